"""Describe a scene as plain numbers: the rotor, what acts on it, and how it starts.

A scene is the only input of a model. Each key of the scene file is declared by one field of `Scene`
or `Blade`. The declaration determines how the key is read and written, its unit, its part in the
hash of the scene, and its name in a sweep.
"""

from __future__ import annotations

import copy
import dataclasses
import functools
import hashlib
import json
import math
import textwrap
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import Field, dataclass, fields
from itertools import pairwise
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from rotor_mbs.errors import InputError, PlausibilityWarning
from rotor_mbs.scenario import keys
from rotor_mbs.scenario.keys import (
    Kind,
    counted,
    file_key,
    invalid,
    list_of,
    read_each,
    restricted,
)
from rotor_mbs.scenario.time_table import (
    LoadTable,
    Segment,
    is_constant,
    is_one_table,
    kink_times,
    segments,
    value_at,
)
from rotor_mbs.scenario.toml_file import (
    KEY_FORM,
    KeyPath,
    KeyProblem,
    TableError,
    as_text,
    parse_key,
    parse_toml,
    plain_value,
    read_toml,
    shown_key,
    toml_lines,
    toml_value,
)

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


DEFAULT_OUTPUTS = ("angles", "rates", "tip", "energy")
OUTPUTS = (*DEFAULT_OUTPUTS, "loads")  # the built-in outputs
# Another package adds an output by an entry point in this group. The entry point has the name of
# the output.
ENTRY_POINT_GROUP = "rotor_mbs.quantities"

# The labels of all coordinates are one attribute of an HDF5 file, which has room for about 4,000.
MAX_BLADES = 1000
MAX_SAMPLES = 10_000_000
MAX_SAMPLE_BYTES = 2 << 30
MAX_CONE = 1.5  # rad
# Largest number of keys of a scene, and of entries of a list, that are shown on a screen.
_SHOWN_KEYS, _SHOWN_ENTRIES = 30, 6
# A second moment of mass may be negative by this share of the inertia's trace. A flat body has a
# second moment of zero, which is slightly negative if the inertia is typed with ten digits. The
# share is far above the round-off of the eigenvalues (1e-15).
INERTIA_TOLERANCE = 1e-9

# (values of a file by field) -> problems of the methods and settings among these values. A layer
# above checks them, because this layer does not know the methods.
ValuesCheck = Callable[[Mapping[str, Any]], list[KeyProblem]]

# What a field means to a run. label: texts, and the methods and settings to use; run: duration,
# samples and outputs; start: the initial state; rotor: parameters and loads.
FieldRole = Literal["label", "run", "start", "rotor"]


# Kinds of values


@functools.cache
def known_outputs() -> tuple[str, ...]:
    """Return the outputs that a scene may ask for: first the built-in ones, then the others.

    The others are those that packages add, sorted by name.
    """
    from importlib.metadata import entry_points

    added = {point.name for point in entry_points(group=ENTRY_POINT_GROUP)}
    return (*OUTPUTS, *sorted(added - set(OUTPUTS)))


def _read_outputs(value: object) -> tuple[str, ...]:
    """Return the outputs of a scene, in the order of `known_outputs`."""
    # Installed packages are searched only if an output is not built in.
    is_built_in = isinstance(value, list) and all(name in OUTPUTS for name in value)
    known = OUTPUTS if is_built_in else known_outputs()
    outputs = list_of(keys.choice(known), "").read(value)
    for output in outputs:
        if outputs.count(output) > 1:
            raise invalid(f'"{output}" is given more than once')
    built_in = [output for output in OUTPUTS if output in outputs]
    return (*built_in, *sorted(set(outputs) - set(OUTPUTS)))


def is_rigid_body_inertia(inertia: Sequence[float]) -> bool:
    """Return whether a rigid body can have this inertia.

    The matrix of the second moments of mass, ½ tr(J) I - J, must be positive semidefinite, as no
    mass is negative. The principal moments then fulfil the triangle inequality.

    Parameters
    ----------
    inertia : elements xx yy zz xy xz yz of the tensor J about the centre of mass, kg m².
    """
    if not any(inertia):
        return True
    import numpy as np  # not at the top: a point mass does not need it

    xx, yy, zz, xy, xz, yz = inertia
    if min(xx, yy, zz) < 0.0:
        return False
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) / max(map(abs, inertia))
    trace = float(np.trace(J))
    second_moments = 0.5 * trace * np.eye(3) - J
    return bool(np.linalg.eigvalsh(second_moments)[0] >= -INERTIA_TOLERANCE * trace)


def _read_load(value: object) -> LoadTable:
    """Return a load as a table over time with rows (time, value).

    The table of a load that is zero at all times is ().

    Parameters
    ----------
    value : a constant, or a list of rows [time in s, value].

    Raises
    ------
    TableError
        If the value is neither, a time is negative or less than the time of the row before it, or
        three rows have the same time.
    """
    if not isinstance(value, list):
        constant = keys.SIZE.read(value)
        return ((0.0, constant),) if constant else ()
    rows: LoadTable = list_of(list_of(keys.SIZE, "", 2, 2), "", 1).read(value)
    times = [time for time, _ in rows]
    if times[0] < 0.0:
        raise invalid("the first time is below 0")
    for before, time in pairwise(times):
        if time < before:
            raise invalid(f"t = {time:g} comes after t = {before:g}")
    for time, after_next in zip(times, times[2:], strict=False):
        if time == after_next:
            raise invalid(f"three rows have t = {time:g}")
    return rows if any(value for _, value in rows) else ()


def _per_blade(kind: Kind) -> Kind:
    """Return the kind of a key that has one value for all pitch bearings, or a list with one each.

    The key is read as a tuple with an entry per blade, or as () if all entries are zero.

    Parameters
    ----------
    kind : the kind of a single value.
    """

    def read(value: Any, scene: Mapping[str, Any]) -> tuple[Any, ...]:
        # If the number of blades is wrong, only that is reported, not what depends on it.
        count = scene.get("blade_count")
        if not isinstance(value, list) or (kind.over_time and value and is_one_table(value)):
            entries = (kind.read(value),) * (count or 1)
        elif count is not None and len(value) != count:
            numbers = counted(len(value), "number")
            raise invalid(f"{numbers} in a list for {counted(count, 'blade')}")
        else:
            entries = read_each(kind.read, value)
        _check_bare_pitches("acts on", entries, scene)
        return entries if any(entries) else ()

    return Kind(
        read,
        f"{kind.allowed}; or a list, one per blade",
        in_context=True,
        per_blade=True,
        over_time=kind.over_time,
    )


