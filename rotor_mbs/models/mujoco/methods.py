"""List the methods of MuJoCo: one model with three of the engine's integrators.

Importing this module does not import MuJoCo.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

from rotor_mbs.errors import MethodRefusal
from rotor_mbs.methods.base import BuiltItem, Method, Solver, lazy, step_ladder
from rotor_mbs.methods.settings import Settings, step

if TYPE_CHECKING:
    from rotor_mbs.scenario.scene import Scene

_HINT = "pip install 'rotor_mbs[mujoco]'"


@dataclass(frozen=True)
class Rk4Settings(Settings):
    """Classical Runge-Kutta, order 4."""

    step: float = step(2.5e-4)


@dataclass(frozen=True)
class FirstOrderSettings(Settings):
    """Semi-implicit Euler, with the forces of dampers at the end of the step.

    The method `implicit` takes the Coriolis forces, too, at the end of the step.
    """

    step: float = step(5e-5)


def _items(scene: Scene) -> list[BuiltItem]:
    """Return the items of a scene's model.

    Raises
    ------
    MethodRefusal
        If MuJoCo is not installed. The message has the command that installs it.
    """
    if not METHODS[0].is_installed:
        raise MethodRefusal(f"MuJoCo is not installed: {_HINT}")
    from rotor_mbs.models.mujoco import mjcf

    return mjcf.items(scene)


def _build(integrator: str, scene: Scene, settings: Rk4Settings | FirstOrderSettings) -> Solver:
    """Build the solver of a scene.

    Parameters
    ----------
    integrator : a key of `mjcf.INTEGRATORS`.
    scene : the run.
    settings : settings of the method.

    Raises
    ------
    MethodRefusal
        If MuJoCo is not installed, or rejects the model.
    """
    _items(scene)
    from rotor_mbs.models.mujoco.solver import MujocoSolver

    return MujocoSolver(scene, integrator, settings.step)


def _method(integrator: str, label: str, **facts: Any) -> Method:
    """Return a method of MuJoCo.

    Parameters
    ----------
    integrator : a key of `mjcf.INTEGRATORS`.
    label : label of the integrator.
    facts : values of other fields of the `Method`.
    """
    return Method(
        name=f"mujoco/{integrator}",
        label=f"MuJoCo, {label}",
        build=partial(_build, integrator),
        items=_items,
        distributions=("mujoco",),
        fixed_step=True,
        relative_cost=10.0,
        import_engine=lambda: import_module("rotor_mbs.models.mujoco.solver"),
        **facts,
    )


METHODS = (
    _method(
        "rk4",
        "RK4",
        settings=Rk4Settings,
        order=4,
        ladders=(step_ladder(10),),
        linearize=lazy("rotor_mbs.models.mujoco.solver:linearize"),
    ),
    # Both methods first compute the new rates, with most forces at the start of the step and those
    # of dampers at its end. They then compute the new angles from the new rates. Their order is 1,
    # so their ladders begin with smaller steps, which still resolve the motion. The engine's
    # integrator Euler is left out: it treats dampers in the same way, and gives the same bits as
    # implicitfast.
    *(
        _method(
            integrator,
            label,
            settings=FirstOrderSettings,
            order=1,
            ladders=(step_ladder(10, first=5),),
        )
        for integrator, label in (("implicitfast", "implicit fast"), ("implicit", "implicit"))
    ),
)
