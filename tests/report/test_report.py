"""The report of synthetic files: what is drawn, what is left out, what is escaped, where it is written."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from matplotlib.lines import Line2D
from support.scenes import paper
from support.stored import Made, rotor, store

from rotor_mbs.analysis.campbell import FloquetTable
from rotor_mbs.errors import StoreError
from rotor_mbs.methods.catalogue import ladders, method_names
from rotor_mbs.report.build import write_report
from rotor_mbs.report.core import canvas, numbers, svg
from rotor_mbs.report.core.canvas import panels
from rotor_mbs.report.core.elements import MARKS
from rotor_mbs.report.core.files import page_names
from rotor_mbs.report.core.looks import (
    COLOURS,
    GREY,
    PALETTE,
    Look,
    class_of,
    coordinate_look,
    label_of,
    look_of,
)
from rotor_mbs.report.pages.modes import multipliers
from rotor_mbs.report.pages.scene_tables import range_table
from rotor_mbs.report.plots import time_histories as figures
from rotor_mbs.report.plots.paths import paths
from rotor_mbs.runs.read import open_results

FIG11 = paper("fig11", samples=301)
PLAIN = replace(FIG11, outputs=("angles",))
PRINTED, REFERENCE, TAYLOR, TREE = "printed/ode45", "reference", "lagrange/taylor", "exudyn_tree/rk67"
SWING = rotor(lambda t: 0.5 + 0.2 * np.sin(t), lambda t: 0.1 * t, np.cos, np.sin)
LOOK = Look("#0072b2", "-", "o")
TIME = np.linspace(0.0, 10.0, 1001)


class Page(HTMLParser):
    """Tags in order, section ids and text of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str]] = []
        self.sections: list[str] = []
        self.words = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += [(name, value or "") for name, value in attrs]
        if tag == "section":
            self.sections.append(dict(attrs)["id"] or "")

    def handle_data(self, data: str) -> None:
        if self.tags[-1:] != ["style"]:
            self.words += data.replace(numbers.SPACE, " ")


def page(folder: Path, name: str = "paper-fig11.html") -> Page:
    return Page((folder / name).read_text(encoding="utf-8"))


def full_set() -> list[Made]:
    return [
        Made(FIG11, REFERENCE, SWING),
        Made(FIG11, PRINTED, rotor(lambda t: 2.7315 * np.sin(0.3 * t), lambda t: -30.0 * t), gain=1e6, refined=True),
        Made(FIG11, TAYLOR, lambda t: SWING(t) + 1e-12 * t[:, None]),
        Made(FIG11, TREE, lambda t: SWING(t) + 1e-10 * t[:, None]),
    ]


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    return write_report(store(folder / "r.h5", full_set()), folder / "out").parent


# What is drawn


def test_motion_gives_rotor_and_pitches_axes_of_their_own() -> None:
    angles, rates = SWING(TIME[::4]), np.cos(SWING(TIME[::4]))
    picture = figures.motion(TIME[::4], angles, rates, horizon=6.0)
    assert [axes.get_ylabel() for axes in picture.axes] == [
        "rotor angle (rad)", "pitch angle (rad)", "rotor rate (rad/s)", "pitch rate (rad/s)",
    ]  # fmt: skip
    for place, (values, first) in enumerate([(angles, 0), (angles, 1), (rates, 0), (rates, 1)]):
        *lines, mark = picture.axes[place].get_lines()
        columns = values[:, :1] if first == 0 else values[:, 1:]
        assert len(lines) == columns.shape[1]
        for i, (line, column) in enumerate(zip(lines, columns.T, strict=True)):
            np.testing.assert_array_equal(line.get_xydata(), np.column_stack([TIME[::4], column]))
            assert line.get_color() == coordinate_look(first + i).colour
        assert mark.get_xdata() == [6.0, 6.0]


def test_only_what_is_there_is_drawn() -> None:
    assert len(figures.motion(TIME, SWING(TIME), None).axes) == 2
    assert len(figures.motion(TIME, SWING(TIME)[:, :1], None).axes) == 1


