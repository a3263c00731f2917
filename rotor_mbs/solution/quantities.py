"""Declare the output quantities of a run, each once.

A declaration says which dimensions and units a quantity has, who computes it, and how it is judged
and plotted. Other packages add quantities by an entry point in the group `rotor_mbs.quantities`.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError
from rotor_mbs.scenario.scene import ENTRY_POINT_GROUP, Scene

if TYPE_CHECKING:
    from rotor_mbs.solution.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class QuantityMetric:
    """Declare a metric that is computed from a quantity, and the largest value that passes.

    The metric is stored with the run. It is the largest magnitude of the quantity, or of its
    difference from another array. All samples count, but only those up to the horizon if the other
    array is that of the reference. If the last dimension is `axis`, the magnitude is the length of
    a vector.

    Attributes
    ----------
    metric : name of the metric.
    with_reference : whether the metric is computed from the difference from the reference's array,
        up to the horizon.
    relative_to : (scene) -> number by which the metric is divided for the check; None for 1.
    at_own_state : whether the array of the closed form at the run's own states takes the place of
        the reference's array. The metric is then computed over all samples.
    scale_of : (scene, samples) -> number by which the metric is divided before it is stored; None
        for 1.
    check : name of the check whose bound in reference/accuracy.toml applies; "" if `bound` does.
    bound : largest value that passes. It is used if `check` is "", or if the method has no bound
        for `check`. None if the metric is not checked in these cases.
    channel, unit : name and unit of the value in the message of a check.
    fault : message for a value that does not pass, with the field {value}.
    look_at : probable cause of a failure.
    """

    metric: str
    with_reference: bool = True
    relative_to: Callable[[Scene], float] | None = None
    at_own_state: bool = False
    scale_of: Callable[[Scene, Trajectory], float] | None = None
    check: str = ""
    bound: float | None = None
    channel: str = ""
    unit: str = ""
    fault: str = ""
    look_at: str = ""


@dataclass(frozen=True, slots=True)
class Plot:
    """Describe the plot of a quantity over time.

    Attributes
    ----------
    title, axis : title of the plot, and label of its vertical axis.
    logarithmic : whether the vertical axis is logarithmic.
    """

    title: str
    axis: str
    logarithmic: bool = False


@dataclass(frozen=True, slots=True)
class Quantity:
    """Declare an output quantity: an array that is computed for a run.

    Attributes
    ----------
    name : name of the dataset in a file, and of the attribute of a `Run`.
    dimensions : names of the array's axes: "time", then any of "coordinate", "blade" and "axis".
    units, long_name : attributes of the dataset.
    output : entry of a scene's `outputs` that requests the quantity; "" if the quantity is stored
        whenever the model computes it.
    producer : (scene, samples) -> array, a formula that computes the quantity for all methods. The
        formula returns None if an array that it needs is missing. None if each model computes the
        quantity itself.
    required : whether every run of a built-in method must have the quantity if its scene requests
        it.
    judgement : metric and bound of the quantity; None if the quantity is not checked, or if special
        code in `analysis` checks it.
    plot : how the quantity is plotted; None if it has no plot of its own.
    has_peak : whether the largest magnitude and the time at which it occurs are metrics of a run.

    Examples
    --------
    >>> angular_momentum = Quantity(
    ...     "hub_angular_momentum", ("time",), "N m s",
    ...     "angular momentum of the hub about the shaft",
    ...     output="momentum",
    ...     producer=lambda scene, samples: scene.hub_inertia * samples.rates[:, 0],
    ...     judgement=QuantityMetric("hub_angular_momentum_error_max", bound=1e-3, unit="N m s"))
    """

    name: str
    dimensions: tuple[str, ...]
    units: str
    long_name: str
    output: str = ""
    producer: Callable[[Scene, Trajectory], Array | None] | None = None
    required: bool = True
    judgement: QuantityMetric | None = None
    plot: Plot | None = None
    has_peak: bool = False


# ---- Dimensions

# The values along each dimension are an array in the file: times, or numbers of coordinates, blades
# and axes.
SCALES = {
    scale.name: scale
    for scale in (
        Quantity("time", ("time",), "s", "time"),
        Quantity(
            "coordinate", ("coordinate",), "1", "joint coordinate: 0 rotor, i pitch of blade i"
        ),
        Quantity("blade", ("blade",), "1", "blade number, from 1"),
        Quantity(
            "axis", ("axis",), "1", "axis: 0 x, 1 y, 2 z of the frame that each variable names"
        ),
    )
}


def sample_times(scene: Scene) -> Array:
    """Return the sample times of a scene, (samples,) s."""
    return np.linspace(0.0, scene.duration, scene.samples)


def scale_values(scene: Scene) -> dict[str, NDArray[np.float64] | NDArray[np.int64]]:
    """Return the values along each dimension of a complete run, by name of the dimension.

    The values are times in s, and the numbers of coordinates, blades and axes.
    """
    blades = len(scene.blades)
    return {
        "time": sample_times(scene),
        "coordinate": np.arange(1 + blades),
        "blade": np.arange(1, 1 + blades),
        "axis": np.arange(3),
    }


def row_shape(quantity: Quantity, scene: Scene) -> tuple[int, ...]:
    """Return the shape of one sample of a quantity: () for a number, (1 + blades,) for angles."""
    scales = scale_values(scene)
    return tuple(len(scales[dimension]) for dimension in quantity.dimensions[1:])


# ---- Built-in quantities, and what their declarations compute


# Energies of a run that diverges may overflow. No warning is needed, because the judgement of the
# run rejects values that are not finite.
@np.errstate(over="ignore", invalid="ignore")
def energy_balance(kinetic: Array, potential: Array, work: Array) -> Array:
    """Return the total energy minus the work, minus the initial value of this difference.

    Parameters
    ----------
    kinetic, potential, work : (..., n) J, energies and work at the samples of one run or of many.

    Returns
    -------
    ndarray, shape (..., n)
        J.
    """
    total = kinetic + potential - work
    error: Array = total - total[..., :1]  # a slice, so that a run without samples is no error
    return error


def energy_error(samples: Trajectory) -> Array | None:
    """Return the energy balance of a run, (n,) J; None if the run has no energies or work."""
    kinetic, potential, work = (
        samples.get(name) for name in ("kinetic_energy", "potential_energy", "work")
    )
    if kinetic is None or potential is None or work is None:
        return None
    return energy_balance(kinetic, potential, work)


def longest_arm(scene: Scene) -> float:
    """Return the largest distance (m) of a blade's centre of mass from the hub's centre.

    The result is 1 if all centres of mass are at the hub's centre, because callers divide by it.
    """
    return max(math.hypot(*blade.centre_of_mass) for blade in scene.blades) or 1.0


def _largest_root_force(_scene: Scene, run: Trajectory) -> float:
    """Return the largest root force (N) over the blades and samples; 1 if missing or zero."""
    forces = run.get("blade_root_force")
    return 1.0 if forces is None else float(np.linalg.norm(forces, axis=-1).max(initial=0.0)) or 1.0


def _largest_root_force_at_arm(scene: Scene, run: Trajectory) -> float:
    """Return the largest root force times the longest arm (N m), the scale of moments.

    The largest moment is no suitable scale, because all moments may be nearly zero.
    """
    return _largest_root_force(scene, run) * longest_arm(scene)


def _load(
    name: str, dimensions: tuple[str, ...], long_name: str, title: str, look_at: str
) -> Quantity:
    """Return the declaration of a load, which is compared with the closed form at the run's states.

    Parameters
    ----------
    name, long_name : see `Quantity`. The unit is N for a name that ends with "force", else N m.
    dimensions : names of the axes after "time".
    title : title of the plot.
    look_at : probable cause of a failure.
    """
    is_force = name.endswith("force")
    rule = QuantityMetric(
        f"{name}_error",
        at_own_state=True,
        scale_of=_largest_root_force if is_force else _largest_root_force_at_arm,
        check="loads",
        channel=name.replace("_", " "),
        unit="of the largest",
        fault=(
            f"{name.replace('_', ' ')} differs by {{value}} of the largest load from the closed "
            "form at its state"
        ),
        look_at=look_at,
    )
    plot = Plot(title, "force (N)" if is_force else "moment (N m)")
    units = "N" if is_force else "N m"
    return Quantity(
        name,
        ("time", *dimensions),
        units,
        long_name,
        "loads",
        judgement=rule,
        plot=plot,
        has_peak=True,
    )


# The root of a blade is the point on its pitch axis at the hub's radius from the apex. At a sample
# at which a torque jumps, a load has the value before the jump.
LOADS = (
    _load(
        "blade_root_force",
        ("blade", "axis"),
        "force of the hub on each blade at its root, in the blade's frame",
        "Forces at the blade roots",
        "an acceleration of a centre of mass, or a weight",
    ),
    _load(
        "blade_root_moment",
        ("blade", "axis"),
        "moment of the hub on each blade about its root, in the blade's frame",
        "Moments at the blade roots",
        "a lever, a gyroscopic moment, or a weight",
    ),
    _load(
        "shaft_force",
        ("axis",),
        "force of the shaft's bearing on the rotor, in the base frame",
        "Force of the shaft's bearing",
        "the sum of the forces at the roots",
    ),
    _load(
        "shaft_moment",
        ("axis",),
        "moment of the shaft's bearing on the rotor about the hub centre, in the base frame",
        "Moment of the shaft's bearing",
        "the sum of the moments at the roots, the hub, or the torque",
    ),
    _load(
        "pitch_actuator_moment",
        ("blade",),
        "moment of each pitch actuator (torque, spring, damper) on its blade",
        "Moments of the pitch actuators",
        "a spring or a damper of a pitch bearing",
    ),
)


def named_loads(
    roots: Iterable[tuple[Array, Array]], shaft_force: Array, shaft_moment: Array, actuators: Array
) -> dict[str, Array]:
    """Return the arrays of the quantities `LOADS` by name.

    Parameters
    ----------
    roots : for each blade the (n, 3) force (N) and moment (N m) at its root in its frame.
    shaft_force, shaft_moment : (n, 3) N and N m, force and moment of the bearing in the base frame.
    actuators : (n, blades) N m, moments of the pitch actuators.
    """
    forces, moments = (np.stack(vectors, axis=1) for vectors in zip(*roots, strict=True))
    arrays = forces, moments, shaft_force, shaft_moment, actuators
    return {
        load.name: np.asarray(values, dtype=float)
        for load, values in zip(LOADS, arrays, strict=True)
    }


_JOINT_GAP = QuantityMetric(
    "constraint_error_max",
    with_reference=False,
    relative_to=longest_arm,
    check="gap",
    bound=0.0,  # for a method without a bound of its own: its joints must not open
    channel="joints",
    unit="of arm",
    fault="joint gap of {value} of the largest distance of a centre of mass from the hub centre",
    look_at="a joint of the chain that is not constrained, or its marker",
)

# Name of the quantity that the judgement of a run computes, not the model.
DEFECT = "defect"

BUILT_IN = (
    Quantity(
        "angles", ("time", "coordinate"), "rad", "rotor angle and pitch angles, unwrapped", "angles"
    ),
    Quantity("rates", ("time", "coordinate"), "rad/s", "rotor rate and pitch rates", "rates"),
    Quantity(
        "tip",
        ("time", "blade", "axis"),
        "m",
        "position of each blade tip in the base frame",
        "tip",
        judgement=QuantityMetric("tip_error_max"),
    ),
    Quantity("kinetic_energy", ("time",), "J", "kinetic energy", "energy"),
    Quantity(
        "potential_energy",
        ("time",),
        "J",
        "potential energy of gravity (zero at the shaft) and springs",
        "energy",
    ),
    Quantity(
        "work",
        ("time",),
        "J",
        "work of torques and commands minus the energy dissipated by dampers",
        "energy",
    ),
    Quantity(
        "energy_error",
        ("time",),
        "J",
        "kinetic plus potential energy minus work, minus its initial value",
        "energy",
        producer=lambda _, samples: energy_error(samples),
        plot=Plot(
            "Energy error: change of total energy minus work",
            "|energy error| (J)",
            logarithmic=True,
        ),
    ),
    Quantity(
        "constraint_error",
        ("time",),
        "m",
        "largest position gap of the joints",
        required=False,
        judgement=_JOINT_GAP,
        plot=Plot("Largest gap in a joint", "gap (m)", logarithmic=True),
    ),
    *LOADS,
    Quantity(
        DEFECT,
        ("time",),
        "rad",
        (
            "size of the defect of the interval up to each sample, the largest over angles and "
            "rates; NaN in the first"
        ),
        required=False,
    ),
    Quantity(
        "angle_uncertainty",
        ("time",),
        "rad",
        (
            "estimate of the error of the angles, before rounding to double precision (half a unit "
            "in the last place)"
        ),
        required=False,
    ),
    Quantity(
        "error_growth",
        ("time",),
        "1",
        "largest factor by which a small error of the initial state has grown",
        required=False,
    ),
)

_OUTPUTS = frozenset(quantity.output for quantity in BUILT_IN)
NAMES = frozenset(quantity.name for quantity in BUILT_IN)


# ---- Quantities of a scene: built-in ones, and those of installed packages


def known_quantities(outputs: Iterable[str] = ()) -> tuple[Quantity, ...]:
    """Return all built-in quantities, and those of `outputs` that installed packages add.

    Raises
    ------
    InputError
        If an output is neither built in nor added by an installed package.
    """
    return BUILT_IN + tuple(
        quantity for output in outputs if output not in _OUTPUTS for quantity in installed(output)
    )


def quantities(outputs: Iterable[str]) -> tuple[Quantity, ...]:
    """Return the quantities that a scene's `outputs` request.

    Quantities that are stored whenever a model computes them are included.

    Raises
    ------
    InputError
        If an output is unknown.
    """
    asked = {"", *outputs}
    return tuple(quantity for quantity in known_quantities(asked) if quantity.output in asked)


@functools.cache
def installed(output: str) -> tuple[Quantity, ...]:
    """Return the quantities of the entry point called `output`.

    Raises
    ------
    InputError
        If there is no such entry point, it cannot be loaded, or one of its quantities is not valid.
    """
    points = tuple(entry_points(group=ENTRY_POINT_GROUP, name=output))
    if not points:
        raise InputError(
            f"unknown output {output!r}; allowed: {', '.join(sorted(_OUTPUTS - {''}))}, or the "
            f"name of an entry point in the group {ENTRY_POINT_GROUP}"
        )
    where = f"output {output!r}, from {points[0].value}"
    try:
        loaded = points[0].load()
    except Exception as exc:  # the other package may raise anything
        raise InputError(f"{where}: cannot be loaded: {type(exc).__name__}: {exc}") from exc
    brought = (loaded,) if isinstance(loaded, Quantity) else loaded
    if not isinstance(brought, Sequence) or not all(
        isinstance(quantity, Quantity) for quantity in brought
    ):
        raise InputError(
            f"{where}: is a {type(loaded).__name__}; allowed: a Quantity or a sequence of them"
        )
    # The faults of all quantities are reported at once.
    problems = []
    allowed = sorted(set(SCALES) - {"time"})
    for quantity in brought:
        name, dimensions = quantity.name, quantity.dimensions
        faults = []
        if not name.isidentifier() or name in NAMES | set(SCALES):
            faults.append(f"name {name!r}; allowed: an identifier that is not taken")
        is_repeated = len(set(dimensions)) < len(dimensions)
        if dimensions[:1] != ("time",) or is_repeated or not set(dimensions[1:]) <= set(allowed):
            faults.append(
                f"dimensions {dimensions}; allowed: 'time', then any of {', '.join(allowed)}, once "
                "each"
            )
        if quantity.output != output:
            faults.append(
                f"output {quantity.output!r}; allowed: {output!r}, the entry point's name"
            )
        problems += [f"{where}: {name}: {fault}" for fault in faults]
    if problems:
        raise InputError(problems)
    return tuple(brought)


# ---- Arrays of a run


def array_of(quantity: Quantity, scene: Scene, samples: Trajectory) -> Array | None:
    """Return the array of a quantity of a run; None if the run does not have it.

    The array is the model's, or else computed from the samples by the quantity's producer.

    Parameters
    ----------
    quantity, scene : the declaration of the quantity, and the scene of the run.
    samples : n samples of the run.

    Returns
    -------
    ndarray or None
        (n, ...) with the shape of `row_shape`, in the unit of the quantity.

    Raises
    ------
    InputError
        If a producer returns an array of another shape.
    """
    values = samples.get(quantity.name)
    if values is not None or quantity.producer is None:
        return values
    values = quantity.producer(scene, samples)
    if values is None:
        return None
    values = np.asarray(values, dtype=np.float64)
    expected = (len(samples.time), *row_shape(quantity, scene))
    if values.shape != expected:
        raise InputError(
            f"quantity {quantity.name!r}: its producer gives shape {values.shape}; allowed: "
            f"{expected}"
        )
    return values


def arrays(scene: Scene, samples: Trajectory) -> dict[str, Array]:
    """Return the arrays of a run that its scene requests, by name of the quantity.

    Quantities that the run does not have are left out.
    """
    by_name = {
        quantity.name: array_of(quantity, scene, samples) for quantity in quantities(scene.outputs)
    }
    return {name: values for name, values in by_name.items() if values is not None}


def sizes(quantity: Quantity, values: Array) -> Array:
    """Return the magnitudes of the values of a quantity, or the lengths of its vectors.

    Parameters
    ----------
    quantity : the declaration; its values are vectors if the last dimension is `axis`.
    values : (n, ...) array in the unit of the quantity.
    """
    lengths: Array = (
        np.linalg.norm(values, axis=-1) if quantity.dimensions[-1] == "axis" else np.abs(values)
    )
    return lengths


def deviation(
    quantity: Quantity, scene: Scene, run: Trajectory, reference: Trajectory | None
) -> Array | None:
    """Return the magnitude at each sample of a quantity, or of its difference from the reference.

    The largest magnitude over the axes other than time is returned, (common samples,). None is
    returned if the quantity is not judged, if the run does not have it, or if the reference is
    needed and does not have it.

    Parameters
    ----------
    quantity, scene : the declaration of the quantity, and the scene of the run.
    run, reference : samples. The reference is used if `QuantityMetric.with_reference` is true.
    """
    rule = quantity.judgement
    if rule is None:
        return None
    values = array_of(quantity, scene, run)
    if values is None:
        return None
    if rule.with_reference:
        exact = None if reference is None else array_of(quantity, scene, reference)
        if exact is None:
            return None
        n = min(len(values), len(exact))
        values = values[:n] - exact[:n]
    lengths = sizes(quantity, values)
    return np.asarray(lengths.max(axis=tuple(range(1, lengths.ndim))))
