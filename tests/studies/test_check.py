"""`check`: all well as shipped; every kind of loss fails, and the line that fails names it."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from support.checking import (
    EVERY_SECOND_SAMPLE,
    WRONG,
    add_run,
    failed,
    faulty_run,
    judged,
    results_file,
)
from support.commands import PROGRAM, refusal, rotor_mbs
from support.frozen_references import digests, freeze
from support.scenes import paper, shipped
from support.stored import Made, change_row, damage, drop, rotor, store
from support.sweeps import THREE_RUNS, made_sweep

import rotor_mbs as rm
from rotor_mbs.analysis.checks import Check, Where
from rotor_mbs.cli import verdicts as formats
from rotor_mbs.methods.catalogue import REFERENCE, method_names
from rotor_mbs.methods.solve import solve
from rotor_mbs.runs.merge import fit_file_to_request
from rotor_mbs.runs.rows import Rows
from rotor_mbs.scenario.accuracy_bounds import Bound, shipped_bounds
from rotor_mbs.scenario.catalogue import REFERENCES
from rotor_mbs.solution.metrics import horizon_samples, running_growth
from rotor_mbs.studies.check import regressions
from rotor_mbs.studies.stored_references import frozen_solution

ROOT = Path(__file__).parents[2]
SCENE, METHOD = "check/general", "lagrange/dop853"


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene made for checking by two right models: every check of it passes."""
    return results_file(
        tmp_path_factory.mktemp("check") / "good.h5", [SCENE], (METHOD, "exudyn_tree/rk67")
    )


@pytest.fixture
def copy(good: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(good, tmp_path / "results.h5"))


def lines_of(*arguments: object, status: int) -> list[str]:
    """The lines of `rotor-mbs check ...`, which must end with `status`."""
    ended = rotor_mbs("check", *arguments)
    assert ended.status == status
    return ended.out.splitlines()


def named(lines: list[str], *words: str) -> str:
    """The one line that has all the words."""
    matching = [line for line in lines if all(word in line for word in words)]
    assert len(matching) == 1, lines
    return matching[0]


# All is well


def test_what_is_shipped_passes_in_short(good: Path) -> None:
    lines = lines_of(good, "-v", status=0)
    assert lines[-1].endswith(" passed, 0 failed")
    names = (
        "integrity",
        "complete",
        "status",
        "metrics",
        "times",
        "start",
        "defect",
        "defect median",
        "error",
        "energy",
        "energies",
        "tip",
        "reference",
        "growth",
        "uncertainty",
        "frozen",
        "settings",
    )
    assert lines[-2] == f"runs checked: 1 {METHOD}, 1 exudyn_tree/rk67"
    assert {line.split(":")[0] for line in lines[:-2]} == {f"pass {name}" for name in names}


def test_where_there_is_nothing_to_judge_the_command_says_so(tmp_path: Path) -> None:
    fit_file_to_request(tmp_path / "empty.h5", [])
    for path in (results_file(tmp_path / "reference.h5", [SCENE], []), tmp_path / "empty.h5"):
        assert refusal("check", path, "--require", METHOD) == (
            f"{path}: nothing to check: no run of a method"
        )


@pytest.mark.nightly  # .ci/wheel runs and checks the scenes of the paper by these methods
def test_the_default_set_passes(tmp_path: Path) -> None:
    lines_of("--json", tmp_path / "check.json", status=0)
    assert all(row["passed"] for row in json.loads((tmp_path / "check.json").read_text()))


# Faults in the models


@pytest.mark.parametrize(
    "scene",
    [
        "check/general",
        *(pytest.param(f"paper/{name}", marks=pytest.mark.full) for name in ("fig08", "fig11")),
    ],
)
def test_a_reference_computed_now_is_the_frozen_one(scene: str) -> None:
    pytest.importorskip("heyoka")
    frozen, own = (
        run.trajectory
        for run in (frozen_solution(shipped(scene)), solve(REFERENCE, shipped(scene), {}))
    )
    assert own.angle_uncertainty is not None
    growth = np.abs(np.log(running_growth(own) / running_growth(frozen)))[: horizon_samples(frozen)]
    used = (own.angle_uncertainty > 0.0) & (frozen.angle_uncertainty > 0.0)
    uncertainty = np.abs(np.log(own.angle_uncertainty[used] / frozen.angle_uncertainty[used]))
    beyond = np.abs(own.angles - frozen.angles).max(axis=1) - own.angle_uncertainty
    for name, differences in {
        "reference": beyond,
        "growth": growth,
        "uncertainty": uncertainty,
    }.items():
        assert differences.max(initial=0.0) <= shipped_bounds().of(name, REFERENCE).value


