"""Read references from results files: shipped references, and those that a study has stored."""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.methods.catalogue import REFERENCE, find_method
from rotor_mbs.runs.design import MISSING, REFERENCE_ARRAYS, RUNS
from rotor_mbs.runs.hdf5 import read_arrays
from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.rows import RowLocation
from rotor_mbs.runs.versions import row_versions
from rotor_mbs.scenario.catalogue import REFERENCES
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.solution.quantities import sample_times
from rotor_mbs.solution.trajectory import Integration, Solution, Trajectory


def shipped_files() -> list[Path]:
    """Return the paths of the shipped files of references, sorted."""
    return sorted(REFERENCES.glob("*.h5"))


class ShippedReference(NamedTuple):
    """Hold the location of the shipped reference of a scene.

    Attributes
    ----------
    path : the file.
    scene : name of the scene in the file.
    frozen_with : versions of the software that computed the reference.
    """

    path: Path
    scene: str
    frozen_with: str


def shipped_reference(scene_hash: str) -> ShippedReference | None:
    """Return the shipped reference of the scene with this hash; None if there is none."""
    return _shipped_by_hash(tuple(shipped_files())).get(scene_hash)


@functools.cache
def _shipped_by_hash(files: tuple[Path, ...]) -> dict[str, ShippedReference]:
    """Return the shipped references in these files, by the hash of their scene."""
    by_hash: dict[str, ShippedReference] = {}
    for path in files:
        # Only three columns are read: reading the whole table takes ten times as long, and every
        # process that runs a scene calls this function.
        columns = read_arrays(path, RUNS, ("scene_hash", "scene", "versions"))
        for digest, scene, made_with in zip(*map(np.ndarray.tolist, columns.values()), strict=True):
            frozen_with = json.loads(made_with)["frozen_with"]
            by_hash[digest] = ShippedReference(path, scene, frozen_with)
    return by_hash


def shipped_versions(scene_hash: str) -> dict[str, str] | None:
    """Return the `versions` of a row with the shipped reference of a scene.

    None is returned if no reference of the scene with this hash is shipped.
    """
    shipped = shipped_reference(scene_hash)
    if shipped is None:
        return None
    source = {"frozen_with": shipped.frozen_with, "frozen_file": _digest(shipped.path)[:12]}
    return row_versions(find_method(REFERENCE)) | source


@functools.cache
def _digest(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def read_reference(place: RowLocation, scene: Scene) -> Trajectory | None:
    """Return the reference of a scene in a results file; None if it is missing or has no samples.

    Parameters
    ----------
    place : location of the row of the reference.
    scene : the scene, with the sample times and the quantities that are returned.
    """
    row = place.read()
    samples = int(row["samples"][0])
    if int(row["status"][0]) == MISSING or samples <= 0:
        return None
    arrays = {name: row[name][0][:samples] for name in REFERENCE_ARRAYS if name in row}
    return rebuilt_reference(scene, {"time": sample_times(scene)[:samples], **arrays})


def rebuilt_reference(scene: Scene, arrays: Mapping[str, NDArray[Any]]) -> Trajectory:
    """Return a stored reference with all quantities that its scene requests.

    Quantities that are not stored are computed by the closed form from the angles and rates.

    Parameters
    ----------
    scene : the scene of the reference.
    arrays : `time` and the arrays in `REFERENCE_ARRAYS` that are stored, by name.
    """
    from rotor_mbs.models.lagrange import samples

    # A row has NaN at all samples of an array that the reference does not have.
    known = {name: values for name, values in arrays.items() if not np.isnan(values[:1]).all()}
    moving = scene.moving_coordinates
    states = np.hstack([known["angles"][:, moving], known["rates"][:, moving]])
    reference = samples.trajectory(scene, known["time"], states)
    reference.quantities |= {name: known[name] for name in REFERENCE_ARRAYS[2:] if name in known}
    return reference


def frozen_solution(scene: Scene) -> Solution | None:
    """Return the shipped reference of a scene; None if there is none.

    Its settings and run times are those of its computation. Its arrays are shared by all callers,
    and read-only.

    Raises
    ------
    StoreError
        If its file cannot be read.
    """
    shipped = shipped_reference(scene_hash(scene))
    return None if shipped is None else _read_shipped(shipped, scene)


@functools.lru_cache(maxsize=32)
def _read_shipped(shipped: ShippedReference, scene: Scene) -> Solution:
    """Read a shipped reference, and make its arrays read-only.

    Parameters
    ----------
    shipped : location of the reference.
    scene : the scene of the reference.
    """
    with open_results(shipped.path, only=[shipped.scene]) as results:
        stored = results.scenes[shipped.scene].reference
        assert stored is not None  # a file of references has one for each scene
        facts, settings = stored.attributes, stored.settings
        arrays = {
            name: stored.array(name) for name in ("time", *REFERENCE_ARRAYS) if name in stored
        }
    # This is outside the block above, which would report an error of this code as a damaged file.
    trajectory = rebuilt_reference(scene, arrays)
    for values in (
        trajectory.time,
        trajectory.angles,
        trajectory.rates,
        *trajectory.quantities.values(),
    ):
        values.flags.writeable = False
    is_complete = len(trajectory.time) == scene.samples
    engine = Integration(
        is_complete,
        "" if is_complete else "the frozen reference ends early",
        facts["time_reached"],
        facts["steps"],
        out_of_time=facts["status"] == "timed_out",
    )
    times = (facts["setup_time_s"], [facts["run_time_s"]], facts["output_time_s"])
    return Solution(scene, REFERENCE, trajectory, engine, settings, *times)
