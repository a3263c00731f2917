"""Damaged files, this program's and others, and random scenes: a verdict or a line, never a crash,
a hang or a wrong value. The long form (1,000 files, 10,000 scenes): `pytest -m nightly
tests/fuzz/test_inputs.py`."""

from __future__ import annotations

import csv
import json
import random
import re
import warnings
from functools import partial
from pathlib import Path

import pytest
from support.data_files import FORMATS
from support.fuzzing import contents, outcome, outcome_of_call, scene_text, try_all, write
from support.scenes import paper
from support.sweeps import run_local

import rotor_mbs as rm
from rotor_mbs.comparison.data import data_of_table, load_data
from rotor_mbs.comparison.formats import read_columns
from rotor_mbs.errors import RotorError
from rotor_mbs.processes.pool import WorkerPool
from rotor_mbs.scenario.scene import parse_scene, scene_toml
from rotor_mbs.scenario.sweep import load_sweep
from rotor_mbs.studies.run import run_scenes

METHOD = "lagrange/dop853"
SWEEP = (
    f'title = "s"\nscene = "a.toml"\nmethods = ["{METHOD}"]\n[[axis]]\nkey = '
    '"gravity"\nvalues = [9.7, 9.8]\n'
)
OWN = ("results.h5", "sweep.h5")
FOREIGN = tuple(FORMATS)
# What a word of a text file may be replaced by: not numbers, numbers that are hard to hold, names
# with odd indices.
ODD_WORDS = (
    "nan",
    "-inf",
    "1e999",
    "1e308",
    "5e-324",
    "-1e308",
    "",
    "x",
    "1" * 5000,
    "0x10",
    "1_000",
    "12:00",
    "****",
    "0.12-101",
    '"',
    "'",
    "[",
    "{",
    "[1, 2]",
    "null",
    "true",
    ",",
    ";",
    "\t",
    "\n",
    "\x00",
    "\u2028",
    "é",
    "time",
    "t / s",
    "speed",
    "f1",
    "f" + "9" * 5000,
    "q[0]",
    "q[,]",
    "q[9]",
    "q[0,1]",
    "rotor [deg]",
    "rotor [",
    "RootMxb1",
)
# bytes at both ends: most of a large file is arrays, descriptions are at its beginning and its end
_EDGE = 8192
_LIMIT_S = 120.0  # for one file


def damaged(content: bytes, seed: int) -> bytes:
    """With one bit flipped; of some files eight, or a piece overwritten, or the rest cut off."""
    chance, changed = random.Random(seed), bytearray(content)
    edge = min(_EDGE, len(changed))
    place = chance.choice(
        [
            chance.randrange(len(changed)),
            chance.randrange(edge),
            len(changed) - 1 - chance.randrange(edge),
        ]
    )
    kind = chance.choice(["bit", "bit", "bit", "bit", "bits", "piece", "cut"])
    if kind == "cut":
        return content[:place]
    if kind == "piece":
        size = len(changed[place : place + 64])
        changed[place : place + size] = chance.randbytes(size)
        return bytes(changed)
    others = [chance.randrange(edge) for _ in range(7)] if kind == "bits" else []
    for at in (place, *others):
        changed[at] ^= 1 << chance.randrange(8)
    return bytes(changed)


def edited(text: str, seed: int) -> str:
    """With some words replaced by odd ones; of some files also the first line gone, twice, or
    joined with the next."""
    chance = random.Random(seed)
    words = re.split(r"([ ,\t\n:\[\]{}]+)", text)
    near_head = min(40, len(words))
    for _ in range(chance.choice([1, 1, 3])):
        words[chance.randrange(chance.choice([near_head, len(words)]))] = chance.choice(ODD_WORDS)
    changed = "".join(words)
    first, _, rest = changed.partition("\n")
    return chance.choice([changed] * 7 + [rest, f"{first}\n{changed}", first + rest])


def resume(folder: Path, path: Path) -> None:
    """What `run` and `sweep` do with a file that is there."""
    if "sweep" in path.name:
        run_local(load_sweep(folder / "s.toml"), path, 0)
    else:
        run_scenes([rm.load(folder / "a.toml")], {"a": [METHOD]}, path, workers=0, timeout_s=60.0)


