"""Data of another program against the closed form: a trajectory against the reference of a scene at the times of the
data, loads against those at the data's own states, a table of frequencies against the modes; and the verdict."""

from __future__ import annotations

import itertools
import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from numbers import Real
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from rotor_mbs.analysis.judgement import OK_ERROR
from rotor_mbs.analysis.modes import CLOSED_FORM, LinearModes
from rotor_mbs.comparison.channels import Channel, ForeignData, channels
from rotor_mbs.comparison.data_mistakes import CauseSearch, carried_errors, defects_of_data, likely_causes, states_of
from rotor_mbs.comparison.hypotheses import DefectCauses
from rotor_mbs.errors import InputError
from rotor_mbs.methods.time_limit import OutOfTimeError, stop_in_time, time_limit
from rotor_mbs.models.lagrange.heyoka_adapter import is_available
from rotor_mbs.models.lagrange.parameters import load_segments, load_tables
from rotor_mbs.models.lagrange.reference import reference_at
from rotor_mbs.models.lagrange.samples import sampled_loads
from rotor_mbs.runs.design import Column
from rotor_mbs.runs.read import Record
from rotor_mbs.runs.versions import versions
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.scenario.time_table import ALIGNMENT, values_before
from rotor_mbs.solution.defects import FLOOR_SAFETY, Defects
from rotor_mbs.solution.metrics import horizon, horizon_samples
from rotor_mbs.solution.quantities import LOADS, longest_arm
from rotor_mbs.solution.trajectory import Array, Trajectory, all_coordinates
from rotor_mbs.studies.modes import compute_modes

LEVELS = (1e-3, 1e-6, 1e-9)  # rad, rad/s, or of the largest: until when data agree to each
DEFAULT_TOLERANCE = 1e-6  # rad, of an interval's defect; of a load's largest; of a frequency


@dataclass(frozen=True)
class ChannelErrors:
    """A channel of data, such as "pitch 1" in "rad", against the reference; loads against those of the data's states.

    error_max, error_whole : the largest error up to the horizon, and at all.
    defect : what is judged, less what the rounding of the data explains; None where it cannot be known. Of an angle or
        a rate (times the interval) the largest over all intervals, rad; of a load the largest error, of the load's
        largest size; of a frequency the largest error, of its size.
    floor : the largest that rounding explains, likewise.
    agrees_until : see the function of this name.
    """

    name: str
    unit: str
    error_max: float
    error_whole: float
    defect: float | None
    floor: float | None
    agrees_until: Mapping[str, float | None]
    defect_unit: str = "rad"


def agrees_until(rows: Array, error: Array) -> dict[str, float | None]:
    """For each of `LEVELS` the last of (n,) times, s, or speeds, rad/s, before the error is larger; None where the
    first is."""
    until: dict[str, float | None] = {}
    for level in LEVELS:
        beyond = ~(error <= level)
        end = int(np.argmax(beyond)) if beyond.any() else len(rows)
        until[str(level)] = float(rows[end - 1]) if end else None
    return until


@dataclass(frozen=True)
class DataVerdict:
    """What became of a comparison.

    source : name of the file.
    status, message : as of a run: "ok", or another one and why in a line.
    tolerance : rad, of an interval's defect.
    rows, compared_until, horizon_s : rows compared, time of the last one (s), horizon of the scene (s); None of modes.
    defect_time, predicted : s, end of the interval of the largest defect; rad, the error up to the horizon that the
        defects add up to; None where they are not known.
    read, unused, notes : how columns were read; columns that were not; what else there is to know.
    likely : what the difference looks like, of what was tried; empty where nothing fits, or nothing was tried.
    axis : "time", or "speed" of a table of modes, whose `compared_until` is in rad/s.
    """

    scene: str
    source: str
    status: str
    message: str
    tolerance: float
    channels: tuple[ChannelErrors, ...]
    rows: int
    compared_until: float
    horizon_s: float | None = None
    defect_time: float | None = None
    predicted: float | None = None
    read: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    likely: tuple[str, ...] = ()
    axis: str = "time"

    @property
    def agrees(self) -> bool:
        return self.status == "ok"


