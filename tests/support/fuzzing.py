"""Seeded random scene files, and what a command may answer to them."""

from __future__ import annotations

import random
import re
import traceback
from collections import Counter
from collections.abc import Callable, Collection, Iterable
from dataclasses import replace
from pathlib import Path

import rotor_mbs as rm
from rotor_mbs.errors import RotorError
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import OUTPUTS, scene_toml
from support.commands import rotor_mbs

SCENES = (
    "check/general",
    "check/pitch-loads",
    "check/point-masses",
    "extreme/toy",
    "extreme/tumbling",
    "paper/fig04b",
    "paper/fig11",
    "stiff/torque-steps",
    "turbine/pitch-step",
)
USUAL = (0.0, 0.1, 1.0, 2.5, 9.8, 1000.0)
# What a value may be replaced by.
ODD = (
    "nan", "inf", "-1", "1e400", '"pi"', '"1/0"', "true", "[]", "{}", '"\\u001b[2J"', "1979-05-27",
    '"' + "x" * 300 + '"',
)  # fmt: skip


def scene_text(seed: int) -> str:
    """A shipped scene, short, with a share of its numbers in other sizes; of every fourth one a
    line is damaged."""
    chance = random.Random(seed)
    scene = find_scenes([chance.choice(SCENES)])[0]
    outputs = tuple(chance.sample(OUTPUTS, chance.randint(1, len(OUTPUTS))))
    text = scene_toml(
        replace(scene, duration=0.1, samples=chance.choice([2, 3, 11]), outputs=outputs)
    )
    share, decades = chance.choice([0.02, 0.1, 0.5]), chance.choice([1.0, 1.0, 5.0, 30.0])

    def change(found: re.Match[str]) -> str:
        if chance.random() > share:
            return found[0]
        return repr(
            chance.choice([*USUAL, float(found[0]) * 10.0 ** chance.uniform(-decades, decades)])
        )

    lines = text.splitlines()
    for i, line in enumerate(lines):
        # numbers that depend on one another
        is_linked = line.startswith("inertia") or " = [[" in line
        if not is_linked or chance.random() < 0.1:
            lines[i] = re.sub(r"\b\d+\.\d+(e[+-]?\d+)?\b", change, line)
    text = "\n".join(lines) + "\n"
    return damaged_line(chance, text) if chance.random() < 0.25 else text


def damaged_line(chance: random.Random, text: str) -> str:
    """The text with one line gone, twice, cut, or with an odd value."""
    lines = text.splitlines()
    place = chance.randrange(len(lines))
    line, key = lines[place], lines[place].partition("=")[0]
    lines[place] = chance.choice(
        ["", f"{line}\n{line}", line[: len(line) // 2], f"{key}= {chance.choice(ODD)}"]
    )
    return "\n".join(lines) + "\n"


def try_all(seeds: Iterable[int], attempt: Callable[[int], Iterable[str]]) -> None:
    """Calls `attempt` with every seed. It returns outcomes, which are counted, or raises, which is
    a fault."""
    outcomes: Counter[str] = Counter()
    faults = []
    for seed in seeds:
        try:
            outcomes.update(attempt(seed))
        except Exception:
            faults.append(f"seed {seed}: {traceback.format_exc()[-900:]}")
    counted = ", ".join(f"{count} {outcome}" for outcome, count in outcomes.most_common())
    print(counted)
    assert not faults, "\n".join([f"{counted}, {len(faults)} failed", *faults[:20]])


def outcome(*words: object, allowed: Collection[int] = (0, 1, 2)) -> str:
    """The exit status of a command in this process, whose answer must be in order."""
    status, out, err = rotor_mbs(*words)
    assert status in allowed, err
    assert "Warning:" not in err
    assert "\x1b" not in err + out
    assert status != 2 or err.strip(), "status 2 without a reason"
    return f"{words[0]}: status {status}"


def outcome_of_call(call: Callable[[], str | None]) -> str:
    """What a call returns; or that it is refused, for a reason."""
    try:
        return call() or "done"
    except RotorError as refusal:
        if not str(refusal):
            raise ValueError("refused without a reason") from refusal
        return "refused"


def contents(path: Path) -> dict[object, tuple[object, ...]]:
    """By run: status, message, angles, rates and metrics but times."""
    found: dict[object, tuple[object, ...]] = {}
    for label, run in rm.open(path).items():
        metrics = {
            name: value
            for name, value in run.metrics.items()
            if not name.endswith(("_s", "repeats"))
        }
        found[label] = (
            run.status,
            run.message,
            run.angles.tobytes(),
            run.rates.tobytes(),
            repr(metrics),
        )
    return found


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path
