"""Pictures of the printed model beside the corrected one, held on what is drawn: data, labels, units, colours."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from support.scenes import paper
from support.stored import Made, rotor, store

from rotor_mbs.analysis.claims import Agreement, Finding, Tally
from rotor_mbs.methods.catalogue import look_of
from rotor_mbs.report.build import write_report
from rotor_mbs.report.core.looks import COLOURS, COORDINATES, GREY, coordinate_look
from rotor_mbs.report.pages import comparison_pictures as comparisons
from rotor_mbs.report.pages.comparison_pictures import Mark, parting
from rotor_mbs.report.pages.index import heat_map, short_sentences
from rotor_mbs.report.plots.time_histories import Series, errors
from rotor_mbs.runs.read import open_results

TIME = np.linspace(0.0, 10.0, 201)
PRINTED, CORRECTED = look_of("printed/ode45"), look_of("lagrange/taylor")
FIG11 = paper("fig11", samples=301)


def test_a_published_value_stands_in_the_plot_at_its_height() -> None:
    series = [Series(TIME, 2.7 * np.sin(0.2 * TIME), PRINTED), Series(TIME, 0.3 * TIME, CORRECTED)]
    picture = comparisons.departure(
        [("rotor angle (rad)", series)], [Mark(0, 2.7315, "published 2.7315 rad")], 6.0, 1.5
    )
    (axes,) = picture.axes
    heights = [line.get_ydata()[0] for line in axes.get_lines() if line.get_linestyle() == ":"]
    assert heights == [2.7315]
    assert [text.get_text().strip() for text in axes.texts] == ["published 2.7315 rad", "0.05 rad apart at 1.5 s"]
    assert axes.get_ylabel() == "rotor angle (rad)"
    assert [line.get_xdata()[0] for line in axes.get_lines()[-2:]] == [6.0, 1.5]


def test_energies_of_very_different_size_are_all_readable() -> None:
    """1 MJ made by the printed model, 40 J lost by the chain, a rounding error: magnitudes; gains have filled marks."""
    values = (1e6 * TIME / 10.0, -40.0 * TIME / 10.0, 1e-4 * np.sin(TIME))
    (axes,) = errors([Series(TIME, x, PRINTED) for x in values], "energy (J)", signed=True).axes
    assert axes.get_yscale() == "log"
    low, high = axes.get_ylim()
    assert low <= 1e-5
    assert high >= 1e6
    curves, marks = axes.get_lines()[::2], axes.get_lines()[1::2]
    for curve, filled, wanted in zip(curves, marks, values, strict=True):
        x, y = curve.get_xydata().T
        shown = np.isfinite(y)
        np.testing.assert_allclose(y[shown], np.interp(x[shown], TIME, np.abs(wanted)), atol=1e-9 * y[shown].max())
        gained = np.interp(filled.get_xdata(), TIME, wanted)
        assert (gained > 0.0).all()
        assert bool(len(gained)) == bool((wanted > 0.0).any())
    assert len(marks[0].get_xdata()) > 5


def test_offsets_over_azimuth_do_not_draw_the_way_back_over_the_top() -> None:
    angles = np.stack([TIME, 0.0 * TIME], axis=1)  # 1.6 turns
    tip = np.stack([np.sin(TIME), 0.05 * np.cos(3.0 * TIME), np.cos(TIME)], axis=1)[:, None, :]
    (axes,) = comparisons.offsets_over_azimuth(angles, tip, [0.0]).axes
    x, y = axes.get_lines()[0].get_xydata().T
    assert np.nanmax(np.abs(np.diff(x))[np.isfinite(np.diff(y))]) < 10.0
    np.testing.assert_allclose(np.nanmax(y), 50.0, rtol=1e-2)
    assert axes.get_ylabel() == "tip out of plane (mm)"
    assert "°" in axes.get_xlabel()
    assert axes.get_lines()[0].get_color() == coordinate_look(1).colour


def test_every_scene_has_its_energy_at_its_place() -> None:
    rows = {"fig03": [(1e-4, PRINTED), (1e-15, CORRECTED)], "fig11": [(0.15, PRINTED)]}
    (axes,) = comparisons.energy_of_scenes(rows).axes
    drawn = [(*line.get_xydata()[0], line.get_color()) for line in axes.get_lines()]
    assert drawn == [(1e-4, 0, PRINTED.colour), (1e-15, 0, CORRECTED.colour), (0.15, 1, PRINTED.colour)]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["fig03", "fig11"]
    assert axes.get_xscale() == "log"


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("glance")
    right = rotor(lambda t: 0.5 + 0.31 * t, lambda t: np.sin(t), np.cos, np.sin)
    wrong = rotor(lambda t: 2.7315 * np.sin(0.3 * t + 0.185), lambda t: np.sin(t) - 0.02 * t**2, np.cos, np.sin)
    runs = [
        Made(FIG11, "reference", right),
        Made(FIG11, "printed/ode45", wrong, gain=1e6, refined=True),
        Made(FIG11, "lagrange/taylor", lambda t: right(t) + 1e-12 * t[:, None]),
        Made(FIG11, "exudyn_tree/rk67", lambda t: right(t) + 1e-9, attributes={"status": "inaccurate"}),
    ]
    return write_report(store(folder / "r.h5", runs), folder / "out").parent


def test_no_picture_has_colours_of_methods_and_of_coordinates(report: Path) -> None:
    methods = {f"k{i}" for i in range(len(COLOURS))} - {"k0"}
    coordinates = {f"k{len(COLOURS) + i}" for i in range(len(COORDINATES))}
    assert GREY not in (*COLOURS, *COORDINATES)
    seen = 0
    for path in report.glob("*.html"):
        for figure in re.findall(r"<figure>.*?</figure>", path.read_text(encoding="utf-8"), re.S):
            used = set(re.findall(r'class="(k\d+)', figure))
            assert not (used & methods and used & coordinates), (path.name, used)
            seen += bool(used & methods)
    assert seen > 4


def test_a_legend_names_nothing_that_is_not_in_its_pictures(report: Path) -> None:
    text = (report / "paper-fig11.html").read_text(encoding="utf-8")
    for figure in re.findall(r"<figure>.*?</figure>", text, re.S):
        picture, _, legend = figure.partition('<ul class="legend">')
        for name in set(re.findall(r'class="(k\d+)', legend)):
            assert f'class="{name}' in picture


def test_the_opening_states_where_the_models_part_and_by_how_much(report: Path) -> None:
    text = (report / "paper-fig11.html").read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
    opening = text[text.index('<div class="opening">') : text.index("What the paper says")]
    assert 'class="viewer"' in opening
    assert re.search(r"The models are 0\.05 rad apart at 0\.\d+ s; their angles differ by up to [\d.]+ rad", opening)
    assert "Largest rotor angle, rad: published 2.7315, as printed 2.731" in opening
    assert ">published 2.7315 rad<" in opening
    lead = text[text.index('<div class="finding">') : text.index('<div class="opening">')]
    assert re.search(
        r"departs from the reference at 0\.\d+ s by 0\.05 rad, in the end by up to [\d.]+ rad; its energy rises", lead
    )


def test_the_models_part_where_their_angles_first_differ_visibly(tmp_path: Path) -> None:
    runs = [Made(FIG11, "reference", rotor(lambda t: 0.0 * t)), Made(FIG11, "printed/ode45", rotor(lambda t: 0.02 * t))]
    with open_results(store(tmp_path / "r.h5", runs)) as opened:
        found = opened.scenes["paper/fig11"].runs
        when, largest = parting(found["printed/ode45"], found["reference"])
        assert parting(found["reference"], found["reference"]) == (None, 0.0)
    assert when == pytest.approx(2.5, abs=0.04)
    assert largest == pytest.approx(0.2)


def test_the_index_opens_with_pictures_then_three_sentences_then_folded_tables(report: Path) -> None:
    text = (report / "index.html").read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
    lead = re.search(r'<div class="finding">(.*?)</div>', text, re.S)
    assert lead is not None
    assert lead[1].count("<p>") == 3
    assert re.search(r"as printed give all 1 published numbers; with their three errors corrected, \w+\.", lead[1])
    assert "make energy from nothing in 1 of 1 scenes, up to 1.00 MJ" in lead[1]
    assert re.search(r"reference to [^ ]+ rad \([^)]+\), .*up to each", lead[1])
    first_table = text.index("<table")
    for needed in ('class="viewer"', 'class="card still"', ">published 2.7315 rad<", "energy made from nothing"):
        assert 0 < text.index(needed) < first_table, needed
    rest = text[text.index('<section id="scenes"') :]
    assert "<table" in rest
    assert "<table" not in re.sub(r"<details>.*?</details>", "", rest, flags=re.S)
    assert len(text.encode()) < 600_000


def test_the_heat_map_has_the_errors_the_methods_and_the_marks(report: Path, tmp_path: Path) -> None:
    text = (report / "index.html").read_text(encoding="utf-8")
    heat = text[text.index('<table class="heat">') :].replace("<wbr>", "")
    assert "lagrange/taylor" in heat
    shades = re.findall(r'<td class="h(\d)" title="[^"]*">([^<]*?)(?: <b>(.)</b>)?</td>', heat)
    assert [(int(shade), mark) for shade, _, mark in shades] == [(7, ""), (1, ""), (2, "≠")]
    assert "≠: inaccurate" in heat
    runs = [Made(FIG11, "lagrange/taylor", rotor(lambda t: t))]
    with open_results(store(tmp_path / "r.h5", runs)) as opened:
        assert heat_map(opened.scenes, {"paper/fig11": "x.html"}) is None  # nothing was compared


def test_a_report_without_a_paper_has_a_short_finding_of_its_own() -> None:
    one = Finding(None, None, None, None, (Agreement("lagrange/taylor", Tally(1, 1), 1e-11, 1e-14, 0.1),))
    (sentence,) = short_sentences(one)
    assert sentence.startswith("The corrected model agrees with a quad-precision reference to 1.0×10⁻¹¹")
