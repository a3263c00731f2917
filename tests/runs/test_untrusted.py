"""Files whose HDF5 structures were forged, under a right digest: the HDF5 library hangs on them,
ends its process or takes all memory, and every command ends with one line all the same."""

from __future__ import annotations

import os
import re
import shutil
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import h5py
import pytest
from support.commands import rotor_mbs
from support.forging import append_trailer

import rotor_mbs as rm
from rotor_mbs.errors import ResourceError, StoreError
from rotor_mbs.runs import hdf5, untrusted
from rotor_mbs.runs.trailer import read_trailer
from rotor_mbs.runs.untrusted import read_in_worker
from rotor_mbs.scenario.catalogue import REFERENCES

SCENE = "check/held"
KINDS = ("results", "s", "modes", "comparison")


@pytest.fixture(autouse=True)
def short_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(untrusted, "TIME_S", 1.0)


def heap_without_end(content: bytearray) -> None:
    """Give the last object of each global heap, the free space, no size: the library stays at
    it."""
    for heap in re.finditer(b"GCOL", content):
        (size,) = struct.unpack_from("<Q", content, heap.start() + 8)
        place = heap.start() + 16
        while place < heap.start() + size:
            (number,) = struct.unpack_from("<H", content, place)
            (length,) = struct.unpack_from("<Q", content, place + 8)
            if number == 0:
                content[place + 8 : place + 16] = bytes(8)
                break
            place += 16 + (length + 7) // 8 * 8


def lists_of_scales_without_version(content: bytearray) -> None:
    """Give the dataspace of the attribute that lists an array's scales no version: the library ends
    the process."""
    name = b"DIMENSION_LIST\0\0"
    for attribute in re.finditer(name, content):
        type_length, space = 16, attribute.end() + 16
        if content[attribute.start() - 4] == type_length and content[space] == 1:
            content[space] = 0


def endless_units(content: bytearray) -> None:
    """Give texts of the attribute `units` a length of 2 GB."""
    for attribute in re.finditer(rb"units\0\0\0", content):
        type_length, space_length = 24, 8
        length = attribute.end() + type_length + space_length
        content[length : length + 4] = (2**31 - 1).to_bytes(4, "little")


FORGERIES = {
    "hangs": heap_without_end,
    "dies": lists_of_scales_without_version,
    "takes memory": endless_units,
}


def forge(path: Path, change: Callable[[bytearray], None]) -> None:
    """Change the bytes of a file outside its rows, and give it a right trailer."""
    known = read_trailer(path)
    with h5py.File(path, "r+"):  # cuts the trailer off
        pass
    content = bytearray(path.read_bytes())
    rows = [
        (start, content[start : start + size])
        for all in known.groups.values()
        for start, size in all.values()
    ]
    change(content)
    for start, values in rows:
        content[start : start + len(values)] = values
    path.write_bytes(content)
    append_trailer(path, known.kind, known.groups)


@pytest.mark.parametrize(
    "forgery", [pytest.param("hangs", marks=pytest.mark.full), "dies", "takes memory"]
)
@pytest.mark.parametrize(
    "kind", [KINDS[0], *(pytest.param(kind, marks=pytest.mark.full) for kind in KINDS[1:])]
)
def test_every_command_ends_with_a_line(
    forgery: str, kind: str, files: Path, tmp_path: Path
) -> None:
    path = Path(shutil.copy(files / f"{kind}.h5", tmp_path / "forged.h5"))
    forge(path, FORGERIES[forgery])
    before = path.read_bytes()
    commands: list[list[object]] = [
        ["check", path],
        ["show", path],
        ["report", path, "-o", tmp_path / "pages"],
    ]
    if kind == "results":
        commands += [
            ["animate", SCENE, path, "-o", tmp_path / "a.webp"],
            ["figures", path, "-o", tmp_path],
        ]
        commands += [["run", SCENE, "-m", "lagrange/dop853", "-j", "1", "-o", path]]
    elif kind == "s":
        commands += [["sweep", files / "s.toml", "-j", "1", "-o", path]]
    elif kind == "modes":
        commands += [["modes", SCENE, "--speeds", "0.5:1:2", "-j", "1", "-o", path]]
    for words in commands:
        ended = rotor_mbs(*words)
        assert ended.status == 2, ended
        *progress, line = ended.err.splitlines()
        assert all(text.startswith("[") for text in progress), progress
        assert str(path) in line
        assert "damaged" in line or "nothing to check" in line
    with pytest.raises(rm.RotorError, match=r"damaged|has no runs"):
        _ = rm.open(path).statuses
    assert path.read_bytes() == before


def _wait(path: Path, seconds: float) -> None:  # noqa: ARG001
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


def _take(path: Path, size: int) -> int:  # noqa: ARG001
    return len(bytes(size))


def _die(path: Path, number: int) -> None:  # noqa: ARG001
    os.kill(os.getpid(), number)


