"""What people mistake a scene or its equations for, and what changes when one of its numbers is off."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.closed_form import Accelerations
from rotor_mbs.models.lagrange.reference import LEFT_OUT, at_azimuths
from rotor_mbs.models.printed.derivation import Errata
from rotor_mbs.models.printed.methods import equations, point_mass_rotor
from rotor_mbs.scenario.catalogue import find_scenes, list_scenes
from rotor_mbs.scenario.scene import Blade, Scene, scene_fields
from rotor_mbs.solution.trajectory import Array

_GRAVITIES = (9.8, 9.80665, 9.81, 9.82, 10.0, 0.0)
_QUARTERS = {90: math.pi / 2.0, 180: math.pi, 270: -math.pi / 2.0}  # zeros that people choose, by degrees
_SAME_START = 1e-3  # rad, rad/s: a scene that starts farther off cannot be the one
_MOST_BLADES = 6  # that are tried one by one
_OF_BEARINGS = {  # fields of a scene with an entry per blade, and their keys
    "bearing_stiffness": "bearing.stiffness", "bearing_damping": "bearing.damping", "pitch_torque": "torque.pitch",
}  # fmt: skip


@dataclass(frozen=True)
class Model:
    """A scene, with its blades at other azimuths (rad), or with other equations."""

    scene: Scene
    azimuths: tuple[float, ...] | None = None
    equations: Accelerations | None = None

    def accelerations(self) -> Accelerations | None:
        """In place of the closed form's. Raises RotorError where the equations have no place for the scene."""
        return at_azimuths(self.scene, self.azimuths) if self.azimuths else self.equations


@dataclass(frozen=True)
class Parameter:
    """A number of the scene; unit: "" where its change is a share of it; change: (model, change) -> model."""

    key: str
    unit: str
    change: Callable[[Model, float], Model]


def other_models(scene: Scene) -> Iterator[tuple[str, Model]]:
    """In words, and the model."""
    for text, other in _scenes(scene):
        if other != scene:
            yield text, Model(other)
    for text, azimuths in _azimuths(scene):
        yield text, Model(scene, tuple(azimuths))
    for terms, reduced in LEFT_OUT.items():
        yield f"without the {terms}", Model(scene, equations=reduced)
    yield "small-angle approximation: sin x = x, cos x = 1", Model(scene, equations=_small_angles)
    # E3 is the power of a term that is zero without E2.
    for names in ("E1", "E2", "E1 and E2", "E2 and E3", "E1 and E2 and E3"):
        errata = Errata(*(name in names for name in ("E1", "E2", "E3")))
        printed = functools.partial(_printed, scene, errata)
        yield f"erratum {names} of the paper's equations", Model(scene, equations=printed)


def scenes_with_start(scene: Scene, first: Array) -> Iterator[tuple[str, Model]]:
    """Other scenes of the catalogue that start with a row, (2 (1 + blades),)."""
    for other in _catalogue():
        start = np.array([*other.initial_angles, *other.initial_rates])
        if other.name != scene.name and len(start) == len(first) and np.abs(start - first).max() < _SAME_START:
            yield f"the scene {other.name}", Model(other)


def _small_angles(angles: Any, rates: Any, form: Any, loads: Any, *_: Any) -> list[Any]:
    return closed_form.accelerations(angles, rates, form, loads, lambda x: x, lambda x: 1.0 + 0.0 * x)


def _printed(scene: Scene, errata: Errata, angles: Any, rates: Any, _form: Any, loads: Any, *_: Any) -> list[Any]:
    """Of (n,) arrays. Raises MethodRefusal for a scene that the printed equations have no place for."""
    accelerations = equations(point_mass_rotor("printed", errata, scene), errata)
    torques = [loads.rotor, *(loads.pitches or (0.0,) * (len(angles) - 1))]
    rows = np.broadcast_arrays(*torques, *angles, *rates)
    count = len(torques)
    columns = np.stack(rows).reshape(len(rows), -1).T.tolist()
    return list(np.array([accelerations(row[:count], row[count:]) for row in columns]).T)


