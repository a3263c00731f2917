"""Pictures of a scene in which the printed model stands beside the corrected one: motion, energy, tips."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rotor_mbs.analysis.claims import Claim
from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.methods.catalogue import REFERENCE, is_corrected
from rotor_mbs.report.core.elements import LegendEntry, Picture, Section, line_entry
from rotor_mbs.report.core.looks import Look, coordinate_look, label_of, look_of, with_capital
from rotor_mbs.report.core.numbers import fixed, number, prefixed, with_unit
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.pages.claim_tables import description_of
from rotor_mbs.report.pages.quantities import angle_difference
from rotor_mbs.report.pages.scene_tables import path_table
from rotor_mbs.report.plots import comparisons, paths
from rotor_mbs.report.plots.comparisons import VISIBLE, Mark
from rotor_mbs.report.plots.time_histories import Series, errors
from rotor_mbs.store.read import StoredRun, StoredScene

_PUBLISHED = 2  # published values at most on one picture


def parting(printed: StoredRun, corrected: StoredRun) -> tuple[float | None, float]:
    """When the angles of both first differ by VISIBLE (s; None: never), and the largest difference (rad)."""
    gap = angle_difference(printed, corrected)
    apart = np.flatnonzero(gap > VISIBLE)
    return (float(printed.array("time")[apart[0]]) if len(apart) else None), float(gap.max(initial=0.0))


def at_time(seconds: float) -> str:
    """ "at the start", "at 0.29 s"."""
    return f"at {with_unit(seconds, 's', 2)}" if seconds else "at the start"


def side_look(run: StoredRun) -> Look:
    """The look of a line among few: the printed model is dashed upon the corrected one."""
    look = look_of(run.method)
    return Look(look.colour, "-" if run.method == REFERENCE or is_corrected(run.method) else "--", "")


def key_picture(
    sides: Sequence[StoredRun], claims: Sequence[Claim], horizon: float | None, name: str = "key"
) -> Picture | None:
    """The rotor's angle and the pitch that differs most, printed and corrected, with published values; None without."""
    runs = [run for run in sides if "angles" in run]
    if not runs:
        return None
    blade = _blade_to_show(runs)
    labels = runs[0].labels
    shown = [0, *([blade] if blade else [])]
    panels_of = [
        (
            f"{labels[i]} angle (rad)",
            [Series(r.array("time"), r.array("angles")[:, i], side_look(r)) for r in reversed(runs)],
        )
        for i in shown
    ]
    parted, largest = parting(runs[0], runs[1]) if len(runs) > 1 else (None, 0.0)
    published = _published(claims, shown)
    panels = comparisons.departure(panels_of, [mark for mark, _ in published], horizon, parted)
    caption = " ".join([_parting_text(runs, parted, largest), *(text for _, text in published)])
    ranges = [
        f"{label_of(r.method)}: {labels[i]} from {number(float(r.array('angles')[:, i].min()), 3)} to "
        f"{number(float(r.array('angles')[:, i].max()), 3)} rad"
        for r in runs for i in shown
    ]  # fmt: skip
    legend = [LegendEntry(label_of(r.method), side_look(r), 2.4 if side_look(r).line == "-" else 1.3) for r in runs]
    if horizon is not None and horizon < float(runs[-1].array("time")[-1]):
        legend.append(line_entry(f"horizon {with_unit(horizon, 's', 3)}", line="--"))
    if published:
        legend.append(line_entry("published", line=":"))
    return picture(panels, name, caption, f"{caption} {'; '.join(ranges)}.", legend=legend)


def _blade_to_show(runs: Sequence[StoredRun]) -> int:
    """The coordinate of the pitch that differs most, or moves most; 0 where no blade pitches."""
    angles = [run.array("angles") for run in runs]
    count = min(map(len, angles))
    moved = np.abs(angles[0][:count] - angles[1][:count] if len(angles) > 1 else angles[0])[:, 1:].max(
        axis=0, initial=0.0
    )
    if not moved.size or moved.max() < 1e-6:
        moved = np.abs(angles[-1][:, 1:]).max(axis=0, initial=0.0)
    return 1 + int(moved.argmax()) if moved.size and moved.max() > 1e-6 else 0


