"""Where commands write: what stands there is not lost, links and devices stay what they are,
folders are refused."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import numpy as np
import pytest
from support.checking import results_file
from support.commands import refusal, rotor_mbs
from support.scenes import paper
from support.stored import Made, rotor, store
from support.sweeps import made_sweep, run_local

import rotor_mbs as rm
from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.runs.output_files import locked, replace_file
from rotor_mbs.runs.read import open_results
from rotor_mbs.scenario.sweep import load_sweep

RUN = ["run", "check/held", "-m", "lagrange/dop853", "-j", "1", "-o"]


@pytest.fixture(scope="module")
def dataset(files: Path) -> Path:
    """Of a sweep, beside its file s.toml."""
    return files / "s.h5"


@pytest.mark.parametrize(
    "command",
    [
        ["reference", "paper/fig03"],
        ["reproduce"],
        ["run", "paper/fig03"],
        ["sweep", "sweeps/fig11-spread"],
    ],
    ids=lambda command: command[0],
)
def test_no_command_writes_what_another_process_is_writing(
    command: list[str], tmp_path: Path
) -> None:
    """The lock of a process that has begun with an output which is not there yet."""
    output = tmp_path / "results.h5"
    with ThreadPoolExecutor(1) as other, locked(output):
        given = tmp_path if command == ["reproduce"] else output
        ended = other.submit(rotor_mbs, *command, "-o", given).result()
    assert ended.status == 2
    assert "another process is writing it now" in ended.err.splitlines()[-1]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "make",
    [
        os.mkfifo,
        os.mkdir,
        lambda path: path.symlink_to("another"),
        lambda path: path.hardlink_to(path.parent / "another"),
    ],
    ids=["pipe", "folder", "link", "file"],
)
def test_a_lock_that_is_no_file_of_ours_is_refused(
    make: Callable[[Path], object], tmp_path: Path
) -> None:
    """A link would be written through, a pipe waited for."""
    (tmp_path / "another").write_text("kept")
    make(tmp_path / ".r.h5.lock")
    with pytest.raises(InputError, match="was not written by rotor-mbs"), locked(tmp_path / "r.h5"):
        pass
    assert (tmp_path / "another").read_text() == "kept"


def test_a_link_stays_a_link_to_what_is_written(dataset: Path, tmp_path: Path) -> None:
    (tmp_path / "far").mkdir()
    results, sweep = tmp_path / "r.h5", tmp_path / "s.h5"
    for link in (results, sweep):
        link.symlink_to(tmp_path / "far" / link.name)
    run_local(load_sweep(dataset.with_name("s.toml")), sweep, 0)
    for method in ("lagrange/dop853", "lagrange/ode45"):  # new, and there already
        results_file(results, ["check/held"], [method])
    assert results.is_symlink()
    assert sweep.is_symlink()
    assert sweep.read_bytes() == dataset.read_bytes()
    with open_results(tmp_path / "far" / "r.h5") as opened:
        assert set(opened.scenes["check/held"].methods) == {"lagrange/dop853", "lagrange/ode45"}


def test_a_pipe_is_written_to(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    far_end = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        replace_file(pipe, b"verdicts", b"verdicts")
        assert os.read(far_end, 100) == b"verdicts"
    finally:
        os.close(far_end)
    assert pipe.is_fifo()


# Every option that names an output and what its earlier output is called in `kinds`; other commands
# that write HDF5 are in test_output_kinds.
OUTPUTS = {
    "export mjcf": (["export", "check/held", "--to", "mjcf", "-o"], "mjcf"),
    "export exudyn": (["export", "check/held", "--to", "exudyn", "-o"], "exudyn"),
    "export csv": (["export", "check/held", "--to", "csv", "-o"], "csv"),
    "check junit": (["check", "{results}", "--junit"], "junit"),
    "check json": (["check", "{results}", "--json"], "json"),
    "test-method junit": (["test-method", "lagrange/dop853", "--junit"], "junit"),
    "animate": (["animate", "check/held", "{results}", "-o"], "webp"),
    "run": (RUN, "results"),
    "sweep": (["sweep", "{sweep}", "-j", "1", "-o"], "sweep"),
}
_QUICK_OUTPUTS = {"export csv", "check json", "run", "sweep"}  # one of each kind of file


@pytest.fixture(scope="module")
def kinds(dataset: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A file of every kind: all outputs, inputs, and what this program never wrote."""
    folder = tmp_path_factory.mktemp("kinds")
    results = folder / "results.h5"
    words = {"results": results, "sweep": dataset.with_name("s.toml")}
    for name in (
        "run",
        "export mjcf",
        "export exudyn",
        "export csv",
        "check junit",
        "check json",
        "animate",
        "sweep",
    ):
        command, kind = OUTPUTS[name]
        suffix = {"run": ".h5", "animate": ".webp"}.get(name, "")
        ended = rotor_mbs(*(word.format(**words) for word in command), folder / f"{kind}{suffix}")
        assert ended.status == 0, ended.err
    assert rotor_mbs("new", folder / "scene.toml").status == 0
    (folder / "data").write_text("time [s],rotor [rad],pitch 1 [rad]\n0.0,0.5,0.1\n0.1,0.5,0.1\n")
    (folder / "page").write_text("<!DOCTYPE html>\n<title>mine</title>\n")
    (folder / "numbers").write_text('[\n {\n  "mine": 1\n }\n]')
    (folder / "suite").write_text(
        "<?xml version='1.0' encoding='utf-8'?>\n<testsuites name=\"mine\"/>\n"
    )
    with h5py.File(folder / "foreign", "w") as file:
        file["time"] = [0.0, 1.0]
    (folder / "note").write_bytes(b"rotor_mbs: \xff\x00 mine\n")
    return {path.stem: path for path in folder.iterdir() if path.is_file()}


