"""Symbols that write down the formula they are put into, so that a formula's text and numbers have one source.

    >>> c, s3 = Symbol("c"), Symbol("s3")
    >>> str(-c * s3 + 2 * c**2)
    '-c s3 + 2 c²'

Sums, products, quotients and whole powers; zeros and ones are dropped, nothing else is simplified.
"""

from __future__ import annotations

from typing import Union

Operand = Union["Symbol", int, float]

_SUM, _PRODUCT, _ATOM = 0, 1, 2  # how tightly a text holds together
_SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


class Symbol:
    """A formula as text; `binding` tells whether it needs brackets inside another."""

    def __init__(self, text: str, binding: int = _ATOM) -> None:
        self.text = text
        self.binding = binding

    def __str__(self) -> str:
        return self.text

    def __add__(self, other: Operand) -> Operand:
        if _is(other, 0):
            return self
        right = str(other)
        return self._formula(f"{self} - {right[1:]}" if right.startswith("-") else f"{self} + {right}", _SUM)

    def __radd__(self, other: Operand) -> Operand:
        return self if _is(other, 0) else self._formula(str(other)) + self

    def __sub__(self, other: Operand) -> Operand:
        if _is(other, 0):
            return self
        right = _bracketed(other, _PRODUCT)
        return self._formula(f"{self} + {right[1:]}" if right.startswith("-") else f"{self} - {right}", _SUM)

    def __rsub__(self, other: Operand) -> Operand:
        return -self if _is(other, 0) else self._formula(str(other)) - self

    def __mul__(self, other: Operand) -> Operand:
        return self._product(self, other)

    def __rmul__(self, other: Operand) -> Operand:
        return self._product(other, self)

    def __truediv__(self, other: Operand) -> Operand:
        return self._formula(f"{_bracketed(self, _PRODUCT)}/{_bracketed(other, _ATOM)}", _PRODUCT)

    def __neg__(self) -> Symbol:
        text = _bracketed(self, _PRODUCT)
        return self._formula(text[1:] if text.startswith("-") else f"-{text}", _PRODUCT)

    def __pow__(self, power: int) -> Symbol:
        return self._formula(_bracketed(self, _ATOM) + str(power).translate(_SUPERSCRIPTS))

    def _formula(self, text: str, binding: int = _ATOM) -> Symbol:
        return type(self)(text, binding)

    def _product(self, left: Operand, right: Operand) -> Operand:
        if _is(left, 0) or _is(right, 0):
            return 0
        if _is(left, 1):
            return right
        if _is(right, 1):
            return left
        if _is(right, -1):
            return -left
        factor = _bracketed(right, _PRODUCT)
        factor = f"({factor})" if factor.startswith("-") else factor
        return self._formula(f"{_bracketed(left, _PRODUCT)} {factor}", _PRODUCT)


def _is(operand: Operand, number: int) -> bool:
    return not isinstance(operand, Symbol) and operand == number


def _bracketed(operand: Operand, at_least: int) -> str:
    return f"({operand})" if isinstance(operand, Symbol) and operand.binding < at_least else str(operand)
