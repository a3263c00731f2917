"""A scene as an animated WebP or GIF, or as MP4 with ffmpeg: the printed model beside the corrected one."""

from __future__ import annotations

import io
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from rotor_mbs.analysis import run_selection
from rotor_mbs.analysis.kinematics import tip_paths
from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.report.core.canvas import FONT_FILE
from rotor_mbs.report.core.looks import GREY, coordinate_look, label_of
from rotor_mbs.report.pages.viewer import magnification
from rotor_mbs.report.plots import projected
from rotor_mbs.runs.files import refuse_foreign, replace_file, replacing
from rotor_mbs.runs.read import StoredScene, open_results
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Array

SUFFIXES = (".webp", ".gif", ".mp4")
RATE = 20  # frames a second, in real time
_MARK = b"rotor_mbs animation"  # in the metadata of every file
_MAX_FRAMES = 600  # a longer scene is shown faster
_SIDE, _TOP, _FINE = 420, 40, 2  # pixels of a square, of the line of text above; drawn at twice the size, then reduced
_PATH_POINTS = 4  # along a path, from one frame to the next
_INK, _FAINT = "#1b1f24", "#d5dae0"


def write_animation(results: Path, name: str, output: Path, magnified: float | None = None) -> Path:
    """Write a scene of a results file as an animation, and return its file.

    Parameters
    ----------
    results, name : the file, and the name of the scene in it.
    output : the animation; its suffix gives the format.
    magnified : how many times the tip's distance from the pitch axis is drawn; None: so many that it is visible.

    Raises
    ------
    InputError
        For a scene that the file does not have, and for a format that cannot be made.
    StoreError
        Where a file cannot be read or written.
    """
    kind = output.suffix.lower()
    if kind not in SUFFIXES:
        raise InputError(f"{output}: unknown kind of file {kind or '(none)'}; allowed: {', '.join(SUFFIXES)}")
    if kind == ".mp4" and shutil.which("ffmpeg") is None:
        raise InputError(
            f"{output}: MP4 needs ffmpeg, which is not found here; allowed: .webp, .gif, or install ffmpeg"
        )
    refuse_foreign(output, _MARK)  # before anything is drawn
    name = Path(name).stem if name.endswith(".toml") else name  # a scene of one's own is stored by the stem of its file
    with open_results(results) as opened:
        if name not in opened.scenes:
            raise InputError(f"{results}: {name!r}: no such scene in it; allowed: {', '.join(opened.scenes) or 'none'}")
        pictures = frames(opened.scenes[name], magnified)
    if kind == ".mp4":
        with replacing(output) as temporary:
            _film(pictures, temporary)
        return output
    options = {"quality": 50, "method": 0, "xmp": _MARK} if kind == ".webp" else {"optimize": False, "comment": _MARK}
    stream = io.BytesIO()
    first, name_of_kind = next(pictures), kind.removeprefix(".")
    first.save(stream, name_of_kind, save_all=True, append_images=pictures, duration=1000 // RATE, loop=0, **options)
    replace_file(output, stream.getvalue(), _MARK)
    return output


def frames(stored: StoredScene, magnified: float | None) -> Iterator[Image.Image]:
    """The pictures. Raises InputError where nothing can be drawn."""
    scene = scene_of(stored)
    runs = {label_of(run.method): run for run in run_selection.sides(stored).values() if "angles" in run}
    if scene is None or not runs:
        raise InputError(f"{stored.name}: nothing to draw: no angles, or its scene file is not known")
    end = max(float(run.array("time")[-1]) for run in runs.values())
    count = max(2, min(round(end * RATE) + 1, _MAX_FRAMES))
    at = np.linspace(0.0, end, (count - 1) * _PATH_POINTS + 1)
    needed = magnification(scene)
    factor = 1.0 if needed is None else float(magnified or needed)
    drawn = {
        name: wires(scene, run.array("time"), np.nan_to_num(run.array("angles"), posinf=0.0, neginf=0.0), at, factor)
        for name, run in runs.items()
    }
    return (_picture(drawn, i, float(at[i]), factor) for i in range(0, len(at), _PATH_POINTS))


class Wires(NamedTuple):
    """A run at equally spaced times, as points (frames, blades, 2) in m, projected."""

    axis: Array  # the pitch axis' end
    edge: Array  # the tip
    root: Array  # the tip's offset at the hub
    reach: float  # m from the hub to the farthest tip
    ended: int  # the frame after the last that the run has


def wires(scene: Scene, time: Array, angles: Array, at: Array, magnified: float) -> Wires:
    """At the times `at` (s); distances from the pitch axis are drawn `magnified` times."""
    moved = np.stack([np.interp(at, time, column) for column in angles.T], axis=1)
    lines = []
    for across, along in ((0.0, 1.0), (magnified, 1.0), (magnified, 0.06)):
        blades = []
        for blade in scene.blades:
            x, y, z = blade.tip
            blades.append(replace(blade, tip=(across * x, across * y, along * z)))
        paths = tip_paths(replace(scene, blades=tuple(blades)), moved)
        lines.append(projected(paths.reshape(-1, 3)).reshape(*paths.shape[:2], 2))
    reach = max(float(np.linalg.norm(blade.tip)) for blade in scene.blades)
    axis, edge, root = lines
    return Wires(axis, edge, root, reach, int(np.searchsorted(at, time[-1], side="right")))


def _picture(drawn: Mapping[str, Wires], frame: int, time: float, magnified: float) -> Image.Image:
    """The runs side by side: paths up to the frame, then the blades."""
    size = (_SIDE * len(drawn), _SIDE + _TOP)
    image = Image.new("RGB", (_FINE * size[0], _FINE * size[1]), "white")
    pen = ImageDraw.Draw(image)
    font = ImageFont.truetype(str(FONT_FILE), 12 * _FINE)
    for place, (name, wire) in enumerate(drawn.items()):
        left = _FINE * place * _SIDE
        last = min(frame, wire.ended - 1)
        over = f", ended at {time * last / frame:.2f} s" if frame > last else ""
        pen.text((left + 12 * _FINE, 4 * _FINE), f"{name}{over}", _INK, font)
        centre = (left + _FINE * _SIDE / 2, _FINE * (_TOP + _SIDE / 2))
        scale = 0.5 * _FINE * _SIDE / (1.08 * wire.reach)
        edge, axis, root = (points * (scale, -scale) + centre for points in (wire.edge, wire.axis, wire.root))
        for blade in range(edge.shape[1]):
            path = [tuple(point) for point in edge[: last + 1, blade].tolist()]
            if len(path) > 1:
                pen.line(path, fill=coordinate_look(blade + 1).colour, width=_FINE)
        for blade in range(edge.shape[1]):
            corners = [centre, *(tuple(points[last, blade].tolist()) for points in (axis, edge, root))]
            pen.polygon(corners, fill=_FAINT)
            pen.line([*corners, centre], fill=coordinate_look(blade + 1).colour, width=3 * _FINE, joint="curve")
        dot = 6 * _FINE
        pen.ellipse((centre[0] - dot, centre[1] - dot, centre[0] + dot, centre[1] + dot), fill=_INK)
    text = f"t = {time:.2f} s" + (f", offset drawn ×{magnified:g}" if magnified != 1.0 else "")
    pen.text((12 * _FINE, 22 * _FINE), text, GREY, font)
    return image.resize(size, Image.Resampling.LANCZOS)


def _film(pictures: Iterator[Image.Image], output: Path) -> None:
    first = next(pictures)
    size = f"{first.width}x{first.height}"
    command = [
        "ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", str(RATE),
        "-i", "-", "-c:v", "libx264", "-pix_fmt", "yuv420p", "-movflags", "+faststart",
        "-metadata", f"comment={_MARK.decode()}", "-f", "mp4", str(output.absolute()),
    ]  # fmt: skip
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as ffmpeg:
        assert ffmpeg.stdin is not None
        assert ffmpeg.stderr is not None
        for picture in (first, *pictures):
            ffmpeg.stdin.write(picture.tobytes())
        ffmpeg.stdin.close()
        message = ffmpeg.stderr.read().decode(errors="replace").strip()
    if ffmpeg.returncode:
        raise StoreError(
            f"{output}: ffmpeg could not make it: {message.splitlines()[-1] if message else 'no reason given'}"
        )
