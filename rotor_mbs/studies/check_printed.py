"""The printed equations against the paper's own derivation, and the corrected derivation against the closed form.

At random states: an identity holds for all of them. Whether the printed equations are correct is not asked here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.closed_form import LoadValues
from rotor_mbs.models.lagrange.parameters import rotor_form
from rotor_mbs.models.printed import literal
from rotor_mbs.models.printed.derivation import DerivedRotor
from rotor_mbs.models.printed.entries import Entries, derived_entries, printed_entries, right_entries
from rotor_mbs.models.printed.errata import random_states
from rotor_mbs.models.printed.matrices import AS_PRINTED, CORRECTED, Errata
from rotor_mbs.scenario.scene import Blade, Scene

_SEED, _STATES = 2020, 5
_TORQUES = (1.7, -0.9, 0.6, 1.1)  # N m, with masses and lengths of order one


def differences() -> Iterator[tuple[str, float, str]]:
    """(channel, largest relative difference, what to look at) of every identity."""
    states = random_states(_SEED, _STATES)
    pairs = [(printed_entries(s.names), derived_entries(s, AS_PRINTED)) for s in states]
    yield "entries as printed", *_worst(pairs)
    yield "entries corrected", *_worst([(derived_entries(s, CORRECTED), right_entries(s)) for s in states])
    for blades in (1, 3):
        yield f"accelerations of {blades}", _accelerations(blades), "(33) or (39)-(56) against (24)-(38), errata in"
        look = "(24)-(38) without errata against the closed form"
        yield f"accelerations of {blades}, corrected", _corrected(blades), look
    yield "fixed pitch", _fixed_pitch(), "(33) with c = 0 against the closed form"


def _worst(pairs: list[tuple[Entries, Entries]]) -> tuple[float, str]:
    worst, where = 0.0, "every entry is what it was derived to be"
    for first, second in pairs:
        for key in {**first, **second}:
            a, b = float(first.get(key, 0.0)), float(second.get(key, 0.0))
            off = abs(a - b) / max(1.0, abs(a), abs(b))
            if not off <= worst:
                worst, where = off, f"{key[0]} {key[1]}: {a:.9g} against {b:.9g}"
    return worst, where


def _random(blades: int) -> list[tuple[list[float], list[float], tuple[float, float, float, float]]]:
    """(angles, rates, (m, c, d, g)) of order one."""
    rng = np.random.default_rng(_SEED + blades)
    return [
        (
            rng.uniform(-math.pi, math.pi, 1 + blades).tolist(),
            rng.uniform(-2.0, 2.0, 1 + blades).tolist(),
            tuple(rng.uniform(0.5, 2.0, 4).tolist()),
        )
        for _ in range(_STATES)
    ]


def _phases(blades: int) -> list[float]:
    return [2.0 * math.pi * i / blades for i in range(blades)]


def _accelerations(blades: int) -> float:
    torques = _TORQUES[: 1 + blades]
    text = literal.one_blade_accelerations if blades == 1 else literal.three_blade_accelerations
    found = []
    for angles, rates, constants in _random(blades):
        for gravity in (constants[3], 0.0):
            own = (*constants[:3], gravity)
            derived = DerivedRotor(*own, _phases(blades), AS_PRINTED).accelerations(torques, angles, rates)
            found.append(_off(text(*own, torques, [*angles, *rates]), derived))
    return float(np.max(found))  # NaN where one is


def _corrected(blades: int) -> float:
    """Each erratum that changes nothing by itself is left in: E3 where E2 is corrected."""
    found, torques = [], _TORQUES[: 1 + blades]
    for angles, rates, (m, c, d, g) in _random(blades):
        form = rotor_form(_scene(blades, m, c, d, g))
        exact = closed_form.accelerations(angles, rates, form, LoadValues(torques[0], torques[1:]), math.sin, math.cos)
        for errata in (CORRECTED, Errata(e1=False, e2=False, e3=True)):
            derived = DerivedRotor(m, c, d, g, _phases(blades), errata).accelerations(torques, angles, rates)
            found.append(_off(derived, exact))
    return float(np.max(found))  # NaN where one is


def _fixed_pitch() -> float:
    found = []
    for angles, rates, (m, _, d, g) in _random(3):
        for gravity in (g, 0.0):
            form = rotor_form(_scene(1, m, 0.0, d, gravity))
            exact = closed_form.accelerations(angles[:1], rates[:1], form, LoadValues(_TORQUES[0]), math.sin, math.cos)
            printed = literal.fixed_pitch_acceleration(m, d, gravity, _TORQUES[0], angles[0] - 0.7, [0.7])
            found.append(_off([printed], exact))
    return float(np.max(found))  # NaN where one is


def _scene(blades: int, m: float, c: float, d: float, g: float) -> Scene:
    blade = Blade(m, (c, 0.0, d), (0.0,) * 6, (c, 0.0, d))
    zero = (0.0,) * (1 + blades)
    return Scene("random", "", (), g, 1.0, 2, ("angles",), (blade,) * blades, 0.0, zero, zero)


def _off(found: object, expected: object) -> float:
    a, b = np.array(found, dtype=float), np.array(expected, dtype=float)
    return float(np.abs(a - b).max() / max(1.0, float(np.abs(b).max())))
