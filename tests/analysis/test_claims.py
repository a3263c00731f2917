"""Claims and the finding of files whose numbers are known because they were made so."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenes import paper
from support.stored import Arrays, Made, rotor, store

from rotor_mbs.analysis import run_selection
from rotor_mbs.analysis.claims import STATISTICS, Claim, ClaimResult, agreement, claims, finding, measure, rounds_to
from rotor_mbs.analysis.exact import escape_rate
from rotor_mbs.analysis.published import Condition, Published, TrajectoryNumber
from rotor_mbs.runs.read import open_results
from rotor_mbs.scenario.catalogue import natural_order

FIG11 = paper("fig11", samples=501)
PRINTED, REFERENCE, TAYLOR = "printed/ode45", "reference", "lagrange/taylor"


def number(statistic: str, value: float, *, quantity: str = "angle", coordinate: int = 0) -> Published:
    asked = TrajectoryNumber("paper/fig11", quantity, coordinate, statistic)
    return Published(id="n", figure="11", kind="number", quote="«»", of=asked, value=value, decimals=4)


def claim(*tests: Condition) -> Published:
    return Published(id="c", figure="11", kind="claim", quote="«»", statement="A claim.", tests=tests)


def of(statistic: str, coordinate: int = 0, scene: str = "paper/fig11", quantity: str = "angle") -> TrajectoryNumber:
    return TrajectoryNumber(scene, quantity, coordinate, statistic)


SERIES = {
    "min": ((3.0, -2.0, 5.0), -2.0),
    "max": ((3.0, -2.0, 5.0), 5.0),
    "max_abs": ((3.0, -7.0, 5.0), 7.0),
    "range": ((3.0, -2.0, 5.0), 7.0),
    "max_abs_change": ((3.0, -3.0, 5.0), 6.0),
    "net_change": ((3.0, -2.0, 5.0), 2.0),
    "reversals": ((1.0, 0.0, -1.0, -2.0, 3.0), 2.0),
    "growth": ((1.0, 3.0, -5.0), 3.0),  # of 2 by the middle of the time to 6
    "swing_ratio": ((0.0, 2.0, 2.0, -1.0, 3.0, 0.0), 2.0),  # 2, 3, 4; the last is unfinished
}


@pytest.mark.parametrize("statistic", SERIES)
def test_statistics_by_hand(statistic: str) -> None:
    x, expected = SERIES[statistic]
    series: Any = Arrays(PRINTED, time=np.arange(1.0, 1.0 + len(x)), angles=np.array([x]).T)
    assert measure(series, of(statistic)) == pytest.approx(expected)
    assert measure(series, of(statistic, 1)) is None  # no such coordinate
    still: Any = Arrays(PRINTED, time=np.arange(1.0, 4.0), angles=np.ones((3, 1)))
    if statistic in ("growth", "swing_ratio"):
        assert measure(still, of(statistic)) is None
        once: Any = Arrays(PRINTED, time=np.arange(3.0), angles=np.array([[0.0, 2.0, 1.0]]).T)
        assert measure(once, of("swing_ratio")) is None
        twice: Any = Arrays(PRINTED, time=np.arange(4.0), angles=np.array([[0.0, 2.0, -1.0, 3.0]]).T)
        assert measure(twice, of("swing_ratio")) == pytest.approx(1.5)
    else:
        assert measure(still, of(statistic)) in (0.0, 1.0)


def test_one_sample_has_no_growth_and_none_no_number() -> None:
    one: Any = Arrays(PRINTED, time=np.ones(1), angles=np.ones((1, 1)))
    assert measure(one, of("growth")) is None
    assert measure(one, of("max")) == 1.0
    assert measure(one, of("max", quantity="rate")) is None
    none: Any = Arrays(PRINTED, time=np.ones(0), angles=np.ones((0, 1)))
    assert measure(none, of("max")) is None
    timeless: Any = Arrays(PRINTED, angles=np.ones((1, 1)))
    assert measure(timeless, of("max")) is None


@pytest.mark.parametrize(
    ("quantity", "statistic", "coordinate", "expected"),
    [
        ("angle", "min", 0, -3.0),
        ("angle", "max", 0, 2.5),
        ("angle", "max_abs", 0, 3.0),
        ("angle", "range", 0, 5.5),
        ("angle", "net_change", 0, 1.0),
        ("angle", "max", 1, 1.0),
        ("rate", "max_abs", 0, 7.0),
        ("rate", "max", 0, 1.0),
    ],
)
def test_extremes_of_the_rotor_are_those_over_the_integrators_own_steps(
    quantity: str, statistic: str, coordinate: int, expected: float
) -> None:
    """Where a run has them; all else is read off the samples, here from 0 to 1."""
    samples = np.outer(np.arange(2.0), [1.0, 1.0])
    run: Any = Arrays(PRINTED, time=np.arange(2.0), angles=samples, rates=samples)
    metrics = {"rotor_angle_min": -3.0, "rotor_angle_max": 2.5, "rotor_rate_max": 7.0}
    asked = of(statistic, coordinate, quantity=quantity)
    assert measure(run, asked, metrics) == expected
    assert measure(run, asked, {}) == STATISTICS[statistic].of(run.get("time"), samples[:, coordinate])


@pytest.mark.parametrize(("value", "reproduced"), [(2.73146, True), (2.73154, True), (2.73144, False), (2.7316, False)])
def test_numbers_compare_at_the_printed_digits(value: float, reproduced: bool) -> None:
    assert rounds_to(value, 2.7315, 4) is reproduced


def test_a_number_that_the_printed_model_gives_and_the_right_one_does_not(tmp_path: Path) -> None:
    runs = [
        Made(FIG11, PRINTED, rotor(lambda t: 2.73148 * np.sin(np.pi * t / 10.0))),
        Made(FIG11, REFERENCE, rotor(lambda t: 0.367 * t)),
    ]
    with open_results(store(tmp_path / "r.h5", runs)) as results:
        found = claims(results.scenes, [number("max", 2.7315)])
    assert [(one.printed.holds, one.corrected.holds) for one in found] == [(True, False)]
    assert found[0].corrected.value == pytest.approx(3.67)


def test_relations_and_what_is_undefined(tmp_path: Path) -> None:
    run = Made(FIG11, PRINTED, rotor(lambda t: 0.1 * t, lambda t: -0.2 * t))
    less = Condition(of=of("range"), relation="<", than=of("range", 1))
    opposite = Condition(of=of("net_change", 1), relation="opposite", than=of("net_change"))
    undefined = Condition(of=of("growth", 2), relation=">", bound=0.0)
    with open_results(store(tmp_path / "r.h5", [run])) as results:
        found = claims(
            results.scenes,
            [
                claim(less),
                claim(replace(less, relation=">")),
                claim(opposite),
                claim(replace(less, relation="opposite")),
                claim(undefined),
                claim(less, undefined),
            ],
        )
    assert [one.printed.holds for one in found] == [True, False, True, False, False, False]
    assert all(one.corrected.holds is None for one in found)


def test_what_the_file_cannot_decide_is_left_out(tmp_path: Path) -> None:
    holds = Condition(of=of("range"), relation=">", bound=0.5)
    fails = Condition(of=of("range"), relation="<", bound=0.5)
    elsewhere = Condition(of=of("range", scene="paper/fig12"), relation=">", bound=0.5)
    with open_results(store(tmp_path / "r.h5", [Made(FIG11, PRINTED, rotor(lambda t: 0.1 * t))])) as results:
        assert claims(results.scenes, [claim(elsewhere), claim(holds, elsewhere)]) == []
        number_elsewhere = replace(number("max", 1.0), of=of("max", scene="paper/fig12"))
        assert claims(results.scenes, [number_elsewhere]) == []
        # One that fails decides, whatever the others would say.
        assert [one.printed.holds for one in claims(results.scenes, [claim(fails, elsewhere)])] == [False]


def test_the_reference_stands_for_right_and_without_it_the_closed_form(tmp_path: Path) -> None:
    right = [Made(FIG11, name, rotor(np.zeros_like)) for name in ("exudyn_tree/rk67", TAYLOR, REFERENCE, PRINTED)]
    with open_results(store(tmp_path / "a.h5", right)) as results:
        assert run_selection.reference_or_corrected_run(results.scenes["paper/fig11"]).method == REFERENCE
        assert list(run_selection.in_order(results.scenes["paper/fig11"]))[:2] == [PRINTED, REFERENCE]
    with open_results(store(tmp_path / "b.h5", right[:2])) as results:
        assert run_selection.reference_or_corrected_run(results.scenes["paper/fig11"]).method == TAYLOR
        assert run_selection.printed_run(results.scenes["paper/fig11"]) is None


def test_the_finding_counts_what_was_put_in(tmp_path: Path) -> None:
    fig12 = paper("fig12", samples=501)
    still = rotor(np.zeros_like)
    off = rotor(lambda t: np.full_like(t, 1e-9))
    runs = [
        *(Made(scene, REFERENCE, still) for scene in (FIG11, fig12)),
        Made(FIG11, PRINTED, still, gain=3e5),
        Made(fig12, PRINTED, still, gain=9e9, until=0.5, attributes={"status": "solver_failed"}),
        Made(FIG11, TAYLOR, off),
        Made(fig12, TAYLOR, rotor(lambda t: np.full_like(t, 1.0)), attributes={"status": "inaccurate"}),
    ]
    with open_results(store(tmp_path / "r.h5", runs)) as results:
        rows = finding(results.scenes, [])
        printed, corrected = agreement(run for scene in results.scenes.values() for run in scene.methods.values())
    # The run that broke off made more, but what a runaway reaches is no measure.
    assert [(row.printed, row.corrected) for row in rows] == [("2 of 2", ""), ("0.3 MJ", "")]
    assert corrected.angle_error == pytest.approx(1e-9)
    assert (printed.runs, corrected.runs) == ("1 of 2 completed", "1 of 2 ok")


def test_the_finding_counts_numbers_and_claims_that_are_decided() -> None:
    def decided(item: Published, printed: bool | None, corrected: bool | None) -> Claim:
        return Claim(item, ClaimResult(printed), ClaimResult(corrected))

    item, words = number("max", 1.0), claim(Condition(of("max"), ">", bound=0.0))
    evaluated = [decided(item, True, False), decided(item, None, False), decided(words, True, None)]
    assert finding({}, evaluated) == [
        ("Published numbers reproduced", "1 of 1", "0 of 2"),
        ("Published claims that hold", "1 of 1", ""),
    ]


def test_escape_rate_of_a_pendulum_upside_down() -> None:
    assert escape_rate(FIG11) == pytest.approx(math.sqrt(9.8 / math.hypot(0.08, 0.03)))
    assert escape_rate(FIG11.replace(**{"bearing.stiffness": 5.0})) is None


def test_scenes_come_in_natural_order() -> None:
    names = ["paper/fig15-100kNm", "paper/fig15-1kNm", "paper/fig06-tenth", "paper/fig15-10kNm", "paper/fig06"]
    assert natural_order(names) == [names[4], names[2], names[1], names[3], names[0]]
