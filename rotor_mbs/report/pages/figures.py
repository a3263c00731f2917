"""The paper's figures: what each shows, and how it is drawn, for a manuscript and on the page that goes through them.

The page sets the models side by side and says what is the same and what differs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.analysis import run_selection
from rotor_mbs.analysis.claims import Claim
from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.errors import InputError
from rotor_mbs.methods.catalogue import look_up
from rotor_mbs.report.core import canvas, svg
from rotor_mbs.report.core.elements import LegendEntry, Picture
from rotor_mbs.report.core.looks import COLOURS, Look, coordinate_look, label_of, with_capital
from rotor_mbs.report.core.numbers import fixed, minus, number, prefixed, with_unit
from rotor_mbs.report.pages import Context
from rotor_mbs.report.pages.claim_tables import description_of, unit_of
from rotor_mbs.report.pages.comparison_pictures import parting
from rotor_mbs.report.pages.quantities import angle_difference
from rotor_mbs.report.pages.scene_tables import horizon, metric
from rotor_mbs.report.plots import paths
from rotor_mbs.report.plots import time_histories as histories
from rotor_mbs.runs.files import replace_file
from rotor_mbs.runs.read import StoredRun, StoredScene, open_results
from rotor_mbs.solution.status import COMPLETE

_ROUNDING = 1e-9  # rad
MOTION, PATHS, TORQUES = "motion", "paths", "torques"
# The models that are compared, by key, in order from left to right.
HEADINGS = {"printed": "As printed", "corrected": "Corrected model", "exudyn": "Exudyn"}


@dataclass(frozen=True)
class PaperFigure:
    """number; kind; panels: the letter ("" where it has none; a torque) and the scene of each."""

    number: str
    kind: str
    panels: tuple[tuple[str, str], ...]


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
    found: dict[str, StoredRun] = {}
    for key, run in [*run_selection.sides(scene).items(), *(("exudyn", run) for run in exudyn[:1])]:
        if run not in found.values() and "angles" in run and "rates" in run:
            found[key] = run
    return found


def panel_runs(figure: PaperFigure, scenes: Mapping[str, StoredScene]) -> dict[str, dict[str, dict[str, StoredRun]]]:
    """The runs of each picture by label, row by row: by letter, then by key of HEADINGS.

    A figure of torques is one row, with the runs of all its scenes in one picture; elsewhere a picture has one run.
    """
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
    runs = compared_runs(scenes[figure.panels[0][1]])
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
    labelled = legend(figure, scenes)
    place = {"loc": "lower center", "ncols": min(len(labelled), 5), "handlelength": 2.6}
    canvas.legend(panels.figure, labelled, for_print=True, **place)
    return panels


def walk_figure(figure: PaperFigure, scenes: Mapping[str, StoredScene], context: Context) -> dict[str, object]:
    """The part of the page about one figure."""
    claims = (claim for claim in context.claims if claim.published.is_number)
    numbers = [claim for claim in claims if claim.published.figure == figure.number]
    pictures = panel_runs(figure, scenes)
    is_torques = figure.kind == TORQUES  # all in one picture per model
    panels = []
    for letter, name in [("", figure.panels[0][1])] if is_torques else figure.panels:
        row = pictures.get(letter, {})
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
        "legend": [LegendEntry(label, look) for label, look in legend(figure, scenes)],
        "panels": panels,
        "numbers": [_number(claim) for claim in numbers],
        "has_rounding_number": any(claim.published.rounding for claim in numbers),
    }


def _torques(
    figure: PaperFigure, scenes: Mapping[str, StoredScene], row: Mapping[str, Mapping[str, StoredRun]]
) -> tuple[str, str]:
    """What is the same and what is not in a figure of torques."""
    gaps = [gap for _, name in figure.panels if (gap := _exudyn_gap(scenes[name])) is not None]
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
    draw(figure, panels.axes, runs)
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
