"""Runs of the Exudyn methods that must succeed."""

from __future__ import annotations

import numpy as np

from rotor_mbs.methods.solve import solve
from rotor_mbs.models.exudyn import methods

METHODS = {method.name: method for method in methods.METHODS}
TREE = [name for name in METHODS if name.startswith("exudyn_tree")]
CHAIN = [name for name in METHODS if name.startswith("exudyn_chain")]
EXPLICIT = TREE[:3]
KINDS = ("node", "object", "marker", "load", "sensor")


def run(name, scene, **settings):
    result = solve(name, scene, settings)
    assert result.integration.success, result.integration.message
    assert len(result.trajectory.time) == scene.samples
    return result.trajectory


def engine_counts(solver):
    """How many nodes, objects, markers, loads and sensors the engine holds."""
    data = solver.system._mbs.systemData
    return {kind: getattr(data, f"NumberOf{kind.capitalize()}s")() for kind in KINDS}


def energy_error(trajectory):
    total = trajectory.kinetic_energy + trajectory.potential_energy - trajectory.work
    return np.abs(total - total[0]).max()
