"""A scene's page in the stability report: verdicts, motion, differences, energy, joint gaps, error over the step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from rotor_mbs.analysis import methods
from rotor_mbs.analysis.stability import OUTCOMES, Cell, reached_by
from rotor_mbs.report import canvas, figures, vector
from rotor_mbs.report import stability_texts as words
from rotor_mbs.report.names import Look, coordinate_look, looks, name_of
from rotor_mbs.report.pages import ScenePage
from rotor_mbs.report.parts import Cell as Entry
from rotor_mbs.report.parts import Picture, Section, Table, line_sample, run_sample
from rotor_mbs.store.read import StoredRun, StoredScene
from rotor_mbs.store.stability import Record

# What is drawn on a log axis: above nothing, below what a run away would make of the picture.
_LOWEST, _HIGHEST = 1e-18, 1e4


def scene_page(
    scene: StoredScene, own: Sequence[Cell], ladders: Sequence[Record], previous: str, following: str
) -> ScenePage:
    drawn = {name: run for name, run in methods.right_runs(scene).items() if methods.has_samples(run)}
    look = looks(list(drawn))
    sections = [
        Section("verdicts", words.VERDICTS, tables=[_verdicts(own)]),
        _motion(scene),
        _difference(scene, drawn, look),
        _energy(drawn, look),
        _gaps(drawn, look),
        _steps(ladders),
    ]
    return ScenePage(
        name=scene.name,
        title=scene.title,
        figures="",
        lead=_lead(scene, own),
        failures=[],
        source=_comment(str(scene.attributes["scene_toml"])),
        sections=[section for section in sections if section.has_content],
        toml=str(scene.attributes["scene_toml"]),
        previous=previous,
        next=following,
    )


def _lead(scene: StoredScene, own: Sequence[Cell]) -> list[str]:
    if not own or not own[0].has_reference:
        return []
    best = reached_by(own, scene.name)
    if best is not None:
        return [f"{words.RIGHT_BY} {name_of(best)}."]
    reference = scene.reference
    assert reference is not None  # has_reference says so
    uncertainty = float(reference.array("angle_uncertainty").max())
    return [words.conditioning(scene.name, uncertainty, float(reference.array("error_growth").max()))]


def _comment(toml: str) -> str:
    """The header of the scene's file: what it stresses, and its oracle."""
    lines = []
    for line in toml.splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.removeprefix("#").strip())
    return " ".join(lines)


def _verdicts(own: Sequence[Cell]) -> Table:
    rows = []
    for cell in own:
        symbol, text = OUTCOMES[cell.outcome]
        tone = "good" if cell.outcome in ("holds", "refuses") else "bad" if cell.outcome != "smaller_step" else ""
        numbers = [_number(cell.angle_error), _number(cell.energy_drift), _number(cell.run_time_s), _number(cell.step)]
        outcome = Entry(f"{symbol} {text}", "" if tone == "good" else tone, note=cell.message)
        rows.append([Entry(name_of(cell.method)), outcome, *map(Entry, numbers), Entry(f"{cell.time_reached:.4g}")])
    head = [
        words.METHOD,
        words.OUTCOME,
        words.ANGLE_ERROR,
        words.ENERGY_DRIFT,
        words.RUN_TIME,
        words.STEP,
        words.REACHED,
    ]
    return Table(words.VERDICTS, head, rows, (2, 3, 4, 5, 6))


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.2g}"


def _motion(scene: StoredScene) -> Section:
    run = methods.right_run(scene)
    if run is None or len(run.array("time")) < 2:
        return Section("motion", words.MOTION)
    caption = words.MOTION_CAPTION.format(name_of(run.method))
    picture = _picture(
        figures.motion(figures.Motion(run.array("time"), run.array("angles"), run.array("rates"))), "motion", caption
    )
    legend = [line_sample(label, *coordinate_look(i)) for i, label in enumerate(run.labels)]
    return Section("motion", words.MOTION, [picture], legend)


