"""The table `summary` of a results file: a row per run, so that a reader need not walk through the groups."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.solution.status import STATUSES, code_of
from rotor_mbs.store import hdf5
from rotor_mbs.store.layout import Column
from rotor_mbs.store.records import COLUMNS

SUMMARY = "summary"

_ROW = Column(("row",), "1", "number of the row")
_NAMES = {
    "scene": Column(("row",), "1", "scene, as a number of its attribute labels"),
    "solver": Column(("row",), "1", "method, as a number of its attribute labels"),
}
_STATUS = Column(("row",), "1", "how the run ended, from its state")
# Attributes of a run, as columns; NaN where a run has none.
_NUMBERS = (
    "angle_error_max", "angle_error_end", "tip_error_max", "energy_drift_max", "horizon_s", "time_reached",
    "setup_time_s", "run_time_s", "output_time_s", "steps",
)  # fmt: skip


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
    for name in _NUMBERS:
        hdf5.put(group, name, _numbers([one.get(name) for one in facts]), Column(("row",), *COLUMNS[name]))


def _code(status: object) -> int:
    """-1 where it is none."""
    return code_of(status) if isinstance(status, str) and status in STATUSES else -1


def _numbers(values: Sequence[object]) -> NDArray[np.float64]:
    return np.array([float(value) if isinstance(value, (int, float, np.number)) else np.nan for value in values])
