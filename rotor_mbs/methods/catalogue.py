"""Find methods by name: built-in ones, those of installed packages, those of named files.

Packages add methods by entry points. A model's code is imported when one of its methods is first
used; its engine, when a solver is built. Which methods run a scene, with which settings, is decided
in `selection`.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from importlib import import_module, metadata
from pathlib import Path
from pkgutil import resolve_name
from typing import TypeVar

from rotor_mbs.errors import InputError, nearest, shown_value
from rotor_mbs.methods.base import Ladder, Method
from rotor_mbs.methods.method_file import ENDING, MethodFile, located, quiet, read_file
from rotor_mbs.scenario.toml_file import file_path

REFERENCE = "reference"
PRINTED = "printed/ode45"  # with all errata
GROUP = "rotor_mbs.methods"

R = TypeVar("R")

# The locations of the tuples of built-in methods ("package.module:name"); for each of them, how the
# names of its methods begin.
_BUILT_IN: Mapping[str, tuple[str, ...]] = {
    "rotor_mbs.models.printed.methods:METHODS": ("printed",),
    "rotor_mbs.models.lagrange.methods:METHODS": ("lagrange", REFERENCE),
    "rotor_mbs.models.exudyn.methods:METHODS": ("exudyn",),
    "rotor_mbs.models.mujoco.methods:METHODS": ("mujoco",),
}


# Methods by name


def methods() -> tuple[Method, ...]:
    """Return every method but the reference, in the order of tables and legends; plug-ins last."""
    built_in = []
    for location in _BUILT_IN:
        built_in += [method for method in _load(location) if method.name != REFERENCE]
    return (*built_in, *_plug_ins().values(), *_file_methods.values())


def method_names(*, is_corrected: bool | None = None) -> tuple[str, ...]:
    """Return the names of all methods.

    Parameters
    ----------
    is_corrected : True for those that claim the corrected equations, False for the others, None for
        all.
    """
    return tuple(method.name for method in methods() if is_corrected in (None, method.is_corrected))


def _built_in(name: str) -> Method | None:
    """Return the built-in method of a name, or None; only its own model is imported."""
    for location, beginnings in _BUILT_IN.items():
        if name.startswith(beginnings):
            for method in _load(location):
                if method.name == name:
                    return method
    return None


def is_built_in(name: str) -> bool:
    """Return whether a method, "reference" included, is one of this package."""
    return _built_in(name) is not None


def find_method_or_none(name: str) -> Method | None:
    """Return the method of a name, "reference" included.

    None where it is not known here: a results file may come from elsewhere.
    """
    return _built_in(name) or _file_methods.get(name) or _plug_ins().get(name)


def find_method(name: str) -> Method:
    """Return the method of a name, "reference" included. Raises InputError for an unknown name."""
    method = find_method_or_none(name)
    if method is None:
        raise InputError(unknown_names([name]))
    return method


def check_names(names: str | Sequence[str]) -> tuple[str, ...]:
    """Return the names of the methods that a user named.

    Parameters
    ----------
    names : names of methods and paths of Python files, one or several.

    Returns
    -------
    tuple of str
        Each name once, in order. A file is replaced by the names of all its methods.

    Raises
    ------
    InputError
        With a line for every unknown name, or for the first file that cannot be loaded.
    """
    names = _expand_files([names] if isinstance(names, str) else names)
    if unknown := unknown_names(names):
        raise InputError(unknown)
    return tuple(dict.fromkeys(names))


def unknown_names(names: Sequence[str]) -> list[str]:
    """Return a line for each of the names that no method has."""
    # Without names no model need be imported.
    known = method_names() if names else ()
    lines = []
    for name in names:
        if name not in known:
            what = f"unknown method {shown_value(name)}{nearest(name, known)}"
            lines.append(f"{what}; allowed: {', '.join(known)}")
    return lines


def is_corrected(name: str) -> bool:
    """Return whether a method claims the corrected equations; True for an unknown method."""
    method = find_method_or_none(name)
    return method is None or method.is_corrected


def default_methods() -> tuple[str, ...]:
    """Return the names of the methods that run where none is named.

    A method that is not installed is replaced by its fallback.
    """
    return tuple(_installed_name(method) for method in methods() if method.is_default)


def default_method() -> str:
    """Return the name of the method of `rm.run` and of sweeps where none is named.

    It is lagrange/taylor, or its fallback where that is not installed.
    """
    return _installed_name(find_method("lagrange/taylor"))


def _installed_name(method: Method) -> str:
    """Return the name of a method, or of its fallback where it is not installed."""
    is_replaced = method.fallback and not method.is_installed
    return method.fallback if is_replaced else method.name


def errata_methods() -> dict[str, str]:
    """Return, for each erratum ("E1", ...), the name of the method that has this erratum alone."""
    return {method.erratum: method.name for method in methods() if method.erratum}


def ladders(names: Sequence[str] = ()) -> dict[str, tuple[Method, Ladder]]:
    """Return the ladders of methods.

    Parameters
    ----------
    names : methods; () for all that have a ladder.

    Returns
    -------
    dict
        Method and ladder by the name of the curve: "model/integrator", then the variant.

    Raises
    ------
    InputError
        For a method that has none.
    """
    with_ladder = [method for method in methods() if method.ladders]
    allowed = [method.name for method in with_ladder]
    problems = []
    for name in names:
        if name not in allowed:
            what = f"no ladder for method {name!r}"
            if name in _file_methods:
                needed = "a setting `step` or `tolerance`, or `ladders`: docs/your-engine.md"
                what += f" (a Method of a file needs {needed})"
            problems.append(f"{what}; allowed: {', '.join(allowed)}")
    if problems:
        raise InputError(problems)
    curves = {}
    for method in with_ladder:
        if not names or method.name in names:
            for ladder in method.ladders:
                curves[method.name + ladder.variant] = method, ladder
    return curves


def label_of(curve: str) -> str:
    """Return the label of a curve: of a method, or of a variant of one, see `ladders`.

    An unknown name is its own label.
    """
    method = find_method_or_none(curve)
    if method is not None:
        return method.label
    curves = ladders()
    if curve not in curves:
        return curve
    method, ladder = curves[curve]
    return ", ".join(label for label in (method.label, ladder.label) if label)


# Methods of files. They are kept in variables of this process, and are replaced there if a file has
# been edited between two calls.

# Files that were named, by model.
_files: dict[str, MethodFile] = {}
# Their methods by name.
_file_methods: dict[str, Method] = {}


def _expand_files(names: Sequence[str]) -> list[str]:
    """Return the names with the path of each file replaced by the names of its methods.

    Parameters
    ----------
    names : of methods, and paths of Python files.

    Raises
    ------
    InputError
        If a file cannot be loaded, or two files have the same name.
    """
    expanded: list[str] = []
    paths: dict[str, str] = {}  # by model
    for name in names:
        if not name.endswith(ENDING):
            expanded.append(name)
            continue
        path = file_path(name)
        model = path.stem
        first = paths.setdefault(model, name)
        if Path(first).resolve() != path.resolve():
            what = f"methods {model}/... are those of {first}"
            raise InputError(f"{name}: {what}; allowed: another file name")
        expanded += _register(read_file(name))
    return expanded


def _register(file: MethodFile) -> list[str]:
    """Register the methods of a file in place of those that it had before; return their names."""
    if _files.get(file.model) != file:
        others = {}
        for name, method in _file_methods.items():
            if method.model != file.model:
                others[name] = method
        loaded = file.load([method for method in methods() if method.name not in _file_methods])
        _file_methods.clear()
        _file_methods.update(others | loaded)
        _files[file.model] = file
    return [name for name, method in _file_methods.items() if method.model == file.model]


def with_method_files(work: Callable[..., R]) -> Callable[..., R]:
    """Return a function that loads the method files of this process, and then calls `work`.

    It is for a worker process. What is printed there, also by `work`, is dropped.

    Parameters
    ----------
    work : the function; it is returned itself if no files are named.
    """
    if not _files:
        return work
    return partial(_call_with_files, os.getpid(), tuple(_files.values()), work)


def _call_with_files(
    process_id: int, files: Sequence[MethodFile], work: Callable[..., R], *arguments: object
) -> R:
    """Call a function after the methods of files have been loaded.

    The process `process_id` created the call; in any other process the output is dropped.
    """
    for file in files:
        _register(file)
    with nullcontext() if os.getpid() == process_id else quiet():
        return work(*arguments)


def error_line(error: BaseException) -> str:
    """Return what a method raised in one line, with the place in a method file if it has one."""
    return located(error, [file.path for file in _files.values()])


# Methods of packages


def _load(location: str) -> tuple[Method, ...]:
    """Import "package.module", and return the methods at the location "package.module:name"."""
    methods: tuple[Method, ...] = resolve_name(location)
    return methods


def _as_methods(loaded: object) -> tuple[Method, ...]:
    """Return the methods in an entry point's object. Raises TypeError if it is something else."""
    several = tuple(loaded) if isinstance(loaded, Iterable) else (loaded,)
    if not several or not all(isinstance(method, Method) for method in several):
        raise TypeError(f"{loaded!r:.60} is no Method and no sequence of them")
    return several


