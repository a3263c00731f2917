"""Define the results of a run: its samples, the engine's report, and the solution.

A model returns a `Trajectory` with the samples of each quantity, an `Integration` with the engine's
report, and, for modes, a `Linearization` of the equations. A `Solution` adds the scene, the method,
the status, the metrics and the run times.
"""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from numbers import Integral, Real
from typing import Any

import numpy as np

from rotor_mbs.errors import shown_value
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.quantities import (
    NAMES,
    SCALES,
    Quantity,
    known_quantities,
    quantities,
    row_shape,
    scale_values,
)
from rotor_mbs.solution.quantities import Array as Array  # models import it from this module
from rotor_mbs.solution.quantities import arrays as all_arrays
from rotor_mbs.solution.quantities import sample_times as sample_times
from rotor_mbs.solution.status import OK_ERROR, comparison


class Trajectory:
    """Hold the n samples of a run, up to its end.

    The samples that a model returns are finite. In a run that is read from a file, angles and rates
    that are not stored are NaN. The quantity `defect` is NaN at the first sample. Quantities other
    than angles and rates are in `quantities` by name. A built-in quantity is also an attribute,
    which is None if the scene does not request the quantity or the model does not compute it.

    Parameters
    ----------
    time : (n,) s.
    angles, rates : (n, 1 + blades) rad and rad/s, rotor first; angles are unwrapped.
    quantities : (n, ...) arrays by name. A name whose array is None is left out.
    """

    # Other attributes cannot be set. An array must be in `quantities`, where `get` looks it up.
    __slots__ = ("angles", "quantities", "rates", "refined", "time")

    def __init__(
        self, time: Array, angles: Array, rates: Array, **quantities: Array | None
    ) -> None:
        self.time, self.angles, self.rates = time, angles, rates
        self.quantities = {
            name: values for name, values in quantities.items() if values is not None
        }
        # Angles and rates at the output points of ode45, which are not the sample times. Only the
        # method printed/ode45 sets this attribute.
        self.refined: Trajectory | None = None

    def get(self, name: str) -> Array | None:
        """Return a quantity by name, or the time; None if the run does not have it."""
        arrays = {"time": self.time, "angles": self.angles, "rates": self.rates}
        return arrays[name] if name in arrays else self.quantities.get(name)

    def replace(self, **changes: Array | None) -> Trajectory:
        """Return a trajectory in which some arrays are replaced, or removed by None.

        The result has no `refined`. It shares the other arrays with this trajectory.
        """
        arrays: dict[str, Any] = {
            "time": self.time,
            "angles": self.angles,
            "rates": self.rates,
            **self.quantities,
        }
        return Trajectory(**{**arrays, **changes})

    def __getattr__(self, name: str) -> Any:
        # Built-in quantities are attributes, such as `run.work`. The type is not `Array | None`, so
        # that callers need no assertion for an array that the scene requests.
        if name in NAMES:
            return self.quantities.get(name)
        raise AttributeError(f"a trajectory has no attribute {name!r}")


def shape_fault(scene: Scene, run: Trajectory) -> str:
    """Return what is wrong with the type or shape of a run's array; "" if all arrays are right.

    Each array must consist of real numbers and have the shape that the scene requires, with a row
    for each time.
    """
    for name in ("time", *(quantity.name for quantity in known_quantities(scene.outputs))):
        values = run.get(name)
        if values is None and name not in ("time", "angles", "rates"):
            continue
        if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiu":
            of = f" of {values.dtype}" if isinstance(values, np.ndarray) else ""
            return f"{name} is {type(values).__name__}{of}; allowed: an array of real numbers"
    time = np.shape(run.time)
    if len(time) != 1:
        return f"time has the shape {time}; allowed: one dimension"
    for quantity in known_quantities(scene.outputs):
        values = run.get(quantity.name)
        wanted = (*time, *row_shape(quantity, scene))
        if values is not None and np.shape(values) != wanted:
            return f"{quantity.name} has the shape {np.shape(values)}; allowed: {wanted}"
    return ""


