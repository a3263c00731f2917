"""Methods in a Python file that is named by its path: in every command, with whatever somebody's
code may do."""

from __future__ import annotations

import re
import resource
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from support.commands import rotor_mbs
from support.packages import forget_method_files

import rotor_mbs as rm
from rotor_mbs.methods import catalogue, method_file

DOCUMENT = (Path(__file__).parents[2] / "docs" / "your-engine.md").read_text()
(EXAMPLE,) = re.findall(r"```python\n(.*?)```", DOCUMENT, re.DOTALL)
SCENE = rm.scene("check/general").replace(duration=0.1, samples=6, outputs=["angles", "rates"]).text
# Methods of one file, each of which does something else in `integrate`.
BAD = """
import os, time
import numpy as np
from rotor_mbs.methods.base import Method
from rotor_mbs.solution.trajectory import Integration, Trajectory

ACTS = {
    "Raises": lambda: 1 / 0,
    "Hangs": lambda: time.sleep(1e3),
    "Dies": lambda: os._exit(9),
    "Prints": lambda: [print("x" * 10**6), os.write(1, b"x" * 10**6)],
    "Shape": lambda: None,
}

class Still:
    def __init__(self, scene, name):
        self.scene, self.name = scene, name
    def integrate(self):
        ACTS[self.name]()
        return Integration(True, "", self.scene.duration)
    def observe(self):
        time = np.linspace(0.0, self.scene.duration, self.scene.samples)
        columns = 1 if self.name == "Shape" else 4
        return Trajectory(time, np.tile(self.scene.initial_angles[:columns], (len(time), 1)), np.zeros((len(time), 4)))

METHODS = [Method(name=name, label=name, build=lambda scene, _, name=name: Still(scene, name)) for name in ACTS]
"""
# A solver that does one of these when it is built.
BAD_BUILD = """
import os, time
from rotor_mbs.methods.base import Method

def build(scene, settings):
    {}

METHOD = Method(name="bad", label="bad", build=build)
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.chdir(tmp_path)
    Path("one.toml").write_text(SCENE)
    Path("mine.py").write_text(EXAMPLE)
    yield tmp_path
    forget_method_files()


def run(*words: str) -> str:
    ended = rotor_mbs("run", "one.toml", "-j", 1, *words)
    assert ended.status == 0, ended
    return ended.out


def test_the_ladder_of_a_files_method_has_the_values_that_its_setting_allows() -> None:
    text = """
from dataclasses import dataclass
from rotor_mbs.methods.base import Method
from rotor_mbs.methods.settings import Settings, number

@dataclass(frozen=True)
class Accuracy(Settings):
    tolerance: float = number(1e-8, at_least=5e-13, at_most=2e-5, doc="relative tolerance")