def _warn(message: str, *values: object) -> None:
    """Write a warning to this package's log."""
    import logging  # late: 6 ms that `rotor-mbs list` need not wait for

    logging.getLogger("rotor_mbs").warning(message, *values)


@functools.cache
def _plug_ins() -> dict[str, Method]:
    """Return the methods of other packages by name.

    One that cannot be loaded is left out, with a warning.
    """
    taken = {REFERENCE} | {method.name for location in _BUILT_IN for method in _load(location)}
    plug_ins: dict[str, Method] = {}
    for point in metadata.entry_points(group=GROUP):
        try:
            loaded = _as_methods(point.load())
        except (Exception, SystemExit) as exc:  # whatever another package raises must not stop this
            message = "plug-in %s of %s omitted: %s: %s"
            _warn(message, point.name, point.value, type(exc).__name__, exc)
            continue
        package = (point.dist.name,) if point.dist else ()
        for method in loaded:
            if method.name in taken:
                message = "plug-in %s of %s: method %s omitted: name already used"
                _warn(message, point.name, point.value, method.name)
                continue
            taken.add(method.name)
            # The version of its own package is stored with its runs, too.
            distributions = tuple(dict.fromkeys((*method.distributions, *package)))
            sources = _sources(point.module)
            plug_ins[method.name] = replace(method, distributions=distributions, sources=sources)
    return plug_ins


def _sources(module: str) -> tuple[Path, ...]:
    """Return the files of the package that a module is in, or the module's own."""
    top = import_module(module.partition(".")[0])
    folders = [Path(folder) for folder in getattr(top, "__path__", ())]
    if folders:
        return tuple(path for folder in folders for path in sorted(folder.rglob("*.py")))
    return (Path(top.__file__),) if top.__file__ else ()
