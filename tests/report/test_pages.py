"""Pages of synthetic files: what they show, what is left out, what is escaped, where they are written; the viewer."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.checking import results_file
from support.scenes import paper
from support.stored import Made, rotor, store
from support.sweeps import made_sweep

from rotor_mbs.analysis.published import CheckedEntry, claim_study, errata, published
from rotor_mbs.errors import StoreError
from rotor_mbs.methods.catalogue import find_method, look_up
from rotor_mbs.report import numbers
from rotor_mbs.report.build import write_report
from rotor_mbs.report.canvas import Panels
from rotor_mbs.report.elements import Row, Section
from rotor_mbs.report.files import page_names, render, write_pages
from rotor_mbs.report.looks import COLOURS, COORDINATES
from rotor_mbs.report.pages import METRICS, compared_time, sweep
from rotor_mbs.report.pages.paper import claim_table, matrices
from rotor_mbs.report.pages.scene import quantity_sections, range_table
from rotor_mbs.report.pages.sweep import _edges, response, sweep_page
from rotor_mbs.report.pages.viewer import MAX_FRAMES, script_json, viewer
from rotor_mbs.runs import design
from rotor_mbs.runs.design import metric_columns
from rotor_mbs.runs.pool import SerialPool
from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.scenario.scene import known_outputs
from rotor_mbs.scenario.sweep import load_sweep
from rotor_mbs.studies.sweep import plan_sweep, run_sweep

FIG11 = paper("fig11", samples=101)
PLAIN = replace(FIG11, outputs=("angles",))
PRINTED, REFERENCE, TAYLOR, TREE = "printed/ode45", "reference", "lagrange/taylor", "exudyn_tree/rk67"
SWING = rotor(lambda t: 0.5 + 0.2 * np.sin(t), lambda t: 0.1 * t, np.cos, np.sin)


def text_of(folder: Path, name: str) -> str:
    return (folder / name).read_text(encoding="utf-8").replace(numbers.SPACE, " ").replace("<wbr>", "")


def sections_of(text: str) -> list[str]:
    return re.findall(r'<section id="([^"]*)"', text)


def rows_of(text: str) -> dict[str, list[str]]:
    """The cells of each row of the tables in a text, by the row's heading, without markup."""
    rows = {}
    for heading, cells in re.findall(r'<tr><th scope="row">(.*?)</th>(.*?)</tr>', text, re.S):
        rows[re.sub("<.*?>", "", heading.partition("<small>")[0])] = [
            re.sub("<.*?>", "", cell) for cell in re.findall(r"<td.*?>(.*?)</td>", cells, re.S)
        ]
    return rows


# What a page has


def test_a_full_page_has_every_section_and_headings_in_order(report: Path) -> None:
    text = text_of(report, "paper-fig11.html")
    sections = ["metrics", "paper", "motion", "paths", "defects", "difference", "quantity-energy_error", "file"]
    assert sections_of(text) == sections
    headings = re.findall(r"<(h\d)\b", text)
    assert headings == ["h1"] + ["h2"] * (len(headings) - 1)
    assert text.count("<figcaption>") == text.count("<figure>") == 1 + 2 + 2 + 1 + 1 + 1
    assert text.count('role="img"') == text.count("<figure>") + text.count("<canvas")
    opening = text[text.index('<div class="opening">') : text.index('<section id="metrics">')]
    assert 'class="viewer"' in opening
    assert re.search(r"both models; largest difference [\d.]+ rad; 0\.05 rad apart at 0\.\d+ s<", opening)
    assert " published 2.7315 rad</li>" in opening
    assert len(text.encode()) < 250_000


def test_the_index_opens_with_what_was_found_and_pictures_and_folds_its_other_tables(report: Path) -> None:
    text = text_of(report, "index.html")
    rows = rows_of(text)
    assert rows["Published numbers reproduced"] == ["3 of 4", "0 of 4"]
    assert rows["Scenes with a spurious energy gain of more than 0.001 of the energy scale"] == ["2 of 4", ""]
    assert rows["Largest spurious energy gain of a complete run"] == ["1 MJ", ""]  # not that of the broken run
    assert rows["closed form, Taylor"][:2] == ["1 of 1 ok", "1.0×10⁻¹¹"]  # 1e-12 per second over 10 s
    heat = text.index('id="scenes"')
    for shown in ('class="viewer"', 'class="card still"', " published 2.7315 rad</li>"):
        assert 0 < text.index(shown) < heat, shown
    rest = text[text.index('<section id="numbers"') :]
    assert "<table" in rest
    assert "<table" not in re.sub(r"<details>.*?</details>", "", rest, flags=re.S)
    assert len(text.encode()) < 600_000


