"""Long data are searched on windows of their rows first: their mistakes are named all the same."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from support import mistaken_data
from support.mistaken_data import Data

import rotor_mbs as rm

ROWS = 4001  # more than the windows have together


def filtered_rotor_rate(data: Data) -> None:
    assert data.rates is not None
    alone = Data(data.time, data.rates[:, :1], None)
    mistaken_data.lag(0.02)(alone)


def limited_pitch(data: Data) -> None:
    """The limit is reached in the last quarter alone."""
    mistaken_data.clip(1, float(np.quantile(data.angles[:, 1], 0.75)), np.inf)(data)


MISTAKES: dict[str, tuple[Callable[[Data], Data | None], str]] = {
    "filter": (filtered_rotor_rate, "rotor rate: smoothed by a filter of first order"),
    "limit": (limited_pitch, "pitch 1: limited to at least"),
    "held": (mistaken_data.hold_rates(7), "every number is held for 7 rows"),
    "late": (mistaken_data.late_channel("angles", 2), "pitch 2: a row late"),
    "clock": (mistaken_data.clock(1.001), "a clock that is 0.1 % fast"),
    "exchanged": (mistaken_data.swap("angles", 1, 2), "columns exchanged: pitch 1 is pitch 2"),
}


@pytest.mark.full
@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_in_long_data_is_named(name: str) -> None:
    scene = rm.scene("paper/fig11").replace(duration=2.0, samples=ROWS)
    run = rm.run(scene, "lagrange/taylor")
    export, text = MISTAKES[name]
    data = Data(run.time, run.angles.copy(), run.rates.copy())
    data = export(data) or data
    found = rm.compare({"time": data.time, "angles": data.angles, "rates": data.rates}, scene)
    assert len(found.likely) == 1
    assert text in found.likely[0]
