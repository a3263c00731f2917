"""Pictures over time: errors with a curve per run, and stored quantities as their declarations say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.models.lagrange.defects import interval_defects
from rotor_mbs.report import plots
from rotor_mbs.report.core.canvas import Panels
from rotor_mbs.report.core.elements import PageTable, Picture, Section
from rotor_mbs.report.core.looks import Look, coordinate_look, label_of, look_of, with_capital
from rotor_mbs.report.core.numbers import number, prefixed
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.plots import LOWEST, Series
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.quantities import Plot, Quantity, known_quantities, sizes
from rotor_mbs.solution.trajectory import Array

Runs = Mapping[str, StoredRun]
VISIBLE = 0.05  # rad: what one can see in a figure of the paper's size


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
            curves = over_time(own, {m: _largest(np.abs(run.array(quantity.name))) for m, run in own.items()})
            section = Section(error_picture(curves, plot.axis, name, plot.title, horizon) if visible(curves) else [])
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
        panels = component_panels(quantity, plot, run.array("time"), run.array(quantity.name), run.labels, horizon)
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
    for panel, look, values in components(quantity, exact, runs[REFERENCE].labels):
        row = [f"{look.label} {panel}".strip()]
        for k in (int(values.argmin()), int(values.argmax())):
            row += [prefixed(float(values[k]), quantity.units), number(float(time[k]), 4)]
        rows.append(row)
    head = ("Component", "Smallest", "at (s)", "Largest", "at (s)")
    return Section(pictures, [PageTable("Extremes in the reference", head, rows)])


def component_panels(
    quantity: Quantity, plot: Plot, time: Array, values: Array, labels: Sequence[str] = (), horizon: float | None = None
) -> Panels:
    """A panel per axis with a line per blade, or one panel with a line per component."""
    rows: dict[str, list[Series]] = {}
    for panel, look, component in components(quantity, values, labels):
        rows.setdefault(f"{panel} {plot.axis}".strip(), []).append(Series(time, component, look))
    return plots.lines(list(rows.items()), horizon, height=2.3 if len(rows) == 1 else 1.3)


def components(quantity: Quantity, values: Array, labels: Sequence[str] = ()) -> list[tuple[str, Look, Array]]:
    """(panel, look, values (n,)) of each component: with blades and axes a panel per axis, else one panel."""
    first = 1 if quantity.dimensions[1] == "blade" else 0  # a blade has the look of its pitch
    names = {"coordinate": labels, "axis": "xyz"}.get(quantity.dimensions[1])
    if names is None:
        names = [f"blade {i + 1}" for i in range(values.shape[1])]
    looks = [coordinate_look(first + i, label) for i, label in enumerate(names[: values.shape[1]])]
    if values.ndim == 2:
        return [("", look, values[:, i]) for i, look in enumerate(looks)]
    return [(axis, look, values[:, i, k]) for i, look in enumerate(looks) for k, axis in enumerate("xyz")]


def over_time(runs: Runs, values: Mapping[str, Array]) -> list[Series]:
    """The values (n,) of runs, by method, over their first samples."""
    return [Series(runs[method].array("time")[: len(x)], x, look_of(method)) for method, x in values.items()]


def _largest(values: Array) -> Array:
    """(n,) of (n, ...): the largest over the components."""
    largest: Array = values.reshape(len(values), -1).max(axis=1)
    return largest


def error_picture(
    curves: Sequence[Series], axis: str, name: str, caption: str, horizon: float | None = None,
    others: Sequence[Series] = (), notes: Sequence[str] = (), *, signed: bool = False,
) -> list[Picture]:  # fmt: skip
    """A picture of the curves and of `others`, which have no marker; none where there is no curve."""
    if not curves:
        return []
    shown = visible(curves)
    exact = [curve.look.label for curve in curves if not visible([curve])]
    notes = [*notes, *([f"No curve, because nowhere above 10⁻¹⁸: {'; '.join(exact)}."] if exact else [])]
    return [picture(plots.errors([*others, *shown], axis, horizon, signed=signed), name, caption, notes)]


def visible(curves: Sequence[Series]) -> list[Series]:
    """The curves that a logarithmic axis can show."""
    return [curve for curve in curves if np.abs(curve.values).max() > LOWEST]


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
