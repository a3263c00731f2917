"""Measure how near the pitches of a rotor are to angles at which its mass matrix is singular.

The measure is the Schur complement S = J_hub + Σ cos²β (a - b²/Jzz) of `closed_form`: the inertia
of the rotor if no moment acts on the pitches. A point mass m at (x, 0, z) adds
m (x² + z²) cos²β cos²θ. Therefore S vanishes if the hub is massless, all blades are such point
masses, and all pitches are ±π/2.
"""

from __future__ import annotations

import numpy as np

from rotor_mbs.models.lagrange.parameters import rotor_form
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Array


def rotor_inertia_shares(scene: Scene, angles: Array) -> Array:
    """Return S as a share of the inertia that the rotor has with fixed pitches, (n,).

    The coefficients of S are computed exactly and then rounded once. For a point mass the
    coefficient of sin² θ vanishes; a rounding error in its place would count as inertia.

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
    """Return the smallest of `rotor_inertia_shares` from each row to the next one, (n,).

    The angles between two rows are taken as linear. The shares are evaluated at each row, and where
    a pitch passes an odd multiple of π/2. The latter is left out if a pitch moves by π/2 or more
    from row to row.

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
