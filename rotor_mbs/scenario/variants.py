"""From a row of a sweep's parameters to the scene they make of its base, validated by the scene file's own schema.

Knows nothing of how the rows come about. Importing this costs 0.2 s (pydantic).
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from pydantic import ValidationError

from rotor_mbs.scenario.faults import Fault, faults_of
from rotor_mbs.scenario.fields import Known
from rotor_mbs.scenario.keys import KeyFaultError, parse_key, put
from rotor_mbs.scenario.lines import KeyPath
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.schema import InitialTable, SceneTable

# Machines kept ready: more than a chunk of runs, or an axis of a usual map, has.
_MAX_MACHINES = 512


class VariantFaultError(ValueError):
    """Parameters that make no scene: one line per fault, without the file."""

    def __init__(self, faults: Sequence[str]) -> None:
        self.faults = tuple(faults)
        super().__init__("; ".join(faults))


@dataclass(frozen=True)
class _Machine:
    """All of a scene but its initial state, validated: that is checked against what `known` settled."""

    scene: Scene
    known: Known
    initial: Mapping[str, Any]


class Variants:
    """The scenes of a sweep: `tables` of the base, with a value put in at each of `keys`."""

    def __init__(self, name: str, tables: Mapping[str, Any], keys: Sequence[str]) -> None:
        self.keys = tuple(keys)
        self._name = name
        self._tables = tables
        paths = [parse_key(key) for key in keys]
        self._initial = [(i, path) for i, path in enumerate(paths) if path[0] == "initial"]
        self._machine_keys = [(i, path) for i, path in enumerate(paths) if path[0] != "initial"]
        self._machines: dict[tuple[float, ...], _Machine] = {}

    def scene(self, values: Sequence[float]) -> Scene:
        """The scene with `values`, one per key, in place. Raises VariantFaultError.

        Most sweeps vary the initial state of few machines: a machine is validated once, then its initial states are.
        """
        machine = self._machine(tuple(values[i] for i, _ in self._machine_keys), values)
        if not self._initial:
            return machine.scene
        initial = {"initial": {key: list(entries) for key, entries in machine.initial.items()}}
        try:
            _put_all(initial, [(path, values[i]) for i, path in self._initial])
            table = InitialTable.model_validate(initial["initial"], context=machine.known)
        except ValidationError:
            # Rare, and the words of its faults need the whole tables.
            return _validated(self._with(values), self._name)[0]
        return replace(machine.scene, initial_angles=tuple(table.angles), initial_rates=tuple(table.rates))

    def _machine(self, numbers: tuple[float, ...], values: Sequence[float]) -> _Machine:
        if numbers not in self._machines:
            if len(self._machines) >= _MAX_MACHINES:
                self._machines.clear()
            tables = self._with(values)
            scene, known = _validated(tables, self._name)
            self._machines[numbers] = _Machine(scene, known, tables["initial"])
        return self._machines[numbers]

    def _with(self, values: Sequence[float]) -> dict[str, Any]:
        tables = copy.deepcopy(dict(self._tables))
        _put_all(tables, [(path, values[i]) for i, path in (*self._machine_keys, *self._initial)])
        return tables


def _put_all(tables: dict[str, Any], entries: Sequence[tuple[KeyPath, float]]) -> None:
    for path, value in entries:
        try:
            put(tables, path, value)
        except KeyFaultError as fault:
            raise VariantFaultError([str(fault)]) from fault


def _validated(tables: dict[str, Any], name: str) -> tuple[Scene, Known]:
    known = Known()
    try:
        return SceneTable.model_validate(tables, context=known).to_scene(name, ""), known
    except ValidationError as error:
        found: list[Fault] = faults_of(error, tables)
        raise VariantFaultError([fault.text for fault in found]) from error
