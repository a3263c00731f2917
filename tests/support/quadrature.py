"""One blade without gravity in 30 digits: time and rotor angle as integrals over the pitch. Knows no model of ours.

Kept are E = ½ S Ω² + ½ J u² and p = S Ω + b u with u = θ̇ + b Ω / J, b = -m c d sin θ, J = m c²,
S = h + m (c² + d²) cos² θ.
Eliminating: θ̇ = √(N / S) / J and Ω = (p - b u) / S, u = (p b + √(S N)) / (b² + S J), N = 2 E b² - J p² + 2 E S J,
for the branch with θ̇ > 0 that starts at Ω = 0. With cos θ = sin x, x = π/2 - θ = ε sinh y, ε² = h / (m (c² + d²)), the
integrand is smooth in y through x = 0.
"""

from __future__ import annotations

from typing import Any

import mpmath

mp = mpmath.mp.clone()
mp.dps = 30


class Passage:
    """The motion from pitch `start` (rad) with rotor at rest and pitch rate 1 rad/s."""

    def __init__(self, mass: float, c: float, d: float, hub: float, start: float) -> None:
        m, c, d, self.h = map(mp.mpf, (mass, c, d, hub))
        self.J, self.coupling = m * c**2, m * c * d
        self.whole = m * (c**2 + d**2)
        self.epsilon = mp.sqrt(self.h / self.whole)
        self.E = self.J / 2
        self.p = -self.coupling * mp.sin(start)
        self.y0 = self._y(start)

    def _y(self, pitch: float) -> Any:
        return mp.asinh((mp.pi / 2 - mp.mpf(pitch)) / self.epsilon)

    def time_and_rotor(self, pitch: float) -> tuple[Any, Any]:
        """s and rad (from the start) at which `pitch` is reached."""
        # The integrand is analytic to y = ± iπ/2, so that Gauss's rule converges fast on panels of width 1.
        y1 = self._y(pitch)
        panels = mp.linspace(y1, self.y0, 2 + int(abs(self.y0 - y1)))
        time, rotor = (
            mp.quad(rate, panels, method="gauss-legendre", maxdegree=3)
            for rate in (lambda y: self._rates(y)[0], lambda y: mp.fprod(self._rates(y)))
        )
        return time, rotor

    def _rates(self, y: Any) -> tuple[Any, Any]:
        """dt/dy (sign turned: y falls) and Ω."""
        x = self.epsilon * mp.sinh(y)
        S = self.h + self.whole * mp.sin(x) ** 2
        b = -self.coupling * mp.cos(x)
        N = 2 * self.E * b * b - self.J * self.p**2 + 2 * self.E * S * self.J
        u = (self.p * b + mp.sqrt(S * N)) / (b * b + S * self.J)
        return self.J * mp.sqrt(S / N) * self.epsilon * mp.cosh(y), (self.p - b * u) / S

    def pitch_rate(self, pitch: float) -> float:
        y = self._y(pitch)
        return float(self.epsilon * mp.cosh(y) / self._rates(y)[0])