@dataclass(slots=True)
class Integration:
    """Report how an engine ended an integration.

    A run is judged by its samples if the engine reports success. If the engine reports a failure,
    the run has failed.

    Attributes
    ----------
    success, message : whether the engine reports that it reached the end, and the reason if not.
    time_reached : time up to which the engine integrated, s.
    steps, rhs_evaluations : number of steps, and number of evaluations of the right-hand side; None
        if unknown.
    out_of_time : whether the integration was stopped by its time limit.
    """

    success: bool
    message: str = ""
    time_reached: float = 0.0
    steps: int | None = None
    rhs_evaluations: int | None = None
    out_of_time: bool = False


def report_fault(report: Integration) -> str:
    """Return which field of a report has a wrong type, and what is allowed; "" if none has."""
    kinds: dict[str, tuple[Any, str]] = {
        "success": (bool | np.bool_, "True or False"),
        "message": (str, "text"),
        "time_reached": (Real, "a number"),
        "steps": (Integral | None, "a whole number or None"),
        "rhs_evaluations": (Integral | None, "a whole number or None"),
        "out_of_time": (bool | np.bool_, "True or False"),
    }
    for name, (kind, allowed) in kinds.items():
        value = getattr(report, name)
        if not isinstance(value, kind):
            return f"Integration: {name} = {shown_value(value)}; allowed: {allowed}"
    return ""


@dataclass
class RunBlock:
    """Hold runs of several scenes that have equal numbers of blades and samples, and equal outputs.

    Attributes
    ----------
    time : (runs, samples) s.
    quantities : requested arrays by name, (runs, samples, ...); NaN after the end of a run.
    integrations : report of the engine on each run.
    samples : number of finite samples of each run.
    """

    time: Array
    quantities: dict[str, Array]
    integrations: list[Integration]
    samples: list[int]

    def trajectory(self, i: int) -> Trajectory:
        """Return the finite samples of run i."""
        n = self.samples[i]
        return Trajectory(
            self.time[i, :n], **{name: values[i, :n] for name, values in self.quantities.items()}
        )

    def end(self, i: int, integration: Integration, samples: int) -> None:
        """End run i after a number of samples: set the later values to NaN, and store the report.

        Parameters
        ----------
        i : number of the run, from 0.
        integration : report of the engine on the run; its `time_reached` is set here.
        samples : number of samples that are kept.
        """
        if samples < self.time.shape[1]:
            for values in self.quantities.values():
                values[i, samples:] = np.nan
        integration.time_reached = float(self.time[i, max(samples - 1, 0)])
        self.integrations[i], self.samples[i] = integration, samples


def all_coordinates(scene: Scene, angles: Array, rates: Array) -> tuple[Array, Array]:
    """Return the angles and rates of all coordinates, each (n, 1 + blades).

    A pitch that does not move keeps its initial angle.

    Parameters
    ----------
    scene : decides which coordinates move.
    angles, rates : (n, m) rad and rad/s, of the scene's `moving_coordinates`.
    """
    moving = scene.moving_coordinates
    all_angles = np.tile(np.array(scene.initial_angles, dtype=angles.dtype), (len(angles), 1))
    all_rates = np.zeros_like(all_angles)
    all_angles[:, moving], all_rates[:, moving] = angles, rates
    return all_angles, all_rates


def finite_rows(*tables: Array) -> int:
    """Return the number of rows before the first row that is not finite in one of the tables."""
    finite = np.all(
        [np.isfinite(table).all(axis=tuple(range(1, table.ndim))) for table in tables], axis=0
    )
    return len(finite) if finite.all() else int(np.argmin(finite))


def finite_samples(scene: Scene, arrays: Mapping[str, Array]) -> Trajectory:
    """Return the samples before the first one at which one of the arrays is not finite.

    Parameters
    ----------
    scene : decides the sample times.
    arrays : (samples reached, ...) arrays by name.
    """
    n = finite_rows(*arrays.values())
    return Trajectory(
        sample_times(scene)[:n], **{name: values[:n] for name, values in arrays.items()}
    )


