"""The main job, `reproduce`: on two scenes, a second call, on all; and when a call has something to do."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from support.commands import Ended, rotor_mbs
from support.scenes import PAPER

from rotor_mbs.cli import runs
from rotor_mbs.methods.catalogue import is_corrected
from rotor_mbs.runs.read import open_results
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.studies import reproduce

SCENES = ["paper/fig08", reproduce.BENCHED]
METHODS = {"printed/ode45", "lagrange/taylor", "exudyn_tree/rk67", "exudyn_chain/extrapolated"}


@pytest.fixture(scope="module")
def call(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Ended, Ended]:
    """The folder, the first call and the second one."""
    pytest.importorskip("heyoka")

    def two_scenes(names: Sequence[str]) -> list[Scene]:
        return find_scenes(SCENES if names == ["paper"] else names)

    folder = tmp_path_factory.mktemp("main-job")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reproduce, "find_scenes", two_scenes)
        return folder, rotor_mbs("reproduce", "-o", folder), rotor_mbs("reproduce", "-o", folder)


def test_every_method_has_run_and_those_of_the_correct_equations_are_ok(call: tuple[Path, Ended, Ended]) -> None:
    folder, first, _ = call
    assert first.status == 0, first.err
    with open_results(folder / "results.h5") as results:
        assert sorted(results.scenes) == sorted(SCENES)
        for scene in results.scenes.values():
            assert set(scene.methods) >= METHODS
            assert {run.status for run in scene.runs.values() if is_corrected(run.method)} == {"ok"}
            drift = {method: scene.runs[method].attributes["energy_drift_max"] for method in METHODS}
            assert drift["printed/ode45"] > 1e-3 > 1e-9 >= max(drift["lagrange/taylor"], drift["exudyn_tree/rk67"])


def test_the_report_is_whole_and_needs_no_network(call: tuple[Path, Ended, Ended]) -> None:
    pages = {path.name: path.read_text() for path in (call[0] / "report").glob("*.html")}
    assert {"index.html", "errata.html"} <= set(pages)
    assert len(pages) == len(SCENES) + 4  # index, errata, the figures one by one, the benches
    for page in pages.values():
        assert not re.search(r'(?:src|href)="(?:https?:)?//(?!doi\.org/)', page)  # a link to the paper asks for nothing


def test_the_second_call_has_nothing_to_do_and_shows_the_same(call: tuple[Path, Ended, Ended]) -> None:
    _, first, second = call
    assert second.status == 0
    assert "nothing to do" in second.out
    summary = [line for line in first.out.splitlines() if line.startswith(("lagrange/", "exudyn_", "printed/"))]
    assert summary
    assert set(summary) <= set(second.out.splitlines())


def test_its_results_pass_check(call: tuple[Path, Ended, Ended]) -> None:
    ended = rotor_mbs("check", call[0] / "results.h5")
    assert ended.status == 0, ended.out


@pytest.mark.full
def test_every_scene_by_every_model_and_all_right_ones_ok(tmp_path: Path) -> None:
    """The printed equations gain more than a thousandth of all energy in most figures, the right ones at most 1e-9."""
    pytest.importorskip("heyoka")
    ended = rotor_mbs("reproduce", "-o", tmp_path)
    assert ended.status == 0, ended.err
    right = ("lagrange/taylor", "exudyn_tree/rk67")
    with open_results(tmp_path / "results.h5") as results:
        assert set(results.scenes) == {f"paper/{name}" for name in PAPER}
        printed_drifts = []
        for scene in results.scenes.values():
            assert scene.reference is not None
            assert {run.status for run in scene.runs.values() if is_corrected(run.method)} == {"ok"}
            drift = {name: run.attributes.get("energy_drift_max", 0.0) for name, run in scene.methods.items()}
            assert max(drift[name] for name in right) <= 1e-9
            printed_drifts.append(drift["printed/ode45"])
    assert sum(drift > 1e-3 for drift in printed_drifts) > len(printed_drifts) / 2
    index = (tmp_path / "report" / "index.html").read_text()
    assert 'Published numbers reproduced</th><td class="n">4 of 4</td>' in index
    assert len(list((tmp_path / "report").glob("*.html"))) == len(PAPER) + 4
    assert rotor_mbs("check", tmp_path / "results.h5").status == 0


@pytest.fixture
def again(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., bool]:
    """Calls `reproduce`, with work that writes a results file and an index; returns whether the work was done."""
    done: list[Path] = []

    def work(_arguments: argparse.Namespace, results: Path, pages: Path) -> tuple[int, str]:
        done.append(results)
        pages.mkdir(parents=True, exist_ok=True)
        (pages / "index.html").touch()
        if not results.exists():
            results.write_bytes(bytes(1000))
        return int(Path("fails").exists()), "result as printed: what came out\n"

    def called(*options: str) -> bool:
        done.clear()
        ended = rotor_mbs("reproduce", "-o", folder, *options)
        assert ended.status == int(bool(done) and Path("fails").exists())
        assert "result as printed: what came out" in ended.out
        assert ("nothing to do" in ended.out) == (not done)
        return bool(done)

    monkeypatch.setattr(runs, "_reproduce", work)
    return called


CHANGES: dict[str, Callable[[], object]] = {
    "nothing": lambda: None,
    "a bit of the results": lambda: Path("results.h5").write_bytes(bytes(999) + b"\x01"),
    "no results": Path("results.h5").unlink,
    "no index": Path("report/index.html").unlink,
    "unfinished work": Path(".results.h5.lock").touch,
    "a call that failed": Path("fails").touch,
}


@pytest.mark.parametrize("change", CHANGES)
def test_only_what_changed_is_looked_into(again: Callable[..., bool], change: str) -> None:
    if change == "a call that failed":
        CHANGES[change]()
        assert again()
    else:
        assert again()
        CHANGES[change]()
    assert again() == (change != "nothing")


def test_another_time_limit_or_other_code_is_looked_into(
    again: Callable[..., bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert again()
    assert again("--timeout", "5")
    monkeypatch.setattr(reproduce, "versions", lambda: {"rotor_mbs": "other code"})
    assert again("--timeout", "5")
