"""Build the page of a scene: what happened, loads, agreement of the methods, and all numbers.

The page of a scene of the paper compares the printed model with the corrected one. The page of any
other scene shows the motion and the loads of its corrected run, or of its printed run if there is
no corrected one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from markupsafe import Markup

from rotor_mbs.analysis.published import ENERGY_RISE, Published
from rotor_mbs.methods.catalogue import REFERENCE, is_corrected
from rotor_mbs.report.elements import (
    Array,
    Curve,
    Element,
    Fact,
    Fold,
    Grid,
    Legend,
    Mark,
    Note,
    PageContent,
    PageTable,
    Plot,
    Row,
    Section,
    SourceText,
    TableCell,
    Viewer,
)
from rotor_mbs.report.looks import (
    BLUE,
    GREY,
    VERMILLION,
    Look,
    coordinate_look,
    label_of,
    look_of,
    with_capital,
)
from rotor_mbs.report.numbers import (
    SPACE,
    fixed,
    number,
    prefixed,
    seconds,
    span,
    typeset,
    typeset_title,
    up_to,
    with_unit,
)
from rotor_mbs.report.pages import (
    Report,
    agree_within,
    agreement,
    agreement_table,
    agreement_text,
    compared_time,
    horizon_of,
    metric,
    metrics_tables,
    paper,
    status_text,
)
from rotor_mbs.report.pages import scene_plots as draw
from rotor_mbs.report.pages.scene_plots import CORRECTED, PRINTED, ChannelCurves, Jumps
from rotor_mbs.report.pages.viewer import viewer
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import values_at
from rotor_mbs.solution.status import GOOD, OK_ERROR

HORIZON_NOTE = (
    "Horizon: the time until which an error of the initial state has grown by less than a factor "
    "of 100 000; after it two accurate solutions may differ visibly. Energy error: change of the "
    "total energy minus the work, relative to the energy scale: sum over the blades of weight "
    "times distance of the centre of mass from the hub centre, plus the initial kinetic and spring "
    "energy, plus the largest work."
)
DEFECT_NOTE = (
    "From each sample the corrected equations are integrated to the next one; the defect is the "
    "difference from the method's own next sample, for the angles, and for the rates times the "
    "interval. Defects do not depend on the growth of errors over the run and cover all of it."
)
_PITCH = "Pitch angle"
# Energy gains below this share of the energy scale are rounding errors.
_NO_ENERGY = 1e-15
_TURN = 2.0 * math.pi
_RPM = 30.0 / math.pi  # rev/min of a rad/s


def scene_page(name: str, report: Report) -> PageContent:
    """Return the content of the page of a scene.

    Parameters
    ----------
    name : name of the scene, a key of `report.scenes` and of `report.files`.
    report : the open results file. The page has links to the pages before and after it.
    """
    scene = report.scenes[name]
    is_paper = (
        bool(scene.figures)
        and len(scene.sides) == 2
        and all("angles" in run for run in scene.sides.values())
    )
    claims = [claim for claim in report.claims if name in claim.scenes]
    content = _paper_page(scene, report, claims) if is_paper else _own_page(scene, report)
    pages = list(report.files.items())
    place = list(report.files).index(name)
    previous = pages[place - 1] if place > 0 else None
    following = pages[place + 1] if place + 1 < len(pages) else None
    return replace(
        content,
        previous=None if previous is None else (previous[1], short_name(previous[0])),
        following=None if following is None else (following[1], short_name(following[0])),
    )


def short_name(scene: str) -> str:
    """Return a scene's name without its folder: "fig11" for "paper/fig11"."""
    return scene.rpartition("/")[2]


def described(scene: StoredScene) -> str:
    """Return a line that describes a scene: its label, figures, blades, duration and samples."""
    parts = [scene.label]
    if scene.figures:
        parts.append(f"Figure{'s' if ',' in scene.figures else ''} {scene.figures} of the paper")
    blades = len(scene.scene.blades)
    parts.append(f"{blades} blade{'s' if blades != 1 else ''}")
    parts.append(f"{scene.scene.duration:g} s, {scene.scene.samples} samples")
    return " · ".join(parts)


def _drawn_runs(scene: StoredScene) -> dict[str, StoredRun]:
    """Return the runs of a scene that have samples, by method.

    The runs that represent the printed and the corrected model come first, so that their curves are
    drawn below those of the other runs.
    """
    drawn = {run.method: run for run in scene.sides.values()}
    for method, run in scene.runs.items():
        if run.samples:
            drawn.setdefault(method, run)
    return drawn


# ---- A scene of the paper


def _paper_page(scene: StoredScene, report: Report, claims: Sequence[Published]) -> PageContent:
    """Return the page of a scene of the paper, which compares the printed and the corrected model.

    Parameters
    ----------
    scene : the scene. Both models have a run with angles.
    report : the open results file.
    claims : the paper's numbers and claims about this scene.
    """
    sections = [
        paper_motion(scene, claims),
        _agreement_section(scene, report),
        paper.claims_section(claims, report, scene),
        _details_section(scene),
    ]
    return PageContent(
        typeset_title(scene.title),
        described(scene),
        paper_answer(scene),
        _paper_facts(scene, claims),
        sections,
    )


