"""The scene file and the bounds file as pydantic models: which keys there are, and what each may be.

Fields are validated in the order in which they stand here. Later ones are checked against what earlier ones left in
the validation's context (blades, outputs, bare_pitches), so that one pass finds every error. Must not know files.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from itertools import pairwise
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, field_validator

from rotor_mbs.errors import nearest
from rotor_mbs.scenario import scene
from rotor_mbs.scenario.accuracy_bounds import CHECKS
from rotor_mbs.scenario.time_table import Table as TimeTable
from rotor_mbs.scenario.time_table import is_one_table
from rotor_mbs.scenario.validation import (
    Line,
    NotNegative,
    NotNegativeSize,
    Number,
    Size,
    Table,
    Text,
    Vector,
    invalid,
)

MAX_BLADES = 10_000
MAX_SAMPLES = 10_000_000
MAX_SAMPLE_BYTES = 2 << 30
# Principal moments may break the triangle inequality by this share of their sum: numbers typed with ten digits do so
# for a flat body, whose inequality is an equality. It is far above the round-off of the eigenvalues (1e-15).
INERTIA_TOLERANCE = 1e-9
_PITCH_LEFT_OUT = "0 there: a pitch without inertia is left out of the model"

T = TypeVar("T")


def is_rigid_body_inertia(inertia: Sequence[float]) -> bool:
    """Whether some distribution of mass >= 0 has this tensor: xx yy zz xy xz yz about the centre of mass, kg m².

    That is so exactly where the second moments ∫r rᵀ dm = ½ tr(J) I - J are positive semidefinite: their eigenvalues
    are (J2 + J3 - J1)/2, so this is the triangle inequality of the principal moments, and it implies J >= 0.
    """
    if not any(inertia):
        return True
    import numpy as np  # late: a point mass, as in every scene of the paper, does without

    xx, yy, zz, xy, xz, yz = inertia
    if min(xx, yy, zz) < 0.0:
        return False
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) / max(abs(element) for element in inertia)
    trace = float(np.trace(J))
    return bool(np.linalg.eigvalsh(0.5 * trace * np.eye(3) - J)[0] >= -INERTIA_TOLERANCE * trace)


def values_per_sample(blades: int, outputs: Collection[str]) -> int:
    """Doubles that a run holds per sample: time, angles and rates always; tips, energies and loads where asked for."""
    energies = 4  # kinetic, potential, work, energy error
    loads = 6 * (1 + blades) + blades  # force and moment at every root and at the shaft, moments of the pitch actuators
    asked = 3 * blades * ("tip" in outputs) + energies * ("energy" in outputs) + loads * ("loads" in outputs)
    return 1 + 2 * (1 + blades) + asked


def _output(name: str) -> str:
    # Installed packages are searched only for what is not built in.
    if name not in scene.OUTPUTS and name not in scene.known_outputs():
        raise invalid("{shown} is not one of them" + nearest(name, list(scene.known_outputs())))
    return name


def _each_once(outputs: list[str]) -> list[str]:
    repeated = next((output for output in outputs if outputs.count(output) > 1), None)
    if repeated:
        raise invalid(f'"{repeated}" is given more than once')
    return outputs


Outputs = Annotated[list[Annotated[str, AfterValidator(_output)]], AfterValidator(_each_once)]
OUTPUTS_ALLOWED = 'some of "angles", "rates", "tip", "energy", "loads" and the outputs of installed packages, each once'


def counted(count: int, noun: str) -> str:
    """ "1 blade", "3 blades"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _context(info: ValidationInfo) -> dict[str, Any]:
    """What the keys validated so far have settled; an entry is missing where its key has an error."""
    return info.context if info.context is not None else {}


def _one_per_blade(value: object, info: ValidationInfo, others: int, link: str) -> object:
    """Checks the length of a list with a number for each blade and for `others` besides."""
    blades = _context(info).get("blades")
    if isinstance(value, list) and value and others == 0 and is_one_table(value):
        return value
    if isinstance(value, list) and blades is not None and len(value) != others + blades:
        raise invalid(f"{counted(len(value), 'number')} {link} {counted(blades, 'blade')}")
    return value


