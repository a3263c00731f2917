"""Search for other scenes, equations and parameters that explain the defects of data.

Each hypothesis is integrated over single intervals from the data's own states, not from the start
of the run. A hypothesis explains the defects if it leaves nearly none, or if all defects that it
leaves are within the tolerance.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.comparison.data_defects import JudgedDefects
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
from rotor_mbs.solution.defects import FLOOR_SAFETY
from rotor_mbs.solution.trajectory import Array

# An explanation may leave the share _LEFT of the largest defect, because the other program and the
# quick steps (`quick_ends`) have errors of their own. It may leave the share _LEFT_OF_SMALL if the
# defects that it leaves are within the tolerance.
_LEFT, _LEFT_OF_SMALL = 1e-3, 0.15
# Largest share of the largest defect that fitted parameters may leave, by their number.
_LEFT_OF_FITTED = {1: 0.02, 2: 2e-3, 3: 2e-3}
# Explanations are equally good if they leave at most _ALIKE times as much as the best one. If all
# defects are within rounding, the factor is _ALIKE_IN_ROUNDING.
_ALIKE = 3.0
_ALIKE_IN_ROUNDING = 1.05
# Relative error of a model's effect, the change of the states at the ends of intervals, if quick
# steps compute it.
_QUICK = 3e-5
# Quick steps are coarse or fine. Fine steps are up to _MOST_FINE times as many as coarse steps, so
# that the error _QUICK also holds if the mass matrix is nearly singular. If a search allows fewer
# than _MAX_STEPS coarse steps in an interval, the interval has at most _FINE_STEPS fine steps.
_MOST_FINE, _FINE_STEPS = 8, 32
# A model is tried by fine steps only if it leaves at most this share of the defects by coarse ones.
_PERHAPS = 0.2
# A multiple of a model's effect explains far more if it leaves less than this share of what the
# model leaves.
_OF_RESCALED = 0.3
# A set of several parameters is fitted only if the linear estimate of the fit leaves less than this
# share of the defects.
_LEFT_OF_SETS = 0.1
_FAR_BETTER = 0.1  # a far better explanation leaves less than this share of what a cheaper one does
_SIGNIFICANT = 8.0  # smallest significant change of a parameter, in standard deviations
# A textbook mistake is certainly the cause if all other hypotheses leave more than this many times
# as much.
_CERTAIN = 10.0
_MAX_CHANGE = 0.6  # largest change of a parameter, share or rad: a larger one is another scene
_MAX_FITTED = 8  # number of sets of each size that are fitted: the best by the linear estimate
_MAX_PARAMETERS = 3  # largest number of parameters in a set
_MAX_INTERVALS = 120  # largest number of intervals on which a hypothesis is tried
_MAX_WINDOWS = 60  # largest number of windows of rows, which are used for fitted rates
_SMALLEST_FLOOR = 1e-18  # rad, added to the rounding of a window so that it is not zero
# Largest number of Runge-Kutta steps in an interval: for a search of any length, for a search of
# some seconds, and for a search in data that agree.
_MAX_STEPS, QUICK_SEARCH, BRIEF_SEARCH = 512, 32, 8
_MAX_FITTED_BRIEF = 4  # the value of _MAX_FITTED for a search in data that agree
_DIFFERENCE = 1e-4  # change of a parameter, share or rad, for the difference quotient
_ROUNDS = 8  # largest number of Gauss-Newton iterations
# Signatures count as independent if the determinant of the matrix of their cosines is larger.
_INDEPENDENT = 1e-6
_MAX_NAMED = 6  # largest number of explanations that a search returns


class DefectSearch:
    """Search for other models that explain the defects of data.

    Parameters
    ----------
    judged : the defects of the data.
    max_steps : largest number of Runge-Kutta steps in an interval. If the motion needs more, every
        search returns an empty list. With at most `BRIEF_SEARCH` steps, sets of several parameters
        are not tried.

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
        excess = np.abs(self._values) - FLOOR_SAFETY * self._floors
        largest = self._largest = float(excess.max(initial=0.0))
        self._allowed = max(_LEFT * largest, min(judged.tolerance, _LEFT_OF_SMALL * largest))
        self._begins, self._ends = defects.time[rows], defects.time[rows + 1]
        self._states = defects.states[rows].T
        # Residuals are divided by the rounding of each number. The rounding has a lower limit, so
        # that no channel dominates all others.
        self._weights = 1.0 / np.maximum(self._floors, 1e-4 * largest)
        self._is_brief = max_steps <= BRIEF_SEARCH
        self._steps, self._fine = None, _MOST_FINE
        if len(rows):
            lengths = self._ends - self._begins
            self._steps = explicit_steps(scene, lengths, defects.states[rows], max_steps)
        if self._steps is not None and max_steps < _MAX_STEPS:
            self._fine = max(min(_MOST_FINE, _FINE_STEPS // self._steps), 1)
        self._ends_of_scene: dict[int, Array] = {}  # by the factor `steps` of `_residual`
        # Mean number of rows in which a coordinate keeps the same value, and with it the same
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

        Parameters are tried only if no other scene or equations explain the defects to within the
        error of the quick steps.

        Returns
        -------
        list of str
            The best explanation, and at most `_MAX_NAMED` - 1 that are as good, in words. Empty if
            no hypothesis explains the defects, or the motion is too stiff for explicit steps.
        """
        if self._steps is None:
            return []
        is_rounding = self._is_rounding
        explained: list[Explanation[RotorModel]] = []
        if not is_rounding:
            for explanation in explanations(self._plausible_models(), self._left_by):
                if not self._has_other_size(explanation):
                    explained.append(explanation)
        # A named mistake is preferred to fitted parameters, unless the parameters explain far more.
        least = _least(explained)
        if least > 10.0 * _QUICK:
            by_parameters = self._parameter_sets()
            if _least(by_parameters) < _FAR_BETTER * least:
                explained = by_parameters
        # If the defects are within rounding, every hypothesis leaves about as much. Only those that
        # are nearly as good as the best one are then named.
        factor = _ALIKE_IN_ROUNDING if is_rounding else _ALIKE
        alike = closest(explained, factor, _QUICK)
        return [explanation.text for explanation in alike[:_MAX_NAMED]]

    def textbook_causes(self) -> list[str]:
        """Find the textbook mistakes that explain the defects; if there are none, fit parameters.

        Returns
        -------
        list of str
            The best explanation, and all that leave at most ten times as much, in words. A single
            explanation is certainly the cause. The list is empty if the best explanation leaves
            more than a thousandth of the defects' weighted root mean square.
        """
        if self._steps is None or self._is_rounding:
            return []

        def left(model: RotorModel) -> float:
            return self._share(self._residual(model, self._fine))

        # An explanation leaves at most _LEFT. Hypotheses that leave up to _CERTAIN times as much
        # are kept, too: one such hypothesis makes the explanation uncertain.
        hypotheses = rotor_hypotheses(self._scene)
        explained = list(explanations(hypotheses, left, _CERTAIN * _LEFT))
        if not _least(explained) <= _LEFT:
            explained = self._parameter_sets()
        if not _least(explained) <= _LEFT:
            return []
        # The right model leaves the error of the quick steps. If two models leave less than this
        # error, it is not known which of them is better.
        alike = closest(explained, _CERTAIN, 0.1 * _QUICK)
        return [explanation.text for explanation in alike]

    def scenes(self) -> list[str]:
        """Search for scenes of the catalogue that have the data's start and explain the defects."""
        if self._steps is None:
            return []

        def left(model: RotorModel) -> float:
            return self._largest_left(self._residual(model, self._fine))

        allowed = max(self._judged.tolerance, self._allowed)
        hypotheses = scenes_with_start(self._scene, self._first_row())
        return [explanation.text for explanation in explanations(hypotheses, left, allowed)]

    def _plausible_models(self) -> Iterator[Hypothesis[RotorModel]]:
        """Yield the models that leave a share of at most `_PERHAPS`, computed by coarse steps."""
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
        """Return the first state of the data: angles, then rates, (2 (1 + blades),).

        A coordinate without inertia keeps the scene's initial state.
        """
        scene = self._scene
        first = np.array([*scene.initial_angles, *scene.initial_rates])
        count = len(scene.initial_angles)
        columns = [*self._moving, *(count + i for i in self._moving)]
        first[columns] = self._judged.defects.states[0]
        return first

    # Residuals

    def _residual(self, model: RotorModel, steps: int = 1) -> Array:
        """Return the defects of the data that are left if a model takes the place of the scene.

        Parameters
        ----------
        model : the scene, equations or method that is tried.
        steps : factor by which the number of steps in an interval is multiplied.

        Returns
        -------
        ndarray
            (k, m) rad; for fitted rates the residuals of windows, see `_window_residuals`. Infinite
            if the model has other moving coordinates, or its equations do not hold for its scene.
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
                # `change` below is then the error of the model's method. It includes the error of
                # the closed form's steps, which does not cancel because the steps are different.
                ends = quick_ends(model.scene, *intervals, model.steps, step=model.method)
        except RotorError:
            return np.full_like(self._values, np.inf)
        # A model without its own method is integrated by the same steps as the scene: the errors
        # of the steps cancel in the difference.
        if steps not in self._ends_of_scene:
            self._ends_of_scene[steps] = quick_ends(self._scene, *intervals, steps * self._steps)
        change = (ends - self._ends_of_scene[steps]).T
        if self._from_intervals is None:
            return np.asarray(self._values + change / self._judged.units)
        of_windows = change.reshape(len(self._values), -1)
        return np.asarray(self._values + np.einsum("kij,kj->ki", self._from_intervals, of_windows))

    def _largest_left(self, residual: Array) -> float:
        """Return the largest defect beyond rounding in a residual of shape (k, m), rad."""
        return float((np.abs(residual) - FLOOR_SAFETY * self._floors).max())

    def _share(self, residual: Array) -> float:
        """Return the weighted root mean square of a residual, as a share of that of the defects."""
        before = float(np.linalg.norm(self._values * self._weights))
        return float(np.linalg.norm(residual * self._weights)) / (before or 1.0)

    def _left_by(self, model: RotorModel) -> float:
        """Return the share of the defects that a model leaves; infinite if it leaves too much."""
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
        """Return whether a multiple of a model's effect explains the defects far better.

        If so, the data have a mistake of the model's kind but of another size, such as a hub whose
        inertia is too small in place of a hub without inertia. If the model is right and the rest
        is the other program's own error, no multiple is far better.
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

        The signature of a parameter is the derivative of the defects with respect to the parameter,
        as a unit vector. A linear estimate, by least squares over the signatures of a set, says how
        much of the defects the set may explain. The best sets by this estimate are fitted.

        Returns
        -------
        list of Explanation
            Sets with the smallest number of parameters that explains the defects, or with a larger
            number if it explains them far better. Empty if no set explains them.
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
            # Parameters with the same signature cannot be distinguished. A mass and gravity, for
            # example, may have the same signature.
            is_independent = np.linalg.det(matrices) > _INDEPENDENT
            sets, matrices = sets[is_independent], matrices[is_independent]
            sides = projections[sets]
            amounts = np.linalg.solve(matrices, sides[..., None])[..., 0]
            # Each set explains the part `squares` of `total`.
            squares = (sides * amounts).sum(axis=1)
            # Signatures hold for small changes only. A single parameter may be so far off that its
            # signature changes. It is therefore fitted even if its signature at the scene's value
            # explains little.
            if count > 1:
                is_enough = squares > (1.0 - _LEFT_OF_SETS**2) * total
                sets, squares = sets[is_enough], squares[is_enough]
            fitted = []
            for places in sets[np.argsort(-squares)[:max_fitted]]:
                hypothesis = self._fit([candidates[i] for i in places])
                if hypothesis is not None:
                    fitted.append(hypothesis)
            # Fitted parameters explain a part of any defects, and several parameters a large part.
            # The limit on what they leave is therefore smaller than that of a textbook mistake,
            # whose size is not fitted.
            allowed = min(self._allowed, _LEFT_OF_FITTED[count] * self._largest)
            left = functools.partial(self._left_at_most, allowed=allowed)
            explained = list(explanations(fitted, left))
            # Sets with one more parameter are accepted only if they explain far more.
            if best and _least(explained) > _FAR_BETTER * _least(best):
                break
            if explained:
                best = explained
            if _least(best) <= 10.0 * _QUICK:
                break
        return best

    def _signatures(self) -> tuple[list[Parameter], Array]:
        """Return the parameters that have an effect, and their signatures as unit vectors."""
        # Signatures have unit length, so that their scalar products are the cosines between them.
        candidates, signatures = [], []
        for parameter in parameters(self._scene):
            slope = self._slope([parameter], [0.0], 0).ravel()
            size = float(np.linalg.norm(slope))
            if 0.0 < size < np.inf:
                candidates.append(parameter)
                signatures.append(slope / size)
        return candidates, np.array(signatures)

    def _fit(self, chosen: Sequence[Parameter]) -> Hypothesis[RotorModel] | None:
        """Fit a set of parameters to the defects by Gauss-Newton iteration.

        Parameters
        ----------
        chosen : the parameters of the set.

        Returns
        -------
        Hypothesis or None
            The changes with their uncertainties, in words, and the changed model; None if the fit
            is not finite, a change is more than `_MAX_CHANGE`, or a change is not significant.
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
        # The uncertainty of a change is at least the relative error of the quick steps.
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
        slopes : (k m, parameters) derivatives of these residuals with respect to the changes.
        """
        spread = float(np.sqrt((weighted**2).mean()))
        if self._is_rounding:
            # A rounding error that repeats over many rows is one error, not many independent ones.
            sizes = (slopes**2).reshape(self._values.shape).sum(axis=0)
            spread = max(spread, 0.3) * math.sqrt(float(sizes @ self._repeats / sizes.sum()))
        covariance = np.linalg.pinv(slopes.T @ slopes)
        return np.asarray(spread * np.sqrt(np.diag(covariance)))

    def _slope(self, chosen: Sequence[Parameter], at: Sequence[float] | Array, which: int) -> Array:
        """Return the weighted derivative of the defects with respect to a parameter.

        Parameters
        ----------
        chosen : parameters that are changed.
        at : (parameters,) changes of `chosen` at which the derivative is taken, shares or rad.
        which : place in `chosen` of the parameter of the derivative.

        Returns
        -------
        ndarray
            (k, m), per unit of the parameter's change; not finite if the changed model has other
            moving coordinates.
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
    """Choose the intervals on which hypotheses are tried.

    One half is spread evenly over the run, the other half has the largest defects. Intervals with a
    kink of a load inside are left out, because quick steps are inaccurate there.

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
    """Return for each interval, (n - 1,), whether a load has a kink inside it."""
    time = judged.defects.time
    has_kink = np.zeros(len(time) - 1, dtype=bool)
    for kink in judged.scene.kink_times:
        # A kink at an end of an interval is not inside: the loads in the interval are then smooth.
        is_after_begin = time[:-1] < kink * (1.0 - 1e-9)
        is_before_end = kink * (1.0 + 1e-9) < time[1:]
        has_kink |= is_after_begin & is_before_end
    return has_kink


def _tried_windows(judged: JudgedDefects, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Choose windows of FIT_ROWS rows, without a kink of a load, that begin at given intervals.

    Parameters
    ----------
    judged : the defects of the data.
    rows : (k,) numbers of the intervals.

    Returns
    -------
    ndarray
        First intervals of at most `_MAX_WINDOWS` windows, taken from `rows`. All FIT_ROWS - 1
        intervals of a window are judged.
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

    The residuals take the place of defects in data whose rates are fitted to the angles. The fit
    chooses rates with which the closed form of the scene is nearest to the angles. The defects of
    single intervals then show only a part of a mistake.

    Parameters
    ----------
    judged : the defects of the data.
    windows : (k,) first rows of the windows, of FIT_ROWS rows each.

    Returns
    -------
    residuals, floors, from_intervals : ndarray
        (k, FIT_ROWS half) rad, with half = m / 2 angles in a row; the effect of rounding on the
        residuals, in the same shape; and the derivative of the residuals with respect to the states
        at the ends of the window's intervals, (k, FIT_ROWS half, (FIT_ROWS - 1) m).
    """
    defects = judged.defects
    count = len(defects.start)
    half = count // 2
    vectors, transitions = judged.values * judged.units, defects.transitions
    scale = np.concatenate([np.ones(half), judged.units[half:]])
    # The deviation of the scene's motion from the data, carried from row to row, is design @
    # (deviation in the first row) + offset. by_ends is the derivative of the offset with respect to
    # the states at the ends of the intervals.
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
    # The projection removes the part of the angles that a deviation in the first row explains.
    projection = np.eye(FIT_ROWS * half) - angles @ np.linalg.pinv(angles)
    offset = np.concatenate([offset[:, :half] for offset in offsets], axis=1)
    residuals = np.einsum("kij,kj->ki", projection, offset)
    rounding = np.hstack([defects.rounding[windows + row][:, :half] for row in range(FIT_ROWS)])
    floors = np.einsum("kij,kj->ki", np.abs(projection), rounding + 2.0**-52 * np.abs(offset))
    from_intervals = projection @ np.concatenate([ends[:, :half] for ends in by_ends], axis=1)
    return residuals, floors + _SMALLEST_FLOOR, from_intervals


def _changed(scene: Scene, chosen: Sequence[Parameter], change: Array) -> RotorModel:
    """Return the model of a scene, with each of the chosen parameters changed by an amount."""
    model = RotorModel(scene)
    for parameter, amount in zip(chosen, change.tolist(), strict=True):
        model = parameter.apply(model, amount)
    return model


def _least(explained: Sequence[Explanation[RotorModel]]) -> float:
    """Return the smallest share that an explanation leaves; infinity if there is none."""
    return min((explanation.left for explanation in explained), default=math.inf)
