"""The mutation run: one change to the source at a time, and `check`'s own verdicts must notice.

    python tests/support/mutation.py [GROUP...] [--only PATTERN] [--every N] [--jobs N]

Each mutant lives in a process of its own, forked from one that has the engines loaded: there the package is imported
anew with one function's text changed, a small set of scenes is computed and judged as `check` does it, and the first
verdict that fails is told. A mutant that raises, or does not end in time, would leave a run that failed: `check` fails
for that, too. What no run that is judged here can show (a turn missed between rows, the place of a quadrature's window)
is put to a unit test of its own; the answer then begins with "test:".
"""

from __future__ import annotations

import argparse
import ast
import atexit
import contextlib
import copy
import functools
import importlib
import importlib.machinery
import importlib.util
import io
import json
import os
import re
import resource
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
_CPU_LIMIT_S, _RUN_LIMIT_S = 25, 120.0  # of a mutant, whatever else the machine does; of each run by the clock
# What is not imported anew for a mutant: what knows neither its module nor anything that does.
_KEPT_ELSE = ("rotor_mbs.errors", "rotor_mbs.scenario", "rotor_mbs.solution")
_KEPT = {
    "rules": _KEPT_ELSE[:2],
    "analysis": (*_KEPT_ELSE, "rotor_mbs.methods", "rotor_mbs.models", "rotor_mbs.execution", "rotor_mbs.store"),
}
# Here whole numbers count, arguments of calls, and conditions; elsewhere the terms of equations.
_PROGRAMS = ("ode45", "schemes", "adapter", "integration", "reference", "analysis")


@dataclass(frozen=True)
class Target:
    """Functions and constants of a module whose every term is perturbed; `share`: by how much a number is changed."""

    group: str
    module: str
    names: tuple[str, ...]  # "*": all of them
    share: float = 1e-6


@dataclass(frozen=True)
class Mutant:
    """One change: "line 12:30: s2 -> c2" of a module's function; `make` gives the module's text with it."""

    group: str
    module: str
    scope: str
    what: str
    make: Callable[[], str]

    @property
    def name(self) -> str:
        return f"{self.module}.{self.scope} {self.what}"


