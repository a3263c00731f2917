"""Where commands write: what stands there is not lost, links and devices stay what they are, folders are refused."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from support.commands import rotor_mbs
from support.sweeps import THREE_RUNS, made_sweep

from rotor_mbs.errors import InputError
from rotor_mbs.runs.files import replace_file, writing
from rotor_mbs.runs.read import open_results


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a sweep."""
    return made_sweep(tmp_path_factory.mktemp("sweep"), THREE_RUNS)


@pytest.fixture
def copy(results: Path, tmp_path: Path) -> Path:
    """A results file that may be written to."""
    path = tmp_path / "r.h5"
    path.write_bytes(results.read_bytes())
    return path


@pytest.mark.parametrize(
    "command",
    [
        ["run", "paper/fig03", "-m", "lagrange/dop853"],
        ["bench", "paper/fig03", "-m", "lagrange/dop853", "--budget", "1"],
        ["stability", "extreme/zero-gravity"],
        ["reference", "paper/fig03"],
        ["modes", "paper/fig03"],
    ],
    ids=lambda command: command[0],
)
def test_a_sweeps_dataset_is_no_output_of_another_study(command: list[str], dataset: Path) -> None:
    before = dataset.read_bytes()
    ended = rotor_mbs(*command, "-o", dataset)
    assert ended.status == 2
    (line,) = ended.err.splitlines()
    assert line.startswith(f"{dataset}: ")
    assert "allowed: another output" in line
    assert dataset.read_bytes() == before
    assert {path.name for path in dataset.parent.iterdir()} == {"s.toml", dataset.name}


@pytest.mark.parametrize("command", [["sweep"], ["reference", "paper/fig03"], ["modes", "paper/fig03"]])
def test_no_other_study_takes_the_place_of_runs(command: list[str], copy: Path, dataset: Path) -> None:
    before = copy.read_bytes()
    words = ["sweep", dataset.with_name("s.toml"), "-j", "1"] if command == ["sweep"] else command
    ended = rotor_mbs(*words, "-o", copy)
    assert ended.status == 2
    assert "allowed: another output" in ended.err.splitlines()[-1]
    assert copy.read_bytes() == before


@pytest.mark.parametrize(
    "command",
    [["reference", "paper/fig03"], ["reproduce"], ["run", "paper/fig03"], ["sweep", "sweeps/fig11-spread"]],
    ids=lambda command: command[0],
)
def test_no_command_writes_what_another_process_is_writing(command: list[str], tmp_path: Path) -> None:
    """The lock of a process that has begun with an output which is not there yet."""
    output = tmp_path / "results.h5"
    with ThreadPoolExecutor(1) as other, writing(output):
        given = tmp_path if command == ["reproduce"] else output
        ended = other.submit(rotor_mbs, *command, "-o", given).result()
    assert ended.status == 2
    assert "another process is writing it now" in ended.err.splitlines()[-1]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: path.symlink_to(path.with_name("another"))])
def test_a_lock_that_is_no_file_of_ours_is_refused(make: Callable[[Path], object], tmp_path: Path) -> None:
    """A link would be written through, a pipe waited for."""
    (tmp_path / "another").write_text("kept")
    make(tmp_path / ".r.h5.lock")
    with pytest.raises(InputError, match="is a foreign file"), writing(tmp_path / "r.h5"):
        pass
    assert (tmp_path / "another").read_text() == "kept"


@pytest.mark.parametrize("study", ["run", "sweep"])
def test_a_link_stays_a_link_to_what_is_written(study: str, dataset: Path, tmp_path: Path) -> None:
    target, link = tmp_path / "far" / "r.h5", tmp_path / "r.h5"
    target.parent.mkdir()
    link.symlink_to(target)
    words = {"run": ["run", "check/held", "-m", "lagrange/dop853"], "sweep": ["sweep", dataset.with_name("s.toml")]}
    for _ in range(2):  # new, and there already
        assert rotor_mbs(*words[study], "-o", link, "-j", "1").status == 0
        assert link.is_symlink()
    if study == "sweep":
        assert target.read_bytes() == dataset.read_bytes()
        return
    assert rotor_mbs("run", "check/held", "-m", "lagrange/ode45", "-o", link, "-j", "1").status == 0
    assert link.is_symlink()
    with open_results(target) as results:
        assert set(results.scenes["check/held"].methods) == {"lagrange/dop853", "lagrange/ode45"}


def test_a_pipe_is_written_to(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    far_end = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        replace_file(pipe, b"verdicts")
        assert os.read(far_end, 100) == b"verdicts"
    finally:
        os.close(far_end)
    assert pipe.is_fifo()


@pytest.mark.parametrize("place", [".", "..", ""])
@pytest.mark.parametrize("command", [["run", "paper/fig03", "-o"], ["sweep", "x.toml", "-o"], ["check", "--junit"]])
def test_a_folder_is_no_output(command: list[str], place: str) -> None:
    ended = rotor_mbs(*command, place)
    assert ended.status == 2
    (line,) = ended.err.strip().splitlines()
    assert "allowed: a file's name, not a folder" in line


@pytest.mark.parametrize(
    "command",
    [
        ["compare", "none.csv", "--scene", "paper/fig03", "-o"],
        ["reproduce", "-o"],
        ["modes", "paper/fig03", "--report"],
    ],
    ids=lambda command: command[0],
)
@pytest.mark.parametrize("place", ["there.csv", "there.csv/new"])
def test_a_file_is_no_folder_for_pages(command: list[str], place: str, tmp_path: Path) -> None:
    """Refused with the arguments, before anything is read or computed."""
    (tmp_path / "there.csv").touch()
    ended = rotor_mbs(*command, tmp_path / place)
    assert ended.status == 2
    (line,) = ended.err.splitlines()
    assert "allowed: a folder that can be written" in line
