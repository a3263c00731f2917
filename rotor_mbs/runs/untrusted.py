"""Read files with the HDF5 library in a worker process with limits of time and memory.

A digest is no signature: a forged file can have a right digest. The library follows the trees,
heaps and headers of a file without checking them. Some forged files end the process that reads
them; others are read without end, or fill the memory. Therefore a worker process reads each file
and returns plain values: a forged file ends only the worker. Files that this process wrote, and
shipped files, are read in this process.
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

# Limits for reading a file: processor time in s and address space in bytes. Each limit is a value
# for every file, and an addition for each byte outside the rows; reading a byte takes about 1 us.
# Processor time is limited because, unlike elapsed time, it hardly depends on the machine's load.
TIME_S = 10.0
TIME_OF_BYTE_S = 1e-5
MEMORY = 1 << 30
MEMORY_OF_BYTE = 16
# Elapsed time is limited, too, for systems that cannot limit processor time. Its limit is longer
# than the limit of processor time by this time in s, as the worker may have to wait.
_WAIT_S = 300.0
_SET_UP_S = 60.0  # time limit for the start of the worker in s
_TRIES = 2  # number of attempts to read a file if the worker is killed from outside
_KILLED = -9  # exit code of a process that SIGKILL ended


def _load() -> None:
    """Load the code that reads files."""
    import_module("rotor_mbs.runs.hdf5")  # by its name, as runs.hdf5 imports this module


_worker = Worker(_load, memory_limit=MEMORY, is_silent=True, set_up_limit_s=_SET_UP_S)
_trusted: set[bytes] = set()
atexit.register(_worker.close)


def prepare_reading() -> None:
    """Start the worker process, which loads its code while this process continues."""
    with suppress(ResourceError):  # a failure is reported when a file is read
        _worker.start()


def trust(digest: bytes) -> None:
    """Trust the file whose trailer has this digest, because this process writes the file."""
    _trusted.add(digest)


def read_in_worker(path: Path, read: Callable[[Path, T], R], argument: T) -> R:
    """Call `read(path, argument)` in the worker process, and return its result.

    If the file is trusted or shipped, or this process is a worker itself, `read` is called in this
    process, without limits.

    Parameters
    ----------
    path : a file of this program. The limits of time and memory grow with the size of its content
        outside the rows.
    read : a function of a path and an argument.
    argument : the second argument of `read`.

    Raises
    ------
    StoreError
        If the file cannot be read within the limits.
    ResourceError
        If the worker process cannot be started or is killed again and again, or the system lacks
        memory to read the file.
    Exception
        What `read` raises.
    """
    # Not at the top: the worker does not need it.
    from rotor_mbs.scenario.catalogue import REFERENCES

    trailer = read_trailer(path)
    if is_worker() or trailer.digest in _trusted or path.parent == REFERENCES:
        return read(path, argument)
    size = path.stat().st_size
    for columns in trailer.groups.values():
        size -= sum(length for _, length in columns.values())
    seconds = TIME_S + TIME_OF_BYTE_S * size
    memory = int(MEMORY + MEMORY_OF_BYTE * size)
    is_over_limit = True  # this stays so if the worker ends without an answer
    for _ in range(_TRIES):
        try:
            value, is_over_limit = _worker.run(
                _read_limited, (seconds, memory, read, path, argument), _WAIT_S + seconds
            )
            if not is_over_limit:
                return cast(R, value)
        except MemoryError:  # in this process, while it receives what the worker has read
            is_over_limit = False
        except TaskLostError as exc:
            # The worker's own limits do not end it with this code: a user has killed it, or a
            # system that lacked memory.
            if exc.exit_code == _KILLED:
                continue
        break
    else:
        raise ResourceError(f"{path}: the process that reads it was killed {_TRIES} times")
    # If this process may use less memory than the limit, so may the worker. The end of the worker
    # then tells nothing about the file.
    if not is_over_limit or address_space() < memory:
        raise ResourceError(f"{path}: not enough memory to read it{memory_limit_text()}")
    limits = f"{seconds:.3g} s or {memory / 2**30:.3g} GB"
    problem = f"damaged or forged: HDF5 ends the process that reads it, or takes more than {limits}"
    raise StoreError(f"{path}: {problem}; allowed: a file that rotor-mbs wrote")


def _read_limited(
    arguments: tuple[float, int, Callable[[Path, T], R], Path, T],
) -> tuple[R | None, bool]:
    """Limit this worker process, then call `read(path, argument)`.

    Parameters
    ----------
    arguments : processor time (s), address space (bytes), `read`, `path` and `argument`.

    Returns
    -------
    value : the result of `read`; None if the memory did not suffice.
    is_over_limit : whether the memory did not suffice.
    """
    seconds, memory, read, path, argument = arguments
    limit_resources(memory, math.ceil(time.process_time() + seconds))
    try:
        return read(path, argument), False
    except MemoryError:
        return None, True
