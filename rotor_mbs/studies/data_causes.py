"""What data that do not agree look like: mistakes in the data, then other scenes and equations, each of them run.

A mistake is tried by comparing the data so corrected with the reference, or with a run at the corrected times.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import linear_sum_assignment

from rotor_mbs.errors import RotorError
from rotor_mbs.foreign.channels import ForeignData
from rotor_mbs.methods.time_limit import OutOfTimeError, time_limit
from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.ode_solvers import Accelerations
from rotor_mbs.models.lagrange.reference import LEFT_OUT, TimedReference, at_azimuths, motion_at
from rotor_mbs.models.ode45 import Ode45Settings
from rotor_mbs.models.printed.derivation import Errata
from rotor_mbs.models.printed.methods import PrintedModel
from rotor_mbs.scenario.catalogue import find_scenes, list_scenes
from rotor_mbs.scenario.scene import Blade, Scene, scene_fields
from rotor_mbs.solution.metrics import horizon, running_growth
from rotor_mbs.solution.trajectory import Array, Trajectory
from rotor_mbs.studies.defect_causes import MAX_LEFT, Change, DefectCauses, Parameter, fault_lines

# A cause fits where what is left is within the tolerance, or a thousandth of what there was and at most this.
_LEFT = 1e-3
_MOST_LEFT = 1e-4
FEWEST = 5  # rows: with fewer, something always fits
_LONGEST_S = 5.0  # of one run: a scene of the catalogue may be so stiff that it would take minutes
_DEGREE, _TURN = math.pi / 180.0, 2.0 * math.pi
_FACTORS = {
    "angle": (
        (_DEGREE, "degrees taken as rad"),
        (1.0 / _DEGREE, "rad taken as degrees"),
        (_TURN, "turns taken as rad"),
    ),
    "rate": ((_DEGREE, "deg/s taken as rad/s"), (_TURN / 60.0, "rpm taken as rad/s"), (_TURN, "Hz taken as rad/s")),
}
_TIMES = ((1e-3, "time in ms taken as s"), (1e-6, "time in us taken as s"), (60.0, "time in minutes taken as s"))

_GRAVITIES = (9.8, 9.80665, 9.81, 9.82, 10.0, 0.0)
_EARLY = 10.0  # growth up to which a cause is tried first: most are refuted there
_STEP = 1.25e-3  # s, of what is interpolated: of the printed equations' own run, its error is some 1e-9
_EARLY_ROWS = 40  # so many rows are tried first at most
_LEAST_LAG = 1e-4  # of an interval between rows: less is rounding
_SAME_START = 1e-3  # rad, rad/s: a scene that starts farther off cannot be the one
MAX_PARAMETERS = 6  # parameters that are named
_QUARTERS = {90: math.pi / 2.0, 180: math.pi, 270: -math.pi / 2.0}  # zeros that people choose, by degrees

Motion = Callable[[Array], Array | None]  # (n,) s -> (n, 2 (1 + blades)), None where it ends before


def carried_errors(reference: Trajectory, growth: Array, units: Array) -> Array:
    """(n, 2 (1 + blades)) What a relative error of 1 at the start may be in each angle, then rate, at most.

    growth, units   of `TimedReference`
    """
    largest = np.maximum.accumulate(np.maximum(np.abs(reference.angles).max(axis=1), 1.0))
    return np.asarray(np.maximum(np.maximum.accumulate(growth, axis=0), 1.0) * largest[:, None] * units)


@dataclass(frozen=True)
class CauseSearch:
    """How far motions are from the data up to the horizon.

    scene, data : all rows of the data, also those after the scene's end.
    exact : the reference at the times of the data and at the scene's samples.
    tolerance, worst : what is allowed per unit of error growth; what the data have.
    ends : of `time.monotonic`; no run is begun later.
    """

    scene: Scene
    data: ForeignData
    exact: TimedReference
    tolerance: float
    worst: float
    ends: float

    def states(self, motion: Motion, time: Array) -> Array | None:
        """(n, 2 (1 + blades)) Of a motion at increasing times; None where it ends early, fails or takes too long.

        Raises OutOfTimeError where the time of the whole search is over.
        """
        left = self.ends - monotonic()
        if left <= 0.0:
            raise OutOfTimeError
        if len(time) < FEWEST:
            return None
        try:
            with time_limit(min(_LONGEST_S, left)):
                return motion(time)
        except (RotorError, OutOfTimeError):
            return None

    @property
    def fitting(self) -> float:
        """The largest error per unit of growth that a cause may leave."""
        return max(self.tolerance, min(_LEFT * self.worst, _MOST_LEFT))

    def rows(self, time: Array, growth: float = math.inf) -> NDArray[np.bool_]:
        """(n,) True for the times up to the horizon, as far as errors have grown less than `growth`-fold."""
        reference = self.exact.trajectory
        end = horizon(reference)
        beyond = np.flatnonzero(running_growth(reference) >= growth)
        if len(beyond):
            end = min(end, float(reference.time[beyond[0]]))
        return (time >= 0.0) & (time <= end)

    def carried(self, time: Array) -> Array:
        """(n, 2 (1 + blades)) as `carried_errors`, at any times up to the horizon."""
        return np.stack([np.interp(time, self.exact.trajectory.time, column) for column in self._carried.T], axis=1)

    @cached_property
    def _carried(self) -> Array:
        return carried_errors(self.exact.trajectory, self.exact.growth, self.exact.units)

    def misfit(self, time: Array, values: Array, states: Array | None) -> float:
        """The largest error per unit of growth; infinite with too few rows, or without a motion to compare with."""
        if states is None or len(time) < FEWEST:
            return math.inf
        columns = self.data.columns
        return float(np.abs((values - states[:, columns]) / self.carried(time)[:, columns]).max())

    def expected(self, time: Array) -> Array:
        """(n, 2 (1 + blades)) The reference at times of the data."""
        reference = self.exact.trajectory
        return states_of(reference)[np.searchsorted(reference.time, time)]


def states_at(scene: Scene, time: Array, equations: Accelerations | None = None) -> Array | None:
    """(n, 2 (1 + blades)) Angles, then rates, of another scene, at increasing times from 0 on; None where it ends.

    equations   as of `motion_at`
    """
    times = np.union1d([0.0], time)
    whole = replace(scene, duration=float(times[-1]), samples=len(times), outputs=("angles", "rates"))
    run = motion_at(whole, times, equations)
    return states_of(run)[len(times) - len(time) :] if len(run.time) == len(times) else None


def states_of(run: Trajectory) -> Array:
    """(n, 2 (1 + blades)) Angles, then rates."""
    return np.hstack([run.angles, run.rates])


def mistakes_in_columns(search: CauseSearch, time: Array, values: Array, states: Array | None) -> list[str]:
    """What is wrong with the columns of data that are otherwise a motion, of these states; empty where nothing fits."""
    if states is None or len(time) < FEWEST:
        return []
    return _units_and_zeros(search, time, values, states) or _exchanged(search, time, values, states)


def _units_and_zeros(search: CauseSearch, time: Array, values: Array, states: Array) -> list[str]:
    """Each channel by itself: unit, sign, zero, turns; the simplest of those that leave least."""
    carried = search.carried(time)
    names: dict[str, list[str]] = {}
    for column, channel in zip(values.T, search.data.channels, strict=True):
        expected = states[:, channel.column]
        left = {
            text: float(np.abs((corrected - expected) / carried[:, channel.column]).max())
            for text, corrected in _corrections(channel.kind, column, expected)
        }
        least = max(min(left.values()), 1e-3 * search.tolerance)
        if not least <= search.fitting:
            return []
        text = next(text for text, size in left.items() if size <= 10.0 * least)
        names.setdefault(text, []).append(channel.name)
    return [f"{', '.join(which)}: {text}" for text, which in names.items() if text]


def _corrections(kind: str, values: Array, expected: Array) -> Iterator[tuple[str, Array]]:
    """(what is wrong, values so corrected), the simplest first."""
    factors = [(1.0, ""), *_FACTORS[kind]]
    signed = [(sign * factor, text) for sign in (1.0, -1.0) for factor, text in factors]
    for shifted in (False, True):
        for factor, text in signed:
            corrected = factor * values
            zero = float(corrected[0] - expected[0]) if shifted else 0.0
            parts = [text, "sign reversed" if factor < 0.0 else "", f"zero off by {zero:.6g}" if shifted else ""]
            parts = [part for part in parts if part]
            corrected = corrected - zero
            yield ", ".join(parts), corrected
            if kind == "angle":
                turns = np.round((expected - corrected) / _TURN)
                yield ", ".join([*parts, "wrapped, taken as unwrapped"]), corrected + _TURN * turns


def factors(search: CauseSearch) -> list[str]:
    """A factor of each channel, where that explains every channel; a parameter of the scene may be it, too."""
    inside = search.rows(search.data.time)
    time, values = search.data.time[inside], search.data.values[inside]
    states = search.expected(time)
    expected = states[:, search.data.columns]
    sizes = (expected**2).sum(axis=0)
    found = np.where(sizes > 0.0, (values * expected).sum(axis=0) / np.where(sizes > 0.0, sizes, 1.0), 1.0)
    if not found.all() or search.misfit(time, values / found, states) > search.fitting:
        return []
    wrong = [
        f"{channel.name} by {factor:.6g}"
        for channel, factor in zip(search.data.channels, found, strict=True)
        if abs(factor - 1.0) > search.tolerance
    ]
    return [f"too large by a factor: {', '.join(wrong)}"]


def _exchanged(search: CauseSearch, time: Array, values: Array, states: Array) -> list[str]:
    """Columns that are those of other channels, rates taken as angles among them."""
    carried = search.carried(time)
    sizes = np.abs(values[:, :, None] - states[:, None, :]) / carried[:, None, :]
    errors = sizes.max(axis=0)  # (channels, 2 (1 + blades))
    own = np.zeros_like(errors)
    own[range(len(search.data.columns)), search.data.columns] = -1e-3  # of equal ones, its own
    rows, chosen = linear_sum_assignment(np.log10(np.clip(errors, 1e-16, 1e16)) + own)
    if errors[rows, chosen].max() > search.fitting or list(chosen) == search.data.columns:
        return []
    labels = search.scene.coordinate_labels
    names = [*labels, *(f"{label} rate" for label in labels)]
    moved = [(channel.name, names[c]) for channel, c in zip(search.data.channels, chosen, strict=True)]
    return ["columns exchanged: " + ", ".join(f"{name} is {other}" for name, other in moved if name != other)]


def _other_time(search: CauseSearch) -> list[str]:
    """Times in another unit, or numbers of rows."""
    data, scene = search.data, search.scene
    factors = list(_TIMES)
    if np.array_equal(np.diff(data.time), np.ones(len(data.time) - 1)):
        factors.append((scene.duration / (len(data.time) - 1), "row numbers taken as s"))
    for factor, text in factors:
        time = data.time * factor
        inside = search.rows(time)
        states = search.states(partial(states_at, scene), time[inside])
        if search.misfit(time[inside], data.values[inside], states) <= search.fitting:
            return [text]
        if found := mistakes_in_columns(search, time[inside], data.values[inside], states):
            return ["; and ".join([text, *found])]
    return []


def _lag(search: CauseSearch, time: Array, values: Array) -> list[str]:
    """A constant lag: Gauss and Newton's iteration from none, one and two rows, early and late."""
    if len(time) < FEWEST + 2:
        return []
    step, columns = float(np.median(np.diff(time))), search.data.columns
    for start in (0.0, step, -step, 2.0 * step, -2.0 * step):
        lag = start
        for _ in range(6):
            moved = time - lag
            inside = search.rows(moved)
            states = search.states(partial(states_at, search.scene), moved[inside])
            if states is None:
                break
            left = search.misfit(moved[inside], values[inside], states)
            count = states.shape[1] // 2
            slopes = np.hstack([states[:, count:], np.gradient(states[:, count:], moved[inside], axis=0)])[:, columns]
            weights = 1.0 / search.carried(moved[inside])[:, columns]
            errors = (values[inside] - states[:, columns]) * weights
            size = float(((slopes * weights) ** 2).sum())
            change = -float((errors * slopes * weights).sum()) / size if size else 0.0
            if left <= search.fitting and abs(change) <= 1e-6 * abs(lag) and abs(lag) >= _LEAST_LAG * step:
                rows = lag / step
                whole = f", {abs(round(rows))} rows" if abs(rows - round(rows)) < 1e-3 and round(rows) else ""
                return [f"a constant lag of {lag:.6g} s{whole} ({'late' if lag > 0.0 else 'early'})"]
            lag += change
    return []


