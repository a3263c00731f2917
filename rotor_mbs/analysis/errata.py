"""The errata of the printed equations: each entry as checked by code, and what each erratum alone does to a scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rotor_mbs.methods.catalogue import errata_methods
from rotor_mbs.store.errata import read_errata
from rotor_mbs.store.read import Results, StoredScene


@dataclass(frozen=True)
class CheckedEntry:
    """A printed entry against its derivative. difference: largest relative; explained_by: "E1, E2" or ""."""

    equation: str
    entry: str
    printed: str
    right: str
    difference: float
    agrees: bool
    explained_by: str


@dataclass(frozen=True)
class Effect:
    """What one erratum does: largest angle change (rad) up to the horizon and over the whole run, energy gain (J)."""

    status: str
    angle_horizon: float | None
    angle_whole: float | None
    energy_gain: float | None


def entries(results: Results) -> list[CheckedEntry]:
    """Every checked entry in the order of the file; none where the file has no such group."""
    return [_entry(check) for check in read_errata(results)]


def effects(scene: StoredScene) -> dict[str, Effect]:
    """By erratum, for those whose run the file has."""
    found = {erratum: scene.methods.get(name) for erratum, name in errata_methods().items()}
    return {erratum: _effect(run.attributes) for erratum, run in found.items() if run is not None}


def _entry(attributes: Mapping[str, Any]) -> CheckedEntry:
    texts = {name: str(attributes.get(name, "")) for name in ("equation", "entry", "printed", "right", "explained_by")}
    difference = attributes.get("difference", 0.0)
    return CheckedEntry(**texts, difference=float(difference), agrees=bool(attributes.get("agrees", 0)))


def _effect(attributes: Mapping[str, Any]) -> Effect:
    def number(name: str) -> float | None:
        value = attributes.get(name)
        return float(value) if isinstance(value, float | int) else None

    return Effect(
        str(attributes.get("status", "")),
        number("angle_error_max"),
        number("angle_error_whole"),
        number("energy_gain_J"),
    )
