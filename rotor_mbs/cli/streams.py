"""Standard output and standard error of a command: no control characters from files, no failure of what is printed.

A title or a message that comes from a file may have escape sequences; a closed standard error must not end a batch.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from typing import Any, TextIO

# C0 but for tab and line feed, DEL, C1, and the marks that change the direction of writing.
_CONTROLS = (*range(0x20), *range(0x7F, 0xA0), *range(0x200E, 0x2010), *range(0x202A, 0x202F), *range(0x2066, 0x206A))
_SHOWN = {code: ascii(chr(code))[1:-1] for code in _CONTROLS if chr(code) not in "\t\n"}


def printable(text: str) -> str:
    r"""The text with every control character but tab and line feed as its escape.

    >>> printable("\x1b[2J")
    '\\x1b[2J'
    """
    return text.translate(_SHOWN)


class PlainStream:
    """A text stream that writes control characters as their escapes; `unfiltered` is the stream itself."""

    def __init__(self, stream: TextIO) -> None:
        self.unfiltered = stream

    def write(self, text: str) -> int:
        self.unfiltered.write(printable(text))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.unfiltered, name)


@contextlib.contextmanager
def plain_streams() -> Iterator[None]:
    """In the block, standard output and standard error are plain; one that is closed is a device that takes all."""
    before = sys.stdout, sys.stderr
    with contextlib.ExitStack() as stack:
        streams: list[TextIO] = [one or stack.enter_context(open(os.devnull, "w")) for one in before]  # noqa: PTH123  (a device)
        sys.stdout, sys.stderr = (PlainStream(stream) for stream in streams)
        try:
            yield
        finally:
            sys.stdout, sys.stderr = before


def show(text: str, stream: TextIO) -> None:
    """Prints a line of which nothing depends: where nobody reads it any more, or the disk is full, it is dropped."""
    with contextlib.suppress(OSError, ValueError):
        print(text, file=stream, flush=True)


def drop_what_is_left() -> None:
    """After a failed write: what is still in the buffer must not fail again when the interpreter ends."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.__stdout__.fileno())  # type: ignore[union-attr]
