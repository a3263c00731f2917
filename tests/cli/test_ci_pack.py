"""What CI systems take: a comparison with an earlier file, JUnit, summaries; the GitHub action and the GitLab job."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml
from support.commands import rotor_mbs

import rotor_mbs as rm
from rotor_mbs.scenario.accuracy_bounds import shipped_bounds
from rotor_mbs.studies.check import judge_file, regressions

ROOT = Path(__file__).parents[2]
SCENE, METHOD = "check/general", "exudyn_tree/rk67"


def results_of(folder: Path, method: str, **settings: object) -> Path:
    return rm.run(SCENE, [method], **settings).save(folder / "results.h5")


@pytest.fixture(scope="module")
def earlier(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return results_of(tmp_path_factory.mktemp("earlier"), METHOD)


@pytest.fixture(scope="module")
def loosened(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same run at a longer step: its energy drift grows thirtyfold and stays below its bound."""
    return results_of(tmp_path_factory.mktemp("loosened"), METHOD, step=0.006)


# Against an earlier file


def test_a_loosened_run_that_passes_its_bounds_is_found(earlier: Path, loosened: Path) -> None:
    assert rotor_mbs("check", earlier, "--against", earlier).status == 0
    assert rotor_mbs("check", loosened).status == 0
    compared = rotor_mbs("check", loosened, "--against", earlier)
    assert compared.status == 1
    assert f"FAIL against: {SCENE} {METHOD} energy: balance" in compared.out


def test_a_run_that_is_gone_is_found(earlier: Path, folder: Path) -> None:
    compared = rotor_mbs("check", results_of(folder, "lagrange/dop853"), "--against", earlier)
    assert compared.status == 1
    (line,) = [line for line in compared.out.splitlines() if line.startswith(f"FAIL against: {SCENE} {METHOD}")]
    assert "run: all: nan" in line
    assert "missing in this one" in line
    assert rotor_mbs("check", earlier, "--against", folder / "none.h5").status == 2


@pytest.mark.parametrize(
    ("before", "now", "passes"),
    [
        (1e-12, 9.9e-12, True),
        (1e-12, 1.1e-11, False),
        (0.0, 1e-16, True),  # rounding
        (2.0, 3.0, True),  # failed before
        (0.5, 2.0, False),  # flipped
        (0.5, float("nan"), False),
    ],
)
def test_a_margin_may_shrink_tenfold(before: float, now: float, passes: bool, earlier: Path) -> None:
    verdict = replace(judge_file(earlier, shipped_bounds())[0], bound=1.0)
    (compared,) = regressions([replace(verdict, value=now)], [replace(verdict, value=before)])
    assert compared.passed == passes


# The composite action and the GitLab job, run line by line

ACTION = yaml.safe_load((ROOT / ".github/actions/check/action.yml").read_text())
JOB = yaml.safe_load((ROOT / ".gitlab/rotor-mbs-check.yml").read_text())[".rotor-mbs-check"]


def _bash(script: str, folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """As a runner does it: bash -e, with the command `rotor-mbs` on the path."""
    command = folder / "bin" / "rotor-mbs"
    command.parent.mkdir(exist_ok=True)
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m rotor_mbs "$@"\n')
    command.chmod(0o755)
    path = f"{command.parent}:{os.environ['PATH']}"
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **variables, "PATH": path}
    return subprocess.run(
        ["bash", "-eo", "pipefail", "-c", script], cwd=folder, env=environment, capture_output=True, text=True
    )


def _run_action(folder: Path, **given: str) -> list[subprocess.CompletedProcess[str]]:
    assert set(given) <= set(ACTION["inputs"])
    inputs = {name: declared["default"] for name, declared in ACTION["inputs"].items()} | given
    done = []
    for step in ACTION["runs"]["steps"]:
        assert step["shell"] == "bash"
        assert "${{" not in step["run"]  # an input is a value of a variable, never a piece of the script
        names = {key: re.fullmatch(r"\$\{\{ inputs\.(\w+) \}\}", text) for key, text in step["env"].items()}
        values = {key: str(inputs[match[1]]) for key, match in names.items() if match}
        assert len(values) == len(step["env"])
        done.append(_bash(step["run"], folder, GITHUB_ACTION_PATH=str(folder), **values))
        if done[-1].returncode:
            break
    return done


