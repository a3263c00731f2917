"""Loads of another program against those of the closed form at the data's own states, row by row, so that neither an
error of the motion nor its growth is in the difference; and what a difference looks like."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rotor_mbs.analysis.data_verdict import ChannelErrors, agrees_until
from rotor_mbs.foreign.channels import Channel, ForeignData
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
_MOST_LEFT = 1e-4  # of the largest, by a mistake that is named
_UNITS = {1.0: "", 1e-3: "kN taken as N", 1e3: "N taken as kN"}
_FACTORS = [sign * factor for sign in (1.0, -1.0) for factor in _UNITS]

# By the name of a load without its axis ("blade root force 1"), then by frame: (n, axes).
Vectors = dict[str, dict[str, Array]]


@dataclass(frozen=True)
class LoadComparison:
    """expected : (n, channels) N or N m. message : why the loads are not right, "" where they are. likely : causes."""

    expected: Array
    errors: tuple[ChannelErrors, ...]
    message: str
    likely: tuple[str, ...]


def load_vectors(scene: Scene, time: Array, angles: Array, rates: Array) -> Vectors:
    """The closed form's loads at (n, 1 + blades) rad and rad/s, in all frames that data may have them in."""
    loads, vectors = sampled_loads(scene, time, angles, rates), Vectors()
    for load in LOADS:
        name, values = load.name.replace("_", " "), loads[load.name]
        if "axis" not in load.dimensions:
            vectors |= {f"{name} {i + 1}": {"": values[:, i, None]} for i in range(values.shape[1])}
        elif "blade" not in load.dimensions:
            vectors[name] = {"": values, "rotor": _turned(values, -angles[:, 0], axis=1)}
        else:
            for i, phase in enumerate(scene.phases):
                in_rotor = _turned(values[:, i], angles[:, 1 + i], axis=2)
                in_base = _turned(in_rotor, angles[:, 0] + phase, axis=1)
                vectors[f"{name} {i + 1}"] = {"": values[:, i], "rotor": in_rotor, "base": in_base}
    return vectors


