"""Compare loads of another program with the closed form's loads, and find causes of differences.

The loads of the closed form are computed at the states of the data.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.comparison.channels import Channel, channels
from rotor_mbs.comparison.column_readings import held_rows
from rotor_mbs.comparison.data import ForeignData
from rotor_mbs.comparison.hypotheses import Explanation, Hypothesis, cheapest, explanations
from rotor_mbs.comparison.other_rotors import other_scenes
from rotor_mbs.comparison.verdict import ChannelErrors, agrees_until
from rotor_mbs.models.lagrange.samples import LoadParts, sampled_loads
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import ALIGNMENT, ROTOR_TORQUE, values_before
from rotor_mbs.solution.defects import FLOOR_SAFETY, Defects
from rotor_mbs.solution.quantities import LOADS, longest_arm
from rotor_mbs.solution.trajectory import Array, all_coordinates

# Errors of a component are divided by its largest value, but at least by this share of the largest
# force at a root (for a moment, times the longest arm): a component near zero has no other scale.
_SMALL = 1e-3
# Rounding of the sums by which a load is computed, relative to the largest force at a root.
_LOAD_ROUNDING = 16.0 * 2.0**-53
_STATE_STEP = 1e-7  # relative step of an angle or rate, for the derivative of the loads
_FEW_ROWS = 50  # largest number of rows in which another scene is tried first, to save time
MIN_EXPLAINED = 5  # least number of rows for a search; with fewer, some cause always fits
# A mistake is named as a cause if the errors that it leaves are at most LEFT_SHARE of the
# difference, and at most MAX_LEFT, or the tolerance if it is smaller, relative to the largest value
# of the load component or, in `comparison.modes`, to the frequency. What is left counts as the
# other program's own error.
MAX_LEFT = 1e-4
LEFT_SHARE = 1e-2
WHOLE = LoadParts()
# Mistakes in the terms that loads consist of, and the factors of the terms.
_FORGOTTEN = {
    "without the weight": LoadParts(weight=0.0),
    "with twice the weight": LoadParts(weight=2.0),
    "without the forces of the rates (centrifugal, Coriolis)": LoadParts(rates=0.0),
    "without the accelerations of rotor and pitches": LoadParts(accelerations=0.0),
    "of the weight alone, without inertia forces": LoadParts(accelerations=0.0, rates=0.0),
    "without the inertia of the hub": LoadParts(hub=0.0),
    "without the inertia of the blades about their centres of mass": LoadParts(inertia=0.0),
    "without the dampers of the bearings": LoadParts(dampers=0.0),
    "without the pitch torques": LoadParts(torques=0.0),
}
# Mistakes in the unit of a column, by the factor from the right numbers to those of the column.
_UNITS = {1.0: "", 1e-3: "kN taken as N", 1e3: "N taken as kN"}
_FACTORS = [sign * factor for sign in (1.0, -1.0) for factor in _UNITS]
# "" is the frame of the scene's own loads: for loads on a root the blade's frame, for loads on the
# shaft the base.
_FRAMES = ("", "coned", "rotor", "shaft", "base")


@dataclass(frozen=True)
class LoadComparison:
    """Hold the result of a comparison of loads.

    Attributes
    ----------
    expected : (n, channels) N or N m, loads of the closed form.
    errors : errors of each channel.
    message : what is wrong with the loads; "" if they are right.
    likely : likely causes of the differences, in words.
    """

    expected: Array
    errors: tuple[ChannelErrors, ...]
    message: str
    likely: tuple[str, ...]


@dataclass(frozen=True)
class Component:
    """Hold a component of loads that a column of the data may be.

    Attributes
    ----------
    factor : the column is this factor times `values`.
    values : (n,) N or N m, the component.
    shown : " is <name>" if it is another component than the column's name says, else "".
    is_shifted : whether the component is late or early by a row. Its first or last row is then
        unknown.
    """

    factor: float
    values: Array
    shown: str = ""
    is_shifted: bool = False


@dataclass(frozen=True)
class JudgedLoads:
    """Hold the loads in the rows that are judged, and the loads that common mistakes give.

    Attributes
    ----------
    scene, channels : the rotor, and the load channels of the data.
    known : channels of all load components of the scene, in the order of the columns of `by_frame`.
    by_frame : for each frame the loads of the closed form, (n, components) N or N m.
    mistaken : for each mistake, in words, the loads that a program with this mistake computes; by
        frame as in `by_frame`.
    hub_weight : for each frame the part of `by_frame` that is the hub's weight.
    time : (n,) s.
    states : (n, m) rad and rad/s, angles, then rates of the data, for the coordinates that move.
    is_inside : (n,) whether a row is neither the first nor the last one of the data.
    values, rounding, expected : (n, channels) N or N m: numbers of the data, the differences that
        rounding explains, and loads of the closed form.
    smallest_scale : (channels,) N or N m, the least size that errors are divided by.
    tolerance : largest allowed error, relative to the largest value of a component.
    """

    scene: Scene
    channels: tuple[Channel, ...]
    known: Sequence[Channel]
    by_frame: Mapping[str, Array]
    mistaken: Mapping[str, Mapping[str, Array]]
    is_inside: NDArray[np.bool_]
    hub_weight: Mapping[str, Array]
    time: Array
    states: Array
    values: Array
    rounding: Array
    expected: Array
    smallest_scale: Array
    tolerance: float

    @property
    def frames(self) -> tuple[str, ...]:
        """Return the frames that differ from one another in the scene."""
        return distinct_frames(self.scene)

    def scale(self, j: int, component: Array) -> float:
        """Return the divisor of the errors of channel j if the channel is `component`, (n,)."""
        largest = float(np.abs(component).max(initial=0.0))
        return max(largest, float(self.smallest_scale[j])) or 1.0

    def left(self, j: int, component: Component, *, may_vanish: bool = False) -> float:
        """Return the largest error of a channel, taken as `component`, minus the allowed error.

        The component explains the channel if the result is at most 0.

        Parameters
        ----------
        j : number of the channel.
        component : what the channel may be.
        may_vanish : whether a component near zero is tried, too. By default the result for such a
            component is infinite, because it fits all small numbers.
        """
        factor, values = component.factor, component.values
        rounding = FLOOR_SAFETY * self.rounding[:, j] / min(abs(factor), 1)
        error = np.abs(self.values[:, j] / factor - values)
        rows = self.is_inside if component.is_shifted else slice(None)
        left = float((error - rounding)[rows].max(initial=-np.inf))
        before = np.abs(self.values[:, j] - self.expected[:, j]).max(initial=0.0)
        share = min(self.tolerance, MAX_LEFT)
        allowed = min(share * self.scale(j, values), LEFT_SHARE * before)
        if not may_vanish and not float(np.abs(values).max()) > 100.0 * allowed:
            return np.inf
        return float(left - allowed)


def loads_by_frame(
    scene: Scene, time: Array, angles: Array, rates: Array, parts: LoadParts = WHOLE
) -> dict[str, Array]:
    """Return the loads of the closed form at given states, in every frame.

    Parameters
    ----------
    scene : the rotor.
    time : (n,) s.
    angles, rates : (n, 1 + blades) rad and rad/s, rotor first.
    parts : factors of the terms that the loads consist of, to leave some of them out.

    Returns
    -------
    dict of ndarray
        For each frame the loads, (n, components) N or N m in the order of `channels`. A load that
        cannot be given in this frame has the components of its own frame.
    """
    loads = sampled_loads(scene, time, angles, rates, parts)
    by_frame = {frame: dict(loads) for frame in _FRAMES}
    # The rotations follow one another. The pitch leads from the blade's frame to the coned frame,
    # the cone to the rotor's frame, the azimuth to the shaft's frame, and the tilt to the base.
    azimuths = angles[:, :1] + np.array(scene.phases)
    cones = np.array([blade.cone for blade in scene.blades])
    for name, values in loads.items():
        if name.startswith("shaft"):
            in_shaft = _turned(values, -scene.shaft_tilt, axis=0)
            by_frame["shaft"][name] = in_shaft
            by_frame["rotor"][name] = _turned(in_shaft, -angles[:, 0], axis=1)
        elif name.startswith("blade"):
            coned = _turned(values, angles[:, 1:], axis=2)
            in_rotor = _turned(coned, -cones, axis=0)
            in_shaft = _turned(in_rotor, azimuths, axis=1)
            by_frame["coned"][name] = coned
            by_frame["rotor"][name] = in_rotor
            by_frame["shaft"][name] = in_shaft
            by_frame["base"][name] = _turned(in_shaft, scene.shaft_tilt, axis=0)
    matrices = {}
    for frame, arrays in by_frame.items():
        columns = [arrays[load.name].reshape(len(time), -1) for load in LOADS]
        matrices[frame] = np.hstack(columns)
    return matrices


def distinct_frames(scene: Scene) -> tuple[str, ...]:
    """Return the frames that differ in a scene; "" is the frame of its own loads."""
    return tuple(frame for frame in _FRAMES if _plain_frame(scene, frame) == frame)


def shaft_direction(scene: Scene, frame: str) -> Array:
    """Return the unit vector along the shaft, (3,), in a frame of the shaft's loads."""
    tilt = 0.0 if frame in ("shaft", "rotor") else scene.shaft_tilt
    return np.array([0.0, math.cos(tilt), math.sin(tilt)])


