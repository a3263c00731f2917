"""Read a sweep file: a scene and what is varied, or every error of the file at once."""

from __future__ import annotations

import copy
import dataclasses
import functools
import math
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError, PlausibilityWarning
from rotor_mbs.scenario import keys
from rotor_mbs.scenario.catalogue import SCENARIOS, SWEEPS, list_scenes, only_scene
from rotor_mbs.scenario.keys import Kind, file_key, invalid, list_of, restricted, table_of
from rotor_mbs.scenario.scene import (
    KEYS_OF_LOADS,
    OUTPUT_NAMES,
    Scene,
    ValuesCheck,
    put_value,
    scene_fields,
    scene_from_tables,
    scene_tables,
    unit_of,
)
from rotor_mbs.scenario.toml_file import (
    KeyPath,
    KeyProblem,
    TableError,
    TomlFile,
    file_path,
    parse_key,
    parse_toml,
    read_toml,
    toml_lines,
)

Array = NDArray[np.float64]

SPLITS = ("train", "validation", "test")
DRAWN = ("uniform", "normal", "sobol")
# Values of a range; too many runs are reported where they are counted.
MAX_COUNT = 10**15
MAX_ROWS = 10_000_000
VARIED = ("values", "linear", "log", *DRAWN)
# Keys whose rule is an interval of its own: if the ends of an axis keep it, all values between them
# do.
_INTERVALS = ("initial", "gravity", "hub", "shaft", "bearing")
_ROWS_AT_ONCE = 4096  # that are checked: tables of all rows would take much memory
_MAX_ROW_ERRORS = 20


def _read_key(value: object) -> str:
    """Return the path of a key that may differ between the runs of a dataset."""
    key: str = keys.LINE.read(value)
    table = parse_key(key)[0]
    if table in ("blades", "samples", "duration"):
        what = f"all runs of a dataset have the same {table}"
        raise invalid(what, "separate sweeps, or another key")
    return key


_KEY = Kind(_read_key, "a key of a number of the scene, such as blade.mass")
_VALUES = list_of(keys.NUMBER, "a list of numbers", 1)
_COUNT = keys.whole(2, MAX_COUNT, "a whole number of at least 2")
_PAIR = list_of(keys.NUMBER, "", 2, 2)
_RANGE = restricted(
    _PAIR,
    lambda pair: pair[0] < pair[1],
    "two numbers [low, high]",
    "the first number is not below the second",
)
_NORMAL = restricted(
    _PAIR,
    lambda pair: pair[1] > 0.0,
    "two numbers [mean, standard deviation], the second one above 0",
    "the standard deviation is not above 0",
)
_SHARE = restricted(keys.NUMBER, lambda share: 0.0 < share < 1.0, "a number between 0 and 1")
_SCENE_NAME = Kind(
    keys.LINE.read,
    "the name of a shipped scene (paper/fig11), or a TOML file beside this one",
)


@dataclass(frozen=True)
class Range:
    """Values of an axis: `count` of them from `start` to `end`, both included."""

    start: float = file_key("start", keys.NUMBER)
    end: float = file_key("end", keys.NUMBER)
    count: int = file_key("count", _COUNT)


_LINEAR = table_of(Range, "a table with start, end, count")
_LOG = restricted(
    _LINEAR,
    lambda range: min(range.start, range.end) > 0.0,
    "a table with start, end, count, both ends above 0",
    "a logarithmic range reaches 0 or less",
)


