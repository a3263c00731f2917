"""Compute a trajectory from the recorded rows of the sensors, for tree and chain.

This module also computes the energy of the springs and the work of the loads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.models.exudyn import chain, tree
from rotor_mbs.models.exudyn.geometry import Body, mounting, movable_blades, rotation_x
from rotor_mbs.models.exudyn.loads import chain_loads, matrices, prescribed_moments, tree_loads
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import (
    POLYNOMIAL_ROWS,
    ROTOR_TORQUE,
    Segment,
    is_constant,
    values_at,
)
from rotor_mbs.solution.trajectory import (
    Array,
    Trajectory,
    all_coordinates,
    finite_rows,
    finite_samples,
    sample_times,
)


class _Reader:
    """Read the rows of all sensors, up to the last at which the state is finite.

    Attributes
    ----------
    time : (rows,) s; all times are different.
    samples : number of the row of each sample that was reached.
    """

    def __init__(
        self, scene: Scene, recorded: Callable[[str], Array], state: Iterable[str]
    ) -> None:
        """Find the rows to be read, and those of the samples.

        Parameters
        ----------
        scene : the run.
        recorded : (name of a sensor) -> its (n, 1 + k) recorded rows, time first.
        state : names of the sensors of the state. A row is read only if their values are finite.
        """
        tables = {name: recorded(name) for name in state}
        time = next(iter(tables.values()))[:, 0]
        # Where two intervals meet, each has recorded a row. Only the first of the two is read.
        spacing = scene.duration / (scene.samples - 1)
        is_distinct = np.diff(time) > 1e-9 * spacing
        distinct = np.flatnonzero(np.concatenate([[True], is_distinct]))
        count = finite_rows(*(table[distinct] for table in tables.values()))
        self._rows = distinct[:count]
        self._tables, self._recorded = tables, recorded
        self.time = time[self._rows]
        # The row of each sample, up to the first sample that has no row.
        wanted = sample_times(scene)
        slack = 1e-6 * spacing
        rows = np.searchsorted(self.time, wanted - slack)
        met = rows < len(self.time)
        met[met] = np.abs(self.time[rows[met]] - wanted[met]) <= slack
        self.samples: NDArray[np.intp] = rows if met.all() else rows[: int(np.argmin(met))]

    def all(self, name: str) -> Array:
        """Return the values of a sensor in all rows, (rows, k)."""
        if name not in self._tables:
            self._tables[name] = self._recorded(name)
        return self._tables[name][self._rows, 1:]

    def sampled(self, name: str) -> Array:
        """Return the values of a sensor at the samples, (samples, k)."""
        return self.all(name)[self.samples]


def tree_trajectory(scene: Scene, recorded: Callable[[str], Array]) -> Trajectory:
    """Return the samples of the tree, whose coordinates are the angles.

    Parameters
    ----------
    scene : the run.
    recorded : as for `_Reader`.
    """
    read = _Reader(scene, recorded, ("angles", "rates"))
    angles, rates = all_coordinates(scene, read.all("angles"), read.all("rates"))
    bodies = [(tree.link_name(link), body) for link, body in enumerate(tree.bodies(scene))]
    fields = _fields(scene, read, angles, rates, bodies)
    if scene.wants("loads"):
        fields |= tree_loads(scene, read.time[read.samples], read.sampled)
    return finite_samples(scene, fields)


def chain_trajectory(
    scene: Scene, recorded: Callable[[str], Array], has_work: bool = False
) -> Trajectory:
    """Return the samples of the chain.

    The joint angles are computed from the rotation matrices of the bodies, the joint rates from
    their angular velocities.

    Parameters
    ----------
    scene : the run.
    recorded : as for `_Reader`.
    has_work : whether `recorded` has the work (J) as rows "work". Otherwise it is computed here.
    """
    placed = chain.placed_bodies(scene)
    bodies = [(part.name, part.body) for part in placed]
    state = [f"{name} {what}" for name, _ in bodies for what in ("position", "rotation", "spin")]
    read = _Reader(scene, recorded, state)
    angles, rates = _joint_motion(scene, read)
    fields = _fields(scene, read, angles, rates, bodies, has_work)
    # The apex of each body, from the body's own position. The joints keep the apex of the hub at
    # that of the ground, which is the origin, and the apexes of the blades at that of the hub.
    centres = []
    for name, body in bodies:
        rotations = matrices(read.sampled(f"{name} rotation"))
        centres.append(read.sampled(f"{name} position") - rotations @ body.com)
    hub, *blades = centres
    gaps = [hub, *(blade - hub for blade in blades)]
    distances = [np.linalg.norm(gap, axis=1) for gap in gaps]
    fields["constraint_error"] = np.asarray(np.max(distances, axis=0))
    if scene.wants("loads"):
        fields |= chain_loads(scene, read.sampled)
    return finite_samples(scene, fields)


def _joint_motion(scene: Scene, read: _Reader) -> tuple[Array, Array]:
    """Return the chain's angles and rates in all rows, (rows, 1 + blades) rad and rad/s.

    Parameters
    ----------
    scene : the run. Its initial angles give the number of whole turns at the start.
    read : the rows of the sensors.
    """
    hub = matrices(read.all("hub rotation"))
    if scene.shaft_tilt:  # from the base frame to the shaft frame, as for blades below
        hub = rotation_x(-scene.shaft_tilt) @ hub
    rates = joint_rates(scene, read.all)
    # The matrix of a rotation about y has the sine twice, and the cosine twice. The mean is used.
    twice_sine = hub[:, 0, 2] - hub[:, 2, 0]
    twice_cosine = hub[:, 0, 0] + hub[:, 2, 2]
    wrapped = np.arctan2(twice_sine, twice_cosine)
    angles = [unwrap(read.time, wrapped, rates[:, 0], scene.initial_angles[0])]
    for column, i in enumerate(movable_blades(scene), start=1):
        # Axes x and y of the blade, and their directions seat_x and seat_y at a pitch of zero.
        blade = matrices(read.all(f"blade {i + 1} rotation"))
        if scene.shaft_tilt:
            blade = rotation_x(-scene.shaft_tilt) @ blade
        x, y, _ = np.moveaxis(blade, 2, 0)
        seat = mounting(scene, i)
        seat_x = hub @ seat[:, 0]
        seat_y = hub @ seat[:, 1] if scene.blades[i].cone else hub[:, :, 1]
        twice_sine = _dot(seat_y, x) - _dot(seat_x, y)
        twice_cosine = _dot(seat_x, x) + _dot(seat_y, y)
        wrapped = np.arctan2(twice_sine, twice_cosine)
        angles.append(unwrap(read.time, wrapped, rates[:, column], scene.initial_angles[1 + i]))
    return all_coordinates(scene, np.stack(angles, axis=1), rates)


def joint_rates(scene: Scene, values: Callable[[str], Array]) -> Array:
    """Return the rates of the chain's joints, (n, coordinates that move) rad/s.

    Parameters
    ----------
    scene : the rotor.
    values : (name of a sensor) -> its (n, k) values.
    """
    hub = matrices(values("hub rotation"))
    hub_spin = values("hub spin")
    hub_omega = (hub @ hub_spin[:, :, None])[:, :, 0]
    rates = [hub_spin[:, 1]]
    for i in movable_blades(scene):
        z = matrices(values(f"blade {i + 1} rotation"))[:, :, 2]
        rates.append(values(f"blade {i + 1} spin")[:, 2] - _dot(hub_omega, z))
    return np.stack(rates, axis=1)


def _dot(a: Array, b: Array) -> Array:
    """Return the scalar products of (n, 3) vectors, (n,)."""
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]


def _fields(
    scene: Scene,
    read: _Reader,
    angles: Array,
    rates: Array,
    bodies: Sequence[tuple[str, Body]],
    has_work: bool = False,
) -> dict[str, Array]:
    """Return the requested quantities except for loads, at the samples, by name.

    Parameters
    ----------
    scene : the run.
    read : the rows of the sensors.
    angles, rates : (rows, 1 + blades) rad and rad/s.
    bodies : names and bodies of hub and blades that pitch.
    has_work : as for `chain_trajectory`.
    """
    fields = {"angles": angles[read.samples], "rates": rates[read.samples]}
    if scene.wants("tip"):
        tips = [read.sampled(f"tip {i + 1}") for i in range(len(scene.blades))]
        fields["tip"] = np.stack(tips, axis=1)
    if scene.wants("energy"):
        if has_work:
            fields["work"] = read.sampled("work")[:, 0]
        else:
            fields["work"] = work(scene, read.time, angles, rates)[read.samples]
        fields["potential_energy"], of_rests = springs(scene, fields["angles"])
        if any(scene.bearing_rest):
            fields["work"] += of_rests
        fields["kinetic_energy"] = np.zeros(len(read.samples))
        # ½ m v² and m g z of each centre of mass, ½ ω·J ω in the body's own frame.
        for name, body in bodies:
            if body.mass:
                velocity = read.sampled(f"{name} velocity")
                position = read.sampled(f"{name} position")
                fields["kinetic_energy"] += 0.5 * body.mass * np.sum(velocity * velocity, axis=1)
                fields["potential_energy"] += body.mass * scene.gravity * position[:, 2]
            if np.any(body.inertia):
                spin = read.sampled(f"{name} spin")
                fields["kinetic_energy"] += 0.5 * np.sum(spin @ body.inertia * spin, axis=1)
    return fields


def unwrap(time: Array, wrapped: Array, rates: Array, start: float) -> Array:
    """Return continuous angles, (n,) rad, from angles that are known up to whole turns.

    The mean of the rates in two rows predicts the change of the angle from one to the other. The
    change that is nearest to the prediction is taken.

    Parameters
    ----------
    time : (n,) s.
    wrapped : (n,) rad, angles up to whole turns.
    rates : (n,) rad/s.
    start : rad. The first angle is the one nearest to it.
    """
    turn = 2.0 * np.pi
    predicted = 0.5 * np.diff(time) * (rates[1:] + rates[:-1])
    gained = np.round((predicted - np.diff(wrapped)) / turn)
    first_turns = np.round((start - wrapped[0]) / turn)
    turns = first_turns + np.concatenate([[0.0], np.cumsum(gained)])
    return np.asarray(wrapped + turn * turns)


def springs(scene: Scene, angles: Array) -> tuple[Array, Array]:
    """Compute the energy of the springs, and the work of rest angles that `work` leaves out.

    The energy is ½ k (θ - r)². The work of a rest angle r that changes is -∫ k (θ - r) dr, jumps
    included. The function `work` includes ∫ k r dθ instead. The difference of the two integrals is
    the change of ½ k r (r - 2θ).

    Parameters
    ----------
    scene : the rotor.
    angles : (n, 1 + blades) rad, at the first n samples.

    Returns
    -------
    energy : ndarray, shape (n,)
        Energy of the springs, J.
    of_rests : ndarray, shape (n,)
        Work to be added to that of the function `work`, J.
    """
    energy, of_rests = np.zeros((2, len(angles)))
    for i in movable_blades(scene):
        stiffness, _ = scene.bearings[i]
        _, table = scene.pitch_loads[i]
        if stiffness:
            rest = values_at(table, sample_times(scene)[: len(angles)])
            energy += 0.5 * stiffness * (angles[:, 1 + i] - rest) ** 2
            if not is_constant(table):
                moved = 0.5 * stiffness * rest * (rest - 2.0 * angles[:, 1 + i])
                of_rests += moved - moved[:1]
    return energy, of_rests


def work(scene: Scene, time: Array, angles: Array, rates: Array) -> Array:
    """Compute the work of the torques minus the energy that the dampers dissipate, (n,) J.

    A spring whose rest angle r changes counts as a spring with a rest angle of 0 and a torque k r;
    see `springs`.

    Parameters
    ----------
    scene : the run.
    time : (n,) s, times of all rows, with those of the samples.
    angles, rates : (n, 1 + blades) rad and rad/s.
    """
    if not scene.work_needs_path:
        # All loads are constant and there are no dampers. Torque times angle is exact.
        turned, torques = angles - angles[:1], scene.load_segments[0].values
        exact: Array = torques[ROTOR_TORQUE] * turned[:, 0]
        for moment in prescribed_moments(scene):
            if moment.coordinate:
                exact = exact + torques[moment.load] * turned[:, moment.coordinate]
        return exact

    # The power jumps with a load, and no polynomial may go through both sides of a jump. Therefore
    # each segment is integrated separately.
    out, done = np.zeros(len(time)), 0.0
    # Largest distance, s, that a row at a jump may have from it because of rounding.
    slack = 1e-9 * scene.duration / (scene.samples - 1)
    for segment in scene.load_segments:
        first, last = np.searchsorted(time, [segment.start - slack, segment.end + slack])
        if last - first < 2:
            break
        inside = slice(first, last)
        drawn = power(scene, segment, time[inside], rates[inside])
        out[inside] = done + cumulative_integral(time[inside], drawn)
        done = out[last - 1]
    return out


def power(scene: Scene, segment: Segment, time: Array, rates: Array) -> Array:
    """Return the power of torques and dampers, whose integral is `work`, (n,) W.

    Parameters
    ----------
    scene : the rotor.
    segment : segment of the run, with the loads.
    time : (n,) s within the segment.
    rates : (n, 1 + blades) rad/s.
    """
    drawn: Array = -(rates**2) @ np.array(scene.dampings)
    for coordinate, load, factor in prescribed_moments(scene):
        drawn = drawn + factor * segment.at(load, time) * rates[:, coordinate]
    return drawn


def cumulative_integral(time: Array, values: Array) -> Array:
    """Return the integral of sampled values from the first row to each row, (n,).

    Between two rows the integrand is the polynomial through the eight nearest rows, which need not
    be equally spaced. Gauss-Legendre quadrature integrates this polynomial exactly.

    Parameters
    ----------
    time : (n,) s, increasing.
    values : (n,) integrand in each row.
    """
    points = min(POLYNOMIAL_ROWS, len(time))
    # The polynomial between two rows goes through equally many rows on both sides, except near the
    # ends.
    first = np.clip(np.arange(len(time) - 1) - (points // 2 - 1), 0, len(time) - points)
    window = first[:, None] + np.arange(points)
    nodes, known = time[window], values[window]
    abscissae, weights = np.polynomial.legendre.leggauss((points + 1) // 2)
    half = 0.5 * np.diff(time)
    at = (time[:-1] + half)[:, None] + half[:, None] * abscissae
    # The polynomial in Lagrange's form: basis function j is 1 at node j and 0 at all other nodes.
    polynomial = np.zeros_like(at)
    for j in range(points):
        basis = np.ones_like(at)
        for k in range(points):
            if k != j:
                basis *= (at - nodes[:, k, None]) / (nodes[:, j] - nodes[:, k])[:, None]
        polynomial += basis * known[:, j, None]
    parts = (polynomial * (half[:, None] * weights)).sum(axis=1)
    return np.concatenate([[0.0], np.cumsum(parts)])
