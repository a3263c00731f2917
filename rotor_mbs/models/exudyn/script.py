"""A scene as a Python script for Exudyn that needs nothing of this package: the kinematic tree, the same step.

Knows the tree's parts and the engine's names as words only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from string import Template
from typing import Any

import numpy as np

from rotor_mbs.models.exudyn import tree
from rotor_mbs.models.exudyn.blueprint import Part, Ref
from rotor_mbs.models.exudyn.geometry import pitching
from rotor_mbs.models.exudyn.moments import Loads, Moment
from rotor_mbs.scenario.scene import Scene

_STEP = 6.7e-4  # s, the largest time step: the default of exudyn_tree/rk67

_KINDS = ("node", "object", "marker", "load")

_COMMENTS = {
    "node": "joint angles (rad) and rates (rad/s) that move, and their initial values",
    "object": "hub and blades: kg, m, inertia about centres of mass kg m^2; springs N m/rad, dampers N m s/rad",
    "marker": "where a torque acts",
    "load": "torque, N m",
}


def exudyn_script(scene: Scene) -> str:
    """The text of the script."""
    parts = [part for part in tree.parts(scene, Loads(scene)) if part.kind in _KINDS]
    moving = [0, *(1 + i for i in pitching(scene))]
    return _SCRIPT.substitute(
        title=(scene.title or scene.name).replace("\\", "/").replace('"', "'"),
        step=repr(_STEP),
        types=", ".join(dict.fromkeys(part.type for part in parts)),
        duration=repr(float(scene.duration)),
        samples=scene.samples,
        loads=_value([[list(map(float, row)) for row in table] for table in scene.load_tables]),
        labels=_value(list(scene.coordinate_labels)),
        angles=_value(list(map(float, scene.initial_angles))),
        rates=_value([float(rate) if i in moving else 0.0 for i, rate in enumerate(scene.initial_rates)]),
        moving=_value(moving),
        parts="\n".join(_lines(part) for part in parts),
    )


def _lines(part: Part) -> str:
    arguments = "".join(f"    {key}={_argument(key, value)},\n" for key, value in part.parameters.items())
    call = f"number[{part.kind!r}, {part.name!r}] = mbs.Add{part.kind.capitalize()}({part.type}("
    return f"# {_COMMENTS[part.kind]}\n{call}\n{arguments}))"


def _argument(key: str, value: Any) -> str:
    if isinstance(value, Ref):
        return f"number[{value.kind!r}, {value.name!r}]"
    if callable(value):
        moment: Moment = value.__self__
        sums = (f"{'' if factor == 1.0 else f'{factor!r} * '}now({load}, time)" for load, factor in moment.terms)
        return f"lambda system, time, load: {' + '.join(sums)}"
    if key == "jointTypes":
        return f"[{', '.join(f'exu.JointType.{name}' for name in value)}]"
    return _TYPES.get(key, "{}").format(_value(value))


# What the engine wants in its own types, by the name of the argument.
_TYPES: Mapping[str, str] = {
    "jointTransformations": "exu.Matrix3DList({})",
    "linkInertiasCOM": "exu.Matrix3DList({})",
    "jointOffsets": "exu.Vector3DList({})",
    "linkCOMs": "exu.Vector3DList({})",
}


def _value(value: object) -> str:
    """Numbers with all their digits; matrices as arrays, a row of a list on its own line where it is nested."""
    if isinstance(value, np.ndarray):
        return f"np.array({value.tolist()!r})"
    if isinstance(value, np.generic):
        return repr(value.item())
    if isinstance(value, str) or not isinstance(value, Sequence):
        return repr(value)
    items = [_value(item) for item in value]
    if any(isinstance(item, (Sequence, np.ndarray)) and not isinstance(item, str) for item in value):
        return "[\n" + "".join(f"        {item},\n" for item in items) + "    ]"
    return "[" + ", ".join(items) + "]"


_SCRIPT = Template('''"""$title

A rotor as a kinematic tree in Exudyn: the hub turns about y, each blade about its own z, z is up. SI units, rad.
Needs exudyn and numpy. Writes time, angles and rates at the samples:

    python THIS_FILE [OUTPUT.csv]     (default: trajectory.csv)
"""

import csv
import itertools
import math
import sys
from types import SimpleNamespace

import exudyn as exu
import numpy as np
from exudyn.itemInterface import $types

DURATION, SAMPLES = $duration, $samples  # s, both ends included
STEP = $step  # s, largest time step of Butcher's Runge-Kutta method of order 6 with 7 stages

# Rotor torque (N m), then torque (N m) and rest angle of the spring (rad) of each pitch, over time, s: linear between
# rows, constant outside; two rows with one time are a jump.
LOADS = $loads

LABELS = $labels
MOVING = $moving  # coordinates that move; a blade without inertia about its pitch axis stays at its initial pitch
INITIAL_ANGLES = $angles  # rad
INITIAL_RATES = $rates  # rad/s

# The interval that is being integrated, s.
interval = SimpleNamespace(start=0.0, end=DURATION)


def now(number, time):
    """Load at `time`, as it is inside the interval: no row of a table lies there."""
    before = [row for row in LOADS[number] if row[0] <= interval.start]
    after = [row for row in LOADS[number] if row[0] >= interval.end]
    if not before or not after:
        return (before[-1] if before else after[0])[1]
    (t0, load0), (t1, load1) = before[-1], after[0]
    return load0 + (load1 - load0) / (t1 - t0) * (time - t0)


system = exu.SystemContainer()
mbs = system.AddSystem()
number = {}

$parts

mbs.Assemble()


def advance(start, end):
    """From one stop to the next: samples and kinks of the loads, over which no step may run."""
    interval.start, interval.end = start, end
    integration.startTime, integration.endTime = start, end
    integration.numberOfSteps = max(1, math.ceil((end - start) / STEP * (1.0 - 1e-9)))
    # The end of one interval is the start of the next.
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.RK67, updateInitialValues=True)


def row(time):
    """Time, all angles, all rates."""
    data = mbs.systemData
    angles, rates = np.array(INITIAL_ANGLES), np.zeros(len(LABELS))
    angles[MOVING] = data.GetODE2Coordinates()
    rates[MOVING] = data.GetODE2Coordinates_t()
    return [time, *angles.tolist(), *rates.tolist()]


settings = exu.SimulationSettings()
settings.solution.file.write = False
settings.show.statistics = settings.show.computationTime = False
integration = settings.timeIntegration
integration.verboseMode = 0
integration.adaptiveStep = False
integration.explicit.computeEndOfStepAccelerations = False
integration.explicit.useLieGroupIntegration = False

samples = np.linspace(0.0, DURATION, SAMPLES).tolist()
spacing = DURATION / (SAMPLES - 1)
times = {time for rows in LOADS for time, _ in rows}
kinks = {time for time in times if 0.0 < time < DURATION and min(time % spacing, -time % spacing) > 1e-6 * spacing}
stops = sorted({*samples, *kinks})

rows = [[0.0, *INITIAL_ANGLES, *INITIAL_RATES]]
for start, end in itertools.pairwise(stops):
    advance(start, end)
    if end not in kinks:
        rows.append(row(end))

with open(sys.argv[1] if len(sys.argv) > 1 else "trajectory.csv", "w", newline="") as output:
    writer = csv.writer(output)
    rates = [f"{label} rate [rad/s]" for label in LABELS]
    writer.writerow(["time [s]", *(f"{label} [rad]" for label in LABELS), *rates])
    writer.writerows([repr(value) for value in values] for values in rows)
''')
