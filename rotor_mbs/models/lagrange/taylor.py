"""Build the closed form as a symbolic system of heyoka, and propagate it over the samples."""

from __future__ import annotations

import copy
import itertools
import weakref
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from importlib.util import find_spec
from typing import Any

import numpy as np

from rotor_mbs.methods import time_limit
from rotor_mbs.methods.base import BuiltItem
from rotor_mbs.models import equation_items
from rotor_mbs.models.lagrange import closed_form, hamilton, samples
from rotor_mbs.models.lagrange.closed_form import LoadValues, load_values
from rotor_mbs.models.lagrange.heyoka_adapter import Parameters, array_of, failure, heyoka
from rotor_mbs.models.lagrange.ode_solvers import work_unit
from rotor_mbs.models.lagrange.parameters import (
    RotorForm,
    changing_loads,
    changing_rests,
    rotor_form,
)
from rotor_mbs.models.lagrange.samples import Advance, at_constant_rests, over_segments
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import Segment
from rotor_mbs.solution.defects import KEPT_ROWS
from rotor_mbs.solution.trajectory import Array, Integration, Trajectory, sample_times

# Largest number of blades for which code is unrolled. Unrolled code is twice as fast as compact
# code, but its compile time grows with the number of blades.
_UNROLLED_BLADES = 4


def build_system(
    scene: Scene, *, in_momenta: bool = False
) -> tuple[list[tuple[Any, Any]], Parameters]:
    """Return the first-order equations of a scene in heyoka's symbols, and their parameters.

    Parameters
    ----------
    scene : the scene.
    in_momenta : whether momenta replace the rates as variables.

    Returns
    -------
    equations : list of tuple
        Symbol and right-hand side for each angle, for each rate or momentum, and for the work (in
        `work_unit`) if it is integrated.
    parameters : Parameters
        The parameters of the equations. The last ones are offset and slope of each changing load
        (`changing_loads`).

    Raises
    ------
    MethodRefusal
        If heyoka is not installed.
    """
    parameters = Parameters()
    numbers = equation_numbers(scene, parameters)
    return symbolic_equations(scene, *numbers, in_momenta=in_momenta), parameters


def symbolic_equations(
    scene: Scene,
    form: RotorForm,
    loads: LoadValues,
    work_per_joule: Any,
    *,
    in_momenta: bool = False,
) -> list[tuple[Any, Any]]:
    """Return the equations of `build_system`, made of given parameters.

    Parameters
    ----------
    scene : the scene.
    form, loads, work_per_joule : result of `equation_numbers`.
    in_momenta : see `build_system`.
    """
    engine = heyoka()
    angles, others = state_symbols(form)
    if in_momenta:
        rates = hamilton.rates(angles, others, form, engine.sin, engine.cos)
        derivatives = hamilton.forces(angles, rates, form, loads, engine.sin, engine.cos)
    else:
        rates = others
        derivatives = closed_form.accelerations(angles, rates, form, loads, engine.sin, engine.cos)
    equations = [*zip(angles, rates, strict=True), *zip(others, derivatives, strict=True)]
    if scene.work_needs_path:
        working = at_constant_rests(changing_rests(scene), loads)
        power = closed_form.power(rates, form, working)
        equations.append((engine.make_vars("work"), work_per_joule * power))
    return equations


def state_symbols(form: RotorForm) -> tuple[list[Any], list[Any]]:
    """Return symbols of the angles, and symbols of the rates or momenta, as two lists.

    Each list has the symbol of the rotor, then those of the pitches that move.
    """
    count = 1 + len(form.blades)
    symbols = heyoka().make_vars(*[f"q{i}" for i in range(count)], *[f"w{i}" for i in range(count)])
    return symbols[:count], symbols[count:]


