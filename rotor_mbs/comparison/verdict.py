"""Define the verdict on data of another program, by channel, and its record in a file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from rotor_mbs.analysis.text_tables import TextTable
from rotor_mbs.comparison.channels import Channel
from rotor_mbs.comparison.data import ForeignData
from rotor_mbs.runs.hdf5 import Column
from rotor_mbs.runs.read import Record
from rotor_mbs.runs.versions import versions
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.solution.defects import Defects
from rotor_mbs.solution.trajectory import Array

LEVELS = (1e-3, 1e-6, 1e-9)  # levels of error in rad, rad/s or relative, see `agrees_until`
# Largest allowed defect of an interval, rad; also the largest allowed error of a load relative to
# its largest magnitude, and of a frequency relative to the frequency.
DEFAULT_TOLERANCE = 1e-6
# Largest number of unused columns that a results file lists, and largest length of this list, of
# names and reasons, as JSON text. The list is stored in an attribute, which has at most 64 kB in
# HDF5.
_MAX_NAMES, _MAX_NAME_BYTES = 100, 30_000


@dataclass(frozen=True)
class ChannelErrors:
    """Hold the errors of a channel of data, such as "pitch 1" in "rad".

    Angles and rates are compared with the reference. Loads are compared with those of the closed
    form at the states of the data, and frequencies with those of the closed form.

    Attributes
    ----------
    error_max, error_whole : the largest error up to the horizon, and over all rows. For loads and
        frequencies, which have no horizon, both are the same.
    defect : the number that is compared with the tolerance, beyond rounding; None if unknown.
        Angle: the largest defect of an interval in rad, after the defect of each interval is
        divided by its `bound_factors` (see `solution.defects`). Rate: the same, with the defects
        converted to rad by `Defects.rate_units`. Load: the largest error relative to the load's
        largest magnitude. Frequency: the largest relative error. The divisors of the relative
        errors have a lower limit, for loads and frequencies near zero.
    floor : largest estimated effect of rounding on a defect or relative error. The true effect may
        be `FLOOR_SAFETY` times as large.
    agrees_until : see the function `agrees_until`.
    defect_unit : unit of `defect` and `floor`, or what they are relative to, in words.
    """

    name: str
    unit: str
    error_max: float
    error_whole: float
    defect: float | None
    floor: float | None
    agrees_until: Mapping[str, float | None]
    defect_unit: str = "rad"


@dataclass(frozen=True)
class DataVerdict:
    """Hold the result of a comparison.

    Attributes
    ----------
    source : name of the file; "data" for arrays.
    status, message : "ok" or another status of a run; one line on why it is not "ok".
    tolerance : largest allowed `defect` of a channel, in the unit of `defect`.
    rows, compared_until, horizon_s : number of rows that are compared; time of the last of these
        rows, s; horizon of the scene, s, None for modes.
    defect_time : s, end of the interval with the largest defect; None if it is unknown.
    predicted : rad, the largest error of an angle up to the horizon that the defects predict; None
        if it is unknown.
    read : one line for each channel on how its column was read, see `ForeignData.read`.
    unused : for the name of each column that is not used, the reason.
    notes : what else a user should know.
    likely : likely causes of the difference, in words; empty if none is found or searched for.
    axis : "time"; for a table of modes "speed", and then `compared_until` is a speed in rad/s.
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
    unused: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    likely: tuple[str, ...] = ()
    axis: str = "time"

    @property
    def agrees(self) -> bool:
        """Return whether the data agree with the scene: the status is "ok"."""
        return self.status == "ok"


def agrees_until(rows: Array, error: Array) -> dict[str, float | None]:
    """Return the time or speed up to which data agree with the reference, for each of `LEVELS`.

    Parameters
    ----------
    rows : (n,) times, s, or speeds, rad/s.
    error : (n,) magnitudes of the errors: rad, rad/s, or relative.

    Returns
    -------
    dict
        For each level (as text) the time or speed of the last row before an error exceeds it; None
        if the error of the first row does.
    """
    until: dict[str, float | None] = {}
    for level in LEVELS:
        is_beyond = ~(error <= level)
        end = int(np.argmax(is_beyond)) if is_beyond.any() else len(rows)
        until[str(level)] = float(rows[end - 1]) if end else None
    return until


def as_dictionary(verdict: DataVerdict) -> dict[str, Any]:
    """Return a verdict as a dictionary that can be written as JSON."""
    return asdict(verdict) | {"agrees": verdict.agrees}


def from_dictionary(stored: Mapping[str, Any]) -> DataVerdict:
    """Restore a verdict from the dictionary that `as_dictionary` returned, or from its JSON."""
    values: dict[str, Any] = {}
    for name, value in stored.items():
        values[name] = tuple(value) if isinstance(value, list) else value
    values["channels"] = tuple(ChannelErrors(**channel) for channel in values["channels"])
    del values["agrees"]
    return DataVerdict(**values)


