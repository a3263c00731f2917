"""The mutation run: one change to the source at a time, and `rotor-mbs check` or a test must
notice.

    python tests/support/mutation.py [PATTERN] [--every N] [--jobs N] [--log FILE]

Each mutant has a process of its own, forked from one that has loaded the engines. There the package
is imported with the changed module, a few scenes are run and judged as `check` does it, and where
no check fails, the tests that belong to the module are run: what noticed the last mutants of the
function first, then those that take least. A mutant that raises or does not end is noticed, too:
`check` fails for a run that failed.
"""

from __future__ import annotations

import argparse
import ast
import copy
import importlib
import importlib.util
import inspect
import io
import json
import math
import os
import re
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stderr, redirect_stdout, suppress
from functools import partial
from importlib.machinery import SourceFileLoader
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, NamedTuple

import pytest
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).parents[2]
# The processor time of a run or a test: five times what the longest takes without any change. A
# process that waits uses none.
LIMIT_S = 20.0
LIMIT_OF_WAITING_S = 3600.0
PYTEST = ("-p", "no:cacheprovider")
# A test that is named runs whatever its mark, but for those that take minutes; of a file that is
# named the default tests run.
NAMED = ("-m", "not nightly and not browser")
# Loaded once, for all forks.
PACKAGES = (
    "exudyn",
    "mujoco",
    "heyoka",
    "scipy.integrate",
    "scipy.special",
    "h5py",
    "asyncio",
    "filelock",
    "unittest.mock",
)


class Target(NamedTuple):
    """Functions and constants of a module in which every term is perturbed.

    names   with blanks between; "*": all of them
    kind    of the runs that are judged, a key of RUNS
    tests   run where no check fails
    share   by how much a number is changed; 0.5 and ode45's: conditions and whole numbers are
    changed, too
    """

    module: str
    names: str
    kind: str
    tests: tuple[str, ...]
    share: float = 1e-6

    @property
    def is_program(self) -> bool:
        return self.share == 0.5 or self.kind == "ode45"


_CHECKED = "check/held check/general check/pitch-loads"
# Scenes and a method, one line after the other until a check fails.
RUNS: dict[str, list[tuple[str, str]]] = {
    "tests alone": [],
    "lagrange": [(_CHECKED, "lagrange/dop853")],
    "printed": [
        ("check/point-masses paper/fig04b", "printed/ode45"),
        ("paper/fig05 paper/fig11", "printed/ode45"),
    ],
    "tree": [(_CHECKED, "exudyn_tree/rk67"), ("check/held", "exudyn_chain/generalized_alpha")],
    "chain": [(_CHECKED, "exudyn_chain/generalized_alpha")],
    "mujoco": [(_CHECKED, "mujoco/rk4")],
    "ode45": [("check/held check/general", "lagrange/ode45"), ("paper/fig05", "printed/ode45")],
    "schemes": [
        ("check/loads", "exudyn_tree/rk67"),
        ("check/held", "exudyn_tree/rk44"),
        ("check/held", "exudyn_tree/dopri5"),
        ("check/held", "exudyn_tree/generalized_alpha"),
        ("check/held", "exudyn_chain/generalized_alpha"),
        ("check/held", "exudyn_chain/newmark_index2"),
        ("check/held", "exudyn_chain/extrapolated"),
        ("check/held", "lagrange/dop853"),
    ],
    "adapter": [
        ("check/held check/loads", "exudyn_tree/rk67"),
        ("check/pitch-loads", "exudyn_tree/dopri5"),
        ("check/held check/loads", "exudyn_chain/generalized_alpha"),
    ],
    "integration": [
        (_CHECKED, "lagrange/taylor"),
        (_CHECKED, "lagrange/dop853"),
        (_CHECKED, "lagrange/ode45"),
    ],
}

