"""A chunk of a sweep's runs in a worker process: from parameters to rows, and into the file where it sees the file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError
from rotor_mbs.methods.base import Method
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.solve import solve
from rotor_mbs.methods.time_limit import OutOfTimeError
from rotor_mbs.models.lagrange.heyoka_adapter import is_available
from rotor_mbs.models.lagrange.reference import error_growth
from rotor_mbs.runs.runner import Task
from rotor_mbs.runs.sweeps import AMPLIFICATION, METRICS
from rotor_mbs.runs.table import Rows, blank_rows, characters
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.sweep import Variants
from rotor_mbs.scenario.toml_file import TableError
from rotor_mbs.solution.judgement import clearly_ok, judge
from rotor_mbs.solution.metrics import energy_drifts, horizon, largest, running_growth
from rotor_mbs.solution.quantities import energy_balance, quantities
from rotor_mbs.solution.solution import Solution
from rotor_mbs.solution.status import code_of
from rotor_mbs.solution.trajectory import Array, Integration, RunBlock, Trajectory

_SIDE_BY_SIDE = ("", "angles", "rates", "tip", "energy")  # outputs that every `Method.solve_many` computes
_GRACE_S = 5.0  # in which a run that ends itself at its limit stores what it reached


@dataclass(frozen=True, kw_only=True)
class Chunk(Task):
    """Runs by one method, the first of them number `start`.

    Attributes
    ----------
    values : (runs, keys) the varied numbers.
    code : of the versions that compute them, stored with each.
    time_limit_s : of one run.
    """

    start: int
    values: NDArray[np.float64]
    variants: Variants
    settings: Mapping[str, object]
    time_limit_s: float
    code: int

    @property
    def first(self) -> int:
        return self.start

    def split(self) -> list[Chunk]:
        """Its runs one by one; [] where it is one run."""
        return [self.part(i, i + 1) for i in range(len(self.values))] if len(self.values) > 1 else []

    def part(self, start: int, end: int) -> Chunk:
        """Some of its runs."""
        values = self.values[start:end]
        kill_after_s = limit_of(len(values), self.time_limit_s)
        return replace(self, start=self.start + start, values=values, kill_after_s=kill_after_s)

    def failed(self, status: str, message: str) -> Rows:
        """The rows of runs whose process was ended, or that raised."""
        rows = blank_rows(len(self.values), self.place.row)
        put_end(rows, slice(None), status, message)
        rows["time_reached"][:], rows["code"][:] = 0.0, self.code
        rows["time_limit_s"][:] = self.time_limit_s if status == "timed_out" else np.nan
        return rows


def limit_of(runs: int, time_limit_s: float) -> float:
    """When the worker of so many runs is ended: a method may compute them one after the other."""
    return time_limit_s * runs + _GRACE_S


def prepare() -> None:
    """Loads, with this module, the fast path's engine where it is installed."""
    is_available()


def perform(chunk: Chunk) -> Rows:
    """(runs, ...) columns of all runs of a chunk.

    Raises
    ------
    InputError, MethodRefusal
        A run's own failure is in its row.
    """
    rows = rows_of(chunk)
    rows["time_limit_s"][rows["status"] == code_of("timed_out")] = chunk.time_limit_s
    rows["code"][:] = chunk.code
    return rows


def rows_of(chunk: Chunk) -> Rows:
    """(runs, ...) columns of all its runs. Raises InputError, MethodRefusal; a run's failure is in its row."""
    scenes = _scenes(chunk)
    if find_method(chunk.method).solve_many is not None and _has_all_of(scenes[0].outputs):
        rows = _side_by_side(chunk, scenes)
    else:
        rows = blank_rows(len(scenes), chunk.place.row)
        for i, scene in enumerate(scenes):
            try:
                run = solve(chunk.method, scene, chunk.settings, time_limit_s=chunk.time_limit_s)
            except OutOfTimeError as exc:
                put_end(rows, i, "timed_out", str(exc))
                rows["time_reached"][i] = 0.0
            else:
                _put_run(rows, i, scene, run)
    if "error_growth" in rows:
        for i, scene in enumerate(scenes):
            _put_amplification(rows, i, scene)
    return rows


def put_end(rows: Rows, runs: int | slice, status: str, message: str) -> None:
    """How these runs ended."""
    rows["status"][runs], rows["message"][runs] = code_of(status), characters(message, rows["message"].shape[1])


def _put_amplification(rows: Rows, i: int, scene: Scene) -> None:
    """Adds the motion's error amplification, from the variational equations of the closed form, whatever the method."""
    angles = np.empty((scene.samples, 0))
    time = np.linspace(0.0, scene.duration, scene.samples)
    motion = Trajectory(time, angles, angles, error_growth=error_growth(scene))
    rows["error_growth"][i], rows["horizon_s"][i] = running_growth(motion)[-1], horizon(motion)


