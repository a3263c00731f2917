"""Results files as they are written: a row per run in the table /runs, its arrays in a table of its scene, and tables
of other studies beside them (/bench, /stability); see `table`."""

from __future__ import annotations

import functools
import json
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.methods.catalogue import REFERENCE, find_method, method_names
from rotor_mbs.runs import files, table
from rotor_mbs.runs.files import KEYWORDS, Column
from rotor_mbs.runs.table import (
    COLUMNS,
    REPEATED,
    Place,
    Rows,
    StoredTable,
    Table,
    blank_rows,
    known_columns,
    text_of,
)
from rotor_mbs.runs.versions import machine, row_versions, versions
from rotor_mbs.scenario.catalogue import natural_key
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.solution.quantities import LOADS, quantities
from rotor_mbs.solution.solution import Solution
from rotor_mbs.solution.status import STATUSES

RUNS = "runs"
# What a frozen reference stores: it cannot be computed again from angles and rates as precisely.
FROZEN = ("angles", "rates", "work", *(load.name for load in LOADS), "angle_uncertainty", "error_growth")
_OF_REFERENCE = ("angle_uncertainty", "error_growth")  # stored once a scene, over time
# What a method that is no reference says of itself under such a name: its name in the file.
OF_METHODS = {"angle_uncertainty": "own_uncertainty"}
_TEXT_LENGTH = 600  # characters of a message

_RUN_COLUMNS = (
    "status", "message", "samples", "time_reached", "time_limit_s", "steps", "rhs_evaluations", "setup_time_s",
    "run_time_s", "run_time_min_s", "output_time_s", "repeats", "engine_success", "engine_message", "false_success",
    "energy_scale_J", "energy_drift_max", "energy_gain_J", "angle_error_max", "angle_error_predicted",
    "angle_error_whole", "angle_error_end", "horizon_s", "defect_max", "defect_median", "defect_time",
    "defect_judged", "defect_mean", "defect_drift", "defect_floor", "defects_not_judged",
    "angular_impulse_error_max", "linear_impulse_error_max",
    "zero_pitch_max", "zero_pitch_left_s", "zero_pitch_growth_per_s", "rotor_angle_min", "rotor_angle_max",
    "rotor_rate_max",
)  # fmt: skip


@dataclass(frozen=True)
class Asked:
    """A run as it is asked for: a row of the design.

    versions: of what computes it, by default those of this installation; of a reference that is read from a shipped
    file also who computed it (`frozen_with`).
    """

    scene: Scene
    method: str
    settings: Mapping[str, object] = field(default_factory=dict)
    versions: Mapping[str, str] | None = None

    @property
    def is_shipped(self) -> bool:
        return self.versions is not None and "frozen_with" in self.versions

    @property
    def run(self) -> str:
        """The label of its row, "paper/fig11/lagrange/taylor"."""
        return f"{self.scene.name}/{self.method}"

    @property
    def known(self) -> dict[str, str]:
        """The columns of /runs that follow from the design."""
        method = find_method(self.method)
        settings = method.chosen(self.scene, self.settings).as_dict()
        return {
            "scene": self.scene.name,
            "method_name": self.method,
            "settings": json.dumps(settings, sort_keys=True),
            "versions": json.dumps(dict(self.versions or row_versions(method)), sort_keys=True),
            "scene_hash": scene_hash(self.scene),
        }


def metric_columns(outputs: Iterable[str]) -> dict[str, Column]:
    """The computed columns of /runs for scenes that ask for these outputs."""
    columns = {name: COLUMNS[name] for name in _RUN_COLUMNS}
    for quantity in quantities(outputs):
        if quantity.judgement is not None:
            unit = "1" if quantity.judgement.scale_of else quantity.units
            columns[quantity.judgement.metric] = Column(("run",), unit, f"largest error of {quantity.long_name}")
        if quantity.has_peak:
            columns[f"{quantity.name}_max"] = Column(("run",), quantity.units, f"largest {quantity.long_name}")
            columns[f"{quantity.name}_max_time_s"] = Column(("run",), "s", f"time of the largest {quantity.long_name}")
            if quantity.dimensions[1:2] == ("blade",):
                columns[f"{quantity.name}_max_blade"] = Column(("run",), "1", "its blade, from 1")
    return columns | {"crc32": COLUMNS["crc32"]}


