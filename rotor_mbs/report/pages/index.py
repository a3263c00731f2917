"""The index: the finding, the paper's numbers and claims, one table over all scenes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rotor_mbs.analysis import run_selection
from rotor_mbs.analysis.claim_records import ClaimStudy
from rotor_mbs.analysis.claim_shares import ClaimShares
from rotor_mbs.analysis.claims import Claim
from rotor_mbs.analysis.finding import Agreement, Finding, PrintedEnergy, Reproduced, Tally, finding
from rotor_mbs.analysis.published import Erratum
from rotor_mbs.report.core.elements import PageTable, Row, Section, TableCell
from rotor_mbs.report.core.looks import label_of, with_capital
from rotor_mbs.report.core.numbers import number, prefixed, with_unit
from rotor_mbs.report.pages import claim_study, glance
from rotor_mbs.report.pages import claims as claim_tables
from rotor_mbs.report.pages.scene_tables import horizon, metric, status_cell, status_text
from rotor_mbs.store.read import OpenResults, StoredRun, StoredScene
from rotor_mbs.store.records import Record

# Attributes of a results file that say what made it.
_VERSIONS = ("rotor_mbs", "python", "exudyn", "heyoka", "numpy", "scipy", "h5py", "platform", "cpu", "created")


def index_page(
    results: OpenResults, scenes: Mapping[str, StoredScene], files: Mapping[str, str], claims: Sequence[Claim],
    conditions: Mapping[str, str], errata: Sequence[Erratum], *, study: ClaimStudy | None = None,
    curves: Mapping[str, Sequence[Record]] | None = None,
) -> dict[str, object]:  # fmt: skip
    """scenes: in order; files: the file name of each scene's page; errata: empty where there is no such page.

    study: the claims on many runs, and the numbers under other conditions; None where there is none
    curves: error against run time, by scene
    """
    shares = None if study is None else study.shares
    trials = [] if study is None else claim_study.trial_tables(study.numbers)[:1]
    notes = [] if shares is None else [claim_study.study_note(shares)]
    general = [text for key, text in conditions.items() if not key.startswith("fig")]
    facts = finding(scenes, claims)
    return {
        "glance": glance.glance(scenes, files, claims, curves or {}, facts),
        "finding": finding_sentences(facts, study if _has_all(claims, shares) else None),
        "scenes": Section(tables=[scene_table(scenes, files)]),
        "numbers": Section(tables=[claim_tables.number_table(claims), *trials], notes=general),
        "claims": Section(tables=[claim_tables.claim_table(claims, shares)], notes=notes),
        "errata": Section(tables=[_errata_table(errata)]),
        "versions": versions(results.attributes),
        "is_paper": bool(claims),
    }


def _has_all(claims: Sequence[Claim], shares: ClaimShares | None) -> bool:
    """Whether the file has the runs of every claim in words that was studied."""
    return shares is not None and {claim.published.id for claim in claims} >= set(shares.claims)


def versions(attributes: Mapping[str, object]) -> list[tuple[str, str]]:
    """(what, version) of the programs and the computer that made a file."""
    return [(name, str(attributes[name])) for name in _VERSIONS if attributes.get(name)]


def scene_table(scenes: Mapping[str, StoredScene], files: Mapping[str, str]) -> PageTable:
    """A row per scene: its horizon, the printed model's departure, the errors of the corrected models."""
    corrected = run_selection.in_catalogue_order(
        dict.fromkeys(name for scene in scenes.values() for name in run_selection.corrected_runs(scene))
    )
    head = ["Scene", "Figure", "Horizon", "As printed, ode45", "departs by (rad, whole run)", "energy gain"]
    for name in corrected:
        head += [f"{with_capital(label_of(name))}: angle error (rad)", "energy drift"]
    rows = []
    for name, scene in scenes.items():
        cells = [
            TableCell(name, href=files[name], note=scene.title),
            str(scene.attributes.get("figures", "")),
            with_unit(horizon(scene), "s", 3),
            *_printed_cells(scene.methods.get(run_selection.PRINTED)),
        ]
        rows.append([*cells, *(cell for method in corrected for cell in _corrected_cells(scene.methods.get(method)))])
    caption = "Angle errors are the largest up to the horizon, against the quad-precision reference"
    return PageTable(caption, head, rows, numeric=[2, *range(4, len(head))]).without_empty_columns()


def _printed_cells(run: StoredRun | None) -> Row:
    if run is None:
        return ["", "", ""]
    gain = prefixed(metric(run, "energy_gain_J"), "J")
    return [status_cell(run), number(metric(run, "angle_error_whole")), gain]


def _corrected_cells(run: StoredRun | None) -> Row:
    """Error and drift; the status in place of the error, and the error below it, where the run is not ok."""
    if run is None:
        return ["", ""]
    error, drift = number(metric(run, "angle_error_max")), number(metric(run, "energy_drift_max"))
    if run.status == "ok":
        return [error, drift]
    return [TableCell(status_text(run.status), tone="bad", note=error), drift]


