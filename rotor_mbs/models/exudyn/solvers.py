"""Run the engine's systems as solvers; the chain also by extrapolation between samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rotor_mbs.errors import MethodRefusal
from rotor_mbs.methods.base import Solver
from rotor_mbs.methods.time_limit import MESSAGE, is_over, samples_kept_at_limit
from rotor_mbs.models.exudyn import chain, sensor_samples, tree
from rotor_mbs.models.exudyn.adapter import System
from rotor_mbs.models.exudyn.geometry import Part
from rotor_mbs.models.exudyn.loads import Loads
from rotor_mbs.models.exudyn.schemes import (
    ChainSettings,
    ExtrapolatedSettings,
    Scheme,
    SchemeSettings,
)
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import Interval, intervals
from rotor_mbs.solution.trajectory import Array, Integration, Trajectory, all_coordinates

# With 2, 4, ..., 14 substeps. Twelve and fourteen are needed for tolerances below 1e-9 rad.
MOST_COLUMNS = 7

# A part of an interval is at least 1/4096 of it.
_MOST_HALVINGS = 12

# No estimate is smaller than some units in the last place of Euler parameters.
_ROUNDING = 100.0 * float(np.finfo(float).eps)

# Components below this share of the largest of their kind are rounding errors, and set to zero.
# Else motions that a symmetry forbids (pitches that stay at zero) begin with 1e-27 rad and grow to
# the size of the others.
_INSIGNIFICANT = 0.5 * float(np.finfo(float).eps)


def substeps(column: int) -> int:
    """Return the number of equal steps of column 0, 1, ... of the extrapolation table."""
    return 2 * (column + 1)


def neville(previous: Sequence[Array], values: Array) -> list[Array]:
    """Return the next row of the extrapolation table.

    Parameters
    ----------
    previous : the row before; [] for the first.
    values : what the new number of substeps gives.

    Returns
    -------
    list of ndarray
        The values, then those without the error's terms of second, fourth, ... power of the
        substep.
    """
    column = len(previous)
    row = [values]
    for k, before in enumerate(previous):
        ratio = (substeps(column) / substeps(column - 1 - k)) ** 2
        row.append(row[k] + (row[k] - before) / (ratio - 1.0))
    return row


# Extrapolation within each interval between samples (Gragg, Bulirsch, Stoer): from the same state
# the trapezoidal rule takes 2, 4, 6, ... equal substeps, Neville's scheme in the square of the
# substep eliminates one even power of the error with each column, and the next interval starts from
# what the table ends with.
#
# E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed., II.9; E.
# Hairer, G. Wanner, II, VI.5. Numbers of substeps are even: with constraints at velocity level an
# error of the accelerations along the constraints changes its sign with every step, and only after
# an even number of steps is it the same in all columns.


# Accelerations and multipliers are carried over this many parts, over which their errors grow
# little, and replaced where the accelerations are off by more than this share.
_PARTS_CARRIED, _LARGEST_CARRIED = 10, 0.01


class _Kept(NamedTuple):
    """Hold the state at the end of a part of an interval, under the loads of that interval."""

    time: float  # s
    interval: Interval
    values: Array  # as of `System.values`
    turns: Array  # of the springs
    work: float  # J


class ExtrapolatedSolver:
    """Run the chain, extrapolated within each interval between samples; see `methods.base.Solver`.

    Attributes
    ----------
    system : the assembled engine.
    columns : of the extrapolation table, for each part of the last integration.
    kept : the states at the ends of these parts.
    """

    def __init__(self, scene: Scene, settings: ExtrapolatedSettings) -> None:
        """Build the chain of a scene.

        Parameters
        ----------
        scene : the run.
        settings : whose tolerance is for each part of an interval.

        Raises
        ------
        MethodRefusal
            If the samples are too close, or the engine does not take the chain.
        """
        self._scene, self._scheme, self._loads = scene, _scheme(scene, settings), Loads(scene)
        self._least_error = max(settings.tolerance, _ROUNDING)
        self._newton_tolerance = settings.newton_relative_tolerance
        self._intervals = intervals(scene.load_segments, scene.samples, every_sample=True)
        # With dampers or loads over time the work depends on the path: it is extrapolated with the
        # state.
        self._integrates_work = scene.work_needs_path
        self._gives_loads = scene.wants("loads")
        parts = chain.parts(scene, self._loads)
        sensors = [part.name for part in parts if part.kind == "sensor"]
        self._of_rates = [name for name in sensors if name.endswith(("rotation", "spin"))]
        # The engine evaluates stored sensors after every step: only those that the work needs are
        # stored.
        for number, part in enumerate(parts):
            if part.kind == "sensor":
                stored = part.name in self._of_rates
                parts[number] = replace(
                    part, parameters={**part.parameters, "storeInternal": stored}
                )
        self.system = System(parts)
        # For each body three displacements and four Euler parameters, from which the coordinates
        # are differences.
        self._reference = self.system.reference.reshape(-1, 7)
        self._sizes = np.abs(self._reference).max(axis=0)
        self._coordinates = self._reference.size
        places = np.arange(3 * self._coordinates).reshape(3, -1, 7)
        # of Euler parameters, their rates and accelerations
        self._rotations = places[:, :, 3:].reshape(3, -1)
        self._total = Integration(True)
        self._halvings = 0
        self.columns: list[int] = []  # of each part
        self.kept: list[_Kept] = []

    def integrate(self) -> Integration:
        """Integrate from sample to sample, and from kink to kink of the loads.

        Where a load has a kink, accelerations and multipliers are calculated anew.
        """
        self._total = Integration(True)
        self._halvings, self.columns, self.kept = 0, [], []
        first = self._intervals[0]
        self._loads.set_segment(first.segment)
        self.system.begin(self._scheme, with_rows=self._integrates_work)
        self._keep(first.start, first, *self.system.initial_values(first.start), 0.0)
        failure = ""
        with samples_kept_at_limit():
            for interval in self._intervals:
                if interval.segment is not self._loads.segment:
                    self._loads.set_segment(interval.segment)
                    self.system.start_from(*self.system.initial_values(interval.start))
                failure = self._cross(interval, interval.start, interval.end, 0)
                if failure:
                    break
        self._total.success, self._total.message = not failure, failure
        self._total.out_of_time = failure == MESSAGE
        self._total.time_reached = self.kept[-1].time
        return self._total

    def _cross(self, interval: Interval, start: float, end: float, halvings: int) -> str:
        """Integrate over a part of an interval, in one go or in halves.

        Parts are as small as the last ones had to be, and twice as large again where two columns
        less would do.

        Parameters
        ----------
        interval : whose loads act.
        start, end : s, of the part.
        halvings : how many times the interval was halved to get it.

        Returns
        -------
        str
            Why the end was not reached; "" where it was.
        """
        if halvings >= self._halvings:
            failure = self._part(interval, start, end)
            if not failure:
                if self.columns[-1] <= MOST_COLUMNS - 2:
                    self._halvings = max(0, halvings - 1)
                return ""
            if failure == MESSAGE or halvings == _MOST_HALVINGS:
                return failure
            self._halvings = halvings + 1
        middle = 0.5 * (start + end)
        failure = self._cross(interval, start, middle, halvings + 1)
        return failure or self._cross(interval, middle, end, halvings + 1)

    def _part(self, interval: Interval, start: float, end: float) -> str:
        """Extrapolate over a part of an interval with as many columns as the tolerance needs.

        Parameters
        ----------
        interval, start, end : as of `_cross`.

        Returns
        -------
        str
            Why the end was not reached; "" where it was.
        """
        row: list[Array] = []
        for column in range(MOST_COLUMNS):
            failure = self.system.advance(start, end, substeps(column), self._total)
            if is_over():
                return MESSAGE
            if failure:
                return failure
            values = self.system.values()
            if self._integrates_work:
                values = np.append(values, self._work(interval))
            row = neville(row, values)
            # The difference is the error of the value beside it in the table, which has two orders
            # less than the one that is kept.
            if column and self._is_met(row[-1] - row[-2], row[-1], end - start):
                self.columns.append(column + 1)
                state, gained = row[-1], 0.0
                if self._integrates_work:
                    state, gained = state[:-1], float(state[-1])
                self._end_part(end, interval, self._consistent(state), gained)
                return ""
        return (
            f"near t = {start:.6g} s the error of an interval of {end - start:.3g} s remains above "
            "the tolerance"
        )

    def _work(self, interval: Interval) -> float:
        """Return the work of loads and dampers over the substeps of one column, J.

        By the trapezoidal rule, whose error is a power series of the substep's square, as the
        state's is.
        """
        tables = {name: self.system.rows(name) for name in self._of_rates}
        time = tables["hub spin"][:, 0]
        moving = sensor_samples.joint_rates(self._scene, lambda name: tables[name][:, 1:])
        _, rates = all_coordinates(self._scene, np.zeros_like(moving), moving)
        power = sensor_samples.power(self._scene, interval.segment, time, rates)
        return float(np.trapezoid(power, time))

    def _is_met(self, difference: Array, values: Array, span: float) -> bool:
        """Return whether an estimated error is within the tolerance.

        Euler parameters are half of an angle, and so their error may be half of the tolerance.
        Newton's method stops at a share of the forces: an error as small as it leaves cannot be
        made smaller by another column.

        Parameters
        ----------
        difference, values : as of `System.values`, the estimate and the state.
        span : s, of the part.
        """
        rotations, rates, _ = np.abs(difference[self._rotations]).max(axis=1)
        error = 2.0 * max(rotations, span * rates)
        if error <= self._least_error:
            return True
        accelerations = np.abs(values[self._rotations[2]]).max()
        return bool(error <= self._newton_tolerance * span**2 * accelerations)

    def _consistent(self, values: Array) -> Array:
        """Return an extrapolated state with Euler parameters of length one, and rates that keep it.

        The engine takes both for granted: without this the errors of the length cause ten times as
        large an error of the motion as all others. Rounding errors are set to zero.

        Parameters
        ----------
        values : as of `System.values`; changed in place.
        """
        # Three derivatives, bodies, displacement (3) and Euler parameters (4).
        kinds = values[: 3 * self._coordinates].reshape(3, -1, 7)
        parameters = kinds[0, :, 3:] + self._reference[:, 3:]
        parameters /= np.sqrt((parameters * parameters).sum(axis=1))[:, None]
        kinds[0, :, 3:] = parameters - self._reference[:, 3:]
        rates = kinds[1, :, 3:]
        rates -= parameters * (parameters * rates).sum(axis=1)[:, None]
        sizes = np.abs(kinds)
        for columns in (slice(0, 3), slice(3, 7)):
            largest = sizes[:, :, columns].max(axis=(1, 2))
            # Coordinates are displacements: their rounding is that of what they are displacements
            # from.
            largest[0] = max(largest[0], self._sizes[columns].max())
            insignificant = sizes[:, :, columns] < _INSIGNIFICANT * largest[:, None, None]
            kinds[:, :, columns][insignificant] = 0.0
        return values

    def _end_part(self, end: float, interval: Interval, values: Array, gained: float) -> None:
        """Keep the state at the end of a part, with the accelerations and multipliers it implies.

        With constraints at velocity level nothing holds the accelerations along the constraints,
        nor the multipliers: their errors are carried from part to part and grow, with dampers
        tenfold in a few turns. The loads have these errors; the motion feels them when they are
        much larger than the accelerations.

        Parameters
        ----------
        end : s, of the part.
        interval : whose loads act.
        values : the extrapolated state, as of `System.values`.
        gained : J, work of loads and dampers in the part.
        """
        turns, work = self.system.turns(), self.kept[-1].work + gained
        is_due = len(self.kept) % _PARTS_CARRIED == 0
        renewed = values
        if is_due or self._gives_loads:
            self.system.start_from(values, turns)
            renewed, _ = self.system.initial_values(end)
        if is_due and self._is_off(values, renewed, end - self.kept[-1].time):
            values = renewed
        # The motion is the same, whether loads are requested or not: only readings differ.
        self._keep(end, interval, values, turns, work)
        if self._gives_loads:
            self.kept[-1] = self.kept[-1]._replace(values=renewed)

    def _is_off(self, values: Array, renewed: Array, span: float) -> bool:
        """Return whether carried accelerations are too far from those that the state implies.

        Parameters
        ----------
        values, renewed : as of `System.values`, carried and implied.
        span : s, of the part.
        """
        accelerations = self._rotations[2]
        error = np.abs(renewed[accelerations] - values[accelerations]).max()
        # Near rest the accelerations themselves are rounding errors.
        rounding = _ROUNDING / span**2
        return bool(error > max(_LARGEST_CARRIED * np.abs(renewed[accelerations]).max(), rounding))

    def _keep(
        self, time: float, interval: Interval, values: Array, turns: Array, work: float
    ) -> None:
        """Keep a state, from which the next part starts."""
        self.system.start_from(values, turns)
        self.kept.append(_Kept(time, interval, values, turns, work))

    def observe(self) -> Trajectory:
        """Return the samples, from the sensors' readings at each state.

        At a jump of a load they are read under the load before it.
        """
        readings = []
        for kept in self.kept:
            self._loads.set_segment(kept.interval.segment)
            readings.append(self.system.read(kept.time, kept.values, kept.turns))
        time = np.array([kept.time for kept in self.kept])
        rows = {
            name: np.column_stack([time, [reading[i] for reading in readings]])
            for i, name in enumerate(self.system.sensors)
        }
        rows["work"] = np.array([[kept.time, kept.work] for kept in self.kept])
        # A diverging state may overflow in its energies; the rows are cut where they stop being
        # finite.
        with np.errstate(over="ignore", invalid="ignore"):
            return sensor_samples.chain_trajectory(
                self._scene, rows.__getitem__, self._integrates_work
            )


Reading = Callable[[Scene, Callable[[str], Array]], Trajectory]

# s. The engine ends a run within 1e-10 s of its end, whatever the step.
_SHORTEST_INTERVAL = 1e-8


class MultibodySolver:
    """Run a system by one of the engine's own time integrations; see `methods.base.Solver`."""

    def __init__(
        self,
        scene: Scene,
        parts: Sequence[Part],
        loads: Loads,
        scheme: Scheme,
        reading: Reading,
        rows_between: bool,
    ) -> None:
        """Build the system.

        Parameters
        ----------
        scene : the run.
        parts : of the system.
        loads : the loads that the parts' load functions read.
        scheme : the time integration.
        reading : makes the trajectory from recorded rows.
        rows_between : whether it needs rows between samples.

        Raises
        ------
        MethodRefusal
            With the engine's reason, where the engine does not take the parts.
        """
        self._scene, self._loads, self._scheme, self._reading = scene, loads, scheme, reading
        self._rows_between = rows_between
        self._intervals = intervals(
            scene.load_segments, scene.samples, every_sample=scheme.step is None
        )
        self.system = System(parts)

    def integrate(self) -> Integration:
        """Integrate from the initial state to the end, or to the first failure."""
        return self.system.integrate(
            self._scheme, self._intervals, self._rows_between, self._loads.set_segment
        )

    def observe(self) -> Trajectory:
        """Return the samples of the last integration."""
        # A diverging state may overflow in its energies; the rows are cut where they stop being
        # finite.
        with np.errstate(over="ignore", invalid="ignore"):
            return self._reading(self._scene, self.system.rows)


