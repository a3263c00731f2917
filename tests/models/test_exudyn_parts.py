"""What is built and what is not, how failures are told, and the quadrature of work where no verdict
can tell."""

from __future__ import annotations

import math
import os
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from support.scenes import MIXED, PAPER_BLADE, make_scene, paper

from rotor_mbs.errors import InputError, MethodRefusal
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.exudyn import geometry, methods, sensor_samples

POLE = replace(PAPER_BLADE, centre_of_mass=(0.0, 0.0, 15.42))
BARE = replace(paper("fig08"), gravity=0.0, outputs=("angles", "rates"))
SCENES = {
    "bare": BARE,
    "gravity": replace(BARE, gravity=9.8),
    "tip": replace(BARE, outputs=("angles", "rates", "tip")),
    "energy": replace(BARE, outputs=("angles", "rates", "energy")),
    "torque": replace(BARE, rotor_torque=((0.0, 5.0),)),
    "torque over time": replace(BARE, rotor_torque=((0.0, 5.0), (1.0, 7.0))),
    "springs": replace(BARE, bearing_stiffness=(1.0, 0.0, 2.0)),
    "dampers": replace(BARE, bearing_damping=(0.0, 1.0, 0.0), shaft_damping=1.0),
    "hub": replace(BARE, hub_inertia=3.0),
    "loads": replace(BARE, outputs=("angles", "rates", "loads")),
    "fixed pitch": make_scene([0.1, 0.2], [0.0, 0.0], (POLE,)),
    "all": MIXED,
}
TREE, CHAIN = "exudyn_tree/rk67", "exudyn_chain/generalized_alpha"
METHODS = {method.name: method for method in methods.METHODS}
KINDS = ("node", "object", "marker", "load", "sensor")


def engine_counts(solver):
    """How many nodes, objects, markers, loads and sensors the engine holds."""
    data = solver.system._mbs.systemData
    return {kind: getattr(data, f"NumberOf{kind.capitalize()}s")() for kind in KINDS}


def listed(name, scene):
    kinds = [item.kind for item in METHODS[name].items(scene)]
    return {kind: kinds.count(kind) for kind in KINDS}


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("name", [TREE, CHAIN])
def test_the_list_is_what_the_engine_holds(name, scene) -> None:
    solver = METHODS[name].build(SCENES[scene], METHODS[name].settings())
    assert engine_counts(solver) == listed(name, SCENES[scene])


def extra(name, scene):
    bare, more = listed(name, BARE), listed(name, SCENES[scene])
    return {kind: more[kind] - bare[kind] for kind in KINDS if more[kind] != bare[kind]}


@pytest.mark.parametrize(
    ("scene", "tree", "chain"),
    [
        # one for each blade; the tree has it in its one object
        ("gravity", {}, {"marker": 3, "load": 3}),
        ("tip", {"sensor": 3}, {"sensor": 3}),
        # position and velocity; the chain reads positions anyhow
        ("energy", {"sensor": 6}, {"sensor": 3}),
        ("torque", {"marker": 1, "load": 1}, {"load": 1}),
        ("torque over time", {"marker": 1, "load": 1}, {"load": 1}),
        # a spring and its turn counter where there is stiffness
        ("springs", {}, {"node": 2, "object": 2}),
        ("dampers", {}, {"object": 2}),
        ("hub", {}, {}),
    ],
)
def test_a_scene_builds_what_it_needs_and_no_more(scene, tree, chain) -> None:
    assert extra(TREE, scene) == tree
    assert extra(CHAIN, scene) == chain


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        ("bare", ""),
        ("gravity", ", gravity"),
        ("springs", ", bearing stiffness"),
        ("dampers", ", damping"),
    ],
)
def test_the_list_says_what_the_object_of_the_tree_has(scene: str, words: str) -> None:
    (tree,) = (item for item in METHODS[TREE].items(SCENES[scene]) if item.kind == "object")
    assert tree.detail == f"ObjectKinematicTree: 4 links{words}"


@pytest.mark.parametrize(
    ("outputs", "damping", "along_the_path"),
    [
        (("angles", "energy"), 1.0, True),
        (("angles", "energy"), 0.0, False),
        (("angles",), 1.0, False),
    ],
)
def test_work_is_integrated_along_the_path_where_it_is_asked_for_and_not_known(
    outputs, damping, along_the_path
) -> None:
    """The tree keeps rows between samples for it, and the extrapolated chain the work itself."""
    scene = replace(
        paper("fig11"), duration=0.2, samples=21, outputs=outputs, shaft_damping=damping
    )
    tree, extrapolated = (
        METHODS[name].build(scene, METHODS[name].settings())
        for name in (TREE, "exudyn_chain/extrapolated")
    )
    assert tree.integrate().success
    assert extrapolated.integrate().success
    assert (len(tree.system.rows("rates")) > scene.samples) is along_the_path
    assert (extrapolated.kept[-1].work != 0.0) is along_the_path


