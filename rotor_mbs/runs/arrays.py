"""Read arrays from any HDF5 file, of this program or of another."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import StoreError
from rotor_mbs.runs.hdf5 import attribute, is_dimension_only, reason_of

# Attributes that tell how the values of an array of another program are to be read.
ARRAY_ATTRIBUTES = (
    "units",
    "unit",
    "scale_factor",
    "add_offset",
    "_FillValue",
    "missing_value",
    "_Unsigned",
)
_MAX_MEMBERS = 1000  # largest number of members, and of other groups, that are described


class StoredArrays(NamedTuple):
    """The arrays of one group of any HDF5 file.

    Attributes
    ----------
    arrays : arrays of numbers with up to three dimensions by name, as they are stored.
    attributes : for each array its attributes in `ARRAY_ATTRIBUTES`, by name.
    others : the other members of the group, and other groups with arrays, by name. A value is a
        description, and whether the member is an array of something else than numbers.
    """

    arrays: dict[str, NDArray[Any]]
    attributes: dict[str, dict[str, Any]]
    others: dict[str, tuple[str, bool]]


def read_arrays(
    path: Path, group: str = "", scene: str = "", max_bytes: float = math.inf
) -> StoredArrays:
    """Read the arrays of numbers of one group of any HDF5 file, with their attributes.

    Arrays of more than three dimensions are not read.

    Parameters
    ----------
    path : a file of another program or of this one.
    group : path of the group or the end of the path; "/" for the root. It may be "" if only one
        group has arrays, apart from groups named "reference".
    scene : name of a scene. If groups with arrays are below it, only these are considered.
    max_bytes : largest total size of the arrays, counted as float64. The size that the file claims
        is compared with it before any array is read.

    Raises
    ------
    StoreError
        If the file cannot be read or claims too much, or `group` is not found or ambiguous. In the
        last two cases the message lists the groups.
    """
    try:
        with h5py.File(path, "r") as file:
            places = _array_places(file)
            place = chosen_group(path, list(places), group, scene)
            chosen = file[place or "/"]
            datasets = {name: chosen[name] for name in places[place]}
            _refuse_claims(path, datasets.values(), max_bytes)
            arrays = {name: dataset[()] for name, dataset in datasets.items()}
            attributes = {name: _attributes_of_array(dataset) for name, dataset in datasets.items()}
            others = {}
            for name in itertools.islice(chosen, _MAX_MEMBERS):
                if name not in datasets:
                    others[name] = _what_it_is(chosen, name)
            for other in itertools.islice(places, _MAX_MEMBERS):
                if other != place and other.rpartition("/")[0] != place:
                    others[f"/{other}"] = ("another group", False)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as exc:
        raise StoreError(f"{path}: not a readable HDF5 file ({reason_of(exc)})") from exc
    return StoredArrays(arrays, attributes, others)


def refuse_claims(path: Path, max_bytes: float) -> None:
    """Raise StoreError if the arrays of an HDF5 file are too large, or are stored in other files.

    Parameters
    ----------
    path : the file.
    max_bytes : largest total size of the arrays, as the file claims it, counted as float64.

    Raises
    ------
    StoreError
        In these cases, and if the file cannot be read.
    """
    datasets: list[Any] = []

    def note(_: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.size:
            datasets.append(item)

    try:
        with h5py.File(path, "r") as file:
            file.visititems(note)
            _refuse_claims(path, datasets, max_bytes)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as exc:
        raise StoreError(f"{path}: not a readable HDF5 file ({reason_of(exc)})") from exc


def _refuse_claims(path: Path, datasets: Iterable[Any], max_bytes: float) -> None:
    """Raise StoreError if datasets together exceed `max_bytes`, or one is stored in another file.

    Parameters
    ----------
    path : path of the file, for the message.
    datasets : the HDF5 datasets.
    max_bytes : largest total size of the datasets, counted as float64.
    """
    size = 0.0
    for dataset in datasets:
        size += 8.0 * dataset.size
        if dataset.is_virtual or dataset.external:
            raise StoreError(
                f"{path}: {dataset.name} is stored in another file; allowed: arrays of this one"
            )
    if size > max_bytes:
        allowed = f"up to {max_bytes / 2**30:g} GB: export fewer rows or arrays"
        raise StoreError(f"{path}: its arrays claim {size / 2**30:.1f} GB; allowed: {allowed}")


def _what_it_is(group: Any, name: str) -> tuple[str, bool]:
    """Describe a member of a group that `read_arrays` does not read.

    Parameters
    ----------
    group : the HDF5 group.
    name : name of the member.

    Returns
    -------
    str, bool
        The description, and whether the member is an array of something else than numbers.
    """
    if group.get(name, getlink=True).__class__ is not h5py.HardLink:
        return "a link to another file or place", False
    item = group[name]
    if not isinstance(item, h5py.Dataset):
        return "another group", False
    if not item.size or is_dimension_only(item):
        return "no values", False
    if item.size == 1:
        return "one value", False
    if item.dtype.kind in "fiu":
        return f"an array of {len(item.shape)} dimensions", False
    return ("records, no numbers" if item.dtype.kind == "V" else "no numbers"), True


def _attributes_of_array(dataset: Any) -> dict[str, Any]:
    """Return the attributes of an array that are in `ARRAY_ATTRIBUTES`, by name.

    Attributes with several values are left out: a list of texts may take long to read.

    Parameters
    ----------
    dataset : the HDF5 dataset.
    """
    found = {}
    for name in ARRAY_ATTRIBUTES:
        if (
            name in dataset.attrs
            and dataset.attrs.get_id(name).get_space().get_simple_extent_npoints() == 1
        ):
            value = attribute(dataset, name)
            # A number is returned with the type with which it was written.
            is_text = isinstance(value, str) or (
                isinstance(value, list) and isinstance(value[0], str)
            )
            found[name] = value if is_text else np.asarray(dataset.attrs[name]).ravel()[0]
    return found


def chosen_group(path: Path, places: Sequence[str], group: str, scene: str) -> str:
    """Return the path of the group that `read_arrays` is asked for.

    Parameters
    ----------
    path : the file, for the message.
    places : paths of the groups that have arrays.
    group, scene : see `read_arrays`.

    Raises
    ------
    StoreError
        If no group fits, or several do.
    """
    inside = [place for place in places if place.startswith(f"{scene}/")] or list(places)
    fitting: list[str]
    is_root, group = group.strip() == "/", group.strip("/")
    if is_root:
        fitting = [place for place in places if not place]
    elif group:
        fitting = [place for place in inside if place == group]
        fitting = fitting or [place for place in inside if f"/{place}".endswith(f"/{group}")]
    else:
        fitting = [place for place in inside if not place.endswith("/reference")]
    if len(fitting) == 1:
        return fitting[0]
    if not places:
        raise StoreError(f"{path}: no arrays of numbers in it; allowed: a time and angles")
    shown = ", ".join(place or "/" for place in inside[:12]) + (", ..." if len(inside) > 12 else "")
    problem = f"no group {group or '/'!r}" if group or is_root else "arrays in several groups"
    raise StoreError(f"{path}: {problem}; allowed: a mapping file with group = one of {shown}")


def _array_places(file: Any) -> dict[str, list[str]]:
    """Return the names of the arrays that `read_arrays` reads, by the path of their group.

    Groups without such arrays are left out.

    Parameters
    ----------
    file : an h5py.File.
    """
    places: dict[str, list[str]] = {}

    def note(path: str, item: Any) -> None:
        if (
            isinstance(item, h5py.Dataset)
            and item.dtype.kind in "fiu"
            and 0 < len(item.shape or ()) <= 3
            and item.size > 1
            and not is_dimension_only(item)
        ):
            folder, _, name = path.rpartition("/")
            places.setdefault(folder, []).append(name)

    file.visititems(note)
    return places
