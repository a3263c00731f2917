"""Input tables against pydantic models: types of values, and errors as lines `key: what is wrong; allowed: ...`.

Shared by all files that are read (scenes, sweeps, bounds, published claims); must not know any of them.
Importing this module costs 0.1 s (pydantic): it is imported only when a file is loaded.
"""

from __future__ import annotations

import json
import unicodedata
from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from rotor_mbs.errors import InputError, nearest
from rotor_mbs.scenario.expression import ALLOWED, ExpressionError, evaluate
from rotor_mbs.scenario.time_table import is_one_table
from rotor_mbs.scenario.toml_file import KeyPath, KeyProblem, TableError, find_lines, line_of, shown_key

MAX_NUMBER = 1e300
MAX_TEXT = 200  # characters
# Of what a rotor is and what acts on it, but for zero: inertias, moments and accelerations, products of up to four such
# numbers, are then between 1e-100 and 1e100, and the product of any three of these is a normal double.
SMALLEST, LARGEST = 1e-25, 1e25
_MAX_PROBLEMS = 100  # lines for one file; nobody reads more, and a file of 1 MiB can have 300 000
_UNPRINTABLE = ("Cc", "Cf", "Cs", "Zl", "Zp")  # Unicode categories: controls, direction marks, line ends
_WRONG_KINDS = {
    "int_type": "not a whole number",
    "bool_type": "not true or false",
    "string_type": "not text",
    "list_type": "not a list",
    "model_type": "not a table",
    "dict_type": "not a table",
    "literal_error": "not one of them",
    "greater_than": "out of range",
    "greater_than_equal": "out of range",
    "less_than": "out of range",
    "less_than_equal": "out of range",
}
_TABLES = ("pitch", "rest")  # keys that have a table over time for each blade, or one for all


class Table(BaseModel):
    """A table of a file: exact types, no key but its fields. A field's description is what a message allows."""

    # Built when first used: a sweep needs neither bounds nor claims.
    model_config = ConfigDict(defer_build=True, strict=True, extra="forbid", frozen=True)


M = TypeVar("M", bound=Table)


def validate(model: type[M], tables: Mapping[str, Any]) -> M:
    """`tables` as an instance of `model`; its validators share an empty dict as context. Raises TableError."""
    try:
        return model.model_validate(tables, context={})
    except ValidationError as error:
        found = error.errors(include_url=False)
        shown = [_problem(one, tables, model) for one in found[:_MAX_PROBLEMS]]
        raise TableError(shown, left_out=len(found) - len(shown)) from error


def validate_file(model: type[M], tables: Mapping[str, Any], text: str, source: str) -> M:
    """As `validate`, for tables read from `text`. Raises InputError with lines `source:line: key: ...`."""
    try:
        return validate(model, tables)
    except TableError as error:
        lines = find_lines(text)
        found = sorted((line_of(lines, problem.path), problem.message) for problem in error.problems)
        shown = [f"{source}:{line}: {message}" for line, message in found]
        if error.left_out:
            shown.append(f"{source}: {error.left_out} more errors")
    raise InputError(shown)


def invalid(wrong: str, allowed: str | None = None) -> PydanticCustomError:
    """An error of a validator: `{shown}` stands for the value; `allowed` defaults to the field's description."""
    return PydanticCustomError("invalid", "{wrong}", {"wrong": wrong, "allowed": allowed})


def _double(value: object) -> float:
    if isinstance(value, str):
        try:
            value = evaluate(value)
        except ExpressionError as error:
            raise invalid(f"{{shown}}: {error.wrong}", f"in quotes {ALLOWED}") from error
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise invalid("{shown} is not a number")
    if not abs(value) <= MAX_NUMBER:  # so written that NaN fails, too
        raise invalid("{shown} is out of range", f"finite numbers, |x| <= {MAX_NUMBER:g}")
    return float(value)


