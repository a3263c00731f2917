"""`animate`: a scene moving, as a picture file that moves, from a results file; computes nothing."""

from __future__ import annotations

import argparse

from rotor_mbs.report.animation import write_animation


def animate(arguments: argparse.Namespace) -> int:
    """`arguments.scene` of `arguments.file` into `arguments.output`."""
    print(write_animation(arguments.file, arguments.scene, arguments.output, arguments.offset))
    return 0
