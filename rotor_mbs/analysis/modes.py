"""Modes of the linearized equations of a scene over rotor speed.

This module computes frequencies, damping ratios, shapes in multiblade coordinates and Floquet
multipliers from stiffness, damping and transition matrices. It returns them as arrays, as text, and
as records of a file of modes.

Symbols: λ eigenvalue (1/s) of d/dt (δq, δq̇); ω0 = |λ| undamped and ωd = |Im λ| damped frequency
(rad/s), ζ = -Re λ / ω0 damping ratio; μ Floquet multiplier.

The records of a file, by path:

/modes/<scene>/<model>/rest        modes at rest under gravity, with the single speed 0
/modes/<scene>/<model>/rotation    modes in steady rotation without gravity (Campbell diagram)
/modes/<scene>/lagrange/floquet    Floquet multipliers of a turn under gravity
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.analysis.text_tables import TextTable
from rotor_mbs.analysis.whirl import (
    HERTZ,
    RPM,
    FixedFrame,
    fixed_frame,
    nodal_diameters,
    whirl,
)
from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.runs.hdf5 import Column, reading
from rotor_mbs.runs.read import Record, read_records
from rotor_mbs.runs.trailer import MODES
from rotor_mbs.solution.trajectory import Array

Complex = NDArray[np.complex128]

# A multiplier counts as growth if it exceeds 1 by more than this. Equal blades have equal
# multipliers, and rounding splits a double eigenvalue by the square root of 1e-16 and more.
GROWTH = 1e-5
# Entries of a matrix below this share of its largest entry are set to zero. Such an entry changes
# an eigenvalue by at most the square root of the share, 1e-10, a hundredth of AGREEMENT.
_REMAINDER = 1e-20


@dataclass(frozen=True)
class ModeSet:
    """Hold n modes at one speed, or at several speeds.

    With several speeds, the first axis of every array is the speed.

    Attributes
    ----------
    eigenvalues : (..., n, 2) 1/s, the two eigenvalues of each mode; they are conjugate if the mode
        oscillates.
    shapes : (..., n, n), a row for each mode: amplitudes of rotor and pitches, the largest is 1.
    names : names of the modes if symmetry distinguishes them, else ().
    """

    eigenvalues: Complex
    shapes: Complex
    names: tuple[str, ...] = ()

    @property
    def undamped_frequencies(self) -> Array:
        """Return the undamped frequencies, (..., n) rad/s.

        The undamped frequency is the square root of the product of both eigenvalues. It is NaN if
        the product is negative: then both are real, and one of them is positive.
        """
        product = (self.eigenvalues[..., 0] * self.eigenvalues[..., 1]).real
        return np.sqrt(np.where(product >= 0.0, np.abs(product), np.nan))

    @property
    def damped_frequencies(self) -> Array:
        """Return the damped frequencies, (..., n) rad/s; 0 if the mode does not oscillate."""
        return np.asarray(np.abs(self.eigenvalues[..., 0].imag))

    @property
    def damping_ratios(self) -> Array:
        """Return the damping ratios, (..., n).

        The ratio is above 1 if the mode is overdamped, and NaN if its undamped frequency is 0 or
        NaN.
        """
        frequencies = self.undamped_frequencies
        rate = -0.5 * self._real_parts.sum(axis=-1)
        ratios = np.divide(
            rate, frequencies, out=np.full_like(rate, np.nan), where=frequencies > 0.0
        )
        return np.asarray(ratios + 0.0)  # no -0

    @property
    def growth_rates(self) -> Array:
        """Return the growth rates, (..., n) 1/s; above 0 the mode is unstable.

        The growth rate is the larger real part of the two eigenvalues.
        """
        return np.asarray(self._real_parts.max(axis=-1) + 0.0)

    @property
    def _real_parts(self) -> Array:
        """Return the real parts of the eigenvalues, (..., n, 2) 1/s.

        A real part is set to 0 if it is below the precision of the eigenvalue, such as -1e-100 for
        an eigenvalue of size 1.
        """
        is_rounding = np.abs(self.eigenvalues.real) <= np.finfo(float).eps * np.abs(
            self.eigenvalues
        )
        return np.where(is_rounding, 0.0, self.eigenvalues.real)


def multiblade(blades: int) -> tuple[tuple[str, ...], Array]:
    """Return the names of the multiblade (Coleman) coordinates, and their matrix.

    The matrix, (blades, blades), transforms multiblade coordinates into the pitches of the blades:
    pitch of blade i = collective + Σ_k (cosine_k cos k ψ_i + sine_k sin k ψ_i) [+ differential
    (-1)^(i-1)], with the blade's mounting angle ψ_i = 2π(i-1)/blades. Source: R. P. Coleman, A. M.
    Feingold, NACA Report 1351, 1958.

    Parameters
    ----------
    blades : number of blades; the differential coordinate exists if the number is even.
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
    """Transform mode shapes into amplitudes of rotor and multiblade coordinates, (..., 1 + blades).

    Parameters
    ----------
    shapes : (..., 1 + blades) amplitudes of rotor and pitches.
    """
    _, matrix = multiblade(shapes.shape[-1] - 1)
    pitches = np.einsum("cb,...b->...c", np.linalg.inv(matrix), shapes[..., 1:])
    return np.concatenate([shapes[..., :1], pitches], axis=-1)


