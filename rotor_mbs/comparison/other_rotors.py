"""Define candidates for the cause of a difference: other scenes, equations and parameters."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.comparison.coarse_methods import Step, coarse_methods
from rotor_mbs.comparison.data_defects import SAME_START
from rotor_mbs.comparison.hypotheses import Hypothesis
from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.closed_form import Accelerations
from rotor_mbs.models.lagrange.parameters import rotor_form
from rotor_mbs.models.lagrange.reference import REDUCED_EQUATIONS, with_azimuths
from rotor_mbs.models.printed.derivation import Errata
from rotor_mbs.models.printed.methods import equations, point_mass_rotor
from rotor_mbs.scenario.catalogue import find_scenes, list_scenes
from rotor_mbs.scenario.scene import Blade, Scene, scene_fields
from rotor_mbs.scenario.time_table import LoadTable, is_constant, value_at
from rotor_mbs.solution.trajectory import Array

_GRAVITIES = (9.8, 9.80665, 9.81, 9.82, 10.0, 32.174, 0.0)  # m/s²; 32.174 is in ft/s²
# Azimuths and pitch angles at which other programs often place the zero: rad, by degrees.
_QUARTERS = {90: math.pi / 2.0, 180: math.pi, 270: -math.pi / 2.0}
# Directions of gravity in the base. Each has the same effect on the motion as a zero of the azimuth
# that is moved by the degrees of its key.
_GRAVITY_AT_QUARTER = {90: "+x", 180: "+z", 270: "-x"}
_MAX_BLADES = 6  # largest number of blades for which the blades are also tried one by one
# Fields of a scene with an entry per blade, and their keys in a scene file.
_BEARING_FIELDS = {
    "bearing_stiffness": "bearing.stiffness",
    "bearing_damping": "bearing.damping",
    "pitch_torque": "torque.pitch",
    "bearing_rest": "bearing.rest",
}
# Fields of a scene that a program may forget or multiply by a factor, and their names in words.
_FORGOTTEN = {
    "rotor_torque": "the torque of the rotor",
    "pitch_torque": "the pitch torques",
    "bearing_stiffness": "the springs",
    "bearing_rest": "the rest angles of the springs",
    "bearing_damping": "the dampers of the bearings",
    "shaft_damping": "the damper of the shaft",
    "hub_inertia": "the hub's inertia",
    "shaft_tilt": "the tilt of the shaft",
}
# A scene can have the fields of _SIGNED with the opposite sign. Those of _DISSIPATING cannot be
# negative in a scene: their sign is reversed in the equations.
_SIGNED = ("rotor_torque", "pitch_torque", "bearing_rest")
_DISSIPATING = ("bearing_stiffness", "bearing_damping", "shaft_damping")
# Fields that affect loads but not the motion, and fields that are changed by an angle, not by a
# share.
_IN_LOADS_ALONE = ("hub_radius", "hub_mass")
_LEANING_FIELDS = ("shaft_tilt", "cone")
# Wrong factors of a load, a property or a term in the equations, by their name in words.
_FACTORS = {"without": 0.0, "half of": 0.5, "twice": 2.0, "opposite sign of": -1.0}
# Mistakes in the units of torques, springs and dampers: the factor by which the number is wrong,
# and the mistake in words.
_IN_KILONEWTONS = ((1e-3, "in kN m taken as N m"), (1e3, "in N m taken as kN m"))
_PER_DEGREE = (
    (math.pi / 180.0, "per degree taken as per rad"),
    (180.0 / math.pi, "per rad taken as per degree"),
)
_UNITS = {
    "rotor_torque": ("torque of the rotor", _IN_KILONEWTONS),
    "pitch_torque": ("pitch torques", _IN_KILONEWTONS),
    "bearing_stiffness": ("stiffness of the springs", (*_IN_KILONEWTONS, *_PER_DEGREE)),
    "bearing_damping": ("damping of the bearings", (*_IN_KILONEWTONS, *_PER_DEGREE)),
    "bearing_rest": (
        "rest angles of the springs",
        (
            (math.pi / 180.0, "in rad taken as degrees"),
            (180.0 / math.pi, "in degrees taken as rad"),
        ),
    ),
}
_POUND = 0.45359237  # kg in a pound
# Prescribed loads of a scene, and their names in words.
_LOADS = {
    "rotor_torque": "torque of the rotor",
    "pitch_torque": "pitch torques",
    "bearing_rest": "rest angles of the springs",
}
_CYCLES = (2, 5, 10, 20, 50)  # numbers of rows over which a controller may hold its loads
# Numbers of rows by which loads may be late.
_DELAYS = (1, 2, 3, 4, 5, 8, 10, 15, 20, 25, 30, 40, 50, 75, 100)
# Sets of the paper's errata that are tried. E3 is tried only together with E2: if E2 is corrected,
# the term whose power E3 changes is zero.
_ERRATA = ("E1", "E2", "E1 and E2", "E2 and E3", "E1 and E2 and E3")

# The way from a scene to one of its numbers: names of fields and indices of entries.
Path = Sequence[str | int]


@dataclass(frozen=True)
class RotorModel:
    """Hold a scene, if needed with other azimuths of blades, other equations or a coarse method.

    Attributes
    ----------
    scene : the rotor.
    azimuths : (blades,) rad, azimuths of the blades; None for `Scene.phases`.
    equations : function for the accelerations; None for the closed form's.
    method : function for one step of a coarse integration method; None for an exact integration.
    steps : number of steps of `method` from row to row.
    """

    scene: Scene
    azimuths: tuple[float, ...] | None = None
    equations: Accelerations | None = None
    method: Step | None = None
    steps: int = 1

    def accelerations(self) -> Accelerations | None:
        """Return the function for the accelerations, None for that of the closed form.

        Raises
        ------
        RotorError
            If the equations do not hold for the scene.
        """
        return with_azimuths(self.scene, self.azimuths) if self.azimuths else self.equations


@dataclass(frozen=True)
class Parameter:
    """Hold a number of the scene that may be wrong, and a function that changes it.

    Attributes
    ----------
    key : key of the number in a scene file, or its name in words.
    unit : unit of a change; "" if a change is a share of the number.
    apply : called as apply(model, change), returns the changed model.
    """

    key: str
    unit: str
    apply: Callable[[RotorModel, float], RotorModel]


def rotor_hypotheses(scene: Scene) -> Iterator[Hypothesis[RotorModel]]:
    """Yield hypotheses with common mistakes in a scene or in its equations of motion.

    Parameters
    ----------
    scene : the rotor as it is.
    """
    for text, other in other_scenes(scene):
        if other != scene:
            yield Hypothesis(text, RotorModel(other))
    for sense, sign in (("-", 1.0), ("+", -1.0)):
        # Another direction of gravity is expressed by a tilt of the shaft, because the motion
        # depends only on the direction of gravity relative to the shaft. A tilt also turns tips and
        # loads. `other_scenes`, which are used for tips and loads, too, therefore do not include
        # these tilted scenes.
        tilted = replace(scene, shaft_tilt=scene.shaft_tilt + sign * math.pi / 2.0)
        yield Hypothesis(f"gravity along {sense}y of the base", RotorModel(tilted))
    for text, azimuths in other_azimuths(scene):
        yield Hypothesis(text, RotorModel(scene, azimuths))
    for terms, reduced in _reduced_equations(scene):
        for text, factor in _FACTORS.items():
            scaled = _with_factor(factor, reduced) if factor else reduced
            yield Hypothesis(f"{text} {terms}", RotorModel(scene, equations=scaled))
    for field in _DISSIPATING:
        without = _equations_of(_scaled_at(scene, [(field,)], -1.0))
        text = f"opposite sign of {_FORGOTTEN[field]}"
        yield Hypothesis(text, RotorModel(scene, equations=_with_factor(-1.0, without)))
    text = "weight of the blades on the pitch axes in the rotor's equation alone"
    on_axes = replace(scene, blades=tuple(_with_weight_on_axis(blade) for blade in scene.blades))
    reduced = _with_moments_of(on_axes, rotor=1.0)
    yield Hypothesis(text, RotorModel(scene, equations=reduced))
    for text, other_equations in _OTHER_EQUATIONS.items():
        yield Hypothesis(text, RotorModel(scene, equations=other_equations))
    text = "dampers of the bearings that see the rotor's rate, too"
    yield Hypothesis(text, _damped_by_rotor(RotorModel(scene), 1.0))
    text = "small-angle approximation: sin x = x, cos x = 1"
    yield Hypothesis(text, RotorModel(scene, equations=_small_angles))
    for names in _ERRATA:
        errata = Errata(*(name in names for name in ("E1", "E2", "E3")))
        printed = functools.partial(_printed, scene, errata)
        text = f"erratum {names} of the paper's equations"
        yield Hypothesis(text, RotorModel(scene, equations=printed))


def scenes_with_start(scene: Scene, first: Array) -> Iterator[Hypothesis[RotorModel]]:
    """Yield the other scenes of the catalogue that have a given initial state.

    Parameters
    ----------
    scene : the scene that is not yielded.
    first : (2 (1 + blades),) initial state: angles, rad, then rates, rad/s, rotor first.
    """
    for other in _catalogue():
        start = np.array([*other.initial_angles, *other.initial_rates])
        if other.name == scene.name or len(start) != len(first):
            continue
        if np.abs(start - first).max() < SAME_START:
            yield Hypothesis(f"the scene {other.name}", RotorModel(other))


@functools.cache
def _catalogue() -> tuple[Scene, ...]:
    """Return all shipped scenes."""
    folders = {name.partition("/")[0] for name, _ in list_scenes()}
    return tuple(find_scenes(sorted(folders)))


# Other equations


def _small_angles(angles: Any, rates: Any, form: Any, loads: Any, *_: Any) -> list[Any]:
    """Return the closed form's accelerations with sin x = x and cos x = 1."""
    return closed_form.accelerations(
        angles, rates, form, loads, lambda x: x, lambda x: 1.0 + 0.0 * x
    )


