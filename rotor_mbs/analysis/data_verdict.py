"""How far data are from what they should be, channel by channel, and what became of a comparison; as JSON and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from rotor_mbs.solution.trajectory import Array

LEVELS = (1e-3, 1e-6, 1e-9)  # rad, rad/s, or of the largest: until when data agree to each
DEFAULT_TOLERANCE = 1e-6  # rad, of an interval's defect; of a load's largest; of a frequency


@dataclass(frozen=True)
class ChannelErrors:
    """A channel of data, such as "pitch 1" in "rad", against the reference; loads against those of the data's states.

    error_max, error_whole : the largest error up to the horizon, and at all.
    defect : what is judged, less what the rounding of the data explains; None where it cannot be known. Of an angle or
        a rate (times the interval) the largest over all intervals, rad; of a load the largest error, of the load's
        largest size; of a frequency the largest error, of its size.
    floor : the largest that rounding explains, likewise.
    agrees_until : see the function of this name.
    """

    name: str
    unit: str
    error_max: float
    error_whole: float
    defect: float | None
    floor: float | None
    agrees_until: Mapping[str, float | None]
    defect_unit: str = "rad"


def agrees_until(rows: Array, error: Array) -> dict[str, float | None]:
    """For each of `LEVELS` the last of (n,) times, s, or speeds, rad/s, before the error is larger; None where the
    first is."""
    until: dict[str, float | None] = {}
    for level in LEVELS:
        beyond = ~(error <= level)
        end = int(np.argmax(beyond)) if beyond.any() else len(rows)
        until[str(level)] = float(rows[end - 1]) if end else None
    return until


@dataclass(frozen=True)
class DataVerdict:
    """What became of a comparison.

    source : name of the file.
    status, message : as of a run: "ok", or another one and why in a line.
    tolerance : rad, of an interval's defect.
    rows, compared_until, horizon_s : rows compared, time of the last one (s), horizon of the scene (s); None of modes.
    defect_time, predicted : s, end of the interval of the largest defect; rad, the error up to the horizon that the
        defects add up to; None where they are not known.
    read, unused, notes : how columns were read; columns that were not; what else there is to know.
    likely : what the difference looks like, of what was tried; empty where nothing fits, or nothing was tried.
    axis : "time", or "speed" of a table of modes, whose `compared_until` is in rad/s.
    """

    scene: str
    source: str
    status: str
    message: str
    tolerance: float
    channels: tuple[ChannelErrors, ...]
    rows: int
    compared_until: float
    horizon_s: float | None = None
    defect_time: float | None = None
    predicted: float | None = None
    read: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    likely: tuple[str, ...] = ()
    axis: str = "time"

    @property
    def agrees(self) -> bool:
        return self.status == "ok"


def as_dictionary(verdict: DataVerdict) -> dict[str, Any]:
    """For JSON."""
    return asdict(verdict) | {"agrees": verdict.agrees}


def from_dictionary(stored: Mapping[str, Any]) -> DataVerdict:
    """The verdict of which `as_dictionary` made this, also where it has been JSON since."""
    values: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value for name, value in stored.items()
    }
    values["channels"] = tuple(ChannelErrors(**channel) for channel in values["channels"])
    del values["agrees"]
    return DataVerdict(**values)
