"""What CI systems take: the composite action's steps as plain bash, the GitLab job's script, summaries and trends."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml
from support.checking import results_file, shipped

from rotor_mbs.analysis.checks import Check, Where
from rotor_mbs.cli import main
from rotor_mbs.report.pages import check as verdict_formats
from rotor_mbs.studies.check import regressions
from rotor_mbs.studies.run import run_scenes

ROOT = Path(__file__).parents[2]
SCENE, METHOD = "check/general", "exudyn_tree/rk67"


@pytest.fixture(scope="module")
def earlier(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return results_file(tmp_path_factory.mktemp("earlier") / "results.h5", [SCENE], [METHOD])


@pytest.fixture(scope="module")
def loosened(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same run at a longer step: its energy drift grows thirtyfold and stays below its bound."""
    path = tmp_path_factory.mktemp("loosened") / "results.h5"
    scene = shipped(SCENE)
    run_scenes([scene], {SCENE: [METHOD]}, path, workers=0, timeout_s=60.0, settings={"step": 0.006})
    return path


# Against an earlier file


def test_a_file_against_itself_passes(earlier: Path) -> None:
    assert main(["check", str(earlier), "--against", str(earlier)]) == 0


def test_a_loosened_run_that_passes_its_bounds_is_found(
    earlier: Path, loosened: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", str(loosened)]) == 0
    capsys.readouterr()
    assert main(["check", str(loosened), "--against", str(earlier)]) == 1
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("FAIL")]
    assert any(line.startswith(f"FAIL against: {SCENE} {METHOD} energy: balance") for line in lines), lines
    assert main(["check", str(loosened), "--against", str(earlier), "--shrink", "1e9"]) == 0


