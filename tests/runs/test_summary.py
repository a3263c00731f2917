"""The table of all runs that every results file has."""

from __future__ import annotations

import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from support.checking import results_file, shipped

from rotor_mbs.studies.run import run_scenes

SCENES = ["check/general", "check/held"]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return results_file(tmp_path_factory.mktemp("summary") / "results.h5", SCENES, ["lagrange/dop853"])


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_a_row_for_each_run_with_the_numbers_of_its_attributes(file: Path, engine: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        table = xr.open_dataset(file, group="summary", engine=engine)
    rows = [
        (table.scene.labels[i], table.solver.labels[j])
        for i, j in zip(table.scene.values, table.solver.values, strict=True)
    ]
    assert sorted(rows) == [(scene, method) for scene in SCENES for method in ("lagrange/dop853", "reference")]
    assert all(table[name].attrs["units"] and table[name].attrs["long_name"] for name in table.variables)
    with h5py.File(file) as stored:
        for i, (scene, method) in enumerate(rows):
            facts = stored[f"{scene}/{method}"].attrs
            assert table.status.flag_meanings.split()[int(table.status[i])] == facts["status"]
            for name in ("angle_error_max", "energy_drift_max", "horizon_s", "run_time_s", "steps"):
                assert np.array_equal(table[name][i], facts.get(name, np.nan), equal_nan=True), name


def test_it_follows_the_file(file: Path) -> None:
    """A later batch into the same file adds its rows; nothing is left of the earlier table."""
    run_scenes([shipped(SCENES[0])], {SCENES[0]: ["exudyn_tree/rk67"]}, file, workers=0, timeout_s=60.0)
    table = xr.open_dataset(file, group="summary", engine="h5netcdf")
    assert table.sizes["row"] == 5
    assert "exudyn_tree/rk67" in list(table.solver.labels)
