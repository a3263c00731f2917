"""A file of every kind that the program writes, made once for all tests of this folder; for reading
only."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.checking import results_file
from support.sweeps import THREE_RUNS, made_sweep

import rotor_mbs as rm

SCENE = "check/held"


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """results.h5, modes.h5 and comparison.h5 of one scene, the last with its data.csv; s.h5, with
    its s.toml."""
    folder = tmp_path_factory.mktemp("files")
    results_file(folder / "results.h5", [SCENE], ["lagrange/dop853"])
    made_sweep(folder, THREE_RUNS)
    rm.modes(SCENE, [0.5, 1.0]).save(folder / "modes.h5")
    rm.export(SCENE, "csv", folder / "data.csv")
    rm.compare(folder / "data.csv", SCENE).save(folder / "comparison.h5")
    return folder
