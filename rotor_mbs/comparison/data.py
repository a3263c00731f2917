"""Load data of a scene in SI units from files or arrays, with the rounding of each number.

Data that cannot be compared are refused here: numbers that are not finite, columns of different
lengths, rows that contradict each other.
"""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.comparison.channels import SPEED, Channel
from rotor_mbs.comparison.columns import DataTable, arrays_of, table_of
from rotor_mbs.comparison.files import read_table
from rotor_mbs.comparison.mapping import ColumnMapping, DataMapping, find_channels, read_mapping
from rotor_mbs.comparison.times import ordered_rows, rounding_of_steps
from rotor_mbs.comparison.units import unit_factor
from rotor_mbs.errors import InputError
from rotor_mbs.scenario.keys import counted
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Array

_FEW_DIGITS, _SURE_DIGITS, _ALL_DIGITS = 9, 14, 17
_MAX_WRITTEN = 20_000  # numbers of a column, evenly chosen, that are formatted as text: 1 us each
_ROUNDED_SINCE = 2.0 * 2.0**-52  # relative error of a conversion of units after the rounding
_SINGLE_DIGITS = 8  # as many as single precision has
_SINGLE = 2.0**-24  # its relative rounding error
_MAX_EXCEPTIONS = 0.05  # of the numbers
_MIN_DISTINCT = 10  # values: fewer may be input, such as 0.5, that says nothing of the digits
_SAMPLE = 200  # about as many numbers of a column are used where not all are needed


@dataclass(frozen=True)
class ForeignData:
    """Samples of another program, or its modes over speed.

    Attributes
    ----------
    source : what messages call the data.
    time, values : (n,) s, increasing from 0 or later; (n, channels) in SI units. A table of modes
        has the speeds, rad/s, in place of the times.
    channels : of the columns of `values`.
    rounding, time_rounding : (n, channels), (n,) half a unit in the last digit of each number, as
        it was written.
    read : a line for each channel: column, unit, and what was assumed.
    unused : by name of every other column, why it is not compared.
    loads_left_out : names of the loads among the unused columns that the mapping does not omit.
    wrapped : for each channel, whether whole turns are missing from it.
    precision : "4 decimals: rounding error 5e-05", or a number of digits in this form; "" if the
        numbers have hardly any rounding.
    time_precision : the same of the times; "" also if their intervals are equal, but for a few.
    notes : what was done to the rows.
    omitted : names of channels that the mapping omits: data without them are complete.
    restricted_to : names of the channels to which the mapping restricts the comparison; empty where
        it does not.
    is_modes : whether it is a table of modes.
    """

    source: str
    time: Array
    values: Array
    channels: tuple[Channel, ...]
    rounding: Array
    time_rounding: Array
    read: tuple[str, ...] = ()
    unused: Mapping[str, str] = field(default_factory=dict)
    loads_left_out: tuple[str, ...] = ()
    wrapped: tuple[bool, ...] = ()
    precision: str = ""
    time_precision: str = ""
    notes: tuple[str, ...] = ()
    omitted: tuple[str, ...] = ()
    restricted_to: tuple[str, ...] = ()
    is_modes: bool = False

    def rows(self, chosen: NDArray[np.bool_] | slice) -> ForeignData:
        """Return the data in the chosen rows."""
        return replace(
            self,
            time=self.time[chosen],
            values=self.values[chosen],
            rounding=self.rounding[chosen],
            time_rounding=self.time_rounding[chosen],
        )

    def only(self, *, loads: bool) -> ForeignData:
        """Return the data with the channels of loads alone, or with all others."""
        chosen = [j for j, channel in enumerate(self.channels) if channel.is_load == loads]
        return replace(
            self,
            channels=tuple(self.channels[j] for j in chosen),
            values=self.values[:, chosen],
            rounding=self.rounding[:, chosen],
            wrapped=tuple(self.wrapped[j] for j in chosen if self.wrapped),
        )

    def beside(self, other: ForeignData) -> ForeignData:
        """Return the data followed by the channels of `other`, which has the same rows."""
        return replace(
            self,
            channels=self.channels + other.channels,
            values=np.hstack([self.values, other.values]),
            rounding=np.hstack([self.rounding, other.rounding]),
            wrapped=self.wrapped + other.wrapped,
        )

    @property
    def columns(self) -> list[int]:
        """Return the places of the channels in a matrix of all angles, then rates, then loads."""
        return [channel.column for channel in self.channels]


