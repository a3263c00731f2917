"""How each method is called and drawn, the same in every figure and table. Knows no run."""

from __future__ import annotations

from typing import NamedTuple

from rotor_mbs.report.language import texts

# Okabe & Ito's colours, told apart by the colour-blind; the yellow is left out, it does not show on white.
COLOURS = ("#000000", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
GREY = "#666666"


class Look(NamedTuple):
    """A line and a mark."""

    colour: str
    line: str
    marker: str


NAMES = {
    "printed/ode45": "as printed, ode45",
    "printed_e1/ode45": "E1 alone, ode45",
    "printed_e2/ode45": "E2 alone, ode45",
    "printed_e3/ode45": "E3 alone, ode45",
    "lagrange/taylor": "closed form, Taylor",
    "lagrange/ode45": "closed form, Dormand-Prince 5(4)",
    "lagrange/dop853": "closed form, DOP853",
    "lagrange/radau": "closed form, Radau",
    "exudyn_tree/rk44": "Exudyn tree, RK44",
    "exudyn_tree/rk67": "Exudyn tree, RK67",
    "exudyn_tree/dopri5": "Exudyn tree, DOPRI5",
    "exudyn_tree/generalized_alpha": "Exudyn tree, generalized-α",
    "exudyn_chain/generalized_alpha": "Exudyn chain, generalized-α",
    "exudyn_chain/newmark_index2": "Exudyn chain, Newmark index 2",
    "reference": "reference, quad precision",
}

# The four methods of a reproduction; any others take what is left, in turn.
_LOOKS = {
    "printed/ode45": Look("#000000", "-", "x"),
    "lagrange/taylor": Look("#0072b2", "-", "o"),
    "exudyn_tree/rk67": Look("#d55e00", "--", "s"),
    "exudyn_chain/generalized_alpha": Look("#009e73", "-.", "^"),
}
_OTHERS = (
    Look("#cc79a7", "-", "D"),
    Look("#e69f00", "--", "v"),
    Look("#56b4e9", "-.", "P"),
    Look(GREY, "-", "*"),
)


def name_of(method: str) -> str:
    return texts.METHOD_NAMES.get(method, method)


def looks(methods: list[str]) -> dict[str, Look]:
    """A look for each, all different for up to eight."""
    others = [method for method in methods if method not in _LOOKS]
    rest = {method: _OTHERS[i % len(_OTHERS)] for i, method in enumerate(others)}
    return {method: _LOOKS.get(method) or rest[method] for method in methods}


def coordinate_look(index: int) -> tuple[str, str | tuple[float, tuple[float, ...]]]:
    """Colour and line of a coordinate: 0 the rotor, i the pitch (and the tip) of blade i."""
    dashes = ("-", (0, (5, 1.5)), (0, (6, 1.5, 1.5, 1.5)))
    line = "-" if index == 0 else dashes[(index - 1) % 3]
    return COLOURS[index % len(COLOURS)], line
