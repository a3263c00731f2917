"""Pictures of the stored quantities that say themselves how they are drawn, by their declarations alone."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import numpy as np

from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.report.core.elements import LegendEntry, Section, line_entry
from rotor_mbs.report.core.looks import coordinate_look, label_of, look_of, with_capital
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.pages.compared_quantities import compared_section, is_compared
from rotor_mbs.report.pages.error_pictures import Curves, error_picture, line_picture, run_legend, visible
from rotor_mbs.report.plots import time_histories as histories
from rotor_mbs.report.plots.time_histories import Series
from rotor_mbs.solution.quantities import Plot, Quantity, known_quantities
from rotor_mbs.store.read import StoredRun, StoredScene

Runs = Mapping[str, StoredRun]


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
        if not own:
            continue
        name = f"quantity-{quantity.name}"
        if plot.logarithmic:
            curves = sizes(quantity, own)
            shown = error_picture(curves, plot.axis, name, plot.title, horizon)
            section = Section(
                [shown] if shown is not None and visible(curves) else [], run_legend(list(visible(curves)))
            )
        elif len(quantity.dimensions) == 1:
            legend = [line_entry(label_of(m), look_of(m).colour, look_of(m).line) for m in own]
            lines = {
                label_of(m): Series(run.array("time"), run.array(quantity.name), look_of(m)) for m, run in own.items()
            }
            section = Section([line_picture(lines, plot.axis, name, plot.title, horizon, quantity.units)], legend)
        elif is_compared(quantity, own):
            section = compared_section(quantity, plot, own, name, horizon)
        else:
            section = _components(quantity, plot, own, name, horizon)
        found.append((name, plot.title, section))
    return found


def sizes(quantity: Quantity, runs: Runs) -> Curves:
    """The largest magnitude of the quantity over its components, of each run that has it."""
    return {
        method: Series(run.array("time"), np.abs(_columns(run, quantity)).max(axis=1), look_of(method))
        for method, run in runs.items()
        if quantity.name in run
    }


def _columns(run: StoredRun, quantity: Quantity) -> histories.Array:
    """(n, components)."""
    values = run.array(quantity.name)
    return values.reshape(len(values), -1)


def _components(quantity: Quantity, plot: Plot, runs: Runs, name: str, horizon: float | None) -> Section:
    """A picture per run, a line per component."""
    first = 1 if quantity.dimensions[1] == "blade" else 0  # a blade has the look of its pitch
    pictures = []
    for i, (method, run) in enumerate(runs.items()):
        columns = _columns(run, quantity).T
        series = [Series(run.array("time"), x, coordinate_look(first + k)) for k, x in enumerate(columns)]
        caption = with_capital(label_of(method))
        described = f"{plot.title} over time, {caption}: {quantity.long_name}, in {quantity.units}."
        pictures.append(picture(histories.lines(series, plot.axis, horizon), f"{name}-{i}", caption, described))
    run = next(iter(runs.values()))
    lengths = run.array(quantity.name).shape[1:]
    labels = {
        "coordinate": run.labels,
        "blade": [f"blade {i + 1}" for i in range(max(lengths))],
        "axis": ["x", "y", "z"],
    }
    each = [labels[dimension][:length] for dimension, length in zip(quantity.dimensions[1:], lengths, strict=True)]
    names = [" ".join(one) for one in product(*each)]
    return Section(pictures, [LegendEntry(label, coordinate_look(first + k)) for k, label in enumerate(names)])
