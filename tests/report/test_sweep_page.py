"""What a sweep's page shows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.sweeps import made_sweep

from rotor_mbs.report.canvas import Panels
from rotor_mbs.report.elements import Section
from rotor_mbs.report.pages import sweep
from rotor_mbs.report.pages.sweep import _edges, response, sweep_page
from rotor_mbs.runs.pool import SerialPool
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.scenario.sweep import load_sweep
from rotor_mbs.studies.sweep import plan_sweep, run_sweep


def test_a_sweep_shows_the_pitch_over_what_was_varied(tmp_path: Path) -> None:
    output = made_sweep(
        tmp_path,
        'title = "t"\nscene = "paper/fig08"\nsamples = 11\noutputs = []\nmethods = ["lagrange/dop853"]\n'
        'change = { "initial.angles[1]" = 0.2 }\n[[axis]]\nkey = "bearing.stiffness"\nvalues = [1e2, 1e4, 1e6]\n',
    )
    dataset = StoredSweep(output)
    page = sweep_page(dataset)
    section = page["plots"]
    assert isinstance(section, Section)
    (shown,) = section.pictures
    assert "bearing stiffness" in shown.caption
    stiffness, pitch = dataset.column("bearing_stiffness"), dataset.column("pitch_max")
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


@pytest.mark.parametrize(("part", "rows"), [((1, 1), 3), ((1, 4), 2), ((2, 3), 1)])
def test_the_map_of_a_grid_has_each_run_at_its_own_values(
    part: tuple[int, int], rows: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the order of the values, by the first method, also of a part that ends within a row."""
    (tmp_path / "s.toml").write_text(
        'title = "t"\nscene = "paper/fig08"\nsamples = 3\noutputs = []\nchange = { duration = 0.5 }\n'
        'methods = ["lagrange/dop853", "lagrange/ode45"]\n[[axis]]\nkey = "bearing.stiffness"\n'
        'values = [1e4, 0, 2e3]\n[[axis]]\nkey = "initial.angles[1]"\nvalues = [0.3, 0.1, 0.2]\n'
    )
    run_sweep(plan_sweep(load_sweep(tmp_path / "s.toml"), part=part), tmp_path / "s.h5", SerialPool())
    shown: list[tuple[Panels, str]] = []
    monkeypatch.setattr(sweep, "picture", lambda panel, _, caption: shown.append((panel, caption)))
    stored = StoredSweep(tmp_path / "s.h5")
    sweep_page(stored)
    if rows == 1:  # of each method: no map
        assert all(" over the " in caption for _, caption in shown)
        return
    ((panel, caption),) = shown
    assert caption.endswith(", by lagrange/dop853")
    (mesh,) = panel.axes[0].collections
    corners, cells = mesh.get_coordinates(), np.ma.filled(mesh.get_array(), np.nan)
    columns = [stored.column(name)[:9] for name in ("initial_angles_1", "bearing_stiffness", "pitch_max")]
    for x, y, value in zip(*columns, strict=True):
        inside = (corners[:-1, :-1] < (x, y)).all(axis=2) & (corners[1:, 1:] > (x, y)).all(axis=2)
        assert cells[inside].tolist() == [value]
    assert np.isfinite(cells).sum() == len(columns[0])
