"""The fast path: runs side by side in SIMD lanes are the runs one by one, each with its own end and
its own word."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenes import general, paper

from rotor_mbs.analysis.judgement import clearly_ok, judge
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.lagrange.ensemble import lanes, solve_many
from rotor_mbs.runs.rows import RowLocation
from rotor_mbs.runs.sweeps import sweep_table
from rotor_mbs.scenario.scene import Scene, scene_tables
from rotor_mbs.scenario.sweep import Variants, sweep_of
from rotor_mbs.solution.metrics import energy_drifts
from rotor_mbs.solution.quantities import energy_balance
from rotor_mbs.solution.trajectory import Solution
from rotor_mbs.studies.sweep import Chunk

pytest.importorskip("heyoka")
LANES = lanes()
_EPS = float(np.finfo(float).eps)
_NAMES = ("angles", "rates", "tip", "kinetic_energy", "potential_energy", "work")


def _perturbed(scene: Scene, count: int) -> list[Scene]:
    rng = np.random.default_rng(5)
    starts = np.array(scene.initial_angles) + 1e-3 * rng.standard_normal(
        (count, len(scene.initial_angles))
    )
    return [replace(scene, initial_angles=tuple(start)) for start in starts.tolist()]


def _machines(count: int, blades: int = 3, **changes: Any) -> list[Scene]:
    """Different machines: masses, tips, stiffness and torque vary, so that no two share a
    parameter."""
    three = general().blades
    return [
        general(
            duration=2.0,
            samples=41,
            blades=tuple(
                replace(
                    three[k % 3], mass=900.0 + 10.0 * k + 7.0 * i, tip=(0.1 * i * k, 0.0, 11.0 + i)
                )
                for k in range(blades)
            ),
            initial_angles=tuple(0.1 * k + 0.01 * i for k in range(blades + 1)),
            initial_rates=tuple(0.2 * k for k in range(blades + 1)),
            **{
                "bearing_stiffness": (2e4 + i,) * blades,
                "bearing_damping": (),
                "rotor_torque": ((0.0, 100.0 + i),),
                **changes,
            },
        )
        for i in range(count)
    ]


_SIDE_BY_SIDE = {
    "starts": _perturbed(paper("fig11", duration=2.0, samples=41), LANES + 3),
    "fixed pitch": _perturbed(paper("fig04b", samples=41), 3),
    "machines": _machines(LANES + 1),
    "more blades than code is unrolled for": _machines(2, blades=6),
    "loads over time": _machines(
        2,
        rotor_torque=((0.0, 0.0), (1.0, 50.0)),
        bearing_rest=(((0.0, 0.1),), ((0.5, 0.0), (0.5, 0.2)), ()),
    ),
    "free": _machines(2, gravity=0.0, bearing_stiffness=()),
    "pitch loads and dampers": _machines(
        2,
        blades=2,
        shaft_damping=5.0,
        bearing_damping=(10.0, 20.0),
        pitch_torque=(((0.0, 50.0),), ((0.0, -20.0),)),
        bearing_rest=(((0.0, 0.1),), ((0.0, -0.2),)),
    ),
}
# the last: every term of Hamilton's equations
_QUICK = ("starts", "fixed pitch", "pitch loads and dampers")


@pytest.mark.parametrize(
    "name",
    [
        name if name in _QUICK else pytest.param(name, marks=pytest.mark.full)
        for name in _SIDE_BY_SIDE
    ],
)
def test_runs_side_by_side_are_the_runs_one_by_one(name: str) -> None:
    scenes = _SIDE_BY_SIDE[name]
    block = solve_many(scenes, _EPS)
    for i, scene in enumerate(scenes):
        single = solve("lagrange/taylor", scene, {"tolerance": _EPS})
        assert block.integrations[i].success
        # most motions take fewer in momenta
        assert 0 < block.integrations[i].steps <= single.integration.steps + 3
        for quantity in _NAMES:
            expected, result = getattr(single.trajectory, quantity), block.quantities[quantity][i]
            # Round-off of other instructions, which two seconds of fig11 carry on a thousandfold;
            # rates by the energy's scale are larger still.
            scale = max(1.0, float(np.abs(expected).max()))
            np.testing.assert_allclose(
                result, expected, rtol=0.0, atol=1e-10 * scale, err_msg=quantity
            )


def test_many_samples_are_evaluated_in_pieces() -> None:
    scene = paper("fig11", duration=1.0, samples=2501)
    block, single = solve_many([scene], _EPS), solve("lagrange/taylor", scene, {"tolerance": _EPS})
    np.testing.assert_allclose(
        block.quantities["tip"][0], single.trajectory.tip, rtol=0.0, atol=1e-10
    )


# A scene, the varied keys, and a row of values for each run.
_FIG11, _FIG03 = (paper(name, duration=2.0, samples=62) for name in ("fig11", "fig03"))
_CHUNKED = {
    "starts": (_FIG11, ["initial.angles[1]"], [[1.0 + 0.1 * i] for i in range(2 * LANES + 1)]),
    "some break off": (
        replace(_FIG03, initial_angles=(1.0, 1.2)),
        ["initial.rates[1]"],
        [[0.5 * i] for i in range(2 * LANES + 1)],
    ),
    "a rotor turned by 2e14": (_FIG11, ["initial.angles[0]"], [[0.1], [0.2], [2e14], [0.3], [0.4]]),
    "tips and masses": (
        _FIG11,
        ["blade.tip[0]", "blade.mass"],
        [[0.1 * i, 1e4 + i] for i in range(LANES + 2)],
    ),
}


@pytest.mark.parametrize(("scene", "keys", "values"), _CHUNKED.values(), ids=list(_CHUNKED))
def test_any_chunks_give_the_same_bytes(
    scene: Scene, keys: list[str], values: list[list[float]]
) -> None:
    variants = Variants("t", scene_tables(scene), keys)
    sweep = sweep_of(
        variants.scene(values[0]), {"gravity": [9.8]}, outputs=["angles", "rates", "tip", "energy"]
    )
    row = sweep_table(sweep, ["lagrange/taylor"], range(len(values))).row_type
    whole = Chunk(
        label="",
        method="lagrange/taylor",
        place=RowLocation(Path(), 0, 0, {}, row),
        values=np.array(values),
        variants=variants,
        settings={},
        time_limit_s=60.0,
        code=0,
    )
    expected = whole.perform()
    assert expected["pitch_max"] == pytest.approx(
        np.nanmax(np.abs(expected["angles"][:, :, 1:]), axis=(1, 2))
    )
    for size in (1, LANES - 1, LANES):
        for start in range(0, len(values), size):
            part = whole.part(start, min(start + size, len(values))).perform()
            for name, result in part.items():
                assert result.tobytes() == expected[name][start : start + size].tobytes(), (
                    name,
                    start,
                    size,
                )


def test_a_run_that_fails_at_once_has_its_start() -> None:
    scene = replace(
        paper("fig03", duration=1.0, samples=11),
        initial_angles=(1.0, -np.pi / 2),
        initial_rates=(0.0, 3.0),
    )
    block, single = solve_many([scene], _EPS), solve("lagrange/taylor", scene, {"tolerance": _EPS})
    assert block.samples == [1] == [len(single.trajectory.time)]
    np.testing.assert_array_equal(block.quantities["angles"][0, 0], scene.initial_angles)


def _towards_the_singularity(count: int) -> list[Scene]:
    """One point-mass blade on a massless hub: there is no motion past ±π/2 of pitch; at rest it
    stays away."""
    base = paper("fig03", duration=3.0, samples=301)
    still = replace(base, initial_angles=(1.0, 0.3))
    return [
        still,
        *[
            replace(base, initial_angles=(1.0, 1.2), initial_rates=(0.0, 1.0 + i))
            for i in range(count)
        ],
    ]


def test_a_run_that_breaks_off_ends_alone() -> None:
    scenes = [replace(scene, gravity=0.0) for scene in _towards_the_singularity(2)]
    block = solve_many(scenes, _EPS)
    assert [word.success for word in block.integrations] == [True, False, False]
    assert block.samples[0] == 301
    for i in (1, 2):
        n = block.samples[i]
        assert 1 < n < 301
        assert np.isfinite(block.quantities["angles"][i, :n]).all()
        for name in _NAMES:
            assert np.isnan(block.quantities[name][i, n:]).all(), name
        assert block.integrations[i].time_reached == pytest.approx(3.0 * (n - 1) / 300)
        single = solve("lagrange/taylor", scenes[i], {"tolerance": _EPS}).trajectory
        assert abs(len(single.time) - n) <= 1


def test_every_row_has_the_status_that_the_run_alone_would_have() -> None:
    scenes = _towards_the_singularity(3)
    block = solve_many(scenes, _EPS)
    kinetic, potential, work = (
        block.quantities[name] for name in ("kinetic_energy", "potential_energy", "work")
    )
    drifts = energy_drifts(scenes, kinetic, work, energy_balance(kinetic, potential, work))
    angles = np.abs(result := block.quantities["angles"]).max(
        axis=(1, 2), initial=0.0, where=np.isfinite(result)
    )
    metrics = [{"energy_drift_max": float(drift)} for drift in drifts]
    well = clearly_ok(scenes, "lagrange/taylor", block.integrations, block.samples, metrics, angles)
    for i, scene in enumerate(scenes):
        run = Solution(scene, "lagrange/taylor", block.trajectory(i), block.integrations[i])
        verdict = judge(scene, run, None)
        assert well[i] == (verdict.status == "ok")
        expected = verdict.metrics["energy_drift_max"]  # of round-off alone
        assert drifts[i] == pytest.approx(expected, rel=1e-12, abs=0.0)
