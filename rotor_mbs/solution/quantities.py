"""Output quantities of a run, each declared once.

A declaration has dimensions, units, who computes the quantity, and how it is judged and plotted.
Further ones come from packages that have an entry point in the group `rotor_mbs.quantities`.
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

    It is stored with the run. The metric is the largest magnitude over all samples (of the vectors,
    if the last dimension is `axis`).

    Attributes
    ----------
    metric : name of the metric.
    with_reference : whether it is that of the difference from the reference's array, up to the
        horizon.
    relative_to : (scene) -> number by which the metric is divided for the check; None for 1.
    at_own_state : whether it is that of the difference from the array of the closed form at the
        run's own state, over all samples.
    scale_of : (scene, samples) -> number by which the metric is divided before it is stored; None
        for 1.
    check : name of a check in reference/accuracy.toml that has the bound; "" if `bound` is used.
    bound : largest value that passes, unless a check has one; None if the metric is not checked.
    channel, unit : name and unit of the value in verdicts.
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
    title, axis : title, and label of the vertical axis.
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
    name : name of the dataset, and of the attribute of a `Run`.
    dimensions : names of the axes: "time", then any of "coordinate", "blade" and "axis".
    units, long_name : as stored.
    output : entry of a scene's `outputs` that requests it; "" if it is stored whenever the model
        computes it.
    producer : (scene, samples) -> array, a formula for all methods; returns None if it lacks input.
        None if each model computes the quantity from its own state.
    required : whether every run of a built-in method must have it where its scene requests it.
    judgement : how it is checked; None if it is not, or by a rule of its own.
    plot : how it is plotted; None if it has no plot of its own.
    has_peak : whether its largest magnitude and the time of that are metrics of a run.

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

# The arrays that number them.
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
    """Return the scales of a complete run by name.

    They are the time in s, and the numbers of coordinates, blades and axes.
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


@np.errstate(over="ignore", invalid="ignore")  # of a runaway: the judgement sees what is not finite
def energy_balance(kinetic: Array, potential: Array, work: Array) -> Array:
    """Return total energy minus work, minus its value at the start: (..., n) J.

    Parameters
    ----------
    kinetic, potential, work : (..., n) J, of one run or of many.
    """
    total = kinetic + potential - work
    error: Array = total - total[..., :1]  # of a run without a sample, too
    return error


def energy_error(samples: Trajectory) -> Array | None:
    """Return the energy balance of a run, (n,) J; None where energies were not requested."""
    kinetic, potential, work = (
        samples.get(name) for name in ("kinetic_energy", "potential_energy", "work")
    )
    if kinetic is None or potential is None or work is None:
        return None
    return energy_balance(kinetic, potential, work)


def longest_arm(scene: Scene) -> float:
    """Return the largest distance (m) of a blade's centre of mass from the hub's centre.

    It is 1 where all of them are there.
    """
    return max(math.hypot(*blade.centre_of_mass) for blade in scene.blades) or 1.0


def _largest_root_force(_scene: Scene, run: Trajectory) -> float:
    """Return the largest root force (N) over the blades and the samples; 1 where there is none."""
    forces = run.get("blade_root_force")
    return 1.0 if forces is None else float(np.linalg.norm(forces, axis=-1).max(initial=0.0)) or 1.0


def _largest_root_force_at_arm(scene: Scene, run: Trajectory) -> float:
    """Return the largest root force times the longest arm (N m).

    It is a scale for moments, which may all be nearly zero.
    """
    return _largest_root_force(scene, run) * longest_arm(scene)


def _load(
    name: str, dimensions: tuple[str, ...], long_name: str, title: str, look_at: str
) -> Quantity:
    """Return the declaration of a load, which is compared with the closed form at the run's state.

    Parameters
    ----------
    name, dimensions, long_name : of the quantity; a name that ends with "force" has the unit N.
    title : of its plot.
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


# The root of a blade is on its pitch axis, at the hub's radius from the apex. Where a torque jumps,
# the value is the one before it.
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
    """Return the arrays of `LOADS` by name.

    Parameters
    ----------
    roots : for each blade the (n, 3) force (N) and moment (N m) at its root in its frame.
    shaft_force, shaft_moment : (n, 3) N and N m, in the base frame.
    actuators : (n, blades) N m.
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
    bound=0.0,  # of a model without joints that can open
    channel="joints",
    unit="of arm",
    fault="joint gap of {value} of the largest distance of a centre of mass from the hub centre",
    look_at="a joint of the chain that is not constrained, or its marker",
)

# Computed by the judgement of a run, not by its model.
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
    """Return the built-in quantities, and those that installed packages add for `outputs`.

    Raises
    ------
    InputError
        If an output is neither.
    """
    return BUILT_IN + tuple(
        quantity for output in outputs if output not in _OUTPUTS for quantity in installed(output)
    )


def quantities(outputs: Iterable[str]) -> tuple[Quantity, ...]:
    """Return the quantities that a scene's `outputs` request.

    Those that are stored whenever a model has them are included.

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
    except Exception as exc:  # whatever the other package raises
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
    """Return a quantity of a run; None where there is none.

    It is the model's own array, or what the quantity's producer computes from the samples.

    Parameters
    ----------
    quantity, scene : the declaration, and the scene of the run.
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
    """Return the arrays that a scene requests and a run has, by name of the quantity."""
    by_name = {
        quantity.name: array_of(quantity, scene, samples) for quantity in quantities(scene.outputs)
    }
    return {name: values for name, values in by_name.items() if values is not None}


def sizes(quantity: Quantity, values: Array) -> Array:
    """Return the magnitudes of an array of a quantity.

    Parameters
    ----------
    quantity : if its last dimension is `axis`, lengths of vectors are returned.
    values : (n, ...) in its unit.
    """
    lengths: Array = (
        np.linalg.norm(values, axis=-1) if quantity.dimensions[-1] == "axis" else np.abs(values)
    )
    return lengths


def deviation(
    quantity: Quantity, scene: Scene, run: Trajectory, reference: Trajectory | None
) -> Array | None:
    """Return the size of a quantity, or of its difference from the reference: (common samples,).

    It is the largest over the other axes. None is returned where the quantity is not judged, or the
    run or the reference that is needed does not have it.

    Parameters
    ----------
    quantity, scene : the declaration, and the scene of the run.
    run, reference : samples; the reference is used if the rule of the quantity says so.
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
