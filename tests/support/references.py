"""Frozen references of shipped scenes, each file read once."""

from __future__ import annotations

import functools

from rotor_mbs.runs.read import open_results
from rotor_mbs.scenario.catalogue import REFERENCES
from rotor_mbs.solution.trajectory import Array, Trajectory
from rotor_mbs.studies.stored_references import rebuilt_reference
from support.scenes import shipped


@functools.cache
def _arrays(group: str) -> dict[str, dict[str, Array]]:
    """Of every reference in a file: to open and verify it takes a second, to read all of it no
    more."""
    with open_results(REFERENCES / f"{group}.h5") as results:
        runs = {name: stored.reference for name, stored in results.scenes.items()}
        return {
            name: {array: run.array(array) for array in run.names}
            for name, run in runs.items()
            if run
        }


def referenced(group: str) -> list[str]:
    """Return the scenes of a group that have a reference."""
    return list(_arrays(group))


@functools.cache
def reference(name: str) -> Trajectory:
    return rebuilt_reference(shipped(name), _arrays(name.split("/")[0])[name])
