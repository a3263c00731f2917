"""What data that do not agree look like: mistakes in their columns and times, then another model, parameters, faults.

A mistake in the columns or times is looked for by the reference, at most carried on from one of its rows, and named
where the data so corrected have no defects.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from rotor_mbs.comparison.channels import ForeignData, channels
from rotor_mbs.comparison.defect_causes import DefectCauses
from rotor_mbs.errors import InputError
from rotor_mbs.models.lagrange.defects import (
    FIT_ROWS,
    fitted_rates,
    interval_defects,
    interval_ends,
)
from rotor_mbs.models.lagrange.reference import TimedReference
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.defects import Defects
from rotor_mbs.solution.metrics import horizon
from rotor_mbs.solution.trajectory import Array, Trajectory

# A mistake fits where what is left is within the tolerance, or a thousandth of what there was and at most this.
_LEFT = 1e-3
_MOST_LEFT = 1e-4
_FEWEST = 5  # rows: with fewer, something always fits
_DEGREE, _TURN = math.pi / 180.0, 2.0 * math.pi
_FACTORS = {
    "angle": (
        (_DEGREE, "degrees taken as rad"),
        (1.0 / _DEGREE, "rad taken as degrees"),
        (_TURN, "turns taken as rad"),
    ),
    "rate": (
        (_DEGREE, "deg/s taken as rad/s"),
        (_TURN / 60.0, "rpm taken as rad/s"),
        (_TURN, "Hz taken as rad/s"),
    ),
}
_TIMES = (
    (1e-3, "time in ms taken as s"),
    (1e-6, "time in us taken as s"),
    (60.0, "time in minutes taken as s"),
)
_LEAST_LAG = 1e-4  # of an interval between rows: less is rounding
_LAG_ROW = 50  # by which a lag is found
_LAG_ROUNDS = 8
_SAME_START = 1e-3  # rad, rad/s: data that start farther off are no run of the scene as they are


def carried_errors(reference: Trajectory, growth: Array, units: Array) -> Array:
    """(n, 2 (1 + blades)) What a relative error of 1 at the start may be in each angle, then rate, at most; growth,
    units: of `TimedReference`."""
    largest = np.maximum.accumulate(np.maximum(np.abs(reference.angles).max(axis=1), 1.0))
    return np.asarray(
        np.maximum(np.maximum.accumulate(growth, axis=0), 1.0) * largest[:, None] * units
    )


def states_of(run: Trajectory) -> Array:
    """(n, 2 (1 + blades)) Angles, then rates."""
    return np.hstack([run.angles, run.rates])


def defects_of_data(
    scene: Scene, data: ForeignData, reference: Trajectory, until: int
) -> tuple[Defects | None, str]:
    """The defects of the data, and what a reader must know of them. Angles that the data lack are the reference's, and
    then only as far as the horizon; rates that they lack are found from the angles."""
    count = len(scene.initial_angles)
    states, rounding = states_of(reference).copy(), np.zeros((len(data.time), 2 * count))
    states[:, data.columns], rounding[:, data.columns] = data.values, data.rounding
    lacking = [i for i in scene.moving_coordinates if i not in data.columns]
    without_rates = [i for i in scene.moving_coordinates if count + i not in data.columns]
    rows, note = until if lacking else len(data.time), ""
    if rows < 2:
        return None, ""
    time, states, rounding = data.time[:rows], states[:rows], rounding[:rows]
    if without_rates and not lacking:
        try:
            rates = fitted_rates(scene, time, states[:, :count])
        except InputError as exc:
            return None, f"no defects: {exc}"
        columns = [count + i for i in without_rates]
        states[:, columns] = rates[:, without_rates]
        # Of a slope through five rows.
        rounding[:, columns] = rounding[:, without_rates] / float(np.median(np.diff(time)))
        names = ", ".join(f"{scene.coordinate_labels[i]} rate" for i in without_rates)
        note = f"computed from the angles, by fitting the equations of motion to {FIT_ROWS} rows: {names}"
    if not np.isfinite(states).all():
        return None, ""
    return interval_defects(
        scene, time, states[:, :count], states[:, count:], rounding, data.time_rounding[:rows]
    ), note


@dataclass(frozen=True)
class CauseSearch:
    """Data, all rows, against a scene's reference at the times of the data and at the scene's samples.

    worst : the largest error per unit of error growth.
    """

    scene: Scene
    data: ForeignData
    exact: TimedReference
    tolerance: float
    worst: float

    def states_at(self, time: Array) -> Array:
        """(n, 2 (1 + blades)) The motion at any increasing times up to the horizon, from the reference's row before."""
        run, moving = self.exact.trajectory, self.scene.moving_coordinates
        before = np.searchsorted(run.time, time, side="right") - 1
        states = states_of(run)[before]
        columns = [*moving, *(len(self.scene.initial_angles) + i for i in moving)]
        states[:, columns] = interval_ends(self.scene, run.time[before], time, states[:, columns])
        return states

    def up_to_horizon(self, data: ForeignData) -> ForeignData:
        return data.rows((data.time >= 0.0) & (data.time <= horizon(self.exact.trajectory)))

    def carried(self, time: Array) -> Array:
        """(n, 2 (1 + blades)) as `carried_errors`, at any times up to the horizon."""
        run = self.exact.trajectory
        carried = carried_errors(run, self.exact.growth, self.exact.units)
        return np.stack([np.interp(time, run.time, column) for column in carried.T], axis=1)

    @property
    def fitting(self) -> float:
        """The largest error per unit of growth that a mistake may leave."""
        return max(self.tolerance, min(_LEFT * self.worst, _MOST_LEFT))

    def is_right(self, data: ForeignData) -> bool:
        """Whether corrected data have no defects, as far as any are known."""
        data = data.rows((data.time >= 0.0) & (data.time <= self.scene.duration * (1.0 + 1e-9)))
        inside = self.up_to_horizon(data)
        if len(data.time) < 2 or not len(inside.time):
            return True
        count = len(self.scene.initial_angles)
        states = np.tile(
            [*self.scene.initial_angles, *self.scene.initial_rates], (len(data.time), 1)
        )
        states[: len(inside.time)] = self.states_at(inside.time)
        reference = Trajectory(data.time, states[:, :count], states[:, count:])
        defects, _ = defects_of_data(self.scene, data, reference, len(inside.time))
        return (
            defects is None
            or DefectCauses(self.scene, defects, self.tolerance).largest <= self.fitting
        )


