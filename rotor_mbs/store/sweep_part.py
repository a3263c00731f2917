"""One file of a sweep while it goes on: its data, growing in their places, and the journal of what is whole.

    0001-<identity>.data   the dataset that is to be, without what the library writes around the runs
    0001.journal           receipts of the runs in it
When all runs are there, the data file is completed, synced and renamed.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

from rotor_mbs.errors import StoreError
from rotor_mbs.store.journal import Journal, sync_folder
from rotor_mbs.store.sweep_file import SweepFile
from rotor_mbs.store.sweep_layout import Plan
from rotor_mbs.store.sweep_rows import Places, Receipt


class SweepPart:
    """The runs first ... last - 1 on their way to `output`. Raises InputError, StoreError as the journal does."""

    def __init__(self, journal: Path, plan: Plan, first: int, last: int, output: Path) -> None:
        self.first, self.last, self._output = first, last, output
        self._dataset = SweepFile(plan, first, last)
        # Named for the sweep: a worker of an earlier one that is still about to end has no way into this file.
        self._path = journal.with_name(f"{journal.stem}-{zlib.crc32(plan.identity.encode()):08x}.data")
        self.places = self._dataset.places(self._path)
        self._journal_path = journal
        self._facts = {"identity": plan.identity, "first": first, "last": last, "places": _fingerprint(self.places)}
        self._journal: Journal | None = None
        self._messages: dict[int, str] = {}
        self._data = self._opened()

    def restored(self) -> Iterator[Receipt]:
        """What an earlier process stored, as far as the data are what their receipts say."""
        if not self._journal_path.exists():
            return
        for receipt in self._opened_journal().found:
            start = receipt.first - self.first
            places = self.places.part(start, start + len(receipt.statuses))
            if places.checksum_in(self._data) == receipt.checksum:
                self._messages |= dict(receipt.messages)
                yield receipt

    def note(self, receipts: Sequence[Receipt]) -> None:
        """Makes runs count that are in their places; returns when all that is durable. Raises StoreError."""
        try:
            os.fsync(self._data.fileno())
        except OSError as exc:
            raise self._failure(exc) from exc
        self._opened_journal().append(receipts)
        for receipt in receipts:
            self._messages |= dict(receipt.messages)

    def finish(self) -> None:
        """Turns the data into the output, atomically, and removes the journal. All runs must be there."""
        try:
            self._dataset.complete(self._data, self._messages)
            os.fsync(self._data.fileno())
            self._data.close()
            self._path.replace(self._output)
        except OSError as exc:
            raise self._failure(exc) from exc
        sync_folder(self._output.parent)
        self.close()
        self._journal_path.unlink(missing_ok=True)

    def close(self) -> None:
        self._dataset.close()
        self._data.close()
        if self._journal is not None:
            self._journal.close()

    def _opened(self) -> BinaryIO:
        try:
            self._path.touch()
            return self._path.open("r+b", buffering=0)
        except OSError as exc:
            raise self._failure(exc) from exc

    def _opened_journal(self) -> Journal:
        """Made with the first runs: a sweep that stored none leaves nothing behind."""
        if self._journal is None:
            self._journal = Journal(self._journal_path, self._facts)
        return self._journal

    def _failure(self, exc: OSError) -> StoreError:
        return StoreError(f"{self._output}: cannot be written: {exc.strerror}; nothing stored before is lost")


def _fingerprint(places: Places) -> int:
    """Of where everything lies: another version of the file library may have it elsewhere."""
    checksum = 0
    for name, column in places.columns.items():
        checksum = zlib.crc32(column.tobytes(), zlib.crc32(name.encode(), checksum))
    return checksum
