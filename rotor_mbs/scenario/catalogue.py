"""Find the shipped scenes, and the scenes that the arguments of a command name."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rotor_mbs.errors import InputError, RotorError, nearest
from rotor_mbs.scenario.toml_file import file_path, parse_toml, shown_path

if TYPE_CHECKING:  # `rotor-mbs list` reads no scene
    from rotor_mbs.scenario.scene import Scene, SceneChange, ValuesCheck

# Names that no scene may have. `runs`, `bench` and `stability` are tables in a results file;
# `modes` and `comparison` are groups in other files. The remaining names are not groups now.
RESERVED_GROUPS = (
    "bench",
    "claims",
    "comparison",
    "errata",
    "modes",
    "runs",
    "stability",
    "summary",
    "sweep",
)

_PACKAGE = Path(__file__).resolve().parents[1]
# The folder that contains `scenarios` and `reference`. In a wheel it is inside the package; in an
# editable install it is the top of the checkout.
_DATA = _PACKAGE / "_data" if (_PACKAGE / "_data").is_dir() else _PACKAGE.parent
SCENARIOS = _DATA / "scenarios"  # the shipped scenes
SWEEPS = SCENARIOS / "sweeps"  # the shipped sweeps: TOML files that vary a scene
REFERENCES = _DATA / "reference"  # published numbers, errata, bounds, frozen trajectories
for _folder in (SCENARIOS, REFERENCES):
    if not _folder.is_dir():
        raise RotorError(f"{_folder}: the folder is missing; install rotor_mbs again")

# Ending of the names of files that map columns of another program's data to channels. Every other
# TOML file in a folder counts as a scene.
MAPPING_ENDING = ".columns.toml"
_NO_MOTION = ("samples", "outputs")  # keys that change what is stored, not how the rotor moves
_SHOWN_CHANGES = 3  # largest number of keys in the label of a changed scene

_PIECE = r"[A-Za-z0-9_-][A-Za-z0-9._-]*"
_NAME = re.compile(rf"{_PIECE}(?:/{_PIECE})*")
_NAME_RULE = "of the characters A-Z a-z 0-9 . _ -, with no dot in front"


def natural_key(name: str) -> list[tuple[int, int, str]]:
    """Return a sort key that compares digits as whole numbers: 1kNm, 10kNm, 50kNm, 100kNm."""
    pieces = []
    for piece in re.findall(r"[0-9]+|[^0-9]+", name):
        is_number = piece.isascii() and piece.isdigit()
        pieces.append((0, int(piece), piece) if is_number else (1, 0, piece))
    return pieces


def natural_order(names: Iterable[str]) -> list[str]:
    """Return names sorted by `natural_key`."""
    return sorted(names, key=natural_key)


def list_scenes() -> list[tuple[str, str]]:
    """Return name and title of every shipped scene."""
    return [(name, _title(path)) for name, path in _shipped().items()]


def list_sweeps() -> list[tuple[str, str]]:
    """Return name and title of every shipped sweep."""
    paths = sorted(SWEEPS.glob("*.toml"), key=lambda path: natural_key(path.name))
    return [(f"sweeps/{path.stem}", _title(path)) for path in paths]


def find_scenes(arguments: Sequence[str], check: ValuesCheck | None = None) -> list[Scene]:
    """Read and return the scenes that the arguments of a command name.

    Parameters
    ----------
    arguments : names of scenes, folders, and paths of TOML files. A shipped name takes precedence
        over a path: a folder `paper` of the user must be given as ./paper.
    check : (values of a scene file by field) -> further problems of these values.

    Returns
    -------
    list of Scene
        The scenes in the order of the arguments, each once. A scene is named `folder/stem` after a
        shipped file, and `stem` after any other file.

    Raises
    ------
    InputError
        One error with the problems of all arguments and all files.
    """
    from rotor_mbs.scenario.scene import load_scene

    problems: list[str] = []
    paths: list[Path] = []
    for argument in arguments:
        try:
            paths += _files(argument)
        except InputError as error:
            problems += error.problems
    seen: set[Path] = set()  # files that were found, with links resolved
    by_name: dict[str, Path] = {}
    scenes = []
    shipped = {path.resolve(): name for name, path in _shipped().items()}
    for path in paths:
        try:
            real = path.resolve()
        except (OSError, RuntimeError, ValueError):  # a circle of links, or a NUL in the name
            what = "cannot be resolved to a file; allowed: a readable TOML file"
            problems.append(f"{shown_path(path)}: {what}")
            continue
        # The arguments may name a file twice: as a file and by its folder, or by a link.
        if real in seen:
            continue
        seen.add(real)
        name = shipped.get(real, path.stem)
        problem = _name_problem(path, name, by_name, shipped.values())
        if problem:
            problems.append(f"{shown_path(path)}: {problem}")
            continue
        by_name[name] = path
        try:
            scenes.append(load_scene(path, name, check))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    return scenes


def _name_problem(
    path: Path,
    name: str,
    by_name: Mapping[str, Path],
    shipped: Iterable[str],
) -> str:
    """Return why a scene cannot be named after its file, or "" if it can.

    Parameters
    ----------
    path : the scene's file.
    name : the name that the scene would have.
    by_name : files of the scenes that were found before, by scene name.
    shipped : names of shipped scenes.
    """
    if name in by_name:
        clash = f"its scene would be named {name}, as that of {shown_path(by_name[name])}"
        return f"{clash}; allowed: different names"
    if not _NAME.fullmatch(name):
        return f"the file's name cannot name a scene; allowed: a name {_NAME_RULE}"
    # No scene can have the name of a shipped folder: in a results file, the group `paper` contains
    # the groups of the scenes `paper/fig05` and others.
    is_folder = any(other.startswith(name + "/") for other in shipped)
    if name in RESERVED_GROUPS or is_folder:
        hint = ""
        if name == "sweep":
            hint = f"; to run a sweep, use: rotor-mbs sweep {shown_path(path)}"
        return f"{name} is a reserved name in results files; allowed: another file name{hint}"
    return ""


def check_scene_name(path: Path) -> None:
    """Raise InputError if no scene can be named after the file `path`, which need not exist."""
    problem = _name_problem(path, path.stem, {}, _shipped())
    if problem:
        raise InputError(f"{shown_path(path)}: {problem}")


def only_scene(argument: str) -> Scene:
    """Return the single scene that an argument names.

    Raises InputError if the argument names several scenes, or if `find_scenes` raises it.
    """
    scenes = find_scenes([argument])
    if len(scenes) != 1:
        allowed = "the name of one scene, or a TOML file"
        raise InputError(f"{argument}: {len(scenes)} scenes; allowed: {allowed}")
    return scenes[0]


def scene_of(given: Scene | str | os.PathLike[str]) -> Scene:
    """Return `given` if it is a scene, otherwise the scene with this name or in this TOML file.

    Raises InputError if there is no such scene, and TypeError if `given` is neither a scene nor a
    name (text) nor a path.
    """
    from rotor_mbs.scenario.scene import Scene

    return given if isinstance(given, Scene) else only_scene(os.fsdecode(given))


def shipped_scene(name: str) -> Scene | None:
    """Return the shipped scene that is called `name`, or None; users' files are not read."""
    from rotor_mbs.scenario.scene import load_scene

    path = _shipped().get(name)
    return None if path is None else load_scene(path, name)