def _has_all_of(outputs: Sequence[str]) -> bool:
    """Whether runs side by side have what is asked for, or it follows from their samples."""
    return all(one.output in _SIDE_BY_SIDE or one.producer or not one.required for one in quantities(outputs))


def _scenes(chunk: Chunk) -> list[Scene]:
    try:
        return [chunk.variants.scene(values) for values in chunk.values.tolist()]
    except TableError as error:
        keys = ", ".join(chunk.variants.keys)
        last = chunk.first + len(chunk.values) - 1
        raise InputError(f"runs {chunk.first} to {last}: {keys}: {error}") from error


def _put_run(rows: Rows, i: int, scene: Scene, run: Solution) -> None:
    _put_verdict(rows, i, scene, run)
    trajectory = run.trajectory
    n = len(trajectory.time)
    for name, values in run.quantities.items():
        if name in rows:
            rows[name][i, :n] = values
    _put_extremes(rows, slice(i, i + 1), trajectory.angles[None], trajectory.rates[None])
    _put_effort(rows, i, run.integration, float(trajectory.time[-1]) if n else 0.0)


def _put_verdict(rows: Rows, i: int, scene: Scene, run: Solution) -> None:
    verdict = judge(scene, run, None)
    put_end(rows, i, verdict.status, verdict.message)
    rows["energy_drift_max"][i] = verdict.metrics.get("energy_drift_max", np.nan)


def _put_effort(rows: Rows, i: int, integration: Integration, time_reached: float) -> None:
    rows["time_reached"][i] = time_reached
    rows["steps"][i] = -1 if integration.steps is None else integration.steps
    rows["rhs_evaluations"][i] = -1 if integration.rhs_evaluations is None else integration.rhs_evaluations


def _put_extremes(rows: Rows, runs: slice, angles: Array, rates: Array) -> None:
    rows["rotor_angle_max"][runs] = largest(angles[:, :, 0])
    rows["rotor_rate_max"][runs] = largest(rates[:, :, 0])
    rows["pitch_max"][runs] = np.max([largest(angles[:, :, i]) for i in range(1, angles.shape[2])], axis=0)


def _side_by_side(chunk: Chunk, scenes: Sequence[Scene]) -> Rows:
    method = find_method(chunk.method)
    assert method.solve_many is not None
    settings = method.settings.of(chunk.method, chunk.settings)
    block = method.solve_many(scenes, settings)
    found = block.quantities
    kinetic, work = found["kinetic_energy"], found["work"]  # which a sweep's scenes ask for
    errors = energy_balance(kinetic, found["potential_energy"], work)
    drifts = energy_drifts(scenes, kinetic, work, errors)
    angles = largest(found["angles"].reshape(len(scenes), -1))
    ok = clearly_ok(scenes, method.name, block.integrations, block.samples, drifts, angles, method.bounds)
    row = chunk.place.row
    metrics = np.dtype([(name, row[name]) for name in row.names or () if name in METRICS | AMPLIFICATION])
    rows = blank_rows(len(scenes), metrics)
    for name in row.names or ():
        if name not in rows:
            values = errors if name == "energy_error" else _quantity(block, scenes, method, name)
            rows[name] = np.ascontiguousarray(values, row[name].base)
    rows["status"][ok] = code_of("ok")
    rows["energy_drift_max"] = drifts
    _put_extremes(rows, slice(None), found["angles"], found["rates"])
    for i, integration in enumerate(block.integrations):
        _put_effort(rows, i, integration, integration.time_reached)
    for i in np.flatnonzero(~ok).tolist():
        run = Solution(scenes[i], method.name, block.trajectory(i), block.integrations[i], settings.as_dict())
        run.is_corrected, run.bounds = method.is_corrected, method.bounds
        _put_verdict(rows, i, scenes[i], run)
    return rows


def _quantity(block: RunBlock, scenes: Sequence[Scene], method: Method, name: str) -> Array:
    """(runs, samples, ...) of a quantity: the block's own, or its producer's of each run; NaN after a run broke off."""
    values: Array | None = block.quantities.get(name)
    if values is None:
        runs = enumerate(scenes)
        made = [Solution(scene, method.name, block.trajectory(i), block.integrations[i])[name] for i, scene in runs]
        values = np.full((len(scenes), scenes[0].samples, *made[0].shape[1:]), np.nan)
        for row, found in zip(values, made, strict=True):
            row[: len(found)] = found
    return values