def _plain_frame(scene: Scene, frame: str, of_shaft: bool = False) -> str:
    """Return the name under which a frame is used, if two frames of the scene are equal.

    Without cones the coned frame is used as the rotor's frame. Without tilt the shaft's frame is
    used as the base. Every other frame keeps its name.

    Parameters
    ----------
    scene : the rotor, with tilt and cones.
    frame : one of `_FRAMES`.
    of_shaft : whether the load is a load on the shaft. Its own frame, "", is then the base.
    """
    if frame == "coned" and not any(blade.cone for blade in scene.blades):
        return "rotor"
    if frame == "shaft" and not scene.shaft_tilt:
        return "" if of_shaft else "base"
    return frame


def _turned(vectors: Array, angle: Array | float, axis: int) -> Array:
    """Return (..., 3) vectors turned about x (axis 0), y (1) or z (2) by (...) rad."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    turned = vectors.copy()
    turned[..., first] = np.cos(angle) * vectors[..., first] - np.sin(angle) * vectors[..., second]
    turned[..., second] = np.sin(angle) * vectors[..., first] + np.cos(angle) * vectors[..., second]
    return turned


def compare_loads(
    scene: Scene, loads: ForeignData, defects: Defects, tolerance: float
) -> LoadComparison:
    """Compare loads of data with the loads of the closed form at the data's own states.

    The part of an error that the rounding of states and loads does not explain is divided by the
    largest value of its component. Rows at a jump of a prescribed load are left out, because a
    program may write the value before the jump or after it.

    Parameters
    ----------
    scene : the rotor.
    loads : channels of loads alone; their first row is that of `defects`.
    defects : interval defects of the motion of the data, with its states and their rounding.
    tolerance : largest allowed error, relative to a component's largest value.
    """
    expected, loads_in_rows = _loads_in_rows(scene, loads, defects, tolerance)
    errors, wrong, message = _load_errors(loads_in_rows)
    likely: tuple[str, ...] = ()
    if len(loads_in_rows.time) >= MIN_EXPLAINED:
        likely = _explained(loads_in_rows, wrong)
    return LoadComparison(expected, errors, message, likely)


def _loads_in_rows(
    scene: Scene, loads: ForeignData, defects: Defects, tolerance: float
) -> tuple[Array, JudgedLoads]:
    """Compute the closed form's loads at the data's states, and choose the rows that are judged.

    Parameters
    ----------
    scene, loads, defects, tolerance : see `compare_loads`.

    Returns
    -------
    expected : ndarray
        (rows, channels) N or N m, loads of the closed form in all rows.
    judged_loads : JudgedLoads
        The loads in the rows that are judged.
    """
    states, time, half = defects.states, defects.time, len(defects.moving)
    known = [channel for channel in channels(scene) if channel.is_load]
    places = [channel.column - known[0].column for channel in loads.channels]

    def loads_at(states: Array, parts: LoadParts = WHOLE, scene: Scene = scene) -> dict[str, Array]:
        angles, rates = all_coordinates(scene, states[:, :half], states[:, half:])
        return loads_by_frame(scene, time, angles, rates, parts)

    def columns_of(by_frame: Mapping[str, Array]) -> Array:
        columns = []
        for channel, place in zip(loads.channels, places, strict=True):
            columns.append(by_frame[channel.frame][:, place])
        return np.stack(columns, axis=1)

    by_frame = loads_at(states)
    expected = columns_of(by_frame)
    # The first components are the forces at the roots.
    forces = by_frame[""][:, : 3 * len(scene.blades)].reshape(len(time), -1, 3)
    largest_force = np.linalg.norm(forces, axis=2).max(axis=1)
    arms = np.ones(len(loads.channels))
    for j, channel in enumerate(loads.channels):
        if channel.kind == "moment":
            arms[j] = longest_arm(scene)
    rounding = loads.rounding[: len(time)] + _LOAD_ROUNDING * largest_force[:, None] * arms
    # The states are rounded, too. The rounding of each angle and rate causes an uncertainty of the
    # loads: it is multiplied by the derivative of the loads by this variable, which is computed as
    # a forward difference.
    for i in range(2 * half):
        step = _STATE_STEP * np.maximum(np.abs(states[:, i]), 1.0)
        moved = states.copy()
        moved[:, i] += step
        change = np.abs(columns_of(loads_at(moved)) - expected)
        rounding += change * (defects.rounding[:, i] / step)[:, None]

    hub_weight = {frame: np.zeros_like(matrix) for frame, matrix in by_frame.items()}
    if scene.hub_mass:
        without = loads_at(states, scene=replace(scene, hub_mass=0.0))
        for frame, matrix in without.items():
            hub_weight[frame] = by_frame[frame] - matrix
    judged = np.isfinite(expected).all(axis=1) & ~is_at_jump(scene, time)
    mistaken = {text: loads_at(states, parts) for text, parts in _FORGOTTEN.items()}
    for text, late in (("a row late", 1), ("a row early", -1)):
        mistaken[text] = {
            frame: np.roll(matrix, late, axis=0) for frame, matrix in by_frame.items()
        }
    period = held_rows(loads.values[: len(time)])
    if period > 1:
        held = np.arange(len(time)) // period * period
        mistaken[f"every row is held for {period} rows"] = {
            frame: matrix[held] for frame, matrix in by_frame.items()
        }
    # If loads are a row late or early, the loads of the first or last row are unknown.
    is_inside = judged & (np.arange(len(time)) > 0) & (np.arange(len(time)) < len(time) - 1)
    judged_loads = JudgedLoads(
        scene=scene,
        channels=loads.channels,
        known=known,
        by_frame={frame: matrix[judged] for frame, matrix in by_frame.items()},
        mistaken={
            text: {frame: matrix[judged] for frame, matrix in matrices.items()}
            for text, matrices in mistaken.items()
        },
        is_inside=is_inside[judged],
        hub_weight={frame: matrix[judged] for frame, matrix in hub_weight.items()},
        time=time[judged],
        states=states[judged],
        values=loads.values[: len(time)][judged],
        rounding=rounding[judged],
        expected=expected[judged],
        smallest_scale=_SMALL * arms * float(largest_force.max(initial=0.0)),
        tolerance=tolerance,
    )
    return expected, judged_loads


def is_at_jump(scene: Scene, time: Array) -> NDArray[np.bool_]:
    """Return whether a prescribed load of a scene jumps at each of (n,) times in s."""
    at_jump = np.zeros(len(time), bool)
    for table in scene.load_tables:
        for (before, _), (after, _) in itertools.pairwise(table):
            if before == after:
                step = float(np.median(np.diff(time)))
                at_jump |= np.abs(time - before) <= ALIGNMENT * step
    return at_jump


def _load_errors(loads: JudgedLoads) -> tuple[tuple[ChannelErrors, ...], list[int], str]:
    """Compute the errors of all load channels, and find the channels that are wrong.

    Parameters
    ----------
    loads : the rows that are judged.

    Returns
    -------
    errors : tuple of ChannelErrors
        One for each channel.
    wrong : list of int
        Numbers of the channels that are wrong.
    message : str
        What is wrong with the worst channel, or that there is no row to judge; "" if all channels
        are right.
    """
    errors, wrong = [], []
    message, largest = "", 0.0
    if not len(loads.time):
        message = "no row in which the loads are known"
    for j, channel in enumerate(loads.channels):
        size = loads.scale(j, loads.expected[:, j])
        error = np.abs(loads.values[:, j] - loads.expected[:, j])
        rounding = loads.rounding[:, j]
        excess = np.maximum(error - FLOOR_SAFETY * rounding, 0.0) / size
        worst, error_max = float(excess.max(initial=0.0)), float(error.max(initial=0.0))
        errors.append(
            ChannelErrors(
                name=channel.name,
                unit=channel.unit,
                error_max=error_max,
                error_whole=error_max,
                defect=worst,
                floor=float((rounding / size).max(initial=0.0)),
                agrees_until=agrees_until(loads.time, error / size),
                defect_unit="of the largest",
            )
        )
        # The comparisons are written with `not`, so that a NaN counts as wrong.
        if not worst <= loads.tolerance:
            wrong.append(j)
        if not worst <= max(loads.tolerance, largest):
            largest = worst
            at = f"at t = {loads.time[int(excess.argmax())]:.6g} s"
            beyond = f"difference of {worst:.1e} of its largest magnitude beyond rounding"
            message = f"{channel.name}: {beyond}, {at}, allowed {loads.tolerance:.0e}"
    return tuple(errors), wrong, message


# Causes of wrong loads


def _explained(loads: JudgedLoads, wrong: Sequence[int]) -> tuple[str, ...]:
    """Search for the causes of wrong loads.

    Parameters
    ----------
    loads : the rows that are judged.
    wrong : numbers of the channels that are wrong.

    Returns
    -------
    tuple of str
        If another scene explains all wrong channels, this scene is the only cause. Otherwise
        several causes, each with the names of the channels that it explains. Empty if nothing fits.
    """
    wrong = list(wrong)
    of_scene = _other_scene(loads, wrong)
    if of_scene:
        return (of_scene,)
    of_hub = _other_hub_mass(loads, wrong)
    for j in of_hub:
        wrong.remove(j)
    by_channel: dict[int, list[Explanation[Component]]] = {}
    # Numbers of the channels of moments that no component explains, by load and frame.
    unexplained: dict[tuple[str, str], list[int]] = {}
    for j in wrong:
        candidates = _component_hypotheses(loads, j)
        explained = cheapest(
            explanations(candidates, functools.partial(loads.left, j), allowed=0.0)
        )
        by_channel[j] = explained
        channel = loads.channels[j]
        if not explained and channel.kind == "moment" and "actuator" not in channel.name:
            unexplained.setdefault((_load(channel), channel.frame), []).append(j)

    named = _shared_texts(loads, by_channel)
    # Moments that no component explains may be taken about another point. All components of a load
    # must have the same point.
    for (load, frame), group in unexplained.items():
        text = _other_point(loads, load, frame, group)
        if text:
            named.setdefault(text, []).extend(loads.channels[j].name for j in group)
    exchanged = named.pop("", [])  # channels that are another component, with no other mistake
    for j, text in of_hub.items():
        named.setdefault(text, []).append(loads.channels[j].name)
    likely = []
    for text, names in named.items():
        likely.append(f"{', '.join(_shared_names(loads, names))}: {text}")
    if exchanged:
        likely.append(f"columns exchanged: {', '.join(_shared_exchanges(loads, exchanged))}")
    return tuple(likely)


def _other_scene(loads: JudgedLoads, wrong: Sequence[int]) -> str:
    """Search for another scene whose loads at the data's states explain all wrong channels.

    Other scenes are tried before mistakes in single components: if the tilt is forgotten, for
    example, a component may by chance equal one in another frame.

    Parameters
    ----------
    loads : the rows that are judged.
    wrong : numbers of the channels that are wrong.

    Returns
    -------
    str
        The cause, in words; "" if no scene explains all wrong channels.
    """
    if not wrong:
        return ""
    some = slice(None, None, 1 + len(loads.time) // _FEW_ROWS)
    screened = replace(
        loads,
        time=loads.time[some],
        states=loads.states[some],
        values=loads.values[some],
        rounding=loads.rounding[some],
        expected=loads.expected[some],
        is_inside=loads.is_inside[some],
    )
    for text, other in other_scenes(loads.scene):
        has_same_states = other.moving_coordinates == loads.scene.moving_coordinates
        if other == loads.scene or not has_same_states:
            continue
        if _is_explained_by(screened, other, wrong) and _is_explained_by(loads, other, wrong):
            return text
    return ""


def _is_explained_by(loads: JudgedLoads, other: Scene, wrong: Sequence[int]) -> bool:
    """Return whether the data have the loads of another scene at their states.

    Parameters
    ----------
    loads : the rows that are judged.
    other : the other scene, in which the same coordinates move.
    wrong : numbers of the wrong channels. The other scene must explain these channels, and the
        right channels must be right with it, too.
    """
    right = _loads_of(loads, other)
    for j in range(len(loads.channels)):
        if j in wrong:
            if not loads.left(j, Component(1.0, right[:, j]), may_vanish=True) <= 0.0:
                return False
            continue
        error = np.abs(loads.values[:, j] - right[:, j]) - FLOOR_SAFETY * loads.rounding[:, j]
        if not error.max() <= loads.tolerance * loads.scale(j, right[:, j]):
            return False
    return True


def _loads_of(loads: JudgedLoads, other: Scene) -> Array:
    """Return the loads of another scene at the data's states, (n, channels) N or N m."""
    angles, rates = np.split(loads.states, 2, axis=1)
    by_frame = loads_by_frame(other, loads.time, *all_coordinates(other, angles, rates))
    columns = []
    for channel in loads.channels:
        columns.append(by_frame[channel.frame][:, channel.column - loads.known[0].column])
    return np.stack(columns, axis=1)


