"""`rm.check`, `rm.bench`, `rm.test_method`: what the commands find, in Python; and what a
comparison does not load."""

from __future__ import annotations

import gc
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import rotor_mbs as rm
from rotor_mbs.errors import ResourceError
from rotor_mbs.runs.runner import RunOutcome

METHOD = "lagrange/dop853"


@pytest.fixture
def scene() -> rm.Scene:
    return rm.scene("paper/fig03").replace(duration=0.5, samples=51)


def test_checks_of_a_file_are_a_sequence_that_says_what_failed(
    scene: rm.Scene, tmp_path: Path
) -> None:
    path = rm.run(scene, [METHOD]).save(tmp_path / "runs.h5")
    checks = rm.check(path)
    assert checks.passed
    assert {"status", "defect", "tip"} <= {check.name for check in checks}
    table = checks.table()
    assert table.passed.all()
    assert table.value.tolist() == [check.value for check in checks]
    assert table.method.tolist() == [check.where.method for check in checks]
    assert repr(checks) == f"{len(checks)} checks passed, 0 failed"
    missing = rm.check(path, require="exudyn_tree/rk67")
    assert not missing.passed
    assert [check.name for check in missing.failures] == ["required"]
    assert "not in the file" in repr(missing)


def test_bounds_of_ones_own_count(scene: rm.Scene, tmp_path: Path) -> None:
    path = rm.run(scene, [METHOD]).save(tmp_path / "runs.h5")
    bounds = tmp_path / "bounds.toml"
    bounds.write_text(
        '[[bound]]\ncheck = "energy"\nmethod = "*"\nvalue = 1e-30\nreason = "for the test"\n'
    )
    assert "energy" in {check.name for check in rm.check(path, bounds=bounds).failures}


def test_a_bench_measures_a_ladder_and_keeps_it(scene: rm.Scene, tmp_path: Path) -> None:
    path = tmp_path / "bench.h5"
    curves = rm.bench(scene, "exudyn_tree/rk44", output=path, repeats=1, budget=0.5, progress=False)
    assert list(curves) == ["paper/fig03/exudyn_tree/rk44"]
    curve = curves["paper/fig03/exudyn_tree/rk44"]
    assert np.nanmin(curve["angle_error_max"]) < 1e-9
    table = curves.table()
    np.testing.assert_array_equal(table.run_time_s, curve["run_time_s"])
    assert table.attrs["run_time_s"]["units"] == "s"
    assert set(table.status) <= {"ok", "inaccurate", "left_out", "diverged", "solver_failed"}
    again = rm.bench(scene, "exudyn_tree/rk44", output=path, repeats=1, budget=0.5, progress=False)
    np.testing.assert_array_equal(
        again["paper/fig03/exudyn_tree/rk44"]["run_time_s"], curve["run_time_s"]
    )
    with pytest.raises(rm.InputError, match="unknown method"):
        rm.bench(scene, "mujoco/nothing")


@pytest.mark.full
def test_a_method_is_examined() -> None:
    checks = rm.test_method(METHOD)
    assert checks.passed, checks
    assert "determinism" in {check.name for check in checks}


def test_a_comparison_and_a_check_load_no_library_of_pictures_and_pages(tmp_path: Path) -> None:
    code = """
import sys
import rotor_mbs as rm
assert "numpy" not in sys.modules
scene = rm.scene("paper/fig03").replace(duration=0.5, samples=51)
run = rm.run(scene, "lagrange/dop853")
data = {"time": run.time, "angles": run.angles, "rates": run.rates}
assert rm.compare(data, scene).status == "ok"
rm.check(rm.run(scene, ["lagrange/dop853"], workers=0).save(sys.argv[1]))
rm.open(sys.argv[1])
print(sorted({"matplotlib", "jinja2", "pandas", "xarray"} & set(sys.modules)))
"""
    words = [sys.executable, "-c", code, str(tmp_path / "runs.h5")]
    ended = subprocess.run(words, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert ended.stdout == "[]\n", ended.stderr


@pytest.mark.full
def test_curves_without_a_file_live_as_long_as_the_object(scene: rm.Scene, tmp_path: Path) -> None:
    curves = rm.bench(scene, "exudyn_tree/rk44", repeats=1, budget=0.5, progress=False)
    assert curves.path.is_file()
    assert repr(curves).startswith("1 curve of error against run time\n")
    assert str(curves.path) not in curves._repr_html_()
    page = curves.to_html(tmp_path / "pages")
    assert page.is_file()
    folder = curves.path.parent
    del curves
    gc.collect()
    assert not folder.exists()


@pytest.mark.parametrize("repeats", [0, -3])
def test_a_bench_repeats_at_least_once(scene: rm.Scene, repeats: int) -> None:
    with pytest.raises(rm.InputError, match=f"repeats: {repeats}; allowed: a whole number from 1"):
        rm.bench(scene, "exudyn_tree/rk44", repeats=repeats)
    with pytest.raises(TypeError):
        rm.bench(scene, "exudyn_tree/rk44", repeats="many")  # type: ignore[arg-type]


def test_curves_that_were_lost_are_an_error(
    scene: rm.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lose(*_: object, **__: object) -> tuple[list[RunOutcome], list[object]]:
        lost = RunOutcome(
            "paper/fig03 exudyn_tree/rk44",
            "exudyn_tree/rk44",
            "worker_died",
            "no room",
            is_stored=False,
        )
        return [lost], []

    monkeypatch.setattr("rotor_mbs.studies.bench.run_bench", lose)
    with pytest.raises(ResourceError, match="paper/fig03 exudyn_tree/rk44: no room"):
        rm.bench(scene, "exudyn_tree/rk44")


def test_a_results_file_is_opened_without_scipy(scene: rm.Scene, tmp_path: Path) -> None:
    path = rm.run(scene, [METHOD]).save(tmp_path / "runs.h5")
    code = "import sys, rotor_mbs as rm; rm.open(sys.argv[1]); print('scipy' in sys.modules)"
    ended = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, cwd=tmp_path
    )
    assert (ended.stdout, ended.stderr) == ("False\n", "")
