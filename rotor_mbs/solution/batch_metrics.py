"""Metrics of many runs at once: those that are clearly ok are found here, the others are left to `judgement.judge`.

Knows arrays only; no engine, no file, no bound of its own.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.judgement import allowed_of, rotor_inertia_shares
from rotor_mbs.solution.metrics import energy_scale
from rotor_mbs.solution.quantities import Array
from rotor_mbs.solution.record import Integration, Trajectory

# Of the rotor's inertia at the start: above it, no start is singular.
_CLEAR_SHARE = 1e-6


def largest(values: Array) -> Array:
    """(k,) of (k, n): the largest size of each row; samples that are not finite do not count."""
    found: Array = np.abs(np.maximum(values.max(axis=1), -values.min(axis=1)))  # of zeros: not -0
    if not np.isfinite(found).all():
        sizes = np.abs(values)
        found = sizes.max(axis=1, initial=0.0, where=np.isfinite(sizes))
    return found


def energy_errors(kinetic: Array, potential: Array, work: Array) -> Array:
    """(k, n) J: total energy less work, less its value at the start of each run."""
    total = kinetic + potential - work
    errors: Array = total - total[:, :1]
    return errors


def energy_drifts(scenes: Sequence[Scene], kinetic: Array, work: Array, errors: Array) -> Array:
    """(k,) largest energy error of each run, of its scale (J where that is zero); NaN samples do not count."""
    scales = _scales(scenes) + kinetic[:, 0] + largest(work)
    drifts: Array = largest(errors) / np.where(scales == 0.0, 1.0, scales)
    return drifts


def _scales(scenes: Sequence[Scene]) -> Array:
    """(k,) J: of each run's energy, before it moves; computed once for runs that share rotor and spring energy."""
    found: dict[tuple[object, ...], float] = {}
    scales = []
    for scene in scenes:
        spring_angles = scene.initial_angles if any(scene.bearing_stiffness) else ()
        key = (scene.rotor_key, spring_angles)
        if key not in found:
            angles = np.array([scene.initial_angles])
            found[key] = energy_scale(scene, Trajectory(np.zeros(1), angles, angles))
        scales.append(found[key])
    return np.array(scales)


def clearly_ok(
    scenes: Sequence[Scene], method: str, integrations: Sequence[Integration], samples: Sequence[int], drifts: Array
) -> NDArray[np.bool_]:
    """(k,) whether `judgement.judge`, without a reference, is certain to call each run ok."""
    allowed = allowed_of(method)
    complete = np.array([one.success and n == scenes[0].samples for one, n in zip(integrations, samples, strict=True)])
    if allowed is None:
        return complete
    return complete & (drifts <= allowed.energy) & (_start_shares(scenes) > _CLEAR_SHARE)


def _start_shares(scenes: Sequence[Scene]) -> Array:
    """(k,) the rotor's inertia at the start with every pitch free, of the whole; all runs of a rotor at once."""
    shares = np.empty(len(scenes))
    rotors: dict[tuple[object, ...], list[int]] = {}
    for i, scene in enumerate(scenes):
        rotors.setdefault(scene.rotor_key, []).append(i)
    for numbers in rotors.values():
        angles = np.array([scenes[i].initial_angles for i in numbers])
        shares[numbers] = rotor_inertia_shares(scenes[numbers[0]], angles)
    return shares