def paper_answer(scene: StoredScene) -> list[Markup]:
    """Return sentences on the results for a scene of the paper.

    The first sentences name the corrected methods that failed. The next one says how well the
    corrected runs agree. The last one says when the printed equations depart from them, and whether
    they break off or create energy.

    Parameters
    ----------
    scene : the scene. Both models have a run with angles.
    """
    printed, corrected = scene.sides[PRINTED], scene.sides[CORRECTED]
    sentences = _faults(scene)
    methods, error = agreement(scene)
    if error is not None:
        compared, whole = compared_time([scene])
        text = Markup("Corrected, {}").format(agree_within(methods, error, 2))
        if compared < whole:
            whole_errors = [metric(scene.runs[method], "angle_error_whole") for method in methods]
            at_end = max((value for value in whole_errors if value is not None), default=None)
            text += f" up to {seconds(compared)}"
            if at_end is not None:
                text += f" and within {up_to(at_end)} rad to the end"
        sentences.append(text + ".")
    left, difference = draw.parting(printed, corrected)
    if left is None:
        text = Markup("The equations as printed stay within <b>{} rad</b> of them").format(
            up_to(difference)
        )
    else:
        text = Markup(
            "The equations as printed depart from them by more than {} rad at <b>{}</b>"
        ).format(f"{draw.VISIBLE:g}", with_unit(left, "s"))
    gain, scale = metric(printed, "energy_gain_J"), metric(printed, "energy_scale_J")
    if printed.status not in GOOD:
        end = float(printed.array("time")[-1])
        text += Markup(" and break off at <b>{}</b> ({})").format(
            seconds(end), status_text(printed)
        )
    elif gain is not None and scale and gain > ENERGY_RISE * scale:
        share = f"{number(100.0 * gain / scale)}{SPACE}%"
        text += Markup(" and create <b>{}</b> of energy, {} of what the scene contains").format(
            prefixed(gain, "J"), share
        )
    sentences.append(text + ".")
    return sentences


def _paper_facts(scene: StoredScene, claims: Sequence[Published]) -> list[Fact]:
    """Return the facts at the top of the page of a scene of the paper.

    Parameters
    ----------
    scene : the scene. Both models have a run with angles.
    claims : the paper's numbers and claims about this scene. The first number that the printed
        model has is a fact.
    """
    printed, corrected = scene.sides[PRINTED], scene.sides[CORRECTED]
    facts = [_result_fact(scene, "Corrected model", "✓ verified")]
    left, difference = draw.parting(printed, corrected)
    note = f"largest difference {number(difference, 3)} rad"
    facts.append(
        Fact(
            "Printed model leaves it after", "never" if left is None else with_unit(left, "s"), note
        )
    )
    gain, scale = metric(printed, "energy_gain_J"), metric(printed, "energy_scale_J")
    if gain is not None and scale:
        others = [
            metric(run, "energy_gain_J")
            for run in scene.corrected_runs.values()
            if run.status == "ok"
        ]
        below = max((value for value in others if value is not None), default=None)
        if below is not None and below < _NO_ENERGY * scale:
            below = 0.0
        note = "" if below is None else f"corrected: at most {up_to(below, 1)} J"
        value = prefixed(gain, "J")
        if printed.status not in GOOD:
            value = "runs away"
        elif gain <= ENERGY_RISE * scale:
            value, note = (
                "none",
                f"{prefixed(gain, 'J')} is {number(gain / scale, 1)} of the energy scale",
            )
        facts.append(Fact("Energy created by the printed model", value, note))
    for claim in claims:
        if claim.is_number and claim.printed is not None:
            name = f"Published {paper.quantity_of(claim)}"
            value = f"{fixed(claim.value, claim.decimals)} {paper.unit_of_claim(claim)}"
            note = (
                f"as printed {fixed(claim.printed, claim.decimals)}, corrected "
                f"{number(claim.corrected, 5)}"
            )
            if claim.rounding:
                note += "; amplified rounding error"
            facts.append(Fact(name, value, note))
            break
    return facts


def paper_motion(scene: StoredScene, claims: Sequence[Published]) -> Section:
    """Return the section with the motion of a scene of the paper by both models.

    First come the animation, the rotor angle, and the pitch angle that differs most between the
    models. The other angles follow. The rates are in a folded part.

    Parameters
    ----------
    scene : the scene. Both models have a run with samples.
    claims : the paper's numbers and claims about this scene; see `paper_plots`.
    """
    sides = scene.sides
    axis = draw.whole_time(list(sides.values()))
    assert axis is not None  # both runs have samples
    hero, others, rates = paper_plots(scene, claims)
    elements: list[Grid | Fold | Element] = [
        Legend([(CORRECTED, draw.CORRECTED_LOOK), (PRINTED, draw.PRINTED_LOOK)]),
        hero,
    ]
    if others:
        elements.append(Grid(2, [[plot] for plot in others]))
    if rates:
        count = len(rates) - 1
        hint = f"of the rotor and {count} pitch{'es' if count != 1 else ''}"
        elements.append(Fold("Rates", hint, [Grid(2, [[plot] for plot in rates])]))
    return Section("motion", "Motion", elements)


