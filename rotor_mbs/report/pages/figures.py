"""Build the page of the paper's figures, recomputed by the printed and by the corrected model."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from markupsafe import Markup, escape

from rotor_mbs.report.elements import (
    Curve,
    Element,
    Fold,
    Grid,
    Legend,
    Note,
    PageContent,
    Plot,
    Section,
)
from rotor_mbs.report.looks import Look, coordinate_look, label_of, step_look
from rotor_mbs.report.numbers import in_words, minus, typeset_title
from rotor_mbs.report.pages import Report, paper
from rotor_mbs.report.pages.scene_plots import parting, range_of, whole_time
from rotor_mbs.report.paper_figures import (
    CORRECTED,
    HEADINGS,
    MOTION,
    PATHS,
    PRINTED_SIDE,
    TORQUES,
    PaperFigure,
    available,
    panel_runs,
)
from rotor_mbs.report.stills import path_picture
from rotor_mbs.runs.read import StoredRun

_KINDS = {
    MOTION: "position and velocity",
    PATHS: "paths of the tips",
    TORQUES: "a constant torque on the rotor",
}
_NOTES = {
    "6": "The caption prints π/10 rad/s, the running text 1/10; the caption's value is plotted.",
    "13": "According to the text, panel (b) is the run of Fig. 12 (blade 1 at π/5 rad/s), "
    "the caption "
    "prints π/8; the caption's value is plotted.",
    "14": "As read from the PDF, the caption gives three initial states for four panels: which one "
    "belongs to which panel is uncertain, and that of panel (d) is not known. Nothing is "
    "drawn for it.",
    "15": "1 and 100 kN m are printed in the caption of Fig. 16; the paper's other torques are not "
    "known, 10 and 50 kN m were chosen.",
}
SIDES = (PRINTED_SIDE, CORRECTED)


def figures_page(report: Report) -> PageContent:
    """Return the content of the page of the paper's figures.

    Parameters
    ----------
    report : the open results file, with scenes of the paper.
    """
    sections = []
    for figure in available(report.scenes):
        pictures = panel_runs(figure, report.scenes)
        if pictures:
            sections.append(_figure_section(figure, pictures, report))
    methods = {section.say for section in sections}
    if len(methods) == 1:  # the text on the methods is the same, and stands once in the answer
        sections = [replace(section, say="") for section in sections]
    departing = []
    for figure in available(report.scenes):
        for _, name in figure.panels:
            sides = report.scenes[name].sides
            if len(sides) == 2 and all("angles" in run for run in sides.values()):
                left, _ = parting(sides[PRINTED_SIDE], sides[CORRECTED])
                departing.append((name, left is not None))
    known = dict(departing)
    answer = []
    if known:
        count = sum(known.values())
        text = Markup(
            "In <b>{} of {} scenes</b> of these figures the printed equations depart visibly from "
            "the corrected ones."
        )
        answer.append(text.format(count, len(known)))
    answer.append(
        Markup("Each of the {} figures stands in the paper's own layout.").format(
            in_words(len(sections))
        )
    )
    if len(methods) == 1:
        answer.append(escape(methods.pop()))
    sections.append(
        Section(
            "files",
            "For a manuscript",
            [Note("As PDF, SVG or PNG, with captions: rotor-mbs figures.")],
        )
    )
    return PageContent("The paper's figures", paper.PAPER, answer, [], sections)


def _figure_section(
    figure: PaperFigure,
    pictures: Mapping[str, Mapping[str, Mapping[str, StoredRun]]],
    report: Report,
) -> Section:
    """Return the section of one figure: its plots, published numbers, and initial states.

    Parameters
    ----------
    figure : a figure of the paper.
    pictures : runs of the figure by row, then by model, then by label; see `panel_runs`.
    report : the open results file, with the claims and the files of the scenes' pages.
    """
    elements: list[Grid | Fold | Element] = []
    numbers = paper.number_table(
        [claim for claim in report.claims if claim.figure == figure.number], with_figure=False
    )
    if figure.kind == PATHS:
        elements.append(_path_plots(pictures))
    else:
        for row in pictures.values():
            elements += _motion_plots(figure, row)
    if numbers.rows:
        elements.append(numbers)
    for letter, name in figure.panels:
        stored = report.scenes[name]
        # The text of the scene has expressions such as "pi/6", which are shown as they are written.
        initial = tomllib.loads(stored.scene.text)["initial"]
        angles, rates = (
            ", ".join(_as_written(value) for value in initial[key]) for key in ("angles", "rates")
        )
        before = f"({letter}) " if letter else ""
        text = Markup('{}{}; initial state {} rad and {} rad/s: <a href="{}">{}</a>')
        elements.append(
            Note(
                text.format(
                    before, typeset_title(stored.title), angles, rates, report.files[name], name
                )
            )
        )
    if figure.number in _NOTES:
        elements.append(Note(_NOTES[figure.number]))
    methods = {
        key: label_of(next(iter(runs.values())).method)
        for row in pictures.values()
        for key, runs in row.items()
    }
    # The label of a printed method repeats the heading: "as printed, ode45". The repeated words are
    # removed.
    lines = [
        f"{HEADINGS[key]}: {methods[key].removeprefix(f'{HEADINGS[key].lower()}, ')}"
        for key in SIDES
        if key in methods
    ]
    say = "; ".join(lines)
    return Section(
        f"figure-{figure.number}",
        f"Figure {figure.number}: {_KINDS[figure.kind]}",
        elements,
        f"{say}.",
    )


def _as_written(value: float | str) -> str:
    """Return an initial value of a scene file typeset as text: "11π/12" for "11*pi/12"."""
    return minus(str(value).replace("*pi", "π").replace("pi", "π"))


def _motion_plots(
    figure: PaperFigure, row: Mapping[str, Mapping[str, StoredRun]]
) -> tuple[Legend, Grid]:
    """Return the legend and the plots of positions and velocities, with a column for each model.

    Parameters
    ----------
    figure : a figure of motion or torques. A figure of torques shows only the rotor.
    row : runs by model, then by label. At least one run has samples.
    """
    runs = [run for side in SIDES for run in row.get(side, {}).values()]
    axis = whole_time(runs)
    assert axis is not None
    looks: dict[str, Look] = {}
    cards: list[list[Element]] = []
    for name, what, unit in (("angles", "position", "rad"), ("rates", "angular velocity", "rad/s")):
        for side in SIDES:
            curves = []
            for place, (label, run) in enumerate(row.get(side, {}).items()):
                values, time = run.array(name), run.array("time")
                if figure.kind == TORQUES:
                    look = step_look(place, len(row[side]), label)
                    curves.append(Curve(label, look, time, values[:, 0]))
                else:
                    for k, coordinate in enumerate(run.labels):
                        curves.append(
                            Curve(coordinate, coordinate_look(k, coordinate), time, values[:, k])
                        )
            for curve in curves:
                looks.setdefault(curve.key, curve.look)
            if curves:
                clip = _usual_range(curves, row, name)
                title = f"{HEADINGS[side]}: {what}"
                cards.append(
                    [
                        Plot(
                            title,
                            unit,
                            axis,
                            curves,
                            190,
                            clip=clip,
                            least=1e-6,
                            still=name == "angles",
                        )
                    ]
                )
    return Legend(list(looks.items())), Grid(2, cards)


def _usual_range(
    curves: Sequence[Curve], row: Mapping[str, Mapping[str, StoredRun]], name: str
) -> tuple[float, float] | None:
    """Return the range to which a plot is cut off if one of its curves runs away.

    The range is a little larger than that of the corrected model. None is returned if no curve runs
    away, or if there is no corrected model.

    Parameters
    ----------
    curves : curves of the plot.
    row : runs of the figure by model, then by label.
    name : "angles" or "rates", the quantity of the curves.
    """
    right = [run.array(name).ravel() for run in row.get(CORRECTED, {}).values()]
    if not right:
        return None
    return range_of(np.concatenate(right), np.concatenate([curve.y for curve in curves]))


def _path_plots(pictures: Mapping[str, Mapping[str, Mapping[str, StoredRun]]]) -> Grid:
    """Return still pictures of the paths of the tips, one for each panel and model.

    Parameters
    ----------
    pictures : runs of the figure by row, then by model, then by label.
    """
    cards: list[list[Element]] = []
    for row in pictures.values():
        for side in SIDES:
            for label, run in row.get(side, {}).items():
                text = f"({label}) {HEADINGS[side]}" if label else HEADINGS[side]
                cards.append([path_picture(run.array("tip"), text)])
    return Grid(4, cards)
