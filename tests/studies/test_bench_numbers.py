"""What a diagram says in numbers, against values by hand: front, interpolation, orders, exponents,
failure rail."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from support.commands import rotor_mbs

import rotor_mbs as rm
from rotor_mbs.analysis.text_tables import bench_table
from rotor_mbs.analysis.work_precision import (
    failed,
    fastest,
    fitted_order,
    succeeded,
    time_to_reach,
)  # fmt: skip
from rotor_mbs.report.build import write_report
from rotor_mbs.report.files import render
from rotor_mbs.report.looks import look_of
from rotor_mbs.report.pages.bench import (
    bench_answer,
    bench_page,
    curve_looks,
    diagram,
    engine_tables,
    point_table,
)
from rotor_mbs.runs.design import POINT_COLUMNS
from rotor_mbs.runs.merge import fit_file_to_request
from rotor_mbs.runs.read import Record, open_results, points_table, read_records
from rotor_mbs.runs.table import TableFile
from rotor_mbs.solution.status import STATUSES


def curve(
    name: str,
    errors: list[float],
    seconds: list[float],
    statuses: list[str] | None = None,
    **attributes: object,
) -> Record:
    n = len(errors)
    statuses = statuses or ["ok"] * n
    arrays: dict[str, NDArray[np.generic]] = {
        "setting": 0.1 * 0.5 ** np.arange(n),
        "angle_error_max": np.array(errors),
        "run_time_s": np.array(seconds),
        "status": np.array([STATUSES.index(status) for status in statuses]),
        "false_success": np.array([int(status == "inaccurate") for status in statuses]),
        "repeats": np.full(n, 20),
        "steps": np.full(n, 100),
    }
    arrays |= dict.fromkeys(
        ("angle_error_end", "tip_error_max", "energy_drift_max"), np.array(errors)
    )
    arrays |= dict.fromkeys(("run_time_min_s", "run_time_q1_s", "run_time_q3_s"), np.array(seconds))
    arrays |= dict.fromkeys(
        ("setup_time_s", "setup_again_time_s", "output_time_s"), np.full(n, 0.5)
    )
    facts = {
        "method": name,
        "setting_kind": "step",
        "horizon_s": 6.0,
        "duration_s": 10.0,
        "uncertainty_rad": 1e-15,
        "samples": 101,
        "budget_s": 28.0,
        "load_before": 0.1,
        "pinned_core": 1,
        "messages": [""] * n,
        "scene_hash": "1",
    }
    return Record("bench", "paper/fig09", name, {**facts, **attributes}, arrays)


FAST = curve("lagrange/taylor", [1e-2, 1e-6, 1e-10], [1e-3, 2e-3, 4e-3])
SLOW = curve(
    "exudyn_tree/rk67",
    [np.nan, 1e-2, 1e-4, 1e-4, 3.0],
    [7e-3, 1e-2, 1e-1, 2e-1, 5e-1],
    ["timed_out", "ok", "ok", "left_out", "inaccurate"],
    messages=["ended after 10 s", "", "", "not run", "as large as the motion"],
    order=5.9,
    order_expected=6.0,
)


def test_time_to_reach_is_straight_in_the_logarithms() -> None:
    """Half way between 1e-2 and 1e-6 (in decades) lies 1e-4; between 1 s and 100 s, 10 s."""
    # the second beaten by the first
    errors, seconds = np.array([1e-2, 1e-1, 1e-6]), np.array([1.0, 50.0, 100.0])
    for target, expected in ((1e-1, 1.0), (1e-4, 10.0), (1e-6, 100.0)):
        assert time_to_reach(errors, seconds, target) == pytest.approx(expected)
    assert time_to_reach(errors, seconds, 1e-7) is None
    assert time_to_reach(np.empty(0), np.empty(0), 1e-3) is None


def test_ratios_are_to_the_fastest() -> None:
    """1e-3 lies a quarter of the way from 1e-2 to 1e-6, and half way from 1e-2 to 1e-4."""
    (first, fast), (second, slow) = fastest([SLOW, FAST], 1e-3)
    assert (first.name, second.name) == ("lagrange/taylor", "exudyn_tree/rk67")
    assert fast.seconds == pytest.approx(1e-3 * 2**0.25)
    assert slow.seconds == pytest.approx(1e-2 * 10**0.5)
    assert (fast.ratio, slow.ratio) == (1.0, pytest.approx(slow.seconds / fast.seconds))
    assert [one.name for one, _ in fastest([SLOW, FAST], 1e-6)] == ["lagrange/taylor"]
    # one cut by the budget
    cut, coarse = bench_table([SLOW, curve("mine/euler", [1e-2, 1e-4], [1.0, 10.0])]).rows
    assert cut[2:] == ("2 of 5", "1.0e-04", "3.16e-02", "not measured", "not measured")
    assert coarse == ("paper/fig09", "mine/euler", "2 of 2", "1.0e-04", "3.16e+00", "", "")


def test_a_row_for_each_engine_with_dashes_for_what_the_file_does_not_say(tmp_path: Path) -> None:
    versions = '{"python": "3.11", "code": "ab", "plug-in": "cd", "pin": "4.1.0"}'
    own = curve(
        "mine/euler",
        [1e-2, 1e-3],
        [2e-3, 8e-3],
        order=0.98,
        order_expected=1.0,
        versions=versions,
        lines=99,
        linearizes=False,
    )
    columns: list[tuple[Record, dict[str, list[float]]]] = [
        (FAST, {"defect_max": [1e-3, 1e-7, 1e-13], "zero_pitch_max": [0.0] * 3}),
        (SLOW, {"defect_max": [np.nan, 1e-3, 1e-5, 0.0, 0.0]}),
        (own, {"defect_max": [1e-4, 1e-5], "zero_pitch_max": [0.0, 0.5]}),
    ]
    curves = [
        replace(
            known,
            arrays={**known.arrays, **{name: np.array(values) for name, values in more.items()}},
        )
        for known, more in columns
    ]
    with open_results(stored(tmp_path / "a.h5", FAST)) as results:
        reached, able = engine_tables(results, {"paper/fig09": curves})

    def texts(row: Any) -> list[str]:
        return [cell if isinstance(cell, str) else cell.text for cell in row]

    assert [texts(row)[1:] for row in reached.rows] == [
        [
            "1 of 1",
            "adaptive",
            "1.0×10⁻¹³",
            "1.0×10⁻¹⁰",
            "1 of 1, × 1.0",
            "1 of 1, × 1.0",
            "1 of 1, × 1.0",
            "–",
            "kept",
            "none failed",
        ],
        [
            "1 of 1",
            "5.9 (nominal 6)",
            "≤ 1.0×10⁻⁵",
            "≤ 1.0×10⁻⁴",
            *["not measured"] * 3,
            "–",
            "–",
            "1 of 2 failed",
        ],
        [
            "1 of 1",
            "0.98 (nominal 1)",
            "1.0×10⁻⁵",
            "0.0010",
            *["0 of 1"] * 3,
            "–",
            "lost",
            "none failed",
        ],
    ]
    assert [texts(row)[1:] for row in able.rows] == [
        ["–"] * 6, ["–"] * 6, ["–", "–", "–", "no", "pin 4.1.0", "99"]
    ]  # fmt: skip


def test_a_scene_on_which_no_setting_is_useful_is_counted_beside_the_error_of_the_others(
    tmp_path: Path,
) -> None:
    useless = replace(
        FAST, arrays={**FAST.arrays, "angle_error_max": np.full(len(FAST.statuses), 2.0)}
    )
    with open_results(stored(tmp_path / "a.h5", FAST)) as results:
        reached, _ = engine_tables(results, {"paper/fig09": [FAST], "paper/fig11": [useless]})
    cell: Any = reached.rows[0][4]
    assert (cell.tone, cell.note) == ("bad", "paper/fig09; fails on 1 of 2")


@pytest.mark.parametrize("order", [2, 4, 6])
def test_orders_are_fitted_above_the_floor(order: int) -> None:
    steps = 0.1 * 0.5 ** np.arange(10)
    floor = 1e-14
    errors = np.maximum((steps / 0.2) ** order, floor * (1.0 + 0.3 * np.arange(10)))
    assert fitted_order(steps, errors) == pytest.approx(order, abs=0.02)
    assert fitted_order(steps[:1], errors[:1]) is None
    assert fitted_order(steps, np.full(10, 1.0)) is None


def test_failures_are_in_the_table_with_their_reasons() -> None:
    assert succeeded(SLOW).tolist() == [False, True, True, False, False]
    assert failed(SLOW).tolist() == [True, False, False, False, True]
    told = [row[2] for row in point_table([FAST, SLOW]).rows]
    assert [cell.note for cell in told if not isinstance(cell, str) and cell.note] == [
        "ended after 10 s", "not run", "as large as the motion; the engine reported success"
    ]  # fmt: skip
    faults = point_table([FAST, SLOW], only_faults=True).rows
    assert len(faults) == 2


def test_the_diagram_draws_what_was_measured() -> None:
    """An error over the run time, each method's own front, upon that of all."""
    looks = {curve.name: look_of(curve.name) for curve in (FAST, SLOW)}
    plot = diagram([FAST, SLOW], "angle_error_max", "error", looks)
    assert plot is not None
    front, fast, slow = plot.curves
    assert (fast.x.tolist(), fast.y.tolist()) == ([1e-3, 2e-3, 4e-3], [1e-2, 1e-6, 1e-10])
    assert (slow.x.tolist(), slow.y.tolist()) == ([1e-2, 1e-1], [1e-2, 1e-4])
    assert front.y.tolist() == [1e-2, 1e-6, 1e-10]
    assert (plot.log, plot.x.log) == (True, True)
    assert diagram([], "angle_error_max", "error", {}) is None


