"""Read groups of this program's files with the HDF5 library, except their computed columns.

The worker process of `runs.untrusted` loads this module. The module imports little, so that the
worker starts fast.
"""

from __future__ import annotations

import functools
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import RotorError, StoreError, one_line
from rotor_mbs.runs.trailer import Trailer, read_trailer, refuse_split
from rotor_mbs.runs.untrusted import read_in_worker

CHARACTERS = "characters"  # name of the dimension over the bytes of a computed text
# Text with which the netCDF-4 library begins the name of a dimension that has no values.
WITHOUT_VALUES = "This is a netCDF dimension but not a netCDF variable."
# Attributes that the HDF5 and netCDF-4 libraries write for themselves.
_LIBRARY_ATTRIBUTES = (
    "CLASS",
    "NAME",
    "REFERENCE_LIST",
    "DIMENSION_LIST",
    "_Netcdf4Dimid",
    "_Netcdf4Coordinates",
)
# Element of a dataset of texts of variable length: the length of a text, and its location in the
# file's heap.
_REFERENCE = np.dtype([("length", "<u4"), ("heap", "<u8"), ("index", "<u4")])
# A text of variable length has three types: TEXT in a NumPy array, and two types of the HDF5
# library, TEXT_IN_MEMORY for values in memory and TEXT_TYPE for values in a file.
TEXT = h5py.string_dtype()
TEXT_IN_MEMORY = h5py.h5t.py_create(TEXT)
TEXT_TYPE = h5py.h5t.py_create(TEXT, logical=True)
ATTEMPTS = 3  # number of attempts to open a file that is being replaced


class Column(NamedTuple):
    """Description of a dataset.

    Attributes
    ----------
    dimensions : name of the scale of each axis; a scale has its own name here.
    units, long_name : unit and meaning of the values.
    kind : NumPy type of the values in the file.
    attributes : further attributes, by name.
    """

    dimensions: tuple[str, ...]
    units: str
    long_name: str
    kind: str = "<f8"
    attributes: Mapping[str, Any] = {}


@dataclass(frozen=True)
class TableSpec:
    """A table without its computed values, before it is laid out or after it is read.

    It also describes a group that is no table. Such a group has no runs, and all its columns are
    known.

    Attributes
    ----------
    group : path of the group in the file; "" for the root.
    runs : (rows,) unique labels or numbers of the rows: the scale of the dimension `run`.
    known : column and values by name, for the known columns, whose values are known when the table
        is laid out, and for all scales except `run`.
    computed : columns that are filled in later, in the order in which the checksum of a row covers
        them. A column without the dimension `run` belongs to the row of the reference.
    attributes : attributes of the group.
    characters : length of each computed text in bytes.
    """

    group: str
    runs: Sequence[str] | NDArray[Any]
    known: Mapping[str, tuple[Column, Any]]
    computed: Mapping[str, Column]
    attributes: Mapping[str, Any] = field(default_factory=dict)
    characters: int = 0

    @functools.cached_property
    def row_type(self) -> np.dtype[np.void]:
        """Return the type of one row: its computed columns in the order of its checksum."""
        lengths = {name: len(values) for name, (_, values) in self.known.items()}
        lengths[CHARACTERS] = self.characters
        fields: list[tuple[str, str, tuple[int, ...]]] = []
        for name, column in self.computed.items():
            dimensions = [dimension for dimension in column.dimensions if dimension != "run"]
            shape = tuple(lengths[dimension] for dimension in dimensions)
            fields.append((name, column.kind, shape))
        return np.dtype(fields)

    def shape(self, name: str) -> tuple[int, ...]:
        """Return the shape of a computed column."""
        rows = (len(self.runs),) if "run" in self.computed[name].dimensions else ()
        return (*rows, *self.row_type[name].shape)

    @functools.cached_property
    def known_rows(self) -> Mapping[str, Mapping[str, Any]]:
        """Return the known values of each row by column, by the label of the row.

        The table must have no scale except `run`: all its known columns have one value per row.
        """
        columns = {name: list(values) for name, (_, values) in self.known.items()}
        rows = {}
        for i, run in enumerate(self.runs):
            rows[str(run)] = {name: values[i] for name, values in columns.items()}
        return rows

    @functools.cached_property
    def row_of(self) -> Mapping[str, int]:
        """Return the number of each row, by the label of the row."""
        return {str(run): row for row, run in enumerate(self.runs)}


