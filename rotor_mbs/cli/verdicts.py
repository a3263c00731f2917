"""Commands `check` and `test-method`, and the formats of their results.

The results are checks, which are written as lines of text, JSON, JUnit XML, and annotations of
GitHub.
"""

from __future__ import annotations

import argparse
import functools
import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from rotor_mbs.analysis.checks import Check
from rotor_mbs.analysis.text_tables import TextTable
from rotor_mbs.cli.terminal import print_table
from rotor_mbs.errors import InputError
from rotor_mbs.runs.output_files import refuse_foreign, replace_file
from rotor_mbs.runs.progress import ProgressLine
from rotor_mbs.runs.read import is_sweep
from rotor_mbs.scenario.accuracy_bounds import read_bounds, shipped_bounds
from rotor_mbs.studies import check as study

# Maximum number of annotations: GitHub shows ten annotations of a step and drops all others without
# a message. It is also the maximum number of lines about margins that have shrunk.
WORST = 10


# Regular expressions that match every file that this program writes in the format.
# `refuse_foreign` recognizes an earlier output by them.
JUNIT = rb'<testsuites name="rotor-mbs check"'
JSON = rb'\A\[\]\Z|\A\[\n \{\n  "check": "'


def check(arguments: argparse.Namespace) -> int:
    """Check the accuracy of stored runs, or of the default set of runs, and print the failures.

    Parameters
    ----------
    arguments : `file`, the file to check, or None for the default set, which is computed by
        `method` with `jobs` processes; `bounds`, a TOML file with bounds; `require`, methods that
        must have run on every scene; `against`, an earlier file, and `allow_changed`, whether
        scenes may differ from it; `junit` and `json`, the files to write; `github`, whether
        failures are printed as annotations; `verbose`, whether passed checks are printed, too.

    Returns
    -------
    int
        1 if a check fails, otherwise 0.

    Raises
    ------
    InputError
        If options exclude each other, or the file and the earlier file are of different kinds.
    """
    _refuse_foreign(arguments)
    if arguments.allow_changed and arguments.against is None:
        raise InputError("--allow-changed: allowed: with --against OLD")
    if arguments.require and arguments.file is None:
        raise InputError("--require: allowed: with a FILE that is to have the runs")
    own_bounds = read_bounds(arguments.bounds) if arguments.bounds else ()
    bounds = shipped_bounds().with_entries(own_bounds)
    earlier = None if arguments.against is None else study.check_file(arguments.against, bounds)
    if (
        earlier is not None
        and arguments.file is not None
        and is_sweep(arguments.against) != is_sweep(arguments.file)
    ):
        raise InputError(
            f"--against {arguments.against}: a file of another kind than {arguments.file}"
        )
    if arguments.file is not None:
        verdicts = study.check_file(arguments.file, bounds, arguments.require or ())
    else:
        with ProgressLine() as progress:
            verdicts = study.check_default_set(bounds, arguments.jobs, progress, arguments.method)
    scenes = study.scenes_checked(arguments.file)
    for bound in study.unused_bounds(own_bounds, verdicts, scenes):
        told = f"{bound.check!r}, method {bound.method!r}, scenes {bound.scenes!r}"
        limit = "; scenes: of shipped scenes, unchanged" if bound.scenes != "*" else ""
        print(
            f"warning: {escaped(str(arguments.bounds))}: no check fits the bound of {told}{limit}",
            file=sys.stderr,
        )
    if verdicts and earlier is not None:
        before = study.scenes_checked(arguments.against)
        changes = study.changed_scenes(scenes, before, are_allowed=arguments.allow_changed)
        changed = {change.where.scene for change in changes if change.value}
        has_sweep = is_sweep(arguments.against)
        settings = {}
        if arguments.file is not None and not has_sweep:
            settings = study.changed_settings(arguments.file, arguments.against)
        verdicts += [*study.regressions(verdicts, earlier, changed, settings), *changes]
        if arguments.file is not None and has_sweep:
            verdicts.append(study.runs_gone(arguments.file, arguments.against))

    _write_verdicts(arguments, verdicts)
    # With `--json -` the JSON must be alone on the standard output.
    stream = sys.stderr if arguments.json == Path("-") else sys.stdout
    failures = [verdict for verdict in verdicts if not verdict.passed]
    annotated = worst_first(failures)[:WORST] if arguments.github else []
    for text in report_lines(verdicts, annotated, verbose=arguments.verbose):
        print(text, file=stream)
    if arguments.file is not None:
        for scene in scenes.values():
            if scene.label != scene.name:
                print(escaped(scene.label), file=stream)
    runs = ", ".join(f"{count} {method}" for method, count in study.judged_runs(verdicts).items())
    if arguments.file is not None and is_sweep(arguments.file):
        print(
            "runs of a sweep: checked that all are there and as written; their accuracy was judged "
            f"when they were computed (rotor-mbs show {arguments.file})",
            file=stream,
        )
    else:
        print(f"runs checked: {runs or 'none'}", file=stream)
    print(f"{len(verdicts) - len(failures)} passed, {len(failures)} failed", file=stream)
    return 1 if failures else 0


