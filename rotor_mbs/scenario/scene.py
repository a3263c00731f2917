"""A scene as plain numbers: what every model gets, and all it gets. Must not know a model or a file format.

Each field of a scene says here which key of the scene file it comes from, its unit, and which part of a scene it is.
The scene's hash, its rotor key, the units of a sweep and the written scene file are derived from that.
"""

from __future__ import annotations

import functools
import hashlib
import json
import math
from collections.abc import Iterator
from dataclasses import Field, dataclass, field, fields
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Literal

from rotor_mbs.scenario.time_table import Table, is_constant, value_at

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

DEFAULT_OUTPUTS = ("angles", "rates", "tip", "energy")
OUTPUTS = (*DEFAULT_OUTPUTS, "loads")  # built in
ENTRY_POINT_GROUP = "rotor_mbs.quantities"  # a package adds the output that its entry point in this group is called

Part = Literal["label", "run", "start", "rotor"]


@functools.cache
def known_outputs() -> tuple[str, ...]:
    """The outputs that a scene may ask for: the built-in ones, then those of installed packages, sorted."""
    from importlib.metadata import entry_points

    added = {point.name for point in entry_points(group=ENTRY_POINT_GROUP)}
    return (*OUTPUTS, *sorted(added - set(OUTPUTS)))


def file_key(
    path: str,
    unit: str = "1",
    part: Part = "rotor",
    *,
    per_blade: bool = False,
    over_time: bool = False,
    added: bool = False,
) -> dict[str, Any]:
    """Metadata of a field of Scene that is read from the key `path` of the scene file ("" for none).

    part        label: no number of the scene; run: what is computed; start: initial state; rotor: parameters and loads
    per_blade   the file may have one value for all blades
    over_time   a value may be a table over time
    added       the key is younger than the stored hashes: at its default it does not enter them
    """
    return {"key": path, "unit": unit, "part": part, "per_blade": per_blade, "over_time": over_time, "added": added}


@dataclass(frozen=True, slots=True)
class Blade:
    """One rigid blade, in its own frame: origin on the shaft axis, z along the pitch axis.

    mass            kg, > 0
    centre_of_mass  (3,) m
    inertia         (6,) kg m², tensor elements xx yy zz xy xz yz about the centre of mass (xy = -∫xy dm)
    tip             (3,) m, the point whose path is drawn
    """

    mass: float = field(metadata={"unit": "kg"})
    centre_of_mass: tuple[float, float, float] = field(metadata={"unit": "m"})
    inertia: tuple[float, float, float, float, float, float] = field(metadata={"unit": "kg m^2"})
    tip: tuple[float, float, float] = field(metadata={"unit": "m"})

    @property
    def is_point_mass(self) -> bool:
        return not any(self.inertia)

    @property
    def inertia_tensor(self) -> NDArray[np.float64]:
        """(3, 3) kg m²."""
        import numpy as np  # late: a scene is read without it

        xx, yy, zz, xy, xz, yz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    @property
    def pitch_inertia(self) -> float:
        """kg m² about the pitch axis."""
        x, y, _ = self.centre_of_mass
        return self.inertia[2] + self.mass * (x * x + y * y)

    @property
    def has_pitch_inertia(self) -> bool:
        """Whether the blade resists pitching at all: Jzz about the pitch axis is not exactly zero (paper, Fig. 4b)."""
        x, y, _ = self.centre_of_mass
        return x != 0.0 or y != 0.0 or self.inertia[2] != 0.0


