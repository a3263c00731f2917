"""How far data are from a reference, channel by channel: errors, per unit of error growth, until when they agree, and
what a constant lag, scale and offset would explain.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any

import numpy as np

from rotor_mbs.solution.metrics import horizon, horizon_samples
from rotor_mbs.solution.trajectory import Array, Trajectory

LEVELS = (1e-3, 1e-6, 1e-9)  # rad, rad/s: until when data agree to each
DEFAULT_TOLERANCE = 1e-6  # rad per unit of error growth


@dataclass(frozen=True)
class ChannelErrors:
    """A channel of data against the reference.

    Attributes
    ----------
    name, unit : such as "pitch 1", "rad".
    error_max : the largest error up to the horizon.
    error_whole : the largest error at all.
    error_per_growth : the largest error up to the horizon, of the largest angle so far (at least 1 rad), per unit of
        growth: how many times larger than an error of the initial state that of this channel may be.
    agrees_until : s, for each of `LEVELS`, of the last row before the error is larger; NaN where the first row is.
    lag_s, scale, offset : least squares of data = scale * reference(t - lag) + offset up to the horizon.
    """

    name: str
    unit: str
    error_max: float
    error_whole: float
    error_per_growth: float
    agrees_until: tuple[float, ...]
    lag_s: float
    scale: float
    offset: float


@dataclass(frozen=True)
class DataVerdict:
    """What became of a comparison.

    Attributes
    ----------
    scene, source : name of the scene; of the file.
    status, message : as of a run: "ok", or another one and why in a line.
    tolerance : per unit of error growth.
    channels : a `ChannelErrors` each.
    rows, compared_until, horizon_s : rows compared, time of the last one (s), horizon of the scene (s).
    energy_drift : largest change of the energy of the data, of its scale; None where it cannot be known.
    read, unused, notes : how columns were read; columns that were not; what else there is to know.
    likely : what the difference looks like, of what was tried; empty where nothing fits, or nothing was tried.
    """

    scene: str
    source: str
    status: str
    message: str
    tolerance: float
    channels: tuple[ChannelErrors, ...]
    rows: int
    compared_until: float
    horizon_s: float
    energy_drift: float | None = None
    read: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    likely: tuple[str, ...] = field(default=())

    @property
    def agrees(self) -> bool:
        return self.status == "ok"


def carried_errors(reference: Trajectory, growth: Array, units: Array) -> Array:
    """(n, 2 (1 + blades)) What a relative error of 1 at the start may be in each angle, then rate, at most.

    growth, units   of `TimedReference`
    """
    largest = np.maximum.accumulate(np.maximum(np.abs(reference.angles).max(axis=1), 1.0))
    return np.asarray(np.maximum(np.maximum.accumulate(growth, axis=0), 1.0) * largest[:, None] * units)


def channel_errors(
    names: Sequence[tuple[str, str]], time: Array, values: Array, expected: Array, slopes: Array, carried: Array,
    until: int,
) -> tuple[ChannelErrors, ...]:  # fmt: skip
    """The errors of every channel.

    names       (name, unit) of each channel
    values, expected, slopes, carried   (n, channels) data, reference, its time derivative, and `carried_errors`
    until       rows up to the horizon
    """
    channels = []
    for j, (name, unit) in enumerate(names):
        error = np.abs(values[:, j] - expected[:, j])
        lag, scale, offset = _fit(values[:until, j], expected[:until, j], slopes[:until, j], carried[:until, j])
        channels.append(
            ChannelErrors(
                name, unit, float(error[:until].max()), float(error.max()),
                float((error / carried[:, j])[:until].max()),
                tuple(_agrees_until(time, error, level) for level in LEVELS), lag, scale, offset,
            )
        )  # fmt: skip
    return tuple(channels)


def _agrees_until(time: Array, error: Array, level: float) -> float:
    beyond = np.flatnonzero(~(error <= level))
    last = int(beyond[0]) - 1 if len(beyond) else len(time) - 1
    return float(time[last]) if last >= 0 else float("nan")


def _fit(values: Array, expected: Array, slopes: Array, carried: Array) -> tuple[float, float, float]:
    """Lag (s), scale and offset: linear least squares, each row by its weight; what a channel cannot show is 0 or 1."""
    columns = np.stack([-slopes, expected, np.ones(len(expected))], axis=1) / carried[:, None]
    sizes = np.linalg.norm(columns, axis=0)
    sizes[sizes == 0.0] = 1.0
    parameters = np.linalg.lstsq(columns / sizes, (values - expected) / carried, rcond=1e-9)[0] / sizes
    return float(parameters[0]), 1.0 + float(parameters[1]), float(parameters[2])


def rows_to_the_horizon(reference: Trajectory, time: Array) -> tuple[float, int]:
    """(s, rows) The horizon, and how many of `time` lie up to it."""
    end = horizon(reference)
    whole = horizon_samples(reference) == len(reference.time)
    return end, len(time) if whole else int(np.searchsorted(time, end, side="right"))


def from_dictionary(stored: Mapping[str, Any]) -> DataVerdict:
    """The verdict of which `as_dictionary` made this, also where it has been JSON since."""
    values = {item.name: stored[item.name] for item in fields(DataVerdict)}
    values = {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}
    channels = [
        channel
        | {"agrees_until": tuple(math.nan if time is None else time for time in channel["agrees_until"].values())}
        for channel in stored["channels"]
    ]
    return DataVerdict(**values | {"channels": tuple(ChannelErrors(**channel) for channel in channels)})


def as_dictionary(verdict: DataVerdict) -> dict[str, object]:
    """For JSON: NaN as None."""
    values = asdict(verdict) | {"agrees": verdict.agrees}
    for channel in values["channels"]:
        times = dict(zip(map(str, LEVELS), channel["agrees_until"], strict=True))
        channel["agrees_until"] = {level: None if math.isnan(time) else time for level, time in times.items()}
    return values
