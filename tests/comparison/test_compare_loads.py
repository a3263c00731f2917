"""Loads of other codes: right ones are accepted at 1e-9, each wrong axis, sign, unit, frame and
point is named."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import other_code
from support.commands import rotor_mbs

import rotor_mbs as rm
from rotor_mbs.comparison.data import load_data
from rotor_mbs.comparison.loads import LoadComparison, compare_loads
from rotor_mbs.errors import InputError
from rotor_mbs.models.lagrange.defects import interval_defects
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.defects import Defects

Array = Any
Arrays = dict[str, Array]


@functools.cache
def short(name: str) -> Scene:
    """Its torques jump after the end."""
    return replace(rm.scene(name), duration=0.3, samples=61)


@functools.cache
def data_of(name: str) -> tuple[Arrays, Defects]:
    scene = short(name)
    time = np.linspace(0.0, scene.duration, scene.samples)
    angles, rates = other_code.trajectory(scene, time)
    arrays = {
        "time": time,
        "angles": angles,
        "rates": rates,
        **other_code.loads(scene, time, angles, rates),
    }
    return arrays, interval_defects(scene, time, angles, rates)


def judged(name: str, changes: Arrays, tolerance: float = 1e-6) -> LoadComparison:
    arrays, defects = data_of(name)
    loads = load_data(arrays | changes, short(name)).only(loads=True)
    return compare_loads(short(name), loads, defects, tolerance)


@pytest.mark.parametrize(
    "name",
    [
        "paper/fig08",
        "paper/fig11",
        "check/general",
        pytest.param("paper/fig15-10kNm", marks=pytest.mark.full),
        pytest.param("check/pitch-loads", marks=pytest.mark.full),
    ],
)
def test_right_loads_are_accepted_at_1e_9(name: str) -> None:
    found = judged(name, {}, 1e-9)
    count = len(short(name).blades)
    assert (found.message, found.likely, len(found.errors)) == ("", (), 7 * count + 6)
    # Not only for what rounding is given: without that, too.
    expected = load_data(data_of(name)[0], short(name)).only(loads=True).values
    assert np.abs(found.expected - expected).max() < 1e-9 * np.abs(expected).max()


def about(point: Callable[[Any], Any]) -> Callable[[Scene, Arrays], Arrays]:
    """Root moments about another point of each blade: M - p × F."""

    def change(scene: Scene, data: Arrays) -> Arrays:
        arms = np.array([point(blade) for blade in scene.blades])
        return {
            "blade_root_moment": data["blade_root_moment"]
            - np.cross(arms, data["blade_root_force"])
        }

    return change


def in_rotor(_: Scene, data: Arrays) -> Arrays:
    force, angles = data["blade_root_force"], data["angles"]
    turned = [
        other_code.about("z", angles[:, 1 + i]).apply(force[:, i]) for i in range(force.shape[1])
    ]
    return {"blade_root_force": np.stack(turned, axis=1)}


def in_base(scene: Scene, data: Arrays) -> Arrays:
    force, angles = in_rotor(scene, data)["blade_root_force"], data["angles"]
    turned = [
        other_code.about("y", angles[:, 0] + phase).apply(force[:, i])
        for i, phase in enumerate(scene.phases)
    ]
    return {"blade_root_force": np.stack(turned, axis=1)}


def shaft_in_rotor(_: Scene, data: Arrays) -> Arrays:
    return {"shaft_force": other_code.about("y", -data["angles"][:, 0]).apply(data["shaft_force"])}


def with_torque(scene: Scene, data: Arrays) -> Arrays:
    torque = other_code.value_at(scene.rotor_torque, data["time"])
    return {"shaft_moment": data["shaft_moment"] + torque[:, None] * [0.0, 1.0, 0.0]}


def without(forgotten: str) -> Callable[[Scene, Arrays], Arrays]:
    """Root forces m (a + g up) of which the weight, or what the coordinates' accelerations make of
    a, is forgotten."""

    def change(scene: Scene, data: Arrays) -> Arrays:
        force = data["blade_root_force"].copy()
        for i, blade in enumerate(scene.blades):
            spin, pitch_rate = data["rates"][:, 0], data["rates"][:, 1 + i]
            azimuth, pitch = data["angles"][:, 0] + scene.phases[i], data["angles"][:, 1 + i]
            up = other_code.about("z", -pitch).apply(
                other_code.about("y", -azimuth).apply([0.0, 0.0, 1.0])
            )
            weight = blade.mass * scene.gravity * up
            if forgotten == "weight":
                force[:, i] -= weight
                continue
            s, c = np.sin(pitch), np.cos(pitch)
            omega = np.stack([spin * s, spin * c, pitch_rate], axis=1)
            coriolis = np.stack([spin * c * pitch_rate, -spin * s * pitch_rate, 0.0 * spin], axis=1)
            r = np.array(blade.centre_of_mass)
            turning = np.cross(coriolis, r) + np.cross(omega, np.cross(omega, r))
            force[:, i] = weight + (blade.mass * turning if forgotten == "accelerations" else 0.0)
        return {"blade_root_force": force}

    return change


def late(_: Scene, data: Arrays) -> Arrays:
    force = data["blade_root_force"]
    return {"blade_root_force": np.concatenate([force[:1], force[:-1]])}


Change = Callable[[Scene, Arrays], Arrays]
REVERSED = "sign reversed (action in place of reaction)"
MISTAKES: dict[str, tuple[Change, list[str]]] = {
    "kN": (lambda _, d: {"blade_root_force": d["blade_root_force"] / 1e3}, ["kN taken as N"]),
    "N in a column of kN": (
        lambda _, d: {"shaft_moment [kN m]": d["shaft_moment"], "shaft_moment": None},
        ["N taken as kN"],
    ),
    "sign": (lambda _, d: {"blade_root_force": -d["blade_root_force"]}, [REVERSED]),
    "sign and kN": (
        lambda _, d: {"shaft_moment": -d["shaft_moment"] / 1e3},
        [f"{REVERSED}, kN taken as N"],
    ),
    "x and y exchanged": (
        lambda _, d: {"blade_root_force": d["blade_root_force"][:, :, [1, 0, 2]]},
        [
            (
                "columns exchanged: blade root force 1 x is blade root force 1 y, blade root force "
                "1 y is blade root force"
            )
        ],
    ),
    "blades 1 and 2 exchanged": (
        lambda _, d: {"blade_root_moment": d["blade_root_moment"][:, [1, 0, 2]]},
        [
            "columns exchanged: blade root moment 1 is blade root moment 2, "
            "blade root moment 2 is blade root moment 1"
        ],
    ),
    "about the centre of mass": (
        about(lambda blade: blade.centre_of_mass),
        ["about the centre of mass in place of the root"],
    ),
    "at a hub radius": (
        about(lambda _: (0.0, 0.0, 1.5)),
        ["hub.radius 1.5 m in place of 0 m"],
    ),
    "tower top": (
        lambda _, d: {
            "shaft_moment": d["shaft_moment"] - np.cross([0.0, -2.0, 0.0], d["shaft_force"])
        },
        ["about the point (0, -2, 0) m of the base frame in place of the hub centre"],
    ),
    "a row late": (late, [": a row late"]),
    "without weight": (without("weight"), [": without the weight"]),
    "without accelerations": (
        without("accelerations"),
        [": without the accelerations of rotor and pitches"],
    ),
    "weight alone": (without("inertia"), [": of the weight alone, without inertia forces"]),
    "without pitch": (in_rotor, ["in the rotor frame"]),
    "in the base": (in_base, ["in the base frame"]),
    "turning with the shaft": (shaft_in_rotor, ["in the rotor frame"]),
    "with the torque": (with_torque, ["shaft moment y: with the torque on the rotor in it"]),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named(mistake: str) -> None:
    change, texts = MISTAKES[mistake]
    arrays, _ = data_of("check/pitch-loads")
    changes = change(short("check/pitch-loads"), arrays)
    found = judged("check/pitch-loads", changes)
    assert found.message.split(":")[0].startswith(
        next(iter(changes)).partition(" ")[0].replace("_", " ")
    )
    for text, likely in zip(texts, found.likely, strict=True):
        assert text in likely, found.likely


@pytest.mark.parametrize("point", ["centre_of_mass", "tip"])
def test_another_point_is_named_for_point_masses_too(point: str) -> None:
    """About whose own place nothing is left."""
    changes = about(lambda blade: getattr(blade, point))(
        short("paper/fig11"), data_of("paper/fig11")[0]
    )
    (text,) = judged("paper/fig11", changes).likely
    assert f": about the {point.replace('_', ' ')} in place of the root" in text


def test_what_nothing_explains_has_no_cause() -> None:
    force = data_of("check/general")[0]["blade_root_force"]
    noise = np.random.default_rng(3).normal(0.0, 3e-6 * np.abs(force).max(), force.shape)
    for wrong in (
        1.01 * force,
        force + noise,
        force + 1.0,
        force * np.linspace(1.0, 1.1, len(force))[:, None, None],
    ):
        found = judged("check/general", {"blade_root_force": wrong})
        assert found.message.startswith("blade root force")
        assert found.likely == ()


def test_an_error_just_above_the_tolerance_is_no_other_point() -> None:
    """A point is always found that takes a little of it away."""
    moment, force = (
        data_of("check/general")[0][f"blade_root_{kind}"] for kind in ("moment", "force")
    )
    near = (
        moment
        - np.cross([2e-6, -2e-6, 1e-6], force)
        + 3e-7 * np.abs(moment).max() * np.sin(np.arange(61))[:, None, None]
    )
    found = judged("check/general", {"blade_root_moment": near})
    assert (found.message[:17], found.likely) == ("blade root moment", ())


def test_a_single_wrong_row_is_told_with_its_time() -> None:
    force = data_of("check/general")[0]["blade_root_force"].copy()
    force[40, 1, 2] += 1e-3 * np.abs(force[:, 1, 2]).max()
    found = judged("check/general", {"blade_root_force": force})
    assert "blade root force 2 z: difference of 1.0e-03 of its largest magnitude" in found.message
    assert "at t = 0.2 s" in found.message


@pytest.mark.full
def test_only_columns_that_are_there_are_judged_and_omit_leaves_out(tmp_path: Path) -> None:
    """By the command, from a CSV with OpenFAST's names, axes and sign, in kN."""
    arrays, _ = data_of("check/pitch-loads")
    force, moment = arrays["blade_root_force"][:, 0], arrays["blade_root_moment"][:, 1]
    pitch = other_code.about("z", arrays["angles"][:, 2]).apply(moment)
    columns = {
        "time [s]": arrays["time"],
        **dict(
            zip(
                ["rotor [rad]", *(f"pitch {i} [rad]" for i in (1, 2, 3))],
                arrays["angles"].T,
                strict=True,
            )
        ),
        **dict(
            zip(
                ["rotor rate", *(f"pitch {i} rate" for i in (1, 2, 3))],
                arrays["rates"].T,
                strict=True,
            )
        ),
        "RootFxb1 [kN]": -force[:, 1] / 1e3,
        "RootFyb1 [kN]": force[:, 0] / 1e3,
        "RootFzb1 [kN]": -force[:, 2] / 1e3,
        "RootMxc2 [kN-m]": -pitch[:, 1] / 1e3,
        "RootMyc2 [kN-m]": pitch[:, 0] / 1e3,
        "shaft_moment_y_kNm": -arrays["shaft_moment"][:, 1] / 1e3,  # wrong
    }
    table = np.column_stack(list(columns.values()))
    np.savetxt(
        tmp_path / "d.csv", table, delimiter=",", header=",".join(columns), comments="", fmt="%.17g"
    )
    scene = short("check/pitch-loads")
    found = rm.compare(
        tmp_path / "d.csv", scene, columns={"omit": ["shaft_moment"]}, tolerance=1e-9
    )
    assert (found.status, found.message, len(found.verdict.channels)) == ("ok", "", 13)
    assert "shaft_moment_y_kNm" in found.verdict.unused
    (tmp_path / "own.toml").write_text(
        rm.scene("check/pitch-loads").replace(duration=0.3, samples=61).text
    )
    wrong = rotor_mbs(
        "compare", tmp_path / "d.csv", "--scene", tmp_path / "own.toml", "-o", tmp_path / "page"
    )
    assert wrong.status == 1
    assert "blade root force 1 y = -'RootFxb1' [kN]" in wrong.out
    assert "blade root moment 2 x, coned frame = 'RootMyc2' [kN-m]" in wrong.out
    assert f"shaft moment y: {REVERSED}" in wrong.out
    page = (tmp_path / "page" / "index.html").read_text()
    assert all(
        text in page
        for text in ("blade root moment 2 x, coned frame", "of the largest", "shaft moment y")
    )


