"""Data of another program against the reference of a scene, evaluated at the times of the data."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from time import monotonic

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.analysis.data_verdict import DEFAULT_TOLERANCE, ChannelErrors, DataVerdict, agrees_until, as_dictionary
from rotor_mbs.analysis.judgement import OK_ERROR
from rotor_mbs.errors import InputError
from rotor_mbs.foreign.channels import ForeignData
from rotor_mbs.methods.time_limit import OutOfTimeError, stop_in_time, time_limit
from rotor_mbs.models.lagrange.heyoka_adapter import is_available
from rotor_mbs.models.lagrange.reference import reference_at
from rotor_mbs.runs.design import Column
from rotor_mbs.runs.read import Record
from rotor_mbs.runs.versions import versions
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.solution.defects import FLOOR_SAFETY, Defects
from rotor_mbs.solution.metrics import horizon, horizon_samples
from rotor_mbs.solution.trajectory import Array, Trajectory
from rotor_mbs.studies.data_causes import CauseSearch, carried_errors, defects_of_data, likely_causes, states_of
from rotor_mbs.studies.data_loads import compare_loads
from rotor_mbs.studies.defect_causes import DefectCauses

_ROUNDING = 1e-9  # of the duration: times that are sums of steps may end so far past it
_FEWEST = 3
_START = 1e-3  # rad, rad/s: starts that differ by more are another start
_FULL_DIGITS = 8  # as many as single precision has
_STRETCHES = (10, 100)  # rows over which defects are added up, too
_MOST_NAMES = 100  # of columns that were not used


@np.errstate(all="ignore")  # data may be of any size
def compare_with_reference(
    data: ForeignData, scene: Scene, tolerance: float = DEFAULT_TOLERANCE, time_limit_s: float = float("inf")
) -> tuple[DataVerdict, Record]:
    """The verdict on data, by their defects over all rows, each channel against its own rounding, by their first row,
    and by their errors up to the horizon; where they differ by more than rounding, what that looks like. And the data
    with what they were compared with, for a file.

    Raises InputError for a tolerance that is not positive, for data without rows in the scene's duration, and where
    reference and defects take longer than `time_limit_s`.
    """
    is_available()  # the engine is loaded before: an interrupt would leave half of it
    ends = monotonic() + time_limit_s
    if not 0.0 < tolerance < float("inf"):
        raise InputError(f"tolerance: {tolerance!r}; allowed: a number more than 0, rad")
    loads, data = data.only(loads=True), data.only(loads=False)
    cut = data.rows(data.time <= scene.duration * (1.0 + _ROUNDING))
    # At the times of the data and at the scene's samples, which make growth and horizon the same for all data.
    end = max(scene.duration, float(cut.time[-1])) if len(cut.time) else scene.duration
    times = np.union1d(np.append(cut.time, end), np.linspace(0.0, scene.duration, scene.samples))
    longer = replace(scene, duration=end, samples=len(times), outputs=("angles", "rates"))
    try:
        with time_limit(time_limit_s):
            exact = reference_at(longer, times)
            run = exact.trajectory
            place: NDArray[np.int64] = np.searchsorted(run.time, cut.time)
            place = place[place < len(run.time)]
            rows, horizon_s, until = len(place), horizon(run), len(place)
            if not rows:
                raise InputError(
                    f"{data.source}: no row within the {scene.duration:g} s of {scene.name}; allowed: times in s from "
                    f"its start; `offset = {-data.time[0]:.6g}` of the time in a mapping file shifts the first row to "
                    "the start"
                )
            at_rows = Trajectory(run.time[place], run.angles[place], run.rates[place])
            if horizon_samples(run) < len(run.time):
                until = max(int(np.searchsorted(at_rows.time, horizon_s, side="right")), 1)
            expected = states_of(at_rows)[:, cut.columns]
            # Wrapped channels with as many turns as the reference has in the first row.
            turns = 2.0 * np.pi * np.round((expected[0] - cut.values[0]) / (2.0 * np.pi))
            cut = replace(cut, values=np.where(cut.wrapped, cut.values + turns, cut.values))
            compared = cut.rows(slice(rows))
            defects, note = defects_of_data(scene, compared, at_rows, until)
            stop_in_time()
    except OutOfTimeError:
        raise InputError(f"timeout: no reference after {time_limit_s:g} s; allowed: a longer time limit") from None

    error = np.abs(compared.values - expected)
    channels: list[ChannelErrors] = []
    for j, channel in enumerate(compared.channels):
        defect = floor = None
        known = of_channel(scene, defects, channel.column)
        if known is not None and defects is not None and defects.is_judged.any():
            sizes, floors = (values[defects.is_judged] for values in known)
            defect, floor = float(np.maximum(sizes - FLOOR_SAFETY * floors, 0.0).max()), float(floors.max())
        largest, of_all = float(error[:until, j].max()), float(error[:, j].max())
        agreed = agrees_until(at_rows.time, error[:, j])
        channels.append(ChannelErrors(channel.name, channel.unit, largest, of_all, defect, floor, agreed))
    predicted = defect_time = None
    drift, drifting = 0.0, ""  # the largest over longer stretches, and where
    if defects is not None:
        judged = defects.is_judged
        excess = np.where(judged[:, None], defects.channel_sizes - FLOOR_SAFETY * defects.floors, 0.0).max(axis=1)
        defect_time = float(defects.time[1 + int(excess.argmax())])
        if defects.predicted is not None:
            predicted = float(np.abs(defects.predicted[:until]).max())
        labels = [scene.coordinate_labels[i] for i in defects.moving]
        for stretch in _STRETCHES:
            sizes, floors = defects.over_rows(stretch)
            excess = (sizes - FLOOR_SAFETY * floors).max(axis=0, initial=0.0)
            worst = int(excess.argmax())
            name = [*labels, *(f"{label} rate" for label in labels)][worst]
            drift, drifting = max((drift, drifting), (float(excess[worst]), f"{name}, over {stretch} rows"))
    # Per unit of error growth: in a motion whose errors do not grow, faults below any interval's tolerance add up.
    carried = carried_errors(run, exact.growth, exact.units)[place][:, data.columns]
    per_growth = (np.maximum(error - FLOOR_SAFETY * compared.rounding, 0.0) / carried)[:until].max(axis=0)
    missing = [label for i, label in enumerate(scene.coordinate_labels) if i not in data.columns]

    def findings() -> Iterator[tuple[str, str]]:
        """Status and message of all that is wrong, the gravest first."""
        off = error[0] - tolerance - FLOOR_SAFETY * compared.rounding[0]
        worst = int(off.argmax())
        if off[worst] > 0.0:
            value, name, unit = compared.values[0, worst], channels[worst].name, channels[worst].unit
            first = f"{name} {value:.9g} {unit}, the scene has {expected[0, worst]:.9g}"
            yield "inaccurate", f"first row, t = {compared.time[0]:.6g} s: {first}"
        known = [channel for channel in channels if channel.defect is not None]
        for channel in sorted(known, key=lambda channel: -(channel.defect or 0.0)):
            if not (channel.defect or 0.0) <= tolerance:
                yield (
                    "inaccurate",
                    (
                        f"{channel.name}: defect of {channel.defect:.1e} rad beyond rounding, in the interval up to "
                        f"t = {defect_time:.6g} s, allowed {tolerance:.0e}"
                    ),
                )
        if not drift <= tolerance:
            yield "inaccurate", f"{drifting}: defect of {drift:.1e} rad beyond rounding, allowed {tolerance:.0e}"
        worst = int(per_growth.argmax())
        if not per_growth[worst] <= tolerance:
            yield (
                "inaccurate",
                (
                    f"{channels[worst].name}: error {channels[worst].error_max:.1e} {channels[worst].unit} up to the "
                    f"horizon, {per_growth[worst]:.1e} per unit of error growth, allowed {tolerance:.0e}"
                ),
            )
        angles = [channel for channel in channels if channel.unit == "rad"] or channels
        largest = max(angles, key=lambda channel: channel.error_max)
        # Without defects the errors are all that there is.
        bound = (OK_ERROR if known else tolerance) + FLOOR_SAFETY * float(compared.rounding.max(initial=0.0))
        if not largest.error_max <= bound:
            size = f"error {largest.error_max:.1e} {largest.unit}"
            yield "inaccurate", f"{largest.name}: {size} up to the horizon, allowed {bound:.0e}"
        # What the rows leave out of the motion.
        time, last = at_rows.time, min(scene.duration, float(run.time[-1]))
        step = float(np.diff(time).max(initial=0.0))
        if time[-1] < last - 1.5 * step:
            yield "inaccurate", f"the data end at t = {time[-1]:.6g} s of {last:g} s"
        if time[0] > 1.5 * step:
            yield "inaccurate", f"the data begin at t = {time[0]:.6g} s, not at 0"
        if until < _FEWEST:
            yield "unchecked", f"{until} rows up to the horizon: too few to be compared"
        if defects is not None and not defects.is_judged[until - 1 :].all():
            long = until - 1 + int(np.argmin(defects.is_judged[until - 1 :]))
            since = f"the first after t = {defects.time[long]:.6g} s"
            yield "unchecked", f"after the horizon the rows are too far apart to be checked, {since}"
        if missed := [name for name in missing if name not in data.omitted]:
            listed = ", ".join(f'"{name.replace(" ", "_")}"' for name in missed)
            yield "unchecked", f"no column for {', '.join(missed)}; allowed: omit = [{listed}] in a mapping file"

    status, message = next(findings(), ("ok", ""))
    notes = [note] if note else []
    if len(data.time) > len(cut.time):
        notes.append(f"{len(data.time) - len(cut.time)} rows after the scene's {scene.duration:g} s are not compared")
    if data.digits < _FULL_DIGITS:
        rounding = 0.5 * 10.0 ** (1 - data.digits)
        notes.append(f"numbers of {data.digits} digits: relative rounding error {rounding:.0e}")
    if missing:
        notes.append(f"missing angles: {', '.join(missing)}")
    likely: list[str] = []
    try:
        with time_limit(max(ends - monotonic(), 0.0)):
            causes = DefectCauses(scene, defects, tolerance) if defects is not None and not missing else None
            if status != "ok":
                whole = replace(data, values=data.values + (cut.values[0] - data.values[0]))  # the turns that `cut` has
                search = CauseSearch(scene, whole, exact, tolerance, float((error / carried)[:until].max()))
                likely = likely_causes(search, causes)
            elif causes is not None:
                likely = causes.explanations()
    except OutOfTimeError:
        notes.append("the search for causes was stopped at the time limit")
    apart = [
        f"{channel.name} {value:.4g} (scene: {start:.4g})"
        for channel, value, start in zip(data.channels, cut.values[0], expected[0], strict=True)
        if abs(value - start) > _START
    ]
    if status != "ok" and not likely and apart and data.time[0] == 0.0:
        start_text = f"initial state differs, in rad and rad/s: {', '.join(apart)}"
        notes.append(f"{start_text}; another scene, initial state or unit?")
    if status == "ok" and likely:
        notes.append(f"within {tolerance:g} rad per interval, but correlated")
    if loads.channels:
        loads = loads.rows(slice(rows))
        own = np.full((rows, len(loads.channels)), np.nan)
        if defects is None:
            notes.append("loads are not compared: the motion is unknown")
            status, message = ("unchecked", notes[-1]) if status == "ok" else (status, message)
        else:
            found = compare_loads(scene, loads, defects, tolerance)
            own[: len(found.expected)] = found.expected
            channels += found.errors
            likely += found.likely
            if found.message and status in ("ok", "unchecked"):
                status, message = "inaccurate", found.message
        expected, compared = np.hstack([expected, own]), compared.beside(loads)
    verdict = DataVerdict(
        scene.name, data.source, status, message, tolerance, tuple(channels), rows, float(at_rows.time[-1]), horizon_s,
        defect_time, predicted, data.read, data.unused, tuple(notes), tuple(likely),
    )  # fmt: skip
    return verdict, comparison_record(verdict, scene, compared, expected, defects)


def comparison_record(
    verdict: DataVerdict, scene: Scene, data: ForeignData, expected: Array, defects: Defects | None
) -> Record:
    """As a record of a results file: of each channel data, reference, error, and defect of an angle or a rate.

    data : the rows that were compared. expected : (n, channels) what they should be. defects : None where unknown.
    """
    axis, what = verdict.axis, "modes" if data.is_modes else "trajectory"
    scale = Column((axis,), "rad/s", "rotor speed") if data.is_modes else Column((axis,), "s", "time")
    columns, arrays = {axis: scale}, {axis: data.time}
    for j, channel in enumerate(data.channels):
        values, right = data.values[:, j], expected[:, j]
        kinds = {
            "": (channel.unit, "", values),
            "_reference": (channel.unit, ", reference", right),
            "_error": (channel.unit, ", data minus reference", values - right),
        }
        if not channel.is_load and not data.is_modes:
            # Of the interval that ends at a row; NaN where there is none.
            defect = np.full(len(values), np.nan)
            known = of_channel(scene, defects, channel.column)
            if known is not None:
                defect[1 : 1 + len(known[0])] = known[0]
            kinds["_defect"] = ("rad", ", defect of the interval before the row", defect)
        for ending, (unit, long_name, array) in kinds.items():
            arrays[channel.key + ending] = array
            columns[channel.key + ending] = Column((axis,), unit, channel.name + long_name)
    shown = replace(verdict, unused=verdict.unused[:_MOST_NAMES])  # an attribute has 64 kB
    facts = {
        "title": scene.title,
        "scene_hash": scene_hash(scene),
        "scene_toml": scene.text,
        **{name: getattr(verdict, name) for name in ("source", "status", "message", "tolerance")},
        "horizon_s": np.nan if verdict.horizon_s is None else verdict.horizon_s,
        "verdict": json.dumps(as_dictionary(shown)),
        **versions(),
    }
    return Record("comparison", scene.name, f"data/{what}", facts, arrays, columns)


def of_channel(scene: Scene, defects: Defects | None, column: int) -> tuple[Array, Array] | None:
    """((n - 1,), (n - 1,)) rad: a channel's defects, and what rounding may make of them; None where not known."""
    count = len(scene.initial_angles)
    if defects is None or column % count not in defects.moving:
        return None
    place = defects.moving.index(column % count) + (len(defects.moving) if column >= count else 0)
    return defects.channel_sizes[:, place], defects.floors[:, place]
