"""List the paper's figures, and choose the runs for each of them from a file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from rotor_mbs.methods.catalogue import REFERENCE, find_method_or_none
from rotor_mbs.runs.read import StoredRun, StoredScene

MOTION, PATHS, TORQUES = "motion", "paths", "torques"
# Headings of the columns by model, from left to right. The independent model has no column, because
# only its difference from the corrected model is drawn.
HEADINGS = {"printed": "As printed", "corrected": "Corrected model"}
PRINTED_SIDE, CORRECTED, INDEPENDENT = "printed", "corrected", "independent"


class PaperFigure(NamedTuple):
    """A figure of the paper, or the figure of a scene that the paper's figures do not show.

    number : number of the paper's figure, such as "11"; "" if the figure is not the paper's.
    kind : MOTION, PATHS or TORQUES.
    panels : (label, name of the scene) of each panel. The label is "" for MOTION, a letter for
        PATHS, and the torque for TORQUES.
    """

    number: str
    kind: str
    panels: tuple[tuple[str, str], ...]


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
    PaperFigure(
        "15", TORQUES, tuple((f"{n} kN m", f"paper/fig15-{n}kNm") for n in (1, 10, 50, 100))
    ),
    PaperFigure("16", PATHS, (("a", "paper/fig15-1kNm"), ("b", "paper/fig15-100kNm"))),
)


def available(scenes: Mapping[str, StoredScene]) -> tuple[PaperFigure, ...]:
    """Return the paper's figures for which there are scenes, with the panels of these scenes only.

    A scene whose motion differs from that of the shipped scene does not count.

    Parameters
    ----------
    scenes : stored scenes by name.
    """
    figures = []
    for figure in FIGURES:
        panels = tuple(
            panel for panel in figure.panels if panel[1] in scenes and scenes[panel[1]].is_shipped
        )
        if panels:
            figures.append(figure._replace(panels=panels))
    return tuple(figures)


def all_figures(scenes: Mapping[str, StoredScene]) -> dict[str, PaperFigure]:
    """Return all figures for given scenes: the paper's by number, then others by name of the scene.

    Each scene that none of the paper's figures shows has a figure of its own.
    """
    figures = {figure.number: figure for figure in available(scenes)}
    shown = {name for figure in figures.values() for _, name in figure.panels}
    for name in scenes:
        if name not in shown:
            figures[name] = PaperFigure("", MOTION, (("", name),))
    return figures


def compared_runs(scene: StoredScene) -> dict[str, StoredRun]:
    """Return the runs of a scene that are compared, by "printed", "corrected" and "independent".

    The independent run is the first run of another corrected model than the Lagrange model. Runs
    without angles and rates are left out.

    Parameters
    ----------
    scene : the stored scene.
    """
    candidates = scene.sides
    for name, run in scene.corrected_runs.items():
        method = find_method_or_none(name)
        # The reference is computed by the Lagrange model, so that other runs of this model are not
        # independent of it.
        is_other = not name.startswith("lagrange/") and (method is None or method.name != REFERENCE)
        if is_other and run.samples and run not in candidates.values():
            candidates[INDEPENDENT] = run
            break
    return {key: run for key, run in candidates.items() if "angles" in run and "rates" in run}


def panel_runs(
    figure: PaperFigure, scenes: Mapping[str, StoredScene]
) -> dict[str, dict[str, dict[str, StoredRun]]]:
    """Return the runs of a figure by row, then by model, then by label.

    The key of a row is the letter of its panel. A figure of torques has a single row, whose labels
    are the torques. A figure of paths has no runs without stored tip positions.

    Parameters
    ----------
    figure : the figure.
    scenes : stored scenes by name.
    """
    rows: dict[str, dict[str, dict[str, StoredRun]]] = {}
    for label, name in figure.panels:
        letter = "" if figure.kind == TORQUES else label
        for key, run in compared_runs(scenes[name]).items():
            if figure.kind != PATHS or "tip" in run:
                rows.setdefault(letter, {}).setdefault(key, {})[label] = run
    return rows
