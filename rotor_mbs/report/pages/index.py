"""The index: the rotor, the published crest, energy and errors of all methods; then numbers, claims and all scenes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from rotor_mbs.analysis import run_selection
from rotor_mbs.analysis.claims import ENERGY_RISE, Claim, Finding, finding
from rotor_mbs.analysis.published import Erratum
from rotor_mbs.report.core.elements import LegendEntry, PageTable, Picture, Row, Section, TableCell
from rotor_mbs.report.core.looks import Look, label_of, look_of
from rotor_mbs.report.core.numbers import number, prefixed, with_unit
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.pages import Context, claim_tables
from rotor_mbs.report.pages.bench import cost_legend, cost_picture
from rotor_mbs.report.pages.comparison_pictures import energy_of_scenes, key_picture
from rotor_mbs.report.pages.scene_tables import horizon, metric, status_cell, status_text, versions
from rotor_mbs.report.pages.viewer import viewer
from rotor_mbs.report.plots import paths
from rotor_mbs.runs.read import OpenResults, StoredRun, StoredScene

Scenes = Mapping[str, StoredScene]
# Errors of the heat map: a shade for each of these powers of ten and below, the last for all that is larger.
_SHADES = (-12, -10, -8, -6, -4, -2, 0)
_MARKS = {"ok": "", "inaccurate": "≠", "timed_out": "T", "diverged": "↯", "singular": "S", "unchecked": "?"}
_FAILED = "✗"
_NAMED = 4  # methods at most in the sentence on agreement; of more, the best and the worst


def index_page(opened: OpenResults, context: Context) -> dict[str, object]:
    """The content of the index. Tables are folded, below what it opens with."""
    scenes, claims, study = opened.scenes, context.claims, context.study
    shares = None if study is None else study.shares
    trials = [] if study is None else claim_tables.trial_tables(study.numbers)[:1]
    notes = [] if shares is None else [claim_tables.headline(shares), claim_tables.study_note(shares)]
    general = [text for key, text in context.conditions.items() if not key.startswith("fig")]
    general += [] if study is None else [claim_tables.numbers_headline(study.numbers)]
    return {
        "glance": _glance(scenes, context),
        "scenes": Section(tables=[_scene_table(scenes, context.files)]),
        "numbers": Section(tables=[claim_tables.number_table(claims), *trials], notes=general),
        "claims": Section(tables=[claim_tables.claim_table(claims, shares)], notes=notes),
        "errata": Section(tables=[_errata_table(context.errata)]),
        "versions": versions(opened.attributes),
        "is_paper": bool(claims),
    }


def _glance(scenes: Scenes, context: Context) -> dict[str, object]:
    """What the index opens with; what the file has no data for is None."""
    name = _shown_scene(scenes, context.claims)
    sides = list(run_selection.sides(scenes[name]).values())
    benched = next((one for one in context.curves if one in scenes), "")
    tips = next((run for run in reversed(sides) if "tip" in run), None)
    own = [claim for claim in context.claims if name in claim.published.scenes]
    curves = context.curves.get(benched, ())
    cost = cost_picture(curves, f"Error against run time of all methods, {benched}")
    described = f"{name}: paths of the tips"
    return {
        "sentences": short_sentences(finding(scenes, context.claims)),
        "scene": name,
        "viewer": viewer(scenes[name], {label_of(run.method): run for run in sides}),
        "still": None if tips is None else picture(paths.paths(tips.array("tip")), "still", name, described),
        "crest": key_picture(sides, own, horizon(scenes[name]), "crest"),
        "energy": _energy(scenes),
        "cost": None if cost is None else replace(cost, legend=cost_legend(curves)),
        "heat": heat_map(scenes, context.files),
    }


def _shown_scene(scenes: Scenes, claims: Sequence[Claim]) -> str:
    """The scene with a published extreme that is no rounding error; else one with both models; else the first."""
    for claim in claims:
        item = claim.published
        if item.is_number and not item.rounding and item.of is not None and item.of.scene in scenes:
            return item.of.scene
    return next((name for name, scene in scenes.items() if len(run_selection.sides(scene)) > 1), next(iter(scenes)))


def short_sentences(facts: Finding) -> list[str]:
    """Three at most: what the paper's numbers come from, what is wrong with that, and how well it is known."""
    found = []
    numbers, corrected = facts.numbers, facts.numbers_corrected
    if numbers is not None:
        share = f"all {numbers.of}" if numbers.count == numbers.of else f"{numbers.count} of {numbers.of}"
        other = "" if corrected is None else f"; with their three errors corrected, {corrected.count or 'none'}"
        found.append(f"The paper's equations as printed give {share} published numbers{other}.")
    if facts.energy is not None and facts.energy.rises.count:
        rises, gain = facts.energy.rises, facts.energy.gain
        most = "" if gain is None else f", up to {prefixed(gain, 'J')}"
        for name, until_then in facts.energy.ended_early.items():
            most += f"; in {name} {prefixed(until_then, 'J')} before its run breaks off"
        found.append(f"As printed they make energy from nothing in {rises.count} of {rises.of} scenes{most}.")
    known = {one.method: one.angle_error for one in facts.agreement if one.angle_error is not None}
    if known:
        count = len({method.partition("/")[0] for method in known})
        models = "The corrected model agrees" if count == 1 else f"{count} independent corrected models agree"
        ranked = sorted(known.items(), key=lambda item: item[1])
        shown = ranked if len(ranked) <= _NAMED else [ranked[0], ranked[-1]]
        each = ", ".join(f"{with_unit(error, 'rad')} ({label_of(method)})" for method, error in shown)
        found.append(f"{models} with a quad-precision reference to {each}, up to each scene's horizon.")
    return found


