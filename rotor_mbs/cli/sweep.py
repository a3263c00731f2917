"""`sweep`: starts the workers, which load their code while this process loads its own and reads the file."""

from __future__ import annotations

import argparse
import signal
from collections.abc import Iterator
from contextlib import contextmanager

from rotor_mbs.execution.engines import open_engine
from rotor_mbs.execution.pool import ImportedCall, TaskPool


def sweep(arguments: argparse.Namespace) -> int:
    """A parameter study into one dataset, which any kind of interruption leaves able to go on."""
    with _interruptible(), _engine(arguments) as engine:
        from rotor_mbs.cli.sweep_study import sweep_on

        return sweep_on(engine, arguments)


@contextmanager
def _engine(arguments: argparse.Namespace) -> Iterator[TaskPool]:
    engine = open_engine(arguments.engine, arguments.jobs, ImportedCall("rotor_mbs.studies.sweep_work:prepare"))
    try:
        yield engine
    finally:
        engine.close()


@contextmanager
def _interruptible() -> Iterator[None]:
    """SIGTERM, as a cluster sends before it kills, ends the sweep as Ctrl-C does."""

    def interrupt(_number: int, _frame: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
