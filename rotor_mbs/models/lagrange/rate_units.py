"""In what unit an error of a rate counts beside an error of an angle. Knows the scene only; no integrator."""

from __future__ import annotations

import math

import numpy as np

from rotor_mbs.models.lagrange.parameters import rotor_form
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Array

# Up to this natural frequency, rad/s, a rate counts in rad/s as an angle counts in rad (the paper's blades: 10.7).
_PLAIN = 100.0


def rate_units(scene: Scene) -> Array:
    """(1 + moving blades,) rad/s: 1, or a coordinate's own frequency where that is above 100 rad/s.

    Without it the quarter period that turns an angle into a rate would pass for growth of an error: 1e5-fold on a
    bearing of 1e12 N m/rad, where nothing grows at all. The frequency is that of the bearing's spring, of gravity on
    the offset mass and of the rotor's turning, at the start.
    """
    form = rotor_form(scene)
    spin = abs(scene.initial_rates[0])
    frequencies = [0.0]
    for blade in form.blades:
        moment = blade.stiffness + math.hypot(blade.weight_x, blade.weight_y)
        frequencies.append(max(math.sqrt(moment / blade.pitch_inertia), spin))
    return np.array([frequency if frequency > _PLAIN else 1.0 for frequency in frequencies])
