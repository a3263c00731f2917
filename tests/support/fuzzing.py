"""Seeded random scene files and sweep files, and what a command may answer to them."""

from __future__ import annotations

import random
import traceback
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Sequence
from pathlib import Path

from rotor_mbs.errors import RotorError
from rotor_mbs.scenario.scene import OUTPUTS
from support.commands import rotor_mbs

# Where a number is drawn from: usual ones, ones of the usual size, and whatever the schema takes.
_USUAL = (0.0, 0.1, 1.0, 2.5, 9.8, 1000.0)
# What a text or a value may be replaced by.
_ODD = (
    "nan", "inf", "-1", "1e400", '"pi"', '"1/0"', "true", "[]", "{}", '"\\u001b[2J"', "1979-05-27",
    '"' + "x" * 300 + '"',
)  # fmt: skip


class Numbers:
    """Numbers of a scene, of which a share may have any magnitude."""

    def __init__(self, random_: random.Random) -> None:
        self.random = random_
        self.extreme_share = random_.choice([0.0, 0.0, 0.03, 0.3])

    def __call__(self, *, positive: bool = False) -> str:
        draw = self.random.random()
        if draw < self.extreme_share:
            value = 10.0 ** self.random.uniform(-300.0, 300.0)
        elif draw < 0.6:
            value = self.random.choice(_USUAL)
        else:
            value = 10.0 ** self.random.uniform(-4.0, 5.0)
        if positive:
            return repr(value or 1.0)
        return repr(-value if self.random.random() < 0.3 else value)

    def size(self) -> str:
        return self().lstrip("-")

    def several(self, count: int) -> str:
        return f"[{', '.join(self() for _ in range(count))}]"


def scene_text(seed: int) -> str:
    """A scene file: every fourth one has a line that is not allowed, the others are valid one number by one."""
    chance = random.Random(seed)
    number, blades = Numbers(chance), chance.choice([1, 2, 3, 3, 5])
    outputs = chance.sample(OUTPUTS, chance.randint(1, len(OUTPUTS)))
    lines = ['title = "fuzz"', f"blades = {blades}", f"gravity = {number.size()}"]
    lines += [f"duration = {number(positive=True)}", f"samples = {chance.choice([2, 3, 11])}"]
    lines.append(f"outputs = {outputs}".replace("'", '"'))
    for _ in range(blades if chance.random() < 0.3 else 1):
        lines += ["[[blade]]", f"mass = {number(positive=True)}", f"centre_of_mass = {number.several(3)}"]
        if chance.random() < 0.4:
            small, large = sorted(float(number(positive=True)) for _ in range(2))
            lines.append(f"inertia = [{large!r}, {large!r}, {small!r}, 0, 0, 0]")
        lines.append(f"tip = {number.several(3)}")
    if lines.count("[[blade]]") != blades:
        lines = ["[blade]" if line == "[[blade]]" else line for line in lines]
    rates = ", ".join(number() if chance.random() < 0.3 else "0" for _ in range(1 + blades))
    lines += ["[initial]", f"angles = {number.several(1 + blades)}", f"rates = [{rates}]"]
    if chance.random() < 0.4:
        lines += ["[hub]", f"inertia = {number.size()}"]
    if chance.random() < 0.4:
        lines += ["[bearing]", f"stiffness = {number.size()}", f"damping = {number.size()}"]
    if chance.random() < 0.3:
        lines += ["[shaft]", f"damping = {number.size()}"]
    if chance.random() < 0.4:
        times = sorted(abs(float(number())) for _ in range(3))
        table = ", ".join(f"[{time!r}, {number()}]" for time in times)
        lines += ["[torque]", f"rotor = {chance.choice([number(), f'[{table}]'])}"]
    return _damaged_line(chance, lines) if chance.random() < 0.25 else "\n".join(lines) + "\n"


def sweep_text(seed: int, scene: str) -> str:
    """A sweep of a few runs of `scene`."""
    chance = random.Random(seed)
    number = Numbers(chance)
    keys = [
        "gravity", "blade.mass", "blade.centre_of_mass[0]", "blade.inertia[2]", "hub.inertia", "initial.angles[0]",
        "initial.angles[1]", "initial.angles[9]", "initial.rates[0]", "bearing.stiffness", "torque.rotor", "no.such",
    ]  # fmt: skip
    lines = ['title = "fuzz"', f'scene = "{scene}"', f"samples = {chance.choice([2, 5, 11])}"]
    lines.append(f"outputs = {chance.sample(OUTPUTS, chance.randint(0, 3))}".replace("'", '"'))
    lines.append(f'methods = ["{chance.choice(["lagrange/taylor", "lagrange/dop853", "exudyn_tree/rk44"])}"]')
    kinds = [chance.choice(["values", "linear", "log", "uniform", "sobol"]) for _ in range(chance.randint(1, 2))]
    if {"uniform", "sobol"} & set(kinds):
        lines.append(f"draws = {chance.randint(1, 4)}")
    for kind, key in zip(kinds, chance.sample(keys, len(kinds)), strict=True):
        low, high = sorted(float(number.size()) for _ in range(2))
        given = {
            "values": number.several(chance.randint(1, 3)),
            "linear": f"{{start = {low!r}, end = {high!r}, count = {chance.randint(2, 4)}}}",
            "log": f"{{start = {low!r}, end = {high!r}, count = {chance.randint(2, 4)}}}",
        }
        lines += ["[[axis]]", f'key = "{key}"', f"{kind} = {given.get(kind, f'[{low!r}, {high!r}]')}"]
    return _damaged_line(chance, lines) if chance.random() < 0.25 else "\n".join(lines) + "\n"


def _damaged_line(chance: random.Random, lines: Sequence[str]) -> str:
    """The text with one line gone, twice, cut, or with an odd value."""
    place = chance.randrange(len(lines))
    line, found = lines[place], list(lines)
    key = line.partition("=")[0]
    found[place] = chance.choice(["", f"{line}\n{line}", line[: len(line) // 2], f"{key}= {chance.choice(_ODD)}"])
    return "\n".join(found) + "\n"


def try_all(seeds: Iterable[int], attempt: Callable[[int], Iterable[str]]) -> None:
    """Calls `attempt` with every seed. It returns outcomes, which are counted, or raises, which is a fault."""
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


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path
