"""The page of a sweep, from its dataset alone: what was varied, how the runs ended, distributions, and its picture: how
fast nearby starts part (Lyapunov exponent), or a map of stability."""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.report.canvas import TIME_AXIS, Panels, colour_map, curve, growth_map, log_axis, panels
from rotor_mbs.report.elements import PageTable, Picture, Section, picture
from rotor_mbs.report.looks import BLUE, VERMILLION, Look, with_capital
from rotor_mbs.report.numbers import SPACE
from rotor_mbs.report.pages import words_of
from rotor_mbs.runs.sweeps import StoredSweep, parameter_name
from rotor_mbs.scenario.scene import parse_scene
from rotor_mbs.solution.status import GOOD, STATUSES
from rotor_mbs.solution.trajectory import Array

_SPAN = 50.0  # between the smallest and the largest value, beyond which a distribution has a logarithmic axis
_COUNTS = ("steps", "rhs_evaluations", "time_reached")  # columns that say nothing of the motion
# What is drawn over the parameters: the first of these that differs from run to run.
_RESPONSES = ("pitch_max", "rotor_rate_max", "rotor_angle_max")
_MAX_RESPONSES = 3
_MAX_POINTS = 200  # of a distribution
_MAX_RUNS = 1000  # that have a point
_MAX_GROWTH = 1e4  # the colours end there: the pitch has turned many times
_COORDINATE = re.compile(r"initial\.(angles|rates)\[(\d+)\]")


def sweep_page(sweep: StoredSweep) -> dict[str, object]:
    """The content of the page."""
    statuses = np.asarray(sweep.column("status"))
    ok = np.isin(statuses, [code for code, status in enumerate(STATUSES) if status in GOOD])
    lines = [with_capital(sweep.attributes["summary"].rstrip(".")) + "."]
    plots = _responses(sweep, ok)
    if _picture_kind(sweep):
        try:
            panels, caption, line = _asked_picture(sweep)
            plots = [picture(panels, "asked", caption)]
        except (InputError, StoreError) as exc:
            line = f"No picture: {exc}."
        lines.append(line)
    distributions = []
    left_out = {*map(parameter_name, sweep.keys), *_COUNTS}
    for name, column in sweep.columns.items():
        if column.dimensions != ("run",) or name in left_out or sweep.column(name).dtype.kind != "f":
            continue
        values = sweep.column(name)[ok]
        values = values[np.isfinite(values)]
        if len(values) < 2 or not np.ptp(values):
            continue
        low, middle, high = (f"{value:.6g}" for value in np.quantile(values, (0.05, 0.5, 0.95)))
        caption = _axis(with_capital(column.long_name), column.units)
        note = f"Median {middle}, 5 to 95 % from {low} to {high}."
        panels = distribution(values, _axis(name.replace("_", " "), column.units), logarithmic=_is_wide(values))
        distributions.append(picture(panels, f"of-{name}", caption, [note]))
    codes, counts = np.unique(statuses, return_counts=True)
    status_rows = [
        (words_of(STATUSES[code]) if code >= 0 else "missing", str(count), f"{100.0 * count / len(statuses):.1f} %")
        for code, count in sorted(zip(codes.tolist(), counts.tolist(), strict=True), key=lambda pair: -pair[1])
    ]
    parameter_rows = []
    for key in sweep.keys:
        name = parameter_name(key)
        values, unit = sweep.column(name), sweep.columns[name].units
        limits = [f"{value:.12g}{SPACE}{unit}" for value in (np.nanmin(values), np.nanmax(values))]
        parameter_rows.append((field_name(key), key, *limits, str(len(np.unique(values)))))
    head = ("Parameter", "Key", "From", "To", "Values")
    return {
        "title": sweep.attributes["title"],
        "summary": lines,
        "plots": Section(plots),
        "statuses": Section(tables=[PageTable("", ("Status", "Runs", "Share"), status_rows)]),
        "parameters": Section(tables=[PageTable("", head, parameter_rows)]),
        "distributions": Section(distributions),
        "toml": str(sweep.attributes.get("sweep_toml", "")),
    }


