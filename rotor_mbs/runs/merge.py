"""Add requested rows to a results file, and copy files with tables."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rotor_mbs.errors import InputError
from rotor_mbs.runs.design import MISSING, RUNS, row_order
from rotor_mbs.runs.hdf5 import Column, TableSpec
from rotor_mbs.runs.layout import KEYWORDS, create_file
from rotor_mbs.runs.output_files import locked, write_file
from rotor_mbs.runs.rows import Rows, blank_rows
from rotor_mbs.runs.table import IDENTITY, TableFile
from rotor_mbs.runs.trailer import RESULTS, may_extend, read_trailer
from rotor_mbs.runs.versions import machine, versions

KnownRows = Mapping[str, Mapping[str, Any]]  # known values by label of the row, then by column


def fit_file_to_request(
    path: Path, wanted: Sequence[TableSpec], replaced: Collection[tuple[str, str, str]] = ()
) -> TableFile:
    """Add the rows of requested tables to a results file; the file is created if there is none.

    If the file has all rows as they are requested, nothing is written. Otherwise a new file is laid
    out beside it, the rows that stay are copied into the new file, and the new file replaces the
    old one. Afterwards the status of a requested row is MISSING if the row is new, or if its known
    values (settings, versions, the hash of the scene ...) differ from those of the stored row.

    Parameters
    ----------
    path : the results file. If it is a symbolic link, the link stays, and its target is replaced.
    wanted : the tables that are requested.
    replaced : curves as (group, scene, curve or method). Their stored rows are dropped, except
        those that are in `wanted`.

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
    stored, requested = file.tables, {table.group: table for table in wanted}
    _refuse_loss(path, _known_rows(stored.get(RUNS)), _known_rows(requested.get(RUNS)))
    merged = _merged_tables(stored, requested, replaced)
    kept = _kept_rows(stored, requested, merged)
    # The old file stays if it has the merged rows and columns, and all its rows are kept.
    count = sum(len(table.runs) for table in stored.values() if "crc32" in table.computed)
    if len(kept) == count and _layout(merged) == _layout(stored):
        return file
    rows = []
    for group, run in kept:
        place = file.place(run, group)
        if place.is_stored:
            rows.append((group, run, place.read()))
    return _write_tables(path, list(merged.values()), rows)


def _refuse_loss(path: Path, stored: KnownRows, requested: KnownRows) -> None:
    """Raise InputError if runs would be lost because the numbers of their scene have changed.

    A file has only one scene of each name. If the numbers of that scene change, its stored runs
    cannot stay.

    Parameters
    ----------
    path : the file.
    stored, requested : known values of the runs, by label.
    """
    hashes = {row["scene"]: row["scene_hash"] for row in requested.values()}
    lost = []
    for run, row in stored.items():
        has_changed = hashes.get(row["scene"], row["scene_hash"]) != row["scene_hash"]
        if has_changed and run not in requested:
            lost.append(
                f"{path}: {row['scene']}: has a run of {row['method_name']} with other numbers of "
                "this scene, which this call would remove and not compute again; allowed: another "
                f"output file, or a call that also runs {row['method_name']}"
            )
    if lost:
        raise InputError(lost)


def _merged_tables(
    stored: Mapping[str, TableSpec],
    requested: Mapping[str, TableSpec],
    replaced: Collection[tuple[str, str, str]],
) -> dict[str, TableSpec]:
    """Return the tables of the new file by group, with the stored rows that stay and new rows.

    Parameters
    ----------
    stored, requested : tables of the file and requested tables, by group.
    replaced : stored rows that are dropped, see `fit_file_to_request`.
    """
    merged: dict[str, TableSpec] = {}
    # First the tables with a row per run or point. Tables of scenes are skipped: they are those
    # without checksums.
    for group in dict.fromkeys((*stored, *requested)):
        before, wanted = stored.get(group), requested.get(group)
        base = wanted or stored[group]
        if "crc32" not in base.computed:
            continue
        wanted_rows = _known_rows(wanted)
        rows: dict[str, Mapping[str, Any]] = {}
        for run, row in _known_rows(before).items():
            curve = group, row["scene"], row.get("curve", row["method_name"])
            if run in wanted_rows or curve not in replaced:
                rows[run] = row
        rows |= wanted_rows
        if rows:
            runs = sorted(rows, key=row_order) if group == RUNS else list(rows)
            known = {}
            for name, (column, _) in base.known.items():
                known[name] = column, [rows[run][name] for run in runs]
            merged[group] = _with_columns_of(before, base, runs, known)
    # Then the tables of scenes, with a row for each run that the new /runs has.
    methods: dict[str, list[str]] = {}  # by scene
    for row in _known_rows(merged.get(RUNS)).values():
        methods.setdefault(row["scene"], []).append(row["method_name"])
    for scene, names in methods.items():
        before, wanted = stored.get(scene), requested.get(scene)
        base = wanted or stored[scene]
        # If the numbers of the scene have changed, the stored table's columns are not taken over.
        if before is not None and before.attributes["scene_hash"] != base.attributes["scene_hash"]:
            before = None
        merged[scene] = _with_columns_of(before, base, names, base.known)
    return merged


