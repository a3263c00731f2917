"""Print how long commands and calls take beside their targets, and how times and memory grow.

    python benchmarks/speed.py [targets] [growth] [install]

Without words: targets and growth, some ten minutes. `install` clones the repository into a
temporary folder, installs it there, which needs a network, and computes the paper.

Each measurement is a process of its own. Wall times count on an idle machine only; processor time
(user and system, with all child processes) varies less with other load. Of repeated calls the least
is printed, since other processes make them longer and never shorter. To compare two versions, run
them by turns.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
COMMAND = [sys.executable, "-m", "rotor_mbs"]
# A user's installation has bytecode.
ENVIRONMENT = {
    name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"
}
REPEATS = 15  # of calls in a process
ROUNDS = 3  # of short commands

# A child process prints the least processor time of a call, in ms, after a first call that loads
# and compiles.
LEAST = """
import time
import rotor_mbs as rm
def least(call, repeats):
    call()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        call()
        times.append(1e3 * (time.process_time() - start))
    print(min(times))
"""
OWN = 'scene = rm.scene("paper/fig08").replace(duration=5.0, samples=501, gravity=9.8)'


class Usage(NamedTuple):
    """What a process took: wall and processor time in s, memory in MB, and what it printed."""

    wall: float
    processor: float
    memory: float
    output: str


def measured(command: list[str], folder: Path) -> Usage:
    """Run a command in a folder, and return what it took.

    The memory is that of its largest process.

    Parameters
    ----------
    command : program and arguments.
    folder : current folder of the process.
    """
    start = time.monotonic()
    with tempfile.TemporaryFile() as printed:
        process = subprocess.Popen(
            command, cwd=folder, env=ENVIRONMENT, stdout=printed, stderr=subprocess.DEVNULL
        )
        _, status, usage = os.wait4(process.pid, 0)
        printed.seek(0)
        output = printed.read().decode()
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        print(f"exit status {process.returncode}: {' '.join(command)[:100]}", file=sys.stderr)
    wall = time.monotonic() - start
    return Usage(wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024.0, output)


def show(what: str, target: str, usage: Usage) -> None:
    """Print a row of a command."""
    times = f"{usage.wall:9.2f} s {usage.processor:9.2f} s"
    print(f"{what:44} {target:>8} {times} {usage.memory:7.0f} MB", flush=True)


def show_run(what: str, target: str, folder: Path, prepare: str, repeats: int = REPEATS) -> None:
    """Print a row of `rm.run`: its least processor time, and the memory of the process.

    Parameters
    ----------
    what, target : as they are printed.
    folder : current folder of the process.
    prepare : statements that define `scene`.
    repeats : number of calls that are measured.
    """
    code = f"{LEAST}\n{prepare}\nleast(lambda: rm.run(scene), {repeats})"
    usage = measured([sys.executable, "-c", code], folder)
    milliseconds = float(usage.output.split()[-1])
    print(
        f"{what:44} {target:>8} {'':11} {milliseconds:8.1f} ms {usage.memory:7.0f} MB", flush=True
    )


def print_targets(folder: Path) -> None:
    """Print the times of commands and calls that have targets; targets are wall times."""
    print(f"{'':44} {'target':>8} {'wall':>11} {'processor':>11} {'memory':>10}")
    show("rotor-mbs reproduce", "20 s", measured([*COMMAND, "reproduce"], folder))
    results = "rotor-mbs-out/results.h5"
    for words, target in (
        (f"check {results}", "3.3 s"),
        ("run paper/fig11 -m lagrange/taylor", "0.9 s"),
        ("list", "0.1 s"),
    ):
        rounds = []
        for _ in range(ROUNDS):
            (folder / "results.h5").unlink(missing_ok=True)
            rounds.append(measured([*COMMAND, *words.split()], folder))
        show(f"rotor-mbs {words}", target, min(rounds, key=lambda usage: usage.processor))
    opening = f"import xarray; xarray.open_datatree({results!r})"
    show("xarray.open_datatree", "1 s", measured([sys.executable, "-c", opening], folder))
    show_run("rm.run, own scene, 501 samples", "10 ms", folder, OWN)
    shipped = 'scene = rm.scene("paper/fig11")'
    show_run("rm.run, paper/fig11, 1001 samples", "15 ms", folder, shipped)


def print_install(folder: Path) -> None:
    """Print the time of the README's line in a fresh clone, with pip's own cache."""
    line = (
        f"git clone -q {ROOT} clone && cd clone && python3 -m venv .venv && "
        ".venv/bin/pip install -q . && .venv/bin/rotor-mbs reproduce"
    )
    show("clone, install and reproduce", "45 s", measured(["bash", "-c", line], folder))


def print_growth(folder: Path) -> None:
    """Print times and memory over the number of samples, the duration, blades, and scenes."""
    print("\ngrowth                                       target              processor     memory")
    for power in range(3, 7):
        scene = f'scene = rm.scene("paper/fig11").replace(samples=10**{power} + 1)'
        target = "1 GB" if power == 6 else ""
        show_run(f"rm.run, 1e{power} samples", target, folder, scene, 1)
    million = (
        "import rotor_mbs as rm; from pathlib import Path; "
        'text = rm.scene("paper/fig11").text.replace("samples = 1001", "samples = 1000001"); '
        'Path("million.toml").write_text(text)'
    )
    measured([sys.executable, "-c", million], folder)
    words = "run million.toml -m lagrange/taylor -o million.h5 --timeout 3000"
    show(
        "rotor-mbs run, 1e6 samples, with reference",
        "1 GB",
        measured([*COMMAND, *words.split()], folder),
    )
    for duration in (10, 50, 200):
        scene = f'scene = rm.scene("paper/fig11").replace(duration={duration}.0, samples=1001)'
        show_run(f"rm.run, {duration} s in 1001 samples", "", folder, scene)
    for blades in (1, 2, 3, 4, 5, 10, 20, 30):
        pitches = [0.3 * (-1) ** i / (1 + i) for i in range(blades)]
        start = {"initial.angles": [0.1, *pitches], "initial.rates": [0.0] * (1 + blades)}
        changed = f"blades={blades}, samples=501, duration=5.0, **{start}"
        scene = f'scene = rm.scene("paper/fig08").replace({changed})'
        show_run(f"rm.run, {blades} blades, 501 samples", "", folder, scene)
    for scenes in (10, 40, 160, 320):
        show_file(folder, scenes)


def show_file(folder: Path, scenes: int) -> None:
    """Print the times to lay out, extend by nothing, and open a results file of small scenes."""
    code = f"""