@dataclass(frozen=True)
class Linearization:
    """Hold the linearized equations δq̈ + D δq̇ + K δq = 0 about a state of constant rates.

    The equations of motion are multiplied by the inverse of the mass matrix M.
    """

    # K, (n, n) 1/s²: minus M⁻¹ times the derivative of the forces with respect to the coordinates.
    stiffness: Array
    # D, (n, n) 1/s: minus M⁻¹ times the derivative of the forces with respect to the rates. It
    # includes gyroscopic terms.
    damping: Array
    # Accelerations at the state, (n,) rad/s², which are zero if the state is steady; empty if they
    # are not known.
    residual: Array


def scene_at(scene: Scene, angles: Sequence[float] | Array, speed: float, torque: float) -> Scene:
    """Return `scene` with another initial state and a constant torque on the rotor.

    Parameters
    ----------
    scene : scene of which a changed copy is returned. The only output of the copy is the angles.
    angles : (1 + blades,) rad, rotor first.
    speed : rotor rate, rad/s; the pitch rates are zero.
    torque : torque on the rotor, N m.
    """
    return replace(
        scene,
        initial_angles=tuple(float(angle) for angle in angles),
        initial_rates=(speed, *(0.0 for _ in scene.blades)),
        rotor_torque=((0.0, torque),) if torque else (),
        outputs=("angles",),
    )


def limit_at_zero(quotients: Sequence[Array], ratio: float) -> Array:
    """Extrapolate difference quotients with the steps h, 2h, 4h, ... to a step of 0 (Richardson).

    Parameters
    ----------
    quotients : difference quotients, the one with the smallest step first.
    ratio : factor by which the first term of the error grows if the step is doubled: 2 for
        one-sided quotients, 4 for central ones. The second term grows by ratio², the third by
        ratio³, and so on.
    """
    values = list(quotients)
    # Each pass combines neighbours so that the leading term of their errors cancels. One value less
    # is left.
    for power in range(1, len(values)):
        values = [
            fine + (fine - coarse) / (ratio**power - 1.0)
            for fine, coarse in itertools.pairwise(values)
        ]
    return values[0]


