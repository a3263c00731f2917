"""The scenes that are shipped, their names, and which ones the arguments of a command mean."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rotor_mbs.errors import InputError, RotorError, nearest
from rotor_mbs.scenario.toml_file import file_path, parse_toml, shown_path

if TYPE_CHECKING:  # `rotor-mbs list` reads no scene
    from rotor_mbs.scenario.scene import Scene, ValuesCheck

# Groups at the top of a results file that are not scenes: no scene may take such a name.
RESERVED_GROUPS = ("bench", "claims", "comparison", "errata", "modes", "stability", "summary", "sweep")

_PACKAGE = Path(__file__).resolve().parents[1]
# A wheel carries the folders inside the package; an editable install has them at the top of the checkout.
_DATA = _PACKAGE / "_data" if (_PACKAGE / "_data").is_dir() else _PACKAGE.parent
SCENARIOS = _DATA / "scenarios"  # the shipped scenes
SWEEPS = SCENARIOS / "sweeps"  # the shipped sweeps: TOML files that vary a scene
REFERENCES = _DATA / "reference"  # published numbers, errata, bounds, trajectories
for _folder in (SCENARIOS, REFERENCES):
    if not _folder.is_dir():
        raise RotorError(f"{_folder}: the folder is missing; install rotor_mbs again")

_PIECE = r"[A-Za-z0-9_-][A-Za-z0-9._-]*"
_NAME = re.compile(rf"{_PIECE}(?:/{_PIECE})*")
_NAME_RULE = "of the characters A-Z a-z 0-9 . _ -, with no dot in front"


def natural_key(name: str) -> list[tuple[int, int, str]]:
    """Sort key under which digits count as whole numbers: 1kNm, 10kNm, 50kNm, 100kNm."""
    pieces = re.findall(r"[0-9]+|[^0-9]+", name)
    return [(0, int(piece), piece) if piece.isascii() and piece.isdigit() else (1, 0, piece) for piece in pieces]


def natural_order(names: Iterable[str]) -> list[str]:
    return sorted(names, key=natural_key)


def list_scenes() -> list[tuple[str, str]]:
    """(name, title) of every shipped scene."""
    return [(name, _title(path)) for name, path in _shipped().items()]


def list_sweeps() -> list[tuple[str, str]]:
    paths = sorted(SWEEPS.glob("*.toml"), key=lambda path: natural_key(path.name))
    return [(f"sweeps/{path.stem}", _title(path)) for path in paths]


def find_scenes(arguments: Sequence[str], check: ValuesCheck | None = None) -> list[Scene]:
    """The scenes that names, folders and paths of TOML files mean, in their order, each once; a shipped name goes
    before a path (write ./paper for a folder of one's own). check: what else is wrong with the values of a file. A
    shipped file is called `folder/stem`, any other by its stem. Raises InputError with all errors of all arguments and
    files."""
    from rotor_mbs.scenario.scene import load_scene

    problems: list[str] = []
    paths: list[Path] = []
    for argument in arguments:
        try:
            paths += _files(argument)
        except InputError as error:
            problems += error.problems
    names: dict[Path, str] = {}  # of files, by where their paths lead to
    by_name: dict[str, Path] = {}
    scenes = []
    shipped = {path.resolve(): name for name, path in _shipped().items()}
    for path in paths:
        try:
            real = path.resolve()
        except (OSError, RuntimeError, ValueError):  # links in a circle, a NUL in the name
            problems.append(f"{shown_path(path)}: cannot be resolved to a file; allowed: a readable TOML file")
            continue
        if real in names:
            continue
        names[real] = name = shipped.get(real, path.stem)
        wrong = ""
        if name in by_name:
            clash = f"its scene would be named {name}, as that of {shown_path(by_name[name])}"
            wrong = f"{clash}; allowed: different names"
        elif not _NAME.fullmatch(name):
            wrong = f"the file's name cannot name a scene; allowed: a name {_NAME_RULE}"
        elif name in RESERVED_GROUPS or any(known.startswith(name + "/") for known in shipped.values()):
            hint = f"; of a sweep: rotor-mbs sweep {shown_path(path)}" if name == "sweep" else ""
            wrong = f"{name} is a reserved name in results files; allowed: another file name{hint}"
        if wrong:
            problems.append(f"{shown_path(path)}: {wrong}")
            continue
        by_name[name] = path
        try:
            scenes.append(load_scene(path, name, check))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    return scenes


def only_scene(argument: str) -> Scene:
    """The one scene that `argument` means. Raises InputError where it means several, as for `find_scenes`."""
    scenes = find_scenes([argument])
    if len(scenes) != 1:
        raise InputError(f"{argument}: {len(scenes)} scenes; allowed: the name of one scene, or a TOML file")
    return scenes[0]


def scene_of(given: Scene | str | os.PathLike[str]) -> Scene:
    """Return the scene itself, or the one that a name or the path of a TOML file means.

    Raises InputError where there is none, TypeError for what is neither a scene nor text nor a path.
    """
    from rotor_mbs.scenario.scene import Scene

    return given if isinstance(given, Scene) else only_scene(os.fsdecode(given))


def shipped_scene(name: str) -> Scene | None:
    """The scene of this package with that name; no file of a user's is read."""
    from rotor_mbs.scenario.scene import load_scene

    path = _shipped().get(name)
    return None if path is None else load_scene(path, name)


def _shipped() -> dict[str, Path]:
    paths = (path for path in SCENARIOS.rglob("*.toml") if path.parent != SWEEPS)
    names = ((path.relative_to(SCENARIOS).with_suffix("").as_posix(), path) for path in paths)
    return dict(sorted(names, key=lambda item: natural_key(item[0])))


def _title(path: Path) -> str:
    """Of a shipped file: all of its tables come after the title, and reading them would take most of the time."""
    text = path.read_text(encoding="utf-8")
    return str(parse_toml(text.partition("\n[")[0], str(path)).tables.get("title", ""))


def _files(argument: str) -> list[Path]:
    shipped = _shipped()
    if argument in shipped:
        return [shipped[argument]]
    inside = [path for name, path in shipped.items() if name.startswith(argument.rstrip("/") + "/")]
    if inside:
        return inside
    path = Path(argument)
    try:
        is_folder, is_there = bool(argument) and path.is_dir(), bool(argument) and path.exists()
    except (OSError, ValueError):  # a name too long for the file system, a NUL in it
        is_folder = is_there = False
    if is_folder:
        paths = sorted(path.glob("*.toml"), key=lambda path: natural_key(path.name))
        if not paths:
            raise InputError(f"{shown_path(path)}: no TOML file in this folder; allowed: a folder of scene files")
        return paths
    if path.suffix == ".toml":
        return [file_path(path)]
    if is_there:
        wrong = "is not a TOML file; allowed: a scene's name, a folder, a path that ends in .toml"
    elif not _NAME.fullmatch(argument):
        wrong = f"is neither a scene's name nor a TOML file; allowed: pieces {_NAME_RULE}, joined by /"
    elif argument in dict(list_sweeps()):
        wrong = f"is a sweep; allowed: a scene, or: rotor-mbs sweep {argument}"
    else:
        names = {*shipped, *(name.rpartition("/")[0] for name in shipped)}
        hint = nearest(argument, natural_order(names))
        wrong = f"no such scene{hint}; allowed: a name from `rotor-mbs list`, or FILE.toml"
    quoted = f"'{argument if len(argument) <= 80 else argument[:77] + '...'}'"
    raise InputError(f"{quoted if argument.isprintable() else ascii(argument[:80])}: {wrong}")
