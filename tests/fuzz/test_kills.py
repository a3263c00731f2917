"""Commands ended by a signal at random moments: nothing lost, no process and no temporary file left behind.

The long form (300 signals over all commands below): `pytest -m nightly tests/fuzz/test_kills.py`.
"""

from __future__ import annotations

import os
import random
import re
import signal
import subprocess
import time
import uuid
from pathlib import Path

import h5py
import numpy as np
import pytest
from support.commands import PROGRAM
from support.fuzzing import write
from support.scenes import paper

from rotor_mbs.scenario.scene_file import scene_toml

pytestmark = [
    pytest.mark.full,
    pytest.mark.skipif(not Path("/proc/self/environ").is_file(), reason="needs /proc"),
]

SWEEP = (
    'title = "s"\nscene = "a.toml"\n[[axis]]\nkey = "initial.angles[1]"\nlinear = {start = 0, end = 0.1, count = 300}\n'
)
METHODS = "-m lagrange/dop853 -m exudyn_tree/rk67"
# The output stands last; `check` has none.
COMMANDS = {
    "run": f"run a.toml b.toml {METHODS} -j 2 -o run.h5",
    "sweep": "sweep s.toml -j 2 -o sweep.h5",
    "report": "report whole.h5 -o report",
    "reference": "reference a.toml -j 1 -o reference.h5",
    "modes": "modes a.toml -j 1 -o modes.h5",
    "bench": "bench a.toml -m lagrange/dop853 --budget 1 -o bench.h5",
    "check": "check whole.h5",
}
OUTPUTS = [command.split()[-1] for name, command in COMMANDS.items() if name != "check"]
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGINT)
LATEST_SIGNAL_S = 6.0
END_OF_WORKERS_S = 8.0


def prepare(folder: Path) -> None:
    folder.mkdir()
    for name, duration in (("a", 1.0), ("b", 2.0)):
        write(folder / f"{name}.toml", scene_toml(paper("fig11", samples=101, duration=duration)))
    write(folder / "s.toml", SWEEP)
    finish(folder, f"run a.toml {METHODS} -o whole.h5")


def finish(folder: Path, command: str) -> None:
    done = subprocess.run([*PROGRAM, *command.split()], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-500:]


def alive(mark: str) -> list[str]:
    """Command lines of the processes that have this mark in their environment: started by one another."""
    lines = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            is_marked = f"ROTOR_MBS_FUZZ={mark}".encode() in (place / "environ").read_bytes().split(b"\0")
            state = (place / "stat").read_text().rpartition(")")[2].split()[0]
            if is_marked and state != "Z":
                lines.append((place / "cmdline").read_text().replace("\0", " "))
        except OSError:
            continue
    return lines


def end_once(folder: Path, name: str, chance: random.Random) -> None:
    """The command, ended by a signal at a random moment, and what must hold then."""
    before = temporaries(folder)
    mark, number = uuid.UUID(int=chance.getrandbits(128)).hex, chance.choice(SIGNALS)
    with (folder / "log").open("wb") as log:
        process = subprocess.Popen(
            [*PROGRAM, *COMMANDS[name].split()], cwd=folder, env=os.environ | {"ROTOR_MBS_FUZZ": mark},
            stdout=log, stderr=log, start_new_session=True,
        )  # fmt: skip
    try:
        process.wait(chance.uniform(0.05, LATEST_SIGNAL_S))
    except subprocess.TimeoutExpired:
        process.send_signal(number)
    status, printed = process.wait(120.0), (folder / "log").read_text()
    # 130 in order; -number before Python has started, and always for SIGKILL. `python -m` itself makes an end by SIGINT
    # of a 130 where the interrupt passed through generated code (a dataclass that is loaded): 130 for a shell.
    assert status in (0, 130, -signal.SIGINT, -number), (name, number, status, printed[-500:])
    assert "Traceback" not in printed or status < 0
    deadline = time.monotonic() + END_OF_WORKERS_S
    while (left := alive(mark)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not left, (name, number, left)
    if number != signal.SIGKILL:
        assert temporaries(folder) <= before, (name, number)  # those of killed processes stay until the next call
    unknown = [path.name for path in folder.iterdir() if not is_known(path.name)]
    assert not unknown, (name, number, unknown)


def temporaries(folder: Path) -> set[str]:
    return {path.name for path in folder.glob(".*.tmp")}


def is_known(name: str) -> bool:
    """Inputs, outputs with their pages and digests, and what stays until the next call of the same command."""
    outputs = "|".join(map(re.escape, OUTPUTS))
    stems = "|".join(re.escape(Path(output).stem) for output in OUTPUTS)
    known = (
        rf"[abs]\.toml|whole\.h5|log|({outputs})(\.full\.h5)?|({stems})(-report|\.sha256)|\..*\.([0-9]+\.tmp|lock)"
    )
    return bool(re.fullmatch(known, name))


def samples(path: Path) -> dict[str, bytes]:
    """The samples of every run of a results file, by the path of the array."""
    arrays = {}

    def collect(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and name.rpartition("/")[2] in ("time", "angles", "rates", "tip"):
            arrays[name] = np.asarray(item).tobytes()

    with h5py.File(path) as file:
        file.visititems(collect)
    return arrays


@pytest.mark.parametrize(
    ("names", "kills"),
    [(("run",), 2), pytest.param(tuple(COMMANDS), 300, marks=pytest.mark.nightly)],
    ids=["short", "long"],
)
def test_nothing_is_lost_and_nothing_is_left(tmp_path: Path, names: tuple[str, ...], kills: int) -> None:
    disturbed, undisturbed = tmp_path / "disturbed", tmp_path / "undisturbed"
    prepare(disturbed)
    prepare(undisturbed)
    for seed in range(kills):
        end_once(disturbed, names[seed % len(names)], random.Random(seed))
    for name in names:
        finish(disturbed, COMMANDS[name])
        finish(undisturbed, COMMANDS[name])
    assert not [path.name for path in disturbed.iterdir() if path.name.endswith((".tmp", ".lock", ".full.h5"))]
    if "run" in names:
        assert samples(disturbed / "run.h5") == samples(undisturbed / "run.h5") != {}
    if "sweep" in names:
        assert (undisturbed / "sweep.h5").read_bytes() == (disturbed / "sweep.h5").read_bytes()
