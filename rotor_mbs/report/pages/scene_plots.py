"""Make the plots of a scene's stored runs: motion, loads, errors.

A plot is data (`elements.Plot`), which the page's script draws.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from markupsafe import Markup

from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.report.elements import Array, Curve, Horizontal, Mark, Plot
from rotor_mbs.report.looks import INK, PALETTE, Look, coordinate_look, look_of, with_capital
from rotor_mbs.report.numbers import prefix_of, prefixed, shortest
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import kink_times, values_at
from rotor_mbs.solution.quantities import DEFECT, LOADS, Quantity, known_quantities

Runs = Mapping[str, StoredRun]
VISIBLE = 0.05  # rad; a larger difference is visible in a figure of the paper's size
CORRECTED, PRINTED = "corrected", "printed"  # keys of the curves of both models
CORRECTED_LOOK = Look(PALETTE["reference"][0], "-", "", "corrected")
PRINTED_LOOK = Look(INK, "--", "", "as printed")
# A curve of the printed model runs away if it leaves the range of the correct curve by more than
# _RUNAWAY times the height of this range. The height counts as at least _LEAST_HEIGHT.
_RUNAWAY = 2.0
_LEAST_HEIGHT = 0.5  # rad, rad/s
# The start of a motion is the share _START of its time. A plot is cut off to the range after the
# start if the whole range is more than _START_EXCESS times as large. It is not cut off if the whole
# range is more than _FLAT times as large: the curves are then flat after the start, and only the
# start is of interest.
_START = 0.05
_START_EXCESS, _FLAT = 3.0, 200.0
_ROUNDING = 1e-9  # components below this share of the largest one are rounding errors
LEAST_ANGLE = 1e-6  # rad, rad/s; a smaller range of an angle or a rate is not magnified
# Values up to this one are gaps on a logarithmic axis, as zeros are. It is far below the rounding
# error of a double of order one.
LOWEST = 1e-18
_SPARK_WIDTH, _SPARK_HEIGHT, _SPARK_POINTS = 150.0, 34.0, 75
# A sample counts as at the time of a jump if it is later by at most this share of the time.
_ALIGNED = 1e-9


def time_axis(time: Array) -> Horizontal:
    """Return the time axis for samples at `time`, (n,) s.

    The axis of a single sample is 1e-12 s long, because an axis needs a length.
    """
    return Horizontal(
        "time", "s", "t", float(time[0]), max(float(time[-1]), float(time[0]) + 1e-12)
    )


def whole_time(runs: Sequence[StoredRun]) -> Horizontal | None:
    """Return the time axis of the longest of these runs; None if no run has samples."""
    times = [run.array("time") for run in runs if run.samples]
    return time_axis(max(times, key=lambda time: float(time[-1]))) if times else None


# ---- Jumps


class Jumps(NamedTuple):
    """The jumps of prescribed loads.

    times : ascending times of the jumps, s.
    texts : text for each jump: the load that jumps, and its value after the jump.
    """

    times: Sequence[float]
    texts: Sequence[str]

    def marks(self, *, with_text: bool = False) -> list[Mark]:
        """Return a vertical line for each jump, with its text only if `with_text` is true."""
        return [
            Mark(text if with_text else "", time)
            for time, text in zip(self.times, self.texts, strict=True)
        ]

    def breaks(self, time: Array) -> list[int]:
        """Return the indices of the samples before which curves are interrupted.

        They are the first samples after the jumps. A sample at the time of a jump is not after it,
        because stored loads have the value before the jump at this time.

        Parameters
        ----------
        time : (n,) times of the samples, s.
        """
        places = []
        for jump in self.times:
            place = int(np.searchsorted(time, jump * (1.0 + _ALIGNED), side="right"))
            if 0 < place < len(time):
                places.append(place)
        return places


def jumps_of(scene: Scene) -> Jumps:
    """Return the jumps of the scene's torques and pitch commands, sorted by time.

    If several loads jump at the same time, the text has only one of them: the torque on the rotor
    before a pitch torque, and a pitch torque before a pitch command.

    Parameters
    ----------
    scene : the scene with the loads.
    """
    tables = {"torque": [scene.rotor_torque], "pitch torque": [], "pitch command": []}
    for torque, rest in scene.pitch_loads:
        tables["pitch torque"].append(torque)
        tables["pitch command"].append(rest)
    found: dict[float, str] = {}
    for what, loads in tables.items():
        for time in kink_times(loads, scene.duration):
            for table in loads:
                values = [value for at, value in table if at == time]
                if len(values) > 1 and values[0] != values[-1]:
                    is_angle = what == "pitch command"
                    shown = (
                        f"{shortest(round(math.degrees(values[-1]), 6))}°"
                        if is_angle
                        else prefixed(values[-1], "N m")
                    )
                    found.setdefault(time, f"{what} {shown}")
                    break
    times = sorted(found)
    return Jumps(times, [found[time] for time in times])


# ---- The printed and the corrected model


def range_of(right: Array, other: Array) -> tuple[float, float] | None:
    """Return the range to which a plot is cut off if one of its two curves runs away.

    The range is that of the correct curve, extended by its height on both sides. None is returned
    if the other curve does not run away, or has no sample in this range. The plot is then not cut
    off.

    Parameters
    ----------
    right : values of the correct curve. Values that are not finite are ignored, here and below.
    other : values of the curve that may run away.
    """
    known, others = right[np.isfinite(right)], other[np.isfinite(other)]
    if not len(known) or not len(others):
        return None
    low, high = float(known.min()), float(known.max())
    height = max(high - low, _LEAST_HEIGHT)
    if not ((others >= low - height) & (others <= high + height)).any():
        return None
    if others.max() > high + _RUNAWAY * height or others.min() < low - _RUNAWAY * height:
        return low - height, high + height
    return None


def settled_range(time: Array, columns: Sequence[Array]) -> tuple[float, float] | None:
    """Return the range to which a plot is cut off if its curves have large values at the start.

    A motion that does not begin in equilibrium, as that of a turbine at a given speed, may have
    loads at the start that are much larger than all later ones. The range is that of the later
    values with some room on both sides. None is returned if the start is not much larger.

    Parameters
    ----------
    time : (n,) s, or another quantity that increases.
    columns : values of each curve, (n,). Values that are not finite are ignored.
    """
    if len(time) < 3:
        return None
    values = np.stack(columns)
    values = np.where(np.isfinite(values), values, np.nan)
    late = values[:, time > time[0] + _START * (time[-1] - time[0])]
    if not np.isfinite(late).any():
        return None
    whole = float(np.nanmax(values) - np.nanmin(values))
    low, high = float(np.nanmin(late)), float(np.nanmax(late))
    if not high - low < whole / _START_EXCESS or high - low < whole / _FLAT:
        return None
    room = 0.25 * (high - low)
    return low - room, high + room


def models_plot(
    sides: Runs,
    coordinate: int,
    name: str,
    axis: Horizontal,
    *,
    height: int = 158,
    marks: Sequence[Mark] = (),
    still: bool = False,
) -> Plot:
    """Return the plot of a coordinate's angle or rate by the corrected and the printed model.

    Parameters
    ----------
    sides : run of each model, by "corrected" and "printed".
    coordinate : 0 for the rotor, i for the pitch of blade i.
    name : "angles" or "rates".
    axis : axis of time.
    height, marks, still : fields of the `Plot`.
    """
    curves, values = [], {}
    for side, look in ((CORRECTED, CORRECTED_LOOK), (PRINTED, PRINTED_LOOK)):
        if side in sides:
            values[side] = sides[side].array(name)[:, coordinate]
            curves.append(Curve(side, look, sides[side].array("time"), values[side]))
    clip = range_of(values[CORRECTED], values[PRINTED]) if len(values) == 2 else None
    label = next(iter(sides.values())).labels[coordinate]
    what, unit = ("angle", "rad") if name == "angles" else ("rate", "rad/s")
    return Plot(
        f"{with_capital(label)} {what}",
        unit,
        axis,
        curves,
        height,
        clip=clip,
        marks=marks,
        least=LEAST_ANGLE,
        still=still,
    )


def largest(values: Array) -> Array:
    """Return the largest component of each sample, (n,), of values (n, ...)."""
    result: Array = values.reshape(len(values), -1).max(axis=1)
    return result


def angle_difference(first: StoredRun, second: StoredRun) -> Array:
    """Return the difference of the angles of two runs at each sample that both have, (n,) rad.

    The difference at a sample is the largest over the coordinates.
    """
    n = min(len(first.array("time")), len(second.array("time")))
    return largest(np.abs(first.array("angles")[:n] - second.array("angles")[:n]))


def parting(printed: StoredRun, corrected: StoredRun) -> tuple[float | None, float]:
    """Return when the angles of two runs begin to differ visibly, and their largest difference.

    The time (s) is that of the first sample at which an angle differs by more than VISIBLE; None if
    there is no such sample. The largest difference is in rad.
    """
    gap = angle_difference(printed, corrected)
    apart = np.flatnonzero(gap > VISIBLE)
    return (float(printed.array("time")[apart[0]]) if len(apart) else None), float(
        gap.max(initial=0.0)
    )


def differing_coordinate(printed: StoredRun, corrected: StoredRun, first: int = 0) -> int:
    """Return the index of the coordinate whose angle differs most between two runs.

    If no angle differs, the coordinate with the largest angle in the corrected model is returned.

    Parameters
    ----------
    printed, corrected : runs with angles of both models.
    first : smallest index that is considered: 0 for all coordinates, 1 for the pitches.
    """
    angles = printed.array("angles"), corrected.array("angles")
    n = min(map(len, angles))
    # First by the difference. If it is negligible, by the angles of the corrected model.
    for values in (angles[0][:n] - angles[1][:n], angles[1]):
        sizes = np.abs(values[:, first:]).max(axis=0, initial=0.0)
        if sizes.size and sizes.max() > LEAST_ANGLE:
            return first + int(sizes.argmax())
    return min(first, int(angles[1].shape[1]) - 1)


def spark(curves: Sequence[tuple[Array, Array, Look]], low: float, high: float) -> Markup:
    """Return a small drawing of curves, an `svg` element.

    Parameters
    ----------
    curves : time (n,) in s, values (n,) and look of each curve.
    low, high : range of the values. Curves are cut off a little beyond it.
    """
    end = max((float(time[-1]) for time, _, _ in curves if len(time)), default=0.0) or 1.0
    room = 0.12 * (high - low) or 1.0
    low, high = low - room, high + room
    drawn = ""
    for time, values, look in curves:
        if not len(time):
            continue
        index = np.unique(np.linspace(0, len(time) - 1, _SPARK_POINTS).astype(int))
        points = []
        for at, value in zip(time[index].tolist(), values[index].tolist(), strict=True):
            if np.isfinite(value):
                share = (min(max(value, low), high) - low) / (high - low)
                points.append(
                    f"{2.0 + (_SPARK_WIDTH - 4.0) * at / end:.1f} {31.0 - 28.0 * share:.1f}"
                )
        drawn += f'<path class="curve {look.css}" d="M{"L".join(points)}"/>' if points else ""
    box = f"0 0 {_SPARK_WIDTH:g} {_SPARK_HEIGHT:g}"
    return Markup(f'<svg class="spark" viewBox="{box}" aria-hidden="true">{drawn}</svg>')


# ---- Channels of one run


class ChannelCurves(NamedTuple):
    """The curves of a run that one plot shows, such as the components of a load along one axis.

    name : title of the plot.
    unit : unit of the values.
    curves : key, look and values (n,) of each curve.
    floor : in `unit`; a smaller range of values is rounding error, and smaller values count as 0.
    note : addition to name and unit, such as the frame of a vector.
    breaks : indices of the samples before which the curves are interrupted.
    """

    name: str
    unit: str
    curves: Sequence[tuple[str, Look, Array]]
    floor: float = 0.0
    note: str = ""
    breaks: Sequence[int] = ()

    def plot(
        self,
        axis: Horizontal,
        time: Array,
        *,
        height: int = 160,
        marks: Sequence[Mark] = (),
        still: bool = False,
    ) -> Plot:
        """Return the plot of the curves over time.

        Parameters
        ----------
        axis : axis of time.
        time : (n,) times of the values, s.
        height, marks, still : fields of the `Plot`.
        """
        curves = [Curve(key, look, time, values, self.breaks) for key, look, values in self.curves]
        return Plot(
            self.name,
            self.unit,
            axis,
            curves,
            height,
            self.note,
            clip=settled_range(time, [values for _, _, values in self.curves]),
            marks=marks,
            least=self.floor,
            still=still,
        )


def blade_look(blade: int) -> Look:
    """Return the look of the curves that belong to a blade; the first blade is 0."""
    return coordinate_look(blade + 1, f"blade {blade + 1}")


def in_units(values: Sequence[Array], unit: str) -> tuple[float, str]:
    """Return the divisor for the values of a channel, and their unit with the matching prefix."""
    known = [float(np.abs(array[np.isfinite(array)]).max(initial=0.0)) for array in values]
    scale, prefix = prefix_of(max(known, default=0.0))
    return scale, f"{prefix}{unit}"


def quantity_channels(quantity: Quantity, run: StoredRun, jumps: Jumps) -> list[ChannelCurves]:
    """Return the channels of a stored quantity: three if it has vectors, else one.

    Each channel of vectors has the components along one axis. Components below 1e-9 of the largest
    one are rounding errors, which sets the floor of the channels.

    Parameters
    ----------
    quantity : the quantity.
    run : run that has the quantity.
    jumps : jumps of the prescribed loads. Curves of loads are interrupted there.
    """
    values = run.array(quantity.name)
    breaks = jumps.breaks(run.array("time")) if quantity.output == "loads" else []
    floor = _ROUNDING * float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
    title = with_capital(quantity.name.replace("_", " "))
    if quantity not in LOADS and quantity.plot is not None:
        title = quantity.plot.title
    frame = (
        ", blade frame"
        if quantity.dimensions[1:2] == ("blade",) and "axis" in quantity.dimensions
        else ""
    )
    if quantity.dimensions[1:] == ("axis",):
        frame = ", base frame"
    if values.ndim == 1:
        parts = {"": [(quantity.name, coordinate_look(0, title.lower()), values)]}
    elif quantity.dimensions[1:] == ("blade", "axis"):
        blades = range(values.shape[1])
        parts = {
            axis: [(f"blade-{i + 1}", blade_look(i), values[:, i, k]) for i in blades]
            for k, axis in enumerate("xyz")
        }
    elif quantity.dimensions[1:] == ("axis",):
        what = quantity.name.partition("_")[0]
        parts = {
            axis: [("rotor", coordinate_look(0, what), values[:, k])]
            for k, axis in enumerate("xyz")
        }
    elif quantity.dimensions[1:] == ("coordinate",):
        looks = [coordinate_look(i, label) for i, label in enumerate(run.labels)]
        parts = {
            "": [
                (f"blade-{i}" if i else "rotor", look, values[:, i]) for i, look in enumerate(looks)
            ]
        }
    else:
        flat = values.reshape(len(values), -1)
        parts = {"": [(f"blade-{i + 1}", blade_look(i), flat[:, i]) for i in range(flat.shape[1])]}
    channels = []
    for axis, curves in parts.items():
        scale, unit = in_units([array for _, _, array in curves], quantity.units)
        scaled = [(key, look, array / scale) for key, look, array in curves]
        channels.append(
            ChannelCurves(
                f"{title} {axis}".strip(), unit, scaled, floor / scale, frame.lstrip(", "), breaks
            )
        )
    return channels


def load_channels(stored: StoredScene, run: StoredRun, jumps: Jumps) -> list[ChannelCurves]:
    """Return the channels of a run's loads, and of quantities of other packages.

    Moments and forces at the blade roots come first, then those of the shaft.

    Parameters
    ----------
    stored : the scene. Only quantities among its outputs are shown.
    run : the run. Quantities that it does not have are left out.
    jumps : jumps of the prescribed loads. Curves of loads are interrupted there.
    """
    channels = []
    built_in = {"angles", "rates", "tip", "energy", ""}
    # Moments come before the forces at the same place, because a root or a shaft is designed for
    # moments.
    first = ("blade_root_moment", "blade_root_force", "shaft_moment", "shaft_force")
    quantities = sorted(
        known_quantities(stored.scene.outputs),
        key=lambda quantity: first.index(quantity.name) if quantity.name in first else len(first),
    )
    for quantity in quantities:
        is_shown = quantity in LOADS or (
            quantity.output not in built_in and quantity.plot is not None
        )
        if is_shown and quantity.name in run:
            channels += quantity_channels(quantity, run, jumps)
    return channels


def values_over(table: Sequence[tuple[float, float]], time: Array) -> tuple[Array, Array]:
    """Return the points of a prescribed load within the duration of a run.

    A load is linear between the rows of its table. The points are therefore these rows, not the
    samples of the run. Points at time 0 and at the end of the run are added if the table has none.

    Parameters
    ----------
    table : rows (time, value) with ascending times in s.
    time : (n,) times of the run's samples, s.

    Returns
    -------
    times, values : (points,) ndarray each
        Times in s, and values in the unit of the table.
    """
    end = float(time[-1])
    points = [(at, value) for at, value in table if 0.0 <= at <= end]
    first, last = (float(values_at(tuple(table), np.array([at]))[0]) for at in (0.0, end))
    if not points or points[0][0] > 0.0:
        points.insert(0, (0.0, first))
    if points[-1][0] < end:
        points.append((end, last))
    times, values = np.array(points, dtype=float).T
    return times, values


# ---- Errors


def positive(values: Array) -> Array:
    """Return the magnitudes of values for a logarithmic axis; NaN for magnitudes up to LOWEST."""
    sizes = np.abs(values)
    result: Array = np.where(sizes > LOWEST, sizes, np.nan)
    return result


def error_curves(runs: Runs, values: Mapping[str, Array], first: int = 0) -> list[Curve]:
    """Return a curve for each method, for a plot with a logarithmic axis.

    Parameters
    ----------
    runs : runs by method.
    values : values of each method, one for each sample from `first` on. Zeros are gaps.
    first : index of the sample to which the first value belongs.
    """
    curves = []
    for method, array in values.items():
        time = runs[method].array("time")[first : first + len(array)]
        curves.append(Curve(method, look_of(method), time, positive(array)))
    return curves


def error_plot(
    name: str, unit: str, curves: Sequence[Curve], axis: Horizontal, **more: object
) -> Plot:
    """Return a plot of errors on a logarithmic axis; `more` are further fields of the `Plot`."""
    plot = Plot(name, unit, axis, curves, 240, log=True)
    return replace(plot, **more)  # type: ignore[arg-type]


def angle_errors(scene: StoredScene, runs: Runs) -> dict[str, Array]:
    """Return the angle error of each run at its samples, (n,) rad, by method.

    The error at a sample is the largest over the coordinates. Runs without angles are left out. The
    dict is empty if there is no reference with angles.
    """
    reference = scene.reference
    if reference is None or "angles" not in reference:
        return {}
    others = {
        method: run for method, run in runs.items() if method != REFERENCE and "angles" in run
    }
    return {method: angle_difference(run, reference) for method, run in others.items()}


def energy_errors(runs: Runs) -> dict[str, Array]:
    """Return the magnitude of each run's energy error, relative to its energy scale, by method.

    Each array is (n,). Runs without an energy error or a scale, and the reference, are left out.
    """
    errors = {}
    for method, run in runs.items():
        scale = None if method == REFERENCE else run.attributes.get("energy_scale_J")
        if "energy_error" in run and isinstance(scale, float):
            errors[method] = np.abs(run.array("energy_error")) / (scale or 1.0)
    return errors


def interval_errors(runs: Runs) -> dict[str, Array]:
    """Return the interval defects of each run in the file, (n - 1,) rad, by method.

    Runs without stored defects are left out, because pages integrate nothing.
    """
    sizes = {}
    for method, run in runs.items():
        if DEFECT in run and run.samples > 1:
            sizes[method] = np.asarray(run.array(DEFECT)[1:], dtype=float)
    return sizes
