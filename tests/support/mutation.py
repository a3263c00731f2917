"""The mutation run: one change to the source at a time, and a check of `rotor-mbs check` or a test must notice.

    python tests/support/mutation.py [GROUP...] [--only PATTERN] [--every N] [--jobs N]

Each mutant lives in a process of its own, forked from one that has loaded the engines: there the package is imported
with the changed text of one module, a small set of scenes is computed and judged as `check` does it, and the first
check that fails is printed. A mutant that raises, or does not end in time, leaves a run that failed: `check` fails for
that, too. What no run that is judged here can show (a turn missed between rows, the place of a quadrature's window) is
put to a unit test of its own; the answer then begins with "test:".
"""

from __future__ import annotations

import argparse
import ast
import atexit
import contextlib
import copy
import functools
import gc
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
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
_CPU_LIMIT_S, _RUN_LIMIT_S = 20, 120.0  # of a mutant, whatever else the machine does; of each run by the clock
# Here whole numbers count, arguments of calls, and conditions; elsewhere the terms of equations.
_PROGRAMS = ("ode45", "schemes", "adapter", "integration", "reference", "analysis")


@dataclass(frozen=True)
class Target:
    """Functions and constants of a module whose every term is perturbed; `share`: by how much a number is changed."""

    group: str
    module: str
    names: str  # with blanks between; "*": all of them
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
    Target("lagrange", f"{_L}.closed_form", "accelerations power rest_energy energies _kinetic point_path"),
    Target("lagrange", f"{_L}.parameters",
           "rotor_form _inertia_about_hub _rotor_inertia _coefficients _cosine_of_turn"),
    # What all but the printed equations share: every group's checks see it.
    Target("lagrange", "rotor_mbs.scenario.time_table",
           "value_at values_at constant_value values at segments values_before"),
    Target("multibody", "rotor_mbs.scenario.time_table", "intervals steps_and_rows"),
    Target("lagrange", f"{_L}.samples", "trajectory _put_energies constant_work"),
    Target("printed", f"{_P}.literal", "*"),
    Target("printed", f"{_P}.derivation", "*"),
    Target("printed", f"{_P}.observables", "tip_path kinetic_energy potential_energy _sines"),
    Target("multibody", f"{_M}.geometry",
           "rotation_y rotation_z mounting _turn blade_body hub_body fixed_blade_rotation on_body"),
    # About the common centre of mass, which a change moves to second order alone.
    Target("multibody", f"{_M}.geometry", "_joined", 0.001),
    Target("multibody", f"{_M}.tree", "_tree"),
    Target("multibody", f"{_M}.sensor_samples", "springs work cumulative_integral"),
    Target("multibody", f"{_M}.moments", "at drives moment_on"),
    Target("multibody", f"{_M}.sensor_samples", "_fields"),
    Target("chain", f"{_M}.geometry", "quaternion quaternion_rate", 0.01),
    Target("chain", f"{_M}.chain",
           "rotation placed_bodies _body _marker _on_body _pitch_spring _spring_torque", 0.01),
    Target("chain", f"{_M}.sensor_samples", "_joint_motion _dot unwrap", 0.01),
    # A thousandth: of fourth order, this model is bound to 1e-8.
    Target("mujoco", f"{_J}.mjcf", "loads_of model _blade _joint _inertial _possible", 0.001),
    Target("mujoco", f"{_J}.solver", "_advance observe _work _springs", 0.001),
    Target("rules", "rotor_mbs.analysis.judgement",
           "allowed_of judge _is_close _broken_off _through_singularity _inaccurate _unchecked start_slack "
           "energy_slack energy_conditioning _shares_at_quarter_turns smallest_rotor_inertia_share "
           "rotor_inertia_shares _shaft_inertia_forms _SINGULAR_SHARE _ROUND_OFF _RESEMBLES _NO_INERTIA", 0.5),
    Target("rules", "rotor_mbs.solution.metrics",
           "running_growth horizon_samples angle_error energy_scale _angle_errors _motion_sizes "
           "HORIZON_GROWTH", 0.5),
    # A thousandth: step rules and tableau; of a tableau's fractions any.
    Target("ode45", "rotor_mbs.models.ode45", "*", 0.001),
    Target("schemes", f"{_M}.schemes", "*", 0.5),
    Target("schemes", f"{_M}.solvers", "_scheme build_tree build_chain __init__ integrate", 0.5),
    Target("schemes", f"{_L}.methods", "tolerance check_tolerance relative_tolerance absolute_tolerance", 0.5),
    Target("adapter", f"{_M}.adapter", "*", 0.5),
    Target("integration", f"{_L}.ode_solvers", "*", 0.5),
    Target("integration", f"{_L}.samples", "over_segments loads_at loads_at_start at_constant_rests", 0.5),
    Target("integration", f"{_L}.taylor", "*", 0.5),
    Target("reference", f"{_L}.reference", "*", 0.5),
    Target("analysis", f"{_A}.exact", "exact_rotor_angle _stays_at_zero_pitch _about_shaft _pendulum"),
    Target("analysis", f"{_A}.kinematics", "*"),
    Target("analysis", f"{_A}.checks", "*", 0.5),
    Target("analysis", f"{_A}.claims", "*", 0.5),
)  # fmt: skip

