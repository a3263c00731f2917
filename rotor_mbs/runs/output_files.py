"""Write output files of every kind.

A file has a temporary name until it is complete. It does not replace a file of another program, and
only one process writes it at a time.
"""

from __future__ import annotations

import os
import re
import secrets
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from rotor_mbs.errors import InputError, StoreError

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer as Buffer

_LARGEST_REPLACED = 1 << 28  # bytes; a larger file that is not HDF5 is not replaced
# Content of a lock file. The file is empty if its process was killed before it wrote the content.
_OWNER = rb"(process [0-9]+ on [!-~]*)?\Z"


# A lock is a file beside the output. It is removed after the output has been written.


@contextmanager
def locked(output: Path) -> Iterator[None]:
    """Lock a file during the block, so that no other process writes it.

    The thread that has the lock may enter it again. If killed processes have left temporary files
    of the output, these files are removed.

    Parameters
    ----------
    output : the file. A symbolic link and the file that it points to have the same lock.

    Raises
    ------
    InputError
        If another process is writing the file, or another program wrote a file with the name of the
        lock file.
    StoreError
        If the lock file cannot be written.
    """
    from filelock import FileLock, Timeout

    file = _resolved(output)
    path = _lock_of(file)
    lock = FileLock(path, timeout=0, is_singleton=True)
    if lock.is_locked:  # by this thread: a study takes the lock, as do functions that it calls
        yield
        return
    owner = b""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_file():
            with suppress(OSError):
                owner = path.read_bytes()
        if (
            path.is_symlink()
            or (path.exists() and not path.is_file())
            or not re.match(_OWNER, owner)
        ):
            raise InputError(
                f"{path}: was not written by rotor-mbs; allowed: another output, or remove it"
            )
        lock.acquire()
    except Timeout:
        writer = f"another process is writing it now{f' ({owner.decode()})' if owner else ''}"
        raise InputError(
            f"{output}: {writer}; allowed: wait for its end, or another output"
        ) from None
    except OSError as exc:
        raise StoreError(f"{output}: cannot be written: {exc.strerror}") from exc
    try:
        # Killed processes have left these temporary files: nothing else writes this output now.
        temporary = re.compile(rf"\.{re.escape(file.name)}\.([0-9]+\.)?tmp")
        for beside in file.parent.iterdir():
            if temporary.fullmatch(beside.name):
                with suppress(OSError):
                    beside.unlink()
        with suppress(OSError):  # if the disk is full, this is reported when the output is written
            path.write_text(f"process {os.getpid()} on {socket.gethostname()}")
        yield
    finally:
        with suppress(OSError):
            path.unlink()
        lock.release()


def is_being_written(output: Path) -> bool:
    """Return whether a process, this or another, is writing a file, or was killed while it did."""
    return _lock_of(_resolved(output)).exists()


def _lock_of(file: Path) -> Path:
    return file.with_name(f".{file.name}.lock")


def _resolved(output: Path) -> Path:
    """Return the absolute path of an output; if it is a symbolic link, that of its target."""
    try:
        return output.resolve() if output.is_symlink() else Path(os.path.abspath(output))  # noqa: PTH100  (links stay)
    except (OSError, RuntimeError) as exc:  # links in a circle, a working folder that is gone
        reason = getattr(exc, "strerror", None) or "cannot be resolved to a file"
        raise StoreError(f"{output}: cannot be written: {reason}") from exc


@contextmanager
def store_errors(path: object) -> Iterator[None]:
    """Raise an OSError of the block as a StoreError about `path`."""
    try:
        yield
    except OSError as exc:
        raise StoreError(
            f"{path}: cannot be written: {exc.strerror or exc}; nothing stored before is lost"
        ) from exc


def replace_file(path: Path, content: Buffer, mark: bytes) -> None:
    """Write a file; an earlier file is replaced only if it is an output of the same kind.

    See `refuse_foreign` and `write_file`. Raises InputError, StoreError.
    """
    refuse_foreign(path, mark)
    write_file(path, content)


def write_file(path: Path, content: Buffer) -> None:
    """Write a file under a temporary name, force it to the disk, then rename it.

    If `path` is a symbolic link, the link stays, and its target is replaced. If `path` is a device
    or a pipe, the content is written to it directly.

    Parameters
    ----------
    path : path of the file.
    content : content of the file as bytes.

    Raises
    ------
    StoreError
        If the file cannot be written; an earlier file is then unchanged.
    """
    # A device or a pipe, such as /dev/stdout, must not be replaced by a file.
    if path.exists() and not path.is_file() and not path.is_dir():
        with store_errors(path):
            path.write_bytes(content)
        return
    with (
        replacing(path.resolve() if path.is_symlink() else path) as temporary,
        temporary.open("wb") as file,
    ):
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def refuse_foreign(path: Path, mark: bytes) -> None:
    """Raise InputError if an existing file is not an output of the kind that is to replace it.

    This is for outputs that are no HDF5 files. An empty file may be replaced.

    Parameters
    ----------
    path : the file, which may not exist.
    mark : regular expression that every output of the kind contains.

    Raises
    ------
    InputError
        If the file is larger than any output, or does not contain the mark.
    StoreError
        If the file cannot be read.
    """
    if not path.is_file():
        return
    with store_errors(path):
        size = path.stat().st_size
        is_own = size <= _LARGEST_REPLACED and (
            size == 0 or re.search(mark, path.read_bytes()) is not None
        )
    if not is_own:
        raise InputError(
            f"{path}: is not an output of this command and is not replaced; allowed: another name, "
            "or remove that file"
        )


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield the name of a new, empty file that replaces `path` after the block.

    The new file is in the same folder. Its name cannot be guessed, and an existing file or link of
    that name is not opened. If the block raises, `path` is unchanged.

    Parameters
    ----------
    path : the file, which may not exist.

    Raises
    ------
    StoreError
        If `path` is a folder, or the system cannot write the file.
    """
    if path.is_dir():
        raise StoreError(f"{path}: is a folder; allowed: the name of a file")
    temporary = path.with_name(f".{path.name}.{secrets.randbits(60)}.tmp")
    with store_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.open("xb").close()
        try:
            yield temporary
            temporary.replace(path)
            with suppress(OSError):  # makes the new name durable, if the system supports it
                folder = os.open(path.parent, os.O_RDONLY)
                try:
                    os.fsync(folder)
                finally:
                    os.close(folder)
        finally:
            with suppress(OSError):
                temporary.unlink()
