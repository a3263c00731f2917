"""Read a sweep file: a scene and the keys that are varied. All errors of a file are reported."""

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
DRAWN = ("uniform", "normal", "sobol")  # keys of an axis whose values are drawn
# Largest number of values of a range, or of draws, that is read. `Design` limits the number of runs
# further, to MAX_ROWS.
MAX_COUNT = 10**15
MAX_ROWS = 10_000_000  # largest number of runs
VARIED = ("values", "linear", "log", *DRAWN)  # keys of an axis, of which exactly one is given
# First parts of keys whose allowed values are an interval that does not depend on other numbers. If
# both ends of such an axis are allowed, so are all values between them.
_INTERVALS = ("initial", "gravity", "hub", "shaft", "bearing")
_ROWS_AT_ONCE = 4096  # number of rows checked together; all rows would take much memory
_MAX_ROW_ERRORS = 20  # number of errors after which no more rows are checked


def _read_key(value: object) -> str:
    """Return a key, after a check that it may differ between the runs of a sweep.

    Raises
    ------
    TableError
        If it may not differ.
    """
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
    """A range of `count` values from `start` to `end`, both included."""

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
    """One [[axis]] of a sweep file: a key of the scene, and its values.

    Exactly one of the attributes `values` to `sobol` is given. The others are None.

    Attributes
    ----------
    key : key of a number in the scene.
    values : the values themselves.
    linear, log : a range with equal differences, or with equal ratios.
    uniform : both ends of a uniform distribution.
    normal : mean and standard deviation of a normal distribution.
    sobol : both ends of the interval in which a Sobol sequence lies.
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
        """Return the path of a value in the table of the axis.

        For an axis with a list of values it is the path of the entry, for any other axis the path
        of the key from which the value is computed.
        """
        if self.values is not None:
            return ("values", self.values.index(value))
        return (next(name for name in VARIED if getattr(self, name) is not None),)

    @property
    def is_drawn(self) -> bool:
        """Return whether the values are drawn: random numbers, or a Sobol sequence."""
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
    """The content of a sweep file, and its rows. A row has a value of each axis, for one run.

    In a "grid" the rows are all combinations of values, ordered like the numbers of a counter whose
    last digit changes fastest. Each axis is a digit, except that all drawn axes together are one
    digit, the draw, at the place of the first of them. In a "zip" row i has value i of every axis.
    A row depends only on its number, so that any part of a sweep can be computed on any computer.

    Attributes
    ----------
    title : title of the sweep.
    scene : name of a shipped scene, or path of a scene file relative to the sweep file.
    methods : names of methods; () for the default method.
    settings : settings of the methods. A method takes only the settings that it has.
    change : numbers by key that replace those of the scene in all runs.
    samples, outputs : replace those of the scene; None keeps those of the scene.
    precision : type of the stored arrays, "float64" or "float32".
    error_growth, defects : whether these are computed for every run.
    combine : "grid" or "zip".
    draws : number of values of each drawn axis.
    seed : seed of the random numbers.
    validation, test : shares of the runs for validation and test. In a grid with drawn axes they
        are shares of the draws, see `splits`.
    axes : the axes of the sweep.
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
        """Raise TableError with all errors of values that contradict one another."""
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
        """Return the digits of a row number: lists of the axes that change together, slowest first.

        An axis is given by its number.
        """
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
        """Return the number of values of each digit, slowest first."""
        counts = self.counts
        return tuple(counts[digit[0]] for digit in self._digits)

    def rows(self, first: int, last: int) -> Array:
        """Return the rows with consecutive numbers.

        Parameters
        ----------
        first, last : number of the first row, and number after the last row. A number of `count` or
            more continues with row 0.

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
        """Return for each row whether it is for training, validation or test.

        In a grid with drawn axes, rows of the same draw are in the same split. If rows were split
        individually, nearly every draw would be in several splits, and a machine-learning model
        would be tested with draws with which it was trained.

        Returns
        -------
        ndarray of int8, shape (rows,)
            Indices in `SPLITS`.
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
            from scipy.stats import qmc  # not at the top: it takes 0.5 s

            # All Sobol axes share one scrambled sequence of points in the unit cube. The sequence
            # is balanced if its length is a power of two. Therefore the next power of two is
            # generated, and the first points are taken.
            sampler = qmc.Sobol(len(sobol), seed=np.random.default_rng(self.seed))
            points = sampler.random_base2((self.draws - 1).bit_length())[: self.draws]
        columns = []
        for i, axis in enumerate(self.axes):
            # Each axis has its own generator, so that an axis that is added at the end does not
            # change the values of the others.
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
    """Choose at random which rows, or draws, of a sweep are for training, validation and test.

    Parameters
    ----------
    count : number of rows or draws.
    validation, test : shares for validation and test. The numbers of rows are rounded.
    seed : seed of the random numbers.

    Returns
    -------
    ndarray of int8, shape (count,)
        Indices in `SPLITS`.
    """
    # The generators of axes are seeded with the numbers of axes. No axis has the number 2**32, so
    # that the splits are independent of the values.
    drawn = np.random.default_rng([seed, 2**32]).permutation(count)
    validation_end = round(validation * count)
    test_end = validation_end + round(test * count)
    codes = np.zeros(count, np.int8)
    codes[drawn[:validation_end]] = SPLITS.index("validation")
    codes[drawn[validation_end:test_end]] = SPLITS.index("test")
    return codes


