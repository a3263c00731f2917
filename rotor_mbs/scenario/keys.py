"""Keys of input files: what a value may be, and tables read by the keys that a dataclass declares. Reading returns what
the program keeps, or raises TableError with all that is wrong."""

from __future__ import annotations

import ast
import dataclasses
import json
import math
import operator
import re
import unicodedata
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass
from typing import Any

from rotor_mbs.errors import InputError, nearest
from rotor_mbs.scenario.toml_file import KeyProblem, TableError

ALLOWED = "numbers, + - * / ** ( ), pi, sqrt(x), hypot(x, y), deg(x)"
MAX_LENGTH = 200  # characters

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


def evaluate(text: str) -> float:
    """The finite double that arithmetic in quotes, "11*pi/12", stands for; parsed, never run as code. Every step is
    rounded as Python's floats are. Raises ValueError."""
    if len(text) > MAX_LENGTH:
        raise ValueError(f"an expression of {len(text)} characters is longer than {MAX_LENGTH}")
    forbidden = _FORBIDDEN.search(text)
    if forbidden:
        raise ValueError(f"{forbidden[0]!a} has no meaning in an expression")
    try:
        return _value(ast.parse(_LEADING_ZEROS.sub("", text.strip(" \t")), mode="eval").body)
    except (SyntaxError, MemoryError, RecursionError) as error:
        raise ValueError(f"{shown(text)} is not a complete expression") from error


def _value(node: ast.expr) -> float:
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return _applied(shown(ast.unparse(node)), float, number)
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
                raise ValueError(f"{name} takes {count} argument{'s' if count > 1 else ''}, not {len(arguments)}")
            return _applied(name, function, *(_value(argument) for argument in arguments))
    raise ValueError(f"{shown(ast.unparse(node))} is not a number or an operation on numbers")


