"""A scene file, strictly: a Scene, or every fault of the file at once. Knows no model and no shipped folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rotor_mbs.errors import InputError
from rotor_mbs.scenario.lines import find_lines, line_of
from rotor_mbs.scenario.reading import parse_toml, read_toml, shown_path
from rotor_mbs.scenario.scene import Scene

_MAX_FAULTS = 100  # lines for one file; nobody reads more, and a file of 1 MiB can hold 300 000


def load_scene(path: Path, name: str) -> Scene:
    """The scene in the TOML file `path`, under `name`. Quoted expressions are evaluated here, once for every model.

    Raises InputError with all faults of the file, a line each: `file:line: key: what is wrong; allowed: ...`;
    entries are counted from 1.
    """
    return _scene(*read_toml(path), name, shown_path(path))


def parse_scene(text: str, name: str) -> Scene:
    """The scene in a TOML text, as it is stored with results. Raises InputError as `load_scene`."""
    return _scene(text, parse_toml(text, name), name, name)


def _scene(text: str, tables: dict[str, Any], name: str, source: str) -> Scene:
    from pydantic import ValidationError  # late, with the schema: 0.2 s

    from rotor_mbs.scenario.faults import faults_of
    from rotor_mbs.scenario.fields import Known
    from rotor_mbs.scenario.schema import SceneTable

    try:
        return SceneTable.model_validate(tables, context=Known()).to_scene(name, text)
    except ValidationError as error:
        lines = find_lines(text)
        found = sorted((line_of(lines, fault.path), fault.text) for fault in faults_of(error, tables))
    shown = [f"{source}:{line}: {words}" for line, words in found[:_MAX_FAULTS]]
    if len(found) > _MAX_FAULTS:
        shown.append(f"{source}: {len(found) - _MAX_FAULTS} more faults")
    raise InputError(shown)
