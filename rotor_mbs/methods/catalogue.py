"""Find methods by name: built-in methods, and methods of other packages and of Python files.

Other packages add methods by entry points. The user names Python files that define methods. A
model's code is imported when one of its methods is first used, and its engine when a solver is
built. `methods.selection` decides which methods run a scene, and with which settings.
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
PRINTED = "printed/ode45"  # the method that has all errata
GROUP = "rotor_mbs.methods"

R = TypeVar("R")

# The location of each tuple of built-in methods, "package.module:name", and the beginnings of the
# names of these methods. A method is found by the beginning of its name, without importing the
# modules of other models.
_BUILT_IN: Mapping[str, tuple[str, ...]] = {
    "rotor_mbs.models.printed.methods:METHODS": ("printed",),
    "rotor_mbs.models.lagrange.methods:METHODS": ("lagrange", REFERENCE),
    "rotor_mbs.models.exudyn.methods:METHODS": ("exudyn",),
    "rotor_mbs.models.mujoco.methods:METHODS": ("mujoco",),
}


# Methods by name


def methods() -> tuple[Method, ...]:
    """Return every method but the reference, in the order of tables and legends.

    Built-in methods are first, then those of other packages, then those of Python files.
    """
    built_in = []
    for location in _BUILT_IN:
        built_in += [method for method in _load(location) if method.name != REFERENCE]
    return (*built_in, *_plug_ins().values(), *_file_methods.values())


def method_names(*, is_corrected: bool | None = None) -> tuple[str, ...]:
    """Return the names of methods: all, or those selected by `is_corrected`.

    Parameters
    ----------
    is_corrected : True for methods that are declared to solve the corrected equations, False for
        the other methods, None for all methods.
    """
    return tuple(method.name for method in methods() if is_corrected in (None, method.is_corrected))


def _built_in(name: str) -> Method | None:
    """Return the built-in method with a name, or None; only the method's model is imported."""
    for location, beginnings in _BUILT_IN.items():
        if name.startswith(beginnings):
            for method in _load(location):
                if method.name == name:
                    return method
    return None


def is_built_in(name: str) -> bool:
    """Return whether the method with a name, which may be "reference", is built in."""
    return _built_in(name) is not None


def find_method_or_none(name: str) -> Method | None:
    """Return the method with a name, which may be "reference", or None if it is unknown.

    A results file of another computer may contain methods that are unknown here.
    """
    return _built_in(name) or _file_methods.get(name) or _plug_ins().get(name)


def find_method(name: str) -> Method:
    """Return the method with a name, which may be "reference". Raises InputError if unknown."""
    method = find_method_or_none(name)
    if method is None:
        raise InputError(unknown_names([name]))
    return method


def check_names(names: str | Sequence[str]) -> tuple[str, ...]:
    """Check the methods that a user named, and return their names.

    Parameters
    ----------
    names : one or several names of methods or paths of Python files.

    Returns
    -------
    tuple of str
        Each name once, in the given order. The path of a file is replaced by the names of all its
        methods.

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
    """Return an error line for each of the names that is not the name of a method."""
    # If there are no names, no model is imported.
    known = method_names() if names else ()
    lines = []
    for name in names:
        if name not in known:
            what = f"unknown method {shown_value(name)}{nearest(name, known)}"
            lines.append(f"{what}; allowed: {', '.join(known)}")
    return lines


def is_corrected(name: str) -> bool:
    """Return whether a method is declared to solve the corrected equations.

    Returns True for an unknown method.
    """
    method = find_method_or_none(name)
    return method is None or method.is_corrected


def default_methods() -> tuple[str, ...]:
    """Return the names of the methods in the default selection (`Method.is_default`).

    A default method that is not installed is replaced by its fallback.
    """
    return tuple(_installed_name(method) for method in methods() if method.is_default)


def default_method() -> str:
    """Return the name of the method that `rm.run` and sweeps use if the user names no method.

    It is lagrange/taylor, or its fallback if lagrange/taylor is not installed.
    """
    return _installed_name(find_method("lagrange/taylor"))


def _installed_name(method: Method) -> str:
    """Return the name of a method, or of its fallback if the method is not installed."""
    is_replaced = method.fallback and not method.is_installed
    return method.fallback if is_replaced else method.name


def errata_methods() -> dict[str, str]:
    """Return the names of the methods that have a single erratum, by erratum ("E1", ...)."""
    return {method.erratum: method.name for method in methods() if method.erratum}


def ladders(names: Sequence[str] = ()) -> dict[str, tuple[Method, Ladder]]:
    """Return the ladders of methods: the steps or tolerances at which `bench` runs them.

    Parameters
    ----------
    names : names of methods; () for all methods that have a ladder.

    Returns
    -------
    dict
        Method and ladder by name of the curve, which is the method's name followed by the ladder's
        variant.

    Raises
    ------
    InputError
        For a method that has no ladder.
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
    """Return the label of a curve, which is a method or a variant of a method (see `ladders`).

    For an unknown curve, its name is returned.
    """
    method = find_method_or_none(curve)
    if method is not None:
        return method.label
    curves = ladders()
    if curve not in curves:
        return curve
    method, ladder = curves[curve]
    return ", ".join(label for label in (method.label, ladder.label) if label)