# An engine that is not installed has no mutants.
TARGETS = tuple(one for one in _TARGETS if one.group != "mujoco" or importlib.util.find_spec("mujoco"))


# What sees the mutants of a module that no check can see: files of a few seconds, of the others single tests.
_PARTS = ("models/test_exudyn_parts.py",)
_MUJOCO = "models/test_mujoco.py::test_"
_WORK = "models/test_pitch_loads.py::test_work_"
_RULES = (
    "analysis/test_status_rules.py",
    "solution/test_judgement.py::test_a_run_that_broke_off_names_time_and_reason",
    "solution/test_judgement.py::test_a_wrong_motion_is_unchecked_where_nothing_can_tell",
    "solution/test_judgement.py::test_a_start_turns_away_leaves_ten_units_in_its_last_place_open",
)
_CHECK = "studies/test_check.py::test_a_"
_PRINTED = ("models/test_printed.py", "analysis/test_errata.py")
_DEFAULTS = "analysis/test_run_integrity.py"
_TESTS = {
    f"{_L}.closed_form": _PRINTED,
    f"{_L}.parameters": _PRINTED,
    f"{_P}.literal": (*_PRINTED, "models/test_printed_method.py::test_figure_4b_is_a_pendulum"),
    f"{_P}.derivation": _PRINTED,
    f"{_M}.geometry": _PARTS,
    f"{_M}.chain": _PARTS,
    f"{_M}.sensor_samples": (*_PARTS, f"{_WORK}of_a_constant_torque_and_of_a_constant_rest_angle[exudyn_tree/rk44]"),
    "rotor_mbs.scenario.time_table": ("scenario/test_time_table.py",),
    f"{_M}.tree": ("solution/test_judgement.py::test_the_tree_is_listed_with_what_it_has",),
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
    "rotor_mbs.analysis.judgement": _RULES,
    "rotor_mbs.solution.metrics": _RULES,
    "rotor_mbs.models.ode45": (_DEFAULTS, "models/test_ode45.py"),
    f"{_M}.schemes": (_DEFAULTS, *_PARTS),
    f"{_M}.solvers": (_DEFAULTS, *_PARTS, "models/test_extrapolation.py::test_steps_are_those_of_all_columns"),
    f"{_M}.adapter": (
        *_PARTS,
        "models/test_linearization.py",
        "models/test_exudyn_models.py::test_large_chains_alone_are_solved_by_a_sparse_factorization",
    ),
    f"{_L}.ode_solvers": ("models/test_segments.py",),
    f"{_L}.methods": (_DEFAULTS, "methods/test_settings.py"),
    f"{_L}.taylor": ("models/test_segments.py", "models/test_lagrange.py", "models/test_sweep_ensemble.py"),
    f"{_L}.samples": ("models/test_segments.py", f"{_WORK}and_energy_of_a_step_of_the_command[lagrange/dop853]"),
    f"{_L}.reference": (
        "models/test_reference.py",
        f"{_CHECK}reference_computed_now_is_the_frozen_one[check/general]",
        "studies/test_compare_data.py::test_growth_of_each_channel_is_at_most_that_of_all",
        "studies/test_compare_data.py::test_the_reference_at_the_times_of_the_data_is_the_frozen_one",
    ),
    f"{_A}.exact": ("analysis/test_exact.py",),
    f"{_A}.kinematics": ("analysis/test_checks.py",),
    f"{_A}.checks": (
        "analysis/test_checks.py",
        _DEFAULTS,
        f"{_CHECK}run_that_was_changed_together_with_its_checksum_fails",
        f"{_CHECK}reference_that_is_altered_or_not_there_fails",
    ),
    f"{_A}.claims": ("analysis/test_claims.py",),
}


