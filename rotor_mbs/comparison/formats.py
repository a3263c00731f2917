"""Which library reads which format: the work of the process that `comparison.files` starts.

A file may be damaged, or made to harm: what it claims to hold is bounded before it is read, and the
process has limits of memory and time for what no check foresees. No regular expression here takes
longer than a constant times the length of its text.
"""

from __future__ import annotations

import csv
import json
import math
import re
import struct
import warnings
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.comparison.columns import (
    MAX_COLUMNS,
    MAX_NAME,
    UNITS,
    DataColumn,
    DataTable,
    split_bracketed_unit,
    table_of,
)
from rotor_mbs.errors import InputError, RotorError

# Of a file, and of its arrays unpacked; a million rows of ten columns are 80 MB.
MAX_BYTES = 1 << 29
_MAX_PROBLEM = 2000  # characters of a message, which may name groups of the file
FORMATS = "text with a header, .json, .npz, .mat, HDF5, netCDF, OpenFAST .out and .outb"
_HDF5, _NETCDF3 = b"\x89HDF\r\n\x1a\n", b"CDF"
_ZIP, _MATLAB_5 = b"PK\x03\x04", b"MATLAB 5.0 MAT-file"
_MATLAB_NUMBERS = {
    "double", "single", "logical", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32",
    "uint64",
}  # fmt: skip
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")  # spreadsheets' "Unicode text"

# Text: comma-separated values, columns divided by blanks, Exudyn's sensor files, OpenFAST's `.out`.
_COMMENT = ("#", "%", "//", "!")
_DIVIDERS = (";", "\t", ",", None)  # None: blanks
_EXUDYN = re.compile(r"OutputVariableType = (\w+)")
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
_FORTRAN = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d)")  # 1.5D-03

Arrays = Mapping[str, Any]
Units = Mapping[str, str]
Lines = Sequence[tuple[int, str]]  # number of the line in the file, its text


def read_in_worker(arguments: tuple[Path, str, str]) -> DataTable:
    """Read a file in the process that `comparison.files` starts.

    Parameters
    ----------
    arguments : path, group and scene, see `read_columns`.

    Raises
    ------
    InputError
        For what cannot be read, with names and messages of bounded length.
    MemoryError
        If it takes more memory than the process has.
    """
    path, group, scene = arguments
    csv.field_size_limit(MAX_BYTES)
    try:
        with warnings.catch_warnings(action="ignore"):
            table = read_columns(path, group, scene)
        columns = {}
        for name, column in _short_names(table.columns).items():
            columns[name] = DataColumn(column.values, column.unit[:MAX_NAME])
        return DataTable(table.source, columns)
    except RotorError as exc:
        problems = [line[:_MAX_PROBLEM] for line in str(exc).splitlines()]
    except MemoryError:
        raise
    except RecursionError:
        problems = [f"{path}: cannot be read: nested too deeply; allowed: {FORMATS}"]
    except Exception as exc:  # of any library
        problems = [f"{path}: cannot be read: {_line(exc)}; allowed: {FORMATS}"]
    raise InputError(problems)


def _line(exc: BaseException) -> str:
    """Return the first line of an exception's text."""
    lines = str(exc).splitlines()
    return lines[0][:200] if lines else type(exc).__name__


def _short_names(columns: Mapping[str, DataColumn]) -> dict[str, DataColumn]:
    """Cut names that are too long for messages and pages; they stay distinct."""
    short = {}
    for number, (name, column) in enumerate(columns.items(), start=1):
        label = name if len(name) <= MAX_NAME else f"{name[:MAX_NAME]}... (column {number})"
        short[label] = column
    return short