def modes_of(
    stiffness: Array,
    damping: Array,
    *,
    is_cyclic: bool,
    rounding: float = 0.0,
) -> ModeSet:
    """Return the n modes of δq̈ + damping δq̇ + stiffness δq = 0, sorted by undamped frequency.

    Parameters
    ----------
    stiffness, damping : ndarray
        (n, n), 1/s² and 1/s; the rotor is the first coordinate.
    is_cyclic : bool
        Whether nothing depends on the rotor angle (no gravity). Then the rotor angle is left out of
        the equations, and the rotor's mode has an eigenvalue of exactly 0.
    rounding : float
        Rounding error of the stiffness, 1/s². An eigenvalue is set to 0 if its squared modulus is
        not larger.
    """
    n = len(stiffness)
    # Differences of nearly equal numbers leave remainders, such as 1e-160 beside 1. They are set to
    # zero: LAPACK scales rows to equal sizes, so that a shape would consist of such remainders.
    size = np.abs(stiffness).max(initial=0.0)
    stiffness = np.where(np.abs(stiffness) < _REMAINDER * size, 0.0, stiffness)
    size = max(float(np.abs(damping).max(initial=0.0)), math.sqrt(size))
    damping = np.where(np.abs(damping) < _REMAINDER * size, 0.0, damping)
    # The matrix of the equations of first order, for positions and then rates. Its first row and
    # column, those of the rotor angle, are left out if nothing depends on this angle.
    matrix = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
    first = 1 if is_cyclic else 0
    values, vectors = np.linalg.eig(matrix[first:, first:])
    rounding = max(rounding, 4e-16 * n * np.abs(stiffness).max(initial=0.0))
    values = np.where(np.abs(values) ** 2 <= rounding, 0.0, values).astype(complex)
    # The real part of an undamped mode is rounding.
    values.real[np.abs(values.real) < 1e-14 * np.abs(values).max(initial=0.0)] = 0.0
    shapes = []
    for vector in vectors.T:
        positions, rates = vector[: n - first], vector[n - first :]
        # The rates of an eigenvector are λ times the positions. They are taken as the shape,
        # because they include the rotor even if its angle is left out. For an eigenvalue near 0
        # the rates are rounding, and the positions are taken.
        slow = np.linalg.norm(rates) <= 1e-7 * np.linalg.norm(positions)
        shapes.append(_normalized(np.concatenate([np.zeros(first), positions]) if slow else rates))
    # Each mode that oscillates: its two eigenvalues, and its shape.
    pairs = [
        ((value, value.conjugate()), shapes[k])
        for k, value in enumerate(values)
        if value.imag > 0.0
    ]
    single = sorted(
        (k for k, value in enumerate(values) if value.imag == 0.0), key=lambda k: abs(values[k])
    )
    if is_cyclic:
        slowest = single.pop(0)
        pairs.append(((values[slowest], 0j), shapes[slowest]))
    # Two real eigenvalues make a mode. Beginning with the largest, each real eigenvalue is paired
    # with the one whose shape is most similar.
    while single:
        last = single.pop()
        partner = max(
            single, key=lambda k: float(_assurance(shapes[last][None], shapes[k][None])[0, 0])
        )
        single.remove(partner)
        # The larger of the two real eigenvalues is the first of the mode. The order must be the
        # same in all models, because `in_order_of` compares the first eigenvalues.
        growing, decaying = sorted((values[last], values[partner]), key=lambda value: -value.real)
        pairs.append(((growing, decaying), shapes[partner]))
    modes = ModeSet(
        np.array([pair for pair, _ in pairs], dtype=complex),
        np.array([shape for _, shape in pairs]),
    )
    order = np.argsort(np.nan_to_num(modes.undamped_frequencies), kind="stable")
    return ModeSet(modes.eigenvalues[order], modes.shapes[order])


def isotropic_modes(stiffness: Array, damping: Array) -> ModeSet:
    """Return the modes of a rotor of equal blades without gravity, with their names.

    The mode of the rotor comes first, then the mode of each multiblade coordinate. In multiblade
    coordinates the equations of such a rotor are decoupled, except for those of rotor and
    collective pitch, which are coupled to each other.

    Parameters
    ----------
    stiffness, damping : (1 + blades, 1 + blades), 1/s² and 1/s, rotor first, then the pitches.
    """
    names, matrix = multiblade(len(stiffness) - 1)
    n = len(stiffness)
    T = np.eye(n)
    T[1:, 1:] = matrix
    K, D = (
        np.asarray(np.linalg.inv(T) @ matrix @ T, dtype=np.float64)
        for matrix in (stiffness, damping)
    )
    together = modes_of(K[:2, :2], D[:2, :2], is_cyclic=True)
    values, shapes = (
        list(together.eigenvalues),
        [np.append(shape, np.zeros(n - 2)) for shape in together.shapes],
    )
    # `modes_of` sorts by frequency: the mode of the collective pitch is first if it is slower than
    # the decay of the rotor. Then both modes are exchanged.
    if abs(shapes[0][0]) < abs(shapes[1][0]) and abs(shapes[0][1]) > 0.0:
        values.reverse()
        shapes.reverse()
    for i in range(2, n):
        # Each further coordinate is a separate oscillator: λ² + D λ + K = 0.
        root = np.sqrt(complex((0.5 * D[i, i]) ** 2 - K[i, i]))
        values.append(np.array([-0.5 * D[i, i] + root, -0.5 * D[i, i] - root]))
        shapes.append(np.eye(n, dtype=complex)[i])
    return ModeSet(
        np.array(values), np.array([_normalized(T @ shape) for shape in shapes]), ("rotor", *names)
    )


def track(sets: Sequence[ModeSet]) -> list[ModeSet]:
    """Return the modes at all speeds, sorted so that a mode has the same place at every speed.

    Parameters
    ----------
    sets : the modes at each speed. They are put in the order of the modes at the speed before.
    """
    out = list(sets[:1])
    for each in sets[1:]:
        out.append(in_order_of(out[-1], each))
    return out


