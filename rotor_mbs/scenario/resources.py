"""Where the shipped scenes and reference data are. Must not know file formats."""

from __future__ import annotations

from pathlib import Path

from rotor_mbs.errors import RotorError

_PACKAGE = Path(__file__).resolve().parents[1]


def scenarios_folder() -> Path:
    """The shipped scenes. Raises RotorError in an incomplete installation."""
    return _folder("scenarios")


def sweeps_folder() -> Path:
    """The shipped sweeps: TOML files that vary a scene."""
    return scenarios_folder() / "sweeps"


def reference_folder() -> Path:
    """The shipped reference data: published numbers, errata, bounds, trajectories. Raises RotorError as above."""
    return _folder("reference")


def _folder(name: str) -> Path:
    # A wheel carries the folders inside the package; an editable install has them at the top of the checkout.
    for candidate in (_PACKAGE / "_data" / name, _PACKAGE.parent / name):
        if candidate.is_dir():
            return candidate
    raise RotorError(f"{_PACKAGE}: the folder {name} is missing; install rotor_mbs again")
