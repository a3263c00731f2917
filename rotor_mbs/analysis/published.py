"""What the paper says, read from the shipped files under `reference/`: numbers, claims, errata, its entries checked."""

from __future__ import annotations

import csv
import tomllib
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from rotor_mbs.scenario.catalogue import reference_folder


class TrajectoryNumber(NamedTuple):
    """A number read off a trajectory: scene, "angle" or "rate", coordinate (0 rotor, i pitch of blade i), statistic."""

    scene: str
    quantity: Literal["angle", "rate"]
    coordinate: int
    statistic: str


@dataclass(frozen=True)
class Condition:
    """`of` stands in `relation` to another number, or to a bound; "opposite" means of opposite sign."""

    of: TrajectoryNumber
    relation: Literal["<", ">", "opposite"]
    than: TrajectoryNumber | None = None
    bound: float | None = None


@dataclass(frozen=True)
class Published:
    """A number or claim of the paper, as in reference/published.toml.

    A number has of, value, decimals; a claim has statement, tests. rounding: of a number, whether it is amplified
    rounding error, which depends on how the equations are written.
    """

    id: str
    figure: str
    kind: Literal["number", "claim"]
    quote: str
    statement: str = ""
    of: TrajectoryNumber | None = None
    value: float = 0.0
    decimals: int = 0
    rounding: bool = False
    tests: tuple[Condition, ...] = ()

    @property
    def is_number(self) -> bool:
        return self.kind == "number"

    @property
    def numbers(self) -> list[TrajectoryNumber]:
        """All that is read off runs for it, each once."""
        sides = [self.of, *(side for test in self.tests for side in (test.of, test.than))]
        return list(dict.fromkeys(side for side in sides if side is not None))

    @property
    def scenes(self) -> frozenset[str]:
        return frozenset(number.scene for number in self.numbers)


@dataclass(frozen=True)
class Erratum:
    """An error in the printed equations; fields as in reference/errata.toml."""

    id: str
    entry: str
    pages: str
    printed: str
    right: str
    reason: str
    evidence: list[str]
    stands_in: list[str]
    reaches: list[str]


class CheckedEntry(NamedTuple):
    """One printed entry against its derivative, as formulas.

    difference: the largest of |printed - right| / max(1, |printed|, |right|) over random states. explained_by: the
    fewest errata with which the paper's derivation gives what is printed, as "E1, E2"; "" where it agrees, or where
    nothing explains it.
    """

    equation: str
    entry: str
    printed: str
    right: str
    difference: float
    agrees: bool
    explained_by: str


def published() -> tuple[Published, ...]:
    """All numbers and claims, in the order of the file."""
    items = []
    for table in _tables("published")["published"]:
        if "of" in table:
            table["of"] = TrajectoryNumber(*table["of"])
        tests = []
        for test in table.get("tests", ()):
            sides = {key: TrajectoryNumber(*test[key]) for key in ("of", "than") if key in test}
            tests.append(Condition(**test | sides))
        items.append(Published(**table | {"tests": tuple(tests)}))
    return tuple(items)


def conditions() -> dict[str, str]:
    """What had to be found out to reproduce the numbers: by subject (gravity, duration) or scene (fig05)."""
    return dict(_tables("published")["conditions"])


def errata() -> tuple[Erratum, ...]:
    """The errata, in the order of the file."""
    return tuple(Erratum(**table) for table in _tables("errata")["erratum"])


def _tables(name: str) -> dict[str, Any]:
    return tomllib.loads((reference_folder() / f"{name}.toml").read_text(encoding="utf-8"))


def checked_entries() -> list[CheckedEntry]:
    """Every printed entry against derivatives of (3), in the order of the equations: reference/errata-check.csv.

    `tests/support/printed_entries.py` computes the file, and a test compares it with the derivation.
    """
    with (reference_folder() / "errata-check.csv").open(encoding="utf-8", newline="") as file:
        rows: list[dict[str, Any]] = list(csv.DictReader(file))
    for row in rows:
        row["difference"], row["agrees"] = float(row["difference"]), row["agrees"] == "True"
    return [CheckedEntry(**row) for row in rows]
