"""Every text of the report, in English: headings, captions, axis labels, sentences made from numbers.

Knows numbers and names, not where they come from.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import inf
from typing import TYPE_CHECKING

from rotor_mbs.analysis.methods import model_of
from rotor_mbs.analysis.summary import Agreement, Finding, PrintedEnergy, Reproduced, Tally
from rotor_mbs.report.core.numbers import number, prefixed, quantity
from rotor_mbs.report.names import name_of

if TYPE_CHECKING:
    from rotor_mbs.report.pages.walk_facts import Facts

REPORT = "Rotor report"
TITLE = "A published rotor model against the right ones"
TITLE_PLAIN = "Rotor scenes by independent models"
ERRATA_TITLE = "Errata of the printed equations"
PAPER = (
    "Aguilar-Acevedo et al., Modelado Euler-Lagrange del rotor de un aerogenerador tripala como sistema multicuerpo, "
    "Revista UIS Ingenierías 19(1), 25-36, 2020, doi 10.18273/revuin.v19n1-2020002"
)

# Headings
FINDING = "The finding"
SCENES = "Scenes"
NUMBERS = "Published numbers"
CLAIMS = "Published claims"
CONDITIONS = "What the paper does not print"
MACHINE = "Made with"
PAPER_SAYS = "What the paper says"
MOTION = "Angles and rates"
DIFFERENCE = "Difference from the reference"
ENERGY = "Energy"
PATHS = "Paths of the tips"
METRICS = "Methods in numbers"
SCENE_FILE = "Scene file"
ENTRIES = "Checked entries"
EFFECTS = "What each erratum alone does to each scene"

# The viewer
MOVING = "The rotor moving"
PLAY, PAUSE, TIME, SPEED, MODELS, VIEW = "Play", "Pause", "Time", "Speed", "Models", "View"
SIDE_BY_SIDE, OVERLAID = "side by side", "overlaid"
OFFSET_DRAWN = "Offset drawn"
ENDED_AT, DASHED = "ended at", "dashed"
VIEWS = {"oblique": "Oblique", "front": "Front", "side": "Side", "top": "Top"}
VIEWER_KEYS = (
    "Drag the picture, or use the arrow keys on it, to turn the view; the space bar plays, comma and full stop go "
    "frame by frame."
)
VIEWER_OFFSET = (
    "The tip and the centre of mass lie so near the pitch axis that pitch could not be seen: their distance from it, "
    "and with it the paths, are drawn larger by the factor stated (1 is true to scale)."
)

# The walk through the paper's figures
WALK, FIGURES, FIGURE_TITLES = "The paper's figures, one by one", "Figures", {
    "motion": "position and velocity", "paths": "paths of the tips", "torques": "a constant torque on the rotor",
}  # fmt: skip
WALK_LEAD = (
    "Each figure of the paper in its own layout: the equations as printed, integrated by ode45 as the paper did, "
    "beside the right model and Exudyn. Every picture has its own scales, and what runs away from them is cut off; the "
    "same means within 0.05 rad."
)
EXUDYN_COLUMN = "Exudyn"
PART_A, PART_B = "(a) position", "(b) angular velocity"
FIGURE_NOTES = {
    "6": "The caption prints π/10 rad/s, the running text 1/10; drawn is the caption's.",
    "13": "The text takes panel (b) for the run of Fig. 12 (blade 1 at π/5 rad/s), the caption prints π/8; drawn is "
    "the caption's.",
    "14": "As read from the PDF, the caption gives three pairs of conditions for four panels: which pair belongs to "
    "which panel is not certain, and the condition of panel (d) is not known. Nothing is drawn for it.",
    "15": "1 and 100 kN·m are printed in the caption of Fig. 16; the paper's other torques are not known, 10 and "
    "50 kN·m were chosen.",
}
DOWNLOADS_NOTE = (
    "SVG and PNG: the picture at print size, 132 mm across, the PNG with 600 dots an inch. Whole figures for a "
    "manuscript, as PDF, SVG or PNG: rotor-mbs figures."
)

# Navigation
INDEX = "All scenes"
ERRATA = "Errata"
NAVIGATION = "Pages"
PREVIOUS = "Previous scene"
NEXT = "Next scene"

# Axes
TIME_AXIS = "time (s)"
ANGLE_AXIS = "angle (rad)"
ROTOR_AXIS = "rotor angle (rad)"
RATE_AXIS = "rate (rad/s)"
DIFFERENCE_AXIS = "largest angle difference (rad)"
ENERGY_ERROR_AXIS = "energy error (J)"
ENERGY_ERROR_RELATIVE_AXIS = "energy error / energy scale"
ALONG_SHAFT_AXIS = "tip y (mm)"

# Legends
CARRIED = "rounding of a double at the start, grown"
UNCERTAINTY = "uncertainty of the reference"
HORIZON = "horizon"
KINETIC, POTENTIAL, TOTAL = "kinetic", "potential", "total less work"
WIRE_START, WIRE_END, SHAFT = "blade at the start", "blade at the end", "shaft"

# Words in tables
SCENE, FIGURE, METHOD, STATUS, COORDINATE, BLADE = "Scene", "Figure", "Method", "Status", "Coordinate", "Blade"
HORIZON_COLUMN = "Horizon"
REPRODUCED, NOT_REPRODUCED, HOLDS, HOLDS_NOT, UNDECIDED = "reproduced", "not reproduced", "holds", "does not hold", "–"
YES, NO = "yes", "no"
PRINTED_COLUMN = "As printed"
RIGHT_COLUMN = "Right model"
STATUSES = {
    "ok": "ok",
    "inaccurate": "inaccurate",
    "diverged": "diverged",
    "singular": "singular",
    "solver_failed": "solver failed",
    "timed_out": "timed out",
}
NEVER_LEFT = "kept"

HORIZON_NOTE = (
    "Horizon: until then an error in the initial state has grown less than 100 000 times; beyond it two right "
    "solutions may part for no fault of theirs. Errors up to the horizon are over all samples before it. Energy drift "
    "is the largest change of total energy less work, relative to the scene's energy scale (weights at their arms, "
    "energy at the start, work of the torque)."
)
QUOTE_NOTE = (
    "Numbers are read off the integrator's own output points, as off a printed figure, and compared at the printed "
    "digits."
)
MATCHED = "a length of the run and an order of adding the weights that were chosen to match"
GROWN_ROUNDING = "grown rounding error"
MATCHED_NOTE = f"These numbers are {GROWN_ROUNDING}; they come out for {MATCHED}."
ERRATA_LEAD = (
    "By the paper's own definition the printed matrices U, (8), (9) and (16) to (19), are the first and second "
    "derivatives of its transformation (3) by the angles; mass, rate and gravity terms follow from the same "
    "transformation by Lagrange's equations. Each printed entry was compared, at random states, with what so follows "
    "from (3). With the errata below mended, the printed equations are the right Euler-Lagrange equations of the rotor."
)
EFFECTS_NOTE = (
    "The right equations with one erratum put in, integrated by ode45 at the paper's tolerances, against the "
    "reference. E3 alone changes nothing: where E2 is mended, the coefficient of its terms is zero. Nor does E2 where "
    "all pitches start at zero, since without E1 they stay there. Those columns show the integrator's own error."
)
PATHS_NOTE = "Equal scales in all three directions. Blades are lines from the hub to the tip."


# Captions
SCENES_CAPTION = "Angle errors are the largest up to the horizon, against the quad-precision reference"
ERRATA_CAPTION = "The faults in the printed equations; all else follows from them"
DIFFERENCE_CAPTION = "Largest difference from the reference, over all angles"
ENERGY_ERROR_CAPTION = "Energy error of each method"
EXTREMES_CAPTION = "Extremes"
ROTOR_ALONE = "Rotor angle alone"
ENDED_EARLY_NOTE = "judged by what there is: the run ended early in"

# Columns
IN_THE_PAPER, PRINTED, RIGHT, VERDICT, ALSO_RIGHT = "In the paper", "Printed", "Right", "Verdict", "Also right?"
WHERE, BECAUSE, EVIDENCE = "Where", "Because", "What shows it"
REACHES, PAGES, AGREEING = "Equations it reaches", "pages", "Entries that agree"
EQUATION, ENTRY, ERRATUM = "Equation", "Entry", "Erratum"
RELATIVE_DIFFERENCE, EXPLAINED_BY, UNEXPLAINED = "Relative difference", "Explained by", "nothing"
EFFECT_COLUMNS = ("angle change to the horizon (rad)", "whole run (rad)", "energy gain")
PRINTED_STATUS = "As printed, ode45"
PRINTED_DEPARTS = "departs by (rad, whole run)"
PRINTED_GAIN = "makes energy"
RAN_TO_THE_END = "runs to the end"
NOT_HELD_NOTE = (
    "The printed equations are held to nothing, neither to the reference nor to their energy: that they depart from "
    "both is the finding. That a run of theirs reaches its end says nothing of whether it is right."
)
DRIFT_COLUMN = "energy drift"
METRIC_COLUMNS = (
    "Angle error to the horizon (rad)", "Angle error, whole run (rad)", "Tip error to the horizon (m)",
    "Energy drift (relative)", "Joint gap (m)", "Zero pitch", "Steps", "Evaluations", "Set-up", "Run",
)  # fmt: skip
DIFFERENCE_COLUMNS = ("Up to the horizon (rad)", "Whole run (rad)", "At the end (rad)")
ENERGY_COLUMNS = ("Largest kinetic energy", "Work at the end", "Largest gain", "Drift (relative)")
LARGEST_RATE = "largest rate (rad/s)"
OFF_PLANE = "off the plane"
RANGE = "{} to {}"


def angle_column(side: str) -> str:
    return f"{side}: angle (rad)"


def length_column(side: str) -> str:
    return f"{side}: length of path"


def viewer_described(title: str) -> str:
    return f"{title}: the blades and the paths of their tips, moving. The pictures below show the same at rest."


def more_readings(count: int, failed: bool) -> str:
    return f"; {count} more {'such' if failed else 'tests hold'}"


def not_so(relation_text: str) -> str:
    return f"not {relation_text}"


def figure_heading(number_of: str, kind: str) -> str:
    return f"{FIGURE} {number_of}: {FIGURE_TITLES[kind]}"


def walk_picture(figure: str, heading: str) -> str:
    return f"{FIGURE} {figure}, {heading}"


def conditions(angles: str, rates: str, torque: float | None, gravity: float, duration: float) -> str:
    """Of a start; torque in N m, None where it changes over time."""
    parts = [f"q(0) = [{angles}] rad", f"dq/dt(0) = [{rates}] rad/s"]
    if torque is None:
        parts.append("a torque that changes over time")
    elif torque:
        parts.append(f"rotor torque {prefixed(torque, 'N·m')}")
    return f"{', '.join(parts)}, g = {number(gravity, 3)} m/s², {quantity(duration, 's', 4)}."


def walk_same(facts: Facts) -> str:
    """What is the same in the models."""
    parts = []
    if facts.seen_apart is not None and facts.seen_apart > 0.0:
        how_long = "throughout" if facts.seen_apart == inf else f"up to {quantity(facts.seen_apart, 's', 3)}"
        parts.append(f"the printed model shows the right motion {how_long}")
    if facts.exudyn is not None:
        parts.append(
            f"Exudyn and the right model differ by no more than {quantity(facts.exudyn, 'rad')} up to "
            f"{quantity(facts.until, 's', 3)}"
        )
    return f"The same: {'; '.join(parts)}." if parts else ""


def walk_different(facts: Facts) -> str:
    """What is not."""
    parts = []
    if facts.right_still and facts.printed_pitch is not None and facts.printed_pitch > 1e-3:
        parts.append(
            f"in the right model no blade pitches at all, in print they reach {quantity(facts.printed_pitch, 'rad')}"
        )
    if facts.largest is not None and facts.seen_apart != inf:
        parts.append(f"the printed angles part from the right ones by up to {quantity(facts.largest, 'rad')}")
    if facts.gain is not None and facts.gain > 1e3:
        parts.append(f"the printed model makes {prefixed(facts.gain, 'J')} out of nothing")
    if facts.ended is not None:
        parts.append(f"it runs away, and ode45 gives up at {quantity(facts.ended, 's', 3)}")
    return f"Not the same: {'; '.join(parts)}." if parts else "Not the same: nothing that one could see."


def torques_same(exudyn: float | None) -> str:
    """exudyn: rad, from the right model, the largest of all torques."""
    text = "The same: every torque sets the rotor going from rest"
    return (
        f"{text}."
        if exudyn is None
        else f"{text}; Exudyn and the right model differ by {quantity(exudyn, 'rad')} at most."
    )


def torques_different(turned: Mapping[str, Mapping[str, float]]) -> str:
    """rad that each torque has turned the rotor by the end, by model."""
    parts = [
        f"{heading}: " + ", ".join(f"{number(value, 3)} rad at {torque}" for torque, value in by_torque.items())
        for heading, by_torque in turned.items()
    ]
    return (
        "Not the same: in the right model the blades stay at zero pitch and the rotor turns by τt²/(2·3·m·(c²+d²)), "
        f"the more the larger the torque. Turned at the end: {'; '.join(parts)}."
    )


def walk_number(what: str, unit: str, published: str, printed: str, right: str) -> str:
    return f"{what[0].upper()}{what[1:]}: published {published} {unit}; as printed {printed}; right model {right}."


def scene_count(count: int) -> str:
    return f"{count} scene" if count == 1 else f"{count} scenes"


def energy_axis(prefix: str) -> str:
    return f"energy ({prefix}J)"


def status(name: str) -> str:
    return STATUSES.get(name, name)


def figures(text: str) -> str:
    """Of the paper; "" where the scene is none of its."""
    if not text:
        return ""
    return f"{'Figures' if ',' in text else 'Figure'} {text} of the paper"


def finding(facts: Finding) -> list[str]:
    """At most three sentences: what is reproduced, what is wrong in print, how far the right models agree."""
    sentences = [_reproduced(facts), _made_energy(facts.energy), _agreement(facts.agreement)]
    return [sentence for sentence in sentences if sentence]


def _reproduced(facts: Finding) -> str:
    if facts.numbers is None:
        return _claims_alone(facts)
    reached = facts.numbers
    text = (
        f"{_of(reached, 'published number')} {_is_are(reached.count)} reproduced to every printed digit by "
        f"integrating the equations as they are printed{_on_conditions(facts.reproduced)}"
    )
    if facts.numbers_right is not None:
        text += f". The right model reproduces {_none_or(facts.numbers_right)}"
    if facts.claims_printed is not None and facts.claims_right is not None:
        text += (
            f"; of the paper's claims in words the printed model bears out {_share(facts.claims_printed)}, "
            f"the right model {_share(facts.claims_right)}"
        )
    return text + "."


def _on_conditions(found: Sequence[Reproduced]) -> str:
    """ ": that of Fig. 11 with g = 9.8 m/s² and 10 s; the 3 of Fig. 5, which are grown ...", "" where none is."""
    parts = []
    for one in found:
        what = f"{'that' if one.count == 1 else f'the {one.count}'} of Fig. {one.figure}"
        parts.append(f"{what}, {GROWN_ROUNDING}, for {MATCHED}" if one.matched else f"{what} {_under(one)}")
    return f": {'; '.join(parts)}" if parts else ""


def _under(one: Reproduced) -> str:
    gravity = "" if one.gravity is None else f"g = {number(one.gravity)} m/s² and "
    return f"with {gravity}{quantity(one.duration, 's')}"


def _claims_alone(facts: Finding) -> str:
    parts = [
        f"{_share(tally)} hold in the {model} model"
        for tally, model in ((facts.claims_printed, "printed"), (facts.claims_right, "right"))
        if tally is not None
    ]
    return f"Of the paper's claims that this file can decide {' and '.join(parts)}." if parts else ""


def _made_energy(energy: PrintedEnergy | None) -> str:
    if energy is None:
        return ""
    start = "Three faults in the printed matrices (E1, E2, E3) make the printed model inconsistent in energy: "
    if not energy.made.count:
        return f"{start}still it makes none to speak of in {'this scene' if energy.made.of == 1 else 'these scenes'}."
    where = f"more than a thousandth of the energy scale in {energy.made.count} of {scene_count(energy.made.of)}"
    if energy.scene:
        most = f"among the runs that reach the end up to {prefixed(energy.gain, 'J')}"
        text = f"{start}it makes energy out of nothing, {where}, {most}"
    else:
        text = f"{start}it makes energy out of nothing, {where}"
    if energy.broke_off:
        text += f", and in {len(energy.broke_off)} it runs away until ode45 gives up"
    return text + "."


def _agreement(found: tuple[Agreement, ...]) -> str:
    known = [agreement for agreement in found if agreement.angle_error is not None]
    if not known:
        return ""
    counted = {1: "One right model", 2: "Two right models", 3: "Three right models"}
    models = len({model_of(agreement.method) for agreement in known})
    subject = counted[models]
    errors = _listed(f"{quantity(a.angle_error, 'rad')} ({name_of(a.method)})" for a in known)
    text = f"{subject} that are given nothing but the same raw data" if models > 1 else subject
    text += (
        f" {'keep' if models > 1 else 'keeps'} to the quad-precision reference within {errors} up to each scene's "
        "horizon, where any error has grown up to 100 000-fold"
    )
    drifts = [a.energy_drift for a in known if a.energy_drift is not None]
    if drifts:
        text += f", and {'keep' if models > 1 else 'keeps'} energy to {number(max(drifts))} of its scale or better"
    failed = sum(a.runs.of - a.runs.count for a in found)
    if failed:
        text += (
            f"; {failed} of {sum(a.runs.of for a in found)} of their runs did not come out well and are left out here"
        )
    return text + "."


def _of(tally: Tally, what: str) -> str:
    return f"{tally.count} of {tally.of} {what}{'' if tally.of == 1 else 's'}"


def _is_are(count: int) -> str:
    return "is" if count == 1 else "are"


def _none_or(tally: Tally) -> str:
    return f"{tally.count}" if tally.count else "none"


def _share(tally: Tally) -> str:
    return f"{tally.count} of {tally.of}"


def _listed(parts: Iterable[str]) -> str:
    items = list(parts)
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}"


def scene_lead(
    departure: float | None, horizon: float | None, gain: float | None, ended: float | None, right: float | None
) -> list[str]:
    """What the pictures of a scene show, a sentence each.

    departure   rad, of the printed model from the reference over the whole run; gain: J that it makes
    ended       s, when the printed run broke off; right: rad, worst of the right models up to the horizon
    """
    found = []
    if ended is not None:
        found.append(f"The printed model runs away: ode45 gives up at {quantity(ended, 's', 3)}.")
    elif departure is not None:
        text = f"The printed model departs from the reference by up to {quantity(departure, 'rad')}"
        if gain is not None:
            text += f"; its energy rises by up to {prefixed(gain, 'J')}"
        found.append(f"{text}.")
    if right is not None and horizon is not None:
        found.append(
            f"Up to the horizon, {quantity(horizon, 's', 3)}, the right models keep to the reference within "
            f"{quantity(right, 'rad')}."
        )
    return found


def ended_early(method: str, state: str, message: str, reached: float) -> str:
    text = f"{name_of(method)}: {status(state)}"
    if message:
        text += f". {message}"
    return f"{text} (samples up to {quantity(reached, 's', 4)})"


def motion_caption(name: str, marked: list[str]) -> str:
    if not marked:
        return name.capitalize()
    return f"{name.capitalize()}, as lines; marks: {'; '.join(marked)}"


def motion_described(name: str, ranges: list[tuple[str, float, float]]) -> str:
    parts = [f"{label} from {number(low, 3)} to {number(high, 3)} rad" for label, low, high in ranges]
    return f"{name} over time: {'; '.join(parts)}."


def cut_angles_note(largest: float) -> str:
    return f"Angles beyond the axis are cut off; the largest is {quantity(largest, 'rad')}."


def cut_rates_note(largest: float) -> str:
    return f"Rates beyond the axis are cut off; the largest is {quantity(largest, 'rad/s')}."


def cut_energy_note(largest: float) -> str:
    return f"Energies beyond the axis are cut off; the largest is {prefixed(largest, 'J')}."


def difference_described(errors: list[tuple[str, float]]) -> str:
    return "Largest angle difference from the reference, log axis: " + "; ".join(
        f"{name} up to {number(value)} rad" for name, value in errors
    )


def exact_note(names: list[str]) -> str:
    return f"No curve, being nowhere above 10⁻¹⁸ rad: {'; '.join(names)}."


def exact_energy_note(names: list[str]) -> str:
    return f"No curve, being nowhere above 10⁻¹⁸: {'; '.join(names)}."


def below_axis_note(uncertainty: float) -> str:
    if uncertainty == 0.0:
        return "Two quad-precision runs of the reference do not differ at all."
    return f"The reference is certain to {quantity(uncertainty, 'rad')}, far below the axis."


def energies_described(name: str, start: float, end: float) -> str:
    return f"{name}: total energy less work {prefixed(start, 'J')} at the start, {prefixed(end, 'J')} at the end."


def energy_errors_described(errors: list[tuple[str, float]]) -> str:
    return "Energy error, log axis: " + "; ".join(f"{name} up to {number(value)}" for name, value in errors)


def paths_described(name: str, turned: float | None, off_plane: float) -> str:
    text = f"{name}: paths of the blade tips in space with the wire frame at start and end"
    if turned is not None:
        text += f"; the rotor ends {number(turned, 3)} rad from its start"
    return f"{text}; tips leave the plane of rotation by up to {prefixed(off_plane, 'm')}."


def left_zero(time: float | None, rate: float | None) -> str:
    if time is None:
        return NEVER_LEFT
    text = f"left at {quantity(time, 's', 3)}"
    return text if rate is None else f"{text}, growing {quantity(rate, '/s', 3)}"


def zero_pitch_note(escape: float | None) -> str:
    text = "Zero pitch: whether pitches that are exactly zero in the reference stayed so; past 10⁻⁹ rad they have left."
    if escape is not None:
        text += (
            f" A pitch below the shaft is a pendulum upside down: rounding grows at up to √(g/c) = "
            f"{quantity(escape, '/s', 3)}."
        )
    return text


def quantity_name(quantity_asked: str, coordinate: int) -> str:
    body = "rotor" if coordinate == 0 else f"pitch {coordinate}"
    return f"{body} {'angle' if quantity_asked == 'angle' else 'rate'}"


STATISTIC_NAMES = {
    "min": "smallest",
    "max": "largest",
    "max_abs": "largest size of",
    "range": "range of",
    "max_abs_change": "largest change of",
    "net_change": "change from start to end of",
    "reversals": "changes of sign of",
    "growth": "growth (later by earlier departure) of",
    "swing_ratio": "largest by smallest swing of",
}
_UNITS = {"reversals": "", "growth": "", "swing_ratio": "", "angle": "rad", "rate": "rad/s"}


def asked(quantity_asked: str, coordinate: int, statistic: str) -> str:
    return f"{STATISTIC_NAMES.get(statistic, statistic)} {quantity_name(quantity_asked, coordinate)}"


def measured(value: float | None, quantity_asked: str, statistic: str) -> str:
    if value is None:
        return "undefined (no motion)"
    unit = _UNITS[statistic] if statistic in _UNITS else _UNITS[quantity_asked]
    return quantity(value, unit, 3) if unit else number(value, 3)


def relation(name: str, bound: float | None) -> str:
    """The sign, with the bound where there is one."""
    words = {"<": "<", ">": ">", "opposite": "opposite to"}[name]
    return words if bound is None else f"{words} {number(bound, 3)}"


def seconds(value: float) -> str:
    return quantity(value, "s", 3)


def agreeing_summary(count: int, largest: float) -> str:
    return f"{count} entries agree with what follows from (3) to {number(largest)}"


def differing_caption(count: int, of: int) -> str:
    return f"{count} of {of} printed entries differ from what follows from (3)"


def error_column(method: str) -> str:
    return f"{method[0].upper()}{method[1:]}: angle error (rad)"


def effect_column(erratum: str, what: str) -> str:
    return f"{erratum}: {what}"


def rotor_caption(printed: str, right: str) -> str:
    return f"The rotor's angle alone: {printed}, solid black; {right}, dashed blue"
