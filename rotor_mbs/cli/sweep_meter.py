"""How far a sweep is: a bar with rate and remaining time on a terminal, a line now and then in a log, or JSON lines."""

from __future__ import annotations

import json
import shutil
import sys
import time
from collections import Counter
from typing import TextIO

_LIVE_EVERY_S = 0.1
_LOG_EVERY_S = 10.0


class Meter:
    """Counts runs by status; called with runs stored, runs in all, and the statuses of those just stored."""

    def __init__(self, *, as_json: bool = False, stream: TextIO | None = None) -> None:
        self._json = as_json
        self._stream = sys.stderr if stream is None else stream
        self._live = self._stream.isatty() and not as_json
        self._start = self._shown = time.monotonic()
        self.made: Counter[str] = Counter()

    def __call__(self, done: int, total: int, statuses: Counter[str]) -> None:
        self.made += statuses
        now = time.monotonic()
        if statuses and (now - self._shown >= (_LIVE_EVERY_S if self._live else _LOG_EVERY_S) or done == total):
            self._shown = now
            self._show(done, total, now - self._start)

    def close(self) -> None:
        """Clears the bar."""
        if self._live:
            print("\r\x1b[K", end="", file=self._stream, flush=True)

    def _show(self, done: int, total: int, spent: float) -> None:
        rate = self.made.total() / spent if spent > 0.0 else 0.0
        left = (total - done) / rate if rate else float("inf")
        if self._json:
            facts = {"done": done, "total": total, "runs_per_s": round(rate, 3), "statuses": self.made}
            print(json.dumps({"event": "progress", **facts}), file=self._stream, flush=True)
            return
        text = f"{done}/{total} runs, {rate:.4g} per s, {_span(left)} left"
        failed = {name: count for name, count in self.made.items() if name != "ok"}
        if failed:
            text += ", " + ", ".join(f"{count} {name}" for name, count in sorted(failed.items()))
        if not self._live:
            print(text, file=self._stream, flush=True)
            return
        width = shutil.get_terminal_size().columns - 1
        room = max(min(40, width - len(text) - 3), 0)
        filled = room * done // total
        bar = f"[{'#' * filled}{' ' * (room - filled)}] " if room > 5 else ""
        print(f"\r\x1b[K{(bar + text)[:width]}", end="", file=self._stream, flush=True)


def _span(seconds: float) -> str:
    if seconds == float("inf"):
        return "unknown time"
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.1f} h"
