"""The status rules on constructed runs whose status is known: each rule from both sides. Knows no engine, no file."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from rotor_mbs.analysis import kinematics
from rotor_mbs.methods.catalogue import is_corrected
from rotor_mbs.scenario.accuracy_bounds import Bounds
from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.solution.judgement import judge, rotor_inertia_shares
from rotor_mbs.solution.metrics import ANGLE_LIMIT, metrics_of
from rotor_mbs.solution.solution import Solution
from rotor_mbs.solution.trajectory import Array, Integration, Trajectory

_DONE, _FAILED = Integration(True), Integration(False, "gave up")
_OUT_OF_TIME = Integration(False, "ended", 0.5, out_of_time=True)
_METHOD = "lagrange/taylor"
_GRAVITY, _STIFFNESS, _SPRUNG = 0.5, 2e4, 0.5
_LONG = Blade(1000.0, (0.1, 0.0, 10.0), (0.0,) * 6, (0.1, 0.0, 20.0))
_SHORT = Blade(1000.0, (0.1, 0.0, 5.0), (0.0,) * 6, (0.1, 0.0, 20.0))
SCENE = Scene(
    "rules", "three point masses in uniform rotation", (), _GRAVITY, 1.0, 11, ("angles", "rates", "energy"),
    (_SHORT, _LONG, _LONG), 0.0, (0.0, _SPRUNG, 0.0, 0.0), (0.5, 0.0, 0.0, 0.0),
    bearing_stiffness=(_STIFFNESS, 0.0, 0.0), bearing_rest=(((0.0, -_SPRUNG),), (), ()),
)  # fmt: skip
_WORK_J = 3000.0
_KINETIC_J = 0.5 * 1000.0 * (3 * 0.1**2 + 2 * 10.0**2 + 5.0**2) * 0.5**2
_ENERGY_J = (
    _KINETIC_J
    + _WORK_J
    + 0.5 * _STIFFNESS * (2.0 * _SPRUNG) ** 2
    + 1000.0 * _GRAVITY * (2.0 * math.hypot(0.1, 10.0) + math.hypot(0.1, 5.0))
)  # what an energy error is relative to
_JUST = 1e-2  # how far on either side of a bound, relatively: far above round-off of a state


@dataclass(frozen=True)
class KnownRun:
    """A run whose status is known."""

    name: str
    status: str
    trajectory: Trajectory
    engine: Integration = field(default_factory=lambda: _DONE)
    reference: Trajectory | None = None
    is_false_success: bool | None = False  # None: not asked
    method: str = _METHOD

    def faults(self) -> str:
        """What the judgement says against what is known; "" where it is right."""
        run = Solution(SCENE, self.method, self.trajectory, self.engine, is_corrected=is_corrected(self.method))
        with np.errstate(all="ignore"):
            found = judge(SCENE, run, self.reference)
        if found.status != self.status:
            return f"a run that is {self.status} is called {found.status}"
        if self.is_false_success not in (None, found.false_success):
            return f"false success is {self.is_false_success} and called {found.false_success}"
        return ""


def known_runs(bounds: Bounds, methods: tuple[str, ...]) -> list[KnownRun]:
    """`bounds`: those that the statuses follow; `methods`: those with bounds."""
    rules = [_at_the_bounds(method, bounds) for method in methods]
    rules += [_broken_off(), _singular(), _conditioned(bounds), _carried(bounds), _gross(), _unbounded()]
    return [run for rule in rules for run in rule]


def metrics_off() -> Iterator[tuple[str, float]]:
    """(metric, relative error) of what is stored beside a status, for a run off by known amounts."""
    exact = _moving().replace(error_growth=_growth(2e5))  # the horizon is sample 3
    exact.tip = np.zeros((11, 3, 3))
    wrong = _with_error(_with_error(_moving(), 0.1, 2), 0.3, 10)
    wrong.tip = np.zeros((11, 3, 3))
    wrong.tip[1, 2] = (3.0, 0.0, 4.0)
    wrong.tip[8, 1] = (30.0, 0.0, 40.0)
    whole = metrics_of(SCENE, wrong, exact)
    known = {
        "horizon_s": 0.3,
        "angle_error_max": 0.1,
        "angle_error_whole": 0.3,
        "angle_error_end": 0.3,
        "tip_error_max": 5.0,
    }
    for name, value in known.items():
        yield name, abs(whole.get(name, math.nan) / value - 1.0)
    errors = {"angle_error_max", "angle_error_per_growth", "tip_error_max"}
    at_once = exact.replace(error_growth=np.where(np.arange(11) < 1, 1.0, 2e5))  # the start alone is before its horizon
    for name, run, reference, expected in (
        ("stopped early", _cut(wrong, 2).replace(tip=wrong.tip[:2]), exact, errors | {"angle_error_whole"}),
        ("gone on past its reference", wrong, _cut(exact, 5), errors - {"tip_error_max"} | {"angle_error_whole"}),
        ("stopped at the start", _cut(wrong, 1), exact, set()),
        ("past the horizon at once", wrong, at_once, {"angle_error_whole", "angle_error_end"}),
    ):
        found = metrics_of(SCENE, run, reference).keys() & (errors | {"angle_error_whole", "angle_error_end"})
        yield f"metrics of a run {name}", float(len(found ^ expected))


def shares_off(scene: Scene) -> float:
    """The rotor's remaining share of inertia against the one from a mass matrix by plain rotation, at random."""
    rng = np.random.default_rng(2020)
    count = 1 + len(scene.blades)
    off = []
    for angles in rng.uniform(-math.pi, math.pi, (5, 1, count)):
        mass = np.zeros((count, count))  # T is ½ q̇·M q̇: by polarisation
        for i, j in itertools.product(range(count), repeat=2):
            rates = [np.eye(count)[i] + sign * np.eye(count)[j] for sign in (1.0, -1.0)]
            plus, minus = (kinematics.kinetic_energy(scene, angles, rate[None])[0] for rate in rates)
            mass[i, j] = 0.5 * (plus - minus)
        free = scene.moving_coordinates[1:]
        share = 1.0 - sum(mass[0, i] ** 2 / mass[i, i] for i in free) / mass[0, 0]
        off.append(abs(float(rotor_inertia_shares(scene, angles)[0]) - share))
    return float(np.max(off))  # NaN where one is


