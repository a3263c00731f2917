"""The reference pages, generated from the program itself before Sphinx reads the sources.

`docs/reference/` is made anew by every build: docstrings, the scene's and the sweep's keys, the
parser of the command line, the catalogue of methods, the bounds, and the arrays of files that are
written for this purpose.
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
from rotor_mbs.runs.versions import versions
from rotor_mbs.scenario import catalogue, expressions, keys
from rotor_mbs.scenario.scene import BLADE_KEYS, SCENE_KEYS, new_scene_text
from rotor_mbs.scenario.sweep import DESIGN_KEYS, Axis, Range
from rotor_mbs.solution.quantities import BUILT_IN
from rotor_mbs.solution.status import STATUSES

ROOT = Path(__file__).parents[2]
VERSIONED = versions().keys()


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
            if inspect.isfunction(item)
            and item.__module__ == "rotor_mbs.testing"
            and not name.startswith("_")
        },
    }
    known = {id(_object(place)) for names in groups.values() for place in names.values()}
    groups["Returned objects"] = {
        item.__name__: f"{item.__module__}.{item.__name__}"
        for item in _returned(known)
        if id(item) not in known
    }
    known |= {id(_object(place)) for place in groups["Returned objects"].values()}
    groups["For methods and quantities of other packages"] = {
        name: place
        for name, place in _imports_of_extensions().items()
        if id(_object(place)) not in known
    }
    pages, parts = {}, []
    for heading, names in groups.items():
        rows = []
        for name, place in sorted(names.items()):
            item = _object(place)
            first = " ".join((inspect.getdoc(item) or "").split("\n\n")[0].split())
            rows.append(
                [
                    f"[`{name}`](api/{name}.md)",
                    first.split(". ")[0].rstrip(".:").replace("*", r"\*"),
                ]
            )
            if inspect.isclass(item):
                own = any(base.__module__.startswith("rotor_mbs.") for base in item.__bases__)
                directive = (
                    f".. autoclass:: {place}\n   :members:" + "\n   :show-inheritance:" * own
                )
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
    """Classes of this package that public functions and properties return, and their base
    classes."""
    found: dict[type, None] = {}
    todo = [_object(f"rotor_mbs.{name}") for name in rotor_mbs.__all__]
    for item in todo:
        members, bases = [item], []
        if inspect.isclass(item):
            members = [member for name, member in vars(item).items() if not name.startswith("_")]
            bases = [base for base in item.__bases__ if base.__module__.startswith("rotor_mbs.")]
        for member in members:
            function = (
                member.fget if isinstance(member, property) else getattr(member, "func", member)
            )
            for kind in [*_classes(function), *bases]:
                if kind not in found and id(kind) not in public:
                    found[kind] = None
                    todo.append(kind)
    return list(found)


def _classes(function: Any) -> list[type]:
    text = str(getattr(function, "__annotations__", {}).get("return", ""))
    module = inspect.getmodule(function)
    names = {**vars(module), **_type_checking_imports(module)} if module else {}
    kinds = [names.get(word) for word in re.findall(r"\w+", text)]
    return [
        kind for kind in kinds if inspect.isclass(kind) and kind.__module__.startswith("rotor_mbs.")
    ]


def _type_checking_imports(module: Any) -> dict[str, Any]:
    """What a module imports, also within functions and for type checkers alone, from this
    package."""
    nodes = ast.walk(ast.parse(inspect.getsource(module)))
    imports = [
        node
        for node in nodes
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("rotor_mbs")
    ]
    return {
        alias.asname or alias.name: getattr(
            importlib.import_module(node.module or ""), alias.name, None
        )
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
                ""
                if action.nargs == 0
                else str(action.metavar or "{" + ",".join(map(str, action.choices or ())) + "}")
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
        parts.append(
            fenced((own.epilog or "").partition("\n")[2].replace("  rotor-mbs", "rotor-mbs"), "sh")
        )
    return page("Command line", *parts)


# Scene and sweep files


def _keys(declared: Mapping[str, Mapping[str, Any]], prefix: str = "") -> str:
    rows = []
    for key in declared.values():
        default = "required"
        if "optional" in key:
            value = key["optional"]
            empty = value is None or (isinstance(value, tuple | dict | list) and not value)
            default = (
                "none" if empty else code(value if not isinstance(value, tuple) else list(value))
            )
        rows.append([code(prefix + key["key"]), key["allowed"], default])
    return table(["key", "allowed values, meaning", "default"], rows)


def _scene_file() -> str:
    top = {name: key for name, key in SCENE_KEYS.items() if key["key"] != "blade"}
    return page(
        "Scene file",
        "A TOML file. `a.b` is the key `b` of the table `[a]`. A number may be arithmetic in "
        f"quotes: {expressions.ALLOWED}; it is parsed, not executed as code.",
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
        (
            "A TOML file with numbers as in a [scene file](scene-file.md); see [parameter "
            "studies](../sweeps.md)."
        ),
        "## Keys",
        _keys(DESIGN_KEYS),
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
            [code(name), setting["allowed"], setting["doc"], code(defaults[name])]
            for name, setting in method.settings.declared().items()
        ]
        parts += [
            f"## {method.name}",
            _sentence(method.label),
            _sentence("; ".join(filter(None, facts))),
        ]
        parts += [table(["setting", "allowed", "meaning", "default"], rows)] if rows else []
    return page("Methods and their settings", *parts)


_BOUND_HEADS = {
    "value": "bound",
    "fault": "value with the known fault",
    "known_fault": "known fault",
}


def _bounds() -> str:
    entries = tomllib.loads((ROOT / "reference" / "accuracy.toml").read_text(encoding="utf-8"))[
        "bound"
    ]
    names = list(dict.fromkeys(name for entry in entries for name in entry))
    by_check: dict[str, list[dict[str, Any]]] = {}
    for entry in entries:
        by_check.setdefault(entry["check"], []).append(entry)
    parts = [
        "From `reference/accuracy.toml`. Of the entries that match check, method and scene the "
        "first one applies; `*` matches any text, `|` separates patterns, and an entry without "
        "scenes applies to any scene. Bounds of `defect`, `defect median`, `error` and `exact` are "
        "in rad; the others are relative, or counts. What is compared: [check](../check.md)."
    ]
    for check, own in by_check.items():
        shown = [name for name in names if name != "check" and any(name in entry for entry in own)]
        rows = [
            [
                code(entry.get(name, "")) if name in ("method", "scenes") else entry.get(name, "")
                for name in shown
            ]
            for entry in own
        ]
        parts += [f"## {check}", table([_BOUND_HEADS.get(name, name) for name in shown], rows)]
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
    "diverged": (
        "values that are not finite, although the engine reports success; `samples` ends before "
        "them"
    ),
    "singular": (
        "the mass matrix is singular at the start or becomes singular; what follows is not "
        "determined"
    ),
    "solver_failed": "end not reached: the engine reports a failure",
    "timed_out": "end not reached: time limit",
    "left_out": "point of a benchmark that was not computed because of the time budget",
    "worker_died": "the worker process died",
    "unchecked": "end reached, but the accuracy cannot be assessed",
    "completed": "end reached by the printed equations, whose accuracy is not assessed",
}
_EXAMPLES = {
    "Results": (
        "`run`, `reproduce` and `reference` write one row per run into `/runs`, and the arrays "
        "over time into a group that has the name of the scene. Both have the same runs: the "
        "label in `/runs` is `SCENE/METHOD`, that in the scene's group `METHOD`.",
        "run scene.toml -m lagrange/dop853 -m exudyn_chain/extrapolated -o results.h5 -j 1",
    ),
    "Benchmarks": (
        "`bench` writes a row per point (a method with one setting on a scene) into `/bench`, and "
        "the references into `/runs` and the groups of the scenes.",
        "bench scene.toml -m lagrange/dop853 --budget 1 --repeats 1 -o bench.h5",
    ),
    "Sweeps": (
        "`sweep` writes one flat table at the root. `run` is a number; each varied parameter is a "
        "variable. Compared with a results file there is no reference and no error relative to "
        "one, there are no run times, `error_growth` and `horizon_s` only with `error_growth = "
        "true`, and scene, methods and versions are attributes instead of columns. `code` "
        "distinguishes rows of other versions.",
        "sweep study.toml -o sweep.h5 -j 1",
    ),
    "Modes": (
        "`modes` writes a group per scene, model and state (`rest`, `rotation`); Floquet "
        "multipliers are in a group of `lagrange`. All models have the same variables; those of "
        "`motion` are left out where no whirl is defined.",
        "modes stiff/nrel-5mw --speeds 0.5:1:2 -o modes.h5 -j 1",
    ),
    "Comparisons": (
        "`compare` writes the data, the reference and their differences at the times of the data. "
        "Shown are the variables of one channel of each kind.",
        "compare data.csv --scene scene.toml -o .",
    ),
}
# Of the attributes that are no versions of packages.
_ATTRIBUTES = {
    "Conventions": "conventions that the file follows",
    "format": "rotor_mbs in every file of this program",
    "format_version": "version of this format",
    "title": "title",
    "summary": "content in words",
    "keywords": "keywords",
    "platform": "operating system of the process that created the file",
    "cpu": "processor, number of cores",
    "created": "time of creation (UTC); not in sweeps, which are reproduced byte by byte",
    "date_created": "the same, as ACDD names it",
    "integrity": "how changes are found",
    "figures": "figures of the paper",
    "blades": "number of blades",
    "gravity": "m/s^2",
    "scene_toml": "text of the scene file",
    "scene_hash": "SHA-256 of the numbers of the scene, in hexadecimal",
    "NX_class": "for viewers of NeXus files",
    "signal": "for viewers of NeXus files",
    "axes": "for viewers of NeXus files",
    "sweep_toml": "text of the sweep file",
    "base_scene": "name of the scene that is varied",
    "combine": "grid or zip",
    "shape": "JSON: number of values of each axis",
    "seed": "seed of the random draws",
    "validation_share": "fraction of the runs marked as validation",
    "test_share": "fraction of the runs marked as test",
    "settings": "JSON: settings of the methods that are not defaults",
    "runs_of_all_parts": "number of runs of the whole sweep",
    "sweep_identity": "SHA-256 of the definition; a file with another one is not continued",
    "methods": "names of the methods",
    "runs": "number of runs in this file",
    "parameter_keys": "keys of the varied parameters",
    "notes": "results that could not be computed, with the reason",
    "label": "label of the model",
    "scene_label": "name of the scene, with what was changed in a shipped one",
    "weights": (
        "1/s^2, moments of all weights about the shaft divided by the inertia: what residuals are "
        "relative to"
    ),
    "symmetric": "1 if the modes are named after multiblade coordinates",
    "mode_labels": "names of the modes",
    "coordinate_labels": "names of the coordinates",
    "component_labels": "names of the multiblade coordinates",
    "motion_labels": "names of the motions in the fixed frame",
    "messages": "reason for each speed without a result",
    "source": "name of the file with the data",
    "status": "ok, inaccurate or unchecked",
    "message": "reason for a status other than ok",
    "tolerance": "tolerance of the comparison",
    "horizon_s": "horizon (s)",
    "verdict": "JSON: the result of the comparison, as `compare --json` prints it",
}
_WRITTEN = {"Comparisons": "comparison.h5"}


def _statuses() -> list[list[object]]:
    return [[code, name, _MEANINGS[name]] for code, name in enumerate(STATUSES)]


def _file_format() -> str:
    parts = [
        "All files are HDF5 and readable as netCDF-4, without links or compression. Numbers are "
        "little-endian. Every dataset has the attributes `units` and `long_name`, and every "
        "dimension has a dataset of the same name with its values (a dimension scale), except "
        "`characters`, whose dataset has the length alone. The tables list the content of files "
        "that were written when these pages were built; signs, frames and units are explained in "
        "[Reading results](../data.md).",
        "**Rows.** A row is complete if its `status` is not -1 and its `crc32` is correct; a file "
        "is complete if all rows are. Of a missing row only the columns that are known in advance "
        "(`run`, `scene`, `method_name`, `settings`, `versions`, `scene_hash`, varied parameters, "
        "`split`) are valid; its other values are undefined. In a complete row a value that does "
        "not exist or was not computed is NaN, -1 (integers) or an empty text.",
        "**Arrays over time** have one entry per sample. A run that ended early has `samples` of "
        "them, and the rest is NaN; in a sweep, which has no such column, the entries that are "
        "not NaN are those of the run. An array that the method does not compute is NaN as a "
        "whole.",
        "**Text** that is known when the file is created is a string of variable length, UTF-8. "
        "Computed text, such as `message`, is an array of single characters (run, characters), "
        "UTF-8, padded with zeros; xarray reads it as text, h5py and MATLAB as [described "
        "here](../data.md).",
        "**Versions.** The column `versions` is a JSON text with the versions of this package, "
        "Python, the libraries and the code that computed the row. A sweep has the column `code` "
        "instead, the CRC-32 of that text: among rows of one method those of other versions can "
        "be told apart, but the versions themselves are not stored. The attributes "
        f"{', '.join(map(code, VERSIONED))} of `/` are of the process that created the file. Rows "
        "of other versions are recomputed by the next `run`, `reproduce`, `bench` or `stability`; "
        "a sweep keeps them.",
        "**Layout.** Datasets are contiguous, so that a row lies at a fixed offset and is written "
        "there when it is computed. The datasets that are filled in this way are called "
        "*computed* here, the others *known in advance*. The trailer of the file lists them.",
        "**Checksum.** `crc32` of row r is the CRC-32 of zlib (`zlib.crc32`), with r, counted "
        "from 0, as its starting value, over the bytes of the row in each computed dataset of "
        "`/runs` except `crc32`, in the order in which they were created (h5py lists them so), "
        "then of the method's row in each computed dataset of its scene's group that has the "
        "dimension `run`. For a reference the computed datasets without the dimension `run` "
        "follow as a whole. In `/bench` and `/stability` only the table's own datasets are "
        "covered, in a sweep those of `/`, where the starting value is the number `run`. Datasets "
        "known in advance are not covered, but by the digest. [Reading results](../data.md) has a "
        "program for results files.",
        "**Trailer.** Behind the end of HDF5, which does not see it: a JSON text, its length (8 "
        "bytes, little-endian), a SHA-256 (32 bytes) and the text `rmbs-end`. The JSON object has "
        "`format_version`, `kind` (`results`, `sweep`, `modes`, `comparison` or `split of FILE`) "
        "and `groups`: by group, by name of each computed dataset in the order of the checksum, "
        "offset and length of its values in bytes. The SHA-256 covers every byte before it except "
        "these values. `rotor-mbs` verifies it before it opens a file.",
        "## Status codes",
        (
            "The attributes `flag_values` and `flag_meanings` of every dataset `status` list the "
            "codes and their names."
        ),
        table(["code", "status", "meaning"], [[-1, "missing", _MEANINGS["missing"]], *_statuses()]),
    ]
    shown: dict[str, list[str]] = {}
    attributes: set[str] = set()
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
            parts += [
                f"## {heading}",
                text,
                fenced(f"rotor-mbs {command}", "sh"),
                *_contents(Path(name), shown, attributes),
            ]
    text = page("File format", *parts, "## Attributes", _attributes(attributes))
    missing = [quantity.name for quantity in BUILT_IN if f"| `{quantity.name}` |" not in text]
    if missing:
        raise RuntimeError(f"no file of the examples has {', '.join(missing)}")
    return text


def _call(command: str) -> None:
    output = io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
        status = main(command.split())
    if status not in (0, 1):
        raise RuntimeError(f"rotor-mbs {command}: status {status}: {output.getvalue()}")


def _contents(path: Path, shown: dict[str, list[str]], attributes: set[str]) -> list[str]:
    """The groups of a file. shown: rows of the tables of the page, by their place, which are not
    repeated; attributes: receives the names of all attributes."""
    parts = []
    with h5py.File(path) as file:
        groups = ["/"]
        file.visititems(
            lambda name, item: groups.append(f"/{name}") if isinstance(item, h5py.Group) else None
        )
        for name in groups:
            group = file[name]
            datasets = [
                item
                for item in group.values()
                if isinstance(item, h5py.Dataset) and _is_shown(item)
            ]
            if not datasets and name != "/":
                continue
            rows = [
                [
                    code(Path(item.name).name),
                    ", ".join(
                        Path(dimension[0].name).name for dimension in item.dims if len(dimension)
                    )
                    or _own(item),
                    _kind(item),
                    _text(item.attrs.get("units", "")),
                    _text(item.attrs.get("long_name", "")) + _flags(item),
                ]
                for item in datasets
            ]
            attributes |= set(group.attrs)
            content = (
                table(["dataset", "dimensions", "type", "unit", "description"], rows)
                if rows
                else ""
            )
            lines = content.splitlines()
            if known := next(
                (place for place in shown if rows and set(lines) <= set(shown[place])), ""
            ):
                if name.startswith("/modes/"):  # another model
                    continue
                fewer = [line.split("|")[1].strip() for line in shown[known] if line not in lines]
                content = f"As {known}{', without ' if fewer else ''}{', '.join(fewer)}."
            place = f"`{name}` of {path.name}"
            shown[place] = lines
            names = [code(name) for name in group.attrs if name not in VERSIONED]
            names += ["versions of packages"] if len(names) < len(group.attrs) else []
            parts += [f"### {place}", f"Attributes: {', '.join(names)}.", content]
    return parts


def _is_shown(item: Any) -> bool:
    """Whether a dataset is listed: of the channels of a comparison the first one of each kind, no
    dimension alone."""
    name = Path(item.name).name
    is_channel = item.name.startswith("/comparison/")
    return name != "characters" and not (is_channel and re.search(r"_[2-9](_|$)|_[yz](_|$)", name))


def _attributes(used: set[str]) -> str:
    """The meaning of every attribute; raises RuntimeError where one has none, or none has it."""
    names = used - VERSIONED
    if names != set(_ATTRIBUTES):
        raise RuntimeError(
            f"attributes without a meaning, or without a file: {names ^ set(_ATTRIBUTES)}"
        )
    return table(
        ["attribute", "meaning"], ([code(name), meaning] for name, meaning in _ATTRIBUTES.items())
    )


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
        flags.append(
            f"codes {', '.join(map(str, item.attrs['flag_values']))}: "
            f"{_text(item.attrs['flag_meanings'])}"
        )
    if "labels" in item.attrs:
        flags.append(
            f"names in the attribute `labels`: {', '.join(map(_text, item.attrs['labels']))}"
        )
    return "".join(f"; {flag}" for flag in flags)


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
