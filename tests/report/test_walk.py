"""The walk through the paper's figures: their order, what they show, what is not known."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
from support.scenes import paper
from support.stored import Made, rotor, store

from rotor_mbs.report.build import write_report
from rotor_mbs.report.pages.figures import FIGURES, in_pi, same_and_different
from rotor_mbs.report.plots.paths import projected
from rotor_mbs.runs.read import open_results
from rotor_mbs.scenario.catalogue import find_scenes

FIG11 = paper("fig11", samples=301)
RIGHT = rotor(lambda t: 0.5 + 0.1 * t, np.sin)


def write(folder: Path, *runs: Made) -> str:
    made = write_report(store(folder / "r.h5", runs), folder / "out").parent / "figures.html"
    return made.read_text(encoding="utf-8")


def test_the_set_is_every_figure_from_3_to_16_and_every_scene_is_shipped() -> None:
    assert [one.number for one in FIGURES] == [str(number) for number in range(3, 17)]
    shipped = {scene.name: scene for scene in find_scenes(["paper"])}
    for figure in FIGURES:
        for letter, scene in figure.panels:
            own = f"{figure.number}{letter if figure.kind == 'paths' else ''}"
            # Each scene file says itself to which figures it belongs.
            assert own in shipped[scene].figures, (figure.number, scene)


def test_the_comparison_gives_when_the_printed_model_visibly_departs(tmp_path: Path) -> None:
    printed = rotor(lambda t: 0.5 + 0.1 * t + 0.02 * t, np.sin)
    near = rotor(lambda t: 0.5 + 0.1 * t + 1e-9 * t, np.sin)
    runs = [
        Made(FIG11, "reference", RIGHT),
        Made(FIG11, "printed/ode45", printed),
        Made(FIG11, "exudyn_tree/rk67", near),
    ]
    with open_results(store(tmp_path / "r.h5", runs)) as opened:
        same, different = (
            text.replace("\N{NO-BREAK SPACE}", " ") for text in same_and_different(opened.scenes["paper/fig11"])
        )
    assert "moves as the corrected one up to 2.50 s" in same  # 0.02 t = 0.05 rad, at the next sample
    assert "Exudyn and the corrected model differ by no more than 1.0×10⁻⁸ rad up to 10.0 s" in same
    assert "the printed angles differ from the corrected ones by up to 0.20 rad" in different
    assert "no blade pitches" not in different


def test_equal_models_do_not_visibly_depart(tmp_path: Path) -> None:
    still = rotor(lambda t: 0.1 * t)
    with open_results(
        store(tmp_path / "r.h5", [Made(FIG11, "reference", still), Made(FIG11, "printed/ode45", still)])
    ) as opened:
        same, different = same_and_different(opened.scenes["paper/fig11"])
    assert "moves as the corrected one throughout" in same
    assert different == "Not the same: nothing visible."


def test_a_figure_has_three_pictures_with_a_message_and_the_published_number(tmp_path: Path) -> None:
    runs = [Made(FIG11, name, RIGHT) for name in ("reference", "printed/ode45", "exudyn_tree/rk67")]
    text = write(tmp_path, *runs)
    section = re.search(r'<section id="figure-11".*?</section>', text, re.S)
    assert section is not None
    assert section[0].count("<figure>") == section[0].count('role="img"') == 3
    assert "published 2.7315 rad" in section[0]
    assert "q(0) = [π/6, π/4, π/6, π/2] rad, dq/dt(0) = [π/10, 0, 0, 0] rad/s, g = 9.80 m/s²" in section[0].replace(
        "\N{NO-BREAK SPACE}", " "
    )
    for described in re.findall(r"<desc[^>]*>(.*?)</desc>", section[0]):
        assert described.startswith("The same: ")
    assert section[0].count('data-kind="svg"') == section[0].count('data-kind="png"') == 3
    # Fig. 13a is the same run; 13b is not in the file.
    assert re.search(r'<section id="figure-13".*?\(a\).*?</section>', text, re.S)
    assert "(b)</h3>" not in text


def test_what_is_not_known_of_figure_14_is_stated(tmp_path: Path) -> None:
    scene = paper("fig14a", samples=51)
    text = write(tmp_path, Made(scene, "reference", RIGHT), Made(scene, "printed/ode45", RIGHT))
    assert "the condition of panel (d) is not known" in text
    assert "(d)</h3>" not in text


def test_a_file_without_the_papers_scenes_has_no_walk(tmp_path: Path) -> None:
    scene = replace(FIG11, name="mine", figures=())
    folder = write_report(store(tmp_path / "r.h5", [Made(scene, "reference", RIGHT)]), tmp_path / "out").parent
    assert not (folder / "figures.html").exists()
    assert "figures.html" not in (folder / "index.html").read_text(encoding="utf-8")


def test_a_scene_named_like_the_walk_does_not_overwrite_it(tmp_path: Path) -> None:
    runs = [Made(FIG11, "reference", RIGHT), Made(replace(FIG11, name="figures"), "reference", RIGHT)]
    folder = write_report(store(tmp_path / "r.h5", runs), tmp_path / "out").parent
    assert (folder / "figures-2.html").is_file()
    assert 'id="figure-11"' in (folder / "figures.html").read_text(encoding="utf-8")


def test_angles_are_written_as_multiples_of_pi() -> None:
    values = (11 * math.pi / 12, -math.pi / 3, math.pi, 0.0, 0.1, -2.0 * math.pi)
    assert [in_pi(x) for x in values] == ["11π/12", "−π/3", "π", "0", "0.1", "−2π"]


def test_the_view_keeps_what_lies_across_it_and_drops_what_lies_along_it() -> None:
    azimuth, elevation = np.radians((-62.0, 14.0))
    across = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    along = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    up = np.cross(along, across)
    np.testing.assert_allclose(projected(np.stack([across, up, along])), [[1, 0], [0, 1], [0, 0]], atol=1e-15)
