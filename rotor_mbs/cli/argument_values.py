"""Values of arguments: each function reads one from its text, or says what is allowed. Knows no command."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from pathlib import Path

REPRODUCED = Path("rotor-mbs-out")  # where `reproduce` writes
_LONGEST_SPAN = 10_000
_LONGEST_NAME = 200  # bytes of a file's name; file systems allow 255, and temporary names are longer
_LARGEST = 1e9  # of a count; of seconds: thirty years


def default_results() -> Path:
    """The results file that is read where none is named: `run`'s in this folder, else `reproduce`'s."""
    here = Path("results.h5")
    return here if here.exists() else REPRODUCED / here


def pages_beside(results: Path) -> Path:
    """The folder for the pages of a file where none is named: `report` beside results.h5, x-report beside x.h5."""
    return results.parent / ("report" if results.name == "results.h5" else f"{results.stem}-report")


def path(text: str) -> Path:
    """A path that the system can look up, whether there is something or not."""
    try:
        Path(text).stat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as exc:
        raise argparse.ArgumentTypeError(f"{_short(text)}: {exc.strerror}; allowed: a path that can be read") from exc
    except ValueError as exc:
        raise argparse.ArgumentTypeError(f"{_short(text)}: {exc}; allowed: a path without it") from exc
    return Path(text)


def file(text: str) -> Path:
    """Where a file is to be written: neither nothing, nor a folder that is there; with room for a longer name."""
    found = path(text)
    if not found.name or found.name == ".." or found.is_dir():
        raise argparse.ArgumentTypeError(f"{text!r} given, allowed: a file's name, not a folder")
    if len(os.fsencode(found.name)) > _LONGEST_NAME:
        raise argparse.ArgumentTypeError(f"{_short(text)}: allowed: a file's name of at most {_LONGEST_NAME} bytes")
    return found


def folder(text: str) -> Path:
    """Where files are to be written: a folder that is there, or that can be made."""
    found = path(text)
    there = next((one for one in (found, *found.parents) if one.exists()), found)
    if not (there.is_dir() and os.access(there, os.W_OK)):
        raise argparse.ArgumentTypeError(f"{text!r} given, allowed: a folder that can be written")
    return found


def _short(text: str) -> str:
    return ascii(text if len(text) <= 80 else f"{text[:77]}...")


def span(text: str) -> tuple[float, ...]:
    """COUNT numbers from FROM to TO, both included, of "FROM:TO:COUNT"."""
    try:
        first, last, count = (kind(part) for kind, part in zip((float, float, int), text.split(":"), strict=True))
        if 0.0 <= first < last < float("inf") and 2 <= count <= _LONGEST_SPAN:
            return tuple(first + (last - first) * i / (count - 1) for i in range(int(count)))
    except ValueError:
        pass
    raise argparse.ArgumentTypeError(
        f"{text!r} given, allowed: FROM:TO:COUNT with 0 <= FROM < TO and COUNT from 2 to {_LONGEST_SPAN}"
    )


def part(text: str) -> tuple[int, int]:
    """(K, N) of "K/N"."""
    number, _, parts = text.partition("/")
    if not (number.isdecimal() and parts.isdecimal() and 1 <= int(number) <= int(parts)):
        raise argparse.ArgumentTypeError(f"{text!r} given, allowed: K/N with K from 1 to N")
    return int(number), int(parts)


def setting(text: str) -> tuple[str, object]:
    """(name, value) of "name=value": a number where it is one."""
    name, equals, value = (part.strip() for part in text.partition("="))
    if not (name and equals and value):
        raise argparse.ArgumentTypeError(f"{text!r} given, allowed: NAME=VALUE")
    for kind in (int, float):
        try:
            return name, kind(value)
        except ValueError:
            continue
    return name, value


def positive(kind: type[int] | type[float], allowed: str) -> Callable[[str], float]:
    def read(text: str) -> float:
        try:
            value = kind(text)
        except ValueError:
            value = kind(0)
        if not 0 < value <= _LARGEST:
            raise argparse.ArgumentTypeError(f"{text!r} given, allowed: {allowed}")
        return value

    return read


COUNT = positive(int, "a whole number from 1 to 1e9")
SECONDS = positive(float, "seconds, more than 0, at most 1e9")
POSITIVE = positive(float, "a number more than 0, at most 1e9")
