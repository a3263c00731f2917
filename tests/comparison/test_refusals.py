"""Data and mappings that cannot be compared, and the reason that the message must have."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.scenes import paper

from rotor_mbs.comparison.data import load_data
from rotor_mbs.errors import InputError

SCENE = paper("fig11", duration=1.0, samples=11)
LABELS = [label.replace(" ", "_") for label in SCENE.coordinate_labels]
TIME = np.linspace(0.0, 1.0, 11)
ANGLES = {label: np.sin(TIME + i) for i, label in enumerate(LABELS)}

REFUSALS: dict[str, tuple[dict[str, Any], dict[str, Any], str]] = {
    "other names than OpenFAST's": (
        {"time": TIME, **ANGLES},
        {"program": "openfast"},
        'data: program = "openfast" reads the names of OpenFAST\'s output alone; '
        "allowed: leave `program` out",
    ),
    "another name of the time than OpenFAST's": (
        {"t": TIME, "Azimuth": TIME},
        {"program": "openfast"},
        'data: program = "openfast" reads the names of OpenFAST\'s output alone; '
        "allowed: leave `program` out",
    ),
    "omit and only": (
        {"time": TIME, **ANGLES},
        {"omit": ["rotor"], "only": ["rotor"]},
        "data: `omit` and `only` leave no angle or rate; allowed: one of " + ", ".join(LABELS),
    ),
    "only loads": (
        {"time": TIME, "rotor": TIME, "shaft_force": np.ones((11, 3))},
        {"only": ["shaft_force"]},
        "data: `only` leaves no angle or rate; allowed: one of rotor",
    ),
    "too few angles": (
        {"time": TIME, "angles": np.ones((11, 2))},
        {},
        "data: `angles` has 2 columns, the scene has 4 coordinates; allowed: as many, rotor first",
    ),
    "one column of rates": (
        {"time": TIME, "qd": TIME},
        {},
        "data: `qd` has 1 column, the scene has 4 coordinates; allowed: as many, rotor first",
    ),
    "unknown names": (
        {"time": TIME, "a": TIME},
        {"omit": ["pitch_3"]},
        "data: no column for an angle or a rate; available: time, a; "
        "allowed: a mapping file (--columns) with `rotor` or others",
    ),
}


@pytest.mark.parametrize("name", REFUSALS)
def test_the_message_has_the_reason(name: str) -> None:
    data, mapping, message = REFUSALS[name]
    with pytest.raises(InputError) as caught:
        load_data(data, SCENE, mapping or None)
    assert str(caught.value) == message


def test_an_array_of_another_length_beside_angles_is_unused_with_the_reason() -> None:
    data = load_data({"time": TIME, **ANGLES, "rates": np.ones((11, 2))}, SCENE)
    assert data.unused["rates[0]"] == "`rates` has 2 columns, the scene has 4 coordinates"
