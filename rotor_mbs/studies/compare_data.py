"""Data of another program against the reference of a scene, evaluated at the times of the data."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from time import monotonic

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.analysis.data_verdict import DEFAULT_TOLERANCE, ChannelErrors, DataVerdict, agrees_until, as_dictionary
from rotor_mbs.analysis.judgement import OK_ERROR
from rotor_mbs.errors import InputError
from rotor_mbs.foreign.channels import ForeignData
from rotor_mbs.methods.time_limit import OutOfTimeError, stop_in_time, time_limit
from rotor_mbs.models.lagrange import samples
from rotor_mbs.models.lagrange.heyoka_adapter import is_available
from rotor_mbs.models.lagrange.parameters import work_is_integrated
from rotor_mbs.models.lagrange.reference import TimedReference, reference_at
from rotor_mbs.runs.design import Column
from rotor_mbs.runs.read import Record
from rotor_mbs.runs.versions import versions
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.solution.defects import FLOOR_SAFETY, Defects
from rotor_mbs.solution.metrics import horizon, horizon_samples, metrics_of, running_growth
from rotor_mbs.solution.trajectory import Array, Trajectory
from rotor_mbs.studies.data_causes import CauseSearch, carried_errors, defects_of_data, likely_causes, states_of
from rotor_mbs.studies.data_loads import compare_loads
from rotor_mbs.studies.defect_causes import DefectCauses

METHOD = "data"  # what takes the place of a method's name
# An error of the state changes the energy by its gradient: some ten times the error, of the energy scale; tenfold that.
_ENERGY_PER_ANGLE = 100.0
_ROUNDING = 1e-9  # of the duration: times that are sums of steps may end so far past it
_FEWEST = 3
_START = 1e-3  # rad, rad/s: starts that differ by more are another start
_FULL_DIGITS = 8  # as many as single precision has
_STRETCHES = (10, 100)  # rows over which defects are added up, too
_MOST_NAMES = 100  # of columns that were not used


@dataclass(frozen=True)
class DataStudy:
    """Data, cut to the scene's duration, what they were compared with, and the verdict.

    expected : (n, channels) the reference at the times of the data, as far as the motion goes.
    defects : of the data; None where they are not known.
    """

    scene: Scene
    data: ForeignData
    expected: Array
    defects: Defects | None
    verdict: DataVerdict

    def record(self) -> Record:
        """As a record of a results file: of each channel data, reference, error, and defect of an angle or a rate."""
        values, axis = self.data.values[: self.verdict.rows], self.verdict.axis
        scale = Column((axis,), "s", "time") if axis == "time" else Column((axis,), "rad/s", "rotor speed")
        columns, arrays = {axis: scale}, {axis: self.data.time[: self.verdict.rows]}
        kinds = {
            "": ("", values),
            "_reference": (", reference", self.expected),
            "_error": (", data minus reference", values - self.expected),
        }
        for j, channel in enumerate(self.data.channels):
            for ending, (what, array) in kinds.items():
                arrays[channel.key + ending] = array[:, j]
                columns[channel.key + ending] = Column((axis,), channel.unit, channel.name + what)
            if channel.is_load or self.data.is_modes:
                continue
            # Of the interval that ends at a row; NaN where there is none.
            defect = np.full(len(values), np.nan)
            known = of_channel(self.scene, self.defects, channel.column)
            if known is not None:
                defect[1 : 1 + len(known[0])] = known[0]
            arrays[channel.key + "_defect"] = defect
            columns[channel.key + "_defect"] = Column(
                ("time",), "rad", f"{channel.name}, defect of the interval before the row"
            )
        verdict = replace(self.verdict, unused=self.verdict.unused[:_MOST_NAMES])  # an attribute has 64 kB
        facts = {
            "title": self.scene.title,
            "scene_hash": scene_hash(self.scene),
            "scene_toml": self.scene.text,
            **{name: getattr(verdict, name) for name in ("source", "status", "message", "tolerance", "horizon_s")},
            "verdict": json.dumps(as_dictionary(verdict)),
            **versions(),
        }
        name = "data/modes" if self.data.is_modes else "data/trajectory"
        return Record("comparison", self.scene.name, name, facts, arrays, columns)


@np.errstate(all="ignore")  # data may be of any size
def compare_with_reference(
    data: ForeignData, scene: Scene, tolerance: float = DEFAULT_TOLERANCE, time_limit_s: float = float("inf")
) -> DataStudy:
    """The verdict on data, by their defects over all rows, each channel against its own rounding, by their first row,
    and by their errors up to the horizon; where they differ by more than rounding, what that looks like.

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
    with _limited(ends, time_limit_s):
        exact = reference_at(replace(scene, duration=end, samples=len(times), outputs=("angles", "rates")), times)
    run = exact.trajectory
    place: NDArray[np.int64] = np.searchsorted(run.time, cut.time)
    place = place[place < len(run.time)]
    if not len(place):
        raise InputError(
            f"{data.source}: no row within the {scene.duration:g} s of {scene.name}; allowed: times in s from its "
            f"start; `offset = {-data.time[0]:.6g}` of the time in a mapping file shifts the first row to the start"
        )
    carried = carried_errors(run, exact.growth, exact.units)[place][:, data.columns]
    at_rows = Trajectory(run.time[place], run.angles[place], run.rates[place], error_growth=run.error_growth[place])
    expected = states_of(at_rows)[:, cut.columns]
    # Wrapped channels with as many turns as the reference has in the first row.
    turns = 2.0 * np.pi * np.round((expected[0] - cut.values[0]) / (2.0 * np.pi))
    cut = replace(cut, values=np.where(cut.wrapped, cut.values + turns, cut.values))
    rows, horizon_s, until = len(place), horizon(run), len(place)
    if horizon_samples(run) < len(run.time):
        until = max(int(np.searchsorted(at_rows.time, horizon_s, side="right")), 1)
    compared = cut.rows(slice(rows))
    with _limited(ends, time_limit_s):
        defects, note = defects_of_data(scene, compared, at_rows, until)
    errors = _channel_errors(scene, compared, at_rows, run, until, defects)
    missing = [label for i, label in enumerate(scene.coordinate_labels) if i not in data.columns]
    notes = [note] if note else []
    energy_drift, energy_note = _energy(scene, compared, at_rows)
    predicted = defect_time = None
    if defects is not None:
        judged = defects.is_judged
        excess = np.where(judged[:, None], defects.channel_sizes - FLOOR_SAFETY * defects.floors, 0.0).max(axis=1)
        defect_time = float(defects.time[1 + int(excess.argmax())])
        path = defects.predicted
        if path is not None:
            predicted = float(np.abs(path[:until]).max())
    drift = 0.0, ""  # the largest over longer stretches, and where
    if defects is not None:
        labels = [scene.coordinate_labels[i] for i in defects.moving]
        for stretch in _STRETCHES:
            sizes, floors = defects.over_rows(stretch)
            excess = (sizes - FLOOR_SAFETY * floors).max(axis=0, initial=0.0)
            worst = int(excess.argmax())
            name = [*labels, *(f"{label} rate" for label in labels)][worst]
            drift = max(drift, (float(excess[worst]), f"{name}, over {stretch} rows"))
    # Per unit of error growth: in a motion whose errors do not grow, faults below any interval's tolerance add up.
    beyond_rounding = np.maximum(np.abs(compared.values - expected) - FLOOR_SAFETY * compared.rounding, 0.0)
    per_growth = (beyond_rounding / carried)[:until].max(axis=0)
    status, message = _status(
        compared, at_rows, errors, per_growth, drift, until, tolerance, defect_time, missing, energy_drift
    )
    if status in ("ok", "unchecked"):
        status, message = _uncovered(scene, compared, exact, until, defects) or (status, message)
    if len(data.time) > len(cut.time):
        notes.append(f"{len(data.time) - len(cut.time)} rows after the scene's {scene.duration:g} s are not compared")
    if data.digits < _FULL_DIGITS:
        rounding = 0.5 * 10.0 ** (1 - data.digits)
        notes.append(f"numbers of {data.digits} digits: relative rounding error {rounding:.0e}")
    if missing:
        notes.append(f"missing angles: {', '.join(missing)}")
    if energy_note:
        notes.append(energy_note)
    likely: list[str] = []
    try:
        with time_limit(max(ends - monotonic(), 0.0)):
            causes = DefectCauses(scene, defects, tolerance) if defects is not None and not missing else None
            if status != "ok":
                whole = replace(data, values=data.values + (cut.values[0] - data.values[0]))  # the turns that `cut` has
                largest = float((np.abs(compared.values - expected) / carried)[:until].max())
                search = CauseSearch(scene, whole, exact, tolerance, largest)
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
            errors, likely = errors + found.errors, [*likely, *found.likely]
            if found.message and status in ("ok", "unchecked"):
                status, message = "inaccurate", found.message
        expected, cut = np.hstack([expected, own]), compared.beside(loads)
    verdict = DataVerdict(
        scene.name, data.source, status, message, tolerance, errors, rows, float(at_rows.time[-1]), horizon_s,
        defect_time, predicted, energy_drift, data.read, data.unused, tuple(notes), tuple(likely),
    )  # fmt: skip
    return DataStudy(scene, cut, expected, defects, verdict)


