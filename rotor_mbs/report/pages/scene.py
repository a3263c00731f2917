"""The sections of a scene's page: pictures and tables from its stored runs. Knows no HTML and writes no file.

Each section is made of what the scene has; one that has nothing is left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from rotor_mbs.analysis import methods
from rotor_mbs.analysis.claims import Claim
from rotor_mbs.report import texts
from rotor_mbs.report.core import canvas, svg
from rotor_mbs.report.core.elements import Picture, Sample, Section, line_sample, mark_sample, run_sample
from rotor_mbs.report.names import GREY, Look, coordinate_look, look_of, name_of
from rotor_mbs.report.pages import claims as claim_tables
from rotor_mbs.report.pages import scene_tables as metrics
from rotor_mbs.report.pages.viewer import viewer
from rotor_mbs.report.plots import time_histories as figures
from rotor_mbs.store.layout import REFERENCE
from rotor_mbs.store.read import StoredRun, StoredScene

Array = NDArray[Any]
_ENERGIES = ("kinetic_energy", "potential_energy", "work")
_ROUNDING = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Drawn:
    """The runs of a scene that are drawn.

    printed, right   the printed model and what stands for the right one
    others           runs of the right models other than `right`
    """

    scene: StoredScene
    printed: StoredRun | None
    right: StoredRun | None
    others: dict[str, StoredRun]
    horizon: float | None

    @classmethod
    def of(cls, scene: StoredScene) -> Drawn:
        printed, right = methods.printed_run(scene), methods.right_run(scene)
        good = {n: run for n, run in methods.right_runs(scene).items() if methods.has_samples(run)}
        others = {name: run for name, run in good.items() if right is None or name != right.method}
        return cls(scene, printed, right, others, metrics.horizon(scene))

    @property
    def sides(self) -> list[StoredRun]:
        """Printed, then right, as they stand side by side."""
        return [run for run in (self.printed, self.right) if run is not None]

    @property
    def compared(self) -> dict[str, StoredRun]:
        """The runs whose errors are drawn; the reference is none of them."""
        runs = {run.method: run for run in self.sides} | self.others
        return {name: run for name, run in runs.items() if name != REFERENCE}


def lead(scene: StoredScene) -> list[str]:
    """What its page shows, in sentences."""
    printed, right = methods.printed_run(scene), methods.right_runs(scene).values()
    departure = gain = ended = None
    if printed is not None:
        departure, gain = (metrics.metric(printed, name) for name in ("angle_error_whole", "energy_gain_J"))
        if printed.status not in ("ok", "inaccurate"):
            ended = float(printed.array("time")[-1])
    errors = [
        error for run in right if run.status == "ok" and (error := metrics.metric(run, "angle_error_max")) is not None
    ]
    return texts.scene_lead(departure, metrics.horizon(scene), gain, ended, max(errors, default=None))


def sections(scene: StoredScene, claims: Sequence[Claim], conditions: Sequence[str]) -> list[Section]:
    """All sections that have something to show, in their order on the page."""
    drawn = Drawn.of(scene)
    tables = [claim_tables.number_table(claims), claim_tables.claim_table(claims)]
    found = [
        Section("said", texts.PAPER_SAYS, tables=[table for table in tables if table.rows], notes=conditions),
        paths(drawn),
        motion(drawn),
        difference(drawn),
        energy(drawn),
        Section("metrics", texts.METRICS, tables=[metrics.metrics_table(scene)], notes=metrics.metrics_notes(scene)),
    ]
    return [section for section in found if section.has_content]


def motion(drawn: Drawn) -> Section:
    """Angles above, rates below, as the paper plots them; printed model beside the right ones."""
    runs = [run for run in drawn.sides if "angles" in run or "rates" in run]
    if not runs:
        return Section("motion", texts.MOTION)
    pictures: list[Picture] = []
    marked: dict[str, StoredRun] = {}
    for run in runs:
        others = drawn.others if run is drawn.right else {}
        marked |= {n: other for n, other in others.items() if "angles" in other or "rates" in other}
        pictures.append(_motion_picture(drawn, run, marked))
    labels = runs[0].labels
    legend = [line_sample(label, *coordinate_look(i)) for i, label in enumerate(labels)]
    legend += [mark_sample(name_of(name), look_of(name)) for name in marked]
    pictures += _rotor_picture(drawn)
    table = metrics.range_table({_heading(drawn, run): run for run in runs})
    return Section("motion", texts.MOTION, pictures, [*legend, *_horizon_sample(drawn)], [table])


def _heading(drawn: Drawn, run: StoredRun) -> str:
    return texts.PRINTED_COLUMN if run is drawn.printed else texts.RIGHT_COLUMN


def _motion_picture(drawn: Drawn, run: StoredRun, marked: dict[str, StoredRun]) -> Picture:
    marks = [(_motion(other), look_of(name)) for name, other in marked.items()]
    plain = _motion(run)
    name = name_of(run.method)
    ranges = []
    if plain.angles is not None:
        extremes = zip(run.labels, plain.angles.min(axis=0), plain.angles.max(axis=0), strict=False)
        ranges = [(label, float(low), float(high)) for label, low, high in extremes]
    pairs = ((plain.angles, texts.cut_angles_note), (plain.rates, texts.cut_rates_note))
    notes = [note(float(np.abs(x).max())) for x, note in pairs if x is not None and figures.is_cut(x)]
    return _picture(
        figures.motion(plain, marks, drawn.horizon),
        f"motion-{len(marked)}-{'p' if run is drawn.printed else 'r'}",
        texts.motion_caption(name, [name_of(other) for other in marked]),
        texts.motion_described(name, ranges),
        notes,
    )


def _rotor_picture(drawn: Drawn) -> Iterator[Picture]:
    """Where both sides are there: beside pitches of many turns the rotor is a flat line."""
    runs = [run for run in drawn.sides if "angles" in run]
    if len(runs) < 2:
        return
    series = [
        figures.Series(run.array("time"), run.array("angles")[:, 0], look)
        for run, look in zip(runs, (Look("#000000", "-", ""), Look("#0072b2", "--", "")), strict=True)
    ]
    names = [name_of(run.method) for run in runs]
    extremes = [
        (name, float(one.values.min()), float(one.values.max())) for name, one in zip(names, series, strict=True)
    ]
    yield _picture(
        figures.rotor(series, drawn.horizon), "rotor", texts.rotor_caption(*names),
        texts.motion_described(texts.ROTOR_ALONE, extremes),
    )  # fmt: skip


def _motion(run: StoredRun) -> figures.Motion:
    arrays = (run.array(name) if name in run else None for name in ("angles", "rates"))
    return figures.Motion(run.array("time"), *arrays)


def difference(drawn: Drawn) -> Section:
    """Each run's largest angle difference from the reference."""
    reference = drawn.scene.reference
    if reference is None or "angles" not in reference or not methods.has_samples(reference):
        return Section("difference", texts.DIFFERENCE)
    series, exact, described = [], [], []
    for name, run in drawn.compared.items():
        if "angles" not in run:
            continue
        one = figures.Series(*angle_difference(run, reference), look_of(name))
        described.append((name_of(name), float(one.values.max())))
        if one.values.max() > figures.LOWEST:
            series.append(one)
        else:
            exact.append(name_of(name))
    if not described:
        return Section("difference", texts.DIFFERENCE)
    notes = [texts.exact_note(exact)] if exact else []
    legend = [run_sample(name_of(n), look_of(n)) for n in drawn.compared if name_of(n) not in exact]
    carried, uncertainty = carried_rounding(reference), None
    if carried is not None:
        legend.append(line_sample(texts.CARRIED, GREY, ":"))
    if "angle_uncertainty" in reference:
        uncertainty = reference.array("time"), reference.array("angle_uncertainty")
        if float(uncertainty[1].max()) > figures.LOWEST:
            legend.append(line_sample(texts.UNCERTAINTY, GREY, "-"))
        else:
            notes.append(texts.below_axis_note(float(uncertainty[1].max())))
    shown = _picture(
        figures.difference(series, carried, uncertainty, drawn.horizon),
        "difference", texts.DIFFERENCE_CAPTION, texts.difference_described(described), notes,
    )  # fmt: skip
    table = metrics.difference_table(drawn.compared)
    return Section("difference", texts.DIFFERENCE, [shown], [*legend, *_horizon_sample(drawn)], [table])