def as_dictionary(verdict: DataVerdict) -> dict[str, Any]:
    """For JSON."""
    return asdict(verdict) | {"agrees": verdict.agrees}


def from_dictionary(stored: Mapping[str, Any]) -> DataVerdict:
    """The verdict of which `as_dictionary` made this, also where it has been JSON since."""
    values: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value for name, value in stored.items()
    }
    values["channels"] = tuple(ChannelErrors(**channel) for channel in values["channels"])
    del values["agrees"]
    return DataVerdict(**values)


def _checked(tolerance: float) -> float:
    """As a plain number. Raises InputError."""
    if isinstance(tolerance, bool) or not isinstance(tolerance, Real) or not 0.0 < tolerance < math.inf:
        raise InputError(f"tolerance: {tolerance!r}; allowed: a number more than 0")
    return float(tolerance)


# A trajectory

_ROUNDING = 1e-9  # of the duration: times that are sums of steps may end so far past it
_FEWEST = 3
_START = 1e-3  # rad, rad/s: starts that differ by more are another start
_STRETCHES = (10, 100)  # rows over which defects are added up, too
_MOST_NAMES = 100  # of columns that were not used,
_MOST_BYTES = 30_000  # and as long: an attribute has 64 kB


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
    tolerance = _checked(tolerance)
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
                size = f"defect of {channel.defect:.1e} rad beyond rounding"
                interval = f"in the interval up to t = {defect_time:.6g} s"
                yield "inaccurate", f"{channel.name}: {size}, {interval}, allowed {tolerance:.0e}"
        if not drift <= tolerance:
            yield "inaccurate", f"{drifting}: defect of {drift:.1e} rad beyond rounding, allowed {tolerance:.0e}"
        worst = int(per_growth.argmax())
        if not per_growth[worst] <= tolerance:
            size = f"error {channels[worst].error_max:.1e} {channels[worst].unit} up to the horizon"
            growing = f"{per_growth[worst]:.1e} per unit of error growth"
            yield "inaccurate", f"{channels[worst].name}: {size}, {growing}, allowed {tolerance:.0e}"
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
        if rows < _FEWEST and len(data.time) > rows:
            inside = f"{rows} of {len(data.time)} rows within the {scene.duration:g} s of {scene.name}"
            yield "inaccurate", f"{inside}; is the time in s? `unit` of the time in a mapping file says otherwise"
        elif time[-1] < last - 1.5 * step:
            yield "inaccurate", f"the data end at t = {time[-1]:.6g} s of {last:g} s"
        if time[0] > 1.5 * step:
            yield "inaccurate", f"the data begin at t = {time[0]:.6g} s, not at 0"
        if until < _FEWEST:
            yield "unchecked", f"{until} rows up to the horizon: too few to be compared"
        if defects is None and note and until < len(at_rows.time):
            yield "unchecked", f"after the horizon at {horizon_s:.6g} s nothing is checked; {note}"
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
    if data.precision:
        notes.append(f"numbers of {data.precision}")
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
    unused = verdict.unused[:_MOST_NAMES]
    while len(json.dumps(unused)) > _MOST_BYTES:
        unused = unused[: len(unused) // 2]
    shown = replace(verdict, unused=unused)
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


# Loads

_SMALL = 1e-3  # of the largest force at a root: components that stay below are judged by this, not by their own largest
_ROUNDING_OF_LOADS = 16.0 * 2.0**-53  # of that force: of the sums that a load is
_STATE_STEP = 1e-7  # of a state, for the derivative of the loads
_FEWEST_EXPLAINED = 5  # rows: with fewer, something always fits
_MOST_LEFT = 1e-4  # of the largest load, or of a frequency, by a mistake that is named,
_LEFT = 1e-2  # and of the difference: another program's own error is no mistake
_LOAD_UNITS = {1.0: "", 1e-3: "kN taken as N", 1e3: "N taken as kN"}
_LOAD_FACTORS = [sign * factor for sign in (1.0, -1.0) for factor in _LOAD_UNITS]
# "" is the one that the scene's loads have: of a root the blade's, of the shaft the base.
_FRAMES = ("", "rotor", "base")


@dataclass(frozen=True)
class LoadComparison:
    """expected : (n, channels) N or N m. message : why the loads are not right, "" where they are. likely : causes."""

    expected: Array
    errors: tuple[ChannelErrors, ...]
    message: str
    likely: tuple[str, ...]


def all_loads(scene: Scene, time: Array, angles: Array, rates: Array) -> dict[str, Array]:
    """By frame the (n, components) loads of the closed form at (n, 1 + blades) rad and rad/s, in the order of
    `channels`; what has no components in a frame is as it is."""
    loads, in_rotor, in_base = sampled_loads(scene, time, angles, rates), dict[str, Array](), dict[str, Array]()
    for name, values in loads.items():
        in_rotor[name] = in_base[name] = values
        if name.startswith("shaft"):
            in_rotor[name] = _turned(values, -angles[:, 0], axis=1)
        elif name.startswith("blade"):
            in_rotor[name] = _turned(values, angles[:, 1:], axis=2)
            in_base[name] = _turned(in_rotor[name], angles[:, :1] + np.array(scene.phases), axis=1)
    return {
        frame: np.hstack([arrays[load.name].reshape(len(time), -1) for load in LOADS])
        for frame, arrays in zip(_FRAMES, (loads, in_rotor, in_base), strict=True)
    }


def _turned(vectors: Array, angle: Array, axis: int) -> Array:
    """(..., 3) turned about y (1) or z (2) by (...) rad."""
    first, second = vectors[..., (axis + 1) % 3], vectors[..., (axis + 2) % 3]
    turned = vectors.copy()
    turned[..., (axis + 1) % 3] = np.cos(angle) * first - np.sin(angle) * second
    turned[..., (axis + 2) % 3] = np.sin(angle) * first + np.cos(angle) * second
    return turned


def compare_loads(scene: Scene, loads: ForeignData, defects: Defects, tolerance: float) -> LoadComparison:
    """The verdict on each component, relative to its largest, beyond what the rounding of states and loads explains.

    Rows at a jump of a torque are left out: a load has its value before the jump, or after it.
    """
    states, time, half = defects.states, defects.time, len(defects.moving)
    known = [channel for channel in channels(scene) if channel.is_load]
    places = [channel.column - known[0].column for channel in loads.channels]

    def loads_at(states: Array) -> dict[str, Array]:
        return all_loads(scene, time, *all_coordinates(scene, states[:, :half], states[:, half:]))

    def chosen(matrices: dict[str, Array]) -> Array:
        columns = zip(places, loads.channels, strict=True)
        return np.stack([matrices[channel.frame][:, place] for place, channel in columns], axis=1)

    matrices = loads_at(states)
    expected, values = chosen(matrices), loads.values[: len(time)]
    forces = matrices[""][:, : 3 * len(scene.blades)].reshape(len(time), -1, 3)
    largest_force = np.linalg.norm(forces, axis=2).max(axis=1)
    arms = np.array([1.0 if channel.kind == "force" else longest_arm(scene) for channel in loads.channels])
    rounding = loads.rounding[: len(time)] + _ROUNDING_OF_LOADS * largest_force[:, None] * arms
    for i in range(2 * half):
        step = _STATE_STEP * np.maximum(np.abs(states[:, i]), 1.0)
        moved = states.copy()
        moved[:, i] += step
        rounding += np.abs(chosen(loads_at(moved)) - expected) * (defects.rounding[:, i] / step)[:, None]
    judged = np.isfinite(expected).all(axis=1)
    for table in load_tables(scene):
        for (t0, _), (t1, _) in itertools.pairwise(table):
            judged &= (t0 != t1) | (np.abs(time - t0) > ALIGNMENT * float(np.median(np.diff(time))))
    time, values, rounding = time[judged], values[judged], rounding[judged]
    matrices = {frame: matrix[judged] for frame, matrix in matrices.items()}
    own = expected[judged]
    least = _SMALL * arms * float(largest_force.max(initial=0.0))  # (channels,) the smallest scale of an error
    before = np.abs(values - own).max(axis=0, initial=0.0)

    def scale(j: int, component: Array) -> float:
        return float(max(np.abs(component).max(initial=0.0), least[j])) or 1.0

    def fits(j: int, factor: float, candidate: Array, *, may_vanish: bool = False) -> bool:
        """Whether a component is `factor` times another one, which is not next to nothing unless it may be."""
        left = np.abs(values[:, j] / factor - candidate) - FLOOR_SAFETY * rounding[:, j] / min(abs(factor), 1)
        allowed = min(min(tolerance, _MOST_LEFT) * scale(j, candidate), _LEFT * before[j])
        return float(left.max()) <= allowed and (may_vanish or float(np.abs(candidate).max()) > 100.0 * allowed)

    errors, wrong = [], []
    message, largest = "" if judged.any() else "no row in which the loads are known", 0.0
    for j, channel in enumerate(loads.channels):
        size, error = scale(j, own[:, j]), np.abs(values[:, j] - own[:, j])
        excess = np.maximum(error - FLOOR_SAFETY * rounding[:, j], 0.0) / size
        worst, floor, most = (float(x.max(initial=0.0)) for x in (excess, rounding[:, j] / size, error))
        until = agrees_until(time, error / size)
        unit = "of the largest"
        errors.append(ChannelErrors(channel.name, channel.unit, most, most, worst, floor, until, unit))
        if not worst <= tolerance:
            wrong.append(j)
        if not worst <= max(tolerance, largest):
            largest, at = worst, f"at t = {time[int(excess.argmax())]:.6g} s, allowed {tolerance:.0e}"
            message = f"{channel.name}: difference of {worst:.1e} of its largest magnitude beyond rounding, {at}"
    if len(time) < _FEWEST_EXPLAINED:
        return LoadComparison(expected, tuple(errors), message, ())

    # For each wrong component the simplest of: unit, sign, axis, frame, another load, the torque on the rotor in it.
    torque = values_before(load_segments(scene), time)[0]
    simplest: dict[int, dict[str, str]] = {}  # by component, then by what is wrong: which column it is
    groups: dict[tuple[str, str], list[int]] = {}  # what is left, of one load
    for j in wrong:
        channel, name = loads.channels[j], loads.channels[j].name.partition(",")[0]
        found: list[tuple[int, str, str]] = []  # mistakes that it takes, what is wrong, which column it is
        for (frame, matrix), (i, other), factor in itertools.product(matrices.items(), enumerate(known), _LOAD_FACTORS):
            if other.kind != channel.kind:
                continue
            parts = [f"in the {_frame_name(other, frame)} frame" if frame != channel.frame else "", *_mistakes(factor)]
            parts = [part for part in parts if part]
            cost = (_load(other) != _load(channel)) + (other.name != name) + len(parts)
            shown = f" is {other.name}" if other.name != name else ""
            if fits(j, factor, matrix[:, i]):
                found.append((cost, ", ".join(parts), shown))
            if other.name == "shaft moment y" and fits(j, factor, matrix[:, i] + torque):
                found.append((cost + 1, ", ".join(["with the torque on the rotor in it", *parts]), shown))
        fewest = min(found)[0] if found else 0
        simplest[j] = {text: shown for cost, text, shown in found[::-1] if cost == fewest}
        if not found and channel.kind == "moment" and "actuator" not in channel.name:
            groups.setdefault((_load(channel), channel.frame), []).append(j)
    # Of texts that are alike for a component the one that most components have.
    common = Counter(text for texts in simplest.values() for text in texts)
    named: dict[str, list[str]] = {}
    for j, texts in simplest.items():
        if texts:
            text = max(reversed(texts), key=lambda text: common[text])
            named.setdefault(text, []).append(f"{loads.channels[j].name}{texts[text]}")
    # Moments about another point: M - p × F = M + F × p, by least squares over the wrong components.
    for (load, frame), group in groups.items():
        moment, force = (
            matrices[frame][:, [i for i, channel in enumerate(known) if _load(channel) == name]]
            for name in (load, load.replace("moment", "force"))
        )
        axes = ["xyz".index(loads.channels[j].name.partition(",")[0][-1]) for j in group]
        moment = moment[:, axes]
        matrix = np.cross(force[:, None, :], np.eye(3)[None]).transpose(0, 2, 1)[:, axes]  # (n, axes, 3): F × p
        is_root = load.startswith("blade root")
        points: list[tuple[str, Array, float]] = []
        if is_root and not frame:
            blade = scene.blades[int(load.split()[-1]) - 1]
            for name, place in (("the centre of mass", blade.centre_of_mass), ("the tip", blade.tip)):
                points += [(name, np.array(place), factor) for factor in _LOAD_FACTORS]
        for factor in _LOAD_FACTORS:
            difference = (values[:, group] / factor - moment).ravel()
            point = np.asarray(np.linalg.lstsq(matrix.reshape(-1, 3), difference, rcond=1e-9)[0], float)
            point[np.abs(point) < 1e-9 * np.abs(point).max()] = 0.0
            shown = ", ".join(f"{x:.6g}" for x in point)
            name = f"the point ({shown}) m of the {_frame_name(loads.channels[group[0]], frame)} frame"
            points.append((name, point, factor))
        for name, point, factor in points:
            candidates = moment + matrix @ point
            if all(fits(j, factor, candidates[:, k], may_vanish=True) for k, j in enumerate(group)):
                origin = "the root" if is_root else "the hub centre"
                text = ", ".join(filter(None, (f"about {name} in place of {origin}", *_mistakes(factor))))
                named.setdefault(text, []).extend(loads.channels[j].name for j in group)
                break
    exchanged = named.pop("", [])
    likely = [f"{', '.join(names)}: {text}" for text, names in named.items()]
    if exchanged:
        likely.append(f"columns exchanged: {', '.join(exchanged)}")
    return LoadComparison(expected, tuple(errors), message, tuple(likely))


def _load(channel: Channel) -> str:
    """Without its axis and frame: "blade root moment 1"."""
    return channel.name.partition(",")[0].rstrip("xyz ")


def _mistakes(factor: float) -> tuple[str, str]:
    return "sign reversed (action in place of reaction)" if factor < 0.0 else "", _LOAD_UNITS[abs(factor)]


def _frame_name(channel: Channel, frame: str) -> str:
    return frame or ("blade's own" if channel.name.startswith("blade root") else "base")


# Modes over rotor speed

_SLOW = 1e-3  # of the largest frequency: slower ones are judged by this, not by their own size
_MOST_SPEEDS = 1000
_HZ, _RPM = 2.0 * math.pi, math.pi / 30.0  # rad/s
_MODE_UNITS = {1.0: "", _HZ: "Hz taken as rad/s", 1.0 / _HZ: "rad/s taken as Hz",
          _RPM: "rpm taken as rad/s", 1.0 / _RPM: "rad/s taken as rpm"}  # fmt: skip


def compare_modes(data: ForeignData, scene: Scene, tolerance: float) -> tuple[DataVerdict, Record]:
    """The verdict on each column of frequencies: its largest error, of the frequency's size, beyond rounding; and the
    data with what they were compared with, for a file.

    At each speed the frequencies are those of different modes of the scene, whichever lie nearest. Steady rotation
    without gravity; at rest under gravity where no speed is above 0. Raises InputError for more than 1000 speeds, or
    more columns than modes.
    """
    tolerance = _checked(tolerance)
    if len(data.time) > _MOST_SPEEDS:
        raise InputError(f"{data.source}: {len(data.time)} speeds; allowed: up to {_MOST_SPEEDS}")
    if len({channel.name.startswith("undamped") for channel in data.channels}) > 1:
        allowed = 'omit = ["undamped_frequency"], or ["frequency"], in a mapping file'
        raise InputError(f"{data.source}: damped and undamped frequencies in one table; allowed: {allowed}")
    modes = _closed_form_modes(scene, data.time)
    if isinstance(modes, str):
        raise InputError(f"{data.source}: nothing to compare with: {modes}")
    right = _families(modes, data)[""]
    if data.values.shape[1] > right.shape[1]:
        raise InputError(f"{data.source}: {data.values.shape[1]} frequencies; allowed: {right.shape[1]}, its modes")
    error, expected = _mode_errors(data.values, data.rounding, right)
    known = np.isfinite(expected).all(axis=1)
    channels, messages = [], []
    for j, channel in enumerate(data.channels):
        size, difference = error[known, j], np.abs(data.values[:, j] - expected[:, j])[known]
        worst, largest = float(size.max(initial=0.0)), float(difference.max(initial=0.0))
        floor = float((data.rounding[:, j] / _mode_scale(expected)[:, j])[known].max(initial=0.0))
        until = agrees_until(data.time[known], size)
        channels.append(ChannelErrors(channel.name, channel.unit, largest, largest, worst, floor, until, "of its size"))
        if not worst <= tolerance:
            at = f"at {data.time[known][int(size.argmax())]:.6g} rad/s, allowed {tolerance:.0e}"
            messages.append((worst, f"{channel.name}: relative difference of {worst:.1e} beyond rounding, {at}"))
    status, message = ("inaccurate", max(messages)[1]) if messages else ("ok", "")
    if not known.all():
        status = "unchecked" if status == "ok" else status
        message = message or next(filter(None, modes.messages), "no modes")
    likely = _mode_causes(scene, data, tolerance, error) if messages else []
    verdict = DataVerdict(
        scene.name, data.source, status, message, tolerance, tuple(channels), len(data.time), float(data.time[-1]),
        read=data.read, unused=data.unused, notes=(f"numbers of {data.precision}",) if data.precision else (),
        likely=tuple(likely), axis="speed",
    )  # fmt: skip
    return verdict, comparison_record(verdict, scene, data, expected, None)


def _closed_form_modes(scene: Scene, speeds: Array) -> LinearModes | str:
    """Modes at these speeds, without gravity, which is what they are without; at rest where none is above 0; why there
    are none."""
    if not speeds.any():
        found = compute_modes(scene, models=(CLOSED_FORM,))
        return found.rest.get(CLOSED_FORM, "; ".join(found.notes))
    found = compute_modes(replace(scene, gravity=0.0), speeds, models=(CLOSED_FORM,))
    return found.rotation.get(CLOSED_FORM, "; ".join(found.notes))


def _families(modes: LinearModes, data: ForeignData) -> dict[str, Array]:
    """What a program may call its frequencies, (speeds, columns or modes); those that are right have no words."""
    damped, undamped, speed = modes.damped_frequencies, modes.undamped_frequencies, modes.speeds[:, None]
    is_undamped = data.channels[0].name.startswith("undamped")
    right, other = (undamped, damped) if is_undamped else (damped, undamped)
    return {
        "": right,
        "damped frequencies" if is_undamped else "undamped frequencies": other,
        "frequencies in the fixed frame (whirl), the rotor's speed below or above those in the rotor's frame": (
            np.concatenate([right, np.abs(right - speed), right + speed], axis=1)
        ),
    }


def _mode_scale(expected: Array) -> Array:
    least = _SLOW * float(np.nanmax(expected, initial=0.0))
    return np.maximum(expected, least or 1.0)


def _mode_errors(values: Array, rounding: Array, known: Array) -> tuple[Array, Array]:
    """(speeds, columns) of the size of the frequency, beyond rounding; and the frequencies that are the nearest."""
    expected = np.full(values.shape, np.nan)
    for i, (row, right) in enumerate(zip(values, known, strict=True)):
        if np.isfinite(right).all():
            expected[i] = right[linear_sum_assignment(np.abs(row[:, None] - right))[1]]
    excess = np.abs(values - expected) - FLOOR_SAFETY * rounding
    return np.maximum(excess, 0.0) / _mode_scale(expected), expected


def _mode_causes(scene: Scene, data: ForeignData, tolerance: float, error: Array) -> list[str]:
    """The least that explains all: a wrong unit, of frequencies or speeds, another kind of frequency, or missing
    stiffening; several texts for one table where they are alike. error: (speeds, columns), as `_mode_errors` has it."""
    allowed = min(tolerance, _MOST_LEFT, _LEFT * float(np.nanmax(error, initial=0.0)))
    # The stiffening is seen from rest on: the squares of undamped frequencies, there and at the speeds of the data.
    whole = _closed_form_modes(scene, np.union1d(0.0, data.time)) if np.count_nonzero(data.time) >= 3 else ""
    found: list[tuple[int, str]] = []  # mistakes that it takes, in words
    for speed, of_speeds in _MODE_UNITS.items() if data.time.any() else [(1.0, "")]:
        modes = _closed_form_modes(scene, speed * data.time)
        if isinstance(modes, str):
            continue
        for unit, of_frequencies in _MODE_UNITS.items():
            values, rounding = data.values * unit, data.rounding * unit
            texts = [f"frequencies in {of_frequencies}"] if of_frequencies else []
            texts += [f"speeds in {of_speeds}"] if of_speeds else []
            for text, frequencies in _families(modes, data).items():
                parts = [*texts, text] if text else texts
                if parts and np.nanmax(_mode_errors(values, rounding, frequencies)[0], initial=0.0) <= allowed:
                    found.append((len(parts), "; and ".join(parts)))
            if speed == 1.0 and not isinstance(whole, str):
                wrong = _mode_errors(values, rounding, modes.damped_frequencies)[0].max(axis=0) > tolerance
                left, text = _without_stiffening(whole, data.time, values[:, wrong], rounding[:, wrong])
                if left <= allowed:
                    found.append((len(texts) + 1, "; and ".join([*texts, text])))
    least = min(found, default=(0, ""))[0]
    return [text for cost, text in found if cost == least]


def _without_stiffening(modes: LinearModes, speeds: Array, values: Array, rounding: Array) -> tuple[float, str]:
    """(what is left, in words) f² = f0² - α Ω², with the scene's f0 and an α of 0 or more, where the scene's own f²
    rises, or falls less: of every column that is wrong, (speeds, columns). modes: at rest and at those speeds.

    Of a blade that turns about its pitch axis by θ, the centrifugal forces have the stiffness Ω² Σ m (u² - v²), u
    the distance of its masses from that axis across the shaft, v along it. A model of linear displacements has
    none of u², which is of second order in θ: what is left, -Ω² Σ m v², softens.
    """
    squares, turning = modes.undamped_frequencies**2, speeds**2
    largest, alphas = 0.0, []
    for column, digits in zip(values.T, rounding.T, strict=True):
        fits = []
        for first, last in zip(squares[0], squares[-1], strict=True):
            alpha = max(float(turning @ (first - column**2) / (turning @ turning)), 0.0)
            if not last > first - alpha * turning[-1]:
                continue
            found = np.sqrt(np.maximum(first - alpha * turning, 0.0))
            excess = np.maximum(np.abs(column - found) - FLOOR_SAFETY * digits, 0.0)
            fits.append((float((excess / _mode_scale(found)).max()), alpha))
        left, alpha = min(fits, default=(math.inf, 0.0))
        largest = max(largest, left)
        alphas.append(f"{alpha:.4g}")
    shown = ", ".join(dict.fromkeys(alphas))
    return largest, f"centrifugal stiffening is missing: f² = f0² - α Ω², α = {shown}"
