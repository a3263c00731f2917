"""Other scenes, equations and parameters that explain the defects of data.

No motion is integrated from the start: each hypothesis is compared with the data's own states,
interval by interval. It explains the defects if it leaves nearly none, or what is tolerated.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.comparison.data_defects import AT_FLOOR, JudgedDefects
from rotor_mbs.comparison.hypotheses import Explanation, Hypothesis, closest, explanations
from rotor_mbs.comparison.other_rotors import (
    Parameter,
    RotorModel,
    by_rows,
    parameters,
    rotor_hypotheses,
    scenes_with_start,
)
from rotor_mbs.errors import RotorError
from rotor_mbs.models.lagrange.defects import FIT_ROWS, explicit_steps, quick_ends
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Array

# Shares of the largest defect that an explanation may leave, because the other program and the
# quick steps have errors of their own. The second share holds if what is left is within the
# tolerance.
_LEFT, _LEFT_OF_SMALL = 1e-3, 0.15
# The same share by the number of fitted parameters.
_LEFT_OF_FITTED = {1: 0.02, 2: 2e-3, 3: 2e-3}
_ALIKE = 3.0  # times what the best explanation leaves
_ALIKE_IN_ROUNDING = 1.05
_QUICK = 3e-5  # relative error of the effect of another model, if computed by quick steps
# Fine steps are _MOST_FINE times as many, so that this error holds also where the mass matrix is
# nearly singular. A search that has to be quick takes at most _FINE_STEPS of them in an interval.
_MOST_FINE, _FINE_STEPS = 8, 32
# A model that leaves a larger share of the defects by coarse steps is not tried by fine ones.
_PERHAPS = 0.2
# A multiple of a model's effect explains far more if it leaves less than this share of what the
# model leaves.
_OF_RESCALED = 0.3
_LEFT_OF_SETS = 0.1  # share left by the projections on several parameters, before they are fitted
_FAR_BETTER = 0.1  # times what a cheaper explanation leaves
_SIGNIFICANT = 8.0  # standard deviations of an estimate
# A textbook mistake is certainly the cause if all others leave more than this many times as much.
_CERTAIN = 10.0
_MAX_CHANGE = 0.6  # a share, or rad: what is further off is another scene
_MAX_FITTED = 8  # sets of parameters, those whose projections leave least
_MAX_PARAMETERS = 3  # at once
_MAX_INTERVALS = 120  # on which a hypothesis is tried
_MAX_WINDOWS = 60  # of rows, likewise, where the rates are computed from the angles
_SMALLEST_FLOOR = 1e-18  # rad
# Largest number of steps of Runge and Kutta in an interval: for any search; for one that takes some
# seconds; for data that agree.
_MAX_STEPS, QUICK_SEARCH, BRIEF_SEARCH = 512, 32, 8
_MAX_FITTED_BRIEF = 4
_DIFFERENCE = 1e-4  # share or rad, for the derivative by a parameter
_ROUNDS = 8  # of Gauss and Newton's iteration
_INDEPENDENT = 1e-6  # determinant of the cosines between the signatures of a set
_MAX_NAMED = 6  # explanations


class DefectSearch:
    """Search for other models that explain the defects of data.

    Parameters
    ----------
    judged : the defects of the data.
    max_steps : of Runge and Kutta in an interval: where more are needed, nothing is searched for.
        With at most `BRIEF_SEARCH`, sets of several parameters are not tried.

    Attributes
    ----------
    rows : (k,) numbers of the intervals on which hypotheses are tried.
    """

    def __init__(self, judged: JudgedDefects, max_steps: int = _MAX_STEPS) -> None:
        defects, scene = judged.defects, judged.scene
        self._judged, self._scene = judged, scene
        self._moving = list(defects.moving)
        rows = self.rows = _tried_intervals(judged)
        self._from_intervals: Array | None = None
        self._values, self._floors = judged.values[rows], judged.floors[rows]
        if judged.has_fitted_rates:
            windows = _tried_windows(judged, rows)
            rows = self.rows = (windows[:, None] + np.arange(FIT_ROWS - 1)).ravel()
            self._values, self._floors, self._from_intervals = _window_residuals(judged, windows)
        excess = np.abs(self._values) - AT_FLOOR * self._floors
        largest = self._largest = float(excess.max(initial=0.0))
        self._allowed = max(_LEFT * largest, min(judged.tolerance, _LEFT_OF_SMALL * largest))
        self._begins, self._ends = defects.time[rows], defects.time[rows + 1]
        self._states = defects.states[rows].T
        # Residuals are weighted by the rounding of each number, which has a lower limit so that no
        # channel counts alone.
        self._weights = 1.0 / np.maximum(self._floors, 1e-4 * largest)
        self._is_brief = max_steps <= BRIEF_SEARCH
        self._steps, self._fine = None, _MOST_FINE
        if len(rows):
            lengths = self._ends - self._begins
            self._steps = explicit_steps(scene, lengths, defects.states[rows], max_steps)
        if self._steps is not None and max_steps < _MAX_STEPS:
            self._fine = max(min(_MOST_FINE, _FINE_STEPS // self._steps), 1)
        self._ends_of_scene: dict[int, Array] = {}  # by the factor of the steps
        # The number of rows, on average, over which a coordinate keeps one value, and with it one
        # rounding error.
        changes = np.count_nonzero(np.diff(self._states), axis=1)
        of_coordinates = (len(rows) / (1.0 + changes)).reshape(2, -1).max(axis=0)
        self._repeats = np.tile(of_coordinates, self._values.shape[1] // len(of_coordinates))

    @property
    def _is_rounding(self) -> bool:
        """Return whether no residual is larger than what rounding explains."""
        return not self._largest

    def explanations(self) -> list[str]:
        """Search for other scenes and equations, and for parameters that are off.

        Parameters are tried if nothing else explains the defects to the error of the quick steps.

        Returns
        -------
        list of str
            The best explanation and all that are alike, in words. Empty where nothing that was
            tried explains the defects, or the motion is too stiff for explicit steps between rows.
        """
        if self._steps is None:
            return []
        is_rounding = self._is_rounding
        explained: list[Explanation[RotorModel]] = []
        if not is_rounding:
            for explanation in explanations(self._plausible_models(), self._left_by):
                if not self._has_other_size(explanation):
                    explained.append(explanation)
        # A named mistake is preferred to fitted parameters, unless these explain far more.
        least = _least(explained)
        if least > 10.0 * _QUICK:
            by_parameters = self._parameter_sets()
            if _least(by_parameters) < _FAR_BETTER * least:
                explained = by_parameters
        # Defects within rounding leave about as much whatever the cause: only explanations that are
        # nearly as good as the best are alike there.
        factor = _ALIKE_IN_ROUNDING if is_rounding else _ALIKE
        alike = closest(explained, factor, _QUICK)
        return [explanation.text for explanation in alike[:_MAX_NAMED]]

    def textbook_causes(self) -> list[str]:
        """Find the mistakes in equations, else in numbers, that explain the defects.

        Returns
        -------
        list of str
            The best, which leaves at most a thousandth of the defects' weighted root mean square,
            and all that leave at most ten times as much; a single one is certainly the cause.
        """
        if self._steps is None or self._is_rounding:
            return []

        def left(model: RotorModel) -> float:
            return self._share(self._residual(model, self._fine))

        # An explanation leaves at most _LEFT. Hypotheses that leave up to _CERTAIN times as much
        # are kept, too: if there are any, the explanation is not certainly the cause.
        hypotheses = rotor_hypotheses(self._scene)
        explained = list(explanations(hypotheses, left, _CERTAIN * _LEFT))
        if not _least(explained) <= _LEFT:
            explained = self._parameter_sets()
        if not _least(explained) <= _LEFT:
            return []
        # A right model leaves an error of the quick steps. What is left below this error does not
        # show which model is better.
        alike = closest(explained, _CERTAIN, 0.1 * _QUICK)
        return [explanation.text for explanation in alike]

    def scenes(self) -> list[str]:
        """Search for scenes of the catalogue that start as the data do and explain the defects."""
        if self._steps is None:
            return []

        def left(model: RotorModel) -> float:
            return self._largest_left(self._residual(model, self._fine))

        allowed = max(self._judged.tolerance, self._allowed)
        hypotheses = scenes_with_start(self._scene, self._first_row())
        return [explanation.text for explanation in explanations(hypotheses, left, allowed)]

    def _plausible_models(self) -> Iterator[Hypothesis[RotorModel]]:
        """Yield the models that leave little of the defects when computed by coarse steps."""
        first_row = self._first_row()
        every = itertools.chain(
            rotor_hypotheses(self._scene),
            by_rows(self._scene, self._judged.defects.time, self.rows),
            scenes_with_start(self._scene, first_row),
        )
        for hypothesis in every:
            if not self._share(self._residual(hypothesis.change)) > _PERHAPS:
                yield hypothesis

    def _first_row(self) -> Array:
        """Return the first state of the data, with the scene's pitches where they have no inertia.

        Its shape is (2 (1 + blades),).
        """
        scene = self._scene
        first = np.array([*scene.initial_angles, *scene.initial_rates])
        count = len(scene.initial_angles)
        columns = [*self._moving, *(count + i for i in self._moving)]
        first[columns] = self._judged.defects.states[0]
        return first

    # Residuals

    def _residual(self, model: RotorModel, steps: int = 1) -> Array:
        """Return the defects of the data by another model.

        Parameters
        ----------
        model : in place of the scene.
        steps : factor of the number of steps in an interval.

        Returns
        -------
        ndarray
            (k, m) rad; infinite if the model has other coordinates or its equations do not hold.
        """
        if model.scene.moving_coordinates != self._moving:
            return np.full_like(self._values, np.inf)
        assert self._steps is not None
        intervals = self._begins, self._ends, self._states
        try:
            if model.method is None:
                ends = quick_ends(
                    model.scene, *intervals, steps * self._steps, model.accelerations()
                )
            else:
                # `change` below is then the error of the method against the closed form. The steps
                # of the two differ, so that errors of the closed form's steps remain in it.
                ends = quick_ends(model.scene, *intervals, model.steps, step=model.method)
        except RotorError:
            return np.full_like(self._values, np.inf)
        # Two models are integrated by the same steps, whose errors cancel in the difference.
        if steps not in self._ends_of_scene:
            self._ends_of_scene[steps] = quick_ends(self._scene, *intervals, steps * self._steps)
        change = (ends - self._ends_of_scene[steps]).T
        if self._from_intervals is None:
            return np.asarray(self._values + change / self._judged.units)
        of_windows = change.reshape(len(self._values), -1)
        return np.asarray(self._values + np.einsum("kij,kj->ki", self._from_intervals, of_windows))

    def _largest_left(self, residual: Array) -> float:
        """Return the largest of (k, m) defects beyond rounding, rad."""
        return float((np.abs(residual) - AT_FLOOR * self._floors).max())

    def _share(self, residual: Array) -> float:
        """Return the share of the defects' weighted root mean square that is left."""
        before = float(np.linalg.norm(self._values * self._weights))
        return float(np.linalg.norm(residual * self._weights)) / (before or 1.0)

    def _left_by(self, model: RotorModel) -> float:
        """Return the share of the defects that a model leaves; infinite where it is too much."""
        return self._left_at_most(model, self._allowed)

    def _left_at_most(self, model: RotorModel, allowed: float) -> float:
        """Return the share that a model leaves; infinite if a defect stays above `allowed`, rad.

        If all defects of the data are within rounding, the share is always returned.
        """
        residual = self._residual(model, self._fine)
        if not self._is_rounding and not self._largest_left(residual) <= allowed:
            return math.inf
        return self._share(residual)

    def _has_other_size(self, explanation: Explanation[RotorModel]) -> bool:
        """Return whether a multiple of a model's effect explains the defects far better than it.

        Then the data have a mistake of this kind but of another size: a hub whose inertia is too
        small is not one without inertia. If the model is right and the rest is the other program's
        own error, no multiple is far better.
        """
        if explanation.left <= 10.0 * _QUICK:
            return False
        residual = self._residual(explanation.hypothesis.change, self._fine)
        left = (residual * self._weights).ravel()
        effect = left - (self._values * self._weights).ravel()
        multiple = float(left @ effect) / (float(effect @ effect) or 1.0)
        rescaled = float(np.linalg.norm(left - multiple * effect))
        return rescaled < _OF_RESCALED * float(np.linalg.norm(left))

    # Parameters

    def _parameter_sets(self) -> list[Explanation[RotorModel]]:
        """Search for small sets of parameters that explain the defects.

        The signature of a parameter is the derivative of the defects by it. Least squares over the
        signatures of a set say how much of the defects it may explain; the best sets are fitted.

        Returns
        -------
        list of Explanation
            Sets of the smallest number of parameters that explains the defects, or of a larger one
            that explains them far better; empty if none does.
        """
        candidates, signatures = self._signatures()
        if not candidates:
            return []
        cosines = signatures @ signatures.T
        before = (self._values * self._weights).ravel()
        projections, total = signatures @ before, float(before @ before)
        best: list[Explanation[RotorModel]] = []
        max_count = 1 if self._is_rounding or self._is_brief else _MAX_PARAMETERS
        max_fitted = _MAX_FITTED_BRIEF if self._is_brief else _MAX_FITTED
        for count in range(1, max_count + 1):
            sets = np.array(list(itertools.combinations(range(len(candidates)), count)))
            if not len(sets):
                break
            matrices = cosines[sets[:, :, None], sets[:, None, :]]
            # Parameters with the same signature cannot be distinguished: a mass and gravity may
            # have the same.
            is_independent = np.linalg.det(matrices) > _INDEPENDENT
            sets, matrices = sets[is_independent], matrices[is_independent]
            sides = projections[sets]
            amounts = np.linalg.solve(matrices, sides[..., None])[..., 0]
            # The part of `total` that a set explains.
            squares = (sides * amounts).sum(axis=1)
            # Signatures are those of small changes. A single parameter may be far off, where its
            # signature is another: it is fitted even if this one explains little.
            if count > 1:
                is_enough = squares > (1.0 - _LEFT_OF_SETS**2) * total
                sets, squares = sets[is_enough], squares[is_enough]
            fitted = []
            for places in sets[np.argsort(-squares)[:max_fitted]]:
                hypothesis = self._fit([candidates[i] for i in places])
                if hypothesis is not None:
                    fitted.append(hypothesis)
            # Fitted numbers explain a part of any defects, and several of them a large part: they
            # are allowed to leave less than a textbook mistake, whose size is known.
            allowed = min(self._allowed, _LEFT_OF_FITTED[count] * self._largest)
            left = functools.partial(self._left_at_most, allowed=allowed)
            explained = list(explanations(fitted, left))
            # A further parameter is accepted only if it explains far more.
            if best and _least(explained) > _FAR_BETTER * _least(best):
                break
            if explained:
                best = explained
            if _least(best) <= 10.0 * _QUICK:
                break
        return best

    def _signatures(self) -> tuple[list[Parameter], Array]:
        """Return the parameters that have an effect, and their signatures as unit vectors."""
        # With unit vectors, scalar products are the cosines between signatures.
        candidates, signatures = [], []
        for parameter in parameters(self._scene):
            slope = self._slope([parameter], [0.0], 0).ravel()
            size = float(np.linalg.norm(slope))
            if 0.0 < size < np.inf:
                candidates.append(parameter)
                signatures.append(slope / size)
        return candidates, np.array(signatures)

    def _fit(self, chosen: Sequence[Parameter]) -> Hypothesis[RotorModel] | None:
        """Fit some parameters at once to the defects, by Gauss and Newton's iteration.

        Parameters
        ----------
        chosen : the parameters.

        Returns
        -------
        Hypothesis or None
            The changes with their uncertainties, in words, and the changed model; None if the fit
            is not finite, a change is more than `_MAX_CHANGE`, or one is not significant.
        """
        change = np.zeros(len(chosen))
        for _ in range(1 if self._is_rounding else _ROUNDS):
            residual = self._residual(_changed(self._scene, chosen, change), self._fine)
            weighted = (residual * self._weights).ravel()
            columns = [self._slope(chosen, change, i).ravel() for i in range(len(chosen))]
            slopes = np.stack(columns, axis=1)
            if not (np.isfinite(weighted).all() and np.isfinite(slopes).all()):
                return None
            correction = -np.linalg.lstsq(slopes, weighted, rcond=None)[0]
            change = change + correction
            if np.abs(change).max() > _MAX_CHANGE:
                return None
            if (np.abs(correction) <= 1e-9 + 1e-6 * np.abs(change)).all():
                break
        model = _changed(self._scene, chosen, change)
        weighted = self._residual(model, self._fine) * self._weights
        if not np.isfinite(weighted).all():
            return None
        deviation = self._deviations(weighted, slopes)
        # A change that is not larger than the error of the quick steps is not significant either.
        deviation = np.maximum(deviation, _QUICK * np.abs(change))
        if (np.abs(change) < _SIGNIFICANT * deviation).any():
            return None
        texts = []
        amounts = zip(chosen, change.tolist(), deviation.tolist(), strict=True)
        for parameter, amount, uncertainty in amounts:
            factor, unit = (1.0, parameter.unit) if parameter.unit else (100.0, "%")
            size = f"{factor * amount:+.4g} {unit} (uncertainty {factor * uncertainty:.1g})"
            texts.append(f"{parameter.key} off by {size}")
        return Hypothesis(" and ".join(texts), model, len(chosen))

    def _deviations(self, weighted: Array, slopes: Array) -> Array:
        """Return the standard deviations of fitted changes, (parameters,), shares or rad.

        Parameters
        ----------
        weighted : (k, m) weighted residuals of the fit.
        slopes : (k m, parameters) their derivatives by the changes.
        """
        spread = float(np.sqrt((weighted**2).mean()))
        if self._is_rounding:
            # A rounding error that is repeated over many rows counts once.
            sizes = (slopes**2).reshape(self._values.shape).sum(axis=0)
            spread = max(spread, 0.3) * math.sqrt(float(sizes @ self._repeats / sizes.sum()))
        covariance = np.linalg.pinv(slopes.T @ slopes)
        return np.asarray(spread * np.sqrt(np.diag(covariance)))

    def _slope(self, chosen: Sequence[Parameter], at: Sequence[float] | Array, which: int) -> Array:
        """Return the weighted derivative of the defects by a parameter, per share or rad.

        Parameters
        ----------
        chosen : parameters that are changed.
        at : (parameters,) their changes, at which the derivative is taken.
        which : number of the parameter by which the derivative is taken.

        Returns
        -------
        ndarray
            (k, m), not finite if the changed model has other coordinates.
        """
        residuals = []
        # Central differences: their error is of second order in the step.
        for step in (_DIFFERENCE, -_DIFFERENCE):
            change = np.array(at, float)
            change[which] += step
            residuals.append(self._residual(_changed(self._scene, chosen, change)))
        with np.errstate(invalid="ignore"):
            difference = (residuals[0] - residuals[1]) * self._weights
            return np.asarray(difference / (2.0 * _DIFFERENCE))


