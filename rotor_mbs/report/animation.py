"""Write a scene as an animated WebP or GIF: the printed model beside the corrected one."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from rotor_mbs.analysis.kinematics import tip_paths
from rotor_mbs.errors import InputError
from rotor_mbs.report import canvas
from rotor_mbs.report.looks import GREY, INK, coordinate_look, label_of
from rotor_mbs.report.pages.viewer import magnification
from rotor_mbs.report.tip_paths import projected
from rotor_mbs.runs.output_files import refuse_foreign, replace_file
from rotor_mbs.runs.read import StoredScene, open_results
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Array

SUFFIXES = (".webp", ".gif")
RATE = 20  # frames a second, in real time
_MARK = b"rotor_mbs animation"  # text in the metadata of each animation, which identifies it
_MAX_FRAMES = 600  # largest number of frames; a scene that needs more is shown faster
_PATH_POINTS = 4  # number of points of a path for each frame


def write_animation(results: Path, name: str, output: Path, magnified: float | None = None) -> Path:
    """Write a scene of a results file as an animation, and return the path of the animation.

    Parameters
    ----------
    results : the results file.
    name : name of the scene in the results file, or name of the TOML file of the scene.
    output : path of the animation. Its suffix determines the format.
    magnified : factor by which the tips' distances from the pitch axes are magnified; None for a
        factor that makes them visible.

    Raises
    ------
    InputError
        If the file does not have the scene, the suffix is not one of SUFFIXES, the scene has no
        angles, or `output` is an existing file that is not an animation of this program.
    StoreError
        If a file cannot be read or written.
    """
    kind = output.suffix.lower()
    if kind not in SUFFIXES:
        raise InputError(
            f"{output}: unknown format {kind or '(none)'}; allowed: {', '.join(SUFFIXES)}"
        )
    refuse_foreign(output, _MARK)  # before anything is drawn
    # A user's scene is stored by the stem of its file.
    name = Path(name).stem if name.endswith(".toml") else name
    with open_results(results) as opened:
        if name not in opened.scenes:
            raise InputError(
                f"{results}: {name!r}: no such scene in it; allowed: "
                f"{', '.join(opened.scenes) or 'none'}"
            )
        pictures = frames(opened.scenes[name], magnified)
        webp, other = (
            {"quality": 50, "method": 0, "xmp": _MARK},
            {"optimize": False, "comment": _MARK},
        )
        options = webp if kind == ".webp" else other
        stream = io.BytesIO()
        first, suffix = next(pictures), kind.removeprefix(".")
        first.save(
            stream,
            suffix,
            save_all=True,
            append_images=pictures,
            duration=1000 // RATE,
            loop=0,
            **options,
        )
    replace_file(output, stream.getvalue(), _MARK)
    return output


def frames(stored: StoredScene, magnified: float | None) -> Iterator[Image.Image]:
    """Return an iterator over the pictures of a scene's animation, with the runs side by side.

    A picture has the blades at its time, and the paths of the tips until then. A run that ended
    earlier is drawn in its last state.

    Parameters
    ----------
    stored : the scene. The runs of its printed and its corrected model are drawn, if they have
        angles.
    magnified : factor by which the tips' distances from the pitch axes are magnified; None for the
        factor on the scene's page. It has no effect if all tips are on the axes.

    Raises
    ------
    InputError
        If neither run has angles.
    """
    scene = stored.scene
    runs = {label_of(run.method): run for run in stored.sides.values() if "angles" in run}
    if not runs:
        raise InputError(f"{stored.name}: nothing to plot: no angles")
    end = min(max(float(run.array("time")[-1]) for run in runs.values()), scene.duration)
    count = max(2, min(round(end * RATE) + 1, _MAX_FRAMES))
    # Times of the points of the paths. A path has several points for each frame, so that it is
    # smooth.
    at = np.linspace(0.0, end, (count - 1) * _PATH_POINTS + 1)
    needed = magnification(scene)
    factor = 1.0 if needed is None else float(magnified or needed)
    reach = 1.08 * max(float(np.linalg.norm(blade.tip)) for blade in scene.blades)
    panels, moving = canvas.squares(len(runs)), []
    for axes, (name, run) in zip(panels.axes, runs.items(), strict=True):
        angles = np.nan_to_num(run.array("angles"), posinf=0.0, neginf=0.0)
        corners = wires(scene, run.array("time"), angles, at, factor)
        axes.set(xlim=(-reach, reach), ylim=(-reach, reach))
        axes.plot([0.0], [0.0], marker="o", color=INK, markersize=8.0, zorder=3.0)
        paths, blades = [], []
        for blade in range(len(scene.blades)):
            colour = coordinate_look(blade + 1).colour
            paths += axes.plot([], [], color=colour, linewidth=0.8)
            blades += axes.fill([0.0], [0.0], facecolor="#dddddd", edgecolor=colour, linewidth=2.2)
        # Number of times up to the last sample of the run.
        ended = int(np.searchsorted(at, run.array("time")[-1], side="right"))
        moving.append((axes, name, corners, ended, paths, blades))
    offset = f", offset drawn ×{factor:g}" if factor != 1.0 else ""
    clock = panels.figure.text(0.01, 0.93, "", color=GREY)

    def picture(frame: int) -> Image.Image:
        """Draw the picture at a place in `at`, and return it."""
        for axes, name, corners, ended, paths, blades in moving:
            last = min(frame, ended - 1)
            axes.set_title(
                f"{name}, ended at {at[last]:.2f} s" if frame > last else name,
                loc="left",
                x=0.02,
                y=1.03,
            )
            for i, (path, blade) in enumerate(zip(paths, blades, strict=True)):
                path.set_data(*corners[: last + 1, i, 1].T)
                blade.set_xy([(0.0, 0.0), *corners[last, i]])
        clock.set_text(f"t = {at[frame]:.2f} s{offset}")
        return Image.fromarray(canvas.pixels(panels.figure))

    return (picture(frame) for frame in range(0, len(at), _PATH_POINTS))


def wires(scene: Scene, time: Array, angles: Array, at: Array, magnified: float) -> Array:
    """Return the positions in the picture of three corners of each blade.

    The corners of a blade are the point of the pitch axis beside the tip, the tip, and a point near
    the hub that has the tip's distance from the pitch axis.

    Parameters
    ----------
    scene : scene of the run.
    time, angles : (n,) s and (n, coordinates) rad, the samples of the run.
    at : (times,) times of the positions, s. The angles are interpolated between samples.
    magnified : factor by which distances from the pitch axis are magnified.

    Returns
    -------
    (times, blades, 3, 2) ndarray
        Positions of the corners, to the right and up, m.
    """
    moved = np.stack([np.interp(at, time, column) for column in angles.T], axis=1)
    # `tip_paths` computes the paths of tips. Each corner is therefore computed as the tip of blades
    # that end there.
    corners = []
    for across, along in ((0.0, 1.0), (magnified, 1.0), (magnified, 0.06)):
        blades = []
        for blade in scene.blades:
            x, y, z = blade.tip
            blades.append(replace(blade, tip=(across * x, across * y, along * z)))
        paths = tip_paths(replace(scene, blades=tuple(blades)), moved)
        corners.append(projected(paths.reshape(-1, 3)).reshape(*paths.shape[:2], 2))
    return np.stack(corners, axis=2)
