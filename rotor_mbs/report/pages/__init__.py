"""One module per page: a report's data to the content of the page. Here what several pages have: the report itself,
cells and tables of stored runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property

from rotor_mbs.analysis import published
from rotor_mbs.analysis.judgement import OK_ERROR
from rotor_mbs.analysis.published import ClaimStudy, Erratum, Published, claims
from rotor_mbs.analysis.work_precision import by_scene
from rotor_mbs.methods.catalogue import PRINTED, REFERENCE, errata_methods, is_corrected, look_up
from rotor_mbs.report.elements import PageTable, Row, TableCell
from rotor_mbs.report.files import page_names
from rotor_mbs.report.looks import label_of, with_capital
from rotor_mbs.report.numbers import number, with_unit
from rotor_mbs.runs.design import metric_columns
from rotor_mbs.runs.read import OpenResults, Record, StoredRun, StoredScene, read_records
from rotor_mbs.solution.status import GOOD
from rotor_mbs.studies.stability import OUTCOMES, SUITE, SuiteRun, suite_runs


class Report(OpenResults):
    """An open results file, and what its pages show of it. What no page asks for is not read."""

    @cached_property
    def is_suite(self) -> bool:
        """Whether the file is of the stability suite: it has ladders of steps, or all its scenes are of the suite."""
        folders = {name.partition("/")[0] for name, scene in self.scenes.items() if scene.methods}
        return bool(read_records(self.path, "stability")) or (bool(folders) and folders <= {*SUITE})

    @cached_property
    def files(self) -> Mapping[str, str]:
        """The file of each scene's page, in order."""
        return page_names(name for name, scene in self.scenes.items() if scene.methods or not self.is_suite)

    @cached_property
    def claims(self) -> Sequence[Published]:
        """Of the paper, about these scenes."""
        return claims(self.scenes)

    @cached_property
    def conditions(self) -> Mapping[str, str]:
        """What the paper does not print."""
        return published.conditions() if self.claims else {}

    @cached_property
    def study(self) -> ClaimStudy | None:
        """The claims on many runs."""
        return published.claim_study() if self.claims else None

    @cached_property
    def errata(self) -> Sequence[Erratum]:
        """Empty where no run is of equations that have them."""
        printed = {PRINTED, *errata_methods().values()}
        return published.errata() if any(printed & {*scene.runs} for scene in self.scenes.values()) else ()

    @cached_property
    def curves(self) -> Mapping[str, Sequence[Record]]:
        """Error and run time, by scene."""
        return by_scene(read_records(self.path, "bench"))

    @cached_property
    def suite_runs(self) -> Sequence[SuiteRun]:
        return suite_runs(self.path) if self.is_suite else ()


METRICS = (
    "defect_max", "defect_median", "defect_time", "angle_error_max", "angle_error_predicted", "angle_error_whole",
    "tip_error_max", "energy_gain_J", "energy_drift_max", "angular_impulse_error_max",
    "zero_pitch_max", "zero_pitch_left_s", "zero_pitch_growth_per_s", "time_reached", "steps",
    "rhs_evaluations", "setup_time_s", "run_time_s",
)  # fmt: skip
# Against the reference, which has none itself.
_ERRORS_OF_RUNS = ("angle_error_max", "angle_error_predicted", "angle_error_whole", "tip_error_max")


def status_text(run: StoredRun) -> str:
    """ "solver failed" of "solver_failed"; of equations that are not claimed to be correct never "ok"."""
    return words_of("completed" if run.status == "ok" and not is_corrected(run.method) else run.status)


def words_of(status: str) -> str:
    return status.replace("_", " ")


def status_cell(run: StoredRun, suite_run: SuiteRun | None = None) -> TableCell:
    """The status, and below it the reason where it is not ok; of a run of the suite also what its ladder found."""
    text, message = status_text(run), str(run.attributes.get("message", ""))
    tone = "good" if text == "ok" else "" if run.status in GOOD else "bad"
    if suite_run is not None and suite_run.outcome != run.status:
        text, message = OUTCOMES[suite_run.outcome][1], suite_run.message
        if suite_run.step is not None:
            message += f"; step for 10⁻⁶ rad: {with_unit(suite_run.step, 's')}"
    return TableCell(text, tone, note="" if text == "ok" else message)


def method_cell(name: str) -> TableCell | str:
    """A method's label, and below it the name that the command line and the file have."""
    label = label_of(name)
    return label if label == name else TableCell(label, note=name)


def run_cell(run: StoredRun) -> TableCell | str:
    """A run's method, and below it the settings that are not the method's defaults."""
    method = look_up(run.method)
    defaults = {} if method is None else method.defaults
    own = [f"{name} = {value}" for name, value in run.settings.items() if defaults.get(name, value) != value]
    note = ", ".join([run.method, *own])
    return TableCell(label_of(run.method), note=note) if own else method_cell(run.method)


def metric(run: StoredRun, name: str) -> float | None:
    """A number stored with the run; None where it has none."""
    value = run.attributes.get(name)
    return float(value) if isinstance(value, float | int) else None


def horizon_of(scene: StoredScene) -> float | None:
    """s; None where no run was compared with a reference."""
    known = [metric(run, "horizon_s") for run in scene.runs.values()]
    return next((value for value in known if value is not None), None)


def compared_time(scenes: Iterable[StoredScene]) -> tuple[float, float]:
    """s: how much of the scenes' time lies before their horizons, and how much they have in all."""
    compared = whole = 0.0
    for scene in scenes:
        if scene.reference is not None and scene.reference.samples:
            end = float(scene.reference.array("time")[-1])
            whole += end
            compared += min(horizon_of(scene) or 0.0, end)
    return compared, whole


def metrics_table(scene: StoredScene, suite_runs: Sequence[SuiteRun] = ()) -> PageTable:
    """Every run of the scene: how it ended, and the metrics that its file describes."""
    of_suite = {run.method: run for run in suite_runs}
    columns = metric_columns(scene.scene.outputs)
    judged = [name for name in columns if name.endswith("_error_max") and name not in METRICS]
    shown = {name: columns[name] for name in (*METRICS, *judged) if name in columns}
    rows: list[Row] = []
    for run in scene.runs.values():
        row = [run_cell(run), status_cell(run, of_suite.get(run.method))]
        for name in shown:
            value = metric(run, name)
            is_over = name == "angle_error_max" and value is not None and not value <= OK_ERROR
            if run.method == REFERENCE and name in _ERRORS_OF_RUNS:
                row.append("")
            else:
                row.append(TableCell(number(value, 3), tone="bad" if is_over and is_corrected(run.method) else ""))
        rows.append(row)
    names = []
    for name, column in shown.items():
        unit = f"{column.units}, at most {OK_ERROR:g}" if name == "angle_error_max" else column.units
        names.append(with_capital(column.long_name.partition("; -1")[0]) + (f" ({unit})" if unit != "1" else ""))
    return PageTable("", ("Method", "Status", *names), rows)