def in_order_of(first: ModeSet, other: ModeSet) -> ModeSet:
    """Return the modes of `other`, sorted so that each is in the place of the like mode of `first`.

    The likeness of two modes is the modal assurance criterion |φ·ψ*|² / (|φ|² |ψ|²) minus the
    distance of their first eigenvalues, as a share of the largest eigenvalue.

    Parameters
    ----------
    first, other : two sets with the same number of modes, each at one speed.
    """
    from scipy.optimize import linear_sum_assignment

    if other.names and other.names == first.names:
        return other
    size = max(float(np.abs(other.eigenvalues).max()), 1e-300)
    likeness = _assurance(first.shapes, other.shapes)
    likeness -= np.abs(first.eigenvalues[:, None, 0] - other.eigenvalues[None, :, 0]) / size
    # Modes are assigned one to one, so that the sum of all likenesses is largest.
    order = linear_sum_assignment(-likeness)[1]
    return ModeSet(other.eigenvalues[order], other.shapes[order])


def floquet(
    transition: Array, flow: Array, gradient: Array, speed: float
) -> tuple[Complex, Complex]:
    """Return the Floquet multipliers of a turn: all of them, and those that are not always 1.

    Every periodic motion has a multiplier 1, and a motion with a conserved quantity has a second
    multiplier 1. The motion is stable if no other multiplier has a modulus above 1, up to `GROWTH`.
    Both arrays are sorted by modulus, the largest first.

    Parameters
    ----------
    transition : (2n, 2n) state transition matrix over the turn.
    flow : (2n,) time derivative of the state; it is an eigenvector of the multiplier 1.
    gradient : (2n,) derivative of the conserved quantity with respect to the state; it is a left
        eigenvector of the multiplier 1. Zeros if nothing is conserved.
    speed : rotor speed, rad/s, by which rates are divided.
    """
    if not np.isfinite(transition).all():
        nothing = np.full(len(transition), complex(np.nan, np.nan))
        return nothing, nothing
    # Rates are divided by the rotor speed, so that all numbers of the state have one unit.
    units = np.repeat([1.0, speed], len(flow) // 2)
    scaled = transition * units / units[:, None]
    fixed = [flow / units, gradient * units]
    fixed = [vector / np.linalg.norm(vector) for vector in fixed if np.any(vector)]
    basis, _ = np.linalg.qr(np.column_stack(fixed), mode="complete")
    # `rest` spans the space orthogonal to `flow` and `gradient`. The hyperplane orthogonal to
    # `gradient` is mapped into itself, and it contains `flow`. Projected onto `rest`, without the
    # direction of `flow`, the map has all other multipliers.
    rest = basis[:, len(fixed) :]
    values = np.linalg.eigvals(scaled).astype(complex)
    others = np.linalg.eigvals(rest.T @ scaled @ rest).astype(complex)
    return values[np.argsort(-np.abs(values))], others[np.argsort(-np.abs(others))]


def _normalized(shape: Complex | Array) -> Complex:
    """Return a shape divided by its largest entry; a shape of zeros is not changed."""
    largest = shape[int(np.argmax(np.abs(shape)))]
    return np.asarray(shape / largest if largest != 0.0 else shape, dtype=complex)


def _assurance(first: Complex, second: Complex) -> Array:
    """Return the modal assurance criterion of each shape (row) of `first` and `second`, (n, m)."""
    product = np.abs(first.conj() @ second.T) ** 2
    sizes = np.outer((np.abs(first) ** 2).sum(axis=1), (np.abs(second) ** 2).sum(axis=1))
    return np.asarray(product / np.maximum(sizes, 1e-300))


REST, ROTATION = "rest", "rotation"
CLOSED_FORM = "lagrange"  # the model with which the other models are compared
FLOQUET = f"{CLOSED_FORM}/floquet"  # name of the record with the Floquet multipliers
# Models agree if their eigenvalues differ by at most this share of the largest eigenvalue.
AGREEMENT = 1e-8
# Largest relative residual of a model's modes in its own equations: six digits are printed.
PRINTED_PRECISION = 1e-6
_NOTE_WIDTH = 130  # line width of notes in a summary, in characters: as wide as its table
# Explanation in a summary of the modes `rotor` and `collective` of a rotor that no drive holds.
_FREE_SHAFT = (
    "the shaft is free: `rotor` turns all blades together, and the collective pitch moves the "
    "rotor, too (rotor/pitch); a whirl moves no rotor"
)
_SHOWN_ROWS = 24  # maximum number of table rows in a summary: three states with eight modes
# Eigenvalues below this share of the largest eigenvalue are not compared directly. They are square
# roots of a small difference of stiffnesses; if nothing holds the rotor, the difference is
# rounding, and the root magnifies it. Residuals, which are not magnified, are compared instead.
_SLOW = 1e-3
# A singular vector counts as a shape of an eigenvalue if its singular value is below this share of
# the terms of the equations.
_NO_FORCE = 1e-10


@dataclass(frozen=True, kw_only=True)
class LinearModes(ModeSet):
    """Hold the modes of one model over speed; a mode has the same place at every speed.

    Attributes
    ----------
    names : names of the modes, such as "collective pitch" if symmetry distinguishes the modes, or
        else "mode 2".
    source, label : name of the model, and its label for readers.
    kind : REST or ROTATION.
    blades : number of blades.
    speeds : (speeds,) rotor speeds, rad/s.
    coordinates : names of the n coordinates that move.
    angles : (speeds, n) rad, values of the `coordinates` at the steady state.
    stiffness, damping : (speeds, n, n) 1/s² and 1/s, multiplied by the inverse mass matrix.
    weights : 1/s², moments of all weights about the shaft, divided by the rotor's inertia. In a
        balanced rotor the moments cancel, and the remaining stiffness is rounding of this number.
    messages : for each speed the reason why there are no modes; "" if there are.
    """

    source: str
    label: str
    kind: str
    blades: int
    speeds: Array
    coordinates: tuple[str, ...]
    angles: Array
    stiffness: Array
    damping: Array
    weights: float = 0.0
    messages: tuple[str, ...] = ()

    @property
    def residual(self) -> float:
        """Return the largest residual of (λ² + λ damping + stiffness) φ = 0 over all modes.

        Each residual is divided by the size of the terms. A residual that is not small shows that
        an assumption is wrong with which the modes were computed: that all blades are equal, or
        that without gravity nothing depends on the rotor angle.
        """
        largest = 0.0
        for i in range(len(self.speeds)):
            if not np.isfinite(self.stiffness[i]).all():
                continue
            for values, shape in zip(self.eigenvalues[i], self.shapes[i], strict=True):
                # The stored shape belongs to one of the two eigenvalues, so the smaller residual
                # counts.
                residuals = [self.residual_of(i, value, shape) for value in values.tolist()]
                largest = max(largest, min(residuals))
        return largest

    def residual_of(self, i: int, value: complex, shape: Complex) -> float:
        """Return the relative residual of an eigenvalue and a shape, see `residual`.

        Parameters
        ----------
        i : number of the speed.
        value : 1/s, the eigenvalue.
        shape : (n,) amplitudes.
        """
        stiffness, damping = self.stiffness[i], self.damping[i]
        force = value * value * shape + value * (damping @ shape) + stiffness @ shape
        return float(np.linalg.norm(force) / (np.linalg.norm(shape) * self._terms(i, value)))

    def shapes_of(self, i: int, value: complex) -> Complex:
        """Compute all shapes of an eigenvalue from the full matrices, one in each row.

        Parameters
        ----------
        i : number of the speed.
        value : 1/s, the eigenvalue.
        """
        n = len(self.coordinates)
        _, sizes, vectors = np.linalg.svd(
            value * value * np.eye(n) + value * self.damping[i] + self.stiffness[i]
        )
        # For an eigenvalue this matrix is singular. Its null space, up to rounding, has the shapes.
        is_shape = sizes <= max(10.0 * sizes[-1], _NO_FORCE * self._terms(i, value))
        return np.asarray(vectors[is_shape].conj())

    def _terms(self, i: int, value: complex) -> float:
        """Return the size of the terms in the equations for an eigenvalue, 1/s²."""
        stiffness, damping = (
            np.abs(matrix[i]).max(initial=0.0) for matrix in (self.stiffness, self.damping)
        )
        return float(max(abs(value) ** 2 + abs(value) * damping + stiffness, self.weights, 1e-300))

    @property
    def whole_shapes(self) -> Complex:
        """Return the amplitudes of the rotor and all pitches, (speeds, n, 1 + blades).

        A pitch that does not move has the amplitude 0.
        """
        whole = np.zeros((len(self.speeds), len(self.coordinates), 1 + self.blades), dtype=complex)
        columns = [
            0 if name == "rotor" else int(name.rpartition(" ")[2]) for name in self.coordinates
        ]
        whole[:, :, columns] = self.shapes
        return whole

    @property
    def multiblade_shapes(self) -> Complex:
        """Return the amplitudes of rotor and multiblade coordinates, (speeds, n, 1 + blades)."""
        return multiblade_shapes(self.whole_shapes)

    @property
    def nodal_diameters(self) -> NDArray[np.int64]:
        """Return the number of nodal diameters of each mode, (n,); see `whirl.nodal_diameters`."""
        return nodal_diameters(self.whole_shapes)

    @property
    def whirl(self) -> tuple[Array, Array]:
        """Return the backward and forward whirl frequencies of each mode, (speeds, n) rad/s.

        The frequencies are those in the fixed frame, and NaN for a mode that does not whirl.
        """
        shapes, values = self.whole_shapes, self.eigenvalues[..., 0]
        return whirl(shapes, values, self.damped_frequencies, self.speeds)

    @property
    def fixed_frame(self) -> FixedFrame | str:
        """Return the motions in both frames, or the reason why whirl is not defined."""
        return fixed_frame(self.names, self.whole_shapes, self.damped_frequencies, self.speeds)


@dataclass(frozen=True)
class FloquetTable:
    """Hold the Floquet multipliers of a turn under gravity over speed.

    Attributes
    ----------
    speeds : (speeds,) rotor speeds, rad/s.
    multipliers : (speeds, 2n) all multipliers.
    largest : (speeds,) largest modulus of the multipliers that are not always 1.
    stable : (speeds,) 1 if the motion is stable, 0 if it is unstable, -1 if no periodic motion was
        found.
    product_error : (speeds,) logarithm of the modulus of the product of all multipliers, minus the
        integrated trace. It would be zero without errors, and is NaN where rounding hides it.
    torque : (speeds,) constant torque on the rotor that maintains its mean speed, N m.
    mismatch : (speeds,) largest difference between the states at the end and at the start of the
        turn: angles in rad, rates divided by the rotor speed.
    messages : for each speed the reason why no motion was found; "" if one was.
    """

    speeds: Array
    multipliers: Complex
    largest: Array
    stable: NDArray[np.int64]
    product_error: Array
    torque: Array
    mismatch: Array
    messages: tuple[str, ...] = ()

    @property
    def growth_rates(self) -> Array:
        """Return the growth rate that follows from the largest multiplier, (speeds,) 1/s."""
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(self.largest) * np.abs(self.speeds) / (2.0 * np.pi))