def test_the_scenes_have_the_errors_the_methods_and_the_marks(report: Path) -> None:
    heat = text_of(report, "index.html").partition('id="scenes"')[2]
    assert "lagrange/taylor" in heat
    row = heat[heat.index("paper-fig11.html") :].partition("</tr>")[0]
    shades = re.findall(r'<td class="n h(\d)" title="[^"]*">\S*(?: (\D))?</td>', row)
    assert shades == [("7", ""), ("1", ""), ("2", "≈")]
    assert "≈: inaccurate" in heat


def test_equations_that_are_not_claimed_correct_are_not_called_ok(report: Path) -> None:
    metrics = text_of(report, "paper-fig11.html").partition('<section id="metrics">')[2]
    rows = rows_of(metrics)
    assert rows["as printed, ode45"][0] == "completed"
    assert rows["closed form, Taylor"][0] == "ok"
    assert "not that the result is correct" in metrics
    assert "<small>lagrange/taylor</small>" in metrics  # the name that the command line and the file have


def test_every_metric_of_the_summary_is_a_column_of_a_file() -> None:
    """Else it is left out of every page, silently."""
    assert set(METRICS) <= metric_columns(known_outputs()).keys()


def test_a_failed_run_shows_its_reason_and_its_partial_data(report: Path) -> None:
    text = text_of(report, "paper-fig12.html")
    metrics = rows_of(text.partition('<section id="metrics">')[2].partition("</section>")[0])
    assert metrics["as printed, ode45"][0] == "solver failedthe step became &lt;too&gt; small"
    assert metrics["Exudyn tree, RK67"][0] == "timed out60 s"
    assert {"motion", "difference", "quantity-energy_error", "paths"} <= set(sections_of(text))


def test_numbers_that_are_rounding_error_are_marked_on_every_page(report: Path) -> None:
    for name, times in (("index.html", 2), ("paper-fig05.html", 2), ("figures.html", 1)):
        assert text_of(report, name).count("amplified rounding error") >= times, name


def test_extremes_of_the_rotor_are_those_that_the_published_numbers_are_read_off(results: Path) -> None:
    """A crest between two samples, where the run has one: the table and the claim beside it must not differ."""
    with open_results(results) as opened:
        run = opened.scenes["paper/fig11"].runs[PRINTED]
        largest = float(run.array("angles")[:, 0].max())
        assert str(range_table([run]).rows[0][1]).endswith(numbers.number(largest, 4))
        run.attributes.update(rotor_angle_min=-0.25, rotor_angle_max=3.25, rotor_rate_max=1.25)
        assert range_table([run]).rows[0][1:] == ["−0.2500 to 3.250", "1.25"]


def test_colours_of_pictures_and_legends(report: Path) -> None:
    """Light and dark in the style sheet; of methods or of coordinates, never both; in a legend only what is drawn."""
    methods = {f"k{i}" for i in range(len(COLOURS))} - {"k0"}
    coordinates = {f"k{len(COLOURS) + i}" for i in range(len(COORDINATES))}
    seen = 0
    for path in report.glob("*.html"):
        text = path.read_text(encoding="utf-8")
        style = text[: text.index("</style>")]
        for name in set(re.findall(r"var\(--(k\d+)\)", text)):
            assert style.count(f"--{name}:") == 2, name
        for figure in re.findall(r"<figure>.*?</figure>", text, re.S):
            assert not re.search(r"#[0-9a-f]{6}\b", figure), path.name  # no colour that a dark page could not change
            picture, _, legend = figure.partition('<ul class="legend">')
            used, shown = (set(re.findall(r"var\(--(k\d+)\)", part)) for part in (picture, legend))
            assert not (used & methods and used & coordinates), (path.name, used)
            assert shown <= used, path.name
            seen += bool(used & methods)
    assert seen > 4