def test_the_sentence_names_the_fastest_and_how_much_slower_another_model_is() -> None:
    other = curve("exudyn_tree/rk67", [1e-4, 1e-8], [2e-2, 1e-1])
    six, nine = map(str, bench_answer({"paper/fig09": [FAST, other]}))
    # 1e-6 is half way, in decades, from 1e-4 to 1e-8: sqrt(0.02 * 0.1) s, against 2e-3 s.
    assert six == (
        "To an error of 10⁻⁶ rad <b>closed form, Taylor</b> is the fastest; Exudyn tree, RK67, "
        "the fastest of another model, takes 22 times as long."
    )
    assert "another model" not in nine


def test_a_method_that_reaches_an_error_at_no_setting_is_named_unless_some_were_left_out() -> None:
    whole = curve("exudyn_tree/rk67", [1e-2, 1e-4], [1e-2, 1e-1])
    last = str(bench_answer({"paper/fig09": [FAST, whole]})[-1])
    assert last == "No setting of <b>Exudyn tree, RK67</b> reaches 10⁻⁶ rad."
    on_one = bench_answer(
        {"paper/fig09": [FAST, whole], "paper/fig11": [replace(whole, arrays=FAST.arrays)]}
    )
    assert not any("No setting" in sentence for sentence in on_one)
    cut = bench_answer({"paper/fig09": [FAST, SLOW]})  # whose finest is left out
    assert not any("No setting" in sentence for sentence in cut)


