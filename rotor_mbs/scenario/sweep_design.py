"""The rows of a sweep: lists, ranges and random draws, as a grid (the last axis fastest; all random axes together are
one digit, the draw) or zipped. Every row follows from its number alone, so that any part of a sweep can be computed on
any computer."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SPLITS = ("train", "validation", "test")
DRAWN = ("uniform", "normal", "sobol")


@dataclass(frozen=True)
class Axis:
    key: str
    kind: str  # values, linear, log, uniform, normal or sobol
    numbers: tuple[float, ...]  # the values; start and end; low and high; or mean and standard deviation
    count: int  # how many values; of a random axis, how many draws

    @property
    def is_drawn(self) -> bool:
        return self.kind in DRAWN


@dataclass(frozen=True)
class Design:
    """All rows of a sweep: axes, how they are combined ("grid" or "zip"), and the seed of every draw."""

    axes: tuple[Axis, ...]
    combine: str
    seed: int

    @functools.cached_property
    def _digits(self) -> list[list[int]]:
        """Axes that move together, as lists of axis numbers, slowest first."""
        if self.combine == "zip":
            return [list(range(len(self.axes)))]
        drawn = [i for i, axis in enumerate(self.axes) if axis.is_drawn]
        digits: list[list[int]] = []
        for i in range(len(self.axes)):
            if i not in drawn:
                digits.append([i])
            elif i == drawn[0]:
                digits.append(drawn)
        return digits

    @property
    def count(self) -> int:
        """Rows in all, counted without making one."""
        return math.prod(self.shape)

    @property
    def shape(self) -> tuple[int, ...]:
        """Values along every digit of a grid, slowest first."""
        return tuple(self.axes[digit[0]].count for digit in self._digits)

    def rows(self, first: int, last: int) -> Array:
        """(last - first, axes) the rows of these numbers; after the last one they begin again."""
        numbers = np.arange(first, last)
        table = np.empty((len(numbers), len(self.axes)))
        for digit in reversed(self._digits):
            count = self.axes[digit[0]].count
            for i in digit:
                table[:, i] = self.values[i][numbers % count]
            numbers = numbers // count
        return table

    @functools.cached_property
    def values(self) -> list[Array]:
        sobol = [axis.key for axis in self.axes if axis.kind == "sobol"]
        if sobol:
            from scipy.stats import qmc  # late: 0.5 s

            # One scrambled sequence over all Sobol axes: points in the unit cube. Its balance belongs to powers of two:
            # its beginning is taken of the next one.
            count = max(axis.count for axis in self.axes if axis.kind == "sobol")
            sampler = qmc.Sobol(len(sobol), seed=np.random.default_rng(self.seed))
            points = sampler.random_base2((count - 1).bit_length())[:count]
        columns = []
        for i, axis in enumerate(self.axes):
            if axis.kind == "values":
                columns.append(np.array(axis.numbers))
                continue
            first, second = axis.numbers
            generator = np.random.default_rng([self.seed, i])
            if axis.kind == "linear":
                columns.append(np.linspace(first, second, axis.count))
            elif axis.kind == "log":
                columns.append(np.geomspace(first, second, axis.count))
            elif axis.kind == "sobol":
                columns.append(first + (second - first) * points[:, sobol.index(axis.key)])
            elif axis.kind == "uniform":
                columns.append(generator.uniform(first, second, axis.count))
            else:
                columns.append(generator.normal(first, second, axis.count))
        return columns


def split_rows(count: int, validation: float, test: float, seed: int) -> NDArray[np.int8]:
    """(count,) numbers of `SPLITS`; shares to the nearest row, rows drawn by `seed`."""
    drawn = np.random.default_rng([seed, 2**32]).permutation(count)
    first, second = round(validation * count), round(validation * count) + round(test * count)
    codes = np.zeros(count, np.int8)
    codes[drawn[:first]], codes[drawn[first:second]] = 1, 2
    return codes