def load_data(
    data: str | os.PathLike[str] | Mapping[str, Any],
    scene: Scene,
    columns: str | os.PathLike[str] | Mapping[str, Any] | None = None,
) -> ForeignData:
    """Load data of a scene from a file, or from arrays by name.

    Parameters
    ----------
    data : a file; or arrays by name, an xarray.Dataset, whose coordinates are arrays too, or a
        pandas.DataFrame.
    scene : the scene that the data are of.
    columns : a mapping file, or a mapping of its keys; by default channels are recognized by the
        names of columns.

    Raises
    ------
    InputError
        If the data or the mapping cannot be read, or the columns are no channels of this scene.
    """
    mapping = read_mapping(columns, scene)
    if isinstance(data, str | os.PathLike):
        table = read_table(data, mapping.group, scene.name)
    elif hasattr(data, "items"):
        if mapping.group:
            problem = f"arrays have no groups, but the mapping has group = {mapping.group!r}"
            raise InputError(f"data: {problem}; allowed: leave `group` out, or an HDF5 file")
        table = table_of("data", *arrays_of(data))
    else:
        allowed = 'a file, or arrays by name, such as {"time": run.time, "angles": run.angles}'
        raise InputError(f"data: {type(data).__name__}; allowed: {allowed}")
    return data_of_table(table, scene, mapping)


@np.errstate(all="ignore")  # numbers of data may be so large that they overflow
def data_of_table(
    table: DataTable, scene: Scene, mapping: DataMapping | None = None
) -> ForeignData:
    """Take the channels of a scene from named columns, in SI units.

    Parameters
    ----------
    table : named columns of numbers.
    scene : the scene whose channels the columns may be.
    mapping : which column is which; by default they are recognized by their names.

    Raises
    ------
    InputError
        If the columns cannot be channels of one trajectory, or of one table of modes; if numbers
        are not finite, or rows contradict each other.
    """
    mapping = mapping or DataMapping()
    found = find_channels(table, scene, mapping)
    sources = found.sources
    _refuse_different_lengths(table, sources)
    columns = [table[source.column].values for source in sources.values()]
    arrays = [_si_values(table, channel, source) for channel, source in sources.items()]
    steps = [table[source.column].step for source in sources.values()]
    rounding, precision = _rounding_of_columns(sources, columns, steps)
    is_modes = next(iter(sources)).name == SPEED
    notes: tuple[str, ...] = ()
    time_precision = ""
    if is_modes:
        places = np.argsort(arrays[0], kind="stable")
        time = arrays[0][places]
        if time[0] < 0.0 or (np.diff(time) == 0.0).any():
            problem = "a speed below 0, or one that repeats"
            raise InputError(f"{table.source}: {problem}; allowed: a row for each speed")
        time_rounding = rounding[0][places]
    else:
        is_load = np.array([channel.is_load for channel in list(sources)[1:]])
        numbers = np.stack(arrays[1:], axis=1)
        places, time, notes = ordered_rows(
            table.source, arrays[0], numbers[:, ~is_load], numbers[:, is_load], _jump_times(scene)
        )
        of_steps = rounding_of_steps(time)
        time_rounding = rounding[0][places] if of_steps is None else of_steps
        time_precision = _time_precision(
            columns[0], rounding[0], is_equidistant=of_steps is not None
        )
    values = []
    for source, array in zip(list(sources.values())[1:], arrays[1:], strict=True):
        values.append(np.unwrap(array[places]) if source.wrapped else array[places])
    return ForeignData(
        source=table.source,
        time=time,
        values=np.stack(values, axis=1),
        channels=tuple(sources)[1:],
        rounding=np.stack(rounding[1:], axis=1)[places],
        time_rounding=time_rounding,
        read=found.lines,
        unused=found.unused,
        loads_left_out=found.loads_left_out,
        wrapped=tuple(source.wrapped for source in sources.values())[1:],
        precision=precision,
        time_precision=time_precision,
        notes=notes,
        omitted=mapping.omitted,
        restricted_to=mapping.only,
        is_modes=is_modes,
    )


def _factor(channel: Channel, source: ColumnMapping) -> float:
    """Return the factor to the SI unit from a column's unit, which fits the channel."""
    return unit_factor(source.unit, channel.kind) or 1.0


def _refuse_different_lengths(table: DataTable, sources: Mapping[Channel, ColumnMapping]) -> None:
    """Raise InputError unless all channels have a row for every time."""
    lengths = {}
    for source in sources.values():
        lengths[source.column] = len(table[source.column].values)
    if len(set(lengths.values())) > 1:
        counts = []
        for name, length in lengths.items():
            counts.append(f"{name} has {counted(length, 'row')}")
        shown = ", ".join(counts)
        problem = f"columns of different lengths: {shown}"
        raise InputError(f"{table.source}: {problem}; allowed: a row for every time")


