"""Rotors for tests, their motion and energies as an oracle that shares nothing with the package but the scene.

T = J_hub q'²/2 + Σ ω·J ω/2 with ω = (q' sin θ, q' cos θ, θ') in the blade frame and J about the hub centre;
V = Σ m g z + Σ k (θ - rest)²/2.
"""

from __future__ import annotations

import functools
from math import hypot, pi

import numpy as np
from scipy.special import ellipj

from rotor_mbs.scenario.scene import Blade, Scene
from support import other_code
from support.other_code import acceleration as acceleration
from support.other_code import value_at

C, D = hypot(0.08, 0.03), 15.42
PAPER = Blade(15000.0, (C, 0.0, D), (0.0,) * 6, (C, 0.0, 33.38))
STOUT = Blade(100.0, (0.3, -0.2, 4.0), (30.0, 40.0, 25.0, 3.0, -4.0, 5.0), (0.3, 0.1, 8.0))
SLIM = Blade(80.0, (-0.1, 0.25, 3.0), (20.0, 22.0, 9.0, -2.0, 1.0, 2.0), (0.3, 0.1, 6.0))
AXIAL = Blade(50.0, (0.0, 0.0, 3.0), (12.0, 12.0, 7.0, 0.0, 0.0, 0.0), (0.2, 0.0, 6.0))
ALL = ("angles", "rates", "tip", "energy")


def make_scene(angles, rates, blades=None, gravity=9.8, duration=1.0, samples=101, outputs=ALL, **more) -> Scene:
    """A scene with as many of the paper's blades as there are pitch angles, unless told otherwise."""
    return Scene(
        name="test",
        title="test",
        figures=(),
        gravity=gravity,
        duration=duration,
        samples=samples,
        outputs=outputs,
        blades=blades or (PAPER,) * (len(angles) - 1),
        hub_inertia=more.pop("hub_inertia", 0.0),
        initial_angles=tuple(map(float, angles)),
        initial_rates=tuple(map(float, rates)),
        **more,
    )


FIG08 = make_scene([0, pi / 4, 0, 0], [0] * 4, duration=10.0, samples=1001)
FIG11 = make_scene([pi / 6, pi / 4, pi / 6, pi / 2], [pi / 10, 0, 0, 0], duration=10.0, samples=1001)
# Every load at once, constant, with ramps and with jumps between samples, on unlike blades of full inertia.
MIXED = make_scene(
    [0.3, 0.4, -0.2, 1.0],
    [1.0, 0.5, -0.3, 0.2],
    (STOUT, SLIM, STOUT),
    duration=1.6,
    samples=161,
    hub_inertia=500.0,
    bearing_stiffness=(2000.0, 3000.0, 100.0),
    bearing_damping=(5.0, 8.0, 1.0),
    shaft_damping=200.0,
    rotor_torque=((0.1234, 0.0), (0.777, 2000.0), (0.777, -1000.0), (1.5, -1000.0), (1.5, 500.0)),
    pitch_torque=(((0.0, 40.0),), ((0.2, 0.0), (0.55, 90.0), (0.55, -60.0)), ()),
    bearing_rest=(((0.0, 0.2),), ((0.4, 0.0), (0.9, 0.3)), ((0.777, 0.1), (0.777, -0.5), (1.3, 0.4))),
)


def about_hub(blade: Blade):
    """(3, 3) kg m² about the hub centre."""
    xx, yy, zz, xy, xz, yz = blade.inertia
    r = np.array(blade.centre_of_mass)
    com = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return com + blade.mass * (r @ r * np.eye(3) - np.outer(r, r))


@functools.cache
def closed_form(scene: Scene, duration: float | None = None):
    """(n, 2 (1 + blades)) angles and rates at the samples up to `duration`, by `other_code`."""
    times = np.linspace(0.0, scene.duration, scene.samples)
    times = times[times <= (duration or scene.duration) + 1e-12]
    return np.hstack(other_code.trajectory(scene, times, rtol=1e-13, atol=1e-14))


def energies(scene: Scene, y):
    """Kinetic and potential energy (n,) J of rows of angles and rates."""
    n = 1 + len(scene.blades)
    kinetic = 0.5 * scene.hub_inertia * y[:, n] ** 2
    potential = np.zeros(len(y))
    for i, blade in enumerate(scene.blades):
        theta, w, v = y[:, 1 + i], y[:, n], y[:, n + 1 + i]
        omega = np.stack([w * np.sin(theta), w * np.cos(theta), v], axis=1)
        kinetic += 0.5 * np.einsum("ni,ij,nj->n", omega, about_hub(blade), omega)
        potential += blade.mass * scene.gravity * (blade_points(scene, y, i, blade.centre_of_mass)[:, 2])
        if scene.bearing_stiffness:
            times = np.linspace(0.0, scene.duration, scene.samples)[: len(y)]
            rest = value_at(scene.bearing_rest[i] if scene.bearing_rest else (), times)
            potential += 0.5 * scene.bearing_stiffness[i] * (theta - rest) ** 2
    return kinetic, potential


def blade_points(scene: Scene, y, index: int, point):
    """(n, 3) m: Ry(q + phase) Rz(θ) point."""
    psi, theta = y[:, 0] + scene.phases[index], y[:, 1 + index]
    x = np.cos(theta) * point[0] - np.sin(theta) * point[1]
    across = np.sin(theta) * point[0] + np.cos(theta) * point[1]
    z = np.full_like(x, point[2])
    return np.stack([np.cos(psi) * x + np.sin(psi) * z, across, -np.sin(psi) * x + np.cos(psi) * z], axis=1)


def pendulum(start: float, length: float, lean: float, gravity: float, t):
    """Angle of a pendulum released from rest at `start` from the top, its mass `lean` ahead of the angle told.

    φ = angle + lean - π swings as φ = 2 asin(k cd(t sqrt(g/l), k²)), k = sin(φ(0)/2).
    """
    k = np.sin(0.5 * (start + lean - pi))
    _, cn, dn, _ = ellipj(t * np.sqrt(gravity / length), k * k)
    return pi - lean + 2.0 * np.arcsin(k * cn / dn)
