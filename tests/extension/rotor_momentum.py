"""An output quantity from another package: the angular momentum about the shaft, from angles and
rates."""

import numpy as np

from rotor_mbs.solution.quantities import Plot, Quantity, QuantityMetric


def momentum(scene, samples):
    """(n,) N m s: hub and blades, each with its inertia tensor about the hub centre."""
    total = scene.hub_inertia * samples.rates[:, 0]
    for i, blade in enumerate(scene.blades):
        xx, yy, zz, xy, xz, yz = blade.inertia
        r, s, c = (
            np.array(blade.centre_of_mass),
            np.sin(samples.angles[:, 1 + i]),
            np.cos(samples.angles[:, 1 + i]),
        )
        J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) + blade.mass * (
            r @ r * np.eye(3) - np.outer(r, r)
        )
        shaft = np.stack([s, c, 0.0 * s], axis=1)
        omega = samples.rates[:, :1] * shaft + samples.rates[:, 1 + i : 2 + i] * [0.0, 0.0, 1.0]
        total = total + np.einsum("ni,ij,nj->n", shaft, J, omega)
    return total


QUANTITY = Quantity(
    "shaft_momentum",
    ("time",),
    "N m s",
    "angular momentum about the shaft",
    output="momentum",
    producer=momentum,
    judgement=QuantityMetric(
        "shaft_momentum_error_max",
        bound=1.0,
        channel="momentum",
        unit="N m s",
        fault="shaft momentum off by {value} N m s",
        look_at="angles or rates",
    ),
    plot=Plot("Angular momentum about the shaft", "momentum (N m s)"),
)