def _read_angles(value: object, scene: Mapping[str, Any]) -> tuple[float, ...]:
    """Return the initial angles or rates: the rotor's, then one for each pitch.

    Parameters
    ----------
    value : the list of numbers in the file.
    scene : values of the earlier keys by field.
    """
    count = scene.get("blade_count")
    if isinstance(value, list) and count is not None and len(value) != 1 + count:
        raise invalid(f"{counted(len(value), 'number')} for a rotor and {counted(count, 'blade')}")
    numbers: tuple[float, ...] = list_of(keys.NUMBER, "").read(value)
    return numbers


def _read_rates(value: object, scene: Mapping[str, Any]) -> tuple[float, ...]:
    """Return the initial rates. Raises TableError if a pitch without inertia has a rate."""
    rates = _read_angles(value, scene)
    _check_bare_pitches("a pitch rate for", rates[1:], scene)
    return rates


def _check_bare_pitches(what: str, entries: Sequence[Any], scene: Mapping[str, Any]) -> None:
    """Raise TableError if an entry is not zero for a blade without pitch inertia.

    Parameters
    ----------
    what : words of the message before the numbers of the blades: "acts on", "a pitch rate for".
    entries : one entry per blade.
    scene : values of the earlier keys by field. If the blades are not among them, because they
        could not be read, nothing is checked.
    """
    if "blade_count" not in scene or "blades" not in scene:
        return
    bare = []
    for number, (blade, entry) in enumerate(zip(scene["blades"], entries, strict=True), 1):
        if entry and not blade.has_pitch_inertia:
            bare.append(number)
    if bare:
        blades = f"{len(bare)} blades (number {bare[0]} first)"
        if len(bare) <= 5:
            blades = f"blade{'s' if len(bare) > 1 else ''} {', '.join(map(str, bare))}"
        allowed = "0 there: a pitch without inertia is not a coordinate of the model"
        raise invalid(f"{what} {blades}, whose pitch has no inertia", allowed)


def _read_blades(value: object, scene: Mapping[str, Any]) -> tuple[Blade, ...]:
    """Return the blades, read from one [blade] table for all or a [[blade]] table for each.

    Parameters
    ----------
    value : a table, or a list of tables.
    scene : values of the earlier keys by field.

    Raises
    ------
    TableError
        If a table is wrong, or the number of tables in a list is not the number of blades.
    """

    def read_blade(table: object) -> Blade:
        if not isinstance(table, dict):
            raise invalid(f"{as_text(table)} is not a table")
        missing = []
        if "tip" not in table and "tip" in scene.get("outputs", ()):
            missing.append(KeyProblem(("tip",), "is missing", BLADE_KEYS["tip"]["allowed"]))
        values = keys.read_keys(BLADE_KEYS, table, lambda _: missing)
        # If no output needs the tip, any point of the blade can stand for it.
        values["tip"] = values["tip"] or values["centre_of_mass"]
        return Blade(**values)

    count = scene.get("blade_count")
    if not isinstance(value, list):
        return (read_blade(value),) * (count or 1)
    if count is not None and len(value) != count:
        raise invalid(f"{counted(len(value), '[[blade]] table')} for {counted(count, 'blade')}")
    return read_each(read_blade, value)


OUTPUT_NAMES = Kind(
    _read_outputs,
    "any of angles, rates, tip, energy, loads, outputs of packages",
)
_OUTPUTS = restricted(OUTPUT_NAMES, bool, OUTPUT_NAMES.allowed, "0 entries")
_POINT = list_of(keys.SIZE, "three numbers x, y, z{unit}, blade frame", 3, 3)
_NOT_RIGID = "a principal moment is negative, or above the sum of the others"
_INERTIA = restricted(
    list_of(keys.SIZE, "", 6, 6),
    is_rigid_body_inertia,
    "six numbers xx yy zz xy xz yz{unit} that a rigid body can have",
    f"no rigid body has this inertia: {_NOT_RIGID}",
)


def _read_lean(most: float, value: object) -> float:
    """Return the angle of a tilt or cone, from -most to most, rad.

    Raises TableError for other angles. If the number would be allowed in degrees, the message says
    how to write degrees.
    """
    angle: float = keys.SIZE.read(value)
    if abs(angle) <= most:
        return angle
    advice = _degrees_meant(angle) if math.radians(abs(angle)) <= most else ""
    raise invalid(f"{as_text(value)} is out of range{advice}")


_TILT = Kind(functools.partial(_read_lean, 0.5 * math.pi), "a number{unit} from -pi/2 to pi/2")
# The limit is below a right angle, at which the pitch axis would lie on the shaft.
_CONE = Kind(
    functools.partial(_read_lean, MAX_CONE), f"a number{{unit}} from -{MAX_CONE:g} to {MAX_CONE:g}"
)
_LOAD = Kind(_read_load, "a number{unit}, or rows [t, number] with t >= 0 s", over_time=True)
_ANGLES = Kind(
    _read_angles,
    "1 + blades numbers{unit}: rotor, then a pitch per blade",
    in_context=True,
)
_RATES = Kind(_read_rates, _ANGLES.allowed, in_context=True)
_BLADES = Kind(
    _read_blades,
    "one [blade] table for all blades, or a [[blade]] table for each",
    in_context=True,
)
_METHODS = list_of(keys.TEXT, "a list of methods, as in `rotor-mbs list`")
_SETTINGS = keys.dict_of(
    keys.NUMBER_OR_TEXT,
    "a table of settings of the methods, such as step = 1e-3",
)


# The scene


