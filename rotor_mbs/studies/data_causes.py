"""What data that do not agree look like, of mistakes in the data: units, signs, zeros, columns, times, scatter.

Each is tried by comparing the data so corrected with the reference, or with a run at the corrected times.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from time import monotonic

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from rotor_mbs.analysis.data_verdict import carried_errors
from rotor_mbs.errors import RotorError
from rotor_mbs.foreign.trajectory import ForeignData
from rotor_mbs.methods.time_limit import OutOfTimeError, time_limit
from rotor_mbs.models.lagrange.ode_solvers import Accelerations
from rotor_mbs.models.lagrange.reference import TimedReference, motion_at
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.metrics import horizon, running_growth
from rotor_mbs.solution.trajectory import Array, Trajectory

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

Motion = Callable[[Array], Array | None]  # (n,) s -> (n, 2 (1 + blades)), None where it ends before


@dataclass(frozen=True)
class CauseSearch:
    """The data up to the horizon, and how far a motion is from them.

    Attributes
    ----------
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


def causes_in_the_data(search: CauseSearch) -> list[str]:
    """What fits, in words; the first kind of mistake that explains every channel.

    Where the rows that were compared agree, another unit of time is tried if many came after the scene's end.
    """
    if search.worst <= search.tolerance:
        return _other_time(search) if search.data.time[-1] > 2.0 * search.scene.duration else []
    inside = search.rows(search.data.time)
    time, values = search.data.time[inside], search.data.values[inside]
    mistakes = mistakes_in_columns(search, time, values, search.expected(time))
    return mistakes or _other_time(search) or _lag(search, time, values) or _scatter(search, time, values)


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
            said = [text] * bool(text) + ["sign reversed"] * (factor < 0.0) + [f"zero off by {zero:.6g}"] * shifted
            corrected = corrected - zero
            yield ", ".join(said), corrected
            if kind == "angle":
                turns = np.round((expected - corrected) / _TURN)
                yield ", ".join([*said, "wrapped, taken as unwrapped"]), corrected + _TURN * turns


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
    step = float(np.median(np.diff(time)))
    for start in (0.0, step, -step, 2.0 * step, -2.0 * step):
        lag = start
        for _ in range(6):
            moved = time - lag
            inside = search.rows(moved)
            found = search.states(partial(states_at, search.scene), moved[inside])
            if found is None:
                break
            left = search.misfit(moved[inside], values[inside], found)
            change = _lag_change(search, moved[inside], values[inside], found)
            if left <= search.fitting and abs(change) <= 1e-6 * abs(lag):
                rows = lag / step
                whole = f", {abs(round(rows))} rows" if abs(rows - round(rows)) < 1e-3 and round(rows) else ""
                return [f"a constant lag of {lag:.6g} s{whole} ({'late' if lag > 0.0 else 'early'})"]
            lag += change
    return []


def _lag_change(search: CauseSearch, time: Array, values: Array, states: Array) -> float:
    count = states.shape[1] // 2
    slopes = np.hstack([states[:, count:], np.gradient(states[:, count:], time, axis=0)])[:, search.data.columns]
    weights = 1.0 / search.carried(time)[:, search.data.columns]
    errors = (values - states[:, search.data.columns]) * weights
    size = float(((slopes * weights) ** 2).sum())
    return -float((errors * slopes * weights).sum()) / size if size else 0.0


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