def _scatter(search: CauseSearch, time: Array, values: Array) -> list[str]:
    """Errors that have nothing in common from row to row, whatever the growth."""
    if len(time) < 4 * FEWEST:
        return []
    errors = values - search.expected(time)[:, search.data.columns]
    wrong = np.abs(errors / search.carried(time)[:, search.data.columns]).max(axis=0) > search.tolerance
    centred = errors[:, wrong] - errors[:, wrong].mean(axis=0)
    sizes = (centred**2).mean(axis=0)
    if not wrong.any() or not ((sizes > 0.0) & (sizes < math.inf)).all():
        return []
    common = np.abs((centred[1:] * centred[:-1]).mean(axis=0)) / sizes
    half = len(time) // 2
    early, late = ((centred[part] ** 2).mean(axis=0) for part in (slice(None, half), slice(half, None)))
    if (common > 3.0 / math.sqrt(len(time))).any() or (late > 2.0 * early).any() or (early > 2.0 * late).any():
        return []
    return [f"scatter from row to row, standard deviation {math.sqrt(float(sizes.max())):.1e}"]


def likely_causes(search: CauseSearch, defects: DefectCauses | None) -> tuple[list[str], str]:
    """What fits, in words: mistakes in the columns and times, faults at a time, other scenes and equations, one
    parameter that is off; else both another scene and a mistake in the columns.

    Beside it what a reader must know where the time of the search was over before all had been tried, else "".
    """
    is_different = defects is not None and not defects.is_rounding
    if search.worst <= search.tolerance and not is_different:
        # The rows that were compared agree, but many may have come after the scene's end.
        return _other_time(search) if search.data.time[-1] > 2.0 * search.scene.duration else [], ""
    inside = search.rows(search.data.time)
    time, values = search.data.time[inside], search.data.values[inside]
    first = np.abs(search.data.values[0] - search.expected(time[:1])[0, search.data.columns]) if len(time) else 0.0
    is_elsewhere = bool(np.max(first) > _SAME_START)
    found: list[str] = []
    both: list[str] = []
    try:
        found = mistakes_in_columns(search, time, values, search.expected(time))
        found = found or _other_time(search) or _lag(search, time, values)
        if found:
            return found, ""
        if is_different and defects is not None and not is_elsewhere:
            found = causes_of_defects(search, defects) or list(fault_lines(defects.faults()))
        if found := found or _scatter(search, time, values):
            return found, ""
        for text, motion in _motions(search):
            beside = _fits(search, motion)
            if beside is not None:
                (both if beside else found).append("; and ".join([text, *beside]))
        if is_elsewhere and is_different and defects is not None and not (both or found):
            found = causes_of_defects(search, defects) or list(fault_lines(defects.faults()))
    except OutOfTimeError:
        note = "the search for causes was ended by its time limit"
        return found or both, note
    # A motion that fits by its errors up to the horizon alone is none where the defects say no.
    return ([] if is_different and not is_elsewhere else found) or both or factors(search), ""