def field_name(key: str) -> str:
    """A varied parameter as one speaks of it: "initial pitch angle of blade 2" for "initial.angles[2]"."""
    parts = _COORDINATE.fullmatch(key)
    if parts is None:
        return re.sub(r"[._]", " ", key)
    is_rate, coordinate = parts[1] == "rates", int(parts[2])
    if not coordinate:
        return "initial rotor speed" if is_rate else "initial rotor angle"
    return f"initial pitch {'rate' if is_rate else 'angle'} of blade {coordinate}"


def save_picture(sweep: StoredSweep, path: Path) -> str:
    """The picture that the sweep's file asks for, as a file; a line about it. Raises InputError, StoreError."""
    panels, _, line = _asked_picture(sweep)
    panels.with_legend().save(path)
    return f"{path}: {line}"


def _picture_kind(sweep: StoredSweep) -> str:
    """The kind of picture that the sweep's file asks for; "" where it asks for none."""
    try:
        return str(tomllib.loads(str(sweep.attributes.get("sweep_toml", ""))).get("picture", ""))
    except tomllib.TOMLDecodeError:
        return ""


def _asked_picture(sweep: StoredSweep) -> tuple[Panels, str, str]:
    """That picture, its caption, its result in a line."""
    if _picture_kind(sweep) == "spread":
        spread = spread_of(sweep)
        line = (
            f"Neighbouring trajectories: largest Lyapunov exponent {_rate(spread)} ({spread.pairs} pairs, "
            f"{spread.start:.2f} to {spread.end:.2f} s)."
        )
        return spread_panels(spread), "Separation of neighbouring trajectories", line
    start = parse_scene(str(sweep.attributes["scene_toml"]), str(sweep.attributes["base_scene"])).initial_angles
    growth = stability_map(sweep, max(map(abs, start[1:]), default=0.0))
    y_label, x_label = (_axis(field_name(key), sweep.columns[parameter_name(key)].units) for key in sweep.keys)
    line = f"The pitches grow {GROWN:g}-fold in {growth.unstable.sum()} of {growth.growth.size} runs."
    caption = "Growth of the pitches: largest pitch of a run, divided by the largest initial pitch"
    return map_panels(growth, x_label, y_label), caption, line


def _rate(spread: Spread) -> str:
    return f"{spread.exponent:.3f} ± {spread.uncertainty:.3f} per s"


def _responses(sweep: StoredSweep, ok: NDArray[np.bool_]) -> list[Picture]:
    """A number of each run that ended well over what was varied: a map of a grid of two axes, else points."""
    for name in _RESPONSES:
        values = np.where(ok, sweep.column(name), np.nan) if name in sweep.columns else np.empty(0)
        if np.isfinite(values).sum() > 1 and np.nanmax(values) > np.nanmin(values):
            break
    else:
        return []
    quantity = sweep.columns[name].long_name
    label = _axis(quantity, sweep.columns[name].units)
    axes = {key: sweep.column(parameter_name(key)) for key in sweep.keys}
    labels = {key: _axis(field_name(key), sweep.columns[parameter_name(key)].units) for key in sweep.keys}
    shape = json.loads(sweep.attributes.get("shape", "[]"))  # of a grid: values along every axis, slowest first
    if len(shape) == len(axes) == 2 and min(shape) > 1:
        rows, columns = shape
        y, x, grid = (numbers[: rows * columns].reshape(rows, columns) for numbers in (*axes.values(), values))
        y_label, x_label = labels.values()
        panels = colour_map(x[0], y[:, 0], grid, (x_label, y_label, label))
        panels.axes[0].set(xscale="log" if _is_wide(x) else "linear", yscale="log" if _is_wide(y) else "linear")
        return [picture(panels, "grid", with_capital(quantity))]
    pictures = []
    known = np.isfinite(values)
    for key in sweep.keys[:_MAX_RESPONSES]:
        parameter = axes[key][known]
        if np.ptp(parameter):
            panels = response(parameter, values[known], labels[key], label, logarithmic=_is_wide(parameter))
            caption = f"{with_capital(quantity)} of each run over the {field_name(key)}"
            pictures.append(picture(panels, f"over-{parameter_name(key)}", caption))
    return pictures


