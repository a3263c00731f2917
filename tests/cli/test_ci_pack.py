"""What CI systems take: a comparison with an earlier file, JUnit, summaries; the GitHub action and
the GitLab job."""

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
    """The same run at a longer step: its energy drift grows thirtyfold and stays below its
    bound."""
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
    (line,) = [
        line
        for line in compared.out.splitlines()
        if line.startswith(f"FAIL against: {SCENE} {METHOD}")
    ]
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
def test_a_margin_may_shrink_tenfold(
    before: float, now: float, passes: bool, earlier: Path
) -> None:
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
    environment = {**os.environ, "PYTHONPATH": f"{folder}:{ROOT}", **variables, "PATH": path}
    return subprocess.run(
        ["bash", "-eo", "pipefail", "-c", script],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
    )


def _run_action(folder: Path, **given: str) -> list[subprocess.CompletedProcess[str]]:
    assert set(given) <= set(ACTION["inputs"])
    inputs = {name: declared["default"] for name, declared in ACTION["inputs"].items()} | given
    done = []
    for step in ACTION["runs"]["steps"]:
        assert step["shell"] == "bash"
        # an input is a value of a variable, never a piece of the script
        assert "${{" not in step["run"]
        names = {
            key: re.fullmatch(r"\$\{\{ inputs\.(\w+) \}\}", text)
            for key, text in step["env"].items()
        }
        values = {key: str(inputs[match[1]]) for key, match in names.items() if match}
        assert len(values) == len(step["env"])
        values |= {
            "GITHUB_ACTION_PATH": str(folder),
            "GITHUB_STEP_SUMMARY": str(folder / "summary.md"),
        }
        done.append(_bash(step["run"], folder, **values))
        if done[-1].returncode:
            break
    return done


def test_the_action_fails_on_a_loosened_run_and_leaves_its_files(
    earlier: Path, loosened: Path, folder: Path
) -> None:
    done = _run_action(folder, file=str(loosened), against=str(earlier), require=METHOD, package="")
    assert [step.returncode for step in done] == [0, 1], done[-1]
    assert "::error title=rotor-mbs against" in done[-1].stdout
    output = folder / "rotor-mbs-check"
    assert {path.name for path in output.iterdir()} == {"verdicts.json", "junit.xml", "check.txt"}
    summary = (folder / "summary.md").read_text().splitlines()
    failed = [text for text in summary if text.startswith("FAIL ")]
    assert f"{len(failed)} failed" in summary[-2]  # those of annotations, too
    assert "::error" not in "".join(summary)
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
    done = _bash(
        script, folder, PACKAGE=".", GITHUB_ACTION_PATH=str(ROOT / ".github/actions/check")
    )
    place = Path(done.stdout.split()[-1])
    assert (place / "pyproject.toml").samefile(ROOT / "pyproject.toml")


# The whole workflows of docs/check.md: without an earlier file, with one, and with one and a fault
# in a model since.

DOCUMENT = (ROOT / "docs/check.md").read_text()
GITHUB, GITLAB = map(yaml.safe_load, re.findall(r"```yaml\n(.*?)```", DOCUMENT, re.DOTALL))
(SCRIPT,) = re.findall(r"```bash\n(.*?)```", DOCUMENT, re.DOTALL)
PIP = "python -m pip install"
EARLIER = "main/results.h5"

# Python runs this module at the start of every process, worker processes included.
FAULT = """
from rotor_mbs.models.exudyn import tree

right = tree.parts

def heavier(scene, *arguments):
    return right(scene.replace(gravity=1.01 * scene.gravity), *arguments)

tree.parts = heavier
"""


@pytest.fixture
def project(folder: Path) -> Path:
    """A repository with one scene, and what a runner puts there."""
    scene = (ROOT / "scenarios" / f"{SCENE}.toml").read_text()
    (folder / "my.toml").write_text(re.sub(r"(?m)^duration = .*$", "duration = 0.2", scene))
    return folder


def plant_fault(project: Path) -> None:
    (project / "sitecustomize.py").write_text(FAULT)
    (project / "results.h5").unlink()  # a runner has an empty folder


def reported(junit: Path) -> list[str]:
    """The failures in a JUnit file."""
    return [failure.attrib["message"] for failure in ElementTree.parse(junit).iter("failure")]