def _applied(called: str, function: Callable[..., float], *arguments: float) -> float:
    try:
        value = function(*arguments)
    except (ArithmeticError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{called} has no finite value")
    return value


MAX_NUMBER = 1e300
MAX_TEXT = 200  # characters
# Of what a rotor is and what acts on it, but for zero: inertias, moments and accelerations, products of up to four such
# numbers, are then between 1e-100 and 1e100, and the product of any three of these is a normal double.
SMALLEST, LARGEST = 1e-25, 1e25
_UNPRINTABLE = ("Cc", "Cf", "Cs", "Zl", "Zp")  # Unicode categories: controls, direction marks, line ends


@dataclass(frozen=True)
class Kind:
    """What a value of a file may be."""

    # from the value; where `in_context`, from the value and the values of the keys before it, by field
    read: Callable[..., Any]
    allowed: str  # what a message says is allowed; {unit} stands for the key's unit
    in_context: bool = False
    per_blade: bool = False  # the file may have one value for all blades
    over_time: bool = False  # a value may be a table over time


def file_key(path: str, kind: Kind, unit: str = "1", note: str = "", *, default: Any = MISSING, **more: Any) -> Any:
    """A field of a dataclass that is the key `path` of a file ("": not in the file); note: what a user has to know
    after what is allowed; more: `optional`, the default of a key whose field has none, and what the class adds."""
    shown_unit = "" if unit == "1" else f" ({unit.replace('^2', '²')})"
    allowed = kind.allowed.replace("{unit}", shown_unit) + note
    metadata = {"key": path, "kind": kind, "unit": unit, "allowed": allowed, **more}
    if default is not MISSING:
        metadata = {"optional": default, **metadata}
    return dataclasses.field(default=default, metadata=metadata)


def wrong(what: str, allowed: str = "") -> TableError:
    """The error that a value is wrong, with what is allowed where that is not the key's own text."""
    return TableError([KeyProblem((), what, allowed)])


def counted(count: int, noun: str, plural: str = "") -> str:
    return f"{count} {noun if count == 1 else plural or noun + 's'}"


def shown(value: object) -> str:
    """The value as the file has it, short and on one line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value) if abs(value) < 10**30 else "a number of over 30 digits"
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, str):
        return json.dumps(value if len(value) <= 40 else value[:37] + "...", ensure_ascii=not value.isprintable())
    if isinstance(value, list | tuple):
        return "a list"
    return "a table" if isinstance(value, dict) else "a date or time"


def read_number(value: object) -> float:
    """A finite double, from a number or arithmetic in quotes."""
    result = value
    if isinstance(value, str):
        try:
            result = evaluate(value)
        except ValueError as error:
            raise wrong(f"{shown(value)}: {error}", f"in quotes {ALLOWED}") from error
    if isinstance(result, bool) or not isinstance(result, int | float):
        raise wrong(f"{shown(value)} is not a number")
    if not abs(result) <= MAX_NUMBER:  # so written that NaN fails, too
        raise wrong(f"{shown(value)} is out of range", f"finite numbers, |x| <= {MAX_NUMBER:g}")
    return float(result)


def as_float(value: float) -> float:
    """Return an argument of Python as a float, inf for a whole number above 1e308; raises TypeError for no number."""
    try:
        return math.fsum([value])  # unlike float(value) it takes no text
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def positive(name: str, number: float) -> float:
    """Return the argument called `name`. Raises InputError where it is not above 0, or not finite."""
    if not 0.0 < number < math.inf:
        raise InputError(f"{name}: {number!r}; allowed: a number more than 0")
    return number


def read_text(value: object) -> str:
    if not isinstance(value, str):
        raise wrong(f"{shown(value)} is not text")
    if not value.strip():
        raise wrong("is empty")
    return value


def _read_line(value: object) -> str:
    text = read_text(value)
    if len(text) > MAX_TEXT:
        raise wrong(f"is {len(text)} characters long")
    odd = next((char for char in text if unicodedata.category(char) in _UNPRINTABLE), None)
    if odd is not None:
        raise wrong(f"contains the control character {odd!a}")
    return text


def _read_flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise wrong(f"{shown(value)} is not true or false")
    return value


def _read_number_or_text(value: object) -> float | str:
    try:
        return read_number(value)
    except TableError:
        if not isinstance(value, str):
            raise
        return read_text(value)


def where(
    kind: Kind, is_right: Callable[[Any], bool], allowed: str, what: str = "{} is out of range", allowed_there: str = ""
) -> Kind:
    """What is of `kind` and right; `what` is the message of the others, with {} for the value."""

    def read(value: object) -> Any:
        result = kind.read(value)
        if not is_right(result):
            raise wrong(what.replace("{}", shown(value)), allowed_there)
        return result

    return Kind(read, allowed)


NUMBER = Kind(read_number, "a number{unit}")
_SIZES = f"sizes from {SMALLEST:g} to {LARGEST:g}"
# Numbers of a rotor.
SIZE = where(
    NUMBER, lambda x: x == 0.0 or SMALLEST <= abs(x) <= LARGEST, "a number{unit}", allowed_there=f"0, or {_SIZES}"
)
NOT_NEGATIVE = where(SIZE, lambda x: x >= 0.0, "a number of at least 0{unit}")
_ABOVE_ZERO = where(NUMBER, lambda x: x > 0.0, "a number above 0{unit}")
POSITIVE = where(_ABOVE_ZERO, lambda x: SMALLEST <= x <= LARGEST, _ABOVE_ZERO.allowed, allowed_there=_SIZES)
NUMBER_OR_TEXT = Kind(_read_number_or_text, "a number or a text")
TEXT = Kind(read_text, "a text")
LINE = Kind(_read_line, f"a text of 1 to {MAX_TEXT} characters on one line")
FLAG = Kind(_read_flag, "true or false")


def whole(lowest: int, highest: int, allowed: str = "") -> Kind:
    """A whole number, both ends included."""

    def read(value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise wrong(f"{shown(value)} is not a whole number")
        if not lowest <= value <= highest:
            raise wrong(f"{shown(value)} is out of range")
        return value

    return Kind(read, allowed or f"a whole number from {lowest} to {highest}")


def choice(names: Sequence[str]) -> Kind:

    def read(value: object) -> str:
        if not isinstance(value, str):
            raise wrong(f"{shown(value)} is not text")
        if value not in names:
            raise wrong(f"{shown(value)} is not one of them{nearest(value, names)}")
        return value

    return Kind(read, f"one of {', '.join(names)}")


def read_each(read: Callable[[Any], Any], values: Iterable[Any]) -> tuple[Any, ...]:
    """Every value, read. Raises TableError with the problems of all."""
    return tuple(_read_entries(read, enumerate(values)).values())


def _read_entries(read: Callable[[Any], Any], entries: Iterable[tuple[str | int, Any]]) -> dict[Any, Any]:
    results, problems = {}, []
    for name, value in entries:
        try:
            results[name] = read(value)
        except TableError as error:
            problems += error.below(name)
    if problems:
        raise TableError(problems)
    return results


def list_of(kind: Kind, allowed: str, least: int = 0, most: int | None = None) -> Kind:

    def read(value: object) -> tuple[Any, ...]:
        if not isinstance(value, list):
            raise wrong(f"{shown(value)} is not a list")
        if len(value) < least or (most is not None and len(value) > most):
            raise wrong(counted(len(value), "entry", "entries"))
        return read_each(kind.read, value)

    return Kind(read, allowed)


def dict_of(kind: Kind, allowed: str) -> Kind:

    def read(value: object) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise wrong(f"{shown(value)} is not a table")
        return _read_entries(kind.read, value.items())

    return Kind(read, allowed)


def table_of(cls: type, allowed: str = "") -> Kind:
    """A table with the keys that a dataclass declares; its __post_init__ may raise TableError, too."""
    keys = declared_keys(cls)

    def read(value: object) -> Any:
        if not isinstance(value, dict):
            raise wrong(f"{shown(value)} is not a table")
        return cls(**read_keys(keys, value))

    return Kind(read, allowed)


def declared_keys(cls: Any) -> dict[str, Mapping[str, Any]]:
    """By field, the metadata of the keys that a dataclass declares."""
    return {field.name: field.metadata for field in dataclasses.fields(cls) if field.metadata["key"]}


def read_keys(
    keys: Mapping[str, Mapping[str, Any]],
    tables: Mapping[str, Any],
    also: Callable[[dict[str, Any]], Iterable[KeyProblem]] = lambda _: (),
) -> dict[str, Any]:
    """The values by field. Raises TableError with everything that is wrong, also with what `also` finds in the values
    that could be read."""
    values: dict[str, Any] = {}
    problems: list[KeyProblem] = []
    fields: dict[str, dict[str, str]] = {"": {}}  # by table, "" for the top, the field of each key's name
    for field, key in keys.items():
        table, _, name = key["key"].rpartition(".")
        fields.setdefault(table, {})[name] = field
    for table, own in fields.items():
        given = tables.get(table, {}) if table else tables
        is_needed = any("optional" not in keys[field] for field in own.values())
        if table and ((table not in tables and is_needed) or not isinstance(given, dict)):
            what = f"{shown(given)} is not a table" if table in tables else "is missing"
            problems.append(KeyProblem((table,), what, f"a table with {', '.join(own)}"))
            continue
        path = (table,) if table else ()
        for name, field in own.items():
            key = keys[field]
            if name in given:
                context = [values] if key["kind"].in_context else []
                try:
                    values[field] = key["kind"].read(given[name], *context)
                except TableError as error:
                    problems += error.below(*path, name, allowed=key["allowed"])
            elif "optional" in key and not (table in tables and len(own) == 1):
                values[field] = key["optional"]
            else:
                problems.append(KeyProblem((*path, name), "is missing", key["allowed"]))
        known = [*own] if table else [*own, *filter(None, fields)]
        for name in given:
            if name not in known:
                what = f"unknown key{nearest(name, known)}"
                problems.append(KeyProblem((*path, name), what, ", ".join(known), is_of_key=True))
    problems += also(values)
    if problems:
        raise TableError(problems)
    return values
