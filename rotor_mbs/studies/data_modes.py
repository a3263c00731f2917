"""A table of frequencies over rotor speed by another program, against the modes of the closed form; and what a
difference looks like: units, the fixed frame, damping, centrifugal stiffening that is missing."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from rotor_mbs.analysis.data_verdict import ChannelErrors, DataVerdict, agrees_until
from rotor_mbs.analysis.modes import CLOSED_FORM, LinearModes
from rotor_mbs.errors import InputError
from rotor_mbs.foreign.channels import ForeignData
from rotor_mbs.runs.read import Record
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.defects import FLOOR_SAFETY
from rotor_mbs.solution.trajectory import Array
from rotor_mbs.studies.compare_data import comparison_record
from rotor_mbs.studies.modes import compute_modes

_SLOW = 1e-3  # of the largest frequency: slower ones are judged by this, not by their own size
_MOST_LEFT = 1e-4  # of a frequency, by a mistake that is named,
_LEFT = 1e-2  # and of the difference: another program's own error is no mistake
_MOST_SPEEDS = 1000
_HZ, _RPM = 2.0 * math.pi, math.pi / 30.0  # rad/s
_UNITS = {1.0: "", _HZ: "Hz taken as rad/s", 1.0 / _HZ: "rad/s taken as Hz",
          _RPM: "rpm taken as rad/s", 1.0 / _RPM: "rad/s taken as rpm"}  # fmt: skip


def compare_modes(data: ForeignData, scene: Scene, tolerance: float) -> tuple[DataVerdict, Record]:
    """The verdict on each column of frequencies: its largest error, of the frequency's size, beyond rounding; and the
    data with what they were compared with, for a file.

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
    modes = _closed_form(scene, data.time)
    if isinstance(modes, str):
        raise InputError(f"{data.source}: nothing to compare with: {modes}")
    right = _families(modes, data)[""]
    if data.values.shape[1] > right.shape[1]:
        raise InputError(f"{data.source}: {data.values.shape[1]} frequencies; allowed: {right.shape[1]}, its modes")
    error, expected = _errors(data.values, data.rounding, right)
    known = np.isfinite(expected).all(axis=1)
    channels, messages = [], []
    for j, channel in enumerate(data.channels):
        size, difference = error[known, j], np.abs(data.values[:, j] - expected[:, j])[known]
        worst, largest = float(size.max(initial=0.0)), float(difference.max(initial=0.0))
        floor = float((data.rounding[:, j] / _scale(expected)[:, j])[known].max(initial=0.0))
        until = agrees_until(data.time[known], size)
        channels.append(ChannelErrors(channel.name, channel.unit, largest, largest, worst, floor, until, "of its size"))
        if not worst <= tolerance:
            at = f"at {data.time[known][int(size.argmax())]:.6g} rad/s, allowed {tolerance:.0e}"
            messages.append((worst, f"{channel.name}: relative difference of {worst:.1e} beyond rounding, {at}"))
    status, message = ("inaccurate", max(messages)[1]) if messages else ("ok", "")
    if not known.all():
        status = "unchecked" if status == "ok" else status
        message = message or next(filter(None, modes.messages), "no modes")
    likely = _causes(scene, data, tolerance, error) if messages else []
    verdict = DataVerdict(
        scene.name, data.source, status, message, tolerance, tuple(channels), len(data.time), float(data.time[-1]),
        read=data.read, unused=data.unused, likely=tuple(likely), axis="speed",
    )  # fmt: skip
    return verdict, comparison_record(verdict, scene, data, expected, None)


def _closed_form(scene: Scene, speeds: Array) -> LinearModes | str:
    """Modes at these speeds, without gravity, which is what they are without; at rest where none is above 0; why there
    are none."""
    if not speeds.any():
        found = compute_modes(scene, models=(CLOSED_FORM,))
        return found.rest.get(CLOSED_FORM, "; ".join(found.notes))
    found = compute_modes(replace(scene, gravity=0.0), speeds, models=(CLOSED_FORM,))
    return found.rotation.get(CLOSED_FORM, "; ".join(found.notes))


def _families(modes: LinearModes, data: ForeignData) -> dict[str, Array]:
    """What a program may call its frequencies, (speeds, columns or modes); those that are right have no words."""
    damped, undamped, speed = modes.damped_frequencies, modes.undamped_frequencies, modes.speeds[:, None]
    is_undamped = data.channels[0].name.startswith("undamped")
    right, other = (undamped, damped) if is_undamped else (damped, undamped)
    return {
        "": right,
        "damped frequencies" if is_undamped else "undamped frequencies": other,
        "frequencies in the fixed frame (whirl), the rotor's speed below or above those in the rotor's frame": (
            np.concatenate([right, np.abs(right - speed), right + speed], axis=1)
        ),
    }


