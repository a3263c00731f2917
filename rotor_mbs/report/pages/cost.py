"""Error against run time as a section of a page: the diagram, its legend, and the cheapest method for an accuracy."""

from __future__ import annotations

from collections.abc import Sequence

from rotor_mbs.analysis.work_precision import TARGETS_RAD, fastest, own_points, succeeded
from rotor_mbs.report.core.elements import LegendEntry, Picture, Section, line_entry, mark_entry
from rotor_mbs.report.core.looks import label_of, look_of
from rotor_mbs.report.core.numbers import prefixed
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.pages.bench_tables import target_text
from rotor_mbs.report.plots.work_precision import FRONT_COLOUR, diagram, has_visible_uncertainty
from rotor_mbs.store.read import StoredScene
from rotor_mbs.store.records import Record


def cost_section(scene: StoredScene, curves: Sequence[Record]) -> Section:
    """The curves measured on the scene, else its own runs, a point each; empty where no run has an error."""
    known = [*curves] or own_points(scene)
    shown = cost_picture(known, f"Error against run time, {scene.name}")
    if shown is None:
        return Section()
    notes = [cheapest(known)]
    if not curves:
        notes.append("Each point is a run of this file, timed while others ran beside it: good to a factor of two.")
    return Section([shown], cost_legend(known), notes=notes)


def cost_picture(curves: Sequence[Record], caption: str) -> Picture | None:
    """The diagram; None where no point stands on it."""
    if not any(succeeded(curve).any() for curve in curves):
        return None
    described = f"{caption}. {cheapest(curves)}"
    return picture(diagram(curves, height=3.4), "cost", f"{caption}: the lower right corner is best", described)


def cost_legend(curves: Sequence[Record]) -> list[LegendEntry]:
    """Methods, front, failed points and uncertainty, as far as they are in the diagram."""
    entries = [LegendEntry(label_of(curve.name), look_of(curve.name)) for curve in curves]
    entries.append(line_entry("best of all (Pareto front)", FRONT_COLOUR, width=6.0))
    if any(not succeeded(curve).all() for curve in curves):
        entries.append(mark_entry("failed: drawn at its time", "x"))
    if has_visible_uncertainty(curves):
        entries.append(line_entry("uncertainty of the reference", width=8.0))
    return entries


def cheapest(curves: Sequence[Record]) -> str:
    """ "Cheapest within 10⁻³ rad: closed form, Taylor (lagrange/taylor), 3 ms; within 10⁻⁶ rad: ..."."""
    parts = []
    for target in TARGETS_RAD:
        found = fastest(curves, target)
        best = "none of these"
        if found:
            curve, reach = found[0]
            best = f"{label_of(curve.name)} ({curve.name}), {prefixed(reach.seconds, 's', 2)}"
        parts.append(f"within {target_text(target)}: {best}")
    return f"Cheapest method {'; '.join(parts)}."
