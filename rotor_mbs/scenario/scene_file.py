"""The scene file: read strictly from TOML, and written. Must not know models.

Quoted expressions are evaluated here, once for every model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.scenario.toml_file import parse_toml, read_toml, shown_path, toml_lines


def load_scene(path: Path | str, name: str | None = None) -> Scene:
    """The scene in the TOML file `path`, under `name`, by default the file's name without its ending.

    Raises InputError with all errors of the file, a line each: `file:line: key: what is wrong; allowed: ...`;
    entries are counted from 0, as by `Scene.replace`.
    """
    path = Path(path)
    return _scene(*read_toml(path), path.stem if name is None else name, shown_path(path))


def parse_scene(text: str, name: str) -> Scene:
    """The scene in a TOML text, as it is stored with results. Raises InputError as `load_scene`."""
    return _scene(text, parse_toml(text, name), name, name)


def _scene(text: str, tables: dict[str, Any], name: str, source: str) -> Scene:
    from rotor_mbs.scenario.schema import SceneTable  # late, with pydantic: 0.2 s
    from rotor_mbs.scenario.validation import validate_file

    return validate_file(SceneTable, tables, text, source).to_scene(name, text)


def new_scene_text() -> str:
    """A scene file with a comment for every key, to start a scene from."""
    return Path(__file__).with_name("template.toml").read_text(encoding="utf-8")


def validated_scene(tables: Mapping[str, Any], name: str) -> Scene:
    """The scene in the tables of a scene file, with no text. Raises TableError with every error."""
    from rotor_mbs.scenario.schema import SceneTable
    from rotor_mbs.scenario.validation import validate

    return validate(SceneTable, tables).to_scene(name, "")


def scene_tables(scene: Scene) -> dict[str, Any]:
    """The scene as the tables of a scene file: numbers as they are, keys at their defaults left out."""
    tables: dict[str, Any] = {}
    for one in fields(Scene):
        value = getattr(scene, one.name)
        if not one.metadata["key"] or value == one.default:
            continue
        *names, last = one.metadata["key"].split(".")
        table = tables
        for name in names:
            table = table.setdefault(name, {})
        if one.metadata["per_blade"] and len(set(value)) == 1:
            table[last] = _listed(value[0])
        elif one.metadata["per_blade"] and one.metadata["over_time"]:
            table[last] = [_listed(rows) if rows else 0.0 for rows in value]
        else:
            table[last] = _blade_tables(scene) if one.name == "blades" else _listed(value)
    if scene.settings:
        tables["settings"] = dict(scene.settings)
    return {"blades": len(scene.blades), **tables}


def _blade_tables(scene: Scene) -> dict[str, Any] | list[dict[str, Any]]:
    """One table for equal blades; a tip that only repeats the centre of mass was not given."""
    tables = []
    for blade in scene.blades:
        table = {one.name: _listed(getattr(blade, one.name)) for one in fields(Blade)}
        if blade.tip == blade.centre_of_mass and not scene.wants("tip"):
            del table["tip"]
        tables.append(table)
    return tables[0] if all(table == tables[0] for table in tables) else tables


def _listed(value: Any) -> Any:
    return [_listed(entry) for entry in value] if isinstance(value, tuple) else value


def scene_toml(scene: Scene) -> str:
    """A scene file that has the scene's numbers bit for bit: reading it gives an equal scene, but for name and text.

    Comments and expressions of the file that the scene was read from are not kept.
    """
    tables = scene_tables(scene)
    parts = [toml_lines({key: value for key, value in tables.items() if not _is_table(value)})]
    for key, value in tables.items():
        if isinstance(value, dict):
            parts.append(f"[{key}]\n{toml_lines(value)}")
        elif _is_table(value):
            parts += [f"[[{key}]]\n{toml_lines(table)}" for table in value]
    return "\n".join(parts)


def _is_table(value: Any) -> bool:
    return isinstance(value, dict) or (isinstance(value, list) and bool(value) and isinstance(value[0], dict))
