"""Compare a trajectory of another program, and its loads, with the reference at its times."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from time import monotonic
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.comparison.causes import likely_causes
from rotor_mbs.comparison.channels import channel_key
from rotor_mbs.comparison.columns import shown_names
from rotor_mbs.comparison.data import ForeignData
from rotor_mbs.comparison.data_defects import (
    STRETCHES,
    carried_errors,
    defects_of_data,
    judged_defects,
    states_of,
)
from rotor_mbs.comparison.data_mistakes import TrajectorySearch, data_mistakes
from rotor_mbs.comparison.defect_search import BRIEF_SEARCH, DefectSearch
from rotor_mbs.comparison.loads import compare_loads
from rotor_mbs.comparison.verdict import (
    DEFAULT_TOLERANCE,
    ChannelErrors,
    DataVerdict,
    agrees_until,
    comparison_record,
    defects_of_channel,
)
from rotor_mbs.errors import InputError
from rotor_mbs.methods.time_limit import (
    OutOfTimeError,
    caller_signals,
    raise_if_over,
    time_limit,
)
from rotor_mbs.models.lagrange.defects import rates_of_change
from rotor_mbs.models.lagrange.heyoka_adapter import is_available
from rotor_mbs.models.lagrange.reference import TimedReference, reference_at
from rotor_mbs.runs.read import Record
from rotor_mbs.scenario.keys import counted
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.defects import FLOOR_SAFETY, Defects
from rotor_mbs.solution.metrics import horizon, horizon_samples
from rotor_mbs.solution.status import OK_ERROR
from rotor_mbs.solution.trajectory import Array, Trajectory

_TIME_ROUNDING = 1e-9  # share of the duration by which rounding may make a time exceed it
_MIN_ROWS = 3
_STAGES = 4  # reference, interval defects, search for causes, loads
_SAME_START = 1e-3  # rad, rad/s: starts that differ by more are another start
# A cause explains errors within the tolerance if at most this share of them is left.
_LEFT_OF_SMALL_ERRORS = 0.02
# References that are kept for further data of the same scene and times: some of 20,000 rows take
# 20 MB.
_MAX_KEPT, _MAX_KEPT_ROWS = 4, 20_000
_MAX_GAP = 1.5  # largest number of intervals without rows at the start or end of the motion


@dataclass(frozen=True)
class ReferencedRows:
    """Rows of data with what they should be.

    Attributes
    ----------
    data : rows within the scene's duration; wrapped channels begin in the turn of the reference.
    compared : those of them that the reference reaches.
    exact : reference at the times of the data and at the scene's samples.
    places : (rows,) rows of `exact` at the times of the data.
    reference : reference at the rows.
    expected : (rows, channels) what the channels of `compared` should be.
    until : number of rows up to the horizon of the scene.
    horizon_s : this horizon, s.
    defects : interval defects of the data, None if unknown.
    note : what a user must know of them.
    rounding : (rows, channels) half a unit in the last digit of each number, plus `of_times`.
    of_times : (rows, channels) change of each number by half a unit in the last digit of its time.
    """

    data: ForeignData
    compared: ForeignData
    exact: TimedReference
    places: NDArray[np.int64]
    reference: Trajectory
    expected: Array
    until: int
    horizon_s: float
    defects: Defects | None
    note: str
    rounding: Array
    of_times: Array


@dataclass(frozen=True)
class TrajectoryErrors:
    """Errors of data against the reference, by every measure that is judged.

    Attributes
    ----------
    channels : errors by channel.
    error : (rows, channels) absolute errors, rad and rad/s.
    per_growth : (rows, channels) errors per unit of the growth of an initial error.
    excess_per_growth : (channels,) the largest of these up to the horizon, beyond rounding.
    predicted, defect_time : see `DataVerdict`.
    drift : rad, the largest sum of defects over a longer stretch of rows, beyond rounding.
    drifting : its channel and number of rows, in words.
    beyond_digits : the largest ratio of a defect, or of such a sum, to its own rounding.
    missing : labels of coordinates without a column of angles.
    """

    channels: tuple[ChannelErrors, ...]
    error: Array
    per_growth: Array
    excess_per_growth: Array
    predicted: float | None
    defect_time: float | None
    drift: float
    drifting: str
    beyond_digits: float
    missing: tuple[str, ...]


@caller_signals()
@np.errstate(all="ignore")  # numbers of data may be so large that they overflow
def compare_with_reference(
    data: ForeignData,
    scene: Scene,
    tolerance: float = DEFAULT_TOLERANCE,
    time_limit_s: float = float("inf"),
    on_stage: Callable[[str, int, int], None] = lambda *_: None,
) -> tuple[DataVerdict, Record]:
    """Compare a trajectory with the reference of a scene.

    Three things are judged: the first row, the defects of all rows (each channel's against its own
    rounding), and the errors up to the horizon. Then likely causes are searched for, also in data
    that agree, whose small defects may be systematic.

    Parameters
    ----------
    data : angles and rates, some of which may be missing, and loads.
    scene : the scene that the data are meant to be of.
    tolerance : rad, the largest allowed defect of an interval beyond rounding.
    time_limit_s : s, for the reference, the defects and the search.
    on_stage : called as on_stage(name, done, stages) when a stage begins.

    Returns
    -------
    DataVerdict, Record
        The verdict; and the data with what they were compared with, for a file.

    Raises
    ------
    InputError
        If the data have no row in the scene's duration, or the reference and the defects take
        longer than the time limit.
    """
    is_available()  # loads the engine before the time limit, which could interrupt its import
    ends = monotonic() + time_limit_s
    loads, data = data.only(loads=True), data.only(loads=False)
    missing_part = "no reference"  # for the message at the time limit
    try:
        with time_limit(time_limit_s):
            on_stage("reference", 0, _STAGES)
            inside, exact = _reference_for(data, scene)
            missing_part = "the rows are not assessed"
            on_stage("interval defects", 1, _STAGES)
            rows = _rows_with_reference(data, scene, inside, exact)
            raise_if_over()
    except OutOfTimeError:
        problem = f"{missing_part} after {time_limit_s:g} s; allowed: a longer time limit"
        raise InputError(f"timeout: {problem}") from None

    errors = _errors_of(data, scene, tolerance, rows)
    findings = _findings(data, scene, tolerance, rows, errors)
    status, message = next(findings, ("ok", ""))
    notes = _notes_on_rows(data, scene, rows, errors)
    likely: list[str] = []
    try:
        with time_limit(max(ends - monotonic(), 0.0)):
            on_stage("search for causes", 2, _STAGES)
            likely = _likely_causes(data, scene, tolerance, rows, errors, is_ok=status == "ok")
    except OutOfTimeError:
        notes.append("the search for causes was stopped at the time limit")
    if status != "ok" and not likely:
        notes += _note_on_start(data, rows)
    if status == "ok" and errors.beyond_digits > FLOOR_SAFETY:
        times = f"{errors.beyond_digits:.2g} times what the digits of the data explain"
        cause = "" if likely else ": an integrator's own error, or a cause that was not found"
        notes.append(f"within {tolerance:g} rad per interval, but {times}{cause}")
    elif status == "ok" and likely:
        within = f"defects are within {tolerance:g} rad per interval"
        notes.append(f"{within}, but correlated from interval to interval")

    channels, expected, compared = errors.channels, rows.expected, rows.compared
    if loads.channels:
        on_stage("loads", 3, _STAGES)
        loads = loads.rows(slice(len(rows.places)))
        expected_loads = np.full((len(rows.places), len(loads.channels)), np.nan)
        if rows.defects is None:
            problem = "loads are not compared: the motion is unknown"
            notes.append(problem)
            if status == "ok":
                status, message = "unchecked", problem
        else:
            comparison = compare_loads(scene, loads, rows.defects, tolerance)
            expected_loads[: len(comparison.expected)] = comparison.expected
            channels += comparison.errors
            likely += comparison.likely
            if comparison.message and status in ("ok", "unchecked"):
                status, message = "inaccurate", comparison.message
        expected = np.hstack([expected, expected_loads])
        compared = compared.beside(loads)

    if data.loads_left_out:
        problem = f"loads of the data that are not compared: {shown_names(data.loads_left_out)}"
        notes.append(problem)
        if status == "ok":
            keys = ", ".join(
                f'"{channel_key(name.partition(",")[0])}"' for name in data.loads_left_out
            )
            status, message = "unchecked", f"{problem}; allowed: omit = [{keys}] in a mapping file"

    verdict = DataVerdict(
        scene=scene.name,
        source=data.source,
        status=status,
        message=message,
        tolerance=tolerance,
        channels=channels,
        rows=len(rows.places),
        compared_until=float(rows.reference.time[-1]),
        horizon_s=rows.horizon_s,
        defect_time=errors.defect_time,
        predicted=errors.predicted,
        read=data.read,
        unused=data.unused,
        notes=tuple(notes),
        likely=tuple(likely),
    )
    return verdict, comparison_record(verdict, scene, compared, expected, rows.defects)


def _reference_for(data: ForeignData, scene: Scene) -> tuple[ForeignData, TimedReference]:
    """Compute the reference of a scene at the times of data and at the scene's samples.

    Parameters
    ----------
    data : angles and rates, all rows.
    scene : the rotor, its duration (s) and number of samples.

    Returns
    -------
    ForeignData, TimedReference
        The rows of `data` up to the scene's end, and the reference.
    """
    inside = data.rows(data.time <= scene.duration * (1.0 + _TIME_ROUNDING))
    end = float(np.max(inside.time, initial=scene.duration))
    # The scene's samples are added to the times of the data, so that growth and horizon are the
    # same for all data.
    samples = np.linspace(0.0, scene.duration, scene.samples)
    times = np.union1d(np.append(inside.time, end), samples)
    sampled_scene = replace(scene, duration=end, samples=len(times), outputs=("angles", "rates"))
    return inside, _reference_at(sampled_scene, times)


_kept: dict[tuple[object, ...], TimedReference] = {}  # the latest last


def _reference_at(scene: Scene, times: Array) -> TimedReference:
    """Return the reference of a scene at given times, which earlier data may have had as well.

    Parameters
    ----------
    scene, times : as of `reference_at`.

    Raises
    ------
    OutOfTimeError
        If it ended early, at the time limit: it is not used.
    """
    # How it is computed belongs to the key: with or without the engine.
    key = (reference_at, is_available(), scene, times.tobytes())
    exact = _kept.pop(key, None)
    if exact is None:
        exact = reference_at(scene, times)
        raise_if_over()
        run = exact.trajectory
        for array in (run.time, run.angles, run.rates, exact.growth, exact.units):
            array.flags.writeable = False  # others will read it
    if len(times) <= _MAX_KEPT_ROWS:
        _kept[key] = exact
        for old in list(_kept)[:-_MAX_KEPT]:
            _kept.pop(old, None)  # another thread may have removed it
    return exact


def _rows_with_reference(
    data: ForeignData, scene: Scene, inside: ForeignData, exact: TimedReference
) -> ReferencedRows:
    """Compute the defects of data, and find the reference at their times.

    Parameters
    ----------
    data : angles and rates, all rows.
    scene : the rotor and its duration.
    inside : the rows of `data` up to the scene's end.
    exact : the reference at their times and at the scene's samples.

    Raises
    ------
    InputError
        If the data have no row in the scene's duration.
    """
    run = exact.trajectory
    places: NDArray[np.int64] = np.searchsorted(run.time, inside.time)
    places = places[places < len(run.time)]
    if not len(places):
        raise InputError(
            f"{data.source}: no row within the {scene.duration:g} s of {scene.name}; allowed: "
            f"times in s from its start; `offset = {-data.time[0]:.6g}` of the time in a mapping "
            "file shifts the first row to the start"
        )
    reference = Trajectory(run.time[places], run.angles[places], run.rates[places])
    horizon_s, until = horizon(run), len(places)
    if horizon_samples(run) < len(run.time):
        until = max(int(np.searchsorted(reference.time, horizon_s, side="right")), 1)
    expected = states_of(reference)[:, inside.columns]
    # Wrapped channels get as many turns as the reference has in the first row.
    turn = 2.0 * np.pi
    missing = turn * np.round((expected[0] - inside.values[0]) / turn)
    values = np.where(inside.wrapped, inside.values + missing, inside.values)
    inside = replace(inside, values=values)
    compared = inside.rows(slice(len(places)))
    defects, note = defects_of_data(scene, compared, reference, until)
    # The time of a row is known to half a digit: the rates of change turn this into an
    # uncertainty of the row's numbers.
    changes = np.zeros((len(places), 2 * len(scene.initial_angles)))
    moving = scene.moving_coordinates
    columns = [*moving, *(len(scene.initial_angles) + i for i in moving)]
    changes[:, columns] = rates_of_change(scene, reference.time, states_of(reference)[:, columns])
    of_times = (compared.time_rounding[:, None] * changes)[:, compared.columns]
    return ReferencedRows(
        data=inside,
        compared=compared,
        exact=exact,
        places=places,
        reference=reference,
        expected=expected,
        until=until,
        horizon_s=horizon_s,
        defects=defects,
        note=note,
        rounding=compared.rounding + of_times,
        of_times=of_times,
    )


def _errors_of(
    data: ForeignData, scene: Scene, tolerance: float, rows: ReferencedRows
) -> TrajectoryErrors:
    """Measure the errors and defects of data against their reference.

    Parameters
    ----------
    data : angles and rates; only which channels they have matters here.
    scene : names the coordinates.
    tolerance : rad, of an interval's defect.
    rows : the data with their reference.
    """
    error = np.abs(rows.compared.values - rows.expected)
    predicted = defect_time = None
    if rows.defects is not None:
        defect_time = float(rows.defects.time[1 + _largest_interval(rows.defects)])
        predicted = float(np.abs(rows.defects.predicted[: rows.until]).max())
    sums = _largest_sums(scene, rows.defects)
    beyond_digits = _beyond_digits(scene, tolerance, rows.defects)
    # Errors are divided by the growth of an initial error. Faults that are below the tolerance in
    # each interval may add up to an error above it. Where the growth is small, the quotient is
    # above the tolerance, too.
    exact = rows.exact
    carried = carried_errors(exact.trajectory, exact.growth, exact.units)
    carried = carried[rows.places][:, data.columns]
    excess = np.maximum(error - FLOOR_SAFETY * rows.rounding, 0.0)
    missing = [label for i, label in enumerate(scene.coordinate_labels) if i not in data.columns]
    return TrajectoryErrors(
        channels=_channel_errors(scene, rows, error),
        error=error,
        per_growth=error / carried,
        excess_per_growth=(excess / carried)[: rows.until].max(axis=0),
        predicted=predicted,
        defect_time=defect_time,
        drift=sums.drift,
        drifting=sums.drifting,
        beyond_digits=max(beyond_digits, sums.beyond_digits),
        missing=tuple(missing),
    )


def _channel_errors(scene: Scene, rows: ReferencedRows, error: Array) -> tuple[ChannelErrors, ...]:
    """Return the largest errors and defects of each channel.

    Parameters
    ----------
    scene : says which coordinate a channel is of.
    rows : the data with their reference.
    error : (rows, channels) absolute errors, rad and rad/s.
    """
    channels = []
    for j, channel in enumerate(rows.compared.channels):
        defect = floor = None
        known = defects_of_channel(scene, rows.defects, channel)
        if known is not None and rows.defects is not None and rows.defects.is_resolved.any():
            sizes, floors = known
            # Judged as those of a run: what is allowed grows with the length of an interval and
            # the error growth over it.
            beyond_rounding = np.maximum(sizes - FLOOR_SAFETY * floors, 0.0)
            excess = rows.defects.in_bound_units(beyond_rounding)
            defect = float(excess[rows.defects.is_resolved].max())
            floor = float(floors[rows.defects.is_resolved].max())
        channels.append(
            ChannelErrors(
                name=channel.name,
                unit=channel.unit,
                error_max=float(error[: rows.until, j].max()),
                error_whole=float(error[:, j].max()),
                defect=defect,
                floor=floor,
                agrees_until=agrees_until(rows.reference.time, error[:, j]),
            )
        )
    return tuple(channels)


def _largest_interval(defects: Defects) -> int:
    """Return the number of the interval whose defect is largest relative to what is allowed."""
    excess = defects.in_bound_units(defects.channel_excess).max(axis=1)
    return int(np.where(defects.is_resolved, excess, 0.0).argmax())


class LargestSums(NamedTuple):
    """Sums of defects over longer stretches of rows.

    Attributes
    ----------
    drift, drifting : see `TrajectoryErrors`.
    beyond_digits : the largest sum over its own rounding.
    """

    drift: float = 0.0
    drifting: str = ""
    beyond_digits: float = 0.0


def _largest_sums(scene: Scene, defects: Defects | None) -> LargestSums:
    """Find the largest sums of defects over stretches of rows.

    A drift may be below the tolerance in each interval, and above it in their sum.

    Parameters
    ----------
    scene : names the coordinates.
    defects : interval defects of the data, None where they are not known.
    """
    largest = LargestSums()
    if defects is None:
        return largest
    labels = [scene.coordinate_labels[i] for i in defects.moving]
    names = [*labels, *(f"{label} rate" for label in labels)]
    for stretch in STRETCHES:
        sizes, floors = defects.over_rows(stretch)
        excess = (sizes - FLOOR_SAFETY * floors).max(axis=0, initial=0.0)
        worst = int(excess.argmax())
        drift, drifting = largest.drift, largest.drifting
        if excess[worst] > drift:
            drift, drifting = float(excess[worst]), f"{names[worst]}, over {stretch} rows"
        ratios = sizes / floors
        ratio = float(ratios[np.isfinite(ratios)].max(initial=0.0))
        largest = LargestSums(drift, drifting, max(largest.beyond_digits, ratio))
    return largest


def _beyond_digits(scene: Scene, tolerance: float, defects: Defects | None) -> float:
    """Return the largest ratio of an interval's defect to its rounding; 0 without defects.

    Rounding alone makes a ratio of at most 3: a larger one is systematic, though the defect may be
    far below the tolerance.

    Parameters
    ----------
    scene, tolerance : see `compare_with_reference`.
    defects : interval defects of the data, None where they are not known.
    """
    if defects is None:
        return 0.0
    judged = judged_defects(scene, defects, tolerance)
    ratios = np.abs(judged.values) / judged.floors
    return float(ratios[judged.is_judged].max(initial=0.0))


def _findings(
    data: ForeignData,
    scene: Scene,
    tolerance: float,
    rows: ReferencedRows,
    errors: TrajectoryErrors,
) -> Iterator[tuple[str, str]]:
    """Yield status and message of each finding, the most serious first.

    Parameters
    ----------
    data, scene, tolerance : see `compare_with_reference`.
    rows, errors : the data with their reference, and their errors.
    """
    yield from _wrong_first_row(tolerance, rows, errors)
    yield from _wrong_defects(tolerance, errors)
    yield from _wrong_errors(tolerance, rows, errors)
    yield from _missing_rows(data, scene, rows)
    yield from _unchecked_parts(data, rows, errors)


def _wrong_first_row(
    tolerance: float, rows: ReferencedRows, errors: TrajectoryErrors
) -> Iterator[tuple[str, str]]:
    """Yield the largest deviation of the first row from the reference, if it is too large.

    Parameters
    ----------
    tolerance : rad and rad/s, beyond rounding.
    rows, errors : the data with their reference, and their errors.
    """
    compared = rows.compared
    off = errors.error[0] - tolerance - FLOOR_SAFETY * rows.rounding[0]
    worst = int(off.argmax())
    if off[worst] > 0.0:
        channel, value = errors.channels[worst], compared.values[0, worst]
        right = f"the scene has {rows.expected[0, worst]:.9g}"
        first = f"{channel.name} is {value:.9g} {channel.unit}, {right}"
        yield "inaccurate", f"first row, t = {compared.time[0]:.6g} s: {first}"


def _wrong_defects(tolerance: float, errors: TrajectoryErrors) -> Iterator[tuple[str, str]]:
    """Yield the channels whose defects are above the tolerance, and a drift above it.

    Parameters
    ----------
    tolerance : rad, beyond rounding.
    errors : errors and defects of the data.
    """
    # Comparisons are negated, so that NaN is wrong.
    known = [channel for channel in errors.channels if channel.defect is not None]
    for channel in sorted(known, key=lambda channel: -(channel.defect or 0.0)):
        if not (channel.defect or 0.0) <= tolerance:
            size = f"defect of {channel.defect:.1e} rad beyond rounding"
            interval = f"in the interval up to t = {errors.defect_time:.6g} s"
            yield "inaccurate", f"{channel.name}: {size}, {interval}, allowed {tolerance:.0e}"
    if not errors.drift <= tolerance:
        size = f"defect of {errors.drift:.1e} rad beyond rounding"
        yield "inaccurate", f"{errors.drifting}: {size}, allowed {tolerance:.0e}"


def _wrong_errors(
    tolerance: float, rows: ReferencedRows, errors: TrajectoryErrors
) -> Iterator[tuple[str, str]]:
    """Yield the largest error up to the horizon where it is too large.

    Parameters
    ----------
    tolerance : rad per unit of error growth.
    rows, errors : the data with their reference, and their errors.
    """
    worst = int(errors.excess_per_growth.argmax())
    growing = errors.excess_per_growth[worst]
    if not growing <= tolerance:
        channel = errors.channels[worst]
        size = f"error {channel.error_max:.1e} {channel.unit} up to the horizon"
        allowed = f"{growing:.1e} per unit of error growth, allowed {tolerance:.0e}"
        yield "inaccurate", f"{channel.name}: {size}, {allowed}"
    # The bound is for angles; it is applied to rates where the data have no angles.
    angles = [channel for channel in errors.channels if channel.unit == "rad"]
    largest = max(angles or errors.channels, key=lambda channel: channel.error_max)
    # Without defects the errors alone are judged, and by the smaller bound.
    has_defects = any(channel.defect is not None for channel in errors.channels)
    bound = OK_ERROR if has_defects else tolerance
    bound += FLOOR_SAFETY * float(rows.rounding[: rows.until].max(initial=0.0))
    if not largest.error_max <= bound:
        size = f"error {largest.error_max:.1e} {largest.unit}"
        yield "inaccurate", f"{largest.name}: {size} up to the horizon, allowed {bound:.0e}"


def _missing_rows(
    data: ForeignData, scene: Scene, rows: ReferencedRows
) -> Iterator[tuple[str, str]]:
    """Yield which parts of the scene's motion the data have no rows of.

    Parameters
    ----------
    data : angles and rates, all rows.
    scene : the scene, whose duration is to be covered.
    rows : the rows of `data` with their reference.
    """
    time, count = rows.reference.time, len(rows.places)
    last = min(scene.duration, float(rows.exact.trajectory.time[-1]))
    step = float(np.diff(time).max(initial=0.0))
    if count < _MIN_ROWS and len(data.time) > count:
        of_all = f"{count} of {counted(len(data.time), 'row')}"
        inside = f"{of_all} within the {scene.duration:g} s of {scene.name}"
        hint = "is the time in s? `unit` of the time in a mapping file says otherwise"
        yield "inaccurate", f"{inside}; {hint}"
    elif time[-1] < last - _MAX_GAP * step:
        yield "inaccurate", f"the data end at t = {time[-1]:.6g} s of {last:g} s"
    if time[0] > _MAX_GAP * step:
        yield "inaccurate", f"the data begin at t = {time[0]:.6g} s, not at 0"


def _unchecked_parts(
    data: ForeignData, rows: ReferencedRows, errors: TrajectoryErrors
) -> Iterator[tuple[str, str]]:
    """Yield which rows and coordinates of the data cannot be checked.

    Parameters
    ----------
    data : angles and rates, of which the omitted ones may be missing.
    rows, errors : the data with their reference, and their errors.
    """
    defects, until = rows.defects, rows.until
    if until < _MIN_ROWS:
        yield "unchecked", f"{counted(until, 'row')} up to the horizon: too few to be compared"
    if defects is None and rows.note and until < len(rows.places):
        after = f"after the horizon at {rows.horizon_s:.6g} s nothing is checked"
        yield "unchecked", f"{after}; {rows.note}"
    if defects is not None and not defects.is_resolved[until - 1 :].all():
        first = until - 1 + int(np.argmin(defects.is_resolved[until - 1 :]))
        since = f"the first after t = {defects.time[first]:.6g} s"
        digits = "have too few digits"
        if data.time_precision:
            digits = f"have times of too few digits ({data.time_precision.partition(':')[0]})"
        reason = f"the rows are too far apart, or {digits}, to be checked"
        yield "unchecked", f"after the horizon {reason}, {since}"
    missed = [name for name in errors.missing if name not in data.omitted]
    unwanted = [name for name in missed if data.restricted_to and name not in data.restricted_to]
    if unwanted:
        listed = ", ".join(f'"{channel_key(name)}"' for name in unwanted)
        verb = "is" if len(unwanted) == 1 else "are"
        allowed = f"{listed} in `only`, or omit = [{listed}], in a mapping file"
        yield "unchecked", f"{', '.join(unwanted)} {verb} not in `only`; allowed: {allowed}"
    elif missed:
        listed = ", ".join(f'"{channel_key(name)}"' for name in missed)
        allowed = f"omit = [{listed}] in a mapping file"
        yield "unchecked", f"no column for {', '.join(missed)}; allowed: {allowed}"


def _notes_on_rows(
    data: ForeignData, scene: Scene, rows: ReferencedRows, errors: TrajectoryErrors
) -> list[str]:
    """Return notes on the data that are shown with every verdict.

    Parameters
    ----------
    data : angles and rates, all rows.
    scene : the scene, after whose end no rows are compared.
    rows, errors : the data with their reference, and their errors.
    """
    notes = [rows.note] if rows.note else []
    later = len(data.time) - len(rows.data.time)
    if later:
        verb = "is" if later == 1 else "are"
        after = f"after the scene's {scene.duration:g} s"
        notes.append(f"{counted(later, 'row')} {after} {verb} not compared")
    notes += data.notes
    if data.precision:
        notes.append(f"numbers of {data.precision}")
    largest = float(rows.of_times[: rows.until].max(initial=0.0))
    if data.time_precision and largest > float(data.rounding.max(initial=0.0)):
        notes.append(
            f"times of {data.time_precision}: they explain differences of up to {largest:.0e}"
        )
    if errors.missing:
        notes.append(f"missing angles: {', '.join(errors.missing)}")
    return notes


def _note_on_start(data: ForeignData, rows: ReferencedRows) -> list[str]:
    """Return a note for data that start in another state than the scene, at t = 0."""
    if data.time[0] != 0.0:
        return []
    different = []
    for j, channel in enumerate(data.channels):
        value, start = rows.data.values[0, j], rows.expected[0, j]
        if abs(value - start) > _SAME_START:
            different.append(f"{channel.name}: {value:.4g} (scene: {start:.4g})")
    if not different:
        return []
    start_text = f"initial state differs, in rad and rad/s: {', '.join(different)}"
    return [f"{start_text}; another scene, initial state or unit?"]


def _likely_causes(
    data: ForeignData,
    scene: Scene,
    tolerance: float,
    rows: ReferencedRows,
    errors: TrajectoryErrors,
    *,
    is_ok: bool,
) -> list[str]:
    """Search for likely causes of the differences, in words.

    In data that do not agree, mistakes in columns and times are searched for, then other models.
    In data that agree, small mistakes are searched for if a defect is larger than the digits of the
    data explain; then another model, which may be recognized from defects that are small but
    correlated.

    Parameters
    ----------
    data, scene, tolerance : see `compare_with_reference`.
    rows, errors : the data with their reference, and their errors.
    is_ok : whether the data agree.
    """
    judged = None
    if rows.defects is not None and not errors.missing:
        rates = len(scene.initial_angles) + np.array(scene.moving_coordinates)
        has_rates = bool(np.isin(rates, data.columns).any())
        judged = judged_defects(scene, rows.defects, tolerance, has_fitted_rates=not has_rates)
    # All rows are searched, also those after the scene's duration.
    turned = rows.data.values[0] - data.values[0]  # the turns that wrapped channels were given
    whole = replace(data, values=data.values + turned)
    worst = float(errors.per_growth[: rows.until].max())
    if is_ok:
        if judged is None:
            return []
        texts: list[str] = []
        if errors.beyond_digits > FLOOR_SAFETY:
            smaller = min(tolerance, _LEFT_OF_SMALL_ERRORS * float(errors.excess_per_growth.max()))
            search = TrajectorySearch(scene, whole, rows.exact, smaller, worst, True)
            texts = data_mistakes(search)
        return texts or DefectSearch(judged, BRIEF_SEARCH).explanations()
    search = TrajectorySearch(scene, whole, rows.exact, tolerance, worst)
    return likely_causes(search, judged)
