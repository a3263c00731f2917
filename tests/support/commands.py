"""The command line, called in this process; and as a process of its own, for tests of signals and
streams."""

from __future__ import annotations

import contextlib
import io
import sys
from typing import Any, NamedTuple
from unittest import mock

from rotor_mbs.cli import main
from rotor_mbs.processes import pool

PROGRAM = [sys.executable, "-m", "rotor_mbs"]


class Ended(NamedTuple):
    """Exit status of a command, what it wrote to standard output and to standard error."""

    status: int
    out: str
    err: str


def rotor_mbs(*words: object, processes: bool = False) -> Ended:
    """Call a command in this process.

    What `-j 1` would give to a worker process is done here, too, unless a test is about processes:
    to start one and load the engines takes longer than most runs of tests.
    """
    out, err = io.StringIO(), io.StringIO()
    workers = (
        contextlib.nullcontext()
        if processes
        else mock.patch.object(pool, "WorkerPool", _pool_without_process)
    )
    with workers, contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = main([str(word) for word in words])
        except SystemExit as exc:  # of the argument parser
            status = int(str(exc.code))
    assert "Traceback" not in err.getvalue()
    return Ended(status, out.getvalue(), err.getvalue())


def _pool_without_process(workers: int, *arguments: Any, **options: Any) -> pool.TaskPool:
    return pool.SerialPool() if workers == 1 else _WorkerPool(workers, *arguments, **options)


_WorkerPool = pool.WorkerPool


def refusal(*words: object) -> str:
    """The line of a command that ends with status 2."""
    ended = rotor_mbs(*words)
    assert ended.status == 2, ended
    (line,) = ended.err.splitlines()
    return line
