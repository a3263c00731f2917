"""A batch goes on: a method that refuses a scene is a line with the reason, never the end of the
others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from support.commands import Ended, rotor_mbs

import rotor_mbs as rm
from rotor_mbs.analysis.modes import read_modes
from rotor_mbs.errors import MethodRefusal
from rotor_mbs.runs.design import MISSING
from rotor_mbs.runs.read import read_records
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.scenario.scene import new_scene_text
from rotor_mbs.solution.status import code_of
from rotor_mbs.studies import modes as modes_study
from rotor_mbs.studies import stability
from rotor_mbs.studies.stability import suite_runs

# A method that is known to refuse a scene only when it is built for it.
REFUSES_WHEN_BUILT = """
from rotor_mbs import Method, MethodRefusal

def build(scene, settings):
    raise MethodRefusal("refuses/late: has no place for this scene")

METHODS = [Method(name="late", label="refuses, late", build=build, items=lambda scene: [])]
"""
HUB_REASON = "printed/ode45 does not include hub inertia; it must be 0"


def short_scene(folder: Path, **changes: object) -> Path:
    """A scene of two intervals; `changes` of lines "key = value" of the template."""
    text = new_scene_text()
    for key, value in {"duration": 0.1, "samples": 3, **changes}.items():
        (line,) = [line for line in text.splitlines() if line.startswith(f"{key} = ")]
        text = text.replace(line, f"{key} = {value}")
    path = folder / "short.toml"
    path.write_text(text, encoding="utf-8")
    return path


def with_hub(folder: Path) -> Path:
    path = short_scene(folder)
    text = path.read_text(encoding="utf-8")
    assert text.count("inertia = 0.0") == 1
    path.write_text(text.replace("inertia = 0.0", "inertia = 3.0"), encoding="utf-8")
    return path


def not_run(ended: Ended) -> list[str]:
    return [line for line in ended.err.splitlines() if line.startswith("not run: ")]


def test_methods_that_refuse_a_scene_are_lines_of_run(folder: Path) -> None:
    """Refused beforehand, when it is built, and because a setting does not fit; the other method is
    stored."""
    (folder / "refuses.py").write_text(REFUSES_WHEN_BUILT)
    methods = ("printed/ode45", "refuses.py", "exudyn_tree/rk44", "lagrange/dop853")
    words = [word for name in methods for word in ("-m", name)]
    command = ["run", with_hub(folder), *words, "--set", "step=1e-12", "-o", "r.h5", "-j", 1]
    ended = rotor_mbs(*command)
    assert ended.status == 1
    assert not_run(ended) == [
        f"not run: printed/ode45 on short: {HUB_REASON}",
        "not run: exudyn_tree/rk44 on short: step = 1e-12 requires more than 1e+09 steps for 0.1 "
        "s; allowed: a step of at least 1e-10 s",
        "not run: refuses/late on short: has no place for this scene",
    ]
    assert "2 runs computed (2 ok), 0 already stored, 3 not run" in ended.out
    assert {name: run.status for name, run in rm.open("r.h5")["short"].items()} == {
        "reference": "ok",
        "lagrange/dop853": "ok",
    }
    again = rotor_mbs(*command)  # which computes nothing, and says the same
    assert (again.status, not_run(again)) == (1, not_run(ended))
    assert "nothing to do, 2 already stored, 3 not run" in again.out


def test_a_call_whose_runs_are_all_refused_is_bad_input(folder: Path) -> None:
    (folder / "refuses.py").write_text(REFUSES_WHEN_BUILT)
    scene = with_hub(folder)
    ended = rotor_mbs("run", scene, "-m", "printed/ode45", "-o", "r.h5")
    assert (ended.status, ended.err) == (2, f"not run: printed/ode45 on short: {HUB_REASON}\n")
    assert not Path("r.h5").exists()
    assert rotor_mbs("run", scene, "-m", "refuses.py", "-o", "r.h5", "-j", 1).status == 2


def test_wrong_names_and_values_end_a_batch_before_it_begins(folder: Path) -> None:
    command = [
        "run",
        with_hub(folder),
        "-m",
        "printed/ode45",
        "-m",
        "exudyn_tree/rk44",
        "-o",
        "r.h5",
    ]
    for words in (["-m", "lagrange/tailor"], ["--set", "stpe=1e-3"], ["--set", "step=-1"]):
        ended = rotor_mbs(*command, *words)
        assert ended.status == 2
        assert not not_run(ended)
    assert not Path("r.h5").exists()


def test_a_method_that_the_rule_selects_and_that_refuses_is_a_line_and_no_fault(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "rotor_mbs.methods.catalogue.default_methods", lambda: ("lagrange/dop853", "printed/ode45")
    )
    ended = rotor_mbs("run", with_hub(folder), "-o", "r.h5", "-j", 1)
    assert (ended.status, not_run(ended)) == (0, [f"not run: printed/ode45 on short: {HUB_REASON}"])


def test_methods_and_variants_that_are_refused_are_lines_of_a_sweep(folder: Path) -> None:
    # Without a list of its items a method of a file is built beforehand.
    (folder / "refuses.py").write_text(REFUSES_WHEN_BUILT.replace(", items=lambda scene: []", ""))
    short_scene(folder)
    Path("s.toml").write_text(
        'title = "hubs"\nscene = "short.toml"\nsamples = 3\n[[axis]]\nkey = "hub.inertia"\nvalues '
        "= [0.0, 3.0, 4.0]\n"
    )
    methods = ("-m", "refuses.py", "-m", "printed/ode45", "-m", "lagrange/dop853")
    ended = rotor_mbs("sweep", "s.toml", *methods, "-o", "s.h5", "-j", 1)
    assert ended.status == 1
    assert not_run(ended) == [
        "not run: refuses/late on short: has no place for this scene",
        f"not run: printed/ode45 on 2 runs (1 to 2): {HUB_REASON}",
    ]
    assert StoredSweep(Path("s.h5")).column("status").tolist() == [
        code_of("completed"),
        MISSING,
        MISSING,
        0,
        0,
        0,
    ]
    ended = rotor_mbs("sweep", "s.toml", "-m", "refuses.py", "-o", "none.h5", "-j", 1)
    assert (ended.status, Path("none.h5").exists()) == (2, False)


def test_a_scene_without_modes_is_a_line(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compute = modes_study.compute_modes

    def refuse_one(scene: rm.Scene, *arguments: object, **options: object) -> object:
        if scene.name == "first":
            raise MethodRefusal("first: no model takes it")
        return compute(scene, *arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(modes_study, "compute_modes", refuse_one)
    scene = rm.scene("check/general")
    scenes = [replace(scene, name="first"), replace(scene, name="second")]
    made = modes_study.modes_of_scenes(scenes, folder / "m.h5", workers=0, timeout_s=60.0)
    assert (made[0].status, made[0].message) == ("refused", "no model takes it")
    assert list(read_modes(folder / "m.h5")) == ["second"]


@pytest.mark.full
def test_a_bench_leaves_out_what_cannot_be_measured(folder: Path) -> None:
    """A scene without a motion to compare with, and a method that refuses the other scene."""
    pytest.importorskip("mujoco")
    scene = short_scene(folder)
    command = [
        "bench",
        "extreme/singular-start",
        scene,
        "-m",
        "lagrange/dop853",
        "-o",
        "b.h5",
        "--budget",
        1,
    ]
    ended = rotor_mbs(*command)
    assert ended.status == 1
    (line,) = not_run(ended)
    assert line.startswith("not run: extreme/singular-start: no usable reference (singular: ")
    assert "1 scene measured, 0 already stored, 1 curve not run" in ended.out
    assert {record.scene for record in read_records(folder / "b.h5", "bench")} == {"short"}
    assert (folder / "b-report" / "index.html").exists()


LONGEST = "extreme/pendulum-million"  # 7.9e6 s: more steps of some methods than engines can count


@pytest.mark.full
def test_the_first_and_the_longest_scene_of_the_suite_by_all_methods(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the whole suite, which `nightly` runs, with short limits."""
    monkeypatch.setattr(stability, "_PATIENT_S", 0.5)
    monkeypatch.setattr(stability, "_LONGEST_RUN_S", 0.01)
    ended = rotor_mbs("stability", "stiff/bearing-1e4", LONGEST, "--timeout", 0.5, "-o", "s.h5")
    assert ended.status == 0, ended.err
    _ends_with_table_and_pages(ended, folder / "s.h5")


@pytest.mark.nightly
def test_the_whole_suite_ends_with_its_table_and_pages(folder: Path) -> None:
    """As a user calls it: without arguments."""
    ended = rotor_mbs("stability")
    assert ended.status == 0, ended.err
    _ends_with_table_and_pages(ended, folder / "stability.h5")


def _ends_with_table_and_pages(ended: Ended, results: Path) -> None:
    assert f"not run: exudyn_tree/rk44 on {LONGEST}: step = 0.00025 requires more than" in ended.err
    assert "reported as success" in ended.out  # the table's last head
    assert {run.scene for run in suite_runs(results)} >= {"stiff/bearing-1e4", LONGEST}
    assert (results.with_name(f"{results.stem}-report") / "index.html").exists()
