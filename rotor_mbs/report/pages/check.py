"""Verdicts as lines of text, JSON, JUnit XML, annotations and job summaries of GitHub, trends, a badge, and a page.

Names and messages come from files of any origin: what is not printable is written as an escape.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from rotor_mbs.analysis.verdicts import Verdict
from rotor_mbs.report.core.elements import PageTable, Row, Section, TableCell
from rotor_mbs.report.core.numbers import NOTHING, number, with_unit
from rotor_mbs.report.pages.scene_tables import method_cell
from rotor_mbs.scenario.accuracy_bounds import load_bounds
from rotor_mbs.solution.text_table import TextTable
from rotor_mbs.studies.check import judge_file

WORST = 10  # annotations: GitHub shows as many of a step and drops the others silently


def line(verdict: Verdict) -> str:
    """One line: outcome, what was checked where, the value, the bound, the margin; of a failure what to look at."""
    outcome = "pass" if verdict.passed else "FAIL"
    margin = "inf" if math.isinf(verdict.margin) else f"{verdict.margin:.3g}"
    unit = f" {verdict.unit}" if verdict.unit else ""
    look_at = "" if verdict.passed else f"; {verdict.look_at}"
    return printable(
        f"{outcome} {verdict.check}: {verdict.scene} {verdict.method} {verdict.channel}: {verdict.value:.2e}, "
        f"bound {verdict.bound:.2e}{unit}, margin {margin}{look_at}"
    )


def github(verdict: Verdict) -> str:
    """A workflow command that GitHub shows as an error annotation."""
    title = _data(printable(f"rotor-mbs {verdict.check} {verdict.scene} {verdict.method}"))
    return f"::error title={title.replace(':', '%3A').replace(',', '%2C')}::{_data(line(verdict))}"


def worst_first(verdicts: Sequence[Verdict]) -> list[Verdict]:
    """By share of the bound, the largest first; not a number before all others."""
    return sorted(verdicts, key=lambda verdict: verdict.margin)


def summary(verdicts: Sequence[Verdict]) -> str:
    """A job summary in Markdown: a row per check, then the ten verdicts nearest to their bounds or beyond."""
    rows = ["### rotor-mbs check", "", "| check | verdicts | failed | smallest margin |", "|---|---:|---:|---:|"]
    for check in dict.fromkeys(verdict.check for verdict in verdicts):
        mine = [verdict for verdict in verdicts if verdict.check == check]
        failed = sum(not verdict.passed for verdict in mine)
        rows.append(f"| {_cell(check)} | {len(mine)} | {failed} | {min(v.margin for v in mine):.3g} |")
    rows += ["", "| | check | scene | method | channel | value | bound | unit |", "|---|---|---|---|---|---:|---:|---|"]
    for one in worst_first(verdicts)[:WORST]:
        texts = [_cell(text) for text in (one.check, one.scene, one.method, one.channel)]
        outcome = "pass" if one.passed else "**FAIL**"
        numbers = [f"{one.value:.2e}", f"{one.bound:.2e}", _cell(one.unit)]
        rows.append("| " + " | ".join([outcome, *texts, *numbers]) + " |")
    return "\n".join(rows) + "\n"


def _cell(text: str) -> str:
    """As text in a cell of a Markdown table: nothing of it is markup."""
    return re.sub(r"([\\`*_{}\[\]<>()#!|~&])", r"\\\1", printable(text))


def trend(verdicts: Sequence[Verdict]) -> str:
    """JSON of benchmark charts where smaller is better: of every check and method the largest share of a bound.

    Shares that are no finite numbers are left out: JSON has none, and their verdicts fail.
    """
    largest: dict[str, float] = {}
    for verdict in verdicts:
        share = 1.0 / verdict.margin if verdict.margin else math.inf
        name = f"{verdict.check} {verdict.method}"
        largest[name] = max(largest.get(name, 0.0), share)
    rows = [
        {"name": name, "unit": "of bound", "value": share} for name, share in largest.items() if math.isfinite(share)
    ]
    return json.dumps(rows, indent=1)


def badge(verdicts: Sequence[Verdict]) -> str:
    """JSON that shields.io draws as a badge (its endpoint schema)."""
    failed = sum(not verdict.passed for verdict in verdicts)
    message = f"{failed} of {len(verdicts)} failed" if failed or not verdicts else f"{len(verdicts)} passed"
    colour = "red" if failed or not verdicts else "brightgreen"
    return json.dumps({"schemaVersion": 1, "label": "accuracy", "message": message, "color": colour})


def _data(text: str) -> str:
    """As GitHub's own toolkit escapes the text of a command."""
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def as_json(verdicts: Sequence[Verdict]) -> str:
    """A list of objects; numbers that JSON cannot hold (NaN, infinity) become null."""
    names = ("check", "scene", "method", "channel", "value", "bound", "unit", "margin", "passed", "look_at")
    rows = [{name: getattr(verdict, name) for name in names} for verdict in verdicts]
    numbers = ("value", "bound", "margin")
    return json.dumps([row | {n: row[n] if math.isfinite(row[n]) else None for n in numbers} for row in rows], indent=1)


