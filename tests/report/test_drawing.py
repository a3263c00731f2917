"""What is drawn, from plain arrays: data, axes, labels, colours; pictures as SVG; numbers as text."""

from __future__ import annotations

import re
from itertools import combinations

import numpy as np
import pytest
from support.stored import rotor

from rotor_mbs.methods.catalogue import ladders, method_names
from rotor_mbs.report import canvas, numbers
from rotor_mbs.report import plots as figures
from rotor_mbs.report.canvas import panels
from rotor_mbs.report.elements import picture as picture_in_page
from rotor_mbs.report.looks import COLOURS, Look, coordinate_look, look_of, name_of_colour
from rotor_mbs.report.pages import scene as scene_page
from rotor_mbs.report.plots import Series, paths

LOOK = Look("#0072b2", "-", "o")
PRINTED, CORRECTED = look_of("printed/ode45"), look_of("lagrange/taylor")
SWING = rotor(lambda t: 0.5 + 0.31 * t, np.sin, np.cos, np.sin)
TIME = np.linspace(0.0, 10.0, 1001)


def test_motion_gives_rotor_and_pitches_axes_of_their_own() -> None:
    time = TIME[::4]
    angles, rates = SWING(time), np.cos(SWING(time))
    picture = figures.motion(time, angles, rates, horizon=6.0)
    assert [axes.get_ylabel() for axes in picture.axes] == [
        "rotor angle (rad)", "pitch angle (rad)", "rotor rate (rad/s)", "pitch rate (rad/s)",
    ]  # fmt: skip
    for place, (values, first) in enumerate([(angles, 0), (angles, 1), (rates, 0), (rates, 1)]):
        *lines, mark = picture.axes[place].get_lines()
        columns = values[:, :1] if first == 0 else values[:, 1:]
        for i, (line, column) in enumerate(zip(lines, columns.T, strict=True)):
            np.testing.assert_array_equal(line.get_xydata(), np.column_stack([time, column]))
            assert line.get_color() == coordinate_look(first + i).colour
        assert mark.get_xdata() == [6.0, 6.0]
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
    picture = figures.errors([Series(TIME, error, LOOK)], "error (rad)")
    drawn = picture.axes[0].get_lines()[0].get_xydata()
    assert picture.axes[0].get_yscale() == "log"
    assert np.nanmax(drawn[:, 1]) == 1e-3
    assert np.isnan(drawn[drawn[:, 0] < 4.9, 1]).all()


def test_a_runaway_is_cut_a_jolt_is_not_and_rounding_is_not_magnified() -> None:
    runaway, jolt = np.sin(TIME)[:, None].copy(), 1e-3 * np.sin(TIME)[:, None]
    runaway[-20:] = 1e6
    jolt[100:130, 0] = 1.6  # a step of a pitch command
    assert figures.is_cut(runaway)
    assert figures.motion(TIME, None, runaway).axes[0].get_ylim()[1] < 5.0
    assert not figures.is_cut(jolt)
    assert figures.motion(TIME, None, jolt).axes[0].get_ylim()[1] >= 1.6
    low, high = figures.motion(TIME, 1e-13 * np.sin(TIME)[:, None], None).axes[0].get_ylim()
    assert high - low > 0.1
    for value in (0.0, 1e17):
        low, high = figures.motion(TIME, np.full((len(TIME), 1), value), None).axes[0].get_ylim()
        assert low < value < high


def test_energies_of_very_different_size_are_all_readable() -> None:
    """1 MJ made by the printed model, 40 J lost by the chain, a rounding error: magnitudes."""
    values = (1e6 * TIME / 10.0, -40.0 * TIME / 10.0, 1e-4 * np.sin(TIME))
    (axes,) = figures.errors([Series(TIME, x, PRINTED) for x in values], "energy (J)").axes
    low, high = axes.get_ylim()
    assert (axes.get_yscale(), low <= 1e-5, high >= 1e6) == ("log", True, True)
    for curve, wanted in zip(axes.get_lines(), values, strict=True):
        x, y = curve.get_xydata().T
        shown = np.isfinite(y)
        np.testing.assert_allclose(y[shown], np.interp(x[shown], TIME, np.abs(wanted)), atol=1e-9 * y[shown].max())


def test_paths_have_equal_scales_and_an_axis_of_stated_length() -> None:
    tip = np.stack([30.0 * np.cos(TIME), 0.05 * np.sin(9.0 * TIME), 30.0 * np.sin(TIME)], axis=1)[:, None, :]
    (space,) = paths(tip).axes
    assert space.get_aspect() == 1.0
    assert "10 m" in [text.get_text() for text in space.texts]
    # A vertical line of 10 m, seen from 14° above.
    spans = [np.ptp(line.get_xydata(), axis=0) for line in space.get_lines() if len(line.get_xdata()) == 2]
    assert any(np.allclose(span, [0.0, 10.0 * np.cos(np.radians(14.0))]) for span in spans)


