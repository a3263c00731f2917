"""The page of a scene: pictures and tables from its stored runs. Sections for which it has no data are empty."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from rotor_mbs.analysis import run_selection
from rotor_mbs.analysis.claim_study import ClaimStudy
from rotor_mbs.analysis.claims import Claim
from rotor_mbs.analysis.exact import escape_rate
from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.methods.catalogue import REFERENCE, is_corrected
from rotor_mbs.report.core import canvas
from rotor_mbs.report.core.canvas import TIME_AXIS, Panels
from rotor_mbs.report.core.elements import LegendEntry, PageTable, Picture, Section, line_entry
from rotor_mbs.report.core.looks import GREY, Look, coordinate_look, label_of, look_of, with_capital
from rotor_mbs.report.core.numbers import fixed, number, prefixed, with_unit
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.pages import Context, claim_tables, quantities
from rotor_mbs.report.pages.bench import cost_section
from rotor_mbs.report.pages.drive import drive_section
from rotor_mbs.report.pages.quantities import VISIBLE, parting
from rotor_mbs.report.pages.scene_tables import failure_table, horizon, method_cell, metric, metrics_table
from rotor_mbs.report.pages.viewer import viewer
from rotor_mbs.report.plots import paths
from rotor_mbs.report.plots import time_histories as histories
from rotor_mbs.report.plots.time_histories import LOWEST, Series
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.solution.trajectory import Array

_MOST_PUBLISHED = 2  # published values on one picture
_EXTREMES = ("rotor_angle_min", "rotor_angle_max", "rotor_rate_max")


class DrawnRuns(NamedTuple):
    """The runs of a scene that are drawn: those that have samples.

    sides   the "printed" run, and the one that stands for the "corrected" model
    all     these, then the other runs of corrected models, by method
    """

    scene: StoredScene
    sides: Mapping[str, StoredRun]
    all: Mapping[str, StoredRun]
    horizon: float | None


def scene_page(scene: StoredScene, context: Context) -> dict[str, object]:
    """The content of the page of a scene."""
    sides = run_selection.sides(scene)
    good = {n: run for n, run in run_selection.corrected_runs(scene).items() if run_selection.has_samples(run)}
    drawn = DrawnRuns(scene, sides, {run.method: run for run in sides.values()} | good, horizon(scene))
    pages = ["", *context.files.values(), ""]
    place = pages.index(context.files[scene.name])
    claims = [claim for claim in context.claims if scene.name in claim.published.scenes]
    condition = context.conditions.get(scene.name.rpartition("/")[2])
    figures = str(scene.attributes.get("figures", ""))
    key = key_picture(list(sides.values()), claims, drawn.horizon)
    parsed = scene_of(scene)
    has_zero_pitch = any("zero_pitch_max" in run.attributes for run in scene.runs.values())
    return {
        "name": scene.name,
        "title": scene.title,
        "figures": figures and f"{'Figures' if ',' in figures else 'Figure'} {figures} of the paper",
        "toml": str(scene.attributes.get("scene_toml", "")),
        "source": opening_comment(scene),
        "failures": Section(tables=[failure_table(scene)]),
        "claims": _claims_section(claims, context.study, [condition] if condition else []),
        "viewer": viewer(scene, {label_of(run.method): run for run in sides.values()}),
        "key": key,
        "paths": tips_section(scene, list(sides.values()), drawn.horizon),
        "motion": motion_section(drawn),
        "difference": difference_section(drawn),
        "energy": energy_section(drawn),
        "drive": drive_section(scene, sides.get("corrected")),
        "cost": cost_section(scene, context.curves.get(scene.name, ())),
        "quantities": quantities.quantity_sections(scene, drawn.all, drawn.horizon),
        "metrics": Section(tables=[metrics_table(scene)]),
        "has_horizon": drawn.horizon is not None,
        "has_printed": any(run.status == "ok" and not is_corrected(run.method) for run in scene.runs.values()),
        "has_zero_pitch": has_zero_pitch,
        "escape_rate": escape_rate(parsed) if has_zero_pitch and parsed is not None else None,
        "previous": pages[place - 1],
        "next": pages[place + 1],
    }


def opening_comment(scene: StoredScene) -> str:
    """The comment at the start of the scene's file, as running text; "" where there is none."""
    lines = []
    for line in str(scene.attributes.get("scene_toml", "")).splitlines():
        if not line.startswith("#"):
            break
        if "doi " not in line:  # the index names the paper
            lines.append(line.lstrip("#").strip())
    return " ".join(lines).strip()


