"""The paper's numbers under other conditions; the study of claims and numbers as records of a results file, and back.

Which durations, tolerances and ways of writing a row reproduce the numbers; read from a report's file, or as shipped.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import astuple, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.analysis.claim_shares import RULE, ClaimShare, ClaimShares
from rotor_mbs.analysis.published import published
from rotor_mbs.models.printed.gravity_rows import GRAVITY_ROWS
from rotor_mbs.runs.layout import KEY_ATTRIBUTE
from rotor_mbs.runs.read import OpenResults, open_results
from rotor_mbs.runs.records import Record, read_record, records_in
from rotor_mbs.scenario.catalogue import reference_folder

KIND, SHARES, NUMBERS = "claims", "shares", "numbers"
# The fields of `Conditions` behind the first as datasets; all of them as attributes, of the usual ones.
_NUMBERS_OF_CONDITIONS = ("duration", "relative_tolerance", "absolute_tolerance")
_USUAL = ("usual_row", "usual_duration_s", "usual_relative_tolerance", "usual_absolute_tolerance")


@dataclass(frozen=True, order=True)
class Conditions:
    """What the paper does not print, or what depends on rounding.

    gravity_row   way of writing the first row of (56), as the setting of printed/ode45
    duration      s
    relative_tolerance, absolute_tolerance   of ode45; the latter in rad and rad/s
    """

    gravity_row: str
    duration: float
    relative_tolerance: float
    absolute_tolerance: float


@dataclass(frozen=True)
class NumberTrial:
    """A published number under some conditions.

    number      its id
    value       rad or rad/s, read off the printed model's run; NaN where there is none
    reproduced  whether it has the printed digits
    remainder   N m, the row's value at the start of Fig. 5: zero but for rounding
    """

    number: str
    conditions: Conditions
    value: float
    reproduced: bool
    remainder: float


@dataclass(frozen=True)
class NumberTrials:
    """All trials of a study.

    usual   the conditions of the paper's scenes, but for the duration
    rows    tried ways of writing the row, names of `GRAVITY_ROWS`, in order
    """

    trials: tuple[NumberTrial, ...]
    usual: Conditions
    rows: tuple[str, ...]

    @property
    def numbers(self) -> list[str]:
        """Ids, in order."""
        return list(dict.fromkeys(one.number for one in self.trials))

    @property
    def conditions(self) -> list[Conditions]:
        """All that were tried, in order."""
        return list(dict.fromkeys(one.conditions for one in self.trials))

    def under(self, conditions: Conditions) -> dict[str, NumberTrial]:
        """The trials under these conditions, by number."""
        return {one.number: one for one in self.trials if one.conditions == conditions}

    def reproduces_all(self, conditions: Conditions) -> bool:
        """Whether every number comes out."""
        return sum(one.reproduced for one in self.under(conditions).values()) == len(self.numbers)

    def durations_of_all(self, row: str) -> list[float]:
        """s, for which all numbers come out with this way of writing the row and the usual tolerances."""
        return [one.duration for one in self.of_row(row) if self.reproduces_all(one)]

    def of_row(self, row: str) -> list[Conditions]:
        """Those with this way of writing the row and the usual tolerances, by duration."""
        usual = replace(self.usual, gravity_row=row)
        return sorted(one for one in self.conditions if one == replace(usual, duration=one.duration))

    def with_tolerances(self) -> list[Conditions]:
        """Those of the usual row and duration, by tolerance."""
        same = (self.usual.gravity_row, self.usual.duration)
        return sorted(one for one in self.conditions if (one.gravity_row, one.duration) == same)


def count_of_rows(trials: NumberTrials, duration: float) -> tuple[int, int]:
    """(ways of writing the printed row that give all numbers for `duration`, all such ways)."""
    found = [duration in trials.durations_of_all(row) for row in trials.rows if GRAVITY_ROWS[row].of is not None]
    return sum(found), len(found)


@dataclass(frozen=True)
class ClaimStudy:
    """Both tables."""

    shares: ClaimShares
    numbers: NumberTrials


def shipped_claims() -> Path:
    """The study shipped with the package, made by `rotor-mbs claims`."""
    return reference_folder() / "claims.h5"


def stored_claims(results: OpenResults | None = None) -> ClaimStudy | None:
    """The study in an open results file, else the shipped one; None where there is none."""
    found = {} if results is None else _records(results)
    if len(found) < 2 and shipped_claims().exists():
        with open_results(shipped_claims()) as shipped:
            found = _records(shipped)
    return ClaimStudy(_shares(found[SHARES]), _numbers(found[NUMBERS])) if len(found) == 2 else None


def records_of(study: ClaimStudy, seed: int, made_with: Mapping[str, str]) -> list[Record]:
    """Two records, found by a content hash. made_with: versions of the programs."""
    facts = {"seed": seed, "made_with": json.dumps(dict(made_with), sort_keys=True)}
    return [_hashed(_shares_record(study.shares), facts), _hashed(_numbers_record(study.numbers), facts)]


def _hashed(record: Record, facts: Mapping[str, object]) -> Record:
    attributes = {**record.attributes, **facts}
    content = [attributes, {name: np.asarray(values).tolist() for name, values in record.arrays.items()}]
    key = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    return replace(record, attributes={KEY_ATTRIBUTE: key, **attributes})


def _records(results: OpenResults) -> dict[str, Record]:
    found = [read_record(path, group) for path, group in records_in(results.root, KIND)]
    return {record.name: record for record in found}


def _shares_record(study: ClaimShares) -> Record:
    shares = study.shares
    texts = {
        "claims": [one.claim for one in shares],
        "methods": [one.method for one in shares],
        "marks": [one.marks for one in shares],
    }
    numbers: dict[str, Any] = {
        "duration": np.array([one.duration for one in shares]),
        "share": np.array([one.share for one in shares]),
        "deciding": np.array([one.deciding for one in shares], dtype=np.int64),
    }
    facts = {"spread_rad": study.spread, "runs": study.runs, "rule": RULE}
    return Record(KIND, "", SHARES, {**facts, **texts}, numbers)


def _shares(record: Record) -> ClaimShares:
    facts = record.attributes
    columns = zip(facts["claims"], facts["methods"], record.arrays["duration"].tolist(), facts["marks"], strict=True)
    return ClaimShares(tuple(ClaimShare(*row) for row in columns), float(facts["spread_rad"]), int(facts["runs"]))


def _numbers_record(study: NumberTrials) -> Record:
    trials = study.trials
    is_rate = {item.id: item.of is not None and item.of.quantity == "rate" for item in published()}
    texts = {
        "numbers": [one.number for one in trials],
        "gravity_rows": [one.conditions.gravity_row for one in trials],
        "row_names": list(study.rows),
        "row_formulas": [GRAVITY_ROWS[row].formula for row in study.rows],
        "rows_of_56": [row for row in study.rows if GRAVITY_ROWS[row].of is not None],
    }
    arrays: dict[str, Any] = {
        **{name: np.array([getattr(one.conditions, name) for one in trials]) for name in _NUMBERS_OF_CONDITIONS},
        "remainder": np.array([one.remainder for one in trials]),
        "angle": np.array([np.nan if is_rate[one.number] else one.value for one in trials]),
        "rate": np.array([one.value if is_rate[one.number] else np.nan for one in trials]),
        "reproduced": np.array([one.reproduced for one in trials], dtype=np.int8),
    }
    facts = dict(zip(_USUAL, astuple(study.usual), strict=True))
    return Record(KIND, "", NUMBERS, {**facts, **texts}, arrays)


def _numbers(record: Record) -> NumberTrials:
    facts, arrays = record.attributes, {name: values.tolist() for name, values in record.arrays.items()}
    conditions = map(Conditions, facts["gravity_rows"], *(arrays[name] for name in _NUMBERS_OF_CONDITIONS))
    values = [rate if np.isnan(angle) else angle for angle, rate in zip(arrays["angle"], arrays["rate"], strict=True)]
    trials = map(
        NumberTrial, facts["numbers"], conditions, values, map(bool, arrays["reproduced"]), arrays["remainder"]
    )
    return NumberTrials(tuple(trials), Conditions(*(facts[name] for name in _USUAL)), tuple(facts["row_names"]))
