"""Wrong scene and bounds files: a readable line per error, with file, line, key and what is
allowed; no traceback."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rotor_mbs.errors import InputError
from rotor_mbs.runs.design import RUNS
from rotor_mbs.scenario.accuracy_bounds import Bound, read_bounds, shipped_bounds
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import load_scene
from rotor_mbs.scenario.toml_file import MAX_BYTES
from rotor_mbs.studies.bench import BENCH

SCENE = """\
title = "A good scene"
blades = 2
gravity = 9.8
duration = 10
samples = 11
outputs = ["angles", "tip"]

[blade]
mass = 2
centre_of_mass = [0.5, 0, 3]
inertia = [1, 1, 1, 0, 0, 0]
tip = [0.5, 0, 7]

[initial]
angles = [0, 0, 0]
rates = [0, 0, 0]

[bearing]
stiffness = 1
damping = 2

[torque]
rotor = 5

[hub]
inertia = 1

[shaft]
damping = 3
"""
BLADE = (
    "[blade]\nmass = 2\ncentre_of_mass = [0.5, 0, 3]\ninertia = [1, 1, 1, 0, 0, 0]\ntip = [0.5, 0, "
    "7]\n"
)
ON_THE_AXIS = "[blade]\nmass = 2\ncentre_of_mass = [0, 0, 3]\ntip = [0.5, 0, 7]\n"

# What to write for what, and the line and key of the one error, with a piece of its message.
WRONG = {
    "title empty": ('"A good scene"', '"  "', 1, "title", "is empty"),
    "unknown key": ("blades = 2", "blades = 2\nbaldes = 2", 3, "baldes", "perhaps blades"),
    "blades astronomical": (
        "blades = 2",
        f"blades = 0x{'f' * 5000}",
        2,
        "blades",
        "a number of over 30 digits",
    ),
    "blades true": ("blades = 2", "blades = true", 2, "blades", "true is not a whole number"),
    "outputs unknown": (
        '["angles", "tip"]',
        '["angles", "tips"]',
        6,
        r"outputs\[1\]",
        '"tips" is not one of them, perhaps tip',
    ),
    "mass missing": ("mass = 2\n", "", 8, r"blade\.mass", "is missing"),
    "inertia of no triangle": (
        "[1, 1, 1, 0, 0, 0]",
        "[1, 1, 2.1, 0, 0, 0]",
        11,
        r"blade\.inertia",
        "no rigid body",
    ),
    "tip missing where wanted": ("tip = [0.5, 0, 7]\n", "", 8, r"blade\.tip", "is missing"),
    "angles too few": (
        "angles = [0, 0, 0]",
        "angles = [0, 0]",
        15,
        r"initial\.angles",
        "2 numbers for a rotor and 2",
    ),
    "torque entry": (
        "rotor = 5",
        "rotor = [[0, 1], [1, nan]]",
        23,
        r"torque\.rotor\[1\]\[1\]",
        "nan",
    ),
    "torque from before": (
        "rotor = 5",
        "rotor = [[-1, 1], [1, 1]]",
        23,
        r"torque\.rotor",
        "below 0",
    ),
    "torque two jumps at once": (
        "rotor = 5",
        "rotor = [[1, 1], [1, 2], [1, 3]]",
        23,
        r"torque\.rotor",
        "three rows have t = 1",
    ),
    "rest back in time": (
        "damping = 2",
        "rest = [[[0, 1], [1, 1]], [[1, 1], [0, 1]]]",
        20,
        r"bearing\.rest\[1\]",
        "t = 0 comes after t = 1",
    ),
    "one of two blade tables": (
        "[blade]",
        "[[blade]]",
        8,
        "blade",
        (
            r"1 \[\[blade\]\] table "
            r"for 2 blades"
        ),
    ),
    "mass too large": ("mass = 2", "mass = 1e200", 9, r"blade\.mass", "allowed: sizes from 1e-25"),
    "tilt in degrees": (
        "damping = 3",
        "tilt = 5",
        29,
        r"shaft\.tilt",
        "5 is out of range; .*from -pi/2 to pi/2",
    ),
    "cone of a cylinder": (
        "mass = 2",
        "mass = 2\ncone = -2",
        10,
        r"blade\.cone",
        "-2 is out of range; .*from -1.5",
    ),
    "hub radius negative": (
        "inertia = 1\n",
        "radius = -1\n",
        26,
        r"hub\.radius",
        "-1 is out of range",
    ),
    "hub mass not a number": ("inertia = 1\n", "mass = '5 t'\n", 26, r"hub\.mass", "5 t"),
    "second blade table": (
        BLADE,
        BLADE.replace("[blade]", "[[blade]]")
        + BLADE.replace("[blade]", "[[blade]]").replace("= 2", "= 0"),
        14,
        r"blade\[1\]\.mass",
        "0 is out of range",
    ),
}


def _problems(folder: Path, content: str | bytes) -> list[str]:
    path = folder / "bad.toml"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(InputError) as caught:
        load_scene(path, "bad")
    problems = [problem.removeprefix(str(path)) for problem in caught.value.problems]
    assert all(problem.isprintable() for problem in problems)
    assert all(":" in problem and "; allowed: " in problem for problem in problems)
    assert all(len(problem) < 400 for problem in problems)
    assert not any(problem.endswith("allowed: ") for problem in problems)
    return problems


@pytest.mark.parametrize(("old", "new", "line", "key", "message"), WRONG.values(), ids=WRONG)
def test_one_error_is_one_line(
    tmp_path: Path, old: str, new: str, line: int, key: str, message: str
) -> None:
    assert SCENE.count(old) == 1
    (problem,) = _problems(tmp_path, SCENE.replace(old, new))
    assert re.match(rf":{line}: {key}: .*{message}", problem), problem


def test_a_run_that_cannot_fit_in_memory(tmp_path: Path) -> None:
    # 20 blades: time, 21 angles, 21 rates, 60 tip coordinates are 103 values; 103 * 8 B * 3e6 = 2.3
    # GiB.
    text = SCENE.replace("blades = 2", "blades = 20").replace("[0, 0, 0]\n", str([0] * 21) + "\n")
    (problem,) = _problems(tmp_path, text.replace("samples = 11", "samples = 3000000"))
    assert problem.startswith(
        ":5: samples: 3000000 samples of 103 values of 8 bytes are 2.302 GiB; allowed: at most 2 "
        "GiB"
    )


def test_a_pitch_without_inertia_takes_no_rate_and_no_bearing(tmp_path: Path) -> None:
    text = SCENE.replace(BLADE, ON_THE_AXIS).replace("rates = [0, 0, 0]", "rates = [1, 0, 4]")
    rates, stiffness, damping = _problems(tmp_path, text)
    assert rates.startswith(
        ":15: initial.rates: a pitch rate for blade 2, whose pitch has no inertia; allowed: 0 there"
    )
    assert stiffness.startswith(
        ":18: bearing.stiffness: acts on blades 1, 2, whose pitch has no inertia"
    )
    assert damping.startswith(":19: bearing.damping: acts on blades 1, 2")
    tables = (BLADE + ON_THE_AXIS).replace("[blade]", "[[blade]]")
    (problem,) = _problems(
        tmp_path, SCENE.replace(BLADE, tables).replace("stiffness = 1", "stiffness = [1, 0]")
    )
    assert problem.startswith(":24: bearing.damping: acts on blade 2, whose pitch has no inertia")


def test_all_errors_of_a_file_in_the_order_of_its_lines(tmp_path: Path) -> None:
    text = SCENE
    for name in (
        "title empty",
        "blades true",
        "outputs unknown",
        "inertia of no triangle",
        "torque entry",
    ):
        text = text.replace(*WRONG[name][:2])
    places = [problem.split(": ")[:2] for problem in _problems(tmp_path, text)]
    assert places == [
        [":1", "title"],
        [":2", "blades"],
        [":6", "outputs[1]"],
        [":11", "blade.inertia"],
        [":23", "torque.rotor[1][1]"],
    ]


@pytest.mark.parametrize(
    ("content", "start"),
    [
        (b"", ": is empty"),
        (b"\x7fELF\x00\x01\xff\xfe", ":1: is not UTF-8"),
        (b"title = 'x'\n# \xe9\n", ":2: is not UTF-8"),
        (b"title = 'x'\n\n\x00", ":3: contains a NUL byte"),
        (b"x" * (MAX_BYTES + 1), ": is larger than 1048576 bytes"),
        (b"title = 'x'\ntitle = 'y'\n", ":2: not TOML: title is there twice, first in line 1; "),
        (
            b"[[blade]]\ntip = 1\n[[blade]]\ntip = [1,\n2]\ntip = [\n1]\n",
            ":7: not TOML: blade[1].tip is there twice, first in line 4; ",
        ),
        (b"[shaft]\n[hub]\n[shaft]\n", ":3: not TOML: shaft is there twice, first in line 1; "),
        (b'"a\\u0062" = 1\nab = 2', ":2: not TOML: cannot overwrite a value"),
        (b"a = " + b"[" * 100_000, ":1: nested too deep"),
        (b"a." * 500_000 + b"a = 1", ":1: key of over 32 parts"),
        (b"a = " + b"9" * 5000, ":1: a number is too long"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_file_that_is_not_toml_text(tmp_path: Path, content: bytes, start: str) -> None:
    (problem,) = _problems(tmp_path, content)
    assert problem.startswith(start)


NO_NAMES = ("", "../paper/fig05", "/paper/fig05", "paper/fig05\n", "paper/\0")


@pytest.mark.parametrize(
    ("argument", "message"),
    [
        *((argument, "is neither a scene's name nor a TOML file") for argument in NO_NAMES),
        ("paper/fig5", "no such scene, perhaps paper/fig05"),
        ("missing.toml", "missing.toml: cannot be read: No such file"),
        ("\0.toml", "not a path of a file; allowed: text without NUL"),
        ("empty", "no TOML file in this folder"),
        ("text.txt", "is not a TOML file"),
        ("odd name.toml", "cannot name a scene"),
        ("bench.toml", "bench is a reserved name"),
        ("sweep.toml", "another file name; to run a sweep, use: rotor-mbs sweep sweep.toml"),
        # resolved to a file; from Python 3.13 on: read
        ("circle.toml", "circle.toml: cannot be re"),
        ("pipe.toml", "is not a regular file"),
        ("study.toml", "study.toml: is a sweep; allowed: a scene, or: rotor-mbs sweep study.toml"),
        (
            "map.toml",
            "map.toml: is a mapping of columns; allowed: a scene, or: rotor-mbs compare DATA "
            "--scene SCENE --columns map.toml",
        ),
        ("columns.toml", "columns.toml: is a mapping of columns; allowed: a scene, or: "),
        ("bounds.toml", "bounds.toml: is a file of bounds; allowed: a scene, or: "),
    ],
)
def test_arguments_that_name_no_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, argument: str, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("empty").mkdir()
    for name in ("text.txt", "odd name.toml", "bench.toml", "sweep.toml"):
        Path(name).write_text(SCENE, encoding="utf-8")
    Path("circle.toml").symlink_to("circle.toml")
    os.mkfifo("pipe.toml")
    Path("study.toml").write_text(
        'scene = "paper/fig11"\n[[axis]]\nkey = "gravity"\nvalues = [1]\n', encoding="utf-8"
    )
    Path("map.toml").write_text('time = "t"\nrotor = "x"\n', encoding="utf-8")
    Path("columns.toml").write_text('[rotor]\ncolumn = "x"\n', encoding="utf-8")
    Path("bounds.toml").write_text('[[bound]]\ncheck = "error"\n', encoding="utf-8")
    with pytest.raises(InputError) as caught:
        find_scenes([argument])
    (problem,) = caught.value.problems
    assert message in problem
    assert problem.isprintable()


@pytest.mark.parametrize("group", [RUNS, BENCH, "stability", "modes", "comparison"])
def test_a_group_of_the_programs_files_is_no_name_of_a_scene(tmp_path: Path, group: str) -> None:
    """A scene's group in a results file would be in the place of the table."""
    path = tmp_path / f"{group}.toml"
    path.write_text(SCENE, encoding="utf-8")
    with pytest.raises(InputError, match=f"{group} is a reserved name in results files; allowed:"):
        find_scenes([str(path)])


