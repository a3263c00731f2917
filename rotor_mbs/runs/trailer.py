"""Write and check the trailer of a file, which follows the HDF5 content.

The trailer has the locations of the rows, and a digest of everything else in the file:

    HDF5 | JSON | length of the JSON, 8 bytes | SHA-256, 32 bytes | MAGIC

The JSON has `format_version`, `kind` and `groups`. `groups` has the offset and the length in bytes
of each computed column by group, then by name, in the order in which the checksum of a row covers
the columns. The digest covers all bytes before it except the computed columns, whose rows have
their own checksums. The digest therefore stays right when rows are written.

A flipped bit can make the HDF5 library hang, or end the process. A file is therefore opened only
after its trailer was checked. The check is repeated each time a file is opened. It is fast, because
it skips the rows, which are nearly all of a large file.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, NamedTuple

from rotor_mbs.errors import InputError, StoreError

FORMAT_VERSION = 3
MAGIC = b"rmbs-end"
# Attribute `integrity` of every file, which tells how the file is checked. It also identifies a
# file that has lost its trailer.
INTEGRITY = "CRC-32 of each row; SHA-256 of the rest, behind the end of HDF5"
RESULTS, SWEEP, MODES, COMPARISON = "results", "sweep", "modes", "comparison"
# A file with one split of a sweep's dataset has a kind that begins with this text and ends with the
# name of the sweep's file.
SPLIT_OF = "split of "
_KINDS = {
    RESULTS: "runs, bench or stability",
    SWEEP: "a sweep",
    MODES: "modes",
    COMPARISON: "comparisons",
}
_LENGTH, _DIGEST = 8, hashlib.sha256().digest_size
_TAIL = _LENGTH + _DIGEST + len(MAGIC)
_LONGEST_JSON = 1 << 24  # bytes; the JSON of a table of 60 columns has 2,000
_BLOCK = 1 << 20  # bytes that are read at once
_HEAD = 1 << 24  # bytes at the beginning of a file in which its attributes are searched for
_HDF5 = b"\x89HDF\r\n\x1a\n"
# Position of the bytes of a file that contain the length of its HDF5 content. They are part of the
# superblock, in the version that h5py writes by default.
_END_OF_HDF5 = slice(40, 48)
_UNFINISHED_NAME = re.compile(r"\..*\.[0-9]+\.tmp")  # temporary name that `replacing` gives a file

# Offset and length of each computed column in bytes, by group, then by name of the column.
Regions = Mapping[str, Mapping[str, tuple[int, int]]]


class Trailer(NamedTuple):
    """The content of a trailer that was checked.

    Attributes
    ----------
    kind : kind of the file.
    groups : locations of the computed columns.
    inode : inode of the file that was checked.
    digest : SHA-256 of the file without its computed columns.
    """

    kind: str
    groups: Regions
    inode: int
    digest: bytes


def trailer_of(file: IO[bytes], kind: str, groups: Regions) -> bytes:
    """Return the trailer that is to be appended to an HDF5 file after its layout."""
    text = json.dumps(
        {"format_version": FORMAT_VERSION, "kind": kind, "groups": groups}, separators=(",", ":")
    )
    head = text.encode() + len(text.encode()).to_bytes(_LENGTH, "little")
    digest = hashlib.sha256()
    for block in _blocks(file, file.seek(0, 2), groups):
        digest.update(block)
    digest.update(head)
    return head + digest.digest() + MAGIC


def digest_of(trailer: bytes) -> bytes:
    """Return the digest in the bytes of a trailer."""
    return trailer[-_DIGEST - len(MAGIC) : -len(MAGIC)]


def is_of_this_program(path: Path) -> bool:
    """Return whether a file ends like a file of this program; it may still be damaged."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        file.seek(max(file.seek(0, os.SEEK_END) - len(MAGIC), 0))
        return file.read() == MAGIC


def read_trailer(path: Path) -> Trailer:
    """Read and check the trailer of a file.

    If no error is raised, the whole file except its rows is as it was written.

    Parameters
    ----------
    path : the file.

    Raises
    ------
    StoreError
        If the file cannot be read, is not of this program and format, or has changed.
    """
    if not path.is_file():
        found = "is a folder" if path.is_dir() else "no such file"
        raise StoreError(
            f"{path}: {found}; allowed: a results file, as rotor-mbs run or reproduce writes it"
        )
    try:
        with path.open("rb") as file:
            return _read_checked(path, file)
    except OSError as exc:
        raise StoreError(f"{path}: cannot be read: {exc.strerror}") from exc


