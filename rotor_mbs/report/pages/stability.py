"""Pages of the stability suite: the map of all scenes and methods, and a page per scene."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rotor_mbs.analysis import run_selection
from rotor_mbs.analysis.stability import OUTCOMES, TARGET, SuiteRun, advice_lines, reached_by, suite_runs
from rotor_mbs.report.core.elements import LegendEntry, PageTable, Row, Section, TableCell
from rotor_mbs.report.core.files import Site, page_names, render
from rotor_mbs.report.core.looks import coordinate_look, label_of, look_of
from rotor_mbs.report.core.numbers import number
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.pages import quantities
from rotor_mbs.report.pages.scene import opening_comment
from rotor_mbs.report.pages.scene_tables import horizon, method_cell, run_cell
from rotor_mbs.report.plots import time_histories as histories
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
    "exponent": "drift exponent",
}
_NOT_BAD = ("holds", "energy_alone", "smaller_step", "refuses")


def is_stability_suite(results: OpenResults) -> bool:
    """Whether the file is of the suite: it has ladders of steps, limits or conservation, or all its scenes are."""
    folders = {name.partition("/")[0] for name, scene in results.scenes.items() if scene.methods}
    return bool(read_records(results.path, *_SUITE)) or (bool(folders) and folders <= set(_FOLDERS))


def stability_pages(opened: OpenResults, main: str, site: Site) -> dict[str, str]:
    """By file name, the map, in the file `main`, and a page per scene."""
    found, records = suite_runs(opened.path), read_records(opened.path, *_SUITE)
    names = list(dict.fromkeys(cell.scene for cell in found))
    files = page_names(names)
    titles = {name: opened.scenes[name].title for name in names}
    pages = {main: render("stability", _map(found, records, files, titles), site, main)}
    for name, previous, following in zip(names, ["", *names], [*names[1:], ""], strict=False):
        own = [cell for cell in found if cell.scene == name]
        ladders = [record for record in records if record.kind == "stability" and record.scene == name]
        around = {"previous": files.get(previous, ""), "next": files.get(following, "")}
        page = _scene_page(opened.scenes[name], own, ladders) | around
        pages[files[name]] = render("stability_scene", page, site)
    return pages


def _map(
    found: Sequence[SuiteRun], records: Sequence[Record], files: dict[str, str], titles: dict[str, str]
) -> dict[str, object]:
    names = list(dict.fromkeys(cell.method for cell in found))
    families: dict[str, list[dict[str, object]]] = {}
    for scene, file in files.items():
        own = {cell.method: cell for cell in found if cell.scene == scene}
        row: dict[str, object] = {
            "scene": scene,
            "href": file,
            "title": titles[scene],
            "marks": [_mark(own[name]) if name in own else None for name in names],
            "fastest": _fastest(list(own.values())),
        }
        families.setdefault(_family(next(iter(own.values())).family), []).append(row)
    used = {cell.outcome for cell in found}
    return {
        "methods": [(label_of(name), name) for name in names],
        "families": list(families.items()),
        "key": [(outcome, symbol, text) for outcome, (symbol, text) in OUTCOMES.items() if outcome in used],
        "summary": advice_lines(found, label_of, lambda family: f"“{_family(family)}”"),
        "false_successes": sum(cell.false_success for cell in found),
        "limits": _limits(records),
        "conservation": _conservation(records),
    }


def _family(name: str) -> str:
    return _FAMILIES.get(name, name)


def _mark(cell: SuiteRun) -> tuple[str, str, str]:
    """The outcome, which names the colour; its symbol; a text that is read out."""
    symbol, text = OUTCOMES[cell.outcome]
    claimed = "!" if cell.false_success and cell.outcome != "false_success" else ""
    return cell.outcome, symbol + claimed, f"{label_of(cell.method)}: {text}. {cell.message}".strip()


def _fastest(own: Sequence[SuiteRun]) -> TableCell | str:
    if not own[0].has_reference:
        return "no reference"
    if all(cell.angle_error is None for cell in own):
        return NOT_COMPARED
    method = reached_by(own, own[0].scene)
    return "no method" if method is None else method_cell(method)


def _limits(records: Sequence[Record]) -> Section:
    rows = []
    for record in records:
        facts = record.attributes
        if record.kind == "stability_limits" and math.isfinite(facts["largest_stable_step_s"]):
            step, theory, mode = facts["largest_stable_step_s"], facts["theory_s"], facts["fastest_mode_per_s"]
            numbers = [f"{step:.4g}", f"{theory:.4g}", f"{step / theory:.3f}", f"{step * mode:.3f}"]
            numbers.append(f"{facts['mode_damping_ratio']:.3g}")
            rows.append([record.scene, method_cell(record.method), *numbers])
    head = (
        "Scene", "Method", "found by bisection (s)", "theory (s)", "found / theory", "step × |λ|", "damping ratio of λ",
    )  # fmt: skip
    return Section(tables=[PageTable("", head, rows, (2, 3, 4, 5, 6))])


def _conservation(records: Sequence[Record]) -> Section:
    rows = [
        [r.scene, method_cell(r.method), *(number(r.attributes.get(name)) for name in _CONSERVED)]
        for r in records
        if r.kind == "conservation"
    ]
    head = ["Scene", "Method", *_CONSERVED.values()]
    return Section(tables=[PageTable("", head, rows, tuple(range(2, len(head))))])


def _scene_page(scene: StoredScene, own: Sequence[SuiteRun], ladders: Sequence[Record]) -> dict[str, object]:
    corrected = run_selection.corrected_runs(scene)
    runs = {
        name: run for name, run in corrected.items() if run_selection.has_samples(run) and len(run.array("time")) > 1
    }
    return {
        "name": scene.name,
        "title": scene.title,
        "figures": "",
        "lead": _lead(scene, own),
        "failures": (),
        "source": opening_comment(scene),
        "toml": str(scene.attributes["scene_toml"]),
        "outcomes": Section(tables=[_outcome_table(scene, own)]),
        "motion": _motion(run_selection.reference_or_corrected_run(scene)),
        "errors": _errors(scene, runs),
        "steps": _error_over_step(ladders),
    }


def _lead(scene: StoredScene, own: Sequence[SuiteRun]) -> list[str]:
    """The fastest method, or why none is accurate: by 1e10 the rounding error 1e-16 rad of the start is 1e-6 rad."""
    if not own or not own[0].has_reference or all(cell.angle_error is None for cell in own):
        return []
    best = reached_by(own, scene.name)
    if best is not None:
        return [f"Fastest to 10⁻⁶ rad up to the horizon: {label_of(best)}."]
    reference = scene.reference
    assert reference is not None  # has_reference says so
    uncertainty, growth = (float(reference.array(name).max()) for name in ("angle_uncertainty", "error_growth"))
    return [
        f"{scene.name}: no method reaches 10⁻⁶ rad. The uncertainty of the reference is {number(uncertainty)} rad, "
        f"and an initial error has grown {number(growth)}-fold by the end: "
        f"the cause is {'the problem, not a code' if growth >= 1e10 else 'the methods'}."
    ]


def _outcome_table(scene: StoredScene, own: Sequence[SuiteRun]) -> PageTable:
    rows: list[Row] = []
    for cell in own:
        symbol, text = OUTCOMES[cell.outcome]
        if cell.outcome in _NOT_BAD:
            outcome = TableCell(f"{symbol} {text}", note=cell.message)
        else:  # the tone brings its own symbol
            outcome = TableCell(text, "bad", note=cell.message)
        numbers = [number(x) for x in (cell.angle_error, cell.energy_drift, cell.run_time_s or None, cell.step)]
        rows.append([run_cell(scene.runs[cell.method]), outcome, *numbers, f"{cell.time_reached:.4g}"])
    head = (
        "Method", "Outcome", "angle error (rad)", "energy drift", "run time (s)", "step for 10⁻⁶ rad (s)",
        "reached (s)",
    )  # fmt: skip
    return PageTable("", head, rows, (2, 3, 4, 5, 6))


def _motion(run: StoredRun | None) -> Section:
    if run is None or len(run.array("time")) < 2:
        return Section()
    caption, unresolved = f"Angles and rates of {label_of(run.method)}", _unresolved(run)
    if unresolved:
        caption += f". The samples are too far apart to resolve the swings of {listed(unresolved)}: "
        caption += "only their range is meaningful"
    legend = [LegendEntry(label, coordinate_look(i)) for i, label in enumerate(run.labels)]
    panels = histories.motion(run.array("time"), run.get("angles"), run.get("rates"))
    return Section([picture(panels, "motion", caption, caption)], legend)


def _unresolved(run: StoredRun) -> list[str]:
    """Coordinates that at their largest rate would cross their whole range between two samples."""
    interval = float(run.array("time")[1] - run.array("time")[0])
    ranges, fastest = np.ptp(run.array("angles"), axis=0), np.abs(run.array("rates")).max(axis=0)
    return [label for label, a, w in zip(run.labels, ranges, fastest, strict=True) if w * interval > a > 0.0]


def _errors(scene: StoredScene, runs: quantities.Runs) -> Section:
    differences = quantities.differences(runs, scene.reference)
    caption = "Largest angle difference from the reference"
    kinds = [(differences, "largest angle difference (rad)", "difference", caption, horizon(scene))]
    kinds += [
        (quantities.sizes(quantity, runs), plot.axis, quantity.name, plot.title, None)
        for quantity, plot in quantities.plotted_quantities(scene)
        if plot.logarithmic
    ]
    energy, drawn = quantities.energy_picture(runs)
    pictures = [quantities.error_picture(*kind) for kind in kinds if quantities.visible(kind[0])]
    drawn += [name for kind in kinds for name in quantities.visible(kind[0])]
    legend = quantities.run_legend([name for name in runs if name in drawn])
    return Section([one for one in (*pictures, energy) if one is not None], legend)


def _error_over_step(ladders: Sequence[Record]) -> Section:
    drawn = {r.method: r.arrays for r in ladders if np.isfinite(r.arrays["angle_error_max"]).any()}
    if not drawn:
        return Section()
    curves = [(arrays["step"], arrays["angle_error_max"], look_of(name)) for name, arrays in drawn.items()]
    caption = "Largest angle error up to the horizon over the fixed step; no mark where the run failed"
    shown = picture(histories.error_over_step(curves, TARGET), "steps", caption, caption)
    return Section([shown], quantities.run_legend(list(drawn)))
