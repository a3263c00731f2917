"""The only file that knows h5py: atomic files that HDF5 1.10, netCDF-4 readers, MATLAB and Octave can open; digests of
what they hold, by which a changed bit is found and located; the lock under which an output is written."""

from __future__ import annotations

import hashlib
import json
import os
import re
import secrets
import socket
import threading
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError, StoreError

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer as Buffer


FORMAT = "rotor_mbs"
FORMAT_VERSION = 2
CONVENTIONS = "CF-1.11, ACDD-1.3"
# What every file is about: the attribute `keywords` of the ACDD conventions.
KEYWORDS = "multibody dynamics, wind turbine rotor, Euler-Lagrange equations, model verification"
HDF5 = b"\x89HDF"  # what a file begins with
_LARGEST_REPLACED = 1 << 28  # bytes, of an output that is not HDF5
DIGESTS = "digests"  # the attribute with the digests of a group
_NOT_ATTRIBUTES = (DIGESTS, "CLASS", "NAME", "REFERENCE_LIST", "DIMENSION_LIST", "_Netcdf4Dimid", "_Netcdf4Coordinates")
CHARACTERS = "characters"  # the dimension of texts that are filled in later
# What a lock file holds, unless its process was killed before it wrote.
_OWNER = rb"(process [0-9]+ on [!-~]*)?\Z"
# The netCDF-4 library's name for the scale of a dimension without values.
_WITHOUT_VALUES = "This is a netCDF dimension but not a netCDF variable."

# What h5py and HDF5 raise on damaged files, and what plain code does with what they return.
_DAMAGE = (
    KeyError, OSError, RuntimeError, ValueError, TypeError, AttributeError, IndexError, OverflowError, MemoryError,
    NotImplementedError,
)  # fmt: skip

# An array may be larger than its bytes in the file, where it is compressed: up to a factor, and a size in any case.
_UNPACKED, _UNPACKED_BYTES = 100, 1 << 26


class Column(NamedTuple):
    """A dataset: its dimensions (names of scales; a scale has its own name), units, what it is, the type of its values
    in the file, and further attributes."""

    dimensions: tuple[str, ...]
    units: str
    long_name: str
    kind: str = "<f8"
    attributes: Mapping[str, Any] = MappingProxyType({})


@contextmanager
def saving(path: object) -> Iterator[None]:
    """What the system refuses in the block is a StoreError about `path`."""
    try:
        yield
    except OSError as exc:
        raise StoreError(f"{path}: cannot be written: {exc.strerror or exc}; nothing stored before is lost") from exc


@contextmanager
def new_file(path: Path) -> Iterator[Any]:
    """A new HDF5 file, put in the place of `path` when all of it is written and on the disk.

    It is made in memory: HDF5 does not survive a disk that fills up under it, a plain write does. Raises StoreError
    where the file cannot be written; what stood at `path` before then still stands.
    """
    memory = {"driver": "core", "backing_store": False, "block_size": 1 << 20}
    with begin_file(f"{path.name}.{threading.get_ident()}", **memory) as file:
        yield file
        file.flush()
        image = file.id.get_file_image()
    replace_file(path, image, HDF5)


def begin_file(place: Path | str, **driver: object) -> Any:
    """A new HDF5 file with the attributes of the format; on the disk, where it must not fill up, without a `driver`."""
    file = h5py.File(place, "w", libver=("earliest", "v108"), track_order=True, **driver)
    file.attrs["Conventions"] = CONVENTIONS
    file.attrs["format"] = FORMAT
    file.attrs["format_version"] = FORMAT_VERSION
    return file