_M, _L, _P = "rotor_mbs.models.exudyn", "rotor_mbs.models.lagrange", "rotor_mbs.models.printed"
_J, _A = "rotor_mbs.models.mujoco", "rotor_mbs.analysis"
_TARGETS = (
    Target(
        "lagrange", f"{_L}.closed_form", ("accelerations", "power", "rest_energy", "energies", "_kinetic", "point_path")
    ),
    Target(
        "lagrange",
        f"{_L}.parameters",
        (
            "rotor_form",
            "_inertia_about_hub",
            "_rotor_inertia",
            "_coefficients",
            "_cosine_of_turn",
        ),
    ),
    # What all but the printed equations share: every group's verdicts see it.
    Target(
        "lagrange",
        "rotor_mbs.scenario.time_table",
        ("value_at", "constant_value", "values", "at", "segments", "_line", "values_before"),
    ),
    Target("multibody", "rotor_mbs.scenario.time_table", ("intervals", "steps_and_rows")),
    Target("lagrange", f"{_L}.samples", ("trajectory", "_put_energies", "constant_work")),
    Target("printed", f"{_P}.literal", ("*",)),
    Target("printed", f"{_P}.matrices", ("*",)),
    Target("printed", f"{_P}.derivation", ("*",)),
    Target("printed", f"{_P}.observables", ("tip_path", "kinetic_energy", "potential_energy", "_sines")),
    Target(
        "multibody",
        f"{_M}.geometry",
        (
            "rotation_y",
            "rotation_z",
            "_turn",
            "_cos_sin",
            "blade_body",
            "hub_body",
            "_turned",
            "fixed_blade_rotation",
        ),
    ),
    # About the common centre of mass, which a change moves to second order alone.
    Target("multibody", f"{_M}.geometry", ("_joined",), 1e-3),
    Target("multibody", f"{_M}.tree", ("_node", "_tree", "_torque", "_tip_sensor")),
    Target("multibody", f"{_M}.energy", ("*",)),
    Target("multibody", f"{_M}.moments", ("at", "pitch_terms")),
    Target("multibody", f"{_M}.sensor_samples", ("_fields", "_add_energies")),
    Target("chain", f"{_M}.geometry", ("quaternion", "quaternion_rate"), 1e-2),
    Target(
        "chain",
        f"{_M}.chain",
        (
            "rotation",
            "placed_bodies",
            "_body",
            "_gravity",
            "_on_ground",
            "_on_body",
            "_pitch_spring",
            "_spring_torque",
            "_rotor_torque",
            "_tip_sensor",
        ),
        1e-2,
    ),
    Target("chain", f"{_M}.sensor_samples", ("_joint_motion", "_dot", "unwrap"), 1e-2),
    # A thousandth: of fourth order, this model is bound to 1e-8.
    Target(
        "mujoco", f"{_J}.mjcf", ("loads_of", "model", "_blade", "_joint", "_quaternion", "_inertial", "_possible"), 1e-3
    ),
    Target(
        "mujoco",
        f"{_J}.solver",
        (
            "_advance",
            "_kinetic_energy",
            "_potential_energy",
            "_work",
            "_work_needs_rows",
            "_dampings",
            "_spring_energy",
            "_springs",
            "_work_of_rests",
        ),
        1e-3,
    ),
    Target(
        "rules",
        "rotor_mbs.solution.judgement",
        (
            "allowed_of",
            "judge",
            "_is_close",
            "_broken_off",
            "_through_singularity",
            "_inaccurate",
            "_unchecked",
            "start_slack",
            "energy_slack",
            "energy_conditioning",
            "_shares_at_quarter_turns",
            "smallest_rotor_inertia_share",
            "rotor_inertia_shares",
            "_shaft_inertia_forms",
            "_SINGULAR_SHARE",
            "_ROUND_OFF",
            "_RESEMBLES",
            "_NO_INERTIA",
        ),
        0.5,
    ),
    Target(
        "rules",
        "rotor_mbs.solution.metrics",
        (
            "running_growth",
            "horizon_samples",
            "angle_error",
            "energy_scale",
            "_angle_errors",
            "_relative_error",
            "_motion_sizes",
            "HORIZON_GROWTH",
        ),
        0.5,
    ),
    # A thousandth: step rules and tableau; of a tableau's fractions any.
    Target("ode45", "rotor_mbs.models.ode45", ("*",), 1e-3),
    Target("schemes", f"{_M}.schemes", ("*",), 0.5),
    Target(
        "schemes", f"{_M}.methods", ("step", "_scheme", "_build_tree", "_build_chain", "__init__", "integrate"), 0.5
    ),
    Target(
        "schemes", f"{_L}.methods", ("tolerance", "check_tolerance", "relative_tolerance", "absolute_tolerance"), 0.5
    ),
    Target("adapter", f"{_M}.adapter", ("*",), 0.5),
    Target("integration", f"{_L}.ode_solvers", ("*",), 0.5),
    Target("integration", f"{_L}.samples", ("over_segments", "loads_at", "loads_at_start", "at_constant_rests"), 0.5),
    Target("integration", f"{_L}.taylor", ("*",), 0.5),
    Target("reference", f"{_L}.reference", ("*",), 0.5),
    Target("analysis", f"{_A}.exact", ("exact_rotor_angle", "_stays_at_zero_pitch", "_about_shaft", "_pendulum")),
    Target("analysis", f"{_A}.kinematics", ("*",)),
    Target("analysis", f"{_A}.verdicts", ("*",), 0.5),
    Target("analysis", f"{_A}.run_integrity", ("*",), 0.5),
    Target("analysis", f"{_A}.trajectory_numbers", ("*",), 0.5),
    Target("analysis", f"{_A}.claims", ("*",), 0.5),
)

