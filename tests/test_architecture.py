"""docs/architecture.md against the code: layers, the places it names, what there is to touch to add something."""

from __future__ import annotations

import ast
import re
import tomllib
from collections import Counter
from pathlib import Path

from rotor_mbs.cli.arguments import _parser
from rotor_mbs.methods.catalogue import methods

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "rotor_mbs"
TEXT = (ROOT / "docs" / "architecture.md").read_text()
SOURCES = {path.relative_to(PACKAGE).as_posix(): path.read_text() for path in sorted(PACKAGE.rglob("*.py"))}
# Where a method is chosen by its name: the selection rule, the check, the suite's patient method, defaults of the
# API, and the printed equations, which the analysis of the paper is about.
CHOSEN = {
    "methods/selection.py", "studies/check.py", "studies/check_probes.py", "studies/check_status_rules.py",
    "studies/stability.py", "studies/claims.py", "analysis/run_selection.py", "api.py",
    "scenario/sweep.py", "report/core/looks.py",
}  # fmt: skip


def code_of(text: str) -> str:
    """Without docstrings and comments."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body[0] = ast.Pass()
    return ast.unparse(tree)


CODE = {name: code_of(text) for name, text in SOURCES.items()}


def naming(pattern: str) -> set[str]:
    """The modules whose code has it."""
    return {name for name, text in CODE.items() if re.search(pattern, text)}


def test_the_layers_are_those_of_the_import_contract() -> None:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    (layers,) = (one["layers"] for one in contracts if one["type"] == "layers")
    assert re.findall(r"^\| `(\w+)` \|", TEXT.partition("## The way")[0], re.M) == layers


def test_every_place_that_is_named_exists() -> None:
    places = re.findall(r"`?\b((?:[a-z_]+/)+[a-z_]+\.(?:py|toml|md))\b", TEXT)
    assert len(places) > 10
    for place in places:
        assert any((base / place).exists() for base in (ROOT, PACKAGE)), place
    layers = "scenario|studies|methods|solution|runs|analysis|report"
    for dotted in re.findall(rf"(?<![.\w])((?:{layers})\.(?!py\b)[a-z_]+)\b", TEXT):
        path = PACKAGE / dotted.replace(".", "/")
        assert path.with_suffix(".py").exists() or path.is_dir(), dotted


# What to touch


def test_every_row_of_the_table_is_tested_here() -> None:
    rows = re.findall(r"^\| (an? [a-z ]+) \|", TEXT.partition("## What to touch")[2].partition("##")[0], re.M)
    assert rows == ["an integrator", "an engine", "a scene key", "an output quantity", "a page", "a command"]


def test_an_integrator_is_one_object_in_its_models_folder() -> None:
    """A method's name stands nowhere but in its model's package, where no study chooses it by name."""
    for method in methods():
        found = naming(rf"['\"]{re.escape(method.name)}['\"]") - CHOSEN
        assert all(name.startswith("models/") for name in found), (method.name, found)


def test_no_code_asks_for_a_method_by_the_beginning_of_its_name() -> None:
    assert naming(r"startswith\(\(?['\"](printed|lagrange|exudyn|mujoco)") == set()


def test_an_engine_is_its_package_and_one_line() -> None:
    for engine, package in (("exudyn", "models/exudyn/"), ("mujoco", "models/mujoco/"), ("heyoka", "models/lagrange/")):
        assert all(name.startswith(package) for name in naming(rf"^\s*(import|from) {engine}\b")), engine
    lines = [line for line in SOURCES["methods/catalogue.py"].splitlines() if "rotor_mbs.models." in line]
    assert len(lines) == len([path for path in (PACKAGE / "models").iterdir() if (path / "methods.py").exists()])


def test_a_quantity_is_its_declaration_and_its_producers() -> None:
    allowed = {"solution/quantities.py", "models/exudyn/sensor_samples.py", "models/exudyn/methods.py"}
    assert naming(r"\bconstraint_error\b") <= allowed


def test_a_scene_key_is_the_scene_and_the_physics_it_changes() -> None:
    outside = {name for name in naming(r"\bshaft_damping\b") if not name.startswith(("scenario/", "models/"))}
    # The selection rule, the balance of momentum, where an exact solution ends, and a picture of what the damper takes.
    assert outside <= {
        "methods/selection.py",
        "solution/impulse.py",
        "analysis/exact.py",
        "report/pages/scene.py",
    }


def test_a_page_is_a_module_and_its_template() -> None:
    templates = {path.name.partition(".")[0] for path in (PACKAGE / "report" / "templates").glob("*.html.j2")}
    for template in templates - {"base", "parts", "viewer"}:  # what pages are made of
        users = naming(rf"['\"]{template}['\"]")
        assert any(name.startswith("report/") for name in users), template


def test_a_command_is_its_arguments_and_a_function() -> None:
    for command, parser in _parser()[1].items():
        module, _, function = parser.get_default("command").partition(":")
        assert f"def {function}(arguments: argparse.Namespace) -> int:" in SOURCES[f"cli/{module}.py"], command


def test_no_two_classes_have_one_name() -> None:
    """But in the models, which do not know each other."""
    texts = [text for name, text in SOURCES.items() if not name.startswith("models/")]
    names = Counter(name for text in texts for name in re.findall(r"^class ([A-Z]\w+)", text, re.M))
    assert [name for name, count in names.items() if count > 1] == []
