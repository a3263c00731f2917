"""Run a command of the command line, and turn errors and interrupts into its exit status.

Control characters in standard output and standard error are escaped, because a title or a message
from a file may contain escape sequences. A closed standard error does not end a command.
"""

from __future__ import annotations

import _thread
import atexit
import importlib
import io
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TextIO

from rotor_mbs.errors import (
    InputError,
    MethodRefusal,
    PlausibilityWarning,
    RotorError,
    StoreError,
    printable,
    system_errors_apart,
)

if TYPE_CHECKING:
    import argparse

EXIT_OK, EXIT_FAILED, EXIT_BAD_INPUT, EXIT_INTERRUPTED = 0, 1, 2, 130
# Commands that only print. They do not fail if the reader closes the pipe, as in
# `rotor-mbs list | head`.
_ONLY_PRINT = ("list", "show")

_received_signals: list[int] = []  # numbers of the signals that interrupted this call


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command, and return its exit status.

    Parameters
    ----------
    argv : the words after `rotor-mbs`; by default those with which this process was started.

    Returns
    -------
    int
        0 success; 1 a check failed or a run did not succeed; 2 bad input; 130 interrupted.
    """
    if argv is not None:
        return _run(list(argv))
    # If PYTHONINSPECT is set, Python shows a SystemExit as a traceback, and waits for input before
    # it ends. Worker processes, which inherit the variable, would do the same.
    is_inspected = bool(os.environ.pop("PYTHONINSPECT", ""))
    try:
        status = _run(sys.argv[1:])
    except SystemExit as exc:  # raised by the argument parser
        if not is_inspected:
            raise
        status = exc.code if isinstance(exc.code, int) else EXIT_OK
    if is_inspected:
        _end_process(status)
    return status


def _end_process(status: int) -> NoReturn:
    """Run the exit functions of this process, and end it without a SystemExit."""
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, OSError, ValueError):
            stream.flush()
    os._exit(status)


def _run(words: list[str]) -> int:
    """Run a command, and return its exit status.

    Parameters
    ----------
    words : the command and its arguments.
    """
    with plain_streams(), _without_invalid_date():
        try:
            with _signals_as_interrupts(), warnings.catch_warnings(), system_errors_apart():
                warnings.simplefilter("always", PlausibilityWarning)
                warnings.showwarning = _print_warning
                # These functions are imported inside the `try` block: an interrupt or a lack of
                # memory during the import is then handled as if it occurred during the command.
                from rotor_mbs.cli.arguments import load_methods, parse

                arguments = parse(words)
                load_methods(arguments)
                _prepare_reading(arguments)
                # `arguments.command` is "module:function", see `parse`.
                module, _, function = arguments.command.partition(":")
                command = getattr(importlib.import_module(f"rotor_mbs.cli.{module}"), function)
                status = int(command(arguments))
            # Writing the rest of the buffer may fail, too.
            sys.stdout.flush()
            if isinstance(sys.stdout, PlainStream) and sys.stdout.failure is not None:
                raise sys.stdout.failure
            return status
        except (KeyboardInterrupt, RotorError, SystemError, ImportError) as exc:
            if _is_interrupt(exc):
                print_line(
                    "interrupted; finished runs are stored, the same command continues", sys.stderr
                )
                return EXIT_INTERRUPTED
            if isinstance(exc, RotorError):
                print_line(str(exc), sys.stderr)
                is_bad_input = isinstance(exc, InputError | MethodRefusal | StoreError)
                return EXIT_BAD_INPUT if is_bad_input else EXIT_FAILED
            # If there is not enough memory for a library, its import raises a SystemError or an
            # ImportError.
            print_line(f"code cannot be loaded: {type(exc).__name__}: {exc}", sys.stderr)
            return EXIT_FAILED
        except MemoryError as exc:
            print_line(f"not enough memory: {exc}" if str(exc) else "not enough memory", sys.stderr)
            return EXIT_FAILED
        except BrokenPipeError:
            only_prints = bool(words) and words[0] in _ONLY_PRINT
            return EXIT_OK if only_prints else EXIT_FAILED
        except OSError as exc:
            print_line(f"{exc.filename or 'standard output'}: {exc.strerror or exc}", sys.stderr)
            return EXIT_BAD_INPUT if exc.filename else EXIT_FAILED


def _prepare_reading(arguments: argparse.Namespace) -> None:
    """Start the worker process of `runs.untrusted` if an argument names a file of this program.

    The worker process reads the file. It loads its code while this process loads the code of the
    command.

    Parameters
    ----------
    arguments : parsed arguments of a command. `file` or `scene` may name a file that this program
        wrote.
    """
    name = getattr(arguments, "file", None) or getattr(arguments, "scene", None)
    if not isinstance(name, str | os.PathLike):
        return
    from rotor_mbs.runs.trailer import is_of_this_program

    with suppress(OSError):  # the command reports a file that cannot be read
        if is_of_this_program(Path(name)):
            from rotor_mbs.runs.untrusted import prepare_reading

            prepare_reading()


@contextmanager
def _without_invalid_date() -> Iterator[None]:
    """Remove a SOURCE_DATE_EPOCH that is not a number from the environment in the block.

    SciPy and a part of NumPy cannot be imported while the variable has such a value.
    """
    date = os.environ.get("SOURCE_DATE_EPOCH")
    if date is None or date.isdecimal():
        yield
        return
    del os.environ["SOURCE_DATE_EPOCH"]
    try:
        yield
    finally:
        os.environ["SOURCE_DATE_EPOCH"] = date


def _print_warning(message: Warning | str, category: type[Warning], *where: Any, **_: Any) -> None:
    """Print a warning: a PlausibilityWarning in one line, others as Python shows them.

    The parameters are those of `warnings.showwarning`; `where` begins with the file name and the
    line number.
    """
    if issubclass(category, PlausibilityWarning):
        text = f"warning: {message}"
    else:
        text = warnings.formatwarning(message, category, *where[:2])
    print_line(text.rstrip(), sys.stderr)


def _is_interrupt(error: BaseException) -> bool:
    """Return whether an error was caused by an interrupt.

    An interrupt inside compiled code or during an import may raise another error. The
    KeyboardInterrupt may or may not be the cause of that error.
    """
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, KeyboardInterrupt):
            return True
        cause = cause.__cause__ or cause.__context__
    return bool(_received_signals)


def _signal_main_thread(number: signal.Signals) -> None:
    """Send a signal to the main thread.

    Except on Windows, the signal also ends a system call of that thread early, such as a sleep.
    """
    handler = signal.getsignal(number)
    if not callable(handler) or handler is signal.default_int_handler:
        # The command has ended, and its handler is removed. The signal would end the process, or
        # interrupt what the caller of the command does next.
        return
    if hasattr(signal, "pthread_kill"):
        main_thread_id = threading.main_thread().ident
        assert main_thread_id is not None  # None only before a thread starts
        signal.pthread_kill(main_thread_id, number)
    else:  # Windows: a system call of the main thread is not broken off
        _thread.interrupt_main(number)


@contextmanager
def _signals_as_interrupts() -> Iterator[None]:
    """Raise KeyboardInterrupt in the block on SIGTERM and SIGHUP, as on Ctrl-C.

    A cluster sends SIGTERM before it kills a process; a terminal sends SIGHUP when it is closed.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(number: int, _frame: object) -> None:
        _received_signals.append(number)
        raise KeyboardInterrupt

    def interrupt_again(unraisable: sys.UnraisableHookArgs) -> None:
        """Send the signal of an interrupt again after 10 ms if Python ignored the exception.

        For example, Python ignores exceptions in the callback of a weak reference.
        """
        if isinstance(unraisable.exc_value, KeyboardInterrupt):
            number = signal.SIGINT
            if _received_signals:
                number = signal.Signals(_received_signals[-1])
            threading.Timer(0.01, _signal_main_thread, [number]).start()
        else:
            earlier_hook(unraisable)

    earlier_hook = sys.unraisablehook
    sys.unraisablehook = interrupt_again
    _received_signals.clear()
    handlers = {}
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)  # Windows has no SIGHUP
        # A signal that is ignored, as SIGHUP is under nohup, stays ignored.
        if number is not None and signal.getsignal(number) in (
            signal.SIG_DFL,
            signal.default_int_handler,
        ):
            handlers[number] = signal.signal(number, interrupt)
    try:
        yield
    finally:
        sys.unraisablehook = earlier_hook
        for number, handler in handlers.items():
            signal.signal(number, handler)


