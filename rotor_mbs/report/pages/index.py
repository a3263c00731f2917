"""The index: the finding, the paper's numbers and claims, one table over all scenes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rotor_mbs.analysis import run_selection
from rotor_mbs.analysis.claim_records import ClaimStudy
from rotor_mbs.analysis.claims import Claim
from rotor_mbs.analysis.finding import finding
from rotor_mbs.analysis.published import Erratum
from rotor_mbs.report.core.elements import PageTable, Row, Section, TableCell
from rotor_mbs.report.core.numbers import number, prefixed, with_unit
from rotor_mbs.report.pages import claim_study, glance
from rotor_mbs.report.pages import claims as claim_tables
from rotor_mbs.report.pages.scene_tables import horizon, metric, status_cell
from rotor_mbs.store.read import OpenResults, StoredScene
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
    notes = [] if shares is None else [claim_study.headline(shares), claim_study.study_note(shares)]
    general = [text for key, text in conditions.items() if not key.startswith("fig")]
    general += [] if study is None else [claim_study.numbers_headline(study.numbers)]
    return {
        "glance": glance.glance(scenes, files, claims, curves or {}, finding(scenes, claims)),
        "scenes": Section(tables=[scene_table(scenes, files)]),
        "numbers": Section(tables=[claim_tables.number_table(claims), *trials], notes=general),
        "claims": Section(tables=[claim_tables.claim_table(claims, shares)], notes=notes),
        "errata": Section(tables=[_errata_table(errata)]),
        "versions": versions(results.attributes),
        "is_paper": bool(claims),
    }


def versions(attributes: Mapping[str, object]) -> list[tuple[str, str]]:
    """(what, version) of the programs and the computer that made a file."""
    return [(name, str(attributes[name])) for name in _VERSIONS if attributes.get(name)]


def scene_table(scenes: Mapping[str, StoredScene], files: Mapping[str, str]) -> PageTable:
    """A row per scene: its horizon, and what the printed model does."""
    head = ("Scene", "Figure", "Horizon", "As printed, ode45", "departs by (rad, whole run)", "energy gain")
    rows: list[Row] = []
    for name, scene in scenes.items():
        cells: list[TableCell | str] = [str(scene.attributes.get("figures", "")), with_unit(horizon(scene), "s", 3)]
        run = scene.methods.get(run_selection.PRINTED)
        if run is not None:
            gain = prefixed(metric(run, "energy_gain_J"), "J")
            cells += [status_cell(run), number(metric(run, "angle_error_whole")), gain]
        rows.append([TableCell(name, href=files[name], note=scene.title), *cells, *[""] * (len(head) - 1 - len(cells))])
    return PageTable("", head, rows, numeric=(2, 4, 5)).without_empty_columns()


def _errata_table(errata: Sequence[Erratum]) -> PageTable:
    rows = [
        (TableCell(e.id, href=f"errata.html#{e.id}"), ", ".join(e.stands_in), e.printed, e.right, e.reason)
        for e in errata
    ]
    caption = "The errors in the printed equations; all else follows from them"
    return PageTable(caption, ("Erratum", "Equation", "Printed", "Correct", "Reason"), rows)
