"""`modes`: natural frequencies, Campbell diagram and Floquet multipliers into one file, and its pages."""

from __future__ import annotations

import argparse
import json
import sys

from rotor_mbs.analysis.campbell import mode_rows, modes_summary
from rotor_mbs.analysis.mode_records import read_modes
from rotor_mbs.cli.argument_values import pages_beside
from rotor_mbs.cli.terminal import ProgressLine
from rotor_mbs.report.build import write_report
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.studies.modes import modes_of_scenes


def modes(arguments: argparse.Namespace) -> int:
    """The modes of every scene; 1 where two models disagree on a frequency or a scene could not be computed."""
    scenes = find_scenes(arguments.scenes)
    made = modes_of_scenes(
        scenes, arguments.output, speeds=arguments.speeds, stiffnesses=arguments.stiffness,
        workers=arguments.jobs, timeout_s=arguments.timeout, on_progress=ProgressLine(),
    )  # fmt: skip
    missing = [one for one in made if not one.is_computed]
    for outcome in missing:
        print(f"{outcome.case.scene.name}: {outcome.result.message}", file=sys.stderr)
    found = read_modes(arguments.output) if len(missing) < len(scenes) else {}
    chosen = [found[scene.name] for scene in scenes if scene.name in found]
    if arguments.json:
        print(json.dumps({one.scene: mode_rows(one) for one in chosen}, ensure_ascii=False, indent=1))
    else:
        for one in chosen:
            print("\n".join(modes_summary(one)))
        folder = arguments.report or pages_beside(arguments.output)
        print(f"report: {write_report(arguments.output, folder)}")
    return 1 if missing or not all(one.agrees for one in chosen) else 0
