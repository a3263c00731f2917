"""Loads of another program against those of the closed form at the data's own states, row by row, so that neither an
error of the motion nor its growth is in the difference; and what a difference looks like."""

from __future__ import annotations

import itertools
from collections import Counter
from dataclasses import dataclass

import numpy as np

from rotor_mbs.analysis.data_verdict import ChannelErrors, agrees_until
from rotor_mbs.foreign.channels import Channel, ForeignData, channels
from rotor_mbs.models.lagrange.parameters import load_segments, load_tables
from rotor_mbs.models.lagrange.samples import sampled_loads
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import ALIGNMENT, values_before
from rotor_mbs.solution.defects import FLOOR_SAFETY, Defects
from rotor_mbs.solution.quantities import LOADS, longest_arm
from rotor_mbs.solution.trajectory import Array, all_coordinates

_SMALL = 1e-3  # of the largest force at a root: components that stay below are judged by this, not by their own largest
_ROUNDING = 16.0 * 2.0**-53  # of that force: of the sums that a load is
_STEP = 1e-7  # of a state, for the derivative of the loads
_FEWEST = 5  # rows: with fewer, something always fits
_MOST_LEFT = 1e-4  # of the largest, by a mistake that is named,
_LEFT = 1e-2  # and of the difference: another program's own error is no mistake
_UNITS = {1.0: "", 1e-3: "kN taken as N", 1e3: "N taken as kN"}
_FACTORS = [sign * factor for sign in (1.0, -1.0) for factor in _UNITS]
_FRAMES = (
    "",
    "rotor",
    "base",
)  # "" is the one that the scene's loads have: of a root the blade's, of the shaft the base


@dataclass(frozen=True)
class LoadComparison:
    """expected : (n, channels) N or N m. message : why the loads are not right, "" where they are. likely : causes."""

    expected: Array
    errors: tuple[ChannelErrors, ...]
    message: str
    likely: tuple[str, ...]


def all_loads(scene: Scene, time: Array, angles: Array, rates: Array) -> dict[str, Array]:
    """By frame the (n, components) loads of the closed form at (n, 1 + blades) rad and rad/s, in the order of
    `channels`; what has no components in a frame is as it is."""
    loads, in_rotor, in_base = sampled_loads(scene, time, angles, rates), dict[str, Array](), dict[str, Array]()
    for name, values in loads.items():
        in_rotor[name] = in_base[name] = values
        if name.startswith("shaft"):
            in_rotor[name] = _turned(values, -angles[:, 0], axis=1)
        elif name.startswith("blade"):
            in_rotor[name] = _turned(values, angles[:, 1:], axis=2)
            in_base[name] = _turned(in_rotor[name], angles[:, :1] + np.array(scene.phases), axis=1)
    return {
        frame: np.hstack([arrays[load.name].reshape(len(time), -1) for load in LOADS])
        for frame, arrays in zip(_FRAMES, (loads, in_rotor, in_base), strict=True)
    }


def _turned(vectors: Array, angle: Array, axis: int) -> Array:
    """(..., 3) turned about y (1) or z (2) by (...) rad."""
    first, second = vectors[..., (axis + 1) % 3], vectors[..., (axis + 2) % 3]
    turned = vectors.copy()
    turned[..., (axis + 1) % 3] = np.cos(angle) * first - np.sin(angle) * second
    turned[..., (axis + 2) % 3] = np.sin(angle) * first + np.cos(angle) * second
    return turned