def _other_hub_mass(loads: JudgedLoads, wrong: Sequence[int]) -> dict[int, str]:
    """Fit the mass of the hub to wrong forces on the shaft, the only loads with the hub's weight.

    Parameters
    ----------
    loads : the rows that are judged.
    wrong : numbers of the channels that are wrong.

    Returns
    -------
    dict
        For the number of each wrong channel of the shaft's force, the cause in words. Empty if no
        mass explains all of these channels, or if the fitted mass is about zero or negative.
    """
    scene = loads.scene
    forces = [j for j in wrong if _load(loads.channels[j]) == "shaft force"]
    if not forces or not scene.gravity:
        return {}
    heavier = _loads_of(loads, replace(scene, hub_mass=scene.hub_mass + 1.0))
    per_kg = (heavier - _loads_of(loads, scene))[:, forces]
    difference = (loads.values - loads.expected)[:, forces]
    change = float((per_kg * difference).sum() / ((per_kg**2).sum() or 1.0))
    mass = scene.hub_mass + change
    # A fitted mass of about zero is not named here: `_component_hypotheses` has the text "without
    # the hub's weight" for it.
    if mass <= MAX_LEFT * abs(change):
        return {}
    right = _loads_of(loads, replace(scene, hub_mass=mass))
    if any(loads.left(j, Component(1.0, right[:, j]), may_vanish=True) > 0.0 for j in forces):
        return {}
    text = f"hub.mass {mass:.6g} kg in place of {scene.hub_mass:g} kg"
    return dict.fromkeys(forces, text)


