"""What the README and `docs/` tell a reader to type is understood, what they link to is there, their Python runs."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import rotor_mbs as rm
from rotor_mbs.cli import main
from rotor_mbs.cli.arguments import parse
from rotor_mbs.scenario.scene import load_scene

ROOT = Path(__file__).parents[1]
DOCUMENTS = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
TEXTS = {path.name: path.read_text() for path in DOCUMENTS}
(OWN_SCENE,) = re.findall(r"```toml\n(title.*?)```", TEXTS["README.md"], re.DOTALL)


def commands(text: str) -> list[list[str]]:
    """Every call of rotor-mbs in an indented line, without what the shell does around it."""
    lines = [line.split("#")[0] for line in text.splitlines() if line.startswith("    ")]
    parts = [part.strip() for line in lines for part in line.replace("exec ", "").split("&&")]
    calls = [part for part in parts if re.match(r"(\.venv/bin/|- run: )?rotor-mbs ", part)]
    return [shlex.split(re.sub(r"\$\(.*?\)", "0001", call.partition("rotor-mbs ")[2])) for call in calls]


def python_of(name: str) -> list[str]:
    """The Python of a document, but for the loader that needs PyTorch: tests/studies/test_sweep_metadata.py runs it."""
    blocks = re.findall(r"```python\n(.*?)```", TEXTS[name], re.DOTALL)
    return [block for block in blocks if "torch" not in block]


@pytest.mark.parametrize("name", TEXTS)
def test_every_command_is_one(name: str) -> None:
    for arguments in commands(TEXTS[name]):
        replaced = ["3/16" if word.startswith("$SLURM_ARRAY_TASK_ID") else word for word in arguments]
        parse(replaced)  # ends with status 2 where it is none


def test_there_are_commands_to_be_tried() -> None:
    assert sum(len(commands(text)) for text in TEXTS.values()) > 15


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_every_link_leads_somewhere(path: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", path.read_text()):
        assert target.startswith("https://") or (path.parent / target).exists(), target


@pytest.mark.parametrize("name", TEXTS)
def test_lines_fit_an_editor(name: str) -> None:
    """But tables, which cannot be wrapped."""
    long = [line for line in TEXTS[name].splitlines() if len(line) > 125 and not line.startswith("|")]
    assert not long


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with the files that the documents read: a scene, results, a bench, a sweep, data of another program."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("documents")
        patch.chdir(folder)
        patch.setenv("MPLBACKEND", "Agg")
        (folder / "my.toml").write_text(OWN_SCENE)
        yield folder


@pytest.fixture(scope="module")
def paper_results(folder: Path) -> None:
    rm.run("paper/fig11", ["lagrange/taylor", "exudyn_tree/rk67"]).save(folder / "rotor-mbs-out" / "results.h5")


@pytest.fixture(scope="module")
def data(folder: Path) -> None:
    rm.export(rm.scene("paper/fig11"), "csv", folder / "mine.csv")


@pytest.fixture(scope="module")
def dataset(folder: Path) -> None:
    """The sweep of docs/sweeps.md, with fewer runs that are as long."""
    (sweep,) = re.findall(r"```toml\n(title.*?)```", TEXTS["sweeps.md"], re.DOTALL)
    fewer = sweep.replace("draws = 100 ", "draws = 4 ").replace("amplification = true", "amplification = false")
    assert fewer != sweep
    (folder / "sweep.toml").write_text(fewer)
    assert main(["sweep", "sweep.toml", "-o", "study.h5", "-j", "1"]) == 0


@pytest.fixture(scope="module")
def bench() -> None:
    main(shlex.split("bench check/general -m lagrange/dop853 -o bench.h5 --budget 1 --repeats 1"))


def test_the_readmes_own_scene_is_one() -> None:
    scene = load_scene(Path("my.toml"), "my")
    assert len(scene.blades) == 2
    assert scene.has_torque
    assert scene.has_damping


@pytest.mark.usefixtures("paper_results")
def test_the_readmes_python_runs(capsys: pytest.CaptureFixture[str]) -> None:
    """First the API, then what reads a results file."""
    (first,), reading = python_of("README.md"), python_of("data.md")
    shorter = first.replace("duration=5.0, samples=501", "duration=0.5, samples=51")  # the references of 5 s take 6 s
    assert shorter != first
    names: dict[str, Any] = {}
    for code in (shorter, *reading):
        exec(code, names)
    assert names["study"].statuses == {"ok": 3}
    assert float(names["error"].sel(run="exudyn_tree/rk67").max()) < 1.0
    assert names["overview"].loc["paper/fig11/lagrange/taylor", "angle_error_max"] < 1e-9
    assert "exudyn_tree/rk67" in capsys.readouterr().out


@pytest.mark.full
@pytest.mark.parametrize(
    "name", [name for name in TEXTS if python_of(name) and name not in ("README.md", "data.md", "tour.md")]
)
def test_the_python_of_documents_runs(name: str, request: pytest.FixtureRequest) -> None:
    needed = {"compare.md": "data", "sweeps.md": "dataset", "bench.md": "bench"}
    if name in needed:
        request.getfixturevalue(needed[name])
    names: dict[str, Any] = {}
    for code in python_of(name):
        exec(code, names)
    if name == "compare.md":
        assert names["comparison"].status == "ok"


@pytest.mark.full
def test_the_tour_prints_what_it_says(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("heyoka")
    (code,) = python_of("tour.md")
    exec(code, {})
    printed = capsys.readouterr().out
    assert printed
    assert set(printed.split("\n")) <= {line.removeprefix("    ") for line in TEXTS["tour.md"].split("\n")}
