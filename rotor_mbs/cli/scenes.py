"""`list`, `show` and `new`: what there is, what each model would build for a scene, and a file for one of your own."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from typing import TYPE_CHECKING

from rotor_mbs.errors import InputError
from rotor_mbs.scenario.catalogue import find_scenes, list_scenes, list_sweeps

if TYPE_CHECKING:
    from rotor_mbs.methods.base import Method


def list_all(arguments: argparse.Namespace) -> int:
    """Name and title of every shipped scene and sweep, name and label of every method."""
    from rotor_mbs.methods.catalogue import methods

    found: dict[str, list[tuple[str, str]]] = {}
    for name, title in list_scenes():
        found.setdefault(f"scenes: {name.partition('/')[0]}", []).append((name, title))
    found["sweeps"] = list_sweeps()
    found["methods"] = [(method.name, method.label) for method in methods()]
    if arguments.json:
        rows = [
            {"name": name, "title": title, "kind": heading.partition(":")[0].removesuffix("s")}
            for heading, entries in found.items()
            for name, title in entries
        ]
        print(json.dumps(rows, ensure_ascii=False))
        return 0
    width = max(len(name) for entries in found.values() for name, _ in entries)
    for heading, entries in found.items():
        print(heading, *(f"  {name:{width}}  {title}" for name, title in entries), "", sep="\n")
    print("next: rotor-mbs show NAME; rotor-mbs run SCENE [-m METHOD]; rotor-mbs sweep SWEEP; rotor-mbs new FILE.toml")
    return 0


def new(arguments: argparse.Namespace) -> int:
    """A commented scene file; never in the place of another file."""
    from rotor_mbs.scenario.scene_file import new_scene_text

    if arguments.file.suffix != ".toml":
        raise InputError(f"{arguments.file}: is not a TOML file's name; allowed: a name that ends in .toml")
    try:
        with arguments.file.open("x", encoding="utf-8") as file:
            file.write(new_scene_text())
    except OSError as exc:
        raise InputError(
            f"{arguments.file}: cannot be created: {exc.strerror}; allowed: a file that is not there yet"
        ) from exc
    print(f"{arguments.file}: edit it, then: rotor-mbs run {arguments.file}")
    return 0


def show(arguments: argparse.Namespace) -> int:
    """One scene's data and the methods of each model, with --build its items; or the settings of a method."""
    from rotor_mbs.cli.terminal import print_doubts
    from rotor_mbs.methods.catalogue import look_up
    from rotor_mbs.studies.scene_overview import models_of, scene_data

    method = look_up(arguments.scene)
    if method is not None:
        if arguments.json:
            allowed = {name: {"allowed": str(one), "doc": one.doc} for name, one in method.settings.allowed().items()}
            facts = {"name": method.name, "label": method.label, "settings": method.defaults, "allowed": allowed}
            print(json.dumps(facts, ensure_ascii=False, indent=1))
        else:
            print(f"{method.name}: {method.label}\n", *_settings_lines(method), sep="\n")
        return 0
    found = find_scenes([arguments.scene])
    if len(found) != 1:
        raise InputError(f"{arguments.scene}: {len(found)} scenes; allowed: one scene's name or file")
    scene = found[0]
    models = models_of(scene)
    if arguments.json:
        built = {model.name: asdict(model) for model in models}
        print(
            json.dumps({"name": scene.name, "scene": scene_data(scene), "models": built}, ensure_ascii=False, indent=1)
        )
        return 0
    print_doubts(found)
    print(f"{scene.name}: {scene.title}\n")
    for key, value in scene_data(scene).items():
        if isinstance(value, dict):
            print(f"  {key}", *(f"    {part:24} {_readable(number)}" for part, number in value.items()), sep="\n")
        else:
            print(f"  {key:26} {_readable(value)}")
    print("\nmethods" + (", and the items that each model builds" if arguments.build else ""))
    for model in models:
        print(f"  {model.line}")
        for item in model.items if arguments.build else ():
            print(f"    {item.kind:9} {item.name:28} {item.detail}".rstrip())
    return 0


def _settings_lines(method: Method) -> list[str]:
    """A line for each setting: name, default, what is allowed, what it does."""
    allowed, defaults = method.settings.allowed(), method.defaults
    lines = [f"  {name:26} {defaults[name]!s:>16}  {one}; {one.doc}".rstrip("; ") for name, one in allowed.items()]
    return [*lines, "", f"set one: rotor-mbs run SCENE -m {method.name} --set NAME=VALUE"] if lines else ["no settings"]


def _readable(value: object) -> str:
    if isinstance(value, dict):
        return "; ".join(f"{key} {_readable(part)}" for key, part in value.items())
    if isinstance(value, tuple):
        return ", ".join(f"[{_readable(part)}]" if isinstance(part, tuple) else _readable(part) for part in value)
    return f"{value:.10g}" if isinstance(value, float) else str(value)
