"""A file of any format as a table: the one place that decides what a file is."""

from __future__ import annotations

import csv
import json
import math
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError, ResourceError, RotorError
from rotor_mbs.runs import table
from rotor_mbs.runs.design import RUNS
from rotor_mbs.runs.read import run_arrays

# By dimension: factor to s, rad or rad/s.
_ANGLES = {
    **dict.fromkeys(("rad", "radian", "radians"), 1.0),
    **dict.fromkeys(("deg", "degree", "degrees", "°"), math.pi / 180.0),
    **dict.fromkeys(("turn", "turns", "rev", "revolutions"), 2.0 * math.pi),
}
_TIMES = {**dict.fromkeys(("s", "sec", "second", "seconds"), 1.0), "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0}
_RATES = {f"{unit}{per}": factor for unit, factor in _ANGLES.items() for per in ("/s", "/sec", " s-1")}
_RATES |= dict.fromkeys(("rpm", "rev/min", "r/min"), math.pi / 30.0) | {"hz": 2.0 * math.pi}
_FORCES = {"n": 1.0, "kn": 1e3}
_MOMENTS = {f"{unit}{mark}m": factor for unit, factor in _FORCES.items() for mark in (" ", "", "-", "*", "·", ".")}
UNITS = {
    "time": _TIMES, "angle": _ANGLES, "rate": _RATES, "frequency": _RATES, "force": _FORCES, "moment": _MOMENTS,
}  # fmt: skip
ALLOWED_UNITS = {
    "time": "s, ms, us, min", "angle": "rad, deg, turns", "rate": "rad/s, deg/s, turns/s, rpm",
    "frequency": "rad/s, Hz", "force": "N, kN", "moment": "N m, kN m",
}  # fmt: skip
BASE_UNITS = {
    "time": "s", "angle": "rad", "rate": "rad/s", "frequency": "rad/s", "force": "N", "moment": "N m",
}  # fmt: skip


_SHOWN = 12  # names that a message lists
_UNIT = re.compile(r"\s*[\[(]([^\])]*)[\])]\s*$|\s+/\s*(\S+)\s*$")


class DataColumn(NamedTuple):
    """A column: (n,) numbers, and the unit that the file states, "" where it states none."""

    values: NDArray[np.float64]
    unit: str = ""


@dataclass(frozen=True)
class DataTable:
    """The columns of a file by name, in the order of the file; source: what messages call it."""

    source: str
    columns: Mapping[str, DataColumn]

    def __getitem__(self, name: str) -> DataColumn:
        """Raises InputError, with the columns that there are."""
        if name not in self.columns:
            raise InputError(f"{self.source}: no column {name!r}; available: {shown_names(list(self.columns))}")
        return self.columns[name]


def table_of(source: str, arrays: Mapping[str, Any], units: Mapping[str, str] | None = None) -> DataTable:
    """Columns from arrays by name; one of two dimensions (n, k) becomes `name[0]` ... `name[k-1]`, one of three
    (n, j, k) `name[0,0]` ... `name[j-1,k-1]`.

    Arrays that are no numbers, are single numbers, or have more dimensions are left out. An array (k, n) beside others
    of length n is turned, as MATLAB's are where they are stored by HDF5.
    """
    try:
        numeric = {name: _plain(values) for name, values in arrays.items()}
    except ValueError as exc:
        raise InputError(f"{source}: rows of different lengths; allowed: arrays (n,) and (n, columns)") from exc
    is_row = any(values.shape == (1,) for values in numeric.values())  # of a single speed
    numeric = {
        name: values if is_row and values.shape[:1] == (1,) else np.squeeze(values) for name, values in numeric.items()
    }
    numeric = {name: values for name, values in numeric.items() if values.dtype.kind in "fiu" and 0 < values.ndim < 4}
    rows = max((values.size for values in numeric.values() if values.ndim == 1), default=0)
    columns: dict[str, DataColumn] = {}
    for name, values in numeric.items():
        plain, unit = named_unit(name)
        unit = (units or {}).get(name, unit)
        if values.ndim == 1:
            columns[plain] = DataColumn(values.astype(float), unit)
            continue
        turned = values.T if values.shape[-1] == rows != values.shape[0] else values
        for place in np.ndindex(turned.shape[1:]):
            columns[f"{plain}[{','.join(map(str, place))}]"] = DataColumn(turned[:, *place].astype(float), unit)
    if not columns:
        raise InputError(f"{source}: no columns of numbers in it; allowed: a time and angles, as columns or arrays")
    return DataTable(source, columns)


def _plain(values: Any) -> NDArray[Any]:
    """NaN where a value is masked."""
    return np.asarray(np.ma.filled(values.astype(float), np.nan) if np.ma.isMaskedArray(values) else values)


def named_unit(name: str) -> tuple[str, str]:
    """("rotor", "deg") of "rotor [deg]", "rotor (deg)" or "rotor / deg"; ("rotor", "") of "rotor"."""
    match = _UNIT.search(name)
    unit = (match[1] or match[2] or "").strip() if match else ""
    if match is None or unit.isdigit() or not name[: match.start()].strip():
        return name.strip(), ""
    return name[: match.start()].strip(), unit


def shown_names(names: list[str]) -> str:
    """The first names, as a message can list them."""
    more = f", ... ({len(names)} in all)" if len(names) > _SHOWN else ""
    return ", ".join(name if name.isprintable() else ascii(name) for name in names[:_SHOWN]) + more


LARGEST = 1 << 29  # bytes; a trajectory of a million rows of ten columns is 80 MB
FORMATS = "text with a header, .json, .npz, .mat, HDF5, netCDF, OpenFAST .out and .outb"
_HDF5, _NETCDF3, _ZIP, _MATLAB_5 = b"\x89HDF\r\n\x1a\n", b"CDF", b"PK\x03\x04", b"MATLAB 5.0 MAT-file"
_BINARY = (_HDF5, _NETCDF3, _ZIP, _MATLAB_5)
_LIMIT_S = 120.0  # for reading a binary file
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")  # spreadsheets' "Unicode text"

# Text: comma-separated values, columns divided by blanks, Exudyn's sensor files, OpenFAST's `.out`.
_COMMENT = ("#", "%", "//", "!")
_DIVIDERS = (";", "\t", ",", None)  # None: blanks
_NAME_AND_UNIT = re.compile(r"\S+(?: \d+)?(?: \w+)?\s*[\[(][^\])]*[\])]")
_EXUDYN = re.compile(r"OutputVariableType = (\w+)")
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
_FORTRAN = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d)")  # 1.5D-03