def hidden_causes(scene: Scene, defects: DefectCauses) -> list[str]:
    """A parameter whose change the defects follow beyond chance, though none is larger than rounding."""
    shares = defects.parameters(list(_parameters(scene)))
    return [text for share, text in shares if share <= 1.05 * shares[0][0]][:MAX_PARAMETERS]


def causes_of_defects(search: CauseSearch, defects: DefectCauses) -> list[str]:
    """Scenes and equations that explain the defects, else parameters; those that leave least, as some are alike."""
    shares: list[tuple[float, str]] = []
    for text, scene, equations in _explanations(search):
        if monotonic() > search.ends:
            raise OutOfTimeError
        try:
            share = defects.left(scene, equations)
        except RotorError:
            continue
        if share < math.inf:
            shares.append((share, text))
    shares = shares or defects.parameters(list(_parameters(search.scene)))
    least = max(min(shares)[0], 1e-9) if shares else 0.0
    # What rounding leaves is of one size whatever the cause: there the least is nearly that of the right one.
    factor = 3.0 if least <= MAX_LEFT else 1.02
    return [text for share, text in sorted(shares) if share <= factor * least][:MAX_PARAMETERS]


def _explanations(search: CauseSearch) -> Iterator[tuple[str, Scene, Accelerations | None]]:
    """What people mistake a scene or its equations for: a text, the scene, other equations."""
    scene = search.scene
    for text, other in _scenes(search):
        yield text, other, None
    for text, azimuths in _azimuths(scene):
        yield text, scene, at_azimuths(scene, azimuths)
    for terms, equations in LEFT_OUT.items():
        yield f"without the {terms}", scene, equations
    yield "angles taken as small: sin x = x, cos x = 1", scene, _small_angles
    # E3 is the power of a term that is zero without E2.
    for names in ("E1", "E2", "E1 and E2", "E2 and E3", "E1 and E2 and E3"):
        errata = Errata(*(name in names for name in ("E1", "E2", "E3")))
        try:
            accelerations = PrintedModel("printed", errata).accelerations(scene)
        except RotorError:
            continue

        def printed(
            angles: Any, rates: Any, _form: Any, loads: Any, *_: Any, accelerations: Any = accelerations
        ) -> list[float]:
            torques = [loads.rotor, *(loads.pitches or (0.0,) * (len(angles) - 1))]
            return list(accelerations(torques, [*angles, *rates]))

        yield f"erratum {names} of the paper's equations", scene, printed


