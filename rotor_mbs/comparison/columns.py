"""Define the table of named columns, with units, to which all data are converted when read."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from numbers import Real
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.comparison.units import is_unit, plain_unit, unit_of_attributes
from rotor_mbs.errors import InputError, shown_value

# Largest number of columns of a file. Wide results of a finite-element program have some thousands.
MAX_COLUMNS = 100_000
# Largest number of characters of a name. Longer names are cut, so that messages and pages stay
# readable.
MAX_NAME = 200
_MAX_SHOWN = 12  # largest number of names that a message lists
_MAX_SHOWN_NAME = 60  # largest number of characters of a name in such a list
_MAX_SHOWN_VALUE = 40  # largest number of characters of a value that a message shows


class DataColumn(NamedTuple):
    """A column of numbers.

    Attributes
    ----------
    values : (n,) numbers in the unit of the file, NaN for a missing number.
    unit : the unit that the file states; "" if it states none.
    step : step between the numbers, in the same unit, if they are packed as integers; otherwise 0.
    missing : text for messages about the first missing number, with its row: "empty in row 2 of 9
        (line 3)". It is "" if no number is missing. Only columns of text files, and of JSON files
        without NaN, have this text; for all other data it is "".
    """

    values: NDArray[np.float64]
    unit: str = ""
    step: float = 0.0
    missing: str = ""


class LeftOut(NamedTuple):
    """The reason why a part of a file is not read as a column of numbers.

    Attributes
    ----------
    reason : the reason in words, "row 3 has 'x', no number".
    is_column : whether the part is a column, but of values that are no numbers. If such a column
        has the name of a channel, the data are refused.
    """

    reason: str
    is_column: bool = False


@dataclass(frozen=True)
class DataTable:
    """The columns of a file, or of arrays that a caller passes.

    Attributes
    ----------
    source : name of the file in messages; "data" for arrays.
    columns : the columns by name, in the order of the file.
    left_out : for each other part of the file, by its name, the reason why it is not read as a
        column of numbers.
    program : "openfast" if the head of the file says that OpenFAST wrote it, otherwise "".
    headers : for each renamed column, by its new name, its name in the file. A column is renamed if
        an earlier column has the same name.
    """

    source: str
    columns: Mapping[str, DataColumn]
    left_out: Mapping[str, LeftOut] = field(default_factory=dict)
    program: str = ""
    headers: Mapping[str, str] = field(default_factory=dict)

    def __getitem__(self, name: str) -> DataColumn:
        """Return the column with a name.

        Parameters
        ----------
        name : name of the column, without its unit.

        Raises
        ------
        InputError
            If there is no such column, or it is not a column of numbers. In the first case the
            message lists the columns of the table.
        """
        if name in self.left_out:
            raise self.refusal(name)
        if name not in self.columns:
            available = shown_names(list(self.columns))
            problem = f"no column {shown_value(name)}; available: {available}"
            raise InputError(f"{self.source}: {problem}")
        return self.columns[name]

    def refusal(self, name: str) -> InputError:
        """Return the error for a column that is needed but is in `left_out`."""
        column = f"column {name!r}: {self.left_out[name].reason}"
        return InputError(f"{self.source}: {column}; allowed: real numbers, a row for every time")


def arrays_of(data: Any) -> tuple[dict[str, Any], dict[str, str]]:
    """Return arrays and their units by name from a mapping, a DataFrame or a Dataset.

    The levels of a column's name in a DataFrame are joined to a path; if the last level is a unit,
    it becomes the array's unit. The index of a DataFrame becomes an array, unless it only counts
    the rows. If an index has one level, no name, and durations or floating-point numbers, it is
    named "time".

    Parameters
    ----------
    data : a mapping, a pandas.DataFrame, or an xarray.Dataset. The coordinates of a Dataset are
        arrays, too.

    Returns
    -------
    dict, dict
        The arrays by name; the units by name, of the arrays that have one.
    """
    arrays: dict[str, Any] = {}
    units: dict[str, str] = {}
    index = getattr(data, "index", None)
    if index is not None and hasattr(index, "names") and type(index).__name__ != "RangeIndex":
        for level, name in enumerate(index.names):
            values = np.asarray(index.get_level_values(level))
            label = "time" if values.dtype.kind in "fm" and len(index.names) == 1 else "index"
            arrays[label if name is None else str(name)] = values
    # The time of an xarray.Dataset is a coordinate, which `items` leaves out.
    for name, values in [*dict(getattr(data, "coords", {})).items(), *data.items()]:
        label, unit = _joined(name)
        if label in arrays:
            label = f"{label} (column {len(arrays) + 1})"
        arrays[label] = values
        unit = unit_of_attributes(getattr(values, "attrs", {})) or unit
        if unit:
            units[label] = unit
    return arrays, units


def _joined(name: object) -> tuple[str, str]:
    """Return the name and unit of a column whose name may be a tuple of levels."""
    if not isinstance(name, tuple):
        return str(name), ""
    levels = [str(level).strip() for level in name]
    unit = ""
    if len(levels) > 1 and (is_unit(levels[-1]) or not plain_unit(levels[-1])):
        unit = levels.pop()
    return "/".join(level for level in levels if level), unit


def table_of(
    source: str,
    arrays: Mapping[str, Any],
    units: Mapping[str, str] | None = None,
    steps: Mapping[str, float] | None = None,
) -> DataTable:
    """Convert arrays by name to columns.

    A two-dimensional array (n, k) becomes the columns `name[0]` ... `name[k-1]`; a
    three-dimensional array (n, j, k) becomes the columns `name[0,0]` ... `name[j-1,k-1]`. An array
    of shape (k, n) is transposed if n, but not k, is the length of the longest one-dimensional
    array: MATLAB's arrays have this shape in HDF5. Values that are no numbers, single numbers,
    empty arrays, and arrays of more dimensions are put into `left_out`.

    Parameters
    ----------
    source : name of the data in messages.
    arrays : arrays, or values that NumPy converts to arrays; masked values become NaN.
    units : units by the name of the array; by default the unit is read from the name.
    steps : steps of packed arrays by name, see `DataColumn`.

    Raises
    ------
    InputError
        If there are no columns of numbers, or more than `MAX_COLUMNS`; if two columns have one
        name, such as "q[0]" and the first column of an array "q".
    """
    numeric: dict[str, NDArray[Any]] = {}
    left_out: dict[str, LeftOut] = {}
    stated = dict(units or {})
    for name, values in arrays.items():
        try:
            numeric[name], unit = _numbers(values)
        except _NotNumbersError as exc:
            left_out[name] = exc.left_out
            continue
        if unit:
            stated[name] = unit
    # Dimensions of length 1 come from MATLAB, whose arrays have at least two dimensions; they are
    # removed. An exception is a table of modes for a single speed. The data are taken as such a
    # table if an array has the shape (1,); arrays whose first dimension is 1 then keep it.
    is_single_row = any(values.shape == (1,) for values in numeric.values())
    for name, values in list(numeric.items()):
        squeezed = values if is_single_row and values.shape[:1] == (1,) else np.squeeze(values)
        numeric[name] = squeezed
        if squeezed.ndim == 0 or squeezed.ndim > 3 or not squeezed.size:
            shape = " x ".join(map(str, values.shape))
            reason = f"an array of {shape}" if squeezed.ndim or not squeezed.size else "one number"
            left_out[name] = LeftOut(reason)
            del numeric[name]
    rows = 0  # length of the longest one-dimensional array
    for values in numeric.values():
        if values.ndim == 1:
            rows = max(rows, values.size)
    columns: dict[str, DataColumn] = {}
    for name, values in numeric.items():
        plain_name, unit = split_bracketed_unit(name)
        if plain_name in columns:  # "a [m]" beside "a [s]"
            plain_name = name
        unit = stated.get(name, unit)
        step = (steps or {}).get(name, 0.0)
        is_transposed = values.ndim > 1 and values.shape[-1] == rows != values.shape[0]
        oriented = values.T if is_transposed else values
        count = math.prod(oriented.shape[1:])
        if len(columns) + count > MAX_COLUMNS:
            problem = f"array {name[:_MAX_SHOWN_NAME]!r} has {count} columns"
            raise InputError(f"{source}: {problem}; allowed: up to {MAX_COLUMNS} in all")
        for place in np.ndindex(oriented.shape[1:]):
            label = f"{plain_name}[{','.join(map(str, place))}]" if place else plain_name
            if label in columns:  # "q[0]" beside an array "q"
                raise InputError(f"{source}: two columns {label!r}; allowed: one of each name")
            columns[label] = DataColumn(oriented[:, *place].astype(float), unit, step)
    if not columns:
        allowed = "a time and angles, as columns or arrays"
        raise InputError(f"{source}: no columns of numbers in it; allowed: {allowed}")
    return DataTable(source, columns, left_out)


class _NotNumbersError(Exception):
    """Raised for values that are no numbers."""

    def __init__(self, reason: str, *, is_column: bool) -> None:
        super().__init__(reason)
        self.left_out = LeftOut(reason, is_column)


def _numbers(values: Any) -> tuple[NDArray[Any], str]:
    """Convert values to an array of numbers, and return the array and its unit.

    Only durations have a unit here: they are converted to seconds.

    Parameters
    ----------
    values : an array, or values that NumPy converts to an array.

    Returns
    -------
    ndarray, str
        The numbers, of the shape of `values`, with NaN for masked and missing values; "s" for
        durations, otherwise "".

    Raises
    ------
    _NotNumbersError
        If a value is no number, or rows have different lengths.
    """
    if np.ma.isMaskedArray(values):
        values = np.ma.filled(values.astype(float), np.nan)
    try:
        array = np.asarray(values)
        if array.dtype.kind in "US" and isinstance(values, list | tuple):
            # If a list contains a text, NumPy converts its numbers to texts, too. In an array of
            # objects they remain numbers.
            array = np.asarray(values, object)
    except (ValueError, TypeError) as exc:
        raise _NotNumbersError("rows of different lengths", is_column=True) from exc
    if array.dtype.kind in "fiu":
        return array, ""
    if array.dtype.kind == "m":
        seconds = array / np.timedelta64(1, "s")
        return seconds, "s"
    if array.dtype.kind == "O":
        return _numbers_of_objects(array), ""
    names = {"M": "dates", "b": "true or false", "V": "records"}
    if array.dtype.kind == "c":
        raise _NotNumbersError("complex numbers", is_column=array.ndim > 0)
    if array.dtype.kind in names:
        raise _NotNumbersError(f"{names[array.dtype.kind]}, no numbers", is_column=array.ndim > 0)
    if array.ndim == 0 or not array.size:
        raise _NotNumbersError("a text", is_column=False)
    raise _NotNumbersError(_shown_value(1, array.flat[0]), is_column=True)


def _numbers_of_objects(array: NDArray[Any]) -> NDArray[np.float64]:
    """Convert an array of objects to numbers, with NaN for None and pandas' missing values.

    Parameters
    ----------
    array : (n, ...) objects.

    Raises
    ------
    _NotNumbersError
        If an object is no number. The message names the row of the first such object; if the object
        is a list or an array, the message is that rows have different lengths.
    """
    numbers = np.empty(array.size)
    width = math.prod(array.shape[1:]) or 1
    for i, value in enumerate(array.flat):
        # pandas.NA and NaT are missing values, but their types are no number types.
        if value is None or type(value).__name__ in ("NAType", "NaTType"):
            numbers[i] = np.nan
            continue
        is_number = isinstance(value, Real | Decimal) and not isinstance(value, bool | np.bool_)
        if not is_number:
            reason = _shown_value(i // width + 1, value)
            if isinstance(value, list | tuple | np.ndarray):
                reason = "rows of different lengths"
            raise _NotNumbersError(reason, is_column=array.ndim > 0 and not isinstance(value, dict))
        try:
            numbers[i] = float(value)
        except OverflowError:  # an integer of more than 308 digits
            numbers[i] = np.inf
    return numbers.reshape(array.shape)


def _shown_value(row: int, value: object) -> str:
    """Return a text that shows a value that is no number: "row 3 has 'x', no number"."""
    text = value.decode("latin-1") if isinstance(value, bytes) else str(value)
    return f"row {row} has {text[:_MAX_SHOWN_VALUE]!a}, no number"


def split_bracketed_unit(name: str) -> tuple[str, str]:
    """Split a column's name into name and unit; the unit is "" if there is none.

    The recognized forms are "rotor [deg]", "rotor (deg)", "rotor / deg", "rotor in deg" and
    "rotor, deg". Numbers in brackets are indices, not a unit: "q[1,1]". Round brackets directly
    after a word enclose the argument of a function if the word is "der" or their content is no
    unit: "der(phi)".

    Parameters
    ----------
    name : name of a column, of any length: the computing time is proportional to the length.

    >>> split_bracketed_unit("rotor [deg]"), split_bracketed_unit("t / s")
    (('rotor', 'deg'), ('t', 's'))
    >>> split_bracketed_unit("q[0]")
    ('q[0]', '')
    """
    text = name.strip()
    units = [place for place in (_bracketed(text), _behind_stroke(text)) if place is not None]
    if not units:
        for divider in (" in ", ","):
            stem, _, unit = text.rpartition(divider)
            if stem.strip() and is_unit(unit):
                return stem.strip(), unit.strip()
        return text, ""
    end, unit = min(units)
    stem = text[:end].strip()
    if not stem or _is_argument(text, end, stem, unit):
        return text, ""
    return stem, unit


def _is_argument(text: str, end: int, stem: str, unit: str) -> bool:
    """Return whether a supposed unit is an index, or the argument of a function.

    Parameters
    ----------
    text : a column's name.
    end : position in `text` of the bracket or stroke before the supposed unit; for " / unit" that
        of the blanks before the stroke.
    stem, unit : the text before this position, and the supposed unit.
    """
    if unit and all(character.isdigit() or character in ", " for character in unit):
        return True
    if text[end] != "(" or text[end - 1].isspace():
        return False
    return stem.rpartition("/")[2].lower() == "der" or not is_unit(unit)


def _bracketed(text: str) -> tuple[int, str] | None:
    """Find brackets at the end of a name.

    Returns
    -------
    (int, str) or None
        The position of the opening bracket, and the text in the brackets; None if the name does not
        end with brackets.
    """
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
    """Find " / unit" or " /unit" at the end of a name.

    Returns
    -------
    (int, str) or None
        The position in `text` of the blanks before " / unit", or of the stroke in " /unit"; the
        unit. None if the name has no such end.
    """
    words = text.rsplit(maxsplit=2)
    if len(words) == 3 and words[1] == "/":
        return len(words[0]), words[2]
    if len(words) > 1 and words[-1].startswith("/") and len(words[-1]) > 1:
        return len(text) - len(words[-1]), words[-1][1:]
    return None


def shown_names(names: Sequence[str]) -> str:
    """Return a list of names for a message; a long list is cut and ends with their number."""
    shown = []
    for name in names[:_MAX_SHOWN]:
        text = name if len(name) <= _MAX_SHOWN_NAME else f"{name[:_MAX_SHOWN_NAME]}..."
        shown.append(text if text.isprintable() else ascii(text))
    if len(names) > _MAX_SHOWN:
        return f"{', '.join(shown)}, ... ({len(names)} in all)"
    return ", ".join(shown)
