"""The paper's figures: what each shows, of which scenes, and how it is drawn, on a page and for a manuscript."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.analysis import run_selection
from rotor_mbs.errors import InputError
from rotor_mbs.methods.catalogue import look_up
from rotor_mbs.report.core import canvas
from rotor_mbs.report.core.looks import COLOURS, Look, coordinate_look
from rotor_mbs.report.plots import paths
from rotor_mbs.report.plots import time_histories as histories
from rotor_mbs.store.hdf5 import replace_file
from rotor_mbs.store.read import StoredRun, StoredScene, open_results

MOTION, PATHS, TORQUES = "motion", "paths", "torques"
# The models that are compared, by key, in order from left to right.
HEADINGS = {"printed": "As printed", "corrected": "Corrected model", "exudyn": "Exudyn"}


@dataclass(frozen=True)
class PaperFigure:
    """number; kind; panels: the letter ("" where it has none; a torque) and the scene of each."""

    number: str
    kind: str
    panels: tuple[tuple[str, str], ...]

    @property
    def scenes(self) -> tuple[str, ...]:
        """The scenes of all panels."""
        return tuple(scene for _, scene in self.panels)


def _figure(number: str, kind: str, **panels: str) -> PaperFigure:
    return PaperFigure(number, kind, tuple((letter.strip("_"), f"paper/{name}") for letter, name in panels.items()))


FIGURES = (
    _figure("3", MOTION, _="fig03"),
    _figure("4", PATHS, a="fig03", b="fig04b"),
    _figure("5", MOTION, _="fig05"),
    _figure("6", MOTION, _="fig06"),
    _figure("7", PATHS, a="fig05", b="fig06"),
    _figure("8", MOTION, _="fig08"),
    _figure("9", MOTION, _="fig09"),
    _figure("10", PATHS, a="fig08", b="fig09"),
    _figure("11", MOTION, _="fig11"),
    _figure("12", MOTION, _="fig12"),
    _figure("13", PATHS, a="fig11", b="fig13b"),
    _figure("14", PATHS, a="fig14a", b="fig14b", c="fig14c"),
    PaperFigure("15", TORQUES, tuple((f"{n} kN·m", f"paper/fig15-{n}kNm") for n in (1, 10, 50, 100))),
    _figure("16", PATHS, a="fig15-1kNm", b="fig15-100kNm"),
)


def available(scenes: Mapping[str, StoredScene]) -> tuple[PaperFigure, ...]:
    """The figures of which `scenes` has a panel, with the panels that it has."""
    found = (
        PaperFigure(one.number, one.kind, tuple(panel for panel in one.panels if panel[1] in scenes)) for one in FIGURES
    )
    return tuple(one for one in found if one.panels)


def compared_runs(scene: StoredScene) -> dict[str, StoredRun]:
    """The scene's runs by the keys of HEADINGS, those that have samples of angles and rates."""
    exudyn = [
        run for name, run in run_selection.corrected_runs(scene).items()
        if (method := look_up(name)) and "exudyn" in method.distributions and run_selection.has_samples(run)
    ]  # fmt: skip
    runs = {
        "printed": run_selection.printed_run(scene),
        "corrected": run_selection.reference_or_corrected_run(scene),
        "exudyn": next(iter(exudyn), None),
    }
    found: dict[str, StoredRun] = {}
    for key, run in runs.items():
        if run is not None and run not in found.values() and "angles" in run and "rates" in run:
            found[key] = run
    return found


def panel_runs(figure: PaperFigure, scenes: Mapping[str, StoredScene]) -> list[tuple[str, str, dict[str, StoredRun]]]:
    """(letter, key, runs by label) of each picture, row by row.

    A figure of torques is one row, with the runs of all its scenes in one picture; elsewhere a picture has one run.
    """
    rows: dict[str, dict[str, dict[str, StoredRun]]] = {}
    for label, name in figure.panels:
        letter = "" if figure.kind == TORQUES else label
        for key, run in compared_runs(scenes[name]).items():
            if figure.kind != PATHS or "tip" in run:
                rows.setdefault(letter, {}).setdefault(key, {})[label] = run
    return [(letter, key, runs) for letter, row in rows.items() for key, runs in row.items()]


