"""Where commands write: what stands there is not lost, links and devices stay what they are, folders are refused."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from rotor_mbs.cli import main
from rotor_mbs.errors import InputError
from rotor_mbs.runs.files import replace_file
from rotor_mbs.runs.lock import writing
from rotor_mbs.runs.read import open_results

SWEEP = """
title = "two starts"
scene = "paper/fig03"
methods = ["lagrange/dop853"]
samples = 3
change = { duration = 0.1 }
[[axis]]
key = "initial.angles[0]"
values = [0.1, 0.2]
"""


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a sweep."""
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "two.toml").write_text(SWEEP)
    assert main(["sweep", str(folder / "two.toml"), "-o", str(folder / "two.h5"), "-j", "1"]) == 0
    return folder / "two.h5"


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a batch."""
    path = tmp_path_factory.mktemp("batch") / "r.h5"
    assert main(["run", "paper/fig03", "-m", "lagrange/dop853", "-o", str(path), "-j", "1"]) == 0
    return path


@pytest.mark.parametrize(
    "command",
    [
        ["run", "paper/fig03", "-m", "lagrange/dop853"],
        ["bench", "paper/fig03", "-m", "lagrange/dop853", "--budget", "1"],
        ["stability", "extreme/zero-gravity"],
        ["reference", "paper/fig03"],
    ],
    ids=lambda command: command[0],
)
def test_a_sweeps_dataset_is_no_output_of_a_batch(
    command: list[str], dataset: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = dataset.read_bytes()
    assert main([*command, "-o", str(dataset)]) == 2
    assert capsys.readouterr().err.strip() == f"{dataset}: holds the dataset of a sweep; allowed: another output file"
    assert dataset.read_bytes() == before
    assert [path.name for path in dataset.parent.iterdir() if path.suffix != ".toml"] == [dataset.name]


def test_a_reference_that_starts_in_a_singular_state_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "extreme/singular-start", "-m", "lagrange/dop853", "-o", str(tmp_path / "b.h5")]) == 2
    assert "every pitch at ±π/2 leaves the rotor no inertia" in capsys.readouterr().err.splitlines()[-1]


def test_a_sweep_does_not_take_the_place_of_an_interrupted_batch(
    dataset: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    finished = tmp_path / "r.h5.parts" / f"{'0' * 64}.h5"
    finished.parent.mkdir()
    finished.touch()
    assert main(["sweep", str(dataset.with_name("two.toml")), "-o", str(tmp_path / "r.h5"), "-j", "1"]) == 2
    assert "r.h5.parts: has unfinished work of `rotor-mbs run`; allowed: " in capsys.readouterr().err
    assert finished.exists()


def test_a_sweeps_link_stays_one(dataset: Path, tmp_path: Path) -> None:
    target, link = tmp_path / "far" / "two.h5", tmp_path / "two.h5"
    target.parent.mkdir()
    link.symlink_to(target)
    assert main(["sweep", str(dataset.with_name("two.toml")), "-o", str(link), "-j", "1"]) == 0
    assert link.is_symlink()
    assert target.read_bytes() == dataset.read_bytes()


def test_references_do_not_take_the_place_of_runs(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = results.read_bytes()
    for scene in ("paper/fig03", "paper/fig04b"):
        assert main(["reference", scene, "-o", str(results)]) == 2
        assert "which would be dropped" in capsys.readouterr().err
    assert results.read_bytes() == before


@pytest.mark.parametrize("command", [["reference", "paper/fig03"], ["reproduce"]])
def test_no_command_writes_what_another_process_is_writing(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The lock of a process that has begun with an output which is not there yet."""
    output = tmp_path / "results.h5"
    with ThreadPoolExecutor(1) as other, writing(output):
        given = tmp_path if command == ["reproduce"] else output
        assert other.submit(main, [*command, "-o", str(given)]).result() == 2
    assert "another process is writing it now" in capsys.readouterr().err.splitlines()[-1]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("place", ["owner", "lock"])
@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: path.symlink_to(path.parents[1] / "another")])
def test_what_is_no_file_of_ours_in_the_folder_of_parts_is_refused(
    make: Callable[[Path], object], place: str, tmp_path: Path
) -> None:
    """A link would be written through, a pipe waited for."""
    another, parts = tmp_path / "another", tmp_path / "r.h5.parts"
    another.write_text("kept")
    parts.mkdir()
    make(parts / place)
    with pytest.raises(InputError, match=f"has {place}, a foreign file"), writing(tmp_path / "r.h5"):
        pass
    assert another.read_text() == "kept"


def test_a_link_stays_a_link_to_what_is_written(results: Path, tmp_path: Path) -> None:
    target, link = tmp_path / "far" / "r.h5", tmp_path / "r.h5"
    target.parent.mkdir()
    target.write_bytes(results.read_bytes())
    link.symlink_to(target)
    assert main(["run", "paper/fig04b", "-m", "lagrange/dop853", "-o", str(link), "-j", "1"]) == 0
    assert link.is_symlink()
    with open_results(target) as found:
        assert sorted(found.scenes) == ["paper/fig03", "paper/fig04b"]


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
def test_a_folder_is_no_output(command: list[str], place: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main([*command, place])
    assert caught.value.code == 2
    message = capsys.readouterr().err.strip()
    assert "allowed: a file's name, not a folder" in message
    assert "\n" not in message


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
def test_a_file_is_no_folder_for_pages(
    command: list[str], place: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Refused with the arguments, before anything is read or computed."""
    (tmp_path / "there.csv").touch()
    with pytest.raises(SystemExit, match="2"):
        main([*command, str(tmp_path / place)])
    (line,) = capsys.readouterr().err.splitlines()
    assert "allowed: a folder that can be written" in line
