"""The map of the stability suite: every scene and method as one of a few outcomes, and what to use which method for.

Reads the store alone.
"""

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

    outcome      a key of OUTCOMES, from the run's status and what a ladder of steps found
    message      the run's own; for "energy_alone", why nothing else judges it
    angle_error  rad up to the horizon; None without a reference, or where the horizon is before the second sample
    time_reached s: of the last finite sample, whatever the engine says
    step         s: the step that 1e-6 rad needs, where a ladder found it
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
        return "stiff" if folder == "stiff" else _FAMILIES.get(first, first)

    @property
    def is_stiff_or_light(self) -> bool:
        return self.family in ("stiff", "light")


_FAMILIES = {  # of scenes whose names do not begin with that of their family
    part: family
    for family, parts in {
        "light": ("feather",),
        "singular": ("passage",),
        "fast": ("spin", "tumbling", "rate", "rates", "torque"),
        "long": ("hour", "pendulum"),
        "scale": ("toy", "giant", "zero", "gravity"),
    }.items()
    for part in parts
}


def suite_runs(path: Path) -> list[SuiteRun]:
    """Every run of a results file, in its order. Raises StoreError."""
    ladders = {(record.scene, record.name): record for record in read_records(path, "stability")}
    found = []
    with open_results(path) as results:
        for scene in results.scenes.values():
            for name, run in scene.methods.items():
                found.append(_suite_run(scene, run, ladders.get((scene.name, name))))
    return found


def _suite_run(scene: StoredScene, run: StoredRun, ladder: Record | None) -> SuiteRun:
    facts = run.attributes
    error = facts.get("angle_error_max")
    reference = scene.reference
    step = ladder.attributes.get("step_for_target_s") if ladder is not None else None
    steps_ok = ladder is not None and ladder.arrays["status"] == code_of("ok")
    ladder_reaches = ladder is not None and bool(np.any(steps_ok & (ladder.arrays["angle_error_max"] <= TARGET)))
    has_reference = reference is not None and reference.status == "ok"
    outcome = _outcome(run, ladder, has_motion=has_reference)
    return SuiteRun(
        scene.name,
        run.method,
        run.status,
        outcome,
        _not_compared(reference) if outcome == "energy_alone" else str(facts.get("message", "")),
        bool(facts.get("false_success", 0)),
        has_reference,
        None if error is None else float(error),
        facts.get("energy_drift_max"),
        float(facts["run_time_s"]),
        float(run.array("time")[-1]) if len(run.array("time")) else 0.0,
        None if step is None else float(step),
        (run.status == "ok" and error is not None and error <= TARGET) or ladder_reaches,
    )


def _outcome(run: StoredRun, ladder: Record | None, *, has_motion: bool) -> str:
    if run.status == "ok":
        return "holds" if "angle_error_max" in run.attributes else "energy_alone"
    if ladder is not None and "ok" in ladder.statuses:
        return "smaller_step"
    if run.status in ("timed_out", "unchecked"):
        return run.status
    if run.attributes.get("false_success", 0):
        return "false_success"
    if run.status == "singular" and not has_motion:
        return "refuses"
    if run.status != "inaccurate":
        return "says_so"
    lost = not run.attributes.get("energy_drift_max", 0.0) <= _ENERGY_LOST
    return "loses_energy" if lost else "inaccurate"


def _not_compared(reference: StoredRun | None) -> str:
    if reference is None:
        return "judged by its energy alone: there is no reference"
    if len(reference.array("time")) < 2:
        return f"judged by its energy alone: no reference ({reference.attributes['message']})"
    return "judged by its energy alone: the horizon is before the second sample"


def unreached(found: Iterable[SuiteRun]) -> list[str]:
    """Stiff and light scenes with a reference on which no method reaches 1e-6 rad."""
    asked = [cell for cell in found if cell.is_stiff_or_light and cell.has_reference]
    reached = {cell.scene for cell in asked if cell.reaches_target}
    return [scene for scene in dict.fromkeys(cell.scene for cell in asked) if scene not in reached]


def reached_by(found: Iterable[SuiteRun], scene: str) -> str | None:
    """The method that reaches 1e-6 rad on the scene in the least time; None where none does."""
    able = [cell for cell in found if cell.scene == scene and cell.status == "ok" and cell.reaches_target]
    return min(able, key=lambda cell: cell.run_time_s).method if able else None


def advice_lines(
    found: Sequence[SuiteRun], label: Callable[[str], str] = str, heading: Callable[[str], str] = str
) -> list[str]:
    """Where each method holds, what to use it for and what not, a line per method.

    By family of scenes: use where nine tenths hold, not where fewer than half do even with a smaller step.

    label, heading   how a method and a family are called
    """
    by_method: dict[str, list[SuiteRun]] = {}
    for run in found:
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
        (use if holds >= 0.9 else in_part if with_step >= 0.5 else avoid).append(family)
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
