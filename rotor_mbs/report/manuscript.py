"""The paper's figures as files for a manuscript: the models side by side, a column each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from rotor_mbs.errors import InputError
from rotor_mbs.report.core import canvas
from rotor_mbs.report.paper_figures import HEADINGS, PATHS, PaperFigure, available, draw, legend, panel_runs
from rotor_mbs.store.hdf5 import replace_file
from rotor_mbs.store.read import StoredScene, open_results


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
    canvas.legend_below(panels.figure, legend(figure, scenes))
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
