"""What can go wrong, as typed errors that carry what was being done. Knows nothing of the rest."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class RotorError(Exception):
    """Base class of the errors that this package raises. The message has one line per error."""


class InputError(RotorError):
    """Raised for invalid input. One line per error: file, line, key, what is wrong, what is allowed.

    The command line prints the lines and ends with exit status 2.
    """

    def __init__(self, problems: str | Iterable[str]) -> None:
        self.problems: tuple[str, ...] = (problems,) if isinstance(problems, str) else tuple(problems)
        super().__init__("\n".join(self.problems))


class MethodRefusal(RotorError):
    """Raised if a method cannot represent a scene or is not installed. The message says what is allowed."""


class ResourceError(RotorError):
    """Raised if the system lacks memory, processes or open files, independently of the run."""


# What the machine lacks: an error of these is no result of a run.
OF_THE_MACHINE = (MemoryError, OSError, ImportError, ResourceError)


class StoreError(RotorError):
    """Raised if a results file cannot be read or written. The message has the file and the reason."""


class PlausibilityWarning(UserWarning):
    """Issued for a number that is valid but implausible, such as degrees, millimetres or tonnes."""


def one_line(error: BaseException) -> str:
    """The type of an exception and the first line of its text."""
    text = str(error).strip().splitlines()
    return f"{type(error).__name__}: {text[0] if text else 'no message'}"


def nearest(name: str, known: Iterable[str]) -> str:
    """ ", perhaps NAME" with the one of `known` that a misspelt `name` may mean, or "" where none is near.

    >>> nearest("tailor", ["lagrange/taylor", "lagrange/radau"]), nearest("euler", ["lagrange/taylor"])
    (', perhaps lagrange/taylor', '')
    """
    by_text = {one: one for one in known}
    by_text |= {one.rpartition("/")[2]: one for one in reversed(by_text)}  # "rk67" may mean "exudyn_tree/rk67"
    near = difflib.get_close_matches(name[:80], by_text, n=1)
    return f", perhaps {by_text[near[0]]}" if near else ""
