"""The catalogue of methods; the rule that takes one where none is named: what it takes, what it
refuses, and why."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.packages import forget_what_is_installed, install
from support.references import reference
from support.scenes import PAPER_SCENES, paper, shipped

from rotor_mbs.analysis.judgement import judge
from rotor_mbs.errors import InputError, MethodRefusal
from rotor_mbs.methods import catalogue
from rotor_mbs.methods.catalogue import (
    find_method,
    is_corrected,
    methods,
)
from rotor_mbs.methods.selection import recommend, selected_methods, singular_reason
from rotor_mbs.methods.solve import solve
from rotor_mbs.scenario.catalogue import find_scenes

DEFAULT_METHODS = tuple(method.name for method in methods() if method.is_default)


def test_scenes_of_the_paper_keep_the_default_set() -> None:
    for name in PAPER_SCENES:
        methods, reason = recommend(paper(name), DEFAULT_METHODS)
        # not the printed model, which comes first in the paper's comparison
        assert methods[0] == "lagrange/taylor"
        assert set(methods) == set(DEFAULT_METHODS), name
        assert reason.startswith("ordinary scene")


def test_an_unknown_method_of_a_scene_is_named_with_the_scene() -> None:
    with pytest.raises(
        InputError,
        match=(
            r"^paper/fig05: methods: unknown method "
            r"'lagrange/tayler', perhaps"
        ),
    ):
        selected_methods([paper("fig05").replace(methods=["lagrange/tayler"])])


CHOOSE_THEIR_STEP, IMPLICIT = (
    ("lagrange/taylor", "exudyn_tree/dopri5"),
    ("lagrange/taylor", "lagrange/radau"),
)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("bearing-1e8", CHOOSE_THEIR_STEP),
        ("slow-rotor", CHOOSE_THEIR_STEP),
        ("one-blade-stiff", CHOOSE_THEIR_STEP),
        # Overdamped: no fixed step of Exudyn's stays within its bound on all of them.
        ("bearing-1e8-damping-100", IMPLICIT),
        ("shaft-damping", IMPLICIT),
    ],
)
def test_stiff_scenes_get_methods_that_stay_within_their_bounds(
    name: str, expected: tuple[str, ...]
) -> None:
    methods, reason = recommend(shipped(f"stiff/{name}"), DEFAULT_METHODS)
    assert methods == expected
    assert "\n" not in reason


# No method at all: rates that overflow when squared, and 7.9e6 s of simulated time within the
# suite's time limit.
_NOTHING_HOLDS = ("extreme/rate-1e200", "extreme/pendulum-million")
_QUICK = ("stiff/bearing-1e8-damping-0.7", "extreme/light-1e-4")


def installed(names: Iterable[str]) -> list[str]:
    """Those of the methods that are installed; the test is skipped where none is."""
    able = [name for name in names if find_method(name).is_installed]
    if not able:
        pytest.skip("none of the methods is installed")
    return able


def _mark_of(number: int, name: str) -> Any:
    """Of scenes that differ in one number every third; all of them, and an hour of chaos, every
    night."""
    if name in _QUICK:
        return ()
    return pytest.mark.nightly if name == "extreme/hour-chaos" or number % 3 else pytest.mark.full


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(given.name, marks=_mark_of(number, given.name))
        for number, given in enumerate(find_scenes(["stiff", "extreme"]))
    ],
)
def test_what_the_rule_takes_holds(name: str) -> None:
    """Every method that claims to be right, at its default settings, against the frozen
    reference."""
    chosen = shipped(name)
    if singular_reason(chosen) or name in _NOTHING_HOLDS:
        pytest.skip("refused, or beyond every method")
    # for an hour, in samples of 10 s: only the energy is known
    is_chaos = name == "extreme/hour-chaos"
    stored = None if is_chaos else reference(name)
    for method in installed(recommend(chosen, DEFAULT_METHODS)[0]):
        if is_corrected(method):
            result = solve(method, chosen, {}, time_limit_s=120.0)
            verdict = judge(chosen, result, stored)
            assert verdict.status == ("unchecked" if is_chaos else "ok"), (
                f"{method}: {verdict.message}"
            )


@pytest.mark.parametrize(
    "changes",
    [{"hub_inertia": 1e-6}, {"bearing_stiffness": (1e6,)}],
    ids=["with a hub", "held by a spring"],
)
def test_one_blade_is_taken_where_it_does_not_end(changes: dict[str, object]) -> None:
    assert recommend(replace(shipped("extreme/singular-one-blade"), **changes), DEFAULT_METHODS)[0]


@pytest.mark.parametrize(
    ("inertia", "hub", "refused"), [(0.0, 0.0, True), (4.0, 0.0, False), (0.0, 4.0, False)]
)
def test_balanced_blades_turn_by_themselves_or_with_the_hub(
    inertia: float, hub: float, refused: bool
) -> None:
    """Centres of mass on the shaft: no gravity, no length and no arm; without any inertia no
    equations either."""
    blade = replace(
        paper("fig05").blades[0],
        centre_of_mass=(0.0, 0.0, 0.0),
        inertia=(inertia,) * 3 + (0.0,) * 3,
    )
    balanced = replace(
        paper("fig05"),
        name="balanced",
        blades=(blade,) * 2,
        initial_angles=(0.0,) * 3,
        initial_rates=(1.0, 0.0, 0.0),
        hub_inertia=hub,
        duration=1.0,
        samples=3,
        outputs=("angles",),
        text="",
    )
    if refused:
        with pytest.raises(MethodRefusal, match="no inertia about the shaft"):
            recommend(balanced, DEFAULT_METHODS)
        return
    for method in installed(recommend(balanced, DEFAULT_METHODS)[0]):
        if not method.startswith("printed"):
            run = solve(method, balanced, {})
            # at constant rate; Newton's tolerance leaves the chain 5e-9
            assert abs(run.angles[-1, 0] - 1.0) < 1e-6
            assert judge(balanced, run, None).status in ("ok", "unchecked")


# The catalogue: unknown names, facts of the built-in methods, methods of other packages

GROUP = "rotor_mbs.methods"
MADE_UP = (Path(__file__).parents[1] / "extension" / "rotor_rk4.py").read_text()
MADE_UP += """
TAKEN = Method(name="lagrange/taylor", label="x", build=Solver, items=items)
"""


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder on sys.path for packages that a test installs."""
    monkeypatch.syspath_prepend(tmp_path)
    forget_what_is_installed()
    yield tmp_path
    forget_what_is_installed()
    sys.modules.pop("made_up", None)