@dataclass(frozen=True)
class SceneModes:
    """Hold the modes of a scene by model, the closed form first.

    Attributes
    ----------
    scene, scene_hash, title, blades, gravity : name, digest, title, number of blades and gravity
        (m/s²) of the scene.
    rest, rotation : modes at rest under gravity, and in steady rotation without gravity, by model.
    floquet : Floquet multipliers of a turn under gravity; None if they were not computed.
    notes : reasons for missing results.
    label : name of the scene; for a changed shipped scene it also has the changes.
    """

    scene: str
    scene_hash: str
    title: str
    blades: int
    gravity: float
    rest: Mapping[str, LinearModes] = field(default_factory=dict)
    rotation: Mapping[str, LinearModes] = field(default_factory=dict)
    floquet: FloquetTable | None = None
    notes: tuple[str, ...] = ()
    label: str = ""

    @property
    def disagreement(self) -> float:
        """Return the largest difference between the closed form and another model.

        The value is 0 if there is only one model. Two numbers of each mode are compared: the larger
        modulus of its two eigenvalues, and their mean real part. Their differences are divided by
        the largest eigenvalue of all modes. Eigenvalues below a thousandth of the largest are not
        compared. Instead, the closed form's mode is inserted into the equations of the other model,
        and its residual counts as the difference, see `LinearModes.residual`.
        """
        largest = 0.0
        for kind in (self.rest, self.rotation):
            sources = list(kind.values())
            for other in sources[1:]:
                largest = max(largest, _difference(sources[0], other))
        return largest

    @property
    def residuals(self) -> dict[str, float]:
        """Return, by model, the largest residual of its modes in its own equations."""
        residuals: dict[str, float] = {}
        for kind in (self.rest, self.rotation):
            for model, source in kind.items():
                residuals[model] = max(residuals.get(model, 0.0), source.residual)
        return residuals

    @property
    def agrees(self) -> bool:
        """Return whether the models agree, and the modes of each satisfy its own equations."""
        return self.disagreement <= AGREEMENT and not self.faults

    @property
    def faults(self) -> list[str]:
        """Return a line for each model whose modes do not satisfy its own equations.

        The modes of such a model have a residual above PRINTED_PRECISION.
        """
        lines = []
        for model, residual in self.residuals.items():
            if not residual <= PRINTED_PRECISION:
                lines.append(
                    f"{model}: its modes leave {residual:.1e} of its own linearized equations"
                )
        return lines

    @property
    def closed_form(self) -> list[LinearModes]:
        """Return the modes of the closed form at rest and in rotation, if they were computed."""
        return [next(iter(kind.values())) for kind in (self.rest, self.rotation) if kind]


