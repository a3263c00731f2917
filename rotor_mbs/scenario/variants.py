"""Scenes that differ from a base in the numbers at some keys, validated by the scene file's own schema.

A key is written as a path, `initial.angles[1]`. Entries are counted from 0, as the coordinates of a results file are:
`initial.angles[1]` is the pitch of blade 1. Must not know how a sweep's rows come about.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from math import isfinite
from typing import Any

from rotor_mbs.errors import InputError
from rotor_mbs.scenario.scene import Blade, Scene, scene_fields
from rotor_mbs.scenario.scene_file import scene_tables, scene_toml, validated_scene
from rotor_mbs.scenario.time_table import is_one_table
from rotor_mbs.scenario.toml_file import KeyPath, KeyProblem, TableError, shown_key

KEY_FORM = "the path of a number, such as gravity, blade.mass, initial.angles[1] (entries counted from 0)"
_PART = r"[A-Za-z_][A-Za-z0-9_]{0,59}(?:\[[0-9]{1,6}\])*"
_KEY = re.compile(rf"{_PART}(?:\.{_PART})*")
_UNITS: dict[str, str] = {one.metadata["key"]: one.metadata["unit"] for one in fields(Scene)} | {
    f"blade.{one.name}": one.metadata["unit"] for one in fields(Blade)
}
_PER_BLADE = frozenset(one.metadata["key"] for one in fields(Scene) if one.metadata["per_blade"])
_OVER_TIME = frozenset(one.metadata["key"] for one in fields(Scene) if one.metadata["over_time"])
_START = {one.metadata["key"]: one.name for one in scene_fields("start")}

# Rotors that are kept validated: more than a chunk of runs, or an axis of a usual map, has.
_MAX_ROTORS = 512


def is_key(text: str) -> bool:
    """Whether it has the form of a key's path."""
    return _KEY.fullmatch(text) is not None


def parse_key(text: str) -> KeyPath:
    """("initial", "angles", 1) of "initial.angles[1]". Raises TableError."""
    if not is_key(text):
        raise _wrong((), f"{text[:60]!a} is not the path of a key; allowed: {KEY_FORM}")
    return tuple(int(part) if part.isdigit() else part for part in re.findall(r"[A-Za-z_]\w*|[0-9]+", text))


def unit_of(path: KeyPath) -> str:
    """The unit of the number at `path`, "1" where it has none."""
    name = _names(path)
    if name in _OVER_TIME and len(path) == (5 if name in _PER_BLADE else 4) and path[-1] == 0:  # the time of a row
        return "s"
    return _UNITS.get(name, "1")


def put_value(tables: dict[str, Any], path: KeyPath, value: object) -> None:
    """Sets the value at `path` in the tables of a scene; tables that are missing are made, keys are not checked.

    One [blade] for all, or one number or table for every bearing, becomes one for each where the path names one.
    Raises TableError where the path goes through something that has no such entry.
    """
    here: Any = tables
    for depth, part in enumerate(path[:-1]):
        _check_step(here, path, depth)
        inner = here.get(part) if isinstance(part, str) else here[part]
        following = path[depth + 1]
        if isinstance(following, int):
            inner = _as_list(tables, inner, path[: depth + 1], following)
        here[part] = {} if inner is None else inner
        here = here[part]
    _check_step(here, path, len(path) - 1)
    here[path[-1]] = value


def _as_list(tables: Mapping[str, Any], value: Any, path: KeyPath, last: int) -> Any:
    """What stands at `path`, as one entry per blade where the scene file allows one for all."""
    blades = tables.get("blades", 0)
    if path == ("blade",) and isinstance(value, dict):
        return [copy.deepcopy(value) for _ in range(blades)]
    is_for_all = not isinstance(value, list) or is_one_table(value)
    if isinstance(path[-1], str) and _names(path) in _PER_BLADE and is_for_all:
        return [copy.deepcopy(0.0 if value is None else value) for _ in range(blades)]
    # Whether a list that is missing could be there is for the schema to say.
    return [0.0] * (last + 1) if value is None else value


