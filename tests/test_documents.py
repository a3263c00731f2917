"""What the README and `docs/` tell a reader to type is understood, what they link to is there,
their Python runs; the generated reference pages have everything."""

from __future__ import annotations

import importlib
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.commands import rotor_mbs
from support.openfast_models import write_model

import rotor_mbs as rm
from rotor_mbs.cli.arguments import parse
from rotor_mbs.cli.verdicts import line
from rotor_mbs.methods.catalogue import method_names
from rotor_mbs.scenario.scene import BLADE_KEYS, SCENE_KEYS, load_scene
from rotor_mbs.studies.check import changed_scenes

ROOT = Path(__file__).parents[1]
DOCUMENTS = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
TEXTS = {path.name: path.read_text() for path in DOCUMENTS}
(OWN_SCENE,) = re.findall(r"```toml\n(title.*?)```", TEXTS["README.md"], re.DOTALL)


def commands(text: str) -> list[list[str]]:
    """Every call of rotor-mbs in an indented line, without what the shell does around it."""
    lines = [line.split("#")[0] for line in text.splitlines() if line.startswith("    ")]
    parts = [
        re.sub(r" > \S+$", "", part.strip())
        for line in lines
        for part in re.split(r"&&|\|\|", line.replace("exec ", ""))
    ]
    calls = [part for part in parts if re.match(r"(\.venv/bin/|- run: )?rotor-mbs ", part)]
    return [
        shlex.split(re.sub(r"\$\(.*?\)", "0001", call.partition("rotor-mbs ")[2])) for call in calls
    ]


def python_of(name: str) -> list[str]:
    """The Python of a document, but for the loader that needs PyTorch:
    tests/studies/test_sweep_metadata.py runs it."""
    blocks = re.findall(r"```python\n(.*?)```", TEXTS[name], re.DOTALL)
    return [block for block in blocks if "torch" not in block]


