"""A scene for other programs: for MuJoCo, for Exudyn, its reference trajectory as CSV."""

from __future__ import annotations

import csv
import io
import itertools
import os
from collections.abc import Callable
from pathlib import Path

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.exudyn.script import exudyn_script
from rotor_mbs.models.mujoco.mjcf import mjcf_file
from rotor_mbs.runs.files import refuse_foreign, replace_file
from rotor_mbs.scenario.catalogue import scene_of
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution import quantities
from rotor_mbs.studies.stored_references import frozen_solution


def export(scene: Scene | str, to: str, output: str | os.PathLike[str]) -> list[Path]:
    """Write a scene in a format of other programs.

    Parameters
    ----------
    to : "mjcf", "exudyn" or "csv" (the reference trajectory, with units).
    output : the file; an earlier one of the same format is replaced.

    Returns
    -------
    The paths that were written.

    Raises
    ------
    InputError
        For an unknown format, or where `output` is another file.
    StoreError
        Where a file cannot be written, or a reference is needed that the scene does not have.

    Examples
    --------
    >>> import tempfile
    >>> import rotor_mbs as rm
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     (path,) = rm.export("paper/fig11", "csv", f"{folder}/fig11.csv")
    ...     print(path.read_text().partition(",rotor rate")[0])
    time [s],rotor [rad],pitch 1 [rad],pitch 2 [rad],pitch 3 [rad]
    """
    scene, output = scene_of(scene), Path(output)
    if to not in FORMATS:
        raise InputError(f"no format {to!r}; allowed: {', '.join(FORMATS)}")
    _, text_of, mark = FORMATS[to]
    refuse_foreign(output, mark)  # before a reference is computed
    replace_file(output, text_of(scene).encode(), mark)
    return [output]


def reference_csv(scene: Scene) -> str:
    """The scene's reference, shipped or computed, as comma-separated values. StoreError where it does not begin."""
    solution = frozen_solution(scene) or solve(REFERENCE, scene, {})
    trajectory = solution.trajectory
    if not len(trajectory.time):
        raise StoreError(f"{scene.name}: no reference: {solution.integration.message or 'no motion from its start'}")
    blades = [f"{blade}" for blade in range(1, 1 + len(scene.blades))]
    labels = {"coordinate": scene.coordinate_labels, "blade": blades, "axis": "xyz"}
    columns = {"time [s]": trajectory.time}
    for quantity in quantities.quantities(scene.outputs):
        values = quantities.array_of(quantity, scene, trajectory) if quantity.is_over_time else None
        if values is None:
            continue
        parts = itertools.product(*(labels[dimension] for dimension in quantity.dimensions[1:]))
        for part, column in zip(map(" ".join, parts), values.reshape(len(values), -1).T, strict=True):
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


# By format: the ending of the file's name; its text; what is found in every such text.
FORMATS: dict[str, tuple[str, Callable[[Scene], str], bytes]] = {
    "mjcf": (".xml", mjcf_file, rb"\A<mujoco model=[^\0]*Start from the keyframe: mj_resetDataKeyframe"),
    "exudyn": (
        "-exudyn.py",
        exudyn_script,
        rb"\A\"\"\"[^\0]*A rotor as a kinematic tree in Exudyn: the hub turns about y",
    ),
    "csv": (".csv", reference_csv, rb"\Atime \[s\],.*,error growth \[1\]\n"),
}