def test_errors_with_the_same_outcome_share_a_sentence() -> None:
    other = curve("exudyn_tree/rk67", [1e-5, 1e-7, 1e-10], [2e-2, 4e-2, 1e-1])
    (both,) = map(str, bench_answer({"paper/fig09": [FAST, other]}))
    # In decades 1e-6 is half way and 1e-9 two thirds of the way from one setting to the next.
    six, nine = math.sqrt(0.02 * 0.04) / 2e-3, 0.04 * 2.5 ** (2 / 3) / (2e-3 * 2.0**0.75)
    assert both == (
        "To errors of 10⁻⁶ and 10⁻⁹ rad <b>closed form, Taylor</b> is the fastest; Exudyn tree, "
        f"RK67, the fastest of another model, takes {six:.0f} and {nine:.0f} times as long."
    )


def test_a_page_of_one_scene_has_each_table_once(tmp_path: Path) -> None:
    for scenes in (1, 2):
        curves = [replace(FAST, scene=f"paper/fig{9 + 2 * i:02d}") for i in range(scenes)]
        with open_results(stored(tmp_path / f"{scenes}.h5", *curves)) as results:
            page = bench_page(results)
        html = render(page)
        tables = re.findall('<table aria-label="(.*?)"', html)
        assert tables.count("Run time to reach an angle error") == scenes
        assert ("Time to 1e-6 rad" in tables) == (scenes == 2)


