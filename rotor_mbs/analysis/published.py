"""Read the paper's numbers, claims and errata, and count how many of them stored runs reproduce.

Numbers, claims and errata are read from the shipped files under `reference/`, as is the check of
each printed entry.

The paper's runs are chaotic: rounding errors decide whether a claim holds in a run. Therefore the
verdict on a claim does not come from a stored run. It comes from many runs with several durations,
whose initial states are moved by the size of rounding errors. reference/claims.json has the
verdicts.
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
    """Hold a number or a claim of the paper, as in reference/published.toml.

    Attributes
    ----------
    id, figure, quote : identifier, the paper's figure, and the paper's words.
    statement, tests : for a claim, its statement, and the conditions under which it holds.
    scene, metric : for a number, the scene of its run, and the metric of this run that it is.
    value, decimals : for a number, the printed value (rad or rad/s) and its number of decimals.
    rounding : for a number, whether it is an amplified rounding error, which depends on how the
        equations are written.
    scenes : names of the scenes whose runs are needed to decide the number or claim.
    printed, corrected : for a number, the metric in a file's runs of the printed and the corrected
        model, set by `claims`; None if there is no such run.
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
        """Return whether this is a number; otherwise it is a claim in words."""
        return bool(self.metric)


@dataclass(frozen=True)
class Erratum:
    """Hold an error in the printed equations; reference/errata.toml describes the fields."""

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
    """Hold an entry of a printed equation, and the correct entry, as formulas.

    Attributes
    ----------
    equation, entry : number of the equation, and place in it, such as "row 1 column 2".
    printed, right : the printed formula, and the formula derived from equation (3).
    difference : the largest of |printed - right| / max(1, |printed|, |right|) over random states.
    agrees : whether both formulas agree.
    explained_by : the fewest errata with which the paper's derivation gives the printed formula,
        such as "E1, E2"; "" if the formulas agree, or if no errata explain the difference.
    """

    equation: str
    entry: str
    printed: str
    right: str
    difference: float
    agrees: bool
    explained_by: str


def published() -> tuple[Published, ...]:
    """Return all numbers and claims of the paper, in the order of reference/published.toml."""
    items = []
    for table in _tables("published")["published"]:
        sides = [
            test[side] for test in table.get("tests", ()) for side in ("of", "than") if side in test
        ]
        scenes = frozenset(scene for scene, *_ in sides) or frozenset({table["scene"]})
        items.append(Published(**table, scenes=scenes))
    return tuple(items)


def conditions() -> dict[str, str]:
    """Return conditions that the paper does not print, but that its numbers depend on.

    The conditions are texts by subject (gravity, duration) or scene (fig05).
    """
    return dict(_tables("published")["conditions"])


def errata() -> tuple[Erratum, ...]:
    """Return the errata of the paper, in the order of reference/errata.toml."""
    return tuple(Erratum(**table) for table in _tables("errata")["erratum"])


def _tables(name: str) -> dict[str, Any]:
    return tomllib.loads((REFERENCES / f"{name}.toml").read_text(encoding="utf-8"))


def checked_entries() -> list[CheckedEntry]:
    """Return every printed entry with that derived from equation (3), in the paper's order.

    The entries are read from reference/errata-check.csv. Tests compute all entries again
    (`tests/support/printed_entries.py`) and compare the file with the result.
    """
    with (REFERENCES / "errata-check.csv").open(encoding="utf-8", newline="") as file:
        rows: list[dict[str, Any]] = list(csv.DictReader(file))
    for row in rows:
        row["difference"], row["agrees"] = float(row["difference"]), row["agrees"] == "True"
    return [CheckedEntry(**row) for row in rows]


HOLDS, FAILS, UNDECIDED = "holds", "fails", "undecided"


@dataclass(frozen=True)
class ClaimStudy:
    """Hold the verdicts on the claims in words, which were tested on many runs.

    Attributes
    ----------
    rule : the rule in words by which a claim gets its verdict.
    runs : number of runs of each scene for each duration.
    durations : durations of the runs, s.
    spread : largest change of the initial states, rad.
    methods : names of two methods, one with the printed, one with the corrected equations.
    verdicts : for each claim and method "holds", "fails" or "undecided".
    shares : for each claim and method a pair for each duration: the share of the deciding runs in
        which the claim holds (None if no run is deciding), and the number of deciding runs.
    """

    rule: str
    runs: int
    durations: Sequence[float]
    spread: float
    methods: Sequence[str]
    verdicts: Mapping[str, Mapping[str, str]]
    shares: Mapping[str, Mapping[str, Sequence[tuple[float | None, int]]]]

    def count(self, method: str, verdict: str) -> int:
        """Return the number of claims to which the runs of a method give this verdict."""
        return sum(verdicts[method] == verdict for verdicts in self.verdicts.values())


@functools.cache
def claim_study() -> ClaimStudy:
    """Return the verdicts of reference/claims.json, which `tests/support/make_claims.py` writes.

    >>> claim_study().verdicts["fig11-pitches-grow"]["printed/ode45"]
    'holds'
    """
    stored = json.loads((REFERENCES / "claims.json").read_text(encoding="utf-8"))
    return ClaimStudy(**{field.name: stored[field.name] for field in fields(ClaimStudy)})


# An energy gain above this share of the scene's energy scale is due to the equations. The error of
# ode45 is smaller: at the paper's tolerances the energy drift of the corrected equations is at most
# 3e-7 of the scale.
ENERGY_RISE = 1e-3


def claims(
    scenes: Mapping[str, StoredScene], items: Iterable[Published] | None = None
) -> list[Published]:
    """Return the numbers and claims that the runs of stored scenes can be compared with.

    For a claim all of its scenes are needed, for a number a run that has its metric. A scene whose
    motion was changed does not count, although it has the name of a scene of the paper.

    Parameters
    ----------
    scenes : stored scenes by name.
    items : numbers and claims to choose from; all of the paper by default.
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
    """Return whether a value, rounded to the decimals of the printed number, equals this number."""
    return f"{value:.{item.decimals}f}" == f"{item.value:.{item.decimals}f}"


def finding(
    scenes: Mapping[str, StoredScene], claims: Iterable[Published]
) -> list[tuple[str, str, str]]:
    """Return how much of the paper is reproduced, and the energy that its equations gain.

    Parameters
    ----------
    scenes : stored scenes by name.
    claims : result of `claims` for these scenes.

    Returns
    -------
    list of tuple of str
        A row for each result that is known: its name, its value for the equations as printed, and
        its value for the corrected model. A value that is not known is "".
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