def report_lines(
    verdicts: Sequence[Check], annotated: Sequence[Check] = (), *, verbose: bool = False
) -> list[str]:
    """Return the lines that report checks; each failure has one line.

    Parameters
    ----------
    verdicts : checks, in the order in which they are reported.
    annotated : failures that are written as annotations of GitHub, not as lines of text.
    verbose : whether passed checks have lines, too.

    Returns
    -------
    list of str
        A line for each failure and each changed scene, or with `verbose` for each check; then the
        annotations. Without `verbose`, only the ten worst failures `against` an earlier file have
        lines, because a single changed default setting can shrink hundreds of margins.
    """
    shrunk = worst_first(
        [verdict for verdict in verdicts if verdict.name == study.AGAINST and not verdict.passed]
    )
    left_out = [] if verbose else shrunk[WORST:]
    lines = []
    for verdict in verdicts:
        is_wanted = (
            verbose or not verdict.passed or (verdict.name == study.CHANGED and verdict.value > 0.0)
        )
        if is_wanted and verdict not in annotated and verdict not in left_out:
            lines.append(line(verdict))
    if left_out:
        lines.append(f"... {len(left_out)} more against the earlier file (all with --verbose)")
    return [*lines, *map(github, annotated)]


def worst_first(failures: Sequence[Check]) -> list[Check]:
    """Return failed checks sorted by rising margin; checks whose margin is NaN come first."""
    return sorted(failures, key=lambda check: (not math.isnan(check.margin), check.margin))


def test_method(arguments: argparse.Namespace) -> int:
    """Test methods, and print each check; a failed check has the most likely reason.

    Parameters
    ----------
    arguments : `methods`, the names of the methods; `timeout`, the time limit of a run in s;
        `junit` and `json`, the files to write.

    Returns
    -------
    int
        1 if a check fails, otherwise 0.

    Raises
    ------
    InputError
        If `junit` or `json` is a file of another kind, or both are the same file.
    """
    from rotor_mbs.studies.method_test import examine  # imported here: `check` does without it

    _refuse_foreign(arguments)
    verdicts: list[Check] = []
    with ProgressLine() as progress:
        for name in arguments.methods:
            show = functools.partial(progress.stage, f"{name}: scenes and other checks")
            verdicts += examine(name, arguments.timeout, show)
    _write_verdicts(arguments, verdicts)
    if arguments.json != Path("-"):
        rows: list[tuple[str, ...]] = []
        for verdict in verdicts:
            # Of these checks the note says what was found, such as the measured order.
            has_note = not verdict.passed or verdict.name in ("refusal", "order")
            number = bound = ""
            if verdict.unit:
                number, bound = f"{verdict.value:.1e}", f"{verdict.bound:.1e}"
            rows.append(
                (
                    verdict.where.method,
                    verdict.name,
                    verdict.where.scene,
                    number,
                    bound,
                    verdict.unit,
                    "pass" if verdict.passed else "FAIL",
                    verdict.hint if has_note else "",
                )
            )
        heads = ("method", "check", "scene", "value", "allowed", "unit", "result", "reason")
        print_table(TextTable(heads, rows))
        failed = sum(not verdict.passed for verdict in verdicts)
        print(f"{len(verdicts) - failed} passed, {failed} failed")
    return int(not all(verdict.passed for verdict in verdicts))


