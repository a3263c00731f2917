"""Ways of writing the first row of (56), the moment of the weights about the shaft: equal but for
rounding.

Fig. 5 starts in an unstable equilibrium of the printed equations, so that its motion is amplified
rounding error and depends on the order in which this row is evaluated. All but the last are the
printed row with its factor c m g, its halves and its root multiplied in or left outside; the last
is the sum over the blades that (56) was simplified from.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Mapping
from types import CodeType

from rotor_mbs.models.printed.literal import ROOT3

_PHASES = (0.0, 2.0 * math.pi / 3.0, 4.0 * math.pi / 3.0)  # (34)-(36), rad

DEFAULT_ROW = "multiplied_in"  # as `literal.rotor_gravity` has it
SUMMED = "summed_over_blades"  # the one that is not of (56)
# By name, in the paper's notation.
GRAVITY_ROWS = {
    "multiplied_in": "-c m g c2 c3 + c m g (c2/2 + √3/2 s2) c4 + c m g (c2/2 - √3/2 s2) c5",
    "factor_outside": "c m g (-c2 c3 + (c2/2 + √3/2 s2) c4 + (c2/2 - √3/2 s2) c5)",
    "reversed": "c m g (c2/2 - √3/2 s2) c5 + c m g (c2/2 + √3/2 s2) c4 - c m g c2 c3",
    "distributed": (
        "-c m g c2 c3 + c m g c2/2 c4 + √3/2 c m g s2 c4 + c m g c2/2 c5 - √3/2 c m g s2 c5"
    ),
    "root_times_sine": "-c m g c2 c3 + c m g (c2/2 + √3 s2/2) c4 + c m g (c2/2 - √3 s2/2) c5",
    "halves_first": "-c m g c2 c3 + c m g (c2 0.5 + √3 0.5 s2) c4 + c m g (c2 0.5 - √3 0.5 s2) c5",
    "halves_outside": "-c m g c2 c3 + c m g/2 (c2 + √3 s2) c4 + c m g/2 (c2 - √3 s2) c5",
    "cosines_first": "-c m g c3 c2 + c m g c4 (c2/2 + √3/2 s2) + c m g c5 (c2/2 - √3/2 s2)",
    "gravity_last": "-c m c2 c3 g + c m (c2/2 + √3/2 s2) c4 g + c m (c2/2 - √3/2 s2) c5 g",
    "mass_first": "-m g c c2 c3 + m g c (c2/2 + √3/2 s2) c4 + m g c (c2/2 - √3/2 s2) c5",
    "gravity_first": "-g m c c2 c3 + g m c (c2/2 + √3/2 s2) c4 + g m c (c2/2 - √3/2 s2) c5",
    SUMMED: "(32), row 1, summed over the blades at q2, q2 + 2π/3, q2 + 4π/3",
}


def moment(
    row: str, m: float, c: float, d: float, g: float, q2: float, c3: float, c4: float, c5: float
) -> float:
    """N m at the rotor angle q2 (rad) and the cosines of the pitches."""
    if row != SUMMED:
        sines = {"s2": math.sin(q2), "c2": math.cos(q2), "c3": c3, "c4": c4, "c5": c5}
        return value(GRAVITY_ROWS[row], {"m": m, "c": c, "g": g, "√3": ROOT3, **sines})
    # First row of (32) summed by (34)-(36), before d cancels out of it: rounded to some 1e-9 N m.
    turns = [q2 + phase for phase in _PHASES]
    moments = [
        m * g * (c * math.cos(turn) * cosine + d * math.sin(turn))
        for turn, cosine in zip(turns, (c3, c4, c5), strict=True)
    ]
    return -(moments[0] + moments[1] + moments[2])


_FUNCTIONS = {"sin": math.sin, "cos": math.cos, "pi": math.pi}


def value(text: str, names: Mapping[str, float]) -> float:
    """The formula, in the paper's notation, at the values of its symbols, in the order in which it
    is written.

    >>> names = {"c": 2.0, "s3": 0.5, "√3": 3.0**0.5}
    >>> value("-c s3 + 2 c² - (c + √3/2)", names) == -2.0 * 0.5 + 2.0 * 2.0**2 - (2.0 + 3.0**0.5 / 2.0)
    True
    """
    plain = {name.replace("√", "root"): number for name, number in names.items()}
    return float(eval(_code(text), _FUNCTIONS | plain))


@functools.cache
def _code(text: str) -> CodeType:
    python = text.replace("²", "**2").replace("√", "root").replace("π", "*pi")
    python = re.sub(r"(?<=[\w)]) (?=[\w(])", " * ", python)  # a blank between two factors
    return compile(python, text, "eval")