@contextmanager
def _limited(ends: float, time_limit_s: float) -> Iterator[None]:
    """Raises InputError where the block is not done when `time.monotonic` is `ends`."""
    try:
        with time_limit(max(ends - monotonic(), 0.0)):
            yield
            stop_in_time()
    except OutOfTimeError:
        raise InputError(f"timeout: no reference after {time_limit_s:g} s; allowed: a longer time limit") from None


def _status(
    data: ForeignData, reference: Trajectory, errors: Sequence[ChannelErrors], per_growth: Array,
    drift: tuple[float, str], until: int, tolerance: float, defect_time: float | None, missing: Sequence[str],
    energy_drift: float | None,
) -> tuple[str, str]:  # fmt: skip
    """The first of these: another start, defects, errors up to the horizon, per unit of error growth and at all,
    energy, a channel that is missed; per_growth: (channels,)."""
    allowed = tolerance + FLOOR_SAFETY * data.rounding[0]
    off = np.abs(data.values[0] - states_of(reference)[0, data.columns]) - allowed
    worst = int(off.argmax())
    if off[worst] > 0.0:
        name, unit = data.channels[worst].name, data.channels[worst].unit
        value, right = data.values[0, worst], states_of(reference)[0, data.columns[worst]]
        return (
            "inaccurate",
            f"first row, t = {data.time[0]:.6g} s: {name} {value:.9g} {unit}, the scene has {right:.9g}",
        )
    known = [channel for channel in errors if channel.defect is not None]
    worst_defect = max(known, key=lambda channel: channel.defect or 0.0, default=None)
    if worst_defect is not None and not (worst_defect.defect or 0.0) <= tolerance:
        return "inaccurate", (
            f"{worst_defect.name}: defect of {worst_defect.defect:.1e} rad beyond rounding, in the interval up to "
            f"t = {defect_time:.6g} s, allowed {tolerance:.0e}"
        )
    if not drift[0] <= tolerance:
        return "inaccurate", f"{drift[1]}: defect of {drift[0]:.1e} rad beyond rounding, allowed {tolerance:.0e}"
    worst = int(per_growth.argmax())
    if not per_growth[worst] <= tolerance:
        return "inaccurate", (
            f"{errors[worst].name}: error {errors[worst].error_max:.1e} {errors[worst].unit} up to the horizon, "
            f"{per_growth[worst]:.1e} per unit of error growth, allowed {tolerance:.0e}"
        )
    angles = [channel for channel in errors if channel.unit == "rad"] or list(errors)
    largest = max(angles, key=lambda channel: channel.error_max)
    rounding = FLOOR_SAFETY * float(data.rounding.max(initial=0.0))
    # Without defects the errors are all that there is.
    bound = (OK_ERROR if known else tolerance) + rounding
    if not largest.error_max <= bound:
        return (
            "inaccurate",
            f"{largest.name}: error {largest.error_max:.1e} {largest.unit} up to the horizon, allowed {bound:.0e}",
        )
    if energy_drift is not None and not energy_drift <= _ENERGY_PER_ANGLE * (tolerance + rounding):
        return "inaccurate", f"energy drift {energy_drift:.1e} of the energy scale"
    if missed := [name for name in missing if name not in data.omitted]:
        listed = ", ".join(f'"{name.replace(" ", "_")}"' for name in missed)
        return "unchecked", f"no column for {', '.join(missed)}; allowed: omit = [{listed}] in a mapping file"
    if until < 2:
        return "unchecked", "a single row"
    return "ok", ""