def _with_factor(factor: float, reduced: Accelerations) -> Accelerations:
    """Return the closed form's equations with some of their terms times a factor.

    Parameters
    ----------
    factor : factor of the terms.
    reduced : the equations without these terms.
    """

    def equations(*arguments: Any) -> list[Any]:
        whole, without = closed_form.accelerations(*arguments), reduced(*arguments)
        # The accelerations are linear in the factor. With 1 they are those of the whole equations,
        # with 0 those of the reduced equations.
        return [factor * a + (1.0 - factor) * b for a, b in zip(whole, without, strict=True)]

    return equations


def _with_moments(moments: Callable[..., tuple[Any, Sequence[Any]]]) -> Accelerations:
    """Return the closed form's equations with additional moments.

    Parameters
    ----------
    moments : called as moments(angles, rates, form, loads), returns the additional moments, N m, on
        the rotor and on each pitch that moves.
    """

    def equations(angles: Any, rates: Any, form: Any, loads: Any, *functions: Any) -> list[Any]:
        rotor, on_pitches = moments(angles, rates, form, loads)
        torques = loads.pitches or [0.0] * len(form.blades)
        pitches = [torque + more for torque, more in zip(torques, on_pitches, strict=True)]
        changed = replace(loads, rotor=loads.rotor + rotor, pitches=pitches)
        return closed_form.accelerations(angles, rates, form, changed, *functions)

    return equations


