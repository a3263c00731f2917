"""The paper's numbers and claims tested on stored runs, and what comes of it: how much of the paper is reproduced."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from rotor_mbs.analysis import run_selection
from rotor_mbs.analysis.claim_study import HOLDS, ClaimShares
from rotor_mbs.analysis.published import Published, TrajectoryNumber, published
from rotor_mbs.methods.catalogue import is_corrected
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.solution.status import GOOD
from rotor_mbs.solution.trajectory import Array

# Numbers read off runs


class RunArrays(Protocol):
    """Arrays of a run by name: time (n,), angles, rates (n, 1 + blades); None where it has no such array."""

    def get(self, name: str, /) -> Array | None: ...


class Statistic(NamedTuple):
    """of: from times (n,) s and values (n,) to the number; text: before the name of what it is of; without a unit?"""

    of: Callable[[Array, Array], float | None]
    text: str
    has_unit: bool = True


def _reversals(x: Array) -> float:
    signs = np.sign(x[x != 0.0])
    return float(np.count_nonzero(signs[1:] != signs[:-1]))


def _growth(t: Array, x: Array) -> float | None:
    """Largest departure from the start over the second half of the time reached by that over the first half."""
    first = t <= 0.5 * (t[0] + t[-1])
    away = np.abs(x - x[0])
    before = float(away[first].max())
    return float(away[~first].max()) / before if before > 0.0 and not first.all() else None


def _swing_ratio(x: Array) -> float | None:
    """Largest by smallest way from one turning point to the next; the start counts as one."""
    moving = np.flatnonzero(np.diff(x) != 0.0)
    signs = np.sign(np.diff(x)[moving])
    turning = moving[1:][signs[1:] != signs[:-1]]
    swings = np.abs(np.diff(x[[0, *turning]]))
    return float(swings.max() / swings.min()) if len(swings) >= 2 else None


STATISTICS = {
    "min": Statistic(lambda _, x: float(x.min()), "smallest"),
    "max": Statistic(lambda _, x: float(x.max()), "largest"),
    "max_abs": Statistic(lambda _, x: float(np.abs(x).max()), "largest magnitude of"),
    "range": Statistic(lambda _, x: float(np.ptp(x)), "range of"),
    "max_abs_change": Statistic(lambda _, x: float(np.abs(x - x[0]).max()), "largest change of"),
    "net_change": Statistic(lambda _, x: float(x[-1] - x[0]), "change from start to end of"),
    "reversals": Statistic(lambda _, x: _reversals(x), "changes of sign of", has_unit=False),
    "growth": Statistic(_growth, "growth (later by earlier departure) of", has_unit=False),
    "swing_ratio": Statistic(lambda _, x: _swing_ratio(x), "largest by smallest swing of", has_unit=False),
}


def measure(run: RunArrays, asked: TrajectoryNumber, metrics: Mapping[str, Any] | None = None) -> float | None:
    """The number in rad or rad/s (reversals and growth: 1); None where the run has no such data or it is undefined.

    The rotor's extremes are those over the integrator's own steps, as off a printed figure, where `metrics` has them.
    """
    extreme = _rotor_extreme(asked, metrics or {})
    if extreme is not None:
        return extreme
    time, values = run.get("time"), run.get({"angle": "angles", "rate": "rates"}[asked.quantity])
    if time is None or values is None or not len(values) or asked.coordinate >= values.shape[1]:
        return None
    return STATISTICS[asked.statistic].of(time, values[:, asked.coordinate])


def _rotor_extreme(asked: TrajectoryNumber, metrics: Mapping[str, Any]) -> float | None:
    if asked.coordinate != 0:
        return None
    if asked.quantity == "rate":
        return metrics.get("rotor_rate_max") if asked.statistic == "max_abs" else None
    smallest, largest = metrics.get("rotor_angle_min"), metrics.get("rotor_angle_max")
    if smallest is None or largest is None:
        return None
    extremes = {
        "min": smallest,
        "max": largest,
        "max_abs": max(abs(smallest), abs(largest)),
        "range": largest - smallest,
    }
    return extremes.get(asked.statistic)


# Claims

# What is read off the runs of one model: None where it is undefined; without it where no run can decide.
NumberValues = Mapping[TrajectoryNumber, float | None]

_RELATIONS: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    ">": operator.gt,
    "opposite": lambda value, other: value * other < 0.0,
}


@dataclass(frozen=True)
class ClaimResult:
    """The result for one model: of a number its value, too. holds: None where the file cannot decide."""

    holds: bool | None
    value: float | None = None


@dataclass(frozen=True)
class Claim:
    """A number or claim of the paper with the results of the printed and of the corrected model."""

    published: Published
    printed: ClaimResult
    corrected: ClaimResult


def claims(scenes: Mapping[str, StoredScene], items: Iterable[Published] | None = None) -> list[Claim]:
    """Return the numbers and claims that `scenes` can decide for at least one model; of `items`, by default of all."""
    results = []
    for item in published() if items is None else items:
        sides = []
        for choose in (run_selection.printed_run, run_selection.reference_or_corrected_run):
            runs = {name: run for name in item.scenes if name in scenes and (run := choose(scenes[name])) is not None}
            values = {
                number: measure(runs[number.scene], number, runs[number.scene].attributes)
                for number in item.numbers
                if number.scene in runs
            }
            value = values.get(item.of) if item.of is not None else None
            if item.of is None:
                sides.append(ClaimResult(claim_holds(item, values)))
            else:
                holds = None if value is None else rounds_to(value, item.value, item.decimals)
                sides.append(ClaimResult(holds, value))
        if any(side.holds is not None for side in sides):
            results.append(Claim(item, *sides))
    return results


def rounds_to(value: float, printed: float, decimals: int) -> bool:
    """Whether `value`, rounded as it would be printed, is the printed number."""
    return f"{value:.{decimals}f}" == f"{printed:.{decimals}f}"


def claim_holds(item: Published, values: NumberValues) -> bool | None:
    """Whether all tests of a claim in words hold for what was read off the runs.

    False as soon as one fails, even where others cannot be decided; None where none fails and one is undecided.
    """
    undecided = not item.tests
    for test in item.tests:
        if test.of not in values or (test.than is not None and test.than not in values):
            undecided = True
            continue
        value, limit = values[test.of], test.bound if test.than is None else values[test.than]
        if value is None or limit is None or not _RELATIONS[test.relation](value, limit):
            return False
    return None if undecided else True


# What came out

# Share of a scene's energy scale. The drift of ode45 itself at the paper's tolerances is below a thousandth of that
# (3e-7 of the scale at most, on the corrected equations).
ENERGY_RISE = 1e-3


class Finding(NamedTuple):
    """A result with what the equations as printed and the corrected model give; "" where nothing is known."""

    result: str
    printed: str
    corrected: str


def finding(
    scenes: Mapping[str, StoredScene], claims: Iterable[Claim], shares: ClaimShares | None = None
) -> list[Finding]:
    """How much of the paper is reproduced, and the energy that its equations gain; empty for other scenes.

    shares: claims in words by their shares of many runs, in place of the single stored ones.
    """
    evaluated = list(claims)
    numbers = [claim for claim in evaluated if claim.published.is_number]
    in_words = [claim for claim in evaluated if not claim.published.is_number]
    rows = [Finding("Published numbers reproduced", *_counts(numbers))]
    if shares is None:
        rows.append(Finding("Published claims that hold", *_counts(in_words)))
    else:
        printed, corrected = (f"{shares.count(name)[HOLDS]} of {len(shares.claims)}" for name in shares.methods)
        rows.append(Finding("Published claims that hold", printed, corrected))
    runs = [run for scene in scenes.values() if (run := run_selection.printed_run(scene)) is not None]
    runs = [run for run in runs if "energy_gain_J" in run.attributes]
    rising = [run for run in runs if run.attributes["energy_gain_J"] > ENERGY_RISE * run.attributes["energy_scale_J"]]
    if runs:
        result = f"Scenes in which energy rises by more than {ENERGY_RISE:g} of its scale without work"
        rows.append(Finding(result, f"{len(rising)} of {len(runs)}", ""))
    gains = [run.attributes["energy_gain_J"] for run in rising if run.status in GOOD]
    if gains:
        rows.append(Finding("Largest spurious energy gain of a complete run", f"{1e-6 * max(gains):.3g} MJ", ""))
    return [row for row in rows if row.printed or row.corrected]


def _counts(claims: Iterable[Claim]) -> tuple[str, str]:
    """How many hold, of those that are decided: as printed, corrected."""
    texts = []
    for results in ([claim.printed for claim in claims], [claim.corrected for claim in claims]):
        decided = [result.holds for result in results if result.holds is not None]
        texts.append(f"{sum(decided)} of {len(decided)}" if decided else "")
    return texts[0], texts[1]


class Agreement(NamedTuple):
    """A method's largest errors over its runs that ended well, and its longest run (s).

    defect rad of an interval, angle_error rad up to each horizon, energy_drift of the energy scale; None without data.
    """

    method: str
    runs: str  # "16 of 17 ok"; of equations that are not claimed to be correct "completed"
    defect: float | None
    angle_error: float | None
    energy_drift: float | None
    longest_s: float


def agreement(runs: Iterable[StoredRun]) -> list[Agreement]:
    """A row for each method, in the order of the catalogue."""
    by_method: dict[str, list[StoredRun]] = {}
    for run in runs:
        by_method.setdefault(run.method, []).append(run)
    rows = []
    for method in run_selection.in_catalogue_order(by_method):
        own = by_method[method]
        ended_well = [run for run in own if run.status in GOOD]
        count = f"{len(ended_well)} of {len(own)} {'ok' if is_corrected(method) else 'completed'}"
        names = ("defect_max", "angle_error_max", "energy_drift_max")
        defect, error, drift = (_largest(ended_well, name) for name in names)
        rows.append(Agreement(method, count, defect, error, drift, _largest(own, "run_time_s") or 0.0))
    return rows


def _largest(runs: Iterable[StoredRun], name: str) -> float | None:
    return max((float(run.attributes[name]) for run in runs if name in run.attributes), default=None)
