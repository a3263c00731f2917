"""Declare what values of keys and settings are allowed, and read them.

A `Kind` converts a value, and says in words which values are allowed. Kinds are made from simpler
kinds: a number, a number within limits, a list of such numbers. A field of a dataclass declares a
key of a file (by `file_key`) or a setting of a method (by the functions of `methods.settings`). The
kind in the declaration reads the value. All errors of a file are raised together in one TableError.
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
# Limits of the size of numbers that describe a rotor or its loads, except zero. Inertias, moments
# and accelerations are products of up to four such numbers. With these limits, they are between
# 1e-100 and 1e100, and the product of any three of them is a normal double.
SMALLEST, LARGEST = 1e-25, 1e25
# Unicode categories of control characters, direction marks, surrogates and line ends. They would
# corrupt the output on a terminal.
_UNPRINTABLE = ("Cc", "Cf", "Cs", "Zl", "Zp")


@dataclass(frozen=True)
class Kind:
    """What a value of a key or setting may be: how it is read, and what is allowed in words.

    Attributes
    ----------
    read : (value) -> the converted value. It raises TableError for a value that is not allowed. If
        `in_context` is set, its second argument has the values that were read before, by field.
    allowed : the allowed values in words, for messages; {unit} stands for the unit.
    in_context : whether the allowed values depend on the values of keys that were read before.
    per_blade : whether a file may have one value for all blades in place of a list.
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
    unit : unit of the value.
    shown_unit : text that stands for {unit} in `kind.allowed`.
    note : text that follows the allowed values in messages.
    **more : further entries of the metadata.
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
    path : the key with its table, such as "hub.inertia"; "" for a field that is not in the file.
    kind : what the value of the key may be.
    unit : unit of the value; "1" for none.
    note : text that follows the allowed values in messages.
    default : default value of the field. If it is given, the key may be missing in a file.
    **more : further entries of the metadata. With `optional`, the key may be missing although the
        field has no default; `optional` is then its value.
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
    """Return a TableError with one problem of a value.

    Parameters
    ----------
    what : what is wrong.
    allowed : what is allowed; "" if the declaration of the key says it.
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
    value : value in a file.

    Raises
    ------
    TableError
        If the value is not a number, or is out of range.
    """
    result = value
    if isinstance(value, str):
        try:
            result = expressions.evaluate(value)
        except ValueError as error:
            allowed = f"in quotes {expressions.ALLOWED}"
            shown = as_text(value)
            reason = str(error)
            # The reason may already begin with the text; then the text is not repeated.
            what = reason if reason.startswith(f"{shown} ") else f"{shown}: {reason}"
            raise invalid(what, allowed) from error
    if isinstance(result, bool) or not isinstance(result, Real):
        raise invalid(f"{as_text(value)} is not a number")
    number = as_float(result)
    if not abs(number) <= MAX_NUMBER:  # this form also refuses NaN
        raise invalid(f"{as_text(value)} is out of range", f"finite numbers, |x| <= {MAX_NUMBER:g}")
    return number


def read_python_number(value: object) -> float:
    """Return a finite float from a number.

    Arithmetic in quotes is refused, as Python code can compute the number itself.
    """
    if isinstance(value, str):
        raise invalid(f"{as_text(value)} is not a number")
    return read_number(value)