@dataclass(frozen=True)
class Axis:
    """One [[axis]]: a key of the scene, and where its values come from.

    Attributes
    ----------
    key : of a number of the scene.
    values, linear, log, uniform, normal, sobol : one of them is given, the others are None: the
        values themselves; a range with equal differences or ratios; the ends of a uniform
        distribution, mean and standard deviation of a normal one, the ends of a Sobol sequence.
    """

    key: str = file_key("key", _KEY)
    values: tuple[float, ...] | None = file_key("values", _VALUES, default=None)
    linear: Range | None = file_key("linear", _LINEAR, default=None)
    log: Range | None = file_key("log", _LOG, default=None)
    uniform: tuple[float, float] | None = file_key(
        "uniform",
        _RANGE,
        note=": random values",
        default=None,
    )
    normal: tuple[float, float] | None = file_key(
        "normal",
        _NORMAL,
        note=": random values",
        default=None,
    )
    sobol: tuple[float, float] | None = file_key(
        "sobol",
        _RANGE,
        note=": Sobol sequence",
        default=None,
    )

    def __post_init__(self) -> None:
        given = [name for name in VARIED if getattr(self, name) is not None]
        if len(given) != 1:
            what = f"has {' and '.join(given)}" if given else "has no values"
            raise invalid(what, f"exactly one of {', '.join(VARIED)}")

    def place_of(self, value: float) -> KeyPath:
        """Return where in its table a value stands: the entry of a list, else where it is from."""
        if self.values is not None:
            return ("values", self.values.index(value))
        return (next(name for name in VARIED if getattr(self, name) is not None),)

    @property
    def is_drawn(self) -> bool:
        """Return whether its values are random, or those of a Sobol sequence."""
        return any(getattr(self, name) is not None for name in DRAWN)


_METHODS = list_of(keys.LINE, "a list of methods, model/integrator", 1)
_SETTINGS = keys.dict_of(
    keys.NUMBER,
    "a table of settings of the methods, such as tolerance = 1e-15",
)
_CHANGE = keys.dict_of(
    keys.NUMBER,
    'a table of scene keys with numbers, such as "blade.mass" = 1e4',
)
_DRAWS = keys.whole(1, MAX_COUNT, "a whole number of at least 1: number of random values")
_SEED = keys.whole(0, 2**63 - 1, "a whole number of at least 0")
_AXES = list_of(table_of(Axis), "one or more [[axis]] tables", 1)


