"""Errors and processor time of the chain's methods on the paper's scenes, in turn: the table of docs/bench.md.

python -m support.chain_accuracy [ROUNDS], in the folder tests

Errors in rad, up to the horizon and over the whole length; time in s, the least of the rounds.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.solution.metrics import horizon_samples
from support.references import reference

VARIANTS: dict[str, tuple[str, dict[str, float]]] = {
    "generalized-alpha": ("exudyn_chain/generalized_alpha", {}),
    "extrapolated": ("exudyn_chain/extrapolated", {}),
    "extrapolated, 1e-10": ("exudyn_chain/extrapolated", {"tolerance": 1e-10}),
}


def main(rounds: int) -> None:
    total = dict.fromkeys(VARIANTS, 0.0)
    for scene in find_scenes(["paper"]):
        exact = reference(scene.name)
        horizon = horizon_samples(exact)
        line = f"{scene.name} up to {exact.time[horizon - 1]:.2f} s"
        solvers = {}
        for variant, (name, settings) in VARIANTS.items():
            method = find_method(name)
            solvers[variant] = method.build(scene, method.settings.of(name, settings))
        times: dict[str, list[float]] = {variant: [] for variant in VARIANTS}
        for _ in range(rounds):
            for variant, solver in solvers.items():
                start = time.process_time()
                solver.integrate()
                times[variant].append(time.process_time() - start)
        for variant, solver in solvers.items():
            angles = solver.observe().angles
            error = np.abs(angles - exact.angles[: len(angles)]).max(axis=1)
            total[variant] += min(times[variant])
            line += f" | {variant}: {error[:horizon].max():.1e} {error.max():.1e} {min(times[variant]):.2f} s"
        print(line, flush=True)
    print("all", " | ".join(f"{variant}: {seconds:.1f} s" for variant, seconds in total.items()))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
