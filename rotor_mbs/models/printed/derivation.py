"""The paper's own way from its matrices to the equations of motion, (24)-(38), for any number of blades, with each of
the errata left in or corrected. E3 stands in (53)-(55) alone: (30), for one blade, is printed with the square of the
pitch rate. The coefficient of that term is zero once E2 is corrected."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from rotor_mbs.models.printed import matrices
from rotor_mbs.models.printed.matrices import AS_PRINTED, Errata, Matrix


class BladeTerms(NamedTuple):
    """What one blade adds to the equations at (q2, q3)."""

    d_22: float  # d: kg m², coefficients of the accelerations
    d_23: float
    d_33: float
    h_2_22: float  # h_i_jk: kg m², coefficients of q̇j q̇k in row i
    h_2_23: float
    h_2_33: float
    h_3_22: float
    h_3_23: float
    h_3_33: float
    gravity_2: float  # N m
    gravity_3: float


def trace(u: Matrix, m: float, v: Matrix) -> float:
    """Trace of U J3 Vᵀ, as in (24) and (26); J3 of (20) is that of a point mass m (kg) in the origin of frame 3."""
    u0, u1, u2, _ = u  # the last row of a derivative is zero
    v0, v1, v2, _ = v
    total: float = m * (u0[3] * v0[3] + u1[3] * v1[3] + u2[3] * v2[3])
    return total


def blade_terms(
    q2: float, q3: float, m: float, c: float, d: float, g: float, errata: Errata = AS_PRINTED
) -> BladeTerms:
    """(24), (26), (27), (31) for one blade whose own rotor angle is q2."""
    s2, c2, s3, c3 = math.sin(q2), math.cos(q2), math.sin(q3), math.cos(q3)
    u2 = matrices.u32(s2, c2, s3, c3, c, d, errata)
    u3 = matrices.u33(s2, c2, s3, c3, c)
    u22 = matrices.u32_2(s2, c2, s3, c3, c, d)
    u23 = matrices.u32_3(s2, c2, s3, c3, c, errata)
    u32 = matrices.u33_2(s2, c2, s3, c3, c)
    u33 = matrices.u33_3(s2, c2, s3, c3, c, errata)
    return BladeTerms(
        d_22=trace(u2, m, u2),
        d_23=trace(u3, m, u2),
        d_33=trace(u3, m, u3),
        h_2_22=trace(u22, m, u2),
        h_2_23=trace(u23, m, u2) + trace(u32, m, u2),
        h_2_33=trace(u33, m, u2),
        h_3_22=trace(u22, m, u3),
        h_3_23=trace(u23, m, u3) + trace(u32, m, u3),
        h_3_33=trace(u33, m, u3),
        gravity_2=m * g * u2[2][3],  # (31): gravity (0, 0, -g, 0), the mass in the origin of frame 3
        gravity_3=m * g * u3[2][3],
    )


class DerivedRotor:
    """Blades alike, each a point mass m (kg) at (c, 0, d) (m), at the given phases (rad); gravity g (m/s²)."""

    def __init__(
        self, m: float, c: float, d: float, g: float, phases: Sequence[float], errata: Errata = AS_PRINTED
    ) -> None:
        self._constants = m, c, d, g, errata
        self._phases = tuple(phases)
        self._first_power = errata.e3 and len(self._phases) > 1

    def blades(self, angles: Sequence[float]) -> list[BladeTerms]:
        """Terms of every blade by (34)-(36); angles (1 + blades,) rad."""
        return [
            blade_terms(angles[0] + phase, pitch, *self._constants)
            for phase, pitch in zip(self._phases, angles[1:], strict=True)
        ]

    def forces(self, blades: Sequence[BladeTerms], rates: Sequence[float]) -> tuple[float, list[float]]:
        """H + C of the rotor's row and of every pitch row; rates (1 + blades,) rad/s; N m."""
        v2 = rates[0]
        rotor = 0.0
        pitches = []
        for terms, v3 in zip(blades, rates[1:], strict=True):
            rotor += terms.h_2_22 * v2 * v2 + terms.h_2_23 * v2 * v3 + terms.h_2_33 * v3 * v3 + terms.gravity_2
            last = v3 if self._first_power else v3 * v3
            pitches.append(terms.h_3_22 * v2 * v2 + terms.h_3_23 * v2 * v3 + terms.h_3_33 * last + terms.gravity_3)
        return rotor, pitches

    def accelerations(self, torques: Sequence[float], angles: Sequence[float], rates: Sequence[float]) -> list[float]:
        """τ = D q̈ + H + C solved for q̈ (rad/s²), the pitches eliminated one by one; torques (1 + blades,) N m."""
        blades = self.blades(angles)
        rotor, forces = self.forces(blades, rates)
        pitches = [force - torque for force, torque in zip(forces, torques[1:], strict=True)]
        inertia, moment = 0.0, torques[0] - rotor
        for terms, force in zip(blades, pitches, strict=True):
            ratio = terms.d_23 / terms.d_33
            inertia += terms.d_22 - ratio * terms.d_23
            moment += ratio * force
        a2 = moment / inertia
        return [a2, *((-f - terms.d_23 * a2) / terms.d_33 for terms, f in zip(blades, pitches, strict=True))]
