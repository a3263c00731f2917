"""Equations of motion linearized about a steady state, as every model hands them out. Knows no model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotor_mbs.solution.trajectory import Array


@dataclass(frozen=True)
class Linearization:
    """δq̈ + D δq̇ + K δq = 0 about a state of constant rates, the mass matrix divided out.

    stiffness   (n, n) 1/s²: M⁻¹ times the derivative of the forces by the coordinates, sign turned
    damping     (n, n) 1/s: the same by the rates; it holds gyroscopic terms, too
    residual    (n,) rad/s²: accelerations that are left at the state, zero where it is steady; () where not known
    """

    stiffness: Array
    damping: Array
    residual: Array

    @property
    def state_matrix(self) -> Array:
        """(2n, 2n): d/dt of (δq, δq̇)."""
        n = len(self.stiffness)
        return np.block([[np.zeros((n, n)), np.eye(n)], [-self.stiffness, -self.damping]])
