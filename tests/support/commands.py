"""The command line, called in this process; and as a process of its own, for tests of signals and streams."""

from __future__ import annotations

import contextlib
import io
import sys
from typing import NamedTuple

from rotor_mbs.cli import main

PROGRAM = [sys.executable, "-m", "rotor_mbs"]


class Ended(NamedTuple):
    """Exit status of a command, what it wrote to standard output and to standard error."""

    status: int
    out: str
    err: str


def rotor_mbs(*words: object) -> Ended:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = main([str(word) for word in words])
        except SystemExit as exc:  # of the argument parser
            status = int(str(exc.code))
    assert "Traceback" not in err.getvalue()
    return Ended(status, out.getvalue(), err.getvalue())


def refusal(*words: object) -> str:
    """The line of a command that ends with status 2."""
    ended = rotor_mbs(*words)
    assert ended.status == 2, ended
    (line,) = ended.err.splitlines()
    return line