@dataclass(frozen=True, kw_only=True)
class Design:
    """What a sweep file says, and the rows that follow from it: values of all axes for each run.

    In a "grid" the last axis is the fastest, and all random axes together are one digit, the draw;
    "zip" takes all axes together. Every row follows from its number alone, so that any part of a
    sweep can be computed on any computer.

    Attributes
    ----------
    title, scene : of the dataset; the name of a shipped scene, or a file beside the sweep's.
    methods, settings : names of methods, () for the default one, and settings for those that have
        them.
    change : numbers of the scene, by key, that differ from it in all runs.
    samples, outputs : in place of the scene's; None for these.
    precision : "float64" or "float32", of stored arrays.
    error_growth, defects : whether they are computed for every run.
    combine : "grid" or "zip".
    draws, seed : number of random values of each random axis; seed of the random numbers.
    validation, test : shares of the runs; in a grid with random axes of the draws, see `splits`.
    axes : what is varied.
    """

    title: str = file_key("title", keys.LINE)
    scene: str = file_key("scene", _SCENE_NAME)
    methods: Sequence[str] = file_key(
        "methods",
        _METHODS,
        note="; by default lagrange/taylor, or lagrange/dop853 where heyoka is not installed",
        default=(),
    )
    settings: Mapping[str, float] = file_key("settings", _SETTINGS, optional={})
    change: Mapping[str, float] = file_key("change", _CHANGE, optional={})
    samples: int | None = file_key(
        "samples",
        _COUNT,
        note="; by default those of the scene",
        default=None,
    )
    outputs: Sequence[str] | None = file_key(
        "outputs",
        OUTPUT_NAMES,
        note="; [] stores metrics only; by default those of the scene",
        default=None,
    )
    precision: str = file_key("precision", keys.choice(("float64", "float32")), default="float64")
    error_growth: bool = file_key(
        "error_growth",
        keys.FLAG,
        note=": whether error growth and horizon of every run are computed",
        default=False,
    )
    defects: bool = file_key(
        "defects",
        keys.FLAG,
        note=": whether interval defects are computed also for lagrange/taylor",
        default=False,
    )
    combine: str = file_key(
        "combine",
        keys.choice(("grid", "zip")),
        note=": every combination, or the i-th values",
        default="grid",
    )
    draws: int = file_key("draws", _DRAWS, default=0)
    seed: int = file_key("seed", _SEED, default=0)
    validation: float = file_key(
        "validation",
        _SHARE,
        note=": fraction of the runs, of a grid with random axes of the draws",
        default=0.0,
    )
    test: float = file_key("test", _SHARE, note="; validation + test < 1", default=0.0)
    axes: tuple[Axis, ...] = file_key("axis", _AXES)

    def __post_init__(self) -> None:
        """Raise TableError for values that do not fit one another."""
        axes = [axis.key for axis in self.axes]
        drawn = [axis.key for axis in self.axes if axis.is_drawn]
        repeated = [key for key, count in Counter(axes).items() if count > 1]
        problems = []
        if self.test + self.validation >= 1.0:
            allowed = "a number between 0 and 1; validation + test < 1"
            problems.append(KeyProblem(("test",), "no runs left for training", allowed))
        if repeated:
            what = f"{repeated[0]} is varied by more than one axis"
            problems.append(KeyProblem(("axis",), what, "one [[axis]] for a key"))
        if drawn and not self.draws:
            what = f"{drawn[0]} is random, and draws is missing"
            problems.append(KeyProblem(("axis",), what, "draws = N at the top of the file"))
        if self.draws and not drawn:
            what = "draws is given, but no axis is random"
            allowed = f"draws with an axis of {', '.join(DRAWN)}"
            problems.append(KeyProblem(("axis",), what, allowed))
        if self.combine == "zip" and len(set(self.counts)) > 1:
            pairs = zip(axes, self.counts, strict=True)
            what = ", ".join(f"{key} has {count}" for key, count in pairs)
            allowed = "with zip as many values in every axis"
            problems.append(KeyProblem(("combine",), what, allowed))
        if self.count > MAX_ROWS:
            problems.append(KeyProblem(("axis",), f"{self.count:,} runs", f"at most {MAX_ROWS:,}"))
        if problems:
            raise TableError(problems)

    @functools.cached_property
    def _digits(self) -> list[list[int]]:
        """Return groups of axes that move together, as lists of axis numbers, slowest first."""
        if self.combine == "zip":
            return [list(range(len(self.axes)))]
        drawn = [i for i, axis in enumerate(self.axes) if axis.is_drawn]
        digits: list[list[int]] = []
        for i in range(len(self.axes)):
            if i not in drawn:
                digits.append([i])
            elif i == drawn[0]:
                digits.append(drawn)
        return digits

    @property
    def counts(self) -> tuple[int, ...]:
        """Return the number of values of each axis, (axes,), without computing the values."""
        counts = []
        for axis in self.axes:
            spaced = axis.linear or axis.log
            if axis.values:
                counts.append(len(axis.values))
            elif spaced:
                counts.append(spaced.count)
            else:
                counts.append(self.draws)
        return tuple(counts)

    @property
    def count(self) -> int:
        """Return the number of rows."""
        return math.prod(self.shape)

    @property
    def shape(self) -> tuple[int, ...]:
        """Return the number of values along every digit of a grid, slowest first."""
        counts = self.counts
        return tuple(counts[digit[0]] for digit in self._digits)

    def rows(self, first: int, last: int) -> Array:
        """Return rows by their numbers.

        Parameters
        ----------
        first, last : number of the first row, and the one after the last. After the last row of all
            they begin again.

        Returns
        -------
        ndarray, shape (last - first, axes)
        """
        numbers = np.arange(first, last)
        table = np.empty((len(numbers), len(self.axes)))
        for digit in reversed(self._digits):
            count = len(self.values[digit[0]])
            for i in digit:
                table[:, i] = self.values[i][numbers % count]
            numbers = numbers // count
        return table

    def splits(self) -> NDArray[np.int8]:
        """Return which rows are for training, validation and test: places in `SPLITS`, (rows,).

        Rows of the same draw are in the same split. Otherwise, in a grid of random and other axes,
        nearly every draw would be in several, and a model would be tested on starts that it was
        trained with.
        """
        shape, drawn = self.shape, [axis.is_drawn for axis in self.axes]
        numbers = np.arange(self.count)
        if any(drawn) and self.combine == "grid":
            place = next(place for place, digit in enumerate(self._digits) if drawn[digit[0]])
            numbers = np.unravel_index(numbers, shape)[place]
        return split_rows(int(numbers.max()) + 1, self.validation, self.test, self.seed)[numbers]

    @functools.cached_property
    def values(self) -> list[Array]:
        """Return the values of each axis, (values,)."""
        sobol = [axis.key for axis in self.axes if axis.sobol]
        if sobol:
            from scipy.stats import qmc  # late: 0.5 s

            # One scrambled sequence over all Sobol axes: points in the unit cube. Its balance
            # belongs to powers of two: its beginning is taken of the next one.
            sampler = qmc.Sobol(len(sobol), seed=np.random.default_rng(self.seed))
            points = sampler.random_base2((self.draws - 1).bit_length())[: self.draws]
        columns = []
        for i, axis in enumerate(self.axes):
            # One generator for each axis: an axis that is added at the end leaves the others alone.
            generator = np.random.default_rng([self.seed, i])
            if axis.linear:
                columns.append(np.linspace(axis.linear.start, axis.linear.end, axis.linear.count))
            elif axis.log:
                columns.append(np.geomspace(axis.log.start, axis.log.end, axis.log.count))
            elif axis.uniform:
                columns.append(generator.uniform(*axis.uniform, self.draws))
            elif axis.normal:
                columns.append(generator.normal(*axis.normal, self.draws))
            elif axis.sobol:
                low, high = axis.sobol
                columns.append(low + (high - low) * points[:, sobol.index(axis.key)])
            else:
                columns.append(np.array(axis.values))
        return columns


