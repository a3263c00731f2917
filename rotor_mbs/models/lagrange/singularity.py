"""Measure how near a rotor is to pitches at which its mass matrix is singular.

S = J_hub + Σ cos²β (a - b²/Jzz) is the rotor's inertia with every pitch free to give way, the Schur
complement of `closed_form`: m (c² + d²) cos²β cos²θ for point masses, which vanishes where all
pitches are ±π/2.
"""

from __future__ import annotations

import numpy as np

from rotor_mbs.models.lagrange.parameters import rotor_form
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Array


def rotor_inertia_shares(scene: Scene, angles: Array) -> Array:
    """Return S as a share of the inertia that the rotor has with fixed pitches, (n,).

    The coefficients are exact until they are rounded once: for a point mass the first one vanishes,
    and a rounding remainder in its place would count as inertia.

    Parameters
    ----------
    scene : the rotor.
    angles : (n, 1 + blades) rad.
    """
    form = rotor_form(scene)
    remaining = np.full(len(angles), form.inertia)
    whole = remaining.copy()
    for blade, column in zip(form.blades, scene.moving_coordinates[1:], strict=True):
        s, c = np.sin(angles[:, column]), np.cos(angles[:, column])
        remaining += blade.schur_ss * s * s + blade.schur_cc * c * c + blade.schur_sc * s * c
        whole += blade.inertia_ss * s * s + blade.inertia_cc * c * c + blade.inertia_sc * s * c
        if blade.lean:
            whole += blade.lean.inertia_s * s + blade.lean.inertia_c * c
    return np.asarray(remaining / whole)


def least_inertia_shares(scene: Scene, angles: Array) -> Array:
    """Return the smallest share at each row and on the straight path to the next one, (n,).

    On the path the share is evaluated where a pitch passes ±π/2, unless a pitch moves by a right
    angle or more.

    Parameters
    ----------
    scene : the rotor.
    angles : (n, 1 + blades) rad.
    """
    shares = rotor_inertia_shares(scene, angles)
    near = np.abs(np.diff(angles[:, 1:], axis=0)).max(axis=1, initial=0.0) < 0.5 * np.pi
    for column in range(1, angles.shape[1]):
        quarter = np.floor(angles[:, column] / np.pi - 0.5)
        rows = np.flatnonzero((np.diff(quarter) != 0.0) & near)
        before, after = angles[rows], angles[rows + 1]
        target = np.pi * (np.maximum(quarter[rows], quarter[rows + 1]) + 0.5)
        part = (target - before[:, column]) / (after[:, column] - before[:, column])
        passed = before + part[:, None] * (after - before)
        passed[:, column] = target
        shares[rows] = np.minimum(shares[rows], rotor_inertia_shares(scene, passed))
    return shares
