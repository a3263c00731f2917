"""Pictures over time: errors with a curve per run, and stored quantities as their declarations say.

Those that are judged against the reference, such as loads, are drawn of the reference, beside the others' errors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.report.core.elements import LegendEntry, PageTable, Picture, Section
from rotor_mbs.report.core.looks import Look, coordinate_look, label_of, look_of, with_capital
from rotor_mbs.report.core.numbers import number, prefixed
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.plots import time_histories as histories
from rotor_mbs.report.plots.time_histories import LOWEST, Series
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.solution.quantities import Plot, Quantity, known_quantities
from rotor_mbs.solution.quantities import sizes as lengths
from rotor_mbs.solution.trajectory import Array

Runs = Mapping[str, StoredRun]
Curves = dict[str, Series]  # by method


class Component(NamedTuple):
    """group: the picture it is drawn in; label: its line there; place: index of the line's look; values: (n,)."""

    group: str
    label: str
    place: int
    values: Array


def plotted_quantities(scene: StoredScene) -> list[tuple[Quantity, Plot]]:
    """The quantities of the scene with a plot: built in, or of an installed package that its outputs name."""
    parsed = scene_of(scene)
    found = known_quantities(parsed.outputs if parsed is not None else ())
    return [(one, one.plot) for one in found if one.plot is not None and one.is_over_time]


def quantity_sections(scene: StoredScene, runs: Runs, horizon: float | None) -> list[tuple[str, str, Section]]:
    """(id, heading, section) of each such quantity that one of `runs` has."""
    found = []
    for quantity, plot in plotted_quantities(scene):
        own = {method: run for method, run in runs.items() if quantity.name in run}
        if own:
            name = f"quantity-{quantity.name}"
            found.append((name, plot.title, _section(quantity, plot, own, name, horizon)))
    return found


def _section(quantity: Quantity, plot: Plot, runs: Runs, name: str, horizon: float | None) -> Section:
    """Sizes on a logarithmic axis; all runs on one axis where there is one component; else pictures of each run."""
    if plot.logarithmic:
        curves = sizes(quantity, runs)
        shown = error_picture(curves, plot.axis, name, plot.title, horizon) if visible(curves) else None
        return Section([] if shown is None else [shown], run_legend(list(visible(curves))))
    if len(quantity.dimensions) == 1:
        lines = {
            m: Series(run.array("time"), run.array(quantity.name), Look(look_of(m).colour, look_of(m).line, ""))
            for m, run in runs.items()
        }
        ranges = "; ".join(
            f"{label_of(m)} from {number(float(one.values.min()), 3)} to {number(float(one.values.max()), 3)}"
            for m, one in lines.items()
        )
        described = f"{plot.title} over time, in {quantity.units}: {ranges}."
        panels = histories.lines([(plot.axis, list(lines.values()))], horizon)
        return Section(
            [picture(panels, name, plot.title, described)],
            [LegendEntry(label_of(m), one.look) for m, one in lines.items()],
        )
    rule = quantity.judgement
    is_compared = rule is not None and rule.with_reference and REFERENCE in runs
    drawn = {REFERENCE: runs[REFERENCE]} if is_compared else runs
    pictures: list[Picture] = []
    for i, run in enumerate(drawn.values()):
        pictures += _pictures(quantity, plot, run, f"{name}-{i}", horizon)
    first = next(iter(drawn.values()))
    parts = components(quantity, first.array(quantity.name), first.labels)
    legend = {one.label: LegendEntry(one.label, coordinate_look(one.place)) for one in parts}
    if not is_compared:
        return Section(pictures, list(legend.values()))
    errors = _errors(quantity, runs)
    title = "Largest difference from the reference"
    shown = error_picture(errors, f"difference ({quantity.units})", f"{name}-error", title, horizon)
    if shown is not None:
        pictures.append(replace(shown, legend=run_legend(list(visible(errors)))))
    return Section(pictures, list(legend.values()), [_extremes(quantity, runs[REFERENCE].array("time"), parts)])


def sizes(quantity: Quantity, runs: Runs) -> Curves:
    """The largest magnitude of the quantity over its components, of each run that has it."""
    return _curves(runs, quantity.name, lambda run: _largest(np.abs(run.array(quantity.name))))


def _curves(runs: Runs, name: str, measure: Callable[[StoredRun], Array]) -> Curves:
    """What `measure` makes of each run that has the array `name`, over the run's first samples."""
    values = {method: measure(run) for method, run in runs.items() if name in run}
    return {m: Series(runs[m].array("time")[: len(x)], x, look_of(m)) for m, x in values.items()}


def _largest(sizes: Array) -> Array:
    """(n,) of (n, ...): the largest over the components."""
    found: Array = sizes.reshape(len(sizes), -1).max(axis=1)
    return found


