"""The page of a sweep: counts, the map, the curves of its cells, numbers over the parameters, runs
that are not ok."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from support.report_pages import (
    answer_of,
    facts_of,
    plots_of,
    rows_of,
    section_of,
    sections_of,
    text_of,
    words_of,
)
from support.sweeps import made_sweep

from rotor_mbs.errors import PlausibilityWarning
from rotor_mbs.processes.pool import SerialPool
from rotor_mbs.report.build import write_report
from rotor_mbs.report.elements import HeatMap
from rotor_mbs.report.pages import sweep as page_of
from rotor_mbs.report.pages.sweep import _Sweep, chosen_runs, explained, sweep_page
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.scenario.sweep import load_sweep
from rotor_mbs.studies.sweep import plan_sweep, run_sweep

HEAD = (
    'title = "t"\nscene = "paper/fig08"\nsamples = 11\nmethods = ["lagrange/dop853"]\n'
    'change = { "initial.angles[1]" = 0.2, duration = 2 }\n'
)
GRID = HEAD + (
    'outputs = ["angles", "rates"]\n[[axis]]\nkey = "bearing.stiffness"\nvalues = [0, 1e3, 1e5]\n'
    '[[axis]]\nkey = "bearing.damping"\nvalues = [0, 1e2]\n'
)


@pytest.fixture(scope="module")
def grid(tmp_path_factory: pytest.TempPathFactory) -> tuple[StoredSweep, str]:
    """A sweep of a grid of two parameters, and its page."""
    folder = tmp_path_factory.mktemp("sweep")
    path = made_sweep(folder, GRID)
    return StoredSweep(path), text_of(write_report(path, folder / "out").parent)


def data_of(text: str) -> dict:  # type: ignore[type-arg]
    """What the map's script has."""
    found = re.search(r'<script type="application/json" id="sweep">(.*?)</script>', text, re.S)
    assert found is not None
    return dict(json.loads(found[1]))


def test_a_sweep_opens_with_counts_and_what_its_parameters_do(
    grid: tuple[StoredSweep, str],
) -> None:
    stored, text = grid
    assert sections_of(text)[:2] == ["map", "slices"]
    assert answer_of(text).startswith("All 6 runs are ok.")
    place = r"at bearing stiffness \S+ N m/rad, bearing damping \S+ N m s/rad"
    assert re.search(place, answer_of(text))
    assert facts_of(text)["Runs that are ok"] == "6 of 6"
    assert "The axis is logarithmic: runs at 0 are in the map." in section_of(text, "slices")
    assert facts_of(text)["Bearing stiffness"] == "0 to 10⁵ N m/rad | 3 values"
    angles = np.degrees(stored.column("angles")[:, :, 1:])
    ranges = np.ptp(angles, axis=1).max(axis=1)
    low, high = facts_of(text)["Range of a pitch angle"].rstrip("°").split(" to ")
    # two digits
    assert (float(low), float(high)) == pytest.approx((ranges.min(), ranges.max()), rel=0.06)
    # A quantity without a unit is named without one.
    assert "(rad)</option>" in text
    assert "(1)</option>" not in text


def test_every_cell_of_the_map_is_the_run_of_its_row_and_column(
    grid: tuple[StoredSweep, str],
) -> None:
    stored, text = grid
    table = section_of(text, "map")
    columns = re.findall(r'<th scope="col">(.*?)</th>', table)
    assert columns == ["0", "100"]
    seen = set()
    for row, cells in re.findall(r'<tr><th scope="row">(.*?)</th>(.*?)</tr>', table, re.S):
        for column, run in zip(columns, re.findall(r'data-run="(\d+)"', cells), strict=True):
            stiffness, damping = (
                float(stored.column(name)[int(run)])
                for name in ("bearing_stiffness", "bearing_damping")
            )
            assert {"0": 0.0, "1000": 1e3, "10⁵": 1e5}[row] == stiffness
            assert {"0": 0.0, "100": 1e2}[column] == damping
            seen.add(run)
    assert len(seen) == 6
    data = data_of(text)
    names = re.findall(r'<option value="\d+">(.*?)</option>', table)
    ranges = np.ptp(np.degrees(stored.column("angles")[:, :, 1:]), axis=1).max(axis=1)
    assert data["values"][names.index("Range of a pitch angle (degrees)")] == pytest.approx(
        ranges, rel=1e-3
    )


def test_the_curves_of_a_cell_are_those_of_its_run(grid: tuple[StoredSweep, str]) -> None:
    stored, text = grid
    places = data_of(text)["places"]
    angles = stored.column("angles")
    for run in range(6):
        x, y = plots_of(text, places[run])["Pitch angle"].curves["blade 1"]
        np.testing.assert_allclose(x, stored.column("time")[()], rtol=1e-6)
        np.testing.assert_allclose(y, np.degrees(angles[run, :, 1]), rtol=1e-5, atol=1e-5)


