"""A sweep file, read strictly: a Sweep, or every error of the file at once. Must not know methods or results files.

Importing this module costs 0.2 s (pydantic).
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from rotor_mbs.errors import InputError
from rotor_mbs.scenario.catalogue import list_scenes, only_scene, scenarios_folder, sweeps_folder
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.scene_file import scene_tables
from rotor_mbs.scenario.schema import OUTPUTS_ALLOWED, Outputs
from rotor_mbs.scenario.sweep_design import DRAWN, Axis, Design
from rotor_mbs.scenario.toml_file import KeyPath, TableError, find_lines, line_of, read_toml, shown_path, toml_lines
from rotor_mbs.scenario.validation import Line, Number, Table, invalid, validate_file
from rotor_mbs.scenario.variants import KEY_FORM, Variants, is_key, parse_key, unit_of

MAX_COUNT = 10**15  # values of a range; too many runs are reported where they are counted
MAX_ROWS = 10_000_000
VARIED = ("values", "linear", "log", *DRAWN)
_OF_ONE_SHAPE = ("blades", "samples", "duration")
# Keys whose rule is an interval of its own: if the ends of an axis keep it, all values between them do.
_INTERVALS = ("initial", "gravity", "hub", "shaft", "bearing")
_ROWS_AT_ONCE = 4096
_MAX_ROW_ERRORS = 20


def _varied_key(key: str) -> str:
    if not is_key(key):
        raise invalid("{shown} is not the path of a key", KEY_FORM)
    table = parse_key(key)[0]
    if table in _OF_ONE_SHAPE:
        raise invalid(f"all runs of a dataset share one {table}", "a sweep for each, or a key that keeps the shape")
    return key


def _rising(pair: list[float]) -> list[float]:
    if not pair[0] < pair[1]:
        raise invalid("the first number is not below the second")
    return pair


def _with_spread(pair: list[float]) -> list[float]:
    if not pair[1] > 0.0:
        raise invalid("the standard deviation is not above 0")
    return pair


Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]
Range = Annotated[Pair, AfterValidator(_rising)]
Normal = Annotated[Pair, AfterValidator(_with_spread)]


class RangeTable(Table):
    """`linear` or `log`: `count` values from `start` to `end`, both included."""

    start: Number = Field(description="a number, the first value")
    end: Number = Field(description="a number, the last value")
    count: int = Field(ge=2, le=MAX_COUNT, description="a whole number from 2 up")


class AxisTable(Table):
    """One [[axis]]: a key of the scene, and where its values come from."""

    key: Annotated[Line, AfterValidator(_varied_key)] = Field(description="the path of a number of the scene")
    values: list[Number] | None = Field(None, min_length=1, description="a list of numbers")
    linear: RangeTable | None = Field(None, description="a table with start, end, count")
    log: RangeTable | None = Field(None, description="a table with start, end, count, both ends above 0")
    uniform: Range | None = Field(None, description="two numbers [low, high]")
    normal: Normal | None = Field(None, description="two numbers [mean, standard deviation], the second one above 0")
    sobol: Range | None = Field(None, description="two numbers [low, high]")

    @field_validator("log")
    @classmethod
    def _is_above_zero(cls, log: RangeTable | None) -> RangeTable | None:
        if log is not None and min(log.start, log.end) <= 0.0:
            raise invalid("a logarithmic range reaches 0 or less")
        return log

    @model_validator(mode="after")
    def _varies_in_one_way(self) -> AxisTable:
        given = [name for name in VARIED if getattr(self, name) is not None]
        if len(given) != 1:
            wrong = f"has {' and '.join(given)}" if given else "has no values"
            raise invalid(wrong, f"exactly one of {', '.join(VARIED)}")
        return self


class SweepTable(Table):
    """The whole file."""

    title: Line = Field(description="a text of 1 to 200 characters on one line")
    scene: Line = Field(description="a shipped scene's name (paper/fig11), or a TOML file beside this one")
    methods: list[Line] = Field(["lagrange/taylor"], min_length=1, description="a list of methods, model/integrator")
    settings: dict[str, Number] = Field({}, description="a table of a method's settings, such as tolerance = 1e-15")
    change: dict[str, Number] = Field({}, description='a table of keys of the scene and numbers, "blade.mass" = 1e4')
    samples: int | None = Field(None, ge=2, description="a whole number from 2 up")
    outputs: Outputs | None = Field(None, description=f"{OUTPUTS_ALLOWED}, or none: metrics alone")
    precision: Literal["float64", "float32"] = Field("float64", description='"float64" or "float32"')
    amplification: bool = Field(False, description="true or false: error amplification and horizon of every run")
    combine: Literal["grid", "zip"] = Field("grid", description='"grid" or "zip"')
    draws: int | None = Field(None, ge=1, le=MAX_COUNT, description="a whole number from 1 up, with random axes")
    seed: int = Field(0, ge=0, le=2**63 - 1, description="a whole number from 0 up")
    validation: Number = Field(0.0, gt=0, lt=1, description="a share between 0 and 1")
    test: Number = Field(0.0, gt=0, lt=1, description="a share between 0 and 1, less than 1 with validation")
    picture: Literal["spread", "map"] | None = Field(None, description='"spread" or "map"')
    axis: list[AxisTable] = Field(min_length=1, description="one or more [[axis]] tables")

    @field_validator("test")
    @classmethod
    def _leaves_rows_for_training(cls, test: float, info: ValidationInfo) -> float:
        if test + info.data.get("validation", 0.0) >= 1.0:
            raise invalid("validation and test leave no rows for training")
        return test

    @field_validator("axis")
    @classmethod
    def _names_each_key_once(cls, axes: list[AxisTable]) -> list[AxisTable]:
        keys = [axis.key for axis in axes]
        repeated = next((key for key in keys if keys.count(key) > 1), None)
        if repeated:
            raise invalid(f"{repeated} is varied by more than one axis", "one [[axis]] for a key")
        return axes

    @field_validator("axis")
    @classmethod
    def _draws_where_random(cls, axes: list[AxisTable], info: ValidationInfo) -> list[AxisTable]:
        drawn = [axis.key for axis in axes if any(getattr(axis, name) is not None for name in DRAWN)]
        draws = info.data.get("draws")
        if drawn and draws is None and "draws" in info.data:
            raise invalid(f"{drawn[0]} is random, and draws is missing", "draws = N at the top of the file")
        if draws is not None and not drawn:
            raise invalid("draws is there, but no axis is random", f"draws with an axis of {', '.join(DRAWN)}")
        return axes


@dataclass(frozen=True)
class Sweep:
    """A base scene and how it is varied.

    table   what the sweep's file says
    base    the scene with the sweep's own changes, before any axis
    text    the TOML text it was read from
    """

    table: SweepTable
    base: Scene
    design: Design
    text: str
    path: Path

    @property
    def name(self) -> str:
        return self.path.stem

    @property
    def keys(self) -> tuple[str, ...]:
        return tuple(axis.key for axis in self.design.axes)

    @property
    def units(self) -> tuple[str, ...]:
        """The unit of every axis' key."""
        return tuple(unit_of(parse_key(key)) for key in self.keys)

    @property
    def outputs(self) -> tuple[str, ...]:
        """What is stored of each run's samples; () for metrics alone."""
        return self.base.outputs if self.table.outputs is None else tuple(self.table.outputs)

    def problem(self, key: KeyPath, message: str) -> str:
        """A line about what the file says at `key`, for an InputError: for errors that only a caller can find."""
        return _problem(self.path, self.text, key, message)

    def variants(self) -> Variants:
        """From rows to scenes. They always ask for the energy: every run's balance is checked."""
        wanted = [*self.outputs, *({"energy"} - set(self.outputs))]
        return Variants(self.name, {**scene_tables(self.base), "outputs": wanted}, self.keys)


