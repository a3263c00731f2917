"""The classification: every bound where it stands, and every false success of an engine that was seen, caught.

The bounds are written down here a second time: one that is widened tenfold in the code fails its test here.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.defects import made_defects
from support.references import reference, run, scene
from support.scenes import paper

from rotor_mbs.analysis import judgement
from rotor_mbs.analysis.judgement import OK_ERROR, Judgement, energy_conditioning, judge
from rotor_mbs.methods.catalogue import find_method, method_names
from rotor_mbs.methods.solve import solve
from rotor_mbs.methods.time_limit import OutOfTimeError, is_over, polled, time_limit
from rotor_mbs.models.exudyn import adapter, chain, sensor_samples
from rotor_mbs.models.exudyn.moments import Loads
from rotor_mbs.models.exudyn.schemes import Scheme
from rotor_mbs.models.exudyn.solvers import MultibodySolver
from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.solution.solution import Solution
from rotor_mbs.solution.trajectory import Integration, Trajectory

# Of each method: largest defect of an interval (rad), largest energy error (of the energy scale).
BOUNDS = {
    "lagrange/taylor": (1e-14, 1e-11),
    "lagrange/dop853": (2e-12, 1e-11),
    "lagrange/ode45": (1e-5, 1e-4),
    "lagrange/radau": (5e-8, 1e-7),
    "exudyn_tree/rk44": (3e-9, 1e-8),
    "exudyn_tree/rk67": (3e-9, 1e-10),
    "exudyn_tree/dopri5": (5e-11, 1e-9),
    "exudyn_tree/generalized_alpha": (1e-5, 1e-5),
    "exudyn_chain/extrapolated": (3e-7, 1e-5),
    "exudyn_chain/generalized_alpha": (4e-4, 1e-5),
    "exudyn_chain/newmark_index2": (4e-3, 1e-5),
    "mujoco/rk4": (3e-9, 1e-8),
    "mujoco/implicitfast": (4e-2, 2e-4),
}
GAPS = {"exudyn_chain/generalized_alpha": 1e-7, "exudyn_chain/newmark_index2": 1e-5}  # of the longest arm


def made(method: str, *, energy: float = 0.0, gap: float | None = None) -> tuple[Scene, Solution]:
    """A run at rest with errors of exactly these sizes: of the energy scale, of the longest arm."""
    chosen = paper("fig05", duration=1.0, samples=11)
    time = np.linspace(0.0, 1.0, 11)
    angles = np.tile(chosen.initial_angles, (11, 1))
    potential = np.zeros(11)
    weights = sum(b.mass * chosen.gravity * float(np.linalg.norm(b.centre_of_mass)) for b in chosen.blades)
    potential[5] = energy * weights
    arm = float(np.linalg.norm(chosen.blades[0].centre_of_mass))
    gaps = None if gap is None else np.full(11, gap * arm)
    energies = {"kinetic_energy": np.zeros(11), "potential_energy": potential, "work": np.zeros(11)}
    trajectory = Trajectory(time, angles, np.zeros_like(angles), **energies, constraint_error=gaps)
    return chosen, Solution(chosen, method, trajectory, Integration(True, "", 1.0))


@pytest.fixture
def defect(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """Gives every run one defect of a size, in the interval up to t = 2 s, which the next one undoes."""

    def plant(size: float) -> None:
        defects = made_defects((0.0, size, -size, 0.0))
        monkeypatch.setattr(judgement, "defects_of", lambda *_, **__: defects)

    plant(0.0)
    return plant


def test_every_held_method_has_its_bounds_here() -> None:
    assert set(BOUNDS) == set(method_names(is_corrected=True))


@pytest.mark.parametrize("method", BOUNDS)
def test_the_bounds_are_where_they_are_said_to_be(method: str, defect: Callable[[float], None]) -> None:
    largest, energy = BOUNDS[method]
    assert judge(*made(method, energy=2.0 * energy), None).status == "inaccurate"
    # What is added up may be more than 0.01 rad before the bound of a defect is reached.
    defect(min(0.5 * largest, 0.9 * OK_ERROR))
    assert judge(*made(method, energy=0.5 * energy), None).status == "ok"
    defect(2.0 * largest)
    wrong = judge(*made(method), None)
    assert wrong.status == "inaccurate"
    assert wrong.message.startswith(f"defect {2.0 * largest:.1e} rad in the interval up to t = 2 s, ")


@pytest.mark.parametrize("method", GAPS)
@pytest.mark.usefixtures("defect")
def test_an_open_joint_is_caught(method: str) -> None:
    assert judge(*made(method, gap=0.5 * GAPS[method]), None).status == "ok"
    opened = judge(*made(method, gap=2.0 * GAPS[method]), None)
    assert opened.status == "inaccurate"
    assert opened.message.startswith("a joint opens by ")
    # A hundredth of the arm parts a coarse run from another machine: the engine's claim of success is false.
    assert [judge(*made(method, gap=gap), None).false_success for gap in (0.5e-2, 2e-2)] == [False, True]


def test_the_energy_bound_opens_only_near_a_quarter_turn() -> None:
    """1/√share: a hub of h on one blade leaves h / (h + m d²) where the blade passes π/2."""
    for hub, name in ((1e3, "1e3"), (1e-6, "1e-6")):
        chosen = scene(f"extreme/passage-{name}")
        blade = chosen.blades[0]
        share = hub / (hub + blade.mass * blade.centre_of_mass[2] ** 2)
        assert energy_conditioning(chosen, reference(chosen.name)) == pytest.approx(np.sqrt(1e-3 / share), rel=1e-3)
    assert energy_conditioning(paper("fig05"), made("lagrange/taylor")[1].trajectory) == 1.0


def test_an_unstable_step_is_caught() -> None:
    """RK44 at ωh = 3.2 (six steps between two samples), beyond 2.83."""
    chosen = scene("stiff/bearing-1e8")
    verdict = judge(chosen, run(chosen, "exudyn_tree/rk44", step=0.02 / 6), reference(chosen.name))
    assert verdict.status in ("diverged", "inaccurate")
    assert verdict.false_success


def wrong(chosen: Scene, method: str, exact: Trajectory | None = None, **settings: object) -> Judgement:
    """The engine reports success; the judgement must not."""
    return caught(chosen, solve(method, chosen, settings), exact)


def caught(chosen: Scene, result: Solution, exact: Trajectory | None = None) -> Judgement:
    assert result.integration.success
    verdict = judge(chosen, result, exact)
    assert verdict.status != "ok"
    assert verdict.false_success
    return verdict


RK44, ALPHA = "exudyn_tree/rk44", "exudyn_tree/generalized_alpha"
CLAIMS = {
    "a bearing of 1e12": (scene("stiff/bearing-1e12"), RK44, None),
    "a rate of 1e200": (scene("extreme/rate-1e200"), RK44, None),
    "a stiffness that is no number": (
        replace(scene("stiff/bearing-1e6"), bearing_stiffness=(np.nan, 0.0, 0.0)), RK44, None
    ),
    "an angle that is no number": (replace(paper("fig05"), initial_angles=(np.nan, 0.0, 0.0, 0.0)), RK44, None),
    "the singular pitch": (scene("extreme/singular-one-blade"), RK44, None),
    "ten steps a second": (paper("fig14c", samples=101), RK44, 0.1),
    "a step of ten seconds": (paper("fig11", samples=2), RK44, 10.0),
    "an implicit step of ten seconds": (paper("fig11", samples=2), ALPHA, 10.0),
}  # fmt: skip


@pytest.mark.parametrize("name", CLAIMS)
def test_an_engines_claim_of_success_that_is_false(name: str) -> None:
    given, method, step = CLAIMS[name]
    exact = reference(given.name) if name == "the singular pitch" else None
    wrong(given, method, exact, **({} if step is None else {"step": step}))


@pytest.mark.parametrize("tolerance", [1e-8, 1e-10])
@pytest.mark.parametrize("intervals", [1, 3])
def test_dopri5_with_equal_tolerances_at_rates_of_minus_one(tolerance: float, intervals: int) -> None:
    """Its error scale, absolute + relative · rate, vanishes at -1: whatever the step makes of the motion is accepted.

    Few steps: each sample starts with one try for the whole interval. By more than a turn in a second, and "success".
    """
    chosen = replace(scene("extreme/rates-minus-one"), samples=intervals + 1)
    exact = run(chosen).trajectory
    equal = {"absolute_tolerance": tolerance, "relative_tolerance": tolerance}
    verdict = wrong(chosen, "exudyn_tree/dopri5", exact, **equal)
    assert verdict.metrics["angle_error_max"] > 2.0 * np.pi
    if intervals > 1:  # the bound of a defect is for intervals of some hundredths of a second
        assert judge(chosen, run(chosen, "exudyn_tree/dopri5"), exact).status == "ok"  # with a relative tolerance of 0


@pytest.mark.parametrize("method", ["exudyn_tree/rk44", "exudyn_tree/generalized_alpha"])
def test_a_solver_stopped_by_its_own_time_out(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It returns True before the end: what counts is the last sample."""
    monkeypatch.setattr(adapter.exudyn.special.solver, "timeout", 0.05)
    chosen = paper("fig08", duration=1000.0, samples=10_001)
    result = solve(method, chosen, {})
    assert len(result.trajectory.time) < chosen.samples
    verdict = caught(chosen, result)
    assert verdict.status == "diverged"
    assert verdict.message.startswith("no finite sample after the last one at t = ")