# Methods of Python files. Two variables of this process keep them. If a file was edited between two
# calls, the second call replaces its methods.

# Files that the user named, by model.
_files: dict[str, MethodFile] = {}
# Methods of these files by name.
_file_methods: dict[str, Method] = {}


def _expand_files(names: Sequence[str]) -> list[str]:
    """Return the names with the path of each file replaced by the names of its methods.

    Parameters
    ----------
    names : names of methods, and paths of Python files.

    Raises
    ------
    InputError
        If a file cannot be loaded, or two files have the same name.
    """
    expanded: list[str] = []
    paths: dict[str, str] = {}  # paths of the files by model
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
    """Register the methods of a file, and return their names.

    They replace the methods that were registered for the file before.
    """
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

    The function is for worker processes. There, the output of the files and of `work` is dropped.

    Parameters
    ----------
    work : the function to call. It is returned unchanged if the user named no files.
    """
    if not _files:
        return work
    return partial(_call_with_files, os.getpid(), tuple(_files.values()), work)


def _call_with_files(
    process_id: int, files: Sequence[MethodFile], work: Callable[..., R], *arguments: object
) -> R:
    """Load the methods of files, then call the function `work`.

    The output of `work` is dropped unless this process is `process_id`, which created the call.
    """
    for file in files:
        _register(file)
    with nullcontext() if os.getpid() == process_id else quiet():
        return work(*arguments)


def error_line(error: BaseException) -> str:
    """Return an error of a method as one line, with file and line if a method file raised it."""
    return located(error, [file.path for file in _files.values()])


# Methods of packages


def _load(location: str) -> tuple[Method, ...]:
    """Import "package.module", and return the methods at the location "package.module:name"."""
    methods: tuple[Method, ...] = resolve_name(location)
    return methods


def _as_methods(loaded: object) -> tuple[Method, ...]:
    """Return the methods in the object of an entry point: a Method, or a sequence of Methods.

    Raises TypeError for any other object.
    """
    several = tuple(loaded) if isinstance(loaded, Iterable) else (loaded,)
    if not several or not all(isinstance(method, Method) for method in several):
        raise TypeError(f"{loaded!r:.60} is no Method and no sequence of them")
    return several


def _warn(message: str, *values: object) -> None:
    """Write a warning to this package's log."""
    import logging  # imported late: it takes 6 ms, and `rotor-mbs list` does not need it

    logging.getLogger("rotor_mbs").warning(message, *values)


@functools.cache
def _plug_ins() -> dict[str, Method]:
    """Return the methods of other packages by name.

    Methods that cannot be loaded, or whose name is already used, are left out with a warning.
    """
    taken = {REFERENCE} | {method.name for location in _BUILT_IN for method in _load(location)}
    plug_ins: dict[str, Method] = {}
    for point in metadata.entry_points(group=GROUP):
        try:
            loaded = _as_methods(point.load())
        except (Exception, SystemExit) as exc:  # another package may raise any error
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
            # With this, the version of the plug-in's package is stored with the method's runs.
            distributions = tuple(dict.fromkeys((*method.distributions, *package)))
            sources = _sources(point.module)
            plug_ins[method.name] = replace(method, distributions=distributions, sources=sources)
    return plug_ins


def _sources(module: str) -> tuple[Path, ...]:
    """Return the Python files of the top-level package that contains a module.

    For a top-level module that is not a package, this is the file of the module.
    """
    top = import_module(module.partition(".")[0])
    folders = [Path(folder) for folder in getattr(top, "__path__", ())]
    if folders:
        return tuple(path for folder in folders for path in sorted(folder.rglob("*.py")))
    return (Path(top.__file__),) if top.__file__ else ()