# An engine that is not installed has no mutants.
TARGETS = tuple(one for one in _TARGETS if one.group != "mujoco" or importlib.util.find_spec("mujoco"))


# What sees the mutants of a module that no verdict can see.
_PARTS = "models/test_exudyn_parts.py::test_"
_MUJOCO = "models/test_mujoco.py::test_"
_PITCH = "models/test_pitch_loads.py::test_"
_RULES = (
    "solution/test_unchecked.py::test_a_wrong_motion_without_energy_and_reference_is_unchecked",
    "solution/test_judgement.py::test_an_open_joint_is_caught",
    "solution/test_unchecked.py::test_a_start_turns_away_leaves_ten_units_in_its_last_place_open",
)
_CHECK = "studies/test_check.py::test_"
_TESTS = {
    f"{_M}.geometry": (f"{_PARTS}mountings_balance_exactly",),
    f"{_M}.sensor_samples": (f"{_PARTS}unwrapping_follows_rates_over_turns_between_rows",),
    "rotor_mbs.scenario.time_table": ("scenario/test_time_table.py",),
    f"{_M}.tree": ("solution/test_judgement_messages.py",),
    f"{_J}.mjcf": (
        f"{_MUJOCO}point_masses_have_no_inertia_that_the_scene_does_not_give",
        f"{_MUJOCO}an_inertia_at_the_limit_of_the_triangle_inequality",
        f"{_MUJOCO}torque_ramp_on_a_balanced_rotor",
    ),
    f"{_J}.solver": (
        f"{_MUJOCO}steps_and_evaluations_are_counted",
        f"{_MUJOCO}torque_ramp_on_a_balanced_rotor",
        f"{_MUJOCO}full_inertia_springs_dampers_and_torque_follow_the_closed_form",
    ),
    "rotor_mbs.solution.judgement": ("solution/test_judgement_messages.py", *_RULES),
    "rotor_mbs.solution.metrics": _RULES,
    f"{_M}.energy": (
        f"{_PARTS}cumulative_integral_is_exact_on_uneven_rows",
        "models/test_exudyn_work.py",
        f"{_PITCH}work_of_a_constant_torque_and_of_a_constant_rest_angle[exudyn_tree/rk44]",
    ),
    "rotor_mbs.models.ode45": ("models/test_ode45.py",),
    f"{_M}.schemes": (f"{_PARTS}counts_of_steps_and_evaluations",),
    f"{_M}.methods": (
        f"{_PARTS}samples_the_engine_cannot_tell_apart_are_refused",
        "models/test_loads.py::test_multipliers_of_rotation_vectors_are_refused",
        "models/test_extrapolation.py::test_steps_are_those_of_all_runs_and_fit_each_other",
    ),
    f"{_M}.adapter": (
        f"{_PARTS}counts_of_steps_and_evaluations",
        f"{_PARTS}a_solve_that_fails_is_counted_to_the_last_step_that_it_took",
        f"{_PARTS}samples_stand_exactly_at_their_times",
        f"{_PARTS}ctrl_c_inside_a_solve_is_an_interrupt",
        "models/test_exudyn_models.py::test_large_chains_alone_are_solved_by_a_sparse_factorization",
    ),
    f"{_L}.ode_solvers": ("models/test_segments.py",),
    f"{_L}.taylor": (
        "models/test_segments.py::test_the_order_of_taylors_series_is_that_of_its_tolerance",
        "models/test_lagrange.py::test_error_growth_is_that_of_neighbouring_runs",
    ),
    f"{_L}.samples": (
        f"{_PITCH}work_of_a_constant_torque_and_of_a_constant_rest_angle[lagrange/dop853]",
        f"{_PITCH}work_and_energy_of_a_step_of_the_command[lagrange/dop853]",
        "models/test_segments.py",
    ),
    f"{_L}.reference": (
        "models/test_lagrange.py::test_the_fallback_reference_states_its_uncertainty",
        "studies/test_compare_data.py::test_the_reference_at_the_times_of_the_data_is_the_frozen_one",
    ),
    f"{_A}.exact": ("analysis/test_exact.py",),
    f"{_A}.verdicts": (f"{_CHECK}a_tampered_run_fails", f"{_CHECK}a_touched_reference_in_the_file_fails"),
    f"{_A}.trajectory_numbers": ("analysis/test_analysis.py",),
    f"{_A}.claims": ("analysis/test_analysis.py",),
}


