"""What CI systems take: a comparison with an earlier file, JUnit, summaries; the GitHub action and the GitLab job."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml
from support.commands import rotor_mbs

from rotor_mbs.report.pages import check as verdict_formats
from rotor_mbs.scenario.accuracy_bounds import load_bounds
from rotor_mbs.studies.check import judge_file, regressions

ROOT = Path(__file__).parents[2]
SCENE, METHOD = "check/general", "exudyn_tree/rk67"


def results_of(folder: Path, method: str, *more: str) -> Path:
    path = folder / "results.h5"
    assert rotor_mbs("run", SCENE, "-m", method, "-o", path, "-j", "1", *more).status == 0
    return path


@pytest.fixture(scope="module")
def earlier(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return results_of(tmp_path_factory.mktemp("earlier"), METHOD)


@pytest.fixture(scope="module")
def loosened(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same run at a longer step: its energy drift grows thirtyfold and stays below its bound."""
    return results_of(tmp_path_factory.mktemp("loosened"), METHOD, "--set", "step=0.006")


# Against an earlier file


def test_a_file_against_itself_passes(earlier: Path) -> None:
    assert rotor_mbs("check", earlier, "--against", earlier).status == 0


def test_a_loosened_run_that_passes_its_bounds_is_found(earlier: Path, loosened: Path) -> None:
    assert rotor_mbs("check", loosened).status == 0
    compared = rotor_mbs("check", loosened, "--against", earlier)
    assert compared.status == 1
    assert f"FAIL against: {SCENE} {METHOD} energy: balance" in compared.out
    assert rotor_mbs("check", loosened, "--against", earlier, "--shrink", "1e9").status == 0


def test_a_run_that_is_gone_is_found(earlier: Path, folder: Path) -> None:
    compared = rotor_mbs("check", results_of(folder, "lagrange/dop853"), "--against", earlier)
    assert compared.status == 1
    (line,) = [line for line in compared.out.splitlines() if line.startswith(f"FAIL against: {SCENE} {METHOD}")]
    assert "run: all: nan" in line
    assert "not in this one" in line


def test_an_earlier_file_that_is_none_is_bad_input(earlier: Path, folder: Path) -> None:
    assert rotor_mbs("check", earlier, "--against", folder / "none.h5").status == 2


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
def test_a_margin_may_shrink_by_the_factor(before: float, now: float, passes: bool, earlier: Path) -> None:
    verdict = replace(judge_file(earlier, load_bounds())[0], bound=1.0)
    (compared,) = regressions([replace(verdict, value=now)], [replace(verdict, value=before)], 10.0)
    assert compared.passed == passes


# Files for CI systems


def test_junit_cases_have_value_bound_and_margin(earlier: Path, folder: Path) -> None:
    assert rotor_mbs("check", earlier, "--junit", "junit.xml").status == 0
    for case in ElementTree.parse(folder / "junit.xml").iter("testcase"):
        properties = {item.attrib["name"]: item.attrib["value"] for item in case.iter("property")}
        assert set(properties) == {"value", "bound", "margin", "unit"}
        assert float(properties["value"]) <= float(properties["bound"])


def test_the_summary_has_the_ten_worst(earlier: Path) -> None:
    verdict = replace(judge_file(earlier, load_bounds())[0], bound=1.0)
    text = verdict_formats.summary([replace(verdict, value=1.0 + i) for i in range(25)])
    rows = [line for line in text.splitlines() if "**FAIL**" in line]
    assert [f"{25.0 - i:.2e}" in row for i, row in enumerate(rows)] == [True] * 10
    assert "| 25 | 24 |" in text  # the first is on its bound


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
    inputs = {name: declared["default"] for name, declared in action["inputs"].items()} | given
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


def test_the_action_passes_and_leaves_its_files(earlier: Path, folder: Path) -> None:
    done = _run_action(folder, file=str(earlier), require=METHOD, package="")
    assert [step.returncode for step in done] == [0, 0], done[-1]
    assert (folder / "summary.md").read_text().startswith("### rotor-mbs check")
    assert {path.name for path in (folder / "rotor-mbs-check").iterdir()} == {"verdicts.json", "junit.xml"}


@pytest.mark.full
def test_the_action_fails_on_a_loosened_run(earlier: Path, loosened: Path, folder: Path) -> None:
    done = _run_action(folder, file=str(loosened), against=str(earlier), package="")
    assert [step.returncode for step in done] == [0, 1]
    assert "::error title=rotor-mbs against" in done[-1].stdout


def test_the_action_takes_no_command_from_an_input(folder: Path) -> None:
    done = _run_action(folder, file=f"$(touch {folder}/made); touch {folder}/made", package="")
    assert done[-1].returncode == 2
    assert not (folder / "made").exists()


