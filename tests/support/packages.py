"""Python packages as an installer leaves them, for tests of plug-ins."""

from __future__ import annotations

from pathlib import Path


def install(folder: Path, name: str, source: str, group: str, entry_points: dict[str, str]) -> None:
    """Put a module and what its entry points are told by into a folder of sys.path."""
    (folder / f"{name}.py").write_text(source)
    about = folder / f"{name}-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = [f"{key} = {value}" for key, value in entry_points.items()]
    (about / "entry_points.txt").write_text("\n".join([f"[{group}]", *lines, ""]))
