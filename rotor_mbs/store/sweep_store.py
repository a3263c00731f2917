"""A sweep's runs on the disk: journals while it goes on, datasets of bounded size when they are complete.

One sweep writes to an output at a time. What has been added survives any end of this process.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.store.journal import Journal, Rows
from rotor_mbs.store.lock import FolderLock
from rotor_mbs.store.sweep_file import Plan, identity_of, statuses_of, write_dataset

_MISSING = -1

# The library keeps an index of a file's chunks in memory while it writes, 1.2 kB a run.
_MOST_RUNS = 100_000


def runs_per_file(file_bytes: int, row_bytes: int) -> int:
    """As many as fit, one at least, and no more than can be written in bounded memory."""
    return min(max(file_bytes // row_bytes, 1), _MOST_RUNS)


class SweepStore:
    """The runs first ... last - 1 of a sweep under `output`; a context manager that holds its lock.

    More runs than fit into one file of `file_bytes` (100,000 at most) go to output-0001.h5, output-0002.h5, ...
    Raises InputError where the output is another's, StoreError where it cannot be read or written.
    """

    def __init__(self, output: Path, plan: Plan, first: int, last: int, file_bytes: int) -> None:
        self._output, self._plan, self._first, self._last = output, plan, first, last
        self._per_file = runs_per_file(file_bytes, plan.row.itemsize)
        self._folder = output.with_name(output.name + ".parts")
        self._statuses = np.full(last - first, _MISSING, np.int8)
        self._journals: dict[int, Journal] = {}

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
        """(first, last) of every gap."""
        gaps = np.flatnonzero(self._statuses == _MISSING)
        spans = np.split(gaps, np.flatnonzero(np.diff(gaps) != 1) + 1) if len(gaps) else []
        return [(self._first + int(span[0]), self._first + int(span[-1]) + 1) for span in spans]

    def add(self, blocks: Sequence[tuple[int, Rows]]) -> None:
        """Adds (first run, rows); returns when they are durable. A block may lie in two files."""
        for part in sorted({self._part(run) for first, rows in blocks for run in (first, first + len(rows) - 1)}):
            start, end = self._span(part)
            inside = [
                (max(first, start), rows[max(start - first, 0) : max(end - first, 0)])
                for first, rows in blocks
                if first < end and first + len(rows) > start
            ]
            self._journal(part).append(inside)
            for first, rows in inside:
                self._note(first, rows)
            self._finish_if_complete(part)

    def complete(self) -> None:
        """Writes the files whose runs were all there already when this was opened. Raises StoreError."""
        for part in list(self._journals):
            self._finish_if_complete(part)

    def _part(self, run: int) -> int:
        return (run - self._first) // self._per_file

    def _span(self, part: int) -> tuple[int, int]:
        start = self._first + part * self._per_file
        return start, min(start + self._per_file, self._last)

    def _note(self, first: int, rows: Rows) -> None:
        start = first - self._first
        self._statuses[start : start + len(rows)] = rows["status"]

    def _journal_path(self, part: int) -> Path:
        return self._folder / f"{part + 1:04d}.journal"

    def _journal(self, part: int) -> Journal:
        if part not in self._journals:
            start, end = self._span(part)
            identity = f"{self._plan.identity} {self._per_file}"
            self._journals[part] = Journal(self._journal_path(part), identity, start, end - start, self._plan.row)
        return self._journals[part]

    def _open_part(self, part: int) -> None:
        path = self.files[part]
        start, end = self._span(part)
        if path.exists():
            self._take_finished(path, start, end)
            self._journal_path(part).unlink(missing_ok=True)
        elif self._journal_path(part).exists():
            for first, rows in self._journal(part).stored():
                self._note(first, rows)

    def _take_finished(self, path: Path, start: int, end: int) -> None:
        found = statuses_of(path) if identity_of(path) == self._plan.identity else np.empty(0, np.int8)
        if len(found) != end - start:
            raise InputError(
                f"{path}: holds something else than this sweep (or a sweep of another version); allowed: another "
                "output file, or remove that one"
            )
        self._statuses[start - self._first : end - self._first] = found

    def _finish_if_complete(self, part: int) -> None:
        start, end = self._span(part)
        if (self._statuses[start - self._first : end - self._first] == _MISSING).any():
            return
        journal = self._journal(part)
        write_dataset(self.files[part], self._plan, start, end, journal.read)
        journal.close()
        del self._journals[part]
        journal.path.unlink()

    def _close(self) -> None:
        for journal in self._journals.values():
            journal.close()
        self._journals.clear()
        if not any(self._folder.glob("*.journal")):
            try:
                shutil.rmtree(self._folder)
            except OSError as exc:
                raise StoreError(f"{self._folder}: cannot be removed: {exc.strerror}") from exc
        self._lock.release()
