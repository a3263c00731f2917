"""How every command writes an output: locked against other processes, with one folder beside it for unfinished work.

The folder `<output>.parts` has the lock, who holds it, and what is finished but not yet in the output. It goes when
nothing is left in it. Only files of known names are ever removed from it. Knows nothing of their contents.
"""

from __future__ import annotations

import os
import re
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rotor_mbs.errors import InputError, StoreError

_LOCK, _OWNER = "lock", "owner"
_OWN = re.compile(r"lock|owner|[0-9a-f]{64}\.h5|\.[0-9a-f]{64}\.h5\.[0-9]+\.tmp")

# Outputs that this process is writing, by thread: a study takes the lock, and so does what it calls.
_held: set[tuple[Path, int]] = set()


@contextmanager
def writing(output: Path) -> Iterator[Path]:
    """The folder of unfinished work of `output`, which no other process writes in the block; it may be entered again.

    Raises InputError where another process is writing it or the folder has something else, StoreError.
    """
    place, parts = _resolved(output), _parts_of(output)
    own = place, threading.get_ident()
    if own in _held:
        yield parts
        return
    from filelock import FileLock, Timeout

    lock = FileLock(parts / _LOCK, timeout=0)
    try:
        parts.mkdir(parents=True, exist_ok=True)
        _refuse_foreign_files(parts)
        lock.acquire()
    except Timeout:
        owner = ""
        with suppress(OSError, UnicodeDecodeError):
            owner = (parts / _OWNER).read_text()
        writer = f"another process is writing it now{f' ({owner})' if owner else ''}"
        raise InputError(f"{output}: {writer}; allowed: wait for its end, or another output") from None
    except OSError as exc:
        raise StoreError(f"{output}: cannot be written: {exc.strerror}") from exc
    _held.add(own)
    try:
        _remove_temporaries(place, parts)
        with suppress(OSError):  # a full disk is reported by what is written to the output
            (parts / _OWNER).write_text(f"process {os.getpid()} on {socket.gethostname()}")
        yield parts
    finally:
        _held.remove(own)
        _leave(parts)
        lock.release()


def has_unfinished(output: Path) -> bool:
    """Whether another process writes it now, or finished work waits to be taken into it."""
    return _parts_of(output).exists()


def _parts_of(output: Path) -> Path:
    place = _resolved(output)
    return place.with_name(f"{place.name}.parts")


def _resolved(output: Path) -> Path:
    """The file itself where the output is a symbolic link: both names are one output."""
    try:
        return output.resolve() if output.is_symlink() else Path(os.path.abspath(output))  # noqa: PTH100  (links stay)
    except (OSError, RuntimeError) as exc:  # links in a circle, a working folder that is gone
        reason = getattr(exc, "strerror", None) or "leads to no file"
        raise StoreError(f"{output}: cannot be written: {reason}") from exc


def refuse_finished_runs(parts: Path) -> None:
    """Raises InputError where a batch of runs was interrupted, whose output would be another file than this."""
    if any(path.suffix == ".h5" for path in parts.iterdir()):
        raise InputError(
            f"{parts}: has unfinished work of `rotor-mbs run`; allowed: to finish that, another output, or remove this "
            "folder"
        )


def _refuse_foreign_files(parts: Path) -> None:
    names = {path.name: path.is_file() and not path.is_symlink() for path in parts.iterdir()}
    foreign = sorted(name for name, is_plain in names.items() if not (is_plain and _OWN.fullmatch(name)))
    if foreign:
        raise InputError(f"{parts}: has {foreign[0]}, a foreign file; allowed: another output, or remove it")


def _remove_temporaries(place: Path, parts: Path) -> None:
    """Half-written files of processes that were killed: nobody else writes this output now."""
    own = re.compile(rf"\.{re.escape(place.name)}\.([0-9]+\.)?tmp")
    found = [path for path in place.parent.iterdir() if own.fullmatch(path.name)]
    found += [path for path in parts.iterdir() if path.suffix == ".tmp" and _OWN.fullmatch(path.name)]
    for path in found:
        with suppress(OSError):
            path.unlink()


def _leave(parts: Path) -> None:
    """The folder goes where no finished part is left in it; what is not this program's stays."""
    if not any(path.suffix == ".h5" for path in parts.iterdir()):
        for name in (_OWNER, _LOCK):
            with suppress(OSError):
                (parts / name).unlink()
        with suppress(OSError):
            parts.rmdir()
