"""Files of this program that somebody changed on purpose: with a right digest, and rows with right
checksums."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py

from rotor_mbs.runs.trailer import read_trailer, trailer_of


@contextmanager
def forged(path: Path) -> Iterator[h5py.File]:
    """The file, open to be changed; afterwards its trailer is that of what it holds then."""
    trailer = read_trailer(path)
    with h5py.File(path, "r+") as file:  # cuts the trailer off
        yield file
    with h5py.File(path) as file:
        groups = {
            group: _places(file[group or "/"], columns) for group, columns in trailer.groups.items()
        }
    append_trailer(path, trailer.kind, groups)


def append_trailer(path: Path, kind: str, groups: Any) -> None:
    """Make any HDF5 file one that has a right trailer."""
    with path.open("r+b") as stream:
        trailer = trailer_of(stream, kind, groups)
        stream.seek(0, 2)
        stream.write(trailer)


def _places(group: h5py.Group, columns: Any) -> dict[str, tuple[int, int]]:
    places = {}
    for name in columns:
        is_own = isinstance(group.get(name, getlink=True), h5py.HardLink)
        dataset = group[name] if is_own else None
        if (
            isinstance(dataset, h5py.Dataset)
            and dataset.shape is not None
            and dataset.id.get_offset() is not None
        ):
            places[name] = dataset.id.get_offset(), dataset.nbytes
        else:
            places[name] = 0, 0
    return places
