"""The table `summary` of a results file: a row per run, so that a reader need not walk through the groups."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.solution.status import STATUSES, code_of
from rotor_mbs.store import hdf5
from rotor_mbs.store.layout import Column

SUMMARY = "summary"

_ROW = Column(("row",), "1", "number of the row")
_NAMES = {
    "scene": Column(("row",), "1", "scene, as a number of its attribute labels"),
    "solver": Column(("row",), "1", "method, as a number of its attribute labels"),
}
_STATUS = Column(("row",), "1", "how the run ended, from its state")
# Attributes of a run, as columns; NaN where a run has none.
_NUMBERS = {
    "angle_error_max": Column(("row",), "rad", "largest angle error up to the horizon"),
    "angle_error_end": Column(("row",), "rad", "angle error at the last sample"),
    "tip_error_max": Column(("row",), "m", "largest distance of a tip from the reference up to the horizon"),
    "energy_drift_max": Column(("row",), "1", "largest energy error over the run, of the energy scale"),
    "horizon_s": Column(("row",), "s", "last sample before the error growth reaches 1e5, or the end"),
    "time_reached": Column(("row",), "s", "time of the last sample"),
    "setup_time_s": Column(("row",), "s", "building the model"),
    "run_time_s": Column(("row",), "s", "median run time of the integration alone"),
    "output_time_s": Column(("row",), "s", "reading out and computing the samples"),
    "steps": Column(("row",), "1", "integration steps"),
}


def put_summary(file: Any, runs: Sequence[tuple[str, str]]) -> None:
    """Writes the table of the runs (scene, method) that an open, new file holds; none where it holds no run."""
    if not runs:
        return
    group = hdf5.new_group(file, SUMMARY)
    hdf5.put_attributes(group, {"title": "all runs of this file"})
    hdf5.put(group, "row", np.arange(len(runs)), _ROW)
    for names, (column, described) in zip(zip(*runs, strict=True), _NAMES.items(), strict=True):
        labels = list(dict.fromkeys(names))
        codes = np.array([labels.index(name) for name in names], np.int32)
        hdf5.put_attributes(hdf5.put(group, column, codes, described), {"labels": labels})
    facts = [file[f"{scene}/{method}"].attrs for scene, method in runs]
    codes = np.array([_code(one.get("status")) for one in facts], np.int8)
    hdf5.put_flags(hdf5.put(group, "status", codes, _STATUS), STATUSES)
    for name, column_of_numbers in _NUMBERS.items():
        hdf5.put(group, name, _numbers([one.get(name) for one in facts]), column_of_numbers)


def _code(status: object) -> int:
    """-1 where it is none."""
    return code_of(status) if isinstance(status, str) and status in STATUSES else -1


def _numbers(values: Sequence[object]) -> NDArray[np.float64]:
    return np.array([float(value) if isinstance(value, (int, float, np.number)) else np.nan for value in values])
