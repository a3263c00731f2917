"""`export`: a scene for other programs."""

from __future__ import annotations

import argparse
from pathlib import Path

from rotor_mbs.scenario.catalogue import only_scene
from rotor_mbs.studies.export import FORMATS, export


def write(arguments: argparse.Namespace) -> int:
    """One scene in one format; the paths that were written, a line each."""
    scene = only_scene(arguments.scene)
    output = arguments.output or Path(scene.name.rpartition("/")[2] + FORMATS[arguments.to][1])
    for path in export(scene, arguments.to, output):
        print(path)
    return 0
