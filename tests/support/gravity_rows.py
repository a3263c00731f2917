"""Ways of writing the first row of (56), the moment of the weights about the shaft: equal but for rounding.

Fig. 5 starts in an unstable equilibrium of the printed equations, so that its motion is amplified rounding error and
depends on the order in which this row is evaluated. All but the last are the printed row with its factor c m g, its
halves and its root multiplied in or left outside; the last is the sum over the blades that (56) was simplified from.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rotor_mbs.models.printed import literal
from rotor_mbs.models.printed.literal import ROOT3
from support.symbols import Symbol

_PHASES = (0.0, 2.0 * math.pi / 3.0, 4.0 * math.pi / 3.0)  # (34)-(36), rad


@dataclass(frozen=True)
class GravityRow:
    """One way of writing the row.

    of   (m, c, g, s2, c2, c3, c4, c5, root3) -> N m; None for the sum over the blades
    """

    of: Callable[..., Any] | None

    @property
    def formula(self) -> str:
        """The row as text, from the function that computes it."""
        if self.of is None:
            return "(32), row 1, summed over the blades at q2, q2 + 2π/3, q2 + 4π/3"
        symbols = [Symbol(name) for name in ("m", "c", "g", "s2", "c2", "c3", "c4", "c5", "√3")]
        return str(self.of(*symbols))

    def moment(self, m: float, c: float, d: float, g: float, q2: float, c3: float, c4: float, c5: float) -> float:
        """N m at the rotor angle q2 (rad) and the cosines of the pitches."""
        if self.of is None:
            return _summed_over_blades(m, c, d, g, q2, c3, c4, c5)
        return float(self.of(m, c, g, math.sin(q2), math.cos(q2), c3, c4, c5, ROOT3))


def _summed_over_blades(m: float, c: float, d: float, g: float, q2: float, *cosines: float) -> float:
    """First row of (32) summed by (34)-(36), before d cancels out of it: rounded to some 1e-9 N m."""
    turns = [q2 + phase for phase in _PHASES]
    moments = [
        m * g * (c * math.cos(turn) * cosine + d * math.sin(turn)) for turn, cosine in zip(turns, cosines, strict=True)
    ]
    return -(moments[0] + moments[1] + moments[2])


DEFAULT_ROW = "multiplied_in"
_OF_56: dict[str, Callable[..., Any]] = {
    DEFAULT_ROW: literal.rotor_gravity,
    "factor_outside": lambda m, c, g, s2, c2, c3, c4, c5, r: (
        literal.gravity_three(m, c, g, s2, c2, 0, c3, 0, c4, 0, c5, r)[0]
    ),
    "reversed": lambda m, c, g, s2, c2, c3, c4, c5, r: (
        c * m * g * (c2 / 2 - r / 2 * s2) * c5 + c * m * g * (c2 / 2 + r / 2 * s2) * c4 - c * m * g * c2 * c3
    ),
    "distributed": lambda m, c, g, s2, c2, c3, c4, c5, r: (
        -c * m * g * c2 * c3 + c * m * g * c2 / 2 * c4 + r / 2 * c * m * g * s2 * c4
        + c * m * g * c2 / 2 * c5 - r / 2 * c * m * g * s2 * c5
    ),
    "root_times_sine": lambda m, c, g, s2, c2, c3, c4, c5, r: (
        -c * m * g * c2 * c3 + c * m * g * (c2 / 2 + r * s2 / 2) * c4 + c * m * g * (c2 / 2 - r * s2 / 2) * c5
    ),
    "halves_first": lambda m, c, g, s2, c2, c3, c4, c5, r: (
        -c * m * g * c2 * c3 + c * m * g * (c2 * 0.5 + r * 0.5 * s2) * c4 + c * m * g * (c2 * 0.5 - r * 0.5 * s2) * c5
    ),
    "halves_outside": lambda m, c, g, s2, c2, c3, c4, c5, r: (
        -c * m * g * c2 * c3 + c * m * g / 2 * (c2 + r * s2) * c4 + c * m * g / 2 * (c2 - r * s2) * c5
    ),
    "cosines_first": lambda m, c, g, s2, c2, c3, c4, c5, r: (
        -c * m * g * c3 * c2 + c * m * g * c4 * (c2 / 2 + r / 2 * s2) + c * m * g * c5 * (c2 / 2 - r / 2 * s2)
    ),
    "gravity_last": lambda m, c, g, s2, c2, c3, c4, c5, r: (
        -c * m * c2 * c3 * g + c * m * (c2 / 2 + r / 2 * s2) * c4 * g + c * m * (c2 / 2 - r / 2 * s2) * c5 * g
    ),
    "mass_first": lambda m, c, g, s2, c2, c3, c4, c5, r: (
        -m * g * c * c2 * c3 + m * g * c * (c2 / 2 + r / 2 * s2) * c4 + m * g * c * (c2 / 2 - r / 2 * s2) * c5
    ),
    "gravity_first": lambda m, c, g, s2, c2, c3, c4, c5, r: (
        -g * m * c * c2 * c3 + g * m * c * (c2 / 2 + r / 2 * s2) * c4 + g * m * c * (c2 / 2 - r / 2 * s2) * c5
    ),
}  # fmt: skip
GRAVITY_ROWS = {name: GravityRow(of) for name, of in _OF_56.items()} | {"summed_over_blades": GravityRow(None)}
