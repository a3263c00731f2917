"""Numbers, claims and errata of the paper, and how many of them stored runs reproduce.

They are read from the shipped files under `reference/`, with the check of each printed entry.

The paper's runs are chaotic: a claim may hold for one rounding and fail for the next. So its
verdict is that of runs from many starts moved by rounding, for several durations, as
reference/claims.json has it.
"""

from __future__ import annotations

import csv
import functools
import json
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

from rotor_mbs.runs.read import StoredScene
from rotor_mbs.scenario.catalogue import REFERENCES
from rotor_mbs.solution.status import GOOD


@dataclass(frozen=True)
class Published:
    """Hold a number or claim of the paper, as in reference/published.toml.

    Attributes
    ----------
    id, figure, quote : identifier, place in the paper and its words.
    statement, tests : of a claim.
    scene, metric, value, decimals : of a number: it is this metric of a run of the scene, rad or
        rad/s.
    rounding : of a number, whether it is amplified rounding error, which depends on how the
        equations are written.
    scenes : names of the scenes whose runs decide it.
    printed, corrected : of a number, what a file's runs of the printed and the corrected model give
        (`claims`).
    """

    id: str
    figure: str
    quote: str
    statement: str = ""
    tests: Sequence[Mapping[str, Any]] = ()
    scene: str = ""
    metric: str = ""
    value: float = 0.0
    decimals: int = 0
    rounding: bool = False
    scenes: frozenset[str] = frozenset()
    printed: float | None = None
    corrected: float | None = None

    @property
    def is_number(self) -> bool:
        """Return whether it is a number, not a claim in words."""
        return bool(self.metric)


@dataclass(frozen=True)
class Erratum:
    """Hold an error in the printed equations; fields as in reference/errata.toml."""

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
    """Hold one printed entry and its derivative, as formulas.

    Attributes
    ----------
    equation, entry : which one it is.
    printed, right : formulas.
    difference : the largest of |printed - right| / max(1, |printed|, |right|) over random states.
    agrees : whether both agree.
    explained_by : the fewest errata with which the paper's derivation gives what is printed, as
        "E1, E2"; "" where it agrees, or where nothing explains it.
    """

    equation: str
    entry: str
    printed: str
    right: str
    difference: float
    agrees: bool
    explained_by: str


def published() -> tuple[Published, ...]:
    """Return all numbers and claims, in the order of the file."""
    items = []
    for table in _tables("published")["published"]:
        sides = [
            test[side] for test in table.get("tests", ()) for side in ("of", "than") if side in test
        ]
        scenes = frozenset(scene for scene, *_ in sides) or frozenset({table["scene"]})
        items.append(Published(**table, scenes=scenes))
    return tuple(items)


def conditions() -> dict[str, str]:
    """Return the conditions that had to be found out to reproduce the numbers.

    They are texts by subject (gravity, duration) or scene (fig05).
    """
    return dict(_tables("published")["conditions"])


def errata() -> tuple[Erratum, ...]:
    """Return the errata, in the order of the file."""
    return tuple(Erratum(**table) for table in _tables("errata")["erratum"])


def _tables(name: str) -> dict[str, Any]:
    return tomllib.loads((REFERENCES / f"{name}.toml").read_text(encoding="utf-8"))


def checked_entries() -> list[CheckedEntry]:
    """Return every printed entry with the derivative of equation (3), in the paper's order.

    They are read from reference/errata-check.csv. Tests compute every entry
    (`tests/support/printed_entries.py`) and compare the file with it.
    """
    with (REFERENCES / "errata-check.csv").open(encoding="utf-8", newline="") as file:
        rows: list[dict[str, Any]] = list(csv.DictReader(file))
    for row in rows:
        row["difference"], row["agrees"] = float(row["difference"]), row["agrees"] == "True"
    return [CheckedEntry(**row) for row in rows]


HOLDS, FAILS, UNDECIDED = "holds", "fails", "undecided"


