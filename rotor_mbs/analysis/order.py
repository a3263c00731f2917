"""Scenes in the order a reader expects: numbers in names by their value (1, 10, 50, 100). Knows names only."""

from __future__ import annotations

import re
from collections.abc import Iterable


def natural(names: Iterable[str]) -> list[str]:
    """The names, sorted; runs of digits compare as whole numbers."""
    return sorted(names, key=_key)


def _key(name: str) -> list[tuple[int, int, str]]:
    pieces = re.findall(r"[0-9]+|[^0-9]+", name)
    return [(0, int(piece), piece) if piece.isascii() and piece.isdigit() else (1, 0, piece) for piece in pieces]
