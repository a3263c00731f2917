"""Show the progress of long calls.

Progress is one line that is overwritten on a terminal or in a notebook, or plain lines in a log.

tqdm is not used: it estimates the remaining time from the number of iterations, but the work of two
runs may differ a thousandfold. It also needs ipywidgets in a notebook. Here the line of a run that
failed stays on the terminal.
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

if TYPE_CHECKING:  # the runner is imported later, while the workers of a sweep load their code
    from rotor_mbs.runs.runner import RunOutcome

# ANSI codes of the colours of statuses on a terminal: "ok" is green, and "completed" has the colour
# of other text, as nothing is claimed of these runs. Statuses of doubtful runs, and of points of a
# bench that were not run, are yellow. All other statuses have the colour _BAD, red.
_COLOURS = {"ok": "32", "completed": "39", "inaccurate": "33", "unchecked": "33", "left_out": "33"}
_BAD = "31"
# Shortest time in s between two lines of a stage: on a terminal or in a notebook, and in a log.
_RENEWED_S, _LOGGED_S = 0.1, 10.0
_STATUS = re.compile(rf"\b({'|'.join((*STATUSES, 'no_reference'))})\b")


def coloured(text: str, stream: TextIO) -> str:
    """Return a text with each status in its colour.

    The text is returned unchanged if the stream is no terminal, or the user has set NO_COLOR
    (https://no-color.org).
    """
    if not stream.isatty() or "NO_COLOR" in os.environ:
        return text
    return _STATUS.sub(lambda found: f"\x1b[{_COLOURS.get(found[0], _BAD)}m{found[0]}\x1b[0m", text)


def span(seconds: float) -> str:
    """Return a duration as text in a suitable unit, such as "2.5 h"."""
    for length, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2.0 * length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.0f} s" if seconds >= 10.0 else f"{seconds:.1f} s"


class ProgressLine:
    """A context manager that shows progress: one line on a terminal, or plain lines in a log.

    The line on a terminal is overwritten, and cleared at the end. The runner calls the object after
    each run, and then the remaining time is estimated from the work done, not from the number of
    runs. In a stage, and for the runs of a sweep, it is estimated from the number of parts done.
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
        keep = outcome.status not in (*GOOD, "measured")  # a failure must not be overlooked
        self._show(text if keep else self._estimate(outcome.share) + text, keep=keep)

    def stage(self, name: str, done: int, total: int, note: str = "") -> None:
        """Show the progress of a stage whose parts have no outcomes, such as drawing pages.

        Call it before the first part and after each part.

        Parameters
        ----------
        name : name of the stage.
        done, total : number of parts that are done, and of all parts.
        note : text that is added to the line.
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

        Call it before the first block of runs and after each block.

        Parameters
        ----------
        done, total : number of runs that are stored, and of all runs.
        statuses : number of runs of the block with each status.
        """
        self._statuses.update(statuses)
        failed = [
            f", {count} {status}"
            for status, count in sorted(self._statuses.items())
            if status not in GOOD
        ]
        self.stage("runs", done, total, "".join(failed))

    def _estimate(self, share: float) -> str:
        """Return a text such as "40%, about 20 s left  "; "" in a log or without an estimate."""
        if not self._is_live or not self._share_before < share < 1.0:
            return ""
        left = (self._last - self._stage_start) / (share - self._share_before) * (1.0 - share)
        return f"{share:4.0%}, about {span(left)} left  "

    def _show(self, text: str, *, keep: bool = False) -> None:
        """Show a text; if `keep` is set, it stays on the terminal in full length."""
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
    """A progress line below a cell of a Jupyter notebook.

    The line is overwritten, and shows at the end how long the call took.
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
    progress : whether progress is shown. With None it is shown on a terminal and in a notebook, but
        not in a script whose messages go to a file.
    """
    if progress is False:
        return SilentProgress()
    # The streams of a notebook are no terminals. They are recognized by the kernel's package.
    if type(sys.stdout).__module__.startswith("ipykernel"):
        return NotebookLine()
    if sys.stderr is None or (progress is None and not sys.stderr.isatty()):
        return SilentProgress()
    return ProgressLine()