def _energy(scenes: Scenes) -> Picture | None:
    """A mark per scene for the printed model's gain, and for the worst corrected model's drift."""
    rows: dict[str, list[tuple[float, Look]]] = {}
    drawn: dict[str, Look] = {}
    made = 0
    for name, scene in scenes.items():
        marks = []
        for run in scene.methods.values():
            gain, scale = metric(run, "energy_gain_J"), metric(run, "energy_scale_J")
            is_printed = run.method == run_selection.PRINTED
            if gain is None or not scale or not (is_printed or run.method in run_selection.corrected_runs(scene)):
                continue
            value = gain / scale if is_printed else metric(run, "energy_drift_max")
            if value is not None and math.isfinite(value):
                marks.append((value, look_of(run.method)))
                drawn[run.method] = look_of(run.method)
                made += is_printed and value > ENERGY_RISE
        if marks:
            rows[name.removeprefix("paper/")] = marks
    if run_selection.PRINTED not in drawn:
        return None
    caption = f"Energy made from nothing: the printed equations, more than a thousandth in {made} of {len(rows)} scenes"
    legend = [LegendEntry(label_of(name), Look(look.colour, "", look.marker)) for name, look in drawn.items()]
    return picture(energy_of_scenes(rows), "energy-scenes", caption, f"{caption}.", legend=legend)


def heat_map(scenes: Scenes, files: Mapping[str, str]) -> dict[str, object] | None:
    """Scene by method, the largest angle error before the horizon; None where no run was compared with a reference.

    methods: (label, name); rows: (scene, page, cells); key: the marks that occur, with their meaning
    """
    names = dict.fromkeys(name for scene in scenes.values() for name in run_selection.corrected_runs(scene))
    methods = run_selection.in_catalogue_order(names)
    if any(run_selection.PRINTED in scene.methods for scene in scenes.values()):
        methods.insert(0, run_selection.PRINTED)
    rows = [
        (name, files[name], [_heat_cell(scene.methods.get(method)) for method in methods])
        for name, scene in scenes.items()
    ]
    known = [cell for _, _, cells in rows for cell in cells if cell]
    if not any(error for _, error, _, _ in known):
        return None
    used = {mark: spoken.rpartition(", ")[2] for _, _, mark, spoken in known if mark}
    return {"methods": [(label_of(name), name) for name in methods], "rows": rows, "key": sorted(used.items())}


def _heat_cell(run: StoredRun | None) -> tuple[int, str, str, str] | None:
    """The number of its shade, the error as text, the mark of the status, and a text that is read out."""
    if run is None:
        return None
    error = metric(run, "angle_error_max")
    text = "" if error is None else number(error)
    spoken = f"{label_of(run.method)}: {text or 'no error known'}, {status_text(run.status)}"
    shade = len(_SHADES) if error is None or not math.isfinite(error) else sum(error > 10.0**e for e in _SHADES)
    return shade, text, _MARKS.get(run.status, _FAILED), spoken


def _scene_table(scenes: Mapping[str, StoredScene], files: Mapping[str, str]) -> PageTable:
    """A row per scene: its horizon, and what the printed model does."""
    head = ("Scene", "Figure", "Horizon", "As printed, ode45", "departs by (rad, whole run)", "energy gain")
    rows: list[Row] = []
    for name, scene in scenes.items():
        cells: list[TableCell | str] = [str(scene.attributes.get("figures", "")), with_unit(horizon(scene), "s", 3)]
        run = scene.methods.get(run_selection.PRINTED)
        if run is not None:
            gain = prefixed(metric(run, "energy_gain_J"), "J")
            cells += [status_cell(run), number(metric(run, "angle_error_whole")), gain]
        rows.append([TableCell(name, href=files[name], note=scene.title), *cells, *[""] * (len(head) - 1 - len(cells))])
    return PageTable("", head, rows, numeric=(2, 4, 5)).without_empty_columns()


def _errata_table(errata: Sequence[Erratum]) -> PageTable:
    rows = [
        (TableCell(e.id, href=f"errata.html#{e.id}"), ", ".join(e.stands_in), e.printed, e.right, e.reason)
        for e in errata
    ]
    caption = "The errors in the printed equations; all else follows from them"
    return PageTable(caption, ("Erratum", "Equation", "Printed", "Correct", "Reason"), rows)
