"""The page that goes through the paper's figures in its order: the models side by side, and what differs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction

import numpy as np

from rotor_mbs.analysis.claims import Claim
from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.report import paper_figures
from rotor_mbs.report.core import canvas, svg
from rotor_mbs.report.core.elements import LegendEntry, Picture
from rotor_mbs.report.core.looks import label_of, with_capital
from rotor_mbs.report.core.numbers import fixed, minus, number, prefixed, with_unit
from rotor_mbs.report.pages import Context
from rotor_mbs.report.pages.claim_tables import description_of, unit_of
from rotor_mbs.report.pages.comparison_pictures import parting
from rotor_mbs.report.pages.quantities import angle_difference
from rotor_mbs.report.pages.scene_tables import horizon, metric
from rotor_mbs.report.paper_figures import HEADINGS, PATHS, TORQUES, PaperFigure, compared_runs
from rotor_mbs.solution.status import COMPLETE
from rotor_mbs.store.read import StoredRun, StoredScene

_ROUNDING = 1e-9  # rad


def walk_figure(figure: PaperFigure, scenes: Mapping[str, StoredScene], context: Context) -> dict[str, object]:
    """The part of the page about one figure."""
    claims = (claim for claim in context.claims if claim.published.is_number)
    numbers = [claim for claim in claims if claim.published.figure == figure.number]
    pictures = paper_figures.panel_runs(figure, scenes)
    is_torques = figure.kind == TORQUES  # all in one picture per model
    panels = []
    for letter, name in [("", figure.scenes[0])] if is_torques else figure.panels:
        row = {key: runs for place, key, runs in pictures if place == letter}
        same, different = _torques(figure, scenes, row) if is_torques else same_and_different(scenes[name])
        panels.append({
            "letter": letter,
            "scene": name,
            "href": context.files[name],
            "conditions": _conditions(scenes[name], with_torque=not is_torques),
            "pictures": [_picture(figure, letter, key, runs, f"{same} {different}") for key, runs in row.items()],
            "same": same,
            "different": different,
        })  # fmt: skip
    return {
        "number": figure.number,
        "kind": figure.kind,
        "legend": [LegendEntry(label, look) for label, look in paper_figures.legend(figure, scenes)],
        "panels": panels,
        "numbers": [_number(claim) for claim in numbers],
        "has_rounding_number": any(claim.published.rounding for claim in numbers),
    }


def _torques(
    figure: PaperFigure, scenes: Mapping[str, StoredScene], row: Mapping[str, Mapping[str, StoredRun]]
) -> tuple[str, str]:
    """What is the same and what is not in a figure of torques."""
    gaps = [gap for name in figure.scenes if (gap := _exudyn_gap(scenes[name])) is not None]
    same = "The same: every torque accelerates the rotor from rest"
    same += f"; Exudyn and the corrected model differ by {with_unit(max(gaps)[0], 'rad')} at most." if gaps else "."
    turned = [
        f"{HEADINGS[key]}: {', '.join(_turned(run, at) for at, run in runs.items())}" for key, runs in row.items()
    ]
    return same, (
        "Not the same: in the corrected model the blades stay at zero pitch and the rotor turns by "
        f"τt²/(2·3·m·(c²+d²)). Turned at the end: {'; '.join(turned)}."
    )


def _turned(run: StoredRun, torque: str) -> str:
    return f"{number(float(run.array('angles')[-1, 0] - run.array('angles')[0, 0]), 3)} rad at {torque}"


def _picture(figure: PaperFigure, letter: str, key: str, runs: Mapping[str, StoredRun], message: str) -> Picture:
    panels = canvas.panels((4.1,) if figure.kind == PATHS else (1.7, 1.7), "")
    if figure.kind != PATHS:
        panels.figure.subplots_adjust(top=0.93, hspace=0.2)  # room for headings
    paper_figures.draw(figure, panels.axes, runs)
    heading, label = HEADINGS[key], label_of(next(iter(runs.values())).method)
    caption = with_capital(label) if label.startswith(heading.lower()) else f"{heading}: {label}"
    return svg.picture(panels, f"f{figure.number}{letter}-{key}", caption, message)


def _number(claim: Claim) -> str:
    item = claim.published
    assert item.of is not None  # every number has it
    published, printed, corrected = (
        fixed(value, item.decimals) for value in (item.value, claim.printed.value, claim.corrected.value)
    )
    return (
        f"{with_capital(description_of(item.of))}: published {published} {unit_of(item.of)}; as printed {printed}; "
        f"corrected model {corrected}."
    )


def same_and_different(scene: StoredScene) -> tuple[str, str]:
    """What the printed model, the corrected one and Exudyn have in common on a scene, and how they differ."""
    runs = compared_runs(scene)
    printed, corrected = runs.get("printed"), runs.get("corrected")
    same, different = [], []
    if printed is not None and corrected is not None:
        parted, largest = parting(printed, corrected)
        if parted is None or parted > 0.0:
            until = "throughout" if parted is None else f"up to {with_unit(parted, 's', 3)}"
            same.append(f"the printed model moves as the corrected one {until}")
        pitches = [float(np.abs(run.array("angles")[:, 1:]).max(initial=0.0)) for run in (corrected, printed)]
        if pitches[0] < _ROUNDING and pitches[1] > 1e-3:
            reach = with_unit(pitches[1], "rad")
            different.append(f"no blade pitches in the corrected model; in print the pitches reach {reach}")
        if parted is not None:
            most = with_unit(largest, "rad")
            different.append(f"the printed angles differ from the corrected ones by up to {most}")
    gap = _exudyn_gap(scene)
    if gap is not None:
        near, until = with_unit(gap[0], "rad"), with_unit(gap[1], "s", 3)
        same.append(f"Exudyn and the corrected model differ by no more than {near} up to {until}")
    gain = None if printed is None else metric(printed, "energy_gain_J")
    if gain is not None and gain > 1e3:
        different.append(f"the energy of the printed model rises by {prefixed(gain, 'J')} without work done")
    if printed is not None and printed.status not in COMPLETE:
        end = with_unit(float(printed.array("time")[-1]), "s", 3)
        different.append(f"it diverges, and ode45 stops at {end}")
    common = f"The same: {'; '.join(same)}." if same else ""
    return common, f"Not the same: {'; '.join(different) or 'nothing visible'}."


def _exudyn_gap(scene: StoredScene) -> tuple[float, float] | None:
    """rad, the difference of Exudyn from the corrected model up to a time, and that time in s; None without both."""
    runs = compared_runs(scene)
    if not {"corrected", "exudyn"} <= set(runs):
        return None
    gap, known = angle_difference(runs["exudyn"], runs["corrected"]), horizon(scene)
    time = runs["exudyn"].array("time")[: len(gap)]
    until = min(math.inf if known is None else known, float(time[-1]))
    return float(gap[time <= until].max(initial=0.0)), until


def _conditions(stored: StoredScene, *, with_torque: bool = True) -> str:
    """The initial state, torque, gravity and duration; "" where the stored text is not a scene."""
    scene = scene_of(stored)
    if scene is None:
        return ""
    angles, rates = (", ".join(in_pi(x) for x in values) for values in (scene.initial_angles, scene.initial_rates))
    parts = [f"q(0) = [{angles}] rad", f"dq/dt(0) = [{rates}] rad/s"]
    if with_torque and not scene.has_constant_torque:
        parts.append("a torque that changes over time")
    elif with_torque and scene.torque_at(0.0):
        parts.append(f"rotor torque {prefixed(scene.torque_at(0.0), 'N·m')}")
    return f"{', '.join(parts)}, g = {number(scene.gravity, 3)} m/s², {with_unit(scene.duration, 's', 4)}."


def in_pi(value: float) -> str:
    """ "11π/12" where `value` is a simple multiple of π, else four digits."""
    part = Fraction(value / math.pi).limit_denominator(12)
    if value and abs(float(part) * math.pi - value) < 1e-12:
        top = {1: "π", -1: "−π"}.get(part.numerator, f"{minus(str(part.numerator))}π")
        return top if part.denominator == 1 else f"{top}/{part.denominator}"
    return minus(f"{value:.4g}")
