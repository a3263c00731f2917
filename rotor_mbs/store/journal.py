"""Which runs are stored: receipts, appended to one file, on the disk before anyone is told.

    header   magic, length, JSON (what is stored, and where), checksum
    record   magic, first run, number of runs, their bytes' checksum, length of the rest, checksum over all of it;
             the statuses, then the messages as JSON
A torn tail fails its checksum and is cut off when the file is opened. Knows receipts, not what they are for.
"""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.store.sweep_rows import Receipt, write_at

_FILE = struct.Struct("<8sI")
_RECORD = struct.Struct("<4sQIIII")
_MAGIC, _MARK = b"RMBSJRN2", b"done"


class Journal:
    """Receipts in the order in which they came.

    Raises InputError where the file is about something else, StoreError where it cannot be read or written.
    """

    def __init__(self, path: Path, facts: Mapping[str, object]) -> None:
        self.path = path
        header = json.dumps(facts, sort_keys=True).encode()
        self._header = _FILE.pack(_MAGIC, len(header)) + header + zlib.crc32(header).to_bytes(4, "little")
        try:
            self._file = self._opened()
            try:
                self.found, self._end = self._read()
                self._file.truncate(self._end)
            except BaseException:
                self._file.close()
                raise
        except OSError as exc:
            raise StoreError(f"{path}: cannot be written: {exc.strerror}") from exc

    def append(self, receipts: Iterable[Receipt]) -> None:
        """Returns when they are on the disk. What was there stays whole if that fails."""
        content = b"".join(map(_packed, receipts))
        try:
            write_at(self._file, self._end, content)
            os.fsync(self._file.fileno())
        except OSError as exc:
            with suppress(OSError):
                self._file.truncate(self._end)
            raise StoreError(f"{self.path}: cannot be written: {exc.strerror}; nothing stored before is lost") from exc
        self._end += len(content)

    def close(self) -> None:
        self._file.close()

    def _opened(self) -> BinaryIO:
        if not self.path.exists():
            temporary = self.path.with_name(self.path.name + ".tmp")
            with temporary.open("wb") as file:
                file.write(self._header)
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(self.path)
            sync_folder(self.path.parent)
        return self.path.open("r+b", buffering=0)

    def _read(self) -> tuple[list[Receipt], int]:
        """All whole records, and where the last of them ends."""
        content = self._file.read()
        end = len(self._header)
        if content[:end] != self._header:
            raise InputError(
                f"{self.path}: holds the runs of another sweep, or of another version; allowed: another output file, "
                "or remove this folder"
            )
        found = []
        while len(content) - end >= _RECORD.size:
            mark, first, count, checksum, length, own = _RECORD.unpack_from(content, end)
            rest = content[end + _RECORD.size : end + _RECORD.size + length]
            if mark != _MARK or len(rest) != length or own != _own_checksum(first, count, checksum, rest):
                break
            messages = json.loads(rest[count:]) if length > count else []
            found.append(Receipt(first, checksum, rest[:count], tuple((run, text) for run, text in messages)))
            end += _RECORD.size + length
        return found, end


def _packed(receipt: Receipt) -> bytes:
    rest = receipt.statuses + (json.dumps(receipt.messages).encode() if receipt.messages else b"")
    first, count, checksum = receipt.first, len(receipt.statuses), receipt.checksum
    return _RECORD.pack(_MARK, first, count, checksum, len(rest), _own_checksum(first, count, checksum, rest)) + rest


def _own_checksum(first: int, count: int, checksum: int, rest: bytes) -> int:
    return zlib.crc32(rest, zlib.crc32(struct.pack("<QIII", first, count, checksum, len(rest))))


def sync_folder(folder: Path) -> None:
    """Makes a new or replaced name in `folder` durable, where the system can."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