def likely_causes(search: CauseSearch, defects: DefectCauses | None) -> list[str]:
    """What fits, in words: mistakes in columns and times; else another model, parameters, or faults at a time; else
    scatter, or a factor of a channel."""
    first = search.up_to_horizon(search.data)
    is_elsewhere = True
    if len(first.time):
        start = search.states_at(first.time[:1])[0, first.columns]
        is_elsewhere = not np.abs(first.values[0] - start).max() <= _SAME_START
    is_different = defects is not None and not defects.is_rounding
    if (
        search.worst <= search.tolerance
        and not is_different
        and search.data.time[-1] <= 2.0 * search.scene.duration
    ):
        return []
    for text, data in itertools.chain([("", search.data)], _times(search)):
        if texts := _column_mistakes(search, text, data):
            return texts
    found: list[str] = []
    if defects is not None and is_elsewhere:
        found = defects.scenes()
    elif defects is not None and is_different:
        found = defects.explanations() or defects.faults()
    found = (
        found
        or _scatter(search, first)
        or _column_mistakes(search, "", search.data, with_factor=True)
    )
    if not found and is_different and defects is not None and is_elsewhere:
        found = defects.explanations() or defects.faults()
    return found


def _column_mistakes(
    search: CauseSearch, text: str, data: ForeignData, *, with_factor: bool = False
) -> list[str]:
    """What is wrong with the columns of data whose times are corrected, which `text` says, beside it; [] where no
    mistakes explain the data."""
    inside = search.up_to_horizon(data)
    if len(inside.time) < _FEWEST:
        return []
    for mistakes, corrected in _corrected(search, data, inside, with_factor):
        texts = [text, *mistakes] if text else mistakes
        if texts and search.is_right(corrected):
            return ["; and ".join([text, "; and ".join(mistakes)])] if text and mistakes else texts
    return []


