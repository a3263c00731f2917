"""Pages of synthetic files: what they show, what is left out, what is escaped, where they are
written; the viewer."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.checking import results_file
from support.commands import rotor_mbs
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
from support.scenes import paper
from support.stored import Made, rotor, store
from support.sweeps import THREE_RUNS, made_sweep

from rotor_mbs.analysis.published import CheckedEntry, claim_study, published
from rotor_mbs.errors import StoreError
from rotor_mbs.methods.catalogue import find_method, find_method_or_none
from rotor_mbs.report import numbers
from rotor_mbs.report.build import write_report
from rotor_mbs.report.elements import Matrix, PageContent, Row, Section
from rotor_mbs.report.files import page_names, render, write_pages
from rotor_mbs.report.looks import PALETTE
from rotor_mbs.report.pages import METRICS, compared_time
from rotor_mbs.report.pages.paper import claim_table, matrices
from rotor_mbs.report.pages.viewer import MAX_FRAMES, script_json, viewer
from rotor_mbs.runs import design
from rotor_mbs.runs.design import metric_columns
from rotor_mbs.runs.read import open_results
from rotor_mbs.scenario.scene import known_outputs, scene_toml

FIG11 = paper("fig11", samples=101)
PLAIN = replace(FIG11, outputs=("angles",))
PRINTED, REFERENCE, TAYLOR, TREE = (
    "printed/ode45",
    "reference",
    "lagrange/taylor",
    "exudyn_tree/rk67",
)
SWING = rotor(lambda t: 0.5 + 0.2 * np.sin(t), lambda t: 0.1 * t, np.cos, np.sin)


# What a page has


def test_a_page_of_the_paper_has_every_part_in_order(report: Path) -> None:
    text = text_of(report, "paper-fig11.html")
    assert sections_of(text) == ["motion", "agreement", "paper", "details"]
    headings = re.findall(r"<(h\d)\b", text)
    assert headings == ["h1"] + ["h2"] * (len(headings) - 1)
    assert text.index('class="answer"') < text.index('class="facts"') < text.index('class="viewer"')
    plots = plots_of(text)
    # beside the viewer; pitch 1 differs most
    assert list(plots)[:2] == ["Rotor angle", "Pitch 1 angle"]
    assert {"Pitch 2 angle", "Pitch 3 angle", "Rotor rate", "Angle error", "Interval defect"} <= {
        *plots
    }
    (mark,) = plots["Rotor angle"].described["marks"]
    assert (mark["y"], mark["text"]) == (2.7315, "published crest 2.7315 rad")
    # rates, how it was decided, defects, numbers, the scene's file
    assert text.count("<details>") >= 5
    assert len(text.encode()) < 400_000


def test_every_sample_is_drawn_and_columns_of_a_page_are_shared(
    results: Path, report: Path
) -> None:
    text = text_of(report, "paper-fig11.html")
    plots = plots_of(text)
    with open_results(results) as opened:
        run = opened.scenes["paper/fig11"].runs[PRINTED]
        time, angles, rates = (run.array(name) for name in ("time", "angles", "rates"))
    for k, name in enumerate(("Rotor", "Pitch 1", "Pitch 2", "Pitch 3")):
        for what, values in (("angle", angles), ("rate", rates)):
            x, y = plots[f"{name} {what}"].curves["as printed"]
            np.testing.assert_allclose(x, time, rtol=1e-7)
            np.testing.assert_allclose(y, values[:, k], rtol=1e-6, atol=1e-30)
    places = {
        json.dumps(curve["x"]) for plot in plots.values() for curve in plot.described["curves"]
    }
    assert len(places) <= 3  # the whole time, and that without its first sample


def test_the_index_has_a_row_per_scene_and_what_each_error_does(report: Path) -> None:
    text = text_of(report, "index.html")
    assert sections_of(text)[:2] == ["hero", "scenes"]
    scenes = rows_of(section_of(text, "scenes"))
    assert list(scenes) == ["fig05", "fig11", "fig12", "fig14a"]
    angle, departure, energy, within, compared = scenes["fig11"]
    assert angle == "rotor"
    assert re.fullmatch(r"0\.\d+ s", departure)
    assert (energy, within, compared) == (
        "1.00 MJ",
        "1.0×10⁻¹¹exudyn_tree/rk67: inaccurate",
        "10 of 10 s",
    )
    assert scenes["fig14a"][1] == "never"
    assert scenes["fig12"][2] == "runs away"
    assert section_of(text, "scenes").count('class="spark"') == 4
    errors = rows_of(section_of(text, "errors"))
    assert [name.partition(",")[0] for name in errors] == ["E1", "E2", "E3"]
    assert section_of(text, "scenes").count("aria-sort") == 6
    assert len(text.encode()) < 300_000


def test_equations_that_are_not_claimed_correct_are_not_called_ok(report: Path) -> None:
    text = text_of(report, "paper-fig11.html")
    rows = rows_of(section_of(text, "agreement"))
    assert rows["as printed, ode45"][0] == "completed"
    assert rows["closed form, Taylor"][0] == "✓ ok"
    assert "nothing is claimed of them" in section_of(text, "details")
    # the name that the command line and the file have
    assert "<small>lagrange/taylor</small>" in text


def test_every_number_of_every_method_is_in_a_table_that_fits(report: Path) -> None:
    """Transposed: a row per quantity, a column per method."""
    text = text_of(report, "paper-fig11.html")
    rows = rows_of(section_of(text, "details"))
    assert rows["Largest angle error up to the horizon (rad)"][0] == "–"  # the reference has none
    # of 1e-12 a second over 10 s
    assert rows["Largest angle error up to the horizon (rad)"][2] == "1.00×10⁻¹¹"
    for table in re.findall(r"<table.*?</table>", text, re.S):
        assert table.partition("</thead>")[0].count("<th ") <= 9, table[:200]


def test_every_metric_of_the_summary_is_a_column_of_a_file() -> None:
    """Else it is left out of every page, silently."""
    assert {*METRICS} - {"constraint_error_max"} <= metric_columns(known_outputs()).keys()


def test_a_failed_run_shows_its_reason_and_its_partial_data(report: Path) -> None:
    text = text_of(report, "paper-fig12.html")
    rows = rows_of(section_of(text, "agreement"))
    assert rows["as printed, ode45"][0] == "solver failedthe step became <too> small"
    assert rows["Exudyn tree, RK67"][0] == "timed out60 s"
    assert "break off at 3.97 s (solver failed)" in answer_of(text)
    x, _ = plots_of(text)["Rotor angle"].curves["as printed"]
    assert x[-1] == pytest.approx(3.97, abs=0.04)
    assert 'class="bad">Exudyn tree, RK67 timed out' in text


def test_numbers_that_are_rounding_error_are_marked_on_every_page(report: Path) -> None:
    for name, times in (
        ("index.html", 2),
        ("paper-fig05.html", 2),
        ("figures.html", 1),
        ("claims.html", 2),
    ):
        assert text_of(report, name).count("amplified rounding error") >= times, name


def test_still_pictures_have_colours_that_a_dark_page_can_change(report: Path) -> None:
    """Light and dark in the style sheet; a picture, for a page without scripts, has its classes."""
    seen = 0
    for path in report.glob("*.html"):
        text = path.read_text(encoding="utf-8")
        style = text[: text.index("</style>")]
        for name in PALETTE:
            assert style.count(f"--{name}:") == 2, name
        for picture in re.findall(r'<div class="still">.*?</div>', text, re.S):
            assert not re.search(r"#[0-9a-f]{6}\b", picture), path.name
            assert '<path class="curve ' in picture
            seen += 1
    assert seen > 8


def test_a_file_of_one_scene_is_its_page(tmp_path: Path) -> None:
    scene = replace(PLAIN, name="mine", title="Mine", figures=()).replace()
    folder = write_report(
        store(tmp_path / "r.h5", [Made(scene, TAYLOR, SWING)]), tmp_path / "out"
    ).parent
    assert [path.name for path in folder.iterdir()] == ["index.html"]
    text = text_of(folder)
    assert sections_of(text) == ["motion", "extremes", "agreement", "details"]
    assert "<h1>Mine</h1>" in text
    assert "<nav" not in text
    words = words_of(
        re.sub(
            r"<script.*?</script>|<details.*?</details>",
            "",
            text.partition("</head>")[2],
            flags=re.S,
        )
    )
    assert "paper" not in words.lower()
    assert "corrected" not in words.lower()  # nothing was corrected there


def test_a_changed_scene_of_the_paper_says_so_and_is_none_of_it(tmp_path: Path) -> None:
    changed = FIG11.replace(gravity=9.0)
    runs = [
        Made(changed, REFERENCE, SWING),
        Made(changed, PRINTED, SWING),
        Made(changed, TAYLOR, SWING),
    ]
    text = text_of(write_report(store(tmp_path / "r.h5", runs), tmp_path / "out").parent)
    assert "paper/fig11, changed: gravity" in text
    assert "of the paper" not in words_of(text.partition("<main>")[2].partition("<details")[0])
    assert "printed" not in answer_of(text)


def test_own_scenes_stand_in_a_table_those_that_failed_first(tmp_path: Path) -> None:
    runs = []
    for name, status in (("a", "ok"), ("b", "diverged"), ("c", "ok")):
        scene = replace(
            PLAIN, name=name, title=f"scene {name}", figures=(), outputs=("angles", "rates")
        ).replace()
        facts = {"status": status, "message": "1e9 rad"} if status != "ok" else {}
        runs.append(Made(scene, TAYLOR, SWING, attributes=facts))
    folder = write_report(store(tmp_path / "r.h5", runs), tmp_path / "out").parent
    text = text_of(folder)
    assert list(rows_of(section_of(text, "scenes"))) == ["b", "a", "c"]
    assert answer_of(text) == "1 of 3 scenes is not ok: b. Two of the three scenes are ok."
    assert rows_of(section_of(text, "scenes"))["b"][1] == "divergedlagrange/taylor: 10⁹ rad"
    assert sorted(path.name for path in folder.iterdir()) == [
        "a.html",
        "b.html",
        "c.html",
        "index.html",
    ]


def test_scenes_of_which_nothing_was_checked_are_not_ok(tmp_path: Path) -> None:
    """One with the printed equations alone, one with a reference alone."""
    scenes = [
        replace(PLAIN, name=name, figures=(), outputs=("angles", "rates")).replace()
        for name in "ab"
    ]
    runs = [
        Made(scenes[0], PRINTED, SWING, attributes={"status": "completed"}),
        Made(scenes[1], REFERENCE, SWING),
    ]
    text = text_of(write_report(store(tmp_path / "r.h5", runs), tmp_path / "out").parent)
    assert answer_of(text).startswith(
        "None of the two scenes is ok. Of two nothing was checked: they have no run of"
    )
    assert facts_of(text)["Scenes"] == "0 of 2 ok"
    table = section_of(text, "scenes")
    assert [cells[1] for cells in rows_of(table).values()] == ["completed", "reference only"]
    assert "✓" not in table
    assert 'class="good"' not in table


def test_the_index_says_how_much_of_the_time_was_compared(tmp_path: Path) -> None:
    """Two scenes of 10 s, one compared to its end and one up to 2.5 s."""
    runs = [
        Made(replace(FIG11, name=name), method, SWING)
        for name in ("a", "b")
        for method in (REFERENCE, TAYLOR)
    ]
    with open_results(store(tmp_path / "r.h5", runs)) as opened:
        scenes = opened.scenes.values()
        assert [compared_time([scene])[1] for scene in scenes] == [10.0, 10.0]
        for scene in scenes:
            for run in scene.runs.values():
                run.attributes.update({"horizon_s": 2.5 if scene.name == "b" else 10.0})
        assert compared_time(scenes) == (12.5, 20.0)


def test_every_page_has_the_same_navigation_and_says_what_made_the_results(report: Path) -> None:
    wanted = ["index.html", "claims.html", "figures.html", "errata.html"]
    for path in report.glob("*.html"):
        text = path.read_text(encoding="utf-8")
        nav = re.search(r'<nav class="site" aria-label="Report">(.*?)</nav>', text, re.S)
        assert nav is not None, path.name
        links = re.findall(r'<a href="([^"]*)"', nav[1])
        assert links == wanted
        assert "<footer><details><summary>Software" in text, path.name
        here = re.findall(r'href="([^"]*)" aria-current="page"', nav[1])
        assert here == ([path.name] if path.name in wanted else [])
    neighbours = re.findall(r'rel="(\w+)" href="([^"]*)"', text_of(report, "paper-fig11.html"))
    assert neighbours == [("prev", "paper-fig05.html"), ("next", "paper-fig12.html")]


def test_a_page_has_the_scripts_that_it_needs_and_a_policy_that_allows_no_other(
    report: Path,
) -> None:
    policies = set()
    for path in report.glob("*.html"):
        text = path.read_text(encoding="utf-8")
        policies.add(re.search(r"script-src ([^\"]*)\"", text)[1])  # type: ignore[index]
        assert ("viewer-time" in text) == ('class="plot"' in text or 'class="viewer"' in text), (
            path.name
        )
    (policy,) = policies
    assert re.fullmatch(r"('sha256-[A-Za-z0-9+/=]{44}' ?){4}", policy)


# The paper's claims and errata


def cells_of(row: Row) -> list[str]:
    return [
        (cell if isinstance(cell, str) else cell.text).replace(numbers.SPACE, " ") for cell in row
    ]


def test_claims_have_a_verdict_for_each_model() -> None:
    items = [item for item in published() if not item.is_number][:2]
    verdicts = {
        items[0].id: {PRINTED: "holds", TAYLOR: "fails"},
        items[1].id: {PRINTED: "undecided", TAYLOR: "undecided"},
    }
    study = replace(claim_study(), verdicts=verdicts)
    table = claim_table(items, study)
    assert [cells_of(row[1:]) for row in table.rows] == [
        ["✓ holds", "✗ fails"],
        ["undecided", "undecided"],
    ]


def test_formulas_are_typeset_and_the_faulty_entry_of_a_matrix_is_marked_and_corrected() -> None:
    entries = [
        CheckedEntry("(8)", "row 1 column 1", "c² m c3²", "", 0.0, True, ""),
        CheckedEntry("(8)", "row 1 column 2", "what <is> this?", "", 0.0, True, ""),
        CheckedEntry("(8)", "row 1 column 3", "c c3", "0", 1.0, False, "E1"),
        CheckedEntry("(25)", "D(1,1)", "c", "d", 1.0, False, "E1"),
    ]
    shown = matrices(entries, ("(8)", "(25)"))
    ((equation, rows),) = shown
    (((formula, _), (text, _), _),) = rows
    assert equation == "(8)"
    assert formula == "<i>c</i>² <i>m</i> <i>c</i><sub>3</sub>²"
    assert text == "what &lt;is&gt; this?"
    page = render(PageContent("t", "", [], [], [Section("E1", "E1", [Matrix("(8)", rows)])]))
    matrix = page[page.index('<div class="matrix">') : page.index("</section>")]
    assert (matrix.count("<td"), matrix.count('<td class="fault">')) == (3, 1)
    assert "<del><i>c</i> <i>c</i><sub>3</sub></del> <ins>0</ins>" in matrix
    # words and ranges stay as they are
    prose = numbers.formula("E1 in (42)-(46), -c c3 of U33,3", in_prose=True)
    assert prose == "E1 in (42)-(46), −<i>c</i> <i>c</i><sub>3</sub> of <i>U</i><sub>33,3</sub>"


def test_the_page_of_errata_has_each_with_its_matrices(report: Path) -> None:
    text = text_of(report, "errata.html")
    assert sections_of(text)[:3] == ["E1", "E2", "E3"]
    assert section_of(text, "E1").count('<td class="fault">') == 2
    assert text.count("wrong entries are struck out") == 1
    assert answer_of(text).startswith("The printed equations contain three errors.")


# Stored quantities


def test_loads_have_a_plot_per_component_and_their_extremes(tmp_path: Path) -> None:
    path = results_file(tmp_path / "r.h5", ["check/loads"], ["lagrange/dop853", TREE])
    text = text_of(write_report(path, tmp_path / "out").parent)
    plots = plots_of(text)
    for load in ("Blade root moment", "Blade root force", "Shaft moment", "Shaft force"):
        for axis in "xyz":
            assert f"{load} {axis}" in plots
    with open_results(path) as opened:
        scene = opened.scenes["check/loads"]
        run = scene.reference
        assert run is not None
        forces, time = run.array("blade_root_force")[:, 3, 0], run.array("time")
    _, drawn = plots["Blade root force x"].curves["blade 4"]
    scale = 1e3  # the largest of the channel is some 1e5 N
    np.testing.assert_allclose(
        drawn, forces / scale, rtol=1e-6, atol=1e-6 * np.abs(forces).max() / scale
    )
    unit, low, at_low, high, at_high, mean, deviation = rows_of(section_of(text, "extremes"))[
        "Blade root force x, blade 4"
    ]
    assert unit == "kN"
    for shown, value in (
        (low, forces.min()),
        (high, forces.max()),
        (mean, forces.mean()),
        (deviation, forces.std()),
    ):
        assert float(shown.replace("−", "-")) == pytest.approx(value / scale, rel=1e-3)
    assert float(at_high) == pytest.approx(time[forces.argmax()], abs=0.0051)
    assert float(at_low) == pytest.approx(time[forces.argmin()], abs=0.0051)
    errors = rows_of(section_of(text, "details"))
    assert any("error" in name.lower() and "shaft" in name for name in errors)


def test_a_driven_scene_shows_torque_power_pitch_and_command(tmp_path: Path) -> None:
    path = results_file(tmp_path / "r.h5", ["turbine/pitch-step"], [])
    text = text_of(write_report(path, tmp_path / "out").parent)
    plots = plots_of(text)
    assert {"Torque on the rotor", "Power of the torque", "Power of the pitch actuators"} <= {
        *plots
    }
    assert "command" in plots["Pitch angle"].curves
    assert {"torque", "shaft damper"} == {*plots["Power of the torque"].curves}
    with open_results(path) as opened:
        stored = opened.scenes["turbine/pitch-step"]
        scene, run = stored.scene, stored.reference
        assert run is not None
        speed = run.array("rates")[:, 0]
    _, power = plots["Power of the torque"].curves["torque"]
    torque = scene.rotor_torque[0][1]
    np.testing.assert_allclose(power * 1e6, torque * speed, rtol=1e-6)
    plain = results_file(tmp_path / "p.h5", ["paper/fig04b"], [])
    assert "Torque on the rotor" not in plots_of(
        text_of(write_report(plain, tmp_path / "plain").parent)
    )


def test_a_torque_that_jumps_is_drawn_by_its_table_and_what_follows_is_interrupted(
    tmp_path: Path,
) -> None:
    """At 1 s, between two samples: the power has the old value before and the new one after, and no
    line between."""
    torque = ((0.0, 1000.0), (1.05, 1000.0), (1.05, -2000.0), (3.0, -2000.0))
    changed = replace(FIG11, samples=31, duration=3.0, name="mine", figures=(), rotor_torque=torque)
    scene = replace(changed, text=scene_toml(changed))
    path = store(tmp_path / "r.h5", [Made(scene, TAYLOR, rotor(lambda t: 2.0 * t, np.sin))])
    plots = plots_of(text_of(write_report(path, tmp_path / "out").parent))
    x, y = plots["Torque on the rotor"].curves["torque"]
    np.testing.assert_allclose(x, [0.0, 1.05, 1.05, 3.0])
    np.testing.assert_allclose(y, [1.0, 1.0, -2.0, -2.0])  # kN m
    power = plots["Power of the torque"]
    assert power.described["curves"][0]["breaks"] == [11]
    x, y = power.curves["torque"]
    assert (x[10], y[10], x[11], y[11]) == pytest.approx((1.0, 2.0, 1.1, -4.0))  # kW at 2 rad/s
    assert "breaks" not in plots["Rotor speed"].described["curves"][0]  # a state does not jump
    marks = [plots[name].described["marks"] for name in ("Rotor speed", "Pitch angle")]
    assert marks == [[{"text": "torque −2.00 kN m", "x": 1.05}], [{"text": "", "x": 1.05}]]


def test_a_quantity_below_rounding_of_its_kind_is_zero(tmp_path: Path) -> None:
    path = results_file(tmp_path / "r.h5", ["check/loads"], [])
    text = text_of(write_report(path, tmp_path / "out").parent)
    for row in rows_of(section_of(text, "extremes")).values():
        for cell in row[1:]:
            assert "×10⁻" not in cell or not re.search(r"×10⁻([1-9]\d)", cell), row
        assert not re.fullmatch(r"(m|µ|n|p)(W|N|N m|J)", row[0])


# The viewer's data

FRAMES11 = paper("fig11", samples=301)
TURNING = rotor(lambda t: 40.0 * t, lambda t: -7.0 * t + 1.0, np.cos, np.sin)


def viewer_of(folder: Path, run: Made) -> dict:  # type: ignore[type-arg]
    """What the viewer of a file with this run has."""
    with open_results(store(folder / "r.h5", [run])) as opened:
        scene = opened.scenes[run.scene.name]
        made = viewer(scene, dict(scene.runs))
    assert made is not None
    return made


def test_angles_are_those_of_the_run_to_a_ten_thousandth_of_a_radian_over_any_number_of_turns(
    tmp_path: Path,
) -> None:
    data = json.loads(str(viewer_of(tmp_path, Made(FRAMES11, "reference", TURNING))["data"]))
    np.testing.assert_allclose(
        data["models"][0]["frames"], TURNING(np.linspace(0.0, 10.0, 301)), atol=0.5001e-4
    )


@pytest.mark.parametrize(("samples", "frames"), [(301, 301), (5001, MAX_FRAMES)])
def test_a_frame_for_each_sample_but_no_more_than_fit_a_page(
    tmp_path: Path, samples: int, frames: int
) -> None:
    made = viewer_of(tmp_path, Made(paper("fig11", samples=samples), "reference", TURNING))
    assert len(json.loads(str(made["data"]))["models"][0]["frames"]) == frames


@pytest.mark.parametrize(
    ("rate", "noted"), [(4.0, ""), (400.0, "turns by up to 13 rad from one frame to the next")]
)
def test_a_motion_too_fast_for_the_frames_is_stated(
    tmp_path: Path, rate: float, noted: str
) -> None:
    notes = viewer_of(tmp_path, Made(FRAMES11, "reference", rotor(lambda t: rate * t)))["notes"]
    assert bool(notes) == bool(noted)
    assert noted in "".join(notes).replace("\N{NO-BREAK SPACE}", " ")


def test_a_page_holds_both_models_thinned_and_small(tmp_path: Path) -> None:
    runs = [
        Made(FRAMES11, "reference", TURNING),
        Made(FRAMES11, "printed/ode45", TURNING, until=0.5),
    ]
    folder = write_report(store(tmp_path / "r.h5", runs), tmp_path / "out").parent
    text = (folder / "index.html").read_text(encoding="utf-8")
    (shown,) = re.findall(r'<script type="application/json">(.*?)</script>', text, re.S)
    data = json.loads(shown)
    assert [model["name"] for model in data["models"]] == ["as printed", "corrected"]
    counts = [len(model["frames"]) for model in data["models"]]
    assert counts[1] == 301  # every sample
    # The printed run stops at 149/300 of 10 s: its frames do, too.
    assert (counts[0] - 1) * data["step"] == pytest.approx(10.0 * 149 / 300, abs=data["step"])
    assert data["blades"][1]["tip"] == list(FRAMES11.blades[1].tip)
    assert len(shown) < 15_000
    scripts = re.findall(r"<script>(.*?)</script>", text, re.S)
    assert sum(len(script.encode()) for script in scripts) < 40_000


def test_a_run_is_drawn_up_to_its_first_sample_that_is_not_finite(tmp_path: Path) -> None:
    broken = rotor(lambda t: np.where(t > 4.0, np.nan, t))
    made = viewer_of(
        tmp_path, Made(replace(FRAMES11, outputs=("angles",)), "lagrange/taylor", broken)
    )
    data = json.loads(str(made["data"]))
    assert (len(data["models"][0]["frames"]) - 1) * data["step"] == pytest.approx(4.0, abs=0.05)


def test_data_cannot_end_the_script_element() -> None:
    evil = "</script><script>alert(1)</script><!-- &amp;"
    text = str(script_json({"name": evil}))
    assert not set("<>&") & set(text)
    assert json.loads(text) == {"name": evil}


# Safety


def test_texts_from_the_file_are_escaped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a method that is not installed, too."""
    monkeypatch.setattr(
        design, "find_method", lambda name: find_method_or_none(name) or find_method(TAYLOR)
    )
    evil = "<script>alert(1)</script>"
    scene = replace(
        FIG11,
        name="a b/<i>",
        title=f"{evil}\x1b[2J",
        text=f"# {evil}\n{FIG11.text}\n# </pre>{evil}",
    )
    failed = {"status": "singular", "message": evil}
    runs = [
        Made(scene, REFERENCE, SWING),
        Made(scene, f"lagrange/{evil[:8]}>x", SWING, attributes=failed),
    ]
    folder = write_report(store(tmp_path / "r.h5", runs), tmp_path / "o")
    for path in folder.parent.glob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert evil not in text
        assert f"{evil[:8]}>x" not in text
        assert "<i>" not in text
        assert "&lt;script&gt;" in text
        assert "\x1b" not in text


