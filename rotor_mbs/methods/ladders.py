"""A method's curve in the bench: its ladder of settings, from coarse to the round-off floor."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

STEP, TOLERANCE = "step", "tolerance"


@dataclass(frozen=True)
class Ladder:
    """A curve of the diagram: one method with its fixed choices, over a falling step or tolerance."""

    kind: str  # STEP or TOLERANCE
    values: tuple[float, ...]  # steps as shares of the sample interval, or tolerances; coarse to fine
    fill: Callable[[float], Mapping[str, float]]  # the settings that go with one value
    choices: Mapping[str, object] = field(default_factory=dict)  # settings that stay the same along the ladder
    variant: str = ""  # what follows the method's name in the curve's name; "" where the choices are the default ones
    label: str = ""  # of the variant; the method's where it is left out
    method: str = ""  # name and expected order (None: adaptive step) of the method; filled in by the `Method`
    order: float | None = None

    @property
    def curve(self) -> str:
        """Name of the curve: "model/integrator", and the variant."""
        return self.method + self.variant

    @property
    def short(self) -> Ladder:
        """This ladder with every second value, without the coarsest third."""
        return replace(self, values=self.values[len(self.values) // 3 :: 2])

    def rungs(self, interval: float) -> dict[float, dict[str, object]]:
        """All that the method is given at each rung, by the number it is plotted by (step in s, or the tolerance);
        interval: s, between samples."""
        numbers = [value * interval if self.kind == STEP else value for value in self.values]
        return {number: {**self.choices, **self.fill(number)} for number in numbers}


def step_ladder(count: int, first: int = 0, **facts: Any) -> Ladder:
    """Of the setting `step`: 0.5**first, ..., 0.5**(first + count - 1) of the sample interval; facts: of the
    `Ladder`."""
    shares = tuple(0.5**k for k in range(first, first + count))
    return Ladder(STEP, shares, lambda step: {"step": step}, **facts)


def tolerance_ladder(fill: Callable[[float], Mapping[str, float]], *tolerances: float) -> Ladder:
    """The settings that `fill` gives for each tolerance, coarse to fine."""
    return Ladder(TOLERANCE, tolerances, fill)


def tolerance_pair(tolerance: float) -> Mapping[str, float]:
    """Relative and absolute tolerance of the same work.

    Angles and rates of order one: a hundredth of the relative tolerance is nowhere the larger of the two."""
    return {"relative_tolerance": tolerance, "absolute_tolerance": 0.01 * tolerance}
