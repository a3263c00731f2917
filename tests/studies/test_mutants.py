"""No change to a term, a parameter or a rule goes unnoticed: the mutation run, and what it cannot
notice and why.

The scene's own numbers are perturbed here; the sources in `mutation.py`, which can be run by
itself; the bounds in `test_check.py`.
"""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.checking import add_run, failed, judged, results_file
from support.mutation import TARGETS, all_mutants, parsed, scopes
from support.scenes import shipped

from rotor_mbs.errors import InputError
from rotor_mbs.methods.solve import solve
from rotor_mbs.scenario.scene import Scene, parse_scene, scene_toml

# Mutants that neither a check nor a test can tell from the original, by name, and why.
EXPLAINED = {
    # The original in other words: the change is to a zero, a whole number or a whole turn, or is
    # not read by anything.
    r"closed_form\.energies .*0\.0 \* sin_q": "a zero of the right kind of number",
    r"geometry\._turn .*2 \* rest scaled": "compares whole numbers",
    r"(geometry\.hub_body|mjcf\.model) .*0\.5 \* scene\.hub_inertia scaled": "the hub turns about y alone",
    r"kinematics\._frames .*left side of zero \+ 1\.0 scaled": "a zero",
    r"checks\._changed_metric .*0\.0 -> 500\.0": (
        "without the excess of an interval no allowed defect is there to be compared"
    ),
    r"geometry\._joined .*r @ r \* np\.eye": (
        "a fixed blade's centre of mass is on its own z: the product is zero"
    ),
    r"sensor_samples\.work .*last - first scaled": "rows counted",
    r"sensor_samples\._dot ": (
        "of a pitch's sine and cosine both shrink alike, and the angle is that of their quotient"
    ),
    r"sensor_samples\.unwrap .*scaled": (
        "rounded to whole turns: 1 % of the way between two rows is no half turn"
    ),
    r"time_table\.intervals .*(end - start|samples - 1) scaled": (
        "rounded to a whole number of intervals"
    ),
    r"mjcf\.model .*0\.0 -> 1\.0": "the centre of mass of a hub that has no mass",
    r"literal\.fixed_pitch_acceleration .*q2 \+ phase": (
        "the cosine multiplies c, which is 0 where this is used"
    ),
    r"derivation\.a3 .*-> (0\.001|1\.000001)$": (
        "the last row of a transformation matrix: nothing reads it"
    ),
    r"derivation\.blade_terms .*trace\(by_23, m, by_3\) \+ trace\(by_32, m, by_3\)": "U33,2 and U33 are perpendicular",
    r"derivation\.forces .*left side of terms\.h_2_22": (
        "U32,2 and U32 of a point mass are perpendicular"
    ),
    r"observables\.tip_path .*sign of -1 lost": (
        "the last axis of three one-dimensional arrays is their axis 1"
    ),
    r"samples\._energies .*2 \* len\(columns\) scaled": "a count beside a count",
    r"tree\._tree .*0\.0 -> ": "the offset of a spring of no stiffness: the rotor's",
    r"ode_solvers\.right_hand_side .*isinstance\(state": (
        "plain floats or the array's own: the same numbers"
    ),
    r"ode_solvers\.__init__ .*0\.0 -> ": "the work of constant torques is known from the angles",
    (
        r"(samples\.loads_at(_start)?|kinematics\.(work_of_constant_loads|exact_rotor_angle)) "
        r".*0\.0 -> "
    ): "a constant load is the same at any time",
    r"taylor\.items .*turned round": (
        "seen in test_independence.py, whose processes have no mutants"
    ),
    r"taylor\.equation_numbers .*0\.0 -> ": "takes a place that the next line fills",
    (
        r"taylor\.(_UNROLLED_BLADES|compiled|is_compact) |adapter\.(_settings "
        r".*|)(constraints|_OLD_JACOBIAN_FROM)"
    ): "decides how long a run takes, not what comes out",
    r"checks\._of_reference .* 0 -> 1": (
        "compared by its length: no shipped reference has a single sample"
    ),
    r"checks\._of_run .*(judgement\.status != run\.status\) \+|'; '\.join)": (
        "more faults than none; a text"
    ),
    r"run_checks\._checks_of_energies .* 1 -> 2": "one zero or two: the largest is zero",
    r"adapter\.linear_solver .*scaled|adapter\._SPARSE_FROM ": (
        "sizes near the bound take as long by either solver"
    ),
    r"adapter\._is_caused_by_limit .*error\.__cause__": "an exception raised in a handler has both",
    r"adapter\.linearized .*0 -> 1": (
        "a column of zeros among the joints' directions hinders no motion"
    ),
    r"metrics\.energy_drifts .* 1 -> 2$": (
        "time and angles of a motion without energies, which are not read"
    ),
    r"defects\.over_rows .*sign of -self\._vectors": "of the sums the magnitude is taken",
    r"defects\.over_rows .* 1 -> 2$": (
        "stretches at once: two, where a block has room for one at most"
    ),
    r"defects\.horizon_samples .*left side of 1 \+ block\.start": "the fraction of 1.5 is cut off",
    r"checks\._own_extremes .*:20 2 -> 3$": "samples of a part that are not read",
    r"run_checks\._checks_of_quantities .*and, or in scene\.wants": (
        "what rounding may cause is not read without loads, and not without those of the closed "
        "form, which come with the defects"
    ),
    r"run_checks\.defect_allowed .*:85 0\.0 -> ": "an interval has both numbers or neither",
    # Not the original, and not seen all the same: tolerances, first steps and counts that are not
    # judged.
    r"sensor_samples\.work .*(1e-09 \* scene\.duration|scene\.samples - 1|slack scaled)": (
        "a tolerance in matching times: any between round-off and the distance of two rows does as "
        "well"
    ),
    r"time_table\.values_before .*1e-12 scaled": (
        "keeps rounding from passing a jump: any size near it does"
    ),
    (
        r"defects\.(_SMALLEST_FLOOR |_with_small_numbers .*right side of floors \+ np\.square"
        r"\(floors\.max\(axis=1, keepdims=True, initial scaled$)"
    ): "keeps a floor from being zero: any size far below round-off of a radian does",
    r"lagrange\.defects\._(MAX_STEPS_\w+|FEWEST_STEPS|EVALUATIONS_PER_STEP|MAX_RUNGE_KUTTA_STEPS) ": (
        "a limit of steps that no motion of a rotor comes near, or where either way is as good"
    ),
    r"lagrange\.defects\._(DOP853|RADIANS_PER_STEP|ROUGH_END) ": (
        "half as much again is within the accuracy that is asked of the matrices, or of a defect"
    ),
    r"lagrange\.defects\._(FIT_ROUNDS|STANDS_STILL|NEAR) |fitted_rates .*(step \* np\.abs|usual <= _STANDS)": (
        "where the rounds of a fit end: half as much again, or a round more, does as well"
    ),
    r"lagrange\.defects\._(SIDE|SMALLEST_SHARE|DIFFERENCE|SMALL_DIFFERENCE|SMALL_AT_END) ": (
        "the size of a difference or of a share near zero: half as much again does as well"
    ),
    r"fitted_rates .*before == np\.inf turned": (
        "rows that are too far apart are so in every round, and near ones are near in every round"
    ),
    r"quick_ends .*right side of (begins \+|ends -) _SIDE": "how near to a jump it is inside of it",
    r"fitted_rates .*1\.0 / step scaled": "a unit of the rates, of which a fit is independent",
    r"fitted_rates .*and, or in np\.isfinite": (
        "both hold the same matrices: where one is not finite, neither is the other"
    ),
    r"interval_ends .*right side of (place|part) \+ 1": "whole numbers are compared",
    r"interval_ends .*(0 -> 1$|steps \+ taken|reached < end|steps >= _FEW|max\(max_steps)": (
        "bounds the work on rows that are no motion, which are NaN in any case"
    ),
    r"_advance_by_taylor .*(len\(state\) > count turned|if has_work|0\.0 -> )": (
        "the work is no part of a defect, wherever it begins"
    ),
    r"_advance_by_dop853 .*(0 -> 1|or 0$)": "SciPy counts its evaluations: there is no other case",
    r"lagrange\.defects\._transitions .*(0 -> 1$|time\[rows|if len\(rows\)|quick - .*(scaled|turned round)$|units scaled$)": (
        "more explicit steps, or difference quotients in place of them, are as accurate; these are "
        "taken unless every coordinate is on the side that is asked for"
    ),
    r"_(difference|quick)_transitions .*(differences / |away / units|1 \+ count scaled)": (
        "the size that is near enough; of a number of copies the fraction is cut off"
    ),
    r"defects\.KEPT_ROWS ": "decides how much memory a run takes, not what comes out",
    r"judgement\.smallest_rotor_inertia_share .*65 -> 66": (
        "points of a search along the way to the next sample"
    ),
    r"judgement\._CLEAR_SHARE ": (
        "decides how many runs of a sweep are judged one by one, not what they are called: any far "
        "above round-off does"
    ),
    r"run_checks\.(_GROWN |_error_fault .*_GROWN )": "an order of magnitude, for a message",
    r"checks\._MOST_INTERVALS ": (
        "how many peaks are looked at: their number decides how many a run may have"
    ),
    (
        r"schemes\.(scheme|newton_relative_tolerance) .*(_NEWTON_SHARE .* scaled|1e-10 -> |40 -> "
        r"|2\.0 -> )"
    ): "where Newton's method stops, below what is kept, and when it begins anew",
    r"schemes\.scheme .* 0 -> 1$": (
        "extrapolation takes the implicit solver whatever the scheme's stages are"
    ),
    r"adapter\.initial_values .*(time \+ 1\.0|1 -> 2)": (
        "an interval that is not integrated: any does as well"
    ),
    r"time_table\.steps_and_rows .*(1e-09|span / step|span / _ROW_STEP)": (
        "a step or a row more in an interval does as well"
    ),
    r"ode_solvers\.ode45_integrator .*end - start|adapter\.integrate .*(0\.1 / |1\.0 - )": (
        "keeps rounding from putting a sample past the end of its interval, in runs of thousands "
        "of intervals"
    ),
    r"ode_solvers\.(MAX_STEP_EVALUATIONS|_OUTLOOK_STEPS) .*000 -> \d+1$": (
        "a limit that one more or one less does not miss"
    ),
    r"taylor\.__init__ .*keep is not None turned": (
        "parts of a segment follow each other without a gap, and decide memory alone"
    ),
    r"reference\.error_growth .*times is None turned": (
        "without heyoka alone, where `.ci/without-heyoka` runs the tests"
    ),
    r"reference\.__init__ .*1 -> 2": "what stands there before the first run is not read",
    r"ode45\.first_step .*h_max \* rate_of_change scaled": (
        "where it decides, either step is the same"
    ),
    r"ode45\._after_success .*0\.2 -> ": (
        "where steps begin to grow fivefold at most, they grow as much by either rule"
    ),
    r"adapter\.integrate .*interval\.end - interval\.start scaled": (
        "the engine cuts a first step that is longer than its interval, with another rounding"
    ),
    r"adapter\.(linearized|initial_values) .*(1\.0 -> |0\.01 \* 0\.5|3 -> 4)": (
        "the size of a difference quotient's step, and how many are extrapolated: any near it does "
        "as well"
    ),
    r"solvers\.(__init__|integrate) .*0 -> 1": (
        "parts of the first interval; how small the smallest may be"
    ),
    r"schemes\.trial_steps .*-> 2": "the least of a range: one trial step ends as soon as two",
    r"schemes\.scheme .*(1e-14|5\.0) -> ": (
        "the smallest step, and how fast steps grow: no motion here comes near"
    ),
    r"adapter\._solve .*(rejected|newtonSteps).* scaled": (
        "evaluations of rejected steps are not judged"
    ),
    r"adapter\.integrate .*1 -> 2": (
        "a scheme that chooses its own steps makes the first one of the interval anyway"
    ),
    r"adapter\.integrate .*(step is None|every_step)": (
        "rows at every step or at every sample carry the work as well"
    ),
    r"ode_solvers\.scipy_integrator .*:36 0 -> 1": "the evaluations of a solver that cannot begin",
    r"taylor\._advance .*time_limit\.is_over": (
        "the time limit of a run, which a run within it does not show"
    ),
}


