"""Compute tip path, energies, work and loads of the printed model's motion.

All of them follow from the paper's transformation matrix (3). Energies and loads are those of a
real rotor with this motion, even if the motion follows from erroneous equations. They show how much
energy such equations produce, and how large their fictitious moments are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotor_mbs.models.ode45 import Ode45Result
from rotor_mbs.models.printed import derivation
from rotor_mbs.models.printed.derivation import CORRECTED
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import torque_place, values_at, values_before
from rotor_mbs.solution.quantities import named_loads
from rotor_mbs.solution.trajectory import Array

# The three Gauss points in [0, 1] and their weights. The quadrature is exact up to degree five, and
# therefore for the interpolant of ode45, which has degree four.
_GAUSS_POINTS = 0.5 + np.sqrt(0.15) * np.array([-1.0, 0.0, 1.0])
_GAUSS_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0


@dataclass(frozen=True, slots=True)
class PointMassRotor:
    """Hold the values of the paper's symbols for a rotor with equal blades, each a point mass.

    Attributes
    ----------
    m : mass of each blade, kg.
    c, d : place of the mass, which is at (c, 0, d) in the blade's frame, m.
    g : gravity, m/s².
    phases : (blades,) rad, azimuths at which the blades are mounted.
    tip : (3,) m, place of the tip minus that of the mass, in the blade's frame.
    """

    m: float
    c: float
    d: float
    g: float
    phases: tuple[float, ...]
    tip: tuple[float, float, float]

    @property
    def pitches_move(self) -> bool:
        """Return whether the pitches move.

        If c = 0, the inertia (47) is zero, and the pitches are fixed (Fig. 4b).
        """
        return self.c != 0.0

    def tip_path(self, angles: Array) -> Array:
        """Return the tips' paths, (n, blades, 3) m in the base frame.

        The matrix (3) transforms the tip from frame 3, whose origin is the mass, to the base frame.

        Parameters
        ----------
        angles : (n, 1 + blades) rad.
        """
        x, y, z = self.tip
        paths = []
        for sines in self._sines(angles):
            place = []
            for row in derivation.a3(*sines, self.c, self.d)[:3]:
                place.append(row[0] * x + row[1] * y + row[2] * z + row[3])
            paths.append(np.stack(place, axis=-1))
        return np.stack(paths, axis=1)

    def kinetic_energy(self, angles: Array, rates: Array) -> Array:
        """Return the kinetic energy ½ m v² of all blades, (n,) J.

        The velocity v follows from the last columns of (8), with E1 corrected, and of (9).
        """
        total = np.zeros(len(angles))
        for pitch, sines in enumerate(self._sines(angles), start=1):
            u32 = derivation.u32(*sines, self.c, self.d, CORRECTED)
            u33 = derivation.u33(*sines, self.c)
            for by_q2, by_q3 in zip(u32[:3], u33[:3], strict=True):
                velocity = by_q2[3] * rates[:, 0] + by_q3[3] * rates[:, pitch]
                total += 0.5 * self.m * velocity**2
        return total

    def potential_energy(self, angles: Array) -> Array:
        """Return the potential energy of the weights, (n,) J; zero at the height of the shaft."""
        total = np.zeros(len(angles))
        for sines in self._sines(angles):
            height = derivation.a3(*sines, self.c, self.d)[2][3]
            total += self.m * self.g * height
        return total

    def loads(
        self, angles: Array, rates: Array, accelerations: Array, torque: Array
    ) -> dict[str, Array]:
        """Compute the loads at roots and shaft that the motion needs, by name of the quantity.

        Parameters
        ----------
        angles, rates, accelerations : (n, 1 + blades) rad, rad/s and rad/s².
        torque : (n,) N m, torque on the rotor.
        """
        forces, moments = [], []
        shaft_force, shaft_moment = np.zeros((2, len(angles), 3))
        for pitch, sines in enumerate(self._sines(angles), start=1):
            # Place of the mass, (n, 3) m: the last column of (3).
            columns = [row[3] for row in derivation.a3(*sines, self.c, self.d)[:3]]
            place = np.stack(np.broadcast_arrays(*columns), axis=1)
            force = self._acceleration(sines, rates[:, [0, pitch]], accelerations[:, [0, pitch]])
            force[:, 2] += self.g
            force *= self.m
            # Axes of the blade in the base frame, (3, 3, n). Some elements of (3) are plain zeros,
            # which become arrays here.
            rotation = derivation.a3(*sines, 0.0, 0.0)[:3]
            axes = np.array([np.broadcast_arrays(*row[:3], angles[:, 0])[:3] for row in rotation])
            forces.append(np.einsum("ijn,ni->nj", axes, force))
            moments.append(np.cross([self.c, 0.0, self.d], forces[-1]))
            shaft_force += force
            shaft_moment += np.cross(place, force)
        shaft_moment[:, 1] -= torque
        actuators = np.stack([moment[:, 2] for moment in moments], axis=1)
        return named_loads(zip(forces, moments, strict=True), shaft_force, shaft_moment, actuators)

    def _acceleration(
        self, sines: tuple[Array, Array, Array, Array], rates: Array, accelerations: Array
    ) -> Array:
        """Return the acceleration of the mass, (n, 3) m/s², with E1 and E2 corrected.

        It follows from the last columns of (8), (9) and (16)-(19).

        Parameters
        ----------
        sines : sines and cosines for the blade, as `_sines` returns them.
        rates, accelerations : (n, 2) derivatives of q2 and q3, rad/s and rad/s².
        """
        c, d = self.c, self.d
        w2, w3 = rates.T
        terms = (
            (derivation.u32(*sines, c, d, CORRECTED), accelerations[:, 0]),
            (derivation.u33(*sines, c), accelerations[:, 1]),
            (derivation.u32_2(*sines, c, d), w2 * w2),
            (derivation.u32_3(*sines, c, CORRECTED), w2 * w3),
            (derivation.u33_2(*sines, c), w2 * w3),
            (derivation.u33_3(*sines, c, CORRECTED), w3 * w3),
        )
        acceleration = np.zeros((3, len(w2)))
        for u, rate in terms:
            for row in range(3):
                acceleration[row] += u[row][3] * rate
        return np.ascontiguousarray(acceleration.T)

    def _sines(self, angles: Array) -> list[tuple[Array, Array, Array, Array]]:
        """Return the sines and cosines s2, c2, s3, c3 for every blade, each (n,)."""
        sines = []
        for i, phase in enumerate(self.phases):
            q2, q3 = angles[:, 0] + phase, angles[:, 1 + i]
            sines.append((np.sin(q2), np.cos(q2), np.sin(q3), np.cos(q3)))
        return sines


def torque_work(scene: Scene, run: Ode45Result, coordinate: int, times: Array) -> Array:
    """Compute the work of the torque on a coordinate, from angles alone.

    On an interval on which the torque τ is linear, ∫ τ q̇ dt = [τ q] - τ' ∫ q dt. The integral of q
    is exact for the interpolant of ode45, which is of degree four in each step.

    Parameters
    ----------
    scene : the scene, with the torque.
    run : result of the integration.
    coordinate : 0 for the rotor, i for the pitch of blade i.
    times : (n,) s, increasing; not later than the end of the run.

    Returns
    -------
    ndarray, shape (n,)
        Work from the start of the run to each of the times, J.
    """
    if len(times) < 2:
        return np.zeros(len(times))
    place, end = torque_place(coordinate), float(times[-1])
    grid = np.unique([*run.time, *times, *scene.kink_times])
    grid = grid[grid <= end]
    # At a jump, one part of the grid ends with the torque before it, and the next part begins with
    # the torque after it.
    before = values_before(scene.load_segments, grid[1:])[place]
    after = values_at(scene.load_tables[place], grid[:-1])
    points = grid[:-1, None] + np.diff(grid)[:, None] * _GAUSS_POINTS
    angles_at_points = run.at(points.ravel())[:, coordinate].reshape(points.shape)
    mean = angles_at_points @ _GAUSS_WEIGHTS
    angles = run.at(grid)[:, coordinate]
    # Work on each part of the grid, [τ q] - τ' ∫ q dt. On a part τ is linear: it has the value
    # `after` at the start, and `before` at the end.
    done = np.cumsum(before * (angles[1:] - mean) + after * (mean - angles[:-1]))
    return np.asarray(np.append(0.0, done)[np.searchsorted(grid, times)])
