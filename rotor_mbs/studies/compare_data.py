"""Data of another program against the reference of a scene, evaluated at the times of the data."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from time import monotonic

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.analysis.data_verdict import DEFAULT_TOLERANCE, LEVELS, ChannelErrors, DataVerdict, as_dictionary
from rotor_mbs.analysis.judgement import judge
from rotor_mbs.errors import InputError
from rotor_mbs.foreign.channels import ForeignData, channels
from rotor_mbs.models.lagrange import samples
from rotor_mbs.models.lagrange.parameters import work_is_integrated
from rotor_mbs.models.lagrange.reference import TimedReference, reference_at
from rotor_mbs.runs.files import Column
from rotor_mbs.runs.records import Record
from rotor_mbs.runs.versions import versions
from rotor_mbs.scenario.accuracy_bounds import Bound
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.solution.metrics import horizon, horizon_samples
from rotor_mbs.solution.solution import Solution
from rotor_mbs.solution.trajectory import Array, Integration, Trajectory
from rotor_mbs.studies.data_causes import CauseSearch, carried_errors, likely_causes, states_of

METHOD = "data"  # what takes the place of a method's name
# An error of the state changes the energy by its gradient: some ten times the error, of the energy scale; tenfold that.
_ENERGY_PER_ANGLE = 100.0
_ROUNDING = 1e-9  # of the duration: times that are sums of steps may end so far past it
_FEWEST = 3
_START = 1e-3  # rad, rad/s: starts that differ by more are another start
_MOST_NAMES = 100  # of columns that were not used
_SEARCH_S = 60.0  # of the search for causes: scenes that are stiff or have many blades would take many minutes


@dataclass(frozen=True)
class DataStudy:
    """Data, cut to the scene's duration, what they were compared with, and the verdict.

    expected : (n, channels) the reference at the times of the data, as far as the motion goes.
    carried : (n, channels) what an error of the initial state of 1 rad may be in each channel, at most.
    """

    scene: Scene
    data: ForeignData
    expected: Array
    carried: Array
    verdict: DataVerdict

    def record(self) -> Record:
        """As a record of a results file: of each channel data, reference, error, and error amplification."""
        values = self.data.values[: self.verdict.rows]
        columns = {"time": Column(("time",), "s", "time")}
        arrays: dict[str, Array] = {"time": self.data.time[: self.verdict.rows]}
        kinds = {
            "": ("", values),
            "_reference": (", reference", self.expected),
            "_error": (", data less reference", values - self.expected),
            "_growth": (", an error of 1 at the start by then", self.carried),
        }
        for j, channel in enumerate(self.data.channels):
            for ending, (what, array) in kinds.items():
                arrays[channel.key + ending] = array[:, j]
                columns[channel.key + ending] = Column(("time",), channel.unit, channel.name + what)
        verdict = replace(self.verdict, unused=self.verdict.unused[:_MOST_NAMES])  # an attribute has 64 kB
        facts = {
            "title": self.scene.title,
            "scene_hash": scene_hash(self.scene),
            "scene_toml": self.scene.text,
            **{name: getattr(verdict, name) for name in ("source", "status", "message", "tolerance", "horizon_s")},
            "verdict": json.dumps(as_dictionary(verdict)),
            **versions(),
        }
        return Record("comparison", self.scene.name, "data/trajectory", facts, arrays, columns)


def compare_with_reference(data: ForeignData, scene: Scene, tolerance: float = DEFAULT_TOLERANCE) -> DataStudy:
    """The verdict on data; where they are off by more than the tolerance, causes are tried by running them.

    Raises InputError for a tolerance that is not positive, and for data without rows in the scene's duration.
    """
    if not 0.0 < tolerance < float("inf"):
        raise InputError(f"tolerance: {tolerance!r}; allowed: a number more than 0, rad per unit of error growth")
    inside = data.time <= scene.duration * (1.0 + _ROUNDING)
    cut = replace(data, time=data.time[inside], values=data.values[inside])
    # At the times of the data and at the scene's samples, which make growth and horizon the same for all data.
    end = max(scene.duration, float(cut.time[-1])) if len(cut.time) else scene.duration
    times = np.union1d(np.append(cut.time, end), np.linspace(0.0, scene.duration, scene.samples))
    exact = reference_at(replace(scene, duration=end, samples=len(times), outputs=("angles", "rates")), times)
    run = exact.trajectory
    place: NDArray[np.int64] = np.searchsorted(run.time, cut.time)
    place = place[place < len(run.time)]
    if not len(place):
        raise InputError(f"{data.source}: no row within the {scene.duration:g} s of {scene.name}; allowed: times in s")
    carried = carried_errors(run, exact.growth, exact.units)[place][:, data.columns]
    at_rows = Trajectory(run.time[place], run.angles[place], run.rates[place], error_growth=run.error_growth[place])
    expected = states_of(at_rows)[:, cut.columns]
    # Wrapped channels with as many turns as the reference has in the first row.
    turns = 2.0 * np.pi * np.round((expected[0] - cut.values[0]) / (2.0 * np.pi))
    cut = replace(cut, values=np.where(cut.wrapped, cut.values + turns, cut.values))
    rows, horizon_s, until = len(place), horizon(run), len(place)
    if horizon_samples(run) < len(run.time):
        until = int(np.searchsorted(at_rows.time, horizon_s, side="right"))
    compared = replace(cut, time=cut.time[:rows], values=cut.values[:rows])
    errors = _channel_errors(compared, at_rows, run, carried, max(until, 1))
    data_run = _as_run(scene, compared, at_rows, tolerance)
    status, message, metrics = "unchecked", "a single row", {}
    if rows > 1:
        judgement = judge(data_run.scene, data_run, at_rows)
        status, message, metrics = judgement.status, judgement.message, judgement.metrics
    worst = max(errors, key=lambda channel: channel.error_per_growth)
    if not worst.error_per_growth <= tolerance:
        status, message = "inaccurate", (
            f"{worst.name}: error {worst.error_max:.1e} {worst.unit} up to the horizon, "
            f"{worst.error_per_growth:.1e} per unit of error growth, allowed {tolerance:.0e}"
        )  # fmt: skip
    if status in ("ok", "unchecked"):
        status, message = _uncovered(scene, compared, exact, until) or (status, message)
    notes = _notes(scene, data, cut, data_run, tolerance)
    likely: list[str] = []
    if status != "ok":
        ends = monotonic() + _SEARCH_S
        whole = replace(data, values=data.values + (cut.values[0] - data.values[0]))  # the turns that `cut` has
        search = CauseSearch(scene, whole, exact, tolerance, max(error.error_per_growth for error in errors), ends)
        with np.errstate(over="ignore", invalid="ignore"):  # data may be of any size
            likely, note = likely_causes(search)
        start = "" if likely else _other_start(scene, cut, expected[0])
        notes += [line for line in (note, start) if line]
    verdict = DataVerdict(
        scene.name, data.source, status, message, tolerance, errors, rows, float(at_rows.time[-1]), horizon_s,
        metrics.get("energy_drift_max"), data.read, data.unused, tuple(notes), tuple(likely),
    )  # fmt: skip
    return DataStudy(scene, cut, expected, carried, verdict)


def _channel_errors(
    data: ForeignData, reference: Trajectory, whole: Trajectory, carried: Array, until: int
) -> tuple[ChannelErrors, ...]:
    """The errors of every channel; until: rows up to the horizon; whole: the reference at more times than those."""
    time, expected = reference.time, states_of(reference)[:, data.columns]
    # Time derivatives; of rates by differences.
    accelerations = np.gradient(whole.rates, whole.time, axis=0) if len(whole.time) > 1 else 0.0 * whole.rates
    slopes = np.hstack([whole.rates, accelerations])[np.searchsorted(whole.time, time)][:, data.columns]
    errors = []
    for j, channel in enumerate(data.channels):
        error = np.abs(data.values[:, j] - expected[:, j])
        agrees_until = []
        for level in LEVELS:
            beyond = np.flatnonzero(~(error <= level))
            last = int(beyond[0]) - 1 if len(beyond) else len(time) - 1
            agrees_until.append(float(time[last]) if last >= 0 else float("nan"))
        # Linear least squares, each row by its weight; what a channel cannot show is 0 or 1.
        weight = carried[:until, j]
        columns = np.stack([-slopes[:until, j], expected[:until, j], np.ones(until)], axis=1) / weight[:, None]
        sizes = np.linalg.norm(columns, axis=0)
        sizes[sizes == 0.0] = 1.0
        difference = (data.values[:until, j] - expected[:until, j]) / weight
        lag, scale, offset = np.linalg.lstsq(columns / sizes, difference, rcond=1e-9)[0] / sizes
        errors.append(
            ChannelErrors(
                channel.name, channel.unit, float(error[:until].max()), float(error.max()),
                float((error / carried[:, j])[:until].max()), tuple(agrees_until),
                float(lag), 1.0 + float(scale), float(offset),
            )
        )  # fmt: skip
    return tuple(errors)


def _as_run(scene: Scene, data: ForeignData, reference: Trajectory, tolerance: float) -> Solution:
    """The data as a run that can be judged; channels that they lack are the reference's and so add no error."""
    states = states_of(reference).copy()
    states[:, data.columns] = data.values
    count = states.shape[1] // 2
    scene = replace(scene, duration=float(data.time[-1]), samples=len(data.time), outputs=("angles", "rates"))
    with_energy = replace(scene, outputs=("angles", "rates", "energy"))
    trajectory = Trajectory(data.time, states[:, :count], states[:, count:])
    if set(data.columns) == set(range(2 * count)) and not work_is_integrated(with_energy):
        moving = scene.moving_coordinates
        columns = [*moving, *(count + i for i in moving)]
        scene = with_energy
        trajectory.quantities |= samples.trajectory(scene, data.time, states[:, columns]).quantities
    bounds = (
        Bound("defect", METHOD, tolerance, "as asked for"),
        Bound("energy", METHOD, _ENERGY_PER_ANGLE * tolerance, "what an error of the tolerance does to the energy"),
    )
    return Solution(scene, METHOD, trajectory, Integration(True), bounds=bounds)