@pytest.mark.parametrize("blades", [2, 3, 4, 6])
def test_blades_that_balance_do_so_exactly(blades: int) -> None:
    """Zero pitches stay zero only if the azimuths add up to zero without rounding."""
    rotor = make_scene([0.0] * (1 + blades), [0.0] * (1 + blades), (PAPER_BLADE,) * blades)
    total = sum(geometry.mounting(rotor, i) for i in range(blades))
    assert total.tolist() == [[0.0, 0.0, 0.0], [0.0, blades, 0.0], [0.0, 0.0, 0.0]]


def test_a_pitch_without_inertia_is_left_out() -> None:
    assert listed(TREE, SCENES["fixed pitch"])["node"] == 1
    assert "1 coordinates" in METHODS[TREE].items(SCENES["fixed pitch"])[0].detail
    items = METHODS[CHAIN].items(SCENES["fixed pitch"])
    assert [item.name for item in items if "Joint" in item.detail] == ["shaft bearing"]
    assert [item.name for item in items if item.kind == "node"] == ["hub"]


def test_samples_the_engine_cannot_tell_apart_are_refused() -> None:
    settings = METHODS[TREE].settings()
    METHODS[TREE].build(replace(paper("fig08"), duration=1.0001e-5), settings)  # 1000 intervals
    with pytest.raises(MethodRefusal, match="1e-08 s apart"):
        METHODS[TREE].build(replace(paper("fig08"), duration=0.9999e-5), settings)
    with pytest.raises(InputError, match="steps"):
        METHODS[TREE].chosen(paper("fig08"), {"step": 1e-12})


# One blade runs into θ = π/2, where nothing holds the rotor: the rates go to infinity at about 0.06
# s.
SINGULAR = make_scene([0.3, 1.2], [0.5, 3.0], duration=1.0)


@pytest.mark.parametrize("name", ["exudyn_tree/dopri5", *(n for n in METHODS if "chain" in n)])
def test_a_hopeless_solve_ends_soon_and_says_so_in_one_line(name, capfd) -> None:
    run = solve(name, SINGULAR, {}, time_limit_s=5.0)
    assert not run.integration.success
    assert not run.integration.out_of_time
    assert run.integration.message not in ("", "the engine gave no reason")
    assert "\n" not in run.integration.message
    assert 0.0 < run.integration.time_reached < 0.1
    assert 1 < len(run.trajectory.time) < 11
    said = capfd.readouterr()
    assert said.out == said.err == ""


@pytest.mark.parametrize("name", ["exudyn_tree/rk67", "exudyn_chain/generalized_alpha"])
def test_a_run_over_its_time_limit_says_so_and_keeps_its_samples(name: str) -> None:
    """The engine makes an error of its own of what interrupts it within its code."""
    scene = paper("fig11", duration=3000.0, samples=30001)
    run = solve(name, scene, {}, time_limit_s=0.3)
    assert run.integration.out_of_time
    assert run.integration.message == "stopped at the time limit"
    assert 1 <= len(run.trajectory.time) < 30001


@pytest.mark.parametrize("name", ["exudyn_chain/generalized_alpha", "exudyn_chain/newmark_index2"])
def test_a_solve_that_fails_is_counted_to_the_last_step_that_it_took(name) -> None:
    """The kink of the torque comes after it, and makes another interval, which is not begun."""
    kinked = replace(SINGULAR, rotor_torque=((0.0, 0.0), (0.5, 0.0), (1.0, 1.0)))
    result = solve(name, kinked, {"step": 1e-3}).integration
    assert result.time_reached < 0.1
    assert result.time_reached == pytest.approx(1e-3 * result.steps, rel=1e-9)
    assert not result.out_of_time
    first = solve(name, replace(SINGULAR, samples=2), {"step": 1.0}).integration
    assert (first.steps, first.time_reached) == (0, 0.0)


