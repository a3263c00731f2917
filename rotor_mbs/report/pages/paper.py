"""Build the pages of the paper's claims and errata, and tables of them for other pages."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence

from markupsafe import Markup

from rotor_mbs.analysis.published import (
    FAILS,
    HOLDS,
    UNDECIDED,
    CheckedEntry,
    ClaimStudy,
    Erratum,
    Published,
    checked_entries,
    rounds_to,
)
from rotor_mbs.methods.catalogue import errata_methods
from rotor_mbs.report.elements import (
    Element,
    Fact,
    Fold,
    Grid,
    Listing,
    Matrix,
    Note,
    PageContent,
    PageTable,
    Row,
    Section,
    TableCell,
)
from rotor_mbs.report.numbers import NOTHING, fixed, formula, in_words, number, up_to
from rotor_mbs.report.pages import Report, metric, number_cell, numbers_sentence
from rotor_mbs.runs.design import COLUMNS
from rotor_mbs.runs.read import StoredScene

ROUNDING = "amplified rounding error, which depends on how the equations are written"
_TONES = {HOLDS: "good", FAILS: "bad", UNDECIDED: ""}


PAPER = Markup(
    'Aguilar-Acevedo et al., <span lang="es">Modelado Euler-Lagrange del rotor de un '
    "aerogenerador tripala como sistema multicuerpo</span>, Revista UIS Ingenierías 19(1), "
    "25-36, 2020, <a "
    'href="https://doi.org/10.18273/revuin.v19n1-2020002">doi&nbsp;10.18273/revuin.v19n1-2020002</a>'
)


def quantity_of(claim: Published) -> str:
    """Return the name of a published number, such as "crest" or "largest rotor rate"."""
    if claim.id.endswith("-crest"):
        return "crest"
    return (
        COLUMNS[claim.metric]
        .long_name.partition(" (")[0]
        .partition(" over")[0]
        .replace("magnitude of the ", "")
    )


def unit_of_claim(claim: Published) -> str:
    """Return the unit of a published number."""
    return COLUMNS[claim.metric].units


def number_table(claims: Iterable[Published], *, with_figure: bool = True) -> PageTable:
    """Return a table of the published numbers beside the results of both models.

    Parameters
    ----------
    claims : numbers and claims of the paper. Claims in words are left out.
    with_figure : whether each row has the number of the paper's figure.
    """
    rows: list[Row] = []
    for claim in claims:
        if not claim.is_number:
            continue
        note = f"Fig. {claim.figure}" if with_figure else ""
        if claim.rounding:
            note = "; ".join(filter(None, [note, ROUNDING]))
        cells = [_verdict(value, claim) for value in (claim.printed, claim.corrected)]
        quantity = TableCell(f"{quantity_of(claim)} ({unit_of_claim(claim)})", note=note)
        rows.append([quantity, fixed(claim.value, claim.decimals), *cells])
    return PageTable(
        "Published numbers", ("Quantity", "Published", "As printed", "Corrected"), rows
    )


def _verdict(value: float | None, item: Published) -> TableCell:
    """Return a cell with a computed number, marked by whether it has the published digits.

    Parameters
    ----------
    value : the computed number; None gives a dash.
    item : the published number.
    """
    if value is None:
        return TableCell(NOTHING)
    holds = rounds_to(value, item)
    return TableCell(
        f"{'✓' if holds else '✗'} {fixed(value, item.decimals + 1)}", "good" if holds else "bad"
    )


def _claim_cell(verdict: str) -> TableCell:
    sign = {HOLDS: "✓ ", FAILS: "✗ "}.get(verdict, "")
    return TableCell(f"{sign}{verdict}", tone=_TONES[verdict])


def claim_table(claims: Iterable[Published], study: ClaimStudy) -> PageTable:
    """Return a table of the claims in words with their quotations and verdicts.

    Parameters
    ----------
    claims : numbers and claims of the paper. Numbers are left out.
    study : verdicts on each claim for both models.
    """
    rows: list[Row] = []
    for claim in claims:
        if claim.is_number:
            continue
        statement = TableCell(
            claim.statement, note=f"Fig. {claim.figure}: «{claim.quote}»", note_language="es"
        )
        rows.append(
            [
                statement,
                *(_claim_cell(study.verdicts[claim.id][method]) for method in study.methods),
            ]
        )
    return PageTable("Published claims", ("Claim", "As printed", "Corrected"), rows)


def count_table(study: ClaimStudy) -> PageTable:
    """Return a table with the numbers of claims that hold, fail or are undecided, by model."""
    names = {HOLDS: "hold", FAILS: "fail", UNDECIDED: "undecided: rounding decides"}
    rows = [
        [text, *(str(study.count(method, verdict)) for method in study.methods)]
        for verdict, text in names.items()
    ]
    return PageTable(
        "Published claims", (f"{len(study.verdicts)} claims", "As printed", "Corrected"), rows
    )


def study_note(study: ClaimStudy) -> str:
    """Return a text on the runs on which the verdicts are based, and on the rule for a verdict."""
    durations = ", ".join(f"{duration:g}" for duration in study.durations)
    return (
        f"Based on {study.runs} runs of each scene for each of the durations {durations} s, with "
        f"initial angles moved by up to {number(study.spread)} rad. A run is deciding if it "
        f"reached its end without a large energy gain. {study.rule}"
    )


def claims_section(claims: Sequence[Published], report: Report, scene: StoredScene) -> Section:
    """Return the section with a table of the paper's numbers and claims about a scene.

    Each row has the verdicts for both models.

    Parameters
    ----------
    claims : the paper's numbers and claims about the scene.
    report : the open results file, with the verdicts on the claims, and the conditions that the
        paper does not print.
    scene : the scene. Conditions are shown only if its motion is that of the shipped scene.
    """
    rows: list[Row] = []
    study = report.study
    for claim in claims:
        if claim.is_number:
            what = (
                f"Published {quantity_of(claim)}: {fixed(claim.value, claim.decimals)} "
                f"{unit_of_claim(claim)}"
            )
            note = f"Fig. {claim.figure}: «{claim.quote}»"
            if claim.rounding:
                what += f"; {ROUNDING}"
            statement = TableCell(what, note=note, note_language="es")
            rows.append(
                [statement, *(_verdict(value, claim) for value in (claim.printed, claim.corrected))]
            )
        elif study is not None:
            statement = TableCell(
                claim.statement, note=f"Fig. {claim.figure}: «{claim.quote}»", note_language="es"
            )
            rows.append(
                [
                    statement,
                    *(_claim_cell(study.verdicts[claim.id][method]) for method in study.methods),
                ]
            )
    elements: list[Grid | Fold | Element] = []
    if rows:
        elements.append(
            PageTable("What the paper says", ("Statement", "As printed", "Corrected"), rows)
        )
    notes: list[Element] = []
    if study is not None and any(not claim.is_number for claim in claims):
        notes.append(Note(study_note(study)))
    condition = report.conditions.get(scene.name.rpartition("/")[2]) if scene.is_shipped else None
    if condition:
        notes.append(Note(condition))
    if notes:
        elements.append(Fold("How this was decided", "runs from moved starts; conditions", notes))
    return Section("paper", "What the paper says of this scene", elements)


def claims_page(report: Report) -> PageContent:
    """Return the content of the page of published numbers and claims.

    Parameters
    ----------
    report : the open results file.
    """
    study, claims = report.study, report.claims
    answer = []
    numbers = [claim for claim in claims if claim.is_number]
    if numbers:
        answer.append(numbers_sentence(numbers))
    sections = []
    if study is not None:
        holds = [study.count(method, HOLDS) for method in study.methods]
        text = Markup(
            "Of {} claims in words {} hold for the printed equations and {} for the corrected ones."
        )
        answer.append(text.format(len(study.verdicts), *(in_words(count) for count in holds)))
        words = [claim for claim in claims if not claim.is_number]
        counts: list[Element] = [count_table(study), Note(study_note(study))]
        sections.append(
            Section("numbers", "Numbers and counts", [Grid(2, [[number_table(claims)], counts])])
        )
        sections.append(Section("claims", "Claims", [claim_table(words, study)]))
    elif numbers:
        sections.append(Section("numbers", "Numbers", [number_table(claims)]))
    notes = [Note(text) for text in report.conditions.values()]
    how = "What had to be found out to reproduce the numbers, since the paper does not print it."
    sections.append(Section("conditions", "Conditions", notes, how))
    return PageContent("Published numbers and claims", PAPER, answer, [], sections)


def equations_of(erratum: Erratum) -> str:
    """Return the equations in which an erratum is printed, as text: "equations (8), (17)"."""
    plural = "s" if len(erratum.stands_in) > 1 else ""
    return f"equation{plural} {', '.join(erratum.stands_in)}"


_PLACE = re.compile(r"row (\d) column (\d)")
# An entry of a matrix as printed, and the correct entry; None if the printed entry is correct.
Cell = tuple[Markup, Markup | None]


def errata_page(report: Report) -> PageContent:
    """Return the content of the page of errata.

    Parameters
    ----------
    report : the open results file. The effects of the errata are taken from its runs.
    """
    entries = checked_entries()
    largest_agreeing = max((entry.difference for entry in entries if entry.agrees), default=0.0)
    differing = [entry for entry in entries if not entry.agrees]
    explained = sum(bool(entry.explained_by) for entry in differing)
    count = len(report.errata)
    answer = [
        Markup("The printed equations contain <b>{} errors</b>.").format(in_words(count)),
        Markup(
            "With them {} of {} printed entries differ from what follows from the paper's own "
            "transformation (3)."
        ).format(len(differing), len(entries)),
        Markup(
            "The {} errors explain <b>{} of these {}</b>; the other entries agree to {}."
        ).format(
            in_words(count),
            "all" if explained == len(differing) else explained,
            len(differing),
            up_to(largest_agreeing),
        ),
    ]
    facts = []
    for erratum in report.errata:
        effect = _effect(report, erratum.id)
        facts.append(Fact(f"{erratum.id}: {equations_of(erratum)}", *effect))
    sections = []
    say = "In matrices wrong entries are struck out and followed by the correct ones."
    for erratum in report.errata:
        items = [
            ("Where", formula(f"{erratum.entry} (pages {erratum.pages})", in_prose=True)),
            ("Printed", formula(erratum.printed, in_prose=True)),
            ("Correct", formula(erratum.right, in_prose=True)),
            ("Reason", formula(erratum.reason, in_prose=True)),
        ]
        if erratum.evidence:
            listed = Markup("").join(
                Markup("<li>{}</li>").format(formula(text, in_prose=True))
                for text in erratum.evidence
            )
            items.append(("Evidence", Markup("<ul>{}</ul>").format(listed)))
        if erratum.reaches:
            items.append(("Equations affected", Markup("{}").format(", ".join(erratum.reaches))))
        elements: list[Element] = [Listing(items)]
        for equation, rows in matrices(entries, erratum.stands_in):
            elements.append(Matrix(f"{equation} as printed", rows))
        heading = f"{erratum.id}: {equations_of(erratum)}"
        has_matrices = len(elements) > 1
        sections.append(
            Section(erratum.id, heading, [Grid(1, [elements])], say if has_matrices else "")
        )
        if has_matrices:
            say = ""  # only the first section with matrices has the text
    head = ("Equation", "Entry", "Printed", "Correct", "Difference", "Explained by")
    rows_of_entries: list[Row] = []
    for entry in differing:
        printed, right = (
            TableCell("", picture=formula(text)) for text in (entry.printed, entry.right)
        )
        difference = number_cell(entry.difference)
        rows_of_entries.append(
            [
                entry.equation,
                entry.entry,
                printed,
                right,
                difference,
                entry.explained_by or "nothing",
            ]
        )
    hint = f"{len(differing)} that differ"
    say = (
        "Difference: the largest over random states, relative to the larger of 1, the printed and "
        "the correct value."
    )
    table = PageTable("Printed entries that differ", head, rows_of_entries, wide=(4,))
    sections.append(Section("entries", "Checked entries", [Fold("Entries", hint, [table])], say))
    sections.append(Section("method", "How they were found", [Note(_METHOD), Note(_ALONE)]))
    return PageContent("Errors in the printed equations", PAPER, answer, facts, sections)


_METHOD = Markup(
    "By the paper's own definition the printed matrices U, (8), (9) and (16) to (19), are the "
    "first and second derivatives of its transformation (3) with respect to the angles; mass, rate "
    "and gravity terms follow from the same transformation by Lagrange's equations. Each printed "
    "entry was compared, at random states, with the entry derived from (3). Notation: "
    "s<sub>i</sub> = sin q<sub>i</sub>, c<sub>i</sub> = cos q<sub>i</sub>; c and d without index: "
    "distances of the centre of mass from the pitch axis and, along that axis, from the shaft; "
    "d<sub>2</sub>: constant offset along the shaft."
)
_ALONE = (
    "Each erratum alone in the corrected equations is integrated with ode45 at the paper's "
    "tolerances; these numbers include the error of ode45, amplified by the error growth."
)


def _effect(report: Report, erratum: str) -> tuple[str, str]:
    """Return two texts: the largest angle error due to one erratum alone, and its scene.

    The first text is a dash if the file has no run with this erratum alone.

    Parameters
    ----------
    report : the open results file.
    erratum : identifier of the erratum, such as "E1".
    """
    largest = largest_of(report, errata_methods().get(erratum, ""), "angle_error_max")
    if largest is None:
        return NOTHING, "no run with it alone"
    value, scene = largest
    return f"{number(value)} rad", f"largest angle error alone, {scene.rpartition('/')[2]}"


def largest_of(report: Report, method: str, name: str) -> tuple[float, str] | None:
    """Return the largest finite value of a metric in a method's runs, and the name of its scene.

    None is returned if no run of the method has a finite value.

    Parameters
    ----------
    report : the open results file.
    method : name of the method.
    name : name of the metric.
    """
    found = []
    for scene in report.scenes.values():
        run = scene.runs.get(method)
        value = None if run is None else metric(run, name)
        if value is not None and math.isfinite(value):
            found.append((value, scene.name))
    return max(found) if found else None


def matrices(
    entries: Sequence[CheckedEntry], equations: Sequence[str]
) -> list[tuple[str, list[list[Cell]]]]:
    """Return the matrices among given equations: (name of the equation, rows of the matrix) each.

    Parameters
    ----------
    entries : checked entries of all equations, each with its place.
    equations : names of the equations, as in `Erratum.stands_in`.
    """
    shown = []
    for equation in equations:
        places = {}
        for entry in entries:
            place = _PLACE.fullmatch(entry.entry)
            if entry.equation == equation and place is not None:
                places[int(place[1]), int(place[2])] = entry
        if places:
            rows, columns = (range(1, 1 + max(place[axis] for place in places)) for axis in (0, 1))
            matrix = []
            for row in rows:
                cells: list[Cell] = []
                for column in columns:
                    checked = places.get((row, column))
                    printed = Markup() if checked is None else formula(checked.printed)
                    cells.append(
                        (
                            printed,
                            None if checked is None or checked.agrees else formula(checked.right),
                        )
                    )
                matrix.append(cells)
            shown.append((equation, matrix))
    return shown
