"""Verdicts on runs that are hard to judge: what is right is ok, what is wrong is not, at any
distance of the rows."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.random_verdicts import COARSE, EXACT, verdicts

from rotor_mbs.analysis.judgement import Judgement, judge
from rotor_mbs.analysis.run_checks import RunSamples, run_checks
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.lagrange.heyoka_adapter import is_available
from rotor_mbs.models.lagrange.samples import load_conditioning
from rotor_mbs.scenario.accuracy_bounds import Bound, shipped_bounds
from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.solution.defects import OK_ERROR
from rotor_mbs.solution.trajectory import Integration, Solution, Trajectory

TAYLOR = "lagrange/taylor" if is_available() else "lagrange/dop853"
OWN = "own/engine"  # without a bound of its own
BLADE = Blade(15.0, (0.1, 0.05, 1.2), (2.0, 2.1, 0.2, 0.05, -0.1, 0.02), (0.1, 0.0, 2.4))


def chaotic(samples: int, **changes: Any) -> Scene:
    """Three blades for 20 s, whose errors grow up to 400-fold from row to row at 41 samples."""
    scene = Scene(
        "chaotic", "three blades", (), 9.81, 20.0, samples, ("angles", "rates"), (BLADE,) * 3, 5.0,
        (0.4, 0.5, -0.6, 0.9), (1.0, 0.5, -0.3, 0.2),
    )  # fmt: skip
    return replace(scene, **changes)


def one_thin_blade(samples: int, duration: float) -> Scene:
    """A point mass 5e-6 m off its pitch axis, whose rates count in units of 1300 rad/s."""
    blade = Blade(
        3.1067823166830557,
        (5.491515224181091e-06, 0.0, 3.764094163734493),
        (0.0,) * 6,
        (2.4, 1.1, 7.3),
    )
    return Scene(
        "thin", "one thin blade", (), 9.8, duration, samples, ("angles", "rates"), (blade,), 0.0,
        (-3.0709748585978156, 0.6701360068912425), (0.0, 0.0),
    )  # fmt: skip


def four_thin_blades(samples: int, duration: float) -> Scene:
    """Blades whose inertia about the pitch axis is 1e-9 of m |r|²; springs, dampers and loads in the joints."""
    blades = (
        Blade(
            1036.9, (1.1913512100296516e-05, 0.0, 1.1757000163153923), (0.0,) * 6, (0.4, -0.07, 2.4)
        ),
        Blade(
            591.8,
            (3.238365165982712e-07, 0.0, 0.9774464747761304),
            (1.2032e-4, 1.3043e-4, 1.07247e-5, -1.51763e-6, 2.93205e-5, 3.21219e-6),
            (0.2, 0.3, 1.9),
        ),
    )
    return Scene(
        "thin blades",
        "two thin blades",
        (),
        9.81,
        duration,
        samples,
        ("angles", "rates"),
        blades,
        0.0,
        (-0.67, 0.73, 1.11),
        (-2.1, -1.46, 0.0),
        bearing_stiffness=(2.5e-5, 2.4e-3),
        bearing_damping=(9.6e-8, 2e-6),
        bearing_rest=(((0.0, 0.34),), ((0.0, 0.3),)),
        shaft_damping=46.0,
    )


def ill_conditioned(samples: int = 51) -> Scene:
    """Blades of 1e-9 m |r|² about their pitch axis: an engine that forms it from terms about the root loses 1e-9."""
    rows = [
        (
            865.6,
            (1.008e-4, 3.27763e-4, 1.45493),
            (1.385e-5, 1.383e-5, 2.717e-7, 1.517e-8, -2.228e-8, -8.699e-7),
        ),
        (
            873.6,
            (3.97962e-4, 2.27197e-3, 0.78795),
            (3.22e-6, 3.137e-6, 1.077e-7, 2.465e-8, -9.439e-8, 3.431e-7),
        ),
        (
            689.1,
            (5.3198e-5, -7.52599e-4, 1.75197),
            (1.9691e-4, 1.8392e-4, 1.684e-5, -4.221e-7, 3.097e-6, -4.044e-5),
        ),
    ]
    blades = tuple(Blade(mass, centre, inertia, (0.1, 0.0, 3.0)) for mass, centre, inertia in rows)
    return Scene(
        "ill conditioned",
        "three thin blades",
        (),
        1.62,
        0.15,
        samples,
        ("angles", "rates", "loads"),
        blades,
        875.0,
        (-3.05, 0.64, 0.87, 0.70),
        (1.13, -0.22, 0.79, -0.18),
    )


def judged(scene: Scene, motion: Trajectory, method: str = OWN) -> Judgement:
    with np.errstate(all="ignore"):
        return judge(scene, Solution(scene, method, motion, Integration(True)), None)


@functools.cache
def right(scene: Scene) -> Trajectory:
    return solve(TAYLOR, scene, {}).trajectory


def with_jump(scene: Scene, size: float) -> Trajectory:
    """Pitch 1 jumps by so many radians at 80 % of the duration, and stays there."""
    motion = right(scene)
    angles = motion.angles.copy()
    angles[int(0.8 * len(angles)) :, 1] += size
    return motion.replace(angles=angles)


def with_late_fault(scene: Scene, share: float) -> Trajectory:
    """Gravity is off by a share from 60 % of the duration on."""
    first = right(scene)
    row = round(0.6 * (scene.samples - 1))
    step = scene.duration / (scene.samples - 1)
    rest = replace(
        scene,
        gravity=scene.gravity * (1.0 + share),
        duration=scene.duration - row * step,
        samples=scene.samples - row,
        initial_angles=tuple(first.angles[row].tolist()),
        initial_rates=tuple(first.rates[row].tolist()),
    )
    after = right(rest)
    angles = np.vstack([first.angles[:row], after.angles])
    return first.replace(angles=angles, rates=np.vstack([first.rates[:row], after.rates]))


@pytest.mark.parametrize("samples", [pytest.param(81, marks=pytest.mark.full), 41])
@pytest.mark.parametrize(
    "fault",
    [
        pytest.param(lambda s: with_jump(s, 0.05), marks=pytest.mark.full),
        lambda s: with_jump(s, 0.015),
        lambda s: with_late_fault(s, 0.003),
    ],
    ids=["jump of 0.05 rad", "jump of 0.015 rad", "gravity 0.3 % wrong from 60 % on"],
)
def test_a_fault_between_rows_that_are_far_apart_is_seen(fault: Any, samples: int) -> None:
    """Though errors grow a hundredfold there, of a method that declares no accuracy of its own."""
    scene = chaotic(samples)
    verdict = judged(scene, fault(scene))
    assert verdict.status == "inaccurate"
    assert "declared by Bound" in verdict.message
    assert verdict.metrics["defect_excess"] > 50.0 * verdict.metrics["defect_allowed"]


@pytest.mark.parametrize(
    "method",
    [TAYLOR, "lagrange/ode45", "exudyn_tree/rk67", "exudyn_chain/extrapolated", "mujoco/rk4"],
)
def test_a_right_run_with_rows_that_are_far_apart_is_ok(method: str) -> None:
    if not find_method(method).is_installed:
        pytest.skip(f"{method} is not installed")
    scene = chaotic(41)
    verdict = judged(scene, solve(method, scene, {}).trajectory, method)
    assert (verdict.status, verdict.message) == ("ok", "")


def test_every_interval_is_judged_though_rates_count_in_large_units() -> None:
    """No error grows by more than 1.04 from row to row."""
    scene = one_thin_blade(201, 18.287 / 5)
    verdict = judged(scene, right(scene), TAYLOR)
    assert (verdict.status, verdict.metrics["defects_not_judged"]) == ("ok", 0)


def test_rates_that_are_half_too_large_are_not_ok() -> None:
    scene = one_thin_blade(201, 18.287 / 5)
    motion = right(scene)
    rates = motion.rates.copy()
    rates[:, 1:] *= 1.5
    assert judged(scene, motion.replace(rates=rates)).status == "inaccurate"


def test_thin_blades_are_judged() -> None:
    scene = four_thin_blades(41, 0.7)
    verdict = judged(scene, right(scene), TAYLOR)
    assert (verdict.status, verdict.message) == ("ok", "")


@pytest.mark.parametrize(
    "method", [pytest.param("mujoco/rk4", marks=pytest.mark.full), "exudyn_tree/rk67"]
)
def test_what_an_ill_conditioned_mass_matrix_loses_of_the_loads_is_no_fault(method: str) -> None:
    if not find_method(method).is_installed:
        pytest.skip(f"{method} is not installed")
    scene = ill_conditioned()
    run = solve(method, scene, {})
    verdict = judge(scene, run, None)
    assert (verdict.status, verdict.message) == ("ok", "")
    if method == "mujoco/rk4":  # far more than its bound, 1e-12
        assert (
            max(
                verdict.metrics["blade_root_force_error"],
                verdict.metrics["blade_root_moment_error"],
            )
            > 1e-10
        )
    # Ten times what may be lost, in a single row, is seen.
    motion = run.trajectory
    lost = load_conditioning(scene, motion.time, motion.angles, motion.rates)["blade_root_force"]
    forces = motion.blade_root_force.copy()
    forces[20] += 10.0 * lost[20]
    wrong = judge(scene, replace(run, trajectory=motion.replace(blade_root_force=forces)), None)
    assert wrong.status == "inaccurate"
    assert wrong.message.startswith("blade root force differs")


def test_the_closed_form_is_excused_no_loads() -> None:
    """Its bound is its own: it computes the loads by the same formulas."""
    scene = ill_conditioned()
    run = solve("lagrange/dop853", scene, {})
    forces = run["blade_root_force"].copy()
    forces[20] *= 1.0 + 1e-12
    assert judge(scene, run, None).status == "ok"
    wrong = replace(run, trajectory=run.trajectory.replace(blade_root_force=forces))
    assert judge(scene, wrong, None).status == "inaccurate"


TWO = chaotic(
    101, blades=(BLADE,) * 2, initial_angles=(0.4, 0.5, -0.6), initial_rates=(1.0, 0.5, -0.3)
)
TWO = replace(TWO, duration=1.0, outputs=("angles", "rates", "tip", "energy"))


def off_by(name: str, size: float) -> Trajectory:
    motion = right(TWO)
    values = motion.get(name)
    assert values is not None
    wrong = values.copy()
    wrong.reshape(len(wrong), -1)[50, 0] += size
    return motion.replace(**{name: wrong})


@pytest.mark.parametrize(
    ("name", "size", "message"),
    [
        ("tip", 1e-3, "a tip is 1.0e-03 m from where its angles put it"),
        ("tip", 1.0, "a tip is 1.0e+00 m"),
        ("kinetic_energy", 1e-3, "energies, kinetic energy"),
        ("angles", 1e-3, "defect"),
        ("rates", 1e-2, "defect"),
    ],
)
def test_whatever_a_run_says_is_judged_in_its_status(name: str, size: float, message: str) -> None:
    verdict = judged(TWO, off_by(name, size))
    assert verdict.status == "inaccurate"
    assert verdict.message.startswith(message)


def test_a_run_that_starts_elsewhere_or_has_other_times_is_not_ok() -> None:
    motion = right(TWO)
    start = solve(TAYLOR, replace(TWO, initial_angles=(0.4, 0.5 + 1e-9, -0.6)), {}).trajectory
    assert judged(TWO, start).message.startswith("start")
    assert judged(TWO, motion.replace(time=motion.time * (1.0 + 1e-9))).message.startswith("times")


# ---- The smallest fault that each bound sees

METHODS = (
    "lagrange/dop853",
    "exudyn_tree/rk67",
    "exudyn_tree/generalized_alpha",
    "exudyn_chain/extrapolated",
    OWN,
)


@pytest.mark.parametrize("samples", [101, 21])
@pytest.mark.parametrize("method", METHODS)
def test_a_defect_of_twice_what_is_allowed_is_seen(method: str, samples: int) -> None:
    """b · max(1, h / 0.01 s) · max(1, G), planted as a jump that stays: no more than half of it
    hides in the run."""
    scene = chaotic(samples, duration=2.0)
    motion = right(scene)
    clean = judged(scene, motion, method)
    assert clean.status == "ok"
    defects = clean.defects
    assert defects is not None
    row = samples // 2  # the interval that ends in this row
    bound = min(shipped_bounds().of("defect", method).value, OK_ERROR)
    allowed = bound * defects.bound_factors[row - 1] + 3.0 * defects.floor[row - 1]
    for times, expected in ((2.0, "inaccurate"), (0.4, "ok")):
        # A run that goes on from elsewhere: the jump is in one interval alone.
        rest = replace(
            scene,
            duration=scene.duration - motion.time[row],
            samples=samples - row,
            initial_angles=tuple((motion.angles[row] + [0.0, times * allowed, 0.0, 0.0]).tolist()),
            initial_rates=tuple(motion.rates[row].tolist()),
        )
        after = right(rest)
        angles = np.vstack([motion.angles[:row], after.angles])
        jumped = motion.replace(angles=angles, rates=np.vstack([motion.rates[:row], after.rates]))
        verdict = judged(scene, jumped, method)
        if expected == "inaccurate":
            assert verdict.metrics["defect_judged"] > bound
            assert verdict.status == expected
        else:
            assert verdict.metrics["defect_judged"] <= bound


@pytest.mark.parametrize(
    ("name", "array", "unit"),
    [
        (
            "tip",
            "tip",
            lambda scene: max(float(np.linalg.norm(blade.tip)) for blade in scene.blades),
        ),
        ("start", "angles", lambda _: 1.0),
    ],
)
def test_another_number_of_twice_its_bound_is_seen(name: str, array: str, unit: Any) -> None:
    bounds = shipped_bounds().with_entries([Bound(name, OWN, 1e-6, "for the test")])
    for times, passed in ((2.0, False), (0.5, True)):
        motion = right(TWO)
        values = motion.get(array)
        assert values is not None
        moved = values.copy()
        moved.reshape(len(moved), -1)[0, 0] += times * 1e-6 * unit(TWO)
        run = RunSamples(TWO, OWN, motion.replace(**{array: moved}), {}, None)
        found = {check.name: check.passed for check in run_checks(run, bounds)}
        assert found[name] is passed


# ---- Random rotors against an integration that is not the package's


def examine(seed: int, methods: tuple[str, ...]) -> None:
    """No run is ok that is off by more than 0.01 rad before its horizon, and no right run is
    refused."""
    found = list(verdicts(seed, methods))
    assert found
    assert [verdict for verdict in found if verdict.fault] == []


# Those that take least; the others, of which some take minutes, are judged every night.
_QUICK_SEEDS = (3, 5, 7)


@pytest.mark.full
@pytest.mark.parametrize("seed", _QUICK_SEEDS)
def test_random_rotors_are_judged_right(seed: int) -> None:
    examine(seed, (*EXACT, "exudyn_tree/rk67"))


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(200))
def test_many_random_rotors_are_judged_right(seed: int) -> None:
    examine(seed, (*EXACT, *COARSE))


# ---- A map of stiffness over damping has no holes


def stiffness_map(stiffnesses: Any, dampings: Any, samples: Any, duration: float = 2.0) -> None:
    base = replace(
        chaotic(11),
        duration=duration,
        outputs=("angles", "rates", "energy"),
        initial_rates=(1.3, 0.0, 0.0, 0.0),
    )
    for stiffness in stiffnesses:
        for damping in dampings:
            for count in samples:
                scene = replace(
                    base,
                    samples=count,
                    bearing_stiffness=(stiffness,) * 3,
                    bearing_damping=(damping,) * 3,
                    rotor_torque=((0.0, 0.0), (0.2 * duration, 0.0), (0.2 * duration, 100.0)),
                )
                verdict = judge(scene, solve(TAYLOR, scene, {}), None)
                assert verdict.status == "ok", (stiffness, damping, count, verdict.message)


def test_stiff_and_damped_bearings_are_ok() -> None:
    # The defects of an interval by DOP853 take a minute for 2 s.
    stiffness_map([1e2, 1e5], [1e-1, 1e3], [21], 2.0 if is_available() else 0.05)


@pytest.mark.parametrize(
    "step",
    [pytest.param(2.0, marks=pytest.mark.full), pytest.param(1.0, marks=pytest.mark.nightly)],
)
def test_a_map_of_stiffness_over_damping_has_no_holes(step: float) -> None:
    stiffnesses, dampings = 10.0 ** np.arange(1.0, 6.0, step), 10.0 ** np.arange(-1.0, 4.0, step)
    stiffness_map(stiffnesses, dampings, [21, 201])
