"""Error against run time: its pages, one for each scene and an index; its section on others; diagram, tables, CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np
from markupsafe import Markup

from rotor_mbs.analysis import work_precision
from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.errors import MethodRefusal
from rotor_mbs.methods.catalogue import find_method, ladders
from rotor_mbs.report.core import canvas
from rotor_mbs.report.core.canvas import Panels
from rotor_mbs.report.core.elements import LegendEntry, PageTable, Picture, Row, Section, TableCell, line_entry
from rotor_mbs.report.core.files import Site, page_names, render
from rotor_mbs.report.core.looks import GREY, Look, label_of, look_of, with_capital
from rotor_mbs.report.core.numbers import NOTHING, number, power, prefixed, with_unit
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.pages.scene_tables import method_cell, status_text, versions
from rotor_mbs.runs.read import OpenResults, StoredScene
from rotor_mbs.runs.records import COST_SCALING, Record, read_records
from rotor_mbs.scenario.catalogue import natural_order

Curves = Mapping[str, Sequence[Record]]  # by scene
_FRONT_COLOUR = "#c8c8c8"
_LOWEST_ERROR, _RAIL_START, _RAIL, _RAIL_END = 1e-16, 3.0, 20.0, 120.0
_POINT_COLUMNS = (
    "method", "setting", "angle error (rad)", "at the end (rad)", "tip error (m)", "energy drift", "median",
    "quartiles", "shortest", "set-up", "again", "read-out", "repeats", "steps", "status",
)  # fmt: skip


def bench_pages(results: OpenResults, main: str, site: Site) -> dict[str, str]:
    """By file name, the pages on the curves of `results`, and CSV; `main`: the file of the one over all scenes."""
    grouped = work_precision.by_scene(read_records(results.path, "bench"))
    scaling = {name: curves for name, curves in grouped.items() if name.startswith(f"{COST_SCALING}/")}
    scenes = {name: grouped[name] for name in natural_order(grouped) if name not in scaling}
    files = {name: f"bench-{file}" for name, file in page_names(scenes).items()}
    index = _index(scenes, scaling, files) | {"versions": versions(results.attributes)}
    pages = {main: render("bench", index, site, main)}
    pages["bench.csv"] = csv_text([curve for curves in scenes.values() for curve in curves])
    for name, curves in scenes.items():
        csv = files[name].removesuffix(".html") + ".csv"
        pages[files[name]] = render("bench_scene", _scene(name, results.scenes.get(name), curves, csv), site)
        pages[csv] = csv_text(curves)
    return pages


def _scene(name: str, stored: StoredScene | None, curves: Sequence[Record], csv: str) -> dict[str, object]:
    captions = {
        False: "Integration alone: its run time over the whole scene; marks on the left failed.",
        True: "The cost of one run: also building the model, compiling everything anew, and reading out samples.",
    }
    pictures = [
        picture(diagram(curves, with_setup=setup), f"bench-{int(setup)}", caption, f"{name}: {caption}")
        for setup, caption in captions.items()
        if not (setup and "is_short" in curves[0].attributes)  # workers there keep what runs before have compiled
    ]
    return {
        "scene": name,
        "summary": [cheapest(curves), *omissions(curves), *refusals(stored)],
        "facts": curves[0].attributes,
        "diagram": Section(pictures, cost_legend(curves)),
        "reach": Section(tables=[reach_table(curves)]),
        "order": Section(tables=[order_table(curves)]),
        "failures": Section(tables=[failure_table(curves)]),
        "points": Section(tables=[point_table(curves)]),
        "csv": csv,
    }


def _index(scenes: Curves, scaling: Curves, files: Mapping[str, str]) -> dict[str, object]:
    pictures = []
    for i, (name, curves) in enumerate(scenes.items()):
        link = Markup('<a href="{}">{}</a>').format(files[name], name)
        panels = diagram(curves, height=2.6, small=True)
        shown = picture(panels, f"bench-s{i}", name, f"Error against run time, {name}")
        pictures.append(replace(shown, caption=link))
    one_of_each = {curve.name: curve for curves in scenes.values() for curve in curves}
    return {
        "summary": omissions([curve for curves in scenes.values() for curve in curves]),
        "fastest": Section(tables=[overview_table(scenes, files)]),
        "scenes": Section(pictures, cost_legend(list(one_of_each.values()))),
        "scaling": [
            (name.rpartition("/")[2], Section(tables=[scaling_table(curves)])) for name, curves in scaling.items()
        ],
        "csv": "bench.csv",
    }


def omissions(curves: Sequence[Record]) -> list[str]:
    """A sentence on the settings that the time budget left out, where there are any."""
    count, total = sum(map(work_precision.left_out, curves)), sum(len(curve.statuses) for curve in curves)
    if not count:
        return []
    return [
        f"The budget left out {count} of {total} settings, always the finest of their ladders: what they would reach "
        "is given as not measured."
    ]


def refusals(stored: StoredScene | None) -> list[str]:
    """A sentence for each method with a ladder that cannot represent the scene."""
    scene, found = None if stored is None else scene_of(stored), []
    if scene is None:
        return []
    for name in dict.fromkeys(ladder.method for ladder in ladders()):
        try:
            find_method(name).items(scene)
        except MethodRefusal as exc:
            found.append(f"{with_capital(label_of(name))} is left out: {exc}.")
    return found


def cost_section(scene: StoredScene, curves: Sequence[Record]) -> Section:
    """The curves measured on the scene, else its own runs, a point each; empty where no run has an error."""
    known = [*curves] or work_precision.own_points(scene)
    shown = cost_picture(known, f"Error against run time, {scene.name}")
    if shown is None:
        return Section()
    notes = [cheapest(known)]
    if not curves:
        notes.append("Each point is a run of this file, timed while others ran beside it: good to a factor of two.")
    return Section([shown], cost_legend(known), notes=notes)


def cost_picture(curves: Sequence[Record], caption: str) -> Picture | None:
    """The diagram; None where no point stands on it."""
    if not any(work_precision.succeeded(curve).any() for curve in curves):
        return None
    described = f"{caption}. {cheapest(curves)}"
    return picture(diagram(curves, height=3.4), "cost", f"{caption}: the lower right corner is best", described)


def diagram(curves: Sequence[Record], *, with_setup: bool = False, height: float = 3.9, small: bool = False) -> Panels:
    """All curves of a scene, Pareto front, quartiles, and failed runs on a strip at the left.

    Error on the horizontal axis, falling to the right, so that accuracy grows to the right; time on the vertical one.
    small: one of many side by side, with front and curves alone.
    """
    picture = canvas.panels((height,), "largest angle error up to the horizon (rad)")
    axes = picture.axes[0]
    drawn = [work_precision.points(curve, with_setup=with_setup) for curve in curves]
    _front(axes, drawn)
    for curve, (errors, seconds) in zip(curves, drawn, strict=True):
        style = look_of(curve.name)
        shown = np.maximum(errors, _LOWEST_ERROR)
        canvas.curve(axes, shown, seconds, style, 1.0, markersize=3.0 if small else 4.2)
        if not with_setup and not small:
            _whiskers(axes, curve, style)
        _rail(axes, curve, style, with_setup)
    _axes(axes, drawn, curves)
    axes.set_ylabel("set-up, run and read-out (s)" if with_setup else "run time (s)")
    return picture


def _uncertainty(curves: Sequence[Record]) -> float:
    """rad, of the reference: in quad precision far beyond the edge of the diagram, where it is not drawn."""
    return max((float(curve.attributes.get("uncertainty_rad", 0.0)) for curve in curves), default=0.0)


def _front(axes: Any, drawn: Sequence[tuple[Any, Any]]) -> None:
    errors, seconds = np.concatenate(drawn, axis=1) if drawn else np.empty((2, 0))
    chosen = work_precision.pareto(errors, seconds)
    best = np.maximum(errors[chosen], _LOWEST_ERROR)
    axes.plot(best, seconds[chosen], color=_FRONT_COLOUR, linewidth=6.0, solid_capstyle="round", zorder=0.5)


def _whiskers(axes: Any, curve: Record, style: Look) -> None:
    chosen = work_precision.succeeded(curve)
    errors = np.maximum(curve.arrays["angle_error_max"][chosen], _LOWEST_ERROR)
    low, high = curve.arrays["run_time_q1_s"][chosen], curve.arrays["run_time_q3_s"][chosen]
    axes.vlines(errors, low, high, color=style.colour, linewidth=2.2, alpha=0.6)


def _rail(axes: Any, curve: Record, style: Look, with_setup: bool) -> None:
    chosen = work_precision.failed(curve)
    seconds = curve.arrays["run_time_s"][chosen]
    if with_setup:
        seconds = seconds + np.nan_to_num(curve.arrays["setup_time_s"][chosen])
    axes.plot(np.full(len(seconds), _RAIL), seconds, linestyle="none", marker="x", markersize=4.0, color=style.colour)


def _axes(axes: Any, drawn: Sequence[tuple[Any, Any]], curves: Sequence[Record]) -> None:
    if _uncertainty(curves) > _LOWEST_ERROR:
        axes.axvspan(_LOWEST_ERROR / 10.0, _uncertainty(curves), color=GREY, alpha=0.2, linewidth=0)
    axes.axvspan(_RAIL_START, _RAIL_END, color="#f2e3de", linewidth=0, zorder=0)
    axes.set_xscale("log")
    axes.set_xlim(_RAIL_END, _LOWEST_ERROR / 2.0)
    exponents = range(-3, -17, -3)
    axes.set_xticks([_RAIL, *(10.0**e for e in exponents)], ["failed", *(power(e) for e in exponents)])
    axes.set_xticks([], minor=True)
    times = [
        *(seconds for _, seconds in drawn),
        *(curve.arrays["run_time_s"][work_precision.failed(curve)] for curve in curves),
    ]
    known = np.concatenate([np.ravel(time) for time in times] or [np.empty(0)])
    known = known[np.isfinite(known) & (known > 0.0)]
    low, high = (known.min(), known.max()) if len(known) else (1e-3, 1.0)
    canvas.log_axis(axes, 10.0 ** math.floor(math.log10(low)), high)


def cost_legend(curves: Sequence[Record]) -> list[LegendEntry]:
    """Methods, front, failed points and uncertainty, as far as they are in the diagram."""
    entries = [LegendEntry(label_of(curve.name), look_of(curve.name)) for curve in curves]
    entries.append(line_entry("best of all (Pareto front)", _FRONT_COLOUR, width=6.0))
    if any(not work_precision.succeeded(curve).all() for curve in curves):
        entries.append(LegendEntry("failed: drawn at its time", Look(GREY, "", "x")))
    if _uncertainty(curves) > _LOWEST_ERROR:
        entries.append(line_entry("uncertainty of the reference", width=8.0))
    return entries


def cheapest(curves: Sequence[Record]) -> str:
    """ "Cheapest within 10⁻³ rad: closed form, Taylor (lagrange/taylor), 3 ms; within 10⁻⁶ rad: ..."."""
    parts = []
    for target in work_precision.TARGETS_RAD:
        found = work_precision.fastest(curves, target)
        best = "none of these"
        if found:
            curve, reach = found[0]
            best = f"{label_of(curve.name)} ({curve.name}), {prefixed(reach.seconds, 's', 2)}"
        parts.append(f"within {_target_text(target)}: {best}")
    return f"Cheapest method {'; '.join(parts)}."


def _target_text(target: float) -> str:
    """ "10⁻⁶ rad": the targets are powers of ten."""
    return f"{power(round(math.log10(target)))} rad"


def csv_text(curves: Sequence[Record]) -> str:
    """Every point, unrounded, with a heading line; units are those of the results file (s, rad, m)."""
    stream = io.StringIO()
    columns = [name for name in (curves[0].arrays if curves else ()) if name != "status"]
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["scene", "method", "setting_kind", *columns, "status", "message"])
    for curve in curves:
        for i, (status, message) in enumerate(zip(curve.statuses, curve.messages, strict=True)):
            values = [curve.arrays[column][i].item() for column in columns]
            writer.writerow([curve.scene, curve.name, curve.attributes["setting_kind"], *values, status, message])
    return stream.getvalue()


def reach_table(curves: Sequence[Record]) -> PageTable:
    """A row per curve: time and ratio for each target."""
    targets = work_precision.TARGETS_RAD
    found = [{one.name: reach for one, reach in work_precision.fastest(curves, target)} for target in targets]
    head = ["method", *map(_target_text, targets)]
    rows: list[Row] = [
        [method_cell(curve.name), *(_reach_cell(curve, reaches.get(curve.name)) for reaches in found)]
        for curve in curves
    ]
    caption = (
        "Run time to an angle error, interpolated linearly in the logarithms between the points of a method's own "
        "front, and its ratio to the fastest method's. A dash: no setting of the ladder was as accurate. Not measured: "
        "the budget left out finer settings, which might have been."
    )
    return PageTable(caption, head, rows, numeric=range(1, len(head)))


def _reach_cell(curve: Record, reach: work_precision.Reach | None) -> TableCell:
    """Time and ratio, or whether the method cannot, or was not asked to."""
    if reach is not None:
        return TableCell(prefixed(reach.seconds, "s", 3), note=f"× {number(reach.ratio)}")
    count = work_precision.left_out(curve)
    if count:
        return TableCell("not measured", note=f"{count} finer {'setting' if count == 1 else 'settings'} left out")
    errors = curve.arrays["angle_error_max"][work_precision.succeeded(curve)]
    best = f"{with_unit(float(errors.min()), 'rad')} at best" if len(errors) else "no run is ok"
    return TableCell(NOTHING, note=best)


def overview_table(scenes: Mapping[str, Sequence[Record]], files: Mapping[str, str]) -> PageTable:
    """A row per scene: for each target the fastest method with its time, and the next one with its ratio."""
    head = ["scene", *map(_target_text, work_precision.TARGETS_RAD)]
    rows: list[Row] = [
        [TableCell(scene, href=files[scene]), *(_fastest_cell(curves, target) for target in work_precision.TARGETS_RAD)]
        for scene, curves in scenes.items()
    ]
    return PageTable(
        "Run time of the fastest method to an angle error, and how many times as long the next one takes.", head, rows
    )


def _fastest_cell(curves: Sequence[Record], target: float) -> TableCell:
    found, is_cut = work_precision.fastest(curves, target), any(map(work_precision.left_out, curves))
    if not found:
        return TableCell("not measured" if is_cut else NOTHING)
    (first, reach), *others = found
    if others:
        next_one = f"then {label_of(others[0][0].name)}, {number(others[0][1].ratio)} times as long"
    else:
        next_one = "no other was measured to there" if is_cut else "no other gets there"
    return TableCell(f"{label_of(first.name)} ({first.name}): {prefixed(reach.seconds, 's', 2)}", note=next_one)


def order_table(curves: Sequence[Record]) -> PageTable:
    """A row per fixed-step curve."""
    rows = [
        [method_cell(curve.name), number(facts.get("order"), 3), f"{facts['order_expected']:g}"]
        for curve in curves
        if "order_expected" in (facts := curve.attributes)
    ]
    return PageTable(
        "Fitted on the finest points above the round-off floor.", ["method", "order", "expected"], rows, numeric=(1, 2)
    )


def point_table(curves: Sequence[Record]) -> PageTable:
    """A row per point that was run."""
    rows = list(chain.from_iterable(map(_point_rows, curves)))
    return PageTable("Every setting measured.", _POINT_COLUMNS, rows, numeric=range(1, 14)).without_empty_columns()


def _point_rows(curve: Record) -> Iterator[Row]:
    a = curve.arrays
    for i, status in enumerate(curve.statuses):
        if status == "left_out":
            continue
        low, high, shortest = (prefixed(_known(a[f"run_time_{q}_s"][i]), "s", 3) for q in ("q1", "q3", "min"))
        spread = (f"{low} to {high}", shortest) if a["repeats"][i] > 1 else ("", "")
        errors = ("angle_error_max", "angle_error_end", "tip_error_max", "energy_drift_max")
        seconds = ("setup_time_s", "setup_again_time_s", "output_time_s")
        yield [
            method_cell(curve.name),
            _setting(curve, i),
            *(number(_known(a[error][i])) for error in errors),
            prefixed(_known(a["run_time_s"][i]), "s", 3),
            *spread,
            *(prefixed(_known(a[second][i]), "s", 3) for second in seconds),
            str(a["repeats"][i]),
            str(a["steps"][i]),
            TableCell(status_text(status), tone="" if status == "ok" else "bad"),
        ]


def failure_table(curves: Sequence[Record]) -> PageTable:
    """Every point that is not on a curve, with the reason; one row for all that the budget left out of a curve."""
    rows = []
    for curve in curves:
        cut = [i for i, status in enumerate(curve.statuses) if status == "left_out"]
        for i, (status, message) in enumerate(zip(curve.statuses, curve.messages, strict=True)):
            if status == "ok" or i in cut[1:]:
                continue
            setting = _setting(curve, i) + (f" and {len(cut) - 1} finer" if [i] == cut[:1] != cut else "")
            seconds = prefixed(_known(curve.arrays["run_time_s"][i]), "s", 3)
            claimed = "yes" if curve.arrays["false_success"][i] else ""
            rows.append([method_cell(curve.name), setting, seconds, status_text(status), claimed, message])
    head = ["method", "setting", "run time", "status", "engine reported ok", "reason"]
    caption = "Runs that failed, found from their state, and settings that the budget left out."
    return PageTable(caption, head, rows, numeric=(1, 2)).without_empty_columns()


def scaling_table(curves: Sequence[Record]) -> PageTable:
    """A row per method over the sizes of a study (blades, or s of duration): run time per simulated second."""
    sizes = sorted({float(size) for curve in curves for size in curve.arrays["setting"]})
    kind = str(curves[0].attributes["setting_kind"])
    head = ["method", *(f"{size:g} {'s' if kind == 'duration' else kind}" for size in sizes), "exponent"]
    rows = []
    for curve in curves:
        ok = np.array([status == "ok" for status in curve.statuses])
        rate = curve.arrays["run_time_s"] / np.array(curve.arrays["simulated_s"])
        at = dict(zip(curve.arrays["setting"][ok].tolist(), rate[ok].tolist(), strict=True))
        exponent = work_precision.cost_exponent(curve.arrays["setting"][ok], rate[ok])
        rows.append([method_cell(curve.name), *(prefixed(at.get(size), "s", 3) for size in sizes), number(exponent)])
    caption = "Run time of one simulated second, and the exponent fitted on the larger half of the sizes."
    return PageTable(caption, head, rows, numeric=range(1, len(head)))


def _setting(curve: Record, i: int) -> str:
    value = float(curve.arrays["setting"][i])
    return prefixed(value, "s", 3) if curve.attributes["setting_kind"] == "step" else number(value, 2)


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
