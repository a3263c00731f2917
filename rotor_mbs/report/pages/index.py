"""Build the index of a file with several scenes: the results, and a table with a row per scene.

The index of scenes of the paper has the findings about the paper. The index of a user's own scenes
has the statuses of their runs, with the failed scenes first.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from rotor_mbs.analysis.published import ENERGY_RISE, rounds_to
from rotor_mbs.methods.catalogue import errata_methods, is_corrected
from rotor_mbs.report.elements import (
    Element,
    Fact,
    Fold,
    Grid,
    Legend,
    Note,
    PageContent,
    PageTable,
    Row,
    Section,
    TableCell,
)
from rotor_mbs.report.looks import coordinate_look, with_capital
from rotor_mbs.report.numbers import (
    NOTHING,
    formula,
    in_words,
    number,
    prefixed,
    text_range,
    typeset_title,
    with_unit,
)
from rotor_mbs.report.pages import (
    Report,
    agree_within,
    agreement,
    agreement_of_scenes,
    compared_time,
    method_cell,
    metric,
    number_cell,
    numbers_sentence,
    paper,
    reproduced,
    status_text,
    words_of,
)
from rotor_mbs.report.pages import scene_plots as draw
from rotor_mbs.report.pages.scene import HORIZON_NOTE, paper_plots, short_name
from rotor_mbs.report.pages.scene_plots import CORRECTED, PRINTED
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.scenario.keys import counted
from rotor_mbs.solution.status import GOOD

_NAMED = 5  # largest number of scenes whose names a sentence has


def index_page(report: Report) -> PageContent:
    """Return the content of the index of a results file.

    The index is that of the paper if the file has scenes with claims, else that of own scenes.
    """
    return _paper_index(report) if report.claims else _own_index(report)


# ---- Scenes of the paper


def created_energy(scene: StoredScene) -> float | None:
    """Return the energy (J) that the printed equations create in a scene.

    None is returned if the energy is unknown, or at most a thousandth of the energy scale.
    """
    run = scene.printed
    if run is None:
        return None
    gain, scale = metric(run, "energy_gain_J"), metric(run, "energy_scale_J")
    return gain if gain is not None and scale is not None and gain > ENERGY_RISE * scale else None


def paper_answer(report: Report) -> list[Markup]:
    """Return sentences on the findings about the paper, with numbers from the runs of the file.

    Parameters
    ----------
    report : the open results file, with scenes of the paper.
    """
    scenes = report.scenes.values()
    with_printed = [scene for scene in scenes if scene.printed is not None]
    rising = [scene for scene in with_printed if created_energy(scene) is not None]
    sentences = []
    if report.errata and with_printed:
        text = Markup(
            "The paper's printed equations contain <b>{} errors</b> and create energy in <b>{} of "
            "{} scenes</b>."
        )
        sentences.append(text.format(in_words(len(report.errata)), len(rising), len(with_printed)))
    methods, error, agreeing = agreement_of_scenes(scenes)
    if error is not None:
        where = f"all {len(scenes)}" if agreeing == len(scenes) else f"{agreeing} of {len(scenes)}"
        compared, whole = compared_time(scenes)
        over = f", over {compared:.0f} of {whole:.0f} s" if compared < whole else ""
        text = Markup("Corrected, {} in {} scenes{}.")
        sentences.append(text.format(agree_within(methods, error), where, over))
    sentences.append(numbers_sentence(report.claims))
    return [sentence for sentence in sentences if sentence]


def _paper_index(report: Report) -> PageContent:
    """Return the index of a file with scenes of the paper.

    Parameters
    ----------
    report : the open results file.
    """
    scenes = report.scenes
    facts = _paper_facts(report)
    sections = []
    hero = _hero_scene(report)
    if hero is not None:
        sections.append(_hero_section(hero, report))
    table = scene_table(report)
    say = "Sorted as in the paper; click a heading to sort."
    sections.append(
        Section(
            "scenes",
            f"All {len(scenes)} scenes",
            [table, Fold("Horizon and energy", "what they are", [Note(HORIZON_NOTE)])],
            say,
        )
    )
    sections += [_errata_section(report), _published_section(report), _methods_section(report)]
    return PageContent(
        "A published rotor model, checked", paper.PAPER, paper_answer(report), facts, sections
    )


def _paper_facts(report: Report) -> list[Fact]:
    """Return the facts about the paper: errors, created energy, disagreement, published numbers.

    Parameters
    ----------
    report : the open results file.
    """
    facts: list[Fact] = []
    if report.errata:
        names = ", ".join(erratum.id for erratum in report.errata)
        link = Markup('<a href="errata.html">{}</a>; each found by differentiation').format(names)
        facts.append(Fact("Errors in the printed equations", str(len(report.errata)), link))
    with_printed = [scene for scene in report.scenes.values() if scene.printed is not None]
    if with_printed:
        gains = {scene.name: created_energy(scene) for scene in with_printed}
        complete = {
            scene.name
            for scene in with_printed
            if scene.printed is not None and scene.printed.status in GOOD
        }
        known = [
            (gain, name) for name, gain in gains.items() if gain is not None and name in complete
        ]
        note = (
            f"up to {prefixed(max(known)[0], 'J', 2)} ({short_name(max(known)[1])})"
            if known
            else ""
        )
        count = sum(gain is not None for gain in gains.values())
        facts.append(
            Fact("Scenes in which energy is created", f"{count} of {len(with_printed)}", note)
        )
    _, error, _ = agreement_of_scenes(report.scenes.values())
    if error is not None:
        runs = [run for scene in report.scenes.values() for run in scene.corrected_runs.values()]
        good = sum(run.status == "ok" for run in runs)
        compared, whole = compared_time(report.scenes.values())
        note = f"{good} of {len(runs)} runs ok; {compared:.0f} of {whole:.0f} s compared"
        is_bad = any(run.status not in GOOD for run in runs)
        facts.append(
            Fact(
                "Corrected: largest disagreement",
                f"{number(error)} rad",
                note,
                "bad" if is_bad else "",
            )
        )
    numbers = [claim for claim in report.claims if claim.is_number]
    if numbers:
        rounding = sum(claim.rounding for claim in numbers)
        note = "by the printed equations"
        if rounding:
            verb = "are" if rounding > 1 else "is"
            note += f"; {in_words(rounding)} of them {verb} amplified rounding error"
        count, _ = reproduced(numbers)
        facts.append(Fact("Published numbers reproduced", f"{count} of {len(numbers)}", note))
    return facts


def _hero_scene(report: Report) -> StoredScene | None:
    """Return the scene whose plots are shown at the top; None if no scene has both models.

    Only scenes with angles of both models are considered. The scene of the first published number
    that is not an amplified rounding error is returned. If there is none, the first scene is
    returned.

    Parameters
    ----------
    report : the open results file.
    """
    both = [
        scene
        for scene in report.scenes.values()
        if len(scene.sides) == 2 and all("angles" in run for run in scene.sides.values())
    ]
    for claim in report.claims:
        if claim.is_number and not claim.rounding and report.scenes[claim.scene] in both:
            return report.scenes[claim.scene]
    return both[0] if both else None


def _hero_section(scene: StoredScene, report: Report) -> Section:
    """Return the section with the plots that compare both models in one scene.

    Parameters
    ----------
    scene : the scene. Both models have a run with angles.
    report : the open results file, with the claims about the scene and the file of its page.
    """
    claims = [claim for claim in report.claims if scene.name in claim.scenes]
    hero, _, _ = paper_plots(scene, claims)
    printed, corrected = scene.sides[PRINTED], scene.sides[CORRECTED]
    link = Markup('<a href="{}">More on this scene</a>').format(report.files[scene.name])
    say = Markup("{}. ").format(typeset_title(scene.title))
    # If the printed equations reproduce a published number, the text names it in place of the
    # scene's title.
    for claim in claims:
        if claim.is_number and claim.printed is not None and rounds_to(claim.printed, claim):
            ends = [float(run.array("angles")[-1, 0]) for run in (printed, corrected)]
            say = Markup(
                "From the same start the printed equations stop the rotor at {} rad, the paper's "
                "{}, and end at {} rad; the corrected ones end at {} rad. "
            ).format(
                number(claim.printed, 3),
                paper.quantity_of(claim),
                *(number(end, 3) for end in ends),
            )
            break
    legend = Legend([(CORRECTED, draw.CORRECTED_LOOK), (PRINTED, draw.PRINTED_LOOK)])
    figure = scene.figures.partition(",")[0]
    heading = f"Figure {figure}, as printed and corrected" if figure else "As printed and corrected"
    return Section("hero", heading, [legend, hero], say + link)


def scene_table(report: Report) -> PageTable:
    """Return the table of the paper's scenes.

    Its columns have the departure of the printed model from the corrected one, the energy that the
    printed model creates, and the agreement of the corrected methods.

    Parameters
    ----------
    report : the open results file.
    """
    rows: list[Row] = []
    # A scene in which fewer methods agree than in another scene has a note with their number.
    most = max((len(agreement(scene)[0]) for scene in report.scenes.values()), default=0)
    for name, scene in report.scenes.items():
        note = typeset_title(scene.title)
        row: list[TableCell | str] = [
            TableCell(short_name(scene.label), href=report.files[name], note=note)
        ]
        row += _departure_cells(scene)
        methods, error = agreement(scene)
        failed = [run for run in scene.corrected_runs.values() if run.status not in GOOD]
        notes = ", ".join(f"{run.method}: {status_text(run)}" for run in failed)
        if len(methods) != most:
            notes = "; ".join(filter(None, [counted(len(methods), "method"), notes]))
        if error is None:
            row.append(TableCell(NOTHING, note=notes))
        else:
            text = number(error) if error else "exact"
            row.append(TableCell(text, "bad" if failed else "", note=notes, order=error))
        compared, whole = compared_time([scene])
        row.append(TableCell(f"{compared:.3g} of {whole:g} s", order=compared) if whole else "")
        rows.append(row)
    head = (
        "Scene", "The angle that differs most: corrected, as printed",
        f"Printed model is {draw.VISIBLE:g} rad off after", "Energy it creates",
        "Corrected methods agree within (rad)", "Compared",
    )  # fmt: skip
    return PageTable("All scenes", head, rows, wide=(1, 5), sortable=True)


def _departure_cells(scene: StoredScene) -> list[TableCell | str]:
    """Return the cells about the printed model: drawing, time of departure, created energy.

    Parameters
    ----------
    scene : scene of the row. If a model has no angles, the cells are empty.
    """
    sides = scene.sides
    if len(sides) < 2 or not all("angles" in run for run in sides.values()):
        return ["", "", ""]
    printed, corrected = sides[PRINTED], sides[CORRECTED]
    coordinate = draw.differing_coordinate(printed, corrected)
    right = corrected.array("angles")[:, coordinate]
    low, high = float(right.min()), float(right.max())
    # The drawing has the range of the corrected model and some room on both sides. The curve of the
    # printed model is cut off beyond it.
    room = max(0.6 * (high - low), 0.2)
    picture = draw.spark(
        [
            (corrected.array("time"), right, draw.CORRECTED_LOOK),
            (printed.array("time"), printed.array("angles")[:, coordinate], draw.PRINTED_LOOK),
        ],
        low - room,
        high + room,
    )
    left, _ = draw.parting(printed, corrected)
    cells: list[TableCell | str] = [
        TableCell("", note=corrected.labels[coordinate], picture=picture, order=coordinate)
    ]
    cells.append(
        TableCell("never", order=1e9)
        if left is None
        else TableCell(with_unit(left, "s"), order=left)
    )
    gain = metric(printed, "energy_gain_J")
    if gain is None:
        cells.append("" if printed.status in GOOD else TableCell(words_of(printed.status), "bad"))
    elif printed.status not in GOOD:
        cells.append(TableCell("runs away", order=gain))
    elif created_energy(scene) is None:
        size = prefixed(gain, "J", 2) if gain >= 1.0 else "below 1 J"
        note = f"below {ENERGY_RISE:g} of the energy scale" if gain >= 1.0 else ""
        cells.append(TableCell(size, note=note, order=gain))
    else:
        cells.append(TableCell(prefixed(gain, "J"), order=gain))
    return cells


def _errata_section(report: Report) -> Section:
    """Return the section with a table of the errata: places, formulas, and effects.

    The effect of an erratum is that of the corrected equations with this erratum alone.

    Parameters
    ----------
    report : the open results file.
    """
    rows: list[Row] = []
    methods = errata_methods()
    for erratum in report.errata:
        where = TableCell(
            f"{erratum.id}, {paper.equations_of(erratum)}",
            href=f"errata.html#{erratum.id}",
            note=erratum.entry,
        )
        cells: list[TableCell | str] = [
            where,
            TableCell("", picture=_printed_and_right(erratum.printed, erratum.right)),
        ]
        for name in ("angle_error_max", "energy_drift_max"):
            found = paper.largest_of(report, methods.get(erratum.id, ""), name)
            if found is None:
                cells.append(NOTHING)
            else:
                cells.append(TableCell(number(found[0]), note=short_name(found[1]), order=found[0]))
        rows.append(cells)
    head = (
        "Where",
        "Printed, and what is right",
        "Largest angle error (rad)",
        "Energy error / energy scale",
    )
    table = PageTable("The errors", head, rows)
    say = "Effect of each alone, in otherwise right equations: the largest over all scenes."
    heading = f"The {in_words(len(report.errata))} errors"
    return Section("errors", heading, [table] if rows else [], say)


def _printed_and_right(printed: str, right: str) -> Markup:
    """Return two lines of HTML: the printed formula of an erratum, and the correct formula."""
    lines = Markup('<span class="formula">{}</span><small>right: {}</small>')
    return lines.format(formula(printed, in_prose=True), formula(right, in_prose=True))


def _published_section(report: Report) -> Section:
    """Return the section with a table of published numbers, and the counts of the claims.

    Parameters
    ----------
    report : the open results file.
    """
    numbers = paper.number_table(report.claims)
    cards: list[list[Element]] = [[numbers]] if numbers.rows else []
    study = report.study
    if study is not None:
        link = Markup('<a href="claims.html">Each claim with its quotation</a>')
        cards.append(
            [
                paper.count_table(study),
                Note(Markup("{} runs of each scene with moved starts. ").format(study.runs) + link),
            ]
        )
    return Section(
        "published", "Published numbers and claims", [Grid(len(cards), cards)] if cards else []
    )


def _methods_section(report: Report) -> Section:
    """Return the section with a table of corrected methods and their largest errors in all scenes.

    Parameters
    ----------
    report : the open results file.
    """
    runs: dict[str, list[StoredRun]] = {}
    for scene in report.scenes.values():
        for method, run in scene.corrected_runs.items():
            runs.setdefault(method, []).append(run)
    rows: list[Row] = []
    for method, own in runs.items():
        good = sum(run.status == "ok" for run in own)
        sign = "✓ " if good == len(own) else ""
        row = [
            method_cell(method),
            TableCell(f"{sign}{good} of {len(own)}", "good" if sign else "bad"),
        ]
        for name in ("angle_error_max", "defect_max", "energy_drift_max", "run_time_s"):
            values = [value for run in own if (value := metric(run, name)) is not None]
            row.append(number_cell(max(values, default=None)))
        rows.append(row)
    head = (
        "Method",
        "ok",
        "Largest angle error (rad)",
        "Largest interval defect (rad)",
        "Energy error / energy scale",
        "Longest run (s)",
    )
    elements: list[Element] = (
        [PageTable("Methods over all scenes", head, rows, wide=(3, 5), sortable=True)]
        if rows
        else []
    )
    if report.curves:
        elements.append(
            Note(
                Markup('<a href="bench.html">Error against run time for all methods and steps</a>')
            )
        )
    return Section("methods", "Methods over all scenes", elements)


# ---- A user's own scenes


def _own_index(report: Report) -> PageContent:
    """Return the index of a file with a user's own scenes.

    Parameters
    ----------
    report : the open results file.
    """
    scenes = list(report.scenes.values())
    failed = [scene for scene in scenes if _is_bad(scene)]
    good = [scene for scene in scenes if scene.corrected_runs and scene not in failed]
    unchecked = len(scenes) - len(failed) - len(good)
    count = len(scenes)
    answer = []
    if failed:
        text = Markup('<span class="bad">{} of {} scenes {} not ok</span>: {}.')
        names = ", ".join(scene.label for scene in failed[:_NAMED])
        if len(failed) > _NAMED:
            names += f" and {len(failed) - _NAMED} more"
        answer.append(text.format(len(failed), count, _is_or_are(len(failed)), names))
    if len(good) == count:
        answer.append(Markup("All <b>{} scenes</b> are ok.").format(in_words(count)))
    else:
        text = Markup("{} of the {} scenes {} ok.")
        subject = in_words(len(good)).capitalize() if good else "None"
        answer.append(text.format(subject, in_words(count), _is_or_are(max(len(good), 1))))
    if unchecked:
        text = Markup(
            "Of {} nothing was checked: {} no run of a corrected model beside the reference."
        )
        answer.append(text.format(in_words(unchecked), "it has" if unchecked == 1 else "they have"))
    methods, error, agreeing = agreement_of_scenes(scenes)
    if error is not None:
        text = Markup("{} in {} of {} scenes.")
        sentence = Markup(with_capital(agree_within(methods, error)))
        answer.append(text.format(sentence, agreeing, count))
    say = (
        "Those that are not ok first; click a heading to sort."
        if failed
        else "Click a heading to sort."
    )
    table = own_table(report, [*failed, *(scene for scene in scenes if scene not in failed)])
    sections = [Section("scenes", f"{count} scenes", [table], say), _methods_section(report)]
    tone = "bad" if failed else "good" if len(good) == count else ""
    facts = [Fact("Scenes", f"{len(good)} of {count} ok", "", tone)]
    largest = _largest_moment(scenes)
    if largest is not None:
        facts.append(Fact("Largest blade root moment", prefixed(largest[0], "N m"), largest[1]))
    if error is not None:
        compared, whole = compared_time(scenes)
        facts.append(
            Fact(
                "Largest disagreement",
                f"{number(error)} rad",
                f"{number(compared, 3)} of {number(whole, 3)} s compared",
            )
        )
    return PageContent("Rotor scenes", report.path.name, answer, facts, sections)


def _is_or_are(count: int) -> str:
    return "is" if count == 1 else "are"


def _is_bad(scene: StoredScene) -> bool:
    """Return whether some run of a corrected model in the scene is not ok."""
    return any(run.status not in GOOD for run in scene.runs.values() if is_corrected(run.method))


def _largest_moment(scenes: Sequence[StoredScene]) -> tuple[float, str] | None:
    found = []
    for scene in scenes:
        run = scene.corrected
        value = None if run is None else metric(run, "blade_root_moment_max")
        if value is not None:
            found.append((value, scene.name))
    return max(found) if found else None


def _status_cell(scene: StoredScene) -> TableCell:
    """Return a cell with the statuses of a scene's failed runs.

    If no run failed, the cell has the number of corrected runs, which are all ok. If there is no
    corrected run, the cell has the statuses of the other runs.
    """
    bad = [run for run in scene.methods.values() if run.status not in GOOD]
    if bad:
        notes = "; ".join(f"{run.method}: {run.attributes.get('message', '')}" for run in bad)
        statuses = ", ".join(dict.fromkeys(map(status_text, bad)))
        return TableCell(statuses, "bad", note=notes, order=-len(bad))
    good = len(scene.corrected_runs)
    if good:
        return TableCell(f"✓ {good} of {good}", "good", order=good)
    # Runs of the printed equations and the reference are not checked and do not count as ok.
    ended = ", ".join(dict.fromkeys(map(status_text, scene.methods.values())))
    return TableCell(ended or "reference only", order=0)


def own_table(report: Report, scenes: Sequence[StoredScene]) -> PageTable:
    """Return the table of a user's scenes: rotor speed, status, largest load, and agreement.

    Parameters
    ----------
    report : the open results file.
    scenes : scenes in the order of the rows.
    """
    rows: list[Row] = []
    for scene in scenes:
        row: list[TableCell | str] = [
            TableCell(scene.label, href=report.files[scene.name], note=typeset_title(scene.title))
        ]
        run = scene.corrected or scene.printed
        name = (
            "" if run is None else next((name for name in ("rates", "angles") if name in run), "")
        )
        if run is not None and name:
            values = run.array(name)[:, 0]
            low, high = float(np.nanmin(values)), float(np.nanmax(values))
            picture = draw.spark([(run.array("time"), values, coordinate_look(0))], low, high)
            unit = "rad/s" if name == "rates" else "rad"
            row.append(
                TableCell(
                    "",
                    note=f"{text_range(number(low, 3), number(high, 3))} {unit}",
                    picture=picture,
                    order=high,
                )
            )
        else:
            row.append("")
        row.append(_status_cell(scene))
        load = None if run is None else metric(run, "blade_root_moment_max")
        row.append("" if load is None else TableCell(prefixed(load, "N m"), order=load))
        _, error = agreement(scene)
        row.append(number_cell(error))
        rows.append(row)
    head = (
        "Scene",
        "Rotor speed",
        "Runs ok",
        "Largest blade root moment",
        "Methods agree within (rad)",
    )
    return PageTable("All scenes", head, rows, sortable=True)
