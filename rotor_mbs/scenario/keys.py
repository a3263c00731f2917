"""Declare what values of keys and settings are allowed, and read them.

A `Kind` converts a value and says in words what is allowed; kinds are made from one another: a
number, a number within limits, a list of them. A field of a dataclass declares a key of a file by
`file_key`, a setting of a method by the functions of `methods.settings`; both are read through the
kind. What is wrong is raised as a TableError, all of a file at once.
"""

from __future__ import annotations

import dataclasses
import math
import unicodedata
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass
from numbers import Real
from typing import Any

from rotor_mbs.errors import InputError, nearest
from rotor_mbs.scenario import expressions
from rotor_mbs.scenario.toml_file import KeyProblem, TableError, as_text

MAX_NUMBER = 1e300
MAX_TEXT = 200  # characters
# Of what a rotor is and what acts on it, but for zero: inertias, moments and accelerations,
# products of up to four such numbers, are then between 1e-100 and 1e100, and the product of any
# three of these is a normal double.
SMALLEST, LARGEST = 1e-25, 1e25
# Unicode categories: controls, direction marks, line ends. They would spoil a terminal.
_UNPRINTABLE = ("Cc", "Cf", "Cs", "Zl", "Zp")


@dataclass(frozen=True)
class Kind:
    """What a value may be.

    Attributes
    ----------
    read : (value) -> the value as the program keeps it; raises TableError where it is not allowed.
        With `in_context`: (value, values of the keys before it by field).
    allowed : what is allowed, for messages; {unit} stands for the unit.
    in_context : whether what is allowed depends on the keys before it.
    per_blade : whether a file may have one value for all blades.
    over_time : whether a value may be a table over time.
    options : the allowed values of a choice; () for any other kind.
    """

    read: Callable[..., Any]
    allowed: str
    in_context: bool = False
    per_blade: bool = False
    over_time: bool = False
    options: tuple[object, ...] = ()

    def accepts(self, value: object) -> bool:
        """Return whether a value is allowed."""
        try:
            self.read(value)
        except TableError:
            return False
        return True


# Declarations


def declaration(
    kind: Kind,
    unit: str,
    shown_unit: str,
    note: str = "",
    **more: Any,
) -> dict[str, Any]:
    """Return the metadata of a dataclass field that declares a value.

    Parameters
    ----------
    kind : what the value may be.
    unit : its unit.
    shown_unit : the unit as it follows a number in messages.
    note : what a user has to know beyond the kind, after it in messages.
    **more : what else the class wants to know of its fields.
    """
    return {
        "kind": kind,
        "unit": unit,
        "allowed": kind.allowed.replace("{unit}", shown_unit) + note,
        **more,
    }


def file_key(
    path: str,
    kind: Kind,
    unit: str = "1",
    note: str = "",
    *,
    default: Any = MISSING,
    **more: Any,
) -> Any:
    """Declare a field of a dataclass that is a key of a file.

    Parameters
    ----------
    path : the key, with its table: "hub.inertia"; "" for a field that is not in the file.
    kind : what its value may be.
    unit : its unit; "1" for none.
    note : what a user has to know beyond the kind, after it in messages.
    default : of the field and of the key, which then may be missing in a file.
    **more : `optional`, the default of a key whose field has none, and what the class adds.
    """
    shown_unit = "" if unit == "1" else f" ({unit.replace('^2', '²')})"
    metadata = declaration(kind, unit, shown_unit, note, key=path, **more)
    if default is not MISSING:
        metadata.setdefault("optional", default)
    return dataclasses.field(default=default, metadata=metadata)


def declared_keys(cls: Any) -> dict[str, Mapping[str, Any]]:
    """Return the metadata of the keys that a dataclass declares, by field."""
    fields = dataclasses.fields(cls)
    return {field.name: field.metadata for field in fields if field.metadata["key"]}


# Messages


def invalid(what: str, allowed: str = "") -> TableError:
    """Return the error of a value.

    Parameters
    ----------
    what : what is wrong.
    allowed : what is allowed, where that is more than the kind says of all values.
    """
    return TableError([KeyProblem((), what, allowed)])