def test_what_utf_8_cannot_hold_does_not_stop_a_report(tmp_path: Path) -> None:
    write_pages(tmp_path, {"index.html": "a\ud800b\x00c\r\n\td"})
    assert (tmp_path / "index.html").read_bytes() == "a\ufffdb\ufffdc\r\n\td".encode()


def test_pages_need_nothing_from_outside(report: Path) -> None:
    for path in report.glob("*.html"):
        text = path.read_text(encoding="utf-8")
        namespace = "http://www.w3.org/2000/svg"  # a name, of which nothing is asked
        for outside in ("http://", "@import"):
            assert outside not in text.replace(namespace, "")
        # a link, which asks for nothing
        assert text.count("https://") == text.count('<a href="https://doi.org/')
        assert not re.search(r"url\((?!#)", text)
        assert not re.search(r"<(link|img|iframe|object)\b|\ssrc=", text)
        assert "default-src 'none'" in text
        links = re.findall(r'\shref="([^"]*)"', text)
        targets = {value.split("#")[0] for value in links if not value.startswith("https://")} - {
            ""
        }
        assert all((report / target).is_file() for target in targets)
        ids = re.findall(r'\sid="([^"]*)"', text)
        assert len(set(ids)) == len(ids), path.name
        assert {value[1:] for value in links if value.startswith("#")} <= set(ids)


