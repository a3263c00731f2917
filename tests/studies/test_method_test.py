"""`test-method`: every shipped method passes, and broken engines fail, each with a right reason or
none."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import other_code
from support.commands import rotor_mbs
from support.other_code import Mistakes
from support.packages import forget_method_files

from rotor_mbs.analysis.checks import Check
from rotor_mbs.analysis.kinematics import kinetic_energy, potential_energy, tip_paths
from rotor_mbs.comparison.data_defects import judged_defects
from rotor_mbs.comparison.defect_search import DefectSearch
from rotor_mbs.comparison.faults import faults_in_time
from rotor_mbs.comparison.wrong_outputs import (
    root_mean_square,
    wrong_energy,
    wrong_loads,
    wrong_rows,
    wrong_tip,
)
from rotor_mbs.methods import catalogue
from rotor_mbs.methods.catalogue import find_method, method_names
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.lagrange.defects import interval_defects
from rotor_mbs.models.lagrange.heyoka_adapter import is_available
from rotor_mbs.scenario.catalogue import only_scene
from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.solution.trajectory import Integration, Solution, Trajectory, sample_times
from rotor_mbs.studies.method_test import NOT_FOUND, examine, five_blades, protocol_fault

DOCUMENT = (Path(__file__).parents[2] / "docs" / "your-engine.md").read_text()
(EXAMPLE,) = re.findall(r"```python\n(.*?)METHOD", DOCUMENT, re.DOTALL)
# The equations of the document by classical Runge-Kutta steps that end at every sample and at every
# jump.
RK4 = (
    EXAMPLE
    + """
import dataclasses
from rotor_mbs.methods.base import Settings
from rotor_mbs.methods.settings import step
from rotor_mbs.scenario.time_table import intervals, segments, value_at

@dataclasses.dataclass(frozen=True)
class Steps(Settings):
    step: float = step(8e-4)

class Rk4(Solver):
    def __init__(self, scene, settings):
        super().__init__(scene, settings)
        self.step = settings.step

    def loads(self, t, part):
        return np.array(part.loads_at(t))

    def one(self, t, h, y, part):
        k1 = self.f(t, y, part)
        k2 = self.f(t + h / 2, y + h / 2 * k1, part)
        k3 = self.f(t + h / 2, y + h / 2 * k2, part)
        k4 = self.f(t + h, y + h * k3, part)
        return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def stops(self):
        return intervals(self.scene.load_segments, self.scene.samples, every_sample=True)

    def start(self):
        return np.array(self.scene.initial_angles + self.scene.initial_rates)

    def integrate(self):
        y = self.start()
        self.states = [y]
        for stop in self.stops():
            count = max(1, int(np.ceil((stop.end - stop.start) / self.step - 1e-9)))
            h = (stop.end - stop.start) / count
            for i in range(count):
                y = self.one(stop.start + i * h, h, y, stop.segment)
            if stop.ends_at_sample:
                self.states.append(y)
        return Integration(True, "", self.scene.duration)

