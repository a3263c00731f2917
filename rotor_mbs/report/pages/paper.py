"""The paper: its numbers and claims as tables, its errata, its figures on a page and for a manuscript."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from markupsafe import Markup

from rotor_mbs.analysis.published import (
    FAILS,
    HOLDS,
    UNDECIDED,
    CheckedEntry,
    ClaimStudy,
    Published,
    checked_entries,
    rounds_to,
)
from rotor_mbs.errors import InputError
from rotor_mbs.methods.catalogue import look_up
from rotor_mbs.report import canvas, plots
from rotor_mbs.report.elements import PageTable, Row, Section, TableCell, picture
from rotor_mbs.report.looks import COLOURS, Look, label_of
from rotor_mbs.report.numbers import NOTHING, fixed, formula, number
from rotor_mbs.report.pages import Report
from rotor_mbs.runs.design import COLUMNS
from rotor_mbs.runs.output_files import replace_file
from rotor_mbs.runs.read import StoredRun, StoredScene, open_results

ROUNDING = "amplified rounding error, which depends on how the equations are written"
_TONES = {HOLDS: "good", FAILS: "bad", UNDECIDED: ""}


def number_table(claims: Iterable[Published]) -> PageTable:
    """The published numbers, a row each."""
    head = ("Figure", "Quantity", "Published", "As printed", "Reproduced?", "Corrected model", "Same number?")
    rows: list[Row] = []
    for claim in claims:
        if not claim.is_number:
            continue
        verdict = _verdict(claim.printed, claim)
        if claim.rounding and verdict.tone == "good":
            verdict = replace(verdict, note=ROUNDING)
        column = COLUMNS[claim.metric]
        description = f"{column.long_name.partition(',')[0]} ({column.units})"
        rows.append([
            claim.figure,
            TableCell(description, note=f"«{claim.quote}»", note_language="es"),
            fixed(claim.value, claim.decimals),
            fixed(claim.printed, claim.decimals + 2),
            verdict,
            fixed(claim.corrected, claim.decimals + 2),
            _verdict(claim.corrected, claim),
        ])  # fmt: skip
    return PageTable("Published numbers", head, rows)


def claim_table(claims: Iterable[Published], study: ClaimStudy) -> PageTable:
    """The claims in words, a row each, with their verdicts."""
    rows: list[Row] = []
    for claim in claims:
        if claim.is_number:
            continue
        statement = TableCell(claim.statement, note=f"«{claim.quote}»", note_language="es")
        row: list[TableCell | str] = [claim.figure, statement]
        for method in study.methods:
            verdict = study.verdicts[claim.id][method]
            row.append(TableCell(verdict, tone=_TONES[verdict]))
        rows.append(row)
    return PageTable("Published claims", ("Figure", "Claim", "As printed", "Corrected model"), rows)


def _verdict(value: float | None, item: Published) -> TableCell:
    """Whether a value has the printed digits."""
    if value is None:
        return TableCell(NOTHING)
    holds = rounds_to(value, item)
    return TableCell("yes" if holds else "no", tone="good" if holds else "bad")


_PLACE = re.compile(r"row (\d) column (\d)")
Cell = tuple[Markup, Markup | None]  # an entry as printed; the correct one where it is faulty


def errata_page(report: Report) -> dict[str, object]:
    """The content of the page of errata."""
    entries = checked_entries()
    largest_agreeing = max((entry.difference for entry in entries if entry.agrees), default=0.0)
    differing = [entry for entry in entries if not entry.agrees]
    differing_table = PageTable(
        f"{len(differing)} of {len(entries)} printed entries differ from what follows from (3); the errata explain "
        f"{sum(bool(entry.explained_by) for entry in differing)}; the others agree to {number(largest_agreeing)}",
        ("Equation", "Entry", "Printed", "Correct", "Difference / max(1, |printed|, |correct|)", "Explained by"),
        [
            (
                e.equation,
                e.entry,
                formula(e.printed),
                formula(e.right),
                number(e.difference),
                e.explained_by or "nothing",
            )
            for e in differing
        ],
    )
    return {
        "errata": [(erratum, matrices(entries, erratum.stands_in)) for erratum in report.errata],
        "differing": Section(tables=[differing_table]),
    }


def matrices(entries: Sequence[CheckedEntry], equations: Sequence[str]) -> list[tuple[str, list[list[Cell]]]]:
    """(equation, rows of its matrix) of those of `equations` that are matrices."""
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
                    cells.append((printed, None if checked is None or checked.agrees else formula(checked.right)))
                matrix.append(cells)
            shown.append((equation, matrix))
    return shown


MOTION, PATHS, TORQUES = "motion", "paths", "torques"
# The models that are compared, by key, in order from left to right.
HEADINGS = {"printed": "As printed", "corrected": "Corrected model", "exudyn": "Exudyn"}


class PaperFigure(NamedTuple):
    """A figure of the paper."""

    number: str
    kind: str
    panels: tuple[tuple[str, str], ...]  # the letter ("" where it has none; a torque) and the scene of each


FIGURES = (
    PaperFigure("3", MOTION, (("", "paper/fig03"),)),
    PaperFigure("4", PATHS, (("a", "paper/fig03"), ("b", "paper/fig04b"))),
    PaperFigure("5", MOTION, (("", "paper/fig05"),)),
    PaperFigure("6", MOTION, (("", "paper/fig06"),)),
    PaperFigure("7", PATHS, (("a", "paper/fig05"), ("b", "paper/fig06"))),
    PaperFigure("8", MOTION, (("", "paper/fig08"),)),
    PaperFigure("9", MOTION, (("", "paper/fig09"),)),
    PaperFigure("10", PATHS, (("a", "paper/fig08"), ("b", "paper/fig09"))),
    PaperFigure("11", MOTION, (("", "paper/fig11"),)),
    PaperFigure("12", MOTION, (("", "paper/fig12"),)),
    PaperFigure("13", PATHS, (("a", "paper/fig11"), ("b", "paper/fig13b"))),
    PaperFigure("14", PATHS, (("a", "paper/fig14a"), ("b", "paper/fig14b"), ("c", "paper/fig14c"))),
    PaperFigure("15", TORQUES, tuple((f"{n} kN m", f"paper/fig15-{n}kNm") for n in (1, 10, 50, 100))),
    PaperFigure("16", PATHS, (("a", "paper/fig15-1kNm"), ("b", "paper/fig15-100kNm"))),
)


def available(scenes: Mapping[str, StoredScene]) -> tuple[PaperFigure, ...]:
    """The figures of which `scenes` has a panel, with the panels that it has; none of a scene that was changed."""
    figures = []
    for figure in FIGURES:
        panels = tuple(panel for panel in figure.panels if panel[1] in scenes and scenes[panel[1]].is_shipped)
        if panels:
            figures.append(figure._replace(panels=panels))
    return tuple(figures)


def compared_runs(scene: StoredScene) -> dict[str, StoredRun]:
    """The scene's runs by the keys of HEADINGS, those that have samples of angles and rates."""
    candidates = scene.sides
    for name, run in scene.corrected_runs.items():
        method = look_up(name)
        if method and "exudyn" in method.distributions and run.samples:
            if run not in candidates.values():
                candidates["exudyn"] = run
            break
    return {key: run for key, run in candidates.items() if "angles" in run and "rates" in run}


