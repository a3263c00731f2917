"""Pictures of errors over time, such as the difference from the reference and the energy error. A curve per run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rotor_mbs.report.core.elements import LegendEntry, Picture
from rotor_mbs.report.core.looks import label_of, look_of
from rotor_mbs.report.core.numbers import number
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.plots import time_histories as histories
from rotor_mbs.report.plots.time_histories import LOWEST, Series
from rotor_mbs.store.read import StoredRun

Runs = Mapping[str, StoredRun]
Curves = dict[str, Series]  # by method


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
    gaps = {method: angle_difference(run, reference) for method, run in runs.items() if "angles" in run}
    return {method: Series(reference.array("time")[: len(gap)], gap, look_of(method)) for method, gap in gaps.items()}


def angle_difference(one: StoredRun, other: StoredRun) -> histories.Array:
    """(common samples,) rad: the largest over the coordinates."""
    n = min(len(one.array("time")), len(other.array("time")))
    found: histories.Array = np.abs(one.array("angles")[:n] - other.array("angles")[:n]).max(axis=1)
    return found


def energy_picture(runs: Runs, horizon: float | None = None) -> tuple[Picture | None, list[str]]:
    """Total energy less work, from its start (J), of each run that has it; None without. The methods that are drawn."""
    curves = {
        method: Series(run.array("time"), run.array("energy_error"), look_of(method))
        for method, run in runs.items()
        if "energy_error" in run
    }
    caption = (
        "Energy that comes from nothing (total energy less work, from its start): filled marks gained, open ones lost"
    )
    shown = error_picture(curves, "|energy from nothing| (J)", "energy", caption, horizon, signed=True)
    return shown, list(visible(curves))
