"""Compare another program's frequencies over rotor speed with the closed form's; find causes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from rotor_mbs.analysis.modes import CLOSED_FORM, LinearModes
from rotor_mbs.analysis.whirl import whirl_frequencies
from rotor_mbs.comparison.data import ForeignData
from rotor_mbs.comparison.hypotheses import Hypothesis, cheapest, explanations
from rotor_mbs.comparison.loads import LEFT_SHARE, MAX_LEFT
from rotor_mbs.comparison.verdict import (
    ChannelErrors,
    DataVerdict,
    agrees_until,
    comparison_record,
)
from rotor_mbs.errors import InputError
from rotor_mbs.runs.read import Record
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.defects import FLOOR_SAFETY
from rotor_mbs.solution.trajectory import Array
from rotor_mbs.studies.modes import compute_modes

# The errors of frequencies below this share of the largest frequency are divided by this share of
# it, not by the frequencies themselves.
_SLOW = 1e-3
_MAX_SPEEDS = 1000
# Smallest number of speeds above 0 for a fit of α, see `_without_stiffening`. An exact fit
# at a single speed would mean nothing, because α is free.
_MIN_TURNING = 3
_HZ, _RPM = 2.0 * math.pi, math.pi / 30.0  # one Hz and one rpm in rad/s
_UNITS = {
    1.0: "",
    _HZ: "Hz taken as rad/s",
    1.0 / _HZ: "rad/s taken as Hz",
    _RPM: "rpm taken as rad/s",
    1.0 / _RPM: "rad/s taken as rpm",
}


def compare_modes(data: ForeignData, scene: Scene, tolerance: float) -> tuple[DataVerdict, Record]:
    """Compare columns of frequencies with the modes of a scene.

    The modes are those of steady rotation without gravity, or those at rest under gravity if no
    speed is above 0. At each speed, every column is assigned a different mode. Of all assignments,
    the one with the least sum of the differences is chosen.

    Parameters
    ----------
    data : (speeds, columns) frequencies, rad/s, over speeds, rad/s.
    scene : the rotor.
    tolerance : the largest allowed error of a frequency beyond rounding, relative to its size.

    Returns
    -------
    DataVerdict, Record
        The verdict; a record for a file, with the data and the frequencies of the modes.

    Raises
    ------
    InputError
        If there are more than 1000 speeds or more columns than modes, if damped and undamped
        frequencies are mixed, or if the scene has no modes.
    """
    if len(data.time) > _MAX_SPEEDS:
        problem = f"{len(data.time)} speeds; allowed: up to {_MAX_SPEEDS}"
        raise InputError(f"{data.source}: {problem}")
    if len({channel.name.startswith("undamped") for channel in data.channels}) > 1:
        allowed = 'omit = ["undamped_frequency"], or ["frequency"], in a mapping file'
        problem = "damped and undamped frequencies in one table"
        raise InputError(f"{data.source}: {problem}; allowed: {allowed}")
    modes = _closed_form_modes(scene, data.time)
    if isinstance(modes, str):
        raise InputError(f"{data.source}: nothing to compare with: {modes}")
    right = _families(modes, data)[""]
    if data.values.shape[1] > right.shape[1]:
        problem = f"{data.values.shape[1]} frequencies; allowed: {right.shape[1]}, its modes"
        raise InputError(f"{data.source}: {problem}")

    error, expected = _errors_of_nearest(data.values, data.rounding, right)
    is_known = np.isfinite(expected).all(axis=1)
    channels, message = _channel_errors(data, error, expected, tolerance)
    status = "inaccurate" if message else "ok"
    likely = _likely_causes(scene, data, tolerance, error) if message else []
    if not is_known.all():
        status = "unchecked" if status == "ok" else status
        message = message or next(filter(None, modes.messages), "no modes")
    verdict = DataVerdict(
        scene=scene.name,
        source=data.source,
        status=status,
        message=message,
        tolerance=tolerance,
        channels=channels,
        rows=len(data.time),
        compared_until=float(data.time[-1]),
        read=data.read,
        unused=data.unused,
        notes=(f"numbers of {data.precision}",) if data.precision else (),
        likely=tuple(likely),
        axis="speed",
    )
    return verdict, comparison_record(verdict, scene, data, expected, None)


def _channel_errors(
    data: ForeignData, error: Array, expected: Array, tolerance: float
) -> tuple[tuple[ChannelErrors, ...], str]:
    """Judge each column of frequencies.

    Parameters
    ----------
    data : frequencies over speeds.
    error, expected : (speeds, columns), see `_errors_of_nearest`; NaN at speeds without modes.
    tolerance : the largest allowed error, relative to a frequency's size.

    Returns
    -------
    tuple of ChannelErrors, str
        The errors of each column; a message on the column with the largest error, or "" if all
        columns are within the tolerance.
    """
    is_known = np.isfinite(expected).all(axis=1)
    speeds = data.time[is_known]
    scale = _frequency_scale(expected)
    channels = []
    messages = []
    for j, channel in enumerate(data.channels):
        size = error[is_known, j]
        difference = np.abs(data.values[:, j] - expected[:, j])[is_known]
        floor = (data.rounding[:, j] / scale[:, j])[is_known]
        worst, largest = float(size.max(initial=0.0)), float(difference.max(initial=0.0))
        channels.append(
            ChannelErrors(
                name=channel.name,
                unit=channel.unit,
                error_max=largest,
                error_whole=largest,
                defect=worst,
                floor=float(floor.max(initial=0.0)),
                agrees_until=agrees_until(speeds, size),
                defect_unit="of its size",
            )
        )
        if not worst <= tolerance:
            at = f"at {speeds[int(size.argmax())]:.6g} rad/s, allowed {tolerance:.0e}"
            beyond = f"relative difference of {worst:.1e} beyond rounding"
            messages.append((worst, f"{channel.name}: {beyond}, {at}"))
    return tuple(channels), max(messages)[1] if messages else ""


def _closed_form_modes(scene: Scene, speeds: Array) -> LinearModes | str:
    """Compute the modes of a scene at some speeds by the closed form.

    Parameters
    ----------
    scene : the rotor; its gravity counts only if no speed is above 0.
    speeds : (n,) rad/s.

    Returns
    -------
    LinearModes or str
        The modes; or the reason, in words, why there are none.
    """
    if not speeds.any():
        modes = compute_modes(scene, models=(CLOSED_FORM,))
        return modes.rest.get(CLOSED_FORM, "; ".join(modes.notes))
    modes = compute_modes(replace(scene, gravity=0.0), speeds, models=(CLOSED_FORM,))
    return modes.rotation.get(CLOSED_FORM, "; ".join(modes.notes))


def _families(modes: LinearModes, data: ForeignData) -> dict[str, Array]:
    """Return the families of frequencies that the data may contain: damped, undamped, whirl.

    Parameters
    ----------
    modes : modes of the scene at the speeds of the data.
    data : the table, whose columns are named as damped or undamped frequencies.

    Returns
    -------
    dict of ndarray
        Frequencies, (speeds, frequencies) rad/s, by name of the family. The name of the right
        family is "".
    """
    damped, undamped = modes.damped_frequencies, modes.undamped_frequencies
    speed = np.abs(modes.speeds[:, None])
    if data.channels[0].name.startswith("undamped"):
        right, other, other_name = undamped, damped, "damped frequencies"
    else:
        right, other, other_name = damped, undamped, "undamped frequencies"
    whirl = (
        "frequencies in the fixed frame (whirl), the rotor's speed below or above those in the "
        "rotor's frame"
    )
    in_fixed_frame = right
    # If a rotor has five blades or more, some waves have two nodal diameters or more.
    for diameters in range(1, max(2, (modes.blades + 1) // 2)):
        whirling = whirl_frequencies(right, speed, diameters)
        in_fixed_frame = np.concatenate([in_fixed_frame, *whirling], axis=1)
    return {"": right, other_name: other, whirl: in_fixed_frame}


def _frequency_scale(expected: Array) -> Array:
    """Return the sizes, rad/s, by which errors of the expected frequencies are divided."""
    least = _SLOW * float(np.nanmax(expected, initial=0.0))
    return np.maximum(expected, least or 1.0)


def _errors_of_nearest(values: Array, rounding: Array, known: Array) -> tuple[Array, Array]:
    """Assign a different mode to each column at each speed, with the least sum of differences.

    Parameters
    ----------
    values, rounding : (speeds, columns) rad/s, and half a unit in their last digits.
    known : (speeds, modes) rad/s; NaN at speeds without modes.

    Returns
    -------
    error, expected : ndarray
        (speeds, columns) both: the differences beyond rounding, divided by `_frequency_scale`; the
        frequencies of the assigned modes, rad/s.
    """
    expected = np.full(values.shape, np.nan)
    for i, (row, right) in enumerate(zip(values, known, strict=True)):
        if np.isfinite(right).all():
            _, nearest = linear_sum_assignment(np.abs(row[:, None] - right))
            expected[i] = right[nearest]
    excess = np.abs(values - expected) - FLOOR_SAFETY * rounding
    return np.maximum(excess, 0.0) / _frequency_scale(expected), expected


# Causes of wrong frequencies


@dataclass(frozen=True)
class FrequencyTable:
    """Hold the frequencies of the data under a hypothesis, and those of the modes.

    Attributes
    ----------
    values, rounding : (speeds, columns) rad/s, and half a unit in their last digits.
    known : (speeds, modes) rad/s, frequencies of the modes; None if `left` is computed already.
    left : the largest relative error that the hypothesis leaves.
    """

    values: Array
    rounding: Array
    known: Array | None = None
    left: float = math.inf


def _left(table: FrequencyTable) -> float:
    """Return the largest relative error of a table; 0 if no speed has modes."""
    if table.known is None:
        return table.left
    error, _ = _errors_of_nearest(table.values, table.rounding, table.known)
    return float(np.nanmax(error, initial=0.0))


def _likely_causes(scene: Scene, data: ForeignData, tolerance: float, error: Array) -> list[str]:
    """Search for the fewest mistakes that explain all columns.

    Return a text for each explanation with this number of mistakes.

    Parameters
    ----------
    scene, data, tolerance : see `compare_modes`.
    error : (speeds, columns), see `_errors_of_nearest`.
    """
    largest = float(np.nanmax(error, initial=0.0))
    allowed = min(tolerance, MAX_LEFT, LEFT_SHARE * largest)
    explained = explanations(_hypotheses(scene, data, tolerance), _left, allowed)
    return [explanation.text for explanation in cheapest(explained)]


def _hypotheses(
    scene: Scene, data: ForeignData, tolerance: float
) -> Iterator[Hypothesis[FrequencyTable]]:
    """Yield hypotheses: wrong units of frequencies or speeds, other families, missing stiffening.

    Parameters
    ----------
    scene, data, tolerance : see `compare_modes`.
    """
    # Stiffening is the change of frequencies from rest to a speed. The undamped frequencies are
    # needed at rest and at the speeds of the data.
    from_rest: LinearModes | str = ""
    if np.count_nonzero(data.time) >= _MIN_TURNING:
        from_rest = _closed_form_modes(scene, np.union1d(0.0, data.time))
    units_of_speed = _UNITS if data.time.any() else {1.0: ""}  # a speed of 0 has no unit
    for speed_factor, of_speeds in units_of_speed.items():
        modes = _closed_form_modes(scene, speed_factor * data.time)
        if isinstance(modes, str):
            continue
        for factor, of_frequencies in _UNITS.items():
            values, rounding = data.values * factor, data.rounding * factor
            units = []
            if of_frequencies:
                units.append(f"frequencies in {of_frequencies}")
            if of_speeds:
                units.append(f"speeds in {of_speeds}")
            for family, frequencies in _families(modes, data).items():
                mistakes = [*units, family] if family else units
                if mistakes:
                    table = FrequencyTable(values, rounding, frequencies)
                    yield Hypothesis("; and ".join(mistakes), table, len(mistakes))
            if speed_factor == 1.0 and not isinstance(from_rest, str):
                error, _ = _errors_of_nearest(values, rounding, modes.damped_frequencies)
                wrong = error.max(axis=0) > tolerance
                left, text = _without_stiffening(
                    from_rest, data.time, values[:, wrong], rounding[:, wrong]
                )
                mistakes = [*units, text]
                table = FrequencyTable(values, rounding, left=left)
                yield Hypothesis("; and ".join(mistakes), table, len(mistakes))


def _without_stiffening(
    modes: LinearModes, speeds: Array, values: Array, rounding: Array
) -> tuple[float, str]:
    """Fit f² = f0² - α Ω² to columns of frequencies, with f0 of the scene at rest and α >= 0.

    If a blade turns about its pitch axis by θ, the stiffness of the centrifugal forces is
    Ω² Σ m (u² - v²). Here u and v are the distances of a mass m from the pitch axis, u across the
    shaft and v along it. The term u² comes from displacements of second order in θ, which a model
    of linear displacements does not have. The rest, -Ω² Σ m v², softens. A frequency is fitted only
    if f² of the scene rises with the speed, or falls less than the fitted f².

    Parameters
    ----------
    modes : modes of the scene at rest and at the speeds, in this order.
    speeds : (n,) rad/s, increasing; the last is above 0.
    values, rounding : (n, columns) rad/s, frequencies of the columns that are wrong, and half a
        unit in their last digits.

    Returns
    -------
    float, str
        The largest relative error that the fit leaves; the cause in words.
    """
    squares, squared_speeds = modes.undamped_frequencies**2, speeds**2
    largest, alphas = 0.0, []
    for column, column_rounding in zip(values.T, rounding.T, strict=True):
        fits = []
        for at_rest, at_end in zip(squares[0], squares[-1], strict=True):
            # Least squares with the one unknown α. A negative α would be additional stiffening.
            slope = squared_speeds @ (at_rest - column**2) / (squared_speeds @ squared_speeds)
            alpha = max(float(slope), 0.0)
            if not at_end > at_rest - alpha * squared_speeds[-1]:
                continue
            fitted = np.sqrt(np.maximum(at_rest - alpha * squared_speeds, 0.0))
            excess = np.maximum(np.abs(column - fitted) - FLOOR_SAFETY * column_rounding, 0.0)
            fits.append((float((excess / _frequency_scale(fitted)).max()), alpha))
        left, alpha = min(fits, default=(math.inf, 0.0))
        largest = max(largest, left)
        alphas.append(f"{alpha:.4g}")
    shown = ", ".join(dict.fromkeys(alphas))
    return largest, f"centrifugal stiffening is missing: f² = f0² - α Ω², α = {shown}"