# Making mutants


def mutants(target: Target) -> list[Mutant]:
    """In the order of the source."""
    tree = ast.parse(_source(target.module))
    found = []
    for name, scope in _scopes(tree):
        if name in target.names or target.names == ("*",):
            for number, (node, parents) in enumerate(_walk(scope)):
                for what, change in _changes(node, parents, scope, target):
                    where = f"line {getattr(node, 'lineno', 0)}:{getattr(node, 'col_offset', 0)}: {what}"
                    source = functools.partial(_changed, tree, scope, number, change)
                    found.append(Mutant(target.group, target.module, name, where, source))
    return found


def _source(module: str) -> str:
    return (ROOT / (module.replace(".", "/") + ".py")).read_text()


Scope = ast.FunctionDef | ast.Assign | ast.AnnAssign


def _scopes(tree: ast.Module) -> Iterator[tuple[str, Scope]]:
    """Functions, methods, the module's constants and its classes' defaults; of nested functions the outer one."""
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    for node in [*tree.body, *(inner for one in classes for inner in one.body)]:
        if isinstance(node, ast.FunctionDef):
            yield node.name, node
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            yield node.targets[0].id, node
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value is not None:
            yield node.target.id, node


Change = Callable[[Any], Any]


def _walk(scope: Scope) -> list[tuple[ast.AST, tuple[ast.AST, ...]]]:
    """Every node of the body or value with its ancestors, the nearest last; neither annotations nor the docstring."""
    found: list[tuple[ast.AST, tuple[ast.AST, ...]]] = []

    def visit(node: ast.AST, parents: tuple[ast.AST, ...]) -> None:
        found.append((node, parents))
        for child in ast.iter_child_nodes(node):
            visit(child, (*parents, node))

    for node in scope.body if isinstance(scope, ast.FunctionDef) else [scope.value]:
        if not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)):
            visit(node, (scope,))
    return found


def _changed(tree: ast.Module, scope: Scope, number: int, change: Change) -> str:
    """The module's text with one node of one function or constant replaced."""
    own = copy.deepcopy(tree)
    twin = next(node for _, node in _scopes(own) if node.lineno == scope.lineno)
    node, parents = _walk(twin)[number]
    new = change(node)
    for name, value in ast.iter_fields(parents[-1]):
        if value is node:
            setattr(parents[-1], name, new)
        elif isinstance(value, list) and any(item is node for item in value):
            setattr(parents[-1], name, [new if item is node else item for item in value])
    return ast.unparse(ast.fix_missing_locations(own))


def _changes(node: ast.AST, parents: Sequence[ast.AST], scope: Scope, target: Target) -> Iterator[tuple[str, Change]]:
    """What can be wrong at a node, each with a word for it."""
    if any(isinstance(parent, (ast.Subscript, ast.JoinedStr, ast.Raise, ast.AnnAssign, ast.arguments)) and not
           (isinstance(parent, ast.Subscript) and _inside(node, parent.value)) and not
           (isinstance(parent, ast.AnnAssign) and parent.value is not None and _inside(node, parent.value))
           for parent in parents):  # fmt: skip
        return  # an index or a text is no term
    text = ast.unparse(node) if isinstance(node, ast.expr) else ""
    text = text if len(text) <= 60 else f"{text[:57]}..."
    if isinstance(node, ast.BinOp):
        yield from _arithmetic(node, parents, text, target.share)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield f"sign of {text} lost", lambda n: n.operand
    elif isinstance(node, ast.Call):
        yield from _turned_function(node, text)
    elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and isinstance(scope, ast.FunctionDef):
        yield from _sine_for_cosine(node, scope, target)
    elif isinstance(node, ast.AugAssign) and isinstance(node.op, (ast.Add, ast.Sub)):
        yield f"sign of {ast.unparse(node)[:60]}", _flipped
        yield f"without {ast.unparse(node)[:60]}", lambda _: ast.Pass()
    elif isinstance(node, ast.Constant) and not isinstance(parents[-1], (ast.BinOp, ast.UnaryOp)):
        yield from _constant(node, parents, target)
    if target.group in ("rules", *_PROGRAMS):
        yield from _logic(node, text)