def survivors(*arguments: object) -> tuple[int, list[str]]:
    """How many mutants were tried, and the names of those that nothing noticed."""
    script = Path(__file__).parents[1] / "support" / "mutation.py"
    command = [sys.executable, script, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=6 * 3600)
    assert done.returncode == 0, done.stderr
    # Exudyn greets there, too
    lines = [line for line in done.stdout.splitlines() if line.startswith("rotor_mbs.")]
    return len(lines), [
        line.removesuffix(": survived") for line in lines if line.endswith(": survived")
    ]


def unexplained(names: list[str]) -> list[str]:
    return [name for name in names if not any(re.search(pattern, name) for pattern in EXPLAINED)]


def test_what_is_changed_and_explained_is_in_the_source() -> None:
    """A function that was renamed or moved would have no mutants, and nobody would notice."""
    pytest.importorskip("mujoco")  # without it, its models have none
    for target in TARGETS:
        present = {name for name, _ in scopes(parsed(target.module))}
        assert target.names == "*" or {*target.names.split()} <= present, target.module
    names = [mutant.name for mutant in all_mutants()]
    assert len({*names}) == len(names)
    assert [
        pattern for pattern in EXPLAINED if not any(re.search(pattern, name) for name in names)
    ] == []


@pytest.mark.full
def test_a_sample_of_mutants_is_noticed() -> None:
    """Of modules whose checks take a second; the others take part in the whole run."""
    modules = r"^rotor_mbs\S*(closed_form|parameters|printed|chain|judgement)"
    tried, unnoticed = survivors(modules, "--every", 80)
    assert tried >= 8
    assert unexplained(unnoticed) == []


