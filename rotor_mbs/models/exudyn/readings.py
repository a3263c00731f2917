"""What each of the two models' sensors say, as a trajectory. Knows the sensors' names and no equations of motion."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from rotor_mbs.models.exudyn import chain, energy, observe, tree
from rotor_mbs.models.exudyn.geometry import Body, mounting, pitching
from rotor_mbs.models.exudyn.timetable import Piece
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Array, Trajectory


class _Reader:
    """The rows of all sensors: once for each time, up to the last at which the state is finite."""

    def __init__(self, scene: Scene, recorded: Callable[[str], Array], state: Iterable[str]) -> None:
        tables = {name: recorded(name) for name in state}
        time = next(iter(tables.values()))[:, 0]
        kept = observe.distinct_rows(scene, time)
        self._rows = kept[: observe.finite_rows(*(table[kept] for table in tables.values()))]
        self._tables, self._recorded = tables, recorded
        self.time = time[self._rows]
        self.samples = observe.sample_rows(scene, self.time)

    def all(self, name: str) -> Array:
        """(n, k): every kept row."""
        if name not in self._tables:
            self._tables[name] = self._recorded(name)
        return self._tables[name][self._rows, 1:]

    def sampled(self, name: str) -> Array:
        """(samples, k)."""
        return self.all(name)[self.samples]


def tree_trajectory(scene: Scene, pieces: Sequence[Piece], recorded: Callable[[str], Array]) -> Trajectory:
    """The kinematic tree's own coordinates; `recorded` gives (n, 1 + k) rows of a sensor, time first."""
    read = _Reader(scene, recorded, ("angles", "rates"))
    angles = _all_blades(scene, read.all("angles"), scene.initial_angles)
    rates = _all_blades(scene, read.all("rates"), (0.0,) * len(scene.initial_rates))
    bodies = [(tree.link_name(link), body) for link, body in enumerate(tree.bodies(scene))]
    return observe.cut(scene, _fields(scene, pieces, read, angles, rates, bodies))


def chain_trajectory(scene: Scene, pieces: Sequence[Piece], recorded: Callable[[str], Array]) -> Trajectory:
    """Joint angles from the bodies' rotation matrices, rates from their angular velocities, and the joints' gaps."""
    placed = chain.placed_bodies(scene)
    bodies = [(each.name, each.body) for each in placed]
    state = [f"{name} {what}" for name, _ in bodies for what in ("position", "rotation", "spin")]
    read = _Reader(scene, recorded, state)
    angles, rates = _joint_motion(scene, read)
    fields = _fields(scene, pieces, read, angles, rates, bodies)
    fields["constraint_error"] = _largest_gap(read, bodies)
    return observe.cut(scene, fields)


def _all_blades(scene: Scene, moving: Array, held: Sequence[float]) -> Array:
    """(n, 1 + blades): the columns that move, and the held value where a blade cannot pitch."""
    out = np.empty((len(moving), len(held)))
    out[:] = held
    out[:, [0, *(1 + i for i in pitching(scene))]] = moving
    return out


def _joint_motion(scene: Scene, read: _Reader) -> tuple[Array, Array]:
    hub, hub_spin = _matrices(read.all("hub rotation")), read.all("hub spin")
    wrapped = np.arctan2(hub[:, 0, 2] - hub[:, 2, 0], hub[:, 0, 0] + hub[:, 2, 2])
    rates = [hub_spin[:, 1]]
    angles = [observe.unwrap(read.time, wrapped, rates[0], scene.initial_angles[0])]
    hub_omega = (hub @ hub_spin[:, :, None])[:, :, 0]
    for i in pitching(scene):
        blade = _matrices(read.all(f"blade {i + 1} rotation"))
        x, y, z = np.moveaxis(blade, 2, 0)
        seat_x, seat_y = hub @ mounting(i, len(scene.blades))[:, 0], hub[:, :, 1]
        wrapped = np.arctan2(_dot(seat_y, x) - _dot(seat_x, y), _dot(seat_x, x) + _dot(seat_y, y))
        rate = read.all(f"blade {i + 1} spin")[:, 2] - _dot(hub_omega, z)
        angles.append(observe.unwrap(read.time, wrapped, rate, scene.initial_angles[1 + i]))
        rates.append(rate)
    still = (0.0,) * len(scene.initial_rates)
    return (
        _all_blades(scene, np.stack(angles, axis=1), scene.initial_angles),
        _all_blades(scene, np.stack(rates, axis=1), still),
    )


def _dot(a: Array, b: Array) -> Array:
    """(n,) from two (n, 3)."""
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]


def _matrices(rows: Array) -> Array:
    return rows.reshape(-1, 3, 3)


def _largest_gap(read: _Reader, bodies: Sequence[tuple[str, Body]]) -> Array:
    """(samples,) m: every body's hub centre, which the joints hold together with the ground's and the hub's."""
    centres = []
    for name, body in bodies:
        rotation = _matrices(read.sampled(f"{name} rotation"))
        centres.append(read.sampled(f"{name} position") - rotation @ body.com)
    hub, *blades = centres
    gaps = [hub, *(blade - hub for blade in blades)]
    largest: Array = np.max([np.linalg.norm(gap, axis=1) for gap in gaps], axis=0)
    return largest


def _fields(
    scene: Scene,
    pieces: Sequence[Piece],
    read: _Reader,
    angles: Array,
    rates: Array,
    bodies: Sequence[tuple[str, Body]],
) -> dict[str, Array]:
    """What the scene asks for, at the samples. angles and rates are (rows, 1 + blades)."""
    fields = {"angles": angles[read.samples], "rates": rates[read.samples]}
    if scene.wants("tip"):
        tips = [read.sampled(f"tip {i + 1}") for i in range(len(scene.blades))]
        fields["tip"] = np.stack(tips, axis=1)
    if scene.wants("energy"):
        fields["work"] = energy.work(scene, pieces, read.time, angles, rates)[read.samples]
        fields["potential_energy"] = energy.spring_energy(scene, fields["angles"])
        fields["kinetic_energy"] = np.zeros(len(read.samples))
        for name, body in bodies:
            _add_energies(scene, fields, read, name, body)
    return fields


def _add_energies(scene: Scene, fields: dict[str, Array], read: _Reader, name: str, body: Body) -> None:
    if body.mass:
        fields["kinetic_energy"] += energy.translation_energy(body, read.sampled(f"{name} velocity"))
        fields["potential_energy"] += energy.gravity_energy(scene, body, read.sampled(f"{name} position"))
    if np.any(body.inertia):
        fields["kinetic_energy"] += energy.rotation_energy(body, read.sampled(f"{name} spin"))
