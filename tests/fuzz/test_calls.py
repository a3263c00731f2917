"""Calls of the API from threads, a running event loop and daemonic processes: the answer of the
same call made alone, or the line of an InputError.

The long form (100 calls in each way): `pytest -m nightly tests/fuzz/test_calls.py`.
"""

from __future__ import annotations

import asyncio
import hashlib
import multiprocessing
import pickle
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor

import pytest

import rotor_mbs as rm
from rotor_mbs.errors import InputError
from rotor_mbs.scenario.scene import Scene

# Not Radau: its answer differed once between two processes, by what is not known; its steps solve
# equations by LAPACK.
METHOD, OTHER = "lagrange/dop853", "lagrange/ode45"


def scene(number: int) -> Scene:
    """Each call has a scene of its own, so that no call can have the answer of another one."""
    scene = rm.scene("paper/fig08").replace(duration=0.2, samples=11, gravity=9.0 + 0.01 * number)
    return scene if number % 2 else pickle.loads(pickle.dumps(scene))


def swept(number: int, **options: object) -> rm.Results:
    values = (0.1 * i for i in range(number % 3 + 1))
    return rm.sweep(
        scene(number), {"initial.angles[1]": values}, methods=[METHOD], samples=3, **options
    )


def compared(number: int) -> dict[str, rm.Run]:
    run = rm.run(scene(number), METHOD)
    assert (
        rm.compare(
            {"time": run.time, "angles": run.angles, "rates": run.rates}, scene(number)
        ).status
        == "ok"
    )
    return {METHOD: run}


WRONG_LIMITS, WRONG_WORKERS = (-1.0, 0.0, float("nan"), float("-inf")), (-1, 10**9, 1025)
CALLS: dict[str, Callable[[int], Mapping[str, rm.Run]]] = {
    "one": lambda n: {METHOD: rm.run(scene(n), METHOD, timeout=100.0)},
    "several": lambda n: rm.run(scene(n), (name for name in (METHOD, OTHER))),
    "sweep": swept,
    "pickled": lambda n: pickle.loads(pickle.dumps(rm.run(scene(n), [METHOD]))),
    "compare": compared,
    "wrong limit": lambda n: rm.run(scene(n), [METHOD], timeout=WRONG_LIMITS[n % 4]),
    "wrong workers": lambda n: swept(n, workers=WRONG_WORKERS[n % 3]),
}


def answer(number: int) -> str:
    """The digest of what a call returns, or its line."""
    name = list(CALLS)[number % len(CALLS)]
    try:
        runs = [
            (label, run.status, run.angles.tobytes()) for label, run in CALLS[name](number).items()
        ]
        return f"{name}: {hashlib.sha256(repr(runs).encode()).hexdigest()}"
    except InputError as error:
        return f"{name}: {error}"


async def _in_loop(number: int) -> str:
    await asyncio.sleep(0.0)
    return answer(number)


@pytest.mark.parametrize(
    "count",
    [pytest.param(24, marks=pytest.mark.full), pytest.param(100, marks=pytest.mark.nightly)],
)
def test_a_call_has_its_own_answer_wherever_it_is_made(count: int) -> None:
    alone = [answer(number) for number in range(count)]
    assert len(set(alone)) > count // 2
    assert all("allowed: " in line for line in alone if line.startswith("wrong"))
    with ThreadPoolExecutor(8) as threads:
        assert list(threads.map(answer, range(count))) == alone
    assert [asyncio.run(_in_loop(number)) for number in range(0, count, 3)] == alone[::3]
    with multiprocessing.get_context("spawn").Pool(1) as daemons:
        assert daemons.map(answer, range(count)) == alone
