"""The index: the finding, the paper's numbers and claims, one table over all scenes. Knows no HTML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rotor_mbs.analysis import methods
from rotor_mbs.analysis.claims import Claim
from rotor_mbs.analysis.published import Erratum
from rotor_mbs.analysis.summary import finding
from rotor_mbs.report import texts
from rotor_mbs.report.core.elements import Cell, Section, Table, without_empty_columns
from rotor_mbs.report.core.environment import IndexPage
from rotor_mbs.report.core.numbers import number, prefixed, quantity
from rotor_mbs.report.names import name_of
from rotor_mbs.report.pages import claims as claim_tables
from rotor_mbs.report.pages import scene_tables as metrics
from rotor_mbs.store.read import Results, StoredRun, StoredScene

# Of the file's attributes, those that say what made it.
_MACHINE = ("rotor_mbs", "python", "exudyn", "heyoka", "numpy", "scipy", "h5py", "platform", "cpu", "created")


def index_page(
    results: Results,
    scenes: Mapping[str, StoredScene],
    files: Mapping[str, str],
    claims: Sequence[Claim],
    conditions: Mapping[str, str],
    errata: Sequence[Erratum],
    *,
    has_walk: bool = False,
) -> IndexPage:
    """scenes: in order; files: each scene's page; errata: empty where the report has no such page."""
    has_numbers = any(claim.published.is_number for claim in claims)
    sections = [
        Section("scenes", texts.SCENES, tables=[scene_table(scenes, files)], notes=[texts.HORIZON_NOTE]),
        Section("numbers", texts.NUMBERS, tables=[claim_tables.number_table(claims)], notes=[texts.QUOTE_NOTE]),
        Section("claims", texts.CLAIMS, tables=[claim_tables.claim_table(claims)]),
        Section("errata", texts.ERRATA, tables=[_errata_table(errata)]),
    ]
    if has_numbers:
        sections[1] = Section(
            "numbers", texts.NUMBERS, tables=sections[1].tables,
            notes=[texts.QUOTE_NOTE, *claim_tables.general_conditions(conditions)],
        )  # fmt: skip
    machine = [(name, str(results.attributes[name])) for name in _MACHINE if results.attributes.get(name)]
    return IndexPage(
        texts.finding(finding(scenes, claims)),
        [section for section in sections if section.has_content],
        machine,
        has_errata=bool(errata),
        is_paper=bool(claims),
        has_walk=has_walk,
    )


def scene_table(scenes: Mapping[str, StoredScene], files: Mapping[str, str]) -> Table:
    """A row per scene: how long it can be compared, what the printed model does, how near the right ones are."""
    right = sorted(
        dict.fromkeys(name for scene in scenes.values() for name in methods.right_runs(scene)),
        key=lambda name: (methods.RIGHT_MODELS.index(methods.model_of(name)), name),
    )
    head = [
        texts.SCENE, texts.FIGURE, texts.HORIZON_COLUMN,
        texts.PRINTED_STATUS, texts.PRINTED_DEPARTS, texts.PRINTED_GAIN,
    ]  # fmt: skip
    for name in right:
        head += [texts.error_column(name_of(name)), texts.DRIFT_COLUMN]
    rows = [_scene_row(scene, files[name], right) for name, scene in scenes.items()]
    return without_empty_columns(Table(texts.SCENES_CAPTION, head, rows, numeric=[2, *range(4, len(head))]))


def _scene_row(scene: StoredScene, file: str, right: Sequence[str]) -> list[Cell]:
    printed = scene.methods.get(methods.PRINTED)
    cells = [
        Cell(scene.name, href=file, note=scene.title),
        Cell(str(scene.attributes.get("figures", ""))),
        Cell(quantity(metrics.horizon(scene), "s", 3)),
        *_printed_cells(printed),
    ]
    for name in right:
        cells += _right_cells(scene.methods.get(name))
    return cells


def _printed_cells(run: StoredRun | None) -> list[Cell]:
    if run is None:
        return [Cell(""), Cell(""), Cell("")]
    departs, gain = metrics.metric(run, "angle_error_whole"), metrics.metric(run, "energy_gain_J")
    return [metrics.status_cell(run), Cell(number(departs)), Cell(prefixed(gain, "J"))]


def _right_cells(run: StoredRun | None) -> list[Cell]:
    """Error and drift; where the run is not ok, its status stands below the error."""
    if run is None:
        return [Cell(""), Cell("")]
    error, drift = metrics.metric(run, "angle_error_max"), metrics.metric(run, "energy_drift_max")
    if run.status == "ok":
        return [Cell(number(error)), Cell(number(drift))]
    return [Cell(texts.status(run.status), tone="bad", note=number(error)), Cell(number(drift))]


def _errata_table(errata: Sequence[Erratum]) -> Table:
    head = (texts.ERRATUM, texts.EQUATION, texts.PRINTED, texts.RIGHT, texts.BECAUSE)
    rows = [
        [
            Cell(one.id, href=f"errata.html#{one.id}"), Cell(", ".join(one.stands_in)), Cell(one.printed),
            Cell(one.right), Cell(one.reason),
        ]
        for one in errata
    ]  # fmt: skip
    return Table(texts.ERRATA_CAPTION, head, rows)