def read_columns(path: Path, group: str, scene: str) -> DataTable:
    """Read the columns of a file of any format.

    Parameters
    ----------
    path : the file; what it is is decided by its first bytes.
    group, scene : of an HDF5 file, see `runs.table.read_arrays`.

    Raises
    ------
    RotorError
        For a file that cannot be read, in one line; any library's exceptions besides.
    """
    with path.open("rb") as file:
        head = file.read(1024)
    source = str(path)
    if head.startswith(_ZIP):
        return table_of(source, _numpy_archive(path))
    if head.startswith(_MATLAB_5):
        return table_of(source, _matlab_5(path))
    if head.startswith(_NETCDF3):
        return table_of(source, *_netcdf_3(path))
    if path.suffix.lower() == ".outb":
        return table_of(source, *_openfast(path))
    # MATLAB's v7.3 has 512 bytes of its own before.
    if head.startswith(_HDF5) or head[512:].startswith(_HDF5):
        return table_of(source, *_hdf5(path, group, scene))
    if b"\x00" in head and not head.startswith(_UTF_16):
        raise InputError(f"{path}: not a format that can be read; allowed: {FORMATS}")
    content = path.read_bytes()
    try:
        text = content.decode("utf-16" if content.startswith(_UTF_16) else "utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    del content
    if text.lstrip().startswith("{"):  # JSON: arrays by name
        arrays = {name: np.asarray(values) for name, values in json.loads(text).items()}
        return table_of(source, arrays)
    return _read_text(source, text)


def _refuse_large(path: Path, size: float) -> None:
    """Raise InputError if arrays of this size, in bytes, are more than is read."""
    if size > MAX_BYTES:
        allowed = f"up to {MAX_BYTES / 2**30:g} GB: export fewer rows or arrays"
        raise InputError(f"{path}: its arrays claim {size / 2**30:.1f} GB; allowed: {allowed}")


def _numpy_archive(path: Path) -> Arrays:
    """Read the arrays of an .npz file."""
    # An entry is read to the size that the archive declares for it, and no further.
    with zipfile.ZipFile(path) as entries:
        _refuse_large(path, sum(entry.file_size for entry in entries.infolist()))
    with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def _matlab_5(path: Path) -> Arrays:
    """Read the arrays of numbers of a MAT file of version 5 to 7."""
    from scipy.io import loadmat, whosmat  # late: 0.1 s

    # The heads of the arrays alone are unpacked for this; structures and cells are not read at all.
    numeric = {name: shape for name, shape, kind in whosmat(path) if kind in _MATLAB_NUMBERS}
    _refuse_large(path, sum(8.0 * math.prod(shape) for shape in numeric.values()))
    arrays = loadmat(path, variable_names=list(numeric)) if numeric else {}
    return {name: values for name, values in arrays.items() if not name.startswith("__")}


def _netcdf_3(path: Path) -> tuple[Arrays, Units]:
    """Read the variables of a netCDF-3 file and their units; path: the file."""
    from scipy.io import netcdf_file

    arrays: dict[str, Any] = {}
    units: dict[str, str] = {}
    # Variables are views of the file, until they are copied: several may be views of the same
    # bytes.
    with netcdf_file(path, "r", mmap=True) as file:
        sizes = [8.0 * math.prod(variable.shape) for variable in file.variables.values()]
        _refuse_large(path, sum(sizes))
        for name in file.variables:
            arrays[name] = np.array(file.variables[name][:])
            if hasattr(file.variables[name], "units"):
                units[name] = file.variables[name].units.decode()
    return arrays, units


def _hdf5(path: Path, group: str, scene: str) -> tuple[Arrays, Units]:
    """Read the arrays of a group of an HDF5 file, of this program's own or of any other."""
    from rotor_mbs.runs import table  # late: 0.2 s
    from rotor_mbs.runs.design import RUNS
    from rotor_mbs.runs.read import run_arrays
    from rotor_mbs.runs.trailer import is_of_this_program

    if is_of_this_program(path) and RUNS in table.TableFile(path, ()).groups:
        return run_arrays(path, group, scene), {}
    return table.read_arrays(path, group, scene, MAX_BYTES)


def _openfast(path: Path) -> tuple[Arrays, Units]:
    """Read OpenFAST's binary output by its own project's reader; path: the file."""
    try:
        from openfast_io.FAST_output_reader import load_binary_output
    except ImportError as exc:
        hint = 'pip install "rotor_mbs[openfast]", or text output (OutFileFmt 1)'
        raise InputError(f"{path}: openfast_io is not installed; allowed: {hint}") from exc
    # That reader allocates what the head claims.
    with path.open("rb") as file:
        head = file.read(12)
    counts = struct.unpack_from("<ii", head, 4 if head[:2] == b"\x04\x00" else 2)  # channels, rows
    number_bytes = 8 if head[:2] == b"\x03\x00" else 2
    if min(counts) < 0 or math.prod(counts) * number_bytes > path.stat().st_size:
        problem = "cannot be read: it has fewer numbers than it claims"
        raise InputError(f"{path}: {problem}; allowed: {FORMATS}")
    values, facts, _ = load_binary_output(str(path))
    names, units = facts["attribute_names"], facts["attribute_units"]
    arrays = {name: values[:, i] for i, name in enumerate(names)}
    return arrays, dict(zip(names, units, strict=True))


def _read_text(source: str, text: str) -> DataTable:
    """Read the columns of a text file.

    Parameters
    ----------
    source : what messages call the file.
    text : comma-separated values, columns divided by blanks, Exudyn's sensor files, OpenFAST's
        `.out`.

    Raises
    ------
    InputError
        With the line where something else than a number stands.
    """
    lines = []
    for number, line in enumerate(text.splitlines(), start=1):
        # Lines of nothing but dividers are what spreadsheets write for empty rows.
        if line.strip(" \t,;"):
            lines.append((number, line.strip(" ")))
    first, divider = _first_row(source, lines)
    head = [line for _, line in lines[:first]]  # comments among it
    rows = []
    for number, line in lines[first:]:
        if not line.startswith(_COMMENT):
            rows.append((number, _FORTRAN.sub("E", line)))
    del lines
    # Beside a point a comma may stand between thousands; without one it is decimal.
    if divider != "," and not any("." in row for _, row in rows):
        rows = [(i, row.replace(",", ".")) for i, row in rows]
    values = _numbers(source, rows, divider)
    comments = [line.lstrip("#%/! ") for line in head if line.startswith(_COMMENT)]
    variable = _EXUDYN.search("\n".join(comments))
    if variable is not None and "sensor output file" in comments[0]:
        return table_of(source, {"time": values[:, 0], variable[1]: values[:, 1:]})
    plain = [line for line in head if not line.startswith(_COMMENT)]
    names = _names(source, plain or comments, values.shape[1], divider)
    columns: dict[str, DataColumn] = {}
    repeats: dict[str, int] = {}
    for (name, unit), column in zip(names, values.T, strict=True):
        if not name and np.isnan(column).all():
            continue  # a divider at the end of every line makes a column of nothing
        # Later columns of one name are kept, with marks before it.
        count = repeats.get(name, 0)
        label = name
        while label in columns:
            label = f"{'_' * count}{name}" if count < 10 else f"_{count}_{name}"
            count += 1
        repeats[name] = count
        columns[label] = DataColumn(column.copy(), unit)
    return DataTable(source, columns)


def _first_row(source: str, lines: Lines) -> tuple[int, str | None]:
    """Find the first row of numbers.

    Parameters
    ----------
    source : what messages call the file.
    lines : of the file, with their numbers.

    Returns
    -------
    int, str or None
        Its place in `lines`; what divides its fields, None for blanks.

    Raises
    ------
    InputError
        Where there is none, with the row that comes nearest.
    """
    most_numbers, nearest = 0, ""  # of the row that comes nearest, and what in it is no number
    for place, (number, line) in enumerate(lines):
        if line.startswith(_COMMENT):
            continue
        for divider in _DIVIDERS:
            fields = _fields(_FORTRAN.sub("E", line), divider)
            others = []
            for field in fields:
                if field and not _is_number(field, decimal_comma=divider != ","):
                    others.append(field)
            if len(fields) > 1 and any(fields) and not others:
                return place, divider
            if others and len(fields) - len(others) > most_numbers:
                most_numbers = len(fields) - len(others)
                nearest = f"; line {number} has {others[0][:40]!a}"
    if any(_is_number(line, decimal_comma=True) for _, line in lines):
        allowed = "a column of times, and others beside it"
        raise InputError(f"{source}: one column of numbers; allowed: {allowed}")
    allowed = "columns of numbers below a header line"
    raise InputError(f"{source}: no row of numbers in it{nearest}; allowed: {allowed}")


def _fields(line: str, divider: str | None) -> list[str]:
    """Return the fields of a line; divider None stands for blanks."""
    if divider is None:
        return line.split()
    return [field.strip() for field in next(csv.reader([line], delimiter=divider))]


def _is_number(field: str, *, decimal_comma: bool) -> bool:
    """Whether a field is a number, with `decimal_comma` also one like 1,5."""
    try:
        float(field)
    except ValueError:
        return decimal_comma and _DECIMAL_COMMA.fullmatch(field) is not None
    return True


def _numbers(source: str, rows: Lines, divider: str | None) -> NDArray[np.float64]:
    """Read the numbers of all rows.

    Parameters
    ----------
    source : what messages call the file.
    rows : the lines of numbers.
    divider : what divides them.

    Returns
    -------
    ndarray
        (n, columns), NaN where a field is empty.

    Raises
    ------
    InputError
        With the line that has another number of fields, or something else than a number.
    """
    width = len(_fields(rows[0][1], divider))
    if width > MAX_COLUMNS:
        raise InputError(f"{source}: {width} columns; allowed: up to {MAX_COLUMNS}")
    values = np.empty((len(rows), width))
    for i, (number, line) in enumerate(rows):
        fields = _fields(line, divider)
        if len(fields) != width:
            problem = f"{len(fields)} fields, where the rows above have {width}"
            raise InputError(f"{source}:{number}: {problem}")
        try:
            values[i] = [float(field or "nan") for field in fields]
        except ValueError:
            for j, field in enumerate(fields):
                if field and not _is_number(field, decimal_comma=False):
                    problem = f"{field[:40]!a} in column {j + 1}; allowed: a number"
                    raise InputError(f"{source}:{number}: {problem}") from None
            raise
    return values


def _names(
    source: str, head: Sequence[str], width: int, divider: str | None
) -> list[tuple[str, str]]:
    """Return name and unit of each column, from the last line of the head, or from the last two.

    Parameters
    ----------
    source : what messages call the file.
    head : lines above the numbers.
    width : number of columns.
    divider : what divides the numbers; the names may be divided otherwise.
    """
    if not head:
        allowed = "a line such as: time [s],rotor [rad]"
        raise InputError(f"{source}: no header line above the numbers; allowed: {allowed}")
    last = _words(head[-1], divider, width)
    above = _words(head[-2], divider, width) if len(head) > 1 else []
    units = [word.strip("[]() ") for word in last]
    is_line_of_units = not UNITS["time"].keys().isdisjoint(unit.lower() for unit in units)
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
    """Return the names in a line of the head; they may be divided otherwise than numbers are."""
    words = _fields(line, divider)
    if len(words) in (width, width - 1) and divider is not None:
        return words
    by_wide_blanks = re.split(r"\s{2,}|\t", line)
    for others in (by_wide_blanks, _names_with_units(line), line.split(), _fields(line, ",")):
        if len(others) == width:
            return others
    return words


def _names_with_units(line: str) -> list[str]:
    """Return the names of a line such as "time [s] pitch 1 rate [rad/s]", with their units."""
    names = []
    for part in line.replace(")", "]").split("]")[:-1]:
        name, _, unit = part.replace("(", "[").partition("[")
        if name.strip() and "[" in part.replace("(", "["):
            names.append(f"{name.strip()} [{unit}]")
    return names
