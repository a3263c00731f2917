"""What the paper says, read from the files under `reference/`: numbers, claims, errata, its entries checked."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeVar

from rotor_mbs.scenario import keys
from rotor_mbs.scenario.catalogue import reference_folder
from rotor_mbs.scenario.keys import Kind, file_key, list_of, table_of, wrong
from rotor_mbs.scenario.toml_file import TableError, read_toml, shown_path


class TrajectoryNumber(NamedTuple):
    """A number read off a trajectory: scene, "angle" or "rate", coordinate (0 rotor, i pitch of blade i), statistic."""

    scene: str
    quantity: Literal["angle", "rate"]
    coordinate: int
    statistic: str


def _read_trajectory_number(value: object) -> TrajectoryNumber:
    if not isinstance(value, list) or len(value) != 4:
        raise wrong(f"{keys.shown(value)} is not a list of four")
    scene, quantity, coordinate, statistic = value
    return TrajectoryNumber(
        keys.read_text(scene),
        keys.choice(("angle", "rate")).read(quantity),
        keys.whole(0, 1000).read(coordinate),
        keys.read_text(statistic),
    )


def _text(allowed: str) -> Kind:
    return Kind(keys.read_text, allowed)


_READ_OFF = Kind(_read_trajectory_number, '[scene, "angle" or "rate", coordinate, statistic]')
_RELATION = keys.choice(("<", ">", "opposite"))


@dataclass(frozen=True)
class Condition:
    """`of` stands in `relation` to another number, or to a bound; "opposite" means of opposite sign."""

    of: TrajectoryNumber = file_key("of", _READ_OFF)
    relation: Literal["<", ">", "opposite"] = file_key("relation", _RELATION)
    than: TrajectoryNumber | None = file_key("than", _READ_OFF, default=None)
    bound: float | None = file_key("bound", keys.NUMBER, default=None)

    def __post_init__(self) -> None:
        if (self.than is None) == (self.bound is None) or (self.relation == "opposite" and self.than is None):
            raise wrong(f"a relation {self.relation} with than {self.than}, bound {self.bound}", "than or bound")


@dataclass(frozen=True)
class Published:
    """A number or claim of the paper. A number has of, value, decimals; a claim has statement, tests.

    rounding: of a number, whether it is amplified rounding error, which depends on how the equations are written.
    """

    id: str = file_key("id", _text("a name"))
    figure: str = file_key("figure", _text("the figure's number"))
    kind: Literal["number", "claim"] = file_key("kind", keys.choice(("number", "claim")))
    quote: str = file_key("quote", _text("the paper's words"))
    statement: str = file_key("statement", _text("the claim as one sentence"), default="")
    of: TrajectoryNumber | None = file_key("of", _READ_OFF, default=None)
    value: float = file_key("value", keys.NUMBER, note=", as printed", default=0.0)
    decimals: int = file_key("decimals", keys.whole(0, 100), default=0)
    rounding: bool = file_key("rounding", keys.FLAG, default=False)
    tests: Sequence[Condition] = file_key("tests", list_of(table_of(Condition), "a list of conditions"), default=())

    def __post_init__(self) -> None:
        if self.is_number != (self.of is not None) or self.is_number == bool(self.statement and self.tests):
            raise wrong(f"{self.id} is no complete {self.kind}", "of, value, decimals; or statement, tests")

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
        """Every scene that it speaks of."""
        return frozenset(number.scene for number in self.numbers)


_NUMBERS = list_of(keys.TEXT, "a list of equation numbers")


@dataclass(frozen=True)
class Erratum:
    """An error in the printed equations; fields as in reference/errata.toml."""

    id: str = file_key("id", _text("a name"))
    entry: str = file_key("entry", _text("the matrix entry"))
    pages: str = file_key("pages", _text("pages of the paper"))
    printed: str = file_key("printed", _text("the entry as printed"))
    right: str = file_key("right", _text("the corrected entry"))
    reason: str = file_key("reason", _text("a sentence"))
    evidence: tuple[str, ...] = file_key("evidence", list_of(keys.TEXT, "a list of sentences"))
    stands_in: tuple[str, ...] = file_key("stands_in", _NUMBERS)
    reaches: tuple[str, ...] = file_key("reaches", _NUMBERS)


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


@dataclass(frozen=True, kw_only=True)
class _PublishedFile:
    conditions: dict[str, str] = file_key("conditions", keys.dict_of(keys.TEXT, "a table of texts"), optional={})
    published: tuple[Published, ...] = file_key("published", list_of(table_of(Published), "[[published]] tables"))


@dataclass(frozen=True)
class _ErrataFile:
    erratum: tuple[Erratum, ...] = file_key("erratum", list_of(table_of(Erratum), "[[erratum]] tables"))


def published() -> tuple[Published, ...]:
    """All numbers and claims, in the order of the file. Raises InputError with every error of the file."""
    return _read("published.toml", _PublishedFile).published


def conditions() -> dict[str, str]:
    """What had to be found out to reproduce the numbers: by subject (gravity, duration) or scene (fig05)."""
    return _read("published.toml", _PublishedFile).conditions


def errata() -> tuple[Erratum, ...]:
    """The errata, in the order of the file. Raises InputError with every error of the file."""
    return _read("errata.toml", _ErrataFile).erratum


_File = TypeVar("_File", _PublishedFile, _ErrataFile)


def _read(name: str, cls: type[_File]) -> _File:
    path = reference_folder() / name
    text, tables = read_toml(path)
    try:
        content: _File = table_of(cls).read(tables)
    except TableError as error:
        raise error.in_file(text, shown_path(path)) from error
    return content


def checked_entries() -> list[CheckedEntry]:
    """Every printed entry against derivatives of (3), in the order of the equations: reference/errata-check.csv.

    `tests/support/printed_entries.py` computes the file, and a test compares it with the derivation.
    """
    with (reference_folder() / "errata-check.csv").open(encoding="utf-8", newline="") as file:
        rows: list[dict[str, Any]] = list(csv.DictReader(file))
    for row in rows:
        row["difference"], row["agrees"] = float(row["difference"]), row["agrees"] == "True"
    return [CheckedEntry(**row) for row in rows]
