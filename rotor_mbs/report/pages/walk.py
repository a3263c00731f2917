"""The page that goes through the paper's figures in its order: printed model, right model and Exudyn side by side.

Knows no HTML: plain data for the template.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from markupsafe import Markup

from rotor_mbs.analysis.claims import Claim
from rotor_mbs.report import texts
from rotor_mbs.report.core import canvas, svg
from rotor_mbs.report.core.elements import Picture, Sample, line_sample
from rotor_mbs.report.core.environment import Entry, Row
from rotor_mbs.report.core.numbers import fixed
from rotor_mbs.report.names import coordinate_look, name_of
from rotor_mbs.report.pages.walk_facts import conditions, facts
from rotor_mbs.report.paper_figures import columns, draw_motion, draw_paths, draw_torques, torque_look
from rotor_mbs.report.paper_set import MOTION, PATHS, TORQUES, PaperFigure
from rotor_mbs.store.read import StoredRun, StoredScene


def entry(
    figure: PaperFigure, scenes: Mapping[str, StoredScene], claims: Sequence[Claim], files: Mapping[str, str]
) -> Entry:
    """claims: all; files: each scene's page."""
    stored = {name: scenes[name] for name in figure.scenes}
    if figure.kind == TORQUES:
        rows = [_torque_row(figure, stored, files)]
    else:
        rows = [_row(figure, letter, stored[name], files[name]) for letter, name in figure.panels]
    numbers = [claim for claim in claims if claim.published.is_number and claim.published.figure == figure.number]
    notes = [texts.MATCHED_NOTE] if any(claim.published.matched for claim in numbers) else []
    notes += [texts.FIGURE_NOTES[figure.number]] if figure.number in texts.FIGURE_NOTES else []
    return Entry(
        figure.number,
        texts.figure_heading(figure.number, figure.kind),
        legend(figure, stored),
        rows,
        [_number(claim) for claim in numbers],
        notes,
    )


def legend(figure: PaperFigure, stored: Mapping[str, StoredScene]) -> list[Sample]:
    """Curves by colour: coordinates, blades, or torques."""
    if figure.kind == TORQUES:
        return [line_sample(label, *torque_look(i)) for i, (label, _) in enumerate(figure.panels)]
    runs = next(iter(columns(next(iter(stored.values()))).values()), None)
    labels = runs.labels if runs is not None else []
    if figure.kind == MOTION:
        return [line_sample(label, *coordinate_look(i)) for i, label in enumerate(labels)]
    return [line_sample(f"{texts.BLADE} {i}".lower(), coordinate_look(i)[0], "-") for i in range(1, len(labels))]


def _row(figure: PaperFigure, letter: str, scene: StoredScene, href: str) -> Row:
    known = facts(scene)
    same, different = texts.walk_same(known), texts.walk_different(known)
    pictures = [
        _picture(figure, f"f{figure.number}{letter}{place}", heading, run, f"{same} {different}")
        for place, (heading, run) in enumerate(columns(scene).items())
        if figure.kind == MOTION or "tip" in run
    ]
    return Row(letter, scene.name, href, conditions(scene), pictures, same, different)


def _picture(figure: PaperFigure, name: str, heading: str, run: StoredRun, message: str) -> Picture:
    with canvas.style():
        if figure.kind == PATHS:
            panels = canvas.grid(1, 1, 3.6)
            draw_paths(panels.axes[0], run.array("tip"))
        else:
            panels = canvas.grid(2, 1, 1.7)
            draw_motion(panels.axes, run)
    return _embedded(panels, name, heading, name_of(run.method), figure.number, message)


def _torque_row(figure: PaperFigure, stored: Mapping[str, StoredScene], files: Mapping[str, str]) -> Row:
    """All torques in one picture a model."""
    labels = {scene: label for label, scene in figure.panels}
    by_heading: dict[str, dict[str, StoredRun]] = {}
    for name, scene in stored.items():
        for heading, run in columns(scene).items():
            by_heading.setdefault(heading, {})[labels[name]] = run
    near = [found for scene in stored.values() if (found := facts(scene).exudyn) is not None]
    same = texts.torques_same(max(near, default=None))
    different = texts.torques_different({k: _swing(r) for k, r in by_heading.items()})
    pictures = []
    for place, (heading, runs) in enumerate(by_heading.items()):
        with canvas.style():
            panels = canvas.grid(2, 1, 1.7)
            draw_torques(panels.axes, runs)
        method = name_of(next(iter(runs.values())).method)
        message = f"{same} {different}"
        pictures.append(_embedded(panels, f"f15{place}", heading, method, figure.number, message))
    first = next(iter(stored))
    return Row("", first, files[first], conditions(stored[first], with_torque=False), pictures, same, different)


def _swing(runs: Mapping[str, StoredRun]) -> dict[str, float]:
    """rad: how far each torque turns the rotor."""
    return {label: float(run.array("angles")[-1, 0] - run.array("angles")[0, 0]) for label, run in runs.items()}


def _embedded(panels: canvas.Panels, name: str, heading: str, method: str, figure: str, message: str) -> Picture:
    title = texts.walk_picture(figure, heading)
    text = svg.embedded(canvas.svg_text(panels.figure), name, title, message)
    return Picture(Markup(text), method.capitalize() if method.startswith(heading.lower()) else f"{heading}: {method}")


def _number(claim: Claim) -> str:
    item = claim.published
    assert item.of is not None
    what = texts.asked(item.of.quantity, item.of.coordinate, item.of.statistic)
    unit = "rad" if item.of.quantity == "angle" else "rad/s"
    decimals = item.decimals
    return texts.walk_number(
        what,
        unit,
        fixed(item.value, decimals),
        fixed(claim.printed.value, decimals),
        fixed(claim.right.value, decimals),
    )
