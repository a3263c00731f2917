"""Read OpenFAST's input files by the names of their lines.

A line is `value  Name  - comment`. OpenFAST itself reads files by line number. But line numbers
differ between its versions, and the names hardly differ from FAST v8 to OpenFAST 5.
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

MAX_BYTES = 32 << 20  # largest size of a file
MAX_ROWS = 100_000  # largest number of rows of a table; tables in use have 10 to 200
# Number of lines at the start of a file that have no names: header and description, both free text.
_TITLE_LINES = 2
_NAME = re.compile(r"[A-Za-z_]\w*(?:\(\d+\))?")
_VALUE = re.compile(r"\"([^\"]*)\"|'([^']*)'|([^\s,;]+)")
# A number as Fortran reads it: 1.5, .5, 5., 1E3, 1.0D5.
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?")
_FLAGS = {
    "t": True, "true": True, ".true.": True, ".t.": True,
    "f": False, "false": False, ".false.": False, ".f.": False,
}  # fmt: skip


class InputFile:
    """An input file of OpenFAST.

    Attributes
    ----------
    path : path of the file.
    lines : lines of the file, without line ends.

    Raises
    ------
    InputError
        If the file cannot be read.
    """

    def __init__(self, path: Path, named_by: str = "", what: str = "an input file") -> None:
        """Read a file.

        Parameters
        ----------
        path : path of the file.
        named_by : file, line and name that refer to this file, for messages, such as
            "a.fst:31: EDFile"; "" for none.
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
            text = content.decode("latin-1")  # never fails
        # Lines end at these characters only. `splitlines` would also end them at other characters,
        # which comments may contain.
        self.lines = re.split(r"\r\n|\n|\r", text)

    @cached_property
    def _entries(self) -> dict[str, tuple[int, list[str]]]:
        """Return the line number and the values of each line by its plain name (`_plain`).

        If several lines have a name, the first of them counts.
        """
        entries: dict[str, tuple[int, list[str]]] = {}
        for number, line in enumerate(self.lines[_TITLE_LINES:], _TITLE_LINES + 1):
            name, values = _split_line(line)
            if name == "outlist":  # the lines that follow are names of channels
                break
            if name:
                entries.setdefault(name, (number, values))
        return entries

    @property
    def description(self) -> str:
        """Return the description: the second line of the file, which is free text."""
        return self.lines[1].strip() if len(self.lines) > 1 else ""

    def __contains__(self, name: str) -> bool:
        """Return whether the file has a line of this name."""
        return _plain(name) in self._entries

    def where(self, name: str) -> str:
        """Return file, line and name for a message: "a.fst:31: EDFile"."""
        shown, entry = shown_path(self.path), self._entries.get(_plain(name))
        return f"{shown}:{entry[0]}: {name}" if entry else f"{shown}: {name}"

    def problem(self, name: str, what: str, allowed: str) -> InputError:
        """Return an error that names a line, what is wrong with it, and what is allowed."""
        return InputError(f"{self.where(name)}: {what}; allowed: {allowed}")

    def number(self, name: str, kind: Kind = keys.NUMBER, default: float | None = None) -> float:
        """Return the number in the line of this name.

        Parameters
        ----------
        name : name of the line.
        kind : kind of the number, which defines the allowed values.
        default : result if there is no such line.

        Raises
        ------
        InputError
            If there is no such line and no default, if its value is not one number, or if the
            number is not allowed.
        """
        if default is not None and name not in self:
            return default
        text = self._first_value(name)
        allowed = kind.allowed.replace("{unit}", "")
        if not _NUMBER.fullmatch(text):
            raise self.problem(name, f"{text[:40]!a} is not a number", allowed)
        values = self._entries[_plain(name)][1]
        # "1,5" with a decimal comma is read as the two values 1 and 5.
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
        """Return the whole number in the line of this name.

        Parameters
        ----------
        name : name of the line.
        lowest, highest : smallest and largest number allowed.
        default : result if there is no such line.

        Raises
        ------
        InputError
            In the same cases as `number`.
        """
        if default is not None and name not in self:
            return default
        number = self.number(name)
        if number != int(number) or not lowest <= number <= highest:
            allowed = f"a whole number from {lowest} to {highest}"
            raise self.problem(name, f"{number:g} is not allowed", allowed)
        return int(number)

    def flag(self, name: str, *, default: bool = False) -> bool:
        """Return the first flag in the line of this name; `default` if there is no such line.

        Raises InputError if the first value of the line is not a flag.
        """
        if name not in self:
            return default
        text = self._first_value(name)
        if text.lower() not in _FLAGS:
            raise self.problem(name, f"{text[:40]!a} is not a flag", "True or False")
        return _FLAGS[text.lower()]

    def file(self, name: str, what: str) -> InputFile:
        """Return the file whose path, relative to this file, is in the line of this name.

        Parameters
        ----------
        name : name of the line.
        what : kind of the file, for messages.

        Raises
        ------
        InputError
            If there is no such line, or the file cannot be read.
        """
        # Paths that were written on Windows have backslashes.
        relative = self._first_value(name).replace("\\", "/")
        return InputFile(self.path.parent / relative, self.where(name), what)

    def _first_value(self, name: str) -> str:
        """Return the text of the first value in the line of this name.

        Raises InputError if there is no such line.
        """
        entry = self._entries.get(_plain(name))
        if entry is None:
            allowed = "a file of FAST v8 or OpenFAST, with `value  Name  - comment` in a line"
            raise InputError(f"{shown_path(self.path)}: no line named {name}; allowed: {allowed}")
        return entry[1][0]

    def line_with(self, *words: str) -> int:
        """Return the index of the first line that has all these words; -1 if no line has."""
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
        first : index of the line with the first row.
        count : number of rows.
        what : name of a row in messages, such as "station".
        width : smallest number of numbers in a row.

        Raises
        ------
        InputError
            If a row has too few numbers, or a number that is too large.
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
    """Return the plain form of a name: lower case, without parentheses.

    OpenFAST's files have both `BldFile(1)` and `BldFile1`.
    """
    return re.sub(r"[()]", "", name).lower()


def _split_line(line: str) -> tuple[str, list[str]]:
    """Return the plain name and the values of a line; "" and [] if it has no name.

    The first word of a line is a value. Numbers, flags and texts in quotes that follow it are
    values, too, because a line may have a list: `30, 60  LinTimes  - comment`. The next word is the
    name.

    Parameters
    ----------
    line : line of an input file of OpenFAST.
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
    """Return the numbers with which a row of a table begins.

    They are separated by blanks, or by commas with or without blanks. If two of them are separated
    by blanks alone, a comma within a word is a decimal comma, and the word is no number.
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
    """Return the float of a number as Fortran reads it; infinite if the number is too large."""
    return float(text.lower().replace("d", "e"))


def table_columns(file: InputFile, header: int, names: Sequence[str]) -> list[int]:
    """Return the indices of the columns with these names in a table.

    Parameters
    ----------
    file : file with the table.
    header : index of the line with the names of the columns.
    names : names of the columns.
    """
    words = [word.lower() for word in file.lines[header].split()]
    return [words.index(name.lower()) for name in names]
