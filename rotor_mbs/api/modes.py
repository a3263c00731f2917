"""Compute natural frequencies, damping and mode shapes: `rm.modes`, and what it returns."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rotor_mbs.analysis.modes import (
    MODE_COLUMNS,
    SceneModes,
    campbell_table,
    linear_dataset,
    mode_rows,
    mode_summary,
    mode_table,
    read_modes,
    to_records,
)
from rotor_mbs.analysis.text_tables import TextTable
from rotor_mbs.api.tables import data_frame
from rotor_mbs.errors import InputError, shown_value
from rotor_mbs.runs.read import write_records
from rotor_mbs.runs.versions import machine, versions
from rotor_mbs.scenario.catalogue import scene_of
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.toml_file import file_path
from rotor_mbs.studies.modes import compute_modes, increasing_speeds

if TYPE_CHECKING:
    from rotor_mbs.report.pages.modes import ModePlots


def modes(scene: Scene | str | os.PathLike[str], speeds: Sequence[float] = ()) -> Modes:
    """Compute natural frequencies, damping ratios and mode shapes of a scene.

    Every model that can be linearized computes the modes at rest under gravity, and over `speeds`
    in steady rotation without gravity (Campbell diagram). Floquet multipliers are computed in
    rotation under gravity. A drive torque that maintains the speed takes the place of the scene's
    torque.

    Parameters
    ----------
    scene : a Scene, the name of a shipped scene, or a TOML file.
    speeds : rotor speeds (rad/s), increasing; at a negative speed the rotor turns the other way.

    Returns
    -------
    Modes

    Raises
    ------
    InputError
        For speeds that do not increase, and for a scene without a steady state.
    TypeError
        If `scene` is neither a scene nor text nor a path, or a speed is not a number.

    Examples
    --------
    >>> import rotor_mbs as rm
    >>> study = rm.modes(rm.scene("stiff/nrel-5mw").replace(gravity=0.0), speeds=[0.0, 1.2])
    >>> study.agrees, list(study.rotation)[:2]
    (True, ['lagrange', 'exudyn_tree'])
    >>> study.rotation["lagrange"].names
    ('rotor', 'collective pitch', 'cosine pitch', 'sine pitch')
    >>> study.rotation["lagrange"].fixed_frame.names
    ('rotor', 'collective pitch', 'backward whirl', 'forward whirl')
    """
    return Modes(**vars(compute_modes(scene_of(scene), increasing_speeds(speeds))))


def open_modes(path: Path) -> Modes | dict[str, Modes]:
    """Return the modes in a file, or a dict by scene name if the file has several scenes.

    Raises StoreError if the file cannot be read.
    """
    found = {name: Modes(**vars(modes)) for name, modes in read_modes(path).items()}
    return found if len(found) > 1 else next(iter(found.values()))


@dataclass(frozen=True, repr=False)
class Modes(SceneModes):
    """Result of `rotor_mbs.modes`: the modes of a scene.

    Attributes
    ----------
    rest, rotation : modes by model, at rest under gravity, and over speed without gravity; the
        closed form first. `modes.rotation["lagrange"].fixed_frame` has names and frequencies
        (rad/s) of the rotor's motions in both frames, such as backward and forward whirl. It is a
        text with the reason if no whirl is defined.
    floquet : Floquet multipliers under gravity; None if they were not computed.
    notes : results that could not be computed, with the reason.
    agrees : whether the modes of all models agree and satisfy the equations of their own models.
    disagreement : largest difference of a frequency or a decay rate between models, relative to the
        largest eigenvalue.
    residuals : by model, the largest residual of its modes in its own linearized equations.
    faults : a line for each residual that is too large.
    plot : `modes.plot()` draws the Campbell diagram, `modes.plot.damping()` the damping ratios, and
        `modes.plot.multipliers()` the Floquet multipliers.
    """

    @property
    def plot(self) -> ModePlots:
        """Return the plots of the modes; `modes.plot()` draws the Campbell diagram."""
        from rotor_mbs.report.pages.modes import ModePlots  # not at the top: it loads matplotlib

        return ModePlots(self)

    def table(self) -> Any:
        """Return a pandas DataFrame with a row per state, speed and mode of the closed form.

        Frequencies are in rad/s, growth rates in 1/s; damping ratios have no unit. Whirl
        frequencies are those in the fixed frame, all other frequencies those in the rotating frame.
        `table.attrs["growth_rate"]` has the unit and the name of the column "growth_rate". See
        `campbell` for frequencies in Hz over rpm.
        """
        rows = mode_rows(self)
        names = list(rows[0]) if rows else []
        return data_frame({name: [row[name] for row in rows] for name in names}, MODE_COLUMNS)

    def campbell(self) -> TextTable:
        """Return a table of the closed form's frequencies in Hz over the rotor speed in rpm.

        The table has the frequencies in the rotating and in the fixed frame; those in the fixed
        frame also as multiples of the rotor speed. If no whirl is defined, the table has only the
        rotating frame, with these multiples.

        Raises
        ------
        InputError
            If no modes over speed were computed.
        """
        for linear in self.rotation.values():
            return campbell_table(linear)
        raise InputError(f"{self.scene}: no modes over speed; allowed: modes computed with speeds")

    def to_xarray(self, state: str = "rotation") -> Any:
        """Return the modes of one state by all models as an xarray.Dataset.

        The dimension `solver` is the model.

        Parameters
        ----------
        state : "rotation" or "rest".

        Raises
        ------
        InputError
            For any other text, and for a state that was not computed.
        """
        states = {"rotation": self.rotation, "rest": self.rest}
        if state not in states:
            raise InputError(f"no state {shown_value(state)}; allowed: {', '.join(states)}")
        import xarray  # not at the top: it takes 0.4 s

        return linear_dataset(states[state], xarray)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Save the modes in a file that `rotor-mbs report` reads.

        In an existing file of modes, earlier modes of the same scene are replaced, and those of
        other scenes are kept. Raises InputError if `path` is a file of another kind, StoreError if
        it cannot be read or written, TypeError if `path` is neither text nor a path.
        """
        target = file_path(path)
        write_records(target, to_records(self))
        return target

    def to_html(self, folder: str | os.PathLike[str]) -> Path:
        """Write the page on the modes into a folder, and return the path of the page."""
        from rotor_mbs.report.files import write_page  # not at the top: it loads the templates
        from rotor_mbs.report.pages.modes import modes_page

        return write_page(file_path(folder), modes_page([self]), versions() | machine())

    def __repr__(self) -> str:
        return mode_summary(self)

    def _repr_html_(self) -> str:
        heading = f"<p>{escape(self.label)}: {escape(self.title)}</p>"
        drawn = self.plot()._repr_svg_() if self.rotation else ""
        return f"{heading}{mode_table(mode_rows(self))._repr_html_()}{drawn}"