def test_one_scene_and_one_method_make_a_report_without_empty_sections(tmp_path: Path) -> None:
    scene = replace(PLAIN, name="mine", title="Mine", figures=()).replace()
    folder = write_report(store(tmp_path / "r.h5", [Made(scene, TAYLOR, SWING)]), tmp_path / "out").parent
    assert sorted(path.name for path in folder.iterdir()) == ["index.html", "mine.html"]
    page, index = text_of(folder, "mine.html"), text_of(folder, "index.html")
    assert sections_of(page) == ["metrics", "motion", "file"]
    assert sections_of(index) == ["methods", "scenes"]
    assert 'class="n h' not in index  # nothing was compared
    assert 'href="index.html"' in page
    assert "<nav" not in index
    for text in (page, index):
        words = re.sub(r"<script.*?</script>|<.*?>", "", text.partition("</head>")[2], flags=re.S).lower()
        assert "paper" not in words
        assert "corrected" not in words  # nothing was corrected there


def test_the_index_says_how_much_of_the_time_was_compared(tmp_path: Path) -> None:
    """Two scenes of 10 s, one compared to its end and one up to 2.5 s."""
    runs = [Made(replace(FIG11, name=name), method, SWING) for name in ("a", "b") for method in (REFERENCE, TAYLOR)]
    with open_results(store(tmp_path / "r.h5", runs)) as opened:
        scenes = opened.scenes.values()
        assert [compared_time([scene])[1] for scene in scenes] == [10.0, 10.0]
        for scene in scenes:
            for run in scene.runs.values():
                run.attributes.update({"horizon_s": 2.5 if scene.name == "b" else 10.0})
        assert compared_time(scenes) == (12.5, 20.0)


def test_every_page_has_the_same_navigation_and_says_what_made_the_results(report: Path) -> None:
    wanted = ["index.html", "figures.html", "errata.html"]
    for path in report.glob("*.html"):
        nav = re.search(r'<nav class="site" aria-label="Report">(.*?)</nav>', path.read_text(encoding="utf-8"), re.S)
        assert nav is not None, path.name
        assert re.findall(r'href="([^"]*)"', nav[1]) == wanted
        assert '<footer><h2 class="quiet">Software</h2>' in path.read_text(encoding="utf-8"), path.name
        here = re.findall(r'href="([^"]*)" aria-current="page"', nav[1])
        assert here == ([path.name] if path.name in wanted else [])


def test_a_sweep_has_a_page_from_its_dataset_alone(tmp_path: Path) -> None:
    pytest.importorskip("heyoka")
    folder = write_report(made_sweep(tmp_path), tmp_path / "out").parent
    text = text_of(folder, "index.html")
    assert "<h1>Speed &amp; stiffness</h1>" in text
    assert "12 runs of paper/fig06 with lagrange/taylor" in text
    assert ">initial rotor speed (rad/s)<" in text  # the axes, named as in the field
    assert ">bearing stiffness (N m/rad)<" in text
    assert rows_of(text)["ok"] == ["12", "100.0 %"]
    assert text.count("<figure>") == 1  # the map
    assert "<script" not in text
    assert len(text.encode()) < 250_000


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


# The paper's claims and errata


def cells_of(row: Row) -> list[str]:
    return [(cell if isinstance(cell, str) else cell.text).replace(numbers.SPACE, " ") for cell in row]


def test_claims_have_a_verdict_for_each_model() -> None:
    items = [item for item in published() if not item.is_number][:2]
    verdicts = {
        items[0].id: {PRINTED: "holds", TAYLOR: "fails"},
        items[1].id: {PRINTED: "undecided", TAYLOR: "undecided"},
    }
    study = replace(claim_study(), verdicts=verdicts)
    table = claim_table(items, study)
    assert [cells_of(row[2:]) for row in table.rows] == [["holds", "fails"], ["undecided", "undecided"]]


def test_formulas_are_typeset_and_the_faulty_entry_of_a_matrix_is_marked_and_corrected() -> None:
    entries = [
        CheckedEntry("(8)", "row 1 column 1", "c² m c3²", "", 0.0, True, ""),
        CheckedEntry("(8)", "row 1 column 2", "what <is> this?", "", 0.0, True, ""),
        CheckedEntry("(8)", "row 1 column 3", "c c3", "0", 1.0, False, "E1"),
        CheckedEntry("(25)", "D(1,1)", "c", "d", 1.0, False, "E1"),
    ]
    shown = matrices(entries, ("(8)", "(25)"))
    ((equation, (((formula, _), (text, _), _),)),) = shown
    assert equation == "(8)"
    assert formula == "<i>c</i>² <i>m</i> <i>c</i><sub>3</sub>²"
    assert text == "what &lt;is&gt; this?"
    others = {"differing": Section()}
    page = render("errata", {"errata": [(errata()[0], shown)], **others})
    matrix = page[page.index('<figure class="matrix">') : page.index("</figure>")]
    assert (matrix.count("<td"), matrix.count('<td class="fault">')) == (3, 1)
    assert "<del><i>c</i> <i>c</i><sub>3</sub></del> <ins>0</ins>" in matrix
    prose = numbers.formula("E1 in (42)-(46), -c c3 of U33,3", in_prose=True)  # words and ranges stay as they are
    assert prose == "E1 in (42)-(46), −<i>c</i> <i>c</i><sub>3</sub> of <i>U</i><sub>33,3</sub>"