METHOD = Method(name="own", label="own", build=lambda scene, settings: None, settings=Accuracy)
"""
    (method,) = method_file.MethodFile("mine.py", text).load(()).values()
    (ladder,) = method.ladders
    assert ladder.values == tuple(10.0**-k for k in range(5, 13))


def test_the_documents_example_is_short_complete_and_right() -> None:
    """40 lines of code; its tolerance leaves 1e-12 an interval, on a scene with every term."""
    assert len([line for line in EXAMPLE.splitlines() if line.strip()]) <= 40
    scene = rm.scene("check/pitch-loads").replace(
        duration=0.7, samples=36, outputs=["angles", "rates"]
    )
    found = rm.run(scene, "mine.py")
    assert (found.status, found.method) == ("ok", "mine/lsoda")
    assert found.metrics["defect_max"] < 1e-11
    with pytest.raises(rm.MethodRefusal, match="blades without inertia"):
        rm.run("check/held", "./mine.py")


def test_arrays_that_a_method_omits_are_no_fault() -> None:
    outputs = ["angles", "rates", "tip", "energy", "loads"]
    Path("one.toml").write_text(rm.load("one.toml").replace(outputs=outputs).text)
    run("-m", "mine.py", "-o", "o.h5")
    assert rotor_mbs("check", "o.h5").out.startswith("runs checked: 1 mine/lsoda\n")


@pytest.mark.full
def test_a_run_is_keyed_by_the_code_of_its_file() -> None:
    first = run("-m", "./mine.py", "-m", "lagrange/dop853", "-o", "o.h5")
    assert "mine/lsoda" in first
    assert "3 already stored" in run("-m", "mine.py", "-m", "lagrange/dop853", "-o", "o.h5")
    Path("mine.py").write_text(EXAMPLE + "# the same\n")
    assert "2 already stored" in run("-m", "mine.py", "-o", "o.h5")
    Path("mine.py").write_text(EXAMPLE.replace("rtol=1e-12, atol=1e-13", "rtol=1e-6, atol=1e-7"))
    assert "1 run computed" in run("-m", "mine.py", "-o", "o.h5")
    runs = rm.open("o.h5")["one"]
    assert list(runs) == ["reference", "lagrange/dop853", "mine/lsoda"]
    assert runs["mine/lsoda"].metrics["defect_max"] > 1e-9


@pytest.mark.parametrize(
    ("name", "text", "line"),
    [
        ("mine.py", "a = 1\nb = (\n", "mine.py:2: SyntaxError: '(' was never closed"),
        (
            "mine.py",
            "import os\nos._exit(0)\n",
            "mine.py: ended the process that loaded it (exit code 0)",
        ),
        ("mine.py", "while True: pass\n", "mine.py: not loaded within 0.5 s"),
        (
            "mine.py",
            "a = 1\n",
            "mine.py: defines no Method; allowed: at least one (docs/your-engine.md)",
        ),
        (
            "mine.py",
            "METHOD = 1\n",
            "mine.py: METHOD is 1; allowed: a Method (docs/your-engine.md)",
        ),
        (
            "lagrange.py",
            EXAMPLE,
            "lagrange.py: lagrange/taylor has this name; allowed: another file name",
        ),
        (
            "other/mine.py",
            EXAMPLE,
            "other/mine.py: methods mine/... are those of mine.py; allowed: another file name",
        ),
    ],
    ids=["syntax", "ends", "hangs", "no method", "a number", "a shipped name", "a name twice"],
)
def test_a_file_that_cannot_be_used_is_one_line(
    name: str, text: str, line: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(method_file, "_LOAD_S", 0.5 if "while" in text else 60.0)
    Path("other").mkdir()
    Path(name).write_text(text)
    named = ["-m", "mine.py"] * (name != "mine.py")
    ended = rotor_mbs("run", "one.toml", *named, "-m", name, "-o", "o.h5")
    assert (ended.status, ended.out, ended.err) == (2, "", f"{line}\n")
    assert not Path("o.h5").exists()


# what each of them becomes in the program itself: test_pool.py, test_judgement.py
@pytest.mark.full
def test_whatever_a_method_does_is_one_line_and_loses_nothing(
    capfd: pytest.CaptureFixture[str],
) -> None:
    Path("bad.py").write_text("import os; print('x' * 10**6); os.write(1, b'x' * 10**6)\n" + BAD)
    words = ("-m", "bad.py", "-m", "mine.py", "-o", "o.h5", "-j", 1, "--timeout", 2)
    ended = rotor_mbs("run", "one.toml", *words, processes=True)
    printed = "".join(capfd.readouterr())
    assert ended.status == 1
    assert len(ended.out + ended.err + printed) < 3000
    runs = rm.open("o.h5")["one"]
    statuses = {name: runs[name].status for name in runs if name != "reference"}
    assert statuses == {
        "bad/Raises": "solver_failed",
        "bad/Hangs": "timed_out",
        "bad/Prints": "inaccurate",
        "mine/lsoda": "ok",
        "bad/Shape": "solver_failed",
    }
    assert runs["bad/Shape"].message == "bad/Shape: angles has the shape (6, 1); allowed: (6, 4)"
    assert runs["bad/Raises"].message == "bad.py:9: ZeroDivisionError: division by zero"
    assert ended.err.count("one bad/Dies: not computed (its process died (exit code 9)") == 1


@pytest.mark.parametrize(
    ("act", "line"),
    [
        ("os._exit(3)", "ended the process that built it for one (exit code 3)"),
        pytest.param("time.sleep(1e3)", "not built for one within 5 s", marks=pytest.mark.full),
    ],
)
def test_a_build_that_ends_or_hangs_its_process_is_one_line(
    act: str, line: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a method without `items` refuses is known from building it, not in the process of the
    command."""
    monkeypatch.setattr(method_file, "_LOAD_S", 5.0 if "sleep" in act else 60.0)
    Path("bad.py").write_text(BAD_BUILD.format(act))
    ended = rotor_mbs("run", "one.toml", "-m", "bad.py", "-o", "o.h5")
    assert (ended.status, ended.out, ended.err) == (2, "", f"not run: bad/bad on one: {line}\n")