def runs_table(asked: Sequence[Asked]) -> Table:
    outputs = dict.fromkeys(output for run in asked for output in run.scene.outputs)
    known = known_columns([run.known for run in asked])
    return Table(RUNS, [run.run for run in asked], known, metric_columns(outputs), characters=_TEXT_LENGTH)


def arrays_of(run: Asked) -> dict[str, Column]:
    """The arrays over time that a run stores, by their name in the file."""
    method = find_method(run.method)
    own = method.arrays(method.settings.of(run.method, run.settings))
    # A reference is read back by its angles and rates, whatever the scene asks for.
    outputs = (*run.scene.outputs, "angles", "rates") if run.method == REFERENCE else run.scene.outputs
    columns = {}
    for quantity in quantities(outputs):
        if not quantity.is_over_time or not (quantity.required or quantity.name in own):
            continue
        if quantity.name in _OF_REFERENCE and run.method == REFERENCE:
            columns[quantity.name] = Column(quantity.dimensions, quantity.units, quantity.long_name)
        else:
            name = OF_METHODS.get(quantity.name, quantity.name)
            columns[name] = Column(("run", *quantity.dimensions), quantity.units, quantity.long_name)
    return columns


def scene_table(runs: Sequence[Asked], arrays: Collection[str] | None = None) -> Table:
    """The table of the arrays of one scene's runs. arrays: names of those that are stored, by default all."""
    scene = runs[0].scene
    computed = {
        name: column for run in runs for name, column in arrays_of(run).items() if arrays is None or name in arrays
    }
    attributes = {
        "title": scene.title,
        "figures": ", ".join(scene.figures),
        "blades": len(scene.blades),
        "scene_toml": scene.text,
        "scene_hash": scene_hash(scene),
        "NX_class": "NXdata",
        "signal": "angles",
        "axes": ["run", "time", "coordinate"],
    }
    scales = table.scene_scales(scene, computed.values())
    repeated = {name: COLUMNS[name] for name in REPEATED}
    return Table(scene.name, [run.method for run in runs], scales, repeated | computed, attributes)


def results_tables(asked: Sequence[Asked]) -> list[Table]:
    asked = sorted(asked, key=lambda run: _order(run.run))
    by_scene: dict[str, list[Asked]] = {}
    for run in asked:
        by_scene.setdefault(run.scene.name, []).append(run)
    return [
        runs_table(asked),
        *(scene_table(runs) for runs in by_scene.values()),
    ]


# Making a file fit what is asked