@dataclass(frozen=True, slots=True)
class Blade:
    """A rigid blade in its own frame, with the origin at the apex and z along the pitch axis.

    The apex is the point where all pitch axes meet the shaft.

    Attributes
    ----------
    mass : kg.
    centre_of_mass : (3,) m.
    inertia : elements xx yy zz xy xz yz of the tensor about the centre of mass, kg m², where the
        element xy is -∫xy dm.
    tip : (3,) m, the point whose path is stored.
    cone : rad, angle between the pitch axis and the plane that is normal to the shaft at the apex.
        If it is positive, the pitch axis leans towards the +y end of the shaft.
    """

    mass: float = file_key("mass", keys.POSITIVE, "kg")
    centre_of_mass: tuple[float, float, float] = file_key(
        "centre_of_mass",
        _POINT,
        "m",
        ": z along the pitch axis",
    )
    inertia: tuple[float, float, float, float, float, float] = file_key(
        "inertia",
        _INERTIA,
        "kg m^2",
        optional=(0.0,) * 6,
    )
    tip: tuple[float, float, float] = file_key(
        "tip",
        _POINT,
        "m",
        ', needed for the output "tip"',
        optional=(),
    )
    cone: float = file_key(
        "cone",
        _CONE,
        "rad",
        ": the pitch axis leans towards +y",
        default=0.0,
        added=True,
    )

    @property
    def is_point_mass(self) -> bool:
        """Return whether the blade has no inertia about its centre of mass."""
        return not any(self.inertia)

    @property
    def inertia_tensor(self) -> NDArray[np.float64]:
        """Return the inertia tensor about the centre of mass, (3, 3) kg m²."""
        import numpy as np  # not at the top: reading a scene does not need it

        xx, yy, zz, xy, xz, yz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def inertia_about_apex(self, number: Callable[[float], Any] = float) -> tuple[Any, ...]:
        """Return the inertia tensor about the apex, where the pitch axis meets the shaft.

        Parameters
        ----------
        number : type of the numbers to compute with: float, or Fraction for exact elements.

        Returns
        -------
        tuple
            Elements xx yy zz xy xz yz of the tensor J_com + m (r·r I - r rᵀ), kg m², in the blade
            frame. The moment of inertia about the pitch axis is zz. For a blade without cone at
            the pitch θ, the moment of inertia about the shaft is
            xx sin²θ + yy cos²θ + 2 xy sin θ cos θ.
        """
        m = number(self.mass)
        x, y, z = map(number, self.centre_of_mass)
        xx, yy, zz, xy, xz, yz = map(number, self.inertia)
        return (
            xx + m * (y * y + z * z),
            yy + m * (x * x + z * z),
            zz + m * (x * x + y * y),
            xy - m * x * y,
            xz - m * x * z,
            yz - m * y * z,
        )

    @property
    def pitch_inertia(self) -> float:
        """Return the moment of inertia about the pitch axis (kg m²)."""
        zz: float = self.inertia_about_apex()[2]
        return zz

    @property
    def has_pitch_inertia(self) -> bool:
        """Return whether the moment of inertia about the pitch axis is not zero.

        The moment is exactly zero in the paper's Fig. 4b. A pitch without inertia is not a
        coordinate of the model.
        """
        x, y, _ = self.centre_of_mass
        return x != 0.0 or y != 0.0 or self.inertia[2] != 0.0


def _key(
    path: str,
    *declared: Any,
    role: FieldRole = "rotor",
    added: bool = False,
    **more: Any,
) -> Any:
    """Declare a field of `Scene` by `file_key`, with its role.

    Parameters
    ----------
    path, *declared, **more : arguments of `file_key`.
    role : what the field means to a run.
    added : whether the key was added to scenes after hashes had been stored. The hash leaves the
        key out if it has its default, so that these hashes are still valid.
    """
    return file_key(path, *declared, role=role, added=added, **more)


