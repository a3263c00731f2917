"""Lay out new HDF5 files, either with room for all rows of tables or with groups of arrays."""

from __future__ import annotations

import errno
import io
import os
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from rotor_mbs.runs.design import MISSING
from rotor_mbs.runs.hdf5 import (
    CHARACTERS,
    TEXT,
    TEXT_IN_MEMORY,
    TEXT_TYPE,
    WITHOUT_VALUES,
    Column,
    TableSpec,
    is_group,
    region_of,
)
from rotor_mbs.runs.output_files import replacing, write_file
from rotor_mbs.runs.table import StoredTable, TableFile
from rotor_mbs.runs.trailer import FORMAT_VERSION, INTEGRITY, RESULTS, SWEEP, digest_of, trailer_of
from rotor_mbs.runs.untrusted import trust

FORMAT = "rotor_mbs"
CONVENTIONS = "CF-1.11, ACDD-1.3"
# Attribute `keywords` of every file with tables, which the ACDD conventions ask for.
KEYWORDS = "multibody dynamics, wind turbine rotor, Euler-Lagrange equations, model verification"
_HEAD_BYTES = 1 << 17  # bytes that are reserved for descriptions and texts outside the rows


@contextmanager
def create_file(
    path: Path, tables: Sequence[TableSpec], attributes: Mapping[str, object]
) -> Iterator[TableFile]:
    """Yield a new file with room for all rows of tables, under a temporary name.

    The file gets its final name after the block. If the block raises, the file is removed. Space is
    reserved before HDF5 writes, because HDF5 does not survive a disk that fills up. Space is
    reserved again after the layout, because HDF5 truncates a file when it creates it.

    Parameters
    ----------
    path : final path of the file.
    tables : the tables that are laid out.
    attributes : attributes of the file.

    Yields
    ------
    TableFile
        The tables of the file, which has its temporary name.

    Raises
    ------
    StoreError
        If the file cannot be written, or the disk has no room for it.
    """
    with replacing(path) as temporary:
        size = _HEAD_BYTES
        for table in tables:
            # Besides the computed columns, a row is estimated to have 8 bytes for each known column
            # and for four more values.
            row_bytes = table.row_type.itemsize + 8 * (4 + len(table.known))
            size += len(table.runs) * row_bytes
        _reserve(temporary, size)
        with begin_file(temporary) as hdf5_file:
            put_attributes(hdf5_file, attributes)
            regions = {table.group: _put_table(hdf5_file, table) for table in tables}
        kind = SWEEP if "" in regions else RESULTS
        with temporary.open("r+b") as file:
            trailer = trailer_of(file, kind, regions)
            trust(digest_of(trailer))
            file.seek(0, os.SEEK_END)
            file.write(trailer)
        _reserve(temporary, temporary.stat().st_size)
        # The tables are made from the values that were written, because reading the file would take
        # longer than writing it.
        inode = temporary.stat().st_ino
        laid_tables = []
        for table in tables:
            known = {}
            for name, (column, values) in table.known.items():
                known[name] = column, _as_stored(values)
            laid = replace(table, runs=_as_stored(table.runs), known=known)
            laid_tables.append(StoredTable.of(laid, temporary, inode, regions))
        yield TableFile(temporary, laid_out_as=(attributes, laid_tables))


def _reserve(path: Path, size: int) -> None:
    """Reserve space on the disk for a file of `size` bytes. Raises OSError.

    Nothing is reserved if the system or the file system cannot do it. macOS and Windows cannot:
    there a full disk is noticed only when a row cannot be written.
    """
    with path.open("ab") as file:
        try:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(file.fileno(), 0, size)
        except OSError as exc:
            if exc.errno not in (errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS):
                raise OSError(exc.errno, f"{exc.strerror} ({size:.2g} bytes for all runs)") from exc
        os.fsync(file.fileno())


def _put_table(file: Any, table: TableSpec) -> dict[str, tuple[int, int]]:
    """Write the layout of a table, and return the locations of its computed columns.

    Parameters
    ----------
    file : an HDF5 file that is open for writing.
    table : the table. Its known columns are written; its computed columns only get space.

    Returns
    -------
    dict of (int, int)
        Offset and length in bytes, by name of the computed column.
    """
    group = new_group(file, table.group) if table.group else file
    put_attributes(group, table.attributes)
    put(group, "run", table.runs, Column(("run",), "1", "name or number of the run"))
    if table.characters:
        put_dimension(group, CHARACTERS, table.characters)
    for name, (column, values) in table.known.items():
        put(group, name, values, column)
    regions = {}
    for name, column in table.computed.items():
        kind, shape = table.row_type[name].base, table.shape(name)
        fill = MISSING if name == "status" else None
        regions[name] = region_of(put_empty(group, name, shape, kind, column, fill))
    return regions


def begin_file(place: Path | str, **driver: object) -> Any:
    """Create an HDF5 file with the attributes of this program's format.

    `driver` has the options of an HDF5 driver for `h5py.File`. Without these options the file is on
    the disk, and the caller must have reserved space for it.
    """
    file = h5py.File(place, "w", libver=("earliest", "v108"), track_order=True, **driver)
    file.attrs["Conventions"] = CONVENTIONS
    file.attrs["format"] = FORMAT
    file.attrs["format_version"] = FORMAT_VERSION
    file.attrs["integrity"] = INTEGRITY
    return file