def test_thinning_loses_no_peak() -> None:
    values = np.sin(np.arange(100_000.0))
    values[54_321], values[77_777] = 9.0, -8.0
    time, thin = figures.thin(np.arange(100_000.0), values)
    assert len(time) <= 1001
    assert (thin.max(), thin.min()) == (9.0, -8.0)
    assert time[thin.argmax()] == 54_321.0
    assert (np.diff(time) > 0).all()


def test_differences_are_drawn_at_their_largest_and_zero_is_a_gap() -> None:
    error = np.where(TIME < 5.0, 0.0, 1e-9 * TIME)
    error[700] = 1e-3
    picture = figures.errors([figures.Series(TIME, error, LOOK)], "error (rad)")
    drawn = picture.axes[0].get_lines()[0].get_xydata()
    assert picture.axes[0].get_yscale() == "log"
    assert np.nanmax(drawn[:, 1]) == 1e-3
    assert np.isnan(drawn[drawn[:, 0] < 4.9, 1]).all()


def test_a_runaway_does_not_flatten_the_rest() -> None:
    rates = np.sin(TIME)[:, None].copy()
    rates[-20:] = 1e6
    picture = figures.motion(TIME, None, rates)
    assert figures.is_cut(rates)
    assert picture.axes[0].get_ylim()[1] < 5.0


def test_a_jolt_that_passes_is_shown_whole() -> None:
    rates = 1e-3 * np.sin(TIME)[:, None]
    rates[100:130, 0] = 1.6  # a step of a pitch command
    assert not figures.is_cut(rates)
    assert figures.motion(TIME, None, rates).axes[0].get_ylim()[1] >= 1.6


def test_rounding_is_not_blown_up_into_a_motion() -> None:
    rates = 1e-13 * np.sin(TIME)[:, None]
    low, high = figures.motion(TIME, rates, None).axes[0].get_ylim()
    assert high - low > 0.1


def test_paths_have_equal_scales_and_an_axis_of_stated_length() -> None:
    tip = np.stack([30.0 * np.cos(TIME), 0.05 * np.sin(9.0 * TIME), 30.0 * np.sin(TIME)], axis=1)[:, None, :]
    (space,) = paths(tip).axes
    assert space.get_aspect() == 1.0
    assert "10 m" in [text.get_text() for text in space.texts]
    axis = next(line.get_xydata() for line in space.get_lines() if len(line.get_xdata()) == 2 and _is_vertical(line))
    np.testing.assert_allclose(np.ptp(axis[:, 1]), 10.0 * np.cos(np.radians(14.0)))


def _is_vertical(line: Line2D) -> bool:
    x, y = line.get_xydata().T
    return bool(x[0] == x[1] and y[0] != y[1] and x[0] < 0.0)


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_a_picture_has_every_point_label_and_colour_of_its_axes(scale: str) -> None:
    picture = panels((2.0,), "time (s)")
    axes = picture.axes[0]
    axes.set_yscale(scale)
    axes.plot([0.0, 0.5, 1.0, 1.0, 2.0], [0.1234567, 0.5, 0.25, 0.75, 0.123], color=COLOURS[2], marker="s")
    canvas.ticks(axes.yaxis, {0.125: "0.125", 0.625: "0.625"})
    axes.set_ylabel("angle (rad)")
    text = str(svg.picture(picture, "n", "title <b>", "described & so").svg)
    for shown in (">0.125<", ">0.625<", ">time (s)<", ">angle (rad)<", "title &lt;b&gt;", "described &amp; so"):
        assert shown in text
    curve, marks = re.findall(rf'class="{class_of(COLOURS[2])}[^"]*"[^>]* d="([^"]*)"', text)
    wanted = axes.transData.transform(axes.get_lines()[0].get_xydata()) * 72.0 / picture.figure.dpi
    height = 72.0 * picture.figure.get_figheight()
    begin, _, steps = curve.removeprefix("M").partition("l")
    drawn = np.vstack(
        [np.array(begin.split(), float), np.array(re.findall(r"-?(?:\d+\.?\d*|\.\d+)", steps), float).reshape(-1, 2)]
    )
    np.testing.assert_allclose(drawn.cumsum(axis=0), wanted * (1, -1) + np.array([0.0, height]), atol=0.11)
    assert marks.count("M") == len(wanted)


