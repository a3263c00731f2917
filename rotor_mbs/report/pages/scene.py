"""The page of a scene: pictures and tables from its stored runs. Sections for which it has no data are empty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rotor_mbs.analysis.published import Published
from rotor_mbs.methods.catalogue import REFERENCE, is_corrected
from rotor_mbs.models.lagrange.defects import interval_defects
from rotor_mbs.report import plots
from rotor_mbs.report.canvas import Panels
from rotor_mbs.report.elements import PageTable, Picture, Section, picture
from rotor_mbs.report.looks import GREY, VERMILLION, Look, coordinate_look, label_of, look_of, with_capital
from rotor_mbs.report.numbers import fixed, number, prefixed, with_unit
from rotor_mbs.report.pages import Report, horizon_of, metric, metrics_table, paper
from rotor_mbs.report.pages.bench import cost_picture
from rotor_mbs.report.pages.viewer import viewer
from rotor_mbs.report.plots import LOWEST, Series
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import values_at
from rotor_mbs.solution.quantities import Plot, Quantity, known_quantities, sizes
from rotor_mbs.solution.status import GOOD
from rotor_mbs.solution.trajectory import Array

Runs = Mapping[str, StoredRun]
VISIBLE = 0.05  # rad: what one can see in a figure of the paper's size
COMMAND, TAKEN = Look(GREY, ":", "", "command"), Look(VERMILLION, "--", "", "dissipated by the shaft damper")
EXTREMES = ("rotor_angle_min", "rotor_angle_max", "rotor_rate_max")


def scene_page(name: str, report: Report) -> dict[str, object]:
    """The content of the page of a scene."""
    scene = report.scenes[name]
    horizon = horizon_of(scene)
    # The printed run and the one that stands for the corrected model, then the others of corrected models.
    sides = scene.sides
    runs = list(sides.values())
    drawn = {run.method: run for run in runs}
    for method, run in scene.corrected_runs.items():
        if run.samples:
            drawn[method] = run
    pages = ["", *report.files.values(), ""]
    place = pages.index(report.files[name])
    claims = [claim for claim in report.claims if name in claim.scenes]
    study = report.study
    tables = [paper.number_table(claims)]
    if study is not None:
        tables.append(paper.claim_table(claims, study))
    condition = report.conditions.get(name.rpartition("/")[2]) if scene.is_shipped else None
    suite_runs = [run for run in report.suite_runs if run.scene == name]
    has_zero_pitch = any("zero_pitch_max" in run.attributes for run in scene.runs.values())
    motion, paths = [], []
    for i, run in enumerate(runs):
        caption = with_capital(label_of(run.method))
        if "angles" in run or "rates" in run:
            drawn_motion = plots.motion(run.array("time"), run.get("angles"), run.get("rates"), horizon)
            motion.append(picture(drawn_motion, f"motion-{i}", caption))
        if "tip" in run:
            paths.append(picture(plots.paths(run.array("tip")), f"paths-{i}", caption))
    return {
        "scene": scene,
        "claims": Section(tables=[table for table in tables if table.rows], notes=[condition] if condition else []),
        "study": study if any(not claim.is_number for claim in claims) else None,
        "viewer": viewer(scene, {label_of(run.method): run for run in runs}),
        "key": key_picture(runs, claims, horizon),
        "paths": Section(paths),
        "motion": Section(motion, [range_table(runs)] if motion else []),
        "difference": _difference_section(scene, drawn, horizon),
        "defects": Section(error_picture(defects(scene.scene, drawn), "defect (rad)", "defects", "Interval defects")),
        "drive": _drive_section(scene.scene, sides.get("corrected")),
        "cost": Section(cost_picture(report.curves.get(name, ()), f"Error and run time, {name}")),
        "quantities": quantity_sections(scene, drawn, horizon),
        "metrics": Section(tables=[metrics_table(scene, suite_runs)]),
        "has_horizon": horizon is not None,
        "has_printed": any(run.status in GOOD and not is_corrected(run.method) for run in scene.runs.values()),
        "has_zero_pitch": has_zero_pitch,
        "previous": pages[place - 1],
        "next": pages[place + 1],
    }


def key_picture(
    sides: Sequence[StoredRun], claims: Sequence[Published], horizon: float | None, name: str = "key"
) -> list[Picture]:
    """The rotor's angle and the pitch that differs most, printed and corrected, with published values.

    Of one model alone all its angles. Empty where no run has angles.
    """
    runs = [run for run in sides if "angles" in run]
    if not runs:
        return []
    if len(runs) == 1:
        panels = plots.motion(runs[0].array("time"), runs[0].array("angles"), None, horizon)
        return [picture(panels, name, f"{with_capital(label_of(runs[0].method))}: angles over time")]
    # Beside the rotor the pitch that differs most, or moves most.
    shown = [0]
    printed, corrected = (run.array("angles") for run in runs)
    count = min(len(printed), len(corrected))
    for values in (printed[:count] - corrected[:count], corrected):
        largest = np.abs(values[:, 1:]).max(axis=0, initial=0.0)
        if largest.size and largest.max() > 1e-6:
            shown.append(1 + int(largest.argmax()))
            break
    rows, marks = [], []
    for place, i in enumerate(shown):
        series = []
        for run, line in zip(reversed(runs), ("-", "--"), strict=True):  # the printed model is dashed upon the other
            look = replace(look_of(run.method), line=line, marker="")
            series.append(Series(run.array("time"), run.array("angles")[:, i], look))
        rows.append((f"{runs[0].labels[i]} angle (rad)", series))
        for claim in claims:
            if i == 0 and claim.metric in ("rotor_angle_min", "rotor_angle_max"):
                marks.append((place, claim.value, f"published {fixed(claim.value, claim.decimals)} rad"))
    parted, difference = parting(*runs)
    caption = f"Rotor and pitch angles of both models; largest difference {with_unit(difference, 'rad')}"
    if parted is not None:
        caption += f"; {VISIBLE:g} rad apart at {with_unit(parted, 's')}"
    return [picture(departure(rows, marks, horizon), name, caption)]


def departure(
    rows: Sequence[tuple[str, Sequence[Series]]], marks: Sequence[tuple[int, float, str]], horizon: float | None
) -> Panels:
    """A panel per (axis label, curves), with published values (panel, value, text)."""
    panels = plots.lines(rows, horizon, [1.75] * len(rows))
    for axes in panels.axes:
        for line in axes.get_lines():  # a dashed curve lies upon a wide one
            line.set_linewidth(2.4 if line.get_linestyle() == "-" else 1.3)
    for place, value, text in marks:
        low, high = panels.axes[place].get_ylim()
        panels.axes[place].set_ylim(min(low, value), max(high, value))
        panels.axes[place].axhline(value, color=GREY, linewidth=1.0, linestyle=":", label=text)
    return panels


def range_table(runs: Sequence[StoredRun]) -> PageTable:
    """Extremes of each coordinate in each of the runs; of the rotor at the integrator's own points, if stored."""
    head = ["Coordinate"]
    # A reference has angles and rates also where the scene does not ask for them.
    rows = [[label] for label in max((run.labels for run in runs), key=len)]
    for run in runs:
        lowest, highest, fastest = (metric(run, name) for name in EXTREMES)
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
    return PageTable("Extremes", head, rows)


