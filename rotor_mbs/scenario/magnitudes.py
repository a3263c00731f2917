"""Whether double precision can hold what follows from a scene's numbers: inertias, moments, energies, accelerations.

The numbers themselves may be up to 1e300; their products may not. What the initial state leads to is not looked at:
that is the outcome of a run. Every quantity here is a product of powers, so that
it is compared by its decimal exponent, which neither overflows nor underflows. Must not know models.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.scenario.time_table import Table
from rotor_mbs.scenario.toml_file import KeyPath, KeyProblem, TableError

# Decimal exponents: the product of any three quantities inside stays a normal double.
LARGEST, SMALLEST = 100.0, -100.0
# (key path, what follows from its number, decimal exponent, unit)
_Size = tuple[KeyPath, str, float, str]


class MagnitudeError(TableError):
    """Numbers of a scene from which follows what double precision cannot hold."""


def unrepresentable(scene: Scene) -> list[KeyProblem]:
    """An error for each quantity that follows from the scene and is beyond double precision; [] where none is."""
    found: dict[KeyPath, KeyProblem] = {}
    for path, name, exponent, unit in _upper(scene):
        if exponent > LARGEST:
            found.setdefault(path, _problem(path, name, exponent, unit, f"at most 1e{LARGEST:g}"))
    for path, name, exponent, unit in _lower(scene):
        if exponent < SMALLEST:
            found.setdefault(path, _problem(path, name, exponent, unit, f"0, or at least 1e{SMALLEST:g}"))
    return list(found.values())


def _problem(path: KeyPath, name: str, exponent: float, unit: str, allowed: str) -> KeyProblem:
    shown = ".".join(part for part in path if isinstance(part, str))
    size = f"10^{exponent:.0f} {unit}"
    return KeyProblem(path, f"{shown}: {name} of {size} is beyond double precision; allowed: {allowed} {unit}", False)


def _exponent(*factors: float) -> float:
    """log10 of the product's size; -inf where a factor is zero."""
    return sum(math.log10(abs(factor)) if factor else -math.inf for factor in factors)


def _largest(*values: float) -> float:
    return max(map(abs, values), default=0.0)


def _upper(scene: Scene) -> Iterator[_Size]:
    """What may be zero, but not too large."""
    inertia = _rotor_inertia(scene)
    yield ("gravity",), "an acceleration", _exponent(scene.gravity), "m/s^2"
    yield ("duration",), "a time", _exponent(scene.duration), "s"
    yield ("hub", "inertia"), "an inertia", _exponent(scene.hub_inertia), "kg m^2"
    yield ("shaft", "damping"), "a decay rate", _exponent(scene.shaft_damping) - min(inertia, 0.0), "1/s"
    yield from _of_torque(scene, inertia)
    several = len(set(scene.blades)) > 1
    bearings = map(scene.bearing, range(len(scene.blades)))
    different = {key: i for i, key in reversed(list(enumerate(zip(scene.blades, bearings, strict=True))))}
    for i in different.values():
        yield from _of_blade(scene, i, scene.blades[i], ("blade", i) if several else ("blade",))


def _of_torque(scene: Scene, inertia: float) -> Iterator[_Size]:
    torque = _exponent(_largest(*(value for _, value in scene.rotor_torque)))
    tables: dict[KeyPath, tuple[Table, str]] = {("torque", "rotor"): (scene.rotor_torque, "N m")}
    tables |= {("torque", "pitch", i): (table, "N m") for i, table in enumerate(scene.pitch_torque)}
    tables |= {("bearing", "rest", i): (table, "rad") for i, table in enumerate(scene.bearing_rest)}
    for path, (table, unit) in tables.items():
        yield path, "a value", _exponent(_largest(*(value for _, value in table))), unit
        for (t0, before), (t1, after) in itertools.pairwise(table):
            yield path, "a time", _exponent(t1), "s"
            if t1 > t0 and before != after:
                yield path, "a slope", _exponent(after - before) - _exponent(t1 - t0), f"{unit}/s"
    yield ("torque", "rotor"), "an acceleration", torque - min(inertia, 0.0), "rad/s^2"


def _of_blade(scene: Scene, i: int, blade: Blade, path: KeyPath) -> Iterator[_Size]:
    arm, offset = _largest(*blade.centre_of_mass), _largest(*blade.centre_of_mass[:2])
    yield (*path, "mass"), "a mass", _exponent(blade.mass), "kg"
    yield (*path, "tip"), "a distance", _exponent(_largest(*blade.tip)), "m"
    yield (*path, "centre_of_mass"), "an inertia", _exponent(blade.mass, arm, arm), "kg m^2"
    yield (*path, "inertia"), "an inertia", _exponent(_largest(*blade.inertia)), "kg m^2"
    yield (*path, "centre_of_mass"), "a moment of the weight", _exponent(blade.mass, arm, scene.gravity), "N m"
    if not blade.has_pitch_inertia:
        return
    inertia = _pitch_inertia(blade)
    moment = _exponent(blade.mass, offset, scene.gravity)
    yield (*path, "centre_of_mass"), "a pitch acceleration", moment - inertia, "rad/s^2"
    yield (*path, "centre_of_mass"), "a coupling of pitch and rotor", _coupling(blade) - inertia, "1"
    if scene.pitch_torque:
        largest = _largest(*(value for _, value in scene.pitch_torque[i]))
        yield ("torque", "pitch", i), "an acceleration", _exponent(largest) - min(inertia, 0.0), "rad/s^2"
    stiffness, damping = scene.bearing(i)
    own: KeyPath = (i,) if len(set(scene.bearing_stiffness + scene.bearing_damping)) > 1 else ()
    for key, value, unit in (("stiffness", stiffness, "1/s^2"), ("damping", damping, "1/s")):
        yield ("bearing", key, *own), "a share of the pitch inertia", _exponent(value) - min(inertia, 0.0), unit


def _lower(scene: Scene) -> Iterator[_Size]:
    """What must not be so small that it is lost; a quantity that is zero is left out."""
    yield ("duration",), "a time", _exponent(scene.duration), "s"
    inertia = _rotor_inertia(scene)
    if inertia > -math.inf:
        yield ("blade",), "a rotor inertia", inertia, "kg m^2"
    different = {blade: i for i, blade in reversed(list(enumerate(scene.blades)))}
    for blade, i in different.items():
        path: KeyPath = ("blade", i) if len(different) > 1 else ("blade",)
        yield (*path, "mass"), "a mass", _exponent(blade.mass), "kg"
        if blade.has_pitch_inertia:
            yield (*path, "centre_of_mass"), "a pitch inertia", _pitch_inertia(blade), "kg m^2"


def _rotor_inertia(scene: Scene) -> float:
    """Decimal exponent of the largest part of the inertia about the shaft, kg m²."""
    blades = dict.fromkeys(scene.blades)
    arms = [_exponent(one.mass, r, r) for one in blades for r in map(float, one.centre_of_mass)]
    return max(_exponent(scene.hub_inertia), *arms, *(_exponent(_largest(*one.inertia)) for one in blades))


def _pitch_inertia(blade: Blade) -> float:
    offset = _largest(*blade.centre_of_mass[:2])
    return max(_exponent(blade.mass, offset, offset), _exponent(blade.inertia[2]))


def _coupling(blade: Blade) -> float:
    """Decimal exponent of the largest product of inertia of pitch and rotor, kg m²."""
    offset = _largest(*blade.centre_of_mass[:2])
    return max(_exponent(blade.mass, offset, blade.centre_of_mass[2]), _exponent(_largest(*blade.inertia[3:])))