def changes_from_shipped(scene: Scene) -> list[SceneChange] | None:
    """Return the changes from the shipped scene of the same name to this scene.

    Returns None if no shipped scene has this name.
    """
    from rotor_mbs.scenario.scene import scene_changes

    shipped = shipped_scene(scene.name)
    return None if shipped is None else scene_changes(shipped, scene)


def scene_label(scene: Scene) -> str:
    """Return the name of a scene, and the keys in which it differs from the shipped scene.

    The keys `samples` and `outputs` are left out, as they do not change the motion.

    Examples
    --------
    >>> scene = find_scenes(["paper/fig11"])[0]
    >>> scene_label(scene), scene_label(scene.replace(**{"blade.mass": 12000.0}))
    ('paper/fig11', 'paper/fig11, changed: blade.mass')
    """
    return label_with_changes(scene.name, changes_from_shipped(scene) or ())


def label_with_changes(name: str, changes: Iterable[SceneChange]) -> str:
    """Return the label of a scene from its name and its `changes_from_shipped`."""
    keys = [change.key for change in changes if change.path[0] not in _NO_MOTION]
    if not keys:
        return name
    more = f" and {len(keys) - _SHOWN_CHANGES} more" if len(keys) > _SHOWN_CHANGES else ""
    return f"{name}, changed: {', '.join(keys[:_SHOWN_CHANGES])}{more}"