def _claims_section(claims: Sequence[Claim], study: ClaimStudy | None, notes: list[str]) -> Section:
    """The numbers and claims about a scene; where a number is rounding error, what it is under other conditions."""
    tables = [claim_tables.number_table(claims), claim_tables.claim_table(claims, study.shares if study else None)]
    if study is not None and any(claim.published.rounding for claim in claims):
        tables += claim_tables.trial_tables(study.numbers)
    tables = [table for table in tables if table.rows]
    if study is not None and any(not claim.published.is_number for claim in claims):
        notes = [*notes, claim_tables.study_note(study.shares)]
    return Section(tables=tables, notes=notes)


# What it opens with


class Mark(NamedTuple):
    """A published value (rad, rad/s) on one of the panels, with the text beside it."""

    panel: int
    value: float
    text: str


def key_picture(
    sides: Sequence[StoredRun], claims: Sequence[Claim], horizon: float | None, name: str = "key"
) -> Picture | None:
    """The rotor's angle and the pitch that differs most, printed and corrected, with published values; None without."""
    runs = [run for run in sides if "angles" in run]
    if not runs:
        return None
    labels = runs[0].labels
    blade = _blade_to_show(runs)
    shown = [0, blade] if blade else [0]
    looks = {}
    for run in runs:  # the printed model is dashed upon the corrected one
        line = "-" if run.method == REFERENCE or is_corrected(run.method) else "--"
        looks[run.method] = Look(look_of(run.method).colour, line, "")
    panels_of = [
        (
            f"{labels[i]} angle (rad)",
            [Series(run.array("time"), run.array("angles")[:, i], looks[run.method]) for run in reversed(runs)],
        )
        for i in shown
    ]
    marks = []
    for claim in claims:
        item, of = claim.published, claim.published.of
        if item.is_number and of is not None and of.quantity == "angle" and of.coordinate in shown:
            text = f"published {fixed(item.value, item.decimals)} rad"
            marks.append(Mark(shown.index(of.coordinate), item.value, text))
    marks = marks[:_MOST_PUBLISHED]
    parted = None
    caption = f"{with_capital(label_of(runs[0].method))}: angles over time"
    if len(runs) > 1:
        parted, largest = parting(runs[0], runs[1])
        caption = f"Rotor and pitch angles of both models, which differ by up to {with_unit(largest, 'rad')}"
    legend = [
        LegendEntry(label_of(run.method), looks[run.method], 2.4 if looks[run.method].line == "-" else 1.3)
        for run in runs
    ]
    legend += horizon_entry(horizon, runs)
    if marks:
        legend.append(line_entry("published", line=":"))
    return picture(departure(panels_of, marks, horizon, parted), name, caption, legend=legend)


def _blade_to_show(runs: Sequence[StoredRun]) -> int:
    """The coordinate of the pitch that differs most, or moves most; 0 where no blade pitches."""
    angles = [run.array("angles") for run in runs]
    count = min(map(len, angles))
    candidates = [angles[-1]]
    if len(angles) > 1:
        candidates.insert(0, angles[0][:count] - angles[1][:count])
    for values in candidates:
        largest = np.abs(values[:, 1:]).max(axis=0, initial=0.0)
        if largest.size and largest.max() > 1e-6:
            return 1 + int(largest.argmax())
    return 0


def departure(
    panels_of: Sequence[tuple[str, Sequence[Series]]], marks: Sequence[Mark] = (), horizon: float | None = None,
    parted: float | None = None,
) -> Panels:  # fmt: skip
    """A panel per (axis label, curves), one below the other, with published values and the time of parting (s)."""
    panels = canvas.panels((1.75,) * len(panels_of), TIME_AXIS)
    for place, (axes, (label, series)) in enumerate(zip(panels.axes, panels_of, strict=True)):
        for curve in series:
            time, values = histories.thin(curve.time, curve.values)
            canvas.curve(axes, time, values, curve.look, 2.4 if curve.look.line == "-" else 1.3)
        shortest = min(len(curve.values) for curve in series)
        histories.set_range(axes, np.stack([curve.values[:shortest] for curve in series], axis=1))
        axes.set_ylabel(label)
        end = max(float(curve.time[-1]) for curve in series)
        for mark in marks:
            if mark.panel == place:
                low, high = axes.get_ylim()
                axes.set_ylim(min(low, mark.value), max(high, mark.value + 0.12 * (high - low)))
                axes.axhline(mark.value, color=GREY, linewidth=1.0, linestyle=":")
                beside = parted if parted is not None and parted < 0.1 * end else 0.0  # not across its line
                _text(axes, beside + 0.01 * end, mark.value, mark.text, va="bottom")
        histories.mark_time(axes, end, horizon)
        if parted is not None and 0.0 < parted < end:
            axes.axvline(parted, color=GREY, linewidth=1.0, linestyle="-")
            if not place:
                text = f"{VISIBLE:g} rad apart at {parted:.2g} s"
                _text(axes, parted + 0.01 * end, axes.get_ylim()[1], text, va="top")
    return panels


