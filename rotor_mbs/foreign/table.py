"""Named columns of numbers, whatever file they came from."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError

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
            raise InputError(f"{self.source}: no column {name!r}; it has: {shown_names(list(self.columns))}")
        return self.columns[name]


def table_of(source: str, arrays: Mapping[str, Any], units: Mapping[str, str] | None = None) -> DataTable:
    """Columns from arrays by name; one of two dimensions (n, k) becomes `name[0]` ... `name[k-1]`.

    Arrays that are no numbers, are single numbers, or have more dimensions are left out. An array (k, n) beside others
    of length n is turned, as MATLAB's are where they are stored by HDF5.
    """
    try:
        numeric = {name: np.squeeze(_plain(values)) for name, values in arrays.items()}
    except ValueError as exc:
        raise InputError(f"{source}: rows of different lengths; allowed: arrays (n,) and (n, columns)") from exc
    numeric = {name: values for name, values in numeric.items() if values.dtype.kind in "fiu" and values.ndim in (1, 2)}
    rows = max((values.size for values in numeric.values() if values.ndim == 1), default=0)
    columns: dict[str, DataColumn] = {}
    for name, values in numeric.items():
        plain, unit = named_unit(name)
        unit = (units or {}).get(name, unit)
        if values.ndim == 1:
            columns[plain] = DataColumn(values.astype(float), unit)
            continue
        turned = values.T if values.shape[1] == rows != values.shape[0] else values
        for number, column in enumerate(turned.T):
            columns[f"{plain}[{number}]"] = DataColumn(column.astype(float), unit)
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
