"""Compare a trajectory of another program with the reference, and its loads with the closed form.

The reference is computed at the times of the trajectory.
"""

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
    SAME_START,
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

# Times are rounded. A row is compared even if its time exceeds the scene's duration, by up to this
# share of the duration.
_TIME_ROUNDING = 1e-9
_MIN_ROWS = 3  # fewer rows are too few to be compared
_STAGES = 4  # number of stages: reference, interval defects, search for causes, loads
# If the data agree, a mistake counts as a cause only if its correction leaves at most this share of
# the largest error per unit of error growth.
_LEFT_OF_SMALL_ERRORS = 0.02
# Largest number of references that are kept for further data of the same scene and times, and
# largest number of rows of each. With three blades, all kept references together take up to some
# 12 MB.
_MAX_KEPT, _MAX_KEPT_ROWS = 4, 20_000
# Data may begin late, and end early, by at most this many times the largest interval between their
# rows.
_MAX_GAP = 1.5


@dataclass(frozen=True)
class ReferencedRows:
    """Hold the rows of data, and the reference in the same rows.

    Attributes
    ----------
    data : rows within the scene's duration. Whole turns are added to wrapped channels, so that
        these begin in the same turn as the reference.
    compared : the rows of `data` that the reference reaches. In the shapes below, `rows` is their
        number.
    exact : reference at the times of the data and at the scene's samples.
    places : (rows,) indices in `exact` of the times of `compared`.
    reference : reference at the times of `compared`.
    expected : (rows, channels) numbers of the reference for the channels of `compared`.
    until : number of rows up to the horizon of the scene.
    horizon_s : horizon of the scene, s.
    defects : interval defects of the data, None if they are unknown.
    note : how the defects were found or why they are unknown, in words; may be "".
    rounding : (rows, channels) half a unit in the last digit of each number, plus `of_times`.
    of_times : (rows, channels) change of each number if its time changes by half a unit in the
        last digit.
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
    """Hold the errors and defects of data, by all measures that are judged.

    Attributes
    ----------
    channels : largest error and defect of each channel.
    defect_times : s, end of the interval with the largest defect of each channel; None if its
        defects are unknown.
    error : (rows, channels) magnitudes of the errors against the reference, rad and rad/s.
    per_growth : (rows, channels) `error` divided by `carried_errors`, the size to which a relative
        error of 1 at the start may have grown.
    excess_per_growth : (channels,) the part of `error` beyond rounding, divided by
        `carried_errors`; the largest value up to the horizon.
    predicted, defect_time : see `DataVerdict`.
    drift : rad, the largest sum of defects over 10 or 100 rows (`STRETCHES`), beyond rounding.
    drifting : channel and number of rows of `drift`, in words.
    beyond_digits : the largest ratio of a defect, or of a sum of defects as in `drift`, to its
        floor, the estimated effect of rounding.
    missing : labels of the coordinates whose angles the data lack.
    """

    channels: tuple[ChannelErrors, ...]
    defect_times: tuple[float | None, ...]
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
@np.errstate(all="ignore")  # the data may have numbers so large that arithmetic overflows
def compare_with_reference(
    data: ForeignData,
    scene: Scene,
    tolerance: float = DEFAULT_TOLERANCE,
    time_limit_s: float = float("inf"),
    on_stage: Callable[[str, int, int], None] = lambda *_: None,
) -> tuple[DataVerdict, Record]:
    """Compare a trajectory with the reference of a scene.

    The error of the first row, the defects of all intervals and the errors up to the horizon are
    judged. The part of each that the rounding of the data explains is left out. Then likely causes
    of the differences are searched for. The search includes data that agree, because their small
    defects may be systematic.

    Parameters
    ----------
    data : angles, rates and loads of another program; some channels may be missing.
    scene : the scene with which the data are compared.
    tolerance : rad, the largest allowed defect of an interval beyond rounding. The same number
        bounds the other measures: the error of the first row, sums of defects, errors per unit of
        error growth, and relative errors of loads.
    time_limit_s : s, time limit for the reference, the defects and the search for causes.
    on_stage : called as on_stage(name, done, stages) when a stage begins; `done` is the number of
        stages before it.

    Returns
    -------
    DataVerdict, Record
        The verdict, and a record for a file: the data, the right values and the errors.

    Raises
    ------
    InputError
        If the data have no row in the scene's duration, or the reference and the defects take
        longer than the time limit.
    """
    is_available()  # imports heyoka here, as the time limit below could interrupt the import
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
    # The scene's samples are added to the times of the data, so that error growth and horizon do
    # not depend on the rows of the data.
    samples = np.linspace(0.0, scene.duration, scene.samples)
    times = np.union1d(np.append(inside.time, end), samples)
    sampled_scene = replace(scene, duration=end, samples=len(times), outputs=("angles", "rates"))
    return inside, _reference_at(sampled_scene, times)


_kept: dict[tuple[object, ...], TimedReference] = {}  # ordered by last use, the latest at the end


def _reference_at(scene: Scene, times: Array) -> TimedReference:
    """Return the reference of a scene at given times, kept from an earlier call or computed.

    Parameters
    ----------
    scene, times : see `reference_at`.

    Raises
    ------
    OutOfTimeError
        If the time limit ended the reference early. This reference is not kept.
    """
    # The key includes how the reference is computed: by which function, with or without heyoka.
    key = (reference_at, is_available(), scene, times.tobytes())
    exact = _kept.pop(key, None)
    if exact is None:
        exact = reference_at(scene, times)
        raise_if_over()
        run = exact.trajectory
        for array in (run.time, run.angles, run.rates, exact.growth, exact.units):
            array.flags.writeable = False  # later calls return the same array
    if len(times) <= _MAX_KEPT_ROWS:
        _kept[key] = exact
        for old in list(_kept)[:-_MAX_KEPT]:
            _kept.pop(old, None)  # another thread may have removed it
    return exact


def _rows_with_reference(
    data: ForeignData, scene: Scene, inside: ForeignData, exact: TimedReference
) -> ReferencedRows:
    """Return the rows of data with the reference in the same rows, and compute their defects.

    Parameters
    ----------
    data : angles and rates, all rows.
    scene : the rotor and its duration.
    inside : the rows of `data` up to the scene's end.
    exact : the reference at the times of `inside` and at the scene's samples.

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
    # Whole turns are missing from a wrapped channel. They are added, so that its first row is in
    # the same turn as the reference.
    turn = 2.0 * np.pi
    missing = turn * np.round((expected[0] - inside.values[0]) / turn)
    values = np.where(inside.wrapped, inside.values + missing, inside.values)
    inside = replace(inside, values=values)
    compared = inside.rows(slice(len(places)))
    defects, note = defects_of_data(scene, compared, reference, until)
    # The time of a row has a rounding error of up to half a unit in its last digit. Multiplied by
    # the rates of change, this error is an uncertainty of the row's numbers.
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
    """Compute the errors of data against the reference, and measures of their defects.

    Parameters
    ----------
    data : angles and rates; only the list of their channels is used here.
    scene : the rotor, with the labels of its coordinates.
    tolerance : rad, the largest allowed defect of an interval.
    rows : the data with their reference.
    """
    error = np.abs(rows.compared.values - rows.expected)
    predicted = defect_time = None
    if rows.defects is not None:
        defect_time = float(rows.defects.time[1 + _largest_interval(rows.defects)])
        predicted = float(np.abs(rows.defects.predicted[: rows.until]).max())
    sums = _largest_sums(scene, rows.defects)
    beyond_digits = _beyond_digits(scene, tolerance, rows.defects)
    # Errors divided by the error growth reveal faults that the defects do not reveal. In each
    # interval such a fault is below the tolerance, but over many intervals it adds up. An error
    # that has only grown from a small error of the initial state remains small after the division.
    exact = rows.exact
    carried = carried_errors(exact.trajectory, exact.growth, exact.units)
    carried = carried[rows.places][:, data.columns]
    excess = np.maximum(error - FLOOR_SAFETY * rows.rounding, 0.0)
    missing = [label for i, label in enumerate(scene.coordinate_labels) if i not in data.columns]
    channels, defect_times = _channel_errors(scene, rows, error)
    return TrajectoryErrors(
        channels=channels,
        defect_times=defect_times,
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


def _channel_errors(
    scene: Scene, rows: ReferencedRows, error: Array
) -> tuple[tuple[ChannelErrors, ...], tuple[float | None, ...]]:
    """Return the largest error and defect of each channel, and the time of each largest defect.

    The time is the end of the interval in s; None if the defects of the channel are unknown.

    Parameters
    ----------
    scene : the rotor, whose coordinates the channels belong to.
    rows : the data with their reference.
    error : (rows, channels) absolute errors, rad and rad/s.
    """
    channels, times = [], []
    for j, channel in enumerate(rows.compared.channels):
        defect = floor = time = None
        known = defects_of_channel(scene, rows.defects, channel)
        if known is not None and rows.defects is not None and rows.defects.is_resolved.any():
            sizes, floors = known
            # Defects of data are judged like those of a run: the allowed defect grows with the
            # length of an interval and with the error growth over the interval.
            beyond_rounding = np.maximum(sizes - FLOOR_SAFETY * floors, 0.0)
            excess = rows.defects.in_bound_units(beyond_rounding)
            resolved = np.where(rows.defects.is_resolved, excess, 0.0)
            largest = int(resolved.argmax())
            defect, time = float(resolved[largest]), float(rows.defects.time[1 + largest])
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
        times.append(time)
    return tuple(channels), tuple(times)


def _largest_interval(defects: Defects) -> int:
    """Return the index of the interval whose defect is largest relative to the allowed defect."""
    excess = defects.in_bound_units(defects.channel_excess).max(axis=1)
    return int(np.where(defects.is_resolved, excess, 0.0).argmax())


class LargestSums(NamedTuple):
    """Hold the largest sums of defects over 10 or 100 successive rows (`STRETCHES`).

    Attributes
    ----------
    drift, drifting : see `TrajectoryErrors`.
    beyond_digits : the largest ratio of a sum to its floor, the estimated effect of rounding.
    """

    drift: float = 0.0
    drifting: str = ""
    beyond_digits: float = 0.0


def _largest_sums(scene: Scene, defects: Defects | None) -> LargestSums:
    """Find the largest sums of defects over 10 or 100 successive rows (`STRETCHES`).

    The defects of a drift may be below the tolerance in each interval although their sum is above.

    Parameters
    ----------
    scene : the rotor, with the labels of its coordinates.
    defects : interval defects of the data, None if they are unknown.
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
    """Return the largest ratio of a defect to its floor; 0 if none is known.

    Rounding alone gives a ratio of at most 3 (`FLOOR_SAFETY`). A larger ratio shows a systematic
    error, even if the defect is far below the tolerance.

    Parameters
    ----------
    scene, tolerance : see `compare_with_reference`.
    defects : interval defects of the data, None if they are unknown.
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
    """Yield a finding if the first row deviates too much from the reference.

    Parameters
    ----------
    tolerance : rad and rad/s, the largest allowed deviation beyond rounding.
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
    """Yield a finding for each channel whose defect is too large, and for too large a drift.

    Parameters
    ----------
    tolerance : rad, the largest allowed defect, and sum of defects, beyond rounding.
    errors : errors and defects of the data.
    """
    # The comparisons are written with `not`, so that a NaN counts as too large.
    known = [
        (channel.defect, channel.name, time)
        for channel, time in zip(errors.channels, errors.defect_times, strict=True)
        if channel.defect is not None and time is not None
    ]
    for defect, name, time in sorted(known, key=lambda entry: -entry[0]):
        if not defect <= tolerance:
            size = f"defect of {defect:.1e} rad beyond rounding"
            interval = f"in the interval up to t = {time:.6g} s"
            yield "inaccurate", f"{name}: {size}, {interval}, allowed {tolerance:.0e}"
    if not errors.drift <= tolerance:
        size = f"defect of {errors.drift:.1e} rad beyond rounding"
        yield "inaccurate", f"{errors.drifting}: {size}, allowed {tolerance:.0e}"


def _wrong_errors(
    tolerance: float, rows: ReferencedRows, errors: TrajectoryErrors
) -> Iterator[tuple[str, str]]:
    """Yield findings if errors up to the horizon are too large, per unit of growth or absolutely.

    Parameters
    ----------
    tolerance : rad, the largest allowed error per unit of error growth.
    rows, errors : the data with their reference, and their errors.
    """
    worst = int(errors.excess_per_growth.argmax())
    growing = errors.excess_per_growth[worst]
    if not growing <= tolerance:
        channel = errors.channels[worst]
        size = f"error {channel.error_max:.1e} {channel.unit} up to the horizon"
        allowed = f"{growing:.1e} per unit of error growth, allowed {tolerance:.0e}"
        yield "inaccurate", f"{channel.name}: {size}, {allowed}"
    # `bound`, below, is for angles. It is applied to rates only if the data have no angles.
    angles = [channel for channel in errors.channels if channel.unit == "rad"]
    largest = max(angles or errors.channels, key=lambda channel: channel.error_max)
    # If no defects are known, only the errors can be judged: then the tolerance is their bound.
    has_defects = any(channel.defect is not None for channel in errors.channels)
    bound = OK_ERROR if has_defects else tolerance
    bound += FLOOR_SAFETY * float(rows.rounding[: rows.until].max(initial=0.0))
    if not largest.error_max <= bound:
        size = f"error {largest.error_max:.1e} {largest.unit}"
        yield "inaccurate", f"{largest.name}: {size} up to the horizon, allowed {bound:.0e}"


def _missing_rows(
    data: ForeignData, scene: Scene, rows: ReferencedRows
) -> Iterator[tuple[str, str]]:
    """Yield findings if the rows of the data do not cover the scene's motion.

    Parameters
    ----------
    data : angles and rates, all rows.
    scene : the scene, with its duration.
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
    """Yield findings on rows and coordinates of the data that cannot be checked.

    Parameters
    ----------
    data : angles and rates. A missing angle is a finding unless the mapping file omits it.
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
    scene : the scene; rows after its end are not compared.
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
    """Return a note if the data begin at t = 0 in another state than the scene; else no note."""
    if data.time[0] != 0.0:
        return []
    different = []
    for j, channel in enumerate(data.channels):
        value, start = rows.data.values[0, j], rows.expected[0, j]
        if abs(value - start) > SAME_START:
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
    """Return likely causes of the differences, in words.

    If the data do not agree, mistakes in columns and times are searched for first, then other
    models. If the data agree, mistakes in columns and times are searched for only if a defect is
    larger than the digits of the data explain. Other models are tried if no such mistake is found,
    even if all defects are small: correlated small defects may reveal another model.

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
    turned = rows.data.values[0] - data.values[0]  # whole turns, added to wrapped channels
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
