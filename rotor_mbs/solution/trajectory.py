"""What a model returns of a run: samples by quantity, and the engine's report; how its rows become samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.quantities import NAMES, known_quantities, row_shape
from rotor_mbs.solution.quantities import Array as Array  # with the samples, for the models
from rotor_mbs.solution.quantities import sample_times as sample_times


class Trajectory:
    """Samples at equally spaced times, as far as the run got (n rows; every row finite); angles are unwrapped.
    Quantities beside angles and rates (n, 1 + blades) are in `quantities` by name; the built-in ones are attributes,
    too, None where the scene does not ask for them or the model lacks them."""

    time: Array
    angles: Array
    rates: Array
    quantities: dict[str, Array]

    def __init__(self, time: Array, angles: Array, rates: Array, **quantities: Array | None) -> None:
        self.time, self.angles, self.rates = time, angles, rates
        self.quantities = {name: values for name, values in quantities.items() if values is not None}

    def get(self, name: str) -> Array | None:
        """An array by its quantity's name, time among them; None where the run does not have it."""
        if name in _FIELDS:
            values: Array = self.__dict__[name]
            return values
        return self.quantities.get(name)

    def replace(self, **changes: Array | None) -> Trajectory:
        """A copy with other arrays; None removes one. The arrays themselves are shared."""
        arrays: dict[str, Any] = {"time": self.time, "angles": self.angles, "rates": self.rates, **self.quantities}
        return Trajectory(**{**arrays, **changes})

    def __getattr__(self, name: str) -> Any:
        # A quantity is an attribute, so that models and metrics read `run.work` whoever declared it. The type is not
        # `Array | None`: what the scene asks for is there.
        if name in NAMES:
            return self.quantities.get(name)
        raise AttributeError(f"a trajectory has no attribute {name!r}")

    def __setattr__(self, name: str, value: Any) -> None:
        if name in _FIELDS or name == "quantities":
            object.__setattr__(self, name, value)
        elif name not in NAMES:
            raise AttributeError(f"a trajectory has no attribute {name!r}")
        elif value is None:
            self.quantities.pop(name, None)
        else:
            self.quantities[name] = value


_FIELDS = ("time", "angles", "rates")


def shape_fault(scene: Scene, run: Trajectory) -> str:
    """The array that has not the shape of the scene and as many rows as there are times; "" where all have."""
    time = np.shape(run.time)
    if len(time) != 1:
        return f"time has the shape {time}; allowed: one dimension"
    for quantity in known_quantities(scene.outputs):
        values = run.get(quantity.name)
        wanted = (*time, *row_shape(quantity, scene))
        if quantity.is_over_time and values is not None and np.shape(values) != wanted:
            return f"{quantity.name} has the shape {np.shape(values)}; allowed: {wanted}"
    return ""


@dataclass(slots=True)
class Integration:
    """One integration as the engine reports it: a claim, which `judgement` checks against the samples."""

    success: bool  # whether the engine says that it reached the end
    message: str = ""  # why it did not; "" where it did
    time_reached: float = 0.0  # s
    steps: int | None = None  # how many; None where they are not counted
    rhs_evaluations: int | None = None
    out_of_time: bool = False  # it was ended by its time limit; what it reached is kept


@dataclass
class RunBlock:
    """Many runs at once, of scenes with the same number of blades and samples and the same outputs."""

    time: Array  # (runs, samples) s
    quantities: dict[str, Array]  # by name, what the scenes ask for: (runs, samples, ...), NaN after a run broke off
    integrations: list[Integration]  # the engine's report of each run
    samples: list[int]  # how many rows of each are finite

    def trajectory(self, i: int) -> Trajectory:
        n = self.samples[i]
        return Trajectory(self.time[i, :n], **{name: values[i, :n] for name, values in self.quantities.items()})

    def end(self, i: int, integration: Integration, samples: int) -> None:
        """Run i has so many samples, though a fixed pitch, or a term that vanishes, stays finite for longer."""
        if samples < self.time.shape[1]:
            for values in self.quantities.values():
                values[i, samples:] = np.nan
        integration.time_reached = float(self.time[i, max(samples - 1, 0)])
        self.integrations[i], self.samples[i] = integration, samples


def all_coordinates(scene: Scene, angles: Array, rates: Array) -> tuple[Array, Array]:
    """(n, 1 + blades) rad and rad/s from those of `scene.moving_coordinates`; a pitch that is fixed keeps its angle."""
    moving = scene.moving_coordinates
    all_angles = np.tile(np.array(scene.initial_angles, dtype=angles.dtype), (len(angles), 1))
    all_rates = np.zeros_like(all_angles)
    all_angles[:, moving], all_rates[:, moving] = angles, rates
    return all_angles, all_rates


def finite_rows(*tables: Array) -> int:
    finite = np.all([np.isfinite(table).all(axis=tuple(range(1, table.ndim))) for table in tables], axis=0)
    return len(finite) if finite.all() else int(np.argmin(finite))


def finite_samples(scene: Scene, arrays: Mapping[str, Array]) -> Trajectory:
    """The samples of all `arrays` by name, (samples reached, ...), up to the first in which one is not finite."""
    n = finite_rows(*arrays.values())
    return Trajectory(sample_times(scene)[:n], **{name: values[:n] for name, values in arrays.items()})
