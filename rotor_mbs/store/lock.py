"""One writer per folder: a lock that the operating system gives back when its holder ends, however it ends."""

from __future__ import annotations

import os
from pathlib import Path

from rotor_mbs.errors import InputError, StoreError


class FolderLock:
    """Held from its making until `release`. Raises InputError where another process holds it."""

    def __init__(self, folder: Path, owner: Path) -> None:
        self._path = folder / "lock"
        self._file = self._locked(owner)

    def release(self) -> None:
        """Gives it back; removing the folder before makes sure that nobody waits on a file that is gone."""
        os.close(self._file)

    def _locked(self, owner: Path) -> int:
        while True:
            try:
                self._path.parent.mkdir(parents=True, exist_ok=True)
                file = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o644)
            except FileNotFoundError:  # its last holder removed the folder in between
                continue
            except OSError as exc:
                raise StoreError(f"{owner}: cannot be written: {exc.strerror}") from exc
            if not _try_lock(file):
                os.close(file)
                raise InputError(
                    f"{owner}: another sweep is writing it now; allowed: wait for its end, or another output file"
                )
            if self._is_current(file):
                return file
            os.close(file)

    def _is_current(self, file: int) -> bool:
        """Whether the locked file is still the one in the folder: its last holder may have removed it."""
        try:
            return os.path.samestat(os.fstat(file), self._path.stat())
        except FileNotFoundError:
            return False


def _try_lock(file: int) -> bool:
    try:
        import fcntl
    except ImportError:
        return _try_lock_on_windows(file)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _try_lock_on_windows(file: int) -> bool:
    import msvcrt

    try:
        msvcrt.locking(file, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
    except OSError:
        return False
    return True
