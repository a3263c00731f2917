"""The paper's numbers and claims tested on stored runs, and what comes of it: how much of the paper is reproduced."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from rotor_mbs.analysis import run_selection
from rotor_mbs.analysis.published import Condition, Published, TrajectoryNumber, published
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.scenario.catalogue import natural_order
from rotor_mbs.solution.status import COMPLETE
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
    """Read a number off a run.

    Parameters
    ----------
    run : its arrays.
    asked : which number.
    metrics : of the run; the extremes of the rotor over the integrator's own steps, `rotor_angle_min` and so on, are
        taken from them, as off a printed figure, and from the samples only where they are not there.

    Returns
    -------
    The number in rad or rad/s (reversals and growth: 1); None where the run has no such data or it is undefined.
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
class Reading:
    """A test and its result. value, limit: read off the runs, None where undefined; holds: None without the data."""

    test: Condition
    value: float | None
    limit: float | None
    holds: bool | None


@dataclass(frozen=True)
class ClaimResult:
    """The result for one model. holds: None where the file cannot decide; ended_early: scenes whose run did."""

    holds: bool | None
    value: float | None = None
    readings: tuple[Reading, ...] = ()
    ended_early: tuple[str, ...] = ()


@dataclass(frozen=True)
class Claim:
    """A number or claim of the paper with the results of the printed and of the corrected model."""

    published: Published
    printed: ClaimResult
    corrected: ClaimResult


def claims(scenes: Mapping[str, StoredScene], items: Iterable[Published] | None = None) -> list[Claim]:
    """Return the numbers and claims that `scenes` can decide for at least one model; of `items`, by default of all."""
    results = [
        Claim(
            item,
            _result(item, scenes, run_selection.printed_run),
            _result(item, scenes, run_selection.reference_or_corrected_run),
        )
        for item in (published() if items is None else items)
    ]
    return [claim for claim in results if claim.printed.holds is not None or claim.corrected.holds is not None]


def _result(
    item: Published, scenes: Mapping[str, StoredScene], choose: Callable[[StoredScene], StoredRun | None]
) -> ClaimResult:
    chosen = {name: choose(scenes[name]) for name in sorted(item.scenes) if name in scenes}
    runs = {name: run for name, run in chosen.items() if run is not None}
    values = {
        number: measure(runs[number.scene], number, runs[number.scene].attributes)
        for number in item.numbers
        if number.scene in runs
    }
    early = tuple(name for name, run in runs.items() if run.status not in COMPLETE)
    if item.of is not None:
        value = values.get(item.of)
        return ClaimResult(None if value is None else rounds_to(value, item.value, item.decimals), value, (), early)
    readings = readings_of(item, values)
    return ClaimResult(all_hold(readings), None, readings, early)


def rounds_to(value: float, printed: float, decimals: int) -> bool:
    """Whether `value`, rounded as it would be printed, is the printed number."""
    return f"{value:.{decimals}f}" == f"{printed:.{decimals}f}"


def readings_of(item: Published, values: NumberValues) -> tuple[Reading, ...]:
    """Return the tests of a claim in words, in order, each with what was read off the runs."""
    readings = []
    for test in item.tests:
        if test.of not in values or (test.than is not None and test.than not in values):
            readings.append(Reading(test, None, None, None))
            continue
        value, limit = values[test.of], None if test.than is None else values[test.than]
        against = test.bound if test.than is None else limit
        holds = value is not None and against is not None and _RELATIONS[test.relation](value, against)
        readings.append(Reading(test, value, limit, holds))
    return tuple(readings)


def all_hold(readings: Iterable[Reading]) -> bool | None:
    """False as soon as one fails, even where others cannot be decided; None where none fails and one is undecided."""
    holds = [reading.holds for reading in readings]
    if False in holds:
        return False
    return None if None in holds or not holds else True


# The finding in numbers

# Share of a scene's energy scale. The drift of ode45 itself at the paper's tolerances is below a thousandth of that
# (3e-7 of the scale at most, on the corrected equations).
ENERGY_RISE = 1e-3


@dataclass(frozen=True)
class Tally:
    """A count of a total."""

    count: int
    of: int


@dataclass(frozen=True)
class PrintedEnergy:
    """Scenes in which the energy of the printed model rises without work.

    gain          J: the largest gain of a run that reached its end; None where no such run gained
    ended_early   scenes where the integration ended early, and the gain until then (J)
    """

    rises: Tally
    gain: float | None
    ended_early: Mapping[str, float]


@dataclass(frozen=True)
class Agreement:
    """A method's largest errors over its runs that are ok, and its longest run (s).

    angle_error rad up to each horizon, energy_drift relative to the energy scale; None without data.
    """

    method: str
    runs: Tally  # ok, of all
    angle_error: float | None
    energy_drift: float | None
    longest_s: float


@dataclass(frozen=True)
class Finding:
    """How much of the paper is reproduced, what its errata do, how well the corrected models agree.

    Parts are None, or empty, where the file does not have the data.
    """

    numbers: Tally | None
    numbers_corrected: Tally | None
    claims_printed: Tally | None
    energy: PrintedEnergy | None
    agreement: tuple[Agreement, ...]


def finding(scenes: Mapping[str, StoredScene], claims: Iterable[Claim]) -> Finding:
    """Summarise the runs' stored metrics and the evaluated claims."""
    evaluated = list(claims)
    numbers = [claim for claim in evaluated if claim.published.is_number]
    in_words = [claim for claim in evaluated if not claim.published.is_number]
    return Finding(
        _tally(claim.printed.holds for claim in numbers),
        _tally(claim.corrected.holds for claim in numbers),
        _tally(claim.printed.holds for claim in in_words),
        _printed_energy(scenes),
        agreement(run for scene in scenes.values() for run in run_selection.corrected_runs(scene).values()),
    )


def _tally(results: Iterable[bool | None]) -> Tally | None:
    decided = [holds for holds in results if holds is not None]
    return Tally(sum(decided), len(decided)) if decided else None


def _printed_energy(scenes: Mapping[str, StoredScene]) -> PrintedEnergy | None:
    runs = {name: run for name in natural_order(scenes) if (run := run_selection.printed_run(scenes[name])) is not None}
    gains = {name: run.attributes["energy_gain_J"] for name, run in runs.items() if "energy_gain_J" in run.attributes}
    if not gains:
        return None
    rising = [name for name in gains if gains[name] > ENERGY_RISE * runs[name].attributes["energy_scale_J"]]
    largest = max((gains[name] for name in rising if runs[name].status == "ok"), default=None)
    ended_early = {name: gain for name, gain in gains.items() if runs[name].status not in COMPLETE}
    return PrintedEnergy(Tally(len(rising), len(gains)), largest, ended_early)


def agreement(runs: Iterable[StoredRun]) -> tuple[Agreement, ...]:
    """Return a row for each method, in the order of the catalogue."""
    by_method: dict[str, list[StoredRun]] = {}
    for run in runs:
        by_method.setdefault(run.method, []).append(run)
    rows = []
    for method in run_selection.in_catalogue_order(by_method):
        own = by_method[method]
        ok = [run for run in own if run.status == "ok"]
        error, drift = _largest(ok, "angle_error_max"), _largest(ok, "energy_drift_max")
        longest = _largest(own, "run_time_s") or 0.0
        rows.append(Agreement(method, Tally(len(ok), len(own)), error, drift, longest))
    return tuple(rows)


def _largest(runs: Iterable[StoredRun], name: str) -> float | None:
    return max((float(run.attributes[name]) for run in runs if name in run.attributes), default=None)
