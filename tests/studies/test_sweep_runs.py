"""Sweeps end to end: the same bytes with one worker or two, after kills and interrupts; a run that
kills is found."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path
from unittest.mock import patch

import h5py
import numpy as np
import pytest
from support.commands import refusal, rotor_mbs
from support.sweeps import THREE_RUNS, made_sweep, run_local, starts_file

import rotor_mbs as rm
from rotor_mbs.errors import StoreError
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.processes.pool import SerialPool
from rotor_mbs.runs import sweeps
from rotor_mbs.runs.design import MISSING
from rotor_mbs.runs.rows import Rows, text_of
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.runs.table import TableFile
from rotor_mbs.runs.versions import code_digest
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.sweep import load_sweep
from rotor_mbs.solution.metrics import horizon
from rotor_mbs.studies.stored_references import frozen_solution
from rotor_mbs.studies.sweep import Chunk, plan_sweep, run_sweep


def _file(folder: Path, draws: int = 4) -> Path:
    """Starts and springs."""
    path = starts_file(folder, draws, 21, 0.2)
    springs = '[[axis]]\nkey = "bearing.stiffness"\nvalues = [0, 10]\n'
    path.write_text(f"validation = 0.25\n{path.read_text()}{springs}")
    return path


def test_side_by_side_or_not_the_runs_are_the_same(tmp_path: Path) -> None:
    pytest.importorskip("heyoka")
    sweep = load_sweep(_file(tmp_path))
    run_local(sweep, tmp_path / "o.h5", 0, ["lagrange/taylor", "lagrange/dop853"])
    with h5py.File(tmp_path / "o.h5") as file:
        by_taylor, by_dop853 = file["angles"][:8], file["angles"][8:]
        # 0.2 s of fig11 carries an error on tenfold; dop853's tolerance is 3e-14.
        np.testing.assert_allclose(by_taylor, by_dop853, rtol=0.0, atol=1e-11)
        assert file["angles"].chunks is None
        assert file["initial_angles_1"].attrs["units"] == "rad"
        assert set(file["bearing_stiffness"][()].tolist()) == {0.0, 10.0}
        np.testing.assert_array_equal(file["angles"][:, 0, 1], file["initial_angles_1"])
        assert file["variant"][()].tolist() == [*range(8)] * 2
        assert file["method_code"][()].tolist() == [0] * 8 + [1] * 8
        assert file["method_code"].attrs["flag_meanings"].split() == [
            "lagrange/taylor",
            "lagrange/dop853",
        ]
        assert file["split"][()].tolist()[:8] == file["split"][()].tolist()[8:]
        assert file["split"][:8].sum() == 2
        assert (file["energy_drift_max"][()] < 1e-11).all()
        assert file.attrs["seed"] == 0
        assert not {"error_growth", "horizon_s"} & set(file)  # not asked for


_EXTREMES = ("rotor_angle_min", "rotor_angle_max", "rotor_rate_max")


@pytest.mark.parametrize("method", ["lagrange/taylor", "lagrange/dop853", "printed/ode45"])
def test_extremes_of_the_rotor_are_those_of_a_run(method: str) -> None:
    """The rotor swings about -2 rad and stays below zero, so that a magnitude is no maximum."""
    if method == "lagrange/taylor":
        pytest.importorskip("heyoka")
    scene = rm.scene("paper/fig11").replace(duration=0.3, samples=11, **{"initial.rates[0]": -1.0})
    swept = rm.sweep(scene, {"initial.angles[0]": [-2.0]}, methods=[method])[0].metrics
    run = rm.run(scene.replace(**{"initial.angles[0]": -2.0}), method)
    # side by side or not: rounding of 0.3 s
    for name in _EXTREMES:
        assert swept[name] == pytest.approx(run.metrics[name], rel=1e-12)
    assert swept["rotor_angle_max"] < 0.0 < swept["rotor_angle_size_max"]
    assert swept["rotor_angle_size_max"] == -swept["rotor_angle_min"]


def test_a_sweep_whose_maximum_was_a_magnitude_is_refused(tmp_path: Path) -> None:
    columns = dict(sweeps.COLUMNS_OF_A_RUN)
    for name in ("rotor_angle_min", "rotor_angle_size_max"):
        del columns[name]
    with patch.object(sweeps, "COLUMNS_OF_A_RUN", columns):
        path = made_sweep(tmp_path, THREE_RUNS)
    before = path.read_bytes()
    for arguments in (["check", path], ["sweep", tmp_path / "s.toml", "-o", path, "-j", "1"]):
        assert "of an earlier version" in refusal(*arguments)
    with pytest.raises(StoreError, match=r"rotor_angle_min, rotor_angle_size_max: .* version"):
        rm.open(path)
    assert path.read_bytes() == before


def test_a_finished_sweep_makes_nothing_again_and_another_one_is_refused(tmp_path: Path) -> None:
    path, output = _file(tmp_path), tmp_path / "o.h5"
    run_local(load_sweep(path), output, 0)
    before = output.read_bytes()
    ended = rotor_mbs("sweep", path, "-o", output, "--json", "-j", 1)
    end = json.loads(ended.out.splitlines()[-1])
    assert (end["event"], end["runs"], end["made"], end["statuses"]) == ("end", 8, 0, {"ok": 8})
    other = rotor_mbs("sweep", path, "-o", output, "-m", "lagrange/ode45", "-j", 1)
    assert other.status == 2
    assert "not the file of this sweep; allowed: another output file" in other.err
    assert output.read_bytes() == before


def test_parts_of_a_job_array_are_the_slices_of_the_whole(tmp_path: Path) -> None:
    sweep = load_sweep(_file(tmp_path))
    run_local(sweep, tmp_path / "whole.h5", 0)
    whole, parts = StoredSweep(tmp_path / "whole.h5"), []
    for k in (1, 2, 3):
        plan = plan_sweep(sweep, part=(k, 3))
        run_sweep(plan, tmp_path / f"{k}.h5", SerialPool())
        parts.append(StoredSweep(tmp_path / f"{k}.h5"))
    for name in ("run", "angles", "initial_angles_1", "status", "split", "crc32"):
        joined = np.concatenate([part.column(name) for part in parts])
        np.testing.assert_array_equal(joined, whole.column(name), err_msg=name)
    empty = rotor_mbs(
        "sweep", tmp_path / "s.toml", "--part", "1/9", "-o", tmp_path / "empty.h5", "-j", 1
    )
    assert (empty.status, empty.out) == (0, "no runs in this part\n")
    assert not (tmp_path / "empty.h5").exists()


# Rows of other versions, and damaged ones


def test_runs_of_other_versions_are_kept_and_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Here a plug-in whose code is corrected under the same version; fresh: all runs are computed
    again."""
    source, output, sweep = tmp_path / "plug_in.py", tmp_path / "o.h5", load_sweep(_file(tmp_path))
    monkeypatch.setitem(find_method("lagrange/dop853").__dict__, "sources", (source,))

    def swept(code: str, **options: bool) -> tuple[int, int]:
        source.write_text(code)
        code_digest.cache_clear()
        result = run_local(sweep, output, 0, **options)
        return result.made, result.older

    assert swept("STEP = 0.1\n") == (8, 0)
    before = output.read_bytes()
    assert swept("STEP = 0.2\n") == (0, 8)
    assert output.read_bytes() == before
    ended = rotor_mbs("sweep", tmp_path / "s.toml", "-o", output, "-j", 1)
    assert "8 stored runs are from other versions; --fresh recomputes them" in ended.err
    assert swept("STEP = 0.2\n", fresh=True) == (8, 0)
    TableFile(output).tables[""].place().mark_missing([3])
    assert swept("STEP = 0.3\n") == (1, 7)
    monkeypatch.undo()
    code_digest.cache_clear()


