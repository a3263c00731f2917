"""Judge runs of random rotors, and compare each verdict with an integration that is not the
package's.

    python tests/support/random_verdicts.py verdicts.csv --seeds 0:200

writes a row for each seed and method as it is computed, and continues a file that has some of them.
"""

from __future__ import annotations

import argparse
import csv
import resource
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from rotor_mbs.analysis.judgement import judge
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.selection import supporting_methods
from rotor_mbs.methods.solve import solve
from rotor_mbs.methods.time_limit import OutOfTimeError
from rotor_mbs.models.lagrange.heyoka_adapter import is_available
from rotor_mbs.solution.defects import OK_ERROR
from rotor_mbs.solution.status import COMPLETE
from support import other_code
from support.random_scenes import random_scene

EXACT = ("lagrange/taylor" if is_available() else "lagrange/dop853", "lagrange/dop853")
COARSE = (
    "exudyn_tree/rk67",
    "mujoco/rk4",
    "exudyn_chain/extrapolated",
    "exudyn_tree/generalized_alpha",
)
LIMIT_S = 60.0
# rad: more than rounding and the independent integration leave. A coarse method whose error is
# less than this breaks no claim.
ROUNDING = 1e-10
RIGHT = 1e-5  # rad: more than a right run of these methods is off
OF_MOTION = ("defect", "median", "angle error", "predicted", "pitch")  # beginnings of messages


@dataclass(frozen=True)
class Verdict:
    """A run of a random rotor, and what was said of it.

    Attributes
    ----------
    seed : of the rotor.
    method : that computed the run.
    status, message : the verdict.
    error : of the angles before the horizon, rad, against the independent integration.
    horizon, duration : s.
    fault : what is wrong with the verdict, "" where nothing is.
    """

    seed: int
    method: str
    status: str
    message: str
    error: float
    horizon: float
    duration: float
    fault: str


def verdicts(
    seed: int, methods: Sequence[str], limit_s: float = LIMIT_S, angles: Any = None
) -> Iterator[Verdict]:
    """Yield the verdict on a run by each method that has the rotor of a seed.

    Parameters
    ----------
    seed : of the rotor.
    methods : names; those that are not installed are left out.
    limit_s : time limit of a run.
    angles : (samples, 1 + blades), of the independent integration; None to integrate here.
    """
    scene = random_scene(seed)
    if angles is None:
        angles = independent_angles(seed)
    installed = [name for name in methods if find_method(name).is_installed]
    for method in supporting_methods(scene, installed)[0]:
        try:
            run = solve(method, scene, {}, time_limit_s=limit_s)
        except OutOfTimeError as exc:
            yield Verdict(seed, method, "timed_out", str(exc), np.nan, np.nan, scene.duration, "")
            continue
        judgement = judge(scene, run, None)
        horizon = judgement.metrics.get("horizon_s", 0.0)
        before = np.flatnonzero(run.time <= horizon)
        error = float(np.abs(run.angles[before] - angles[before]).max(initial=0.0))
        fault = _fault(method, judgement.status, judgement.message, error)
        yield Verdict(
            seed, method, judgement.status, judgement.message, error, horizon, scene.duration, fault
        )


def independent_angles(seed: int) -> Any:
    """Return the angles of a seed's rotor at its sample times, by another code."""
    scene = random_scene(seed)
    with np.errstate(all="ignore"):
        times = np.linspace(0.0, scene.duration, scene.samples)
        return other_code.trajectory(scene, times, atol=1e-13)[0]


def _fault(method: str, status: str, message: str, error: float) -> str:
    """Return what is wrong with a verdict; "" where nothing is."""
    if status == "ok":
        return "" if error <= OK_ERROR else f"ok, but off by {error:.1e} rad"
    if status == "timed_out":
        return ""
    if method in EXACT and status != "unchecked":
        return f"exact to rounding, but {status}"
    if status == "unchecked":
        is_explained = "would not be seen; set a larger number of `samples`" in message
        return "" if is_explained else "unchecked without a reason"
    # Of a right motion tips, energies and loads are right, too.
    if status in COMPLETE and error <= RIGHT and not message.startswith(OF_MOTION):
        return f"right to {error:.1e} rad, but {message}"
    # What stopped before its end is not a motion that could be right.
    if status in COMPLETE and error <= ROUNDING:
        return f"right to {error:.1e} rad, but {status}"
    return ""


@contextmanager
def _cpu_limit(limit_s: float) -> Iterator[None]:
    """Raise TimeoutError after a time of this process's own computing, in s."""

    def end(*_: object) -> None:
        raise TimeoutError

    previous = signal.signal(signal.SIGVTALRM, end)
    signal.setitimer(signal.ITIMER_VIRTUAL, limit_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, previous)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--seeds", default="0:200", help="first:end")
    parser.add_argument("--limit", type=float, default=LIMIT_S, help="s, of each run")
    parser.add_argument(
        "--cpu", type=float, default=600.0, help="s, of the independent integration"
    )
    arguments = parser.parse_args()
    first, end = map(int, arguments.seeds.split(":"))
    names = [field.name for field in fields(Verdict)]
    done = set()
    if arguments.file.exists():
        done = {int(row["seed"]) for row in csv.DictReader(arguments.file.open())}
    else:
        csv.writer(arguments.file.open("w")).writerow(names)
    for seed in range(first, end):
        if seed in done:
            continue
        try:
            with _cpu_limit(arguments.cpu):
                angles = independent_angles(seed)
        except TimeoutError:
            text = f"independent integration takes more than {arguments.cpu:g} s"
            rows = [Verdict(seed, "", "not judged", text, np.nan, np.nan, np.nan, "")]
        else:
            methods = dict.fromkeys((*EXACT, *COARSE))
            rows = list(verdicts(seed, tuple(methods), arguments.limit, angles))
        with arguments.file.open("a") as file:  # a seed at a time, so that none is left half done
            csv.writer(file).writerows([getattr(row, name) for name in names] for row in rows)
        cpu = resource.getrusage(resource.RUSAGE_SELF).ru_utime
        print(seed, f"{cpu:.0f} s", *(f"{row.method}: {row.fault}" for row in rows if row.fault))
        sys.stdout.flush()


if __name__ == "__main__":
    main()
