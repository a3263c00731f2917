"""`report`, `figures` and `animate`: pages and pictures from stored files; no model is loaded."""

from __future__ import annotations

import argparse
import hashlib
import os
import webbrowser
from collections.abc import Callable
from pathlib import Path

from rotor_mbs.cli.argument_values import pages_beside
from rotor_mbs.execution.provenance import fingerprint
from rotor_mbs.scenario.catalogue import reference_folder
from rotor_mbs.store.hdf5 import replace_file

_STAMP = ".made-from"
_SUMMARY = "summary.txt"  # what `reproduce` prints at its end


def report(arguments: argparse.Namespace) -> int:
    """Pages from `arguments.file` into `arguments.output`, or beside the file."""
    from rotor_mbs.report.build import write_report

    index = write_report(arguments.file, arguments.output or pages_beside(arguments.file), jobs=os.cpu_count() or 1)
    print(index)
    if arguments.open:
        webbrowser.open(index.resolve().as_uri())
    return 0


def figures(arguments: argparse.Namespace) -> int:
    """The paper's figures as files for a manuscript into `arguments.output`."""
    from rotor_mbs.report.manuscript import write_figures

    print(*write_figures(arguments.file, arguments.output, arguments.format, arguments.figure or ()), sep="\n")
    return 0


def animate(arguments: argparse.Namespace) -> int:
    """`arguments.scene` of `arguments.file`, moving, into `arguments.output`."""
    from rotor_mbs.report.animation import write_animation

    output = arguments.output or Path(arguments.scene.rpartition("/")[2] + ".webp")
    print(write_animation(arguments.file, arguments.scene, output, arguments.offset))
    return 0


def render_if_changed(
    results: Path, output: Path, jobs: int, summary: Callable[[Path], str], on_page: Callable[[int, int], None]
) -> tuple[Path, str]:
    """The index of the report on `results` in `output`, and the text that `summary` makes of `results`.

    Both are made anew unless the same data and code have made them before. Raises StoreError.
    """
    from rotor_mbs.report.core.files import INDEX

    made_from = _digest(results)
    stamp, index, text = output / _STAMP, output / INDEX, output / _SUMMARY
    if not (stamp.is_file() and stamp.read_text() == made_from and index.is_file() and text.is_file()):
        from rotor_mbs.report.build import write_report  # late: matplotlib

        write_report(results, output, jobs, on_page)
        replace_file(text, summary(results).encode())
        replace_file(stamp, made_from.encode())
    return index, text.read_text(encoding="utf-8")


def _digest(results: Path) -> str:
    """Of all that a report depends on."""
    digest = hashlib.sha256(fingerprint("report", "analysis", "store").encode())
    for path in (results, *sorted(reference_folder().glob("*.toml"))):
        with path.open("rb") as file:
            digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()
