"""Whirl of a rotor of equal blades: nodal diameters of mode shapes, frequencies in the fixed frame.

Blade i of N, mounted at ψ_i = 2π(i-1)/N on a rotor at the angle q = Ω t, stands at the azimuth
ψ = Ω t + ψ_i. Its pitch in a mode, Re φ_i e^{λt}, is a sum of waves over the blades,

    Re c_n e^{λt - j n ψ_i},   c_n = (1/N) Σ_i φ_i e^{j n ψ_i},   -N/2 < n <= N/2,

that run towards larger azimuths for n > 0 and have |n| nodal diameters. At a fixed azimuth the wave
is Re c_n e^{(λ + j n Ω) t - j n ψ}: of the frequency ω in the rotating frame the fixed one has
|ω + n Ω|. A wave is called forward if it runs, in the rotating frame, the way the rotor turns: its
frequency in the fixed frame is ω + |n Ω|, that of a backward one |ω - |n Ω||. Where ω < |n Ω| the
rotor carries a backward wave along, so that it moves forward in the fixed frame.

Waves of the diameter 0 (collective) and N/2 (differential: neighbours against each other) do not
whirl; multiblade coordinates have no azimuth there, and both frames have the same frequency.

Source: R. P. Coleman, A. M. Feingold, NACA Report 1351, 1958; M. H. Hansen, Wind Energy 6 (2003)
179-195; G. Bir, AIAA 2008-1300.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.solution.trajectory import Array

Complex = NDArray[np.complex128]

HERTZ = 1.0 / (2.0 * np.pi)  # Hz of a rad/s
RPM = 30.0 / np.pi  # rpm of a rad/s

# Share of a mode shape that is rounding: what is left of other nodal diameters, of the other
# direction. Six digits are printed.
_PURE = 1e-6
# Share of the largest eigenvalue within which two eigenvalues are one, as models agree.
_EQUAL = 1e-8


@dataclass(frozen=True)
class FixedFrame:
    """Hold the motions of a rotor of equal blades as a fixed observer sees them.

    Attributes
    ----------
    names : of the m motions: "backward whirl", "forward whirl" (of two nodal diameters and more
        with their number: "forward whirl 2"), and the modes that do not whirl by their own names.
    diameters : (m,) nodal diameters, below 0 of a backward whirl.
    rotating, fixed : (speeds, m) rad/s, damped frequency in the rotating and in the fixed frame.
    rotor_share : (speeds, m) amplitude of the rotor's angle over that of the pitches; NaN where no
        pitch moves.
    """

    names: tuple[str, ...]
    diameters: NDArray[np.int64]
    rotating: Array
    fixed: Array
    rotor_share: Array


def wave_amplitudes(pitches: Array | Complex) -> Complex:
    """Return the amplitudes c_n of the waves over the blades, (..., N).

    Parameters
    ----------
    pitches : (..., N) pitch amplitudes of a mode, or pitches.

    Returns
    -------
    ndarray
        In NumPy's order of frequencies: n = 0, 1, ..., -2, -1.
    """
    # The inverse transform has the positive sign in the exponent, and the factor 1/N.
    return np.asarray(np.fft.ifft(pitches, axis=-1), dtype=complex)


def nodal_diameters(shapes: Complex) -> NDArray[np.int64]:
    """Return the number of nodal diameters of each mode; -1 where its shape has several.

    The rotor's angle counts to the diameter 0: it moves all blades alike.

    Parameters
    ----------
    shapes : (speeds, n, 1 + N) amplitudes of rotor and pitches; NaN at speeds without modes.
    """
    blades = shapes.shape[2] - 1
    waves = np.abs(wave_amplitudes(shapes[:, :, 1:])) ** 2 * blades  # shares of Σ |φ_i|²
    content = np.zeros((*shapes.shape[:2], blades // 2 + 1))
    content[:, :, 0] = np.abs(shapes[:, :, 0]) ** 2
    for k in range(blades):
        content[:, :, min(k, blades - k)] += waves[:, :, k]
    is_known = np.isfinite(content).all(axis=(1, 2))
    diameters = np.full(shapes.shape[1], -1)
    for mode in range(shapes.shape[1]):
        shares = content[is_known, mode]
        if not len(shares):
            continue
        largest = int(shares.sum(axis=0).argmax())
        others = np.delete(shares, largest, axis=1).sum(axis=1)
        if (others <= _PURE**2 * shares.sum(axis=1)).all():
            diameters[mode] = largest
    return diameters


def why_no_whirl(diameters: NDArray[np.int64], blades: int) -> str:
    """Return why modes do not whirl, "" where they do: as many of each diameter as coordinates.

    Parameters
    ----------
    diameters : (n,) nodal diameters of all modes, see `nodal_diameters`.
    blades : number of blades.
    """
    if blades < 3:
        return "whirl is not defined for fewer than three blades"
    expected = sorted([0, *(min(k, blades - k) for k in range(blades))])
    if sorted(diameters.tolist()) != expected:
        return "whirl is not defined: blades, bearings or steady pitches differ"
    return ""


def whirl_frequencies(
    frequency: Array, speed: Array | float, diameter: Array | int = 1
) -> tuple[Array, Array]:
    """Return the backward and forward whirl frequencies in rad/s, in the fixed frame.

    Parameters
    ----------
    frequency : rad/s, in the rotating frame.
    speed : rad/s, of the rotor; its sign is that of no frequency.
    diameter : nodal diameters, the number k of the coordinates cosine_k and sine_k.
    """
    carried = diameter * np.abs(speed)
    return np.abs(frequency - carried), frequency + carried


def whirl(
    shapes: Complex, eigenvalues: Complex, frequencies: Array, speeds: Array
) -> tuple[Array, Array]:
    """Return the frequencies at which each mode is seen in the fixed frame as a whirl.

    A standing wave is a sum of both directions, as are two modes of one eigenvalue, of which any
    combination is a mode. A mode alone whose phases go round in one direction is seen in it only.

    Parameters
    ----------
    shapes : (speeds, n, 1 + N) amplitudes of rotor and pitches.
    eigenvalues : (speeds, n) 1/s, that of each shape.
    frequencies : (speeds, n) rad/s, damped, in the rotating frame.
    speeds : (speeds,) rad/s, of the rotor.

    Returns
    -------
    backward, forward : ndarray
        (speeds, n) rad/s; NaN where the mode has no such wave, and where no whirl is defined.
    """
    blades = shapes.shape[2] - 1
    diameters = nodal_diameters(shapes)
    sizes = np.linalg.norm(shapes, axis=2)
    seen = np.full((2, *frequencies.shape), np.nan)
    if why_no_whirl(diameters, blades):
        return seen[0], seen[1]
    for mode, diameter in enumerate(diameters.tolist()):
        if diameter in (0, blades / 2):
            continue
        largest = np.abs(eigenvalues).max(axis=1)
        has_wave = np.zeros((2, len(speeds)), dtype=bool)
        for other in np.flatnonzero(diameters == diameter).tolist():
            distance = np.abs(eigenvalues[:, other] - eigenvalues[:, mode])
            is_same = distance <= _EQUAL * largest
            for place, amplitude in enumerate(_directions(shapes[:, other], speeds, diameter)):
                has_wave[place] |= is_same & (amplitude > _PURE * sizes[:, other])
        both = whirl_frequencies(frequencies[:, mode], speeds, diameter)
        for place, values in enumerate(both):
            seen[place, :, mode] = np.where(has_wave[place], values, np.nan)
    return seen[0], seen[1]


def fixed_frame(
    names: Sequence[str],
    shapes: Complex,
    frequencies: Array,
    speeds: Array,
) -> FixedFrame | str:
    """Return the motions in both frames, or why whirl is not defined.

    Of two modes of a nodal diameter the backward whirl is that in which the backward wave is
    stronger; for equal blades both have one frequency.

    Parameters
    ----------
    names : of the n modes.
    shapes, frequencies, speeds : see `whirl`.
    """
    blades = shapes.shape[2] - 1
    known_diameters = nodal_diameters(shapes)
    reason = why_no_whirl(known_diameters, blades)
    if reason:
        return reason
    diameters = known_diameters.tolist()
    titles: list[str] = []
    signed: list[int] = []
    rotating: list[Array] = []
    fixed: list[Array] = []
    shares: list[Array] = []
    pitches = np.abs(shapes[:, :, 1:]).max(axis=2)
    moving = np.where(pitches > 0.0, pitches, np.nan)
    rotor_share = np.abs(shapes[:, :, 0]) / moving
    for mode, diameter in enumerate(diameters):
        if diameter in (0, blades / 2):
            titles.append(names[mode])
            signed.append(diameter)
            rotating.append(frequencies[:, mode])
            fixed.append(frequencies[:, mode])
            shares.append(rotor_share[:, mode])
            continue
        if diameter in diameters[:mode]:
            continue  # with the first mode of the two
        pair = np.flatnonzero(known_diameters == diameter)
        for sign, direction in ((-1, "backward"), (1, "forward")):
            # Of each mode the amplitude in this direction: (speeds, 2).
            amplitudes = np.column_stack(
                [_directions(shapes[:, other], speeds, diameter)[(1 + sign) // 2] for other in pair]
            )
            chosen = pair[np.nan_to_num(amplitudes).argmax(axis=1)]
            frequency = frequencies[np.arange(len(speeds)), chosen]
            titles.append(f"{direction} whirl" + (f" {diameter}" if diameter > 1 else ""))
            signed.append(sign * diameter)
            rotating.append(frequency)
            fixed.append(whirl_frequencies(frequency, speeds, diameter)[(1 + sign) // 2])
            shares.append(rotor_share[np.arange(len(speeds)), chosen])
    return FixedFrame(
        names=tuple(titles),
        diameters=np.array(signed),
        rotating=np.column_stack(rotating),
        fixed=np.column_stack(fixed),
        rotor_share=np.column_stack(shares),
    )


def _directions(shapes: Complex, speeds: Array, diameter: int) -> tuple[Array, Array]:
    """Return the amplitudes of the backward and of the forward wave, (speeds,) each.

    Parameters
    ----------
    shapes : (speeds, 1 + N) of one mode.
    speeds : (speeds,) rad/s, whose sign says which direction is forward.
    diameter : of both waves.
    """
    waves = np.abs(wave_amplitudes(shapes[:, 1:]))
    up, down = waves[:, diameter], waves[:, -diameter]
    is_reversed = speeds < 0.0
    return np.where(is_reversed, up, down), np.where(is_reversed, down, up)