def _with_reactions(torques: float, springs: float, dampers: float) -> Accelerations:
    """Return the closed form's equations with reactions of pitch moments on the rotor.

    The reactions are those that would act if the pitch axes were along the shaft.

    Parameters
    ----------
    torques, springs, dampers : 1 if moments of this kind have such a reaction, 0 if not.
    """

    def moments(angles: Any, rates: Any, form: Any, loads: Any) -> Any:
        total: Any = 0.0
        for blade, theta, rate, torque, rest in closed_form.pitches(form, angles, rates, loads):
            total = total + torques * torque - dampers * blade.damping * rate
            total = total + springs * blade.stiffness * (rest - theta)
        return -total, [0.0] * len(form.blades)

    return _with_moments(moments)


def _quadratic_dampers(_angles: Any, rates: Any, form: Any, _loads: Any) -> Any:
    """Return the additional moments, N m, for bearing dampers quadratic in the rate in rad/s."""
    pairs = zip(form.blades, rates[1:], strict=True)
    return 0.0, [blade.damping * rate * (1.0 - np.abs(rate)) for blade, rate in pairs]


def _quadratic_shaft_damper(_angles: Any, rates: Any, form: Any, _loads: Any) -> Any:
    """Return the additional moment, N m, for a shaft damper quadratic in the rate in rad/s."""
    moment = form.shaft_damping * rates[0] * (1.0 - np.abs(rates[0]))
    return moment, [0.0] * len(form.blades)


def _sine_springs(angles: Any, rates: Any, form: Any, loads: Any) -> Any:
    """Return the additional moments, N m, for springs that act by the sine of the deflection."""
    moments = []
    for blade, theta, _, _, rest in closed_form.pitches(form, angles, rates, loads):
        deflection = theta - rest
        moments.append(blade.stiffness * (deflection - np.sin(deflection)))
    return 0.0, moments


def _reduced_equations(scene: Scene) -> Iterator[tuple[str, Accelerations]]:
    """Yield terms of the equations of motion in words, each with the equations without it.

    Parameters
    ----------
    scene : the rotor.
    """
    for terms, reduced in REDUCED_EQUATIONS.items():
        yield f"the {terms}", reduced
    weightless = replace(scene, gravity=0.0)
    yield (
        "gravity in the equations of the pitches",
        _with_moments_of(weightless, pitches=1.0),
    )
    yield "gravity in the rotor's equation", _with_moments_of(weightless, rotor=1.0)
    terms = "the gyroscopic moments ω x J ω"
    own = [blade.inertia_tensor for blade in scene.blades]
    yield f"{terms} about the blades' centres of mass", _without_gyroscopic_moments(scene, own)
    whole = [
        _with_inertia(blade, blade.inertia + _steiner(blade)).inertia_tensor
        for blade in scene.blades
    ]
    yield f"{terms} of the blades", _without_gyroscopic_moments(scene, whole)


def _equations_of(scene: Scene) -> Accelerations:
    """Return the closed form's equations of a scene; they ignore the form in their arguments."""
    own = rotor_form(scene)
    return lambda angles, rates, _form, *rest: closed_form.accelerations(angles, rates, own, *rest)


def _with_moments_of(other: Scene, *, rotor: float = 0.0, pitches: float = 0.0) -> Accelerations:
    """Return the closed form's equations with the moments of another scene in some of them.

    Parameters
    ----------
    other : a scene with the same mass matrix and other moments.
    rotor, pitches : 1 if the rotor's equation, or the equations of the pitches, have the moments of
        `other`; 0 if not.
    """
    others = _equations_of(other)

    def equations(angles: Any, rates: Any, form: Any, *rest: Any) -> list[Any]:
        own = closed_form.accelerations(angles, rates, form, *rest)
        difference = np.array(others(angles, rates, form, *rest)) - own
        matrix = _MassMatrix(angles, form)
        on_rotor, *on_pitches = matrix.times(list(difference))
        moments = [rotor * on_rotor, *(pitches * moment for moment in on_pitches)]
        return list(own + np.array(matrix.solve(moments)))

    return equations


class _MassMatrix:
    """Hold the mass matrix at given angles; the first row is the rotor's, the others the pitches'.

    Parameters
    ----------
    angles : rad, rotor first.
    form : the coefficients of the equations.
    """

    def __init__(self, angles: Any, form: Any) -> None:
        self.inertia, self.couplings = form.inertia, list[Any]()
        self._pitches = [blade.pitch_inertia for blade in form.blades]
        for blade, theta in zip(form.blades, angles[1:], strict=True):
            s, c = np.sin(theta), np.cos(theta)
            inertia = blade.inertia_ss * s * s + blade.inertia_cc * c * c + blade.inertia_sc * s * c
            coupling = blade.coupling_s * s + blade.coupling_c * c
            if blade.lean:
                inertia = inertia + blade.lean.inertia_s * s + blade.lean.inertia_c * c
                coupling = coupling + blade.lean.coupling
            self.inertia = self.inertia + inertia
            self.couplings.append(coupling)

    def times(self, accelerations: Sequence[Any]) -> list[Any]:
        """Return the moments, N m, that are the product of the matrix and accelerations, rad/s²."""
        rotor, *pitches = accelerations
        moments = [self.inertia * rotor]
        for inertia, coupling, pitch in zip(self._pitches, self.couplings, pitches, strict=True):
            moments[0] = moments[0] + coupling * pitch
            moments.append(coupling * rotor + inertia * pitch)
        return moments

    def solve(self, moments: Sequence[Any]) -> list[Any]:
        """Return the accelerations, rad/s², that moments, N m, cause."""
        reduced, (moment, *others) = self.inertia, moments
        for inertia, coupling, other in zip(self._pitches, self.couplings, others, strict=True):
            reduced = reduced - coupling * coupling / inertia
            moment = moment - coupling * other / inertia
        rotor = moment / reduced
        accelerations = [rotor]
        for inertia, coupling, other in zip(self._pitches, self.couplings, others, strict=True):
            accelerations.append((other - coupling * rotor) / inertia)
        return accelerations


