"""A sweep on a real dask cluster on this machine: a scheduler, two worker processes, one of them
killed on the way."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import pytest
from support.commands import refusal, rotor_mbs
from support.sweeps import starts_file, stored_runs

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.processes.cluster import Cluster, run_as_worker
from rotor_mbs.processes.pool import SerialPool, run_in
from rotor_mbs.runs.engines import identity, refuse_other_code

Client = pytest.importorskip("distributed").Client
pytestmark = pytest.mark.full


@pytest.fixture
def cluster() -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Address, scheduler and two workers: without nannies, so that a killed one stays away."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    dask = [sys.executable, "-m", "distributed.cli"]
    commands = [
        [f"{dask[2]}.dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
    ]
    commands += [
        [f"{dask[2]}.dask_worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard"]
    ] * 2
    with ExitStack() as stack:
        processes = [
            stack.enter_context(
                subprocess.Popen(
                    [*dask[:2], *command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
                )
            )
            for command in commands
        ]
        with Client(address, timeout=30, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=60)
        yield address, processes
        for process in processes:
            process.kill()


def swept(
    folder: Path, address: str, victim: subprocess.Popen[bytes], draws: int
) -> tuple[str, str, int]:
    """Output, errors and status of s.toml into dask.h5 on a cluster of which a process is killed
    after five runs."""
    path, output = starts_file(folder, draws, 21, 3.0), folder / "dask.h5"
    command = [
        sys.executable,
        "-m",
        "rotor_mbs",
        "sweep",
        str(path),
        "-o",
        str(output),
        "--engine",
        f"dask:{address}",
    ]
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as sweep:
        while sweep.poll() is None and stored_runs(output) < 5:
            time.sleep(0.01)
        assert sweep.poll() is None, sweep.communicate()
        victim.kill()
        return (*sweep.communicate(timeout=120), sweep.wait())


def test_a_killed_worker_of_a_cluster_loses_nothing(
    tmp_path: Path, cluster: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    address, (_, worker, _) = cluster
    output, errors, status = swept(tmp_path, address, worker, 60)
    assert status == 0, (output, errors)
    assert "60 runs: 60 ok" in output
    assert rotor_mbs("sweep", tmp_path / "s.toml", "-o", tmp_path / "local.h5").status == 0
    assert (tmp_path / "dask.h5").read_bytes() == (tmp_path / "local.h5").read_bytes()


def test_a_worker_with_other_code_or_another_version_is_refused() -> None:
    here = identity()
    assert {"rotor_mbs", "numpy", "heyoka", "python", "code of rotor_mbs"} <= set(here)
    for name in here:
        other = SerialPool().submit(partial(_run_as_worker, here | {name: "other"}), 3, 1.0)
        with pytest.raises(
            InputError,
            match=(
                rf"allowed: workers with the same \(on .*: {name} .* "
                r"\(here other\)\)"
            ),
        ):
            other.result()
    assert SerialPool().submit(partial(_run_as_worker, here), -3, 1.0).result() == 3


def _run_as_worker(expected: dict[str, str], task: int) -> int:
    return run_as_worker(abs, task, 10.0, partial(refuse_other_code, expected))


def test_a_scheduler_that_dies_ends_in_one_line(
    tmp_path: Path, cluster: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    address, (scheduler, *_) = cluster
    _, errors, status = swept(tmp_path, address, scheduler, 4000)
    assert status == 1, errors
    assert "Traceback" not in errors
    assert (
        errors.strip()
        .splitlines()[-1]
        .startswith("engine dask: the scheduler was lost; stored runs are kept")
    )


def test_a_cluster_that_is_not_there_and_one_without_workers_are_a_line(
    tmp_path: Path, cluster: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    told = refusal(
        "sweep",
        "sweeps/fig11-spread",
        "-o",
        tmp_path / "o.h5",
        "--engine",
        "dask:tcp://127.0.0.1:9",
    )
    assert "engine dask:tcp://127.0.0.1:9: no dask scheduler answers there" in told
    address, (_, *workers) = cluster
    with Client(address, timeout=30, set_as_default=False) as client:
        for worker in workers:
            worker.kill()
        (end,) = run_in(Cluster(client, dict, patience_s=0.5), time.sleep, [100.0], 200.0)
    assert isinstance(end.error, StoreError)  # which ends a sweep
    assert str(end.error) == "engine dask: no workers for 0.5 s; stored runs are kept"
