"""What the commands print alike: progress, spans of time, the summary of runs."""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
import threading
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Self, TextIO

from rotor_mbs.cli import printable
from rotor_mbs.solution.status import GOOD, STATUSES

if TYPE_CHECKING:  # a sweep's workers load their code meanwhile
    from rotor_mbs.scenario.scene import Scene
    from rotor_mbs.solution.text_table import TextTable
    from rotor_mbs.studies.run import Outcome, RunReport


# How a status is coloured on a terminal: well; open to doubt; anything else went wrong.
_COLOURS = {"ok": "32", "inaccurate": "33", "unchecked": "33"}
_BAD = "31"
_STATUS = re.compile(rf"\b({'|'.join((*STATUSES, 'no_reference'))})\b")


def coloured(text: str, stream: TextIO) -> str:
    """The statuses in a text each in its colour: on a terminal, unless the user asks for none (https://no-color.org)."""
    if not stream.isatty() or "NO_COLOR" in os.environ:
        return text
    return _STATUS.sub(lambda found: f"\x1b[{_COLOURS.get(found[0], _BAD)}m{found[0]}\x1b[0m", text)


def print_table(table: TextTable) -> None:
    """On standard output, after an empty line; nothing where it has no rows."""
    if table.rows:
        print_text(str(table))


def print_text(text: str) -> None:
    """On standard output, after an empty line, with its statuses coloured on a terminal."""
    text, stream = printable(text), getattr(sys.stdout, "unfiltered", sys.stdout)
    print("", coloured(text, stream), sep="\n", file=stream)


