"""Declare the settings of a method once, with unit, default and allowed values, and check them.

What a value may be is a `Kind` of `scenario.keys`, as for the keys of a scene file.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any, Self

from rotor_mbs.errors import InputError, nearest, shown_value
from rotor_mbs.scenario import keys
from rotor_mbs.scenario.keys import Kind
from rotor_mbs.scenario.toml_file import TableError


def number(
    default: float,
    *,
    unit: str = "",
    above: float = -math.inf,
    at_least: float = -math.inf,
    at_most: float = math.inf,
    doc: str = "",
) -> Any:
    """Declare a field of a `Settings` class: a finite number.

    Parameters
    ----------
    default : if it is an int, whole numbers alone are allowed.
    unit : SI unit; "" for none.
    above, at_least, at_most : exclusive lower, inclusive lower and inclusive upper limit.
    doc : description in one line.
    """
    kind = keys.PYTHON_WHOLE if isinstance(default, int) else keys.PYTHON_NUMBER
    limited = keys.within(kind, above=above, at_least=at_least, at_most=at_most)
    return field(default=default, metadata=_declaration(limited, unit, doc))


def step(default: float) -> Any:
    """Declare a field of a `Settings` class: a time step in s."""
    doc = "time step; shortened to fit the sample interval"
    return number(default, unit="s", above=0.0, doc=doc)


def choice(default: object, options: Sequence[object], *, doc: str = "") -> Any:
    """Declare a field of a `Settings` class: one of several values.

    Parameters
    ----------
    default : one of the allowed values.
    options : all of them: texts, numbers or flags.
    doc : description in one line.
    """
    kind = keys.choice(options, " or ".join(map(str, options)))
    return field(default=default, metadata=_declaration(kind, "", doc))


def _declaration(kind: Kind, unit: str, doc: str) -> dict[str, Any]:
    """Return the metadata of a field, as `Settings.declared` gives them."""
    # Messages have what is allowed in parentheses, therefore the unit is added without brackets.
    note = f", in {unit}" if unit else ""
    return keys.declaration(kind, unit, note, doc=doc)


# For a field that a class declares without `number`, `step` or `choice`.
_UNDECLARED = _declaration(keys.PYTHON_NUMBER, "", "")


def unknown_setting(name: str, known: Iterable[str]) -> str:
    """Return the line for an unknown setting, with a hint if it looks like a key of a scene."""
    line = f"no setting {name!r}{nearest(name, known)}"
    if "." in name:
        line += " (a key of scenes? rotor-mbs new FILE --from SCENE copies one, to be edited)"
    return line


@dataclass(frozen=True)
class Settings:
    """Base class of the settings of a method, and the class for methods without settings.

    The settings of a method are a frozen dataclass whose fields are declared by `number`, `step`
    and `choice`:

    >>> @dataclass(frozen=True)
    ... class Euler(Settings):
    ...     step: float = number(1e-3, unit="s", above=0.0, doc="time step")
    >>> Euler.of("mine/euler", {"step": 1})
    Euler(step=1.0)
    """

    @classmethod
    def of(cls, method: str, given: Mapping[str, object]) -> Self:
        """Return settings of a method, checked and converted.

        Parameters
        ----------
        method : name of the method, for messages.
        given : values by the names of settings; the others have their defaults.

        Raises
        ------
        InputError
            For unknown names and values that are not allowed, in one line with all settings.
        """
        declared = cls.declared()
        values: dict[str, Any] = {}
        problems = []
        for name, value in given.items():
            if name not in declared:
                problems.append(unknown_setting(name, declared))
                continue
            try:
                values[name] = declared[name]["kind"].read(value)
            except TableError:
                problems.append(f"{name} = {shown_value(value)} is not allowed")
        if problems:
            raise InputError(f"{method}: {'; '.join(problems)}; allowed: {cls.describe()}")
        return cls(**values)

    @classmethod
    def declared(cls) -> dict[str, Mapping[str, Any]]:
        """Return what is declared of each setting, by name.

        Returns
        -------
        dict
            Mappings with `kind`, a `Kind`; `unit`; `allowed`, what is allowed in words; `doc`.
        """
        declared: dict[str, Mapping[str, Any]] = {}
        for setting in fields(cls):
            is_declared = "kind" in setting.metadata
            declared[setting.name] = setting.metadata if is_declared else _UNDECLARED
        return declared

    @classmethod
    def describe(cls) -> str:
        """Return all settings with what is allowed and their defaults, in one line."""
        defaults = cls().as_dict()
        texts = []
        for name, setting in cls.declared().items():
            texts.append(f"{name} ({setting['allowed']}; default {defaults[name]})")
        return ", ".join(texts) or "none"

    def as_dict(self) -> dict[str, object]:
        """Return the values by the names of the settings."""
        return asdict(self)
