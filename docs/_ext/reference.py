"""The reference pages, generated from the program itself before Sphinx reads the sources.

`docs/reference/` is made anew by every build: docstrings, the scene's and the sweep's keys, the parser of the command
line, the catalogue of methods, the bounds, and the arrays of files that are written for this purpose.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import importlib
import inspect
import io
import re
import tempfile
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import h5py
from sphinx.application import Sphinx

import rotor_mbs
import rotor_mbs.testing
from rotor_mbs.cli import arguments, main
from rotor_mbs.methods.catalogue import methods
from rotor_mbs.scenario import catalogue, keys
from rotor_mbs.scenario.scene import BLADE_KEYS, SCENE_KEYS, new_scene_text
from rotor_mbs.scenario.sweep import Axis, Range, SweepTable
from rotor_mbs.solution.quantities import BUILT_IN
from rotor_mbs.solution.status import STATUSES

ROOT = Path(__file__).parents[2]


def page(title: str, *parts: str) -> str:
    return "\n\n".join([f"# {title}", *(part.strip("\n") for part in parts if part)]) + "\n"


def table(head: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    lines = [list(head), *(list(row) for row in rows)]
    lines.insert(1, ["---"] * len(lines[0]))
    return "\n".join("| " + " | ".join(_cell(item) for item in line) + " |" for line in lines)


def _cell(item: object) -> str:
    text = " ".join(str(item).split())
    return re.sub(r"(?<!\\)\|", r"\\|", text)


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}." if text else ""


def code(item: object) -> str:
    return f"`{item}`" if str(item) else ""


def fenced(text: str, language: str = "text") -> str:
    return f"```{language}\n{text.rstrip()}\n```"


# The API: every public name, what public functions return, and what an extension imports


def _pages_of_api() -> dict[str, str]:
    groups = {
        "`import rotor_mbs as rm`": {name: f"rotor_mbs.{name}" for name in rotor_mbs.__all__},
        "`rotor_mbs.testing`": {
            name: f"rotor_mbs.testing.{name}"
            for name, item in vars(rotor_mbs.testing).items()
            if inspect.isfunction(item) and item.__module__ == "rotor_mbs.testing" and not name.startswith("_")
        },
    }
    known = {id(_object(place)) for names in groups.values() for place in names.values()}
    groups["Returned objects"] = {
        item.__name__: f"{item.__module__}.{item.__name__}" for item in _returned(known) if id(item) not in known
    }
    known |= {id(_object(place)) for place in groups["Returned objects"].values()}
    groups["For methods and quantities of other packages"] = {
        name: place for name, place in _imports_of_extensions().items() if id(_object(place)) not in known
    }
    pages, parts = {}, []
    for heading, names in groups.items():
        rows = []
        for name, place in sorted(names.items()):
            item = _object(place)
            first = " ".join((inspect.getdoc(item) or "").split("\n\n")[0].split())
            rows.append([f"[`{name}`](api/{name}.md)", first.split(". ")[0].rstrip(".:").replace("*", r"\*")])
            if inspect.isclass(item):
                directive = f".. autoclass:: {place}\n   :members:"
            else:
                directive = f".. autofunction:: {place}"
            pages[f"api/{name}"] = page(f"{name}", fenced(directive, "{eval-rst}"))
        parts += [f"## {heading}", table(["name", "description"], rows)]
    toctree = fenced(":hidden:\n\n" + "\n".join(sorted(pages)), "{toctree}")
    pages["api"] = page("Python API", *parts, toctree)
    return pages


def _object(place: str) -> Any:
    module, _, name = place.rpartition(".")
    return getattr(importlib.import_module(module), name)


def _returned(public: set[int]) -> list[type]:
    """Classes of this package that public functions and properties return."""
    found: dict[type, None] = {}
    todo = [_object(f"rotor_mbs.{name}") for name in rotor_mbs.__all__]
    for item in todo:
        members = [item]
        if inspect.isclass(item):
            members = [member for name, member in vars(item).items() if not name.startswith("_")]
        for member in members:
            function = member.fget if isinstance(member, property) else getattr(member, "func", member)
            for kind in _classes(function):
                if kind not in found and id(kind) not in public:
                    found[kind] = None
                    todo.append(kind)
    return list(found)


def _classes(function: Any) -> list[type]:
    text = str(getattr(function, "__annotations__", {}).get("return", ""))
    module = inspect.getmodule(function)
    names = {**vars(module), **_type_checking_imports(module)} if module else {}
    kinds = [names.get(word) for word in re.findall(r"\w+", text)]
    return [kind for kind in kinds if inspect.isclass(kind) and kind.__module__.startswith("rotor_mbs.")]


def _type_checking_imports(module: Any) -> dict[str, Any]:
    """What a module imports, also within functions and for type checkers alone, from this package."""
    nodes = ast.walk(ast.parse(inspect.getsource(module)))
    imports = [
        node for node in nodes if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("rotor_mbs")
    ]
    return {
        alias.asname or alias.name: getattr(importlib.import_module(node.module or ""), alias.name, None)
        for node in imports
        for alias in node.names
    }


def _imports_of_extensions() -> dict[str, str]:
    """What the examples of extensions import from this package."""
    names = {}
    for path in sorted((ROOT / "tests" / "extension").glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("rotor_mbs."):
                names |= {alias.name: f"{node.module}.{alias.name}" for alias in node.names}
    return names


# The command line


def _command_line() -> str:
    parser, commands = arguments._parser()
    parts = [parser.description or "", fenced(parser.epilog or "")]
    for name, own in commands.items():
        rows = []
        for action in own._actions:
            if isinstance(action, argparse._HelpAction):
                continue
            names = ", ".join(code(option) for option in action.option_strings)
            value = (
                "" if action.nargs == 0 else str(action.metavar or "{" + ",".join(map(str, action.choices or ())) + "}")
            )
            text = (action.help or "") % {**vars(action), "prog": own.prog}
            if action.dest == "jobs":  # the number of cores of the machine that builds the pages
                text = text.replace(f", {action.default}", "")
            rows.append([names or code(value), code(value) if names else "", text])
        usage = " ".join(own.format_usage().removeprefix("usage: ").split())
        parts += [
            f"## {name}",
            f"{_sentence(own.description or '')}",
            fenced(usage),
            table(["argument", "value", "meaning"], rows),
        ]
        parts.append(fenced((own.epilog or "").partition("\n")[2].replace("  rotor-mbs", "rotor-mbs"), "sh"))
    return page("Command line", *parts)


# Scene and sweep files


def _keys(declared: Mapping[str, Mapping[str, Any]], prefix: str = "") -> str:
    rows = []
    for key in declared.values():
        default = "required"
        if "optional" in key:
            value = key["optional"]
            empty = value is None or (isinstance(value, tuple | dict | list) and not value)
            default = "none" if empty else code(value if not isinstance(value, tuple) else list(value))
        rows.append([code(prefix + key["key"]), key["allowed"], default])
    return table(["key", "allowed", "default"], rows)


def _scene_file() -> str:
    top = {name: key for name, key in SCENE_KEYS.items() if key["key"] != "blade"}
    return page(
        "Scene file",
        "A TOML file. `a.b` is the key `b` of the table `[a]`. "
        f"A number may be arithmetic in quotes: {keys.ALLOWED}; it is parsed, not executed as code.",
        "## Keys",
        _keys(top),
        "## Blades",
        f"{SCENE_KEYS['blades']['allowed'].capitalize()}.",
        _keys(BLADE_KEYS, "blade."),
        "## A file with every key",
        "As `rotor-mbs new FILE` writes it:",
        fenced(new_scene_text(), "toml"),
    )


def _sweep_file() -> str:
    return page(
        "Sweep file",
        "A TOML file with numbers as in a [scene file](scene-file.md); see [parameter studies](../sweeps.md).",
        "## Keys",
        _keys(keys.declared_keys(SweepTable)),
        "## `[[axis]]`",
        _keys(keys.declared_keys(Axis), "axis."),
        "Exactly one of these is required beside `key`. A table for `linear` and `log` has:",
        _keys(keys.declared_keys(Range)),
    )


def _scenes() -> str:
    parts = []
    folders: dict[str, list[list[str]]] = {}
    for name, title in [*catalogue.list_scenes(), *catalogue.list_sweeps()]:
        folders.setdefault(name.partition("/")[0], []).append([code(name), title])
    for folder, rows in folders.items():
        parts += [f"## {folder}", table(["scene", "title"], rows)]
    return page("Shipped scenes and sweeps", *parts)


# Methods and bounds


def _methods() -> str:
    parts = ["A setting is changed by `--set NAME=VALUE` or by `[settings]` in a scene file."]
    for method in methods():
        facts = [
            f"order {method.order:g}" if method.order else "",
            "fixed step" if method.fixed_step else "",
            "in the default selection" if method.is_default else "",
            f"needs {', '.join(method.distributions)}" if method.distributions else "",
            f"replaced by `{method.fallback}` if this is missing" if method.fallback else "",
            "linearized by `modes`" if method.linearize else "",
        ]
        defaults = method.settings().as_dict()
        rows = [
            [code(name), allowed, allowed.doc, code(defaults[name])]
            for name, allowed in method.settings.allowed().items()
        ]
        parts += [f"## {method.name}", _sentence(method.label), _sentence("; ".join(filter(None, facts)))]
        parts += [table(["setting", "allowed", "meaning", "default"], rows)] if rows else []
    return page("Methods and their settings", *parts)


def _bounds() -> str:
    entries = tomllib.loads((ROOT / "reference" / "accuracy.toml").read_text(encoding="utf-8"))["bound"]
    names = list(dict.fromkeys(name for entry in entries for name in entry))
    by_check: dict[str, list[dict[str, Any]]] = {}
    for entry in entries:
        by_check.setdefault(entry["check"], []).append(entry)
    parts = ["From `reference/accuracy.toml`; `*` matches any name. `fault` is the value that the known fault gives."]
    for check, own in by_check.items():
        shown = [name for name in names if name != "check" and any(name in entry for entry in own)]
        rows = [
            [code(entry.get(name, "")) if name in ("method", "scenes") else entry.get(name, "") for name in shown]
            for entry in own
        ]
        parts += [f"## {check}", table([name.replace("_", " ") for name in shown], rows)]
    return page("Accuracy bounds", *parts)


# Files


_STUDY = """
title = "Two stiffnesses"
scene = "check/general"
methods = ["lagrange/dop853"]
outputs = ["angles", "rates", "tip", "energy", "loads"]
samples = 11
error_growth = true
validation = 0.5
[[axis]]
key = "bearing.stiffness"
values = [1e3, 2e3]
"""
_MEANINGS = {
    "missing": "not computed yet",
    "ok": "defects, energy balance and error up to the horizon within the bounds",
    "inaccurate": "end reached, but one of these bounds is exceeded",
    "diverged": "end not reached: values grew without limit",
    "singular": "end not reached, or not reliable: the motion passes a singularity of the mass matrix",
    "solver_failed": "end not reached: the integrator failed",
    "timed_out": "end not reached: time limit",
    "left_out": "point of a benchmark that was not computed because of the time budget",
    "worker_died": "the worker process died",
    "unchecked": "end reached, but the accuracy cannot be assessed",
    "completed": "end reached by the printed equations, whose accuracy is not assessed",
}
_EXAMPLES = {
    "Results": (
        "`run`, `reproduce` and `reference` write one row per run into `/runs`, and the arrays over time into a group "
        "of the scene's name.",
        "run scene.toml -m lagrange/dop853 -m exudyn_chain/extrapolated -o results.h5 -j 1",
    ),
    "Benchmarks": (
        "`bench` writes a row per point (a method with one setting on a scene) into `/bench`, references into `/runs`.",
        "bench scene.toml -m lagrange/dop853 --budget 1 --repeats 1 -o bench.h5",
    ),
    "Sweeps": (
        "One flat table at the root: the run's numbers, the varied parameters, metrics and arrays. Unlike a results "
        "file it has no references and no errors relative to them, no run times, a horizon only with `error_growth`, "
        "and no texts per row: scene, methods and versions are attributes, `code` tells rows of other versions apart.",
        "sweep study.toml -o sweep.h5 -j 1",
    ),
    "Modes": ("A group per scene, model and state.", "modes scene.toml --speeds 0.5:1:2 -o modes.h5 -j 1"),
    "Comparisons": ("The data and the reference at their times.", "compare data.csv --scene scene.toml -o ."),
}
_WRITTEN = {"Comparisons": "comparison.h5"}


def _statuses() -> list[list[object]]:
    return [[code, name, _MEANINGS[name]] for code, name in enumerate(STATUSES)]


def _file_format() -> str:
    parts = [
        "All files are HDF5, readable by netCDF-4, xarray, MATLAB and h5py, without links or compression. Numbers are "
        "little-endian; every dataset has `units` and `long_name`, and every dimension a dataset of its name (a "
        "dimension scale). Arrays are contiguous, so that a row lies at a fixed offset. The tables below list the "
        "content of files that were written when these pages were built.",
        "A row is complete if its `status` is not -1 and its `crc32` is correct; a file is complete if all rows are. "
        "All values of a missing row are NaN, -1 or empty text. Arrays over time are NaN after the last sample of a "
        "run; `samples` is the number of samples. Text that is known when the file is created is of variable length, "
        "UTF-8. Computed text, such as `message`, is UTF-8 in an array of single characters, padded with zeros; xarray "
        "reads it as text. The attribute `digests` of a group has SHA-256 digests of everything that is not a row. "
        "`versions` of a row is a JSON text with the versions that computed it; the attributes of `/` have those that "
        "created the file. Signs and frames: [Reading results](../data.md).",
        "`crc32` of row r is the CRC-32 of zlib (`zlib.crc32`), with r as its starting value, over the bytes of the "
        "row in each computed dataset of `/runs` but `crc32`, then in each computed dataset of its scene's group, in "
        "the order of creation; of a reference then the whole of its datasets without the dimension `run`. Computed "
        "datasets are those whose key in `digests` is `attributes of NAME`. In a sweep the starting value is the "
        "number `run`.",
        "## Status codes",
        table(["code", "status", "meaning"], [[-1, "missing", _MEANINGS["missing"]], *_statuses()]),
    ]
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        scene = rotor_mbs.scene("check/general").replace(
            duration=0.5, samples=11, outputs=["angles", "rates", "tip", "energy", "loads"]
        )
        Path("scene.toml").write_text(scene.text, encoding="utf-8")
        Path("study.toml").write_text(_STUDY, encoding="utf-8")
        _call("export scene.toml --to csv -o data.csv")
        for heading, (text, command) in _EXAMPLES.items():
            _call(command)
            name = _WRITTEN.get(heading) or command.partition(" -o ")[2].split()[0]
            parts += [f"## {heading}", text, fenced(f"rotor-mbs {command}", "sh"), *_contents(Path(name))]
    text = page("File format", *parts)
    missing = [quantity.name for quantity in BUILT_IN if quantity.is_over_time and f"| `{quantity.name}` |" not in text]
    if missing:
        raise RuntimeError(f"no file of the examples has {', '.join(missing)}")
    return text


def _call(command: str) -> None:
    output = io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
        status = main(command.split())
    if status not in (0, 1):
        raise RuntimeError(f"rotor-mbs {command}: status {status}: {output.getvalue()}")


def _contents(path: Path) -> list[str]:
    parts = []
    with h5py.File(path) as file:
        groups = ["/"]
        file.visititems(lambda name, item: groups.append(f"/{name}") if isinstance(item, h5py.Group) else None)
        for name in groups:
            group = file[name]
            datasets = [item for item in group.values() if isinstance(item, h5py.Dataset)]
            if not datasets and name != "/":
                continue
            attributes = [[code(key), code(_short(value))] for key, value in group.attrs.items()]
            parts += [f"### `{name}` of {path.name}", table(["attribute", "as in this file"], attributes)]
            rows = [
                [
                    code(Path(item.name).name),
                    ", ".join(Path(dimension[0].name).name for dimension in item.dims if len(dimension)) or _own(item),
                    _kind(item),
                    _text(item.attrs.get("units", "")),
                    _text(item.attrs.get("long_name", "length of texts")) + _flags(item),
                ]
                for item in datasets
            ]
            parts += [table(["dataset", "dimensions", "type", "unit", "description"], rows)] if rows else []
    return parts


def _own(item: Any) -> str:
    return Path(item.name).name if item.is_scale else ""


def _kind(item: Any) -> str:
    if item.chunks or item.compression:
        raise RuntimeError(f"{item.name}: chunked or compressed, which the page denies")
    if item.dtype.kind in "OS":
        return "text" if item.dtype.kind == "O" else "character"
    return str(item.dtype)


def _text(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)


def _flags(item: Any) -> str:
    flags = []
    if "flag_meanings" in item.attrs and Path(item.name).name != "status":
        flags.append(f"codes {', '.join(map(str, item.attrs['flag_values']))}: {_text(item.attrs['flag_meanings'])}")
    if "labels" in item.attrs:
        flags.append(f"names in the attribute `labels`: {', '.join(map(_text, item.attrs['labels']))}")
    return "".join(f"; {flag}" for flag in flags)


def _short(value: Any) -> str:
    text = " ".join(_text(value).split()).replace("`", "'")
    return text if len(text) <= 80 else text[:77] + "..."


def declared_pages() -> dict[str, str]:
    """The pages that need no file to be written."""
    return {
        **_pages_of_api(),
        "command-line": _command_line(),
        "scene-file": _scene_file(),
        "sweep-file": _sweep_file(),
        "scenes": _scenes(),
        "methods": _methods(),
        "bounds": _bounds(),
    }


def _write(app: Sphinx) -> None:
    """Unchanged files are left as they are, so that Sphinx does not read them again."""
    folder = Path(app.srcdir) / "reference"
    pages = {**declared_pages(), "file-format": _file_format()}
    for path in folder.rglob("*.md"):
        if path.relative_to(folder).with_suffix("").as_posix() not in pages:
            path.unlink()
    for name, text in pages.items():
        path = folder / f"{name}.md"
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", _write)
    return {"parallel_read_safe": True}
