"""Numbers and formulas as text: few digits, powers of ten, SI prefixes, a true minus sign."""

from __future__ import annotations

import math
import re

from markupsafe import Markup, escape

NOTHING = "–"  # a number that does not exist
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PREFIXES = (
    (1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"),
    (1e-12, "p"),
)  # fmt: skip
SPACE = "\N{NO-BREAK SPACE}"
_COMPUTED = re.compile(r"(?<![\w./-])(-?\d+(?:\.\d+)?)e([+-]?\d+)\b")
# A symbol with its index: c, q̇2, U33,3. In prose "a" may be a word, E1 is an erratum, and "kg m²" is a unit.
_SYMBOL = re.compile(r"(?<![A-Za-z&#])(q̇|[A-Za-zα-ω])(\d+(?:,\d)?)?(?![A-Za-z])")
_SYMBOL_IN_PROSE = re.compile(r"(?<![A-Za-z&#])(?<!kg )(?<!N )(q̇|[cdmqsUα-ω])(\d+(?:,\d)?)?(?![A-Za-z'])")
_ALONE_IN_PROSE = "cdm"  # symbols there without an index
_SIGN = re.compile(r"(?<![\w)])-(?=\S)|(?<= )-(?= )")


def power(exponent: int) -> str:
    """10⁻¹⁰ for -10."""
    return "10" + str(exponent).translate(_SUPERSCRIPT)


def number(value: float | None, digits: int = 2) -> str:
    """`digits` significant digits: 0.31, 12, 1200, 1.2×10⁻¹⁰; a dash for None, "not finite" for NaN."""
    if value is None:
        return NOTHING
    if not math.isfinite(value):
        return "not finite"
    if value == 0.0:
        return "0"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    if -3 <= int(exponent) < 4:
        return minus(f"{value:.{max(digits - 1 - int(exponent), 0)}f}")
    return minus(f"{mantissa}×{power(int(exponent))}")


def fixed(value: float | None, decimals: int) -> str:
    """So many decimals, as a paper prints them; without the sign of a zero."""
    if value is None:
        return NOTHING
    text = f"{value:.{decimals}f}"
    return minus(text if float(text) else text.lstrip("-"))


def with_unit(value: float | None, unit: str, digits: int = 2) -> str:
    """A number with its unit, without a line break between them."""
    return number(value, digits) if value is None else f"{number(value, digits)}{SPACE}{unit}"


def prefixed(value: float | None, unit: str, digits: int = 3) -> str:
    """With an SI prefix: 1.12 MJ, 687 J, 4.1 mJ; powers of ten beyond tera and below pico."""
    if value is None or not math.isfinite(value) or value == 0.0:
        return with_unit(value, unit, digits)
    rounded = float(f"{value:.{digits - 1}e}")
    if not 1e-12 <= abs(rounded) < 1e15:
        return with_unit(value, unit, min(digits, 2))
    scale, prefix = next((s, p) for s, p in _PREFIXES if abs(rounded) >= s)
    scaled = rounded / scale
    decimals = max(digits - 1 - math.floor(math.log10(abs(scaled))), 0)
    return f"{minus(f'{scaled:.{decimals}f}')}{SPACE}{prefix}{unit}"


def scaled(largest: float) -> tuple[float, str]:
    """What an axis up to `largest` is divided by, and the prefix of its unit for that."""
    return next(((scale, prefix) for scale, prefix in _PREFIXES[2:4] if largest >= scale), (1.0, ""))


def typeset(text: str) -> str:
    """A sentence with its numbers such as 8.1e+00 and 1e-06 as 8.1 and 10⁻⁶; names such as torque-1e9 stay."""

    def shortest(computed: re.Match[str]) -> str:
        mantissa, exponent = computed.groups()
        return (
            power(int(exponent))
            if mantissa == "1"
            else number(float(computed[0]), len(mantissa.strip("-").replace(".", "")))
        )

    return text if isinstance(text, Markup) else _COMPUTED.sub(shortest, text)


def minus(text: str) -> str:
    return text.replace("-", "−")


def formula(text: str, *, in_prose: bool = False) -> Markup:
    """The text with symbols in italics and their indices as subscripts."""
    symbol = _SYMBOL_IN_PROSE if in_prose else _SYMBOL

    def typeset(match: re.Match[str]) -> str:
        if match[2]:
            return f"<i>{match[1]}</i><sub>{match[2]}</sub>"
        return match[0] if in_prose and match[1] not in _ALONE_IN_PROSE else f"<i>{match[1]}</i>"

    return Markup(symbol.sub(typeset, _SIGN.sub("−", str(escape(text)))))
