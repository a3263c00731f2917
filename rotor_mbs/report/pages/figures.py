"""The page that goes through the paper's figures in its order: the models side by side, and what differs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from rotor_mbs.analysis.claims import Claim
from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.report import paper_figures
from rotor_mbs.report.core import canvas, svg
from rotor_mbs.report.core.elements import LegendEntry, Picture
from rotor_mbs.report.core.looks import label_of, with_capital
from rotor_mbs.report.core.numbers import fixed, minus, number, prefixed, with_unit
from rotor_mbs.report.pages.claims import description_of, unit_of
from rotor_mbs.report.pages.comparison_pictures import VISIBLE
from rotor_mbs.report.pages.error_pictures import angle_difference
from rotor_mbs.report.pages.scene_tables import horizon, metric
from rotor_mbs.report.paper_figures import HEADINGS, PATHS, TORQUES, PaperFigure, compared_runs
from rotor_mbs.solution.status import COMPLETE
from rotor_mbs.store.read import StoredRun, StoredScene

_ROUNDING = 1e-9  # rad


@dataclass(frozen=True)
class ModelComparison:
    """How the models of a scene differ; None where the file does not have the runs.

    visible_from      s, when the printed angles differ from the corrected ones by VISIBLE; inf: never
    largest           rad, the largest difference of the two
    ended             s, when the printed run ended early
    corrected_still   whether no blade of the corrected model pitches
    printed_pitch     rad, the largest pitch of the printed model
    gain              J, rise of the printed model's energy without work
    exudyn            rad, difference of Exudyn from the corrected model up to the time `until` (s)
    """

    visible_from: float | None
    largest: float | None
    ended: float | None
    corrected_still: bool
    printed_pitch: float | None
    gain: float | None
    exudyn: float | None
    until: float


def walk_figure(
    figure: PaperFigure, scenes: Mapping[str, StoredScene], claims: Sequence[Claim], files: Mapping[str, str]
) -> dict[str, object]:
    """claims: all of the paper; files: the file name of each scene's page."""
    numbers = [claim for claim in claims if claim.published.is_number and claim.published.figure == figure.number]
    pictures = paper_figures.panel_runs(figure, scenes)
    is_torques = figure.kind == TORQUES  # all in one picture per model
    panels = []
    for letter, name in [("", figure.scenes[0])] if is_torques else figure.panels:
        row = {key: runs for place, key, runs in pictures if place == letter}
        same, different = _torques(figure, scenes, row) if is_torques else _same_and_different(scenes[name])
        panels.append({
            "letter": letter,
            "scene": name,
            "href": files[name],
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
    gaps = [gap for name in figure.scenes if (gap := comparison(scenes[name]).exudyn) is not None]
    same = "The same: every torque accelerates the rotor from rest"
    same += f"; Exudyn and the corrected model differ by {with_unit(max(gaps), 'rad')} at most." if gaps else "."
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
    panels = canvas.grid(1, 1, 3.6) if figure.kind == PATHS else canvas.grid(2, 1, 1.7)
    with canvas.style():
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


def comparison(scene: StoredScene) -> ModelComparison:
    """The printed model, the corrected one and Exudyn on one scene."""
    runs = compared_runs(scene)
    printed, corrected, exudyn = (runs.get(key) for key in HEADINGS)
    visible = largest = ended = gain = pitch = near = None
    known = horizon(scene)
    until = math.inf if known is None else known
    if printed is not None:
        gain = metric(printed, "energy_gain_J")
        pitch = float(np.abs(printed.array("angles")[:, 1:]).max(initial=0.0))
        if printed.status not in COMPLETE:
            ended = float(printed.array("time")[-1])
    if printed is not None and corrected is not None:
        gap = angle_difference(printed, corrected)
        largest = float(gap.max())
        apart = np.flatnonzero(gap > VISIBLE)
        visible = float(printed.array("time")[apart[0]]) if len(apart) else math.inf
    if exudyn is not None and corrected is not None:
        gap = angle_difference(exudyn, corrected)
        time = exudyn.array("time")[: len(gap)]
        until = min(until, float(time[-1]))
        near = float(gap[time <= until].max(initial=0.0))
    still = corrected is not None and bool(np.abs(corrected.array("angles")[:, 1:]).max(initial=0.0) < _ROUNDING)
    return ModelComparison(visible, largest, ended, still, pitch, gain, near, until)


def _same_and_different(scene: StoredScene) -> tuple[str, str]:
    found = comparison(scene)
    return _same(found), _different(found)


def _same(found: ModelComparison) -> str:
    parts = []
    if found.visible_from is not None and found.visible_from > 0.0:
        until = "throughout" if found.visible_from == math.inf else f"up to {with_unit(found.visible_from, 's', 3)}"
        parts.append(f"the printed model moves as the corrected one {until}")
    if found.exudyn is not None:
        parts.append(
            f"Exudyn and the corrected model differ by no more than {with_unit(found.exudyn, 'rad')} up to "
            f"{with_unit(found.until, 's', 3)}"
        )
    return f"The same: {'; '.join(parts)}." if parts else ""


def _different(found: ModelComparison) -> str:
    parts = []
    if found.corrected_still and found.printed_pitch is not None and found.printed_pitch > 1e-3:
        pitch = with_unit(found.printed_pitch, "rad")
        parts.append(f"no blade pitches in the corrected model; in print the pitches reach {pitch}")
    if found.largest is not None and found.visible_from != math.inf:
        parts.append(f"the printed angles differ from the corrected ones by up to {with_unit(found.largest, 'rad')}")
    if found.gain is not None and found.gain > 1e3:
        parts.append(f"the energy of the printed model rises by {prefixed(found.gain, 'J')} without work done")
    if found.ended is not None:
        parts.append(f"it diverges, and ode45 stops at {with_unit(found.ended, 's', 3)}")
    return f"Not the same: {'; '.join(parts)}." if parts else "Not the same: nothing visible."


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
