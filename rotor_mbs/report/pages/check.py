"""Checks as lines of text, JSON, JUnit XML, annotations and job summaries of GitHub, and as a page."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from xml.etree import ElementTree

from rotor_mbs.analysis.checks import Check
from rotor_mbs.report.elements import PageTable, Row, Section, TableCell
from rotor_mbs.report.numbers import NOTHING, number, with_unit
from rotor_mbs.report.pages import method_cell
from rotor_mbs.runs.read import OpenResults
from rotor_mbs.scenario.accuracy_bounds import load_bounds
from rotor_mbs.studies.check import judge_file

WORST = 10  # annotations: GitHub shows as many of a step and drops the others silently


# What is found in every output of a kind.
JUNIT = rb'<testsuites name="rotor-mbs check"'
JSON = rb'\A\[\]\Z|\A\[\n \{\n  "check": "'


def line(check: Check) -> str:
    """One line: outcome, what was checked where, the value, the bound, the margin; of a failure what to look at."""
    outcome = "pass" if check.passed else "FAIL"
    margin = "inf" if math.isinf(check.margin) else f"{check.margin:.3g}"
    unit = f" {check.unit}" if check.unit else ""
    hint = "" if check.passed else f"; {check.hint}"
    return printable(
        f"{outcome} {check.name}: {' '.join(check.where)}: {check.value:.2e}, "
        f"bound {check.bound:.2e}{unit}, margin {margin}{hint}"
    )


def github(check: Check) -> str:
    """A workflow command that GitHub shows as an error annotation."""
    title = printable(f"rotor-mbs {check.name} {check.where.scene} {check.where.method}").replace("%", "%25")
    title = title.replace(":", "%3A").replace(",", "%2C")
    return f"::error title={title}::{line(check).replace('%', '%25')}"  # neither has a line break


def worst_first(checks: Sequence[Check]) -> list[Check]:
    """By share of the bound, the largest first; not a number before all others."""
    return sorted(checks, key=lambda check: check.margin)


def summary(checks: Sequence[Check]) -> str:
    """A job summary in Markdown: a row per name of a check, then the ten nearest to their bounds or beyond."""
    rows = ["### rotor-mbs check", "", "| check | count | failed | smallest margin |", "|---|---:|---:|---:|"]
    for name in dict.fromkeys(check.name for check in checks):
        same = [check for check in checks if check.name == name]
        failed = sum(not check.passed for check in same)
        rows.append(f"| {_cell(name)} | {len(same)} | {failed} | {min(check.margin for check in same):.3g} |")
    rows += ["", "| | check | scene | method | channel | value | bound | unit |", "|---|---|---|---|---|---:|---:|---|"]
    for check in worst_first(checks)[:WORST]:
        texts = [_cell(text) for text in (check.name, *check.where)]
        outcome = "pass" if check.passed else "**FAIL**"
        numbers = [f"{check.value:.2e}", f"{check.bound:.2e}", _cell(check.unit)]
        rows.append("| " + " | ".join([outcome, *texts, *numbers]) + " |")
    return "\n".join(rows) + "\n"


def _cell(text: str) -> str:
    """As text in a cell of a Markdown table: nothing of it is markup."""
    return re.sub(r"([\\`*_{}\[\]<>()#!|~&])", r"\\\1", printable(text))


def as_json(checks: Sequence[Check]) -> str:
    """A list of objects; numbers that JSON cannot hold (NaN, infinity) become null."""
    rows = []
    for check in checks:
        numbers = {"value": check.value, "bound": check.bound, "margin": check.margin}
        rows.append(
            {
                "check": check.name,
                **check.where._asdict(),
                **{name: value if math.isfinite(value) else None for name, value in numbers.items()},
                "unit": check.unit,
                "passed": check.passed,
                "hint": check.hint,
            }
        )
    return json.dumps(rows, indent=1)


def junit(checks: Sequence[Check]) -> bytes:
    """JUnit XML as GitHub's and GitLab's viewers read it: a suite per scene, a case per check."""
    root = ElementTree.Element("testsuites", {"name": "rotor-mbs check", **_counts(checks)})
    for scene in dict.fromkeys(check.where.scene for check in checks):
        of_scene = [check for check in checks if check.where.scene == scene]
        suite = ElementTree.SubElement(root, "testsuite", {"name": printable(scene), **_counts(of_scene)})
        for check in of_scene:
            name = printable(f"{check.name} {check.where.method} {check.where.channel}")
            case = ElementTree.SubElement(
                suite, "testcase", classname=printable(f"rotor_mbs.{scene}"), name=name, time="0"
            )
            properties = ElementTree.SubElement(case, "properties")
            for key in ("value", "bound", "margin", "unit"):
                ElementTree.SubElement(properties, "property", name=key, value=printable(str(getattr(check, key))))
            if not check.passed:
                failure = ElementTree.SubElement(case, "failure", message=line(check), type=check.name)
                failure.text = line(check)
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text


def _counts(checks: Sequence[Check]) -> dict[str, str]:
    failed = sum(not check.passed for check in checks)
    return {"tests": str(len(checks)), "failures": str(failed), "errors": "0"}


def printable(text: str) -> str:
    """`text` with escapes for what controls a terminal or is not allowed in XML: control characters, surrogates."""
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in text)


def check_page(opened: OpenResults) -> dict[str, object]:
    """What `rotor-mbs check` finds in the results file. Raises StoreError, InputError."""
    checks = judge_file(opened.path, load_bounds(None))
    failed = [check for check in checks if not check.passed]
    # A count of faults has no distance to its bound: zero is all there is.
    measured = [check for check in worst_first(checks) if check.passed and 0.0 < check.margin < math.inf]
    largest: dict[tuple[str, str, float], Check] = {}  # by name, method and bound; not a number before all others
    for check in checks:
        key = (check.name, check.where.method, check.bound)
        if key not in largest or not check.value <= largest[key].value:
            largest[key] = check
    sections = {
        "failures": ("Checks that fail", worst_first(failed)),
        "nearest": ("Checks with the smallest margins", measured[:WORST]),
        "all": ("Largest value for every check, method and bound", [*largest.values()]),
    }
    page: dict[str, object] = {"count": len(checks), "failed": len(failed)}
    for section, (caption, shown) in sections.items():
        rows: list[Row] = []
        for check in shown:
            rows.append([
                check.name,
                method_cell(check.where.method),
                TableCell(check.where.scene, note=check.where.channel),
                number(check.value),
                with_unit(check.bound, check.unit),
                number(check.margin, 3) if math.isfinite(check.margin) else NOTHING,
                TableCell("pass", "good") if check.passed else TableCell("fail", "bad", note=check.hint),
            ])  # fmt: skip
        head = ("Check", "Method", "Where", "Value", "Bound", "Margin", "Outcome")
        page[section] = Section(tables=[PageTable(caption, head, rows)])
    return page