def _difference_section(scene: StoredScene, drawn: Runs, horizon: float | None) -> Section:
    """Each run's largest angle difference from the reference, and the reference's uncertainty."""
    reference = scene.reference
    if reference is None or "angles" not in reference or not len(reference.array("time")):
        return Section()
    runs = {method: run for method, run in drawn.items() if method != REFERENCE}
    others = []
    if "error_growth" in reference:
        growth = np.maximum(np.maximum.accumulate(reference.array("error_growth")), 1.0)
        look = Look(GREY, ":", "", "rounding error of the initial state times error growth")
        others.append(Series(reference.array("time"), float(np.finfo(float).eps) * growth, look))
    if "angle_uncertainty" in reference and reference.array("angle_uncertainty").max() > LOWEST:
        look = Look(GREY, "-", "", f"{label_of(REFERENCE)}: uncertainty")
        others.append(Series(reference.array("time"), reference.array("angle_uncertainty"), look))
    differences = {method: angle_difference(run, reference) for method, run in runs.items() if "angles" in run}
    return Section(error_picture(
        over_time(runs, differences), "largest angle difference (rad)", "difference",
        "Largest difference from the reference, over all angles", horizon, others,
    ))  # fmt: skip


def _drive_section(scene: Scene, run: StoredRun | None) -> Section:
    """Torque and power at the shaft; pitches, their commands and the power of their actuators."""
    if run is None or "rates" not in run or "angles" not in run or not len(run.array("time")):
        return Section()
    time, angles, rates = run.array("time"), run.array("angles"), run.array("rates")
    drawn: dict[str, list[tuple[str, list[Series]]]] = {}  # by caption
    numbers: list[tuple[str, Array, str]] = []
    if scene.has_torque:
        look, torque = coordinate_look(0, "torque on the rotor"), values_at(scene.rotor_torque, time)
        powers = [Series(time, torque * rates[:, 0], look)]
        numbers += [("Torque on the rotor", torque, "N m"), ("Its power", powers[0].values, "W")]
        if scene.shaft_damping:
            powers.append(Series(time, scene.shaft_damping * rates[:, 0] ** 2, TAKEN))
            numbers.append(("Dissipated by the shaft damper", powers[1].values, "W"))
        torques = [Series(time, torque, look)]
        drawn["Rotor torque and its power"] = [("torque (N m)", torques), ("power (W)", powers)]
    driven = [i for i, tables in enumerate(scene.pitch_loads) if any(tables)]
    if driven:
        pitches, powers = plots.coordinate_series(time, angles)[1:], []
        for i in driven:
            torque, rest = (values_at(table, time) for table in scene.pitch_loads[i])
            stiffness, damping = scene.bearings[i]
            moment = torque + stiffness * (rest - angles[:, 1 + i]) - damping * rates[:, 1 + i]
            powers.append(Series(time, moment * rates[:, 1 + i], coordinate_look(1 + i)))
            if scene.pitch_loads[i][1]:
                pitches.append(Series(time, rest, COMMAND))
            numbers += [
                (f"Pitch {i + 1}", angles[:, 1 + i], "rad"),
                (f"Actuator {i + 1}, power", powers[-1].values, "W"),
            ]
        drawn["Pitches, their commands and actuators"] = [("pitch (rad)", pitches), ("actuators' power (W)", powers)]
    pictures: list[Picture] = []
    for caption, panels_of in drawn.items():
        panels = plots.lines(panels_of, heights=[1.3] * len(panels_of))
        for axes in panels.axes:  # they have the zero
            low, high = axes.get_ylim()
            axes.set_ylim(min(low, 0.0), max(high, 0.0))
        pictures.append(picture(panels, f"drive-{len(pictures)}", caption))
    rows = []
    for name, values, unit in numbers:
        work = prefixed(float(np.trapezoid(values, time)), "J") if unit == "W" else ""
        rows.append((name, *(prefixed(float(x), unit) for x in (np.abs(values).max(), values[-1])), work))
    table = PageTable("", ("Quantity", "Largest", "At the end", "Work"), rows)
    return Section(pictures, [table] if rows else [])