def angle_difference(run: StoredRun, reference: StoredRun) -> tuple[Array, Array]:
    """(time, rad) over the samples that both have: largest over the coordinates."""
    n = min(len(run.array("time")), len(reference.array("time")))
    gap = np.abs(run.array("angles")[:n] - reference.array("angles")[:n])
    return reference.array("time")[:n], gap.max(axis=1)


def carried_rounding(reference: StoredRun) -> tuple[Array, Array] | None:
    """(time, rad): what rounding the initial state to a double has grown to, by the stored error growth."""
    if "error_growth" not in reference:
        return None
    growth = np.maximum(np.maximum.accumulate(reference.array("error_growth")), 1.0)
    return reference.array("time"), _ROUNDING * growth


def energy(drawn: Drawn) -> Section:
    """Energies of the printed and of the right model; energy error of all."""
    runs = [run for run in drawn.sides if all(name in run for name in _ENERGIES)]
    pictures = [_energy_picture(drawn, run) for run in runs]
    errors = {n: run for n, run in ({r.method: r for r in drawn.sides} | drawn.others).items() if "energy_error" in run}
    if not errors:
        return Section("energy", texts.ENERGY)
    scales = {name: metrics.metric(run, "energy_scale_J") or 0.0 for name, run in errors.items()}
    relative = all(scales.values())
    series, exact, described = [], [], []
    for name, run in errors.items():
        values = np.abs(run.array("energy_error")) / (scales[name] if relative else 1.0)
        described.append((name_of(name), float(values.max())))
        if values.max() > figures.LOWEST:
            series.append(figures.Series(run.array("time"), values, look_of(name)))
        else:
            exact.append(name_of(name))
    notes = [texts.exact_energy_note(exact)] if exact else []
    pictures.append(
        _picture(
            figures.energy_errors(series, relative, drawn.horizon),
            "energy-error",
            texts.ENERGY_ERROR_CAPTION,
            texts.energy_errors_described(described),
            notes,
        )
    )
    names = (texts.KINETIC, texts.POTENTIAL, texts.TOTAL)
    legend = [line_sample(name, *look) for name, look in zip(names, figures.ENERGY_LOOKS, strict=True)] if runs else []
    legend += [run_sample(name_of(name), look_of(name)) for name in errors if name_of(name) not in exact]
    return Section("energy", texts.ENERGY, pictures, [*legend, *_horizon_sample(drawn)], [metrics.energy_table(errors)])


