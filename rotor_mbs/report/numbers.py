"""Write numbers and formulas as text: few digits, powers of ten, SI prefixes, a true minus sign."""

from __future__ import annotations

import math
import re

from markupsafe import Markup, escape

NOTHING = "–"  # text in place of a number that does not exist
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# There are no prefixes for numbers below 1. A moment of 1e-3 N m beside one of 1e3 N m is to look
# small, which "1 mN m" would not.
_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""))
SPACE = "\N{NO-BREAK SPACE}"
_COMPUTED = re.compile(r"(?<![\w./-])(-?\d+(?:\.\d+)?)e([+-]?\d+)\b")
# A symbol with its index, if it has one: c, q̇2, U33,3. The pattern for prose excludes words such as
# "a", errata such as E1, and the m of units such as "kg m²".
_SYMBOL = re.compile(r"(?<![A-Za-z&#])(q̇|[A-Za-zα-ω])(\d+(?:,\d)?)?(?![A-Za-z])")
_SYMBOL_IN_PROSE = re.compile(
    r"(?<![A-Za-z&#])(?<!kg )(?<!N "
    r")(q̇|[cdmqsUα-ω])(\d+(?:,\d)?)?(?![A-Za-z'])"
)
_ALONE_IN_PROSE = "cdm"  # letters that are symbols in prose even without an index
_SIGN = re.compile(r"(?<![\w)])-(?=\S)|(?<= )-(?= )")


def power(exponent: int) -> str:
    """Return a power of ten as text: "10⁻¹⁰" for -10."""
    return "10" + str(exponent).translate(_SUPERSCRIPT)


def number(value: float | None, digits: int = 2) -> str:
    """Return a number as text with few significant digits: 0.31, 12, 1200, 1.2×10⁻¹⁰.

    Parameters
    ----------
    value : the number. None gives a dash; NaN and infinities give "not finite".
    digits : number of significant digits.
    """
    if value is None:
        return NOTHING
    if not math.isfinite(value):
        return "not finite"
    if value == 0.0:
        return "0"
    # The exponent is that of the rounded number: 9.99 with two digits is 10.
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    if -3 <= int(exponent) < 4:
        return minus(f"{value:.{max(digits - 1 - int(exponent), 0)}f}")
    return minus(f"{mantissa}×{power(int(exponent))}")


def typeset_title(title: str) -> str:
    """Return a scene's title with π and ° in place of "pi" and "degrees".

    >>> typeset_title("Rotor at 30 degrees and pi/10 rad/s")
    'Rotor at 30° and π/10 rad/s'
    """
    return title.replace(" degrees", "°").replace("pi/", "π/")


def fixed(value: float | None, decimals: int) -> str:
    """Return a number as text with a given number of decimals, as a paper prints it.

    A number that is rounded to zero has no sign. None gives a dash.
    """
    if value is None:
        return NOTHING
    text = f"{value:.{decimals}f}"
    return minus(text if float(text) else text.lstrip("-"))


def with_unit(value: float | None, unit: str, digits: int = 2) -> str:
    """Return a number with its unit as text, without a line break between them."""
    return number(value, digits) if value is None else f"{number(value, digits)}{SPACE}{unit}"


def prefix_of(largest: float) -> tuple[float, str]:
    """Return the scale by which values are divided, and the prefix of their unit: k, M, G or "".

    `largest` is the largest magnitude of the values.

    >>> prefix_of(4.2e4)
    (1000.0, 'k')
    """
    for scale, prefix in _PREFIXES[:-1]:
        if largest >= scale:
            return scale, prefix
    return 1.0, ""


def prefixed(value: float | None, unit: str, digits: int = 3) -> str:
    """Return a number with its unit as text; the unit of a large number has a prefix: "1.12 MJ"."""
    if value is None or not math.isfinite(value) or value == 0.0:
        return with_unit(value, unit, digits)
    # The prefix is that of the rounded number: 999.9 with three digits is 1.00 k.
    rounded = float(f"{value:.{digits - 1}e}")
    scale, prefix = prefix_of(abs(rounded))
    return f"{number(value / scale, digits)}{SPACE}{prefix}{unit}"


def up_to(value: float | None, digits: int = 2) -> str:
    """Return a magnitude as text, rounded up: 2.4×10⁻⁶ for 2.33e-6.

    A sentence such as "they agree within 2.4×10⁻⁶" is thus true.

    >>> up_to(2.33e-6), up_to(5.19e-6, 1), up_to(0.0)
    ('2.4×10⁻⁶', '6×10⁻⁶', '0')
    """
    if value is None or not math.isfinite(value) or value == 0.0:
        return number(value, digits)
    step = 10.0 ** (math.floor(math.log10(value)) - digits + 1)
    # If the value has no more than these digits, the quotient may be slightly above a whole number
    # because of rounding. The factor prevents that such a value is rounded up.
    return number(math.ceil(value / step * (1.0 - 1e-12)) * step, digits)