def _with_coupling(factor: float) -> Accelerations:
    """Return the closed form's equations with another coupling in the mass matrix.

    Parameters
    ----------
    factor : factor of the entries of the mass matrix that couple rotor and pitches.
    """

    def equations(angles: Any, rates: Any, form: Any, *rest: Any) -> list[Any]:
        matrix = _MassMatrix(angles, form)
        # The right mass matrix times the right accelerations gives the moments of all other terms,
        # which stay as they are.
        moments = matrix.times(closed_form.accelerations(angles, rates, form, *rest))
        matrix.couplings = [factor * coupling for coupling in matrix.couplings]
        return matrix.solve(moments)

    return equations


def _without_gyroscopic_moments(scene: Scene, tensors: Sequence[Array]) -> Accelerations:
    """Return the closed form's equations without the moments ω x J ω of the blades.

    Parameters
    ----------
    scene : the rotor.
    tensors : (3, 3) kg m², J of each blade.
    """
    moving = [pitch - 1 for pitch in scene.moving_coordinates[1:]]

    def moments(angles: Any, rates: Any, _form: Any, _loads: Any) -> Any:
        on_rotor: Any = 0.0
        on_pitches = []
        for i, theta, rate in zip(moving, angles[1:], rates[1:], strict=True):
            cone = scene.blades[i].cone
            # Unit vector along the shaft, in the axes of the blade.
            shaft = np.array(
                [
                    math.cos(cone) * np.sin(theta),
                    math.cos(cone) * np.cos(theta),
                    math.sin(cone) + 0.0 * theta,
                ]
            )
            omega = rates[0] * shaft
            omega[2] = omega[2] + rate
            momentum = np.tensordot(tensors[i], omega, axes=1)
            moment = np.cross(omega, momentum, axis=0)
            on_rotor = on_rotor + (shaft * moment).sum(axis=0)
            on_pitches.append(moment[2])
        return on_rotor, on_pitches

    return _with_moments(moments)


# Equations with one mistake that is easily made in a derivation by Lagrange's equations or by those
# of Newton and Euler.
_OTHER_EQUATIONS = {
    "pitch torques with reactions on the rotor": _with_reactions(1.0, 0.0, 0.0),
    "moments of the pitch bearings with reactions on the rotor": _with_reactions(1.0, 1.0, 1.0),
    "dampers of the bearings with reactions on the rotor": _with_reactions(0.0, 0.0, 1.0),
    "dampers of the bearings quadratic in the rate": _with_moments(_quadratic_dampers),
    "damper of the shaft quadratic in the rate": _with_moments(_quadratic_shaft_damper),
    "springs by the sine of the deflection": _with_moments(_sine_springs),
    "without the coupling of rotor and pitches in the mass matrix": _with_coupling(0.0),
    "opposite sign of the coupling of rotor and pitches in the mass matrix": _with_coupling(-1.0),
}


def _printed(
    scene: Scene, errata: Errata, angles: Any, rates: Any, _form: Any, loads: Any, *_: Any
) -> list[Any]:
    """Return the accelerations by the paper's printed equations, for (n,) arrays.

    Parameters
    ----------
    scene : the rotor.
    errata : the errors of the print that are not corrected.
    angles, rates, _form, loads : see `closed_form.accelerations`; each angle, rate and load is an
        array, (n,), or a number.

    Raises
    ------
    MethodRefusal
        If the printed equations do not hold for the scene.
    """
    accelerations = equations(point_mass_rotor("printed", errata, scene), errata)
    torques = [loads.rotor, *(loads.pitches or (0.0,) * (len(angles) - 1))]
    rows = np.broadcast_arrays(*torques, *angles, *rates)
    count = len(torques)
    by_instant = np.stack(rows).reshape(len(rows), -1).T.tolist()
    values = [accelerations(row[:count], row[count:]) for row in by_instant]
    return list(np.array(values).T)


# Other scenes


def other_scenes(scene: Scene) -> Iterator[tuple[str, Scene]]:
    """Yield common mistakes in words, each with the scene that has this mistake.

    Parameters
    ----------
    scene : the rotor as it is. Some of the yielded scenes may be equal to it.
    """
    for gravity in _GRAVITIES:
        yield f"gravity of {gravity:g} m/s^2", replace(scene, gravity=gravity)
    yield from _other_blades(scene)
    yield "tilt of the shaft with opposite sign", replace(scene, shaft_tilt=-scene.shaft_tilt)
    if scene.shaft_tilt and any(blade.cone for blade in scene.blades):
        upright = tuple(replace(blade, cone=0.0) for blade in scene.blades)
        text = "without the tilt of the shaft and the cone of the blades"
        yield text, replace(scene, shaft_tilt=0.0, blades=upright)
    yield from _exchanged_bearings(scene)
    for (field, text), (amount, factor) in itertools.product(_FORGOTTEN.items(), _FACTORS.items()):
        if factor >= 0.0 or field in _SIGNED:
            yield f"{amount} {text}", _scaled_at(scene, [(field,)], factor - 1.0)
    for field, (name, units) in _UNITS.items():
        for factor, text in units:
            yield f"{name} {text}", _scaled_at(scene, [(field,)], factor - 1.0)
    if any(scene.bearing_rest) and any(scene.bearing_damping):
        text = "dampers of the bearings that act on the rate less that of the rest angle"
        yield text, _with_damped_error(scene)
    if any(scene.bearing_stiffness[1:]):
        springs = (scene.bearing_stiffness[0], *(0.0 for _ in scene.bearing_stiffness[1:]))
        yield "a spring at blade 1 alone", replace(scene, bearing_stiffness=springs)
    count = len(scene.blades)
    if count > 2:  # with two blades this is twice the hub's inertia, which is yielded above
        hubs = replace(scene, hub_inertia=count * scene.hub_inertia)
        yield "the hub's inertia once for each blade", hubs
    if not scene.has_constant_loads:
        # A program that reads the loads once per segment holds all loads from a kink of any load to
        # the next kink of any load.
        times = [0.0, *scene.kink_times, scene.duration]
        yield "ramps of loads held at their value at the start", with_held_loads(scene, times)
    for degrees, angle in _QUARTERS.items():
        turned = _pitch_turned(scene, range(len(scene.blades)), angle)
        yield f"pitch angles from another zero: {degrees} degrees where they are 0", turned


