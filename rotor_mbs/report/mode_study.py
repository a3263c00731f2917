"""The modes of a scene in memory, with tables, figures, files: what `rotor_mbs.modes` returns."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from rotor_mbs.analysis.campbell import LinearModes, SceneModes, linear_dataset, mode_rows, to_records
from rotor_mbs.errors import InputError
from rotor_mbs.report.core import canvas
from rotor_mbs.report.core.canvas import Panels
from rotor_mbs.report.core.files import write_page
from rotor_mbs.report.pages import modes as pages
from rotor_mbs.runs.records import write_records
from rotor_mbs.scenario.catalogue import scene_of
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.solution.solution import need_xarray
from rotor_mbs.solution.text_table import TextTable
from rotor_mbs.studies.modes import compute_modes


def modes(scene: Scene | str, speeds: Sequence[float] = (), stiffnesses: Sequence[float] = ()) -> Modes:
    """Natural frequencies, damping ratios and mode shapes of a scene, by every model that can be linearized.

    At rest under gravity; over `speeds` in steady rotation without gravity (Campbell diagram); under gravity by the
    Floquet multipliers of a turn. The torque of the scene is left out: the drive keeps the speed.

    Parameters
    ----------
    speeds : rad/s of the rotor, increasing, from 0 up.
    stiffnesses : N m/rad of every bearing, for the stability chart over speed and stiffness.

    Raises
    ------
    InputError
        For speeds or stiffnesses that do not increase, or are negative.

    Examples
    --------
    >>> import rotor_mbs as rm
    >>> study = rm.modes(rm.scene("stiff/nrel-5mw").replace(gravity=0.0), speeds=[0.0, 1.2])
    >>> study.agrees, list(study.rotation)[:2]
    (True, ['lagrange', 'exudyn_tree'])
    >>> study.rotation["lagrange"].names
    ('rotor', 'collective pitch', 'cosine pitch', 'sine pitch')
    """
    scene = scene_of(scene)
    return Modes(**vars(compute_modes(scene, speeds, stiffnesses)), hash=scene_hash(scene))


@dataclass(frozen=True, kw_only=True)
class Modes(SceneModes):
    """The modes of a scene: see `rotor_mbs.modes`.

    Attributes
    ----------
    rest, rotation : by model, its modes at rest under gravity, and over speed without; the closed form first.
    floquet, chart : multipliers of a turn under gravity, and the largest over speed and stiffness; None without.
    notes : what could not be done, and why.
    agrees, disagreement : whether the models have the same frequencies, and their largest relative difference.
    plot : `modes.plot()` draws the Campbell diagram; `.damping()`, `.multipliers()`, `.chart()`.
    """

    hash: str

    @property
    def plot(self) -> ModePlots:
        return ModePlots(self)

    def table(self) -> TextTable:
        """A row for each state, speed and mode of the closed form: rad/s, damping ratio, 1/s."""
        rows = mode_rows(self)
        cells = [
            tuple("" if v is None else f"{v:.7g}" if isinstance(v, float) else str(v) for v in row.values())
            for row in rows
        ]
        return TextTable(tuple(name.replace("_", " ") for name in rows[0]) if rows else (), cells)

    def to_xarray(self, state: str = "rotation") -> Any:
        """The modes of one state, "rotation" or "rest", as an xarray.Dataset with the dimension `solver`."""
        return linear_dataset(self.rest if state == "rest" else self.rotation, need_xarray())

    def save(self, path: str | os.PathLike[str]) -> Path:
        """A results file that `rotor-mbs report` reads. Replaces the file."""
        write_records(Path(path), to_records(self, {"scene_hash": self.hash}))
        return Path(path)

    def to_html(self, folder: str | os.PathLike[str]) -> Path:
        """The page into a folder; its path."""
        return write_page(folder, "modes", pages.modes_page([self]))

    def _repr_html_(self) -> str:
        drawn = self.plot()._repr_svg_() if self.rotation else ""
        return f"<p>{escape(self.scene)}: {escape(self.title)}</p>{self.table()._repr_html_()}{drawn}"


class ModePlots:
    """Figures of the modes of one scene."""

    def __init__(self, modes: SceneModes) -> None:
        self._modes = modes

    def __call__(self) -> Panels:
        """Campbell diagram: damped frequencies (rad/s) over rotor speed. Raises InputError without speeds."""
        rotation = self._rotation()
        panels = pages.campbell(rotation)
        looks = [pages.mode_look(k) for k in range(len(rotation.names))]
        canvas.legend(panels.axes[0], list(zip(rotation.names, looks, strict=True)))
        return panels

    def damping(self) -> Panels:
        """Damping ratios and growth rates (1/s) over rotor speed. Raises InputError without speeds."""
        return pages.damping(self._rotation())

    def multipliers(self) -> Panels:
        """Moduli of the Floquet multipliers over rotor speed. Raises InputError where there are none."""
        if self._modes.floquet is None:
            raise InputError(f"{self._modes.scene}: no Floquet multipliers; they need gravity and speeds above 0")
        return pages.multipliers(self._modes.floquet)

    def chart(self) -> Panels:
        """Growth over a turn over speed and bearing stiffness. Raises InputError where there is none."""
        if self._modes.chart is None:
            raise InputError(f"{self._modes.scene}: no stability chart; it needs gravity, speeds and stiffnesses")
        return pages.chart(self._modes.chart)

    def _rotation(self) -> LinearModes:
        for linear in self._modes.rotation.values():
            return linear
        raise InputError(f"{self._modes.scene}: no modes over speed; ask for speeds")
