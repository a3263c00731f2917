"""Adapt the Exudyn engine, and run it without window, console output or files.

No other module imports Exudyn. This module loads its fast build, which has no range checks.
"""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from rotor_mbs.errors import MethodRefusal
from rotor_mbs.methods.time_limit import (
    MESSAGE,
    OutOfTimeError,
    caller_signals,
    must_ask,
    raise_if_over,
)
from rotor_mbs.models.exudyn.geometry import LISTS, Part, Ref
from rotor_mbs.models.exudyn.schemes import Scheme
from rotor_mbs.scenario.time_table import Interval, Segment, step_within, steps_and_rows
from rotor_mbs.solution.trajectory import Array, Integration, limit_at_zero

os.environ.setdefault("EXUDYN_MODULE", "fast")
with contextlib.redirect_stdout(io.StringIO()):  # Exudyn prints a greeting on import
    import exudyn
    from exudyn import itemInterface

# The engine's type stubs lag behind it.
_engine: Any = exudyn
_engine.config.printToConsole = False
_engine.config.suppressWarnings = True
# Suppress all windows. The engine also has an environment variable for this, but with the variable
# it sets matplotlib's backend to Agg, also for the caller's plots.
_engine.special.userInterface.SuppressAll(True)


class Linearized(NamedTuple):
    """Hold the matrices of M δq̈ + D δq̇ + K δq + C δλ = 0 in the engine's coordinates.

    M, K and D are (n, n), and C is (n, constraints), all in SI units.
    """

    M: Array
    K: Array
    D: Array
    C: Array


