"""The index: the rotor, the published crest, defects of all methods; then numbers, claims and all scenes."""

from __future__ import annotations

import math
from collections.abc import Mapping

from rotor_mbs.analysis.published import finding
from rotor_mbs.analysis.text_tables import method_table
from rotor_mbs.methods.catalogue import PRINTED, REFERENCE
from rotor_mbs.report import plots
from rotor_mbs.report.elements import PageTable, Row, Section, TableCell, picture
from rotor_mbs.report.looks import label_of
from rotor_mbs.report.numbers import SPACE, number, power, prefixed
from rotor_mbs.report.pages import (
    Report,
    compared_time,
    horizon_of,
    method_cell,
    metric,
    paper,
    status_text,
)
from rotor_mbs.report.pages.bench import cost_picture
from rotor_mbs.report.pages.scene import defects, error_picture, key_picture
from rotor_mbs.report.pages.viewer import viewer
from rotor_mbs.runs.read import StoredScene
from rotor_mbs.solution.status import GOOD
from rotor_mbs.studies.stability import OUTCOMES

Scenes = Mapping[str, StoredScene]
# Errors: a shade for each of these powers of ten and below, the last for all that is larger.
_SHADES = (-12, -10, -8, -6, -4, -2, 0)


def index_page(report: Report) -> dict[str, object]:
    """The content of the index; what the file has no data for is None or empty. Its last tables are folded."""
    scenes, claims, study = report.scenes, report.claims, report.study
    model = "Corrected model" if claims else "Model"  # of a user's own rotor nothing was corrected
    # The scene with a published extreme that is no rounding error; else one with both models; else the first.
    both = [name for name, scene in scenes.items() if len(scene.sides) > 1]
    shown = next(iter([*both, *scenes]))
    for claim in claims:
        if claim.is_number and not claim.rounding:
            shown = claim.scene
            break
    sides = list(scenes[shown].sides.values())
    own_claims = [claim for claim in claims if shown in claim.scenes]
    printed = scenes[shown].printed
    judged = {} if printed is None else {printed.method: printed}
    judged |= scenes[shown].corrected_runs
    still = None
    for run in sides:
        if "tip" in run:
            still = picture(plots.paths(run.array("tip")), "still", f"{shown}: paths of the tips")
    benched = next((scene for scene in report.curves if scene in scenes), "")
    methods = method_table(run for scene in scenes.values() for run in scene.corrected_runs.values())
    method_rows = [(method_cell(name), *cells) for name, *cells in methods.rows]
    compared, whole = compared_time(scenes.values())
    notes = []
    if compared:
        notes.append(
            f"Compared with the reference over {number(compared, 3)} of {number(whole, 3)} s of simulated time, "
            f"{100.0 * compared / whole:.0f}{SPACE}%: each scene up to its horizon."
        )
    table, marks = scene_table(scenes, report.files)
    shades = [*(f"≤{SPACE}{power(exponent)}" for exponent in _SHADES), f">{SPACE}{power(_SHADES[-1])}"]
    return {
        "paper": PageTable("", ("Result", "As printed", model), finding(scenes, claims)),
        "scene": shown,
        "viewer": viewer(scenes[shown], {label_of(run.method): run for run in sides}),
        "still": still,
        "pictures": [
            *key_picture(sides, own_claims, horizon_of(scenes[shown]), "crest"),
            *error_picture(
                defects(scenes[shown].scene, judged),
                "defect of an interval (rad)",
                "defects",
                f"{shown}: interval defects",
            ),
            *cost_picture(report.curves.get(benched, ()), f"Error and run time of all methods, {benched}"),
        ],
        "methods": Section(tables=[PageTable("", methods.head, method_rows)], notes=notes),
        "scenes": table,
        "marks": sorted(marks.items()),
        "shades": shades if compared else [],
        "numbers": Section(
            tables=[paper.number_table(claims)],
            notes=[text for key, text in report.conditions.items() if not key.startswith("fig")],
        ),
        "claims": Section(tables=[] if study is None else [paper.claim_table(claims, study)]),
        "study": study,
        "is_paper": bool(claims),
    }


def scene_table(scenes: Scenes, files: Mapping[str, str]) -> tuple[PageTable, dict[str, str]]:
    """A row per scene: errors of all methods, and the energy gain of the printed model.

    Returns the table, and what its marks stand for.
    """
    names = dict.fromkeys(name for scene in scenes.values() for name in scene.runs)
    methods = [name for name in names if name != REFERENCE]
    marks: dict[str, str] = {}
    rows: list[Row] = []
    for name, scene in scenes.items():
        compared, whole = compared_time([scene])
        row: list[TableCell | str] = [TableCell(name, href=files[name], note=scene.title)]
        row += [
            scene.figures,
            f"{number(compared, 3)} of {number(whole, 3)}" * (whole > 0.0),
        ]
        for method in methods:
            run = scene.methods.get(method)
            if run is None:
                row.append("")
                continue
            error, shade, mark = metric(run, "angle_error_max"), "n", ""
            if error is not None:
                is_finite = math.isfinite(error)
                shade = f"n h{sum(error > 10.0**exponent for exponent in _SHADES) if is_finite else len(_SHADES)}"
            if run.status not in GOOD:
                mark = OUTCOMES[run.status][0]
                marks[mark] = status_text(run)
            title = f"{label_of(method)}: {'error unknown' if error is None else number(error)}, {status_text(run)}"
            row.append(TableCell(f"{number(error)} {mark}".rstrip(), shade=shade, title=title))
        printed = scene.methods.get(PRINTED)
        row.append("" if printed is None else prefixed(metric(printed, "energy_gain_J"), "J"))
        rows.append(row)
    head = ("Scene", "Figure", "Compared (s)", *map(method_cell, methods), "As printed: energy gain")
    return PageTable("Largest angle error up to the horizon (rad), by method", head, rows), marks
