"""Results files made by hand: known curves in place of trajectories, stored as a batch stores
them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.errors import StoreError
from rotor_mbs.runs.design import RUNS, RunRequest, results_tables
from rotor_mbs.runs.merge import fit_file_to_request
from rotor_mbs.runs.rows import RowLocation, Rows, row_of_run
from rotor_mbs.runs.table import TableFile
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.metrics import metrics_of
from rotor_mbs.solution.trajectory import Integration, Solution, Trajectory

Curve = Callable[[Any], Any]  # time (n,) to angles (n, coordinates)


@dataclass
class Made:
    """A run to be stored: angles as a function of time; rates are its differences.

    until      share of the scene's duration that the run reached
    gain       J that the total energy rises by, evenly over the time
    versions   of what computed it, by default this installation's
    """

    scene: Scene
    method: str
    angles: Curve
    until: float = 1.0
    gain: float = 0.0
    attributes: dict[str, object] = field(default_factory=dict)
    versions: dict[str, str] | None = None

    def run(self) -> Solution:
        scene = self.scene
        time = np.linspace(0.0, scene.duration, scene.samples)[
            : max(int(self.until * scene.samples), 0)
        ]
        angles = np.broadcast_to(self.angles(time), (len(time), 1 + len(scene.blades))).copy()
        rates = np.gradient(angles, time, axis=0) if len(time) > 1 else np.zeros_like(angles)
        fields = {}
        if len(time) and scene.wants("tip"):
            turned = angles[:, :1] + np.array(scene.phases)
            fields["tip"] = 33.0 * np.stack(
                [np.sin(turned), 1e-3 * np.sin(angles[:, 1:]), np.cos(turned)], axis=2
            )
        if len(time) and scene.wants("energy"):
            fields["kinetic_energy"] = 1e6 + self.gain * time / scene.duration
            fields["potential_energy"] = fields["work"] = np.zeros(len(time))
        if self.method == "reference":
            fields |= {
                "angle_uncertainty": np.full(len(time), 1e-30),
                "error_growth": np.ones(len(time)),
            }
        if len(time) and scene.wants("angles") and scene.wants("rates"):
            fields["defect"] = np.concatenate([[np.nan], np.full(len(time) - 1, 1e-12)])
        trajectory = Trajectory(time, angles, rates, **fields)
        return Solution(scene, self.method, trajectory, Integration(True), {}, 0.01, [0.002], 0.001)


def store(path: Path, runs: Sequence[Made]) -> Path:
    """The runs in one file, each compared with its scene's reference where there is one."""
    references = {
        made.scene.name: made.run().trajectory for made in runs if made.method == "reference"
    }
    file = fit_file_to_request(
        path,
        results_tables(
            [RunRequest(made.scene, made.method, versions=made.versions) for made in runs]
        ),
    )
    for made in runs:
        run = made.run()
        metrics = (
            metrics_of(made.scene, run.trajectory, references.get(made.scene.name))
            if made.until
            else {}
        )
        facts = {**metrics, **made.attributes}
        run.status, run.message = str(facts.pop("status", "ok")), str(facts.pop("message", ""))
        place = file.place(f"{made.scene.name}/{made.method}")
        place.write(row_of_run(run, place, facts))
    return path


def rotor(curve: Callable[[Any], Any], *pitches: Callable[[Any], Any]) -> Curve:
    """Angles of the rotor and of as many pitches as are given; the rest are zero, for three
    blades."""
    curves = [curve, *pitches] + [np.zeros_like] * (3 - len(pitches))
    return lambda time: np.stack([one(time) for one in curves], axis=1)


class Arrays:
    """Arrays by name in place of a stored run; None is one that cannot be read."""

    def __init__(
        self,
        method: str,
        status: str = "ok",
        attributes: Any = (),
        settings: Any = (),
        **arrays: Any,
    ) -> None:
        self.scene_name, self.method, self.status, self.arrays = "scene", method, status, arrays
        self.attributes, self.settings, self.is_frozen = dict(attributes), dict(settings), False

    def __contains__(self, name: str) -> bool:
        return name in self.arrays

    def get(self, name: str) -> Any:
        return self.arrays.get(name)

    def array(self, name: str) -> Any:
        if self.arrays[name] is None:
            raise StoreError(f"{name} changed after it was written")
        return self.arrays[name]


def damage(path: Path, run: str, column: str, at: int = 0, bit: int = 0) -> None:
    """Change a bit of a stored row: of the column, `at` bytes from its end."""
    change_byte(TableFile(path).place(run), column, at, bit)


def change_byte(place: RowLocation, column: str, at: int = 0, bit: int = 0) -> None:
    with place.path.open("r+b") as file:
        file.seek(place.offsets[column] + place.row_type[column].itemsize - 1 - at)
        byte = file.read(1)[0]
        file.seek(-1, 1)
        file.write(bytes([byte ^ 1 << bit]))


def change_row(path: Path, run: str, change: Callable[[Rows], None]) -> None:
    """Change the columns of a stored run in place; its row has the checksum of what it holds
    then."""
    place = TableFile(path).place(run)
    row = {name: values.copy() for name, values in place.read().items()}
    change({name: values[0, ...] for name, values in row.items()})
    place.write(row)


def drop(path: Path, scene: str, method: str) -> None:
    """Take a run out of a file."""
    fit_file_to_request(path, [], replaced=[(RUNS, scene, method)])
