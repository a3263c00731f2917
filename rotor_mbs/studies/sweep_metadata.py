"""A sweep's dataset for those who find it without its maker: Croissant, and a folder for `datasets`.

    STEM.croissant.json        the variables of the dataset, with types and units
    FOLDER/train.h5 ...        the runs of each split, and FOLDER/README.md, the dataset card, which names them
No licence is named: whoever publishes a dataset chooses one.
"""

from __future__ import annotations

import hashlib
import json
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.runs.files import KEYWORDS, new_file, replace_file
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.runs.table import MISSING
from rotor_mbs.scenario.sweep import SPLITS
from rotor_mbs.solution.status import STATUSES

# What is found in every file of a kind.
_CROISSANT = rb'"conformsTo": "http://mlcommons.org/croissant/1.0"[^\0]*"Euler-Lagrange equations"'
_CARD = rb"\A---\npretty_name: [^\0]*Euler-Lagrange equations"
_CONTEXT = Path(__file__).parent / "templates" / "croissant-context.json"


def describe(path: Path | str) -> Path:
    """Write the Croissant file beside the dataset at `path`; its path. Raises StoreError where it is no sweep's."""
    path = Path(path)
    place = path.with_suffix(".croissant.json")
    text = json.dumps(_croissant(path, StoredSweep(path)), indent=1) + "\n"
    replace_file(place, text.encode(), _CROISSANT)
    return place


def write_splits(path: Path | str, folder: Path) -> list[Path]:
    """Write the dataset at `path` as a folder that `datasets.load_dataset(folder)` of Hugging Face reads.

    That reader takes each variable of an HDF5 file for a column, and wants one number of rows in all of them: each
    split is a file of its own, without the scales. Runs that are missing are left out; those that failed have their
    status. A split is held in memory while it is written.

    Parameters
    ----------
    path : a sweep's dataset.
    folder : made where it does not exist; its files are replaced where they are earlier ones of this function.

    Returns
    -------
    The files: one for each split that has runs, "train.h5" where runs are not marked, and the card.

    Raises
    ------
    StoreError, InputError
        Where `path` is no sweep's dataset, or a file cannot be written, or is not an earlier output.
    """
    stored = StoredSweep(Path(path))
    columns = {name: column for name, column in stored.columns.items() if column.dimensions[0] == "run"}
    is_there = np.asarray(stored.column("status")) != MISSING
    marks = stored.column("split") if "split" in columns else np.zeros(len(is_there), np.int8)
    files = []
    for code, split in enumerate(SPLITS):
        rows = np.flatnonzero(is_there & (marks == code))
        if not len(rows):
            continue
        files.append(folder / f"{split}.h5")
        with new_file(files[-1]) as file:
            for name, column in columns.items():
                values = stored.column(name)[rows]
                if values.dtype.kind == "S":  # a text is one value there
                    values = np.ascontiguousarray(values).view(f"S{values.shape[1]}")[:, 0]
                variable = file.create_dataset(name, data=values)
                variable.attrs.update(units=column.units, long_name=column.long_name)
    card = folder / "README.md"
    replace_file(card, _card(stored, [file.stem for file in files]).encode(), _CARD)
    return [*files, card]


def _card(stored: StoredSweep, splits: list[str]) -> str:
    """The dataset card: what the loader reads, and what a reader wants to know."""
    title, summary = json.dumps(stored.attributes["title"]), stored.attributes["summary"]
    time = stored.column("time") if "time" in stored.columns else np.empty(0)
    lines = ["---", f"pretty_name: {title}", "configs:", "- config_name: default", "  data_files:"]
    for split in splits:
        lines += [f"  - split: {split}", f"    path: {split}.h5"]
    lines += ["---", "", f"# {stored.attributes['title']}", "", summary, ""]
    if len(time):
        lines += [f"{len(time)} samples, equally spaced from {time[0]:g} to {time[-1]:g} s.", ""]
    lines += ["| variable | dimensions | unit | |", "|---|---|---|---|"]
    for name, column in stored.columns.items():
        if column.dimensions[0] == "run":
            lines.append(f"| `{name}` | {', '.join(column.dimensions)} | {column.units} | {column.long_name} |")
    lines += ["", "Codes count from 0 in these lists:", ""]
    for name, meanings in {"status": STATUSES, "method_code": stored.methods, "split": SPLITS}.items():
        if name in stored.columns:
            lines.append(f"- `{name}`: {', '.join(meanings)}")
    lines += ["", f"Computed with `rotor-mbs sweep`: {KEYWORDS}.", ""]
    return "\n".join(lines)


def _croissant(path: Path, stored: StoredSweep) -> dict[str, Any]:
    """The variables with a run in front as fields of one record set, a record a run."""
    kinds = {"f": "sc:Float", "i": "sc:Integer", "u": "sc:Integer", "S": "sc:Text"}
    fields = [
        {
            "@type": "cr:Field",
            "@id": f"runs/{name}",
            "name": name,
            "description": f"{column.long_name} [{column.units}], dimensions {' x '.join(column.dimensions)}",
            "dataType": kinds[stored.column(name).dtype.kind],
            "source": {"fileObject": {"@id": path.name}, "extract": {"column": name}},
        }
        for name, column in stored.columns.items()
        if column.dimensions[0] == "run"
    ]
    return {
        "@context": json.loads(_CONTEXT.read_text(encoding="utf-8")),
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": path.stem,
        "description": stored.attributes["summary"],
        "keywords": KEYWORDS.split(", "),
        "datePublished": date.today().isoformat(),
        "version": "1.0.0",
        "distribution": [
            {
                "@type": "cr:FileObject",
                "@id": path.name,
                "name": path.name,
                "contentUrl": path.name,
                "contentSize": f"{path.stat().st_size} B",
                "encodingFormat": "application/x-hdf5",
                "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
            }
        ],
        "recordSet": [{"@type": "cr:RecordSet", "@id": "runs", "name": "runs", "field": fields}],
    }
