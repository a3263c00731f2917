"""The paper's figures, each model side by side, for a manuscript and on the page that goes through them."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rotor_mbs.analysis import run_selection
from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.errors import InputError
from rotor_mbs.methods.catalogue import look_up
from rotor_mbs.report import plots
from rotor_mbs.report.core import canvas, svg
from rotor_mbs.report.core.looks import COLOURS, Look, label_of, with_capital
from rotor_mbs.report.pages import Report
from rotor_mbs.report.pages.claim_tables import number_table
from rotor_mbs.runs.files import replace_file
from rotor_mbs.runs.read import StoredRun, StoredScene, open_results

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
    """The figures of which `scenes` has a panel, with the panels that it has."""
    figures = []
    for figure in FIGURES:
        panels = tuple(panel for panel in figure.panels if panel[1] in scenes)
        if panels:
            figures.append(figure._replace(panels=panels))
    return tuple(figures)


def compared_runs(scene: StoredScene) -> dict[str, StoredRun]:
    """The scene's runs by the keys of HEADINGS, those that have samples of angles and rates."""
    candidates = run_selection.sides(scene)
    for name, run in run_selection.corrected_runs(scene).items():
        method = look_up(name)
        if method and "exudyn" in method.distributions and run_selection.has_samples(run):
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
        if figure.kind == MOTION:
            run = next(iter(runs.values()))
            plots.draw_coordinates(panel, run.array("time"), run.array(name), label)
        else:
            series = []
            for place, (torque, run) in enumerate(runs.items()):
                look = Look(COLOURS[place], ("-", "--", "-.", ":")[place], "", torque)
                series.append(plots.Series(run.array("time"), run.array(name)[:, 0], look))
            plots.draw_lines(panel, series, label)
            plots.set_range(panel, np.concatenate([curve.values for curve in series])[:, None])
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
        have = {figure.number: figure for figure in available(opened.scenes)}
        asked = list(dict.fromkeys(numbers)) or list(have)
        unknown = [number for number in asked if number not in have]
        if unknown or not have:
            allowed = ", ".join(have) or "none: it has no scene of the paper"
            raise InputError(f"{results}: figure {', '.join(unknown) or 'of the paper'}: not in it; allowed: {allowed}")
        made = {f"fig{int(n):02d}.{kind}": canvas.encoded(composed(have[n], opened.scenes).figure, kind) for n in asked}
    for name, content in made.items():
        replace_file(folder / name, content, canvas.MARK)
    return [folder / name for name in made]


def composed(figure: PaperFigure, scenes: Mapping[str, StoredScene]) -> canvas.Panels:
    """The whole figure, a column per model: position above velocity, or a row per panel where paths are shown."""
    pictures = panel_runs(figure, scenes)
    keys = [key for key in HEADINGS if any(key in row for row in pictures.values())]
    is_paths = figure.kind == PATHS
    with canvas.style(for_print=True):
        rows, height, heading = (len(pictures), 1.8, 1.02) if is_paths else (2, 1.55, 1.16)
        panels = canvas.print_grid(rows, len(keys), height)
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
        labelled = panels.labelled()
        columns = min(len(labelled), 5)
        panels.figure.legend(labelled.values(), labelled, loc="lower center", ncols=columns, handlelength=2.6)
    return panels


def figures_page(report: Report) -> dict[str, object]:
    """The content of the page that goes through the figures."""
    figures = []
    for figure in available(report.scenes):
        runs_of_panels = panel_runs(figure, report.scenes)
        panels = []
        # Torques are all in one picture per model.
        for letter, scene in [("", figure.panels[0][1])] if figure.kind == TORQUES else figure.panels:
            pictures = []
            for key, runs in runs_of_panels.get(letter, {}).items():
                drawn = canvas.panels((4.1,) if figure.kind == PATHS else (1.7, 1.7), "")
                if figure.kind != PATHS:
                    drawn.figure.subplots_adjust(top=0.93, hspace=0.2)  # room for headings
                draw(figure, drawn.axes, runs)
                heading, label = HEADINGS[key], label_of(next(iter(runs.values())).method)
                is_named = label.lower().startswith(heading.lower())
                caption = with_capital(label) if is_named else f"{heading}: {label}"
                pictures.append(svg.picture(drawn, f"f{figure.number}{letter}-{key}", caption))
            parsed = scene_of(report.scenes[scene])
            panels.append({
                "letter": letter,
                "scene": scene,
                "title": report.scenes[scene].title,
                "initial": {} if parsed is None else tomllib.loads(parsed.text)["initial"],  # pi/6 as it is written
                "href": report.files[scene],
                "pictures": pictures,
            })  # fmt: skip
        claims = [claim for claim in report.claims if claim.published.figure == figure.number]
        figures.append({
            "number": figure.number, "kind": figure.kind, "panels": panels, "numbers": number_table(claims),
        })  # fmt: skip
    return {"figures": figures}
