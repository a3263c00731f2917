"""References read from results files: those shipped with the package, and those computed beside the runs of a study."""

from __future__ import annotations

import functools
import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.errors import StoreError
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.runs.read import StoredRun, open_results
from rotor_mbs.scenario.catalogue import reference_folder
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.quantities import LOADS
from rotor_mbs.solution.solution import Solution
from rotor_mbs.solution.trajectory import Integration, Trajectory

_SHORT = 5001  # samples: at some 30 numbers each, twenty references take 25 MB at most


def shipped_files() -> list[Path]:
    """The files of frozen references."""
    return sorted(reference_folder().glob("*.h5"))


def frozen_file(scene_hash: str) -> Path | None:
    """The shipped file with the reference of the scene of that hash; None where there is none."""
    return _files_by_hash(tuple(shipped_files())).get(scene_hash)


@functools.cache
def _files_by_hash(files: tuple[Path, ...]) -> dict[str, Path]:
    found: dict[str, Path] = {}
    for path in files:
        with open_results(path) as results:
            found |= {str(scene.attributes["scene_hash"]): path for scene in results.scenes.values()}
    return found


@functools.cache
def digest(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def load_reference(path: Path, scene: Scene) -> Trajectory | None:
    """The reference of `scene` in a results file, not to be changed; None where there is none, or where it is empty.

    Short ones stay in memory: a process judges runs of one scene by many methods.
    """
    state = path.stat() if path.is_file() else None
    load = _load_reference if scene.samples <= _SHORT else _load_reference.__wrapped__
    return load(path, state and (state.st_ino, state.st_mtime_ns, state.st_size), scene)


@functools.lru_cache(maxsize=20)
def _load_reference(path: Path, _state: object, scene: Scene) -> Trajectory | None:
    with open_results(path) as results:
        stored = results.scenes[scene.name].reference if scene.name in results.scenes else None
        if stored is None or not len(stored.array("time")):
            return None
        return rebuilt_reference(scene, stored)


def rebuilt_reference(scene: Scene, stored: StoredRun) -> Trajectory:
    """A stored reference with what its scene asks for, computed from its angles and rates by its own closed form."""
    from rotor_mbs.models.lagrange import samples

    angles, rates = stored.array("angles"), stored.array("rates")
    moving = scene.moving_coordinates
    result = samples.trajectory(scene, stored.array("time"), np.hstack([angles[:, moving], rates[:, moving]]))
    if "work" in stored:
        result.work = stored.array("work")
    result.angle_uncertainty = stored.array("angle_uncertainty")
    result.error_growth = stored.get("error_growth")
    result.quantities |= {load.name: stored.array(load.name) for load in LOADS if load.name in stored}
    return result


def frozen_solution(scene: Scene, scene_hash: str) -> tuple[Solution, dict[str, Any]]:
    """The shipped reference of a scene, with the settings and times of when it was computed; and who computed it.

    Raises StoreError where none is shipped.
    """
    path = frozen_file(scene_hash)
    if path is None:
        raise StoreError(f"{reference_folder()}: no frozen reference of {scene.name}; `rotor-mbs reference` makes one")
    with open_results(path) as results:
        stored = next(s for s in results.scenes.values() if s.attributes["scene_hash"] == scene_hash).reference
        assert stored is not None  # a file of references has one for each scene
        facts = stored.attributes
        trajectory = rebuilt_reference(scene, stored)
        is_complete = len(trajectory.time) == scene.samples
        engine = Integration(
            is_complete,
            "" if is_complete else "the frozen reference ends here",
            facts["time_reached"],
            facts["steps"],
            out_of_time=facts["status"] == "timed_out",
        )
        times = (facts["setup_time_s"], [facts["run_time_s"]], facts["output_time_s"])
        return Solution(scene, REFERENCE, trajectory, engine, stored.settings, *times), {
            "frozen_with": facts["frozen_with"]
        }
