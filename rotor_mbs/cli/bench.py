"""`bench`: error against run time, scene by scene, and the pages beside the results file."""

from __future__ import annotations

import argparse
import sys

from rotor_mbs.analysis.run_tables import bench_table
from rotor_mbs.cli.argument_values import pages_beside
from rotor_mbs.cli.arguments import cores
from rotor_mbs.cli.terminal import ProgressLine, print_doubts, print_not_computed, print_table
from rotor_mbs.errors import InputError
from rotor_mbs.methods.catalogue import check_names
from rotor_mbs.report.build import write_report
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.store.records import read_records
from rotor_mbs.studies.bench import run_bench
from rotor_mbs.studies.cost_scaling import run_cost_scaling


def bench(arguments: argparse.Namespace) -> int:
    """0 also where points failed: they are what is measured."""
    if not arguments.scenes and not arguments.growth:
        raise InputError("bench: nothing to measure; allowed: SCENE..., or --growth")
    scenes = find_scenes(arguments.scenes) if arguments.scenes else []
    methods, output = check_names(arguments.method or ()), arguments.output
    settings = dict(arguments.set or ())
    print_doubts(scenes)
    limits = {"repeats": arguments.repeats, "budget_s": arguments.budget}
    with ProgressLine() as progress:
        report = run_bench(scenes, methods, output, workers=cores(), settings=settings, on_progress=progress, **limits)
        made = [*report.made]
        if arguments.growth:
            made += run_cost_scaling(methods, output, on_progress=progress, **limits)
    for line in report.left_out:
        print(line, file=sys.stderr)
    names = {scene.name for scene in scenes}
    print_table(bench_table([curve for curve in read_records(output, "bench") if curve.scene in names]))
    index = write_report(output, pages_beside(output))
    print(f"{output}: {report.measured} scenes measured, {report.kept} there already\nreport: {index}")
    lost = [one for one in made if not one.is_computed]
    print_not_computed(lost)
    return 1 if lost else 0