def _check_step(here: Any, path: KeyPath, depth: int) -> None:
    """Raises TableError unless `here` is of the kind that path[depth] needs."""
    part, shown = path[depth], shown_key(path[:depth])
    if isinstance(part, str) and isinstance(here, dict):
        return
    if not isinstance(here, list):
        kind = "a table" if isinstance(here, dict) else "a single value"
        raise _wrong(path, f"{shown} is {kind}; allowed: {KEY_FORM}")
    if isinstance(part, str) or part >= len(here):
        raise _wrong(path, f"{shown} has {len(here)} entries; allowed: {shown}[0] to {shown}[{len(here) - 1}]")


def _wrong(path: KeyPath, message: str) -> TableError:
    return TableError([KeyProblem(path, message, is_of_key=True)])


def _names(path: KeyPath) -> str:
    return ".".join(part for part in path if isinstance(part, str))


def replaced_scene(scene: Scene, changes: Mapping[str, object]) -> Scene:
    """`scene` with other values at some keys, as `Scene.replace` describes it."""
    tables = scene_tables(scene)
    try:
        for key, value in changes.items():
            put_value(tables, parse_key(key), _plain(value))
        changed = validated_scene(tables, scene.name)
    except TableError as error:
        raise InputError(f"{scene.name}: {problem.message}" for problem in error.problems) from error
    return replace(changed, text=scene_toml(changed))


def _plain(value: object) -> object:
    """Tuples and NumPy values as the lists and numbers of a TOML file."""
    if isinstance(value, tuple | list):
        return [_plain(entry) for entry in value]
    return value.tolist() if hasattr(value, "tolist") else value


class Variants:
    """The scenes of a sweep: `tables` of the base, with a number put in at each of `keys`.

    Most sweeps vary the initial state of few rotors: a rotor is validated once, then initial states are put in.
    """

    def __init__(self, name: str, tables: Mapping[str, Any], keys: Sequence[str]) -> None:
        self.keys = tuple(keys)
        self._name = name
        self._tables = tables
        paths = [parse_key(key) for key in keys]
        self._start = [(i, path) for i, path in enumerate(paths) if _names(path) in _START]
        self._rest = [(i, path) for i, path in enumerate(paths) if _names(path) not in _START]
        self._rotors: dict[tuple[float, ...], Scene] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Once a scene was made, a rotor common to all runs is pickled, too: the receiver need not validate it."""
        return self.__dict__ | {"_rotors": {} if self._rest else self._rotors}

    def scene(self, values: Sequence[float]) -> Scene:
        """The scene with `values`, one per key, in place. Raises TableError."""
        numbers = tuple(values[i] for i, _ in self._rest)
        if numbers not in self._rotors:
            if len(self._rotors) >= _MAX_ROTORS:
                self._rotors.clear()
            self._rotors[numbers] = self._validated(values)
        rotor = self._rotors[numbers]
        if not self._start:
            return rotor
        state: dict[str, Any] = {name: list(getattr(rotor, name)) for name in _START.values()}
        for i, path in self._start:  # the rotor has been validated with these keys: each ends in a valid index
            state[_START[_names(path)]][int(path[-1])] = values[i]
        state = {name: tuple(numbers) for name, numbers in state.items()}
        scene = replace(rotor, **state)
        return scene if _is_plain(scene) else self._validated(values)

    def _validated(self, values: Sequence[float]) -> Scene:
        tables = copy.deepcopy(dict(self._tables))
        for i, path in (*self._rest, *self._start):
            put_value(tables, path, values[i])
        return validated_scene(tables, self._name)


def _is_plain(scene: Scene) -> bool:
    """Whether the initial state needs no validation: finite, no rate where a pitch has no inertia."""
    rates = zip(scene.initial_rates[1:], scene.blades, strict=True)
    finite = all(map(isfinite, (*scene.initial_angles, *scene.initial_rates)))
    return finite and not any(rate and not blade.has_pitch_inertia for rate, blade in rates)
