"""A sweep file, strictly: a Sweep, or every fault of the file at once. Knows no method and no results file."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rotor_mbs.errors import InputError
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.design import Axis, Design
from rotor_mbs.scenario.keys import KeyFaultError, parse_key, put, unit_of
from rotor_mbs.scenario.lines import KeyPath, find_lines, line_of
from rotor_mbs.scenario.reading import read_toml, shown_path
from rotor_mbs.scenario.resources import scenarios_folder, sweeps_folder
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.sweep_rows import telling_rows

if TYPE_CHECKING:  # pydantic behind them takes 0.2 s
    from rotor_mbs.scenario.sweep_schema import AxisTable, SweepTable
    from rotor_mbs.scenario.variants import Variants

MAX_ROWS = 10_000_000
_OF_ONE_SHAPE = ("blades", "samples", "duration")


@dataclass(frozen=True)
class Sweep:
    """A base scene and how it is varied.

    base        the scene with the sweep's own changes, before any axis
    tables      the same, as TOML tables: what the axes' values are put into
    units       of every axis' key
    outputs     what is stored of each run's samples; () for metrics alone
    validation  share of the rows marked for validation, 0 for no mark
    text        the TOML text it was read from; path: of the file, as it is shown
    """

    name: str
    title: str
    base: Scene
    tables: Mapping[str, Any]
    design: Design
    units: tuple[str, ...]
    methods: tuple[str, ...]
    settings: Mapping[str, float]
    outputs: tuple[str, ...]
    precision: str
    validation: float
    file_bytes: int
    picture: str | None
    text: str
    path: str

    @property
    def keys(self) -> tuple[str, ...]:
        return tuple(axis.key for axis in self.design.axes)

    def fault(self, key: KeyPath, words: str) -> str:
        """A line about what the file says at `key`, for an InputError: for faults that the scenes cannot show."""
        return f"{self.path}:{line_of(find_lines(self.text), key)}: {words}"

    def variants(self) -> Variants:
        """From rows to scenes. They always ask for the energy: every run's balance is checked."""
        from rotor_mbs.scenario.variants import Variants

        wanted = [*self.outputs, *({"energy"} - set(self.outputs))]
        return Variants(self.name, {**self.tables, "outputs": wanted}, self.keys)


def load_sweep(path: Path) -> Sweep:
    """The sweep in the TOML file `path`; a name such as sweeps/fig11-spread means a shipped one.

    Raises InputError with all faults of the file, a line each.
    """
    from pydantic import ValidationError

    from rotor_mbs.scenario.faults import faults_of
    from rotor_mbs.scenario.sweep_schema import SweepTable

    path = _shipped_or(path)
    text, tables = read_toml(path)
    lines = find_lines(text)
    try:
        table = SweepTable.model_validate(tables)
    except ValidationError as error:
        found = sorted((line_of(lines, fault.path), fault.text) for fault in faults_of(error, tables, SweepTable))
        raise InputError([f"{shown_path(path)}:{line}: {words}" for line, words in found]) from error
    return _Reader(path, text, lines, table).sweep()


def _shipped_or(path: Path) -> Path:
    shipped = (sweeps_folder().parent / path).with_suffix(".toml")
    is_name = not path.exists() and path.parts[:1] == ("sweeps",) and shipped.is_file()
    return shipped if is_name else path