def _difference(first: LinearModes, other: LinearModes) -> float:
    """Return the largest difference between the modes of two models.

    The difference is defined in `SceneModes.disagreement`.

    Parameters
    ----------
    first, other : modes of two models, at the same speeds and in the same order. Slow modes of
        `first` are inserted into the equations of `other`.
    """
    sizes = np.abs(first.eigenvalues)  # (speeds, modes, 2)
    top = float(np.nanmax(sizes, initial=0.0))
    numbers = []
    for source in (first, other):
        numbers.append(
            np.stack([np.abs(source.eigenvalues).max(axis=2), source.eigenvalues.real.mean(axis=2)])
        )
    is_fast = sizes.max(axis=2) > _SLOW * top
    largest = (
        float(np.nanmax(np.abs(numbers[1] - numbers[0])[:, is_fast], initial=0.0)) / top
        if top
        else 0.0
    )
    for i in range(len(first.speeds)):
        if not (np.isfinite(first.stiffness[i]).all() and np.isfinite(other.stiffness[i]).all()):
            continue
        for value in first.eigenvalues[i].ravel().tolist():
            if abs(value) <= _SLOW * top:
                residuals = [
                    other.residual_of(i, value, shape) for shape in first.shapes_of(i, value)
                ]
                largest = max(largest, *residuals)
    return largest


def mode_rows(modes: SceneModes) -> list[dict[str, object]]:
    """Return a row for each state, speed and mode of the closed form.

    Speeds and frequencies are in rad/s, growth rates in 1/s. A number that does not exist is None.
    Whirl frequencies are in the fixed frame, all other frequencies in the rotating frame.

    Parameters
    ----------
    modes : modes of a scene.
    """
    rows: list[dict[str, object]] = []
    for linear in modes.closed_form:
        backward, forward = linear.whirl
        numbers = {
            "undamped_frequency": linear.undamped_frequencies,
            "damped_frequency": linear.damped_frequencies,
            "damping_ratio": linear.damping_ratios,
            "growth_rate": linear.growth_rates,
            "backward_whirl_frequency": backward,
            "forward_whirl_frequency": forward,
        }
        state = "at rest" if linear.kind == REST else "steady rotation without gravity"
        for i, speed in enumerate(linear.speeds.tolist()):
            for k, name in enumerate(linear.names):
                # None replaces NaN and infinity, which JSON does not have.
                shown = {
                    key: float(a[i, k]) if math.isfinite(a[i, k]) else None
                    for key, a in numbers.items()
                }
                rows.append({"state": state, "speed": speed, "mode": name, **shown})
    return rows


def mode_table(rows: Sequence[Mapping[str, object]]) -> TextTable:
    """Return a table of modes, in which damped frequencies are in rad/s and in Hz.

    Parameters
    ----------
    rows : rows as `mode_rows` returns them.
    """
    head = (
        "state",
        "speed (rad/s)",
        "mode",
        "undamped (rad/s)",
        "damped (rad/s)",
        "damped (Hz)",
        "damping ratio",
        "growth (1/s)",
    )

    def cell(value: object) -> str:
        return f"{value:.6g}" if isinstance(value, float) else "" if value is None else str(value)

    cells = []
    for row in rows:
        damped = row["damped_frequency"]
        hertz = damped / math.tau if isinstance(damped, float) else None
        # A shorter text of the state, so that the table fits the width of a screen.
        state = "at rest" if row["state"] == "at rest" else "rotating, no gravity"
        shown = state, row["speed"], row["mode"], row["undamped_frequency"], damped, hertz
        cells.append(tuple(map(cell, (*shown, row["damping_ratio"], row["growth_rate"]))))
    return TextTable(head, cells)