def test_every_command_is_one() -> None:
    calls = [call for text in TEXTS.values() for call in commands(text)]
    assert len(calls) > 15
    for arguments in calls:
        replaced = [
            "3/16" if word.startswith("$SLURM_ARRAY_TASK_ID") else word for word in arguments
        ]
        if "--names" not in arguments:  # which prints and ends
            parse(replaced)  # ends with status 2 where it is none


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_every_link_leads_somewhere(path: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", path.read_text()):
        assert target.startswith("https://") or (path.parent / target).exists(), target


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Where the Python of documents runs, with the README's scene."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("documents")
        patch.chdir(folder)
        patch.setenv("MPLBACKEND", "Agg")
        (folder / "my.toml").write_text(OWN_SCENE)
        yield folder


def test_the_readmes_own_scene_is_one() -> None:
    scene = load_scene(Path("my.toml"), "my")
    assert len(scene.blades) == 2
    assert scene.has_torque
    assert scene.has_damping


@pytest.mark.full
def test_the_readmes_python_runs(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """First the API, then what reads a results file."""
    pytest.importorskip("heyoka")
    rm.run("paper/fig11", ["lagrange/taylor", "exudyn_tree/rk67"]).save(
        folder / "rotor-mbs-out" / "results.h5"
    )
    (first,), reading = python_of("README.md"), python_of("data.md")
    # the references of 5 s take 6 s
    shorter = first.replace("duration=5.0, samples=501", "duration=0.5, samples=51")
    assert shorter != first
    names: dict[str, Any] = {}
    for code in (shorter, *reading):
        exec(code, names)
    assert names["study"].statuses == {"ok": 3}
    assert float(names["error"].sel(run="exudyn_tree/rk67").max()) < 1.0
    assert names["overview"].loc["paper/fig11/lagrange/taylor", "angle_error_max"] < 1e-9
    assert "exudyn_tree/rk67" in capsys.readouterr().out


def make_inputs(name: str) -> None:
    """The files that a document's Python reads."""
    if name == "compare.md":
        rm.export("paper/fig11", "csv", "mine.csv")
    elif name == "your-turbine.md":
        write_model(Path.cwd()).rename("MODEL.fst")
    elif name == "sweeps.md":
        (sweep,) = re.findall(r"```toml\n(title.*?)```", TEXTS[name], re.DOTALL)
        fewer = sweep.replace("draws = 100 ", "draws = 4 ").replace(
            "error_growth = true", "error_growth = false"
        )
        assert fewer != sweep
        Path("sweep.toml").write_text(fewer)
        assert rotor_mbs("sweep", "sweep.toml", "-o", "study.h5", "-j", 1).status == 0
    elif name == "bench.md":
        rotor_mbs(
            *shlex.split(
                "bench check/general -m lagrange/dop853 -o bench.h5 --budget 1 --repeats 1"
            )
        )


@pytest.mark.full
@pytest.mark.parametrize(
    "name",
    [name for name in TEXTS if python_of(name) and name not in ("README.md", "data.md", "tour.md")],
)
def test_the_python_of_documents_runs(name: str) -> None:
    make_inputs(name)
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
    assert set(printed.split("\n")) <= {
        line.removeprefix("    ") for line in TEXTS["tour.md"].split("\n")
    }


@pytest.mark.full
@pytest.mark.parametrize("name", ["data.md", "sweeps.md"])
def test_the_matlab_code_of_documents_runs_in_octave(folder: Path, name: str) -> None:
    """Without drawing, which needs a display; at the end it prints one angle of the last block."""
    octave = shutil.which("octave-cli")
    if octave is None:
        pytest.skip("needs Octave")
    if subprocess.run(
        [octave, "-q", "--eval", "pkg load netcdf"], capture_output=True, check=False
    ).returncode:
        pytest.skip("needs the package netcdf of Octave")
    blocks = re.findall(r"```matlab\n(.*?)```", TEXTS[name], re.DOTALL)
    lines = [
        line for block in blocks for line in block.splitlines() if not line.startswith("plot(")
    ]
    if name == "data.md":
        path = folder / "octave" / "rotor-mbs-out" / "results.h5"
        rm.run("paper/fig11", ["exudyn_tree/rk67", "lagrange/dop853"]).save(path)
        shown = rotor_mbs("show", path, "--json")
        assert shown.status == 0
        path.with_suffix(".json").write_text(shown.out)
        expected = rm.open(path)["exudyn_tree/rk67"].angles[-1, 2]
        lines.append("printf('%.17g', q67(3, end) / ok67)")
    else:
        make_inputs(name)  # 12 runs
        path = folder / "study.h5"
        expected = rm.open(path)[7].angles[3, 2]
        lines = [line.replace("18", "8") for line in lines]
        lines.append("printf('%.17g', q(4, 3))")
    script = path.parent / "code.m"
    script.write_text("\n".join(lines))
    where = path.parents[1] if name == "data.md" else path.parent
    done = subprocess.run(
        [octave, "-q", str(script)], cwd=where, capture_output=True, text=True, check=True
    )
    assert float(done.stdout) == expected


# What a document's path needs that the document itself does not make: by document, commands before
# it.
BEFORE = {
    "bench.md": ["run stiff/bearing-1e6 -m lagrange/dop853 -o results.h5"],
    "check.md": [
        "run paper/fig08 -m lagrange/dop853 -m exudyn_tree/rk67 -o results.h5",
        "run paper/fig08 -m lagrange/dop853 -m exudyn_tree/rk67 -o main/results.h5",
    ],
    "compare.md": ["export paper/fig11 --to csv -o mine.csv"],
    "data.md": [
        "run paper/fig11 -m lagrange/taylor -m exudyn_tree/rk67 -o rotor-mbs-out/results.h5"
    ],
}
# Commands that would take minutes, with what makes them short; others of the documents are run as
# they stand.
SHORTER = {
    "reproduce": "run paper/fig08 -m lagrange/dop853 -o rotor-mbs-out/results.h5",
    "bench paper/fig09": (
        "bench paper/fig09 -m lagrange/dop853 -o bench-results.h5 --budget 1 --repeats 1"
    ),
    "bench paper -o bench.h5": (
        "bench check/general -m lagrange/dop853 -o bench.h5 --budget 1 --repeats 1"
    ),
    "bench my.toml": "bench my.toml -m lagrange/dop853 --budget 1 --repeats 1",
    "check": "check results.h5",
    "check --junit check.xml --json check.json --github -v": (
        "check results.h5 --junit check.xml --json check.json -v"
    ),
    "modes stiff/nrel-5mw --speeds 0:3:31": "modes stiff/nrel-5mw --speeds 0:3:3",
    "modes my.toml --speeds 0.1:3:30 -o modes.h5": "modes my.toml --speeds 0.1:3:3 -o modes.h5",
    "sweep sweeps/fig11-spread": "sweep sweeps/fig11-spread --dry-run",
    "sweep sweeps/pitch-stability": "sweep sweeps/pitch-stability --dry-run",
    "sweep sweeps/learning": "sweep sweeps/learning --dry-run",
}
# Other programs' files, servers, engines of other packages, and commands of hours.
NOT_HERE = (
    "dask:",
    "SLURM",
    "examples/engines",
    "engines.h5",
    "-m mine.py",
    "campbell.csv",
    "MODEL.out",
    "stability",
    "--repeats 50",
)


def path_of(name: str) -> list[str | list[str]]:
    """A document's commands, as lists, and its Python, as text, in the order in which a reader
    meets them."""
    steps: list[str | list[str]] = []
    for part in re.split(r"(```python\n.*?```)", TEXTS[name], flags=re.DOTALL):
        if part.startswith("```python"):
            steps.append(part.removeprefix("```python\n").removesuffix("```"))
        else:
            steps += commands(re.sub(r"```.*?```", "", part, flags=re.DOTALL))
    return steps


@pytest.mark.nightly
@pytest.mark.parametrize(
    "name", [name for name, text in TEXTS.items() if commands(text) and name != "architecture.md"]
)
def test_the_path_of_a_document_can_be_walked(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every command and every piece of Python, one after the other in one folder, as a reader
    would."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my.toml").write_text(OWN_SCENE)
    (tmp_path / "main").mkdir()
    if name == "sweeps.md":
        make_inputs(name)
        (tmp_path / "SWEEP.toml").write_text((tmp_path / "sweep.toml").read_text())
        (tmp_path / "study.h5").unlink()
    if name in ("your-turbine.md", "README.md"):
        make_inputs("your-turbine.md")  # a model of OpenFAST, of which a scene is made
        (tmp_path / "my.toml").unlink()
    if name == "your-engine.md":
        (tmp_path / "mine.py").write_text(python_of(name)[0])
    for command in BEFORE.get(name, []):
        assert rotor_mbs(*shlex.split(command)).status == 0, command
    names: dict[str, Any] = {}
    for step in path_of(name):
        if isinstance(step, str):
            if "torch" not in step:
                exec(step, names)
            continue
        text = shlex.join(step)
        if not any(word in text for word in NOT_HERE):
            # 1: a check failed, a run is inaccurate, as some documents show; 2 is a command that is
            # not understood.
            assert rotor_mbs(*shlex.split(SHORTER.get(text, text))).status in (0, 1), text


def test_every_public_name_key_command_and_method_is_on_a_reference_page(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """`sphinx-build` itself fails where a built-in array is missing from the page of the file
    format."""
    pytest.importorskip("sphinx", reason="extra docs")
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "_ext"))
    from reference import declared_pages

    pages = declared_pages()
    for name in (*rm.__all__, "assert_agrees", "Modes", "RunPlots"):
        assert f"api/{name}" in pages, name
        assert f"(api/{name}.md)" in pages["api"]
    commands = re.findall(r"^    ([a-z-]+)\b", rotor_mbs("--help").out, re.M)
    assert "reproduce" in commands
    expected = {
        "command-line": [f"## {name}" for name in commands],
        "scene-file": [f"`{key['key']}`" for key in SCENE_KEYS.values() if key["key"] != "blade"]
        + [f"`blade.{key['key']}`" for key in BLADE_KEYS.values()],
        "methods": [f"## {name}" for name in method_names()],
    }
    for name, texts in expected.items():
        assert not [text for text in texts if text not in pages[name]], name


def test_the_picture_of_defects_shows_a_run_below_and_one_above_what_is_allowed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.syspath_prepend(ROOT / "docs/_ext")
    drawing = importlib.import_module("draw_defects")
    ends, allowed, faulty, good = drawing.curves()
    is_late = ends > drawing.FAULT_TIME_S + 0.05
    assert (good < allowed).all()
    assert (faulty[~is_late][:-1] < allowed[~is_late][:-1]).all()
    assert (faulty[is_late] > 3.0 * allowed[is_late]).all()
    picture = drawing.PICTURE.read_text()
    assert f"gravity {drawing.FAULT:.0e} too large from {drawing.FAULT_TIME_S:g} s on" in picture
    assert "allowed" in picture


def test_the_line_of_a_changed_scene_is_that_of_check() -> None:
    scene = rm.scene("paper/fig11").replace(**{"blade.mass": 15000.0})
    changed = scene.replace(**{"blade.mass": 15010.0})
    (check,) = changed_scenes({scene.name: changed}, {scene.name: scene})
    assert f"    {line(check)}\n" in TEXTS["check.md"]