@dataclass(frozen=True, slots=True, repr=False)
class Scene:
    """A rotor with its loads and initial state.

    In the base frame z is up, and the shaft points along +y if it is not tilted. Blade i is mounted
    at 2π(i-1)/blades about the shaft. Its axes in the base frame are the columns of
    Rx(tilt) Ry(q + 2π(i-1)/blades) Rx(-cone_i) Rz(θ_i), where q is the rotor angle and θ_i the
    pitch.

    Attributes
    ----------
    name, title, figures : the name, a title in one line, and the paper's figures that show the
        scene.
    gravity : m/s², along -z.
    duration, samples : duration in s; number of equally spaced samples, both ends included.
    outputs : names of the groups of quantities that a run stores.
    blades : (blades,) `Blade`.
    hub_inertia, shaft_damping : kg m² about the shaft; N m s/rad.
    hub_radius : m, distance from the apex to each blade's root along its pitch axis. Root loads are
        given at this point.
    hub_mass : kg, at the apex; it changes only the loads of the shaft.
    shaft_tilt : rad, angle about x by which the +y end of the shaft is raised.
    initial_angles, initial_rates : (1 + blades,) rad, rad/s: rotor, then a pitch per blade.
    rotor_torque : table over time (see `time_table`), N m.
    pitch_torque : (blades,) tables over time, N m. The torque acts between hub and blade, and is
        positive in the direction of the pitch.
    bearing_stiffness, bearing_damping : (blades,) N m/rad, N m s/rad.
    bearing_rest : (blades,) tables over time, rad: pitch at which the bearing's spring is unloaded.
    methods, settings : methods that `run` uses, and their settings. If `methods` is (), `run`
        selects the methods.
    text : the TOML text from which the scene was read.

    Notes
    -----
    Torques, rest angles, stiffnesses and bearing dampings that are zero are stored as (). The
    constructor does not validate its arguments; `load_scene`, `parse_scene` and `replace` do.
    """

    name: str = _key("", keys.TEXT, role="label")
    title: str = _key("title", keys.LINE, role="label")
    figures: tuple[str, ...] = _key(
        "figures",
        list_of(keys.LINE, 'texts, such as ["5"]'),
        role="label",
        optional=(),
    )
    gravity: float = _key("gravity", keys.NOT_NEGATIVE, "m/s^2", ", along -z")
    duration: float = _key("duration", keys.POSITIVE, "s", role="run")
    samples: int = _key(
        "samples",
        keys.whole(2, MAX_SAMPLES),
        "1",
        ": equally spaced, both ends included",
        role="run",
    )
    outputs: tuple[str, ...] = _key("outputs", _OUTPUTS, role="run", optional=DEFAULT_OUTPUTS)
    blades: tuple[Blade, ...] = _key("blade", _BLADES)
    hub_inertia: float = _key(
        "hub.inertia",
        keys.NOT_NEGATIVE,
        "kg m^2",
        ", about the shaft",
        optional=0.0,
    )
    initial_angles: tuple[float, ...] = _key("initial.angles", _ANGLES, "rad", role="start")
    initial_rates: tuple[float, ...] = _key("initial.rates", _RATES, "rad/s", role="start")
    rotor_torque: tuple[tuple[float, float], ...] = _key("torque.rotor", _LOAD, "N m", default=())
    bearing_stiffness: tuple[float, ...] = _key(
        "bearing.stiffness",
        _per_blade(keys.NOT_NEGATIVE),
        "N m/rad",
        default=(),
    )
    bearing_damping: tuple[float, ...] = _key(
        "bearing.damping",
        _per_blade(keys.NOT_NEGATIVE),
        "N m s/rad",
        default=(),
    )
    shaft_damping: float = _key("shaft.damping", keys.NOT_NEGATIVE, "N m s/rad", default=0.0)
    pitch_torque: tuple[LoadTable, ...] = _key(
        "torque.pitch",
        _per_blade(_LOAD),
        "N m",
        default=(),
        added=True,
    )
    bearing_rest: tuple[LoadTable, ...] = _key(
        "bearing.rest",
        _per_blade(_LOAD),
        "rad",
        ": pitch at which the spring is unloaded",
        default=(),
        added=True,
    )
    hub_radius: float = _key(
        "hub.radius",
        keys.NOT_NEGATIVE,
        "m",
        ", from the apex to the blade roots: where root loads are given",
        default=0.0,
        added=True,
    )
    hub_mass: float = _key(
        "hub.mass",
        keys.NOT_NEGATIVE,
        "kg",
        ", at the apex: in the shaft's loads alone",
        default=0.0,
        added=True,
    )
    shaft_tilt: float = _key(
        "shaft.tilt",
        _TILT,
        "rad",
        ": the +y end of the shaft rises",
        default=0.0,
        added=True,
    )
    methods: tuple[str, ...] = _key("methods", _METHODS, role="label", default=())
    settings: tuple[tuple[str, float | str], ...] = _key(
        "settings",
        _SETTINGS,
        role="label",
        default=(),
    )
    text: str = _key("", keys.TEXT, role="label", default="")

    def __repr__(self) -> str:
        """Return the keys of the scene with units and values, shortened to fit on one screen."""
        lines = [f"{self.label}: {self.title}"]
        for key, unit, value in _short_keys(self):
            lines.append(f"  {key + (f', {unit}' if unit else ''):28} {value}".rstrip())
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        from html import escape  # not at the top: reading a scene does not need it

        rows = ""
        for cells in _short_keys(self):
            key, unit, value = map(escape, cells)
            rows += (
                f"<tr><th style='text-align:left'>{key}</th><td>{value}</td><td>{unit}</td></tr>"
            )
        return f"<table><caption>{escape(f'{self.label}: {self.title}')}</caption>{rows}</table>"

    @property
    def label(self) -> str:
        """Return the name, with the keys that were changed if the scene was a shipped one.

        An example is "paper/fig11, changed: blade.mass".
        """
        # Not at the top: the functions of the catalogue import this module.
        from rotor_mbs.scenario.catalogue import scene_label

        return scene_label(self)

    @property
    def phases(self) -> tuple[float, ...]:
        """Return the azimuths at which the blades are mounted, (blades,) rad."""
        return tuple(2.0 * math.pi * i / len(self.blades) for i in range(len(self.blades)))

    @property
    def has_tilt_or_cone(self) -> bool:
        """Return whether the shaft is tilted or a blade is coned."""
        return self.shaft_tilt != 0.0 or any(blade.cone for blade in self.blades)

    @property
    def has_torque(self) -> bool:
        """Return whether a torque acts on the rotor at some time."""
        return any(torque != 0.0 for _, torque in self.rotor_torque)

    @property
    def has_constant_torque(self) -> bool:
        """Return whether the torque on the rotor is the same at all times, or zero."""
        return is_constant(self.rotor_torque)

    @property
    def load_tables(self) -> tuple[LoadTable, ...]:
        """Return the loads over time: rotor torque, then torque and rest angle of each pitch.

        Constant loads are included.

        All code has the loads of a scene in this order. `time_table.torque_place` and `rest_place`
        return the place of a load in it.
        """
        return (self.rotor_torque, *(table for pair in self.pitch_loads for table in pair))

    @property
    def load_segments(self) -> tuple[Segment, ...]:
        """Return the segments of a run on which every load is linear.

        The loads of a segment are in the order of `load_tables`.
        """
        return segments(self.load_tables, self.duration)

    @property
    def kink_times(self) -> list[float]:
        """Return the times (s) within the run at which a load has a kink or a jump, increasing."""
        return kink_times(self.load_tables, self.duration)

    @property
    def has_constant_loads(self) -> bool:
        """Return whether no load changes over time."""
        return all(map(is_constant, self.load_tables))

    @property
    def has_damping(self) -> bool:
        """Return whether the shaft or a bearing has a damper."""
        return self.shaft_damping != 0.0 or any(self.bearing_damping)

    @property
    def work_needs_path(self) -> bool:
        """Return whether the work is requested and must be integrated along the path.

        The work of constant loads follows from the angles. The work of dampers, and of loads that
        change over time, does not.
        """
        return self.wants("energy") and (self.has_damping or not self.has_constant_loads)

    @property
    def coordinate_labels(self) -> tuple[str, ...]:
        """Return the labels of the coordinates, (1 + blades,): rotor, pitch 1, ..."""
        return coordinate_labels(len(self.blades))

    @property
    def moving_coordinates(self) -> list[int]:
        """Return the numbers of the coordinates with inertia: 0 (rotor), i for the pitch i."""
        pitches = [i for i, blade in enumerate(self.blades, 1) if blade.has_pitch_inertia]
        return [0, *pitches]

    @property
    def bearings(self) -> list[tuple[float, float]]:
        """Return stiffness (N m/rad) and damping (N m s/rad) of each pitch bearing."""
        none = (0.0,) * len(self.blades)
        return list(zip(self.bearing_stiffness or none, self.bearing_damping or none, strict=True))

    @property
    def dampings(self) -> tuple[float, ...]:
        """Return the damping of the shaft, then of each pitch bearing: (1 + blades,) N m s/rad."""
        return self.shaft_damping, *(damping for _, damping in self.bearings)

    @property
    def pitch_loads(self) -> list[tuple[LoadTable, LoadTable]]:
        """Return the torque (N m) and the rest angle (rad) of each pitch over time.

        If a bearing has no stiffness, its rest angle has no effect and is returned as ().
        """
        none: tuple[LoadTable, ...] = ((),) * len(self.blades)
        torques, rests = self.pitch_torque or none, self.bearing_rest or none
        loads = []
        for torque, rest, (stiffness, _) in zip(torques, rests, self.bearings, strict=True):
            loads.append((torque, rest if stiffness else ()))
        return loads

    @property
    def rotor_key(self) -> tuple[object, ...]:
        """Return the values of all fields whose role is "rotor": the parameters and the loads.

        Scenes that differ only in fields of other roles have equal keys.
        """
        return tuple(_rotor_values(self))

    def replace(self, **changes: Any) -> Scene:
        """Return a copy of the scene with some keys changed, validated like a scene file.

        Parameters
        ----------
        **changes
            Each keyword is a key of the scene file. Keys with dots or indices are passed as a dict,
            `**{"blade.mass": 1e4}`. Entries are counted from 0: `initial.angles[1]` is the pitch of
            blade 1. A value is a number, an expression in quotes, or a list (tuple, array), as in a
            scene file.

        Returns
        -------
        Scene
            The changed scene. Its `text` is written from its values.

        Raises
        ------
        InputError
            With a line for each error: the key, what is wrong, what is allowed, the most similar
            key.
        TypeError
            If a value cannot be in a file, such as None.

        Examples
        --------
        >>> import rotor_mbs.scenario.catalogue
        >>> scene = rotor_mbs.scenario.catalogue.find_scenes(["paper/fig11"])[0]
        >>> changes = {"initial.angles[1]": "pi/5", "blade.mass": 1e4}
        >>> scene.replace(gravity=9.81, **changes).blades[0].mass
        10000.0
        """
        tables = scene_tables(self)
        try:
            for path, value in changes.items():
                put_value(tables, parse_key(path), plain_value(value))
            changed = scene_from_tables(tables, self.name)
        except TableError as error:
            raise InputError(f"{self.name}: {problem}" for problem in error.problems) from error
        return dataclasses.replace(changed, text=scene_toml(changed))

    def wants(self, output: str) -> bool:
        """Return whether the scene asks for an output."""
        return output in self.outputs

    def torque_at(self, time: float) -> float:
        """Return the rotor torque (N m) at `time` (s); at a jump, the value after it."""
        return value_at(self.rotor_torque, keys.as_float(time))


