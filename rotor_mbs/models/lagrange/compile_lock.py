"""One compilation at a time on a machine: the next process finds the code in the engine's cache on disk."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from getpass import getuser
from pathlib import Path


@contextmanager
def one_at_a_time(name: str) -> Iterator[None]:
    """Waits for other processes of this user that hold `name`; without locks on this system it does not wait."""
    try:
        import fcntl
    except ImportError:  # Windows: two processes then compile the same code, which costs time and nothing else
        yield
        return
    path = Path(tempfile.gettempdir()) / f"{name}-{getuser()}.lock"
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
