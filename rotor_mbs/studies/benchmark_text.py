"""A scene as a benchmark problem: description with data, error definition and acceptance; a program that evaluates it.

Their texts are `templates/description.md` and `templates/evaluate.py.txt`.
What a benchmark problem has to state: https://www.iftomm-multibody.org/benchmark/submit/
"""

from __future__ import annotations

from pathlib import Path
from string import Template

from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.solution.metrics import HORIZON_GROWTH, horizon
from rotor_mbs.solution.trajectory import Trajectory

# rad per unit of error amplification: the largest error that is accepted.
ACCEPTED = 1e-6


def description(scene: Scene, reference: Trajectory) -> str:
    """The problem in Markdown: motivation, data, error definition, acceptance, required results."""
    uncertainty = reference.angle_uncertainty
    return _template("description.md").substitute(
        title=scene.title or scene.name,
        count=len(scene.blades),
        phase=f"2π(i-1)/{len(scene.blades)}",
        gravity=repr(float(scene.gravity)),
        duration=repr(float(scene.duration)),
        samples=scene.samples,
        blades="\n".join(_blade_row(number, blade) for number, blade in enumerate(scene.blades, start=1)),
        hub=repr(float(scene.hub_inertia)),
        shaft=repr(float(scene.shaft_damping)),
        bearings="\n".join(_bearing_row(scene, number) for number in range(len(scene.blades))),
        loads=_loads(scene),
        initial="\n".join(
            f"| {label} | {angle!r} | {rate!r} |"
            for label, angle, rate in zip(
                scene.coordinate_labels, map(float, scene.initial_angles), map(float, scene.initial_rates), strict=True
            )
        ),
        horizon=f"{horizon(reference):g}",
        growth=f"{HORIZON_GROWTH:g}",
        accepted=f"{ACCEPTED:g}",
        uncertainty="unknown" if uncertainty is None else f"{float(uncertainty.max()):.1g} rad",
        end=f"{reference.time[-1]:g}",
    )


def _blade_row(number: int, blade: Blade) -> str:
    centre = ", ".join(repr(float(x)) for x in blade.centre_of_mass)
    inertia = ", ".join(repr(float(x)) for x in blade.inertia)
    tip = ", ".join(repr(float(x)) for x in blade.tip)
    return f"| {number} | {float(blade.mass)!r} | {centre} | {inertia} | {tip} |"


def _bearing_row(scene: Scene, blade: int) -> str:
    stiffness, damping = map(float, scene.bearing(blade))
    return f"| {blade + 1} | {stiffness!r} | {damping!r} |"


def _loads(scene: Scene) -> str:
    """What drives rotor and pitches, a table over time each."""
    names = ["torque on the rotor about +y, N m"]
    for number in range(1, 1 + len(scene.blades)):
        names += [f"torque on pitch {number}, N m", f"pitch {number} at which its spring is unloaded, rad"]
    given = {name: table for name, table in zip(names, scene.load_tables, strict=True) if table}
    if not given:
        return "None."
    parts = [
        "linear between the rows, constant before the first and after the last; two rows with one time are a jump. A\n"
        "torque on a pitch acts between hub and blade."
    ]
    for name, table in given.items():
        rows = "\n".join(f"| {float(time)!r} | {float(value)!r} |" for time, value in table)
        parts.append(f"| time, s | {name} |\n|---|---|\n{rows}")
    return "\n\n".join(parts)


def evaluation_program(scene: Scene) -> str:
    """A program (Python, standard library alone) that computes the error of a results file: accepted or not."""
    return _template("evaluate.py.txt").substitute(
        title=(scene.title or scene.name).replace("\\", "/").replace('"', "'"),
        coordinates=1 + len(scene.blades),
        accepted=f"{ACCEPTED:g}",
        growth=f"{HORIZON_GROWTH:g}",
    )


def _template(name: str) -> Template:
    return Template((Path(__file__).parent / "templates" / name).read_text(encoding="utf-8"))
