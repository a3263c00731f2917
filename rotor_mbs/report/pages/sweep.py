"""The page of a sweep, from its dataset alone: what was varied, how the runs ended, what they have over it."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.report.canvas import Panels, curve, log_axis, panels, style
from rotor_mbs.report.elements import PageTable, Picture, Section, picture
from rotor_mbs.report.looks import BLUE, Look, with_capital
from rotor_mbs.report.numbers import SPACE
from rotor_mbs.report.pages import words_of
from rotor_mbs.runs.sweeps import StoredSweep, parameter_name
from rotor_mbs.solution.status import GOOD, STATUSES
from rotor_mbs.solution.trajectory import Array

_SPAN = 50.0  # between the smallest and the largest value, beyond which an axis is logarithmic
_COUNTS = ("steps", "rhs_evaluations", "time_reached")  # columns that say nothing of the motion
# What is drawn over the parameters: the first of these that differs from run to run.
_RESPONSES = ("pitch_max", "rotor_rate_max", "rotor_angle_max")
_MAX_RESPONSES = 3
_MAX_RUNS = 1000  # that have a point
_COORDINATE = re.compile(r"initial\.(angles|rates)\[(\d+)\]")


def sweep_page(sweep: StoredSweep) -> dict[str, object]:
    """The content of the page."""
    statuses = np.asarray(sweep.column("status"))
    ok = np.isin(statuses, [code for code, status in enumerate(STATUSES) if status in GOOD])
    parameter_rows = []
    for key in sweep.keys:
        name = parameter_name(key)
        values, unit = sweep.column(name), sweep.columns[name].units
        limits = [f"{value:.12g}{SPACE}{unit}" for value in (np.nanmin(values), np.nanmax(values))]
        parameter_rows.append((field_name(key), key, *limits, str(len(np.unique(values)))))
    result_rows = []
    left_out = {*map(parameter_name, sweep.keys), *_COUNTS}
    for name, column in sweep.columns.items():
        if column.dimensions != ("run",) or name in left_out or sweep.column(name).dtype.kind != "f":
            continue
        values = sweep.column(name)[ok]
        values = values[np.isfinite(values)]
        if len(values) > 1 and np.ptp(values):
            quantiles = (f"{value:.6g}" for value in np.quantile(values, (0.0, 0.05, 0.5, 0.95, 1.0)))
            result_rows.append((_axis(with_capital(column.long_name), column.units), name, *quantiles))
    codes, counts = np.unique(statuses, return_counts=True)
    status_rows = [
        (words_of(STATUSES[code]) if code >= 0 else "missing", str(count), f"{100.0 * count / len(statuses):.1f} %")
        for code, count in sorted(zip(codes.tolist(), counts.tolist(), strict=True), key=lambda pair: -pair[1])
    ]
    head = ("Parameter", "Key", "From", "To", "Values")
    result_head = ("Result", "Column", "Smallest", f"5{SPACE}%", "Median", f"95{SPACE}%", "Largest")
    return {
        "title": sweep.attributes["title"],
        "summary": [with_capital(sweep.attributes["summary"].rstrip(".")) + "."],
        "plots": Section(_responses(sweep, ok)),
        "statuses": Section(tables=[PageTable("", ("Status", "Runs", "Share"), status_rows)]),
        "parameters": Section(tables=[PageTable("", head, parameter_rows)]),
        "results": Section(tables=[PageTable("", result_head, result_rows)]),
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
    if len(sweep.shape) == len(axes) == 2:
        # By one method, as those of the others would look the same; runs that a part of a sweep does not have are NaN.
        codes = np.asarray(sweep.column("method_code"))
        shown = codes == codes[np.isfinite(values)][0]
        (y, rows), (x, columns) = (np.unique(numbers[shown], return_inverse=True) for numbers in axes.values())
        if min(len(y), len(x)) > 1:
            grid = np.full((len(y), len(x)), np.nan)
            grid[rows, columns] = values[shown]
            y_label, x_label = labels.values()
            drawn = panels((3.8,), x_label)
            (x_edges, x_scale), (y_edges, y_scale) = _edges(x), _edges(y)
            norm = "log" if _is_wide(grid) else "linear"
            drawn.axes[0].set(xscale=x_scale, yscale=y_scale, ylabel=y_label)
            drawn.axes[0].grid(visible=False)
            if x_scale == "linear":
                drawn.axes[0].locator_params("x", nbins=4)
            mesh = drawn.axes[0].pcolormesh(x_edges, y_edges, grid, cmap="cividis", norm=norm, rasterized=True)
            with style():
                drawn.figure.colorbar(mesh, ax=drawn.axes[0]).set_label(label)
            drawn.figure.subplots_adjust(left=0.18)
            method = f", by {sweep.methods[codes[shown][0]]}" if len(sweep.methods) > 1 else ""
            return [picture(drawn, "grid", with_capital(quantity) + method)]
    pictures = []
    known = np.isfinite(values)
    for key in sweep.keys[:_MAX_RESPONSES]:
        parameter = axes[key][known]
        if np.ptp(parameter):
            caption = f"{with_capital(quantity)} of each run over the {field_name(key)}"
            drawn = response(parameter, values[known], labels[key], label)
            pictures.append(picture(drawn, f"over-{parameter_name(key)}", caption))
    return pictures


def _axis(label: str, unit: str) -> str:
    return label if unit == "1" else f"{label} ({unit})"


def _is_wide(values: Array) -> bool:
    """Whether a logarithmic axis shows more."""
    low, high = np.nanmin(values), np.nanmax(values)
    return bool(low > 0.0 and high > _SPAN * low)


def _edges(values: Array) -> tuple[Array, str]:
    """(n + 1,) Edges of the cells about ascending values, and the scale of their axis: logarithmic where ratios are
    equal."""
    is_geometric = _is_wide(values) and np.ptp(np.diff(np.log(values))) < 0.01 * np.log(values[-1] / values[0])
    places = np.log(values) if is_geometric else values
    middles = 0.5 * (places[1:] + places[:-1])
    edges = np.concatenate([[2.0 * places[0] - middles[0]], middles, [2.0 * places[-1] - middles[-1]]])
    return (np.exp(edges), "log") if is_geometric else (edges, "linear")


def response(parameter: Array, values: Array, x_label: str, y_label: str) -> Panels:
    """A number of each run over a parameter that was varied, a point per run."""
    panel = panels((3.0,), x_label)
    shown = np.linspace(0, len(values) - 1, min(len(values), _MAX_RUNS)).round().astype(int)
    curve(panel.axes[0], parameter[shown], values[shown], Look(BLUE, "", "o"), markersize=3.5, markerfacecolor=BLUE)
    if _is_wide(parameter):
        log_axis(panel.axes[0], float(parameter.min()), float(parameter.max()), "x")
    panel.axes[0].margins(0.03)
    panel.axes[0].set_ylabel(y_label)
    return panel
