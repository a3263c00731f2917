"""Build the page of the modes of scenes, and the figures of `Modes.plot` in Python."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup

from rotor_mbs.analysis.modes import (
    AGREEMENT,
    GROWTH,
    ROTATION,
    FloquetTable,
    LinearModes,
    SceneModes,
    multiblade,
)
from rotor_mbs.analysis.whirl import HERTZ, RPM, FixedFrame
from rotor_mbs.errors import InputError
from rotor_mbs.report.canvas import RPM_AXIS, Panels, curve, log_axis, panels
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
from rotor_mbs.report.looks import BLUE, GREY, VERMILLION, Look, coordinate_look, with_capital
from rotor_mbs.report.numbers import (
    NOTHING,
    SPACE,
    in_words,
    number,
    text_range,
    typeset_title,
    up_to,
)
from rotor_mbs.scenario.keys import counted
from rotor_mbs.solution.trajectory import Array

_MARKS = ("o", "s", "^", "D", "v", "P", "x")
_TURN = 2.0 * math.pi
# Frequencies below this share of the largest one are those of rigid motions, and count as zero.
# Frequencies that differ by at most this share of the largest one count as equal.
_ZERO = 1e-6
# A change of damping ratios or growth rates below this share of the largest one is not magnified.
_FLAT = 1e-3
_TALL = 30.0  # if a modulus of a multiplier is larger, the axis is logarithmic
_NOTHING = 1e-9  # smaller growth rates in 1/s, and smaller damping ratios, are rounding errors


class ModePlots:
    """Plots of the modes of a scene."""

    def __init__(self, modes: SceneModes) -> None:
        self._modes = modes

    def __call__(self) -> Panels:
        """Plot the Campbell diagram: damped frequencies (Hz) over the rotor speed (rpm).

        The panels have the frequencies in the rotating frame, the frequencies in the fixed frame if
        whirl is defined, and the change of the former from the lowest speed. Dotted lines are
        multiples of the speed.

        Raises
        ------
        InputError
            If no modes over speed were computed.
        """
        modes = self._rotation()
        motions = _motions(modes)
        frames = {"frequency (Hz)": motions.rotating}
        if motions.fixed is not None:
            frames = {"rotating frame (Hz)": motions.rotating, "fixed frame (Hz)": motions.fixed}
        panel = panels((2.6,) * len(frames) + (1.5,), RPM_AXIS)
        rpm = modes.speeds * RPM
        for axes, (label, frequencies) in zip(panel.axes, frames.items(), strict=False):
            top = _top(frequencies)
            _draw_harmonics(axes, modes, top)
            axes.set_ylim(0.0, top)
            axes.set_ylabel(label)
        first = _first_known(motions.rotating)
        is_fast = np.nanmax(motions.rotating, axis=0, initial=0.0) > _ZERO * _top(motions.rotating)
        change = np.where(is_fast, motions.rotating - first, np.nan)
        for axes, values in zip(panel.axes, [*frames.values(), change], strict=True):
            for k, name in enumerate(motions.names):
                # The markers of each mode begin at another sample, so that curves that lie on each
                # other can be told apart.
                every = (k, len(motions.names) * max(1, len(rpm) // 24))
                look = mode_look(k, name)
                curve(axes, rpm, values[:, k], look, markevery=every, markersize=4.0)
        panel.axes[-1].set_ylabel("change (Hz)")
        panel.with_legend()
        # The margin above the axes is set again, with more room for each line of the legend than
        # `with_legend` leaves.
        lines = math.ceil(len(motions.names) / 2)
        height = float(panel.figure.get_figheight())
        panel.figure.subplots_adjust(top=1.0 - (0.15 + 0.24 * lines) / height)
        return panel

    def damping(self) -> Panels:
        """Plot damping ratios and growth rates (1/s) over rotor speed (rpm).

        Raises
        ------
        InputError
            If no modes over speed were computed.
        """
        modes = self._rotation()
        panel = panels((2.0, 2.0), RPM_AXIS)
        curves = {"damping ratio": modes.damping_ratios, "growth rate (1/s)": modes.growth_rates}
        for axes, (label, numbers) in zip(panel.axes, curves.items(), strict=True):
            for k, values in enumerate(numbers.T):
                look = replace(mode_look(k, modes.names[k]), marker="")
                curve(axes, modes.speeds * RPM, values, look)
            axes.set_ylabel(label)
        return panel.with_legend()

    def multipliers(self) -> Panels:
        """Plot moduli of the Floquet multipliers over rotor speed (rpm).

        Raises
        ------
        InputError
            If no multipliers were computed.
        """
        table = self._modes.floquet
        if table is None:
            reason = "no Floquet multipliers; they need gravity and speeds above 0"
            for note in self._modes.notes:  # a note has the reason if, say, heyoka is missing
                if note.startswith("no Floquet multipliers"):
                    reason = note
            raise InputError(f"{self._modes.scene}: {reason}")
        panel = panels((2.6,), RPM_AXIS)
        axes = panel.axes[0]
        rpm = table.speeds * RPM
        sizes = np.abs(table.multipliers)
        shown = np.where(sizes > 0.0, sizes, np.nan)
        for k, sizes_of_one in enumerate(shown.T):
            look = Look(BLUE, "", "o", "" if k else "each")
            curve(axes, rpm, sizes_of_one, look, markersize=2.0, markerfacecolor=BLUE)
        curve(axes, rpm, table.largest, Look(VERMILLION, "-", "", "largest"), 1.5)
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


class _Motions(NamedTuple):
    """Hold the curves of a Campbell diagram, with their names.

    The curves are motions in both frames if whirl is defined, else modes in the rotating frame.
    """

    names: tuple[str, ...]
    rotating: Array  # (speeds, motions) Hz
    fixed: Array | None  # (speeds, motions) Hz; None if no whirl is defined


def _motions(linear: LinearModes) -> _Motions:
    """Return the curves of a Campbell diagram.

    Parameters
    ----------
    linear : modes over speed.
    """
    frame = linear.fixed_frame
    if isinstance(frame, FixedFrame):
        return _Motions(frame.names, frame.rotating * HERTZ, frame.fixed * HERTZ)
    return _Motions(linear.names, linear.damped_frequencies * HERTZ, None)


def _top(frequencies: Array) -> float:
    """Return the upper end of an axis of frequencies, a little above the largest."""
    return float(np.nanmax(frequencies, initial=0.0)) * 1.08 or 1.0


def _first_known(frequencies: Array) -> Array:
    """Return the first finite value of each column of frequencies; 0 for a column without one.

    Parameters
    ----------
    frequencies : (speeds, motions) Hz.
    """
    columns = [column[np.isfinite(column)][:1] for column in frequencies.T]
    return np.array([column.sum() for column in columns])


def _harmonics(blades: int) -> list[int]:
    """Return the multiples of the rotor speed that are drawn, ascending.

    They are 1 to 6, the number of blades, and twice this number. Gravity and wind shear excite a
    blade once per revolution. A tower is excited by each blade in turn, and thus as many times per
    revolution as there are blades.
    """
    return sorted({*range(1, 7), blades, 2 * blades})


def _draw_harmonics(axes: Any, modes: LinearModes, top: float) -> None:
    """Draw multiples of the rotor speed as dotted lines with their numbers.

    Parameters
    ----------
    axes : axes of matplotlib with frequency (Hz) over rotor speed (rpm).
    modes : modes over speed.
    top : upper end of the vertical axis, Hz.
    """
    revolutions = np.abs(modes.speeds) * HERTZ
    fastest = float(revolutions[-1])
    multiples = _harmonics(modes.blades)
    is_apart = fastest > 0.05 * top  # if not, the labels would lie on each other
    for k in multiples:
        axes.plot(modes.speeds * RPM, k * revolutions, color=GREY, linewidth=0.7, linestyle=":")
        if fastest > 0.0 and (is_apart or k == multiples[-1]):
            end = min(fastest, 0.8 * top / k)  # below the legend and the highest curve
            place = math.copysign(end, modes.speeds[-1]) / HERTZ * RPM
            axes.text(place, k * end, f"{k}P", color=GREY, ha="right", va="bottom", fontsize=8.0)


def mode_look(index: int, name: str) -> Look:
    """Return the look of the curve of a mode, with its colour, line and marker.

    Up to seven modes have different markers, because curves of equal frequencies lie on each other.

    Parameters
    ----------
    index : index of the mode.
    name : name of the mode in the legend.
    """
    return replace(coordinate_look(index, name), marker=_MARKS[index % len(_MARKS)])


def modes_page(modes: Sequence[SceneModes]) -> PageContent:
    """Return the content of the page of modes.

    The page has the modes of each scene over rotor speed, under gravity, and at rest. Its facts are
    those of the first scene that has facts.

    Parameters
    ----------
    modes : modes of each scene; at least one scene.
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
    """Return sentences on faults, frequencies at rest, stability, and agreement of the models.

    If the models do not agree, the sentence on their agreement comes directly after the faults.

    Parameters
    ----------
    scene : the modes of one scene.
    """
    sentences = []
    models = max(len(scene.rest), len(scene.rotation))
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
            sentences.append(Markup("at rest its natural frequencies are <b>{}</b>.").format(text))
    table = scene.floquet
    if table is not None and len(table.speeds):
        unstable = table.speeds[table.stable == 0]
        known_count = int((table.stable != -1).sum())
        if len(unstable):
            text = Markup(
                'under gravity its rotation is <span class="bad">unstable at {} of {} '
                "speeds</span>, {}."
            )
            ends = [number(float(end) * RPM, 3) for end in (unstable.min(), unstable.max())]
            where = f"{text_range(*ends)}{SPACE}rpm"
            sentences.append(text.format(len(unstable), known_count, where))
        elif known_count:
            every = "all" if known_count == len(table.speeds) else f"{known_count} of"
            text = Markup("under gravity its rotation is <b>stable at {} {} speeds</b>, up to {}.")
            highest = f"{number(float(table.speeds[table.stable != -1].max()) * RPM, 3)}{SPACE}rpm"
            sentences.append(text.format(every, len(table.speeds), highest))
    if models > 1:
        how = Markup("agree within <b>{}</b> of the largest eigenvalue")
        place = len(sentences)
        if scene.disagreement > AGREEMENT:
            how = Markup(
                '<span class="bad">do not agree: they differ by {} of the largest eigenvalue</span>'
            )
            place = 0
        how = how.format(_difference(scene))
        sentences.insert(place, Markup("the modes of {} models {}.").format(in_words(models), how))
    faults = [
        Markup('<span class="bad">{}: {}</span>.').format(scene.label, fault)
        for fault in scene.faults
    ]
    if not sentences:
        return faults
    first = Markup("{}: {}").format(scene.label, sentences[0])
    return [*faults, first, *(Markup(with_capital(text)) for text in sentences[1:])]