def _times(search: CauseSearch) -> Iterator[tuple[str, ForeignData]]:
    """Times in another unit, or numbers of rows; a constant lag; rows from the end to the start."""
    data = search.data
    factors = list(_TIMES)
    if np.array_equal(np.diff(data.time), np.ones(len(data.time) - 1)):
        factors.append((search.scene.duration / (len(data.time) - 1), "row numbers taken as s"))
    for factor, text in factors:
        yield (
            text,
            replace(data, time=data.time * factor, time_rounding=data.time_rounding * factor),
        )
    step = float(np.median(np.diff(data.time)))
    lag = _lag(search)
    if abs(lag) > _LEAST_LAG * step:
        rows = lag / step
        whole = (
            f", {abs(round(rows))} rows" if abs(rows - round(rows)) < 1e-3 and round(rows) else ""
        )
        text = f"a constant lag of {lag:.6g} s{whole} ({'late' if lag > 0.0 else 'early'})"
        yield f"{text}: `offset = {-lag:.6g}` of the time", replace(data, time=data.time - lag)
    turned = (data.time[0] + data.time[-1] - data.time)[::-1]
    backward = replace(data, time=turned, values=data.values[::-1], rounding=data.rounding[::-1])
    yield "rows from the end to the start, time reversed", backward


