"""List the methods that integrate the paper's equations by ode45.

printed/ode45 integrates the equations as printed. printed_e1/ode45, printed_e2/ode45 and
printed_e3/ode45 integrate the corrected equations with one of the errata E1, E2, E3.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING

from rotor_mbs.errors import MethodRefusal
from rotor_mbs.methods.base import BuiltItem, Method
from rotor_mbs.models import Ode45Settings, equation_items
from rotor_mbs.models.printed import literal
from rotor_mbs.models.printed.derivation import DerivedRotor, Errata

if TYPE_CHECKING:  # the list of methods needs none of these modules
    from rotor_mbs.models.ode45 import Ode45Result, RightHandSide
    from rotor_mbs.models.printed.observables import PointMassRotor
    from rotor_mbs.scenario.scene import Scene
    from rotor_mbs.scenario.time_table import LoadTable
    from rotor_mbs.solution.trajectory import Integration, Trajectory

# (torques, angles followed by rates) -> accelerations. All are of the coordinates that move, and in
# N m, rad, rad/s and rad/s².
Accelerations = Callable[[Sequence[float], Sequence[float]], Sequence[float]]


class PrintedSolver:
    """Integrate the equations as printed, or derived anew with some errata, by ode45."""

    def __init__(
        self, name: str, errata: Errata | None, scene: Scene, settings: Ode45Settings
    ) -> None:
        """Build the equations.

        Parameters
        ----------
        name : name of the method.
        errata : errata that are left in the derived equations; None for the equations as printed.
        scene : the run.
        settings : the tolerances.

        Raises
        ------
        MethodRefusal
            If the equations cannot represent the scene.
        """
        self._scene, self._errata = scene, errata
        self._rotor = rotor = point_mass_rotor(name, errata, scene)
        self._moving = moving = len(scene.initial_angles) if rotor.pitches_move else 1
        self._initial = [*scene.initial_angles[:moving], *scene.initial_rates[:moving]]
        self._right_hand_side = right_hand_side(scene, equations(rotor, errata), moving)
        self._tolerances = settings.relative_tolerance, settings.absolute_tolerance
        self._result: Ode45Result  # result of the last integration

    def integrate(self) -> Integration:
        """Integrate from the initial state to the end, or to the first failure."""
        from rotor_mbs.models.ode45 import ode45
        from rotor_mbs.solution.trajectory import Integration

        result = ode45(
            self._right_hand_side, self._scene.duration, self._initial, *self._tolerances
        )
        self._result = result
        return Integration(
            result.success,
            result.message,
            float(result.time[-1]),
            result.steps,
            rhs_evaluations=result.evaluations,
        )

    def observe(self) -> Trajectory:
        """Return the samples of the last integration.

        For the equations as printed, the trajectory also has ode45's own output points (`refined`).
        """
        import numpy as np

        from rotor_mbs.models.printed.observables import torque_work
        from rotor_mbs.solution.trajectory import Trajectory, all_coordinates, sample_times

        scene, rotor, result = self._scene, self._rotor, self._result
        time = sample_times(scene)
        time = time[time <= result.time[-1]]
        states = result.at(time)
        angles, rates = all_coordinates(scene, states[:, : self._moving], states[:, self._moving :])
        fields = {}
        if scene.wants("tip"):
            fields["tip"] = rotor.tip_path(angles)
        if scene.wants("energy"):
            fields["kinetic_energy"] = rotor.kinetic_energy(angles, rates)
            fields["potential_energy"] = rotor.potential_energy(angles)
            fields["work"] = np.zeros(len(time))
            for coordinate, table in enumerate(_torque_tables(scene, self._moving)):
                if table:
                    fields["work"] += torque_work(scene, result, coordinate, time)
        if scene.wants("loads"):
            before = np.nextafter(time, 0.0).tolist()  # at a jump of a torque: before the jump
            torque = np.array([scene.torque_at(t) for t in before])
            # The accelerations of fixed pitches are zero.
            accelerations = np.zeros((len(time), len(scene.initial_angles)))
            for row, t, state in zip(accelerations, before, states.tolist(), strict=True):
                row[: self._moving] = self._right_hand_side(t, state)[self._moving :]
            fields |= rotor.loads(angles, rates, accelerations, torque)
        trajectory = Trajectory(time, angles, rates, **fields)
        if not self._errata:
            # The paper's numbers are read off at ode45's own output points.
            own_time, states = result.refined()
            refined = all_coordinates(scene, states[:, : self._moving], states[:, self._moving :])
            trajectory.refined = Trajectory(own_time, *refined)
        return trajectory


def point_mass_rotor(name: str, errata: Errata | None, scene: Scene) -> PointMassRotor:
    """Return the values of the paper's symbols for a scene.

    Parameters
    ----------
    name : name of the method.
    errata : errata that are left in the derived equations; None for the equations as printed.
    scene : the rotor.

    Raises
    ------
    MethodRefusal
        If the equations cannot represent the scene. The message says why, in one sentence.
    """
    from rotor_mbs.models.printed.observables import PointMassRotor

    blade, count = scene.blades[0], len(scene.blades)
    x, y, z = blade.centre_of_mass
    refusals = {
        f"{name} requires 1 or 3 blades; the scene has {count}": not errata and count not in (1, 3),
        f"{name} requires equal blades": any(other != blade for other in scene.blades),
        f"{name} requires point-mass blades, without inertia about the centre of mass": (
            not blade.is_point_mass
        ),
        f"{name} requires the centre of mass in the blade's x-z plane: y = 0, not {y:g}": y != 0.0,
        f"{name} does not include hub inertia; it must be 0": scene.hub_inertia != 0.0,
        f"{name} does not include bearing stiffness or damping; both must be 0": (
            any(scene.bearing_stiffness) or any(scene.bearing_damping)
        ),
        f"{name} does not include shaft damping; it must be 0": scene.shaft_damping != 0.0,
        f"{name} does not include a tilted shaft; shaft.tilt must be 0": scene.shaft_tilt != 0.0,
        f"{name} does not include coned blades; blade.cone must be 0": blade.cone != 0.0,
        f"{name} does not include a hub with a radius or a mass; both must be 0": (
            scene.hub_radius != 0.0 or scene.hub_mass != 0.0
        ),
    }
    for sentence, refused in refusals.items():
        if refused:
            raise MethodRefusal(sentence)
    # The tip is given in frame 3, whose origin is the point mass.
    tip = (blade.tip[0] - x, blade.tip[1] - y, blade.tip[2] - z)
    return PointMassRotor(blade.mass, x, z, scene.gravity, scene.phases, tip)


def equations(rotor: PointMassRotor, errata: Errata | None) -> Accelerations:
    """Return the equations of motion, as printed or derived anew with some errata.

    Parameters
    ----------
    rotor : values of the paper's symbols.
    errata : errata that are left in the derived equations; None for the equations as printed.
    """
    m, c, d, g = rotor.m, rotor.c, rotor.d, rotor.g
    if not rotor.pitches_move:
        return lambda torques, state: [
            literal.fixed_pitch_acceleration(m, d, g, torques[0], state[0], rotor.phases)
        ]
    if errata:
        derived = DerivedRotor(m, c, d, g, rotor.phases, errata)
        n = 1 + len(rotor.phases)
        return lambda torques, state: derived.accelerations(torques, state[:n], state[n:])
    if len(rotor.phases) == 1:
        return lambda torques, state: literal.one_blade_accelerations(m, c, d, g, torques, state)
    return lambda torques, state: literal.three_blade_accelerations(m, c, d, g, torques, state)


def items(name: str, errata: Errata | None, scene: Scene) -> list[BuiltItem]:
    """Return equations, terms and outputs of a scene, with the numbers of the paper's equations.

    Parameters
    ----------
    name, errata, scene : as for `point_mass_rotor`.

    Raises
    ------
    MethodRefusal
        If the equations cannot represent the scene.
    """
    point_mass_rotor(name, errata, scene)
    if errata:
        left = " ".join(erratum.upper() for erratum, is_left in asdict(errata).items() if is_left)
        return equation_items(scene, (f"(24)-(38) rederived, with {left}",) * 2)
    if len(scene.blades) == 1:
        return equation_items(scene, ("(33), rotor row", "(33), pitch row"))
    return equation_items(
        scene, ("(42)-(45), (52), (56) with its factor expanded", "(46)-(51), (53)-(56)")
    )


def _torque_tables(scene: Scene, moving: int) -> tuple[LoadTable, ...]:
    """Return the torques over time on the first `moving` coordinates: τ2, then τ3 to τ5."""
    from rotor_mbs.scenario.time_table import torque_place

    return tuple(scene.load_tables[torque_place(coordinate)] for coordinate in range(moving))


def right_hand_side(scene: Scene, accelerations: Accelerations, moving: int) -> RightHandSide:
    """Return the function y' = f(t, y) of y = (angles, rates).

    The function returns NaN if the equations are singular at y.

    Parameters
    ----------
    scene : gives the torques over time.
    accelerations : the equations of motion.
    moving : number of coordinates that move.
    """
    from rotor_mbs.scenario.time_table import is_constant, value_at

    undefined = [math.nan] * (2 * moving)
    tables = _torque_tables(scene, moving)
    # Constant torques are looked up only once. All scenes of the paper have constant torques.
    constant = [value_at(table, 0.0) for table in tables] if all(map(is_constant, tables)) else None

    def f(t: float, y: Sequence[float]) -> list[float]:
        torques = constant or [value_at(table, t) for table in tables]
        try:
            return [*y[moving:], *accelerations(torques, y)]
        # The sine of an infinite angle raises ValueError.
        except (ZeroDivisionError, OverflowError, ValueError):
            return undefined

    return f


def _method(name: str, label: str, errata: Errata | None = None, erratum: str = "") -> Method:
    """Return a method of the printed equations.

    Parameters
    ----------
    name, label : name and label of the method.
    errata : errata that are left in the derived equations; None for the equations as printed.
    erratum : name of the only erratum, such as "E1"; "" for the equations as printed.
    """
    return Method(
        name=name,
        label=label,
        build=partial(PrintedSolver, name, errata),
        items=partial(items, name, errata),
        settings=Ode45Settings,
        is_corrected=False,
        is_default=not erratum,
        erratum=erratum,
        relative_cost=30.0,
    )


METHODS = (
    _method("printed/ode45", "as printed, ode45"),
    _method("printed_e1/ode45", "E1 alone, ode45", Errata(e1=True, e2=False, e3=False), "E1"),
    _method("printed_e2/ode45", "E2 alone, ode45", Errata(e1=False, e2=True, e3=False), "E2"),
    _method("printed_e3/ode45", "E3 alone, ode45", Errata(e1=False, e2=False, e3=True), "E3"),
)