# Making mutants


def mutants(target: Target) -> list[Mutant]:
    """In the order of the source."""
    tree = ast.parse(_source(target.module))
    found = []
    for name, scope in _scopes(tree):
        if target.names == "*" or name in target.names.split():
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


def _checks_of(group: str) -> Iterator[list[Any]]:
    """What `check` says, the cheap parts first."""
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
    folder = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, folder)
    return folder / "good.h5"


def _make_good_file() -> None:
    """Runs of every kind of check."""
    from support.checking import results_file

    path = _good_file()
    results_file(path, ["check/held", "check/general", "check/pitch-loads", "check/loads"],
                 ["lagrange/dop853", "exudyn_tree/rk67"])  # fmt: skip
    results_file(path, ["paper/fig03", "paper/fig04b", "paper/fig05", "paper/fig06", "paper/fig15-100kNm"],
                 ["lagrange/dop853", "printed/ode45"])  # fmt: skip
    results_file(path, ["paper/fig11", "paper/fig13b"], ["printed/ode45"])


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


def _outcome(mutant: Mutant) -> str:
    """Which check failed first, or which test; "" where none did. Of the checks themselves the tests are quicker."""
    sys.meta_path.insert(0, _Finder(mutant))  # type: ignore[arg-type]
    try:
        with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
            judges = (lambda: _check_that_fails(mutant.group)), (lambda: _test_that_fails(mutant.module))
            return next(filter(None, (judge() for judge in judges[:: -1 if mutant.group == "analysis" else 1])), "")
    except BaseException as exc:
        return f"raised {type(exc).__name__}: {str(exc)[:60]}"


def _check_that_fails(group: str) -> str:
    for checks in _checks_of(group):
        for check in checks:
            if not check.passed:
                return f"{check.name}: {' '.join(check.where)}"
    return ""


class _FirstFailure:
    """Which test failed first."""

    name = ""

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.name = self.name or (report.nodeid if report.failed else "")

    pytest_collectreport = pytest_runtest_logreport  # a module that cannot be imported


_PYTEST = ("-q", "-x", "-p", "no:cacheprovider")


def _run_tests(tests: Iterable[str], *options: str) -> str:
    """Which test failed first; "" where none did."""
    first = _FirstFailure()
    with contextlib.redirect_stdout(io.StringIO()):
        failed = pytest.main([*_PYTEST, *options, *(str(ROOT / "tests" / test) for test in tests)], [first])
    return first.name or "interrupted" if failed else ""


def _test_that_fails(module: str) -> str:
    failed = module in _TESTS and _run_tests(_TESTS[module])
    return f"test: {failed}" if failed else ""


def _in_a_child(mutant: Mutant) -> tuple[int, int]:
    """(process, pipe to read its answer from)."""
    read, write = os.pipe()
    process = os.fork()
    if process:
        os.close(write)
        return process, read
    resource.setrlimit(resource.RLIMIT_CPU, (_CPU_LIMIT_S, _CPU_LIMIT_S))
    answer = _NOT_TRIED
    try:
        answer = _outcome(mutant) or "survived"
    finally:
        with os.fdopen(write, "w") as pipe:
            pipe.write(answer)
        os._exit(0)


_NOT_TRIED = "could not be put in place"


