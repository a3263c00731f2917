"""Evaluate arithmetic in quotes in an input file, such as "11*pi/12".

The text is parsed, and never run as code.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable

from rotor_mbs.scenario.toml_file import as_text

ALLOWED = "numbers, + - * / ** ( ), pi, sqrt(x), hypot(x, y), deg(x)"
MAX_LENGTH = 200  # characters

# What an expression may not contain, although Python would read most of it. In this order: other
# characters; a letter after a digit or point (0x10, 1j, 2pi), except in an exponent; a comma before
# a closing parenthesis; //.
_FORBIDDEN = re.compile(
    r"[^0-9A-Za-z.+\-*/(), \t]"
    r"|(?<=[0-9.])(?![eE][+-]?[0-9])[A-Za-z]"
    r"|,(?=[ \t]*\))"
    r"|//"
)
# Other programs write 007, which Python refuses.
_LEADING_ZEROS = re.compile(r"(?<![0-9A-Za-z.])0+(?=[0-9])")
_OPERATIONS: dict[type[ast.operator], tuple[str, Callable[[float, float], float]]] = {
    ast.Add: ("+", operator.add),
    ast.Sub: ("-", operator.sub),
    ast.Mult: ("*", operator.mul),
    ast.Div: ("/", operator.truediv),
    ast.Pow: ("**", math.pow),
}
# For each name, the function and its number of arguments.
_FUNCTIONS: dict[str, tuple[Callable[..., float], int]] = {
    "sqrt": (math.sqrt, 1),
    "hypot": (math.hypot, 2),
    "deg": (math.radians, 1),
}


def evaluate(text: str) -> float:
    """Return the value of an arithmetic expression.

    Parameters
    ----------
    text : the expression, such as "11*pi/12". `ALLOWED` lists what it may consist of.

    Returns
    -------
    float
        The finite value. The result of every operation is rounded to double precision.

    Raises
    ------
    ValueError
        If the text is too long, is not an expression, or has no finite value.

    Examples
    --------
    >>> evaluate("hypot(3, 4) + 1e-1")
    5.1
    """
    if len(text) > MAX_LENGTH:
        raise ValueError(f"an expression of {len(text)} characters is longer than {MAX_LENGTH}")
    forbidden = _FORBIDDEN.search(text)
    if forbidden:
        raise ValueError(f"{forbidden[0]!a} has no meaning in an expression")
    try:
        # If the nesting is too deep, the parser may raise any of the three errors.
        return _value(ast.parse(_LEADING_ZEROS.sub("", text.strip(" \t")), mode="eval").body)
    except (SyntaxError, MemoryError, RecursionError) as error:
        raise ValueError(f"{as_text(text)} is not a complete expression") from error


def _value(node: ast.expr) -> float:
    """Return the value of a part of an expression.

    Parameters
    ----------
    node : the part as a syntax tree.

    Raises
    ------
    ValueError
        If the part is not arithmetic, or has no finite value.
    """
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return _applied(as_text(ast.unparse(node)), float, number)
        case ast.Name(id="pi"):
            return math.pi
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_value(operand)
        case ast.BinOp(op=op) if type(op) in _OPERATIONS:
            sign, function = _OPERATIONS[type(op)]
            x, y = _value(node.left), _value(node.right)
            return _applied(f"{x:g} {sign} {y:g}", function, x, y)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in _FUNCTIONS:
            function, count = _FUNCTIONS[name]
            if len(arguments) != count:
                noun = "argument" if count == 1 else "arguments"
                raise ValueError(f"{name} takes {count} {noun}, not {len(arguments)}")
            return _applied(name, function, *(_value(argument) for argument in arguments))
    raise ValueError(f"{as_text(ast.unparse(node))} is not a number or an operation on numbers")


def _applied(operation: str, function: Callable[..., float], *arguments: float) -> float:
    """Return the value of a function of the arguments.

    Raises ValueError with the text `operation` if the value is not finite.
    """
    try:
        value = function(*arguments)
    except (ArithmeticError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{operation} has no finite value")
    return value