def _difference(scene: StoredScene, drawn: dict[str, StoredRun], look: dict[str, Look]) -> Section:
    reference = scene.reference
    if reference is None or len(reference.array("time")) < 2:
        return Section("difference", words.DIFFERENCE)
    right = reference.array("angles")
    series = []
    for name, run in drawn.items():
        n = min(len(right), len(run.array("time")))
        error = np.abs(run.array("angles")[:n] - right[:n]).max(axis=1)
        if error.max() > figures.LOWEST:
            series.append(figures.Series(run.array("time")[:n], np.minimum(error, _HIGHEST), look[name]))
    horizon = next(
        (float(run.attributes["horizon_s"]) for run in drawn.values() if "horizon_s" in run.attributes), None
    )
    panels = figures.difference(series, None, None, horizon)
    legend = [run_sample(name_of(name), look[name]) for name in drawn]
    picture = _picture(panels, "difference", words.DIFFERENCE_CAPTION)
    return Section("difference", words.DIFFERENCE, [picture], legend)


def _energy(drawn: dict[str, StoredRun], look: dict[str, Look]) -> Section:
    having = {name: run for name, run in drawn.items() if "energy_error" in run and len(run.array("time")) > 1}
    series = []
    for name, run in having.items():
        scale = float(run.attributes.get("energy_scale_J", 0.0)) or 1.0
        values = np.clip(np.abs(run.array("energy_error")) / scale, 0.0, _HIGHEST)
        if values.max() > figures.LOWEST:
            series.append(figures.Series(run.array("time"), values, look[name]))
    if not series:
        return Section("energy", words.ENERGY)
    legend = [run_sample(name_of(name), look[name]) for name in having]
    picture = _picture(figures.energy_errors(series, relative=True, horizon=None), "energy", words.ENERGY_CAPTION)
    return Section("energy", words.ENERGY, [picture], legend)


def _gaps(drawn: dict[str, StoredRun], look: dict[str, Look]) -> Section:
    having = {n: run for n, run in drawn.items() if "constraint_error" in run and len(run.array("time")) > 1}
    if not having:
        return Section("gaps", words.GAPS)
    picture = canvas.panels((2.3,), "time (s)")
    axes, highest = picture.axes[0], 1e-12
    for name, run in having.items():
        values = np.clip(run.array("constraint_error"), _LOWEST, _HIGHEST)
        highest = max(highest, float(values.max()))
        axes.plot(*figures.thin(run.array("time"), values), color=look[name].colour, linestyle=look[name].line)
    canvas.log_axis(axes, _LOWEST, highest)
    axes.set_ylabel(words.GAP_AXIS)
    legend = [run_sample(name_of(name), look[name]) for name in having]
    return Section("gaps", words.GAPS, [_picture(picture, "gaps", words.GAPS_CAPTION)], legend)


def _steps(ladders: Sequence[Record]) -> Section:
    drawn = {r.method: r for r in ladders if np.isfinite(r.arrays["angle_error_max"]).any()}
    if not drawn:
        return Section("steps", words.STEPS)
    look = looks(list(drawn))
    picture = canvas.panels((2.8,), words.STEP_AXIS)
    axes, lowest, highest = picture.axes[0], 1e-8, 1e-6
    for name, record in drawn.items():
        errors = np.clip(record.arrays["angle_error_max"], _LOWEST, _HIGHEST)
        lowest, highest = min(lowest, float(np.nanmin(errors))), max(highest, float(np.nanmax(errors)))
        one = look[name]
        axes.plot(
            record.arrays["step"], errors, color=one.colour, linestyle=one.line, marker=one.marker, markersize=4.2
        )
    axes.set_xscale("log")
    canvas.log_axis(axes, lowest, highest)
    axes.axhline(1e-6, color="#666666", linewidth=0.8, linestyle=":")
    axes.set_ylabel(words.STEP_ERROR_AXIS)
    legend = [run_sample(name_of(name), look[name]) for name in drawn]
    return Section("steps", words.STEPS, [_picture(picture, "steps", words.STEPS_CAPTION)], legend)


def _picture(panels: canvas.Panels, name: str, caption: str) -> Picture:
    svg = vector.embedded(canvas.svg_text(panels.figure), name, caption, caption)
    return Picture(Markup(svg), caption)