class _Killing(Chunk):
    """Run 5 kills its process, wherever it is tried, and leaves a mark each time."""

    def perform(self) -> Rows:
        if self.first <= 5 < self.first + len(self.values):
            with Path(os.environ["ROTOR_TEST_MARKS"]).open("a") as marks:
                marks.write(f"{len(self.values)}\n")
            os.kill(os.getpid(), signal.SIGKILL)
        return super().perform()


@pytest.mark.full
def test_a_run_that_kills_its_worker_is_found_and_the_others_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    marks, output = tmp_path / "marks", tmp_path / "o.h5"
    monkeypatch.setenv("ROTOR_TEST_MARKS", str(marks))
    sweep = load_sweep(_file(tmp_path, draws=16))
    with patch("rotor_mbs.studies.sweep.Chunk", _Killing):
        result = run_local(sweep, output, methods=["lagrange/taylor"], workers=2)
    assert (result.made, result.statuses, result.is_ok) == (31, {"ok": 31}, False)
    (line,) = result.lost
    assert line.startswith("run 5: its process died")
    assert line.endswith("also when it was retried alone")
    assert marks.read_text().split() == ["8", "1"]  # tried with its chunk, then once more, alone
    stored = StoredSweep(output)
    assert stored.column("status")[5] == MISSING
    assert np.isfinite(np.delete(stored.column("angles"), 5, axis=0)).all()
    # The same sweep tries it again; nothing of the machine's trouble stays in the file.
    again = run_local(sweep, output, methods=["lagrange/taylor"], workers=1)
    assert (again.made, again.statuses, again.is_ok, again.lost) == (1, {"ok": 32}, True, ())


