"""The path of a number in a scene's tables, as a sweep writes it: `initial.angles[1]`. Knows tables, but no schema.

Entries are counted from 0, as the coordinates of a results file are: `initial.angles[1]` is the pitch of blade 1.
"""

from __future__ import annotations

import copy
import re
from dataclasses import fields
from typing import Any

from rotor_mbs.scenario.lines import KeyPath
from rotor_mbs.scenario.scene import Blade, Scene

_PART = r"[A-Za-z_][A-Za-z0-9_]{0,59}(?:\[[0-9]{1,6}\])*"
_KEY = re.compile(rf"{_PART}(?:\.{_PART})*")
FORM = "the path of a number, such as gravity, blade.mass, initial.angles[1] (entries counted from 0)"

# What a scene holds where it says nothing: needed for setting one entry of a list that is not there.
_ABSENT = {("blade", "inertia"): [0.0] * 6}
_PER_BLADE = (("bearing", "stiffness"), ("bearing", "damping"))

_UNITS: dict[str, str] = {one.metadata["key"]: one.metadata["unit"] for one in fields(Scene)} | {
    f"blade.{one.name}": one.metadata["unit"] for one in fields(Blade)
}


class KeyFaultError(ValueError):
    """A path that leads nowhere in the tables; the text says what is wrong and what is allowed."""


def parse_key(text: str) -> KeyPath:
    """("initial", "angles", 1) of "initial.angles[1]". Raises KeyFaultError."""
    if not _KEY.fullmatch(text):
        raise KeyFaultError(f"is no path of a key; allowed: {FORM}")
    return tuple(int(part) if part.isdigit() else part for part in re.findall(r"[A-Za-z_]\w*|[0-9]+", text))


def unit_of(path: KeyPath) -> str:
    """The unit of the number at `path`, "1" where it has none."""
    names = ".".join(part for part in path if isinstance(part, str))
    if names == "torque.rotor" and path[-1] == 0 and len(path) == 4:  # the time of a row
        return "s"
    return _UNITS.get(names, "1")


def put(tables: dict[str, Any], path: KeyPath, value: float) -> None:
    """Sets the number at `path`; tables that are missing are made. Raises KeyFaultError where no number can be there.

    One [blade] for all, or one number for every bearing, becomes one for each where the path names one of them.
    """
    here: Any = tables
    for depth, part in enumerate(path[:-1]):
        here = _step(tables, here, path, depth, part)
    here = _container(here, path, len(path) - 1)
    last = path[-1]
    if isinstance(here.get(last) if isinstance(last, str) else here[last], dict | list):
        raise KeyFaultError(f"is no number but {_kind(here[last])}; allowed: {FORM}")
    here[last] = value


def _step(tables: dict[str, Any], here: Any, path: KeyPath, depth: int, part: str | int) -> Any:
    here = _container(here, path, depth)
    following = path[depth + 1]
    if isinstance(part, int):
        return here[part]
    if isinstance(following, int):
        value = _as_list(tables, here.get(part), path[: depth + 1])
        # Whether a list that is not there could be there, the schema says.
        here[part] = [0.0] * (following + 1) if value is None else value
    return here.setdefault(part, {})


def _as_list(tables: dict[str, Any], value: Any, path: KeyPath) -> Any:
    """What stands at `path`, spread to one entry per blade where the scene file allows one for all."""
    names = tuple(part for part in path if isinstance(part, str))
    blades = tables.get("blades", 0)
    if names == ("blade",) and isinstance(value, dict):
        return [copy.deepcopy(value) for _ in range(blades)]
    if names in _PER_BLADE and not isinstance(value, list):
        return [0.0 if value is None else value] * blades
    return copy.copy(_ABSENT[names]) if value is None and names in _ABSENT else value


def _container(here: Any, path: KeyPath, depth: int) -> Any:
    """`here`, seen to be of the kind that path[depth] needs."""
    part = path[depth]
    if isinstance(part, str) and isinstance(here, dict):
        return here
    if isinstance(part, int) and isinstance(here, list) and part < len(here):
        return here
    shown = shown_key(path[:depth])
    if isinstance(part, int) and isinstance(here, list):
        raise KeyFaultError(f"{shown} has {len(here)} entries; allowed: {shown}[0] to {shown}[{len(here) - 1}]")
    if isinstance(part, str) and isinstance(here, list):
        raise KeyFaultError(
            f"{shown} is {_kind(here)}; allowed: {shown}[0] to {shown}[{len(here) - 1}] in place of {shown}"
        )
    raise KeyFaultError(f"{shown} is {_kind(here)}; allowed: {FORM}")


def _kind(value: Any) -> str:
    if isinstance(value, dict):
        return "a table" if value else "not there"
    return "a list" if isinstance(value, list) else "a number" if isinstance(value, int | float | str) else "not there"


def shown_key(path: KeyPath) -> str:
    """ "initial.angles[1]" of ("initial", "angles", 1)."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    return text.removeprefix(".")
