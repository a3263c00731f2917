"""Tables and CSV of error against run time: every point, time to an accuracy, orders, failures, growth. No HTML."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from rotor_mbs.analysis.work_precision import (
    TARGETS_RAD,
    Reach,
    fastest,
    growth_exponent,
    left_out,
    reaches,
    succeeded,
)
from rotor_mbs.report import texts as report_texts
from rotor_mbs.report.core.elements import Cell, Table
from rotor_mbs.report.core.numbers import NOTHING, number, prefixed
from rotor_mbs.report.pages import bench_texts as texts
from rotor_mbs.store.bench import Curve

_CSV_COLUMNS = (
    "setting", "angle_error_max", "angle_error_end", "tip_error_max", "energy_drift_max", "run_time_s",
    "run_time_min_s", "run_time_q1_s", "run_time_q3_s", "setup_time_s", "setup_again_time_s", "output_time_s",
    "repeats", "steps", "false_success",
)  # fmt: skip


def name(curve: Curve) -> str:
    return texts.curve_name(curve.name, str(curve.attributes["method"]))


def csv_text(curves: Sequence[Curve]) -> str:
    """Every point, unrounded, with a heading line; units are those of the results file (s, rad, m)."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["scene", "method", "setting_kind", *_CSV_COLUMNS, "status", "message"])
    for curve in curves:
        for i, (status, message) in enumerate(zip(curve.statuses, curve.messages, strict=True)):
            values = [curve.arrays[column][i].item() for column in _CSV_COLUMNS]
            writer.writerow([curve.scene, curve.name, curve.attributes["setting_kind"], *values, status, message])
    return stream.getvalue()


def reach_table(curves: Sequence[Curve]) -> Table:
    """A row per curve: time and ratio for each target."""
    found = reaches(curves)
    head = [texts.METHOD, *(texts.target(target) for target in TARGETS_RAD)]
    rows = []
    for curve in curves:
        cells = [Cell(name(curve))]
        for target in TARGETS_RAD:
            reach = found[curve.name][target]
            cells.append(_unreached(curve) if reach is None else _reached(reach))
        rows.append(cells)
    return Table(texts.REACH_CAPTION, head, rows, numeric=range(1, len(head)))


def _reached(reach: Reach) -> Cell:
    return Cell(prefixed(reach.seconds, "s", 3), note=f"× {number(reach.ratio)}")


def _unreached(curve: Curve) -> Cell:
    """Whether the method cannot, or was not asked to."""
    if left_out(curve):
        return Cell(texts.NOT_MEASURED, note=texts.finer_left_out(left_out(curve)))
    errors = curve.arrays["angle_error_max"][succeeded(curve)]
    return Cell(NOTHING, note=texts.best_reached(float(errors.min()) if len(errors) else None))


def overview_table(scenes: Mapping[str, Sequence[Curve]], files: Mapping[str, str]) -> Table:
    """A row per scene: for each target the fastest method with its time, and the next one with its ratio."""
    head = [texts.SCENE, *(texts.target(target) for target in TARGETS_RAD)]
    rows = [
        [Cell(scene, href=files[scene]), *(_fastest_cell(curves, target) for target in TARGETS_RAD)]
        for scene, curves in scenes.items()
    ]
    return Table(texts.OVERVIEW_CAPTION, head, rows)


def _fastest_cell(curves: Sequence[Curve], target: float) -> Cell:
    found, is_cut = fastest(curves, target), any(map(left_out, curves))
    if not found:
        return Cell(texts.NOT_MEASURED if is_cut else NOTHING)
    (first, reach), *others = found
    if others:
        next_one = texts.runner_up(name(others[0][0]), others[0][1].ratio)
    else:
        next_one = texts.OTHERS_NOT_MEASURED if is_cut else texts.ALONE
    return Cell(f"{name(first)}: {prefixed(reach.seconds, 's', 2)}", note=next_one)


def overview(scenes: Mapping[str, Sequence[Curve]]) -> list[str]:
    """Plain words over all scenes: for each target who is fastest, and by how much the other models are slower."""
    sentences = [_overview(list(scenes.values()), target) for target in TARGETS_RAD]
    return [*filter(None, sentences), *omissions([curve for curves in scenes.values() for curve in curves])]


def _overview(scenes: Sequence[Sequence[Curve]], target: float) -> str:
    wins: dict[str, list[float]] = {}
    ratios: dict[str, list[float]] = {}
    for curves in scenes:
        best: dict[str, float] = {}
        for place, (curve, reach) in enumerate(fastest(curves, target)):
            model = curve.name.partition("/")[0]
            if not place:
                wins.setdefault(name(curve), []).append(reach.seconds)
            best.setdefault(model, reach.ratio)
        for model, ratio in best.items():
            if ratio > 1.0:
                ratios.setdefault(model, []).append(ratio)
    return texts.overview(target, len(scenes), wins, ratios) if wins else ""


