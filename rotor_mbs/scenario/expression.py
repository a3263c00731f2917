"""Arithmetic in quotes, "11*pi/12", to a double: parsed by hand, never run as code. Knows nothing of scenes.

sum      product (("+" | "-") product)*
product  signed (("*" | "/") signed)*
signed   "-" signed | power
power    atom ("**" signed)?                 right to left, above the sign: -2**2 = -4
atom     number | "pi" | "sqrt(" sum ")" | "hypot(" sum "," sum ")" | "(" sum ")"
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable

ALLOWED = "numbers, + - * / ** ( ), pi, sqrt(x), hypot(x, y)"
MAX_LENGTH = 200  # characters
MAX_DEPTH = 32  # signs, powers, brackets and calls inside one another

_TOKEN = re.compile(
    r"[ \t]*(?:(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
    r"|(?P<word>[A-Za-z_][A-Za-z_0-9]*)"
    r"|(?P<mark>\*\*|[-+*/(),]))"
)
_OPERATIONS: dict[str, Callable[[float, float], float]] = {
    "+": lambda x, y: x + y,
    "-": lambda x, y: x - y,
    "*": lambda x, y: x * y,
    "/": lambda x, y: x / y,
    "**": math.pow,
}


class ExpressionError(ValueError):
    """A text that is no expression, or has no finite value; `wrong` is the message without what is allowed."""

    def __init__(self, wrong: str) -> None:
        self.wrong = wrong
        super().__init__(f"{wrong}; allowed: {ALLOWED}")


def evaluate(text: str) -> float:
    """The finite double that `text` stands for; every step is rounded as Python's floats are.

    Raises ExpressionError, a ValueError, with one sentence that says what is allowed.
    """
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"an expression of {len(text)} characters is longer than {MAX_LENGTH}")
    parser = _Parser(_tokens(text))
    value = parser.sum()
    parser.expect("", "the end of the expression")
    return value


def _tokens(text: str) -> list[str]:
    """The pieces of `text`, ended by an empty one."""
    tokens = []
    position, end = 0, len(text.rstrip(" \t"))
    while position < end:
        match = _TOKEN.match(text, position)
        if match is None:
            rest = text[position:].lstrip(" \t")
            raise ExpressionError(f"{rest[0]!a} has no meaning in an expression")
        tokens.append(match[0].lstrip(" \t"))
        position = match.end()
    return [*tokens, ""]


class _Parser:
    """Recursive descent over the tokens, computing as it goes: no tree is kept."""

    def __init__(self, tokens: list[str]) -> None:
        self._tokens = tokens
        self._position = 0
        self._depth = 0

    def sum(self) -> float:
        value = self._product()
        while self._next in ("+", "-"):
            value = _apply(self._take(), value, self._product())
        return value

    def expect(self, token: str, called: str) -> None:
        if self._next != token:
            found = f"'{_short(self._next)}'" if self._next else "the end of the expression"
            raise ExpressionError(f"{found} stands where {called} should")
        self._take()

    def _product(self) -> float:
        value = self._signed()
        while self._next in ("*", "/"):
            value = _apply(self._take(), value, self._signed())
        return value

    def _signed(self) -> float:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise ExpressionError(f"an expression is nested deeper than {MAX_DEPTH}")
        if self._next == "-":
            self._take()
            value = -self._signed()
        else:
            value = self._power()
        self._depth -= 1
        return value

    def _power(self) -> float:
        base = self._atom()
        if self._next != "**":
            return base
        return _apply(self._take(), base, self._signed())

    def _atom(self) -> float:
        token = self._next
        if token == "(":
            self._take()
            value = self.sum()
            self.expect(")", "')'")
            return value
        if token[:1].isdigit() or token[:1] == ".":
            return _finite(float(self._take()), _short(token))
        if token == "pi":
            self._take()
            return math.pi
        if token == "sqrt":
            return _apply_call("sqrt", math.sqrt, *self._arguments(1))
        if token == "hypot":
            return _apply_call("hypot", math.hypot, *self._arguments(2))
        found = f"'{_short(token)}'" if token else "the end of the expression"
        raise ExpressionError(f"{found} stands where a number should")

    def _arguments(self, count: int) -> list[float]:
        name = self._take()
        self.expect("(", f"'(' after {name}")
        values = [self.sum()]
        while len(values) < count:
            self.expect(",", f"',' (of {count} arguments of {name})")
            values.append(self.sum())
        self.expect(")", f"')' after {count} argument{'s' if count > 1 else ''} of {name}")
        return values

    @property
    def _next(self) -> str:
        return self._tokens[self._position]

    def _take(self) -> str:
        token = self._next
        # The empty token that ends the list is never passed, so that `_next` always has an answer.
        self._position = min(self._position + 1, len(self._tokens) - 1)
        return token


def _apply(operation: str, x: float, y: float) -> float:
    return _apply_call(f"{x:g} {operation} {y:g}", _OPERATIONS[operation], x, y)


def _apply_call(called: str, function: Callable[..., float], *arguments: float) -> float:
    try:
        value = function(*arguments)
    except (ArithmeticError, ValueError):
        value = math.nan
    return _finite(value, called)


def _finite(value: float, called: str) -> float:
    if not math.isfinite(value):
        raise ExpressionError(f"{called} has no finite value")
    return value


def _short(token: str) -> str:
    return token if len(token) <= 40 else token[:37] + "..."