def coordinate_labels(blades: int) -> tuple[str, ...]:
    """Return the labels of the coordinates of a rotor, given its number of blades."""
    return ("rotor", *(f"pitch {i + 1}" for i in range(blades)))


BLADE_KEYS = keys.declared_keys(Blade)
_FIELD_KEYS = keys.declared_keys(Scene)
_COUNT = file_key(
    "blades",
    keys.whole(1, MAX_BLADES),
    "1",
    ": blade i at 2 pi (i - 1)/blades about the shaft",
)
# The keys of each table are read in this order, those at the top of the file first. The template of
# `new_scene_text` has the same order. The number of blades is no field of `Scene`; it comes before
# the keys that depend on it.
SCENE_KEYS = {
    "title": _FIELD_KEYS["title"],
    "figures": _FIELD_KEYS["figures"],
    "blade_count": _COUNT.metadata,
    **_FIELD_KEYS,
}
_BY_PATH = {declared["key"]: declared for declared in SCENE_KEYS.values()} | {
    f"blade.{name}": declared for name, declared in BLADE_KEYS.items()
}


def scene_fields(*roles: FieldRole) -> Iterator[Field[Any]]:
    """Yield the fields of `Scene` that have one of the given roles."""
    return (field for field in fields(Scene) if field.metadata["role"] in roles)


_rotor_values = attrgetter(*(field.name for field in scene_fields("rotor")))


def scene_hash(scene: Scene) -> str:
    """Return the SHA-256, in hexadecimal, of the values of a scene that determine its results.

    The hash covers the numbers of the scene, bit for bit, and the outputs. It does not cover fields
    whose role is "label", nor the tip if its path is not an output.
    """
    content: dict[str, object] = {}
    for field in scene_fields("run", "start", "rotor"):
        value = getattr(scene, field.name)
        if field.name == "blades":
            content["blades"] = [_blade_numbers(blade, scene.wants("tip")) for blade in value]
        elif not (field.metadata["added"] and value == field.default):
            content[field.name] = sorted(value) if field.name == "outputs" else _exact(value)
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _blade_numbers(blade: Blade, with_tip: bool) -> list[object]:
    """Return the numbers of a blade that the hash of its scene covers."""
    numbers = []
    for name, declared in BLADE_KEYS.items():
        value = getattr(blade, name)
        is_default_of_added = declared.get("added", False) and value == declared["optional"]
        if is_default_of_added or (name == "tip" and not with_tip):
            continue
        # A single number, such as the mass, is put in a list, as it was for the stored hashes.
        numbers.append(_exact(value, listed=True))
    return numbers


def _exact(value: object, *, listed: bool = False) -> object:
    """Return a value with its floats as hexadecimal text, which shows every bit.

    Parameters
    ----------
    value : a single value, or a tuple of values.
    listed : whether a single value is put in a list.
    """
    if isinstance(value, tuple):
        return [_exact(entry) for entry in value]
    exact = value.hex() if isinstance(value, float) else value
    return [exact] if listed else exact


def values_per_sample(blades: int, outputs: Sequence[str]) -> int:
    """Return how many doubles a run has per sample, without the outputs of packages.

    Parameters
    ----------
    blades : number of blades.
    outputs : outputs of the scene. Time, angles and rates are counted in any case.
    """
    count = 1 + 2 * (1 + blades)  # time, angles, rates
    if "tip" in outputs:
        count += 3 * blades
    if "energy" in outputs:
        count += 4  # kinetic, potential, work, energy error
    if "loads" in outputs:
        # Force and moment at every root and at the shaft, moments of the pitch actuators.
        count += 6 * (1 + blades) + blades
    return count


# Files


def scene_from_tables(
    tables: Mapping[str, Any],
    name: str,
    text: str = "",
    check: ValuesCheck | None = None,
) -> Scene:
    """Return the scene that the tables of a scene file describe.

    Parameters
    ----------
    tables : content of the file by key.
    name, text : values of these two fields of the scene.
    check : further check of the values.

    Raises
    ------
    TableError
        With all errors of the tables.
    """

    def extra_check(values: Mapping[str, Any]) -> list[KeyProblem]:
        problems = check(values) if check else []
        if {"blade_count", "samples", "outputs"} <= values.keys():
            samples = values["samples"]
            per_sample = values_per_sample(values["blade_count"], values["outputs"])
            total = samples * per_sample * 8
            if total > MAX_SAMPLE_BYTES:
                size = f"{total / 2**30:.4g} GiB"
                what = f"{samples} samples of {per_sample} values of 8 bytes are {size}"
                allowed = f"at most {MAX_SAMPLE_BYTES >> 30} GiB"
                problems.append(KeyProblem(("samples",), what, allowed))
        return problems

    values = keys.read_keys(SCENE_KEYS, tables, extra_check)
    del values["blade_count"]
    values["settings"] = tuple(dict(values["settings"]).items())
    return Scene(name=name, text=text, **values)


def scene_tables(scene: Scene) -> dict[str, Any]:
    """Return the scene as tables of a scene file.

    A key is left out if its field has a default and is equal to it.

    Parameters
    ----------
    scene : the scene; its numbers are neither rounded nor formatted.
    """
    tables: dict[str, Any] = {"blades": len(scene.blades)}
    for field in fields(Scene):
        value = getattr(scene, field.name)
        if not field.metadata["key"] or value == field.default:
            continue
        table, _, name = field.metadata["key"].rpartition(".")
        written: Any
        if field.name == "blades":
            written = _blade_tables(scene)
        elif field.name == "settings":
            written = dict(value)
        elif field.metadata["kind"].per_blade and len(set(value)) == 1:
            written = _listed(value[0])
        elif field.metadata["kind"].per_blade:
            written = [_listed(entry) if entry != () else 0.0 for entry in value]
        else:
            written = _listed(value)
        entries = tables.setdefault(table, {}) if table else tables
        entries[name] = written
    return tables


