"""What data that do not agree look like, of other scenes and equations: each is run and compared with the data."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, replace
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from rotor_mbs.errors import RotorError
from rotor_mbs.methods.time_limit import OutOfTimeError, time_limit
from rotor_mbs.models.lagrange.at_times import LEFT_OUT, motion_without
from rotor_mbs.models.ode45 import Ode45Settings
from rotor_mbs.models.printed.matrices import Errata
from rotor_mbs.models.printed.methods import PrintedModel
from rotor_mbs.scenario.catalogue import find_scenes, list_scenes
from rotor_mbs.scenario.scene import Blade, Scene, scene_fields
from rotor_mbs.solution.metrics import HORIZON_GROWTH
from rotor_mbs.solution.record import Array
from rotor_mbs.studies.data_causes import FEWEST, CauseSearch, factors, states_at

_GRAVITIES = (9.8, 9.80665, 9.81, 9.82, 10.0, 0.0)
_EARLY = 10.0  # growth up to which a cause is tried first: most are refuted there
_STEP = 1.25e-3  # s, of what is interpolated: of the printed equations' own run, its error is some 1e-9
_LONGEST_S = 5.0  # of one run: a scene of the catalogue may be so stiff that it would take minutes
_EARLY_ROWS = 40  # so many rows are tried first at most
# Growth, and rows, up to which a parameter is fitted, one after another: a start too far off is useless once errors
# have grown, and most parameters are refuted by the first rows.
_LEVELS = ((3.0, _EARLY_ROWS), (1e1, 200), (1e2, 1000), (1e3, 10**4), (1e4, 10**5), (HORIZON_GROWTH, 10**9))
_LARGEST_CHANGE = 0.3
_SAME_START = 1e-3  # rad, rad/s: a scene that starts farther off cannot be the one
_MOST = 6  # parameters that are named

Motion = Callable[[Array], Array | None]  # (n,) s -> (n, 2 (1 + blades)), None where it ends before


def causes_in_the_scene(search: CauseSearch) -> list[str]:
    """What fits, in words: other scenes and equations; where none does, one parameter that is off."""
    found = [text for text, motion in _motions(search) if _fits(search, motion)]
    return found or [*_one_parameter(search), *factors(search)]


def _fits(search: CauseSearch, motion: Motion) -> bool:
    """First over the first rows, up to a growth of `_EARLY`, then up to the horizon."""
    data = search.data
    for growth, most in ((_EARLY, _EARLY_ROWS), (math.inf, 10**9)):
        inside = np.flatnonzero(search.rows(data.time, growth))[:most]
        if growth == _EARLY and len(inside) < FEWEST:
            continue
        try:
            with time_limit(_LONGEST_S):
                states = motion(data.time[inside])
        except (RotorError, OutOfTimeError):
            return False
        expected = None if states is None else states[:, data.columns]
        if not search.misfit(data.time[inside], data.values[inside], expected) <= search.fitting:
            return False
    return True


def _motions(search: CauseSearch) -> Iterator[tuple[str, Motion]]:
    scene = search.scene
    for text, other in _scenes(search):
        yield text, partial(states_at, other)
    if len(scene.blades) > 2:
        yield "blades numbered the other way round", partial(_renumbered, scene)
    for terms in LEFT_OUT:
        yield f"without the {terms}", partial(_without, scene, terms)
    for size in (1, 2, 3):
        for chosen in combinations(("e1", "e2", "e3"), size):
            if chosen in (("e3",), ("e1", "e3")):  # E3 is the power of a term that is zero without E2
                continue
            errata = Errata(*(name in chosen for name in ("e1", "e2", "e3")))
            text = f"erratum {' and '.join(name.upper() for name in chosen)} of the paper's equations"
            yield text, partial(_printed, scene, errata)


def _scenes(search: CauseSearch) -> Iterator[tuple[str, Scene]]:
    scene = search.scene
    for gravity in (*_GRAVITIES, -scene.gravity):
        if gravity != scene.gravity:
            yield f"gravity of {gravity:g} m/s^2", replace(scene, gravity=gravity)
    on_axis = tuple(replace(blade, centre_of_mass=(0.0, 0.0, blade.centre_of_mass[2])) for blade in scene.blades)
    if on_axis != scene.blades and all(
        blade.has_pitch_inertia or not rate for blade, rate in zip(on_axis, scene.initial_rates[1:], strict=True)
    ):
        yield "blade mass on the pitch axis", replace(scene, blades=on_axis)
    first = search.data.values[0]
    for other in _catalogue():
        states = np.array([*other.initial_angles, *other.initial_rates])
        is_other = other.name != scene.name and len(other.blades) == len(scene.blades)
        if is_other and np.abs(states[search.data.columns] - first).max() < _SAME_START:
            yield f"the scene {other.name}", other


@functools.cache
def _catalogue() -> tuple[Scene, ...]:
    return tuple(find_scenes(sorted({name.partition("/")[0] for name, _ in list_scenes()})))


def _renumbered(scene: Scene, time: Array) -> Array | None:
    """Blade 2 in the place of the last one, and so on."""
    order = [0, *range(len(scene.blades) - 1, 0, -1)]
    coordinates = [0, *(1 + i for i in order)]
    changed: dict[str, Any] = {}
    for one in scene_fields("rotor", "start"):
        value = getattr(scene, one.name)
        places = coordinates if one.metadata["part"] == "start" else order
        if value and (one.name == "blades" or one.metadata["per_blade"] or places is coordinates):
            changed[one.name] = tuple(value[i] for i in places)
    states = states_at(replace(scene, **changed), time)
    return None if states is None else states[:, [*coordinates, *(len(coordinates) + i for i in coordinates)]]


def _without(scene: Scene, terms: str, time: Array) -> Array | None:
    times = np.union1d([0.0], time)
    whole = replace(scene, duration=float(times[-1]), samples=len(times), outputs=("angles", "rates"))
    run = motion_without(whole, times, terms)
    complete = len(run.time) == len(times)
    return np.hstack([run.angles, run.rates])[len(times) - len(time) :] if complete else None


def _printed(scene: Scene, errata: Errata, time: Array) -> Array | None:
    """The paper's derivation with some of its errata; its own samples are so near that they can be interpolated.

    Raises MethodRefusal for a scene that the printed equations have no place for.
    """
    end = float(time[-1])
    whole = replace(scene, duration=end, samples=2 + math.ceil(end / _STEP), outputs=("angles", "rates"))
    solver = PrintedModel("printed", errata).build(
        whole, Ode45Settings(relative_tolerance=1e-9, absolute_tolerance=1e-11)
    )
    solver.integrate()
    run = solver.observe()
    if len(run.time) < whole.samples:
        return None
    spline = CubicHermiteSpline(run.time, run.angles, run.rates)
    return np.hstack([spline(time), spline(time, 1)])


def _one_parameter(search: CauseSearch) -> list[str]:
    """Parameters of the scene that are off alone, fitted: those that leave least; several may be one to the motion."""
    found = []
    for key, unit, changed in _parameters(search.scene):
        change, left = _fitted(search, changed)
        if left <= search.fitting:
            size = f"{change:+.4g} {unit}" if unit else f"{100.0 * change:+.4g} %"
            found.append((left, f"{key} off by {size}"))
    best = max(min(found)[0], 1e-3 * search.tolerance) if found else 0.0
    return [text for left, text in found if left <= 10.0 * best][:_MOST]


def _fitted(search: CauseSearch, changed: Callable[[float], Scene]) -> tuple[float, float]:
    """(change, error per unit of growth that is left) by Gauss and Newton's iteration over ever longer times."""
    change, left, before, rows = 0.0, math.inf, math.inf, 0
    for level, most in _LEVELS:
        inside = np.flatnonzero(search.rows(search.data.time, level))[:most]
        if len(inside) < max(FEWEST, rows + 1):
            continue
        rows = len(inside)
        time, values = search.data.time[inside], search.data.values[inside]
        weights = 1.0 / search.carried(time)[:, search.data.columns]

        def errors(size: float, time: Array = time, values: Array = values, weights: Array = weights) -> Array | None:
            states = states_at(changed(size), time)
            return None if states is None else (values - states[:, search.data.columns]) * weights

        step = 1e-3 / level
        for _ in range(3):
            here, beside = errors(change), errors(change + step)
            if here is None or beside is None:
                return change, math.inf
            left = float(np.abs(here).max())
            before = left if before == math.inf else before
            if left <= 0.01 * search.tolerance:
                break
            slope = (beside - here) / step
            size = float((slope**2).sum())
            if size == 0.0:
                return change, math.inf
            change -= float(np.clip((slope * here).sum() / size, -_LARGEST_CHANGE, _LARGEST_CHANGE))
        final = errors(change)
        left = math.inf if final is None else float(np.abs(final).max())
        if not left <= max(0.2 * before, 0.01 * search.fitting):
            return change, math.inf
    return change, left


