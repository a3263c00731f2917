"""A scene's page in the stability report: verdicts, motion, errors over time, error over the step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rotor_mbs.analysis import methods
from rotor_mbs.analysis.stability import OUTCOMES, Cell, reached_by
from rotor_mbs.report.core.elements import Cell as Entry
from rotor_mbs.report.core.elements import Section, Table, line_sample
from rotor_mbs.report.core.environment import ScenePage
from rotor_mbs.report.names import coordinate_look, name_of
from rotor_mbs.report.pages import stability_texts as words
from rotor_mbs.report.pages.stability_errors import error_over_step, errors_over_time, picture
from rotor_mbs.report.plots import time_histories as figures
from rotor_mbs.store.read import StoredRun, StoredScene
from rotor_mbs.store.stability import Record

_NOT_BAD = ("holds", "energy_alone", "smaller_step", "refuses")


def scene_page(
    scene: StoredScene, own: Sequence[Cell], ladders: Sequence[Record], previous: str, following: str
) -> ScenePage:
    drawn = {name: run for name, run in methods.right_runs(scene).items() if methods.has_samples(run)}
    sections = [
        Section("verdicts", words.VERDICTS, tables=[_verdicts(own)]),
        _motion(scene),
        errors_over_time(scene, drawn),
        error_over_step(ladders),
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
    if not own or not own[0].has_reference or all(cell.angle_error is None for cell in own):
        return []
    best = reached_by(own, scene.name)
    if best is not None:
        return [f"{words.RIGHT_BY} up to the horizon: {name_of(best)}."]
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


def _unresolved(run: StoredRun) -> list[str]:
    """Coordinates that at their rate would cross all of their range between two samples: lines there mislead."""
    interval = float(run.array("time")[1] - run.array("time")[0])
    ranges, fastest = np.ptp(run.array("angles"), axis=0), np.abs(run.array("rates")).max(axis=0)
    return [label for label, a, w in zip(run.labels, ranges, fastest, strict=True) if w * interval > a > 0.0]


def _verdicts(own: Sequence[Cell]) -> Table:
    rows = []
    for cell in own:
        symbol, text = OUTCOMES[cell.outcome]
        known = (cell.angle_error, cell.energy_drift, cell.run_time_s or None, cell.step)
        if cell.outcome in _NOT_BAD:
            outcome = Entry(f"{symbol} {text}", note=cell.message)
        else:  # the tone brings its own mark
            outcome = Entry(text, "bad", note=cell.message)
        numbers = [*map(_number, known), f"{cell.time_reached:.4g}"]
        rows.append([Entry(name_of(cell.method)), outcome, *map(Entry, numbers)])
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
    caption = words.motion_caption(name_of(run.method), _unresolved(run))
    panels = figures.motion(figures.Motion(run.array("time"), run.array("angles"), run.array("rates")))
    legend = [line_sample(label, *coordinate_look(i)) for i, label in enumerate(run.labels)]
    return Section("motion", words.MOTION, [picture(panels, "motion", caption)], legend)