class _Reader:
    """What the schema cannot see: the base scene, the keys of the axes in it, and how many rows there are."""

    def __init__(self, path: Path, text: str, lines: Mapping[KeyPath, int], table: SweepTable) -> None:
        self._path, self._text, self._lines, self._table = path, text, lines, table

    def sweep(self) -> Sweep:
        table = self._table
        base = self._base()
        tables = self._changed(tomllib.loads(base.text))
        design = self._design()
        self._check_keys(design)
        outputs = base.outputs if table.outputs is None else tuple(table.outputs)
        sweep = Sweep(
            name=self._path.stem,
            title=table.title,
            base=base,
            tables=tables,
            design=design,
            units=tuple(unit_of(parse_key(axis.key)) for axis in design.axes),
            methods=tuple(dict.fromkeys(table.methods)),
            settings=dict(table.settings),
            outputs=outputs,
            precision=table.precision,
            validation=table.validation or 0.0,
            file_bytes=int(table.file_bytes),
            picture=table.picture,
            text=self._text,
            path=shown_path(self._path),
        )
        return self._with_checked_rows(sweep)

    def _fault(self, key: KeyPath, words: str) -> InputError:
        return InputError(f"{shown_path(self._path)}:{line_of(self._lines, key)}: {words}")

    def _base(self) -> Scene:
        asked = self._table.scene
        beside = self._path.parent / asked
        is_shipped = (scenarios_folder() / f"{asked}.toml").is_file()
        try:
            found = find_scenes([asked if is_shipped or not asked.endswith(".toml") else str(beside)])
        except InputError as error:
            raise self._fault(("scene",), f"scene: {error}") from error
        if len(found) != 1:
            raise self._fault(("scene",), f"scene: {asked} is {len(found)} scenes; allowed: one scene's name or file")
        return found[0]

    def _changed(self, tables: dict[str, Any]) -> dict[str, Any]:
        for key, value in self._table.change.items():
            try:
                put(tables, parse_key(key), value)
            except KeyFaultError as fault:
                raise self._fault(("change", key), f"change: {key}: {fault}") from fault
        if self._table.samples is not None:
            tables["samples"] = self._table.samples
        if self._table.outputs:
            tables["outputs"] = list(self._table.outputs)
        return tables

    def _design(self) -> Design:
        axes = tuple(_axis(axis, self._table.draws or 0) for axis in self._table.axis)
        if self._table.combine == "zip" and len({axis.count for axis in axes}) > 1:
            counts = ", ".join(f"{axis.key} has {axis.count}" for axis in axes)
            raise self._fault(("combine",), f"combine: {counts}; allowed with zip: as many values in every axis")
        design = Design(axes, self._table.combine, self._table.seed)
        if design.count > MAX_ROWS:
            raise self._fault(("axis",), f"axis: {design.count:,} runs; allowed: at most {MAX_ROWS:,}")
        return design

    def _check_keys(self, design: Design) -> None:
        problems = []
        for i, axis in enumerate(design.axes):
            words = self._wrong_with_key(axis.key)
            if words:
                line = line_of(self._lines, ("axis", i, "key"))
                problems.append(f"{shown_path(self._path)}:{line}: axis.key: {axis.key}: {words}")
        if problems:
            raise InputError(problems)

    def _wrong_with_key(self, key: str) -> str:
        try:
            path = parse_key(key)
        except KeyFaultError as fault:
            return str(fault)
        if path[0] in _OF_ONE_SHAPE:
            return (
                f"all runs of a dataset share one {path[0]}; allowed: a sweep for each, or a key that keeps the shape"
            )
        return ""

    def _with_checked_rows(self, sweep: Sweep) -> Sweep:
        """The sweep with its base read anew after the changes; every axis' ends, or every row, held to the schema."""
        from rotor_mbs.scenario.variants import VariantFaultError, Variants

        try:
            base = Variants(sweep.base.name, sweep.tables, ()).scene(())
        except VariantFaultError as fault:
            key: KeyPath = ("change",) if self._table.change else ("samples",)
            raise self._fault(key, f"scene after the changes: {fault}") from fault
        sweep = replace(sweep, base=replace(base, text=sweep.base.text, title=sweep.base.title))
        problems: dict[str, None] = {}
        for i, values, row in telling_rows(sweep):
            try:
                values.scene(row)
            except VariantFaultError as fault:
                line = line_of(self._lines, ("axis", i, "key"))
                pairs = zip(values.keys, row, strict=True)
                shown = ", ".join(key if fault.is_of_key else f"{key} = {value:g}" for key, value in pairs)
                for words in fault.faults:
                    problems.setdefault(f"{shown_path(self._path)}:{line}: {shown}: {words}")
                if len(problems) >= 20:
                    break
        if problems:
            raise InputError(list(problems))
        return sweep


def _axis(table: AxisTable, draws: int) -> Axis:
    if table.values is not None:
        return Axis(table.key, "values", tuple(table.values), len(table.values))
    for kind, span in (("linear", table.linear), ("log", table.log)):
        if span is not None:
            return Axis(table.key, kind, (span.start, span.end), span.count)
    for kind, pair in (("uniform", table.uniform), ("normal", table.normal), ("sobol", table.sobol)):
        if pair is not None:
            return Axis(table.key, kind, (pair[0], pair[1]), draws)
    raise AssertionError("the schema lets no axis without values through")
