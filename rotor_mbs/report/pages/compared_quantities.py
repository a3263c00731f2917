"""Quantities judged against the reference, such as loads: components over time, errors of the others, extremes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.report.core.elements import LegendEntry, PageTable, Picture, Section
from rotor_mbs.report.core.looks import coordinate_look, label_of, look_of, with_capital
from rotor_mbs.report.core.numbers import number, prefixed
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.pages.error_pictures import Curves, error_picture, run_legend, visible
from rotor_mbs.report.plots import time_histories as histories
from rotor_mbs.report.plots.time_histories import Array, Series
from rotor_mbs.solution.quantities import Plot, Quantity, sizes
from rotor_mbs.store.read import StoredRun

Runs = Mapping[str, StoredRun]
_AXES = ("x", "y", "z")


class _Component(NamedTuple):
    """group: the picture it is drawn in; label: its line there; place: index of the line's look; values: (n,)."""

    group: str
    label: str
    place: int
    values: Array


def is_compared(quantity: Quantity, runs: Runs) -> bool:
    """Whether the quantity has a reference among `runs` that the others are measured by."""
    rule = quantity.judgement
    return rule is not None and rule.with_reference and len(quantity.dimensions) > 1 and REFERENCE in runs


def compared_section(quantity: Quantity, plot: Plot, runs: Runs, name: str, horizon: float | None) -> Section:
    """The reference's components over time, the errors of the other runs, and the reference's extremes."""
    reference = runs[REFERENCE]
    components = list(_components(quantity, reference.array(quantity.name)))
    groups = list(dict.fromkeys(one.group for one in components))
    pictures = [
        _picture(quantity, plot, reference, [one for one in components if one.group == group], f"{name}-{i}", horizon)
        for i, group in enumerate(groups)
    ]
    lines = [one for one in components if one.group == groups[0]]
    errors = _errors(quantity, runs)
    differences = error_picture(
        errors, f"difference ({quantity.units})", f"{name}-error", "Largest difference from the reference", horizon
    )
    if differences is not None:
        shown = Picture(differences.svg, differences.caption, differences.notes, run_legend(list(visible(errors))))
        pictures.append(shown)
    legend = [LegendEntry(one.label, coordinate_look(one.place)) for one in lines]
    return Section(pictures, legend, [_extremes(quantity, reference.array("time"), components)])


def _components(quantity: Quantity, values: Array) -> Iterator[_Component]:
    """One by one: with blades and axes, a picture per axis and a line per blade; else one picture."""
    if quantity.dimensions[1] == "axis":
        yield from (_Component("", axis, k, values[:, k]) for k, axis in enumerate(_AXES))
        return
    for blade in range(values.shape[1]):
        label = f"blade {blade + 1}"
        if values.ndim == 2:
            yield _Component("", label, 1 + blade, values[:, blade])
        else:
            yield from (_Component(axis, label, 1 + blade, values[:, blade, k]) for k, axis in enumerate(_AXES))


def _picture(
    quantity: Quantity, plot: Plot, run: StoredRun, lines: list[_Component], name: str, horizon: float | None
) -> Picture:
    largest = max(float(np.abs(one.values).max()) for one in lines)
    factor, prefix = next(((f, p) for f, p in ((1e6, "M"), (1e3, "k")) if largest >= f), (1.0, ""))
    time = run.array("time")
    series = [Series(time, one.values / factor, coordinate_look(one.place)) for one in lines]
    axis = plot.axis.replace(f"({quantity.units})", f"({prefix}{quantity.units})")
    caption = with_capital(", ".join(filter(None, (label_of(run.method), lines[0].group and f"{lines[0].group} axis"))))
    described = f"{plot.title} over time, {caption}: {quantity.long_name}, up to {prefixed(largest, quantity.units)}."
    return picture(histories.lines(series, axis, horizon), name, caption, described)


def _errors(quantity: Quantity, runs: Runs) -> Curves:
    """The largest difference from the reference over blades, at the samples that both have; vectors by their length."""
    exact, found = runs[REFERENCE].array(quantity.name), {}
    for method, run in runs.items():
        if method != REFERENCE:
            values = run.array(quantity.name)
            n = min(len(values), len(exact))
            off = sizes(quantity, values[:n] - exact[:n]).reshape(n, -1).max(axis=1)
            found[method] = Series(run.array("time")[:n], off, look_of(method))
    return found


def _extremes(quantity: Quantity, time: Array, components: list[_Component]) -> PageTable:
    """Smallest and largest value of each component, with their times."""
    rows = []
    for one in components:
        low, high = int(one.values.argmin()), int(one.values.argmax())
        ends = [(prefixed(float(one.values[k]), quantity.units), number(float(time[k]), 4)) for k in (low, high)]
        rows.append([" ".join(filter(None, (one.label, one.group))), *ends[0], *ends[1]])
    head = ("Component", "Smallest", "at (s)", "Largest", "at (s)")
    return PageTable("Extremes in the reference", head, rows, numeric=(1, 2, 3, 4))
