"""Each row of the table "Files to change" in docs/architecture.md, by adding one of it.

A copy of the package is changed in the files of that row alone. Then the commands and the report of
the copy know what was added.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
import pytest
from support.scenes import paper

from rotor_mbs.scenario.scene import scene_toml

ROOT = Path(__file__).parents[1]
ROWS = dict(
    re.findall(r"^\| (an? [a-z ]+) \| (.*) \|$", (ROOT / "docs/architecture.md").read_text(), re.M)
)
DAMPING = 3e5  # N m s/rad, of the shaft


class Edit(NamedTuple):
    """A text that is put in front of another one in a file, which has that text once; or a new file
    with the text."""

    file: str
    text: str
    before: str = ""


ADDED: dict[str, Sequence[Edit]] = {
    "a setting": [
        Edit(
            "models/lagrange/methods.py",
            '    strictness: float = number(1.0, above=0.0, doc="divides both tolerances")\n',
            "\n\n@dataclass(frozen=True)\nclass RadauSettings",
        ),
        Edit(
            "models/lagrange/methods.py",
            '        share = getattr(chosen, "strictness", 1.0)\n'
            "        relative, absolute = chosen.relative_tolerance, chosen.absolute_tolerance\n"
            "        return OdeSolver(\n"
            "            scene, scipy_integrator(solver, relative / share, absolute / share)\n"
            "        )\n\n",
            "        return OdeSolver(\n            scene, scipy_integrator(solver",
        ),
    ],
    "an integrator": [
        Edit(
            "models/lagrange/methods.py",
            '    _scipy_method("RK45", Dop853Settings, tolerance_ladder(tolerance_pair, 1e-6), 40.0),\n',
            '    _scipy_method(\n        "Radau"',
        ),
    ],
    "an engine": [
        Edit("models/copied/__init__.py", '"""A model."""\n'),
        Edit(
            "models/copied/methods.py",
            '"""List its methods."""\n'
            "from dataclasses import replace\n"
            "from rotor_mbs.models.mujoco.methods import METHODS as MUJOCO\n"
            'METHODS = (replace(MUJOCO[0], name="copied/rk4", label="a copy of RK4"),)\n',
        ),
        Edit(
            "methods/catalogue.py",
            '    "rotor_mbs.models.copied.methods:METHODS": ("copied",),\n',
            '    "rotor_mbs.models.mujoco.methods:METHODS"',
        ),
    ],
    "a scene key": [
        Edit(
            "scenario/scene.py",
            '    brake_damping: float = _key(\n        "shaft.brake", keys.NOT_NEGATIVE, "N m s/rad", '
            "default=0.0, added=True\n    )\n",
            '    methods: tuple[str, ...] = _key("methods"',
        ),
        Edit(
            "models/lagrange/parameters.py",
            "    damping = Fraction(scene.shaft_damping) + Fraction(scene.brake_damping)\n",
            "    return RotorForm(\n",
        ),
        Edit(
            "models/printed/methods.py",
            '        f"{name} does not include a brake": scene.brake_damping != 0.0,\n',
            '        f"{name} does not include a tilted shaft',
        ),
        *(
            Edit(
                f"models/{file}",
                "    if scene.brake_damping:\n"
                "        from rotor_mbs.errors import MethodRefusal\n\n"
                '        raise MethodRefusal("does not include a brake")\n',
                before,
            )
            for file, before in (
                ("exudyn/chain.py", "    return geometry.items("),
                ("exudyn/tree.py", "    return geometry.items("),
                ("mujoco/methods.py", "    if not METHODS[0].is_installed:"),
            )
        ),
    ],
    "an output quantity": [
        Edit(
            "solution/quantities.py",
            "    Quantity(\n"
            '        "shaft_speed", ("time",), "rpm", "speed of the shaft", "speed",\n'
            '        plot=Plot("Speed of the shaft", "speed (rpm)"),\n'
            "    ),\n",
            '    Quantity("kinetic_energy"',
        ),
        Edit("scenario/scene.py", '"speed", ', '"loads")'),
        Edit(
            "models/lagrange/samples.py",
            '    if scene.wants("speed"):\n'
            '        fields["shaft_speed"] = rates[:, 0] * (30.0 / np.pi)\n',
            '    if scene.wants("energy"):\n        fields |=',
        ),
    ],
    "a metric": [
        Edit(
            "solution/metrics.py",
            '    "rotor_rate_end": RowValue("rad/s", "rotor rate at the last sample"),\n',
            '    "rotor_angle_size_max": RowValue(',
        ),
        Edit(
            "solution/metrics.py",
            '    metrics["rotor_rate_end"] = float(run.rates[-1, 0])\n',
            "    peaks: Metrics = {}",
        ),
    ],
    "a page": [
        Edit(
            "report/pages/greeting.py",
            '"""Build a page."""\n'
            "from rotor_mbs.report.elements import Note, PageContent, Section\n"
            "def greeting_page():\n"
            '    section = Section("greeting", "A heading", [Note("Good day.")])\n'
            '    return PageContent("A greeting", "", [], [], [section])\n',
        ),
        Edit(
            "report/build.py",
            "    from rotor_mbs.report.pages.greeting import greeting_page\n"
            '    pages.append(Page("greeting.html", "A greeting", greeting_page))\n',
            "    pages[0] = pages[0]._replace(file=files.INDEX)\n",
        ),
    ],
    "a command": [
        Edit(
            "cli/commands.py",
            "def greet(arguments):\n"
            '    """Greet."""\n'
            '    print(f"good day, {arguments.name}")\n'
            "    return 0\n\n\n",
            "def new(arguments: argparse.Namespace) -> int:\n",
        ),
        Edit(
            "cli/arguments.py",
            '    options = command("greet", "greet somebody", "commands:greet", "Ana")\n'
            '    options.add_argument("name")\n\n',
            '    options = command(\n        "show",',
        ),
    ],
}


def test_each_row_of_the_document_is_added_here_in_its_own_files() -> None:
    assert set(ROWS) == set(ADDED)
    for row, edits in ADDED.items():
        named = re.findall(r"`([\w/]+(?:/|\.\w+))`", ROWS[row])
        for edit in edits:
            in_its_model = "its model's" in ROWS[row] and edit.file.startswith("models/")
            assert in_its_model or edit.file.startswith(tuple(named)), (row, edit.file)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the package with all that is added, and two scenes."""
    folder = tmp_path_factory.mktemp("copy")
    shutil.copytree(
        ROOT / "rotor_mbs", folder / "rotor_mbs", ignore=shutil.ignore_patterns("__pycache__")
    )
    for data in ("scenarios", "reference"):
        (folder / data).symlink_to(ROOT / data)
    for edits in ADDED.values():
        for file, text, before in edits:
            path = folder / "rotor_mbs" / file
            path.parent.mkdir(exist_ok=True)
            if before:
                old = path.read_text()
                assert old.count(before) == 1, (file, before)
                text = old.replace(before, text + before)
            path.write_text(text)
    outputs = ("angles", "rates")
    scene = paper("fig11", duration=0.2, samples=21, outputs=outputs)
    text = scene_toml(scene)
    (folder / "damper.toml").write_text(f"{text}\n[shaft]\ndamping = {DAMPING}\n")
    text = text.replace("outputs = [", 'outputs = ["speed", ')
    (folder / "brake.toml").write_text(f"{text}\n[shaft]\nbrake = {DAMPING}\n")
    return folder


