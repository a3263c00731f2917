"""From recorded rows to samples: which rows are samples, angles over many turns, where a run stopped being finite.

Knows no rotor model; the models' own readings are put together in `readings`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.models.exudyn.timetable import sample_times
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Array, Trajectory

Indices = NDArray[np.intp]


def distinct_rows(scene: Scene, time: Array) -> Indices:
    """Indices of the rows to keep: two legs share the row they meet at."""
    slack = 1e-9 * scene.duration / (scene.samples - 1)
    return np.flatnonzero(np.concatenate([[True], np.diff(time) > slack]))


def finite_rows(*tables: Array) -> int:
    """How many rows from the first are finite in every table."""
    if not len(tables[0]):
        return 0
    finite = np.ones(len(tables[0]), dtype=bool)
    for table in tables:
        finite &= np.isfinite(table.reshape(len(table), -1)).all(axis=1)
    return len(finite) if finite.all() else int(np.argmin(finite))


def sample_rows(scene: Scene, time: Array) -> Indices:
    """Row of each sample, as far as they were reached without a gap."""
    wanted = sample_times(scene)
    slack = 1e-6 * scene.duration / (scene.samples - 1)
    rows = np.searchsorted(time, wanted - slack)
    met = rows < len(time)
    met[met] = np.abs(time[rows[met]] - wanted[met]) <= slack
    return rows if met.all() else rows[: int(np.argmin(met))]


def unwrap(time: Array, wrapped: Array, rates: Array, start: float) -> Array:
    """(n,) rad: angles known but for whole turns, made continuous with the help of the measured rates (rad/s).

    The angle is predicted by the mean rate between two rows; the turn nearest to that is taken, so many turns between
    rows do no harm as long as the prediction is right to half a turn. The first row gets the turns of `start`.
    """
    turn = 2.0 * np.pi
    predicted = 0.5 * np.diff(time) * (rates[1:] + rates[:-1])
    gained = np.round((predicted - np.diff(wrapped)) / turn)
    turns = np.round((start - wrapped[0]) / turn) + np.concatenate([[0.0], np.cumsum(gained)])
    unwrapped: Array = wrapped + turn * turns
    return unwrapped


def cut(scene: Scene, fields: Mapping[str, Array]) -> Trajectory:
    """The samples as a trajectory, up to the first row in which any field is not finite."""
    n = finite_rows(*fields.values())
    kept: dict[str, Any] = {name: table[:n] for name, table in fields.items()}
    return Trajectory(time=sample_times(scene)[:n], **kept)