def _read_whole(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise invalid(f"{as_text(value)} is not a whole number")
    return value


def _read_python_whole(value: object) -> int:
    """Return an int from an int or a whole float: a scene file's settings are read as floats."""
    number = read_python_number(value)
    if number != int(number):
        raise invalid(f"{as_text(value)} is not a whole number")
    return int(number)


def as_float(value: float | Real) -> float:
    """Return a number as a float; an int that is too large for a float becomes inf or -inf.

    Raises TypeError for a value that is not a number.
    """
    try:
        return math.fsum([value])  # unlike float(value) it takes no text
    except OverflowError:
        return -math.inf if value < 0 else math.inf


def positive(name: str, number: float) -> float:
    """Return a number that is above 0 and finite.

    Raises InputError for any other number; `name` is the number's name in the message.
    """
    if not 0.0 < number < math.inf:
        raise InputError(f"{name}: {number!r}; allowed: a number more than 0")
    return number


def read_text(value: object) -> str:
    """Return a text that is not blank. Raises TableError for any other value."""
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
    """Return a kind that allows only those values of `kind` that fulfil a condition.

    Parameters
    ----------
    kind : the kind to restrict. It reads the value.
    is_right : (value, as `kind` returns it) -> whether it is allowed.
    allowed : the allowed values in words.
    what : the message for a value that `is_right` refuses; {} stands for the value.
    allowed_there : the allowed values in words, for the error with the message `what`. If it is "",
        the error has the words of the key's declaration.
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
    """Return a kind that allows only those numbers of `kind` that lie within limits.

    Parameters
    ----------
    kind : the kind of number to restrict.
    above, at_least, at_most : exclusive lower, inclusive lower and inclusive upper limit.
    allowed : the allowed numbers in words; by default the words of `kind` and the limits.
    """

    def is_within(number: float) -> bool:
        return number > above and at_least <= number <= at_most

    if not allowed:
        named_limits = {"above": above, "at least": at_least, "at most": at_most}
        limits = [f"{name} {x:g}" for name, x in named_limits.items() if math.isfinite(x)]
        text = " " + " and ".join(limits) if limits else ""
        allowed = kind.allowed.replace("{unit}", text + "{unit}")
    return restricted(kind, is_within, allowed)


# Kinds of finite numbers. NUMBER may be arithmetic in quotes. The kinds whose names begin with
# PYTHON are for values that Python code passes. PYTHON_WHOLE also allows whole floats.
NUMBER = Kind(read_number, "a number{unit}")
PYTHON_NUMBER = Kind(read_python_number, NUMBER.allowed)
WHOLE = Kind(_read_whole, "a whole number{unit}")
PYTHON_WHOLE = Kind(_read_python_whole, WHOLE.allowed)

# Kinds of numbers that describe a rotor or its loads.
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
    """Return the kind of whole numbers from `lowest` to `highest`.

    `allowed` says in words which numbers are allowed; by default it names the two limits.
    """
    allowed = allowed or f"a whole number from {lowest} to {highest}"
    return within(WHOLE, at_least=lowest, at_most=highest, allowed=allowed)


def choice(options: Sequence[object], allowed: str = "") -> Kind:
    """Return the kind of a value that is one of the given options.

    Parameters
    ----------
    options : the allowed values.
    allowed : the allowed values in words; by default a list of the options.
    """
    are_texts = all(isinstance(option, str) for option in options)
    names = [str(option) for option in options]

    def is_option(value: object) -> bool:
        if not isinstance(value, Hashable):  # an array: its comparison has no truth value
            return False
        # True and 1 are equal in Python, but are different options.
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
    """Return the results of `read` for all values. Raises TableError with all problems."""
    return tuple(_read_entries(read, enumerate(values)).values())


def _read_entries(
    read: Callable[[Any], Any],
    entries: Iterable[tuple[str | int, Any]],
) -> dict[Any, Any]:
    """Return the results of `read` for the entries of a list or table, by index or key.

    Parameters
    ----------
    read : (value) -> the converted value.
    entries : index or key, and value, of each entry.

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
    kind : kind of each entry.
    allowed : the allowed lists in words.
    least, most : smallest and largest number of entries; None for no largest number.
    """

    def read(value: object) -> tuple[Any, ...]:
        if not isinstance(value, list):
            raise invalid(f"{as_text(value)} is not a list")
        if len(value) < least or (most is not None and len(value) > most):
            raise invalid(counted(len(value), "entry", "entries"))
        return read_each(kind.read, value)

    return Kind(read, allowed)


def dict_of(kind: Kind, allowed: str) -> Kind:
    """Return the kind of a table with any keys, in which every value is of kind `kind`."""

    def read(value: object) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise invalid(f"{as_text(value)} is not a table")
        return _read_entries(kind.read, value.items())

    return Kind(read, allowed)


def table_of(cls: type, allowed: str = "") -> Kind:
    """Return the kind of a table that is read as an instance of the dataclass `cls`.

    The table has the keys that the dataclass declares. The dataclass's __post_init__ may raise
    TableError if the values contradict each other.
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
    """Read the declared keys in a file's tables, and return their values.

    The keys at the top of the file are read first, then those of each table, in the order in which
    they are declared. A key whose kind is `in_context` depends on the values read before it.

    Parameters
    ----------
    keys : metadata of the declared keys by field, as `declared_keys` returns them.
    tables : the parsed tables of the file.
    extra_check : (values that were read without an error, by field) -> further problems of them.

    Returns
    -------
    dict
        The values by field. If a key is missing in the file, its value is the default.

    Raises
    ------
    TableError
        With all problems of the tables.
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
            # If only one key is declared in a table, a table without this key is a mistake.
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
    """Return the fields by table and by name of the key in the table; "" is the top of the file."""
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
    """Return a problem for each entry of the table at `path` whose name is not in `names`."""
    problems = []
    for name in entries:
        if name not in names:
            what = f"unknown key{nearest(name, names)}"
            problems.append(KeyProblem((*path, name), what, ", ".join(names), is_of_key=True))
    return problems
