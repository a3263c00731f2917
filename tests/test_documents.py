"""What the README and `docs/` tell a reader to type is understood, and what they link to is there."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest

import rotor_mbs as rm
from rotor_mbs.cli.arguments import parse
from rotor_mbs.scenario.scene_file import load_scene

ROOT = Path(__file__).parents[1]
DOCUMENTS = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
NAMES = [path.name for path in DOCUMENTS]


def commands(text: str) -> list[list[str]]:
    """Every call of rotor-mbs in an indented line, without what the shell does around it."""
    lines = [line.split("#")[0] for line in text.splitlines() if line.startswith("    ")]
    parts = [part.strip() for line in lines for part in line.replace("exec ", "").split("&&")]
    calls = [part for part in parts if re.match(r"(\.venv/bin/|- run: )?rotor-mbs ", part)]
    return [shlex.split(re.sub(r"\$\(.*?\)", "0001", call.partition("rotor-mbs ")[2])) for call in calls]


@pytest.mark.parametrize("path", DOCUMENTS, ids=NAMES)
def test_every_command_is_one(path: Path) -> None:
    for arguments in commands(path.read_text()):
        replaced = ["3/16" if word.startswith("$SLURM_ARRAY_TASK_ID") else word for word in arguments]
        parse(replaced)  # ends with status 2 where it is none


def test_there_are_commands_to_be_tried() -> None:
    assert sum(len(commands(path.read_text())) for path in DOCUMENTS) > 15


@pytest.mark.parametrize("path", DOCUMENTS, ids=NAMES)
def test_every_link_leads_somewhere(path: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", path.read_text()):
        assert target.startswith("https://") or (path.parent / target).exists(), target


def test_the_readmes_own_scene_is_one(tmp_path: Path) -> None:
    (block,) = re.findall(r"```toml\n(title.*?)```", DOCUMENTS[0].read_text(), re.DOTALL)
    scene_file = tmp_path / "my.toml"
    scene_file.write_text(block)
    scene = load_scene(scene_file, "my")
    assert len(scene.blades) == 2
    assert scene.has_torque
    assert scene.has_damping


@pytest.mark.parametrize("path", DOCUMENTS, ids=NAMES)
def test_lines_fit_an_editor(path: Path) -> None:
    """But tables, which cannot be wrapped."""
    long = [line for line in path.read_text().splitlines() if len(line) > 125 and not line.startswith("|")]
    assert not long


@pytest.fixture
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    return tmp_path


def test_the_readmes_python_runs(empty_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """First the API, then what reads a results file, on a file with the scene and the methods that it names."""
    first, *reading = re.findall(r"```python\n(.*?)```", DOCUMENTS[0].read_text(), re.DOTALL)
    shorter = first.replace("duration=5.0, samples=501", "duration=0.5, samples=51")  # the references of 5 s take 6 s
    assert shorter != first
    exec(shorter, {})
    results = empty_folder / "rotor-mbs-out" / "results.h5"
    rm.run("paper/fig11", ["lagrange/taylor", "exudyn_tree/rk67"]).save(results)
    assert len(reading) == 2
    for code in reading:
        names: dict[str, Any] = {}
        exec(code, names)
    assert float(names["error"].sel(run="exudyn_tree/rk67").max()) < 1.0
    assert names["overview"].loc["paper/fig11/lagrange/taylor", "angle_error_max"] < 1e-9
    assert "exudyn_tree/rk67" in capsys.readouterr().out


def test_the_tour_prints_what_it_says(empty_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("heyoka")
    tour = (ROOT / "docs" / "tour.md").read_text()
    (scene,) = re.findall(r"```toml\n(title.*?)```", DOCUMENTS[0].read_text(), re.DOTALL)
    (code,) = re.findall(r"```python\n(.*?)```", tour, re.DOTALL)
    (empty_folder / "my.toml").write_text(scene)
    exec(code, {})
    printed = capsys.readouterr().out
    assert printed
    assert set(printed.split("\n")) <= {line.removeprefix("    ") for line in tour.split("\n")}
