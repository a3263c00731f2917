"""Files for the publication of a sweep's dataset.

    STEM.croissant.json   Croissant metadata: the variables of the dataset, with types and units
    FOLDER/train.h5 ...   a file with the runs of each split, for the library `datasets`
    FOLDER/README.md      the dataset card, which names the files of the splits

The files name no licence: the publisher of the dataset chooses one.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from datetime import date
from pathlib import Path

import jinja2
import numpy as np

from rotor_mbs.runs.design import MISSING
from rotor_mbs.runs.hdf5 import Column
from rotor_mbs.runs.layout import KEYWORDS, new_file
from rotor_mbs.runs.output_files import replace_file
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.runs.trailer import SPLIT_OF, may_extend
from rotor_mbs.scenario.sweep import SPLITS
from rotor_mbs.solution.status import STATUSES

# Patterns that every Croissant file and every dataset card of this module contain. A file without
# the pattern is not an earlier output, and is not replaced.
_CROISSANT = rb'"conformsTo": "http://mlcommons.org/croissant/1.0"[^\0]*"Euler-Lagrange equations"'
_CARD = rb"\A---\npretty_name: [^\0]*Euler-Lagrange equations"
_TEMPLATES = jinja2.Environment(
    loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
    trim_blocks=True,
    keep_trailing_newline=True,
)


def describe(path: Path | str) -> Path:
    """Write the Croissant file beside the dataset at `path`, and return its path.

    Raises
    ------
    StoreError
        If `path` is not a sweep's dataset.
    """
    path = Path(path)
    place, stored = path.with_suffix(".croissant.json"), StoredSweep(path)
    columns = _of_runs(stored)
    facts = {
        "path": path,
        "today": date.today().isoformat(),
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "kinds": {name: stored.column(name).dtype.kind for name in columns},
    }
    text = _text("croissant.json.j2", stored, columns, facts)
    replace_file(place, text.encode(), _CROISSANT)
    return place


def write_splits(path: Path | str, folder: Path) -> list[Path]:
    """Write a dataset as a folder for `datasets.load_dataset(folder)` of Hugging Face.

    `load_dataset` reads each variable of an HDF5 file as a column, and all columns must have the
    same number of rows. Therefore each split is a separate file, and its scales are left out. Only
    the time is kept, repeated in every row. Missing runs are left out; runs that failed are
    written, with their status. Each file is made in memory.

    Parameters
    ----------
    path : path of a sweep's dataset.
    folder : folder for the files, created if it does not exist. Earlier outputs of this function
        are replaced.

    Returns
    -------
    list of Path
        A file for each split that has runs, then the dataset card. If the dataset has no splits,
        all runs are in "train.h5".

    Raises
    ------
    StoreError, InputError
        If `path` is not a sweep's dataset, if a file cannot be written, or if a file exists that is
        not an earlier output.
    """
    stored = StoredSweep(Path(path))
    columns = _of_runs(stored)
    is_there = np.asarray(stored.column("status")) != MISSING
    marks = stored.column("split") if "split" in columns else np.zeros(len(is_there), np.int8)
    files, kind = [], f"{SPLIT_OF}{Path(path).name}"
    for code, split in enumerate(SPLITS):
        rows = np.flatnonzero(is_there & (marks == code))
        if not len(rows):
            continue
        files.append(folder / f"{split}.h5")
        may_extend(files[-1], kind)
        with new_file(files[-1], kind) as file:
            for name, column in columns.items():
                values = stored.column(name)[rows]
                if values.dtype.kind == "S":  # characters are joined: one value a row
                    values = np.ascontiguousarray(values).view(f"S{values.shape[1]}")[:, 0]
                variable = file.create_dataset(name, data=values)
                variable.attrs.update(units=column.units, long_name=column.long_name)
            if "time" in stored.columns:
                # `load_dataset` knows no scales, so each row has the times of its samples.
                time = np.broadcast_to(
                    stored.column("time"), (len(rows), len(stored.column("time")))
                )
                variable = file.create_dataset("time", data=time)
                variable.attrs.update(units="s", long_name="time, the same in all runs")
    card = folder / "README.md"
    if "time" in stored.columns:
        columns["time"] = Column(("run", "time"), "s", "time, the same in all runs")
    facts = {
        "splits": [file.stem for file in files],
        "time": stored.column("time") if "time" in stored.columns else (),
        "codes": {"status": STATUSES, "method_code": stored.methods, "split": SPLITS},
    }
    replace_file(card, _text("dataset-card.md.j2", stored, columns, facts).encode(), _CARD)
    return [*files, card]


def _of_runs(stored: StoredSweep) -> dict[str, Column]:
    """Return the columns that have a value for each run, by name."""
    return {
        name: column for name, column in stored.columns.items() if column.dimensions[0] == "run"
    }


def _text(
    template: str, stored: StoredSweep, columns: Mapping[str, Column], facts: Mapping[str, object]
) -> str:
    return _TEMPLATES.get_template(template).render(
        attributes=stored.attributes, columns=columns, keywords=KEYWORDS, **facts
    )
