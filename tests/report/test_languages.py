"""The report's texts: the same names in each language, none left out, none in the wrong one."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from support.scenes import PAPER, paper
from support.stored import Made, rotor, store

from rotor_mbs.cli import main
from rotor_mbs.report import texts, texts_es
from rotor_mbs.report.language import speaking, spoken
from rotor_mbs.report.language import texts as current

RIGHT = rotor(lambda t: 0.5 + 0.1 * t, np.sin, np.cos)
# The same in both languages: proper names, symbols, words that Spanish shares.
SHARED = {"PAPER", "EXUDYN_COLUMN", "UNDECIDED", "YES", "NO"}


def names(module: ModuleType) -> set[str]:
    """What a module says itself: constants, and functions that are its own."""
    own = {
        name for name, value in vars(module).items()
        if not name.startswith("_") and (name.isupper() or getattr(value, "__module__", "") == module.__name__)
    }  # fmt: skip
    return own - {"NAMES", "TYPE_CHECKING"}


def test_both_languages_have_the_same_names() -> None:
    assert names(texts) == names(texts_es)


def test_values_are_of_one_kind_and_functions_take_the_same() -> None:
    for name in sorted(names(texts)):
        one, other = getattr(texts, name), getattr(texts_es, name)
        if inspect.isfunction(one):
            assert list(inspect.signature(one).parameters) == list(inspect.signature(other).parameters), name
        else:
            assert type(one) is type(other), name
        if isinstance(one, dict):
            assert one.keys() == other.keys(), name
        if isinstance(one, tuple):
            assert len(one) == len(other), name


def test_every_sentence_is_translated() -> None:
    same = {
        name for name in names(texts)
        if isinstance(getattr(texts, name), str) and getattr(texts, name) == getattr(texts_es, name)
    }  # fmt: skip
    assert same <= SHARED


def test_every_scene_of_the_paper_has_a_spanish_title() -> None:
    for name in PAPER:
        assert texts_es.scene_title(f"paper/{name}", "") != ""


def test_a_language_ends_with_its_block() -> None:
    with speaking("es"):
        assert current.LANGUAGE == spoken() == "es"
    assert current.LANGUAGE == "en"


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    scene = paper("fig11", samples=101)
    runs = [Made(scene, method, RIGHT) for method in ("reference", "printed/ode45", "exudyn_tree/rk67")]
    return store(tmp_path_factory.mktemp("languages") / "r.h5", runs)


def test_a_spanish_report_speaks_spanish_in_every_page(results: Path, tmp_path: Path) -> None:
    assert main(["report", str(results), "-o", str(tmp_path), "--lang", "es"]) == 0
    pages = {path.name: path.read_text(encoding="utf-8") for path in tmp_path.glob("*.html")}
    assert set(pages) == {"index.html", "errata.html", "figures.html", "paper-fig11.html"}
    for text in pages.values():
        assert '<html lang="es">' in text
    assert "Números publicados" in pages["index.html"]
    assert "Tres palas giradas, rotor a 30 grados" in pages["index.html"]
    assert "El rotor en movimiento" in pages["paper-fig11.html"]
    assert "Igual: " in pages["figures.html"]
    assert "de su transformación (3) respecto de los ángulos" in pages["errata.html"]
    assert "U32, fila 2, columna 4" in pages["errata.html"]
    captions = re.findall(r"<(?:figcaption|caption><span)>([^<]*)", "".join(pages.values()))
    assert captions
    for english in ("printed", "Reference", "model", "Exudyn tree", "Largest", "error of"):
        assert not [caption for caption in captions if english in caption and "modelo" not in caption], english


def test_figures_speak_spanish_too(results: Path, tmp_path: Path) -> None:
    for language in ("en", "es"):
        command = ["figures", "--results", str(results), "--figure", "11", "--format", "svg", "--lang", language]
        assert main([*command, "-o", str(tmp_path / language)]) == 0
    assert (tmp_path / "en" / "fig11.svg").read_bytes() != (tmp_path / "es" / "fig11.svg").read_bytes()
