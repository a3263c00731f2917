"""Adapt Exudyn, without window, console output or files.

No other module imports it. It is loaded in its fast build, without range checks.
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
with contextlib.redirect_stdout(io.StringIO()):  # it prints a greeting on import
    import exudyn
    from exudyn import itemInterface

# The engine's type stubs lag behind it.
_engine: Any = exudyn
_engine.config.printToConsole = False
_engine.config.suppressWarnings = True
# Not by the engine's environment variable: with that it would set matplotlib's backend to Agg, also
# for the caller's plots.
_engine.special.userInterface.SuppressAll(True)


class Linearized(NamedTuple):
    """Hold M δq̈ + D δq̇ + K δq + C δλ = 0 in the engine's coordinates.

    M, K, D are (n, n), C (n, constraints), in SI units.
    """

    M: Array
    K: Array
    D: Array
    C: Array


class System:
    """Hold an assembled system of the engine, which each `integrate` starts anew."""

    def __init__(self, parts: Sequence[Part]) -> None:
        """Add all parts to a system, and assemble it.

        Parameters
        ----------
        parts : in the order in which they are added: a part comes after those that it refers to.

        Raises
        ------
        MethodRefusal
            If the engine does not take the parts, with its reason.
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
        # By sensor, where the solver does not compute them.
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
        """Return an argument as the engine takes it: numbers of parts, and its own types."""
        if isinstance(value, Ref):
            return self._numbers[value]
        if isinstance(value, tuple) and value and isinstance(value[0], Ref):
            return [self._numbers[ref] for ref in value]
        return _TRANSLATIONS[key](value) if key in _TRANSLATIONS else value

    def rows(self, sensor: str) -> Array:
        """Return the rows that a sensor kept in the last integration.

        Parameters
        ----------
        sensor : its name.

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
        """Return the engine's linearization at the initial state, by one-sided differences.

        Parameters
        ----------
        step : rad and m, of the differences.
        """
        settings = _engine.SimulationSettings()
        settings.solution.file.write = False
        differences = settings.staticSolver.newton.numericalDifferentiation
        differences.relativeEpsilon, differences.minimumCoordinateSize = step, 1.0
        M, K, D, *more = self._mbs.ComputeLinearizedSystem(settings, returnConstraintJacobian=True)
        C = more[0] if more else np.zeros((len(M), 0))  # of a model without joints
        return Linearized(np.array(M), np.array(K), np.array(D), np.array(C))

    def forces(self) -> Array:
        """Return applied and gyroscopic forces on the coordinates at the initial state, (n,).

        The joints' forces are not among them.
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
        intervals : from one stop to the next; on each of them all loads are linear.
        rows_between : whether the sensors keep rows between samples, too.
        set_segment : called with the loads of each interval before it is integrated.

        Returns
        -------
        Integration
            With the reason, where the end was not reached.
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
                # What sensors of accelerations read at the initial state: only an implicit solver
                # computes it. From a singular start the run itself will fail.
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
                raise_if_over()  # its exception may have been suppressed above
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
            # The engine adds up periods, with rounding. They are shortened by a tenth of a step
            # over the whole interval, so that no row comes a step late.
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
            # The engine would cut a longer step itself, with another rounding.
            integration.initialStepSize = min(it.currentStepSize, interval.end - interval.start)
        return total

    # For extrapolation: integrations of one interval from a state that the caller sets.

    @property
    def sensors(self) -> list[str]:
        """Return the names of all sensors."""
        return [ref.name for ref in self._numbers if ref.kind == "sensor"]

    @property
    def reference(self) -> Array:
        """Return the values that the coordinates are displacements from, (n,)."""
        return np.array(
            self._mbs.systemData.GetODE2Coordinates(_engine.ConfigurationType.Reference)
        )

    def begin(self, scheme: Scheme, *, with_rows: bool) -> None:
        """Go back to the initial state, to be integrated by an implicit scheme.

        Parameters
        ----------
        scheme : solver and options.
        with_rows : whether sensors keep every step of the last `advance`; else they keep nothing.
        """
        data = self._mbs.systemData
        data.SetSystemState(self._initial_state, _engine.ConfigurationType.Initial)
        self._settings = _settings(scheme, data.ODE2Size(), data.AEsize())
        self._settings.solution.sensors.active = with_rows
        self._settings.solution.sensors.writePeriod = 0.0
        self._solver = _engine.MainSolverImplicitSecondOrder()

    def initial_values(self, time: float) -> tuple[Array, Array]:
        """Compute the initial values of an integration, accelerations and multipliers included.

        Parameters
        ----------
        time : s, at which the integration starts.

        Returns
        -------
        values : ndarray
            As of `values`.
        turns : ndarray
            As of `turns`.
        """
        # The engine differentiates the constraints' velocities by one-sided differences. They are
        # polynomials of third degree in the coordinates, so that three steps, extrapolated to zero,
        # leave rounding errors.
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
        """Integrate from the state set last in equal steps.

        Parameters
        ----------
        start, end : s.
        steps : number of steps.
        total : in which steps and evaluations are counted.

        Returns
        -------
        str
            Why it failed; "" where it did not.
        """
        integration = self._settings.timeIntegration
        integration.startTime, integration.endTime, integration.numberOfSteps = start, end, steps
        return self._solve(self._solver, self._settings, 0, total)

    def values(self) -> Array:
        """Return the state where the last integration ended.

        Coordinates, rates, accelerations and multipliers, one after the other.
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
        """Return the data coordinates where the last integration ended.

        They are the angles of springs over many turns.
        """
        return np.array(self._mbs.systemData.GetDataCoordinates(_engine.ConfigurationType.Current))

    def start_from(self, values: Array, turns: Array) -> None:
        """Set the state from which the next integration starts, as of `values` and `turns`."""
        self._set(values, turns, _engine.ConfigurationType.Initial)

    def _set(self, values: Array, turns: Array, where: Any) -> None:
        """Set a state as one of the engine's configurations."""
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
        values, turns : the state, as of the methods of these names.
        """
        data, current = self._mbs.systemData, _engine.ConfigurationType.Current
        data.SetTime(time, current)
        self._set(values, turns, current)
        data.SetAECoordinates(values[3 * data.ODE2Size() :], current)
        return [self._mbs.GetSensorValues(number) for number in self._sensor_numbers]

    def _solve(self, solver: Any, settings: Any, stages: int, total: Integration) -> str:
        """Run the solver from start to end time; return why it failed, or "".

        Parameters
        ----------
        solver, settings : the engine's.
        stages : evaluations in a step of an explicit solver; 0 for an implicit one.
        total : to which steps and evaluations are added.
        """
        failure = ""
        # The engine replaces exceptions of signal handlers, as of Ctrl-C, by its own; here they
        # reach the caller.
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
        # The engine's index is one ahead of the steps it took, and two where the last one failed;
        # an implicit step evaluates its residual once more than it iterates.
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

# Number of coordinates and constraints from which on a sparse factorization costs less than a dense
# one; a chain of twelve blades has so many. The sparse one's cost is proportional to their number,
# the dense one's to its power of 2.5.
_SPARSE_FROM = 140

# From this number of coordinates of a tree on, a Jacobian, which takes as many evaluations, costs
# more than the additional iterations with an old one. For a chain a Jacobian costs no more than two
# evaluations, whatever the number of bodies.
_OLD_JACOBIAN_FROM = 13


def linear_solver(coordinates: int, constraints: int) -> str:
    """Return the engine's name of the linear solver for a system of that size."""
    # A tree, without constraints, is one dense block.
    return (
        "EigenSparse" if constraints and coordinates + constraints >= _SPARSE_FROM else "EigenDense"
    )