def _errata_table(errata: Sequence[Erratum]) -> PageTable:
    rows = [
        (TableCell(e.id, href=f"errata.html#{e.id}"), ", ".join(e.stands_in), e.printed, e.right, e.reason)
        for e in errata
    ]
    caption = "The errors in the printed equations; all else follows from them"
    return PageTable(caption, ("Erratum", "Equation", "Printed", "Correct", "Reason"), rows)


def finding_sentences(facts: Finding, study: ClaimStudy | None = None) -> list[str]:
    """A few sentences: what is reproduced, which claims hold, what is wrong in print, how corrected models agree."""
    claims = "" if study is None else claim_study.headline(study.shares)
    numbers = "" if study is None or facts.numbers is None else claim_study.numbers_headline(study.numbers)
    sentences = [
        _reproduced(facts, with_claims=not claims),
        numbers,
        claims,
        _printed_energy(facts.energy),
        _agreement(facts.agreement),
    ]
    return [sentence for sentence in sentences if sentence]


def _reproduced(facts: Finding, *, with_claims: bool) -> str:
    numbers, printed, corrected = facts.numbers, facts.claims_printed, facts.claims_corrected
    if numbers is None:
        tallies = [(printed, "printed"), (corrected, "corrected")]
        parts = [f"{_share(tally)} hold in the {model} model" for tally, model in tallies if tally is not None]
        return f"Of the paper's claims that this file can decide {' and '.join(parts)}." if parts else ""
    text = (
        f"{_share(numbers)} published number{'' if numbers.of == 1 else 's'} {'is' if numbers.count == 1 else 'are'} "
        "reproduced to every printed digit by integrating the equations as they are printed"
    )
    if facts.reproduced:
        text += f": {'; '.join(map(_condition, facts.reproduced))}"
    if facts.numbers_corrected is not None:
        text += f". The corrected model reproduces {facts.numbers_corrected.count or 'none'}"
    if with_claims and printed is not None and corrected is not None:
        text += (
            f"; of the paper's claims in words {_share(printed)} hold in the printed model, {_share(corrected)} in the "
            "corrected model"
        )
    return f"{text}."


def _condition(one: Reproduced) -> str:
    """ "that of Fig. 11 with g = 9.8 m/s² and 10 s"."""
    what = f"{'that' if one.count == 1 else f'the {one.count}'} of Fig. {one.figure}"
    gravity = "" if one.gravity is None else f"g = {number(one.gravity)} m/s² and "
    note = f" ({claim_tables.ROUNDING})" if one.rounding else ""
    return f"{what} with {gravity}{with_unit(one.duration, 's')}{note}"


def _printed_energy(energy: PrintedEnergy | None) -> str:
    if energy is None:
        return ""
    text = "Three errors in the printed matrices (E1, E2, E3) make the printed model inconsistent in energy: "
    if not energy.rises.count:
        where = "this scene" if energy.rises.of == 1 else "these scenes"
        return f"{text}but its energy does not rise noticeably in {where}."
    rises, of = energy.rises.count, energy.rises.of
    where = f"{rises} of {of} scene{'' if of == 1 else 's'}"
    text += f"its energy rises without work done, by more than a thousandth of its scale in {where}"
    if energy.scene:
        text += f", among the runs that reach the end by up to {prefixed(energy.gain, 'J')}"
    if energy.ended_early:
        text += f", and in {len(energy.ended_early)} it diverges until ode45 stops"
    return f"{text}."


def _agreement(found: Sequence[Agreement]) -> str:
    known = [agreement for agreement in found if agreement.angle_error is not None]
    if not known:
        return ""
    models = len({agreement.method.partition("/")[0] for agreement in known})
    counts = {1: "One corrected model agrees", 2: "Two corrected models agree", 3: "Three corrected models agree"}
    errors = [f"{with_unit(a.angle_error, 'rad')} ({label_of(a.method)})" for a in known]
    listed = errors[0] if len(errors) == 1 else f"{', '.join(errors[:-1])} and {errors[-1]}"
    text = counts.get(models, f"{models} corrected models agree")
    if models > 1:
        text = text.replace(" agree", ", which share nothing but the raw data, agree")
    text += (
        f" with the quad-precision reference to within {listed} up to each scene's horizon, where an initial error has "
        "grown up to 100 000-fold"
    )
    drifts = [a.energy_drift for a in known if a.energy_drift is not None]
    if drifts:
        text += f", and conserve{'s' if models == 1 else ''} energy to {number(max(drifts))} of its scale or better"
    failed = sum(a.runs.of - a.runs.count for a in found)
    if failed:
        text += f"; {failed} of {sum(a.runs.of for a in found)} of their runs are not ok and are left out here"
    return f"{text}."


def _share(tally: Tally) -> str:
    return f"{tally.count} of {tally.of}"