# Stored quantities


def test_loads_are_drawn_once_with_the_errors_of_the_others_and_their_extremes(tmp_path: Path) -> None:
    """Of the reference a picture, a panel per axis; one of the errors; a table of the extremes with their times."""
    path = results_file(tmp_path / "r.h5", ["check/loads"], ["lagrange/dop853", TREE])
    text = text_of(write_report(path, tmp_path / "out").parent, "check-loads.html")
    sections = dict(re.findall(r'<section id="quantity-(\w+)">(.*?)</section>', text, re.S))
    loads = ["blade_root_force", "blade_root_moment", "shaft_force", "shaft_moment", "pitch_actuator_moment"]
    assert [name for name in sections if name in loads] == loads
    assert [sections[name].count("<figure>") for name in loads] == [2, 2, 2, 2, 2]
    with open_results(path) as opened:
        scene = opened.scenes["check/loads"]
        assert scene.reference is not None
        largest = float(scene.reference.array("blade_root_force")[:, 3, 0].max())
        alone = quantity_sections(scene, {TREE: scene.runs[TREE]}, None)
    assert [len(section.pictures) for _, _, section in alone] == [1] * 6  # energy and loads; no reference, no errors
    shown = numbers.prefixed(largest, "N").replace(numbers.SPACE, " ")
    assert shown in rows_of(sections["blade_root_force"])["blade 4 x"]
    assert "Exudyn tree, RK67" in sections["shaft_moment"]


def test_the_page_of_a_driven_scene_shows_power_pitch_and_command_and_no_other_does(tmp_path: Path) -> None:
    path = results_file(tmp_path / "r.h5", ["turbine/pitch-step", "paper/fig04b"], [])
    folder = write_report(path, tmp_path / "out").parent
    assert 'id="drive"' not in text_of(folder, "paper-fig04b.html")
    section = text_of(folder, "turbine-pitch-step.html").partition('<section id="drive">')[2].partition("</section>")[0]
    assert section.count("<figure>") == 2
    for piece in ("dissipated by the shaft damper", "command", "Pitches, their commands", "pitch 3"):
        assert piece in section, piece
    power = rows_of(section)["Its power"]
    assert power[0].startswith("5.3")
    assert power[2] == "31.8 MJ"  # 5.297 MW over 6 s


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


def test_angles_are_those_of_the_run_to_a_ten_thousandth_of_a_radian_over_any_number_of_turns(tmp_path: Path) -> None:
    data = json.loads(str(viewer_of(tmp_path, Made(FRAMES11, "reference", TURNING))["data"]))
    np.testing.assert_allclose(data["models"][0]["frames"], TURNING(np.linspace(0.0, 10.0, 301)), atol=0.5001e-4)


@pytest.mark.parametrize(("samples", "frames"), [(301, 301), (5001, MAX_FRAMES)])
def test_a_frame_for_each_sample_but_no_more_than_fit_a_page(tmp_path: Path, samples: int, frames: int) -> None:
    made = viewer_of(tmp_path, Made(paper("fig11", samples=samples), "reference", TURNING))
    assert len(json.loads(str(made["data"]))["models"][0]["frames"]) == frames


@pytest.mark.parametrize(("rate", "noted"), [(4.0, ""), (400.0, "turns by up to 13 rad from one frame to the next")])
def test_a_motion_too_fast_for_the_frames_is_stated(tmp_path: Path, rate: float, noted: str) -> None:
    notes = viewer_of(tmp_path, Made(FRAMES11, "reference", rotor(lambda t: rate * t)))["notes"]
    assert bool(notes) == bool(noted)
    assert noted in "".join(notes).replace("\N{NO-BREAK SPACE}", " ")


