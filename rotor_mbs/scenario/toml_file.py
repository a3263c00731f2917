"""TOML text: read from a file with limits, written, and the line on which each key stands."""

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
MAX_PROBLEMS = 100  # lines for one file; nobody reads more, and a file of 1 MiB can have 300,000

# A dotted key costs the TOML reader the square of its parts in time and memory: 1 MiB of "a.a.a." would need
# terabytes. Nothing in a scene has more than two parts; the lookbehind keeps this search itself linear.
_MAX_KEY_PARTS = 32
_LONG_KEY = re.compile(
    r"(?<![A-Za-z0-9_-])(?:(?:[A-Za-z0-9_-]++|\"[^\"\n]*+\"|'[^'\n]*+')[ \t]*+\.[ \t]*+)" + f"{{{_MAX_KEY_PARTS}}}"
)
KEY_FORM = "the path of a number, such as gravity, blade.mass, initial.angles[1] (entries counted from 0)"
_PART = r"[A-Za-z_][A-Za-z0-9_]{0,59}(?:\[[0-9]{1,6}\])*"
_KEY = re.compile(rf"{_PART}(?:\.{_PART})*")
_MARKS = frozenset("[]{}=,.\n")
_TOKEN = re.compile(
    r'("{3}(?:[^"\\]|\\.|"{1,2}(?!"))*"{3,5}|\'{3}(?:[^\']|\'{1,2}(?!\'))*\'{3,5}'  # strings of several lines
    r'|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\''
    r"|[\[\]{}=,.\n]|[^\s\[\]{}=,.#\"']+)|#[^\n]*",
    re.DOTALL,
)


class KeyProblem(NamedTuple):
    path: KeyPath  # where it is, in the tables as they were read
    wrong: str  # what is wrong
    allowed: str = ""  # what is allowed; "" for what the key allows
    is_of_key: bool = False  # whether it is the key that is wrong, whatever the value is

    @property
    def message(self) -> str:
        where = f"{shown_key(self.path)}: " if self.path else ""
        return f"{where}{self.wrong}; allowed: {self.allowed}" if self.allowed else f"{where}{self.wrong}"


class TableError(InputError):
    """Tables of a file, or a value in them, that are not as they should be; where they stand is not known yet."""

    def __init__(self, faults: Iterable[KeyProblem]) -> None:
        self.faults = tuple(faults)
        super().__init__(fault.message for fault in self.faults)

    def under(self, *path: str | int, allowed: str = "") -> list[KeyProblem]:
        """The faults of a value that stands at `path`, where `allowed` is what its key allows."""
        return [fault._replace(path=(*path, *fault.path), allowed=fault.allowed or allowed) for fault in self.faults]


@dataclass(frozen=True)
class TomlFile:
    source: str  # what messages call it
    text: str
    tables: dict[str, Any]

    @contextmanager
    def with_line_numbers(self, *path: str) -> Iterator[None]:
        """What is wrong with the key at `path`, an InputError of the block, gets lines `source:line: key: what is
        wrong; allowed: ...`, in the order of the file."""
        try:
            yield
        except InputError as error:
            faults = [KeyProblem(path, problem) for problem in error.problems]
            if isinstance(error, TableError):
                faults = error.under(*path)
            lines = find_lines(self.text)
            messages = sorted(((line_of(lines, fault.path), fault.message) for fault in faults), key=itemgetter(0))
            shown = [f"{self.source}:{line}: {message}" for line, message in messages[:MAX_PROBLEMS]]
            if len(messages) > MAX_PROBLEMS:
                shown.append(f"{self.source}: {len(messages) - MAX_PROBLEMS} more errors")
            raise InputError(shown) from error


def file_path(path: str | os.PathLike[str]) -> Path:
    """Return a path that a file may have, whether there is one or not.

    Raises
    ------
    TypeError
        If it is neither text nor a path.
    InputError
        If no file can have it: a NUL, half a surrogate pair, a name longer than the system takes.
    """
    path = Path(path)
    try:
        os.lstat(path)
    except ValueError as error:
        raise InputError(f"{shown_value(str(path))}: not a path of a file; allowed: text without NUL") from error
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            shown = shown_value(str(path))
            raise InputError(f"{shown}: {len(str(path))} characters; allowed: a shorter path") from error
    return path


def shown_path(path: Path) -> str:
    text = str(path)
    return text if text.isprintable() else ascii(text)


def shown_key(path: KeyPath) -> str:
    """The path as `Scene.replace` and sweeps take it, entries counted from 0: blade[1].mass; odd names in quotes."""
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
    """("initial", "angles", 1) of "initial.angles[1]". Raises TableError."""
    if not _KEY.fullmatch(text):
        raise TableError([KeyProblem((), f"{text[:60]!a} is not the path of a key", KEY_FORM, is_of_key=True)])
    return tuple(int(part) if part.isdigit() else part for part in re.findall(r"[A-Za-z_]\w*|[0-9]+", text))


_TOML_ALLOWED = 'allowed: TOML 1.0, with arithmetic in quotes: "pi/6"'


def read_toml(path: Path) -> TomlFile:
    """Raises InputError with one line."""
    shown = shown_path(path)
    try:
        if path.exists() and not path.is_file():  # a pipe or a device would block, or never end
            kind = "a folder" if path.is_dir() else "not a regular file"
            raise InputError(f"{shown}: is {kind}; allowed: a TOML file")
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise InputError(f"{shown}: cannot be read: {reason}; allowed: a readable TOML file") from error
    if len(content) > MAX_BYTES:
        raise InputError(f"{shown}: is larger than {MAX_BYTES} bytes; allowed: at most that")
    if not content.strip():
        raise InputError(f"{shown}: is empty; allowed: a TOML file")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(f"{shown}:{line}: is not UTF-8; allowed: TOML text in UTF-8") from error
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise InputError(f"{shown}:{line}: contains a NUL byte; allowed: TOML text in UTF-8")
    return parse_toml(text, shown)


