"""What the defects of data look like: another scene, other equations, parameters that are off, or faults at a time.

Nothing is run from the start: each explanation is held to the data's own states, interval by interval. It is named
where what it leaves of the defects would agree.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.comparison.other_rotors import (
    Model,
    Parameter,
    other_models,
    parameters,
    scenes_with_start,
)
from rotor_mbs.errors import RotorError
from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.defects import explicit_steps, quick_ends
from rotor_mbs.models.lagrange.parameters import rotor_form
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import torque_place
from rotor_mbs.solution.defects import Defects
from rotor_mbs.solution.trajectory import Array

_AT_FLOOR = 3.0  # times the rounding
_LEFT = 1e-3  # of the largest defect: the rest is the other program's own error, or that of the quick steps
_LEFT_OF_SMALL = 0.02  # where that is within the tolerance
_ALIKE = 3.0  # times what the best explanation leaves
_QUICK = 3e-5  # share to which a change of the model is known
_FINE = 8  # times the steps, with which that holds also where the mass matrix is nearly singular
_PERHAPS = 0.2  # of the defects left by steps that are not so fine
_LEFT_OF_SETS = 0.1  # by the projections on several parameters, before they are iterated
_SIGNIFICANT = 8.0  # standard deviations of an estimate
_LARGEST_CHANGE = 0.6  # a share, or rad: what is further off is another scene
_TRIED = 8  # sets of parameters, those whose projections leave least
_SET = 3  # parameters at once
_INTERVALS = 120  # that an explanation is tried on
_DIFFERENCE = 1e-4  # share or rad, for the derivative by a parameter
_ROUNDS = 8
_INDEPENDENT = 1e-6  # determinant of the cosines between the signatures of a set
_MOST = 6  # explanations, or faults, that are named
_PARALLEL = 0.995  # cosine
_NEARLY = 0.05
_LEFT_OF_LOADS = 0.15  # of the defects: a load changes within an interval, and the rotor turns on
_OF_COORDINATE = 0.1  # of a coordinate's defects are a load's on it, the rest of those on others
_OF_USUAL = 10.0  # times a coordinate's own median: less says nothing of it
_AT_END = 3  # intervals
_OF_ENDS = 1e-3  # of the largest defect: the others are large enough for those at the ends to be of the same cause
_STANDS_OUT = 30.0  # times the median of the defects
_FAINT = 0.02  # of the largest defect: fainter ones are not told beside it
_GAP = 6  # intervals: faults that are nearer are one
_MOST_DIRECTIONS = 20  # rows of a fault at which loads are looked for


@dataclass(frozen=True)
class Explanation:
    """A text, and the share of the defects' root mean square that it leaves."""

    left: float
    text: str