def _refuse_foreign(arguments: argparse.Namespace) -> None:
    """Raise InputError if --junit or --json is a file of another kind, or both are the same file.

    Commands call this function before they compute anything.

    Parameters
    ----------
    arguments : `junit` and `json`, paths or None.
    """
    if (
        arguments.junit is not None
        and arguments.json is not None
        and arguments.junit.resolve() == arguments.json.resolve()
    ):
        raise InputError(f"--json {arguments.json}: is the file of --junit; allowed: two files")
    if arguments.junit is not None:
        refuse_foreign(arguments.junit, JUNIT)
    if arguments.json is not None and arguments.json != Path("-"):
        refuse_foreign(arguments.json, JSON)


def _write_verdicts(arguments: argparse.Namespace, verdicts: Sequence[Check]) -> None:
    if arguments.junit is not None:
        replace_file(arguments.junit, junit(verdicts), JUNIT)
    if arguments.json == Path("-"):
        print(as_json(verdicts))
    elif arguments.json is not None:
        replace_file(arguments.json, as_json(verdicts).encode(), JSON)


def line(check: Check) -> str:
    """Return a check as one line of text.

    The line has the outcome, the name of the check, scene, method and channel, the value, the bound
    and the margin. For a failure, or an allowed change of a scene, it also has the hint.

    Parameters
    ----------
    check : the check; control characters in its texts are escaped.
    """
    outcome = "pass" if check.passed else "FAIL"
    margin = "inf" if math.isinf(check.margin) else f"{check.margin:.3g}"
    unit = f" {check.unit}" if check.unit else ""
    is_allowed_change = check.name == study.CHANGED and check.value > 0.0
    hint = f"; {check.hint}" if not check.passed or is_allowed_change else ""
    return escaped(
        f"{outcome} {check.name}: {' '.join(check.where)}: {check.value:.2e}, bound "
        f"{check.bound:.2e}{unit}, margin {margin}{hint}"
    )


def github(check: Check) -> str:
    """Return a workflow command that GitHub shows as an error annotation."""
    title = escaped(f"rotor-mbs {check.name} {check.where.scene} {check.where.method}").replace(
        "%", "%25"
    )
    title = title.replace(":", "%3A").replace(",", "%2C")
    return f"::error title={title}::{line(check).replace('%', '%25')}"  # without line breaks


def as_json(checks: Sequence[Check]) -> str:
    """Return checks as a JSON list with an object for each check.

    NaN and infinity, which JSON does not have, become null.

    Parameters
    ----------
    checks : the checks, in the order of the list.
    """
    rows = []
    for check in checks:
        numbers: dict[str, float | None] = {}
        for name in ("value", "bound", "margin"):
            number = getattr(check, name)
            numbers[name] = number if math.isfinite(number) else None
        rows.append(
            {
                "check": check.name,
                **check.where._asdict(),
                **numbers,
                "unit": check.unit,
                "passed": check.passed,
                "hint": check.hint,
            }
        )
    return json.dumps(rows, indent=1)


def junit(checks: Sequence[Check]) -> bytes:
    """Return checks as JUnit XML, which the viewers of GitHub and GitLab read.

    Parameters
    ----------
    checks : the checks; each becomes a test case, and those of a scene become a test suite.

    Returns
    -------
    bytes
        The document in UTF-8.
    """
    root = ElementTree.Element("testsuites", {"name": "rotor-mbs check", **_counts(checks)})
    for scene in dict.fromkeys(check.where.scene for check in checks):
        of_scene = [check for check in checks if check.where.scene == scene]
        suite = ElementTree.SubElement(
            root, "testsuite", {"name": escaped(scene), **_counts(of_scene)}
        )
        for check in of_scene:
            name = escaped(f"{check.name} {check.where.method} {check.where.channel}")
            case = ElementTree.SubElement(
                suite, "testcase", classname=escaped(f"rotor_mbs.{scene}"), name=name, time="0"
            )
            properties = ElementTree.SubElement(case, "properties")
            for key in ("value", "bound", "margin", "unit"):
                ElementTree.SubElement(
                    properties, "property", name=key, value=escaped(str(getattr(check, key)))
                )
            if not check.passed:
                failure = ElementTree.SubElement(
                    case, "failure", message=line(check), type=check.name
                )
                failure.text = line(check)
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text


def _counts(checks: Sequence[Check]) -> dict[str, str]:
    failed = sum(not check.passed for check in checks)
    return {"tests": str(len(checks)), "failures": str(failed), "errors": "0"}


def escaped(text: str) -> str:
    """Return `text` with escapes in place of characters that are not printable.

    Control characters would control a terminal. XML allows neither them nor surrogates.
    """
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in text)