def load_sweep(path: Path) -> Sweep:
    """The sweep in the TOML file `path`; a name such as sweeps/fig11-spread means a shipped one.

    Raises InputError with all errors of the file, a line each.
    """
    shipped = (sweeps_folder().parent / path).with_suffix(".toml")
    if not path.exists() and path.parts[:1] == ("sweeps",) and shipped.is_file():
        path = shipped
    if not path.exists() and str(path) in dict(list_scenes()):
        raise InputError(f"{path}: is a scene; allowed: a sweep of scenes (rotor-mbs list), or: rotor-mbs run {path}")
    text, tables = read_toml(path)
    return _sweep(path, text, validate_file(SweepTable, tables, text, shown_path(path)))


def sweep_of(scene: Scene, axes: Mapping[str, object], **options: object) -> Sweep:
    """A sweep made without a file.

    Parameters
    ----------
    axes
        By the key of a number of the scene: a list of values, or a table as an [[axis]] of a sweep file has it.
    options
        The other keys of a sweep file, such as samples, outputs, draws or validation.

    Raises
    ------
    InputError
        With a line for each error; line numbers are those of the sweep's `text`.

    Examples
    --------
    >>> from rotor_mbs.scenario.catalogue import find_scenes
    >>> scene = find_scenes(["paper/fig11"])[0]
    >>> sweep = sweep_of(scene, {"bearing.stiffness": [0, 1e3], "gravity": {"uniform": [9, 10]}}, draws=5)
    >>> sweep.design.count, sweep.units
    (10, ('N m/rad', 'm/s^2'))
    """
    tables: dict[str, object] = {"title": scene.title, "scene": scene.name, **options}
    listed: list[dict[str, object]] = []
    for key, values in axes.items():
        plain = values.tolist() if isinstance(values, np.ndarray) else values
        listed.append({"key": key, **(plain if isinstance(plain, Mapping) else {"values": plain})})
    parts = [toml_lines(tables), *("\n[[axis]]\n" + toml_lines(axis) for axis in listed)]
    text, tables["axis"] = "".join(parts), listed
    return _sweep(Path("sweep"), text, validate_file(SweepTable, tables, text, "sweep"), scene)


