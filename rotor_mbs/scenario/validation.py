"""Input tables against pydantic models: errors as lines `key: what is wrong; allowed: ...`.

For the published claims and the columns of foreign data; scenes, sweeps and bounds are read by `keys`.
Importing this module costs 0.1 s (pydantic).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError
from pydantic_core import ErrorDetails

from rotor_mbs.errors import nearest
from rotor_mbs.scenario.keys import counted, read_number, read_text, shown, wrong
from rotor_mbs.scenario.toml_file import KeyPath, KeyProblem, TableError

_WRONG_KINDS = {
    "int_type": "not a whole number",
    "bool_type": "not true or false",
    "string_type": "not text",
    "list_type": "not a list",
    "model_type": "not a table",
    "dict_type": "not a table",
    "literal_error": "not one of them",
    "greater_than_equal": "out of range",
}


class Table(BaseModel):
    """A table of a file: exact types, no key but its fields. A field's description is what a message allows."""

    model_config = ConfigDict(defer_build=True, strict=True, extra="forbid", frozen=True)


M = TypeVar("M", bound=Table)
Number = Annotated[float, BeforeValidator(read_number)]
Text = Annotated[str, BeforeValidator(read_text)]
invalid = wrong


def validate(model: type[M], tables: Mapping[str, Any]) -> M:
    """`tables` as an instance of `model`. Raises TableError."""
    try:
        return model.model_validate(tables)
    except ValidationError as error:
        raise TableError([_problem(details, model) for details in error.errors(include_url=False)]) from error


def validate_file(model: type[M], tables: Mapping[str, Any], text: str, source: str) -> M:
    """As `validate`, for tables read from `text`. Raises InputError with lines `source:line: key: ...`."""
    try:
        return validate(model, tables)
    except TableError as error:
        raise error.in_file(text, source) from error


def _problem(details: ErrorDetails, root: type[BaseModel]) -> KeyProblem:
    kind, path = details["type"], details["loc"]
    model, allowed = _field(path, root)
    if kind == "value_error":  # a reader's own
        (problem,) = details["ctx"]["error"].problems
        return KeyProblem(path, problem.wrong, problem.allowed or allowed)
    if kind == "missing":
        return KeyProblem(path, "is missing", allowed)
    if kind == "extra_forbidden":
        names = list(model.model_fields)
        hint = nearest(str(path[-1]), names)
        return KeyProblem(path, f"is not a key here{hint}", ", ".join(names), is_of_key=True)
    if kind in ("too_short", "too_long"):
        return KeyProblem(path, counted(len(details["input"]), "entry", "entries"), allowed)
    return KeyProblem(path, f"{shown(details['input'])} is {_WRONG_KINDS.get(kind, 'not allowed')}", allowed)


def _field(path: KeyPath, root: type[BaseModel]) -> tuple[type[BaseModel], str]:
    """The model that has the last named key of `path`, and the description of its field ("" for an unknown key)."""
    model = root
    names = [part for part in path if isinstance(part, str)]
    for name in names[:-1]:
        field = model.model_fields.get(name)
        types = (field.annotation, *getattr(field.annotation, "__args__", ())) if field else ()
        model = next((kind for kind in types if isinstance(kind, type) and issubclass(kind, BaseModel)), model)
    described = model.model_fields.get(names[-1]) if names else None
    return model, (described.description or "") if described else ""
