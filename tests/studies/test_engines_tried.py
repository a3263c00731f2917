"""Engines with one mistake each fail `test-method` with the right reason or none; right ones of any
order pass."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from support import broken_engines
from support.broken_engines import (
    BROKEN,
    NOT_FOUND,
    RIGHT,
    as_records,
    checks_of_first_scene,
    is_right,
    reasons,
)

from rotor_mbs.analysis.run_checks import Check
from rotor_mbs.methods import catalogue
from rotor_mbs.studies import method_test

# Of which `test-method` tells that they are wrong, and not why.
NOT_NAMED = {
    "n05_loose",
    "p14_pitch_sense_in_gravity",
    "p19_no_coupling_alpha",
    "p20_hub_radius",
}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    catalogue._files.clear()
    catalogue._file_methods.clear()


def method_of(name: str) -> str:
    file = Path(f"{name}.py")
    file.write_text(broken_engines.ENGINES[name].source())
    (method,) = catalogue.check_names(str(file))
    return method


def judge_reasons(name: str, checks: list[Check]) -> None:
    """A broken engine fails; nothing wrong is named, and what is wrong is where that can be."""
    given = reasons(as_records(checks))
    assert given, f"{name} passes"
    verdicts = {reason: is_right(BROKEN[name], reason) for reason in given}
    assert False not in verdicts.values(), verdicts
    assert (True in verdicts.values()) == (name not in NOT_NAMED), verdicts


QUICK = ("r04_tip_no_pitch", "r12_loads_of_blade_1", "r07_rates_in_degrees")


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in QUICK else pytest.mark.full)
        for name in (
            *QUICK,
            "r10_potential_sign",
            "r03_kinetic_without_hub",
            "n04_last_step_short",
            "n06_no_jumps",
        )
    ],
)
def test_a_mistake_is_named_by_the_first_scene(name: str) -> None:
    judge_reasons(name, checks_of_first_scene(name, Path()))


@pytest.mark.full
def test_a_right_engine_passes_the_first_scene() -> None:
    assert [check for check in checks_of_first_scene("rk4", Path()) if not check.passed] == []


@pytest.mark.nightly
@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_engine_fails_with_the_right_reason_or_none(name: str) -> None:
    judge_reasons(name, method_test.examine(method_of(name)))


@pytest.mark.nightly
@pytest.mark.parametrize("name", RIGHT)
def test_a_right_engine_passes_with_its_order(name: str) -> None:
    checks = method_test.examine(method_of(name))
    assert [check for check in checks if not check.passed] == []
    # The one with a tolerance, and that of the document, have no step; of order 8 all steps but one
    # are at rounding, so that no order can be fitted.
    without_order = ("dop_tol", "document", "dop8")
    assert ("order" in {check.name for check in checks}) == (name not in without_order)


def test_no_reason_is_right_by_accident() -> None:
    """What is expected of one engine is not said of another mistake."""
    assert is_right(BROKEN["p01_gravity_axis"], f"{NOT_FOUND}; the run raised an error") is None
    assert is_right(BROKEN["p01_gravity_axis"], "gravity of 9.8 m/s^2") is False
    assert is_right(BROKEN["p16_gravity_9_8"], "gravity of 9.8 m/s^2") is True


def test_every_mistake_is_made_in_the_text_of_its_engine() -> None:
    """An engine whose text was formatted anew would else be found missing in the long form alone."""
    for name, engine in (BROKEN | RIGHT).items():
        compile(engine.source(), name, "exec")
