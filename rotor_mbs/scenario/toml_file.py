"""Read TOML files within limits, write TOML text, and find the line of each key."""

from __future__ import annotations

import errno
import json
import os
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import date, time
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

from rotor_mbs.errors import InputError, shown_value

KeyPath = tuple[str | int, ...]

MAX_BYTES = 1 << 20
# Largest number of error lines for one file. A file of 1 MiB can have 300,000 errors.
MAX_PROBLEMS = 100

# For a dotted key, the time and memory of the TOML reader grow with the square of the number of
# parts: 1 MiB of "a.a.a." would need terabytes. No key of a scene has more than two parts. The
# lookbehind in `_LONG_KEY` keeps the time of a search for long keys proportional to the text.
_MAX_KEY_PARTS = 32
_LONG_KEY = re.compile(
    r"(?<![A-Za-z0-9_-])"
    r"(?:(?:[A-Za-z0-9_-]++|\"[^\"\n]*+\"|'[^'\n]*+')[ \t]*+\.[ \t]*+)"
    f"{{{_MAX_KEY_PARTS}}}"
)
_EXAMPLES = "gravity, blade.mass, initial.angles[1] (entries counted from 0)"
KEY_FORM = f"the path of a number, such as {_EXAMPLES}"
_PART = r"[A-Za-z_][A-Za-z0-9_]{0,59}(?:\[[0-9]{1,6}\])*"
_KEY = re.compile(rf"{_PART}(?:\.{_PART})*")
_MARKS = frozenset("[]{}=,.\n")
_TOKEN = re.compile(
    # In this order: strings over several lines, strings on one line, marks, bare words; comments,
    # which are not in the captured group.
    r'("{3}(?:[^"\\]|\\.|"{1,2}(?!"))*"{3,5}|\'{3}(?:[^\']|\'{1,2}(?!\'))*\'{3,5}'
    r'|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\''
    r"|[\[\]{}=,.\n]|[^\s\[\]{}=,.#\"']+)|#[^\n]*",
    re.DOTALL,
)


# The command that reads a kind of file. The keys are the names of the kinds in messages.
_COMMANDS = {
    "a scene": "rotor-mbs run {}",
    "a sweep": "rotor-mbs sweep {}",
    "a mapping of columns": "rotor-mbs compare DATA --scene SCENE --columns {}",
    "a file of bounds": "rotor-mbs check FILE --bounds {}",
}
# Keys that a mapping of columns may have besides tables with the key `column`. If it has no such
# table, it has at least one of these keys.
_MAPPING_KEYS = frozenset(("time", "speed", "omit", "only", "program", "openfast", "group"))


class KeyProblem(NamedTuple):
    """What is wrong with a key or its value.

    Attributes
    ----------
    path : path of the key in the tables that were read.
    wrong : what is wrong.
    allowed : what is allowed; "" stands for what the declaration of the key allows.
    is_of_key : whether the key itself is wrong, so that no value is right for it.
    """

    path: KeyPath
    wrong: str
    allowed: str = ""
    is_of_key: bool = False

    @property
    def message(self) -> str:
        """Return the problem in one line."""
        message = f"{shown_key(self.path)}: {self.wrong}" if self.path else self.wrong
        return f"{message}; allowed: {self.allowed}" if self.allowed else message


class TableError(InputError):
    """Raised for errors in the tables of a file, or in a value, whose lines are not known yet.

    Attributes
    ----------
    faults : the errors, with paths that begin at the table or value that was read.
    """

    def __init__(self, faults: Iterable[KeyProblem]) -> None:
        self.faults = tuple(faults)
        super().__init__(fault.message for fault in self.faults)

    def under(self, *path: str | int, allowed: str = "") -> list[KeyProblem]:
        """Return the problems with `path` in front of their own paths.

        Parameters
        ----------
        *path : path of the value or table that was read.
        allowed : what the key of the value allows, for problems that do not say what is allowed.
        """
        faults = []
        for fault in self.faults:
            whole_path = (*path, *fault.path)
            faults.append(fault._replace(path=whole_path, allowed=fault.allowed or allowed))
        return faults


