"""Error amplification and horizon of every run of a sweep."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from support.sweeps import made_sweep

from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.solution.metrics import horizon
from rotor_mbs.studies.stored_references import frozen_solution

SWEEP = """
title = "fig11 and a neighbour"
scene = "paper/fig11"
methods = ["lagrange/taylor", "exudyn_tree/rk67"]
amplification = {asked}
outputs = []
[[axis]]
key = "gravity"
values = [0, {gravity}]
"""


def _sweep(folder: Path, asked: str) -> Path:
    gravity = find_scenes(["paper/fig11"])[0].gravity
    return made_sweep(folder, SWEEP.format(asked=asked, gravity=gravity))


def test_it_is_that_of_the_frozen_reference(tmp_path: Path) -> None:
    """Both from double precision variational equations, whose own rounding is far below a thousandth."""
    (scene,) = find_scenes(["paper/fig11"])
    frozen = frozen_solution(scene).trajectory
    with h5py.File(_sweep(tmp_path, "true")) as file:
        growth, until = file["error_growth"][()], file["horizon_s"][()]
        assert file["horizon_s"].attrs["units"] == "s"
    assert growth[1] == pytest.approx(np.maximum.accumulate(frozen.error_growth)[-1], rel=1e-3)
    assert until[1] == horizon(frozen)
    assert growth[0] < growth[1]
    assert np.array_equal(growth[:2], growth[2:])  # of the motion, not of the method


def test_it_is_not_stored_where_it_is_not_asked_for(tmp_path: Path) -> None:
    with h5py.File(_sweep(tmp_path, "false")) as file:
        assert "error_growth" not in file
        assert "horizon_s" not in file
