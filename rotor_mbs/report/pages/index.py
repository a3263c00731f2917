"""The index: the rotor, the published crest, energy and errors of all methods; then numbers, claims and all scenes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rotor_mbs.analysis import run_selection
from rotor_mbs.analysis.claims import finding
from rotor_mbs.analysis.judgement import OK_ERROR
from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.analysis.run_tables import agreement
from rotor_mbs.report import plots
from rotor_mbs.report.core import canvas
from rotor_mbs.report.core.canvas import Panels
from rotor_mbs.report.core.elements import PageTable, Picture, Row, Section, TableCell
from rotor_mbs.report.core.looks import Look, label_of, look_of
from rotor_mbs.report.core.numbers import SPACE, number, power, prefixed, with_unit
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.pages import Context, claim_tables, quantities
from rotor_mbs.report.pages.bench import cost_picture
from rotor_mbs.report.pages.figures import compared_runs
from rotor_mbs.report.pages.quantities import VISIBLE, angle_difference, parting
from rotor_mbs.report.pages.scene import key_picture
from rotor_mbs.report.pages.scene_tables import (
    bounded_cell,
    compared_time,
    horizon,
    method_cell,
    metric,
    status_cell,
    status_text,
)
from rotor_mbs.report.pages.viewer import viewer
from rotor_mbs.runs.read import OpenResults, StoredScene

Scenes = Mapping[str, StoredScene]
# Errors of the heat map: a shade for each of these powers of ten and below, the last for all that is larger.
_SHADES = (-12, -10, -8, -6, -4, -2, 0)
_MARKS = {
    "ok": "",
    "completed": "",
    "inaccurate": "≠",
    "timed_out": "T",
    "diverged": "↯",
    "singular": "S",
    "unchecked": "?",
}
_FAILED = "✗"
_LOWEST_ENERGY = 1e-16  # relative: smaller errors are drawn there


def index_page(context: Context, opened: OpenResults) -> dict[str, object]:
    """The content of the index; what the file has no data for is None or empty. Its last tables are folded."""
    scenes, claims, study = opened.scenes, context.claims, context.study
    model = "Corrected model" if claims else "Model"  # of a user's own rotor nothing was corrected
    # The scene with a published extreme that is no rounding error; else one with both models; else the first.
    both = [name for name, scene in scenes.items() if len(run_selection.sides(scene)) > 1]
    shown = next(iter([*both, *scenes]))
    for claim in claims:
        item = claim.published
        if item.is_number and not item.rounding and item.of is not None and item.of.scene in scenes:
            shown = item.of.scene
            break
    sides = list(run_selection.sides(scenes[shown]).values())
    own_claims = [claim for claim in claims if shown in claim.published.scenes]
    still = None
    for run in sides:
        if "tip" in run:
            still = picture(plots.paths(run.array("tip")), "still", f"{shown}: paths of the tips")
    benched = next((scene for scene in context.curves if scene in scenes), "")
    curves = context.curves.get(benched, ())
    agreement_head = (
        "Method", "Runs", "Largest defect (rad)", f"Largest angle error up to each horizon (rad), at most {OK_ERROR:g}",
        "Largest energy drift (relative)", "Longest run",
    )  # fmt: skip
    agreement_rows: list[Row] = []
    for row in agreement(run for scene in scenes.values() for run in run_selection.corrected_runs(scene).values()):
        cells = [method_cell(row.method), row.runs, number(row.defect), bounded_cell(row.angle_error)]
        cells.append(number(row.energy_drift))
        agreement_rows.append([*cells, prefixed(row.longest_s, "s")])
    compared, whole = compared_time(scenes.values())
    notes = []
    if compared:
        notes.append(
            f"Compared with the reference over {number(compared, 3)} of {number(whole, 3)} s of simulated time, "
            f"{100.0 * compared / whole:.0f}{SPACE}%: each scene up to its horizon."
        )
    return {
        "paper": PageTable("", ("Result", "As printed", model), finding(scenes, claims)),
        "scene": shown,
        "viewer": viewer(scenes[shown], {label_of(run.method): run for run in sides}),
        "still": still,
        "pictures": [
            *key_picture(sides, own_claims, horizon(scenes[shown]), "crest"),
            *_defects(scenes, shown),
            *_energy(scenes, model),
            *cost_picture(curves, f"Error against run time of all methods, {benched}"),
        ],
        "methods": Section(tables=[PageTable("", agreement_head, agreement_rows)], notes=notes),
        "heat": heat_map(scenes, context.files),
        "scenes": Section(tables=[scene_table(scenes, context.files, model)]),
        "numbers": Section(
            tables=[
                claim_tables.number_table(claims),
                *(claim_tables.trial_tables(study) if study is not None else ()),
            ],
            notes=[text for key, text in context.conditions.items() if not key.startswith("fig")],
        ),
        "claims": Section(
            tables=[] if study is None else [claim_tables.claim_table(claims, study)],
            notes=[] if study is None else [claim_tables.study_note(study)],
        ),
        "is_paper": bool(claims),
    }


def _defects(scenes: Scenes, name: str) -> list[Picture]:
    """Interval defects of the printed and the corrected models over the whole of one scene."""
    scene, stored = scene_of(scenes[name]), scenes[name]
    if scene is None:
        return []
    runs = run_selection.corrected_runs(stored)
    if (printed := run_selection.printed_run(stored)) is not None:
        runs = {printed.method: printed} | runs
    curves = quantities.defects(scene, runs)
    caption = f"{name}: what the closed form makes of each sample by the next, less what each run has there"
    return quantities.error_picture(curves, "defect of an interval (rad)", "defects", caption)


def scene_table(scenes: Scenes, files: Mapping[str, str], model: str) -> PageTable:
    """A row per scene: how far the printed model and Exudyn are from the corrected one, which is called `model`."""
    head = (
        "Scene", "Figure", "Compared up to the horizon", "As printed, ode45", f"{VISIBLE:g} rad off from (s)",
        "Largest difference (rad)", "Energy gain", "Largest pitch (rad)", f"{model}: largest pitch (rad)",
        "Exudyn: largest difference up to the horizon (rad)",
    )  # fmt: skip
    rows: list[Row] = []
    for name, scene in scenes.items():
        until = horizon(scene)
        figures = str(scene.attributes.get("figures", ""))
        row: list[TableCell | str] = [TableCell(name, href=files[name], note=scene.title), figures]
        row.append(with_unit(until, "s", 3))
        runs = compared_runs(scene)
        corrected = runs.get("corrected")
        stored = scene.methods.get(run_selection.PRINTED)
        row.append("" if stored is None else status_cell(stored))
        if "printed" in runs and corrected is not None:
            parted, largest = parting(runs["printed"], corrected)
            row += ["never" if parted is None else number(parted, 3), number(largest)]
        else:
            row += ["", ""]
        row.append("" if stored is None else prefixed(metric(stored, "energy_gain_J"), "J"))
        for key in ("printed", "corrected"):
            row.append(number(float(np.abs(runs[key].array("angles")[:, 1:]).max(initial=0.0))) if key in runs else "")
        if "exudyn" in runs and corrected is not None:
            gap = angle_difference(runs["exudyn"], corrected)
            time = corrected.array("time")[: len(gap)]
            row.append(number(float(gap[time <= (until or np.inf)].max(initial=0.0))))
        else:
            row.append("")
        rows.append(row)
    return PageTable("", head, rows)


def _energy(scenes: Scenes, model: str) -> list[Picture]:
    """A mark per scene for the printed model's gain, and for the drift of each corrected one, called `model`."""
    rows: dict[str, list[tuple[float, Look]]] = {}
    has_printed = False
    for name, scene in scenes.items():
        corrected = run_selection.corrected_runs(scene)
        for run in scene.methods.values():
            gain, scale = metric(run, "energy_gain_J"), metric(run, "energy_scale_J")
            value = None
            if run.method == run_selection.PRINTED and gain is not None and scale:
                value, has_printed = gain / scale, True
            elif run.method in corrected and scale:
                value = metric(run, "energy_drift_max")
            if value is not None and math.isfinite(value):
                look = replace(look_of(run.method), line="")
                rows.setdefault(name.removeprefix("paper/"), []).append((value, look))
    if not has_printed:
        return []
    caption = f"Spurious energy gain as printed, and energy drift of each {model.lower()}, by scene"
    return [picture(energy_of_scenes(rows), "energy-scenes", caption)]


