"""A scene for other programs: for MuJoCo, Exudyn and SymPy, its reference trajectory, a benchmark problem.

What a benchmark problem has to state: https://www.iftomm-multibody.org/benchmark/submit/
"""

from __future__ import annotations

import csv
import io
import itertools
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import jinja2
import numpy as np

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.exudyn.script import exudyn_script
from rotor_mbs.models.lagrange.sympy_text import sympy_text
from rotor_mbs.models.mujoco.mjcf import mjcf_file
from rotor_mbs.runs.files import replace_file
from rotor_mbs.scenario.catalogue import scene_of
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.scenario.scene_file import scene_toml
from rotor_mbs.solution import quantities
from rotor_mbs.solution.metrics import HORIZON_GROWTH, horizon
from rotor_mbs.solution.quantities import Array
from rotor_mbs.solution.trajectory import Trajectory
from rotor_mbs.studies.stored_references import frozen_solution, shipped_reference

_ACCEPTED = 1e-6  # rad per unit of error amplification: the largest error that a benchmark problem accepts


def export(scene: Scene | str, to: str, output: str | os.PathLike[str]) -> list[Path]:
    """A scene in a format of other programs, as a file or, for "iftomm", a folder of files.

    Parameters
    ----------
    to : "mjcf", "exudyn", "csv" (the reference trajectory, with units), "sympy" (the equations) or "iftomm" (a
        benchmark problem: description, error definition, acceptance, results).
    output : the file or folder; files that are there are replaced.

    Returns
    -------
    The paths that were written.

    Raises
    ------
    InputError
        For an unknown format.
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
    text_of = FORMATS[to][1]
    texts = {output: text_of(scene)} if text_of else {output / name: text for name, text in _benchmark(scene).items()}
    for path, text in texts.items():
        replace_file(path, text.encode())
    return list(texts)


def reference_of(scene: Scene) -> Trajectory:
    """The scene's reference: the shipped one, else computed. Raises StoreError where it does not reach the end."""
    is_shipped = shipped_reference(scene_hash(scene)) is not None
    solution = frozen_solution(scene) if is_shipped else solve(REFERENCE, scene, {})
    if not len(solution.trajectory.time):
        raise StoreError(f"{scene.name}: no reference: {solution.integration.message or 'no motion from its start'}")
    return solution.trajectory


def trajectory_csv(scene: Scene, trajectory: Trajectory) -> str:
    """Comma-separated values with a header: "time [s]", "rotor [rad]", "pitch 1 [rad]", ..., a column per component.

    Numbers have all their digits.
    """
    columns = list(_columns(scene, trajectory))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([name for name, _ in columns])
    for row in zip(*(values.tolist() for _, values in columns), strict=True):
        writer.writerow([repr(value) for value in row])
    return text.getvalue()


def _columns(scene: Scene, trajectory: Trajectory) -> Iterator[tuple[str, Array]]:
    """Name and values of every component, the last dimension fastest."""
    blades = [f"{blade}" for blade in range(1, 1 + len(scene.blades))]
    labels = {"coordinate": scene.coordinate_labels, "blade": blades, "axis": "xyz"}
    yield "time [s]", trajectory.time
    for quantity in quantities.quantities(scene.outputs):
        values = quantities.array_of(quantity, scene, trajectory) if quantity.is_over_time else None
        if values is not None:
            parts = itertools.product(*(labels[dimension] for dimension in quantity.dimensions[1:]))
            for part, column in zip(map(" ".join, parts), values.reshape(len(values), -1).T, strict=True):
                plain = f"{quantity.name.replace('_', ' ')} {part}".rstrip()
                name = {"angles": part, "rates": f"{part} rate"}.get(quantity.name, plain)
                yield f"{name} [{quantity.units}]", column


def _benchmark(scene: Scene) -> dict[str, str]:
    """Texts of a benchmark problem by file name: description, reference, error and acceptance as a program, models."""
    trajectory = reference_of(scene)
    return {
        "description.md": _rendered("description.md.j2", scene, trajectory),
        "reference.csv": trajectory_csv(scene, trajectory),
        "results.txt": _results(scene, trajectory),
        "evaluate.py": _rendered("evaluate.py.j2", scene, trajectory),
        "scene.toml": scene_toml(scene),
        "model.xml": mjcf_file(scene),
        "model_exudyn.py": exudyn_script(scene),
        "equations.py": sympy_text(scene),
    }


def _rendered(template: str, scene: Scene, reference: Trajectory) -> str:
    """The text by templates/`template`; numbers have all their digits, but for those that follow from the reference."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
    environment.filters["exact"] = lambda values: ", ".join(repr(float(value)) for value in np.ravel(values))
    environment.filters["short"] = "{:g}".format
    names = ["torque on the rotor about +y, N m"]
    for number in range(1, 1 + len(scene.blades)):
        names += [f"torque on pitch {number}, N m", f"pitch {number} at which its spring is unloaded, rad"]
    return environment.get_template(template).render(
        scene=scene,
        loads=[(name, table) for name, table in zip(names, scene.load_tables, strict=True) if table],
        reference=reference,
        horizon=horizon(reference),
        growth=HORIZON_GROWTH,
        accepted=_ACCEPTED,
    )


def _results(scene: Scene, trajectory: Trajectory) -> str:
    """The results that a participant hands in: time and angles, in columns of text with a header."""
    names = ["time[s]", *(f"{label.replace(' ', '_')}[rad]" for label in scene.coordinate_labels)]
    rows = ([time, *angles] for time, angles in zip(trajectory.time.tolist(), trajectory.angles.tolist(), strict=True))
    return "\n".join([" ".join(names), *(" ".join(map(repr, row)) for row in rows)]) + "\n"


# By format: the ending of the file's name, "" of a folder; its text, None of a folder.
FORMATS: dict[str, tuple[str, Callable[[Scene], str] | None]] = {
    "mjcf": (".xml", mjcf_file),
    "exudyn": ("-exudyn.py", exudyn_script),
    "csv": (".csv", lambda scene: trajectory_csv(scene, reference_of(scene))),
    "sympy": ("-equations.py", sympy_text),
    "iftomm": ("", None),
}
