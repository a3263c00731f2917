"""Pages of the stability suite: the map of all scenes and methods, and a page per scene."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from rotor_mbs.analysis import run_selection
from rotor_mbs.analysis.stability import OUTCOMES, TARGET, SuiteRun, advice_lines, reached_by, suite_runs
from rotor_mbs.report import plots
from rotor_mbs.report.core.elements import LegendEntry, PageTable, Row, Section, TableCell
from rotor_mbs.report.core.files import Site, page_names, render
from rotor_mbs.report.core.looks import coordinate_look, label_of, look_of
from rotor_mbs.report.core.numbers import number, with_unit
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.pages import quantities
from rotor_mbs.report.pages.scene import opening_comment
from rotor_mbs.report.pages.scene_tables import horizon, method_cell, run_cell
from rotor_mbs.runs.read import OpenResults, StoredRun, StoredScene
from rotor_mbs.runs.records import Record, read_records
from rotor_mbs.solution.text_table import listed

_FOLDERS = ("stiff", "extreme")
_SUITE = ("stability", "stability_limits", "symmetry")
NOT_COMPARED = "horizon before the second sample"
_FAMILIES = {"needle": "on a needle", "scale": "out of scale"}  # headings that are not the family's name
_CONSERVED = {
    "angular_momentum_drift": "angular momentum (relative)",
    "mirror_error": "mirror image (rad)",
    "relabelling_error": "blades renumbered (rad)",
    "reversal_error": "there and back (rad)",
}
_NOT_BAD = ("holds", "energy_alone", "smaller_step", "refuses")


def is_stability_suite(results: OpenResults) -> bool:
    """Whether the file is of the suite: it has ladders of steps, limits or conservation, or all its scenes are."""
    folders = {name.partition("/")[0] for name, scene in results.scenes.items() if scene.methods}
    return bool(read_records(results.path, *_SUITE)) or (bool(folders) and folders <= set(_FOLDERS))


def stability_pages(opened: OpenResults, main: str, site: Site) -> dict[str, str]:
    """By file name, the map, in the file `main`, and a page per scene."""
    runs, records = suite_runs(opened.path), read_records(opened.path, *_SUITE)
    names = list(dict.fromkeys(run.scene for run in runs))
    files = page_names(names)
    pages = {main: render("stability", _map(runs, records, files, opened.scenes), site, main)}
    for name, previous, following in zip(names, ["", *names], [*names[1:], ""], strict=False):
        scene = opened.scenes[name]
        ladders = {}
        for record in records:
            is_ladder = record.kind == "stability" and record.scene == name
            if is_ladder and np.isfinite(record.arrays["angle_error_max"]).any():
                ladders[record.method] = record.arrays
        steps = Section()
        if ladders:
            curves = [
                (arrays["step"], arrays["angle_error_max"], look_of(method)) for method, arrays in ladders.items()
            ]
            caption = "Largest angle error up to the horizon over the fixed step; no mark where the run failed"
            shown = picture(plots.error_over_step(curves, TARGET), "steps", caption)
            steps = Section([shown], quantities.run_legend(ladders))
        page = {
            "name": name,
            "title": scene.title,
            "figures": "",
            "failures": Section(),
            "source": opening_comment(scene),
            "toml": str(scene.attributes["scene_toml"]),
            "outcomes": _outcomes(scene, [run for run in runs if run.scene == name]),
            "motion": _motion(run_selection.reference_or_corrected_run(scene)),
            "errors": _errors(scene),
            "steps": steps,
            "previous": files.get(previous, ""),
            "next": files.get(following, ""),
        }
        pages[files[name]] = render("stability_scene", page, site)
    return pages


def _map(
    runs: Sequence[SuiteRun], records: Sequence[Record], files: Mapping[str, str], scenes: Mapping[str, StoredScene]
) -> dict[str, object]:
    methods = list(dict.fromkeys(run.method for run in runs))
    families: dict[str, list[dict[str, object]]] = {}
    for scene, file in files.items():
        own = {run.method: run for run in runs if run.scene == scene}
        marks: list[tuple[str, str, str] | None] = []
        for method in methods:
            run = own.get(method)
            if run is None:
                marks.append(None)
                continue
            symbol, text = OUTCOMES[run.outcome]
            if run.false_success and run.outcome != "false_success":
                symbol += "!"
            marks.append((run.outcome, symbol, f"{label_of(run.method)}: {text}. {run.message}".strip()))
        first = next(iter(own.values()))
        fastest: TableCell | str = "no method"
        if not first.has_reference:
            fastest = "no reference"
        elif all(run.angle_error is None for run in own.values()):
            fastest = NOT_COMPARED
        elif reached := reached_by(list(own.values()), scene):
            fastest = method_cell(reached)
        row: dict[str, object] = {
            "scene": scene,
            "href": file,
            "title": scenes[scene].title,
            "marks": marks,
            "fastest": fastest,
        }
        families.setdefault(_FAMILIES.get(first.family, first.family), []).append(row)
    limits, conserved = [], []
    for record in records:
        facts = record.attributes
        if record.kind == "stability_limits" and math.isfinite(facts.get("largest_stable_step_s", math.nan)):
            step, theory, mode = facts["largest_stable_step_s"], facts["theory_s"], facts["fastest_mode_per_s"]
            numbers = [f"{step:.4g}", f"{theory:.4g}", f"{step / theory:.3f}", f"{step * mode:.3f}"]
            numbers.append(f"{facts['mode_damping_ratio']:.3g}")
            limits.append([record.scene, method_cell(record.method), *numbers])
        drifts = [facts.get(name) for name in _CONSERVED]
        if record.kind == "symmetry" and any(value is not None for value in drifts):
            conserved.append([record.scene, method_cell(record.method), *map(number, drifts)])
    limits_head = (
        "Scene", "Method", "found by bisection (s)", "theory (s)", "found / theory", "step × |λ|", "damping ratio of λ",
    )  # fmt: skip
    conserved_head = ["Scene", "Method", *_CONSERVED.values()]
    used = {run.outcome for run in runs}
    return {
        "methods": [(label_of(name), name) for name in methods],
        "families": list(families.items()),
        "key": [(outcome, symbol, text) for outcome, (symbol, text) in OUTCOMES.items() if outcome in used],
        "summary": advice_lines(runs, label_of, lambda family: f"“{_FAMILIES.get(family, family)}”"),
        "false_successes": sum(run.false_success for run in runs),
        "limits": Section(tables=[PageTable("", limits_head, limits, range(2, 7))]),
        "conservation": Section(tables=[PageTable("", conserved_head, conserved, range(2, len(conserved_head)))]),
    }


def _outcomes(scene: StoredScene, own: Sequence[SuiteRun]) -> Section:
    """The outcome of each method; what limits the accuracy of any: rounding of the initial state times its growth."""
    rows: list[Row] = []
    for run in own:
        symbol, text = OUTCOMES[run.outcome]
        if run.outcome in _NOT_BAD:
            outcome = TableCell(f"{symbol} {text}", note=run.message)
        else:  # the tone brings its own symbol
            outcome = TableCell(text, "bad", note=run.message)
        numbers = [number(x) for x in (run.angle_error, run.energy_drift, run.run_time_s or None, run.step)]
        rows.append([run_cell(scene.runs[run.method]), outcome, *numbers, f"{run.time_reached:.4g}"])
    head = (
        "Method", "Outcome", "angle error (rad)", "energy drift", "run time (s)", "step for 10⁻⁶ rad (s)",
        "reached (s)",
    )  # fmt: skip
    limits = []
    reference = scene.reference
    if reference is not None and run_selection.has_samples(reference) and "error_growth" in reference:
        names = ("angle_uncertainty", "error_growth")
        limits.append([with_unit(horizon(scene), "s", 4), *(number(float(reference.array(n).max())) for n in names)])
    limits_head = ("Horizon", "largest uncertainty of the angles (rad)", "error growth by the end")
    return Section(
        tables=[PageTable("", head, rows, (2, 3, 4, 5, 6)), PageTable("The reference", limits_head, limits, (0, 1, 2))]
    )


def _motion(run: StoredRun | None) -> Section:
    if run is None or len(run.array("time")) < 2:
        return Section()
    # Coordinates that at their largest rate would cross their whole range between two samples.
    interval = float(run.array("time")[1] - run.array("time")[0])
    ranges, fastest = np.ptp(run.array("angles"), axis=0), np.abs(run.array("rates")).max(axis=0)
    unresolved = [label for label, a, w in zip(run.labels, ranges, fastest, strict=True) if w * interval > a > 0.0]
    notes = []
    if unresolved:
        notes.append(f"Only the range is meaningful, samples are too far apart: {listed(unresolved)}.")
    legend = [LegendEntry(label, coordinate_look(i)) for i, label in enumerate(run.labels)]
    panels = plots.motion(run.array("time"), run.get("angles"), run.get("rates"))
    return Section([picture(panels, "motion", f"Angles and rates of {label_of(run.method)}", notes)], legend)


def _errors(scene: StoredScene) -> Section:
    runs = {}
    for name, run in run_selection.corrected_runs(scene).items():
        if run_selection.has_samples(run) and len(run.array("time")) > 1:
            runs[name] = run
    pictures = []
    methods: set[str] = set()
    differences = quantities.differences(runs, scene.reference)
    if quantities.visible(differences):
        caption = "Largest angle difference from the reference"
        axis = "largest angle difference (rad)"
        pictures.append(quantities.error_picture(differences, axis, "difference", caption, horizon(scene)))
        methods |= quantities.visible(differences).keys()
    for quantity, plot in quantities.plotted_quantities(scene):
        sizes = quantities.magnitudes(quantity, runs) if plot.logarithmic else {}
        if quantities.visible(sizes):
            pictures.append(quantities.error_picture(sizes, plot.axis, quantity.name, plot.title))
            methods |= quantities.visible(sizes).keys()
    energy, drawn = quantities.energy_picture(runs)
    legend = quantities.run_legend(name for name in runs if name in {*methods, *drawn})
    return Section([shown for shown in (*pictures, energy) if shown is not None], legend)