# Name of the scene's field for each key of the initial state. The key is a tuple (table, name).
_START = {tuple(field.metadata["key"].split(".")): field.name for field in scene_fields("start")}

# Largest number of rotors whose scenes are kept. A chunk of runs, or an axis of a usual sweep, has
# fewer.
MAX_ROTORS = 512


class Variants:
    """The scenes of a sweep, made from a base scene and values of the varied keys.

    To read and validate a scene takes long. It is done once for each rotor, of which most sweeps
    have few. For each row the initial state of that scene is replaced.

    Parameters
    ----------
    name : name of the scenes.
    tables : tables of the base scene, as in a scene file.
    varied : keys whose numbers are varied.
    """

    def __init__(self, name: str, tables: dict[str, Any], varied: Sequence[str]) -> None:
        self.keys = tuple(varied)
        self._name = name
        self._tables = tables
        self._paths = [parse_key(key) for key in varied]
        self._rotors: dict[tuple[float, ...], Scene] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Return the state for pickling, with the rotor's scene only if all runs share a rotor."""
        # With this scene, the process that receives the object need not read the rotor again.
        has_one_rotor = all(map(_is_of_start, self._paths))
        return self.__dict__ | {"_rotors": self._rotors if has_one_rotor else {}}

    def scene(self, values: Sequence[float]) -> Scene:
        """Return the scene with given values of the varied keys.

        Parameters
        ----------
        values : a value for each key, in the order of the keys.

        Raises
        ------
        TableError
            If a scene file with these values has errors.
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
                # The key ends in a valid index, because the rotor was read with it.
                start[_START[path[:2]]][int(path[2])] = value
        changes: dict[str, Any] = {name: tuple(numbers) for name, numbers in start.items()}
        scene = dataclasses.replace(rotor, **changes)
        if _is_valid_start(scene):
            return scene
        return self._read(values)  # raises the error of a scene file with these values

    def _read(self, values: Sequence[float]) -> Scene:
        """Return the scene with given values, read and validated like a scene file."""
        tables = copy.deepcopy(self._tables)
        for path, value in zip(self._paths, values, strict=True):
            put_value(tables, path, value)
        return scene_from_tables(tables, self._name)


def _is_of_start(path: KeyPath) -> bool:
    """Return whether a key belongs to the initial state."""
    return path[:2] in _START


def _is_valid_start(scene: Scene) -> bool:
    """Return whether a scene file may have the initial angles and rates of a scene."""
    for number in (*scene.initial_angles, *scene.initial_rates):
        if not abs(number) <= keys.MAX_NUMBER:  # NaN fails this comparison, too
            return False
    rates = zip(scene.initial_rates[1:], scene.blades, strict=True)
    return all(blade.has_pitch_inertia or not rate for rate, blade in rates)


@dataclass(frozen=True)
class Sweep:
    """A parameter study: a scene, and the axes that are varied.

    Attributes
    ----------
    design : content of the sweep file.
    base : the scene with `change`, `samples` and `outputs` of the design, and no axis varied.
    file, path : the sweep file, and its path.
    """

    design: Design
    base: Scene
    file: TomlFile
    path: Path

    @property
    def name(self) -> str:
        """Return the name of the sweep file, without its suffix."""
        return self.path.stem

    @property
    def keys(self) -> tuple[str, ...]:
        """Return the key of each axis, (axes,)."""
        return tuple(axis.key for axis in self.design.axes)

    @property
    def units(self) -> tuple[str, ...]:
        """Return the unit of each axis, (axes,); "1" for a number without a unit."""
        return tuple(unit_of(parse_key(key)) for key in self.keys)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Return the outputs that are stored for each run; () if only metrics are stored."""
        return self.base.outputs if self.design.outputs is None else tuple(self.design.outputs)

    def variants(self) -> Variants:
        """Return the object that makes the scene of a row.

        The scenes always have the output "energy", because the energy balance of every run is
        checked.
        """
        wanted = [*self.outputs, *({"energy"} - set(self.outputs))]
        return Variants(self.name, {**scene_tables(self.base), "outputs": wanted}, self.keys)


