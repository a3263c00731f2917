"""What a run leaves behind: samples and the engine's word, as plain arrays. Knows no engine and no file format."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(slots=True)
class Refined:
    """An integrator's own output points (ode45: four per step), from which a figure's extremes are read."""

    time: Array  # (k,) s
    angles: Array  # (k, 1 + blades) rad
    rates: Array  # (k, 1 + blades) rad/s


@dataclass(slots=True)
class Trajectory:
    """Samples at equally spaced times, as far as the run got (n rows; every row finite).

    Angles are unwrapped. A pitch without inertia is held at its initial value. Optional fields are None where
    the scene does not ask for them or they do not exist in the model.
    """

    time: Array  # (n,) s
    angles: Array  # (n, 1 + blades) rad
    rates: Array  # (n, 1 + blades) rad/s
    tip: Array | None = None  # (n, blades, 3) m, base frame
    kinetic_energy: Array | None = None  # (n,) J
    potential_energy: Array | None = None  # (n,) J, gravity and springs
    work: Array | None = None  # (n,) J, of the torque, less what the dampers took
    constraint_error: Array | None = None  # (n,) m, largest position gap in any joint of a redundant chain
    refined: Refined | None = None
    uncertainty: Array | None = None  # (n,) rad, of a reference's angles
    growth: Array | None = None  # (n,) how many times an error of the initial state has grown, of a reference


@dataclass(slots=True)
class Integration:
    """One integration as the engine tells it. A word, not a verdict: see `outcome`.

    out_of_time: it was ended by its time limit; what it reached is kept.
    """

    success: bool
    message: str = ""
    time_reached: float = 0.0
    steps: int | None = None
    rhs_evaluations: int | None = None
    out_of_time: bool = False


@dataclass(frozen=True, slots=True)
class Item:
    """One thing a model builds for a scene: kind is node, object, marker, load, sensor, equation or term."""

    kind: str
    name: str
    detail: str = ""


@dataclass(slots=True)
class Solution:
    """A method applied to a scene: samples, the engine's word, settings and times (s)."""

    method: str
    trajectory: Trajectory
    integration: Integration
    settings: dict[str, object]
    setup_time_s: float
    run_times_s: list[float]
    output_time_s: float
    metrics: dict[str, float | int | str] = field(default_factory=dict)