def test_a_misspelt_setting_is_one_line_and_no_file(tmp_path: Path) -> None:
    path = _file(tmp_path)
    path.write_text(
        path.read_text().replace("samples", "settings = { tolerence = 1e-15 }\nsamples", 1)
    )
    told = refusal("sweep", path, "-o", tmp_path / "o.h5", "-j", 1)
    assert (
        "s.toml:5: settings: lagrange/dop853: no setting 'tolerence'; allowed: relative_tol" in told
    )
    assert not list(tmp_path.glob("o.h5*"))


def test_a_dry_run_tells_runs_and_size_and_writes_nothing(tmp_path: Path) -> None:
    ended = rotor_mbs(
        "sweep", _file(tmp_path), "-o", tmp_path / "o.h5", "--dry-run", "--json", "-j", 1
    )
    assert ended.status == 0
    facts = json.loads(ended.out)
    assert facts["runs"] == 8
    assert facts["bytes"] >= 8 * 21 * 4 * 8
    assert not list(tmp_path.glob("o.h5*"))


def test_the_longest_message_is_stored_whole(tmp_path: Path) -> None:
    varied = '[[axis]]\nkey = "shaft.damping"\nvalues = [0]\n'
    scene = 'title = "one"\nscene = "extreme/singular-one-blade"\nmethods = ["lagrange/ode45"]\n'
    message = text_of(StoredSweep(made_sweep(tmp_path, scene + varied)).column("message")[0])
    assert message.startswith("with all pitches at ±π/2")
    assert message.endswith(" at time t.")


WITH_GROWTH = """
title = "fig11 and a neighbour"
scene = "paper/fig11"
methods = ["lagrange/taylor", "exudyn_tree/rk67"]
error_growth = true
outputs = []
[[axis]]
key = "gravity"
values = [0, 9.8]
"""


def test_the_error_growth_is_that_of_the_frozen_reference(tmp_path: Path) -> None:
    """Both from double precision variational equations, whose own rounding is far below a
    thousandth."""
    pytest.importorskip("heyoka")
    (scene,) = find_scenes(["paper/fig11"])
    assert scene.gravity == 9.8
    frozen = frozen_solution(scene).trajectory
    path = made_sweep(tmp_path, WITH_GROWTH)
    with h5py.File(path) as file:
        growth, until = file["error_growth"][()], file["horizon_s"][()]
        assert file["horizon_s"].attrs["units"] == "s"
    assert growth[1] == pytest.approx(np.maximum.accumulate(frozen.error_growth)[-1], rel=1e-3)
    assert until[1] == horizon(frozen)
    assert growth[0] < growth[1]
    assert np.array_equal(growth[:2], growth[2:])  # of the motion, not of the method
    run = rm.open(path)[1]
    assert (run.metrics["error_growth"], run.metrics["horizon_s"]) == (growth[1], until[1])
    assert "reached: 10 s of 10 s, 0 samples" in repr(run)
