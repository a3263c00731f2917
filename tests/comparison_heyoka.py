"""heyoka's own integrator, one run after the other: states at the samples, nothing derived, judged or kept.

    python comparison_heyoka.py SCENES

SCENES: pickled scenes of one machine. Prints the seconds of the loop alone.
"""

import pickle
import sys
import time
from pathlib import Path

import numpy as np

from rotor_mbs.models.lagrange.heyoka_adapter import array_of, heyoka
from rotor_mbs.models.lagrange.system import build_system


def loop(path: Path) -> float:
    scenes = pickle.loads(path.read_bytes())
    system = build_system(scenes[0])
    initial = np.array([[*scene.initial_angles, *scene.initial_rates] for scene in scenes])
    integrator = heyoka().taylor_adaptive(system.equations, state=initial[0], tol=1e-15, high_accuracy=True)
    integrator.pars[:] = array_of(system.parameters.values, quad=False)[: len(integrator.pars)]
    grid = np.linspace(0.0, scenes[0].duration, scenes[0].samples)
    start = time.perf_counter()
    for state in initial:
        integrator.time = 0.0
        integrator.state[:] = state
        integrator.propagate_grid(grid)
    return time.perf_counter() - start


if __name__ == "__main__":
    print(loop(Path(sys.argv[1])))
