"""The command line: the only layer that knows all the others. Loads a command's code when that command is given.

Standard output and standard error are plain: a title or a message that comes from a file may have escape sequences, and
a closed standard error must not end a batch.
"""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
from argparse import Namespace
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from typing import Any, TextIO

from rotor_mbs.errors import InputError, MethodRefusal, RotorError, StoreError

EXIT_OK, EXIT_FAILED, EXIT_BAD_INPUT, EXIT_INTERRUPTED = 0, 1, 2, 130
# Commands that only print: a reader who has seen enough (`rotor-mbs list | head`) has missed nothing.
_ONLY_PRINT = ("list", "show")

# C0 but for tab and line feed, DEL, C1, and the marks that change the direction of writing.
_CONTROLS = (*range(0x20), *range(0x7F, 0xA0), *range(0x200E, 0x2010), *range(0x202A, 0x202F), *range(0x2066, 0x206A))
_received: list[int] = []  # signals that this call was to end by
_SHOWN = {code: ascii(chr(code))[1:-1] for code in _CONTROLS if chr(code) not in "\t\n"}


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
    """Inside compiled code of a library, or while it loads, an interrupt becomes another error, or its cause."""
    found: BaseException | None = error
    while found is not None and not isinstance(found, KeyboardInterrupt):
        found = found.__cause__ or found.__context__
    return found is not None or bool(_received)


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

    def interrupt(number: int, _frame: object) -> None:
        _received.append(number)
        raise KeyboardInterrupt

    def interrupt_again(ignored: sys.UnraisableHookArgs) -> None:
        """One that came where Python ignores exceptions, as in a weak reference's callback, comes a moment later."""
        if isinstance(ignored.exc_value, KeyboardInterrupt):
            threading.Timer(0.01, _thread.interrupt_main).start()
        else:
            hook(ignored)

    hook, sys.unraisablehook = sys.unraisablehook, interrupt_again
    _received.clear()
    names = ("SIGINT", "SIGTERM", "SIGHUP")
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    # One that is ignored (nohup) stays so.
    usual = (signal.SIG_DFL, signal.default_int_handler)
    before = {one: signal.signal(one, interrupt) for one in numbers if signal.getsignal(one) in usual}
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for number, handler in before.items():
            signal.signal(number, handler)


def printable(text: str) -> str:
    r"""The text with every control character but tab and line feed as its escape.

    >>> printable("\x1b[2J")
    '\\x1b[2J'
    """
    return text.translate(_SHOWN)


class PlainStream:
    """A text stream that writes control characters as their escapes; `unfiltered` is the stream itself."""

    def __init__(self, stream: TextIO) -> None:
        self.unfiltered = stream

    def write(self, text: str) -> int:
        self.unfiltered.write(printable(text))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.unfiltered, name)


@contextmanager
def plain_streams() -> Iterator[None]:
    """In the block, standard output and standard error are plain; one that is closed is a device that takes all."""
    before = sys.stdout, sys.stderr
    with ExitStack() as stack:
        streams: list[TextIO] = [one or stack.enter_context(open(os.devnull, "w")) for one in before]  # noqa: PTH123  (a device)
        sys.stdout, sys.stderr = (PlainStream(stream) for stream in streams)
        try:
            yield
        finally:
            sys.stdout, sys.stderr = before


def show(text: str, stream: TextIO) -> None:
    """Prints a line of which nothing depends: where nobody reads it any more, or the disk is full, it is dropped."""
    with suppress(OSError, ValueError):
        print(text, file=stream, flush=True)


def drop_what_is_left() -> None:
    """After a failed write: what is still in the buffer must not fail again when the interpreter ends."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.__stdout__.fileno())  # type: ignore[union-attr]