def replace_file(path: Path, content: Buffer, mark: bytes) -> None:
    """`content` under a temporary name beside `path`, forced to the disk, then renamed.

    Of a symbolic link the file that it points to is replaced; a device or a pipe is written to. mark: see
    `refuse_foreign`. Raises InputError where `path` is a file of another kind, StoreError where it cannot be written.
    """
    refuse_foreign(path, mark)
    if path.exists() and not path.is_file() and not path.is_dir():
        with saving(path):
            path.write_bytes(content)
        return
    with replacing(path.resolve() if path.is_symlink() else path) as temporary, temporary.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def refuse_foreign(path: Path, mark: bytes) -> None:
    """Raises InputError where `path` is a file that this program did not write as an output of the same kind.

    mark: a regular expression that is found in every output of the kind; HDF5: the attribute of the format instead. An
    empty file may be replaced.
    """
    if not path.is_file():
        return
    with saving(path):
        size = path.stat().st_size
        if mark == HDF5:
            is_own = size == 0 or is_of_this_program(path)
        else:
            is_own = size == 0 or (size <= _LARGEST_REPLACED and re.search(mark, path.read_bytes()) is not None)
    if not is_own:
        raise InputError(
            f"{path}: is not an output of this command and is not replaced; allowed: another name, or remove that file"
        )


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """The name of a new, empty file beside `path`, which takes its place after the block. Raises StoreError.

    The name cannot be guessed, and a file or link of that name is not opened.
    """
    temporary = path.with_name(f".{path.name}.{secrets.randbits(60)}.tmp")
    with saving(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.open("xb").close()
        try:
            yield temporary
            temporary.replace(path)
        finally:
            with suppress(OSError):
                temporary.unlink()


@contextmanager
def open_file(path: Path) -> Iterator[Any]:
    """An existing results file, read only. Raises StoreError where it is missing, damaged or another program's."""
    if not path.is_file():
        found = "is a folder" if path.is_dir() else "no such file"
        raise StoreError(f"{path}: {found}; allowed: a results file, as rotor-mbs run or reproduce writes it")
    try:
        path.open("rb").close()
    except OSError as exc:
        raise StoreError(f"{path}: cannot be read: {exc.strerror}") from exc
    try:
        file = h5py.File(path, "r")
    except OSError as exc:
        raise StoreError(
            f"{path}: not a readable HDF5 file ({_reason(exc)}); allowed: a file that rotor-mbs wrote"
        ) from exc
    with file:
        with reading(path):
            written_by, version = (attribute(file, name) for name in ("format", "format_version"))
        if written_by != FORMAT:
            raise StoreError(f"{path}: its attribute format is {written_by!r}; allowed: a file that rotor-mbs wrote")
        if version != FORMAT_VERSION:
            raise StoreError(
                f"{path}: format_version {version!r}, this program reads {FORMAT_VERSION}; allowed: a file of this "
                "version, with its runs recomputed"
            )
        yield file


@contextmanager
def reading(path: Path | str, what: str = "") -> Iterator[None]:
    """Whatever goes wrong in reading a file that may be damaged is a StoreError that names the place."""
    try:
        yield
    except StoreError:
        raise
    except _DAMAGE as exc:
        place = f"{path}: {what}" if what else f"{path}"
        reason = str(exc).splitlines()[0][:150] if str(exc) else type(exc).__name__
        raise StoreError(f"{place}: damaged or incomplete ({reason})") from exc


def member(group: Any, name: str) -> Any:
    """A member of a group. Raises KeyError where there is none, StoreError at a link."""
    if is_link(group, name):
        raise StoreError(
            f"{group.file.filename}: {group.name}/{name} is a link; allowed: groups and arrays of this file"
        )
    return group[name]


def values_of(dataset: Any) -> NDArray[Any]:
    """An array of numbers, or of texts, whole. Raises StoreError where it is not in the file, or claims far more than
    the file holds."""
    place = f"{dataset.file.filename}: {dataset.name}"
    if not isinstance(dataset, h5py.Dataset) or dataset.shape is None:
        raise StoreError(f"{place} is no array")
    layout = dataset.id.get_create_plist()
    if layout.get_external_count() or layout.get_layout() == h5py.h5d.VIRTUAL:
        raise StoreError(f"{place} is stored in another file; allowed: arrays of this file")
    if dataset.dtype.kind == "O":
        if h5py.check_string_dtype(dataset.dtype) is None:
            raise StoreError(f"{place} is no array")
        return np.array([plain(text) for text in dataset[()]], dtype=object)
    kept = dataset.id.get_storage_size()
    if kept > dataset.file.id.get_filesize() or dataset.nbytes > max(_UNPACKED_BYTES, _UNPACKED * kept):
        raise StoreError(f"{place} claims {dataset.nbytes:.2g} bytes and has {kept:.2g}")
    values: NDArray[Any] = dataset[()]
    return values


def new_group(parent: Any, name: str) -> Any:
    """A group, and those above it, that list their members in the order of writing."""
    for part in name.split("/"):
        parent = parent[part] if part in parent else parent.create_group(part, track_order=True)
    return parent


def put(group: Any, name: str, values: Any, column: Column) -> Any:
    """A dataset of numbers or texts. The scales of its dimensions must be there; a scale is its own dimension."""
    is_text = len(values) > 0 and isinstance(values[0], str)
    data = np.array(list(values), dtype=h5py.string_dtype()) if is_text else np.asarray(values)
    return _described(group.create_dataset(name, data=data), group, column)


def _described(dataset: Any, group: Any, column: Column) -> Any:
    put_attributes(dataset, {"units": column.units, "long_name": column.long_name, **column.attributes})
    for axis, dimension in enumerate(column.dimensions):
        if group[dimension] == dataset:
            dataset.make_scale(dimension)
        else:
            dataset.dims[axis].attach_scale(group[dimension])
    return dataset


def put_dimension(group: Any, name: str, length: int) -> None:
    """A dimension without values, as the netCDF-4 library has them."""
    scale = group.create_dataset(name, (length,), ">f4")
    scale.make_scale(f"{_WITHOUT_VALUES}{length:10d}")


def is_dimension_only(dataset: Any) -> bool:
    """Whether a dataset is a dimension without values."""
    return str(attribute(dataset, "NAME", "")).startswith(_WITHOUT_VALUES)


def put_attributes(target: Any, values: Mapping[str, object]) -> None:
    """Numbers as float64 or int64, truth as int8 (netCDF-4 has no booleans), lists of names as strings."""
    for name, value in values.items():
        if isinstance(value, bool):
            target.attrs[name] = np.int8(value)
        elif isinstance(value, (list, tuple)):
            target.attrs.create(name, list(value), dtype=h5py.string_dtype())
        else:
            target.attrs[name] = value


def plain(value: Any) -> Any:
    """An attribute as a plain Python value."""
    if isinstance(value, np.ndarray):
        return [plain(item) for item in value]
    if isinstance(value, bytes):
        return value.decode()
    return value.item() if isinstance(value, np.generic) else value


def attributes_of(target: Any) -> dict[str, Any]:
    """As plain Python values, without those that the library writes and changes by itself, and the digests."""
    return {name: attribute(target, name) for name in target.attrs if name not in _NOT_ATTRIBUTES}


def attribute(target: Any, name: str, default: Any = None) -> Any:
    """As a plain Python value; the default where there is none. Raises ValueError for a type that no attribute has.

    In a damaged file a text may have become a list of any type: reading it ends the process.
    """
    if name not in target.attrs:
        return default
    if isinstance(h5py.h5a.open(target.id, name.encode()).get_type(), h5py.h5t.TypeVlenID):
        raise ValueError(f"attribute {name} is neither a number nor a text")
    return plain(target.attrs[name])


def dimensions_of(dataset: Any) -> list[str]:
    """The names of its scales; "" where a dimension has none.

    By the attribute of the scale: the library would look for its path through the whole file, and its own way to the
    name ends the process where that is damaged.
    """
    names = [str(attribute(dimension[0], "NAME")) if len(dimension) else "" for dimension in dataset.dims]
    return [CHARACTERS if name.startswith(_WITHOUT_VALUES) else name for name in names]


def columns_of(group: Any) -> dict[str, Column]:
    """What the datasets of a group are, by name."""
    columns = {}
    for name, dataset in group.items():
        if not is_group(dataset) and not is_dimension_only(dataset):
            dimensions = tuple(dimension or name for dimension in dimensions_of(dataset))
            # Lists of texts as such; numbers as they are, whose type belongs to the attribute.
            attributes = {
                name: dataset.attrs[name] if isinstance(value, list) and not isinstance(value[0], str) else value
                for name, value in attributes_of(dataset).items()
                if name != "_Encoding"
            }
            units, long_name = (str(attributes.pop(name)) for name in ("units", "long_name"))
            columns[name] = Column(dimensions, units, long_name, dataset.dtype.str, attributes)
    return columns


def groups_in(group: Any, seen: set[Any] | None = None) -> Iterator[Any]:
    """A group and every one below it, but for those below a table. Raises StoreError at a link or a second name."""
    seen = set() if seen is None else seen
    if group in seen:
        raise StoreError(
            f"{group.file.filename}: {group.name} is a second name of a group; allowed: one name for each group"
        )
    seen.add(group)
    yield group
    for name in () if "run" in group else group:
        item = member(group, name)
        if is_group(item):
            yield from groups_in(item, seen)


def is_link(group: Any, name: str) -> bool:
    """Whether a member of a group stands elsewhere, in this file or another one."""
    return not isinstance(group.get(name, getlink=True), h5py.HardLink)


def is_group(item: Any) -> bool:
    return isinstance(item, h5py.Group)


def put_empty(group: Any, name: str, shape: tuple[int, ...], kind: Any, column: Column, fill: int | None = None) -> Any:
    """A contiguous dataset that has its place in the file now and is written by others; fill: its first value, by
    default what the file system makes of a new file, zeros."""
    layout = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    layout.set_layout(h5py.h5d.CONTIGUOUS)
    layout.set_obj_track_times(False)  # the same call gives the same bytes
    layout.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    layout.set_fill_time(h5py.h5d.FILL_TIME_NEVER if fill is None else h5py.h5d.FILL_TIME_ALLOC)
    if fill is not None:
        layout.set_fill_value(np.array(fill, kind))
    dataset = _described(group.create_dataset(name, shape, kind, dcpl=layout), group, column)
    if np.dtype(kind).kind == "S":
        dataset.attrs["_Encoding"] = "utf-8"
    return dataset


def sync_folder(folder: Path) -> None:
    """Makes a new or replaced name in `folder` durable, where the system can."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _reason(error: Exception) -> str:
    """What HDF5 says in brackets, "file signature not found", without the name of its function."""
    text = str(error).splitlines()[0]
    return text.partition("(")[2].rpartition(")")[0] or text


def is_of_this_program(path: Path) -> bool:
    try:
        with h5py.File(path, "r") as file:
            return bool(attribute(file, "format") == FORMAT)
    except (OSError, RuntimeError, ValueError):
        return False


def read_arrays(path: Path, group: str = "", scene: str = "") -> tuple[dict[str, NDArray[Any]], dict[str, str]]:
    """Arrays of numbers of up to three dimensions and their units by name, of any HDF5 file: those of one group.

    group: its path, or the end of it; may be left out where one group alone has arrays, or one alone but the reference
    below `scene`. Raises StoreError with the groups that there are.
    """
    try:
        with h5py.File(path, "r") as file:
            places = _array_places(file)
            name = chosen_group(path, list(places), group.strip("/"), scene)
            chosen = file[name or "/"]
            arrays = {name: chosen[name][()] for name in places[name]}
            units = {name: str(attribute(chosen[name], "units", "")) for name in arrays}
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as exc:
        raise StoreError(f"{path}: not a readable HDF5 file ({_reason(exc)})") from exc
    return arrays, {name: unit for name, unit in units.items() if unit}


def chosen_group(path: Path, places: Sequence[str], group: str, scene: str) -> str:
    """The one of `places` that is meant, see `read_arrays`. Raises StoreError."""
    inside = [place for place in places if place.startswith(f"{scene}/")] or list(places)
    if group:
        fitting = [place for place in inside if place == group]
        fitting = fitting or [place for place in inside if f"/{place}".endswith(f"/{group}")]
    else:
        fitting = [place for place in inside if not place.endswith("/reference")]
    if len(fitting) == 1:
        return fitting[0]
    if not places:
        raise StoreError(f"{path}: no arrays of numbers in it; allowed: a time and angles")
    shown = ", ".join(place or "/" for place in inside[:12]) + (", ..." if len(inside) > 12 else "")
    problem = f"no group {group!r}" if group else "arrays in several groups"
    raise StoreError(f"{path}: {problem}; allowed: a mapping file with group = one of {shown}")


def _array_places(file: Any) -> dict[str, list[str]]:
    """Names of the arrays of numbers by their group; groups without any are left out."""
    places: dict[str, list[str]] = {}

    def note(path: str, item: Any) -> None:
        if (
            isinstance(item, h5py.Dataset)
            and item.dtype.kind in "fiu"
            and 0 < len(item.shape or ()) <= 3
            and item.size > 1
        ):
            folder, _, name = path.rpartition("/")
            places.setdefault(folder, []).append(name)

    file.visititems(note)
    return places


# Digests: the attribute `digests` of a group is a JSON object, SHA-256 by the name of each dataset, over values and
# attributes, and by "attributes" over the group's own. Of columns that are filled later it covers the attributes alone.

ATTRIBUTES = "attributes"
_COMPUTED = "attributes of "


def array_digest(values: NDArray[Any], attributes: str = "") -> str:
    """Over shape and values as little-endian numbers: the same on every machine and for every HDF5 layout; attributes:
    their digest, where it is over these, too."""
    if values.dtype.kind == "O":  # texts
        digest = hashlib.sha256("\0".join(map(str, values.tolist())).encode())
    else:
        values = np.ascontiguousarray(values)
        digest = hashlib.sha256(f"{values.dtype.kind}{values.dtype.itemsize}{values.shape}".encode())
        digest.update(values.astype(values.dtype.newbyteorder("<"), copy=False).tobytes())
    digest.update(attributes.encode())
    return digest.hexdigest()


def attributes_digest(target: Any) -> str:
    """Over names and values, in any order."""
    return hashlib.sha256(json.dumps(attributes_of(target), sort_keys=True).encode()).hexdigest()


def seal(group: Any, later: Collection[str] = ()) -> None:
    """Store the digests of a group; of the datasets `later`, which are computed later, those of their attributes."""
    sums = {ATTRIBUTES: attributes_digest(group)}
    for name, item in group.items():
        if name in later:
            sums[f"{_COMPUTED}{name}"] = attributes_digest(item)
        elif not is_group(item) and not is_dimension_only(item):
            sums[name] = _digest_of(item)
    group.attrs[DIGESTS] = json.dumps(sums)


def _digest_of(dataset: Any) -> str:
    """Over values, units, long name and further attributes."""
    return array_digest(values_of(dataset), attributes_digest(dataset))


def seal_all(group: Any) -> None:
    """Store the digests of every group that has none yet."""
    if DIGESTS not in group.attrs:
        seal(group)
    for name in group:
        if is_group(group.get(name)):
            seal_all(group[name])


def damages_of(group: Any, *, with_columns: bool = True) -> list[str]:
    """The parts of a group, "attributes" or names of datasets, that are not what was written, are new or are gone.

    "digests" where it has none. Links, and arrays that cannot be read, count too. with_columns: the attributes of
    datasets that are computed, too, which takes most of the time.
    """
    try:
        known = stored_digests(group)
    except ValueError:
        known = {}
    if not known:
        return [DIGESTS]
    sums = {ATTRIBUTES: attributes_digest(group)}
    for name in group:
        is_computed = f"{_COMPUTED}{name}" in known
        label = f"{_COMPUTED}{name}" if is_computed else name
        if is_computed and not with_columns and not is_link(group, name):
            sums[label] = known[label]
            continue
        sums[label] = ""
        with suppress(StoreError), reading(""):
            item = member(group, name)
            if is_group(item) or is_dimension_only(item):
                del sums[label]
            else:
                sums[label] = attributes_digest(item) if is_computed else _digest_of(item)
    return [name for name in {**known, **sums} if known.get(name) != sums.get(name)]


def stored_digests(group: Any) -> dict[str, str]:
    """By name; {} where there are none. Raises ValueError where they cannot be read."""
    found = json.loads(str(attribute(group, DIGESTS, "{}")))
    if not isinstance(found, dict):
        raise ValueError("no object of digests")
    return found


def computed_in(digests: Mapping[str, str]) -> list[str]:
    """The datasets whose attributes alone are covered."""
    return [name.removeprefix(_COMPUTED) for name in digests if name.startswith(_COMPUTED)]


# The lock: a file beside an output that no other process may write, which goes afterwards.


@contextmanager
def writing(output: Path) -> Iterator[None]:
    """No other process writes `output` in the block; its thread may enter it again. Raises InputError, StoreError."""
    from filelock import FileLock, Timeout

    place = _resolved(output)
    path = _lock_of(place)
    lock = FileLock(path, timeout=0, is_singleton=True)
    if lock.is_locked:  # by this thread: a study takes the lock, and so does what it calls
        yield
        return
    owner = b""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_file():
            with suppress(OSError):
                owner = path.read_bytes()
        if path.is_symlink() or (path.exists() and not path.is_file()) or not re.match(_OWNER, owner):
            raise InputError(f"{path}: was not written by rotor-mbs; allowed: another output, or remove it")
        lock.acquire()
    except Timeout:
        writer = f"another process is writing it now{f' ({owner.decode()})' if owner else ''}"
        raise InputError(f"{output}: {writer}; allowed: wait for its end, or another output") from None
    except OSError as exc:
        raise StoreError(f"{output}: cannot be written: {exc.strerror}") from exc
    try:
        # Half-written files of processes that were killed: nobody else writes this output now.
        temporary = re.compile(rf"\.{re.escape(place.name)}\.([0-9]+\.)?tmp")
        for beside in place.parent.iterdir():
            if temporary.fullmatch(beside.name):
                with suppress(OSError):
                    beside.unlink()
        with suppress(OSError):  # a full disk is reported by what is written to the output
            path.write_text(f"process {os.getpid()} on {socket.gethostname()}")
        yield
    finally:
        with suppress(OSError):
            path.unlink()
        lock.release()


def is_being_written(output: Path) -> bool:
    """Whether another process writes it now, or was killed while it did."""
    return _lock_of(_resolved(output)).exists()


def _lock_of(place: Path) -> Path:
    return place.with_name(f".{place.name}.lock")


def _resolved(output: Path) -> Path:
    """The file itself where the output is a symbolic link: both names are one output."""
    try:
        return output.resolve() if output.is_symlink() else Path(os.path.abspath(output))  # noqa: PTH100  (links stay)
    except (OSError, RuntimeError) as exc:  # links in a circle, a working folder that is gone
        reason = getattr(exc, "strerror", None) or "leads to no file"
        raise StoreError(f"{output}: cannot be written: {reason}") from exc
