"""The page of a scene: pictures and tables from its stored runs. Sections for which it has no data are empty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from rotor_mbs.analysis import run_selection
from rotor_mbs.analysis.claim_study import ClaimStudy
from rotor_mbs.analysis.claims import Claim
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.report.core.elements import LegendEntry, Picture, Section, line_entry
from rotor_mbs.report.core.looks import GREY, Look, coordinate_look, label_of, look_of, with_capital
from rotor_mbs.report.core.numbers import number, prefixed, with_unit
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.pages import Context, claim_tables, comparison_pictures, quantities, scene_tables
from rotor_mbs.report.pages.bench import cost_section
from rotor_mbs.report.pages.comparison_pictures import horizon_entry
from rotor_mbs.report.pages.drive import drive_section
from rotor_mbs.report.pages.figures import HEADINGS
from rotor_mbs.report.pages.scene_tables import metric
from rotor_mbs.report.pages.viewer import viewer
from rotor_mbs.report.plots import time_histories as histories
from rotor_mbs.report.plots.time_histories import LOWEST, Series
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.solution.status import COMPLETE


class DrawnRuns(NamedTuple):
    """The runs of a scene that are drawn: those that have samples.

    sides   printed, and the one that stands for the corrected model, by the heading of their column
    all     these, then the other runs of corrected models, by method
    """

    scene: StoredScene
    sides: Mapping[str, StoredRun]
    all: Mapping[str, StoredRun]
    horizon: float | None


def _drawn_runs(scene: StoredScene) -> DrawnRuns:
    sides = {HEADINGS[side]: run for side, run in run_selection.sides(scene).items()}
    good = {n: run for n, run in run_selection.corrected_runs(scene).items() if run_selection.has_samples(run)}
    return DrawnRuns(scene, sides, {run.method: run for run in sides.values()} | good, scene_tables.horizon(scene))


def scene_page(scene: StoredScene, context: Context) -> dict[str, object]:
    """The content of the page of a scene."""
    drawn, pages = _drawn_runs(scene), ["", *context.files.values(), ""]
    place = pages.index(context.files[scene.name])
    claims = [claim for claim in context.claims if scene.name in claim.published.scenes]
    own = context.conditions.get(scene.name.rpartition("/")[2])
    figures = str(scene.attributes.get("figures", ""))
    sides = {label_of(run.method): run for run in drawn.sides.values()}
    key = comparison_pictures.key_picture(list(drawn.sides.values()), claims, drawn.horizon)
    return {
        "name": scene.name,
        "title": scene.title,
        "figures": figures and f"{'Figures' if ',' in figures else 'Figure'} {figures} of the paper",
        "toml": str(scene.attributes.get("scene_toml", "")),
        "source": opening_comment(scene),
        "lead": _lead(drawn),
        "failures": scene_tables.failures(scene),
        "claims": _claims_section(claims, context.study, [own] if own else []),
        "viewer": viewer(scene, sides),
        "key": Section([key] if key is not None else []),
        "paths": comparison_pictures.tips_section(scene, drawn.sides, drawn.horizon),
        "motion": motion_section(drawn),
        "difference": difference_section(drawn),
        "energy": energy_section(drawn),
        "drive": drive_section(scene, drawn.sides.get(HEADINGS["corrected"])),
        "cost": cost_section(scene, context.curves.get(scene.name, ())),
        "quantities": quantities.quantity_sections(scene, drawn.all, drawn.horizon),
        "metrics": Section(tables=[scene_tables.metrics_table(scene)], notes=scene_tables.metrics_notes(scene)),
        "has_horizon": drawn.horizon is not None,
        "previous": pages[place - 1],
        "next": pages[place + 1],
    }


def _claims_section(claims: Sequence[Claim], study: ClaimStudy | None, notes: list[str]) -> Section:
    """The numbers and claims about a scene; where a number is rounding error, what it is under other conditions."""
    tables = [claim_tables.number_table(claims), claim_tables.claim_table(claims, study.shares if study else None)]
    if study is not None and tables[1].rows:
        notes = [*notes, claim_tables.study_note(study.shares)]
    if study is not None and any(claim.published.rounding for claim in claims):
        tables += claim_tables.trial_tables(study.numbers)
        notes = [*notes, claim_tables.trial_note(study.numbers)]
    return Section(tables=[table for table in tables if table.rows], notes=notes)


def _lead(drawn: DrawnRuns) -> list[str]:
    """What the pictures show, a sentence each."""
    printed, found = drawn.sides.get(HEADINGS["printed"]), []
    departure = None if printed is None else metric(printed, "angle_error_whole")
    if printed is not None and printed.status not in COMPLETE:
        end = with_unit(float(printed.array("time")[-1]), "s", 3)
        found.append(f"The printed model diverges: ode45 stops at {end}.")
    elif printed is not None and departure is not None:
        gain = metric(printed, "energy_gain_J")
        energy = "" if gain is None else f"; its energy rises by up to {prefixed(gain, 'J')}"
        sides = [run for run in drawn.sides.values() if "angles" in run]
        parted = comparison_pictures.parting(*sides)[0] if len(sides) == 2 else None
        most = f"by up to {with_unit(departure, 'rad')}{energy}."
        if parted is not None:
            most = f"{comparison_pictures.at_time(parted)} by {comparison_pictures.VISIBLE:g} rad, in the end {most}"
        found.append(f"The printed model departs from the reference {most}")
    runs = [run for run in run_selection.corrected_runs(drawn.scene).values() if run.status == "ok"]
    errors = {label_of(run.method): error for run in runs if (error := metric(run, "angle_error_max")) is not None}
    if errors and drawn.horizon is not None:
        each = ", ".join(f"{label} {with_unit(error, 'rad')}" for label, error in errors.items())
        horizon = with_unit(drawn.horizon, "s", 3)
        found.append(f"Corrected models are off the reference, up to the horizon at {horizon}, by: {each}.")
    return found


def motion_section(drawn: DrawnRuns) -> Section:
    """Angles above rates, as the paper plots them; the printed model beside the corrected one."""
    runs = {heading: run for heading, run in drawn.sides.items() if "angles" in run or "rates" in run}
    if not runs:
        return Section()
    pictures = [_motion_picture(f"motion-{i}", run, drawn.horizon) for i, run in enumerate(runs.values())]
    legend = [LegendEntry(label, coordinate_look(i)) for i, label in enumerate(next(iter(runs.values())).labels)]
    return Section(
        pictures, [*legend, *horizon_entry(drawn.horizon, drawn.sides.values())], [scene_tables.range_table(runs)]
    )


def _motion_picture(name: str, run: StoredRun, horizon: float | None) -> Picture:
    time, angles, rates = run.array("time"), run.get("angles"), run.get("rates")
    notes = []
    for values, what, unit in ((angles, "Angles", "rad"), (rates, "Rates", "rad/s")):
        if values is not None and histories.is_cut(values):
            largest = with_unit(float(np.abs(values).max()), unit)
            notes.append(f"{what} beyond the axis are cut off; the largest is {largest}.")
    label = label_of(run.method)
    named = [] if angles is None else zip(run.labels, angles.T, strict=False)
    ranges = [f"{n} from {number(float(x.min()), 3)} to {number(float(x.max()), 3)} rad" for n, x in named]
    panels = histories.motion(time, angles, rates, horizon)
    return picture(panels, name, with_capital(label), f"{label} over time: {'; '.join(ranges)}.", notes)


def difference_section(drawn: DrawnRuns) -> Section:
    """Each run's largest angle difference from the reference, and the reference's own uncertainty."""
    reference = drawn.scene.reference
    runs = {name: run for name, run in drawn.all.items() if name != REFERENCE}
    curves = quantities.differences(runs, reference)
    if not curves or reference is None:
        return Section()
    others, notes = [], []
    legend = quantities.run_legend(list(quantities.visible(curves)))
    time = reference.array("time")
    if "error_growth" in reference:
        growth = np.maximum(np.maximum.accumulate(reference.array("error_growth")), 1.0)
        others.append(Series(time, float(np.finfo(float).eps) * growth, Look(GREY, ":", "")))
        legend.append(line_entry("rounding error of the initial state, grown", line=":"))
    if "angle_uncertainty" in reference:
        uncertainty = float(reference.array("angle_uncertainty").max())
        if uncertainty > LOWEST:
            others.append(Series(time, reference.array("angle_uncertainty"), Look(GREY, "-", "")))
            legend.append(line_entry("uncertainty of the reference"))
        else:
            size = with_unit(uncertainty, "rad")
            notes.append(
                f"The uncertainty of the reference, {size}, is far below the axis; its angles are stored in double "
                "precision, rounded by at most half a unit in the last place."
            )
    for method, run in runs.items():
        if "angle_uncertainty" in run:
            look, label, own = Look(look_of(method).colour, ":", ""), label_of(method), run.array("angle_uncertainty")
            others.append(Series(run.array("time"), own, look))
            legend.append(LegendEntry(f"{label}: its uncertainty", look))
            known = own[run.array("time") <= (drawn.horizon or np.inf)]
            size = with_unit(float(known.max()), "rad")
            notes.append(f"{label}: uncertain by {size} up to the horizon, by its own estimate.")
    shown = quantities.error_picture(
        curves, "largest angle difference (rad)", "difference",
        "Largest difference from the reference, over all angles", drawn.horizon, others,
    )  # fmt: skip
    legend += horizon_entry(drawn.horizon, drawn.sides.values())
    return Section([shown] if shown else [], legend, notes=notes)


def energy_section(drawn: DrawnRuns) -> Section:
    """Energy less work from its start, of every run."""
    runs = {name: run for name, run in drawn.all.items() if "energy_error" in run}
    shown, methods = quantities.energy_picture(runs, drawn.horizon)
    if shown is None:
        return Section()
    legend = [*quantities.run_legend(methods), *horizon_entry(drawn.horizon, drawn.sides.values())]
    return Section([shown], legend, [scene_tables.energy_table(runs)])


def opening_comment(scene: StoredScene) -> str:
    """The comment at the start of the scene's file, as running text; "" where there is none."""
    lines = []
    for line in str(scene.attributes.get("scene_toml", "")).splitlines():
        if not line.startswith("#"):
            break
        if "doi " not in line:  # the index names the paper
            lines.append(line.lstrip("#").strip())
    return " ".join(lines).strip()