def quantity_sections(scene: StoredScene, runs: Runs, horizon: float | None) -> list[tuple[str, str, Section]]:
    """(id, heading, section) of each quantity with a plot that one of `runs` has."""
    sections = []
    for quantity in known_quantities(scene.scene.outputs):
        plot, own = quantity.plot, {method: run for method, run in runs.items() if quantity.name in run}
        if plot is None or not own:
            continue
        name = f"quantity-{quantity.name}"
        if plot.logarithmic:
            curves = over_time(own, {m: _largest(np.abs(run.array(quantity.name))) for m, run in own.items()})
            section = Section(error_picture(curves, plot.axis, name, plot.title, horizon))
        elif len(quantity.dimensions) == 1:
            curves = over_time(own, {method: run.array(quantity.name) for method, run in own.items()})
            curves = [curve._replace(look=replace(curve.look, marker="")) for curve in curves]
            section = Section([picture(plots.lines([(plot.axis, curves)], horizon), name, plot.title)])
        else:
            section = _components_section(quantity, plot, own, name, horizon)
        sections.append((name, plot.title, section))
    return sections


def _components_section(quantity: Quantity, plot: Plot, runs: Runs, name: str, horizon: float | None) -> Section:
    """Every run; of a quantity that is judged against the reference that one alone, the errors and its extremes."""
    rule = quantity.judgement
    is_compared = rule is not None and rule.with_reference and REFERENCE in runs
    pictures: list[Picture] = []
    for i, run in enumerate([runs[REFERENCE]] if is_compared else runs.values()):
        panels = plots.component_panels(
            quantity, plot, run.array("time"), run.array(quantity.name), run.labels, horizon
        )
        caption = f"{with_capital(label_of(run.method))}: {quantity.long_name}"
        pictures.append(picture(panels, f"{name}-{i}", caption))
    if not is_compared:
        return Section(pictures)
    time, exact = runs[REFERENCE].array("time"), runs[REFERENCE].array(quantity.name)
    differences = {}
    for method, run in runs.items():
        if method != REFERENCE:  # at the samples that both have; the largest over blades, of vectors the length
            values = run.array(quantity.name)
            n = min(len(values), len(exact))
            differences[method] = _largest(sizes(quantity, values[:n] - exact[:n]))
    axis, caption = f"difference ({quantity.units})", "Largest difference from the reference"
    pictures += error_picture(over_time(runs, differences), axis, f"{name}-error", caption, horizon)
    rows = []
    for panel, look, values in plots.components(quantity, exact, runs[REFERENCE].labels):
        row = [f"{look.label} {panel}".strip()]
        for k in (int(values.argmin()), int(values.argmax())):
            row += [prefixed(float(values[k]), quantity.units), number(float(time[k]), 4)]
        rows.append(row)
    head = ("Component", "Smallest", "at (s)", "Largest", "at (s)")
    return Section(pictures, [PageTable("Extremes in the reference", head, rows)])