def _si_values(table: DataTable, channel: Channel, source: ColumnMapping) -> Array:
    """Return the numbers of a channel in SI units, (n,).

    Parameters
    ----------
    table : the columns of the data.
    channel : what the column is.
    source : the column, its unit, sign and offset.

    Raises
    ------
    InputError
        If a number is not finite, with its row.
    """
    values = table[source.column].values
    factor = _factor(channel, source)
    si_values: Array = source.sign * (values + source.offset) * factor
    bad = np.flatnonzero(~np.isfinite(si_values))
    if len(bad):
        place = f"in row {bad[0] + 1} of {len(values)}"
        what = f"{values[bad[0]]} {place}"
        if np.isnan(values[bad[0]]):
            what = table[source.column].missing or what
        problem = f"column {source.column!r} is {what}"
        raise InputError(f"{table.source}: {problem}; allowed: finite numbers")
    return si_values


def _jump_times(scene: Scene) -> list[float]:
    """Return the times, s, at which a prescribed load of a scene jumps."""
    times = []
    for table in scene.load_tables:
        for (before, _), (after, _) in itertools.pairwise(table):
            if before == after:
                times.append(after)
    return times


# Rounding: data are judged by the digits with which they were written


def _rounding_of_columns(
    sources: Mapping[Channel, ColumnMapping], columns: Sequence[Array], steps: Sequence[float]
) -> tuple[list[Array], str]:
    """Find the rounding of the numbers of all columns.

    Parameters
    ----------
    sources : by channel its column and unit, the time or speed first.
    columns : (n,) numbers of each channel, as they were written.
    steps : between packed numbers of each channel, see `DataColumn`.

    Returns
    -------
    list of ndarray, str
        Half a unit in the last digit of each number, in SI units; `ForeignData.precision`.
    """
    time, *numbers = columns
    factors = []
    kinds = []
    for channel, source in sources.items():
        factors.append(_factor(channel, source))
        kinds.append((channel.kind, source.unit))
    del kinds[0]  # of the time
    rounding = [rounding_of_printed(time)]
    # Columns of one kind and unit are written alike: one that hardly changes has their digits.
    for kind, values in zip(kinds, numbers, strict=True):
        alike = []
        for other_kind, other in zip(kinds, numbers, strict=True):
            if other_kind == kind:
                alike.append(other)
        # Frequencies are computed, not chosen: few of them say something of digits, too.
        min_distinct = 1 if kind[0] == "frequency" else _MIN_DISTINCT
        rounding.append(rounding_of_printed(values, [alike, numbers], min_distinct))
    rounding = [np.maximum(last, 0.5 * step) for last, step in zip(rounding, steps, strict=True)]
    precision = _precision(numbers, rounding[1:])
    in_si_units = [each * abs(factor) for each, factor in zip(rounding, factors, strict=True)]
    return in_si_units, precision