def test_a_gap_in_a_curve_is_a_gap_in_its_picture() -> None:
    picture = panels((2.0,), "time (s)")
    picture.axes[0].plot([0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 1.0, np.nan, 1.0, 0.5], color=COLOURS[2])
    text = str(svg.picture(picture, "n", "t", "d").svg)
    curve = re.search(rf'class="{class_of(COLOURS[2])}"[^>]* d="([^"]*)"', text)
    assert curve is not None
    assert curve[1].count("M") == 2
    assert "nan" not in text


def test_a_straight_curve_of_many_samples_is_short() -> None:
    picture = panels((2.0,), "time (s)")
    picture.axes[0].plot(TIME, 0.3 * TIME, color=COLOURS[2])
    assert len(str(svg.picture(picture, "n", "t", "d").svg)) < 5000  # a thousand steps would be 8 characters each


def test_a_factor_of_the_tick_labels_stands_with_the_unit() -> None:
    picture = panels((2.0,), "time (s)")
    picture.axes[0].plot([0.0, 1.0], [0.0, 3e-4])
    picture.axes[0].set_ylabel("pitch angle (rad)")
    text = str(svg.picture(picture, "a", "b", "c").svg).replace(numbers.SPACE, " ")
    assert ">pitch angle (10⁻⁴ rad)<" in text
    assert ">3.0<" in text
    assert "1e" not in text


def test_multipliers_that_differ_tenfold_have_powers_of_ten_as_labels() -> None:
    ones, small = np.ones(2), np.array([0.02, 0.5])
    table = FloquetTable(np.array([0.1, 3.0]), np.stack([ones, small], 1), small, np.ones(2, int), ones, ones, ones)
    text = str(svg.picture(multipliers(table), "n", "t", "d").svg)
    assert re.findall(r">(10[⁻\d⁰¹²³⁴-⁹]+)<", text) == ["10⁻²", "10⁻¹", "10⁰"]
    assert "$" not in text


def test_no_tick_stands_outside_its_axes() -> None:
    picture = panels((2.0,), "time (s)")
    axes = picture.axes[0]
    axes.plot([0.0, 1.0], [1e-16, 1e-13])
    canvas.log_axis(axes, 1e-16, 1e-13)
    text = str(svg.picture(picture, "n", "t", "d").svg)
    assert re.findall(r">(10[⁻\d⁰¹²³⁴-⁹]+)<", text) == ["10⁻¹⁶", "10⁻¹⁵", "10⁻¹⁴", "10⁻¹³"]


def test_every_colour_of_a_picture_is_in_the_style_sheet_light_and_dark(report: Path) -> None:
    for path in report.glob("*.html"):
        text = path.read_text(encoding="utf-8")
        style = text[: text.index("</style>")]
        for name in set(re.findall(r'class="(k\d+)', text)):
            assert style.count(f"--{name}:") == 2, name
            assert f".{name}{{color:var(--{name})}}" in style
        assert not re.search(r'(stroke|fill)="#', text[len(style) :])  # no colour that a dark page could not change


def test_colours_of_methods_and_of_coordinates_differ() -> None:
    of_methods = {look_of(name).colour for name in ("reference", *method_names())}
    of_coordinates = {coordinate_look(index).colour for index in range(12)}
    assert not of_methods & of_coordinates
    assert of_methods | of_coordinates <= set(PALETTE)


# What a page has


def test_a_full_page_has_every_section_and_headings_in_order(report: Path) -> None:
    found = page(report)
    assert found.sections == ["paper", "motion", "paths", "energy", "difference", "cost", "metrics", "file"]
    headings = [tag for tag in found.tags if re.fullmatch(r"h\d", tag)]
    assert headings == ["h1"] + ["h2"] * (len(headings) - 1)
    assert found.tags.count("figcaption") == found.tags.count("figure") == 1 + 2 + 5 + 1 + 1 + 1
    images = [value for name, value in found.attributes if name == "role" and value == "img"]
    assert len(images) == found.tags.count("figure") + found.tags.count("canvas")
    assert (report / "paper-fig11.html").stat().st_size < 250_000


