"""What data that do not agree look like: mistakes in the data, then other scenes and equations, each of them run."""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from rotor_mbs.methods.time_limit import OutOfTimeError
from rotor_mbs.models.lagrange.reference import LEFT_OUT, at_azimuths
from rotor_mbs.models.ode45 import Ode45Settings
from rotor_mbs.models.printed.matrices import Errata
from rotor_mbs.models.printed.methods import PrintedModel
from rotor_mbs.scenario.catalogue import find_scenes, list_scenes
from rotor_mbs.scenario.scene import Blade, Scene, scene_fields
from rotor_mbs.solution.metrics import HORIZON_GROWTH
from rotor_mbs.solution.trajectory import Array
from rotor_mbs.studies.data_causes import (
    FEWEST,
    CauseSearch,
    Motion,
    causes_in_the_data,
    factors,
    mistakes_in_columns,
    states_at,
)

_GRAVITIES = (9.8, 9.80665, 9.81, 9.82, 10.0, 0.0)
_EARLY = 10.0  # growth up to which a cause is tried first: most are refuted there
_STEP = 1.25e-3  # s, of what is interpolated: of the printed equations' own run, its error is some 1e-9
_EARLY_ROWS = 40  # so many rows are tried first at most
# Growth, and rows, up to which a parameter is fitted, one after another: a start too far off is useless once errors
# have grown, and most parameters are refuted by the first rows.
_LEVELS = ((3.0, _EARLY_ROWS), (1e1, 200), (1e2, 1000), (1e3, 10**4), (1e4, 10**5), (HORIZON_GROWTH, 10**9))
_LARGEST_CHANGE = 0.3
_SAME_START = 1e-3  # rad, rad/s: a scene that starts farther off cannot be the one
_MOST = 6  # parameters that are named
_QUARTERS = {90: math.pi / 2.0, 180: math.pi, 270: -math.pi / 2.0}  # zeros that people choose, by degrees

Path = tuple[int | str, ...]  # names of fields, numbers of entries
Parameter = tuple[str, str, Callable[[float], Motion]]  # key, unit or "" for a share, motion by its change


def likely_causes(search: CauseSearch) -> tuple[list[str], str]:
    """What fits, in words: mistakes in the data, else other scenes and equations, else one parameter that is off.

    Beside it what a reader must know where the time of the search was over before all had been tried, else "".
    """
    motions, parameters = list(_motions(search)), list(_parameters(search.scene))
    found, both, fitted, tried = list[str](), list[str](), list[tuple[float, str]](), 0
    try:
        found = causes_in_the_data(search)
        if found or search.worst <= search.tolerance:
            return found, ""
        for text, motion in motions:
            beside = _fits(search, motion)
            if beside is not None:
                (both if beside else found).append("; and ".join([text, *beside]))
            tried += 1
        for key, unit, changed in [] if found or both else parameters:
            change, left = _fitted(search, changed)
            if left <= search.fitting:
                size = f"{change:+.4g} {unit}" if unit else f"{100.0 * change:+.4g} %"
                fitted.append((left, f"{key} off by {size}"))
            tried += 1
    except OutOfTimeError:
        count = len(motions) + len(parameters)
        return found or both, f"the search for causes was ended by its time limit: {tried} of {count} scenes tried"
    return found or both or [*_best(fitted, search.tolerance), *factors(search)], ""


def _best(fitted: Sequence[tuple[float, str]], tolerance: float) -> list[str]:
    """Parameters that leave least; several may be one to the motion."""
    least = max(min(fitted)[0], 1e-3 * tolerance) if fitted else 0.0
    return [text for left, text in fitted if left <= 10.0 * least][:_MOST]


def _fits(search: CauseSearch, motion: Motion) -> list[str] | None:
    """First over the first rows, up to a growth of `_EARLY`, then up to the horizon.

    None where it does not fit; else what is wrong with the columns beside, which is nothing where it fits as it is.
    """
    data, beside = search.data, list[str]()
    for growth, most in ((_EARLY, _EARLY_ROWS), (math.inf, 10**9)):
        inside = np.flatnonzero(search.rows(data.time, growth))[:most]
        if growth == _EARLY and len(inside) < FEWEST:
            continue
        time, values = data.time[inside], data.values[inside]
        states, beside = search.states(motion, time), []
        if not search.misfit(time, values, states) <= search.fitting:
            beside = mistakes_in_columns(search, time, values, states)
            if not beside:
                return None
    return beside


def _motions(search: CauseSearch) -> Iterator[tuple[str, Motion]]:
    scene = search.scene
    for text, other in _scenes(search):
        yield text, partial(states_at, other)
    for text, azimuths in _azimuths(scene):
        yield text, partial(states_at, scene, equations=at_azimuths(scene, azimuths))
    for terms, equations in LEFT_OUT.items():
        yield f"without the {terms}", partial(states_at, scene, equations=equations)
    # E3 is the power of a term that is zero without E2.
    for names in ("E1", "E2", "E1 and E2", "E2 and E3", "E1 and E2 and E3"):
        errata = Errata(*(name in names for name in ("E1", "E2", "E3")))
        yield f"erratum {names} of the paper's equations", partial(_printed, scene, errata)


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
    for degrees, angle in _QUARTERS.items():
        turned = _pitch_turned(scene, range(len(scene.blades)), angle)
        yield f"pitch angles from another zero: {degrees} degrees where they are 0", turned
    first = search.data.values[0]
    for other in _catalogue():
        states = np.array([*other.initial_angles, *other.initial_rates])
        is_other = other.name != scene.name and len(other.blades) == len(scene.blades)
        if is_other and np.abs(states[search.data.columns] - first).max() < _SAME_START:
            yield f"the scene {other.name}", other


