"""Runs that must succeed, to the last sample."""

from __future__ import annotations

import numpy as np
import pytest

from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.solve import solve
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Trajectory


def run(method: str, scene: Scene, **settings: object) -> Trajectory:
    """The test is skipped where the method's engine is not installed."""
    if not find_method(method).is_installed:
        pytest.skip(f"{method} is not installed")
    solution = solve(method, scene, settings)
    assert solution.integration.success, solution.integration.message
    assert len(solution.trajectory.time) == scene.samples
    return solution.trajectory


def energy_error(run: Trajectory) -> float:
    """J: largest change of the energies less the work."""
    total = run.kinetic_energy + run.potential_energy - run.work
    return float(np.abs(total - total[0]).max())
