"""The picture that a sweep file asks for, drawn from the stored runs when they are complete."""

from __future__ import annotations

from pathlib import Path

from rotor_mbs.analysis.sweep_numbers import spread_of, stability_map
from rotor_mbs.errors import StoreError
from rotor_mbs.report.plots.sweep import map_figure, spread_figure
from rotor_mbs.scenario.sweep import Sweep
from rotor_mbs.store.sweep_dataset import StoredSweep


def draw(sweep: Sweep, dataset: Path, path: Path) -> str:
    """Writes the picture to `path`; returns a line about it. Raises InputError, StoreError."""
    stored = StoredSweep(dataset)
    if sweep.picture == "spread":
        spread = spread_of(stored)
        text = spread_figure(spread, sweep.title)
        line = (
            f"largest Lyapunov exponent {spread.exponent:.3f} ± {spread.uncertainty:.3f} per s "
            f"({spread.pairs} pairs, {spread.start:.2f} to {spread.end:.2f} s)"
        )
    else:
        found = stability_map(stored, max(abs(angle) for angle in sweep.base.initial_angles[1:]))
        text = map_figure(found, sweep.title)
        line = f"the pitches grow tenfold in {found.unstable.sum()} of {found.growth.size} runs"
    try:
        path.write_text(text)
    except OSError as exc:
        raise StoreError(f"{path}: cannot be written: {exc.strerror}") from exc
    return f"{path}: {line}"