DESIGN_KEYS = keys.declared_keys(Design)


def split_rows(count: int, validation: float, test: float, seed: int) -> NDArray[np.int8]:
    """Draw which rows, or draws, of a sweep are for training, validation and test.

    Parameters
    ----------
    count : their number.
    validation, test : shares of them, to the nearest whole number.
    seed : of the random numbers.

    Returns
    -------
    ndarray of int8, shape (count,)
        Places in `SPLITS`.
    """
    # No axis has this number: the rows are drawn independently of the values.
    drawn = np.random.default_rng([seed, 2**32]).permutation(count)
    validation_end = round(validation * count)
    test_end = validation_end + round(test * count)
    codes = np.zeros(count, np.int8)
    codes[drawn[:validation_end]] = SPLITS.index("validation")
    codes[drawn[validation_end:test_end]] = SPLITS.index("test")
    return codes


# Field by table and name of the key.
_START = {tuple(field.metadata["key"].split(".")): field.name for field in scene_fields("start")}

# Rotors that are kept validated: more than a chunk of runs, or an axis of a usual map, has.
MAX_ROTORS = 512


class Variants:
    """The scenes of a sweep.

    A scene is read for each rotor, of which most sweeps have few; then initial states are put in.

    Parameters
    ----------
    name : of the scenes.
    tables : of the base, as a scene file has them.
    varied : keys at which a number is put in.
    """

    def __init__(self, name: str, tables: dict[str, Any], varied: Sequence[str]) -> None:
        self.keys = tuple(varied)
        self._name = name
        self._tables = tables
        self._paths = [parse_key(key) for key in varied]
        self._rotors: dict[tuple[float, ...], Scene] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled: the rotor, too, where all runs have the same."""
        # The process that gets it need not read the rotor again.
        has_one_rotor = all(map(_is_of_start, self._paths))
        return self.__dict__ | {"_rotors": self._rotors if has_one_rotor else {}}

    def scene(self, values: Sequence[float]) -> Scene:
        """Return the scene with one value for each varied key.

        Parameters
        ----------
        values : in the order of the keys.

        Raises
        ------
        TableError
            As for a file with these values.
        """
        pairs = list(zip(self._paths, values, strict=True))
        rotor_numbers = tuple(value for path, value in pairs if not _is_of_start(path))
        if rotor_numbers not in self._rotors:
            if len(self._rotors) >= MAX_ROTORS:
                self._rotors.clear()
            self._rotors[rotor_numbers] = self._read(values)
        rotor = self._rotors[rotor_numbers]
        start = {name: list(getattr(rotor, name)) for name in _START.values()}
        for path, value in pairs:
            if _is_of_start(path):
                # The rotor was read with these keys: each ends in a valid index.
                start[_START[path[:2]]][int(path[2])] = value
        changes: dict[str, Any] = {name: tuple(numbers) for name, numbers in start.items()}
        scene = dataclasses.replace(rotor, **changes)
        if _is_valid_start(scene):
            return scene
        return self._read(values)  # which raises the error that says what is wrong

    def _read(self, values: Sequence[float]) -> Scene:
        """Return the scene with some values, read as from a file."""
        tables = copy.deepcopy(self._tables)
        for path, value in zip(self._paths, values, strict=True):
            put_value(tables, path, value)
        return scene_from_tables(tables, self._name)


def _is_of_start(path: KeyPath) -> bool:
    """Return whether a key is one of the initial state."""
    return path[:2] in _START


def _is_valid_start(scene: Scene) -> bool:
    """Return whether initial angles and rates are such as a scene file may have."""
    for number in (*scene.initial_angles, *scene.initial_rates):
        if not abs(number) <= keys.MAX_NUMBER:  # so written that NaN fails, too
            return False
    rates = zip(scene.initial_rates[1:], scene.blades, strict=True)
    return all(blade.has_pitch_inertia or not rate for rate, blade in rates)


@dataclass(frozen=True)
class Sweep:
    """A parameter study: a scene, and what is varied.

    Attributes
    ----------
    design : what the file says.
    base : the scene with the sweep's own changes, before any axis.
    file, path : that it was read from.
    """

    design: Design
    base: Scene
    file: TomlFile
    path: Path

    @property
    def name(self) -> str:
        """Return the name of the file, without its ending."""
        return self.path.stem

    @property
    def keys(self) -> tuple[str, ...]:
        """Return the key of each axis, (axes,)."""
        return tuple(axis.key for axis in self.design.axes)

    @property
    def units(self) -> tuple[str, ...]:
        """Return the unit of each axis, (axes,); "1" for none."""
        return tuple(unit_of(parse_key(key)) for key in self.keys)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Return what is stored of each run's samples; () for metrics alone."""
        return self.base.outputs if self.design.outputs is None else tuple(self.design.outputs)

    def variants(self) -> Variants:
        """Return what makes scenes of rows.

        They always ask for the energy: every run's balance is checked.
        """
        wanted = [*self.outputs, *({"energy"} - set(self.outputs))]
        return Variants(self.name, {**scene_tables(self.base), "outputs": wanted}, self.keys)