def paper_plots(
    scene: StoredScene, claims: Sequence[Published]
) -> tuple[Grid, list[Plot], list[Plot]]:
    """Return the plots that compare both models on the page of a scene of the paper.

    Parameters
    ----------
    scene : the scene. Both models have a run with samples.
    claims : the paper's numbers and claims about this scene. A published smallest or largest rotor
        angle is marked in the plot of the rotor angle.

    Returns
    -------
    hero : Grid
        The animation beside two plots: the rotor angle, and the pitch angle that differs most.
    others : list of Plot
        Plots of the other angles.
    rates : list of Plot
        Plots of all rates; empty if one of the two runs has no rates.
    """
    sides = scene.sides
    printed, corrected = sides[PRINTED], sides[CORRECTED]
    axis = draw.whole_time(list(sides.values()))
    assert axis is not None
    marks: list[Mark] = []
    for claim in claims:
        if (
            claim.is_number
            and claim.scene == scene.name
            and claim.metric in ("rotor_angle_min", "rotor_angle_max")
        ):
            text = f"published {paper.quantity_of(claim)} {fixed(claim.value, claim.decimals)} rad"
            marks.append(Mark(text if not marks else "", y=claim.value))
    coordinates = range(corrected.array("angles").shape[1])
    shown = draw.differing_coordinate(printed, corrected, 1)
    plots = {}
    for k in coordinates:
        is_main = k in (0, shown)
        plots[k] = draw.models_plot(
            sides,
            k,
            "angles",
            axis,
            height=158 if is_main else 150,
            marks=marks if k == 0 else (),
            still=is_main,
        )
    moving = viewer(scene, {"as printed": printed, "corrected": corrected})
    # `shown` is 0 if there are no pitches. The rotor angle is then the only plot.
    stack = [plots[k] for k in dict.fromkeys([0, shown])]
    cards: list[list[Element]] = [] if moving is None else [[Viewer(moving, scene.title)]]
    hero = Grid(len(cards) + 1, [*cards, [*stack]])
    rates = []
    if all("rates" in run for run in sides.values()):
        rates = [draw.models_plot(sides, k, "rates", axis, height=150) for k in coordinates]
    return hero, [plots[k] for k in coordinates if k not in (0, shown)], rates


# ---- Any other scene


def _own_page(scene: StoredScene, report: Report) -> PageContent:
    """Return the page of a scene that is not compared with the paper: motion and loads first.

    Parameters
    ----------
    scene : the scene. The motion is that of its corrected run, or of its printed run if there is no
        corrected one.
    report : the open results file.
    """
    run = scene.corrected or scene.printed
    jumps = draw.jumps_of(scene.scene)
    sections = []
    facts = [_result_fact(scene, "Result", "✓ ok")]
    if run is not None and ("angles" in run or "rates" in run):
        motion, others = motion_channels(scene, run, jumps)
        loads = draw.load_channels(scene, run, jumps)
        energies = _energy_channel(run)
        sections.append(_motion_section(scene, run, jumps, motion, others))
        sections.append(_loads_section(run, jumps, loads, energies))
        sections.append(_extremes_section(run, [*motion, *others, *_root_moments(run), *loads]))
        facts += _own_facts(scene, run)
    sections += [_agreement_section(scene, report), _details_section(scene)]
    return PageContent(
        typeset_title(scene.title), described(scene), own_answer(scene, run), facts[:4], sections
    )


def _faults(scene: StoredScene) -> list[Markup]:
    """Return a sentence about each corrected method of the scene whose run is not ok.

    If there are more than two such methods, a single sentence names all of them.
    """
    sentences = []
    for method, run in scene.corrected_runs.items():
        if run.status in GOOD:
            continue
        reason = str(run.attributes.get("message", ""))
        text = Markup('<span class="bad">{} is {}</span>').format(
            with_capital(label_of(method)), status_text(run)
        )
        if run.status == "timed_out":
            text = Markup('<span class="bad">{} timed out</span>').format(
                with_capital(label_of(method))
            )
        if run.status in ("solver_failed", "worker_died", "diverged"):
            text = Markup('<span class="bad">{}: {}</span>').format(
                with_capital(label_of(method)), status_text(run)
            )
        text += f": {typeset(reason)}." if reason else "."
        error = metric(run, "angle_error_max")
        if run.status == "inaccurate" and error is not None and error <= OK_ERROR:
            # Another bound was exceeded, such as that of the energy. The sentence adds that the
            # angles, which most readers need, are accurate.
            text += f" Its angles are within {up_to(error)} rad of the reference"
            compared, whole = compared_time([scene])
            text += f" up to {seconds(compared)}." if compared < whole else "."
        sentences.append(text)
    # The reasons of many failures would be too long for the answer. They are in the tables.
    if len(sentences) > 2:
        names = [
            label_of(method)
            for method, run in scene.corrected_runs.items()
            if run.status not in GOOD
        ]
        text = Markup('<span class="bad">{} of {} methods are not ok</span>: {}.')
        return [text.format(len(names), len(scene.corrected_runs), ", ".join(names))]
    return sentences