def test_file_names_stay_in_the_folder_and_differ() -> None:
    names = page_names(
        ["paper/fig05", "/etc/passwd", "index", "figures", "A", "a", "ü/ß", "x" * 300]
    )
    assert names["paper/fig05"] == "paper-fig05.html"
    assert names["figures"] == "figures-2.html"
    assert all(re.fullmatch(r"[A-Za-z0-9_-][A-Za-z0-9._-]*\.html", name) for name in names.values())
    assert (
        len({name.lower() for name in names.values()} | {"index.html", "errata.html"})
        == len(names) + 2
    )
    assert page_names(["data--2"]) == {"data--2": "scene-data--2.html"}
    for bad in ("../x", "a/../b", "..", "a\\..\\b"):
        with pytest.raises(StoreError, match="file name"):
            page_names([bad])


def test_own_old_pages_go_and_foreign_files_stay(tmp_path: Path) -> None:
    out = tmp_path / "out"
    two = [Made(replace(PLAIN, name=name), TAYLOR, SWING) for name in ("one", "two")]
    write_report(store(tmp_path / "a.h5", two), out)
    assert (out / "two.html").exists()
    (out / "notes.html").write_text("mine")
    (out / "data.csv").write_text("1")
    write_report(store(tmp_path / "b.h5", [Made(replace(PLAIN, name="other"), TAYLOR, SWING)]), out)
    assert sorted(path.name for path in out.iterdir()) == ["data.csv", "index.html", "notes.html"]