@pytest.mark.nightly
def test_every_mutant_is_noticed_or_explained() -> None:
    """Of every eighth, in the order of targets and sources, so that each has its share;
    MUTANTS_EVERY=1 tries all."""
    every = int(os.environ.get("MUTANTS_EVERY", "8"))
    tried, unnoticed = survivors("--every", every, "--jobs", 1)
    print(
        f"{tried} mutants, {len(unnoticed)} unnoticed, {len(unexplained(unnoticed))} of them "
        "unexplained"
    )
    assert tried > 1900 / every
    assert unexplained(unnoticed) == []
    if every == 1:
        idle = [
            pattern
            for pattern in EXPLAINED
            if not any(re.search(pattern, name) for name in unnoticed)
        ]
        assert idle == []  # an explanation that explains nothing hides something


# The scene's own numbers: a method that takes one of them a little wrong, compared with the scene
# as it is


# By scene: the keys of the numbers that a model reads, and how many numbers these are.
_GENERAL = (
    "check/general",
    (
        "gravity",
        "mass",
        "centre_of_mass",
        "inertia",
        "tip",
        "angles",
        "rates",
        "rotor",
        "stiffness",
        "damping",
    ),
    63,
)
_PITCH_LOADS = ("check/pitch-loads", ("pitch", "rest"), 20)