def _blades_named(indices: Sequence[int]) -> str:
    if len(indices) > 5:
        return f"{len(indices)} blades (number {indices[0] + 1} first)"
    return f"blade{'s' * (len(indices) > 1)} {', '.join(str(i + 1) for i in indices)}"


class BladeTable(Table):
    """[blade] for all blades, or one of the [[blade]] tables."""

    mass: Size = Field(gt=0, description="a number above 0 (kg)")
    centre_of_mass: Vector = Field(description="three numbers x, y, z (m, blade frame)")
    inertia: list[Size] = Field(
        [0.0] * 6,
        min_length=6,
        max_length=6,
        description="six numbers xx yy zz xy xz yz (kg m²) that a rigid body can have: positive semidefinite, "
        "no principal moment above the sum of the others",
    )
    tip: Vector | None = Field(
        None, validate_default=True, description='three numbers x, y, z (m, blade frame), needed for the output "tip"'
    )

    @field_validator("inertia")
    @classmethod
    def _is_of_a_rigid_body(cls, inertia: list[float]) -> list[float]:
        if not is_rigid_body_inertia(inertia):
            raise invalid("no rigid body has this inertia")
        return inertia

    @field_validator("tip", mode="before")
    @classmethod
    def _is_there_where_wanted(cls, tip: object, info: ValidationInfo) -> object:
        if tip is None and "tip" in _context(info).get("outputs", ()):
            raise invalid("is missing")
        return tip

    def to_blade(self) -> scene.Blade:
        x, y, z = self.centre_of_mass
        tip_x, tip_y, tip_z = self.centre_of_mass if self.tip is None else self.tip
        xx, yy, zz, xy, xz, yz = self.inertia
        return scene.Blade(self.mass, (x, y, z), (xx, yy, zz, xy, xz, yz), (tip_x, tip_y, tip_z))


class HubTable(Table):
    """[hub]"""

    inertia: NotNegativeSize = Field(description="a number of at least 0 (kg m² about the shaft)")


class ShaftTable(Table):
    """[shaft]"""

    damping: NotNegativeSize = Field(description="a number of at least 0 (N m s/rad)")


def _as_rows(value: object) -> object:
    """A constant as one row at t = 0, since a load is constant outside a table's times."""
    return value if isinstance(value, list) else [[0.0, value]]


def _checked_rows(rows: list[list[float]]) -> list[list[float]]:
    """The rows (t, value), [] where they are zero at all times. Raises where the times (s) go back.

    Two rows with one time are a jump.
    """
    times = [row[0] for row in rows]
    if times[0] < 0.0:
        raise invalid("the first time is below 0")
    for before, time in pairwise(times):
        if time < before:
            raise invalid(f"t = {time:g} comes after t = {before:g}")
    for time, after_next in zip(times, times[2:], strict=False):
        if time == after_next:
            raise invalid(f"three rows have t = {time:g}")
    return rows if any(value for _, value in rows) else []


def _as_list(value: object) -> object:
    return value if isinstance(value, list) else [value]


def _as_tables(value: object) -> object:
    """One table for all blades, or one for each, of a number, rows [t, value], or a list of numbers and rows."""
    if not isinstance(value, list) or is_one_table(value):
        return [_as_rows(value)]
    return [_as_rows(entry) for entry in value]


def _on_pitches_with_inertia(values: list[Any], info: ValidationInfo) -> list[Any]:
    """Raises where a number or a table that is not zero is for a blade without pitch inertia; one may be for all."""
    acted_on = [i for i in _context(info).get("bare_pitches", ()) if values[i if len(values) > 1 else 0]]
    if acted_on:
        raise invalid(f"acts on {_blades_named(acted_on)}, whose pitch has no inertia", _PITCH_LEFT_OUT)
    return values


