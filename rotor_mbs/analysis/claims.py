"""Each published number and claim tested on the printed equations and on the corrected model."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from rotor_mbs.analysis import run_selection
from rotor_mbs.analysis.published import Condition, Published, TrajectoryNumber, published
from rotor_mbs.analysis.trajectory_numbers import measure
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.solution.status import COMPLETE

Choice = Callable[[StoredScene], StoredRun | None]
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
    """The numbers and claims that `scenes` can decide for at least one model; of `items`, by default of all."""
    found = []
    for item in published() if items is None else items:
        printed = _outcome(item, scenes, run_selection.printed_run)
        found.append(Claim(item, printed, _outcome(item, scenes, run_selection.reference_or_corrected_run)))
    return [one for one in found if one.printed.holds is not None or one.corrected.holds is not None]


def readings_of(item: Published, values: NumberValues) -> tuple[Reading, ...]:
    """The tests of a claim in words, in order."""
    return tuple(_read(test, values) for test in item.tests)


def all_hold(readings: Iterable[Reading]) -> bool | None:
    """False as soon as one fails, even where others cannot be decided; None where none fails and one is undecided."""
    verdicts = [reading.holds for reading in readings]
    if False in verdicts:
        return False
    return None if None in verdicts or not verdicts else True


def _outcome(item: Published, scenes: Mapping[str, StoredScene], choose: Choice) -> ClaimResult:
    chosen = {name: choose(scenes[name]) for name in sorted(item.scenes) if name in scenes}
    runs = {name: run for name, run in chosen.items() if run is not None}
    values = {number: measure(runs[number.scene], number) for number in item.numbers if number.scene in runs}
    early = tuple(name for name, run in runs.items() if run.status not in COMPLETE)
    if item.of is not None:
        value = values.get(item.of)
        return ClaimResult(None if value is None else rounds_to(value, item.value, item.decimals), value, (), early)
    readings = readings_of(item, values)
    return ClaimResult(all_hold(readings), None, readings, early)


def rounds_to(value: float, printed: float, decimals: int) -> bool:
    """Whether `value`, rounded as it would be printed, is the printed number."""
    return f"{value:.{decimals}f}" == f"{printed:.{decimals}f}"


def _read(test: Condition, values: NumberValues) -> Reading:
    sides = [test.of] if test.than is None else [test.of, test.than]
    if any(side not in values for side in sides):
        return Reading(test, None, None, None)
    value, limit = values[test.of], None if test.than is None else values[test.than]
    against = test.bound if test.than is None else limit
    holds = value is not None and against is not None and _RELATIONS[test.relation](value, against)
    return Reading(test, value, limit, holds)
