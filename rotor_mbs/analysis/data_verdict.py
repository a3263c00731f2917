"""How far data are from a reference, channel by channel, and what became of a comparison; as JSON and back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

LEVELS = (1e-3, 1e-6, 1e-9)  # rad, rad/s: until when data agree to each
DEFAULT_TOLERANCE = 1e-6  # rad, of an interval's defect


@dataclass(frozen=True)
class ChannelErrors:
    """A channel of data, such as "pitch 1" in "rad", against the reference.

    error_max, error_whole : the largest error up to the horizon, and at all.
    defect : rad, the largest over all intervals (of a rate times the interval), less what the rounding of the data
        explains; None where it cannot be known.
    floor : rad, the largest that rounding explains.
    agrees_until : s, for each of `LEVELS`, of the last row before the error is larger; NaN where the first row is.
    lag_s, scale, offset : least squares of data = scale * reference(t - lag) + offset up to the horizon.
    """

    name: str
    unit: str
    error_max: float
    error_whole: float
    defect: float | None
    floor: float | None
    agrees_until: tuple[float, ...]
    lag_s: float
    scale: float
    offset: float


@dataclass(frozen=True)
class DataVerdict:
    """What became of a comparison.

    source : name of the file.
    status, message : as of a run: "ok", or another one and why in a line.
    tolerance : rad, of an interval's defect.
    rows, compared_until, horizon_s : rows compared, time of the last one (s), horizon of the scene (s).
    defect_time, predicted : s, end of the interval of the largest defect; rad, the error up to the horizon that the
        defects add up to; None where they are not known.
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
    defect_time: float | None = None
    predicted: float | None = None
    energy_drift: float | None = None
    read: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    likely: tuple[str, ...] = ()

    @property
    def agrees(self) -> bool:
        return self.status == "ok"


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