class PlainStream:
    """A text stream that escapes control characters, and accepts text after a failed write.

    Attributes
    ----------
    unfiltered : the stream to which the text is written.
    failure : the first error in writing, such as BrokenPipeError, or None. All text after this
        error is dropped without another error. The command thus completes its work, and afterwards
        `_run` raises the failure of standard output.
    """

    def __init__(self, stream: TextIO) -> None:
        self.unfiltered = stream
        self.failure: OSError | None = None

    def write(self, text: str) -> int:
        """Write a text with its control characters escaped."""
        self.write_unfiltered(printable(text))
        return len(text)

    def write_unfiltered(self, text: str) -> None:
        """Write a text without escaping its control characters."""
        with self._kept_failure():
            self.unfiltered.write(text)

    def flush(self) -> None:
        """Flush the stream."""
        with self._kept_failure():
            self.unfiltered.flush()

    @contextmanager
    def _kept_failure(self) -> Iterator[None]:
        """Store the first OSError of the block in `failure`, and drop all text after it."""
        try:
            yield
        except OSError as exc:
            self.failure = self.failure or exc
            discard_output(self.unfiltered)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.unfiltered, name)


@contextmanager
def plain_streams() -> Iterator[None]:
    """Replace standard output and standard error in the block by PlainStream objects.

    A closed stream is replaced by the null device. A character that the stream's encoding lacks,
    such as ° in ASCII, is written as an escape.
    """
    with open(os.devnull, "w") as null, ExitStack() as stack:  # noqa: PTH123  (a device)
        for redirect, stream in ((redirect_stdout, sys.stdout), (redirect_stderr, sys.stderr)):
            if isinstance(stream, io.TextIOWrapper):
                stack.callback(stream.reconfigure, errors=stream.errors)
                stream.reconfigure(errors="backslashreplace")
            stack.enter_context(redirect(PlainStream(stream or null)))
        yield


def print_line(text: str, stream: TextIO) -> None:
    """Print a line, and ignore errors such as a closed stream or a full disk."""
    with suppress(OSError, ValueError):
        print(text, file=stream, flush=True)


def discard_output(stream: TextIO) -> None:
    """Redirect a stream to the null device after a failed write.

    Without this, the interpreter would fail again when it ends, as it then writes the text that is
    left in the stream's buffer.
    """
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
