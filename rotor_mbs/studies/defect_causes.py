"""What the defects of data look like: a fault at a time, other equations or numbers, or a parameter that is off.

Nothing is run from the start: each explanation is held to the data's own states, interval by interval. It is named
where it explains the defects to what the rounding of the data leaves, or but for a fiftieth of what they were.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.closed_form import load_values
from rotor_mbs.models.lagrange.defects import change_of_ends, interval_ends
from rotor_mbs.models.lagrange.ode_solvers import Accelerations
from rotor_mbs.models.lagrange.parameters import rotor_form
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.defects import Defects
from rotor_mbs.solution.trajectory import Array

MAX_LEFT = 0.02  # of the defects' root mean square
_AT_FLOOR = 3.0  # times the rounding
_SIGNIFICANT = 8.0  # standard deviations of an estimate
_TRIED = 8  # parameters, those whose projections leave least
_LARGEST_CHANGE = 0.6  # a share, or rad: what is further off is another scene
_INTERVALS = 120  # that an explanation is tried on first
_DIFFERENCE = 1e-4  # share or rad, for the derivative by a parameter
_ROUNDS = 8
_PARALLEL = 0.995  # cosine
_ALONG = 0.9  # of a load while the rotor turns on
_STANDS_OUT = 30.0  # times the median of the defects
_FAINT = 0.02  # of the largest defect: fainter ones are not told beside it
_GAP = 6  # intervals: faults that are nearer are one
_MOST_DIRECTIONS = 20  # rows of a fault at which loads are looked for
_MAX_FAULTS = 6  # that are named one by one

# The scene with its parameter changed by a share (or rad), or the same scene with other equations.
Change = Callable[[float], tuple[Scene, Accelerations | None]]


@dataclass(frozen=True)
class Parameter:
    """A number of the scene; unit: "" where its change is a share of it."""

    key: str
    unit: str
    change: Change


@dataclass(frozen=True)
class Fault:
    """A fault between two rows of the data."""

    start_s: float
    end_s: float
    text: str


class DefectCauses:
    """Explanations of the defects of data of a scene, on intervals in which they are judged."""

    def __init__(self, scene: Scene, defects: Defects) -> None:
        self._scene, self._defects = scene, defects
        moving = list(defects.moving)
        self._values = np.hstack([defects.angles[:, moving], defects.rates[:, moving]])
        units = self._units = np.concatenate([np.ones(len(moving)), defects.rate_units[moving]])
        # Where a number is next to nothing its rounding is no measure.
        floors = np.maximum(defects.floors, 0.3 * np.median(defects.floors, axis=0) + 1e-18) * units
        self._judged = np.flatnonzero(defects.is_judged & np.isfinite(self._values).all(axis=1))
        # In these a defect of what rounding makes is 1 at most.
        self._weights = 1.0 / floors
        self._normal = np.where(np.isfinite(self._values), self._values * self._weights, 0.0)
        size = np.abs(self._normal).max(axis=1)
        spread = np.linspace(0, len(self._judged) - 1, min(_INTERVALS, len(self._judged))).astype(int)
        largest = self._judged[np.argsort(-size[self._judged])[: _INTERVALS // 2]]
        self._chosen = np.unique(np.concatenate([self._judged[spread], largest])) if len(self._judged) else self._judged

    @property
    def is_rounding(self) -> bool:
        """Whether no defect is larger than what rounding explains."""
        return not len(self._judged) or float(np.abs(self._normal[self._judged]).max()) <= _AT_FLOOR

    def within(self, size: float) -> bool:
        """Whether no defect is larger than this (rad) beyond what rounding explains."""
        excess = self._defects.channel_sizes[self._judged] - _AT_FLOOR * self._defects.floors[self._judged]
        return not excess.size or float(excess.max()) <= size

    def left(self, scene: Scene, equations: Accelerations | None = None) -> float:
        """Share of the defects' root mean square that another scene or other equations leave; infinite where they do
        not explain them. A scene is tried by small steps first, which need no code to be compiled."""
        if not len(self._judged) or scene.moving_coordinates != list(self._defects.moving):
            return np.inf
        if equations is None:
            change = change_of_ends(self._scene, scene, self._defects.time, self._defects.states)
            if change is not None:
                residual = self._normal[self._chosen] + (change * self._weights)[self._chosen]
                if not self._share(residual, self._chosen) < np.inf:
                    return np.inf
        return self._share(self._residual(scene, equations, self._chosen), self._chosen)

    def parameters(self, parameters: Sequence[Parameter]) -> list[tuple[float, str]]:
        """Of those that explain the defects by themselves: (share that is left, key and change)."""
        chosen, explained = self._chosen, []
        if not len(chosen):
            return []
        before = self._normal[chosen]
        total = float(np.linalg.norm(before))
        projections = []
        for parameter in parameters:
            slope = self._slope(parameter, 0.0, chosen)
            size = float((slope**2).sum())
            if np.isfinite(size) and size > 0.0:
                estimate = -float((before * slope).sum()) / size
                residual = before + estimate * slope
                rest = float(np.linalg.norm(residual))
                deviation = max(rest / np.sqrt(residual.size), 0.3) / np.sqrt(size)
                projections.append((rest, estimate, deviation, parameter))
        projections.sort(key=lambda projection: projection[0])
        for rest, estimate, deviation, parameter in projections[:_TRIED]:
            # Below the rounding of the data a parameter shows by the sum over all rows alone.
            if self.is_rounding:
                if abs(estimate) >= _SIGNIFICANT * deviation and abs(estimate) <= _LARGEST_CHANGE:
                    explained.append((rest / total, _text(parameter, estimate)))
                continue
            change = estimate
            for _ in range(_ROUNDS):
                residual = self._residual(*parameter.change(change), chosen)
                slope = self._slope(parameter, change, chosen)
                size = float((slope**2).sum())
                if not (np.isfinite(residual).all() and 0.0 < size < np.inf) or abs(change) > _LARGEST_CHANGE:
                    break
                correction = -float((residual * slope).sum()) / size
                change += correction
                if abs(correction) <= 1e-9 + 1e-6 * abs(change):
                    break
            if _SIGNIFICANT * deviation <= abs(change) <= _LARGEST_CHANGE:
                share = self._share(self._residual(*parameter.change(change), chosen), chosen)
                if share < np.inf:
                    explained.append((share, _text(parameter, change)))
        return sorted(explained)

    def faults(self) -> list[Fault]:
        """What stands out of the other intervals, by its pattern in time; none where most intervals are wrong."""
        excess = np.maximum(self._defects.channel_sizes - _AT_FLOOR * self._defects.floors, 0.0).max(axis=1)
        excess[~np.isin(np.arange(len(excess)), self._judged)] = 0.0
        usual = float(np.median(excess[self._judged])) if len(self._judged) else 0.0
        wrong = np.flatnonzero(excess > max(_STANDS_OUT * usual, _FAINT * float(excess.max(initial=0.0))))
        # What is wrong everywhere is no fault at a time, though it shows in some places more than in others.
        if not len(wrong) or len(wrong) > 0.6 * len(excess) or _is_smooth(excess, wrong):
            return []
        groups = np.split(wrong, np.flatnonzero(np.diff(wrong) > _GAP) + 1)
        return [self._fault(group) for group in groups]

    def _fault(self, group: NDArray[np.int64]) -> Fault:
        """The group's intervals stand out, one after the other."""
        time, half = self._defects.time, len(self._defects.moving)
        first, last = int(group[0]), int(group[-1])
        start, end = float(time[first]), float(time[last + 1])
        values = self._values[group]
        along = self._cosine(values[0], self._flow(first))
        at = f"t = {end:.6g} s"
        if len(group) == 1:
            if abs(along) >= _PARALLEL:
                # The defect is closed form less data: along the motion where the data are behind it.
                text = "a row repeated, or the clock late by a part of an interval" if along > 0.0 else (
                    "a row left out and the others renumbered, or the clock early by a part of an interval"
                )  # fmt: skip
                return Fault(start, end, f"{text}, at {at}")
            angles = np.abs(self._normal[first, :half]).max()
            if angles <= _AT_FLOOR or np.abs(values[0, :half]).max() * 100.0 < np.abs(values[0, half:]).max():
                return Fault(start, end, f"a jump of rates, or a load of one interval, before {at}")
            return Fault(start, end, f"the motion goes on from another state after {at}")
        if len(group) == 2 and self._defects.transitions is not None:
            carried = self._defects.transitions[first + 1] @ values[0]
            if self._cosine(values[1], -carried) >= _PARALLEL:
                row = f"row {first + 2}, t = {time[first + 1]:.6g} s"
                if abs(along) >= _PARALLEL:
                    return Fault(start, end, f"a stuck row, or one at a wrong time: {row}")
                return Fault(start, end, f"a single wrong row: {row}")
        # The coordinate on which a load makes such changes of the rates.
        chosen = group[:: max(1, len(group) // _MOST_DIRECTIONS)]
        directions = np.stack([self._directions(row) for row in chosen], axis=1)
        cosines = [self._cosine_of_rates(self._values[chosen, half:], direction) for direction in directions]
        place = int(np.argmax(cosines))
        label = self._scene.coordinate_labels[self._defects.moving[place]]
        kind = "a load on the {} that is wrong or missing" if cosines[place] >= _ALONG else "a fault of the {}"
        return Fault(start, end, f"{kind.format(label)} from t = {start:.6g} to {end:.6g} s")

    def _directions(self, row: int) -> Array:
        """(coordinates, coordinates) rad/s² that 1 N m on each coordinate that moves makes of all."""
        state, half = self._defects.states[row], len(self._defects.moving)
        form = rotor_form(self._scene)

        def accelerations(torques: Array) -> Array:
            loads = load_values([*torques, *np.zeros(half - 1)])
            found = closed_form.accelerations(
                state[:half].tolist(), state[half:].tolist(), form, loads, math.sin, math.cos
            )
            return np.array(found)

        free = accelerations(np.zeros(half))
        return np.array([accelerations(1e6 * unit) - free for unit in np.eye(half)])

    def _cosine_of_rates(self, values: Array, directions: Array) -> float:
        """Of the defects of rates of several intervals, on the average, each with its direction."""
        sizes = np.linalg.norm(values, axis=1) * np.linalg.norm(directions, axis=1)
        return float(np.abs((values * directions).sum(axis=1)).sum() / (sizes.sum() or 1.0))

    def _flow(self, row: int) -> Array:
        """How the state goes on at a row, per s."""
        states, time = self._defects.states, self._defects.time
        half = states.shape[1] // 2
        ahead = min(row + 2, len(states) - 1)
        change = (states[ahead, half:] - states[row, half:]) / (time[ahead] - time[row])
        return np.concatenate([states[row + 1, half:], change])

    def _cosine(self, first: Array, second: Array) -> float:
        a, b = first / self._units, second / self._units
        size = float(np.linalg.norm(a) * np.linalg.norm(b))
        return float(a @ b) / size if size else 0.0

    def _residual(self, scene: Scene, equations: Accelerations | None, intervals: NDArray[np.int64]) -> Array:
        """(intervals, m) defects by another scene or other equations, in units of rounding."""
        states = self._defects.states
        equations = equations or closed_form.accelerations  # by SciPy: a scene of another structure is not compiled
        ends = interval_ends(scene, self._defects.time, states, intervals.tolist(), equations)
        return np.asarray((ends - states[intervals + 1]) * self._weights[intervals])

    def _slope(self, parameter: Parameter, at: float, intervals: NDArray[np.int64]) -> Array:
        """By the parameter's share, or per rad, at a change of it."""
        sides = []
        for step in (_DIFFERENCE, -_DIFFERENCE):
            scene, equations = parameter.change(at + step)
            change = None
            if equations is None:
                change = change_of_ends(self._scene, scene, self._defects.time, self._defects.states)
            if change is not None:
                sides.append((change * self._weights)[intervals])
            else:
                sides.append(self._residual(scene, equations, intervals))
        return np.asarray((sides[0] - sides[1]) / (2.0 * _DIFFERENCE))

    def _share(self, residual: Array, intervals: NDArray[np.int64]) -> float:
        """What is left of the defects' root mean square; infinite where that is neither little nor rounding."""
        if not np.isfinite(residual).all():
            return np.inf
        share = float(np.linalg.norm(residual) / (np.linalg.norm(self._normal[intervals]) or 1.0))
        return share if share <= MAX_LEFT or float(np.abs(residual).max()) <= _AT_FLOOR else np.inf


def _text(parameter: Parameter, change: float) -> str:
    amount = f"{change:+.4g} {parameter.unit}" if parameter.unit else f"{100.0 * change:+.4g} %"
    return f"{parameter.key} off by {amount}"


def _is_smooth(size: Array, wrong: NDArray[np.int64]) -> bool:
    """Whether the sizes come down gradually beside what stands out: a fault at a time has edges."""
    edges = [i for i in (*(wrong - 1), *(wrong + 1)) if 0 <= i < len(size) and i not in set(wrong.tolist())]
    return bool(edges) and float(np.median(size[edges])) > 0.1 * float(np.median(size[wrong]))


def fault_lines(faults: Sequence[Fault]) -> Iterator[str]:
    """Faults in words; of many the first ones, and how many there are."""
    for fault in faults[:_MAX_FAULTS]:
        yield fault.text
    if len(faults) > _MAX_FAULTS:
        yield f"and {len(faults) - _MAX_FAULTS} more faults until t = {faults[-1].end_s:.6g} s"