def _read_checked(path: Path, file: IO[bytes]) -> Trailer:
    """Check the digest of an open file, and return its trailer.

    Parameters
    ----------
    path : path of the file, for the message.
    file : the file, open for reading.

    Raises
    ------
    StoreError
        If the file has no trailer, has changed, or has another format.
    """
    size = file.seek(0, 2)
    file.seek(max(size - _TAIL, 0))
    tail = file.read(_TAIL)
    if len(tail) < _TAIL or not tail.endswith(MAGIC):
        raise StoreError(f"{path}: {_reason_without_trailer(path, file, size)}")
    damaged = StoreError(
        f"{path}: damaged: what was laid out is not as it was written (its digest does not match)"
    )
    length = int.from_bytes(tail[:_LENGTH], "little")
    end = size - _TAIL - length
    if end < 0 or length > _LONGEST_JSON:
        raise damaged
    file.seek(end)
    text = file.read(length)
    try:
        content = json.loads(text)
        version, kind, groups = content["format_version"], content["kind"], content["groups"]
        digest = hashlib.sha256()
        for block in _blocks(file, end, groups):
            digest.update(block)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        raise damaged from None
    digest.update(text + tail[:_LENGTH])
    if digest.digest() != digest_of(tail):
        raise damaged
    if version != FORMAT_VERSION:
        raise StoreError(
            f"{path}: format_version {version!r}, this program reads {FORMAT_VERSION}; allowed: a "
            "file of this version, with its runs recomputed"
        )
    if not isinstance(kind, str) or not _kind_in_words(kind):
        raise StoreError(
            f"{path}: damaged: kind {kind!r}; allowed: {', '.join(_KINDS)}, {SPLIT_OF}FILE"
        )
    return Trailer(kind, groups, os.fstat(file.fileno()).st_ino, digest.digest())


def refuse_split(path: Path, kind: str) -> None:
    """Raise StoreError for a file that is a split of a sweep's dataset."""
    if kind.startswith(SPLIT_OF):
        whole = kind.removeprefix(SPLIT_OF)
        raise StoreError(
            f"{path}: a split for Hugging Face datasets; allowed: the sweep's own file, {whole}"
        )


def may_extend(path: Path, kind: str) -> bool:
    """Return whether there is a file that a command can extend; otherwise it writes a new file.

    An empty file counts as no file.

    Parameters
    ----------
    path : the file that the command is to write.
    kind : kind of the command's output.

    Raises
    ------
    InputError
        If the file is of another kind.
    StoreError
        If the file is damaged or not of this program, or `path` is a folder.
    """
    if path.is_dir():
        raise StoreError(f"{path}: is a folder; allowed: the name of a file")
    if not path.exists() or (path.is_file() and path.stat().st_size == 0):
        return False
    found = read_trailer(path).kind
    if found != kind:
        raise InputError(
            f"{path}: holds {_kind_in_words(found)}, and this command writes "
            f"{_kind_in_words(kind)}; allowed: another output file"
        )
    return True


def _kind_in_words(kind: str) -> str:
    """Return what a file of a kind holds, in words; "" for an unknown kind."""
    return kind if kind.startswith(SPLIT_OF) else _KINDS.get(kind, "")


def _blocks(file: IO[bytes], end: int, groups: Regions) -> Iterator[bytes]:
    """Yield the bytes of a file that are outside its computed columns, in blocks.

    Parameters
    ----------
    file : the file, open for reading.
    end : position in bytes at which the last block ends.
    groups : locations of the computed columns.

    Raises
    ------
    ValueError, TypeError, AttributeError
        If `groups` has other content than locations, or they overlap or exceed `end`.
    """
    regions = []
    for columns in groups.values():
        regions += [tuple(region) for region in columns.values()]
    regions = sorted(region for region in regions if region[1])
    position = 0
    for start, length in [*regions, (end, 0)]:
        if not position <= start <= start + length <= end:
            raise ValueError(f"{length} bytes at {start}")
        file.seek(position)
        while position < start:
            block = file.read(min(start - position, _BLOCK))
            if not block:
                raise ValueError("the file became shorter")
            yield block
            position += len(block)
        position = start + length


def _reason_without_trailer(path: Path, file: IO[bytes], size: int) -> str:
    """Return in words why a file does not end with a trailer.

    Parameters
    ----------
    path : path of the file. The temporary name of an unfinished layout is recognized.
    file : the file, open for reading.
    size : size of the file in bytes.
    """
    file.seek(0)
    head = file.read(_HEAD)
    if _UNFINISHED_NAME.fullmatch(path.name):
        return "a layout that was interrupted; allowed: to remove it"
    if not head.startswith(_HDF5):
        return "not an HDF5 file; allowed: a file that rotor-mbs wrote"
    end = int.from_bytes(head[_END_OF_HDF5], "little")
    if INTEGRITY.encode() in head:
        if size < end:
            return f"cut off: {size} bytes of more than {end}"
        if size == end:
            return "changed: another program has written to it since (its trailer is gone)"
        return "cut off, or another program has written to it (its trailer is not at its end)"
    if b"rotor_mbs" in head and b"format_version" in head:
        return (
            f"of an earlier format, this program reads format_version {FORMAT_VERSION}; allowed: "
            "to compute it again"
        )
    return "not a file of this program, or damaged; allowed: a file that rotor-mbs wrote"