def own_answer(scene: StoredScene, run: StoredRun | None) -> list[Markup]:
    """Return sentences on the motion of a rotor: turns, speed, pitch, and largest root moment.

    The first sentences name the methods that failed. The last one says how well the methods agree.

    Parameters
    ----------
    scene : the scene.
    run : the run whose motion is described; None if no run has samples.
    """
    sentences = _faults(scene)
    if run is None:
        return [*sentences, Markup("No run of this scene has samples.")]
    time = run.array("time")
    whole = seconds(float(time[-1]))
    if "angles" in run:
        angles = run.array("angles")
        turns = float(angles[-1, 0] - angles[0, 0]) / _TURN
        if abs(turns) >= 1.0:
            backwards = " backwards" if turns < 0.0 else ""
            text = Markup("The rotor turns{} <b>{} times in {}</b>").format(
                backwards, number(abs(turns), 3), whole
            )
        else:
            low, high = (
                number(float(value), 3)
                for value in np.degrees([angles[:, 0].min(), angles[:, 0].max()])
            )
            text = Markup("In {} the rotor moves between <b>{}° and {}°</b>").format(
                whole, low, high
            )
            if low == high:
                text = Markup("For {} the rotor stays at <b>{}°</b>").format(whole, low)
        if "rates" in run:
            speed = run.array("rates")[:, 0]
            text += Markup(", at {} rad/s").format(span(float(speed.min()), float(speed.max())))
        sentences.append(text + ".")
        if angles.shape[1] > 1:
            pitch = np.degrees(angles[:, 1:])
            low, high = (number(float(value), 3) for value in (pitch.min(), pitch.max()))
            text = Markup("Pitch stays between <b>{}° and {}°</b>.").format(low, high)
            if low == high:
                text = Markup("Pitch stays at <b>{}°</b>.").format(low)
            sentences.append(text)
    moment = _peak(run, "blade_root_moment")
    if moment is not None:
        size, blade, at = moment
        text = Markup("The largest blade root moment is <b>{}</b>, blade {} at {}.")
        sentences.append(text.format(prefixed(size, "N m"), blade, seconds(at)))
    sentences.append(agreement_text(scene))
    return [sentence for sentence in sentences if sentence]


def _peak(run: StoredRun, name: str) -> tuple[float, int, float] | None:
    """Return the largest magnitude of a blade load, the number of its blade, and its time (s).

    The first blade is 1. None is returned if the run does not have the load `name`, or has no
    finite value of it.
    """
    if name not in run:
        return None
    values = run.array(name)
    sizes = np.linalg.norm(values, axis=2) if values.ndim == 3 else np.abs(values)
    if not np.isfinite(sizes).any():
        return None
    sample, blade = np.unravel_index(int(np.nanargmax(sizes)), sizes.shape)
    return float(sizes[sample, blade]), int(blade) + 1, float(run.array("time")[sample])


def _root_moments(run: StoredRun) -> list[ChannelCurves]:
    """Return a list with the channel of the magnitudes of the blade root moments.

    The list is empty if the run does not have these moments. The answer and the facts of the page
    give the largest magnitude, but the channels of loads have only the components of the vectors.
    """
    if "blade_root_moment" not in run:
        return []
    sizes = np.linalg.norm(run.array("blade_root_moment"), axis=2)
    return [_in_units("Blade root moment, magnitude", "N m", _blade_curves(sizes))]


def _result_fact(scene: StoredScene, name: str, good: str) -> Fact:
    """Return the fact that says how many corrected methods are ok.

    If a method is not ok, the value of the fact is the statuses that are not ok.

    Parameters
    ----------
    scene : the scene whose corrected runs are counted.
    name : name of the fact.
    good : value of the fact if all methods are ok.
    """
    runs = scene.corrected_runs
    if not runs:
        text = "reference only" if scene.reference is not None else "not checked"
        return Fact(name, text, "no run of a corrected model")
    good_runs = [run for run in runs.values() if run.status == "ok"]
    note = (
        f"{len(good_runs)} of {len(runs)} method{'s' if len(runs) != 1 else ''} ok, limit "
        f"{OK_ERROR:g} rad"
    )
    if len(good_runs) == len(runs):
        return Fact(name, good, note, "good")
    statuses = dict.fromkeys(status_text(run) for run in runs.values() if run.status != "ok")
    is_bad = any(run.status not in GOOD for run in runs.values())
    return Fact(name, ", ".join(statuses), note, "bad" if is_bad else "")


