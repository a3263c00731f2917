"""What the paper says, read from the files under `reference/`: numbers, claims, errata, its entries checked."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple, TypeVar

from pydantic import Field, model_validator

from rotor_mbs.scenario.catalogue import reference_folder
from rotor_mbs.scenario.toml_file import read_toml, shown_path
from rotor_mbs.scenario.validation import Number, Table, Text, invalid, validate_file

T = TypeVar("T", bound=Table)


class TrajectoryNumber(NamedTuple):
    """A number read off a trajectory: scene, "angle" or "rate", coordinate (0 rotor, i pitch of blade i), statistic."""

    scene: str
    quantity: Literal["angle", "rate"]
    coordinate: int
    statistic: str


ReadOff = Annotated[TrajectoryNumber, Field(description='[scene, "angle" or "rate", coordinate, statistic]')]
Texts = Annotated[tuple[Text, ...], Field(strict=False)]


class Condition(Table):
    """`of` stands in `relation` to another number, or to a bound; "opposite" means of opposite sign."""

    of: ReadOff
    relation: Literal["<", ">", "opposite"] = Field(description='"<", ">" or "opposite"')
    than: ReadOff | None = None
    bound: Number | None = None

    @model_validator(mode="after")
    def _has_one_limit(self) -> Condition:
        if (self.than is None) == (self.bound is None) or (self.relation == "opposite" and self.than is None):
            raise invalid(f"a relation {self.relation} with than {self.than}, bound {self.bound}", "than or bound")
        return self


class Published(Table):
    """A number or claim of the paper. A number has of, value, decimals; a claim has statement, tests.

    rounding: of a number, whether it is amplified rounding error, which depends on how the equations are written.
    """

    id: Text = Field(description="a name")
    figure: Text = Field(description="the figure's number")
    kind: Literal["number", "claim"] = Field(description='"number" or "claim"')
    quote: Text = Field(description="the paper's words")
    statement: str = Field("", description="the claim as one sentence")
    of: ReadOff | None = None
    value: Number = Field(0.0, description="the printed number")
    decimals: int = Field(0, ge=0, description="how many decimals are printed")
    rounding: bool = Field(False, description="true or false")
    tests: Annotated[tuple[Condition, ...], Field(strict=False)] = Field((), description="a list of conditions")

    @model_validator(mode="after")
    def _is_complete(self) -> Published:
        if self.is_number != (self.of is not None) or self.is_number == bool(self.statement and self.tests):
            raise invalid(f"{self.id} is no complete {self.kind}", "of, value, decimals; or statement, tests")
        return self

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


class Erratum(Table):
    """An error in the printed equations; fields as in reference/errata.toml."""

    id: Text = Field(description="a name")
    entry: Text = Field(description="the matrix entry")
    pages: Text = Field(description="pages of the paper")
    printed: Text = Field(description="the entry as printed")
    right: Text = Field(description="the corrected entry")
    reason: Text = Field(description="a sentence")
    evidence: Texts = Field(description="a list of sentences")
    stands_in: Texts = Field(description="a list of equation numbers")
    reaches: Texts = Field(description="a list of equation numbers")


@dataclass(frozen=True, slots=True)
class CheckedEntry:
    """One printed entry against its derivative.

    printed, right   formulas; a term that is not there is 0
    difference       the largest of |printed - right| / max(1, |printed|, |right|) over random states
    explained_by     the fewest errata with which the paper's derivation gives what is printed, where without any it
                     gives what is right, as "E1, E2"; "" where the entry agrees, and where nothing explains it
    """

    equation: str
    entry: str
    printed: str
    right: str
    difference: float
    agrees: bool
    explained_by: str


class _PublishedFile(Table):
    conditions: dict[str, Text] = Field({}, description="a table of texts")
    published: list[Published] = Field(description="[[published]] tables")


class _ErrataFile(Table):
    erratum: list[Erratum] = Field(description="[[erratum]] tables")


def published() -> tuple[Published, ...]:
    """All numbers and claims, in the order of the file. Raises InputError with every error of the file."""
    return tuple(_read("published.toml", _PublishedFile).published)


def conditions() -> dict[str, str]:
    """What had to be found out to reproduce the numbers: by subject (gravity, duration) or scene (fig05)."""
    return dict(_read("published.toml", _PublishedFile).conditions)


def errata() -> tuple[Erratum, ...]:
    """The errata, in the order of the file. Raises InputError with every error of the file."""
    return tuple(_read("errata.toml", _ErrataFile).erratum)


def checked_entries() -> list[CheckedEntry]:
    """Every printed entry against derivatives of (3), in the order of the equations: reference/errata-check.csv.

    `tests/support/printed_entries.py` computes the file, and a test compares it with the derivation.
    """
    with (reference_folder() / "errata-check.csv").open(encoding="utf-8", newline="") as file:
        return [
            CheckedEntry(
                row["equation"],
                row["entry"],
                row["printed"],
                row["right"],
                float(row["difference"]),
                row["agrees"] == "True",
                row["explained_by"],
            )
            for row in csv.DictReader(file)
        ]


def _read(name: str, model: type[T]) -> T:
    path = reference_folder() / name
    text, tables = read_toml(path)
    return validate_file(model, tables, text, shown_path(path))
