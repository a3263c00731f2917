"""Shipped scenes, their frozen references, and runs of them; each read once."""

from __future__ import annotations

import functools

import pytest

from rotor_mbs.methods.solve import solve
from rotor_mbs.runs.read import open_results
from rotor_mbs.scenario.catalogue import find_scenes, reference_folder
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Solution, Trajectory
from rotor_mbs.studies.stored_references import rebuilt_reference

TAYLOR = "lagrange/taylor"


@functools.cache
def scene(name: str) -> Scene:
    return find_scenes([name])[0]


@functools.cache
def reference(name: str) -> Trajectory:
    with open_results(reference_folder() / f"{name.split('/')[0]}.h5") as results:
        stored = results.scenes[name].reference
        assert stored is not None
        arrays = {array: stored.array(array) for array in stored.names}
        return rebuilt_reference(scene(name), arrays)


def run(one: Scene, method: str = TAYLOR, **settings: object) -> Solution:
    if method == TAYLOR:
        pytest.importorskip("heyoka")
    return solve(method, one, settings)