def _inside(node: ast.AST, tree: ast.AST) -> bool:
    return any(one is node for one in ast.walk(tree))


def _arithmetic(node: ast.BinOp, parents: Sequence[ast.AST], text: str, share: float) -> Iterator[tuple[str, Change]]:
    if any(isinstance(side, (ast.List, ast.ListComp, ast.Tuple, ast.JoinedStr)) for side in (node.left, node.right)):
        return
    if isinstance(node.op, (ast.Add, ast.Sub)):
        sign = isinstance(node.op, ast.Sub)
        yield f"sign in {text}", _flipped
        yield f"right side of {text} lost", lambda n: n.left
        if not (isinstance(node.left, ast.BinOp) and isinstance(node.left.op, (ast.Add, ast.Sub))):
            yield f"left side of {text} lost", lambda n: ast.UnaryOp(ast.USub(), n.right) if sign else n.right
        yield f"right side of {text} scaled", lambda n: _with(n, right=_scaled(n.right, share))
    elif isinstance(node.op, (ast.Mult, ast.Div)):
        within = parents[-1]
        if not (isinstance(within, ast.BinOp) and isinstance(within.op, (ast.Mult, ast.Div, ast.Add, ast.Sub))):
            yield f"{text} scaled", lambda n: _scaled(n, share)
        if isinstance(node.op, ast.Div):
            yield f"/ in {text} for *", lambda n: _with(n, op=ast.Mult())


def _flipped(node: Any) -> Any:
    return _with(node, op=ast.Add() if isinstance(node.op, ast.Sub) else ast.Sub())


def _with(node: Any, **fields: Any) -> Any:
    new = copy.copy(node)
    for name, value in fields.items():
        setattr(new, name, value)
    return new


def _scaled(node: ast.expr, share: float) -> ast.expr:
    return ast.BinOp(node, ast.Mult(), ast.Constant(1.0 + share))


_OTHER = {"sin": "cos", "cos": "sin"}


def _turned_function(node: ast.Call, text: str) -> Iterator[tuple[str, Change]]:
    function = node.func
    if isinstance(function, ast.Name) and function.id in _OTHER:
        other: ast.expr = ast.Name(_OTHER[function.id], ast.Load())
    elif isinstance(function, ast.Attribute) and function.attr in _OTHER:
        other = ast.Attribute(function.value, _OTHER[function.attr], ast.Load())
    else:
        return
    yield f"{text}: sine and cosine", lambda n: _with(n, func=other)


def _sine_for_cosine(node: ast.Name, function: ast.FunctionDef, target: Target) -> Iterator[tuple[str, Change]]:
    """s2 for c2, where both are at hand; c is a length in the print."""
    match = re.fullmatch(r"([sc])([2-5p]?|in_\w+|os_\w+)", node.id)
    known = {arg.arg for arg in function.args.args} | {
        name.id for name in ast.walk(function) if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store)
    }
    if match is None or (target.group == "printed" and not match[2]):
        return
    other = {"s": "c", "c": "s"}[match[1]] + match[2].replace("in_", "#").replace("os_", "in_").replace("#", "os_")
    if other in known:
        yield f"{node.id} -> {other}", lambda _: ast.Name(other, ast.Load())


