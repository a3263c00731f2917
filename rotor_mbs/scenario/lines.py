"""On which line of a TOML text a key stands: for messages only. Knows no scene.

The text has been read by a TOML parser before, so its grammar is taken for granted here; on anything unexpected
the scanner stops early, and a message then names the line of the nearest enclosing key that was found.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

KeyPath = tuple[str | int, ...]

_TOKEN = re.compile(
    r'(?P<string>"{3}(?:[^"\\]|\\.|"{1,2}(?!"))*"{3,5}|\'{3}(?:[^\']|\'{1,2}(?!\'))*\'{3,5}'
    r'|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\')'
    r"|(?P<newline>\n)|(?P<mark>[\[\]{}=,.])|(?P<word>[^\s\[\]{}=,.#\"']+)|#[^\n]*",
    re.DOTALL,
)


class _Token(NamedTuple):
    kind: str
    text: str
    line: int


def find_lines(text: str) -> dict[KeyPath, int]:
    """Line number, counted from 1, of every key and array entry: ("blade", 1, "mass") is in the second [[blade]]."""
    return _Scanner(_tokens(text)).scan()


def line_of(lines: Mapping[KeyPath, int], path: KeyPath) -> int:
    """The line of `path`, else of the nearest key that encloses it, else 1."""
    for length in range(len(path), 0, -1):
        if path[:length] in lines:
            return lines[path[:length]]
    return 1


def _tokens(text: str) -> list[_Token]:
    tokens = []
    line, counted = 1, 0
    for match in _TOKEN.finditer(text):
        line += text.count("\n", counted, match.start())
        counted = match.start()
        if match.lastgroup is not None:
            tokens.append(_Token(match.lastgroup, match[0], line))
    return tokens


class _Scanner:
    """One pass over the tokens; containers are kept on a stack of its own, so no nesting is too deep."""

    def __init__(self, tokens: list[_Token]) -> None:
        self._tokens = tokens
        self._position = 0
        self._lines: dict[KeyPath, int] = {}
        self._table_counts: dict[KeyPath, int] = {}

    def scan(self) -> dict[KeyPath, int]:
        table: KeyPath = ()
        while (token := self._peek()) is not None:
            if token.kind == "newline":
                self._position += 1
            elif token.text == "[":
                table = self._header()
            elif token.kind in ("word", "string"):
                self._value(self._key(table))
            else:
                break
        return self._lines

    def _peek(self) -> _Token | None:
        return self._tokens[self._position] if self._position < len(self._tokens) else None

    def _at(self, text: str) -> bool:
        token = self._peek()
        return token is not None and token.kind == "mark" and token.text == text

    def _header(self) -> KeyPath:
        """Reads [a.b] or [[a.b]]; a part that is an array of tables is followed by the number of its last table."""
        self._position += 1
        of_array = self._at("[")
        self._position += of_array
        path: KeyPath = ()
        parts = self._parts()
        for i, (name, line) in enumerate(parts):
            path = (*path, name)
            self._lines.setdefault(path, line)
            if of_array and i == len(parts) - 1:
                self._table_counts[path] = self._table_counts.get(path, 0) + 1
            if path in self._table_counts:
                path = (*path, self._table_counts[path] - 1)
                self._lines.setdefault(path, line)
        self._position += 1 + of_array
        return path

    def _key(self, table: KeyPath) -> KeyPath:
        """Reads `a.b =`; returns the whole path."""
        path = table
        for name, line in self._parts():
            path = (*path, name)
            self._lines.setdefault(path, line)
        self._position += 1
        return path

    def _parts(self) -> list[tuple[str, int]]:
        parts = []
        while (token := self._peek()) is not None and token.text not in ("=", "]") and token.kind != "newline":
            if token.kind != "mark":
                parts.append((_name(token), token.line))
            self._position += 1
        return parts

    def _value(self, path: KeyPath) -> None:
        """Reads one value to the end of its line, or to the end of its outermost bracket."""
        open_containers: list[tuple[str, KeyPath, int]] = []
        self._opens(path, open_containers)
        while open_containers and (token := self._peek()) is not None:
            kind, path, entry = open_containers[-1]
            if token.kind == "mark" and token.text in "]}":
                open_containers.pop()
                self._position += 1
            elif token.kind == "mark" and token.text == ",":
                open_containers[-1] = (kind, path, entry + 1)
                self._position += 1
            elif token.kind == "newline":
                self._position += 1
            elif kind == "{":
                self._opens(self._key(path), open_containers)
            else:
                self._lines.setdefault((*path, entry), token.line)
                self._opens((*path, entry), open_containers)

    def _opens(self, path: KeyPath, open_containers: list[tuple[str, KeyPath, int]]) -> None:
        """Steps into a bracket, or over a scalar (which may be several tokens: 1.5, or a date and a time)."""
        token = self._peek()
        if token is not None and token.kind == "mark" and token.text in "[{":
            open_containers.append((token.text, path, 0))
            self._position += 1
            return
        while (token := self._peek()) is not None and token.kind != "newline":
            if token.kind == "mark" and token.text in ",]}":
                return
            self._position += 1


def _name(token: _Token) -> str:
    # Escapes in a quoted key are left as they are: its line is then the one of the table around it.
    return token.text[1:-1] if token.kind == "string" else token.text
