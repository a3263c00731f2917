"""Verdicts as lines of text, JSON, JUnit XML, and annotations of GitHub.

Names and messages come from files of any origin: what is not printable is written as an escape.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from xml.etree import ElementTree

from rotor_mbs.analysis.verdicts import Verdict


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
    title = f"rotor-mbs {verdict.check} {verdict.scene} {verdict.method}"
    return f"::error title={_property(title)}::{_data(line(verdict))}"


def _data(text: str) -> str:
    """As GitHub's own toolkit escapes the text of a command."""
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    """As GitHub's own toolkit escapes a property of a command."""
    return _data(printable(text)).replace(":", "%3A").replace(",", "%2C")


def as_json(verdicts: Sequence[Verdict]) -> str:
    """A list of objects; numbers that JSON cannot hold (NaN, infinity) become null."""
    names = ("check", "scene", "method", "channel", "value", "bound", "unit", "margin", "passed", "look_at")
    rows = [{name: _finite(getattr(verdict, name)) for name in names} for verdict in verdicts]
    return json.dumps(rows, indent=1)


def _finite(value: object) -> object:
    return None if isinstance(value, float) and not math.isfinite(value) else value


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
        if not v.passed:
            failure = ElementTree.SubElement(case, "failure", message=line(v), type=v.check)
            failure.text = line(v)


def printable(text: str) -> str:
    """`text` with escapes for what controls a terminal or is not allowed in XML: control characters, surrogates."""
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in text)
