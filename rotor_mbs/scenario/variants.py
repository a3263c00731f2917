"""From a row of a sweep's parameters to the scene they make of its base, validated by the scene file's own schema.

Knows nothing of how the rows come about.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isfinite
from typing import Any

from rotor_mbs.scenario.keys import KeyFaultError, parse_key, put
from rotor_mbs.scenario.lines import KeyPath
from rotor_mbs.scenario.scene import Scene

# Machines kept ready: more than a chunk of runs, or an axis of a usual map, has.
_MAX_MACHINES = 512


class VariantFaultError(ValueError):
    """Parameters that make no scene: one line per fault, without the file.

    is_of_key   whether it is a key that is wrong, whatever its value
    """

    def __init__(self, faults: Sequence[str], *, is_of_key: bool = False) -> None:
        self.faults, self.is_of_key = tuple(faults), is_of_key
        super().__init__("; ".join(faults))


class Variants:
    """The scenes of a sweep: `tables` of the base, with a value put in at each of `keys`."""

    def __init__(self, name: str, tables: Mapping[str, Any], keys: Sequence[str]) -> None:
        self.keys = tuple(keys)
        self._name = name
        self._tables = tables
        paths = [parse_key(key) for key in keys]
        self._initial = [(i, path) for i, path in enumerate(paths) if path[0] == "initial"]
        self._machine_keys = [(i, path) for i, path in enumerate(paths) if path[0] != "initial"]
        self._machines: dict[tuple[float, ...], Scene] = {}

    def __getstate__(self) -> dict[str, Any]:
        """The one machine of all runs goes along, so that who gets it needs no validation, which is slow to load."""
        return self.__dict__ | {"_machines": {} if self._machine_keys else self._machines}

    def prepare(self, values: Sequence[float]) -> None:
        """Validates the machine of all runs, where there is but one; values: of any run. Raises VariantFaultError."""
        if not self._machine_keys:
            self._machine((), values)

    def scene(self, values: Sequence[float]) -> Scene:
        """The scene with `values`, one per key, in place. Raises VariantFaultError.

        Most sweeps vary the initial state of few machines: a machine is validated once, then initial states are put in.
        """
        machine = self._machine(tuple(values[i] for i, _ in self._machine_keys), values)
        if not self._initial:
            return machine
        state = {"angles": list(machine.initial_angles), "rates": list(machine.initial_rates)}
        for i, (_, name, column) in self._initial:  # the keys have led to a machine: they have this form
            state[str(name)][int(column)] = values[i]
        scene = replace(machine, initial_angles=tuple(state["angles"]), initial_rates=tuple(state["rates"]))
        return scene if _is_plain(scene) else self._validated(values)

    def _machine(self, numbers: tuple[float, ...], values: Sequence[float]) -> Scene:
        if numbers not in self._machines:
            if len(self._machines) >= _MAX_MACHINES:
                self._machines.clear()
            self._machines[numbers] = self._validated(values)
        return self._machines[numbers]

    def _validated(self, values: Sequence[float]) -> Scene:
        from pydantic import ValidationError  # late, with the schema: 0.15 s

        from rotor_mbs.scenario.faults import faults_of
        from rotor_mbs.scenario.fields import Known
        from rotor_mbs.scenario.schema import SceneTable

        tables = self._with(values)
        try:
            return SceneTable.model_validate(tables, context=Known()).to_scene(self._name, "")
        except ValidationError as error:
            unknown = {detail["type"] for detail in error.errors(include_url=False)} == {"extra_forbidden"}
            texts = [fault.text for fault in faults_of(error, tables)]
            raise VariantFaultError(texts, is_of_key=unknown) from error

    def _with(self, values: Sequence[float]) -> dict[str, Any]:
        tables = copy.deepcopy(dict(self._tables))
        _put_all(tables, [(path, values[i]) for i, path in (*self._machine_keys, *self._initial)])
        return tables


def _put_all(tables: dict[str, Any], entries: Sequence[tuple[KeyPath, float]]) -> None:
    for path, value in entries:
        try:
            put(tables, path, value)
        except KeyFaultError as fault:
            raise VariantFaultError([str(fault)], is_of_key=True) from fault


def _is_plain(scene: Scene) -> bool:
    """Whether the initial state is beyond doubt: finite, no rate where a pitch has no inertia. Else the schema decides,
    and has the words."""
    rates = zip(scene.initial_rates[1:], scene.blades, strict=True)
    finite = all(map(isfinite, (*scene.initial_angles, *scene.initial_rates)))
    return finite and not any(rate and not blade.has_pitch_inertia for rate, blade in rates)
