"""Data of a scene: a time and any of its angles and rates, in s, rad, rad/s; refused where they cannot be compared."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError
from rotor_mbs.foreign.channels import Channel, read_mapping, sources
from rotor_mbs.foreign.files import read_table
from rotor_mbs.foreign.table import table_of
from rotor_mbs.scenario.scene import Scene

Array = NDArray[np.float64]
_FEW_DIGITS, _ALL_DIGITS = 9, 17
_FEWEST = 3  # rows: fewer have no motion to be compared


@dataclass(frozen=True)
class ForeignData:
    """Samples of another program.

    time, values : (n,) s, increasing from 0 or later; (n, channels) rad or rad/s, what `channels` says.
    read, unused : a line for each channel: column, unit, and what was assumed; names of the other columns.
    wrapped : for each channel, whether whole turns are missing from it.
    digits : how many significant digits the numbers have, at most; 17 where they have all.
    """

    source: str
    time: Array
    values: Array
    channels: tuple[Channel, ...]
    read: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()
    wrapped: tuple[bool, ...] = ()
    digits: int = _ALL_DIGITS

    @property
    def columns(self) -> list[int]:
        """Places of the channels in a matrix of all angles, then all rates."""
        return [channel.column for channel in self.channels]


def load_data(
    data: str | os.PathLike[str] | Mapping[str, Any],
    scene: Scene,
    columns: str | os.PathLike[str] | Mapping[str, Any] | None = None,
) -> ForeignData:
    """Data from a file or from arrays by name, by a mapping or by guesses. Raises InputError, StoreError."""
    entries, group = read_mapping(columns, scene)
    table = table_of("data", data) if isinstance(data, Mapping) else read_table(data, group, scene.name)
    channel_sources = sources(table, scene, entries)
    lengths = {source.entry.column: len(table[source.entry.column].values) for source in channel_sources}
    if len(set(lengths.values())) > 1:
        shown = ", ".join(f"{name} has {length} rows" for name, length in lengths.items())
        raise InputError(f"{table.source}: columns of different lengths: {shown}; allowed: a row for every time")
    arrays: list[Array] = []
    for source in channel_sources:
        values = table[source.entry.column].values
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise InputError(
                f"{table.source}: column {source.entry.column!r} is {values[bad[0]]} in row {bad[0] + 1} of "
                f"{len(values)}; allowed: finite numbers"
            )
        si_values: Array = source.entry.sign * (values + source.entry.offset) * source.factor
        arrays.append(np.unwrap(si_values) if source.entry.wrapped else si_values)
    _refuse_wrong_times(table.source, arrays[0])
    return ForeignData(
        table.source,
        arrays[0],
        np.stack(arrays[1:], axis=1),
        tuple(source.channel for source in channel_sources[1:]),
        tuple(str(source) for source in channel_sources),
        tuple(name for name in table.columns if name not in lengths),
        tuple(source.entry.wrapped for source in channel_sources[1:]),
        max(_digits(table[source.entry.column].values) for source in channel_sources[1:]),
    )


def _digits(values: Array) -> int:
    """With how many significant digits the numbers may have been written."""
    some = values[values != 0.0][:200]
    sizes = 10.0 ** np.floor(np.log10(np.abs(some)))
    for digits in range(1, _FEW_DIGITS + 1):
        unit = sizes * 10.0 ** (1 - digits)
        if np.allclose(some, np.round(some / unit) * unit, rtol=1e-12, atol=0.0):
            return digits
    return _ALL_DIGITS


def _refuse_wrong_times(source: str, time: Array) -> None:
    if len(time) < _FEWEST:
        raise InputError(f"{source}: {len(time)} rows; allowed: {_FEWEST} or more")
    if time[0] < 0.0:
        raise InputError(
            f"{source}: begins at t = {time[0]:g} s; allowed: times from 0, the scene's start (`offset` of the time)"
        )
    wrong = np.flatnonzero(np.diff(time) <= 0.0)
    if len(wrong):
        row = int(wrong[0])
        problem = "repeats" if time[row + 1] == time[row] else "comes before"
        raise InputError(
            f"{source}: the time of row {row + 2}, {time[row + 1]:.9g} s, {problem} that of the row above, "
            f"{time[row]:.9g} s; allowed: times that increase"
        )
