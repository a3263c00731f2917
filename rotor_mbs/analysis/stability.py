"""The map of the stability suite: every scene and method as one of a few outcomes, and what to use which method for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rotor_mbs.runs.read import StoredRun, StoredScene, open_results
from rotor_mbs.runs.records import Record, read_records
from rotor_mbs.solution.status import code_of
from rotor_mbs.solution.text_table import listed

TARGET = 1e-6  # rad: what a method must reach on the stiff and light scenes

# Outcome -> symbol, text. Colour is the report's.
OUTCOMES = {
    "holds": ("✓", "holds"),
    "energy_alone": ("E", "conserves energy; there is nothing else to compare it with"),
    "smaller_step": ("▾", "holds with a smaller step"),
    "inaccurate": ("≈", "ends, but off its bound"),
    "loses_energy": ("↯", "loses or makes energy"),
    "says_so": ("✗", "fails and reports it"),
    "false_success": ("!", "fails and claims success"),
    "refuses": ("–", "refuses a scene in which no motion exists"),
    "timed_out": ("T", "too slow for the time limit"),
    "unchecked": ("?", "ends; there is nothing to judge it by"),
}

_HOLDS = ("holds", "energy_alone")

# Above this share of the energy scale a run has not merely lost digits.
_ENERGY_LOST = 1e-3


@dataclass(frozen=True)
class SuiteRun:
    """A run of the suite: a scene by a method.

    outcome: a key of OUTCOMES, from the run's status and what a ladder of steps found. angle_error: rad up to the
    horizon, None where nothing is compared. time_reached: s, of the last finite sample. step: s, that 1e-6 rad needs,
    where a ladder found it.
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
    reaches_target: bool

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
            _suite_run(scene, run, ladders.get((scene.name, name)))
            for scene in results.scenes.values()
            for name, run in scene.methods.items()
        ]


def _suite_run(scene: StoredScene, run: StoredRun, ladder: Record | None) -> SuiteRun:
    facts, reference = run.attributes, scene.reference
    message, error = str(facts.get("message", "")), facts.get("angle_error_max")
    drift, time = facts.get("energy_drift_max"), run.array("time")
    has_reference = reference is not None and reference.status == "ok"
    step, steps_hold, reaches_target = None, False, run.status == "ok" and error is not None and error <= TARGET
    if ladder is not None:
        step, steps_ok = ladder.attributes.get("step_for_target_s"), ladder.arrays["status"] == code_of("ok")
        steps_hold = bool(steps_ok.any())
        reaches_target |= bool(np.any(steps_ok & (ladder.arrays["angle_error_max"] <= TARGET)))
    if run.status == "ok" and error is not None:
        outcome = "holds"
    elif run.status == "ok":
        outcome = "energy_alone"
        reason = "the horizon is before the second sample"
        if reference is None:
            reason = "there is no reference"
        elif len(reference.array("time")) < 2:
            reason = f"no reference ({reference.attributes['message']})"
        message = f"judged by its energy alone: {reason}"
    elif steps_hold:
        outcome = "smaller_step"
    elif run.status in ("timed_out", "unchecked"):
        outcome = run.status
    elif facts.get("false_success", 0):
        outcome = "false_success"
    elif run.status == "singular" and not has_reference:
        outcome = "refuses"
    elif run.status != "inaccurate":
        outcome = "says_so"
    else:
        outcome = "inaccurate" if (drift or 0.0) <= _ENERGY_LOST else "loses_energy"
    return SuiteRun(
        scene.name,
        run.method,
        run.status,
        outcome,
        message,
        bool(facts.get("false_success", 0)),
        has_reference,
        None if error is None else float(error),
        drift,
        float(facts["run_time_s"]),
        float(time[-1]) if len(time) else 0.0,
        None if step is None else float(step),
        reaches_target,
    )


def unreached(runs: Iterable[SuiteRun]) -> list[str]:
    """Stiff and light scenes with a reference on which no method reaches 1e-6 rad."""
    asked = [run for run in runs if run.is_stiff_or_light and run.has_reference]
    reached = {run.scene for run in asked if run.reaches_target}
    return [scene for scene in dict.fromkeys(run.scene for run in asked) if scene not in reached]


def reached_by(runs: Iterable[SuiteRun], scene: str) -> str | None:
    """The method that reaches 1e-6 rad on the scene in the least time; None where none does."""
    able = [run for run in runs if run.scene == scene and run.status == "ok" and run.reaches_target]
    return min(able, key=lambda run: run.run_time_s).method if able else None


def advice_lines(
    runs: Sequence[SuiteRun], label: Callable[[str], str] = str, heading: Callable[[str], str] = str
) -> list[str]:
    """Where each method holds, what to use it for and what not, a line per method.

    By family of scenes: use where nine tenths hold, not where fewer than half do even with a smaller step. label and
    heading: how a method and a family are called.
    """
    by_method: dict[str, list[SuiteRun]] = {}
    for run in runs:
        by_method.setdefault(run.method, []).append(run)
    return [f"{label(method)}: {'; '.join(_advice(own, heading))}" for method, own in by_method.items()]


def _advice(own: Sequence[SuiteRun], heading: Callable[[str], str]) -> list[str]:
    use: list[str] = []
    in_part: list[str] = []
    avoid: list[str] = []
    for family in dict.fromkeys(run.family for run in own):
        outcomes = [run.outcome for run in own if run.family == family and run.outcome != "refuses"]
        if not outcomes:
            continue
        holds = sum(outcome in _HOLDS for outcome in outcomes) / len(outcomes)
        with_step = sum(outcome in (*_HOLDS, "smaller_step") for outcome in outcomes) / len(outcomes)
        if holds >= 0.9:
            use.append(family)
        elif with_step >= 0.5:
            in_part.append(family)
        else:
            avoid.append(family)
    by_energy = sum(run.outcome == "energy_alone" for run in own)
    alone = f" ({by_energy} by its energy alone)" if by_energy else ""
    parts = [f"holds on {sum(run.outcome in _HOLDS for run in own)} of {len(own)}{alone}"]
    smaller = any(run.outcome == "smaller_step" and run.family in in_part for run in own)
    partly = "with a smaller step or not everywhere" if smaller else "not everywhere"
    for action, families in (("use", use), (partly, in_part), ("do not use", avoid)):
        if families:
            parts.append(f"{action} for {listed([*map(heading, families)])}")
    claimed = sum(run.false_success for run in own)
    if claimed:
        times = "once" if claimed == 1 else f"{claimed} times"
        parts.append(f"its engine claimed success {times} where the state says otherwise")
    return parts