@dataclass(frozen=True)
class TomlFile:
    """The content of a TOML file.

    Attributes
    ----------
    source : name of the file in messages.
    text : the text of the file.
    tables : the tables that were parsed from the text.
    """

    source: str
    text: str
    tables: dict[str, Any]

    @property
    def kind(self) -> str:
        """Return the kind of the file by its keys, such as "a scene"; "" if they do not show it."""
        keys = self.tables.keys()
        if {"axis", "scene"} <= keys:
            return "a sweep"
        if {"blade", "initial"} <= keys:
            return "a scene"
        if "bound" in keys:
            return "a file of bounds"
        has_column = any(
            isinstance(value, dict) and "column" in value for value in self.tables.values()
        )
        is_other = bool(keys & {"title", "blade", "blades", "axis", "scene"})
        if not is_other and (has_column or keys & _MAPPING_KEYS):
            return "a mapping of columns"
        return ""

    def refuse_other_kind(self, wanted: str) -> None:
        """Raise InputError, in one line, if the keys of the file show that it is of another kind.

        Parameters
        ----------
        wanted : the kind of file that the caller reads, such as "a scene".
        """
        kind = self.kind
        if kind and kind != wanted:
            command = _COMMANDS[kind].format(self.source)
            raise InputError(f"{self.source}: is {kind}; allowed: {wanted}, or: {command}")

    @contextmanager
    def with_line_numbers(self, *path: str) -> Iterator[None]:
        """Add the file's name and line numbers to an InputError that is raised in the block.

        Parameters
        ----------
        *path : path of the key or table that is read in the block.

        Raises
        ------
        InputError
            With lines `source:line: key: what is wrong; allowed: ...`, sorted by line number.
        """
        try:
            yield
        except InputError as error:
            if isinstance(error, TableError):
                faults = error.under(*path)
            else:
                faults = [KeyProblem(path, problem) for problem in error.problems]
            lines = find_lines(self.text)
            messages = [(line_of(lines, fault.path), fault.message) for fault in faults]
            messages.sort(key=itemgetter(0))
            shown = []
            for line, message in messages[:MAX_PROBLEMS]:
                shown.append(f"{self.source}:{line}: {message}")
            if len(messages) > MAX_PROBLEMS:
                shown.append(f"{self.source}: {len(messages) - MAX_PROBLEMS} more errors")
            raise InputError(shown) from error


def file_path(path: str | os.PathLike[str]) -> Path:
    """Return a valid path of a file, which need not exist.

    Parameters
    ----------
    path : text or a path.

    Raises
    ------
    TypeError
        If `path` is neither text nor a path.
    InputError
        If no file can have this path, as it contains a NUL or half a surrogate pair, or is too long
        for the system.
    """
    path = Path(path)
    try:
        os.lstat(path)
    except ValueError as error:
        shown = shown_value(str(path))
        raise InputError(f"{shown}: not a path of a file; allowed: text without NUL") from error
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            shown = shown_value(str(path))
            what = f"{len(str(path))} characters"
            raise InputError(f"{shown}: {what}; allowed: a shorter path") from error
    return path


def shown_path(path: Path) -> str:
    """Return a path for a message; a path that cannot be printed is written as an ASCII literal."""
    text = str(path)
    return text if text.isprintable() else ascii(text)


def shown_key(path: KeyPath) -> str:
    """Return the path of a key as text, as `Scene.replace` and sweeps take it: blade[1].mass.

    A name that is long, or has characters other than letters, digits, - and _, is put in quotes.
    """
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        elif re.fullmatch(r"[A-Za-z0-9_-]{1,60}", part):
            text += f".{part}"
        else:
            text += "." + json.dumps(part if len(part) <= 60 else part[:57] + "...")
    return text[1:]


def parse_key(text: str) -> KeyPath:
    """Return the path of a key from its text, ("initial", "angles", 1) from "initial.angles[1]".

    Raises TableError if the text is not the path of a key.
    """
    if not _KEY.fullmatch(text):
        what = f"{text[:60]!a} is not the path of a key"
        raise TableError([KeyProblem((), what, KEY_FORM, is_of_key=True)])
    parts = re.findall(r"[A-Za-z_]\w*|[0-9]+", text)
    return tuple(int(part) if part.isdigit() else part for part in parts)


_TEXT_ALLOWED = "allowed: TOML text in UTF-8"
_TOML_ALLOWED = 'allowed: TOML 1.0, with arithmetic in quotes: "pi/6"'


def read_toml(path: Path) -> TomlFile:
    """Read a TOML file with a limit on its size.

    Parameters
    ----------
    path : path of the file.

    Raises
    ------
    InputError
        With one line, if the file cannot be read, is larger than MAX_BYTES or empty, or is not TOML
        text in UTF-8, or if `parse_toml` raises it.
    """
    shown = shown_path(path)
    try:
        if path.exists() and not path.is_file():  # a pipe or a device may block, or never end
            kind = "a folder" if path.is_dir() else "not a regular file"
            raise InputError(f"{shown}: is {kind}; allowed: a TOML file")
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = str(error)
        if isinstance(error, OSError) and error.strerror:
            reason = error.strerror
        what = f"cannot be read: {reason}"
        raise InputError(f"{shown}: {what}; allowed: a readable TOML file") from error
    if len(content) > MAX_BYTES:
        raise InputError(f"{shown}: is larger than {MAX_BYTES} bytes; allowed: at most that")
    if not content.strip():
        raise InputError(f"{shown}: is empty; allowed: a TOML file")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(f"{shown}:{line}: is not UTF-8; {_TEXT_ALLOWED}") from error
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise InputError(f"{shown}:{line}: contains a NUL byte; {_TEXT_ALLOWED}")
    return parse_toml(text, shown)