def test_zero_has_no_place_on_a_logarithmic_axis(grid: tuple[StoredSweep, str]) -> None:
    _, text = grid
    plot = plots_of(text)["Range of a pitch angle"]
    assert plot.described["x"]["log"] is True
    low, high = plot.described["x"]["range"]
    assert 0.9e3 < low < 1e3 < 1e5 < high < 1.1e5  # with room for the halves of the dots
    for x, _ in plot.curves.values():
        assert x.tolist() == [1e3, 1e5]
    assert [*plot.curves] == ["0", "100"]  # a curve per damping, zero among them


def test_one_parameter_has_curves_over_it_and_no_map(tmp_path: Path) -> None:
    path = made_sweep(
        tmp_path,
        HEAD.replace(", duration = 2", "")
        + 'outputs = []\n[[axis]]\nkey = "bearing.stiffness"\nvalues = [1e2, 1e4, 1e6]\n',
    )
    stored = StoredSweep(path)
    text = text_of(write_report(path, tmp_path / "out").parent)
    assert 'class="heat' not in text
    plot = plots_of(text)["Largest magnitude of a pitch angle"]
    x, y = plot.curves["runs"]
    np.testing.assert_allclose(x, [1e2, 1e4, 1e6])
    np.testing.assert_allclose(y, np.degrees(stored.column("pitch_max")[()]), rtol=1e-6)


def test_a_parameter_of_the_loads_without_loads_is_said_to_change_nothing(tmp_path: Path) -> None:
    axis = '[[axis]]\nkey = "hub.mass"\nvalues = [0, 1e3]\n'
    with pytest.warns(PlausibilityWarning):
        path = made_sweep(tmp_path, HEAD + axis)
    text = text_of(write_report(path, tmp_path / "out").parent)
    assert "The hub mass changes nothing: it enters the loads alone, which are no output." in text
    path.unlink()
    path = made_sweep(tmp_path, HEAD + 'outputs = ["angles", "loads"]\n' + axis)
    text = text_of(write_report(path, tmp_path / "out").parent)
    assert "changes nothing" not in text


def test_runs_of_the_printed_equations_are_completed_and_not_ok(tmp_path: Path) -> None:
    text = HEAD.replace("lagrange/dop853", "printed/ode45") + (
        'outputs = []\n[[axis]]\nkey = "gravity"\nvalues = [9, 10]\n'
    )
    page = text_of(write_report(made_sweep(tmp_path, text), tmp_path / "out").parent)
    assert answer_of(page).startswith("All 2 runs are completed.")
    assert facts_of(page)["Runs that are completed"] == (
        "2 of 2 | nothing is claimed of the printed equations"
    )
    assert "✓" not in page
    assert not re.search(r"\bok\b", words_of(section_of(page, "runs")))


def test_runs_are_links_where_they_can_be_shown(
    grid: tuple[StoredSweep, str], tmp_path: Path
) -> None:
    text = HEAD + 'outputs = []\n[[axis]]\nkey = "gravity"\nvalues = [9, 10]\n'
    page = text_of(write_report(made_sweep(tmp_path, text), tmp_path / "out").parent)
    assert 'id="sweep"' not in page
    assert "#run-" not in page
    assert "#run-" in grid[1]


def test_what_is_shown_of_one_method_alone_says_so(tmp_path: Path) -> None:
    text = GRID.replace('["lagrange/dop853"]', '["lagrange/dop853", "lagrange/ode45"]')
    page = text_of(write_report(made_sweep(tmp_path, text), tmp_path / "out").parent)
    for section in ("map", "slices"):
        assert "By lagrange/dop853 alone." in words_of(section_of(page, section))


def test_random_draws_are_points_over_each_parameter(tmp_path: Path) -> None:
    path = made_sweep(
        tmp_path,
        HEAD + 'outputs = []\ndraws = 5\n[[axis]]\nkey = "gravity"\nuniform = [9.0, 10.0]\n'
        '[[axis]]\nkey = "bearing.stiffness"\nuniform = [1e3, 1e4]\n',
    )
    text = text_of(write_report(path, tmp_path / "out").parent)
    assert 'class="heat' not in text
    plots = re.findall(r"&#34;x&#34;:{&#34;name&#34;:&#34;(.*?)&#34;", text)
    assert {"gravity", "bearing stiffness"} == {*plots}
    assert text.count("&#34;dots&#34;:&#34;only&#34;") == len(plots)


