"""Pictures over time: errors with a curve per run, and stored quantities as their declarations say."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.report import plots
from rotor_mbs.report.core.elements import LegendEntry, PageTable, Picture, Section
from rotor_mbs.report.core.looks import coordinate_look, label_of, look_of, with_capital
from rotor_mbs.report.core.numbers import number, prefixed
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.plots import LOWEST, Series
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.solution.quantities import Plot, Quantity, known_quantities, sizes
from rotor_mbs.solution.trajectory import Array

Runs = Mapping[str, StoredRun]
Curves = dict[str, Series]  # by method
VISIBLE = 0.05  # rad: what one can see in a figure of the paper's size


class Component(NamedTuple):
    """A component of a quantity over time."""

    group: str  # the picture it is drawn in
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
            curves = magnitudes(quantity, own)
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
    legend: dict[str, LegendEntry] = {}
    for i, run in enumerate([runs[REFERENCE]] if is_compared else runs.values()):
        parts = components(quantity, run.array(quantity.name), run.labels)
        for k, group in enumerate(dict.fromkeys(part.group for part in parts)):
            lines = [part for part in parts if part.group == group]
            series = [Series(run.array("time"), part.values, coordinate_look(part.place)) for part in lines]
            caption = with_capital(label_of(run.method)) + (f", {group} axis" if group else "")
            pictures.append(picture(plots.lines([(plot.axis, series)], horizon), f"{name}-{i}-{k}", caption))
            legend |= {part.label: LegendEntry(part.label, coordinate_look(part.place)) for part in lines}
    if not is_compared:
        return Section(pictures, list(legend.values()))
    exact = runs[REFERENCE].array(quantity.name)

    def difference(run: StoredRun) -> Array:
        """The largest over blades, at the samples that both have; of vectors the length."""
        values = run.array(quantity.name)
        n = min(len(values), len(exact))
        return _over_components(sizes(quantity, values[:n] - exact[:n]))

    others = {method: run for method, run in runs.items() if method != REFERENCE}
    errors = _curves(others, quantity.name, difference)
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
    table = PageTable("Extremes in the reference", head, rows, numeric=(1, 2, 3, 4))
    return Section(pictures, list(legend.values()), [table])


def magnitudes(quantity: Quantity, runs: Runs) -> Curves:
    """The largest magnitude of the quantity over its components, of each run that has it."""
    return _curves(runs, quantity.name, lambda run: _over_components(np.abs(run.array(quantity.name))))


def _curves(runs: Runs, name: str, measure: Callable[[StoredRun], Array]) -> Curves:
    """What `measure` makes of each run that has the array `name`, over the run's first samples."""
    values = {method: measure(run) for method, run in runs.items() if name in run}
    return {method: Series(runs[method].array("time")[: len(x)], x, look_of(method)) for method, x in values.items()}


def _over_components(values: Array) -> Array:
    """(n,) of (n, ...): the largest over the components."""
    largest: Array = values.reshape(len(values), -1).max(axis=1)
    return largest


def components(quantity: Quantity, values: Array, labels: Sequence[str] = ()) -> list[Component]:
    """One by one: with blades and axes, a picture per axis and a line per blade; else one picture."""
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


def differences(runs: Runs, reference: StoredRun | None) -> Curves:
    """Largest angle difference (rad) from the reference over the coordinates, at the samples that both have."""
    if reference is None or "angles" not in reference or not len(reference.array("time")):
        return {}
    return _curves(runs, "angles", lambda run: angle_difference(run, reference))


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


def energy_picture(runs: Runs, horizon: float | None = None) -> tuple[Picture | None, list[str]]:
    """Total energy less work, from its start (J), of each run that has it; None without. The methods that are drawn."""
    curves = _curves(runs, "energy_error", lambda run: run.array("energy_error"))
    caption = "Total energy less work, from its start: filled marks gained, open ones lost"
    shown = error_picture(curves, "|energy error| (J)", "energy", caption, horizon, signed=True)
    return shown, list(visible(curves))