# Faults in files


def _with(name: str, at: object, value: float) -> Callable[[Rows], None]:
    def change(row: Rows) -> None:
        row[name][at] = value

    return change


def _without_last_sample(row: Rows) -> None:
    row["samples"][...] = 150
    row["angles"][-1] = np.nan


TAMPERING: dict[str, tuple[Callable[[Rows], None], tuple[str, ...]]] = {
    "a sample missing": (
        _without_last_sample,
        ("FAIL complete", "stored as ok; 150 of 151 samples"),
    ),
    "a channel missing": (_with("tip", ..., math.nan), ("FAIL complete", "tip is missing")),
    "a NaN": (_with("rates", 7, math.nan), ("FAIL complete", "rates is not finite at sample 7")),
    "a touched angle": (_with("angles", 20, 3.0), ("FAIL tip",)),
    "a touched rate": (_with("rates", 20, 3.0), ("FAIL energies", "kinetic energy")),
    "a touched work": (_with("work", 20, 3.0), ("FAIL energy", "balance")),
    "an edited error": (_with("angle_error_max", ..., 1e-17), ("FAIL metrics", "angle_error_max")),
    "a huge number": (_with("angles", 20, 1e308), ("FAIL tip",)),
}


@pytest.mark.parametrize("fault", TAMPERING)
def test_a_run_that_was_changed_together_with_its_checksum_fails(fault: str, copy: Path) -> None:
    change, words = TAMPERING[fault]
    change_row(copy, f"{SCENE}/{METHOD}", change)
    lines = lines_of(copy, status=1)
    named(lines, f": check/general {METHOD} ", *words)
    assert not any("exudyn_tree" in line for line in lines[:-2])  # and nobody else


@pytest.mark.parametrize(("column", "bit"), [("tip", 0), ("samples", 7)])
def test_a_changed_byte_is_of_its_run(column: str, bit: int, copy: Path) -> None:
    """Whatever it does to the other checks: a number of samples below zero."""
    damage(copy, f"{SCENE}/{METHOD}", column, bit=bit)
    named(
        lines_of(copy, status=1),
        f"FAIL integrity: {SCENE} {METHOD} row",
        "changed after it was written",
    )


def test_a_false_success_and_an_edited_status_fail(copy: Path) -> None:
    """A run that is wrong, stored as it was judged, fails by its numbers; called ok, by its status
    too."""
    scene = shipped("check/general")
    add_run(copy, scene, faulty_run("offset", scene, METHOD, 0.5))
    lines = lines_of(copy, status=1)
    named(lines, f"FAIL defect: check/general {METHOD} largest")
    assert not any("FAIL status" in line for line in lines)

    def call_it_ok(row: Rows) -> None:
        assert row["engine_success"] == 1
        row["status"][...] = row["false_success"][...] = 0

    change_row(copy, f"{SCENE}/{METHOD}", call_it_ok)
    line = named(
        lines_of(copy, status=1),
        f"FAIL status: check/general {METHOD}",
        "stored ok, its samples give",
    )
    assert "report of success is false" in line


def test_a_model_that_is_not_there_is_missed_where_it_is_required(copy: Path) -> None:
    required = ("--require", METHOD, "--require", "exudyn_tree/rk67")
    lines_of(copy, *required, status=0)
    drop(copy, "check/general", METHOD)
    lines_of(copy, status=0)
    lines = lines_of(copy, *required, "--require", "mine/lsoda", status=1)
    for method in (METHOD, "mine/lsoda"):
        named(
            lines,
            "FAIL required: check/general",
            method,
            "not in the file, which has reference, exudyn_tree/rk67",
        )


def test_a_sweep_is_checked_for_methods_and_for_runs_of_an_earlier_file(tmp_path: Path) -> None:
    for name, values in (("old", "9.7, 9.8, 9.9"), ("new", "9.9, 9.7")):
        (tmp_path / name).mkdir()
        made_sweep(tmp_path / name, THREE_RUNS.replace("9.7, 9.8, 9.9", values))
    old, new = tmp_path / "old/s.h5", tmp_path / "new/s.h5"
    lines = lines_of(old, "--require", METHOD, "--against", new, status=0)
    assert lines[-2].startswith("runs of a sweep: checked that all are there and as written; ")
    named(
        lines_of(old, "--require", "mine/lsoda", status=1),
        "FAIL required: paper/fig11",
        f"has {METHOD}",
    )
    named(
        lines_of(new, "--against", old, status=1),
        "FAIL against",
        "1 of 3 runs of the earlier file",
    )


