"""What a scene's numbers must obey beyond their types. Knows no file format."""

from __future__ import annotations

from collections.abc import Collection, Sequence

# Principal moments may break the triangle inequality by this share of their sum: numbers typed with ten digits do so
# for a flat body, whose inequality is an equality. It is far above the round-off of the eigenvalues (1e-15).
INERTIA_TOLERANCE = 1e-9


def is_rigid_body_inertia(inertia: Sequence[float]) -> bool:
    """Whether some distribution of mass >= 0 has this tensor: xx yy zz xy xz yz about the centre of mass, kg m².

    That is so exactly where the second moments ∫r rᵀ dm = ½ tr(J) I - J are positive semidefinite: their eigenvalues
    are (J2 + J3 - J1)/2, so this is the triangle inequality of the principal moments, and it implies J >= 0.
    """
    if not any(inertia):
        return True
    import numpy as np  # late: a point mass, as in every scene of the paper, does without

    xx, yy, zz, xy, xz, yz = inertia
    if min(xx, yy, zz) < 0.0:
        return False
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) / max(abs(element) for element in inertia)
    trace = float(np.trace(J))
    return bool(np.linalg.eigvalsh(0.5 * trace * np.eye(3) - J)[0] >= -INERTIA_TOLERANCE * trace)


def torque_table_fault(rows: Sequence[Sequence[float]]) -> str | None:
    """What is wrong with the times (s) of rows (t, torque), or None; two rows with one time are a jump."""
    times = [row[0] for row in rows]
    if times[0] < 0.0:
        return "the first time is below 0"
    for i in range(1, len(times)):
        if times[i] < times[i - 1]:
            return f"the time of row {i + 1} is before that of row {i}"
        if i > 1 and times[i] == times[i - 2]:
            return f"rows {i - 1}, {i} and {i + 1} have one time"
    return None


def values_per_sample(blades: int, outputs: Collection[str]) -> int:
    """Doubles that a run holds per sample: time, angles and rates always, tip paths and energies where asked for."""
    energies = 4  # kinetic, potential, work, energy error
    return 1 + 2 * (1 + blades) + 3 * blades * ("tip" in outputs) + energies * ("energy" in outputs)