def _turned(vectors: Array, angle: Array, axis: int) -> Array:
    """(n, 3) turned about y (1) or z (2) by (n,) rad."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    turned = vectors.copy()
    turned[:, first] = np.cos(angle) * vectors[:, first] - np.sin(angle) * vectors[:, second]
    turned[:, second] = np.sin(angle) * vectors[:, first] + np.cos(angle) * vectors[:, second]
    return turned


def component(vectors: Vectors, channel: Channel) -> Array:
    """(n,) what the closed form has of a channel."""
    name, axis = _load_and_axis(channel)
    return vectors[name][channel.frame][:, axis]


def _load_and_axis(channel: Channel) -> tuple[str, int]:
    name = channel.name.partition(",")[0]
    return (name[:-2], "xyz".index(name[-1])) if name[-1] in "xyz" else (name, 0)


def compare_loads(scene: Scene, loads: ForeignData, defects: Defects, tolerance: float) -> LoadComparison:
    """The verdict on each component, relative to its largest, beyond what the rounding of states and loads explains.

    Rows at a jump of a torque are left out: a load has its value before the jump, or after it.
    """
    count = len(defects.moving)
    states, time = defects.states, defects.time

    def vectors_at(states: Array) -> Vectors:
        return load_vectors(scene, time, *all_coordinates(scene, states[:, :count], states[:, count:]))

    vectors = vectors_at(states)
    expected = np.stack([component(vectors, channel) for channel in loads.channels], axis=1)
    values, own_rounding = loads.values[: len(time)], loads.rounding[: len(time)]
    largest_force = np.max(
        [np.linalg.norm(frames[""], axis=1) for name, frames in vectors.items() if name.startswith("blade root force")],
        axis=0,
    )
    arms = np.array([1.0 if channel.kind == "force" else longest_arm(scene) for channel in loads.channels])
    rounding = own_rounding + _ROUNDING * largest_force[:, None] * arms
    for i in range(2 * count):
        step = _STEP * np.maximum(np.abs(states[:, i]), 1.0)
        moved = states.copy()
        moved[:, i] += step
        there = vectors_at(moved)
        for j, channel in enumerate(loads.channels):
            slope = np.abs(component(there, channel) - expected[:, j]) / step
            rounding[:, j] += slope * defects.rounding[:, i]
    judged = np.isfinite(expected).all(axis=1)
    for table in load_tables(scene):
        for (t0, _), (t1, _) in itertools.pairwise(table):
            judged &= (t0 != t1) | (np.abs(time - t0) > ALIGNMENT * float(np.median(np.diff(time))))
    time, values, rounding = time[judged], values[judged], rounding[judged]
    vectors = {name: {frame: v[judged] for frame, v in frames.items()} for name, frames in vectors.items()}
    least = _SMALL * arms * float(largest_force.max(initial=0.0))
    search = _LoadCauses(scene, vectors, time, values, rounding, least, tolerance)
    errors, messages, wrong = [], [], []
    for j, channel in enumerate(loads.channels):
        own = component(vectors, channel)
        scale, error = search.scale(j, own), np.abs(values[:, j] - own)
        excess = np.maximum(error - FLOOR_SAFETY * rounding[:, j], 0.0) / scale
        worst, floor = float(excess.max(initial=0.0)), float(rounding[:, j].max(initial=0.0)) / scale
        largest = float(error.max(initial=0.0))
        until = agrees_until(time, error / scale)
        errors.append(
            ChannelErrors(
                channel.name, channel.unit, largest, largest, worst, floor, until, defect_unit="of the largest"
            )
        )
        if not worst <= tolerance:
            wrong.append(j)
            at = time[int(excess.argmax())]
            messages.append(
                (worst, f"{channel.name}: off by {worst:.1e} of its largest beyond rounding, at t = {at:.6g} s")
            )
    message = f"{max(messages)[1]}, allowed {tolerance:.0e}" if messages else ""
    likely = search.causes(loads.channels, wrong) if wrong and len(time) >= _FEWEST else []
    return LoadComparison(expected, tuple(errors), message, tuple(likely))


@dataclass(frozen=True)
class _LoadCauses:
    """Loads of data, (n, channels), against loads of the closed form; rounding: what they may differ by, likewise;
    least: (channels,) the smallest scale of an error."""

    scene: Scene
    vectors: Vectors
    time: Array
    values: Array
    rounding: Array
    least: Array
    tolerance: float

    def scale(self, j: int, values: Array) -> float:
        return float(max(np.abs(values).max(initial=0.0), self.least[j])) or 1.0

    def fits(self, j: int, factor: float, candidate: Array, *, may_vanish: bool = False) -> bool:
        """Whether a component is `factor` times another one, which is not next to nothing unless it may be."""
        scale, size = self.scale(j, candidate), float(np.abs(candidate).max())
        allowed = min(self.tolerance, _MOST_LEFT)
        left = np.abs(self.values[:, j] / factor - candidate) - FLOOR_SAFETY * self.rounding[:, j] / min(abs(factor), 1)
        return float(left.max()) <= allowed * scale and (may_vanish or size > 100.0 * allowed * scale)

    def causes(self, channels: tuple[Channel, ...], wrong: list[int]) -> list[str]:
        """For each wrong component the simplest of: unit, sign, axis, frame, another load, the torque on the rotor in
        it; for moments that are left another point. Components with one cause are named together."""
        simplest: dict[int, dict[str, str]] = {}  # by component, then by what is wrong: which column it is
        groups: dict[tuple[str, str], list[int]] = {}  # what is left, of one load
        for j in wrong:
            found = list(self._explanations(j, channels[j]))
            least = min([cost for cost, _, _ in found], default=0)
            simplest[j] = {text: other for cost, other, text in found[::-1] if cost == least}
            if not found:
                groups.setdefault((_load_and_axis(channels[j])[0], channels[j].frame), []).append(j)
        # Of texts that are alike for a component the one that most components have.
        common = Counter(text for texts in simplest.values() for text in texts)
        named: dict[str, list[str]] = {}
        for j, texts in simplest.items():
            if texts:
                text = max(reversed(texts), key=lambda text: common[text])
                named.setdefault(text, []).append(f"{channels[j].name}{texts[text]}")
        for (load, frame), group in groups.items():
            if text := self._other_point(load, frame, group, channels):
                named.setdefault(text, []).extend(channels[j].name for j in group)
        exchanged = named.pop("", [])
        lines = [f"{', '.join(names)}: {text}" for text, names in named.items()]
        return [*lines, f"columns exchanged: {', '.join(exchanged)}"] if exchanged else lines

    def _explanations(self, j: int, channel: Channel) -> Iterator[tuple[int, str, str]]:
        """(mistakes that it takes, which column it is, what is wrong)."""
        own, own_axis = _load_and_axis(channel)
        for load, frames in self.vectors.items():
            if ("force" in load) != (channel.kind == "force"):
                continue
            more = [("", frames)]
            if load == "shaft moment":
                torque = np.zeros((len(self.time), 3))
                torque[:, 1] = values_before(load_segments(self.scene), self.time)[0]
                with_torque = {frame: vectors + torque for frame, vectors in frames.items()}
                more.append(("with the torque on the rotor in it", with_torque))
            for (extra, vectors), frame in itertools.product(more, frames):
                for axis, factor in itertools.product(range(vectors[frame].shape[1]), _FACTORS):
                    if not self.fits(j, factor, vectors[frame][:, axis]):
                        continue
                    is_other = load != own or axis != own_axis
                    elsewhere = f"in the {_frame_name(load, frame)} frame" if frame != channel.frame else ""
                    parts = [extra, elsewhere, *_mistakes(factor)]
                    ending = f" {'xyz'[axis]}" if vectors[frame].shape[1] == 3 else ""
                    cost = (load != own) + sum(map(bool, [axis != own_axis, *parts]))
                    yield cost, f" is {load}{ending}" if is_other else "", ", ".join(filter(None, parts))

    def _other_point(self, load: str, frame: str, group: list[int], channels: tuple[Channel, ...]) -> str:
        """About which point a moment is, M - p × F = M + F × p, by least squares over its wrong components; "" where it
        is about none."""
        if not load.startswith(("shaft moment", "blade root moment")):
            return ""
        moment, force = (self.vectors[name][frame] for name in (load, load.replace("moment", "force")))
        axes = [_load_and_axis(channels[j])[1] for j in group]
        matrix = np.cross(force[:, None, :], np.eye(3)[None]).transpose(0, 2, 1)[:, axes]  # (n, axes, 3): F × p
        points: list[tuple[str, Array, float]] = []
        if load.startswith("blade root") and not frame:
            blade = self.scene.blades[int(load.split()[-1]) - 1]
            for name, place in (("the centre of mass", blade.centre_of_mass), ("the tip", blade.tip)):
                points += [(name, np.array(place), factor) for factor in _FACTORS]
        for factor in _FACTORS:
            arms = (self.values[:, group] / factor - moment[:, axes]).ravel()
            point = np.asarray(np.linalg.lstsq(matrix.reshape(-1, 3), arms, rcond=1e-9)[0], float)
            point[np.abs(point) < 1e-9 * np.abs(point).max()] = 0.0
            shown = ", ".join(f"{x:.6g}" for x in point)
            points.append((f"the point ({shown}) m of the {_frame_name(load, frame)} frame", point, factor))
        for name, point, factor in points:
            candidates = moment[:, axes] + matrix @ point
            if all(self.fits(j, factor, candidates[:, k], may_vanish=True) for k, j in enumerate(group)):
                origin = "the root" if load.startswith("blade root") else "the hub centre"
                parts = (f"about {name} in place of {origin}", *_mistakes(factor))
                return ", ".join(filter(None, parts))
        return ""


def _mistakes(factor: float) -> tuple[str, str]:
    return "sign reversed (action in place of reaction)" if factor < 0.0 else "", _UNITS[abs(factor)]


def _frame_name(load: str, frame: str) -> str:
    return frame or ("blade's own" if load.startswith("blade root") else "base")
