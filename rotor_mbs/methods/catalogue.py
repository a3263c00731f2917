"""Methods by the names used everywhere; a model's code, and its engine, are loaded when first asked for."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Sequence

from rotor_mbs.errors import InputError
from rotor_mbs.methods.base import Method

_MODULES = {
    "printed": "rotor_mbs.models.printed.method",
    "printed_e1": "rotor_mbs.models.printed.method",
    "printed_e2": "rotor_mbs.models.printed.method",
    "printed_e3": "rotor_mbs.models.printed.method",
    "lagrange": "rotor_mbs.models.lagrange.methods",
    "exudyn_tree": "rotor_mbs.models.exudyn.methods",
    "exudyn_chain": "rotor_mbs.models.exudyn.methods",
}

REFERENCE = "reference"

# Modules that are a method each.
_METHODS = {
    "lagrange/taylor": "rotor_mbs.models.lagrange.taylor",
    REFERENCE: "rotor_mbs.models.lagrange.reference",
}

METHOD_NAMES = (
    "printed/ode45",
    "printed_e1/ode45",
    "printed_e2/ode45",
    "printed_e3/ode45",
    "lagrange/taylor",
    "lagrange/ode45",
    "lagrange/dop853",
    "lagrange/radau",
    "exudyn_tree/rk44",
    "exudyn_tree/rk67",
    "exudyn_tree/dopri5",
    "exudyn_tree/generalized_alpha",
    "exudyn_chain/generalized_alpha",
    "exudyn_chain/newmark_index2",
)

# What a batch runs where nothing is named: the printed equations, and the three right models at their best.
DEFAULT_METHODS = ("printed/ode45", "lagrange/taylor", "exudyn_tree/rk67", "exudyn_chain/generalized_alpha")

# What each erratum alone does to a scene; the reproduction runs these too.
ERRATA_METHODS = ("printed_e1/ode45", "printed_e2/ode45", "printed_e3/ode45")

# Where heyoka is not to be had.
_STAND_INS = {"lagrange/taylor": "lagrange/dop853"}


def available_defaults() -> tuple[str, ...]:
    """DEFAULT_METHODS, with a stand-in where an engine is not installed."""
    missing = importlib.util.find_spec("heyoka") is None
    return tuple(_STAND_INS.get(name, name) if missing else name for name in DEFAULT_METHODS)


def find_method(name: str) -> Method:
    """The method called `name` ("model/integrator" or "reference")."""
    if name in _METHODS:
        method: Method = importlib.import_module(_METHODS[name])
        return method
    table: dict[str, Method] = importlib.import_module(_MODULES[name.split("/")[0]]).METHODS
    return table[name]


def check_names(names: Sequence[str]) -> tuple[str, ...]:
    """The names, once each, in order. Raises InputError naming every unknown one and what is allowed."""
    unknown = [name for name in names if name not in METHOD_NAMES]
    if unknown:
        allowed = ", ".join(METHOD_NAMES)
        raise InputError([f"unknown method {name!r}; allowed: {allowed}" for name in unknown])
    return tuple(dict.fromkeys(names))


def load_engine(name: str) -> None:
    """Imports what the method called `name` computes with, and lets no compiled code of an earlier process be used.

    For timings: neither an import nor what happens to lie in a cache on disk belongs to a run.
    """
    if name == "lagrange/taylor":
        importlib.import_module("rotor_mbs.models.lagrange.heyoka_adapter").compile_anew()
    elif name.startswith("exudyn"):
        importlib.import_module("rotor_mbs.models.exudyn.adapter")
    else:
        importlib.import_module("scipy.integrate")
