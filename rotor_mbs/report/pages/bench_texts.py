"""Every text of the pages on error against run time, in English. Knows numbers and names, not where they come from."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from rotor_mbs.report.core.numbers import number, power, prefixed, quantity
from rotor_mbs.report.names import name_of

TITLE = "Error against run time"
LEAD = (
    "Each point is one method at one setting: the median of its run times, a line from lower to upper quartile, and "
    "the error of those very runs. Accuracy grows to the right, speed grows downwards: the lower right corner is best."
)
ERROR_AXIS = "largest angle error up to the horizon (rad)"
TIME_AXIS = "run time (s)"
SETUP_TIME_AXIS = "set-up, run and read-out (s)"
DIAGRAM_HEADING = "Error against run time"
REACH_HEADING, POINTS_HEADING, FAILURES_HEADING = "Time to an accuracy", "All points", "Failures"
ORDER_HEADING = "Order of convergence"
SCENES_HEADING, OVERVIEW_HEADING = "Scene by scene", "The fastest"
OVERVIEW_CAPTION = "Run time of the fastest method to an angle error, and how many times as long the next one takes."
NOT_MEASURED, ALONE = "not measured", "no other gets there"
OTHERS_NOT_MEASURED = "no other was measured to there"
FRONT = "best of all (Pareto front)"
FAILED = "failed: drawn at its time"
FLOOR = "uncertainty of the reference"
CSV = "these numbers as CSV"
RAIL = "failed"
RUN_CAPTION = "Integration alone: its run time over the whole scene; marks on the left rail failed."
SETUP_CAPTION = (
    "What one run costs: the same with building the model, compiling everything anew, and reading out samples."
)
REACH_CAPTION = (
    "Run time to an angle error, straight in the logarithms between the points of a method's own front, and how many "
    "times the fastest method's. A dash: no setting of the whole ladder was as accurate. Not measured: the "
    "budget left out finer settings, which might have been."
)
REACH_NOTE = "Where a method's fastest point is more accurate than asked for, its time is given."
POINTS_CAPTION = "Every setting measured."
FAILURES_CAPTION = "Runs that failed, found from their state, and rungs that the budget left out."
ORDER_CAPTION = "Fitted on the finest points above the round-off floor."
GROWTH_CAPTION = "Run time of one simulated second, and the exponent fitted on the larger half of the sizes."
SCENE = "scene"
METHOD, SETTING, STATUS, REASON, TIME, FALSE = "method", "setting", "status", "reason", "run time", "engine said ok"
ORDER, EXPECTED, EXPONENT = "order", "expected", "exponent"
POINT_COLUMNS = (
    "method", "setting", "angle error (rad)", "at the end (rad)", "tip error (m)", "energy drift", "median",
    "quartiles", "shortest", "set-up", "again", "read-out", "repeats", "steps", "status",
)  # fmt: skip

_GROWTH_HEADINGS = {
    "growth/blades": "Growth of cost with the number of blades",
    "growth/duration": "Growth of cost with the duration",
}
MODELS = {"lagrange": "the closed form", "exudyn_tree": "Exudyn's tree", "exudyn_chain": "Exudyn's chain"}
_CHOICES = {
    "rho0.7": "ρ∞ 0.7",
    "rho1.0": "ρ∞ 1",
    "rotation_vector": "rotation vector",
}


def curve_name(curve: str, method: str) -> str:
    """The method's name, with its fixed choices where they are not the default ones."""
    rest = curve.removeprefix(method).strip("_")
    choices = [text for short, text in _CHOICES.items() if short in rest]
    return ", ".join([name_of(method), *choices])


def growth_heading(study: str) -> str:
    return _GROWTH_HEADINGS[study]


def horizon(seconds: float, duration: float, uncertainty: float) -> str:
    """What the errors cover."""
    if seconds < duration:
        reach = (
            f"Times are of the whole {number(duration, 3)} s; errors are claimed up to the horizon at "
            f"{quantity(seconds, 's', 3)}: beyond it an error at the start may have grown more than 10⁵ times "
            "(from the variational equations)."
        )
    else:
        reach = f"Times and errors are of the whole {number(duration, 3)} s: the horizon lies beyond."
    return f"{reach} The reference is uncertain by {quantity(uncertainty, 'rad')} up to there."


def sampling(samples: int, budget: float, load: float, core: int) -> str:
    where = "on a core of its own choosing" if core < 0 else f"on core {core}"
    return (
        f"Errors are taken at {samples} samples. One process at a time {where}, garbage collector off, all points in "
        f"turn in rounds, within {number(budget, 3)} s; the machine's load before: {number(load)}."
    )


def target(value: float) -> str:
    return f"{_power(value)} rad"


def _power(value: float) -> str:
    """10⁻⁶: the targets are powers of ten."""
    return power(round(math.log10(value)))


def finer_left_out(count: int) -> str:
    return f"{count} finer {'setting' if count == 1 else 'settings'} left out"


def best_reached(error: float | None) -> str:
    return "no run came out well" if error is None else f"{quantity(error, 'rad')} at best"


def runner_up(name: str, ratio: float) -> str:
    return f"then {name}, {_times(ratio)} as long"


def _times(ratio: float) -> str:
    return f"{number(ratio)} times"


def omissions(count: int, of: int) -> str:
    return (
        f"The budget left out {count} of {of} settings, always the finest of their ladders: what they would reach is "
        f"told as {NOT_MEASURED}."
    )


def overview(
    wanted: float, scenes: int, wins: Mapping[str, Sequence[float]], ratios: Mapping[str, Sequence[float]]
) -> str:
    """wins: times (s) by method, of the scenes where it is the fastest; ratios: of each model's best, where slower."""
    ranked = sorted(wins.items(), key=lambda item: -len(item[1]))
    first = [
        f"{name} in {len(seconds)} of {scenes} scenes ({_range(seconds, lambda s: prefixed(s, 's', 2))})"
        for name, seconds in ranked
    ]
    slower = [
        f"the best of {MODELS.get(model, model)} takes {_range(found, number)} times as long ({len(found)} of {scenes})"
        for model, found in ratios.items()
    ]
    return f"To {target(wanted)} the fastest is {'; '.join([' and '.join(first), *slower])}."


def _range(values: Sequence[float], shown: Callable[[float], str]) -> str:
    low, high = shown(min(values)), shown(max(values))
    return low if low == high else f"{low} to {high}"


def summary(scene: str, wanted: float, times: Mapping[str, float]) -> str:
    """ "paper/fig11, 10⁻⁹ rad: closed form, Taylor 4 ms; Exudyn tree, RK67 50 ms (13 times)." by rising time."""
    ranked = sorted(times.items(), key=lambda item: item[1])
    if not ranked:
        return f"{scene}, {target(wanted)}: reached by no method within the budget."
    fastest = ranked[0][1]
    parts = [
        f"{name} {prefixed(time, 's', 2)}" + (f" ({number(time / fastest)} times)" if time > fastest else "")
        for name, time in ranked
    ]
    return f"{scene}, {target(wanted)}: {'; '.join(parts)}."
