"""One blade without gravity in 40 digits: time and rotor angle as integrals over the pitch. Knows no model of ours.

Kept are E = ½ S Ω² + ½ J u² and p = S Ω + b u with u = θ̇ + b Ω / J, b = -m c d sin θ, J = m c²,
S = h + m (c² + d²) cos² θ.
Eliminating: θ̇ = √(N / S) / J and Ω = (p - b u) / S, u = (p b + √(S N)) / (b² + S J), N = 2 E b² - J p² + 2 E S J,
for the branch with θ̇ > 0 that starts at Ω = 0. With cos θ = sin x, x = π/2 - θ = ε sinh y, ε² = h / (m (c² + d²)), the
integrand is smooth in y through x = 0.
"""

from __future__ import annotations

import math
from decimal import Decimal, getcontext
from functools import cache

getcontext().prec = 45
D = Decimal
HALF_PI = D("1.57079632679489661923132169163975144209858469968755291")
_NODES = 20
# The integrand is analytic to y = ± iπ/2: on panels of width 1, 20 points leave 1e-32.
_PANEL = D(1)


class Passage:
    """The motion from pitch `start` (rad) with rotor at rest and pitch rate 1 rad/s."""

    def __init__(self, mass: float, c: float, d: float, hub: float, start: float) -> None:
        m, self.c, self.d, self.h = D(mass), D(c), D(d), D(hub)
        self.J, self.coupling = m * self.c**2, m * self.c * self.d
        self.whole = m * (self.c**2 + self.d**2)
        self.E = self.J / 2
        self.p = -self.coupling * cosine(HALF_PI - D(start))
        self.y0 = self._y(start)

    def _y(self, pitch: float) -> Decimal:
        ratio = (HALF_PI - D(pitch)) * (self.whole / self.h).sqrt()
        root = (ratio * ratio + 1).sqrt()
        # asinh, without loss for negative arguments
        return (ratio + root).ln() if ratio >= 0 else -(-ratio + root).ln()

    def time_and_rotor(self, pitch: float) -> tuple[Decimal, Decimal]:
        """s and rad (from the start) at which `pitch` is reached."""
        y1 = self._y(pitch)
        panels = max(1, int(abs(self.y0 - y1) / _PANEL) + 1)
        width = (self.y0 - y1) / panels
        time = rotor = D(0)
        for k in range(panels):
            for node, weight in gauss_legendre():
                dt, omega = self._rates(y1 + width * (k + (node + 1) / 2))
                time += weight * dt * width / 2
                rotor += weight * dt * omega * width / 2
        return time, rotor

    def _rates(self, y: Decimal) -> tuple[Decimal, Decimal]:
        """dt/dy (sign turned: y falls) and Ω."""
        epsilon = (self.h / self.whole).sqrt()
        e, inverse = y.exp(), (-y).exp()
        x = epsilon * (e - inverse) / 2
        S = self.h + self.whole * sine(x) ** 2
        b = -self.coupling * cosine(x)
        N = 2 * self.E * b * b - self.J * self.p**2 + 2 * self.E * S * self.J
        u = (self.p * b + (S * N).sqrt()) / (b * b + S * self.J)
        return self.J * (S / N).sqrt() * epsilon * (e + inverse) / 2, (self.p - b * u) / S

    def pitch_rate(self, pitch: float) -> float:
        dt, _ = self._rates(self._y(pitch))
        y = self._y(pitch)
        return float((self.h / self.whole).sqrt() * (y.exp() + (-y).exp()) / 2 / dt)


def sine(x: Decimal) -> Decimal:
    return _series(x, x, 2)


def cosine(x: Decimal) -> Decimal:
    return _series(x, D(1), 1)


def _series(x: Decimal, term: Decimal, n: int) -> Decimal:
    """Of sine and cosine: `term` the first one, n (n + 1) the divisor of the next."""
    total = term
    while abs(term) > D(10) ** -48:
        term = -term * x * x / (n * (n + 1))
        total += term
        n += 2
    return total


@cache
def gauss_legendre() -> list[tuple[Decimal, Decimal]]:
    """Nodes and weights on [-1, 1], by Newton's method on the Legendre polynomial."""
    return [_node(i) for i in range(_NODES)]


def _node(i: int) -> tuple[Decimal, Decimal]:
    x = D(math.cos(math.pi * (i + 0.75) / (_NODES + 0.5)))
    for _ in range(7):
        value, slope = _legendre(x)
        x -= value / slope
    _, slope = _legendre(x)
    return x, 2 / ((1 - x * x) * slope * slope)


def _legendre(x: Decimal) -> tuple[Decimal, Decimal]:
    before, value = D(1), x
    for k in range(2, _NODES + 1):
        before, value = value, ((2 * k - 1) * x * value - (k - 1) * before) / k
    return value, _NODES * (x * value - before) / (x * x - 1)
