"""What the environment sets or lacks is ignored where it does not matter, and is never the result
of a method."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from support.commands import PROGRAM, rotor_mbs

import rotor_mbs as rm
from rotor_mbs.errors import ResourceError, system_errors_apart

# a folder that cannot be made
NO_HOME = {"HOME": os.devnull, "XDG_CACHE_HOME": "", "MPLCONFIGDIR": ""}
BROKEN = {**NO_HOME, "MPLBACKEND": "broken", "SOURCE_DATE_EPOCH": "abc"}
# A method that loads a library which does not load while there is no file `licence`, with an error
# of its own.
LOADS_A_LIBRARY = """
import sys
from rotor_mbs import Method

def build(scene, settings):
    sys.path.insert(0, FOLDER)
    import library_with_licence
    raise ArithmeticError("of the method")

METHODS = [Method(name="loads", label="loads, a library", build=build, items=lambda scene: [])]
"""
LIBRARY = """
from pathlib import Path
if not Path(FOLDER, "licence").exists():
    raise ValueError("no licence")
"""


def in_environment(variables: dict[str, str], *words: object) -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in {**os.environ, **variables}.items() if value}
    command = [*PROGRAM, *map(str, words)]
    return subprocess.run(
        command, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True
    )


@pytest.mark.parametrize(
    ("variables", "words", "status"),
    [
        ({"PYTHONINSPECT": "1"}, ("list",), 0),
        ({"PYTHONINSPECT": "1"}, ("list", "--help"), 0),
        ({"PYTHONINSPECT": "1"}, ("show", "no/scene"), 2),
        pytest.param(
            BROKEN,
            ("figures", "FILE", "--figure", "8", "-o", "figures"),
            0,
            marks=pytest.mark.full,
        ),
        pytest.param(BROKEN, ("check", "FILE"), 0, marks=pytest.mark.full),
        pytest.param(BROKEN, ("report", "FILE", "-o", "pages"), 0, marks=pytest.mark.full),
        pytest.param(
            BROKEN, ("animate", "paper/fig08", "FILE", "-o", "a.gif"), 0, marks=pytest.mark.full
        ),
    ],
)
def test_variables_that_do_not_matter_are_ignored(
    variables: dict[str, str], words: tuple[str, ...], status: int, results: Path
) -> None:
    ended = in_environment(variables, *(str(results) if word == "FILE" else word for word in words))
    assert ended.returncode == status, ended.stderr
    lines = [line for line in ended.stderr.splitlines() if line]
    assert len(lines) == (1 if status else 0), ended.stderr


@pytest.mark.full
def test_workers_of_a_command_that_is_inspected_are_not(folder: Path) -> None:
    command = ["run", "paper/fig08", "-m", "lagrange/dop853", "-o", "r.h5", "-j", "1"]
    ended = in_environment({"PYTHONINSPECT": "1", "SOURCE_DATE_EPOCH": "abc"}, *command)
    assert ended.returncode == 0, ended.stderr
    assert "Traceback" not in ended.stderr
    assert rm.open(folder / "r.h5")["paper/fig08/lagrange/dop853"].status == "ok"


def test_a_valid_backend_stays_that_of_the_caller() -> None:
    program = "import rotor_mbs.report.canvas, matplotlib; print(matplotlib.get_backend())"
    ended = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "MPLBACKEND": "pdf"},
        capture_output=True,
        text=True,
    )
    assert (ended.stdout, ended.stderr) == ("pdf\n", "")


def test_a_library_that_does_not_load_is_no_result_of_a_method(folder: Path) -> None:
    scene = rm.scene("paper/fig08")
    for name, text in {"loads.py": LOADS_A_LIBRARY, "library_with_licence.py": LIBRARY}.items():
        (folder / name).write_text(text.replace("FOLDER", repr(str(folder))))
    command = ["run", scene.name, "-m", "loads.py", "-o", "r.h5", "-j", 1]
    ended = rotor_mbs(*command, processes=True)
    assert ended.status == 1
    reason = (
        "code cannot be loaded: ImportError: ValueError: no licence, also when it was retried alone"
    )
    assert (
        f"{scene.name} loads/loads: not computed ({reason}); repeat the command to try again"
        in ended.err
    )
    assert list(rm.open("r.h5")[scene.name]) == ["reference"]

    (folder / "licence").touch()
    rotor_mbs(*command, processes=True)
    run = rm.open("r.h5")[scene.name]["loads/loads"]
    assert run.status == "solver_failed"
    assert run.message.endswith("ArithmeticError: of the method")


def test_an_error_that_the_system_caused_is_the_systems() -> None:
    def fail() -> None:
        try:
            raise MemoryError("of 8 GiB")
        except MemoryError as exc:
            raise RuntimeError("engine stopped") from exc

    with (
        pytest.raises(ResourceError, match="RuntimeError: engine stopped"),
        system_errors_apart(),
    ):
        fail()
    with pytest.raises(KeyError, match="passes"), system_errors_apart():
        exec(compile("raise KeyError('passes')", "<string>", "exec"), {"__file__": __file__})