def equation_numbers(scene: Scene, parameters: Parameters) -> tuple[RotorForm, LoadValues, Any]:
    """Return the coefficients of a scene, its loads, and 1 / `work_unit`, as heyoka's parameters.

    The last one is 0 if the work is not integrated.

    Parameters
    ----------
    scene : the scene.
    parameters : empty parameters, to which the scene's numbers are added in the order in which the
        compiled code has them.
    """
    form = rotor_form(scene, parameters)
    parameters.structure.append(int(scene.has_tilt_or_cone))
    # The error tolerance of the engine's step control is relative to the largest variable. In J the
    # work would be the largest by far, and the other variables would be less accurate.
    work_per_joule = (
        parameters.own(1 / Fraction(work_unit(scene))) if scene.work_needs_path else 0.0
    )
    linear_loads, changing = scene.load_segments[0].linear_loads, changing_loads(scene)
    values = [
        0.0 if i in changing else parameters(offset) for i, (offset, _) in enumerate(linear_loads)
    ]
    for i in changing:
        offset, slope = linear_loads[i]
        values[i] = parameters.own(offset) + parameters.own(slope) * heyoka().time
    return form, load_values(values, scene.moving_coordinates[1:]), work_per_joule


# For each key the compiled code, and a list of its copies whose owners no longer exist.
_compiled: dict[tuple[object, ...], tuple[Any, list[Any]]] = {}


def compiled(key: tuple[object, ...], make: Callable[[], Any], owner: object) -> Any:
    """Return a copy of compiled code that only `owner` uses, because the code holds a state.

    The code is compiled once per process and key. After the owner no longer exists, its copy is
    given to another owner. A copy has the state, time and parameters of its last use, and the new
    owner must set them.

    Parameters
    ----------
    key : everything on which the code depends.
    make : function that compiles the code.
    owner : the object that uses the copy.
    """
    if key not in _compiled:
        _compiled[key] = make(), []
    original, idle = _compiled[key]
    try:
        code = idle.pop()
    except IndexError:
        code = copy.deepcopy(original)
    # Copying takes time. Therefore the copy is kept for another owner when this owner is removed.
    # The code must not refer to its owner. Otherwise the owner would never be removed.
    weakref.finalize(owner, idle.append, code).atexit = False
    return code


def set_parameters(integrator: Any, values: Any) -> None:
    """Set the parameters that the compiled equations use.

    Parameters
    ----------
    integrator : integrator of heyoka.
    values : parameters of the scene: first those of the equations, then those that only energies
        and tips use.
    """
    integrator.pars[:] = values[: len(integrator.pars)]


def is_compact(scene: Scene) -> bool:
    """Return whether code for a scene is compiled in heyoka's compact mode."""
    return len(scene.blades) > _UNROLLED_BLADES