import time
from dataclasses import replace
from pathlib import Path
import rotor_mbs as rm
from rotor_mbs.runs.design import RunRequest, results_tables
from rotor_mbs.runs.merge import fit_file_to_request
from rotor_mbs.runs.table import TableFile
base = rm.scene("paper/fig11").replace(duration=1.0, samples=11)
asked = []
for i in range({scenes}):
    scene = replace(base, name=f"own/s{{i}}")
    asked += [RunRequest(scene, "reference"), RunRequest(scene, "lagrange/taylor")]
tables, path = results_tables(asked), Path("scenes-{scenes}.h5")
for call in (fit_file_to_request, fit_file_to_request, lambda path, _: TableFile(path)):
    start = time.process_time()
    call(path, tables)
    print(1e3 * (time.process_time() - start) / {scenes})
"""
    usage = measured([sys.executable, "-c", code], folder)
    times = [float(text) for text in usage.output.split()]
    for what, milliseconds in zip(("layout", "nothing to do", "open"), times, strict=True):
        row = f"file of {scenes} scenes, {what}, for each scene"
        print(f"{row:44} {'':8} {'':11} {milliseconds:8.1f} ms {usage.memory:7.0f} MB", flush=True)


if __name__ == "__main__":
    parts = {"targets": print_targets, "growth": print_growth, "install": print_install}
    asked = sys.argv[1:] or ["targets", "growth"]
    if unknown := set(asked) - set(parts):
        sys.exit(f"unknown: {', '.join(unknown)}; allowed: {', '.join(parts)}")
    compiling = [sys.executable, "-m", "compileall", "-q", str(ROOT / "rotor_mbs")]
    subprocess.run(compiling, env=ENVIRONMENT, check=True)
    print(f"load before: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    with tempfile.TemporaryDirectory() as temporary:
        for name in asked:
            parts[name](Path(temporary))
    print(f"load after: {os.getloadavg()[0]:.1f}")