def use_damaged(folder: Path, name: str, seed: int) -> list[str]:
    """Opens, checks, reports and continues a damaged file of this program; returns the outcomes."""
    warnings.simplefilter("error")
    whole, broken = contents(folder / name), folder / f"broken-{name}"
    broken.write_bytes(damaged((folder / name).read_bytes(), seed))

    def read() -> None:
        wrong = [label for label, values in contents(broken).items() if values != whole.get(label)]
        assert not wrong, f"wrong values are read of {wrong}"

    def continue_it() -> None:
        resume(folder, broken)
        assert contents(broken) == whole, "wrong values are stored"

    outcomes = [f"opened: {outcome_of_call(read)}", outcome("check", broken, "-j", "1")]
    if seed % 5 == 0:
        outcomes.append(outcome("report", broken, "-o", folder / "pages", "-j", "1"))
    return [*outcomes, f"continued: {outcome_of_call(continue_it)}"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("flips")
    scene = paper("fig11", samples=11, duration=0.1)
    write(folder / "a.toml", scene_toml(scene))
    write(folder / "s.toml", SWEEP)
    for name in OWN:
        resume(folder, folder / name)
    run = rm.run(scene, METHOD)
    for name in FOREIGN:
        FORMATS[name](folder / name, scene, run.time, run.angles, run.rates)
    rows = [
        {"time": t, "q": q.tolist()} for t, q in zip(run.time.tolist(), run.angles, strict=True)
    ]
    write(folder / "rows.jsonl", "\n".join(map(json.dumps, rows)))
    vectors = [f"{row['time']},{' '.join(map(repr, row['q']))}" for row in rows]
    write(
        folder / "vectors.csv",
        "\n".join(["time,q", *vectors, "This file was closed on 19-Oct-2018."]),
    )
    return folder


COUNTS = pytest.mark.parametrize(
    "count", [pytest.param(5, marks=pytest.mark.full), pytest.param(125, marks=pytest.mark.nightly)]
)


@COUNTS
@pytest.mark.parametrize("name", OWN)
def test_a_damaged_file_of_this_program(name: str, count: int, folder: Path) -> None:
    """In a process of its own, which a file may end."""
    with WorkerPool(1) as pool:
        use = partial(use_damaged, folder, name)
        try_all(range(count), lambda seed: pool.submit(use, seed, _LIMIT_S).result())


@COUNTS
@pytest.mark.parametrize("name", FOREIGN)
def test_a_damaged_file_of_another_program(name: str, count: int, folder: Path) -> None:
    def compare(seed: int) -> list[str]:
        broken = folder / f"broken-{name}"
        broken.write_bytes(damaged((folder / name).read_bytes(), seed))
        return [outcome("compare", broken, "--scene", folder / "a.toml", "-o", folder / "pages")]

    try_all(range(count), compare)


@pytest.mark.parametrize("count", [1, pytest.param(100, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("name", FOREIGN)
def test_a_damaged_file_of_another_program_is_data_or_one_line(
    name: str, count: int, folder: Path
) -> None:
    """As far as its channels: without the comparison."""
    scene, broken = paper("fig11"), folder / f"broken-{name}"

    def load(seed: int) -> list[str]:
        broken.write_bytes(damaged((folder / name).read_bytes(), seed))
        return [outcome_of_call(lambda: str(load_data(broken, scene).is_modes))]

    try_all(range(count), load)


@pytest.mark.parametrize("count", [150, pytest.param(10_000, marks=pytest.mark.nightly)])
@pytest.mark.parametrize(
    "name",
    ["data.csv", "data.txt", "sensor.txt", "data.out", "data.json", "rows.jsonl", "vectors.csv"],
)
def test_edited_text_of_another_program_is_data_or_refused(
    name: str, count: int, folder: Path
) -> None:
    """Read in this process: what is raised there is one line of the reading process
    (tests/comparison)."""
    scene, broken = paper("fig11"), folder / f"edited-{name}"
    text = (folder / name).read_text()

    def load(seed: int) -> list[str]:
        broken.write_text(edited(text, seed), encoding="utf-8")
        try:
            table = read_columns(broken, "", "")
        except (
            RotorError,
            ValueError,
            TypeError,
            AttributeError,
            csv.Error,
            RecursionError,
        ) as refusal:
            return [f"refused: {type(refusal).__name__}"]
        return [outcome_of_call(lambda: str(data_of_table(table, scene).is_modes))]

    try_all(range(count), load)


# Random scenes

METHODS = (
    "lagrange/dop853",
    "lagrange/radau",
    "exudyn_tree/rk44",
    "exudyn_tree/dopri5",
    "printed/ode45",
    "mujoco/rk4",
)
METHODS += ("exudyn_chain/generalized_alpha", "lagrange/ode45")


@pytest.mark.parametrize(
    "count",
    [pytest.param(40, marks=pytest.mark.full), pytest.param(10_000, marks=pytest.mark.nightly)],
)
def test_random_scenes(tmp_path: Path, count: int) -> None:
    """Shown, and run by one method: nothing but a status, or a refusal with its reason."""

    def show_and_run(seed: int) -> list[str]:
        path = write(tmp_path / "scene.toml", scene_text(seed))
        shown = outcome("show", path, allowed=(0, 2))

        def run() -> str:
            scene = parse_scene(path.read_text(), "scene")
            run = rm.run(scene, METHODS[seed % len(METHODS)], timeout=0.2)
            # an exception of the code in place of a reason
            assert "Error: " not in run.message, run.message
            return run.status

        return [shown, outcome_of_call(run)]

    try_all(range(count), show_and_run)