def test_stored_loads_are_the_datas_and_the_closed_forms() -> None:
    arrays, _ = data_of("paper/fig11")
    found = rm.compare(
        arrays | {"shaft_force": 1.5 * arrays["shaft_force"]}, short("paper/fig11")
    ).to_xarray()
    np.testing.assert_allclose(
        found.shaft_force_z_reference, arrays["shaft_force"][:, 2], rtol=1e-9
    )
    np.testing.assert_allclose(
        found.shaft_force_z_error, 0.5 * arrays["shaft_force"][:, 2], rtol=1e-8
    )
    assert (found.shaft_force_z.attrs["units"], found.shaft_moment_x.attrs["units"]) == ("N", "N m")


def test_a_mapping_says_column_unit_sign_and_frame_of_a_load() -> None:
    arrays, _ = data_of("paper/fig11")
    turned = in_rotor(short("paper/fig11"), arrays)["blade_root_force"]
    states = {
        "time": "time",
        "rotor": "angles[0]",
        **{f"pitch_{i}": f"angles[{i}]" for i in (1, 2, 3)},
    }
    mapping = {"blade_root_force_2_x": {"column": "fx", "unit": "kN", "sign": -1, "frame": "rotor"}}
    found = rm.compare(
        {**arrays, "fx": -turned[:, 1, 0] / 1e3}, short("paper/fig11"), columns=states | mapping
    )
    compared = [channel.name for channel in found.verdict.channels]
    assert found.status == "ok"
    assert "blade root force 2 x, rotor frame" in compared
    assert "blade root force 2 x" not in compared
    with pytest.raises(
        InputError, match="shaft_force_x: frame 'blade'; allowed: base, shaft, rotor"
    ):
        rm.compare(
            arrays,
            short("paper/fig11"),
            columns={"shaft_force_x": {"column": "time", "frame": "blade"}},
        )
    with pytest.raises(InputError, match="no column for an angle or a rate"):
        rm.compare(
            {"time": arrays["time"], "shaft_force": arrays["shaft_force"]}, short("paper/fig11")
        )


@pytest.mark.full
def test_loads_of_few_digits_are_judged_by_them() -> None:
    """States and loads of six digits: right ones are ok, 0.1 % off is not."""
    arrays, _ = data_of("check/general")
    six_digits = np.vectorize(lambda value: float(f"{value:.5e}"))
    for factor, status in ((1.0, "ok"), (1.001, "inaccurate")):
        table = {
            "time": arrays["time"],
            "q": six_digits(arrays["angles"]),
            "qd": six_digits(arrays["rates"]),
            "blade_root_force_1_z": six_digits(factor * arrays["blade_root_force"][:, 0, 2]),
        }
        assert rm.compare(table, short("check/general")).status == status