def _component_hypotheses(loads: JudgedLoads, j: int) -> Iterator[Hypothesis[Component]]:
    """Yield the components that a channel may be.

    The channel may have another unit, sign, axis or frame, or be another load. The hub's weight,
    other weights or inertia forces may be missing, or the torque on the rotor may be included. The
    channel may be late or early by a row, or hold its numbers over several rows.

    Parameters
    ----------
    loads : the rows that are judged.
    j : number of the channel.
    """
    channel = loads.channels[j]
    name = channel.name.partition(",")[0]
    torque = values_before(loads.scene.load_segments, loads.time)[ROTOR_TORQUE]
    own_frame = _plain_frame(loads.scene, channel.frame, name.startswith("shaft"))
    for frame in loads.frames:
        matrix = loads.by_frame[frame]
        for i, other in enumerate(loads.known):
            if other.kind != channel.kind:
                continue
            shown = f" is {other.name}" if other.name != name else ""
            exchanges = int(_load(other) != _load(channel)) + int(other.name != name)
            for factor in _FACTORS:
                mistakes = _mistakes(factor)
                if frame != own_frame:
                    mistakes.insert(0, f"in the {_frame_name(other, frame)} frame")
                price = exchanges + len(mistakes)
                component = Component(factor, matrix[:, i], shown)
                yield Hypothesis(", ".join(mistakes), component, price)
                if np.any(loads.hub_weight[frame][:, i]):
                    text = ", ".join(["without the hub's weight", *mistakes])
                    component = Component(
                        factor, matrix[:, i] - loads.hub_weight[frame][:, i], shown
                    )
                    yield Hypothesis(text, component, price + 1)
                share = 0.0
                if _load(other) == "shaft moment":
                    share = float(shaft_direction(loads.scene, frame)["xyz".index(other.name[-1])])
                if share:
                    text = ", ".join(["with the torque on the rotor in it", *mistakes])
                    component = Component(factor, matrix[:, i] + share * torque, shown)
                    yield Hypothesis(text, component, price + 1)
    own = channel.column - loads.known[0].column
    for wrong, by_frame in loads.mistaken.items():
        for factor in _FACTORS:
            mistakes = [wrong, *_mistakes(factor)]
            component = Component(
                factor, by_frame[channel.frame][:, own], is_shifted=wrong.startswith("a row")
            )
            yield Hypothesis(", ".join(mistakes), component, len(mistakes))


