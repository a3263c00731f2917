"""Commands ended by a signal at random moments: nothing lost, no process and no temporary file left behind.

The long form (300 signals over all commands below): `pytest -m nightly tests/fuzz/test_kills.py`.
"""

from __future__ import annotations

import os
import random
import re
import signal
import subprocess
import sys
import time
import uuid
from pathlib import Path

import h5py
import numpy as np
import pytest
from support.fuzzing import write
from support.scenes import paper

from rotor_mbs.scenario.scene_file import scene_toml

pytestmark = [
    pytest.mark.full,
    pytest.mark.skipif(not Path("/proc/self/environ").is_file(), reason="needs /proc"),
]

_SWEEP = (
    'title = "s"\nscene = "a.toml"\n[[axis]]\nkey = "initial.angles[1]"\nlinear = {start = 0, end = 0.1, count = 300}\n'
)
_METHODS = ("-m", "lagrange/dop853", "-m", "exudyn_tree/rk67")
# Command and the output that it makes; "" for none.
COMMANDS = {
    "run": (["run", "a.toml", "b.toml", *_METHODS, "-j", "2", "-o", "run.h5"], "run.h5"),
    "sweep": (["sweep", "s.toml", "-j", "2", "-o", "sweep.h5"], "sweep.h5"),
    "report": (["report", "whole.h5", "-o", "report"], "report"),
    "reference": (["reference", "a.toml", "-j", "1", "-o", "reference.h5"], "reference.h5"),
    "modes": (["modes", "a.toml", "-j", "1", "-o", "modes.h5"], "modes.h5"),
    "bench": (["bench", "a.toml", "-m", "lagrange/dop853", "--budget", "1", "-o", "bench.h5"], "bench.h5"),
    "check": (["check", "whole.h5"], ""),
}
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGINT)
_LONGEST_S = 6.0  # after which a signal comes, at the latest
_GONE_S = 8.0  # in which every process must be gone


def _prepare(folder: Path) -> None:
    for name, duration in (("a", 1.0), ("b", 2.0)):
        scene = paper("fig11", samples=101, duration=duration)
        write(folder / f"{name}.toml", scene_toml(scene))
    write(folder / "s.toml", _SWEEP)
    _finish(folder, ["run", "a.toml", *_METHODS, "-o", "whole.h5"])


def _start(folder: Path, words: list[str], mark: str) -> subprocess.Popen[bytes]:
    environment = os.environ | {"ROTOR_MBS_FUZZ": mark}
    with (folder / "log").open("wb") as log:
        return subprocess.Popen(
            [sys.executable, "-m", "rotor_mbs", *words], cwd=folder, env=environment, stdout=log, stderr=log,
            start_new_session=True,
        )  # fmt: skip


def _finish(folder: Path, words: list[str]) -> None:
    done = subprocess.run([sys.executable, "-m", "rotor_mbs", *words], cwd=folder, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()[-500:]


def _alive(mark: str) -> list[str]:
    """Processes that were started, directly or not, with this mark in their environment."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            if f"ROTOR_MBS_FUZZ={mark}".encode() in (place / "environ").read_bytes().split(b"\0"):
                state = (place / "stat").read_text().rpartition(")")[2].split()[0]
                if state != "Z":
                    found.append((place / "cmdline").read_text().replace("\0", " "))
        except OSError:
            continue
    return found


def _kill_once(folder: Path, name: str, chance: random.Random) -> None:
    words, _ = COMMANDS[name]
    before = _temporaries(folder)
    mark, number = uuid.UUID(int=chance.getrandbits(128)).hex, chance.choice(SIGNALS)
    with _start(folder, words, mark) as process:
        try:
            process.wait(chance.uniform(0.05, _LONGEST_S))
        except subprocess.TimeoutExpired:
            process.send_signal(number)
        status = process.wait(120.0)
    # 130 in order; -number before Python has started, and always for SIGKILL. `python -m` itself makes an end by SIGINT
    # of a 130 where the interrupt passed through generated code (a dataclass that is loaded): 130 for a shell.
    assert status in (0, 130, -signal.SIGINT, -number), (name, number, status, (folder / "log").read_text()[-500:])
    assert "Traceback" not in (folder / "log").read_text() or status < 0
    end = time.monotonic() + _GONE_S
    while (left := _alive(mark)) and time.monotonic() < end:
        time.sleep(0.05)
    assert not left, (name, number, left)
    if number != signal.SIGKILL:
        assert _temporaries(folder) <= before, (name, number)  # those of killed processes stay until the next call
    foreign = [path.name for path in folder.iterdir() if not _is_known(path.name)]
    assert not foreign, (name, number, foreign)


def _temporaries(folder: Path) -> set[str]:
    return {path.name for path in folder.glob(".*.tmp")}


def _is_known(name: str) -> bool:
    given = ("a.toml", "b.toml", "s.toml", "whole.h5", "log")
    made = [output for _, output in COMMANDS.values() if output]
    pages = [f"{Path(one).stem}-report" for one in made]
    digests = [f"{Path(one).stem}.sha256" for one in made]
    # Finished parts stay until the next call of the same command.
    parts = any(re.fullmatch(rf"{re.escape(one)}(\.full\.h5)?(\.parts)?", name) for one in made)
    temporary = re.fullmatch(r"\..*\.[0-9]+\.tmp", name)  # of a killed process, until the next call
    return name in (*given, *made, *pages, *digests) or parts or bool(temporary)


def _same_arrays(one: Path, other: Path) -> bool:
    found: list[bool] = []
    with h5py.File(one) as left, h5py.File(other) as right:

        def compare(name: str, item: object) -> None:
            if isinstance(item, h5py.Dataset) and name.rpartition("/")[2] in ("time", "angles", "rates", "tip"):
                found.append(name in right and np.array_equal(item[()], right[name][()]))

        left.visititems(compare)
    return bool(found) and all(found)


@pytest.mark.parametrize(
    ("names", "kills"),
    [(("run",), 2), pytest.param(tuple(COMMANDS), 300, marks=pytest.mark.nightly)],
    ids=["short", "long"],
)
def test_nothing_is_lost_and_nothing_is_left(tmp_path: Path, names: tuple[str, ...], kills: int) -> None:
    disturbed, undisturbed = tmp_path / "disturbed", tmp_path / "undisturbed"
    for folder in (disturbed, undisturbed):
        folder.mkdir()
        _prepare(folder)
    for seed in range(kills):
        _kill_once(disturbed, names[seed % len(names)], random.Random(seed))
    for name in names:
        for folder in (disturbed, undisturbed):
            _finish(folder, COMMANDS[name][0])
    assert not [path.name for path in disturbed.iterdir() if path.name.endswith((".tmp", ".parts", ".full.h5"))]
    if "run" in names:
        assert _same_arrays(undisturbed / "run.h5", disturbed / "run.h5")
    if "sweep" in names:
        assert (undisturbed / "sweep.h5").read_bytes() == (disturbed / "sweep.h5").read_bytes()
