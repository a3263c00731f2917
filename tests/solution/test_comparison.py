"""What a status was found by, and to which time, as it is told beside it."""

from __future__ import annotations

from typing import Any

import pytest

from rotor_mbs.solution.status import comparison

DESIGN_COLUMNS = {
    "defect_max": 3e-9,
    "defect_excess": 2e-9,
    "defect_allowed": 5e-9,
    "horizon_s": 3.03,
}


@pytest.mark.parametrize(
    ("metrics", "expected"),
    [
        ({}, ("", "", "", "")),
        (
            DESIGN_COLUMNS | {"angle_error_max": 1e-4},
            ("2.0e-09", "5.0e-09", "1.0e-04", "3.03 of 10 s"),
        ),
        (
            DESIGN_COLUMNS | {"angle_error_predicted": 1e-4},
            ("2.0e-09", "5.0e-09", "1.0e-04 predicted", "3.03 of 10 s"),
        ),
        (DESIGN_COLUMNS | {"defect_excess": 0.0}, ("3.0e-09", "rounding", "", "")),
        # of the printed equations nothing is allowed or forbidden
        ({"defect_max": 0.5}, ("5.0e-01", "", "", "")),
    ],
)
def test_defect_and_what_is_allowed_error_and_until_when(
    metrics: dict[str, Any], expected: tuple[str, ...]
) -> None:
    assert comparison(metrics, 10.0) == expected
