"""The main job, `reproduce`: on a scene, a second call, when there is something to do. All scenes,
all curves of error and run time: `.ci/wheel`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import pytest
from support.commands import Ended, rotor_mbs

from rotor_mbs.cli import runs
from rotor_mbs.methods.catalogue import is_corrected
from rotor_mbs.runs.read import open_results
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.studies import reproduce

SCENES = [reproduce.BENCHED]
PRINTED, RIGHT = "printed/ode45", ("lagrange/taylor", "exudyn_tree/rk67")


class Calls(NamedTuple):
    """Two calls of `reproduce`, and the folder of their output."""

    folder: Path
    first: Ended
    second: Ended


@pytest.fixture(scope="module")
def calls(tmp_path_factory: pytest.TempPathFactory) -> Calls:
    pytest.importorskip("heyoka")

    def only_some(names: Sequence[str]) -> list[Scene]:
        return find_scenes(SCENES if names == ["paper"] else names)

    curves = reproduce.short_curves
    folder = tmp_path_factory.mktemp("main-job")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reproduce, "find_scenes", only_some)
        patch.setattr(reproduce, "short_curves", lambda scene: curves(scene)[:2])
        first, second = (
            rotor_mbs("reproduce", "-j", 1, "--timeout", 600, "-o", folder) for _ in range(2)
        )
    return Calls(folder, first, second)


def test_every_method_has_run_and_those_of_the_correct_equations_are_ok(calls: Calls) -> None:
    """The printed equations gain more than a thousandth of all energy in most figures, the right
    ones at most 1e-9."""
    assert calls.first.status == 0, calls.first.err
    printed_drifts = []
    with open_results(calls.folder / "results.h5") as results:
        assert set(results.scenes) == set(SCENES)
        for scene in results.scenes.values():
            assert scene.reference is not None
            assert set(scene.methods) >= {PRINTED, *RIGHT, "exudyn_chain/extrapolated"}
            assert {run.status for run in scene.runs.values() if is_corrected(run.method)} == {"ok"}
            drift = {
                name: run.attributes.get("energy_drift_max", 0.0)
                for name, run in scene.methods.items()
            }
            assert max(drift[name] for name in RIGHT) <= 1e-9
            printed_drifts.append(drift[PRINTED])
    assert sum(drift > 1e-3 for drift in printed_drifts) > len(printed_drifts) / 2


def test_the_report_is_whole(calls: Calls) -> None:
    """Of a single scene the page is the index."""
    pages = {path.name for path in (calls.folder / "report").glob("*.html")}
    assert pages == {"index.html", "claims.html", "figures.html", "errata.html", "bench.html"}


def test_the_second_call_has_nothing_to_do_and_shows_the_same(calls: Calls) -> None:
    assert calls.second.status == 0
    assert "nothing to do" in calls.second.out
    summary = [
        line
        for line in calls.first.out.splitlines()
        if line.startswith(("lagrange/", "exudyn_", "printed/"))
    ]
    assert summary
    assert set(summary) <= set(calls.second.out.splitlines())


def test_its_results_pass_check(calls: Calls) -> None:
    ended = rotor_mbs("check", calls.folder / "results.h5")
    assert ended.status == 0, ended.out


@pytest.fixture
def again(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., bool]:
    """Calls `reproduce`, with work that writes a results file and an index; returns whether the
    work was done."""
    done: list[Path] = []

    def compute(results: Path, **_: object) -> tuple[list[object], list[object]]:
        done.append(results)
        if not results.exists():
            results.write_bytes(bytes(1000))
        return [], []

    def write(_results: Path, pages: Path, *_: object) -> None:
        pages.mkdir(parents=True, exist_ok=True)
        (pages / "index.html").touch()

    def called(*options: str) -> bool:
        done.clear()
        ended = rotor_mbs("reproduce", "-j", 1, "-o", folder, *options)
        assert ended.status == int(bool(done) and Path("fails").exists())
        assert "result as printed: what came out" in ended.out
        assert ("nothing to do" in ended.out) == (not done)
        return bool(done)

    monkeypatch.setattr(reproduce, "reproduce", compute)
    monkeypatch.setattr(runs, "print_summary", lambda *_: int(Path("fails").exists()))
    monkeypatch.setattr(reproduce, "summary_of", lambda _: "result as printed: what came out\n")
    monkeypatch.setattr("rotor_mbs.report.build.write_report", write)
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


def test_a_stamp_of_no_text_is_refused_in_one_line_and_stays(
    again: Callable[..., bool], folder: Path
) -> None:
    """The stamp says which output files the report was made from; a damaged one says nothing."""
    assert again()
    stamp = folder / "report/.made-from"
    stamp.write_bytes(b"\xff\xfe" * 32)
    ended = rotor_mbs("reproduce", "-j", 1, "-o", folder)
    assert ended.status == 2
    assert ".made-from" in ended.err
    assert "Traceback" not in ended.err
    assert stamp.read_bytes() == b"\xff\xfe" * 32


def test_a_summary_that_is_no_text_is_shown_all_the_same(
    again: Callable[..., bool], folder: Path
) -> None:
    assert again()
    (folder / "report/summary.txt").write_bytes(b"result \xff\n")
    ended = rotor_mbs("reproduce", "-j", 1, "-o", folder)
    assert ended.status == 0
    assert "result" in ended.out
