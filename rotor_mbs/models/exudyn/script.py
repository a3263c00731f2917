"""A scene as a Python script for Exudyn alone, the kinematic tree with the same step; its text is `script.py.txt`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from rotor_mbs.models.exudyn import tree
from rotor_mbs.models.exudyn.geometry import LISTS, Ref, pitching
from rotor_mbs.models.exudyn.moments import Loads, Moment
from rotor_mbs.scenario.scene import Scene

_STEP = 6.7e-4  # s, the largest time step: the default of exudyn_tree/rk67

_COMMENTS = {  # by kind; parts of another kind are left out
    "node": "joint angles (rad) and rates (rad/s) that move, and their initial values",
    "object": "hub and blades: kg, m, inertia about centres of mass kg m^2; springs N m/rad, dampers N m s/rad",
    "marker": "where a torque acts",
    "load": "torque, N m",
}


def exudyn_script(scene: Scene) -> str:
    parts = [part for part in tree.parts(scene, Loads(scene)) if part.kind in _COMMENTS]
    moving = [0, *(1 + i for i in pitching(scene))]
    calls = []
    for part in parts:
        arguments = "".join(f"    {key}={_argument(key, value)},\n" for key, value in part.parameters.items())
        call = f"number[{part.kind!r}, {part.name!r}] = mbs.Add{part.kind.capitalize()}({part.type}("
        calls.append(f"# {_COMMENTS[part.kind]}\n{call}\n{arguments}))")
    template = Path(__file__).with_name("script.py.txt").read_text(encoding="utf-8")
    return Template(template).substitute(
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
        parts="\n".join(calls),
    )


def _argument(key: str, value: Any) -> str:
    if isinstance(value, Ref):
        return f"number[{value.kind!r}, {value.name!r}]"
    if callable(value):
        moment: Moment = value.__self__
        terms = []
        for load, factor in moment.terms:
            term = f"now({load}, time)"
            terms.append(term if factor == 1.0 else f"{factor!r} * {term}")
        return f"lambda system, time, load: {' + '.join(terms)}"
    if key == "jointTypes":
        return f"[{', '.join(f'exu.JointType.{name}' for name in value)}]"
    return f"exu.{LISTS[key]}({_value(value)})" if key in LISTS else _value(value)


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