def _energy_picture(drawn: Drawn, run: StoredRun) -> Picture:
    kinetic, potential, work = (run.array(name) for name in _ENERGIES)
    total = kinetic + potential - work
    # What a run that runs away may reach is no scale; the scene's own is.
    scale = metrics.metric(drawn.right or run, "energy_scale_J") or 0.0
    largest = max(float(np.abs(curve).max()) for curve in (kinetic, potential, total))
    name = name_of(run.method)
    return _picture(
        figures.energies(run.array("time"), (kinetic, potential, total), scale),
        f"energy-{'p' if run is drawn.printed else 'r'}",
        name.capitalize(),
        texts.energies_described(name, float(total[0]), float(total[-1])),
        [texts.cut_energy_note(largest) if 0.0 < 3.0 * scale < largest else ""],
    )


def paths(drawn: Drawn) -> Section:
    """Paths of the tips in space, printed beside right."""
    runs = [run for run in drawn.sides if "tip" in run]
    if not runs:
        return Section("paths", texts.PATHS)
    pictures = [_path_picture(drawn, run) for run in runs]
    blades = runs[0].array("tip").shape[1]
    legend = [line_sample(f"{texts.BLADE} {i}".lower(), coordinate_look(i)[0], "-") for i in range(1, blades + 1)]
    legend += [
        line_sample(texts.WIRE_START, GREY, (0, (3, 2))),
        line_sample(texts.WIRE_END, GREY, "-"),
        replace(line_sample(texts.SHAFT, GREY, "-"), width=4.0),
    ]
    table = metrics.path_table({_heading(drawn, run): run for run in runs})
    moving = viewer(
        drawn.scene, {name_of(run.method): run for run in drawn.sides}, texts.viewer_described(drawn.scene.title)
    )
    heading = texts.PATHS if moving is None else texts.MOVING
    return Section("paths", heading, pictures, legend, [table], [texts.PATHS_NOTE], moving)


def _path_picture(drawn: Drawn, run: StoredRun) -> Picture:
    tip, name = run.array("tip"), name_of(run.method)
    turned = float(run.array("angles")[-1, 0] - run.array("angles")[0, 0]) if "angles" in run else None
    return _picture(
        figures.paths(run.array("time"), tip),
        f"paths-{'p' if run is drawn.printed else 'r'}",
        name.capitalize(),
        texts.paths_described(name, turned, float(np.abs(tip[:, :, 1]).max())),
    )


def _horizon_sample(drawn: Drawn) -> Iterator[Sample]:
    """In the legend where the line is drawn: before the end."""
    ends = [float(run.array("time")[-1]) for run in drawn.sides]
    if drawn.horizon is not None and any(drawn.horizon < end for end in ends):
        yield line_sample(f"{texts.HORIZON} {texts.seconds(drawn.horizon)}", GREY, (0, (2, 2)))


def _picture(panels: canvas.Panels, name: str, caption: str, described: str, notes: Iterable[str] = ()) -> Picture:
    """Draws it. `name` is unique on the page; `described` says what one would see."""
    text = svg.embedded(canvas.svg_text(panels.figure), name, caption, described)
    return Picture(Markup(text), caption, [note for note in notes if note])


def source_comment(scene: StoredScene) -> str:
    """The comment that opens the scene's file, as running text; "" where there is none."""
    lines = []
    for line in str(scene.attributes.get("scene_toml", "")).splitlines():
        if not line.startswith("#"):
            break
        if "doi " not in line:  # the paper itself is named on the index
            lines.append(line.lstrip("#").strip())
    return " ".join(lines).strip()
