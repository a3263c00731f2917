"""Write the paper's figures as files for a manuscript.

A figure has a column for the printed model, one for the corrected model, and one for the
differences of the printed model and of an independent computation from the corrected model. Its
file has a title and a description; a text file beside it has the caption. Scenes that are not the
paper's, or were changed, have a figure of the same layout.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.errors import InputError
from rotor_mbs.methods.catalogue import PRINTED, errata_methods
from rotor_mbs.report import canvas, plots
from rotor_mbs.report.looks import Look, label_of, look_of, step_look, with_capital
from rotor_mbs.report.numbers import up_to
from rotor_mbs.report.paper_figures import (
    CORRECTED,
    HEADINGS,
    INDEPENDENT,
    MOTION,
    PATHS,
    PRINTED_SIDE,
    TORQUES,
    PaperFigure,
    all_figures,
    panel_runs,
)
from rotor_mbs.runs.output_files import replace_file
from rotor_mbs.runs.read import StoredRun, StoredScene, open_results
from rotor_mbs.runs.versions import made_with
from rotor_mbs.scenario.scene import scene_tables
from rotor_mbs.solution.trajectory import Array

# Heading of the column of differences. The caption says from which model they are taken.
DIFFERENCE = "Difference"
# Heading of the column of the corrected model in a scene without a printed model, in which nothing
# was corrected.
REFERENCE_HEADING = "Motion"
_PAPER = "Aguilar-Acevedo et al., Revista UIS Ingenierías 19(1), 25-36, 2020"
# in; room for a legend of two lines and the label of the axis above it
_LEGEND_HEIGHT = 0.95
_LOWEST = 1e-17  # rad, rad/s, m; differences up to this value are gaps on the logarithmic axis


# ---- Drawing


def draw(figure: PaperFigure, axes: Sequence[Any], runs: Mapping[str, StoredRun]) -> None:
    """Draw the runs of one model of a figure.

    Parameters
    ----------
    figure : the figure. If it shows paths, only those of the first run are drawn.
    axes : axes of matplotlib: one for paths, else two, position above velocity.
    runs : runs of the model by label.
    """
    if figure.kind == PATHS:
        plots.draw_paths(axes[0], next(iter(runs.values())).array("tip"))
        return
    is_rotor = figure.kind == TORQUES
    labels = (
        ("rotor angle (rad)", "rotor rate (rad/s)")
        if is_rotor
        else (plots.ANGLE_AXIS, plots.RATE_AXIS)
    )
    for panel, name, label in zip(axes, ("angles", "rates"), labels, strict=True):
        series = []
        for place, (torque, run) in enumerate(runs.items()):
            of_run = plots.coordinate_series(run.array("time"), run.array(name))
            if is_rotor:
                of_run = [of_run[0]._replace(look=step_look(place, len(runs), torque))]
            series += of_run
        plots.draw_lines(panel, series, label)
    axes[0].set_title("(a) position", loc="left")
    axes[0].tick_params(labelbottom=False)
    axes[1].set_title("(b) angular velocity", loc="left")
    axes[1].set_xlabel(canvas.TIME_AXIS)


def draw_differences(
    figure: PaperFigure, axes: Sequence[Any], runs: Mapping[str, Mapping[str, StoredRun]]
) -> None:
    """Draw how far the printed model and an independent computation are from the corrected one.

    Parameters
    ----------
    figure : the figure.
    axes : axes of matplotlib. If the figure shows paths, there is one, for the distances of the
        tips (m). Otherwise there are two, angles (rad) above rates (rad/s). Their vertical axes
        become logarithmic.
    runs : runs by model, then by label. The corrected model has runs.
    """
    names = ("tip",) if figure.kind == PATHS else ("angles", "rates")
    units = {"tip": "tip distance (m)", "angles": "angle (rad)", "rates": "rate (rad/s)"}
    for panel, name in zip(axes, names, strict=True):
        known = []
        for side in (PRINTED_SIDE, INDEPENDENT):
            for place, (label, run) in enumerate(runs.get(side, {}).items()):
                other = runs[CORRECTED].get(label)
                if other is None or name not in other:
                    continue
                sizes = differences(name, run, other)
                if figure.kind == TORQUES:
                    look = step_look(place, len(runs[side]), "")
                    look = Look(look.colour, "-" if side == PRINTED_SIDE else ":", "")
                else:
                    look = look_of(run.method)
                    look = Look(
                        look.colour,
                        look.line,
                        "",
                        "as printed" if side == PRINTED_SIDE else look.label,
                    )
                shown = np.where(sizes > _LOWEST, sizes, np.nan)
                canvas.curve(panel, run.array("time")[: len(shown)], shown, look)
                known += shown[np.isfinite(shown)].tolist()
        if known:
            canvas.log_axis(panel, 0.7 * min(known), max(known))
        panel.set_ylabel(units[name])
    axes[-1].set_xlabel(canvas.TIME_AXIS)
    if len(axes) > 1:
        axes[0].tick_params(labelbottom=False)


def differences(name: str, run: StoredRun, other: StoredRun) -> Array:
    """Return the difference of two runs at each sample that both have, (n,).

    Parameters
    ----------
    name : quantity that is compared. For "tip" a difference is the largest distance of a blade's
        tips, m. For "angles" or "rates" it is the largest difference over the coordinates, rad or
        rad/s.
    run, other : runs of the same scene.
    """
    n = min(run.samples, other.samples)
    gap = run.array(name)[:n] - other.array(name)[:n]
    sizes = np.linalg.norm(gap, axis=2) if name == "tip" else np.abs(gap)
    result: Array = sizes.reshape(n, -1).max(axis=1)
    return result


def composed(figure: PaperFigure, scenes: Mapping[str, StoredScene]) -> canvas.Panels:
    """Return a figure with a column for each model and a column for the differences.

    A figure of paths has a row for each panel. Other figures have two rows, position above
    velocity.

    Parameters
    ----------
    figure : the figure. At least one run of its scenes is stored.
    scenes : stored scenes by name.
    """
    pictures = panel_runs(figure, scenes)
    keys = [key for key in HEADINGS if any(key in row for row in pictures.values())]
    has_differences = any(len(row) > 1 and CORRECTED in row for row in pictures.values())
    columns = len(keys) + has_differences
    is_paths = figure.kind == PATHS
    with canvas.style(for_print=True):
        rows, height, heading = (len(pictures), 1.8, 1.02) if is_paths else (2, 1.55, 1.16)
        panels = canvas.grid(rows, columns, height)
        table = [panels.axes[i : i + columns] for i in range(0, len(panels.axes), columns)]
        for i, row_of_runs in enumerate(pictures.values()):
            for key in keys:
                if key in row_of_runs:
                    column = [row[keys.index(key)] for row in table]
                    draw(figure, [column[i]] if is_paths else column, row_of_runs[key])
            if has_differences and CORRECTED in row_of_runs:
                column = [row[-1] for row in table]
                draw_differences(figure, [column[i]] if is_paths else column, row_of_runs)
        names = HEADINGS if PRINTED_SIDE in keys else {CORRECTED: REFERENCE_HEADING}
        headings = [names[key] for key in keys]
        if has_differences:
            headings.append(DIFFERENCE)
        for axes, text in zip(table[0], headings, strict=True):
            axes.text(0.5, heading, text, transform=axes.transAxes, ha="center", weight="bold")
        # If a panel has no run of a model, the axes of this model are empty. They are hidden.
        for axes in panels.axes:
            if not axes.has_data():
                axes.set_axis_off()
        # Only the first column and that of the differences have labels of the vertical axis.
        for row in table:
            for axes in row[1 : len(keys)]:
                axes.set_ylabel("")
        for row, letter in zip(table, pictures if is_paths else (), strict=False):
            row[0].text(-0.08, 0.94, f"({letter})", transform=row[0].transAxes)
        labelled = panels.labelled()
        count = min(len(labelled), 5)
        if len(labelled) > count:  # room for a second line of the legend
            figure_height = float(panels.figure.get_figheight())
            panels.figure.subplots_adjust(bottom=_LEGEND_HEIGHT / figure_height)
        panels.figure.legend(
            labelled.values(), labelled, loc="lower center", ncols=count, handlelength=2.6
        )
    return panels


# ---- Titles and captions


def title_of(figure: PaperFigure, scenes: Mapping[str, StoredScene]) -> str:
    """Return the title of a figure.

    It names the figure of the paper that is recomputed. The title of any other figure is that of
    its scene.
    """
    if figure.number:
        return f"Figure {figure.number} of {_PAPER}, recomputed"
    scene = scenes[figure.panels[0][1]]
    return f"{scene.title} ({scene.label})"


def caption_of(figure: PaperFigure, scenes: Mapping[str, StoredScene]) -> str:
    """Return the caption of a figure, several lines.

    The caption says what is shown, for which scenes, by which methods with which settings, and
    which models are right. A corrected model is called right if all its runs have the status ok.

    Parameters
    ----------
    figure : the figure.
    scenes : stored scenes by name.
    """
    pictures = panel_runs(figure, scenes)
    what = {
        MOTION: (
            "(a) Angles (rad) and (b) rates (rad/s) of the rotor and of the pitch of each blade "
            "over time (s)."
        ),
        PATHS: (
            "Paths of the blade tips in space; blades at the start (dashed) and at the end "
            "(solid); equal scales."
        ),
        TORQUES: (
            "(a) Rotor angle (rad) and (b) rotor rate (rad/s) over time (s) for each torque on the "
            "rotor."
        ),
    }[figure.kind]
    title = title_of(figure, scenes) if figure.number else _name(scenes[figure.panels[0][1]])
    lines = [f"{title}.", what]
    for label, name in figure.panels:
        lines.append(_scene_line(label, scenes[name], has_title=bool(figure.number)))
    sides: dict[str, list[StoredRun]] = {}
    for row in pictures.values():
        for key, runs in row.items():
            sides.setdefault(key, []).extend(runs.values())
    if PRINTED_SIDE in sides:
        run = sides[PRINTED_SIDE][0]
        count = len(errata_methods())
        what = (
            f"the equations as printed, with their {count} errors; wrong"
            if run.method == PRINTED
            else label_of(run.method)
        )
        lines.append(f"{HEADINGS[PRINTED_SIDE]}: {what}. {_method_line(run)}")
    name = HEADINGS[CORRECTED] if PRINTED_SIDE in sides else REFERENCE_HEADING
    if CORRECTED in sides:
        text = f"{name}: {_verdict(sides[CORRECTED])}. {_method_line(sides[CORRECTED][0])}"
        bound = _uncertainty(sides[CORRECTED])
        if bound is not None:
            text += f" Its angles are uncertain by at most {up_to(bound)} rad."
        lines.append(text)
    others = []
    if PRINTED_SIDE in sides:
        others.append("of the printed model")
    if INDEPENDENT in sides:
        dotted = " (dotted)" if figure.kind == TORQUES else ""
        others.append(f"of an independent computation{dotted}")
    if CORRECTED in sides and others:
        what = (
            "the largest distance of a tip (m)"
            if figure.kind == PATHS
            else "the largest over all coordinates"
        )
        other = "the corrected model" if PRINTED_SIDE in sides else "the reference"
        text = (
            f"{DIFFERENCE}: {what}, on a logarithmic axis over time (s), {' and '.join(others)} "
            f"from {other}."
        )
        worst = _largest_difference(pictures)
        if INDEPENDENT in sides:
            independent = sides[INDEPENDENT][0]
            text += f" {_method_line(independent)}"
            text += f" It is {_verdict(sides[INDEPENDENT])}"
            if worst is not None:
                text += f"; no angle differs by more than {up_to(worst)} rad"
            text += "."
        lines.append(text)
    return "\n".join(lines) + "\n"


def _name(scene: StoredScene) -> str:
    """Return the title and the name of a scene for a caption."""
    return f"{scene.title} (scene {scene.label})"


def _scene_line(label: str, scene: StoredScene, *, has_title: bool) -> str:
    """Return a line about a scene: start, masses, gravity, duration and samples.

    Parameters
    ----------
    label : label of the scene's panel; "" if the figure has only one.
    scene : the scene.
    has_title : whether the line has the title and the name of the scene. It is false for figures
        that are not the paper's, whose captions begin with them.
    """
    initial = scene_tables(scene.scene)["initial"]
    angles, rates = (
        ", ".join(f"{value:.6g}" for value in initial[key]) for key in ("angles", "rates")
    )
    masses = [f"{blade.mass:.6g}" for blade in scene.scene.blades]
    if len(masses) == 1:
        blades = f"blade of {masses[0]} kg"
    elif len(set(masses)) == 1:
        blades = f"blades each of {masses[0]} kg"
    else:
        blades = f"blades of {', '.join(masses)} kg"
    before = f"({label}) " if label else ""
    start = f"{_name(scene)}: initial" if has_title else "Initial"
    return (
        f"{before}{start} angles {angles} rad and rates {rates} rad/s, rotor first; "
        f"{blades}; gravity {scene.scene.gravity:g} m/s^2; "
        f"{scene.scene.duration:g} s, {scene.scene.samples} samples."
    )


def _verdict(runs: Sequence[StoredRun]) -> str:
    """Return "right" if all runs are ok, else "not verified" with the other statuses."""
    statuses = [run.status.replace("_", " ") for run in runs if run.status != "ok"]
    if not statuses:
        return "right"
    return (
        f"not verified ({len(statuses)} of {len(runs)} runs: {', '.join(dict.fromkeys(statuses))})"
    )


def _method_line(run: StoredRun) -> str:
    """Return the label, the name and the settings of a run's method, as text."""
    settings = ", ".join(f"{name} = {value}" for name, value in run.settings.items())
    name = f"{with_capital(label_of(run.method))} ({run.method})"
    return f"{name}: {settings}." if settings else f"{name}."


