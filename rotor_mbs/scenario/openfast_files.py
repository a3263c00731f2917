"""Read OpenFAST's input files by the names of their lines.

A line is `value  Name  - comment`. OpenFAST itself reads by line number, so that a reader by line
number knows one generation of files; names hardly change from FAST v8 to OpenFAST 5.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

from rotor_mbs.errors import InputError
from rotor_mbs.scenario import keys
from rotor_mbs.scenario.keys import Kind
from rotor_mbs.scenario.toml_file import TableError, shown_path

MAX_BYTES = 32 << 20
MAX_ROWS = 100_000  # of a table; real ones have 10 to 200
# Header and description of a file, which are text of any form.
_TITLE_LINES = 2
_NAME = re.compile(r"[A-Za-z_]\w*(?:\(\d+\))?")
_VALUE = re.compile(r"\"([^\"]*)\"|'([^']*)'|([^\s,;]+)")
# Fortran's numbers: 1.5, .5, 5., 1E3, 1.0D5.
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?")
_FLAGS = {
    "t": True, "true": True, ".true.": True, ".t.": True,
    "f": False, "false": False, ".false.": False, ".f.": False,
}  # fmt: skip


class InputFile:
    """An input file of OpenFAST.

    Attributes
    ----------
    path : of the file.
    lines : its lines, without line ends.

    Raises
    ------
    InputError
        If the file cannot be read.
    """

    def __init__(self, path: Path, named_by: str = "", what: str = "an input file") -> None:
        """Read a file.

        Parameters
        ----------
        path : of the file.
        named_by : the file, line and name that refer to it, for messages: "a.fst:31: EDFile".
        what : kind of the file, for messages.

        Raises
        ------
        InputError
            If the file cannot be read.
        """
        self.path = path
        shown = f"{named_by}: {shown_path(path)}" if named_by else shown_path(path)
        allowed = f"allowed: {what} that can be read"
        try:
            if not path.is_file():  # a pipe or a device would block, or never end
                problem = "is not a regular file" if path.exists() else "no such file"
                raise InputError(f"{shown}: {problem}; {allowed}")
            with path.open("rb") as file:
                content = file.read(MAX_BYTES + 1)
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise InputError(f"{shown}: cannot be read: {reason}; {allowed}") from error
        if len(content) > MAX_BYTES:
            raise InputError(f"{shown}: is larger than {MAX_BYTES >> 20} MiB; {allowed}")
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("latin-1")  # every file can be read so
        # Only these end a line; `splitlines` knows others, which comments may contain.
        self.lines = re.split(r"\r\n|\n|\r", text)

    @cached_property
    def _entries(self) -> dict[str, tuple[int, list[str]]]:
        """Return line number and values by plain name; of a name that occurs twice, the first."""
        entries: dict[str, tuple[int, list[str]]] = {}
        for number, line in enumerate(self.lines[_TITLE_LINES:], _TITLE_LINES + 1):
            name, values = _split_line(line)
            if name == "outlist":  # channels follow, whose names are no keys
                break
            if name:
                entries.setdefault(name, (number, values))
        return entries

    @property
    def description(self) -> str:
        """Return its second line, which is free text."""
        return self.lines[1].strip() if len(self.lines) > 1 else ""

    def __contains__(self, name: str) -> bool:
        """Return whether there is a line of this name."""
        return _plain(name) in self._entries

    def where(self, name: str) -> str:
        """Return file, line and name for a message: "a.fst:31: EDFile"."""
        shown, entry = shown_path(self.path), self._entries.get(_plain(name))
        return f"{shown}:{entry[0]}: {name}" if entry else f"{shown}: {name}"

    def problem(self, name: str, what: str, allowed: str) -> InputError:
        """Return the error of a line: what is wrong with it, and what is allowed."""
        return InputError(f"{self.where(name)}: {what}; allowed: {allowed}")

    def number(self, name: str, kind: Kind = keys.NUMBER, default: float | None = None) -> float:
        """Return the number in the line of this name.

        Parameters
        ----------
        name : of the line.
        kind : what it may be.
        default : where there is no such line.

        Raises
        ------
        InputError
            If there is no such line and no default, or if the number is not allowed.
        """
        if default is not None and name not in self:
            return default
        text = self._first_value(name)
        allowed = kind.allowed.replace("{unit}", "")
        if not _NUMBER.fullmatch(text):
            raise self.problem(name, f"{text[:40]!a} is not a number", allowed)
        values = self._entries[_plain(name)][1]
        # Of "1,5", with a decimal comma, the first value is 1.
        if len(values) > 1:
            found = f"{len(values)} values, {', '.join(values)[:40]!a}"
            raise self.problem(name, found, f"{allowed}, with a decimal point")
        try:
            read: float = kind.read(_as_number(text))
        except TableError as error:
            fault = error.faults[0]
            raise self.problem(name, fault.wrong, fault.allowed or allowed) from error
        return read

    def whole(self, name: str, lowest: int, highest: int, default: int | None = None) -> int:
        """Return the whole number in the line of this name; as `number`."""
        if default is not None and name not in self:
            return default
        number = self.number(name)
        if number != int(number) or not lowest <= number <= highest:
            allowed = f"a whole number from {lowest} to {highest}"
            raise self.problem(name, f"{number:g} is not allowed", allowed)
        return int(number)

    def flag(self, name: str, *, default: bool = False) -> bool:
        """Return the first flag in the line of this name, `default` where there is no such line."""
        if name not in self:
            return default
        text = self._first_value(name)
        if text.lower() not in _FLAGS:
            raise self.problem(name, f"{text[:40]!a} is not a flag", "True or False")
        return _FLAGS[text.lower()]

    def file(self, name: str, what: str) -> InputFile:
        """Return the file that the line of this name gives, relative to this one."""
        # Written on Windows, read anywhere.
        relative = self._first_value(name).replace("\\", "/")
        return InputFile(self.path.parent / relative, self.where(name), what)

    def _first_value(self, name: str) -> str:
        """Return the first value in the line of this name. Raises InputError without the line."""
        entry = self._entries.get(_plain(name))
        if entry is None:
            allowed = "a file of FAST v8 or OpenFAST, with `value  Name  - comment` in a line"
            raise InputError(f"{shown_path(self.path)}: no line named {name}; allowed: {allowed}")
        return entry[1][0]

    def line_with(self, *words: str) -> int:
        """Return the index of the first line that has all these words; -1 where none has."""
        wanted = {word.lower() for word in words}
        for index, line in enumerate(self.lines):
            if wanted <= set(line.lower().split()):
                return index
        return -1

    def lines_of_numbers(self, first: int) -> list[int]:
        """Return the indices of the lines from `first` on that begin with a number."""
        found = []
        for index in range(first, len(self.lines)):
            words = self.lines[index].replace(",", " ").split(maxsplit=1)
            if words and _NUMBER.fullmatch(words[0]):
                found.append(index)
        return found

    def rows(self, first: int, count: int, what: str, width: int) -> list[list[float]]:
        """Return rows of a table of numbers.

        Parameters
        ----------
        first : index of the line of the first row.
        count : how many rows.
        what : a row is, for messages.
        width : how many numbers a row has at least.

        Raises
        ------
        InputError
            For a row of too few numbers, or one that is not finite.
        """
        rows = []
        for index in range(first, first + count):
            line = self.lines[index] if index < len(self.lines) else ""
            row = _numbers_of_row(line)
            if len(row) < width or not all(abs(number) <= keys.LARGEST for number in row):
                place = f"{shown_path(self.path)}:{index + 1}"
                problem = f"{what} {index - first + 1} of {count} is not {width} numbers"
                raise InputError(f"{place}: {problem}; allowed: {width} numbers, |x| <= 1e25")
            rows.append(row)
        return rows


def _plain(name: str) -> str:
    """Return a name as it is looked up: `BldFile(1)` and `BldFile1` are one."""
    return re.sub(r"[()]", "", name).lower()


def _split_line(line: str) -> tuple[str, list[str]]:
    """Return the plain name and the values of a line; "" and [] if it has none.

    The first word is a value. Numbers, flags and texts in quotes behind it are values, too, since
    some lines are lists: `30, 60  LinTimes  - comment`.

    Parameters
    ----------
    line : of an input file of OpenFAST.
    """
    if line.lstrip()[:2] in ("--", "==") or line.lstrip()[:1] in ("!", "#", "%"):
        return "", []
    if line.split()[:1] == ["OutList"]:
        return "outlist", []
    values: list[str] = []
    for match in _VALUE.finditer(line):
        in_quotes, word = match[1] if match[1] is not None else match[2], match[3]
        if in_quotes is not None:
            values.append(in_quotes)
        elif not values or _NUMBER.fullmatch(word) or word.lower() in _FLAGS:
            values.append(word)
        elif _NAME.fullmatch(word):
            return _plain(word), values
        else:
            break
    return "", []


def _numbers_of_row(line: str) -> list[float]:
    """Return the numbers that a row of a table begins with.

    They are parted by blanks, or by commas with or without blanks. In a row that has blanks without
    a comma, a comma within a number is a decimal comma: this is no number.
    """
    has_blanks = re.search(r"[^\s,]\s+[-+.\d]", line) is not None
    words = line.split() if has_blanks else line.replace(",", " ").split()
    row = []
    for word in words:
        number = word.strip(",")
        if not _NUMBER.fullmatch(number):
            break
        row.append(_as_number(number))
    return row


def _as_number(text: str) -> float:
    """Return one of Fortran's numbers as a float, infinite where it is too large."""
    return float(text.lower().replace("d", "e"))


def table_columns(file: InputFile, header: int, names: Sequence[str]) -> list[int]:
    """Return at which places the columns of these names stand in the header line of a table."""
    words = [word.lower() for word in file.lines[header].split()]
    return [words.index(name.lower()) for name in names]