def test_the_action_installs_the_checkout_it_is_from(folder: Path) -> None:
    script = _action()["runs"]["steps"][0]["run"].replace("python -m pip", "echo")
    done = _bash(script, folder, PACKAGE=".", GITHUB_ACTION_PATH=str(ROOT / ".github/actions/check"))
    place = Path(done.stdout.split()[-1])
    assert (place / "pyproject.toml").samefile(ROOT / "pyproject.toml")


@pytest.mark.full
def test_the_gitlab_job_is_plain_bash_too(earlier: Path, folder: Path) -> None:
    job = yaml.safe_load((ROOT / ".gitlab/rotor-mbs-check.yml").read_text())[".rotor-mbs-check"]
    variables = {**job["variables"], "PACKAGE": "", "FILE": str(earlier), "AGAINST": str(earlier)}
    done = _bash("\n".join(job["script"]), folder, **variables)
    assert done.returncode == 0, done
    for name in [job["artifacts"]["reports"]["junit"], *job["artifacts"]["paths"]]:
        assert (folder / name.replace("$FILE", str(earlier))).stat().st_size


# The whole workflows of docs/check.md

GITHUB, GITLAB = map(yaml.safe_load, re.findall(r"```yaml\n(.*?)```", (ROOT / "docs/check.md").read_text(), re.DOTALL))
PIP = "python -m pip install"


@pytest.fixture
def project(folder: Path) -> Path:
    """A repository with one scene, and what a runner puts there; `cache` is what later runs are given."""
    scene = (ROOT / "scenarios" / f"{SCENE}.toml").read_text()
    (folder / "my.toml").write_text(re.sub(r"(?m)^duration = .*$", "duration = 0.2", scene))
    return folder


def _github_run(folder: Path, ref: str) -> list[str]:
    """Runs the workflow's steps in turn; returns the names of what was used, with what was found in the cache."""
    used, matched = [], ""
    cached = folder / "cache" / "results.h5"
    for step in GITHUB["jobs"]["accuracy"]["steps"]:
        if "if" in step:
            assert step["if"] == "github.ref == 'refs/heads/main'"
            if ref != "refs/heads/main":
                continue
        given, action = step.get("with", {}), step.get("uses", "").split("@")[0]
        used.append(action)
        if "run" in step:
            done = _bash(step["run"].replace(PIP, "echo"), folder)
            assert done.returncode == 0, done
        elif action == "actions/cache/restore" and cached.exists():
            (folder / "main").mkdir(exist_ok=True)
            (folder / given["path"]).write_bytes(cached.read_bytes())
            matched = given["restore-keys"]
        elif action == "actions/cache/save":
            cached.parent.mkdir(exist_ok=True)
            cached.write_bytes((folder / given["path"]).read_bytes())
        elif action == "./rotor_mbs/.github/actions/check":
            assert given["against"] == "${{ steps.main.outputs.cache-matched-key && 'main/results.h5' || '' }}"
            steps = _run_action(folder, **{**given, "against": "main/results.h5" if matched else ""})
            assert [step.returncode for step in steps] == [0, 0], steps[-1]
            used[-1] += " against" * ("against" in (folder / "rotor-mbs-check" / "verdicts.json").read_text())
    return used


@pytest.mark.full
def test_the_workflow_for_github_has_no_earlier_file_at_first_and_then_compares(project: Path) -> None:
    check, save = "./rotor_mbs/.github/actions/check", "actions/cache/save"
    first = _github_run(project, "refs/heads/main")
    assert check in first
    assert save in first
    second = _github_run(project, "refs/pull/1/merge")
    assert f"{check} against" in second
    assert save not in second


@pytest.mark.full
def test_the_pipeline_for_gitlab_has_no_earlier_file_at_first_and_then_compares(project: Path) -> None:
    template = yaml.safe_load((ROOT / ".gitlab/rotor-mbs-check.yml").read_text())[GITLAB["accuracy"]["extends"]]
    job = {**template, **GITLAB["accuracy"], "variables": {**template["variables"], **GITLAB["accuracy"]["variables"]}}
    assert GITLAB["keep"]["cache"][0]["paths"] == job["cache"][0]["paths"] == [job["variables"]["AGAINST"]]
    script = "\n".join([*job["before_script"], *job["script"]]).replace(PIP, "echo")
    first = _bash(script, project, **job["variables"])
    assert first.returncode == 0, first
    assert "no earlier file" in first.stdout
    assert _bash("\n".join(GITLAB["keep"]["script"]), project).returncode == 0
    second = _bash(script, project, **job["variables"])
    assert second.returncode == 0, second
    assert "no earlier file" not in second.stdout