def by_rows(
    scene: Scene, times: Array, intervals: NDArray[np.int64]
) -> Iterator[Hypothesis[RotorModel]]:
    """Yield hypotheses that depend on the rows: coarse methods, and loads that are held or late.

    Parameters
    ----------
    scene : the rotor as it is.
    times : (n,) s, times of all rows.
    intervals : (k,) numbers of the intervals on which hypotheses are tried. The held loads are
        right in these intervals only; in others they may be held for too long.
    """
    step = float(times[-1] - times[0]) / (len(times) - 1)
    for text, method, steps in coarse_methods(step):
        yield Hypothesis(text, RotorModel(scene, method=method, steps=steps))
    if scene.has_constant_loads:
        return
    # `other_scenes` have a scene in which all loads are held from a kink of any load to the next.
    # If all changing loads have rows at the same times, it is the scene of the first hypothesis
    # here, in which all changing loads are held: this hypothesis is then skipped.
    changing = [table for table in scene.load_tables if not is_constant(table)]
    row_times = {tuple(time for time, _ in table) for table in changing}
    is_yielded_there = len(row_times) == 1
    held = _with_tables(scene, _held_from_row_to_row)
    how = "held from row to row of their tables"
    yield from itertools.islice(_with_loads_of(scene, held, how), int(is_yielded_there), None)
    for rows in (1, *_CYCLES):
        if 2 * rows < len(times):
            first = intervals // rows * rows
            ends = np.minimum(first + rows, len(times) - 1)
            held = with_held_loads(scene, times[np.union1d(first, ends)].tolist())
            how = f"held over a cycle of {rows} rows, {rows * step:.6g} s"
            if rows == 1:
                how = "held from each row to the next"
            yield from _with_loads_of(scene, held, how)
    for rows in _DELAYS:
        if rows * step < scene.duration:
            late = _with_late_loads(scene, rows * step)
            yield from _with_loads_of(scene, late, f"late by {rows * step:.6g} s")


def _with_loads_of(scene: Scene, other: Scene, how: str) -> Iterator[Hypothesis[RotorModel]]:
    """Yield a scene with all changed loads of another scene, then with each kind of them alone.

    Parameters
    ----------
    scene : the rotor as it is.
    other : the same rotor with changed loads.
    how : how the loads are changed, in words.
    """
    changed = {}
    for field in _LOADS:
        tables = getattr(scene, field)
        if field == "rotor_torque":
            tables = (tables,)
        if not all(is_constant(table) for table in tables):
            changed[field] = getattr(other, field)
    if len(changed) > 1:
        yield Hypothesis(f"loads {how}", RotorModel(replace(scene, **changed)))
    for field, value in changed.items():
        # If only one kind of load changes over time, the name "loads" says enough.
        name = _LOADS[field] if len(changed) > 1 else "loads"
        yield Hypothesis(f"{name} {how}", RotorModel(replace(scene, **{field: value})))


def _with_late_loads(scene: Scene, delay: float) -> Scene:
    """Return a scene whose loads come later by a delay in s."""

    def late(table: LoadTable) -> LoadTable:
        return tuple((time + delay, value) for time, value in table)

    return _with_tables(scene, late)


def with_held_loads(scene: Scene, times: Sequence[float]) -> Scene:
    """Return a scene whose loads are constant from each of the given times, s, to the next."""
    return _with_tables(scene, functools.partial(_held, times))


def _with_tables(scene: Scene, change: Callable[[LoadTable], LoadTable]) -> Scene:
    """Return a scene in which the table of each load is replaced by `change(table)`."""
    return replace(
        scene,
        rotor_torque=change(scene.rotor_torque),
        pitch_torque=tuple(change(table) for table in scene.pitch_torque),
        bearing_rest=tuple(change(table) for table in scene.bearing_rest),
    )


def _with_damped_error(scene: Scene) -> Scene:
    """Return a scene whose bearing dampers act on the pitch rate minus the rest angle's rate.

    Parameters
    ----------
    scene : the rotor, whose rest angles may change over time. The moment of a damper due to the
        rate of the rest angle is added to the pitch torque.
    """
    count = len(scene.blades)
    torques = scene.pitch_torque or ((),) * count
    rests = scene.bearing_rest or ((),) * count
    damped = []
    for torque, rest, damping in zip(torques, rests, scene.bearing_damping, strict=True):
        rows = {time for table in (torque, rest) for time, _ in table}
        times = sorted({0.0, *rows, scene.duration})
        table: list[tuple[float, float]] = []
        for start, end in itertools.pairwise(times):
            middle = 0.5 * (start + end)
            moment = damping * 2.0 * (value_at(rest, middle) - value_at(rest, start))
            moment /= end - start
            first = value_at(torque, start)
            last = 2.0 * value_at(torque, middle) - first  # the value before a jump at the end
            table += [(start, first + moment), (end, last + moment)]
        damped.append(tuple(table))
    return replace(scene, pitch_torque=tuple(damped))


def _held(times: Sequence[float], table: LoadTable) -> LoadTable:
    """Return a load that keeps the value that it has at each of the times, s, until the next."""
    held: list[tuple[float, float]] = []
    for start, end in itertools.pairwise(times):
        value = value_at(table, start)
        held += [(start, value), (end, value)]
    return tuple(held) if table else ()


