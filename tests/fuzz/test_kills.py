"""Commands and their workers, ended by a signal at random moments: nothing lost, nothing left
behind.

The long form (200 signals over all commands below, about 25 minutes): `pytest -m nightly
tests/fuzz/test_kills.py`.
"""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import time
import uuid
from contextlib import suppress
from pathlib import Path

import pytest
from support.commands import PROGRAM
from support.fuzzing import contents, write
from support.scenes import paper
from support.sweeps import stored_runs

from rotor_mbs.scenario.scene import scene_toml

pytestmark = [
    pytest.mark.full,
    pytest.mark.skipif(not Path("/proc/self/environ").is_file(), reason="needs /proc"),
]

SWEEP = (
    'title = "s"\nscene = "a.toml"\n[[axis]]\nkey = "initial.angles[1]"\nlinear = {start = 0, end '
    "= 0.1, count = 100}\n"
)
# A limit that no run of a loaded machine reaches.
METHODS, LIMIT = "-m lagrange/dop853 -m exudyn_tree/rk67", "--timeout 1000"
# The output stands last; `check` has none.
COMMANDS = {
    "run": f"run a.toml b.toml {METHODS} {LIMIT} -j 2 -o run.h5",
    "sweep": f"sweep s.toml {LIMIT} -j 2 -o sweep.h5",
    "reproduce": f"reproduce {LIMIT} -j 2 -o reproduce",
    "bench": "bench a.toml -m lagrange/dop853 --budget 1 -o bench.h5",
    "report": "report whole.h5 -o report",
    "reference": f"reference a.toml {LIMIT} -j 1 -o reference.h5",
    "modes": "modes a.toml -j 1 -o modes.h5",
    "check": "check whole.h5",
}
# Every second signal hits one of these, which compute.
COMPUTING = ("run", "sweep", "reproduce", "bench")
OUTPUTS = {name: command.split()[-1] for name, command in COMMANDS.items() if name != "check"}
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGINT)
LATEST_SIGNAL_S = {name: 40.0 if name == "reproduce" else 6.0 for name in COMMANDS}
END_OF_WORKERS_S = 8.0


def prepare(folder: Path) -> None:
    folder.mkdir()
    for name, duration in (("a", 1.0), ("b", 2.0)):
        write(folder / f"{name}.toml", scene_toml(paper("fig11", samples=101, duration=duration)))
    write(folder / "s.toml", SWEEP)
    finish(folder, f"run a.toml {METHODS} {LIMIT} -o whole.h5")


def finish(folder: Path, command: str) -> None:
    done = subprocess.run(
        [*PROGRAM, *command.split()], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-500:]


def processes_of(mark: str) -> dict[int, str]:
    """Command line by number of the processes that have this mark in their environment: started by
    one another."""
    found = {}
    for place in Path("/proc").glob("[0-9]*"):
        try:
            is_marked = f"ROTOR_MBS_FUZZ={mark}".encode() in (place / "environ").read_bytes().split(
                b"\0"
            )
            state = (place / "stat").read_text().rpartition(")")[2].split()[0]
            if is_marked and state != "Z":
                found[int(place.name)] = (place / "cmdline").read_text().replace("\0", " ")
        except OSError:
            continue
    return found