def test_the_answer_to_an_interrupted_question_is_not_the_next_ones(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupted(_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("rotor_mbs.processes.worker.pickle.load", interrupted)
        with pytest.raises(KeyboardInterrupt):
            method_file.read_file("mine.py")
    catalogue.check_names(["mine.py"])
    assert catalogue.find_method("mine/lsoda").items(rm.load("one.toml")) == []


def test_a_sweep_and_python_take_a_file() -> None:
    scene = rm.load("one.toml").replace(outputs=["angles", "rates", "energy"])
    runs = rm.sweep(
        scene, {"gravity": [10.0]}, methods="mine.py", outputs=["angles", "rates"], workers=1
    )
    assert runs.statuses == {"ok": 1}
    assert np.array_equal(runs[0].angles, rm.run(scene.replace(gravity=10.0), "mine/lsoda").angles)
    Path("bad.py").write_text(BAD)
    with pytest.raises(rm.InputError, match="the file has bad/Raises, "):
        rm.run(scene, "bad.py")
    bad = rm.run(scene, ["bad/Raises", "bad/Shape"], workers=0)
    assert [(run.status, run.message) for run in bad.values()][1:] == [
        ("solver_failed", "bad.py:8: ZeroDivisionError: division by zero"),
        ("solver_failed", "bad/Shape: angles has the shape (6, 1); allowed: (6, 4)"),
    ]


def test_what_modes_and_bench_need_is_named() -> None:
    ended = rotor_mbs("modes", "one.toml", "-m", "mine.py")
    assert ended.status == 2
    assert ended.err == (
        "mine/lsoda: its model has no linearization; allowed: a model with `linearize`\n"
    )
    ended = rotor_mbs("bench", "one.toml", "-m", "mine.py")
    assert ended.status == 2
    assert (
        "no ladder for method 'mine/lsoda' (a Method of a file needs a setting `step` or"
        in ended.err
    )


@pytest.mark.parametrize("mended", ["file", "module"])
def test_a_file_that_failed_is_loaded_again(
    mended: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where it was mended in the same session, or a module that it imports was."""
    library = folder / "library"
    library.mkdir()
    monkeypatch.syspath_prepend(str(library))
    broken, right = "missing = 0\n", "present = 0\n"
    name = f"helper_of_{mended}"
    (library / f"{name}.py").write_text(broken if mended == "module" else right)
    importing = f"from {name} import present\n"
    Path("mine.py").write_text(importing + ("1 / 0\n" if mended == "file" else "") + EXAMPLE)
    for _ in range(2):
        with pytest.raises(rm.InputError, match=r"mine\.py:[12]: (ZeroDivision|Import)Error"):
            catalogue.check_names("mine.py")
    (library / f"{name}.py").write_text(right + "# longer\n")
    Path("mine.py").write_text(importing + EXAMPLE)
    assert catalogue.check_names("mine.py") == ("mine/lsoda",)


def test_a_file_that_is_late_under_a_memory_limit_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    limits = resource.getrlimit(resource.RLIMIT_AS)
    monkeypatch.setattr(method_file, "_LOAD_S", 0.5)
    Path("mine.py").write_text("while True: pass\n")
    resource.setrlimit(resource.RLIMIT_AS, (1 << 46, limits[1]))
    try:
        with pytest.raises(
            rm.InputError,
            match=(
                r"not loaded within 0\.5 s under a memory limit "
                r"\(ulimit -v\)"
            ),
        ):
            catalogue.check_names("mine.py")
    finally:
        resource.setrlimit(resource.RLIMIT_AS, limits)
