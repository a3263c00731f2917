"""Add requested rows to a results file, and copy files with tables."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rotor_mbs.errors import InputError
from rotor_mbs.runs.design import MISSING, RUNS, TableSpec, row_order
from rotor_mbs.runs.hdf5 import Column
from rotor_mbs.runs.layout import KEYWORDS, create_file
from rotor_mbs.runs.output_files import locked, write_file
from rotor_mbs.runs.rows import Rows, blank_rows
from rotor_mbs.runs.table import IDENTITY, TableFile
from rotor_mbs.runs.trailer import RESULTS, may_extend, read_trailer
from rotor_mbs.runs.versions import machine, versions


def fit_file_to_request(
    path: Path, wanted: Sequence[TableSpec], replaced: Collection[tuple[str, str, str]] = ()
) -> TableFile:
    """Add the rows of requested tables to a results file, which is created if there is none.

    If the file has all rows as they are requested, nothing is written. Otherwise a new file is laid
    out beside it, the rows that stay are copied into it, and the new file replaces the old one. A
    row is missing afterwards if anything in its design differs (settings, versions, the scene's
    numbers).

    Parameters
    ----------
    path : the results file; a symbolic link is followed, and stays one.
    wanted : the tables that are requested.
    replaced : (group, scene, curve or method) of stored rows that are dropped unless they
        are in `wanted`.

    Returns
    -------
    TableFile
        The tables of the file.

    Raises
    ------
    InputError
        If runs of a scene whose numbers have changed would be dropped and not computed again, or
        the file is of another kind.
    StoreError
        If the file cannot be read or written.
    """
    if path.is_symlink():
        path = path.resolve()
    if not may_extend(path, RESULTS):
        return _write_tables(path, wanted, [])
    file = TableFile(path)
    stored = file.tables
    wanted_tables = {table.group: table for table in wanted}
    wanted_runs = _known_rows(wanted_tables.get(RUNS))
    hashes = {row["scene"]: row["scene_hash"] for row in wanted_runs.values()}
    # A file has only one scene of each name. If its numbers have changed, its stored runs cannot
    # stay.
    lost = []
    for run, row in _known_rows(stored.get(RUNS)).items():
        has_changed = hashes.get(row["scene"], row["scene_hash"]) != row["scene_hash"]
        if has_changed and run not in wanted_runs:
            lost.append(
                f"{path}: {row['scene']}: has a run of {row['method_name']} with other numbers of "
                "this scene, which this call would remove and not compute again; allowed: another "
                f"output file, or a call that also runs {row['method_name']}"
            )
    if lost:
        raise InputError(lost)
    # Tables with a row per run or point: their stored rows, then the requested ones.
    merged: dict[str, TableSpec] = {}
    kept: list[tuple[str, str]] = []  # group and label of the stored rows that are copied
    for group in dict.fromkeys((*stored, *wanted_tables)):
        before, requested = stored.get(group), wanted_tables.get(group)
        base = requested or stored[group]
        # A table of a scene's arrays has no checksums; it follows below from the rows of /runs.
        if "crc32" not in base.computed:
            continue
        requested_rows = _known_rows(requested)
        rows: dict[str, Mapping[str, Any]] = {}
        for run, row in _known_rows(before).items():
            curve = group, row["scene"], row.get("curve", row["method_name"])
            if run not in requested_rows and curve in replaced:
                continue
            rows[run] = row
            if run not in requested_rows or _is_same_row(row, requested_rows[run]):
                kept.append((group, run))
        rows |= requested_rows
        if rows:
            runs = sorted(rows, key=row_order) if group == RUNS else list(rows)
            known = {}
            for name, (column, _) in base.known.items():
                known[name] = column, [rows[run][name] for run in runs]
            columns = _joined_columns(before, requested)
            merged[group] = TableSpec(group, runs, known, columns, base.attributes, base.characters)
    # Tables of the scenes' arrays: a row for each run that /runs has now.
    methods: dict[str, list[str]] = {}  # by scene
    if RUNS in merged:
        for run, scene in zip(merged[RUNS].runs, merged[RUNS].known["scene"][1], strict=True):
            methods.setdefault(scene, []).append(str(run).removeprefix(f"{scene}/"))
    for scene, methods_of_scene in methods.items():
        before, requested = stored.get(scene), wanted_tables.get(scene)
        # Arrays of a scene with other numbers are not taken over.
        if (
            before is not None
            and requested is not None
            and before.attributes["scene_hash"] != requested.attributes["scene_hash"]
        ):
            before = None
        base = requested or stored[scene]
        columns = _joined_columns(before, requested)
        merged[scene] = TableSpec(
            scene, methods_of_scene, base.known, columns, base.attributes, base.characters
        )
    # The file is kept if it has these rows and columns, and none of its rows is dropped.
    count = sum(len(table.runs) for table in stored.values() if "crc32" in table.computed)
    if len(kept) == count and _have_same_layout(merged, stored):
        return file
    rows_kept = []
    for group, run in kept:
        place = file.place(run, group)
        if place.is_stored:
            rows_kept.append((group, run, place.read()))
    return _write_tables(path, list(merged.values()), rows_kept)


def copy_file(source: Path, target: Path) -> None:
    """Copy a file with tables. A file at the target is replaced only if none of its rows is lost.

    Parameters
    ----------
    source : the file.
    target : the copy. A file there is replaced if it is of the same kind and `source` has all its
        stored rows. Different sweeps have no rows in common.

    Raises
    ------
    InputError
        If rows would be lost, or `target` is of another kind.
    StoreError
        If `target` is damaged, not of this program, or cannot be written.
    """
    with locked(target):
        if may_extend(target, read_trailer(source).kind):
            old, new = TableFile(target), TableFile(source)
            is_same_sweep = old.attributes.get(IDENTITY) == new.attributes.get(IDENTITY)
            for group, table in old.tables.items():
                copied: set[str] = set()
                if is_same_sweep and group in new.tables:
                    copied = {str(run) for run in new.tables[group].runs}
                for run, status in zip(map(str, table.runs), table.column("status"), strict=True):
                    if status != MISSING and run not in copied:
                        what = f"{group}: {run}" if group else f"run {run}"
                        raise InputError(
                            f"{target}: has {what}, which would be lost; allowed: another name, or "
                            "remove that file"
                        )
        write_file(target, source.read_bytes())


def _known_rows(table: TableSpec | None) -> Mapping[str, Mapping[str, Any]]:
    """Return the known values of each row of a table, by label; none without a table."""
    return {} if table is None else table.known_rows


def _is_same_row(stored: Mapping[str, Any], requested: Mapping[str, Any]) -> bool:
    """Return whether the known values of a row are those that are requested."""
    if stored.keys() != requested.keys():
        return False
    for name, value in stored.items():
        other = requested[name]
        # A number that is missing is NaN, which differs from itself.
        are_both_missing = value != value and other != other
        if value != other and not are_both_missing:
            return False
    return True


def _have_same_layout(tables: Mapping[str, TableSpec], others: Mapping[str, TableSpec]) -> bool:
    """Return whether tables by group have the same rows and computed columns as others."""
    if tables.keys() != others.keys():
        return False
    for group, table in tables.items():
        other = others[group]
        if list(table.runs) != list(other.runs):
            return False
        if table.computed.keys() != other.computed.keys():
            return False
    return True


def _joined_columns(before: TableSpec | None, requested: TableSpec | None) -> dict[str, Column]:
    """Return the computed columns of two tables, the checksum last."""
    columns: dict[str, Column] = {}
    for table in (before, requested):
        if table is not None:
            columns |= table.computed
    checksum = columns.pop("crc32", None)
    return columns if checksum is None else {**columns, "crc32": checksum}


def _write_tables(
    path: Path, tables: Sequence[TableSpec], rows: Sequence[tuple[str, str, Rows]]
) -> TableFile:
    """Write a new file with tables, in which the given rows are filled and the others blank.

    Parameters
    ----------
    path : of the file.
    tables : all that it has.
    rows : group and label of each row that is filled, and its columns.

    Returns
    -------
    TableFile
        The tables of the file.
    """
    created = datetime.now(UTC).isoformat(timespec="seconds")
    count, scenes = 0, set[str]()
    others = sorted(
        table.group for table in tables if table.group != RUNS and "crc32" in table.computed
    )
    for table in tables:
        if table.group == RUNS:
            count, scenes = len(table.runs), set(table.known["scene"][1])
    summary = f"runs: {count}, scenes: {len(scenes)}; trajectories, energies, status and errors"
    if others:
        summary += f"; tables {', '.join(others)}"
    # The attributes that the ACDD conventions ask for.
    described = {"title": "Rotor models compared", "summary": summary, "keywords": KEYWORDS}
    attributes = {
        **described,
        **versions(),
        **machine(),
        "created": created,
        "date_created": created,
    }
    with create_file(path, tables, attributes) as file:
        for stored in file.tables.values():
            stored.clear()
        for group, run, values in rows:
            place = file.place(run, group)
            # A column that the earlier row did not have stays blank.
            columns = blank_rows(1, place.row_type)
            for name in columns:
                columns[name] = values.get(name, columns[name])
            place.write(columns)
    # The file that was laid out has its final name now.
    laid_tables = [replace(stored, path=path) for stored in file.tables.values()]
    return TableFile(path, laid_out_as=(attributes, laid_tables))
