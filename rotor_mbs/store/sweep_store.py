"""A sweep's runs on the disk: parts in a folder while it goes on, datasets of bounded size when they are complete.

One sweep writes to an output at a time. What has been noted survives any end of this process.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.store.lock import FolderLock
from rotor_mbs.store.sweep_layout import Plan
from rotor_mbs.store.sweep_rows import Places, Receipt, Rows, count_of, part_of

if TYPE_CHECKING:  # the file library behind it is loaded when the first runs are on their way
    from rotor_mbs.store.sweep_part import SweepPart

_MISSING = -1

# The library's index of a file's chunks is held in memory while the file fills, 0.9 kB a run.
_MOST_RUNS = 100_000

# What a file takes beside its runs: descriptions, texts and messages, and an index entry for each dataset of a run.
_HEAD_BYTES = 60_000
_INDEX_BYTES = 140


def runs_per_file(file_bytes: int, plan: Plan) -> int:
    """As many as fit, one at least, and no more than can be written in bounded memory."""
    chunked = sum(plan.row[name].ndim > 0 for name in plan.row.names or ())
    run_bytes = plan.row.itemsize + _INDEX_BYTES * chunked + 8 * len(plan.keys)
    return min(max((file_bytes - _HEAD_BYTES) // run_bytes, 1), _MOST_RUNS)


class SweepStore:
    """The runs first ... last - 1 of a sweep under `output`; a context manager that holds its lock.

    More runs than fit into one file of `file_bytes` (100,000 at most) go to output-0001.h5, output-0002.h5, ...
    Raises InputError where the output is another's, StoreError where it cannot be read or written.
    """

    def __init__(self, output: Path, plan: Plan, first: int, last: int, file_bytes: int) -> None:
        output = output.resolve() if output.is_symlink() else output  # a link stays one
        self._output, self._plan, self._first, self._last = output, plan, first, last
        self._per_file = runs_per_file(file_bytes, plan)
        self._folder = output.with_name(output.name + ".parts")
        self._statuses = np.full(last - first, _MISSING, np.int8)
        self._parts: dict[int, SweepPart] = {}

    def __enter__(self) -> SweepStore:
        self._lock = FolderLock(self._folder, self._output)
        try:
            for part in range(len(self.files)):
                self._open_part(part)
        except BaseException:
            self._close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._close()

    @property
    def files(self) -> list[Path]:
        count = -(-(self._last - self._first) // self._per_file)
        if count <= 1:
            return [self._output]
        names = (f"{self._output.stem}-{i + 1:04d}{self._output.suffix}" for i in range(count))
        return [self._output.with_name(name) for name in names]

    @property
    def statuses(self) -> NDArray[np.int8]:
        """(runs,) codes of SWEEP_STATUSES; below 0 where a run is missing."""
        return self._statuses

    def missing(self) -> list[tuple[int, int]]:
        """(first, last) of every gap; none reaches from one file into the next."""
        gaps = np.flatnonzero(self._statuses == _MISSING)
        ends = (np.diff(gaps) != 1) | (np.diff(gaps // self._per_file) != 0)
        spans = np.split(gaps, np.flatnonzero(ends) + 1) if len(gaps) else []
        return [(self._first + int(span[0]), self._first + int(span[-1]) + 1) for span in spans]

    def places(self, first: int, last: int) -> Places:
        """Where these runs, all of one file, are to be put. Raises StoreError."""
        part = self._part(first)
        return part.places.part(first - part.first, last - part.first)

    def add(self, blocks: Sequence[tuple[int, Rows]]) -> None:
        """Puts (first run, rows) into their places and notes them. A block may lie in two files."""
        self.note([receipt for first, rows in blocks for receipt in self._put(first, rows)])

    def note(self, receipts: Sequence[Receipt]) -> None:
        """Makes runs count that are in their places; returns when all that is durable. Raises StoreError."""
        by_part: dict[int, list[Receipt]] = {}
        for receipt in receipts:
            by_part.setdefault(self._number(receipt.first), []).append(receipt)
        for number, those in by_part.items():
            self._part(those[0].first).note(those)
            for receipt in those:
                self._count(receipt)
            self._finish_if_complete(number)

    def complete(self) -> None:
        """Writes the files whose runs were all there already when this was opened. Raises StoreError."""
        for number in list(self._parts):
            self._finish_if_complete(number)

    def _put(self, first: int, rows: Rows) -> Iterator[Receipt]:
        last = first + count_of(rows)
        for number in range(self._number(first), self._number(last - 1) + 1):
            span = self._span(number)
            start, end = max(first, span[0]), min(last, span[1])
            yield self.places(start, end).put(part_of(rows, start - first, end - first))

    def _number(self, run: int) -> int:
        return (run - self._first) // self._per_file

    def _journal(self, number: int) -> Path:
        return self._folder / f"{number + 1:04d}.journal"

    def _span(self, number: int) -> tuple[int, int]:
        start = self._first + number * self._per_file
        return start, min(start + self._per_file, self._last)

    def _count(self, receipt: Receipt) -> None:
        start = receipt.first - self._first
        codes = np.frombuffer(receipt.statuses, np.int8)
        self._statuses[start : start + len(codes)] = codes

    def _part(self, run: int) -> SweepPart:
        from rotor_mbs.store.sweep_part import SweepPart

        number = self._number(run)
        if number not in self._parts:
            start, end = self._span(number)
            self._parts[number] = SweepPart(self._journal(number), self._plan, start, end, self.files[number])
        return self._parts[number]

    def _open_part(self, number: int) -> None:
        path = self.files[number]
        start, end = self._span(number)
        journal = self._journal(number)
        if path.exists():
            self._take_finished(path, start, end)
            journal.unlink(missing_ok=True)
        elif journal.exists():
            for receipt in self._part(start).restored():
                self._count(receipt)

    def _take_finished(self, path: Path, start: int, end: int) -> None:
        from rotor_mbs.store.sweep_file import identity_of, statuses_of

        found = statuses_of(path) if identity_of(path) == self._plan.identity else np.empty(0, np.int8)
        if len(found) != end - start:
            raise InputError(
                f"{path}: holds something else than this sweep (or a sweep of another version); allowed: another "
                "output file, or remove that one"
            )
        self._statuses[start - self._first : end - self._first] = found

    def _finish_if_complete(self, number: int) -> None:
        start, end = self._span(number)
        if (self._statuses[start - self._first : end - self._first] == _MISSING).any():
            return
        self._part(start).finish()
        del self._parts[number]

    def _close(self) -> None:
        for part in self._parts.values():
            part.close()
        self._parts.clear()
        if not any(self._folder.glob("*.journal")):
            try:
                shutil.rmtree(self._folder)
            except OSError as exc:
                raise StoreError(f"{self._folder}: cannot be removed: {exc.strerror}") from exc
        self._lock.release()