def new_group(parent: Any, name: str) -> Any:
    """Return a group by its path; it and the groups above it are created if they do not exist.

    A new group lists its members in the order of writing.
    """
    for part in name.split("/"):
        parent = parent[part] if part in parent else parent.create_group(part, track_order=True)
    return parent


def put(group: Any, name: str, values: Any, column: Column) -> Any:
    """Write a dataset of numbers or texts.

    A dataset with the name of its only dimension becomes a scale. For any other dataset, the scales
    of its dimensions must exist.
    """
    dataset = group.create_dataset(name, data=_as_stored(values))
    return _describe(dataset, group, name, column)


def _as_stored(values: Any) -> NDArray[Any]:
    """Return numbers or texts as the array that a reader of the file gets."""
    is_text = len(values) > 0 and isinstance(values[0], str)
    return np.array(list(values), dtype=TEXT) if is_text else np.asarray(values)


def _describe(dataset: Any, group: Any, name: str, column: Column) -> Any:
    """Write the attributes of a dataset, attach its scales, and return the dataset."""
    put_attributes(
        dataset, {"units": column.units, "long_name": column.long_name, **column.attributes}
    )
    for axis, dimension in enumerate(column.dimensions):
        if dimension == name:
            dataset.make_scale(dimension)
        else:
            h5py.h5ds.attach_scale(dataset.id, h5py.h5d.open(group.id, dimension.encode()), axis)
    return dataset


def put_dimension(group: Any, name: str, length: int) -> None:
    """Write a dimension without values, as the netCDF-4 library does."""
    scale = group.create_dataset(name, (length,), ">f4")
    scale.make_scale(f"{WITHOUT_VALUES}{length:10d}")


def put_empty(
    group: Any,
    name: str,
    shape: tuple[int, ...],
    kind: Any,
    column: Column,
    fill: int | None = None,
) -> Any:
    """Create a contiguous dataset with space in the file, whose values are written later.

    Parameters
    ----------
    group, name : the group in which the dataset is created, and its name.
    shape, kind : shape and type of the values.
    column : dimensions and description of the dataset.
    fill : initial value of all entries. By default none is written, and a reader gets zeros.
    """
    layout = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    layout.set_layout(h5py.h5d.CONTIGUOUS)
    layout.set_obj_track_times(False)  # without times, the same call writes the same bytes
    layout.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    layout.set_fill_time(h5py.h5d.FILL_TIME_NEVER if fill is None else h5py.h5d.FILL_TIME_ALLOC)
    if fill is not None:
        layout.set_fill_value(np.array(fill, kind))
    dataset = group.create_dataset(name, shape, kind, dcpl=layout)
    _describe(dataset, group, name, column)
    if np.dtype(kind).kind == "S":
        dataset.attrs["_Encoding"] = "utf-8"
    return dataset


def put_attributes(target: Any, values: Mapping[str, object]) -> None:
    """Write new attributes of a file, a group or a dataset.

    Parameters
    ----------
    target : the HDF5 object.
    values : values of the attributes by name. Numbers are stored as float64 or int64, booleans as
        int8 (netCDF-4 has no booleans), lists of texts as arrays of texts, and arrays with their
        own type.
    """
    for name, value in values.items():
        if isinstance(value, str):
            # Nearly all attributes are single texts. `attrs` of h5py takes three times as long to
            # write them.
            stored = h5py.h5a.create(
                target.id, name.encode(), TEXT_TYPE, h5py.h5s.create(h5py.h5s.SCALAR)
            )
            stored.write(np.array(value, TEXT), mtype=TEXT_IN_MEMORY)
        elif isinstance(value, bool):
            target.attrs[name] = np.int8(value)
        elif isinstance(value, (list, tuple)):
            target.attrs.create(name, list(value), dtype=TEXT)
        else:
            target.attrs[name] = value


@contextmanager
def new_file(path: Path, kind: str) -> Iterator[Any]:
    """Yield an HDF5 file in memory, which is written to `path` after the block.

    HDF5 makes the file in memory, because HDF5 does not survive a disk that fills up. If the file
    cannot be written, an earlier file at `path` is unchanged. Before this call, the caller must
    check by `may_extend` whether an earlier file may be replaced.

    Parameters
    ----------
    path : path of the file.
    kind : kind of the file, which is stored in its trailer.

    Raises
    ------
    StoreError
        If the file cannot be written.
    """
    memory = {"driver": "core", "backing_store": False, "block_size": 1 << 20}
    with begin_file(f"{path.name}.{threading.get_ident()}", **memory) as file:
        yield file
        groups: dict[str, Mapping[str, tuple[int, int]]] = {
            group_path: {} for group_path in _groups_with_arrays(file)
        }
        file.flush()
        image = io.BytesIO(file.id.get_file_image())
    trailer = trailer_of(image, kind, groups)
    trust(digest_of(trailer))
    image.seek(0, io.SEEK_END)
    image.write(trailer)
    write_file(path, image.getbuffer())


def _groups_with_arrays(group: Any, path: str = "") -> Iterator[str]:
    """Yield the path of the group of each array, for all arrays below `group` in order of writing.

    A group with several arrays is yielded several times.
    """
    for name, item in group.items():
        if is_group(item):
            yield from _groups_with_arrays(item, f"{path}/{name}" if path else name)
        else:
            yield path