def test_a_run_that_is_gone_is_found(earlier: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = results_file(tmp_path / "other.h5", [SCENE], ["lagrange/dop853"])
    capsys.readouterr()
    assert main(["check", str(other), "--against", str(earlier)]) == 1
    (line,) = [
        line for line in capsys.readouterr().out.splitlines() if line.startswith(f"FAIL against: {SCENE} {METHOD}")
    ]
    assert "run: all: nan" in line
    assert "not in this one" in line


def test_an_earlier_file_that_is_none_is_bad_input(earlier: Path, tmp_path: Path) -> None:
    assert main(["check", str(earlier), "--against", str(tmp_path / "none.h5")]) == 2


@pytest.mark.parametrize(
    ("before", "now", "passes"),
    [
        (1e-12, 9.9e-12, True),
        (1e-12, 1.1e-11, False),
        (0.0, 1e-16, True),  # rounding
        (0.0, 1e-12, False),
        (2.0, 3.0, True),  # failed before
        (2.0, 0.5, True),
        (0.5, 2.0, False),  # flipped
        (0.5, float("nan"), False),
    ],
)
def test_a_margin_may_shrink_by_the_factor(before: float, now: float, passes: bool) -> None:
    def verdict(value: float) -> Check:
        return Check("energy", Where("scene", "method", "balance"), value, 1.0, "", "of scale")

    [found] = regressions([verdict(now)], [verdict(before)], 10.0)
    assert found.passed == passes


# Files for CI systems


def test_junit_cases_have_value_bound_and_margin(earlier: Path, tmp_path: Path) -> None:
    path = tmp_path / "junit.xml"
    assert main(["check", str(earlier), "--junit", str(path)]) == 0
    for case in ElementTree.parse(path).iter("testcase"):
        found = {item.attrib["name"]: item.attrib["value"] for item in case.iter("property")}
        assert set(found) == {"value", "bound", "margin", "unit"}
        assert float(found["value"]) <= float(found["bound"])


def test_trend_and_badge(earlier: Path, tmp_path: Path) -> None:
    trend, badge = tmp_path / "trend.json", tmp_path / "badge.json"
    assert main(["check", str(earlier), "--trend", str(trend), "--badge", str(badge)]) == 0
    rows = json.loads(trend.read_text())
    assert {row["name"] for row in rows} >= {f"agreement {METHOD}", f"energy {METHOD}"}
    assert all(set(row) == {"name", "unit", "value"} and 0.0 <= row["value"] <= 1.0 for row in rows)
    shown = json.loads(badge.read_text())
    assert (shown["schemaVersion"], shown["color"]) == (1, "brightgreen")
    assert re.fullmatch(r"\d+ passed", shown["message"])


def _many(count: int) -> list[Check]:
    return [Check("tip", Where(f"s{i}|<b>", "m/i", "tip"), 1.0 + i, 1.0, "look", "m") for i in range(count)]


def test_the_summary_has_the_ten_worst_and_no_markup_of_names() -> None:
    text = verdict_formats.summary(_many(25))
    rows = [line for line in text.splitlines() if "**FAIL**" in line]
    assert [row.split(" | ")[2] for row in rows] == [rf"s{i}\|\<b\>" for i in range(24, 14, -1)]
    assert "| tip | 25 | 24 |" in text  # the first is on its bound


# The composite action and the GitLab job, run line by line


def _action() -> Any:
    return yaml.safe_load((ROOT / ".github/actions/check/action.yml").read_text())


def _bash(script: str, folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """As a runner does it: bash -e, with the command `rotor-mbs` on the path."""
    place = folder / "bin"
    place.mkdir(exist_ok=True)
    command = place / "rotor-mbs"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m rotor_mbs "$@"\n')
    command.chmod(0o755)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **variables, "PATH": f"{place}:{os.environ['PATH']}"}
    return subprocess.run(
        ["bash", "-eo", "pipefail", "-c", script], cwd=folder, env=environment, capture_output=True, text=True
    )


def _run_action(folder: Path, **given: str) -> list[subprocess.CompletedProcess[str]]:
    action = _action()
    inputs = {name: one["default"] for name, one in action["inputs"].items()} | given
    done = []
    for step in action["runs"]["steps"]:
        assert step["shell"] == "bash"
        assert "${{" not in step["run"]  # an input is a value of a variable, never a piece of the script
        names = {key: re.fullmatch(r"\$\{\{ inputs\.(\w+) \}\}", text) for key, text in step["env"].items()}
        values = {key: str(inputs[match[1]]) for key, match in names.items() if match}
        assert len(values) == len(step["env"])
        summary = str(folder / "summary.md")
        done.append(_bash(step["run"], folder, GITHUB_STEP_SUMMARY=summary, GITHUB_ACTION_PATH=str(folder), **values))
        if done[-1].returncode:
            break
    return done


def test_the_action_passes_and_leaves_its_files(earlier: Path, tmp_path: Path) -> None:
    done = _run_action(tmp_path, file=str(earlier), require=METHOD, package="")
    assert [one.returncode for one in done] == [0, 0], done[-1]
    assert (tmp_path / "summary.md").read_text().startswith("### rotor-mbs check")
    names = {"verdicts.json", "junit.xml", "trend.json", "badge.json"}
    assert {path.name for path in (tmp_path / "rotor-mbs-check").iterdir()} == names


def test_the_action_fails_on_a_loosened_run(earlier: Path, loosened: Path, tmp_path: Path) -> None:
    done = _run_action(tmp_path, file=str(loosened), against=str(earlier), package="")
    assert [one.returncode for one in done] == [0, 1]
    assert "::error title=rotor-mbs against" in done[-1].stdout


def test_the_action_takes_no_command_from_an_input(tmp_path: Path) -> None:
    done = _run_action(tmp_path, file=f"$(touch {tmp_path}/made); touch {tmp_path}/made", package="")
    assert done[-1].returncode == 2
    assert not (tmp_path / "made").exists()


def test_the_action_installs_the_checkout_it_is_from(tmp_path: Path) -> None:
    script = _action()["runs"]["steps"][0]["run"].replace("python -m pip", "echo")
    done = _bash(script, tmp_path, PACKAGE=".", GITHUB_ACTION_PATH=str(ROOT / ".github/actions/check"))
    place = Path(done.stdout.split()[-1])
    assert (place / "pyproject.toml").samefile(ROOT / "pyproject.toml")


def test_the_gitlab_job_is_plain_bash_too(earlier: Path, tmp_path: Path) -> None:
    job = yaml.safe_load((ROOT / ".gitlab/rotor-mbs-check.yml").read_text())[".rotor-mbs-check"]
    variables = {**job["variables"], "PACKAGE": "", "FILE": str(earlier), "AGAINST": str(earlier)}
    done = _bash("\n".join(job["script"]), tmp_path, **variables)
    assert done.returncode == 0, done
    for name in [job["artifacts"]["reports"]["junit"], *job["artifacts"]["paths"]]:
        assert (tmp_path / name).stat().st_size
