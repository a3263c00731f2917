"""A chunk of a sweep's runs, from parameters to rows, in a worker process; and where it shares the disk, to their
places in the file. What counts as stored, the parent says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.solve import solve
from rotor_mbs.methods.time_limit import OutOfTimeError, time_limit
from rotor_mbs.models.lagrange.heyoka_adapter import is_available
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.toml_file import TableError
from rotor_mbs.scenario.variants import Variants
from rotor_mbs.solution.batch_metrics import clearly_ok, energy_drifts, energy_errors, largest
from rotor_mbs.solution.judgement import judge
from rotor_mbs.solution.record import Array, Integration
from rotor_mbs.solution.solution import Solution
from rotor_mbs.store.sweep_layout import MESSAGE_BYTES, METRICS_AND_MESSAGE, SWEEP_STATUSES, empty_rows
from rotor_mbs.store.sweep_rows import MESSAGE, Places, Receipt, Rows

ENSEMBLE_METHOD = "lagrange/taylor"


@dataclass(frozen=True)
class Chunk:
    """Runs first ... first + len(values) - 1 by one method.

    values        (runs, keys) the varied numbers
    row           the type of a stored row
    time_limit_s  of one run
    places        where the rows are to be put; None where they are to be returned
    """

    variants: Variants
    method: str
    settings: Mapping[str, float]
    row: np.dtype[np.void]
    first: int
    values: NDArray[np.float64]
    time_limit_s: float
    places: Places | None = None

    @property
    def last(self) -> int:
        """The run after its last one."""
        return self.first + len(self.values)

    def parts(self) -> list[Chunk]:
        """Its runs one by one; [] where it is one run."""
        if len(self.values) == 1:
            return []
        return [self.part(i, i + 1) for i in range(len(self.values))]

    def part(self, start: int, end: int) -> Chunk:
        places = self.places.part(start, end) if self.places else None
        return replace(self, first=self.first + start, values=self.values[start:end], places=places)


def prepare() -> None:
    """Loads, with this module, the fast path, and its engine where it is installed."""
    import_module("rotor_mbs.models.lagrange.ensemble")
    is_available()


def perform(chunk: Chunk) -> Rows | Receipt:
    """The runs' rows, or the receipt for them. Raises InputError, MethodRefusal, StoreError; a run's failure is in its
    row."""
    rows = rows_of(chunk)
    return chunk.places.put(rows) if chunk.places else rows


def rows_of(chunk: Chunk) -> Rows:
    """(runs, ...) columns of all its runs. Raises InputError, MethodRefusal; a run's failure is in its row."""
    scenes = _scenes(chunk)
    if chunk.method == ENSEMBLE_METHOD:
        return _ensemble(chunk, scenes)
    rows = empty_rows(len(scenes), chunk.row)
    for i, scene in enumerate(scenes):
        _put_run(rows, i, scene, _solved(chunk, scene))
    return rows


def lost(chunk: Chunk, status: str, message: str) -> Rows:
    """Rows of runs that left nothing: their process died, or was ended."""
    rows = empty_rows(len(chunk.values), chunk.row)
    rows["status"][:], rows[MESSAGE][:] = SWEEP_STATUSES.index(status), message.encode()[:MESSAGE_BYTES]
    rows["time_reached"][:] = 0.0
    return rows


def _scenes(chunk: Chunk) -> list[Scene]:
    try:
        return [chunk.variants.scene(values) for values in chunk.values.tolist()]
    except TableError as error:
        keys = ", ".join(chunk.variants.keys)
        last = chunk.first + len(chunk.values) - 1
        raise InputError(f"runs {chunk.first} to {last}: {keys}: {error}") from error


def _solved(chunk: Chunk, scene: Scene) -> Solution | str:
    """The run, or why there is none."""
    try:
        with time_limit(chunk.time_limit_s):
            return solve(chunk.method, scene, chunk.settings)
    except OutOfTimeError as exc:
        return str(exc)


def _put_run(rows: Rows, i: int, scene: Scene, run: Solution | str) -> None:
    if isinstance(run, str):
        rows["status"][i], rows[MESSAGE][i] = SWEEP_STATUSES.index("timed_out"), run.encode()[:MESSAGE_BYTES]
        rows["time_reached"][i] = 0.0
        return
    _put_verdict(rows, i, scene, run)
    trajectory = run.trajectory
    n = len(trajectory.time)
    for name, values in run.quantities.items():
        if name in rows:
            rows[name][i, :n] = values
    _put_extremes(rows, slice(i, i + 1), trajectory.angles[None], trajectory.rates[None])
    _put_words(rows, i, run.integration, float(trajectory.time[-1]) if n else 0.0)


def _put_verdict(rows: Rows, i: int, scene: Scene, run: Solution) -> None:
    verdict = judge(scene, run, None)
    rows["status"][i] = SWEEP_STATUSES.index(verdict.status)
    rows[MESSAGE][i] = verdict.message.encode()[:MESSAGE_BYTES]
    rows["energy_drift_max"][i] = verdict.metrics.get("energy_drift_max", np.nan)


def _put_words(rows: Rows, i: int, word: Integration, time_reached: float) -> None:
    rows["time_reached"][i] = time_reached
    rows["steps"][i] = -1 if word.steps is None else word.steps
    rows["rhs_evaluations"][i] = -1 if word.rhs_evaluations is None else word.rhs_evaluations


def _put_extremes(rows: Rows, runs: slice, angles: Array, rates: Array) -> None:
    rows["rotor_angle_max"][runs] = largest(angles[:, :, 0])
    rows["rotor_rate_max"][runs] = largest(rates[:, :, 0])
    rows["pitch_max"][runs] = np.max([largest(angles[:, :, i]) for i in range(1, angles.shape[2])], axis=0)


def _ensemble(chunk: Chunk, scenes: Sequence[Scene]) -> Rows:
    method = find_method(chunk.method)
    assert method.solve_many is not None
    settings = method.settings.of(chunk.method, chunk.settings)
    block = method.solve_many(scenes, settings)
    assert block.kinetic_energy is not None  # a sweep's scenes ask for the energy
    assert block.potential_energy is not None
    assert block.work is not None
    errors = energy_errors(block.kinetic_energy, block.potential_energy, block.work)
    drifts = energy_drifts(scenes, block.kinetic_energy, block.work, errors)
    ok = clearly_ok(scenes, chunk.method, block.words, block.samples, drifts)
    rows = empty_rows(len(scenes), chunk.row, METRICS_AND_MESSAGE)
    for name in chunk.row.names or ():
        if name not in rows:
            values = errors if name == "energy_error" else getattr(block, name)
            rows[name] = np.ascontiguousarray(values, chunk.row[name].base)
    rows["status"][ok] = SWEEP_STATUSES.index("ok")
    rows["energy_drift_max"] = drifts
    _put_extremes(rows, slice(None), block.angles, block.rates)
    for i, word in enumerate(block.words):
        _put_words(rows, i, word, word.time_reached)
    for i in np.flatnonzero(~ok).tolist():
        run = Solution(scenes[i], chunk.method, block.trajectory(i), block.words[i], settings.as_dict())
        _put_verdict(rows, i, scenes[i], run)
    return rows
