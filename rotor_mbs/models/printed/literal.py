"""Evaluate the paper's equations of motion as printed: (33) for one blade, (39)-(56) for three.

The terms of (33) are (25), (29), (30) and (32). Nothing is corrected here: E1 and E2 are in the
coefficients, E3 in the last terms of (53)-(55). Every formula is a function of the symbols it is
printed with, so that its numbers and its text have one source. Formulas are evaluated in the order
of the print, with one exception: the factor of the first row of (56) is multiplied in, see
`rotor_gravity`.

s2, c2 .. s5, c5   sines and cosines of q2 (rotor), q3, q4, q5 (pitch of blade 1, 2, 3)
w22, w23, w33, ..  products of rates: w23 = q̇2 q̇3, w33 = q̇3²
w3, w4, w5         rates to the first power, w3 = q̇3, printed in (53)-(55)
m, c, d, g         mass (kg) and place (c, 0, d) (m) of the point mass; gravity (m/s²) along -z
root3              the square root of 3

Some equations are damaged in the machine-readable text of the paper. What was printed then follows
from an undamaged equation: (54), (55) are (30) at q2 + 2π/3 and q2 + 4π/3 by (35), (36); the pitch
rows of (56) are (32) at the same angles.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

ROOT3 = math.sqrt(3.0)
Row = tuple[Any, ...]


def mass_one(m: Any, c: Any, d: Any, s3: Any, c3: Any) -> tuple[Row, Row]:
    """Return (25), rows and columns of q2, q3; kg m²."""
    return (
        (2 * c**2 * m * c3**2 + d**2 * m, -c * d * m * s3 + c**2 * m * c3**2),
        (c**2 * m * c3**2 - c * d * m * s3, c**2 * m),
    )


def h2(m: Any, c: Any, d: Any, s2: Any, c2: Any, s3: Any, c3: Any, w23: Any, w33: Any) -> Any:
    """Return (29), N m."""
    return (
        -3 * c**2 * m * s3 * c3 * w23
        + c**2 * m * c3 * (s2**2 * c3 - s3 - s2 * c3 * c2) * w33
        - c * d * m * s2 * c3 * (c2 + s2) * w33
    )


def h3(m: Any, c: Any, s2: Any, c2: Any, s3: Any, c3: Any, w22: Any, w23: Any, w33: Any) -> Any:
    """Return (30), N m: with the square of q̇3, unlike (53)."""
    return (
        c**2 * m * c3 * s3 * w22
        - c**2 * m * c3 * s3 * w23
        + c**2 * m * c3 * s3 * (s2 * c2 - c2**2) * w33
    )


def gravity_one(m: Any, c: Any, d: Any, g: Any, s2: Any, c2: Any, s3: Any, c3: Any) -> Row:
    """Return (32), rows of q2, q3; N m."""
    return -c * m * g * c2 * c3 - d * m * g * s2, c * m * g * s2 * s3


def mass_three(
    m: Any, c: Any, d: Any, s3: Any, c3: Any, s4: Any, c4: Any, s5: Any, c5: Any
) -> tuple[Row, Row, Row, Row]:
    """Return (39)-(51), rows and columns of q2, q3, q4, q5; kg m².

    Parameters
    ----------
    m, c, d : mass (kg) and place (m) of the point mass.
    s3, c3, s4, c4, s5, c5 : sines and cosines of the pitches.
    """
    return (
        (
            2 * c**2 * m * (c3**2 + c4**2 + c5**2) + 3 * d**2 * m,  # (42)
            -c * d * m * s3 + c**2 * m * c3**2,  # (43)
            -c * d * m * s4 + c**2 * m * c4**2,  # (44)
            -c * d * m * s5 + c**2 * m * c5**2,  # (45)
        ),
        (c**2 * m * c3**2 - c * d * m * s3, c**2 * m, 0, 0),  # (46), (47), (39)
        (c**2 * m * c4**2 - c * d * m * s4, 0, c**2 * m, 0),  # (48), (40), (49)
        (c**2 * m * c5**2 - c * d * m * s5, 0, 0, c**2 * m),  # (50), (41), (51)
    )


def h_1(
    m: Any, c: Any, d: Any, s2: Any, c2: Any, s3: Any, c3: Any, s4: Any, c4: Any, s5: Any, c5: Any,
    w23: Any, w24: Any, w25: Any, w33: Any, w44: Any, w55: Any, root3: Any = ROOT3,
) -> Any:  # fmt: skip
    """Return (52), N m.

    Parameters
    ----------
    m, c, d : mass (kg) and place (m) of the point mass.
    s2, c2, s3, c3, s4, c4, s5, c5 : sines and cosines of the angles.
    w23, w24, w25, w33, w44, w55 : products of rates, rad²/s².
    root3 : the square root of 3.
    """
    return (
        -3 * c**2 * m * (s3 * c3 * w23 + s4 * c4 * w24 + s5 * c5 * w25)
        + c * m * c3 * (c * c3 * (s2**2 - s2 * c2) - d * (s2**2 + s2 * c2) - c * s3) * w33
        + c
        * m
        * c4
        * (
            c
            * c4
            * ((1 - root3) / 4 * s2**2 + (2 - 2 * root3) / 4 * s2 * c2 + (3 + root3) / 4 * c2**2)
            - d
            * ((1 + root3) / 4 * s2**2 - (2 + 2 * root3) / 4 * s2 * c2 + (3 - root3) / 4 * c2**2)
            - c * s4
        )
        * w44
        + c
        * m
        * c5
        * (
            c
            * c5
            * ((1 + root3) / 4 * s2**2 + (2 + 2 * root3) / 4 * s2 * c2 + (3 - root3) / 4 * c2**2)
            - d
            * ((1 - root3) / 4 * s2**2 - (2 - 2 * root3) / 4 * s2 * c2 + (3 + root3) / 4 * c2**2)
            - c * s5
        )
        * w55
    )


def h_2(m: Any, c: Any, s2: Any, c2: Any, s3: Any, c3: Any, w22: Any, w23: Any, w3: Any) -> Any:
    """Return (53), N m; q̇3 to the first power in the last term (E3)."""
    return c**2 * m * s3 * c3 * (w22 - w23 + (s2 * c2 - c2**2) * w3)


def h_3(
    m: Any,
    c: Any,
    s2: Any,
    c2: Any,
    s4: Any,
    c4: Any,
    w22: Any,
    w24: Any,
    w4: Any,
    root3: Any = ROOT3,
) -> Any:
    """Return (54), N m; q̇4 to the first power in the last term (E3).

    Parameters
    ----------
    m, c : mass (kg) and place (m) of the point mass.
    s2, c2, s4, c4 : sines and cosines of the angles.
    w22, w24 : products of rates, rad²/s².
    w4 : q̇4.
    root3 : the square root of 3.
    """
    last = (-3 + root3) / 4 * s2**2 - (2 + 2 * root3) / 4 * s2 * c2 - (1 + root3) / 4 * c2**2
    return c**2 * m * s4 * c4 * (w22 - w24 + last * w4)


def h_4(
    m: Any,
    c: Any,
    s2: Any,
    c2: Any,
    s5: Any,
    c5: Any,
    w22: Any,
    w25: Any,
    w5: Any,
    root3: Any = ROOT3,
) -> Any:
    """Return (55), N m; q̇5 to the first power in the last term (E3).

    Parameters
    ----------
    m, c : mass (kg) and place (m) of the point mass.
    s2, c2, s5, c5 : sines and cosines of the angles.
    w22, w25 : products of rates, rad²/s².
    w5 : q̇5.
    root3 : the square root of 3.
    """
    last = (-3 - root3) / 4 * s2**2 - (2 - 2 * root3) / 4 * s2 * c2 - (1 - root3) / 4 * c2**2
    return c**2 * m * s5 * c5 * (w22 - w25 + last * w5)


def gravity_three(
    m: Any, c: Any, g: Any, s2: Any, c2: Any, s3: Any, c3: Any, s4: Any, c4: Any, s5: Any, c5: Any,
    root3: Any = ROOT3,
) -> Row:  # fmt: skip
    """Return (56), rows of q2, q3, q4, q5; N m.

    The distance d has cancelled out of the first row.
    """
    return (
        c * m * g * (-c2 * c3 + (c2 / 2 + root3 / 2 * s2) * c4 + (c2 / 2 - root3 / 2 * s2) * c5),
        c * m * g * s2 * s3,
        c * m * g * (-s2 / 2 + root3 / 2 * c2) * s4,
        c * m * g * (-s2 / 2 - root3 / 2 * c2) * s5,
    )


def rotor_gravity(
    m: Any, c: Any, g: Any, s2: Any, c2: Any, c3: Any, c4: Any, c5: Any, root3: Any = ROOT3
) -> Any:
    """Return the first row of (56) as it is run, N m: with its factor c m g multiplied in.

    Rounding decides Fig. 5, which starts at rest in an unstable equilibrium: the printed bracket is
    exactly zero there, and nothing moves; the three terms leave -4.2e-13 N m, with which the
    published numbers come out for T = 12 s. Results of other ways to evaluate the row are in
    reference/claims.json.
    """
    second, third = c2 / 2 + root3 / 2 * s2, c2 / 2 - root3 / 2 * s2
    return -c * m * g * c2 * c3 + c * m * g * second * c4 + c * m * g * third * c5


def fixed_pitch_acceleration(
    m: float, d: float, g: float, torque: float, q2: float, phases: Sequence[float]
) -> float:
    """Return q̈2 (rad/s²) where c = 0.

    There (47) is zero, and the first row of (33) is a pendulum's, summed over the blades.
    """
    inertia = moment = 0.0
    for phase in phases:
        s2, c2 = math.sin(q2 + phase), math.cos(q2 + phase)
        inertia += mass_one(m, 0.0, d, 0.0, 1.0)[0][0]
        if g:
            moment += gravity_one(m, 0.0, d, g, s2, c2, 0.0, 1.0)[0]
    return (torque - moment) / inertia


def one_blade_accelerations(
    m: float, c: float, d: float, g: float, torques: Sequence[float], state: Sequence[float]
) -> tuple[float, float]:
    """Solve (33) for q̈2, q̈3 in rad/s².

    Parameters
    ----------
    m, c, d : mass (kg) and place (m) of the point mass.
    g : m/s².
    torques : (2,) τ2, τ3 in N m.
    state : (4,) q2, q3 in rad, q̇2, q̇3 in rad/s.
    """
    q2, q3, v2, v3 = state
    s2, c2, s3, c3 = math.sin(q2), math.cos(q2), math.sin(q3), math.cos(q3)
    (d11, d12), (d21, d22) = mass_one(m, c, d, s3, c3)
    b1 = torques[0] - h2(m, c, d, s2, c2, s3, c3, v2 * v3, v3 * v3)
    b2 = torques[1] - h3(m, c, s2, c2, s3, c3, v2 * v2, v2 * v3, v3 * v3)
    if g:
        f1, f2 = gravity_one(m, c, d, g, s2, c2, s3, c3)
        b1, b2 = b1 - f1, b2 - f2
    a2 = (b1 - d12 / d22 * b2) / (d11 - d12 / d22 * d21)
    return a2, (b2 - d21 * a2) / d22


def three_blade_accelerations(
    m: float, c: float, d: float, g: float, torques: Sequence[float], state: Sequence[float]
) -> tuple[float, float, float, float]:
    """Solve (39)-(56) for q̈2..q̈5 in rad/s².

    By (39)-(41) each pitch row has only q̈2 and the acceleration of its own pitch. Therefore the
    pitches are eliminated one by one.

    Parameters
    ----------
    m, c, d : mass (kg) and place (m) of the point masses.
    g : m/s².
    torques : (4,) τ2..τ5 in N m.
    state : (8,) q2..q5 in rad, q̇2..q̇5 in rad/s.
    """
    q2, q3, q4, q5, v2, v3, v4, v5 = state
    s2, c2, s3, c3 = math.sin(q2), math.cos(q2), math.sin(q3), math.cos(q3)
    s4, c4, s5, c5 = math.sin(q4), math.cos(q4), math.sin(q5), math.cos(q5)
    (d11, d12, d13, d14), (d21, d22, _, _), (d31, _, d33, _), (d41, _, _, d44) = mass_three(
        m, c, d, s3, c3, s4, c4, s5, c5
    )
    v22, v23, v24, v25 = v2 * v2, v2 * v3, v2 * v4, v2 * v5
    b1 = torques[0] - h_1(
        m, c, d, s2, c2, s3, c3, s4, c4, s5, c5, v23, v24, v25, v3 * v3, v4 * v4, v5 * v5
    )
    b2 = torques[1] - h_2(m, c, s2, c2, s3, c3, v22, v23, v3)
    b3 = torques[2] - h_3(m, c, s2, c2, s4, c4, v22, v24, v4)
    b4 = torques[3] - h_4(m, c, s2, c2, s5, c5, v22, v25, v5)
    if g:
        _, f2, f3, f4 = gravity_three(m, c, g, s2, c2, s3, c3, s4, c4, s5, c5)
        f1 = rotor_gravity(m, c, g, s2, c2, c3, c4, c5)
        b1, b2, b3, b4 = b1 - f1, b2 - f2, b3 - f3, b4 - f4
    r2, r3, r4 = d12 / d22, d13 / d33, d14 / d44
    a2 = (b1 - r2 * b2 - r3 * b3 - r4 * b4) / (d11 - r2 * d21 - r3 * d31 - r4 * d41)
    return a2, (b2 - d21 * a2) / d22, (b3 - d31 * a2) / d33, (b4 - d41 * a2) / d44