@dataclass
class Solution:
    """Hold the result of a method applied to a scene.

    A quantity is an (n, ...) array with a row for each of the n samples. It is an attribute and an
    item: `solution.tip`, `solution["tip"]`.

    Attributes
    ----------
    scene, method : the scene, and the name of the method, such as "lagrange/taylor".
    trajectory : the samples.
    integration : report of the engine.
    settings : all settings of the method.
    setup_time_s, output_time_s : times (s) to build the model and to compute the samples.
    run_times_s : time (s) of each integration; empty if the times are unknown.
    status, message : status determined from the samples, and its reason; "" if not assessed.
    metrics : numbers by their names in a results file, such as energy_drift_max.
    """

    scene: Scene
    method: str
    trajectory: Trajectory
    integration: Integration
    settings: Mapping[str, object] = field(default_factory=dict)
    setup_time_s: float = 0.0
    run_times_s: list[float] = field(default_factory=list)
    output_time_s: float = 0.0
    status: str = ""
    message: str = ""
    metrics: Mapping[str, float] = field(default_factory=dict)

    @property
    def time(self) -> Array:
        """Return the sample times, (n,) s."""
        return self.trajectory.time

    @property
    def angles(self) -> Array:
        """Return the rotor angle, then the pitch angle of each blade: (n, 1 + blades) rad.

        Angles that are not stored are NaN.
        """
        return self.trajectory.angles

    @property
    def rates(self) -> Array:
        """Return the rotor rate, then the pitch rate of each blade: (n, 1 + blades) rad/s.

        Rates that are not stored are NaN.
        """
        return self.trajectory.rates

    @property
    def quantities(self) -> dict[str, Array]:
        """Return the arrays of the scene's `outputs`, by name."""
        return all_arrays(self.scene, self.trajectory)

    def __getitem__(self, name: str) -> Array:
        values = self.trajectory.get(name)
        if values is not None:
            return values
        known = self.quantities
        if name not in known:
            raise KeyError(f"{shown_value(name)}; this solution has: time, {', '.join(known)}")
        return known[name]

    def __getattr__(self, name: str) -> Array:
        # Python calls this for a name that is no field. Built-in quantities and those of other
        # packages are such names. A name that starts with "_" is refused, because copying and
        # pickling ask for such names before the object has its fields.
        if not name.startswith("_") and "trajectory" in self.__dict__:
            try:
                return self[name]
            except KeyError as exc:
                raise AttributeError(f"no attribute or quantity {exc.args[0]}") from None
        raise AttributeError(name)

    def to_xarray(self) -> Any:
        """Return the samples as an xarray.Dataset with units, long names and labels.

        For example `data.angles.sel(coordinate="pitch 1")`, `data.tip.sel(blade=1, axis="y")`.
        """
        import xarray  # imported only here, because the import takes 0.4 s

        labels = {"coordinate": list(self.scene.coordinate_labels), "axis": ["x", "y", "z"]}
        scales: dict[str, Any] = {**scale_values(self.scene), "time": self.time}
        arrays = self.quantities
        variables, used = {}, {"time"}
        for quantity in quantities(self.scene.outputs):
            if quantity.name in arrays:
                variables[quantity.name] = (
                    quantity.dimensions,
                    arrays[quantity.name],
                    _attributes(quantity),
                )
                used |= set(quantity.dimensions)
        coordinates = {
            name: (name, labels.get(name, scales[name]), _attributes(scale))
            for name, scale in SCALES.items()
            if name in used
        }
        facts = {
            "scene": self.scene.name,
            "method": self.method,
            "status": self.status,
            "message": self.message,
        }
        return xarray.Dataset(variables, coordinates, {**facts, **self.metrics})

    def _summary(self) -> dict[str, str]:
        """Return the lines of the summary of a run, as texts by name; empty texts are left out."""
        last = float(self.time[-1]) if len(self.time) else self.integration.time_reached
        reached = f"{last:g} s of {self.scene.duration:g} s, {len(self.time)} samples"
        shown = comparison(self.metrics, self.scene.duration)
        error = f"{shown.error}, limit {OK_ERROR:g}" if shown.error else ""
        if shown.compared:  # a run of a sweep stores no horizon unless its error growth is computed
            error += f", compared to {shown.compared}"
        rows = {
            "method": self.method,
            "status": self.status or "not assessed",
            "message": self.message,
            "defect (rad)": f"{shown.defect}, allowed {shown.allowed}" if shown.allowed else "",
            "angle error (rad)": error,
            "reached": reached,
            "steps": "" if self.integration.steps is None else str(self.integration.steps),
            "run time": f"{float(np.median(self.run_times_s)):.3g} s" if self.run_times_s else "",
        }
        return {name: text for name, text in rows.items() if text}

    def _arrays(self) -> str:
        """Return the names, shapes and units of the arrays: "time (9,) s, angles (9, 4) rad"."""
        units = {quantity.name: quantity.units for quantity in quantities(self.scene.outputs)}
        shown = [f"time {self.time.shape} s"]
        for name, values in self.quantities.items():
            if not np.isnan(values).all():
                unit = units.get(name, "1")
                shown.append(f"{name} {values.shape}{'' if unit == '1' else f' {unit}'}")
        return ", ".join(shown)

    def __repr__(self) -> str:
        rows = self._summary() | {"arrays": self._arrays()}
        lines = [f"{self.scene.label}: {self.scene.title}"]
        for name, text in rows.items():
            lines += textwrap.wrap(
                f"{name}: {text}", 110, initial_indent="  ", subsequent_indent="    "
            )
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        rows = self._summary() | {"arrays": self._arrays()}
        cells = "".join(
            f"<tr><th>{escape(k)}</th><td>{escape(v)}</td></tr>" for k, v in rows.items()
        )
        caption = escape(f"{self.scene.label}: {self.scene.title}")
        return f"<table><caption>{caption}</caption>{cells}</table>"


def _attributes(quantity: Quantity) -> dict[str, str]:
    return {"units": quantity.units, "long_name": quantity.long_name}