def _lag(search: CauseSearch) -> float:
    """s, by when the reference is nearest to a row of the data; 0 where it never is near."""
    data, run = search.data, search.exact.trajectory
    row = min(_LAG_ROW, len(data.time) // 4)
    columns, end = data.columns, horizon(run)
    distances = np.abs(states_of(run)[run.time <= end][:, columns] - data.values[row]).max(axis=1)
    time = float(run.time[int(distances.argmin())])
    step = 1e-6 * max(end, 1e-9)
    for _ in range(_LAG_ROUNDS):
        here, ahead = search.states_at(np.array([time, time + step]))[:, columns]
        slope = (ahead - here) / step
        size = float(slope @ slope)
        change = float((data.values[row] - here) @ slope) / size if size else 0.0
        time = min(max(time + change, 0.0), end - step)
    return float(data.time[row]) - time


def _corrected(
    search: CauseSearch, data: ForeignData, inside: ForeignData, with_factor: bool
) -> Iterator[tuple[list[str], ForeignData]]:
    """What may be wrong with the columns of data whose times are right, and the data so corrected; inside: the rows up
    to the horizon. with_factor: whether any factor of a channel may be wrong."""
    states, carried = search.states_at(inside.time), search.carried(inside.time)
    columns, values = data.columns, inside.values
    if float(np.abs((values - states[:, columns]) / carried[:, columns]).max()) <= search.fitting:
        yield [], data
        return
    # Each channel by itself: unit, sign, zero, turns; the simplest of those that leave least.
    begin = int(np.searchsorted(data.time, 0.0))
    names: dict[str, list[str]] = {}
    parts: list[tuple[Array, Array]] = []
    for j, channel in enumerate(data.channels):
        expected, scale = states[:, channel.column], carried[:, channel.column]
        whole = list(_corrections(channel.kind, data.values[:, j], begin, float(expected[0])))
        if with_factor and (factor := float(values[:, j] @ expected / (expected @ expected))):
            whole.append(
                (f"too large by a factor of {factor:.6g}", 1.0 / factor, data.values[:, j] / factor)
            )
        left = [
            float(np.abs((v[begin : begin + len(values)] - expected) / scale).max())
            for _, _, v in whole
        ]
        least = max(min(left), 1e-3 * search.tolerance)
        if not least <= search.fitting:
            break
        text, factor, corrected = next(
            item for item, size in zip(whole, left, strict=True) if size <= 10.0 * least
        )
        names.setdefault(text, []).append(channel.name)
        parts.append((corrected, data.rounding[:, j] * abs(factor)))
    else:
        texts = [f"{', '.join(which)}: {text}" for text, which in names.items() if text]
        both = [np.stack(arrays, axis=1) for arrays in zip(*parts, strict=True)]
        yield texts, replace(data, values=both[0], rounding=both[1])
    # Columns that are those of other channels, rates taken as angles among them.
    errors = (np.abs(values[:, :, None] - states[:, None, :]) / carried[:, None, :]).max(axis=0)
    own = np.zeros_like(errors)
    own[range(len(columns)), columns] = -1e-3  # of equal ones, its own
    _, chosen = linear_sum_assignment(np.log10(np.clip(errors, 1e-16, 1e16)) + own)
    if errors[range(len(columns)), chosen].max() <= search.fitting and list(chosen) != columns:
        text, exchanged = _exchanged(search.scene, data, list(chosen))
        yield [text], exchanged


def _corrections(
    kind: str, values: Array, begin: int, start: float
) -> Iterator[tuple[str, float, Array]]:
    """What is wrong, factor, values so corrected, the simplest first; begin: the first row that is compared; start: the
    right value there."""
    factors = [(1.0, ""), *_FACTORS[kind]]
    signed = [(sign * factor, text) for sign in (1.0, -1.0) for factor, text in factors]
    for shifted in (False, True):
        for factor, text in signed:
            zero = factor * float(values[begin]) - start if shifted else 0.0
            parts = [
                text,
                "sign reversed" if factor < 0.0 else "",
                f"zero off by {zero:.6g}" if shifted else "",
            ]
            parts = [part for part in parts if part]
            corrected = factor * values - zero
            yield ", ".join(parts), factor, corrected
            if kind == "angle" and np.abs(np.diff(corrected)).max() > 0.5 * _TURN:
                unwrapped = np.unwrap(corrected)
                unwrapped += _TURN * np.round((start - unwrapped[begin]) / _TURN)
                yield ", ".join([*parts, "wrapped, taken as unwrapped"]), factor, unwrapped


def _exchanged(scene: Scene, data: ForeignData, chosen: Sequence[int]) -> tuple[str, ForeignData]:
    """In words, and the data with their columns taken as those of other channels."""
    known = channels(scene)[1:]
    others = tuple(known[c] for c in chosen)
    moved = [
        f"{own.name} is {other.name}"
        for own, other in zip(data.channels, others, strict=True)
        if own != other
    ]
    return f"columns exchanged: {', '.join(moved)}", replace(data, channels=others)


def _scatter(search: CauseSearch, data: ForeignData) -> list[str]:
    """Errors that have nothing in common from row to row, whatever the growth; data: up to the horizon."""
    if len(data.time) < 4 * _FEWEST:
        return []
    errors = data.values - search.states_at(data.time)[:, data.columns]
    wrong = (
        np.abs(errors / search.carried(data.time)[:, data.columns]).max(axis=0) > search.tolerance
    )
    centred = errors[:, wrong] - errors[:, wrong].mean(axis=0)
    sizes = (centred**2).mean(axis=0)
    if not wrong.any() or not ((sizes > 0.0) & (sizes < math.inf)).all():
        return []
    # Of every second row alone neighbours have nothing in common either.
    common = (
        np.max([np.abs((centred[n:] * centred[:-n]).mean(axis=0)) for n in (1, 2)], axis=0) / sizes
    )
    half = len(data.time) // 2
    early, late = (
        (centred[part] ** 2).mean(axis=0) for part in (slice(None, half), slice(half, None))
    )
    if (
        (common > 3.0 / math.sqrt(len(errors))).any()
        or (late > 2.0 * early).any()
        or (early > 2.0 * late).any()
    ):
        return []
    return [f"scatter from row to row, standard deviation {math.sqrt(float(sizes.max())):.1e}"]
