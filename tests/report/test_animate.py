"""`animate`: a picture file that moves, and what is said where it cannot be made."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.commands import refusal, rotor_mbs
from support.scenes import paper
from support.stored import Made, rotor, store

from rotor_mbs.report.animation import wires

SHORT = paper("fig11", duration=1.0, samples=101)
TURNING = rotor(lambda t: 2.0 * t, np.sin)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    scene = replace(SHORT, text=SHORT.text.replace("duration = 10.0", "duration = 1.0"))
    runs = [Made(scene, "reference", TURNING), Made(scene, "printed/ode45", TURNING, until=0.5)]
    return store(tmp_path_factory.mktemp("animate") / "r.h5", runs)


@pytest.mark.parametrize("suffix", ["webp", "gif"])
def test_an_animation_moves_for_as_long_as_the_scene(results: Path, tmp_path: Path, suffix: str) -> None:
    output = tmp_path / f"new/a.{suffix}"
    assert rotor_mbs("animate", "paper/fig11", results, "-o", output).status == 0
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
    # The printed run ends at half time: its rotor stands still from then on, only the text above changes.
    still = np.abs(halves[1][0][60:] - halves[2][0][60:])
    assert np.count_nonzero(still > 64) < 0.002 * still.size  # compression may move a pixel's shade


def test_wires_stand_where_the_rotor_is() -> None:
    scene = replace(SHORT, blades=SHORT.blades[:1])
    time = np.array([0.0, 1.0])
    angles = np.array([[0.0, 0.0], [0.0, np.pi / 2]])
    corners = wires(scene, time, angles, np.array([0.0, 1.0]), magnified=1.0)
    x, _, z = scene.blades[0].tip
    # Blade 1 up: z is seen as cos(elevation); x as cos(28°) to the right and, from above, sin(14°) sin(28°) up.
    up, right = np.cos(np.radians(14.0)), np.sin(np.radians(62.0))
    np.testing.assert_allclose(corners[0, 0, 0], [0.0, up * z], atol=1e-12)
    np.testing.assert_allclose(corners[0, 0, 1, 0], right * x)
    # Pitched by 90°, the tip's offset points along +y: seen as cos(62°) to the right.
    np.testing.assert_allclose(corners[1, 0, 1, 0], np.cos(np.radians(62.0)) * x)


def test_without_ffmpeg_a_film_is_refused_with_what_to_do(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, "which", lambda _: None)
    assert "MP4 needs ffmpeg" in refusal("animate", "paper/fig11", results, "-o", tmp_path / "a.mp4")


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="no ffmpeg here")
def test_a_film_is_made_where_ffmpeg_is(results: Path, tmp_path: Path) -> None:
    assert rotor_mbs("animate", "paper/fig11", results, "-o", tmp_path / "a.mp4").status == 0
    assert (tmp_path / "a.mp4").read_bytes()[4:8] == b"ftyp"
