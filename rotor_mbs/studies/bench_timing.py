"""Fair timing: warm-ups, then rounds over all points in turn, as many as a budget allows. Knows no engine, no process.

A point is one method at one setting. Rounds spread a drift of the machine over all points alike; the budget is shared
out so that the cheap points get all their repeats before an expensive one gets its second.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeAlias, TypeVar

import numpy as np

T = TypeVar("T", bound=Hashable)
WarmUp: TypeAlias = Callable[[T], tuple[float, bool]]

LONG_RUN_S = 0.5  # runs longer than this are repeated LONG_REPEATS times at most
LONG_REPEATS = 5
# Of the budget, what the warm-up runs may take before expensive rungs are left out, so that there is time for about two
# rounds; and what warm-ups and building may take together.
_WARM_UP_SHARE, _BUILD_SHARE = 0.3, 0.6


@dataclass
class Timings(Generic[T]):
    """What `conduct` found: by point, run times in s of those that can be repeated, seconds of the warm-up of all that
    were tried, and why the budget left out the others."""

    times: dict[T, list[float]] = field(default_factory=dict)
    warm: dict[T, float] = field(default_factory=dict)
    left_out: dict[T, str] = field(default_factory=dict)


def statistics(times: Sequence[float]) -> dict[str, float]:
    """Statistics of run times in s, by the names they are stored under; quartiles between the order statistics."""
    low, middle, high = map(float, np.quantile(times, (0.25, 0.5, 0.75)))
    return {
        "run_time_s": middle,
        "run_time_min_s": min(times),
        "run_time_q1_s": low,
        "run_time_q3_s": high,
        "repeats": len(times),
    }


def conduct(
    ladders: Sequence[Sequence[T]],
    warm_up: WarmUp[T],
    repeat: Callable[[T], float],
    budget_s: float,
    repeats: int,
    clock: Callable[[], float],
) -> Timings[T]:
    """Warms up every point, the cheapest next rung of any ladder first, then times them in rounds.

    ladders     each coarse to fine
    warm_up     builds the point and runs it once: seconds, and whether it came back, so that it can be repeated
    repeat      runs it once more: seconds
    budget_s    for all of it, on `clock` (s)
    """
    found: Timings[T] = Timings()
    start = clock()

    def left() -> float:
        return min(_WARM_UP_SHARE * budget_s - sum(found.warm.values()), _BUILD_SHARE * budget_s - (clock() - start))

    _warm_all(found, ladders, warm_up, left)
    alive = {point: max(found.warm[point], 1e-9) for point in found.times}
    few = min(repeats, LONG_REPEATS)
    wanted = {point: repeats if seconds <= LONG_RUN_S else few for point, seconds in alive.items()}
    allowed = allot(alive, wanted, budget_s - (clock() - start))
    for round_ in range(max(allowed.values(), default=0)):
        for point, count in allowed.items():
            if round_ and clock() - start > budget_s:  # the machine has become slower
                return found
            if round_ < count:
                found.times[point].append(repeat(point))
    return found


def _warm_all(
    found: Timings[T],
    ladders: Sequence[Sequence[T]],
    warm_up: WarmUp[T],
    left_s: Callable[[], float],
) -> None:
    """The rung expected to be cheapest comes next. What is left over when even that one does not fit is left out."""
    waiting = [(0.0, 0, number) for number, ladder in enumerate(ladders) if ladder]
    while waiting:
        expected, rung, number = heapq.heappop(waiting)
        ladder = ladders[number]
        if rung and expected > left_s():
            reason = f"not run: about {expected:.2g} s more were not in the budget"
            found.left_out.update(dict.fromkeys(ladder[rung:], reason))
            continue
        found.warm[ladder[rung]], returned = warm_up(ladder[rung])
        if returned:
            found.times[ladder[rung]] = []
        if rung + 1 < len(ladder):
            following = _expected([found.warm[point] for point in ladder[: rung + 1]])
            heapq.heappush(waiting, (following, rung + 1, number))


def _expected(earlier: Sequence[float]) -> float:
    """Expected time of the next rung in s: the last one's time, grown as from the one before it, at least doubled."""
    growth = earlier[-1] / earlier[-2] if len(earlier) > 1 and earlier[-2] > 0.0 else 2.0
    return earlier[-1] * min(max(growth, 2.0), 10.0)


def allot(seconds: Mapping[T, float], wanted: Mapping[T, int], budget_s: float) -> dict[T, int]:
    """Repeats of each point: all it wants or what an equal share of time allows, and one in any case.

    What points that want less than their share leave is shared by the others.
    """
    found: dict[T, int] = {}
    by_demand = sorted(seconds, key=lambda point: wanted[point] * seconds[point])
    for done, point in enumerate(by_demand):
        share = budget_s / (len(by_demand) - done) * (1.0 + 1e-12)
        found[point] = max(1, min(wanted[point], int(share / seconds[point])))
        budget_s -= found[point] * seconds[point]
    return {point: found[point] for point in seconds}