def panel_runs(figure: PaperFigure, scenes: Mapping[str, StoredScene]) -> dict[str, dict[str, dict[str, StoredRun]]]:
    """The runs of each picture by label, row by row: by letter, then by key of HEADINGS."""
    rows: dict[str, dict[str, dict[str, StoredRun]]] = {}
    for label, name in figure.panels:
        letter = "" if figure.kind == TORQUES else label
        for key, run in compared_runs(scenes[name]).items():
            if figure.kind != PATHS or "tip" in run:
                rows.setdefault(letter, {}).setdefault(key, {})[label] = run
    return rows


def draw(figure: PaperFigure, axes: Sequence[Any], runs: Mapping[str, StoredRun]) -> None:
    """A picture on `axes`: one for paths, else two, position above velocity."""
    if figure.kind == PATHS:
        plots.draw_paths(axes[0], next(iter(runs.values())).array("tip"))
        return
    labels = (plots.ANGLE_AXIS, plots.RATE_AXIS)
    for panel, name, label in zip(axes, ("angles", "rates"), labels, strict=True):
        series = []
        for place, (torque, run) in enumerate(runs.items()):
            of_run = plots.coordinate_series(run.array("time"), run.array(name))
            if figure.kind == TORQUES:
                look = Look(COLOURS[place], ("-", "--", "-.", ":")[place], "", torque)
                of_run = [of_run[0]._replace(look=look)]
            series += of_run
        plots.draw_lines(panel, series, label)
    axes[0].set_title("(a) position", loc="left")
    axes[0].tick_params(labelbottom=False)
    axes[1].set_title("(b) angular velocity", loc="left")
    axes[1].set_xlabel(canvas.TIME_AXIS)