def load_sweep(path: Path, check: ValuesCheck | None = None) -> Sweep:
    """Read a sweep from a TOML file.

    Parameters
    ----------
    path : of the file; sweeps/NAME means a shipped one.
    check : what else is wrong with the values.

    Raises
    ------
    InputError
        With all errors of the file.
    """
    path = file_path(path)
    if not path.exists() and path.parts[:1] == ("sweeps",):
        shipped = (SWEEPS.parent / path).with_suffix(".toml")
        if shipped.is_file():
            path = shipped
    if not path.exists() and str(path) in dict(list_scenes()):
        allowed = f"a sweep (rotor-mbs list), or: rotor-mbs run {path}"
        raise InputError(f"{path}: is a scene; allowed: {allowed}")
    file = read_toml(path)
    file.refuse_other_kind("a sweep")
    return _sweep(path, file, check)


def sweep_of(scene: Scene, axes: Mapping[str, object], **options: object) -> Sweep:
    """Return a sweep made without a file.

    Parameters
    ----------
    scene : Scene
    axes : mapping
        By key of a number of the scene a list of values, or a table as an [[axis]] of a file has
        it: plain values.
    **options
        The other keys of a sweep file, plain values.

    Raises
    ------
    InputError
        Line numbers are those of the sweep's text.
    """
    text = toml_lines({"title": scene.title, "scene": scene.name, **options})
    for key, values in axes.items():
        table = values if isinstance(values, Mapping) else {"values": values}
        text += "\n[[axis]]\n" + toml_lines({"key": key, **table})
    return _sweep(Path("sweep"), parse_toml(text, "sweep"), None, scene)