def _own_facts(scene: StoredScene, run: StoredRun) -> list[Fact]:
    """Return facts about a run: rotor speed, largest moments, pitch, and compared time.

    Parameters
    ----------
    scene : the scene, whose runs were compared with the reference up to the horizon.
    run : the run that is shown.
    """
    facts = []
    if "rates" in run:
        low, high = (
            float(value)
            for value in (run.array("rates")[:, 0].min(), run.array("rates")[:, 0].max())
        )
        turns = f"{span(low * _RPM, high * _RPM)} rev/min"
        facts.append(Fact("Rotor speed", f"{span(low, high)} rad/s", turns))
    for name, title in (
        ("blade_root_moment", "root moment"),
        ("pitch_actuator_moment", "actuator moment"),
    ):
        peak = _peak(run, name)
        if peak is not None and peak[0] > 0.0:
            size, blade, at = peak
            facts.append(
                Fact(
                    f"Largest {title}",
                    prefixed(size, "N m"),
                    f"blade {blade}, at {seconds(at)}",
                )
            )
    if "angles" in run and run.array("angles").shape[1] > 1:
        pitch = run.array("angles")[:, 1:]
        low, high = np.degrees([pitch.min(), pitch.max()]).tolist()
        blades = f"of {pitch.shape[1]} blade{'s' if pitch.shape[1] > 1 else ''}"
        facts.append(Fact("Pitch", span(low, high, unit="°"), blades))
    compared, whole = compared_time([scene])
    if compared:
        note = "the reference's horizon" if compared < whole else "the whole run"
        facts.append(Fact("Compared with a reference", seconds(compared), note))
    return facts


def motion_channels(
    scene: StoredScene, run: StoredRun, jumps: Jumps
) -> tuple[list[ChannelCurves], list[ChannelCurves]]:
    """Return the channels of the motion of a run in two lists: main channels, and the others.

    Parameters
    ----------
    scene : scene of the run.
    run : run with angles, rates, or both.
    jumps : jumps of the scene's prescribed loads. Curves of power are interrupted there.

    Returns
    -------
    main : list of ChannelCurves
        Rotor speed and pitch angles, if the run has them.
    others : list of ChannelCurves
        Powers, rotor angle, and pitch rates, if the run has them.
    """
    main, others = [], []
    rotor = coordinate_look(0)
    if "rates" in run:
        speed = run.array("rates")[:, 0]
        main.append(
            ChannelCurves("Rotor speed", "rad/s", [("rotor", rotor, speed)], draw.LEAST_ANGLE)
        )
    if "angles" in run:
        angles = run.array("angles")
        if angles.shape[1] > 1:
            pitches = _blade_curves(np.degrees(angles[:, 1:]))
            main.append(ChannelCurves(_PITCH, "degrees", pitches, math.degrees(draw.LEAST_ANGLE)))
        unit, factor = "revolutions", 1.0 / _TURN
        if abs(float(angles[-1, 0] - angles[0, 0])) < _TURN:
            unit, factor = "degrees", math.degrees(1.0)
        turned = [("rotor", rotor, factor * angles[:, 0])]
        others.append(ChannelCurves("Rotor angle", unit, turned, factor * draw.LEAST_ANGLE))
    if "rates" in run:
        rates = run.array("rates")
        others = [*_powers(scene.scene, run, jumps), *others]
        if rates.shape[1] > 1:
            others.append(
                ChannelCurves("Pitch rate", "rad/s", _blade_curves(rates[:, 1:]), draw.LEAST_ANGLE)
            )
    return main, others


def _blade_curves(values: Array) -> list[tuple[str, Look, Array]]:
    return [(f"blade-{i + 1}", draw.blade_look(i), column) for i, column in enumerate(values.T)]


def _commands(scene: Scene, time: Array) -> list[Curve]:
    """Return the curves (degrees) of the pitch commands that change over time.

    Equal commands of several blades have one curve. The points of a curve are the rows of the
    command's table within the range of `time`, (n,) s.
    """
    curves = []
    look = Look(GREY, ":", "", "command")
    for table in dict.fromkeys(rest for _, rest in scene.pitch_loads):
        if len({value for _, value in table}) > 1:
            times, values = draw.values_over(table, time)
            curves.append(Curve("command", look, times, np.degrees(values)))
    return curves


