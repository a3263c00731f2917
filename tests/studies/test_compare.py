"""Several methods on one scene as a table, and one run in this process."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from support.references import scene

from rotor_mbs.errors import InputError, MethodRefusal
from rotor_mbs.studies.compare import compare
from rotor_mbs.studies.run import solve_judged

METHODS = ["lagrange/dop853", "exudyn_tree/rk44"]


def test_a_comparison_has_a_row_and_samples_of_each_method(tmp_path: Path) -> None:
    found = compare(scene("paper/fig03"), METHODS, tmp_path / "c.h5")
    assert [row.method for row in found.rows] == METHODS
    for row in found.rows:
        assert row.status == "ok"
        assert row.angle_error_max is not None
        assert row.angle_error_max < 1e-6
        assert row.run_time_s > 0.0
    assert set(found.solutions()) == set(METHODS)
    assert compare(scene("paper/fig03"), METHODS, tmp_path / "c.h5").rows == found.rows  # stored, not computed again


def test_without_an_output_its_file_goes_with_it() -> None:
    found = compare(scene("paper/fig03"), METHODS[:1])
    path = found.file
    assert path.is_file()
    del found
    assert not path.exists()


def test_what_cannot_be_compared_is_refused() -> None:
    with pytest.raises(InputError, match="unknown method"):
        compare(scene("paper/fig03"), ["no/such"])
    with pytest.raises(MethodRefusal):
        compare(scene("extreme/singular-start"))


def test_a_run_without_a_reference_is_judged_by_its_energy_alone() -> None:
    one = replace(scene("paper/fig03"), gravity=5.0, duration=0.5, samples=11)
    run = solve_judged(one, METHODS[0])
    assert run.status == "ok"
    assert "angle_error_max" not in run.metrics
    assert "angle_error_max" in solve_judged(one, METHODS[0], compute_reference=True).metrics