def _of_a_rotor(value: float) -> float:
    if value and not SMALLEST <= abs(value) <= LARGEST:
        raise invalid("{shown} is out of range", f"0, or sizes from {SMALLEST:g} to {LARGEST:g}")
    return value


def _not_blank(value: str) -> str:
    if not value.strip():
        raise invalid("is empty")
    return value


def _one_line(value: str) -> str:
    if len(value) > MAX_TEXT:
        raise invalid(f"is {len(value)} characters long")
    odd = next((char for char in value if unicodedata.category(char) in _UNPRINTABLE), None)
    if odd is not None:
        raise invalid(f"contains the control character {odd!a}")
    return value


Number = Annotated[float, BeforeValidator(_double)]
NotNegative = Annotated[Number, Field(ge=0)]
Size = Annotated[Number, AfterValidator(_of_a_rotor)]
NotNegativeSize = Annotated[Size, Field(ge=0)]
Vector = Annotated[list[Size], Field(min_length=3, max_length=3)]
Text = Annotated[str, AfterValidator(_not_blank)]
Line = Annotated[Text, AfterValidator(_one_line)]


def _problem(details: ErrorDetails, tables: Mapping[str, Any], root: type[BaseModel]) -> KeyProblem:
    path, value = _in_tables(details["loc"], tables)
    model, description = _field(details["loc"], root)
    wrong, allowed = _explained(details, model, _shown(value))
    message = f"{shown_key(path)}: {wrong}; allowed: {allowed or description}"
    return KeyProblem(path, message, details["type"] == "extra_forbidden")


def _explained(details: ErrorDetails, model: type[BaseModel], shown: str) -> tuple[str, str | None]:
    """What is wrong, and what is allowed where that is not the field's description."""
    kind, context = details["type"], details.get("ctx", {})
    if kind == "invalid":
        return str(context["wrong"]).replace("{shown}", shown), context["allowed"]
    if kind == "missing":
        return "is missing", None
    if kind == "extra_forbidden":
        names = list(model.model_fields)
        return "is not a key here" + nearest(str(details["loc"][-1]), names), ", ".join(names)
    if kind in ("too_short", "too_long"):
        count = len(details["input"])
        return f"{count} {'entry' if count == 1 else 'entries'}", None
    return f"{shown} is {_WRONG_KINDS.get(kind, 'not allowed')}", None


def _field(loc: KeyPath, root: type[BaseModel]) -> tuple[type[BaseModel], str]:
    """The model that has the last named key of `loc`, and the description of its field ("" for an unknown key)."""
    model = root
    names = [part for part in loc if isinstance(part, str)]
    for name in names[:-1]:
        field = model.model_fields.get(name)
        types = (field.annotation, *getattr(field.annotation, "__args__", ())) if field else ()
        model = next((one for one in types if isinstance(one, type) and issubclass(one, BaseModel)), model)
    field = model.model_fields.get(names[-1])
    return model, (field.description or "") if field else ""


def _in_tables(loc: KeyPath, tables: Mapping[str, Any]) -> tuple[KeyPath, object]:
    """Where in the tables `loc` is, and the value that stands there; None where the key is missing.

    Left out are the entries of lists that the model made of single values ([blade], a constant torque), and the blade
    where one table over time is for all blades.
    """
    path: KeyPath = ()
    here: Any = tables
    left_out = False
    for part in loc:
        if isinstance(part, int) and isinstance(here, list):
            if not left_out and path[-1] in _TABLES and is_one_table(here):
                left_out = True
                continue
            here = here[part]
        elif isinstance(part, str) and isinstance(here, Mapping):
            here = here.get(part)
        else:
            continue
        path = (*path, part)
    return path, here


def _shown(value: object) -> str:
    """The value as the file has it, short and on one line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value) if abs(value) < 10**30 else "so large a number"
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, str):
        return json.dumps(value if len(value) <= 40 else value[:37] + "...", ensure_ascii=not value.isprintable())
    if isinstance(value, list):
        return "a list"
    return "a table" if isinstance(value, dict) else "a date or time"
