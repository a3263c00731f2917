"""The paper's figures as files for a manuscript: printed model, right model and Exudyn in one figure, column by column.

Knows stored scenes and how figures are drawn; no page.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.report.core import canvas
from rotor_mbs.report.pages.walk import legend
from rotor_mbs.report.paper_figures import columns, draw_motion, draw_paths, draw_torques
from rotor_mbs.report.paper_set import MOTION, TORQUES, PaperFigure, available
from rotor_mbs.store.read import StoredRun, StoredScene, open_results


def write_figures(results: Path, folder: Path, kind: str, numbers: Iterable[str]) -> list[Path]:
    """`folder`/figNN.`kind` for each figure asked for, all that the file has where `numbers` is empty.

    Raises InputError for a figure that the file does not have, StoreError where file or folder is not as it should be.
    """
    with open_results(results) as opened:
        have = {one.number: one for one in available(opened.scenes)}
        asked = list(dict.fromkeys(numbers)) or list(have)
        unknown = [number for number in asked if number not in have]
        if unknown or not have:
            allowed = ", ".join(have) or "none: it has no scene of the paper"
            raise InputError(f"{results}: figure {', '.join(unknown) or 'of the paper'}: not in it; allowed: {allowed}")
        made = {f"fig{int(n):02d}.{kind}": canvas.encoded(composed(have[n], opened.scenes).figure, kind) for n in asked}
    return [_written(folder / name, content) for name, content in made.items()]


def composed(figure: PaperFigure, scenes: Mapping[str, StoredScene]) -> canvas.Panels:
    """The whole figure: a column a model; rows (a) and (b), or a row a panel where paths are shown."""
    stored = {name: scenes[name] for name in figure.scenes}
    with canvas.style(for_print=True):
        panels = (_curves if figure.kind in (MOTION, TORQUES) else _paths)(figure, stored)
    canvas.legend_below(panels.figure, [(one.label, one.colour, _dashes(one.dashes)) for one in legend(figure, stored)])
    return panels


def _curves(figure: PaperFigure, stored: Mapping[str, StoredScene]) -> canvas.Panels:
    by_heading: dict[str, dict[str, StoredRun]] = {}
    for label, name in figure.panels:
        for heading, run in columns(stored[name]).items():
            by_heading.setdefault(heading, {})[label] = run
    across = len(by_heading)
    panels = canvas.grid(2, across, 1.55, for_print=True)
    for place, (heading, runs) in enumerate(by_heading.items()):
        axes = (panels.axes[place], panels.axes[across + place])
        if figure.kind == TORQUES:
            draw_torques(axes, runs)
        else:
            draw_motion(axes, next(iter(runs.values())))
        _head(axes[0], heading, 1.16)
        if place:
            for one in axes:
                one.set_ylabel("")
    return panels


def _paths(figure: PaperFigure, stored: Mapping[str, StoredScene]) -> canvas.Panels:
    rows = [(letter, columns(stored[name])) for letter, name in figure.panels]
    headings = list(dict.fromkeys(heading for _, runs in rows for heading in runs))
    panels = canvas.grid(len(rows), len(headings), 1.8, for_print=True)
    for i, (letter, runs) in enumerate(rows):
        for j, heading in enumerate(headings):
            axes = panels.axes[i * len(headings) + j]
            if heading in runs and "tip" in runs[heading]:
                draw_paths(axes, runs[heading].array("tip"))
            else:
                axes.set_axis_off()
            if not i:
                _head(axes, heading, 1.02)
            if not j:
                axes.text(-0.08, 0.94, f"({letter})", transform=axes.transAxes)
    return panels


def _head(axes: Any, heading: str, height: float) -> None:
    axes.text(0.5, height, heading, transform=axes.transAxes, ha="center", weight="bold")


def _dashes(text: str) -> Any:
    """A line's style of the dashes of a legend's sample, which are twice as long."""
    return (0, tuple(0.5 * float(length) for length in text.split())) if text else "-"


def _written(path: Path, content: bytes) -> Path:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    except OSError as exc:
        raise StoreError(f"{path}: cannot be written: {exc.strerror or exc}") from exc
    return path
