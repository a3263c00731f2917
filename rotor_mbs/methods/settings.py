"""Settings of a method: name, unit, default and allowed values of each, declared once, checked on every use."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from numbers import Real
from typing import Any, Self

from rotor_mbs.errors import InputError, nearest, shown_value


@dataclass(frozen=True)
class Allowed:
    """Allowed values of a setting: one of `options`, or a finite number within the limits.

    Attributes
    ----------
    unit : SI unit of a number; "" for none.
    above, at_least, at_most : limits of a number: exclusive lower, inclusive lower and inclusive upper one.
    whole : whether only whole numbers are allowed.
    options : allowed values of a choice; () for a number.
    doc : description in one line.
    """

    unit: str = ""
    above: float = -math.inf
    at_least: float = -math.inf
    at_most: float = math.inf
    whole: bool = False
    options: tuple[object, ...] = ()
    doc: str = ""

    def convert(self, value: object) -> object:
        """Return the value in the form that is stored. Raises ValueError if it is not allowed."""
        if self.options:
            if value not in self.options or isinstance(value, bool) != isinstance(self.options[0], bool):
                raise ValueError
            return value
        if isinstance(value, bool) or not isinstance(value, Real):
            raise ValueError
        try:
            number = float(value)
        except OverflowError as error:  # a whole number above 1e308
            raise ValueError from error
        if not (math.isfinite(number) and number > self.above and self.at_least <= number <= self.at_most):
            raise ValueError
        if self.whole and number != int(number):
            raise ValueError
        return int(number) if self.whole else number

    def __str__(self) -> str:
        """ "a number above 0, in s"."""
        if self.options:
            return " or ".join(map(str, self.options))
        limits = {"above": self.above, "at least": self.at_least, "at most": self.at_most}
        text = "a whole number" if self.whole else "a number"
        ranges = [f"{word} {limit:g}" for word, limit in limits.items() if math.isfinite(limit)]
        if ranges:
            text += " " + " and ".join(ranges)
        return f"{text}, in {self.unit}" if self.unit else text


def number(
    default: float,
    *,
    unit: str = "",
    above: float = -math.inf,
    at_least: float = -math.inf,
    at_most: float = math.inf,
    doc: str = "",
) -> Any:
    """Declare a field of a `Settings` class: a finite number, an integer if `default` is an int."""
    allowed = Allowed(unit, above, at_least, at_most, isinstance(default, int), (), doc)
    return field(default=default, metadata={"allowed": allowed})


def step(default: float) -> Any:
    return number(default, unit="s", above=0.0, doc="time step; shortened to fit the sample interval")


def choice(default: object, options: Sequence[object], *, doc: str = "") -> Any:
    return field(default=default, metadata={"allowed": Allowed(options=tuple(options), doc=doc)})


@dataclass(frozen=True)
class Settings:
    """Base class of the settings of a method, and the class for methods without settings.

    The settings of a method are a frozen dataclass whose fields are declared by `number` and `choice`:

    >>> @dataclass(frozen=True)
    ... class Euler(Settings):
    ...     step: float = number(1e-3, unit="s", above=0.0, doc="time step")
    >>> Euler.of("mine/euler", {"step": 1})
    Euler(step=1.0)
    """

    @classmethod
    def of(cls, method: str, given: Mapping[str, object]) -> Self:
        """Return the settings of `method`: the `given` values, defaults for others.

        Raises InputError, one line with all settings, for an unknown name or a value that is not allowed, of any type.
        """
        known, values, problems = cls.allowed(), {}, []
        for name, value in given.items():
            if name not in known:
                problems.append(f"no setting {name!r}{nearest(name, known)}")
                continue
            try:
                values[name] = known[name].convert(value)
            except ValueError:
                problems.append(f"{name} = {shown_value(value)} is not allowed")
        if problems:
            raise InputError(f"{method}: {'; '.join(problems)}; allowed: {cls.describe()}")
        return cls(**values)

    @classmethod
    def allowed(cls) -> dict[str, Allowed]:
        return {setting.name: setting.metadata.get("allowed", Allowed()) for setting in fields(cls)}

    @classmethod
    def describe(cls) -> str:
        defaults = cls().as_dict()
        texts = [f"{name} ({allowed}; default {defaults[name]})" for name, allowed in cls.allowed().items()]
        return ", ".join(texts) or "none"

    def as_dict(self) -> dict[str, object]:
        return asdict(self)