def components(quantity: Quantity, values: Array, labels: Sequence[str] = ()) -> list[Component]:
    """One by one: with blades and axes, a picture per axis and a line per blade; else one picture.

    labels: of the coordinates, for a quantity that has them.
    """
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


def _pictures(quantity: Quantity, plot: Plot, run: StoredRun, name: str, horizon: float | None) -> Iterator[Picture]:
    """One per group of components."""
    parts = components(quantity, run.array(quantity.name), run.labels)
    for i, group in enumerate(dict.fromkeys(one.group for one in parts)):
        lines = [one for one in parts if one.group == group]
        series = [Series(run.array("time"), one.values, coordinate_look(one.place)) for one in lines]
        largest = prefixed(max(float(np.abs(one.values).max()) for one in lines), quantity.units)
        caption = with_capital(label_of(run.method)) + (f", {group} axis" if group else "")
        described = f"{plot.title} over time, {caption}: {quantity.long_name}, up to {largest}."
        yield picture(histories.lines([(plot.axis, series)], horizon), f"{name}-{i}", caption, described)


def _errors(quantity: Quantity, runs: Runs) -> Curves:
    """The largest difference from the reference over blades, at the samples that both have; vectors by their length."""
    exact = runs[REFERENCE].array(quantity.name)

    def off(run: StoredRun) -> Array:
        values = run.array(quantity.name)
        n = min(len(values), len(exact))
        return _largest(lengths(quantity, values[:n] - exact[:n]))

    return _curves({method: run for method, run in runs.items() if method != REFERENCE}, quantity.name, off)


def _extremes(quantity: Quantity, time: Array, parts: Sequence[Component]) -> PageTable:
    """Smallest and largest value of each component, with their times."""
    rows = []
    for one in parts:
        places = (int(one.values.argmin()), int(one.values.argmax()))
        cells = [
            text for k in places for text in (prefixed(float(one.values[k]), quantity.units), number(float(time[k]), 4))
        ]
        rows.append([f"{one.label} {one.group}".strip(), *cells])
    head = ("Component", "Smallest", "at (s)", "Largest", "at (s)")
    return PageTable("Extremes in the reference", head, rows, numeric=(1, 2, 3, 4))


def error_picture(
    curves: Curves, axis: str, name: str, caption: str, horizon: float | None = None, others: Sequence[Series] = (),
    *, signed: bool = False,
) -> Picture | None:  # fmt: skip
    """The curves and `others`, which have no marker; None where there is nothing to draw or to note."""
    if not curves:
        return None
    exact = [label_of(method) for method in curves if method not in visible(curves)]
    notes = [f"No curve, because nowhere above 10⁻¹⁸: {'; '.join(exact)}."] if exact else []
    sizes = {label_of(method): float(np.abs(one.values).max()) for method, one in curves.items()}
    largest = "; ".join(f"{label} up to {number(size)}" for label, size in sizes.items())
    panels = histories.errors([*others, *visible(curves).values()], axis, horizon, signed=signed)
    return picture(panels, name, caption, f"{caption}, logarithmic axis: {largest}", notes)


def visible(curves: Curves) -> Curves:
    """The curves that a logarithmic axis can show."""
    return {method: one for method, one in curves.items() if np.abs(one.values).max() > LOWEST}


def run_legend(methods: Sequence[str]) -> list[LegendEntry]:
    """An entry per method, as its error curves are drawn."""
    return [LegendEntry(label_of(method), look_of(method)) for method in methods]


def differences(runs: Runs, reference: StoredRun | None) -> Curves:
    """Largest angle difference (rad) from the reference over the coordinates, at the samples that both have."""
    if reference is None or "angles" not in reference or not len(reference.array("time")):
        return {}
    return _curves(runs, "angles", lambda run: angle_difference(run, reference))


def angle_difference(one: StoredRun, other: StoredRun) -> Array:
    """(common samples,) rad: the largest over the coordinates."""
    n = min(len(one.array("time")), len(other.array("time")))
    found: Array = np.abs(one.array("angles")[:n] - other.array("angles")[:n]).max(axis=1)
    return found


def energy_picture(runs: Runs, horizon: float | None = None) -> tuple[Picture | None, list[str]]:
    """Total energy less work, from its start (J), of each run that has it; None without. The methods that are drawn."""
    curves = _curves(runs, "energy_error", lambda run: run.array("energy_error"))
    caption = (
        "Energy that comes from nothing (total energy less work, from its start): filled marks gained, open ones lost"
    )
    shown = error_picture(curves, "|energy from nothing| (J)", "energy", caption, horizon, signed=True)
    return shown, list(visible(curves))
