"""heyoka's own integrator, one run after the other: states at the samples, nothing derived, judged or kept.

    python comparison_heyoka.py SCENES [written]

SCENES: pickled scenes of one machine, point-mass blades at (c, 0, d) on a massless hub; nothing but gravity acts.
Prints the seconds of the loop alone. The equations are those of the models, or, for "written", as one writes them down.
"""

import math
import pickle
import sys
import time
from pathlib import Path
from typing import Any

import heyoka as hy
import numpy as np

from rotor_mbs.models.lagrange.heyoka_adapter import array_of
from rotor_mbs.models.lagrange.taylor import build_system
from rotor_mbs.scenario.scene import Scene


def written(scene: Scene) -> list[tuple[Any, Any]]:
    """The arrowhead solved by hand, the azimuths' sines by sums of angles, which is the faster way."""
    blades = len(scene.blades)
    c, _, d = scene.blades[0].centre_of_mass
    g = scene.gravity
    q = hy.make_vars(*[f"q{i}" for i in range(1 + blades)])
    w = hy.make_vars(*[f"w{i}" for i in range(1 + blades)])
    sin_q, cos_q, spin = hy.sin(q[0]), hy.cos(q[0]), w[0]
    schur: Any = 0.0
    moment: Any = 0.0
    alone = []
    for i, phase in enumerate(scene.phases):
        s, cos, rate = hy.sin(q[1 + i]), hy.cos(q[1 + i]), w[1 + i]
        sin_phi = sin_q * math.cos(phase) + cos_q * math.sin(phase)
        cos_phi = cos_q * math.cos(phase) - sin_q * math.sin(phase)
        pitch = -s * cos * spin * spin - g / c * s * sin_phi
        schur += (c * c + d * d) * cos * cos
        moment += 2.0 * c * c * s * cos * spin * rate + c * d * cos * rate * rate
        moment += g * (d * sin_phi + c * cos * cos_phi) + c * d * s * pitch
        alone.append((s, pitch))
    rotor = moment / schur
    pitches = [pitch + d / c * s * rotor for s, pitch in alone]
    return [*zip(q, w, strict=True), *zip(w, [rotor, *pitches], strict=True)]


def loop(scenes: list[Scene], *, as_written: bool) -> float:
    initial = np.array([[*scene.initial_angles, *scene.initial_rates] for scene in scenes])
    if as_written:
        integrator = hy.taylor_adaptive(written(scenes[0]), state=initial[0], tol=1e-15)
    else:
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
    print(loop(pickle.loads(Path(sys.argv[1]).read_bytes()), as_written="written" in sys.argv[2:]))
