"""The paper's figures, on their page and as files for a manuscript; animations."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.commands import refusal, rotor_mbs
from support.report_pages import answer_of, plots_of, section_of, text_of
from support.scenes import paper
from support.stored import Made, rotor, store

from rotor_mbs.report.animation import wires
from rotor_mbs.report.figures import caption_of, composed, differences
from rotor_mbs.report.pages.scene_plots import parting
from rotor_mbs.report.paper_figures import FIGURES, all_figures, available
from rotor_mbs.runs.read import open_results
from rotor_mbs.scenario.catalogue import find_scenes

RIGHT = rotor(lambda t: 0.5 + 0.1 * t, np.sin, np.cos)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    runs = []
    for name in ("fig11", "fig08", "fig09", "fig15-1kNm", "fig15-100kNm"):
        scene = paper(name, samples=101)
        runs += [
            Made(scene, method, RIGHT)
            for method in ("reference", "printed/ode45", "exudyn_tree/rk67")
        ]
    return store(tmp_path_factory.mktemp("figures") / "r.h5", runs)


def test_the_set_is_every_figure_from_3_to_16_and_every_scene_is_shipped() -> None:
    assert [figure.number for figure in FIGURES] == [str(number) for number in range(3, 17)]
    shipped = {scene.name: scene for scene in find_scenes(["paper"])}
    for figure in FIGURES:
        for letter, scene in figure.panels:
            own = f"{figure.number}{letter if figure.kind == 'paths' else ''}"
            # Each scene file says itself to which figures it belongs.
            assert own in shipped[scene].figures, (figure.number, scene)


def test_models_part_when_their_angles_visibly_differ(tmp_path: Path) -> None:
    """Printed: 0.02 t off, so 0.05 rad at 2.5 s and, at the next of 301 samples, more."""
    scene = paper("fig11", samples=301)
    runs = [
        Made(scene, "reference", rotor(lambda t: 0.5 + 0.1 * t, np.sin)),
        Made(scene, "printed/ode45", rotor(lambda t: 0.5 + 0.12 * t, np.sin)),
        Made(replace(scene, name="paper/fig12"), "reference", RIGHT),
        Made(replace(scene, name="paper/fig12"), "printed/ode45", RIGHT),
    ]
    with open_results(store(tmp_path / "r.h5", runs)) as opened:
        parted, same = (parting(*scene.sides.values()) for scene in opened.scenes.values())
    assert parted == (pytest.approx(2.5, abs=0.04), pytest.approx(0.2))
    assert same == (None, 0.0)


def test_a_figure_has_its_models_its_scenes_and_the_published_number(report: Path) -> None:
    section = section_of(text_of(report, "figures.html"), "figure-11")
    # position and velocity, as printed and corrected
    assert section.count('<figure class="plot"') == 4
    # What holds of all figures is said once.
    methods = "As printed: ode45; Corrected model: reference, quad precision."
    assert methods in answer_of(text_of(report, "figures.html"))
    assert text_of(report, "figures.html").count("quad precision") == 1
    assert ">2.7315<" in section
    assert "initial state π/6, π/4, π/6, π/2 rad and π/10, 0, 0, 0 rad/s" in section
    # Fig. 13a is the same run; 13b is not in the file.
    paths = section_of(text_of(report, "figures.html"), "figure-13")
    assert ("(a) As printed" in paths, "(b) As printed" in paths) == (True, False)


def test_the_plots_of_a_figure_have_every_sample(results: Path, report: Path) -> None:
    plots = plots_of(
        section_of(text_of(report, "figures.html"), "figure-11") + text_of(report, "figures.html")
    )
    with open_results(results) as opened:
        run = opened.scenes["paper/fig11"].runs["printed/ode45"]
        time, rates = run.array("time"), run.array("rates")
    x, y = plots["As printed: angular velocity"].curves["pitch 2"]
    np.testing.assert_allclose(x, time, rtol=1e-7)
    np.testing.assert_allclose(y, rates[:, 2], rtol=1e-6, atol=1e-12)


# As files


@pytest.mark.full
def test_every_figure_the_file_has_is_written(drawn: Path, tmp_path: Path) -> None:
    ended = rotor_mbs("figures", drawn, "-o", tmp_path, "--format", "svg")
    assert ended.status == 0
    names = [
        f"fig{number:02d}.{ending}"
        for number in (8, 9, 10, 11, 13, 15, 16)
        for ending in ("svg", "txt")
    ]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)
    assert ended.out.split() == [str(tmp_path / name) for name in names]
    head = (tmp_path / "fig11.svg").read_text(encoding="utf-8")[:2000]
    width = re.search(r'width="([\d.]+)pt"', head)
    assert width is not None
    assert float(width[1]) / 72 * 25.4 == pytest.approx(174.0, abs=0.01)  # two columns of a journal


@pytest.mark.parametrize(
    ("kind", "start"),
    [
        pytest.param("pdf", b"%PDF", marks=pytest.mark.full),
        pytest.param("png", b"\x89PNG", marks=pytest.mark.full),
        ("svg", b"<?xml"),
    ],
)
def test_formats_have_the_same_bytes_every_time_and_say_what_they_show(
    drawn: Path, tmp_path: Path, kind: str, start: bytes
) -> None:
    for folder in ("a", "b"):
        assert (
            rotor_mbs(
                "figures", drawn, "--format", kind, "--figure", 11, "-o", tmp_path / folder
            ).status
            == 0
        )
    content = (tmp_path / "a" / f"fig11.{kind}").read_bytes()
    assert content.startswith(start)
    assert content == (tmp_path / "b" / f"fig11.{kind}").read_bytes()
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == [
        f"fig11.{kind}",
        "fig11.txt",
    ]
    title = "Figure 11 of Aguilar-Acevedo et al."
    if kind == "pdf":  # texts beyond Latin letters are UTF-16 in a PDF
        assert title.encode("utf-16-be") in content or title.encode() in content
        assert b"/Subject" in content
    elif kind == "svg":
        assert f"<title>{title}" in content.decode()
        assert "the equations as printed" in content.decode()
    else:
        with Image.open(tmp_path / "a" / "fig11.png") as image:
            assert str(image.info["Title"]).startswith(title)
            assert "the equations as printed" in str(image.info["Description"])


def test_the_caption_has_scene_methods_settings_and_what_is_right(drawn: Path) -> None:
    with open_results(drawn) as opened:
        text = caption_of(all_figures(opened.scenes)["11"], opened.scenes)
        run, other = (
            opened.scenes["paper/fig11"].runs[name] for name in ("exudyn_tree/rk67", "reference")
        )
        assert differences("angles", run, other).max() == 0.0
    for piece in (
        "Figure 11 of", "scene paper/fig11", ("initial angles 0.523599, 0.785398, 0.523599, "
                                             "1.5708 rad"),
        "blades each of 15000 kg; gravity 9.8 m/s^2; 10 s, 1001 samples", "with their 3 errors; wrong", "(printed/ode45)",
        "Corrected model: right", "(reference)", ("of an independent computation from the "
                                                 "corrected model"),
        "(exudyn_tree/rk67)", "It is right; no angle differs by more than 0 rad.",
    ):  # fmt: skip
        assert piece in text, piece


def test_the_caption_of_an_own_scene_has_its_title_once_and_its_masses(tmp_path: Path) -> None:
    scene = paper("fig11", samples=101).replace(**{"blade.mass": 2e4})
    scene = replace(scene, name="heavy", title="Heavy")
    runs = [Made(scene, "lagrange/taylor", rotor(np.sin))]
    with open_results(store(tmp_path / "r.h5", runs)) as opened:
        text = caption_of(all_figures(opened.scenes)["heavy"], opened.scenes)
    assert text.startswith("Heavy (scene heavy).\n")
    assert text.count("Heavy") == 1
    assert "\nInitial angles 0.523599, " in text
    assert "blades each of 20000 kg; gravity 9.8" in text


def test_a_caption_calls_nothing_right_that_is_not_ok(tmp_path: Path) -> None:
    scene = paper("fig11", samples=101)
    facts = {"status": "inaccurate"}
    runs = [
        Made(scene, name, rotor(np.sin), attributes=facts)
        for name in ("lagrange/taylor", "exudyn_tree/rk67")
    ]
    with open_results(store(tmp_path / "r.h5", runs)) as opened:
        text = caption_of(all_figures(opened.scenes)["11"], opened.scenes)
    assert "right" not in text
    assert text.count("not verified (1 of 1 runs: inaccurate)") == 2


def test_a_figure_shows_each_model_as_it_was_stored_and_how_far_the_others_are(
    tmp_path: Path,
) -> None:
    """The printed rotor is 0.2 t, the independent one 1e-9 off."""
    scene = paper("fig11", samples=101)
    runs = [
        Made(scene, "reference", RIGHT),
        Made(scene, "printed/ode45", lambda t: RIGHT(t) + 0.2 * t[:, None]),
        Made(scene, "exudyn_tree/rk67", lambda t: RIGHT(t) + 1e-9),
    ]
    with open_results(store(tmp_path / "r.h5", runs)) as opened:
        figure = next(figure for figure in available(opened.scenes) if figure.number == "11")
        panels = composed(figure, opened.scenes)
        run = opened.scenes["paper/fig11"].runs["printed/ode45"]
        time, angles, rates = run.array("time"), run.array("angles"), run.array("rates")
    assert len(panels.axes) == 6
    assert [axes.texts[0].get_text() for axes in panels.axes[:3]] == [
        "As printed",
        "Corrected model",
        "Difference",
    ]
    for axes, values in ((panels.axes[0], angles), (panels.axes[3], rates)):
        for line, column in zip(axes.get_lines(), values.T, strict=True):
            np.testing.assert_array_equal(line.get_xydata(), np.column_stack([time, column]))
    printed, independent = panels.axes[2].get_lines()
    assert panels.axes[2].get_yscale() == "log"
    np.testing.assert_allclose(printed.get_ydata()[1:], 0.2 * time[1:], rtol=1e-9)
    # eight digits are left of the difference
    np.testing.assert_allclose(independent.get_ydata(), 1e-9, rtol=1e-5)


def test_a_changed_scene_and_ones_own_have_figures_that_say_so(tmp_path: Path) -> None:
    changed = paper("fig11", samples=11).replace(gravity=9.0)
    own = replace(changed, name="mine", title="Mine", figures=())
    path = store(
        tmp_path / "r.h5", [Made(changed, "reference", RIGHT), Made(own, "reference", RIGHT)]
    )
    assert rotor_mbs("figures", path, "--format", "svg", "-o", tmp_path / "out").status == 0
    names = ["mine.svg", "mine.txt", "paper-fig11.svg", "paper-fig11.txt"]
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == names
    text = (tmp_path / "out" / "paper-fig11.txt").read_text(encoding="utf-8")
    assert "(scene paper/fig11, changed: gravity)" in text
    assert "Figure 11" not in text
    assert "gravity 9 m/s^2" in text
    assert "changed" not in (tmp_path / "out" / "mine.txt").read_text(encoding="utf-8")
    assert rotor_mbs("figures", path, "--figure", "mine", "-o", tmp_path / "one").status == 0  # PDF
    assert len([*(tmp_path / "one").iterdir()]) == 2


def test_paths_without_tips_are_no_figure(tmp_path: Path) -> None:
    path = store(
        tmp_path / "r.h5",
        [Made(paper("fig08", samples=11, outputs=("angles", "rates")), "reference", RIGHT)],
    )
    assert "figure 10: not in the file; allowed: 8" in refusal(
        "figures", path, "--figure", "10", "-o", tmp_path
    )


# Animations

SHORT = paper("fig11", duration=1.0, samples=101)
TURNING = rotor(lambda t: 2.0 * t, np.sin)


@pytest.fixture(scope="module")
def moving(tmp_path_factory: pytest.TempPathFactory) -> Path:
    scene = replace(SHORT, text=SHORT.text.replace("duration = 10.0", "duration = 1.0"))
    runs = [Made(scene, "reference", TURNING), Made(scene, "printed/ode45", TURNING, until=0.5)]
    return store(tmp_path_factory.mktemp("animate") / "r.h5", runs)


@pytest.mark.parametrize("suffix", ["webp", pytest.param("gif", marks=pytest.mark.full)])
def test_an_animation_moves_for_as_long_as_the_scene(
    moving: Path, tmp_path: Path, suffix: str
) -> None:
    output = tmp_path / f"new/a.{suffix}"
    assert rotor_mbs("animate", "paper/fig11", moving, "-o", output).status == 0
    with Image.open(output) as image:
        assert image.n_frames == 21  # 1 s at 20 frames a second, both ends
        assert image.size[0] > image.size[1]  # two models side by side
        seen = []
        for frame in (0, 10, 20):
            image.seek(frame)
            seen.append(np.asarray(image.convert("RGB"), dtype=int))
            if frame:
                assert image.info["duration"] == 50
    halves = [np.hsplit(picture, 2) for picture in seen]
    assert (halves[0][1] != halves[1][1]).any()
    assert (halves[1][1] != halves[2][1]).any()
    # The printed run ends at half time: its rotor stands still from then on, only the text above
    # changes.
    still = np.abs(halves[1][0][60:] - halves[2][0][60:])
    assert np.count_nonzero(still > 64) < 0.002 * still.size  # compression may move a pixel's shade


def test_wires_stand_where_the_rotor_is() -> None:
    scene = replace(SHORT, blades=SHORT.blades[:1])
    time = np.array([0.0, 1.0])
    angles = np.array([[0.0, 0.0], [0.0, np.pi / 2]])
    corners = wires(scene, time, angles, np.array([0.0, 1.0]), magnified=1.0)
    x, _, z = scene.blades[0].tip
    # Blade 1 up: z is seen as cos(elevation); x as cos(28°) to the right and, from above, lower.
    up, right = np.cos(np.radians(14.0)), np.sin(np.radians(62.0))
    np.testing.assert_allclose(corners[0, 0, 0], [0.0, up * z], atol=1e-12)
    lower = np.sin(np.radians(14.0)) * np.cos(np.radians(62.0)) * x
    np.testing.assert_allclose(corners[0, 0, 1], [right * x, up * z - lower], atol=1e-12)
    # Pitched by 90°, the tip's offset points along +y: seen as cos(62°) to the right.
    np.testing.assert_allclose(corners[1, 0, 1, 0], np.cos(np.radians(62.0)) * x)
