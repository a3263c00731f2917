"""The language a report is written in: `texts` is the module of texts of that language. Knows no text itself."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

MODULES = {"en": "rotor_mbs.report.texts", "es": "rotor_mbs.report.texts_es"}
_spoken: ContextVar[str] = ContextVar("language", default="en")


def spoken() -> str:
    """The language in use: "en" unless told otherwise."""
    return _spoken.get()


@contextmanager
def speaking(language: str) -> Iterator[None]:
    """All texts in `language`, one of MODULES, until the end of the block."""
    before = _spoken.set(language if language in MODULES else "en")
    try:
        yield
    finally:
        _spoken.reset(before)


if TYPE_CHECKING:
    from rotor_mbs.report import texts as texts
else:

    class _Texts:
        """Looks every name up in the module of the language in use."""

        def __getattr__(self, name: str) -> object:
            return getattr(importlib.import_module(MODULES[spoken()]), name)

    texts = _Texts()
