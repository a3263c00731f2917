"""Numbers of docs/reading.md, from a file of `rotor-mbs reproduce`: python tests/support/defect_tables.py results.h5

Defects of every default method, the smallest relative faults that they would show, and predicted beside true errors.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from fractions import Fraction
from math import cos, sin
from pathlib import Path

import numpy as np

from rotor_mbs.methods.catalogue import is_corrected
from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.parameters import rate_units, rotor_form
from rotor_mbs.models.lagrange.samples import loads_at
from rotor_mbs.runs.read import StoredRun, open_results
from rotor_mbs.scenario.accuracy_bounds import shipped_bounds
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.defects import FLOOR_SAFETY
from rotor_mbs.solution.trajectory import Array, Trajectory

FAULTS = ("c", "gravity", "Coriolis term", "torque", "azimuth (rad)")
_SMALL = 1e-7  # relative (of the azimuth rad): far above rounding, and the defects are linear in it


def signatures(scene: Scene, motion: Trajectory) -> dict[str, Array]:
    """(n,) rad for each of `FAULTS`: size of each interval's defect for a relative fault of 1 (an azimuth of 1 rad).

    To first order in the interval h: a wrong acceleration Δa is a defect of h Δa in the rates.
    """
    moving = scene.moving_coordinates
    angles, rates = motion.angles[:, moving].T, motion.rates[:, moving].T
    form, loads = rotor_form(scene), loads_at(scene, motion.time)
    interval = scene.duration / (scene.samples - 1)
    units = np.maximum(rate_units(scene), 1.0 / interval)[:, None]

    def accelerations(form: object = form, loads: object = loads, rates: Array = rates) -> Array:
        rows = closed_form.accelerations(list(angles), list(rates), form, loads, np.sin, np.cos)
        return np.array([np.broadcast_to(row, angles[0].shape) for row in rows])

    def size(difference: Array) -> Array:
        return np.abs(difference * interval / units).max(axis=0)

    right = accelerations()
    further = 1.0 + _SMALL
    blades = [
        replace(blade, centre_of_mass=(blade.centre_of_mass[0] * further, *blade.centre_of_mass[1:]))
        for blade in scene.blades
    ]
    phases = [(Fraction(cos(angle)), Fraction(sin(angle))) for angle in (_SMALL, *scene.phases[1:])]
    rotor_alone, pitches_alone = rates.copy(), rates.copy()
    rotor_alone[1:], pitches_alone[0] = 0.0, 0.0
    products = right - accelerations(rates=rotor_alone) - accelerations(rates=pitches_alone)
    return {
        "c": size(accelerations(rotor_form(replace(scene, blades=tuple(blades)))) - right) / _SMALL,
        "gravity": size(accelerations(rotor_form(replace(scene, gravity=scene.gravity * further))) - right) / _SMALL,
        "Coriolis term": size(products + accelerations(rates=0.0 * rates)),
        "torque": size(accelerations(loads=replace(loads, rotor=np.asarray(loads.rotor) * further)) - right) / _SMALL,
        "azimuth (rad)": size(accelerations(rotor_form(scene, phases=phases)) - right) / _SMALL,
    }


def smallest_faults(scene: str, run: StoredRun, of_fault: dict[str, Array]) -> list[str]:
    """The relative size of each fault from which a bound would show it; "-" where the motion has none of it.

    A wrong number is in every interval: it shows where its largest defect is above the bound on the largest, or their
    median above the bound on the median.
    """
    own = replace(shipped_bounds(), scene=scene)
    limits = [(own.of("defect", run.method).value + FLOOR_SAFETY * run.attributes["defect_floor"], np.max)]
    if (of_median := own.find("defect median", run.method)) is not None:
        limits.append((of_median.value, np.median))
    seen = [
        min((limit / float(size(sizes)) for limit, size in limits if size(sizes) > 1e-12), default=1.0)
        for sizes in of_fault.values()
    ]
    return [f"{share:.0e}" if share < 1.0 else "-" for share in seen]


def main(path: Path) -> None:
    heads = ["method", "scene", "largest (rad)", "median (rad)", *FAULTS, "horizon (s)", "error (rad)", "predicted"]
    rows = []
    with open_results(path) as results:
        for name, stored in results.scenes.items():
            reference = stored.reference_trajectory
            assert reference is not None
            of_fault: dict[str, Array] = {}
            for run in stored.runs.values():
                solution = run.solution(stored.scene)
                if solution is None or run.method == "reference":
                    continue
                of_fault = of_fault or signatures(solution.scene, reference)
                facts = run.attributes
                row = [run.method, name, f"{facts['defect_max']:.0e}", f"{facts['defect_median']:.0e}"]
                if is_corrected(run.method):
                    row += [*smallest_faults(name, run, of_fault), f"{facts['horizon_s']:.2f}"]
                    row += [f"{facts['angle_error_max']:.1e}", f"{facts.get('angle_error_predicted', np.nan):.1e}"]
                rows.append(row)
    for row in [heads, ["---"] * len(heads), *sorted(rows)]:
        print("|", " | ".join(row), "|")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
