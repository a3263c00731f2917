"""The finding in numbers: how much of the paper is reproduced, what its errata do, how well corrected models agree."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from rotor_mbs.analysis import run_selection
from rotor_mbs.analysis.claims import Claim
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.scenario.catalogue import natural_order
from rotor_mbs.solution.status import COMPLETE

# Share of a scene's energy scale. The drift of ode45 itself at the paper's tolerances is below a thousandth of that
# (3e-7 of the scale at most, on the corrected equations).
ENERGY_RISE = 1e-3


@dataclass(frozen=True)
class Tally:
    """A count of a total."""

    count: int
    of: int


@dataclass(frozen=True)
class PrintedEnergy:
    """Scenes in which the energy of the printed model rises without work.

    gain          J: the largest gain of a run that reached its end; None where no such run gained
    ended_early   scenes where the integration ended early, and the gain until then (J)
    """

    rises: Tally
    gain: float | None
    ended_early: Mapping[str, float]


@dataclass(frozen=True)
class Agreement:
    """A method's largest errors over its runs that are ok, and its longest run (s).

    angle_error rad up to each horizon, energy_drift relative to the energy scale; None without data.
    """

    method: str
    runs: Tally  # ok, of all
    angle_error: float | None
    energy_drift: float | None
    longest_s: float


@dataclass(frozen=True)
class Finding:
    """Parts are None, or empty, where the file does not have the data."""

    numbers: Tally | None
    numbers_corrected: Tally | None
    claims_printed: Tally | None
    energy: PrintedEnergy | None
    agreement: tuple[Agreement, ...]


def finding(scenes: Mapping[str, StoredScene], claims: Iterable[Claim]) -> Finding:
    """From the runs' stored metrics and the evaluated claims."""
    said = list(claims)
    numbers = [claim for claim in said if claim.published.is_number]
    others = [claim for claim in said if not claim.published.is_number]
    return Finding(
        _tally(claim.printed.holds for claim in numbers),
        _tally(claim.corrected.holds for claim in numbers),
        _tally(claim.printed.holds for claim in others),
        _printed_energy(scenes),
        agreement(run for scene in scenes.values() for run in run_selection.corrected_runs(scene).values()),
    )


def _tally(verdicts: Iterable[bool | None]) -> Tally | None:
    decided = [verdict for verdict in verdicts if verdict is not None]
    return Tally(sum(decided), len(decided)) if decided else None


def _printed_energy(scenes: Mapping[str, StoredScene]) -> PrintedEnergy | None:
    runs = {name: run for name in natural_order(scenes) if (run := run_selection.printed_run(scenes[name])) is not None}
    gains = {name: run.attributes["energy_gain_J"] for name, run in runs.items() if "energy_gain_J" in run.attributes}
    if not gains:
        return None
    made = [name for name in gains if gains[name] > ENERGY_RISE * runs[name].attributes["energy_scale_J"]]
    largest = max((gains[name] for name in made if runs[name].status == "ok"), default=None)
    ended_early = {name: gain for name, gain in gains.items() if runs[name].status not in COMPLETE}
    return PrintedEnergy(Tally(len(made), len(gains)), largest, ended_early)


def agreement(runs: Iterable[StoredRun]) -> tuple[Agreement, ...]:
    """A row for each method, in the order of the catalogue."""
    by_method: dict[str, list[StoredRun]] = {}
    for run in runs:
        by_method.setdefault(run.method, []).append(run)
    found = []
    for method in run_selection.in_catalogue_order(by_method):
        own = by_method[method]
        ok = [run for run in own if run.status == "ok"]
        error, drift = _largest(ok, "angle_error_max"), _largest(ok, "energy_drift_max")
        longest = _largest(own, "run_time_s") or 0.0
        found.append(Agreement(method, Tally(len(ok), len(own)), error, drift, longest))
    return tuple(found)


def _largest(runs: Iterable[StoredRun], name: str) -> float | None:
    return max((float(run.attributes[name]) for run in runs if name in run.attributes), default=None)
