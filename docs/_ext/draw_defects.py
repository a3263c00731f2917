"""Draw docs/defects.svg: what is allowed and what is found, of a good run and of one with a small
fault from 5 s on.

Run: python docs/_ext/draw_defects.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import rotor_mbs as rm
from rotor_mbs.analysis.judgement import bounds_of
from rotor_mbs.models.lagrange.defects import interval_defects
from rotor_mbs.report.looks import Look
from rotor_mbs.report.plots import Series, errors
from rotor_mbs.solution.defects import FLOOR_SAFETY
from rotor_mbs.solution.trajectory import Array

METHOD = "exudyn_tree/rk67"
FAULT_TIME_S, FAULT = 5.0, 1e-5  # share by which gravity is too large from then on
EVERY = 5  # intervals for a point of a curve
PICTURE = Path(__file__).parents[1] / "defects.svg"


def curves() -> tuple[Array, Array, Array, Array]:
    """Return ends of intervals (s), what is allowed, and the defects of the faulty and of the good
    run (rad)."""
    scene = rm.scene("paper/fig11")
    good = rm.run(scene, METHOD)
    first = int(np.searchsorted(good.time, FAULT_TIME_S))
    start = {
        "initial.angles": good.angles[first].tolist(),
        "initial.rates": good.rates[first].tolist(),
    }
    rest = scene.replace(
        gravity=scene.gravity * (1.0 + FAULT),
        duration=scene.duration - FAULT_TIME_S,
        samples=scene.samples - first,
        **start,
    )
    faulty = rm.run(rest, METHOD)
    angles = np.vstack([good.angles[:first], faulty.angles])
    rates = np.vstack([good.rates[:first], faulty.rates])
    found = interval_defects(scene, good.time, good.angles, good.rates)
    found_faulty = interval_defects(scene, good.time, angles, rates)
    bound = bounds_of(METHOD).of("defect", METHOD).value
    allowed = bound * found.bound_factors + FLOOR_SAFETY * found.floor
    values = good.time[1:], allowed, found_faulty.sizes, found.sizes
    # The largest of each few intervals, for a small file.
    ends, *sizes = (array.reshape(-1, EVERY).max(axis=1) for array in values)
    return ends, *sizes


def main() -> None:
    """Compute both runs, and write the picture."""
    ends, *sizes = curves()
    looks = (
        Look("#333333", "--", "", "allowed"),
        Look(
            "#d55e00", "-", "", f"found: gravity {FAULT:.0e} too large from {FAULT_TIME_S:g} s on"
        ),
        Look("#0072b2", "-", "", "found: good run"),
    )
    series = [Series(ends, values, look) for values, look in zip(sizes, looks, strict=True)]
    errors(series, "defect (rad)").with_legend().save(PICTURE)


if __name__ == "__main__":
    main()