def wrong_scenes(scene: Scene, keys: tuple[str, ...], share: float) -> Iterator[tuple[str, Scene]]:
    """Yield the scene with each number of its keys that is not zero off by `share` of its size, one
    at a time."""
    text = scene_toml(scene)
    for found in re.finditer(r"-?[\d.]+(e[+-]\d+)?", text):
        line = text[text.rfind("\n", 0, found.start()) + 1 :].partition("\n")[0]
        if line.startswith(keys) and float(found[0]):
            # the time of a jump's first row may not pass that of its second
            for factor in (1.0 + share, 1.0 - share):
                other = text[: found.start()] + repr(float(found[0]) * factor) + text[found.end() :]
                with contextlib.suppress(InputError):
                    yield f"{found[0]} of {line}", parse_scene(other, scene.name)
                    break


@pytest.mark.full
@pytest.mark.parametrize(
    ("scene", "keys", "count", "method", "share"),
    [
        (*_GENERAL, "exudyn_tree/rk67", 1e-6),
        pytest.param(*_GENERAL, "lagrange/dop853", 1e-6, marks=pytest.mark.nightly),
        pytest.param(*_GENERAL, "mujoco/rk4", 1e-3, marks=pytest.mark.nightly),
        # Of second order: a product of inertia of 25 beside 4000 kg m² shows from 3 % on.
        pytest.param(*_GENERAL, "exudyn_chain/generalized_alpha", 5e-2, marks=pytest.mark.nightly),
        (*_PITCH_LOADS, "lagrange/dop853", 1e-4),  # times of jumps and kinks, too
        pytest.param(*_PITCH_LOADS, "exudyn_tree/rk67", 1e-4, marks=pytest.mark.nightly),
    ],
)
def test_every_number_of_a_scene_counts(
    scene: str, keys: tuple[str, ...], count: int, method: str, share: float, tmp_path: Path
) -> None:
    if method.startswith("mujoco"):
        pytest.importorskip("mujoco")
    right = shipped(scene)
    path = results_file(tmp_path / "numbers.h5", [scene], [])
    wrong, unnoticed = list(wrong_scenes(right, keys, share)), []
    for name, other in wrong:
        add_run(path, right, solve(method, other, {}))
        if not failed(judged(path)):
            unnoticed.append(name)
    assert len(wrong) == count
    assert unnoticed == []
