"""A table of frequencies over rotor speed by another program, against the modes of the closed form; and what a
difference looks like: units, the fixed frame, damping, centrifugal stiffening that is missing."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from rotor_mbs.analysis.data_verdict import ChannelErrors, DataVerdict, agrees_until
from rotor_mbs.analysis.modes import CLOSED_FORM, LinearModes
from rotor_mbs.errors import InputError
from rotor_mbs.foreign.channels import ForeignData
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.defects import FLOOR_SAFETY
from rotor_mbs.solution.trajectory import Array
from rotor_mbs.studies.compare_data import DataStudy
from rotor_mbs.studies.modes import compute_modes

_SLOW = 1e-3  # of the largest frequency: slower ones are judged by this, not by their own size
_MOST_LEFT = 1e-4  # of a frequency, by a mistake that is named,
_LEFT = 1e-2  # and of the difference: another program's own error is no mistake
_MOST_SPEEDS = 1000
_HZ, _RPM = 2.0 * math.pi, math.pi / 30.0  # rad/s
_UNITS = {1.0: "", _HZ: "Hz taken as rad/s", 1.0 / _HZ: "rad/s taken as Hz",
          _RPM: "rpm taken as rad/s", 1.0 / _RPM: "rad/s taken as rpm"}  # fmt: skip


def compare_modes(data: ForeignData, scene: Scene, tolerance: float) -> DataStudy:
    """The verdict on each column of frequencies: its largest error, of the frequency's size, beyond rounding.

    At each speed the frequencies are those of different modes of the scene, whichever lie nearest. Steady rotation
    without gravity; at rest under gravity where no speed is above 0. Raises InputError for more than 1000 speeds, or
    more columns than modes.
    """
    if not 0.0 < tolerance < math.inf:
        raise InputError(f"tolerance: {tolerance!r}; allowed: a number more than 0")
    if len(data.time) > _MOST_SPEEDS:
        raise InputError(f"{data.source}: {len(data.time)} speeds; allowed: up to {_MOST_SPEEDS}")
    if len({channel.name.startswith("undamped") for channel in data.channels}) > 1:
        allowed = 'omit = ["undamped_frequency"], or ["frequency"], in a mapping file'
        raise InputError(f"{data.source}: damped and undamped frequencies in one table; allowed: {allowed}")
    search = _ModeCauses(scene, data, tolerance)
    modes = search.modes(1.0)
    if isinstance(modes, str):
        raise InputError(f"{data.source}: nothing to compare with: {modes}")
    error, expected = search.errors(data.values, data.rounding, search.families(1.0)[0][1])
    known = np.isfinite(expected).all(axis=1)
    channels, messages = [], []
    for j, channel in enumerate(data.channels):
        size, difference = error[known, j], np.abs(data.values[:, j] - expected[:, j])[known]
        worst, largest = float(size.max(initial=0.0)), float(difference.max(initial=0.0))
        floor = float((data.rounding[:, j] / search.scale(expected)[:, j])[known].max(initial=0.0))
        until = agrees_until(data.time[known], size)
        channels.append(
            ChannelErrors(channel.name, channel.unit, largest, largest, worst, floor, until, defect_unit="of its size")
        )
        if not worst <= tolerance:
            at = f"at {data.time[known][int(size.argmax())]:.6g} rad/s, allowed {tolerance:.0e}"
            messages.append((worst, f"{channel.name}: relative difference of {worst:.1e} beyond rounding, {at}"))
    status, message = ("inaccurate", max(messages)[1]) if messages else ("ok", "")
    if not known.all():
        status = "unchecked" if status == "ok" else status
        message = message or next(filter(None, modes.messages), "no modes")
    likely = search.causes() if messages else []
    end = float(data.time[-1])
    verdict = DataVerdict(
        scene.name, data.source, status, message, tolerance, tuple(channels), len(data.time), end, math.nan,
        read=data.read, unused=data.unused, likely=tuple(likely), axis="speed",
    )  # fmt: skip
    return DataStudy(scene, data, expected, None, verdict)


@dataclass(frozen=True)
class _ModeCauses:
    scene: Scene
    data: ForeignData
    tolerance: float

    def modes(self, factor: float, *, with_rest: bool = False) -> LinearModes | str:
        """Of the closed form at the data's speeds times a factor, and without rotation before; why there are none."""
        speeds = self.data.time * factor
        if not speeds.any() and not with_rest:
            found = compute_modes(self.scene, models=(CLOSED_FORM,))
            return found.rest.get(CLOSED_FORM, "; ".join(found.notes))
        # Without gravity there are no Floquet multipliers to compute; these modes are without it anyway.
        speeds = np.union1d(0.0, speeds) if with_rest else speeds
        found = compute_modes(replace(self.scene, gravity=0.0), speeds, models=(CLOSED_FORM,))
        return found.rotation.get(CLOSED_FORM, "; ".join(found.notes))

    def families(self, factor: float) -> list[tuple[str, Array]]:
        """What a program may call its frequencies, (speeds, columns or modes); the first are those that are right."""
        modes = self.modes(factor)
        if isinstance(modes, str):
            return []
        damped, undamped, speed = modes.damped_frequencies, modes.undamped_frequencies, modes.speeds[:, None]
        is_undamped = self.data.channels[0].name.startswith("undamped")
        right, other = (undamped, damped) if is_undamped else (damped, undamped)
        whirl = np.concatenate([right, np.abs(right - speed), right + speed], axis=1)
        text = "damped frequencies" if is_undamped else "undamped frequencies"
        frame = "in the fixed frame (whirl), the rotor's speed below or above those in the rotor's frame"
        return [("", right), (text, other), (f"frequencies {frame}", whirl)]

    def scale(self, expected: Array) -> Array:
        least = _SLOW * float(np.nanmax(expected, initial=0.0))
        return np.maximum(expected, least or 1.0)

    def errors(self, values: Array, rounding: Array, known: Array) -> tuple[Array, Array]:
        """(speeds, columns) of the size of the frequency, beyond rounding; and the frequencies that are the nearest."""
        if values.shape[1] > known.shape[1]:
            raise InputError(f"{self.data.source}: {values.shape[1]} frequencies; allowed: {known.shape[1]}, its modes")
        expected = np.full(values.shape, np.nan)
        for i, (row, right) in enumerate(zip(values, known, strict=True)):
            if np.isfinite(right).all():
                expected[i] = right[linear_sum_assignment(np.abs(row[:, None] - right))[1]]
        excess = np.abs(values - expected) - FLOOR_SAFETY * rounding
        return np.maximum(excess, 0.0) / self.scale(expected), expected

    def causes(self) -> list[str]:
        """The least that explains all: a wrong unit, of frequencies or speeds, another kind of frequency, or missing
        stiffening; several texts for one table where they are alike."""
        families = {factor: self.families(factor) for factor in _UNITS}
        before = self.errors(self.data.values, self.data.rounding, families[1.0][0][1])[0]
        allowed = min(self.tolerance, _MOST_LEFT, _LEFT * float(np.nanmax(before, initial=0.0)))
        found: list[tuple[int, str]] = []  # mistakes that it takes, in words
        for (speed, of_speeds), (unit, of_frequencies) in itertools.product(_UNITS.items(), _UNITS.items()):
            if speed != 1.0 and not self.data.time.any():
                continue
            values, rounding = self.data.values * unit, self.data.rounding * unit
            texts = [f"frequencies in {of_frequencies}"] if of_frequencies else []
            texts += [f"speeds in {of_speeds}"] if of_speeds else []
            for text, frequencies in families[speed]:
                parts = [*texts, text] if text else texts
                if parts and np.nanmax(self.errors(values, rounding, frequencies)[0], initial=0.0) <= allowed:
                    found.append((len(parts), "; and ".join(parts)))
            if speed == 1.0:
                left, text = self._without_stiffening(values, rounding)
                if left <= allowed:
                    found.append((len(texts) + 1, "; and ".join([*texts, text])))
        least = min(found, default=(0, ""))[0]
        return [text for cost, text in found if cost == least]

    def _without_stiffening(self, values: Array, rounding: Array) -> tuple[float, str]:
        """(what is left, in words) f² = f0² - α Ω², with the scene's f0 and an α of 0 or more, where the scene's own f²
        rises, or falls less: of every column that is wrong.

        Of a blade that turns about its pitch axis by θ, the centrifugal forces have the stiffness Ω² Σ m (u² - v²), u
        the distance of its masses from that axis across the shaft, v along it. A model of linear displacements has
        none of u², which is of second order in θ: what is left, -Ω² Σ m v², softens.
        """
        modes = self.modes(1.0, with_rest=True)
        if isinstance(modes, str) or np.count_nonzero(self.data.time) < 3:
            return math.inf, ""
        squares, places = modes.undamped_frequencies**2, np.searchsorted(modes.speeds, self.data.time)
        turning = self.data.time**2
        wrong = self.errors(values, rounding, modes.damped_frequencies[places])[0].max(axis=0) > self.tolerance
        largest, alphas = 0.0, []
        for column, digits in zip(values.T[wrong], rounding.T[wrong], strict=True):
            fits = []
            for first, last in zip(squares[0], squares[-1], strict=True):
                alpha = max(float(turning @ (first - column**2) / (turning @ turning)), 0.0)
                if not last > first - alpha * turning[-1]:
                    continue
                found = np.sqrt(np.maximum(first - alpha * turning, 0.0))
                excess = np.maximum(np.abs(column - found) - FLOOR_SAFETY * digits, 0.0)
                fits.append((float((excess / self.scale(found)).max()), alpha))
            left, alpha = min(fits, default=(math.inf, 0.0))
            largest = max(largest, left)
            alphas.append(f"{alpha:.4g}")
        shown = ", ".join(dict.fromkeys(alphas))
        return largest, f"centrifugal stiffening is missing: f² = f0² - α Ω², α = {shown}"