Lines = Sequence[tuple[int, str]]  # number of the line in the file, its text


def read_table(path: str | os.PathLike[str], group: str = "", scene: str = "") -> DataTable:
    """The columns of numbers in a file; `group`, `scene`: see `runs.table.read_arrays`.

    Raises InputError or StoreError, in one line, for what cannot be read.
    """
    path = Path(path)
    source = str(path)
    if not path.is_file():
        raise InputError(f"{path}: {'is a folder' if path.is_dir() else 'no such file'}; allowed: {FORMATS}")
    size = path.stat().st_size
    if size == 0:
        raise InputError(f"{path}: empty; allowed: {FORMATS}")
    if size > LARGEST:
        raise InputError(f"{path}: {size / 2**30:.1f} GB; allowed: up to {LARGEST / 2**30:g} GB: export fewer rows")
    try:
        with path.open("rb") as file:
            head = file.read(1024)
    except OSError as exc:
        raise InputError(f"{path}: cannot be read: {exc.strerror}") from exc
    if head.startswith(_BINARY) or head[512:].startswith(_HDF5) or path.suffix.lower() == ".outb":
        return table_of(source, *_read_apart(path, group, scene))
    try:
        if b"\x00" in head and not head.startswith(_UTF_16):
            raise InputError(f"{path}: not a format that can be read; allowed: {FORMATS}")
        content = path.read_bytes()
        try:
            text = content.decode("utf-16" if content.startswith(_UTF_16) else "utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("latin-1")
        if text.lstrip().startswith("{"):  # JSON: arrays by name
            return table_of(source, {name: np.asarray(values) for name, values in json.loads(text).items()})
        return _read_text(source, text)
    except (OSError, ValueError, MemoryError) as exc:
        raise InputError(f"{path}: cannot be read: {_line(exc)}; allowed: {FORMATS}") from exc


def _line(exc: BaseException) -> str:
    return (str(exc).splitlines() or [type(exc).__name__])[0]


def _read_apart(path: Path, group: str, scene: str) -> tuple[dict[str, NDArray[Any]], dict[str, str]]:
    """Arrays and units of a binary file, read by a process of its own, which a damaged file may end or keep busy."""
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "arrays.npz"
        call = f"from {__name__} import write_arrays; write_arrays()"
        command = [sys.executable, "-P", "-W", "ignore", "-c", call, str(path), str(output), group, scene]
        folders = os.pathsep.join(str(Path(folder).absolute()) for folder in sys.path)
        try:
            ended = subprocess.run(
                command, capture_output=True, text=True, errors="replace", timeout=_LIMIT_S, check=False,
                env=os.environ | {"PYTHONPATH": folders},
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            raise InputError(f"{path}: cannot be read within {_LIMIT_S:g} s; allowed: {FORMATS}") from None
        except OSError as exc:
            raise ResourceError(f"{path}: cannot be read: the reading process could not be started: {exc}") from exc
        if ended.returncode not in (0, 1):
            raise InputError(f"{path}: cannot be read: the reading process died; allowed: {FORMATS}")
        if ended.returncode:
            raise InputError(ended.stderr.strip().splitlines()[-1])
        with np.load(output, allow_pickle=False) as archive:
            names = archive["names"].tolist()
            arrays = {name: archive[f"arr_{i}"] for i, name in enumerate(names)}
            return arrays, dict(zip(names, archive["units"].tolist(), strict=True))


def write_arrays() -> None:
    """The process of `_read_apart`: writes the arrays of numbers to an .npz file, or ends with a line."""
    path, output, group, scene = sys.argv[1:]
    try:
        arrays, units = _binary_arrays(Path(path), group, scene)
        kept = {name: _plain(values) for name, values in arrays.items()}
    except RotorError as exc:
        sys.exit(str(exc))
    except Exception as exc:  # of any library
        sys.exit(f"{path}: cannot be read: {_line(exc)}; allowed: {FORMATS}")
    kept = {name: values for name, values in kept.items() if values.dtype.kind in "fiu"}
    np.savez(output, *kept.values(), names=np.array(list(kept), str), units=[units.get(name, "") for name in kept])


def _binary_arrays(path: Path, group: str, scene: str) -> tuple[Mapping[str, Any], Mapping[str, str]]:
    with path.open("rb") as file:
        head = file.read(len(_MATLAB_5))
    if head.startswith(_ZIP):
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}, {}
    if head.startswith(_MATLAB_5):
        from scipy.io import loadmat  # late: 0.1 s

        return {name: values for name, values in loadmat(path).items() if not name.startswith("__")}, {}
    if head.startswith(_NETCDF3):
        from scipy.io import netcdf_file

        with netcdf_file(path, "r", mmap=False) as file:
            units = {name: item.units.decode() for name, item in file.variables.items() if hasattr(item, "units")}
            return {name: np.array(variable[:]) for name, variable in file.variables.items()}, units
    if path.suffix.lower() == ".outb":
        return _openfast(path)
    if table.is_of_this_program(path) and RUNS in table.TableFile(path, ()).groups:
        return run_arrays(path, group, scene), {}
    return table.read_arrays(path, group, scene)


def _openfast(path: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """OpenFAST's binary output, by its own project's reader."""
    try:
        from openfast_io.FAST_output_reader import load_binary_output
    except ImportError as exc:
        hint = 'pip install "rotor_mbs[openfast]", or text output (OutFileFmt 1)'
        raise InputError(f"{path}: openfast_io is not installed; allowed: {hint}") from exc
    values, facts, _ = load_binary_output(str(path))
    names, units = facts["attribute_names"], facts["attribute_units"]
    return {name: values[:, i] for i, name in enumerate(names)}, dict(zip(names, units, strict=True))


def _read_text(source: str, text: str) -> DataTable:
    """The columns of a text file. Raises InputError with the line where something else than a number stands."""
    # Lines of nothing but dividers are what spreadsheets write for empty rows.
    lines = [(i, line.strip(" ")) for i, line in enumerate(text.splitlines(), start=1) if line.strip(" \t,;")]
    first, divider = _first_row(source, lines)
    head = [line for _, line in lines[:first]]
    rows = [(i, _FORTRAN.sub("E", row)) for i, row in lines[first:] if not row.startswith(_COMMENT)]
    if divider != "," and not any("." in row for _, row in rows):  # else a comma may stand between thousands
        rows = [(i, row.replace(",", ".")) for i, row in rows]
    values = _numbers(source, rows, divider)
    comments = [line.lstrip("#%/! ") for line in head if line.startswith(_COMMENT)]
    variable = _EXUDYN.search("\n".join(comments))
    if variable is not None and "sensor output file" in comments[0]:
        return table_of(source, {"time": values[:, 0], variable[1]: values[:, 1:]})
    plain = [line for line in head if not line.startswith(_COMMENT)] or comments
    columns = {}
    for (name, unit), column in zip(_names(source, plain, values.shape[1], divider), values.T, strict=True):
        if name or not np.isnan(column).all():  # a divider at the end of every line makes a column of nothing
            while name in columns:
                name = f"_{name}"
            columns[name] = DataColumn(column.copy(), unit)
    return DataTable(source, columns)


def _first_row(source: str, lines: Lines) -> tuple[int, str | None]:
    """Place of the first row of numbers, and what divides its fields."""
    nearest = 0, ""
    for place, (number, line) in enumerate(lines):
        for divider in () if line.startswith(_COMMENT) else _DIVIDERS:
            fields = _fields(_FORTRAN.sub("E", line), divider)
            others = [field for field in fields if field and not _is_number(field, decimal_comma=divider != ",")]
            if len(fields) > 1 and any(fields) and not others:
                return place, divider
            if others and len(fields) - len(others) > nearest[0]:
                nearest = len(fields) - len(others), f"; line {number} has {others[0][:40]!a}"
    if any(_is_number(line, decimal_comma=True) for _, line in lines):
        raise InputError(f"{source}: one column of numbers; allowed: a column of times, and others beside it")
    raise InputError(f"{source}: no row of numbers in it{nearest[1]}; allowed: columns of numbers below a header line")


def _fields(line: str, divider: str | None) -> list[str]:
    if divider is None:
        return line.split()
    return [field.strip() for field in next(csv.reader([line], delimiter=divider))]


def _is_number(field: str, *, decimal_comma: bool) -> bool:
    try:
        float(field)
    except ValueError:
        return decimal_comma and _DECIMAL_COMMA.fullmatch(field) is not None
    return True


def _numbers(source: str, rows: Lines, divider: str | None) -> NDArray[np.float64]:
    """(n, columns), NaN where a field is empty."""
    width = len(_fields(rows[0][1], divider))
    values = np.empty((len(rows), width))
    for i, (number, line) in enumerate(rows):
        fields = _fields(line, divider)
        if len(fields) != width:
            raise InputError(f"{source}:{number}: {len(fields)} fields, where the rows above have {width}")
        try:
            values[i] = [float(field or "nan") for field in fields]
        except ValueError:
            bad = next(j for j, field in enumerate(fields) if field and not _is_number(field, decimal_comma=False))
            raise InputError(
                f"{source}:{number}: {fields[bad][:40]!a} in column {bad + 1}; allowed: a number"
            ) from None
    return values


def _names(source: str, head: Sequence[str], width: int, divider: str | None) -> list[tuple[str, str]]:
    """Name and unit of each column from the last line of the head, or from the last two, where one has the units."""
    if not head:
        raise InputError(f"{source}: no header line above the numbers; allowed: a line such as: time [s],rotor [rad]")
    last = _words(head[-1], divider, width)
    units = [word.strip("[]() ") for word in last]
    above = _words(head[-2], divider, width) if len(head) > 1 else []
    if len(above) == len(last) and not UNITS["time"].keys().isdisjoint(unit.lower() for unit in units):
        names = list(zip(above, units, strict=True))
    else:
        names = [named_unit(word) for word in last]
    if len(names) == width - 1 and divider is not None:
        names.append(("", ""))
    if len(names) != width:
        raise InputError(f"{source}: {len(names)} names in the header, {width} columns of numbers; allowed: as many")
    return names


def _words(line: str, divider: str | None, width: int) -> list[str]:
    """The names in a line of the head, which may be divided otherwise than the numbers are."""
    words = _fields(line, divider)
    if len(words) in (width, width - 1) and divider is not None:
        return words
    ways = (re.split(r"\s{2,}|\t", line), _NAME_AND_UNIT.findall(line), line.split(), _fields(line, ","))
    return next((other for other in ways if len(other) == width), words)