def _moving(pitch: float = 0.0) -> Trajectory:
    """Uniform rotation, every pitch at `pitch` rad; energies that change into each other without loss."""
    time = np.linspace(0.0, 1.0, 11)
    angles, rates = np.full((11, 4), pitch), np.zeros((11, 4))
    angles[:, 0], rates[:, 0] = 0.5 * time, 0.5
    work = _WORK_J * time
    return Trajectory(
        time, angles, rates, kinetic_energy=_KINETIC_J + 3.0 * work, potential_energy=7.0 - 2.0 * work, work=work
    )


def _cut(trajectory: Trajectory, rows: int) -> Trajectory:
    parts = ("time", "angles", "rates", "kinetic_energy", "potential_energy", "work")
    return Trajectory(**{part: getattr(trajectory, part)[:rows] for part in parts})


def _with_drift(trajectory: Trajectory, share: float) -> Trajectory:
    """An energy error of `share` of the scale in the middle of the run."""
    assert trajectory.kinetic_energy is not None
    energy = trajectory.kinetic_energy.copy()
    energy[5] += share * _ENERGY_J
    return trajectory.replace(kinetic_energy=energy)


def _with_error(trajectory: Trajectory, error: float, row: int = 5, column: int = 0) -> Trajectory:
    angles = trajectory.angles.copy()
    angles[row, column] += error
    return trajectory.replace(angles=angles)


def _at_the_bounds(method: str, bounds: Bounds) -> Iterator[KnownRun]:
    exact = _moving()
    energy, angle = bounds.of("energy", method).value, bounds.of("agreement", method).value
    for side, status in ((1.0 - _JUST, "ok"), (1.0 + _JUST, "inaccurate"), (math.nan, "inaccurate")):
        known = partial(KnownRun, method=method, is_false_success=None if math.isnan(side) else False)
        yield known(f"energy drift of {side:g} bounds", status, _with_drift(exact, side * energy))
        yield known(f"angle error of {side:g} bounds", status, _with_error(exact, side * angle), reference=exact)
        if bounds.find("gap", method):
            gap = np.full(11, side * bounds.of("gap", method).value * math.hypot(0.1, 10.0))
            yield known(f"gap of {side:g} bounds", status, exact.replace(constraint_error=gap))
    if not bounds.find("gap", method):
        opened = exact.replace(constraint_error=np.full(11, 1e-15))
        yield KnownRun("a gap without a joint", "inaccurate", opened, method=method)


