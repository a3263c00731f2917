"""What `check` measures beyond a batch's own runs: symmetry, orders, references anew, the print, the rules, run times.

Each function is a task of its own for the pool: picklable, by name.
"""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from rotor_mbs.errors import StoreError
from rotor_mbs.methods.base import solve
from rotor_mbs.methods.catalogue import METHOD_NAMES, REFERENCE, find_method
from rotor_mbs.scenario.bounds import load_bounds
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.resources import reference_folder
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.judgement import is_held
from rotor_mbs.solution.metrics import horizon_samples, running_growth
from rotor_mbs.solution.record import Array, Trajectory
from rotor_mbs.store.read import open_results
from rotor_mbs.studies.check_printed import differences
from rotor_mbs.studies.check_rules import cases, metrics_off, shares_off


@dataclass(frozen=True)
class Measured:
    """A number for a verdict that no results file holds."""

    check: str
    scene: str
    method: str
    channel: str
    value: float
    unit: str
    look_at: str


@dataclass(frozen=True)
class Probe:
    """A measurement to make: kind (a key of _KINDS), scene, method, expected order."""

    kind: str
    scene: str
    method: str
    expected: float = 0.0


# One scene with three different pitches, where every symmetry has something to move; orders where the step decides
# and round-off does not; references in quad precision, short and long.
PROBES = (
    Probe("symmetry", "paper/fig11", "lagrange/taylor"),
    Probe("symmetry", "paper/fig11", "exudyn_tree/rk67"),
    Probe("order", "paper/fig11", "exudyn_tree/rk44", 4.0),
    Probe("order", "paper/fig11", "exudyn_chain/generalized_alpha", 2.0),
    Probe("reference", "paper/fig08", REFERENCE),
    Probe("reference", "paper/fig11", REFERENCE),
    Probe("reference", "check/general", REFERENCE),
    Probe("printed", "random states", "printed/ode45"),
    Probe("rules", "made by hand", "*"),
)
SPEED_PROBES = (
    Probe("speed", "paper/fig11", "lagrange/taylor"),
    Probe("speed", "paper/fig11", "exudyn_tree/rk67"),
)

_ORDER_STEPS = {4.0: (0.002, 0.001, 0.0005, 0.00025), 2.0: (0.002, 0.001, 0.0005, 0.00025)}  # s


def measure(probe: Probe) -> list[Measured]:
    """The measurement, or NaN where a run did not get to its end."""
    return list(measurements(probe))


def measurements(probe: Probe) -> Iterable[Measured]:
    """The same one by one."""
    return _KINDS[probe.kind](probe)


def _scene(probe: Probe, duration: float) -> Scene:
    scene = find_scenes([probe.scene])[0]
    return replace(scene, duration=duration, samples=1 + round(100 * duration), outputs=("angles", "rates"))


def _run(probe: Probe, scene: Scene, **settings: object) -> Trajectory | None:
    run = solve(probe.method, find_method(probe.method), scene, settings)
    return run.trajectory if len(run.trajectory.time) == scene.samples else None


def _symmetry(probe: Probe) -> list[Measured]:
    """Every blade handed on to the next place and the rotor turned back by one; the mirror image in the rotor's plane.

    The mirror turns y into -y: azimuths stay, pitches change sign.
    """
    scene = _scene(probe, 2.0)
    base = _run(probe, scene)
    q, w = scene.initial_angles, scene.initial_rates
    back = 2.0 * math.pi / len(scene.blades)
    handed = replace(
        scene,
        initial_angles=(q[0] - back, q[-1], *q[1:-1]),
        initial_rates=(w[0], w[-1], *w[1:-1]),
        blades=(scene.blades[-1], *scene.blades[:-1]),
    )
    mirrored = replace(scene, initial_angles=(q[0], *(-a for a in q[1:])), initial_rates=(w[0], *(-r for r in w[1:])))
    growth = _growth(probe.scene, scene.samples)
    found = []
    for name, variant, columns, sign in (
        ("blades handed on", handed, [2, *range(3, len(q)), 1], 1.0),
        ("mirrored along the shaft", mirrored, list(range(1, len(q))), -1.0),
    ):
        other = _run(probe, variant)
        value = math.nan
        if base is not None and other is not None:
            pitches = np.abs(sign * other.angles[:, columns] - base.angles[:, 1:]).max(axis=1)
            value = float((pitches / growth).max())
        look = "a blade's phase, or a term that knows its blade's number or side"
        found.append(Measured("symmetry", probe.scene, probe.method, name, value, "per growth", look))
    return found