@pytest.mark.full
def test_the_same_file_gives_the_same_bytes_in_any_number_of_processes(tmp_path: Path) -> None:
    path = store(
        tmp_path / "r.h5",
        [Made(replace(PLAIN, name=name), TAYLOR, SWING) for name in ("one", "two")],
    )
    folders = [write_report(path, tmp_path / str(jobs), jobs=jobs).parent for jobs in (1, 2)]
    first, second = (
        {page.name: page.read_bytes() for page in folder.iterdir()} for folder in folders
    )
    assert sorted(first) == ["index.html", "one.html", "two.html"]
    assert first == second


@pytest.mark.full
def test_a_report_needs_no_engine_and_no_scipy(results: Path, tmp_path: Path) -> None:
    """In a process in which none of them can be imported, whatever asks for it."""
    modes, sweep = tmp_path / "modes.h5", made_sweep(tmp_path, THREE_RUNS)
    assert rotor_mbs("modes", "paper/fig11", "--speeds", "0.5:1:2", "-o", modes).status == 0
    code = (
        "import sys\nfor name in ('exudyn', 'mujoco', 'heyoka', 'scipy'): sys.modules[name] = "
        "None\nfrom pathlib import Path\nfrom rotor_mbs.report.build import write_report\nfor path "
        "in map(Path, sys.argv[1:]): write_report(path, Path(path.stem))\n"
    )
    subprocess.run([sys.executable, "-c", code, results, modes, sweep], cwd=tmp_path, check=True)
    assert len(list((tmp_path / results.stem).glob("*.html"))) > 4
    assert "Interval defect" in text_of(tmp_path / results.stem, "paper-fig11.html")