def _held_from_row_to_row(table: LoadTable) -> LoadTable:
    """Return a load that keeps the value of each row of its table until the next row."""
    held = list(table[:1])
    for (_, before), (time, value) in itertools.pairwise(table):
        held += [(time, before), (time, value)]
    return tuple(held)


def _single_blades(scene: Scene) -> range:
    """Return the numbers of the blades that are tried one by one; none if there are too many."""
    return range(len(scene.blades) if len(scene.blades) <= _MAX_BLADES else 0)


def _other_blades(scene: Scene) -> Iterator[tuple[str, Scene]]:
    """Yield mistakes in the properties of blades, in words, each with the scene that has it.

    Parameters
    ----------
    scene : the rotor as it is.
    """
    blades = scene.blades
    radius = scene.hub_radius
    cones = "cone of the blades"
    others: dict[str, list[Blade]] = {
        f"{cones} with opposite sign": [replace(blade, cone=-blade.cone) for blade in blades],
        f"without the {cones}": [replace(blade, cone=0.0) for blade in blades],
        "masses of the blades in lb taken as kg": [
            replace(blade, mass=blade.mass / _POUND) for blade in blades
        ],
        "weight of the blades on the pitch axes": [_with_weight_on_axis(blade) for blade in blades],
        "inertia moved by the distance from the root, hub.radius less": [
            _with_inertia(blade, np.add(blade.inertia, _steiner(blade, -radius) - _steiner(blade)))
            for blade in blades
        ],
    }
    centres: Mapping[str, Callable[[float, float, float], tuple[float, float, float]]] = {
        "blade mass on the pitch axis": lambda _x, _y, z: (0.0, 0.0, z),
        "centre of mass at half its distance from the apex": lambda x, y, z: (x, y, 0.5 * z),
        "x and y of the centres of mass exchanged": lambda x, y, z: (y, x, z),
        "hub.radius added to the distance of the centre of mass": lambda x, y, z: (
            (x, y, z + radius)
        ),
    }
    for text, moved in centres.items():
        others[text] = [
            replace(blade, centre_of_mass=moved(*blade.centre_of_mass)) for blade in blades
        ]
    for text, inertia in _INERTIAS.items():
        others[text] = [
            _with_inertia(blade, inertia(np.array(blade.inertia), _steiner(blade)))
            for blade in blades
        ]
    for text, changed in others.items():
        yield text, replace(scene, blades=tuple(changed))
    for i in _single_blades(scene):
        yield (
            f"numbers of blade {i + 1} at all blades",
            replace(scene, blades=(blades[i],) * len(blades)),
        )
        for j in _single_blades(scene) if len(blades) > 2 else ():
            copied = (*blades[:j], blades[i], *blades[j + 1 :])
            yield f"numbers of blade {i + 1} at blade {j + 1}, too", replace(scene, blades=copied)
    for i in _single_blades(scene):
        for j in range(i):
            text = f"numbers of blades {i + 1} and {j + 1} exchanged"
            yield text, replace(scene, blades=_exchanged(blades, i, j))
    groups = [list(range(len(blades)))]
    if len(blades) > 1:
        groups += [[i] for i in _single_blades(scene)]
    for group, axis in itertools.product(groups, (0, 1)):
        number = f"[{group[0]}]" if len(group) < len(blades) else ""
        paths = [("blades", blade, "centre_of_mass", axis) for blade in group]
        text = f"blade{number}.centre_of_mass[{axis}] with opposite sign"
        yield text, _scaled_at(scene, paths, -2.0)


def _exchanged(values: tuple[Any, ...], i: int, j: int) -> tuple[Any, ...]:
    """Return values with entries i and j exchanged."""
    exchanged = list(values)
    exchanged[i], exchanged[j] = values[j], values[i]
    return tuple(exchanged)


def _exchanged_bearings(scene: Scene) -> Iterator[tuple[str, Scene]]:
    """Yield mistakes in words, each with a scene in which blades have bearings of other blades.

    The scenes differ in springs, dampers, pitch torques or rest angles.

    Parameters
    ----------
    scene : the rotor as it is.
    """
    count, change = len(scene.blades), dict[str, Any]()
    first = dict[str, Any]()
    for field, key in _BEARING_FIELDS.items():
        values = getattr(scene, field)
        if len(values) != len(scene.blades):
            continue
        first[field] = (values[0],) * count
        yield f"{key} of blade 1 at all blades", replace(scene, **{field: first[field]})
        # With two blades this is an exchange, which is yielded below.
        for step, which in ((1, "next"), (-1, "previous")) if count > 2 else ():
            change = {field: (*values[step:], *values[:step])}
            yield f"{key} of the {which} blade at each blade", replace(scene, **change)
        for i, j in itertools.combinations(_single_blades(scene), 2):
            change = {field: _exchanged(values, i, j)}
            yield f"{key} of blades {i + 1} and {j + 1} exchanged", replace(scene, **change)
    first.pop("pitch_torque", None)
    first.pop("bearing_rest", None)
    if len(first) == 2:
        yield "stiffness and damping of bearing 1 at all blades", replace(scene, **first)


# Mistakes in the inertia of a blade. Each function returns the wrong elements xx yy zz xy xz yz
# about the centre of mass. Its arguments are the right elements, and Steiner's share: what must be
# added to them for the inertia about the apex.
_PRODUCTS = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
_INERTIAS: Mapping[str, Callable[[Array, Array], Array]] = {
    "products of inertia about the centre of mass ignored": lambda own, _: own * (1.0 - _PRODUCTS),
    "blades without inertia, as point masses": lambda own, _: 0.0 * own,
    "products of inertia with opposite sign": lambda own, _: own * (1.0 - 2.0 * _PRODUCTS),
    # The products of inertia about the apex are own + share, because the model adds the share. They
    # get the opposite sign if twice own + share is subtracted from own.
    "products of inertia about the root with opposite sign": lambda own, share: (
        own - 2.0 * _PRODUCTS * (own + share)
    ),
    "moments of inertia about x and y exchanged": lambda own, _: own[[1, 0, 2, 3, 4, 5]],
    "inertia about the root used as inertia about the centre of mass": lambda own, share: (
        own + share
    ),
    "inertia about the centre of mass used as inertia about the root: without Steiner's share": (
        lambda own, share: own - share
    ),
}