class _RenewedLine:
    """One line that renews itself on a terminal, plain lines in a log. A context manager that clears it.

    On a terminal it is renewed every second, so that a long run is no silence.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._is_terminal = self._stream.isatty()
        self._start = time.monotonic()
        self._text = "starting"
        self._lock = threading.Lock()
        self._ended = threading.Event()

    def __enter__(self) -> Self:
        if self._is_terminal:
            threading.Thread(target=self._renew, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        with self._lock:
            if self._is_terminal:
                self._print("\r\x1b[K", end="")

    def _renew(self) -> None:
        while not self._ended.is_set():
            with self._lock:
                if self._text and not self._ended.is_set():
                    self._print_over(self._text)
            self._ended.wait(1.0)

    def _show(self, text: str, *, keep: bool = False) -> None:
        """keep: it stays on the terminal, whole."""
        with self._lock:
            text = printable(text)
            self._text = "" if keep else text
            if not self._is_terminal:
                self._print(text)
            elif keep:
                self._print(f"\r\x1b[K{coloured(text, self._stream)}")
            else:
                self._print_over(text)

    def _print_over(self, text: str) -> None:
        elapsed = f"  {span(time.monotonic() - self._start)}"
        self._print(f"\r\x1b[K{text[: self._width - len(elapsed)]}{elapsed}", end="")

    def _print(self, text: str, end: str = "\n") -> None:
        """A progress that nobody can read any more must not end the work."""
        with suppress(OSError, ValueError):
            print(text, end=end, file=getattr(self._stream, "unfiltered", self._stream), flush=True)

    @property
    def _width(self) -> int:
        return shutil.get_terminal_size().columns - 1


class ProgressLine(_RenewedLine):
    """Called after each run. What is left is estimated from the work done, not from the number of runs.

    parts: shares of the work, in order, of the lists of runs and of the stages that a command has. Where the lists are
    more than these, each is estimated by itself.
    """

    def __init__(self, stream: TextIO | None = None, parts: Sequence[float] = (1.0,)) -> None:
        super().__init__(stream)
        self._parts = parts
        self._part = -1
        self._last = self._part_start = self._start

    def __call__(self, done: int, total: int, outcome: Outcome) -> None:
        if done == 1:
            self._begin_part()
        self._last = time.monotonic()
        seconds = f" {outcome.seconds:.3f} s" if outcome.seconds > 0.0 else ""
        if outcome.is_shipped:
            seconds = " (read, not computed)"
        reason = f": {outcome.message}" if outcome.message else ""
        text = f"[{done:{len(str(total))}d}/{total}] {outcome.label} {outcome.status}{seconds}{reason}"
        keep = outcome.status not in GOOD  # a person must not miss it
        self._show(text if keep else self._estimate(outcome.share) + text, keep=keep)

    def stage(self, text: str, done: int, total: int) -> None:
        """What is done beside runs, such as drawing pages: called before the first (done = 0) and after each."""
        if done == 0:
            self._begin_part()
        self._last = time.monotonic()
        self._show(f"{self._estimate(done / total)}{text} {done}/{total}")

    def _begin_part(self) -> None:
        self._part += 1
        if self._part >= len(self._parts):  # by itself
            self._part_start = self._last

    def _estimate(self, share: float) -> str:
        """ "40%, about 20 s left  ", for a terminal."""
        if self._part < len(self._parts):
            share = sum(self._parts[: self._part]) + share * self._parts[self._part]
        if not self._is_terminal or not 0.0 < share < 1.0:
            return ""
        left = (self._last - self._part_start) / share * (1.0 - share)
        return f"{share:4.0%}, about {span(left)} left  "


class SweepProgress(_RenewedLine):
    """Called with runs stored, runs in all, and the statuses of those just stored; with a bar, or as JSON lines."""

    def __init__(self, *, as_json: bool = False) -> None:
        super().__init__()
        self._as_json = as_json
        self._is_terminal = self._is_terminal and not as_json
        self._every_s = 0.1 if self._is_terminal else 10.0
        self._shown = self._start
        self._made: Counter[str] = Counter()

    @property
    def has_made_runs(self) -> bool:
        return bool(self._made)

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
        failed = [f"{count} {name}" for name, count in sorted(self._made.items()) if name not in GOOD]
        text = ", ".join([f"{done}/{total} runs", f"{rate:.4g} per s", f"{span((total - done) / rate)} left", *failed])
        room = min(40, self._width - len(text) - 3)
        if self._is_terminal and room > 5:
            text = f"[{'#' * (room * done // total):{room}}] {text}"
        self._show(text)


def span(seconds: float) -> str:
    for length, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2.0 * length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.0f} s" if seconds >= 10.0 else f"{seconds:.1f} s"


def print_summary(report: RunReport, output: Path) -> int:
    """The runs in a few lines; the exit status: 1 where a run that should succeed did not, or was not computed."""
    is_lost = print_not_computed(report.made)
    statuses = [run.status for run in report.made if run.is_stored]
    failed, lost = len(report.failures), len(report.not_computed)
    ok, completed = statuses.count("ok"), statuses.count("completed")
    counts = {
        "completed": completed,
        "failed": failed,
        "of the printed equations ended early": len(statuses) - ok - completed - failed,
        "not computed": lost,
    }
    parts = [f"{ok} ok", *(f"{n} {what}" for what, n in counts.items() if n)]
    made = f"{len(report.made)} runs made ({', '.join(parts)})" if report.made else "nothing to do"
    print(f"{output}: {made}, {len(report.kept)} already stored")
    for line in report.stored_failures:
        print(f"stored: {line}", file=sys.stderr)
    return 1 if report.failures or is_lost or report.stored_failures else 0


def print_doubts(scenes: Sequence[Scene]) -> None:
    """A line for each number that looks like a slip; none for shipped scenes, which have a folder in their name."""
    from rotor_mbs.scenario.scene import doubts

    for scene in scenes:
        for doubt in () if "/" in scene.name else doubts(scene):
            print(f"warning: {scene.name}: {doubt}", file=sys.stderr)


def print_not_computed(made: Sequence[Outcome]) -> bool:
    """A line for each run whose process died or could not start; whether there are any."""
    lost = [outcome for outcome in made if not outcome.is_stored]
    for outcome in lost:
        print(f"{outcome.label}: not computed ({outcome.message}); repeat the command to try again", file=sys.stderr)
    return bool(lost)