def _shared_texts(
    loads: JudgedLoads, by_channel: Mapping[int, Sequence[Explanation[Component]]]
) -> dict[str, list[str]]:
    """Choose one explanation for each channel: the one that most channels have in common.

    Parameters
    ----------
    loads : the rows that are judged.
    by_channel : explanations of each channel, by its number.

    Returns
    -------
    dict
        For the text of each explanation the names of its channels. A name is followed by
        " is <name>" if the channel is another component.
    """
    shown_by_text: dict[int, dict[str, str]] = {}
    for j, explained in by_channel.items():
        # If several components have one text, the first of them is shown.
        shown_by_text[j] = {e.text: e.hypothesis.change.shown for e in reversed(explained)}
    count = Counter(text for texts in shown_by_text.values() for text in texts)
    named: dict[str, list[str]] = {}
    for j, texts in shown_by_text.items():
        if texts:
            text = max(reversed(texts), key=lambda text: count[text])
            named.setdefault(text, []).append(f"{loads.channels[j].name}{texts[text]}")
    return named


def _shared_names(loads: JudgedLoads, names: Sequence[str]) -> list[str]:
    """Return names of channels, with the components of a load at all blades under one name.

    The name of a load, without the number of a blade, replaces the names of its components if the
    components at all blades are among `names`.

    Parameters
    ----------
    loads : the rows that are judged.
    names : names of channels.
    """
    by_load: dict[str, list[str]] = {}
    for channel in loads.channels:
        by_load.setdefault(_load(channel).rstrip("0123456789 "), []).append(channel.name)
    shown = list(names)
    for load, components in by_load.items():
        if len(components) > 1 and set(components) <= set(shown):
            place = shown.index(components[0])
            shown = [name for name in shown if name not in components]
            shown.insert(place, load)
    return shown


