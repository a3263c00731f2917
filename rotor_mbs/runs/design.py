"""The design of a results file: the runs that are asked for, and the columns that a table of runs or points has."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rotor_mbs.methods.catalogue import REFERENCE, find_method
from rotor_mbs.runs.hdf5 import CHARACTERS, Column
from rotor_mbs.runs.versions import row_versions
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.solution.quantities import LOADS, quantities
from rotor_mbs.solution.status import STATUSES

MISSING = -1  # status of a row that is not stored
# What the table of a scene's arrays repeats of the run's row in another table; in a row it has this name.
REPEATED = {"status": "status_repeated", "samples": "samples_repeated"}
CHARACTER = "S1"  # kind of a column of texts that are computed: (run, characters), UTF-8, then zeros
RUNS = "runs"
# What a frozen reference stores: it cannot be computed again from angles and rates as precisely.
FROZEN = ("angles", "rates", "work", *(load.name for load in LOADS), "angle_uncertainty", "error_growth")
ONCE_A_SCENE = ("angle_uncertainty", "error_growth")  # stored once a scene, over time


def flags(names: Sequence[str], first: int = 0) -> dict[str, Any]:
    """Return the attributes of a column of codes, as CF has them: what each code from `first` on
    means."""
    return {"flag_values": np.arange(first, first + len(names), dtype=np.int8), "flag_meanings": " ".join(names)}


_OWN_POINTS = "of printed/ode45 over ode45's own output points instead"
# What a computed column with a value a row is, whichever table has it: units, long name, type where it is no double.
COLUMNS = {
    name: Column(("run", CHARACTERS) if CHARACTER in kind else ("run",), units, long_name, kind[0] if kind else "<f8")
    for name, (units, long_name, *kind) in {
        "status": ("1", "outcome of the run, see the status codes; -1: not computed yet", "i1"),
        "message": ("1", "reason for a status other than ok and completed", CHARACTER),
        "samples": ("1", "number of samples stored", "<i8"),
        "time_reached": ("s", "time of the run's last sample; 0 also without any"),
        "time_limit_s": ("s", "time limit that stopped the run; NaN if it was not stopped"),
        "steps": ("1", "number of integration steps; -1: unknown", "<i8"),
        "rhs_evaluations": ("1", "number of evaluations of the right-hand side; -1: unknown", "<i8"),
        "setup_time_s": ("s", "time to build the model"),
        "setup_again_time_s": ("s", "time to build the model a second time"),
        "run_time_s": ("s", "median run time of the integration"),
        "run_time_min_s": ("s", "shortest run time of the integration"),
        "run_time_q1_s": ("s", "lower quartile of the run times"),
        "run_time_q3_s": ("s", "upper quartile of the run times"),
        "output_time_s": ("s", "time to compute the samples after the integration"),
        "repeats": ("1", "number of timed runs", "<i8"),
        "repeatable": ("1", "1 if the first and last run of every point of the curve are bitwise equal", "i1"),
        "engine_success": ("1", "1: the engine reported success, 0: failure; -1: no report", "i1"),
        "engine_message": ("1", "message of the engine", CHARACTER),
        "false_success": ("1", "1 if the engine reported success although the samples are wrong", "i1"),
        "energy_scale_J": ("J", "energy scale, to which energy errors are relative"),
        "energy_drift_max": ("1", "largest energy error over the run, relative to the energy scale"),
        "energy_gain_J": ("J", "largest increase of the total energy beyond the work"),
        "angle_error_max": ("rad", "largest angle error up to the horizon"),
        "angle_error_predicted": ("rad", "largest angle error up to the horizon, predicted from the defects"),
        "defect_max": (
            "rad",
            "largest defect of a coordinate in an interval",
        ),
        "defect_median": ("rad", "median of the interval defects"),
        "defect_time": ("s", "end of the interval that is furthest beyond its bound, or of the largest defect"),
        "defect_judged": (
            "rad",
            "value compared with the bound: defect beyond rounding divided by (interval / 0.01 s), if above 1, and by "
            "the error growth over the interval, if above 1; largest over the run",
        ),
        "defect_excess": ("rad", "defect beyond rounding in that interval"),
        "defect_allowed": ("rad", "largest defect beyond rounding that is allowed in that interval"),
        "defect_mean": ("rad", "largest signed mean of the defects of a coordinate"),
        "defect_drift": (
            "rad",
            "largest sum of the defects of 100 consecutive intervals, each multiplied by the state transition matrix "
            "from its interval to the last of the 100",
        ),
        "defect_floor": ("rad", "largest defect that rounding of the samples can cause"),
        "defects_not_judged": (
            "1",
            "number of intervals with a defect of more than 0.01 rad, beyond rounding or because of it",
        ),
        "angle_error_whole": ("rad", "largest angle error over the whole run"),
        "angle_error_end": ("rad", "angle error at the last sample of the scene"),
        "tip_error_max": ("m", "largest distance of a tip from the reference up to the horizon"),
        "error_growth": ("1", "largest factor by which a small error of the initial state has grown"),
        "horizon_s": (
            "s",
            "time of the last sample before the error growth reaches 1e5",
        ),
        "uncertainty_rad": ("rad", "uncertainty of the reference up to the horizon"),
        "zero_pitch_max": ("rad", "largest magnitude of the pitch angles that stay zero in the reference"),
        "zero_pitch_left_s": ("s", "time at which a pitch angle that stays zero in the reference becomes nonzero"),
        "zero_pitch_growth_per_s": ("1/s", "growth rate of a pitch angle that stays zero in the reference"),
        "rotor_angle_min": ("rad", f"smallest rotor angle (signed) over the samples; {_OWN_POINTS}"),
        "rotor_angle_max": ("rad", f"largest rotor angle (signed) over the samples; {_OWN_POINTS}"),
        "rotor_rate_max": ("rad/s", f"largest magnitude of the rotor rate over the samples; {_OWN_POINTS}"),
        "pitch_max": ("rad", "largest magnitude of a pitch angle"),
        "left_out": ("1", "1 if the point was omitted because of the time budget", "i1"),
        "load_before": ("1", "load average of the machine before the timing"),
        "pinned_core": ("1", "number of the core used for timing; -1: any", "<i8"),
        "order": ("1", "order of convergence of the curve, fitted above its round-off floor"),
        "step_for_target_s": ("s", "largest step of the ladder with an error of at most 1e-6 rad"),
        "code": (
            "1",
            "CRC-32 of the versions (package, code, libraries of the method) that computed the run",
            "<u4",
        ),
        "crc32": (
            "1",
            "CRC-32 of the row over what is computed; not of what is known before",
            "<u4",
        ),
    }.items()
}
COLUMNS["status"] = COLUMNS["status"]._replace(attributes=flags(("missing", *STATUSES), MISSING))
# What the design says of each row of a table, in this order: units, long name. What has no entry is no column.
KNOWN = {
    "scene": ("1", "name of the scene"),
    "method_name": ("1", "name of the method: model/integrator"),
    "curve": ("1", "method, and the settings that are constant along it"),
    "setting_kind": ("1", "setting that varies along the curve: step or tolerance"),
    "settings": ("1", "settings of the method, JSON"),
    "options": ("1", "options of the command, JSON"),
    "versions": ("1", "versions of package, libraries and code that computed the row, JSON"),
    "scene_hash": ("1", "SHA-256 of the numbers of the scene"),
    "step": ("s", "time step"),
    "tolerance": ("1", "tolerance of the method"),
    "order_expected": ("1", "order of the method"),
}
NUMBERS = ("step", "tolerance", "order_expected")  # those of them that are no texts

_RUN_COLUMNS = (
    "status", "message", "samples", "time_reached", "time_limit_s", "steps", "rhs_evaluations", "setup_time_s",
    "run_time_s", "run_time_min_s", "output_time_s", "repeats", "engine_success", "engine_message", "false_success",
    "energy_scale_J", "energy_drift_max", "energy_gain_J", "angle_error_max", "angle_error_predicted",
    "angle_error_whole", "angle_error_end", "horizon_s", "defect_max", "defect_median", "defect_time",
    "defect_judged", "defect_excess", "defect_allowed", "defect_mean", "defect_drift", "defect_floor",
    "defects_not_judged",
    "zero_pitch_max", "zero_pitch_left_s", "zero_pitch_growth_per_s", "rotor_angle_min", "rotor_angle_max",
    "rotor_rate_max",
)  # fmt: skip
# The computed columns of each table of points.
POINT_COLUMNS: Mapping[str, Mapping[str, Column]] = {
    table: {name: COLUMNS[name] for name in names.split()}
    for table, names in {
        "bench": "status message angle_error_max angle_error_end tip_error_max energy_drift_max defect_max "
        "defect_median zero_pitch_max run_time_s run_time_min_s run_time_q1_s run_time_q3_s setup_time_s "
        "setup_again_time_s output_time_s repeats steps "
        "false_success left_out horizon_s uncertainty_rad samples load_before pinned_core repeatable order crc32",
        "stability": "status message angle_error_max energy_drift_max false_success step_for_target_s crc32",
    }.items()
}


@dataclass(frozen=True)
class Asked:
    """A run as it is asked for: a row of the design.

    versions: of what computes it, by default those of this installation; of a reference that is read from a shipped
    file also who computed it (`frozen_with`).
    """

    scene: Scene
    method: str
    settings: Mapping[str, object] = field(default_factory=dict)
    versions: Mapping[str, str] | None = None

    @property
    def is_shipped(self) -> bool:
        return self.versions is not None and "frozen_with" in self.versions

    @property
    def label(self) -> str:
        """Return the label of its row: "paper/fig11/lagrange/taylor"."""
        return f"{self.scene.name}/{self.method}"

    @property
    def reference_label(self) -> str:
        return f"{self.scene.name}/{REFERENCE}"

    @property
    def known(self) -> dict[str, str]:
        """Return the columns of /runs that follow from the design."""
        method = find_method(self.method)
        settings = method.chosen(self.scene, self.settings).as_dict()
        return {
            "scene": self.scene.name,
            "method_name": self.method,
            "settings": json.dumps(settings, sort_keys=True),
            "versions": json.dumps(dict(self.versions or row_versions(method)), sort_keys=True),
            "scene_hash": scene_hash(self.scene),
        }


def metric_columns(outputs: Iterable[str]) -> dict[str, Column]:
    """Return the computed columns of /runs for scenes that ask for these outputs."""
    columns = {name: COLUMNS[name] for name in _RUN_COLUMNS}
    for quantity in quantities(outputs):
        name, long_name = quantity.name, quantity.long_name
        if quantity.judgement is not None:
            unit = "1" if quantity.judgement.scale_of else quantity.units
            error = "largest relative error" if quantity.judgement.scale_of else "largest error"
            text = f"{long_name}: {error}" if quantity.judgement.with_reference else f"{long_name} over the run"
            columns[quantity.judgement.metric] = Column(("run",), unit, text)
        if quantity.has_peak:
            columns[f"{name}_max"] = Column(("run",), quantity.units, f"{long_name}: maximum")
            columns[f"{name}_max_time_s"] = Column(("run",), "s", f"{long_name}: time of the maximum")
            if quantity.dimensions[1:2] == ("blade",):
                columns[f"{name}_max_blade"] = Column(("run",), "1", f"{long_name}: blade of the maximum, from 1")
    return columns | {"crc32": COLUMNS["crc32"]}


def arrays_of(run: Asked) -> dict[str, Column]:
    """Return the arrays over time that a run stores, by their name in the file."""
    method = find_method(run.method)
    # A reference is read back by its angles and rates, whatever the scene asks for.
    outputs = (*run.scene.outputs, "angles", "rates") if run.method == REFERENCE else run.scene.outputs
    columns = {}
    for quantity in quantities(outputs):
        if not (quantity.required or quantity.name in method.arrays):
            continue
        is_once = quantity.name in ONCE_A_SCENE
        if is_once and run.method != REFERENCE:
            continue
        dimensions = quantity.dimensions if is_once else ("run", *quantity.dimensions)
        columns[quantity.name] = Column(dimensions, quantity.units, quantity.long_name)
    return columns
