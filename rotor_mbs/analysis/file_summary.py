"""Summarize a file that this program wrote: its content, and commands to use it."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rotor_mbs.analysis.modes import mode_summary, read_modes
from rotor_mbs.analysis.text_tables import TextTable, bench_table, method_table, sweep_parameters
from rotor_mbs.methods.catalogue import REFERENCE, is_corrected
from rotor_mbs.runs.design import MISSING
from rotor_mbs.runs.hdf5 import reading
from rotor_mbs.runs.read import StoredScene, open_results, read_records
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.runs.table import TableFile, parsed
from rotor_mbs.runs.trailer import COMPARISON, MODES, RESULTS, SWEEP, read_trailer, refuse_split
from rotor_mbs.runs.versions import made_with
from rotor_mbs.scenario.keys import counted
from rotor_mbs.solution.status import GOOD, STATUSES

_WIDTH = 110  # largest number of characters in a line
_MOST_FAILED = 5  # largest number of runs that are listed with the reason why they are not ok


@dataclass
class FileSummary:
    """Describe what is in a file of this program.

    Attributes
    ----------
    path : the file.
    kind : kind of the file: "results", "sweep", "modes" or "comparison".
    attributes : attributes of the file, among them the versions of the programs that made it.
    scenes, methods, outputs : names, in the order of the file.
    labels : label of each scene by its name, with the changes to a shipped scene.
    runs : labels of all rows of a results file, in the order of the file. Rows that are not
        computed yet are included.
    statuses : number of runs, or of comparisons, by status.
    lines, tables : further lines and tables, which depend on the kind of the file.
    next : commands and Python calls to use the file, each with a description.
    """

    path: Path
    kind: str
    attributes: Mapping[str, Any]
    scenes: list[str] = field(default_factory=list)
    methods: list[str] = field(default_factory=list)
    outputs: list[str] = field(default_factory=list)
    runs: list[str] = field(default_factory=list)
    statuses: dict[str, int] = field(default_factory=dict)
    labels: dict[str, str] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)
    tables: list[TextTable] = field(default_factory=list)
    next: list[tuple[str, str]] = field(default_factory=list)

    def as_dictionary(self) -> dict[str, Any]:
        """Return the summary as a dictionary for JSON."""
        return {
            "file": str(self.path),
            "kind": self.kind,
            "bytes": self.path.stat().st_size,
            "scenes": self.scenes,
            "methods": self.methods,
            "outputs": self.outputs,
            "runs": self.runs,
            "statuses": self.statuses,
            "made_with": dict(made_with(self.attributes)),
            "next": [command for command, _ in self.next],
        }

    def __str__(self) -> str:
        """Return the summary as a screen of text."""
        size = self.path.stat().st_size
        parts = [f"{self.path}: {self.kind}, {size / 1e6:.3g} MB"]
        facts = {
            "scenes": shortened([self.labels.get(name, name) for name in self.scenes]),
            "methods": ", ".join(self.methods),
            "outputs": ", ".join(self.outputs),
            "status": counts(self.statuses),
            "made by": ", ".join(f"{name} {text}" for name, text in made_with(self.attributes)),
        }
        for name, text in facts.items():
            if text:
                parts += textwrap.wrap(
                    text, _WIDTH, initial_indent=f"  {name:9}", subsequent_indent=11 * " "
                )
        parts += [f"  {line}".rstrip() for line in self.lines]
        for table in self.tables:
            parts += ["", str(table)]
        width = max(len(command) for command, _ in self.next)
        parts += ["", "next:", *(f"  {command:{width}}  {what}" for command, what in self.next)]
        return "\n".join(parts)


def counts(statuses: Mapping[str, int]) -> str:
    """Return a text such as "18 ok, 2 inaccurate", the most frequent status first."""
    return ", ".join(f"{count} {status}" for status, count in Counter(statuses).most_common())


def shortened(names: Sequence[str]) -> str:
    """Return names as a text: at most eight of them, and the number of all if there are more."""
    shown = ", ".join(names[:8])
    return f"{shown}, ... ({len(names)} in all)" if len(names) > 8 else shown


def summary_of(path: Path) -> FileSummary:
    """Return a summary of the content of a file.

    Raises
    ------
    StoreError
        If the file at `path` cannot be read or was not written by this program.
    """
    kind = read_trailer(path).kind
    refuse_split(path, kind)
    of_kind = {RESULTS: _results, SWEEP: _sweep, MODES: _modes, COMPARISON: _comparison}
    with reading(path):
        summary = of_kind[kind](path)
    summary.next = [
        (f"rotor-mbs report {path}", "pages: figures, tables, what was found"),
        *summary.next,
    ]
    summary.next.append((f'rm.open("{path}")', "in Python, after `import rotor_mbs as rm`"))
    return summary


def _results(path: Path) -> FileSummary:
    """Return the summary of a results file: scenes, methods, statuses, benches and ladders.

    The first few runs that failed are listed, each with its reason.

    Parameters
    ----------
    path : the file.
    """
    curves, ladders = read_records(path, "bench"), read_records(path, "stability")
    with open_results(path) as results:
        summary = FileSummary(path, RESULTS, results.attributes, list(results.scenes))
        summary.runs = results.rows
        summary.labels = {name: scene.label for name, scene in results.scenes.items()}
        runs = [run for scene in results.scenes.values() for run in scene.methods.values()]
        summary.methods = list(
            dict.fromkeys([run.method for run in runs] + [curve.method for curve in curves])
        )
        summary.outputs = _unique(
            output for scene in results.scenes.values() for output in scene.scene.outputs
        )
        summary.statuses = dict(Counter(run.status for run in runs))
        failed = [run for run in runs if run.status not in GOOD and is_corrected(run.method)]
        for run in failed[:_MOST_FAILED]:
            reason = str(run.attributes.get("message", ""))
            text = f"{run.scene_name} {run.method} {run.status}{': ' if reason else ''}{reason}"
            summary.lines += textwrap.wrap(text, _WIDTH, subsequent_indent="  ")
        if len(failed) > _MOST_FAILED:
            summary.lines.append(f"... {len(failed) - _MOST_FAILED} more runs that are not ok")
        if results.scenes:
            summary.tables = [_scene_table(results.scenes.values()), method_table(runs)]
        # A file may have no run to check: only points of a bench or of the stability suite, or only
        # references.
        if runs:
            summary.next = [
                (f"rotor-mbs check {path}", "accuracy verdicts; exit status 1 where one fails")
            ]
    if curves:
        summary.scenes = _unique([*summary.scenes, *(curve.scene for curve in curves)])
        summary.lines.append(f"bench: {counted(len(curves), 'curve')} of error against run time")
        summary.tables.append(bench_table(curves))
    if ladders:
        summary.lines.append(f"stability: {counted(len(ladders), 'ladder')} of time steps")
    summary.tables = [table for table in summary.tables if table.rows]
    return summary


def _unique(names: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(names))


def _scene_table(scenes: Iterable[StoredScene]) -> TextTable:
    """Return a table with a row for each of the stored `scenes`: size, reference, statuses."""
    rows: list[tuple[str, ...]] = []
    for stored in scenes:
        scene = stored.scene
        statuses = counts(Counter(run.status for run in stored.methods.values()))
        reference = stored.reference
        origin = "none" if reference is None else "shipped" if reference.is_frozen else "computed"
        rows.append(
            (
                stored.label,
                str(len(scene.blades)),
                f"{scene.duration:g}",
                str(scene.samples),
                origin,
                statuses,
            )
        )
    return TextTable(("scene", "blades", "duration (s)", "samples", REFERENCE, "runs"), rows)


def _sweep(path: Path) -> FileSummary:
    """Return the summary of a sweep: its parameters, and the number of runs by status.

    Runs whose rows were damaged after they were written are counted as "damaged", too.

    Parameters
    ----------
    path : the file.
    """
    sweep = StoredSweep(path, allow_damaged_runs=True)
    codes = sweep.column("status")
    summary = FileSummary(
        path, SWEEP, sweep.attributes, [sweep.base_scene.name], list(sweep.methods)
    )
    summary.labels = {sweep.base_scene.name: sweep.base_scene.label}
    summary.statuses = dict(Counter(STATUSES[code] for code in codes.tolist() if code != MISSING))
    missing = int((codes == MISSING).sum())
    if missing:
        summary.statuses["not computed"] = missing
        summary.next = [
            ("rotor-mbs sweep ...", "the command that made it computes what is missing")
        ]
    if len(sweep.damaged_runs):
        summary.statuses["damaged"] = len(sweep.damaged_runs)
    summary.outputs = [
        name
        for name, column in sweep.columns.items()
        if "time" in column.dimensions and name != "time"
    ]
    summary.tables = [sweep_parameters(sweep)]
    summary.next.append(
        (f"rotor-mbs check {path}", "accuracy verdicts; exit status 1 where one fails")
    )
    return summary


def _modes(path: Path) -> FileSummary:
    """Return the summary of a file of modes, with the modes of each scene as lines of text."""
    found = read_modes(path)
    summary = FileSummary(path, MODES, TableFile(path, ()).attributes, list(found))
    summary.labels = {name: modes.label for name, modes in found.items()}
    summary.methods = _unique(
        model for modes in found.values() for model in (*modes.rest, *modes.rotation)
    )
    summary.lines = [
        line for modes in found.values() for line in ("", *mode_summary(modes).splitlines())
    ]
    return summary


def _comparison(path: Path) -> FileSummary:
    """Return the summary of a file of comparisons.

    It has a table with a row for each comparison, and lines with the reasons why data disagree.

    Parameters
    ----------
    path : the file.
    """
    records = read_records(path, COMPARISON)
    summary = FileSummary(
        path,
        COMPARISON,
        TableFile(path, ()).attributes,
        _unique(record.scene for record in records),
    )
    summary.statuses = dict(Counter(str(record.attributes["status"]) for record in records))
    rows: list[tuple[str, ...]] = []
    for record in records:
        verdict = parsed(record.attributes["verdict"], dict, path)
        numbers = (f"{verdict[name]:g}" for name in ("rows", "compared_until", "tolerance"))
        summary.labels[record.scene] = str(record.attributes.get("scene_label", record.scene))
        rows.append((record.name, summary.labels[record.scene], *numbers, str(verdict["status"])))
        reasons = [verdict["message"], *(f"probable cause: {cause}" for cause in verdict["likely"])]
        for reason in filter(None, reasons):
            summary.lines += textwrap.wrap(
                f"{record.name}: {reason}", _WIDTH, subsequent_indent="  "
            )
    summary.tables = [
        TextTable(("data", "scene", "rows", "compared up to (s)", "tolerance", "status"), rows)
    ]
    summary.next = [("rotor-mbs compare DATA --scene SCENE", "the same for other data")]
    return summary
