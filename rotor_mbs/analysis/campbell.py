"""Modes of a scene over rotor speed, as arrays, and as tables for readers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.analysis.modes import Complex, ModeSet, multiblade_shapes, whirl_frequencies
from rotor_mbs.solution.trajectory import Array

REST, ROTATION, FLOQUET, CHART = "rest", "rotation", "floquet", "chart"
# Sources agree where their frequencies differ by no more than this share.
AGREEMENT = 1e-8
# Frequencies below this share of the largest are not compared: they are roots of what is left when stiffnesses cancel,
# and of a rotor that nothing holds that is rounding.
_SLOW = 1e-3


@dataclass(frozen=True, kw_only=True)
class LinearModes(ModeSet):
    """The modes of one source over speed, the same mode in the same place at every speed.

    names       "collective pitch" where symmetry tells the modes apart, else "mode 2"
    source      "lagrange", "exudyn_tree", ...; label: as a reader calls it
    kind        REST or ROTATION
    coordinates names of the coordinates that move; angles: their (speeds, n) steady values, rad
    stiffness, damping   (speeds, n, n), the mass matrix divided out
    messages    why there is nothing at a speed; "" where there is
    """

    source: str
    label: str
    kind: str
    blades: int
    speeds: Array
    coordinates: tuple[str, ...]
    angles: Array
    stiffness: Array
    damping: Array
    messages: tuple[str, ...] = ()

    @property
    def multiblade_shapes(self) -> Complex:
        """(speeds, n, 1 + blades): by speed, mode, and rotor or multiblade coordinate."""
        whole = np.zeros((len(self.speeds), len(self.coordinates), 1 + self.blades), dtype=complex)
        columns = [0 if name == "rotor" else int(name.rpartition(" ")[2]) for name in self.coordinates]
        whole[:, :, columns] = self.shapes
        return multiblade_shapes(whole)

    @property
    def whirl(self) -> tuple[Array, Array]:
        """(speeds, n) rad/s backward and forward whirl, NaN for modes that are no cosine and no sine of the blades."""
        harmonics = np.full(len(self.names), np.nan)
        for k, name in enumerate(self.names):
            if name.startswith(("cosine", "sine")):  # "cosine pitch", "cosine 2 pitch"
                harmonics[k] = int(name.split()[1]) if name.split()[1].isdigit() else 1
        return whirl_frequencies(self.damped_frequencies, self.speeds[:, None], harmonics)


@dataclass(frozen=True)
class FloquetTable:
    """Multipliers of a turn under gravity over speed.

    multipliers     (speeds, 2n); largest: modulus of those that are not always 1
    stable          1, 0, or -1 where no periodic motion was found
    product_error   logarithm of their product less the integrated trace; NaN where rounding hides it
    torque, mismatch   N m on the rotor, and rad that a turn misses
    """

    speeds: Array
    multipliers: Complex
    largest: Array
    stable: NDArray[np.int64]
    product_error: Array
    torque: Array
    mismatch: Array
    messages: tuple[str, ...] = ()

    @property
    def growth_rates(self) -> Array:
        """(speeds,) 1/s."""
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(self.largest) * self.speeds / (2.0 * np.pi))


@dataclass(frozen=True)
class StabilityChart:
    """(stiffnesses, speeds) largest multipliers; NaN where no periodic motion was found."""

    speeds: Array
    stiffnesses: Array
    largest: Array


@dataclass(frozen=True)
class SceneModes:
    """All that is known of a scene's modes.

    rest, rotation   by source, in the order of the catalogue; the first one is the closed form
    notes            what could not be done, and why
    """

    scene: str
    title: str
    blades: int
    gravity: float
    rest: Mapping[str, LinearModes] = field(default_factory=dict)
    rotation: Mapping[str, LinearModes] = field(default_factory=dict)
    floquet: FloquetTable | None = None
    chart: StabilityChart | None = None
    notes: tuple[str, ...] = ()

    @property
    def disagreement(self) -> float:
        """Largest relative difference between the frequencies of two sources; 0 where there is one source alone."""
        return max((_difference(list(kind.values())) for kind in (self.rest, self.rotation) if kind), default=0.0)

    @property
    def agrees(self) -> bool:
        return self.disagreement <= AGREEMENT


def _difference(sources: Sequence[LinearModes]) -> float:
    """Largest difference of all other sources from the first one, modes in the order of their size."""
    expected, *others = (np.sort(np.abs(source.eigenvalues).max(axis=2), axis=1) for source in sources)
    fast = expected > _SLOW * np.nanmax(expected, initial=0.0)
    shares = (np.abs(other - expected)[fast] / expected[fast] for other in others)
    return max((float(np.nanmax(share, initial=0.0)) for share in shares), default=0.0)


def mode_rows(modes: SceneModes) -> list[dict[str, object]]:
    """A row for each state, speed and mode of the closed form: speeds and frequencies in rad/s, growth in 1/s."""
    rows: list[dict[str, object]] = []
    for kind in (modes.rest, modes.rotation):
        for linear in list(kind.values())[:1]:
            rows += [
                {
                    "state": "at rest" if linear.kind == REST else "steady rotation without gravity",
                    "speed": float(speed),
                    "mode": name,
                    "undamped_frequency": _number(linear.undamped_frequencies[i, k]),
                    "damped_frequency": _number(linear.damped_frequencies[i, k]),
                    "damping_ratio": _number(linear.damping_ratios[i, k]),
                    "growth_rate": _number(linear.growth_rates[i, k]),
                }
                for i, speed in enumerate(linear.speeds)
                for k, name in enumerate(linear.names)
            ]
    return rows


def modes_summary(modes: SceneModes) -> list[str]:
    """Lines for a terminal: modes at rest, at the lowest and the highest speed, agreement, multipliers."""
    lines = [f"{modes.scene}: {modes.title}"]
    for kind in (modes.rest, modes.rotation):
        for linear in list(kind.values())[:1]:
            for i in sorted({0, len(linear.speeds) - 1}):
                lines += _state_lines(linear, i)
    compared = [
        f"{', '.join(s.label for s in kind.values())}" for kind in (modes.rest, modes.rotation) if len(kind) > 1
    ]
    if compared:
        verdict = "agree" if modes.agrees else "DISAGREE"
        lines.append(f"  {max(compared, key=len)} {verdict}: frequencies differ by {modes.disagreement:.1e} at most")
    if modes.floquet is not None:
        lines.append(f"  {floquet_sentence(modes.floquet)}")
    return [*lines, *(f"  {note}" for note in modes.notes)]


def _state_lines(modes: LinearModes, i: int) -> list[str]:
    state = "at rest" if modes.kind == REST else f"at {modes.speeds[i]:.4g} rad/s without gravity"
    if modes.messages[i]:
        return [f"  {state}: {modes.messages[i]}"]
    lines = [f"  {state}"]
    columns = (modes.undamped_frequencies, modes.damped_frequencies, modes.damping_ratios, modes.growth_rates)
    for name, undamped, damped, ratio, growth in zip(modes.names, *(column[i] for column in columns), strict=True):
        if not math.isfinite(undamped):
            lines.append(f"    {name:18} grows without oscillating, {growth:.5g} 1/s")
            continue
        shown = f", damping ratio {ratio:.4g}" if math.isfinite(ratio) and abs(ratio) > 1e-12 else ""
        lines.append(
            f"    {name:18} {undamped:12.7g} rad/s {undamped / (2 * math.pi):12.7g} Hz, damped {damped:.7g}{shown}"
        )
    return lines


def floquet_sentence(table: FloquetTable) -> str:
    """At how many speeds the motion under gravity is stable."""
    counts = [int(np.count_nonzero(table.stable == code)) for code in (1, 0, -1)]
    parts = [
        f"{n} {what}" for n, what in zip(counts, ("stable", "unstable", "without a periodic motion"), strict=True) if n
    ]
    return f"turning under gravity, {len(table.speeds)} speeds: {', '.join(parts)}"


def _number(value: float) -> float | None:
    """None for what JSON has no number for."""
    return float(value) if math.isfinite(value) else None