def _tried_intervals(judged: JudgedDefects) -> NDArray[np.int64]:
    """Choose intervals: some evenly over the run, and those of the largest defects.

    Intervals with a kink of a load inside are left out: there the quick steps are wrong.

    Parameters
    ----------
    judged : the defects of the data.

    Returns
    -------
    ndarray
        (k,) numbers of intervals, increasing.
    """
    is_tried = judged.is_judged & ~_has_kink(judged)
    rows = np.flatnonzero(is_tried)
    if not len(rows):
        return rows
    half = _MAX_INTERVALS // 2
    places = np.linspace(0, len(rows) - 1, min(half, len(rows))).astype(int)
    largest = rows[np.argsort(-judged.excess[rows])[:half]]
    return np.union1d(rows[places], largest)


def _has_kink(judged: JudgedDefects) -> NDArray[np.bool_]:
    """Return whether each interval has a kink of a load inside, where quick steps fail."""
    time = judged.defects.time
    has_kink = np.zeros(len(time) - 1, dtype=bool)
    for kink in judged.scene.kink_times:
        # A kink at an end of an interval is not inside: the loads in the interval are then smooth.
        is_after_begin = time[:-1] < kink * (1.0 - 1e-9)
        is_before_end = kink * (1.0 + 1e-9) < time[1:]
        has_kink |= is_after_begin & is_before_end
    return has_kink


