"""The stability suite: the map of all scenes and methods, and what the pages of its scenes have more than others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rotor_mbs.report import canvas
from rotor_mbs.report.canvas import Panels
from rotor_mbs.report.elements import PageTable, Row, Section, TableCell, picture
from rotor_mbs.report.looks import GREY, Look, label_of, look_of
from rotor_mbs.report.pages import Report, method_cell
from rotor_mbs.report.plots import HIGHEST, LOWEST
from rotor_mbs.runs.read import Record
from rotor_mbs.solution.trajectory import Array
from rotor_mbs.studies.stability import OUTCOMES, TARGET, suite_table


def stability_page(report: Report) -> dict[str, object]:
    """The content of the map, which is the index of the suite."""
    runs = report.suite_runs
    methods = list(dict.fromkeys(run.method for run in runs))
    rows: list[Row] = []
    for scene, file in report.files.items():
        own = {run.method: run for run in runs if run.scene == scene}
        row: list[TableCell | str] = [TableCell(scene, href=file, note=report.scenes[scene].title)]
        for method in methods:
            if method not in own:
                row.append("")
                continue
            run = own[method]
            symbol, text = OUTCOMES[run.outcome]
            if run.false_success:
                symbol, text = f"{symbol}!", f"{text}; the engine reported success"
            title = f"{label_of(method)}: {text}. {run.message}".strip()
            row.append(TableCell(symbol, shade=f"mark {run.outcome}", title=title))
        rows.append(row)
    used = {run.outcome for run in runs}
    counts = suite_table(runs)
    count_rows = [(method_cell(method), *cells) for method, *cells in counts.rows]
    return {
        "map": PageTable("", ("Scene", *map(method_cell, methods)), rows),
        "key": [(outcome, symbol, text) for outcome, (symbol, text) in OUTCOMES.items() if outcome in used],
        "summary": Section(tables=[PageTable("", counts.head, count_rows)]),
        "false_successes": sum(run.false_success for run in runs),
    }


def step_section(scene: str, ladders: Sequence[Record]) -> Section:
    """The error over the fixed step, where it was measured."""
    own = {record.method: record.arrays for record in ladders if record.scene == scene}
    if not own:
        return Section()
    curves = [(arrays["step"], arrays["angle_error_max"], look_of(method)) for method, arrays in own.items()]
    caption = "Largest angle error up to the horizon over the fixed step; no mark where the run failed"
    return Section([picture(error_over_step(curves, TARGET), "steps", caption)])


def error_over_step(series: Sequence[tuple[Array, Array, Look]], target: float) -> Panels:
    """Error (rad) over the fixed step (s), both axes logarithmic, with a line at `target`."""
    panels = canvas.panels((2.8,), "step (s)")
    axes, known = panels.axes[0], [1e-8, 1e-6]
    for steps, values, look in series:
        shown = np.clip(values, LOWEST, HIGHEST)
        known += [float(np.nanmin(shown)), float(np.nanmax(shown))]
        canvas.curve(axes, steps, shown, look)
    every_step = np.concatenate([steps for steps, _, _ in series])
    canvas.log_axis(axes, every_step.min(), every_step.max(), "x")
    canvas.log_axis(axes, min(known), max(known))
    axes.axhline(target, color=GREY, linewidth=0.8, linestyle=":")
    axes.set_ylabel("largest angle error (rad)")
    return panels