def load_sweep(path: Path, check: ValuesCheck | None = None) -> Sweep:
    """Read a sweep from a TOML file.

    Parameters
    ----------
    path : path of the file, or sweeps/NAME for a shipped sweep.
    check : function that finds more errors in the values that were read.

    Raises
    ------
    InputError
        If the file has errors; with all of them.
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
    """Return a sweep that is defined by Python values instead of a file.

    Parameters
    ----------
    scene : Scene
        The scene that is varied.
    axes : mapping
        For each varied key of the scene a list of values, or a mapping with the keys of an [[axis]]
        except `key`.
    **options
        The other keys of a sweep file, with plain values.

    Raises
    ------
    InputError
        If the sweep has errors. Their line numbers refer to the text of an equal sweep file.
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
    path, file : path and content of the file.
    check : function that finds more errors in the values that were read.
    base : the scene that is varied; by default the scene that the file names.

    Raises
    ------
    InputError
        If the file has errors, or if scenes of rows have errors; with all of them.

    Warns
    -----
    PlausibilityWarning
        If an axis varies a key that has no effect on the stored outputs.
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
        # All changes are made together. Therefore an error is reported at the first of the keys
        # that are given.
        given = [key for key in ("change", "samples", "outputs") if getattr(design, key)]
        with file.with_line_numbers(given[0]):
            base = base.replace(**changes)
    sweep = Sweep(design, base, file, path)
    # A dict serves as an ordered set, so that a problem of many rows is reported once.
    faults: dict[KeyProblem, None] = {}
    found: set[KeyProblem] = set()  # problems found so far, without the place in the sweep file
    for i, variants, row in _rows_to_check(sweep):
        try:
            variants.scene(row)
        except TableError as error:
            pairs = zip(variants.keys, row, strict=True)
            values = ", ".join(f"{key} = {value:g}" for key, value in pairs)
            is_alone = len(row) == 1
            for fault in error.faults:
                # A row with values of all axes may repeat a problem that was found with one axis
                # alone. It is not reported again for another axis.
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
    """Yield rows such that all rows of a sweep are valid if these rows are.

    The first rows have one value: the smallest or largest value of one axis. Then follow complete
    rows, if the sweep has axes whose allowed values depend on other numbers, such as inertias or
    torque tables. Of complete rows with equal values on these axes only the first is yielded.

    Parameters
    ----------
    sweep : the sweep.

    Yields
    ------
    axis, variants, row
        Number of the axis that an error names, object that makes the scene of the row, and values
        of the row.
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
            # Rows with equal values on the dependent axes are either all valid or all invalid.
            _, distinct = np.unique(rows[:, dependent], axis=0, return_index=True)
            for row in rows[np.sort(distinct)]:
                yield dependent[0], together, tuple(row.tolist())


def _is_interval(key: str) -> bool:
    """Return whether the allowed values of a key are an interval, independent of other numbers."""
    path = parse_key(key)
    if path[0] == "torque" or path[:2] == ("bearing", "rest"):
        # A second index, of a row in a table over time, makes the number depend on other rows.
        is_of_row = any(isinstance(part, int) for part in path[3:])
        return not is_of_row
    return path[0] in _INTERVALS or path[-1] == "mass" or "tip" in path