def test_errors_of_all_arguments_and_files_at_once(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / f"{name}.toml").write_text(
            SCENE.replace("mass = 2", "mass = -2"), encoding="utf-8"
        )
    with pytest.raises(InputError) as caught:
        find_scenes(["paper/fig08", "nonsense", str(tmp_path), "paper/fig00"])
    assert len(caught.value.problems) == 4


_SNIPPETS = st.sampled_from(
    [
        "[",
        "]",
        "{",
        "}",
        "=",
        '"',
        "'''",
        "nan",
        "-1",
        "1e999",
        "true",
        "[[blade]]\n",
        "blade.",
        "\n",
        "[]",
        "{}",
        "#",
        "0",
    ]
)


@settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60, deadline=None
)
@given(
    st.lists(
        st.tuples(st.integers(0, len(SCENE)), st.integers(0, 12), _SNIPPETS | st.text(max_size=5)),
        max_size=4,
    )
)
def test_no_damage_to_a_file_gives_a_traceback(
    tmp_path: Path, damages: list[tuple[int, int, str]]
) -> None:
    text = SCENE
    for start, length, snippet in damages:
        text = text[:start] + snippet + text[start + length :]
    path = tmp_path / "damaged.toml"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    problems: tuple[str, ...] = ()
    try:
        load_scene(path, "damaged")
    except InputError as error:
        problems = error.problems
    assert all(problem.isprintable() for problem in problems)
    assert all(re.match(rf"{re.escape(str(path))}(:\d+)?: ", problem) for problem in problems)