def command(folder: Path, *words: str, status: int = 0) -> str:
    ended = subprocess.run(
        [sys.executable, "-m", "rotor_mbs", *words],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == status, ended.stderr
    return ended.stdout + ended.stderr


@pytest.fixture(scope="module")
def results(folder: Path) -> Path:
    """Runs of both scenes by methods of all models."""
    pytest.importorskip("mujoco")
    methods = ["lagrange/dop853", "lagrange/rk45", "copied/rk4", "exudyn_tree/rk67"]
    words = ["run", "damper.toml", "-o", "results.h5", "--set", "strictness=2"]
    for method in methods:
        words += ["-m", method]
    command(folder, *words, "-j", "1")
    command(folder, "run", "brake.toml", "-m", "lagrange/dop853", "-o", "results.h5", "-j", "1")
    return folder / "results.h5"


@pytest.mark.full
def test_a_setting_is_shown_and_stored(folder: Path, results: Path) -> None:
    assert "strictness" in command(folder, "show", "lagrange/dop853")
    with h5py.File(results) as file:
        settings = dict(zip(file["runs/run"].asstr(), file["runs/settings"].asstr(), strict=True))
    assert json.loads(settings["damper/lagrange/dop853"])["strictness"] == 2.0
    assert json.loads(settings["brake/lagrange/dop853"])["strictness"] == 1.0


@pytest.mark.full
def test_an_integrator_and_an_engine_are_listed_and_run(folder: Path, results: Path) -> None:
    listed = command(folder, "list")
    with h5py.File(results) as file:
        statuses = dict(zip(file["runs/run"].asstr(), file["runs/status"], strict=True))
    for method in ("lagrange/rk45", "copied/rk4"):
        assert method in listed
        assert statuses[f"damper/{method}"] == statuses["damper/lagrange/dop853"]


@pytest.mark.full
def test_a_scene_key_changes_the_motion_or_is_refused(folder: Path, results: Path) -> None:
    with h5py.File(results) as file:
        brake, damper = (file[f"{name}/angles"][-1] for name in ("brake", "damper"))
        labels = [str(label) for label in file["damper/run"].asstr()]
        damper = file["damper/angles"][labels.index("lagrange/dop853")]
    # A brake is a second damper; the other run has half the tolerance.
    np.testing.assert_allclose(brake, damper, rtol=0.0, atol=1e-12)
    for method in ("printed/ode45", "exudyn_tree/rk67", "exudyn_chain/extrapolated", "mujoco/rk4"):
        words = ["run", "brake.toml", "-m", method, "-o", "refused.h5", "-j", "1"]
        assert "does not include a brake" in command(folder, *words, status=2)


@pytest.mark.full
def test_a_quantity_and_a_metric_are_stored(results: Path) -> None:
    with h5py.File(results) as file:
        speed = file["brake/shaft_speed"]
        rates, labels = file["brake/rates"], [str(label) for label in file["brake/run"].asstr()]
        row = labels.index("lagrange/dop853")
        np.testing.assert_array_equal(speed[row], rates[row, :, 0] * (30.0 / np.pi))
        assert speed.attrs["units"] == "rpm"
        labels = [str(label) for label in file["runs/run"].asstr()]
        assert (
            file["runs/rotor_rate_end"][labels.index("brake/lagrange/dop853")]
            == (rates[row, -1, 0])
        )


@pytest.mark.full
def test_a_page_and_a_command_are_there(folder: Path, results: Path) -> None:
    command(folder, "report", str(results), "-o", "pages")
    assert "Good day." in (folder / "pages/greeting.html").read_text()
    assert "greeting.html" in (folder / "pages/index.html").read_text()
    assert command(folder, "greet", "Ana") == "good day, Ana\n"
    assert "greet" in command(folder, "--help")