def omissions(curves: Sequence[Curve]) -> list[str]:
    """How much the budget left out, and what that means for the tables; nothing where it left out nothing."""
    count = sum(map(left_out, curves))
    return [texts.omissions(count, sum(len(curve.statuses) for curve in curves))] if count else []


def order_table(curves: Sequence[Curve]) -> Table:
    """A row per fixed-step curve."""
    rows = [
        [Cell(name(curve)), Cell(number(curve.attributes.get("order"), 3)), Cell(f"{a['order_expected']:g}")]
        for curve in curves
        if "order_expected" in (a := curve.attributes)
    ]
    return Table(texts.ORDER_CAPTION, [texts.METHOD, texts.ORDER, texts.EXPECTED], rows, numeric=(1, 2))


def point_table(curves: Sequence[Curve]) -> Table:
    """A row per point that was run."""
    rows = [row for curve in curves for row in _point_rows(curve)]
    return Table(texts.POINTS_CAPTION, texts.POINT_COLUMNS, rows, numeric=range(1, 14))


def _point_rows(curve: Curve) -> Iterator[list[Cell]]:
    a = curve.arrays
    for i, status in enumerate(curve.statuses):
        if status == "left_out":
            continue
        low, high = (prefixed(_known(a[f"run_time_{q}_s"][i]), "s", 3) for q in ("q1", "q3"))
        errors = ("angle_error_max", "angle_error_end", "tip_error_max", "energy_drift_max")
        seconds = ("run_time_min_s", "setup_time_s", "setup_again_time_s", "output_time_s")
        yield [
            Cell(name(curve)),
            Cell(_setting(curve, i)),
            *(Cell(number(_known(a[error][i]))) for error in errors),
            Cell(prefixed(_known(a["run_time_s"][i]), "s", 3)),
            Cell(f"{low} to {high}"),
            *(Cell(prefixed(_known(a[second][i]), "s", 3)) for second in seconds),
            Cell(str(a["repeats"][i])),
            Cell(str(a["steps"][i])),
            Cell(report_texts.status(status), tone="" if status == "ok" else "bad"),
        ]


def failure_table(curves: Sequence[Curve]) -> Table:
    """Every point that is not on a curve, with the reason."""
    rows = [
        [
            Cell(name(curve)),
            Cell(_setting(curve, i)),
            Cell(prefixed(_known(curve.arrays["run_time_s"][i]), "s", 3)),
            Cell("left out" if status == "left_out" else report_texts.status(status)),
            Cell("yes" if curve.arrays["false_success"][i] else ""),
            Cell(message),
        ]
        for curve in curves
        for i, (status, message) in enumerate(zip(curve.statuses, curve.messages, strict=True))
        if status != "ok"
    ]
    head = [texts.METHOD, texts.SETTING, texts.TIME, texts.STATUS, texts.FALSE, texts.REASON]
    return Table(texts.FAILURES_CAPTION, head, rows, numeric=(1, 2))


def growth_table(curves: Sequence[Curve]) -> Table:
    """A row per method over the sizes of a study (blades, or s of duration): run time per simulated second."""
    sizes = sorted({float(size) for curve in curves for size in curve.arrays["setting"]})
    kind = str(curves[0].attributes["setting_kind"])
    head = [texts.METHOD, *(f"{size:g} {'s' if kind == 'duration' else kind}" for size in sizes), texts.EXPONENT]
    rows = []
    for curve in curves:
        ok = np.array([status == "ok" for status in curve.statuses])
        rate = curve.arrays["run_time_s"] / np.array(curve.arrays["simulated_s"])
        at = dict(zip(curve.arrays["setting"][ok].tolist(), rate[ok].tolist(), strict=True))
        exponent = growth_exponent(curve.arrays["setting"][ok], rate[ok])
        cells = [Cell(prefixed(at.get(size), "s", 3)) for size in sizes]
        rows.append([Cell(name(curve)), *cells, Cell(number(exponent))])
    return Table(texts.GROWTH_CAPTION, head, rows, numeric=range(1, len(head)))


def summary(scene: str, curves: Sequence[Curve]) -> list[str]:
    """Plain words from the numbers: for each target, each model's best; what the budget left out."""
    sentences = []
    for target in TARGETS_RAD:
        best: dict[str, tuple[str, float]] = {}
        for curve, reach in fastest(curves, target):
            best.setdefault(curve.name.partition("/")[0], (name(curve), reach.seconds))
        sentences.append(texts.summary(scene, target, dict(best.values())))
    return [*sentences, *omissions(curves)]


def _setting(curve: Curve, i: int) -> str:
    value = float(curve.arrays["setting"][i])
    return prefixed(value, "s", 3) if curve.attributes["setting_kind"] == "step" else number(value, 2)


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