def _powers(scene: Scene, run: StoredRun, jumps: Jumps) -> list[ChannelCurves]:
    """Return the channels of power: torque on the rotor with shaft damper, and pitch actuators.

    Parameters
    ----------
    scene : scene of the run. An actuator has a curve only if its torque or its command changes
        over time.
    run : run with rates. If it has no angles, the actuators are left out.
    jumps : jumps of the prescribed loads. The curves are interrupted there.
    """
    time, rates = run.array("time"), run.array("rates")
    # `values_at` returns the value after a jump. Stored loads have the value before it. The loads
    # are therefore evaluated slightly earlier than the samples.
    before = time * (1.0 - 1e-12)
    breaks = jumps.breaks(time)
    channels = []
    curves = []
    if scene.has_torque:
        torque = values_at(scene.rotor_torque, before)
        curves.append(("rotor", coordinate_look(0, "torque"), torque * rates[:, 0]))
        if scene.shaft_damping:
            look = Look(VERMILLION, "-", "", "shaft damper")
            curves.append(("damper", look, -scene.shaft_damping * rates[:, 0] ** 2))
        channels.append(_in_units("Power of the torque", "W", curves, breaks))
    driven = []
    if "angles" in run:
        angles = run.array("angles")
        for i, (torque_table, rest_table) in enumerate(scene.pitch_loads):
            if not any(
                len({value for _, value in table}) > 1 for table in (torque_table, rest_table)
            ):
                continue
            # The moment of an actuator is the sum of the pitch torque and the moments of a spring
            # to the commanded angle and of a damper.
            torque, rest = (values_at(table, before) for table in (torque_table, rest_table))
            stiffness, damping = scene.bearings[i]
            moment = torque + stiffness * (rest - angles[:, 1 + i]) - damping * rates[:, 1 + i]
            driven.append((f"blade-{i + 1}", draw.blade_look(i), moment * rates[:, 1 + i]))
    if driven:
        channels.append(_in_units("Power of the pitch actuators", "W", driven, breaks))
    return channels


def _in_units(
    name: str, unit: str, curves: Sequence[tuple[str, Look, Array]], breaks: Sequence[int] = ()
) -> ChannelCurves:
    scale, prefixed_unit = draw.in_units([values for _, _, values in curves], unit)
    return ChannelCurves(
        name,
        prefixed_unit,
        [(key, look, values / scale) for key, look, values in curves],
        breaks=breaks,
    )


def _torque_plot(scene: Scene, run: StoredRun, jumps: Jumps) -> Plot | None:
    """Return the plot of the torque on the rotor; None if no torque acts on it.

    The points of the curve are the rows of the torque's table, not the samples of the run.

    Parameters
    ----------
    scene : scene with the torque.
    run : run with the time axis.
    jumps : jumps of the prescribed loads. Vertical lines mark them.
    """
    if not scene.has_torque:
        return None
    time = run.array("time")
    times, values = draw.values_over(scene.rotor_torque, time)
    scale, unit = draw.in_units([values], "N m")
    curve = Curve("rotor", coordinate_look(0, "torque"), times, values / scale)
    return Plot(
        "Torque on the rotor",
        unit,
        draw.time_axis(time),
        [curve],
        150,
        marks=jumps.marks(),
    )


def _motion_section(
    scene: StoredScene,
    run: StoredRun,
    jumps: Jumps,
    main: Sequence[ChannelCurves],
    others: Sequence[ChannelCurves],
) -> Section:
    """Return the section with the motion of a run.

    Parameters
    ----------
    scene : scene of the run.
    run : the run that is shown.
    jumps : jumps of the prescribed loads. All plots mark them, and the first plot also names them.
    main : channels that are plotted beside the animation.
    others : channels that are plotted below the animation.
    """
    time = run.array("time")
    axis = draw.time_axis(time)
    moving = viewer(scene, {scene.name: run})
    height = 206 if moving is not None else 180
    marks = jumps.marks(with_text=True)
    stack: list[Element] = []
    commands = _commands(scene.scene, time)
    for channel in main:
        plot = channel.plot(axis, time, height=height * (3 - len(main)), marks=marks, still=True)
        if channel.name == _PITCH:
            plot = replace(plot, curves=[*plot.curves, *commands])
        stack.append(plot)
        marks = jumps.marks()
    cards: list[list[Element]] = [] if moving is None else [[Viewer(moving, scene.title)]]
    if stack and moving is not None:
        cards.append(stack)
    else:
        cards += [[plot] for plot in stack]
    rest = [channel.plot(axis, time, height=150, marks=jumps.marks()) for channel in others]
    torque = _torque_plot(scene.scene, run, jumps)
    if torque is not None:
        rest = [torque, *rest]
    keys: dict[str, Look] = {}
    for channel in [*main, *others]:
        for key, look, _ in channel.curves:
            label = "rotor" if key == "rotor" else look.label
            keys.setdefault(key, replace(look, label=label))
    for curve in commands:
        keys.setdefault(curve.key, curve.look)
    elements: list[Grid | Fold | Element] = [Legend(list(keys.items()))]
    if cards:
        elements.append(Grid(min(len(cards), 2), cards))
    if rest:
        elements.append(Grid(2 if len(rest) in (2, 4) else 3, [[plot] for plot in rest]))
    say = f"By {label_of(run.method)}." if run.method != REFERENCE else ""
    return Section("motion", "Motion", elements, say)


