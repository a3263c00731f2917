"""The smallest fault that a bound on defects sees is what the rule states: planted at twice its
size it is seen.

In the frozen references of the shipped scenes, which are exact to rounding, by the bound of every
method.
"""

from __future__ import annotations

import numpy as np
import pytest
from support.references import reference, referenced
from support.scenes import shipped

from rotor_mbs.methods.catalogue import method_names
from rotor_mbs.models.lagrange.defects import interval_defects
from rotor_mbs.scenario.accuracy_bounds import shipped_bounds
from rotor_mbs.scenario.catalogue import REFERENCES
from rotor_mbs.solution.defects import FLOOR_SAFETY, OK_ERROR, Defects
from rotor_mbs.solution.trajectory import Array

OWN = "own/engine"  # without a bound of its own
_ILL_CONDITIONED = 1e3
ROWS = 3  # of each scene, from its second to its last
GROUPS = [path.stem for path in sorted(REFERENCES.glob("*.h5"))]


def bounds_by_value() -> dict[float, list[str]]:
    """Return the bounds on defects, rad, with the methods that have each."""
    methods: dict[float, list[str]] = {}
    for method in (*method_names(is_corrected=True), OWN):
        bound = min(shipped_bounds().of("defect", method).value, OK_ERROR)
        methods.setdefault(bound, []).append(method)
    return methods


def interval(name: str, row: int, angles: Array, rates: Array) -> Defects:
    """Return the defects of the interval that ends in a row, (2, 1 + blades) rad and rad/s."""
    return interval_defects(shipped(name), reference(name).time[row - 1 : row + 1], angles, rates)


def judge_faults(name: str, row: int) -> int:
    """Plant faults in the end of an interval; return how many."""
    with np.errstate(all="ignore"):  # in extreme scenes numbers overflow
        return _judge_faults(name, row)


def _judge_faults(name: str, row: int) -> int:
    motion = reference(name)
    angles, rates = motion.angles[row - 1 : row + 1], motion.rates[row - 1 : row + 1]
    clean = interval(name, row, angles, rates)
    if not clean.is_judged[0]:
        return 0
    largest = float(clean.excess[0])
    length = float(motion.time[row] - motion.time[row - 1])
    factor = max(1.0, length / 0.01) * max(1.0, float(clean.growth[0]))  # the rule
    moving, planted = list(clean.moving), 0
    for bound, methods in bounds_by_value().items():
        allowed = bound * factor
        # What rounding may hide is part of the smallest fault.
        smallest = allowed + FLOOR_SAFETY * float(clean.floor[0])
        for coordinate in (moving[0], moving[-1]):
            moved_angles, moved_rates = angles.copy(), rates.copy()
            moved_angles[1, coordinate] += 2.0 * smallest
            moved_rates[1, coordinate] += 2.0 * smallest * clean.rate_units[coordinate]
            for wrong in ((moved_angles, rates), (angles, moved_rates)):
                defects = interval(name, row, *wrong)
                seen = defects.judged_sizes[0]
                # Moved to a singular pitch, where nothing is known, a run is not ok either.
                assert seen > bound or not defects.is_judged[0], (
                    name,
                    row,
                    coordinate,
                    methods,
                    seen,
                )
                planted += 1
        # And what is well below is no fault; beside a singular pitch all of it may be.
        if largest <= 0.1 * allowed and clean.conditioning[0] < _ILL_CONDITIONED:
            moved_angles = angles.copy()
            moved_angles[1, moving[0]] += 0.4 * allowed
            assert interval(name, row, moved_angles, rates).judged_sizes[0] <= bound, (
                name,
                row,
                methods,
            )
    return planted


def rows_of(name: str, count: int) -> list[int]:
    """Return rows of a reference, spread over its length; none where it has no interval."""
    length = len(reference(name).time)
    return sorted({*np.linspace(1, length - 1, count).astype(int).tolist()}) if length > 1 else []


@pytest.mark.parametrize(
    "name", ["paper/fig11", pytest.param("stiff/bearing-1e6", marks=pytest.mark.full)]
)
def test_a_fault_of_twice_the_smallest_is_seen(name: str) -> None:
    (row,) = rows_of(name, 3)[1:2]
    assert judge_faults(name, row) > 0


# The groups of most scenes take half a minute.
@pytest.mark.parametrize(
    "group",
    [
        pytest.param(
            group,
            marks=pytest.mark.nightly if group in ("extreme", "paper") else pytest.mark.full,
        )
        for group in GROUPS
    ],
)
def test_a_fault_of_twice_the_smallest_is_seen_in_every_scene(group: str) -> None:
    judged = []
    for name in referenced(group):
        planted = sum(judge_faults(name, row) for row in rows_of(name, ROWS))
        judged.append(planted > 0)
    # In a scene whose motion ends at once, or is not known from row to row, nothing is judged.
    assert sum(judged) >= 0.8 * len(judged)