def _scale(expected: Array) -> Array:
    least = _SLOW * float(np.nanmax(expected, initial=0.0))
    return np.maximum(expected, least or 1.0)


def _errors(values: Array, rounding: Array, known: Array) -> tuple[Array, Array]:
    """(speeds, columns) of the size of the frequency, beyond rounding; and the frequencies that are the nearest."""
    expected = np.full(values.shape, np.nan)
    for i, (row, right) in enumerate(zip(values, known, strict=True)):
        if np.isfinite(right).all():
            expected[i] = right[linear_sum_assignment(np.abs(row[:, None] - right))[1]]
    excess = np.abs(values - expected) - FLOOR_SAFETY * rounding
    return np.maximum(excess, 0.0) / _scale(expected), expected


def _causes(scene: Scene, data: ForeignData, tolerance: float, error: Array) -> list[str]:
    """The least that explains all: a wrong unit, of frequencies or speeds, another kind of frequency, or missing
    stiffening; several texts for one table where they are alike. error: (speeds, columns), as `_errors` has it."""
    allowed = min(tolerance, _MOST_LEFT, _LEFT * float(np.nanmax(error, initial=0.0)))
    # The stiffening is seen from rest on: the squares of undamped frequencies, there and at the speeds of the data.
    whole = _closed_form(scene, np.union1d(0.0, data.time)) if np.count_nonzero(data.time) >= 3 else ""
    found: list[tuple[int, str]] = []  # mistakes that it takes, in words
    for speed, of_speeds in _UNITS.items() if data.time.any() else [(1.0, "")]:
        modes = _closed_form(scene, speed * data.time)
        if isinstance(modes, str):
            continue
        for unit, of_frequencies in _UNITS.items():
            values, rounding = data.values * unit, data.rounding * unit
            texts = [f"frequencies in {of_frequencies}"] if of_frequencies else []
            texts += [f"speeds in {of_speeds}"] if of_speeds else []
            for text, frequencies in _families(modes, data).items():
                parts = [*texts, text] if text else texts
                if parts and np.nanmax(_errors(values, rounding, frequencies)[0], initial=0.0) <= allowed:
                    found.append((len(parts), "; and ".join(parts)))
            if speed == 1.0 and not isinstance(whole, str):
                wrong = _errors(values, rounding, modes.damped_frequencies)[0].max(axis=0) > tolerance
                left, text = _without_stiffening(whole, data.time, values[:, wrong], rounding[:, wrong])
                if left <= allowed:
                    found.append((len(texts) + 1, "; and ".join([*texts, text])))
    least = min(found, default=(0, ""))[0]
    return [text for cost, text in found if cost == least]


def _without_stiffening(modes: LinearModes, speeds: Array, values: Array, rounding: Array) -> tuple[float, str]:
    """(what is left, in words) f² = f0² - α Ω², with the scene's f0 and an α of 0 or more, where the scene's own f²
    rises, or falls less: of every column that is wrong, (speeds, columns). modes: at rest and at those speeds.

    Of a blade that turns about its pitch axis by θ, the centrifugal forces have the stiffness Ω² Σ m (u² - v²), u
    the distance of its masses from that axis across the shaft, v along it. A model of linear displacements has
    none of u², which is of second order in θ: what is left, -Ω² Σ m v², softens.
    """
    squares, turning = modes.undamped_frequencies**2, speeds**2
    largest, alphas = 0.0, []
    for column, digits in zip(values.T, rounding.T, strict=True):
        fits = []
        for first, last in zip(squares[0], squares[-1], strict=True):
            alpha = max(float(turning @ (first - column**2) / (turning @ turning)), 0.0)
            if not last > first - alpha * turning[-1]:
                continue
            found = np.sqrt(np.maximum(first - alpha * turning, 0.0))
            excess = np.maximum(np.abs(column - found) - FLOOR_SAFETY * digits, 0.0)
            fits.append((float((excess / _scale(found)).max()), alpha))
        left, alpha = min(fits, default=(math.inf, 0.0))
        largest = max(largest, left)
        alphas.append(f"{alpha:.4g}")
    shown = ", ".join(dict.fromkeys(alphas))
    return largest, f"centrifugal stiffening is missing: f² = f0² - α Ω², α = {shown}"
