"""Solve scenes by the engine's time integrations, and the chain also by extrapolation."""

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

# Largest number of columns of the extrapolation table: results with 2, 4, ..., 14 substeps. Twelve
# and fourteen substeps are needed for tolerances below 1e-9 rad.
MOST_COLUMNS = 7

# Largest number of halvings of an interval: a part of it has at least 1/4096 of its length.
_MOST_HALVINGS = 12

# Rounding error of an angle, rad: some units in the last place of Euler parameters. No smaller
# tolerance is used, because error estimates do not get below it.
_ROUNDING = 100.0 * float(np.finfo(float).eps)

# A component of a state below this share of the largest component of its kind is a rounding error,
# and is set to zero. Otherwise motions that a symmetry forbids, such as those of pitches that stay
# at zero, would begin with 1e-27 rad and grow to the size of the other motions.
_INSIGNIFICANT = 0.5 * float(np.finfo(float).eps)


def substeps(column: int) -> int:
    """Return the number of equal substeps with which a row of the extrapolation table begins.

    Each row adds one column to the table.

    Parameters
    ----------
    column : number of the row, and of the column that it adds, from 0.
    """
    return 2 * (column + 1)


def neville(previous: Sequence[Array], values: Array) -> list[Array]:
    """Return the next row of the extrapolation table.

    Parameters
    ----------
    previous : the row before; [] for the first row.
    values : result of the integration with the new number of substeps.

    Returns
    -------
    list of ndarray
        The values; then the values without the term of second power of the substep in their error;
        then without the terms of second and fourth power; and so on.
    """
    column = len(previous)
    row = [values]
    for k, before in enumerate(previous):
        ratio = (substeps(column) / substeps(column - 1 - k)) ** 2
        row.append(row[k] + (row[k] - before) / (ratio - 1.0))
    return row


# Each interval between samples is integrated by extrapolation (Gragg, Bulirsch, Stoer). From the
# same state the trapezoidal rule takes 2, then 4, 6, ... equal substeps. Neville's scheme in the
# square of the substep eliminates one even power of the error with each column. The next interval
# starts from the last value of the table.
#
# The numbers of substeps are even. With constraints at velocity level, an error of the
# accelerations along the constraints changes its sign with every step. This error is the same in
# all columns only after an even number of steps.
#
# E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed., II.9; E.
# Hairer, G. Wanner, II, VI.5.


# After each _PARTS_CARRIED parts, accelerations and multipliers are compared with those that the
# state implies; over so few parts their errors grow little. They are replaced if the accelerations
# differ by more than the share _LARGEST_CARRIED of the largest acceleration.
_PARTS_CARRIED, _LARGEST_CARRIED = 10, 0.01


class _Kept(NamedTuple):
    """Hold the initial state, or the state at the end of a part of an interval."""

    time: float  # s
    interval: Interval  # the interval whose loads act
    values: Array  # the state, in the form of `System.values`
    turns: Array  # the data coordinates, in the form of `System.turns`
    work: float  # J, work of loads and dampers since the start of the run