_Row = Annotated[list[Size], Field(min_length=2, max_length=2)]
Rows = Annotated[list[_Row], Field(min_length=1), BeforeValidator(_as_rows), AfterValidator(_checked_rows)]
# Of validators that come before the type's own, the last one is the first.
_PITCHES = (
    BeforeValidator(lambda value, info: _one_per_blade(value, info, 0, "in a list for")),
    AfterValidator(_on_pitches_with_inertia),
)
Tables = Annotated[list[Rows], BeforeValidator(_as_tables), *_PITCHES]
PerBlade = Annotated[list[NotNegativeSize], BeforeValidator(_as_list), *_PITCHES]
_ROWS = "rows [t, {}] with t from 0 s upwards, at most two rows with one t"
_TABLES = "a number ({}), rows [t, {}] with t from 0 s upwards, or a list with one or the other for each blade"


class BearingTable(Table):
    """[bearing]: one value for every pitch bearing, or a list with one per blade."""

    stiffness: PerBlade = Field([0.0], description="a number of at least 0 (N m/rad), or a list with one per blade")
    damping: PerBlade = Field([0.0], description="a number of at least 0 (N m s/rad), or a list with one per blade")
    rest: Tables = Field([[]], description=_TABLES.format("rad", "angle"))


class TorqueTable(Table):
    """[torque]"""

    rotor: Rows = Field([], description=f"a number (N m), or {_ROWS.format('torque')}")
    pitch: Tables = Field([[]], description=_TABLES.format("N m", "torque"))


class InitialTable(Table):
    """[initial]"""

    angles: list[Number] = Field(description="1 + blades numbers (rad): rotor, then a pitch per blade")
    rates: list[Number] = Field(description="1 + blades numbers (rad/s): rotor, then a pitch per blade")

    @field_validator("angles", "rates", mode="before")
    @classmethod
    def _has_one_per_coordinate(cls, value: object, info: ValidationInfo) -> object:
        return _one_per_blade(value, info, 1, "for a rotor and")

    @field_validator("rates")
    @classmethod
    def _moves_what_has_inertia(cls, rates: list[float], info: ValidationInfo) -> list[float]:
        # Their number may be wrong where `blades` has an error, but then no pitch is known to be bare.
        moved = [i for i in _context(info).get("bare_pitches", ()) if rates[1 + i] != 0.0]
        if moved:
            raise invalid(f"a pitch rate for {_blades_named(moved)}, whose pitch has no inertia", _PITCH_LEFT_OUT)
        return rates


