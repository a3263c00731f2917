"""A method's curve in the bench: its ladder of settings, from coarse to the round-off floor."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

STEP, TOLERANCE = "step", "tolerance"


@dataclass(frozen=True)
class Ladder:
    """A curve of the diagram: one method with its fixed choices, over a falling step or tolerance.

    kind      STEP or TOLERANCE
    values    steps as shares of the sample interval, or tolerances; coarse to fine
    fill      the settings that go with one value
    choices   settings that stay the same along the ladder
    variant   what follows the method's name in the curve's name; "" where the choices are the default ones
    label     of the variant; the method's where it is left out
    method, order   name and expected order (None: adaptive step) of the method; filled in by the `Method`
    """

    kind: str
    values: tuple[float, ...]
    fill: Callable[[float], Mapping[str, object]]
    choices: Mapping[str, object] = field(default_factory=dict)
    variant: str = ""
    label: str = ""
    method: str = ""
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
        """The ladder on a scene whose samples are `interval` s apart.

        All that the method is given, by the number it is plotted by (s, or the tolerance).
        """
        settings = [value * interval if self.kind == STEP else value for value in self.values]
        return {setting: {**self.choices, **self.fill(setting)} for setting in settings}


def step_ladder(count: int, first: int = 0, **facts: Any) -> Ladder:
    """`count` values of the setting `step`, by halves from 0.5**first of the sample interval; facts: of a `Ladder`."""
    return Ladder(STEP, tuple(0.5**k for k in range(first, first + count)), lambda step: {"step": step}, **facts)


def tolerance_ladder(fill: Callable[[float], Mapping[str, object]], *tolerances: float) -> Ladder:
    """The settings that `fill` gives for each tolerance, coarse to fine."""
    return Ladder(TOLERANCE, tolerances, fill)


def tolerance_pair(tolerance: float) -> Mapping[str, object]:
    """Angles and rates of order one: a hundredth of the relative tolerance is nowhere the larger of the two."""
    return {"relative_tolerance": tolerance, "absolute_tolerance": 0.01 * tolerance}