def campbell_table(linear: LinearModes, places: Sequence[int] | None = None) -> TextTable:
    """Return a table of frequencies in Hz over the rotor speed in rpm.

    The table has a row for each speed and motion, with the frequencies in both frames. Its column
    "per rev" is the frequency in the fixed frame, divided by the rotor speed. If whirl is not
    defined, the table has a row for each speed and mode, with the frequency in the rotating frame
    only, and "per rev" is this frequency, divided by the rotor speed.

    Parameters
    ----------
    linear : modes over speed.
    places : indices of the speeds that are shown; None for all speeds.
    """
    frame = linear.fixed_frame
    speeds = linear.speeds
    shown = range(len(speeds)) if places is None else places
    if isinstance(frame, str):
        frequencies = linear.damped_frequencies * HERTZ
        rows = []
        for i in shown:
            for k, name in enumerate(linear.names):
                cells = (
                    speeds[i] * RPM,
                    frequencies[i, k],
                    _multiple(frequencies[i, k], speeds[i]),
                )
                rows.append((f"{cells[0]:.6g}", name, *map(_printed, cells[1:])))
        return TextTable(("speed (rpm)", "mode", "rotating frame (Hz)", "per rev"), rows)
    rows = []
    for i in shown:
        for k, name in enumerate(frame.names):
            fixed = frame.fixed[i, k] * HERTZ
            diameter = str(abs(int(frame.diameters[k])))
            numbers = frame.rotating[i, k] * HERTZ, fixed, _multiple(fixed, speeds[i])
            share = frame.rotor_share[i, k]
            rows.append(
                (f"{speeds[i] * RPM:.6g}", name, diameter, *map(_printed, numbers), _printed(share))
            )
    head = (
        "speed (rpm)",
        "motion",
        "nodal diameters",
        "rotating frame (Hz)",
        "fixed frame (Hz)",
        "per rev",
        "rotor/pitch",
    )
    return TextTable(head, rows)


def _multiple(hertz: float, speed: float) -> float:
    """Return a frequency (Hz) as a multiple of the rotor speed (rad/s); NaN at rest."""
    return hertz / (abs(speed) * HERTZ) if speed else math.nan


def _printed(value: float) -> str:
    """Return a number as text with six digits; "" if it is not finite."""
    return f"{value:.6g}" if math.isfinite(value) else ""


@np.errstate(all="ignore")
def mode_summary(modes: SceneModes) -> str:
    """Return a text with the modes of a scene, its stability, and whether models agree.

    The text has the modes at rest, and those at the lowest and highest speed.

    Parameters
    ----------
    modes : modes of a scene.
    """
    rows = mode_rows(modes)
    ends = {
        linear.speeds[place] for linear in list(modes.rotation.values())[:1] for place in (0, -1)
    }
    shown = [row for row in rows if row["state"] == "at rest" or row["speed"] in ends]
    lines = [f"{modes.label}: {modes.title}"]
    if shown:
        lines += ["", str(mode_table(shown[:_SHOWN_ROWS]))]
    if len(shown) > _SHOWN_ROWS:
        lines.append(f"... {len(shown) - _SHOWN_ROWS} more rows")
    for linear in list(modes.rotation.values())[:1]:
        places = sorted({0, len(linear.speeds) - 1})
        table = campbell_table(linear, places)
        lines += ["", str(TextTable(table.head, table.rows[:_SHOWN_ROWS]))]
        if len(table.rows) > _SHOWN_ROWS:
            lines.append(f"... {len(table.rows) - _SHOWN_ROWS} more rows")
        frame = linear.fixed_frame
        lines.append(f"fixed frame: {frame}" if isinstance(frame, str) else _FREE_SHAFT)
    if modes.floquet is not None:
        stable = modes.floquet.stable
        unstable, unknown = int((stable == 0).sum()), int((stable == -1).sum())
        where = f"unstable in rotation under gravity at {unstable} of"
        if not unstable and not unknown:
            where = "stable in rotation under gravity at all"
        if unknown:
            where = where.replace(" of", f", unknown at {unknown} of")
        lines.append(f"{where} {len(stable)} speeds")
    models = list(dict.fromkeys((*modes.rest, *modes.rotation)))
    if len(models) > 1:
        verdict = "agree" if modes.agrees else "DISAGREE"
        differ = f"modes differ by at most {modes.disagreement:.1e} of the largest eigenvalue"
        lines.append(f"{', '.join(models)} {verdict}: {differ}")
    lines += modes.faults
    for note in modes.notes:
        lines += textwrap.wrap(note, _NOTE_WIDTH, subsequent_indent="  ")
    return "\n".join(lines)


# Records of a results file

_SCALES = {
    "speed": Column(("speed",), "rad/s", "rotor speed"),
    "mode": Column(("mode",), "1", "number of the mode"),
    "coordinate": Column(("coordinate",), "1", "coordinate with inertia"),
    "component": Column(("component",), "1", "rotor and multiblade coordinates"),
    "equation": Column(
        ("equation",), "1", "equation of motion, of the coordinate with the same number"
    ),
    "root": Column(("root",), "1", "number of the eigenvalue of a mode, 0 or 1"),
    "motion": Column(("motion",), "1", "number of the motion in the fixed frame"),
    "multiplier": Column(("multiplier",), "1", "number of the multiplier, the largest first"),
}
# Declaration of the arrays in a group of a file, for writing and for reading. For each array name
# it has the path of the array in the stored object (see `_part`), and a description. The values of
# a scale are numbers from 0, except for the speeds.
Declared: TypeAlias = Mapping[str, tuple[str, Column]]

