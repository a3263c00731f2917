"""Compute tip path, energies, work and loads of the printed model's motion by the paper's (3).

Energies and loads are the physical ones, whatever equations made the motion: they show how much
energy those equations produce, and how large their fictitious moments are.
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

# Gauss's three points in [0, 1]: exact to degree five, so for a quartic interpolant.
_GAUSS_POINTS = 0.5 + np.sqrt(0.15) * np.array([-1.0, 0.0, 1.0])
_GAUSS_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0


@dataclass(frozen=True, slots=True)
class PointMassRotor:
    """Hold the printed symbols of a scene: equal blades, each a point mass.

    Attributes
    ----------
    m : kg, of each blade.
    c, d : m, the mass is at (c, 0, d) in the blade's frame.
    g : m/s².
    phases : (blades,) rad.
    tip : (3,) m, the point whose path is drawn, seen from the mass in the directions of the blade
        frame.
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

        c = 0 takes the inertia out of (47): the pitch is then fixed (Fig. 4b).
        """
        return self.c != 0.0

    def tip_path(self, angles: Array) -> Array:
        """Return the tips' paths, (n, blades, 3) m in the base frame.

        (3) is applied to the tip as frame 3 sees it.

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
        """Return ½ m v², (n,) J, with v from the last columns of (8), E1 corrected, and (9)."""
        total = np.zeros(len(angles))
        for pitch, sines in enumerate(self._sines(angles), start=1):
            u32 = derivation.u32(*sines, self.c, self.d, CORRECTED)
            u33 = derivation.u33(*sines, self.c)
            for by_q2, by_q3 in zip(u32[:3], u33[:3], strict=True):
                velocity = by_q2[3] * rates[:, 0] + by_q3[3] * rates[:, pitch]
                total += 0.5 * self.m * velocity**2
        return total

    def potential_energy(self, angles: Array) -> Array:
        """Return the energy of the weights, (n,) J, zero at the height of the shaft."""
        total = np.zeros(len(angles))
        for sines in self._sines(angles):
            height = derivation.a3(*sines, self.c, self.d)[2][3]
            total += self.m * self.g * height
        return total

    def loads(
        self, angles: Array, rates: Array, accelerations: Array, torque: Array
    ) -> dict[str, Array]:
        """Compute the loads at roots and shaft that the motion needs, by quantity.

        Parameters
        ----------
        angles, rates, accelerations : (n, 1 + blades) rad, rad/s and rad/s².
        torque : (n,) N m, on the rotor.
        """
        forces, moments = [], []
        shaft_force, shaft_moment = np.zeros((2, len(angles), 3))
        for pitch, sines in enumerate(self._sines(angles), start=1):
            # (n, 3) m: the last column of (3).
            columns = [row[3] for row in derivation.a3(*sines, self.c, self.d)[:3]]
            place = np.stack(np.broadcast_arrays(*columns), axis=1)
            force = self._acceleration(sines, rates[:, [0, pitch]], accelerations[:, [0, pitch]])
            force[:, 2] += self.g
            force *= self.m
            # (3, 3, n): the blade's axes in the base frame, some elements of which are plain zeros.
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

        From the last columns of (8), (9), (16)-(19).

        Parameters
        ----------
        sines : as of `_sines`.
        rates, accelerations : (n, 2) of q2 and q3, rad/s and rad/s².
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
        """Return s2, c2, s3, c3 of every blade, each (n,)."""
        sines = []
        for i, phase in enumerate(self.phases):
            q2, q3 = angles[:, 0] + phase, angles[:, 1 + i]
            sines.append((np.sin(q2), np.cos(q2), np.sin(q3), np.cos(q3)))
        return sines


def torque_work(scene: Scene, run: Ode45Result, coordinate: int, times: Array) -> Array:
    """Compute the work of the torque on a coordinate from angles alone.

    Where the torque τ is linear, ∫τ q̇ dt = [τ q] - τ' ∫q dt, and the integral is exact for the
    interpolant, a quartic in each step.

    Parameters
    ----------
    scene : whose torque it is.
    run : every step of the integration.
    coordinate : 0 for the rotor, then the pitches.
    times : (n,) s, increasing, that the run reached.

    Returns
    -------
    ndarray, shape (n,)
        J done up to each of the times.
    """
    if len(times) < 2:
        return np.zeros(len(times))
    place, end = torque_place(coordinate), float(times[-1])
    grid = np.unique([*run.time, *times, *scene.kink_times])
    grid = grid[grid <= end]
    # At a jump the value before it ends one part of the grid, and the one after it begins the next.
    before = values_before(scene.load_segments, grid[1:])[place]
    after = values_at(scene.load_tables[place], grid[:-1])
    points = grid[:-1, None] + np.diff(grid)[:, None] * _GAUSS_POINTS
    angles_at_points = run.at(points.ravel())[:, coordinate].reshape(points.shape)
    mean = angles_at_points @ _GAUSS_WEIGHTS
    angles = run.at(grid)[:, coordinate]
    # [τ q] - τ' ∫ q dt on each part, on which τ goes linearly from `after` to `before`.
    done = np.cumsum(before * (angles[1:] - mean) + after * (mean - angles[:-1]))
    return np.asarray(np.append(0.0, done)[np.searchsorted(grid, times)])
