"""For all tests: signals arrive, compiled code stays out of the user's cache; a results file to
read."""

from __future__ import annotations

import os
import pickle
import signal
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

import pytest

# A CI runner or `nohup ... &` may have them ignored, which processes inherit: a test of signals
# would wait in vain.
for name, default in {"SIGINT": signal.default_int_handler, "SIGHUP": signal.SIG_DFL}.items():
    number = getattr(signal, name, None)  # SIGHUP: not on Windows
    if number is not None and signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, default)

# The mutants alone leave hundreds of integrators, and every process that compiles reads through all
# that is there: 0.08 s with 240 MB. heyoka looks for its cache here when it is first imported.
os.environ["XDG_CACHE_HOME"] = str(Path(__file__).parents[1] / ".pytest_cache" / "compiled")


@pytest.fixture(scope="session")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A results file of two scenes of the paper by two methods and their references, made once; for
    reading only."""
    from support.checking import results_file  # late: it loads the engines

    scenes, methods = ("paper/fig08", "paper/fig11"), ("lagrange/dop853", "exudyn_tree/rk67")
    path = results_file(tmp_path_factory.mktemp("results") / "results.h5", scenes, methods)
    path.chmod(0o444)
    return path


class _WorkerHere:
    """A worker that calls its functions in this process; their results are pickled all the same."""

    def __init__(self, **_options: object) -> None:
        pass

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def run(self, work: Callable[[Any], Any], task: Any, _timeout_s: float) -> Any:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # as in the process, whose output is dropped
            return pickle.loads(pickle.dumps(work(task)))


@pytest.fixture
def files_read_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Files of other programs are read in this process: to start one that loads pandas takes longer
    than most tests of columns and verdicts."""
    from rotor_mbs.comparison import files  # late: few tests need it

    monkeypatch.setattr(files, "Worker", _WorkerHere)
