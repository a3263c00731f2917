"""Export of a scene: a file for MuJoCo or Exudyn, or its reference trajectory as CSV."""

from __future__ import annotations

import csv
import io
import itertools
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from rotor_mbs.errors import InputError, StoreError, shown_value
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.exudyn import tree
from rotor_mbs.models.exudyn.geometry import LISTS, Ref, movable_blades
from rotor_mbs.models.exudyn.loads import Loads, Moment
from rotor_mbs.models.mujoco.mjcf import mjcf_file
from rotor_mbs.runs.output_files import refuse_foreign, replace_file
from rotor_mbs.scenario.catalogue import scene_of
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.toml_file import file_path
from rotor_mbs.solution import quantities
from rotor_mbs.studies.stored_references import frozen_solution


def export(
    scene: Scene | str | os.PathLike[str], to: str, output: str | os.PathLike[str]
) -> list[Path]:
    """Write a scene to a file in the format of another program.

    Parameters
    ----------
    scene : a Scene, the name of a shipped scene, or a TOML file.
    to : "mjcf", "exudyn" or "csv" (the reference trajectory, with units).
    output : the file; an earlier output in the same format is replaced.

    Returns
    -------
    The paths of the written files.

    Raises
    ------
    InputError
        If the format is unknown, or if `output` exists and is not an earlier output in this format.
    StoreError
        If a file cannot be written, or the reference of the scene cannot be computed.
    TypeError
        If `scene` or `output` is neither text nor a path.

    Examples
    --------
    >>> import tempfile
    >>> import rotor_mbs as rm
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     (path,) = rm.export("paper/fig11", "csv", f"{folder}/fig11.csv")
    ...     print(path.read_text().partition(",rotor rate")[0])
    time [s],rotor [rad],pitch 1 [rad],pitch 2 [rad],pitch 3 [rad]
    """
    scene, output = scene_of(scene), file_path(output)
    if to not in FORMATS:
        raise InputError(f"no format {shown_value(to)}; allowed: {', '.join(FORMATS)}")
    _, text_of, mark = FORMATS[to]
    refuse_foreign(output, mark)  # before a reference is computed
    replace_file(output, text_of(scene).encode(), mark)
    return [output]


def reference_csv(scene: Scene) -> str:
    """Return the reference trajectory of a scene as comma-separated values.

    A shipped reference is read; any other is computed.

    Raises
    ------
    StoreError
        If the reference has no samples.
    """
    solution = frozen_solution(scene) or solve(REFERENCE, scene, {})
    trajectory = solution.trajectory
    if not len(trajectory.time):
        raise StoreError(
            f"{scene.name}: no reference: "
            f"{solution.integration.message or 'the motion does not start'}"
        )
    blades = [f"{blade}" for blade in range(1, 1 + len(scene.blades))]
    labels = {"coordinate": scene.coordinate_labels, "blade": blades, "axis": "xyz"}
    columns = {"time [s]": trajectory.time}
    for quantity in quantities.quantities(scene.outputs):
        values = quantities.array_of(quantity, scene, trajectory)
        if values is None:
            continue
        parts = itertools.product(*(labels[dimension] for dimension in quantity.dimensions[1:]))
        for part, column in zip(
            map(" ".join, parts), values.reshape(len(values), -1).T, strict=True
        ):
            if quantity.name == "angles":
                name = part
            elif quantity.name == "rates":
                name = f"{part} rate"
            else:
                name = f"{quantity.name.replace('_', ' ')} {part}".rstrip()
            columns[f"{name} [{quantity.units}]"] = column
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in zip(*(values.tolist() for values in columns.values()), strict=True):
        writer.writerow([repr(value) for value in row])
    return text.getvalue()


_STEP = 6.7e-4  # largest time step of the script, s: the default of exudyn_tree/rk67

