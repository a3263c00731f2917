"""The paper's transformation matrix (3) and its derivative matrices as printed, with errata E1, E2 switchable: sines
and cosines of q2, q3 (numbers, arrays or symbols) and the lengths c, d in. The constants d1, d2 of (2), (3) are
zero."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

Matrix = tuple[tuple[Any, Any, Any, Any], ...]
LAST_ROW_OF_DERIVATIVE = (0, 0, 0, 0)


@dataclass(frozen=True, slots=True)
class Errata:
    """Which faults are in: e1, (8) row 2 column 4 is c c3 (and (17) its derivative), where y does not depend on q2; e2,
    (19) row 1 column 4 has s2 in place of c2; e3, the last terms of (53)-(55) have the pitch rate, not its square."""

    e1: bool = True
    e2: bool = True
    e3: bool = True


AS_PRINTED = Errata()
CORRECTED = Errata(e1=False, e2=False, e3=False)


def a3(s2: Any, c2: Any, s3: Any, c3: Any, c: Any, d: Any) -> Matrix:
    """(3), base from frame 3, whose origin is the blade's mass point: Ry(q2) Rz(q3), the origin at (c, 0, d)."""
    return (
        (c2 * c3, -c2 * s3, s2, c * c2 * c3 + d * s2),
        (s3, c3, 0, c * s3),
        (-s2 * c3, s2 * s3, c2, -c * s2 * c3 + d * c2),
        (0, 0, 0, 1),
    )


def u32(s2: Any, c2: Any, s3: Any, c3: Any, c: Any, d: Any, errata: Errata = AS_PRINTED) -> Matrix:
    """(8), derivative of (3) by q2."""
    return (
        (-s2 * c3, s2 * s3, c2, -c * s2 * c3 + d * c2),
        (0, 0, 0, c * c3 if errata.e1 else 0),
        (-c2 * c3, c2 * s3, -s2, -c * c2 * c3 - d * s2),
        LAST_ROW_OF_DERIVATIVE,
    )


def u33(s2: Any, c2: Any, s3: Any, c3: Any, c: Any) -> Matrix:
    """(9), derivative of (3) by q3."""
    return (
        (-c2 * s3, -c2 * c3, 0, -c * c2 * s3),
        (c3, -s3, 0, c * c3),
        (s2 * s3, s2 * c3, 0, c * s2 * s3),
        LAST_ROW_OF_DERIVATIVE,
    )


def u32_2(s2: Any, c2: Any, s3: Any, c3: Any, c: Any, d: Any) -> Matrix:
    """(16), derivative of (8) by q2."""
    return (
        (-c2 * c3, c2 * s3, -s2, -c * c2 * c3 - d * s2),
        (0, 0, 0, 0),
        (s2 * c3, -s2 * s3, -c2, c * s2 * c3 - d * c2),
        LAST_ROW_OF_DERIVATIVE,
    )


def u32_3(s2: Any, c2: Any, s3: Any, c3: Any, c: Any, errata: Errata = AS_PRINTED) -> Matrix:
    """(17), derivative of (8) by q3."""
    return (
        (s2 * s3, s2 * c3, 0, c * s2 * s3),
        (0, 0, 0, -c * s3 if errata.e1 else 0),
        (c2 * s3, c2 * c3, 0, c * c2 * s3),
        LAST_ROW_OF_DERIVATIVE,
    )


def u33_2(s2: Any, c2: Any, s3: Any, c3: Any, c: Any) -> Matrix:
    """(18), derivative of (9) by q2."""
    return (
        (s2 * s3, s2 * c3, 0, c * s2 * s3),
        (0, 0, 0, 0),
        (c2 * s3, c2 * c3, 0, c * c2 * s3),
        LAST_ROW_OF_DERIVATIVE,
    )


def u33_3(s2: Any, c2: Any, s3: Any, c3: Any, c: Any, errata: Errata = AS_PRINTED) -> Matrix:
    """(19), derivative of (9) by q3."""
    return (
        (-c2 * c3, c2 * s3, 0, -c * s2 * c3 if errata.e2 else -c * c2 * c3),
        (-s3, -c3, 0, -c * s3),
        (s2 * c3, -s2 * s3, 0, c * s2 * c3),
        LAST_ROW_OF_DERIVATIVE,
    )
