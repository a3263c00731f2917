"""Derive the equations of motion as the paper does, (24)-(38), with errata left in or corrected.

They follow from the paper's matrices, for any number of blades. E3 is in (53)-(55) alone: (30), for
one blade, is printed with the square of the pitch rate. The coefficient of that term is zero once
E2 is corrected.

The first functions return the transformation matrix (3) and its derivatives as printed. Their
arguments are sines and cosines of q2, q3 (numbers, arrays or symbols) and the lengths c, d. The
constants d1, d2 of (2), (3) are zero.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

Matrix = tuple[tuple[Any, Any, Any, Any], ...]
LAST_ROW_OF_DERIVATIVE = (0, 0, 0, 0)


@dataclass(frozen=True, slots=True)
class Errata:
    """Say which of the paper's errata are left in.

    Attributes
    ----------
    e1 : (8) row 2 column 4 is c c3 (and (17) its derivative), where y does not depend on q2.
    e2 : (19) row 1 column 4 has s2 in place of c2.
    e3 : the last terms of (53)-(55) have the pitch rate, not its square.
    """

    e1: bool = True
    e2: bool = True
    e3: bool = True


AS_PRINTED = Errata()
CORRECTED = Errata(e1=False, e2=False, e3=False)


def a3(s2: Any, c2: Any, s3: Any, c3: Any, c: Any, d: Any) -> Matrix:
    """Return (3), the transformation from frame 3 to the base frame: Ry(q2) Rz(q3).

    The origin of frame 3 is the blade's mass point, at (c, 0, d).
    """
    return (
        (c2 * c3, -c2 * s3, s2, c * c2 * c3 + d * s2),
        (s3, c3, 0, c * s3),
        (-s2 * c3, s2 * s3, c2, -c * s2 * c3 + d * c2),
        (0, 0, 0, 1),
    )


def u32(s2: Any, c2: Any, s3: Any, c3: Any, c: Any, d: Any, errata: Errata = AS_PRINTED) -> Matrix:
    """Return (8), derivative of (3) by q2."""
    return (
        (-s2 * c3, s2 * s3, c2, -c * s2 * c3 + d * c2),
        (0, 0, 0, c * c3 if errata.e1 else 0),
        (-c2 * c3, c2 * s3, -s2, -c * c2 * c3 - d * s2),
        LAST_ROW_OF_DERIVATIVE,
    )


def u33(s2: Any, c2: Any, s3: Any, c3: Any, c: Any) -> Matrix:
    """Return (9), derivative of (3) by q3."""
    return (
        (-c2 * s3, -c2 * c3, 0, -c * c2 * s3),
        (c3, -s3, 0, c * c3),
        (s2 * s3, s2 * c3, 0, c * s2 * s3),
        LAST_ROW_OF_DERIVATIVE,
    )


def u32_2(s2: Any, c2: Any, s3: Any, c3: Any, c: Any, d: Any) -> Matrix:
    """Return (16), derivative of (8) by q2."""
    return (
        (-c2 * c3, c2 * s3, -s2, -c * c2 * c3 - d * s2),
        (0, 0, 0, 0),
        (s2 * c3, -s2 * s3, -c2, c * s2 * c3 - d * c2),
        LAST_ROW_OF_DERIVATIVE,
    )


def u32_3(s2: Any, c2: Any, s3: Any, c3: Any, c: Any, errata: Errata = AS_PRINTED) -> Matrix:
    """Return (17), derivative of (8) by q3."""
    return (
        (s2 * s3, s2 * c3, 0, c * s2 * s3),
        (0, 0, 0, -c * s3 if errata.e1 else 0),
        (c2 * s3, c2 * c3, 0, c * c2 * s3),
        LAST_ROW_OF_DERIVATIVE,
    )


def u33_2(s2: Any, c2: Any, s3: Any, c3: Any, c: Any) -> Matrix:
    """Return (18), derivative of (9) by q2."""
    return (
        (s2 * s3, s2 * c3, 0, c * s2 * s3),
        (0, 0, 0, 0),
        (c2 * s3, c2 * c3, 0, c * c2 * s3),
        LAST_ROW_OF_DERIVATIVE,
    )


def u33_3(s2: Any, c2: Any, s3: Any, c3: Any, c: Any, errata: Errata = AS_PRINTED) -> Matrix:
    """Return (19), derivative of (9) by q3."""
    return (
        (-c2 * c3, c2 * s3, 0, -c * s2 * c3 if errata.e2 else -c * c2 * c3),
        (-s3, -c3, 0, -c * s3),
        (s2 * c3, -s2 * s3, 0, c * s2 * c3),
        LAST_ROW_OF_DERIVATIVE,
    )


class BladeTerms(NamedTuple):
    """Hold what one blade adds to the equations at (q2, q3)."""

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
    """Return the trace of U J3 Vᵀ in (24) and (26).

    J3 of (20) is the inertia matrix of a point mass m (kg) in the origin of frame 3.
    """
    u0, u1, u2, _ = u  # the last row of a derivative is zero
    v0, v1, v2, _ = v
    total: float = m * (u0[3] * v0[3] + u1[3] * v1[3] + u2[3] * v2[3])
    return total


def blade_terms(
    q2: float, q3: float, m: float, c: float, d: float, g: float, errata: Errata = AS_PRINTED
) -> BladeTerms:
    """Return (24), (26), (27), (31) for one blade.

    Parameters
    ----------
    q2 : rad, the rotor angle at which this blade stands.
    q3 : rad, its pitch.
    m, c, d : mass (kg) and place (m) of the point mass.
    g : m/s².
    errata : the faults that are left in.
    """
    s2, c2, s3, c3 = math.sin(q2), math.cos(q2), math.sin(q3), math.cos(q3)
    by_2 = u32(s2, c2, s3, c3, c, d, errata)
    by_3 = u33(s2, c2, s3, c3, c)
    by_22 = u32_2(s2, c2, s3, c3, c, d)
    by_23 = u32_3(s2, c2, s3, c3, c, errata)
    by_32 = u33_2(s2, c2, s3, c3, c)
    by_33 = u33_3(s2, c2, s3, c3, c, errata)
    return BladeTerms(
        d_22=trace(by_2, m, by_2),
        d_23=trace(by_3, m, by_2),
        d_33=trace(by_3, m, by_3),
        h_2_22=trace(by_22, m, by_2),
        h_2_23=trace(by_23, m, by_2) + trace(by_32, m, by_2),
        h_2_33=trace(by_33, m, by_2),
        h_3_22=trace(by_22, m, by_3),
        h_3_23=trace(by_23, m, by_3) + trace(by_32, m, by_3),
        h_3_33=trace(by_33, m, by_3),
        # (31): gravity (0, 0, -g, 0), the mass in the origin of frame 3
        gravity_2=m * g * by_2[2][3],
        gravity_3=m * g * by_3[2][3],
    )


class DerivedRotor:
    """Evaluate the derived equations of motion of a rotor with equal blades.

    Parameters
    ----------
    m, c, d : mass (kg) and place (c, 0, d) (m) of each blade's point mass.
    g : m/s².
    phases : (blades,) rad.
    errata : the faults that are left in.
    """

    def __init__(
        self,
        m: float,
        c: float,
        d: float,
        g: float,
        phases: Sequence[float],
        errata: Errata = AS_PRINTED,
    ) -> None:
        self._constants = m, c, d, g, errata
        self._phases = tuple(phases)
        self._first_power = errata.e3 and len(self._phases) > 1

    def blades(self, angles: Sequence[float]) -> list[BladeTerms]:
        """Return the terms of every blade by (34)-(36); angles (1 + blades,) rad."""
        return [
            blade_terms(angles[0] + phase, pitch, *self._constants)
            for phase, pitch in zip(self._phases, angles[1:], strict=True)
        ]

    def forces(
        self, blades: Sequence[BladeTerms], rates: Sequence[float]
    ) -> tuple[float, list[float]]:
        """Return H + C of the rotor's row and of every pitch row, N m.

        Parameters
        ----------
        blades : their terms, as of `blades`.
        rates : (1 + blades,) rad/s.
        """
        v2 = rates[0]
        rotor = 0.0
        pitches = []
        for terms, v3 in zip(blades, rates[1:], strict=True):
            rotor += (
                terms.h_2_22 * v2 * v2
                + terms.h_2_23 * v2 * v3
                + terms.h_2_33 * v3 * v3
                + terms.gravity_2
            )
            last = v3 if self._first_power else v3 * v3
            pitches.append(
                terms.h_3_22 * v2 * v2
                + terms.h_3_23 * v2 * v3
                + terms.h_3_33 * last
                + terms.gravity_3
            )
        return rotor, pitches

    def accelerations(
        self, torques: Sequence[float], angles: Sequence[float], rates: Sequence[float]
    ) -> list[float]:
        """Solve τ = D q̈ + H + C for q̈ (rad/s²), the pitches eliminated one by one.

        Parameters
        ----------
        torques : (1 + blades,) N m.
        angles, rates : (1 + blades,) rad and rad/s.
        """
        blades = self.blades(angles)
        rotor, forces = self.forces(blades, rates)
        pitches = [force - torque for force, torque in zip(forces, torques[1:], strict=True)]
        inertia, moment = 0.0, torques[0] - rotor
        for terms, force in zip(blades, pitches, strict=True):
            ratio = terms.d_23 / terms.d_33
            inertia += terms.d_22 - ratio * terms.d_23
            moment += ratio * force
        a2 = moment / inertia
        return [
            a2,
            *(
                (-f - terms.d_23 * a2) / terms.d_33
                for terms, f in zip(blades, pitches, strict=True)
            ),
        ]
