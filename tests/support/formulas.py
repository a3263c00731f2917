"""Formulas in the paper's notation as Python code, so that a formula's text is the source of its numbers.

>>> names = {"c": 2.0, "s3": 0.5, "√3": 3.0**0.5}
>>> value("-c s3 + 2 c² - (c + √3/2)", names) == -2.0 * 0.5 + 2.0 * 2.0**2 - (2.0 + 3.0**0.5 / 2.0)
True
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Mapping
from types import CodeType

_FUNCTIONS = {"sin": math.sin, "cos": math.cos, "pi": math.pi}


def value(text: str, names: Mapping[str, float]) -> float:
    """The formula at the values of its symbols, evaluated in the order in which it is written."""
    plain = {name.replace("√", "root"): number for name, number in names.items()}
    return float(eval(_code(text), _FUNCTIONS | plain))


@functools.cache
def _code(text: str) -> CodeType:
    python = text.replace("²", "**2").replace("√", "root").replace("π", "*pi")
    python = re.sub(r"(?<=[\w)]) (?=[\w(])", " * ", python)  # a blank between two factors
    return compile(python, text, "eval")