def _text(axes: Any, x: float, y: float, text: str, va: str) -> None:
    axes.text(x, y, text, color=GREY, ha="left", va=va, fontsize=8.5)


def horizon_entry(horizon: float | None, runs: Iterable[StoredRun]) -> list[LegendEntry]:
    """For the legend, where the line is drawn: before the end of a run."""
    if horizon is None or not any(horizon < float(run.array("time")[-1]) for run in runs):
        return []
    return [line_entry(f"horizon {with_unit(horizon, 's', 3)}", line="--")]


# Its sections


def motion_section(drawn: DrawnRuns) -> Section:
    """Angles above rates, as the paper plots them; the printed model beside the corrected one."""
    runs = [run for run in drawn.sides.values() if "angles" in run or "rates" in run]
    if not runs:
        return Section()
    pictures = []
    for i, run in enumerate(runs):
        angles, rates = run.get("angles"), run.get("rates")
        notes = []
        if any(values is not None and histories.is_cut(values) for values in (angles, rates)):
            notes.append("Values beyond the axes are cut off.")
        panels = histories.motion(run.array("time"), angles, rates, drawn.horizon)
        pictures.append(picture(panels, f"motion-{i}", with_capital(label_of(run.method)), notes))
    legend = [LegendEntry(label, coordinate_look(i)) for i, label in enumerate(runs[0].labels)]
    return Section(pictures, [*legend, *horizon_entry(drawn.horizon, runs)], [range_table(runs)])


def range_table(runs: Sequence[StoredRun]) -> PageTable:
    """Extremes of each coordinate in each of the runs, of the samples.

    Of the rotor, where they are stored, those of the integrator's own points, as the published numbers are: a sample
    need not meet a crest.
    """
    labels = runs[0].labels
    head = ["Coordinate"]
    rows = [[label] for label in labels]
    for run in runs:
        lowest, highest, fastest = (metric(run, name) for name in _EXTREMES)
        if "angles" in run:
            head.append(f"{with_capital(label_of(run.method))}: angle (rad)")
            angles = run.array("angles")
            low, high = angles.min(axis=0), angles.max(axis=0)
            low[0] = low[0] if lowest is None else lowest
            high[0] = high[0] if highest is None else highest
            for row, least, most in zip(rows, low, high, strict=True):
                row.append(f"{number(least, 4)} to {number(most, 4)}")
        if "rates" in run:
            head.append("largest rate (rad/s)")
            largest = np.abs(run.array("rates")).max(axis=0)
            largest[0] = largest[0] if fastest is None else fastest
            for row, rate in zip(rows, largest, strict=True):
                row.append(number(rate, 3))
    return PageTable("Extremes", head, rows, numeric=range(1, len(head)))


def tips_section(stored: StoredScene, sides: Sequence[StoredRun], horizon: float | None) -> Section:
    """Paths in space as the paper draws them; offset over azimuth; distance of printed from corrected tips."""
    runs = [run for run in sides if "tip" in run]
    if not runs:
        return Section()
    scene = scene_of(stored)
    pictures = [
        picture(paths.paths(run.array("tip")), f"paths-{i}", with_capital(label_of(run.method)))
        for i, run in enumerate(runs)
    ]
    out_of_plane = [float(np.abs(run.array("tip")[:, :, 1]).max()) for run in runs]
    if scene is not None and max(out_of_plane) > 1e-9:
        for i, run in enumerate(run for run in runs if "angles" in run):
            panels = offsets_over_azimuth(run.array("angles"), run.array("tip"), scene.phases)
            caption = f"{with_capital(label_of(run.method))}: tips out of the plane of rotation"
            pictures.append(picture(panels, f"offset-{i}", caption))
    if len(runs) > 1:
        first, second = runs
        count = min(len(first.array("time")), len(second.array("time")))
        time = first.array("time")[:count]
        gaps = np.linalg.norm(first.array("tip")[:count] - second.array("tip")[:count], axis=2)
        series = [Series(time, np.maximum(gap, 1e-6), coordinate_look(1 + i)) for i, gap in enumerate(gaps.T)]
        caption = f"Distance of each printed tip from the corrected one: up to {prefixed(float(gaps.max()), 'm')}"
        panels = histories.errors(series, "printed − corrected (m)", horizon)
        pictures.append(picture(panels, "tip-difference", caption))
    blades = range(1, 1 + runs[0].array("tip").shape[1])
    lines = [LegendEntry(f"blade {i}", coordinate_look(i)) for i in blades]
    ends = [line_entry("blade at the start", line="--"), line_entry("at the end"), line_entry("shaft", width=4)]
    head = ["Blade"]
    rows = [[str(i)] for i in blades]
    for run in runs:
        tip = run.array("tip")
        head += [f"{with_capital(label_of(run.method))}: length of path", "off the plane"]
        lengths = np.linalg.norm(np.diff(tip, axis=0), axis=2).sum(axis=0)
        for row, length, off in zip(rows, lengths, np.abs(tip[:, :, 1]).max(axis=0), strict=True):
            row += [prefixed(length, "m"), prefixed(off, "m")]
    return Section(pictures, [*lines, *ends], [PageTable("Paths of the tips", head, rows, range(1, len(head)))])


