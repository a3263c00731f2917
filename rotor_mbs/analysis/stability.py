"""The stability suite as a map: how each method ends on every scene, whether a smaller step helps, which is fastest."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rotor_mbs.runs.read import StoredRun, open_results
from rotor_mbs.runs.records import Record, read_records
from rotor_mbs.solution.status import code_of
from rotor_mbs.solution.text_table import TextTable

TARGET = 1e-6  # rad: what a method must reach on the stiff and light scenes

# What the map shows of a run: its status, or one of two that say more. Symbol, text; colour is the report's.
OUTCOMES = {
    "ok": ("✓", "ok"),
    "energy_alone": ("E", "ok by its energy; there is nothing else to compare it with"),
    "smaller_step": ("▾", "ok with a smaller step"),
    "inaccurate": ("≈", "inaccurate: ends, but off its bound"),
    "diverged": ("↯", "diverged"),
    "singular": ("S", "singular"),
    "solver_failed": ("✗", "solver failed"),
    "timed_out": ("T", "timed out"),
    "unchecked": ("?", "unchecked: ends; there is nothing to judge it by"),
}


@dataclass(frozen=True)
class SuiteRun:
    """A run of the suite: a scene by a method.

    outcome: a key of OUTCOMES. angle_error: rad up to the horizon, None where nothing is compared. time_reached: s, of
    the last finite sample. step: s, that 1e-6 rad needs, where a ladder found it.
    """

    scene: str
    method: str
    status: str
    outcome: str
    message: str
    false_success: bool
    has_reference: bool
    angle_error: float | None
    energy_drift: float | None
    run_time_s: float
    time_reached: float
    step: float | None

    @property
    def family(self) -> str:
        """What its scene stresses: stiff, or the first part of an extreme scene's name."""
        folder, _, name = self.scene.rpartition("/")
        first = name.split("-")[0]
        if folder == "stiff":
            return "stiff"
        return next((family for family, names in _FAMILIES.items() if first in names), first)

    @property
    def is_stiff_or_light(self) -> bool:
        return self.family in ("stiff", "light")

    @property
    def reaches_target(self) -> bool:
        """Whether it is ok within 1e-6 rad, or a smaller step is."""
        is_close = self.status == "ok" and self.angle_error is not None and self.angle_error <= TARGET
        return is_close or self.step is not None


_FAMILIES = {  # of scenes whose names do not begin with that of their family
    "light": ("feather",),
    "singular": ("passage",),
    "fast": ("spin", "tumbling", "rate", "rates", "torque"),
    "long": ("hour", "pendulum"),
    "scale": ("toy", "giant", "zero", "gravity"),
}


def suite_runs(path: Path) -> list[SuiteRun]:
    """Every run of a results file, in its order. Raises StoreError."""
    ladders = {(record.scene, record.name): record for record in read_records(path, "stability")}
    with open_results(path) as results:
        return [
            _suite_run(run, scene.reference, ladders.get((scene.name, name)))
            for scene in results.scenes.values()
            for name, run in scene.methods.items()
        ]


def _suite_run(run: StoredRun, reference: StoredRun | None, ladder: Record | None) -> SuiteRun:
    facts, time = run.attributes, run.array("time")
    outcome, message = run.status, str(facts.get("message", ""))
    if run.status == "ok" and "angle_error_max" not in facts:
        reason = "the horizon is before the second sample"
        if reference is None:
            reason = "there is no reference"
        elif len(reference.array("time")) < 2:
            reason = f"no reference ({reference.attributes['message']})"
        outcome, message = "energy_alone", f"judged by its energy alone: {reason}"
    elif run.status != "ok" and ladder is not None and np.any(ladder.arrays["status"] == code_of("ok")):
        outcome = "smaller_step"
    return SuiteRun(
        scene=run.scene,
        method=run.method,
        status=run.status,
        outcome=outcome,
        message=message,
        false_success=bool(facts.get("false_success", 0)),
        has_reference=reference is not None and reference.status == "ok",
        angle_error=facts.get("angle_error_max"),
        energy_drift=facts.get("energy_drift_max"),
        run_time_s=float(facts["run_time_s"]),
        time_reached=float(time[-1]) if len(time) else 0.0,
        step=None if ladder is None else ladder.attributes.get("step_for_target_s"),
    )


def fastest_to_target(runs: Iterable[SuiteRun]) -> dict[str, str | None]:
    """By scene with a reference, the method that is ok within 1e-6 rad, or with a smaller step, in the least time; None
    where none is."""
    fastest: dict[str, SuiteRun | None] = {}
    for run in runs:
        if not run.has_reference:
            continue
        before = fastest.setdefault(run.scene, None)
        is_able = run.status == "ok" and run.reaches_target
        if is_able and (before is None or run.run_time_s < before.run_time_s):
            fastest[run.scene] = run
    return {scene: None if run is None else run.method for scene, run in fastest.items()}


def unreached(runs: Iterable[SuiteRun]) -> list[str]:
    """Stiff and light scenes with a reference on which no method reaches 1e-6 rad."""
    asked = [run for run in runs if run.is_stiff_or_light and run.has_reference]
    reached = {run.scene for run in asked if run.reaches_target}
    return [scene for scene in dict.fromkeys(run.scene for run in asked) if scene not in reached]


def family_table(runs: Sequence[SuiteRun], heading: Callable[[str], str] = str) -> TextTable:
    """A row for each method, a column for each family of scenes: "12+1 of 14" are ok, of these 1 with a smaller step.

    Without scenes that are singular and have no reference: there no motion exists. heading: how a family is called.
    """
    compared = [run for run in runs if run.has_reference or run.status != "singular"]
    families = list(dict.fromkeys(run.family for run in compared))
    rows = []
    for method in dict.fromkeys(run.method for run in runs):
        cells = []
        for family in families:
            outcomes = [run.outcome for run in compared if run.method == method and run.family == family]
            ok, smaller = sum(outcome in ("ok", "energy_alone") for outcome in outcomes), outcomes.count("smaller_step")
            count = f"{ok}+{smaller}" if smaller else f"{ok}"
            cells.append(f"{count} of {len(outcomes)}" if outcomes else "")
        claimed = sum(run.false_success for run in runs if run.method == method)
        rows.append((method, *cells, str(claimed)))
    return TextTable(("method", *map(heading, families), "false successes"), rows)