@dataclass(frozen=True, slots=True)
class Scene:
    """A rotor and what happens to it. Blade i hangs at phase 2π(i-1)/len(blades) about the shaft (+y); z is up.

    initial_angles, initial_rates   (1 + blades,) rad, rad/s: rotor, then a pitch per blade
    rotor_torque                    a table over time (see time_table), N m
    pitch_torque                    (blades,) tables over time, N m, between hub and blade; positive as the pitch is
    bearing_stiffness, _damping     (blades,) N m/rad, N m s/rad; of the pitch and of its rate
    bearing_rest                    (blades,) tables over time, rad: pitch at which the spring is unloaded
    shaft_damping                   N m s/rad
    methods, settings               by which methods `run` computes it, and with what in place of their defaults; () for
                                    what a rule and the methods say
    text                            the TOML text it was read from
    """

    name: str = field(metadata=file_key("", part="label"))
    title: str = field(metadata=file_key("title", part="label"))
    figures: tuple[str, ...] = field(metadata=file_key("figures", part="label"))
    gravity: float = field(metadata=file_key("gravity", "m/s^2"))
    duration: float = field(metadata=file_key("duration", "s", "run"))
    samples: int = field(metadata=file_key("samples", part="run"))
    outputs: tuple[str, ...] = field(metadata=file_key("outputs", part="run"))
    blades: tuple[Blade, ...] = field(metadata=file_key("blade"))
    hub_inertia: float = field(metadata=file_key("hub.inertia", "kg m^2"))
    initial_angles: tuple[float, ...] = field(metadata=file_key("initial.angles", "rad", "start"))
    initial_rates: tuple[float, ...] = field(metadata=file_key("initial.rates", "rad/s", "start"))
    rotor_torque: Table = field(default=(), metadata=file_key("torque.rotor", "N m", over_time=True))
    bearing_stiffness: tuple[float, ...] = field(
        default=(), metadata=file_key("bearing.stiffness", "N m/rad", per_blade=True)
    )
    bearing_damping: tuple[float, ...] = field(
        default=(), metadata=file_key("bearing.damping", "N m s/rad", per_blade=True)
    )
    shaft_damping: float = field(default=0.0, metadata=file_key("shaft.damping", "N m s/rad"))
    pitch_torque: tuple[Table, ...] = field(
        default=(), metadata=file_key("torque.pitch", "N m", per_blade=True, over_time=True, added=True)
    )
    bearing_rest: tuple[Table, ...] = field(
        default=(), metadata=file_key("bearing.rest", "rad", per_blade=True, over_time=True, added=True)
    )
    methods: tuple[str, ...] = field(default=(), metadata=file_key("methods", part="label"))
    settings: tuple[tuple[str, float | str], ...] = field(default=(), metadata=file_key("settings", part="label"))
    text: str = field(default="", metadata=file_key("", part="label"))

    @property
    def phases(self) -> tuple[float, ...]:
        """(blades,) rad: the angle about the shaft at which each blade is mounted."""
        return tuple(2.0 * math.pi * i / len(self.blades) for i in range(len(self.blades)))

    @property
    def has_torque(self) -> bool:
        return any(torque != 0.0 for _, torque in self.rotor_torque)

    @property
    def has_constant_torque(self) -> bool:
        return is_constant(self.rotor_torque)

    @property
    def load_tables(self) -> tuple[Table, ...]:
        """Everything that may change over time: rotor torque, then the torque and the rest angle of each pitch."""
        pitches = (self.pitch_load(blade) for blade in range(len(self.blades)))
        return (self.rotor_torque, *(table for pair in pitches for table in pair))

    @property
    def has_constant_loads(self) -> bool:
        return all(map(is_constant, self.load_tables))

    @property
    def has_damping(self) -> bool:
        return self.shaft_damping != 0.0 or any(self.bearing_damping)

    @property
    def work_needs_path(self) -> bool:
        """Whether the work has to be integrated along the path: it is exact for constant loads without dampers."""
        return self.has_damping or not self.has_constant_loads

    @property
    def coordinate_labels(self) -> tuple[str, ...]:
        return ("rotor", *(f"pitch {i + 1}" for i in range(len(self.blades))))

    @property
    def moving_coordinates(self) -> list[int]:
        """Columns of the angles that move: 0, the rotor, then 1 + i for each blade i whose pitch has inertia."""
        return [0, *(1 + i for i, blade in enumerate(self.blades) if blade.has_pitch_inertia)]

    def bearing(self, blade: int) -> tuple[float, float]:
        """Stiffness (N m/rad) and damping (N m s/rad) of the pitch bearing of a blade, counted from 0."""
        stiffness = self.bearing_stiffness[blade] if self.bearing_stiffness else 0.0
        return stiffness, self.bearing_damping[blade] if self.bearing_damping else 0.0

    @property
    def dampings(self) -> tuple[float, ...]:
        """(1 + blades,) N m s/rad: of the shaft, then of each pitch bearing."""
        return self.shaft_damping, *(self.bearing(i)[1] for i in range(len(self.blades)))

    def pitch_load(self, blade: int) -> tuple[Table, Table]:
        """Torque (N m) and rest angle (rad) over time of the pitch bearing of a blade, counted from 0.

        A spring without stiffness has no rest angle.
        """
        torque = self.pitch_torque[blade] if self.pitch_torque else ()
        return torque, self.bearing_rest[blade] if self.bearing_rest and self.bearing(blade)[0] else ()

    @property
    def rotor_key(self) -> tuple[object, ...]:
        """The rotor's parameters and loads: equal for scenes that differ in start, run or label alone."""
        return tuple(_rotor_values(self))

    def replace(self, **changes: Any) -> Scene:
        """A scene with other values at some keys of the scene file, validated like a file.

        A keyword is a key; one with dots or indices goes through a dict. Entries are counted from 0, so that
        `initial.angles[1]` is the pitch of blade 1. A value is what the file may have: a number, a quoted expression, a
        list (or tuple, or array). `text` is written anew from the numbers.

        Raises InputError with a line for each error: the key, what is wrong, what is allowed, the most similar key.

        >>> import rotor_mbs.scenario.catalogue
        >>> scene = rotor_mbs.scenario.catalogue.find_scenes(["paper/fig11"])[0]
        >>> scene.replace(gravity=9.81, **{"initial.angles[1]": "pi/5", "blade.mass": 1e4}).blades[0].mass
        10000.0
        """
        from rotor_mbs.scenario.variants import replaced_scene  # late: it builds scenes, and so imports this module

        return replaced_scene(self, changes)

    def wants(self, output: str) -> bool:
        return output in self.outputs

    def torque_at(self, time: float) -> float:
        """Rotor torque in N m at `time` in s; at a jump, the value after it."""
        return value_at(self.rotor_torque, time)