def test_a_page_holds_both_models_thinned_and_small(tmp_path: Path) -> None:
    runs = [Made(FRAMES11, "reference", TURNING), Made(FRAMES11, "printed/ode45", TURNING, until=0.5)]
    folder = write_report(store(tmp_path / "r.h5", runs), tmp_path / "out").parent
    text = (folder / "paper-fig11.html").read_text(encoding="utf-8")
    (shown,) = re.findall(r'<script type="application/json">(.*?)</script>', text, re.S)
    data = json.loads(shown)
    assert [model["name"] for model in data["models"]] == ["as printed, ode45", "reference, quad precision"]
    counts = [len(model["frames"]) for model in data["models"]]
    assert counts[1] == 301  # every sample
    # The printed run stops at 149/300 of 10 s: its frames do, too.
    assert (counts[0] - 1) * data["step"] == pytest.approx(10.0 * 149 / 300, abs=data["step"])
    assert data["blades"][1]["tip"] == list(FRAMES11.blades[1].tip)
    assert len(shown) < 15_000
    (script,) = (script for script in re.findall(r"<script>(.*?)</script>", text, re.S) if "viewer" in script)
    assert len(script.encode()) < 40_000


def test_a_run_is_drawn_up_to_its_first_sample_that_is_not_finite(tmp_path: Path) -> None:
    broken = rotor(lambda t: np.where(t > 4.0, np.nan, t))
    made = viewer_of(tmp_path, Made(replace(FRAMES11, outputs=("angles",)), "lagrange/taylor", broken))
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
    monkeypatch.setattr(design, "find_method", lambda name: look_up(name) or find_method(TAYLOR))
    evil = "<script>alert(1)</script>"
    scene = replace(FIG11, name="a b/<i>", title=f"{evil}\x1b[2J", text=f"# {evil}\n{FIG11.text}\n# </pre>{evil}")
    failed = {"status": "singular", "message": evil}
    runs = [Made(scene, REFERENCE, SWING), Made(scene, f"lagrange/{evil[:8]}>x", SWING, attributes=failed)]
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
        for outside in ("http://", "@import"):
            assert outside not in text
        assert text.count("https://") == text.count('<a href="https://doi.org/')  # a link, which asks for nothing
        assert not re.search(r"url\((?!#)", text)
        assert not re.search(r"<(link|img|iframe|object)\b|\ssrc=", text)
        assert "default-src 'none'" in text
        links = re.findall(r'\shref="([^"]*)"', text)
        targets = {value.split("#")[0] for value in links if not value.startswith("https://")} - {""}
        assert all((report / target).is_file() for target in targets)
        ids = re.findall(r'\sid="([^"]*)"', text)
        assert len(set(ids)) == len(ids), path.name
        assert {value[1:] for value in links if value.startswith("#")} <= set(ids)


def test_file_names_stay_in_the_folder_and_differ() -> None:
    names = page_names(["paper/fig05", "/etc/passwd", "index", "figures", "A", "a", "ü/ß", "x" * 300])
    assert names["paper/fig05"] == "paper-fig05.html"
    assert names["figures"] == "figures-2.html"
    assert all(re.fullmatch(r"[A-Za-z0-9_-][A-Za-z0-9._-]*\.html", name) for name in names.values())
    assert len({name.lower() for name in names.values()} | {"index.html", "errata.html"}) == len(names) + 2
    assert page_names(["data--2"]) == {"data--2": "scene-data--2.html"}
    for bad in ("../x", "a/../b", "..", "a\\..\\b"):
        with pytest.raises(StoreError, match="file name"):
            page_names([bad])


def test_own_old_pages_go_and_foreign_files_stay(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write_report(store(tmp_path / "a.h5", [Made(PLAIN, TAYLOR, SWING)]), out)
    (out / "notes.html").write_text("mine")
    (out / "data.csv").write_text("1")
    write_report(store(tmp_path / "b.h5", [Made(replace(PLAIN, name="other"), TAYLOR, SWING)]), out)
    assert sorted(path.name for path in out.iterdir()) == ["data.csv", "index.html", "notes.html", "other.html"]


@pytest.mark.full
def test_the_same_file_gives_the_same_bytes_in_any_number_of_processes(tmp_path: Path) -> None:
    path = store(tmp_path / "r.h5", [Made(replace(PLAIN, name=name), TAYLOR, SWING) for name in ("one", "two")])
    folders = [write_report(path, tmp_path / str(jobs), jobs=jobs).parent for jobs in (1, 2)]
    first, second = ({page.name: page.read_bytes() for page in folder.iterdir()} for folder in folders)
    assert sorted(first) == ["index.html", "one.html", "two.html"]
    assert first == second