# Bounds files: what is accepted, and which entry counts

WRONG_BOUNDS = {
    'value = 1\nreason = "x"\nunit = "m"': (6, "unit: unknown key"),
    'value = -1e-9\nreason = "x"': (4, "value: -1e-09 is out of range"),
    'reason = "x"': (1, "value: is missing; allowed: a number from 0"),
    'value = 1\nreason = " "': (5, "reason: is empty; allowed: a sentence"),
}


@pytest.mark.parametrize("text", WRONG_BOUNDS)
def test_an_error_of_bounds_is_one_line(tmp_path: Path, text: str) -> None:
    own, (line, message) = tmp_path / "own.toml", WRONG_BOUNDS[text]
    own.write_text(f'[[bound]]\ncheck = "tip"\nmethod = "*"\n{text}\n')
    with pytest.raises(InputError, match=rf"bound\[0\]\.{message}") as caught:
        read_bounds(own)
    (problem,) = caught.value.problems
    assert problem.startswith(f"{own}:{line}: bound[0].")


@pytest.mark.parametrize("text", ["bound = 3", "[[bounds]]\n", ""])
def test_a_file_of_another_kind_is_refused(tmp_path: Path, text: str) -> None:
    own = tmp_path / "own.toml"
    own.write_text(text)
    with pytest.raises(InputError) as caught:
        read_bounds(own)
    assert all(problem.startswith(str(own)) for problem in caught.value.problems)


def test_entries_in_front_count_first_and_the_shipped_ones_stay(tmp_path: Path) -> None:
    own = tmp_path / "own.toml"
    own.write_text(
        '[[bound]]\ncheck = "energy"\nmethod = "mine/*"\nvalue = 1e-3\nreason = "explicit method"\n'
    )
    bounds = shipped_bounds().with_entries(read_bounds(own))
    assert bounds.of("energy", "mine/euler") == Bound("energy", "mine/*", 1e-3, "explicit method")
    brought = Bound("energy", "mine/euler", 1e-4, "of the method")
    bounds = shipped_bounds().with_entries([brought])
    assert bounds.of("energy", "mine/euler") == brought
    assert bounds.of("energy", "lagrange/taylor") == shipped_bounds().of(
        "energy", "lagrange/taylor"
    )