def test_methods_of_files_differ_by_colour_from_file_to_file_and_by_line_in_one() -> None:
    names = ["pinocchio/dop853", "drake/rk3", "drake/rk5", "drake/radau3", "dart/world"]
    looks = curve_looks([FAST, *(curve(name, [1e-2], [1e-3]) for name in names)])
    assert len({look.css for look in looks.values()}) == 1 + len(names)
    assert len({looks[name].colour for name in names}) == 3


def stored(path: Path, *curves: Record) -> Path:
    """The curves in a file, as `bench` stores them."""
    points = [point for curve in curves for point in known_points(curve)]
    file = fit_file_to_request(path, [points_table("bench", points)])
    for curve in curves:
        facts = {
            name: value
            for name, value in curve.attributes.items()
            if name in POINT_COLUMNS["bench"]
        }
        for i, point in enumerate(known_points(curve)):
            place = file.place(str(point["run"]), "bench")
            values = {
                name: array[i]
                for name, array in curve.arrays.items()
                if name not in ("setting", "status")
            }
            values |= {"status": curve.statuses[i], "message": curve.messages[i]}
            place.write(place.encode(facts | values))
    return path


def known_points(curve: Record) -> list[dict[str, object]]:
    facts = curve.attributes
    known = {
        "scene": curve.scene,
        "method_name": curve.method,
        "curve": curve.name,
        "setting_kind": "step",
        "scene_hash": facts["scene_hash"],
        "order_expected": facts.get("order_expected", np.nan),
        "options": '{"budget_s": 28.0, "duration_s": 10.0}',
    }
    return [
        known | {"run": f"{curve.scene}/{curve.name} {x:g}", "step": x}
        for x in curve.arrays["setting"].tolist()
    ]


def test_curves_are_read_as_they_are_stored_and_one_without_a_point_is_not_shown(
    tmp_path: Path,
) -> None:
    stored(tmp_path / "a.h5", FAST)
    stored(tmp_path / "a.h5", SLOW)
    for curve, read in zip((FAST, SLOW), read_records(tmp_path / "a.h5", "bench"), strict=True):
        assert (read.name, read.messages) == (curve.name, curve.messages)
        np.testing.assert_array_equal(read.arrays["run_time_s"], curve.arrays["run_time_s"])
    TableFile(tmp_path / "a.h5").place("paper/fig09/lagrange/taylor 0.05", "bench").mark_missing(
        [0]
    )
    assert [curve.name for curve in read_records(tmp_path / "a.h5", "bench")] == [
        "exudyn_tree/rk67"
    ]


def test_a_file_of_curves_alone_is_opened_and_shown(tmp_path: Path) -> None:
    curves = rm.open(stored(tmp_path / "a.h5", FAST, SLOW))
    assert list(curves) == ["paper/fig09/lagrange/taylor", "paper/fig09/exudyn_tree/rk67"]
    np.testing.assert_array_equal(
        curves["paper/fig09/lagrange/taylor"]["run_time_s"], FAST.arrays["run_time_s"]
    )
    assert repr(curves).splitlines()[0] == (
        f"{tmp_path / 'a.h5'}: 2 curves of error against run time"
    )
    assert "lagrange/taylor" in curves._repr_html_()
    assert curves.to_html(tmp_path / "pages").is_file()
    shown = rotor_mbs("show", tmp_path / "a.h5").out
    assert "bench: 2 curves of error against run time" in shown
    assert "methods  lagrange/taylor, exudyn_tree/rk67" in shown


def test_pages_are_written(tmp_path: Path) -> None:
    stored(tmp_path / "a.h5", FAST, SLOW)
    index = write_report(tmp_path / "a.h5", tmp_path / "report")
    assert [path.name for path in index.parent.iterdir()] == ["index.html"]
    page = index.read_text()
    assert "ended after 10 s" in page
    assert "evaluated up to 6.00" in page
    assert page.count('<figure class="plot"') == 1  # these curves have no defects
    # The diagram stands before every table.
    assert page.index('id="diagram"') < page.index("<table")
