"""Methods of other people that return something of a wrong type, and the line that says so."""

from __future__ import annotations

import inspect
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.scenes import paper

from rotor_mbs.errors import InputError, RotorError
from rotor_mbs.methods.base import Method
from rotor_mbs.methods.method_file import MethodFile
from rotor_mbs.methods.solve import solve
from rotor_mbs.solution.trajectory import Integration, Trajectory

SCENE = paper("fig03", samples=3)
ANGLES = np.zeros((3, 1 + len(SCENE.blades)))


class Solver:
    """Returns what it is given."""

    def __init__(self, report: Any, samples: Any) -> None:
        self.report, self.samples = report, samples

    def integrate(self) -> Any:
        return self.report

    def observe(self) -> Any:
        return self.samples


def _samples(**arrays: Any) -> Trajectory:
    wanted: dict[str, Any] = {"time": np.linspace(0.0, 10.0, 3), "angles": ANGLES, "rates": ANGLES}
    return Trajectory(**(wanted | arrays))


RIGHT = Integration(True)
WRONG: dict[str, tuple[Any, str]] = {
    "nothing built": (None, "build returned None; allowed: an object with integrate and observe"),
    "no observe": (1.0, "build returned an object without integrate and observe; allowed: "),
    "no report": (Solver(None, _samples()), "integrate returned None; allowed: "),
    "a flag": (Solver(True, _samples()), "integrate returned an object of type bool; allowed: "),
    "a report of text": (
        Solver(Integration("ok"), _samples()),  # type: ignore[arg-type]
        "Integration: success = 'ok'; allowed: True or False",
    ),
    "no samples": (Solver(RIGHT, None), "observe returned None; allowed: "),
    "a pair": (Solver(RIGHT, (1, 2)), "observe returned an object of type tuple; allowed: "),
    "lists": (Solver(RIGHT, _samples(angles=[[0.0]])), "angles is list; allowed: "),
    "complex": (Solver(RIGHT, _samples(rates=1j * ANGLES)), "rates is ndarray of complex128; "),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_method_that_returns_another_type_is_one_line(name: str) -> None:
    built, message = WRONG[name]

    def build(_scene: object, _settings: object) -> Any:
        return built

    method = Method(name="mine/m", label="mine, m", build=build)
    with pytest.raises(RotorError) as caught:
        solve(method, SCENE, {})
    assert message in str(caught.value)
    assert "Error" not in str(caught.value)
    places = {"build": build, "integrate": Solver.integrate, "observe": Solver.observe}
    function = places.get(message.partition(" ")[0])
    if function is not None:
        line = inspect.getsourcelines(function)[1]
        assert str(caught.value).startswith(f"{__file__}:{line}: ")


@pytest.mark.parametrize(
    "change",
    [
        {"name": 3},
        {"label": None},
        {"build": 3},
        {"settings": dict},
        {"ladders": 3},
        {"bounds": (1,)},
        {"order": "4"},
        {"solve_many": 1},
        {"arrays": "energy"},
    ],
)
def test_a_method_with_an_attribute_of_another_type_is_not_loaded(
    change: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    method = replace(Method(name="m", label="m", build=lambda *_: None), **change)
    file = MethodFile("mine.py", "")
    monkeypatch.setattr(MethodFile, "defined", lambda *_: [method])
    (name,) = change
    with pytest.raises(InputError, match=rf"^mine\.py: Method .*: {name} = .*; allowed: "):
        file.load([])
