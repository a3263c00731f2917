"""How each method is called and drawn, the same in every figure and table. Knows no run."""

from __future__ import annotations

from typing import NamedTuple

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

# The one table of looks: every method, and every variant of a method that a bench draws (by the name of its curve).
# Blues the closed form, reds and yellows Exudyn's tree, green and purple its chain; a spectral radius changes the line,
# a kind of node the mark.
LOOKS = {
    "reference": Look(GREY, "-", "*"),
    "printed/ode45": Look("#000000", "-", "x"),
    "printed_e1/ode45": Look("#000000", "--", "<"),
    "printed_e2/ode45": Look("#000000", "-.", ">"),
    "printed_e3/ode45": Look("#000000", ":", "p"),
    "lagrange/taylor": Look("#0072b2", "-", "o"),
    "lagrange/dop853": Look("#0072b2", "--", "D"),
    "lagrange/ode45": Look("#56b4e9", "-", "v"),
    "lagrange/radau": Look("#56b4e9", "--", "*"),
    "exudyn_tree/rk67": Look("#d55e00", "--", "s"),
    "exudyn_tree/dopri5": Look("#d55e00", "-", "<"),
    "exudyn_tree/rk44": Look("#e69f00", "-.", "P"),
    "exudyn_tree/generalized_alpha": Look("#e69f00", "-", "^"),
    "exudyn_tree/generalized_alpha_rho0.7": Look("#e69f00", "--", "^"),
    "exudyn_tree/generalized_alpha_rho1.0": Look("#e69f00", ":", "^"),
    "exudyn_chain/generalized_alpha": Look("#009e73", "-.", "^"),
    "exudyn_chain/generalized_alpha_rho0.7": Look("#009e73", "--", "^"),
    "exudyn_chain/generalized_alpha_rho1.0": Look("#009e73", ":", "^"),
    "exudyn_chain/generalized_alpha_rotation_vector": Look("#009e73", "-.", ">"),
    "exudyn_chain/generalized_alpha_rho0.7_rotation_vector": Look("#009e73", "--", ">"),
    "exudyn_chain/generalized_alpha_rho1.0_rotation_vector": Look("#009e73", ":", ">"),
    "exudyn_chain/newmark_index2": Look("#cc79a7", "-", "D"),
    "exudyn_chain/newmark_index2_rotation_vector": Look("#cc79a7", ":", "p"),
}
_UNKNOWN = Look(GREY, ":", "D")


def name_of(method: str) -> str:
    return NAMES.get(method, method)


def look_of(curve: str) -> Look:
    """Of "model/integrator", or of a variant by the name of its curve; one in grey for what is none of ours."""
    return LOOKS.get(curve, _UNKNOWN)


def coordinate_look(index: int) -> tuple[str, str | tuple[float, tuple[float, ...]]]:
    """Colour and line of a coordinate: 0 the rotor, i the pitch (and the tip) of blade i."""
    dashes = ("-", (0, (5, 1.5)), (0, (6, 1.5, 1.5, 1.5)))
    line = "-" if index == 0 else dashes[(index - 1) % 3]
    return COLOURS[index % len(COLOURS)], line
