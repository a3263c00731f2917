"""Checks as lines of text, JSON, JUnit XML and annotations of GitHub."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from xml.etree import ElementTree

from rotor_mbs.analysis.checks import Check

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
