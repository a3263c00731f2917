"""The pictures of a scene from plain arrays: motion, difference, energy, paths. Knows no file and no page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.report import texts
from rotor_mbs.report.core import canvas
from rotor_mbs.report.core.canvas import Panels
from rotor_mbs.report.names import GREY, Look, coordinate_look

Array = NDArray[Any]

# Below this nothing is drawn on a log axis: a hundredth of the rounding of a double of order one.
LOWEST = 1e-18
_HIGHEST = 1e4
# A runaway that leaves the rest of a run flat on the axis is cut off: this many times what nine tenths stay below.
_RUNAWAY = 8.0
# A range (rad, rad/s; of energies, of their scale) that is rounding, not motion.
_NOTHING = 1e-9
_MARKS = 26  # marks along a curve


class Motion(NamedTuple):
    """A run to be drawn: time (n,) s, angles and rates (n, coordinates); either may be missing."""

    time: Array
    angles: Array | None
    rates: Array | None


class Series(NamedTuple):
    """A curve over time with its look."""

    time: Array
    values: Array
    look: Look


def motion(run: Motion, marked: Sequence[tuple[Motion, Look]] = (), horizon: float | None = None) -> Panels:
    """Position above, velocity below; `run` as lines, the runs in `marked` as sparse marks upon them."""
    pairs = ((texts.ANGLE_AXIS, 1, run.angles), (texts.RATE_AXIS, 2, run.rates))
    drawn = [(label, i, values) for label, i, values in pairs if values is not None]
    picture = canvas.panels((2.0,) * len(drawn), texts.TIME_AXIS)
    for axes, (label, i, values) in zip(picture.axes, drawn, strict=True):
        for column, curve in enumerate(values.T):
            colour, line = coordinate_look(column)
            axes.plot(*thin(run.time, curve), color=colour, linestyle=line)
        for place, (other, look) in enumerate(marked):
            theirs = other[i]
            if theirs is not None:
                _marks(axes, other.time, theirs, look, place / len(marked))
        axes.set_ylabel(label)
        set_range(axes, values)
        _horizon(axes, run.time, horizon)
    return picture


def rotor(series: Sequence[Series], horizon: float | None) -> Panels:
    """The rotor's angle alone, of several runs on one axis."""
    picture = canvas.panels((2.3,), texts.TIME_AXIS)
    axes = picture.axes[0]
    for one in series:
        axes.plot(*thin(one.time, one.values), color=one.look.colour, linestyle=one.look.line, linewidth=1.6)
    axes.set_ylabel(texts.ROTOR_AXIS)
    _horizon(axes, max((one.time for one in series), key=lambda time: float(time[-1])), horizon)
    return picture


