"""TOML text: read from a file with limits, and the line on which each key stands. Must not know scenes.

Everything that prevents reading is one line of an InputError: `file:line: what is wrong; allowed: ...`.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rotor_mbs.errors import InputError

KeyPath = tuple[str | int, ...]

MAX_BYTES = 1 << 20

# A dotted key costs the TOML reader the square of its parts in time and memory: 1 MiB of "a.a.a." would need
# terabytes. Nothing in a scene has more than two parts; the lookbehind keeps this search itself linear.
_MAX_KEY_PARTS = 32
_LONG_KEY = re.compile(
    r"(?<![A-Za-z0-9_-])(?:(?:[A-Za-z0-9_-]++|\"[^\"\n]*+\"|'[^'\n]*+')[ \t]*+\.[ \t]*+)" + f"{{{_MAX_KEY_PARTS}}}"
)
_MARKS = frozenset("[]{}=,.\n")
_TOKEN = re.compile(
    r'("{3}(?:[^"\\]|\\.|"{1,2}(?!"))*"{3,5}|\'{3}(?:[^\']|\'{1,2}(?!\'))*\'{3,5}'  # strings of several lines
    r'|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\''
    r"|[\[\]{}=,.\n]|[^\s\[\]{}=,.#\"']+)|#[^\n]*",
    re.DOTALL,
)


class KeyProblem(NamedTuple):
    """One error: where it is in the tables as they were read, its message, and whether it is the key that is wrong."""

    path: KeyPath
    message: str
    is_of_key: bool


class TableError(ValueError):
    """Tables of a file that are not as they should be; `problems` are all that is wrong."""

    def __init__(self, problems: Sequence[KeyProblem]) -> None:
        self.problems = tuple(problems)
        super().__init__("; ".join(problem.message for problem in problems))

    @property
    def is_of_keys(self) -> bool:
        """Whether all of it is wrong whatever the values are."""
        return all(problem.is_of_key for problem in self.problems)


def shown_path(path: Path) -> str:
    """The path as it can stand in a one-line message."""
    text = str(path)
    return text if text.isprintable() else ascii(text)


def read_toml(path: Path) -> tuple[str, dict[str, Any]]:
    """The text of the file and its tables. Raises InputError with one line."""
    text = _read_text(path)
    return text, parse_toml(text, shown_path(path))


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """The tables in a text. Raises InputError with one line that begins with `source`."""
    too_long = _LONG_KEY.search(text)
    if too_long:
        line = text.count("\n", 0, too_long.start()) + 1
        raise InputError(f"{source}:{line}: key of over {_MAX_KEY_PARTS} parts; allowed: at most that")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{source}:{_syntax_error(str(error), text)}; allowed: TOML 1.0") from error
    except RecursionError as error:
        raise InputError(f"{source}:1: nested too deep; allowed: tables and arrays of a scene") from error
    except ValueError as error:
        # The reader does not convert this one to its own error: whole numbers of more digits than Python converts.
        raise InputError(f"{source}:1: a number is too long; allowed: |x| <= 1e300") from error


def toml_value(value: object) -> str:
    """The value in TOML: text, numbers bit for bit, lists, and mappings as inline tables.

    >>> toml_value({"start": 0.1, "names": ["a"], "log": True})
    '{"start" = 0.1, "names" = ["a"], "log" = true}'
    """
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{json.dumps(key)} = {toml_value(entry)}' for key, entry in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(toml_value(entry) for entry in value)}]"
    return repr(float(value)) if isinstance(value, float) else json.dumps(value, ensure_ascii=False)


def _read_text(path: Path) -> str:
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
    return text


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
    """Line number, counted from 1, of every key and array entry of a text that is valid TOML.

    ("blade", 1, "mass") is in the second [[blade]] table. In a text that is not TOML some lines are missing or wrong.
    """
    return _Scanner(text).scan()


def line_of(lines: Mapping[KeyPath, int], path: KeyPath) -> int:
    """The line of `path`, else of the nearest key that encloses it, else 1."""
    return next((lines[path[:n]] for n in range(len(path), 0, -1) if path[:n] in lines), 1)


class _Scanner:
    """One pass over the tokens of a TOML text: brackets and other marks, newlines, strings, bare pieces."""

    def __init__(self, text: str) -> None:
        self._tokens: list[tuple[str, int]] = []
        self._position = 0
        self._lines: dict[KeyPath, int] = {}
        self._table_counts: dict[KeyPath, int] = {}
        line = 1
        for match in _TOKEN.finditer(text):
            if match[1]:
                self._tokens.append((match[1], line))
            line += match[0].count("\n")
        self._end = ("", line)

    def scan(self) -> dict[KeyPath, int]:
        table: KeyPath = ()
        while self._next:
            if self._next == "\n":
                self._position += 1
            elif self._next == "[":
                table = self._header()
            else:
                self._entry(table)
        return self._lines

    @property
    def _token(self) -> tuple[str, int]:
        return self._tokens[self._position] if self._position < len(self._tokens) else self._end

    @property
    def _next(self) -> str:
        return self._token[0]

    def _header(self) -> KeyPath:
        """Reads [a.b] or [[a.b]]; a part that is an array of tables is followed by the number of its last table."""
        self._position += 1
        of_array = self._next == "["
        self._position += of_array
        path: KeyPath = ()
        parts = self._key_parts("]")
        for i, (name, line) in enumerate(parts):
            path = self._add((*path, name), line)
            if of_array and i == len(parts) - 1:
                self._table_counts[path] = self._table_counts.get(path, 0) + 1
            if path in self._table_counts:
                path = self._add((*path, self._table_counts[path] - 1), line)
        self._position += of_array
        return path

    def _entry(self, path: KeyPath) -> None:
        """Reads `a.b = value`."""
        for name, line in self._key_parts("="):
            path = self._add((*path, name), line)
        self._value(path)

    def _add(self, path: KeyPath, line: int) -> KeyPath:
        self._lines.setdefault(path, line)
        return path

    def _key_parts(self, end: str) -> list[tuple[str, int]]:
        """Names and lines of the parts of a dotted key, up to and over the mark that ends it."""
        parts = []
        while self._next not in (end, "\n", ""):
            name, line = self._token
            if name not in _MARKS:
                # Escapes in a quoted key are left as they are: its line is then the one of the table around it.
                parts.append((name[1:-1] if name[0] in "\"'" else name, line))
            self._position += 1
        self._position += 1
        return parts

    def _value(self, path: KeyPath) -> None:
        """Reads a scalar (which may be several tokens: 1.5, or a date and a time), an array or an inline table."""
        opening = self._next
        if opening not in ("[", "{"):
            while self._next not in (",", "]", "}", "\n", ""):
                self._position += 1
            return
        self._position += 1
        entry = 0
        while self._next not in ("]", "}", ""):
            if self._next in (",", "\n"):
                entry += self._next == ","
                self._position += 1
            elif opening == "{":
                self._entry(path)
            else:
                self._value(self._add((*path, entry), self._token[1]))
        self._position += 1