class ExtrapolatedSolver:
    """Integrate the chain by extrapolation within each interval; see `methods.base.Solver`.

    Attributes
    ----------
    system : the assembled system of the engine.
    columns : number of columns of the extrapolation table for each part of the last integration.
    kept : the initial state, and the states at the ends of these parts.
    """

    def __init__(self, scene: Scene, settings: ExtrapolatedSettings) -> None:
        """Build the chain of a scene.

        Parameters
        ----------
        scene : the run.
        settings : settings with the tolerance for each part of an interval.

        Raises
        ------
        MethodRefusal
            If the samples are too close to each other, or the engine rejects the chain.
        """
        self._scene, self._scheme, self._loads = scene, _scheme(scene, settings), Loads(scene)
        self._least_error = max(settings.tolerance, _ROUNDING)
        self._newton_tolerance = settings.newton_relative_tolerance
        self._intervals = intervals(scene.load_segments, scene.samples, every_sample=True)
        # If dampers act or loads change over time, the work depends on the path. It is then
        # extrapolated together with the state.
        self._integrates_work = scene.work_needs_path
        self._gives_loads = scene.wants("loads")
        parts = chain.parts(scene, self._loads)
        sensors = [part.name for part in parts if part.kind == "sensor"]
        self._of_rates = [name for name in sensors if name.endswith(("rotation", "spin"))]
        # The engine evaluates after every step each sensor that stores its readings. Therefore only
        # the sensors that the work needs store them.
        for number, part in enumerate(parts):
            if part.kind == "sensor":
                stored = part.name in self._of_rates
                parts[number] = replace(
                    part, parameters={**part.parameters, "storeInternal": stored}
                )
        self.system = System(parts)
        # (bodies, 7): reference values of three positions and four Euler parameters of each body.
        # The engine's coordinates are the differences from these values.
        self._reference = self.system.reference.reshape(-1, 7)
        self._sizes = np.abs(self._reference).max(axis=0)
        self._coordinates = self._reference.size
        places = np.arange(3 * self._coordinates).reshape(3, -1, 7)
        # (3, 4 bodies): places of the Euler parameters, of their rates and of their accelerations
        # in a state.
        self._rotations = places[:, :, 3:].reshape(3, -1)
        self._total = Integration(True)
        self._halvings = 0
        self.columns: list[int] = []  # for each part
        self.kept: list[_Kept] = []

    def integrate(self) -> Integration:
        """Integrate interval by interval, to the end or to the first failure.

        After a kink or a jump of a load, accelerations and multipliers are computed anew.
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
        """Integrate over a part of an interval, as a whole or in halves.

        A part is as small as the last parts had to be. If a part needs at least two columns less
        than the most, the next parts may be twice as large.

        Parameters
        ----------
        interval : the interval, whose loads act.
        start, end : s, start and end of the part.
        halvings : number of times that the interval was halved to get the part.

        Returns
        -------
        str
            The reason if the end of the part was not reached; otherwise "".
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
        interval, start, end : as for `_cross`.

        Returns
        -------
        str
            The reason if the end of the part was not reached; otherwise "".
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
            # The difference of the last two values estimates the error of the last but one. The
            # last value, which is kept, has an order that is higher by two.
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
        """Return the work of loads and dampers over the substeps of the last `advance`, J.

        The work is integrated by the trapezoidal rule. Its error is therefore a power series of the
        square of the substep, like the error of the state.
        """
        tables = {name: self.system.rows(name) for name in self._of_rates}
        time = tables["hub spin"][:, 0]
        moving = sensor_samples.joint_rates(self._scene, lambda name: tables[name][:, 1:])
        _, rates = all_coordinates(self._scene, np.zeros_like(moving), moving)
        power = sensor_samples.power(self._scene, interval.segment, time, rates)
        return float(np.trapezoid(power, time))

    def _is_met(self, difference: Array, values: Array, span: float) -> bool:
        """Return whether an estimated error is within the tolerance.

        The error of an angle is twice that of the Euler parameters. Newton's method stops when the
        residual is below a share of the forces. Another column cannot reduce an error that is as
        small as what Newton's method leaves, so such an error is accepted, too.

        Parameters
        ----------
        difference, values : estimated error and state, in the form of `System.values`.
        span : s, length of the part.
        """
        rotations, rates, _ = np.abs(difference[self._rotations]).max(axis=1)
        error = 2.0 * max(rotations, span * rates)
        if error <= self._least_error:
            return True
        accelerations = np.abs(values[self._rotations[2]]).max()
        return bool(error <= self._newton_tolerance * span**2 * accelerations)

    def _consistent(self, values: Array) -> Array:
        """Return an extrapolated state with Euler parameters of length one.

        The rates are changed, too, so that they keep this length. The engine assumes both. Without
        the change, errors of the length would cause an error of the motion that is ten times as
        large as all other errors. Components that are rounding errors are set to zero.

        Parameters
        ----------
        values : the state, in the form of `System.values`; changed in place.
        """
        # (3, bodies, 7): coordinates, rates and accelerations of each body, for its position (3)
        # and its Euler parameters (4).
        kinds = values[: 3 * self._coordinates].reshape(3, -1, 7)
        parameters = kinds[0, :, 3:] + self._reference[:, 3:]
        parameters /= np.sqrt((parameters * parameters).sum(axis=1))[:, None]
        kinds[0, :, 3:] = parameters - self._reference[:, 3:]
        rates = kinds[1, :, 3:]
        rates -= parameters * (parameters * rates).sum(axis=1)[:, None]
        sizes = np.abs(kinds)
        for columns in (slice(0, 3), slice(3, 7)):
            largest = sizes[:, :, columns].max(axis=(1, 2))
            # A coordinate is the displacement from a reference value, and has the rounding error of
            # that value.
            largest[0] = max(largest[0], self._sizes[columns].max())
            insignificant = sizes[:, :, columns] < _INSIGNIFICANT * largest[:, None, None]
            kinds[:, :, columns][insignificant] = 0.0
        return values

    def _end_part(self, end: float, interval: Interval, values: Array, gained: float) -> None:
        """Keep the state at the end of a part; renew accelerations and multipliers if necessary.

        Constraints at velocity level determine neither the accelerations along the constraints nor
        the multipliers. Their errors are carried from part to part and grow, with dampers tenfold
        in a few turns. These errors change the loads. They change the motion only if they are much
        larger than the accelerations.

        Parameters
        ----------
        end : s, end of the part.
        interval : the interval, whose loads act.
        values : the extrapolated state, in the form of `System.values`.
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
        # The motion must not depend on whether loads are requested. The next part starts from
        # `values`; `renewed` is only for the readings of the sensors.
        self._keep(end, interval, values, turns, work)
        if self._gives_loads:
            self.kept[-1] = self.kept[-1]._replace(values=renewed)

    def _is_off(self, values: Array, renewed: Array, span: float) -> bool:
        """Return whether carried accelerations are too far from those that the state implies.

        Parameters
        ----------
        values, renewed : the state with the carried and with the implied accelerations, in the form
            of `System.values`.
        span : s, length of the part.
        """
        accelerations = self._rotations[2]
        error = np.abs(renewed[accelerations] - values[accelerations]).max()
        # Near rest the accelerations themselves are rounding errors.
        rounding = _ROUNDING / span**2
        return bool(error > max(_LARGEST_CARRIED * np.abs(renewed[accelerations]).max(), rounding))

    def _keep(
        self, time: float, interval: Interval, values: Array, turns: Array, work: float
    ) -> None:
        """Keep a state, and let the next part start from it."""
        self.system.start_from(values, turns)
        self.kept.append(_Kept(time, interval, values, turns, work))

    def observe(self) -> Trajectory:
        """Return the samples, computed from the readings of the sensors at each kept state.

        At a jump of a load the sensors are read with the load before the jump.
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
        # The energies of a diverging state may overflow. The samples end before the first that is
        # not finite.
        with np.errstate(over="ignore", invalid="ignore"):
            return sensor_samples.chain_trajectory(
                self._scene, rows.__getitem__, self._integrates_work
            )


