"""Declare the settings of a method with unit, default and allowed values, and check their values.

The allowed values of a setting are a `Kind` of `scenario.keys`, like those of a key of a scene.
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
    """Declare a field of a `Settings` class whose value is a finite number.

    Parameters
    ----------
    default : default value. If it is an int, only whole numbers are allowed.
    unit : SI unit; "" for none.
    above, at_least, at_most : exclusive lower, inclusive lower and inclusive upper limit.
    doc : description in one line.
    """
    kind = keys.PYTHON_WHOLE if isinstance(default, int) else keys.PYTHON_NUMBER
    limited = keys.within(kind, above=above, at_least=at_least, at_most=at_most)
    return field(default=default, metadata=_declaration(limited, unit, doc))


def step(default: float) -> Any:
    """Declare a field of a `Settings` class whose value is a time step in s."""
    doc = "time step; shortened to fit the sample interval"
    return number(default, unit="s", above=0.0, doc=doc)


def choice(default: object, options: Sequence[object], *, doc: str = "") -> Any:
    """Declare a field of a `Settings` class whose value is one of the given options.

    Parameters
    ----------
    default : default value, one of the options.
    options : all allowed values, which may be texts, numbers or flags.
    doc : description in one line.
    """
    kind = keys.choice(options, " or ".join(map(str, options)))
    return field(default=default, metadata=_declaration(kind, "", doc))


def _declaration(kind: Kind, unit: str, doc: str) -> dict[str, Any]:
    """Return the metadata of a field of a `Settings` class."""
    # Messages write the allowed values in parentheses. The unit is therefore not in parentheses.
    note = f", in {unit}" if unit else ""
    return keys.declaration(kind, unit, note, doc=doc)


# Metadata of a field that a class declares without `number`, `step` or `choice`.
_UNDECLARED = _declaration(keys.PYTHON_NUMBER, "", "")


def unknown_setting(name: str, known: Iterable[str]) -> str:
    """Return the message for an unknown setting.

    It has a hint if the name is similar to a known setting, or may be a key of a scene.
    """
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
        given : values by name of the setting. Settings that are not given have their defaults.

        Raises
        ------
        InputError
            For unknown names and values that are not allowed. The message is one line with all
            problems, followed by the description of all settings.
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
        """Return the declarations of the settings by name.

        Returns
        -------
        dict
            For each setting a mapping with `kind` (a `Kind`), `unit`, `allowed` (the allowed values
            in words) and `doc` (description).
        """
        declared: dict[str, Mapping[str, Any]] = {}
        for setting in fields(cls):
            is_declared = "kind" in setting.metadata
            declared[setting.name] = setting.metadata if is_declared else _UNDECLARED
        return declared

    @classmethod
    def describe(cls) -> str:
        """Return a line with all settings, their allowed values and their defaults."""
        defaults = cls().as_dict()
        texts = []
        for name, setting in cls.declared().items():
            texts.append(f"{name} ({setting['allowed']}; default {defaults[name]})")
        return ", ".join(texts) or "none"

    def as_dict(self) -> dict[str, object]:
        """Return the values of the settings by name."""
        return asdict(self)