@pytest.mark.parametrize(("part", "runs"), [((1, 1), 9), ((1, 4), 5), ((2, 3), 6)])
def test_the_map_of_a_part_of_a_grid_has_the_runs_that_are_there(
    part: tuple[int, int], runs: int, tmp_path: Path
) -> None:
    """Whatever the order of the values, by the first method, also of a part that ends within a
    row."""
    (tmp_path / "s.toml").write_text(
        'title = "t"\nscene = "paper/fig08"\nsamples = 3\noutputs = []\nchange = { duration '
        "= 0.5 }\n"
        'methods = ["lagrange/dop853", "lagrange/ode45"]\n[[axis]]\nkey = "bearing.stiffness"\n'
        'values = [1e4, 0, 2e3]\n[[axis]]\nkey = "initial.angles[1]"\nvalues = [0.3, 0.1, 0.2]\n'
    )
    run_sweep(
        plan_sweep(load_sweep(tmp_path / "s.toml"), part=part), tmp_path / "s.h5", SerialPool()
    )
    stored = StoredSweep(tmp_path / "s.h5")
    page = sweep_page(stored)
    maps = [
        part
        for section in page.sections
        for grid in section.elements
        for card in getattr(grid, "cards", ())
        for part in card
        if isinstance(part, HeatMap)
    ]
    (shown,) = maps
    assert "By lagrange/dop853 alone." in shown.note or "By lagrange/ode45 alone." in shown.note
    numbers = [cell[0] for line in shown.cells for cell in line if cell is not None]
    first = np.asarray(stored.column("method_code"))
    assert len(numbers) == len({*numbers}) == int((first == first[0]).sum())
    for row, line in zip(shown.rows, shown.cells, strict=True):
        for column, cell in zip(shown.columns, line, strict=True):
            if cell is not None:
                assert row == page_of.brief(float(stored.column("bearing_stiffness")[cell[0]]))
                assert column == page_of.brief(float(stored.column("initial_angles_1")[cell[0]]))
    assert runs >= len(numbers)


def test_runs_that_are_not_ok_are_grouped_by_status_and_reason_with_their_ranges(
    tmp_path: Path,
) -> None:
    """A step that is far too long for the two stiffest bearings."""
    path = made_sweep(
        tmp_path,
        'title = "t"\nscene = "paper/fig08"\nsamples = 11\nmethods = ["exudyn_tree/rk44"]\n'
        'outputs = ["angles", "rates"]\n'
        'change = { "initial.angles[1]" = 0.2, duration = 1 }\nsettings = { step = 0.05 }\n'
        '[[axis]]\nkey = "bearing.stiffness"\nvalues = [0, 1e6, 1e7]\n[[axis]]\nkey = '
        '"gravity"\nvalues = [9, 10]\n',
    )
    stored = StoredSweep(path)
    bad = np.flatnonzero(stored.column("status")[()] != 0)
    assert len(bad) >= 4
    text = text_of(write_report(path, tmp_path / "out").parent)
    good = 6 - len(bad)
    assert answer_of(text).startswith(f"{good} of 6 runs are ok")
    faults = section_of(text, "faults")
    counts = [int(cells[0]) for cells in rows_of(faults).values()]
    assert 0 < sum(counts) <= len(bad)
    assert re.search(r"10⁶( to 10⁷)?", faults)
    assert 'href="#run-' in faults
    kinds = re.findall(r'data-run="(\d+)"(?: class="(\w+)")?', section_of(text, "map"))
    assert {int(run) for run, kind in kinds if kind} == {*bad.tolist()}


def test_of_many_runs_the_curves_of_corners_faults_and_every_kth_are_kept(
    grid: tuple[StoredSweep, str],
) -> None:
    stored, _ = grid
    sweep = _Sweep(stored)
    everything = np.ones(6, bool)
    assert chosen_runs(sweep, everything, 6).tolist() == list(range(6))
    few = chosen_runs(sweep, everything, 4)
    assert len(few) <= 4
    stiffness, damping = (
        stored.column(name)[()] for name in ("bearing_stiffness", "bearing_damping")
    )
    corners = [run for run in few if stiffness[run] in (0.0, 1e5) and damping[run] in (0.0, 1e2)]
    assert len(corners) >= 2


def test_a_parameter_decides_what_varies_with_it_alone() -> None:
    x, y = (values.ravel() for values in np.meshgrid([1.0, 2.0, 3.0], [1.0, 2.0, 3.0]))
    assert explained(x**2, x) == pytest.approx(1.0)
    assert explained(x**2, y) == pytest.approx(0.0, abs=1e-12)
    assert explained(x + y, x) == pytest.approx(0.5)
    assert explained(np.full(9, 2.0), x) == 0.0


def test_ends_of_a_range_that_are_written_alike_are_one_number(tmp_path: Path) -> None:
    """A microradian more at the start changes no digit that is written."""
    sweep = HEAD + 'outputs = ["angles"]\n[[axis]]\nkey = "initial.angles[0]"\nvalues = [0, 1e-6]\n'
    path = made_sweep(tmp_path, sweep)
    text = text_of(write_report(path, tmp_path / "out").parent)
    name = "Largest magnitude of the rotor rate over the samples"
    assert re.search(rf"{name} is [\S]+ rad/s in all of them\.", answer_of(text))
    assert " to " not in facts_of(text)[name]
