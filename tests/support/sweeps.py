"""Sweeps made in this process: no pool is needed for a few runs."""

from __future__ import annotations

from pathlib import Path

from rotor_mbs.scenario.sweep import load_sweep
from rotor_mbs.store.sweep_dataset import SweepDataset
from rotor_mbs.studies.sweep import plan_sweep
from rotor_mbs.studies.sweep_work import rows_of

MAP = """title = "Speed & stiffness"
scene = "paper/fig06"
samples = 51
outputs = []
picture = "map"
[change]
"initial.angles[1]" = 1e-6
duration = 2
[[axis]]
key = "bearing.stiffness"
linear = {start = 500, end = 40000, count = 3}
[[axis]]
key = "initial.rates[0]"
linear = {start = 0.25, end = 20, count = 4}
"""


def made_sweep(folder: Path, text: str = MAP) -> Path:
    """The dataset of the sweep file `text`, complete."""
    (folder / "s.toml").write_text(text)
    plan = plan_sweep(load_sweep(folder / "s.toml"), (), (1, 1), 60.0)
    with SweepDataset(folder / "s.h5", plan.layout) as dataset:
        for chunk in plan.chunks(dataset.missing()):
            dataset.write(chunk.first, rows_of(chunk))
    return folder / "s.h5"
