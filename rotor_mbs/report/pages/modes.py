"""Build the page of modes, and their figures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from markupsafe import Markup

from rotor_mbs.analysis.modes import (
    AGREEMENT,
    GROWTH,
    FloquetTable,
    LinearModes,
    SceneModes,
    multiblade,
)
from rotor_mbs.errors import InputError
from rotor_mbs.report.canvas import SPEED_AXIS, Panels, curve, log_axis, panels
from rotor_mbs.report.elements import (
    Curve,
    Element,
    Fact,
    Fold,
    Grid,
    Horizontal,
    Legend,
    Mark,
    Note,
    PageContent,
    PageTable,
    Plot,
    Row,
    Section,
    TableCell,
)
from rotor_mbs.report.looks import BLUE, GREY, VERMILLION, Look, coordinate_look
from rotor_mbs.report.numbers import (
    NOTHING,
    SPACE,
    in_words,
    number,
    text_range,
    typeset_title,
    up_to,
)
from rotor_mbs.report.pages import is_wide
from rotor_mbs.scenario.keys import counted
from rotor_mbs.solution.trajectory import Array

_MARKS = ("o", "s", "^", "D", "v", "P", "x")
_TURN = 2.0 * math.pi
_ZERO = 1e-6  # share of the largest frequency; below it is that of a rigid motion
_NOTHING = 1e-9  # 1/s, or of a frequency: a smaller growth or damping is rounding error


class ModePlots:
    """Plots of the modes of a scene."""

    def __init__(self, modes: SceneModes) -> None:
        self._modes = modes

    def __call__(self) -> Panels:
        """Plot the Campbell diagram: damped frequencies (rad/s) over rotor speed.

        Dotted lines are multiples of the speed; the lower panel has the change from the lowest
        speed.

        Raises
        ------
        InputError
            Where no modes over speed were computed.
        """
        modes = self._rotation()
        panel = panels((2.9, 1.7), SPEED_AXIS)
        frequencies, speeds = modes.damped_frequencies, modes.speeds
        top = float(np.nanmax(frequencies, initial=0.0)) * 1.08 or 1.0
        apart = float(speeds[-1]) > 0.05 * top  # else the labels would lie on each other
        # Gravity excites a blade once per revolution, a tower or a yaw error each blade in turn.
        harmonics = sorted({1, 2, modes.blades, 2 * modes.blades})
        for k in harmonics:
            panel.axes[0].plot(speeds, k * speeds, color=GREY, linewidth=0.7, linestyle=":")
            if apart or k == harmonics[-1]:
                end = min(float(speeds[-1]), top / k)
                panel.axes[0].text(
                    end, k * end, f"{k}P", color=GREY, ha="right", va="bottom", fontsize=8.0
                )
        for k, known in enumerate(frequencies.T):
            first = known[np.flatnonzero(np.isfinite(known))[:1]]
            change = np.where(np.nanmax(known) > 1e-6 * top, known - first, np.nan)
            # Markers of each mode begin at another sample: equal curves lie on each other.
            every = (k, frequencies.shape[1] * max(1, len(speeds) // 24))
            for axes, values in zip(panel.axes, (known, change), strict=True):
                curve(
                    axes,
                    speeds,
                    values,
                    mode_look(k, modes.names[k]),
                    markevery=every,
                    markersize=4.0,
                )
        panel.axes[0].set_ylim(0.0, top)
        panel.axes[0].set_ylabel("frequency (rad/s)")
        panel.axes[1].set_ylabel("change (rad/s)")
        return panel.with_legend()

    def damping(self) -> Panels:
        """Plot damping ratios and growth rates (1/s) over rotor speed.

        Raises
        ------
        InputError
            Where no modes over speed were computed.
        """
        modes = self._rotation()
        panel = panels((2.0, 2.0), SPEED_AXIS)
        curves = {"damping ratio": modes.damping_ratios, "growth rate (1/s)": modes.growth_rates}
        for axes, (label, numbers) in zip(panel.axes, curves.items(), strict=True):
            for k, values in enumerate(numbers.T):
                curve(axes, modes.speeds, values, replace(mode_look(k, modes.names[k]), marker=""))
            axes.set_ylabel(label)
        return panel.with_legend()

    def multipliers(self) -> Panels:
        """Plot moduli of the Floquet multipliers over rotor speed.

        Raises
        ------
        InputError
            Where there are no multipliers.
        """
        table = self._modes.floquet
        if table is None:
            raise InputError(
                f"{self._modes.scene}: no Floquet multipliers; they need gravity and speeds above 0"
            )
        panel = panels((2.6,), SPEED_AXIS)
        axes = panel.axes[0]
        sizes = np.abs(table.multipliers)
        shown = np.where(sizes > 0.0, sizes, np.nan)
        for k, sizes_of_one in enumerate(shown.T):
            look = Look(BLUE, "", "o", "" if k else "each")
            curve(axes, table.speeds, sizes_of_one, look, markersize=2.0, markerfacecolor=BLUE)
        curve(axes, table.speeds, table.largest, Look(VERMILLION, "-", "", "largest"), 1.5)
        axes.axhline(1.0, color=GREY, linewidth=0.8)
        known = sizes[np.isfinite(sizes) & (sizes > 0.0)]
        if len(known) and known.max() / known.min() > 10.0:
            log_axis(axes, float(known.min()), float(known.max()))
        elif len(known) and known.max() / known.min() < 1.0 + 10.0 * GROWTH:
            axes.set_ylim(0.9, 1.1)
        axes.set_ylabel("modulus of the multipliers")
        return panel.with_legend()

    def _rotation(self) -> LinearModes:
        for linear in self._modes.rotation.values():
            return linear
        raise InputError(
            f"{self._modes.scene}: no modes over speed; allowed: modes computed with speeds"
        )


def mode_look(index: int, name: str) -> Look:
    """Return the line and the marker of a mode.

    Each mode has a marker of its own, since curves of equal frequencies lie on each other.
    """
    return replace(coordinate_look(index, name), marker=_MARKS[index % len(_MARKS)])


def modes_page(modes: Sequence[SceneModes]) -> PageContent:
    """Return the content of the page of modes.

    It has the modes of each scene over speed, under gravity, and at rest. The facts are those of
    the first scene that has any.

    Parameters
    ----------
    modes : of each scene; at least one.
    """
    sections: list[Section] = []
    answer: list[Markup] = []
    facts: list[Fact] = []
    for place, scene in enumerate(modes):
        answer += mode_answer(scene)
        if not facts:
            facts = _facts(scene)
        sections += _scene_sections(scene, f"scene{place}", with_name=len(modes) > 1)
    title = (
        typeset_title(modes[0].title)
        if len(modes) == 1
        else f"Modes of {in_words(len(modes))} scenes"
    )
    about = ", ".join(scene.label for scene in modes)
    return PageContent(title, f"Modes and Campbell diagram of {about}", answer, facts, sections)


def _first(kind: Mapping[str, LinearModes]) -> LinearModes | None:
    return next(iter(kind.values()), None)


def mode_answer(scene: SceneModes) -> list[Markup]:
    """Return sentences: faults, agreement of the models, frequencies at rest, and stability.

    Parameters
    ----------
    scene : the modes of one scene.
    """
    sentences = []
    models = max(len(scene.rest), len(scene.rotation))
    for fault in scene.faults:
        sentences.append(Markup('<span class="bad">{}: {}</span>.').format(scene.label, fault))
    if models > 1:
        how = Markup("agree within <b>{}</b> of the largest eigenvalue")
        if scene.disagreement > AGREEMENT:
            how = Markup(
                '<span class="bad">do not agree: they differ by {} of the largest eigenvalue</span>'
            )
        how = how.format(_difference(scene))
        sentences.append(
            Markup("{}: the modes of {} models {}.").format(scene.label, in_words(models), how)
        )
    rest = _first(scene.rest)
    if rest is not None:
        known = [
            value
            for value in rest.undamped_frequencies[0].tolist()
            if math.isfinite(value) and value > 0.0
        ]
        known = [value for value in known if value > _ZERO * max(known)]
        if known:
            low, high = min(known), max(known)
            text = f"{number(low / _TURN, 4)}{SPACE}Hz"
            if high > 1.001 * low:
                text = f"{number(low / _TURN, 4)} to {number(high / _TURN, 4)}{SPACE}Hz"
            sentences.append(Markup("At rest its natural frequencies are <b>{}</b>.").format(text))
    table = scene.floquet
    if table is not None and len(table.speeds):
        unstable = table.speeds[table.stable == 0]
        known_count = int((table.stable != -1).sum())
        if len(unstable):
            text = Markup(
                'Under gravity its rotation is <span class="bad">unstable at {} of {} '
                "speeds</span>, {}."
            )
            where = text_range(number(float(unstable.min()), 3), number(float(unstable.max()), 3))
            sentences.append(text.format(len(unstable), known_count, f"{where}{SPACE}rad/s"))
        elif known_count:
            every = "all" if known_count == len(table.speeds) else f"{known_count} of"
            text = Markup("Under gravity its rotation is <b>stable at {} {} speeds</b>, up to {}.")
            highest = f"{number(float(table.speeds[table.stable != -1].max()), 3)}{SPACE}rad/s"
            sentences.append(text.format(every, len(table.speeds), highest))
    return sentences


def _difference(scene: SceneModes) -> str:
    """Return the largest difference of the models; rounded up where they agree within it."""
    size = scene.disagreement
    return number(size) if size > AGREEMENT else up_to(size)


def _facts(scene: SceneModes) -> list[Fact]:
    """Return the facts at the top of the page: models, speeds, damping, and largest modulus.

    Parameters
    ----------
    scene : the modes of one scene.
    """
    facts = []
    models = max(len(scene.rest), len(scene.rotation))
    note = f"{models}; difference {_difference(scene)} of the largest eigenvalue"
    if scene.faults:
        facts.append(Fact("Models", "✗ not their equations", scene.faults[0], "bad"))
    elif models > 1 and scene.agrees:
        facts.append(Fact("Models", "✓ agree", note, "good"))
    elif models > 1:
        facts.append(Fact("Models", "✗ do not agree", note, "bad"))
    rotation = _first(scene.rotation)
    if rotation is not None and len(rotation.speeds) > 1:
        low, high = float(rotation.speeds[0]), float(rotation.speeds[-1])
        speeds = text_range(number(low, 3), number(high, 3))
        rpm = text_range(number(low * 60.0 / _TURN, 3), number(high * 60.0 / _TURN, 3))
        facts.append(Fact("Rotor speeds", f"{speeds} rad/s", f"{rpm} rev/min"))
        damped = rotation.damping_ratios[np.isfinite(rotation.damping_ratios)]
        if len(damped) and float(np.abs(damped).max()) > _NOTHING:
            low, high = float(damped.min()), float(damped.max())
            ratios = text_range(_shown(low, 3), _shown(high, 3))
            note = "in rotation without gravity, over all speeds"
            facts.append(Fact("Damping ratio", ratios, note))
    if scene.floquet is not None and np.isfinite(scene.floquet.largest).any():
        largest = float(np.nanmax(scene.floquet.largest))
        is_bad = bool((scene.floquet.stable == 0).any())
        note = "of a Floquet multiplier under gravity; above 1 is unstable"
        facts.append(Fact("Largest modulus", number(largest, 6), note, "bad" if is_bad else ""))
    return facts


def _scene_sections(scene: SceneModes, name: str, *, with_name: bool) -> list[Section]:
    """Return the sections of one scene.

    Parameters
    ----------
    scene : its modes.
    name : begins the ids of the sections and the keys of the curves.
    with_name : whether headings and axes name the scene, where a page has several.
    """
    before = f"{scene.label}: " if with_name else ""
    axis_name = f"rotor speed of {scene.label}" if with_name else "rotor speed"
    sections = []
    rest, rotation = _first(scene.rest), _first(scene.rotation)
    if (
        rotation is not None
        and len(rotation.speeds) > 1
        and not np.isnan(rotation.growth_rates).all()
    ):
        legend, cards = _campbell(rotation, name, axis_name)
        say = (
            "Horizontally: rotor speed (rad/s), in steady rotation without gravity; a torque keeps "
            "the speed. Frequencies are in the rotor's frame; 1P, 2P: multiples of the rotor speed."
        )
        sections.append(
            Section(f"{name}-rotation", f"{before}Campbell diagram", [legend, Grid(2, cards)], say)
        )
    turning = _turning(scene, name, axis_name)
    if turning is not None:
        sections.append(replace(turning, heading=f"{before}{turning.heading}"))
    if rest is not None:
        sections.append(
            Section(f"{name}-rest", f"{before}At rest", [*_tables(rest, 0), Note(_AT_REST)])
        )
    folds: list[Grid | Fold | Element] = []
    if rotation is not None:
        last = len(rotation.speeds) - 1
        hint = f"{number(float(rotation.speeds[last]), 4)} rad/s"
        folds.append(
            Fold("Modes at the highest speed", hint, [*_tables(rotation, last), Note(_FRAMES)])
        )
    if scene.floquet is not None:
        folds.append(
            Fold(
                "Floquet multipliers",
                f"{len(scene.floquet.speeds)} speeds",
                [_multipliers(scene.floquet)],
            )
        )
    if scene.notes:
        folds.append(
            Fold(
                "Not computed",
                counted(len(scene.notes), "note"),
                [Note(text) for text in scene.notes],
            )
        )
    sources = max((list(kind.values()) for kind in (scene.rest, scene.rotation)), key=len)
    models = ", ".join(f"{linear.label} ({linear.source})" for linear in sources)
    folds.append(Fold("Models", models, [Note(_SMALL_MOTIONS)]))
    sections.append(Section(f"{name}-details", f"{before}In detail", folds))
    return sections


def _campbell(
    rotation: LinearModes, name: str, axis_name: str
) -> tuple[Legend, list[list[Element]]]:
    """Return the legend and the plots of frequencies, their change, and damping over speed.

    Multiples of the rotor speed are drawn among the frequencies. Damping and growth are left out
    where they are rounding error.

    Parameters
    ----------
    rotation : modes over speed.
    name : begins the keys of the curves.
    axis_name : of the horizontal axis, which is zoomed together with others of that name.
    """
    speeds = rotation.speeds
    axis = Horizontal(axis_name, "rad/s", "speed", float(speeds[0]), float(speeds[-1]))
    looks = [mode_look(k, mode) for k, mode in enumerate(rotation.names)]
    frequencies = rotation.damped_frequencies
    top = float(np.nanmax(frequencies, initial=0.0)) * 1.08 or 1.0

    def curves(values: Array) -> list[Curve]:
        return [Curve(f"{name} {k}", look, speeds, values[:, k]) for k, look in enumerate(looks)]

    harmonics = []
    multiples = sorted({1, 2, rotation.blades, 2 * rotation.blades})
    for k in multiples:
        line = np.where(k * speeds <= top, k * speeds, np.nan)
        harmonics.append(Curve(f"{name} harmonics", Look(GREY, ":", "", f"{k}P"), speeds, line))
    # The frequency at the lowest speed at which a mode has one; the sum of none is 0.
    first = np.array(
        [column[np.flatnonzero(np.isfinite(column))[:1]].sum() for column in frequencies.T]
    )
    plots = [
        Plot(
            "Damped frequency", "rad/s", axis, [*harmonics, *curves(frequencies)], 300, still=True
        ),
        Plot(
            "Change from the lowest speed",
            "rad/s",
            axis,
            curves(frequencies - first),
            300,
            least=1e-9 * top,
        ),
    ]
    damping, growth = rotation.damping_ratios, rotation.growth_rates
    if (
        max(np.nanmax(np.abs(damping), initial=0.0), np.nanmax(np.abs(growth), initial=0.0))
        > _NOTHING
    ):
        plots.append(Plot("Damping ratio", "", axis, curves(damping), 200, least=_NOTHING))
        plots.append(Plot("Growth rate", "1/s", axis, curves(growth), 200, least=_NOTHING))
    items = [(f"{name} {k}", look) for k, look in enumerate(looks)]
    items.append(
        (
            f"{name} harmonics",
            Look(GREY, ":", "", f"{', '.join(f'{k}P' for k in multiples)} from below"),
        )
    )
    return Legend(items), [[plot] for plot in plots]


def _turning(scene: SceneModes, name: str, axis_name: str) -> Section | None:
    """Return the section with the Floquet multipliers over speed; None without any.

    Parameters
    ----------
    scene : its modes; the section needs multipliers at two speeds or more.
    name : begins the id of the section and the keys of the curves.
    axis_name : of the horizontal axis, as for `_campbell`.
    """
    table = scene.floquet
    if table is None or len(table.speeds) < 2 or not np.isfinite(table.largest).any():
        return None
    speeds = table.speeds
    axis = Horizontal(axis_name, "rad/s", "speed", float(speeds[0]), float(speeds[-1]))
    sizes = np.abs(table.multipliers)
    shown = np.where(sizes > 0.0, sizes, np.nan)
    each = [
        Curve(f"{name} each", Look(BLUE, "-", "", "each"), speeds, column, dots="only")
        for column in shown.T
    ]
    largest = Curve(f"{name} largest", Look(VERMILLION, "-", "", "largest"), speeds, table.largest)
    known = shown[np.isfinite(shown)]
    is_log = is_wide(known)
    mark = [Mark("1: above it the motion is unstable", y=1.0)]
    plot = Plot(
        "Modulus of the multipliers",
        "",
        axis,
        [*each, largest],
        240,
        log=is_log,
        marks=mark,
        least=10.0 * GROWTH,
    )
    rates = Plot(
        "Growth rate",
        "1/s",
        axis,
        [Curve("growth", Look(VERMILLION, "-", "", "largest"), speeds, table.growth_rates)],
        240,
        least=_NOTHING,
    )
    say = (
        "Under gravity a rotating rotor has no equilibrium but a periodic motion. Multipliers are "
        "the eigenvalues of its state transition matrix over one revolution; the largest excludes "
        "those that are 1 for every such motion. For 0 rad/s see the modes at rest."
    )
    return Section(f"{name}-turning", "Rotation under gravity", [Grid(2, [[plot], [rates]])], say)


_AT_REST = (
    "Small motions about the equilibrium that is found from the initial angles by decreasing the "
    "potential energy, without the torque on the rotor. The shapes of modes with equal frequencies "
    "are not unique: any linear combination of them is a mode shape."
)
_FRAMES = (
    "Frequencies are in the rotor's frame; in the base frame a pair of cosine and sine modes is a "
    "backward and a forward whirl, with the frequency decreased and increased by the rotor speed "
    "times its number. Undamped frequency: square root of the product of a mode's two eigenvalues. "
    "Damping ratio: minus their mean, relative to that."
)
_SMALL_MOTIONS = "The geometric stiffness of the chain's constraint forces is included."


def _multipliers(table: FloquetTable) -> PageTable:
    """Return the table of Floquet multipliers, a row per rotor speed.

    Parameters
    ----------
    table : the multipliers of one scene.
    """
    rows: list[Row] = []
    for i, (speed, largest) in enumerate(
        zip(table.speeds.tolist(), table.largest.tolist(), strict=True)
    ):
        text = "unknown" if table.stable[i] == -1 else _shown(largest, 7)
        cell = TableCell(text, "bad" if table.stable[i] == 0 else "", note=table.messages[i])
        numbers = ((table.growth_rates, 4), (table.product_error, 2), (table.torque, 4))
        rows.append(
            [
                number(speed, 4),
                cell,
                *(_shown(float(values[i]), digits) for values, digits in numbers),
            ]
        )
    head = (
        "Speed (rad/s)",
        "largest multiplier",
        "growth rate (1/s)",
        "product minus trace",
        "torque (N m)",
    )
    return PageTable("Multipliers over speed", head, rows)


def _tables(linear: LinearModes, i: int) -> list[PageTable]:
    """Return the tables of frequencies and of mode shapes at the speed of index `i`.

    Parameters
    ----------
    linear : modes by one model.
    i : index of the speed.
    """
    columns = {
        "undamped (Hz)": linear.undamped_frequencies / (2.0 * math.pi),
        "undamped (rad/s)": linear.undamped_frequencies,
        "damped (rad/s)": linear.damped_frequencies,
        "damping ratio": linear.damping_ratios,
        "growth rate (1/s)": linear.growth_rates,
        "backward whirl (rad/s)": linear.whirl[0],
        "forward whirl (rad/s)": linear.whirl[1],
    }
    frequencies, shapes = [], []
    for k, name in enumerate(linear.names):
        frequencies.append([name, *(_shown(float(values[i, k]), 7) for values in columns.values())])
        amplitudes = np.abs(linear.multiblade_shapes[i][k])
        largest = max(float(amplitudes.max()), 1e-300)
        shapes.append([name, *(_shown(float(amplitude) / largest, 3) for amplitude in amplitudes)])
    head = ("Shape (largest amplitude 1)", "rotor", *multiblade(linear.blades)[0])
    caption = f"Modes by the {linear.label} ({linear.source})"
    return [
        PageTable(caption, ("Mode", *columns), frequencies),
        PageTable("Mode shapes", head, shapes),
    ]


def _shown(value: float, digits: int) -> str:
    """Return a number; 0 for what is rounding error of an eigenvalue, a dash if not finite."""
    if not math.isfinite(value):
        return NOTHING
    return number(0.0 if abs(value) < _NOTHING else value, digits)