def test_a_body_that_falls_free_of_its_joints() -> None:
    """An explicit integration of the chain, set not to eliminate the constraints, drops them and returns True.

    One body, so that its mass matrix is regular without joints: hub and blade fall by g t²/2 and keep their energy.
    """
    rod = Blade(15000.0, (0.0, 0.0, 15.42), (1e5, 1e5, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 33.38))
    chosen = paper("fig03", duration=1.0, samples=11, blades=(rod,), hub_inertia=1e3)
    loads = Loads(chosen)
    scheme = Scheme("RK44", 4, {"explicit.eliminateConstraints": False}, step=1e-3)
    parts = chain.parts(chosen, loads, "rotation_vector")
    solver = MultibodySolver(chosen, parts, loads, scheme, sensor_samples.chain_trajectory, rows_between=True)
    integration = solver.integrate()
    result = Solution(chosen, "exudyn_chain/newmark_index2", solver.observe(), integration)
    verdict = caught(chosen, result)
    assert verdict.metrics["energy_drift_max"] <= 1e-12  # it is the open joint alone that tells
    assert verdict.metrics["constraint_error_max"] == pytest.approx(0.5 * chosen.gravity, rel=1e-9)


def test_nobody_gets_through_a_singularity() -> None:
    """One blade without hub inertia: whatever a method makes of it, it is not ok; the implicit ones step over it."""
    chosen = scene("extreme/singular-one-blade")
    exact = reference(chosen.name)
    assert len(exact.time) < chosen.samples
    for method in BOUNDS:
        # DOPRI5 has its own test: it does not end.
        if method == "exudyn_tree/dopri5" or not find_method(method).is_installed:
            continue
        with time_limit(20.0):
            result = run(chosen, method)
        assert judge(chosen, result, exact).status not in ("ok", "inaccurate"), method


