"""List the seven methods of Exudyn: two models, each with its integrators.

The engine is loaded when a system is built.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from rotor_mbs.methods.base import Ladder, Method, lazy, step_ladder, tolerance_ladder
from rotor_mbs.models.exudyn import schemes

_LINEARIZATION = "rotor_mbs.models.exudyn.linearization"
_SOLVERS = "rotor_mbs.models.exudyn.solvers"


def _method(model: str, integrator: str, label: str, builder: str = "", **facts: Any) -> Method:
    """Return a method of Exudyn.

    Parameters
    ----------
    model, integrator : the two parts of the method's name.
    label : label of the integrator.
    builder : name, without "build_", of the function in `solvers` that builds the solver; "" for
        the function of the model.
    facts : values of other fields of the `Method`.
    """
    in_tree = model == "exudyn_tree"
    kind = "tree" if in_tree else "chain"
    return Method(
        name=f"{model}/{integrator}",
        label=f"Exudyn {kind}, {label}",
        build=lazy(f"{_SOLVERS}:build_{builder or kind}"),
        items=lazy(f"rotor_mbs.models.exudyn.{kind}:items"),
        arrays=() if in_tree else ("constraint_error",),
        distributions=("exudyn",),
        relative_cost=10.0 if in_tree else 100.0,
        import_engine=lambda: import_module("rotor_mbs.models.exudyn.adapter"),
        **facts,
    )


# Text in the name of a curve, and text in its label, by the value of a setting: spectral_radius and
# node. The first value is the default.
_RADII = {0.9: ("", ""), 0.7: ("_rho0.7", "ρ∞ 0.7"), 1.0: ("_rho1.0", "ρ∞ 1")}
_NODES = {"euler_parameters": ("", ""), "rotation_vector": ("_rotation_vector", "rotation vector")}

_TREE_ALPHA_LADDERS = tuple(
    step_ladder(8, choices={"spectral_radius": radius}, variant=variant, label=label)
    for radius, (variant, label) in _RADII.items()
)
_NEWMARK_LADDERS = tuple(
    step_ladder(7, choices={"node": node}, variant=variant, label=label)
    for node, (variant, label) in _NODES.items()
)


def _chain_alpha_ladders() -> tuple[Ladder, ...]:
    """Return a ladder for each kind of node with each spectral radius."""
    ladders = []
    for node, (node_variant, node_label) in _NODES.items():
        for radius, (radius_variant, radius_label) in _RADII.items():
            labels = [label for label in (radius_label, node_label) if label]
            choices = {"spectral_radius": radius, "node": node}
            variant = radius_variant + node_variant
            ladders.append(
                step_ladder(7, choices=choices, variant=variant, label=", ".join(labels))
            )
    return tuple(ladders)


METHODS = (
    _method(
        "exudyn_tree",
        "rk44",
        "RK44",
        settings=schemes.Rk44Settings,
        order=4,
        fixed_step=True,
        ladders=(step_ladder(10),),
    ),
    _method(
        "exudyn_tree",
        "rk67",
        "RK67",
        settings=schemes.Rk67Settings,
        order=6,
        fixed_step=True,
        is_default=True,
        ladders=(step_ladder(8),),
        linearize=lazy(f"{_LINEARIZATION}:linearize_tree"),
    ),
    _method(
        "exudyn_tree",
        "dopri5",
        "DOPRI5",
        settings=schemes.Dopri5Settings,
        ladders=(
            tolerance_ladder(
                lambda tol: {"absolute_tolerance": tol, "relative_tolerance": 0.0},
                1e-2,
                1e-4,
                1e-6,
                1e-8,
                1e-10,
                1e-12,
                1e-14,
            ),
        ),
    ),
    _method(
        "exudyn_tree",
        "generalized_alpha",
        "generalized-α",
        settings=schemes.AlphaSettings,
        order=2,
        fixed_step=True,
        ladders=_TREE_ALPHA_LADDERS,
    ),
    _method(
        "exudyn_chain",
        "extrapolated",
        "extrapolated",
        builder="extrapolated",
        settings=schemes.ExtrapolatedSettings,
        is_default=True,
        ladders=(
            tolerance_ladder(lambda tol: {"tolerance": tol}, *(10.0**-k for k in range(3, 12))),
        ),
        linearize=lazy(f"{_LINEARIZATION}:linearize_chain"),
    ),
    _method(
        "exudyn_chain",
        "generalized_alpha",
        "generalized-α",
        settings=schemes.ChainAlphaSettings,
        order=2,
        fixed_step=True,
        ladders=_chain_alpha_ladders(),
    ),
    _method(
        "exudyn_chain",
        "newmark_index2",
        "Newmark index 2",
        settings=schemes.ChainNewmarkSettings,
        order=2,
        fixed_step=True,
        ladders=_NEWMARK_LADDERS,
    ),
)