def scene_fields(*parts: Part) -> Iterator[Field[Any]]:
    """The dataclass fields of Scene that are of these parts, in order."""
    return (one for one in fields(Scene) if one.metadata["part"] in parts)


_rotor_values = attrgetter(*(one.name for one in scene_fields("rotor")))


def scene_hash(scene: Scene) -> str:
    """SHA-256, in hexadecimal, over all that a run of the scene depends on: its numbers, bit for bit, and outputs.

    Name, title, figures and the text of the file (comments, order, how a number was written, one [blade] or several
    equal ones) do not enter; neither does the tip where no tip path is asked for.
    """
    content: dict[str, object] = {}
    for one in scene_fields("run", "start", "rotor"):
        value = getattr(scene, one.name)
        if one.name == "blades":
            content["blades"] = [_blade_content(blade, with_tip=scene.wants("tip")) for blade in value]
        elif not (one.metadata["added"] and value == one.default):
            content[one.name] = sorted(value) if one.name == "outputs" else _exact(value)
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _blade_content(blade: Blade, *, with_tip: bool) -> list[object]:
    values = [getattr(blade, one.name) for one in fields(Blade) if with_tip or one.name != "tip"]
    return [_exact(value if isinstance(value, tuple) else (value,)) for value in values]


def _exact(value: object) -> object:
    """Doubles in hexadecimal, so that the text tells them apart bit for bit."""
    if isinstance(value, tuple):
        return [_exact(entry) for entry in value]
    return value.hex() if isinstance(value, float) else value
