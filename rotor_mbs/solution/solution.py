"""A run as a Python user has it: scene, method, samples, status, numbers, times."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np

from rotor_mbs.errors import InputError
from rotor_mbs.scenario.accuracy_bounds import Bound
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.quantities import SCALES, Array, Quantity, quantities, scale_values
from rotor_mbs.solution.quantities import arrays as all_arrays
from rotor_mbs.solution.trajectory import Integration, Trajectory


@dataclass
class Solution:
    """A method applied to a scene.

    Attributes
    ----------
    scene, method : what was run; the method by its name, such as "lagrange/taylor".
    trajectory : the samples.
    integration : what the engine reports of itself.
    settings : of the method, all of them.
    setup_time_s, run_times_s, output_time_s : s, building the model, each integration, computing the samples.
    status, message : from the samples, see `judgement`; "" where the run was not judged.
    metrics : numbers by their names in a results file, such as energy_drift_max.
    is_corrected : whether the method claims to solve the corrected equations.
    bounds : accuracy bounds that the method brings beside those of reference/accuracy.toml.

    Quantities are attributes and items: `solution.tip`, `solution["tip"]`; (n, ...) arrays, n samples.
    """

    scene: Scene
    method: str
    trajectory: Trajectory
    integration: Integration
    settings: Mapping[str, object] = field(default_factory=dict)
    setup_time_s: float = 0.0
    run_times_s: list[float] = field(default_factory=lambda: [0.0])
    output_time_s: float = 0.0
    status: str = ""
    message: str = ""
    metrics: Mapping[str, float] = field(default_factory=dict)
    is_corrected: bool = True
    bounds: tuple[Bound, ...] = ()

    @property
    def time(self) -> Array:
        """(n,) s"""
        return self.trajectory.time

    @property
    def angles(self) -> Array:
        """(n, 1 + blades) rad: rotor, then the pitch of each blade."""
        return self.trajectory.angles

    @property
    def rates(self) -> Array:
        """(n, 1 + blades) rad/s: rotor, then the pitch of each blade."""
        return self.trajectory.rates

    @property
    def quantities(self) -> dict[str, Array]:
        """The arrays that the scene's `outputs` ask for, by name."""
        return all_arrays(self.scene, self.trajectory)

    def __getitem__(self, name: str) -> Array:
        values = self.trajectory.get(name)
        if values is not None:
            return values
        known = self.quantities
        if name not in known:
            raise KeyError(f"{name!r}; this solution has: time, {', '.join(known)}")
        return known[name]

    def __getattr__(self, name: str) -> Array:
        # Called for names that are no field: quantities of plug-ins are attributes like the built-in ones. Names that
        # start with "_" stay unknown, as copying and pickling ask for those of an object that is not yet filled.
        if not name.startswith("_") and "trajectory" in self.__dict__:
            try:
                return self[name]
            except KeyError as exc:
                raise AttributeError(f"no attribute or quantity {exc.args[0]}") from None
        raise AttributeError(name)

    def to_xarray(self) -> Any:
        """The samples as an xarray.Dataset with units, long names and labels: `data.angles.sel(coordinate="pitch 1")`,
        `data.tip.sel(blade=1, axis="y")`. Raises InputError where xarray is not installed."""
        xarray = need_xarray()
        labels = {"coordinate": list(self.scene.coordinate_labels), "axis": ["x", "y", "z"]}
        scales: dict[str, Any] = {**scale_values(self.scene), "time": self.time}
        if (refined := self.trajectory.get("refined_time")) is not None:
            scales["refined_time"] = refined
        arrays = self.quantities
        variables, used = {}, {"time"}
        for quantity in quantities(self.scene.outputs):
            if quantity.name in arrays:
                variables[quantity.name] = (quantity.dimensions, arrays[quantity.name], _attributes(quantity))
                used |= set(quantity.dimensions)
        coordinates = {
            name: (name, labels.get(name, scales[name]), _attributes(scale))
            for name, scale in SCALES.items()
            if name in used
        }
        facts = {"scene": self.scene.name, "method": self.method, "status": self.status, "message": self.message}
        return xarray.Dataset(variables, coordinates, {**facts, **self.metrics})

    def _summary(self) -> dict[str, str]:
        reached = f"{self.time[-1]:g} s of {self.scene.duration:g} s" if len(self.time) else "no sample"
        rows = {
            "method": self.method,
            "status": self.status or "not judged",
            "message": self.message,
            "reached": f"{reached}, {len(self.time)} samples",
            "steps": "" if self.integration.steps is None else str(self.integration.steps),
            "run time": f"{float(np.median(self.run_times_s)):.3g} s",
        }
        return {name: text for name, text in rows.items() if text}

    def __repr__(self) -> str:
        metrics = ", ".join(f"{name} {value:.3g}" for name, value in self.metrics.items())
        lines = [
            f"{self.scene.name}: {self.scene.title}",
            *(f"{name}: {text}" for name, text in self._summary().items()),
        ]
        return "\n  ".join([*lines, *textwrap.wrap(metrics, 110)[:3]])

    def _repr_html_(self) -> str:
        rows = self._summary() | {name: f"{value:.3g}" for name, value in self.metrics.items()}
        cells = "".join(f"<tr><th>{escape(k)}</th><td>{escape(v)}</td></tr>" for k, v in rows.items())
        return f"<table><caption>{escape(self.scene.title)}</caption>{cells}</table>"


def need_xarray() -> Any:
    """The module xarray. Raises InputError that says how to get it."""
    try:
        import xarray
    except ImportError as exc:
        raise InputError('xarray is not installed; allowed: pip install "rotor_mbs[xarray]"') from exc
    return xarray


def _attributes(quantity: Quantity) -> dict[str, str]:
    return {"units": quantity.units, "long_name": quantity.long_name}
