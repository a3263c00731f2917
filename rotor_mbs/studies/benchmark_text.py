"""A scene as a benchmark problem: description with data, error definition and acceptance; a program that evaluates it.

What a benchmark problem has to state: https://www.iftomm-multibody.org/benchmark/submit/
"""

from __future__ import annotations

from string import Template

from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.solution.metrics import HORIZON_GROWTH, horizon
from rotor_mbs.solution.trajectory import Trajectory

# rad per unit of error amplification: the largest error that is accepted.
ACCEPTED = 1e-6


def description(scene: Scene, reference: Trajectory) -> str:
    """The problem in Markdown: motivation, data, error definition, acceptance, required results."""
    uncertainty = reference.angle_uncertainty
    return _DESCRIPTION.substitute(
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
    return _EVALUATION.substitute(
        title=(scene.title or scene.name).replace("\\", "/").replace('"', "'"),
        coordinates=1 + len(scene.blades),
        accepted=f"{ACCEPTED:g}",
        growth=f"{HORIZON_GROWTH:g}",
    )


_DESCRIPTION = Template("""\
# $title

## Motivation

A rotor with $count blades that pitch freely is a small mechanism with strong inertial coupling, and often chaotic: a
trajectory can be compared only while the problem's own error amplification is bounded, which the reference states.

## System

SI units; z is up, gravity is $gravity m/s² along -z. A massless or rigid hub turns about the horizontal y axis of the
base frame (rotor angle). Blade i is mounted on it, turned by $phase about y, and turns relative to the hub about its
own z axis (pitch i), which passes through the centre of the hub. Rotation of blade i: Ry(rotor + $phase) Rz(pitch i).
A blade without inertia about its pitch axis is fixed to the hub at its initial pitch.

Points are in the blade's frame; inertia is about the centre of mass, kg m²: xx, yy, zz, xy, xz, yz (xy = -∫xy dm).

| blade | mass, kg | centre of mass, m | inertia, kg m² | tip, m |
|---|---|---|---|---|
$blades

Hub: inertia about the shaft $hub kg m²; damping of the shaft $shaft N m s/rad.

| pitch bearing | stiffness, N m/rad (unloaded at pitch 0, or as below) | damping, N m s/rad |
|---|---|---|
$bearings

## Forces

Gravity, springs and dampers as above. Loads over time: $loads

## Initial conditions

| coordinate | angle, rad | rate, rad/s |
|---|---|---|
$initial

## Simulation

Forward dynamics over $duration s; $samples equally spaced samples, both ends included. Objective: the least run time of
an accepted solution.

## Required results

A text file with a header line and the columns time (s), rotor angle, then the pitch of each blade (rad, unwrapped),
separated by blanks, a row per sample. `results.txt` is the reference in that form.

## Error definition

With reference angles r_j(t_i), and the amplification g(t_i) of a small error of the initial state (column
`error growth` of `reference.csv`, its running maximum, at least 1):

    e = max over samples i and coordinates j of |q_j(t_i) - r_j(t_i)| / (g(t_i) s_j(t_i))
    s_j = max(1, how far the rotor has turned from its start, or the largest pitch of any blade, up to t_i)

over all samples before g reaches $growth, which is up to t = $horizon s here.

## Acceptance

A solution is accepted where it has all samples up to there, every number is finite, and e is at most $accepted.
`python evaluate.py YOUR_RESULTS.txt` computes e and ends with status 0 where the solution is accepted.

## Reference

`reference.csv`: quad-precision integration of the equations of motion up to t = $end s; uncertainty of its angles
$uncertainty. `equations.py` has the equations for SymPy, `model.xml` is a model for MuJoCo, `model_exudyn.py` a script
for Exudyn, `scene.toml` the scene for rotor_mbs.
""")

_EVALUATION = Template('''"""$title: the error of a results file, and whether it is accepted.

    python evaluate.py RESULTS.txt
"""

import csv
import math
import pathlib
import sys

COORDINATES = $coordinates
ACCEPTED = $accepted  # rad per unit of error amplification
HORIZON = $growth  # error amplification up to which trajectories are compared


def read_reference():
    with open(pathlib.Path(__file__).with_name("reference.csv"), encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    growth = header.index("error growth [1]")
    return [[float(row[0]), [float(x) for x in row[1 : 1 + COORDINATES]], float(row[growth])] for row in rows]


def read_results(path):
    lines = pathlib.Path(path).read_text(encoding="utf-8").splitlines()[1:]
    try:
        return [[float(x) for x in line.split()] for line in lines if line.strip()]
    except ValueError as fault:
        sys.exit(f"{path}: {fault}; not accepted")


def error(reference, results):
    """The error as in description.md; infinite where a sample or a number is missing."""
    worst, growth, turned, pitched = 0.0, 1.0, 1.0, 1.0
    start = reference[0][1][0]
    for number, (time, angles, now) in enumerate(reference):
        growth = max(growth, now)
        if growth >= HORIZON:
            break
        turned = max(turned, abs(angles[0] - start))
        pitched = max(pitched, *map(abs, angles[1:]))
        row = results[number] if number < len(results) else []
        if len(row) < 1 + COORDINATES or not all(map(math.isfinite, row)) or abs(row[0] - time) > 1e-9 * (1 + time):
            return math.inf
        for number_of_angle, (angle, exact) in enumerate(zip(row[1:], angles)):
            size = pitched if number_of_angle else turned
            worst = max(worst, abs(angle - exact) / (growth * size))
    return worst


if __name__ == "__main__":
    if len(sys.argv) != 2:
        print("usage: python evaluate.py RESULTS.txt", file=sys.stderr)
        sys.exit(2)
    found = error(read_reference(), read_results(sys.argv[1]))
    print(f"error {found:.3e}, accepted up to {ACCEPTED:g}: {'accepted' if found <= ACCEPTED else 'not accepted'}")
    sys.exit(0 if found <= ACCEPTED else 1)
''')
