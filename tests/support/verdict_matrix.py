"""Right and wrong data of the paper's scenes in every format and precision: the verdicts, as a
table.

    python tests/support/verdict_matrix.py [SECONDS] > matrix.md

The verdict depends on the numbers alone. It is computed once for each scene, precision, and with or
without rates; of every format it is shown that the numbers come out of it as they went in.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import rotor_mbs as rm
from rotor_mbs.comparison.data import data_of_table, load_data
from rotor_mbs.comparison.formats import read_in_worker
from rotor_mbs.scenario.catalogue import list_scenes
from rotor_mbs.scenario.scene import Scene
from support import references
from support.random_tables import FILES, write_table

Array = Any
PRECISIONS = ("float64", "float32", "6 digits")
WRONG_GRAVITY = 1.01  # a factor, which 6 digits of two seconds show
UNMOVED, DRIFT = 1e-9, 1e-3  # rad


def in_precision(values: Array, precision: str) -> Array:
    """Numbers as they come back from a file of this precision."""
    if precision == "float32":
        return values.astype(np.float32)
    if precision == "6 digits":
        return np.vectorize(lambda number: float(f"{number:.5e}"))(values)
    return values


def motions(name: str, seconds: float) -> Iterator[tuple[str, Scene, Array, Array, Array]]:
    """The right motion of a scene, its reference, and one in another gravity: what, scene, time,
    angles, rates."""
    shipped = rm.scene(name)
    exact = references.reference(name)
    duration = min(seconds, shipped.duration)
    rows = exact.time <= duration * (1.0 + 1e-9)
    scene = shipped.replace(duration=float(exact.time[rows][-1]), samples=int(rows.sum()))
    yield "right", scene, exact.time[rows], exact.angles[rows], exact.rates[rows]
    run = rm.run(scene.replace(gravity=WRONG_GRAVITY * scene.gravity), "lagrange/dop853")
    time, angles, rates = run.time, run.angles.copy(), run.rates.copy()
    if np.abs(angles - exact.angles[rows]).max() < UNMOVED:
        # Of a balanced rotor without pitch gravity moves nothing: there the rotor drifts off.
        angles[:, 0] += DRIFT * (1.0 - np.cos(time))
        rates[:, 0] += DRIFT * np.sin(time)
    yield "wrong", scene, time, angles, rates


def rows_of(name: str, seconds: float) -> Iterator[tuple[str, ...]]:
    """Yield a row for each precision, with and without rates: the verdicts, and formats with other
    numbers."""
    folder = Path(tempfile.mkdtemp())
    cells: dict[tuple[str, str], dict[str, str]] = {}
    others: dict[tuple[str, str], list[str]] = {}
    for what, scene, time, angles, rates in motions(name, seconds):
        for precision in PRECISIONS:
            for with_rates in (True, False):
                # Times of equal steps are exact in any precision but the single one.
                times = time.astype(np.float32) if precision == "float32" else time
                arrays = {"time": times, "angles": in_precision(angles, precision)}
                if with_rates:
                    arrays["rates"] = in_precision(rates, precision)
                key = (precision, "with rates" if with_rates else "angles alone")
                verdict = rm.compare(arrays, scene).verdict
                cause = (
                    ""
                    if verdict.status == "ok"
                    else f" ({verdict.likely[0] if verdict.likely else 'no cause'})"
                )
                cells.setdefault(key, {})[what] = f"{verdict.status}{cause}"
                if what == "wrong":
                    continue
                expected = load_data(arrays, scene)
                for kind in FILES:
                    # Text of a number in single precision is another number: it has the digits that
                    # tell it apart.
                    of_text = {name: values.astype(float) for name, values in arrays.items()}
                    is_text = kind in ("csv", "txt", "jsonl")
                    path = write_table(folder, kind, of_text if is_text else arrays)
                    read = data_of_table(read_in_worker((path, "", scene.name)), scene)
                    are_equal = read.columns == expected.columns and np.array_equal(
                        read.values, expected.values
                    )
                    if not (are_equal and np.array_equal(read.rounding, expected.rounding)):
                        others.setdefault(key, []).append(kind)
    for key, statuses in cells.items():
        yield (
            name,
            *key,
            statuses["right"],
            statuses["wrong"],
            ", ".join(others.get(key, [])) or "none",
        )


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else np.inf
    print("| scene | numbers | columns | right data | wrong data | formats with other numbers |")
    print("|---|---|---|---|---|---|")
    names = sys.argv[2:] or [name for name, _ in list_scenes() if name.startswith("paper/")]
    for name in names:
        for row in rows_of(name, seconds):
            print("|", " | ".join(row), "|", flush=True)


if __name__ == "__main__":
    main()