def _channel_errors(
    scene: Scene, data: ForeignData, reference: Trajectory, whole: Trajectory, until: int, defects: Defects | None
) -> tuple[ChannelErrors, ...]:
    """The errors of every channel; until: rows up to the horizon; whole: the reference at more times than those."""
    time, expected = reference.time, states_of(reference)[:, data.columns]
    # Time derivatives; of rates by differences.
    accelerations = np.gradient(whole.rates, whole.time, axis=0) if len(whole.time) > 1 else 0.0 * whole.rates
    slopes = np.hstack([whole.rates, accelerations])[np.searchsorted(whole.time, time)][:, data.columns]
    slopes[~np.isfinite(slopes)] = 0.0  # between times that are almost the same
    growth = running_growth(reference)
    errors = []
    for j, channel in enumerate(data.channels):
        error = np.abs(data.values[:, j] - expected[:, j])
        # Linear least squares, each row by its weight; what a channel cannot show is 0 or 1.
        weight = growth[:until]
        columns = np.stack([-slopes[:until, j], expected[:until, j], np.ones(until)], axis=1) / weight[:, None]
        sizes = np.linalg.norm(columns, axis=0)
        sizes[sizes == 0.0] = 1.0
        difference = (data.values[:until, j] - expected[:until, j]) / weight
        lag, scale, offset = np.linalg.lstsq(columns / sizes, difference, rcond=1e-9)[0] / sizes
        known, defect, floor = of_channel(scene, defects, channel.column), None, None
        if known is not None and defects is not None and defects.is_judged.any():
            sizes, floors = (values[defects.is_judged] for values in known)
            defect, floor = float(np.maximum(sizes - FLOOR_SAFETY * floors, 0.0).max()), float(floors.max())
        errors.append(
            ChannelErrors(
                channel.name, channel.unit, float(error[:until].max()), float(error.max()), defect, floor,
                agrees_until(time, error), float(lag), 1.0 + float(scale), float(offset),
            )
        )  # fmt: skip
    return tuple(errors)