def _broken_off() -> Iterator[KnownRun]:
    exact = _moving()
    nothing = Trajectory(np.empty(0), np.empty((0, 4)), np.empty((0, 4)))  # with no sample there are no energies
    yield KnownRun("complete, the engine reports success", "ok", exact)
    silent = exact.replace(kinetic_energy=None, potential_energy=None, work=None)
    yield KnownRun("complete, nothing to judge it by", "unchecked", silent)
    yield KnownRun("complete, judged by its angles alone", "ok", silent, reference=exact)
    at_once = exact.replace(error_growth=np.where(np.arange(11) < 1, 1.0, 2e5))
    yield KnownRun("energies missing, past the horizon at once", "unchecked", silent, reference=at_once)
    for side, status in ((1.0 - _JUST, "ok"), (1.0 + _JUST, "unchecked")):
        far = exact.replace(angles=exact.angles.copy())
        far.angles[5, 0] = -side * ANGLE_LIMIT
        yield KnownRun(f"a rotor angle of {side:g} times the limit", status, far)
    yield KnownRun("complete, the engine reports failure", "solver_failed", exact, _FAILED)
    short = _cut(exact, 10)
    yield KnownRun("one sample short of the end, a claim of success", "diverged", short, is_false_success=True)
    yield KnownRun("one sample short of the end, a failure", "solver_failed", _cut(exact, 10), _FAILED)
    yield KnownRun("short of the end, out of time", "timed_out", _cut(exact, 5), _OUT_OF_TIME)
    yield KnownRun("no sample, a claim of success", "diverged", nothing, is_false_success=True)
    yield KnownRun("no sample, a failure", "solver_failed", nothing, _FAILED)


def _singular() -> Iterator[KnownRun]:
    """Every pitch at ±π/2 leaves the rotor cos²θ of its inertia."""
    exact = _moving()
    near, far = (_moving(math.acos(math.sqrt(share))) for share in (0.8e-3, 1.2e-3))
    yield KnownRun("broken off near the singularity", "singular", _cut(near, 5), _FAILED)
    yield KnownRun("broken off away from the singularity", "solver_failed", _cut(far, 5), _FAILED)
    rim = math.acos(math.sqrt(1e-3))  # the pitch at which "near" begins; a sample's interval is 0.1 s
    for beyond, status in ((0.001, "singular"), (-0.001, "solver_failed")):
        on_the_way = _cut(_moving(rim - 0.1 + beyond), 5)
        on_the_way.rates[-1, 1:] = 1.0
        yield KnownRun(f"broken off {0.1 - beyond:g} s before it", status, on_the_way, _FAILED)
    yield KnownRun("from a singular start to the end", "singular", _moving(0.5 * math.pi), is_false_success=True)
    # Four and five doubles below π/2: shares of 9.0e-31 and 1.4e-30.
    four, five = (0.5 * math.pi - math.ulp(1.0) * count for count in (4, 5))
    yield KnownRun("from the last singular start to the end", "singular", _moving(four), is_false_success=True)
    yield KnownRun("from the first regular start to the end", "ok", _moving(five))
    ended = _cut(near, 5)
    yield KnownRun("past the end of the motion", "singular", exact, reference=ended, is_false_success=True)
    yield KnownRun("past the end of a reference that merely stops", "ok", far, reference=_cut(far, 5))


def _conditioned(bounds: Bounds) -> Iterator[KnownRun]:
    """Near ±π/2 the energy magnifies round-off, 1e-14 of it, by √(1e-3/share): at a sample and between two."""
    allowed = bounds.of("energy", _METHOD).value
    near = _moving(math.acos(math.sqrt(1e-13)))  # 1e5-fold: 1e-9 more than without
    for side, status in ((1.0 - _JUST, "ok"), (1.0 + _JUST, "inaccurate")):
        drift = allowed + side * (1e5 - 1.0) * 1e-14
        yield KnownRun(f"drift of {side:g} of what a small share allows", status, _with_drift(near, drift))
    apart = _with_drift(_one_by_one(), 2.0 * allowed)
    yield KnownRun("drift, one after the other through π/2", "inaccurate", apart)
    for sign in (1.0, -1.0):
        through = _through(sign * 0.5, 1.5)
        yield KnownRun("drift, between samples through ±π/2", "ok", _with_drift(through, 1e3 * allowed))
        beside = _through(sign * 0.5, 0.1, others=0.5)
        yield KnownRun("drift, one of three through ±π/2", "inaccurate", _with_drift(beside, 2.0 * allowed))
        leap = _through(sign * 0.5, 1.65)
        yield KnownRun("drift, in leaps over ±π/2", "inaccurate", _with_drift(leap, 2.0 * allowed))


