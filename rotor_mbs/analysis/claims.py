"""The paper's numbers read off stored runs, and how much of the paper is reproduced."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from rotor_mbs.analysis import run_selection
from rotor_mbs.analysis.published import HOLDS, Published, claim_study, published
from rotor_mbs.runs.read import StoredScene
from rotor_mbs.solution.status import GOOD

# The metric of a run that a published number is, and its words. Of the rotor, over the integrator's own output points.
STATISTICS = {
    ("angle", "min"): ("rotor_angle_min", "smallest"),
    ("angle", "max"): ("rotor_angle_max", "largest"),
    ("rate", "max_abs"): ("rotor_rate_max", "largest magnitude of"),
}

# Share of a scene's energy scale. The drift of ode45 itself at the paper's tolerances is below a thousandth of that
# (3e-7 of the scale at most, on the corrected equations).
ENERGY_RISE = 1e-3


class NumberResult(NamedTuple):
    """A published number by one model, in rad or rad/s, and whether it has the printed digits; None without a run."""

    holds: bool | None = None
    value: float | None = None


_UNKNOWN = NumberResult()


@dataclass(frozen=True)
class Claim:
    """A number or claim of the paper; of a number the results of the printed and of the corrected model."""

    published: Published
    printed: NumberResult = _UNKNOWN
    corrected: NumberResult = _UNKNOWN


def claims(scenes: Mapping[str, StoredScene], items: Iterable[Published] | None = None) -> list[Claim]:
    """The numbers that runs of `scenes` have, and the claims about scenes that are all there; of `items`, or of all."""
    results = []
    for item in published() if items is None else items:
        if not item.scenes <= scenes.keys():
            continue
        if item.of is None:
            results.append(Claim(item))
            continue
        metric, _ = STATISTICS[item.of.quantity, item.of.statistic]
        scene = scenes[item.of.scene]
        sides = []
        for run in (run_selection.printed_run(scene), run_selection.reference_or_corrected_run(scene)):
            value = None if run is None else run.attributes.get(metric)
            sides.append(_UNKNOWN if value is None else NumberResult(rounds_to(value, item), value))
        if sides != [_UNKNOWN, _UNKNOWN]:
            results.append(Claim(item, *sides))
    return results


def rounds_to(value: float, item: Published) -> bool:
    """Whether `value`, rounded as it would be printed, is the printed number."""
    return f"{value:.{item.decimals}f}" == f"{item.value:.{item.decimals}f}"


class Finding(NamedTuple):
    """A result with what the equations as printed and the corrected model give; "" where nothing is known."""

    result: str
    printed: str
    corrected: str


def finding(scenes: Mapping[str, StoredScene], claims: Iterable[Claim]) -> list[Finding]:
    """How much of the paper is reproduced, and the energy that its equations gain; empty for other scenes."""
    claims = list(claims)
    numbers = [claim for claim in claims if claim.published.is_number]
    counts = []
    for results in ([claim.printed for claim in numbers], [claim.corrected for claim in numbers]):
        known = [result.holds for result in results if result.holds is not None]
        counts.append(f"{sum(known)} of {len(known)}" if known else "")
    rows = [Finding("Published numbers reproduced", *counts)]
    if claims:
        study = claim_study()
        printed, corrected = (f"{study.count(name, HOLDS)} of {len(study.verdicts)}" for name in study.methods)
        rows.append(Finding("Published claims that hold", printed, corrected))
    runs = [run for scene in scenes.values() if (run := run_selection.printed_run(scene)) is not None]
    runs = [run for run in runs if "energy_gain_J" in run.attributes]
    rising = [run for run in runs if run.attributes["energy_gain_J"] > ENERGY_RISE * run.attributes["energy_scale_J"]]
    if runs:
        result = f"Scenes in which energy rises by more than {ENERGY_RISE:g} of its scale without work"
        rows.append(Finding(result, f"{len(rising)} of {len(runs)}", ""))
    gains = [run.attributes["energy_gain_J"] for run in rising if run.status in GOOD]
    if gains:
        rows.append(Finding("Largest spurious energy gain of a complete run", f"{1e-6 * max(gains):.3g} MJ", ""))
    return [row for row in rows if row.printed or row.corrected]
