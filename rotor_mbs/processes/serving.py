"""Answer requests of the parent in a worker process; `processes.worker` is the parent's side."""

from __future__ import annotations

import gc
import math
import os
import pickle
import queue
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import BinaryIO

from rotor_mbs.errors import one_line, system_errors_apart

_is_worker = False


def serve() -> None:
    """Answer requests until the parent ends; this is all that a worker process does."""
    global _is_worker
    try:
        _is_worker = True
        _end_with_parent()
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        # Garbage is collected less often: loading engines and drawing leave little of it, and the
        # collections took a twentieth of the time.
        gc.set_threshold(50_000, 20, 20)
        del sys.argv[1:]
        requests, answers = _private_pipes()
        received: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        # The thread ends this process when its input ends, whatever the main thread does.
        threading.Thread(target=_receive, args=(requests, received), daemon=True).start()
        while True:
            send(answers, _answer(received.get()))
    finally:  # after an exit or an error, the parent sees that this process has ended
        os._exit(1)


def _end_with_parent() -> None:
    """Make Linux end this process when the parent ends.

    On other systems only the thread in `_receive` does so. It cannot run while an engine holds the
    interpreter's lock.
    """
    if sys.platform == "linux":
        with suppress(ImportError, OSError, AttributeError):
            import ctypes

            set_parent_death_signal = 1  # PR_SET_PDEATHSIG of prctl(2)
            ctypes.CDLL(None).prctl(set_parent_death_signal, signal.SIGKILL)


def _private_pipes() -> tuple[BinaryIO, BinaryIO]:
    """Return the pipes of requests and answers, moved to new file descriptors.

    Code that reads from standard input, or prints, then does not reach the pipes.
    """
    nothing = os.open(os.devnull, os.O_RDWR)
    while nothing <= 2:  # descriptor 2 is free if the parent's standard error was closed
        nothing = os.open(os.devnull, os.O_RDWR)
    pipes = [os.dup(0), os.dup(1)]
    os.dup2(nothing, 0)
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    requests, answers = os.fdopen(pipes[0], "rb"), os.fdopen(pipes[1], "wb")

    def close_in_fork() -> None:
        """Close the pipes in a process that a method forks.

        The forked process may outlive this one. With its copies of the pipes open, the parent would
        not see that this process has ended.
        """
        while pipes:
            os.close(pipes.pop())

    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=close_in_fork)
    return requests, answers


def _receive(requests: BinaryIO, received: queue.SimpleQueue[bytes]) -> None:
    """Pass requests on to the main thread; end this process when the pipe is closed."""
    try:
        while True:
            received.put(pickle.load(requests))
    finally:
        os._exit(1)


def set_up(
    core: int | None, memory_limit: int | None, initializer: Callable[[], object] | None
) -> None:
    """Set the core and the memory limit (bytes) of this process, and call its initializer."""
    if core is not None and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {core})
    if memory_limit is not None:
        _keep_below_limit_of_parent()
        limit_resources(memory_limit)
    if initializer is not None:
        initializer()


def _keep_below_limit_of_parent() -> None:
    """Prevent this process from raising its limit of address space above the parent's."""
    with suppress(ImportError):  # Windows
        import resource

        soft, _ = resource.getrlimit(resource.RLIMIT_AS)
        with suppress(ValueError, OSError):  # macOS has no limit of address space
            resource.setrlimit(resource.RLIMIT_AS, (soft, soft))


def limit_resources(memory: int, processor_s: int | None = None) -> None:
    """Limit address space and processor time of this process, if the system can.

    The system ends a process that exceeds the processor time.

    Parameters
    ----------
    memory : address space, bytes.
    processor_s : processor time, s; None for no limit.
    """
    with suppress(ImportError):  # Windows
        import resource

        limits = {resource.RLIMIT_AS: memory}
        if processor_s is not None:
            limits |= {resource.RLIMIT_CPU: processor_s, resource.RLIMIT_CORE: 0}
        for kind, limit in limits.items():
            _, hard = resource.getrlimit(kind)
            if hard != resource.RLIM_INFINITY:
                limit = min(limit, hard)
            with suppress(ValueError, OSError):  # macOS has no limit of address space
                resource.setrlimit(kind, (limit, hard))


def address_space() -> float:
    """Return the limit of address space (bytes) of this process; infinity if there is none.

    Processes that this one starts inherit the limit.
    """
    with suppress(ImportError):  # Windows
        import resource

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        if limit != resource.RLIM_INFINITY:
            return float(limit)
    return math.inf


def is_worker() -> bool:
    """Return whether this is a worker process."""
    return _is_worker


def _answer(request: bytes) -> bytes:
    """Call the function in a request, and return the pickled tuple (result, error).

    A result that cannot be pickled counts as an error. If the function exits, as by SystemExit, or
    its error cannot be pickled, the error in the tuple is a RuntimeError.

    Parameters
    ----------
    request : pickled tuple (folder, call). `folder` is that in which the function runs; "" for the
        current folder. `call` is the pickled tuple (function, argument).
    """
    try:
        with system_errors_apart():
            folder, call = pickle.loads(request)
            if folder:
                with suppress(OSError):  # the folder is gone, also for the parent
                    os.chdir(folder)
            work, task = pickle.loads(call)
            result = work(task)
        return pickle.dumps((result, None))
    except Exception as exc:
        try:
            answer = pickle.dumps((None, exc))
            pickle.loads(answer)  # some errors can be pickled but not read again
        except Exception:
            return pickle.dumps((None, RuntimeError(one_line(exc))))
        return answer
    except BaseException as exc:  # SystemExit and the like, raised in the parent, would end it
        return pickle.dumps((None, RuntimeError(one_line(exc))))


def send(stream: BinaryIO, message: bytes) -> None:
    """Write a message to a pipe, from which `pickle.load` reads it. Raises OSError."""
    pickle.dump(message, stream)
    stream.flush()