def _process(path: Path, argument: None) -> int:  # noqa: ARG001
    return os.getpid()


@pytest.mark.parametrize(
    ("read", "argument"),
    [(_wait, 100.0), (_take, 1 << 31), (_die, signal.SIGSEGV)],
    ids=["time", "memory", "signal"],
)
def test_the_limits_of_the_worker(
    read: Callable[[Path, object], object], argument: object, files: Path, tmp_path: Path
) -> None:
    path = Path(shutil.copy(files / "results.h5", tmp_path / "changed.h5"))
    forge(path, lambda content: content.extend(bytes(8)))
    with pytest.raises(StoreError, match=r"damaged or forged: .* takes more than .* s or .* GB"):
        read_in_worker(path, read, argument)
    assert read_in_worker(path, _process, None) != os.getpid()  # a new process reads the next one


_UNDER_A_LIMIT = """
import resource, sys
from pathlib import Path
from taking import take
from rotor_mbs.errors import ResourceError
from rotor_mbs.runs.untrusted import read_in_worker

resource.setrlimit(resource.RLIMIT_AS, (900 << 20, resource.RLIM_INFINITY))
try:
    read_in_worker(Path(sys.argv[1]), take, 800 << 20)
except ResourceError as exc:
    print(exc)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="no limit of address space")
def test_what_the_callers_own_memory_limit_stops_is_no_forgery(files: Path, tmp_path: Path) -> None:
    """800 MB are within what a file may take (1 GB), but not within the caller's limit."""
    path = Path(shutil.copy(files / "results.h5", tmp_path / "changed.h5"))
    forge(path, lambda content: content.extend(bytes(8)))
    (tmp_path / "taking.py").write_text("def take(path, size):\n    return len(bytes(size))\n")
    (tmp_path / "program.py").write_text(_UNDER_A_LIMIT)
    program = [sys.executable, str(tmp_path / "program.py"), str(path)]
    ended = subprocess.run(program, capture_output=True, text=True, timeout=60)
    told = f"{path}: not enough memory to read it under a memory limit (ulimit -v) of 900 MiB"
    assert (ended.stdout.strip(), ended.stderr) == (told, "")


def test_a_file_that_is_removed_while_it_is_opened_is_a_line(
    files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = Path(shutil.copy(files / "results.h5", tmp_path / "removed.h5"))

    def opened(*arguments: object) -> h5py.File:
        file = open_by_h5py(*arguments)
        path.unlink()
        return file

    open_by_h5py = h5py.File
    monkeypatch.setattr(h5py, "File", opened)
    with pytest.raises(StoreError, match=r"removed\.h5: no such file"), hdf5.open_file(path):
        pass


def test_a_lack_of_memory_is_no_damage() -> None:
    with pytest.raises(MemoryError), hdf5.reading("results.h5"):
        raise MemoryError


def test_only_files_of_others_are_read_by_the_worker(files: Path, tmp_path: Path) -> None:
    assert read_in_worker(files / "results.h5", _process, None) == os.getpid()
    assert read_in_worker(sorted(REFERENCES.glob("*.h5"))[0], _process, None) == os.getpid()
    path = Path(shutil.copy(files / "results.h5", tmp_path / "changed.h5"))
    forge(path, lambda content: content.extend(bytes(8)))
    assert read_in_worker(path, _process, None) != os.getpid()
    assert rm.open(path).statuses == rm.open(files / "results.h5").statuses


def test_the_worker_needs_no_more_than_it_reads_with() -> None:
    """Or each command would wait longer for it."""
    program = "import sys, rotor_mbs.runs.hdf5; print(*sys.modules)"
    modules = set(
        subprocess.run(
            [sys.executable, "-c", program], capture_output=True, text=True
        ).stdout.split()
    )
    assert "h5py" in modules
    assert not modules & {
        "rotor_mbs.scenario.scene",
        "rotor_mbs.methods.catalogue",
        "rotor_mbs.runs.table",
        "scipy",
    }


def _killed(_path: Path, marks: Path) -> int:
    """Leave a mark, and kill this process, as often as the first mark says; then return the number
    of marks."""
    count = len(list(marks.glob("mark-*")))
    if count < int((marks / "kills").read_text()):
        (marks / f"mark-{count}").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return count


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs SIGKILL")
def test_a_reader_that_is_killed_from_outside_says_nothing_of_the_file(tmp_path: Path) -> None:
    """As by a system that lacks memory: the file is read again, and never called damaged."""
    file = Path(shutil.copy(REFERENCES / "stiff.h5", tmp_path))
    (tmp_path / "kills").write_text("1")
    assert read_in_worker(file, _killed, tmp_path) == 1
    (tmp_path / "kills").write_text("3")
    with pytest.raises(ResourceError, match="the process that reads it was killed 2 times"):
        read_in_worker(file, _killed, tmp_path)
