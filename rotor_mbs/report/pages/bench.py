"""Build the page of error and run time, and the work-precision diagrams of a scene."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import cycle

import numpy as np
from markupsafe import Markup

from rotor_mbs.analysis import work_precision
from rotor_mbs.analysis.text_tables import bench_table
from rotor_mbs.report.elements import (
    Curve,
    Element,
    Fact,
    Fold,
    Grid,
    Horizontal,
    Legend,
    Listing,
    Mark,
    Note,
    PageContent,
    PageTable,
    Plot,
    Row,
    Section,
    TableCell,
)
from rotor_mbs.report.looks import GREY, LINES, PALETTE, Look, label_of, look_of, with_capital
from rotor_mbs.report.numbers import NOTHING, number, shortest, with_unit
from rotor_mbs.report.pages import method_cell, words_of
from rotor_mbs.runs.design import COLUMNS
from rotor_mbs.runs.read import OpenResults, Record, StoredRun, read_records
from rotor_mbs.scenario.catalogue import natural_order
from rotor_mbs.solution.status import COMPLETE
from rotor_mbs.studies.stability import SuiteRun, suite_runs

_POINT_COLUMNS = ("angle_error_max", "defect_max", "energy_drift_max", "run_time_s", "steps")
# Largest number of points in the tables of a page. If a bench has more points, the tables have only
# those that are not ok.
_MAX_POINTS = 800
_ERRORS = {
    work_precision.ANGLE_ERROR: "Largest angle error",
    "defect_max": "Largest interval defect",
}
_ENGINE_TARGETS = (1e-6, 1e-9, 1e-10)  # errors in rad for which each method's run time is given
_LONG_S = 100.0  # s, shortest duration of a scene whose energy drift is shown
_NO_ENGINE = (
    "rotor_mbs",
    "python",
    "numpy",
    "h5py",
    "code",
    "plug-in",
)  # names of stored versions that are not versions of an engine
# Colours for methods of files. On light and on dark pages they differ from each other, and from the
# colours of the models in the catalogue.
_COLOURS_OF_FILES = tuple(
    PALETTE[name][0] for name in ("rotor", "blade-4", "step-6", "blade-3", "blade-5", "step-3")
)
_FRONT = Look(PALETTE["ring"][0], "-", "", "best of all methods")
_LOWEST_ERROR = 2e-16  # rad; smaller errors are drawn at this value, inside the frame
_SCENES_IN_A_TABLE = 6  # largest number of columns beside that of the methods
_NAMES_IN_A_SENTENCE = 4  # largest number of methods whose names a sentence has


def bench_page(results: OpenResults) -> PageContent:
    """Return the content of the page of error against run time.

    The page has the diagrams of the first scene, with those of other scenes folded. Tables of the
    results of each method, and of every setting, follow.

    Parameters
    ----------
    results : the open results file, with curves of a bench.
    """
    grouped = work_precision.by_scene(read_records(results.path, "bench"))
    scenes = {name: grouped[name] for name in natural_order(grouped)}
    sections = []
    first = next(iter(scenes))
    elements: list[Grid | Fold | Element] = [
        *diagrams(scenes[first]),
        Note(_conditions(first, scenes[first])),
    ]
    others = []
    for name in [*scenes][1:]:
        note = Note(_conditions(name, scenes[name]))
        others.append(
            Fold(name, _winner(scenes[name]), [*diagrams(scenes[name], f"{name} "), note])
        )
    if others:
        elements += others
    sections.append(Section("diagram", f"Error against run time: {first}", elements, _LOWER_LEFT))
    if len(scenes) == 1:
        # The table of all scenes would have only one column. The table of the scene shows more.
        sections.append(Section("reach", "Time to an error", [_reach_table(scenes[first])]))
    else:
        sections.append(_reach_section(scenes))
    sections.append(_methods_section(results, scenes))
    folds = []
    whole = sum(len(curve.statuses) for curves in scenes.values() for curve in curves)
    for name, curves in scenes.items():
        count = sum(len(curve.statuses) for curve in curves)
        is_cut = whole > _MAX_POINTS
        points = point_table(curves, only_faults=is_cut)
        shown_rows = f"{len(points.rows)} of " if is_cut else ""
        shown = [points] if len(scenes) == 1 else [_reach_table(curves), points]
        folds.append(Fold(name, f"{shown_rows}{count} settings", shown))
    say = "Those that are not ok; all are in the file." if whole > _MAX_POINTS else ""
    sections.append(Section("points", "Every setting", folds, say))
    return PageContent(
        "Error and run time", results.path.name, bench_answer(scenes), _facts(scenes), sections
    )


_LOWER_LEFT = (
    "Each point is one method at one setting: the median of its run times, and the error of the "
    "same runs. The lower left is best. Settings that another one of the same method beats in "
    "both, and runs that failed, are in the tables. Errors below 2×10⁻¹⁶ rad are drawn there."
)


def bench_answer(scenes: Mapping[str, Sequence[Record]]) -> list[Markup]:
    """Return sentences on the fastest method to an error, and on the fastest one of another model.

    A last sentence names the methods that never reach 1e-6 rad, if they are few.

    Parameters
    ----------
    scenes : the curves of the bench, by scene.
    """
    sentences = []
    found: dict[tuple[str, str, str], list[tuple[float, str]]] = {}
    for target in (1e-6, 1e-9):
        wins: Counter[str] = Counter()
        reached = 0
        ratios: dict[str, list[float]] = {}
        for curves in scenes.values():
            ranked = work_precision.fastest(curves, target)
            if not ranked:
                continue
            reached += 1
            winner = ranked[0][0].method
            wins[winner] += 1
            # The winner is compared with a method of another model, because methods of the same
            # model share code.
            other = next(
                (pair for pair in ranked if _model(pair[0].method) != _model(winner)), None
            )
            if other is not None:
                ratios.setdefault(other[0].method, []).append(other[1].ratio)
        if not wins:
            sentences.append(Markup("No method reaches {} rad.").format(shortest(target)))
            continue
        winner, count = wins.most_common(1)[0]
        where = "" if len(scenes) == 1 else f" on {count} of {reached} scenes"
        second, factor = "", ""
        if ratios:
            # `second` is the method that is the fastest one of another model on most scenes.
            second = max(ratios, key=lambda method: len(ratios[method]))
            factor = number(float(np.median(ratios[second])))
        found.setdefault((winner, where, second), []).append((target, factor))
    # Errors with the same outcome share a sentence.
    told = []
    for (winner, where, second), outcomes in found.items():
        targets = " and ".join(shortest(target) for target, _ in outcomes)
        errors = "an error" if len(outcomes) == 1 else "errors"
        text = Markup("To {} of {} rad <b>{}</b> is the fastest{}").format(
            errors, targets, label_of(winner), where
        )
        if second:
            factors = " and ".join(dict.fromkeys(factor for _, factor in outcomes))
            text += Markup("; {}, the fastest of another model, takes {} times as long").format(
                label_of(second), factors
            )
        told.append(text + ".")
    sentences = [*told, *sentences]
    never = _never_reaching(scenes, 1e-6)
    if never and len(never) <= _NAMES_IN_A_SENTENCE:
        bold = [Markup("<b>{}</b>").format(name) for name in never]  # some have a comma
        names = Markup(" and ").join(filter(None, (Markup(", ").join(bold[:-1]), bold[-1])))
        text = Markup("No setting of {} reaches 10⁻⁶ rad{}.")
        sentences.append(text.format(names, "" if len(scenes) == 1 else " on any scene"))
    return sentences


def _never_reaching(scenes: Mapping[str, Sequence[Record]], target: float) -> list[str]:
    """Return the labels of the methods that reach an error on no scene.

    A method is not returned if some of its settings were left out, because these settings might
    reach the error.

    Parameters
    ----------
    scenes : the curves of the bench, by scene.
    target : the error, rad.
    """
    curves = [curve for of_scene in scenes.values() for curve in of_scene]
    able = {
        curve.method
        for curve in curves
        if work_precision.left_out(curve) or work_precision.fastest([curve], target)
    }
    methods = dict.fromkeys(curve.method for curve in curves)
    return [label_of(method) for method in methods if method not in able]


def _model(method: str) -> str:
    return method.partition("/")[0]


def _facts(scenes: Mapping[str, Sequence[Record]]) -> list[Fact]:
    """Return the facts at the top of the page: numbers of scenes, methods and settings.

    Parameters
    ----------
    scenes : the curves of the bench, by scene.
    """
    curves = [curve for of_scene in scenes.values() for curve in of_scene]
    measured = sum(status != "left_out" for curve in curves for status in curve.statuses)
    count = sum(len(curve.statuses) for curve in curves)
    failed = sum(int(work_precision.failed(curve).sum()) for curve in curves)
    methods, variants = (
        len({getattr(curve, key) for curve in curves}) for key in ("method", "name")
    )
    return [
        Fact("Scenes", str(len(scenes))),
        Fact(
            "Methods",
            str(methods),
            "" if variants == methods else f"{variants} with their variants",
        ),
        Fact(
            "Settings that were timed",
            f"{measured} of {count}",
            "the others did not fit the time budget",
        ),
        Fact("Failed settings", str(failed), "did not end, or with an error of 1 rad or more"),
    ]


def _winner(curves: Sequence[Record]) -> str:
    ranked = work_precision.fastest(curves, 1e-6)
    if not ranked:
        return "no method reaches 10⁻⁶ rad"
    curve, reach = ranked[0]
    return f"fastest to 10⁻⁶ rad: {label_of(curve.name)}, {with_unit(reach.seconds, 's')}"


def _conditions(name: str, curves: Sequence[Record]) -> str:
    """Return a text on how the points of a scene were measured.

    Parameters
    ----------
    name : name of the scene.
    curves : curves of the scene. Their attributes have the conditions of the measurement.
    """
    facts = curves[0].attributes
    if facts["horizon_s"] < facts["duration_s"]:
        text = (
            f"Times are for the whole {number(facts['duration_s'], 3)} s; errors are evaluated up "
            f"to {with_unit(facts['horizon_s'], 's', 3)}, the last of the samples used here before "
            "the horizon."
        )
    else:
        text = (
            f"Times and errors are for the whole {number(facts['duration_s'], 3)} s; the horizon "
            "is not reached."
        )
    text += f" Uncertainty of the reference: {with_unit(facts['uncertainty_rad'], 'rad')}. "
    if "is_short" in facts:
        return text + (
            "Each method has a few settings, each run once in parallel with other runs: times may "
            f"be wrong by a factor of four or more. rotor-mbs bench {name} measures them "
            "accurately."
        )
    core = "any core" if facts["pinned_core"] < 0 else f"core {facts['pinned_core']}"
    return text + (
        f"One process at a time on {core}, garbage collection disabled, all points timed in "
        f"alternating rounds, within {number(facts['budget_s'], 3)} s; load average of the machine "
        f"before: {number(facts['load_before'])}."
    )


def curve_looks(curves: Sequence[Record]) -> dict[str, Look]:
    """Return the look of each curve by the name of the curve.

    Curves that are not in the catalogue would all be grey. Each file of methods therefore gets a
    colour, and each method of a file a line style.
    """
    looks = {curve.name: look_of(curve.name) for curve in curves}
    unknown: dict[str, list[str]] = {}
    for name, look in looks.items():
        if look.colour == GREY:
            unknown.setdefault(_model(name), []).append(name)
    for names, colour in zip(unknown.values(), cycle(_COLOURS_OF_FILES), strict=False):
        for name, line in zip(names, cycle(LINES), strict=False):
            looks[name] = replace(looks[name], colour=colour, line=line)
    return looks


def diagrams(curves: Sequence[Record], group: str = "") -> list[Legend | Grid]:
    """Return the legend and the work-precision diagrams of a scene.

    One diagram has the angle error over the run time, the other the interval defect. The list is
    empty if neither has a point.

    Parameters
    ----------
    curves : curves of the scene.
    group : prefix of the keys of the curves, which separates groups of diagrams on a page.
    """
    looks = curve_looks(curves)
    plots = []
    for error, name in _ERRORS.items():
        plot = diagram(curves, error, name, looks, group)
        if plot is not None:
            plots.append(plot)
    if not plots:
        return []
    drawn = dict.fromkeys(curve.key for plot in plots for curve in plot.curves)
    items = [(f"{group}{name}", look) for name, look in looks.items() if f"{group}{name}" in drawn]
    return [Legend(items), Grid(len(plots), [[plot] for plot in plots])]


def diagram(
    curves: Sequence[Record], error: str, name: str, looks: Mapping[str, Look], group: str = ""
) -> Plot | None:
    """Return a work-precision diagram of a scene; None if it has no point.

    The Pareto front of all curves is drawn behind them.

    Parameters
    ----------
    curves : curves of the scene.
    error : name of the column with the error, rad.
    name : name of the error, which is the title of the plot.
    looks : look of each curve by the name of the curve.
    group : prefix of the keys of the curves. A diagram with a group has no still picture.
    """
    points = {
        curve.name: work_precision.points(curve, error) for curve in curves if error in curve.arrays
    }
    drawn = {method: of_curve for method, of_curve in points.items() if len(of_curve[0])}
    if not drawn:
        return None
    errors, seconds = np.concatenate(list(drawn.values()), axis=1)
    front = work_precision.pareto(errors, seconds)
    plotted = []
    # The front comes first, so that the curves are drawn over it.
    if len(front) > 1:
        order = front[np.argsort(seconds[front])]
        plotted.append(
            Curve("front", _FRONT, seconds[order], np.maximum(errors[order], _LOWEST_ERROR))
        )
    for method, (own_errors, own_seconds) in drawn.items():
        order = work_precision.pareto(own_errors, own_seconds)  # by rising time
        shown = np.maximum(own_errors[order], _LOWEST_ERROR)
        plotted.append(
            Curve(f"{group}{method}", looks[method], own_seconds[order], shown, dots="line")
        )
    low, high = float(seconds.min()), float(seconds.max())
    axis = Horizontal("run time", "s", "time", 0.8 * low, max(1.25 * high, 1.0001 * low), log=True)
    marks = []
    # The uncertainty is marked only if it is larger than the smallest error. That of a reference in
    # quad precision is far below all errors.
    uncertainty = max(
        (float(curve.attributes.get("uncertainty_rad", 0.0)) for curve in curves), default=0.0
    )
    if error == work_precision.ANGLE_ERROR and uncertainty > max(
        float(errors.min()), _LOWEST_ERROR
    ):
        marks.append(Mark("uncertainty of the reference", y=uncertainty))
    return Plot(
        name, "rad", axis, plotted, 320, "over run time (s)", log=True, marks=marks, still=not group
    )


def _reach_table(curves: Sequence[Record]) -> PageTable:
    """Return the table of the run times that the curves of a scene need to reach an error.

    Parameters
    ----------
    curves : curves of the scene. Each curve has a row, but those that were not measured share the
        last one.
    """
    table = bench_table(curves)
    rows: list[Row] = []
    missing = []
    for curve, (_, method, *cells) in zip(curves, table.rows, strict=True):
        if all(status == "left_out" for status in curve.statuses):
            missing.append(label_of(method))
            continue
        rows.append([method_cell(method), *(cell or NOTHING for cell in cells)])
    if missing:
        rows.append(
            [TableCell("not measured", note=", ".join(missing)), *[NOTHING] * (len(table.head) - 2)]
        )
    targets = [f"Time to {head.removeprefix('s to ')} (s)" for head in table.head[4:]]
    head = ("Method", "Settings ok", "Best error (rad)", *targets)
    return PageTable("Run time to reach an angle error", head, rows, wide=(1, 3), sortable=True)


def _reach_section(scenes: Mapping[str, Sequence[Record]]) -> Section:
    """Return the section with the run time of each method to reach 1e-6 rad on each scene.

    The tables have a row for each method and a column for each scene. There are several tables if
    the scenes do not fit the width of a page.

    Parameters
    ----------
    scenes : the curves of the bench, by scene.
    """
    methods = list(dict.fromkeys(curve.method for curves in scenes.values() for curve in curves))
    ranked = {scene: work_precision.fastest(curves, 1e-6) for scene, curves in scenes.items()}
    names = list(scenes)
    tables = []
    for first in range(0, len(names), _SCENES_IN_A_TABLE):
        shown = names[first : first + _SCENES_IN_A_TABLE]
        rows: list[Row] = []
        for method in methods:
            cells = [_scene_cell(method, scenes[scene], ranked[scene]) for scene in shown]
            rows.append([method_cell(method), *cells])
        tables.append(PageTable("Time to 1e-6 rad", ("Method", *shown), rows))
    say = (
        "✓: reaches 10⁻⁶ rad, with its run time relative to the fastest there. Not measured: finer "
        "settings did not fit the time budget."
    )
    return Section("reach", "Scenes and methods", tables, say)


def _scene_cell(
    method: str,
    curves: Sequence[Record],
    ranked: Sequence[tuple[Record, work_precision.Reach]],
) -> TableCell | str:
    """Return a cell that says whether a method reaches an error on a scene.

    The cell is "" if the method was not run on the scene.

    Parameters
    ----------
    method : name of the method.
    curves : curves of all methods on the scene.
    ranked : the curves that reach the error, the fastest first; see `work_precision.fastest`.
    """
    own = [curve for curve in curves if curve.method == method]
    reach = next((reach for curve, reach in ranked if curve.method == method), None)
    if reach is not None:
        return TableCell(
            f"✓ × {number(reach.ratio)}", note=with_unit(reach.seconds, "s"), order=reach.ratio
        )
    if not own:
        return ""
    if any(work_precision.left_out(curve) for curve in own):
        return "not measured"
    return TableCell("✗ not reached", "bad")


def _methods_section(results: OpenResults, scenes: Mapping[str, Sequence[Record]]) -> Section:
    """Return the section with a folded list of results for each method.

    The heading of a folded list summarizes the results.

    Parameters
    ----------
    results : the open results file.
    scenes : the curves of the bench, by scene.
    """
    reached, able = engine_tables(results, scenes)
    folds: list[Grid | Fold | Element] = []
    for row, capability in zip(reached.rows, able.rows, strict=True):
        items: list[tuple[str, str | Markup]] = []
        for head, cell in [
            *zip(reached.head[1:], row[1:], strict=True),
            *zip(able.head[1:], capability[1:], strict=True),
        ]:
            text = _in_a_line(cell)
            if text not in ("", NOTHING):
                items.append((with_capital(_in_a_line(head)), text))
        name = row[0] if isinstance(row[0], str) else row[0].text
        count, best, reach = (
            (cell if isinstance(cell, str) else cell.text) for cell in (row[1], row[4], row[5])
        )
        unit = " rad" if best[-1:].isdigit() or best[-1:] in "⁰¹²³⁴⁵⁶⁷⁸⁹" else ""
        hint = f"ok on {count}; best error {best}{unit}; to 10⁻⁶ rad: {reach}"
        folds.append(Fold(name, hint, [Listing(items)]))
    folds.append(Note(_EXPLAINED))
    title = "Each method" if len(scenes) == 1 else "Each method over all scenes"
    return Section("engines", title, folds)


def _in_a_line(cell: TableCell | str) -> str:
    if isinstance(cell, str):
        return cell
    return f"{cell.text} ({cell.note})" if cell.note else cell.text


_EXPLAINED = (
    "Ok on scenes: at least one setting has the status ok. Best defect, best error: of the most "
    'accurate setting, on the scene where it is largest; "fails": no setting on that many scenes '
    "ends with an error below 1 rad. Time to an error: on how many scenes it is reached, and the "
    "run time relative to the fastest method there, median over these scenes. Energy drift: "
    "relative to the energy scale, for a run of 100 s or more with default settings, if the file "
    "has one. Zero pitch: whether pitch angles that are exactly zero in the reference remain "
    "zero. Wrong but reported as success: of the finished runs of the stability suite that are "
    "not ok (without these in the file: of the points on this page that failed), those that the "
    "engine reported as successful although they are far from the motion. ≤, ≥ and not measured: "
    "finer settings were omitted because of the time budget."
)


def engine_tables(results: OpenResults, scenes: Mapping[str, Sequence[Record]]) -> list[PageTable]:
    """Return two tables with a row per method: accuracy and cost over all scenes, and capabilities.

    Values that are unknown are dashes.

    Parameters
    ----------
    results : the open results file. Its scenes determine which curves have damping and loads over
        time. Its runs have the energy drift.
    scenes : the curves of the bench, by scene.
    """
    curves = [curve for of_scene in scenes.values() for curve in of_scene]
    parsed = {name: stored.scene for name, stored in results.scenes.items()}
    suite = [
        run for run in suite_runs(results.path) if run.scene.startswith(("stiff/", "extreme/"))
    ]
    # The energy drift is shown for the shortest scene that lasts at least _LONG_S.
    durations = {
        name: scene.duration for name, scene in parsed.items() if results.scenes[name].methods
    }
    long = min(
        (name for name in durations if durations[name] >= _LONG_S),
        key=lambda name: durations[name],
        default="",
    )
    reached: list[Row] = []
    able: list[Row] = []
    for method in dict.fromkeys(curve.method for curve in curves):
        own = {
            name: [curve for curve in of_scene if curve.method == method]
            for name, of_scene in scenes.items()
        }
        own = {name: of_scene for name, of_scene in own.items() if of_scene}
        # A method is ok on a scene if at least one of its settings is ok.
        with_ok = [curves for curves in own.values() if any("ok" in c.statuses for c in curves)]
        reached.append(
            [
                method_cell(method),
                f"{len(with_ok)} of {len(own)}",
                _order_cell([curve for of_scene in own.values() for curve in of_scene]),
                _worst_cell(own, "defect_max"),
                _worst_cell(own, work_precision.ANGLE_ERROR),
                *(_reach_cell(scenes, own, target) for target in _ENGINE_TARGETS),
                _drift_cell(results.scenes[long].methods.get(method)) if long else NOTHING,
                _zero_pitch_cell(own),
                _false_success_cell(own, [run for run in suite if run.method == method]),
            ]
        )
        facts = next(iter(own.values()))[0].attributes
        damped = {name: own[name] for name in own if name in parsed and parsed[name].has_damping}
        loaded = {
            name: own[name]
            for name in own
            if name in parsed and not parsed[name].has_constant_loads
        }
        with_loads = [
            stored.runs.get(method)
            for name, stored in results.scenes.items()
            if parsed[name].wants("loads")
        ]
        loads = [
            "yes" if "blade_root_force" in run else "no" for run in with_loads if run is not None
        ]
        versions = json.loads(facts.get("versions", "{}"))
        engine = [
            f"{name} {version}" for name, version in versions.items() if name not in _NO_ENGINE
        ]
        able.append([
            method_cell(method),
            _worst_cell(damped, work_precision.ANGLE_ERROR),
            _worst_cell(loaded, work_precision.ANGLE_ERROR),
            max(loads, default=NOTHING),
            {True: "yes", False: "no"}.get(facts.get("linearizes", ""), NOTHING),
            ", ".join(engine) or NOTHING,
            str(facts.get("lines") or NOTHING),
        ])  # fmt: skip
    drift = f"energy drift in {durations[long]:g} s" if long else "energy drift"
    targets = [f"time to {shortest(target)} rad" for target in _ENGINE_TARGETS]
    head = [
        "method",
        "ok on scenes",
        "measured order",
        "best defect (rad)",
        "best error (rad)",
        *targets,
        drift,
        "zero pitch",
        "wrong but reported as success",
    ]
    able_head = [
        "method",
        "joint damping: best error (rad)",
        "load over time: best error (rad)",
        "loads",
        "linearization",
        "software",
        "lines of code",
    ]
    return [
        PageTable("Accuracy and cost over all scenes", head, reached),
        PageTable("Capabilities", able_head, able),
    ]


def _worst_cell(own: Mapping[str, Sequence[Record]], column: str) -> TableCell | str:
    """Return a cell with the largest of a method's smallest errors.

    The smallest error is taken over the settings of each scene, the largest over the scenes. The
    note has the scene, and the number of scenes on which all settings failed.

    Parameters
    ----------
    own : the curves of the method, by scene.
    column : name of the column with the error.
    """
    values = {name: work_precision.values_of(curves, column) for name, curves in own.items()}
    known = {name: min(of_scene) for name, of_scene in values.items() if of_scene}
    if not known:
        is_cut = any(work_precision.left_out(curve) for curves in own.values() for curve in curves)
        return (
            (TableCell("not measured") if is_cut else TableCell("none", "bad")) if own else NOTHING
        )
    # If finer settings were left out on this scene, the value is an upper bound.
    worst = max(known, key=lambda name: known[name])
    is_bound = known[worst] > 0.0 and any(map(work_precision.left_out, own[worst]))
    bound = "≤ " if is_bound else ""
    note = worst if len(own) > 1 else ""
    failed = sum(
        not any(map(work_precision.left_out, own[name])) for name in own.keys() - known.keys()
    )
    if failed:
        note += f"; fails on {failed} of {len(own)}"
    return TableCell(bound + number(known[worst]), "bad" if failed else "", note=note)


def _reach_cell(
    scenes: Mapping[str, Sequence[Record]], own: Mapping[str, Sequence[Record]], target: float
) -> TableCell:
    """Return a cell with the number of scenes on which a method reaches an error.

    The cell also has the run time relative to that of the fastest method, as a median over these
    scenes.

    Parameters
    ----------
    scenes : the curves of all methods, by scene.
    own : the curves of the method, by scene.
    target : the error, rad.
    """
    reached: dict[str, work_precision.Reach] = {}
    cut = 0  # number of scenes on which the error might be reached by settings that were left out
    for name, curves in own.items():
        ranked = work_precision.fastest(scenes[name], target)
        reach = next(
            (reach for curve, reach in ranked if any(curve is one for one in curves)), None
        )
        if reach is not None:
            reached[name] = reach
        elif any(work_precision.left_out(curve) for curve in curves):
            cut += 1
    if not reached and cut:
        return TableCell("not measured")
    text, note = f"{'≥ ' if cut else ''}{len(reached)} of {len(own)}", ""
    if reached:
        seconds = [reach.seconds for reach in reached.values()]
        text += f", × {number(float(np.median([reach.ratio for reach in reached.values()])))}"
        times = dict.fromkeys(with_unit(value, "s") for value in (min(seconds), max(seconds)))
        note = " to ".join(times)
    return TableCell(text, note=note)


def _order_cell(curves: Sequence[Record]) -> str:
    """Return a text with the measured and the nominal order of a method with a fixed step.

    The text is "adaptive" for a method without a nominal order.

    Parameters
    ----------
    curves : curves of the method on all scenes.
    """
    claimed = [
        curve.attributes["order_expected"]
        for curve in curves
        if "order_expected" in curve.attributes
    ]
    seen = [
        curve.attributes["order"] for curve in curves if claimed and "order" in curve.attributes
    ]
    if not claimed:
        return "adaptive"
    return f"{number(float(np.median(seen)) if seen else None)} (nominal {claimed[0]:g})"


def _drift_cell(run: StoredRun | None) -> TableCell | str:
    if run is None:
        return NOTHING
    if run.status == "timed_out":
        return "not measured"
    if run.status not in COMPLETE:
        return TableCell(words_of(run.status), "bad")
    return number(run.attributes.get("energy_drift_max"))


def _zero_pitch_cell(own: Mapping[str, Sequence[Record]]) -> TableCell | str:
    """Return a cell that says whether pitch angles remain zero that are zero in the reference.

    They must remain zero at every setting.

    Parameters
    ----------
    own : the curves of the method, by scene.
    """
    known = work_precision.values_of(
        (curve for curves in own.values() for curve in curves), "zero_pitch_max"
    )
    if not known:
        return NOTHING
    return (
        "kept"
        if not any(known)
        else TableCell("lost", "bad", note=f"up to {with_unit(max(known), 'rad')}")
    )


def _false_success_cell(
    own: Mapping[str, Sequence[Record]], suite: Sequence[SuiteRun]
) -> TableCell | str:
    """Return a cell with the number of wrong results for which an engine reported success.

    Parameters
    ----------
    own : the curves of the method, by scene.
    suite : runs of the method in the stability suite. If there are none, the failed settings of
        the curves are counted.
    """
    if suite:
        # A run that the time limit ended is neither correct nor wrong.
        finished = [run for run in suite if run.status != "timed_out"]
        wrong = [run for run in finished if run.status not in ("ok", "unchecked")]
        claimed, count, late = (
            sum(run.false_success for run in wrong),
            len(wrong),
            len(suite) - len(finished),
        )
        note = f"{len(finished)} finished" + (f", {late} over the time limit" if late else "")
    else:
        curves = [curve for of_scene in own.values() for curve in of_scene]
        claimed = sum(int(curve.arrays["false_success"].sum()) for curve in curves)
        count, note = (
            sum(int(work_precision.failed(curve).sum()) for curve in curves),
            "on this page",
        )
    if not count:
        return TableCell("all ok" if suite else "none failed", note=note)
    what = "not ok" if suite else "failed"
    return TableCell(f"{claimed} of {count} {what}", "bad" if claimed else "", note=note)


def point_table(curves: Sequence[Record], *, only_faults: bool = False) -> PageTable:
    """Return a table with a row for each setting that was run.

    The settings of a curve that the time budget left out share a row.

    Parameters
    ----------
    curves : curves of one scene.
    only_faults : whether the table omits settings that are ok or were left out.
    """
    columns = {
        name: COLUMNS[name]
        for name in _POINT_COLUMNS
        if all(name in curve.arrays for curve in curves)
    }
    units = [f" ({column.units})" if column.units != "1" else "" for column in columns.values()]
    names = [
        f"{column.long_name.partition('; -1')[0]}{unit}"
        for column, unit in zip(columns.values(), units, strict=True)
    ]
    rows: list[Row] = []
    for curve in curves:
        left_out = [i for i, status in enumerate(curve.statuses) if status == "left_out"]
        for i, status in enumerate(curve.statuses):
            if i in left_out[1:] or (only_faults and status in ("ok", "left_out")):
                continue
            values = []
            for name, column in columns.items():
                value = curve.arrays[name][i]
                if i in left_out:
                    values.append("")
                elif column.kind == "<i8":
                    values.append(str(int(value)))
                else:
                    values.append(number(float(value) if np.isfinite(value) else None, 3))
            size = float(curve.arrays["setting"][i])
            setting = (
                with_unit(size, "s", 3)
                if curve.attributes["setting_kind"] == "step"
                else number(size)
            )
            if i in left_out[:-1]:
                setting += f" and {len(left_out) - 1} finer"
            claim = "the engine reported success" if curve.arrays["false_success"][i] else ""
            message = "; ".join(filter(None, (curve.messages[i], claim)))
            outcome = TableCell(
                words_of(status), tone="" if status == "ok" else "bad", note=message
            )
            rows.append([method_cell(curve.name), setting, outcome, *values])
    return PageTable("Every setting", ("method", "setting", "status", *names), rows)
