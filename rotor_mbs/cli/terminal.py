"""Print the output that several commands have in common: tables, JSON, the summary of runs."""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rotor_mbs.cli import EXIT_BAD_INPUT, EXIT_FAILED, EXIT_OK
from rotor_mbs.errors import printable
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.methods.selection import Refusal
from rotor_mbs.runs.progress import coloured
from rotor_mbs.scenario.keys import counted
from rotor_mbs.solution.status import REFUSED

if TYPE_CHECKING:  # a sweep starts its workers before it imports these modules
    from rotor_mbs.analysis.text_tables import TextTable
    from rotor_mbs.runs.runner import RunOutcome


def print_table(table: TextTable | str) -> None:
    """Print a table on standard output after an empty line, unless it has no rows.

    On a terminal, the statuses in the table are coloured.
    """
    if isinstance(table, str) or table.rows:
        # Colours are control characters. The stream's `write` would escape them.
        write = getattr(sys.stdout, "write_unfiltered", sys.stdout.write)
        write(f"\n{coloured(printable(str(table)), sys.stdout)}\n")


def print_json(data: object, *, indent: int | None = None) -> None:
    """Print data as JSON on standard output.

    Characters outside ASCII are escaped unless the stream's encoding is a Unicode one.
    """
    encoding = sys.stdout.encoding or "utf-8"
    is_unicode = encoding.lower().startswith("utf")
    print(json.dumps(data, ensure_ascii=not is_unicode, indent=indent))


def print_summary(runs: Sequence[RunOutcome], output: Path, refused: Sequence[Refusal] = ()) -> int:
    """Print a summary of the runs of a call, and return the exit status.

    Parameters
    ----------
    runs : outcomes of the runs that the call computed or tried to compute, and of the runs that
        were stored before.
    output : the results file.
    refused : runs that were left out before the call began.

    Returns
    -------
    int
        The exit status: 2 if methods were refused and nothing but references could run; otherwise
        1 if a run failed that should succeed, or if `print_not_computed` returns True.
    """
    is_incomplete = print_not_computed(runs, refused)
    accepted = [run for run in runs if run.status != REFUSED]
    computed = [run for run in accepted if run.is_computed]
    stored = [run for run in accepted if not run.is_computed]
    counts = Counter(run.status if run.is_stored else "not computed" for run in computed)
    text = "nothing to do"
    if computed:
        parts = [f"{count} {status}" for status, count in counts.most_common()]
        text = f"{counted(len(computed), 'run')} computed ({', '.join(parts)})"
    text += f", {len(stored)} already stored"
    not_run = len(refused) + len(runs) - len(accepted)
    if not_run:
        text += f", {not_run} not run"
    print(f"{output}: {text}")
    for run in stored:
        if run.has_failed:
            print(f"stored: {run.label} {run.status}: {run.message}", file=sys.stderr)
    if not_run and all(run.method == REFERENCE for run in accepted):
        return EXIT_BAD_INPUT
    if is_incomplete or any(run.has_failed for run in runs):
        return EXIT_FAILED
    return EXIT_OK


def print_not_computed(made: Sequence[RunOutcome], refused: Sequence[Refusal] = ()) -> bool:
    """Print a line on standard error for each run that was not computed.

    Parameters
    ----------
    made : outcomes of the runs that a call computed or tried to compute. A run is not computed if
        its method refuses the scene when the solver is built, if its process dies or cannot start,
        or if the reference of its scene was not computed.
    refused : runs that were left out before the call began.

    Returns
    -------
    bool
        Whether the exit status must not be 0. This holds if a run should be tried again, was
        refused when its solver was built, or was left out before although the user asked for it
        (`Refusal.is_asked`).
    """
    not_stored = [outcome for outcome in made if not outcome.is_stored]
    lost = [outcome for outcome in not_stored if outcome.status != REFUSED]
    refusals = list(refused)
    for outcome in not_stored:
        if outcome.status == REFUSED:
            refusals.append(Refusal(outcome.scene, outcome.method, outcome.message))
    for refusal in refusals:
        print(refusal, file=sys.stderr)
    for outcome in lost:
        print(
            f"{outcome.label}: not computed ({outcome.message}); repeat the command to try again",
            file=sys.stderr,
        )
    return bool(lost) or any(refusal.is_asked for refusal in refusals)
