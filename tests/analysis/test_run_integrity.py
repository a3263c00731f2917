"""Copies, settings and steps, of constructed runs."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from support.scenes import paper
from support.stored import Arrays

from rotor_mbs.analysis.checks import copies, same_settings, settings_faults, steps_off
from rotor_mbs.methods.catalogue import find_method, look_up
from rotor_mbs.scenario.accuracy_bounds import expected_settings

TIME = np.linspace(0.0, 3.0, 100)
BENT = np.sin(TIME)[:, None] * [1.0, 2.0]


@pytest.mark.parametrize(
    ("names", "arrays", "found"),
    [
        (("a", "b"), (BENT, BENT), 2),
        (("a", "b"), (BENT, BENT[:, ::-1]), 0),
        (("a", "b"), (BENT[1:], BENT[1:]), 0),  # too few rows
        (("a/ode45", "b/ode45"), (BENT, BENT), 0),
        (("a/ode45", "b"), (BENT, BENT), 2),
        (("a", "b"), (BENT, BENT * [0.0, 1.0]), 1),
        (("a", "b"), (5.0 + 2.0 * TIME[:, None],) * 2, 0),
        (("a", "b"), (1.0 + 1.3e-9 * BENT,) * 2, 2),  # bent by 1.2e-12 and 2.4e-12 of its size
        (("a", "b"), (1.0 + 0.8e-9 * BENT,) * 2, 1),
    ],
)
def test_equal_bits_of_a_bent_column_are_a_copy(names: Any, arrays: Any, found: int) -> None:
    runs = {name: Arrays(name, angles=angles) for name, angles in zip(names, arrays, strict=True)}
    scene: Any = SimpleNamespace(runs=runs)
    told = list(copies(scene))
    assert len(told) == found
    assert all((run, other) == (runs[names[1]], names[0]) for run, other, _ in told)


def test_a_run_without_angles_is_no_copy() -> None:
    scene: Any = SimpleNamespace(runs={name: Arrays(name, rates=BENT) for name in ("a", "b")})
    assert [place for _, _, place in copies(scene)] == ["rates 0", "rates 1"]


def test_settings_are_all_of_the_methods_and_none_else() -> None:
    def faults(method: str, **settings: object) -> list[str]:
        one: Any = Arrays(method, settings=settings)
        return settings_faults(one)

    assert faults("exudyn_tree/rk44", step=1e-3) == []
    assert faults("exudyn_tree/rk44") == ["step is missing"]
    assert len(faults("exudyn_tree/rk44", step=-1.0, stride=2)) == 1
    assert len(faults("exudyn_chain/extrapolated", tolerance=0.011)) == 1  # coarser than what is called ok
    alpha = "exudyn_tree/generalized_alpha"  # which a spectral radius above 1 makes unstable
    assert len(faults(alpha, **{**find_method(alpha).defaults, "spectral_radius": 1.1})) == 1
    assert faults("of/another", step=-1.0) == []  # a plug-in that is not installed


def off(method: str, steps: int | None, name: str = "", rows: int = 11, **settings: object) -> float | None:
    """Of 1 s in ten intervals."""
    known = look_up(method)
    run: Any = Arrays(
        method, attributes={"steps": steps} if steps is not None else {}, time=np.zeros(rows),
        settings={**(known.defaults if known else {}), **settings},
    )  # fmt: skip
    found = steps_off(paper("fig11", duration=1.0, samples=11), run, name)
    return found[0] if found else None


def test_steps_are_those_that_fit_between_samples() -> None:
    assert off("exudyn_tree/rk44", 40, step=0.03) == 0.0  # four of at most 0.03 s in 0.1 s
    assert off("exudyn_tree/rk44", 100, step=0.01) == 0.0  # 0.1 s is ten of 0.01 s, whatever its rounding
    assert off("exudyn_tree/rk44", 30, step=0.0333333333333333) == 0.0  # nor a third's, in 15 digits
    assert off("exudyn_tree/rk44", 20, step=0.0999) == 0.0  # two of at most 0.0999 s
    assert off("exudyn_tree/rk44", 50, step=0.03) == pytest.approx(0.25)
    assert off("exudyn_tree/rk44", 20, step=0.03) == pytest.approx(0.5)
    for unknown in (
        off("exudyn_tree/rk44", None, step=0.03),
        off("exudyn_tree/rk44", 50, step=0.03, rows=10),  # it stopped early
        off("of/another", 50, step=0.03),
        off("exudyn_tree/dopri5", 10, step=0.03),  # no setting of a method that chooses its own
        off("lagrange/taylor", 50, "paper/none"),
    ):
        assert unknown is None


def test_steps_of_an_adaptive_method_are_those_on_file() -> None:
    name, steps = next(iter(expected_settings()["lagrange/ode45"]["steps"].items()))
    assert off("lagrange/ode45", steps, name) == 0.0
    assert off("lagrange/ode45", 2 * steps, name) == 1.0
    assert off("lagrange/ode45", steps, name, relative_tolerance=1e-3) is None


def test_defaults_are_the_settings_that_the_bounds_were_found_with() -> None:
    for name, known in expected_settings().items():
        assert same_settings(find_method(name).defaults, known["settings"]), name