_M, _L, _P = "rotor_mbs.models.exudyn", "rotor_mbs.models.lagrange", "rotor_mbs.models.printed"
_J, _A = "rotor_mbs.models.mujoco", "rotor_mbs.analysis"
_PARTS = ("models/test_exudyn_parts.py",)
_ALL_LOADS = (
    "models/test_exact_solutions.py::test_every_load_at_once_follows_the_equations_written_anew"
)
_EXACT = "models/test_exact_solutions.py::test_every_model_has_the_exact_motion"
_CONSTANT = "constant torques and angle of rest"
_PRINTED = ("models/test_printed.py", "analysis/test_errata.py")
_DEFAULTS = "analysis/test_run_integrity.py"
_SENSORS = (
    *_PARTS,
    f"{_EXACT}[exudyn_tree/rk44-{_CONSTANT}]",
    "models/test_exact_solutions.py::test_a_thousand_radians_a_second_are_counted_turn_by_turn",
)
_EXTRAPOLATION = ("models/test_extrapolation.py",)
_MUJOCO = "models/test_mujoco.py::test_"
_JUDGEMENT = "solution/test_judgement.py::test_"
_RULES = (
    "analysis/test_status_rules.py",
    f"{_JUDGEMENT}an_inaccurate_run_says_by_how_much",
    f"{_JUDGEMENT}a_run_that_broke_off_names_time_and_reason",
    f"{_JUDGEMENT}a_wrong_motion_is_unchecked_where_nothing_can_tell",
    f"{_JUDGEMENT}a_start_turns_away_leaves_ten_units_in_its_last_place_open",
)
_DEFECTS = ("models/test_defects.py",)
_JUDGED_RIGHT = ("analysis/test_judged_right.py",)
_SWEEP = ("models/test_sweep_ensemble.py",)
_CHECK = "studies/test_check.py::test_"
_LEANING = "models/test_tilt_cone.py::test_"
_LEANING_MOTION = (
    f"{_LEANING}a_motion_has_the_angles_energies_tips_and_loads_of_newtons_and_eulers_laws"
)
_CLOSED_FORM = (
    *_PRINTED,
    f"{_LEANING}the_closed_form_obeys_newtons_and_eulers_laws",
    f"{_LEANING}blades_without_pitch_inertia_lean_with_the_hub[lagrange/dop853]",
)
_TIME_TABLE = ("scenario/test_time_table.py",)
_SAMPLES = (
    "models/test_segments.py",
    f"{_ALL_LOADS}[lagrange/dop853]",
    f"{_EXACT}[lagrange/dop853-{_CONSTANT}]",
)
_TARGETS = (
    Target(
        f"{_L}.closed_form",
        "accelerations power rest_energy energies point_path",
        "lagrange",
        _CLOSED_FORM,
    ),
    Target(
        f"{_L}.parameters",
        "rotor_form _form _inertia_about_hub _rotor_inertia _coefficients _lean_coefficients "
        "leans _lean "
        "_cosine_of_turn "
        "_cosine_and_sine _power_series",
        "lagrange",
        _CLOSED_FORM,
    ),
    # What all but the printed equations share.
    Target(
        "rotor_mbs.scenario.time_table",
        (
            "value_at values_at constant_value kink_times torque_place rest_place values at "
            "segments values_before"
        ),
        "lagrange",
        _TIME_TABLE,
    ),
    Target(
        "rotor_mbs.scenario.scene",
        "inertia_about_apex",
        "tests alone",
        ("scenario/test_scene_files.py",),
    ),
    Target("rotor_mbs.scenario.time_table", "intervals steps_and_rows", "tree", _TIME_TABLE),
    Target(f"{_L}.samples", "trajectory _energies constant_work", "lagrange", _SAMPLES),
    Target(
        f"{_P}.literal",
        "*",
        "printed",
        (
            *_PRINTED,
            "models/test_printed_method.py::test_one_blade_is_a_pendulum_that_does_not_pitch",
            "models/test_printed_method.py::test_without_c_a_torque_turns_the_rotor_about_its_shaft",
        ),
    ),
    Target(f"{_P}.derivation", "*", "printed", _PRINTED),
    Target(f"{_P}.observables", "tip_path kinetic_energy potential_energy _sines", "printed", ()),
    Target(
        f"{_M}.geometry",
        "rotation_x rotation_y rotation_z mounting shaft_axis _turn blade_body hub_body "
        "fixed_blade_rotation "
        "body_of_point",
        "tree",
        (*_PARTS, f"{_LEANING_MOTION}[exudyn_tree/rk67]"),
    ),
    # About the common centre of mass, which a change moves to second order alone.
    Target(f"{_M}.geometry", "_joined", "tree", _PARTS, 0.001),
    Target(f"{_M}.tree", "_tree", "tree", _PARTS),
    Target(f"{_M}.sensor_samples", "springs work cumulative_integral _fields", "tree", _SENSORS),
    Target(f"{_M}.loads", "at prescribed_moments moment_on", "tree", ()),
    Target(
        f"{_M}.geometry",
        "quaternion _quaternion_product quaternion_rate",
        "chain",
        (*_PARTS, f"{_LEANING_MOTION}[exudyn_chain/extrapolated]"),
        0.01,
    ),
    Target(
        f"{_M}.chain",
        (
            "placed_bodies _rotor_rotation _body _marker _on_body _torque_on_shaft _pitch_spring "
            "_spring_torque"
        ),
        "chain",
        (
            *_PARTS,
            f"{_LEANING_MOTION}[exudyn_chain/extrapolated]",
            (
                f"{_EXACT}[exudyn_chain/generalized_alpha-a growing torque and a constant "
                "angle of rest]"
            ),
        ),
        0.01,
    ),
    Target(
        f"{_M}.sensor_samples",
        "_joint_motion _dot unwrap",
        "chain",
        (*_SENSORS, f"{_LEANING_MOTION}[exudyn_chain/extrapolated]"),
        0.01,
    ),
    # Of fourth order: this model is bound to 1e-8.
    Target(
        f"{_J}.mjcf",
        "loads_of model _blade _joint _inertial _possible",
        "mujoco",
        (
            f"{_MUJOCO}point_masses_have_no_inertia_that_the_scene_does_not_give",
            f"{_MUJOCO}an_inertia_at_the_limit_of_the_triangle_inequality",
            f"{_ALL_LOADS}[mujoco/rk4]",
            f"{_LEANING_MOTION}[mujoco/rk4]",
            f"{_LEANING}blades_without_pitch_inertia_lean_with_the_hub[mujoco/rk4]",
        ),
        0.001,
    ),
    Target(
        f"{_J}.solver",
        "_advance observe _work _springs",
        "mujoco",
        (
            f"{_MUJOCO}steps_and_evaluations_are_counted",
            f"{_MUJOCO}the_work_of_loads_and_dampers_is_of_fourth_order",
            f"{_ALL_LOADS}[mujoco/rk4]",
        ),
        0.001,
    ),
    Target(
        f"{_A}.judgement",
        "judge clearly_ok _is_close largest_angle_error _status _too_far_apart "
        "smallest_rotor_inertia_share _initial_inertia_shares "
        "_RESEMBLES _RESEMBLING_ANGLE _CLEAR_SHARE",
        "tests alone",
        (*_RULES, *_SWEEP),
        0.5,
    ),
    Target(
        f"{_A}.run_checks",
        "*",
        "tests alone",
        (
            *_RULES,
            "solution/test_metrics.py::test_a_load_that_is_off_is_inaccurate",
            "analysis/test_checks.py",
            f"{_DEFECTS[0]}::test_a_run_that_left_the_symmetry_is_compared_to_the_horizon_of_its_scene",
            *_JUDGED_RIGHT,
        ),
        0.5,
    ),
    Target(f"{_L}.singularity", "*", "tests alone", _RULES, 0.5),
    Target(
        "rotor_mbs.solution.metrics",
        "running_growth horizon_samples angle_error energy_scale metrics_of defect_metrics "
        "_angle_errors largest "
        "energy_drifts HORIZON_GROWTH",
        "tests alone",
        (*_RULES, "solution/test_metrics.py", *_DEFECTS, *_SWEEP),
        0.5,
    ),
    Target(
        "rotor_mbs.solution.defects", "*", "tests alone", (*_DEFECTS, *_RULES, *_JUDGED_RIGHT), 0.5
    ),
    Target(f"{_L}.defects", "*", "tests alone", (*_DEFECTS, *_RULES, *_JUDGED_RIGHT), 0.5),
    # Of a tableau's fractions any may be changed.
    Target("rotor_mbs.models.ode45", "*", "ode45", (_DEFAULTS, "models/test_ode45.py"), 0.001),
    Target(f"{_M}.schemes", "*", "schemes", (_DEFAULTS, *_PARTS, *_EXTRAPOLATION), 0.5),
    Target(
        f"{_M}.solvers",
        "_scheme build_tree build_chain __init__ integrate",
        "schemes",
        (_DEFAULTS, *_PARTS, *_EXTRAPOLATION, f"{_ALL_LOADS}[exudyn_chain/extrapolated]"),
        0.5,
    ),
    Target(
        f"{_L}.methods",
        "tolerance check_tolerance relative_tolerance absolute_tolerance",
        "schemes",
        (_DEFAULTS, "methods/test_settings.py"),
        0.5,
    ),
    Target(
        f"{_M}.adapter",
        "*",
        "adapter",
        (
            *_PARTS,
            *_EXTRAPOLATION,
            "models/test_linearization.py",
            "models/test_loads.py::test_at_a_jump_of_the_torque_stands_the_load_before_it[exudyn_tree/rk67]",
            f"{_EXACT}[exudyn_chain/extrapolated-torsion from 9.7 rad]",
            "models/test_exudyn_models.py::test_large_chains_alone_are_solved_by_a_sparse_factorization",
        ),
        0.5,
    ),
    Target(f"{_L}.ode_solvers", "*", "integration", ("models/test_segments.py",), 0.5),
    Target(
        f"{_L}.samples",
        "over_segments loads_at loads_at_start at_constant_rests",
        "integration",
        _SAMPLES,
        0.5,
    ),
    Target(
        f"{_L}.taylor",
        "*",
        "integration",
        ("models/test_segments.py", "models/test_lagrange.py", "models/test_sweep_ensemble.py"),
        0.5,
    ),
    # What the causes of a defect leave out of the equations is in test_planted_mistakes.py.
    Target(
        f"{_L}.reference",
        "__init__ integrate observe uncertainty build _in_quad _in_doubles error_growth "
        "_transition_matrices "
        "_variational_matrices _matrices_by_quotients _largest_growth free_variables _in_units "
        "reference_at",
        "tests alone",
        (
            "models/test_reference.py",
            f"{_CHECK}a_reference_computed_now_is_the_frozen_one[check/general]",
            "comparison/test_compare_trajectory.py::test_growth_of_each_channel_is_at_most_that_of_all",
            "comparison/test_compare_trajectory.py"
            "::test_the_reference_at_the_times_of_the_data_is_the_frozen_one",
        ),
        0.5,
    ),
    Target(
        f"{_A}.kinematics",
        "*",
        "tests alone",
        (
            "analysis/test_kinematics.py",
            "analysis/test_exact.py",
            f"{_LEANING}a_blade_on_a_tilted_shaft_is_a_pendulum[-0.25-0.3-lagrange/taylor]",
            "analysis/test_claims.py",
            "analysis/test_checks.py",
            f"{_CHECK}what_is_shipped_passes_in_short",
        ),
    ),
    Target(
        f"{_A}.checks",
        "*",
        "tests alone",
        (
            "analysis/test_checks.py",
            _DEFAULTS,
            f"{_CHECK}what_is_shipped_passes_in_short",
            f"{_CHECK}a_run_that_was_changed_together_with_its_checksum_fails",
            f"{_CHECK}a_changed_byte_is_of_its_run",
            f"{_CHECK}a_false_success_and_an_edited_status_fail",
            f"{_CHECK}a_number_of_the_reference_that_is_edited_is_seen",
            f"{_CHECK}a_reference_that_is_altered_or_not_there_fails",
            "analysis/test_checks.py::test_the_growth_of_a_reference_is_that_of_its_samples",
            "analysis/test_checks.py"
            "::test_a_stored_number_may_differ_by_what_rounding_or_other_points_decide",
            "runs/test_integrity.py::test_an_edit_behind_a_right_checksum_is_found",
        ),
        0.5,
    ),
    Target(
        f"{_A}.published",
        "ENERGY_RISE claims rounds_to finding",
        "tests alone",
        ("analysis/test_claims.py",),
        0.5,
    ),
)
# An engine that is not installed has no mutants.
TARGETS = tuple(
    target for target in _TARGETS if target.kind != "mujoco" or importlib.util.find_spec("mujoco")
)


