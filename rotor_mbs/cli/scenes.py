"""`list`, `show` and `new`: the scenes, what each model would build for one, and a file for one of your own."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING

from rotor_mbs.errors import InputError, MethodRefusal
from rotor_mbs.scenario.catalogue import find_scenes, list_scenes
from rotor_mbs.scenario.scene import Scene

if TYPE_CHECKING:  # numpy behind it is too heavy for `list`
    from rotor_mbs.solution.record import Item


def list_all(arguments: argparse.Namespace) -> int:
    """Name and title of every shipped scene."""
    scenes = list_scenes()
    if arguments.json:
        print(json.dumps([{"name": name, "title": title} for name, title in scenes], ensure_ascii=False))
        return 0
    width = max((len(name) for name, _ in scenes), default=0)
    for name, title in scenes:
        print(f"{name:{width}}  {title}")
    return 0


def new(arguments: argparse.Namespace) -> int:
    """A commented scene file; never in the place of another file."""
    from rotor_mbs.scenario.scene_file import new_scene_text

    try:
        with arguments.file.open("x", encoding="utf-8") as file:
            file.write(new_scene_text())
    except OSError as exc:
        raise InputError(f"{arguments.file}: cannot be created: {exc.strerror}") from exc
    print(f"{arguments.file}: edit it, then: rotor-mbs run {arguments.file}")
    return 0


def show(arguments: argparse.Namespace) -> int:
    """One scene's data and the methods of each model; with --build its items."""
    found = find_scenes([arguments.scene])
    if len(found) != 1:
        raise InputError(f"{arguments.scene}: {len(found)} scenes; allowed: one scene's name or file")
    scene = found[0]
    models = _models(scene)
    if arguments.json:
        built = {model.name: asdict(model) for model in models}
        print(json.dumps({"name": scene.name, "scene": _data(scene), "models": built}, ensure_ascii=False, indent=1))
        return 0
    print(f"{scene.name}: {scene.title}\n")
    for key, value in _data(scene).items():
        print(f"  {key:20} {_readable(value)}")
    for model in models:
        print(f"\n{model.name}  ({', '.join(model.methods)})")
        if model.refused:
            print(f"  cannot represent this scene: {model.refused}")
        for item in model.items if arguments.build else ():
            print(f"  {item.kind:9} {item.name:28} {item.detail}".rstrip())
    return 0


def _data(scene: Scene) -> dict[str, object]:
    first = scene.blades[0]
    same = all(blade == first for blade in scene.blades)
    blades = [first] if same else list(scene.blades)
    data: dict[str, object] = {
        "figures": list(scene.figures),
        "blades": len(scene.blades),
        "gravity, m/s^2": scene.gravity,
        "duration, s": scene.duration,
        "samples": scene.samples,
        "outputs": list(scene.outputs),
        "angles, rad": list(scene.initial_angles),
        "rates, rad/s": list(scene.initial_rates),
        "hub inertia, kg m^2": scene.hub_inertia,
        "torque, N m": [list(row) for row in scene.rotor_torque],
        "stiffness, N m/rad": list(scene.bearing_stiffness),
        "damping, N m s/rad": list(scene.bearing_damping),
        "shaft, N m s/rad": scene.shaft_damping,
    }
    for i, blade in enumerate(blades):
        which = "every blade" if same else f"blade {i + 1}"
        data[which] = {
            "mass, kg": blade.mass,
            "centre of mass, m": list(blade.centre_of_mass),
            "inertia, kg m^2": list(blade.inertia),
            "tip, m": list(blade.tip),
        }
    return {key: value for key, value in data.items() if value not in ([], 0.0) or key == "gravity, m/s^2"}


def _readable(value: object) -> str:
    if isinstance(value, dict):
        return "; ".join(f"{key} {_readable(part)}" for key, part in value.items())
    if isinstance(value, list):
        return ", ".join(f"[{_readable(part)}]" if isinstance(part, list) else _readable(part) for part in value)
    return f"{value:.10g}" if isinstance(value, float) else str(value)


@dataclass
class _Model:
    """What a model would build for the scene, or why it cannot."""

    name: str
    methods: list[str]
    items: list[Item] = field(default_factory=list)
    refused: str = ""


def _models(scene: Scene) -> list[_Model]:
    from rotor_mbs.methods.catalogue import methods

    models: dict[str, _Model] = {}
    for method in methods():
        known = models.setdefault(method.model, _Model(method.model, []))
        known.methods.append(method.name)
        if known.items:
            continue
        try:
            known.items, known.refused = method.items(scene), ""
        except MethodRefusal as exc:
            known.refused = str(exc)
    return list(models.values())
