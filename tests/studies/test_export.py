"""What is exported runs without this package and moves as the scene does."""

from __future__ import annotations

import csv
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import references
from support.commands import refusal, rotor_mbs
from support.scenes import shipped

import rotor_mbs as rm
from rotor_mbs.methods.solve import solve
from rotor_mbs.solution.metrics import metrics_of
from rotor_mbs.solution.trajectory import Trajectory
from rotor_mbs.studies.export import export
from rotor_mbs.studies.method_test import leaning_blades

# Springs, dampers, full inertia, torque with a jump between samples; blades that cannot pitch;
# point masses, chaotic.
SCENES = ("check/general", "check/held", pytest.param("paper/fig11", marks=pytest.mark.full))

# Steps of one file through plain MuJoCo: torques by the file's own segments, samples every so many
# steps.
PLAIN_MUJOCO = """
import sys
import mujoco, numpy
model = mujoco.MjModel.from_xml_path(sys.argv[1])
data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, 0)
segments = [model.numeric_data[a : a + n] for a, n in zip(model.numeric_adr, model.numeric_size)]
rows = [data.qpos.copy()]
for _ in range(int(sys.argv[2]) - 1):
    for _ in range(int(sys.argv[3])):
        for segment in segments:
            if segment[0] > 0.0 and abs(segment[0] - data.time) < 0.01 * model.opt.timestep:
                data.act[:], data.ctrl[:] = numpy.split(segment[1:], 2)
        mujoco.mj_step(model, data)
    rows.append(data.qpos.copy())
numpy.save(sys.argv[4], rows)
"""


def plain_python(*arguments: object) -> subprocess.CompletedProcess[str]:
    """In a process without this package on its path, with warnings as errors."""
    blocked = (
        "import sys, runpy; sys.modules['rotor_mbs'] = None; sys.argv = "
        f"{[str(a) for a in arguments]!r}; "
    )
    code = blocked + "runpy.run_path(sys.argv[0], run_name='__main__')"
    return subprocess.run(
        [sys.executable, "-I", "-W", "error", "-c", code], capture_output=True, text=True
    )


@pytest.mark.parametrize("name", SCENES)
def test_the_mujoco_file_in_plain_mujoco(name: str, tmp_path: Path) -> None:
    """As this package's own model, to rounding; whose motions are within their bounds."""
    pytest.importorskip("mujoco")
    scene = shipped(name)
    (path,) = export(scene, "mjcf", tmp_path / "scene.xml")
    steps = round(scene.duration / (scene.samples - 1) / 2.5e-4)
    samples = min(200, scene.samples)
    (tmp_path / "program.py").write_text(PLAIN_MUJOCO, encoding="utf-8")
    done = plain_python(tmp_path / "program.py", path, samples, steps, tmp_path / "out.npy")
    assert done.returncode == 0, done.stderr
    moving = [0, *(1 + i for i, blade in enumerate(scene.blades) if blade.has_pitch_inertia)]
    ours = solve("mujoco/rk4", scene, {}).trajectory.angles[:samples, moving]
    assert np.abs(np.load(tmp_path / "out.npy") - ours).max() < 1e-9


@pytest.mark.parametrize(
    "name", [*SCENES, pytest.param("check/pitch-loads", marks=pytest.mark.full)]
)
def test_the_exudyn_script_in_plain_python(name: str, tmp_path: Path) -> None:
    scene, exact = shipped(name), references.reference(name)
    (path,) = export(scene, "exudyn", tmp_path / "scene.py")
    text = path.read_text(encoding="utf-8")
    assert "rotor_mbs" not in text
    # each bracket below its line
    assert text[text.index("\nLOADS = [\n    [") :].partition("],\n]\n")[1]
    done = plain_python(path, tmp_path / "out.csv")
    assert done.returncode == 0, done.stderr
    with (tmp_path / "out.csv").open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    table = np.array(rows, dtype=float)
    count = 1 + len(scene.blades)
    assert header[1 : 1 + count] == [f"{label} [rad]" for label in scene.coordinate_labels]
    found = Trajectory(table[:, 0], table[:, 1 : 1 + count], table[:, 1 + count :])
    assert len(found.time) == scene.samples
    assert metrics_of(replace(scene, outputs=("angles",)), found, exact)["angle_error_max"] < 1e-11
    until = min(100, scene.samples)
    assert np.abs(found.rates[:until] - exact.rates[:until]).max() < 1e-10
    if name == "check/pitch-loads":  # as it is, `compare` reads it
        assert rm.compare(tmp_path / "out.csv", scene).status == "ok"


@pytest.mark.full
def test_tilt_and_cone_are_in_both_files(tmp_path: Path) -> None:
    """Five coned blades on a tilted shaft, against the closed form."""
    pytest.importorskip("mujoco")
    scene = replace(leaning_blades(), outputs=("angles", "rates"), duration=0.2, samples=21)
    exact = solve("lagrange/dop853", scene, {}).trajectory
    (path,) = export(scene, "exudyn", tmp_path / "scene.py")
    done = plain_python(path, tmp_path / "out.csv")
    assert done.returncode == 0, done.stderr
    table = np.loadtxt(tmp_path / "out.csv", delimiter=",", skiprows=1)
    assert np.abs(table[:, 1:7] - exact.angles).max() < 1e-11
    (path,) = export(scene, "mjcf", tmp_path / "scene.xml")
    (tmp_path / "program.py").write_text(PLAIN_MUJOCO, encoding="utf-8")
    done = plain_python(tmp_path / "program.py", path, scene.samples, 40, tmp_path / "out.npy")
    assert done.returncode == 0, done.stderr
    assert np.abs(np.load(tmp_path / "out.npy") - exact.angles).max() < 1e-9


def test_the_csv_has_the_reference_bit_for_bit_with_units(tmp_path: Path) -> None:
    scene, exact = shipped("check/held"), references.reference("check/held")
    (path,) = rm.export(scene, "csv", tmp_path / "held.csv")
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    columns = dict(zip(header, np.array(rows, dtype=float).T, strict=True))
    assert np.array_equal(columns["time [s]"], exact.time)
    assert np.array_equal(columns["pitch 4 [rad]"], exact.angles[:, 4])
    assert np.array_equal(columns["rotor rate [rad/s]"], exact.rates[:, 0])
    assert np.array_equal(columns["tip 2 z [m]"], exact.tip[:, 1, 2])
    assert np.array_equal(columns["kinetic energy [J]"], exact.kinetic_energy)
    assert np.array_equal(columns["error growth [1]"], exact.error_growth)
    assert all(name.endswith("]") for name in header)


def test_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for to, name in (("mjcf", "fig03.xml"), ("exudyn", "fig03-exudyn.py"), ("csv", "fig03.csv")):
        assert rotor_mbs("export", "paper/fig03", "--to", to) == (0, f"{name}\n", "")
    assert "allowed: the name of one scene" in refusal("export", "paper", "--to", "csv")
    assert rotor_mbs("export", "paper/fig03", "--to", "step").status == 2
