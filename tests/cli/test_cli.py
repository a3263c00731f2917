"""The command line as a user meets it: exit statuses, one line per error, resuming."""

from __future__ import annotations

import itertools
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from support.commands import Ended, refusal, rotor_mbs
from support.scenes import paper

import rotor_mbs as rm
from rotor_mbs.report.pages import agreement_table
from rotor_mbs.runs.read import open_results
from rotor_mbs.scenario.scene import OUTPUTS, scene_toml

QUICK = rm.scene("paper/fig03").replace(duration=0.5, samples=11).text
BOTH = ("-m", "lagrange/dop853", "-m", "exudyn_tree/rk67")


@pytest.fixture(scope="module")
def first_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Ended]:
    """The results file of `quick`, and the command that made it."""
    folder = tmp_path_factory.mktemp("quick")
    (folder / "quick.toml").write_text(QUICK)
    return folder / "r.h5", rotor_mbs(
        "run", folder / "quick.toml", *BOTH, "-o", folder / "r.h5", "-j", "1"
    )


@pytest.fixture
def quick(folder: Path) -> Path:
    path = folder / "quick.toml"
    path.write_text(QUICK)
    return path


@pytest.fixture
def stored(folder: Path, first_run: tuple[Path, Ended]) -> Path:
    return Path(shutil.copy(first_run[0], folder))


# What only prints


def test_list_has_scenes_sweeps_and_methods() -> None:
    text = rotor_mbs("list").out
    headings = {line for line in text.splitlines() if line and not line.startswith(" ")}
    assert {"scenes: paper", "scenes: stiff", "sweeps", "methods"} <= headings
    assert all(
        f"  {name}  " in text for name in ("paper/fig11", "sweeps/fig11-spread", "lagrange/taylor")
    )
    rows = json.loads(rotor_mbs("list", "--json").out)
    assert {row["kind"] for row in rows} == {"scene", "sweep", "method"}


def test_list_and_every_help_load_no_library_that_takes_time() -> None:
    """NumPy alone takes as long as all else that `list` does."""
    code = (
        "import sys\nfrom rotor_mbs.cli import main\nfrom rotor_mbs.cli.arguments import "
        "_parser\nfor words in (['list'], ['--help'], *([name, '--help'] for name in "
        "_parser()[1])):\n    try:\n        main(words)\n    except SystemExit:\n        "
        "pass\nprint(*sorted({name.partition('.')[0] for name in sys.modules}))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.splitlines()[-1].split())
    assert not loaded & {
        "numpy",
        "scipy",
        "pydantic",
        "h5py",
        "matplotlib",
        "exudyn",
        "heyoka",
        "mujoco",
    }


def test_show_build_lists_what_a_scene_needs_and_no_more() -> None:
    text = rotor_mbs("show", "paper/fig15-1kNm", "--build").out
    assert "rotor torque" in text
    assert "exudyn_chain" in text
    assert "torque.rotor, N m            1000.0\n" in text  # constant: as in the file, no table
    assert "rotor torque" not in rotor_mbs("show", "paper/fig05", "--build").out
    assert "(not available: " in rotor_mbs("show", "stiff/nrel-5mw-damped").out


# Runs


def test_settings_are_stored_and_unknown_ones_refused(quick: Path, stored: Path) -> None:
    command = ("run", quick, "-m", "lagrange/dop853", "-o", stored, "-j", "1", "--set")
    ended = rotor_mbs(*command, "relative_tolerance=1e-6")
    assert ended.status == 1  # inaccurate
    assert "1 run computed" in ended.out
    with open_results(stored) as results:
        assert (
            results.scenes["quick"].runs["lagrange/dop853"].settings["relative_tolerance"] == 1e-6
        )
        notes = [str(cell.note) for cell, *_ in agreement_table(results.scenes["quick"]).rows]
        assert "lagrange/dop853, relative_tolerance = 1e-06" in notes
    assert "NAME=VALUE" in refusal(*command, "x")


def test_run_writes_every_run_and_a_second_one_has_nothing_to_do(
    quick: Path, stored: Path, first_run: tuple[Path, Ended]
) -> None:
    first = first_run[1]
    assert first.status == 0, first.err
    assert "3 runs computed (3 ok)" in first.out
    table = [line.split()[:3] for line in first.out.splitlines() if line.startswith("quick ")]
    assert table == [
        ["quick", method, "ok"] for method in ("reference", "lagrange/dop853", "exudyn_tree/rk67")
    ]
    before = stored.read_bytes()
    assert "nothing to do, 3 " in rotor_mbs("run", quick, *BOTH, "-o", stored, "-j", "1").out
    assert stored.read_bytes() == before
    assert {path.name for path in Path().iterdir()} == {"quick.toml", "r.h5"}


@pytest.mark.full
def test_a_run_over_its_time_limit_is_recorded_and_the_rest_goes_on(quick: Path) -> None:
    method = "exudyn_chain/generalized_alpha"
    ended = rotor_mbs("run", "paper/fig11", quick, "-m", method, "--timeout", "0.6", "-o", "r.h5")
    assert ended.status == 1
    with open_results(Path("r.h5")) as results:
        assert results.scenes["paper/fig11"].runs[method].status == "timed_out"
        assert results.scenes["quick"].runs[method].status == "ok"


@pytest.mark.parametrize("command", ["run", "sweep"])
def test_a_misspelt_method_of_a_file_is_told_with_the_other_errors(
    command: str, quick: Path
) -> None:
    quick.write_text('methods = ["lagrange/tailor"]\nsamples = 1\n')
    ended = rotor_mbs(command, quick)
    assert ended.status == 2
    assert (
        f"{quick}:1: methods: unknown method 'lagrange/tailor', perhaps lagrange/taylor; allowed: "
    ) in ended.err
    assert f"{quick}:2: samples: 1 is out of range" in ended.err


ARRAYS = ("angles", "rates", "tip")
ALL = [
    chosen
    for count in range(1, 1 + len(OUTPUTS))
    for chosen in itertools.combinations(OUTPUTS, count)
]


@pytest.mark.full
def test_every_combination_of_outputs_runs_is_checked_and_reported(tmp_path: Path) -> None:
    folder, results = tmp_path / "scenes", tmp_path / "r.h5"
    folder.mkdir()
    for chosen in ALL:
        scene = paper("fig11", samples=6, duration=0.1, outputs=chosen)
        (folder / f"{'-'.join(chosen)}.toml").write_text(scene_toml(scene))
    ended = rotor_mbs(
        "run", folder, "-m", "lagrange/taylor", "-m", "exudyn_tree/rk67", "-o", results, "-j", 1
    )
    assert ended.status in (0, 1), ended.err
    with open_results(results) as stored:
        for chosen in ALL:
            run = stored.scenes["-".join(chosen)].runs["lagrange/taylor"]
            is_judged = "angles" in chosen or "energy" in chosen
            assert run.status == ("ok" if is_judged else "unchecked")
            assert {*run.names} & {*ARRAYS} == {*chosen} & {*ARRAYS}
    assert rotor_mbs("run", folder, "-m", "printed/ode45", "-o", results, "-j", 1).status in (0, 1)
    assert rotor_mbs("report", results, "-o", tmp_path / "report").status == 0
    assert rotor_mbs("check", results).status == 0
