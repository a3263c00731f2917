"""A scene's errors in the stability report: difference from the reference, energy, joint gaps, error over the step.

Reads the store alone; judges nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from markupsafe import Markup

from rotor_mbs.report.core import canvas, svg
from rotor_mbs.report.core.elements import Picture, Section, run_sample
from rotor_mbs.report.names import look_of, name_of
from rotor_mbs.report.pages import stability_texts as words
from rotor_mbs.report.plots import time_histories as figures
from rotor_mbs.report.plots.time_histories import Series
from rotor_mbs.store.read import StoredRun, StoredScene
from rotor_mbs.store.stability import Record

# What is drawn on a log axis: above nothing, below what a run away would make of the picture.
_LOWEST, _HIGHEST = 1e-18, 1e4

Curves = dict[str, Series]
Runs = Mapping[str, StoredRun]


def errors_over_time(scene: StoredScene, runs: Runs) -> Section:
    """Differences, energies and gaps of the runs that left more than their start; the key names what has a curve."""
    long = {name: run for name, run in runs.items() if len(run.array("time")) > 1}
    difference, energy, gaps = _differences(scene, long), _energies(long), _gaps(long)
    pictures = []
    if difference:
        known = [float(run.attributes["horizon_s"]) for run in long.values() if "horizon_s" in run.attributes]
        panels = figures.difference(list(difference.values()), None, None, known[0] if known else None)
        pictures.append(picture(panels, "difference", words.DIFFERENCE_CAPTION))
    if energy:
        panels = figures.energy_errors(list(energy.values()), relative=True, horizon=None)
        pictures.append(picture(panels, "energy", words.ENERGY_CAPTION))
    if gaps:
        pictures.append(picture(_gap_panel(list(gaps.values())), "gaps", words.GAPS_CAPTION))
    named = [name for name in runs if name in difference or name in energy or name in gaps]
    return Section("errors", words.ERRORS, pictures, [run_sample(name_of(name), look_of(name)) for name in named])


def error_over_step(ladders: Sequence[Record]) -> Section:
    drawn = {r.method: r for r in ladders if np.isfinite(r.arrays["angle_error_max"]).any()}
    if not drawn:
        return Section("steps", words.STEPS)
    panels = canvas.panels((2.8,), words.STEP_AXIS)
    axes, lowest, highest = panels.axes[0], 1e-8, 1e-6
    for name, record in drawn.items():
        errors = np.clip(record.arrays["angle_error_max"], _LOWEST, _HIGHEST)
        lowest, highest = min(lowest, float(np.nanmin(errors))), max(highest, float(np.nanmax(errors)))
        one, step = look_of(name), record.arrays["step"]
        axes.plot(
            step, errors, color=one.colour, linestyle=one.line, marker=one.marker, markersize=4.2,
            markerfacecolor="white",
        )  # fmt: skip
    axes.set_xscale("log")
    canvas.log_axis(axes, lowest, highest)
    axes.axhline(1e-6, color="#666666", linewidth=0.8, linestyle=":")
    axes.set_ylabel(words.STEP_ERROR_AXIS)
    legend = [run_sample(name_of(name), look_of(name)) for name in drawn]
    return Section("steps", words.STEPS, [picture(panels, "steps", words.STEPS_CAPTION)], legend)


def picture(panels: canvas.Panels, name: str, caption: str) -> Picture:
    text = svg.embedded(canvas.svg_text(panels.figure), name, caption, caption)
    return Picture(Markup(text), caption)


def _differences(scene: StoredScene, runs: Runs) -> Curves:
    reference = scene.reference
    if reference is None or len(reference.array("time")) < 2:
        return {}
    right = reference.array("angles")
    found = {}
    for name, run in runs.items():
        n = min(len(right), len(run.array("time")))
        error = np.abs(run.array("angles")[:n] - right[:n]).max(axis=1)
        found[name] = Series(run.array("time")[:n], error, look_of(name))
    return _shown(found)


def _energies(runs: Runs) -> Curves:
    """Of the energy scale."""
    found = {}
    for name, run in runs.items():
        if "energy_error" in run:
            scale = float(run.attributes.get("energy_scale_J", 0.0)) or 1.0
            found[name] = Series(run.array("time"), np.abs(run.array("energy_error")) / scale, look_of(name))
    return _shown(found)


def _gaps(runs: Runs) -> Curves:
    return _shown(
        {
            name: Series(run.array("time"), run.array("constraint_error"), look_of(name))
            for name, run in runs.items()
            if "constraint_error" in run
        }
    )


def _shown(curves: Curves) -> Curves:
    """Those that a log axis shows at all, cut off where a run away would make nothing of the others."""
    return {
        name: one._replace(values=np.minimum(one.values, _HIGHEST))
        for name, one in curves.items()
        if one.values.max() > figures.LOWEST
    }


def _gap_panel(series: Sequence[Series]) -> canvas.Panels:
    panels = canvas.panels((2.7,), "time (s)")
    axes, highest = panels.axes[0], 1e-12
    for one in series:
        highest = max(highest, float(one.values.max()))
        time, values = figures.thin(one.time, np.maximum(one.values, _LOWEST))
        axes.plot(time, values, color=one.look.colour, linestyle=one.look.line)
    canvas.log_axis(axes, _LOWEST, highest)
    axes.set_ylabel(words.GAP_AXIS)
    return panels