# Comment in the script on each part of the model, by kind of part. Parts of other kinds are not
# written.
_COMMENTS = {
    "node": "joint angles (rad) and rates (rad/s) that move, and their initial values",
    "object": (
        "hub and blades: kg, m, inertia about centres of mass kg m^2; springs N m/rad, dampers N m "
        "s/rad"
    ),
    "marker": "where a torque acts",
    "load": "torque, N m",
}


def exudyn_script(scene: Scene) -> str:
    """Return a Python script that computes a scene with Exudyn, without this package.

    The script has the model of `exudyn_tree`, a kinematic tree, and integrates it with steps of at
    most `_STEP`. The text is made from a template.

    Parameters
    ----------
    scene : the scene; its loads become tables in the script.
    """
    parts = [part for part in tree.parts(scene, Loads(scene)) if part.kind in _COMMENTS]
    moving = [0, *(1 + i for i in movable_blades(scene))]
    calls = []
    for part in parts:
        arguments = "".join(
            f"    {key}={_argument(key, value)},\n" for key, value in part.parameters.items()
        )
        call = (
            f"number[{part.kind!r}, {part.name!r}] = mbs.Add{part.kind.capitalize()}({part.type}("
        )
        calls.append(f"# {_COMMENTS[part.kind]}\n{call}\n{arguments}))")
    template = (Path(__file__).parent / "templates" / "exudyn-script.py.txt").read_text(
        encoding="utf-8"
    )
    return Template(template).substitute(
        title=(scene.title or scene.name).replace("\\", "/").replace('"', "'"),
        step=repr(_STEP),
        types=", ".join(dict.fromkeys(part.type for part in parts)),
        duration=repr(float(scene.duration)),
        samples=scene.samples,
        loads=_value(
            [[list(map(float, row)) for row in table] for table in scene.load_tables], indent=0
        ),
        labels=_value(list(scene.coordinate_labels)),
        angles=_value(list(map(float, scene.initial_angles))),
        rates=_value(
            [float(rate) if i in moving else 0.0 for i, rate in enumerate(scene.initial_rates)]
        ),
        moving=_value(moving),
        parts="\n".join(calls),
    )


def _argument(key: str, value: Any) -> str:
    """Return the value of an argument of an Exudyn item as Python source.

    Parameters
    ----------
    key : name of the argument.
    value : a reference to another item, a bound method of a `Moment`, or numbers.
    """
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


def _value(value: object, indent: int = 4) -> str:
    """Return a value as Python source.

    Numbers have all their digits. An array becomes a call of `np.array`. A list that contains lists
    or arrays has a line for each item.

    Parameters
    ----------
    value : a number, a text, an array or a sequence of these.
    indent : indentation of the line in which the value begins, in blanks.
    """
    if isinstance(value, np.ndarray):
        return f"np.array({value.tolist()!r})"
    if isinstance(value, np.generic):
        return repr(value.item())
    if isinstance(value, str) or not isinstance(value, Sequence):
        return repr(value)
    items = [_value(item, indent + 4) for item in value]
    if any(
        isinstance(item, (Sequence, np.ndarray)) and not isinstance(item, str) for item in value
    ):
        margin = " " * indent
        return "[\n" + "".join(f"{margin}    {item},\n" for item in items) + f"{margin}]"
    return "[" + ", ".join(items) + "]"


# Each format has the ending of its file names, the function that returns the text of a scene, and a
# pattern that all its texts contain. A file without the pattern is not replaced.
FORMATS: dict[str, tuple[str, Callable[[Scene], str], bytes]] = {
    "mjcf": (
        ".xml",
        mjcf_file,
        (
            rb"\A<mujoco model=[^\0]*Start from the keyframe: "
            rb"mj_resetDataKeyframe"
        ),
    ),
    "exudyn": (
        "-exudyn.py",
        exudyn_script,
        rb"\A\"\"\"[^\0]*A rotor as a kinematic tree in Exudyn: the hub turns about y",
    ),
    "csv": (".csv", reference_csv, rb"\Atime \[s\],.*,error growth \[1\]\n"),
}
