"""How far a batch is: one line that renews itself on a terminal, a plain line per run in a log."""

from __future__ import annotations

import shutil
import sys
import time
from typing import TextIO


class Progress:
    """Counts finished runs of `total` and tells each; `stream` is standard error unless told."""

    def __init__(self, total: int, stream: TextIO | None = None) -> None:
        self._total = total
        self._done = 0
        self._stream = sys.stderr if stream is None else stream
        self._live = self._stream.isatty()
        self._start = time.monotonic()

    def tell(self, what: str, *, keep: bool = False) -> None:
        """One more is done; `keep` leaves its line standing on a terminal (what a person must not miss)."""
        self._done += 1
        line = f"[{self._done:{len(str(self._total))}d}/{self._total}] {what}"
        if not self._live:
            print(line, file=self._stream, flush=True)
            return
        spent = time.monotonic() - self._start
        left = spent / self._done * (self._total - self._done)
        width = shutil.get_terminal_size().columns - 1
        text = f"{line}  ({left:.0f} s left)" if self._done < self._total and not keep else line
        print(f"\r\x1b[K{text[:width]}", end="\n" if keep else "", file=self._stream, flush=True)

    def close(self) -> None:
        """Clears the live line."""
        if self._live:
            print("\r\x1b[K", end="", file=self._stream, flush=True)