def test_the_index_states_the_finding(report: Path) -> None:
    found = page(report, "index.html")
    assert "as printed give all 1 published numbers; with their three errors corrected, none." in found.words
    assert "make energy from nothing in 1 of 1 scenes, up to 1.00 MJ." in found.words
    assert "1.0×10⁻¹¹ rad (closed form, Taylor)" in found.words  # 1e-12 per second over 10 s
    assert "1.0×10⁻⁹ rad (Exudyn tree, RK67)" in found.words
    assert ("href", "paper-fig11.html") in found.attributes
    errata = page(report, "errata.html").words
    assert "E1" in errata
    assert "the first and second derivatives of its transformation (3) by the angles" in errata


FIG05 = paper("fig05", samples=301)
# Two of Fig. 5's three numbers, 0.5127 and 0.5273 rad; so slow that the third, 0.0458 rad/s, does not come out.
FIG05_ANGLES = rotor(lambda t: 0.52 + 0.0073 * np.sin(2.0 * t))


def test_numbers_that_are_rounding_error_are_marked_on_every_page(tmp_path: Path) -> None:
    runs = [Made(FIG05, PRINTED, FIG05_ANGLES, refined=True), Made(FIG05, REFERENCE, rotor(lambda t: 0.52 + 0.0 * t))]
    folder = write_report(store(tmp_path / "r.h5", runs), tmp_path / "out").parent
    for name, times in (("index.html", 2), ("paper-fig05.html", 2), ("figures.html", 1)):
        assert page(folder, name).words.count("amplified rounding error") >= times, name


def test_energy_of_runs_that_ended_early_is_not_the_largest_of_the_finding(tmp_path: Path) -> None:
    broken = {"status": "solver_failed", "message": "gave up"}
    away = replace(FIG11, name="paper/fig12")
    runs = [
        Made(FIG11, PRINTED, SWING, gain=1e6),
        Made(away, PRINTED, SWING, gain=1e12, until=0.5, attributes=broken),
    ]
    found = page(write_report(store(tmp_path / "r.h5", runs), tmp_path / "out").parent, "index.html")
    # 149/300 of 1e12 J
    assert "in 2 of 2 scenes, up to 1.00 MJ; in paper/fig12 497 GJ before its run breaks off." in found.words


def test_equations_that_are_not_claimed_correct_are_not_called_ok(report: Path) -> None:
    text = (report / "paper-fig11.html").read_text(encoding="utf-8")
    metrics = text[text.index('<section id="metrics">') :].replace("<wbr>", "")
    rows = dict(re.findall(r'<tr><th scope="row">([^<]*)<small>[^<]*</small></th><td>(.*?)</td>', metrics))
    assert rows["as printed, ode45"] == "runs to the end"
    assert rows["closed form, Taylor"] == '<span class="good">ok</span>'
    assert "is not thereby correct" in metrics
    assert "<small>lagrange/taylor</small>" in metrics  # the name that the command line and the file have


def test_every_method_and_every_curve_of_a_bench_has_a_look_of_its_own() -> None:
    looks = {name: look_of(name) for name in ("reference", *method_names(), *(ladder.curve for ladder in ladders()))}
    assert len(set(looks.values())) == len(looks)
    for one, other in combinations(method_names(), 2):  # methods differ by more than a colour
        a, b = looks[one], looks[other]
        assert (a.colour != b.colour) + (a.line != b.line) + (a.marker != b.marker) >= 2, (one, other)
    for look in looks.values():
        assert look.marker in MARKS  # the legend can draw it
        assert look.colour in (*COLOURS, GREY)
    assert look_of("mine/own").colour == GREY
    assert label_of("mine/own") == "mine/own"