def _constant(node: ast.Constant, parents: Sequence[ast.AST], target: Target) -> Iterator[tuple[str, Change]]:
    value, within = node.value, parents[-1]
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return
    of_a_program = target.group in _PROGRAMS
    is_number = isinstance(within, (ast.Tuple, ast.List, ast.Return, ast.Assign, ast.IfExp, ast.Dict))
    if of_a_program:
        is_number |= isinstance(within, (ast.Call, ast.keyword, ast.Compare)) and getattr(within, "arg", "") != "axis"
    if not is_number and not (target.group == "rules" and isinstance(within, ast.Compare)):
        return
    if isinstance(value, int) and of_a_program:
        yield f"{value} -> {value + 1}", lambda _: ast.Constant(value + 1)
        return
    if isinstance(value, int) and target.group != "printed":
        return
    new = value * (1.0 + target.share) if value else 1e3 * target.share  # of units of order one
    yield f"{value} -> {new!r}", lambda _: ast.Constant(new)


_OPPOSITE = {ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
             ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In}  # fmt: skip


def _logic(node: ast.AST, text: str) -> Iterator[tuple[str, Change]]:
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        opposite = _OPPOSITE[type(node.ops[0])]
        yield f"{text} turned round", lambda n: _with(n, ops=[opposite()])
    elif isinstance(node, ast.BoolOp):
        other = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield f"and, or in {text}", lambda n: _with(n, op=other)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield f"{text} without not", lambda n: n.operand
    elif isinstance(node, ast.Constant) and node.value in STATUS_WORDS:
        other_word = "diverged" if node.value != "diverged" else "ok"
        yield f"{node.value} -> {other_word}", lambda _: ast.Constant(other_word)
    elif isinstance(node, (ast.If, ast.IfExp)):
        condition = ast.unparse(node.test)[:60]
        yield f"if {condition}: never", lambda n: _with(n, test=ast.Constant(False))
        yield f"if {condition}: always", lambda n: _with(n, test=ast.Constant(True))
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("min", "max"):
        other_name = "max" if node.func.id == "min" else "min"
        yield f"{text}: min, max", lambda n: _with(n, func=ast.Name(other_name, ast.Load()))


STATUS_WORDS = ("ok", "inaccurate", "diverged", "singular", "solver_failed", "timed_out", "unchecked")


# Judging mutants


def _verdicts_of(group: str) -> Iterator[list[Any]]:
    """What `check` says, the cheap parts first. Imported here: after the mutant's text was put in place."""
    from rotor_mbs.scenario.accuracy_bounds import load_bounds
    from rotor_mbs.studies import check, check_probes

    if group in ("schemes", "ode45"):
        yield check.judge_defaults(load_bounds())
    kinds = {"rules": ("rules",), "reference": ("reference",), "lagrange": ("printed",), "printed": ("printed",)}
    for probe in check_probes.probes():
        if probe.study in kinds.get(group, ()) and probe.scene.name != "paper/fig11":
            for one in check_probes.measure(probe):
                yield [check.judge_measured(one, load_bounds())]
    batches = {
        "lagrange": [(("check/held",), "lagrange/dop853"), (("check/general",), "lagrange/dop853"),
                     (("check/pitch-loads",), "lagrange/dop853")],
        "printed": [(("check/point-masses", "paper/fig04b"), "printed/ode45"),
                    (("paper/fig05", "paper/fig11"), "printed/ode45")],
        "multibody": [(("check/held",), "exudyn_tree/rk67"), (("check/general",), "exudyn_tree/rk67"),
                      (("check/pitch-loads",), "exudyn_tree/rk67"),
                      (("check/held",), "exudyn_chain/generalized_alpha")],
        "chain": [(("check/held",), "exudyn_chain/generalized_alpha"),
                  (("check/general",), "exudyn_chain/generalized_alpha"),
                  (("check/pitch-loads",), "exudyn_chain/generalized_alpha")],
        "mujoco": [(("check/held",), "mujoco/rk4"), (("check/general",), "mujoco/rk4"),
                   (("check/pitch-loads",), "mujoco/rk4")],
        "ode45": [(("check/held", "check/general"), "lagrange/ode45"), (("paper/fig05",), "printed/ode45")],
        "schemes": [(("check/loads",), "exudyn_tree/rk67"), *[(("check/held",), method) for method in (
            "exudyn_tree/rk44", "exudyn_tree/dopri5", "exudyn_tree/generalized_alpha",
            "exudyn_chain/generalized_alpha", "exudyn_chain/newmark_index2", "lagrange/dop853")]],
        "adapter": [(("check/held", "check/loads"), "exudyn_tree/rk67"), (("check/pitch-loads",), "exudyn_tree/dopri5"),
                    (("check/held", "check/loads"), "exudyn_chain/generalized_alpha")],
        "integration": [(("check/held", "check/general", "check/pitch-loads"), method) for method in (
            "lagrange/taylor", "lagrange/dop853", "lagrange/ode45")],
    }  # fmt: skip
    from support.checking import judged, results_file

    if group == "analysis":
        yield judged(_good_file())
    for scenes, method in batches.get(group, ()):
        with tempfile.TemporaryDirectory() as folder:
            yield judged(results_file(Path(folder) / "mutant.h5", scenes, [method], _RUN_LIMIT_S))