@pytest.mark.parametrize(
    "output",
    [
        pytest.param(name, marks=() if name in _QUICK_OUTPUTS else pytest.mark.full)
        for name in OUTPUTS
    ],
)
def test_an_output_replaces_nothing_but_its_own_earlier_output(
    output: str, kinds: dict[str, Path], dataset: Path, tmp_path: Path
) -> None:
    words, own = OUTPUTS[output]
    suffix = ".webp" if output == "animate" else ".file"
    words = [
        word.format(results=kinds["results"], sweep=dataset.with_name("s.toml")) for word in words
    ]
    for kind, path in kinds.items():
        there = tmp_path / f"{kind}{suffix}"
        there.write_bytes(path.read_bytes())
        ended = rotor_mbs(*words, there)
        if kind == own:
            assert ended.status == 0, ended.err
        else:
            assert ended.status == 2, (kind, ended)
            assert ended.err.splitlines()[-1].startswith(f"{there}: ")
            assert there.read_bytes() == path.read_bytes(), kind


@pytest.mark.parametrize("command", ["export check/held --to csv -o", "check {} --junit"])
def test_a_link_under_a_temporary_name_is_not_followed(
    command: str, results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place, kept = tmp_path / "new.webp", tmp_path / "kept"
    kept.write_text("kept")
    monkeypatch.setattr("secrets.randbits", lambda _: os.getpid())  # a name that can be guessed
    (tmp_path / f".new.webp.{os.getpid()}.tmp").symlink_to(kept)
    refusal(*command.format(results).split(), place)
    assert kept.read_text() == "kept"
    assert not place.exists()


def test_what_a_sweep_writes_beside_its_dataset_replaces_no_other_file(tmp_path: Path) -> None:
    made_sweep(tmp_path)
    command = ["sweep", tmp_path / "s.toml", "-j", "1", "--metadata", "-o", tmp_path / "x.h5"]
    other = tmp_path / "x.croissant.json"
    other.write_text("mine")
    assert rotor_mbs(*command).status == 2
    assert other.read_text() == "mine"
    other.unlink()
    for _ in range(2):
        assert rotor_mbs(*command).status == 0


@pytest.mark.full
def test_pages_figures_and_saved_runs_replace_no_other_file(tmp_path: Path) -> None:
    scene = paper("fig08", samples=11)
    path = store(tmp_path / "r.h5", [Made(scene, "lagrange/dop853", rotor(np.sin))])

    def figures(folder: Path) -> None:
        if (ended := rotor_mbs("figures", path, "-o", folder, "--format", "svg")).status:
            raise InputError(ended.err)

    for write, name in ((rm.open(path).to_html, "index.html"), (figures, "fig08.svg")):
        folder = tmp_path / name
        folder.mkdir()
        (folder / name).write_text("<title>mine</title>")
        with pytest.raises(InputError, match=name):
            write(folder)
        assert (folder / name).read_text() == "<title>mine</title>"
        assert [path.name for path in folder.iterdir()] == [name]
        (folder / name).unlink()
        for _ in range(2):
            write(folder)
    with pytest.raises(StoreError, match="not an HDF5 file"):
        rm.open(path).save(folder / name)


@pytest.mark.parametrize(
    ("command", "allowed"),
    [
        ("run paper/fig03 -o ..", "allowed: a file's name, not a folder"),
        ("sweep x.toml -o ''", "allowed: a file's name, not a folder"),
        ("check --junit .", "allowed: a file's name, not a folder"),
        (
            "compare none.csv --scene paper/fig03 -o {sweep}",
            "allowed: a folder that can be written",
        ),
        ("reproduce -o {sweep}/new", "allowed: a folder that can be written"),
        ("report {results} -o {sweep}", "allowed: a folder that can be written"),
        ("export check/held --to csv -o /", ""),
        ("export check/held --to csv -o /proc/none/x.csv", ""),
        ("sweep {sweep} -o {sweep}", ""),
        ("check {results} --junit /proc/none/x.xml", ""),
        ("animate .. {results}", ""),
        ("animate .. {results} -o /proc/none/x.webp", ""),
        ("run check/held -m lagrange/ode45 -o /proc/none/x.h5", ""),
        ("new /proc/none/x.toml", ""),
        pytest.param("figures {results} -o /proc/none/x", "", marks=pytest.mark.full),
        ("report {dataset} -o /proc/none/x", ""),
    ],
)
def test_an_output_that_cannot_be_written_is_a_line(
    command: str, allowed: str, results: Path, dataset: Path
) -> None:
    """Found with the arguments where it can be, before anything is read or computed."""
    sweep = dataset.with_name("s.toml")
    assert allowed in refusal(
        *shlex.split(command.format(results=results, dataset=dataset, sweep=sweep))
    )
    assert "[[axis]]" in sweep.read_text()
