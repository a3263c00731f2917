"""Arithmetic in quotes, "11*pi/12", to a double: parsed, never run as code."""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable

ALLOWED = "numbers, + - * / ** ( ), pi, sqrt(x), hypot(x, y), deg(x)"
MAX_LENGTH = 200  # characters
MAX_DEPTH = 32  # signs, right operands and calls inside one another

# What Python would read but an expression may not hold: other characters, 0x10, 1j, 2pi, a comma that ends a list.
_FORBIDDEN = re.compile(r"[^0-9A-Za-z.+\-*/(), \t]|(?<=[0-9.])(?![eE][+-]?[0-9])[A-Za-z]|,(?=[ \t]*\))|//")
_LEADING_ZEROS = re.compile(r"(?<![0-9A-Za-z.])0+(?=[0-9])")
_OPERATIONS: dict[type[ast.operator], tuple[str, Callable[[float, float], float]]] = {
    ast.Add: ("+", operator.add),
    ast.Sub: ("-", operator.sub),
    ast.Mult: ("*", operator.mul),
    ast.Div: ("/", operator.truediv),
    ast.Pow: ("**", math.pow),
}
_FUNCTIONS: dict[str, tuple[Callable[..., float], int]] = {
    "sqrt": (math.sqrt, 1),
    "hypot": (math.hypot, 2),
    "deg": (math.radians, 1),
}


class ExpressionError(ValueError):
    """A text that is no expression, or has no finite value; `wrong` is the message without what is allowed."""

    def __init__(self, wrong: str) -> None:
        self.wrong = wrong
        super().__init__(f"{wrong}; allowed: {ALLOWED}")


def evaluate(text: str) -> float:
    """The finite double that `text` stands for, every step rounded as Python's floats are. Raises ExpressionError."""
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"an expression of {len(text)} characters is longer than {MAX_LENGTH}")
    forbidden = _FORBIDDEN.search(text)
    if forbidden:
        raise ExpressionError(f"{forbidden[0]!a} has no meaning in an expression")
    try:
        tree = ast.parse(_LEADING_ZEROS.sub("", text.strip(" \t")), mode="eval")
    except (SyntaxError, MemoryError, RecursionError) as error:
        raise ExpressionError(f"{_shown(text)} is not a complete expression") from error
    return _value(tree.body, 1)


def _value(node: ast.expr, depth: int) -> float:
    if depth > MAX_DEPTH:
        raise ExpressionError(f"an expression is nested deeper than {MAX_DEPTH}")
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return _applied(_shown(ast.unparse(node)), float, number)
        case ast.Name(id="pi"):
            return math.pi
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_value(operand, depth + 1)
        case ast.BinOp(op=op) if type(op) in _OPERATIONS:
            sign, function = _OPERATIONS[type(op)]
            # A sum of many terms is a chain of left operands: no deeper than its first one.
            x, y = _value(node.left, depth), _value(node.right, depth + 1)
            return _applied(f"{x:g} {sign} {y:g}", function, x, y)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in _FUNCTIONS:
            function, count = _FUNCTIONS[name]
            if len(arguments) != count:
                raise ExpressionError(f"{name} takes {count} argument{'s' if count > 1 else ''}, not {len(arguments)}")
            return _applied(name, function, *(_value(argument, depth + 1) for argument in arguments))
    raise ExpressionError(f"{_shown(ast.unparse(node))} is not a number or an operation on numbers")


def _applied(called: str, function: Callable[..., float], *arguments: float) -> float:
    try:
        value = function(*arguments)
    except (ArithmeticError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise ExpressionError(f"{called} has no finite value")
    return value


def _shown(text: str) -> str:
    short = text if len(text) <= 40 else f"{text[:37]}..."
    return f"'{short}'" if short.isprintable() else ascii(short)  # a tab