def _axis(label: str, unit: str) -> str:
    return label if unit == "1" else f"{label} ({unit})"


def _is_wide(values: Array) -> bool:
    """Whether a logarithmic axis shows more."""
    return bool(values.min() > 0.0 and values.max() > _SPAN * values.min())


def spread_panels(spread: Spread) -> Panels:
    """Separation over time on a log scale, with the fitted exponential growth."""
    panel = panels((3.6,), TIME_AXIS)
    axes = panel.axes[0]
    seen = spread.low > 0.0
    label = f"10 to 90 % of {spread.pairs} pairs"
    axes.fill_between(spread.time[seen], spread.low[seen], spread.high[seen], color=BLUE, alpha=0.2, lw=0, label=label)
    curve(axes, spread.time, spread.median, Look(BLUE, "-", "", "median"))
    inside = (spread.time >= spread.start) & (spread.time <= spread.end)
    time, growth = spread.time[inside], spread.growth[inside]
    # Through the window's middle, at the slope that was found.
    fitted = np.exp(np.log(growth).mean() + spread.exponent * (time - time.mean()))
    curve(axes, time, fitted, Look(VERMILLION, "--", "", f"growth {_rate(spread)}"))
    log_axis(axes, float(spread.low[seen].min()), float(spread.high.max()))
    axes.set_ylabel("separation of the angles (rad)")
    return panel


def map_panels(growth: StabilityMap, x_label: str, y_label: str) -> Panels:
    """Growth of the pitches as colour over both axes, and the line where they grew tenfold, if there is one."""
    labels = (x_label, y_label, "largest pitch / initial pitch (powers of ten)")
    boundary = (GROWN, f"{GROWN:g} times the initial pitch")
    panels_of_map = growth_map(growth.x, growth.y, growth.growth, labels, _MAX_GROWTH, boundary)
    panels_of_map.axes[0].ticklabel_format(style="plain")
    return panels_of_map


def response(parameter: Array, values: Array, x_label: str, y_label: str, *, logarithmic: bool) -> Panels:
    """A number of each run over a parameter that was varied, a point per run."""
    panel = panels((3.0,), x_label)
    shown = np.linspace(0, len(values) - 1, min(len(values), _MAX_RUNS)).round().astype(int)
    curve(panel.axes[0], parameter[shown], values[shown], Look(BLUE, "", "o"), markersize=3.5, markerfacecolor=BLUE)
    if logarithmic:
        log_axis(panel.axes[0], float(parameter.min()), float(parameter.max()), "x")
    panel.axes[0].margins(0.03)
    panel.axes[0].set_ylabel(y_label)
    return panel


def distribution(values: Array, label: str, *, logarithmic: bool) -> Panels:
    """How many runs have how large a value: the share of runs up to each value, as a rising curve."""
    panel = panels((1.9,), label)
    known = np.sort(values[np.isfinite(values) & ((values > 0.0) | (not logarithmic))])
    if len(known) > _MAX_POINTS:
        known = known[np.linspace(0, len(known) - 1, _MAX_POINTS).round().astype(int)]
    curve(panel.axes[0], known, np.linspace(0.0, 100.0, len(known)), Look(BLUE, "-", ""))
    if logarithmic:
        log_axis(panel.axes[0], known[0], known[-1], "x")
    panel.axes[0].set(ylim=(0.0, 101.0), ylabel="share of runs (%)")
    return panel


# A pitch that has grown tenfold is leaving: what stays bounded in a stable rotor only swings, by its amplitude.
GROWN = 10.0

_PAIRS_AT_ONCE = 256
_BLOCKS = 8
# The growth is exponential after the first tenfold, in which the separation turns to the fastest direction, and while
# a separation is small against a radian.
_TURNED, _SMALL = 10.0, 0.1


@dataclass(frozen=True)
class Spread:
    """Separations (rad) of runs 2i and 2i + 1: root of the summed squares of the angles' differences, over time (s).

    low, median, high: tenth, fiftieth and ninetieth percentile over the pairs; growth: geometric mean. exponent and
    uncertainty: 1/s, slope of log(growth) between `start` and `end` (s), and its standard error.
    """

    time: Array
    low: Array
    median: Array
    high: Array
    growth: Array
    exponent: float
    uncertainty: float
    start: float
    end: float
    pairs: int


