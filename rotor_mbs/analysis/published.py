"""What the paper says, read from the files under `reference/`: numbers, claims, errata. Compares nothing."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rotor_mbs.errors import RotorError
from rotor_mbs.scenario.resources import reference_folder


@dataclass(frozen=True)
class Asked:
    """A number to be read off a trajectory: scene, "angle" or "rate", coordinate (0 rotor), statistic."""

    scene: str
    quantity: str
    coordinate: int
    statistic: str


@dataclass(frozen=True)
class Condition:
    """`of` stands in `relation` ("<", ">", "opposite" in sign) to another number or to a bound."""

    of: Asked
    relation: str
    than: Asked | None = None
    bound: float | None = None


@dataclass(frozen=True)
class Published:
    """A number or claim of the paper. A number has of, value, decimals; a claim has statement, tests.

    matched: of a number that is grown rounding error: the run's length and the order of adding the weights were chosen
    so that it comes out.
    """

    id: str
    figure: str
    kind: str
    quote: str
    statement: str = ""
    of: Asked | None = None
    value: float = 0.0
    decimals: int = 0
    matched: bool = False
    tests: tuple[Condition, ...] = ()

    @property
    def is_number(self) -> bool:
        return self.kind == "number"

    @property
    def scenes(self) -> frozenset[str]:
        """Every scene that it speaks of."""
        asked = [self.of, *(side for test in self.tests for side in (test.of, test.than))]
        return frozenset(one.scene for one in asked if one is not None)


@dataclass(frozen=True)
class Erratum:
    """A fault in the printed equations; fields as in reference/errata.toml."""

    id: str
    entry: str
    pages: str
    printed: str
    right: str
    reason: str
    evidence: tuple[str, ...]
    stands_in: tuple[str, ...]
    reaches: tuple[str, ...]


def published() -> tuple[Published, ...]:
    """All numbers and claims, in the order of the file. Raises RotorError where it is missing or damaged."""
    return tuple(_published(item) for item in _read("published.toml")["published"])


def conditions() -> dict[str, str]:
    """What had to be found out to reproduce the numbers: by subject (gravity, duration) or scene (fig05)."""
    return {str(key): str(text) for key, text in _read("published.toml").get("conditions", {}).items()}


def errata() -> tuple[Erratum, ...]:
    """The errata, in the order of the file. Raises RotorError where it is missing or damaged."""
    return tuple(_erratum(item) for item in _read("errata.toml")["erratum"])


def _read(name: str) -> dict[str, Any]:
    path = Path(reference_folder()) / name
    try:
        with path.open("rb") as file:
            return tomllib.load(file)
    except (OSError, tomllib.TOMLDecodeError) as exc:
        raise RotorError(f"{path}: cannot be read ({exc}); install rotor_mbs again") from exc


def _erratum(item: Mapping[str, Any]) -> Erratum:
    several: dict[str, Any] = {name: tuple(item[name]) for name in ("evidence", "stands_in", "reaches")}
    return Erratum(**{**item, **several})


def _published(item: Mapping[str, Any]) -> Published:
    names = ("id", "figure", "kind", "quote", "statement", "value", "decimals", "matched")
    plain = {key: item[key] for key in names if key in item}
    of = Asked(*item["of"]) if "of" in item else None
    return Published(**plain, of=of, tests=tuple(_test(test) for test in item.get("tests", ())))


def _test(item: Mapping[str, Any]) -> Condition:
    than = Asked(*item["than"]) if "than" in item else None
    return Condition(Asked(*item["of"]), item["relation"], than, float(item["bound"]) if "bound" in item else None)
