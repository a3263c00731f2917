"""The fast path: runs side by side in SIMD lanes are the runs one by one, each with its own end and its own word."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import general, paper

from rotor_mbs.cli.sweep_work import Chunk, perform
from rotor_mbs.models.base import solve
from rotor_mbs.models.lagrange import taylor
from rotor_mbs.models.lagrange.ensemble import lanes, solve_many
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.variants import Variants
from rotor_mbs.store.sweep_layout import SWEEP_STATUSES, row_type
from rotor_mbs.trajectory.many import clearly_ok, energy_drifts, energy_errors
from rotor_mbs.trajectory.outcome import judge
from rotor_mbs.trajectory.record import Run

pytest.importorskip("heyoka")
LANES = lanes()
_EPS = float(np.finfo(float).eps)
_NAMES = ("angles", "rates", "tip", "kinetic_energy", "potential_energy", "work")


def _perturbed(scene: Scene, count: int) -> list[Scene]:
    rng = np.random.default_rng(5)
    starts = np.array(scene.initial_angles) + 1e-3 * rng.standard_normal((count, len(scene.initial_angles)))
    return [replace(scene, initial_angles=tuple(start)) for start in starts.tolist()]


def _machines(count: int) -> list[Scene]:
    """Different machines: masses, stiffness and torque vary, so that no two share a parameter."""
    base = general(duration=2.0, samples=41)
    return [
        replace(
            base,
            blades=tuple(replace(blade, mass=blade.mass + 7.0 * i) for blade in base.blades),
            bearing_stiffness=(2e4 + i, 1.5e4, 3e4 - i),
            rotor_torque=((0.0, 100.0 + i),),
        )
        for i in range(count)
    ]


@pytest.mark.parametrize(
    "scenes",
    [
        _perturbed(paper("fig11", duration=2.0, samples=41), LANES + 3),
        _perturbed(paper("fig04b", samples=41), 3),  # a pitch that is held
        _machines(3),
        [replace(scene, bearing_damping=(10.0, 20.0, 30.0), shaft_damping=5.0) for scene in _machines(2)],
        [replace(scene, rotor_torque=((0.0, 0.0), (1.0, 50.0))) for scene in _machines(2)],
    ],
    ids=["starts", "held pitch", "machines", "dampers", "torque over time"],
)
def test_runs_side_by_side_are_the_runs_one_by_one(scenes: list[Scene]) -> None:
    block = solve_many(scenes, _EPS)
    for i, scene in enumerate(scenes):
        single = solve("lagrange/taylor", taylor, scene, {"tolerance": _EPS})
        assert block.words[i].success
        assert block.words[i].steps == pytest.approx(single.integration.steps, abs=2)
        for name in _NAMES:
            expected, found = getattr(single.trajectory, name), getattr(block, name)[i]
            # Round-off of other instructions, which two seconds of fig11 carry on a thousandfold; rates by the
            # energy's scale are larger still.
            scale = max(1.0, float(np.abs(expected).max()))
            np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-10 * scale, err_msg=name)


def test_a_run_does_not_depend_on_its_neighbours() -> None:
    scenes = _perturbed(paper("fig11", samples=41), 2 * LANES + 1)
    block = solve_many(scenes, _EPS)
    for i in (0, LANES - 1, LANES + 2, 2 * LANES):
        alone = solve_many([scenes[i]], _EPS)
        for name in _NAMES:
            np.testing.assert_array_equal(getattr(alone, name)[0], getattr(block, name)[i], err_msg=name)
        assert alone.words[0].steps == block.words[i].steps


def _towards_the_singularity(count: int) -> list[Scene]:
    """One point-mass blade on a massless hub: there is no motion past ±π/2 of pitch; at rest it stays away."""
    base = paper("fig03", duration=3.0, samples=301)
    still = replace(base, initial_angles=(1.0, 0.3))
    return [still, *[replace(base, initial_angles=(1.0, 1.2), initial_rates=(0.0, 1.0 + i)) for i in range(count)]]


def test_a_run_that_breaks_off_ends_alone() -> None:
    scenes = _towards_the_singularity(2)
    block = solve_many(scenes, _EPS)
    assert [word.success for word in block.words] == [True, False, False]
    assert block.samples[0] == 301
    for i in (1, 2):
        n = block.samples[i]
        assert 1 < n < 301
        assert np.isfinite(block.angles[i, :n]).all()
        assert np.isnan(block.angles[i, n:]).all()
        assert block.words[i].time_reached == pytest.approx(3.0 * (n - 1) / 300)
        single = solve("lagrange/taylor", taylor, scenes[i], {"tolerance": _EPS}).trajectory
        assert abs(len(single.time) - n) <= 1


def test_every_row_has_the_status_that_the_run_alone_would_have() -> None:
    scenes = _towards_the_singularity(3)
    block = solve_many(scenes, _EPS)
    assert block.kinetic_energy is not None
    assert block.potential_energy is not None
    assert block.work is not None
    errors = energy_errors(block.kinetic_energy, block.potential_energy, block.work)
    drifts = energy_drifts(scenes, block.kinetic_energy, block.work, errors)
    well = clearly_ok(scenes, "lagrange/taylor", block.words, block.samples, drifts)
    for i, scene in enumerate(scenes):
        run = Run("lagrange/taylor", block.trajectory(i), block.words[i], {}, 0.0, [0.0], 0.0)
        verdict = judge(scene, run, None)
        assert well[i] == (verdict.status == "ok")
        assert drifts[i] == pytest.approx(verdict.metrics["energy_drift_max"], rel=1e-12)


def test_a_loose_tolerance_is_found_out_run_by_run() -> None:
    """Teeth: at 1e-6 the energy is not kept to 1e-11, and the rows say so."""
    scene = paper("fig11", duration=2.0, samples=41)
    tables = {
        "title": "t",
        "blades": 3,
        "gravity": 9.8,
        "duration": 2.0,
        "samples": 41,
        "outputs": ["angles", "energy"],
        "blade": {"mass": 15000.0, "centre_of_mass": list(scene.blades[0].centre_of_mass)},
        "initial": {"angles": list(scene.initial_angles), "rates": list(scene.initial_rates)},
    }
    variants = Variants("t", tables, ("initial.angles[0]",))
    row = row_type(variants.scene([0.0]), ("angles",), "float32")
    values = np.linspace(0.1, 0.5, 3)[:, None]
    statuses = {}
    for tolerance in (1e-6, 1e-15):
        rows = perform(Chunk(variants, "lagrange/taylor", {"tolerance": tolerance}, row, 5, values, 60.0))
        statuses[tolerance] = [SWEEP_STATUSES[code] for code in rows["status"]]
        assert rows["angles"].dtype == np.float32
        assert (rows["steps"] > 10).all()
    assert statuses == {1e-6: ["inaccurate"] * 3, 1e-15: ["ok"] * 3}