def of_channel(scene: Scene, defects: Defects | None, column: int) -> tuple[Array, Array] | None:
    """((n - 1,), (n - 1,)) rad: a channel's defects, and what rounding may make of them; None where not known."""
    count = len(scene.initial_angles)
    if defects is None or column % count not in defects.moving:
        return None
    place = defects.moving.index(column % count) + (len(defects.moving) if column >= count else 0)
    return defects.channel_sizes[:, place], defects.floors[:, place]


def _energy(scene: Scene, data: ForeignData, reference: Trajectory) -> tuple[float | None, str]:
    """The largest change of the data's energy, of its scale; else None and why it is not known."""
    count = len(scene.initial_angles)
    scene = replace(scene, duration=float(data.time[-1]), samples=len(data.time), outputs=("angles", "rates", "energy"))
    if set(data.columns) != set(range(2 * count)):
        return None, "no energy balance: not all angles and rates are given"
    if work_is_integrated(scene):
        return None, "no energy balance: the work of dampers or changing loads is unknown"
    states = states_of(reference).copy()
    states[:, data.columns] = data.values
    moving = scene.moving_coordinates
    with np.errstate(all="ignore"):
        run = samples.trajectory(scene, data.time, states[:, [*moving, *(count + i for i in moving)]])
        return metrics_of(scene, run, None).get("energy_drift_max"), ""


def _uncovered(
    scene: Scene, data: ForeignData, exact: TimedReference, until: int, defects: Defects | None
) -> tuple[str, str] | None:
    """What the rows leave out of the motion, which is then not ok: its start, its end, all but a row of it, or what
    lies beyond the horizon in intervals over which errors grow too much to be judged."""
    time, end = data.time, min(scene.duration, float(exact.trajectory.time[-1]))
    step = float(np.diff(time).max(initial=0.0))
    if time[-1] < end - 1.5 * step:
        return "inaccurate", f"the data end at t = {time[-1]:.6g} s of {end:g} s"
    if time[0] > 1.5 * step:
        return "inaccurate", f"the data begin at t = {time[0]:.6g} s, not at 0"
    if until < _FEWEST:
        return "unchecked", f"{until} rows up to the horizon: too few to be compared"
    if defects is not None and not defects.is_judged[until - 1 :].all():
        long = until - 1 + int(np.argmin(defects.is_judged[until - 1 :]))
        since = f"the first after t = {defects.time[long]:.6g} s"
        return "unchecked", f"after the horizon the rows are too far apart to be checked, {since}"
    return None
