"""`report`, `figures` and `animate`: pages and pictures from stored files; no model is loaded."""

from __future__ import annotations

import argparse
import webbrowser
from pathlib import Path

from rotor_mbs.cli.arguments import pages_beside
from rotor_mbs.execution import cores


def report(arguments: argparse.Namespace) -> int:
    """Pages from `arguments.file` into `arguments.output`, or beside the file."""
    from rotor_mbs.report.build import write_report

    output = arguments.output or pages_beside(arguments.file)
    index = write_report(arguments.file, output, jobs=cores(), checked=True)
    print(index)
    if arguments.open:
        webbrowser.open(index.resolve().as_uri())
    return 0


def figures(arguments: argparse.Namespace) -> int:
    """The paper's figures as files for a manuscript into `arguments.output`."""
    from rotor_mbs.report.paper_figures import write_figures

    print(*write_figures(arguments.file, arguments.output, arguments.format, arguments.figure or ()), sep="\n")
    return 0


def animate(arguments: argparse.Namespace) -> int:
    """`arguments.scene` of `arguments.file`, moving, into `arguments.output`."""
    from rotor_mbs.report.animation import write_animation

    output = arguments.output or Path(arguments.scene.rpartition("/")[2] + ".webp")
    print(write_animation(arguments.file, arguments.scene, output, arguments.offset))
    return 0