def _one_by_one() -> Trajectory:
    """Two pitches through π/2 between the same two samples, at different instants; the third stays there."""
    trajectory = _moving(0.5 * math.pi)
    late = np.where(np.arange(11) <= 5, -1.0, 0.0)
    trajectory.angles[:, 1] = 0.5 * math.pi + late + 0.2
    trajectory.angles[:, 2] = 0.5 * math.pi + late + 0.8
    return trajectory


def _through(quarter: float, step: float, others: float | None = None) -> Trajectory:
    """Pitches past quarter·π in the middle between samples 5 and 6, the fastest `step` rad at once; `others` stay.

    At different rates: they are at quarter·π together at that instant alone.
    """
    trajectory = _moving()
    way = np.where(np.arange(11) <= 5, -0.5, 0.5) * step
    trajectory.angles[:, 1:] = quarter * math.pi + way[:, None] * [1.0, 0.8, 0.6]
    if others is not None:
        trajectory.angles[:, 2:] = others
    return trajectory


def _carried(bounds: Bounds) -> Iterator[KnownRun]:
    """A scene's own error growth, and the size of its angles, are not the method's fault; past the horizon none is."""
    allowed = bounds.of("agreement", _METHOD).value
    cases = (
        # growth; the rotor's start, its way from there to the error, a pitch; coordinate of the error; what is allowed
        (100.0, 0.0, 0.0, 0.0, 0, 100.0),
        (0.01, 0.0, 0.0, 0.0, 0, 1.0),
        (1.0, 0.0, 7.0, 0.0, 0, 7.0),
        (1.0, 0.0, 7.0, 0.0, 1, 1.0),
        (1.0, 0.0, 0.0, 7.0, 1, 7.0),
        (1.0, 0.0, 0.0, 7.0, 0, 1.0),
        (1.0, 7.0, 0.0, 0.0, 0, 1.0),
    )
    for growth, start, way, pitch, column, factor in cases:
        exact = _moving().replace(error_growth=_growth(growth))
        exact.angles[:, 0] = start + 2.0 * way * exact.time
        exact.angles[:, 2] = pitch
        for side, status in ((1.0 - _JUST, "ok"), (1.0 + _JUST, "inaccurate")):
            name = f"error of {side:g} bounds in {column}: growth {growth:g}, start {start:g}, {way:g}, pitch {pitch:g}"
            wrong = _with_error(exact, side * allowed * factor, column=column)
            yield KnownRun(name, status, wrong, reference=exact)
    for growth, status in ((0.9e5, "inaccurate"), (1.1e5, "ok")):
        exact = _moving().replace(error_growth=_growth(growth))
        yield KnownRun(f"error at growth {growth:g}", status, _with_error(exact, 0.1, 8), reference=exact)
    early = _moving().replace(error_growth=_growth(1.0))
    early.error_growth[2] = 200.0
    wrong = _with_error(early, 100.0 * allowed, 8)
    yield KnownRun("error after a growth that has gone back", "ok", wrong, reference=early)


def _growth(value: float) -> Array:
    """One until sample 3, then `value`."""
    return np.where(np.arange(11) < 4, 1.0, value)


def _gross() -> Iterator[KnownRun]:
    """A hundredth of the scale or of the angle parts a coarse run from one that is another motion."""
    exact = _moving()
    for side, lie in ((1.0 - _JUST, False), (1.0 + _JUST, True)):
        drifting, wrong = _with_drift(exact, side * 1e-2), _with_error(exact, side * 1e-2)
        yield KnownRun(f"a drift of {side:g} %", "inaccurate", drifting, is_false_success=lie)
        yield KnownRun(f"an error of {side:g} %", "inaccurate", wrong, reference=exact, is_false_success=lie)


def _unbounded() -> Iterator[KnownRun]:
    """The printed equations have no bounds for energy and error: they must reach the end, no more."""
    exact, known = _moving(), partial(KnownRun, method="printed/ode45")
    yield known("printed, far off", "ok", _with_drift(_with_error(exact, 1.0), 1.0), reference=exact)
    yield known("printed, broken off", "solver_failed", _cut(exact, 5), _FAILED)
    yield known("printed, past the motion's end", "ok", exact, reference=_cut(_moving(1.5707), 5))