def _scenes(scene: Scene) -> Iterator[tuple[str, Scene]]:
    """Some may be the scene itself."""
    for gravity in (*_GRAVITIES, -scene.gravity):
        yield f"gravity of {gravity:g} m/s^2", replace(scene, gravity=gravity)
    blades = scene.blades
    few = range(len(blades) if len(blades) <= _MOST_BLADES else 0)
    for text, others in {
        "blade mass on the pitch axis": [replace(b, centre_of_mass=(0.0, 0.0, b.centre_of_mass[2])) for b in blades],
        "blades without inertia, as point masses": [replace(b, inertia=_inertia([0.0] * 6)) for b in blades],
        "products of inertia with opposite sign": [
            replace(b, inertia=_inertia([*b.inertia[:3], *(-x for x in b.inertia[3:])])) for b in blades
        ],
        "tip used as centre of mass": [replace(b, centre_of_mass=b.tip) for b in blades],
        "inertia about the root used as inertia about the centre of mass": [_with_steiner(b) for b in blades],
        **{
            f"numbers of blades {i + 1} and {j + 1} exchanged": [blades[{i: j, j: i}.get(k, k)] for k in few]
            for i in few
            for j in range(i)
        },
    }.items():
        yield text, replace(scene, blades=tuple(others))
    for chosen, k in itertools.product([range(len(blades)), *((i,) for i in few if len(blades) > 1)], (0, 1)):
        number = f"[{chosen[0]}]" if len(chosen) < len(blades) else ""
        opposite = _scaled_at(scene, [("blades", b, "centre_of_mass", k) for b in chosen], -2.0)
        yield f"blade{number}.centre_of_mass[{k}] with opposite sign", opposite
    for name, key in _OF_BEARINGS.items():
        values = getattr(scene, name)
        for i, j in itertools.combinations(few if len(values) == len(blades) else (), 2):
            exchanged: dict[str, Any] = {name: tuple(values[{i: j, j: i}.get(k, k)] for k in range(len(values)))}
            yield f"{key} of blades {i + 1} and {j + 1} exchanged", replace(scene, **exchanged)
    for name, text in (
        ("rotor_torque", "the torque of the rotor"), ("bearing_stiffness", "the springs"),
        ("bearing_damping", "the dampers of the bearings"), ("shaft_damping", "the damper of the shaft"),
        ("hub_inertia", "the hub's inertia"),
    ):  # fmt: skip
        yield f"without {text}", _scaled_at(scene, [(name,)], -1.0)
    for degrees, angle in _QUARTERS.items():
        turned = _pitch_turned(scene, range(len(blades)), angle)
        yield f"pitch angles from another zero: {degrees} degrees where they are 0", turned


def _with_steiner(blade: Blade) -> Blade:
    """As if its inertia, which is about the root, were about the centre of mass: Steiner's share twice."""
    m, (x, y, z) = blade.mass, blade.centre_of_mass
    share = (m * (y * y + z * z), m * (x * x + z * z), m * (x * x + y * y), -m * x * y, -m * x * z, -m * y * z)
    return replace(blade, inertia=_inertia([a + b for a, b in zip(blade.inertia, share, strict=True)]))


def _inertia(values: Sequence[float]) -> tuple[float, float, float, float, float, float]:
    xx, yy, zz, xy, xz, yz = values
    return xx, yy, zz, xy, xz, yz


@functools.cache
def _catalogue() -> tuple[Scene, ...]:
    return tuple(find_scenes(sorted({name.partition("/")[0] for name, _ in list_scenes()})))


def _azimuths(scene: Scene) -> Iterator[tuple[str, Sequence[float]]]:
    """Blades at other angles about the shaft than they should be."""
    right, n = scene.phases, len(scene.blades)
    if n > 1:
        yield "all blades at the azimuth of blade 1", (0.0,) * n
        yield "azimuths of the blades in degrees taken as rad", [math.degrees(phase) for phase in right]
    if n > 2:
        yield "blades numbered in the opposite sense", (right[0], *right[:0:-1])
    for i in range(n if 2 < n <= _MOST_BLADES else 0):
        for other in ((i + 1) % n, (i - 1) % n):
            text = f"blade {i + 1} at an azimuth of {360 * other / n:g} degrees in place of {360 * i / n:g}"
            yield text, (*right[:i], right[other], *right[i + 1 :])
    others = {360.0 * i / n: phase for i, phase in enumerate(right) if i}
    for degrees, angle in (others | _QUARTERS).items():
        text = f"rotor angle from another zero: blade 1 at an azimuth of {degrees:g} degrees where it is 0"
        yield text, [phase + angle for phase in right]


