"""The six methods of Exudyn: two models, each with its integrators. The engine is loaded when a system is built."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from itertools import product
from typing import TYPE_CHECKING, Any

from rotor_mbs.errors import InputError, MethodRefusal
from rotor_mbs.methods.base import BuiltItem, Method, Solver, late, stability_polynomial, step_ladder, tolerance_ladder
from rotor_mbs.methods.settings import choice, step
from rotor_mbs.models.exudyn import schemes

if TYPE_CHECKING:  # the list of methods needs none of them
    from rotor_mbs.models.exudyn import blueprint
    from rotor_mbs.models.exudyn.moments import Loads
    from rotor_mbs.scenario.scene import Scene
    from rotor_mbs.scenario.time_table import Segment
    from rotor_mbs.solution.trajectory import Array, Integration, Trajectory

    Reading = Callable[[Scene, Sequence[Segment], Callable[[str], Array]], Trajectory]

# The engine takes a run as ended within 1e-10 s of its end, whatever the step.
_SHORTEST_INTERVAL = 1e-8
_MAX_STEPS = 1e9
_LINEARIZATION = "rotor_mbs.models.exudyn.linearization"

_NODE = choice("euler_parameters", ("euler_parameters", "rotation_vector"), doc="coordinates of a body's rotation")
_EXTRAPOLATION = choice("none", ("none", "richardson"), doc="richardson: three runs, with step, step/2 and step/4")


@dataclass(frozen=True)
class ChainAlphaSettings(schemes.AlphaSettings):
    """Generalized-alpha of the chain."""

    step: float = step(5e-4)
    node: str = _NODE
    extrapolation: str = _EXTRAPOLATION


@dataclass(frozen=True)
class ChainNewmarkSettings(schemes.NewtonSettings):
    """The trapezoidal rule of the chain."""

    node: str = _NODE
    extrapolation: str = _EXTRAPOLATION


class MultibodySolver:
    """See `methods.base.Solver`; `reading` makes the trajectory from recorded rows, for which it may need
    `rows_between` samples. Raises MethodRefusal, with the engine's reason, where the engine does not take the parts."""

    def __init__(
        self,
        scene: Scene,
        parts: Sequence[blueprint.Part],
        loads: Loads,
        scheme: schemes.Scheme,
        reading: Reading,
        rows_between: bool,
    ) -> None:
        from rotor_mbs.models.exudyn.adapter import System
        from rotor_mbs.scenario.time_table import intervals

        self._scene, self._loads, self._scheme, self._reading = scene, loads, scheme, reading
        self._rows_between = rows_between
        self._intervals = intervals(loads.segments, scene.samples, every_sample=scheme.step is None)
        self.system = System(parts)

    def integrate(self) -> Integration:
        """From the initial state, every time; bit for bit the same."""
        return self.system.integrate(self._scheme, self._intervals, self._rows_between, self._loads.enter)

    def observe(self) -> Trajectory:
        import numpy as np

        # A diverging state may overflow in its energies; the rows are cut where they stop being finite.
        with np.errstate(over="ignore", invalid="ignore"):
            return self._reading(self._scene, self._loads.segments, self.system.rows)


def _build_tree(scene: Scene, settings: schemes.SchemeSettings) -> Solver:
    from rotor_mbs.models.exudyn import sensor_samples, tree
    from rotor_mbs.models.exudyn.moments import Loads

    scheme, loads = _scheme(scene, settings), Loads(scene)
    if scene.wants("loads"):
        scheme = scheme.with_accelerations()
    between = scene.wants("energy") and scene.work_needs_path
    return MultibodySolver(scene, tree.parts(scene, loads), loads, scheme, sensor_samples.tree_trajectory, between)


def _build_chain(scene: Scene, settings: ChainAlphaSettings | ChainNewmarkSettings) -> Solver:
    from rotor_mbs.models.exudyn import chain, sensor_samples
    from rotor_mbs.models.exudyn.extrapolation import ExtrapolatedSolver
    from rotor_mbs.models.exudyn.moments import Loads

    scheme = _scheme(scene, settings)
    if scene.wants("loads") and settings.node == "rotation_vector":
        raise MethodRefusal(
            "exudyn_chain: loads need the setting node = euler_parameters: with rotation_vector the engine's "
            "multipliers start wrong, and those of newmark_index2 stay so"
        )

    def build(refinement: int = 1) -> Solver:
        loads = Loads(scene)
        parts, finer = chain.parts(scene, loads, settings.node), replace(scheme, refinement=refinement)
        # Its angles are unwrapped from row to row, so rows are kept between samples.
        return MultibodySolver(scene, parts, loads, finer, sensor_samples.chain_trajectory, rows_between=True)

    if settings.extrapolation == "richardson":
        return ExtrapolatedSolver(build, settings.newton_relative_tolerance)
    return build()


