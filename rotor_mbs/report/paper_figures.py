"""List the paper's figures, and choose the runs of each from a file; nothing is drawn here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from rotor_mbs.methods.catalogue import REFERENCE, find_method_or_none
from rotor_mbs.runs.read import StoredRun, StoredScene

MOTION, PATHS, TORQUES = "motion", "paths", "torques"
# Headings of the models' columns, by key, from left to right. An independent model has no column:
# it is drawn by its difference alone.
HEADINGS = {"printed": "As printed", "corrected": "Corrected model"}
PRINTED_SIDE, CORRECTED, INDEPENDENT = "printed", "corrected", "independent"


class PaperFigure(NamedTuple):
    """A figure of the paper, or of one scene that is in none of them.

    number : of the paper's figure, "11"; "" where it is not the paper's.
    kind : MOTION, PATHS or TORQUES.
    panels : (letter, scene) each; the letter is "" where there is none, and a torque for TORQUES.
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
    """Return the paper's figures of which `scenes` has a panel, with these panels alone.

    A scene that differs from the shipped one has no panel.
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
    """Return the paper's figures by number, then one by name for each scene in none of them."""
    figures = {figure.number: figure for figure in available(scenes)}
    shown = {name for figure in figures.values() for _, name in figure.panels}
    for name in scenes:
        if name not in shown:
            figures[name] = PaperFigure("", MOTION, (("", name),))
    return figures


def compared_runs(scene: StoredScene) -> dict[str, StoredRun]:
    """Return the scene's runs with angles and rates by "printed", "corrected", and "independent".

    The independent run is the first corrected one with samples that is neither of the Lagrange
    model nor the reference.

    Parameters
    ----------
    scene : whose runs are chosen.
    """
    candidates = scene.sides
    for name, run in scene.corrected_runs.items():
        method = find_method_or_none(name)
        # The reference is of the Lagrange model: another run of that model is not independent.
        is_other = not name.startswith("lagrange/") and (method is None or method.name != REFERENCE)
        if is_other and run.samples and run not in candidates.values():
            candidates[INDEPENDENT] = run
            break
    return {key: run for key, run in candidates.items() if "angles" in run and "rates" in run}


def panel_runs(
    figure: PaperFigure, scenes: Mapping[str, StoredScene]
) -> dict[str, dict[str, dict[str, StoredRun]]]:
    """Return the runs of a figure: by letter of the row, then by model, then by label.

    A figure of torques has one row, in which the labels are the torques. Where `scenes` lack paths,
    a figure of paths has no run.
    """
    rows: dict[str, dict[str, dict[str, StoredRun]]] = {}
    for label, name in figure.panels:
        letter = "" if figure.kind == TORQUES else label
        for key, run in compared_runs(scenes[name]).items():
            if figure.kind != PATHS or "tip" in run:
                rows.setdefault(letter, {}).setdefault(key, {})[label] = run
    return rows