# Making mutants


class Mutant(NamedTuple):
    """The change of this number in the order of a target's source; name:
    "rotor_mbs.models.ode45._step 12:30 ..."."""

    target: Target
    number: int
    name: str

    @property
    def scope(self) -> str:
        return self.name.split()[0].removeprefix(f"{self.target.module}.")


def all_mutants(pattern: str = "") -> list[Mutant]:
    mutants = []
    for target in TARGETS:
        for number, (name, _) in enumerate(changed_modules(target)):
            if re.search(pattern, name):
                mutants.append(Mutant(target, number, name))
    return mutants


def changed_modules(target: Target) -> Iterator[tuple[str, ast.Module]]:
    """Yield each change's name and the module with it; the next one undoes it."""
    tree = parsed(target.module)
    names: set[str] = set()
    for scope, body in scopes(tree):
        if target.names != "*" and scope not in target.names.split():
            continue
        for parent, field, at, node in body:
            for what, changed in _changes(node, parent, target):
                name = (
                    f"{target.module}.{scope} "
                    f"{getattr(node, 'lineno', 0)}:{getattr(node, 'col_offset', 0)} {what}"
                )
                # a sum in a sum begins at one place, and of its text the beginning is told
                while name in names:
                    name += ", inside"
                names.add(name)
                _put(parent, field, at, ast.fix_missing_locations(ast.copy_location(changed, node)))
                yield name, tree
                _put(parent, field, at, node)


