"""List the methods of the closed form, and declare their settings.

Importing this module loads neither NumPy, SciPy nor heyoka.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

from rotor_mbs.methods.base import Ladder, Method, Solver, lazy, tolerance_ladder, tolerance_pair
from rotor_mbs.methods.settings import Settings, number
from rotor_mbs.models import Ode45Settings, equation_items

if TYPE_CHECKING:  # these modules would load NumPy
    from rotor_mbs.scenario.scene import Scene
    from rotor_mbs.solution.trajectory import Linearization

_EPS = sys.float_info.epsilon
_SOLVE_MANY = "rotor_mbs.models.lagrange.ensemble:solve_many"


@dataclass(frozen=True)
class TaylorSettings(Settings):
    """Settings of heyoka's adaptive Taylor method in double precision."""

    tolerance: float = number(
        _EPS, above=0.0, doc="tolerance of the local error, absolute and relative"
    )


@dataclass(frozen=True)
class ReferenceSettings(Settings):
    """Settings of the reference's two runs in quad precision."""

    tolerance: float = number(1e-33, above=0.0, doc="tolerance of the stored run")
    check_tolerance: float = number(1e-30, above=0.0, doc="tolerance of the run for comparison")


def _relative(default: float) -> Any:
    """Declare a relative tolerance of SciPy.

    SciPy itself raises a smaller tolerance to the least value that is allowed here.
    """
    return number(default, at_least=100.0 * _EPS, doc="relative tolerance of the local error")


def _absolute(default: float) -> Any:
    """Declare an absolute tolerance of SciPy."""
    return number(default, above=0.0, doc="absolute tolerance of the local error, rad and rad/s")


@dataclass(frozen=True)
class Dop853Settings(Settings):
    """Settings of SciPy's DOP853, an explicit method of order 8."""

    relative_tolerance: float = _relative(3e-14)
    absolute_tolerance: float = _absolute(1e-16)


@dataclass(frozen=True)
class RadauSettings(Settings):
    """Settings of SciPy's Radau, an implicit method of order 5."""

    relative_tolerance: float = _relative(1e-8)
    absolute_tolerance: float = _absolute(1e-11)


def _build_taylor(scene: Scene, settings: TaylorSettings) -> Solver:
    from rotor_mbs.models.lagrange.taylor import Propagation, is_compact

    return Propagation(
        scene, tol=settings.tolerance, compact_mode=is_compact(scene), high_accuracy=True
    )


def _build_ode45(scene: Scene, settings: Ode45Settings) -> Solver:
    from rotor_mbs.models.lagrange.ode_solvers import OdeSolver, ode45_integrator

    return OdeSolver(
        scene, ode45_integrator(settings.relative_tolerance, settings.absolute_tolerance)
    )


def _linearize(scene: Scene, angles: Any, speed: float, torque: float) -> Linearization:
    from rotor_mbs.models.lagrange.linearization import linearize

    return linearize(scene, angles, [speed, *(0.0 for _ in scene.blades)], torque)


def _scipy_method(
    solver: str, settings: type[Settings], ladder: Ladder, relative_cost: float
) -> Method:
    """Return the method that integrates the closed form by one of SciPy's solvers.

    Parameters
    ----------
    solver : name of the class in `scipy.integrate`.
    settings, relative_cost : see `Method`.
    ladder : the only ladder of the method.
    """

    def build(scene: Scene, chosen: Any) -> Solver:
        from rotor_mbs.models.lagrange.ode_solvers import OdeSolver, scipy_integrator

        return OdeSolver(
            scene, scipy_integrator(solver, chosen.relative_tolerance, chosen.absolute_tolerance)
        )

    return Method(
        name=f"lagrange/{solver.lower()}",
        label=f"closed form, {solver}",
        settings=settings,
        build=build,
        items=equation_items,
        distributions=("scipy",),
        ladders=(ladder,),
        import_engine=lambda: import_module("scipy.integrate"),
        relative_cost=relative_cost,
    )


METHODS = (
    Method(
        name="lagrange/taylor",
        label="closed form, Taylor",
        settings=TaylorSettings,
        build=_build_taylor,
        items=lazy("rotor_mbs.models.lagrange.taylor:items"),
        solve_many=lambda scenes, settings: lazy(_SOLVE_MANY)(scenes, settings.tolerance),
        import_engine=lazy("rotor_mbs.models.lagrange.heyoka_adapter:compile_anew"),
        distributions=("heyoka",),
        fallback="lagrange/dop853",
        is_default=True,
        ladders=(
            tolerance_ladder(
                lambda tol: {"tolerance": tol},
                1e-1, 1e-3, 1e-5, 1e-7, 1e-9, 1e-10, 1e-11, 1e-13, 2.0**-52,
            ),
        ),
    ),
    Method(
        name="lagrange/ode45",
        label="closed form, Dormand-Prince 5(4)",
        settings=Ode45Settings,
        build=_build_ode45,
        items=equation_items,
        ladders=(tolerance_ladder(tolerance_pair, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 3e-14),),
        relative_cost=10.0,
        linearize=_linearize,
    ),
    _scipy_method(
        "DOP853", Dop853Settings,
        tolerance_ladder(tolerance_pair, 1e-1, 1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13, 3e-14), 20.0,
    ),
    _scipy_method(
        "Radau", RadauSettings,
        tolerance_ladder(tolerance_pair, 1e-1, 1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13), 80.0,
    ),
    Method(
        name="reference",
        label="reference, quad precision",
        settings=ReferenceSettings,
        build=lazy("rotor_mbs.models.lagrange.reference:build"),
        arrays=("angle_uncertainty", "error_growth"),
        items=equation_items,
    ),
)  # fmt: skip
