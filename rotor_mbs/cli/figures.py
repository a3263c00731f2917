"""`figures`: the paper's figures from a results file, as files for a manuscript; computes nothing."""

from __future__ import annotations

import argparse

from rotor_mbs.report.manuscript import write_figures


def figures(arguments: argparse.Namespace) -> int:
    """A file for each figure into `arguments.output`."""
    made = write_figures(arguments.file, arguments.output, arguments.format, arguments.figure or ())
    for path in made:
        print(path)
    return 0