def _blade_tables(scene: Scene) -> dict[str, Any] | list[dict[str, Any]]:
    """Return one table if all blades of a scene are equal, otherwise a table for each."""
    are_equal = len(set(scene.blades)) == 1
    written = []
    for blade in scene.blades[:1] if are_equal else scene.blades:
        table = {key: _listed(getattr(blade, key)) for key in BLADE_KEYS}
        # If a file has no tip, `_read_blades` sets the tip to the centre of mass. Such a tip is
        # left out.
        if blade.tip == blade.centre_of_mass and not scene.wants("tip"):
            del table["tip"]
        if not blade.cone:
            del table["cone"]
        written.append(table)
    return written[0] if are_equal else written


def scene_keys(scene: Scene) -> list[tuple[KeyPath, Any]]:
    """Return the path and the value of each key in the `scene_tables` of a scene.

    Parameters
    ----------
    scene : the scene.
    """
    found: list[tuple[KeyPath, Any]] = []

    def collect(value: Any, path: KeyPath) -> None:
        entries: Iterable[tuple[Any, Any]] = ()
        if isinstance(value, dict):
            entries = value.items()
        elif isinstance(value, list) and value and isinstance(value[0], dict):  # a table per blade
            entries = enumerate(value)
        else:
            found.append((path, value))
        for name, entry in entries:
            collect(entry, (*path, name))

    collect(scene_tables(scene), ())
    return found


class SceneChange(NamedTuple):
    """A key that has different values in two scenes.

    A value is None if the scene does not have the key. The text of a change is like
    "blade.mass 15000 -> 15010".
    """

    path: KeyPath
    before: Any
    after: Any

    @property
    def key(self) -> str:
        """Return the key as text, such as "initial.angles[1]"."""
        return shown_key(self.path)

    def __str__(self) -> str:
        return f"{self.key} {_exact_text(self.before)} -> {_exact_text(self.after)}"


def scene_changes(before: Scene, after: Scene) -> list[SceneChange]:
    """Return the differences of two scenes: a change for each key, or each entry of a list.

    Parameters
    ----------
    before, after : the scenes. Titles, figures, methods and settings are not compared. The tip is
        compared if both scenes store its path.
    """
    are_unequal = any(len(set(scene.blades)) > 1 for scene in (before, after))
    left_out = {field.metadata["key"] for field in scene_fields("label")}
    old, new = (_values_by_path(scene, each_blade=are_unequal) for scene in (before, after))
    changes: list[SceneChange] = []
    for path in dict.fromkeys((*old, *new)):
        is_unused_tip = path[0] == "blade" and path[-1] == "tip"
        is_unused_tip = is_unused_tip and not (before.wants("tip") and after.wants("tip"))
        if path[0] not in left_out and not is_unused_tip:
            changes += _entry_changes(path, old.get(path), new.get(path))
    return changes


def _values_by_path(scene: Scene, *, each_blade: bool) -> dict[KeyPath, Any]:
    """Return the values of a scene's keys by path, with constant loads as numbers.

    Parameters
    ----------
    scene : the scene.
    each_blade : whether each of several equal blades has its own paths, as unequal blades have.
    """
    values: dict[KeyPath, Any] = {}
    for path, value in scene_keys(scene):
        paths = [path]
        if each_blade and path[0] == "blade" and not isinstance(path[1], int):
            paths = [("blade", i, *path[1:]) for i in range(len(scene.blades))]
        for each in paths:
            values[each] = without_times(value)
    return values


def _entry_changes(path: KeyPath, before: Any, after: Any) -> Iterator[SceneChange]:
    """Yield the change of a value; for two lists of equal length, the change of each entry."""
    are_lists = isinstance(before, list) and isinstance(after, list) and len(before) == len(after)
    if are_lists and path != ("outputs",):
        for i, (old, new) in enumerate(zip(before, after, strict=True)):
            yield from _entry_changes((*path, i), old, new)
    elif before != after:
        yield SceneChange(path, before, after)


def _exact_text(value: Any) -> str:
    """Return a value as text: numbers with all digits, lists with at most six entries."""
    if value is None:
        return "none"
    if not isinstance(value, list):
        return str(value).removesuffix(".0")
    shown = [_exact_text(entry) for entry in value[:_SHOWN_ENTRIES]]
    if len(value) > _SHOWN_ENTRIES:
        shown.append(f"... {len(value) - _SHOWN_ENTRIES} more")
    return f"[{', '.join(shown)}]"


def without_times(value: Any) -> Any:
    """Return a value of a scene file, with the number in place of each table of one row."""
    match value:
        case [[float(), float() as number]]:
            return number
        case list():
            return [without_times(entry) for entry in value]
    return value


def _short_keys(scene: Scene) -> list[tuple[str, str, str]]:
    """Return the keys of a scene that a screen has room for, as rows of text: key, unit, value."""
    rows = []
    for path, value in scene_keys(scene):
        unit = unit_of(path)
        if path != ("title",) and value != []:
            rows.append(
                (shown_key(path), "" if unit == "1" else unit, _short_value(without_times(value)))
            )
    # The keys of unequal blades come last, as there may be hundreds of blades.
    rows.sort(key=lambda row: row[0].startswith("blade["))
    if len(rows) > _SHOWN_KEYS:
        rows[_SHOWN_KEYS:] = [(f"... {len(rows) - _SHOWN_KEYS} more keys", "", "")]
    return rows