def _parameters(scene: Scene) -> Iterator[tuple[str, str, Callable[[float], Scene]]]:
    """(key, unit or "" for a share, change -> scene) of every number, or list of numbers, that is not zero."""
    for one in scene_fields("rotor", "start"):
        key, value = one.metadata["key"], getattr(scene, one.name)
        if one.name == "blades":
            yield from _blade_parameters(scene)
        elif one.metadata["part"] == "start":
            for i in scene.moving_coordinates:
                yield f"{key}[{i}]", one.metadata["unit"], partial(_start_moved, scene, one.name, i)
        elif _scaled(value, 2.0) != value:
            yield key, "", partial(_field_scaled, scene, one.name)


def _start_moved(scene: Scene, name: str, i: int, change: float) -> Scene:
    changed: dict[str, Any] = {name: _entry_moved(getattr(scene, name), i, change)}
    return replace(scene, **changed)


def _field_scaled(scene: Scene, name: str, change: float) -> Scene:
    changed: dict[str, Any] = {name: _scaled(getattr(scene, name), 1.0 + change)}
    return replace(scene, **changed)


def _blade_parameters(scene: Scene) -> Iterator[tuple[str, str, Callable[[float], Scene]]]:
    """Of all blades alike, then of each."""
    each = [(f"[{i}]", (i,)) for i in range(len(scene.blades))] if len(scene.blades) > 1 else []
    for label, chosen in [("", tuple(range(len(scene.blades)))), *each]:
        for one in fields(Blade):
            value = getattr(scene.blades[chosen[0]], one.name)
            for i in range(len(value)) if isinstance(value, tuple) else [-1]:
                if one.name != "tip" and (value[i] if isinstance(value, tuple) else value):
                    entry = f"[{i}]" if i >= 0 else ""
                    yield f"blade{label}.{one.name}{entry}", "", partial(_blades_scaled, scene, chosen, one.name, i)


def _blades_scaled(scene: Scene, chosen: Sequence[int], name: str, i: int, change: float) -> Scene:
    """i: the entry; -1 where it is a number."""
    blades = list(scene.blades)
    for b in chosen:
        old = getattr(blades[b], name)
        changed: dict[str, Any] = {name: _entry_moved(old, i, old[i] * change) if i >= 0 else old * (1.0 + change)}
        blades[b] = replace(blades[b], **changed)
    return replace(scene, blades=tuple(blades))


def _entry_moved(values: tuple[float, ...], i: int, change: float) -> tuple[float, ...]:
    return (*values[:i], values[i] + change, *values[i + 1 :])


def _scaled(value: Any, factor: float) -> Any:
    """Numbers times a factor; of a table over time, not the times."""
    if not isinstance(value, tuple):
        return value * factor if isinstance(value, float) else value
    if value and all(isinstance(row, tuple) and len(row) == 2 and not isinstance(row[0], tuple) for row in value):
        return tuple((row[0], row[1] * factor) for row in value)
    return tuple(_scaled(entry, factor) for entry in value)
