"""Run many scenes of lagrange/taylor at once, by heyoka's batch integrator in Hamilton's variables.

Each SIMD lane of the processor integrates one run. Scenes whose equations have the same structure
share compiled code. The numbers of a run do not depend on the runs in the other lanes. Therefore
any partition of a sweep gives the same bits. The module uses one thread; a sweep runs several
processes in parallel.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from rotor_mbs.methods.solve import solve
from rotor_mbs.models.lagrange import closed_form, hamilton, taylor
from rotor_mbs.models.lagrange.heyoka_adapter import Parameters, array_of, failure, heyoka
from rotor_mbs.models.lagrange.ode_solvers import work_unit
from rotor_mbs.models.lagrange.parameters import Lean, leans
from rotor_mbs.models.lagrange.samples import constant_work
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Array, Integration, RunBlock

# A lane whose angles are below this (rad) has no effect on the other lanes. If one lane has an
# angle of 1e14 rad or more, the sines of all lanes are computed in another way and are rounded
# differently.
_HUGE = 1e13

_ENERGIES = ("kinetic_energy", "potential_energy", "work")

# Number of samples, over all runs of a chunk, that are computed before they are written to the
# block. So many stay in the processor's cache.
_SAMPLES_PER_CHUNK = 4096
# Number of samples of a run whose tips and energies are evaluated in one call. It is limited
# because the rotor's parameters are repeated for each sample.
_OBSERVED_PER_CALL = 1024


def lanes() -> int:
    """Return the number of lanes: runs that are integrated side by side in one vector register."""
    # With the lanes of two registers, runs are a fifth slower and compiling takes three times as
    # long.
    return int(heyoka().recommended_simd_size())


def solve_many(scenes: Sequence[Scene], tolerance: float) -> RunBlock:
    """Run several scenes, and return their samples in one block.

    Parameters
    ----------
    scenes : scenes with the same number of blades and samples, and the same outputs, which must not
        include loads.
    tolerance : tolerance of the local error.

    Returns
    -------
    RunBlock
        The samples of all runs. A run that fails has its samples up to the failure, and the reason.

    Raises
    ------
    MethodRefusal
        If heyoka is not installed.
    """
    first, runs = scenes[0], len(scenes)
    durations = np.array([scene.duration for scene in scenes])
    time = np.linspace(0.0, durations, first.samples, axis=1)
    blades = len(first.blades)
    shapes: dict[str, tuple[int, ...]] = dict.fromkeys(("angles", "rates"), (1 + blades,))
    if first.wants("tip"):
        shapes["tip"] = (blades, 3)
    if first.wants("energy"):
        shapes |= dict.fromkeys(_ENERGIES, ())
    arrays = {}
    for name, shape in shapes.items():
        arrays[name] = np.empty((*time.shape, *shape))
    block = RunBlock(time, arrays, [Integration(False)] * runs, [0] * runs)

    # For each rotor its parameters (those of the equations, then those of the tips), and the
    # structure of its equations. Rotors of equal structure share compiled code.
    rotors: dict[tuple[object, ...], tuple[Array, tuple[int, ...]]] = {}
    groups: dict[tuple[int, ...], list[int]] = {}  # numbers of the runs of each structure
    keys: dict[int, tuple[object, ...]] = {}  # for each run its key in `rotors`
    for i, scene in enumerate(scenes):
        if not scene.has_constant_loads:
            # A run is integrated from one kink of its loads to the next. The kinks of different
            # runs are at different times, so that the runs cannot share lanes.
            run = solve("lagrange/taylor", scene, {"tolerance": tolerance})
            n = len(run.trajectory.time)
            for name, values in block.quantities.items():
                values[i, :n] = getattr(run.trajectory, name)
            block.end(i, run.integration, n)
            continue
        unit = work_unit(scene) if scene.work_needs_path else 0.0
        key = (scene.rotor_key, unit)
        if key not in rotors:
            parameters = Parameters()
            taylor.equation_numbers(scene, parameters)
            _tip_numbers(scene, parameters)
            structure = (*parameters.structure, scene.work_needs_path, *scene.moving_coordinates)
            rotors[key] = array_of(parameters.values, quad=False), structure
        keys[i] = key
        _, structure = rotors[key]
        groups.setdefault(structure, []).append(i)
    for structure, places in groups.items():
        of_group = [scenes[i] for i in places]
        numbers = np.stack([rotors[keys[i]][0] for i in places], axis=1)
        group = _Group(places, of_group, structure, numbers, tolerance)
        group.run(block)
    return block


def _tip_numbers(scene: Scene, parameters: Parameters) -> list[tuple[list[Any], Lean | None]]:
    """Return parameters for each blade's tip (m), and for cosines and sines of its cone and tilt.

    Parameters
    ----------
    scene : the rotor.
    parameters : the parameters of the equations. Those of the tips are added to them.

    Returns
    -------
    list
        (blades,) tip, and a Lean or None; [] if the scene does not request the tips.
    """
    if not scene.wants("tip"):
        return []
    tips = [[parameters(Fraction(x)) for x in blade.tip] for blade in scene.blades]
    return list(zip(tips, leans(scene, parameters), strict=True))


def _momenta(example: Scene) -> Any:
    """Return a compiled function that computes the momenta from angles and rates.

    Parameters
    ----------
    example : a scene of the structure.
    """
    form, _, _ = taylor.equation_numbers(example, Parameters())
    angles, rates = taylor.state_symbols(form)
    rows = hamilton.momenta(angles, rates, form, heyoka().sin, heyoka().cos)
    return _compiled_rows(example, rows, [*angles, *rates])


def _observables(example: Scene) -> Any:
    """Return a compiled function that computes rates, tips and energies from angles and momenta.

    Tips and energies are computed only if the scene requests them. The compiled code takes a tenth
    of NumPy's time for the same formulas.

    Parameters
    ----------
    example : a scene of the structure.
    """
    engine, parameters = heyoka(), Parameters()
    form, loads, _ = taylor.equation_numbers(example, parameters)
    points = _tip_numbers(example, parameters)
    angles, momenta = taylor.state_symbols(form)
    rates = hamilton.rates(angles, momenta, form, engine.sin, engine.cos)
    moving = dict(zip(example.moving_coordinates, angles, strict=True))
    # The angle of a fixed pitch is a parameter, because it differs from run to run.
    pitches = []
    for coordinate in range(1, 1 + len(example.blades)):
        if coordinate in moving:
            pitches.append(moving[coordinate])
        else:
            pitches.append(parameters.own(Fraction(0)))
    observables: list[Any] = [*rates]
    for i, (point, lean) in enumerate(points):
        azimuth = angles[0] + example.phases[i]
        observables += closed_form.point_path(
            azimuth, pitches[i], point, engine.sin, engine.cos, lean
        )
    if example.wants("energy"):
        observables += closed_form.energies(angles, rates, form, loads, engine.sin, engine.cos)
    return _compiled_rows(example, observables, [*angles, *momenta])


def _compiled_rows(example: Scene, rows: Sequence[Any], variables: Sequence[Any]) -> Any:
    """Return a compiled function that computes expressions, one per row, from variables.

    Parameters
    ----------
    example : a scene of the structure.
    rows : the expressions.
    variables : the symbols whose values are given to the function.
    """
    # If all terms of an expression vanish, the closed form returns the number zero, but the engine
    # takes only expressions.
    expressions = [heyoka().expression(0.0) + row for row in rows]
    return heyoka().cfunc(expressions, variables, compact_mode=taylor.is_compact(example))


def _observed(function: Any, states: Array, numbers: Array) -> Array:
    """Evaluate compiled code at the states of several runs.

    The number of runs must be a multiple of the number of lanes. Otherwise the engine computes the
    last runs by other instructions, which round differently.

    Parameters
    ----------
    function : result of `_compiled_rows`.
    states : (variables, runs, samples) states of the coordinates that move.
    numbers : (parameters, runs) parameters of the runs, see `_Group`.

    Returns
    -------
    ndarray, shape (rows, runs, samples)
        The value of each expression at each sample.
    """
    _, runs, samples = states.shape
    parts = []
    for i in range(0, samples, _OBSERVED_PER_CALL):
        part = states[: function.nvars, :, i : i + _OBSERVED_PER_CALL]
        count = part.shape[2]
        # The engine needs a copy of the parameters for every state.
        spread = np.broadcast_to(
            numbers[: function.nparams, :, None], (function.nparams, runs, count)
        )
        inputs = np.ascontiguousarray(part).reshape(len(part), -1)
        pars = np.ascontiguousarray(spread).reshape(len(spread), -1)
        rows = function(inputs, pars=pars, batch_parallel=False)
        parts.append(rows.reshape(-1, runs, count))
    return np.concatenate(parts, axis=2)


class _Group:
    """Run the scenes whose equations have one structure, by shared compiled code."""

    def __init__(
        self,
        places: list[int],
        scenes: list[Scene],
        structure: tuple[int, ...],
        numbers: Array,
        tolerance: float,
    ) -> None:
        """Compile the code, or take code that was compiled for another group of the same structure.

        Parameters
        ----------
        places : (runs,) number of each run in the block.
        scenes : (runs,) scenes whose equations have the same structure.
        structure : what the compiled code of these equations depends on.
        numbers : (parameters, runs) parameters of the rotors.
        tolerance : tolerance of the local error.
        """
        example = scenes[0]
        self.places, self.scenes = places, scenes

        def integrator() -> Any:
            equations, _ = taylor.build_system(example, in_momenta=True)
            options = {
                "tol": tolerance,
                "compact_mode": taylor.is_compact(example),
                "high_accuracy": True,
            }
            return heyoka().taylor_adaptive_batch(
                equations, state=np.zeros((len(equations), lanes())), **options
            )

        self.integrator = taylor.compiled(("batch", tolerance, structure), integrator, self)
        outputs = example.wants("tip"), example.wants("energy")
        self.observables = taylor.compiled(
            ("observables", *outputs, structure), lambda: _observables(example), self
        )
        self.momenta = taylor.compiled(("momenta", structure), lambda: _momenta(example), self)
        self.moving = example.moving_coordinates
        fixed = [i for i in range(len(example.initial_angles)) if i not in self.moving]
        angles = np.array([scene.initial_angles for scene in scenes]).T
        rates = np.array([scene.initial_rates for scene in scenes]).T
        self.initial = np.zeros((self.integrator.state.shape[0], len(scenes)))
        self.initial[: 2 * len(self.moving)] = np.concatenate(
            [angles[self.moving], rates[self.moving]]
        )
        self.times = np.linspace(
            0.0, np.array([scene.duration for scene in scenes]), example.samples
        )
        # (parameters, runs): the rotor's parameters, then the angles of the fixed pitches.
        self.numbers = np.concatenate([numbers, angles[fixed]])

    def run(self, block: RunBlock) -> None:
        """Run all scenes of the group, in chunks whose samples stay in the processor's cache.

        Parameters
        ----------
        block : block to which the samples are written.
        """
        width = self.integrator.state.shape[1]
        runs = len(self.scenes)
        chunk = max(_SAMPLES_PER_CHUNK // len(self.times) // width, 1) * width
        for start in range(0, runs, chunk):
            columns = list(range(start, min(start + chunk, runs)))
            padded = columns + [columns[-1]] * (-len(columns) % width)
            states, observed, integrations = self.solve(padded)
            self.put(block, padded, states, observed, integrations[: len(columns)])
            # A run that failed, or has huge angles, may have had an effect on the other lanes.
            # `sizes` has the largest magnitude of each variable; NaN if a sample is NaN.
            sizes = np.maximum(states.max(axis=2), -states.min(axis=2))
            angles = sizes[: len(sizes) // 2]
            independent = (angles < _HUGE).all(axis=0) & np.isfinite(sizes).all(axis=0)
            independent &= [integration.success for integration in integrations]
            affected = {i // width for i in np.flatnonzero(~independent).tolist()}
            for i in [i for i in range(len(columns)) if i // width in affected]:
                # If one lane fails, all lanes end. Therefore each run of these lanes is repeated
                # alone, with a copy of it in every lane.
                alone = [columns[i]] * width
                states, observed, integrations = self.solve(alone)
                # Samples after the first one that is not finite are no motion.
                is_lost = ~np.isfinite(states).all(axis=0)
                states[:, np.maximum.accumulate(is_lost, axis=1)] = np.nan
                self.put(block, alone, states, observed, integrations[:1])

    def solve(self, columns: Sequence[int]) -> tuple[Array, Array, list[Integration]]:
        """Integrate some of the runs.

        Parameters
        ----------
        columns : numbers of the runs in this group, in the order in which they fill the lanes.

        Returns
        -------
        states : ndarray, shape (variables, columns, samples)
            Angles, rates and, if it is integrated, the work.
        observed : ndarray, shape (rows, columns, samples)
            Tips and energies.
        integrations : list of Integration
            The engine's report on each column.
        """
        width = self.integrator.state.shape[1]
        initial, times = self.initial[:, columns], self.times[:, columns]
        numbers = self.numbers[:, columns]
        states = np.empty((len(initial), len(columns), len(times)))
        half, integrations = len(self.moving), []
        # The equations have momenta in place of rates.
        start = initial.copy()
        start[half : 2 * half] = _observed(self.momenta, initial[:, :, None], numbers)[:, :, 0]
        for i in range(0, len(columns), width):
            lanes = slice(i, i + width)
            self.integrator.set_time(np.zeros(width))
            self.integrator.state[:] = start[:, lanes]
            taylor.set_parameters(self.integrator, numbers[:, lanes])
            _, samples = self.integrator.propagate_grid(times[:, lanes])
            states[:, lanes] = samples.transpose(1, 2, 0)
            for result in self.integrator.propagate_res:
                message = failure(result[0])
                integrations.append(Integration(not message, message, 0.0, int(result[3])))
        states[:, :, 0] = start  # set here, because a run may fail in its first step
        observed = _observed(self.observables, states, numbers)
        states[half : 2 * half] = observed[:half]
        states[:, :, 0] = initial
        return states, observed[half:], integrations

    def put(
        self,
        block: RunBlock,
        columns: Sequence[int],
        states: Array,
        observed: Array,
        integrations: Sequence[Integration],
    ) -> None:
        """Write the runs of the first len(integrations) columns to the block.

        Parameters
        ----------
        block : block to which the samples are written.
        columns : numbers of the runs in this group.
        states, observed : see `solve`.
        integrations : the engine's reports on the runs to be written. The other columns are copies
            that only fill the lanes.
        """
        runs, count = len(integrations), len(self.moving)
        states, observed = states[:, :runs], observed[:, :runs]
        places = [self.places[i] for i in columns[:runs]]
        scenes = [self.scenes[i] for i in columns[:runs]]
        angles, rates = block.quantities["angles"], block.quantities["rates"]
        angles[places] = np.array([scene.initial_angles for scene in scenes])[:, None]
        rates[places] = 0.0
        for i, column in enumerate(self.moving):
            angles[places, :, column], rates[places, :, column] = states[i], states[count + i]
        rows = 0
        if "tip" in block.quantities:
            tip = block.quantities["tip"].reshape(*block.time.shape, -1)
            rows = tip.shape[2]
            tip[places] = observed[:rows].transpose(1, 2, 0)
        if "work" in block.quantities:
            kinetic, potential, work = (block.quantities[name] for name in _ENERGIES)
            kinetic[places], potential[places] = observed[rows], observed[rows + 1]
            has_work = len(states) > 2 * count
            for i, place in enumerate(places):
                if has_work:
                    work[place] = states[2 * count, i] * work_unit(scenes[i])
                else:
                    work[place] = constant_work(scenes[i], angles[place])
        samples = states.shape[2] - np.isnan(states[0]).sum(axis=1)
        for i, integration, n in zip(places, integrations, samples.tolist(), strict=True):
            block.end(i, integration, n)