def write_figures(results: Path, folder: Path, kind: str, numbers: Iterable[str] = ()) -> list[Path]:
    """Write figures of the paper for a manuscript, and return their files.

    Parameters
    ----------
    results, folder : the results file; where figNN.pdf and so on are written.
    kind : "pdf", "svg" or "png".
    numbers : of the figures, such as "11"; all that the file has where none is given.

    Raises
    ------
    InputError
        For a figure that the file does not have.
    StoreError
        Where the file cannot be read or the folder cannot be written.
    """
    with open_results(results) as opened:
        have = {figure.number: figure for figure in available(opened.scenes) if panel_runs(figure, opened.scenes)}
        asked = list(dict.fromkeys(numbers)) or list(have)
        unknown = [number for number in asked if number not in have]
        if not have:
            raise InputError(f"{results}: no figure of the paper in the file; allowed: a file of rotor-mbs reproduce")
        if unknown:
            raise InputError(f"{results}: figure {', '.join(unknown)}: not in the file; allowed: {', '.join(have)}")
        made = {f"fig{int(n):02d}.{kind}": canvas.encoded(composed(have[n], opened.scenes).figure, kind) for n in asked}
    for name, content in made.items():
        replace_file(folder / name, content, canvas.MARK)
    return [folder / name for name in made]


def composed(figure: PaperFigure, scenes: Mapping[str, StoredScene], *, for_print: bool = True) -> canvas.Panels:
    """The whole figure, a column per model: position above velocity, or a row per panel where paths are shown.

    for_print: for a manuscript, with its legend; else for a page, which has the legend beside the picture.
    """
    pictures = panel_runs(figure, scenes)
    keys = [key for key in HEADINGS if any(key in row for row in pictures.values())]
    is_paths = figure.kind == PATHS
    with canvas.style(for_print=for_print):
        rows, height, heading = (len(pictures), 1.8, 1.02) if is_paths else (2, 1.55, 1.16)
        panels = canvas.grid(rows, len(keys), height if for_print else 1.4 * height, for_print=for_print)
        table = [panels.axes[i : i + len(keys)] for i in range(0, len(panels.axes), len(keys))]
        for i, row_of_runs in enumerate(pictures.values()):
            for key, runs in row_of_runs.items():
                column = [row[keys.index(key)] for row in table]
                draw(figure, [column[i]] if is_paths else column, runs)
        for axes, key in zip(table[0], keys, strict=True):
            axes.text(0.5, heading, HEADINGS[key], transform=axes.transAxes, ha="center", weight="bold")
        for axes in panels.axes:
            if not axes.has_data():
                axes.set_axis_off()
            if axes not in [row[0] for row in table]:  # the labels of the first column are for all
                axes.set_ylabel("")
        for row, letter in zip(table, pictures if is_paths else (), strict=False):
            row[0].text(-0.08, 0.94, f"({letter})", transform=row[0].transAxes)
        if for_print:
            labelled = panels.labelled()
            columns = min(len(labelled), 5)
            panels.figure.legend(labelled.values(), labelled, loc="lower center", ncols=columns, handlelength=2.6)
    return panels


def figures_page(report: Report) -> dict[str, object]:
    """The content of the page that goes through the figures."""
    figures = []
    for figure in available(report.scenes):
        labels: dict[str, str] = {}  # by key of HEADINGS
        for row_of_runs in panel_runs(figure, report.scenes).values():
            for key, runs in row_of_runs.items():
                labels.setdefault(key, label_of(next(iter(runs.values())).method))
        if not labels:  # neither angles nor rates
            continue
        caption = f"Columns: {'; '.join(labels[key] for key in HEADINGS if key in labels)}"
        panels = []
        for letter, name in figure.panels:
            stored = report.scenes[name]
            initial = tomllib.loads(stored.scene.text)["initial"]  # pi/6 as it is written
            panels.append((letter, name, stored.title, initial, report.files[name]))
        figures.append({
            "number": figure.number,
            "kind": figure.kind,
            "panels": panels,
            "picture": picture(composed(figure, report.scenes, for_print=False), f"f{figure.number}", caption),
            "numbers": number_table([claim for claim in report.claims if claim.figure == figure.number]),
        })  # fmt: skip
    return {"figures": figures}