def over_time(runs: Runs, values: Mapping[str, Array]) -> list[Series]:
    """The values (n,) of runs, by method, over their first samples."""
    return [Series(runs[method].array("time")[: len(x)], x, look_of(method)) for method, x in values.items()]


def _largest(values: Array) -> Array:
    """(n,) of (n, ...): the largest over the components."""
    largest: Array = values.reshape(len(values), -1).max(axis=1)
    return largest


def error_picture(
    curves: Sequence[Series], axis: str, name: str, caption: str, horizon: float | None = None,
    others: Sequence[Series] = (),
) -> list[Picture]:  # fmt: skip
    """A picture of the curves and of `others`, which have no marker; none where there is no curve."""
    shown, exact, notes = [], [], []
    for curve in curves:
        if np.abs(curve.values).max() > LOWEST:
            shown.append(curve)
        else:
            exact.append(curve.look.label)
    if exact:
        notes.append(f"Below 10⁻¹⁸ everywhere, not plotted: {'; '.join(exact)}.")
    panels = plots.errors([*others, *shown], axis, horizon)
    return [picture(panels, name, caption, notes)] if curves else []


def defects(scene: Scene, runs: Runs) -> list[Series]:
    """The size (rad) of the defect of every interval, at its end; a fault in time stands out in its own intervals."""
    curves = []
    for method, run in runs.items():
        time = run.array("time") if "angles" in run and "rates" in run else np.empty(0)
        if len(time) >= 2:
            sizes = interval_defects(scene, time, run.array("angles"), run.array("rates")).sizes
            curves.append(Series(time[1:], sizes, look_of(method)))
    return curves


def angle_difference(first: StoredRun, second: StoredRun) -> Array:
    """(common samples,) rad: the largest over the coordinates."""
    n = min(len(first.array("time")), len(second.array("time")))
    return _largest(np.abs(first.array("angles")[:n] - second.array("angles")[:n]))


def parting(printed: StoredRun, corrected: StoredRun) -> tuple[float | None, float]:
    """When the angles of both first differ by VISIBLE (s; None: never), and the largest difference (rad)."""
    gap = angle_difference(printed, corrected)
    apart = np.flatnonzero(gap > VISIBLE)
    return (float(printed.array("time")[apart[0]]) if len(apart) else None), float(gap.max(initial=0.0))
