"""Faults at a time, parameters and other models in the defects of a run: each pattern has its name, those that look
alike have one name for both."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from support.checking import with_wrong_number
from support.scenes import paper

from rotor_mbs.methods.solve import solve
from rotor_mbs.models.lagrange.defects import interval_defects
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Array
from rotor_mbs.studies.defect_causes import DefectCauses

TOLERANCE = 1e-6
JUMP = 5e4  # N m, at 0.5 s


def steps(*rows: tuple[float, float]) -> tuple[tuple[float, float], ...]:
    """A table that jumps to each value at its time, from 0 on."""
    value, table = 0.0, [(0.0, 0.0)]
    for time, following in rows:
        table += [(time, value), (time, following)]
        value = following
    return tuple(table)


SCENE = replace(paper("fig11", duration=1.0, samples=101, outputs=("angles", "rates")), rotor_torque=steps((0.5, JUMP)))
BESIDE = steps((0.7, 100.0), (0.8, 0.0))
Rows = tuple[Array, Array, Array]


@functools.cache
def run(scene: Scene = SCENE) -> Rows:
    solution = solve("lagrange/dop853", scene, {}).trajectory
    return solution.time, solution.angles, solution.rates


def causes(time: Array, angles: Array, rates: Array, scene: Scene = SCENE) -> DefectCauses:
    return DefectCauses(scene, interval_defects(scene, time, angles, rates), TOLERANCE)


def with_row(row: int, angles: Array, rates: Array) -> Rows:
    time, q, w = (array.copy() for array in run())
    q[row], w[row] = angles, rates
    return time, q, w


def stuck() -> Rows:
    _, angles, rates = run()
    return with_row(40, angles[39], rates[39])


def at_a_wrong_time() -> Rows:
    """Row 41 is of half a sample before."""
    _, angles, rates = run(replace(SCENE, samples=201))
    return with_row(40, angles[79], rates[79])


def wrong() -> Rows:
    _, angles, rates = run()
    return with_row(40, angles[40] + [0.0, 1e-3, 0.0, 0.0], rates[40])


def taken(*rows: int) -> Rows:
    time, angles, rates = run()
    order = np.array(rows)
    return time[: len(order)], angles[order], rates[order]


def clock(late: float) -> Rows:
    """Goes wrong between rows 31 and 32."""
    time, angles, rates = run()
    return time + late * (np.arange(101) > 30), angles, rates


def kicked() -> Rows:
    time, angles, rates = run()
    start = rates[30] + [0.0, 0.0, 1e-3, 0.0]
    after = replace(
        SCENE, duration=0.7, samples=71, rotor_torque=steps((0.2, JUMP)),
        initial_angles=tuple(angles[30]), initial_rates=tuple(start),
    )  # fmt: skip
    _, q, w = run(after)
    return time, np.vstack([angles[:30], q]), np.vstack([rates[:30], w])


def driven(*rows: tuple[float, float]) -> Callable[[], Rows]:
    return lambda: run(replace(SCENE, rotor_torque=steps(*rows)))


PATTERNS: dict[str, tuple[Callable[[], Rows], str]] = {
    "a stuck row": (stuck, "a stuck row, or one at a wrong time: row 41, t = 0.4 s"),
    "a row half a sample off": (at_a_wrong_time, "a stuck row, or one at a wrong time: row 41, t = 0.4 s"),
    "an outlier": (wrong, "a single wrong row: row 41, t = 0.4 s"),
    "a row repeated": (
        lambda: taken(*range(31), *range(30, 100)),
        "a row repeated, or times late by less than an interval, at t = 0.31 s",
    ),
    "a clock that goes on": (
        lambda: clock(0.004), "a row repeated, or times late by less than an interval, at t = 0.314 s",
    ),
    "a row left out": (
        lambda: taken(*range(31), *range(32, 51)),
        "a row omitted and the others renumbered, or times early by less than an interval, at t = 0.31 s",
    ),
    "a clock that stands": (
        lambda: clock(-0.004),
        "a row omitted and the others renumbered, or times early by less than an interval, at t = 0.306 s",
    ),
    "a wrong rate": (kicked, "a jump of rates, or a load of one interval, before t = 0.3 s"),
    "a load of an interval": (
        driven((0.3, JUMP), (0.31, 0.0), (0.5, JUMP)),
        "a jump of rates, or a load of one interval, before t = 0.31 s",
    ),
    "a late edge": (
        driven((0.51, JUMP)), "the load on the rotor jumps a row late at t = 0.5 s, or has a wrong value in this row",
    ),
    "an early edge": (
        driven((0.49, JUMP)), "the load on the rotor jumps a row early at t = 0.5 s, or has a wrong value in this row",
    ),
    "smoothed over three": (
        driven((0.49, JUMP / 3.0), (0.5, 2.0 * JUMP / 3.0), (0.51, JUMP)),
        "the load on the rotor is smoothed over its jump at t = 0.5 s",
    ),
    "missing": (
        driven((0.5, JUMP), (0.7, 0.0), (0.8, JUMP)),
        "a load that is wrong or missing from t = 0.7 to 0.8 s: on average -5e+04 N m on the rotor",
    ),
    "two loads at once": (
        lambda: run(replace(
            SCENE, rotor_torque=steps((0.5, JUMP), (0.7, 2.0 * JUMP), (0.8, JUMP)),
            pitch_torque=(steps(), steps(), BESIDE),
        )),
        "a load that is wrong or missing from t = 0.7 to 0.8 s: on average +5e+04 N m on the rotor and +100 N m on "
        "the pitch 3",
    ),
}  # fmt: skip


def averaged() -> Rows:
    """A filter leaves the first and the last two rows as they were: the largest defects are there."""
    time, angles, rates = run()
    return time, *(
        np.vstack([a[:2], sum(a[i : len(a) - 4 + i] for i in range(5)) / 5.0, a[-2:]]) for a in (angles, rates)
    )


def differences() -> Rows:
    time, angles, _ = run()
    return time, angles, np.gradient(angles, time, axis=0)


@pytest.mark.parametrize("rows", [run, averaged, differences])
def test_what_is_right_or_wrong_in_all_rows_has_no_fault_at_a_time(rows: Callable[[], Rows]) -> None:
    assert causes(*rows()).faults() == []


@pytest.mark.parametrize("name", PATTERNS)
def test_a_fault_at_a_time_is_named(name: str) -> None:
    rows, text = PATTERNS[name]
    assert causes(*rows()).faults() == [text]


def test_faults_far_apart_are_named_each() -> None:
    time, angles, rates = wrong()
    angles[60, 2] += 1e-3
    found = causes(time, angles, rates).faults()
    assert found == ["a single wrong row: row 41, t = 0.4 s", "a single wrong row: row 61, t = 0.6 s"]


def test_parameters_that_are_off_are_named_together_with_estimate_and_uncertainty() -> None:
    """Mass, gravity and torque of driven point masses: of two wrong ones the motion tells two, whichever they are."""
    found = causes(*run(with_wrong_number(with_wrong_number(SCENE, "mass", 0.01), "gravity", -0.02))).explanations()
    assert "gravity off by -2 % (uncertainty " in found[0]
    assert any("blade.mass off by +1 % (uncertainty " in text for text in found)
    assert all(" and " in text for text in found)
    (alone,) = causes(*run(with_wrong_number(SCENE, "gravity", 0.02))).explanations()
    assert alone.startswith("gravity off by +2 % (uncertainty ")


SPRUNG = replace(SCENE, bearing_stiffness=(6e3, 5e3, 8e3), bearing_damping=(300.0, 500.0, 400.0))


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"bearing.damping": [330, 500, 400]}, "bearing.damping[0] off by +10 % (uncertainty "),
        ({"bearing.stiffness": [6e3, 4e3, 8e3]}, "bearing.stiffness[1] off by -20 % (uncertainty "),
        ({"bearing.rest": [-0.1, -0.1, -0.1]}, "bearing.rest off by -0.1 rad (uncertainty "),
    ],
)
def test_a_number_of_one_bearing_is_named(change: dict[str, list[float]], text: str) -> None:
    """In numbers that differ from blade to blade, by what the right text rounds to."""
    (found,) = causes(*run(SPRUNG.replace(**change)), SPRUNG).explanations()
    assert found.startswith(text)


def test_a_sine_that_nothing_makes_is_not_explained() -> None:
    time, angles, rates = run()
    data = causes(time, angles + 1e-3 * np.sin(7.0 * time)[:, None], rates)
    assert (data.explanations(), data.faults()) == ([], [])