def _parting_text(runs: Sequence[StoredRun], parted: float | None, largest: float) -> str:
    if len(runs) < 2:
        return f"{with_capital(label_of(runs[0].method))}: angles over time."
    if parted is None:
        return f"Printed and corrected model never differ by {VISIBLE:g} rad: by {with_unit(largest, 'rad')} at most."
    most = with_unit(largest, "rad")
    return f"The models are {VISIBLE:g} rad apart {at_time(parted)}; their angles differ by up to {most}."


def _published(claims: Sequence[Claim], shown: Sequence[int]) -> list[tuple[Mark, str]]:
    """Published extremes of the angles of the coordinates `shown`: heights in their panels, what each model has."""
    found = []
    for claim in claims:
        item, of = claim.published, claim.published.of
        if not item.is_number or of is None or of.quantity != "angle" or of.coordinate not in shown:
            continue
        values = (fixed(value, item.decimals) for value in (item.value, claim.printed.value, claim.corrected.value))
        published, printed, corrected = values
        mark = Mark(shown.index(of.coordinate), item.value, f"published {published} rad")
        text = f"{with_capital(description_of(of))}, rad: published {published}, as printed {printed}"
        found.append((mark, f"{text}, corrected {corrected}."))
    return found[:_PUBLISHED]


def tips_section(stored: StoredScene, runs: Mapping[str, StoredRun], horizon: float | None) -> Section:
    """Paths in space as the paper draws them; offset over azimuth; distance of printed from corrected tips.

    runs: printed and corrected, by heading, those that have tips.
    """
    if not runs:
        return Section()
    blades = next(iter(runs.values())).array("tip").shape[1]
    pictures = [_path_picture(f"paths-{i}", run) for i, run in enumerate(runs.values())]
    scene = scene_of(stored)
    lines = [LegendEntry(f"blade {i}", coordinate_look(i)) for i in range(1, blades + 1)]
    moved = any(float(np.abs(run.array("tip")[:, :, 1]).max()) > 1e-9 for run in runs.values())
    if scene is not None and moved:
        for i, run in enumerate(run for run in runs.values() if "angles" in run):
            panels = comparisons.offsets_over_azimuth(run.array("angles"), run.array("tip"), scene.phases)
            caption = f"{with_capital(label_of(run.method))}: tips out of the plane of rotation"
            reach = prefixed(float(np.abs(run.array("tip")[:, :, 1]).max()), "m")
            pictures.append(picture(panels, f"offset-{i}", caption, f"{caption}, by up to {reach}."))
    if len(runs) > 1:
        one, other = runs.values()
        count = min(len(one.array("time")), len(other.array("time")))
        time = one.array("time")[:count]
        gaps = np.linalg.norm(one.array("tip")[:count] - other.array("tip")[:count], axis=2)
        series = [Series(time, np.maximum(gap, 1e-6), coordinate_look(1 + i)) for i, gap in enumerate(gaps.T)]
        panels = errors(series, "printed − corrected (m)", horizon)
        caption = f"Distance of each printed tip from the corrected one: up to {prefixed(float(gaps.max()), 'm')}"
        pictures.append(picture(panels, "tip-difference", caption, f"{caption}."))
    ends = [line_entry("blade at the start", line="--"), line_entry("at the end"), line_entry("shaft", width=4)]
    return Section(pictures, [*lines, *ends], [path_table(runs)])


def _path_picture(name: str, run: StoredRun) -> Picture:
    tip, label = run.array("tip"), label_of(run.method)
    text = f"{label}: paths of the blade tips in space with the blades at the start and at the end"
    if "angles" in run:
        turned = float(run.array("angles")[-1, 0] - run.array("angles")[0, 0])
        text += f"; the rotor ends {number(turned, 3)} rad from its start"
    text += f"; tips leave the plane of rotation by up to {prefixed(float(np.abs(tip[:, :, 1]).max()), 'm')}."
    return picture(paths.paths(tip), name, with_capital(label), text)