class DefectCauses:
    """Explanations of the defects of data of a scene, on intervals in which they are judged; tolerance: rad.

    largest, typical : rad, the largest beyond rounding, and the median over the intervals.
    """

    def __init__(self, scene: Scene, defects: Defects, tolerance: float) -> None:
        self._scene, self._defects, self._tolerance = scene, defects, tolerance
        moving = list(defects.moving)
        raw = np.hstack([defects.angles[:, moving], defects.rates[:, moving]])
        self._units = np.concatenate([np.ones(len(moving)), defects.rate_units[moving]])
        self._values = raw / self._units  # rad
        # Where a number is next to nothing its rounding is no measure.
        self._floors = np.maximum(defects.floors, 0.3 * np.median(defects.floors, axis=0) + 1e-18)
        judged = self._judged = defects.is_judged & np.isfinite(raw).all(axis=1)
        excess = np.maximum(
            np.abs(np.where(judged[:, None], self._values, 0.0)) - _AT_FLOOR * self._floors, 0.0
        )
        self._excess = excess.max(axis=1, initial=0.0)
        largest = self.largest = float(self._excess.max(initial=0.0))
        self.typical = float(np.median(self._excess))
        self._allowed = max(_LEFT * largest, min(tolerance, _LEFT_OF_SMALL * largest))
        # Some all over the run, and the largest; none with a kink of a load inside, where quick steps are wrong.
        tried = judged.copy()
        for kink in scene.kink_times:
            inside = (defects.time[:-1] < kink * (1.0 - 1e-9)) & (
                kink * (1.0 + 1e-9) < defects.time[1:]
            )
            tried &= ~inside
        rows = np.flatnonzero(tried)
        spread = (
            rows[np.linspace(0, len(rows) - 1, min(_INTERVALS // 2, len(rows))).astype(int)]
            if len(rows)
            else rows
        )
        chosen = self._chosen = np.union1d(
            spread, rows[np.argsort(-self._excess[rows])[: _INTERVALS // 2]]
        )
        self._begins, self._ends = defects.time[chosen], defects.time[chosen + 1]
        self._states = defects.states[chosen].T
        self._tried = self._values[chosen]
        self._weights = 1.0 / np.maximum(self._floors[chosen], 1e-4 * largest)
        self._steps = (
            explicit_steps(scene, self._ends - self._begins, defects.states[chosen])
            if len(chosen)
            else None
        )
        self._own_ends: dict[int, Array] = {}  # by the scene, by the factor of the steps
        # (m,) for how many of these rows a coordinate has one number, and with it one rounding error, on average.
        repeats = len(chosen) / (1.0 + np.count_nonzero(np.diff(self._states), axis=1))
        self._repeats = np.tile(repeats.reshape(2, -1).max(axis=0), 2)

    @property
    def is_rounding(self) -> bool:
        """Whether no defect is larger than what rounding explains."""
        return not self.largest

    def explanations(self) -> list[str]:
        """Other scenes and equations, else parameters, as many at once as it takes up to three; of those that are alike
        all. None where the defects follow nothing that was tried, or the motion is too stiff for explicit steps between
        the rows."""
        if self._steps is None:
            return []
        explained: list[Explanation] = []
        models = itertools.chain(
            other_models(self._scene), scenes_with_start(self._scene, self._first_row())
        )
        for text, model in () if self.is_rounding else models:
            if self._share(self._residual(model)) > _PERHAPS:
                continue
            residual = self._residual(model, _FINE)
            if self._left(residual) <= self._allowed:
                explained.append(Explanation(self._share(residual), text))
        # What has a name of its own is named, unless numbers of the scene explain far more.
        least = min([e.left for e in explained], default=np.inf)
        if least > 10.0 * _QUICK:
            others = self._parameter_sets()
            if min([e.left for e in others], default=np.inf) < 0.1 * least:
                explained = others
        least = max(min([e.left for e in explained], default=0.0), _QUICK)
        # What rounding leaves is of one size whatever the cause: there the least is nearly that of the right one.
        factor = 1.05 if self.is_rounding else _ALIKE
        return [
            e.text for e in sorted(explained, key=lambda e: e.left) if e.left <= factor * least
        ][:_MOST]

    def scenes(self) -> list[str]:
        """Those of the catalogue that start as the data do, and of which they may be."""
        if self._steps is None:
            return []
        allowed = max(self._tolerance, self._allowed)
        models = scenes_with_start(self._scene, self._first_row())
        return [
            text for text, model in models if self._left(self._residual(model, _FINE)) <= allowed
        ]

    def _first_row(self) -> Array:
        """(2 (1 + blades),) of the data; of coordinates that are fixed the scene's."""
        first, count = (
            np.array([*self._scene.initial_angles, *self._scene.initial_rates]),
            len(self._scene.blades) + 1,
        )
        moving = list(self._defects.moving)
        first[[*moving, *(count + i for i in moving)]] = self._defects.states[0]
        return first

    def _parameter_sets(self) -> list[Explanation]:
        """By least squares over the signatures of all parameters; the smallest sets that explain the defects."""
        known, columns = [], []
        for parameter in parameters(self._scene):
            slope = self._slope([parameter], [0.0], 0).ravel()
            size = float(np.linalg.norm(slope))
            if 0.0 < size < np.inf:
                known.append(parameter)
                columns.append(slope / size)
        if not known:
            return []
        cosines = np.array(columns) @ np.array(columns).T
        before = (self._tried * self._weights).ravel()
        projections, total = np.array(columns) @ before, float(before @ before)
        best, least = list[Explanation](), np.inf
        for count in range(1, 2 if self.is_rounding else _SET + 1):
            sets = np.array(list(itertools.combinations(range(len(known)), count)))
            if not len(sets):
                break
            matrices = cosines[sets[:, :, None], sets[:, None, :]]
            independent = np.linalg.det(matrices) > _INDEPENDENT
            sets, matrices = sets[independent], matrices[independent]
            sides = projections[sets]
            explained = (sides * np.linalg.solve(matrices, sides[..., None])[..., 0]).sum(axis=1)
            # Of a single one that is far off the signature may be another; several are not.
            if count > 1:
                sets, explained = (
                    array[explained > (1.0 - _LEFT_OF_SETS**2) * total]
                    for array in (sets, explained)
                )
            fits = [
                self._fit([known[i] for i in chosen])
                for chosen in sets[np.argsort(-explained)[:_TRIED]]
            ]
            found = [fit for fit in fits if fit is not None]
            left = min([fit.left for fit in found], default=np.inf)
            # One more is named only where that explains far more.
            if best and left > 0.1 * least:
                break
            if found:
                best, least = found, left
            if least <= 10.0 * _QUICK:
                break
        return best

    def _fit(self, chosen: Sequence[Parameter]) -> Explanation | None:
        """Gauss and Newton's iteration over some parameters at once; one step where rounding hides their effect."""
        change = np.zeros(len(chosen))
        for _ in range(1 if self.is_rounding else _ROUNDS):
            residual = (
                self._residual(_changed(self._scene, chosen, change), _FINE) * self._weights
            ).ravel()
            slopes = np.stack(
                [self._slope(chosen, change, i).ravel() for i in range(len(chosen))], axis=1
            )
            if not (np.isfinite(residual).all() and np.isfinite(slopes).all()):
                return None
            correction = -np.linalg.lstsq(slopes, residual, rcond=None)[0]
            change = change + correction
            if np.abs(change).max() > _LARGEST_CHANGE:
                return None
            if (np.abs(correction) <= 1e-9 + 1e-6 * np.abs(change)).all():
                break
        residual = self._residual(_changed(self._scene, chosen, change), _FINE)
        weighted = residual * self._weights
        if (
            not (self.is_rounding or self._left(residual) <= self._allowed)
            or not np.isfinite(weighted).all()
        ):
            return None
        spread = float(np.sqrt((weighted**2).mean()))
        if self.is_rounding:
            sizes = (slopes**2).reshape(self._tried.shape).sum(axis=0)  # of a single parameter
            spread = max(spread, 0.3) * math.sqrt(float(sizes @ self._repeats / sizes.sum()))
        deviation = spread * np.sqrt(np.diag(np.linalg.pinv(slopes.T @ slopes)))
        deviation = np.maximum(deviation, _QUICK * np.abs(change))
        if (np.abs(change) < _SIGNIFICANT * deviation).any():
            return None
        texts = []
        for parameter, amount, uncertainty in zip(
            chosen, change.tolist(), deviation.tolist(), strict=True
        ):
            factor, unit = (1.0, parameter.unit) if parameter.unit else (100.0, "%")
            texts.append(
                f"{parameter.key} off by {factor * amount:+.4g} {unit} (uncertainty {factor * uncertainty:.1g})"
            )
        return Explanation(self._share(residual), " and ".join(texts))

    def _residual(self, model: Model, steps: int = 1) -> Array:
        """(intervals, m) rad: defects by another model; infinite where it has another number of coordinates. steps: how
        many times as many as for transition matrices."""
        if model.scene.moving_coordinates != list(self._defects.moving):
            return np.full_like(self._tried, np.inf)
        assert self._steps is not None
        intervals = self._begins, self._ends, self._states, steps * self._steps
        try:
            ends = quick_ends(model.scene, *intervals, model.accelerations())
        except RotorError:
            return np.full_like(self._tried, np.inf)
        if steps not in self._own_ends:
            self._own_ends[steps] = quick_ends(self._scene, *intervals)
        return np.asarray(self._tried + (ends - self._own_ends[steps]).T / self._units)

    def _slope(self, chosen: Sequence[Parameter], at: Sequence[float] | Array, which: int) -> Array:
        """Weighted, by one of the parameters' share, or per rad, where they are changed already."""
        sides = []
        for step in (_DIFFERENCE, -_DIFFERENCE):
            change = np.array(at, float)
            change[which] += step
            sides.append(self._residual(_changed(self._scene, chosen, change)))
        with np.errstate(invalid="ignore"):
            return np.asarray((sides[0] - sides[1]) * self._weights / (2.0 * _DIFFERENCE))

    def _left(self, residual: Array) -> float:
        """rad, the largest beyond rounding."""
        return float((np.abs(residual) - _AT_FLOOR * self._floors[self._chosen]).max())

    def _share(self, residual: Array) -> float:
        before = float(np.linalg.norm(self._tried * self._weights))
        return float(np.linalg.norm(residual * self._weights)) / (before or 1.0)

    def faults(self) -> list[str]:
        """What stands out of the other intervals, by its pattern in time; none where most intervals are wrong, or none
        is more than the tolerance."""
        excess = self._excess
        if self.largest <= self._tolerance:
            return []
        usual = float(np.median(excess[self._judged])) if self._judged.any() else 0.0
        wrong = np.flatnonzero(excess > max(_STANDS_OUT * usual, _FAINT * self.largest))
        # What is wrong everywhere is no fault at a time, though it shows in some places more than in others.
        if not len(wrong) or len(wrong) > 0.6 * len(excess):
            return []
        # Nor is one whose size comes down gradually beside what stands out: a fault at a time has edges.
        edges = np.concatenate([wrong - 1, wrong + 1])
        edges = edges[~np.isin(edges, wrong) & (edges >= 0) & (edges < len(excess))]
        if len(edges) and float(np.median(excess[edges])) > 0.1 * float(np.median(excess[wrong])):
            return []
        groups = np.split(wrong, np.flatnonzero(np.diff(wrong) > _GAP) + 1)
        # A filter, or differences in place of rates, are wrong in all rows, and most at the ends.
        if usual > _OF_ENDS * self.largest:
            groups = [
                group
                for group in groups
                if group[-1] >= _AT_END and group[0] < len(excess) - _AT_END
            ]
        texts = [self._fault(group) for group in groups[:_MOST]]
        if len(groups) > _MOST:
            end = float(self._defects.time[groups[-1][-1] + 1])
            texts.append(f"and {len(groups) - _MOST} more faults until t = {end:.6g} s")
        return texts

    def _fault(self, group: NDArray[np.int64]) -> str:
        """Of intervals that stand out, one near the other."""
        time, half = self._defects.time, len(self._defects.moving)
        first, last = int(group[0]), int(group[-1])
        start, end = float(time[first]), float(time[last + 1])
        values = self._values[group]
        # Of a repeated row the defect is the motion over the interval; of a part of it, that at its end.
        motion = (
            values[0]
            + (self._defects.states[first + 1] - self._defects.states[first]) / self._units
        )
        along = max((_cosine(values[0], flow) for flow in (self._flow(first), motion)), key=abs)
        if len(group) == 1 and abs(along) >= _PARALLEL:
            # The defect is closed form less data: along the motion where the data are behind it.
            row, clock = (
                ("repeated", "late")
                if along > 0.0
                else ("omitted and the others renumbered", "early")
            )
            return f"a row {row}, or times {clock} by less than an interval, at t = {end:.6g} s"
        if len(group) == 2 and self._defects.transitions is not None and last == first + 1:
            carried = self._defects.transitions[first + 1] @ (values[0] * self._units) / self._units
            if _cosine(values[1], -carried) >= _PARALLEL:
                row = f"row {first + 2}, t = {time[first + 1]:.6g} s"
                if abs(along) >= _PARALLEL:
                    return f"a stuck row, or one at a wrong time: {row}"
                return f"a single wrong row: {row}"
        # The coordinates on which loads make such defects.
        chosen = group[:: max(1, len(group) // _MOST_DIRECTIONS)]
        loads, acting = self._loads(chosen)  # N m that the data have more
        if len(acting) == 1 and (edge := self._edge(acting[0], start, end, loads[:, acting[0]])):
            return f"the load on the {self._label(acting[0])} {edge}"
        if len(group) == 1:
            # Of a change of rates in the interval the angles have got a share.
            angles, rates = values[0, :half], values[0, half:] * self._units[half:] * (end - start)
            share = float(angles @ rates) / (float(rates @ rates) or 1.0)
            rest = float(np.linalg.norm(angles - share * rates))
            if -_NEARLY <= share <= 1.0 + _NEARLY and rest <= _NEARLY * float(
                np.linalg.norm(rates)
            ):
                return f"a jump of rates, or a load of one interval, before t = {end:.6g} s"
            return f"the motion continues from another state after t = {end:.6g} s"
        if acting:
            amounts = " and ".join(
                f"{loads[:, i].mean():+.3g} N m on the {self._label(i)}" for i in acting
            )
            return f"a load that is wrong or missing from t = {start:.6g} to {end:.6g} s: on average {amounts}"
        largest = int(np.abs(values).max(axis=0).argmax()) % half
        return f"a fault from t = {start:.6g} to {end:.6g} s, largest in the {self._label(largest)}"

    def _label(self, place: int) -> str:
        return self._scene.coordinate_labels[self._defects.moving[place]]

    def _loads(self, rows: NDArray[np.int64]) -> tuple[Array, list[int]]:
        """(rows, coordinates) N m that explain the defects of some intervals best, and the coordinates on which they
        act; none where loads leave too much."""
        values, effects = self._values[rows], self._effects(rows)
        usual = np.median(np.abs(self._values[self._judged]), axis=0) + _AT_FLOOR * self._floors[
            rows
        ].max(axis=0)
        # Each channel counts alike: a pitch moves by millions of what the rotor does.
        units = np.linalg.norm(values, axis=0) + _OF_USUAL * math.sqrt(len(rows)) * usual
        sizes = np.linalg.norm(effects / units, axis=2)
        if not (np.isfinite(sizes).all() and sizes.all()):
            return np.zeros(sizes.T.shape), []
        matrices = (effects / units / sizes[:, :, None]).transpose(1, 2, 0)
        loads = -(np.linalg.pinv(matrices) @ (values / units)[:, :, None])[:, :, 0] / sizes.T
        parts = loads.T[:, :, None] * effects
        if np.linalg.norm((values + parts.sum(axis=0)) / units) > _LEFT_OF_LOADS * np.linalg.norm(
            values / units
        ):
            return loads, []
        acting = []
        for i, part in enumerate(parts):
            own = [i, len(parts) + i]
            if np.linalg.norm(part[:, own] / units[own]) > _OF_COORDINATE:
                acting.append(i)
        return loads, acting

    def _edge(self, place: int, start: float, end: float, more: Array) -> str:
        """Of intervals beside a jump of a coordinate's load, "" elsewhere; more: N m that the data have more."""
        table = self._scene.load_tables[torque_place(self._defects.moving[place])]
        for (t0, value0), (t1, value1) in itertools.pairwise(table):
            jump = value1 - value0
            if t0 != t1 or not jump or not start * (1.0 - 1e-9) <= t0 <= end * (1.0 + 1e-9):
                continue
            if len(more) == 1 and abs(abs(more[0] / jump) - 1.0) <= _NEARLY:
                side = "late" if more[0] / jump < 0.0 else "early"
                return f"jumps a row {side} at t = {t0:.6g} s, or has a wrong value in this row"
            if (
                len(more) == 2
                and abs(more.sum()) <= _NEARLY * np.abs(more).max()
                and more[0] / jump > 0.0
            ):
                return f"is smoothed over its jump at t = {t0:.6g} s"
        return ""

    def _effects(self, rows: NDArray[np.int64]) -> Array:
        """(coordinates, rows, m) rad: what 1 N m on each coordinate that moves makes of an interval's end."""
        defects, form = self._defects, rotor_form(self._scene)
        begins, ends, states = defects.time[rows], defects.time[rows + 1], defects.states[rows].T
        steps = explicit_steps(self._scene, ends - begins, defects.states[rows]) or 1
        inertia = form.inertia + sum(blade.schur_ss + blade.schur_cc for blade in form.blades)
        effects = []
        for i, size in enumerate([inertia, *(blade.pitch_inertia for blade in form.blades)]):
            torque = (
                1e-6 * float(size) / float((ends - begins).max()) ** 2
            )  # far above round-off, and yet linear

            def equations(
                angles: Any,
                rates: Any,
                form: Any,
                loads: Any,
                *rest: Any,
                i: int = i,
                x: float = torque,
            ) -> Any:
                pitches = [
                    p + x * (k + 1 == i)
                    for k, p in enumerate(loads.pitches or [0.0] * len(form.blades))
                ]
                loads = replace(loads, rotor=loads.rotor + x * (i == 0), pitches=pitches)
                return closed_form.accelerations(angles, rates, form, loads, *rest)

            pushed, free = (
                quick_ends(self._scene, begins, ends, states, steps, e) for e in (equations, None)
            )
            effects.append((pushed - free).T / self._units / torque)
        return np.asarray(effects)

    def _flow(self, row: int) -> Array:
        """How the state goes on at a row, rad and, in units of the rates' defects, rad, per s."""
        states, time = self._defects.states, self._defects.time
        half = states.shape[1] // 2
        ahead = min(row + 2, len(states) - 1)
        change = (states[ahead, half:] - states[row, half:]) / (time[ahead] - time[row])
        return np.asarray(np.concatenate([states[row + 1, half:], change]) / self._units)


def _changed(scene: Scene, chosen: Sequence[Parameter], change: Array) -> Model:
    model = Model(scene)
    for parameter, amount in zip(chosen, change.tolist(), strict=True):
        model = parameter.change(model, amount)
    return model


def _cosine(first: Array, second: Array) -> float:
    size = float(np.linalg.norm(first) * np.linalg.norm(second))
    return float(first @ second) / size if size else 0.0
