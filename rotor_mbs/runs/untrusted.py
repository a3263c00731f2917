"""Read files with the HDF5 library in a worker process with limits of time and memory.

A digest is no signature: a forged file can have a right one. The library follows the trees, heaps
and headers of a file as they are. Some forged files end the process that reads them, and others are
read without end, or fill the memory. A worker process therefore reads each file and returns plain
values: a forged file ends only the worker. Files that this process wrote, and those that came with
the program, are read without it.
"""

from __future__ import annotations

import atexit
import math
import time
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import TypeVar, cast

from rotor_mbs.errors import ResourceError, StoreError
from rotor_mbs.processes.serving import address_space, is_worker, limit_resources
from rotor_mbs.processes.worker import TaskLostError, Worker, memory_limit_text
from rotor_mbs.runs.trailer import read_trailer

T = TypeVar("T")
R = TypeVar("R")

# Limits of processor time (s), which does not depend on how busy the machine is, and of address
# space (bytes): for every file, and in addition for each byte outside its rows. It takes about 1 us
# to read a byte.
TIME_S = 10.0
TIME_OF_BYTE_S = 1e-5
MEMORY = 1 << 30
MEMORY_OF_BYTE = 16
# Elapsed time that is allowed in addition, for waiting. It limits the reading where the system
# cannot limit processor time.
_WAIT_S = 300.0
_SET_UP_S = 60.0  # for the start of the worker
_TRIES = 2  # to read a file, if the worker is killed from outside
_KILLED = -9  # exit code of a process that SIGKILL ended


def _load() -> None:
    """Load the code that reads files."""
    import_module("rotor_mbs.runs.hdf5")  # by its name: it imports this module


_worker = Worker(_load, memory_limit=MEMORY, is_silent=True, set_up_limit_s=_SET_UP_S)
_trusted: set[bytes] = set()
atexit.register(_worker.close)


def prepare_reading() -> None:
    """Start the worker process, which loads its code while this one goes on."""
    with suppress(ResourceError):  # reported when a file is read
        _worker.start()


def trust(digest: bytes) -> None:
    """Trust the file whose trailer has this digest, as this process writes it."""
    _trusted.add(digest)


def read_in_worker(path: Path, read: Callable[[Path, T], R], argument: T) -> R:
    """Return `read(path, argument)` of a file of this program, called in the worker process.

    In a worker process, and for a file that is trusted, it is called in this process.

    Parameters
    ----------
    path : the file; the limits of time and memory grow with its size without the rows.
    read : a function of a path and an argument.
    argument : its second argument.

    Raises
    ------
    StoreError
        If the file cannot be read within the limits, and what `read` raises.
    ResourceError
        If the worker process cannot be started or is killed again and again, or the system lacks
        memory to read the file.
    """
    from rotor_mbs.scenario.catalogue import REFERENCES  # late: the worker does without

    trailer = read_trailer(path)
    if is_worker() or trailer.digest in _trusted or path.parent == REFERENCES:
        return read(path, argument)
    size = path.stat().st_size
    for columns in trailer.groups.values():
        size -= sum(length for _, length in columns.values())
    seconds = TIME_S + TIME_OF_BYTE_S * size
    memory = int(MEMORY + MEMORY_OF_BYTE * size)
    is_over_limit = True  # unless the worker returns
    for _ in range(_TRIES):
        try:
            value, is_over_limit = _worker.run(
                _read_limited, (seconds, memory, read, path, argument), _WAIT_S + seconds
            )
            if not is_over_limit:
                return cast(R, value)
        except MemoryError:  # of this process, which receives what was read
            is_over_limit = False
        except TaskLostError as exc:
            # At its limits the worker ends otherwise: it was killed by a user, or by a system that
            # lacked memory.
            if exc.exit_code == _KILLED:
                continue
        break
    else:
        raise ResourceError(f"{path}: the process that reads it was killed {_TRIES} times")
    # If the memory of this process is limited to less, so is the worker's, and its end says nothing
    # of the file.
    if not is_over_limit or address_space() < memory:
        raise ResourceError(f"{path}: not enough memory to read it{memory_limit_text()}")
    limits = f"{seconds:.3g} s or {memory / 2**30:.3g} GB"
    problem = f"damaged or forged: HDF5 ends the process that reads it, or takes more than {limits}"
    raise StoreError(f"{path}: {problem}; allowed: a file that rotor-mbs wrote")


def _read_limited(
    arguments: tuple[float, int, Callable[[Path, T], R], Path, T],
) -> tuple[R | None, bool]:
    """Call `read(path, argument)` within limits of this process.

    Parameters
    ----------
    arguments : processor time (s), address space (bytes), `read`, `path` and `argument`.

    Returns
    -------
    value : what was read; None if the memory did not suffice.
    is_over_limit : whether the memory did not suffice.
    """
    seconds, memory, read, path, argument = arguments
    limit_resources(memory, math.ceil(time.process_time() + seconds))
    try:
        return read(path, argument), False
    except MemoryError:
        return None, True