def end_once(folder: Path, name: str, chance: random.Random) -> bool:
    """The command, ended by a signal at a random moment, and what must hold then; whether it has
    done all.

    Every fourth signal is a kill of one of its workers: the command then ends by itself, with 1 and
    a line on what is not computed where that worker had taken a task.
    """
    before, stored = temporaries(folder), stored_runs(folder / OUTPUTS["sweep"])
    mark, number = uuid.UUID(int=chance.getrandbits(128)).hex, chance.choice(SIGNALS)
    hits_worker = chance.random() < 0.25
    with (folder / "log").open("wb") as log:
        process = subprocess.Popen(
            [*PROGRAM, *COMMANDS[name].split()],
            cwd=folder,
            env=os.environ | {"ROTOR_MBS_FUZZ": mark},
            stdout=log,
            stderr=log,
            start_new_session=True,
        )
    hit = False
    try:
        process.wait(chance.uniform(0.05, LATEST_SIGNAL_S[name]))
    except subprocess.TimeoutExpired:
        workers = sorted(
            number for number, line in processes_of(mark).items() if "import serve" in line
        )
        if not hits_worker:
            process.send_signal(number)
        elif workers:
            with suppress(ProcessLookupError):  # it ended meanwhile
                os.kill(chance.choice(workers), signal.SIGKILL)
                hit = True
    status, printed = process.wait(300.0), (folder / "log").read_text()
    # 130 in order; -number before Python has started, and always for SIGKILL. `python -m` itself
    # makes an end by SIGINT of a 130 where the interrupt passed through generated code (a dataclass
    # that is loaded): 130 for a shell.
    allowed = (0, 1) if hit else (0,) if hits_worker else (0, 130, -signal.SIGINT, -number)
    assert status in allowed, (name, number, hit, status, printed[-500:])
    assert "Traceback" not in printed or status < 0, (name, number, hit, printed[-2000:])
    deadline = time.monotonic() + END_OF_WORKERS_S
    while (left := processes_of(mark)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not left, (name, number, left)
    assert stored_runs(folder / OUTPUTS["sweep"]) >= stored, "finished runs were lost"
    if number != signal.SIGKILL:
        # those of killed processes stay until the next call
        assert temporaries(folder) <= before, (name, number)
    known = ("a.", "b.", "s.", "log", "whole.", *(Path(output).stem for output in OUTPUTS.values()))
    unknown = [
        path.name for path in folder.iterdir() if not path.name.lstrip(".").startswith(known)
    ]
    assert not unknown, (name, number, unknown)
    return status == 0


def temporaries(folder: Path) -> set[str]:
    return {path.name for path in folder.glob(".*.tmp")}


def assert_same(name: str, disturbed: Path, undisturbed: Path) -> None:
    """The outputs of a command that was disturbed many times and of one that was not."""
    if name == "sweep":
        assert (undisturbed / OUTPUTS[name]).read_bytes() == (
            disturbed / OUTPUTS[name]
        ).read_bytes()
    elif name in COMPUTING and name != "bench":  # whose numbers are times
        file = OUTPUTS[name] if name == "run" else f"{OUTPUTS[name]}/results.h5"
        assert contents(disturbed / file) == contents(undisturbed / file) != {}


@pytest.mark.parametrize(
    ("names", "signals"),
    [(("run", "sweep"), 4), pytest.param(tuple(COMMANDS), 200, marks=pytest.mark.nightly)],
    ids=["short", "long"],
)
def test_nothing_is_lost_and_nothing_is_left(
    tmp_path: Path, names: tuple[str, ...], signals: int
) -> None:
    disturbed, undisturbed = tmp_path / "disturbed", tmp_path / "undisturbed"
    prepare(disturbed)
    prepare(undisturbed)
    for name in names:
        finish(undisturbed, COMMANDS[name])
    computing = [name for name in names if name in COMPUTING]
    for seed in range(signals):
        order = computing if seed % 2 else names
        name = order[seed // 2 % len(order)]
        print(seed, name, flush=True)  # shown where it fails
        if end_once(disturbed, name, random.Random(seed)) and name in OUTPUTS:
            assert_same(name, disturbed, undisturbed)
            output = disturbed / OUTPUTS[name]
            if output.is_dir():
                shutil.rmtree(output)
            else:
                output.unlink()
    for name in names:
        finish(disturbed, COMMANDS[name])
        assert_same(name, disturbed, undisturbed)
    assert not [
        path.name
        for path in disturbed.iterdir()
        if path.name.endswith((".tmp", ".lock", ".full.h5"))
    ]