def _energy_channel(run: StoredRun) -> ChannelCurves | None:
    """Return the channel of kinetic energy, potential energy and work.

    None is returned if the run does not have all three.
    """
    names = ("kinetic_energy", "potential_energy", "work")
    if not all(name in run for name in names):
        return None
    looks = (
        Look(VERMILLION, "-", "", "kinetic"),
        Look(BLUE, "-", "", "potential"),
        Look(GREY, "-", "", "work"),
    )
    curves = [(name, look, run.array(name)) for name, look in zip(names, looks, strict=True)]
    return _in_units("Energy", "J", curves)


def _loads_section(
    run: StoredRun, jumps: Jumps, loads: Sequence[ChannelCurves], energy: ChannelCurves | None
) -> Section:
    """Return the section with the loads and energies of a run.

    The components of vectors come first, with x, y and z in a row. The other loads and the energies
    follow.

    Parameters
    ----------
    run : run with the time axis.
    jumps : jumps of the prescribed loads. Each plot marks them.
    loads : channels of the loads. The name of a channel ends in x, y or z if the channel has a
        component of vectors.
    energy : channel of the energies; None if the run does not have them.
    """
    time = run.array("time")
    axis = draw.time_axis(time)
    components = (" x", " y", " z")
    vectors = [channel for channel in loads if channel.name.endswith(components)]
    others = [channel for channel in loads if not channel.name.endswith(components)]
    elements: list[Grid | Fold | Element] = []
    keys: dict[str, Look] = {}
    for channel in loads:
        for key, look, _ in channel.curves:
            keys.setdefault(key, replace(look, label="shaft") if key == "rotor" else look)
    if keys:
        elements.append(Legend(list(keys.items())))
    if vectors:
        cards = []
        for channel in vectors:
            is_still = channel.name == "Blade root moment y"
            # The text above the plots names the frame, so that the plots need not.
            channel = channel._replace(note="")
            cards.append([channel.plot(axis, time, marks=jumps.marks(), still=is_still)])
        elements.append(Grid(3, cards))
    last: list[list[Element]] = [
        [channel.plot(axis, time, height=176, marks=jumps.marks())] for channel in others
    ]
    if energy is not None:
        legend = Legend([("", look) for _, look, _ in energy.curves])
        last.append([energy.plot(axis, time, height=176, marks=jumps.marks()), legend])
    if last:
        elements.append(Grid(min(len(last), 2), last))
    heading = "Loads and energy" if loads and energy is not None else "Loads" if loads else "Energy"
    say = "Drag over a plot to zoom all of them in time; double-click to go back."
    if jumps.times and loads:
        say += " Loads that jump with the torque or a command are interrupted there."
    frames = dict.fromkeys(channel.note for channel in vectors)
    if len(frames) > 1:
        say += " Components are in the blade frame for blade loads, else in the base frame."
    elif vectors:
        say += f" Components are in the {vectors[0].note}."
    return Section("loads", heading, elements, say)


def _extremes_section(run: StoredRun, channels: Sequence[ChannelCurves]) -> Section:
    """Return the section with the extremes, means and standard deviations of all curves.

    Parameters
    ----------
    run : run with the times of the samples.
    channels : channels of the run. Each of their curves is a row of the table; curves without a
        finite value are left out.
    """
    time = run.array("time")
    rows: list[Row] = []
    for channel in channels:
        for _, look, values in channel.curves:
            if not np.isfinite(values).any():
                continue
            low, high = int(np.nanargmin(values)), int(np.nanargmax(values))
            name = channel.name if len(channel.curves) == 1 else f"{channel.name}, {look.label}"
            row: list[TableCell | str] = [name, channel.unit]
            for sample in (low, high):
                row += [
                    _floored(float(values[sample]), channel.floor),
                    _time_cell(float(time[sample])),
                ]
            row += [
                _floored(float(statistic(values)), channel.floor)
                for statistic in (np.nanmean, np.nanstd)
            ]
            rows.append(row)
    head = ("Quantity", "Unit", "Smallest", "at (s)", "Largest", "at (s)", "Mean", "Std. deviation")
    table = PageTable("Extremes", head, rows, wide=(3, 5, 6, 7), sortable=True)
    return Section("extremes", "Extremes", [table] if rows else [])


def _floored(value: float, floor: float) -> TableCell:
    """Return a cell with four digits of a value; 0 if its magnitude is at most `floor`."""
    shown = 0.0 if abs(value) <= floor else value
    return TableCell(number(shown, 4), order=shown)


def _time_cell(time: float) -> TableCell:
    return TableCell(fixed(time, 2), order=time)


# ---- Sections of both kinds of pages


