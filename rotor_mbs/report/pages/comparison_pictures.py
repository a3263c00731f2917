"""Pictures of a scene in which the printed model stands beside the corrected one: motion, energy, tips."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from rotor_mbs.analysis.claims import Claim
from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.methods.catalogue import REFERENCE, is_corrected
from rotor_mbs.report.core import canvas
from rotor_mbs.report.core.canvas import TIME_AXIS, Panels
from rotor_mbs.report.core.elements import LegendEntry, Picture, Section, line_entry
from rotor_mbs.report.core.looks import GREY, Look, coordinate_look, label_of, look_of, with_capital
from rotor_mbs.report.core.numbers import fixed, number, power, prefixed, with_unit
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.pages.claim_tables import description_of
from rotor_mbs.report.pages.quantities import angle_difference
from rotor_mbs.report.pages.scene_tables import path_table
from rotor_mbs.report.plots import paths
from rotor_mbs.report.plots.time_histories import Series, errors, mark_time, set_range, thin
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.solution.trajectory import Array

VISIBLE = 0.05  # rad: what one can see in a figure of the paper's size
_LOWEST = 1e-16  # relative energy at which a mark below it is drawn
_PUBLISHED = 2  # published values at most on one picture


class Mark(NamedTuple):
    """A published value (rad, rad/s) on one of the panels, with the text beside it."""

    panel: int
    value: float
    text: str


def parting(printed: StoredRun, corrected: StoredRun) -> tuple[float | None, float]:
    """When the angles of both first differ by VISIBLE (s; None: never), and the largest difference (rad)."""
    gap = angle_difference(printed, corrected)
    apart = np.flatnonzero(gap > VISIBLE)
    return (float(printed.array("time")[apart[0]]) if len(apart) else None), float(gap.max(initial=0.0))


def at_time(seconds: float) -> str:
    """ "at the start", "at 0.29 s"."""
    return f"at {with_unit(seconds, 's', 2)}" if seconds else "at the start"


def side_look(run: StoredRun) -> Look:
    """The look of a line among few: the printed model is dashed upon the corrected one."""
    look = look_of(run.method)
    return Look(look.colour, "-" if run.method == REFERENCE or is_corrected(run.method) else "--", "")


def key_picture(
    sides: Sequence[StoredRun], claims: Sequence[Claim], horizon: float | None, name: str = "key"
) -> Picture | None:
    """The rotor's angle and the pitch that differs most, printed and corrected, with published values; None without."""
    runs = [run for run in sides if "angles" in run]
    if not runs:
        return None
    blade = _blade_to_show(runs)
    labels = runs[0].labels
    shown = [0, *([blade] if blade else [])]
    panels_of = [
        (
            f"{labels[i]} angle (rad)",
            [Series(r.array("time"), r.array("angles")[:, i], side_look(r)) for r in reversed(runs)],
        )
        for i in shown
    ]
    parted, largest = parting(runs[0], runs[1]) if len(runs) > 1 else (None, 0.0)
    published = _published(claims, shown)
    panels = departure(panels_of, [mark for mark, _ in published], horizon, parted)
    caption = " ".join([_parting_text(runs, parted, largest), *(text for _, text in published)])
    ranges = [
        f"{label_of(r.method)}: {labels[i]} from {number(float(r.array('angles')[:, i].min()), 3)} to "
        f"{number(float(r.array('angles')[:, i].max()), 3)} rad"
        for r in runs for i in shown
    ]  # fmt: skip
    legend = [LegendEntry(label_of(r.method), side_look(r), 2.4 if side_look(r).line == "-" else 1.3) for r in runs]
    legend += horizon_entry(horizon, runs)
    if published:
        legend.append(line_entry("published", line=":"))
    return picture(panels, name, caption, f"{caption} {'; '.join(ranges)}.", legend=legend)


def horizon_entry(horizon: float | None, runs: Iterable[StoredRun]) -> list[LegendEntry]:
    """For the legend, where the line is drawn: before the end of a run."""
    if horizon is None or not any(horizon < float(run.array("time")[-1]) for run in runs):
        return []
    return [line_entry(f"horizon {with_unit(horizon, 's', 3)}", line="--")]