@functools.cache
def _good_file() -> Path:
    """Runs of every kind of verdict; made once, before the first mutant."""
    from support.checking import results_file

    path = Path(tempfile.mkdtemp()) / "good.h5"
    atexit.register(shutil.rmtree, path.parent)
    results_file(path, ["check/held", "check/general", "check/pitch-loads", "check/loads"],
                 ["lagrange/dop853", "exudyn_tree/rk67"])  # fmt: skip
    results_file(path, ["paper/fig03", "paper/fig04b", "paper/fig05", "paper/fig06", "paper/fig15-100kNm"],
                 ["lagrange/dop853", "printed/ode45"])  # fmt: skip
    return results_file(path, ["paper/fig11", "paper/fig13b"], ["printed/ode45"])


class _Changed(importlib.machinery.SourceFileLoader):
    """Loads one module from a text in place of its file."""

    def __init__(self, name: str, path: str, source: str) -> None:
        super().__init__(name, path)
        self._source = source

    def get_code(self, fullname: str) -> Any:  # noqa: ARG002
        return compile(self._source, self.path, "exec")


class _Finder:
    def __init__(self, mutant: Mutant) -> None:
        self._mutant = mutant

    def find_spec(self, name: str, _path: Any = None, _target: Any = None) -> Any:
        if name != self._mutant.module:
            return None
        place = str(ROOT / (name.replace(".", "/") + ".py"))
        return importlib.util.spec_from_file_location(name, place, loader=_Changed(name, place, self._mutant.make()))


def _forget(group: str) -> None:
    kept = _KEPT.get(group, _KEPT_ELSE)
    for name in [name for name in sys.modules if name.startswith(("rotor_mbs.", "support."))]:
        if not name.startswith(kept):
            del sys.modules[name]


def _outcome(mutant: Mutant) -> str:
    """Which verdict failed first, or which test; "" where none did."""
    try:
        with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
            return _verdict_that_fails(mutant) or _test_that_fails(mutant.module)
    except BaseException as exc:
        return f"raised {type(exc).__name__}: {str(exc)[:60]}"


def _verdict_that_fails(mutant: Mutant) -> str:
    _forget(mutant.group)
    sys.meta_path.insert(0, _Finder(mutant))  # type: ignore[arg-type]
    for verdicts in _verdicts_of(mutant.group):
        for verdict in verdicts:
            if not verdict.passed:
                return f"{verdict.check}: {verdict.scene} {verdict.method} {verdict.channel}"
    return ""


class _FirstFailure:
    """Which test failed first."""

    name = ""

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.name = self.name or (report.nodeid if report.failed else "")

    pytest_collectreport = pytest_runtest_logreport  # a module that cannot be imported