Problem = Callable[[KeyPath, str], str]


def _problem(path: Path, text: str, key: KeyPath, message: str) -> str:
    return f"{shown_path(path)}:{line_of(find_lines(text), key)}: {message}"


def _sweep(path: Path, text: str, table: SweepTable, base: Scene | None = None) -> Sweep:
    """What the file's model cannot check: the base scene, the keys of the axes in it, and how many rows there are."""
    problem = functools.partial(_problem, path, text)
    base = _changed(base or _base(path, table.scene, problem), table, problem)
    sweep = Sweep(table, base, _design(table, problem), text, path)
    _check_rows(sweep)
    return sweep


def _base(path: Path, asked: str, problem: Problem) -> Scene:
    is_shipped = (scenarios_folder() / f"{asked}.toml").is_file()
    try:
        return only_scene(str(path.parent / asked) if asked.endswith(".toml") and not is_shipped else asked)
    except InputError as error:
        raise InputError(problem(("scene",), f"scene: {error}")) from error


def _changed(base: Scene, table: SweepTable, problem: Problem) -> Scene:
    changes: dict[str, object] = dict(table.change)
    if table.samples is not None:
        changes["samples"] = table.samples
    if table.outputs:
        changes["outputs"] = table.outputs
    try:
        return base.replace(**changes) if changes else base
    except InputError as error:
        key = next(key for key in ("change", "samples", "outputs") if getattr(table, key))
        raise InputError([problem((key,), f"{key}: {one}") for one in error.problems]) from error


def _design(table: SweepTable, problem: Problem) -> Design:
    axes = tuple(_axis(axis, table.draws or 0) for axis in table.axis)
    if table.combine == "zip" and len({axis.count for axis in axes}) > 1:
        counts = ", ".join(f"{axis.key} has {axis.count}" for axis in axes)
        wrong = f"combine: {counts}; allowed with zip: as many values in every axis"
        raise InputError(problem(("combine",), wrong))
    design = Design(axes, table.combine, table.seed)
    if design.count > MAX_ROWS:
        raise InputError(problem(("axis",), f"axis: {design.count:,} runs; allowed: at most {MAX_ROWS:,}"))
    return design


def _axis(table: AxisTable, draws: int) -> Axis:
    kind = next(name for name in VARIED if getattr(table, name) is not None)
    given = getattr(table, kind)
    if isinstance(given, RangeTable):
        return Axis(table.key, kind, (given.start, given.end), given.count)
    return Axis(table.key, kind, tuple(given), draws if kind in DRAWN else len(given))


def _check_rows(sweep: Sweep) -> None:
    """Validates the scenes of the ends of every axis, or of every row where that is needed.

    Raises InputError with a line for each error.
    """
    problems: dict[str, None] = {}
    for i, variants, row in _rows_to_check(sweep):
        try:
            variants.scene(row)
        except TableError as error:
            values = ", ".join(f"{key} = {value:g}" for key, value in zip(variants.keys, row, strict=True))
            start = "" if error.is_of_keys else f"{values}: "
            for problem in error.problems:
                problems.setdefault(sweep.problem(("axis", i, "key"), f"{start}{problem.message}"))
            if len(problems) >= _MAX_ROW_ERRORS:
                break
    if problems:
        raise InputError(list(problems))


def _rows_to_check(sweep: Sweep) -> Iterator[tuple[int, Variants, tuple[float, ...]]]:
    """(axis, variants, a row for them): the ends of each axis, and all rows where numbers depend on one another.

    That is enough to find every error: inertias and torque tables alone are validated as a whole.
    """
    tables = {**scene_tables(sweep.base), "outputs": list(sweep.outputs) or ["angles"]}
    for i, axis in enumerate(sweep.design.axes):
        alone = Variants(sweep.name, tables, [axis.key])
        values = sweep.design.values[i]
        for value in dict.fromkeys((float(values.min()), float(values.max()))):
            yield i, alone, (value,)
    dependent = [i for i, key in enumerate(sweep.keys) if not _is_interval(key)]
    if dependent:
        together = sweep.variants()
        for first in range(0, sweep.design.count, _ROWS_AT_ONCE):
            rows = sweep.design.rows(first, min(first + _ROWS_AT_ONCE, sweep.design.count))
            chosen = np.unique(rows[:, dependent], axis=0, return_index=True)[1]
            for row in rows[np.sort(chosen)]:
                yield dependent[0], together, tuple(row.tolist())


def _is_interval(key: str) -> bool:
    path = parse_key(key)
    if path[0] == "torque" or path[:2] == ("bearing", "rest"):
        return not any(isinstance(part, int) for part in path[3:])  # a constant, not a row of a table
    return path[0] in _INTERVALS or path[-1] == "mass" or "tip" in path