def test_a_scene_that_changed_since_the_earlier_file_fails_unless_it_may(tmp_path: Path) -> None:
    """Both files pass for themselves: by their own scene every run is right."""
    scene = shipped("paper/fig03").replace(duration=0.1, samples=11, outputs=["angles", "rates"])
    files = []
    for name, changes in (
        ("old", {"blade.mass": 15015.0, "torque.rotor": 20.0}),
        ("new", {"blade.mass": 15016.0, "initial.angles[1]": 0.25, "torque.rotor": 20.0}),
    ):
        runs = rm.run(scene.replace(**changes), [METHOD])
        files.append(runs.save(tmp_path / f"{name}.h5"))
    old, new = files
    lines = lines_of(new, status=0)
    start = f"{scene.name}, changed: duration, blade.mass, initial.angles[1] and 1 more"
    assert start in lines
    line = named(lines_of(new, "--against", old, status=1), f"FAIL scene: {scene.name} *")
    angle = str(scene.initial_angles[1]).removesuffix(".0")
    change = (
        f"; {scene.name}: blade.mass 15015 -> 15016, initial.angles[1] {angle} -> 0.25; margins of "
        "another scene are not compared"
    )
    assert line.endswith(change)
    allowed = lines_of(new, "--against", old, "--allow-changed", "-v", status=0)
    assert named(allowed, "pass scene").endswith(change)
    assert not any(line.startswith("pass against") for line in allowed)
    assert not any("scene:" in line for line in lines_of(new, "--against", new, status=0))
    assert rotor_mbs("check", new, "--allow-changed").status == 2


def test_of_a_changed_scene_only_missing_runs_are_regressions() -> None:
    before = [Check("defect", Where("one", METHOD, name), 1e-9, 1.0, "", "rad") for name in "ab"]
    now = [replace(check, value=0.5) for check in before]
    assert len(regressions(now, before)) == 2
    assert not regressions(now, before, {"one"})
    (lost,) = regressions([], before, {"one"})
    assert (lost.passed, lost.where.channel) == (False, "run: all")


def test_a_margin_that_shrank_with_a_setting_names_the_setting(tmp_path: Path) -> None:
    scene = shipped("check/general").replace(duration=0.1, samples=11, outputs=["angles", "rates"])
    files = []
    for tolerance in (3e-14, 1e-10):
        runs = rm.run(scene, [METHOD], relative_tolerance=tolerance)
        files.append(runs.save(tmp_path / f"{tolerance}.h5"))
    old, new = files
    lines = lines_of(new, "--against", old, status=1)
    line = named(lines, "FAIL against", METHOD, "defect: largest")
    assert "; settings changed: relative_tolerance 3e-14 -> 1e-10; up to t = " in line
    assert "settings changed" not in "".join(lines_of(old, "--against", old, "-v", status=0))


def test_a_sweep_of_a_changed_scene_fails_against_an_earlier_one(tmp_path: Path) -> None:
    scene = paper("fig11", samples=11, duration=0.1)
    files = []
    for name, mass in (("old", 15000.0), ("new", 15010.0)):
        base = scene.replace(**{"blade.mass": mass})
        path = tmp_path / f"{name}.h5"
        rm.sweep(base, {"gravity": [9.7, 9.8]}, methods=[METHOD], output=path)
        files.append(path)
    line = named(lines_of(files[1], "--against", files[0], status=1), "FAIL scene")
    assert "; paper/fig11: blade.mass 15000 -> 15010; margins" in line


def test_a_reference_that_is_altered_or_not_there_fails(copy: Path) -> None:
    change_row(copy, f"{SCENE}/reference", _with("angles", 50, 1.2345))
    named(
        lines_of(copy, status=1),
        f"FAIL reference: {SCENE} reference angles",
        "an altered reference",
    )
    drop(copy, SCENE, "reference")
    named(lines_of(copy, status=1), f"FAIL reference: {SCENE} reference all", "no reference")


def test_references_of_a_results_file_are_frozen_bit_for_bit(good: Path, tmp_path: Path) -> None:
    """Those of `good` were read from the shipped file."""
    freeze(good, target=tmp_path / "again.h5")
    lines = (tmp_path / "again.sha256").read_text().splitlines()
    assert lines
    assert {*lines} <= {*(REFERENCES / "check.sha256").read_text().splitlines()}