def spread_of(sweep: StoredSweep) -> Spread:
    """From the runs that ended well. Raises StoreError without angles, InputError where nothing grows."""
    time, stored = sweep.column("time"), sweep.column("angles")
    well = sweep.column("status") == 0
    parts = []
    for first in range(0, len(stored), 2 * _PAIRS_AT_ONCE):
        angles = stored[first : first + 2 * _PAIRS_AT_ONCE]
        pairs = len(angles) // 2
        both = well[first : first + 2 * pairs].reshape(pairs, 2).all(axis=1)
        difference = angles[1 : 2 * pairs : 2].astype(float) - angles[0 : 2 * pairs : 2]
        parts.append(np.sqrt((difference[both] ** 2).sum(axis=2)))
    if not sum(map(len, parts)):
        raise InputError("spread: no pair of complete runs; allowed: a sweep with two or more complete runs")
    separations = np.concatenate(parts)
    low, median, high = np.percentile(separations, [10.0, 50.0, 90.0], axis=0)
    growth = np.exp(np.log(np.maximum(separations, np.finfo(float).tiny)).mean(axis=0))
    exponent, uncertainty, start, end = lyapunov_exponent(time, growth)
    return Spread(time, low, median, high, growth, exponent, uncertainty, start, end, len(separations))


def lyapunov_exponent(time: Array, growth: Array) -> tuple[float, float, float, float]:
    """Exponent and standard error in 1/s, start and end of the window in s. Raises InputError where nothing grows.

    The mean rate over the window, as the mean over equal blocks of it; the blocks' scatter gives the standard error.
    A finite-time exponent, of the stretch of motion that was run. Source: Wolf et al., Physica D 16, 1985, 285-317.
    """
    turned = np.flatnonzero(growth >= _TURNED * growth[0])
    grown = np.flatnonzero(growth >= _SMALL)
    first = int(turned[0]) if len(turned) else len(growth)
    last = int(grown[0]) if len(grown) else len(growth) - 1
    if last - first < 2 * _BLOCKS:
        raise InputError(
            f"spread: the growth from {growth[0]:.1e} rad has {max(last - first, 0)} samples of exponential growth; "
            f"allowed: at least {2 * _BLOCKS}, from {_TURNED:g} times the initial separation to {_SMALL:g} rad"
        )
    ends = np.linspace(first, last, _BLOCKS + 1).round().astype(int)
    rates = np.diff(np.log(growth[ends])) / np.diff(time[ends])
    lengths = np.diff(time[ends])
    mean = float(np.average(rates, weights=lengths))
    return mean, float(rates.std(ddof=1) / np.sqrt(_BLOCKS)), float(time[first]), float(time[last])


@dataclass(frozen=True)
class StabilityMap:
    """x, y: (columns,), (rows,) values of the second and the first axis; growth: (rows, columns) the largest pitch of
    the run, of the largest at its start; NaN where the run left nothing."""

    x: Array
    y: Array
    growth: Array

    @property
    def unstable(self) -> NDArray[np.bool_]:
        return np.asarray(self.growth >= GROWN)


def stability_map(sweep: StoredSweep, start: float) -> StabilityMap:
    """start: the largest pitch at the start, rad. Raises InputError where the sweep is no grid of two axes."""
    shape = json.loads(sweep.attributes["shape"])  # values along every axis of the grid, slowest first
    if len(shape) != 2 or len(sweep.keys) != 2:
        raise InputError(f"map: {len(sweep.keys)} axes; allowed: a grid of two axes, with one method")
    if not start > 0.0:
        raise InputError("map: all initial pitches are zero and cannot grow; allowed: a small initial pitch")
    rows, columns = shape
    y, x = (sweep.column(parameter_name(key))[: rows * columns].reshape(rows, columns) for key in sweep.keys)
    largest = sweep.column("pitch_max")[: rows * columns].reshape(rows, columns)
    return StabilityMap(x[0], y[:, 0], largest / start)
