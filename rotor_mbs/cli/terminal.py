"""What the commands print alike: progress, spans of time, the summary of runs."""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Self, TextIO

from rotor_mbs.cli import EXIT_BAD_INPUT, EXIT_FAILED, EXIT_OK, printable
from rotor_mbs.methods.catalogue import REFERENCE, Refusal
from rotor_mbs.scenario.keys import counted
from rotor_mbs.solution.status import GOOD, REFUSED, STATUSES

if TYPE_CHECKING:  # a sweep's workers load their code meanwhile
    from rotor_mbs.analysis.text_tables import TextTable
    from rotor_mbs.runs.runner import Outcome
    from rotor_mbs.studies.run import RunReport


# How a status is coloured on a terminal: well; open to doubt; anything else went wrong.
_COLOURS = {"ok": "32", "inaccurate": "33", "unchecked": "33"}
_BAD = "31"
_RENEWED_S, _LOGGED_S = 0.1, 10.0  # between two lines of a stage, on a terminal and in a log
_STATUS = re.compile(rf"\b({'|'.join((*STATUSES, 'no_reference'))})\b")


def coloured(text: str, stream: TextIO) -> str:
    """The statuses in a text each in its colour: on a terminal, unless the user asks for none (https://no-color.org)."""
    if not stream.isatty() or "NO_COLOR" in os.environ:
        return text
    return _STATUS.sub(lambda found: f"\x1b[{_COLOURS.get(found[0], _BAD)}m{found[0]}\x1b[0m", text)


def print_table(table: TextTable | str) -> None:
    """On standard output, after an empty line, with its statuses coloured on a terminal; nothing without rows."""
    if isinstance(table, str) or table.rows:
        # Colours are control characters, which the stream would escape.
        write = getattr(sys.stdout, "write_unfiltered", sys.stdout.write)
        write(f"\n{coloured(printable(str(table)), sys.stdout)}\n")


def print_json(data: object, *, indent: int | None = None) -> None:
    """Print data as JSON on standard output, in ASCII where the stream's encoding may lack a character."""
    encoding = sys.stdout.encoding or "utf-8"
    is_unicode = encoding.lower().startswith("utf")
    print(json.dumps(data, ensure_ascii=not is_unicode, indent=indent))


class ProgressLine:
    """One line that renews itself on a terminal, plain lines in a log. A context manager that clears it.

    Called after each run. What is left is estimated from the work done, not from the number of runs.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._is_terminal = self._stream.isatty()
        self._start = self._last = self._stage_start = time.monotonic()
        self._stage, self._share_before = "", 0.0

    def __enter__(self) -> Self:
        if self._is_terminal:
            self._print_over("starting")
        return self

    def __exit__(self, *_: object) -> None:
        if self._is_terminal:
            self._print("\r\x1b[K", end="")

    def __call__(self, done: int, total: int, outcome: Outcome) -> None:
        if done == 1:
            self._stage_start, self._share_before = self._last, 0.0
        self._last = time.monotonic()
        seconds = f" {outcome.seconds:.3f} s" if outcome.seconds > 0.0 else ""
        if outcome.is_shipped:
            seconds = " (read, not computed)"
        reason = f": {outcome.message}" if outcome.message else ""
        text = f"[{done:{len(str(total))}d}/{total}] {outcome.label} {outcome.status}{seconds}{reason}"
        keep = outcome.status not in (*GOOD, "measured")  # a person must not miss it
        self._show(text if keep else self._estimate(outcome.share) + text, keep=keep)

    def stage(self, name: str, done: int, total: int, note: str = "") -> None:
        """What has no outcomes of its own, such as drawing pages: called before the first and after each."""
        now = time.monotonic()
        if name != self._stage:
            self._stage, self._stage_start, self._share_before = name, now, done / total
        elif done < total and now - self._last < (_RENEWED_S if self._is_terminal else _LOGGED_S):
            return
        self._last = now
        self._show(f"{self._estimate(done / total)}{name} {done}/{total}{note}")

    def _estimate(self, share: float) -> str:
        """ "40%, about 20 s left  ", for a terminal."""
        if not self._is_terminal or not self._share_before < share < 1.0:
            return ""
        left = (self._last - self._stage_start) / (share - self._share_before) * (1.0 - share)
        return f"{share:4.0%}, about {span(left)} left  "

    def _show(self, text: str, *, keep: bool = False) -> None:
        """keep: it stays on the terminal, whole."""
        text = printable(text)
        if not self._is_terminal:
            self._print(text)
        elif keep:
            self._print(f"\r\x1b[K{coloured(text, self._stream)}")
        else:
            self._print_over(text)

    def _print_over(self, text: str) -> None:
        elapsed = f"  {span(time.monotonic() - self._start)}"
        width = shutil.get_terminal_size().columns - 1
        self._print(f"\r\x1b[K{text[: width - len(elapsed)]}{elapsed}", end="")

    def _print(self, text: str, end: str = "\n") -> None:
        """A progress that nobody can read any more must not end the work."""
        with suppress(OSError, ValueError):
            print(text, end=end, file=getattr(self._stream, "unfiltered", self._stream), flush=True)


def span(seconds: float) -> str:
    for length, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2.0 * length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.0f} s" if seconds >= 10.0 else f"{seconds:.1f} s"


def print_summary(report: RunReport, output: Path, refused: Sequence[Refusal] = ()) -> int:
    """Print the runs of a call in a few lines.

    Parameters
    ----------
    report : what the call computed, and what was stored already.
    output : the results file.
    refused : runs that were left out before.

    Returns
    -------
    int
        The exit status: 1 if a run that should succeed did not, or was not computed; 2 if the methods refused all runs.
    """
    is_incomplete = print_not_computed(report.made, refused)
    made = [run for run in report.made if run.status != REFUSED]
    counts = Counter(run.status if run.is_stored else "not computed" for run in made)
    parts = [f"{count} {status}" for status, count in counts.most_common()]
    text = f"{counted(len(made), 'run')} computed ({', '.join(parts)})" if made else "nothing to do"
    text += f", {len(report.kept)} already stored"
    not_run = len(refused) + len(report.made) - len(made)
    if not_run:
        text += f", {not_run} not run"
    print(f"{output}: {text}")
    for line in report.stored_failures:
        print(f"stored: {line}", file=sys.stderr)
    methods = [run.method for run in made] + [run.method for run, _, _ in report.kept]
    if not_run and all(method == REFERENCE for method in methods):
        return EXIT_BAD_INPUT
    return EXIT_FAILED if report.failures or is_incomplete or report.stored_failures else EXIT_OK


def print_not_computed(made: Sequence[Outcome], refused: Sequence[Refusal] = ()) -> bool:
    """Print a line for each run that was not computed.

    Parameters
    ----------
    made : what a call computed or tried to. Not computed are runs that their method refused when it was built, and
        runs whose process died or could not start.
    refused : runs that were left out before.

    Returns
    -------
    bool
        Whether one of the runs was asked for by name, or should be tried again: the exit status is not 0.
    """
    not_stored = [outcome for outcome in made if not outcome.is_stored]
    lost = [outcome for outcome in not_stored if outcome.status != REFUSED]
    refusals = list(refused)
    for outcome in not_stored:
        if outcome.status == REFUSED:
            refusals.append(Refusal(outcome.label.partition(" ")[0], outcome.method, outcome.message))
    for refusal in refusals:
        print(refusal, file=sys.stderr)
    for outcome in lost:
        print(f"{outcome.label}: not computed ({outcome.message}); repeat the command to try again", file=sys.stderr)
    return bool(lost) or any(refusal.is_asked for refusal in refusals)
