"""The paper's figures in their order: what each shows, and of which scenes. Draws nothing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rotor_mbs.store.read import StoredScene

MOTION, PATHS, TORQUES = "motion", "paths", "torques"


@dataclass(frozen=True)
class PaperFigure:
    """number; kind; panels: the letter ("" where it has none) and the scene of each."""

    number: str
    kind: str
    panels: tuple[tuple[str, str], ...]

    @property
    def scenes(self) -> tuple[str, ...]:
        return tuple(scene for _, scene in self.panels)


def _figure(number: str, kind: str, **panels: str) -> PaperFigure:
    return PaperFigure(number, kind, tuple((letter.strip("_"), f"paper/{name}") for letter, name in panels.items()))


FIGURES = (
    _figure("3", MOTION, _="fig03"),
    _figure("4", PATHS, a="fig03", b="fig04b"),
    _figure("5", MOTION, _="fig05"),
    _figure("6", MOTION, _="fig06"),
    _figure("7", PATHS, a="fig05", b="fig06"),
    _figure("8", MOTION, _="fig08"),
    _figure("9", MOTION, _="fig09"),
    _figure("10", PATHS, a="fig08", b="fig09"),
    _figure("11", MOTION, _="fig11"),
    _figure("12", MOTION, _="fig12"),
    _figure("13", PATHS, a="fig11", b="fig13b"),
    _figure("14", PATHS, a="fig14a", b="fig14b", c="fig14c"),
    PaperFigure("15", TORQUES, tuple((f"{n} kN·m", f"paper/fig15-{n}kNm") for n in (1, 10, 50, 100))),
    _figure("16", PATHS, a="fig15-1kNm", b="fig15-100kNm"),
)


def available(scenes: Mapping[str, StoredScene]) -> tuple[PaperFigure, ...]:
    """The figures of which the file has a panel, with the panels that it has."""
    found = (
        PaperFigure(one.number, one.kind, tuple(panel for panel in one.panels if panel[1] in scenes)) for one in FIGURES
    )
    return tuple(one for one in found if one.panels)
