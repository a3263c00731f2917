"""Error against run time in a results file: /bench/<scene>/<model>/<integrator>, one-dimensional over `setting`.

Writes and reads curves; judges nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.solution.status import RUN_STATUSES
from rotor_mbs.store import hdf5
from rotor_mbs.store.layout import Column
from rotor_mbs.store.read import open_results

GROUP = "bench"
GROWTH = "growth"

# The statuses of a run, and one for a rung that no run was made of. Order gives the integer codes.
STATUSES = (*RUN_STATUSES, "left_out")

_SECONDS = {
    "run_time_s": "median run time of the integration alone",
    "run_time_min_s": "shortest run time",
    "run_time_q1_s": "lower quartile of the run times",
    "run_time_q3_s": "upper quartile of the run times",
    "setup_time_s": "building the model, everything compiled anew",
    "setup_again_time_s": "building the model a second time",
    "output_time_s": "reading out and computing the samples",
}
_QUANTITIES = {
    "angle_error_max": Column(("setting",), "rad", "largest angle error up to the horizon"),
    "angle_error_end": Column(("setting",), "rad", "angle error at the last sample"),
    "tip_error_max": Column(("setting",), "m", "largest distance of a tip from the reference up to the horizon"),
    "energy_drift_max": Column(("setting",), "1", "largest energy error over the run, of the energy scale"),
    **{name: Column(("setting",), "s", text) for name, text in _SECONDS.items()},
    "simulated_s": Column(("setting",), "s", "duration of the scene"),
    "repeats": Column(("setting",), "1", "timed runs"),
    "steps": Column(("setting",), "1", "steps of one run"),
    "status": Column(("setting",), "1", "how the run ended, from its state"),
    "false_success": Column(("setting",), "1", "1 where the engine reported success and the state says otherwise"),
}
_WHOLE = ("repeats", "steps", "status", "false_success")
_UNITS = {"step": "s", "tolerance": "1", "blades": "1", "duration": "s"}


@dataclass(frozen=True)
class Curve:
    """One method over its settings on one scene.

    scene, name   "paper/fig05", "lagrange/taylor" (with its fixed choices behind, where they are not the default ones)
    arrays        by dataset name, each (settings,); `setting` among them, `status` as codes of STATUSES
    attributes    method, setting_kind, horizon_s, order, order_expected, uncertainty_rad, messages, bench_hash, ...
    """

    scene: str
    name: str
    arrays: Mapping[str, NDArray[Any]]
    attributes: Mapping[str, Any]

    @property
    def statuses(self) -> list[str]:
        return [STATUSES[int(code)] for code in self.arrays["status"]]

    @property
    def messages(self) -> list[str]:
        return [str(text) for text in self.attributes.get("messages", [""] * len(self.arrays["setting"]))]


def write_curves(path: Path, curves: Sequence[Curve]) -> None:
    """A results file with these curves alone, atomically. Raises StoreError."""
    with hdf5.new_file(path) as file:
        for curve in curves:
            _put(hdf5.new_group(file, f"{GROUP}/{curve.scene}/{curve.name}"), curve)


def _put(group: Any, curve: Curve) -> None:
    kind = str(curve.attributes["setting_kind"])
    scale = Column(("setting",), _UNITS[kind], kind)
    hdf5.put_attributes(hdf5.put(group, "setting", curve.arrays["setting"], scale), {"kind": kind})
    for name, quantity in _QUANTITIES.items():
        if name in curve.arrays:
            kind_of = np.int64 if name in _WHOLE else np.float64
            dataset = hdf5.put(group, name, np.asarray(curve.arrays[name], dtype=kind_of), quantity)
            if name == "status":
                codes = np.arange(len(STATUSES), dtype=np.int64)
                dataset.attrs["flag_values"] = codes
                dataset.attrs["flag_meanings"] = " ".join(STATUSES)
    hdf5.put_attributes(group, dict(curve.attributes))


def read_curves(path: Path) -> list[Curve]:
    """Every curve of a results file, in its order; none where it has no bench. Raises StoreError."""
    with open_results(path) as results:
        if GROUP not in results.root:
            return []
        return [_curve(name, group) for name, group in leaves(results.root[GROUP])]


def _curve(path: str, group: Any) -> Curve:
    scene, model, integrator = path.rsplit("/", 2)
    arrays = {name: item[()] for name, item in group.items() if not hdf5.is_group(item)}
    return Curve(scene, f"{model}/{integrator}", arrays, hdf5.attributes_of(group))


def leaves(group: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """(path, group) of every group below `group` that is a curve or a stability record; `path` goes before."""
    for name, item in group.items():
        if not hdf5.is_group(item):
            continue
        below = f"{path}/{name}" if path else name
        if "setting" in item or "record" in item.attrs:
            yield below, item
        else:
            yield from leaves(item, below)
