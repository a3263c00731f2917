"""The scene file: a scene read from TOML, and a file to start from. Quoted expressions are evaluated here, once."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rotor_mbs.errors import InputError
from rotor_mbs.scenario.scene import BLADE_KEYS, SCENE_KEYS, Scene, scene_from_tables, scene_toml
from rotor_mbs.scenario.toml_file import TableError, parse_toml, read_toml, shown_path, toml_value

__all__ = ["load_scene", "new_scene_text", "parse_scene", "scene_toml"]


def load_scene(path: Path | str, name: str | None = None) -> Scene:
    """The scene in the TOML file `path`, under `name` or the file's own. Raises InputError with all errors of the file,
    a line each: `file:line: key: what is wrong; allowed: ...`; entries are counted from 0."""
    path = Path(path)
    text, tables = read_toml(path)
    if "axis" in tables and "scene" in tables:
        shown = shown_path(path)
        raise InputError(f"{shown}: is a sweep; allowed: a scene, or: rotor-mbs sweep {shown}")
    return _scene(text, tables, path.stem if name is None else name, shown_path(path))


def parse_scene(text: str, name: str) -> Scene:
    """The scene in a TOML text, as it is stored with results. Raises InputError as `load_scene`."""
    return _scene(text, parse_toml(text, name), name, name)


def _scene(text: str, tables: dict[str, Any], name: str, source: str) -> Scene:
    try:
        return scene_from_tables(tables, name, text)
    except TableError as error:
        raise error.in_file(text, source) from error


_HEADER = """\
# A scene: a rotor, its loads and its start. SI units; angles in rad.
# Numbers may be arithmetic in quotes, "11*pi/12", with pi, sqrt(x), hypot(x, y) and deg(x).
"""
_EXAMPLE: dict[str, Any] = {
    "title": "My rotor",
    "blades": 3,
    "gravity": 9.81,
    "duration": 10.0,
    "samples": 1001,
    "blade.mass": 15000.0,
    "blade.centre_of_mass": [0.08, 0.0, 15.4],
    "blade.inertia": [0, 0, 0, 0, 0, 0],
    "blade.tip": [0.08, 0.0, 33.4],
    "initial.angles": ["deg(30)", 0, "pi/4", 0],
    "initial.rates": [0, 0, 0, 0],
    "torque.rotor": 1000.0,
}


def new_scene_text() -> str:
    """A scene file with every key, a value and what is allowed, to start a scene from."""
    lines: dict[str, list[str]] = {"": _HEADER.splitlines()}
    needed = {"blade"}
    declarations: dict[str, Mapping[str, Any]] = {}  # by path; those of a blade in the place of `blade`
    for declared in SCENE_KEYS.values():
        if declared["key"] == "blade":
            declarations |= {f"blade.{name}": of_blade for name, of_blade in BLADE_KEYS.items()}
        elif declared["key"] != "settings":
            declarations[declared["key"]] = declared
    for path, declared in declarations.items():
        table, _, name = path.rpartition(".")
        value = _EXAMPLE.get(path, declared.get("optional"))
        if value == () and declared["unit"] != "1":  # no load
            value = 0.0
        entry = f"{name} = {toml_value(value)}"
        comment = declared["allowed"]
        if "optional" not in declared:
            needed.add(table)
        elif table in ("", "blade"):
            comment = f"optional: {comment}"
        first, *more = textwrap.wrap(comment, 117 - max(34, len(entry)))
        lines.setdefault(table, []).append(f"{entry:34} # {first}")
        lines[table] += [f"{'':34} # {rest}" for rest in more]
    lines["settings"] = [f"{'# step = 1e-3':34} # {SCENE_KEYS['settings']['allowed']}"]
    parts = []
    for table, entries in lines.items():
        header = [f"[{table}]" if table in needed else f"{f'[{table}]':34} # optional"] if table else []
        parts.append("\n".join([*header, *entries, ""]))
    return "\n".join(parts)
