"""The generated reference pages: every public name, key, command and method has its place. `sphinx-build` itself fails
where a built-in array is missing from the page of the file format."""

from __future__ import annotations

from pathlib import Path

import pytest

import rotor_mbs as rm
from rotor_mbs.cli.arguments import _parser
from rotor_mbs.methods.catalogue import method_names
from rotor_mbs.scenario.scene import BLADE_KEYS, SCENE_KEYS

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    """The pages of docs/reference by name."""
    pytest.importorskip("sphinx", reason="extra docs")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "docs" / "_ext"))
        from reference import declared_pages

        return declared_pages()


def test_every_public_name_has_a_page(pages: dict[str, str]) -> None:
    for name in (*rm.__all__, "assert_agrees", "Modes", "RunPlots"):
        assert f"api/{name}" in pages, name
        assert f"(api/{name}.md)" in pages["api"]


def test_every_key_command_and_method_is_listed(pages: dict[str, str]) -> None:
    expected = {
        "command-line": [f"## {name}" for name in _parser()[1]],
        "scene-file": [f"`{key['key']}`" for key in SCENE_KEYS.values() if key["key"] != "blade"]
        + [f"`blade.{key['key']}`" for key in BLADE_KEYS.values()],
        "methods": [f"## {name}" for name in method_names()],
    }
    for name, texts in expected.items():
        assert not [text for text in texts if text not in pages[name]], name
