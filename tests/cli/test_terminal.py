"""Progress and tables on a terminal and in a log; interrupts; output without a reader, and a full
one."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from support.commands import PROGRAM, rotor_mbs
from support.scenes import paper
from support.stored import Made, rotor, store
from support.sweeps import THREE_RUNS

from rotor_mbs.analysis.text_tables import table_of_runs
from rotor_mbs.errors import InputError, MethodRefusal
from rotor_mbs.runs.progress import ProgressLine, coloured
from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.runner import RunOutcome
from rotor_mbs.runs.sweeps import StoredSweep


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def outcome(method: str = "lagrange/dop853", share: float = 0.5, **result: object) -> RunOutcome:
    return RunOutcome(f"paper/fig05 {method}", method, **{"status": "ok", **result}, share=share)  # type: ignore[arg-type]


def test_a_log_has_a_plain_line_for_each_case() -> None:
    log = io.StringIO()
    with ProgressLine(log) as progress:
        progress(1, 2, outcome("reference", is_shipped=True))
        progress(2, 2, outcome(status="diverged", message="not finite", seconds=1.5))
    assert log.getvalue().splitlines() == [
        "[1/2] paper/fig05 reference ok (read, not computed)",
        "[2/2] paper/fig05 lagrange/dop853 diverged 1.500 s: not finite",
    ]


def test_a_terminal_shows_the_share_of_the_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    screen = Terminal()
    with ProgressLine(screen) as progress:
        progress(1, 100, outcome(share=0.25))
        assert " 25%, about" in screen.getvalue()
        # wider than any terminal: kept whole
        progress(2, 100, outcome(status="diverged", message="x" * 200))
    assert "x" * 200 in screen.getvalue()
    assert "\x1b[31mdiverged\x1b[0m" in screen.getvalue()
    # of a completed run nothing is claimed: neither a success nor a failure
    assert coloured("ok, completed", screen) == "\x1b[32mok\x1b[0m, \x1b[39mcompleted\x1b[0m"


def _ends_by(patch: pytest.MonkeyPatch, action: Callable[[], object]) -> tuple[int, str]:
    """Status and errors of a command in which `action` takes the place of its first step."""
    patch.setattr("rotor_mbs.cli.runs.find_scenes", lambda *_: action())
    ended = rotor_mbs("run", "paper/fig03")
    return ended.status, ended.err


@pytest.mark.parametrize("error", [SystemError, ImportError, MethodRefusal])
def test_an_interrupt_inside_compiled_code_is_an_interrupt(
    error: type[Exception], monkeypatch: pytest.MonkeyPatch
) -> None:
    """h5py's locks make a SystemError of it, loading an engine an ImportError, which may be taken
    for a lack.

    Without an interrupt, code that cannot be loaded (where there is no memory for a library, for
    example) is one line.
    """

    def fail(cause: BaseException | None = None) -> None:
        raise error("failed to map segment") from cause

    status, errors = _ends_by(monkeypatch, partial(fail, KeyboardInterrupt()))
    assert status == 130
    assert errors.startswith("interrupted; ")
    if error is not MethodRefusal:
        line = f"code cannot be loaded: {error.__name__}: failed to map segment\n"
        assert _ends_by(monkeypatch, fail) == (1, line)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupt_that_becomes_another_error_without_a_trace(
    number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """NumPy's own loading: PyCapsule_Import("datetime") forgets why the import failed."""
    # as nohup does with SIGHUP, which then is not the command's
    if signal.getsignal(number) == signal.SIG_IGN:
        pytest.skip("the signal is ignored here")

    def interrupted() -> None:
        with suppress(KeyboardInterrupt):
            signal.raise_signal(number)
        raise ImportError("PyCapsule_Import could not import module")

    assert _ends_by(monkeypatch, interrupted)[0] == 130


def test_an_interrupt_where_python_ignores_exceptions_comes_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Interrupted:
        def __del__(self) -> None:
            raise KeyboardInterrupt

    def interrupted() -> list[object]:
        Interrupted()
        time.sleep(30.0)  # broken off at once
        return []

    assert _ends_by(monkeypatch, interrupted)[0] == 130


def test_an_interrupt_that_comes_again_after_the_command_leaves_its_caller_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Interrupted:
        def __del__(self) -> None:
            raise KeyboardInterrupt

    def interrupted() -> list[object]:
        Interrupted()
        raise InputError("no such scene")

    status, errors = _ends_by(monkeypatch, interrupted)
    time.sleep(0.1)  # the interrupt comes again after 10 ms
    assert (status, errors) == (2, "no such scene\n")


@pytest.mark.parametrize(("words", "status"), [(("list",), 0), (("new", "mine.toml"), 1)])
def test_a_closed_pipe_is_no_success_but_of_a_command_that_only_prints(
    words: tuple[str, ...], status: int
) -> None:
    """As by `| true`."""
    reading, writing = os.pipe()
    os.close(reading)
    try:
        assert (
            subprocess.run([*PROGRAM, *words], stdout=writing, stderr=subprocess.DEVNULL).returncode
            == status
        )
    finally:
        os.close(writing)


@pytest.mark.full
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="fills standard output as Linux does")
def test_full_output_and_closed_errors_lose_no_run(folder: Path) -> None:
    Path("s.toml").write_text(THREE_RUNS)
    command = [*PROGRAM, "sweep", "s.toml", "-o", "o.h5", "-j", "1"]
    # no summary
    assert (
        subprocess.run(["sh", "-c", 'exec "$@" 2>&- > /dev/full', "sh", *command]).returncode == 1
    )
    assert StoredSweep(folder / "o.h5").column("status").tolist() == [0, 0, 0]


GOOD, BAD = "lagrange/dop853", "exudyn_tree/rk67"


def test_a_row_for_each_run_and_of_many_runs_one_for_each_method(tmp_path: Path) -> None:
    runs = []
    for i in range(14):
        scene = replace(
            paper("fig05"), name=f"paper/s{i}", samples=11, outputs=("angles", "rates", "energy")
        )
        runs += [Made(scene, "reference", rotor(np.sin), versions={"frozen_with": "1.0"})]
        runs += [
            Made(scene, GOOD, rotor(lambda t: np.sin(t) + 1e-9), attributes={"defect_max": 3e-12})
        ]
        runs += [
            Made(scene, BAD, rotor(lambda t: np.sin(t) + 0.25), attributes={"status": "inaccurate"})
        ]
    with open_results(store(tmp_path / "r.h5", runs)) as results:
        few = table_of_runs(results.scenes, {"paper/s0": [GOOD, BAD], "not there": [GOOD]})
        many = table_of_runs(results.scenes, {name: [GOOD, BAD] for name in results.scenes})
    assert few.rows == [
        # shipped, and no error against itself
        ("paper/s0", "reference", "ok", "", "", "", "", "0.0e+00", "read"),
        ("paper/s0", GOOD, "ok", "3.0e-12", "", "1.0e-09", "12 of 12 s", "0.0e+00", "0.002"),
        ("paper/s0", BAD, "inaccurate", "", "", "2.5e-01", "12 of 12 s", "0.0e+00", "0.002"),
    ]
    assert many.rows == [  # with the largest of those that are ok
        (GOOD, "14 of 14 ok", "3.0e-12", "1.0e-09", "0.0e+00", "0.002"),
        (BAD, "0 of 14 ok", "", "", "", "0.002"),
    ]