def _difference(scene: SceneModes) -> str:
    """Return the largest difference of the models as text; rounded up if the models agree."""
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
        rpm = text_range(number(low * RPM, 3), number(high * RPM, 3))
        facts.append(Fact("Rotor speeds", f"{rpm} rpm", f"{speeds} rad/s"))
        damped = rotation.damping_ratios[np.isfinite(rotation.damping_ratios)]
        if len(damped) and float(np.abs(damped).max()) > _NOTHING:
            low, high = float(damped.min()), float(damped.max())
            ratios = text_range(_shown(low, 3), _shown(high, 3))
            note = "in rotation without gravity, over all speeds"
            facts.append(Fact("Damping ratio", ratios, note))
    if scene.floquet is not None and _has_multipliers(scene.floquet):
        largest = float(np.nanmax(scene.floquet.largest))
        is_bad = bool((scene.floquet.stable == 0).any())
        note = "of a Floquet multiplier under gravity; above 1 is unstable"
        digits = 6 if abs(largest - 1.0) < 0.01 else 3  # near 1 the difference from 1 is needed
        facts.append(
            Fact("Largest modulus", number(largest, digits), note, "bad" if is_bad else "")
        )
    return facts


def _has_multipliers(table: FloquetTable) -> bool:
    """Return whether the table has multipliers other than those that are 1 for every motion."""
    return bool((table.largest[np.isfinite(table.largest)] > 0.0).any())