def defects_of_channel(
    scene: Scene, defects: Defects | None, channel: Channel
) -> tuple[Array, Array] | None:
    """Return the magnitudes of a channel's interval defects, and their floors.

    A floor is the estimated effect of rounding.

    Parameters
    ----------
    scene : the rotor, with the number of its coordinates.
    defects : interval defects of the data, None if they are unknown.
    channel : an angle or a rate.

    Returns
    -------
    tuple of ndarray, or None
        Both (n - 1,) rad; None if the defects are unknown, or if the coordinate does not move.
    """
    count = len(scene.initial_angles)
    coordinate, is_rate = channel.column % count, channel.column >= count
    if defects is None or coordinate not in defects.moving:
        return None
    place = defects.moving.index(coordinate)
    if is_rate:
        place += len(defects.moving)
    return defects.channel_sizes[:, place], defects.floors[:, place]


def comparison_record(
    verdict: DataVerdict,
    scene: Scene,
    data: ForeignData,
    expected: Array,
    defects: Defects | None,
) -> Record:
    """Return a comparison as a record for a results file.

    Parameters
    ----------
    verdict : the verdict, stored as JSON in an attribute.
    scene : the scene, stored as text.
    data : the rows that were compared.
    expected : (n, channels) right numbers, of the reference or the closed form.
    defects : interval defects of the data, None if they are unknown.

    Returns
    -------
    Record
        For each channel a column of its data, and columns whose names end with `_reference`,
        `_error` and, for an angle or a rate, `_defect`. A defect that is unknown is NaN.
    """
    axis, content = verdict.axis, "modes" if data.is_modes else "trajectory"
    if data.is_modes:
        scale = Column((axis,), "rad/s", "rotor speed")
    else:
        scale = Column((axis,), "s", "time")
    columns, arrays = {axis: scale}, {axis: data.time}
    for j, channel in enumerate(data.channels):
        values, right = data.values[:, j], expected[:, j]
        by_ending = {
            "": (channel.unit, "", values),
            "_reference": (channel.unit, ", reference", right),
            "_error": (channel.unit, ", data minus reference", values - right),
        }
        if not channel.is_load and not data.is_modes:
            # A row has the defect of the interval that ends at this row; NaN if it is unknown.
            defect = np.full(len(values), np.nan)
            known = defects_of_channel(scene, defects, channel)
            if known is not None:
                defect[1 : 1 + len(known[0])] = known[0]
            by_ending["_defect"] = ("rad", ", defect of the interval before the row", defect)
        for ending, (unit, long_name, array) in by_ending.items():
            arrays[channel.key + ending] = array
            columns[channel.key + ending] = Column((axis,), unit, channel.name + long_name)
    unused = list(verdict.unused.items())[:_MAX_NAMES]
    while len(json.dumps(unused)) > _MAX_NAME_BYTES:
        unused = unused[: len(unused) // 2]
    attributes = {
        "title": scene.title,
        "scene_hash": scene_hash(scene),
        "scene_toml": scene.text,
        "scene_label": scene.label,
        "source": verdict.source,
        "status": verdict.status,
        "message": verdict.message,
        "tolerance": verdict.tolerance,
        "horizon_s": np.nan if verdict.horizon_s is None else verdict.horizon_s,
        "verdict": json.dumps(as_dictionary(replace(verdict, unused=dict(unused)))),
        **versions(),
    }
    return Record("comparison", scene.name, f"data/{content}", attributes, arrays, columns)


def unused_lines(verdict: DataVerdict, most: int = 12) -> list[str]:
    """Return the columns that are not compared, a line for each reason.

    Parameters
    ----------
    verdict : the verdict, with the unused columns and the reasons.
    most : how many names a line lists.
    """
    names_by_reason: dict[str, list[str]] = {}
    for name, reason in verdict.unused.items():
        names_by_reason.setdefault(reason, []).append(name)
    lines = []
    for reason, names in names_by_reason.items():
        shown = ", ".join(names[:most])
        if len(names) > most:
            shown = f"{shown}, ... ({len(names)} in all)"
        lines.append(f"not used ({reason}): {shown}")
    return lines


def channel_table(verdict: DataVerdict) -> TextTable:
    """Return a table with a row for each channel: largest error, largest defect, `agrees_until`.

    Parameters
    ----------
    verdict : the verdict, with the errors of each channel.
    """
    head = (
        "channel",
        "largest error",
        "largest defect",
        *(f"within {level:g} up to" for level in LEVELS),
    )
    rows = []
    for channel in verdict.channels:
        errors = (f"{channel.error_max:.1e} {channel.unit}", _defect(channel))
        ends = channel.agrees_until.values()
        until = ("never" if end is None else f"{end:.6g} {axis_unit(verdict)}" for end in ends)
        rows.append((channel.name, *errors, *until))
    return TextTable(head, rows)


def axis_unit(verdict: DataVerdict) -> str:
    """Return the unit of the rows' times, or of the rows' speeds in a table of modes."""
    return "s" if verdict.axis == "time" else "rad/s"


def verdict_of(record: Record) -> DataVerdict:
    """Return the verdict in the record of a stored comparison."""
    return from_dictionary(json.loads(record.attributes["verdict"]))


def _defect(channel: ChannelErrors) -> str:
    """Return the largest defect of a channel with its unit; "" if it is unknown."""
    return "" if channel.defect is None else f"{channel.defect:.1e} {channel.defect_unit}"
