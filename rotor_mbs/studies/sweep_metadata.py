"""Metadata beside a sweep's dataset, for those who find it without its maker: RO-Crate, Croissant, statistics.

    ro-crate-metadata.json     of the folder: the dataset and its sweep, one entry for every dataset described there
    STEM.croissant.json        the variables of the dataset, with types and units
    STEM.statistics.json       mean, deviation and range of every variable over the training runs that are ok
Plain JSON, from the dataset alone. No licence is named: whoever publishes a dataset chooses one.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from datetime import date
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import StoreError
from rotor_mbs.runs.files import KEYWORDS, replace_file
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.scenario.sweep_design import SPLITS
from rotor_mbs.solution.status import code_of

_PIECE = 1 << 24  # bytes of a variable that are read at once
_CRATE = "ro-crate-metadata.json"
_CRATE_PROFILE = "https://w3id.org/ro/crate/1.1"
_CROISSANT_PROFILE = "http://mlcommons.org/croissant/1.0"
_CONTEXT = Path(__file__).parent / "templates" / "croissant-context.json"


def describe(path: Path | str) -> list[Path]:
    """Writes the three files beside the dataset at `path`; returns their paths.

    Raises
    ------
    StoreError
        Where `path` is no sweep's dataset, a file cannot be written, or the folder's ro-crate-metadata.json was not
        written here and would be lost.
    """
    path = Path(path)
    stored = StoredSweep(path)
    content = hashlib.sha256(path.read_bytes()).hexdigest()
    files = {
        path.with_name(_CRATE): _crate(path, stored, content),
        path.with_suffix(".croissant.json"): _croissant(path, stored, content),
        path.with_suffix(".statistics.json"): statistics(stored),
    }
    for place, text in files.items():
        replace_file(place, (json.dumps(text, indent=1) + "\n").encode())
    return list(files)


def statistics(stored: StoredSweep) -> dict[str, Any]:
    """Mean, deviation, smallest and largest value of every variable of floating point numbers.

    Over the runs that are ok and, where runs are marked, marked for training, and over their samples in time: one
    number for each remaining entry (a coordinate, a blade and axis), as nested lists. NaN, of what a run did not reach,
    is left out.

    Examples
    --------
    `{"runs": 800, "variables": {"angles": {"unit": "rad", "mean": [...], "std": [...], ...}}}`
    """
    chosen = stored.column("status") == code_of("ok")
    if "split" in stored.columns:
        chosen &= stored.column("split") == SPLITS.index("train")
    found = {}
    for name, column in stored.columns.items():
        values = stored.column(name)
        if column.dimensions[0] == "run" and values.dtype.kind == "f":
            axes = tuple(i for i, one in enumerate(column.dimensions) if one in ("run", "time"))
            numbers = _moments(partial(_chosen, values, chosen), axes)
            found[name] = {"unit": column.units, "dimensions": list(column.dimensions), **numbers}
    return {"runs": int(chosen.sum()), "split": "train", "variables": found}


def _chosen(values: NDArray[Any], chosen: NDArray[np.bool_]) -> Iterator[NDArray[np.float64]]:
    """The chosen runs, piece by piece."""
    runs = max(_PIECE * len(values) // values.nbytes, 1)
    for first in range(0, len(values), runs):
        piece = slice(first, first + runs)
        yield np.asarray(values[piece][chosen[piece]], dtype=np.float64)


def _moments(pieces: Callable[[], Iterator[NDArray[np.float64]]], axes: tuple[int, ...]) -> dict[str, Any]:
    """Over these axes, NaN left out; in two passes over the pieces, as a file need not fit into memory."""
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


def _crate(path: Path, stored: StoredSweep, content: str) -> dict[str, Any]:
    place = path.with_name(_CRATE)
    known = _crate_entities(place)
    others = [one for one in known if one["@type"] == "File" and one["@id"] != path.name]
    kept = [one for one in known if one["@type"] == "PropertyValue" and not one["@id"].startswith(f"#{path.name}/")]
    measured = [
        _entity(f"#{path.name}/{name}", "PropertyValue", name=name, unitText=one.units, description=one.long_name)
        for name, one in stored.columns.items()
    ]
    about = {"name": stored.attributes["title"], "description": stored.attributes["summary"], "keywords": KEYWORDS}
    file = _entity(
        path.name,
        "File",
        **about,
        encodingFormat=["application/x-hdf5", "application/netcdf"],
        contentSize=str(path.stat().st_size),
        sha256=content,
        variableMeasured=[{"@id": one["@id"]} for one in measured],
    )
    files = sorted([*others, file], key=lambda one: str(one["@id"]))
    if others:
        about |= {"name": "Parameter studies of a wind turbine rotor", "description": "Datasets of rotor_mbs"}
    parts = [{"@id": one["@id"]} for one in files]
    root = _entity("./", "Dataset", **about, datePublished=date.today().isoformat(), hasPart=parts)
    program = _entity("#rotor_mbs", "SoftwareApplication", name="rotor_mbs")
    program["softwareVersion"] = str(stored.attributes.get("rotor_mbs", ""))
    links = {"about": {"@id": "./"}, "conformsTo": {"@id": _CRATE_PROFILE}, "creator": {"@id": "#rotor_mbs"}}
    descriptor = _entity(_CRATE, "CreativeWork", **links)
    return {"@context": f"{_CRATE_PROFILE}/context", "@graph": [descriptor, root, program, *files, *kept, *measured]}


def _entity(identity: str, kind: str, **facts: object) -> dict[str, Any]:
    return {"@id": identity, "@type": kind, **facts}


def _crate_entities(place: Path) -> list[dict[str, Any]]:
    """What the folder's crate has so far. Raises StoreError where the crate is not ours."""
    if not place.exists():
        return []
    try:
        graph: list[dict[str, Any]] = json.loads(place.read_text(encoding="utf-8"))["@graph"]
        if any(one["@id"] == "#rotor_mbs" and one["@type"] for one in graph):
            return graph
    except (OSError, ValueError, KeyError, TypeError):
        pass
    raise StoreError(f"{place}: not written by rotor-mbs; allowed: a folder without one")


def _croissant(path: Path, stored: StoredSweep, content: str) -> dict[str, Any]:
    """The variables with a run in front as fields of one record set, a record a run."""
    kinds = {"f": "sc:Float", "i": "sc:Integer", "u": "sc:Integer"}
    fields = [
        {
            "@type": "cr:Field",
            "@id": f"runs/{name}",
            "name": name,
            "description": f"{one.long_name} [{one.units}], dimensions {' x '.join(one.dimensions)}",
            "dataType": kinds[stored.column(name).dtype.kind],
            "source": {"fileObject": {"@id": path.name}, "extract": {"column": name}},
        }
        for name, one in stored.columns.items()
        if one.dimensions[0] == "run"
    ]
    return {
        "@context": json.loads(_CONTEXT.read_text(encoding="utf-8")),
        "@type": "sc:Dataset",
        "conformsTo": _CROISSANT_PROFILE,
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
                "sha256": content,
            }
        ],
        "recordSet": [{"@type": "cr:RecordSet", "@id": "runs", "name": "runs", "field": fields}],
    }
