"""Equations of motion linearized about a steady state, as every model gives them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Array


@dataclass(frozen=True)
class Linearization:
    """δq̈ + D δq̇ + K δq = 0 about a state of constant rates, the mass matrix divided out."""

    stiffness: Array  # (n, n) 1/s²: M⁻¹ times the derivative of the forces by the coordinates, sign turned
    damping: Array  # (n, n) 1/s: the same by the rates; it has gyroscopic terms, too
    residual: Array  # (n,) rad/s²: accelerations that remain at the state, zero where it is steady; () where not known


def scene_at(scene: Scene, angles: Sequence[float] | Array, speed: float, torque: float) -> Scene:
    """`scene` at `angles` (1 + blades,) rad, its rotor turning at `speed` rad/s under `torque` N m."""
    return replace(
        scene,
        initial_angles=tuple(float(angle) for angle in angles),
        initial_rates=(speed, *(0.0 for _ in scene.blades)),
        rotor_torque=((0.0, torque),) if torque else (),
        outputs=("angles",),
    )


def limit_at_zero(quotients: Sequence[Array], ratio: float) -> Array:
    """Difference quotients with the steps h, 2h, 4h, ... extrapolated to a step of 0 (Richardson); ratio: by which a
    doubled step enlarges each further term of the error, 2 for one-sided quotients, 4 for central ones."""
    values = list(quotients)
    for power in range(1, len(values)):
        pairs = itertools.pairwise(values)
        values = [(ratio**power * fine - coarse) / (ratio**power - 1.0) for fine, coarse in pairs]
    return values[0]
