"""Digests of what a group of a file holds, stored with it: a changed bit is found and located.

The attribute `digests` of a group is a JSON object: SHA-256 by the name of each dataset, over values and attributes,
and by "attributes" over the group's own. Of columns that are filled later it covers the attributes alone. Knows no
file library.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

DIGESTS = "digests"
ATTRIBUTES = "attributes"
_UNFILLED = "attributes of "

# What the library writes and changes by itself.
_NOT_COVERED = (DIGESTS, "CLASS", "NAME", "REFERENCE_LIST", "DIMENSION_LIST", "_Netcdf4Dimid", "_Netcdf4Coordinates")


def plain(value: Any) -> Any:
    """An attribute as a plain Python value."""
    if isinstance(value, np.ndarray):
        return [plain(item) for item in value]
    if isinstance(value, bytes):
        return value.decode()
    return value.item() if isinstance(value, np.generic) else value


def array_digest(values: NDArray[Any]) -> str:
    """Over shape and values as little-endian numbers: the same on every machine and for every HDF5 layout."""
    return str(_of_array(values).hexdigest())


def _of_array(values: NDArray[Any]) -> Any:
    values = np.ascontiguousarray(values)
    digest = hashlib.sha256(f"{values.dtype.kind}{values.dtype.itemsize}{values.shape}".encode())
    digest.update(values.astype(values.dtype.newbyteorder("<"), copy=False).tobytes())
    return digest


def dataset_digest(values: NDArray[Any], attributes: Mapping[str, Any]) -> str:
    """Over values, units, long name and further attributes."""
    digest = _of_array(values)
    digest.update(attributes_digest(attributes).encode())
    return str(digest.hexdigest())


def attributes_digest(attributes: Mapping[str, Any]) -> str:
    """Over names and values, in any order."""
    covered = {name: plain(attributes[name]) for name in attributes if name not in _NOT_COVERED}
    return hashlib.sha256(json.dumps(covered, sort_keys=True).encode()).hexdigest()


def seal(group: Any, later: Collection[str] = ()) -> None:
    """Stores the digests of a group; of the datasets `later`, which are filled by others, those of their attributes."""
    found = {ATTRIBUTES: attributes_digest(group.attrs)}
    for name, item in group.items():
        if name in later:
            found[unfilled(name)] = attributes_digest(item.attrs)
        elif not hasattr(item, "items"):
            found[name] = dataset_digest(item[()], item.attrs)
    group.attrs[DIGESTS] = json.dumps(found)


def seal_all(group: Any) -> None:
    """Stores the digests of every group that has none: what was copied keeps those of when it was written."""
    if DIGESTS not in group.attrs:
        seal(group)
    for name in group:
        if hasattr(group.get(name, getclass=True), "items"):
            seal_all(group[name])


def stored_digests(attributes: Mapping[str, Any]) -> dict[str, str]:
    """By name; {} where there are none. Raises ValueError where they cannot be read."""
    found = json.loads(str(attributes.get(DIGESTS, "{}")))
    if not isinstance(found, dict):
        raise ValueError("no object of digests")
    return found


def unfilled(name: str) -> str:
    """What the digest of a dataset's attributes alone is called."""
    return f"{_UNFILLED}{name}"


def unfilled_in(digests: Mapping[str, str]) -> list[str]:
    """The datasets whose attributes alone are covered."""
    return [name.removeprefix(_UNFILLED) for name in digests if name.startswith(_UNFILLED)]