def _blade_to_show(runs: Sequence[StoredRun]) -> int:
    """The coordinate of the pitch that differs most, or moves most; 0 where no blade pitches."""
    angles = [run.array("angles") for run in runs]
    count = min(map(len, angles))
    moved = np.abs(angles[0][:count] - angles[1][:count] if len(angles) > 1 else angles[0])[:, 1:].max(
        axis=0, initial=0.0
    )
    if not moved.size or moved.max() < 1e-6:
        moved = np.abs(angles[-1][:, 1:]).max(axis=0, initial=0.0)
    return 1 + int(moved.argmax()) if moved.size and moved.max() > 1e-6 else 0


def _parting_text(runs: Sequence[StoredRun], parted: float | None, largest: float) -> str:
    if len(runs) < 2:
        return f"{with_capital(label_of(runs[0].method))}: angles over time."
    if parted is None:
        return f"Printed and corrected model never differ by {VISIBLE:g} rad: by {with_unit(largest, 'rad')} at most."
    most = with_unit(largest, "rad")
    return f"The models are {VISIBLE:g} rad apart {at_time(parted)}; their angles differ by up to {most}."


def _published(claims: Sequence[Claim], shown: Sequence[int]) -> list[tuple[Mark, str]]:
    """Published extremes of the angles of the coordinates `shown`: heights in their panels, what each model has."""
    found = []
    for claim in claims:
        item, of = claim.published, claim.published.of
        if not item.is_number or of is None or of.quantity != "angle" or of.coordinate not in shown:
            continue
        values = (fixed(value, item.decimals) for value in (item.value, claim.printed.value, claim.corrected.value))
        published, printed, corrected = values
        mark = Mark(shown.index(of.coordinate), item.value, f"published {published} rad")
        text = f"{with_capital(description_of(of))}, rad: published {published}, as printed {printed}"
        found.append((mark, f"{text}, corrected {corrected}."))
    return found[:_PUBLISHED]


def tips_section(stored: StoredScene, sides: Mapping[str, StoredRun], horizon: float | None) -> Section:
    """Paths in space as the paper draws them; offset over azimuth; distance of printed from corrected tips.

    sides: printed and corrected, by heading.
    """
    runs = {heading: run for heading, run in sides.items() if "tip" in run}
    if not runs:
        return Section()
    blades = next(iter(runs.values())).array("tip").shape[1]
    pictures = [_path_picture(f"paths-{i}", run) for i, run in enumerate(runs.values())]
    scene = scene_of(stored)
    lines = [LegendEntry(f"blade {i}", coordinate_look(i)) for i in range(1, blades + 1)]
    moved = any(float(np.abs(run.array("tip")[:, :, 1]).max()) > 1e-9 for run in runs.values())
    if scene is not None and moved:
        for i, run in enumerate(run for run in runs.values() if "angles" in run):
            panels = offsets_over_azimuth(run.array("angles"), run.array("tip"), scene.phases)
            caption = f"{with_capital(label_of(run.method))}: tips out of the plane of rotation"
            reach = prefixed(float(np.abs(run.array("tip")[:, :, 1]).max()), "m")
            pictures.append(picture(panels, f"offset-{i}", caption, f"{caption}, by up to {reach}."))
    if len(runs) > 1:
        one, other = runs.values()
        count = min(len(one.array("time")), len(other.array("time")))
        time = one.array("time")[:count]
        gaps = np.linalg.norm(one.array("tip")[:count] - other.array("tip")[:count], axis=2)
        series = [Series(time, np.maximum(gap, 1e-6), coordinate_look(1 + i)) for i, gap in enumerate(gaps.T)]
        panels = errors(series, "printed − corrected (m)", horizon)
        caption = f"Distance of each printed tip from the corrected one: up to {prefixed(float(gaps.max()), 'm')}"
        pictures.append(picture(panels, "tip-difference", caption, f"{caption}."))
    ends = [line_entry("blade at the start", line="--"), line_entry("at the end"), line_entry("shaft", width=4)]
    return Section(pictures, [*lines, *ends], [path_table(runs)])


