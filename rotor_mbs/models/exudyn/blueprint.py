"""What a model consists of, as plain data, from which it is listed, counted and built in the engine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from rotor_mbs.methods.base import BuiltItem

# Arguments that are lists in the engine's own types, and these types.
LISTS = {
    "jointTransformations": "Matrix3DList",
    "linkInertiasCOM": "Matrix3DList",
    "jointOffsets": "Vector3DList",
    "linkCOMs": "Vector3DList",
}


@dataclass(frozen=True)
class Ref:
    """The number the engine gave to another part, by kind and name."""

    kind: str
    name: str


@dataclass(frozen=True)
class Part:
    """One item: `type` is the engine's name of it, `parameters` its arguments, with Ref where they name other parts."""

    kind: str
    name: str
    type: str
    parameters: Mapping[str, object] = field(default_factory=dict)
    detail: str = ""


def sensor(name: str, type_: str, quantity: str, detail: str = "", **where: object) -> Part:
    """A sensor that keeps `quantity` (the engine's name of an output) in memory."""
    stored = {"outputVariableType": quantity, "storeInternal": True, "writeToFile": False, **where}
    return Part("sensor", name, type_, stored, detail or quantity)


def items(parts: Sequence[Part]) -> list[BuiltItem]:
    return [
        BuiltItem(part.kind, part.name, f"{part.type}: {part.detail}" if part.detail else part.type) for part in parts
    ]