def test_the_legend_of_a_picture_has_what_is_labelled_once_as_it_is_drawn() -> None:
    series = [Series(TIME, 1e-9 + TIME, CORRECTED), Series(TIME, 2.0 + TIME, CORRECTED), Series(TIME, 3.0 + TIME, LOOK)]
    picture = figures.errors(series, "error (rad)", horizon=6.0)
    picture.axes[0].fill_between(TIME, 1.0, 2.0, color=COLOURS[2], label="between")
    legend = str(picture_in_page(picture, "n", "t").legend).replace(numbers.SPACE, " ")
    entries = {label: mark for mark, label in re.findall(r"<li>(.*?)</svg> (.*?)</li>", legend)}
    assert set(entries) == {"closed form, Taylor", "horizon 6.00 s", "between"}
    assert f"stroke: var(--{name_of_colour(CORRECTED.colour)})" in entries["closed form, Taylor"]
    assert "stroke-dasharray" in entries["horizon 6.00 s"]
    assert f"fill: var(--{name_of_colour(COLOURS[2])})" in entries["between"]


def test_a_published_value_stands_in_the_plot_at_its_height() -> None:
    series = [Series(TIME, 2.7 * np.sin(0.2 * TIME), PRINTED), Series(TIME, 0.3 * TIME, CORRECTED)]
    mark = (0, 2.7315, "published 2.7315 rad")
    (axes,) = scene_page.departure([("rotor angle (rad)", series)], [mark], 6.0).axes
    assert [line.get_ydata()[0] for line in axes.get_lines() if line.get_linestyle() == ":"] == [2.7315]
    assert "published 2.7315 rad" in axes.get_legend_handles_labels()[1]
    assert axes.get_ylabel() == "rotor angle (rad)"


# Looks


def test_every_method_and_every_curve_of_a_bench_has_a_look_of_its_own() -> None:
    names = {"reference", *method_names(), *ladders()}
    looks = {name: look_of(name) for name in names}
    assert len(set(looks.values())) == len(looks)
    for first, second in combinations(method_names(), 2):  # methods differ by more than a colour
        a, b = looks[first], looks[second]
        assert (a.colour != b.colour) + (a.line != b.line) + (a.marker != b.marker) >= 2, (first, second)
    assert {look.colour for look in looks.values()} <= set(COLOURS)


# Pictures as SVG


def test_a_picture_in_a_page_has_its_labels_its_title_and_the_colours_of_the_page() -> None:
    picture = panels((2.0,), "time (s)")
    picture.axes[0].plot([0.0, 1.0, 2.0], [0.1234567, 0.5, 0.25], color=COLOURS[2], marker="s")
    canvas.ticks(picture.axes[0].yaxis, {0.125: "0.125", 0.625: "0.625"})
    picture.axes[0].set_ylabel("angle (rad)")
    text = str(picture_in_page(picture, "motion", "title <b>").svg)
    for shown in (">0.125<", ">time (s)<", ">angle (rad)<", "title &lt;b&gt;"):
        assert shown in text
    colours = set(re.findall(r"#[0-9a-f]{6}|var\(--\w+\)", text))
    assert colours == {f"var(--{name})" for name in (name_of_colour(COLOURS[2]), "ink", "grid")}
    assert all(name.startswith("motion") for name in re.findall(r' id="([^"]*)"', text))


def test_a_factor_of_the_tick_labels_stands_with_the_unit() -> None:
    picture = panels((2.0,), "time (s)")
    picture.axes[0].plot([0.0, 1.0], [0.0, 3e-4])
    picture.axes[0].set_ylabel("pitch angle (rad)")
    text = str(picture_in_page(picture, "a", "b").svg).replace(numbers.SPACE, " ")
    assert ">pitch angle (10⁻⁴ rad)<" in text
    assert ">3.0<" in text
    assert "1e" not in text


@pytest.mark.parametrize(
    ("shown", "wanted"),
    [
        (numbers.number(1.2345e-10), "1.2×10⁻¹⁰"),
        (numbers.number(0.9999), "1.0"),
        (numbers.number(0.0), "0"),
        (numbers.number(float("nan")), "not finite"),
        (numbers.number(None), "–"),
        (numbers.fixed(-0.00001, 4), "0.0000"),
        (numbers.prefixed(999.9, "J"), "1.00 kJ"),
        (numbers.prefixed(3e-13, "J"), "3.0×10⁻¹³ J"),
        (
            numbers.typeset("off by 8.1e+00 rad, 1e-06 of it, -5.3e-06 s, in stiff/torque-1e9"),
            "off by 8.1 rad, 10⁻⁶ of it, −5.3×10⁻⁶ s, in stiff/torque-1e9",
        ),
    ],
)
def test_numbers_read_well(shown: str, wanted: str) -> None:
    assert shown.replace(numbers.SPACE, " ") == wanted