def _test_that_fails(module: str) -> str:
    tests, first = [str(ROOT / "tests" / test) for test in _TESTS.get(module, ())], _FirstFailure()
    if tests:
        pytest.main(["-q", "-x", "-p", "no:cacheprovider", *tests], [first])
    return f"test: {first.name}" if first.name else ""


def _in_a_child(mutant: Mutant) -> tuple[int, int]:
    """(process, pipe to read its answer from)."""
    read, write = os.pipe()
    process = os.fork()
    if process:
        os.close(write)
        return process, read
    resource.setrlimit(resource.RLIMIT_CPU, (_CPU_LIMIT_S, _CPU_LIMIT_S))
    with os.fdopen(write, "w") as pipe:
        pipe.write(_outcome(mutant) or "survived")
    os._exit(0)


def prove_control(target: Target) -> None:
    """Raises SystemExit where a module with its own text, imported anew like a mutant, does not pass every verdict."""
    if target.group == "analysis":
        _good_file()
    unchanged = Mutant(target.group, target.module, "*", "unchanged", lambda: _source(target.module))
    process = os.fork()
    if not process:
        noticed = _verdict_that_fails(unchanged)
        os._exit(bool(noticed))
    if os.waitpid(process, 0)[1]:
        raise SystemExit(f"{target.module}, imported anew and unchanged, does not pass")


def run(chosen: Sequence[Mutant], jobs: int) -> Iterator[tuple[Mutant, str]]:
    """Every mutant with the verdict that noticed it ("survived": none); as many at a time as there are jobs."""
    waiting, going = list(chosen)[::-1], {}
    while waiting or going:
        while waiting and len(going) < jobs:
            mutant = waiting.pop()
            process, pipe = _in_a_child(mutant)
            going[process] = mutant, pipe
        process, _ = os.wait()
        mutant, pipe = going.pop(process)
        with os.fdopen(pipe) as answer:
            yield mutant, answer.read() or "did not end, or took its process with it"


def all_mutants(groups: Sequence[str] = (), every: int = 1, only: str = "") -> list[Mutant]:
    found = [mutant for target in TARGETS if not groups or target.group in groups for mutant in mutants(target)]
    return [mutant for mutant in found if re.search(only, mutant.name)][::every]


def warm_up() -> None:
    """Loads the engines and what else is not imported anew."""
    sys.path[:0] = [str(ROOT), str(ROOT / "tests")]
    for name in (
        "rotor_mbs.models.exudyn.adapter", "mujoco", "heyoka", "scipy.integrate", "scipy.special", "h5py",
        "rotor_mbs.scenario.schema", "rotor_mbs.scenario.scene_file",
    ):  # fmt: skip
        if importlib.util.find_spec(name):
            importlib.import_module(name)


def main() -> None:
    parser = argparse.ArgumentParser(description="Mutants of the models and rules, and which verdict notices each.")
    parser.add_argument("groups", nargs="*", metavar="GROUP", help="such as lagrange, rules, ode45")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="each N-th mutant alone")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="at a time (default: %(default)s)")
    parser.add_argument("--only", default="", metavar="PATTERN", help="those alone whose name has it")
    arguments = parser.parse_args()
    start = time.monotonic()
    warm_up()
    chosen = all_mutants(arguments.groups, arguments.every, arguments.only)
    for group in dict.fromkeys(mutant.group for mutant in chosen):
        prove_control(next(target for target in TARGETS if target.group == group))
    rows = []
    for mutant, noticed in run(chosen, arguments.jobs):
        rows.append({"mutant": mutant.name, "group": mutant.group, "noticed": noticed})
        if noticed == "survived":
            print(f"survived: {mutant.name}", file=sys.stderr, flush=True)
    survived = sum(row["noticed"] == "survived" for row in rows)
    tested = sum(row["noticed"].startswith("test:") for row in rows)
    seconds = time.monotonic() - start
    print(f"{len(rows)} mutants, {tested} seen by a test alone, {survived} survived; {seconds:.0f} s", file=sys.stderr)
    json.dump(rows, sys.stdout, indent=1)


if __name__ == "__main__":
    main()