METHOD = Method(name="rk4", label="own, RK4", build=Rk4, settings=Steps, order=4, fixed_step=True)
"""
).replace("np.array(part.loads_at(t))\n        M =", "self.loads(t, part)\n        M =")
PAST = "np.array([value_at(table, {}) for table in self.scene.load_tables])"
# What is put in place of what, and what a reason may say beside "cause not found"; more in
# support/broken_engines.py.
BROKEN = {
    "Coriolis sign": ("rotor -= 2 *", "rotor -= -2 *", "opposite sign of the Coriolis terms"),
    "inertia about the wrong point": (
        "+= np.array([m *",
        "+= np.array([2 * m *",
        "inertia about the root used as inertia about",
    ),
    "damping ignored": (
        " - self.d * v[1:]",
        "",
        "without the dampers of the bearings|damping off by -100 %",
    ),
    "torque late by a step": (
        "np.array(part.loads_at(t))",
        PAST.format("t - self.step"),
        "load|torque",
    ),
    "NaN with success": (
        "return Integration(True",
        "self.states[-3:] = [np.nan * y] * 3\n        return Integration(True",
        "row [0-9]+ is not finite",
    ),
    "no jump handling": (
        "intervals(self.scene.load_segments,",
        "intervals(segments([()] * 9, self.scene.duration),",
        "load|jump",
    ),
    "first order": (
        "return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)",
        "return y + h * k1",
        "order (1.0|1.1|0.9)|order 2.* where 4 is expected",
    ),
    "state kept": (
        "        y = self.start()",
        (
            "        Rk4.runs = getattr(Rk4, 'runs', 0) + 1\n        y = self.start() + 1e-12 * "
            "Rk4.runs"
        ),
        "state kept between runs",
    ),
    "a step too few": (
        "for i in range(count)",
        "for i in range(count - (stop.end == self.scene.duration))",
        "times late|row repeated|row omitted|its step|continues from another state",
    ),
    "angles wrapped": (
        (
            "return Trajectory(self.time[: len(self.states)], *np.split(np.array(self.states), 2, "
            "axis=1))"
        ),
        "q, v = np.split(np.array(self.states), 2, axis=1)\n        return Trajectory(self.time, "
        "(q + np.pi) % (2 * np.pi) - np.pi, v)",
        "angles are wrapped",
    ),
}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.chdir(tmp_path)
    yield
    forget_method_files()


def examined(text: str) -> list[Check]:
    Path("mine.py").write_text(text)
    (name,) = catalogue.check_names("mine.py")
    return examine(name)


@pytest.mark.full
def test_the_engine_that_is_broken_below_passes() -> None:
    assert [check for check in examined(RK4) if not check.passed] == []


# Half a minute each: of the others every night; on the first scene alone more of them are in
# test_engines_tried.py.
_IN_CI = ("no jump handling",)


@pytest.mark.parametrize(
    "fault",
    [
        pytest.param(one, marks=pytest.mark.full if one in _IN_CI else pytest.mark.nightly)
        for one in BROKEN
    ],
)
def test_a_broken_engine_fails_with_a_right_reason_or_none(fault: str) -> None:
    old, new, right = BROKEN[fault]
    assert RK4.count(old) >= 1
    text = RK4.replace(old, new)
    if fault == "no jump handling":
        text = text.replace("np.array(part.loads_at(t))", PAST.format("t"))
    failed = [check for check in examined(text) if not check.passed]
    assert failed
    own = {
        "order": r"measured order",
        "start": "the initial state",  # of a state that is kept
        "energy": "see the defect|too long a step",
        "mirror image": "does not give that of the motion",
        "renumbered": "by other numbers",
        "exact": "solved analytically",
    }
    for check in failed:
        assert NOT_FOUND in check.hint or re.search(
            f"{right}|{own.get(check.name, right)}", check.hint
        ), check
    assert any(re.search(right, check.hint) for check in failed)
    # What an engine raises is no reason.
    assert not any(re.match(r"[^;]*Error", check.hint) for check in failed)


@pytest.mark.nightly
@pytest.mark.parametrize("name", method_names(is_corrected=True))
def test_every_shipped_method_passes(name: str) -> None:
    if not find_method(name).is_installed:
        pytest.skip(f"{name} is not installed")
    assert [check for check in examine(name) if not check.passed] == []


def test_the_command_prints_a_table_and_writes_what_a_script_reads() -> None:
    method = "lagrange/taylor" if is_available() else "lagrange/dop853"
    ended = rotor_mbs("test-method", method, "--json", "t.json", "--junit", "t.xml")
    assert ended.status == 0, ended
    assert f"{method}  determinism   paper/fig11" in ended.out
    assert f"{method}: scenes and other checks 0/7\n" in ended.err  # a search may take minutes
    checks = json.loads(Path("t.json").read_text())
    assert {check["check"] for check in checks} == {
        "samples", "times", "start", "defect", "energy", "tip", "energies", "loads", "determinism",
        "builds", "exact", "mirror image", "renumbered", "time limit",
    }  # fmt: skip
    assert b'<testsuites name="rotor-mbs check" tests=' in Path("t.xml").read_bytes()
    assert rotor_mbs("test-method", "./none.py").status == 2


@pytest.mark.parametrize(
    ("change", "success", "fault"),
    [
        ({}, True, ""),
        ({}, False, "reports a failure: no reason given"),
        ({"time": np.linspace(0.0, 0.9, 5)}, True, "its times are not the scene's sample times"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_the_form_of_a_run_is_said(
    change: dict[str, object], success: bool, fault: str
) -> None:
    scene = only_scene("paper/fig03").replace(duration=1.0, samples=5)
    run = Trajectory(np.linspace(0.0, 1.0, 5), np.zeros((5, 2)), np.zeros((5, 2))).replace(**change)
    assert protocol_fault(Solution(scene, "a/b", run, Integration(success))) == fault


def test_a_load_jumps_between_two_rows() -> None:
    """An engine that ends its steps at rows alone has to fail."""
    away = [np.abs(sample_times(FIVE) - kink).min() for kink in FIVE.kink_times]
    assert max(away) > 1e-3


# ---- Rows and outputs that are made wrongly of a right motion


def right_run() -> Trajectory:
    return Trajectory(sample_times(FIVE), *other_code.trajectory(FIVE, sample_times(FIVE)))


def differenced(run: Trajectory) -> Trajectory:
    rates = run.rates.copy()
    rates[1:] = np.diff(run.angles, axis=0) / np.diff(run.time)[:, None]
    return run.replace(rates=rates)


def interpolated(run: Trajectory) -> Trajectory:
    some, rows = run.time[::5], np.hstack([run.angles, run.rates])
    columns = [np.interp(run.time, some, column) for column in rows[::5].T]
    angles, rates = np.split(np.stack(columns, axis=1), 2, axis=1)
    return run.replace(angles=angles, rates=rates)


def reversed_blades(run: Trajectory) -> Trajectory:
    order = [0, 5, 4, 3, 2, 1]
    return run.replace(angles=run.angles[:, order], rates=run.rates[:, order])


ROWS = {
    "rates are in degrees per second": lambda run: run.replace(rates=np.degrees(run.rates)),
    "rates have the opposite sign": lambda run: run.replace(rates=-run.rates),
    "rates are backward differences": differenced,
    "linear interpolation": interpolated,
    "pitches are in the reverse order of the blades": reversed_blades,
    "": lambda run: run.replace(rates=1.01 * run.rates),
}


def test_rows_that_are_made_wrongly_are_named() -> None:
    run = right_run()
    for expected, change in ROWS.items():
        wrong = change(run)
        defects = interval_defects(FIVE, wrong.time, wrong.angles, wrong.rates)
        text = wrong_rows(FIVE, wrong, defects)
        assert expected in text
        assert bool(expected) == bool(text)


def test_a_uniform_rotation_before_a_load_is_no_interpolation() -> None:
    scene = only_scene("paper/fig03").replace(duration=1.0, samples=51)
    time = sample_times(scene)
    angles = np.zeros((51, 2))
    angles[:, 0] = time + np.where(time > 0.6, (time - 0.6) ** 2, 0.0)
    rates = np.gradient(angles, time, axis=0)
    defects = interval_defects(scene, time, angles, rates)
    assert "interpolation" not in wrong_rows(scene, Trajectory(time, angles, rates), defects)


def test_tips_that_are_made_wrongly_are_named() -> None:
    run = right_run()
    own = tip_paths(FIVE, run.angles)
    without_pitch = tip_paths(FIVE, run.angles * [1, 0, 0, 0, 0, 0])
    tips = [blade.tip for blade in FIVE.blades]
    tips[1] = (0.1, 0.2, 2.5)
    longer = replace(
        FIVE, blades=tuple(replace(b, tip=tip) for b, tip in zip(FIVE.blades, tips, strict=True))
    )
    for tip, expected in (
        (without_pitch, "tips without the rotation by the pitch"),
        (own[:, ::-1], "tips of the blades in reverse order"),
        (np.roll(own, 1, axis=1), "tips of the previous blade for each blade"),
        (own + np.array([0.1, 0.0, 0.0]), "tips off by (0.1, 0, 0) m of the base"),
        (tip_paths(longer, run.angles), "tip of blade 2 off by (0, 0, 0.1) m of the blade's frame"),
        (own * (1.0 + 0.01 * run.time[:, None, None]), ""),
    ):
        assert wrong_tip(FIVE, run.replace(tip=tip)) == expected


def test_energies_that_are_made_wrongly_are_named() -> None:
    run = right_run()
    kinetic, potential = (
        kinetic_energy(FIVE, run.angles, run.rates),
        potential_energy(FIVE, run.time, run.angles),
    )
    without_hub = replace(FIVE, hub_inertia=0.0)
    run = run.replace(kinetic_energy=kinetic, potential_energy=potential, work=0.0 * kinetic)
    for name, energy, expected in (
        (
            "kinetic energy",
            kinetic_energy(without_hub, run.angles, run.rates),
            "without the hub's inertia",
        ),
        ("kinetic energy", kinetic + 0.01 * run.time, ""),
        ("potential energy", -potential, "opposite sign"),
        ("potential energy", potential + 100.0, "zero at another height"),
        ("potential energy", potential + 0.01 * run.time, ""),
    ):
        wrong = run.replace(**{name.replace(" ", "_"): energy})
        assert wrong_energy(FIVE, wrong, name) == expected


def test_loads_that_are_made_wrongly_are_named() -> None:
    run = right_run()
    loads = other_code.loads(FIVE, run.time, run.angles, run.rates)
    force, moment = loads["blade_root_force"], loads["blade_root_moment"]
    centres = np.array([blade.centre_of_mass for blade in FIVE.blades])
    about_centre = moment - np.cross(centres, force)
    for changed, expected in (
        (
            {"blade_root_force": -force},
            "blade root force: sign reversed (action in place of reaction)",
        ),
        (
            {"blade_root_force": np.roll(force, -1, axis=1)},
            "columns exchanged: blade root force 1 is blade root force 2, ",
        ),
        (
            {"blade_root_moment": about_centre},
            "blade root moment: about the centre of mass in place of the root",
        ),
        ({"shaft_force": 1e-3 * loads["shaft_force"]}, "shaft force: kN taken as N"),
        ({"shaft_force": loads["shaft_force"] + run.time[:, None]}, ""),
    ):
        found = wrong_loads(FIVE, run.replace(**(loads | changed)))
        assert found.startswith(expected)
        assert bool(found) == bool(expected)


def test_rates_in_degrees_are_no_wrapped_angles() -> None:
    run = right_run()
    turning = replace(FIVE, initial_rates=(20.0, *FIVE.initial_rates[1:]))
    fast = Trajectory(run.time, *other_code.trajectory(turning, run.time))
    wrapped = fast.replace(angles=(fast.angles + np.pi) % (2.0 * np.pi) - np.pi)
    for rows, fault in (
        (wrapped, "angles are wrapped"),
        (fast.replace(rates=np.degrees(fast.rates)), ""),
    ):
        text = protocol_fault(Solution(turning, "a/b", rows, Integration(True)))
        assert fault in text
        assert bool(fault) == bool(text)


def test_a_motion_that_falls_behind_in_many_intervals_is_late() -> None:
    """As by an engine that omits a step of 1 ms in some intervals."""
    scene = replace(FIVE, rotor_torque=(), pitch_torque=(), bearing_rest=())
    time = sample_times(scene)
    is_late = np.arange(len(time)) % 3 == 1
    motion = other_code.trajectory(scene, time - 1e-3 * np.cumsum(is_late))
    defects = interval_defects(scene, time, *motion)
    (text,) = faults_in_time(judged_defects(scene, defects, 1e-6))
    assert text == (
        "the motion is late by 0.001 s more in each of 10 intervals from t = 0 to 0.56 s: "
        "wrong steps, or times"
    )


# ---- Causes, on the states of a run by other equations


def changed_blades(scene: Scene, factor: float) -> tuple[Blade, ...]:
    """Blades whose inertia about the root lacks (0) or has twice (2) Steiner's share."""
    blades = []
    for blade in scene.blades:
        m, r = (factor - 1.0) * blade.mass, np.array(blade.centre_of_mass)
        share = m * (r @ r * np.eye(3) - np.outer(r, r))
        elements = blade.inertia_tensor + share
        inertia = tuple(elements[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist())
        blades.append(replace(blade, inertia=inertia))
    return tuple(blades)


FIVE = replace(five_blades(), outputs=("angles", "rates"))
OTHERS: dict[str, tuple[Any, Mistakes, str]] = {
    "right": ({}, other_code.NONE, ""),
    "hub": ({"hub_inertia": 25.0}, other_code.NONE, "the hub's inertia once for each blade"),
    "rest": ({"bearing_rest": ()}, other_code.NONE, "without the rest angles of the springs"),
    "Steiner": ({"blades": changed_blades(FIVE, 0.0)}, other_code.NONE, "without Steiner's share"),
    "Steiner twice": (
        {"blades": changed_blades(FIVE, 2.0)},
        other_code.NONE,
        "inertia about the root used",
    ),
    "half": ({}, Mistakes(coriolis=0.5), "half of the Coriolis terms"),
    "azimuths": (
        {},
        Mistakes(phases=tuple(np.arange(5) * 2.0 * np.pi / 3.0)),
        "blades at multiples of 120 degrees",
    ),
    "dampers twice": (
        {"bearing_damping": tuple(2.0 * d for d in FIVE.bearing_damping)},
        other_code.NONE,
        "twice the dampers of the bearings",
    ),
    "rest in degrees": (
        {
            "bearing_rest": tuple(
                tuple((t, np.radians(r)) for t, r in table) for table in FIVE.bearing_rest
            )
        },
        other_code.NONE,
        "rest angles of the springs in rad taken as degrees",
    ),
    "torques of other blades": (
        {"pitch_torque": (*FIVE.pitch_torque[-1:], *FIVE.pitch_torque[:-1])},
        other_code.NONE,
        "torque.pitch of the previous blade at each blade",
    ),
    "one bearing": (
        {"bearing_stiffness": (30.0,) * 5, "bearing_damping": (2.0,) * 5},
        other_code.NONE,
        "stiffness and damping of bearing 1 at all blades",
    ),
    "no products": (
        {"blades": tuple(replace(b, inertia=(*b.inertia[:3], 0.0, 0.0, 0.0)) for b in FIVE.blades)},
        other_code.NONE,
        "products of inertia about the centre of mass ignored",
    ),
    "azimuths in degrees": (
        {},
        Mistakes(phases=tuple(np.radians(np.arange(5) * 0.4 * np.pi))),
        "in rad taken as degrees",
    ),
    "gravity upwards": ({"gravity": -9.81}, other_code.NONE, "or gravity along +z of the base"),
    "damper": (
        {"bearing_damping": tuple(1.5 * d for d in FIVE.bearing_damping)},
        other_code.NONE,
        "bearing.damping off",
    ),
    # Two mistakes at once have no name of their own.
    "two": ({"hub_inertia": 25.0}, Mistakes(coriolis=0.5), None),
}


_QUICK = ("right", "Steiner")


@pytest.mark.parametrize(
    "name", [pytest.param(one, marks=() if one in _QUICK else pytest.mark.full) for one in OTHERS]
)
def test_a_textbook_cause_is_named_alone_and_nothing_else(name: str) -> None:
    changes, mistakes, expected = OTHERS[name]
    motion = other_code.trajectory(replace(FIVE, **changes), sample_times(FIVE), mistakes)
    defects = interval_defects(FIVE, sample_times(FIVE), *motion)
    causes = []
    if defects.judged_sizes.max() > 1e-6:
        causes = DefectSearch(judged_defects(FIVE, defects, 1e-6)).textbook_causes()
    if not expected:
        assert causes == []
    else:
        (cause,) = causes
        assert expected in cause


def test_the_order_of_a_step_is_that_of_root_mean_squares() -> None:
    """Of both sizes the same quantity: halved steps of an engine of order four leave a
    sixteenth."""
    scene = replace(FIVE, rotor_torque=(), bearing_rest=())
    coarse, fine = (
        interval_defects(scene, run.time, run.angles, run.rates)
        for run in (
            solve("exudyn_tree/rk44", scene, {"step": step}).trajectory for step in (0.02, 0.01)
        )
    )
    assert np.log2(root_mean_square(coarse) / root_mean_square(fine)) == pytest.approx(4.0, abs=0.3)
