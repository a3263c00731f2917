"""What can go wrong, as typed errors that carry what was being done. Knows nothing of the rest."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class RotorError(Exception):
    """Base of every error this package raises on purpose; its text is one readable line (or several)."""


class InputError(RotorError):
    """Bad input: one line per fault, each naming file (and line), key, what is wrong, what is allowed.

    The command line prints the lines and ends with exit status 2.
    """

    def __init__(self, problems: str | Iterable[str]) -> None:
        self.problems: tuple[str, ...] = (problems,) if isinstance(problems, str) else tuple(problems)
        super().__init__("\n".join(self.problems))


class MethodRefusal(RotorError):
    """A method that cannot represent this scene, or is not installed here; says what is allowed or how to get it."""


class ResourceError(RotorError):
    """The machine lacks what a run needs (memory, processes, open files); it says nothing about the run."""


# What the machine lacks: an error of these is no result of a run.
OF_THE_MACHINE = (MemoryError, OSError, ImportError, ResourceError)


class StoreError(RotorError):
    """A results file that cannot be read or written; names the file and the reason."""


class PlausibilityWarning(UserWarning):
    """A number that is allowed, and yet looks like a slip: degrees, millimetres, tonnes."""


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
