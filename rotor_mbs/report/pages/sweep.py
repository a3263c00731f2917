"""The page of a sweep, from its dataset alone: what was varied, how the runs ended, its picture, distributions."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.analysis.sweep_numbers import GROWN, Spread, StabilityMap, spread_of, stability_map
from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.report.core.canvas import TIME_AXIS, Panels, colour_map, curve, growth_map, log_axis, panels
from rotor_mbs.report.core.elements import PageTable, Picture, Section
from rotor_mbs.report.core.looks import BLUE, VERMILLION, Look, with_capital
from rotor_mbs.report.core.numbers import SPACE
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.pages.scene_tables import words_of
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
            f"Nearby starts part with the largest Lyapunov exponent {_rate(spread)} ({spread.pairs} pairs, "
            f"{spread.start:.2f} to {spread.end:.2f} s)."
        )
        return spread_panels(spread), "Separation of nearby starts", line
    start = parse_scene(str(sweep.attributes["scene_toml"]), str(sweep.attributes["base_scene"])).initial_angles
    growth = stability_map(sweep, max(map(abs, start[1:]), default=0.0))
    y_label, x_label = (_axis(field_name(key), sweep.columns[parameter_name(key)].units) for key in sweep.keys)
    line = f"The pitches grow {GROWN:g}-fold in {growth.unstable.sum()} of {growth.growth.size} runs."
    caption = "Growth of the pitches: the largest pitch of a run, of the largest at its start"
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
    labels = (x_label, y_label, "largest pitch, of its start (powers of ten)")
    boundary = (GROWN, f"{GROWN:g} times its start")
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
