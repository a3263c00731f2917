"""Calls of the API from threads, a running event loop and daemonic processes: the answer of the same call made alone,
or the line of an InputError.

The long form (100 calls in each way): `pytest -m nightly tests/fuzz/test_calls.py`.
"""

from __future__ import annotations

import asyncio
import hashlib
import multiprocessing
import pickle
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pytest

import rotor_mbs as rm
from rotor_mbs.errors import InputError
from rotor_mbs.scenario.scene import Scene

# Not Radau: its answer differed once between two processes, by what is not known; its steps solve equations by LAPACK.
METHOD, OTHER = "lagrange/dop853", "lagrange/ode45"


def _scene(number: int) -> Scene:
    """Each call has a scene of its own, so that no call can have the answer of another one."""
    scene = rm.scene("paper/fig08").replace(duration=0.2, samples=11, gravity=9.0 + 0.01 * number)
    return scene if number % 2 else pickle.loads(pickle.dumps(scene))


def _of(runs: rm.Runs) -> list[object]:
    return [(label, run.status, run.angles.tobytes()) for label, run in runs.items()]


def _run(number: int) -> object:
    run = rm.run(_scene(number), METHOD, timeout=100.0)
    return run.status, run.angles.tobytes()


def _several(number: int) -> object:
    return _of(rm.run(_scene(number), (name for name in (METHOD, OTHER))))


def _sweep(number: int) -> object:
    values = (0.1 * i for i in range(number % 3 + 1))
    return _of(rm.sweep(_scene(number), {"initial.angles[1]": values}, methods=[METHOD], samples=3))


def _pickled(number: int) -> object:
    return _of(pickle.loads(pickle.dumps(rm.run(_scene(number), [METHOD]))))


def _compare(number: int) -> object:
    scene = _scene(number)
    run = rm.run(scene, METHOD)
    return rm.compare({"time": run.time, "angles": run.angles, "rates": run.rates}, scene).status


def _wrong_limit(number: int) -> object:
    return rm.run(_scene(number), [METHOD], timeout=(-1.0, 0.0, float("nan"), float("-inf"))[number % 4])


def _wrong_workers(number: int) -> object:
    return rm.sweep(_scene(number), {"gravity": [1.0]}, methods=[METHOD], workers=(-1, 10**9, 0.5)[number % 3])


def _short(number: int) -> object:
    """Whatever it reached, it is said that the limit ended it."""
    return rm.run(_scene(number).replace(samples=100_001), "exudyn_tree/rk44", timeout=0.01).status


CALLS: list[Callable[[int], object]] = [
    _run, _several, _sweep, _pickled, _compare, _wrong_limit, _wrong_workers, _short,
]  # fmt: skip


def answer(number: int) -> str:
    """The digest of what a call returns, or its line."""
    call = CALLS[number % len(CALLS)]
    try:
        return f"{call.__name__} {hashlib.sha256(repr(call(number)).encode()).hexdigest()}"
    except InputError as error:
        return f"{call.__name__} {error}"


async def _in_loop(number: int) -> str:
    await asyncio.sleep(0.0)
    return answer(number)


@pytest.mark.parametrize(
    "count", [pytest.param(24, marks=pytest.mark.full), pytest.param(100, marks=pytest.mark.nightly)]
)
def test_a_call_has_its_own_answer_wherever_it_is_made(count: int) -> None:
    alone = [answer(number) for number in range(count)]
    assert len(set(alone)) > count // 2
    assert all("allowed: " in line for line in alone if line.startswith("_wrong"))
    with ThreadPoolExecutor(8) as threads:
        assert list(threads.map(answer, range(count))) == alone
    assert [asyncio.run(_in_loop(number)) for number in range(0, count, 3)] == alone[::3]
    with multiprocessing.get_context("spawn").Pool(1) as daemons:
        assert daemons.map(answer, range(count)) == alone