def _small_angles(angles: Any, rates: Any, form: Any, loads: Any, *_: Any) -> list[Any]:
    return closed_form.accelerations(angles, rates, form, loads, lambda x: x, lambda x: 1.0 + 0.0 * x)


def _fits(search: CauseSearch, motion: Motion) -> list[str] | None:
    """First over the first rows, up to a growth of `_EARLY`, then up to the horizon.

    None where it does not fit; else what is wrong with the columns beside, which is nothing where it fits as it is.
    """
    data, beside = search.data, list[str]()
    for growth, most in ((_EARLY, _EARLY_ROWS), (math.inf, 10**9)):
        inside = np.flatnonzero(search.rows(data.time, growth))[:most]
        if growth == _EARLY and len(inside) < FEWEST:
            continue
        time, values = data.time[inside], data.values[inside]
        states, beside = search.states(motion, time), []
        if not search.misfit(time, values, states) <= search.fitting:
            beside = mistakes_in_columns(search, time, values, states)
            if not beside:
                return None
    return beside


def _motions(search: CauseSearch) -> Iterator[tuple[str, Motion]]:
    scene = search.scene
    for text, other in _scenes(search):
        yield text, partial(states_at, other)
    for text, azimuths in _azimuths(scene):
        yield text, partial(states_at, scene, equations=at_azimuths(scene, azimuths))
    for terms, equations in LEFT_OUT.items():
        yield f"without the {terms}", partial(states_at, scene, equations=equations)
    # E3 is the power of a term that is zero without E2.
    for names in ("E1", "E2", "E1 and E2", "E2 and E3", "E1 and E2 and E3"):
        errata = Errata(*(name in names for name in ("E1", "E2", "E3")))
        yield f"erratum {names} of the paper's equations", partial(_printed, scene, errata)


