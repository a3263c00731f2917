"""The settings each method is benched with, from useless to its round-off floor. Knows names and numbers, no engine."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from rotor_mbs.errors import InputError

STEP, TOLERANCE = "step", "tolerance"


@dataclass(frozen=True)
class Rung:
    """A setting of a ladder: the number it is plotted by (s, or the tolerance), and all that the method is given."""

    setting: float
    settings: Mapping[str, object]


@dataclass(frozen=True)
class Ladder:
    """A curve of the diagram: one method with its fixed choices, over a falling step or tolerance.

    curve     "model/integrator", with the choices behind it where they are not the default ones
    kind      STEP or TOLERANCE
    order     expected order of convergence, where the step is fixed
    choices   settings that stay the same along the ladder
    values    steps as shares of the sample interval, or tolerances; coarse to fine
    fill      the settings that go with one value
    """

    curve: str
    method: str
    kind: str
    values: tuple[float, ...]
    fill: Callable[[float], Mapping[str, object]]
    order: float | None
    choices: Mapping[str, object]

    def rungs(self, interval: float) -> tuple[Rung, ...]:
        """The ladder on a scene whose samples are `interval` s apart."""
        settings = [value * interval if self.kind == STEP else value for value in self.values]
        return tuple(Rung(setting, {**self.choices, **self.fill(setting)}) for setting in settings)


def ladders(methods: Sequence[str] = ()) -> tuple[Ladder, ...]:
    """The ladders of the methods named, of all where none is named. Raises InputError for one that has none."""
    without = [name for name in methods if name not in _METHODS]
    if without:
        raise InputError([f"no ladder for method {name!r}; allowed: {', '.join(_METHODS)}" for name in without])
    return tuple(ladder for ladder in _LADDERS if not methods or ladder.method in methods)


def _halvings(count: int) -> tuple[float, ...]:
    return tuple(0.5**k for k in range(count))


def _step(step: float) -> Mapping[str, object]:
    return {"step": step}


def _pair(tolerance: float) -> Mapping[str, object]:
    """Angles and rates of order one: a hundredth of the relative tolerance is nowhere the larger of the two."""
    return {"relative_tolerance": tolerance, "absolute_tolerance": 0.01 * tolerance}


def _fixed_step(method: str, order: float, count: int, **choices: object) -> Ladder:
    names = [_SHORT.get((name, value), f"{value}") for name, value in choices.items()]
    curve = "_".join([method, *filter(None, names)])
    return Ladder(curve, method, STEP, _halvings(count), _step, order, choices)


def _adaptive(method: str, fill: Callable[[float], Mapping[str, object]], *tolerances: float) -> Ladder:
    return Ladder(method, method, TOLERANCE, tolerances, fill, None, {})


# A choice in the name of a curve; the default ones leave no trace there.
_SHORT: Mapping[tuple[str, object], str] = {
    ("spectral_radius", 0.7): "rho0.7",
    ("spectral_radius", 0.9): "",
    ("spectral_radius", 1.0): "rho1.0",
    ("node", "euler_parameters"): "",
}
_RADII = (0.9, 0.7, 1.0)
_NODES = ("euler_parameters", "rotation_vector")

_LADDERS = (
    _adaptive(
        "lagrange/taylor", lambda tol: {"tolerance": tol},
        1e-1, 1e-3, 1e-5, 1e-7, 1e-9, 1e-10, 1e-11, 1e-13, 2.0**-52,
    ),
    _adaptive("lagrange/ode45", _pair, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 3e-14),
    _adaptive("lagrange/dop853", _pair, 1e-1, 1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13, 3e-14),
    _adaptive("lagrange/radau", _pair, 1e-1, 1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13),
    _fixed_step("exudyn_tree/rk44", 4, 10),
    _fixed_step("exudyn_tree/rk67", 6, 8),
    _adaptive(
        "exudyn_tree/dopri5", lambda tol: {"relative_tolerance": 0.0, "absolute_tolerance": tol},
        1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14,
    ),
    *(_fixed_step("exudyn_tree/generalized_alpha", 2, 8, spectral_radius=radius) for radius in _RADII),
    *(
        _fixed_step("exudyn_chain/generalized_alpha", 2, 7, spectral_radius=radius, node=node)
        for node, radius in itertools.product(_NODES, _RADII)
    ),
    *(_fixed_step("exudyn_chain/newmark_index2", 2, 7, node=node) for node in _NODES),
)  # fmt: skip

_METHODS = tuple(dict.fromkeys(ladder.method for ladder in _LADDERS))
