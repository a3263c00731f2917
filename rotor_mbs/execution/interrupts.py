"""Ctrl-C and SIGTERM, put off: amid what the HDF5 library calls back to us they end in its crash, and amid the end of
other processes they leave some of them alive."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def interrupts_put_off() -> Iterator[None]:
    """Those that come in the block are acted on at its end. Where signals do not arrive, in other threads, it does
    nothing."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    numbers = (signal.SIGINT, signal.SIGTERM)
    before: dict[signal.Signals, Any] = {}
    try:
        for one in numbers:
            before[one] = signal.signal(one, lambda number, _: came.append(number))
        yield
    finally:
        for one, handler in before.items():
            signal.signal(one, signal.SIG_DFL if handler is None else handler)
        if came:
            signal.raise_signal(came[0])