def build_tree(scene: Scene, settings: SchemeSettings) -> Solver:
    """Build the solver of a scene's kinematic tree.

    Parameters
    ----------
    scene : the run.
    settings : of the time integration.

    Raises
    ------
    MethodRefusal
        If the samples are too close, or the engine does not take the tree.
    """
    scheme, loads = _scheme(scene, settings), Loads(scene)
    if scene.wants("loads"):
        scheme = scheme.with_accelerations()
    parts = tree.parts(scene, loads)
    return MultibodySolver(
        scene, parts, loads, scheme, sensor_samples.tree_trajectory, scene.work_needs_path
    )


def build_chain(scene: Scene, settings: ChainSettings) -> Solver:
    """Build the solver of a scene's chain.

    Parameters
    ----------
    scene : the run.
    settings : of the time integration, and the node of a body.

    Raises
    ------
    MethodRefusal
        If loads are requested with the node whose multipliers are wrong, the samples are too close,
        or the engine does not take the chain.
    """
    scheme = _scheme(scene, settings)
    if scene.wants("loads") and settings.node == "rotation_vector":
        raise MethodRefusal(
            "exudyn_chain: loads need the setting node = euler_parameters: with rotation_vector "
            "the engine's first multipliers are wrong, and those of newmark_index2 remain wrong"
        )
    loads = Loads(scene)
    parts = chain.parts(scene, loads, settings.node)
    # Its angles are unwrapped from row to row, so rows are kept between samples.
    return MultibodySolver(
        scene, parts, loads, scheme, sensor_samples.chain_trajectory, rows_between=True
    )


def build_extrapolated(scene: Scene, settings: ExtrapolatedSettings) -> Solver:
    """Build the chain of a scene, to be extrapolated."""
    return ExtrapolatedSolver(scene, settings)


def _scheme(scene: Scene, settings: SchemeSettings | ExtrapolatedSettings) -> Scheme:
    """Return the time integration that the settings describe.

    Raises
    ------
    MethodRefusal
        If the samples of the scene are too close for the engine.
    """
    if scene.duration / (scene.samples - 1) < _SHORTEST_INTERVAL:
        raise MethodRefusal(
            f"Exudyn cannot resolve samples less than {_SHORTEST_INTERVAL:g} s apart"
        )
    return settings.scheme()
