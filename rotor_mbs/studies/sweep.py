"""Sweeps: the runs of a parameter study, computed into one dataset.

A sweep can be divided into parts, which are computed on different computers. Each part is divided
into chunks of runs, and each chunk is the task of one worker process.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.analysis.judgement import clearly_ok, defects_of, judge
from rotor_mbs.errors import InputError, MethodRefusal
from rotor_mbs.methods.base import checked_result
from rotor_mbs.methods.catalogue import (
    check_names,
    default_method,
    find_method,
    is_corrected,
)
from rotor_mbs.methods.selection import Refusal, settings_for, supporting_methods
from rotor_mbs.methods.solve import solve
from rotor_mbs.methods.time_limit import OutOfTimeError, caller_signals, time_limit
from rotor_mbs.models.lagrange.reference import error_growth
from rotor_mbs.processes.pool import TaskPool
from rotor_mbs.runs.design import COLUMNS, MISSING
from rotor_mbs.runs.hdf5 import TableSpec
from rotor_mbs.runs.layout import KEYWORDS
from rotor_mbs.runs.rows import RowLocation, Rows, blank_rows, row_of_run
from rotor_mbs.runs.runner import Task, run_tasks
from rotor_mbs.runs.sweeps import code_of_method, open_sweep, sweep_table
from rotor_mbs.runs.table import IDENTITY
from rotor_mbs.runs.versions import machine, versions
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.scenario.sweep import Sweep, Variants
from rotor_mbs.scenario.toml_file import TableError
from rotor_mbs.solution.metrics import (
    Metrics,
    defect_metrics,
    energy_drifts,
    extremes,
    horizon,
    largest,
    running_growth,
)
from rotor_mbs.solution.quantities import energy_balance, quantities
from rotor_mbs.solution.status import REFUSED, STATUSES, code_of
from rotor_mbs.solution.trajectory import Array, RunBlock, Solution, Trajectory

# Entries of a scene's `outputs` whose quantities every `Method.solve_many` computes. The entry ""
# has the quantities that no scene requests by name.
_SIDE_BY_SIDE = ("", "angles", "rates", "tip", "energy")
_OF_DEFECTS = ("defect_max", "defect_median", "defect_time", "angle_error_predicted")
_GRACE_S = 5.0  # time in which a run that reached its time limit ends itself and stores its row


@dataclass(frozen=True, kw_only=True)
class Chunk(Task):
    """Compute runs of a sweep by one method, in a worker process.

    Attributes
    ----------
    values : (runs, keys) varied numbers.
    variants : builds the scene of a run from its row of `values`.
    settings : settings of the method.
    time_limit_s : time limit of each run, s.
    code : checksum of the versions that compute the runs, stored with each run.
    with_defects : whether runs that are computed side by side are checked by their defects, too,
        not by their energy alone.
    """

    values: NDArray[np.float64]
    variants: Variants
    settings: Mapping[str, object]
    time_limit_s: float
    code: int
    with_defects: bool = False

    def perform(self) -> Rows:
        """Compute all runs of the chunk, and return their columns, (runs, ...) each.

        A run that fails has a row, too, with its status and the reason.

        Raises
        ------
        InputError
            If the varied values of a run do not make a valid scene.
        MethodRefusal
            If the method cannot represent a scene.
        """
        try:
            scenes = [self.variants.scene(values) for values in self.values.tolist()]
        except TableError as error:
            keys, last = ", ".join(self.variants.keys), self.first + len(self.values) - 1
            raise InputError(f"runs {self.first} to {last}: {keys}: {error}") from error
        # Runs can be computed side by side if every requested quantity is computed by `solve_many`,
        # follows from the samples, or is optional.
        asked = quantities(scenes[0].outputs)
        is_there = all(
            known.output in _SIDE_BY_SIDE or known.producer or not known.required for known in asked
        )
        if is_there and find_method(self.method).solve_many is not None:
            rows = _side_by_side(self, scenes)
        else:
            each = []
            for i, scene in enumerate(scenes):
                try:
                    run = solve(self.method, scene, self.settings, time_limit_s=self.time_limit_s)
                    each.append(_judged_row(self, run))
                except OutOfTimeError as exc:
                    each.append(self.part(i, i + 1).failed("timed_out", str(exc)))
            rows = {name: np.concatenate([row[name] for row in each]) for name in each[0]}
        # The error growth is a property of the scene. For every method it is computed by the closed
        # form, from its variational equations.
        if "error_growth" in rows:
            for i, scene in enumerate(scenes):
                angles = np.empty((scene.samples, 0))
                time = np.linspace(0.0, scene.duration, scene.samples)
                motion = Trajectory(time, angles, angles, error_growth=error_growth(scene))
                rows["error_growth"][i], rows["horizon_s"][i] = (
                    running_growth(motion)[-1],
                    horizon(motion),
                )
        rows["time_limit_s"][rows["status"] == code_of("timed_out")] = self.time_limit_s
        rows["code"][:] = self.code
        return rows

    def split(self) -> list[Chunk]:
        """Return a chunk for each run; an empty list if this chunk has only one run."""
        return (
            [self.part(i, i + 1) for i in range(len(self.values))] if len(self.values) > 1 else []
        )

    def part(self, start: int, end: int) -> Chunk:
        """Return a chunk with the runs start <= i < end of this chunk."""
        values = self.values[start:end]
        kill_after_s = limit_of(len(values), self.time_limit_s)
        return replace(self, place=self.place.at(start), values=values, kill_after_s=kill_after_s)

    def failed(self, status: str, message: str) -> Rows:
        """Return rows for all runs of the chunk that have a status and a reason, but no values."""
        limit = self.time_limit_s if status == "timed_out" else np.nan
        values = {
            "status": status,
            "message": message,
            "time_reached": 0.0,
            "code": self.code,
            "time_limit_s": limit,
        }
        return self.place.encode(values, len(self.values))


def limit_of(runs: int, time_limit_s: float) -> float:
    """Return the time in s after which the worker process of a chunk is ended.

    It allows for runs that are computed one after the other, and for storing their rows.

    Parameters
    ----------
    runs : number of runs in the chunk.
    time_limit_s : time limit of each run, s.
    """
    return time_limit_s * runs + _GRACE_S


def _judged_row(chunk: Chunk, run: Solution) -> Rows:
    """Judge a run, and return its row.

    Raises
    ------
    OutOfTimeError
        If judging takes longer than the time limit of a run.
    """
    with time_limit(chunk.time_limit_s):
        judgement = judge(run.scene, run, None)
    judged = replace(
        run, status=judgement.status, message=judgement.message, metrics=judgement.metrics
    )
    # Extremes are those of the samples, unless the judgement computes the metric of that name. For
    # the printed equations the judgement takes the rotor's extremes over the integrator's own
    # output points.
    found: Metrics = {}
    for name, values in _extremes(run.angles[None], run.rates[None]).items():
        found[name] = float(values[0])
    found |= {name: value for name, value in judged.metrics.items() if name in found}
    found["rotor_angle_size_max"] = max(-found["rotor_angle_min"], found["rotor_angle_max"])
    return row_of_run(judged, chunk.place, found)


def _extremes(angles: Array, rates: Array) -> dict[str, Array]:
    """Return the extremes of rotor angle, rotor rate and pitch angles of each run, by metric.

    Parameters
    ----------
    angles, rates : (runs, samples, 1 + blades) rad and rad/s, rotor first.
    """
    lows, highs = extremes(angles[:, :, 0])
    pitches = [largest(angles[:, :, i]) for i in range(1, angles.shape[2])]
    return {
        "rotor_angle_min": lows,
        "rotor_angle_max": highs,
        "rotor_angle_size_max": np.maximum(-lows, highs),
        "rotor_rate_max": largest(rates[:, :, 0]),
        "pitch_max": np.max(pitches, axis=0),
    }


def _side_by_side(chunk: Chunk, scenes: Sequence[Scene]) -> Rows:
    """Compute all runs of a chunk at once by `Method.solve_many`, and return their rows.

    If the energy drift of a run (and its defects, if the chunk is to compute them) shows that it is
    ok, the run gets the status ok. Every other run is judged in full, one by one.

    Parameters
    ----------
    chunk : the chunk; its method has `solve_many`.
    scenes : the scene of each run.
    """
    method = find_method(chunk.method)
    assert method.solve_many is not None
    settings = method.settings.of(chunk.method, chunk.settings)
    block = method.solve_many(scenes, settings)
    checked_result(block, RunBlock, "solve_many", method.solve_many, method.name)
    found = block.quantities
    kinetic, work = found["kinetic_energy"], found["work"]  # every scene of a sweep requests them
    errors = energy_balance(kinetic, found["potential_energy"], work)
    drifts = energy_drifts(scenes, kinetic, work, errors)
    angles = largest(found["angles"].reshape(len(scenes), -1))
    # Metrics that decide whether a run is clearly ok. By default only the energy drift decides: the
    # built-in method with `solve_many` integrates the closed form itself, and computing the defects
    # takes ten times as long as the runs.
    of_runs: list[Metrics] = []
    for i, scene in enumerate(scenes):
        defects = defects_of(scene, block.trajectory(i)) if chunk.with_defects else None
        of_defects = {} if defects is None else defect_metrics(defects, None)
        of_runs.append({"energy_drift_max": float(drifts[i]), **of_defects})
    ok = clearly_ok(
        scenes, method.name, block.integrations, block.samples, of_runs, angles, method.bounds
    )
    row = chunk.place.row_type
    metrics = np.dtype([(name, row[name]) for name in row.names or () if name in COLUMNS])
    rows = blank_rows(len(scenes), metrics)
    for name in row.names or ():
        if name not in rows:
            values = errors if name == "energy_error" else block.quantities.get(name)
            # Quantities of other packages are computed run by run. Samples after an early end are
            # NaN.
            if values is None:
                runs = enumerate(scenes)
                made = [
                    Solution(one, method.name, block.trajectory(i), block.integrations[i])[name]
                    for i, one in runs
                ]
                values = np.full((len(scenes), scenes[0].samples, *made[0].shape[1:]), np.nan)
                for run_values, samples in zip(values, made, strict=True):
                    run_values[: len(samples)] = samples
            rows[name] = np.ascontiguousarray(values, row[name].base)
    rows["status"][ok] = code_of("ok")
    for name in ("energy_drift_max", *_OF_DEFECTS):
        rows[name] = np.array([run.get(name, np.nan) for run in of_runs])
    rows |= _extremes(found["angles"], found["rates"])
    for i, integration in enumerate(block.integrations):
        rows["time_reached"][i] = integration.time_reached
        rows["steps"][i] = -1 if integration.steps is None else integration.steps
        rows["rhs_evaluations"][i] = (
            -1 if integration.rhs_evaluations is None else integration.rhs_evaluations
        )
    for i in np.flatnonzero(~ok).tolist():
        run = Solution(
            scenes[i], method.name, block.trajectory(i), block.integrations[i], settings.as_dict()
        )
        try:
            judged = _judged_row(chunk, run)
        except OutOfTimeError as exc:
            judged = chunk.place.encode(
                {"status": "timed_out", "message": f"{exc}, while its samples were assessed"}
            )
            judged |= {name: rows[name][i : i + 1] for name in ("energy_drift_max", *_OF_DEFECTS)}
        for name in ("status", "message", "energy_drift_max", *_OF_DEFECTS):
            rows[name][i] = judged[name][0]
    return rows


# Limits of a chunk whose method computes many runs side by side. The maximum number of runs takes
# the fastest method an eighth of a second. The number of runs is a multiple of the minimum, which
# fills the vector lanes of any processor. The last limit is the size of the chunk's rows in bytes.
_MAX_RUNS = 128
_MIN_RUNS = 8
_CHUNK_BYTES = 1 << 23


# Function that is called with the number of runs stored so far, the number of runs of the plan, and
# the counts by status of the runs that have just ended.
OnProgress = Callable[[int, int, Counter[str]], None]


@dataclass(frozen=True)
class SweepPlan:
    """Hold the runs with the numbers first <= r < last of a sweep.

    Run r is row r mod `rows` of the design, by method number r div `rows`.

    Attributes
    ----------
    sweep, methods : the sweep, and the names of the methods that can represent its base scene.
    settings : by method, those settings of the sweep that the method has.
    first, last : number of the first run, and of the run after the last.
    time_limit_s : time limit of each run, s.
    refused : the methods that were left out.
    """

    sweep: Sweep
    methods: tuple[str, ...]
    settings: Mapping[str, Mapping[str, object]]
    first: int
    last: int
    time_limit_s: float
    refused: tuple[Refusal, ...] = ()

    @property
    def runs(self) -> int:
        """Return the number of runs of the plan."""
        return self.last - self.first

    @property
    def rows(self) -> int:
        """Return the number of rows of the design: runs of the whole sweep by each method."""
        return self.sweep.design.count

    def table(self) -> TableSpec:
        """Return the specification of the table that holds the runs of the plan."""
        return sweep_table(self.sweep, self.methods, range(self.first, self.last))

    def chunks(
        self, place: RowLocation, gaps: Sequence[tuple[int, int]], workers: int = 1
    ) -> Iterator[Chunk]:
        """Divide the missing runs into chunks, each by one method, and yield the chunks.

        Chunks become smaller towards the end, so that all workers end at about the same time.

        Parameters
        ----------
        place : location of the plan's first run in the file.
        gaps : (first, last) numbers of missing runs; `last` is the run after the last one.
        workers : number of processes among which the runs are shared.

        Raises
        ------
        TableError
            If the values of the first missing run do not make a valid scene.
        """
        variants, design = self.sweep.variants(), self.sweep.design
        for first, _ in gaps[:1]:
            variants.scene(design.rows(first, first + 1)[0].tolist())
        left = sum(last - first for first, last in gaps)
        for first, last in gaps:
            while first < last:
                number = first // self.rows
                method, size = find_method(self.methods[number]), 1
                if method.solve_many is not None:
                    most = min(
                        _CHUNK_BYTES // place.row_type.itemsize, left // (2 * workers), _MAX_RUNS
                    )
                    size = max(most // _MIN_RUNS, 1) * _MIN_RUNS
                end = min(first + size, last, (number + 1) * self.rows)
                values, settings = design.rows(first, end), self.settings[method.name]
                code = code_of_method(method.name)
                yield Chunk(
                    label=f"runs {first} to {end - 1}",
                    method=method.name,
                    place=place.at(first - self.first),
                    kill_after_s=limit_of(end - first, self.time_limit_s),
                    values=values,
                    variants=variants,
                    settings=settings,
                    time_limit_s=self.time_limit_s,
                    code=code,
                    with_defects=self.sweep.design.defects,
                )
                first, left = end, left - (end - first)

    def attributes(self) -> dict[str, object]:
        """Return the attributes of the sweep's file, by name.

        The digest under IDENTITY covers everything that determines the runs and their arrays.
        """
        sweep, table = self.sweep, self.sweep.design
        options = [
            table.combine,
            table.settings,
            table.precision,
            table.error_growth,
            table.defects,
            table.seed,
        ]
        axes = [(axis.key, axis.is_drawn) for axis in sweep.design.axes]
        runs = [self.methods, self.first, self.last, table.validation, table.test]
        content = [scene_hash(sweep.base), sweep.outputs, axes, options, runs]
        identity = hashlib.sha256(json.dumps(content, sort_keys=True).encode())
        for values in sweep.design.values:
            identity.update(values.tobytes())
        return {
            "title": table.title,
            "summary": (
                f"{self.runs} runs of {sweep.base.name} with {', '.join(self.methods)}; varied: "
                f"{', '.join(sweep.keys)}"
            ),
            "keywords": KEYWORDS,
            "sweep_toml": sweep.file.text,
            "base_scene": sweep.base.name,
            "scene_toml": sweep.base.text,
            "scene_hash": scene_hash(sweep.base),
            "combine": table.combine,
            "shape": json.dumps(sweep.design.shape),
            "seed": table.seed,
            "validation_share": table.validation,
            "test_share": table.test,
            "settings": json.dumps(table.settings, sort_keys=True),
            "runs_of_all_parts": self.rows * len(self.methods),
            IDENTITY: identity.hexdigest(),
            "methods": list(self.methods),
            "runs": self.runs,
            "parameter_keys": list(sweep.keys),
            **versions(),
            **machine(),
        }


def plan_sweep(
    sweep: Sweep,
    methods: Sequence[str] = (),
    part: tuple[int, int] = (1, 1),
    time_limit_s: float = 60.0,
) -> SweepPlan:
    """Return the plan of a part of a sweep.

    Methods that cannot represent the base scene of the sweep are left out.

    Parameters
    ----------
    sweep : the sweep, as read from its file.
    methods : names of methods; if empty, those of the sweep's file; if it has none, the default
        method.
    part : (k, n) for part k of n, k from 1.
    time_limit_s : time limit of a run in s.

    Raises
    ------
    InputError
        If a method is unknown, or no method has one of the settings.
    MethodRefusal
        If all methods refuse the base scene.
    """
    named = check_names(methods or sweep.design.methods or default_method())
    with sweep.file.with_line_numbers("settings"):
        settings = settings_for(named, sweep.design.settings)
    able, refused = supporting_methods(sweep.base, named, sweep.design.settings)
    if not able:
        raise MethodRefusal("\n".join(map(str, refused)))
    chosen = tuple(able)
    total = sweep.design.count * len(chosen)
    number, parts = part
    first, last = (number - 1) * total // parts, number * total // parts
    return SweepPlan(sweep, chosen, settings, first, last, time_limit_s, tuple(refused))


@dataclass(frozen=True)
class SweepResult:
    """Hold the outcome of a call that computes the missing runs of a sweep.

    Afterwards all runs of the plan are stored, except those that were lost or refused.

    Attributes
    ----------
    path : path of the dataset.
    runs, made : number of runs of the plan, and of those computed by this call.
    statuses : number of stored runs with each status.
    seconds : duration of this call, s.
    is_ok : whether nothing was refused, and every run of a method with the corrected equations is
        ok.
    lost : a line for each run that is not stored because its process died or could not start, also
        when the run was tried alone.
    older : number of stored runs that were computed by other versions.
    refused : a line for each method and reason. The method cannot represent the base scene, or the
        scenes of some runs, which are not stored.
    """

    path: Path
    runs: int
    made: int
    statuses: Counter[str]
    seconds: float
    is_ok: bool
    lost: tuple[str, ...] = ()
    older: int = 0
    refused: tuple[str, ...] = ()


@caller_signals()
def run_sweep(
    plan: SweepPlan,
    output: Path,
    pool: TaskPool,
    on_progress: OnProgress = lambda *_: None,
    *,
    fresh: bool = False,
) -> SweepResult:
    """Compute the runs of a plan that a dataset lacks, and store them in it.

    After an interruption, a repeated call continues with the runs that are still missing.

    Parameters
    ----------
    plan : the plan of the runs.
    output : path of the dataset; it is created if it does not exist.
    pool : pool of worker processes.
    on_progress : called once with the number of runs that are already stored, then after each
        chunk.
    fresh : whether runs that are already stored are computed again.

    Raises
    ------
    InputError, MethodRefusal
        If the sweep cannot be computed, or `output` is not a dataset of this sweep.
    StoreError
        If `output` cannot be written; runs that are stored already remain.
    """
    start = time.monotonic()
    opened = open_sweep(output, plan.table(), plan.attributes(), plan.time_limit_s, fresh=fresh)
    with opened as (stored, statuses):
        place = stored.place()
        missing, lost = int((statuses == MISSING).sum()), list[str]()
        refused: dict[tuple[str, str], list[int]] = {}  # runs by method and reason
        done = plan.runs - missing
        now = np.array([code_of_method(name) for name in plan.methods], np.uint32)
        is_older = stored.column("code") != now[np.arange(plan.first, plan.last) // plan.rows]
        older = int((is_older & (statuses != MISSING)).sum())
        on_progress(done, plan.runs, Counter())
        # The first number of every span of missing runs, and the number after its last one.
        edges = plan.first + np.flatnonzero(
            np.diff(statuses == MISSING, prepend=False, append=False)
        )
        gaps = [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]
        for end in run_tasks(pool, plan.chunks(place, gaps, pool.workers)):
            chunk = end.task
            assert isinstance(chunk, Chunk)
            if end.value is None:  # the runs have no rows, and stay missing
                runs = range(chunk.first, chunk.first + len(chunk.values))
                if end.failure == REFUSED:
                    refused.setdefault((chunk.method, end.message), []).extend(runs)
                else:
                    lost += [f"run {run}: {end.message}" for run in runs]
                on_progress(done, plan.runs, Counter({end.failure: len(chunk.values)}))
                continue
            made = end.value["status"]
            statuses[chunk.first - plan.first : chunk.first - plan.first + len(made)] = made
            done += len(made)
            on_progress(done, plan.runs, _counted(made))
        seconds = time.monotonic() - start
        computed = missing - len(lost) - sum(map(len, refused.values()))
        lines = [str(refusal) for refusal in plan.refused]
        for (method, reason), numbers in refused.items():
            which = f"run {numbers[0]}"
            if len(numbers) > 1:
                which = f"{len(numbers)} runs ({min(numbers)} to {max(numbers)})"
            lines.append(str(Refusal(which, method, reason)))
        failed = np.unique((np.flatnonzero(statuses != code_of("ok")) + plan.first) // plan.rows)
        is_ok = not lines and not any(is_corrected(plan.methods[number]) for number in failed)
        counts = _counted(statuses)
        return SweepResult(
            place.path,
            plan.runs,
            computed,
            counts,
            seconds,
            is_ok,
            tuple(lost),
            older,
            tuple(lines),
        )


def _counted(statuses: NDArray[np.int8]) -> Counter[str]:
    """Return the number of runs with each status; missing runs are not counted."""
    return Counter(STATUSES[code] for code in statuses.tolist() if code != MISSING)
