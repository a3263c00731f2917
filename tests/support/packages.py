"""Python packages as an installer leaves them, for tests of plug-ins; what a process knows of
methods, forgotten."""

from __future__ import annotations

import sys
from pathlib import Path

from rotor_mbs.methods import catalogue


def forget_method_files() -> None:
    """Empty what the catalogue knows of methods in files, which later tests have under the same
    names."""
    catalogue._files.clear()
    catalogue._file_methods.clear()


def forget_what_is_installed() -> None:
    """Empty the caches of rotor_mbs, of which some hold the methods and quantities that were
    found."""
    for name, module in list(sys.modules.items()):
        if name.startswith("rotor_mbs."):
            for value in vars(module).values():
                getattr(value, "cache_clear", lambda: None)()


def install(folder: Path, name: str, source: str, group: str, entry_points: dict[str, str]) -> None:
    """Put a module and what its entry points are told by into a folder of sys.path."""
    (folder / f"{name}.py").write_text(source)
    about = folder / f"{name}-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = [f"{key} = {value}" for key, value in entry_points.items()]
    (about / "entry_points.txt").write_text("\n".join([f"[{group}]", *lines, ""]))