def test_extremes_are_those_of_the_points_that_the_published_numbers_are_read_off(tmp_path: Path) -> None:
    """A crest between two samples: the table and the claim beside it must not differ."""
    narrow = rotor(lambda t: 0.5 + 0.2315 * np.exp(-(((t - 5.02) / 0.01) ** 2)))
    runs = [Made(FIG11, PRINTED, narrow, refined=True)]
    with open_results(store(tmp_path / "r.h5", runs)) as opened:
        run = opened.scenes["paper/fig11"].runs[PRINTED]
        assert run.array("angles").max() < run.array("refined_angles").max()
        (first, *_) = range_table({"As printed": run}).rows
        assert str(first[1]).endswith(numbers.number(float(run.array("refined_angles")[:, 0].max()), 4))


def test_no_caption_repeats_its_heading(report: Path) -> None:
    for path in report.glob("*.html"):
        for section in re.findall(r"<section.*?</section>", path.read_text(encoding="utf-8"), re.S):
            headings = set(re.findall(r"<h2>(.*?)</h2>", section))
            assert not headings & set(re.findall(r"<caption><span>(.*?)</span>", section)), path.name


def test_one_scene_and_one_method_make_a_report_without_empty_sections(tmp_path: Path) -> None:
    scene = replace(PLAIN, name="mine", title="Mine", figures=(), text="")
    folder = write_report(store(tmp_path / "r.h5", [Made(scene, TAYLOR, SWING)]), tmp_path / "out").parent
    assert sorted(path.name for path in folder.iterdir()) == ["index.html", "mine.html"]
    found = page(folder, "mine.html")
    assert found.sections == ["motion", "metrics"]
    index = page(folder, "index.html")
    assert index.sections == ["scenes", "machine"]
    assert "paper" not in index.words.lower()


def test_a_failed_run_shows_its_reason_and_its_partial_data(tmp_path: Path) -> None:
    failed = {"status": "solver_failed", "message": "the step became <too> small"}
    runs = [
        Made(FIG11, REFERENCE, SWING),
        Made(FIG11, PRINTED, SWING, until=0.4, attributes=failed),
        Made(FIG11, TREE, SWING, until=0.0, attributes={"status": "timed_out", "message": "60 s"}),
    ]
    folder = write_report(store(tmp_path / "r.h5", runs), tmp_path / "out").parent
    found = page(folder)
    assert "as printed, ode45: solver failed. the step became <too> small (samples up to 3.967 s)" in found.words
    assert "Exudyn tree, RK67: timed out. 60 s" in found.words
    assert {"motion", "difference", "energy", "paths"} <= set(found.sections)


# Safety


def test_texts_from_the_file_are_escaped(tmp_path: Path) -> None:
    evil = "<script>alert(1)</script>"
    scene = replace(FIG11, name="a b/<i>", title=evil, text=f"# {evil}\n{FIG11.text}\n# </pre>{evil}")
    failed = {"status": evil, "message": evil}
    runs = [Made(scene, REFERENCE, SWING), Made(scene, f"lagrange/{evil[:8]}>x", SWING, attributes=failed)]
    folder = write_report(store(tmp_path / "r.h5", runs), tmp_path / "o")
    for path in folder.parent.glob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert evil not in text
        assert f"{evil[:8]}>x" not in text
        assert "<i>" not in text
        assert "&lt;script&gt;" in text


def test_pages_need_nothing_from_outside(report: Path) -> None:
    for path in report.glob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert "http://" not in text
        assert "https://" not in text
        assert "@import" not in text
        assert not re.search(r"url\((?!#)", text)
        found = Page(text)
        assert not {"link", "img", "iframe", "object"} & set(found.tags)
        assert "src" not in dict(found.attributes)
        assert "default-src 'none'" in text
        links = [value for name, value in found.attributes if name in ("href", "src")]
        targets = {value.split("#")[0] for value in links} - {""}
        assert all((report / target).is_file() for target in targets)
        ids = [value for name, value in found.attributes if name == "id"]
        assert len(set(ids)) == len(ids), path.name
        assert {value[1:] for value in links if value.startswith("#")} <= set(ids)