def _marks(axes: Any, time: Array, values: Array, look: Look, offset: float) -> None:
    """Marks in each coordinate's colour; the offset keeps those of different runs apart."""
    every = max(1, len(time) // _MARKS)
    chosen = slice(int(offset * every), None, every)
    for column, series in enumerate(values.T):
        colour, _ = coordinate_look(column)
        axes.plot(
            time[chosen], series[chosen], linestyle="none", marker=look.marker, markersize=4.2,
            markerfacecolor="none", markeredgecolor=colour, markeredgewidth=0.8,
        )  # fmt: skip


def difference(
    series: Sequence[Series],
    carried: tuple[Array, Array] | None,
    uncertainty: tuple[Array, Array] | None,
    horizon: float | None,
) -> Panels:
    """Largest angle difference of each run from the reference.

    carried: what rounding at the start grows to; uncertainty: the reference's own, both (time, rad).
    """
    picture = canvas.panels((3.1,), texts.TIME_AXIS)
    axes = picture.axes[0]
    peaks = []
    if carried is not None:
        time, values = _peaks(*carried)
        axes.plot(time, values, color=GREY, linestyle=":", linewidth=1.6)
    if uncertainty is not None and uncertainty[1].max() > LOWEST:
        axes.plot(*_peaks(*uncertainty), color=GREY, linewidth=2.0)
    for one in series:
        time, values = _peaks(one.time, one.values)
        peaks.append(np.nanmax(values, initial=LOWEST))
        _with_sparse_marks(axes, time, values, one.look)
    canvas.log_axis(axes, LOWEST, min(max([1e-9, *peaks]), _HIGHEST))
    axes.set_ylabel(texts.DIFFERENCE_AXIS)
    if series:
        _horizon(axes, series[0].time, horizon)
    return picture


def energies(time: Array, curves: Sequence[Array], scale: float) -> Panels:
    """Kinetic, potential, and their sum less the work, with an SI prefix; a runaway beyond 3 `scale` is cut off."""
    picture = canvas.panels((2.3,), texts.TIME_AXIS)
    axes = picture.axes[0]
    largest = max(float(np.abs(curve).max()) for curve in curves)
    top = min(largest, 3.0 * scale) if scale > 0.0 else largest
    factor, prefix = next(((f, p) for f, p in ((1e6, "M"), (1e3, "k")) if top >= f), (1.0, ""))
    for curve, (colour, line, width) in zip(curves, ENERGY_LOOKS, strict=True):
        # The total is drawn beneath, and wide: where the others are small it would hide the kinetic energy.
        axes.plot(*thin(time, curve / factor), color=colour, linestyle=line, linewidth=width, zorder=3.0 - 0.1 * width)
    if largest < _NOTHING * scale:
        axes.set_ylim(-1e-3 * scale, 1e-3 * scale)
    if largest > 3.0 * scale > 0.0:
        axes.set_ylim(-2.0 * scale / factor, 3.0 * scale / factor)
    axes.set_ylabel(texts.energy_axis(prefix))
    return picture


ENERGY_LOOKS = (("#d55e00", "-", 1.2), ("#0072b2", "--", 1.2), ("#000000", "-", 2.6))


def energy_errors(series: Sequence[Series], relative: bool, horizon: float | None) -> Panels:
    """|total less work, less its start| of each run, of the scene's energy scale where `relative`, else in J."""
    picture = canvas.panels((2.7,), texts.TIME_AXIS)
    axes = picture.axes[0]
    lowest, highest = [], []
    for one in series:
        time, values = _peaks(one.time, one.values)
        if np.isfinite(values).any():
            lowest.append(np.nanmin(values))
            highest.append(np.nanmax(values))
        _with_sparse_marks(axes, time, values, one.look)
    canvas.log_axis(axes, max(min(lowest, default=1e-17), 1e-18), max(highest, default=1e-9))
    axes.set_ylabel(texts.ENERGY_ERROR_RELATIVE_AXIS if relative else texts.ENERGY_ERROR_AXIS)
    if series:
        _horizon(axes, series[0].time, horizon)
    return picture


def paths(time: Array, tip: Array) -> Panels:
    """Paths of the tips (n, blades, 3) in space with the wire frame at start (dashed) and end; below, where blades
    pitch, how far each tip is along the shaft."""
    reach = 1.04 * float(np.linalg.norm(tip, axis=2).max())
    off_plane = bool(np.abs(tip[:, :, 1]).max() > 1e-12 * reach)
    picture = canvas.space_above(1.25 if off_plane else 0.0, reach, 0.5 * reach)
    space = picture.axes[0]
    space.plot((0, 0), (0, -0.5 * reach), (0, 0), color=GREY, linewidth=3.0, solid_capstyle="butt")
    for blade in range(tip.shape[1]):
        colour, line = coordinate_look(blade + 1)
        path = tip[:, blade]
        space.plot(*path.T, color=colour, linewidth=0.8, alpha=0.75)
        for end, dashes, mark in ((path[0], (0, (3, 2)), "none"), (path[-1], "-", colour)):
            space.plot(*np.array([np.zeros(3), end]).T, color=colour, linestyle=dashes, linewidth=2.0)
            space.plot(*end[:, None], marker="o", markersize=5, markeredgecolor=colour, markerfacecolor=mark)
        if off_plane:
            picture.axes[1].plot(*thin(time, 1e3 * path[:, 1]), color=colour, linestyle=line, linewidth=1.0)
    if off_plane:
        picture.axes[1].set(xlabel=texts.TIME_AXIS, ylabel=texts.ALONG_SHAFT_AXIS)
    return picture


def thin(time: Array, values: Array, bins: int = 400) -> tuple[Array, Array]:
    """The lowest and highest sample of each of about `bins` stretches, in order: no peak is lost."""
    if len(time) <= 2 * bins:
        return time, values
    table = _stretches(values, bins)
    starts = np.arange(len(table)) * table.shape[1]
    found = np.concatenate([[0, len(time) - 1], starts + table.argmin(axis=1), starts + table.argmax(axis=1)])
    index = np.unique(np.minimum(found, len(time) - 1))
    return time[index], values[index]


def _peaks(time: Array, values: Array, bins: int = 250) -> tuple[Array, Array]:
    """The largest of each stretch of samples at its time; what a log axis cannot show (zero) is left out as a gap."""
    if len(time) > 2 * bins:
        table = _stretches(values, bins)
        index = np.minimum(np.arange(len(table)) * table.shape[1] + table.argmax(axis=1), len(time) - 1)
        time, values = time[index], values[index]
    return time, np.where(values > LOWEST, values, np.nan)


def _stretches(values: Array, bins: int) -> Array:
    """(about bins, samples each); the last one filled up with the last value."""
    size = -(-len(values) // bins)
    filled = np.pad(values, (0, -len(values) % size), mode="edge")
    return filled.reshape(-1, size)


def _with_sparse_marks(axes: Any, time: Array, values: Array, look: Look) -> None:
    axes.plot(
        time, values, color=look.colour, linestyle=look.line, marker=look.marker, markersize=4.2,
        markerfacecolor="white", markevery=(0.03, 0.12), linewidth=1.0,
    )  # fmt: skip


def set_range(axes: Any, values: Array) -> None:
    """Cuts off a runaway; does not blow up rounding where nothing moves."""
    if is_cut(values):
        usual = float(np.quantile(np.abs(values).max(axis=1), 0.9))
        axes.set_ylim(-2.0 * usual, 2.0 * usual)
    elif values.max() - values.min() < _NOTHING:
        middle = 0.5 * float(values.max() + values.min())
        axes.set_ylim(middle - 0.1, middle + 0.1)


def is_cut(values: Array) -> bool:
    """Whether `motion` would cut off a runaway of these angles or rates."""
    largest = np.abs(values).max(axis=1)
    return bool(largest.max() > _RUNAWAY * float(np.quantile(largest, 0.9)) > 0.0)


def _horizon(axes: Any, time: Array, horizon: float | None) -> None:
    """A vertical line, where the horizon lies before the end of what is drawn."""
    if horizon is not None and horizon < time[-1]:
        axes.axvline(horizon, color=GREY, linestyle=(0, (2, 2)), linewidth=1.3)
