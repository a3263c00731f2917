"""Typical mistakes of a beginner: each is answered with a line that says what to do next."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.commands import refusal, rotor_mbs

import rotor_mbs as rm
from rotor_mbs.errors import InputError, PlausibilityWarning
from rotor_mbs.scenario.catalogue import list_scenes
from rotor_mbs.scenario.scene import implausible_values, new_scene_text

# Mistake: (edits of the template, the command with {file} for the scene file, what the one line
# must say).
MISTAKES: dict[str, tuple[dict[str, str], str, str]] = {
    "a scene without its folder": ({}, "run fig05", "perhaps paper/fig05"),
    "a misspelt command": ({}, "rnu {file}", "perhaps run"),
    "a misspelt setting": (
        {},
        "run {file} -m lagrange/taylor --set tolerence=1e-9",
        "perhaps tolerance",
    ),
    "a step too short": (
        {},
        "run {file} -m exudyn_tree/rk67 --set step=1e-300",
        "allowed: a step of at least 1e-08 s",
    ),
    "no tip": ({"tip = [0.08, 0.0, 33.4]": ""}, "run {file}", 'needed for the output "tip"'),
    "a sweep that is run": ({}, "run sweeps/fig11-spread", "rotor-mbs sweep sweeps/fig11-spread"),
    "a scene that is swept": ({}, "sweep paper/fig11", "rotor-mbs run paper/fig11"),
    "a report of a scene file": ({}, "report {file}", "allowed: a file that rotor-mbs wrote"),
    "a new file that would not run": ({}, "new mine.txt", "allowed: a name that ends in .toml"),
    "a time limit that is none": ({}, "run {file} --timeout nan", "allowed: seconds, more than 0"),
    "a bench of nothing": ({}, "bench", "required: SCENE"),
    "an option in front": ({}, "--frobnicate list", "unrecognized arguments: --frobnicate"),
    "a method that cannot": (
        {"inertia = 0.0": "inertia = 3.0"},
        "run {file} -m printed/ode45",
        "hub",
    ),
    "a new file over an old one": ({}, "new {file}", "allowed: a file that does not exist yet"),
    "too many processes": ({}, "run {file} -j 1025", "allowed: a whole number from 1 to 1024"),
    "no process": ({}, "run {file} -j 0", "allowed: a whole number from 1 to 1024"),
    "no motion at all": (
        {},
        "run extreme/singular-start",
        "singular-start: rejected: all pitches are ±π/2 and",
    ),
    "a motion that ends at once": (
        {},
        "run extreme/singular-one-blade",
        "rejected: one point-mass blade on a hub",
    ),
    "a bench of no motion": (
        {},
        "bench extreme/singular-start -m lagrange/dop853",
        "the initial mass matrix is singular",
    ),
    "a bench without a ladder": (
        {},
        "bench paper/fig09 -m printed/ode45",
        "no ladder for method 'printed/ode45'",
    ),
    "a figure that is not there": (
        {},
        "figures {results} --figure 2 -o out",
        "figure 2: not in the file; allowed: 8",
    ),
    "a film of no scene": (
        {},
        "animate a/mine.toml {results} -o a.webp",
        "'mine': no such scene in it; allowed: paper/fig08",
    ),
    "a film of another kind": (
        {},
        "animate paper/fig11 {results} -o a.avi",
        "unknown format .avi; allowed: .webp, .gif",
    ),
    "a film of no file": ({}, "animate paper/fig11 none.h5 -o a.webp", "no such file"),
    "an engine that is none": (
        {},
        "sweep sweeps/fig11-spread --engine slurm -o s.h5",
        "no such engine; allowed: local, or dask:tcp://host:port",
    ),
}
SLIPS: dict[str, tuple[str, str, str]] = {
    "degrees": ('"deg(30)"', "30", '30 rad are 4.8 turns; degrees? write "deg(30)"'),
    "degrees per second": ("rates = [0,", "rates = [360,", 'write "deg(360)"'),
    "millimetres": ("33.4]", "24000]", "24000 m from the apex; is it in m?"),
    "gravity in cm": ("9.81", "981", "9.81 is usual"),
}


def scene_file(folder: Path, edits: dict[str, str]) -> Path:
    text = new_scene_text()
    for old, new in edits.items():
        assert old in text
        text = text.replace(old, new, 1)
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_line_that_says_what_to_do_next(
    mistake: str, folder: Path, results: Path
) -> None:
    """And nothing is written, but for the points that a bench is about to measure."""
    edits, command, says = MISTAKES[mistake]
    assert says in refusal(
        *command.format(file=scene_file(folder, edits).name, results=results).split()
    )
    assert {path.name for path in folder.iterdir()} - {"bench.h5"} == {"mine.toml"}


@pytest.mark.parametrize("slip", SLIPS)
def test_a_number_that_looks_like_a_slip_is_warned_of_and_not_refused(
    slip: str, folder: Path
) -> None:
    old, new, says = SLIPS[slip]
    path = scene_file(folder, {old: new})
    shown = rotor_mbs("show", path)
    assert shown.status == 0
    (line,) = shown.err.splitlines()
    assert line.startswith(f"warning: {path}: ")
    assert says in line
    with pytest.warns(PlausibilityWarning, match="mine.toml"):
        rm.load(path)


def test_plausible_numbers_are_not_warned_of(folder: Path) -> None:
    assert rotor_mbs("show", scene_file(folder, {})).err == ""


def test_an_angle_that_was_computed_is_not_advised_to_be_written_in_degrees(folder: Path) -> None:
    text = new_scene_text().replace('"deg(30)"', '"deg(400)"', 1)
    text = text.replace("rates = [0,", 'rates = ["deg(7000)",', 1)
    text = text.replace("tilt = 0.0", 'tilt = "deg(90)"', 1)
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    lines = rotor_mbs("show", path).err.splitlines()
    assert [line.rpartition(": ")[2] for line in lines] == [
        "6.98132 rad are 1.1 turns",
        "122.173 rad/s",
        "1.5708 rad are 90 degrees",
    ]


@pytest.mark.parametrize(("key", "number"), [("shaft.tilt", -5), ("blade.cone", 5)])
def test_a_lean_out_of_range_that_is_one_in_degrees_is_advised_to_be_written_so(
    key: str, number: int
) -> None:
    scene = rm.scene("paper/fig11")
    with pytest.raises(InputError, match=rf'out of range; degrees\? write "deg\({number}\)"; allo'):
        scene.replace(**{key: number})
    with pytest.raises(InputError, match="200 is out of range; allowed: "):
        scene.replace(**{key: 200})


def test_all_angles_in_degrees_are_named_and_rest_angles_and_inertias_in_other_units() -> None:
    scene = rm.scene("paper/fig11").replace(
        **{"initial.angles": [30, 5, 0.1, -45], "bearing.stiffness": 1e3}
    )
    assert [line[:17] for line in implausible_values(scene)] == [
        f"initial.angles[{i}]" for i in (0, 1, 3)
    ]
    (line,) = implausible_values(rm.scene("turbine/pitch-step").replace(**{"bearing.rest": 5.0}))[
        :1
    ]
    assert line.startswith("bearing.rest[0]: 5 rad are 0.8 turns")
    (line,) = implausible_values(
        rm.scene("paper/fig11").replace(**{"blade.inertia": [9e7, 9e7, 1e3, 0, 0, 0]})
    )
    assert line.startswith("blade.inertia: a radius of gyration of 77.5 m")  # sqrt(9e7 / 15000)
    wide = {"shaft.tilt": 0.6, "blade.cone": -1.2, "hub.radius": 90.0, "hub.mass": 56.78e6}
    keys = [
        line.partition(":")[0]
        for line in implausible_values(rm.scene("paper/fig11").replace(**wide))
    ]
    assert sorted(keys) == ["blade.cone", "hub.mass", "hub.radius", "shaft.tilt"]
    for name, _ in list_scenes():
        assert not [
            line
            for line in implausible_values(rm.scene(name))
            if "gyration" in line or "rest" in line
        ], name


def test_an_inaccurate_run_names_the_next_step_to_try_until_it_is_accurate() -> None:
    scene = rm.scene("check/general")
    step, steps = 0.02, [0.02]
    while (run := rm.run(scene, "exudyn_tree/rk44", step=step)).status == "inaccurate":
        step = float(run.message.rpartition("next to try: step=")[2])
        steps.append(step)
        assert len(steps) < 12
    assert run.status == "ok", run.message
    assert len(steps) > 1
    assert steps == sorted(set(steps), reverse=True)


def test_a_scene_names_its_methods_and_settings(folder: Path) -> None:
    edits = {
        "methods = []": 'methods = ["exudyn_tree/rk67", "lagrange/dop853"]',
        "# step = 1e-3": "step = 0.002",
        "duration = 10.0": "duration = 0.2",
        "samples = 1001": "samples = 11",
    }
    path = scene_file(folder, edits)
    assert rm.run(rm.load(path), "exudyn_tree/rk67").settings["step"] == 0.002
    assert rotor_mbs("run", path, "-o", "r.h5", "-j", "1", "--set", "step=0.001").status == 0
    runs = rm.open("r.h5")
    assert set(runs["mine"]) == {"reference", "exudyn_tree/rk67", "lagrange/dop853"}
    assert runs["mine/exudyn_tree/rk67"].settings["step"] == 0.001
    scene_file(folder, edits | {"# step = 1e-3": "stp = 0.002"})
    (line,) = (
        number
        for number, text in enumerate(path.read_text().splitlines(), 1)
        if text.startswith("[settings]")
    )
    assert f"mine.toml:{line}: settings: no setting 'stp', perhaps step" in refusal(
        "run", path, "-o", "r.h5"
    )
