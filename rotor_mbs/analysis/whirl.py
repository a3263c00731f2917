"""Whirl of a rotor of equal blades: nodal diameters of mode shapes, frequencies in the fixed frame.

The rotor has N blades, and its angle is q = Ω t. Blade i is mounted at ψ_i = 2π(i-1)/N, so that its
azimuth is ψ = Ω t + ψ_i. In a mode its pitch Re φ_i e^{λt} is a sum of waves over the blades,

    Re c_n e^{λt - j n ψ_i},   c_n = (1/N) Σ_i φ_i e^{j n ψ_i},   -N/2 < n <= N/2.

A wave has |n| nodal diameters, and runs towards larger azimuths for n > 0. At a fixed azimuth ψ it
is Re c_n e^{(λ + j n Ω) t - j n ψ}: a wave with the frequency ω in the rotating frame has the
frequency |ω + n Ω| in the fixed frame. A wave is called forward if it runs, in the rotating frame,
in the direction of rotation. The frequency in the fixed frame is ω + |n Ω| for a forward wave, and
|ω - |n Ω|| for a backward wave. If ω < |n Ω|, the rotor carries a backward wave along, so that it
moves forward in the fixed frame.

Waves with 0 nodal diameters (collective) or N/2 (differential: neighbouring blades in opposite
directions) do not whirl. Their multiblade coordinates have no azimuth, and their frequency is the
same in both frames.

Sources: R. P. Coleman, A. M. Feingold, NACA Report 1351, 1958; M. H. Hansen, Wind Energy 6 (2003)
179-195; G. Bir, AIAA 2008-1300.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.solution.trajectory import Array

Complex = NDArray[np.complex128]

HERTZ = 1.0 / (2.0 * np.pi)  # 1 rad/s in Hz
RPM = 30.0 / np.pi  # 1 rad/s in rpm

# Share of a mode shape up to which waves of other nodal diameters, or of the other direction, count
# as rounding. The share corresponds to the six digits that are printed.
_PURE = 1e-6
# Two eigenvalues count as equal if they differ by at most this share of the largest eigenvalue. It
# is the share within which models must agree.
_EQUAL = 1e-8


@dataclass(frozen=True)
class FixedFrame:
    """Hold the motions of a rotor of equal blades, with their frequencies in both frames.

    A motion is a backward or forward whirl, or a mode that does not whirl.

    Attributes
    ----------
    names : names of the m motions: "backward whirl" or "forward whirl", followed by the number of
        nodal diameters if there are two or more ("forward whirl 2"); a mode that does not whirl has
        its own name.
    diameters : (m,) number of nodal diameters; it is negative for a backward whirl.
    rotating, fixed : (speeds, m) rad/s, damped frequency in the rotating and in the fixed frame.
    rotor_share : (speeds, m) amplitude of the rotor angle, divided by the largest amplitude of a
        pitch; NaN where no pitch moves.
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
    pitches : (..., N) pitch amplitudes of a mode, or pitch angles.

    Returns
    -------
    ndarray
        c_n in NumPy's order of frequencies: n = 0, 1, ..., -2, -1.
    """
    # NumPy's inverse transform has the positive exponent and the factor 1/N of c_n.
    return np.asarray(np.fft.ifft(pitches, axis=-1), dtype=complex)


def nodal_diameters(shapes: Complex) -> NDArray[np.int64]:
    """Return the number of nodal diameters of each mode, (n,).

    It is -1 for a mode whose shape has waves of several numbers of nodal diameters. The rotor angle
    counts as a wave with 0 nodal diameters, because it moves all blades alike.

    Parameters
    ----------
    shapes : (speeds, n, 1 + N) amplitudes of the rotor and the pitches; NaN at speeds without
        modes.
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
    """Return why whirl is not defined; "" if it is.

    Whirl is defined if modes and multiblade coordinates have the same numbers of nodal diameters.

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
    frequency : frequency in the rotating frame, rad/s.
    speed : rotor speed, rad/s; only its magnitude matters.
    diameter : number of nodal diameters: k for the multiblade coordinates cosine_k and sine_k.
    """
    carried = diameter * np.abs(speed)
    return np.abs(frequency - carried), frequency + carried


def whirl(
    shapes: Complex, eigenvalues: Complex, frequencies: Array, speeds: Array
) -> tuple[Array, Array]:
    """Return the backward and forward whirl frequency of each mode in the fixed frame.

    A mode that is a standing wave is a sum of a backward and a forward wave, and has both
    frequencies. So do two modes with equal eigenvalues, because each combination of both is a mode,
    too. A single mode that is a wave in one direction has only the frequency of that direction.

    Parameters
    ----------
    shapes : (speeds, n, 1 + N) amplitudes of the rotor and the pitches.
    eigenvalues : (speeds, n) 1/s, the eigenvalue of each shape.
    frequencies : (speeds, n) rad/s, damped frequencies in the rotating frame.
    speeds : (speeds,) rad/s, rotor speeds.

    Returns
    -------
    backward, forward : ndarray
        (speeds, n) rad/s; NaN where the mode has no wave in this direction, and where whirl is not
        defined.
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
    """Return the motions in both frames, or the reason why whirl is not defined.

    Two modes have the same number of nodal diameters. The mode in which the backward wave is
    stronger gives the backward whirl, and the mode in which the forward wave is stronger gives the
    forward whirl. If the pair has equal frequencies, the choice does not matter.

    Parameters
    ----------
    names : names of the n modes.
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
            continue  # both modes of the pair are treated at the first one
        pair = np.flatnonzero(known_diameters == diameter)
        for sign, direction in ((-1, "backward"), (1, "forward")):
            # The amplitude of the wave in this direction in each mode of the pair: (speeds, 2).
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
    """Return the amplitudes of the backward and the forward wave of a mode, (speeds,) each.

    Parameters
    ----------
    shapes : (speeds, 1 + N) amplitudes of the rotor and the pitches in the mode.
    speeds : (speeds,) rad/s, rotor speeds; their sign determines which direction is forward.
    diameter : number of nodal diameters of both waves.
    """
    waves = np.abs(wave_amplitudes(shapes[:, 1:]))
    up, down = waves[:, diameter], waves[:, -diameter]
    is_reversed = speeds < 0.0
    return np.where(is_reversed, up, down), np.where(is_reversed, down, up)
