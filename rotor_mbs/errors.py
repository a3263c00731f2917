"""Define the error classes of the package, and functions that make text for messages.

This module imports no other module of the package.
"""

from __future__ import annotations

import traceback
from collections.abc import Iterable, Iterator
from contextlib import contextmanager


class RotorError(Exception):
    """Base class of the errors that this package raises.

    The message has one line per error.
    """


class InputError(RotorError):
    """Raised for invalid input.

    The message has one line per error: file, line, key, what is wrong, what is allowed. The command
    line prints the lines and ends with exit status 2.

    Attributes
    ----------
    problems : the lines of the message.
    """

    def __init__(self, problems: str | Iterable[str]) -> None:
        self.problems: tuple[str, ...] = (
            (problems,) if isinstance(problems, str) else tuple(problems)
        )
        super().__init__("\n".join(self.problems))


class MethodRefusal(RotorError):
    """Raised if a method cannot represent a scene or is not installed.

    The message says what is allowed.
    """


class ResourceError(RotorError):
    """Raised if the system lacks memory, processes or open files; the run is not the cause."""


# Errors that are raised if the system lacks something: memory, a file, a library. Such an error is
# not a result of a run.
SYSTEM_ERRORS = (MemoryError, OSError, ImportError, ResourceError)


class StoreError(RotorError):
    """Raised if a results file cannot be read or written.

    The message has the file and the reason.
    """


class PlausibilityWarning(UserWarning):
    """Issued for a number valid but implausible: perhaps in degrees, millimetres or tonnes."""


@contextmanager
def system_errors_apart(*others: type[Exception]) -> Iterator[None]:
    """Replace every error in the block that the system causes by one of SYSTEM_ERRORS.

    A library that cannot be loaded may raise an error of any type. For example, NumPy raises
    ValueError for an invalid SOURCE_DATE_EPOCH. An engine may replace a system error by an error of
    its own type. In both cases the error says nothing about the run.

    Parameters
    ----------
    *others : types of errors that are passed on unchanged, even if raised during an import.

    Raises
    ------
    ImportError
        If an error is raised while a module is being imported.
    ResourceError
        If an error has one of SYSTEM_ERRORS as its cause.
    """
    passing: tuple[type[Exception], ...] = (RotorError, *SYSTEM_ERRORS, *others)
    try:
        yield
    except passing:
        raise
    except Exception as exc:
        if _was_importing(exc):
            raise ImportError(one_line(exc)) from exc
        if isinstance(exc.__cause__, SYSTEM_ERRORS):
            raise ResourceError(f"{one_line(exc)} ({one_line(exc.__cause__)})") from exc
        raise


def _was_importing(error: BaseException) -> bool:
    """Return whether an error passed through the code of a module that was being imported."""
    for frame, _ in traceback.walk_tb(error.__traceback__):
        # Code that `exec` runs has the name <module>, too, but usually not the module's file name.
        if frame.f_code.co_name == "<module>" and frame.f_code.co_filename == frame.f_globals.get(
            "__file__"
        ):
            return True
    return False


def shown_value(value: object) -> str:
    """Return a value for a message: its representation in ASCII, of at most 60 characters."""
    try:
        text = ascii(value)
    except ValueError:  # Python does not convert whole numbers of more than 4300 digits
        text = "a number of too many digits"
    return text if len(text) <= 60 else f"{text[:57]}..."


# Codes of the control characters (C0, DEL and C1) and of the marks that change the direction of
# writing.
_CONTROLS = (
    *range(0x20),
    *range(0x7F, 0xA0),
    *range(0x200E, 0x2010),
    *range(0x202A, 0x202F),
    *range(0x2066, 0x206A),
)
_ESCAPES = {code: ascii(chr(code))[1:-1] for code in _CONTROLS if chr(code) not in "\t\n"}


def printable(text: str) -> str:
    r"""Return the text with its control characters escaped, except tab and line feed.

    >>> printable("\x1b[2J")
    '\\x1b[2J'
    """
    return text.translate(_ESCAPES)


def one_line(error: BaseException) -> str:
    """Return the type of an exception and the first line of its text."""
    text = str(error).strip().splitlines()
    return f"{type(error).__name__}: {text[0] if text else 'no message'}"


def nearest(name: str, known: Iterable[str]) -> str:
    """Return ", perhaps NAME" with the most similar known name, or "" if no name is similar.

    Parameters
    ----------
    name : a name that may be misspelt; its first 80 characters are used.
    known : the known names. `name` is also compared with the part after the last "/" of each.

    >>> names = ["lagrange/taylor", "lagrange/radau"]
    >>> nearest("tailor", names), nearest("euler", names[:1])
    (', perhaps lagrange/taylor', '')
    """
    import difflib  # used only after a mistake; without it `rotor-mbs list` starts faster

    by_text = {one: one for one in known}
    # "rk67" may mean "exudyn_tree/rk67"
    by_text |= {one.rpartition("/")[2]: one for one in reversed(by_text)}
    near = difflib.get_close_matches(name[:80], by_text, n=1)
    return f", perhaps {by_text[near[0]]}" if near else ""