class SceneTable(Table):
    """The whole file."""

    title: Line = Field(description="a text of 1 to 200 characters on one line")
    figures: list[Line] = Field([], description='texts, such as ["5", "7a"]')
    blades: int = Field(ge=1, le=MAX_BLADES, description=f"a whole number from 1 to {MAX_BLADES}")
    gravity: NotNegativeSize = Field(description="a number of at least 0 (m/s², along -z)")
    duration: Size = Field(gt=0, description="a number above 0 (s)")
    outputs: Outputs = Field(
        list(scene.DEFAULT_OUTPUTS), min_length=1, validate_default=True, description=OUTPUTS_ALLOWED
    )
    samples: int = Field(ge=2, le=MAX_SAMPLES, description=f"a whole number from 2 to {MAX_SAMPLES}")
    blade: list[BladeTable] = Field(description="one [blade] table for all blades, or a [[blade]] table for each")
    hub: HubTable | None = Field(None, description="a table with inertia")
    bearing: BearingTable | None = Field(None, description="a table with stiffness, damping, rest")
    shaft: ShaftTable | None = Field(None, description="a table with damping")
    torque: TorqueTable | None = Field(None, description="a table with rotor, pitch")
    methods: list[Text] = Field([], description="names of methods, as `rotor-mbs list` has them")
    settings: dict[str, Number | Text] = Field({}, description="a table of methods' settings, such as step = 1e-3")
    initial: InitialTable = Field(description="a table with angles, rates")

    @field_validator("blades", "outputs")
    @classmethod
    def _note(cls, value: object, info: ValidationInfo) -> object:
        _context(info)[str(info.field_name)] = value
        return value

    @field_validator("samples")
    @classmethod
    def _fit_in_memory(cls, samples: int, info: ValidationInfo) -> int:
        blades, outputs = info.data.get("blades"), info.data.get("outputs")
        if blades is None or outputs is None:
            return samples
        values = values_per_sample(blades, outputs)
        size = samples * values * 8
        if size > MAX_SAMPLE_BYTES:
            raise invalid(
                f"{samples} samples of {values} values of 8 bytes are {size / 2**30:.4g} GiB",
                f"at most {MAX_SAMPLE_BYTES >> 30} GiB",
            )
        return samples

    @field_validator("blade", mode="before")
    @classmethod
    def _count_blade_tables(cls, value: object, info: ValidationInfo) -> object:
        blades = _context(info).get("blades")
        if isinstance(value, dict):
            return [value]
        if not isinstance(value, list):
            raise invalid("{shown} is not a table")
        if blades is not None and len(value) != blades:
            raise invalid(f"{counted(len(value), '[[blade]] table')} for {counted(blades, 'blade')}")
        return value

    @field_validator("blade")
    @classmethod
    def _note_bare_pitches(cls, tables: list[BladeTable], info: ValidationInfo) -> list[BladeTable]:
        context = _context(info)
        if "blades" in context:
            bare = _for_each([not table.to_blade().has_pitch_inertia for table in tables], context["blades"])
            context["bare_pitches"] = tuple(i for i, is_bare in enumerate(bare) if is_bare)
        return tables

    def to_scene(self, name: str, text: str) -> scene.Scene:
        """The scene as plain numbers. What is zero throughout (torque, springs, dampers) is left out."""
        return scene.Scene(
            name=name,
            title=self.title,
            figures=tuple(self.figures),
            gravity=self.gravity,
            duration=self.duration,
            samples=self.samples,
            outputs=_in_order(self.outputs),
            blades=_for_each([table.to_blade() for table in self.blade], self.blades),
            hub_inertia=self.hub.inertia if self.hub else 0.0,
            initial_angles=tuple(self.initial.angles),
            initial_rates=tuple(self.initial.rates),
            rotor_torque=_table(self.torque.rotor) if self.torque else (),
            bearing_stiffness=_unless_zero(self.bearing.stiffness, self.blades) if self.bearing else (),
            bearing_damping=_unless_zero(self.bearing.damping, self.blades) if self.bearing else (),
            shaft_damping=self.shaft.damping if self.shaft else 0.0,
            pitch_torque=_unless_zero(map(_table, self.torque.pitch), self.blades) if self.torque else (),
            bearing_rest=_unless_zero(map(_table, self.bearing.rest), self.blades) if self.bearing else (),
            methods=tuple(self.methods),
            settings=tuple(self.settings.items()),
            text=text,
        )


def _for_each(values: list[T], blades: int) -> tuple[T, ...]:
    """One value for every blade, from one for all or one for each."""
    return tuple(values) if len(values) == blades else tuple(values) * blades


def _unless_zero(values: Iterable[T], blades: int) -> tuple[T, ...]:
    """As `_for_each`; () where all are zero."""
    each = _for_each(list(values), blades)
    return each if any(each) else ()


def _table(rows: list[list[float]]) -> TimeTable:
    return tuple((time, value) for time, value in rows)


def _in_order(outputs: Collection[str]) -> tuple[str, ...]:
    """The built-in outputs in their order, then the others, sorted."""
    built_in = tuple(output for output in scene.OUTPUTS if output in outputs)
    return (*built_in, *sorted(set(outputs) - set(built_in)))


class BoundTable(Table):
    """One [[bound]] of a bounds file."""

    check: str = Field(description=f"one of {', '.join(CHECKS)}")
    method: Text = Field(description="a method or a pattern with *")
    value: NotNegative = Field(description="a number from 0 to 1e300")
    reason: Text = Field(description="a sentence")
    fault: NotNegative | None = Field(None, description="a number from 0 to 1e300")
    known_fault: Text | None = Field(None, description="a sentence")
    scenes: Text | None = Field(None, description="shipped scenes, patterns with |")

    @field_validator("check")
    @classmethod
    def _is_a_check(cls, check: str) -> str:
        if check not in CHECKS:
            raise invalid("{shown} is not one of them" + nearest(check, list(CHECKS)))
        return check


class BoundsTable(Table):
    """The whole bounds file."""

    bound: list[BoundTable] = Field(description="one or more [[bound]] tables")
