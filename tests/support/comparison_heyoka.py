"""heyoka's own integrator, one run after the other: states at the samples, nothing derived, judged or kept.

    python comparison_heyoka.py SCENES

SCENES: pickled scenes of one machine, which differ by their starts. Prints the seconds of the loop alone.
"""

import pickle
import sys
import time
from pathlib import Path

import heyoka as hy
import numpy as np

from rotor_mbs.models.lagrange.heyoka_adapter import array_of
from rotor_mbs.models.lagrange.taylor import build_system
from rotor_mbs.scenario.scene import Scene


def loop(scenes: list[Scene]) -> float:
    initial = np.array([[*scene.initial_angles, *scene.initial_rates] for scene in scenes])
    equations, parameters = build_system(scenes[0])
    integrator = hy.taylor_adaptive(equations, state=initial[0], tol=1e-15, high_accuracy=True)
    integrator.pars[:] = array_of(parameters.values, quad=False)[: len(integrator.pars)]
    grid = np.linspace(0.0, scenes[0].duration, scenes[0].samples)
    start = time.perf_counter()
    for state in initial:
        integrator.time = 0.0
        integrator.state[:] = state
        integrator.propagate_grid(grid)
    return time.perf_counter() - start


if __name__ == "__main__":
    print(loop(pickle.loads(Path(sys.argv[1]).read_bytes())))
