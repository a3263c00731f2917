"""Digests of what a group of a file holds, stored with it: a changed bit is found and located.

The attribute `digests` of a group is a JSON object: SHA-256 by the name of each dataset, over values and attributes,
and by "attributes" over the group's own. Of columns that are filled later it covers the attributes alone.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import StoreError
from rotor_mbs.runs import files
from rotor_mbs.runs.files import DIGESTS, plain

ATTRIBUTES = "attributes"
_COMPUTED = "attributes of "

# What the library writes and changes by itself.
_NOT_COVERED = (DIGESTS, "CLASS", "NAME", "REFERENCE_LIST", "DIMENSION_LIST", "_Netcdf4Dimid", "_Netcdf4Coordinates")


def array_digest(values: NDArray[Any]) -> str:
    """Over shape and values as little-endian numbers: the same on every machine and for every HDF5 layout."""
    return str(_of_array(values).hexdigest())


def _of_array(values: NDArray[Any]) -> Any:
    if values.dtype.kind == "O":  # texts
        return hashlib.sha256("\0".join(map(str, values.tolist())).encode())
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
    """Store the digests of a group; of the datasets `later`, which are computed later, those of their attributes."""
    sums = {ATTRIBUTES: attributes_digest(group.attrs)}
    for name, item in group.items():
        if name in later:
            sums[label_of(name)] = attributes_digest(item.attrs)
        elif not files.is_group(item) and not files.is_dimension_only(item):
            sums[name] = _digest_of(item)
    group.attrs[DIGESTS] = json.dumps(sums)


def _digest_of(dataset: Any) -> str:
    values = files.texts_of(dataset) if files.is_text(dataset) else files.values_of(dataset)
    return dataset_digest(values, dataset.attrs)


def seal_all(group: Any) -> None:
    """Store the digests of every group that has none yet."""
    if DIGESTS not in group.attrs:
        seal(group)
    for name in group:
        if files.is_group(group.get(name)):
            seal_all(group[name])


def damages_of(group: Any, *, with_columns: bool = True) -> list[str]:
    """The parts of a group, "attributes" or names of datasets, that are not what was written, are new or are gone.

    "digests" where it has none. Links, and arrays that cannot be read, count too. with_columns: the attributes of
    datasets that are computed, too, which takes most of the time.
    """
    try:
        known = stored_digests(group.attrs)
    except ValueError:
        known = {}
    if not known:
        return [DIGESTS]
    sums = {ATTRIBUTES: attributes_digest(group.attrs)}
    for name in group:
        is_computed = label_of(name) in known
        label = label_of(name) if is_computed else name
        if is_computed and not with_columns and not files.is_link(group, name):
            sums[label] = known[label]
            continue
        sums[label] = ""
        with suppress(StoreError), files.reading(""):
            item = files.member(group, name)
            if files.is_group(item) or files.is_dimension_only(item):
                del sums[label]
            else:
                sums[label] = attributes_digest(item.attrs) if is_computed else _digest_of(item)
    return [name for name in {**known, **sums} if known.get(name) != sums.get(name)]


def stored_digests(attributes: Mapping[str, Any]) -> dict[str, str]:
    """By name; {} where there are none. Raises ValueError where they cannot be read."""
    found = json.loads(str(attributes.get(DIGESTS, "{}")))
    if not isinstance(found, dict):
        raise ValueError("no object of digests")
    return found


def label_of(name: str) -> str:
    """What the digest of a dataset's attributes alone is called."""
    return f"{_COMPUTED}{name}"


def computed_in(digests: Mapping[str, str]) -> list[str]:
    """The datasets whose attributes alone are covered."""
    return [name.removeprefix(_COMPUTED) for name in digests if name.startswith(_COMPUTED)]