def read_groups(
    path: Path, kinds: Collection[str], only: Collection[str] | None = None
) -> tuple[dict[str, TableSpec], Trailer]:
    """Read groups of a file of this program, in the worker process unless the file is trusted.

    Parameters
    ----------
    path : the file.
    kinds : kinds of files whose groups are read. If the file is of another kind, only its root is
        read.
    only : names of the groups to read beside the root, by default all.

    Returns
    -------
    dict of TableSpec
        The groups by name; "" is the root.
    Trailer
        The trailer of the file, with all groups and the locations of the computed columns.

    Raises
    ------
    StoreError
        If the file is missing, damaged or another program's, or cannot be read within limits.
    """
    return read_in_worker(path, _read_groups, (kinds, only))


def read_arrays(path: Path, group: str, names: Collection[str]) -> dict[str, NDArray[Any]]:
    """Read arrays of a file of this program, in the worker process unless the file is trusted.

    Parameters
    ----------
    path : the file.
    group : path of a group.
    names : names of arrays in the group.

    Raises
    ------
    StoreError
        In the cases of `read_groups`, or if an array is missing.
    """
    return read_in_worker(path, _read_arrays, (group, names))


def _read_arrays(path: Path, asked: tuple[str, Collection[str]]) -> dict[str, NDArray[Any]]:
    group, names = asked
    with open_file(path) as (file, _), reading(path):
        return {name: values_of(member(group_at(file, group), name)) for name in names}


def _read_groups(
    path: Path, selection: tuple[Collection[str], Collection[str] | None]
) -> tuple[dict[str, TableSpec], Trailer]:
    """Read groups of a file in this process; `selection` is (kinds, only), see `read_groups`."""
    kinds, only = selection
    with open_file(path) as (file, trailer), reading(path):
        groups = {"": _read_group(file, "", trailer.groups.get("", {}))}
        for name in trailer.groups if trailer.kind in kinds else ():
            if name and (only is None or name in only):
                groups[name] = _read_group(group_at(file, name), name, trailer.groups[name])
        return groups, trailer


def _read_group(group: Any, path: str, regions: Mapping[str, tuple[int, int]]) -> TableSpec:
    """Read a group, but not the values of its computed columns.

    The computed columns must be at the locations that the trailer gives; otherwise StoreError is
    raised.

    Parameters
    ----------
    group, path : an h5py.Group, and its path in the file.
    regions : offset and length of each computed column in bytes, from the trailer.
    """
    datasets = datasets_of(group)
    columns = columns_of(datasets)
    known = {}
    for name, dataset in datasets.items():
        if name not in regions:
            known[name] = columns[name], values_of(dataset)
    _, runs = known.pop("run", (None, ()))
    computed = {name: columns[name] for name in regions}
    characters = len(group[CHARACTERS]) if CHARACTERS in group else 0
    table = TableSpec(path, runs, known, computed, attributes_of(group), characters)
    for name, region in regions.items():
        dataset = datasets[name]
        if dataset.shape != table.shape(name) or region_of(dataset) != tuple(region):
            place = f"{group.file.filename}: {path}/{name}"
            raise StoreError(f"{place} has shape {dataset.shape} of {dataset.dtype}; damaged")
    return table


@contextmanager
def open_file(path: Path) -> Iterator[tuple[Any, Trailer]]:
    """Check the trailer of a file of this program, then open the file for reading.

    Parameters
    ----------
    path : the file.

    Yields
    ------
    h5py.File, Trailer
        The file, and its trailer.

    Raises
    ------
    StoreError
        If the file is missing, damaged, of another program, or is being replaced.
    """
    for _ in range(ATTEMPTS):
        trailer = read_trailer(path)
        try:
            file = h5py.File(path, "r")
        except FileNotFoundError:  # the file was removed after its trailer was checked
            continue
        except OSError as exc:
            raise StoreError(
                f"{path}: not a readable HDF5 file ({reason_of(exc)}); allowed: a file that "
                "rotor-mbs wrote"
            ) from exc
        with file:
            try:
                inode = path.stat().st_ino
            except FileNotFoundError:  # the file was removed after its trailer was checked
                continue
            if inode != trailer.inode:  # the file was replaced after its trailer was checked
                continue
            refuse_split(path, trailer.kind)
            yield file, trailer
            return
    raise StoreError(f"{path}: is being replaced by another process")