def counted(count: int, noun: str, plural: str = "") -> str:
    """Return a number with its noun: "1 entry", "2 entries"; by default the plural has an s."""
    return f"{count} {noun if count == 1 else plural or noun + 's'}"


# Single values


def read_number(value: object) -> float:
    """Return a finite float, from a number or from arithmetic in quotes.

    Parameters
    ----------
    value : as a file has it.

    Raises
    ------
    TableError
        If it is no number, or out of range.
    """
    result = value
    if isinstance(value, str):
        try:
            result = expressions.evaluate(value)
        except ValueError as error:
            allowed = f"in quotes {expressions.ALLOWED}"
            shown = as_text(value)
            reason = str(error)
            # The reason may begin with the whole text, or a part of it.
            what = reason if reason.startswith(f"{shown} ") else f"{shown}: {reason}"
            raise invalid(what, allowed) from error
    if isinstance(result, bool) or not isinstance(result, Real):
        raise invalid(f"{as_text(value)} is not a number")
    number = as_float(result)
    if not abs(number) <= MAX_NUMBER:  # so written that NaN fails, too
        raise invalid(f"{as_text(value)} is out of range", f"finite numbers, |x| <= {MAX_NUMBER:g}")
    return number


def read_python_number(value: object) -> float:
    """Return a finite float, from a number alone: Python code writes its own arithmetic."""
    if isinstance(value, str):
        raise invalid(f"{as_text(value)} is not a number")
    return read_number(value)


