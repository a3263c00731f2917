"""Build the page of the stability suite: the map of all scenes and methods."""

from __future__ import annotations

from markupsafe import Markup

from rotor_mbs.report.elements import (
    Element,
    Fact,
    Note,
    PageContent,
    PageTable,
    Row,
    Section,
    TableCell,
)
from rotor_mbs.report.looks import label_of, with_capital
from rotor_mbs.report.numbers import typeset_title
from rotor_mbs.report.pages import Report, method_cell
from rotor_mbs.studies.stability import OUTCOMES, suite_table

_METHODS_IN_A_TABLE = 7  # beside the scene, on a page of 1440 px
_WRONG = ("inaccurate", "diverged", "singular", "solver_failed")


def stability_page(report: Report) -> PageContent:
    """Return the content of the map, which is the index of the suite.

    Parameters
    ----------
    report : the open results file, with runs of the suite.
    """
    runs = report.suite_runs
    methods = list(dict.fromkeys(run.method for run in runs))
    scenes = {
        scene: file
        for scene, file in report.files.items()
        if any(run.scene == scene for run in runs)
    }
    # A singular run without a reference is left out: its scene may have no solution.
    compared = [run for run in runs if run.has_reference or run.status != "singular"]
    good = {
        method: sum(run.outcome == "ok" for run in compared if run.method == method)
        for method in methods
    }
    counts = {method: sum(run.method == method for run in compared) for method in methods}
    answer = []
    if methods:
        best = max(good.values())
        names = [label_of(method) for method in methods if good[method] == best]
        whole = max(counts.values())
        text = Markup("<b>{}</b> {} ok on <b>{} of {} scenes</b> at default settings, the most.")
        answer.append(
            text.format(
                with_capital(" and ".join(names[:3])),
                "is" if len(names) == 1 else "are",
                best,
                whole,
            )
        )
        # By the share: not every method has run every scene.
        worst = min(methods, key=lambda method: good[method] / max(counts[method], 1))
        if good[worst] < best:
            text = Markup("The fewest: {}, {} of {}.")
            answer.append(text.format(label_of(worst), good[worst], counts[worst]))
    claimed = sum(run.false_success for run in runs)
    if claimed:
        wrong = sum(run.outcome in _WRONG for run in runs)
        text = Markup(
            'Engines reported success for <span class="bad">{} of {} wrong results</span>.'
        )
        answer.append(text.format(claimed, max(wrong, claimed)))
    else:
        answer.append(Markup("No engine reported success for a wrong result."))
    facts = [
        Fact("Scenes", str(len(scenes)), "chosen to provoke failure"),
        Fact("Methods", str(len(methods))),
        Fact(
            "Runs that are ok",
            f"{sum(good.values())} of {sum(counts.values())}",
            "where a motion exists",
        ),
        Fact(
            "Wrong, but reported as success",
            str(claimed),
            "never counted as ok",
            "bad" if claimed else "good",
        ),
    ]
    tables = []
    for first in range(0, len(methods), _METHODS_IN_A_TABLE):
        shown = methods[first : first + _METHODS_IN_A_TABLE]
        rows: list[Row] = []
        for scene, file in scenes.items():
            own = {run.method: run for run in runs if run.scene == scene}
            row: list[TableCell | str] = [
                TableCell(scene, href=file, note=typeset_title(report.scenes[scene].title))
            ]
            for method in shown:
                if method not in own:
                    row.append("")
                    continue
                run = own[method]
                symbol, words = OUTCOMES[run.outcome]
                if run.false_success:
                    symbol, words = f"{symbol}!", f"{words}; the engine reported success"
                kind = (
                    "ok"
                    if run.outcome in ("ok", "smaller_step")
                    else "late"
                    if run.outcome == "timed_out"
                    else ""
                )
                kind = "wrong" if run.outcome in _WRONG else kind
                title = f"{label_of(method)}: {words}. {run.message}".strip()
                row.append(TableCell(symbol, mark=f"status {kind}".strip(), title=title))
            rows.append(row)
        tables.append(PageTable("Statuses", ("Scene", *map(method_cell, shown)), rows))
    used = {run.outcome for run in runs}
    # The key explains the outcomes that are in the map, and no others.
    key = [(symbol, text) for outcome, (symbol, text) in OUTCOMES.items() if outcome in used]
    if claimed:
        key.append(("!", "the engine reported success for a wrong result"))
    counted = suite_table(runs)
    count_rows: list[Row] = [(method_cell(method), *cells) for method, *cells in counted.rows]
    count_table = PageTable(
        "Number of ok runs",
        ("Method", *counted.head[1:-1], "Wrong, but reported as success"),
        count_rows,
    )
    note = (
        "Only scenes that have a solution are counted. After a +: runs that are ok with a smaller "
        "step. Runs of the printed equations are counted as completed."
    )
    how = (
        "A mark is the status of the run, determined from its samples: finite values, end reached, "
        "energy balance, gaps in joints, difference from a quad-precision reference up to the "
        "horizon. A reported success is not relied on. The page of a scene has the reasons."
    )
    meaning = Note(" · ".join(f"{symbol} {words}" for symbol, words in key))
    summary: list[Element] = [count_table, Note(note)] if len(scenes) > 1 else []
    sections = [
        Section("map", "Statuses", [*tables, meaning], how),
        Section("summary", "Number of ok runs", summary),
    ]
    return PageContent(
        "Stiff and extreme scenes: range of each method", report.path.name, answer, facts, sections
    )