class TableFile:
    """A file of tables whose rows are read and written by their places. Tables are read when they are asked for."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._tables: dict[str, StoredTable] = {}

    def table(self, group: str) -> StoredTable:
        """A table. Raises StoreError where the file has none of that name, or what was laid out has changed."""
        if group not in self._tables:
            with files.open_file(self.path) as file, files.reading(self.path):
                self._tables[group] = table.stored_table(file, group)
        return self._tables[group]

    @functools.cached_property
    def groups(self) -> list[str]:
        return table.table_groups(self.path)

    def place(self, run: str, group: str = RUNS) -> Place:
        """Where a row is; of a run, together with its arrays."""
        stored = self.table(group)
        row = stored.runs.tolist().index(run)
        place = stored.place(row)
        if group != RUNS:
            return place
        scene = str(stored.known["scene"][row])
        arrays = self.table(scene)
        label = run.removeprefix(f"{scene}/")
        others = arrays.place(arrays.runs.tolist().index(label))
        offsets = {REPEATED.get(name, name): offset for name, offset in others.offsets.items()}
        kinds = [(REPEATED.get(name, name), others.row[name]) for name in others.row.names or ()]
        for name, column in arrays.computed.items():
            if label == REFERENCE and not column.is_of_runs:
                offsets[name] = column.offset
                kinds.append((name, np.dtype((column.kind, column.shape))))
        own = [(name, place.row[name]) for name in place.row.names or ()]
        return replace(place, offsets={**place.offsets, **offsets}, row=np.dtype([*own, *kinds]))

    def known(self, group: str, row: int) -> dict[str, Any]:
        return {name: values[row] for name, values in self.table(group).known.items()}

    def take_back_missing(
        self, asked: Sequence[Asked], time_limit_s: float
    ) -> tuple[list[Asked], list[tuple[Asked, str, str]]]:
        """The runs that are to be computed, and those that are stored with their status and message; of `asked` runs,
        of each scene the reference first.

        To be computed are those that the file lacks, that a shorter time limit ended, or whose reference is one of
        these; what is stored of them is taken back.
        """
        missing: dict[str, Asked] = {}
        kept: list[tuple[Asked, str, str]] = []
        for run in asked:
            place = self.place(run.run)
            row = place.read()
            status = STATUSES[row["status"][0]] if place.is_stored else ""
            # A shipped reference may end early itself; it has a limit only where reading it was over one.
            limit = row["time_limit_s"][0]
            is_short = limit < time_limit_s if run.is_shipped else not limit >= time_limit_s
            is_over = status == "timed_out" and is_short
            if status and not is_over and f"{run.scene.name}/{REFERENCE}" not in missing:
                kept.append((run, status, text_of(row["message"][0])))
            else:
                missing[run.run] = run
                place.mark_missing([0])
        return list(missing.values()), kept


def extend_file(path: Path, wanted: Sequence[Table], replaced: Collection[tuple[str, str, str]] = ()) -> TableFile:
    """Make the file hold the rows of `wanted` tables, beside those that it has.

    replaced: (group, scene, curve or method) of stored rows that go where they are not wanted.

    Where the file has all rows as they are asked for, nothing is written. Else a file is laid out beside it, the rows
    that stay are copied, and it takes the place of the old one. A row of which anything in the design differs
    (settings, versions, the scene's numbers) is missing afterwards. Raises InputError where runs of a scene that has
    other numbers by now would be dropped and not computed again, StoreError where the file cannot be read or written,
    or is a sweep's.
    """
    if path.is_symlink():  # a link stays one
        path = path.resolve()
    if not path.exists():
        _write_tables(path, wanted, [])
        return TableFile(path)
    old, new = TableFile(path), {made.group: made for made in wanted}
    if "" in old.groups:
        raise StoreError(f"{path}: holds the dataset of a sweep; allowed: another output file")
    with files.open_file(path) as file, files.reading(path):
        stored = {group: table.as_table(file, group) for group in old.groups}
    wanted_runs = _known_rows(new.get(RUNS))
    hashes = {row["scene"]: row["scene_hash"] for row in wanted_runs.values()}
    lost = [
        f"{path}: {row['scene']}: has {row['method_name']} of a scene of that name with other numbers, which this call "
        "would drop; allowed: another output file, or a call that has this method too"
        for run, row in _known_rows(stored.get(RUNS)).items()
        if hashes.get(row["scene"], row["scene_hash"]) != row["scene_hash"] and run not in wanted_runs
    ]
    if lost:
        raise InputError(lost)
    merged: dict[str, Table] = {}
    kept: list[tuple[str, str]] = []
    for group in dict.fromkeys((*stored, *new)):
        before, made = stored.get(group), new.get(group)
        base = made or stored[group]
        if "crc32" not in base.computed:
            continue
        asked = _known_rows(made)
        rows = {
            run: row
            for run, row in _known_rows(before).items()
            if run in asked or (group, row["scene"], row.get("curve", row["method_name"])) not in replaced
        }
        kept += [(group, run) for run in rows if run not in asked or _is_same(rows[run], asked[run])]
        rows |= asked
        if rows:
            runs = sorted(rows, key=_order) if group == RUNS else list(rows)
            known = {name: (column, [rows[run][name] for run in runs]) for name, (column, _) in base.known.items()}
            merged[group] = replace(base, runs=runs, known=known, computed=_joined(before, made))
    methods: dict[str, list[str]] = {}  # by scene
    if RUNS in merged:
        for run, scene in zip(merged[RUNS].runs, merged[RUNS].known["scene"][1], strict=True):
            methods.setdefault(scene, []).append(str(run).removeprefix(f"{scene}/"))
    for scene, own in methods.items():
        before, made = stored.get(scene), new.get(scene)
        if before is not None and made is not None and before.attributes["scene_hash"] != made.attributes["scene_hash"]:
            before = None
        merged[scene] = replace(made or stored[scene], runs=own, computed=_joined(before, made))
    is_same = merged.keys() == stored.keys() and all(
        list(made.runs) == list(stored[group].runs) and made.computed.keys() == stored[group].computed.keys()
        for group, made in merged.items()
    )
    if is_same and len(kept) == sum(len(made.runs) for made in stored.values() if "crc32" in made.computed):
        return old
    places = [(group, run, old.place(run, group)) for group, run in kept]
    rows_kept = [(group, run, place.read()) for group, run, place in places if place.is_stored]
    _write_tables(path, list(merged.values()), rows_kept)
    return TableFile(path)


def _known_rows(made: Table | None) -> dict[str, dict[str, Any]]:
    """By run, what the design says of it."""
    if made is None:
        return {}
    columns = {name: list(values) for name, (_, values) in made.known.items()}
    return {str(run): {name: values[i] for name, values in columns.items()} for i, run in enumerate(made.runs)}


def _is_same(stored: Mapping[str, Any], asked: Mapping[str, Any]) -> bool:
    """Whether a row is as it is asked for; a number that it does not have is NaN in both."""
    return stored.keys() == asked.keys() and all(
        value == asked[name] or (value != value and asked[name] != asked[name]) for name, value in stored.items()
    )


def _joined(before: Table | None, made: Table | None) -> dict[str, Column]:
    """The computed columns of both, the checksum last."""
    columns = {**(before.computed if before else {}), **(made.computed if made else {})}
    checksum = columns.pop("crc32", None)
    return columns if checksum is None else {**columns, "crc32": checksum}


def _order(run: str) -> tuple[Any, ...]:
    """Scenes in natural order; of each the reference, then methods in the order of the catalogue."""
    scene, method = (run.removesuffix(f"/{REFERENCE}"), REFERENCE) if run.endswith(f"/{REFERENCE}") else (
        "/".join(run.split("/")[:-2]), "/".join(run.split("/")[-2:])
    )  # fmt: skip
    names = [REFERENCE, *method_names()]
    return natural_key(scene), names.index(method) if method in names else len(names), method


def _write_tables(path: Path, tables: Sequence[Table], rows: Sequence[tuple[str, str, Rows]]) -> None:
    """A new file with these tables; of its rows those that are given, the others blank."""
    created = datetime.now(UTC).isoformat(timespec="seconds")
    count, scenes = 0, set[str]()
    others = sorted(made.group for made in tables if made.group != RUNS and "crc32" in made.computed)
    for made in tables:
        if made.group == RUNS:
            count, scenes = len(made.runs), set(made.known["scene"][1])
    summary = f"{count} runs of {len(scenes)} scenes: trajectories, energies, status and errors of each"
    if others:
        summary += f"; tables {', '.join(others)}"
    described = {"title": "Rotor models compared", "summary": summary, "keywords": KEYWORDS}  # as ACDD asks for them
    attributes = {**described, **versions(), **machine(), "created": created, "date_created": created}
    with table.laid_out(path, tables, attributes) as temporary:
        file = TableFile(temporary)
        given = {(group, run): values for group, run, values in rows}
        for made in tables:
            for run in made.runs if "crc32" in made.computed else ():
                place = file.place(str(run), made.group)
                values = given.get((made.group, str(run)))
                if values is None:
                    place.clear()
                else:
                    blank = blank_rows(1, place.row)
                    place.write({name: values.get(name, blank[name]) for name in place.row.names or ()})


# The rows of a run


def row_of_run(run: Solution, place: Place, facts: Mapping[str, object]) -> Rows:
    """The row of a run: status, metrics, times, arrays. facts: further columns by name."""
    integration = run.integration
    arrays = dict(run.quantities)
    if run.method == REFERENCE:
        arrays |= {"angles": run.angles, "rates": run.rates}
    else:
        arrays = {OF_METHODS.get(name, name): array for name, array in arrays.items()}
    return place.rows_of(
        {
            "status": run.status,
            "message": run.message,
            "engine_message": integration.message,
            "samples": len(run.time),
            "time_reached": integration.time_reached,
            "steps": -1 if integration.steps is None else integration.steps,
            "rhs_evaluations": -1 if integration.rhs_evaluations is None else integration.rhs_evaluations,
            "engine_success": int(integration.success),
            "setup_time_s": run.setup_time_s,
            "run_time_s": float(np.median(run.run_times_s)),
            "run_time_min_s": min(run.run_times_s),
            "output_time_s": run.output_time_s,
            "repeats": len(run.run_times_s),
            **run.metrics,
            **facts,
            **arrays,
        }
    )
