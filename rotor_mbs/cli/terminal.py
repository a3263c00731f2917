"""What the commands print alike: progress, spans of time, the summary of runs."""

from __future__ import annotations

import json
import shutil
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Self, TextIO

if TYPE_CHECKING:  # a sweep's workers load their code meanwhile
    from rotor_mbs.execution.execute import Outcome
    from rotor_mbs.studies.run import RunReport


class _RenewedLine:
    """One line that renews itself on a terminal, plain lines in a log. A context manager that clears it."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._is_terminal = self._stream.isatty()
        self._start = time.monotonic()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._is_terminal:
            self._print("\r\x1b[K", end="")

    def _show(self, text: str, *, keep: bool = False) -> None:
        """keep: it stays on the terminal."""
        if self._is_terminal:
            self._print(f"\r\x1b[K{text[: self._width]}", end="\n" if keep else "")
        else:
            self._print(text)

    def _print(self, text: str, end: str = "\n") -> None:
        print(text, end=end, file=self._stream, flush=True)

    @property
    def _width(self) -> int:
        return shutil.get_terminal_size().columns - 1


class ProgressLine(_RenewedLine):
    """Called after each case."""

    def __call__(self, done: int, total: int, outcome: Outcome) -> None:
        result = outcome.result
        seconds = f" {result.seconds:.3f} s" if result.seconds else ""
        reason = f": {result.message}" if result.message else ""
        text = f"[{done:{len(str(total))}d}/{total}] {outcome.case.label} {result.status}{seconds}{reason}"
        keep = result.status != "ok"  # a person must not miss it
        if self._is_terminal and done < total and not keep:
            left = (time.monotonic() - self._start) / done * (total - done)
            text += f"  ({span(left)} left)"
        self._show(text, keep=keep)


class SweepProgress(_RenewedLine):
    """Called with runs stored, runs in all, and the statuses of those just stored; with a bar, or as JSON lines."""

    def __init__(self, *, as_json: bool = False, stream: TextIO | None = None) -> None:
        super().__init__(stream)
        self._as_json = as_json
        self._is_terminal = self._is_terminal and not as_json
        self._every_s = 0.1 if self._is_terminal else 10.0
        self._shown = self._start
        self._made: Counter[str] = Counter()

    def __call__(self, done: int, total: int, statuses: Counter[str]) -> None:
        self._made += statuses
        now = time.monotonic()
        if not statuses or (now - self._shown < self._every_s and done < total):
            return
        self._shown = now
        rate = self._made.total() / max(now - self._start, 1e-9)
        if self._as_json:
            facts = {"done": done, "total": total, "runs_per_s": round(rate, 3), "statuses": self._made}
            self._show(json.dumps({"event": "progress", **facts}))
            return
        failed = [f"{count} {name}" for name, count in sorted(self._made.items()) if name != "ok"]
        text = ", ".join([f"{done}/{total} runs", f"{rate:.4g} per s", f"{span((total - done) / rate)} left", *failed])
        room = min(40, self._width - len(text) - 3)
        if self._is_terminal and room > 5:
            text = f"[{'#' * (room * done // total):{room}}] {text}"
        self._show(text)


def span(seconds: float) -> str:
    """A length of time in s, min, h or days."""
    for length, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2.0 * length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.0f} s" if seconds >= 10.0 else f"{seconds:.1f} s"


def print_summary(report: RunReport, output: Path) -> int:
    """The runs in a few lines; the exit status: 1 where a run that should succeed did not, or was not computed."""
    lost = report.not_computed
    print_not_computed(lost)
    counts = {"failed": len(report.failures), "printed broke off": len(report.broken_off), "not computed": len(lost)}
    parts = [f"{len(report.made) - sum(counts.values())} ok", *(f"{n} {what}" for what, n in counts.items() if n)]
    made = f"{len(report.made)} runs made ({', '.join(parts)})" if report.made else "nothing to do"
    print(f"{output}: {made}, {report.kept} there already")
    return 1 if report.failures or lost else 0


def print_not_computed(lost: Sequence[Outcome]) -> None:
    """The cases whose process died or could not start, a line each."""
    for one in lost:
        print(f"{one.case.label}: not computed ({one.result.message}); the same command tries again", file=sys.stderr)
