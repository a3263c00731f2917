"""docs/architecture.md against the code: layers, the places it names, what there is to touch to add something."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path

from rotor_mbs.methods.catalogue import methods

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "rotor_mbs"
TEXT = (ROOT / "docs" / "architecture.md").read_text()
SOURCES = {path.relative_to(PACKAGE).as_posix(): path.read_text() for path in sorted(PACKAGE.rglob("*.py"))}
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
# Where a method is chosen by its name: the selection rule, the check, the suite's patient method, defaults of the API.
CHOSEN = {
    "methods/catalogue.py",
    "methods/selection.py",
    "studies/check.py",
    "studies/stability.py",
    "api/runs.py",
    "scenario/sweep.py",
}


def code_of(text: str) -> str:
    """Without docstrings and comments."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body[0] = ast.Pass()
    return ast.unparse(tree)


CODE = {file: code_of(text) for file, text in SOURCES.items()}


def test_the_layers_are_those_of_the_import_contract() -> None:
    (layers,) = (contract["layers"] for contract in CONTRACTS if contract["type"] == "layers")
    names = [name.strip() for layer in layers for name in layer.split(":")]  # those of one layer stand together
    assert re.findall(r"^\| `(\w+)` \|", TEXT.partition("## Data flow")[0], re.M) == names


def test_every_place_that_is_named_exists() -> None:
    places = re.findall(r"`?\b((?:[a-z_]+/)+[a-z_]+\.(?:py|toml|md))\b", TEXT)
    assert len(places) > 10
    for place in places:
        assert any((base / place).exists() for base in (ROOT, PACKAGE)), place
    layers = "processes|scenario|studies|comparison|methods|solution|runs|analysis|report"
    for dotted in re.findall(rf"(?<![.\w])((?:{layers})\.(?!py\b)[a-z_]+)\b", TEXT):
        path = PACKAGE / dotted.replace(".", "/")
        assert path.with_suffix(".py").exists() or path.is_dir(), dotted


# Files to change


def test_the_physics_of_a_scene_key_is_in_the_files_of_its_row() -> None:
    row = re.findall(r"^\| a scene key \| (.*) \|$", TEXT, re.M)[0]
    named = re.findall(r"`([\w/]+/(?:\w+\.py)?)`", row)
    assert "models/" in named
    keys = "hub_(inertia|radius|mass)|shaft_(tilt|damping)|bearing_(stiffness|damping|rest)"
    keys += "|bearing|(pitch|rotor)_torque"
    using = [file for file, code in CODE.items() if re.search(rf"\bscene\.({keys})\b", code)]
    assert [file for file in using if not file.startswith(("scenario/", *named))] == []


def test_an_integrator_is_one_object_in_its_models_folder() -> None:
    """A method's name stands nowhere but in its model's package, where no study chooses it by name."""
    elsewhere = {file: code for file, code in CODE.items() if not file.startswith("models/")}
    for method in methods():
        assert {file for file, code in elsewhere.items() if f"'{method.name}'" in code} <= CHOSEN, method.name


def test_every_model_is_in_the_catalogue_and_in_the_contract_of_independence() -> None:
    models = {path.parent.name for path in PACKAGE.glob("models/*/methods.py")}
    (independent,) = (contract["modules"] for contract in CONTRACTS if contract["type"] == "independence")
    assert {name.rpartition(".")[2] for name in independent} == models
    assert set(re.findall(r"'rotor_mbs\.models\.(\w+)", CODE["methods/catalogue.py"])) == models
