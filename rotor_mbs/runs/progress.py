"""Show the progress of long calls.

It is one line that is overwritten on a terminal or in a notebook, or plain lines in a log.

What is left is estimated from the work of the runs, which differs a thousandfold, and a run that
failed keeps its line: tqdm counts iterations, and needs ipywidgets in a notebook.
"""

from __future__ import annotations

import importlib
import io
import os
import re
import shutil
import sys
import time
from collections import Counter
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Self, TextIO

from rotor_mbs.errors import printable
from rotor_mbs.solution.status import GOOD, STATUSES

if TYPE_CHECKING:  # a sweep's workers load their code meanwhile
    from rotor_mbs.runs.runner import RunOutcome

# How a status is coloured on a terminal: well; open to doubt; anything else went wrong.
_COLOURS = {"ok": "32", "inaccurate": "33", "unchecked": "33"}
_BAD = "31"
_RENEWED_S, _LOGGED_S = 0.1, 10.0  # between two lines of a stage, renewed and in a log
_STATUS = re.compile(rf"\b({'|'.join((*STATUSES, 'no_reference'))})\b")


def coloured(text: str, stream: TextIO) -> str:
    """Return a text with each status in its colour.

    Nothing is coloured unless the stream is a terminal, and the user has not set NO_COLOR
    (https://no-color.org).
    """
    if not stream.isatty() or "NO_COLOR" in os.environ:
        return text
    return _STATUS.sub(lambda found: f"\x1b[{_COLOURS.get(found[0], _BAD)}m{found[0]}\x1b[0m", text)


def span(seconds: float) -> str:
    """Return a duration as text in a suitable unit, "2.5 h"."""
    for length, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2.0 * length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.0f} s" if seconds >= 10.0 else f"{seconds:.1f} s"


class ProgressLine:
    """A context manager that shows progress: one line on a terminal, or plain lines in a log.

    The line on a terminal is overwritten, and cleared at the end. The object is called after each
    run. The remaining time is estimated from the work done, not from the number of runs.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._is_live = self._stream.isatty()
        self._start = self._last = self._stage_start = time.monotonic()
        self._stage, self._share_before = "", 0.0
        self._statuses = Counter[str]()

    def __enter__(self) -> Self:
        if self._is_live:
            self._print_over("starting")
        return self

    def __exit__(self, *_: object) -> None:
        if self._is_live:
            self._clear()

    def __call__(self, done: int, total: int, outcome: RunOutcome) -> None:
        if done == 1:
            self._stage_start, self._share_before = self._last, 0.0
        self._last = time.monotonic()
        seconds = f" {outcome.seconds:.3f} s" if outcome.seconds > 0.0 else ""
        if outcome.is_shipped:
            seconds = " (read, not computed)"
        reason = f": {outcome.message}" if outcome.message else ""
        text = (
            f"[{done:{len(str(total))}d}/{total}] {outcome.label} {outcome.status}{seconds}{reason}"
        )
        keep = outcome.status not in (*GOOD, "measured")  # a person must not miss it
        self._show(text if keep else self._estimate(outcome.share) + text, keep=keep)

    def stage(self, name: str, done: int, total: int, note: str = "") -> None:
        """Show the progress of a stage whose parts have no outcomes, such as drawing pages.

        It is called before the first part and after each.
        """
        now = time.monotonic()
        if name != self._stage:
            self._stage, self._stage_start, self._share_before = name, now, done / total
        elif done < total and now - self._last < (_RENEWED_S if self._is_live else _LOGGED_S):
            return
        self._last = now
        self._show(f"{self._estimate(done / total)}{name} {done}/{total}{note}")

    def runs(self, done: int, total: int, statuses: Counter[str]) -> None:
        """Show how many runs of a sweep have been computed, and how many failed with which status.

        It is called before the first block of runs and after each; `statuses` are those of the
        block.
        """
        self._statuses.update(statuses)
        failed = [
            f", {count} {status}"
            for status, count in sorted(self._statuses.items())
            if status not in GOOD
        ]
        self.stage("runs", done, total, "".join(failed))

    def _estimate(self, share: float) -> str:
        """Return "40%, about 20 s left  ", or "" in a log or without an estimate."""
        if not self._is_live or not self._share_before < share < 1.0:
            return ""
        left = (self._last - self._stage_start) / (share - self._share_before) * (1.0 - share)
        return f"{share:4.0%}, about {span(left)} left  "

    def _show(self, text: str, *, keep: bool = False) -> None:
        """Show a text; with `keep` it stays on the terminal in full length."""
        text = printable(text)
        if not self._is_live:
            self._print(text)
        elif keep:
            self._print_above(text)
        else:
            self._print_over(text)

    def _print_over(self, text: str) -> None:
        elapsed = f"  {span(time.monotonic() - self._start)}"
        width = shutil.get_terminal_size().columns - 1
        self._print(f"\r\x1b[K{text[: width - len(elapsed)]}{elapsed}", end="")

    def _print_above(self, text: str) -> None:
        self._print(f"\r\x1b[K{coloured(text, self._stream)}")

    def _clear(self) -> None:
        self._print("\r\x1b[K", end="")

    def _print(self, text: str, end: str = "\n") -> None:
        """Print a line, and ignore a failure, as on a closed stream."""
        with suppress(OSError, ValueError):
            print(text, end=end, file=getattr(self._stream, "unfiltered", self._stream), flush=True)


class NotebookLine(ProgressLine):
    """A line below a cell of a Jupyter notebook that is overwritten.

    At the end it shows how long the call took.
    """

    def __init__(self) -> None:
        super().__init__()
        self._is_live = True
        self._display: Any = importlib.import_module("IPython.display")
        self._handle: Any = None

    def _print_over(self, text: str) -> None:
        shown = {"text/plain": f"{text}  {span(time.monotonic() - self._start)}"}
        if self._handle is None:
            self._handle = self._display.display(shown, raw=True, display_id=True)
        else:
            self._handle.update(shown, raw=True)

    def _print_above(self, text: str) -> None:
        print(text)

    def _clear(self) -> None:
        if self._handle is not None:
            self._handle.update(
                {"text/plain": f"done in {span(time.monotonic() - self._start)}"}, raw=True
            )


class SilentProgress(ProgressLine):
    """A progress line that shows nothing, and needs no stream."""

    def __init__(self) -> None:
        with io.StringIO() as nowhere:
            super().__init__(nowhere)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def _show(self, text: str, *, keep: bool = False) -> None:
        pass


def progress_of_call(progress: bool | None) -> ProgressLine:
    """Return the object that shows the progress of a call in Python.

    Parameters
    ----------
    progress : whether to show it; None: on a terminal and in a notebook, but not in a script whose
        messages go to a file.
    """
    if progress is False:
        return SilentProgress()
    # A notebook's streams are no terminals: its kernel brings its own.
    if type(sys.stdout).__module__.startswith("ipykernel"):
        return NotebookLine()
    if sys.stderr is None or (progress is None and not sys.stderr.isatty()):
        return SilentProgress()
    return ProgressLine()