def rounding_of_printed(
    values: Array, others: Sequence[Sequence[Array]] = (), min_distinct: int = _MIN_DISTINCT
) -> Array:
    """Find half a unit in the last place of numbers as they were written.

    They may have been written with some decimals, some significant digits, or in single or double
    precision: the coarsest way that fits all of them is taken.

    Parameters
    ----------
    values : (n,) numbers of a column.
    others : groups of columns; a column of few distinct values is judged together with the first
        group that has enough.
    min_distinct : numbers with fewer distinct values than this are taken to be exact, to double
        precision.

    Returns
    -------
    ndarray
        (n,) in the unit of the numbers.
    """
    sizes, judged = np.abs(values), values
    for group in others:
        if len(np.unique(judged)) < _MIN_DISTINCT:
            samples = [other[:: 1 + len(other) // _SAMPLE] for other in group]
            judged = np.concatenate([values, *samples])
    largest = float(np.abs(judged).max(initial=0.0))
    if len(np.unique(judged)) < min_distinct:
        return np.asarray(sizes * 2.0**-53)
    # Numbers with a fixed number of decimals may seem to have a fixed number of digits, and the
    # other way round: both are tried, and the coarser rounding is taken.
    last = np.zeros(len(values))
    noise = 4.0 * 2.0**-52 * largest  # errors of the arithmetic below
    for decimals in range(_SURE_DIGITS + 1):
        unit = 10.0**-decimals
        # Any number fits a unit that is not far above the errors of the arithmetic.
        if not 100.0 * noise < unit < largest:
            continue
        rounded = np.round(judged / unit) * unit
        if np.abs(judged - rounded).max() <= noise:
            last[:] = 0.5 * unit
            break
    digits = _significant_digits(judged)
    if digits < _ALL_DIGITS:
        exponents = np.floor(np.log10(np.where(sizes > 0.0, sizes, 1.0)))
        units = 0.5 * 10.0 ** (exponents + 1 - digits)
        last = np.maximum(last, np.where(sizes > 0.0, units, 0.0))
    # Numbers of single precision may also seem to have 16 digits. All doubles from 0.5 to 1 do: the
    # gaps between them are wider than those between numbers of 16 digits.
    with np.errstate(over="ignore"):  # of what is larger than single precision can be
        single = np.asarray(judged, np.float32).astype(float)
    if np.array_equal(single, judged):
        return np.maximum(last, sizes * _SINGLE)
    return last if last.any() else np.asarray(sizes * 2.0**-53)


def _precision(columns: Sequence[Array], rounding: Sequence[Array]) -> str:
    """Return the precision of numbers in words, see `ForeignData.precision`.

    Parameters
    ----------
    columns : (n,) numbers of each column, as they were written.
    rounding : `rounding_of_printed` of each.
    """
    rounded = []
    digits = 0  # of the rounded columns: others may have all digits
    for values, last in zip(columns, rounding, strict=True):
        sizes = np.abs(values)
        if (last > 10.0**-_FEW_DIGITS * sizes).any():
            rounded.append((sizes, last))
            digits = max(digits, _significant_digits(values))
    if not rounded:
        return ""
    # A column of zeros has no digits.
    count = sum(bool(np.any(values)) for values in columns)
    where = "" if len(rounded) >= count else f" in {len(rounded)} of {count} columns"
    if digits >= _SINGLE_DIGITS:
        for sizes, last in rounded:
            if sizes.any() and (last == sizes * _SINGLE).all():
                return f"single precision{where}: relative rounding error {_SINGLE:.0e}"
        return ""
    # Digits and decimals are the same for numbers of one size; they are named as decimals only if
    # sizes differ and nearly all numbers have the same rounding.
    is_fixed = any(sizes.min() < 0.1 * sizes.max() for sizes, _ in rounded)
    exceptions = [(last > 2.0 * last.min()).mean() for _, last in rounded]
    if is_fixed and max(exceptions) < _MAX_EXCEPTIONS:
        decimals = sorted({round(-math.log10(2.0 * last.min())) for _, last in rounded})
        shown = " or ".join(map(str, decimals))
        return f"{shown} decimals{where}: rounding error {0.5 * 10.0 ** -decimals[0]:.0e}"
    return f"{digits} digits{where}: relative rounding error {0.5 * 10.0 ** (1 - digits):.0e}"


def _time_precision(time: Array, rounding: Array, *, is_equidistant: bool) -> str:
    """Return the precision of times in words, see `ForeignData.time_precision`.

    Parameters
    ----------
    time, rounding : (n,) as they were written, in the unit of the file.
    is_equidistant : whether the intervals are equal, or equal but for a few; then the digits of the
        times do not matter.
    """
    if is_equidistant:
        return ""
    text = _precision([time], [rounding])
    if text or not (rounding > 2.0 * 2.0**-53 * np.abs(time)).any():
        return text
    return f"{_significant_digits(time)} digits"


def _significant_digits(values: Array) -> int:
    """Find the least number of significant digits that all numbers fit, up to 17."""
    nonzero = values[values != 0.0]
    if not np.isfinite(nonzero).all():
        return _ALL_DIGITS
    for digits in range(1, _ALL_DIGITS):
        # A few values refute most numbers of digits, which saves the time for all of them.
        if _have_digits(nonzero[:_SAMPLE], digits) and _have_digits(nonzero, digits):
            return digits
    return _ALL_DIGITS


def _have_digits(values: Array, digits: int) -> bool:
    """Return whether numbers may have been written with so many significant digits.

    Parameters
    ----------
    values : (n,) finite numbers, none of them 0.
    digits : number of significant digits.
    """
    if digits <= _FEW_DIGITS:
        with np.errstate(all="ignore"):  # the unit of the smallest numbers may be 0: none fit
            unit = 10.0 ** (np.floor(np.log10(np.abs(values))) + 1 - digits)
            rounded = np.round(values / unit) * unit
        return np.allclose(values, rounded, rtol=1e-12, atol=0.0)
    # Beyond that the arithmetic above is too coarse: numbers are written as texts and compared. A
    # number may have been multiplied by a factor of units since it was rounded.
    most = _ROUNDED_SINCE if digits <= _SURE_DIGITS else 0.0
    for value in values[:: 1 + len(values) // _MAX_WRITTEN].tolist():
        written = float(f"{value:.{digits - 1}e}")
        if abs(written - value) > most * abs(value):
            return False
    return True