@contextmanager
def reading(path: Path | str, what: str = "") -> Iterator[None]:
    """Convert errors that the content of a file causes in the block to StoreError.

    HDF5 raises errors of many types on damaged files. A forged file with a right digest may cause
    such errors, too, in the code that uses its content.

    Parameters
    ----------
    path, what : the file, and the part of the file, for the message.
    """
    try:
        yield
    except (RotorError, ImportError, MemoryError, BrokenPipeError):
        raise
    except Exception as exc:
        place = f"{path}: {what}" if what else f"{path}"
        raise StoreError(f"{place}: damaged or incomplete ({one_line(exc)[:150]})") from exc


def group_at(file: Any, path: str) -> Any:
    """Return a group by its path. Raises StoreError if it is missing or a link."""
    for name in path.split("/") if path else ():
        file = member(file, name)
    return file


def member(group: Any, name: str) -> Any:
    """Return a member of a group. Raises StoreError if it is missing or a link."""
    link = group.get(name, getlink=True)
    if not isinstance(link, h5py.HardLink):
        found = "is missing" if link is None else "is a link"
        raise StoreError(
            f"{group.file.filename}: {group.name}/{name} {found}; allowed: groups and arrays of "
            "this file"
        )
    return group[name]


def values_of(dataset: Any) -> NDArray[Any]:
    """Read an array of numbers or of texts.

    Parameters
    ----------
    dataset : an h5py.Dataset.

    Returns
    -------
    ndarray
        The values. Texts are in an array of dtype object.

    Raises
    ------
    StoreError
        If `dataset` is no array, is not contiguous in this file, or claims more than the file has.
    """
    place = f"{dataset.file.filename}: {dataset.name}"
    if not isinstance(dataset, h5py.Dataset) or dataset.shape is None:
        raise StoreError(f"{place} is no array")
    layout = dataset.id.get_create_plist()
    if layout.get_external_count() or layout.get_layout() != h5py.h5d.CONTIGUOUS:
        raise StoreError(
            f"{place} is not contiguous in this file; allowed: an array as rotor-mbs writes it"
        )
    kept, size = dataset.id.get_storage_size(), dataset.file.id.get_filesize()
    if kept > size or kept < dataset.nbytes:
        raise StoreError(f"{place} claims {dataset.nbytes:.2g} bytes and has {kept:.2g}")
    if dataset.dtype.kind != "O":
        values: NDArray[Any] = dataset[()]
        return values
    if h5py.check_string_dtype(dataset.dtype) is None:
        raise StoreError(f"{place} is no array")
    # The dataset has a reference to each text, with the length of the text. In a forged file all
    # references may lead to the same long text, so the sum of the lengths is limited before the
    # texts are read.
    if dataset.size:
        texts = np.memmap(
            dataset.file.filename, _REFERENCE, "r", dataset.id.get_offset(), dataset.shape
        )
        if int(texts["length"].sum(dtype=np.uint64)) > size:
            raise StoreError(f"{place} claims more text than the file has")
    return np.array([plain(text) for text in dataset[()]], dtype=object)


def plain(value: Any) -> Any:
    """Return a value that h5py has read, a text or an attribute, as a plain Python value."""
    if isinstance(value, np.ndarray):
        return [plain(item) for item in value]
    if isinstance(value, bytes):
        return value.decode()
    return value.item() if isinstance(value, np.generic) else value


def attributes_of(target: Any) -> dict[str, Any]:
    """Return the attributes of a group or dataset as plain Python values.

    Attributes that the HDF5 and netCDF-4 libraries write for themselves are left out.
    """
    return {
        name: attribute(target, name) for name in target.attrs if name not in _LIBRARY_ATTRIBUTES
    }