def _with_columns_of(
    before: TableSpec | None,
    base: TableSpec,
    runs: Sequence[str],
    known: Mapping[str, tuple[Column, Any]],
) -> TableSpec:
    """Return a table like `base` with other rows, and with the computed columns of `before`, too.

    Parameters
    ----------
    before : the stored table; None if there is none.
    base : the requested table; the stored table if none is requested.
    runs, known : labels of the rows and known columns of the new table.
    """
    columns = {**(before.computed if before else {}), **base.computed}
    checksum = columns.pop("crc32", None)  # it must be the last column
    if checksum is not None:
        columns["crc32"] = checksum
    return TableSpec(base.group, runs, known, columns, base.attributes, base.characters)


def _kept_rows(
    stored: Mapping[str, TableSpec],
    requested: Mapping[str, TableSpec],
    merged: Mapping[str, TableSpec],
) -> list[tuple[str, str]]:
    """Return (group, label) of the stored rows that are copied into the new file.

    A row of a run or a point is copied if the new file has its label, and the row either is not
    requested or is as it is requested.

    Parameters
    ----------
    stored, requested, merged : tables of the old file, requested tables and tables of the new file,
        by group.
    """
    kept = []
    for group, table in stored.items():
        if "crc32" not in table.computed:
            continue
        staying, wanted = _known_rows(merged.get(group)), _known_rows(requested.get(group))
        for run, row in table.known_rows.items():
            if run in staying and (run not in wanted or _is_same_row(row, wanted[run])):
                kept.append((group, run))
    return kept


def copy_file(source: Path, target: Path) -> None:
    """Copy a file with tables to a path; a file at that path is replaced only if no row is lost.

    Parameters
    ----------
    source : the file.
    target : path of the copy. A file at `target` is replaced if it is of the same kind, and
        `source` has rows with the labels of all its stored rows. Different sweeps have no rows in
        common.

    Raises
    ------
    InputError
        If rows would be lost, or the file at `target` is of another kind.
    StoreError
        If the file at `target` is damaged or not of this program, or `target` cannot be written.
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


def _known_rows(table: TableSpec | None) -> KnownRows:
    """Return the known values of each row of a table, by label; no rows if there is no table."""
    return {} if table is None else table.known_rows


def _is_same_row(stored: Mapping[str, Any], requested: Mapping[str, Any]) -> bool:
    """Return whether a stored row and a requested row have the same known values."""
    if stored.keys() != requested.keys():
        return False
    for name, value in stored.items():
        other = requested[name]
        # A missing number is NaN, which differs from itself.
        are_both_missing = value != value and other != other
        if value != other and not are_both_missing:
            return False
    return True


def _layout(tables: Mapping[str, TableSpec]) -> dict[str, object]:
    """Return the labels of the rows and the names of the computed columns of tables, by group."""
    return {group: (list(table.runs), {*table.computed}) for group, table in tables.items()}


def _write_tables(
    path: Path, tables: Sequence[TableSpec], rows: Sequence[tuple[str, str, Rows]]
) -> TableFile:
    """Write a new file with tables; the given rows are filled, all other rows are blank.

    Parameters
    ----------
    path : path of the file.
    tables : all tables of the file.
    rows : group, label and columns of each row that is filled.

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
            # A column that the copied row did not have in the old file stays blank.
            columns = blank_rows(1, place.row_type)
            for name in columns:
                columns[name] = values.get(name, columns[name])
            place.write(columns)
    # The tables still have the temporary name under which the file was laid out.
    laid_tables = [replace(stored, path=path) for stored in file.tables.values()]
    return TableFile(path, laid_out_as=(attributes, laid_tables))