def _tried_windows(judged: JudgedDefects, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Choose windows of rows without a kink of a load, which begin at given intervals.

    Parameters
    ----------
    judged : the defects of the data.
    rows : (k,) numbers of the intervals.

    Returns
    -------
    ndarray
        At most `_MAX_WINDOWS` of `rows`, each with FIT_ROWS - 1 judged intervals from it on.
    """
    is_smooth = ~_has_kink(judged) & judged.is_judged
    count = len(is_smooth) - (FIT_ROWS - 2)
    windows = []
    for row in rows[rows < count].tolist():
        if is_smooth[row : row + FIT_ROWS - 1].all():
            windows.append(row)
    return np.array(windows[:: 1 + len(windows) // _MAX_WINDOWS], dtype=np.int64)


def _window_residuals(
    judged: JudgedDefects, windows: NDArray[np.int64]
) -> tuple[Array, Array, Array]:
    """Compute the residuals of the angles in each window after a fit of the scene's motion.

    It is for data whose rates are fitted to their angles. The fitted rates are those with which the
    closed form fits best, so that defects of single intervals show only a part of a mistake.

    Parameters
    ----------
    judged : the defects of the data.
    windows : (k,) first rows of the windows, of FIT_ROWS rows each.

    Returns
    -------
    residuals, floors, from_intervals : ndarray
        (k, FIT_ROWS half) rad, and what rounding makes of them; the change of the residuals by a
        change of the intervals' ends, (k, FIT_ROWS half, (FIT_ROWS - 1) m).
    """
    defects = judged.defects
    count = len(defects.start)
    half = count // 2
    vectors, transitions = judged.values * judged.units, defects.transitions
    scale = np.concatenate([np.ones(half), judged.units[half:]])
    # A deviation from the data's own states, carried on row by row, is design @ (deviation in the
    # first row) + offset; by_ends is the derivative of the offset by the ends of all intervals.
    design = [np.broadcast_to(np.eye(count), (len(windows), count, count))]
    offsets = [np.zeros((len(windows), count))]
    by_ends = [np.zeros((len(windows), count, (FIT_ROWS - 1) * count))]
    for row in range(FIT_ROWS - 1):
        matrix = transitions[windows + row]
        design.append(matrix @ design[-1])
        offsets.append(np.einsum("kij,kj->ki", matrix, offsets[-1]) + vectors[windows + row])
        derivative = matrix @ by_ends[-1]
        derivative[:, :, row * count : (row + 1) * count] += np.eye(count)
        by_ends.append(derivative)
    angles = np.concatenate([matrix[:, :half] * scale for matrix in design], axis=1)
    # The projection removes from the angles what any deviation in the first row may explain.
    projection = np.eye(FIT_ROWS * half) - angles @ np.linalg.pinv(angles)
    offset = np.concatenate([offset[:, :half] for offset in offsets], axis=1)
    residuals = np.einsum("kij,kj->ki", projection, offset)
    rounding = np.hstack([defects.rounding[windows + row][:, :half] for row in range(FIT_ROWS)])
    floors = np.einsum("kij,kj->ki", np.abs(projection), rounding + 2.0**-52 * np.abs(offset))
    from_intervals = projection @ np.concatenate([ends[:, :half] for ends in by_ends], axis=1)
    return residuals, floors + _SMALLEST_FLOOR, from_intervals


def _changed(scene: Scene, chosen: Sequence[Parameter], change: Array) -> RotorModel:
    """Return the model of a scene whose parameters are changed by some amounts."""
    model = RotorModel(scene)
    for parameter, amount in zip(chosen, change.tolist(), strict=True):
        model = parameter.apply(model, amount)
    return model


def _least(explained: Sequence[Explanation[RotorModel]]) -> float:
    """Return the least that an explanation leaves, infinity where there is none."""
    return min((explanation.left for explanation in explained), default=math.inf)