def _uncovered(scene: Scene, data: ForeignData, exact: TimedReference, until: int) -> tuple[str, str] | None:
    """What the rows leave out of the motion, which is then not ok: its start, its end, or all but a row of it."""
    time, end = data.time, min(scene.duration, float(exact.trajectory.time[-1]))
    step = float(np.diff(time).max(initial=0.0))
    if time[-1] < end - 1.5 * step:
        return "inaccurate", f"the data end at t = {time[-1]:.6g} s of {end:g} s: the rest is not known"
    if time[0] > 1.5 * step:
        return "inaccurate", f"the data begin at t = {time[0]:.6g} s: what was before is not known"
    if until < _FEWEST:
        return "unchecked", f"{until} rows up to the horizon: too few to be compared"
    return None


def _other_start(scene: Scene, data: ForeignData, expected: Array) -> str:
    """What of the first row is not the scene's start, "" where all is, or the data begin later."""
    names = [channel.name for channel in channels(scene)[1:]]
    rows = zip(data.columns, data.values[0].tolist(), expected.tolist(), strict=True)
    apart = [f"{names[i]} {value:.4g} (scene: {start:.4g})" for i, value, start in rows if abs(value - start) > _START]
    if data.time[0] > 0.0 or not apart:
        return ""
    return f"the data start elsewhere, in rad and rad/s: {', '.join(apart)}; another scene, start or unit?"


def _notes(scene: Scene, whole: ForeignData, data: ForeignData, run: Solution, tolerance: float) -> list[str]:
    notes = []
    if len(whole.time) > len(data.time):
        notes.append(f"{len(whole.time) - len(data.time)} rows after the scene's {scene.duration:g} s are not compared")
    if 1 < data.digits <= -math.log10(tolerance):
        rounding = 0.5 * 10.0 ** (1 - data.digits)
        notes.append(f"numbers of {data.digits} digits: their rounding alone is {rounding:.0e} of their size")
    missing = [label for i, label in enumerate(scene.coordinate_labels) if i not in data.columns]
    if missing:
        notes.append(f"no angle of: {', '.join(missing)}")
    if "energy" not in run.scene.outputs:
        reason = "not all angles and rates are given" if missing or len(data.columns) < 2 * len(
            scene.coordinate_labels
        ) else "the work of dampers or of loads that change is not known"  # fmt: skip
        notes.append(f"no energy balance: {reason}")
    return notes
