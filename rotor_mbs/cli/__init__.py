"""The command line: the only layer that knows all the others. Loads a command's code when that command is given."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from argparse import Namespace
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from rotor_mbs.cli.streams import drop_what_is_left, plain_streams, show
from rotor_mbs.errors import InputError, MethodRefusal, RotorError, StoreError

EXIT_OK, EXIT_FAILED, EXIT_BAD_INPUT, EXIT_INTERRUPTED = 0, 1, 2, 130
# Commands that only print: a reader who has seen enough (`rotor-mbs list | head`) has missed nothing.
_ONLY_PRINT = ("list", "show")


def main(argv: Sequence[str] | None = None) -> int:
    """Runs a command; returns the exit status of the contract (0, 1, 2, 130)."""
    words = sys.argv[1:] if argv is None else list(argv)
    with plain_streams():
        try:
            with _ended_in_order():
                status = _run(words)
            sys.stdout.flush()
        except (KeyboardInterrupt, SystemError, ImportError) as exc:
            if not _is_interrupt(exc):  # without memory for a library, its loading raises either
                show(f"code cannot be loaded: {type(exc).__name__}: {exc}", sys.stderr)
                return EXIT_FAILED
            show("interrupted; what was finished is kept, the same command goes on from there", sys.stderr)
            return EXIT_INTERRUPTED
        except BrokenPipeError:
            drop_what_is_left()
            return EXIT_OK if words[:1] and words[0] in _ONLY_PRINT else EXIT_FAILED
        except OSError as exc:
            drop_what_is_left()
            show(f"{exc.filename or 'standard output'}: {exc.strerror or exc}", sys.stderr)
            return EXIT_BAD_INPUT if exc.filename else EXIT_FAILED
        return status


def _is_interrupt(error: BaseException) -> bool:
    """Inside compiled code of a library, or while it loads, an interrupt becomes the cause of another error."""
    found: BaseException | None = error
    while found is not None and not isinstance(found, KeyboardInterrupt):
        found = found.__cause__ or found.__context__
    return found is not None


def _run(words: Sequence[str]) -> int:
    from rotor_mbs.cli.arguments import parse

    arguments: Namespace = parse(words)
    try:
        return int(arguments.command(arguments))
    except RotorError as exc:
        if _is_interrupt(exc):
            raise KeyboardInterrupt from exc
        show(str(exc), sys.stderr)
        return EXIT_BAD_INPUT if isinstance(exc, InputError | MethodRefusal | StoreError) else EXIT_FAILED
    except MemoryError as exc:
        show(f"not enough memory: {exc}" if str(exc) else "not enough memory", sys.stderr)
        return EXIT_FAILED


@contextmanager
def _ended_in_order() -> Iterator[None]:
    """SIGTERM, as a cluster sends it before it kills, and SIGHUP, of a terminal that is closed, end as Ctrl-C does."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(_number: int, _frame: object) -> None:
        raise KeyboardInterrupt

    def interrupt_again(ignored: sys.UnraisableHookArgs) -> None:
        """One that came where Python ignores exceptions, as in a weak reference's callback, comes a moment later."""
        if isinstance(ignored.exc_value, KeyboardInterrupt):
            threading.Timer(0.01, _thread.interrupt_main).start()
        else:
            hook(ignored)

    hook, sys.unraisablehook = sys.unraisablehook, interrupt_again
    names = ("SIGTERM", "SIGHUP")
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    # One that is ignored (nohup) stays so.
    before = {one: signal.signal(one, interrupt) for one in numbers if signal.getsignal(one) is signal.SIG_DFL}
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for number, handler in before.items():
            signal.signal(number, handler)