def test_file_names_stay_in_the_folder_and_differ() -> None:
    names = page_names(["paper/fig05", "/etc/passwd", "index", "A", "a", "ü/ß", "x" * 300])
    assert names["paper/fig05"] == "paper-fig05.html"
    assert all(re.fullmatch(r"[A-Za-z0-9_-][A-Za-z0-9._-]*\.html", name) for name in names.values())
    assert len({name.lower() for name in names.values()} | {"index.html", "errata.html"}) == len(names) + 2
    assert set(page_names(["data--2", "Bench-fig11"]).values()) == {"scene-data--2.html", "scene-Bench-fig11.html"}
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
    (out / "index.html").write_text("mine")
    with pytest.raises(StoreError, match=r"index\.html: not a page of rotor_mbs.*another folder"):
        write_report(tmp_path / "a.h5", out)
    assert (out / "index.html").read_text() == "mine"


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    path = store(tmp_path / "r.h5", [Made(PLAIN, TAYLOR, SWING)])
    with pytest.raises(StoreError, match=r"r\.h5.*cannot be written") as caught:
        write_report(path, path)
    assert "\n" not in str(caught.value)
    with pytest.raises(StoreError, match="no such file"):
        write_report(tmp_path / "none.h5", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_the_same_file_gives_the_same_bytes_in_any_number_of_processes(tmp_path: Path) -> None:
    runs = [Made(replace(PLAIN, name=name), TAYLOR, SWING) for name in ("one", "two")]
    path = store(tmp_path / "r.h5", runs)
    write_report(path, tmp_path / "a", jobs=1)
    write_report(path, tmp_path / "b", jobs=2)
    names = sorted(one.name for one in (tmp_path / "a").iterdir())
    assert names == ["index.html", "one.html", "two.html"]
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_the_report_is_built_without_any_engine(tmp_path: Path) -> None:
    path = store(tmp_path / "r.h5", [Made(PLAIN, REFERENCE, SWING), Made(PLAIN, PRINTED, SWING)])
    code = (
        "import sys\n"
        "for name in ('exudyn', 'heyoka', 'scipy'): sys.modules[name] = None\n"
        "from rotor_mbs.cli import main\n"
        "status = main(['report', sys.argv[1], '-o', sys.argv[2]])\n"
        "sys.exit(status)\n"
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code, str(path), str(tmp_path / "out")], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == str(tmp_path / "out" / "index.html")
    assert (tmp_path / "out" / "paper-fig11.html").is_file()


@pytest.mark.parametrize(
    ("shown", "wanted"),
    [
        (numbers.number(1.2345e-10), "1.2×10⁻¹⁰"),
        (numbers.number(0.9999), "1.0"),
        (numbers.number(-12.34, 3), "−12.3"),
        (numbers.number(0.0), "0"),
        (numbers.number(float("nan")), "not finite"),
        (numbers.number(None), "–"),
        (numbers.fixed(-0.00001, 4), "0.0000"),
        (numbers.prefixed(1.1234e6, "J"), "1.12 MJ"),
        (numbers.prefixed(999.9, "J"), "1.00 kJ"),
        (numbers.prefixed(150.0, "J", 2), "150 J"),
        (numbers.prefixed(3e-12, "J"), "3.0×10⁻¹² J"),
        (
            numbers.typeset("off by 8.1e+00 rad, 1e-06 of it, in stiff/torque-1e9"),
            "off by 8.1 rad, 10⁻⁶ of it, in stiff/torque-1e9",
        ),
        (" to ".join(numbers.apart(0.52359877, 0.52359879)), "0.52359877 to 0.52359879"),
        (" to ".join(numbers.apart(0.5, 0.5)), "0.5000 to 0.5000"),
    ],
)
def test_numbers_read_well(shown: str, wanted: str) -> None:
    assert shown.replace(numbers.SPACE, " ") == wanted


@pytest.mark.parametrize("value", [0.0, 1e17])
def test_a_constant_has_a_range_that_holds_it(value: float) -> None:
    axes = panels((1.0,), "").axes[0]
    figures.set_range(axes, np.full((3, 1), value))
    low, high = axes.get_ylim()
    assert low < value < high
