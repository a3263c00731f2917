"""Each published number and claim tested on the printed equations and on the corrected model."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

from rotor_mbs.analysis import run_selection
from rotor_mbs.analysis.published import Condition, Published, TrajectoryNumber, published
from rotor_mbs.analysis.trajectory_numbers import measure
from rotor_mbs.solution.status import COMPLETE
from rotor_mbs.store.read import StoredRun, StoredScene

Choice = Callable[[StoredScene], StoredRun | None]


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

    @property
    def is_decided(self) -> bool:
        """Whether the file decides it for one of the models."""
        return self.printed.holds is not None or self.corrected.holds is not None


def claims(scenes: Mapping[str, StoredScene], items: Iterable[Published] | None = None) -> list[Claim]:
    """The numbers and claims that `scenes` can decide for at least one model; of `items`, by default of all."""
    found = []
    for item in published() if items is None else items:
        printed = _outcome(item, _Runs(scenes, run_selection.printed_run))
        found.append(Claim(item, printed, _outcome(item, _Runs(scenes, run_selection.reference_or_corrected_run))))
    return [claim for claim in found if claim.is_decided]


class Numbers(Protocol):
    """Where the numbers of a claim are read off: the runs of one model, one for each scene."""

    def has(self, scene: str) -> bool:
        """Whether there is a run of the scene that can decide anything."""

    def value(self, asked: TrajectoryNumber) -> float | None:
        """The number; None where it is undefined, or where there is no run."""


def readings_of(item: Published, numbers: Numbers) -> tuple[Reading, ...]:
    """The tests of a claim in words, in order."""
    return tuple(_read(test, numbers) for test in item.tests)


def all_hold(readings: Iterable[Reading]) -> bool | None:
    """False as soon as one fails, even where others cannot be decided; None where none fails and one is undecided."""
    verdicts = [reading.holds for reading in readings]
    if False in verdicts:
        return False
    return None if None in verdicts or not verdicts else True


@dataclass(frozen=True)
class _Runs:
    scenes: Mapping[str, StoredScene]
    choose: Choice

    def of(self, scene: str) -> StoredRun | None:
        return self.choose(self.scenes[scene]) if scene in self.scenes else None

    def has(self, scene: str) -> bool:
        return self.of(scene) is not None

    def value(self, asked: TrajectoryNumber) -> float | None:
        run = self.of(asked.scene)
        return None if run is None else measure(run, asked)


def _outcome(item: Published, runs: _Runs) -> ClaimResult:
    early = tuple(sorted(scene for scene in item.scenes if _ended_early(runs.of(scene))))
    if item.of is not None:
        value = runs.value(item.of)
        return ClaimResult(None if value is None else rounds_to(value, item.value, item.decimals), value, (), early)
    readings = readings_of(item, runs)
    return ClaimResult(all_hold(readings), None, readings, early)


def rounds_to(value: float, printed: float, decimals: int) -> bool:
    """Whether `value`, rounded as it would be printed, is the printed number."""
    return f"{value:.{decimals}f}" == f"{printed:.{decimals}f}"


def _ended_early(run: StoredRun | None) -> bool:
    return run is not None and run.status not in COMPLETE


def _read(test: Condition, numbers: Numbers) -> Reading:
    if not numbers.has(test.of.scene) or (test.than is not None and not numbers.has(test.than.scene)):
        return Reading(test, None, None, None)
    value = numbers.value(test.of)
    limit = numbers.value(test.than) if test.than is not None else None
    undefined = value is None or (test.than is not None and limit is None)
    return Reading(test, value, limit, False if undefined else _relation(test, value, limit))


def _relation(test: Condition, value: float | None, limit: float | None) -> bool:
    assert value is not None
    against = limit if limit is not None else test.bound
    assert against is not None
    if test.relation == "opposite":
        return value * against < 0.0
    return value < against if test.relation == "<" else value > against