def compare_loads(scene: Scene, loads: ForeignData, defects: Defects, tolerance: float) -> LoadComparison:
    """The verdict on each component, relative to its largest, beyond what the rounding of states and loads explains.

    Rows at a jump of a torque are left out: a load has its value before the jump, or after it.
    """
    states, time, half = defects.states, defects.time, len(defects.moving)
    known = [channel for channel in channels(scene) if channel.is_load]
    places = [channel.column - known[0].column for channel in loads.channels]

    def loads_at(states: Array) -> dict[str, Array]:
        return all_loads(scene, time, *all_coordinates(scene, states[:, :half], states[:, half:]))

    def chosen(matrices: dict[str, Array]) -> Array:
        columns = zip(places, loads.channels, strict=True)
        return np.stack([matrices[channel.frame][:, place] for place, channel in columns], axis=1)

    matrices = loads_at(states)
    expected, values = chosen(matrices), loads.values[: len(time)]
    forces = matrices[""][:, : 3 * len(scene.blades)].reshape(len(time), -1, 3)
    largest_force = np.linalg.norm(forces, axis=2).max(axis=1)
    arms = np.array([1.0 if channel.kind == "force" else longest_arm(scene) for channel in loads.channels])
    rounding = loads.rounding[: len(time)] + _ROUNDING * largest_force[:, None] * arms
    for i in range(2 * half):
        step = _STEP * np.maximum(np.abs(states[:, i]), 1.0)
        moved = states.copy()
        moved[:, i] += step
        rounding += np.abs(chosen(loads_at(moved)) - expected) * (defects.rounding[:, i] / step)[:, None]
    judged = np.isfinite(expected).all(axis=1)
    for table in load_tables(scene):
        for (t0, _), (t1, _) in itertools.pairwise(table):
            judged &= (t0 != t1) | (np.abs(time - t0) > ALIGNMENT * float(np.median(np.diff(time))))
    time, values, rounding = time[judged], values[judged], rounding[judged]
    matrices = {frame: matrix[judged] for frame, matrix in matrices.items()}
    least = _SMALL * arms * float(largest_force.max(initial=0.0))
    own = expected[judged]
    least = _SMALL * arms * float(largest_force.max(initial=0.0))  # (channels,) the smallest scale of an error
    before = np.abs(values - own).max(axis=0, initial=0.0)

    def scale(j: int, component: Array) -> float:
        return float(max(np.abs(component).max(initial=0.0), least[j])) or 1.0

    def fits(j: int, factor: float, candidate: Array, *, may_vanish: bool = False) -> bool:
        """Whether a component is `factor` times another one, which is not next to nothing unless it may be."""
        left = np.abs(values[:, j] / factor - candidate) - FLOOR_SAFETY * rounding[:, j] / min(abs(factor), 1)
        allowed = min(min(tolerance, _MOST_LEFT) * scale(j, candidate), _LEFT * before[j])
        return float(left.max()) <= allowed and (may_vanish or float(np.abs(candidate).max()) > 100.0 * allowed)

    errors, wrong = [], []
    message, largest = "" if judged.any() else "no row in which the loads are known", 0.0
    for j, channel in enumerate(loads.channels):
        size, error = scale(j, own[:, j]), np.abs(values[:, j] - own[:, j])
        excess = np.maximum(error - FLOOR_SAFETY * rounding[:, j], 0.0) / size
        worst, floor, most = (float(x.max(initial=0.0)) for x in (excess, rounding[:, j] / size, error))
        until = agrees_until(time, error / size)
        unit = "of the largest"
        errors.append(ChannelErrors(channel.name, channel.unit, most, most, worst, floor, until, unit))
        if not worst <= tolerance:
            wrong.append(j)
        if not worst <= max(tolerance, largest):
            largest, at = worst, f"at t = {time[int(excess.argmax())]:.6g} s, allowed {tolerance:.0e}"
            message = f"{channel.name}: difference of {worst:.1e} of its largest magnitude beyond rounding, {at}"
    if len(time) < _FEWEST:
        return LoadComparison(expected, tuple(errors), message, ())

    # For each wrong component the simplest of: unit, sign, axis, frame, another load, the torque on the rotor in it.
    torque = values_before(load_segments(scene), time)[0]
    simplest: dict[int, dict[str, str]] = {}  # by component, then by what is wrong: which column it is
    groups: dict[tuple[str, str], list[int]] = {}  # what is left, of one load
    for j in wrong:
        channel, name = loads.channels[j], loads.channels[j].name.partition(",")[0]
        found: list[tuple[int, str, str]] = []  # mistakes that it takes, what is wrong, which column it is
        for (frame, matrix), (i, other), factor in itertools.product(matrices.items(), enumerate(known), _FACTORS):
            if other.kind != channel.kind:
                continue
            parts = [f"in the {_frame_name(other, frame)} frame" if frame != channel.frame else "", *_mistakes(factor)]
            parts = [part for part in parts if part]
            cost = (_load(other) != _load(channel)) + (other.name != name) + len(parts)
            shown = f" is {other.name}" if other.name != name else ""
            if fits(j, factor, matrix[:, i]):
                found.append((cost, ", ".join(parts), shown))
            if other.name == "shaft moment y" and fits(j, factor, matrix[:, i] + torque):
                found.append((cost + 1, ", ".join(["with the torque on the rotor in it", *parts]), shown))
        fewest = min(found)[0] if found else 0
        simplest[j] = {text: shown for cost, text, shown in found[::-1] if cost == fewest}
        if not found and channel.kind == "moment" and "actuator" not in channel.name:
            groups.setdefault((_load(channel), channel.frame), []).append(j)
    # Of texts that are alike for a component the one that most components have.
    common = Counter(text for texts in simplest.values() for text in texts)
    named: dict[str, list[str]] = {}
    for j, texts in simplest.items():
        if texts:
            text = max(reversed(texts), key=lambda text: common[text])
            named.setdefault(text, []).append(f"{loads.channels[j].name}{texts[text]}")
    # Moments about another point: M - p × F = M + F × p, by least squares over the wrong components.
    for (load, frame), group in groups.items():
        moment, force = (
            matrices[frame][:, [i for i, channel in enumerate(known) if _load(channel) == name]]
            for name in (load, load.replace("moment", "force"))
        )
        axes = ["xyz".index(loads.channels[j].name.partition(",")[0][-1]) for j in group]
        moment = moment[:, axes]
        matrix = np.cross(force[:, None, :], np.eye(3)[None]).transpose(0, 2, 1)[:, axes]  # (n, axes, 3): F × p
        is_root = load.startswith("blade root")
        points: list[tuple[str, Array, float]] = []
        if is_root and not frame:
            blade = scene.blades[int(load.split()[-1]) - 1]
            for name, place in (("the centre of mass", blade.centre_of_mass), ("the tip", blade.tip)):
                points += [(name, np.array(place), factor) for factor in _FACTORS]
        for factor in _FACTORS:
            difference = (values[:, group] / factor - moment).ravel()
            point = np.asarray(np.linalg.lstsq(matrix.reshape(-1, 3), difference, rcond=1e-9)[0], float)
            point[np.abs(point) < 1e-9 * np.abs(point).max()] = 0.0
            shown = ", ".join(f"{x:.6g}" for x in point)
            name = f"the point ({shown}) m of the {_frame_name(loads.channels[group[0]], frame)} frame"
            points.append((name, point, factor))
        for name, point, factor in points:
            candidates = moment + matrix @ point
            if all(fits(j, factor, candidates[:, k], may_vanish=True) for k, j in enumerate(group)):
                origin = "the root" if is_root else "the hub centre"
                text = ", ".join(filter(None, (f"about {name} in place of {origin}", *_mistakes(factor))))
                named.setdefault(text, []).extend(loads.channels[j].name for j in group)
                break
    exchanged = named.pop("", [])
    likely = [f"{', '.join(names)}: {text}" for text, names in named.items()]
    if exchanged:
        likely.append(f"columns exchanged: {', '.join(exchanged)}")
    return LoadComparison(expected, tuple(errors), message, tuple(likely))


def _load(channel: Channel) -> str:
    """Without its axis and frame: "blade root moment 1"."""
    return channel.name.partition(",")[0].rstrip("xyz ")


def _mistakes(factor: float) -> tuple[str, str]:
    return "sign reversed (action in place of reaction)" if factor < 0.0 else "", _UNITS[abs(factor)]


def _frame_name(channel: Channel, frame: str) -> str:
    return frame or ("blade's own" if channel.name.startswith("blade root") else "base")