Reading = Callable[[Scene, Callable[[str], Array]], Trajectory]

# Shortest time between samples, s. The engine ends a run within 1e-10 s of its end, whatever the
# step.
_SHORTEST_INTERVAL = 1e-8


class MultibodySolver:
    """Integrate a system by one of the engine's time integrations; see `methods.base.Solver`."""

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
        parts : the parts of the system.
        loads : the loads that the load functions of the parts read.
        scheme : the time integration.
        reading : function that computes the trajectory from the recorded rows.
        rows_between : whether `reading` needs rows between samples.

        Raises
        ------
        MethodRefusal
            If the engine rejects the parts. The message has the engine's reason.
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
        # The energies of a diverging state may overflow. The samples end before the first that is
        # not finite.
        with np.errstate(over="ignore", invalid="ignore"):
            return self._reading(self._scene, self.system.rows)


def build_tree(scene: Scene, settings: SchemeSettings) -> Solver:
    """Build the solver of a scene's kinematic tree.

    Parameters
    ----------
    scene : the run.
    settings : settings of the time integration.

    Raises
    ------
    MethodRefusal
        If the samples are too close to each other, or the engine rejects the tree.
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
    settings : settings of the time integration, with the node of a body.

    Raises
    ------
    MethodRefusal
        If loads are requested with the node rotation_vector, whose multipliers are wrong; if the
        samples are too close to each other; or if the engine rejects the chain.
    """
    scheme = _scheme(scene, settings)
    if scene.wants("loads") and settings.node == "rotation_vector":
        raise MethodRefusal(
            "exudyn_chain: loads need the setting node = euler_parameters: with rotation_vector "
            "the engine's first multipliers are wrong, and those of newmark_index2 remain wrong"
        )
    loads = Loads(scene)
    parts = chain.parts(scene, loads, settings.node)
    # The angles of the chain are unwrapped from row to row. This needs rows between samples.
    return MultibodySolver(
        scene, parts, loads, scheme, sensor_samples.chain_trajectory, rows_between=True
    )


def build_extrapolated(scene: Scene, settings: ExtrapolatedSettings) -> Solver:
    """Build the solver that extrapolates the chain of a scene."""
    return ExtrapolatedSolver(scene, settings)


def _scheme(scene: Scene, settings: SchemeSettings | ExtrapolatedSettings) -> Scheme:
    """Return the time integration that the settings describe.

    Raises
    ------
    MethodRefusal
        If the samples of the scene are too close to each other for the engine.
    """
    if scene.duration / (scene.samples - 1) < _SHORTEST_INTERVAL:
        raise MethodRefusal(
            f"Exudyn cannot resolve samples less than {_SHORTEST_INTERVAL:g} s apart"
        )
    return settings.scheme()
