"""Turn stored data into the content of pages, one module per page.

This module has the parts that several pages share: the open report, and cells, tables and sentences
about stored runs.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import cached_property

import numpy as np
from markupsafe import Markup

from rotor_mbs.analysis import published
from rotor_mbs.analysis.published import ClaimStudy, Erratum, Published, claims, rounds_to
from rotor_mbs.analysis.work_precision import by_scene
from rotor_mbs.methods.catalogue import (
    PRINTED,
    REFERENCE,
    errata_methods,
    find_method_or_none,
    is_corrected,
)
from rotor_mbs.report.elements import Array, PageTable, Row, TableCell
from rotor_mbs.report.files import INDEX, page_names
from rotor_mbs.report.looks import label_of, with_capital
from rotor_mbs.report.numbers import NOTHING, in_words, number, seconds, up_to, with_unit
from rotor_mbs.runs.design import metric_columns
from rotor_mbs.runs.read import OpenResults, Record, StoredRun, StoredScene, read_records
from rotor_mbs.solution.status import GOOD, OK_ERROR
from rotor_mbs.studies.stability import OUTCOMES, SUITE, SuiteRun, suite_runs


class Report(OpenResults):
    """An open results file with the data that several pages of its report show.

    Each property is computed when a page first reads it.
    """

    @cached_property
    def is_suite(self) -> bool:
        """Return whether the file has the runs of the stability suite.

        This is the case if the file has ladders of steps, or if all its scenes with methods belong
        to the suite.
        """
        folders = {name.partition("/")[0] for name, scene in self.scenes.items() if scene.methods}
        return bool(read_records(self.path, "stability")) or (bool(folders) and folders <= {*SUITE})

    @cached_property
    def files(self) -> Mapping[str, str]:
        """Return the file names of the scenes' pages by scene, in the order of the pages.

        If the results file has a single scene, and is not of the stability suite, the scene's page
        is the index.
        """
        names = [name for name, scene in self.scenes.items() if scene.methods or not self.is_suite]
        if len(names) == 1 and not self.is_suite:
            return {names[0]: INDEX}
        return page_names(names)

    @cached_property
    def claims(self) -> Sequence[Published]:
        """Return the paper's published numbers and claims about these scenes."""
        return claims(self.scenes)

    @cached_property
    def conditions(self) -> Mapping[str, str]:
        """Return conditions that the paper's numbers depend on, but that the paper does not print.

        The conditions are texts by subject or scene. The mapping is empty if there are no claims
        about the scenes of the file.
        """
        return published.conditions() if self.claims else {}

    @cached_property
    def study(self) -> ClaimStudy | None:
        """Return the verdicts on the paper's claims; None if no claim is about these scenes.

        The verdicts come from many runs with slightly changed initial states, not from this file.
        """
        return published.claim_study() if self.claims else None

    @cached_property
    def errata(self) -> Sequence[Erratum]:
        """Return the errors in the printed equations; none if no run of the file has them."""
        printed = {PRINTED, *errata_methods().values()}
        return (
            published.errata()
            if any(printed & {*scene.runs} for scene in self.scenes.values())
            else ()
        )

    @cached_property
    def curves(self) -> Mapping[str, Sequence[Record]]:
        """Return the curves of error over run time that `rotor-mbs bench` stored, by scene."""
        return by_scene(read_records(self.path, "bench"))

    @cached_property
    def suite_runs(self) -> Sequence[SuiteRun]:
        """Return the runs of the stability suite; none if the file is not of the suite."""
        return suite_runs(self.path) if self.is_suite else ()