def parsed(module: str) -> ast.Module:
    """Return the syntax tree of a module's source."""
    return ast.parse((ROOT / (module.replace(".", "/") + ".py")).read_text())


# a node's parent, the field and index where it stands, the node
Place = tuple[ast.AST, str, "int | None", ast.AST]


def _put(parent: ast.AST, field: str, at: int | None, node: ast.AST) -> None:
    if at is None:
        setattr(parent, field, node)
    else:
        getattr(parent, field)[at] = node


def scopes(tree: ast.Module) -> Iterator[tuple[str, list[Place]]]:
    """Functions, methods, the module's constants and its classes' defaults; of nested functions the
    outer one."""
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    for node in [*tree.body, *(inner for outer in classes for inner in outer.body)]:
        match node:
            case ast.FunctionDef(name=name):
                yield name, list(_places(node))
            case ast.Assign(targets=[ast.Name(id=name)]) | ast.AnnAssign(target=ast.Name(id=name)):
                yield name, list(_places(node))


# neither these nor annotations and indices are terms
_TEXTS = (ast.JoinedStr, ast.Raise, ast.arguments)


def _places(parent: ast.AST) -> Iterator[Place]:
    for field, value in ast.iter_fields(parent):
        if field in ("annotation", "returns", "decorator_list", "slice"):
            continue
        for at, node in enumerate(value) if isinstance(value, list) else [(None, value)]:
            if isinstance(node, ast.AST) and not isinstance(node, _TEXTS):
                yield parent, field, at, node
                yield from _places(node)