def parse_toml(text: str, source: str) -> TomlFile:
    """A text as a file that messages call `source`. Raises InputError with one line."""
    too_long = _LONG_KEY.search(text)
    if too_long:
        line = text.count("\n", 0, too_long.start()) + 1
        raise InputError(f"{source}:{line}: key of over {_MAX_KEY_PARTS} parts; allowed: at most that")
    try:
        return TomlFile(source, text, tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{source}:{_syntax_error(str(error), text)}; {_TOML_ALLOWED}") from error
    except RecursionError as error:
        raise InputError(f"{source}:1: nested too deep; allowed: tables and arrays of a scene") from error
    except ValueError as error:
        # The reader does not convert this one to its own error: whole numbers of more digits than Python converts.
        raise InputError(f"{source}:1: a number is too long; allowed: |x| <= 1e300") from error


def plain_value(value: Any) -> Any:
    """Return a value of Python as a TOML file has it: arrays, tuples, ranges, generators as lists.

    Raises TypeError for what no file can have, such as None or bytes.
    """
    if hasattr(value, "tolist"):  # of NumPy
        value = value.tolist()
    if isinstance(value, str | bool | int | float | date | time):
        return value
    if isinstance(value, Mapping):
        plain = {}
        for key, entry in value.items():
            plain[str(key) if isinstance(key, str) else shown_value(key)] = plain_value(entry)
        return plain
    if isinstance(value, Iterable) and not isinstance(value, bytes | bytearray):
        return [plain_value(entry) for entry in value]
    raise TypeError(f"{shown_value(value)}: a file has no {type(value).__name__}")


def as_text(value: object) -> str:
    """Return a value for a message as its file has it, short and on one line."""
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
    """The value in TOML: text, numbers bit for bit, lists, and mappings as inline tables. Raises InputError."""
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{json.dumps(key)} = {toml_value(entry)}' for key, entry in value.items())}}}"
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
    return "".join(f"{key} = {toml_value(value)}\n" for key, value in table.items())


def _syntax_error(message: str, text: str) -> str:
    """'12: not TOML: invalid value (column 7)' from the reader's 'Invalid value (at line 12, column 7)'."""
    match = re.fullmatch(r"(?s)(.*) \(at line (\d+), column (\d+)\)", message)
    if match:
        reason, line, place = match[1], int(match[2]), f"column {match[3]}"
    else:
        reason, place = message.removesuffix(" (at end of document)"), "end of file"
        line = text.rstrip().count("\n") + 1
    reason = reason[:1].lower() + reason[1:120]
    return f"{line}: not TOML: {reason if reason.isprintable() else ascii(reason)} ({place})"


def find_lines(text: str) -> dict[KeyPath, int]:
    """Line number, from 1, of every key and array entry of a text that is valid TOML, but for the keys of inline
    tables; ("blade", 1, "mass") is in the second [[blade]] table. Without valid TOML some are missing or wrong."""
    lines: dict[KeyPath, int] = {}
    table_counts: dict[KeyPath, int] = {}  # of every array of tables
    table: KeyPath = ()
    for statement in _statements(text):
        is_header = statement[0][0] == "["
        of_array = [token for token, _ in statement[:2]] == ["[", "["]
        end = next((i for i, (token, _) in enumerate(statement) if token == "="), len(statement))
        path = () if is_header else table
        # Escapes in a quoted key are left as they are: its line is then the one of the table around it.
        names = [(token, line) for token, line in statement[:end] if token not in _MARKS]
        for i, (name, line) in enumerate(names):
            path = (*path, name[1:-1] if name[0] in "\"'" else name)
            lines.setdefault(path, line)
            if of_array and i == len(names) - 1:
                table_counts[path] = table_counts.get(path, 0) + 1
            if is_header and path in table_counts:
                path = (*path, table_counts[path] - 1)
                lines.setdefault(path, line)
        if is_header:
            table = path
        _number_entries(path, statement[end + 1 :], lines)
    return lines


def _statements(text: str) -> Iterator[list[tuple[str, int]]]:
    """The tokens of each table header or `key = value` with their lines; newlines inside brackets are left out."""
    statement: list[tuple[str, int]] = []
    line, depth = 1, 0
    for match in _TOKEN.finditer(text):
        token = match[1]
        if token and token != "\n":
            statement.append((token, line))
            depth += (token in "[{") - (token in "]}")
        elif token and depth <= 0 and statement:
            yield statement
            statement, depth = [], 0
        line += match[0].count("\n")
    if statement:
        yield statement


def _number_entries(path: KeyPath, value: Sequence[tuple[str, int]], lines: dict[KeyPath, int]) -> None:
    numbers: list[int] = []
    for token, line in value:
        if token in "]}":
            del numbers[-1:]
        elif token == ",":
            if numbers:
                numbers[-1] += 1
        else:
            lines.setdefault((*path, *numbers), line)
            if token in "[{":
                numbers.append(0)


def line_of(lines: Mapping[KeyPath, int], path: KeyPath) -> int:
    """The line of `path`, else of the nearest key that encloses it, else 1."""
    return next((lines[path[:n]] for n in range(len(path), 0, -1) if path[:n] in lines), 1)