def parameters(scene: Scene) -> Iterator[Parameter]:
    """Every number, or list of numbers, that is not zero, and the zeros of the angles; of all blades, and of each where
    there are a few."""
    for item in scene_fields("rotor"):
        key, value = item.metadata["key"], getattr(scene, item.name)
        if item.name != "blades" and _scaled(value, 1.0) != value:
            yield Parameter(key, "", _share_of([(item.name,)]))
    blades = range(len(scene.blades))
    alone = [[i] for i in blades] if 1 < len(blades) <= _MOST_BLADES else []
    for chosen in [list(blades), *alone]:
        number = f"{chosen}" if chosen in alone else ""
        for field in fields(Blade):
            value = getattr(scene.blades[chosen[0]], field.name)
            entries = [(i,) for i, x in enumerate(value) if x] if isinstance(value, tuple) else [()] * bool(value)
            for entry in entries if field.name != "tip" else []:
                paths = [("blades", b, field.name, *entry) for b in chosen]
                place = f"[{entry[0]}]" if entry else ""
                yield Parameter(f"blade{number}.{field.name}{place}", "", _share_of(paths))
        for name, key in _OF_BEARINGS.items() if number else ():
            values = getattr(scene, name)
            if len(values) == len(blades) and _scaled(values[chosen[0]], 1.0) != values[chosen[0]]:
                yield Parameter(f"{key}{number}", "", _share_of([(name, chosen[0])]))
        if any(scene.bearing_stiffness):
            yield Parameter(f"bearing.rest{number}", "rad", functools.partial(_rest_moved, chosen))
        which = f"blade {chosen[0] + 1}" if len(chosen) == 1 else "all blades"
        yield Parameter(f"azimuth of {which}", "rad", functools.partial(_azimuth_moved, chosen))
        yield Parameter(f"zero of the pitch of {which}", "rad", functools.partial(_zero_moved, chosen))


def _share_of(paths: Sequence[Sequence[str | int]]) -> Callable[[Model, float], Model]:
    return lambda model, change: replace(model, scene=_scaled_at(model.scene, paths, change))


def _azimuth_moved(chosen: Sequence[int], model: Model, change: float) -> Model:
    azimuths = model.azimuths or model.scene.phases
    return replace(model, azimuths=tuple(angle + change * (i in chosen) for i, angle in enumerate(azimuths)))


def _rest_moved(chosen: Sequence[int], model: Model, change: float) -> Model:
    rests = model.scene.bearing_rest or (((0.0, 0.0),),) * len(model.scene.blades)
    moved = tuple(
        tuple((t, angle + change) for t, angle in rest) if i in chosen else rest for i, rest in enumerate(rests)
    )
    return replace(model, scene=replace(model.scene, bearing_rest=moved))


def _zero_moved(chosen: Sequence[int], model: Model, change: float) -> Model:
    return replace(model, scene=_pitch_turned(model.scene, chosen, change))


def _pitch_turned(scene: Scene, chosen: Sequence[int], angle: float) -> Scene:
    """Chosen blades that are turned about the pitch axis where their pitch is 0."""
    s, c = math.sin(angle), math.cos(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    blades = list(scene.blades)
    for i in chosen:
        inertia = turn @ blades[i].inertia_tensor @ turn.T
        x, y, z = (turn @ blades[i].centre_of_mass).tolist()
        elements = _inertia(inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist())
        blades[i] = replace(blades[i], centre_of_mass=(x, y, z), inertia=elements)
    return replace(scene, blades=tuple(blades))


def _scaled_at(scene: Scene, paths: Sequence[Sequence[str | int]], share: float) -> Scene:
    """The scene with the values at some paths, of names of fields and numbers of entries, larger by a share."""

    def with_value(whole: Any, path: Sequence[str | int]) -> Any:
        if not path:
            return _scaled(whole, share)
        place, rest = path[0], path[1:]
        if isinstance(place, int):
            return (*whole[:place], with_value(whole[place], rest), *whole[place + 1 :])
        return replace(whole, **{place: with_value(getattr(whole, place), rest)})

    for path in paths:
        scene = with_value(scene, path)
    return scene


def _scaled(value: Any, share: float) -> Any:
    """Numbers larger by a share; of a table over time, not the times."""
    if not isinstance(value, tuple):
        return value * (1.0 + share) if isinstance(value, float) else value
    if value and all(isinstance(row, tuple) and len(row) == 2 and not isinstance(row[0], tuple) for row in value):
        return tuple((row[0], row[1] * (1.0 + share)) for row in value)
    return tuple(_scaled(entry, share) for entry in value)