def _scenes(search: CauseSearch) -> Iterator[tuple[str, Scene]]:
    scene = search.scene
    for gravity in (*_GRAVITIES, -scene.gravity):
        if gravity != scene.gravity:
            yield f"gravity of {gravity:g} m/s^2", replace(scene, gravity=gravity)
    on_axis = tuple(replace(blade, centre_of_mass=(0.0, 0.0, blade.centre_of_mass[2])) for blade in scene.blades)
    if on_axis != scene.blades and all(
        blade.has_pitch_inertia or not rate for blade, rate in zip(on_axis, scene.initial_rates[1:], strict=True)
    ):
        yield "blade mass on the pitch axis", replace(scene, blades=on_axis)
    blades = scene.blades
    for text, others in {
        "blades without inertia, as point masses": [replace(b, inertia=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)) for b in blades],
        "products of inertia with the other sign": [
            replace(b, inertia=_inertia([*b.inertia[:3], *(-x for x in b.inertia[3:])])) for b in blades
        ],
        "the tip in place of the centre of mass": [replace(b, centre_of_mass=b.tip) for b in blades],
        "inertia about the root taken as about the centre of mass": [_with_steiner(b) for b in blades],
        **{
            f"numbers of blades {i + 1} and {j + 1} exchanged": [
                blades[{i: j, j: i}.get(k, k)] for k in range(len(blades))
            ]
            for i in range(len(blades))
            for j in range(i)
        },
    }.items():
        if tuple(others) != blades:
            yield text, replace(scene, blades=tuple(others))
    for name, text in (
        ("rotor_torque", "the torque of the rotor"), ("bearing_stiffness", "the springs"),
        ("bearing_damping", "the dampers of the bearings"), ("shaft_damping", "the damper of the shaft"),
        ("hub_inertia", "the hub's inertia"),
    ):  # fmt: skip
        value = getattr(scene, name)
        without = _changed(scene, [(name,)], lambda value, _: _scaled(value, -1.0), 0.0)
        if value != getattr(without, name):
            yield f"without {text}", without
    for degrees, angle in _QUARTERS.items():
        turned = _pitch_turned(scene, range(len(scene.blades)), angle)
        yield f"pitch angles from another zero: {degrees} degrees where they are 0", turned
    first = search.data.values[0]
    for other in _catalogue():
        states = np.array([*other.initial_angles, *other.initial_rates])
        is_other = other.name != scene.name and len(other.blades) == len(scene.blades)
        if is_other and np.abs(states[search.data.columns] - first).max() < _SAME_START:
            yield f"the scene {other.name}", other