class System:
    """Hold an assembled system of the engine; each `integrate` begins at its initial state."""

    def __init__(self, parts: Sequence[Part]) -> None:
        """Add all parts to a system, and assemble it.

        Parameters
        ----------
        parts : the parts, in the order in which they are added. A part comes after the parts that
            it refers to.

        Raises
        ------
        MethodRefusal
            If the engine rejects the parts. The message has the engine's reason.
        """
        self._container = _engine.SystemContainer()
        self._mbs = self._container.AddSystem()
        self._numbers: dict[Ref, object] = {}
        self._of_accelerations = [
            part.name
            for part in parts
            if part.kind == "sensor"
            and "Acceleration" in str(part.parameters["outputVariableType"])
        ]
        # Accelerations at the initial state by sensor. Empty if the solver itself computes them.
        self._initial_values: dict[str, Array] = {}
        try:
            for part in parts:
                arguments = {
                    key: self._argument(key, value) for key, value in part.parameters.items()
                }
                item = getattr(itemInterface, part.type)(name=part.name, **arguments)
                add = getattr(self._mbs, f"Add{part.kind.capitalize()}")
                self._numbers[Ref(part.kind, part.name)] = add(item)
            self._mbs.Assemble()
        except _engine.ExudynError as exc:
            raise MethodRefusal(f"Exudyn rejected this model: {_one_line(str(exc))}") from exc
        self._initial_state = self._mbs.systemData.GetSystemState(_engine.ConfigurationType.Initial)
        self._sensor_numbers = [self._numbers[Ref("sensor", name)] for name in self.sensors]

    def _argument(self, key: str, value: Any) -> object:
        """Return an argument in the engine's form, with numbers of parts and the engine's types."""
        if isinstance(value, Ref):
            return self._numbers[value]
        if isinstance(value, tuple) and value and isinstance(value[0], Ref):
            return [self._numbers[ref] for ref in value]
        return _TRANSLATIONS[key](value) if key in _TRANSLATIONS else value

    def rows(self, sensor: str) -> Array:
        """Return the rows that a sensor kept in the last integration.

        Parameters
        ----------
        sensor : name of the sensor.

        Returns
        -------
        ndarray, shape (n, 1 + k)
            Time in s, then the k values of the sensor.
        """
        number = self._numbers[Ref("sensor", sensor)]
        stored = np.array(self._mbs.GetSensorStoredData(number), dtype=float, ndmin=2)
        if sensor in self._initial_values:
            stored[0, 1:] = self._initial_values[sensor]
        return stored

    def linearized(self, step: float) -> Linearized:
        """Linearize the system at the initial state by the engine's one-sided differences.

        Parameters
        ----------
        step : step of the differences, rad or m.
        """
        settings = _engine.SimulationSettings()
        settings.solution.file.write = False
        differences = settings.staticSolver.newton.numericalDifferentiation
        differences.relativeEpsilon, differences.minimumCoordinateSize = step, 1.0
        M, K, D, *more = self._mbs.ComputeLinearizedSystem(settings, returnConstraintJacobian=True)
        C = more[0] if more else np.zeros((len(M), 0))  # a model without joints
        return Linearized(np.array(M), np.array(K), np.array(D), np.array(C))

    def forces(self) -> Array:
        """Return the applied and gyroscopic forces on the coordinates at the initial state, (n,).

        The forces of the joints are left out.
        """
        solver, settings = _engine.MainSolverStatic(), _engine.SimulationSettings()
        settings.solution.file.write = False
        solver.InitializeSolver(self._mbs, settings)
        solver.ComputeODE2RHS(self._mbs)
        residual = np.array(solver.GetSystemResidual())[: solver.GetODE2size()]
        solver.FinalizeSolver(self._mbs, settings)
        return residual

    @property
    def coordinates(self) -> Array:
        return np.array(self._mbs.systemData.GetODE2Coordinates(_engine.ConfigurationType.Initial))

    @coordinates.setter
    def coordinates(self, values: Array) -> None:
        self._mbs.systemData.SetODE2Coordinates(values, _engine.ConfigurationType.Initial)

    def integrate(
        self,
        scheme: Scheme,
        intervals: Sequence[Interval],
        rows_between: bool,
        set_segment: Callable[[Segment], None],
    ) -> Integration:
        """Integrate from the initial state through all intervals, or to the first failure.

        Parameters
        ----------
        scheme : solver and options.
        intervals : intervals from one stop to the next. On each interval all loads are linear.
        rows_between : whether the sensors also keep rows between samples.
        set_segment : function that is called with the segment of each interval, before the interval
            is integrated.

        Returns
        -------
        Integration
            The report, with the reason if the end was not reached.
        """
        data = self._mbs.systemData
        data.SetSystemState(self._initial_state, _engine.ConfigurationType.Initial)
        settings = _settings(scheme, data.ODE2Size(), data.AEsize())
        integration = settings.timeIntegration
        trials: list[float] = []
        if scheme.trial_steps or must_ask():

            def before_trial(_system: object, time: float) -> bool:
                raise_if_over()
                if scheme.trial_steps:
                    trials.append(time)
                if len(trials) > scheme.trial_steps:
                    raise RuntimeError(
                        f"no progress in {scheme.trial_steps} trial steps near t = {time:.6g} s"
                    )
                return True

            self._mbs.SetPreStepUserFunction(before_trial)
        total = Integration(True)
        for interval in intervals:
            set_segment(interval.segment)
            if interval is intervals[0] and scheme.lacks_initial_accelerations:
                # Only an implicit solver computes the accelerations at the initial state. The
                # acceleration sensors are read here and their values kept. If the initial state is
                # singular, the error is suppressed here, and the run itself will fail.
                plain, implicit = (
                    _engine.SimulationSettings(),
                    _engine.MainSolverImplicitSecondOrder(),
                )
                plain.solution.file.write = False
                with contextlib.suppress(_engine.ExudynError, RuntimeError):
                    implicit.InitializeSolver(self._mbs, plain)
                    for name in self._of_accelerations:
                        values = self._mbs.GetSensorValues(self._numbers[Ref("sensor", name)])
                        self._initial_values[name] = np.array(values, dtype=float)
                    implicit.FinalizeSolver(self._mbs, plain)
                raise_if_over()  # an error at the time limit may have been suppressed above
            trials.clear()
            settings.solution.sensors.append = interval is not intervals[0]
            span = (interval.end - interval.start) / interval.sample_intervals
            steps, rows = 1, 1
            if scheme.step is not None:
                step = scheme.step
                if rows_between:
                    step = step_within(interval.segment, step)
                steps, rows = steps_and_rows(span, step, rows_between)
            integration.startTime, integration.endTime = interval.start, interval.end
            integration.numberOfSteps = steps * interval.sample_intervals
            every_step = scheme.step is None and rows_between
            # The engine adds up the periods between rows, with rounding errors. The periods of an
            # interval are shortened by a tenth of a step in total. Otherwise a row could come one
            # step late.
            period = span / rows * (1.0 - 0.1 / integration.numberOfSteps)
            settings.solution.sensors.writePeriod = 0.0 if every_step else period
            solver = (
                _engine.MainSolverExplicit()
                if scheme.stages
                else _engine.MainSolverImplicitSecondOrder()
            )
            failure, it = self._solve(solver, settings, scheme.stages, total), solver.it
            total.success, total.message = not failure, failure
            total.out_of_time = failure == MESSAGE
            total.time_reached = (
                max(interval.start, it.currentTime - it.currentStepSize)
                if failure
                else interval.end
            )
            if failure:
                break
            # The next interval starts where this one ended.
            data.SetSystemState(data.GetSystemState(), _engine.ConfigurationType.Initial)
            # The next interval begins with the last step size, but not with a step that is longer
            # than an interval: the engine would shorten such a step itself, with another rounding.
            integration.initialStepSize = min(it.currentStepSize, interval.end - interval.start)
        return total

    # The following members are for extrapolation. Each of its integrations starts from a state that
    # the caller sets.

    @property
    def sensors(self) -> list[str]:
        """Return the names of all sensors."""
        return [ref.name for ref in self._numbers if ref.kind == "sensor"]

    @property
    def reference(self) -> Array:
        """Return the reference values of the coordinates, (n,).

        The engine's coordinates are displacements from these values.
        """
        return np.array(
            self._mbs.systemData.GetODE2Coordinates(_engine.ConfigurationType.Reference)
        )

    def begin(self, scheme: Scheme, *, with_rows: bool) -> None:
        """Set the initial state, and prepare the calls of `advance` with an implicit scheme.

        Parameters
        ----------
        scheme : solver and options.
        with_rows : whether the sensors keep a row for every step of the last `advance`. Otherwise
            they keep no rows.
        """
        data = self._mbs.systemData
        data.SetSystemState(self._initial_state, _engine.ConfigurationType.Initial)
        self._settings = _settings(scheme, data.ODE2Size(), data.AEsize())
        self._settings.solution.sensors.active = with_rows
        self._settings.solution.sensors.writePeriod = 0.0
        self._solver = _engine.MainSolverImplicitSecondOrder()

    def initial_values(self, time: float) -> tuple[Array, Array]:
        """Compute accelerations and multipliers at the start of the next integration.

        Parameters
        ----------
        time : s, time at which the integration starts.

        Returns
        -------
        values : ndarray
            The state with these accelerations and multipliers, in the form of the method `values`.
        turns : ndarray
            The data coordinates, in the form of the method `turns`.
        """
        # For the accelerations the engine differentiates the velocities of the constraints by
        # one-sided differences. The velocities are polynomials of third degree in the coordinates.
        # Therefore an extrapolation from three steps to a step of zero leaves only rounding errors.
        integration = self._settings.timeIntegration
        integration.startTime, integration.endTime, integration.numberOfSteps = time, time + 1.0, 1
        integration.generalizedAlpha.computeInitialAccelerations = True
        differences = integration.newton.numericalDifferentiation
        differences.minimumCoordinateSize = 1.0
        by_step: list[Array] = []
        for k in range(3):
            differences.relativeEpsilon = 0.01 * 0.5**k
            with contextlib.suppress(_engine.ExudynError, RuntimeError):
                self._solver.InitializeSolver(self._mbs, self._settings)
                self._solver.FinalizeSolver(self._mbs, self._settings)
            by_step.append(self.values())
        integration.generalizedAlpha.computeInitialAccelerations = False
        return limit_at_zero(by_step[::-1], 2.0), self.turns()

    def advance(self, start: float, end: float, steps: int, total: Integration) -> str:
        """Integrate in equal steps from the state that was last set by `begin` or `start_from`.

        Parameters
        ----------
        start, end : s.
        steps : number of steps.
        total : report to whose numbers of steps and evaluations those of this call are added.

        Returns
        -------
        str
            The reason if the integration failed; otherwise "".
        """
        integration = self._settings.timeIntegration
        integration.startTime, integration.endTime, integration.numberOfSteps = start, end, steps
        return self._solve(self._solver, self._settings, 0, total)

    def values(self) -> Array:
        """Return the state at the end of the last integration, (3 n + multipliers,).

        It consists of coordinates, rates, accelerations and multipliers, in this order.
        """
        data, current = self._mbs.systemData, _engine.ConfigurationType.Current
        return np.concatenate(
            [
                data.GetODE2Coordinates(current),
                data.GetODE2Coordinates_t(current),
                data.GetODE2Coordinates_tt(current),
                data.GetAECoordinates(current),
            ]
        )

    def turns(self) -> Array:
        """Return the data coordinates at the end of the last integration.

        Each is the angle of a spring, rad, which the engine follows over many turns.
        """
        return np.array(self._mbs.systemData.GetDataCoordinates(_engine.ConfigurationType.Current))

    def start_from(self, values: Array, turns: Array) -> None:
        """Set the state from which the next integrations start.

        Parameters
        ----------
        values, turns : the state, in the form of the methods `values` and `turns`.
        """
        self._set(values, turns, _engine.ConfigurationType.Initial)

    def _set(self, values: Array, turns: Array, where: Any) -> None:
        """Set the state, without multipliers, of one of the engine's configurations.

        Parameters
        ----------
        values, turns : the state, in the form of the methods `values` and `turns`.
        where : the engine's configuration type, such as Initial or Current.
        """
        data = self._mbs.systemData
        n = data.ODE2Size()
        data.SetODE2Coordinates(values[:n], where)
        data.SetODE2Coordinates_t(values[n : 2 * n], where)
        data.SetODE2Coordinates_tt(values[2 * n : 3 * n], where)
        if len(turns):
            data.SetDataCoordinates(turns, where)

    def read(self, time: float, values: Array, turns: Array) -> list[Any]:
        """Return the readings of all sensors at a state, in the order of `sensors`.

        A sensor gives a number or an array.

        Parameters
        ----------
        time : s.
        values, turns : the state, in the form of the methods `values` and `turns`.
        """
        data, current = self._mbs.systemData, _engine.ConfigurationType.Current
        data.SetTime(time, current)
        self._set(values, turns, current)
        data.SetAECoordinates(values[3 * data.ODE2Size() :], current)
        return [self._mbs.GetSensorValues(number) for number in self._sensor_numbers]

    def _solve(self, solver: Any, settings: Any, stages: int, total: Integration) -> str:
        """Run a solver from start to end time; return the reason if it failed, otherwise "".

        Parameters
        ----------
        solver, settings : a solver of the engine, and the engine's settings with the times.
        stages : number of evaluations in a step of an explicit solver; 0 for an implicit solver.
        total : report to whose numbers of steps and evaluations those of this run are added.
        """
        failure = ""
        # The engine replaces an exception of a signal handler, such as that of Ctrl-C, by one of
        # its own. `caller_signals` passes the handler's exception on to the caller.
        with caller_signals():
            try:
                if not solver.SolveSystem(self._mbs, settings):
                    failure = _one_line(solver.GetErrorString()) or _NO_REASON
            except (_engine.ExudynError, OutOfTimeError, RuntimeError, SystemError) as exc:
                failure = MESSAGE
                if not _is_caused_by_limit(exc):
                    failure = (
                        _one_line(str(exc)) or _one_line(solver.GetErrorString()) or _NO_REASON
                    )
        # The engine's step index is the number of steps taken plus 1, or plus 2 if the last step
        # failed. An implicit step takes one evaluation of the residual more than Newton iterations.
        it = solver.it
        taken = max(0, it.currentStepIndex - (2 if failure else 1))
        evaluations = (
            stages * (taken + it.rejectedAutomaticStepSizeSteps)
            if stages
            else it.newtonStepsCount + taken
        )
        total.steps = (total.steps or 0) + taken
        total.rhs_evaluations = (total.rhs_evaluations or 0) + evaluations
        return failure


