"""For tests of `check`: results files made in this process, from true runs or from runs with a
known fault."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

from rotor_mbs.analysis import kinematics
from rotor_mbs.analysis.checks import Check
from rotor_mbs.analysis.judgement import judge
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.exudyn import chain
from rotor_mbs.models.exudyn.geometry import Part
from rotor_mbs.runs.design import RunRequest, results_tables
from rotor_mbs.runs.merge import fit_file_to_request
from rotor_mbs.runs.rows import row_of_run
from rotor_mbs.scenario.accuracy_bounds import Bounds, shipped_bounds
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Solution
from rotor_mbs.studies import check
from rotor_mbs.studies.run import run_scenes
from rotor_mbs.studies.stored_references import read_reference


def results_file(
    path: Path, scenes: Sequence[str], methods: Sequence[str], timeout_s: float = 60.0
) -> Path:
    """A batch as `run` makes it."""
    chosen = find_scenes(scenes)
    run_scenes(
        chosen, {scene.name: methods for scene in chosen}, path, workers=0, timeout_s=timeout_s
    )
    return path


def add_run(path: Path, scene: Scene, run: Solution) -> None:
    """A run into a file that has its scene's reference, judged as a batch judges it."""
    asked = RunRequest(scene, run.method, run.settings)
    file = fit_file_to_request(path, results_tables([asked]))
    judgement = judge(scene, run, read_reference(file.place(f"{scene.name}/{REFERENCE}"), scene))
    run = replace(
        run,
        scene=scene,
        status=judgement.status,
        message=judgement.message,
        metrics=judgement.metrics,
    )
    place = file.place(asked.label)
    place.write(row_of_run(run, place, {"false_success": int(judgement.false_success)}))


def judged(path: Path, bounds: Bounds | None = None) -> list[Check]:
    return check.judge_file(path, bounds or shipped_bounds())


def failed(checks: Sequence[Check]) -> list[Check]:
    return [check for check in checks if not check.passed]


# Known faults: what a method makes of a scene a little wrong, handed in as its answer to the right
# one.


def with_wrong_number(scene: Scene, number: str, share: float) -> Scene:
    """The gravity, the start, or of each blade its mass, its tip, or the offset c of its centre of
    mass from the pitch axis, off by `share` of its size."""
    factor = 1.0 + share
    if number == "gravity":
        return replace(scene, gravity=scene.gravity * factor)
    if number == "start":
        return replace(
            scene, initial_angles=tuple(angle * factor for angle in scene.initial_angles)
        )
    blades = []
    for blade in scene.blades:
        (x, y, z), tip = blade.centre_of_mass, blade.tip
        if number == "mass":
            blades.append(replace(blade, mass=blade.mass * factor))
        elif number == "offset":
            blades.append(replace(blade, centre_of_mass=(x * factor, y * factor, z)))
        else:
            blades.append(replace(blade, tip=(tip[0] * factor, tip[1] * factor, tip[2] * factor)))
    return replace(scene, blades=tuple(blades))


# in place of a share of gravity: the others are left out, and the rest renumbered
EVERY_SECOND_SAMPLE = 2.0

# By the name of a check, the number whose fault it shall see.
WRONG = {
    "offset": "offset", "error": "offset", "energy": "offset",
    "defect": "gravity", "defect median": "gravity",
    "loads": "mass", "exact": "mass", "energies": "mass",
    "tip": "tip", "start": "start",
}  # fmt: skip


def faulty_run(check_name: str, scene: Scene, method: str, share: float) -> Solution:
    """The run of a model that has the fault. For the energy balance: its energies do not have
    it."""
    if check_name == "gap":
        with _wrong_seat(share):
            return solve(method, scene, {})
    if check_name == "defect" and share == EVERY_SECOND_SAMPLE:
        run = solve(method, replace(scene, duration=2.0 * scene.duration), {})
        run.trajectory.time = 0.5 * run.trajectory.time
        return run
    run = solve(method, with_wrong_number(scene, WRONG[check_name], share), {})
    if check_name == "energy":
        motion = run.trajectory
        motion.quantities["kinetic_energy"] = kinematics.kinetic_energy(
            scene, motion.angles, motion.rates
        )
        motion.quantities["potential_energy"] = kinematics.potential_energy(
            scene, motion.time, motion.angles
        )
    return run


@contextlib.contextmanager
def _wrong_seat(share: float) -> Iterator[None]:
    """The blades' own markers at the bearings off by `share` of their distance from the centre of
    mass.

    They are put there once the bodies' places are known: what is off is where the joint holds, not
    where the body is.
    """
    right = chain.parts

    def wrong(*arguments: Any) -> list[Part]:
        built = right(*arguments)
        for number, part in enumerate(built):
            if part.kind == "marker" and part.name.endswith(" at bearing"):
                turned, position = part.parameters["localHT"]
                moved = {**part.parameters, "localHT": (turned, position * (1.0 + share))}
                built[number] = replace(part, parameters=moved)
        return built

    with mock.patch.object(chain, "parts", wrong):
        yield