_OTHER = {"sin": "cos", "cos": "sin", "min": "max", "max": "min"}
_OPPOSITE = {
    ast.Lt: ast.GtE,
    ast.LtE: ast.Gt,
    ast.Gt: ast.LtE,
    ast.GtE: ast.Lt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
_STATUSES = ("ok", "inaccurate", "diverged", "singular", "solver_failed", "timed_out", "unchecked")


def _changes(node: ast.AST, parent: ast.AST, target: Target) -> Iterator[tuple[str, ast.AST]]:
    """What can be wrong at a node: a name for it, and the node to be put there."""
    text = ast.unparse(node)[:60] if isinstance(node, (ast.expr, ast.AugAssign)) else ""
    match node:
        case ast.BinOp(op=ast.Add() | ast.Sub()):
            for side in ("left", "right"):
                term = getattr(node, side)
                if isinstance(term, (ast.List, ast.ListComp, ast.Tuple, ast.JoinedStr)):
                    return
                if not _is_sum(term):
                    yield (
                        f"{side} side of {text} scaled",
                        _with(node, **{side: _scaled(term, target.share)}),
                    )
        case ast.BinOp(op=ast.Mult() | ast.Div()) if not (_is_sum(parent) or _is_product(parent)):
            yield f"{text} scaled", _scaled(node, target.share)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            yield f"sign of {text} lost", operand
        case ast.AugAssign(op=ast.Add() | ast.Sub()):
            yield f"without {text}", ast.Pass()
        case ast.Call(func=ast.Name(id=name)) if name in _OTHER:
            yield f"{text} as {_OTHER[name]}", _with(node, func=ast.Name(_OTHER[name], ast.Load()))
        case ast.Call(func=ast.Attribute(attr="sin" | "cos" as name)):
            yield f"{text} as {_OTHER[name]}", _with(node, func=_with(node.func, attr=_OTHER[name]))
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            yield from _other_numbers(value, parent, target)
    if target.is_program:
        yield from _other_decisions(node, text)


def _other_numbers(value: float, parent: ast.AST, target: Target) -> Iterator[tuple[str, ast.AST]]:
    """Numbers that are no factor of a product: entries, results, arguments, bounds of a
    comparison."""
    holders: tuple[type, ...] = (
        ast.Tuple,
        ast.List,
        ast.Return,
        ast.Assign,
        ast.AnnAssign,
        ast.IfExp,
        ast.Dict,
    )
    if target.is_program:
        holders += (ast.Call, ast.keyword, ast.Compare)
    if not isinstance(parent, holders) or getattr(parent, "arg", "") == "axis":
        return
    if isinstance(value, float) or target.kind == "printed":
        # of units of order one
        other = value * (1.0 + target.share) if value else 1e3 * target.share
    elif target.is_program:
        other = value + 1
    else:
        return
    yield f"{value} -> {other!r}", ast.Constant(other)


def _other_decisions(node: ast.AST, text: str) -> Iterator[tuple[str, ast.AST]]:
    match node:
        case ast.Compare(ops=[operator]):
            yield f"{text} turned round", _with(node, ops=[_OPPOSITE[type(operator)]()])
        case ast.BoolOp(op=operator):
            yield (
                f"and, or in {text}",
                _with(node, op=ast.Or() if isinstance(operator, ast.And) else ast.And()),
            )
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            yield f"{text} without not", operand
        case ast.If(test=test) | ast.IfExp(test=test) if not isinstance(
            test, (ast.Compare, ast.UnaryOp)
        ):
            yield (
                f"if {ast.unparse(test)[:60]}: turned round",
                _with(node, test=ast.UnaryOp(ast.Not(), test)),
            )
        case ast.Constant(value=str() as status) if status in _STATUSES:
            other = "diverged" if status != "diverged" else "ok"
            yield f"{status} -> {other}", ast.Constant(other)


def _is_sum(node: ast.AST) -> bool:
    return isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub))


