"""Files with a flipped bit, or of wrong shapes: a line and status 2, never the end of the process."""

from __future__ import annotations

import base64
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from support.commands import PROGRAM, rotor_mbs
from support.sweeps import THREE_RUNS, made_sweep

from rotor_mbs.errors import StoreError
from rotor_mbs.runs import files

# One bit of a MAT file of SciPy's, at which its reader ends the process.
DAMAGED_MAT = base64.b64decode(
    """
TUFUTEFCIDUuMCBNQVQtZmlsZSBQbGF0Zm9ybTogcG9zaXgsIENyZWF0ZWQgb246IFN1biBOb3YgMjIgMjI6MTU6NDggMjAyNgAA
AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAABSU0OAAAAWAAAAAYAAAAIAAAABgAAAAAA
AAAFAAAACAAAAAEAAAAFAAAAAQAEAHRpbWUJAAAAKAAAAAAAAAAAAAAAMzMzMzMzsz8zMzMzMzPDP8zMzMzMzMw/MzMzMzMz0z8O
AAAAsAAAAAYAAAAIAAAABgAAAAAAAAAFAAAACAAAAAUAAAADAAAAAQAAAAYAAABhbmdsZXMAACkAAAB4AAAAAAAAAAAAAAAAAAAA
AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA
AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA
"""
)


_READ_ALL = """import sys
from pathlib import Path
from rotor_mbs.errors import StoreError
from rotor_mbs.runs.files import open_file
from rotor_mbs.runs.read import open_results
path, content = Path(sys.argv[1]), Path(sys.argv[1]).read_bytes()
place, refused = content.find(b"\\x19\\x01"), 0
while place >= 0:
    path.write_bytes(content[:place] + b"\\x19\\x00" + content[place + 2 :])
    try:
        with open_results(path) as results:
            [run.attributes for scene in results.scenes.values() for run in scene.runs.values()]
    except StoreError:
        refused += 1
    place = content.find(b"\\x19\\x01", place + 1)
print(refused)
"""


@pytest.fixture
def copy(results: Path, tmp_path: Path) -> Path:
    path = tmp_path / "r.h5"
    path.write_bytes(results.read_bytes())
    return path


def test_an_attribute_that_became_a_list_is_not_read(copy: Path) -> None:
    ended = subprocess.run([sys.executable, "-c", _READ_ALL, copy], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    assert int(ended.stdout) > 10


def test_a_mat_file_that_ends_its_reader_is_a_line(tmp_path: Path) -> None:
    path = tmp_path / "z7.mat"
    path.write_bytes(DAMAGED_MAT)
    command = [*PROGRAM, "compare", str(path), "--scene", "paper/fig08", "-o", str(tmp_path / "pages")]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 2, ended
    (line,) = ended.stderr.splitlines()
    assert "cannot be read: its reader ended" in line


@pytest.mark.parametrize("shape", [(), (1,), (0, 3), (2, 2)])
@pytest.mark.parametrize("name", ["paper/fig08/angles", "runs/samples", "runs/status", "paper/fig08/time"])
def test_a_column_of_another_shape_is_a_line(name: str, shape: tuple[int, ...], copy: Path, tmp_path: Path) -> None:
    """With right digests: they do not cover the shape of what is computed later."""
    group, _, column = name.rpartition("/")
    with h5py.File(copy, "r+") as file:
        there = file[group]
        later = files.computed_in(files.stored_digests(there))
        facts = {key: there[column].attrs[key] for key in ("units", "long_name")}
        kind = there[column].dtype
        del there[column]
        dataset = there.create_dataset(column, data=np.zeros(shape, kind))
        for key, value in facts.items():
            dataset.attrs[key] = value
        del there.attrs[files.DIGESTS]
        files.seal(there, later=later)
    for command in (["check", copy], ["report", copy, "-o", tmp_path / "pages"]):
        ended = rotor_mbs(*command)
        assert ended.status in (1, 2), ended


@pytest.mark.parametrize(("name", "shape"), [("status", (0,)), ("steps", (2,)), ("angles", (0, 3)), ("crc32", ())])
def test_a_sweeps_column_of_another_shape_is_a_line(name: str, shape: tuple[int, ...], tmp_path: Path) -> None:
    path = made_sweep(tmp_path, THREE_RUNS)
    with h5py.File(path, "r+") as file:
        facts, kind = {key: file[name].attrs[key] for key in ("units", "long_name")}, file[name].dtype
        later = files.computed_in(files.stored_digests(file))
        del file[name], file.attrs[files.DIGESTS]
        dataset = file.create_dataset(name, data=np.zeros(shape, kind))
        for key, value in facts.items():
            dataset.attrs[key] = value
        files.seal(file, later=later)
    before = path.read_bytes()
    ended = rotor_mbs("sweep", tmp_path / "s.toml", "-o", path, "-j", "1")
    assert ended.status == 2, ended
    assert len(ended.err.splitlines()) == 1
    assert path.read_bytes() == before


def test_a_file_that_may_not_be_read_says_so(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(StoreError, match="cannot be read: Permission denied"), files.open_file(copy):
        pass


def test_a_dataset_without_values_is_no_column_of_data(tmp_path: Path) -> None:
    path = tmp_path / "data.h5"
    with h5py.File(path, "w") as file:
        file["nothing"] = h5py.Empty("f8")
        file["time"], file["phi"] = np.linspace(0.0, 1.0, 5), np.zeros((5, 4))
    arrays, _ = files.read_arrays(path)
    assert set(arrays) == {"time", "phi"}
