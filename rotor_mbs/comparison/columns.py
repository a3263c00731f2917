"""Named columns of numbers with units: what becomes of every file, and of arrays in memory."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError

# By dimension: factor to s, rad or rad/s.
_ANGLES = {
    **dict.fromkeys(("rad", "radian", "radians"), 1.0),
    **dict.fromkeys(("deg", "degree", "degrees", "°"), math.pi / 180.0),
    **dict.fromkeys(("turn", "turns", "rev", "revolutions"), 2.0 * math.pi),
}
_TIMES = {
    **dict.fromkeys(("s", "sec", "second", "seconds"), 1.0),
    "ms": 1e-3,
    "us": 1e-6,
    "µs": 1e-6,
    "min": 60.0,
}
_PER_SECOND = ("/s", "/sec", " s-1")
_RATES = {f"{unit}{per}": factor for unit, factor in _ANGLES.items() for per in _PER_SECOND}
_RATES |= dict.fromkeys(("rpm", "rev/min", "r/min"), math.pi / 30.0) | {"hz": 2.0 * math.pi}
_FORCES = {"n": 1.0, "kn": 1e3}
_TIMES_METRE = (" m", "m", "-m", "*m", "·m", ".m")
_MOMENTS = {f"{unit}{metre}": factor for unit, factor in _FORCES.items() for metre in _TIMES_METRE}
UNITS = {
    "time": _TIMES,
    "angle": _ANGLES,
    "rate": _RATES,
    "frequency": _RATES,
    "force": _FORCES,
    "moment": _MOMENTS,
}
ALLOWED_UNITS = {
    "time": "s, ms, us, min",
    "angle": "rad, deg, turns",
    "rate": "rad/s, deg/s, turns/s, rpm",
    "frequency": "rad/s, Hz",
    "force": "N, kN",
    "moment": "N m, kN m",
}
BASE_UNITS = {
    "time": "s",
    "angle": "rad",
    "rate": "rad/s",
    "frequency": "rad/s",
    "force": "N",
    "moment": "N m",
}

MAX_COLUMNS = 100_000  # of a file: wide results of a finite-element program have some thousands
MAX_NAME = 200  # characters: longer names are cut, so that messages and pages stay readable
_MAX_SHOWN = 12  # names that a message lists
_MAX_SHOWN_NAME = 60  # characters of each


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
        """Return a column. Raises InputError, with the columns that there are."""
        if name not in self.columns:
            available = shown_names(list(self.columns))
            raise InputError(f"{self.source}: no column {name!r}; available: {available}")
        return self.columns[name]


def table_of(
    source: str, arrays: Mapping[str, Any], units: Mapping[str, str] | None = None
) -> DataTable:
    """Return arrays by name as columns.

    An array of two dimensions (n, k) becomes the columns `name[0]` ... `name[k-1]`, one of three
    (n, j, k) the columns `name[0,0]` ... `name[j-1,k-1]`. An array (k, n) beside others of length n
    is transposed, as MATLAB's arrays are where HDF5 stores them. What is no numbers, is a single
    number, or has more dimensions is left out.

    Parameters
    ----------
    source : what messages call the data.
    arrays : arrays, or what NumPy makes arrays of; masked values become NaN.
    units : units by the name of the array; by default a unit in brackets behind the name.

    Raises
    ------
    InputError
        If there are no columns of numbers, or more than `MAX_COLUMNS`.
    """
    try:
        plain_arrays = {name: _unmasked(values) for name, values in arrays.items()}
    except ValueError as exc:
        allowed = "arrays (n,) and (n, columns)"
        raise InputError(f"{source}: rows of different lengths; allowed: {allowed}") from exc
    # A single row, of one speed, is a column of length 1; otherwise dimensions of length 1 are
    # MATLAB's.
    is_single_row = any(values.shape == (1,) for values in plain_arrays.values())
    numeric: dict[str, NDArray[Any]] = {}
    for name, values in plain_arrays.items():
        squeezed = values if is_single_row and values.shape[:1] == (1,) else np.squeeze(values)
        if squeezed.dtype.kind in "fiu" and 0 < squeezed.ndim < 4:
            numeric[name] = squeezed
    rows = 0  # of the columns, as the arrays of one dimension have them
    for values in numeric.values():
        if values.ndim == 1:
            rows = max(rows, values.size)
    columns: dict[str, DataColumn] = {}
    for name, values in numeric.items():
        plain_name, stated = split_bracketed_unit(name)
        unit = (units or {}).get(name, stated)
        if values.ndim == 1:
            columns[plain_name] = DataColumn(values.astype(float), unit)
            continue
        is_transposed = values.shape[-1] == rows != values.shape[0]
        oriented = values.T if is_transposed else values
        count = math.prod(oriented.shape[1:])
        if len(columns) + count > MAX_COLUMNS:
            problem = f"array {name[:_MAX_SHOWN_NAME]!r} has {count} columns"
            raise InputError(f"{source}: {problem}; allowed: up to {MAX_COLUMNS} in all")
        for place in np.ndindex(oriented.shape[1:]):
            label = f"{plain_name}[{','.join(map(str, place))}]"
            columns[label] = DataColumn(oriented[:, *place].astype(float), unit)
    if not columns:
        allowed = "a time and angles, as columns or arrays"
        raise InputError(f"{source}: no columns of numbers in it; allowed: {allowed}")
    return DataTable(source, columns)


def _unmasked(values: Any) -> NDArray[Any]:
    """Return values as an array, NaN where they are masked."""
    if np.ma.isMaskedArray(values):
        return np.asarray(np.ma.filled(values.astype(float), np.nan))
    return np.asarray(values)


def split_bracketed_unit(name: str) -> tuple[str, str]:
    """Return name and unit of "rotor [deg]", "rotor (deg)" or "rotor / deg"; "" for no unit.

    A number in brackets is an index: "q[0]" has no unit. Linear in the length of the name, which
    may be any.

    >>> split_bracketed_unit("rotor [deg]"), split_bracketed_unit("t / s")
    (('rotor', 'deg'), ('t', 's'))
    >>> split_bracketed_unit("q[0]")
    ('q[0]', '')
    """
    text = name.strip()
    units = [place for place in (_bracketed(text), _behind_stroke(text)) if place is not None]
    if not units:
        return text, ""
    end, unit = min(units)
    stem = text[:end].strip()
    if not stem or unit.isdigit():
        return text, ""
    return stem, unit


def _bracketed(text: str) -> tuple[int, str] | None:
    """Return where the last brackets of a name open, if it ends with them, and what is in them."""
    if not text.endswith(("]", ")")):
        return None
    inner = text[:-1]
    begin = max(inner.rfind("]"), inner.rfind(")")) + 1
    places = [inner.find(mark, begin) for mark in "[("]
    opened = [place for place in places if place >= 0]
    if not opened:
        return None
    return min(opened), inner[min(opened) + 1 :].strip()


def _behind_stroke(text: str) -> tuple[int, str] | None:
    """Return where "/ unit" begins at the end of a name, blanks before the stroke, and the unit."""
    words = text.rsplit(maxsplit=2)
    if len(words) == 3 and words[1] == "/":
        return len(words[0]), words[2]
    if len(words) > 1 and words[-1].startswith("/") and len(words[-1]) > 1:
        return len(text) - len(words[-1]), words[-1][1:]
    return None


def shown_names(names: list[str]) -> str:
    """Return the first names as a message can list them."""
    shown = []
    for name in names[:_MAX_SHOWN]:
        text = name if len(name) <= _MAX_SHOWN_NAME else f"{name[:_MAX_SHOWN_NAME]}..."
        shown.append(text if text.isprintable() else ascii(text))
    if len(names) > _MAX_SHOWN:
        return f"{', '.join(shown)}, ... ({len(names)} in all)"
    return ", ".join(shown)