METRICS = (
    "angle_error_max",
    "angle_error_whole",
    "angle_error_predicted",
    "defect_max",
    "defect_median",
    "defect_time",
    "tip_error_max",
    "energy_gain_J",
    "energy_drift_max",
    "constraint_error_max",
    "zero_pitch_max",
    "zero_pitch_left_s",
    "zero_pitch_growth_per_s",
    "time_reached",
    "steps",
    "rhs_evaluations",
    "run_time_s",
    "setup_time_s",
)
# Metrics that compare a run with the reference. They are not shown for the reference itself.
_ERRORS_OF_RUNS = ("angle_error_max", "angle_error_predicted", "angle_error_whole", "tip_error_max")
# If the ratio of the largest to the smallest value is above this number, an axis is logarithmic.
_SPAN = 30.0
_METHODS_IN_A_TABLE = 8  # number of columns for which a page of 1440 px has room


def status_text(run: StoredRun) -> str:
    """Return the status of a run in words: "solver failed" for "solver_failed".

    A run of equations that are not claimed to be correct is never "ok". It is "completed" instead.
    """
    return words_of(
        "completed" if run.status == "ok" and not is_corrected(run.method) else run.status
    )


def words_of(status: str) -> str:
    """Return a status in words: "timed out" for "timed_out"."""
    return status.replace("_", " ")


def status_cell(run: StoredRun, suite_run: SuiteRun | None = None) -> TableCell:
    """Return a cell with the status of a run, and with the reason if the run is not ok.

    Parameters
    ----------
    run : the stored run.
    suite_run : the outcome of the same run in the stability suite; None if the file is not of the
        suite. If the outcome differs from the status, the cell has the outcome.
    """
    text, message = status_text(run), str(run.attributes.get("message", ""))
    tone = "good" if text == "ok" else "" if run.status in GOOD else "bad"
    if suite_run is not None and suite_run.outcome != run.status:
        text, message = OUTCOMES[suite_run.outcome][1], suite_run.message
        if suite_run.step is not None:
            message += f"; step for 10⁻⁶ rad: {with_unit(suite_run.step, 's')}"
    if text == "ok":
        return TableCell("✓ ok", tone)
    return TableCell(text, tone, note=message)


def method_cell(name: str) -> TableCell | str:
    """Return a cell with the label of a method.

    Below the label is the method's name, which the command line and the file have.
    """
    label = label_of(name)
    return label if label == name else TableCell(label, note=name)


def run_cell(run: StoredRun) -> TableCell | str:
    """Return a cell with the label of a run's method.

    Below the label are the method's name and the settings that differ from its defaults.
    """
    method = find_method_or_none(run.method)
    defaults = {} if method is None else method.defaults
    own = [
        f"{name} = {value}"
        for name, value in run.settings.items()
        if defaults.get(name, value) != value
    ]
    note = ", ".join([run.method, *own])
    return TableCell(label_of(run.method), note=note) if own else method_cell(run.method)


def metric(run: StoredRun, name: str) -> float | None:
    """Return a metric of a stored run; None if the run does not have it."""
    value = run.attributes.get(name)
    return float(value) if isinstance(value, float | int) else None


def number_cell(value: float | None, tone: str = "") -> TableCell:
    """Return a cell with a number, by which its column is sorted.

    Parameters
    ----------
    value : the number; None gives a dash.
    tone : tone of the cell; see `TableCell`.
    """
    order = value if value is not None and math.isfinite(value) else None
    return TableCell(number(value), tone, order=order)


def horizon_of(scene: StoredScene) -> float | None:
    """Return the scene's horizon in s; None if no run was compared with a reference."""
    known = [metric(run, "horizon_s") for run in scene.runs.values()]
    return next((value for value in known if value is not None), None)


def compared_time(scenes: Iterable[StoredScene]) -> tuple[float, float]:
    """Return two sums over scenes, in s: the compared time, and the whole time.

    The compared time of a scene ends at its horizon. Scenes without a reference are left out of
    both sums.
    """
    compared = whole = 0.0
    for scene in scenes:
        if scene.reference is not None and scene.reference.samples:
            end = float(scene.reference.array("time")[-1])
            whole += end
            compared += min(horizon_of(scene) or 0.0, end)
    return compared, whole