def _order(probe: Probe) -> list[Measured]:
    """The slope of log error over log step, against the reference, over 0.5 s."""
    scene = _scene(probe, 0.5)
    exact = _frozen(probe.scene).angles[: scene.samples]
    steps = _ORDER_STEPS[probe.expected]
    errors = []
    for step in steps:
        found = _run(probe, scene, step=step)
        errors.append(math.nan if found is None else float(np.abs(found.angles - exact).max()))
    order = float(np.polyfit(np.log(steps), np.log(errors), 1)[0]) if np.isfinite(errors).all() else math.nan
    look = f"fitted {order:.3f}, expected {probe.expected:g}: the scheme, or a force evaluated at the wrong time"
    return [Measured("order", probe.scene, probe.method, "angles", abs(order - probe.expected), "", look)]


def _reference(probe: Probe) -> list[Measured]:
    """Computed now against frozen; a stand-in is worth its own uncertainty and is held to that."""
    scene = find_scenes([probe.scene])[0]
    frozen = _frozen(probe.scene)
    found = solve(REFERENCE, find_method(REFERENCE), scene, {}).trajectory
    look = "the closed form, its coefficients, or a touched file under reference/"
    if len(found.time) != scene.samples or found.angle_uncertainty is None or found.error_growth is None:
        return [Measured("reference", probe.scene, REFERENCE, "recomputed", math.nan, "rad", look)]
    off = np.abs(found.angles - frozen.angles).max(axis=1)
    beyond = float(np.maximum(off - 10.0 * found.angle_uncertainty, 0.0).max())
    if found.angle_uncertainty.max() > 1e-12:
        worst = found.angle_uncertainty.max()
        look += f"; a stand-in in double precision, uncertain to {worst:.0e} rad, which is allowed for"
    growth = np.abs(np.log(running_growth(found) / running_growth(frozen)))
    until = horizon_samples(frozen)
    return [
        Measured("reference", probe.scene, REFERENCE, "recomputed angles", beyond, "rad", look),
        Measured("growth", probe.scene, REFERENCE, "error growth", float(growth[:until].max()), "log", look),
    ]


def _printed(probe: Probe) -> Iterator[Measured]:
    for channel, off, look in differences():
        yield Measured("printed", probe.scene, probe.method, channel, off, "relative", look)


def _rules(probe: Probe) -> Iterator[Measured]:
    """One number for each hand-made run: 1 where it is called what it is not."""
    held = tuple(name for name in METHOD_NAMES if is_held(name))
    for case in cases(load_bounds(), held):
        fault = case.faults()
        look = fault or "called what it is"
        yield Measured("rules", probe.scene, case.method, case.name, float(bool(fault)), "faults", look)
    for channel, off in metrics_off():
        look = f"off by {off:.1e}: a number that is stored with a run"
        yield Measured("rules", probe.scene, "*", channel, float(not off <= 1e-12), "faults", look)
    for scene in find_scenes(["check"]):
        off = shares_off(scene)
        look = f"off by {off:.1e}: what decides that a motion is singular"
        yield Measured("rules", scene.name, "*", "rotor inertia share", float(not off <= 1e-12), "faults", look)


def _speed(probe: Probe) -> list[Measured]:
    """Run time over that of a fixed piece of arithmetic just before and after it, against the ratio on file.

    The median over fifteen runs: what else the machine does hits both, or one run and not the others.
    """
    scene = _scene(probe, 10.0)
    method = find_method(probe.method)
    solve(probe.method, method, scene, {})
    ratios, before = [], _calibration()
    for _ in range(_SPEED_RUNS):
        run = solve(probe.method, method, scene, {}, repeats=3)
        after = _calibration()
        ratios.append(min(run.run_times_s) / (0.5 * (before + after)))
        before = after
    ratio = float(np.median(ratios))
    expected = SPEED_RATIOS[probe.method]
    look = f"{ratio:.3g} calibration runs, {expected:g} on file: a slower engine, or our own code around it"
    return [Measured("speed", probe.scene, probe.method, "run time", ratio / expected, "times", look)]


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
# On the machine named in the README, otherwise idle, twice by Python 3.11, 3.12, 3.13 each: 0.20 to 0.23, 13.0 to 13.2.
SPEED_RATIOS = {"lagrange/taylor": 0.23, "exudyn_tree/rk67": 13.1}


@functools.cache
def _frozen(name: str) -> Trajectory:
    """The shipped reference of a shipped scene. Raises StoreError where there is none."""
    for path in sorted(reference_folder().glob("*.h5")):
        with open_results(path) as results:
            stored = results.scenes[name].reference if name in results.scenes else None
            if stored is not None:
                parts = ("time", "angles", "rates", "error_growth")
                time_, angles, rates, growth = (stored.array(part) for part in parts)
                return Trajectory(time_, angles, rates, error_growth=growth)
    raise StoreError(f"{reference_folder()}: no frozen reference of {name}; `rotor-mbs reference` makes one")


def _growth(name: str, samples: int) -> Array:
    return running_growth(_frozen(name))[:samples]


_KINDS: dict[str, Callable[[Probe], Iterable[Measured]]] = {
    "symmetry": _symmetry,
    "order": _order,
    "reference": _reference,
    "printed": _printed,
    "rules": _rules,
    "speed": _speed,
}
