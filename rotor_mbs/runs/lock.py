"""How every command writes an output: locked against other processes, by a file beside it that goes afterwards."""

from __future__ import annotations

import os
import re
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rotor_mbs.errors import InputError, StoreError

# Outputs that this process is writing, by thread: a study takes the lock, and so does what it calls.
_held: set[tuple[Path, int]] = set()


@contextmanager
def writing(output: Path) -> Iterator[None]:
    """No other process writes `output` in the block; it may be entered again by the same thread.

    Raises
    ------
    InputError
        Where another process is writing it.
    StoreError
        Where it cannot be written.
    """
    place = _resolved(output)
    own = place, threading.get_ident()
    if own in _held:
        yield
        return
    from filelock import FileLock, Timeout

    path = _lock_of(place)
    lock = FileLock(path, timeout=0)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_symlink() or (path.exists() and not path.is_file()):
            raise InputError(f"{path}: is a foreign file; allowed: another output, or remove it")
        lock.acquire()
    except Timeout:
        owner = ""
        with suppress(OSError, UnicodeDecodeError):
            owner = path.read_text()
        writer = f"another process is writing it now{f' ({owner})' if owner else ''}"
        raise InputError(f"{output}: {writer}; allowed: wait for its end, or another output") from None
    except OSError as exc:
        raise StoreError(f"{output}: cannot be written: {exc.strerror}") from exc
    _held.add(own)
    try:
        _remove_temporaries(place)
        with suppress(OSError):  # a full disk is reported by what is written to the output
            path.write_text(f"process {os.getpid()} on {socket.gethostname()}")
        yield
    finally:
        _held.remove(own)
        with suppress(OSError):
            path.unlink()
        lock.release()


def is_being_written(output: Path) -> bool:
    """Whether another process writes it now, or was killed while it did."""
    return _lock_of(_resolved(output)).exists()


def _lock_of(place: Path) -> Path:
    return place.with_name(f".{place.name}.lock")


def _resolved(output: Path) -> Path:
    """The file itself where the output is a symbolic link: both names are one output."""
    try:
        return output.resolve() if output.is_symlink() else Path(os.path.abspath(output))  # noqa: PTH100  (links stay)
    except (OSError, RuntimeError) as exc:  # links in a circle, a working folder that is gone
        reason = getattr(exc, "strerror", None) or "leads to no file"
        raise StoreError(f"{output}: cannot be written: {reason}") from exc


def _remove_temporaries(place: Path) -> None:
    """Half-written files of processes that were killed: nobody else writes this output now."""
    own = re.compile(rf"\.{re.escape(place.name)}\.([0-9]+\.)?tmp")
    for path in place.parent.iterdir():
        if own.fullmatch(path.name):
            with suppress(OSError):
                path.unlink()
