"""What a process of a pool does with what it is asked for."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from typing import Any

Answer = tuple[Any, Exception | None]


@dataclass(frozen=True)
class Worker:
    """Made in its process, it does work: of (function, argument), the result or what was raised.

    prepare   "module:name", a function to call first; or ""
    """

    prepare: str

    def __call__(self) -> Callable[[tuple[Callable[[Any], Any], Any]], Answer]:
        if self.prepare:
            with suppress(Exception):  # the first task meets it again, and tells it
                call(self.prepare)
        return _answer


def call(target: str) -> None:
    """Calls the function "module:name"."""
    module, _, name = target.partition(":")
    getattr(import_module(module), name)()


def _answer(request: tuple[Callable[[Any], Any], Any]) -> Answer:
    work, task = request
    try:
        return work(task), None
    except Exception as exc:
        return None, _sendable(exc)


def _sendable(error: Exception) -> Exception:
    """The error itself, where it arrives as it is sent."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error
