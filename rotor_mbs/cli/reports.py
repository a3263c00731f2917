"""`report`, `figures` and `animate`: pages and pictures from a results file; no model is loaded."""

from __future__ import annotations

import argparse
import hashlib
import os
from pathlib import Path

from rotor_mbs.execution.provenance import fingerprint
from rotor_mbs.scenario.catalogue import reference_folder
from rotor_mbs.store.hdf5 import replace_file
from rotor_mbs.store.read import open_results
from rotor_mbs.store.records import read_records

_STAMP = ".made-from"


def report(arguments: argparse.Namespace) -> int:
    """Pages from `arguments.file` into `arguments.output`."""
    from rotor_mbs.report.build import write_report
    from rotor_mbs.report.pages.bench import write_bench_report
    from rotor_mbs.report.pages.modes import write_modes_report

    has_modes = bool(read_records(arguments.file, "modes"))
    with open_results(arguments.file) as results:
        has_scenes = bool(results.scenes)
    if has_scenes or not has_modes:
        print(write_report(arguments.file, arguments.output, jobs=os.cpu_count() or 1))
    if has_modes:
        print(write_modes_report(arguments.file, arguments.output / "modes" if has_scenes else arguments.output))
    if read_records(arguments.file, "bench"):
        print(write_bench_report(arguments.file, arguments.output / "bench"))
    return 0


def figures(arguments: argparse.Namespace) -> int:
    """The paper's figures as files for a manuscript into `arguments.output`."""
    from rotor_mbs.report.manuscript import write_figures

    print(*write_figures(arguments.file, arguments.output, arguments.format, arguments.figure or ()), sep="\n")
    return 0


def animate(arguments: argparse.Namespace) -> int:
    """`arguments.scene` of `arguments.file`, moving, into `arguments.output`."""
    from rotor_mbs.report.animation import write_animation

    print(write_animation(arguments.file, arguments.scene, arguments.output, arguments.offset))
    return 0


def render_if_changed(results: Path, output: Path, jobs: int) -> Path:
    """The index of the report on `results` in `output`; made anew unless the same data and code have made it before.

    Raises StoreError.
    """
    from rotor_mbs.report.build import write_report
    from rotor_mbs.report.core.files import INDEX

    made_from = _digest(results)
    stamp = output / _STAMP
    if not (stamp.is_file() and stamp.read_text() == made_from and (output / INDEX).is_file()):
        write_report(results, output, jobs)
        replace_file(stamp, made_from.encode())
    return output / INDEX


def _digest(results: Path) -> str:
    """Of all that a report depends on."""
    digest = hashlib.sha256(fingerprint("report", "analysis", "store").encode())
    for path in (results, *sorted(reference_folder().glob("*.toml"))):
        with path.open("rb") as file:
            digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()
