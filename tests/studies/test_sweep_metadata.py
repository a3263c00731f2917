"""Metadata beside a dataset: JSON-LD and splits that agree with the file."""

from __future__ import annotations

import hashlib
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest
from support.commands import refusal, rotor_mbs

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.studies.sweep_metadata import write_splits

ROOT = Path(__file__).parents[2]
SWEEP = """
title = "Stiffness and start"
scene = "paper/fig11"
methods = ["lagrange/dop853"]
change = { duration = 0.2 }
samples = 11
validation = 0.2
test = 0.2
outputs = ["angles", "rates", "tip"]
[[axis]]
key = "bearing.stiffness"
values = [0, 1e3, 1e4]
[[axis]]
key = "initial.angles[1]"
linear = { start = 0, end = 1, count = 6 }
"""
COLUMNS = ("run", "bearing_stiffness", "status", "angles", "tip")


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("described")
    (folder / "study.toml").write_text(SWEEP)
    path = folder / "out" / "study.nc"
    command = ["sweep", folder / "study.toml", "-o", path, "--metadata", "-j", 1]
    assert rotor_mbs(*command, "--datasets", folder / "splits").status == 0
    return path


def splits(dataset: Path) -> Iterator[tuple[str, dict[str, np.ndarray]]]:
    """Each split, and what the whole dataset has of its runs."""
    with h5py.File(dataset) as whole:
        for code, split in enumerate(("train", "validation", "test")):
            rows = np.flatnonzero(whole["split"][()] == code)
            yield split, {name: whole[name][()][rows] for name in COLUMNS}


def test_croissant_names_every_variable_and_the_content(dataset: Path) -> None:
    croissant = json.loads(
        dataset.with_suffix(".croissant.json").read_text(), parse_constant=pytest.fail
    )
    assert (
        croissant["distribution"][0]["sha256"] == hashlib.sha256(dataset.read_bytes()).hexdigest()
    )
    with h5py.File(dataset) as file:
        along_runs = {
            name for name, item in file.items() if item.shape[0] == 18 and name != "message_byte"
        }
    assert {field["name"] for field in croissant["recordSet"][0]["field"]} == along_runs


@pytest.mark.full
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of the validator and what it imports
def test_croissant_is_valid(dataset: Path) -> None:
    mlcroissant = pytest.importorskip("mlcroissant")
    # raises where it is not
    mlcroissant.Dataset(jsonld=str(dataset.with_suffix(".croissant.json")))


def test_a_split_has_its_runs_bit_for_bit(dataset: Path) -> None:
    for split, columns in splits(dataset):
        with h5py.File(dataset.parents[1] / "splits" / f"{split}.h5") as file:
            assert {len(item) for item in file.values()} == {len(columns["run"])} != {0}
            assert file["tip"].attrs["units"] == "m"
            for name, values in columns.items():
                assert file[name][()].tobytes() == values.tobytes()
            with h5py.File(dataset) as whole:
                assert (file["time"][()] == whole["time"][()]).all()


def test_a_dataset_card_replaces_its_own_kind_only(dataset: Path, tmp_path: Path) -> None:
    *files, card = write_splits(dataset, tmp_path)
    text = card.read_text()
    assert [file.name for file in files] == ["train.h5", "validation.h5", "test.h5"]
    assert all(f"path: {file.name}" in text for file in files)
    with pytest.raises(
        StoreError, match=f"a split for .*; allowed: the sweep's own file, {dataset.name}"
    ):
        StoredSweep(files[0])
    assert "a split for Hugging Face datasets; allowed: the sweep's own file" in refusal(
        "show", files[0]
    )
    write_splits(dataset, tmp_path)
    card.write_text("of somebody else")
    with pytest.raises(InputError, match="is not an output of this command"):
        write_splits(dataset, tmp_path)


@pytest.mark.full
@pytest.mark.filterwarnings("ignore")  # of the reader and what it imports
def test_hugging_face_reads_the_folder_bit_for_bit(dataset: Path, tmp_path: Path) -> None:
    datasets = pytest.importorskip("datasets")
    loaded = datasets.load_dataset(str(dataset.parents[1] / "splits"), cache_dir=str(tmp_path))
    for split, columns in splits(dataset):
        assert loaded[split].num_rows == len(columns["run"])
        for name, values in columns.items():
            there = np.array(loaded[split].data.column(name).to_pylist(), values.dtype)
            assert (there.shape, there.tobytes()) == (values.shape, values.tobytes())


def test_the_loader_of_the_documentation(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its text, run with a stand-in for PyTorch: normalized inputs and angles of the training
    runs."""
    [code] = re.findall(
        r"```python\n(import h5py[^`]*, torch\n[^`]*)```",
        (ROOT / "docs/sweeps.md").read_text(),
        re.DOTALL,
    )
    data = SimpleNamespace(TensorDataset=lambda *arrays: arrays)
    torch = SimpleNamespace(utils=SimpleNamespace(data=data), from_numpy=lambda array: array)
    monkeypatch.setitem(sys.modules, "torch", torch)
    monkeypatch.chdir(dataset.parent)
    names: dict[str, Any] = {}
    exec(code.replace("study.h5", dataset.name), names)
    for values in names["data"]:
        over = tuple(range(values.ndim - 1))
        moving = values.std(axis=over) > 0.0
        assert moving.any()
        assert np.abs(values.mean(axis=over)).max() < 1e-12
        assert np.abs(values.std(axis=over)[moving] - 1.0).max() < 1e-12
