"""The command line as a user meets it: exit statuses, one line per fault, resuming, and nothing lost."""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from rotor_mbs.cli.arguments import pages_beside, parse
from rotor_mbs.report.pages.scene_tables import metrics_table
from rotor_mbs.runs.read import open_results

RUN = [sys.executable, "-m", "rotor_mbs"]
QUICK = """
title = "quick"
blades = 1
gravity = 9.8
duration = 0.5
samples = 11
[blade]
mass = 10.0
centre_of_mass = [0.1, 0.0, 1.0]
tip = [0.1, 0.0, 2.0]
[initial]
angles = [{angle}, 0.1]
rates = [0, 0]
"""


def rotor_mbs(*arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    done = subprocess.run([*RUN, *map(str, arguments)], capture_output=True, text=True, cwd=cwd)
    assert "Traceback" not in done.stderr
    return done


def hashes(path: Path) -> dict[str, str]:
    with open_results(path) as results:
        return {
            f"{scene.name}/{run.method}": run.attributes["run_hash"]
            for scene in results.scenes.values()
            for run in scene.runs.values()
        }


@pytest.fixture
def quick(tmp_path: Path) -> Path:
    path = tmp_path / "quick.toml"
    path.write_text(QUICK.format(angle=0.5))
    return path


def test_list_and_show(tmp_path: Path) -> None:
    listed = rotor_mbs("list", cwd=tmp_path)
    assert listed.returncode == 0
    assert "paper/fig11" in listed.stdout
    shown = rotor_mbs("show", "paper/fig15-1kNm", "--build", cwd=tmp_path)
    assert shown.returncode == 0
    assert "rotor torque" in shown.stdout
    assert "exudyn_chain" in shown.stdout
    assert "rotor torque" not in rotor_mbs("show", "paper/fig05", "--build", cwd=tmp_path).stdout


def test_list_has_headings_for_scenes_sweeps_and_methods(tmp_path: Path) -> None:
    text = rotor_mbs("list", cwd=tmp_path).stdout
    headings = [line for line in text.splitlines() if line and not line.startswith(" ")]
    assert headings[-3:-1] == ["sweeps", "methods"]
    assert {"scenes: paper", "scenes: stiff"} <= set(headings[:-3])
    assert "  sweeps/fig11-spread" in text
    assert "  lagrange/taylor" in text
    rows = json.loads(rotor_mbs("list", "--json", cwd=tmp_path).stdout)
    assert {row["kind"] for row in rows} == {"scene", "sweep", "method"}


@pytest.mark.parametrize("scene", ["paper/fig11", "paper/fig15-1kNm", "stiff/nrel-5mw-damped"])
def test_what_show_prints_fits_a_screen(scene: str, tmp_path: Path) -> None:
    assert len(rotor_mbs("show", scene, cwd=tmp_path).stdout.splitlines()) <= 30


def test_show_tells_the_settings_of_a_method(tmp_path: Path) -> None:
    text = rotor_mbs("show", "exudyn_tree/rk67", cwd=tmp_path).stdout
    found = json.loads(rotor_mbs("show", "exudyn_tree/rk67", "--json", cwd=tmp_path).stdout)
    assert f"{found['settings']['step']}  a number above 0, in s" in text
    assert found["allowed"]["step"]["allowed"] == "a number above 0, in s"


def test_every_help_has_an_example(tmp_path: Path) -> None:
    text = rotor_mbs(cwd=tmp_path).stdout  # without a command: the help
    assert "start with:" in text
    commands = re.findall(r"^    ([a-z]+)  ", text, re.MULTILINE)
    assert len(commands) > 10
    for command in commands:
        with contextlib.redirect_stdout(io.StringIO()) as printed, pytest.raises(SystemExit):
            parse([command, "--help"])
        assert f"example:\n  rotor-mbs {command}" in printed.getvalue()


def test_files_and_pages_have_the_same_default_in_every_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    commands = (["report"], ["figures"], ["animate", "paper/fig11"])
    assert {parse(command).file for command in commands} == {Path("rotor-mbs-out/results.h5")}
    Path("results.h5").touch()
    assert {parse(command).file for command in commands} == {Path("results.h5")}
    assert {parse([*command, "mine.h5"]).file for command in (*commands, ["check"])} == {Path("mine.h5")}
    assert pages_beside(Path("a/mine.h5")) == Path("a/mine-report")
    assert pages_beside(Path("rotor-mbs-out/results.h5")) == Path("rotor-mbs-out/report")


def test_a_new_scene_file_runs_and_replaces_no_other(tmp_path: Path) -> None:
    assert rotor_mbs("new", "mine.toml", cwd=tmp_path).returncode == 0
    assert rotor_mbs("show", "mine.toml", cwd=tmp_path).returncode == 0
    again = rotor_mbs("new", "mine.toml", cwd=tmp_path)
    assert again.returncode == 2
    assert "File exists" in again.stderr


def test_settings_are_stored_and_unknown_ones_refused(tmp_path: Path, quick: Path) -> None:
    command = ("run", quick, "-m", "lagrange/dop853", "-o", "r.h5", "--set")
    assert rotor_mbs(*command, "relative_tolerance=1e-6", cwd=tmp_path).returncode == 1  # inaccurate
    with open_results(tmp_path / "r.h5") as results:
        assert results.scenes["quick"].runs["lagrange/dop853"].settings["relative_tolerance"] == 1e-6
        (*_, (cell, *_)) = metrics_table(results.scenes["quick"]).rows
        assert str(cell.note) == "lagrange/dop853, relative_tolerance = 1e-06"
    assert "1 runs made" in rotor_mbs(*command, "relative_tolerance=1e-7", cwd=tmp_path).stdout
    for wrong, says in (("tolerence=1e-3", "tolerence"), ("relative_tolerance=-1", "-1"), ("x", "NAME=VALUE")):
        refused = rotor_mbs(*command, wrong, cwd=tmp_path)
        assert refused.returncode == 2
        assert says in refused.stderr
        assert len(refused.stderr.splitlines()) == 1


def test_run_writes_every_run_and_a_second_one_has_nothing_to_do(tmp_path: Path, quick: Path) -> None:
    first = rotor_mbs("run", quick, "-m", "lagrange/dop853", "-m", "exudyn_tree/rk67", "-o", "r.h5", cwd=tmp_path)
    assert first.returncode == 0, first.stderr
    assert "3 runs made (3 ok)" in first.stdout
    table = [line.split() for line in first.stdout.splitlines() if line.startswith("quick ")]
    assert [row[:3] for row in table] == [
        ["quick", "reference", "ok"], ["quick", "lagrange/dop853", "ok"], ["quick", "exudyn_tree/rk67", "ok"],
    ]  # fmt: skip
    before = (tmp_path / "r.h5").read_bytes()
    second = rotor_mbs("run", quick, "-m", "lagrange/dop853", "-m", "exudyn_tree/rk67", "-o", "r.h5", cwd=tmp_path)
    assert "nothing to do, 3 there already" in second.stdout
    assert (tmp_path / "r.h5").read_bytes() == before
    third = rotor_mbs("run", quick, "-m", "lagrange/radau", "-o", "r.h5", cwd=tmp_path)
    assert "1 runs made" in third.stdout
    assert sorted(hashes(tmp_path / "r.h5")) == [
        "quick/exudyn_tree/rk67",
        "quick/lagrange/dop853",
        "quick/lagrange/radau",
        "quick/reference",
    ]
    assert not list(tmp_path.glob("*.parts"))


def test_a_scene_with_other_numbers_does_not_silently_replace_runs(tmp_path: Path, quick: Path) -> None:
    both = ("-m", "lagrange/dop853", "-m", "exudyn_tree/rk67", "-o", "r.h5")
    assert rotor_mbs("run", quick, *both, cwd=tmp_path).returncode == 0
    old = hashes(tmp_path / "r.h5")
    quick.write_text(QUICK.format(angle=0.6))
    refused = rotor_mbs("run", quick, "-m", "lagrange/dop853", "-o", "r.h5", cwd=tmp_path)
    assert refused.returncode == 2
    assert "exudyn_tree/rk67" in refused.stderr
    assert hashes(tmp_path / "r.h5") == old
    assert rotor_mbs("run", quick, *both, cwd=tmp_path).returncode == 0
    new = hashes(tmp_path / "r.h5")
    assert new.keys() == old.keys()
    assert not set(new.values()) & set(old.values())


def test_a_killed_batch_goes_on_where_it_stopped(tmp_path: Path) -> None:
    """Killed after its first pieces: the next one makes only what is missing, and the file is whole."""
    command = [*RUN, "run", "paper/fig05", "paper/fig06", "-m", "exudyn_chain/generalized_alpha"]
    command += ["-m", "lagrange/dop853", "-o", "r.h5", "-j", "1"]
    batch = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL, start_new_session=True)
    parts = tmp_path / "r.h5.parts"
    deadline = time.monotonic() + 60
    while len(list(parts.glob("*.h5"))) < 3 and time.monotonic() < deadline:
        time.sleep(0.02)
    os.killpg(batch.pid, signal.SIGKILL)
    batch.wait()
    finished = {path.name: path.stat().st_mtime_ns for path in parts.glob("*.h5")}
    assert len(finished) >= 3
    assert not (tmp_path / "r.h5").exists()
    again = rotor_mbs(*command[3:], cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert f"{6 - len(finished)} runs made" in again.stdout or len(finished) == 6
    assert len(hashes(tmp_path / "r.h5")) == 6


def test_interrupt_ends_with_130_and_keeps_what_is_finished(tmp_path: Path) -> None:
    command = [*RUN, "run", "paper/fig05", "paper/fig11", "-m", "exudyn_chain/generalized_alpha", "-o", "r.h5"]
    batch = subprocess.Popen([*command, "-j", "1"], cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    parts = tmp_path / "r.h5.parts"
    deadline = time.monotonic() + 60
    while len(list(parts.glob("*.h5"))) < 2 and time.monotonic() < deadline:
        time.sleep(0.02)
    batch.send_signal(signal.SIGINT)
    _, told = batch.communicate(timeout=30)
    assert batch.returncode == 130
    assert "Traceback" not in told
    assert len(list(parts.glob("*.h5"))) >= 2


def test_a_run_over_its_time_limit_is_recorded_and_the_rest_goes_on(tmp_path: Path, quick: Path) -> None:
    ended = rotor_mbs(
        "run", "paper/fig11", quick, "-m", "exudyn_chain/generalized_alpha", "--timeout", "0.6", "-o", "r.h5",
        cwd=tmp_path,
    )  # fmt: skip
    assert ended.returncode == 1
    with open_results(tmp_path / "r.h5") as results:
        assert results.scenes["paper/fig11"].runs["exudyn_chain/generalized_alpha"].status == "timed_out"
        assert results.scenes["quick"].runs["exudyn_chain/generalized_alpha"].status == "ok"


def test_a_run_without_a_single_finite_sample_is_stored_as_what_it_is(tmp_path: Path) -> None:
    """Rates of 1e200: the engine reports success, and has nothing to show for it."""
    ended = rotor_mbs("run", "extreme/rate-1e200", "-m", "exudyn_tree/rk44", "-o", "r.h5", cwd=tmp_path)
    assert ended.returncode == 1
    with open_results(tmp_path / "r.h5") as results:
        run = results.scenes["extreme/rate-1e200"].runs["exudyn_tree/rk44"]
        assert run.status == "diverged"
        assert run.attributes["false_success"] == 1
        assert not len(run.array("time"))


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["run", "paper/fig99"], "no such scene"),
        (["run", "../paper"], "../paper"),
        (["run", "paper/fig05", "-m", "magic/rk4"], "allowed: printed/ode45"),
        (["run", "paper/fig05", "-j", "0"], "allowed: a whole number from 1 to"),
        (["run", "paper/fig05", "--timeout", "nan"], "allowed: seconds, more than 0"),
        (["show", "paper"], "one scene"),
        (["report", "missing.h5"], "no such file"),
        (["report", "."], "is a folder"),
        (["frobnicate"], "no command 'frobnicate'; allowed: list"),
        (["reprodcue"], "perhaps reproduce"),
        (["bench", "--budget", "0"], "allowed: seconds, more than 0"),
        (["bench", "--no-such-option"], "--no-such-option"),
    ],
)
def test_bad_usage_ends_with_2_and_one_clear_line(arguments: list[str], says: str, tmp_path: Path) -> None:
    done = rotor_mbs(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert says in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_the_printed_model_refuses_what_it_cannot_represent(tmp_path: Path, quick: Path) -> None:
    quick.write_text(QUICK.format(angle=0.5) + "[hub]\ninertia = 3.0\n")
    done = rotor_mbs("run", quick, "-m", "printed/ode45", cwd=tmp_path)
    assert done.returncode == 2
    assert "hub" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_an_output_that_cannot_be_written_is_one_line(tmp_path: Path, quick: Path) -> None:
    (tmp_path / "file").write_text("")
    done = rotor_mbs("run", quick, "-m", "lagrange/dop853", "-o", "file/r.h5", cwd=tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1


def test_a_full_disk_is_one_line_and_loses_nothing(tmp_path: Path) -> None:
    """A file system of 4 MB fills up: what was stored still opens, and with more room the batch goes on."""
    small = tmp_path / "small"
    small.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", small], capture_output=True).returncode:
        pytest.skip("a small file system cannot be mounted here")
    try:
        batch = ("run", "paper/fig05", "-m", "lagrange/dop853", "-m", "printed/ode45", "-o", "r.h5")
        assert rotor_mbs(*batch, cwd=small).returncode == 0
        stored = hashes(small / "r.h5")
        (small / "ballast").write_bytes(b"x" * (3_000_000))
        more = ("run", "paper/fig05", "paper/fig06", "paper/fig08", "-m", "lagrange/dop853", "-o", "r.h5")
        full = rotor_mbs(*more, cwd=small)
        assert full.returncode in (1, 2)
        assert "No space left" in full.stderr.splitlines()[-1]
        assert hashes(small / "r.h5") == stored
        (small / "ballast").unlink()
        again = rotor_mbs(*more, cwd=small)
        assert again.returncode == 0, again.stderr
        assert stored.items() <= hashes(small / "r.h5").items()
    finally:
        subprocess.run(["umount", small], check=True)


def test_samples_do_not_depend_on_how_many_processes(tmp_path: Path) -> None:
    scenes = ("paper/fig08", "paper/fig03", "-m", "lagrange/dop853", "-m", "exudyn_tree/rk67")
    for jobs in ("1", "2"):
        assert rotor_mbs("run", *scenes, "-j", jobs, "-o", f"{jobs}.h5", cwd=tmp_path).returncode == 0
    with open_results(tmp_path / "1.h5") as one, open_results(tmp_path / "2.h5") as two:
        for name, scene in one.scenes.items():
            for method, run in scene.runs.items():
                assert (run.array("angles") == two.scenes[name].runs[method].array("angles")).all()
