"""The rule that takes a method where none is named: what it takes, what it refuses, and why in one line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from scenes import PAPER, paper
from test_stability_exact import scene

from rotor_mbs.cli import main
from rotor_mbs.errors import MethodRefusal
from rotor_mbs.models.choice import choose
from rotor_mbs.models.registry import DEFAULT_METHODS
from rotor_mbs.scenario.scene import Scene


@pytest.mark.parametrize("name", PAPER)
def test_scenes_of_the_paper_keep_the_default_set(name: str) -> None:
    assert choose(paper(name), DEFAULT_METHODS).methods == DEFAULT_METHODS


@pytest.mark.parametrize("name", ["bearing-1e8", "bearing-1e12", "slow-rotor", "one-blade-stiff"])
def test_fast_swings_get_methods_that_choose_their_step(name: str) -> None:
    choice = choose(scene(f"stiff/{name}"), DEFAULT_METHODS)
    assert choice.methods[0] == "lagrange/taylor"
    assert not {"exudyn_tree/rk44", "exudyn_tree/rk67"} & set(choice.methods)
    assert "\n" not in choice.reason


@pytest.mark.parametrize("name", ["bearing-1e8-damping-100", "bearing-1e12-damping-100", "shaft-damping"])
def test_overdamped_scenes_get_implicit_methods(name: str) -> None:
    choice = choose(scene(f"stiff/{name}"), DEFAULT_METHODS)
    assert "lagrange/radau" in choice.methods
    assert "implicit" in choice.reason


@pytest.mark.parametrize("name", ["singular-start", "singular-one-blade"])
def test_what_has_no_motion_is_refused(name: str) -> None:
    with pytest.raises(MethodRefusal, match="singular") as caught:
        choose(scene(f"extreme/{name}"), DEFAULT_METHODS)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "able",
    [
        replace(scene("extreme/singular-one-blade"), hub_inertia=1e-6),
        replace(scene("extreme/singular-one-blade"), bearing_stiffness=(1e6,)),
        paper("fig03"),
    ],
    ids=["with a hub", "held by a spring", "pitch exactly zero"],
)
def test_one_blade_is_taken_where_it_does_not_end(able: Scene) -> None:
    assert choose(able, DEFAULT_METHODS).methods


def test_a_run_says_what_it_took_and_a_refusal_ends_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "extreme/singular-one-blade", "-o", str(tmp_path / "r.h5")]) == 2
    told = capsys.readouterr().err.strip()
    assert told.startswith("extreme/singular-one-blade: refused: ")
    assert "\n" not in told
    assert not (tmp_path / "r.h5").exists()