def offsets_over_azimuth(angles: Array, tip: Array, phases: Sequence[float]) -> Panels:
    """How far each tip (n, blades, 3) m is out of the plane of rotation, in mm, over where its blade points."""
    panels = canvas.panels((2.3,), "azimuth of the blade (°), 0 above the hub")
    axes = panels.axes[0]
    for blade, phase in enumerate(phases):
        azimuth = np.degrees(np.remainder(angles[:, 0] + phase, 2.0 * np.pi))
        offset = 1e3 * tip[:, blade, 1]
        gap = np.abs(np.diff(azimuth, prepend=azimuth[:1])) > 180.0
        canvas.curve(axes, azimuth, np.where(gap, np.nan, offset), coordinate_look(blade + 1), 0.9)
    axes.set(xlim=(0.0, 360.0), ylabel="tip out of plane (mm)")
    canvas.ticks(axes.xaxis, {angle: str(angle) for angle in range(0, 361, 60)})
    return panels


def difference_section(drawn: DrawnRuns) -> Section:
    """Each run's largest angle difference from the reference, and the uncertainties that are known."""
    reference = drawn.scene.reference
    runs = {name: run for name, run in drawn.all.items() if name != REFERENCE}
    curves = quantities.differences(runs, reference)
    if not curves or reference is None:
        return Section()
    others = []
    legend = quantities.run_legend(quantities.visible(curves))
    if "error_growth" in reference:
        growth = np.maximum(np.maximum.accumulate(reference.array("error_growth")), 1.0)
        others.append(Series(reference.array("time"), float(np.finfo(float).eps) * growth, Look(GREY, ":", "")))
        legend.append(line_entry("rounding error of the initial state, grown", line=":"))
    rows = []
    for method, run in {REFERENCE: reference, **runs}.items():
        if "angle_uncertainty" not in run:
            continue
        time, uncertainty = run.array("time"), run.array("angle_uncertainty")
        largest = float(uncertainty[time <= (drawn.horizon or np.inf)].max())
        rows.append([method_cell(method), number(largest), number(float(uncertainty.max()))])
        if uncertainty.max() > LOWEST:
            look = Look(GREY, "-", "") if method == REFERENCE else Look(look_of(method).colour, ":", "")
            others.append(Series(time, uncertainty, look))
            legend.append(LegendEntry(f"{label_of(method)}: its uncertainty", look))
    shown = quantities.error_picture(
        curves, "largest angle difference (rad)", "difference",
        "Largest difference from the reference, over all angles", drawn.horizon, others,
    )  # fmt: skip
    legend += horizon_entry(drawn.horizon, drawn.sides.values())
    table = PageTable(
        "Uncertainty of the angles, by the method's own estimate (rad)",
        ("Method", "up to the horizon", "whole run"), rows, numeric=(1, 2),
    )  # fmt: skip
    return Section([shown] if shown else [], legend, [table] if rows else [])


def energy_section(drawn: DrawnRuns) -> Section:
    """Energy less work from its start, of every run; what each run has and how well it conserves it."""
    runs = {name: run for name, run in drawn.all.items() if "energy_error" in run}
    shown, methods = quantities.energy_picture(runs, drawn.horizon)
    if shown is None:
        return Section()
    legend = [*quantities.run_legend(methods), *horizon_entry(drawn.horizon, drawn.sides.values())]
    head = ("Method", "Largest kinetic energy", "Work at the end", "Largest gain", "Drift (relative)")
    rows = []
    for name, run in runs.items():
        kinetic = float(run.array("kinetic_energy").max()) if "kinetic_energy" in run else None
        work = float(run.array("work")[-1]) if "work" in run and run.array("work").any() else None
        joules = [prefixed(value, "J") for value in (kinetic, work, metric(run, "energy_gain_J"))]
        rows.append([method_cell(name), *joules, number(metric(run, "energy_drift_max"))])
    return Section([shown], legend, [PageTable("", head, rows, numeric=(1, 2, 3, 4)).without_empty_columns()])
