"""`bench`: error against run time, scene by scene, into one results file that a further call goes on from."""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rotor_mbs.errors import InputError
from rotor_mbs.execution.environment import machine, versions
from rotor_mbs.methods.catalogue import check_names, ladders
from rotor_mbs.methods.ladders import Ladder
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.store.merge import merge
from rotor_mbs.store.records import read_records, write_records
from rotor_mbs.studies.bench_points import Plan, bench_hash, measure
from rotor_mbs.studies.bench_work import able, prepared_scene
from rotor_mbs.studies.run import run_scenes

# An hour of simulated time, or 48 blades, costs what several scenes do.
_GROWTH_BUDGETS = 3.0


@dataclass(frozen=True)
class _Work:
    """A scene and the ladders to be measured on it."""

    scene: Scene
    ladders: tuple[Ladder, ...]


def bench(arguments: argparse.Namespace) -> int:
    """Measures what is missing in `arguments.output`, then the pages beside it. 0 also where points failed: they are
    what is measured."""
    from rotor_mbs.report.pages.bench import write_bench_report

    if not arguments.scenes and not arguments.growth:
        raise InputError("bench: nothing to measure; allowed: SCENE..., or --growth")
    scenes = find_scenes(arguments.scenes) if arguments.scenes else []
    chosen = ladders(check_names(arguments.method or ()))
    output: Path = arguments.output
    _collect(output)
    _references(scenes, output)
    there = {(curve.scene, curve.name): curve.key for curve in read_records(output, "bench")}
    works = [_work(scene, chosen, there, arguments.repeats, arguments.budget) for scene in scenes]
    missing = [work for work in works if work.ladders]
    for work in missing:  # refused before the first is measured
        prepared_scene(work.scene, output)
    try:
        _measure_all(missing, output, arguments)
        if arguments.growth:
            _measure_growth(output, arguments)
    finally:
        _collect(output)
    index = write_bench_report(output, output.with_name(f"{output.stem}-report"))
    print(f"{output}: {len(missing)} scenes measured, {len(works) - len(missing)} there already\nreport: {index}")
    return 0


def _references(scenes: Sequence[Scene], output: Path) -> None:
    """The references, frozen or computed, into the results file. Raises InputError, StoreError."""
    nothing: Mapping[str, Sequence[str]] = {scene.name: () for scene in scenes}
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
    report = run_scenes(scenes, nothing, output, workers=cores, timeout_s=60.0)
    if report.failures or report.not_computed:
        raise InputError(
            f"{one.case.scene.name}: no usable reference ({one.result.status}: {one.result.message}); a bench needs one"
            for one in [*report.failures, *report.not_computed]
        )


def _work(
    scene: Scene, chosen: Sequence[Ladder], there: Mapping[tuple[str, str], object], repeats: int, budget: float
) -> _Work:
    wanted = []
    for ladder in chosen:
        if reason := able(ladder.method, scene):
            print(f"{scene.name}: {ladder.curve} left out: {reason}", file=sys.stderr)
        elif there.get((scene.name, ladder.curve)) != bench_hash(scene, ladder, repeats, budget):
            wanted.append(ladder)
    return _Work(scene, tuple(wanted))


def _pieces(output: Path) -> Path:
    """The folder of what is measured and not yet merged: one merge at the end costs less than one for each scene."""
    return output.with_name(output.name + ".bench")


def _collect(output: Path) -> None:
    """Merges what has been measured into the results file: now, or by a call before this one that was killed."""
    pieces = sorted(_pieces(output).glob("*.h5"))
    if pieces:
        merge(output, [output, *pieces] if output.exists() else pieces, {**versions(), **machine()})
        shutil.rmtree(_pieces(output))


def _measure_growth(output: Path, arguments: argparse.Namespace) -> None:
    from rotor_mbs.studies.cost_scaling import measure_growth, studies

    for study in studies():
        budget = _GROWTH_BUDGETS * arguments.budget
        found = measure_growth(study, arguments.method or (), arguments.repeats, budget)
        write_records(_pieces(output) / f"growth-{study.kind}.h5", found)
        print(f"growth with {study.kind} measured", file=sys.stderr, flush=True)


def _measure_all(works: Sequence[_Work], output: Path, arguments: argparse.Namespace) -> None:
    """Each scene's curves are a piece as soon as they are there: an interrupted bench goes on with the next scene."""
    start = time.monotonic()
    for number, work in enumerate(works, 1):
        plan = Plan(work.scene, work.ladders, output, arguments.repeats, arguments.budget)
        curves = measure(plan)
        write_records(_pieces(output) / f"{work.scene.name.replace('/', '-')}.h5", curves)
        spent = time.monotonic() - start
        left = spent / number * (len(works) - number)
        failures = sum(status not in ("ok", "left_out") for curve in curves for status in curve.statuses)
        omitted = sum(status == "left_out" for curve in curves for status in curve.statuses)
        points = sum(len(curve.statuses) for curve in curves)
        text = f"[{number}/{len(works)}] {work.scene.name} {points} points, {failures} failed, {omitted} left out"
        print(f"{text}; {spent:.0f} s, about {left:.0f} s left", file=sys.stderr, flush=True)