def _settings(scheme: Scheme, coordinates: int, constraints: int) -> Any:
    """Return the engine's settings for a scheme and the size of a system.

    Parameters
    ----------
    scheme : solver and options.
    coordinates, constraints : their numbers in the system.
    """
    settings = _engine.SimulationSettings()
    settings.solution.file.write = False
    integration = settings.timeIntegration
    integration.solverType = getattr(_engine.DynamicSolverType, scheme.solver)
    # A step that the engine halves by itself would miss the sample times: a fixed step is kept, or
    # the run fails.
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
    """Return whether the engine made an error of its own of an OutOfTimeError."""
    while error is not None:
        if isinstance(error, OutOfTimeError):
            return True
        error = error.__cause__ or error.__context__
    return False


def _one_line(text: str) -> str:
    """Return a text of the engine in one line of at most 300 characters."""
    lines = [line.strip(" =*+\t") for line in text.splitlines()]
    return "; ".join(line for line in lines if line)[:300]


# Arguments that the engine takes in its own types: the conversion by the name of the argument.
_TRANSLATIONS: dict[str, Callable[[Any], object]] = {
    "outputVariableType": lambda name: getattr(_engine.OutputVariableType, name),
    "localHT": lambda frame: _engine.HT(*frame),
    "jointTypes": lambda names: [getattr(_engine.JointType, name) for name in names],
} | {argument: getattr(_engine, name) for argument, name in LISTS.items()}
