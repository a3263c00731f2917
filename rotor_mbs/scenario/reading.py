"""From a path to the TOML tables in it, or one line that says why not. Knows no scene."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from rotor_mbs.errors import InputError

MAX_BYTES = 1 << 20

# A dotted key costs the TOML reader the square of its parts in time and memory: 1 MiB of "a.a.a." would need
# terabytes. Nothing in a scene has more than two parts; the lookbehind keeps this search itself linear.
_MAX_KEY_PARTS = 32
_LONG_KEY = re.compile(
    r"(?<![A-Za-z0-9_-])(?:(?:[A-Za-z0-9_-]++|\"[^\"\n]*+\"|'[^'\n]*+')[ \t]*+\.[ \t]*+)" + f"{{{_MAX_KEY_PARTS}}}"
)


def shown_path(path: Path) -> str:
    """The path as it can stand in a one-line message."""
    text = str(path)
    return text if text.isprintable() else ascii(text)


def read_toml(path: Path) -> tuple[str, dict[str, Any]]:
    """The text of the file and its tables; raises InputError with one line for whatever is in the way."""
    text = _read_text(path)
    return text, parse_toml(text, shown_path(path))


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """The tables in a text; raises InputError with one line that begins with `source`."""
    too_long = _LONG_KEY.search(text)
    if too_long:
        line = text.count("\n", 0, too_long.start()) + 1
        raise InputError(f"{source}:{line}: key of over {_MAX_KEY_PARTS} parts; allowed: keys of a scene")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{source}:{_syntax_fault(str(error), text)}; allowed: TOML 1.0") from error
    except RecursionError as error:
        raise InputError(f"{source}:1: nested too deep; allowed: tables and arrays of a scene") from error
    except ValueError as error:
        # What the reader lets through untyped: whole numbers of more digits than Python converts.
        raise InputError(f"{source}:1: a number is too long; allowed: |x| <= 1e300") from error


def _read_text(path: Path) -> str:
    try:
        if path.is_dir():
            raise InputError(f"{shown_path(path)}: is a folder; allowed: a TOML file")
        if path.exists() and not path.is_file():
            # A pipe or a device would block, or never end.
            raise InputError(f"{shown_path(path)}: is no regular file; allowed: a TOML file")
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise InputError(f"{shown_path(path)}: cannot be read: {reason}; allowed: a readable TOML file") from error
    if len(content) > MAX_BYTES:
        raise InputError(f"{shown_path(path)}: is larger than {MAX_BYTES} bytes; allowed: at most that")
    if not content.strip():
        raise InputError(f"{shown_path(path)}: is empty; allowed: a scene in TOML")
    return _decode(path, content)


def _decode(path: Path, content: bytes) -> str:
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(f"{shown_path(path)}:{line}: is not UTF-8; allowed: TOML text in UTF-8") from error
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise InputError(f"{shown_path(path)}:{line}: holds a NUL byte; allowed: TOML text in UTF-8")
    return text


def _syntax_fault(message: str, text: str) -> str:
    """'12: not TOML: invalid value (column 7)' from the reader's 'Invalid value (at line 12, column 7)'."""
    match = re.fullmatch(r"(?s)(.*) \(at line (\d+), column (\d+)\)", message)
    if match:
        reason, line, place = match[1], int(match[2]), f"column {match[3]}"
    else:
        reason, place = message.removesuffix(" (at end of document)"), "end of file"
        line = text.rstrip().count("\n") + 1
    reason = reason[:1].lower() + reason[1:120]
    if not reason.isprintable():
        reason = ascii(reason)
    return f"{line}: not TOML: {reason} ({place})"