def moves_as_shipped(changes: Iterable[SceneChange] | None) -> bool:
    """Return whether a scene moves as the shipped scene of the same name.

    Parameters
    ----------
    changes : the result of `changes_from_shipped` for the scene. The motion is the same if no key
        but `samples` and `outputs` was changed. For None, the function returns False.
    """
    return changes is not None and all(change.path[0] in _NO_MOTION for change in changes)


def _shipped() -> dict[str, Path]:
    """Return the files of the shipped scenes by name, in natural order."""
    paths = {}
    for path in SCENARIOS.rglob("*.toml"):
        if path.parent != SWEEPS:
            paths[path.relative_to(SCENARIOS).with_suffix("").as_posix()] = path
    return {name: paths[name] for name in natural_order(paths)}


def _title(path: Path) -> str:
    """Return the title in a shipped scene or sweep file."""
    text = path.read_text(encoding="utf-8")
    # The title stands before the first table. Parsing the tables would take most of the time.
    top = text.partition("\n[")[0]
    return str(parse_toml(top, str(path)).tables.get("title", ""))


def _files(argument: str) -> list[Path]:
    """Return the scene files that an argument of a command names.

    Parameters
    ----------
    argument : name of a shipped scene or folder, or path of a TOML file or of a folder of TOML
        files.

    Raises
    ------
    InputError
        If the argument names no scene file.
    """
    shipped = _shipped()
    if argument in shipped:
        return [shipped[argument]]
    folder = argument.rstrip("/") + "/"
    inside = [path for name, path in shipped.items() if name.startswith(folder)]
    if inside:
        return inside
    path = Path(argument)
    try:
        is_folder = bool(argument) and path.is_dir()
        exists = bool(argument) and path.exists()
    except (OSError, ValueError):  # the name is too long for the file system, or has a NUL
        is_folder = exists = False
    if is_folder:
        files = sorted(path.glob("*.toml"), key=lambda path: natural_key(path.name))
        paths = [file for file in files if not file.name.endswith(MAPPING_ENDING)]
        if not paths:
            what = "no TOML file in this folder; allowed: a folder of scene files"
            raise InputError(f"{shown_path(path)}: {what}")
        return paths
    if path.suffix == ".toml":
        return [file_path(path)]
    if exists:
        allowed = "a scene's name, a folder, a path that ends in .toml"
        what = f"is not a TOML file; allowed: {allowed}"
    elif not _NAME.fullmatch(argument):
        allowed = f"pieces {_NAME_RULE}, joined by /"
        what = f"is neither a scene's name nor a TOML file; allowed: {allowed}"
    elif argument in dict(list_sweeps()):
        what = f"is a sweep; allowed: a scene, or: rotor-mbs sweep {argument}"
    else:
        names = {*shipped, *(name.rpartition("/")[0] for name in shipped)}
        hint = nearest(argument, natural_order(names))
        what = f"no such scene{hint}; allowed: a name from `rotor-mbs list`, or FILE.toml"
    quoted = ascii(argument[:80])
    if argument.isprintable():
        shown = argument if len(argument) <= 80 else f"{argument[:77]}..."
        quoted = f"'{shown}'"
    raise InputError(f"{quoted}: {what}")
