"""The sweep file as pydantic models: which keys there are, and what each may hold. Knows no file and no line.

Importing this module costs 0.2 s (pydantic): it is imported only when a sweep is loaded.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from rotor_mbs.scenario.fields import Line, Number, Table, fault

MAX_COUNT = 10**15  # of values that a range may ask for; how many runs are too many is told where they are counted
VARIED = ("values", "linear", "log", "uniform", "normal", "sobol")
DRAWN = ("uniform", "normal", "sobol")

Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]


class RangeTable(Table):
    """`linear` or `log`: `count` values from `start` to `end`, both included."""

    start: Number = Field(description="a number, the first value")
    end: Number = Field(description="a number, the last value")
    count: int = Field(ge=2, le=MAX_COUNT, description="a whole number from 2 up")


class AxisTable(Table):
    """One [[axis]]: a key of the scene, and where its values come from."""

    key: Line = Field(description="the path of a number of the scene, such as initial.angles[1]")
    values: list[Number] | None = Field(None, min_length=1, description="a list of numbers")
    linear: RangeTable | None = Field(None, description="a table with start, end, count")
    log: RangeTable | None = Field(None, description="a table with start, end, count, both ends above 0")
    uniform: Pair | None = Field(None, description="two numbers [low, high]")
    normal: Pair | None = Field(None, description="two numbers [mean, standard deviation], the second one above 0")
    sobol: Pair | None = Field(None, description="two numbers [low, high]")

    @field_validator("log")
    @classmethod
    def _is_above_zero(cls, log: RangeTable | None) -> RangeTable | None:
        if log is not None and min(log.start, log.end) <= 0.0:
            raise fault("a logarithmic range reaches 0 or less")
        return log

    @field_validator("uniform", "sobol")
    @classmethod
    def _is_a_range(cls, pair: list[float] | None) -> list[float] | None:
        if pair is not None and not pair[0] < pair[1]:
            raise fault("the first number is not below the second")
        return pair

    @field_validator("normal")
    @classmethod
    def _has_a_spread(cls, pair: list[float] | None) -> list[float] | None:
        if pair is not None and not pair[1] > 0.0:
            raise fault("the standard deviation is not above 0")
        return pair

    @model_validator(mode="after")
    def _varies_in_one_way(self) -> AxisTable:
        given = [name for name in VARIED if getattr(self, name) is not None]
        if len(given) != 1:
            wrong = f"has {' and '.join(given)}" if given else "has no values"
            raise fault(wrong, f"exactly one of {', '.join(VARIED)}")
        return self


class SweepTable(Table):
    """The whole file."""

    title: Line = Field(description="a text of 1 to 200 characters on one line")
    scene: Line = Field(description="a shipped scene's name (paper/fig11), or a TOML file beside this one")
    methods: list[Line] = Field(["lagrange/taylor"], min_length=1, description="a list of methods, model/integrator")
    settings: dict[str, Number] = Field({}, description="a table of a method's settings, such as tolerance = 1e-15")
    change: dict[str, Number] = Field({}, description='a table of keys of the scene and numbers, "blade.mass" = 1e4')
    samples: int | None = Field(None, ge=2, description="a whole number from 2 up")
    outputs: list[Literal["angles", "rates", "tip", "energy"]] | None = Field(
        None, description='some of "angles", "rates", "tip", "energy", or none: metrics alone'
    )
    precision: Literal["float64", "float32"] = Field("float64", description='"float64" or "float32"')
    combine: Literal["grid", "zip"] = Field("grid", description='"grid" or "zip"')
    draws: int | None = Field(None, ge=1, le=MAX_COUNT, description="a whole number from 1 up, with random axes")
    seed: int = Field(0, ge=0, le=2**63 - 1, description="a whole number from 0 up")
    validation: Number | None = Field(None, gt=0, lt=1, description="a share between 0 and 1")
    file_bytes: Number = Field(4e9, ge=1e5, description="a number of at least 1e5, the most bytes of one file")
    picture: Literal["spread", "map"] | None = Field(None, description='"spread" or "map"')
    axis: list[AxisTable] = Field(min_length=1, description="one or more [[axis]] tables")

    @field_validator("axis")
    @classmethod
    def _names_each_key_once(cls, axes: list[AxisTable]) -> list[AxisTable]:
        keys = [axis.key for axis in axes]
        repeated = next((key for key in keys if keys.count(key) > 1), None)
        if repeated:
            raise fault(f"{repeated} is varied by more than one axis", "one [[axis]] for a key")
        return axes

    @field_validator("axis")
    @classmethod
    def _draws_where_random(cls, axes: list[AxisTable], info: ValidationInfo) -> list[AxisTable]:
        drawn = [axis.key for axis in axes if any(getattr(axis, name) is not None for name in DRAWN)]
        draws = info.data.get("draws")
        if drawn and draws is None and "draws" in info.data:
            raise fault(f"{drawn[0]} is random, and draws is missing", "draws = N at the top of the file")
        if draws is not None and not drawn:
            raise fault("draws is there, but no axis is random", f"draws with an axis of {', '.join(DRAWN)}")
        return axes
