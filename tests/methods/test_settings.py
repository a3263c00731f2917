"""Settings of methods: what is refused, for every method, and that the message says what is
allowed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from rotor_mbs.errors import InputError
from rotor_mbs.methods.base import Method
from rotor_mbs.methods.catalogue import find_method, methods
from rotor_mbs.methods.selection import settings_for
from rotor_mbs.methods.settings import Settings, choice, number

ALL = [*methods(), find_method("reference")]
NUMBERS = [
    pytest.param(method, name, id=f"{method.name}-{name}")
    for method in ALL
    for name, setting in method.settings.declared().items()
    if not setting["kind"].options
]


def refused(method: Method, **given: object) -> str:
    with pytest.raises(InputError) as caught:
        method.settings.of(method.name, given)
    (line,) = caught.value.problems
    assert "\n" not in line
    assert line.startswith(f"{method.name}: ")
    assert all(
        f"{name} (" in line and f"default {value}" in line
        for name, value in method.defaults.items()
    )
    return line


@pytest.mark.parametrize("method", ALL, ids=lambda method: method.name)
def test_an_unknown_setting_is_refused_with_the_list_of_settings(method: Method) -> None:
    assert "no setting 'tolerence'" in refused(method, tolerence=1e-3)
    assert "rotor-mbs new FILE --from SCENE" in refused(method, **{"blade.mass": 1e4})
    assert "relative_tolerance" in refused(method, relative_tolerance=-1)


@pytest.mark.parametrize(
    "value", [-1, math.nan, math.inf, "1e-3", True, np.array([1e-3])], ids=repr
)
@pytest.mark.parametrize(("method", "name"), NUMBERS)
def test_an_impossible_value_is_refused(method: Method, name: str, value: object) -> None:
    assert f"{name} = " in refused(method, **{name: value})


@pytest.mark.parametrize("method", ALL, ids=lambda method: method.name)
def test_defaults_and_the_settings_of_every_ladder_are_allowed(method: Method) -> None:
    assert method.settings.of(method.name, method.defaults).as_dict() == method.defaults
    assert all(len(ladder.settings_by_value(0.1)) >= 6 for ladder in method.ladders)
    given = [
        settings for ladder in method.ladders for settings in ladder.settings_by_value(0.1).values()
    ]
    for settings in given:
        assert method.settings.of(method.name, settings).as_dict() == {
            **method.defaults,
            **settings,
        }
    assert all(setting["doc"] for setting in method.settings.declared().values())


def test_the_range_of_scipys_tolerance_starts_where_scipy_would_change_it() -> None:
    least = 100.0 * float(np.finfo(float).eps)
    for name in ("lagrange/dop853", "lagrange/radau"):
        settings = find_method(name).settings
        assert (
            settings.of(name, {"relative_tolerance": least}).as_dict()["relative_tolerance"]
            == least
        )
        assert "at least 2.22045e-14" in refused(find_method(name), relative_tolerance=0.99 * least)


@dataclass(frozen=True)
class Own(Settings):
    stages: int = number(4, at_least=1, at_most=8, doc="stages")
    step: float = number(0.1, unit="s", above=0.0, doc="time step")
    scheme: str = choice("a", ("a", "b"), doc="scheme")


def test_numbers_are_converted_to_the_declared_type() -> None:
    result = Own.of("own", {"stages": 3.0, "step": np.float32(0.5), "scheme": "b"})
    assert result == Own(3, 0.5, "b")
    assert [type(value) for value in result.as_dict().values()] == [int, float, str]


def test_settings_go_to_the_methods_that_have_them() -> None:
    names = ["lagrange/taylor", "exudyn_tree/rk67"]
    assert settings_for(names, {"step": 1e-3}) == {
        "lagrange/taylor": {},
        "exudyn_tree/rk67": {"step": 1e-3},
    }
    with pytest.raises(
        InputError,
        match=(
            r"no setting 'stp', perhaps step; allowed: .*lagrange/taylor, "
            r"exudyn_tree/rk67"
        ),
    ):
        settings_for(names, {"stp": 1e-3})
    with pytest.raises(InputError, match=r"step = -1 is not allowed"):
        settings_for(names, {"step": -1})