_NO_REASON = "the engine gave no reason"

# Smallest number of coordinates and constraints for which a sparse factorization costs less than a
# dense one. A chain with ten blades, each body with Euler parameters, has 143. The cost of a sparse
# factorization is proportional to this number, that of a dense one to its power of 2.5.
_SPARSE_FROM = 140

# Smallest number of coordinates of a tree for which a Jacobian is used for more than one step. A
# Jacobian of a tree takes one evaluation for each coordinate. From this number on it costs more
# than the additional iterations with an old Jacobian. A Jacobian of a chain costs at most as much
# as two evaluations, whatever the number of bodies.
_OLD_JACOBIAN_FROM = 13


def linear_solver(coordinates: int, constraints: int) -> str:
    """Return the engine's name of the linear solver for a system.

    Parameters
    ----------
    coordinates, constraints : number of coordinates and of constraints in the system.
    """
    # A tree has no constraints. Its matrix is one dense block.
    return (
        "EigenSparse" if constraints and coordinates + constraints >= _SPARSE_FROM else "EigenDense"
    )


def _settings(scheme: Scheme, coordinates: int, constraints: int) -> Any:
    """Return the engine's settings for a scheme and the size of a system.

    Parameters
    ----------
    scheme : solver and options.
    coordinates, constraints : number of coordinates and of constraints in the system.
    """
    settings = _engine.SimulationSettings()
    settings.solution.file.write = False
    integration = settings.timeIntegration
    integration.solverType = getattr(_engine.DynamicSolverType, scheme.solver)
    # The engine's adaptive steps are switched off. With them the engine would halve a step that
    # fails, and miss the sample times. Without them the run fails.
    integration.adaptiveStep = False
    for path, value in scheme.options.items():
        group, _, name = path.rpartition(".")
        place = attrgetter(group)(integration) if group else integration
        setattr(place, name, value)
    kind = linear_solver(coordinates, constraints)
    settings.linearSolver.solverType = getattr(_engine.LinearSolverType, kind)
    if not constraints and coordinates >= _OLD_JACOBIAN_FROM:
        integration.newton.modifiedNewtonJacUpdatePerStep = False
    return settings


def _is_caused_by_limit(error: BaseException | None) -> bool:
    """Return whether an error is an OutOfTimeError, or was raised in place of one."""
    while error is not None:
        if isinstance(error, OutOfTimeError):
            return True
        error = error.__cause__ or error.__context__
    return False


def _one_line(text: str) -> str:
    """Return a text of the engine as one line of at most 300 characters."""
    lines = [line.strip(" =*+\t") for line in text.splitlines()]
    return "; ".join(line for line in lines if line)[:300]


# Functions that convert an argument to one of the engine's own types, by the argument's name.
_TRANSLATIONS: dict[str, Callable[[Any], object]] = {
    "outputVariableType": lambda name: getattr(_engine.OutputVariableType, name),
    "localHT": lambda frame: _engine.HT(*frame),
    "jointTypes": lambda names: [getattr(_engine.JointType, name) for name in names],
} | {argument: getattr(_engine, name) for argument, name in LISTS.items()}