def _is_product(node: ast.AST) -> bool:
    return isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Mult, ast.Div))


def _with(node: Any, **fields: Any) -> Any:
    new = copy.copy(node)
    for name, value in fields.items():
        setattr(new, name, value)
    return new


def _scaled(node: ast.expr, share: float) -> ast.expr:
    return ast.BinOp(node, ast.Mult(), ast.Constant(1.0 + share))


# Judging mutants


class _Changed(SourceFileLoader):
    """Finds and loads one module from a changed syntax tree in place of its file."""

    def __init__(self, module: str, tree: ast.Module) -> None:
        super().__init__(module, str(ROOT / (module.replace(".", "/") + ".py")))
        self.tree = tree

    def find_spec(self, name: str, _path: Any = None, _target: Any = None) -> Any:
        if name == self.name:
            return importlib.util.spec_from_file_location(name, self.path, loader=self)
        return None

    def get_code(self, _name: str) -> Any:
        return compile(self.tree, self.path, "exec")


# A run as a scene and a method, or a test's name.
Detector = tuple[str, str] | str


class Answer(NamedTuple):
    """What a process found.

    failure    which check or test failed first, or what was raised; "" where none did
    detector   that check's run or that test
    durations  in s of processor time, of the tests that were run
    """

    failure: str
    detector: Detector | None = None
    durations: dict[str, float] | None = None


def noticed_by(mutant: Mutant, likely: list[Detector], durations: dict[str, float]) -> Answer:
    """Run what belongs to a mutant. For a process of its own."""
    module, _, kind, tests, _ = mutant.target
    _, tree = next(islice(changed_modules(mutant.target), mutant.number, None))
    try:
        # In place, which is quick; and whatever that leaves, by a package that is loaded anew, for
        # the sake of constants and of what was computed when it was loaded.
        if put_in_place(module, mutant.scope, tree):
            answer = first_failure(kind, (), likely)
            if answer.failure:
                return answer
        for name in [*sys.modules]:
            if name.startswith(("rotor_mbs", "support", "conftest", "test_")):
                del sys.modules[name]
        sys.meta_path.insert(0, _Changed(module, tree))  # type: ignore[arg-type]
        return first_failure(kind, tests, likely, durations)
    except BaseException as exc:
        return Answer(f"raised {type(exc).__name__}: {str(exc)[:60]}")