def _read_whole(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise invalid(f"{as_text(value)} is not a whole number")
    return value


def _read_python_whole(value: object) -> int:
    """Return an int, also from a whole float: settings of a scene file are read as floats."""
    number = read_python_number(value)
    if number != int(number):
        raise invalid(f"{as_text(value)} is not a whole number")
    return int(number)


def as_float(value: float | Real) -> float:
    """Return a number as a float, inf for an int above 1e308. Raises TypeError for no number."""
    try:
        return math.fsum([value])  # unlike float(value) it takes no text
    except OverflowError:
        return -math.inf if value < 0 else math.inf


def positive(name: str, number: float) -> float:
    """Return the argument called `name`. Raises InputError unless it is above 0 and finite."""
    if not 0.0 < number < math.inf:
        raise InputError(f"{name}: {number!r}; allowed: a number more than 0")
    return number


def read_text(value: object) -> str:
    """Return a text that is not blank. Raises TableError."""
    if not isinstance(value, str):
        raise invalid(f"{as_text(value)} is not text")
    if not value.strip():
        raise invalid("is empty")
    return value


def _read_line(value: object) -> str:
    text = read_text(value)
    if len(text) > MAX_TEXT:
        raise invalid(f"is {len(text)} characters long")
    for character in text:
        if unicodedata.category(character) in _UNPRINTABLE:
            raise invalid(f"contains the control character {character!a}")
    return text


def _read_flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise invalid(f"{as_text(value)} is not true or false")
    return value


def _read_number_or_text(value: object) -> float | str:
    try:
        return read_number(value)
    except TableError:
        if not isinstance(value, str):
            raise
        return read_text(value)


def restricted(
    kind: Kind,
    is_right: Callable[[Any], bool],
    allowed: str,
    what: str = "{} is out of range",
    allowed_there: str = "",
) -> Kind:
    """Return the kind of those values of a kind that fulfil a condition.

    Parameters
    ----------
    kind : the values to choose from.
    is_right : (value, as `kind` returns it) -> whether it is allowed.
    allowed : what is allowed, for all messages.
    what : the message for a value that `is_right` refuses; {} stands for the value.
    allowed_there : what is allowed, in this message alone.
    """

    def read(value: object) -> Any:
        result = kind.read(value)
        if not is_right(result):
            raise invalid(what.replace("{}", as_text(value)), allowed_there)
        return result

    return Kind(read, allowed)


def within(
    kind: Kind,
    *,
    above: float = -math.inf,
    at_least: float = -math.inf,
    at_most: float = math.inf,
    allowed: str = "",
) -> Kind:
    """Return the kind of those numbers of a kind that lie within limits.

    Parameters
    ----------
    kind : the numbers to choose from.
    above, at_least, at_most : exclusive lower, inclusive lower and inclusive upper limit.
    allowed : what is allowed; by default the limits are written behind what `kind` allows.
    """

    def is_within(number: float) -> bool:
        return number > above and at_least <= number <= at_most

    if not allowed:
        named_limits = {"above": above, "at least": at_least, "at most": at_most}
        limits = [f"{name} {x:g}" for name, x in named_limits.items() if math.isfinite(x)]
        text = " " + " and ".join(limits) if limits else ""
        allowed = kind.allowed.replace("{unit}", text + "{unit}")
    return restricted(kind, is_within, allowed)


# A finite number; the second one of Python code, which may not be in quotes.
NUMBER = Kind(read_number, "a number{unit}")
PYTHON_NUMBER = Kind(read_python_number, NUMBER.allowed)
WHOLE = Kind(_read_whole, "a whole number{unit}")
PYTHON_WHOLE = Kind(_read_python_whole, WHOLE.allowed)

# Numbers of a rotor.
_SIZES = f"sizes from {SMALLEST:g} to {LARGEST:g}"
SIZE = restricted(
    NUMBER,
    lambda x: x == 0.0 or SMALLEST <= abs(x) <= LARGEST,
    NUMBER.allowed,
    allowed_there=f"0, or {_SIZES}",
)
NOT_NEGATIVE = within(SIZE, at_least=0.0, allowed="a number of at least 0{unit}")
_ABOVE_ZERO = within(NUMBER, above=0.0)
POSITIVE = restricted(
    _ABOVE_ZERO,
    lambda x: SMALLEST <= x <= LARGEST,
    _ABOVE_ZERO.allowed,
    allowed_there=_SIZES,
)

NUMBER_OR_TEXT = Kind(_read_number_or_text, "a number or a text")
TEXT = Kind(read_text, "a text")
LINE = Kind(_read_line, f"a text of 1 to {MAX_TEXT} characters on one line")
FLAG = Kind(_read_flag, "true or false")


def whole(lowest: int, highest: int, allowed: str = "") -> Kind:
    """Return the kind of whole numbers from `lowest` to `highest`; `allowed`: in other words."""
    allowed = allowed or f"a whole number from {lowest} to {highest}"
    return within(WHOLE, at_least=lowest, at_most=highest, allowed=allowed)


def choice(options: Sequence[object], allowed: str = "") -> Kind:
    """Return the kind of a value that is one of some options.

    Parameters
    ----------
    options : the allowed values.
    allowed : what is allowed, in words; by default the options.
    """
    are_texts = all(isinstance(option, str) for option in options)
    names = [str(option) for option in options]

    def is_option(value: object) -> bool:
        if not isinstance(value, Hashable):  # the comparison with an array has no truth value
            return False
        # True and 1 are equal, and are not the same choice.
        is_flag = isinstance(value, bool)
        return any(value == option and isinstance(option, bool) is is_flag for option in options)

    def read(value: object) -> Any:
        if are_texts and not isinstance(value, str):
            raise invalid(f"{as_text(value)} is not text")
        if not is_option(value):
            hint = nearest(value, names) if isinstance(value, str) else ""
            raise invalid(f"{as_text(value)} is not one of them{hint}")
        return value

    return Kind(read, allowed or f"one of {', '.join(names)}", options=tuple(options))


# Lists and tables


def read_each(read: Callable[[Any], Any], values: Iterable[Any]) -> tuple[Any, ...]:
    """Return every value, read. Raises TableError with the problems of all."""
    return tuple(_read_entries(read, enumerate(values)).values())


def _read_entries(
    read: Callable[[Any], Any],
    entries: Iterable[tuple[str | int, Any]],
) -> dict[Any, Any]:
    """Return every value of a list or table by its place.

    Parameters
    ----------
    read : reads one value.
    entries : place and value of each.

    Raises
    ------
    TableError
        With the problems of all values.
    """
    results: dict[Any, Any] = {}
    problems: list[KeyProblem] = []
    for place, value in entries:
        try:
            results[place] = read(value)
        except TableError as error:
            problems += error.under(place)
    if problems:
        raise TableError(problems)
    return results


def list_of(kind: Kind, allowed: str, least: int = 0, most: int | None = None) -> Kind:
    """Return the kind of a list, read as a tuple.

    Parameters
    ----------
    kind : of each entry.
    allowed : what is allowed, in words.
    least, most : how many entries it may have; None: any number.
    """

    def read(value: object) -> tuple[Any, ...]:
        if not isinstance(value, list):
            raise invalid(f"{as_text(value)} is not a list")
        if len(value) < least or (most is not None and len(value) > most):
            raise invalid(counted(len(value), "entry", "entries"))
        return read_each(kind.read, value)

    return Kind(read, allowed)


def dict_of(kind: Kind, allowed: str) -> Kind:
    """Return the kind of a table of any keys, whose values are of one kind."""

    def read(value: object) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise invalid(f"{as_text(value)} is not a table")
        return _read_entries(kind.read, value.items())

    return Kind(read, allowed)


def table_of(cls: type, allowed: str = "") -> Kind:
    """Return the kind of a table with the keys that a dataclass declares, read as the dataclass.

    Its __post_init__ may raise TableError for values that do not fit one another.
    """
    keys = declared_keys(cls)

    def read(value: object) -> Any:
        if not isinstance(value, dict):
            raise invalid(f"{as_text(value)} is not a table")
        return cls(**read_keys(keys, value))

    return Kind(read, allowed)


def read_keys(
    keys: Mapping[str, Mapping[str, Any]],
    tables: Mapping[str, Any],
    extra_check: Callable[[dict[str, Any]], Iterable[KeyProblem]] | None = None,
) -> dict[str, Any]:
    """Return the values of a file's tables.

    Parameters
    ----------
    keys : metadata of the declared keys by field, as of `declared_keys`; in this order they are
        read, so that a key in context finds those before it.
    tables : as the file has them.
    extra_check : (values that could be read, by field) -> what else is wrong with them.

    Returns
    -------
    dict
        The values by field; that of a key which the file does not have is its default.

    Raises
    ------
    TableError
        With everything that is wrong.
    """
    values: dict[str, Any] = {}
    problems: list[KeyProblem] = []
    fields_by_table = _fields_by_table(keys)
    for table, fields in fields_by_table.items():
        entries = tables.get(table, {}) if table else tables
        is_required = any("optional" not in keys[field] for field in fields.values())
        is_missing = table not in tables and is_required
        if table and (is_missing or not isinstance(entries, dict)):
            what = "is missing" if is_missing else f"{as_text(entries)} is not a table"
            problems.append(KeyProblem((table,), what, f"a table with {', '.join(fields)}"))
            continue
        path = (table,) if table else ()
        for name, field in fields.items():
            key = keys[field]
            if name in entries:
                context = [values] if key["kind"].in_context else []
                try:
                    values[field] = key["kind"].read(entries[name], *context)
                except TableError as error:
                    problems += error.under(*path, name, allowed=key["allowed"])
            # A table that has one key alone was written for it: without the key it is a mistake.
            elif "optional" in key and not (table in tables and len(fields) == 1):
                values[field] = key["optional"]
            else:
                problems.append(KeyProblem((*path, name), "is missing", key["allowed"]))
        names = [*fields] if table else [*fields, *filter(None, fields_by_table)]
        problems += _unknown_names(path, entries, names)
    if extra_check is not None:
        problems += extra_check(values)
    if problems:
        raise TableError(problems)
    return values


def _fields_by_table(keys: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, str]]:
    """Return the field of each key by table ("" for the top of the file) and name in it."""
    fields: dict[str, dict[str, str]] = {"": {}}
    for field, key in keys.items():
        table, _, name = key["key"].rpartition(".")
        fields.setdefault(table, {})[name] = field
    return fields


def _unknown_names(
    path: tuple[str, ...],
    entries: Mapping[str, Any],
    names: Sequence[str],
) -> list[KeyProblem]:
    """Return a problem for each entry of the table at `path` whose name is none of `names`."""
    problems = []
    for name in entries:
        if name not in names:
            what = f"unknown key{nearest(name, names)}"
            problems.append(KeyProblem((*path, name), what, ", ".join(names), is_of_key=True))
    return problems