def span(low: float, high: float, digits: int = 3, unit: str = "") -> str:
    """Return a range of two numbers as text, both rounded to the last digit of the larger one.

    A number that is much smaller than the larger one is thus written as zero. If both numbers have
    the same text, the range is a single number.

    Parameters
    ----------
    low, high : ends of the range.
    digits : number of significant digits of the end with the larger magnitude.
    unit : text directly after each number, such as "°".

    Examples
    --------
    >>> span(-0.00189, 1.75), span(-11.46, 11.2, unit="°"), span(0.8249, 0.8251)
    ('0 to 1.75', '−11.5° to 11.2°', '0.825')
    """
    largest = max(abs(low), abs(high))
    ends = [low, high]
    if largest > 0.0 and math.isfinite(largest):
        step = 10.0 ** (math.floor(math.log10(largest)) - digits + 1)
        ends = [round(value / step) * step for value in ends]
    return text_range(*(f"{number(value, digits)}{unit}" for value in ends))


def text_range(low: str, high: str) -> str:
    """Return a range of two numbers that are given as text; a single one if the texts are equal.

    >>> text_range("0.824", "0.825"), text_range("0.825", "0.825")
    ('0.824 to 0.825', '0.825')
    """
    return low if low == high else f"{low} to {high}"


def shortest(value: float) -> str:
    """Return a number as text with all its digits, up to six: 0, 300, 10⁵, 3.2×10⁴, 9.81.

    It is meant for numbers that a user chose, which have few digits.

    >>> shortest(1e5), shortest(300.0), shortest(-3.2e4), shortest(1e-3)
    ('10⁵', '300', '−3.2×10⁴', '0.001')
    """
    if value == 0.0 or not math.isfinite(value) or 1e-3 <= abs(value) < 1e4:
        return minus(f"{value:.6g}")
    mantissa, exponent = f"{value:.5e}".split("e")
    mantissa = mantissa.rstrip("0").rstrip(".")
    ten = power(int(exponent))
    return minus({"1": ten, "-1": f"-{ten}"}.get(mantissa, f"{mantissa}×{ten}"))


def seconds(value: float) -> str:
    """Return a time in s as text with at most three digits and its unit: "20 s", "3.45 s".

    >>> seconds(20.0).replace(SPACE, " "), seconds(3.449).replace(SPACE, " ")
    ('20 s', '3.45 s')
    """
    return f"{shortest(float(f'{value:.3g}'))}{SPACE}s"


def in_words(count: int) -> str:
    """Return a count up to ten as a word, such as "three", and a larger one in digits.

    >>> in_words(3), in_words(17)
    ('three', '17')
    """
    words = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
    return words[count] if count < len(words) else str(count)


def typeset(text: str) -> str:
    """Return a text with numbers in e-notation typeset: 8.1 for 8.1e+00, 10⁻⁶ for 1e-06.

    Names such as torque-1e9 are not changed. A text that is already markup is not changed either.
    """

    def shortest(computed: re.Match[str]) -> str:
        mantissa, exponent = computed.groups()
        return (
            power(int(exponent))
            if mantissa == "1"
            else number(float(computed[0]), len(mantissa.strip("-").replace(".", "")))
        )

    return text if isinstance(text, Markup) else _COMPUTED.sub(shortest, text)


def minus(text: str) -> str:
    """Return the text with true minus signs in place of hyphens."""
    return text.replace("-", "−")


def formula(text: str, *, in_prose: bool = False) -> Markup:
    """Return a text as markup with symbols in italics and their indices as subscripts.

    Parameters
    ----------
    text : the text.
    in_prose : whether the text is prose with symbols. A letter without an index is then a symbol
        only if it is c, d or m.
    """
    symbol = _SYMBOL_IN_PROSE if in_prose else _SYMBOL

    def typeset(match: re.Match[str]) -> str:
        if match[2]:
            return f"<i>{match[1]}</i><sub>{match[2]}</sub>"
        return match[0] if in_prose and match[1] not in _ALONE_IN_PROSE else f"<i>{match[1]}</i>"

    return Markup(symbol.sub(typeset, _SIGN.sub("−", str(escape(text)))))
