"""Search for the likely causes of differences, in a fixed order, if data do not agree."""

from __future__ import annotations

import math

import numpy as np

from rotor_mbs.comparison.data import ForeignData
from rotor_mbs.comparison.data_defects import SAME_START, JudgedDefects
from rotor_mbs.comparison.data_mistakes import (
    MIN_ROWS,
    TrajectorySearch,
    clock_mistakes,
    column_mistakes,
    data_mistakes,
)
from rotor_mbs.comparison.defect_search import QUICK_SEARCH, DefectSearch
from rotor_mbs.comparison.faults import faults_in_time

# Data longer than this many times the scene's duration are searched even if all their errors and
# defects are small: their times may be in another unit.
_LONG = 2.0
# Errors are correlated if their correlation is larger than this many times the standard deviation
# that it would have for independent numbers.
_CORRELATED = 3.0


def likely_causes(search: TrajectorySearch, judged: JudgedDefects | None) -> list[str]:
    """Search for causes of the differences in data that do not agree.

    Mistakes in columns and times are tried first; then other models, other parameters and faults at
    some times; then scatter, or a factor of a channel.

    The order changes if the data start in another state than the scene. The reason may be a mistake
    in one column, such as a factor. Other models, parameters and faults are therefore tried last,
    except for the scenes of the catalogue that have the initial state of the data. These scenes are
    tried before scatter.

    Parameters
    ----------
    search : the data and the reference.
    judged : defects of the data, None if they are unknown for some coordinate.

    Returns
    -------
    list of str
        Causes in words; empty if nothing fits, or if the data agree with the reference.
    """
    first = search.up_to_horizon(search.data)
    is_elsewhere = True
    if len(first.time):
        start = search.states_at(first.time[:1])[0, first.columns]
        is_elsewhere = not np.abs(first.values[0] - start).max() <= SAME_START
    has_defects = judged is not None and not judged.is_rounding
    is_long = not search.data.time[-1] <= _LONG * search.scene.duration
    if search.worst <= search.tolerance and not has_defects and not is_long:
        return []
    texts = data_mistakes(search)
    if texts:
        return texts
    if judged is None:
        texts = clock_mistakes(search)
    elif is_elsewhere:
        texts = DefectSearch(judged, QUICK_SEARCH).scenes()
    elif has_defects:
        texts = _other_models_or_faults(search, judged)
    texts = texts or _scatter(search, first) or column_mistakes(search, with_factor=True)
    if not texts and judged is not None and is_elsewhere:
        starts_at_zero = bool(len(first.time)) and first.time[0] == 0.0
        if starts_at_zero and judged.largest <= judged.tolerance:
            return ["another initial state, and the right motion from there"]
        if has_defects:
            return _other_models_or_faults(search, judged)
    return texts


def _other_models_or_faults(search: TrajectorySearch, judged: JudgedDefects) -> list[str]:
    """Search for other models, parameters and a wrong clock; else for faults at some times."""
    texts = DefectSearch(judged, QUICK_SEARCH).explanations() + clock_mistakes(search)
    return texts or faults_in_time(judged)


def _scatter(search: TrajectorySearch, data: ForeignData) -> list[str]:
    """Return a text if the errors are scatter: uncorrelated from row to row, without growth.

    Parameters
    ----------
    search : the reference, and the tolerance above which a channel is wrong.
    data : rows of the data up to the horizon.

    Returns
    -------
    list of str
        The standard deviation in words; empty if the errors are no scatter.
    """
    if len(data.time) < 4 * MIN_ROWS:
        return []
    errors = data.values - search.states_at(data.time)[:, data.columns]
    carried = search.carried(data.time)[:, data.columns]
    is_wrong = np.abs(errors / carried).max(axis=0) > search.tolerance
    centred = errors[:, is_wrong] - errors[:, is_wrong].mean(axis=0)
    sizes = (centred**2).mean(axis=0)
    if not is_wrong.any() or not ((sizes > 0.0) & (sizes < math.inf)).all():
        return []
    # If only every second row is wrong, neighbouring rows are uncorrelated. Therefore the
    # correlation of rows two apart is computed, too.
    products = []
    for lag in (1, 2):
        products.append(np.abs((centred[lag:] * centred[:-lag]).mean(axis=0)))
    correlation = np.max(products, axis=0) / sizes
    # Scatter is as large in the second half of the rows as in the first; an error of the motion
    # grows.
    half = len(data.time) // 2
    early = (centred[:half] ** 2).mean(axis=0)
    late = (centred[half:] ** 2).mean(axis=0)
    is_correlated = (correlation > _CORRELATED / math.sqrt(len(errors))).any()
    if is_correlated or (late > 2.0 * early).any() or (early > 2.0 * late).any():
        return []
    deviation = math.sqrt(float(sizes.max()))
    return [f"scatter from row to row, standard deviation {deviation:.1e}"]
