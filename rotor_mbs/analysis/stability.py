"""The map of the stability suite: every scene and method as one of six outcomes, and what to use which method for.

Reads the store alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rotor_mbs.store.read import StoredRun, StoredScene, open_results
from rotor_mbs.store.stability import Record, read_records

TARGET = 1e-6  # rad: what "right" means on the map

# Outcome -> symbol, words. Colour is the report's.
OUTCOMES = {
    "holds": ("✓", "holds"),
    "smaller_step": ("▾", "holds with a smaller step"),
    "inaccurate": ("≈", "ends, but off its bound"),
    "loses_energy": ("↯", "loses or makes energy"),
    "says_so": ("✗", "fails and says so"),
    "false_success": ("!", "fails and claims success"),
    "refuses": ("–", "refuses, rightly: no motion to follow"),
    "timed_out": ("⧗", "too slow for the time limit"),
}

# Above this share of the energy scale a run has not merely lost digits.
_ENERGY_LOST = 1e-3


@dataclass(frozen=True)
class Cell:
    """A scene under a method.

    outcome      a key of OUTCOMES, from the run's status and what a ladder of steps found
    angle_error  rad up to the horizon; None without a reference
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
        return family_of(self.scene)

    @property
    def is_stiff_or_light(self) -> bool:
        return self.family in ("stiff", "light")


def family_of(scene: str) -> str:
    """What a shipped scene stresses: stiff, or the first word of an extreme scene's name."""
    folder, _, name = scene.rpartition("/")
    if folder == "stiff":
        return "stiff"
    first = name.split("-")[0]
    return _FAMILIES.get(first, first)


_FAMILIES = {
    "feather": "light",
    "passage": "singular",
    "spin": "fast",
    "tumbling": "fast",
    "rate": "fast",
    "rates": "fast",
    "torque": "fast",
    "hour": "long",
    "pendulum": "long",
    "toy": "scale",
    "giant": "scale",
    "zero": "scale",
    "gravity": "scale",
}


def cells(path: Path) -> list[Cell]:
    """Every run of a results file, in its order. Raises StoreError."""
    ladders = {record.name: record for record in read_records(path) if record.kind == "steps"}
    found = []
    with open_results(path) as results:
        for scene in results.scenes.values():
            for name, run in scene.methods.items():
                found.append(_cell(scene, run, ladders.get(f"{scene.name}/{name}")))
    return found


def _cell(scene: StoredScene, run: StoredRun, ladder: Record | None) -> Cell:
    facts = run.attributes
    error = facts.get("angle_error_max")
    reference = scene.reference
    step = ladder.attributes.get("step_for_target_s") if ladder is not None else None
    ladder_reaches = ladder is not None and bool(np.any(_ok(ladder) & (ladder.arrays["angle_error_max"] <= TARGET)))
    return Cell(
        scene.name,
        run.method,
        run.status,
        _outcome(run, ladder, has_motion=reference is not None and reference.status == "ok"),
        str(facts.get("message", "")),
        bool(facts.get("false_success", 0)),
        reference is not None and reference.status == "ok",
        None if error is None else float(error),
        facts.get("energy_drift_max"),
        float(facts["run_time_s"]),
        float(facts["time_reached"]),
        None if step is None else float(step),
        (run.status == "ok" and error is not None and error <= TARGET) or ladder_reaches,
    )


def _ok(ladder: Record) -> np.ndarray:
    return np.array([status == "ok" for status in ladder.statuses])


def _outcome(run: StoredRun, ladder: Record | None, *, has_motion: bool) -> str:
    if run.status == "ok":
        return "holds"
    if ladder is not None and bool(_ok(ladder).any()):
        return "smaller_step"
    if run.status == "timed_out":
        return "timed_out"
    if run.attributes.get("false_success", 0):
        return "false_success"
    if run.status == "singular" and not has_motion:
        return "refuses"
    if run.status != "inaccurate":
        return "says_so"
    lost = not run.attributes.get("energy_drift_max", 0.0) <= _ENERGY_LOST
    return "loses_energy" if lost else "inaccurate"


def unreached(found: Iterable[Cell]) -> list[str]:
    """Stiff and light scenes with a reference on which no method reaches 1e-6 rad."""
    by_scene: dict[str, bool] = {}
    for cell in found:
        if cell.is_stiff_or_light and cell.has_reference:
            by_scene[cell.scene] = by_scene.get(cell.scene, False) or cell.reaches_target
    return [scene for scene, reached in by_scene.items() if not reached]


def reached_by(found: Iterable[Cell], scene: str) -> str | None:
    """The method that reaches 1e-6 rad on the scene in the least time; None where none does."""
    able = [cell for cell in found if cell.scene == scene and cell.status == "ok" and cell.reaches_target]
    return min(able, key=lambda cell: cell.run_time_s).method if able else None


@dataclass(frozen=True)
class Advice:
    """use, avoid: families of scenes; holds: scenes on which the method holds, of all it ran."""

    method: str
    holds: int
    of: int
    use: tuple[str, ...]
    with_smaller_step: tuple[str, ...]
    avoid: tuple[str, ...]
    false_successes: int


def advice(found: Sequence[Cell]) -> list[Advice]:
    """Per method, by family: use where nine tenths hold, avoid where fewer than half do even with a smaller step."""
    return [
        _advice(method, [c for c in found if c.method == method]) for method in dict.fromkeys(c.method for c in found)
    ]


def _advice(method: str, own: Sequence[Cell]) -> Advice:
    use, smaller, avoid = [], [], []
    for family in dict.fromkeys(cell.family for cell in own):
        inside = [cell for cell in own if cell.family == family and cell.outcome != "refuses"]
        if not inside:
            continue
        holds = sum(cell.outcome == "holds" for cell in inside) / len(inside)
        with_step = sum(cell.outcome in ("holds", "smaller_step") for cell in inside) / len(inside)
        if holds >= 0.9:
            use.append(family)
        elif with_step >= 0.5:
            smaller.append(family)
        else:
            avoid.append(family)
    held = sum(cell.outcome == "holds" for cell in own)
    claimed = sum(cell.false_success for cell in own)
    return Advice(method, held, len(own), tuple(use), tuple(smaller), tuple(avoid), claimed)


def summary_lines(found: Sequence[Cell]) -> list[str]:
    """The advice in plain words, a line per method."""
    return [in_words(one) for one in advice(found)]


def in_words(one: Advice) -> str:
    parts = [f"{one.method}: holds on {one.holds} of {one.of}"]
    if one.use:
        parts.append(f"use for {_listed(one.use)}")
    if one.with_smaller_step:
        parts.append(f"with a smaller step or not everywhere for {_listed(one.with_smaller_step)}")
    if one.avoid:
        parts.append(f"do not use for {_listed(one.avoid)}")
    if one.false_successes:
        parts.append(f"its engine claimed success {one.false_successes} times where the state says otherwise")
    return "; ".join(parts)


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else names[0]


def is_number(value: float | None) -> bool:
    return value is not None and math.isfinite(value)
