"""A sweep's dataset for those who find it without its maker: Croissant, statistics, and a folder for `datasets`.

    STEM.croissant.json        the variables of the dataset, with types and units
    STEM.statistics.json       mean, deviation and range of every variable over the training runs that are ok
    FOLDER/train.h5 ...        the runs of each split, and FOLDER/README.md, the dataset card, which names them
No licence is named: whoever publishes a dataset chooses one.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.runs.files import KEYWORDS, new_file, replace_file
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.runs.table import MISSING
from rotor_mbs.scenario.sweep import SPLITS
from rotor_mbs.solution.status import GOOD, STATUSES, code_of

_PIECE = 1 << 24  # bytes of a variable that are read at once
# What is found in every file of a kind.
_CROISSANT = rb'"conformsTo": "http://mlcommons.org/croissant/1.0"[^\0]*"Euler-Lagrange equations"'
_STATISTICS = rb'\A\{\n "runs": \d+,\n "split": "train",\n "variables": '
_CARD = rb"\A---\npretty_name: [^\0]*Euler-Lagrange equations"
_CONTEXT = Path(__file__).parent / "templates" / "croissant-context.json"


def describe(path: Path | str) -> list[Path]:
    """Write the two files beside the dataset at `path`; their paths. Raises StoreError where it is no sweep's."""
    path = Path(path)
    stored = StoredSweep(path)
    files = [
        (path.with_suffix(".croissant.json"), _croissant(path, stored), _CROISSANT),
        (path.with_suffix(".statistics.json"), statistics(stored), _STATISTICS),
    ]
    for place, text, mark in files:
        replace_file(place, (json.dumps(text, indent=1) + "\n").encode(), mark)
    return [place for place, _, _ in files]


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


def statistics(stored: StoredSweep) -> dict[str, Any]:
    """Mean, deviation, smallest and largest value of every variable of floating point numbers, NaN left out.

    Over the runs that are ok and, where runs are marked, marked for training, and over their samples in time: one
    number for each remaining entry (a coordinate, a blade and axis), as nested lists.
    """
    chosen = np.isin(stored.column("status"), [code_of(status) for status in GOOD])
    if "split" in stored.columns:
        chosen &= stored.column("split") == SPLITS.index("train")
    variables = {}
    for name, column in stored.columns.items():
        values = stored.column(name)
        if column.dimensions[0] == "run" and values.dtype.kind == "f":
            axes = tuple(i for i, dimension in enumerate(column.dimensions) if dimension in ("run", "time"))
            numbers = _moments(values, chosen, axes)
            variables[name] = {"unit": column.units, "dimensions": list(column.dimensions), **numbers}
    return {"runs": int(chosen.sum()), "split": "train", "variables": variables}


def _moments(stored: NDArray[Any], chosen: NDArray[np.bool_], axes: tuple[int, ...]) -> dict[str, Any]:
    """Of the chosen runs, over these axes; in two passes over pieces of them, as a file need not fit into memory."""

    def pieces() -> Iterator[NDArray[np.float64]]:
        runs = max(_PIECE * len(stored) // stored.nbytes, 1)
        for first in range(0, len(stored), runs):
            piece = slice(first, first + runs)
            yield np.asarray(stored[piece][chosen[piece]], dtype=np.float64)

    count, total, squares, least, largest = (np.float64(start) for start in (0.0, 0.0, 0.0, np.inf, -np.inf))
    for values in pieces():
        finite = np.isfinite(values)
        count = count + finite.sum(axis=axes)
        total = total + np.where(finite, values, 0.0).sum(axis=axes)
        least = np.minimum(least, np.where(finite, values, np.inf).min(axis=axes, initial=np.inf))
        largest = np.maximum(largest, np.where(finite, values, -np.inf).max(axis=axes, initial=-np.inf))
    mean = total / np.maximum(count, 1)
    for values in pieces():
        away = np.where(np.isfinite(values), values - np.expand_dims(mean, axes), 0.0)
        squares = squares + (away**2).sum(axis=axes)
    numbers = {"mean": mean, "std": np.sqrt(squares / np.maximum(count, 1)), "min": least, "max": largest}
    return {name: _plain(np.where(count > 0, values, np.nan)) for name, values in numbers.items()}


def _plain(values: NDArray[np.float64]) -> Any:
    """As nested lists; null for what is no finite number, which JSON has not."""
    if values.ndim:
        return [_plain(value) for value in values]
    return float(values) if np.isfinite(values) else None


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