def energy_of_scenes(rows: Mapping[str, Sequence[tuple[float, Look]]]) -> Panels:
    """A row per scene, a mark per model: its energy error, of the scene's energy scale, logarithmic."""
    panels = canvas.panels((0.19 * len(rows) + 0.25,), "energy error / energy scale of the scene")
    axes = panels.axes[0]
    for row, marks in enumerate(rows.values()):
        for value, look in marks:
            canvas.curve(axes, [min(max(value, _LOWEST_ENERGY), 1e3)], [row], look, markersize=5.5)
    axes.set(xscale="log", xlim=(_LOWEST_ENERGY / 3.0, 3e3), ylim=(len(rows) - 0.4, -0.6))
    canvas.ticks(axes.xaxis, {10.0**e: power(e) for e in range(round(math.log10(_LOWEST_ENERGY)), 4, 3)})
    canvas.ticks(axes.yaxis, dict(enumerate(rows)))
    panels.figure.subplots_adjust(left=0.25)
    return panels


def heat_map(scenes: Scenes, files: Mapping[str, str]) -> dict[str, object] | None:
    """Scene by method, the largest angle error up to the horizon; None where no run was compared with a reference."""
    names = dict.fromkeys(name for scene in scenes.values() for name in run_selection.corrected_runs(scene))
    methods = run_selection.in_catalogue_order(names)
    if any(run_selection.PRINTED in scene.methods for scene in scenes.values()):
        methods.insert(0, run_selection.PRINTED)
    rows = []
    key = {}
    is_compared = False
    for name, scene in scenes.items():
        cells: list[tuple[int, str, str, str] | None] = []
        for method in methods:
            run = scene.methods.get(method)
            if run is None:
                cells.append(None)
                continue
            error = metric(run, "angle_error_max")
            is_compared = is_compared or error is not None
            text = "" if error is None else number(error)
            shade = len(_SHADES)
            if error is not None and math.isfinite(error):
                shade = sum(error > 10.0**exponent for exponent in _SHADES)
            mark = _MARKS.get(run.status, _FAILED)
            if mark:
                key[mark] = status_text(run)
            spoken = f"{label_of(method)}: {text or 'no error known'}, {status_text(run)}"
            cells.append((shade, text, mark, spoken))
        compared, whole = compared_time([scene])
        rows.append((name, files[name], f"{number(compared, 3)} of {number(whole, 3)}", cells))
    if not is_compared:
        return None
    shades = [*(f"≤{SPACE}{power(exponent)}" for exponent in _SHADES), f">{SPACE}{power(_SHADES[-1])}"]
    methods_shown = [(label_of(name), name) for name in methods]
    return {"methods": methods_shown, "rows": rows, "key": sorted(key.items()), "shades": shades}
