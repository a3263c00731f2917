"""Symbols that write down the formula they are put into, so that a printed equation's text and numbers have one source.

    >>> c, s3 = Symbol("c"), Symbol("s3")
    >>> str(-c * s3 + 2 * c**2)
    '-c s3 + 2 c²'

Knows sums, products, quotients and whole powers; drops zeros and ones, simplifies nothing else.
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

    def __repr__(self) -> str:
        return f"Symbol({self.text!r})"

    def __add__(self, other: Operand) -> Operand:
        if _is(other, 0):
            return self
        right = str(other)
        return Symbol(f"{self} - {right[1:]}" if right.startswith("-") else f"{self} + {right}", _SUM)

    def __radd__(self, other: Operand) -> Operand:
        return self if _is(other, 0) else _symbol(other) + self

    def __sub__(self, other: Operand) -> Operand:
        if _is(other, 0):
            return self
        right = _bracketed(other, _PRODUCT)
        return Symbol(f"{self} + {right[1:]}" if right.startswith("-") else f"{self} - {right}", _SUM)

    def __rsub__(self, other: Operand) -> Operand:
        return -self if _is(other, 0) else _symbol(other) - self

    def __mul__(self, other: Operand) -> Operand:
        return _product(self, other)

    def __rmul__(self, other: Operand) -> Operand:
        return _product(other, self)

    def __truediv__(self, other: Operand) -> Operand:
        return Symbol(f"{_bracketed(self, _PRODUCT)}/{_bracketed(other, _ATOM)}", _PRODUCT)

    def __neg__(self) -> Symbol:
        text = _bracketed(self, _PRODUCT)
        return Symbol(text[1:] if text.startswith("-") else f"-{text}", _PRODUCT)

    def __pow__(self, power: int) -> Symbol:
        return Symbol(_bracketed(self, _ATOM) + str(power).translate(_SUPERSCRIPTS))


def _is(operand: Operand, number: int) -> bool:
    return not isinstance(operand, Symbol) and operand == number


def _symbol(operand: Operand) -> Symbol:
    return operand if isinstance(operand, Symbol) else Symbol(f"{operand:g}")


def _bracketed(operand: Operand, at_least: int) -> str:
    formula = _symbol(operand)
    return formula.text if formula.binding >= at_least else f"({formula.text})"


def _product(left: Operand, right: Operand) -> Operand:
    if _is(left, 0) or _is(right, 0):
        return 0
    if _is(left, 1):
        return right
    if _is(right, 1):
        return left
    if _is(right, -1):
        return -left
    factor = _bracketed(right, _PRODUCT)
    return Symbol(f"{_bracketed(left, _PRODUCT)} " + (f"({factor})" if factor.startswith("-") else factor), _PRODUCT)
