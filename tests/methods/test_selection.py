"""The rule that takes a method where none is named: what it takes, what it refuses, and why in one line."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.references import reference, scene
from support.scenes import PAPER, paper

from rotor_mbs.analysis.judgement import judge
from rotor_mbs.errors import InputError, MethodRefusal
from rotor_mbs.methods.catalogue import (
    choose,
    is_corrected,
    methods,
    selected_methods,
    singular_reason,
)
from rotor_mbs.methods.solve import solve
from rotor_mbs.scenario.catalogue import find_scenes

DEFAULT_METHODS = tuple(method.name for method in methods() if method.is_default)


def test_scenes_of_the_paper_keep_the_default_set() -> None:
    for name in PAPER:
        methods, reason = choose(paper(name), DEFAULT_METHODS)
        assert methods[0] == "lagrange/taylor"  # not the printed model, which comes first in the paper's comparison
        assert set(methods) == set(DEFAULT_METHODS), name
        assert reason.startswith("not stiff, nearly singular or long")


def test_an_unknown_method_of_a_scene_is_named_with_the_scene() -> None:
    with pytest.raises(InputError, match=r"^paper/fig05: methods: unknown method 'lagrange/tayler', perhaps"):
        selected_methods([paper("fig05").replace(methods=["lagrange/tayler"])])


CHOOSE_THEIR_STEP, IMPLICIT = ("lagrange/taylor", "exudyn_tree/dopri5"), ("lagrange/taylor", "lagrange/radau")


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
def test_stiff_scenes_get_methods_that_stay_within_their_bounds(name: str, expected: tuple[str, ...]) -> None:
    methods, reason = choose(scene(f"stiff/{name}"), DEFAULT_METHODS)
    assert methods == expected
    assert "\n" not in reason


# No method at all: rates that overflow when squared, and 7.9e6 s of simulated time within the suite's time limit.
_NOTHING_HOLDS = ("extreme/rate-1e200", "extreme/pendulum-million")
_QUICK = ("stiff/bearing-1e8-damping-0.7", "extreme/light-1e-4")


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(given.name, marks=() if given.name in _QUICK else pytest.mark.full)
        for given in find_scenes(["stiff", "extreme"])
    ],
)
def test_what_the_rule_takes_holds(name: str) -> None:
    """Every method that claims to be right, at its default settings, against the frozen reference."""
    chosen = scene(name)
    if singular_reason(chosen) or name in _NOTHING_HOLDS:
        pytest.skip("refused, or beyond every method")
    is_chaos = name == "extreme/hour-chaos"  # for an hour, in samples of 10 s: only the energy is known
    stored = None if is_chaos else reference(name)
    for method in choose(chosen, DEFAULT_METHODS)[0]:
        if is_corrected(method):
            result = solve(method, chosen, {}, time_limit_s=120.0)
            verdict = judge(chosen, result, stored)
            assert verdict.status == ("unchecked" if is_chaos else "ok"), f"{method}: {verdict.message}"


@pytest.mark.parametrize(
    "changes", [{"hub_inertia": 1e-6}, {"bearing_stiffness": (1e6,)}], ids=["with a hub", "held by a spring"]
)
def test_one_blade_is_taken_where_it_does_not_end(changes: dict[str, object]) -> None:
    assert choose(replace(scene("extreme/singular-one-blade"), **changes), DEFAULT_METHODS)[0]


@pytest.mark.parametrize(("inertia", "hub", "refused"), [(0.0, 0.0, True), (4.0, 0.0, False), (0.0, 4.0, False)])
def test_balanced_blades_turn_by_themselves_or_with_the_hub(inertia: float, hub: float, refused: bool) -> None:
    """Centres of mass on the shaft: no gravity, no length and no arm; without any inertia no equations either."""
    blade = replace(paper("fig05").blades[0], centre_of_mass=(0.0, 0.0, 0.0), inertia=(inertia,) * 3 + (0.0,) * 3)
    balanced = replace(
        paper("fig05"), name="balanced", blades=(blade,) * 2, initial_angles=(0.0,) * 3, initial_rates=(1.0, 0.0, 0.0),
        hub_inertia=hub, duration=1.0, samples=3, outputs=("angles",), text="",
    )  # fmt: skip
    if refused:
        with pytest.raises(MethodRefusal, match="no inertia about the shaft"):
            choose(balanced, DEFAULT_METHODS)
        return
    for method in choose(balanced, DEFAULT_METHODS)[0]:
        if not method.startswith("printed"):
            run = solve(method, balanced, {})
            assert abs(run.angles[-1, 0] - 1.0) < 1e-6  # at constant rate; Newton's tolerance leaves the chain 5e-9
            assert judge(balanced, run, None).status in ("ok", "unchecked")
