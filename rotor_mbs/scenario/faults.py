"""From pydantic's errors to plain lines `key: what is wrong; allowed: ...`. Knows the schema, but no file."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from rotor_mbs.scenario.lines import KeyPath
from rotor_mbs.scenario.schema import SceneTable

_KINDS = {
    "int_type": "no whole number",
    "string_type": "no text",
    "list_type": "no list",
    "model_type": "no table",
    "literal_error": "none of them",
    "greater_than": "out of range",
    "greater_than_equal": "out of range",
    "less_than_equal": "out of range",
}


class Fault(NamedTuple):
    """One fault: where it is in the tables as they were read, and its words."""

    path: KeyPath
    text: str


def faults_of(error: ValidationError, tables: Mapping[str, Any], root: type[BaseModel] = SceneTable) -> list[Fault]:
    """Every fault that pydantic found in `tables` when it held them against `root`, in plain words."""
    return [_fault(details, tables, root) for details in error.errors(include_url=False)]


def _fault(details: ErrorDetails, tables: Mapping[str, Any], root: type[BaseModel]) -> Fault:
    path, value = _in_file(details["loc"], tables)
    model, description = _field(details["loc"], root)
    wrong, allowed = _words(details, model, _shown(value))
    return Fault(path, f"{_shown_key(path)}: {wrong}; allowed: {allowed or description}")


def _words(details: ErrorDetails, model: type[BaseModel], shown: str) -> tuple[str, str | None]:
    """What is wrong, and what is allowed where that is not the field's description."""
    kind, context = details["type"], details.get("ctx", {})
    if kind == "fault":
        return str(context["wrong"]).replace("{shown}", shown), context["allowed"]
    if kind == "missing":
        return "is missing", None
    if kind == "extra_forbidden":
        return _unknown_key(str(details["loc"][-1]), list(model.model_fields))
    if kind in _KINDS:
        return f"{shown} is {_KINDS[kind]}", None
    if kind in ("too_short", "too_long"):
        count = len(details["input"])
        return f"{count} {'entry' if count == 1 else 'entries'}", None
    return f"{shown} is not allowed", None


def _unknown_key(key: str, names: list[str]) -> tuple[str, str]:
    near = difflib.get_close_matches(key[:40], names, n=1)
    return "is no key here" + (f", perhaps {near[0]}" if near else ""), ", ".join(names)


def _field(loc: KeyPath, root: type[BaseModel]) -> tuple[type[BaseModel], str]:
    """The model that holds the last named key of `loc`, and the description of its field ("" for an unknown key)."""
    model = root
    names = [part for part in loc if isinstance(part, str)]
    for name in names[:-1]:
        model = _tables_in(model).get(name, model)
    field = model.model_fields.get(names[-1])
    return model, (field.description or "") if field else ""


def _tables_in(model: type[BaseModel]) -> dict[str, type[BaseModel]]:
    """The model of every table in a table, by its key."""
    models: dict[str, type[BaseModel]] = {}
    for name, field in model.model_fields.items():
        for candidate in (field.annotation, *getattr(field.annotation, "__args__", ())):
            if isinstance(candidate, type) and issubclass(candidate, BaseModel):
                models[name] = candidate
    return models


def _in_file(loc: KeyPath, tables: Mapping[str, Any]) -> tuple[KeyPath, object]:
    """Where in the file `loc` is, and the value that stands there (None where the key is missing).

    Left out are the entries of lists that the schema made of single values ([blade], a constant torque).
    """
    path: KeyPath = ()
    here: Any = tables
    for part in loc:
        if isinstance(part, int) and isinstance(here, list):
            here = here[part]
        elif isinstance(part, str):
            here = here.get(part)
        else:
            continue
        path = (*path, part)
    return path, here


def _shown_key(path: KeyPath) -> str:
    """'blade.tip (blade 2, entry 3)' for ("blade", 1, "tip", 2): counted from 1, as blades are."""
    names = ".".join(_shown_name(part) for part in path if isinstance(part, str))
    numbers = []
    for i, part in enumerate(path):
        if isinstance(part, int):
            is_last = i == len(path) - 1
            is_row = path[:2] == ("torque", "rotor") and i == 2
            noun = "blade" if path[:1] == ("blade",) and i == 1 else "row" if is_row else "entry"
            numbers.append(f"{noun} {part + 1}" if is_last or noun != "entry" else str(part + 1))
    return f"{names} ({', '.join(numbers)})" if numbers else names


def _shown_name(name: str) -> str:
    if re.fullmatch(r"[A-Za-z0-9_-]{1,60}", name):
        return name
    return json.dumps(name if len(name) <= 60 else name[:57] + "...")


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
