"""The scenes of a sweep: a base scene with other numbers at some keys."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from rotor_mbs.scenario.keys import MAX_NUMBER
from rotor_mbs.scenario.scene import Scene, copied, put_value, scene_fields, scene_from_tables
from rotor_mbs.scenario.toml_file import KeyPath, parse_key

# Field by table and name of the key.
_START = {tuple(field.metadata["key"].split(".")): field.name for field in scene_fields("start")}

# Rotors that are kept validated: more than a chunk of runs, or an axis of a usual map, has.
MAX_ROTORS = 512


class Variants:
    """The scenes of a sweep: `tables` of the base, with a number put in at each of `keys`. A scene is read for each
    rotor, of which most sweeps have few, then initial states are put in."""

    def __init__(self, name: str, tables: dict[str, Any], keys: Sequence[str]) -> None:
        self.keys = tuple(keys)
        self._name = name
        self._tables = tables
        self._paths = [parse_key(key) for key in keys]
        self._rotors: dict[tuple[float, ...], Scene] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Once a scene was made, a rotor common to all runs is pickled, too: the receiver need not read it."""
        return self.__dict__ | {"_rotors": self._rotors if all(map(_is_of_start, self._paths)) else {}}

    def scene(self, values: Sequence[float]) -> Scene:
        pairs = list(zip(self._paths, values, strict=True))
        rotor_numbers = tuple(value for path, value in pairs if not _is_of_start(path))
        if rotor_numbers not in self._rotors:
            if len(self._rotors) >= MAX_ROTORS:
                self._rotors.clear()
            self._rotors[rotor_numbers] = self._read(values)
        rotor = self._rotors[rotor_numbers]
        start = {name: list(getattr(rotor, name)) for name in _START.values()}
        for path, value in pairs:
            if _is_of_start(path):  # the rotor was read with these keys: each ends in a valid index
                start[_START[path[:2]]][int(path[2])] = value
        changes: dict[str, Any] = {name: tuple(numbers) for name, numbers in start.items()}
        scene = dataclasses.replace(rotor, **changes)
        rates = zip(scene.initial_rates[1:], scene.blades, strict=True)
        if any(rate and not blade.has_pitch_inertia for rate, blade in rates) or not all(
            abs(number) <= MAX_NUMBER for number in (*scene.initial_angles, *scene.initial_rates)
        ):
            return self._read(values)  # which raises the error that says so
        return scene

    def _read(self, values: Sequence[float]) -> Scene:
        tables = copied(self._tables)
        for path, value in zip(self._paths, values, strict=True):
            put_value(tables, path, value)
        return scene_from_tables(tables, self._name)


def _is_of_start(path: KeyPath) -> bool:
    return path[:2] in _START
