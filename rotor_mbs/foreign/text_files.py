"""Columns in text: comma-separated values, columns divided by blanks, Exudyn's sensor files, OpenFAST's `.out`."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence

import numpy as np

from rotor_mbs.errors import InputError
from rotor_mbs.foreign.table import DataColumn, DataTable, named_unit, table_of

_COMMENT = ("#", "%", "//", "!")
_NAME_AND_UNIT = re.compile(r"\S+(?: \d+)?(?: \w+)?\s*[\[(][^\])]*[\])]")
_EXUDYN = re.compile(r"OutputVariableType = (\w+)")


def read_text(source: str, text: str) -> DataTable:
    """The columns of a text file. Raises InputError with the line where something else than a number stands."""
    lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), start=1) if line.strip()]
    head, rows = _split(source, lines)
    divider = _divider(rows[0][1])
    width = len(_fields(rows[0][1], divider))
    values = _numbers(source, rows, divider, width)
    comments = [line.lstrip("#%/! ") for _, line in head if line.startswith(_COMMENT)]
    variable = _EXUDYN.search("\n".join(comments))
    if variable is not None and "sensor output file" in comments[0]:
        return table_of(source, {"time": values[:, 0], variable[1]: values[:, 1:]})
    plain = [line for _, line in head if not line.startswith(_COMMENT)] or comments
    names, units = _names(source, plain, width, divider)
    columns = (DataColumn(values[:, i].copy(), units[i]) for i in range(width))
    return DataTable(source, dict(zip(names, columns, strict=True)))


def _split(source: str, lines: Sequence[tuple[int, str]]) -> tuple[list[tuple[int, str]], list[tuple[int, str]]]:
    """Lines before the first row of numbers, and the rows without comments."""
    for place, (_, line) in enumerate(lines):
        if not line.startswith(_COMMENT) and all(map(_is_number, _fields(line, _divider(line)))):
            rows = [(number, row) for number, row in lines[place:] if not row.startswith(_COMMENT)]
            return list(lines[:place]), rows
    raise InputError(f"{source}: no row of numbers in it; allowed: columns of numbers under a line of names")


def _divider(line: str) -> str | None:
    """What divides the fields of a line; None: blanks."""
    return next((mark for mark in (";", ",", "\t") if mark in line), None)


def _fields(line: str, divider: str | None) -> list[str]:
    if divider is None:
        return line.split()
    found = [field.strip() for field in next(csv.reader([line], delimiter=divider))]
    return found[:-1] if len(found) > 1 and not found[-1] else found  # a divider at the end of a line


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def _numbers(
    source: str, rows: Sequence[tuple[int, str]], divider: str | None, width: int
) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """(n, width)"""
    values = np.empty((len(rows), width))
    for i, (number, line) in enumerate(rows):
        fields = _fields(line, divider)
        if len(fields) != width:
            raise InputError(f"{source}:{number}: {len(fields)} fields, where the rows above have {width}")
        for j, field in enumerate(fields):
            try:
                values[i, j] = float(field)
            except ValueError:
                raise InputError(f"{source}:{number}: {field[:40]!a} in column {j + 1}; allowed: a number") from None
    return values


def _names(source: str, head: Sequence[str], width: int, divider: str | None) -> tuple[list[str], list[str]]:
    """Names and units from the last line of the head, or from the last two, where the last one has units alone."""
    if not head:
        raise InputError(f"{source}: no line of names above the numbers; allowed: one such as: time [s],rotor [rad]")
    last = _words(head[-1], divider, width)
    if len(head) > 1 and all(re.fullmatch(r"[\[(].*[\])]", word) for word in last):
        names, units = _words(head[-2], divider, width), [word[1:-1].strip() for word in last]
    else:
        pairs = [named_unit(word) for word in last]
        names, units = [name for name, _ in pairs], [unit for _, unit in pairs]
    if len(names) != width or len(units) != width:
        raise InputError(f"{source}: {len(names)} names in the header, {width} columns of numbers; allowed: as many")
    repeated = [name for i, name in enumerate(names) if name in names[:i]]
    if repeated:
        raise InputError(f"{source}: two columns are named {repeated[0]!r}; allowed: different names")
    return names, units


def _words(line: str, divider: str | None, width: int) -> list[str]:
    """The names in a line of the head, which may be divided otherwise than the numbers are."""
    ways = [_fields(line, divider), _fields(line, _divider(line)), re.split(r"\s{2,}|\t", line)]
    ways += [_NAME_AND_UNIT.findall(line), line.split()]
    return next((words for words in ways if len(words) == width), ways[0])
