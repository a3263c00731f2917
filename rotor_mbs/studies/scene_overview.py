"""What there is to know of a scene before it is run: its data by key, and what each model would build for it."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

from rotor_mbs.errors import MethodRefusal
from rotor_mbs.methods.base import BuiltItem
from rotor_mbs.methods.catalogue import methods
from rotor_mbs.scenario.scene import Scene, scene_fields


def scene_data(scene: Scene) -> dict[str, object]:
    """Every key of the scene that is set, with its unit."""
    data: dict[str, object] = {}
    for item in scene_fields("label", "run", "start", "rotor"):
        value, unit = getattr(scene, item.name), item.metadata["unit"]
        if item.name == "blades":
            data["blades"] = len(value)
            alike = all(blade == value[0] for blade in value)
            for i, blade in enumerate(value[:1] if alike else value):
                numbers = {f"{part.name}, {part.metadata['unit']}": getattr(blade, part.name) for part in fields(blade)}
                data["every blade" if alike else f"blade {i + 1}"] = numbers
        elif item.metadata["key"] and item.name != "title" and (value not in ((), 0.0) or item.name == "gravity"):
            data[item.metadata["key"] if unit == "1" else f"{item.metadata['key']}, {unit}"] = value
    return data


@dataclass
class SceneModel:
    """What a model would build for the scene, or why it cannot."""

    name: str
    methods: list[str]
    items: list[BuiltItem] = field(default_factory=list)
    refused: str = ""
    is_linearized: bool = False

    @property
    def line(self) -> str:
        """ "lagrange/taylor, /ode45, ...", and what else there is to know."""
        first, *others = self.methods
        names = ", ".join([first, *(name.removeprefix(self.name) for name in others)])
        if self.refused:
            return f"{names}  (cannot represent this scene: {self.refused})"
        return names + ("  (linearized by `rotor-mbs modes`)" if self.is_linearized else "")


def models_of(scene: Scene) -> list[SceneModel]:
    """Every model, in the order of the catalogue."""
    models: dict[str, SceneModel] = {}
    for method in methods():
        known = models.setdefault(method.model, SceneModel(method.model, []))
        known.methods.append(method.name)
        known.is_linearized |= method.linearize is not None
        if known.items:
            continue
        try:
            known.items, known.refused = method.items(scene), ""
        except MethodRefusal as exc:
            known.refused = str(exc)
    return list(models.values())
