"""Read a file of any format, in the worker process that `comparison.files` starts.

Libraries read the numbers. pandas reads text and tables in JSON; NumPy reads .npz; pymatreader and
SciPy read MAT files; SciPy reads netCDF-3; h5py reads HDF5 and netCDF-4; openfast_io reads .outb.
xarray unpacks arrays of netCDF and HDF5 by the CF conventions. The headers of text files, including
those of OpenFAST and Exudyn, are read by the code below.

A file may be damaged or malicious. The size of the arrays that a file claims to have is therefore
checked before they are read. The process has limits of memory and time for all other cases. The
regular expressions below take a time that is proportional to the length of the text.
"""

from __future__ import annotations

import csv
import io
import itertools
import json
import math
import re
import struct
import warnings
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.comparison.columns import (
    MAX_COLUMNS,
    MAX_NAME,
    DataColumn,
    DataTable,
    LeftOut,
    arrays_of,
    split_bracketed_unit,
    table_of,
)
from rotor_mbs.comparison.units import unit_factor, unit_of_attributes
from rotor_mbs.errors import InputError, RotorError

# Largest size of a file in bytes, and of all its arrays after unpacking. A million rows of ten
# columns take 80 MB.
MAX_BYTES = 1 << 29
# Largest number of characters of a message, which may contain names from the file.
_MAX_PROBLEM = 2000
FORMATS = "text with a header, .json, .npz, .mat, HDF5, netCDF, OpenFAST .out and .outb"
_HDF5, _NETCDF3 = b"\x89HDF\r\n\x1a\n", b"CDF"
_ZIP, _MATLAB_5, _MATLAB_73 = b"PK\x03\x04", b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file"
_MATLAB_NUMBERS = {
    "double", "single", "logical", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32",
    "uint64",
}  # fmt: skip
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")  # first bytes of "Unicode text" from a spreadsheet program
# Numbers that the netCDF library stores in rows that no program has written, by type. A file may
# state another number.
_DEFAULT_FILL = {
    "f4": 9.969209968386869e36,
    "f8": 9.969209968386869e36,
    "i1": -127,
    "i2": -32767,
    "i4": -2147483647,
    "i8": -9223372036854775806,
}
# Attributes of an array that is packed or has missing values.
_PACKING = ("scale_factor", "add_offset", "_FillValue", "missing_value")
_MAX_PARTS = 10_000  # largest number of arrays, cells and fields read from a MAT or JSON file

# Constants for text files: comma-separated values, columns separated by blanks, Exudyn's files, and
# OpenFAST's `.out`.
_COMMENT = ("#", "%", "//", "!")  # first characters of a comment line
_DIVIDERS = (";", "\t", ",", None)  # separators of fields; None stands for blanks
_OPENFAST_HEAD = re.compile(r"^Predictions were generated .{0,80}\b(?:Open)?FAST\b")
_EXUDYN = re.compile(r"OutputVariableType = (\w+)")
# The head of Exudyn's solution file has the number of columns of each kind; the time is the first
# column and not counted.
_EXUDYN_SOLUTION = re.compile(r"written coordinates \[[^\][]*\] = \[([\d, ]+)\]")
_EXUDYN_KINDS = (
    "coordinates", "coordinates_t", "accelerations", "ode1", "ode1_t", "algebraic", "data",
)  # fmt: skip
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
_FORTRAN = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d)")  # 1.5D-03
# 0.123456-101: Fortran leaves out the E before an exponent of three digits.
_FORTRAN_3_DIGITS = re.compile(r"(?<=[\d.])(?=[+-]\d{3}$)")
# Texts that programs write in place of a missing number. The first row of numbers may have them.
_MISSING = re.compile(r"\*+|-+|\?|#?n/?a!?|null|none|missing|nil", re.IGNORECASE)
# Number of lines, from the first on, that are searched for the header of a table in which columns
# are texts or vectors.
_MAX_SEARCHED = 200

Arrays = Mapping[str, Any]
Units = Mapping[str, str]
Lines = Sequence[tuple[int, str]]  # the number of each line in the file, and its text


def read_in_worker(arguments: tuple[Path, str, str]) -> DataTable:
    """Read a file in the worker process that `comparison.files` starts.

    Parameters
    ----------
    arguments : the arguments path, group and scene of `read_columns`.

    Returns
    -------
    DataTable
        The columns of the file; names and units are cut to a bounded length.

    Raises
    ------
    InputError
        If the file cannot be read; names and messages are of bounded length.
    MemoryError
        If reading takes more memory than the process has.
    """
    path, group, scene = arguments
    csv.field_size_limit(MAX_BYTES)
    try:
        with warnings.catch_warnings(action="ignore"):
            table = read_columns(path, group, scene)
        columns = {}
        for label, column in _short_names(table.columns).items():
            columns[label] = column._replace(unit=column.unit[:MAX_NAME])
        headers = {}
        for label, header in table.headers.items():
            headers[label] = header[:MAX_NAME]
        left_out = _short_names(table.left_out)
        return replace(table, columns=columns, left_out=left_out, headers=_short_names(headers))
    except RotorError as exc:
        problems = [line[:_MAX_PROBLEM] for line in str(exc).splitlines()]
    except MemoryError:
        raise
    except RecursionError:
        problems = [f"{path}: cannot be read: nested too deeply; allowed: {FORMATS}"]
    except Exception as exc:  # a library may raise any exception for a damaged file
        problems = [f"{path}: cannot be read: {_line(exc)}; allowed: {FORMATS}"]
    raise InputError(problems)


