"""The equations of motion of a scene as the text of a SymPy program, written by the closed form's own energies.

The closed form takes numbers of any kind; here a number is a piece of text. The program around them is
`sympy.py.txt`. Imports no SymPy.
"""

from __future__ import annotations

from pathlib import Path
from string import Template

from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.closed_form import load_values
from rotor_mbs.models.lagrange.parameters import load_segments, load_tables, rotor_form
from rotor_mbs.models.symbols import CodeSymbol
from rotor_mbs.scenario.scene import Scene


def sympy_text(scene: Scene) -> str:
    """A Python program that defines, in SymPy, the equations of motion M(q) a = f(q, w, t) of a scene.

    q, w, a are angles (rad), rates and accelerations of the coordinates that move, rotor first. The program defines
    the kinetic and potential energy T and V (J), the torque tau (N m) over time t (s), the generalized forces Q (N m)
    of torques and dampers, the mass matrix M and the right-hand side f by Lagrange's equations, and the initial state.
    """
    form = rotor_form(scene)
    moving = scene.moving_coordinates
    q, w = ([CodeSymbol(f"{name}{i}") for i in moving] for name in "qw")
    tables = load_tables(scene)
    names = ["tau", *(f"tau{i}" for i in moving[1:]), *(f"rest{i}" for i in moving[1:])]
    values = [CodeSymbol(name) if table else 0.0 for name, table in zip(names, tables, strict=True)]
    loads = load_values([CodeSymbol("tau"), *values[1:]])
    kinetic, potential = closed_form.energies(
        q, w, form, loads, lambda x: CodeSymbol(f"sin({x})"), lambda x: CodeSymbol(f"cos({x})")
    )
    dampings = [form.shaft_damping, *(blade.damping for blade in form.blades)]
    moments = [loads.rotor, *loads.pitches]
    forces = [moment - damping * rate for moment, damping, rate in zip(moments, dampings, w, strict=True)]
    template = Path(__file__).with_name("sympy.py.txt").read_text(encoding="utf-8")
    return Template(template).substitute(
        title=(scene.title or scene.name).replace("\n", " "),
        names=", ".join(f"{name}{i}" for name in "qw" for i in moving),
        letters=" ".join(f"{name}{i}" for name in "qw" for i in moving),
        legend="\n".join(f"#   q{i}, w{i}   {scene.coordinate_labels[i]}" for i in moving),
        q=", ".join(f"q{i}" for i in moving),
        w=", ".join(f"w{i}" for i in moving),
        loads="\n".join(f"{name} = {_over_time(scene, i)}" for i, name in enumerate(names) if i == 0 or tables[i]),
        kinetic=kinetic,
        potential=potential,
        forces=", ".join(map(str, forces)),
        initial_angles=[float(scene.initial_angles[i]) for i in moving],
        initial_rates=[float(scene.initial_rates[i]) for i in moving],
        duration=repr(float(scene.duration)),
    )


def _over_time(scene: Scene, load: int) -> str:
    """A load over time, piecewise linear; at a jump, the value after it."""
    lines = [(part.lines[load], part.end) for part in load_segments(scene)]
    texts = [
        (f"{float(offset)!r} + {float(slope)!r}*t" if slope else repr(float(offset)), end)
        for (offset, slope), end in lines
    ]
    if len({line for line, _ in lines}) == 1:
        return f"sympify({texts[0][0]})"
    parts = [f"({text}, t < {end!r})" for text, end in texts[:-1]] + [f"({texts[-1][0]}, True)"]
    return f"Piecewise({', '.join(parts)})"
