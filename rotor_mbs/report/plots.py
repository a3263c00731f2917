"""Plot motion, energies and errors over time, and paths of the blade tips.

The functions plot arrays. The classes plot runs that are in memory, for notebooks and scripts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from rotor_mbs.errors import InputError, shown_value
from rotor_mbs.report import canvas
from rotor_mbs.report.canvas import TIME_AXIS, Panels
from rotor_mbs.report.curves import extremes
from rotor_mbs.report.looks import BLUE, GREY, INK, VERMILLION, Look, coordinate_look, look_of
from rotor_mbs.report.numbers import prefix_of, with_unit
from rotor_mbs.report.tip_paths import picture_of
from rotor_mbs.solution.metrics import angle_error, energy_scale, horizon
from rotor_mbs.solution.quantities import DEFECT, LOADS, Plot, Quantity
from rotor_mbs.solution.trajectory import Array, Solution, Trajectory

ANGLE_AXIS, RATE_AXIS = "angle (rad)", "rate (rad/s)"
# Values up to this one are gaps on a logarithmic axis. It is a hundredth of the rounding error of a
# double of order one.
LOWEST = 1e-18
# In the unit of the curve: larger errors, which only a divergence has, are drawn at this value.
HIGHEST = 1e15
# Values are a divergence, and are cut off, if the largest one exceeds the 90 % quantile by this
# factor.
_RUNAWAY = 8.0
# For this comparison the largest value counts as at most this many times the last samples. A larger
# value is a peak after which the motion is small again.
_STILL = 10.0
# rad or rad/s: a smaller range of values is rounding error.
_ROUNDING = 1e-9
_MAX_POINTS = 4000  # approximate largest number of points of a drawn curve; see `thin`


class Series(NamedTuple):
    """A curve over time: times (n,) in s, values (n,), and look."""

    time: Array
    values: Array
    look: Look


def motion(
    time: Array, angles: Array | None, rates: Array | None, horizon: float | None = None
) -> Panels:
    """Plot angles and rates over time in up to four panels: rotor and pitches separately.

    Parameters
    ----------
    time : (n,) s.
    angles, rates : (n, coordinates) rad and rad/s, rotor first; None for no panels of these values.
    horizon : horizon in s, which is marked by a line; None for no line.
    """
    rows: list[tuple[str, Sequence[Series]]] = []
    for name, values in ((ANGLE_AXIS, angles), (RATE_AXIS, rates)):
        if values is not None:
            series = coordinate_series(time, values)
            rows += [(f"rotor {name}", series[:1]), (f"pitch {name}", series[1:])]
    rows = [row for row in rows if row[1]]
    return lines(rows, horizon, [1.45 if label.startswith("pitch") else 1.1 for label, _ in rows])


def coordinate_series(time: Array, values: Array) -> list[Series]:
    """Return a curve for each coordinate of `values` (n, coordinates), with its look."""
    return [Series(time, x, coordinate_look(i)) for i, x in enumerate(values.T)]


def draw_lines(axes: Any, series: Sequence[Series], label: str) -> None:
    """Draw curves over time on one vertical axis, and label the axis.

    Parameters
    ----------
    axes : axes of matplotlib.
    series : the curves; at least one. Long curves are thinned.
    label : label of the axis with the unit in brackets. If the values are large, the unit gets a
        prefix: k, M or G. Units that begin with rad get none.
    """
    shortest = min(len(curve.values) for curve in series)
    values = np.stack([curve.values[:shortest] for curve in series], axis=1)
    scale, prefix = prefix_of(
        float(np.abs(values).max()) if "(" in label and "(rad" not in label else 1.0
    )
    for curve in series:
        canvas.curve(axes, *thin(curve.time, curve.values / scale), curve.look)
    if "(rad" in label:
        set_range(axes, values)
    axes.set_ylabel(label.replace("(", f"({prefix}", 1))


def set_range(axes: Any, values: Array) -> None:
    """Set the vertical range so that neither a divergence nor rounding errors fill it.

    The range is not changed if the values have neither a divergence nor a range of rounding errors.

    Parameters
    ----------
    axes : axes of matplotlib.
    values : (n, curves) values of the curves, rad or rad/s.
    """
    if is_cut(values):
        usual = float(np.quantile(np.abs(values).max(axis=1), 0.9))
        axes.set_ylim(-2.0 * usual, 2.0 * usual)
    elif values.max() - values.min() < _ROUNDING:
        middle = 0.5 * float(values.max() + values.min())
        # A margin of 0.1 would be lost to rounding if the middle is about 1e15 or more.
        margin = 0.1 if middle + 0.1 > middle else 0.05 * abs(middle)
        axes.set_ylim(middle - margin, middle + margin)


def lines(
    rows: Sequence[tuple[str, Sequence[Series]]],
    horizon: float | None = None,
    heights: Sequence[float] = (),
) -> Panels:
    """Plot curves over time in panels one below the other.

    Parameters
    ----------
    rows : for each panel the label of its vertical axis, with a unit in brackets, and its curves.
    horizon : horizon in s, which is marked by a line; None for no line.
    heights : heights of the panels, in; () for equal heights.
    """
    panels = canvas.panels(tuple(heights) or (2.3,) * len(rows), TIME_AXIS)
    for axes, (label, series) in zip(panels.axes, rows, strict=True):
        draw_lines(axes, series, label)
        mark_time(axes, max(float(curve.time[-1]) for curve in series), horizon)
    return panels


def component_panels(quantity: Quantity, plot: Plot, time: Array, values: Array) -> Panels:
    """Plot the components of a quantity over time.

    Vectors of blades have a panel for each axis, with a line for each blade. Any other quantity has
    one panel, with a line for each axis or for each blade.

    Parameters
    ----------
    quantity : quantity whose second dimension is "blade" or "axis".
    plot : how the quantity is plotted; it has the label of the vertical axis.
    time : (n,) s.
    values : (n, blades, 3), (n, blades) or (n, 3), in the quantity's unit.
    """
    # A line of a blade has the look of the blade's pitch angle, which is coordinate 1, 2, ...
    first = 1 if quantity.dimensions[1] == "blade" else 0
    names = "xyz" if first == 0 else [f"blade {i + 1}" for i in range(values.shape[1])]
    panels = "xyz" if values.ndim == 3 else [""]
    components = values.reshape(*values.shape[:2], -1)
    rows = []
    for k, panel in enumerate(panels):
        looks = [coordinate_look(first + i, name) for i, name in enumerate(names)]
        curves = [Series(time, components[:, i, k], look) for i, look in enumerate(looks)]
        rows.append((f"{panel} {plot.axis}".strip(), curves))
    return lines(rows, heights=[2.3 if len(rows) == 1 else 1.3] * len(rows))


def errors(series: Sequence[Series], label: str, horizon: float | None = None) -> Panels:
    """Plot magnitudes over time on a logarithmic axis that begins at 1 or less.

    Parameters
    ----------
    series : the curves. Values up to LOWEST are gaps; values beyond HIGHEST are drawn at HIGHEST.
    label : label of the vertical axis.
    horizon : horizon in s, which is marked by a line; None for no line.
    """
    panels = canvas.panels((2.9,), TIME_AXIS)
    axes, known = panels.axes[0], []
    for curve in series:
        time, values = thin(curve.time, np.abs(curve.values))
        sizes = np.where(np.abs(values) > LOWEST, np.minimum(np.abs(values), HIGHEST), np.nan)
        first, step = len(time) // 30, max(1, len(time) // 8)
        canvas.curve(
            axes,
            time,
            sizes,
            curve.look,
            1.0 if curve.look.marker else 1.8,
            markevery=(first, step),
        )
        known += sizes[np.isfinite(sizes)].tolist()
    # The factor lowers the axis a little, so that a curve at a power of ten does not lie on it.
    lowest = 0.7 * max(min([*known, 1.0] if known else [LOWEST]), LOWEST)
    canvas.log_axis(axes, lowest, max(known, default=1e-9))
    axes.set_ylabel(label)
    if series:
        mark_time(axes, float(series[0].time[-1]), horizon)
    return panels


def thin(time: Array, values: Array) -> tuple[Array, Array]:
    """Return the samples of a curve that are drawn if it has too many.

    They are the first and the last sample, and the smallest and the largest one of equally long
    intervals, so that no peak is lost. A short curve is returned whole.

    Parameters
    ----------
    time, values : (n,) times and values of the curve.
    """
    index = extremes(values, _MAX_POINTS)
    return time[index], values[index]


def is_cut(values: Array) -> bool:
    """Return whether the largest of these values are a divergence.

    They are a divergence if they exceed the usual values by far, and the last samples are not small
    again. A peak after which the values are small again is not a divergence.

    Parameters
    ----------
    values : (n, curves).
    """
    largest = np.abs(values).max(axis=1)
    usual = float(np.quantile(largest, 0.9))
    # The limit of _STILL times the last samples excludes a peak after which the values are small.
    return bool(min(largest.max(), _STILL * largest[-5:].max()) > _RUNAWAY * usual > 0.0)


def mark_time(axes: Any, end: float, horizon: float | None) -> None:
    """Draw a vertical line at the horizon, if the horizon is before the end of the curves.

    Parameters
    ----------
    axes : axes of matplotlib.
    end : time of the last sample that is drawn, s.
    horizon : horizon in s; None for no line.
    """
    if horizon is not None and horizon < end:
        axes.axvline(
            horizon,
            color=GREY,
            linestyle="--",
            linewidth=1.3,
            label=f"horizon {with_unit(horizon, 's', 3)}",
        )


def paths(tip: Array, tilt: float = 0.0) -> Panels:
    """Plot the paths of the blade tips.

    Parameters
    ----------
    tip : (n, blades, 3) positions of the tips, m, base frame.
    tilt : tilt of the shaft, rad.
    """
    panels = canvas.panels((4.1,), "")
    draw_paths(panels.axes[0], tip, tilt)
    return panels


def draw_paths(axes: Any, tip: Array, tilt: float = 0.0) -> None:
    """Draw the paths of the blade tips, with the blades, the shaft and a scale.

    The blades are drawn at the start (dashed) and at the end (solid).

    Parameters
    ----------
    axes : axes of matplotlib.
    tip : (n, blades, 3) positions of the tips, m, base frame.
    tilt : tilt of the shaft, rad.
    """
    reach, lines, texts = picture_of(tip, tilt)
    axes.set(xlim=(-0.95 * reach, 0.95 * reach), ylim=(-1.02 * reach, 1.02 * reach), aspect="equal")
    axes.set_axis_off()
    for line in lines:
        axes.plot(
            *line.points.T,
            color=line.colour,
            linewidth=line.width,
            linestyle=(0, (3, 2)) if line.dashed else "-",
            label=line.label or "_",
        )
        if line.end:
            fill = "white" if line.end == "hollow" else line.colour
            axes.plot(
                *line.points[-1:].T, color=line.colour, marker="o", markersize=4,
                markerfacecolor=fill,
            )  # fmt: skip
    for place, text in texts:
        side = "left" if text == texts[-1][1] else "center"
        axes.text(*place, text, color=GREY, ha=side, va="center", fontsize="small")
    # Lines without points make entries in the legend.
    for dashes, width, label in (
        ("--", 1.6, "blade at the start"),
        ("-", 1.6, "at the end"),
        ("-", 3.0, "shaft"),
    ):
        axes.plot([], [], color=GREY, linestyle=dashes, linewidth=width, label=label)


class ComparisonPlots:
    """Plots of several runs of one scene; each method returns a figure."""

    def __init__(self, runs: Mapping[str, Solution], reference: Trajectory | None) -> None:
        self._runs, self._reference = list(runs.values()), reference

    def __call__(self) -> Panels:
        """Plot the largest angle error of each run over time, as `error` does."""
        return self.error()

    def error(self) -> Panels:
        """Plot the largest angle error (rad) of each run over time.

        Raises
        ------
        InputError
            If there is no reference, or a run has no angles.
        """
        if self._reference is None:
            raise InputError(
                "no reference to compare with; allowed: run(..., reference=True) computes one"
            )
        for run in self._runs:
            _quantity(run, "angles")
        series = self._series([angle_error(run.trajectory, self._reference) for run in self._runs])
        return errors(series, "largest angle error (rad)", horizon(self._reference)).with_legend()

    def defects(self) -> Panels:
        """Plot the interval defects (rad) of each run over time.

        If a run has no stored defects, as a run of a sweep, they are computed from its angles and
        rates.

        Raises
        ------
        InputError
            If a run has fewer than two samples, or has neither stored defects nor angles and rates.
        """
        series = []
        for run in self._runs:
            if len(run.time) < 2:
                raise InputError("the run has fewer than two samples; no interval to plot")
            stored = run.trajectory.get(DEFECT)
            if stored is not None:
                sizes = stored[1:]
            else:
                # Imported only here, because this module imports SciPy and an engine.
                from rotor_mbs.models.lagrange.defects import interval_defects

                angles, rates = _quantity(run, "angles"), _quantity(run, "rates")
                sizes = interval_defects(run.scene, run.time, angles, rates).sizes
            series.append(Series(run.time[1:], sizes, look_of(run.method)))
        return errors(series, "defect (rad)").with_legend()

    def rotor(self) -> Panels:
        """Plot the rotor angle (rad) of each run over time.

        Raises
        ------
        InputError
            If a run has no angles.
        """
        series = self._series([_quantity(run, "angles")[:, 0] for run in self._runs])
        return lines([("rotor angle (rad)", series)]).with_legend()

    def energy_error(self) -> Panels:
        """Plot the energy error of each run, relative to its energy scale, over time.

        Raises
        ------
        InputError
            If a run has no energies.
        """
        shares = []
        for run in self._runs:
            scale = energy_scale(run.scene, run.trajectory)
            shares.append(np.abs(_quantity(run, "energy_error")) / (scale or 1.0))
        return errors(self._series(shares), "energy error / energy scale").with_legend()

    def _series(self, values: Sequence[Array]) -> list[Series]:
        pairs = zip(self._runs, values, strict=True)
        return [
            Series(_some(run.time)[: len(array)], array, look_of(run.method))
            for run, array in pairs
        ]


class RunPlots(ComparisonPlots):
    """Plots of one run; each method returns a figure."""

    def __init__(self, run: Solution, reference: Trajectory | None) -> None:
        super().__init__({run.method: run}, reference)
        self._run = run

    def __call__(self) -> Panels:
        """Plot angles (rad) and rates (rad/s) of rotor and pitches over time (s).

        Raises
        ------
        InputError
            If the run has no samples, or neither angles nor rates.
        """
        run = self._run
        horizon_s = None if self._reference is None else horizon(self._reference)
        angles, rates = (
            None if np.isnan(values).all() else values for values in (run.angles, run.rates)
        )
        shown = _quantity(run, "angles") if rates is None else angles
        return motion(_some(run.time), shown, rates, horizon_s).with_legend()

    def energy(self) -> Panels:
        """Plot kinetic and potential energy, and their sum minus the work (J), over time.

        Raises
        ------
        InputError
            If the run has no energies.
        """
        run = self._run
        kinetic, potential, work = (
            _quantity(run, name) for name in ("kinetic_energy", "potential_energy", "work")
        )
        curves = (
            (kinetic, Look(VERMILLION, "-", "", "kinetic")),
            (potential, Look(BLUE, "--", "", "potential")),
            (kinetic + potential - work, Look(INK, "-", "", "total minus work")),
        )
        return lines([("energy (J)", [Series(run.time, *curve) for curve in curves])]).with_legend()

    def loads(self, name: str = "blade_root_force") -> Panels:
        """Plot a load over time.

        A force or a moment at the blade roots has a panel for each axis, with a line for each
        blade. Any other load has one panel, with a line for each axis or for each blade.

        Parameters
        ----------
        name : blade_root_force, blade_root_moment, shaft_force, shaft_moment or
            pitch_actuator_moment (N, N m).

        Raises
        ------
        InputError
            If `name` is another name, or the run does not have the load.
        """
        plotted = {load.name: load for load in LOADS if load.plot is not None}
        load = plotted.get(name)
        if load is None or load.plot is None:
            raise InputError(f"no load {shown_value(name)}; allowed: {', '.join(plotted)}")
        values = _quantity(self._run, name)
        return component_panels(load, load.plot, self._run.time, values).with_legend()

    def tips(self) -> Panels:
        """Plot the paths of the blade tips (m).

        Raises
        ------
        InputError
            If the run does not have these paths.
        """
        _some(self._run.time)
        return paths(_quantity(self._run, "tip"), self._run.scene.shaft_tilt).with_legend()


def _some(time: Array) -> Array:
    if not len(time):
        raise InputError("the run has no samples; nothing to plot")
    return time


def _quantity(run: Solution, name: str) -> Array:
    """Return a quantity of a run by its name.

    Raises
    ------
    InputError
        If the run has no samples or no such quantity, or its file does not store the quantity.
    """
    _some(run.time)
    try:
        values = run[name]
    except KeyError as exc:
        raise InputError(f"{run.scene.name} {run.method} has no {exc.args[0]}") from exc
    if np.isnan(values).all():
        raise InputError(
            f"{run.scene.name} {run.method}: {name} are not stored; allowed: {name} in `outputs`"
        )
    return values
