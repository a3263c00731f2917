"""List the methods of MuJoCo: one model with three of the engine's integrators.

Importing this does not import MuJoCo.
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
    """Semi-implicit Euler, dampers at the end of the step.

    The method `implicit` takes Coriolis forces there, too.
    """

    step: float = step(5e-5)


def _items(scene: Scene) -> list[BuiltItem]:
    """Return the items of a scene.

    Raises
    ------
    MethodRefusal
        If MuJoCo is not installed, with the way to get it.
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
    settings : of the method, of which the step is used.

    Raises
    ------
    MethodRefusal
        If MuJoCo is not installed, or does not take the model.
    """
    _items(scene)
    from rotor_mbs.models.mujoco.solver import MujocoSolver

    return MujocoSolver(scene, integrator, settings.step)


def _method(integrator: str, label: str, **facts: Any) -> Method:
    """Return a method of MuJoCo.

    Parameters
    ----------
    integrator : a key of `mjcf.INTEGRATORS`.
    label : of the integrator.
    facts : other fields of the `Method`.
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
    # First the new rates, with forces at the start of the step and dampers at its end; then angles
    # with these rates. The ladders of these first-order methods begin at steps that still resolve
    # the motion. The engine's Euler treats dampers alike, and gives the same bits as implicitfast.
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