def is_wide(values: Array) -> bool:
    """Return whether an axis for these values should be logarithmic.

    It should if all finite values are positive and the largest is more than 30 times the smallest.
    """
    known = values[np.isfinite(values)]
    return bool(len(known)) and bool(known.min() > 0.0) and bool(known.max() > _SPAN * known.min())


def models_of(methods: Collection[str]) -> int:
    """Return the number of different models to which these methods belong."""
    return len({method.partition("/")[0] for method in methods})


def computations(methods: Collection[str]) -> str:
    """Return the subject of a sentence on agreement: the number of methods, and of their models.

    The subject for a single method is its label. Methods of different models are independent.

    >>> computations(["lagrange/taylor", "exudyn_tree/rk67"])
    'two independent computations'
    >>> computations(["lagrange/taylor", "lagrange/dop853", "exudyn_tree/rk67"])
    'three methods of two independent models'
    """
    count, models = len(methods), models_of(methods)
    if count == 1:
        return f"{label_of(next(iter(methods)))}"
    if models == count:
        return f"{in_words(count)} independent computations"
    if models == 1:
        return f"{in_words(count)} methods of one model"
    return f"{in_words(count)} methods of {in_words(models)} independent models"


def agreement(scene: StoredScene) -> tuple[list[str], float | None]:
    """Return the corrected methods of a scene that are ok, and the largest of their angle errors.

    Methods that were not compared with a reference are left out. The error (rad) is the largest one
    up to the horizon. It is None if no method is left.
    """
    errors: dict[str, float] = {}
    for name, run in scene.corrected_runs.items():
        error = metric(run, "angle_error_max")
        if run.status == "ok" and error is not None:
            errors[name] = error
    return list(errors), max(errors.values(), default=None)


def agreement_of_scenes(scenes: Iterable[StoredScene]) -> tuple[list[str], float | None, int]:
    """Return how well the corrected methods agree over several scenes.

    A scene counts as compared if one of its corrected methods is ok and was compared with a
    reference.

    Parameters
    ----------
    scenes : the scenes. Scenes that do not count as compared are left out.

    Returns
    -------
    methods : list of str
        Names of the methods that are ok in every compared scene.
    error : float or None
        Largest angle error of all runs that are ok, rad; None if no scene was compared.
    count : int
        Number of compared scenes.
    """
    common: list[str] = []
    errors: list[float] = []
    for scene in scenes:
        methods, error = agreement(scene)
        if error is not None:
            common = [name for name in common if name in methods] if errors else methods
            errors.append(error)
    return common, max(errors, default=None), len(errors)


def agree_within(methods: Sequence[str], error: float, digits: int = 1) -> Markup:
    """Return a clause such as "three independent computations agree within 2×10⁻⁶ rad".

    Parameters
    ----------
    methods : names of the methods that agree. If there is one, the clause says that it agrees with
        the reference. If there is none, the subject of the clause is "all runs that are ok".
    error : largest angle error, rad. It is rounded up.
    digits : number of digits of the error.
    """
    within = (
        Markup("<b>exactly</b>")
        if error == 0.0
        else Markup("within <b>{} rad</b>").format(up_to(error, digits))
    )
    subject = computations(methods) if methods else "all runs that are ok"
    verb = "agrees with the reference" if len(methods) == 1 else "agree"
    return Markup("{} {} {}").format(subject, verb, within)


def reproduced(numbers: Iterable[Published]) -> tuple[int, int]:
    """Return how many published numbers are reproduced by the printed and by the corrected model.

    A number is reproduced if the computed value, rounded to the published decimals, equals it.

    Parameters
    ----------
    numbers : published numbers with the computed values of both models.
    """
    printed = corrected = 0
    for claim in numbers:
        printed += claim.printed is not None and rounds_to(claim.printed, claim)
        corrected += claim.corrected is not None and rounds_to(claim.corrected, claim)
    return printed, corrected