def test_the_shipped_references_are_bit_for_bit_those_that_were_frozen(tmp_path: Path) -> None:
    """A number touched in its last bit is found, beyond its horizon, too, where no agreement would
    tell."""
    for path in REFERENCES.glob("*.h5"):
        assert digests(path) == path.with_suffix(".sha256").read_text()

    def touch(row: Rows) -> None:
        row["angles"][900, 2] = np.nextafter(row["angles"][900, 2], np.inf)

    touched = Path(shutil.copy(REFERENCES / "paper.h5", tmp_path))
    change_row(touched, "paper/fig12/reference", touch)
    now, frozen = (
        digests(touched).splitlines(),
        (REFERENCES / "paper.sha256").read_text().splitlines(),
    )
    assert [new.split()[1:] for new, old in zip(now, frozen, strict=True) if new != old] == [
        ["paper/fig12", "angles"]
    ]


# Bounds


def test_every_bound_is_below_what_a_known_fault_gives() -> None:
    for bound in shipped_bounds().entries:
        assert bound.value < bound.fault, bound
        assert bound.known_fault


def _known_faults() -> Iterator[tuple[Bound, str, str, float]]:
    """Each bound whose known fault is a number of a scene that is off: with the scene, a method,
    and by how much."""
    for bound in shipped_bounds().entries:
        text, _, place = bound.known_fault.rstrip(")").partition(" (")
        scene = place if "/" in place else f"paper/{place}"
        own = replace(shipped_bounds(), scene="" if bound.scenes == "*" else scene)
        methods = [
            name for name in method_names(is_corrected=True) if own.find(bound.check, name) == bound
        ]
        if methods and (bound.check in WRONG or bound.check == "gap"):
            share = {"no gravity": -1.0, "every second sample omitted": EVERY_SECOND_SAMPLE}.get(
                text
            )
            if share is None:
                number, percent = re.findall(r"error of (\S+)( %)?", text)[0]
                share = float(number) * (0.01 if percent else 1.0)
            yield bound, scene, METHOD if METHOD in methods else methods[0], share


@pytest.mark.parametrize(
    ("bound", "scene_name", "method", "share"),
    [
        pytest.param(
            *row, id=f"{row[0].check}-{row[2]}",
            marks=() if row[0].check == "defect" and row[2] == METHOD else pytest.mark.full,
        )
        for row in _known_faults()
    ],
)  # fmt: skip
def test_a_known_fault_reaches_what_its_bound_says(
    bound: Bound, scene_name: str, method: str, share: float, tmp_path: Path
) -> None:
    if method.startswith("mujoco"):
        pytest.importorskip("mujoco")
    scene = shipped(scene_name)
    path = results_file(tmp_path / "fault.h5", [scene_name], [])
    add_run(path, scene, faulty_run(bound.check, scene, method, share))
    values = [
        check.value
        for check in failed(judged(path))
        if (check.name, check.where.method) == (bound.check, method)
    ]
    assert max(values) >= bound.fault


def test_a_users_bound_goes_before_the_shipped_one(good: Path, tmp_path: Path) -> None:
    own = tmp_path / "own.toml"
    own.write_text(
        '[[bound]]\ncheck = "energy"\nmethod = "exudyn_*"\nvalue = 0\nreason = '
        '"nothing is good enough"\n'
    )
    lines = lines_of(good, "--bounds", own, status=1)
    assert {line.split(":")[0] for line in lines[:-2]} == {"FAIL energy"}
    assert all("exudyn_tree" in line and "bound 0.00e+00" in line for line in lines[:-2])


def test_a_users_bound_that_fits_no_check_is_named(good: Path, tmp_path: Path) -> None:
    """A misspelt method would else leave a check of CI without its bound."""
    own = tmp_path / "own.toml"
    entry = '[[bound]]\ncheck = "{}"\nmethod = "{}"\nvalue = 1\nreason = "ours"\n'
    fits = entry.format("error", "exudyn_*") + f'scenes = "{SCENE}"\n'
    own.write_text(fits + entry.format("error", "exudyn_tree/rk68"))
    ended = rotor_mbs("check", good, "--bounds", own)
    assert ended.status == 0
    (warning,) = ended.err.splitlines()
    assert "own.toml: no check fits the bound of 'error', method 'exudyn_tree/rk68'" in warning
    own.write_text(entry.format("error", "exudyn_*") + 'scenes = "mine"\n')
    (warning,) = rotor_mbs("check", good, "--bounds", own).err.splitlines()
    assert warning.endswith("scenes 'mine'; scenes: of shipped scenes, unchanged")