def attribute(target: Any, name: str, default: Any = None) -> Any:
    """Return an attribute as a plain Python value.

    In a damaged file the type of a text may be changed to a list of variable length. The library
    would end the process if it read such an attribute, so ValueError is raised instead.

    Parameters
    ----------
    target : a file, group or dataset.
    name : name of the attribute.
    default : returned if there is no such attribute.

    Raises
    ------
    ValueError
        If the attribute is a list of variable length.
    """
    if not h5py.h5a.exists(target.id, name.encode()):
        return default
    stored = h5py.h5a.open(target.id, name.encode())
    kind = stored.get_type()
    if isinstance(kind, h5py.h5t.TypeVlenID):
        raise ValueError(f"attribute {name} is neither a number nor a text")
    # Nearly all attributes are single texts. `attrs` of h5py takes three times as long for them.
    if isinstance(kind, h5py.h5t.TypeStringID) and kind.is_variable_str() and stored.shape == ():
        text = np.empty((), TEXT)
        stored.read(text, mtype=TEXT_IN_MEMORY)
        return plain(text[()])
    return plain(target.attrs[name])


def datasets_of(group: Any) -> dict[str, Any]:
    """Return the open datasets of a group that have values, by name."""
    datasets = {}
    for name in group:
        dataset = member(group, name)
        if not is_group(dataset) and not is_dimension_only(dataset):
            datasets[name] = dataset
    return datasets


def _dimension(dataset: Any, axis: int, name: str, scale_names: dict[int, str]) -> str:
    """Return the name of the scale of an axis of a dataset.

    A dataset without scales is a scale itself, and its own name is returned.

    Parameters
    ----------
    dataset, axis, name : the dataset, the number of the axis, and the name of the dataset.
    scale_names : names of the scales found so far, by address in the file; a new one is added.
    """
    scales: list[Any] = []
    if h5py.h5ds.get_num_scales(dataset.id, axis):
        h5py.h5ds.iterate(dataset.id, axis, scales.append, 0)
    if not scales:
        return name
    address = h5py.h5o.get_info(scales[0]).addr
    if address not in scale_names:
        # The name is read from an attribute. To find the scale's path, the library would search the
        # whole file; and its function for the name ends the process if the name is damaged.
        scale = str(attribute(h5py.Dataset(scales[0]), "NAME"))
        scale_names[address] = CHARACTERS if scale.startswith(WITHOUT_VALUES) else scale
    return scale_names[address]


def columns_of(datasets: Mapping[str, Any]) -> dict[str, Column]:
    """Return the descriptions of the datasets of a group, by name.

    Parameters
    ----------
    datasets : the HDF5 datasets by name.
    """
    columns = {}
    scale_names: dict[int, str] = {}
    for name, dataset in datasets.items():
        dimensions = tuple(
            _dimension(dataset, axis, name, scale_names) for axis in range(dataset.ndim)
        )
        attributes = attributes_of(dataset)
        attributes.pop("_Encoding", None)
        for key, value in attributes.items():
            # A list of texts stays a list. Numbers stay an array, which keeps their type.
            if isinstance(value, list) and not isinstance(value[0], str):
                attributes[key] = dataset.attrs[key]
        units, long_name = str(attributes.pop("units")), str(attributes.pop("long_name"))
        columns[name] = Column(dimensions, units, long_name, dataset.dtype.str, attributes)
    return columns


def is_group(item: Any) -> bool:
    """Return whether an item of a file is a group."""
    return isinstance(item, h5py.Group)


def reason_of(error: Exception) -> str:
    """Return the reason that an HDF5 error has in brackets, such as "file signature not found".

    If there are no brackets, the first line of the error is returned.
    """
    text = str(error).splitlines()[0]
    return text.partition("(")[2].rpartition(")")[0] or text


def region_of(dataset: Any) -> tuple[int, int]:
    """Return the offset and the length of the values of a contiguous dataset, in bytes."""
    return dataset.id.get_offset() or 0, dataset.nbytes


def is_dimension_only(dataset: Any) -> bool:
    """Return whether a dataset is a dimension without values."""
    return str(attribute(dataset, "NAME", "")).startswith(WITHOUT_VALUES)
