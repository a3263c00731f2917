"""Import heyoka, and convert numbers to its parameters and to its quad precision.

No other module imports heyoka. They get it from the function `heyoka`.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from rotor_mbs.errors import MethodRefusal, ResourceError

_HINT = "it comes with rotor_mbs on Linux (pip install heyoka) and from conda-forge elsewhere"


@functools.cache
def heyoka() -> ModuleType:
    """Return the module heyoka, which is imported at the first call.

    Raises
    ------
    MethodRefusal
        If heyoka is not installed. The message says how to install it.
    ResourceError
        If heyoka is installed and cannot be loaded.
    """
    try:
        import heyoka as engine
    except MemoryError as exc:
        raise ResourceError("heyoka cannot be loaded: not enough memory") from exc
    except ImportError as exc:
        # heyoka is installed, but the system could not load it.
        if not isinstance(exc, ModuleNotFoundError):
            raise ResourceError(f"heyoka cannot be loaded: {exc}") from exc
        raise MethodRefusal(
            f"heyoka is not installed: {_HINT}; lagrange/dop853 needs SciPy only"
        ) from exc
    if not _is_writable(engine.llvm_state.get_diskcache_path()):
        # Without a writable folder the engine would print two warnings for every system that it
        # compiles.
        engine.llvm_state.set_diskcache_enabled(False)
    return engine  # type: ignore[no-any-return]


def _is_writable(cache: Path) -> bool:
    """Return whether the engine can store compiled code in its cache folder.

    The folder is created if it does not exist.

    Parameters
    ----------
    cache : cache folder of the engine; an empty path if there is no home folder.
    """
    if cache == Path():
        return False
    try:
        cache.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return all(os.access(path, os.W_OK) for path in (cache, *cache.glob("*.db")))


def is_available() -> bool:
    """Return whether heyoka is installed, after an attempt to import it."""
    try:
        heyoka()
    except MethodRefusal:
        return False
    return True


def compile_anew() -> None:
    """Disable the engine's cache of compiled code on disk, for timing a cold start."""
    heyoka().llvm_state.set_diskcache_enabled(False)


class Parameters:
    """Convert numbers to runtime parameters of compiled code.

    Equal numbers share one parameter. An exact zero becomes no parameter, so that its terms vanish
    from the equations. Scenes with equal `structure` share compiled code.

    Attributes
    ----------
    values : the value of each parameter.
    structure : for each converted number, in the order of the calls, its index in `values`; -1 for
        zero.
    """

    def __init__(self) -> None:
        self.values: list[Fraction] = []
        self.structure: list[int] = []
        # Index in `values` by numerator and denominator. To hash a Fraction would be slow.
        self._known: dict[tuple[int, int], int] = {}

    def __call__(self, value: Fraction) -> Any:
        if value == 0:
            self.structure.append(-1)
            return 0.0
        key = value.numerator, value.denominator
        if key not in self._known:
            self._known[key] = len(self.values)
            self.values.append(value)
        return self._parameter(self._known[key])

    def own(self, value: Fraction) -> Any:
        """Return a parameter that no other number shares, even if it is zero or equal to another.

        Numbers that change during a run, or from run to run, need such a parameter.
        """
        self.values.append(value)
        return self._parameter(len(self.values) - 1)

    def _parameter(self, index: int) -> Any:
        self.structure.append(index)
        return heyoka().par[index]


def array_of(values: Sequence[Fraction], *, quad: bool) -> Any:
    """Return numbers as an array of float64, or of real128 if `quad`.

    A double is the number rounded once. For a quad number the numerator, the denominator and their
    quotient are rounded.
    """
    if not quad:
        return np.array([float(value) for value in values])
    real128 = heyoka().real128
    numbers = [real128(str(value.numerator)) / real128(str(value.denominator)) for value in values]
    return np.array(numbers, dtype=real128)


def quad_arithmetic() -> tuple[
    Callable[[Fraction], Any], Callable[[Any], Any], Callable[[Any], Any]
]:
    """Return three functions: conversion to a quad number, and sine and cosine of quad arrays.

    These arrays have the type object, because NumPy can multiply such arrays by doubles.
    """
    real128 = heyoka().real128

    def of_objects(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
        return lambda numbers: function(numbers.astype(real128)).astype(object)

    return lambda value: array_of([value], quad=True)[0], of_objects(np.sin), of_objects(np.cos)


def failure(outcome: Any) -> str:
    """Return why an integration by the engine failed; "" if it reached the end.

    Parameters
    ----------
    outcome : the outcome that the engine returned.
    """
    outcomes = heyoka().taylor_outcome
    if outcome == outcomes.time_limit:
        return ""
    if outcome == outcomes.err_nf_state:
        return "the state became non-finite (heyoka: err_nf_state)"
    return f"heyoka: {str(outcome).rsplit('.', 1)[-1]}"