_mode = partial(Column, ("speed", "mode"))
_root = partial(Column, ("speed", "mode", "root"))
_place = partial(Column, ("speed", "mode", "coordinate"))
_component = partial(Column, ("speed", "mode", "component"))
_entry = partial(Column, ("speed", "equation", "coordinate"))
_LINEAR: Declared = {
    "steady_angle": (
        "angles",
        Column(("speed", "coordinate"), "rad", "angle at the steady state"),
    ),
    "undamped_frequency": (
        "undamped_frequencies",
        _mode("rad/s", "undamped frequency, in the rotor's frame"),
    ),
    "damped_frequency": (
        "damped_frequencies",
        _mode("rad/s", "damped frequency, in the rotor's frame"),
    ),
    "damping_ratio": ("damping_ratios", _mode("1", "damping ratio")),
    "growth_rate": ("growth_rates", _mode("1/s", "largest real part of the mode's eigenvalues")),
    "backward_whirl_frequency": (
        "whirl.0",
        _mode("rad/s", "damped frequency in the fixed frame, seen as a backward whirl"),
    ),
    "forward_whirl_frequency": (
        "whirl.1",
        _mode("rad/s", "damped frequency in the fixed frame, seen as a forward whirl"),
    ),
    "eigenvalue_real": ("eigenvalues.real", _root("1/s", "eigenvalue, real part")),
    "eigenvalue_imag": ("eigenvalues.imag", _root("1/s", "eigenvalue, imaginary part")),
    "shape_real": ("shapes.real", _place("1", "mode shape, real part, largest entry 1")),
    "shape_imag": ("shapes.imag", _place("1", "mode shape, imaginary part")),
    "multiblade_shape_real": (
        "multiblade_shapes.real",
        _component("1", "multiblade mode shape, real part"),
    ),
    "multiblade_shape_imag": (
        "multiblade_shapes.imag",
        _component("1", "multiblade mode shape, imaginary part"),
    ),
    "stiffness": ("stiffness", _entry("1/s^2", "inverse mass matrix times stiffness matrix")),
    "damping": (
        "damping",
        _entry("1/s", "inverse mass matrix times damping and gyroscopic matrix"),
    ),
    "nodal_diameter": (
        "nodal_diameters",
        Column(("mode",), "1", "nodal diameters of the mode shape, -1: several", "<i8"),
    ),
}
# Descriptions of the arrays of modes, by name.
MODE_COLUMNS = {"speed": _SCALES["speed"]} | {name: column for name, (_, column) in _LINEAR.items()}
_motion = partial(Column, ("speed", "motion"))
_FIXED_FRAME: Declared = {
    "motion_diameter": (
        "fixed_frame.diameters",
        Column(("motion",), "1", "nodal diameters, below 0: backward whirl", "<i8"),
    ),
    "rotating_frame_frequency": (
        "fixed_frame.rotating",
        _motion("rad/s", "damped frequency of the motion in the rotating frame"),
    ),
    "fixed_frame_frequency": (
        "fixed_frame.fixed",
        _motion("rad/s", "damped frequency of the motion in the fixed frame"),
    ),
    "rotor_share": (
        "fixed_frame.rotor_share",
        _motion("1", "amplitude of the rotor's angle over the largest of the pitches"),
    ),
}
_speed = partial(Column, ("speed",))
_multiplier = partial(Column, ("speed", "multiplier"))
_FLOQUET: Declared = {
    "multiplier_real": ("multipliers.real", _multiplier("1", "Floquet multiplier, real part")),
    "multiplier_imag": (
        "multipliers.imag",
        _multiplier("1", "Floquet multiplier, imaginary part"),
    ),
    "largest_multiplier": (
        "largest",
        _speed("1", "largest modulus, without multipliers that are always 1"),
    ),
    "growth_rate": (
        "growth_rates",
        _speed("1/s", "growth rate that follows from the largest multiplier"),
    ),
    "stable": (
        "stable",
        _speed("1", "1: no multiplier above 1, 0: a multiplier above 1, -1: unknown"),
    ),
    "product_error": (
        "product_error",
        _speed("1", "logarithm of the product of the multipliers minus the integrated trace"),
    ),
    "torque": ("torque", _speed("N m", "torque on the rotor that maintains its mean speed")),
    "mismatch": ("mismatch", _speed("rad", "error of periodicity after a revolution")),
}


def _part(stored: LinearModes | FloquetTable, path: str) -> NDArray[Any]:
    """Return an array of an object by its path, such as `stored.whirl[1]` for "whirl.1".

    Parameters
    ----------
    stored : the object that is stored: modes or multipliers.
    path : names of attributes and indices of entries, joined by dots.
    """
    value: Any = stored
    for name in path.split("."):
        value = value[int(name)] if name.isdigit() else getattr(value, name)
    return np.asarray(value)


def _record(
    scene: str,
    name: str,
    attributes: Mapping[str, Any],
    stored: LinearModes | FloquetTable,
    declared: Declared,
) -> Record:
    """Return a record of modes or multipliers: the scales, then the declared arrays.

    Parameters
    ----------
    scene, name : scene and name of the record.
    attributes : attributes of the record.
    stored : the object from which the arrays are taken.
    declared : declaration of the arrays.
    """
    arrays: dict[str, NDArray[Any]] = {}
    lengths: dict[str, int] = {}
    for array, (path, column) in declared.items():
        arrays[array] = _part(stored, path)
        lengths |= zip(column.dimensions, arrays[array].shape, strict=True)
    scales = {scale: np.arange(lengths[scale]) for scale in _SCALES if scale in lengths}
    columns = {scale: _SCALES[scale] for scale in scales}
    columns |= {array: column for array, (_, column) in declared.items()}
    return Record(
        MODES, scene, name, attributes, scales | {"speed": stored.speeds} | arrays, columns
    )


def _stored_fields(
    cls: type[LinearModes] | type[FloquetTable],
    arrays: Mapping[str, NDArray[Any]],
    declared: Declared,
) -> dict[str, Any]:
    """Return the fields of a stored object that are arrays, by name, from the arrays of a record.

    Parameters
    ----------
    cls : class of the stored object. Arrays of the record that are not fields of the class are left
        out: they are properties, which follow from the fields.
    arrays : arrays of the record, by name.
    declared : the declaration with which the record was written.
    """
    names = {field.name for field in fields(cls)}
    values: dict[str, Any] = {"speeds": arrays["speed"]}
    for array, (path, _) in declared.items():
        name, _, part = path.partition(".")
        if name in names:
            values[name] = values[name] + 1j * arrays[array] if part == "imag" else arrays[array]
    return values