def draw(figure: PaperFigure, axes: Sequence[Any], runs: Mapping[str, StoredRun]) -> None:
    """A picture on `axes`: one for paths, else two, position above velocity."""
    if figure.kind == PATHS:
        paths.draw_paths(axes[0], next(iter(runs.values())).array("tip"))
        return
    labels = (histories.ANGLE_AXIS, histories.RATE_AXIS)
    for one, name, label in zip(axes, ("angles", "rates"), labels, strict=True):
        if figure.kind == MOTION:
            run = next(iter(runs.values()))
            histories.draw_coordinates(one, run.array("time"), run.array(name), label)
        else:
            series = [
                histories.Series(run.array("time"), run.array(name)[:, 0], torque_look(place))
                for place, run in enumerate(runs.values())
            ]
            histories.draw_lines(one, series, label)
            histories.set_range(one, np.concatenate([run.values for run in series])[:, None])
    axes[0].set_title("(a) position", loc="left")
    axes[0].tick_params(labelbottom=False)
    axes[1].set_title("(b) angular velocity", loc="left")
    axes[1].set_xlabel(canvas.TIME_AXIS)


def torque_look(place: int) -> Look:
    """Line of the curve at `place` in a figure of torques."""
    return Look(COLOURS[place % len(COLOURS)], ("-", "--", "-.", ":")[place % 4], "")


def legend(figure: PaperFigure, scenes: Mapping[str, StoredScene]) -> list[tuple[str, Look]]:
    """(label, look) of the curves: coordinates, blades, or torques."""
    if figure.kind == TORQUES:
        return [(label, torque_look(i)) for i, (label, _) in enumerate(figure.panels)]
    runs = compared_runs(scenes[figure.scenes[0]])
    labels = next(iter(runs.values())).labels if runs else []
    if figure.kind == MOTION:
        return [(label, coordinate_look(i)) for i, label in enumerate(labels)]
    return [(f"blade {i}", replace(coordinate_look(i), line="-")) for i in range(1, len(labels))]


def write_figures(results: Path, folder: Path, kind: str, numbers: Iterable[str] = ()) -> list[Path]:
    """`folder`/figNN.`kind` for each figure of `numbers`, or for all that the file has where `numbers` is empty.

    `kind` is "pdf", "svg" or "png". Returns the files written. Raises InputError for a figure that the file does not
    have, StoreError where the file cannot be read or the folder cannot be written.
    """
    with open_results(results) as opened:
        have = {one.number: one for one in available(opened.scenes)}
        asked = list(dict.fromkeys(numbers)) or list(have)
        unknown = [number for number in asked if number not in have]
        if unknown or not have:
            allowed = ", ".join(have) or "none: it has no scene of the paper"
            raise InputError(f"{results}: figure {', '.join(unknown) or 'of the paper'}: not in it; allowed: {allowed}")
        made = {f"fig{int(n):02d}.{kind}": canvas.encoded(composed(have[n], opened.scenes).figure, kind) for n in asked}
    for name, content in made.items():
        replace_file(folder / name, content)
    return [folder / name for name in made]


def composed(figure: PaperFigure, scenes: Mapping[str, StoredScene]) -> canvas.Panels:
    """The whole figure, a column per model: position above velocity, or a row per panel where paths are shown."""
    pictures = panel_runs(figure, scenes)
    letters = list(dict.fromkeys(letter for letter, _, _ in pictures))
    keys = [key for key in HEADINGS if key in {key for _, key, _ in pictures}]
    is_paths = figure.kind == PATHS
    with canvas.style(for_print=True):
        rows, height, heading = (len(letters), 1.8, 1.02) if is_paths else (2, 1.55, 1.16)
        panels = canvas.print_grid(rows, len(keys), height)
        table = [panels.axes[i : i + len(keys)] for i in range(0, len(panels.axes), len(keys))]
        for letter, key, runs in pictures:
            column = [row[keys.index(key)] for row in table]
            draw(figure, [column[letters.index(letter)]] if is_paths else column, runs)
        for axes, key in zip(table[0], keys, strict=True):
            axes.text(0.5, heading, HEADINGS[key], transform=axes.transAxes, ha="center", weight="bold")
        _tidy(table, letters if is_paths else [])
    labelled = legend(figure, scenes)
    place = {"loc": "lower center", "ncols": min(len(labelled), 5), "handlelength": 2.6}
    canvas.legend(panels.figure, labelled, for_print=True, **place)
    return panels


def _tidy(table: list[list[Any]], letters: list[str]) -> None:
    """Letters at the rows of paths; labels of the vertical axes at the first column alone; no empty frames."""
    for row in table:
        for axes in row:
            if not axes.has_data():
                axes.set_axis_off()
            if axes is not row[0]:
                axes.set_ylabel("")
    for row, letter in zip(table, letters, strict=False):
        row[0].text(-0.08, 0.94, f"({letter})", transform=row[0].transAxes)