def test_an_unknown_name_is_refused_with_the_nearest_one() -> None:
    for name, nearest in (("rk67", ", perhaps exudyn_tree/rk67;"), ("foo/bar", ";")):
        with pytest.raises(InputError) as caught:
            find_method(name)
        (line,) = caught.value.problems
        assert line.startswith(f"unknown method {name!r}{nearest} allowed: ")
        assert line.endswith("allowed: " + ", ".join(method.name for method in methods()))
    with pytest.raises(InputError, match="unknown method 'reference'"):
        # it is computed for every scene, and not asked for by name
        catalogue.check_names(["reference"])


def test_facts_of_the_built_in_methods_agree_with_each_other() -> None:
    assert len({method.name for method in methods()}) == len(methods())
    for method in methods():
        assert (method.order is not None) == method.fixed_step == ("step" in method.defaults)
        assert method.is_corrected == bool(method.ladders)
        assert not (method.erratum and (method.is_corrected or method.is_default))
        assert not method.fallback or find_method(method.fallback).is_corrected
    assert [*catalogue.ladders(["exudyn_tree/generalized_alpha"])] == [
        "exudyn_tree/generalized_alpha",
        "exudyn_tree/generalized_alpha_rho0.7",
        "exudyn_tree/generalized_alpha_rho1.0",
    ]


def test_plug_ins_that_cannot_be_used_are_left_out_with_one_line_each(
    site: Path, caplog: pytest.LogCaptureFixture
) -> None:
    entry_points = {
        "a": "no_such_module:METHOD",
        "b": "made_up:MISSING",
        "c": "made_up:np",
        "d": "made_up:TAKEN",
    }
    install(site, "made_up", MADE_UP, GROUP, {**entry_points, "e": "made_up:METHOD"})
    install(site, "own_exit", "raise SystemExit(3)\n", GROUP, {"x": "own_exit:X"})
    assert "outside/rk4" in {method.name for method in methods()}
    assert find_method("outside/rk4").distributions == ("made_up",)
    assert sorted(record.getMessage().partition(" omitted")[0] for record in caplog.records) == [
        "plug-in a of no_such_module:METHOD",
        "plug-in b of made_up:MISSING",
        "plug-in c of made_up:np",
        "plug-in d of made_up:TAKEN: method lagrange/taylor",
        "plug-in x of own_exit:X",
    ]
    assert "omitted: SystemExit: 3" in caplog.text


def test_reading_a_built_in_method_imports_no_plug_in(site: Path) -> None:
    install(site, "made_up", "raise SystemExit('imported')", GROUP, {"own": "made_up:METHOD"})
    assert find_method("exudyn_tree/rk67").label
