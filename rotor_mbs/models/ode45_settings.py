"""The settings of `rotor_mbs.models.ode45`, apart from its code: the list of methods needs no NumPy."""

from __future__ import annotations

from dataclasses import dataclass

from rotor_mbs.methods.settings import Settings, number


@dataclass(frozen=True)
class Ode45Settings(Settings):
    relative_tolerance: float = number(1e-6, above=0.0, doc="relative tolerance of the local error")
    absolute_tolerance: float = number(1e-9, above=0.0, doc="absolute tolerance of the local error, rad and rad/s")
