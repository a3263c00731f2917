"""Load data of a scene in SI units from files or arrays, and find the rounding of each number.

Data are refused here if they cannot be compared: if numbers are not finite, columns have different
lengths, or rows contradict each other.
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

# Bounds of the test whether numbers have a given number of significant digits. Up to _FEW_DIGITS
# digits, the test is by arithmetic. For more digits, numbers are formatted as text, and each is
# compared with the number in its text. Up to _SURE_DIGITS digits, the two may differ by
# _ROUNDED_SINCE (relative). For more digits, they must be equal. If they could differ there,
# numbers that are not rounded would pass, too (a third of them at 15 digits, nearly all at 16),
# because the rounding to so many digits is hardly larger than _ROUNDED_SINCE. No double needs more
# than _ALL_DIGITS.
_FEW_DIGITS, _SURE_DIGITS, _ALL_DIGITS = 9, 14, 17
# At most about this many numbers of a column, evenly spaced, are formatted as text, because
# formatting takes 1 us per number.
_MAX_WRITTEN = 20_000
# Largest relative error that a unit conversion adds to a number that was rounded before.
_ROUNDED_SINCE = 2.0 * 2.0**-52
_SINGLE_DIGITS = 8  # numbers with fewer significant digits are not called single precision
_SINGLE = 2.0**-24  # relative rounding error of single precision
# A column is said to have a fixed number of decimals if at most this share of its numbers has a
# coarser rounding than the others.
_MAX_EXCEPTIONS = 0.05
# If a column has fewer distinct values than this, its number of written digits cannot be inferred:
# the values may be input, such as 0.5, and not rounded.
_MIN_DISTINCT = 10
_SAMPLE = 200  # about this many numbers of a column are used where a sample is enough


@dataclass(frozen=True)
class ForeignData:
    """Samples of another program, or its modes over speed.

    Attributes
    ----------
    source : name of the data in messages.
    time, values : (n,) s, increasing from 0 or later; (n, channels) in SI units. In a table of
        modes, `time` has the speeds, rad/s.
    channels : the channel of each column of `values`.
    rounding, time_rounding : (n, channels), (n,) half a unit in the last written digit of each
        number, in SI units. Times with nearly equal intervals are taken as exact to double
        precision, or as sums of a step in double precision, see `rounding_of_steps`.
    read : a line for each channel: column, unit, and what was assumed. For OpenFAST's output, the
        first line says how its columns are read.
    unused : for every column or part of a file that is not compared, by its name, the reason.
    loads_left_out : names of the loads that the data have and the mapping's `only` does not
        contain. They are not compared for this reason alone: the mapping does not omit them.
    wrapped : for each channel, whether the file has the angle without its whole turns.
    precision : precision of the numbers in words, as a number of decimals ("4 decimals: rounding
        error 5e-05"), as a number of digits, or as single precision; "" if the numbers have hardly
        any rounding.
    time_precision : precision of the times in words. It is "" if the times have hardly any
        rounding, or if nearly all intervals are equal.
    notes : what was done to the rows, a line each.
    omitted : names of the channels, loads and kinds of frequencies that the mapping omits: the data
        need not have them.
    restricted_to : names of the channels, loads and kinds of frequencies to which the mapping
        restricts the comparison; empty if there is no restriction.
    is_modes : whether the data are a table of modes.
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
        """Return the data with the load channels only, or with the other channels only.

        Parameters
        ----------
        loads : whether the load channels are kept.
        """
        chosen = [j for j, channel in enumerate(self.channels) if channel.is_load == loads]
        return replace(
            self,
            channels=tuple(self.channels[j] for j in chosen),
            values=self.values[:, chosen],
            rounding=self.rounding[:, chosen],
            wrapped=tuple(self.wrapped[j] for j in chosen if self.wrapped),
        )

    def beside(self, other: ForeignData) -> ForeignData:
        """Return data with the channels of this object and those of `other`.

        Parameters
        ----------
        other : data with the same rows.
        """
        return replace(
            self,
            channels=self.channels + other.channels,
            values=np.hstack([self.values, other.values]),
            rounding=np.hstack([self.rounding, other.rounding]),
            wrapped=self.wrapped + other.wrapped,
        )

    @property
    def columns(self) -> list[int]:
        """Return `Channel.column` of each channel.

        This is its index among the scene's angles, rates and loads, or among the frequencies.
        """
        return [channel.column for channel in self.channels]


def load_data(
    data: str | os.PathLike[str] | Mapping[str, Any],
    scene: Scene,
    columns: str | os.PathLike[str] | Mapping[str, Any] | None = None,
) -> ForeignData:
    """Load data of a scene from a file, or from arrays by name.

    Parameters
    ----------
    data : path of a file, a mapping of arrays by name, a pandas.DataFrame, or an xarray.Dataset.
        The coordinates of a Dataset are arrays, too.
    scene : the scene with which the data are to be compared.
    columns : path of a mapping file, or a dict with the keys of such a file; by default channels
        are recognized by the names of columns.

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


@np.errstate(all="ignore")  # numbers in the data may be so large that the arithmetic overflows
def data_of_table(
    table: DataTable, scene: Scene, mapping: DataMapping | None = None
) -> ForeignData:
    """Return the channels of a scene that are found in named columns, in SI units.

    Parameters
    ----------
    table : named columns of numbers.
    scene : the scene whose channels the columns may be.
    mapping : content of the mapping file; by default channels are recognized by the names of
        columns.

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
        if of_steps is None:  # the intervals differ: the times are as exact as their digits
            channel, source = next(iter(sources.items()))
            written = rounding[0] / _factor(channel, source)
            time_precision = _time_precision(columns[0], written, source.unit)
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
    """Return the factor from a column's unit to the channel's SI unit.

    `find_channels` has already refused units that do not fit the channel.
    """
    return unit_factor(source.unit, channel.kind) or 1.0


def _refuse_different_lengths(table: DataTable, sources: Mapping[Channel, ColumnMapping]) -> None:
    """Raise InputError if the columns of the channels have different lengths."""
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
    channel : the channel.
    source : the name of its column, with unit, sign and offset.

    Raises
    ------
    InputError
        If a number is not finite; the message names the row.
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


# Rounding: it is found from the digits with which the numbers were written


def _rounding_of_columns(
    sources: Mapping[Channel, ColumnMapping], columns: Sequence[Array], steps: Sequence[float]
) -> tuple[list[Array], str]:
    """Find the rounding of the numbers of all columns, and their precision in words.

    Parameters
    ----------
    sources : the column and unit of each channel, the time or speed first.
    columns : (n,) numbers of each channel, as they were written.
    steps : for each channel, the step between its numbers if they are packed, see `DataColumn`.

    Returns
    -------
    list of ndarray, str
        For each channel, half a unit in the last digit of each number, in SI units; the text
        `ForeignData.precision`.
    """
    time, *numbers = columns
    factors = []
    kinds = []
    for channel, source in sources.items():
        factors.append(_factor(channel, source))
        kinds.append((channel.kind, source.unit))
    del kinds[0]  # the kind of the time or speed
    rounding = [rounding_of_printed(time)]
    # Columns of one kind and unit are written with the same digits. A column that hardly changes
    # does not show its digits; they are then found from the other columns of its kind and unit.
    for kind, values in zip(kinds, numbers, strict=True):
        alike = []
        for other_kind, other in zip(kinds, numbers, strict=True):
            if other_kind == kind:
                alike.append(other)
        # Frequencies are computed, not input: even a few of them show their digits.
        min_distinct = 1 if kind[0] == "frequency" else _MIN_DISTINCT
        rounding.append(rounding_of_printed(values, [alike, numbers], min_distinct))
    rounding = [np.maximum(last, 0.5 * step) for last, step in zip(rounding, steps, strict=True)]
    precision = _precision(numbers, rounding[1:])
    in_si_units = [each * abs(factor) for each, factor in zip(rounding, factors, strict=True)]
    return in_si_units, precision


def rounding_of_printed(
    values: Array, others: Sequence[Sequence[Array]] = (), min_distinct: int = _MIN_DISTINCT
) -> Array:
    """Find the rounding of written numbers: half a unit in the last place of each.

    The numbers may have been written with a fixed number of decimals, a fixed number of significant
    digits, or in single or double precision. The coarsest of these forms that fits all numbers is
    taken.

    Parameters
    ----------
    values : (n,) numbers of a column.
    others : groups of columns. If `values` has few distinct numbers, the rounding is found from
        `values` and the first group together. If `values` and this group have few distinct numbers,
        too, the next group replaces the first.
    min_distinct : if there are fewer distinct numbers than this, the numbers are taken as exact to
        double precision.

    Returns
    -------
    ndarray
        (n,) the rounding, in the unit of the numbers.
    """
    sizes, judged = np.abs(values), values
    for group in others:
        if len(np.unique(judged)) < _MIN_DISTINCT:
            samples = [other[:: 1 + len(other) // _SAMPLE] for other in group]
            judged = np.concatenate([values, *samples])
    largest = float(np.abs(judged).max(initial=0.0))
    if len(np.unique(judged)) < min_distinct:
        return np.asarray(sizes * 2.0**-53)
    # Numbers with a fixed number of decimals may seem to have a fixed number of digits, and vice
    # versa. Both forms are therefore tried, and the coarser rounding is taken.
    last = np.zeros(len(values))
    noise = 4.0 * 2.0**-52 * largest  # error of the arithmetic below
    for decimals in range(_SURE_DIGITS + 1):
        unit = 10.0**-decimals
        # Units near the error of the arithmetic are skipped: any number fits them.
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
    # Single precision is tested even if a number of digits was found, because numbers of single
    # precision may seem to have 16 digits. Any double from 0.5 to 1 seems to have 16: the gaps
    # between these doubles are wider than the gaps between numbers of 16 digits.
    with np.errstate(over="ignore"):  # large doubles overflow in single precision
        single = np.asarray(judged, np.float32).astype(float)
    if np.array_equal(single, judged):
        return np.maximum(last, sizes * _SINGLE)
    return last if last.any() else np.asarray(sizes * 2.0**-53)


def _precision(columns: Sequence[Array], rounding: Sequence[Array]) -> str:
    """Return the precision of numbers in words, see `ForeignData.precision`.

    Parameters
    ----------
    columns : (n,) numbers of each column, as they were written.
    rounding : (n,) rounding of each column, by `rounding_of_printed`.
    """
    rounded = []
    # Largest number of digits of the columns in `rounded`. Columns that are not rounded may have 17
    # digits; they are not counted.
    digits = 0
    for values, last in zip(columns, rounding, strict=True):
        sizes = np.abs(values)
        if (last > 10.0**-_FEW_DIGITS * sizes).any():
            rounded.append((sizes, last))
            digits = max(digits, _significant_digits(values))
    if not rounded:
        return ""
    # Columns of zeros are not counted: they have no digits.
    count = sum(bool(np.any(values)) for values in columns)
    where = "" if len(rounded) >= count else f" in {len(rounded)} of {count} columns"
    if digits >= _SINGLE_DIGITS:
        for sizes, last in rounded:
            if sizes.any() and (last == sizes * _SINGLE).all():
                return f"single precision{where}: relative rounding error {_SINGLE:.0e}"
        return ""
    # For numbers of one magnitude, a number of digits is also a number of decimals. The text says
    # "decimals" only if magnitudes differ and nearly all numbers have the same rounding.
    is_fixed = any(sizes.min() < 0.1 * sizes.max() for sizes, _ in rounded)
    # A number 0 has no rounding if its column has a fixed number of digits.
    known = [last[last > 0.0] for _, last in rounded]
    exceptions = [(last > 2.0 * last.min()).mean() for last in known]
    if is_fixed and max(exceptions) < _MAX_EXCEPTIONS:
        decimals = sorted({round(-math.log10(2.0 * last.min())) for last in known})
        shown = " or ".join(map(str, decimals))
        return f"{shown} decimals{where}: rounding error {0.5 * 10.0 ** -decimals[0]:.0e}"
    return f"{digits} digits{where}: relative rounding error {0.5 * 10.0 ** (1 - digits):.0e}"


def _time_precision(time: Array, rounding: Array, unit: str) -> str:
    """Return the precision of times in words, see `ForeignData.time_precision`.

    Parameters
    ----------
    time, rounding : (n,) times as they were written, and the rounding of each, in the unit of the
        file.
    unit : the unit of the times in the file. If the returned text states a number of decimals, it
        ends with this unit, unless the unit is s.
    """
    text = _precision([time], [rounding])
    if "decimals" in text and unit not in ("", "s"):
        return f"{text} {unit}"
    if text or not (rounding > 2.0 * 2.0**-53 * np.abs(time)).any():
        return text
    return f"{_significant_digits(time)} digits"


def _significant_digits(values: Array) -> int:
    """Return the smallest number of significant digits, up to 17, that represents all numbers."""
    nonzero = values[values != 0.0]
    if not np.isfinite(nonzero).all():
        return _ALL_DIGITS
    for digits in range(1, _ALL_DIGITS):
        # For most `digits` the first values already fail; the test of all values is then saved.
        if _have_digits(nonzero[:_SAMPLE], digits) and _have_digits(nonzero, digits):
            return digits
    return _ALL_DIGITS


def _have_digits(values: Array, digits: int) -> bool:
    """Return whether numbers may have been written with a given number of significant digits.

    Parameters
    ----------
    values : (n,) finite numbers other than 0.
    digits : number of significant digits.
    """
    if digits <= _FEW_DIGITS:
        # For the smallest doubles, the unit may be 0. They then fail this test, and are found to
        # have more digits.
        with np.errstate(all="ignore"):
            unit = 10.0 ** (np.floor(np.log10(np.abs(values))) + 1 - digits)
            rounded = np.round(values / unit) * unit
        return np.allclose(values, rounded, rtol=1e-12, atol=0.0)
    # For more digits the arithmetic above is too coarse. The numbers are formatted as text and
    # compared with the text. Up to _SURE_DIGITS digits a small difference is allowed, because the
    # numbers may have been converted to another unit after they were rounded.
    most = _ROUNDED_SINCE if digits <= _SURE_DIGITS else 0.0
    for value in values[:: 1 + len(values) // _MAX_WRITTEN].tolist():
        written = float(f"{value:.{digits - 1}e}")
        if abs(written - value) > most * abs(value):
            return False
    return True