def put_in_place(module: str, scope: str, tree: ast.Module) -> bool:
    """Give a loaded function its changed code.

    Parameters
    ----------
    module, scope : names of the module, and of a function or of methods in it.
    tree : the module with the change.

    Returns
    -------
    bool
        False where there is no such function.
    """
    loaded, found = importlib.import_module(module), False
    codes = [constant for constant in compile(tree, module, "exec").co_consts if _is_code(constant)]
    codes += [constant for code in codes for constant in code.co_consts if _is_code(constant)]
    for code in codes:
        if code.co_name != scope:
            continue
        owner: Any = loaded
        for name in code.co_qualname.split(".")[:-1]:
            owner = getattr(owner, name, None)
        member = inspect.getattr_static(owner, scope, None)
        for wrapped in ("fget", "func", "__func__"):  # of properties and of methods of classes
            member = getattr(member, wrapped, member)
        function = inspect.unwrap(member) if callable(member) else None
        if isinstance(function, FunctionType):
            function.__code__ = code
            found = True
    return found


def _is_code(constant: object) -> bool:
    return isinstance(constant, CodeType)


class _FirstFailure:
    """Orders tests by the processor time they took without any change, limits each, and keeps the
    name of the one that failed."""

    def __init__(self, durations: dict[str, float]) -> None:
        self.name = ""
        self.known = durations
        self.durations: dict[str, float] = {}
        self.began = 0.0

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        items.sort(key=lambda item: self.known.get(item.nodeid, 0.0))

    def pytest_runtest_setup(self) -> None:
        end_after(LIMIT_S)
        self.began = time.process_time()

    def pytest_runtest_logreport(self, report: Any) -> None:
        self.durations[report.nodeid] = time.process_time() - self.began
        self.pytest_collectreport(report)

    def pytest_collectreport(self, report: Any) -> None:
        # a module that cannot be imported is a failure, too
        if report.failed and not self.name:
            self.name = report.nodeid


def first_failure(
    kind: str,
    tests: tuple[str, ...],
    likely: Sequence[Detector] = (),
    durations: dict[str, float] | None = None,
) -> Answer:
    """Run the scenes of a kind and the tests until one fails.

    Parameters
    ----------
    kind, tests : of a `Target`.
    likely : runs and tests that come before the others.
    durations : in s, of each test without any change; cheap ones come first.
    """
    from support.checking import failed, judged, results_file

    runs = [(scene, method) for scenes, method in RUNS[kind] for scene in scenes.split()]
    runs.sort(key=lambda run: run not in likely)
    likely_tests = [test.removeprefix("tests/") for test in likely if isinstance(test, str)]
    first = _FirstFailure(durations or {})
    with (
        redirect_stdout(io.StringIO()),
        redirect_stderr(io.StringIO()),
        tempfile.TemporaryDirectory() as folder,
    ):
        for number, (scene, method) in enumerate(runs):
            end_after(LIMIT_S)
            # What does not end is ended by the limit above: on a busy machine a right run may take
            # its minute.
            path = results_file(Path(folder) / f"{number}.h5", [scene], [method], timeout_s=1e4)
            for check in failed(judged(path)):
                return Answer(f"check {check.name}: {' '.join(check.where)}", (scene, method))
        named = [test for test in tests if "::" in test]
        files = [test for test in tests if "::" not in test]
        for chosen, marks in ((likely_tests, NAMED), (named, NAMED), (files, ())):
            if chosen and pytest.main(["-q", "-x", *PYTEST, *marks, *_paths(chosen)], [first]):
                detector = first.name if "::" in first.name else None
                return Answer(f"test {first.name or 'not found'}", detector)
    return Answer("", None, first.durations)