def to_records(modes: SceneModes) -> list[Record]:
    """Return the records that store the modes of a scene.

    There is a record for each model at rest and in rotation, and one for the Floquet multipliers.

    Parameters
    ----------
    modes : modes of a scene.
    """
    common = {name: getattr(modes, name) for name in ("scene_hash", "title", "blades", "gravity")}
    common |= {"notes": "\n".join(modes.notes), "scene_label": modes.label}
    linear = [*modes.rest.values(), *modes.rotation.values()]
    records = [_linear_record(modes.scene, source, common) for source in linear]
    if modes.floquet is not None:
        facts = {**common, "messages": list(modes.floquet.messages)}
        records.append(_record(modes.scene, FLOQUET, facts, modes.floquet, _FLOQUET))
    return records


def _linear_record(scene: str, linear: LinearModes, common: Mapping[str, Any]) -> Record:
    """Return the record of the modes of one model.

    Parameters
    ----------
    scene : name of the scene.
    linear : modes of the model.
    common : attributes that all records of the scene have.
    """
    frame = linear.fixed_frame
    attributes = {
        **common,
        "label": linear.label,
        "mode_labels": list(linear.names),
        "symmetric": "rotor" in linear.names,
        "coordinate_labels": list(linear.coordinates),
        "component_labels": ["rotor", *multiblade(linear.blades)[0]],
        "messages": list(linear.messages),
        "weights": linear.weights,
    }
    declared = _LINEAR
    if linear.kind == ROTATION and isinstance(frame, FixedFrame):
        attributes["motion_labels"] = list(frame.names)
        declared = {**_LINEAR, **_FIXED_FRAME}
    return _record(scene, f"{linear.source}/{linear.kind}", attributes, linear, declared)


def linear_dataset(sources: Mapping[str, LinearModes], xarray: Any) -> Any:
    """Return the modes of all models as an xarray.Dataset, in which a model is a `solver`.

    Parameters
    ----------
    sources : modes at rest, or in rotation, by model.
    xarray : the module xarray.

    Raises
    ------
    InputError
        If `sources` is empty.
    """
    if not sources:
        raise InputError("no modes of this state; allowed: a state that was computed")
    sets = []
    for linear in sources.values():
        record = _linear_record("", linear, {})
        variables = {
            name: (
                column.dimensions,
                record.attributes.get(f"{name}_labels", record.arrays[name]),
                {"units": column.units, "long_name": column.long_name},
            )
            for name, column in record.columns.items()
        }
        coordinates = {name: value for name, value in variables.items() if value[0] == (name,)}
        data = {name: value for name, value in variables.items() if name not in coordinates}
        sets.append(xarray.Dataset(data, coords=coordinates))
    models = xarray.Variable("solver", list(sources), {"long_name": "model"})
    return xarray.concat(sets, models, join="override", combine_attrs="override")


def read_modes(path: Path) -> dict[str, SceneModes]:
    """Read all modes in the file at `path`, by scene.

    Raises
    ------
    StoreError
        If the file cannot be read or has no modes.
    """
    records = read_records(path, "modes")
    if not records:
        raise StoreError(
            f"{path}: no modes in it; allowed: a file that rotor-mbs modes has written"
        )
    with reading(path), np.errstate(all="ignore"):  # a file may hold any number
        return _modes_of(records)


def _modes_of(of_all: Sequence[Record]) -> dict[str, SceneModes]:
    """Return the modes that are stored in records, by scene, with the closed form first.

    Parameters
    ----------
    of_all : records of all scenes, as `to_records` returns them.
    """
    by_scene: dict[str, dict[str, Record]] = {}
    for record in of_all:
        by_scene.setdefault(record.scene, {})[record.name] = record
    modes_by_scene = {}
    for scene, records in by_scene.items():
        states: dict[str, dict[str, LinearModes]] = {REST: {}, ROTATION: {}}
        floquet = None
        for name in sorted(records, key=lambda name: name.partition("/")[0] != CLOSED_FORM):
            facts, arrays = records[name].attributes, records[name].arrays
            source, _, kind = name.partition("/")
            if name == FLOQUET:
                floquet = FloquetTable(
                    **_stored_fields(FloquetTable, arrays, _FLOQUET),
                    messages=tuple(map(str, facts["messages"])),
                )
            elif kind in states:
                states[kind][source] = LinearModes(
                    **_stored_fields(LinearModes, arrays, _LINEAR),
                    names=tuple(map(str, facts["mode_labels"])),
                    source=source,
                    label=str(facts["label"]),
                    kind=kind,
                    blades=int(facts["blades"]),
                    coordinates=tuple(map(str, facts["coordinate_labels"])),
                    weights=float(facts.get("weights", 0.0)),
                    messages=tuple(map(str, facts["messages"])),
                )
        facts = next(iter(records.values())).attributes
        modes_by_scene[scene] = SceneModes(
            scene=scene,
            scene_hash=str(facts["scene_hash"]),
            title=str(facts["title"]),
            blades=int(facts["blades"]),
            gravity=float(facts["gravity"]),
            rest=states[REST],
            rotation=states[ROTATION],
            floquet=floquet,
            notes=tuple(str(facts["notes"]).splitlines()),
            label=str(facts.get("scene_label", scene)),
        )
        # These computations raise an error here if the arrays do not fit together.
        assert isinstance(modes_by_scene[scene].agrees, bool)
        for linear in modes_by_scene[scene].closed_form:
            assert linear.fixed_frame
    return modes_by_scene