def _steiner(blade: Blade, farther: float = 0.0) -> Array:
    """Return Steiner's share of a blade's inertia about the apex: xx yy zz xy xz yz, kg m².

    Parameters
    ----------
    blade : the blade, of which mass and centre of mass are used.
    farther : m, distance by which the centre of mass is moved away from the apex.
    """
    x, y, z = blade.centre_of_mass
    z += farther
    shares = [y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z]
    return blade.mass * np.array(shares)


def _with_inertia(blade: Blade, elements: Array) -> Blade:
    """Return a blade with other elements xx yy zz xy xz yz of its inertia, kg m²."""
    xx, yy, zz, xy, xz, yz = elements.tolist()
    return replace(blade, inertia=(xx, yy, zz, xy, xz, yz))


def _with_weight_on_axis(blade: Blade) -> Blade:
    """Return a blade with its weight on the pitch axis, and the same inertia about the apex."""
    moved = replace(blade, centre_of_mass=(0.0, 0.0, blade.centre_of_mass[2]))
    return _with_inertia(moved, np.array(blade.inertia) + _steiner(blade) - _steiner(moved))


def other_azimuths(scene: Scene) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Yield mistakes in words, each with the wrong azimuths of the blades, (blades,) rad.

    Parameters
    ----------
    scene : the rotor, whose own azimuths are its `phases`.
    """
    right, count = tuple(scene.phases), len(scene.blades)
    if count > 1:
        yield "all blades at the azimuth of blade 1", (0.0,) * count
        in_degrees = tuple(math.degrees(phase) for phase in right)
        yield "azimuths of the blades in degrees taken as rad", in_degrees
        in_radians = tuple(math.radians(phase) for phase in right)
        yield "azimuths of the blades in rad taken as degrees", in_radians
        if count != 3:
            of_three = tuple(math.radians(120.0 * i) for i in range(count))
            yield "blades at multiples of 120 degrees", of_three
    if count > 2:
        yield "blades numbered in the opposite sense", (right[0], *right[:0:-1])
    # With three blades this exchange is the opposite sense, which is yielded above.
    for i, j in itertools.combinations(range(1, count if 3 < count <= _MAX_BLADES else 0), 2):
        exchanged = _exchanged(right, i, j)
        if exchanged[1:] != right[:0:-1]:
            yield f"azimuths of blades {i + 1} and {j + 1} exchanged", exchanged
    for i in range(count if 2 < count <= _MAX_BLADES else 0):
        for other in ((i + 1) % count, (i - 1) % count):
            place = f"{360 * other / count:g} degrees in place of {360 * i / count:g}"
            azimuths = (*right[:i], right[other], *right[i + 1 :])
            yield f"blade {i + 1} at an azimuth of {place}", azimuths
    zeros = {360.0 * i / count: phase for i, phase in enumerate(right) if i}
    for degrees, angle in (zeros | _QUARTERS).items():
        place = f"blade 1 at an azimuth of {degrees:g} degrees where it is 0"
        if degrees in _GRAVITY_AT_QUARTER:
            place += f", or gravity along {_GRAVITY_AT_QUARTER[int(degrees)]} of the base"
        turned = tuple(phase + angle for phase in right)
        yield f"rotor angle from another zero: {place}", turned


# Parameters that may be wrong


def parameters(scene: Scene) -> Iterator[Parameter]:
    """Yield the parameters of a scene that may be wrong, including the zeros of its angles.

    A number that is zero is left out, because a share does not change it. The parameters of blades
    are yielded for all blades at once, and also for each blade if there are 2 to `_MAX_BLADES`.

    Parameters
    ----------
    scene : the rotor as it is.
    """
    for item in scene_fields("rotor"):
        value = getattr(scene, item.name)
        if item.name in ("blades", *_IN_LOADS_ALONE, *_LEANING_FIELDS):
            continue
        # A share changes neither a zero nor a value that is not a number.
        if _scaled(value, 1.0) != value:
            yield Parameter(item.metadata["key"], "", _share_of([(item.name,)]))
    yield Parameter("shaft.tilt", "rad", _tilt_moved)
    blades = list(range(len(scene.blades)))
    yield from _blade_parameters(scene, blades, "")
    if 1 < len(blades) <= _MAX_BLADES:
        for blade in blades:
            yield from _blade_parameters(scene, [blade], f"[{blade}]")


def _blade_parameters(scene: Scene, chosen: list[int], number: str) -> Iterator[Parameter]:
    """Yield the parameters of some blades; each parameter changes all these blades together.

    Parameters
    ----------
    scene : the rotor as it is.
    chosen : numbers of the blades, from 0.
    number : index of a single blade as it stands in a key, "[0]"; "" for all blades.
    """
    for field in fields(Blade):
        if field.name in ("tip", *_LEANING_FIELDS):  # the tip is in no equation
            continue
        value = getattr(scene.blades[chosen[0]], field.name)
        if isinstance(value, tuple):
            entries: list[tuple[int, ...]] = [(i,) for i, entry in enumerate(value) if entry]
        else:
            entries = [()] if value else []
        for entry in entries:
            paths: list[Path] = [("blades", blade, field.name, *entry) for blade in chosen]
            place = f"[{entry[0]}]" if entry else ""
            yield Parameter(f"blade{number}.{field.name}{place}", "", _share_of(paths))
    if number:
        for name, key in _BEARING_FIELDS.items():
            values = getattr(scene, name)
            if len(values) != len(scene.blades):
                continue
            value = values[chosen[0]]
            if _scaled(value, 1.0) != value:
                yield Parameter(f"{key}{number}", "", _share_of([(name, chosen[0])]))
    if any(scene.bearing_stiffness):
        rest = functools.partial(_rest_moved, chosen)
        yield Parameter(f"bearing.rest{number}", "rad", rest)
    if any(scene.bearing_damping) and not number:
        text = "share of the rotor's rate that the bearings' dampers see"
        yield Parameter(text, "of it", _damped_by_rotor)
    yield Parameter(f"blade{number}.cone", "rad", functools.partial(_cone_moved, chosen))
    which = f"blade {chosen[0] + 1}" if len(chosen) == 1 else "all blades"
    azimuth = functools.partial(_azimuth_moved, chosen)
    yield Parameter(f"azimuth of {which}", "rad", azimuth)
    zero = functools.partial(_zero_moved, chosen)
    yield Parameter(f"zero of the pitch of {which}", "rad", zero)


def _share_of(paths: Sequence[Path]) -> Callable[[RotorModel, float], RotorModel]:
    """Return a function that makes the numbers at some paths of a model larger by a share."""

    def apply(model: RotorModel, change: float) -> RotorModel:
        return replace(model, scene=_scaled_at(model.scene, paths, change))

    return apply


def _tilt_moved(model: RotorModel, change: float) -> RotorModel:
    """Return a model whose shaft's tilt is larger by a change in rad."""
    return replace(model, scene=replace(model.scene, shaft_tilt=model.scene.shaft_tilt + change))


