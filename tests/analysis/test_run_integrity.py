"""Stored settings: what is missing, unknown or out of its range is a fault of the run."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from support.stored import Arrays

from rotor_mbs.analysis.checks import settings_faults
from rotor_mbs.methods.catalogue import find_method


def test_settings_are_all_of_the_methods_and_none_else() -> None:
    def faults(method: str, **settings: object) -> list[str]:
        one: Any = Arrays(method, settings=settings)
        return settings_faults(one)

    assert faults("exudyn_tree/rk44", step=1e-3) == []
    assert faults("exudyn_tree/rk44") == ["step is missing"]
    assert len(faults("exudyn_tree/rk44", step=-1.0, stride=2)) == 1
    # coarser than what is called ok
    assert len(faults("exudyn_chain/extrapolated", tolerance=0.011)) == 1
    alpha = "exudyn_tree/generalized_alpha"  # which a spectral radius above 1 makes unstable
    assert len(faults(alpha, **{**find_method(alpha).defaults, "spectral_radius": 1.1})) == 1
    assert faults("of/another", step=-1.0) == []  # a plug-in that is not installed


def test_defaults_are_the_settings_that_the_bounds_were_found_with() -> None:
    known = tomllib.loads((Path(__file__).parent / "default_settings.toml").read_text())
    for name, settings in known.items():
        # One that is not there is None, which TOML has no word for.
        assert {
            key: value for key, value in find_method(name).defaults.items() if value is not None
        } == settings, name