def parse_toml(text: str, source: str) -> TomlFile:
    """Parse a TOML text, and return it with its tables.

    Parameters
    ----------
    text : the content of a file.
    source : name of the file in messages.

    Raises
    ------
    InputError
        With one line, if the text is not TOML, or has a key of too many parts, tables nested too
        deep, or a number of too many digits.
    """
    too_long = _LONG_KEY.search(text)
    if too_long:
        line = text.count("\n", 0, too_long.start()) + 1
        what = f"key of over {_MAX_KEY_PARTS} parts"
        raise InputError(f"{source}:{line}: {what}; allowed: at most that")
    try:
        return TomlFile(source, text, tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        what = _syntax_error(str(error), text)
        raise InputError(f"{source}:{what}; {_TOML_ALLOWED}") from error
    except RecursionError as error:
        allowed = "allowed: tables and arrays of a scene"
        raise InputError(f"{source}:1: nested too deep; {allowed}") from error
    except ValueError as error:
        # The TOML reader raises a plain ValueError for a whole number of more digits than Python
        # converts.
        raise InputError(f"{source}:1: a number is too long; allowed: |x| <= 1e300") from error


def plain_value(value: Any) -> Any:
    """Convert a Python value to the types of a TOML file; arrays and other iterables become lists.

    Parameters
    ----------
    value : a single value, a mapping, or an iterable such as an array, tuple, range or generator.

    Raises
    ------
    TypeError
        For a value that a TOML file cannot contain, such as None or bytes.
    """
    if hasattr(value, "tolist"):  # a NumPy array or number
        value = value.tolist()
    if isinstance(value, str | bool | int | float | date | time):
        return value
    if isinstance(value, Mapping):
        plain = {}
        for key, entry in value.items():
            # A key that is not text becomes text, so that the error for an unknown key names it.
            name = str(key) if isinstance(key, str) else shown_value(key)
            plain[name] = plain_value(entry)
        return plain
    if isinstance(value, Iterable) and not isinstance(value, bytes | bytearray):
        return [plain_value(entry) for entry in value]
    raise TypeError(f"{shown_value(value)}: a file has no {type(value).__name__}")


def as_text(value: object) -> str:
    """Return a value for a message, on one line.

    Numbers, flags and texts are written as in a TOML file, shortened if they are long. For any
    other value the text is its type, such as "a list".
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value) if abs(value) < 10**30 else "a number of over 30 digits"
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, str):
        shortened = value if len(value) <= 40 else value[:37] + "..."
        return json.dumps(shortened, ensure_ascii=not value.isprintable())
    if isinstance(value, list | tuple):
        return "a list"
    return "a table" if isinstance(value, dict) else "a date or time"


def toml_value(value: object) -> str:
    """Return a value as TOML text, in which mappings are inline tables.

    A number that is read from the text is equal to the written number bit for bit.

    Parameters
    ----------
    value : a value as `plain_value` returns it.

    Raises
    ------
    InputError
        For a whole number with more digits than Python converts.
    """
    if isinstance(value, Mapping):
        entries = [f"{json.dumps(key)} = {toml_value(entry)}" for key, entry in value.items()]
        return f"{{{', '.join(entries)}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(toml_value(entry) for entry in value)}]"
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, date | time):
        return value.isoformat()
    try:
        return json.dumps(value, ensure_ascii=False)
    except ValueError as error:  # a whole number of more digits than Python converts
        raise InputError(f"{shown_value(value)}; allowed: |x| <= 1e300") from error


def toml_lines(table: Mapping[str, object]) -> str:
    """Return the entries of a table as TOML text with one line per entry."""
    return "".join(f"{key} = {toml_value(value)}\n" for key, value in table.items())


# Beginnings of the TOML reader's messages about a key or table that is repeated.
_SAYS_TWICE = ("Cannot overwrite", "Cannot declare", "Cannot mutate", "Cannot redefine")


def _repeated_key(text: str, line: int) -> str:
    """Return a message with the repeated key and its first line, or "" if none is found.

    Parameters
    ----------
    text : text that the TOML reader refuses.
    line : number of the line in which the second occurrence of the key ends.
    """
    located = list(_located("\n".join(text.split("\n")[:line])))
    path, own_line, _ = located[-1]
    for length in range(len(path), 0, -1):
        for known, first_line, _ in located:
            if known == path[:length] and first_line < own_line:
                return f"{shown_key(known)} is there twice, first in line {first_line}"
    return ""


def _syntax_error(message: str, text: str) -> str:
    """Return a message of the TOML reader in the form of this package's messages.

    Parameters
    ----------
    message : message of the reader, such as "Invalid value (at line 12, column 7)".
    text : text that the reader refuses.

    Returns
    -------
    str
        The text after the file's name, such as "12: not TOML: invalid value (column 7)".
    """
    match = re.fullmatch(r"(?s)(.*) \(at line (\d+), column (\d+)\)", message)
    if match:
        reason, line, place = match[1], int(match[2]), f"column {match[3]}"
    else:
        reason, place = message.removesuffix(" (at end of document)"), "end of file"
        line = text.rstrip().count("\n") + 1
    if reason.startswith(_SAYS_TWICE) and (twice := _repeated_key(text, line)):
        return f"{line}: not TOML: {twice}"
    reason = reason[:1].lower() + reason[1:120]
    return f"{line}: not TOML: {reason if reason.isprintable() else ascii(reason)} ({place})"


def find_lines(text: str) -> dict[KeyPath, int]:
    """Return the line numbers of the keys and array entries in a TOML text.

    Parameters
    ----------
    text : valid TOML. For other text, line numbers may be missing or wrong.

    Returns
    -------
    dict
        Line numbers, counted from 1, by path. The path ("blade", 1, "mass") is that of the mass in
        the second [[blade]] table. The dict does not contain the keys in inline tables.
    """
    lines: dict[KeyPath, int] = {}
    for path, line, value in _located(text):
        lines.setdefault(path, line)
        _number_entries(path, value, lines)
    return lines


def _located(text: str) -> Iterator[tuple[KeyPath, int, Sequence[tuple[str, int]]]]:
    """Yield the path, the line number and the value's tokens of each key and each table header.

    Before that, the path of each part of the key or header is yielded without tokens: for `a.b = 1`
    the path of a, then that of a.b, and then that of a.b with the tokens of the value.

    Parameters
    ----------
    text : the content of a TOML file; see `find_lines`.
    """
    table_counts: dict[KeyPath, int] = {}  # tables so far in each array of tables
    table: KeyPath = ()
    for statement in _statements(text):
        is_header = statement[0][0] == "["
        tokens = [token for token, _ in statement]
        of_array = tokens[:2] == ["[", "["]
        end = tokens.index("=") if "=" in tokens else len(tokens)
        path = () if is_header else table
        line = statement[0][1]
        # Escapes in a quoted key are not decoded. `line_of` therefore does not find the key, and
        # returns the line of the enclosing table.
        names = [(token, line) for token, line in statement[:end] if token not in _MARKS]
        for i, (name, line) in enumerate(names):
            path = (*path, name[1:-1] if name[0] in "\"'" else name)
            yield path, line, ()
            if of_array and i == len(names) - 1:
                table_counts[path] = table_counts.get(path, 0) + 1
            if is_header and path in table_counts:
                path = (*path, table_counts[path] - 1)
                yield path, line, ()
        if is_header:
            table = path
        yield path, line, statement[end + 1 :]


def _statements(text: str) -> Iterator[list[tuple[str, int]]]:
    """Yield the tokens of each table header and each `key = value`, with their line numbers.

    The tokens do not include newlines. A newline inside brackets does not end a statement.

    Parameters
    ----------
    text : the content of a TOML file.
    """
    statement: list[tuple[str, int]] = []
    line, depth = 1, 0
    for match in _TOKEN.finditer(text):
        token = match[1]
        if token and token != "\n":
            statement.append((token, line))
            if token in "[{":
                depth += 1
            elif token in "]}":
                depth -= 1
        elif token and depth <= 0 and statement:
            yield statement
            statement, depth = [], 0
        line += match[0].count("\n")
    if statement:
        yield statement


def _number_entries(
    path: KeyPath,
    value: Sequence[tuple[str, int]],
    lines: dict[KeyPath, int],
) -> None:
    """Add the line number of every entry of an array to `lines`.

    Parameters
    ----------
    path : path of the array.
    value : tokens of the array with their line numbers.
    lines : line numbers by path.
    """
    numbers: list[int] = []  # index of the current entry in each enclosing array
    for token, line in value:
        if token in "]}":
            if numbers:
                numbers.pop()
        elif token == ",":
            if numbers:
                numbers[-1] += 1
        else:
            lines.setdefault((*path, *numbers), line)
            if token in "[{":
                numbers.append(0)


def line_of(lines: Mapping[KeyPath, int], path: KeyPath) -> int:
    """Return the line of a path, else the line of the innermost enclosing table, else 1."""
    for length in range(len(path), 0, -1):
        if path[:length] in lines:
            return lines[path[:length]]
    return 1