def end_after(seconds: float) -> None:
    """End this process once it has used so much more processor time."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    limit = math.ceil(used.ru_utime + used.ru_stime + seconds)
    resource.setrlimit(resource.RLIMIT_CPU, (limit, resource.RLIM_INFINITY))


def answer_of_fork(call: Callable[[], Answer]) -> Answer:
    """Return what a call returns in a fork of this process, or that it has not returned within its
    limits."""
    context = get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    fork = context.Process(target=lambda: sender.send(call()))
    fork.start()
    sender.close()
    with receiver, suppress(EOFError):
        try:
            if receiver.poll(LIMIT_OF_WAITING_S):
                answer: Answer = receiver.recv()
                return answer
        finally:
            fork.kill()
            fork.join()
    return Answer("did not end, or took its process with it")


class Trial:
    """Tries mutants, each first by what noticed the last ones of its function and its module."""

    def __init__(self, durations: dict[str, float]) -> None:
        self.durations = durations
        self.recent: dict[str, list[Detector]] = {}

    def __call__(self, mutant: Mutant) -> str:
        places = (mutant.name.split()[0], mutant.target.module)
        likely = [found for place in places for found in self.recent.get(place, [])[:2]]
        likely = list(dict.fromkeys(likely))
        answer = answer_of_fork(partial(noticed_by, mutant, likely, self.durations))
        if answer.detector is not None:
            for place in places:
                others = [found for found in self.recent.get(place, []) if found != answer.detector]
                self.recent[place] = [answer.detector, *others]
        return answer.failure


def load(tests: tuple[str, ...]) -> None:
    """Load the package, the tests and which references are shipped, for all forks."""
    importlib.import_module("support.checking")
    stored_references = importlib.import_module("rotor_mbs.studies.stored_references")
    stored_references.shipped_reference("")
    with redirect_stdout(io.StringIO()):
        pytest.main(["--collect-only", *PYTEST, *NAMED, *_paths(tests)])


def _paths(tests: Sequence[str]) -> list[str]:
    return [str(ROOT / "tests" / test) for test in tests]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("pattern", nargs="?", default="", help="mutants whose name has it")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="each N-th of them alone")
    parser.add_argument(
        "--jobs", type=int, default=2, metavar="N", help=("at a time (default: %(default)s)")
    )
    parser.add_argument(
        "--log",
        type=Path,
        metavar="FILE",
        help=(
            "mutants that it has are not tried again; beside it, as .json, how long tests take "
            "without any change"
        ),
    )
    arguments = parser.parse_args()
    sys.path[:0] = [str(ROOT), str(ROOT / "tests")]
    sys.dont_write_bytecode = False  # or every fork compiles the package and the tests
    os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"  # which take longer than most tests
    os.environ["XDG_CACHE_HOME"] = str(ROOT / ".pytest_cache" / "compiled")  # as in conftest.py
    for package in PACKAGES:
        if importlib.util.find_spec(package.partition(".")[0]):
            importlib.import_module(package)
    # On a busy machine examples pass their deadline, and a mutant would seem to be noticed.
    settings.register_profile("mutants", deadline=None, suppress_health_check=[*HealthCheck])
    settings.load_profile("mutants")
    mutants = all_mutants(arguments.pattern)[:: arguments.every]
    log: Path | None = arguments.log
    if log is not None and log.exists():
        tried = log.read_text()
        mutants = [mutant for mutant in mutants if f"{mutant.name}: " not in tried]
    tests = tuple(dict.fromkeys(test for mutant in mutants for test in mutant.target.tests))
    load(tests)
    with ThreadPoolExecutor(arguments.jobs) as pool:
        known = log.with_suffix(".json") if log is not None else None
        if known is not None and known.exists():
            durations = json.loads(known.read_text())
        else:
            kinds = dict.fromkeys(mutant.target.kind for mutant in mutants)
            durations = durations_without_change(pool, tests, kinds)
            if known is not None:
                known.write_text(json.dumps(durations))
        failures = pool.map(Trial(durations), mutants)
        for mutant, failure in zip(mutants, failures, strict=True):
            line = f"{mutant.name}: {failure or 'survived'}"
            print(line, flush=True)
            if log is not None:
                with log.open("a") as stream:
                    stream.write(line + "\n")


def durations_without_change(
    pool: ThreadPoolExecutor, tests: tuple[str, ...], kinds: Iterable[str]
) -> dict[str, float]:
    """Return the processor time of each test without any change, in s. Ends where one fails."""
    calls = [
        partial(first_failure, "tests alone", tests),
        *(partial(first_failure, kind, ()) for kind in kinds),
    ]
    answers = list(pool.map(answer_of_fork, calls))
    for answer in answers:
        if answer.failure:
            raise SystemExit(f"without any change: {answer.failure}")
    return answers[0].durations or {}


if __name__ == "__main__":
    main()