@dataclass(frozen=True)
class ClaimStudy:
    """Hold the verdicts on the claims in words, tested on many runs.

    Attributes
    ----------
    rule : of the verdicts, in words.
    runs : number of runs of each scene for each duration.
    durations : s.
    spread : rad, by which their initial states were moved at most.
    methods : the printed and the corrected equations.
    verdicts : "holds", "fails" or "undecided" of each claim by method.
    shares : of each claim by method, for each duration: the share of the deciding runs in which it
        holds (None where none decides), and how many decide.
    """

    rule: str
    runs: int
    durations: Sequence[float]
    spread: float
    methods: Sequence[str]
    verdicts: Mapping[str, Mapping[str, str]]
    shares: Mapping[str, Mapping[str, Sequence[tuple[float | None, int]]]]

    def count(self, method: str, verdict: str) -> int:
        """Return how many claims have this verdict by the method."""
        return sum(verdicts[method] == verdict for verdicts in self.verdicts.values())


@functools.cache
def claim_study() -> ClaimStudy:
    """Read reference/claims.json, which `tests/support/make_claims.py` makes.

    >>> claim_study().verdicts["fig11-pitches-grow"]["printed/ode45"]
    'holds'
    """
    stored = json.loads((REFERENCES / "claims.json").read_text(encoding="utf-8"))
    return ClaimStudy(**{field.name: stored[field.name] for field in fields(ClaimStudy)})


# Share of a scene's energy scale. The drift of ode45 itself at the paper's tolerances is below a
# thousandth of that (3e-7 of the scale at most, on the corrected equations).
ENERGY_RISE = 1e-3


def claims(
    scenes: Mapping[str, StoredScene], items: Iterable[Published] | None = None
) -> list[Published]:
    """Return the numbers and claims that runs of the paper's scenes can be compared with.

    A claim needs all of its scenes, a number a run that has its metric. A scene that was changed
    under its name is not the paper's.

    Parameters
    ----------
    scenes : stored scenes by name.
    items : numbers and claims; all of the paper by default.
    """
    results = []
    for item in published() if items is None else items:
        if not all(name in scenes and scenes[name].is_shipped for name in item.scenes):
            continue
        if not item.is_number:
            results.append(item)
            continue
        runs = scenes[item.scene].printed, scenes[item.scene].corrected
        printed, corrected = (
            None if run is None else run.attributes.get(item.metric) for run in runs
        )
        if printed is not None or corrected is not None:
            results.append(replace(item, printed=printed, corrected=corrected))
    return results


def rounds_to(value: float, item: Published) -> bool:
    """Return whether `value`, rounded as it would be printed, is the printed number."""
    return f"{value:.{item.decimals}f}" == f"{item.value:.{item.decimals}f}"


def finding(
    scenes: Mapping[str, StoredScene], claims: Iterable[Published]
) -> list[tuple[str, str, str]]:
    """Return how much of the paper is reproduced, and the energy that its equations gain.

    The list is empty for other scenes.

    Parameters
    ----------
    scenes : stored scenes by name.
    claims : as `claims` returns them for these scenes.

    Returns
    -------
    list of tuple of str
        A result, and what the equations as printed and the corrected model give; "" where nothing
        is known.
    """
    claims = list(claims)
    numbers = [claim for claim in claims if claim.is_number]
    counts = []
    for values in ([claim.printed for claim in numbers], [claim.corrected for claim in numbers]):
        pairs = zip(values, numbers, strict=True)
        known = [rounds_to(value, claim) for value, claim in pairs if value is not None]
        counts.append(f"{sum(known)} of {len(known)}" if known else "")
    rows = [("Published numbers reproduced", counts[0], counts[1])]
    if claims:
        study = claim_study()
        printed, corrected = (
            f"{study.count(name, HOLDS)} of {len(study.verdicts)}" for name in study.methods
        )
        rows.append(("Published claims that hold", printed, corrected))
    runs = [run for scene in scenes.values() if (run := scene.printed) is not None]
    runs = [run for run in runs if "energy_gain_J" in run.attributes]
    rising = [
        run
        for run in runs
        if run.attributes["energy_gain_J"] > ENERGY_RISE * run.attributes["energy_scale_J"]
    ]
    if runs:
        result = (
            f"Scenes with a spurious energy gain of more than {ENERGY_RISE:g} of the energy scale"
        )
        rows.append((result, f"{len(rising)} of {len(runs)}", ""))
    gains = [run.attributes["energy_gain_J"] for run in rising if run.status in GOOD]
    if gains:
        rows.append(
            ("Largest spurious energy gain of a complete run", f"{1e-6 * max(gains):.3g} MJ", "")
        )
    return [row for row in rows if any(row[1:])]
