"""A chunk of a sweep's runs in a worker process: from parameters to rows, and into the file where it sees the file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
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
from rotor_mbs.runs.sweep_columns import AMPLIFICATION, MESSAGE_BYTES, METRICS, Rows, RunColumns
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.toml_file import TableError
from rotor_mbs.scenario.variants import Variants
from rotor_mbs.solution.judgement import clearly_ok, judge
from rotor_mbs.solution.metrics import energy_drifts, horizon, largest, running_growth
from rotor_mbs.solution.quantities import energy_balance, quantities
from rotor_mbs.solution.solution import Solution
from rotor_mbs.solution.status import code_of
from rotor_mbs.solution.trajectory import Array, Integration, RunBlock, Trajectory

_SIDE_BY_SIDE = ("", "angles", "rates", "tip", "energy")  # outputs that every `Method.solve_many` computes


@dataclass(frozen=True)
class Chunk:
    """Runs first ... first + len(values) - 1 by one method.

    values        (runs, keys) the varied numbers
    row           the type of a stored row
    time_limit_s  of one run
    columns       where the rows are to be written; None where they are to be returned
    """

    variants: Variants
    method: str
    settings: Mapping[str, object]
    row: np.dtype[np.void]
    first: int
    values: NDArray[np.float64]
    time_limit_s: float
    columns: RunColumns | None = None

    @property
    def last(self) -> int:
        """The run after its last one."""
        return self.first + len(self.values)

    def split(self) -> list[Chunk]:
        """Its runs one by one; [] where it is one run."""
        return [self.part(i, i + 1) for i in range(len(self.values))] if len(self.values) > 1 else []

    def part(self, start: int, end: int) -> Chunk:
        return replace(self, first=self.first + start, values=self.values[start:end])


def prepare() -> None:
    """Loads, with this module, the fast path's engine where it is installed."""
    is_available()


def perform(chunk: Chunk) -> Rows | NDArray[np.int8]:
    """Computes the runs; returns their rows, or their statuses where the rows have been written.

    Raises InputError, MethodRefusal, StoreError; a run's own failure is in its row.
    """
    rows = rows_of(chunk)
    rows["time_limit_s"][rows["status"] == code_of("timed_out")] = chunk.time_limit_s
    return rows if chunk.columns is None else chunk.columns.write(chunk.first, rows)


def rows_of(chunk: Chunk) -> Rows:
    """(runs, ...) columns of all its runs. Raises InputError, MethodRefusal; a run's failure is in its row."""
    scenes = _scenes(chunk)
    if find_method(chunk.method).solve_many is not None and _has_all_of(scenes[0].outputs):
        rows = _side_by_side(chunk, scenes)
    else:
        rows = empty_rows(len(scenes), chunk.row)
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


def empty_rows(count: int, row: np.dtype[np.void], names: Iterable[str] | None = None) -> Rows:
    """Runs that left nothing: NaN, -1 and no text. `names`: these columns only."""
    blank = {"f": np.nan, "i": -1, "u": 0}
    kinds = {name: row[name] for name in names or row.names or ()}
    return {name: np.full((count, *kind.shape), blank[kind.base.kind], kind.base) for name, kind in kinds.items()}


def put_end(rows: Rows, runs: int | slice, status: str, message: str) -> None:
    """How these runs ended."""
    text = message.encode()[:MESSAGE_BYTES].ljust(MESSAGE_BYTES, b"\0")
    rows["status"][runs], rows["message"][runs] = code_of(status), np.frombuffer(text, np.uint8)


def lost_rows(count: int, row: np.dtype[np.void], status: str, message: str) -> Rows:
    """Of runs whose process died, or was ended."""
    rows = empty_rows(count, row)
    put_end(rows, slice(None), status, message)
    rows["time_reached"][:] = 0.0
    return rows


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
    rows = empty_rows(len(scenes), chunk.row, (METRICS | AMPLIFICATION).keys() & set(chunk.row.names or ()))
    for name in chunk.row.names or ():
        if name not in rows:
            values = errors if name == "energy_error" else _quantity(block, scenes, method, name)
            rows[name] = np.ascontiguousarray(values, chunk.row[name].base)
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