def prove_control(group: str) -> None:
    """Raises SystemExit where the group, unchanged, fails."""
    if group == "analysis" and (not _good_file() or not _in_order(_make_good_file)):
        raise SystemExit("no file to judge")
    if not _in_order(lambda: _check_that_fails(group)):
        raise SystemExit(f"{group}, unchanged, does not pass")


def _in_order(act: Callable[[], Any]) -> bool:
    """Whether `act` ends in a process of its own, without an answer."""
    process = os.fork()
    if process:
        return os.waitpid(process, 0)[1] == 0
    status = 1
    try:
        status = int(bool(act()))
    finally:
        os._exit(status)


def run(chosen: Sequence[Mutant], jobs: int) -> Iterator[tuple[Mutant, str]]:
    """Every mutant with the check that noticed it ("survived": none); as many at a time as there are jobs."""
    waiting, going = list(chosen)[::-1], {}
    while waiting or going:
        while waiting and len(going) < jobs:
            mutant = waiting.pop()
            process, pipe = _in_a_child(mutant)
            going[process] = mutant, pipe
        process, _ = os.wait()
        mutant, pipe = going.pop(process)
        with os.fdopen(pipe) as answer:
            noticed = answer.read() or "did not end, or took its process with it"
        if noticed == _NOT_TRIED:
            raise SystemExit(f"{mutant.name}: {noticed}")
        yield mutant, noticed


def all_mutants(groups: Sequence[str] = (), every: int = 1, only: str = "") -> list[Mutant]:
    found = [mutant for target in TARGETS if not groups or target.group in groups for mutant in mutants(target)]
    return [mutant for mutant in found if re.search(only, mutant.name)][::every]


def warm_up(modules: Sequence[str]) -> None:
    """Loads the engines; raises SystemExit where a test that mutants of these modules are judged by is not there."""
    sys.path[:0] = [str(ROOT), str(ROOT / "tests")]
    os.environ["XDG_CACHE_HOME"] = str(ROOT / ".pytest_cache" / "compiled")  # as in conftest.py
    for name in ("exudyn", "mujoco", "heyoka", "scipy.integrate", "scipy.special", "h5py"):
        if importlib.util.find_spec(name):
            importlib.import_module(name)
    tests = {test for module in modules for test in _TESTS.get(module, ())}
    if tests and not _in_order(lambda: _run_tests(tests, "--collect-only")):
        raise SystemExit("a test that mutants are judged by is not there")
    gc.freeze()  # else every child's collections go through all of it


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Mutants of the models and rules, and which check or test notices each."
    )
    parser.add_argument("groups", nargs="*", metavar="GROUP", help="such as lagrange, rules, ode45")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="each N-th mutant alone")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="at a time (default: %(default)s)")
    parser.add_argument("--only", default="", metavar="PATTERN", help="those alone whose name has it")
    arguments = parser.parse_args()
    start = time.monotonic()
    chosen = all_mutants(arguments.groups, arguments.every, arguments.only)
    warm_up(list(dict.fromkeys(mutant.module for mutant in chosen)))
    for group in dict.fromkeys(mutant.group for mutant in chosen):
        prove_control(group)
    ways: Counter[str] = Counter()
    tests = set()
    for mutant, noticed in run(chosen, arguments.jobs):
        print(json.dumps({"mutant": mutant.name, "group": mutant.group, "noticed": noticed}), flush=True)
        ways[noticed.split(":")[0].split()[0]] += 1
        tests |= {noticed.removeprefix("test: tests/")} if noticed.startswith("test: tests/") else set()
    if tests and not _in_order(lambda: _run_tests(tests)):
        raise SystemExit("a test that noticed a mutant fails without one")
    by_check = len(chosen) - sum(ways[way] for way in ("test", "survived", "raised", "did"))
    cpu = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    print(
        f"{len(chosen)} mutants: {by_check} made a check fail, {ways['raised']} raised, {ways['did']} did not end, "
        f"{ways['test']} made a test alone fail, {ways['survived']} survived; "
        f"{time.monotonic() - start:.0f} s, {cpu:.0f} s of processor time",
        file=sys.stderr,
    )


if __name__ == "__main__":
    main()