class Propagation:
    """Integrate the equations of a scene by heyoka's Taylor method.

    Attributes
    ----------
    integrator : integrator of heyoka.
    times : (n,) s, sample times.
    states : (rows, variables) states of the last run at the samples before the first one that is
        not finite. If variational, each row also has the state transition matrix, row by row.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        quad: bool = False,
        variational: bool = False,
        times: Array | None = None,
        keep: Callable[[Array], Array] | None = None,
        **options: Any,
    ) -> None:
        """Compile the equations, or take those compiled for another scene of the same structure.

        Parameters
        ----------
        scene : the scene.
        quad : whether to integrate in quad precision instead of doubles.
        variational : whether to integrate the state transition matrix, too.
        times : (n,) s, sample times; by default those of the scene.
        keep : function that reduces the states at k consecutive samples, (k, variables), to the
            values that are kept, (k, values). It is called for at most `KEPT_ROWS` samples at a
            time, so that a long run needs less memory. By default the states are kept.
        options : options of heyoka's integrator.

        Raises
        ------
        MethodRefusal
            If heyoka is not installed.
        """
        engine, self._scene = heyoka(), scene
        columns = scene.moving_coordinates
        count = 2 * len(columns)
        size = count + int(scene.work_needs_path)
        parameters = Parameters()
        numbers = equation_numbers(scene, parameters)
        self._changing = changing_loads(scene)
        structure = (*parameters.structure, size, *self._changing)
        values = [scene.initial_angles[i] for i in columns] + [
            scene.initial_rates[i] for i in columns
        ]
        values += [0.0] * (size - count)  # the work, where it is a variable
        start = array_of([Fraction(value) for value in values], quad=quad)
        # everything on which the compiled code depends
        key = (quad, variational, *options.items(), structure)
        if quad:
            options |= {"tol": engine.real128(options["tol"]), "fp_type": engine.real128}
        if variational:
            start = start[:count]

        def make() -> Any:
            equations: Any = symbolic_equations(scene, *numbers)
            if variational:
                equations = engine.var_ode_sys(
                    equations[:count], args=engine.var_args.vars, order=1
                )
            return engine.taylor_adaptive(equations, state=start, **options)

        self.integrator = compiled(key, make, self)
        set_parameters(self.integrator, array_of(parameters.values, quad=quad))
        self._initial = np.concatenate([start, np.eye(count).ravel()]) if variational else start
        self.times = sample_times(scene) if times is None else times
        self._keep = keep
        self._segments: Sequence[Segment] = scene.load_segments
        if keep is not None:
            self._segments = _cut_segments(self._segments, self.times)
        self.states = self._kept(self._initial[None, :])

    def integrate(self) -> Integration:
        """Integrate from the initial state to the end, or to the first failure."""
        self.integrator.time = self._initial.dtype.type(0)
        self.integrator.state[:] = self._initial
        self.states, integration = over_segments(
            self.times, self._segments, self._kept(self._initial[None, :])[0], self._advance
        )
        return integration

    def _kept(self, states: Array) -> Array:
        """Return the values that are kept of the states (k, variables) at some samples."""
        return states if self._keep is None else self._keep(states)

    def set_segment(self, segment: Segment) -> None:
        """Set the integrator's parameters of changing loads to the values of a segment."""
        if self._changing:
            numbers = [number for i in self._changing for number in segment.linear_loads[i]]
            self.integrator.pars[-len(numbers) :] = array_of(
                numbers, quad=self._initial.dtype != np.float64
            )

    def _advance(self, segment: Segment, _state: Array, times: Array) -> Advance:
        """Integrate over a segment, from the state that the integrator holds.

        It is the state at the end of the segment before.
        """
        integrator, kind = self.integrator, self._initial.dtype
        self.set_segment(segment)
        # The grid must reach the end of the segment, where the next one starts, even if no sample
        # is there.
        end = [] if len(times) and times[-1] == segment.end else [segment.end]
        grid = np.concatenate([[segment.start], times, end]).astype(kind)
        with time_limit.samples_kept_at_limit():
            outcome, _, _, steps, _, states = integrator.propagate_grid(
                grid, callback=time_limit.step_callback()
            )
        message = time_limit.MESSAGE if time_limit.is_over() else failure(outcome)
        kept = self._kept(states[1 : 1 + len(times)])
        return Advance(kept, integrator.state, steps, None, message)

    def observe(self) -> Trajectory:
        """Return the samples of the last run in doubles, with the work in J."""
        states = self.states.astype(float)
        if self._scene.work_needs_path:  # the work is the last variable
            states[:, -1] *= work_unit(self._scene)
        return samples.trajectory(self._scene, self.times, states)


def _cut_segments(segments: Sequence[Segment], times: Array) -> list[Segment]:
    """Return the segments of the loads, divided into parts of at most `KEPT_ROWS` samples.

    Parameters
    ----------
    segments : segments of the loads, in the order of time.
    times : (n,) s, sample times.
    """
    parts = []
    for segment in segments:
        inside = times[(times > segment.start) & (times < segment.end)]
        cuts = inside[KEPT_ROWS - 1 :: KEPT_ROWS].tolist()
        for start, end in itertools.pairwise([segment.start, *cuts, segment.end]):
            parts.append(replace(segment, start=start, end=end))
    return parts


def items(scene: Scene) -> list[BuiltItem]:
    """Return the equations, terms and outputs of a scene, without loading heyoka.

    Raises MethodRefusal if heyoka is not installed.
    """
    if find_spec("heyoka") is None:
        heyoka()  # raises MethodRefusal
    return equation_items(scene)
