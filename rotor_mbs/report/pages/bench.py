"""Error and run time: its page, and its diagram on other pages."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import cycle

import numpy as np

from rotor_mbs.analysis import work_precision
from rotor_mbs.analysis.text_tables import bench_table
from rotor_mbs.report import canvas
from rotor_mbs.report.canvas import Panels
from rotor_mbs.report.elements import PageTable, Picture, Row, Section, TableCell, picture
from rotor_mbs.report.looks import COORDINATES, GREY, Look, look_of
from rotor_mbs.report.numbers import NOTHING, number, power, prefixed, with_unit
from rotor_mbs.report.pages import method_cell, words_of
from rotor_mbs.runs.design import COLUMNS
from rotor_mbs.runs.read import OpenResults, Record, StoredRun, read_records
from rotor_mbs.scenario.catalogue import natural_order
from rotor_mbs.solution.status import COMPLETE
from rotor_mbs.studies.stability import SuiteRun, suite_runs

_POINT_COLUMNS = (
    "angle_error_max", "angle_error_end", "tip_error_max", "energy_drift_max", "run_time_s", "run_time_q1_s",
    "run_time_q3_s", "run_time_min_s", "setup_time_s", "setup_again_time_s", "output_time_s", "repeats", "steps",
)  # fmt: skip
_ERRORS = {
    work_precision.ANGLE_ERROR: "largest angle error up to the horizon (rad)",
    "defect_max": "largest defect of an interval between samples (rad)",
}
_ENGINE_TARGETS = (1e-6, 1e-9, 1e-10)  # rad
_LONG_S = 100.0  # of a run whose energy drift says something
_NO_ENGINE = ("rotor_mbs", "python", "numpy", "h5py", "code", "plug-in")  # among the versions of a row
_FRONT_COLOUR = "#c8c8c8"
_LOWEST_ERROR = 1e-16  # rad: smaller ones are drawn there
_FAILED_LEFT, _FAILED, _FAILED_RIGHT = 3.0, 20.0, 120.0  # rad: the band of failed runs on the axis of errors


def bench_page(results: OpenResults) -> dict[str, object]:
    """The content of the page: the fastest methods, then the curves of each scene."""
    grouped = work_precision.by_scene(read_records(results.path, "bench"))
    scenes = {name: grouped[name] for name in natural_order(grouped)}
    parts = []
    for i, (name, curves) in enumerate(scenes.items()):
        pictures = [
            picture(diagram(curves), f"bench-{i}", "Run time of the integration: lower left is best"),
            picture(diagram(curves, "defect_max"), f"bench-{i}-defect", "Largest interval defect and run time"),
        ]
        table = bench_table(curves)
        rows = [[method_cell(method), *(cell or NOTHING for cell in cells)] for _, method, *cells in table.rows]
        times = PageTable("Run time to reach an angle error", table.head[1:], rows)
        parts.append({
            "id": f"scene-{i}",
            "name": name,
            "facts": curves[0].attributes,
            "diagram": Section(pictures, [times]),
            "points": point_table(curves),
        })  # fmt: skip
    return {"engines": engine_tables(results, scenes), "scenes": parts}


def cost_picture(curves: Sequence[Record], caption: str) -> list[Picture]:
    """The diagram; none where no point stands on it."""
    if not any(work_precision.succeeded(curve).any() for curve in curves):
        return []
    return [picture(diagram(curves, height=3.4), "cost", f"{caption}: lower left is best")]


def diagram(curves: Sequence[Record], error: str = work_precision.ANGLE_ERROR, height: float = 3.9) -> Panels:
    """All curves of a scene over one of their errors, Pareto front, quartiles, and failed runs on a strip at the right.

    As work-precision diagrams are drawn in the field: the error falls to the left, the time downwards.
    """
    panels = canvas.panels((height,), _ERRORS[error])
    axes = panels.axes[0]
    points = [work_precision.points(curve, error) for curve in curves]
    errors, seconds = np.concatenate(points, axis=1) if points else np.empty((2, 0))
    front = work_precision.pareto(errors, seconds)
    if len(front) > 1:
        axes.plot(
            np.maximum(errors[front], _LOWEST_ERROR), seconds[front], label="Pareto front of all methods",
            color=_FRONT_COLOUR, linewidth=6.0, solid_capstyle="round", zorder=0.5,
        )  # fmt: skip
    times = [seconds]
    # Methods that are not known here, of files, would all be grey: a colour for each file.
    looks = {curve.name: look_of(curve.name) for curve in curves}
    unknown = dict.fromkeys(name.partition("/")[0] for name, look in looks.items() if look.colour == GREY)
    colours = dict(zip(unknown, cycle(COORDINATES), strict=False))
    for curve, (own_errors, own_seconds) in zip(curves, points, strict=True):
        look = looks[curve.name]
        look = replace(look, colour=colours.get(curve.name.partition("/")[0], look.colour))
        if len(own_errors) < 2:
            look = replace(look, line="")
        shown = np.maximum(own_errors, _LOWEST_ERROR)
        if len(shown):
            canvas.curve(axes, shown, own_seconds, look, 1.0)
        chosen = work_precision.succeeded(curve, error)
        low, high = curve.arrays["run_time_q1_s"][chosen], curve.arrays["run_time_q3_s"][chosen]
        axes.vlines(shown, low, high, color=look.colour, linewidth=2.2, alpha=0.6)
        failed = curve.arrays["run_time_s"][work_precision.failed(curve)]
        times.append(failed)
        if len(failed):
            marks = Look(look.colour, "", "x", "" if len(shown) else look.label)
            canvas.curve(axes, np.full(len(failed), _FAILED), failed, marks, markersize=4.0)
    # Of the reference; in quad precision far beyond the edge of the diagram.
    uncertainty = max((float(curve.attributes.get("uncertainty_rad", 0.0)) for curve in curves), default=0.0)
    if uncertainty > _LOWEST_ERROR and error == work_precision.ANGLE_ERROR:
        label = "uncertainty of the reference"
        axes.axvspan(_LOWEST_ERROR / 10.0, uncertainty, color=GREY, alpha=0.2, linewidth=0, label=label)
    smallest = max(errors.min(initial=1e-3), _LOWEST_ERROR)
    lowest = math.floor(math.log10(smallest) + 1e-9)
    labels = {10.0**e: power(e) for e in range(0, lowest - 1, -2 if lowest > -12 else -3)}
    largest = 3.0
    if any(work_precision.failed(curve).any() for curve in curves):
        axes.axvspan(
            _FAILED_LEFT, _FAILED_RIGHT, color="#f2e3de", linewidth=0, zorder=0, label="failed, at its run time"
        )
        labels[_FAILED] = "failed"
        largest = _FAILED_RIGHT
    axes.set(xscale="log", xlim=(10.0**lowest / 2.0, largest))
    canvas.ticks(axes.xaxis, labels)
    known = np.concatenate(times)
    known = known[np.isfinite(known) & (known > 0.0)]
    shortest, longest = (known.min(), known.max()) if len(known) else (1e-3, 1.0)
    canvas.log_axis(axes, 10.0 ** math.floor(math.log10(shortest)), longest)
    axes.set_ylabel("run time (s)")
    return panels


def engine_tables(results: OpenResults, scenes: Mapping[str, Sequence[Record]]) -> list[PageTable]:
    """A row per method: what it reaches over all scenes and what that costs; what it can compute. What the file does
    not know is a dash."""
    curves = [curve for of_scene in scenes.values() for curve in of_scene]
    parsed = {name: stored.scene for name, stored in results.scenes.items()}
    suite = [run for run in suite_runs(results.path) if run.scene.startswith(("stiff/", "extreme/"))]
    # The shortest that is long enough.
    durations = {name: scene.duration for name, scene in parsed.items() if results.scenes[name].methods}
    long = min((name for name in durations if durations[name] >= _LONG_S), key=lambda name: durations[name], default="")
    reached: list[Row] = []
    able: list[Row] = []
    for method in dict.fromkeys(curve.method for curve in curves):
        own = {name: [curve for curve in of_scene if curve.method == method] for name, of_scene in scenes.items()}
        own = {name: of_scene for name, of_scene in own.items() if of_scene}
        reached.append([
            method_cell(method),
            f"{sum(any('ok' in curve.statuses for curve in curves) for curves in own.values())} of {len(own)}",
            _order_cell([curve for of_scene in own.values() for curve in of_scene]),
            _worst_cell(own, "defect_max"),
            _worst_cell(own, work_precision.ANGLE_ERROR),
            *(_reach_cell(scenes, own, target) for target in _ENGINE_TARGETS),
            _drift_cell(results.scenes[long].methods.get(method)) if long else NOTHING,
            _zero_pitch_cell(own),
            _false_success_cell(own, [run for run in suite if run.method == method]),
        ])  # fmt: skip
        facts = next(iter(own.values()))[0].attributes
        damped = {name: own[name] for name in own if name in parsed and parsed[name].has_damping}
        loaded = {name: own[name] for name in own if name in parsed and not parsed[name].has_constant_loads}
        with_loads = [stored.runs.get(method) for name, stored in results.scenes.items() if parsed[name].wants("loads")]
        loads = ["yes" if "blade_root_force" in run else "no" for run in with_loads if run is not None]
        versions = json.loads(facts.get("versions", "{}"))
        engine = [f"{name} {version}" for name, version in versions.items() if name not in _NO_ENGINE]
        able.append([
            method_cell(method),
            _worst_cell(damped, work_precision.ANGLE_ERROR),
            _worst_cell(loaded, work_precision.ANGLE_ERROR),
            max(loads, default=NOTHING),
            {True: "yes", False: "no"}.get(facts.get("linearizes", ""), NOTHING),
            ", ".join(engine) or NOTHING,
            str(facts.get("lines") or NOTHING),
        ])  # fmt: skip
    drift = f"energy drift in {durations[long]:g} s" if long else "energy drift"
    targets = [f"time to {power(round(math.log10(target)))} rad" for target in _ENGINE_TARGETS]
    head = [
        "method", "ok on scenes", "measured order", "best defect (rad)", "best error (rad)", *targets, drift,
        "zero pitch", "reported as success although far from the motion",
    ]  # fmt: skip
    able_head = [
        "method", "joint damping: best error (rad)", "load over time: best error (rad)", "loads", "linearization",
        "software", "lines of code",
    ]  # fmt: skip
    return [
        PageTable("Accuracy and cost over all scenes", head, reached),
        PageTable("Capabilities", able_head, able),
    ]


def _worst_cell(own: Mapping[str, Sequence[Record]], column: str) -> TableCell | str:
    """The smallest value on the scene where that is largest; on how many scenes no setting is useful."""
    values = {name: work_precision.values_of(curves, column) for name, curves in own.items()}
    known = {name: min(of_scene) for name, of_scene in values.items() if of_scene}
    if not known:
        is_cut = any(work_precision.left_out(curve) for curves in own.values() for curve in curves)
        return (TableCell("not measured") if is_cut else TableCell("none", "bad")) if own else NOTHING
    worst = max(known, key=lambda name: known[name])
    bound = "≤ " if any(map(work_precision.left_out, own[worst])) else ""
    note = worst if len(own) > 1 else ""
    failed = sum(not any(map(work_precision.left_out, own[name])) for name in own.keys() - known.keys())
    if failed:
        note += f"; fails on {failed} of {len(own)}"
    return TableCell(bound + number(known[worst]), "bad" if failed else "", note=note)


def _reach_cell(
    scenes: Mapping[str, Sequence[Record]], own: Mapping[str, Sequence[Record]], target: float
) -> TableCell:
    """On how many scenes it reaches the target, the median of the ratios of its run times to the fastest, and them."""
    reached: dict[str, work_precision.Reach] = {}
    cut = 0  # scenes on which it was not measured to there
    for name, curves in own.items():
        ranked = work_precision.fastest(scenes[name], target)
        reach = next((reach for curve, reach in ranked if any(curve is one for one in curves)), None)
        if reach is not None:
            reached[name] = reach
        elif any(work_precision.left_out(curve) for curve in curves):
            cut += 1
    if not reached and cut:
        return TableCell("not measured")
    text, note = f"{'≥ ' if cut else ''}{len(reached)} of {len(own)}", ""
    if reached:
        seconds = [reach.seconds for reach in reached.values()]
        text += f", × {number(float(np.median([reach.ratio for reach in reached.values()])))}"
        times = dict.fromkeys(prefixed(value, "s", 2) for value in (min(seconds), max(seconds)))
        note = " to ".join(times)
    return TableCell(text, note=note)


def _order_cell(curves: Sequence[Record]) -> str:
    """The median of the fitted orders of a method with a fixed step, and the order that it claims."""
    claimed = [curve.attributes["order_expected"] for curve in curves if "order_expected" in curve.attributes]
    seen = [curve.attributes["order"] for curve in curves if claimed and "order" in curve.attributes]
    if not claimed:
        return "adaptive"
    return f"{number(float(np.median(seen)) if seen else None)} (nominal {claimed[0]:g})"


def _drift_cell(run: StoredRun | None) -> TableCell | str:
    if run is None:
        return NOTHING
    if run.status == "timed_out":
        return "not measured"
    if run.status not in COMPLETE:
        return TableCell(words_of(run.status), "bad")
    return number(run.attributes.get("energy_drift_max"))


def _zero_pitch_cell(own: Mapping[str, Sequence[Record]]) -> TableCell | str:
    """Whether pitches that are zero in the reference are zero at every setting."""
    known = work_precision.values_of((curve for curves in own.values() for curve in curves), "zero_pitch_max")
    if not known:
        return NOTHING
    return "kept" if not any(known) else TableCell("lost", "bad", note=f"up to {with_unit(max(known), 'rad')}")


def _false_success_cell(own: Mapping[str, Sequence[Record]], suite: Sequence[SuiteRun]) -> TableCell | str:
    """Of the runs of the stability suite that are not ok, where the file has them; else of the settings here."""
    if suite:
        # What the time limit ended is neither right nor wrong.
        finished = [run for run in suite if run.status != "timed_out"]
        wrong = [run for run in finished if run.status not in ("ok", "unchecked")]
        claimed, count, late = sum(run.false_success for run in wrong), len(wrong), len(suite) - len(finished)
        note = f"{len(finished)} finished" + (f", {late} over the time limit" if late else "")
    else:
        curves = [curve for of_scene in own.values() for curve in of_scene]
        claimed = sum(int(curve.arrays["false_success"].sum()) for curve in curves)
        count, note = sum(int(work_precision.failed(curve).sum()) for curve in curves), "on this page"
    if not count:
        return TableCell("all ok" if suite else "none failed", note=note)
    what = "not ok" if suite else "failed"
    return TableCell(f"{claimed} of {count} {what}", "bad" if claimed else "", note=note)


def point_table(curves: Sequence[Record]) -> PageTable:
    """A row per point that was run, with the reason where it is not ok; one for all that the budget left out."""
    columns = {name: COLUMNS[name] for name in _POINT_COLUMNS}
    units = [f" ({column.units})" if column.units != "1" else "" for column in columns.values()]
    names = [
        f"{column.long_name.partition('; -1')[0]}{unit}" for column, unit in zip(columns.values(), units, strict=True)
    ]
    rows: list[Row] = []
    for curve in curves:
        left_out = [i for i, status in enumerate(curve.statuses) if status == "left_out"]
        for i, status in enumerate(curve.statuses):
            if i in left_out[1:]:
                continue
            values = []
            for name, column in columns.items():
                value = curve.arrays[name][i]
                if i in left_out:
                    values.append("")
                elif column.kind == "<i8":
                    values.append(str(int(value)))
                else:
                    values.append(number(float(value) if np.isfinite(value) else None, 3))
            size = float(curve.arrays["setting"][i])
            setting = prefixed(size, "s", 3) if curve.attributes["setting_kind"] == "step" else number(size)
            if i in left_out[:-1]:
                setting += f" and {len(left_out) - 1} finer"
            claim = "the engine reported success" if curve.arrays["false_success"][i] else ""
            message = "; ".join(filter(None, (curve.messages[i], claim)))
            outcome = TableCell(words_of(status), tone="" if status == "ok" else "bad", note=message)
            rows.append([method_cell(curve.name), setting, outcome, *values])
    return PageTable("Every setting", ("method", "setting", "status", *names), rows)