def _agreement_section(scene: StoredScene, report: Report) -> Section:
    """Return the section with a table of all runs, and plots of their errors over time.

    Parameters
    ----------
    scene : the scene whose runs are compared.
    report : the open results file. If it is of the stability suite, the table has the outcomes of
        the suite.
    """
    runs = _drawn_runs(scene)
    suite_runs = [run for run in report.suite_runs if run.scene == scene.name]
    elements: list[Grid | Fold | Element] = [agreement_table(scene, suite_runs)]
    axis = draw.whole_time(list(runs.values()))
    horizon = horizon_of(scene)
    marks = []
    if axis is not None and horizon is not None and horizon < axis.last:
        marks = [Mark(f"horizon {with_unit(horizon, 's', 3)}", horizon)]
    plots: list[list[Element]] = []
    methods: dict[str, None] = {}
    if axis is not None:
        angles = draw.error_curves(runs, draw.angle_errors(scene, runs))
        energies = draw.error_curves(runs, draw.energy_errors(runs))
        methods = dict.fromkeys(curve.key for curve in [*angles, *energies])
        if angles:
            extra = _uncertainty(scene)
            still = len(scene.corrected_runs) > 0
            plots.append(
                [
                    draw.error_plot(
                        "Angle error",
                        "rad",
                        [*extra, *angles],
                        axis,
                        note="largest over all angles",
                        marks=marks,
                        still=still,
                    )
                ]
            )
        if energies:
            note = "kinetic + potential − work − initial"
            plots.append(
                [draw.error_plot("Energy error / energy scale", "", energies, axis, note=note)]
            )
    if plots:
        items = [(method, look_of(method)) for method in methods]
        if any(curve.key == "uncertainty" for curve in _uncertainty(scene)):
            items.append(("uncertainty", _UNCERTAINTY))
        elements += [Legend(items), Grid(2, plots)]
    benched = scene.name in report.curves
    if benched:
        link = Markup('<a href="bench.html">Error against run time of this scene\'s methods</a>')
        elements.append(Note(link))
    if len(scene.runs) < 2:
        return Section("agreement", "Accuracy", elements)
    say = ""
    if scene.reference is not None and scene.methods:
        say = "Every method against the reference, which is computed in quad precision."
        if marks:
            say += (
                " After the horizon an initial rounding error has grown 100 000 times, and two "
                "right solutions may differ."
            )
    return Section("agreement", "Agreement between methods", elements, say)


_UNCERTAINTY = Look(GREY, ":", "", "uncertainty of the reference")


def _uncertainty(scene: StoredScene) -> list[Curve]:
    """Return a list with the curve of the reference's uncertainty, rad.

    The list is empty if the uncertainty is unknown or too small to be drawn.
    """
    reference = scene.reference
    if reference is None or "angle_uncertainty" not in reference:
        return []
    values = reference.array("angle_uncertainty")
    if not values.size or not values.max() > draw.LOWEST:
        return []
    return [Curve("uncertainty", _UNCERTAINTY, reference.array("time"), draw.positive(values))]


def _details_section(scene: StoredScene) -> Section:
    """Return the section of folded details: interval defects, joints, all metrics, scene file.

    Parameters
    ----------
    scene : the scene whose runs and file are shown.
    """
    runs = {name: run for name, run in _drawn_runs(scene).items() if name != REFERENCE}
    folds: list[Grid | Fold | Element] = []
    axis = draw.whole_time(list(runs.values()))
    if axis is not None:
        curves = draw.error_curves(runs, draw.interval_errors(runs), first=1)
        if curves:
            plot = draw.error_plot("Interval defect", "rad", curves, axis)
            legend = Legend([(f"{curve.key} ", curve.look) for curve in curves])
            plot = replace(plot, curves=[replace(curve, key=f"{curve.key} ") for curve in curves])
            hint = "where in time a method departs from the equations of motion"
            folds.append(Fold("Interval defects", hint, [legend, plot, Note(DEFECT_NOTE)]))
        gaps = {
            name: run.array("constraint_error")
            for name, run in runs.items()
            if "constraint_error" in run
        }
        if gaps:
            plot = draw.error_plot(
                "Largest gap of a joint", "m", draw.error_curves(runs, gaps), axis
            )
            folds.append(Fold("Joints", "how far they open in models with joints", [plot]))
    tables = metrics_tables(scene)
    if any(table.rows for table in tables):
        notes = [Note(HORIZON_NOTE)] if horizon_of(scene) is not None else []
        if any(run.status in GOOD and not is_corrected(run.method) for run in scene.runs.values()):
            notes.append(
                Note(
                    "Completed: the printed equations reached the end; nothing is claimed of them."
                )
            )
        hint = f"{max(len(table.rows) for table in tables)} quantities"
        folds.append(Fold("All numbers of every method", hint, [*tables, *notes]))
    text = scene.attributes.get("scene_toml")
    if text:
        folds.append(Fold("Scene file", f"{scene.name}.toml", [SourceText(str(text))]))
    return Section("details", "Verification in detail", folds)