def test_counts_of_steps_and_evaluations() -> None:
    scene = replace(paper("fig11"), duration=0.1, samples=11)
    rk44 = solve("exudyn_tree/rk44", scene, {"step": 3e-3}).integration
    # four steps of at most 3 ms in each 10 ms
    assert (rk44.steps, rk44.rhs_evaluations) == (40, 160)
    rk67 = solve("exudyn_tree/rk67", scene, {"step": 3e-3}).integration
    assert (rk67.steps, rk67.rhs_evaluations, rk67.time_reached) == (40, 280, 0.1)
    alpha = solve(CHAIN, scene, {"step": 1e-3}).integration
    assert alpha.steps == 100
    assert alpha.rhs_evaluations >= 200
    dopri5 = solve("exudyn_tree/dopri5", scene, {}).integration
    assert dopri5.rhs_evaluations % 7 == 0
    # fewer are rejected than intervals begun
    assert 0 < dopri5.rhs_evaluations // 7 - dopri5.steps < 10
    # one to a sample
    assert solve("exudyn_tree/dopri5", scene, {"absolute_tolerance": 1.0}).integration.steps == 10
    # two intervals, of the same steps
    kinked = replace(scene, rotor_torque=((0.0, 0.0), (0.05, 0.0), (0.1, 1.0)))
    assert solve("exudyn_tree/rk44", kinked, {"step": 3e-3}).integration.steps == 40
    linear = replace(
        BARE, blades=(POLE,) * 3, initial_rates=(1.0, 0.0, 0.0, 0.0), duration=0.1, samples=11
    )
    turning = solve("exudyn_tree/generalized_alpha", linear, {"step": 1e-3}).integration
    # an iteration a step, and the residual once more
    assert (turning.steps, turning.rhs_evaluations) == (100, 200)


def test_loads_and_rotation_vectors_are_refused_together_alone() -> None:
    settings, loads = METHODS[CHAIN].settings, replace(BARE, outputs=("angles", "rates", "loads"))
    for scene, node in ((BARE, "rotation_vector"), (loads, "euler_parameters")):
        assert engine_counts(METHODS[CHAIN].build(scene, settings(node=node))) == listed(
            CHAIN, scene
        )
    with pytest.raises(MethodRefusal, match="euler_parameters"):
        METHODS[CHAIN].build(loads, settings(node="rotation_vector"))


def test_ctrl_c_inside_a_solve_is_an_interrupt() -> None:
    scene = replace(paper("fig11"), duration=2.0, samples=201)
    with (
        pytest.raises(KeyboardInterrupt),
        subprocess.Popen(["sh", "-c", f"sleep 0.5; kill -INT {os.getpid()}"]),
    ):
        solve(CHAIN, scene, {"step": 1e-4})


# A torque of 0 to 4 N m, then a jump to 10: ∫ over a rate of one is t² / 2, then 8 + 10 (t - 4).
TORQUE = ((0.0, 0.0), (4.0, 4.0), (4.0, 10.0), (8.0, 10.0))


@pytest.mark.parametrize(
    ("rows", "at_jump"),
    [
        (30, 4.0),
        (41, 4.0),
        (81, 4.0),
        (81, math.nextafter(4.0, 0.0)),
        (81, math.nextafter(4.0, 8.0)),
    ],
    ids=[
        "short of the jump",
        "up to it",
        "across it",
        "a row before it by rounding",
        "a row behind it by rounding",
    ],
)
def test_work_of_a_torque_that_jumps(rows: int, at_jump: float) -> None:
    """The row at the jump belongs to both segments, on whichever side of the jump its time was
    rounded to."""
    scene = make_scene(
        [0.0, 0.0], [1.0, 0.0], (PAPER_BLADE,), duration=8.0, samples=81, rotor_torque=TORQUE
    )
    time = np.linspace(0.0, 8.0, 81)
    time[40] = at_jump
    time = time[:rows]
    angles, rates = np.zeros((rows, 2)), np.zeros((rows, 2))
    angles[:, 0], rates[:, 0] = time, 1.0
    work = sensor_samples.work(scene, time, angles, rates)
    exact = np.where(time <= 4.0, 0.5 * time**2, 8.0 + 10.0 * (time - 4.0))
    assert np.abs(work - exact).max() < 1e-12


def test_the_window_stands_in_the_middle() -> None:
    """Eight points, four on either side: an interval's error is 2497/3628800 h⁹ f⁽⁸⁾; one row off,
    3233/3628800."""
    h = 0.25
    time = np.arange(41) * h
    errors = np.diff(sensor_samples.cumulative_integral(time, np.exp(time)) - np.exp(time))
    middle = time[:-1] + 0.5 * h
    inside = slice(3, -3)
    share = np.abs(errors[inside]) / (h**9 * np.exp(middle[inside]))
    assert share == pytest.approx(2497 / 3628800, rel=0.1)


@pytest.mark.parametrize("rows", [2, 3, 4, 5, 6, 7, 8])
def test_few_rows_still_carry_the_polynomial_through_them(rows: int) -> None:
    time = np.cumsum(np.linspace(0.3, 0.5, rows))
    time /= time[-1]
    got = sensor_samples.cumulative_integral(time, rows * time ** (rows - 1))
    assert got == pytest.approx(time**rows - time[0] ** rows, abs=1e-13)