def _with_steiner(blade: Blade) -> Blade:
    """As if its inertia, which is about the root, were about the centre of mass: Steiner's share twice."""
    m, (x, y, z) = blade.mass, blade.centre_of_mass
    share = (m * (y * y + z * z), m * (x * x + z * z), m * (x * x + y * y), -m * x * y, -m * x * z, -m * y * z)
    return replace(blade, inertia=_inertia([a + b for a, b in zip(blade.inertia, share, strict=True)]))


def _inertia(values: Sequence[float]) -> tuple[float, float, float, float, float, float]:
    xx, yy, zz, xy, xz, yz = values
    return xx, yy, zz, xy, xz, yz


@functools.cache
def _catalogue() -> tuple[Scene, ...]:
    return tuple(find_scenes(sorted({name.partition("/")[0] for name, _ in list_scenes()})))


def _azimuths(scene: Scene) -> Iterator[tuple[str, Sequence[float]]]:
    """Blades at other angles about the shaft than they should be."""
    right, n = scene.phases, len(scene.blades)
    if n > 1:
        yield "all blades at the azimuth of blade 1", (0.0,) * n
        yield "azimuths of the blades in degrees taken as rad", [math.degrees(phase) for phase in right]
    if n > 2:
        yield "blades numbered the other way round", (right[0], *right[:0:-1])
        for i in range(n):
            for other in ((i + 1) % n, (i - 1) % n):
                text = f"blade {i + 1} at an azimuth of {360 * other / n:g} degrees in place of {360 * i / n:g}"
                yield text, (*right[:i], right[other], *right[i + 1 :])
    others = {360.0 * i / n: phase for i, phase in enumerate(right) if i}
    for degrees, angle in (others | _QUARTERS).items():
        text = f"rotor angle from another zero: blade 1 at an azimuth of {degrees:g} degrees where it is 0"
        yield text, [phase + angle for phase in right]