def test_a_start_without_inertia_is_singular_for_all() -> None:
    chosen = scene("extreme/singular-start")
    for method in ("lagrange/taylor", "exudyn_tree/rk67"):
        assert judge(chosen, run(chosen, method), reference(chosen.name)).status == "singular"


@pytest.mark.parametrize(("step", "is_false"), [(0.1, True), (0.02, False)])
def test_a_coarse_step_is_told_apart_from_nonsense(step: float, is_false: bool) -> None:
    """On Fig. 11: a tenth of a second leaves RK44 defects of 0.1 rad, a fiftieth a motion with fewer digits."""
    chosen = paper("fig11", samples=101)
    verdict = judge(chosen, solve("exudyn_tree/rk44", chosen, {"step": step}), None)
    assert (verdict.status, verdict.false_success) == ("inaccurate", is_false)


def test_a_run_that_hangs_is_ended_with_what_it_reached() -> None:
    """DOPRI5 at the singular pitch repeats its smallest step for ever, if nobody counts."""
    chosen = scene("extreme/singular-one-blade")
    with time_limit(1.0):
        result = run(chosen, "exudyn_tree/dopri5", trial_steps=10**9)
    assert result.integration.out_of_time
    verdict = judge(chosen, result, reference(chosen.name))
    assert verdict.status == "timed_out"
    assert 1 < len(result.trajectory.time) < chosen.samples


@pytest.mark.parametrize("method", ["lagrange/taylor", "lagrange/dop853", "exudyn_tree/rk67", "mujoco/rk4"])
def test_a_long_run_keeps_its_samples_when_ended(method: str) -> None:
    if not find_method(method).is_installed:
        pytest.skip(f"{method} is not installed")
    chosen = replace(scene("extreme/pendulum-million"), duration=5e5, samples=200_001)
    found_method = find_method(method)
    solver = found_method.build(chosen, found_method.settings())
    with time_limit(0.3):
        integration = solver.integrate()
    assert integration.out_of_time
    assert not integration.success
    trajectory = solver.observe()
    assert 1 < len(trajectory.time) < chosen.samples
    assert np.isfinite(trajectory.angles).all()


def test_a_limit_costs_no_look_at_the_clock_after_every_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """And changes no bit of the run."""
    solver = find_method("lagrange/taylor").build(scene("paper/fig11"), find_method("lagrange/taylor").settings())
    solver.integrate()
    free, looks, monotonic = solver.observe(), [], time.monotonic
    monkeypatch.setattr(time, "monotonic", lambda: looks.append(1) or monotonic())
    with time_limit(60.0):
        steps = solver.integrate().steps
    assert len(looks) < 5 < steps
    assert np.array_equal(solver.observe().angles, free.angles)


def test_the_limit_reaches_plain_python() -> None:
    with pytest.raises(OutOfTimeError), time_limit(0.05):
        time.sleep(5.0)


def test_a_run_that_was_ended_is_not_repeated() -> None:
    """Short runs are repeated: the second would not be stopped, and its status would be that of a run without limit."""
    ended = Integration(False, "ended", out_of_time=True)
    solver = SimpleNamespace(integrate=lambda: ended, observe=lambda: made("lagrange/taylor")[1].trajectory)
    method = replace(find_method("lagrange/taylor"), build=lambda *_: solver)
    result = solve(method, scene("paper/fig05"), {}, repeats=5)
    assert result.integration.out_of_time
    assert len(result.run_times_s) == 1


def test_who_knows_that_time_is_up_is_not_interrupted_and_the_next_run_starts_afresh() -> None:
    """The signal may come a moment after the clock was read: samples on their way out must not be lost to it."""
    with time_limit(0.05):
        with polled():
            while not is_over():
                pass
        time.sleep(0.1)  # here the signal arrives, outside `polled`
    assert not is_over()
