"""`export`: a scene for other programs."""

from __future__ import annotations

import argparse
from pathlib import Path

from rotor_mbs.errors import InputError
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.studies.export import FORMATS, export


def write(arguments: argparse.Namespace) -> int:
    """One scene in one format; the paths that were written, a line each."""
    found = find_scenes([arguments.scene])
    if len(found) != 1:
        raise InputError(f"{arguments.scene}: {len(found)} scenes; allowed: one scene's name or file")
    output = arguments.output or Path(found[0].name.rpartition("/")[2] + FORMATS[arguments.to][1])
    for path in export(found[0], arguments.to, output):
        print(path)
    return 0
