"""Modes of linearized equations: frequencies, damping ratios, shapes in multiblade coordinates; Floquet multipliers.

Symbols: λ eigenvalue (1/s) of d/dt (δq, δq̇); ω0 = |λ| undamped and ωd = |Im λ| damped frequency (rad/s),
ζ = -Re λ / ω0 damping ratio; μ Floquet multiplier.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.solution.trajectory import Array

Complex = NDArray[np.complex128]

# A multiplier this much above 1 counts as growth: those of equal blades coincide, and rounding splits a double
# eigenvalue by the root of 1e-16 and more.
GROWTH = 1e-5


@dataclass(frozen=True)
class ModeSet:
    """n modes: of one speed, or of several, whose number then comes first in every array.

    eigenvalues (..., n, 2) 1/s: both of each mode, conjugate where it oscillates
    shapes      (..., n, n): a row for each mode, rotor and pitch amplitudes, the largest one 1
    names       of the modes where symmetry tells them apart, else ()
    """

    eigenvalues: Complex
    shapes: Complex
    names: tuple[str, ...] = ()

    @property
    def undamped_frequencies(self) -> Array:
        """(..., n) rad/s: root of the product of both eigenvalues; NaN where one of them grows without oscillating."""
        product = (self.eigenvalues[..., 0] * self.eigenvalues[..., 1]).real
        return np.sqrt(np.where(product >= 0.0, np.abs(product), np.nan))

    @property
    def damped_frequencies(self) -> Array:
        """(..., n) rad/s: 0 where the mode does not oscillate."""
        return np.asarray(np.abs(self.eigenvalues[..., 0].imag))

    @property
    def damping_ratios(self) -> Array:
        """(..., n) share of critical damping, above 1 if overdamped; NaN where the undamped frequency is 0 or none."""
        frequencies = self.undamped_frequencies
        rate = -0.5 * (self.eigenvalues[..., 0] + self.eigenvalues[..., 1]).real
        ratios = np.divide(rate, frequencies, out=np.full_like(rate, np.nan), where=frequencies > 0.0)
        return np.asarray(ratios + 0.0)  # no -0

    @property
    def growth_rates(self) -> Array:
        """(..., n) 1/s: the larger real part of each mode; above 0 it is unstable."""
        return np.asarray(self.eigenvalues.real.max(axis=-1) + 0.0)


def multiblade(blades: int) -> tuple[tuple[str, ...], Array]:
    """Names of the multiblade (Coleman) coordinates, and the (blades, blades) matrix from them to the blades' pitches.

    Pitch of blade i = collective + Σ_k (cosine_k cos k ψ_i + sine_k sin k ψ_i) [+ differential (-1)^i], with the
    blade's mounting angle ψ_i = 2π(i-1)/blades. Source: R. P. Coleman, A. M. Feingold, NACA Report 1351, 1958.
    """
    psi = 2.0 * np.pi * np.arange(blades) / blades
    names, columns = ["collective"], [np.ones(blades)]
    for k in range(1, (blades + 1) // 2):
        suffix = f" {k}" if k > 1 else ""
        names += [f"cosine{suffix}", f"sine{suffix}"]
        columns += [np.cos(k * psi), np.sin(k * psi)]
    if blades % 2 == 0:
        names.append("differential")
        columns.append(np.cos(np.pi * np.arange(blades)))
    return tuple(names), np.column_stack(columns)


def multiblade_shapes(shapes: Complex) -> Complex:
    """(..., 1 + blades) amplitudes of rotor and multiblade coordinates, from those of rotor and pitches."""
    _, matrix = multiblade(shapes.shape[-1] - 1)
    pitches = np.einsum("cb,...b->...c", np.linalg.inv(matrix), shapes[..., 1:])
    return np.concatenate([shapes[..., :1], pitches], axis=-1)


def modes_of(stiffness: Array, damping: Array, *, is_cyclic: bool) -> ModeSet:
    """All modes of δq̈ + damping δq̇ + stiffness δq = 0, rotor first among the (n,) coordinates, by undamped frequency.

    is_cyclic   nothing depends on the rotor's angle (no gravity): it is left out, its mode has an eigenvalue of exact 0
    """
    n = len(stiffness)
    matrix = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
    first = 1 if is_cyclic else 0
    values, vectors = np.linalg.eig(matrix[first:, first:])
    values = np.where(np.abs(values) ** 2 <= 4e-16 * n * np.abs(stiffness).max(initial=0.0), 0.0, values).astype(
        complex
    )
    values.real[np.abs(values.real) < 1e-14 * np.abs(values).max(initial=0.0)] = 0.0  # rounding of undamped modes
    shapes = []
    for vector in vectors.T:
        positions, rates = vector[: n - first], vector[n - first :]
        slow = np.linalg.norm(rates) <= 1e-7 * np.linalg.norm(positions)
        shapes.append(_normalized(np.concatenate([np.zeros(first), positions]) if slow else rates))
    pairs = _pairs(values, shapes, is_cyclic)
    modes = ModeSet(np.array([pair for pair, _ in pairs]), np.array([shape for _, shape in pairs]))
    order = np.argsort(np.nan_to_num(modes.undamped_frequencies), kind="stable")
    return ModeSet(modes.eigenvalues[order], modes.shapes[order])


def isotropic_modes(stiffness: Array, damping: Array) -> ModeSet:
    """Modes of a rotor of equal blades without gravity: rotor, then one for each multiblade coordinate, by name.

    Multiblade coordinates split the equations exactly: rotor and collective pitch, and each of the others alone.
    """
    names, matrix = multiblade(len(stiffness) - 1)
    n = len(stiffness)
    T = np.eye(n)
    T[1:, 1:] = matrix
    K, D = (np.asarray(np.linalg.inv(T) @ matrix @ T, dtype=np.float64) for matrix in (stiffness, damping))
    together = modes_of(K[:2, :2], D[:2, :2], is_cyclic=True)
    values, shapes = list(together.eigenvalues), [np.append(shape, np.zeros(n - 2)) for shape in together.shapes]
    if abs(shapes[0][0]) < abs(shapes[1][0]) and abs(shapes[0][1]) > 0.0:  # pitch slower than the rotor's decay
        values.reverse()
        shapes.reverse()
    for i in range(2, n):
        root = np.sqrt(complex((0.5 * D[i, i]) ** 2 - K[i, i]))
        values.append(np.array([-0.5 * D[i, i] + root, -0.5 * D[i, i] - root]))
        shapes.append(np.eye(n, dtype=complex)[i])
    return ModeSet(np.array(values), np.array([_normalized(T @ shape) for shape in shapes]), ("rotor", *names))


def track(sets: Sequence[ModeSet]) -> list[ModeSet]:
    """Puts the same modes in the same places at every speed: each set is put in the order of the one before, by shape.

    Likeness of two modes: the modal assurance criterion |φ·ψ*|² / (|φ|² |ψ|²), less their relative distance.
    """
    from scipy.optimize import linear_sum_assignment

    out = list(sets[:1])
    for each in sets[1:]:
        if each.names and each.names == out[-1].names:
            out.append(each)
            continue
        before = out[-1]
        size = max(float(np.abs(each.eigenvalues).max()), 1e-300)
        likeness = _assurance(before.shapes, each.shapes)
        likeness -= np.abs(before.eigenvalues[:, None, 0] - each.eigenvalues[None, :, 0]) / size
        order = linear_sum_assignment(-likeness)[1]
        out.append(ModeSet(each.eigenvalues[order], each.shapes[order]))
    return out


def whirl_frequencies(frequency: Array, speed: Array, harmonic: Array | int = 1) -> tuple[Array, Array]:
    """Backward and forward whirl in rad/s, as the base sees a cosine and sine mode of `frequency` in the rotor."""
    return np.abs(frequency - harmonic * speed), frequency + harmonic * speed


def floquet(transition: Array, flow: Array, gradient: Array, speed: float) -> tuple[Complex, Complex]:
    """Multipliers of a (2n, 2n) state transition matrix over a turn, the largest first: all of them, and the others
    than those that are 1 for every such motion. It is stable where none of the latter is larger than 1, up to `GROWTH`.

    flow: (2n,) time derivative of the state, an eigenvector for 1. gradient: (2n,) derivative of what the motion keeps,
    a left eigenvector for 1, or zeros.
    """
    if not np.isfinite(transition).all():
        nothing = np.full(len(transition), complex(np.nan, np.nan))
        return nothing, nothing
    units = np.repeat([1.0, speed], len(flow) // 2)
    scaled = transition * units / units[:, None]
    fixed = [flow / units, gradient * units]
    fixed = [vector / np.linalg.norm(vector) for vector in fixed if np.any(vector)]
    basis, _ = np.linalg.qr(np.column_stack(fixed), mode="complete")
    rest = basis[:, len(fixed) :]
    values = np.linalg.eigvals(scaled).astype(complex)
    others = np.linalg.eigvals(rest.T @ scaled @ rest).astype(complex)
    return values[np.argsort(-np.abs(values))], others[np.argsort(-np.abs(others))]


def _normalized(shape: Complex | Array) -> Complex:
    largest = shape[int(np.argmax(np.abs(shape)))]
    return np.asarray(shape / largest if largest != 0.0 else shape, dtype=complex)


def _pairs(
    values: Complex, shapes: Sequence[Complex], is_cyclic: bool
) -> list[tuple[tuple[complex, complex], Complex]]:
    """Both eigenvalues of each mode, and its shape."""
    pairs = [((value, value.conjugate()), shapes[k]) for k, value in enumerate(values) if value.imag > 0.0]
    single = sorted((k for k, value in enumerate(values) if value.imag == 0.0), key=lambda k: abs(values[k]))
    if is_cyclic:
        slowest = single.pop(0)
        pairs.append(((values[slowest], 0j), shapes[slowest]))
    while single:
        last = single.pop()
        partner = max(single, key=lambda k: float(_assurance(shapes[last][None], shapes[k][None])[0, 0]))
        single.remove(partner)
        pairs.append(((values[last], values[partner]), shapes[partner]))
    return [((complex(a), complex(b)), shape) for (a, b), shape in pairs]


def _assurance(first: Complex, second: Complex) -> Array:
    """(n, m) modal assurance criterion between the rows of both."""
    product = np.abs(first.conj() @ second.T) ** 2
    sizes = np.outer((np.abs(first) ** 2).sum(axis=1), (np.abs(second) ** 2).sum(axis=1))
    return np.asarray(product / np.maximum(sizes, 1e-300))