def _cone_moved(chosen: Sequence[int], model: RotorModel, change: float) -> RotorModel:
    """Return a model in which the cone of some blades is larger by a change in rad."""
    blades = list(model.scene.blades)
    for i in chosen:
        blades[i] = replace(blades[i], cone=blades[i].cone + change)
    return replace(model, scene=replace(model.scene, blades=tuple(blades)))


def _azimuth_moved(chosen: Sequence[int], model: RotorModel, change: float) -> RotorModel:
    """Return a model with larger azimuths of some blades, by a change in rad."""
    azimuths = list(model.azimuths or model.scene.phases)
    for blade in chosen:
        azimuths[blade] += change
    return replace(model, azimuths=tuple(azimuths))


def _damped_by_rotor(model: RotorModel, change: float) -> RotorModel:
    """Return a model whose bearing dampers act on pitch rate plus a share of the rotor's rate."""

    def equations(angles: Any, rates: Any, form: Any, loads: Any, *functions: Any) -> list[Any]:
        pitches = list(loads.pitches or [0.0] * len(form.blades))
        for i, blade in enumerate(form.blades):
            pitches[i] = pitches[i] - change * blade.damping * rates[0]
        damped = replace(loads, pitches=pitches)
        return closed_form.accelerations(angles, rates, form, damped, *functions)

    return replace(model, equations=equations)


def _rest_moved(chosen: Sequence[int], model: RotorModel, change: float) -> RotorModel:
    """Return a model with larger rest angles of some blades' springs, by a change in rad."""
    scene = model.scene
    rests = list(scene.bearing_rest or (((0.0, 0.0),),) * len(scene.blades))
    for blade in chosen:
        rests[blade] = tuple((time, angle + change) for time, angle in rests[blade])
    return replace(model, scene=replace(scene, bearing_rest=tuple(rests)))


def _zero_moved(chosen: Sequence[int], model: RotorModel, change: float) -> RotorModel:
    """Return a model in which the zero of the pitch of some blades is moved by a change in rad."""
    return replace(model, scene=_pitch_turned(model.scene, chosen, change))


def _pitch_turned(scene: Scene, chosen: Sequence[int], angle: float) -> Scene:
    """Return a scene whose blades `chosen` are turned about their pitch axes, by an angle in rad.

    The pitch angles stay as they are: centre of mass and inertia are turned in the blade's frame.
    """
    s, c = math.sin(angle), math.cos(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    blades = list(scene.blades)
    for i in chosen:
        inertia = turn @ blades[i].inertia_tensor @ turn.T
        x, y, z = (turn @ blades[i].centre_of_mass).tolist()
        places = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]  # xx yy zz xy xz yz
        blades[i] = _with_inertia(replace(blades[i], centre_of_mass=(x, y, z)), inertia[places])
    return replace(scene, blades=tuple(blades))


def _scaled_at(scene: Scene, paths: Sequence[Path], share: float) -> Scene:
    """Return a scene in which the values at some paths are larger by a share.

    Parameters
    ----------
    scene : the rotor.
    paths : the ways from the scene to the values.
    share : a value v becomes (1 + share) v.
    """

    def with_value(whole: Any, path: Path) -> Any:
        if not path:
            return _scaled(whole, share)
        place, rest = path[0], path[1:]
        if isinstance(place, int):
            return (*whole[:place], with_value(whole[place], rest), *whole[place + 1 :])
        return replace(whole, **{place: with_value(getattr(whole, place), rest)})

    for path in paths:
        scene = with_value(scene, path)
    return scene


def _scaled(value: Any, share: float) -> Any:
    """Return a number, the numbers of a tuple or the loads of a table, larger by a share."""
    if not isinstance(value, tuple):
        return value * (1.0 + share) if isinstance(value, float) else value
    if value and all(_is_row(row) for row in value):
        # In a table over time only the torques or angles are scaled, not the times.
        return tuple((time, number * (1.0 + share)) for time, number in value)
    return tuple(_scaled(entry, share) for entry in value)


def _is_row(value: Any) -> bool:
    """Return whether a value is a row of a table over time: a time and a number."""
    is_pair = isinstance(value, tuple) and len(value) == 2
    return is_pair and not isinstance(value[0], tuple)