# Stored numbers


@pytest.mark.parametrize(
    "name", ["horizon_s", "defect_max", "angle_uncertainty", "error_growth", "rates"]
)
def test_a_number_of_the_reference_that_is_edited_is_seen(name: str, copy: Path) -> None:
    """With a new checksum; halved, a defect by 1e-9 rad, and of its arrays the last bit of one
    number."""

    def edit(row: Rows) -> None:
        if row[name].ndim:
            row[name][-1] = np.nextafter(row[name][-1], np.inf)
        else:
            row[name][...] = 0.5 * row[name] + 1e-9

    change_row(copy, f"{SCENE}/reference", edit)
    (failure,) = failed(judged(copy))
    assert (failure.name, failure.where.scene, failure.where.method) == (
        "metrics" if name in ("horizon_s", "defect_max") else "frozen", SCENE, REFERENCE,
    )  # fmt: skip
    assert failure.where.channel == name


# Files that are none


def test_a_stored_scene_that_is_none_is_refused(tmp_path: Path) -> None:
    path = store(
        tmp_path / "r.h5", [Made(paper("fig11", text="blades = 'three'"), METHOD, rotor(np.sin))]
    )
    assert rotor_mbs("check", path).status == 2


# What other programs read


def test_hostile_texts_in_a_file_come_out_as_text(tmp_path: Path) -> None:
    scene = replace(paper("fig11", samples=11), name="check/h]]><&", title="<script>\x1b")
    told = {"status": "singular", "message": "<b>\x1b[2J\n::error::%0A&"}
    made = [
        Made(scene, REFERENCE, rotor(np.sin)),
        Made(scene, METHOD, rotor(np.sin), attributes=told, until=0.5),
    ]
    path = store(tmp_path / "hostile.h5", made)
    files = ("--github", "--junit", tmp_path / "c.xml", "--json", tmp_path / "c.json", "-v")
    lines = lines_of(path, *files, status=1)
    assert all(line.isprintable() for line in lines)
    assert len([line for line in lines if line.startswith("::error ")]) == formats.WORST
    assert not any(line.startswith("::error::") for line in lines)
    (suite,) = ElementTree.parse(tmp_path / "c.xml").getroot()
    # in place of the lines of these failures
    annotations = [line for line in lines if line.startswith("::error ")]
    failures = len(annotations) + sum(line.startswith("FAIL") for line in lines)
    assert suite.attrib["name"] == scene.name
    assert suite.attrib["failures"] == str(len(list(suite.iter("failure")))) == str(failures)
    # NaN is no JSON
    rows = json.loads((tmp_path / "c.json").read_text(), parse_constant=pytest.fail)
    assert [row["passed"] for row in rows].count(False) == failures
    assert len(rows) == len(annotations) + sum(line[:4] in ("pass", "FAIL") for line in lines)


def test_a_run_without_samples_says_why_and_one_file_is_not_written_twice(tmp_path: Path) -> None:
    failure = {"status": "solver_failed", "message": "no step"}
    path = store(
        tmp_path / "r.h5",
        [Made(paper("fig11"), METHOD, rotor(np.sin), attributes=failure, until=0.0)],
    )
    line = named(lines_of(path, status=1), "FAIL complete", METHOD)
    assert line.endswith("; stored as solver_failed: no step; no samples")
    assert rotor_mbs("check", "--junit", tmp_path / "a", "--json", tmp_path / "a").status == 2
    assert not (tmp_path / "a").exists()


def test_json_on_standard_output_is_alone_there(good: Path) -> None:
    ended = rotor_mbs("check", good, "--json", "-", "-v")
    assert ended.status == 0
    assert all(row["passed"] for row in json.loads(ended.out))
    assert ended.err.endswith(" passed, 0 failed\n")


# Without heyoka


@pytest.mark.full
def test_without_heyoka_a_scene_of_ones_own_has_a_reference(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text("import sys\nsys.modules['heyoka'] = None\n")
    (tmp_path / "own.toml").write_text(paper("fig11", duration=0.5, samples=51).text)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}
    for words in (["run", "own.toml", "-o", "r.h5"], ["check", "r.h5", "--json", "c.json"]):
        subprocess.run([*PROGRAM, *words], cwd=tmp_path, env=environment, check=True, timeout=550)
    methods = {row["method"] for row in json.loads((tmp_path / "c.json").read_text())}
    assert {REFERENCE, "lagrange/dop853"} <= methods
    assert "lagrange/taylor" not in methods
