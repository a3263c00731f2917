"""The only file that knows heyoka: symbols and parameters, Taylor integrators, quad precision
numbers."""

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
    """The engine, imported when first asked for. Raises MethodRefusal with the way to get it."""
    try:
        import heyoka as engine
    except MemoryError as exc:
        raise ResourceError("heyoka cannot be loaded: not enough memory") from exc
    except ImportError as exc:
        # it is there, and the system could not load it
        if not isinstance(exc, ModuleNotFoundError):
            raise ResourceError(f"heyoka cannot be loaded: {exc}") from exc
        raise MethodRefusal(
            f"heyoka is not installed: {_HINT}; lagrange/dop853 needs SciPy only"
        ) from exc
    if not _is_writable(engine.llvm_state.get_diskcache_path()):
        # The engine would warn twice of every system that it compiles.
        engine.llvm_state.set_diskcache_enabled(False)
    return engine  # type: ignore[no-any-return]


def _is_writable(cache: Path) -> bool:
    """Return whether the engine can keep compiled code in a folder, which is made; there is none
    without a home."""
    if cache == Path():
        return False
    try:
        cache.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return all(os.access(path, os.W_OK) for path in (cache, *cache.glob("*.db")))


def is_available() -> bool:
    """Whether heyoka can be loaded, which this tries."""
    try:
        heyoka()
    except MethodRefusal:
        return False
    return True


def compile_anew() -> None:
    """From now on no compiled code is taken from, or left in, the engine's cache on disk: for
    timing a cold start."""
    heyoka().llvm_state.set_diskcache_enabled(False)


class Parameters:
    """Turns numbers into runtime parameters: equal ones share one of the `values`, exact zeros
    vanish from the equations. `structure` has the index (-1: zero) of every number in the order
    asked for: one compiled integrator serves every scene of an equal structure."""

    def __init__(self) -> None:
        self.values: list[Fraction] = []
        self.structure: list[int] = []
        self._known: dict[Fraction, int] = {}

    def __call__(self, value: Fraction) -> Any:
        if value == 0:
            self.structure.append(-1)
            return 0.0
        if value not in self._known:
            self._known[value] = len(self.values)
            self.values.append(value)
        return self._parameter(self._known[value])

    def own(self, value: Fraction) -> Any:
        """A parameter of its own, even when zero or equal to another: for what changes during a
        run, or with it."""
        self.values.append(value)
        return self._parameter(len(self.values) - 1)

    def _parameter(self, index: int) -> Any:
        self.structure.append(index)
        return heyoka().par[index]


def array_of(values: Sequence[Fraction], *, quad: bool) -> Any:
    """(len(values),) float64, or real128 where `quad`: each number rounded once (quad: at most
    twice)."""
    if not quad:
        return np.array([float(value) for value in values])
    real128 = heyoka().real128
    numbers = [real128(str(value.numerator)) / real128(str(value.denominator)) for value in values]
    return np.array(numbers, dtype=real128)


def quad_arithmetic() -> tuple[
    Callable[[Fraction], Any], Callable[[Any], Any], Callable[[Any], Any]
]:
    """To a quad number; sine and cosine of arrays of them as objects, which NumPy multiplies by
    doubles, too."""
    real128 = heyoka().real128

    def of_objects(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
        return lambda numbers: function(numbers.astype(real128)).astype(object)

    return lambda value: array_of([value], quad=True)[0], of_objects(np.sin), of_objects(np.cos)


def failure(outcome: Any) -> str:
    """The engine's status of a propagation: "" where it reports that it reached the end, else its
    reason."""
    outcomes = heyoka().taylor_outcome
    if outcome == outcomes.time_limit:
        return ""
    if outcome == outcomes.err_nf_state:
        return "the state became non-finite (heyoka: err_nf_state)"
    return f"heyoka: {str(outcome).rsplit('.', 1)[-1]}"