def _scene_sections(scene: SceneModes, name: str, *, with_name: bool) -> list[Section]:
    """Return the sections of one scene.

    Parameters
    ----------
    scene : modes of the scene.
    name : prefix of the ids of the sections and of the keys of the curves.
    with_name : whether headings and axes name the scene, because the page has several scenes.
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
        sections += _campbell(rotation, name, axis_name, before)
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
        highest = float(rotation.speeds[last])
        hint = f"{number(highest * RPM, 4)} rpm, {number(highest, 4)} rad/s"
        folds.append(
            Fold("Modes at the highest speed", hint, [*_tables(rotation, last), Note(_FRAMES)])
        )
        folds.append(_over_speed(rotation))
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


def _campbell(rotation: LinearModes, name: str, axis_name: str, before: str) -> list[Section]:
    """Return the section with the Campbell diagram, and the section with damping over speed.

    The diagram has the frequencies in both frames and multiples of the rotor speed. The plot in the
    fixed frame is left out if no whirl is defined. The section with damping is left out if all
    damping and growth is rounding error.

    Parameters
    ----------
    rotation : modes over speed.
    name : prefix of the ids of the sections and of the keys of the curves.
    axis_name : name of the horizontal axis. Plots with axes of the same name are zoomed together.
    before : prefix of the headings.
    """
    rpm = rotation.speeds * RPM
    axis = Horizontal(axis_name, "rpm", "speed", float(rpm[0]), float(rpm[-1]))
    motions = _motions(rotation)
    looks = [mode_look(k, motion) for k, motion in enumerate(motions.names)]
    first = _first_known(motions.rotating)
    items = [(f"{name} motion {k}", look) for k, look in enumerate(looks)]
    multiples = ", ".join(f"{k}P" for k in _harmonics(rotation.blades))
    items.append((f"{name} harmonics", Look(GREY, ":", "", f"{multiples} from below")))

    def curves(values: Array, *, are_named: bool = True) -> list[Curve]:
        names = _names_beside(values, motions.names) if are_named else [""] * len(looks)
        drawn = []
        for (key, look), column, beside in zip(items, values.T, names, strict=False):
            drawn.append(Curve(key, look, rpm, column, beside=beside))
        return drawn

    def diagram(title: str, values: Array) -> Plot:
        lines = _harmonic_curves(rotation, _top(values), f"{name} harmonics")
        # The curves come before the multiples of the speed, because the texts at their ends are
        # placed in this order. If there is too little room, a multiple has no text.
        return Plot(title, "Hz", axis, [*curves(values), *lines], 320, still=True)

    cards = [[diagram("Rotating frame", motions.rotating)]]
    say = (
        "Damped frequency (Hz) over the rotor speed (rpm), in steady rotation without gravity; a "
        "torque keeps the speed. 1P, 2P, ...: multiples of the rotor speed. "
    )
    if motions.fixed is not None:
        cards.append([diagram("Fixed frame", motions.fixed)])
        say += _WHIRL
    else:
        reason = str(rotation.fixed_frame)
        say += f"Frequencies are in the rotating frame; in the fixed frame, {reason}."
    change = curves(motions.rotating - first, are_named=False)
    least = 1e-9 * _top(motions.rotating)
    if np.nanmax(np.abs(motions.rotating - first), initial=0.0) > least:
        cards.append([Plot("Change from the lowest speed", "Hz", axis, change, 200, least=least)])
    section = Section(
        f"{name}-rotation", f"{before}Campbell diagram", [Legend(items), Grid(2, cards)], say
    )
    damped = _damping(rotation, name, axis)
    if damped is None:
        return [section]
    return [section, replace(damped, heading=f"{before}{damped.heading}")]


def _harmonic_curves(rotation: LinearModes, top: float, key: str) -> list[Curve]:
    """Return the curves of the multiples of the rotor speed in Hz, with their names.

    Parameters
    ----------
    rotation : modes over speed.
    top : frequency at which the curves end, Hz.
    key : key of all these curves.
    """
    rpm = rotation.speeds * RPM
    lines = []
    for k in _harmonics(rotation.blades):
        # The line ends where it leaves the plot. The speed there is not a sample, and is added.
        last = top / k / HERTZ * RPM
        ends = [end for end in (-last, last) if rpm[0] < end < rpm[-1]]
        places = np.unique([*rpm[np.abs(rpm) <= last], *ends])
        look = Look(GREY, ":", "", f"{k}P")
        line = k * np.abs(places) / RPM * HERTZ
        lines.append(Curve(key, look, places, line, beside=f"{k}P"))
    return lines


def _names_beside(values: Array, names: Sequence[str]) -> list[str]:
    """Return the text at the end of each curve.

    If several curves are equal, the text of the first one has the names of all of them, and the
    others have the text "".

    Parameters
    ----------
    values : (speeds, curves) frequencies.
    names : name of each curve.
    """
    top = _top(values)
    groups: list[list[int]] = []
    for k, column in enumerate(values.T):
        for group in groups:
            apart = np.nanmax(np.abs(column - values[:, group[0]]), initial=0.0)
            if apart <= _ZERO * top:
                group.append(k)
                break
        else:
            groups.append([k])
    texts = [""] * len(names)
    for group in groups:
        shown = [names[k] for k in group]
        if len(shown) > 1:
            shown = ["whirl" if "whirl" in name else name for name in shown]
        texts[group[0]] = ", ".join(dict.fromkeys(shown))
    return texts


def _damping(rotation: LinearModes, name: str, axis: Horizontal) -> Section | None:
    """Return the section with damping ratios and growth rates over speed.

    None is returned if all of them are rounding errors.

    Parameters
    ----------
    rotation : modes over speed.
    name : prefix of the id of the section and of the keys of the curves.
    axis : horizontal axis with the rotor speed in rpm.
    """
    damping, growth = rotation.damping_ratios, rotation.growth_rates
    sizes = [np.nanmax(np.abs(values), initial=0.0) for values in (damping, growth)]
    if max(sizes) <= _NOTHING:
        return None
    items = [(f"{name} {k}", mode_look(k, mode)) for k, mode in enumerate(rotation.names)]
    cards = []
    for title, unit, values in (("Damping ratio", "", damping), ("Growth rate", "1/s", growth)):
        curves = []
        for (key, look), column in zip(items, values.T, strict=True):
            curves.append(Curve(key, look, rotation.speeds * RPM, column))
        least = max(_NOTHING, _FLAT * float(np.nanmax(np.abs(values), initial=0.0)))
        cards.append([Plot(title, unit, axis, curves, 200, least=least)])
    return Section(f"{name}-damping", "Damping over speed", [Legend(items), Grid(2, cards)])


def _turning(scene: SceneModes, name: str, axis_name: str) -> Section | None:
    """Return the section with plots of the Floquet multipliers over speed.

    None is returned if the multipliers were not computed at two speeds or more, or if all of them
    are 1 for every motion.

    Parameters
    ----------
    scene : modes of the scene.
    name : prefix of the id of the section and of the keys of the curves.
    axis_name : name of the horizontal axis; see `_campbell`.
    """
    table = scene.floquet
    if table is None or len(table.speeds) < 2 or not _has_multipliers(table):
        return None
    speeds = table.speeds * RPM
    axis = Horizontal(axis_name, "rpm", "speed", float(speeds[0]), float(speeds[-1]))
    sizes = np.abs(table.multipliers)
    shown = np.where(sizes > 0.0, sizes, np.nan)
    each = [
        Curve(f"{name} each", Look(BLUE, "-", "", "each"), speeds, column, dots="only")
        for column in shown.T
    ]
    largest = Curve(f"{name} largest", Look(VERMILLION, "-", "", "largest"), speeds, table.largest)
    known = shown[np.isfinite(shown)]
    # The multipliers above 1 are of interest. On a logarithmic axis small multipliers would take
    # most of the range. They are cut off.
    is_log = float(known.max(initial=0.0)) > _TALL
    mark = [Mark("1: above it the motion is unstable", y=1.0)]
    plot = Plot(
        "Modulus of the multipliers",
        "",
        axis,
        [*each, largest],
        240,
        clip=(1.0 / _TALL, 2.0 * float(known.max())) if is_log else None,
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
        "those that are 1 for every such motion. For 0 rpm see the modes at rest."
    )
    return Section(f"{name}-turning", "Rotation under gravity", [Grid(2, [[plot], [rates]])], say)


_AT_REST = (
    "Small motions about the equilibrium that is found from the initial angles by decreasing the "
    "potential energy, without the torque on the rotor. The shapes of modes with equal frequencies "
    "are not unique: any linear combination of them is a mode shape."
)
_WHIRL = (
    "In the fixed frame, a wave of the pitches that runs round the rotor is seen at its frequency "
    "in the rotating frame plus the rotor speed times its nodal diameters if it runs the way the "
    "rotor turns (forward), minus if it runs the other way (backward; absolute value). The shaft "
    "is free: “rotor” turns all blades together, and the collective pitch moves the rotor, too."
)
_FRAMES = (
    "Frequencies are in the rotating frame, but for whirl: a pair of cosine and sine modes is a "
    "backward and a forward whirl in the fixed frame, with the frequency decreased and increased "
    "by the rotor speed times the nodal diameters. Undamped frequency: square root of the product "
    "of a mode's two eigenvalues. Damping ratio: minus their mean, relative to that."
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
                number(speed * RPM, 4),
                number(speed, 4),
                cell,
                *(_shown(float(values[i]), digits) for values, digits in numbers),
            ]
        )
    head = (
        "Speed (rpm)",
        "speed (rad/s)",
        "largest multiplier",
        "growth rate (1/s)",
        "product minus trace",
        "torque (N m)",
    )
    return PageTable("Multipliers over speed", head, rows)


def _tables(linear: LinearModes, i: int) -> list[PageTable]:
    """Return two tables for one rotor speed: frequencies with damping, and mode shapes.

    Parameters
    ----------
    linear : modes by one model.
    i : index of the speed.
    """
    columns = {
        "undamped (Hz)": linear.undamped_frequencies * HERTZ,
        "damped (Hz)": linear.damped_frequencies * HERTZ,
        "undamped (rad/s)": linear.undamped_frequencies,
        "damped (rad/s)": linear.damped_frequencies,
        "damping ratio": linear.damping_ratios,
        "growth rate (1/s)": linear.growth_rates,
    }
    if linear.kind == ROTATION:
        backward, forward = linear.whirl
        columns["backward whirl (Hz)"] = backward * HERTZ
        columns["forward whirl (Hz)"] = forward * HERTZ
    frequencies, shapes = [], []
    for k, name in enumerate(linear.names):
        frequencies.append([name, *(_shown(float(values[i, k]), 7) for values in columns.values())])
        amplitudes = np.abs(linear.multiblade_shapes[i][k])
        largest = max(float(amplitudes.max()), 1e-300)
        shapes.append([name, *(_shown(float(amplitude) / largest, 3) for amplitude in amplitudes)])
    head = ("Shape (largest amplitude 1)", "rotor", *multiblade(linear.blades)[0])
    caption = f"Modes by the {linear.label} ({linear.source})"
    return [
        PageTable(caption, ("Mode", *columns), frequencies, wide=(3, 4, 6)),
        PageTable("Mode shapes", head, shapes),
    ]


def _over_speed(rotation: LinearModes) -> Fold:
    """Return the folded tables of the frequencies (Hz) over the rotor speed, one for each frame.

    Parameters
    ----------
    rotation : modes over speed.
    """
    frames = {"Rotating frame (Hz)": (rotation.names, rotation.damped_frequencies)}
    frame = rotation.fixed_frame
    if isinstance(frame, FixedFrame):
        frames["Fixed frame (Hz)"] = (frame.names, frame.fixed)
    tables = []
    for title, (names, frequencies) in frames.items():
        rows: list[Row] = []
        for speed, values in zip(rotation.speeds.tolist(), frequencies * HERTZ, strict=True):
            cells = [_shown(value, 6) for value in values.tolist()]
            rows.append([number(speed * RPM, 4), number(speed, 4), *cells])
        tables.append(PageTable(title, ("Speed (rpm)", "speed (rad/s)", *names), rows))
    elements: list[Element] = []
    for table in tables:
        elements += [Note(table.caption), table]
    return Fold("Frequencies over speed", f"{len(rotation.speeds)} speeds, Hz", elements)


def _shown(value: float, digits: int) -> str:
    """Return a number as text; "0" if it is a rounding error, a dash if it is not finite.

    Magnitudes below _NOTHING are rounding errors of eigenvalues.
    """
    if not math.isfinite(value):
        return NOTHING
    return number(0.0 if abs(value) < _NOTHING else value, digits)
