"""What is drawn, from plain arrays: data, axes, labels, colours; still pictures; numbers as
text."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from support.stored import rotor

from rotor_mbs.methods.catalogue import ladders, method_names
from rotor_mbs.report import numbers
from rotor_mbs.report import plots as figures
from rotor_mbs.report.curves import extremes
from rotor_mbs.report.elements import Curve, Horizontal, Mark, PageTable, Plot
from rotor_mbs.report.looks import PALETTE, Look, coordinate_look, look_of
from rotor_mbs.report.pages.scene_plots import range_of, settled_range
from rotor_mbs.report.plots import Series, paths
from rotor_mbs.report.stills import still

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


def test_labels_of_axes_and_legend_do_not_overlap() -> None:
    """As wide as on a page: the labels of the four panels, one below the other, and the legend."""
    picture = figures.motion(TIME, SWING(TIME), SWING(TIME)).with_legend()
    renderer = FigureCanvasAgg(picture.figure).get_renderer()
    picture.figure.draw(renderer)
    extents = [axes.yaxis.label.get_window_extent(renderer) for axes in picture.axes]
    for upper, lower in pairwise(extents):
        assert lower.y1 < upper.y0
    legend = picture.axes[0].get_legend().get_window_extent(renderer)
    assert legend.y0 >= picture.axes[0].get_window_extent(renderer).y1
    assert legend.y1 <= picture.figure.bbox.y1


@pytest.mark.parametrize("count", [1, 4, 13])
def test_a_legend_is_inside_its_figure(count: int) -> None:
    series = [Series(TIME, TIME, Look("k", "-", "", f"method {i}")) for i in range(count)]
    picture = figures.lines([("rotor angle (rad)", series)]).with_legend()
    renderer = FigureCanvasAgg(picture.figure).get_renderer()
    picture.figure.draw(renderer)
    legend = picture.axes[0].get_legend().get_window_extent(renderer)
    assert 0.0 <= picture.figure.bbox.y1 - legend.y1 < 40.0


def test_thinning_loses_no_peak_and_no_sample_of_an_ordinary_run() -> None:
    values = np.sin(np.arange(100_000.0))
    values[54_321], values[77_777] = 9.0, -8.0
    time, thin = figures.thin(np.arange(100_000.0), values)
    assert len(time) <= 4002
    assert (thin.max(), thin.min()) == (9.0, -8.0)
    assert time[thin.argmax()] == 54_321.0
    assert (np.diff(time) > 0).all()
    np.testing.assert_array_equal(figures.thin(TIME, np.sin(TIME)), (TIME, np.sin(TIME)))


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
        np.testing.assert_allclose(
            y[shown], np.interp(x[shown], TIME, np.abs(wanted)), atol=1e-9 * y[shown].max()
        )


def test_paths_have_equal_scales_and_an_axis_of_stated_length() -> None:
    tip = np.stack([30.0 * np.cos(TIME), 0.05 * np.sin(9.0 * TIME), 30.0 * np.sin(TIME)], axis=1)[
        :, None, :
    ]
    (space,) = paths(tip).axes
    assert space.get_aspect() == 1.0
    assert "10 m" in [text.get_text() for text in space.texts]
    # A vertical line of 10 m, seen from 14° above.
    spans = [
        np.ptp(line.get_xydata(), axis=0)
        for line in space.get_lines()
        if len(line.get_xdata()) == 2
    ]
    assert any(np.allclose(span, [0.0, 10.0 * np.cos(np.radians(14.0))]) for span in spans)


def test_a_jerk_at_the_start_does_not_fill_a_plot() -> None:
    """Where it alone makes the range: not a decay over a tenth of the time, nor beside rest."""
    swing = np.sin(TIME)  # from -1 to 1
    assert settled_range(TIME, [swing + 20.0 * np.exp(-TIME / 0.1), swing]) == pytest.approx(
        (-1.5, 1.5), abs=0.1
    )
    for other in (swing, swing + 20.0 * np.exp(-TIME), 20.0 * np.exp(-TIME / 0.05), 0.0 * TIME):
        assert settled_range(TIME, [other]) is None
    assert settled_range(TIME[:2], [swing[:2]]) is None
    assert settled_range(TIME, [np.full_like(TIME, np.nan)]) is None


# Looks


def test_every_method_and_every_curve_of_a_bench_has_a_look_of_its_own() -> None:
    names = {"reference", *method_names(), *ladders()}
    looks = {name: look_of(name) for name in names}
    assert len(set(looks.values())) == len(looks)
    for first, second in combinations(method_names(), 2):
        # On a page, where there are no markers, by colour or dashes; in a figure by one thing more.
        assert looks[first].css != looks[second].css, (first, second)
        a, b = looks[first], looks[second]
        assert (a.colour != b.colour) + (a.line != b.line) + (a.marker != b.marker) >= 2, (
            first,
            second,
        )
    assert {look.colour for look in looks.values()} <= {light for light, _ in PALETTE.values()}
    assert [
        name
        for name in (
            "printed/ode45",
            "lagrange/taylor",
            "exudyn_tree/rk67",
            "exudyn_chain/extrapolated",
        )
        # of the default methods it alone is dashed
        if looks[name].line != "-"
    ] == ["printed/ode45"]


def luminance(colour: str) -> float:
    """Relative luminance of sRGB, as WCAG 2.1 defines it."""
    channels = [int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


@pytest.mark.parametrize("scheme", [0, 1])
def test_curves_can_be_seen_on_their_card_in_both_schemes(scheme: int) -> None:
    """WCAG asks for a contrast of 3 of what is not text."""
    card = luminance(PALETTE["card"][scheme])
    for name, pair in PALETTE.items():
        if name in ("card", "grid", "ring", "heat"):  # behind the curves
            continue
        bright, dark = sorted((card, luminance(pair[scheme])), reverse=True)
        assert (bright + 0.05) / (dark + 0.05) >= 3.0, name


# Still pictures


def test_a_still_picture_has_the_curves_the_range_and_the_colours_of_the_page() -> None:
    axis = Horizontal("time", "s", "t", 0.0, 10.0)
    jump = Curve(
        "one", coordinate_look(1, "first"), TIME, np.where(TIME < 5.0, 0.0, 1.0), breaks=[500]
    )
    runaway = Curve("two", coordinate_look(2, "second"), TIME, np.exp(TIME))
    plot = Plot(
        "angle <b>",
        "rad",
        axis,
        [jump, runaway],
        marks=[Mark("x", y=0.5)],
        clip=(-1.0, 2.0),
        still=True,
    )
    text = str(still(plot))
    assert '<path class="curve blade-1 solid" d="M' in text
    assert 'aria-label="angle &lt;b&gt;"' in text
    assert not re.search(r"#[0-9a-f]{6}\b", text)
    assert " id=" not in text
    ticks = [float(tick.replace("−", "-")) for tick in re.findall(r">([−\d.]+)</text>", text)]
    assert max(tick for tick in ticks if tick not in (4.0, 6.0, 8.0, 10.0)) <= 2.0  # not exp(10)


def test_ticks_of_an_axis_have_equal_decimals() -> None:
    axis = Horizontal("time", "s", "t", 0.0, 10.0)
    curve = Curve("one", coordinate_look(1, "first"), TIME, 1.2672 + 4e-4 * TIME)
    text = str(still(Plot("speed", "rad/s", axis, [curve], still=True)))
    ticks = [tick for tick in re.findall(r">([−\d.]+)</text>", text) if tick.startswith("1.2")]
    assert ticks[:2] == ["1.268", "1.270"]
    below = str(still(replace(Plot("x", "", axis, [replace(curve, y=TIME - 0.9)]), height=300)))
    assert ">0<" in below
    assert ">0.0<" not in below


def test_extremes_of_intervals_are_drawn_and_gaps_are_left_out() -> None:
    values = np.sin(np.arange(10_000.0))
    values[4321], values[100:200] = 9.0, np.nan
    chosen = extremes(values, 300)
    assert 4321 in chosen
    assert len(chosen) <= 302
    assert (chosen[0], chosen[-1]) == (0, 9999)


# Numbers


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
        (numbers.prefixed(3e-13, "J"), "3.00×10⁻¹³ J"),
        (numbers.prefixed(-0.692, "W"), "−0.692 W"),  # never milli of a mechanical quantity
        (numbers.prefixed(9.6e4, "N m"), "96.0 kN m"),
        (numbers.up_to(2.33e-6), "2.4×10⁻⁶"),  # rounded up, for "within"
        (numbers.up_to(5.19e-6, 1), "6×10⁻⁶"),
        (numbers.up_to(3e-5, 1), "3×10⁻⁵"),
        (numbers.shortest(3.2e5), "3.2×10⁵"),
        (numbers.shortest(300.0), "300"),
        (
            numbers.typeset("off by 8.1e+00 rad, 1e-06 of it, -5.3e-06 s, in stiff/torque-1e9"),
            "off by 8.1 rad, 10⁻⁶ of it, −5.3×10⁻⁶ s, in stiff/torque-1e9",
        ),
    ],
)
def test_numbers_read_well(shown: str, wanted: str) -> None:
    assert shown.replace(numbers.SPACE, " ") == wanted


def test_a_column_of_numbers_is_aligned_right_whatever_words_stand_among_them() -> None:
    rows = [["a", "3 s", "holds"], ["b", "never", "1"], ["c", "never", "fails"]]
    columns = PageTable("", ("Name", "Until", "Verdict"), rows).columns()
    assert [classes for _, _, classes in columns] == ["", "n", ""]


def test_a_curve_that_its_range_would_not_show_is_not_cut_off() -> None:
    right = np.sin(TIME)
    assert range_of(right, 1e3 * right) is not None
    assert range_of(right, right + 1e3) is None
