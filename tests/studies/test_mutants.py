"""No change to a term, a parameter or a rule goes unnoticed: the mutation run, and what it cannot notice and why.

The scene's own numbers are perturbed here; the sources in `mutation.py`, which can be run by itself; the bounds in
`test_check.py`.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.checking import add_run, failed, judged, results_file, shipped

from rotor_mbs.methods.solve import solve
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import Table

# Mutants that neither a verdict nor a test can tell from the original, by module.scope and what is changed, and why.
# First those that are the original in other words: what they change is a zero, a whole number or a whole turn, is read
# by nobody, or is annulled by what follows.
EQUIVALENT = {
    r"closed_form\.energies .*(0\.0 \* sin_q|:22: sin_q -> cos_q)": "a zero of the right kind of number",
    r"parameters\._cosine_of_turn .*sign in \(?turn \+ Fraction": "the same angle but for a whole turn",
    r"geometry\._turn .*2 \* rest scaled": "compares whole numbers",
    r"geometry\.hub_body .*0\.5 \* scene\.hub_inertia scaled": "the hub turns about y alone and feels no other inertia",
    r"geometry\._joined .*r @ r \* np\.eye": (
        "a fixed blade has its centre of mass on its own z, in the rotor's plane: about y the product is zero"
    ),
    r"sensor_samples\.work .*last - first scaled": "whole numbers: rows counted",
    r"sensor_samples\.cumulative_integral .*sign in .*abscissae": "the points stand alike on both sides of the middle",
    r"sensor_samples\._joint_motion .*_dot\(hub_omega, z\)": "the hub turns about y, a pitch axis has no y: zero",
    r"sensor_samples\._dot ": (
        "a pitch is read off twice, across and along the shaft: a term lost shrinks both sides of the arctangent alike"
    ),
    r"sensor_samples\.unwrap .*right side of start - wrapped\[0\] lost": "rounded to turns, and less than half of one",
    r"sensor_samples\.unwrap .*scaled": "rounded to whole turns: 1 % of the way between two rows is no half turn",
    r"time_table\.intervals .*end - start scaled": "rounded to a whole number of intervals",
    r"mjcf\.model .*0\.5 \* scene\.hub_inertia scaled": "the hub turns about y alone and feels no other inertia",
    r"mjcf\.model .*0\.0 -> 1\.0": "the centre of mass of a hub that has no mass",
    r"literal\.fixed_pitch_acceleration .*(c2 -> s2|cos\(q2 \+ phase\): sine and cosine|:48: .* q2 \+ phase)": (
        "the cosine multiplies c, which is 0 where this function is used"
    ),
    r"literal\.three_blade_accelerations .*c[345] -> s[345]": (
        "goes into the first row of (56) alone, whose place `rotor_gravity` takes"
    ),
    r"derivation\.a3 .*-> (0\.001|1\.000001)$": "the last row of a transformation matrix: nothing reads it",
    r"derivation\.blade_terms .*[sc]3 -> [sc]3": (
        "the matrix's last column, which is all that a point mass in the frame's origin takes of it, does not have it"
    ),
    r"derivation\.blade_terms .*trace\(by_23, m, by_3\) \+ trace\(by_32, m, by_3\)": (
        "U33,2 and U33 of a point mass are perpendicular: the second trace is zero identically"
    ),
    r"derivation\.forces .*left side of terms\.h_2_22": (
        "U32,2 and U32 of a point mass are perpendicular: h_2_22 is zero identically"
    ),
    r"observables\.tip_path .*sign of -1 lost": "the last axis of three one-dimensional arrays is their axis 1",
    r"judgement\._shaft_inertia_forms .*has_pitch_inertia: always": (
        "without pitch inertia the products of inertia that would be divided are zero, too"
    ),
    r"samples\._put_energies .*2 \* len\(columns\) scaled": "a count beside a count: a millionth more is the same",
    r"tree\._tree .*0\.0 -> ": "the offset of a spring of no stiffness: the rotor's",
    r"judgement\.allowed_of .*and, or in angle is None": "a method has a bound for both or for neither",
    r"ode_solvers\._right_hand_side .*isinstance\(state": "plain floats or the array's own: the same numbers",
    r"ode_solvers\._right_hand_side .*any\(segment\.slopes\): always": "slopes of zero: the same loads again",
    r"ode_solvers\.scipy_integrator .*reached > done: always": "no rows are added to the rows",
    r"ode_solvers\.__init__ .*0\.0 -> |(__init__|build_system) .*work_is_integrated\(scene\): always": (
        "the work of constant torques is integrated, too, where it is known from the angles"
    ),
    r"samples\.loads_at .*is_constant\(table\): never": "a table of one value, read at every time, gives that value",
    r"(samples\.loads_at(_start)?|kinematics\.work_of_constant_loads|exact\.exact_rotor_angle) .*0\.0 -> ": (
        "a constant load is the same at any time"
    ),
    r"taylor\.equation_numbers .*(0\.0 -> |if i in changing: never)": "takes a place that the next line fills",
    r"taylor\.(_UNROLLED_BLADES|compiled|is_compact) |adapter\.(_settings .*|)(constraints|_OLD_JACOBIAN_FROM)": (
        "decides how long a run takes, not what comes out"
    ),
    r"claims\._RELATIONS .*value \* other scaled": "its sign alone counts",
    r"checks\._of_reference .*: 0 -> 1": "compared by its length: no shipped reference has a single sample",
    r"checks\._bent_columns .*0 -> 1": "one row is as much too short as none",
    r"checks\._of_samples .*: 1 -> 2": "one zero or two: the largest is zero",
    r"adapter\.linear_solver .*scaled|adapter\._SPARSE_FROM ": "sizes near the bound take as long by either solver",
    r"kinematics\._frames .*:25: s -> c": "zeros of its shape",
    r"exact\._pendulum .*sign in ellipk": "sn is the same on both sides of its quarter period",
    r"reference\._matrices_by_quotients .*sign of start\[i\]": "all columns change their sign, their norms do not",
    r"adapter\.linearized .*0 -> 1": "a column of zeros among the joints' directions hinders no motion",
    r"metrics\.energy_scale .*(if run\.|and, or in|0\.0 -> )": "nobody asks for the scale of a run without energies",
}
# Then what is not the original and is not seen all the same.
UNSEEN = {
    r"sensor_samples\.work .*(1e-09 \* scene\.duration|scene\.samples - 1|slack scaled)": (
        "a tolerance in matching times: any between round-off and the distance of two rows does as well"
    ),
    r"time_table\.values_before .*1e-12 scaled": "keeps rounding from passing a jump: any size near it does",
    r"time_table\.steps_and_rows .*(1e-09|span / step)": "a step more in an interval does as well",
    r"ode_solvers\.ode45_integrator .*end - start|adapter\.integrate .*(0\.1 / |1\.0 - )": (
        "keeps rounding from putting a sample past the end of its interval, in runs of thousands of intervals"
    ),
    r"ode45\._after_success .*0\.2 -> ": "where steps begin to grow fivefold at most, they grow as much by either rule",
    r"adapter\.integrate .*interval\.end - interval\.start( lost| scaled|$)": (
        "the engine cuts a first step that is longer than its interval, with another rounding"
    ),
    r"adapter\.linearized .*1\.0 -> ": "the size of a difference quotient's step: any near it does as well",
    r"reference\._(LOOSER|TIGHTEST|QUAD|PERTURBATION) ": "a tolerance half as large again bounds and resolves as much",
    r"checks\.steps_off .*1e-09 scaled": "keeps rounding from adding a step: any size near it does",
    r"solvers\._scheme .*scheme\.step scaled": "the largest number of steps: any near it does",
    r"schemes\.trial_steps .*-> 2": "the least of a range: one trial step ends as soon as two",
    r"schemes\.scheme .*(1e-14|5\.0) -> ": "the smallest step, and how fast steps grow: no motion here comes near",
    r"adapter\.integrate .*(rejected|newtonSteps).* scaled": "evaluations of rejected steps are reported, not judged",
    r"adapter\.integrate .*1 -> 2": "a scheme that chooses its own steps makes the first one of the interval anyway",
    r"adapter\.integrate .*(step is None|every_step)": "rows at every step or at every sample carry the work as well",
    r"(ode_solvers|taylor)\..*deadline\.is_over": "the time limit of a run, which a run within it does not show",
}
EXPLAINED = {**EQUIVALENT, **UNSEEN}


def _run(*arguments: str) -> list[dict[str, str]]:
    script = Path(__file__).parents[1] / "support" / "mutation.py"
    done = subprocess.run([sys.executable, script, *arguments], capture_output=True, text=True, timeout=6 * 3600)
    assert done.returncode == 0, done.stderr
    print(done.stderr)
    rows = [line for line in done.stdout.splitlines() if line.startswith("{")]  # Exudyn greets on standard output
    return [json.loads(row) for row in rows]


def _unexplained(rows: list[dict[str, str]]) -> list[str]:
    survivors = [row["mutant"] for row in rows if row["noticed"] == "survived"]
    return [name for name in survivors if not any(re.search(pattern, name) for pattern in EXPLAINED)]


@pytest.mark.full
def test_a_sample_of_mutants_is_noticed() -> None:
    """Of the groups whose checks take a second; the others take part in the whole run."""
    rows = _run("lagrange", "printed", "multibody", "chain", "mujoco", "rules", "ode45", "--every", "180")
    assert len(rows) >= 14
    assert _unexplained(rows) == []


@pytest.mark.nightly
def test_every_mutant_is_noticed_or_explained() -> None:
    """Of every eighth, in the order of targets and sources, so that each has its share; MUTANTS_EVERY=1 tries all."""
    every = int(os.environ.get("MUTANTS_EVERY", "8"))
    rows = _run("--every", str(every), "--jobs", "1")
    survivors = [row["mutant"] for row in rows if row["noticed"] == "survived"]
    print(f"{len(survivors) - len(_unexplained(rows))} explained, {len(_unexplained(rows))} unexplained")
    assert len(rows) > 3500 / every
    assert _unexplained(rows) == []
    if every == 1:
        idle = [pattern for pattern in EXPLAINED if not any(re.search(pattern, name) for name in survivors)]
        assert idle == []  # an explanation that explains nothing hides something


# The scene's own numbers: a method that takes one of them a little wrong, held to the scene as it is


def _numbers(value: Any, where: str = "") -> Iterator[tuple[str, Any]]:
    """Every number of a (nested) tuple that is not zero, by its place, with the tuple in which it alone is changed."""
    if isinstance(value, tuple):
        for i, item in enumerate(value):
            for place, make in _numbers(item, f"{where}[{i}]"):
                yield place, lambda share, i=i, make=make: (*value[:i], make(share), *value[i + 1 :])
    elif value:
        yield where, lambda share: value * (1.0 + share)


_SCENE_NUMBERS = (
    "gravity", "hub_inertia", "initial_angles", "initial_rates", "rotor_torque", "bearing_stiffness",
    "bearing_damping", "shaft_damping", "pitch_torque", "bearing_rest",
)  # fmt: skip


def _is_in_order(table: Table) -> bool:
    times = [time for time, _ in table]
    return times == sorted(times)


def wrong_scenes(scene: Scene, share: float) -> Iterator[tuple[str, Scene]]:
    """Every number that a model reads off the scene, one at a time off by `share` of its size."""
    for name in _SCENE_NUMBERS:
        for place, make in _numbers(getattr(scene, name)):
            changed = make(share)
            if name in ("pitch_torque", "bearing_rest") and not all(map(_is_in_order, changed)):
                changed = make(-share)  # the first row of a jump: past the second one it would be refused
            yield f"{name}{place}", replace(scene, **{name: changed})
    for i, blade in enumerate(scene.blades):
        for name in ("mass", "centre_of_mass", "inertia", "tip"):
            for place, make in _numbers(getattr(blade, name)):
                wrong = replace(blade, **{name: make(share)})
                blades = (*scene.blades[:i], wrong, *scene.blades[i + 1 :])
                yield f"blade {i + 1} {name}{place}", replace(scene, blades=blades)


# A scene, what the names of its numbers begin with and how many these are, a method, the share, and each how many-th.
_GENERAL, _PITCH_LOADS = ("check/general", "", 63), ("check/pitch-loads", ("pitch_torque", "bearing_rest"), 20)


@pytest.mark.parametrize(
    ("scene", "names", "count", "method", "share", "every"),
    [
        (*_GENERAL, "lagrange/dop853", 1e-6, 31),
        pytest.param(*_GENERAL, "lagrange/dop853", 1e-6, 1, marks=pytest.mark.full),
        pytest.param(*_GENERAL, "exudyn_tree/rk67", 1e-6, 1, marks=pytest.mark.full),
        pytest.param(*_GENERAL, "mujoco/rk4", 1e-3, 1, marks=pytest.mark.nightly),
        # Of second order: a product of inertia of 25 beside 4000 kg m² shows from 3 % on.
        pytest.param(*_GENERAL, "exudyn_chain/generalized_alpha", 5e-2, 1, marks=pytest.mark.nightly),
        (*_PITCH_LOADS, "lagrange/dop853", 1e-4, 10),  # times of jumps and kinks, too
        pytest.param(*_PITCH_LOADS, "lagrange/dop853", 1e-4, 1, marks=pytest.mark.full),
        pytest.param(*_PITCH_LOADS, "exudyn_tree/rk67", 1e-4, 1, marks=pytest.mark.full),
    ],
)
def test_every_number_of_a_scene_counts(
    scene: str, names: str | tuple[str, ...], count: int, method: str, share: float, every: int, tmp_path: Path
) -> None:
    if method.startswith("mujoco"):
        pytest.importorskip("mujoco")
    right = shipped(scene)
    path = results_file(tmp_path / "numbers.h5", [scene], [])
    wrong = [(name, changed) for name, changed in wrong_scenes(right, share) if name.startswith(names)]
    survivors = []
    for name, changed in wrong[::every]:
        add_run(path, right, solve(method, changed, {}))
        if not failed(judged(path)):
            survivors.append(name)
    assert len(wrong) == count
    assert survivors == []