def _line(exc: BaseException) -> str:
    """Return the first line of an exception's text, up to 200 characters; its type if no text."""
    lines = str(exc).splitlines()
    return lines[0][:200] if lines else type(exc).__name__


def _short_names(by_name: Mapping[str, Any]) -> dict[str, Any]:
    """Return values by name, with long names cut but still distinct."""
    short = {}
    for number, (name, value) in enumerate(by_name.items(), start=1):
        label = name if len(name) <= MAX_NAME else f"{name[:MAX_NAME]}... (column {number})"
        short[label] = value
    return short


def read_columns(path: Path, group: str, scene: str) -> DataTable:
    """Read the columns of a file of any format.

    Parameters
    ----------
    path : the file. The format is recognized by the first bytes of the file; OpenFAST's binary
        output is recognized by its ending `.outb`.
    group, scene : the group of an HDF5 file that is read, and the name of a scene whose groups are
        preferred, see `runs.arrays.read_arrays`.

    Raises
    ------
    RotorError
        If the file cannot be read. Other exceptions, which libraries raise, are not caught here.
    """
    with path.open("rb") as file:
        begin = file.read(1024)
    source = str(path)
    # The last four of the 128 bytes of MATLAB's header are the version and the byte order.
    has_version = begin[124:128] in (b"\x00\x02IM", b"\x02\x00MI")
    is_matlab_73 = begin.startswith(_MATLAB_73) and has_version
    # A file of MATLAB 7.3 has 512 bytes of MATLAB before the signature of HDF5.
    is_hdf5 = begin.startswith(_HDF5) or begin[512:].startswith(_HDF5)
    if group and (is_matlab_73 or not is_hdf5):
        problem = f"a format without groups, but the mapping has group = {group!r}"
        raise InputError(f"{path}: {problem}; allowed: leave `group` out, or an HDF5 file")
    if begin.startswith(_ZIP):
        arrays, objects = _numpy_archive(path)
        table = table_of(source, arrays)
        left_out = {name: LeftOut("an array of Python objects", True) for name in objects}
        return replace(table, left_out={**table.left_out, **left_out})
    if begin.startswith(_MATLAB_5) or _is_matlab_4(begin) or is_matlab_73:
        return table_of(source, _matlab(path, is_hdf5=is_matlab_73))
    if begin.startswith(_NETCDF3):
        return _decoded(source, *_netcdf_3(path))
    if path.suffix.lower() == ".outb":
        return replace(table_of(source, *_openfast(path)), program="openfast")
    if is_hdf5:
        return _hdf5(path, group, scene)
    if b"\x00" in begin and not begin.startswith(_UTF_16):
        raise InputError(f"{path}: not a format that can be read; allowed: {FORMATS}")
    content = path.read_bytes()
    try:
        text = content.decode("utf-16" if content.startswith(_UTF_16) else "utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    del content
    if _is_json(text):
        table = table_of(source, *_json(text))
        # If the file has NaN too, a missing number may be a NaN instead of a null; the message then
        # does not say "null".
        return table if "NaN" in text else _with_nulls(table)
    return _read_text(source, text)


def _refuse_large(path: Path, size: float) -> None:
    """Raise InputError if the size of all arrays of a file, in bytes, is above `MAX_BYTES`."""
    if size > MAX_BYTES:
        allowed = f"up to {MAX_BYTES / 2**30:g} GB: export fewer rows or arrays"
        raise InputError(f"{path}: its arrays claim {size / 2**30:.1f} GB; allowed: {allowed}")


def _numpy_archive(path: Path) -> tuple[Arrays, list[str]]:
    """Read the arrays of an .npz file.

    Parameters
    ----------
    path : the file.

    Returns
    -------
    dict, list of str
        The arrays by name; the names of arrays of Python objects, which are not read.

    Raises
    ------
    InputError
        If the arrays claim more than `MAX_BYTES`.
    """
    # NumPy reads no more of an entry than the size that the archive declares, so the declared sizes
    # are checked.
    with zipfile.ZipFile(path) as entries:
        _refuse_large(path, sum(entry.file_size for entry in entries.infolist()))
    arrays: dict[str, Any] = {}
    objects: list[str] = []
    with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
        for name in archive.files:
            try:
                arrays[name] = archive[name]
            except ValueError as exc:
                if "allow_pickle" not in str(exc):
                    raise
                objects.append(name)  # objects are stored as pickles, which can execute any code
    return arrays, objects


# MAT files


def _is_matlab_4(begin: bytes) -> bool:
    """Return whether a file begins with the header of an array in the format of MATLAB 4.

    The header has five integers. The first has machine, precision and kind of the array as decimal
    digits. The others are the number of rows, the number of columns, 1 for a complex array or else
    0, and the length of the name.

    Parameters
    ----------
    begin : the first bytes of the file. A header has 20 bytes.
    """
    if len(begin) < 20:
        return False
    # The file has the byte order of the machine that wrote it; both orders are tried.
    for order in "<>":
        kind, rows, columns, is_complex, length = struct.unpack(f"{order}5i", begin[:20])
        digits = kind // 1000, kind // 100 % 10, kind // 10 % 10, kind % 10
        is_kind = digits[0] in (0, 1) and not digits[1] and digits[2] < 6 and digits[3] < 3
        if is_kind and min(rows, columns) > 0 and is_complex in (0, 1) and 1 < length < 100:
            return True
    return False


def _matlab(path: Path, *, is_hdf5: bool) -> Arrays:
    """Read the arrays of a MAT file of any version.

    Parameters
    ----------
    path : the file.
    is_hdf5 : whether the file has the format of MATLAB 7.3, which is HDF5.

    Returns
    -------
    dict
        The arrays by name. An array in a structure has the name "structure/field", an array in a
        cell array the name "cells/1".

    Raises
    ------
    RotorError
        If the file is damaged, or its arrays claim more than `MAX_BYTES`.
    """
    from pymatreader import read_mat  # imported here, as it takes 0.2 s
    from scipy.io import whosmat

    if is_hdf5:
        from rotor_mbs.runs.arrays import refuse_claims

        refuse_claims(path, MAX_BYTES)
    try:
        if not is_hdf5:
            # Only the headers of the outermost arrays are read. Structures and cells are not
            # unpacked here, so the sizes of arrays in them are not checked.
            shapes = [shape for _, shape, kind in whosmat(path) if kind in _MATLAB_NUMBERS]
            _refuse_large(path, sum(8.0 * math.prod(shape) for shape in shapes))
        content = read_mat(str(path))
    except (RotorError, MemoryError, RecursionError):
        raise
    except Exception as exc:  # SciPy may raise any exception for a damaged file
        raise InputError(f"{path}: not a MAT file that can be read; allowed: {FORMATS}") from exc
    names = [name for name in content if not (name.startswith("__") or name == "#refs#")]
    return dict(_parts("", {name: content[name] for name in names}))


def _parts(path: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the arrays in a nested value with their paths, at most `_MAX_PARTS` of them.

    Parameters
    ----------
    path, value : see `_all_parts`.
    """
    yield from itertools.islice(_all_parts(path, value), _MAX_PARTS)


def _all_parts(path: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the arrays in nested mappings, lists and cells with their paths.

    The arrays in the fields of a mapping are yielded with the path "path/field". The arrays in the
    entries of a list, or of an array of objects, are yielded with the paths "path/1", "path/2"...
    Every other value, also a list of numbers or a list of lists, is yielded itself.

    Parameters
    ----------
    path : path of the value in the file, "" for the whole file.
    value : the value.
    """
    prefix = f"{path}/" if path else ""
    if isinstance(value, Mapping):
        fields = dict(value)
        # This mapping is Simulink's "structure with time". The values of a signal get the signal's
        # label as name.
        if "time" in fields and isinstance(fields.get("signals"), Mapping):
            signals = fields.pop("signals")
            yield from _signals(prefix, signals)
        for name, field in fields.items():
            yield from _all_parts(f"{prefix}{name}", field)
        return
    if isinstance(value, np.ndarray) and value.dtype.kind == "O":
        value = list(value.flat)
    if isinstance(value, list) and any(_has_parts(part) for part in value[:_MAX_PARTS]):
        if all(isinstance(part, list) for part in value):
            yield path, value  # in JSON, an array of two dimensions is a list of rows
            return
        for number, part in enumerate(value, start=1):
            yield from _all_parts(f"{prefix}{number}", part)
        return
    yield path, value


def _has_parts(value: Any) -> bool:
    """Return whether a value is a list, mapping or array that is not empty."""
    return isinstance(value, list | dict | np.ndarray) and len(value) > 0


def _signals(prefix: str, signals: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the values of Simulink's signals, with their labels as names.

    Parameters
    ----------
    prefix : path of the structure, with "/" at its end unless it is empty.
    signals : the structure's field `signals`.
    """
    values, labels = signals.get("values"), signals.get("label", "")
    if not isinstance(values, list):
        values, labels = [values], [labels]
    for number, part in enumerate(values):
        label = labels[number] if isinstance(labels, list) and number < len(labels) else labels
        name = label if isinstance(label, str) and label else f"signals/{number + 1}"
        yield f"{prefix}{name}", part


# netCDF and HDF5


def _netcdf_3(path: Path) -> tuple[Arrays, Mapping[str, Mapping[str, Any]]]:
    """Read the variables of a netCDF-3 file and their attributes.

    Parameters
    ----------
    path : the file.

    Returns
    -------
    arrays, attributes : dict
        The numbers of each variable as they are stored, by name of the variable; the attributes of
        each variable, by name of the variable, then by name of the attribute.

    Raises
    ------
    InputError
        If the arrays claim more than `MAX_BYTES`.
    """
    from scipy.io import netcdf_file

    from rotor_mbs.runs.arrays import ARRAY_ATTRIBUTES

    arrays: dict[str, Any] = {}
    attributes: dict[str, dict[str, Any]] = {}
    # Variables are views of the file, and several variables may be views of the same bytes. A small
    # file may thus claim large arrays, so the sizes are checked before the arrays are copied.
    with netcdf_file(path, "r", mmap=True, maskandscale=False) as file:
        sizes = [8.0 * math.prod(variable.shape) for variable in file.variables.values()]
        _refuse_large(path, sum(sizes))
        for name, variable in file.variables.items():
            values = np.array(variable[:])
            arrays[name] = values.astype(values.dtype.newbyteorder("="))
            attributes[name] = {}
            for key in ARRAY_ATTRIBUTES:
                if hasattr(variable, key):
                    attributes[name][key] = getattr(variable, key)
            # The netCDF library stores the number `fill` in rows that no program has written.
            fill = _DEFAULT_FILL.get(arrays[name].dtype.str[1:])
            if fill is not None:
                attributes[name].setdefault("_FillValue", fill)
    return arrays, attributes


def _hdf5(path: Path, group: str, scene: str) -> DataTable:
    """Read the arrays of one group of an HDF5 file, written by this program or by another.

    Parameters
    ----------
    path : the file.
    group, scene : the group that is read, and the name of a scene whose groups are preferred, see
        `runs.arrays.read_arrays`.

    Raises
    ------
    RotorError
        If the file cannot be read, its arrays claim more than `MAX_BYTES`, or it has the layout of
        pandas' `to_hdf`.
    """
    from rotor_mbs.runs import arrays as hdf5_arrays  # imported here, as it takes 0.2 s
    from rotor_mbs.runs.design import RUNS
    from rotor_mbs.runs.read import run_arrays
    from rotor_mbs.runs.table import TableFile
    from rotor_mbs.runs.trailer import is_of_this_program

    if is_of_this_program(path) and RUNS in TableFile(path, ()).groups:
        return table_of(str(path), run_arrays(path, group, scene))
    arrays, attributes, others = hdf5_arrays.read_arrays(path, group, scene, MAX_BYTES)
    if "axis0" in {*arrays, *others} and "block0_values" in {*arrays, *others}:
        allowed = "a table that other programs can read: to_csv, or to_xarray().to_netcdf"
        raise InputError(f"{path}: pandas' own layout of HDF5 (to_hdf); allowed: {allowed}")
    for name, values in arrays.items():
        # If no program has written a row of an array of floating-point numbers, the netCDF library
        # stores the number `fill` in the row, and the HDF5 library stores 0.
        fill = _DEFAULT_FILL.get(values.dtype.str[1:]) if values.dtype.kind == "f" else None
        if fill is not None:
            attributes[name].setdefault("_FillValue", fill)
    decoded = _decoded(str(path), arrays, attributes)
    left_out = dict(decoded.left_out)
    for name, (reason, is_column) in others.items():
        left_out[name] = LeftOut(reason, is_column)
    return DataTable(decoded.source, decoded.columns, left_out)


def _decoded(source: str, arrays: Arrays, attributes: Mapping[str, Mapping[str, Any]]) -> DataTable:
    """Unpack stored arrays by the CF conventions, and return them as columns.

    Scales and offsets are applied; missing values become NaN; times remain numbers. A packed array
    of signed 32-bit or 64-bit integers is left out if a number did not fit when it was packed.

    Parameters
    ----------
    source : name of the file in messages.
    arrays : arrays by name, as they are stored.
    attributes : the attributes of each array, by name of the array, then by name of the attribute.

    Raises
    ------
    InputError
        See `table_of`.
    """
    import xarray as xr  # imported here, as it takes 0.4 s

    variables = {}
    units: dict[str, str] = {}
    steps: dict[str, float] = {}
    for number, (name, values) in enumerate(arrays.items()):
        facts = dict(attributes.get(name, {}))
        unit = unit_of_attributes(facts)
        if unit:
            units[name] = unit
        for key in ("units", "unit"):
            facts.pop(key, None)
        for key in ("_FillValue", "missing_value"):
            if key in facts:
                facts[key] = np.asarray(facts[key]).ravel()[0]
        if isinstance(facts.get("_Unsigned"), bytes):  # SciPy reads texts of netCDF-3 as bytes
            facts["_Unsigned"] = facts["_Unsigned"].decode("latin-1")
        is_packed = not facts.keys().isdisjoint(_PACKING)
        if is_packed and values.dtype.kind in "iu":
            if "scale_factor" in facts:
                steps[name] = abs(float(np.asarray(facts["scale_factor"]).ravel()[0]))
            # xarray unpacks to the precision of these two attributes. If they have single
            # precision, unpacking would add a rounding that the data do not have.
            for key, default in (("scale_factor", 1.0), ("add_offset", 0.0)):
                facts[key] = np.float64(np.asarray(facts.get(key, default)).ravel()[0])
        dimensions = [f"dimension_{number}_{axis}" for axis in range(values.ndim)]
        variables[name] = (dimensions, values, facts)
    dataset = xr.decode_cf(
        xr.Dataset(variables), decode_times=False, decode_timedelta=False, decode_coords=False
    )
    unpacked = {name: dataset[name].values for name in arrays}
    overflown = {}
    for name in steps:
        stored = arrays[name].ravel()
        # In a conversion to a 32-bit or 64-bit integer, a number that does not fit becomes the
        # smallest integer.
        is_least = (stored == np.iinfo(stored.dtype).min) & np.isfinite(unpacked[name].ravel())
        is_signed = stored.dtype.kind == "i" and variables[name][2].get("_Unsigned") != "true"
        if is_signed and stored.itemsize > 2 and is_least.any():
            row = int(is_least.argmax()) // math.prod(arrays[name].shape[1:]) + 1
            reason = f"row {row} has {stored.min()}, packed from a number that did not fit"
            overflown[name] = LeftOut(reason, is_column=True)
            del unpacked[name]
    table = table_of(source, unpacked, units, steps)
    return DataTable(source, table.columns, {**table.left_out, **overflown})


def _openfast(path: Path) -> tuple[Arrays, Units]:
    """Read OpenFAST's binary output with openfast_io, the reader of the OpenFAST project.

    Parameters
    ----------
    path : the file.

    Returns
    -------
    dict, dict
        The arrays by name; the units by name.

    Raises
    ------
    InputError
        If openfast_io is not installed, or the file has fewer numbers than its header claims.
    """
    try:
        from openfast_io.FAST_output_reader import load_binary_output
    except ImportError as exc:
        hint = 'pip install "rotor_mbs[openfast]", or text output (OutFileFmt 1)'
        raise InputError(f"{path}: openfast_io is not installed; allowed: {hint}") from exc
    # openfast_io allocates the memory that the header claims, so the claim is checked first.
    with path.open("rb") as file:
        begin = file.read(12)
    offset = 4 if begin[:2] == b"\x04\x00" else 2
    counts = struct.unpack_from("<ii", begin, offset)  # numbers of channels and rows
    number_bytes = 8 if begin[:2] == b"\x03\x00" else 2
    if min(counts) < 0 or math.prod(counts) * number_bytes > path.stat().st_size:
        problem = "cannot be read: it has fewer numbers than it claims"
        raise InputError(f"{path}: {problem}; allowed: {FORMATS}")
    values, facts, _ = load_binary_output(str(path))
    names, units = facts["attribute_names"], facts["attribute_units"]
    arrays = {name: values[:, i] for i, name in enumerate(names)}
    return arrays, dict(zip(names, units, strict=True))


# JSON


def _is_json(text: str) -> bool:
    """Return whether a text begins like JSON with an object, or a list of objects or lists."""
    begin = text[:1000].lstrip()
    return begin.startswith("{") or (begin[:1] == "[" and begin[1:].lstrip()[:1] in "[{")


def _json(text: str) -> tuple[Arrays, Units]:
    """Read JSON with arrays by name, or a table in any of the forms that pandas writes.

    Parameters
    ----------
    text : content of the file. A table has one of these forms: a list with an object for each row;
        an object on each line; {"columns": ..., "data": ...}; {"schema": ..., "data": ...}; an
        object with an object for each column, or for each row.

    Returns
    -------
    dict, dict
        The arrays by name; the units by name, of the arrays that have one.

    Raises
    ------
    ValueError
        If the text is no JSON, or is a list with elements other than objects.
    """
    import pandas as pd  # imported here, as it takes 0.3 s

    try:
        content = json.loads(text)
    except json.JSONDecodeError:
        lines = [line for line in text.splitlines() if line.strip()]
        if len(lines) < 2 or not lines[1].lstrip().startswith("{"):
            raise
        content = [json.loads(line) for line in lines]
    if isinstance(content, list):
        rows = [row for row in content if isinstance(row, dict)]
        if len(rows) != len(content):
            raise ValueError("rows without names")
        return arrays_of(pd.DataFrame(rows))
    if isinstance(content.get("data"), list):
        if isinstance(content.get("columns"), list):
            columns = [tuple(c) if isinstance(c, list) else c for c in content["columns"]]
            return arrays_of(pd.DataFrame(content["data"], columns=pd.Index(columns)))
        if "schema" in content:
            return arrays_of(pd.DataFrame(content["data"]))
    parts = list(content.values())
    if parts and all(isinstance(part, dict) for part in parts):
        if all(name.isdigit() for name in content):
            return arrays_of(pd.DataFrame(parts))
        if all(name.isdigit() for part in parts for name in part):
            by_row = pd.DataFrame(content)
            return arrays_of(by_row.reset_index(drop=True))
    return dict(_parts("", content)), {}


def _with_nulls(table: DataTable) -> DataTable:
    """Return columns of JSON with a text about the first null of each, see `DataColumn.missing`."""
    columns = {}
    for name, column in table.columns.items():
        is_missing = np.isnan(column.values)
        if is_missing.any():
            row = int(is_missing.argmax()) + 1
            column = column._replace(missing=f"null in row {row} of {len(is_missing)}")
        columns[name] = column
    return replace(table, columns=columns)


# Text


def _read_text(source: str, text: str) -> DataTable:
    """Read the columns of a text file.

    Parameters
    ----------
    source : name of the file in messages.
    text : content of the file: comma-separated values, columns separated by blanks, a file of
        Exudyn, or OpenFAST's `.out`.

    Raises
    ------
    InputError
        If there are no rows of numbers or no names for the columns, or lines have different numbers
        of fields.
    """
    lines = []
    for number, line in enumerate(text.splitlines(), start=1):
        # Spreadsheet programs write an empty row as a line of separators only.
        if line.strip(" \t,;"):
            lines.append((number, line.strip(" ")))
    lines = _with_vectors_as_columns(lines)
    first, divider = _first_row(source, lines)
    head = [line for _, line in lines[:first]]  # lines above the numbers, including comments
    closing = {}
    width = len(_fields(lines[first][1], divider))
    while len(lines) > first + 1 and _is_closing(lines[-1][1], divider, width):
        number, line = lines.pop()
        closing[f"line {number}"] = LeftOut(f"text below the numbers: {line[:40]!a}")
    rows = [(number, line) for number, line in lines[first:] if not line.startswith(_COMMENT)]
    del lines
    columns = _columns_of_rows(source, rows, divider)
    comments = [line.lstrip("#%/! ") for line in head if line.startswith(_COMMENT)]
    if comments and comments[0].startswith("Exudyn"):
        exudyn = _exudyn(source, comments, columns)
        if exudyn is not None:
            return exudyn
    plain = [line for line in head if not line.startswith(_COMMENT)]
    names = _names(source, plain or comments, len(columns), divider)
    named: dict[str, DataColumn] = {}
    headers: dict[str, str] = {}  # see `DataTable.headers`
    left_out: dict[str, LeftOut] = dict(closing)
    repeats: dict[str, int] = {}
    for number, ((name, unit), values) in enumerate(zip(names, columns, strict=True)):
        is_empty = isinstance(values, np.ndarray) and bool(np.isnan(values).all())
        if not name and is_empty:
            continue  # a separator at the end of every line makes an empty column without a name
        # A column whose name has occurred before is kept, with "_" before the name.
        count = repeats.get(name, 0)
        label = name
        while label in named or label in left_out:
            label = f"{'_' * count}{name}" if count < 10 else f"_{count}_{name}"
            count += 1
        repeats[name] = count
        if label != name:
            headers[label] = name
        if isinstance(values, LeftOut):
            left_out[label] = values
        else:
            missing = _missing_field(values, number, rows, divider)
            named[label] = DataColumn(values, unit, missing=missing)
    is_openfast = any(map(_OPENFAST_HEAD.search, head))
    program = "openfast" if is_openfast else ""
    return DataTable(source, named, left_out, program, headers)


def _is_closing(line: str, divider: str | None, width: int) -> bool:
    """Return whether the last line of a file is a text below the rows, such as a closing remark.

    Parameters
    ----------
    line : the line.
    divider : separator of fields, None for blanks.
    width : number of fields of a row.
    """
    fields = _fields(line, divider)
    numbers, others = _kinds_of_fields(fields, divider)
    return not line.startswith(_COMMENT) and not numbers and bool(others) and len(fields) != width


def _with_vectors_as_columns(lines: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """Return the lines of a file with a separate field for each entry of a vector.

    FMI 3 writes all entries of a vector into one field. The header "time,y" with the row "0,1 2 3"
    becomes the header "time","y[0]","y[1]","y[2]" with the row 0,1,2,3.

    Parameters
    ----------
    lines : lines of the file and their numbers. If there are no vectors, they are returned
        unchanged.
    """
    for (_, above), (_, row) in itertools.pairwise(lines[:_MAX_SEARCHED]):
        for divider in (",", ";"):
            if divider not in row or row.startswith(_COMMENT):
                continue
            names, fields = _fields(above, divider), _fields(row, divider)
            counts = [len(field.split()) for field in fields]
            is_vector = len(names) == len(fields) and max(counts) > 1 and min(counts) > 0
            words_of_names, words = " ".join(names).split(), " ".join(fields).split()
            is_head = not any(_is_number(word, decimal_comma=False) for word in words_of_names)
            is_row = all(_is_number(word, decimal_comma=False) for word in words)
            if not (is_vector and is_head and is_row):
                continue
            labels = []
            for name, count in zip(names, counts, strict=True):
                plain, unit = split_bracketed_unit(name)
                for i in range(count):
                    label = plain if count == 1 else f"{plain}[{i}]"
                    labels.append(f"{label} [{unit}]" if unit else label)
            quoted = divider.join(f'"{label}"' for label in labels)
            expanded = []
            for number, line in lines:
                text = quoted if line == above else _expanded(line, divider, counts)
                expanded.append((number, text))
            return expanded
    return lines


def _expanded(line: str, divider: str, counts: Sequence[int]) -> str:
    """Return a line with a separate field for each entry of a vector.

    Parameters
    ----------
    line : a line of the file.
    divider : separator of the fields.
    counts : number of entries in each field. A field without text stands for as many empty fields.
    """
    fields = line.split(divider)
    if len(fields) != len(counts):  # another kind of line, such as a comment
        return divider.join(line.replace(divider, " ").split())
    words: list[str] = []
    for field, count in zip(fields, counts, strict=True):
        words += field.split() or [""] * count
    return divider.join(words)


def _exudyn(
    source: str, comments: Sequence[str], columns: Sequence[NDArray[np.float64] | LeftOut]
) -> DataTable | None:
    """Read a sensor or solution file of Exudyn, whose columns have no names.

    Parameters
    ----------
    source : name of the file in messages.
    comments : comment lines above the numbers.
    columns : (n,) numbers of each column, the time first.

    Returns
    -------
    DataTable or None
        The columns, with names from the head of the file. If the file has several solves, only the
        rows of the last one are returned. None if the file is neither a sensor nor a solution file.

    Raises
    ------
    InputError
        If a column has values that are no numbers, or the number of columns is not that in the
        head.
    """
    text = "\n".join(comments)
    variable, written = _EXUDYN.search(text), _EXUDYN_SOLUTION.search(text)
    if variable is None and written is None:
        return None
    for number, column in enumerate(columns, start=1):
        if isinstance(column, LeftOut):
            raise InputError(f"{source}: column {number}: {column.reason}; allowed: numbers")
    values = np.stack([column for column in columns if isinstance(column, np.ndarray)], axis=1)
    left_out = {}
    ends = np.flatnonzero(np.diff(values[:, 0]) < 0.0)
    if len(ends):
        begin = int(ends[-1]) + 1
        left_out[f"rows 1 to {begin}"] = LeftOut("of an earlier solve")
        values = values[begin:]
    arrays: dict[str, Any] = {"time": values[:, 0]}
    if written is None and variable is not None:
        arrays[variable[1]] = values[:, 1:]
    elif written is not None:
        counts = [int(count) for count in written[1].split(",")[: len(_EXUDYN_KINDS)]]
        if sum(counts) != values.shape[1] - 1:
            problem = f"{values.shape[1] - 1} columns beside the time"
            raise InputError(f"{source}: {problem}; allowed: {sum(counts)}, as its head says")
        begin = 1
        for kind, count in zip(_EXUDYN_KINDS, counts, strict=False):
            if count:
                arrays[kind] = values[:, begin : begin + count]
            begin += count
    table = table_of(source, arrays)
    return DataTable(source, table.columns, {**table.left_out, **left_out})


def _first_row(source: str, lines: Lines) -> tuple[int, str | None]:
    """Find the first row of numbers.

    Parameters
    ----------
    source : name of the file in messages.
    lines : lines of the file and their numbers.

    Returns
    -------
    int, str or None
        Index of the row in `lines`; separator of its fields, None for blanks.

    Raises
    ------
    InputError
        If there is no row of numbers, or all numbers are in a single column.
    """
    # If there is no row of numbers, the message names the line that has the most numbers among the
    # lines with numbers and other texts.
    most_numbers, nearest = 0, ""
    for place, (number, line) in enumerate(lines):
        if line.startswith(_COMMENT):
            continue
        for divider in _DIVIDERS:
            fields = _fields(line, divider)
            numbers, others = _kinds_of_fields(fields, divider)
            if len(fields) > 1 and numbers and not others:
                # An earlier line may be a row with a text in place of a number. That line is taken
                # as a row, not as a header, if its first field is a number, such as the time.
                with_texts = _first_row_with_texts(lines[: place + 1])
                if with_texts is not None:
                    first = _fields(lines[with_texts[0]][1], with_texts[1])[0]
                    if _is_number(first, decimal_comma=with_texts[1] != ","):
                        return with_texts
                return place, divider
            if others and numbers > most_numbers:
                most_numbers = numbers
                nearest = f"; line {number} has {others[0][:40]!a}"
    with_texts = _first_row_with_texts(lines)
    if with_texts is not None:
        return with_texts
    if any(_is_number(line, decimal_comma=True) for _, line in lines):
        allowed = "a column of times, and others beside it"
        raise InputError(f"{source}: one column of numbers; allowed: {allowed}")
    allowed = "columns of numbers below a header line"
    raise InputError(f"{source}: no row of numbers in it{nearest}; allowed: {allowed}")


def _first_row_with_texts(lines: Lines) -> tuple[int, str | None] | None:
    """Find the first row of a table in which some columns are texts.

    Such a table is recognized by three successive lines with the same number of fields. The first
    line has no numbers: it is the header. The two lines below it have numbers.

    Parameters
    ----------
    lines : lines of the file and their numbers. The first `_MAX_SEARCHED` lines are searched.

    Returns
    -------
    (int, str or None) or None
        Index of the row in `lines`, and separator of its fields, None for blanks; None if there is
        no such table.
    """
    plain = []
    for place, (_, line) in enumerate(lines[:_MAX_SEARCHED]):
        if not line.startswith(_COMMENT):
            plain.append((place, line))
    for divider in _DIVIDERS:
        for (_, above), (place, line), (_, below) in zip(plain, plain[1:], plain[2:], strict=False):
            widths = [len(_fields(text, divider)) for text in (above, line, below)]
            counts = []
            for text in (above, line, below):
                counts.append(_kinds_of_fields(_fields(text, divider), divider)[0])
            is_below_head = counts[0] == 0 and min(counts[1:]) > 0
            if is_below_head and widths[0] > 1 and len(set(widths)) == 1:
                return place, divider
    return None


def _kinds_of_fields(fields: Sequence[str], divider: str | None) -> tuple[int, list[str]]:
    """Count the fields that are numbers, and list the fields that are other texts.

    Parameters
    ----------
    fields : fields of a line.
    divider : separator of fields, None for blanks.

    Returns
    -------
    int, list of str
        The number of fields that are numbers; the fields that are neither numbers, nor empty, nor a
        mark for a missing number.
    """
    numbers, others = 0, []
    for field in fields:
        if _is_number(_without_fortran(field), decimal_comma=divider != ","):
            numbers += 1
        elif field and not _MISSING.fullmatch(field):
            others.append(field)
    return numbers, others


def _without_fortran(field: str) -> str:
    """Return a number of Fortran with the letter E: 1.5E-3 for 1.5D-3, 0.15E-101 for 0.15-101."""
    return _FORTRAN_3_DIGITS.sub("E", _FORTRAN.sub("E", field))


def _fields(line: str, divider: str | None) -> list[str]:
    """Return the fields of a line; the separator `divider` is None for blanks."""
    if divider is None:
        return line.split()
    return [field.strip() for field in next(csv.reader([line], delimiter=divider))]


def _is_number(field: str, *, decimal_comma: bool) -> bool:
    """Return whether a field is a number; with `decimal_comma`, 1,5 is a number, too."""
    try:
        float(field)
    except ValueError:
        return decimal_comma and _DECIMAL_COMMA.fullmatch(field) is not None
    return True


def _columns_of_rows(
    source: str, rows: Lines, divider: str | None
) -> list[NDArray[np.float64] | LeftOut]:
    """Read the columns of all rows.

    Parameters
    ----------
    source : name of the file in messages.
    rows : line number in the file, and text, of each row.
    divider : separator of the fields of a line, None for blanks.

    Returns
    -------
    list of ndarray or LeftOut
        For each column, its (n,) numbers, with NaN for an empty field. If a field of the column is
        no number, a `LeftOut` that names the first such field.

    Raises
    ------
    InputError
        If a line has another number of fields than the first line, or there are more than
        `MAX_COLUMNS` columns.
    """
    import pandas as pd  # imported here, as it takes 0.3 s

    width = len(_fields(rows[0][1], divider))
    if width > MAX_COLUMNS:
        raise InputError(f"{source}: {width} columns; allowed: up to {MAX_COLUMNS}")
    # Commas that do not separate fields are decimal commas, unless a row has a point: in numbers
    # with decimal points, a comma may separate thousands.
    is_comma = divider != "," and not any("." in row for _, row in rows)
    body = io.StringIO("\n".join(row for _, row in rows))
    # Numbers have to be exact to the last bit. pandas 3.1 and later read them so by default, and
    # the option is deprecated.
    options: dict[str, Any] = {}
    if tuple(int(part) for part in pd.__version__.split(".")[:2]) < (3, 1):
        options["float_precision"] = "round_trip"
    try:
        frame = pd.read_csv(
            body,
            sep=r"\s+" if divider is None else divider,
            header=None,
            names=list(range(width)),
            index_col=False,
            decimal="," if is_comma else ".",
            skipinitialspace=True,
            skip_blank_lines=False,
            keep_default_na=False,
            na_values=[""],
            low_memory=False,
            **options,
        )
    except pd.errors.ParserError:
        _refuse_ragged(source, rows, divider, width)
        raise
    # pandas adds empty fields to rows that are too short. If the last column has an empty field,
    # the fields of every row are counted, because a complete row may end with an empty field, too.
    if len(frame) != len(rows) or frame[width - 1].isna().any():
        _refuse_ragged(source, rows, divider, width)
    columns: list[NDArray[np.float64] | LeftOut] = []
    for number in range(width):
        column = frame[number]
        if column.dtype.kind in "fiu":
            columns.append(column.to_numpy(float))
        else:
            columns.append(_numbers_of_texts(column.to_numpy(object), rows, is_comma=is_comma))
    return columns


def _missing_field(
    values: NDArray[np.float64], number: int, rows: Lines, divider: str | None
) -> str:
    """Return the text about the first missing number of a column, see `DataColumn.missing`.

    Parameters
    ----------
    values : (n,) numbers of a column, NaN for a missing number.
    number : index of the column, counted from 0.
    rows, divider : see `_columns_of_rows`.
    """
    is_missing = np.isnan(values)
    if not is_missing.any():
        return ""
    row = int(is_missing.argmax())
    line, text = rows[row]
    field = _fields(text, divider)[number]
    return f"{'nan' if field else 'empty'} in row {row + 1} of {len(values)} (line {line})"


def _refuse_ragged(source: str, rows: Lines, divider: str | None, width: int) -> None:
    """Raise InputError if a line has a number of fields other than `width`."""
    for number, line in rows:
        count = len(_fields(line, divider))
        if count != width:
            problem = f"{count} fields, where the rows above have {width}"
            raise InputError(f"{source}:{number}: {problem}")


def _numbers_of_texts(
    fields: NDArray[Any], rows: Lines, *, is_comma: bool
) -> NDArray[np.float64] | LeftOut:
    """Convert a column that pandas has left as texts to numbers, for example those of Fortran.

    Parameters
    ----------
    fields : (n,) texts and numbers, NaN for an empty field.
    rows : line number in the file, and text, of each of the n rows.
    is_comma : whether numbers have decimal commas.

    Returns
    -------
    ndarray or LeftOut
        (n,) the numbers; or a `LeftOut` that names the first field that is no number.
    """
    numbers = np.empty(len(fields))
    for i, field in enumerate(fields):
        text = str(field).strip()
        if is_comma:
            text = text.replace(",", ".")
        try:
            numbers[i] = float(_without_fortran(text))
        except ValueError:
            reason = f"row {i + 1} (line {rows[i][0]}) has {str(field)[:40]!a}, no number"
            return LeftOut(reason, is_column=True)
    return numbers


def _names(
    source: str, head: Sequence[str], width: int, divider: str | None
) -> list[tuple[str, str]]:
    """Return the name and unit of each column from the lines above the numbers.

    The last line has the names, or it has the units and the line above it has the names. The last
    name may be missing, unless the numbers are separated by blanks.

    Parameters
    ----------
    source : name of the file in messages.
    head : lines above the numbers.
    width : number of columns.
    divider : separator of the numbers, None for blanks. The names may have another separator.

    Raises
    ------
    InputError
        If there is no line above the numbers, or the number of names is not the number of columns.
    """
    if not head:
        allowed = "a line such as: time [s],rotor [rad]"
        raise InputError(f"{source}: no header line above the numbers; allowed: {allowed}")
    # There may be another comment between the names and the numbers; it is left out.
    while len(head) > 1 and len(_words(head[-1], divider, width)) not in (width, width - 1):
        if len(_words(head[-2], divider, width)) != width:
            break
        head = head[:-1]
    last = _words(head[-1], divider, width)
    above = _words(head[-2], divider, width) if len(head) > 1 else []
    units = [word.strip("[]() ") for word in last]
    is_line_of_units = any(unit_factor(unit, "time") is not None for unit in units)
    if len(above) == len(last) and is_line_of_units:
        names = list(zip(above, units, strict=True))
    else:
        names = [split_bracketed_unit(word) for word in last]
    if len(names) == width - 1 and divider is not None:
        names.append(("", ""))
    if len(names) != width:
        problem = f"{len(names)} names in the header, {width} columns of numbers"
        raise InputError(f"{source}: {problem}; allowed: as many")
    return names


def _words(line: str, divider: str | None, width: int) -> list[str]:
    """Split a line above the numbers into names.

    Parameters
    ----------
    line : the line.
    divider : separator of the numbers, None for blanks. Other separators are tried if this one does
        not give the right number of names. If it is None, wide blanks and units are always tried
        first, because a name may contain a blank.
    width : number of columns.
    """
    words = _fields(line, divider)
    if len(words) in (width, width - 1) and divider is not None:
        return words
    by_wide_blanks = re.split(r"\s{2,}|\t", line)
    for others in (by_wide_blanks, _names_with_units(line), line.split(), _fields(line, ",")):
        if len(others) == width:
            return others
    return words


def _names_with_units(line: str) -> list[str]:
    """Return the names, with units, in a line such as "time [s] pitch 1 rate [rad/s]"."""
    names = []
    for part in line.replace(")", "]").split("]")[:-1]:
        name, _, unit = part.replace("(", "[").partition("[")
        if name.strip() and "[" in part.replace("(", "["):
            names.append(f"{name.strip()} [{unit}]")
    return names