def junit(verdicts: Sequence[Verdict]) -> bytes:
    """JUnit XML as GitHub's and GitLab's viewers read it: a suite per scene, a case per verdict."""
    root = ElementTree.Element("testsuites", {"name": "rotor-mbs check", **_counts(verdicts)})
    for scene in dict.fromkeys(v.scene for v in verdicts):
        _add_suite(root, scene, [v for v in verdicts if v.scene == scene])
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text


def _counts(verdicts: Sequence[Verdict]) -> dict[str, str]:
    failed = sum(not verdict.passed for verdict in verdicts)
    return {"tests": str(len(verdicts)), "failures": str(failed), "errors": "0"}


def _add_suite(root: ElementTree.Element, scene: str, mine: Sequence[Verdict]) -> None:
    suite = ElementTree.SubElement(root, "testsuite", {"name": printable(scene), **_counts(mine)})
    for v in mine:
        name, group = printable(f"{v.check} {v.method} {v.channel}"), printable(f"rotor_mbs.{scene}")
        case = ElementTree.SubElement(suite, "testcase", classname=group, name=name, time="0")
        properties = ElementTree.SubElement(case, "properties")
        for key, value in (("value", v.value), ("bound", v.bound), ("margin", v.margin), ("unit", v.unit)):
            ElementTree.SubElement(properties, "property", name=key, value=printable(str(value)))
        if not v.passed:
            failure = ElementTree.SubElement(case, "failure", message=line(v), type=v.check)
            failure.text = line(v)


def printable(text: str) -> str:
    """`text` with escapes for what controls a terminal or is not allowed in XML: control characters, surrogates."""
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in text)


def largest_seen(verdicts: Sequence[Verdict]) -> list[Verdict]:
    """For every check, method and bound the verdict with the largest value; not a number before all others."""
    worst: dict[tuple[str, str, float], Verdict] = {}
    for one in verdicts:
        key = (one.check, one.method, one.bound)
        if key not in worst or not one.value <= worst[key].value:
            worst[key] = one
    return list(worst.values())


def margins(verdicts: Sequence[Verdict]) -> TextTable:
    """For every check, method and bound: the largest value that was seen, the bound, their ratio, and where.

    Without the verdicts on the bounds themselves: of those nothing is seen.
    """
    rows = []
    for one in largest_seen([one for one in verdicts if one.check != "bound"]):
        ratio = f"{one.margin:.3g}" if math.isfinite(one.margin) else "-"
        texts = (one.check, one.method, f"{one.value:.2e}", f"{one.bound:.2e}", ratio, f"{one.scene} {one.channel}")
        rows.append(tuple(map(printable, texts)))
    return TextTable(("check", "method", "seen", "bound", "ratio", "where"), rows)


def check_page(results: Path) -> dict[str, object]:
    """What `rotor-mbs check` finds in the results file. Raises StoreError, InputError."""
    found = judge_file(results, load_bounds(None))
    failed = [one for one in found if not one.passed]
    count = f"{len(failed)} of {len(found)} verdicts fail" if failed else f"All {len(found)} verdicts pass"
    # A count of faults has no distance to its bound: zero is all there is.
    measured = [one for one in worst_first(found) if one.passed and 0.0 < one.margin < math.inf]
    return {
        "lead": [f"{count}: numbers computed again from the stored samples, each against its bound."],
        "failures": Section(tables=[_table("Verdicts that fail", worst_first(failed))]),
        "nearest": Section(tables=[_table("The verdicts that pass by least", measured[:WORST])]),
        "all": Section(
            tables=[_table("The largest number seen of every check, method and bound", largest_seen(found))]
        ),
    }


def _table(caption: str, verdicts: Sequence[Verdict]) -> PageTable:
    head = ("Check", "Method", "Where", "Seen", "Bound", "Margin", "Outcome")
    return PageTable(caption, head, [_row(one) for one in verdicts], numeric=(3, 4, 5))


def _row(one: Verdict) -> Row:
    outcome = TableCell("pass", "good") if one.passed else TableCell("fail", "bad", note=printable(one.look_at))
    return [
        printable(one.check),
        method_cell(printable(one.method)),
        TableCell(printable(one.scene), note=printable(one.channel)),
        number(one.value),
        with_unit(one.bound, one.unit),
        number(one.margin, 3) if math.isfinite(one.margin) else NOTHING,
        outcome,
    ]
