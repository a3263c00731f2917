"""Metadata beside a sweep's dataset, for those who find it without its maker: Croissant, and statistics.

    STEM.croissant.json        the variables of the dataset, with types and units
    STEM.statistics.json       mean, deviation and range of every variable over the training runs that are ok
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

from rotor_mbs.runs.files import KEYWORDS, replace_file
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.scenario.sweep import SPLITS
from rotor_mbs.solution.status import GOOD, code_of

_PIECE = 1 << 24  # bytes of a variable that are read at once
# What is found in every file of a kind.
_CROISSANT = rb'"conformsTo": "http://mlcommons.org/croissant/1.0"[^\0]*"Euler-Lagrange equations"'
_STATISTICS = rb'\A\{\n "runs": \d+,\n "split": "train",\n "variables": '
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