def _printed(scene: Scene, errata: Errata, time: Array) -> Array | None:
    """The paper's derivation with some of its errata; its own samples are so near that they can be interpolated.

    Raises MethodRefusal for a scene that the printed equations have no place for.
    """
    end = float(time[-1])
    whole = replace(scene, duration=end, samples=2 + math.ceil(end / _STEP), outputs=("angles", "rates"))
    solver = PrintedModel("printed", errata).build(
        whole, Ode45Settings(relative_tolerance=1e-9, absolute_tolerance=1e-11)
    )
    solver.integrate()
    run = solver.observe()
    if len(run.time) < whole.samples:
        return None
    spline = CubicHermiteSpline(run.time, run.angles, run.rates)
    return np.hstack([spline(time), spline(time, 1)])


def _parameters(scene: Scene) -> Iterator[Parameter]:
    """Every number, or list of numbers, that is not zero, and the zeros of the angles."""
    for item in scene_fields("rotor"):
        key, value = item.metadata["key"], getattr(scene, item.name)
        if item.name != "blades" and _scaled(value, 1.0) != value:
            yield Parameter(key, "", _changes(_changed, scene, [(item.name,)], _scaled))
    blades = range(len(scene.blades))
    for chosen in [list(blades), *([i] for i in blades if len(blades) > 1)]:
        alone = len(chosen) == 1 < len(blades)
        for field in fields(Blade):
            value = getattr(scene.blades[chosen[0]], field.name)
            entries = [(i,) for i, x in enumerate(value) if x] if isinstance(value, tuple) else [()] * bool(value)
            for entry in entries if field.name != "tip" else []:
                paths = [("blades", b, field.name, *entry) for b in chosen]
                key = f"blade{chosen * alone or ''}.{field.name}{list(entry) or ''}"
                yield Parameter(key, "", _changes(_changed, scene, paths, _scaled))
        which = f"blade {chosen[0] + 1}" if len(chosen) == 1 else "all blades"
        yield Parameter(f"azimuth of {which}", "rad", partial(_azimuth_moved, scene, chosen))
        yield Parameter(f"zero of the pitch of {which}", "rad", _changes(_pitch_turned, scene, chosen))


def _changes(changed: Callable[..., Scene], *chosen: Any) -> Change:
    """The scene by the change of its parameter, the last argument of `changed`."""
    return lambda change: (changed(*chosen, change), None)


def _azimuth_moved(scene: Scene, chosen: Sequence[int], change: float) -> tuple[Scene, Accelerations]:
    azimuths = [phase + change * (i in chosen) for i, phase in enumerate(scene.phases)]
    return scene, at_azimuths(scene, azimuths)


def _pitch_turned(scene: Scene, chosen: Sequence[int], angle: float) -> Scene:
    """Chosen blades that are turned about the pitch axis where their pitch is 0."""
    s, c = math.sin(angle), math.cos(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    blades = list(scene.blades)
    for i in chosen:
        xx, yy, zz, xy, xz, yz = blades[i].inertia
        inertia = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
        blades[i] = replace(
            blades[i],
            centre_of_mass=tuple((turn @ blades[i].centre_of_mass).tolist()),
            inertia=tuple(inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist()),
        )
    return replace(scene, blades=tuple(blades))


def _changed(scene: Scene, paths: Sequence[Any], how: Callable[[Any, float], Any], change: float) -> Scene:
    """The scene with `how(value, change)` for the values at some paths of names of fields and numbers of entries."""

    def with_value(whole: Any, path: Sequence[Any]) -> Any:
        if not path:
            return how(whole, change)
        if isinstance(path[0], int):
            return (*whole[: path[0]], with_value(whole[path[0]], path[1:]), *whole[path[0] + 1 :])
        return replace(whole, **{path[0]: with_value(getattr(whole, path[0]), path[1:])})

    for path in paths:
        scene = with_value(scene, path)
    return scene


def _scaled(value: Any, share: float) -> Any:
    """Numbers larger by a share; of a table over time, not the times."""
    if not isinstance(value, tuple):
        return value * (1.0 + share) if isinstance(value, float) else value
    if value and all(isinstance(row, tuple) and len(row) == 2 and not isinstance(row[0], tuple) for row in value):
        return tuple((row[0], row[1] * (1.0 + share)) for row in value)
    return tuple(_scaled(entry, share) for entry in value)
