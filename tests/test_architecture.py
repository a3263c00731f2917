"""docs/architecture.md against the code: layers, the places it names, what there is to touch to add
something; and the tests against the code: they use what is public."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path

import pytest

from rotor_mbs.methods.catalogue import methods

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "rotor_mbs"
TEXT = (ROOT / "docs" / "architecture.md").read_text()
SOURCES = {
    path.relative_to(PACKAGE).as_posix(): path.read_text() for path in sorted(PACKAGE.rglob("*.py"))
}
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"][
    "contracts"
]
# Where a method is chosen by its name: the selection rule, the check, the suite's patient method,
# defaults of the API.
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
        if (
            isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
            and ast.get_docstring(node) is not None
        ):
            node.body[0] = ast.Pass()
    return ast.unparse(tree)


@pytest.fixture(scope="module")
def code() -> dict[str, str]:
    return {file: code_of(text) for file, text in SOURCES.items()}


def test_the_layers_are_those_of_the_import_contract() -> None:
    (layers,) = (contract["layers"] for contract in CONTRACTS if contract["type"] == "layers")
    # those of one layer stand together
    names = [name.strip() for layer in layers for name in layer.split(":")]
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


def test_the_physics_of_a_scene_key_is_in_the_files_of_its_row(code: dict[str, str]) -> None:
    row = re.findall(r"^\| a scene key \| (.*) \|$", TEXT, re.M)[0]
    named = re.findall(r"`([\w/]+/(?:\w+\.py)?)`", row)
    assert "models/" in named
    keys = "hub_(inertia|radius|mass)|shaft_(tilt|damping)|bearing_(stiffness|damping|rest)"
    keys += "|bearing|(pitch|rotor)_torque"
    using = [file for file, text in code.items() if re.search(rf"\bscene\.({keys})\b", text)]
    assert [file for file in using if not file.startswith(("scenario/", *named))] == []


def test_an_integrator_is_one_object_in_its_models_folder(code: dict[str, str]) -> None:
    """A method's name stands nowhere but in its model's package, where no study chooses it by
    name."""
    elsewhere = {file: text for file, text in code.items() if not file.startswith("models/")}
    for method in methods():
        assert {file for file, text in elsewhere.items() if f"'{method.name}'" in text} <= CHOSEN, (
            method.name
        )


def test_every_model_is_in_the_catalogue_and_in_the_contract_of_independence(
    code: dict[str, str],
) -> None:
    models = {path.parent.name for path in PACKAGE.glob("models/*/methods.py")}
    (independent,) = (
        contract["modules"] for contract in CONTRACTS if contract["type"] == "independence"
    )
    assert {name.rpartition(".")[2] for name in independent} == models
    assert set(re.findall(r"'rotor_mbs\.models\.(\w+)", code["methods/catalogue.py"])) == models


# Tests

# Protocols of Python and of notebooks; and names that a test has no other way to, until they are
# public.
PRIVATE = {"_repr_html_", "_replace", "_asdict", "_fields", "_exit", "_config"}
PRIVATE |= {
    "_files",
    "_file_methods",
    "_own_extremes",
    "_changed_metric",
    "_of_reference",
    "_of_run",
    "_PATIENT_S",
    "_LONGEST_RUN_S",
    "_LOAD_S",
    "_is_met",
    "_mbs",
    "_runs",
    "_in_doubles",
    "_transition_matrices",
    "_matrices_by_quotients",
    "_Sweep",
    "_turn",
    "_Examination",
    "_scene",
    "_made",
    "_run",
    "_of_stored_interval",
}


def private_names(tree: ast.Module) -> set[str]:
    """Return names with one underscore in front that are not the own ones: imported, of an object,
    or set by a text."""
    names: set[str] = set()
    for node in ast.walk(tree):
        match node:
            case ast.ImportFrom(names=imported):
                names |= {alias.name for alias in imported}
            case ast.Attribute(value=ast.Name(id="self" | "cls")):
                pass
            case ast.Attribute(attr=name):
                names.add(name)
            case ast.Call(
                func=ast.Attribute(attr="setattr" | "object" | "setitem"),
                args=[_, ast.Constant(str(name)), *_],
            ):
                names.add(name)
    return {name for name in names if name.startswith("_") and not name.startswith("__")}


def test_tests_use_public_names() -> None:
    """A private function is tested through the public one that calls it, so that it may be written
    anew."""
    names = {
        path: private_names(ast.parse(path.read_text())) for path in (ROOT / "tests").rglob("*.py")
    }
    assert {path.name: found - PRIVATE for path, found in names.items() if found - PRIVATE} == {}
    assert set().union(*names.values()) >= PRIVATE  # none that is public now
