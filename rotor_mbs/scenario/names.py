"""Names of scenes and of groups in a results file: their order, and which are reserved. Must not know files."""

from __future__ import annotations

import re
from collections.abc import Iterable

# Groups at the top of a results file that are not scenes: no scene may take such a name.
RESERVED_GROUPS = ("bench", "errata", "modes", "stability", "sweep")


def natural_key(name: str) -> list[tuple[int, int, str]]:
    """Sort key under which digits count as whole numbers: 1kNm, 10kNm, 50kNm, 100kNm."""
    pieces = re.findall(r"[0-9]+|[^0-9]+", name)
    return [(0, int(piece), piece) if piece.isascii() and piece.isdigit() else (1, 0, piece) for piece in pieces]


def natural_order(names: Iterable[str]) -> list[str]:
    """The names, sorted by `natural_key`.

    >>> natural_order(["fig15-10kNm", "fig15-1kNm", "fig05"])
    ['fig05', 'fig15-1kNm', 'fig15-10kNm']
    """
    return sorted(names, key=natural_key)
