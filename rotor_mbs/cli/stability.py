"""`stability`: every method on the stiff and extreme scenes, step limits, conservation, and the map of it all."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from rotor_mbs.analysis.stability import Cell, cells, summary_lines, unreached
from rotor_mbs.cli.terminal import ProgressLine
from rotor_mbs.methods.catalogue import method_names
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.studies.run import able_methods, run_scenes
from rotor_mbs.studies.stability_records import complete_records

SUITE = ("stiff", "extreme")

# The method that `run` stands by is given time for the longest scenes: where nothing ends, the map tells nothing.
_PATIENT_METHOD, _PATIENT_S = "lagrange/taylor", 120.0


def stability(arguments: argparse.Namespace) -> int:
    """The suite into one file, then its report. 1 where a claim of the suite fails: see `unreached`."""
    start = time.monotonic()
    scenes = find_scenes(arguments.scenes or SUITE)
    names = method_names(is_corrected=True)
    methods = {scene.name: able_methods(scene, names)[0] for scene in scenes}
    output: Path = arguments.output
    none: dict[str, list[str]] = {name: [] for name in methods}  # references first, which two scenes have no time for
    patient = {name: [method for method in able if method == _PATIENT_METHOD] for name, able in methods.items()}
    limit = arguments.timeout
    for chosen, limit_s in ((none, limit), (patient, max(limit, _PATIENT_S)), (methods, limit)):
        run_scenes(scenes, chosen, output, workers=arguments.jobs, timeout_s=limit_s, on_progress=ProgressLine())
    complete_records(scenes, methods, cells(output), output, arguments.jobs)
    found = cells(output)
    _tell(found)
    print(f"{output}: {len(scenes)} scenes, {len(found)} runs, {time.monotonic() - start:.0f} s in all")
    print(f"report: {_report(output, arguments)}")
    missing = unreached(found)
    for scene in missing:
        print(f"{scene}: no method reaches 1e-6 rad", file=sys.stderr)
    return 1 if missing else 0


def _tell(found: Sequence[Cell]) -> None:
    for line in summary_lines(found):
        print(line)


def _report(output: Path, arguments: argparse.Namespace) -> Path:
    from rotor_mbs.report.pages.stability import write_stability_report

    folder = arguments.report or output.with_name(f"{output.stem}-report")
    return write_stability_report(output, folder)