@pytest.mark.full
def test_action_and_job_may_allow_a_scene_that_was_changed(project: Path) -> None:
    for duration, name in ((0.2, "main/results.h5"), (0.1, "results.h5")):
        scene = rm.load(project / "my.toml").replace(duration=duration, samples=3)
        (project / name).parent.mkdir(exist_ok=True)
        rm.run(scene, ["lagrange/dop853"]).save(project / name)
    given = {"file": "results.h5", "against": EARLIER, "package": ""}
    job = {**JOB["variables"], "FILE": "results.h5", "AGAINST": EARLIER, "PACKAGE": ""}
    for allowed in ("false", "true"):
        done = _run_action(project, **given, allow_changed=allowed)[-1]
        done_job = _bash("\n".join(JOB["script"]), project, **job | {"ALLOW_CHANGED": allowed})
        for told in (done.stdout, done_job.stdout):
            assert "duration 0.2 -> 0.1" in told
        assert (done.returncode, done_job.returncode) == (
            (1, 1) if allowed == "false" else (0, 0)
        ), done


@pytest.mark.full
def test_the_workflow_for_github_compares_with_the_file_of_the_main_branch(project: Path) -> None:
    steps = GITHUB["jobs"]["accuracy"]["steps"]
    caches = [step for step in steps if "actions/cache" in step.get("uses", "")]
    # restored first, saved at last
    assert [step["with"]["path"] for step in caches] == [EARLIER, EARLIER]
    output, summary = project / "rotor-mbs-check", project / "summary.md"
    for against, has_fault in (("", False), (EARLIER, False), (EARLIER, True)):
        if has_fault:
            plant_fault(project)
        for step in steps:
            if "run" in step and "if" not in step:
                done = _bash(step["run"].replace(PIP, "echo"), project)
                assert done.returncode == 0, done
            elif "run" in step and not has_fault:  # a failed step skips those that store the file
                assert _bash(step["run"], project).returncode == 0
            elif step.get("uses") == "./rotor_mbs/.github/actions/check":
                done = _run_action(project, **{**step["with"], "against": against})
                assert [end.returncode for end in done] == [0, int(has_fault)], done[-1]
        assert ("against" in (output / "verdicts.json").read_text()) == bool(against)
        assert ("0 failed" in summary.read_text().splitlines()[-2]) != has_fault
    failures = reported(output / "junit.xml")
    assert any(f"{METHOD} error" in failure for failure in failures)
    annotations = [text for text in done[-1].stdout.splitlines() if text.startswith("::error")]
    assert 0 < len(annotations) <= 10
    told = [text for text in done[-1].stdout.splitlines() if "FAIL " in text]
    assert len(told) == len(set(told)) <= len(failures)  # each failure once


@pytest.mark.nightly
def test_the_pipeline_for_gitlab_compares_with_the_file_of_the_main_branch(project: Path) -> None:
    assert GITLAB["accuracy"]["extends"] == ".rotor-mbs-check"
    job = {
        **JOB,
        **GITLAB["accuracy"],
        "variables": {**JOB["variables"], **GITLAB["accuracy"]["variables"]},
    }
    assert (
        GITLAB["keep"]["cache"][0]["paths"]
        == job["cache"][0]["paths"]
        == [job["variables"]["AGAINST"]]
    )
    assert job["artifacts"]["when"] == "always"
    script = "\n".join([*job["before_script"], *job["script"]]).replace(PIP, "echo")
    for is_first, has_fault in ((True, False), (False, False), (False, True)):
        if has_fault:
            plant_fault(project)
        done = _bash(script, project, **job["variables"])
        assert done.returncode == int(has_fault), done
        assert ("no earlier file" in done.stdout) == is_first
        for name in [job["artifacts"]["reports"]["junit"], *job["artifacts"]["paths"]]:
            assert (project / name.replace("$FILE", job["variables"]["FILE"])).stat().st_size
        failures = reported(project / job["artifacts"]["reports"]["junit"])
        assert any(f"{METHOD} error" in failure for failure in failures) == has_fault
        if not has_fault:
            assert _bash("\n".join(GITLAB["keep"]["script"]), project).returncode == 0


@pytest.mark.full
def test_the_script_for_other_systems_compares_with_an_earlier_file(project: Path) -> None:
    for has_fault in (False, True):
        if has_fault:
            (project / "main").mkdir()
            (project / "results.h5").rename(project / EARLIER)
            (project / "results.h5").touch()
            plant_fault(project)
        done = _bash(SCRIPT, project)
        assert done.returncode == int(has_fault), done
        assert bool(reported(project / "check.xml")) == has_fault
    shrunk = [text for text in done.stdout.splitlines() if text.startswith("FAIL against")]
    assert 0 < len(shrunk) <= 10