@functools.cache
def _catalogue() -> tuple[Scene, ...]:
    return tuple(find_scenes(sorted({name.partition("/")[0] for name, _ in list_scenes()})))


def _azimuths(scene: Scene) -> Iterator[tuple[str, Sequence[float]]]:
    """Blades at other angles about the shaft than they should be."""
    right, n = scene.phases, len(scene.blades)
    if n > 1:
        yield "all blades at the azimuth of blade 1", (0.0,) * n
        yield "azimuths of the blades in degrees taken as rad", [math.degrees(phase) for phase in right]
    if n > 2:
        yield "blades numbered the other way round", (right[0], *right[:0:-1])
        for i in range(n):
            for other in ((i + 1) % n, (i - 1) % n):
                text = f"blade {i + 1} at an azimuth of {360 * other / n:g} degrees in place of {360 * i / n:g}"
                yield text, (*right[:i], right[other], *right[i + 1 :])
    others = {360.0 * i / n: phase for i, phase in enumerate(right) if i}
    for degrees, angle in (others | _QUARTERS).items():
        text = f"rotor angle from another zero: blade 1 at an azimuth of {degrees:g} degrees where it is 0"
        yield text, [phase + angle for phase in right]


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


def _fitted(search: CauseSearch, changed: Callable[[float], Motion]) -> tuple[float, float]:
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
            states = search.states(changed(size), time)
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


def _parameters(scene: Scene) -> Iterator[Parameter]:
    """Every number, or list of numbers, that is not zero, and the zeros of the angles."""
    for one in scene_fields("rotor", "start"):
        key, value = one.metadata["key"], getattr(scene, one.name)
        if one.metadata["part"] == "start":
            for i in scene.moving_coordinates:
                yield f"{key}[{i}]", one.metadata["unit"], _runs(_changed, scene, [(one.name, i)], operator.add)
        elif one.name != "blades" and _scaled(value, 1.0) != value:
            yield key, "", _runs(_changed, scene, [(one.name,)], _scaled)
    blades = range(len(scene.blades))
    for chosen in [list(blades), *([i] for i in blades if len(blades) > 1)]:
        alone = len(chosen) == 1 < len(blades)
        for field in fields(Blade):
            value = getattr(scene.blades[chosen[0]], field.name)
            entries = [(i,) for i, x in enumerate(value) if x] if isinstance(value, tuple) else [()] * bool(value)
            for entry in entries if field.name != "tip" else []:
                paths = [("blades", b, field.name, *entry) for b in chosen]
                key = f"blade{chosen * alone or ''}.{field.name}{list(entry) or ''}"
                yield key, "", _runs(_changed, scene, paths, _scaled)
        which = f"blade {chosen[0] + 1}" if len(chosen) == 1 else "all blades"
        yield f"azimuth of {which}", "rad", partial(_azimuth_moved, scene, chosen)
        yield f"zero of the pitch of {which}", "rad", _runs(_pitch_turned, scene, chosen)


def _runs(changed: Callable[..., Scene], *chosen: Any) -> Callable[[float], Motion]:
    """The motion of a scene by the change of its parameter, the last argument of `changed`."""
    return lambda change: partial(states_at, changed(*chosen, change))


def _azimuth_moved(scene: Scene, chosen: Sequence[int], change: float) -> Motion:
    azimuths = [phase + change * (i in chosen) for i, phase in enumerate(scene.phases)]
    return partial(states_at, scene, equations=at_azimuths(scene, azimuths))


def _pitch_turned(scene: Scene, chosen: Sequence[int], angle: float) -> Scene:
    """Chosen blades that are turned about the pitch axis where their pitch is 0."""
    s, c = math.sin(angle), math.cos(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    blades = list(scene.blades)
    for i in chosen:
        xx, yy, zz, xy, xz, yz = blades[i].inertia
        inertia = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
        blades[i] = replace(
            blades[i],
            centre_of_mass=tuple((turn @ blades[i].centre_of_mass).tolist()),
            inertia=tuple(inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist()),
        )
    return replace(scene, blades=tuple(blades))


def _changed(scene: Scene, paths: Sequence[Path], how: Callable[[Any, float], Any], change: float) -> Scene:
    """The scene with `how(value, change)` in place of the values at some paths."""
    for path in paths:
        scene = _with_value(scene, path, lambda value: how(value, change))
    return scene


def _with_value(whole: Any, path: Path, new: Callable[[Any], Any]) -> Any:
    if not path:
        return new(whole)
    first, rest = path[0], path[1:]
    if isinstance(first, int):
        return (*whole[:first], _with_value(whole[first], rest, new), *whole[first + 1 :])
    return replace(whole, **{first: _with_value(getattr(whole, first), rest, new)})


def _scaled(value: Any, share: float) -> Any:
    """Numbers larger by a share; of a table over time, not the times."""
    if not isinstance(value, tuple):
        return value * (1.0 + share) if isinstance(value, float) else value
    if value and all(isinstance(row, tuple) and len(row) == 2 and not isinstance(row[0], tuple) for row in value):
        return tuple((row[0], row[1] * (1.0 + share)) for row in value)
    return tuple(_scaled(entry, share) for entry in value)