def _sweep(
    path: Path,
    file: TomlFile,
    check: ValuesCheck | None,
    base: Scene | None = None,
) -> Sweep:
    """Return the sweep that a file describes.

    Parameters
    ----------
    path, file : its path and what it holds.
    check : what else is wrong with the values.
    base : the scene that is varied; by default the one that the file names.

    Raises
    ------
    InputError
        With all errors of the file, and of the scenes that it makes.

    Warns
    -----
    PlausibilityWarning
        For a key that changes nothing that is stored.
    """
    with file.with_line_numbers():
        design = Design(**keys.read_keys(DESIGN_KEYS, file.tables, check))
    if base is None:
        is_shipped = (SCENARIOS / f"{design.scene}.toml").is_file()
        is_beside = design.scene.endswith(".toml") and not is_shipped
        with file.with_line_numbers("scene"):
            base = only_scene(str(path.parent / design.scene) if is_beside else design.scene)
    changes: dict[str, object] = dict(design.change)
    if design.samples is not None:
        changes["samples"] = design.samples
    if design.outputs:
        changes["outputs"] = design.outputs
    if changes:
        # All changes are made at once: an error is reported at the first of these keys.
        given = [key for key in ("change", "samples", "outputs") if getattr(design, key)]
        with file.with_line_numbers(given[0]):
            base = base.replace(**changes)
    sweep = Sweep(design, base, file, path)
    # A problem of many rows is reported once; a dict keeps the order.
    faults: dict[KeyProblem, None] = {}
    found: set[KeyProblem] = set()  # in scenes with one axis alone
    for i, variants, row in _rows_to_check(sweep):
        try:
            variants.scene(row)
        except TableError as error:
            pairs = zip(variants.keys, row, strict=True)
            values = ", ".join(f"{key} = {value:g}" for key, value in pairs)
            is_alone = len(row) == 1
            for fault in error.faults:
                # What one axis alone does is no fault of another that varies beside it.
                if not is_alone and fault in found:
                    continue
                found.add(fault)
                axis, value = design.axes[i], row[0 if is_alone else i]
                place = ("key",) if fault.is_of_key else axis.place_of(value)
                what = fault.message if fault.is_of_key else f"{values}: {fault.message}"
                faults.setdefault(KeyProblem(("axis", i, *place), what))
            if len(faults) >= _MAX_ROW_ERRORS:
                break
    with file.with_line_numbers():
        if faults:
            raise TableError(faults)
    for key in sweep.keys:
        if key in KEYS_OF_LOADS and "loads" not in sweep.outputs:
            line = f'{key}: changes no run: it enters the loads alone, and "loads" is no output'
            warnings.warn(f"{file.source}: {line}", PlausibilityWarning, stacklevel=3)
    return sweep


def _rows_to_check(sweep: Sweep) -> Iterator[tuple[int, Variants, tuple[float, ...]]]:
    """Yield rows of a sweep which show, if they can be read, that all rows can.

    These are the ends of each axis, and all rows in which numbers depend on one another. Only
    inertias and torque tables do.

    Parameters
    ----------
    sweep : the sweep.

    Yields
    ------
    axis, variants, row
        Number of the axis that is named if the row is wrong; what makes a scene of it; its values.
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
            # Rows with equal values on the dependent axes are right or wrong together.
            _, distinct = np.unique(rows[:, dependent], axis=0, return_index=True)
            for row in rows[np.sort(distinct)]:
                yield dependent[0], together, tuple(row.tolist())


def _is_interval(key: str) -> bool:
    """Return whether the allowed values of a key are an interval, whatever other numbers are."""
    path = parse_key(key)
    if path[0] == "torque" or path[:2] == ("bearing", "rest"):
        is_of_row = any(isinstance(part, int) for part in path[3:])  # of a table over time
        return not is_of_row
    return path[0] in _INTERVALS or path[-1] == "mass" or "tip" in path
