"""Checks of known arrays: one that is off by a known number gives the value that follows from it,
and no other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from support.defects import made_defects
from support.references import reference
from support.scenes import general, paper, shipped
from support.stored import Arrays, Made, damage, rotor, store

from rotor_mbs.analysis import checks
from rotor_mbs.analysis.judgement import bounds_of, defects_of, judge
from rotor_mbs.analysis.run_checks import (
    RunSamples,
    defect_allowed,
    defect_bound,
    energy_slack,
    quantity_errors,
    run_checks,
    start_slack,
)
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.lagrange.samples import load_conditioning, load_rounding
from rotor_mbs.report.paper_figures import available
from rotor_mbs.runs.read import open_results
from rotor_mbs.scenario.accuracy_bounds import shipped_bounds
from rotor_mbs.scenario.catalogue import REFERENCES
from rotor_mbs.solution.defects import Defects
from rotor_mbs.solution.metrics import Metrics, defect_metrics, energy_scale, metrics_of
from rotor_mbs.solution.quantities import energy_error
from rotor_mbs.solution.trajectory import Integration, Solution, Trajectory

METHOD, PRINTED, BOUNDS = "lagrange/dop853", "printed/ode45", shipped_bounds()
OWN = "own/engine"  # without a bound of its own
LOADED = shipped("check/loads")
FIG11 = paper("fig11", samples=101)
ANGLES, RATE = {"rotor_angle_min", "rotor_angle_max"}, {"rotor_rate_max"}


def stored(method: str = METHOD, **more: Any) -> Any:
    return Arrays(method, **more)


def run_of(**changes: Any) -> Solution:
    return solve(METHOD, general(duration=0.2, samples=5, **changes), {})


def values(found: Any) -> dict[tuple[str, str], float]:
    return {(check.name, check.where.channel): check.value for check in found}


def of_samples(run: Solution) -> dict[tuple[str, str], float]:
    return values(checked(run, {}))


def checked(run: Solution, metrics: Metrics, defects: Defects | None = None) -> list[checks.Check]:
    return list(
        run_checks(RunSamples(run.scene, run.method, run.trajectory, metrics, defects), BOUNDS)
    )


@pytest.mark.parametrize(
    ("array", "place", "off", "channel", "size"),
    [
        ("time", 3, 1e-3, ("times", "time"), 0.2),
        ("angles", (0, 2), 1e-3, ("start", "angles, rates"), 5.0),
        ("rates", (0, 3), 1e-3, ("start", "angles, rates"), 5.0),
        ("tip", (4, 1, 2), 1e-3, ("tip", "tip"), 11.5),
        ("energy_error", 2, 1.0, ("energies", "energy error"), None),
        ("kinetic_energy", 2, 1.0, ("energies", "kinetic energy"), None),
        ("potential_energy", 2, 1.0, ("energies", "potential energy"), None),
        ("work", 0, 1.0, ("energies", "work at the start"), None),
        ("work", 3, 1.0, ("energies", "work"), None),
    ],
)
def test_a_sample_off_is_seen_in_its_channel(
    array: str, place: Any, off: float, channel: Any, size: float
) -> None:
    """Relative to the duration, to the largest start (5 rad), to the longest tip, or to the scene's
    energy."""
    tips = [
        replace(blade, tip=(0.0, 0.0, length))
        for blade, length in zip(general().blades, (9.0, 11.5, 3.0), strict=True)
    ]
    run = run_of(
        initial_angles=(5.0, 0.2, -0.4, 0.6), rotor_torque=((0.0, 30.0),), blades=tuple(tips)
    )
    run.trajectory.quantities["energy_error"] = energy_error(run.trajectory)
    before = of_samples(run)
    getattr(run.trajectory, array)[place] += off
    if array not in ("energy_error", "tip", "time"):
        run.trajectory.quantities["energy_error"] = energy_error(run.trajectory)
    after = of_samples(run)
    size = size or max(
        energy_scale(run.scene, run.trajectory), float(run.trajectory.kinetic_energy.max())
    )
    assert after[channel] == pytest.approx(off / size, rel=1e-6)
    assert before[channel] < 1e-6 * after[channel]
    if array != "energy_error":
        assert after["energies", "energy error"] < 1e-12


def test_the_start_of_small_angles_is_compared_in_rad_and_a_fixed_pitch_does_not_turn() -> None:
    fixed = replace(general().blades[1], inertia=(0.0,) * 6, centre_of_mass=(0.0, 0.0, 9.0))
    blades = (general().blades[0], fixed, general().blades[2])
    run = run_of(
        blades=blades, initial_angles=(0.3, 0.2, 0.4, 0.6), initial_rates=(0.1, 0.2, 0.3, 0.4)
    )
    assert of_samples(run)["start", "angles, rates"] < 1e-15
    run.trajectory.angles[0, 1] += 1e-3
    assert of_samples(run)["start", "angles, rates"] == pytest.approx(1e-3, rel=1e-9)


@pytest.mark.parametrize("outputs", [("angles", "energy"), ("angles", "rates")])
def test_energies_are_checked_against_angles_and_rates_alone(outputs: tuple[str, ...]) -> None:
    assert ("energies", "kinetic energy") not in of_samples(run_of(outputs=outputs))


def test_numbers_of_a_model_are_its_metrics_less_what_rounding_and_its_start_leave_open() -> None:
    """Whole turns away and past π/2 in pitch, digits are lost that no model has."""
    one = paper("fig11", duration=0.5, samples=51)
    run = solve(METHOD, one, {})
    run.trajectory.angles[20, 1] += 1e-3
    run.trajectory.kinetic_energy[30] += 1e3
    away = replace(
        one, initial_angles=(one.initial_angles[0] + 1e7 * np.pi, *one.initial_angles[1:])
    )
    defects = defects_of(away, run.trajectory)
    assert defects is not None
    metrics = metrics_of(away, run.trajectory, reference("paper/fig11"), defects)
    found = values(checked(replace(run, scene=away), metrics, defects))
    row = int(defects.sizes.argmax())
    # Of the rate, in which a wrong angle shows most, and of its own interval.
    beyond = (defects.channel_sizes - 3.0 * defects.floors)[row].max()
    assert found["defect", "largest"] == pytest.approx(beyond / max(defects.growth[row], 1.0))
    assert found["error", "angles"] == pytest.approx(metrics["angle_error_max"] - start_slack(away))
    assert 0.0 < start_slack(away) < found["error", "angles"]
    drift = metrics["energy_drift_max"] - energy_slack(away, run.trajectory)
    assert found["energy", "balance"] == pytest.approx(drift, rel=1e-12)
    # Of an error that is predicted the start leaves as much open.
    alone = {"angle_error_predicted": 3.0 * start_slack(away), "horizon_s": 0.5}
    predicted = values(checked(replace(run, scene=away), alone))
    assert predicted["error", "angles, predicted"] == pytest.approx(
        2.0 * start_slack(away), rel=1e-12
    )


@pytest.mark.parametrize("side", [0.9, 1.1])
def test_work_that_an_engine_integrates_is_as_accurate_as_its_balance_of_energy(
    side: float,
) -> None:
    """That of a method of this package is a function of the angles."""
    assert BOUNDS.of("energies", METHOD).value < BOUNDS.of("energy", METHOD).value
    assert BOUNDS.of("energies", OWN).value < BOUNDS.of("energy", OWN).value
    for method, check in ((METHOD, "energies"), (OWN, "energy")):
        run = run_of(rotor_torque=((0.0, 30.0),))
        scale = max(
            energy_scale(run.scene, run.trajectory), float(run.trajectory.kinetic_energy.max())
        )
        run.trajectory.work[3] += side * BOUNDS.of(check, method).value * scale
        (work,) = (
            found
            for found in checked(replace(run, method=method), {})
            if found.where.channel == "work"
        )
        assert work.passed is (side < 1.0)


@pytest.mark.parametrize(
    ("name", "duration", "samples"),
    [
        ("fig08", 10.0, 31),  # a narrow peak of the rate far from the largest sample
        ("fig15-10kNm", 10.0, 51),  # the largest rate before the largest sample
        ("fig06", 5.0, 5),  # the largest angle at the end
    ],
)
def test_extremes_of_the_printed_equations_are_found_between_samples(
    name: str, duration: float, samples: int
) -> None:
    """To ode45's relative tolerance; samples alone miss the rate of the first two by 0.26 and 0.32
    rad/s."""
    run = solve(PRINTED, paper(name, duration=duration, samples=samples), {})
    exact = metrics_of(run.scene, run.trajectory, None)
    expected = {name: pytest.approx(exact[name], rel=1e-3, abs=1e-3) for name in ANGLES | RATE}
    assert checks._own_extremes(run) == expected


def test_extremes_between_samples_are_not_sought_after_a_break_and_under_loads_that_change() -> (
    None
):
    run = solve(PRINTED, paper("fig06", duration=5.0, samples=5), {})
    broken_off = Trajectory(run.time[:4], run.angles[:4], run.rates[:4])
    assert checks._own_extremes(replace(run, trajectory=broken_off)) == {}
    ramp = solve(
        PRINTED, paper("fig06", duration=5.0, samples=5, rotor_torque=((0.0, 0.0), (5.0, 9.0))), {}
    )
    assert checks._own_extremes(ramp) == {}


def of_stored(run: Solution, metrics: Any, name: str, stored_value: float) -> tuple[str, float]:
    one = stored(run.method, attributes={**metrics, name: stored_value})
    return checks._changed_metric(one, metrics, run)[:2]


@pytest.mark.parametrize("method", [pytest.param(METHOD, marks=pytest.mark.full), PRINTED])
def test_a_stored_number_may_differ_by_what_rounding_or_other_points_decide(method: str) -> None:
    """And no other at all: errors, loads, the horizon, one for nothing."""
    short = (
        paper("fig06", duration=5.0, samples=5)
        if method == PRINTED
        else replace(LOADED, duration=0.2, samples=41)
    )
    run = solve(method, short, {})
    metrics = judge(short, run, run.trajectory).metrics
    assert {"horizon_s", "angle_error_max", "energy_drift_max"} <= set(metrics)
    allowed = dict.fromkeys(metrics.keys() - {"defect_time"}, 0.0)
    if method == PRINTED:
        allowed |= {name: 1e-3 * max(abs(metrics[name]), 1.0) for name in ANGLES | RATE}
    else:
        floor = 3.0 * metrics["defect_floor"]
        names = ("defect_max", "defect_judged", "defect_excess", "defect_median", "defect_mean")
        allowed |= dict.fromkeys(names, floor)
        # In proportion to the growth of an error over the interval; of no interval without an
        # excess.
        allowed["defect_allowed"] = 0.05 * metrics["defect_allowed"]
        if metrics["defect_excess"] <= floor:
            del allowed["defect_allowed"]
        allowed |= {"defect_drift": 100 * floor, "angle_error_predicted": 1e5 * floor}
        # Where no interval is judged there is no floor.
        assert of_stored(run, {"defect_drift": 1.0}, "defect_drift", 2.0)[0] == "defect_drift"
    for name, size in allowed.items():
        assert of_stored(run, metrics, name, metrics[name] + 0.9 * size) == ("stored numbers", 0.0)
        changed = metrics[name] + (1.1 * size or 1.0)
        off = (changed - metrics[name]) / max(abs(changed), abs(metrics[name]))
        assert of_stored(run, metrics, name, changed) == (name, pytest.approx(off))


@pytest.mark.parametrize(("interval", "is_as_far"), [(0, True), (1, True), (2, False)])
def test_the_worst_interval_may_be_another_that_is_as_far_beyond_its_bound(
    interval: int, is_as_far: bool
) -> None:
    """All that is stored of it is compared with the numbers of that one: its end, its excess, what
    is allowed."""
    # in the second, twice as long, twice as much is allowed
    time = np.array([0.0, 0.01, 0.03, 0.04])
    sizes = np.array([1e-3, 2e-3, 0.5e-3])
    defects = made_defects(sizes.tolist(), time=time)
    judgement: Any = SimpleNamespace(
        defects=defects, metrics=defect_metrics(defects, 0.04) | {"defect_allowed": 1e-6}
    )
    found = checks._of_stored_interval(
        stored(attributes={"defect_time": float(time[1 + interval])}), judgement
    )
    bound = defect_bound(bounds_of(METHOD), METHOD)
    shown = [found.get(name) for name in ("defect_time", "defect_excess", "defect_allowed")]
    expected = [time[1 + interval], sizes[interval], bound * (1.0 + interval)]
    assert shown == (pytest.approx(expected) if is_as_far else [None] * 3)


def test_the_time_of_the_largest_defect_is_of_no_interval_where_all_are_rounding() -> None:
    defects = made_defects([1e-17, 2e-17], rounding=np.full((3, 2), 1e-16))
    judgement: Any = SimpleNamespace(defects=defects, metrics=defect_metrics(defects, 0.02))
    assert judgement.metrics["defect_time"] == 0.02
    assert (
        checks._of_stored_interval(stored(attributes={"defect_time": 0.01}), judgement)[
            "defect_time"
        ]
        == 0.01
    )


@pytest.mark.parametrize("judged", [True, False], ids=["beyond rounding", "rounding alone"])
@pytest.mark.parametrize(("share", "is_as_far"), [(0.9, True), (1.1, False)])
def test_an_interval_is_as_far_as_the_worst_to_what_rounding_may_decide(
    judged: bool, share: float, is_as_far: bool
) -> None:
    """The second, stored interval is smaller by a share of that: three units in which the samples
    are rounded."""
    floor, unit = 3e-6, 1e-6
    larger = 1e-3 if judged else 1e-5
    defects = made_defects(
        [larger, larger - share * floor],
        rounding=np.full((3, 2), 0.0 if judged else 1.0),
    )
    judgement: Any = SimpleNamespace(
        defects=defects, metrics=defect_metrics(defects, 0.02) | {"defect_floor": unit}
    )
    assert bool(judgement.metrics["defect_judged"]) is judged
    found = checks._of_stored_interval(stored(attributes={"defect_time": 0.02}), judgement)
    assert found.get("defect_time") == (0.02 if is_as_far else None)


def test_without_a_stored_interval_the_numbers_of_the_worst_one_are_compared() -> None:
    defects = made_defects([2e-3, 1e-3])
    judgement: Any = SimpleNamespace(defects=defects, metrics=defect_metrics(defects, 0.02))
    assert checks._of_stored_interval(stored(), judgement) == {}


def of_reference(own: Any, shipped: Any) -> dict[tuple[str, str], float]:
    scene: Any = SimpleNamespace(name="scene", reference=own)
    return values(checks._of_reference(scene, shipped, BOUNDS))


def test_a_reference_is_compared_with_the_shipped_one() -> None:
    two = np.array([[1.0, 4.0], [0.5, -8.0]])
    shipped = stored(
        REFERENCE,
        angles=two,
        rates=two,
        error_growth=np.array([1.0, 0.0, np.inf, 8.0]),
        angle_uncertainty=np.ones(2),
    )
    assert list(of_reference(shipped, shipped).values()) == [0.0] * 4
    own = stored(
        REFERENCE,
        # of at least 1 rad: 0.25; of 8 rad: 0.125
        angles=two + np.array([[0.25, 0.0], [0.0, 1.0]]),
        rates=two[:1],
        error_growth=np.array([np.e, 1.0, 1.0, 8.0]),
        angle_uncertainty=np.array([np.exp(-3.0), 1.0]),
    )
    found = of_reference(own, shipped)
    assert found["reference", "angles"] == 0.25
    assert np.isnan(found["reference", "rates"])
    assert found["growth", "error growth"] == pytest.approx(1.0)
    assert found["uncertainty", "angle uncertainty"] == pytest.approx(3.0)
    assert np.isnan(of_reference(stored(REFERENCE, angles=two), shipped)["growth", "error growth"])
    assert of_reference(own, None) == {}
    frozen = stored(REFERENCE, angles=two)  # of a scene without rates
    frozen.is_frozen = True
    assert of_reference(frozen, shipped)["frozen", "all"] == 0.0
    assert np.isnan(of_reference(None, shipped)["reference", "all"])


@pytest.mark.full
def test_the_growth_of_a_reference_is_that_of_its_samples() -> None:
    """To the factor by which it was changed; of no other method."""
    exact = solve(REFERENCE, paper("fig03", duration=0.2, samples=5), {})
    growth = exact.trajectory.error_growth.copy()
    for off, passed in ((0.04, True), (0.06, False)):
        exact.trajectory.error_growth[1:] = growth[1:] * np.exp(off)
        found = {
            check.name: check
            for check in checks._of_run(stored(REFERENCE), BOUNDS, exact, [], None, False)
        }
        assert found["growth"].value == pytest.approx(off, abs=1e-3)
        assert found["growth"].passed is passed
        # judged as it was, and no report of success called false
        assert found["status"].value == 0.0
    assert "growth" not in {
        check.name for check in checks._of_run(stored(), BOUNDS, exact, [], None, False)
    }


def test_loads_are_checked_under_one_name() -> None:
    run = solve(METHOD, replace(LOADED, duration=0.2, samples=41), {})
    metrics = judge(run.scene, run, run.trajectory).metrics
    found = checked(run, metrics)
    assert {"blade root force", "shaft moment"} < {
        check.where.channel for check in found if check.name == "loads"
    }
    for quantity, rule, _ in quantity_errors(run.scene, metrics):
        (check,) = (check for check in found if check.where.channel == rule.channel)
        assert (check.name, check.hint, check.unit) == (
            rule.check,
            rule.look_at,
            "of the largest",
        ), quantity.name


def test_a_turn_of_a_pendulum_is_off_by_what_was_added() -> None:
    run = solve(METHOD, paper("fig03", duration=0.5, samples=51), {})
    run.trajectory.angles[7, 0] += 1e-3
    judged = of_samples(run)
    assert judged["exact", "rotor angle"] == pytest.approx(1e-3, rel=1e-6)


def test_a_start_turns_away_leaves_its_last_digits_of_an_exact_angle_open() -> None:
    """A scene at rest, off by twice what the start leaves open."""
    scene = paper("fig05", duration=0.5, samples=51)
    start = scene.initial_angles[0] + 1e7 * np.pi
    scene = replace(
        scene,
        initial_angles=(start, 0.0, 0.0, 0.0),
        initial_rates=(0.0,) * 4,
        rotor_torque=(),
        outputs=("angles",),
    )
    time = np.linspace(0.0, 0.5, 51)
    angles = np.tile(scene.initial_angles, (51, 1))
    angles[7, 0] += 2.0 * start_slack(scene)
    off = angles[7, 0] - start
    run = Solution(scene, METHOD, Trajectory(time, angles, np.zeros((51, 4))), Integration(True))
    found = of_samples(run)["exact", "rotor angle"]
    assert found == pytest.approx(off - start_slack(scene), rel=1e-12)


@pytest.mark.parametrize("method", [METHOD, OWN])
def test_an_error_of_loads_counts_beyond_what_rounding_may_cause(method: str) -> None:
    """That of the state; of a method without a bound of its own that of its arithmetic, too."""
    scene = replace(LOADED, duration=0.2, samples=41)
    motion = solve(METHOD, scene, {}).trajectory
    samples = motion.time, motion.angles, motion.rates
    allowed = load_rounding(scene, *samples)["blade_root_force"]
    if method == OWN:
        lost = load_conditioning(scene, *samples)["blade_root_force"]
        assert np.linalg.norm(lost[20, 0]) > 1e-3 * np.linalg.norm(allowed[20, 0])
        allowed = allowed + 3.0 * lost
    forces = motion.blade_root_force.copy()
    forces[20, 0, 1] += 100.0 * np.linalg.norm(allowed[20, 0])
    motion = motion.replace(blade_root_force=forces)
    defects = defects_of(scene, motion)
    assert defects is not None
    metrics = metrics_of(scene, motion, None, defects)
    run = Solution(scene, method, motion, Integration(True))
    found = values(checked(run, metrics, defects))["loads", "blade root force"]
    exact = defects.own_loads.blade_root_force
    off = np.linalg.norm((forces - exact)[20, 0])
    largest = np.linalg.norm(forces, axis=2).max()
    expected = (off - np.linalg.norm(allowed[20, 0])) / largest
    assert found == pytest.approx(expected, rel=1e-9, abs=0.0)


def test_where_no_defect_is_judged_the_bound_is_what_is_allowed() -> None:
    assert defect_allowed({}, 1e-9) == 1e-9


@pytest.mark.parametrize(
    ("end", "method", "status", "complete"),
    [
        ("singular", METHOD, "singular", True),
        ("timed_out", METHOD, "singular", False),
        ("ok", METHOD, "solver_failed", False),  # gave up, and says so
        ("singular", METHOD, "ok", False),  # says that it got to the end
        ("timed_out", PRINTED, "diverged", True),
    ],
)
def test_an_early_end_is_excused_where_the_reference_ends_or_nothing_is_claimed(
    end: str, method: str, status: str, complete: bool, tmp_path: Path
) -> None:
    runs = {REFERENCE: end, method: status}
    made = [
        Made(FIG11, name, rotor(np.sin), 0.5, attributes={"status": said})
        for name, said in runs.items()
    ]
    with open_results(store(tmp_path / "r.h5", made)) as results:
        found = checks.checks_of(results, [], BOUNDS)
    assert [check.passed for check in found if check.name == "complete"][1] is complete


@pytest.mark.parametrize(
    ("outputs", "false_success", "faults"),
    [
        (("energy",), 1, 0.0),
        (("angles", "energy"), 1, 0.0),
        (("rates", "energy"), 1, 0.0),
        (("angles", "rates", "energy"), 1, 1.0),
        (("energy",), 0, 1.0),  # the report of success is false, and is not called so
    ],
)
def test_a_singularity_is_not_judged_without_angles_or_rates(
    outputs: tuple[str, ...], false_success: int, faults: float, tmp_path: Path
) -> None:
    facts = {"status": "singular", "false_success": false_success}
    made = [Made(FIG11.replace(outputs=outputs), METHOD, rotor(np.sin), 0.5, attributes=facts)]
    with open_results(store(tmp_path / "r.h5", made)) as results:
        found = checks.checks_of(results, [], BOUNDS)
    assert [check.value for check in found if check.name == "status"] == [faults]


def test_an_error_in_a_damaged_run_is_its_own_and_in_an_intact_one_the_programs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = store(tmp_path / "r.h5", [Made(FIG11, METHOD, rotor(np.sin))])
    monkeypatch.setattr(checks, "_of_run", Mock(side_effect=ZeroDivisionError("of the content")))
    with open_results(path, verify=False) as results, pytest.raises(ZeroDivisionError):
        checks.checks_of(results, [], BOUNDS)
    damage(path, f"{FIG11.name}/{METHOD}", "angles")
    with open_results(path, verify=False) as results:
        found = {check.name: check for check in checks.checks_of(results, [], BOUNDS)}
    assert not found["integrity"].passed
    assert np.isnan(found["complete"].value)
    assert "of the content" in found["complete"].hint


@pytest.mark.parametrize(
    ("value", "passed", "margin"),
    [
        (0.5, True, 4.0),
        (2.0, True, 1.0),
        (2.1, False, 2.0 / 2.1),
        (0.0, True, np.inf),
        (np.nan, False, 0.0),
    ],
)
def test_the_margin_is_bound_over_value(value: float, passed: bool, margin: float) -> None:
    one = checks.Check("energy", checks.Where("s", "m", "c"), value, 2.0, "", "J")
    assert (one.passed, one.margin) == (passed, pytest.approx(margin))


@pytest.mark.parametrize(
    ("changes", "off", "figures"), [({"samples": 51}, [2.0], "11, 13a"), ({"gravity": 3.7}, [], "")]
)
def test_a_scene_of_the_paper_that_nobody_changed_is_judged_by_its_numbers_too(
    changes: dict[str, Any], off: list[float], figures: str, tmp_path: Path
) -> None:
    scene, curve = FIG11.replace(**changes), rotor(lambda t: 2.7313 * np.sin(np.pi * t / 10.0))
    made = [Made(scene, REFERENCE, rotor(np.zeros_like)), Made(scene, PRINTED, curve)]
    with open_results(store(tmp_path / "r.h5", made)) as results:
        found = values(checks.checks_of(results, [], BOUNDS))
        assert results.scenes[scene.name].figures == figures
        assert bool(available(results.scenes)) is bool(figures)
    assert [value for (check, _), value in found.items() if check == "published"] == pytest.approx(
        off
    )


def test_a_scene_that_is_not_shipped_is_not_compared_with_the_shipped_one_of_its_name(
    tmp_path: Path,
) -> None:
    fewer_samples = FIG11.replace()  # its text, too
    made = store(tmp_path / "r.h5", [Made(fewer_samples, REFERENCE, rotor(np.zeros_like))])
    with open_results(made) as results, open_results(REFERENCES / "paper.h5") as shipped:
        found = {check.name for check in checks.checks_of(results, [shipped], BOUNDS)}
    assert "complete" in found
    assert not found & {"reference", "uncertainty"}