def _uncertainty(runs: Iterable[StoredRun]) -> float | None:
    """Return the largest uncertainty of the angles of runs, rad; None if no run has a known one.

    Parameters
    ----------
    runs : runs of one model.
    """
    known = [
        float(run.array("angle_uncertainty").max())
        for run in runs
        if "angle_uncertainty" in run and run.samples
    ]
    # The stored uncertainty does not include the rounding of the angles to double precision, which
    # is half a unit in the last place.
    angles = [
        float(np.abs(run.array("angles")).max())
        for run in runs
        if "angle_uncertainty" in run and run.samples
    ]
    if not known:
        return None
    return max(max(known), 0.5 * float(np.spacing(max(angles))))


def _largest_difference(
    pictures: Mapping[str, Mapping[str, Mapping[str, StoredRun]]],
) -> float | None:
    """Return the largest angle difference between independent and corrected runs, rad.

    None is returned if no two runs can be compared.

    Parameters
    ----------
    pictures : runs by row, then by model, then by label; see `panel_runs`.
    """
    largest = []
    for row in pictures.values():
        for label, run in row.get(INDEPENDENT, {}).items():
            other = row.get(CORRECTED, {}).get(label)
            if other is not None and run.samples and other.samples:
                largest.append(float(differences("angles", run, other).max()))
    return max(largest, default=None)