def _short_value(value: Any) -> str:
    """Return a value as text: numbers with at most six digits, lists with at most six entries."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if not isinstance(value, list):
        return str(value)
    shown = [_short_value(entry) for entry in value[:_SHOWN_ENTRIES]]
    if len(value) > _SHOWN_ENTRIES:
        shown.append(f"... {len(value) - _SHOWN_ENTRIES} more")
    return f"[{', '.join(shown)}]"


def _listed(value: Any) -> Any:
    """Return a value with lists in place of tuples, as TOML has them."""
    return [_listed(entry) for entry in value] if isinstance(value, tuple) else value


def scene_toml(scene: Scene) -> str:
    """Return the text of a scene file with the scene's numbers bit for bit.

    Comments and expressions of the file from which the scene was read are not kept.
    """
    top, parts = {}, []
    for name, value in scene_tables(scene).items():
        if isinstance(value, dict):
            parts.append(f"[{name}]\n{toml_lines(value)}")
        elif name == "blade":
            parts += [f"[[{name}]]\n{toml_lines(table)}" for table in value]
        else:
            top[name] = value
    return "\n".join([toml_lines(top), *parts])


def unit_of(path: KeyPath) -> str:
    """Return the unit of the number at a path of a scene file; "1" if it has no unit."""
    declared = _BY_PATH.get(_names(path))
    if declared is None:
        return "1"
    kind = declared["kind"]
    row_depth = 5 if kind.per_blade else 4  # torque.rotor[row][0], torque.pitch[blade][row][0]
    if kind.over_time and len(path) == row_depth and path[-1] == 0:
        return "s"  # the time of a row
    return str(declared["unit"])


def _names(path: KeyPath) -> str:
    """Return the names in a path, joined by dots, without the numbers of list entries."""
    return ".".join(part for part in path if isinstance(part, str))


def put_value(tables: dict[str, Any], path: KeyPath, value: object) -> None:
    """Set a value in the tables of a scene file.

    Parameters
    ----------
    tables : tables of the file, which are changed. If they have one value for all blades, and the
        path names one blade, every blade first gets a copy of the value.
    path : path of the value. Whether a scene can have this key is not checked here.
    value : the value as a file would have it.

    Raises
    ------
    TableError
        If a list on the path has too few entries, or a value on the path is of the wrong type.
    """
    here: Any = tables  # a table or a list
    for depth, part in enumerate(path):
        is_right_type = isinstance(here, list if isinstance(part, int) else dict)
        if not is_right_type or (isinstance(part, int) and part >= len(here)):
            raise TableError([_no_such_entry(here, path, depth)])
        if depth == len(path) - 1:
            here[part] = value
            return
        inner = here[part] if isinstance(part, int) else here.get(part)
        following = path[depth + 1]
        if isinstance(following, int):
            inner = _as_list(tables, inner, path[: depth + 1], following)
        here[part] = {} if inner is None else inner
        here = here[part]


def _no_such_entry(container: Any, path: KeyPath, depth: int) -> KeyProblem:
    """Return the problem of a key path with an entry that does not exist.

    Parameters
    ----------
    container : the value at `path[:depth]`, which has no entry `path[depth]`.
    path : path of the key.
    depth : number of parts of the path that exist.
    """
    above, part = path[:depth], path[depth]
    if isinstance(container, list) and isinstance(part, int):
        name = shown_key(above)
        what, allowed = (
            f"has {len(container)} entries",
            f"{name}[0] to {name}[{len(container) - 1}]",
        )
        return KeyProblem(above, what, allowed, is_of_key=True)
    what, allowed = "is a single value", KEY_FORM
    if isinstance(container, dict):
        what = "is a table"
    elif isinstance(container, list):
        what = "is a list"
    if above == ("blade",):
        first = shown_key(("blade", 0, *path[depth:]))
        last = shown_key(("blade", len(container) - 1, *path[depth:]))
        allowed = f"{first} to {last}"
    return KeyProblem(above, what, allowed, is_of_key=True)


def _as_list(tables: Mapping[str, Any], value: Any, path: KeyPath, last: int) -> Any:
    """Return the value at a path as a list, of which one entry can be set.

    One value for all blades becomes a list with a copy for each blade. A missing value becomes a
    list of zeros. Any other value is returned as it is.

    Parameters
    ----------
    tables : tables of the scene file, which have the number of blades.
    value : value at the path; None if the key is missing.
    path : path of the value.
    last : number of the entry that is to be set.
    """
    count = tables.get("blades", 0)
    if path == ("blade",) and isinstance(value, dict):
        return [copy.deepcopy(value) for _ in range(count)]
    declared = _BY_PATH.get(_names(path))
    is_per_blade = declared is not None and declared["kind"].per_blade and isinstance(path[-1], str)
    if is_per_blade and (not isinstance(value, list) or is_one_table(value)):
        return [copy.deepcopy(0.0 if value is None else value) for _ in range(count)]
    # Whether a scene can have this list is checked later, when its keys are read.
    return [0.0] * (last + 1) if value is None else value


def load_scene(
    path: Path | str,
    name: str | None = None,
    check: ValuesCheck | None = None,
    stacklevel: int = 2,
) -> Scene:
    """Read a scene from a TOML file.

    Parameters
    ----------
    path : path of the file.
    name : name of the scene; by default the name of the file without its ending.
    check : further check of the values.
    stacklevel : argument of `warnings.warn`.

    Raises
    ------
    InputError
        With a line for each error: `file:line: key: what is wrong; allowed: ...`. Entries are
        counted from 0.

    Warns
    -----
    PlausibilityWarning
        For each number that looks like a mistake. Shipped scenes, whose names have a folder, are
        not checked for such numbers.
    """
    path = Path(path)
    name = path.stem if name is None else name
    file = read_toml(path)
    file.refuse_other_kind("a scene")
    with file.with_line_numbers():
        scene = scene_from_tables(file.tables, name, file.text, check)
    if "/" not in scene.name:
        for line in implausible_values(scene):
            warnings.warn(f"{file.source}: {line}", PlausibilityWarning, stacklevel)
    return scene


def parse_scene(text: str, name: str) -> Scene:
    """Return the scene that a TOML text describes; results are stored with such a text.

    Raises InputError with lines like those of `load_scene`, with `name` in place of the file.
    """
    file = parse_toml(text, name)
    with file.with_line_numbers():
        return scene_from_tables(file.tables, name, text)


_HEADER = """\
# A scene: a rotor, its loads and its start. SI units; angles in rad.
# Numbers may be arithmetic in quotes, "11*pi/12", with pi, sqrt(x), hypot(x, y) and deg(x).
"""
_EXAMPLE: dict[str, Any] = {
    "title": "My rotor",
    "blades": 3,
    "gravity": 9.81,
    "duration": 10.0,
    "samples": 1001,
    "blade.mass": 15000.0,
    "blade.centre_of_mass": [0.08, 0.0, 15.4],
    "blade.inertia": [0, 0, 0, 0, 0, 0],
    "blade.tip": [0.08, 0.0, 33.4],
    "initial.angles": ["deg(30)", 0, "pi/4", 0],
    "initial.rates": [0, 0, 0, 0],
    "torque.rotor": 1000.0,
}


_COMMENT_COLUMN = 34
_LAST_COLUMN = 117


def new_scene_text() -> str:
    """Return the text of a scene file from which users can start, with a comment on every key."""
    lines: dict[str, list[str]] = {"": _HEADER.splitlines(), "blade": []}  # lines of each table
    required = {"blade"}
    for path, declared in _BY_PATH.items():
        if path in ("blade", "settings"):  # these are tables
            continue
        table, _, name = path.rpartition(".")
        value = _EXAMPLE.get(path, declared.get("optional"))
        if value == () and declared["unit"] != "1":  # no load
            value = 0.0
        comment = declared["allowed"]
        if "optional" not in declared:
            required.add(table)
        elif table in ("", "blade"):  # other tables say so in the header
            comment = f"optional: {comment}"
        entry = f"{name} = {toml_value(value)}"
        lines.setdefault(table, []).extend(_commented(entry, comment))
    lines["settings"] = _commented("# step = 1e-3", SCENE_KEYS["settings"]["allowed"])
    parts = []
    for table, entries in lines.items():
        header = []
        if table:
            is_required = table in required
            header = [f"[{table}]"] if is_required else _commented(f"[{table}]", "optional")
        parts.append("\n".join([*header, *entries, ""]))
    return "\n".join(parts)


def _commented(entry: str, comment: str) -> list[str]:
    """Return the lines of an entry of a TOML file, with a wrapped comment at its right."""
    width = _LAST_COLUMN - max(_COMMENT_COLUMN, len(entry))
    first, *others = textwrap.wrap(comment, width)
    lines = [f"{entry:{_COMMENT_COLUMN}} # {first}"]
    for text in others:
        lines.append(f"{'':{_COMMENT_COLUMN}} # {text}")
    return lines


# Warnings of numbers that are allowed but implausible: perhaps degrees in place of radians,
# millimetres in place of metres, or tonnes in place of kilograms.

TURN = 2.0 * math.pi
MAX_RATE = 100.0  # rad/s, about a thousand revolutions per minute
# Distances of a blade's centre of mass and tip from the apex, m. The longest blades have 130 m.
MIN_DISTANCE, MAX_DISTANCE = 0.01, 300.0
MIN_MASS, MAX_MASS = 0.01, 1e6  # kg
MAX_LEAN = 0.5  # rad, tilt or cone; real rotors have about 0.1
USUAL_GRAVITY = (1.0, 30.0)  # m/s^2; the Moon has 1.6, Jupiter 25
KEYS_OF_LOADS = ("hub.radius", "hub.mass")  # keys that change only the loads, not the motion


def implausible_values(scene: Scene) -> list[str]:
    """Return a line for each number that looks like a mistake: key, value, what may be meant."""
    lines = _implausible_motion(scene)
    # Equal blades have one table.
    if len(set(scene.blades)) == 1:
        lines += _implausible_blade("blade", scene.blades[0])
    else:
        for i, blade in enumerate(scene.blades):
            lines += _implausible_blade(f"blade[{i}]", blade)
    if scene.gravity and not USUAL_GRAVITY[0] <= scene.gravity <= USUAL_GRAVITY[1]:
        lines.append(f"gravity: {scene.gravity:g} m/s^2; 9.81 is usual, 0 is none")
    return lines + _implausible_hub(scene)


def _implausible_hub(scene: Scene) -> list[str]:
    """Return a line for each number of hub and shaft that looks like a mistake."""
    lines = []
    if abs(scene.shaft_tilt) > MAX_LEAN:
        lines.append(f"shaft.tilt: {_as_wide_angle(scene.shaft_tilt)}")
    farthest = max(max(math.hypot(*blade.tip), blade.centre_of_mass[2]) for blade in scene.blades)
    if scene.hub_radius >= farthest:
        beyond = f"beyond the farthest point of a blade, {farthest:g} m"
        lines.append(f"hub.radius: {scene.hub_radius:g} m is {beyond}; is it in m?")
    if scene.hub_mass and not MIN_MASS <= scene.hub_mass <= MAX_MASS:
        lines.append(f"hub.mass: {scene.hub_mass:g} kg; is it in kg?")
    return lines


def _as_wide_angle(angle: float) -> str:
    """Return the warning of a tilt or cone (rad) that is far larger than in real rotors."""
    return f"{angle:g} rad are {math.degrees(angle):.3g} degrees{_degrees_meant(angle)}"


def _implausible_motion(scene: Scene) -> list[str]:
    """Return a line for each angle and rate in a scene that seems to be in degrees.

    Parameters
    ----------
    scene : the scene, with angles in rad and rates in rad/s.
    """
    lines = []
    # If one angle is more than a turn, the others that are whole numbers may be in degrees, too.
    in_degrees = any(abs(angle) > TURN for angle in scene.initial_angles)
    for i, angle in enumerate(scene.initial_angles):
        is_whole = abs(angle) >= 1.0 and angle == round(angle)
        if abs(angle) > TURN or (in_degrees and is_whole):
            lines.append(f"initial.angles[{i}]: {_as_degrees(angle)}")
    for i, (_, rests) in enumerate(scene.pitch_loads):
        rest = max((value for _, value in rests), key=abs, default=0.0)
        if abs(rest) > 0.5 * TURN:
            lines.append(f"bearing.rest[{i}]: {_as_degrees(rest)}")
    for i, rate in enumerate(scene.initial_rates):
        if abs(rate) > MAX_RATE:
            advice = _degrees_meant(rate, "degrees per second")
            lines.append(f"initial.rates[{i}]: {rate:g} rad/s{advice}")
    return lines


def _as_degrees(angle: float) -> str:
    """Return the warning of an angle (rad) that seems to be in degrees."""
    turns = round(abs(angle) / TURN, 1)
    return f"{angle:g} rad are {turns:.6g} turns{_degrees_meant(angle)}"


def _degrees_meant(number: float, unit: str = "degrees") -> str:
    """Return the advice to write deg(x), for a number that seems to be in degrees.

    The advice is "" if the number has more than six digits: the user has then computed it, by
    deg(x) or from pi.
    """
    if float(f"{number:.6g}") != number:
        return ""
    return f'; {unit}? write "deg({number:g})"'


def _implausible_blade(name: str, blade: Blade) -> list[str]:
    """Return a line for each number of a blade that looks like a mistake.

    Parameters
    ----------
    name : name of the blade in the lines, such as "blade[0]".
    blade : the blade, in SI units.
    """
    lines = []
    if not MIN_MASS <= blade.mass <= MAX_MASS:
        lines.append(f"{name}.mass: {blade.mass:g} kg; is it in kg?")
    for key, point in (("centre_of_mass", blade.centre_of_mass), ("tip", blade.tip)):
        distance = math.hypot(*point)
        if not MIN_DISTANCE <= distance <= MAX_DISTANCE:
            lines.append(f"{name}.{key}: {distance:g} m from the apex; is it in m?")
    # No mass is much farther from the apex than the tip. The radius of gyration, a mean distance of
    # the mass, is therefore not much larger, either.
    gyration = math.sqrt(max(blade.inertia[:3]) / blade.mass) if blade.mass else 0.0
    if gyration > 2.0 * math.hypot(*blade.tip):
        far = f"a radius of gyration of {gyration:.3g} m, far beyond the tip"
        lines.append(f"{name}.inertia: {far}; is it in kg m^2, mass in kg?")
    if abs(blade.cone) > MAX_LEAN:
        lines.append(f"{name}.cone: {_as_wide_angle(blade.cone)}")
    return lines