def numbers_sentence(claims: Iterable[Published]) -> Markup:
    """Return a sentence on which model reproduces the paper's numbers; "" if there is no number.

    Parameters
    ----------
    claims : numbers and claims of the paper. Claims in words are ignored.
    """
    numbers = [claim for claim in claims if claim.is_number]
    if not numbers:
        return Markup()
    printed, corrected = reproduced(numbers)
    if printed == len(numbers) and corrected == 0:
        text = (
            "All {} numbers that the paper publishes come out of the printed equations and none "
            "out of the "
        )
        text += "corrected ones: its curves show the errors, not the rotor."
        return Markup(text).format(in_words(len(numbers)))
    text = (
        "Of {} numbers that the paper publishes <b>{}</b> come out of the printed equations and "
        "<b>{}</b> out of "
    )
    text += "the corrected ones."
    words = [in_words(count) if count else "none" for count in (printed, corrected)]
    return Markup(text).format(in_words(len(numbers)), *words)


def agreement_text(scene: StoredScene) -> Markup:
    """Return a sentence on how well a scene's corrected methods agree.

    The sentence is "" if no corrected method is ok and was compared with a reference.
    """
    methods, error = agreement(scene)
    if error is None:
        return Markup()
    compared, whole = compared_time([scene])
    until = "" if compared >= whole else f" up to {seconds(compared)}"
    return Markup("{}{}.").format(Markup(with_capital(agree_within(methods, error))), until)


def agreement_table(scene: StoredScene, suite_runs: Sequence[SuiteRun] = ()) -> PageTable:
    """Return a table of the status, errors and run time of each run of a scene.

    Parameters
    ----------
    scene : the scene; each of its runs is a row.
    suite_runs : outcomes of the same runs in the stability suite; empty if the file is not of the
        suite.
    """
    of_suite = {run.method: run for run in suite_runs}
    rows: list[Row] = []
    for run in scene.runs.values():
        row = [run_cell(run), status_cell(run, of_suite.get(run.method))]
        for name in ("angle_error_max", "defect_max", "energy_drift_max", "run_time_s"):
            value = metric(run, name)
            if run.method == REFERENCE and name == "angle_error_max":
                row.append(NOTHING)
                continue
            is_over = name == "angle_error_max" and value is not None and not value <= OK_ERROR
            row.append(
                number_cell(value, tone="bad" if is_over and is_corrected(run.method) else "")
            )
        rows.append(row)
    head = (
        "Method",
        "Status",
        "Largest angle error up to the horizon (rad)",
        "Largest interval defect (rad)",
        "Energy error / energy scale",
        "Run time (s)",
    )
    return PageTable("Runs of this scene", head, rows, wide=(3, 5), sortable=True)


def metrics_tables(scene: StoredScene) -> list[PageTable]:
    """Return tables of the metrics of all runs of a scene: a row per metric, a column per run.

    There are several tables if the runs do not fit the width of a page. A metric that no run of a
    table has is left out of this table.

    Parameters
    ----------
    scene : the scene.
    """
    columns = metric_columns(scene.scene.outputs)
    judged = [
        name for name in columns if name.endswith(("_error_max", "_error")) and name not in METRICS
    ]
    names = [name for name in (*METRICS, *judged) if name in columns]
    runs = list(scene.runs.values())
    tables = []
    for first in range(0, len(runs), _METHODS_IN_A_TABLE):
        shown = runs[first : first + _METHODS_IN_A_TABLE]
        rows: list[Row] = []
        for name in names:
            unit = "" if columns[name].units == "1" else f" ({columns[name].units})"
            row: list[TableCell | str] = [
                with_capital(columns[name].long_name.partition("; -1")[0]) + unit
            ]
            for run in shown:
                is_its_own = run.method == REFERENCE and name in _ERRORS_OF_RUNS
                value = None if is_its_own else metric(run, name)
                is_count = columns[name].kind == "<i8" and value is not None
                row.append(str(int(value or 0)) if is_count else number(value, 3))
            if any(cell != NOTHING for cell in row[1:]):
                rows.append(row)
        tables.append(
            PageTable("All numbers of every method", ("Quantity", *map(run_cell, shown)), rows)
        )
    return tables
