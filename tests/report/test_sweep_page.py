"""What a sweep's page shows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.sweeps import made_sweep

from rotor_mbs.report.elements import Section
from rotor_mbs.report.pages.sweep import _edges, response, sweep_page
from rotor_mbs.runs.sweeps import StoredSweep


def test_a_sweep_shows_the_pitch_over_what_was_varied(tmp_path: Path) -> None:
    output = made_sweep(
        tmp_path,
        'title = "t"\nscene = "paper/fig08"\nsamples = 11\noutputs = []\nmethods = ["lagrange/dop853"]\n'
        'change = { "initial.angles[1]" = 0.2 }\n[[axis]]\nkey = "bearing.stiffness"\nvalues = [1e2, 1e4, 1e6]\n',
    )
    sweep = StoredSweep(output)
    page = sweep_page(sweep)
    section = page["plots"]
    assert isinstance(section, Section)
    (shown,) = section.pictures
    assert "bearing stiffness" in shown.caption
    stiffness, pitch = sweep.column("bearing_stiffness"), sweep.column("pitch_max")
    (axes,) = response(stiffness, pitch, "k (N m/rad)", "largest pitch (rad)").axes
    (points,) = axes.get_lines()
    np.testing.assert_array_equal(points.get_xydata(), np.column_stack([stiffness, pitch]))
    assert (axes.get_xscale(), axes.get_ylabel()) == ("log", "largest pitch (rad)")
    results = page["results"]
    assert isinstance(results, Section)
    (row,) = (row for row in results.tables[0].rows if row[1] == "pitch_max")
    assert [float(str(cell)) for cell in row[2:]] == pytest.approx(
        np.quantile(pitch, (0, 0.05, 0.5, 0.95, 1)), rel=1e-5
    )
    for values, edges in (
        ([0.0, 10.0, 20.0], [-5, 5, 15, 25]),
        ([1.0, 10.0, 100.0], [0.1**0.5, 10**0.5, 1e3**0.5, 1e5**0.5]),
    ):
        np.testing.assert_allclose(_edges(np.array(values))[0], edges)  # no cell is cut off
