"""What `check` measures beyond runs: symmetry, orders, references computed anew, the printed equations, the status
rules, run times. Each probe is a case whose study names the measurement; nothing of it is stored."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np

from rotor_mbs.analysis.exact import mirrored, relabelled
from rotor_mbs.analysis.verdicts import Verdict
from rotor_mbs.methods.catalogue import REFERENCE, method_names
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.lagrange.heyoka_adapter import is_available
from rotor_mbs.runs.case import Case
from rotor_mbs.scenario.accuracy_bounds import load_bounds
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.metrics import angle_error, horizon_samples, running_growth
from rotor_mbs.solution.trajectory import Array, Trajectory
from rotor_mbs.studies.check_printed import differences
from rotor_mbs.studies.check_status_rules import SCENE, known_runs, metrics_off, shares_off
from rotor_mbs.studies.ensembles import compare_ensembles
from rotor_mbs.studies.stored_references import frozen_solution

# Scenes of probes that need none of the shipped ones.
_OWN_SCENES = ("random states", "made by hand")

_CHAIN = "exudyn_chain/generalized_alpha"


def probe(kind: str, scene: str, method: str, expected: float = 0.0, **settings: object) -> Case:
    """A measurement: kind (a key of _KINDS), name of the scene, method, expected order or error, settings."""
    found = replace(SCENE, name=scene) if scene in _OWN_SCENES else find_scenes([scene])[0]
    return Case(found, method, settings, study=kind, options={"expected": expected})


def probes() -> list[Case]:
    """One scene with three different pitches, where every symmetry has something to move; orders where the step decides
    and round-off does not; references in quad precision, short and long."""
    return [
        probe("symmetry", "paper/fig11", "lagrange/taylor"),
        probe("symmetry", "paper/fig11", "exudyn_tree/rk67"),
        probe("symmetry", "paper/fig11", "mujoco/rk4"),
        probe("order", "paper/fig11", "mujoco/rk4", 4.0),
        probe("order", "paper/fig11", "mujoco/implicitfast", 1.0),
        probe("order", "paper/fig11", "exudyn_tree/rk44", 4.0),
        probe("order", "paper/fig11", _CHAIN, 2.0),
        probe("extrapolated", "paper/fig08", _CHAIN, 1e-9, extrapolation="richardson", newton_relative_tolerance=1e-12),
        probe("extrapolated", "paper/fig11", _CHAIN, 1e-6, extrapolation="richardson"),
        probe("ensemble", "paper/fig11", "exudyn_tree/rk67", 100, step=2e-3),
        probe("reference", "paper/fig08", REFERENCE),
        probe("reference", "paper/fig11", REFERENCE),
        probe("reference", "check/general", REFERENCE),
        probe("printed", "random states", "printed/ode45"),
        probe("rules", "made by hand", "*"),
    ]


# |ln| of the error growth: how far the difference quotients of the fallback may be off.
_QUOTIENTS = 0.02

_ORDER_STEPS = (0.002, 0.001, 0.0005, 0.00025)  # s


def measure(case: Case) -> list[Verdict]:
    """The measurements of a probe, not yet with a bound; NaN where a run did not get to its end."""
    return list(_KINDS[case.study](case))


def measured(case: Case, channel: str, value: float, unit: str = "", look_at: str = "") -> Verdict:
    """A number that no results file holds."""
    return Verdict(case.study, case.scene.name, case.method, channel, value, math.nan, unit, look_at)


def _scene(case: Case, duration: float) -> Scene:
    return replace(case.scene, duration=duration, samples=1 + round(100 * duration), outputs=("angles", "rates"))


def _frozen(case: Case) -> Trajectory:
    return frozen_solution(case.scene, case.scene_hash)[0].trajectory


def _run(case: Case, scene: Scene, **settings: object) -> Trajectory | None:
    run = solve(case.method, scene, settings)
    return run.trajectory if len(run.trajectory.time) == scene.samples else None


def _symmetry(case: Case) -> list[Verdict]:
    """Every blade in the place of the next one and the rotor turned back by one; the mirror image in the rotor's plane.

    The mirror turns y into -y: azimuths stay, pitches change sign.
    """
    scene = _scene(case, 2.0)
    base, count = _run(case, scene), 1 + len(scene.blades)
    growth = running_growth(_frozen(case))[: scene.samples]
    found = []
    for name, variant, columns, sign in (
        ("blades permuted", relabelled(scene), [*range(2, count), 1], 1.0),
        ("mirrored along the shaft", mirrored(scene), list(range(1, count)), -1.0),
    ):
        other = _run(case, variant)
        value = math.nan
        if base is not None and other is not None:
            pitches = np.abs(sign * other.angles[:, columns] - base.angles[:, 1:]).max(axis=1)
            value = float((pitches / growth).max())
        look = "a blade's phase, or a term that knows its blade's number or side"
        found.append(measured(case, name, value, "per growth", look))
    return found


def _order(case: Case) -> list[Verdict]:
    """The slope of log error over log step, against the reference, over 0.5 s."""
    scene = _scene(case, 0.5)
    exact = _frozen(case).angles[: scene.samples]
    expected = float(str(case.options["expected"]))
    errors = []
    for step in _ORDER_STEPS:
        found = _run(case, scene, step=step)
        errors.append(math.nan if found is None else float(np.abs(found.angles - exact).max()))
    order = float(np.polyfit(np.log(_ORDER_STEPS), np.log(errors), 1)[0]) if np.isfinite(errors).all() else math.nan
    look = f"fitted {order:.3f}, expected {expected:g}: the scheme, or a force evaluated at the wrong time"
    return [measured(case, "angles", abs(order - expected), "", look)]


def _extrapolated(case: Case) -> list[Verdict]:
    """The error of angles with an uncertainty, of the expected one and of this uncertainty.

    Over the whole run where its pitches that are zero stay so, up to the horizon else: there any rounding has grown.
    """
    frozen = _frozen(case)
    moves = frozen.angles[:, 1:].any(axis=0).all()
    count = horizon_samples(frozen) if moves else len(frozen.time)
    scene = replace(_scene(case, float(frozen.time[count - 1])), samples=count)
    found, expected = _run(case, scene, **case.settings), float(str(case.options["expected"]))
    largest = share = math.nan
    if found is not None and found.angle_uncertainty is not None:
        error = angle_error(found, frozen)
        largest, share = float(error.max()), float((error / found.angle_uncertainty).max())
    look = f"{largest:.1e} rad, expected at most {expected:g} rad: the chain, or Newton's residual"
    return [
        measured(case, "angles", largest / expected, "of expected", look),
        measured(case, "angles, of their uncertainty", share, "of uncertainty", look),
    ]


def _ensemble(case: Case) -> Iterator[Verdict]:
    """Beyond the horizon: distributions over many starts, of the method and of the closed form, three times as many."""
    count = int(str(case.options["expected"]))
    for one in compare_ensembles(case.scene, "lagrange/taylor", case.method, (3 * count, count), case.settings):
        quantiles = ", ".join(f"{value:.2f}" for value in one.quantiles)
        look = (
            f"{3 * count} and {count} runs to {case.scene.duration:g} s; quantiles 10, 50, 90 % differ by {quantiles} "
            "standard deviations: a term that counts after the horizon, or the energy there"
        )
        yield measured(case, one.channel, max(one.distance, one.mean), "of critical", look)


def _reference(case: Case) -> list[Verdict]:
    """Computed now against frozen; a fallback reference is compared within its own uncertainty."""
    scene = case.scene
    frozen = _frozen(case)
    found = solve(REFERENCE, scene, {}).trajectory
    look = "the closed form, its coefficients, or a touched file under reference/"
    if len(found.time) != scene.samples or found.angle_uncertainty is None or found.error_growth is None:
        return [measured(case, "recomputed", math.nan, "rad", look)]
    off = np.abs(found.angles - frozen.angles).max(axis=1)
    beyond = float(np.maximum(off - found.angle_uncertainty, 0.0).max())
    if found.angle_uncertainty.max() > 1e-12:
        worst = found.angle_uncertainty.max()
        look += f"; a fallback in double precision, uncertain to {worst:.0e} rad, which is allowed for"
    growth = np.abs(np.log(running_growth(found) / running_growth(frozen)))
    if not is_available():  # its difference quotients decide no horizon
        growth = np.maximum(growth - _QUOTIENTS, 0.0)
    until = horizon_samples(frozen)
    return [
        measured(case, "recomputed angles", beyond, "rad", look),
        replace(measured(case, "error growth", float(growth[:until].max()), "log", look), check="growth"),
        *_uncertainty(case, found.angle_uncertainty, frozen),
    ]


def _uncertainty(case: Case, found: Array, frozen: Trajectory) -> list[Verdict]:
    """|ln| of its ratio to the frozen one; that of the fallback is another, and allowed for above."""
    if not is_available() or frozen.angle_uncertainty is None:
        return []
    used = (found > 0.0) & (frozen.angle_uncertainty > 0.0)
    off = float(np.abs(np.log(found[used] / frozen.angle_uncertainty[used])).max(initial=0.0))
    look = "the tolerances of the two quad precision runs, or what is made of their difference"
    return [replace(measured(case, "angle uncertainty", off, "log", look), check="uncertainty")]


def _printed(case: Case) -> Iterator[Verdict]:
    for channel, off, look in differences():
        yield measured(case, channel, off, "relative", look)


def _rules(case: Case) -> Iterator[Verdict]:
    """One number for each known run: 1 where its status is not the known one."""
    for run in known_runs(load_bounds(), method_names(is_corrected=True)):
        fault = run.faults()
        look = fault or "its known status"
        yield replace(measured(case, run.name, float(bool(fault)), "faults", look), method=run.method)
    for channel, off in metrics_off():
        look = f"off by {off:.1e}: a number that is stored with a run"
        yield measured(case, channel, float(not off <= 1e-12), "faults", look)
    for scene in find_scenes(["check"]):
        off = shares_off(scene)
        look = f"off by {off:.1e}: what decides that a motion is singular"
        yield replace(measured(case, "rotor inertia share", float(not off <= 1e-12), "faults", look), scene=scene.name)


def _speed(case: Case) -> list[Verdict]:
    """Run time over that of a fixed piece of arithmetic just before and after it, against the ratio on file.

    The median over fifteen runs: other load of the machine affects both, or one run alone.
    """
    scene = _scene(case, 10.0)
    solve(case.method, scene, {})
    ratios, before = [], _calibration()
    for _ in range(_SPEED_RUNS):
        run = solve(case.method, scene, {}, repeats=3)
        after = _calibration()
        ratios.append(min(run.run_times_s) / (0.5 * (before + after)))
        before = after
    ratio = float(np.median(ratios))
    expected = SPEED_RATIOS[case.method]
    look = f"{ratio:.3g} calibration runs, {expected:g} on file: a slower engine, or our own code around it"
    return [measured(case, "run time", ratio / expected, "times", look)]


def _calibration() -> float:
    """Seconds that four million multiplications, each of the one before, take here and now.

    In NumPy's compiled loop: a chain that no wider vector unit and no faster interpreter shortens.
    """
    ones = np.ones(4000)
    start = time.perf_counter()
    for _ in range(1000):
        np.multiply.accumulate(ones)
    return time.perf_counter() - start


_SPEED_RUNS = 15
# On the machine of docs/findings.md, otherwise idle, twice by Python 3.11, 3.12, 3.13: 0.20 to 0.23, 13.0 to 13.2.
SPEED_RATIOS = {"lagrange/taylor": 0.23, "exudyn_tree/rk67": 13.1}


_KINDS: dict[str, Callable[[Case], Iterable[Verdict]]] = {
    "symmetry": _symmetry,
    "order": _order,
    "ensemble": _ensemble,
    "extrapolated": _extrapolated,
    "reference": _reference,
    "printed": _printed,
    "rules": _rules,
    "speed": _speed,
}
