"""`list`, `show` and `new`: what is available, what each model builds for a scene, and a new scene file.

`list` reads no scene: what only the others need is imported by them.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from rotor_mbs.errors import InputError, MethodRefusal
from rotor_mbs.methods.base import Method
from rotor_mbs.methods.catalogue import look_up, methods
from rotor_mbs.scenario.catalogue import list_scenes, list_sweeps, only_scene


def list_all(arguments: argparse.Namespace) -> int:
    """Name and title of every shipped scene and sweep, name and label of every method."""
    scenes, sweeps = list_scenes(), list_sweeps()
    labels = [(method.name, method.label) for method in methods()]
    if arguments.json:
        kinds = {"scene": scenes, "sweep": sweeps, "method": labels}
        rows = [{"name": name, "title": title, "kind": kind} for kind in kinds for name, title in kinds[kind]]
        print(json.dumps(rows, ensure_ascii=False))
        return 0
    headings: dict[str, list[tuple[str, str]]] = {}
    for name, title in scenes:
        headings.setdefault(f"scenes: {name.partition('/')[0]}", []).append((name, title))
    headings |= {"sweeps": sweeps, "methods": labels}
    width = max(len(name) for entries in headings.values() for name, _ in entries)
    for heading, entries in headings.items():
        print(heading, *(f"  {name:{width}}  {title}" for name, title in entries), "", sep="\n")
    print("next: rotor-mbs show NAME; rotor-mbs run SCENE [-m METHOD]; rotor-mbs sweep SWEEP; rotor-mbs new FILE.toml")
    return 0


def new(arguments: argparse.Namespace) -> int:
    """A commented scene file; never in the place of another file."""
    from rotor_mbs.scenario.scene import new_scene_text

    if arguments.file.suffix != ".toml":
        raise InputError(f"{arguments.file}: is not a TOML file's name; allowed: a name that ends in .toml")
    try:
        with arguments.file.open("x", encoding="utf-8") as file:
            file.write(new_scene_text())
    except OSError as exc:
        raise InputError(
            f"{arguments.file}: cannot be created: {exc.strerror}; allowed: a file that does not exist yet"
        ) from exc
    print(f"{arguments.file}: edit it, then: rotor-mbs run {arguments.file}")
    return 0


def show(arguments: argparse.Namespace) -> int:
    """One scene's data and the methods of each model, with --build its items; or the settings of a method."""
    method = look_up(arguments.scene)
    if method is None:
        _show_scene(arguments)
    else:
        _show_method(method, arguments)
    return 0


def _show_method(method: Method, arguments: argparse.Namespace) -> None:
    allowed, defaults = method.settings.allowed(), method.defaults
    if arguments.json:
        rules = {name: {"allowed": str(rule), "doc": rule.doc} for name, rule in allowed.items()}
        facts = {"name": method.name, "label": method.label, "settings": defaults, "allowed": rules}
        print(json.dumps(facts, ensure_ascii=False, indent=1))
        return
    print(f"{method.name}: {method.label}\n")
    for name, rule in allowed.items():
        print(f"  {name:26} {defaults[name]!s:>16}  {rule}; {rule.doc}".rstrip("; "))
    print(f"\nset one: rotor-mbs run SCENE -m {method.name} --set NAME=VALUE" if allowed else "no settings")


def _show_scene(arguments: argparse.Namespace) -> None:
    from rotor_mbs.cli.terminal import print_doubts
    from rotor_mbs.scenario.scene import scene_tables, unit_of

    scene = only_scene(arguments.scene)
    models: dict[str, dict[str, Any]] = {}
    for method in methods():
        facts = {"name": method.model, "methods": [], "items": [], "refused": "", "is_linearized": False}
        model = models.setdefault(method.model, facts)
        model["methods"].append(method.name)
        model["is_linearized"] |= method.linearize is not None
        if not model["items"]:
            try:
                model["items"], model["refused"] = list(map(asdict, method.items(scene))), ""
            except MethodRefusal as exc:
                model["refused"] = str(exc)
    tables = scene_tables(scene)
    if arguments.json:
        print(json.dumps({"name": scene.name, "scene": tables, "models": models}, ensure_ascii=False, indent=1))
        return
    print_doubts([scene])
    print(f"{scene.name}\n")
    for path, value in _keys(tables):
        name = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)[1:]
        unit = "" if unit_of(path) == "1" else f", {unit_of(path)}"
        print(f"  {name + unit:28} {value}")
    print("\nmethods" + (", and the items that each model builds" if arguments.build else ""))
    for name, model in models.items():
        first, *others = model["methods"]
        line = ", ".join([first, *(other.removeprefix(name) for other in others)])  # "lagrange/taylor, /ode45, ..."
        if model["refused"]:
            line += f"  (not available: {model['refused']})"
        elif model["is_linearized"]:
            line += "  (linearized by `rotor-mbs modes`)"
        print(f"  {line}")
        for item in model["items"] if arguments.build else ():
            print(f"    {item['kind']:9} {item['name']:28} {item['detail']}".rstrip())


def _keys(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[tuple[str | int, ...], Any]]:
    """The path and the value of each key of a scene file."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _keys(inner, (*path, name))
    elif isinstance(value, list) and value and isinstance(value[0], dict):  # a table per blade
        for place, inner in enumerate(value):
            yield from _keys(inner, (*path, place))
    else:
        yield path, value
