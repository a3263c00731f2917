"""Pictures over time: errors with a curve per run, and stored quantities as their declarations say."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.models.lagrange.defects import interval_defects
from rotor_mbs.report import plots
from rotor_mbs.report.core.canvas import Panels
from rotor_mbs.report.core.elements import LegendEntry, PageTable, Picture, Section
from rotor_mbs.report.core.looks import Look, coordinate_look, label_of, look_of, with_capital
from rotor_mbs.report.core.numbers import number, prefixed
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.plots import LOWEST, Series
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.quantities import Plot, Quantity, known_quantities, sizes
from rotor_mbs.solution.trajectory import Array

Runs = Mapping[str, StoredRun]
Curves = dict[str, Series]  # by method
VISIBLE = 0.05  # rad: what one can see in a figure of the paper's size


class Component(NamedTuple):
    """A component of a quantity over time."""

    group: str  # the panel it is drawn in
    label: str  # its line there
    place: int  # index of the line's look
    values: Array  # (n,)


def plotted_quantities(scene: StoredScene) -> list[tuple[Quantity, Plot]]:
    """The quantities of the scene with a plot: built in, or of an installed package that its outputs name."""
    parsed = scene_of(scene)
    quantities = known_quantities(parsed.outputs if parsed is not None else ())
    return [(quantity, quantity.plot) for quantity in quantities if quantity.plot is not None and quantity.is_over_time]


def quantity_sections(scene: StoredScene, runs: Runs, horizon: float | None) -> list[tuple[str, str, Section]]:
    """(id, heading, section) of each such quantity that one of `runs` has."""
    sections = []
    for quantity, plot in plotted_quantities(scene):
        own = {method: run for method, run in runs.items() if quantity.name in run}
        if not own:
            continue
        name = f"quantity-{quantity.name}"
        if plot.logarithmic:
            sizes_of_runs = {method: _over_components(np.abs(run.array(quantity.name))) for method, run in own.items()}
            curves = over_time(own, sizes_of_runs)
            shown = error_picture(curves, plot.axis, name, plot.title, horizon) if visible(curves) else None
            section = Section([] if shown is None else [shown], run_legend(visible(curves)))
        elif len(quantity.dimensions) == 1:
            lines = {}
            for method, run in own.items():
                look = replace(look_of(method), marker="")
                lines[method] = Series(run.array("time"), run.array(quantity.name), look)
            panels = plots.lines([(plot.axis, list(lines.values()))], horizon)
            legend = [LegendEntry(label_of(method), line.look) for method, line in lines.items()]
            section = Section([picture(panels, name, plot.title)], legend)
        else:
            section = _components_section(quantity, plot, own, name, horizon)
        sections.append((name, plot.title, section))
    return sections


def _components_section(quantity: Quantity, plot: Plot, runs: Runs, name: str, horizon: float | None) -> Section:
    rule = quantity.judgement
    is_compared = rule is not None and rule.with_reference and REFERENCE in runs
    pictures: list[Picture] = []
    legend: list[LegendEntry] = []
    for i, run in enumerate([runs[REFERENCE]] if is_compared else runs.values()):
        values = run.array(quantity.name)
        panels, looks = component_panels(quantity, plot, run.array("time"), values, run.labels, horizon)
        caption = f"{with_capital(label_of(run.method))}: {quantity.long_name}"
        pictures.append(picture(panels, f"{name}-{i}", caption))
        legend = [LegendEntry(label, look) for label, look in looks.items()]
    if not is_compared:
        return Section(pictures, legend)
    exact = runs[REFERENCE].array(quantity.name)

    def difference(run: StoredRun) -> Array:
        """The largest over blades, at the samples that both have; of vectors the length."""
        values = run.array(quantity.name)
        n = min(len(values), len(exact))
        return _over_components(sizes(quantity, values[:n] - exact[:n]))

    others = {method: run for method, run in runs.items() if method != REFERENCE}
    errors = over_time(others, {method: difference(run) for method, run in others.items()})
    shown = error_picture(
        errors, f"difference ({quantity.units})", f"{name}-error", "Largest difference from the reference", horizon,
        legend=run_legend(visible(errors)),
    )  # fmt: skip
    if shown is not None:
        pictures.append(shown)
    time = runs[REFERENCE].array("time")
    rows = []
    for part in components(quantity, exact, runs[REFERENCE].labels):
        row = [f"{part.label} {part.group}".strip()]
        for k in (int(part.values.argmin()), int(part.values.argmax())):
            row += [prefixed(float(part.values[k]), quantity.units), number(float(time[k]), 4)]
        rows.append(row)
    head = ("Component", "Smallest", "at (s)", "Largest", "at (s)")
    return Section(pictures, legend, [PageTable("Extremes in the reference", head, rows)])


def component_panels(
    quantity: Quantity, plot: Plot, time: Array, values: Array, labels: Sequence[str] = (), horizon: float | None = None
) -> tuple[Panels, dict[str, Look]]:
    """A panel per axis with a line per blade, or one panel with a line per component; the looks of the lines."""
    rows: dict[str, list[Series]] = {}
    looks: dict[str, Look] = {}
    for part in components(quantity, values, labels):
        looks[part.label] = coordinate_look(part.place)
        axis = f"{part.group} {plot.axis}".strip()
        rows.setdefault(axis, []).append(Series(time, part.values, looks[part.label]))
    return plots.lines(list(rows.items()), horizon, height=2.3 if len(rows) == 1 else 1.3), looks


def over_time(runs: Runs, values: Mapping[str, Array]) -> Curves:
    """The values (n,) of runs, by method, over their first samples."""
    return {method: Series(runs[method].array("time")[: len(x)], x, look_of(method)) for method, x in values.items()}


def _over_components(values: Array) -> Array:
    """(n,) of (n, ...): the largest over the components."""
    largest: Array = values.reshape(len(values), -1).max(axis=1)
    return largest


def components(quantity: Quantity, values: Array, labels: Sequence[str] = ()) -> list[Component]:
    """One by one: with blades and axes, a panel per axis and a line per blade; else one panel."""
    names = {"coordinate": labels, "axis": ["x", "y", "z"]}
    shown = names.get(quantity.dimensions[1], [f"blade {i + 1}" for i in range(values.shape[1])])[: values.shape[1]]
    first = 1 if quantity.dimensions[1] == "blade" else 0  # a blade has the look of its pitch
    if values.ndim == 2:
        return [Component("", label, first + i, values[:, i]) for i, label in enumerate(shown)]
    return [
        Component(axis, label, first + i, values[:, i, k])
        for i, label in enumerate(shown)
        for k, axis in enumerate("xyz")
    ]


def error_picture(
    curves: Curves, axis: str, name: str, caption: str, horizon: float | None = None, others: Sequence[Series] = (),
    legend: Sequence[LegendEntry] = (), *, signed: bool = False,
) -> Picture | None:  # fmt: skip
    """The curves and `others`, which have no marker; None where there is nothing to draw or to note."""
    if not curves:
        return None
    shown = visible(curves)
    exact = [label_of(method) for method in curves if method not in shown]
    notes = [f"No curve, because nowhere above 10⁻¹⁸: {'; '.join(exact)}."] if exact else []
    panels = plots.errors([*others, *shown.values()], axis, horizon, signed=signed)
    return picture(panels, name, caption, notes, legend)


def visible(curves: Curves) -> Curves:
    """The curves that a logarithmic axis can show."""
    return {method: curve for method, curve in curves.items() if np.abs(curve.values).max() > LOWEST}


def run_legend(methods: Iterable[str]) -> list[LegendEntry]:
    """An entry per method, as its error curves are drawn."""
    return [LegendEntry(label_of(method), look_of(method)) for method in methods]


def defects(scene: Scene, runs: Runs) -> Curves:
    """The size (rad) of the defect of every interval, at its end; a fault in time stands out in its own intervals."""
    curves = {}
    for method, run in runs.items():
        time = run.array("time") if "angles" in run and "rates" in run else np.empty(0)
        if len(time) < 2:
            continue
        sizes = interval_defects(scene, time, run.array("angles"), run.array("rates")).sizes
        curves[method] = Series(time[1:], sizes, look_of(method))
    return curves


def differences(runs: Runs, reference: StoredRun | None) -> Curves:
    """Largest angle difference (rad) from the reference over the coordinates, at the samples that both have."""
    if reference is None or "angles" not in reference or not len(reference.array("time")):
        return {}
    values = {method: angle_difference(run, reference) for method, run in runs.items() if "angles" in run}
    return over_time(runs, values)


def angle_difference(first: StoredRun, second: StoredRun) -> Array:
    """(common samples,) rad: the largest over the coordinates."""
    n = min(len(first.array("time")), len(second.array("time")))
    largest: Array = np.abs(first.array("angles")[:n] - second.array("angles")[:n]).max(axis=1)
    return largest


def parting(printed: StoredRun, corrected: StoredRun) -> tuple[float | None, float]:
    """When the angles of both first differ by VISIBLE (s; None: never), and the largest difference (rad)."""
    gap = angle_difference(printed, corrected)
    apart = np.flatnonzero(gap > VISIBLE)
    return (float(printed.array("time")[apart[0]]) if len(apart) else None), float(gap.max(initial=0.0))
