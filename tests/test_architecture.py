"""docs/architecture.md against the code: layers, the places it names, what there is to touch to add something."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from rotor_mbs.methods.catalogue import methods
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import scene_hash

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "rotor_mbs"
TEXT = (ROOT / "docs" / "architecture.md").read_text()
SOURCES = {path.relative_to(PACKAGE).as_posix(): path.read_text() for path in sorted(PACKAGE.rglob("*.py"))}
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
# Where a method is chosen by its name: the selection rule, the check, the suite's patient method, defaults of the
# API, and the printed equations, which the analysis of the paper is about.
CHOSEN = {
    "methods/catalogue.py", "studies/check.py", "studies/stability.py", "analysis/run_selection.py", "api.py",
    "scenario/sweep.py",
}  # fmt: skip


def code_of(text: str) -> str:
    """Without docstrings and comments."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body[0] = ast.Pass()
    return ast.unparse(tree)


def test_the_layers_are_those_of_the_import_contract() -> None:
    (layers,) = (contract["layers"] for contract in CONTRACTS if contract["type"] == "layers")
    assert re.findall(r"^\| `(\w+)` \|", TEXT.partition("## Data flow")[0], re.M) == layers


def test_every_place_that_is_named_exists() -> None:
    places = re.findall(r"`?\b((?:[a-z_]+/)+[a-z_]+\.(?:py|toml|md))\b", TEXT)
    assert len(places) > 10
    for place in places:
        assert any((base / place).exists() for base in (ROOT, PACKAGE)), place
    layers = "scenario|studies|methods|solution|runs|analysis|report"
    for dotted in re.findall(rf"(?<![.\w])((?:{layers})\.(?!py\b)[a-z_]+)\b", TEXT):
        path = PACKAGE / dotted.replace(".", "/")
        assert path.with_suffix(".py").exists() or path.is_dir(), dotted


# Files to change

FIELD = 'shaft_brake: float = _key("shaft.brake", keys.SIZE, "N m", default=0.0, added=True)\n    '
REFUSAL = 'if scene.shaft_brake: raise MethodRefusal("no shaft brake")\n'
IMPORT = {"from rotor_mbs.scenario.scene import": "from rotor_mbs.errors import MethodRefusal\n"}
BRAKE = {"- form.shaft_damping * spin": "- form.shaft_brake "}
RK4 = (ROOT / "tests" / "extension" / "rotor_rk4.py").read_text().partition("    bounds=")[0]
BOUND = '\n[[bound]]\ncheck = "{}"\nmethod = "outside/*"\nvalue = 1e-6\nreason = "order 4"\n'
CHECKS = ("defect", "error", "metrics", "tip", "energy", "impulse")
# By addition and file: what is put in front of a text; for "" at the end.
PATCHES: dict[str, dict[str, dict[str, str]]] = {
    # A constant moment against a rotor that turns forwards: computed by the closed form alone.
    "a scene key": {
        "scenario/scene.py": {
            "pitch_torque: ": FIELD,
            "self.has_damping or": "self.shaft_brake != 0.0 or ",
        },
        "models/lagrange/parameters.py": {
            "shaft_damping: Number": "shaft_brake: Number\n    ",
            "convert(Fraction(scene.shaft_damping))": "convert(Fraction(scene.shaft_brake)), ",
        },
        "models/lagrange/closed_form.py": BRAKE | {"- form.shaft_damping * (spin": "- form.shaft_brake * spin "},
        "models/lagrange/hamilton.py": BRAKE,
        "models/printed/methods.py": {"for sentence, refused in": REFUSAL + 8 * " "},
        "models/exudyn/moments.py": IMPORT | {"self.segments = ": REFUSAL + 8 * " "},
        "models/mujoco/mjcf.py": IMPORT | {'root = ET.Element("mujoco"': REFUSAL + 4 * " "},
        "solution/impulse.py": {"scene.shaft_damping * (angles": "scene.shaft_brake * run.time + "},
    },
    "a page": {
        "report/pages/names.py": {"": "def names_page(opened):\n    return {'all': [*opened.scenes]}\n"},
        "report/templates/names.html.j2": {
            "": '{% extends "base.html.j2" %}{% block main %}{{ page.all }}{% endblock %}'
        },
        "report/build.py": {
            "from rotor_mbs.report.pages.scene ": "from rotor_mbs.report.pages.names import names_page\n",
            "    pages[0] = pages[0]": '    pages.append(Page("names", "Names", names_page))\n',
        },
    },
    "a command": {
        "cli/scenes.py": {
            "": "\n\nfrom rotor_mbs.studies.masses import mass_of\n"
            "def mass(arguments):\n    print(mass_of(only_scene(arguments.scene)))\n    return 0\n"
        },
        "cli/arguments.py": {
            "    return parser, ": '    command("mass", "all blades", "scenes:mass").add_argument("scene")\n'
        },
        "studies/masses.py": {"": "def mass_of(scene):\n    return sum(blade.mass for blade in scene.blades)\n"},
    },
    "an engine": {
        "models/outside/__init__.py": {"": ""},
        "models/outside/methods.py": {"": f"{RK4})\nMETHODS = (METHOD,)\n"},
        "methods/catalogue.py": {
            '    "rotor_mbs.models.muj': '    "rotor_mbs.models.outside.methods:METHODS": ("outside",),\n'
        },
        "reference/accuracy.toml": {"": "".join(BOUND.format(check) for check in CHECKS)},
        "pyproject.toml": {'"rotor_mbs.models.mujoco"]': '"rotor_mbs.models.outside", '},
    },
}