def _path_picture(name: str, run: StoredRun) -> Picture:
    tip, label = run.array("tip"), label_of(run.method)
    text = f"{label}: paths of the blade tips in space with the blades at the start and at the end"
    if "angles" in run:
        turned = float(run.array("angles")[-1, 0] - run.array("angles")[0, 0])
        text += f"; the rotor ends {number(turned, 3)} rad from its start"
    text += f"; tips leave the plane of rotation by up to {prefixed(float(np.abs(tip[:, :, 1]).max()), 'm')}."
    return picture(paths.paths(tip), name, with_capital(label), text)


def departure(
    panels_of: Sequence[tuple[str, Sequence[Series]]], marks: Sequence[Mark] = (), horizon: float | None = None,
    parted: float | None = None,
) -> Panels:  # fmt: skip
    """A panel per (axis label, curves), one below the other, with published values and the time of parting (s)."""
    picture = canvas.panels((1.75,) * len(panels_of), TIME_AXIS)
    for place, (axes, (label, series)) in enumerate(zip(picture.axes, panels_of, strict=True)):
        for one in series:
            canvas.curve(axes, *thin(one.time, one.values), one.look, 2.4 if one.look.line == "-" else 1.3)
        longest = min(len(one.values) for one in series)
        set_range(axes, np.stack([one.values[:longest] for one in series], axis=1))
        axes.set_ylabel(label)
        end = max(float(one.time[-1]) for one in series)
        for mark in marks:
            if mark.panel == place:
                low, high = axes.get_ylim()
                axes.set_ylim(min(low, mark.value), max(high, mark.value + 0.12 * (high - low)))
                axes.axhline(mark.value, color=GREY, linewidth=1.0, linestyle=":")
                beside = parted if parted is not None and parted < 0.1 * end else 0.0  # not across its line
                axes.text(beside + 0.01 * end, mark.value, mark.text, color=GREY, ha="left", va="bottom", fontsize=8.5)
        mark_time(axes, end, horizon)
        if parted is not None and 0.0 < parted < end:
            axes.axvline(parted, color=GREY, linewidth=1.0, linestyle="-")
            if not place:
                text = f"{VISIBLE:g} rad apart at {parted:.2g} s"
                axes.text(parted + 0.01 * end, axes.get_ylim()[1], text, color=GREY, va="top", fontsize=8.5)
    return picture


def offsets_over_azimuth(angles: Array, tip: Array, phases: Sequence[float]) -> Panels:
    """How far each tip (n, blades, 3) m is out of the plane of rotation, in mm, over where its blade points."""
    picture = canvas.panels((2.3,), "azimuth of the blade (°), 0 above the hub")
    axes = picture.axes[0]
    for blade, phase in enumerate(phases):
        azimuth = np.degrees(np.remainder(angles[:, 0] + phase, 2.0 * np.pi))
        offset = 1e3 * tip[:, blade, 1]
        gap = np.abs(np.diff(azimuth, prepend=azimuth[:1])) > 180.0
        look = coordinate_look(blade + 1)
        canvas.curve(axes, azimuth, np.where(gap, np.nan, offset), look, 0.9)
    axes.set(xlim=(0.0, 360.0), ylabel="tip out of plane (mm)")
    canvas.ticks(axes.xaxis, {angle: str(angle) for angle in range(0, 361, 60)})
    return picture


def energy_of_scenes(rows: Mapping[str, Sequence[tuple[float, Look]]]) -> Panels:
    """A row per scene, a mark per model: its energy made from nothing, of the scene's energy scale, logarithmic."""
    picture = canvas.panels((0.19 * len(rows) + 0.25,), "energy made from nothing / energy scale of the scene")
    axes = picture.axes[0]
    for row, marks in enumerate(rows.values()):
        for value, look in marks:
            shown = min(max(value, _LOWEST), 1e3)
            canvas.curve(axes, [shown], [row], Look(look.colour, "", look.marker), markersize=5.5)
    axes.set(xscale="log", xlim=(_LOWEST / 3.0, 3e3), ylim=(len(rows) - 0.4, -0.6))
    canvas.ticks(axes.xaxis, {10.0**e: power(e) for e in range(round(math.log10(_LOWEST)), 4, 3)})
    canvas.ticks(axes.yaxis, dict(enumerate(rows)))
    picture.figure.subplots_adjust(left=0.25)
    return picture
