"""A file of any format as a table: the one place that decides what a file is."""

from __future__ import annotations

import os
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.errors import InputError
from rotor_mbs.foreign.table import DataTable, table_of
from rotor_mbs.foreign.text_files import read_text
from rotor_mbs.runs import files
from rotor_mbs.runs.read import is_sweep, run_arrays

LARGEST = 1 << 29  # bytes; a trajectory of a million rows of ten columns is 80 MB
FORMATS = "text with a header, .npz, .mat, HDF5, netCDF, OpenFAST .out and .outb"
_HDF5, _NETCDF3, _ZIP = b"\x89HDF\r\n\x1a\n", b"CDF", b"PK\x03\x04"
_MATLAB_5 = b"MATLAB 5.0 MAT-file"
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")  # spreadsheets' "Unicode text"


def read_table(path: str | os.PathLike[str], group: str = "", scene: str = "") -> DataTable:
    """The columns of numbers in a file; `group`, `scene`: see `runs.files.read_arrays`.

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
    try:
        if head.startswith(_HDF5) or head[512:].startswith(_HDF5):  # MATLAB puts a block of its own in front
            if files.is_of_this_program(path) and not is_sweep(path):
                return table_of(source, run_arrays(path, group, scene))
            return table_of(source, *files.read_arrays(path, group, scene))
        if head.startswith(_ZIP):
            with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
                return table_of(source, {name: archive[name] for name in archive.files})
        if head.startswith(_MATLAB_5):
            return _matlab(path)
        if head.startswith(_NETCDF3):
            from scipy.io import netcdf_file  # late: 0.1 s

            with netcdf_file(path, "r", mmap=False) as file:
                arrays = {name: np.array(variable[:]) for name, variable in file.variables.items()}
                units = {name: item.units.decode() for name, item in file.variables.items() if hasattr(item, "units")}
            return table_of(source, arrays, units)
        if path.suffix.lower() == ".outb":
            return _openfast(path)
        if b"\x00" in head and not head.startswith(_UTF_16):
            raise InputError(f"{path}: not a format that can be read; allowed: {FORMATS}")
        content = path.read_bytes()
        try:
            text = content.decode("utf-16" if content.startswith(_UTF_16) else "utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("latin-1")
        return read_text(source, text)
    except (OSError, ValueError, zipfile.BadZipFile, struct.error, MemoryError, KeyError) as exc:
        raise InputError(f"{path}: cannot be read: {_line(exc)}; allowed: {FORMATS}") from exc


def _line(exc: BaseException) -> str:
    return (str(exc).splitlines() or [type(exc).__name__])[0]


def _matlab(path: Path) -> DataTable:
    from scipy.io import loadmat  # late: 0.1 s
    from scipy.io.matlab import MatReadError

    try:
        variables: dict[str, Any] = loadmat(path)
    except (MatReadError, TypeError, IndexError) as exc:
        raise InputError(f"{path}: a damaged MAT file: {_line(exc)}") from exc
    return table_of(str(path), {name: values for name, values in variables.items() if not name.startswith("__")})


def _openfast(path: Path) -> DataTable:
    """OpenFAST's binary output, by its own project's reader."""
    try:
        from openfast_io.FAST_output_reader import load_binary_output
    except ImportError as exc:
        hint = 'pip install "rotor_mbs[openfast]", or text output (OutFileFmt 1)'
        raise InputError(f"{path}: openfast_io is not installed; allowed: {hint}") from exc
    values, facts, _ = load_binary_output(str(path))
    names, units = facts["attribute_names"], facts["attribute_units"]
    arrays = {name: values[:, i] for i, name in enumerate(names)}
    return table_of(str(path), arrays, dict(zip(names, units, strict=True)))
