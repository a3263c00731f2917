"""How run time grows with the number of blades and with the duration: a table for each method.

    python tests/support/cost_scaling.py [METHOD...]

Each method runs at its default settings; sizes after one that took longer than BUDGET_S are left out.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

from rotor_mbs.methods.catalogue import method_names
from rotor_mbs.methods.solve import solve
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene

BUDGET_S = 30.0
BLADES = (1, 2, 3, 6, 12, 24, 48, 96)
DURATIONS = (1.0, 10.0, 60.0, 600.0, 3600.0)  # s


def with_blades(scene: Scene, count: int) -> Scene:
    """The scene with so many blades like its first, each at a pitch of its own, for one second."""
    return replace(
        scene,
        duration=1.0,
        samples=11,
        blades=scene.blades[:1] * count,
        initial_angles=(0.0, *(float(0.1 + 0.2 * np.sin(1.0 + i)) for i in range(count))),
        initial_rates=(0.0,) * (1 + count),
        bearing_stiffness=(),
        bearing_damping=(),
        text="",
    )


def main() -> None:
    # Blades pitched a little, for the second in which no error has grown much; a plain pendulum, which stays regular.
    many, one = find_scenes(["paper/fig08"])[0], find_scenes(["paper/fig03"])[0]
    studies = {
        "blades": {float(count): with_blades(many, count) for count in BLADES},
        "simulated s": {t: replace(one, duration=t, samples=round(10 * t) + 1) for t in DURATIONS},
    }
    for method in sys.argv[1:] or method_names(is_corrected=True):
        for kind, scenes in studies.items():
            for size, scene in scenes.items():
                seconds = min(solve(method, scene, {}, repeats=3).run_times_s)
                print(f"{method:32s} {size:8g} {kind:12s} {seconds:.3e} s", flush=True)
                if seconds > BUDGET_S:
                    break


if __name__ == "__main__":
    main()