def _scheme(scene: Scene, settings: schemes.SchemeSettings) -> schemes.Scheme:
    if scene.duration / (scene.samples - 1) < _SHORTEST_INTERVAL:
        raise MethodRefusal(f"Exudyn cannot resolve samples less than {_SHORTEST_INTERVAL:g} s apart")
    scheme = settings.scheme()
    if scheme.step is not None and scene.duration / scheme.step > _MAX_STEPS:
        raise InputError(f"setting step: {scheme.step:g} s makes more than {_MAX_STEPS:g} steps")
    return scheme


def _chain_arrays(settings: ChainAlphaSettings | ChainNewmarkSettings) -> tuple[str, ...]:
    own = ("angle_uncertainty",) if settings.extrapolation == "richardson" else ()
    return ("constraint_error", *own)


def _method(model: str, integrator: str, label: str, **facts: Any) -> Method:
    in_tree = model == "exudyn_tree"

    def items(scene: Scene) -> list[BuiltItem]:
        from rotor_mbs.models.exudyn import blueprint, chain, tree
        from rotor_mbs.models.exudyn.moments import Loads

        return blueprint.items((tree if in_tree else chain).parts(scene, Loads(scene)))

    return Method(
        name=f"{model}/{integrator}",
        label=f"Exudyn {'tree' if in_tree else 'chain'}, {label}",
        build=_build_tree if in_tree else _build_chain,
        items=items,
        arrays=(lambda _: ()) if in_tree else _chain_arrays,
        distributions=("exudyn",),
        relative_cost=10.0 if in_tree else 100.0,
        load=lambda: import_module("rotor_mbs.models.exudyn.adapter"),
        **facts,
    )


# What the names and the labels of curves have for a spectral radius, and for a kind of node; the first is the default.
_RADII = {0.9: ("", ""), 0.7: ("_rho0.7", "ρ∞ 0.7"), 1.0: ("_rho1.0", "ρ∞ 1")}
_NODES = {"euler_parameters": ("", ""), "rotation_vector": ("_rotation_vector", "rotation vector")}

_TREE_ALPHA_LADDERS = tuple(
    step_ladder(8, choices={"spectral_radius": radius}, variant=variant, label=label)
    for radius, (variant, label) in _RADII.items()
)
_CHAIN_ALPHA_LADDERS = tuple(
    step_ladder(
        7,
        choices={"spectral_radius": radius, "node": node},
        variant=of_radius[0] + of_node[0],
        label=", ".join(filter(None, (of_radius[1], of_node[1]))),
    )
    for (node, of_node), (radius, of_radius) in product(_NODES.items(), _RADII.items())
)
_NEWMARK_LADDERS = (
    step_ladder(7, choices={"node": "euler_parameters"}),
    step_ladder(
        7,
        choices={"node": "rotation_vector"},
        variant="_rotation_vector",
        label="rotation vector",
    ),
)

METHODS = (
    _method(
        "exudyn_tree", "rk44", "RK44",
        settings=schemes.Rk44Settings, order=4, fixed_step=True,
        stability_function=stability_polynomial(1, 1, 1 / 2, 1 / 6, 1 / 24),
        ladders=(step_ladder(10),),
    ),
    _method(
        "exudyn_tree", "rk67", "RK67",
        settings=schemes.Rk67Settings, order=6, fixed_step=True, is_default=True,
        # To order 6 the exponential's; of the seventh stage b7 a76 a65 a54 a43 a32 a21 = -1/2160
        # (J. C. Butcher, J. Austral. Math. Soc. 4 (1964), 179-194).
        stability_function=stability_polynomial(1, 1, 1 / 2, 1 / 6, 1 / 24, 1 / 120, 1 / 720, -1 / 2160),
        ladders=(step_ladder(8),), linearize=late(f"{_LINEARIZATION}:linearize_tree"),
    ),
    _method(
        "exudyn_tree", "dopri5", "DOPRI5",
        settings=schemes.Dopri5Settings,
        ladders=(
            tolerance_ladder(
                lambda tol: {"relative_tolerance": 0.0, "absolute_tolerance": tol},
                1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14,
            ),
        ),

    ),
    _method(
        "exudyn_tree", "generalized_alpha", "generalized-α",
        settings=schemes.AlphaSettings, order=2, fixed_step=True,
        ladders=_TREE_ALPHA_LADDERS,
    ),
    _method(
        "exudyn_chain", "generalized_alpha", "generalized-α",
        settings=ChainAlphaSettings, order=2, fixed_step=True, is_default=True,
        ladders=_CHAIN_ALPHA_LADDERS,
        linearize=late(f"{_LINEARIZATION}:linearize_chain"),
    ),
    _method(
        "exudyn_chain", "newmark_index2", "Newmark index 2",
        settings=ChainNewmarkSettings, order=2, fixed_step=True,
        ladders=_NEWMARK_LADDERS,
    ),
)  # fmt: skip
