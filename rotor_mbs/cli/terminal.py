"""What the commands print alike: progress of cases, the summary of runs."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Self, TextIO

from rotor_mbs.execution.execute import Outcome
from rotor_mbs.studies.run import RunReport


class ProgressLine:
    """Called after each case: one line that renews itself on a terminal, a plain line per case in a log."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._is_terminal = self._stream.isatty()
        self._start = time.monotonic()

    def __call__(self, done: int, total: int, outcome: Outcome) -> None:
        result = outcome.result
        seconds = f" {result.seconds:.3f} s" if result.seconds else ""
        reason = f": {result.message}" if result.message else ""
        line = f"[{done:{len(str(total))}d}/{total}] {outcome.case.label} {result.status}{seconds}{reason}"
        if not self._is_terminal:
            print(line, file=self._stream, flush=True)
            return
        keep = result.status != "ok"  # what a person must not miss stays on the terminal
        left = (time.monotonic() - self._start) / done * (total - done)
        text = f"{line}  ({left:.0f} s left)" if done < total and not keep else line
        width = shutil.get_terminal_size().columns - 1
        print(f"\r\x1b[K{text[:width]}", end="\n" if keep else "", file=self._stream, flush=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._is_terminal:
            print("\r\x1b[K", end="", file=self._stream, flush=True)


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
