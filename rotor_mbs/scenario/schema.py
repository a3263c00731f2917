"""The scene file as pydantic models: which keys there are, and what each may hold. Knows no file and no line.

A field's `description` is what a message says is allowed. Fields are validated in the order in which they stand here,
and later ones are checked against what earlier ones settled (`Known`), so that one pass finds every fault.
Importing this module costs 0.2 s (pydantic): only `load` does, and only when a scene is loaded.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeVar

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator

from rotor_mbs.scenario import scene
from rotor_mbs.scenario.fields import Line, Number, PerBlade, Table, Vector, blades_named, counted, fault, known
from rotor_mbs.scenario.physics import is_rigid_body_inertia, torque_table_fault, values_per_sample

MAX_BLADES = 10_000
MAX_SAMPLES = 10_000_000
MAX_SAMPLE_BYTES = 2 << 30
_PITCH_LEFT_OUT = "0 there: a pitch without inertia is left out of the model"

T = TypeVar("T")


class BladeTable(Table):
    """[blade] for all blades, or one of the [[blade]] tables."""

    mass: Number = Field(gt=0, description="a number above 0 (kg)")
    centre_of_mass: Vector = Field(description="three numbers x, y, z (m, blade frame)")
    inertia: list[Number] = Field(
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
            raise fault("no rigid body has this inertia")
        return inertia

    @field_validator("tip", mode="before")
    @classmethod
    def _is_there_where_wanted(cls, tip: object, info: ValidationInfo) -> object:
        if tip is None and known(info).wants_tip:
            raise fault("is missing")
        return tip

    def to_blade(self) -> scene.Blade:
        x, y, z = self.centre_of_mass
        tip_x, tip_y, tip_z = self.centre_of_mass if self.tip is None else self.tip
        xx, yy, zz, xy, xz, yz = self.inertia
        return scene.Blade(self.mass, (x, y, z), (xx, yy, zz, xy, xz, yz), (tip_x, tip_y, tip_z))


class HubTable(Table):
    """[hub]"""

    inertia: Number = Field(ge=0, description="a number of at least 0 (kg m² about the shaft)")


class ShaftTable(Table):
    """[shaft]"""

    damping: Number = Field(ge=0, description="a number of at least 0 (N m s/rad)")


class BearingTable(Table):
    """[bearing]: one number for every pitch bearing or, an extension of the contract, a list with one per blade."""

    stiffness: PerBlade = Field([0.0], description="a number of at least 0 (N m/rad), or a list with one per blade")
    damping: PerBlade = Field([0.0], description="a number of at least 0 (N m s/rad), or a list with one per blade")

    @field_validator("stiffness", "damping", mode="before")
    @classmethod
    def _has_one_per_blade(cls, value: object, info: ValidationInfo) -> object:
        blades = known(info).blades
        if isinstance(value, list) and blades is not None and len(value) != blades:
            raise fault(f"{counted(len(value), 'number')} in a list for {counted(blades, 'blade')}")
        return value

    @field_validator("stiffness", "damping")
    @classmethod
    def _acts_on_inertia(cls, value: list[float], info: ValidationInfo) -> list[float]:
        acted_on = [i for i in known(info).bare_pitches if value[i if len(value) > 1 else 0] != 0.0]
        if acted_on:
            raise fault(f"acts on {blades_named(acted_on)}, whose pitch has no inertia", _PITCH_LEFT_OUT)
        return value


def _as_rows(value: object) -> object:
    return value if isinstance(value, list) else [[0.0, value]]


class TorqueTable(Table):
    """[torque]: a constant is one row at t = 0, since a table is held outside its times."""

    rotor: Annotated[list[Annotated[list[Number], Field(min_length=2, max_length=2)]], BeforeValidator(_as_rows)] = (
        Field(
            min_length=1,
            description="a number (N m), or rows [t, torque] with t from 0 s upwards, at most two rows with one t",
        )
    )

    @field_validator("rotor")
    @classmethod
    def _goes_forward(cls, rows: list[list[float]]) -> list[list[float]]:
        wrong = torque_table_fault(rows)
        if wrong:
            raise fault(wrong)
        return rows


class InitialTable(Table):
    """[initial]"""

    angles: list[Number] = Field(description="1 + blades numbers (rad): rotor, then a pitch per blade")
    rates: list[Number] = Field(description="1 + blades numbers (rad/s): rotor, then a pitch per blade")

    @field_validator("angles", "rates", mode="before")
    @classmethod
    def _has_one_per_coordinate(cls, value: object, info: ValidationInfo) -> object:
        blades = known(info).blades
        if isinstance(value, list) and blades is not None and len(value) != 1 + blades:
            raise fault(f"{counted(len(value), 'number')} for a rotor and {counted(blades, 'blade')}")
        return value

    @field_validator("rates")
    @classmethod
    def _moves_what_has_inertia(cls, rates: list[float], info: ValidationInfo) -> list[float]:
        # Their number is not known to be right where `blades` is faulty, but then no pitch is known to be bare.
        moved = [i for i in known(info).bare_pitches if rates[1 + i] != 0.0]
        if moved:
            raise fault(f"a pitch rate for {blades_named(moved)}, whose pitch has no inertia", _PITCH_LEFT_OUT)
        return rates


class SceneTable(Table):
    """The whole file."""

    title: Line = Field(description="a text of 1 to 200 characters on one line")
    figures: list[Line] = Field([], description='texts, such as ["5", "7a"]')
    blades: int = Field(ge=1, le=MAX_BLADES, description=f"a whole number from 1 to {MAX_BLADES}")
    gravity: Number = Field(ge=0, description="a number of at least 0 (m/s², along -z)")
    duration: Number = Field(gt=0, description="a number above 0 (s)")
    outputs: list[Literal["angles", "rates", "tip", "energy"]] = Field(
        ["angles", "rates", "tip", "energy"],
        min_length=1,
        validate_default=True,
        description='some of "angles", "rates", "tip", "energy", each once',
    )
    samples: int = Field(ge=2, le=MAX_SAMPLES, description=f"a whole number from 2 to {MAX_SAMPLES}")
    blade: list[BladeTable] = Field(description="one [blade] table for all blades, or a [[blade]] table for each")
    hub: HubTable | None = Field(None, description="a table with inertia")
    bearing: BearingTable | None = Field(None, description="a table with stiffness, damping")
    shaft: ShaftTable | None = Field(None, description="a table with damping")
    torque: TorqueTable | None = Field(None, description="a table with rotor")
    initial: InitialTable = Field(description="a table with angles, rates")

    @field_validator("blades")
    @classmethod
    def _settle_blades(cls, blades: int, info: ValidationInfo) -> int:
        known(info).blades = blades
        return blades

    @field_validator("outputs")
    @classmethod
    def _settle_outputs(cls, outputs: list[str], info: ValidationInfo) -> list[str]:
        repeated = next((output for output in outputs if outputs.count(output) > 1), None)
        if repeated:
            raise fault(f'"{repeated}" stands there more than once')
        known(info).wants_tip = "tip" in outputs
        return outputs

    @field_validator("samples")
    @classmethod
    def _fit_in_memory(cls, samples: int, info: ValidationInfo) -> int:
        blades, outputs = info.data.get("blades"), info.data.get("outputs")
        if blades is None or outputs is None:
            return samples
        values = values_per_sample(blades, outputs)
        size = samples * values * 8
        if size > MAX_SAMPLE_BYTES:
            raise fault(
                f"{samples} samples of {values} values of 8 bytes are {size / 2**30:.4g} GiB",
                f"at most {MAX_SAMPLE_BYTES >> 30} GiB",
            )
        return samples

    @field_validator("blade", mode="before")
    @classmethod
    def _count_blade_tables(cls, value: object, info: ValidationInfo) -> object:
        blades = known(info).blades
        if isinstance(value, dict):
            return [value]
        if not isinstance(value, list):
            raise fault("{shown} is no table")
        if blades is not None and len(value) != blades:
            raise fault(f"{counted(len(value), '[[blade]] table')} for {counted(blades, 'blade')}")
        return value

    @field_validator("blade")
    @classmethod
    def _settle_bare_pitches(cls, tables: list[BladeTable], info: ValidationInfo) -> list[BladeTable]:
        settled = known(info)
        if settled.blades is not None:
            bare = _for_each([not table.to_blade().has_pitch_inertia for table in tables], settled.blades)
            settled.bare_pitches = tuple(i for i, is_bare in enumerate(bare) if is_bare)
        return tables

    def to_scene(self, name: str, text: str) -> scene.Scene:
        """The scene as plain numbers. What is zero throughout (torque, springs, dampers) is left out."""
        rows = self.torque.rotor if self.torque else []
        return scene.Scene(
            name=name,
            title=self.title,
            figures=tuple(self.figures),
            gravity=self.gravity,
            duration=self.duration,
            samples=self.samples,
            outputs=tuple(output for output in scene.OUTPUTS if output in self.outputs),
            blades=_for_each([table.to_blade() for table in self.blade], self.blades),
            hub_inertia=self.hub.inertia if self.hub else 0.0,
            initial_angles=tuple(self.initial.angles),
            initial_rates=tuple(self.initial.rates),
            rotor_torque=tuple((t, torque) for t, torque in rows) if any(torque for _, torque in rows) else (),
            bearing_stiffness=_unless_zero(self.bearing.stiffness, self.blades) if self.bearing else (),
            bearing_damping=_unless_zero(self.bearing.damping, self.blades) if self.bearing else (),
            shaft_damping=self.shaft.damping if self.shaft else 0.0,
            text=text,
        )


def _for_each(values: list[T], blades: int) -> tuple[T, ...]:
    """One value for every blade, from one for all or one for each."""
    return tuple(values) if len(values) == blades else tuple(values) * blades


def _unless_zero(values: list[float], blades: int) -> tuple[float, ...]:
    return _for_each(values, blades) if any(values) else ()