# ---- Files


def write_figures(
    results: Path, folder: Path, kind: str, numbers: Iterable[str] = ()
) -> list[Path]:
    """Write figures for a manuscript with their captions, and return their files.

    Parameters
    ----------
    results : the results file.
    folder : folder in which the figures are written, such as fig11.pdf with its caption fig11.txt.
    kind : "pdf", "svg" or "png".
    numbers : numbers of the paper's figures, such as "11", or names of other scenes. If none is
        given, all figures that the file has are written.

    Raises
    ------
    InputError
        If the file does not have one of these figures, or has no run with angles and rates.
    StoreError
        If the file cannot be read or the folder cannot be written.
    """
    with open_results(results) as opened:
        known = all_figures(opened.scenes)
        have = {name: figure for name, figure in known.items() if panel_runs(figure, opened.scenes)}
        asked = list(dict.fromkeys(numbers)) or list(have)
        unknown = [name for name in asked if name not in have]
        if not have:
            raise InputError(
                f"{results}: no run with angles and rates in the file; allowed: a file that has one"
            )
        if unknown:
            raise InputError(
                f"{results}: figure {', '.join(unknown)}: not in the file; allowed: "
                f"{', '.join(have)}"
            )
        software = ", ".join(
            f"{name} {version}"
            for name, version in made_with(opened.attributes)
            if name != "created"
        )
        made: dict[str, bytes] = {}
        # The numbers of a divergence may overflow in a caption or a difference, which is no error.
        with np.errstate(over="ignore", invalid="ignore"):
            for name in asked:
                figure = have[name]
                title, caption = title_of(figure, opened.scenes), caption_of(figure, opened.scenes)
                caption += f"{canvas.MARK.decode()}, from {results.name}: {software}\n"
                stem = f"fig{int(name):02d}" if figure.number else name.replace("/", "-")
                panels = composed(figure, opened.scenes)
                made[f"{stem}.{kind}"] = canvas.encoded(
                    panels.figure, kind, title=title, description=caption
                )
                made[f"{stem}.txt"] = caption.encode()
    for name, content in made.items():
        replace_file(folder / name, content, canvas.MARK)
    return [folder / name for name in made]
