"""Figures of runs that are in memory, for notebooks and scripts: motion, energy, error, paths of the tips."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rotor_mbs.errors import InputError
from rotor_mbs.models.lagrange.defects import interval_defects
from rotor_mbs.report import plots
from rotor_mbs.report.core.canvas import Panels
from rotor_mbs.report.core.looks import BLUE, INK, VERMILLION, Look, look_of
from rotor_mbs.report.plots import Series
from rotor_mbs.solution.metrics import angle_error, energy_scale, horizon
from rotor_mbs.solution.quantities import LOADS
from rotor_mbs.solution.solution import Solution
from rotor_mbs.solution.trajectory import Array, Trajectory


class ComparisonPlots:
    """Figures of several runs of one scene."""

    def __init__(self, runs: Mapping[str, Solution], reference: Trajectory | None) -> None:
        self._runs, self._reference = list(runs.values()), reference

    def __call__(self) -> Panels:
        """Draws `error`."""
        return self.error()

    def error(self) -> Panels:
        """Largest angle error (rad) of each run against the reference over time. Raises InputError without one."""
        if self._reference is None:
            raise InputError("no reference to compare with; allowed: run(..., reference=True) computes one")
        series = self._series([angle_error(run.trajectory, self._reference) for run in self._runs])
        return plots.errors(series, "largest angle error (rad)", horizon(self._reference)).with_legend()

    def defects(self) -> Panels:
        """The size (rad) of each run's interval defects over time. Raises InputError for fewer than two samples."""
        series = []
        for run in self._runs:
            if len(run.time) < 2:
                raise InputError("the run left fewer than two samples; there is no interval to draw")
            sizes = interval_defects(run.scene, run.time, run.angles, run.rates).sizes
            series.append(Series(run.time[1:], sizes, look_of(run.method)))
        return plots.errors(series, "defect (rad)").with_legend()

    def rotor(self) -> Panels:
        """The rotor's angle (rad) by each method over time."""
        series = self._series([run.angles[:, 0] for run in self._runs])
        return plots.lines([("rotor angle (rad)", series)]).with_legend()

    def energy_error(self) -> Panels:
        """Size of the energy error of each run, relative to the scene's energy scale. Raises InputError without."""
        errors = []
        for run in self._runs:
            scale = energy_scale(run.scene, run.trajectory)
            errors.append(np.abs(_quantity(run, "energy_error")) / (scale or 1.0))
        return plots.errors(self._series(errors), "energy error, of the energy scale").with_legend()

    def _series(self, values: Sequence[Array]) -> list[Series]:
        pairs = zip(self._runs, values, strict=True)
        return [Series(_some(run.time)[: len(array)], array, look_of(run.method)) for run, array in pairs]


class RunPlots(ComparisonPlots):
    """Figures of one run; those of several, too."""

    def __init__(self, run: Solution, reference: Trajectory | None) -> None:
        super().__init__({run.method: run}, reference)
        self._run = run

    def __call__(self) -> Panels:
        """Angles (rad) and rates (rad/s) over time (s): rotor and pitches."""
        run = self._run
        horizon_s = None if self._reference is None else horizon(self._reference)
        return plots.motion(_some(run.time), run.angles, run.rates, horizon_s)

    def energy(self) -> Panels:
        """Kinetic energy, potential energy, and their sum less the work (J) over time. Raises InputError without."""
        run = self._run
        kinetic, potential, work = (_quantity(run, name) for name in ("kinetic_energy", "potential_energy", "work"))
        curves = (
            (kinetic, Look(VERMILLION, "-", "", "kinetic")),
            (potential, Look(BLUE, "--", "", "potential")),
            (kinetic + potential - work, Look(INK, "-", "", "total less work")),
        )
        return plots.lines([("energy (J)", [Series(run.time, *curve) for curve in curves])]).with_legend()

    def loads(self, name: str = "blade_root_force") -> Panels:
        """A load over time: a panel per axis with a line per blade, or one panel with a line per axis (or blade).

        name: blade_root_force, blade_root_moment, shaft_force, shaft_moment or pitch_actuator_moment (N, N m).

        Raises InputError where the run does not have it.
        """
        values, load = _quantity(self._run, name), next((load for load in LOADS if load.name == name), None)
        if load is None or load.plot is None:
            raise InputError(f"no load {name!r}; allowed: {', '.join(load.name for load in LOADS)}")
        return plots.component_panels(load, load.plot, self._run.time, values).with_legend()

    def tips(self) -> Panels:
        """Paths of the blade tips (m). Raises InputError where the scene does not ask for them."""
        _some(self._run.time)
        return plots.paths(_quantity(self._run, "tip"))


def _some(time: Array) -> Array:
    if not len(time):
        raise InputError("the run left no samples; nothing to draw")
    return time


def _quantity(run: Solution, name: str) -> Array:
    _some(run.time)
    try:
        return run[name]
    except KeyError as exc:
        raise InputError(f"{run.scene.name} {run.method} has no {exc.args[0]}") from exc
