"""Linearize tree and chain by the engine's difference quotients, extrapolated to a step of zero.

The engine's quotients are one-sided. For joints the engine leaves out the geometric stiffness, the
effect of constraint forces that turn with the bodies. This stiffness is computed here from the
engine's constraint Jacobians at neighbouring states. Without it the frequencies of the chain under
gravity are wrong by several percent.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from rotor_mbs.errors import MethodRefusal
from rotor_mbs.models.exudyn import chain, tree
from rotor_mbs.models.exudyn.adapter import Linearized, System
from rotor_mbs.models.exudyn.geometry import movable_blades
from rotor_mbs.models.exudyn.loads import Loads
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Array, Linearization, limit_at_zero, scene_at

# Steps of the difference quotients, rad or m. With each further step the extrapolation eliminates
# one more order of the error.
_STEPS = tuple(1e-3 * 2.0**k for k in range(6))


def linearize_tree(
    scene: Scene, angles: Sequence[float] | Array, speed: float, torque: float
) -> Linearization:
    """Linearize the tree about a state of steady rotation or rest.

    Parameters
    ----------
    scene : the rotor. Its loads have their values at t = 0.
    angles : (1 + blades,) rad.
    speed : rate of the rotor, rad/s.
    torque : constant torque on the rotor, N m.

    Raises
    ------
    MethodRefusal
        If the engine rejects the tree.
    """
    state = scene_at(scene, angles, speed, torque)
    system = System(tree.parts(state, Loads(state)))
    linear = _extrapolated(system.linearized)
    inverse = np.asarray(np.linalg.inv(linear.M), dtype=np.float64)
    return Linearization(inverse @ linear.K, inverse @ linear.D, inverse @ system.forces())


def linearize_chain(
    scene: Scene, angles: Sequence[float] | Array, speed: float, torque: float
) -> Linearization:
    """Linearize the chain at rest.

    The stiffness is Nᵀ (K + ∂(C λ)/∂q) N. The columns of N are a basis of the velocities that the
    joints allow; λ are the multipliers of the joints.

    Parameters
    ----------
    scene : the rotor.
    angles : (1 + blades,) rad.
    speed, torque : must be 0 rad/s and 0 N m.

    Raises
    ------
    MethodRefusal
        If the engine rejects the chain, or the state is not an equilibrium at rest.
    """
    if speed or torque:
        raise MethodRefusal("exudyn_chain: can be linearized at rest only")
    state = scene_at(scene, angles, 0.0, 0.0)
    system = System(chain.parts(state, Loads(state), "euler_parameters"))
    linear = _extrapolated(system.linearized)
    force = system.forces()
    # In equilibrium the forces of the joints balance all other forces on the bodies.
    multipliers = np.asarray(np.linalg.lstsq(linear.C, force, rcond=None)[0], dtype=np.float64)
    residual = np.abs(force - linear.C @ multipliers).max()
    if residual > 1e-7 * np.abs(force).max(initial=0.0) + 1e-12 * np.abs(linear.K).max():
        raise MethodRefusal(f"exudyn_chain: no equilibrium: unbalanced force {residual:g} N")
    # N is an orthonormal basis of the velocities q̇ with Cᵀ q̇ = 0.
    vectors, singular_values, _ = np.linalg.svd(linear.C)
    rank = int(np.count_nonzero(singular_values > 1e-10 * singular_values[0]))
    N: Array = np.asarray(vectors[:, rank:])
    geometric = limit_at_zero(
        [_geometric_stiffness(system, multipliers, N, step) for step in _STEPS], 2.0
    )
    joint = _joint_rates(state) @ N
    mass = N.T @ linear.M @ N

    def in_joint_angles(matrix: Array) -> Array:
        return np.asarray(joint @ np.linalg.solve(mass, matrix) @ np.linalg.inv(joint))

    stiffness = in_joint_angles(N.T @ (linear.K @ N + geometric))
    damping = in_joint_angles(N.T @ linear.D @ N)
    return Linearization(stiffness, damping, joint @ np.linalg.solve(mass, N.T @ force))


def _joint_rates(scene: Scene) -> Array:
    """Return the matrix that maps the rates of the bodies' coordinates to the rates of the joints.

    A body's coordinates are position and Euler parameters (e0, e); its angular velocity is
    2 (e0 ė - ė0 e + e × ė).

    Parameters
    ----------
    scene : the rotor, at its initial state.

    Returns
    -------
    ndarray, shape (bodies, 7 bodies)
    """
    bodies = chain.placed_bodies(scene)
    rows = np.zeros((len(bodies), 7 * len(bodies)))
    for k, placed in enumerate(bodies):
        rows[k, 7 * k + 3 : 7 * k + 7] = placed.axis @ _spin(placed)
    # The rotor's rotation has a component about the axis of a coned blade. The pitch rate is what
    # remains of the blade's rate about this axis.
    for k, i in enumerate(movable_blades(scene), start=1):
        if scene.blades[i].cone:
            rows[k, 3:7] -= bodies[k].axis @ _spin(bodies[0])
    return rows


def _spin(placed: chain.Placed) -> Array:
    """Return the (3, 4) matrix that maps rates of Euler parameters to an angular velocity."""
    p = placed.quaternion
    return 2.0 * np.column_stack([-p[1:], p[0] * np.eye(3) + np.cross(p[1:], np.eye(3)).T])


def _extrapolated(linearized: Callable[[float], Linearized]) -> Linearized:
    """Return the limit of the engine's linearization for a step of 0."""
    by_step = [linearized(step) for step in _STEPS]
    return Linearized(*(limit_at_zero(matrices, 2.0) for matrices in zip(*by_step, strict=True)))


def _geometric_stiffness(system: System, multipliers: Array, N: Array, step: float) -> Array:
    """Return ∂(C λ)/∂q N, (n, free), by difference quotients along each column of N.

    Parameters
    ----------
    system : the system, at the state of the linearization.
    multipliers : (constraints,) λ.
    N : (n, free) basis of the velocities that the joints allow.
    step : step of the difference quotients, rad or m.
    """
    start = system.coordinates
    here = system.linearized(_STEPS[0]).C @ multipliers
    columns = []
    for direction in N.T:
        system.coordinates = start + step * direction
        columns.append((system.linearized(_STEPS[0]).C @ multipliers - here) / step)
    system.coordinates = start
    return np.array(columns).T