def files_of_row(addition: str) -> tuple[list[str], list[str]]:
    """What the row of the table names, and of these what there always is to change."""
    row = re.findall(rf"^\| {addition} \| (.*) \|$", TEXT, re.M)[0].partition("; from another package")[0]
    every, always = (re.findall(r"`([\w/]+/(?:\w+\.\w+)?|\w+\.toml)`", text) for text in (row, row.split("; if ")[0]))
    return every, always


class PatchedPackage:
    """The package and its data in a folder, with an addition that changes the files of its row and no others."""

    def __init__(self, folder: Path, addition: str) -> None:
        every, always = files_of_row(addition)
        patch = PATCHES[addition]
        assert [file for file in patch if not file.startswith(tuple(every))] == []
        assert [place for place in always if not any(file.startswith(place) for file in patch)] == []
        self.folder = folder
        for name in ("rotor_mbs", "reference", "scenarios"):
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(ROOT / "pyproject.toml", folder)
        for name, additions in patch.items():
            path = folder / name if (folder / name).exists() else folder / "rotor_mbs" / name
            path.parent.mkdir(exist_ok=True)
            text = path.read_text() if path.exists() else ""
            for place, added in additions.items():
                assert not place or text.count(place) == 1, (name, place)
                text = text.replace(place, added + place) if place else text + added
            path.write_text(text)

    def python(self, *words: str, status: int = 0) -> str:
        command, environment = [sys.executable, *words], {**os.environ, "PYTHONPATH": str(self.folder)}
        done = subprocess.run(command, capture_output=True, text=True, cwd=self.folder, env=environment)
        assert done.returncode == status, done
        return done.stdout + done.stderr

    def command(self, words: str, status: int = 0) -> str:
        return self.python("-m", "rotor_mbs", *words.split(), status=status)


BRAKED_RUNS = """
import pathlib, rotor_mbs as rm
from rotor_mbs.scenario.scene import scene_hash
assert scene_hash(rm.scene("paper/fig11")) == "HASH"
free = rm.scene("paper/fig11").replace(duration=1.0, samples=101)
braked, driven = free.replace(**{"shaft.brake": 300}), free.replace(**{"torque.rotor": -300})
assert scene_hash(free) != scene_hash(braked)
pathlib.Path("braked.toml").write_text(braked.text)
pathlib.Path("bad.toml").write_text(braked.text.replace("brake = 300.0", "brake = 1e30"))
assert rm.load("braked.toml").shaft_brake == 300.0
angles, same, other = (rm.run(scene, "lagrange/dop853").angles for scene in (braked, driven, free))
assert abs(angles - same).max() < 1e-12 and abs(angles - other).max() > 1e-6
swept = rm.sweep(free, {"shaft.brake": [0.0, 300.0]}).column("angles")
assert max(abs(swept[0] - other).max(), abs(swept[1] - angles).max()) < 1e-9
"""


@pytest.mark.full
def test_a_scene_key_takes_the_files_of_its_row(tmp_path: Path) -> None:
    """Then it is read, refused, hashed, swept, written and checked; a brake of 300 N m is a torque of -300 N m."""
    package = PatchedPackage(tmp_path, "a scene key")
    package.python("-c", BRAKED_RUNS.replace("HASH", scene_hash(find_scenes(["paper/fig11"])[0])))
    assert re.match(r"bad.toml:\d+: shaft.brake: 1e\+30 is out of range; allowed", package.command("show bad.toml", 2))
    package.command("run braked.toml -m lagrange/dop853 -o runs.h5 -j 1")
    package.command("check runs.h5 -j 1")
    for method in ("printed/ode45", "exudyn_tree/rk67", "exudyn_chain/newmark_index2", "mujoco/rk4"):
        assert "no shaft brake" in package.command(f"run braked.toml -m {method} -o no.h5", 2)
    package.command("new new.toml")
    assert "brake = 0.0" in (tmp_path / "new.toml").read_text()


@pytest.mark.full
def test_a_page_takes_the_files_of_its_row(tmp_path: Path) -> None:
    package = PatchedPackage(tmp_path, "a page")
    package.command("run paper/fig03 -m lagrange/dop853 -o runs.h5 -j 1")
    package.command("report runs.h5 -o pages")
    assert "paper/fig03" in (tmp_path / "pages" / "names.html").read_text()
    assert '<a href="names.html">Names</a>' in (tmp_path / "pages" / "index.html").read_text()


def test_a_command_takes_the_files_of_its_row(tmp_path: Path) -> None:
    package = PatchedPackage(tmp_path, "a command")
    assert "all blades" in package.command("--help")
    assert package.command("mass paper/fig11") == "45000.0\n"


@pytest.mark.full
def test_an_engine_takes_the_files_of_its_row(tmp_path: Path) -> None:
    package = PatchedPackage(tmp_path, "an engine")
    package.command("run paper/fig11 -m outside/rk4 -o runs.h5 -j 1")
    assert "defect: paper/fig11 outside/rk4" in package.command("check runs.h5 -v -j 1")


def test_an_integrator_is_one_object_in_its_models_folder() -> None:
    """A method's name stands nowhere but in its model's package, where no study chooses it by name."""
    elsewhere = {file: code_of(text) for file, text in SOURCES.items() if not file.startswith("models/")}
    for method in methods():
        found = {file for file, code in elsewhere.items() if f"'{method.name}'" in code}
        assert found <= CHOSEN, method.name


def test_every_model_is_in_the_catalogue_and_in_the_contract_of_independence() -> None:
    models = {path.parent.name for path in PACKAGE.glob("models/*/methods.py")}
    (independent,) = (contract["modules"] for contract in CONTRACTS if contract["type"] == "independence")
    assert {name.rpartition(".")[2] for name in independent} == models
    assert set(re.findall(r'"rotor_mbs\.models\.(\w+)', SOURCES["methods/catalogue.py"])) == models
