"""Files with one bit flipped, and what reads them; a process of its own goes through them, which a file may end.

python -m support.flips FILE FOLDER FIRST COUNT     # made by `prepare`; prints "seed N", then its outcome
"""

from __future__ import annotations

import faulthandler
import os
import random
import subprocess
import sys
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import rotor_mbs as rm
from rotor_mbs.errors import InputError, RotorError
from rotor_mbs.foreign import files as foreign
from rotor_mbs.scenario.scene import scene_toml
from rotor_mbs.scenario.sweep import load_sweep
from rotor_mbs.studies.run import run_scenes
from support.commands import PROGRAM, rotor_mbs
from support.data_files import FORMATS
from support.fuzzing import write
from support.scenes import paper
from support.sweeps import run_local

METHOD = "lagrange/dop853"
SWEEP = f'title = "s"\nscene = "a.toml"\nmethods = ["{METHOD}"]\n[[axis]]\nkey = "gravity"\nvalues = [9.7, 9.8]\n'
OWN = ("results.h5", "sweep.h5")
FOREIGN = ("data.mat", "data73.mat", "data.nc", "data3.nc", "data.npz", "data.outb")
_EDGE = 8192  # bytes at both ends: most of a large file is arrays, descriptions are at its beginning and its end
_LIMIT_S = 120.0  # for one file


def prepare(folder: Path) -> None:
    scene = paper("fig11", samples=11, duration=0.1)
    write(folder / "a.toml", scene_toml(scene))
    write(folder / "s.toml", SWEEP)
    _resume(folder, folder / "results.h5")
    _resume(folder, folder / "sweep.h5")
    run = rm.run(scene, METHOD)
    for name in FOREIGN:
        FORMATS[name](folder / name, scene, run.time, run.angles, run.rates)


def flipped(content: bytes, seed: int) -> bytes:
    chance = random.Random(seed)
    found, edge = bytearray(content), min(_EDGE, len(content))
    at = chance.choice([chance.randrange(len(found)), chance.randrange(edge), len(found) - 1 - chance.randrange(edge)])
    found[at] ^= 1 << chance.randrange(8)
    return bytes(found)


def faults_of_flips(name: str, folder: Path, first: int, count: int) -> tuple[Counter[str], list[str]]:
    """How often each outcome was, and what was not in order: an exception, a wrong value, the end of a process."""
    outcomes: Counter[str] = Counter()
    faults: list[str] = []
    seed, end = first, first + count
    while seed < end:
        command = [sys.executable, "-m", "support.flips", name, str(folder), str(seed), str(end - seed)]
        places = os.pathsep.join(str(Path(place).absolute()) for place in sys.path)
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, env=os.environ | {"PYTHONPATH": places}
        )
        lines = done.stdout.splitlines()
        outcomes.update(line for line in lines if not line.startswith(("seed", "fault")))
        faults += [line for line in lines if line.startswith("fault")]
        if done.returncode == 0:
            break
        seed = int(lines[-1].removeprefix("seed "))
        outcomes["process ended"] += 1
        if name in OWN:
            faults.append(f"seed {seed}: exit code {done.returncode}: {done.stderr[-1500:]}")
        else:
            faults += _faults_of_command(folder, name, seed)
        seed += 1
    return outcomes, faults


def _faults_of_command(folder: Path, name: str, seed: int) -> list[str]:
    """A reader in this process has ended it: the command, whose reader is a process of its own, must tell it."""
    broken = folder / f"broken-{name}"
    broken.write_bytes(flipped((folder / name).read_bytes(), seed))
    command = [*PROGRAM, "compare", str(broken), "--scene", str(folder / "a.toml"), "-o", str(folder / "pages")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode == 2 and len(done.stderr.splitlines()) == 1:
        return []
    return [f"seed {seed}: status {done.returncode}: {done.stderr[-500:]}"]


def _resume(folder: Path, path: Path) -> None:
    """What `run` and `sweep` do with a file that is there."""
    if path.name.endswith("sweep.h5"):
        run_local(load_sweep(folder / "s.toml"), path, 0)
    else:
        run_scenes([rm.load(folder / "a.toml")], {"a": [METHOD]}, path, workers=0, timeout_s=60.0)


def _contents(path: Path) -> dict[object, tuple[object, ...]]:
    """By run; metrics but times and what is known of steps."""
    return {
        label: (run.status, run.message, run.time.tobytes(), run.angles.tobytes(), run.rates.tobytes())
        for label, run in rm.open(path).items()
    }


def _outcome(call: Callable[[], object]) -> str:
    try:
        call()
    except RotorError as exc:
        return "refused" if str(exc) else "fault: refused without a reason"
    return "read"


def _try_own(folder: Path, broken: Path, whole: dict[object, tuple[object, ...]], seed: int) -> None:
    """Opened, checked, reported and continued."""

    def opened() -> None:
        found = _contents(broken)
        wrong = [label for label in found if found[label] != whole.get(label)]
        if wrong:
            print(f"fault: seed {seed}: wrong values are read of {wrong}")

    def resumed() -> None:
        _resume(folder, broken)
        if _contents(broken) != whole:
            print(f"fault: seed {seed}: wrong values are stored")

    print("opened:", _outcome(opened))
    _command(seed, "check", broken)
    if seed % 5 == 0:
        _command(seed, "report", broken, "-o", folder / "pages")
    print("continued:", _outcome(resumed))


def _command(seed: int, *words: object) -> None:
    ended = rotor_mbs(*words)
    print(f"{words[0]}: status {ended.status}")
    if ended.status not in (0, 1, 2) or (ended.status == 2 and not ended.err.strip()):
        print(f"fault: seed {seed}: {words[0]}: {ended}")


def _read_here(path: Path, group: str, scene: str) -> object:
    try:
        return foreign._binary_arrays(path, group, scene)
    except RotorError:
        raise
    except Exception as exc:  # as `write_arrays` does
        raise InputError(f"{path}: cannot be read: {exc}") from exc


def _go_through(name: str, folder: Path, first: int, count: int) -> None:
    warnings.simplefilter("error")
    content, broken = (folder / name).read_bytes(), folder / f"broken-{name}"
    whole = _contents(folder / name) if name in OWN else {}
    if name not in OWN:  # in this process, where it is quick
        vars(foreign)["_read_apart"] = _read_here
    for seed in range(first, first + count):
        print(f"seed {seed}", flush=True)
        broken.write_bytes(flipped(content, seed))
        faulthandler.dump_traceback_later(_LIMIT_S, exit=True)
        try:
            if name in OWN:
                _try_own(folder, broken, whole, seed)
            else:
                _command(seed, "compare", broken, "--scene", folder / "a.toml", "-o", folder / "pages")
        except BaseException:
            print(f"fault: seed {seed}: {traceback.format_exc()[-900:]!r}")
        faulthandler.cancel_dump_traceback_later()


if __name__ == "__main__":
    _go_through(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]))