def test_the_action_fails_on_a_loosened_run_and_leaves_its_files(earlier: Path, loosened: Path, folder: Path) -> None:
    done = _run_action(folder, file=str(loosened), against=str(earlier), require=METHOD, package="")
    assert [step.returncode for step in done] == [0, 1], done[-1]
    assert "::error title=rotor-mbs against" in done[-1].stdout
    output = folder / "rotor-mbs-check"
    assert {path.name for path in output.iterdir()} == {"verdicts.json", "junit.xml"}
    for case in ElementTree.parse(output / "junit.xml").iter("testcase"):
        properties = {item.attrib["name"]: item.attrib["value"] for item in case.iter("property")}
        assert set(properties) == {"value", "bound", "margin", "unit"}
        is_within = float(properties["value"]) <= float(properties["bound"])
        assert is_within == (case.find("failure") is None)


def test_the_action_takes_no_command_from_an_input(folder: Path) -> None:
    done = _run_action(folder, file=f"$(touch {folder}/made); touch {folder}/made", package="")
    assert done[-1].returncode == 2
    assert not (folder / "made").exists()


def test_the_action_installs_the_checkout_it_is_from(folder: Path) -> None:
    script = ACTION["runs"]["steps"][0]["run"].replace("python -m pip", "echo")
    done = _bash(script, folder, PACKAGE=".", GITHUB_ACTION_PATH=str(ROOT / ".github/actions/check"))
    place = Path(done.stdout.split()[-1])
    assert (place / "pyproject.toml").samefile(ROOT / "pyproject.toml")


# The whole workflows of docs/check.md: the first time there is no earlier file, the second time there is

GITHUB, GITLAB = map(yaml.safe_load, re.findall(r"```yaml\n(.*?)```", (ROOT / "docs/check.md").read_text(), re.DOTALL))
PIP = "python -m pip install"
EARLIER = "main/results.h5"


@pytest.fixture
def project(folder: Path) -> Path:
    """A repository with one scene, and what a runner puts there."""
    scene = (ROOT / "scenarios" / f"{SCENE}.toml").read_text()
    (folder / "my.toml").write_text(re.sub(r"(?m)^duration = .*$", "duration = 0.2", scene))
    return folder


@pytest.mark.full
def test_the_workflow_for_github_compares_with_the_file_of_the_main_branch(project: Path) -> None:
    steps = GITHUB["jobs"]["accuracy"]["steps"]
    caches = [step for step in steps if "actions/cache" in step.get("uses", "")]
    assert [step["with"]["path"] for step in caches] == [EARLIER, EARLIER]  # restored first, saved at last
    for against in ("", EARLIER):
        for step in steps:
            if "run" in step:
                done = _bash(step["run"].replace(PIP, "echo"), project)
                assert done.returncode == 0, done
            elif step["uses"] == "./rotor_mbs/.github/actions/check":
                done = _run_action(project, **{**step["with"], "against": against})
                assert [end.returncode for end in done] == [0, 0], done[-1]
        assert ("against" in (project / "rotor-mbs-check" / "verdicts.json").read_text()) == bool(against)


@pytest.mark.full
def test_the_pipeline_for_gitlab_compares_with_the_file_of_the_main_branch(project: Path) -> None:
    assert GITLAB["accuracy"]["extends"] == ".rotor-mbs-check"
    job = {**JOB, **GITLAB["accuracy"], "variables": {**JOB["variables"], **GITLAB["accuracy"]["variables"]}}
    assert GITLAB["keep"]["cache"][0]["paths"] == job["cache"][0]["paths"] == [job["variables"]["AGAINST"]]
    script = "\n".join([*job["before_script"], *job["script"]]).replace(PIP, "echo")
    for is_first in (True, False):
        done = _bash(script, project, **job["variables"])
        assert done.returncode == 0, done
        assert ("no earlier file" in done.stdout) == is_first
        for name in [job["artifacts"]["reports"]["junit"], *job["artifacts"]["paths"]]:
            assert (project / name.replace("$FILE", job["variables"]["FILE"])).stat().st_size
        assert _bash("\n".join(GITLAB["keep"]["script"]), project).returncode == 0