def _shared_exchanges(loads: JudgedLoads, exchanged: Sequence[str]) -> list[str]:
    """Return texts on exchanged columns; a text on a load replaces those on all its components.

    Parameters
    ----------
    loads : the rows that are judged.
    exchanged : texts such as "blade root force 2 x is blade root force 1 x".
    """
    by_load: dict[str, list[Channel]] = {}
    for channel in loads.channels:
        by_load.setdefault(_load(channel), []).append(channel)
    shown = list(exchanged)
    for load, components in by_load.items():
        for other in by_load:
            texts = []
            for channel in components:
                axis = channel.name.removeprefix(load)
                texts.append(f"{channel.name} is {other}{axis}")
            if len(texts) > 1 and set(texts) <= set(shown):
                place = shown.index(texts[0])
                shown = [text for text in shown if text not in texts]
                shown.insert(place, f"{load} is {other}")
    return shown


def _other_point(loads: JudgedLoads, load: str, frame: str, group: Sequence[int]) -> str:
    """Search for another point about which the moments of one load may be taken.

    With the moment M about the origin and the force F of a load, the moment about a point p is
    M - p × F = M + F × p.

    Parameters
    ----------
    loads : the rows that are judged.
    load : name of the moment, such as "blade root moment 1".
    frame : frame of the moment's components in the data, "" for the scene's own frame.
    group : numbers of the channels of this moment that are to be explained.

    Returns
    -------
    str
        The point, in words; "" if no point explains all of the channels.
    """
    force = _columns(loads, frame, load.replace("moment", "force"))
    axes = []
    for j in group:
        component = loads.channels[j].name.partition(",")[0]
        axes.append("xyz".index(component[-1]))
    moment = _columns(loads, frame, load)[:, axes]
    # F × p is `matrix`, (n, axes, 3), times p. Its columns are the products of F with unit vectors.
    products = np.cross(force[:, None, :], np.eye(3)[None])
    matrix = products.transpose(0, 2, 1)[:, axes]

    points: list[Hypothesis[tuple[float, Array]]] = []
    is_root = load.startswith("blade root")
    origin = "the root" if is_root else "the hub centre"

    def add(name: str, point: Array, factor: float) -> None:
        text = ", ".join([f"about {name} in place of {origin}", *_mistakes(factor)])
        points.append(Hypothesis(text, (factor, point)))

    root = np.array([0.0, 0.0, loads.scene.hub_radius])
    if is_root and loads.scene.hub_radius and frame in ("", "coned"):
        for factor in _FACTORS:
            add("the apex", -root, factor)
    if is_root and not frame:
        blade = loads.scene.blades[int(load.split()[-1]) - 1]
        for name, place in (("the centre of mass", blade.centre_of_mass), ("the tip", blade.tip)):
            for factor in _FACTORS:
                add(name, np.array(place) - root, factor)
    # Any other point is fitted to the wrong components by linear least squares, because M + F × p
    # is linear in p. If F keeps its direction, the coordinate of p along F is undetermined: with
    # rcond it becomes zero.
    frame_name = _frame_name(loads.channels[group[0]], frame)
    for factor in _FACTORS:
        difference = (loads.values[:, group] / factor - moment).ravel()
        solution = np.linalg.lstsq(matrix.reshape(-1, 3), difference, rcond=1e-9)[0]
        point = np.asarray(solution, float)
        # A coordinate that is zero but for rounding is shown as 0.
        point[np.abs(point) < 1e-9 * np.abs(point).max()] = 0.0
        shown = ", ".join(f"{x:.6g}" for x in point)
        radius = loads.scene.hub_radius + float(point[2])
        is_on_axis = float(np.abs(point[:2]).max()) <= MAX_LEFT * abs(float(point[2]))
        if is_root and frame in ("", "coned") and is_on_axis and radius > 0.0:
            text = f"hub.radius {radius:.6g} m in place of {loads.scene.hub_radius:g} m"
            text = ", ".join([text, *_mistakes(factor)])
            points.append(Hypothesis(text, (factor, point)))
            continue
        add(f"the point ({shown}) m of the {frame_name} frame", point, factor)

    def left_about(change: tuple[float, Array]) -> float:
        factor, point = change
        moved = moment + matrix @ point
        by_channel = []
        for k, j in enumerate(group):
            component = Component(factor, moved[:, k])
            by_channel.append(loads.left(j, component, may_vanish=True))
        return float(np.max(by_channel))

    first = next(explanations(points, left_about, allowed=0.0), None)
    return first.text if first else ""


def _columns(loads: JudgedLoads, frame: str, name: str) -> Array:
    """Return the three components of a load, (n, 3), in a frame."""
    places = [i for i, channel in enumerate(loads.known) if _load(channel) == name]
    return loads.by_frame[frame][:, places]


def _load(channel: Channel) -> str:
    """Return a channel's name without its axis and frame: "blade root moment 1"."""
    return channel.name.partition(",")[0].rstrip("xyz ")


def _mistakes(factor: float) -> list[str]:
    """Return in words the mistakes in a column that is `factor` times the right one."""
    mistakes = ["sign reversed (action in place of reaction)"] if factor < 0.0 else []
    unit = _UNITS[abs(factor)]
    return [*mistakes, unit] if unit else mistakes


def _frame_name(channel: Channel, frame: str) -> str:
    """Return the name of a frame in words; "" is the channel's own frame."""
    if frame:
        return frame
    return "blade's own" if channel.name.startswith("blade root") else "base"
