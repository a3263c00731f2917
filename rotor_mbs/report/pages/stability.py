"""Build the page of the stability suite, with a map of the outcomes of all scenes and methods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

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
from rotor_mbs.report.numbers import in_words, typeset_title
from rotor_mbs.report.pages import Report, method_cell
from rotor_mbs.studies.stability import OUTCOMES, SuiteRun, suite_table

_NAMES = 3  # largest number of methods whose names a sentence has
_METHODS_IN_A_TABLE = 7  # number of columns beside the scenes that fit a page of 1440 px
_WRONG = ("inaccurate", "diverged", "singular", "solver_failed")  # outcomes of wrong results


def stability_page(report: Report) -> PageContent:
    """Return the content of the page of the stability suite, which is the index of its report.

    Parameters
    ----------
    report : the open results file, with the runs of the suite.
    """
    runs = report.suite_runs
    methods = list(dict.fromkeys(run.method for run in runs))
    present = {run.scene for run in runs}
    scenes = {scene: file for scene, file in report.files.items() if scene in present}
    # A singular run without a reference is left out: its scene may have no solution.
    compared = [run for run in runs if run.has_reference or run.status != "singular"]
    claimed = sum(run.false_success for run in runs)
    good = sum(run.outcome == "ok" for run in compared)
    facts = [
        Fact("Scenes", str(len(scenes)), "chosen to provoke failure"),
        Fact("Methods", str(len(methods))),
        Fact("Runs that are ok", f"{good} of {len(compared)}", "where a motion exists"),
        Fact(
            "Wrong, but reported as success",
            str(claimed),
            "never counted as ok",
            "bad" if claimed else "good",
        ),
    ]
    tables: list[Element] = []
    for first in range(0, len(methods), _METHODS_IN_A_TABLE):
        shown = methods[first : first + _METHODS_IN_A_TABLE]
        tables.append(_map(report, runs, scenes, shown))
    how = (
        "A mark is the status of the run, determined from its samples: finite values, end reached, "
        "energy balance, gaps in joints, difference from a quad-precision reference up to the "
        "horizon. A reported success is not relied on. The page of a scene has the reasons."
    )
    sections = [
        Section("map", "Statuses", [*tables, _key(runs)], how),
        Section("summary", "Number of ok runs", _counts(runs) if len(scenes) > 1 else []),
    ]
    return PageContent(
        "Stiff and extreme scenes: range of each method",
        report.path.name,
        [*ranking(compared, methods), _false_successes(runs)],
        facts,
        sections,
    )


def ranking(compared: Sequence[SuiteRun], methods: Sequence[str]) -> list[Markup]:
    """Return sentences on the methods that are ok on the most and on the fewest scenes.

    Parameters
    ----------
    compared : runs of the suite that are counted.
    methods : names of the methods, in the order of the map.
    """
    if not methods:
        return []
    good, counts = dict.fromkeys(methods, 0), dict.fromkeys(methods, 0)
    for run in compared:
        counts[run.method] += 1
        good[run.method] += run.outcome == "ok"
    best = max(good.values())
    names = [label_of(method) for method in methods if good[method] == best]
    text = Markup("<b>{}</b> {} ok on <b>{} of {} scenes</b> at default settings{}.")
    comment = ", the most" if len(methods) > 1 else ""
    verb = "is" if len(names) == 1 else "are"
    which = with_capital(" and ".join(names[:3]))
    sentences = [text.format(which, verb, best, max(counts.values()), comment)]
    # The worst methods are found by their shares of ok runs, because not every method was run on
    # every scene.
    shares = {method: good[method] / max(counts[method], 1) for method in methods}
    worst = min(methods, key=lambda method: shares[method])
    if good[worst] < best:
        names = [label_of(method) for method in methods if shares[method] == shares[worst]]
        text = Markup("The fewest: {}, {} of {}.")
        which = "; ".join(names) if len(names) <= _NAMES else f"{in_words(len(names))} methods"
        count = f"{counts[worst]} each" if len(names) > 1 else counts[worst]
        sentences.append(text.format(which, good[worst], count))
    return sentences


def _false_successes(runs: Sequence[SuiteRun]) -> Markup:
    """Return a sentence on the number of wrong results for which the engines reported success."""
    claimed = sum(run.false_success for run in runs)
    if not claimed:
        return Markup("No engine reported success for a wrong result.")
    wrong = sum(run.outcome in _WRONG for run in runs)
    text = Markup('Engines reported success for <span class="bad">{} of {} wrong results</span>.')
    return text.format(claimed, max(wrong, claimed))


def _map(
    report: Report, runs: Sequence[SuiteRun], scenes: Mapping[str, str], methods: Sequence[str]
) -> PageTable:
    """Return the map: a table of outcomes with a row for each scene and a column for each method.

    Parameters
    ----------
    report : the open results file, with the titles of the scenes.
    runs : runs of the suite.
    scenes : file of each scene's page by the name of the scene.
    methods : names of the methods that the table shows.
    """
    by_place = {(run.scene, run.method): run for run in runs}
    rows: list[Row] = []
    for scene, file in scenes.items():
        title = typeset_title(report.scenes[scene].title)
        row: list[TableCell | str] = [TableCell(scene, href=file, note=title)]
        for method in methods:
            run = by_place.get((scene, method))
            row.append("" if run is None else _status_cell(run))
        rows.append(row)
    return PageTable("Statuses", ("Scene", *map(method_cell, methods)), rows)


def _status_cell(run: SuiteRun) -> TableCell:
    """Return a cell with the symbol of a run's outcome; the cell's title has the reason."""
    symbol, words = OUTCOMES[run.outcome]
    if run.false_success:
        symbol, words = f"{symbol}!", f"{words}; the engine reported success"
    if run.outcome in _WRONG:
        mark = "status wrong"
    elif run.outcome == "timed_out":
        mark = "status late"
    elif run.outcome in ("ok", "smaller_step"):
        mark = "status ok"
    else:
        mark = "status"
    title = f"{label_of(run.method)}: {words}. {run.message}".strip()
    return TableCell(symbol, mark=mark, title=title)


def _key(runs: Sequence[SuiteRun]) -> Note:
    """Return a note that explains the symbols that occur in the map."""
    used = {run.outcome for run in runs}
    key = [f"{symbol} {words}" for outcome, (symbol, words) in OUTCOMES.items() if outcome in used]
    if any(run.false_success for run in runs):
        key.append("! the engine reported success for a wrong result")
    return Note(" · ".join(key))


def _counts(runs: Sequence[SuiteRun]) -> list[Element]:
    """Return a table with the number of ok runs of each method, and a note on its rules."""
    counted = suite_table(runs)
    rows: list[Row] = [(method_cell(method), *cells) for method, *cells in counted.rows]
    head = ("Method", *counted.head[1:-1], "Wrong, but reported as success")
    note = (
        "Only scenes that have a solution are counted. After a +: runs that are ok with a smaller "
        "step. Runs of the printed equations are counted as completed."
    )
    return [PageTable("Number of ok runs", head, rows), Note(note)]
