"""How every command writes an output: locked against other processes, with one folder beside it for unfinished work.

The folder `<output>.parts` has the lock, the kind of the output, and what is finished but not yet in the output. It
goes when nothing is left in it. Only files of known names are ever removed from it. Knows nothing of their contents.
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

RESULTS, SWEEP = "results", "sweep"
_LOCK, _KIND = "lock", "kind"
_OWN = re.compile(r"lock|kind|[0-9a-f]{64}\.h5|\.[0-9a-f]{64}\.h5\.[0-9]+\.tmp")
_COMMANDS = {RESULTS: "rotor-mbs run", SWEEP: "rotor-mbs sweep"}

# Outputs that this process is writing, by thread: a study takes the lock, and so does what it calls.
_held: dict[tuple[Path, int], str] = {}


@contextmanager
def writing(output: Path, kind: str) -> Iterator[Path]:
    """The folder of unfinished work of `output`, which no other process writes in the block; it may be entered again.

    kind   RESULTS or SWEEP: unfinished work of the other kind is refused

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
        _prepare(parts, kind)
        lock.acquire()
    except Timeout:
        owner = _noted(parts, 1)
        writer = f"another process is writing it now{f' ({owner})' if owner else ''}"
        raise InputError(f"{output}: {writer}; allowed: wait for its end, or another output") from None
    except OSError as exc:
        raise StoreError(f"{output}: cannot be written: {exc.strerror}") from exc
    _held[own] = kind
    try:
        _remove_temporaries(place, parts)
        with suppress(OSError):  # a full disk is reported by what is written to the output
            (parts / _KIND).write_text(f"{kind}\nprocess {os.getpid()} on {socket.gethostname()}\n")
        yield parts
    finally:
        del _held[own]
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


def _prepare(parts: Path, kind: str) -> None:
    """Makes the folder. Raises InputError where it has unfinished work of another kind, or a foreign file."""
    parts.mkdir(parents=True, exist_ok=True)
    names = {path.name: path.is_file() and not path.is_symlink() for path in parts.iterdir()}
    foreign = sorted(name for name, is_plain in names.items() if not (is_plain and _OWN.fullmatch(name)))
    if foreign:
        raise InputError(f"{parts}: has {foreign[0]}, a foreign file; allowed: another output, or remove it")
    found = _noted(parts, 0)
    if found not in ("", kind) and any(name.endswith(".h5") for name in names):
        raise InputError(
            f"{parts}: has unfinished work of `{_COMMANDS.get(found, found)}`; allowed: to finish that, "
            "another output, or remove this folder"
        )


def _noted(parts: Path, line: int) -> str:
    """A line of what the writer of the output notes: its kind, its process; "" where there is none."""
    with suppress(OSError, UnicodeDecodeError, IndexError):
        return (parts / _KIND).read_text().splitlines()[line]
    return ""


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
        for name in (_KIND, _LOCK):
            with suppress(OSError):
                (parts / name).unlink()
        with suppress(OSError):
            parts.rmdir()
