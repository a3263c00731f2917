"""The stability suite: the map of all scenes and methods."""

from __future__ import annotations

from rotor_mbs.report.elements import PageTable, Row, Section, TableCell
from rotor_mbs.report.looks import label_of
from rotor_mbs.report.pages import Report, method_cell
from rotor_mbs.studies.stability import OUTCOMES, suite_table


def stability_page(report: Report) -> dict[str, object]:
    """The content of the map, which is the index of the suite."""
    runs = report.suite_runs
    methods = list(dict.fromkeys(run.method for run in runs))
    rows: list[Row] = []
    for scene, file in report.files.items():
        own = {run.method: run for run in runs if run.scene == scene}
        row: list[TableCell | str] = [TableCell(scene, href=file, note=report.scenes[scene].title)]
        for method in methods:
            if method not in own:
                row.append("")
                continue
            run = own[method]
            symbol, text = OUTCOMES[run.outcome]
            if run.false_success:
                symbol, text = f"{symbol}!", f"{text}; the engine reported success"
            title = f"{label_of(method)}: {text}. {run.message}".strip()
            row.append(TableCell(symbol, shade=f"mark {run.outcome}", title=title))
        rows.append(row)
    used = {run.outcome for run in runs}
    counts = suite_table(runs)
    count_rows = [(method_cell(method), *cells) for method, *cells in counts.rows]
    return {
        "map": PageTable("", ("Scene", *map(method_cell, methods)), rows),
        "key": [(outcome, symbol, text) for outcome, (symbol, text) in OUTCOMES.items() if outcome in used],
        "summary": Section(tables=[PageTable("", counts.head, count_rows)]),
        "false_successes": sum(run.false_success for run in runs),
    }
