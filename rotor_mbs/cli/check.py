"""`check`: verdicts on a results file, or on a default set computed on the spot; status 1 where one fails."""

from __future__ import annotations

import argparse
import importlib.util
import math
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from rotor_mbs.analysis.verdicts import Verdict, verdicts
from rotor_mbs.errors import StoreError
from rotor_mbs.execution.pool import run_tasks
from rotor_mbs.methods.catalogue import METHOD_NAMES, REFERENCE, available_defaults, check_names
from rotor_mbs.report import verdict_formats
from rotor_mbs.scenario.bounds import Bounds, load_bounds
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.resources import reference_folder
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.store.digests import touched
from rotor_mbs.store.hdf5 import replace_file
from rotor_mbs.store.read import open_results
from rotor_mbs.studies.batch import Batch, execute
from rotor_mbs.studies.check_runs import PROBES, SPEED_PROBES, Measured, Probe, measure

# The chain takes as long as all else together: four scenes of the paper tell what it has to tell.
_CHAIN, _CHAIN_SCENES = "exudyn_chain/generalized_alpha", ("paper/fig03", "paper/fig04b", "paper/fig08", "paper/fig11")
_TIMEOUT_S = 60.0
_STANDARD_OUTPUT = Path("-")
_OF_EVERY_RUN = "status"  # a check that each run has one verdict of


@dataclass(frozen=True)
class DefaultSet:
    """What is computed where no file is given: methods by scene name, and measurements beside them."""

    scenes: Sequence[Scene]
    methods: dict[str, list[str]]
    probes: Sequence[Probe]


def check(arguments: argparse.Namespace) -> int:
    """Prints every verdict that fails (with --verbose all), then a count."""
    bounds = load_bounds(arguments.bounds)
    required = check_names(arguments.require or ())
    if arguments.file is not None:
        found = judge_file(arguments.file, bounds)
        found += judge_presence(found, required)
    else:
        found = judge_default_set(default_set(), bounds, arguments.jobs)
    if arguments.speed:
        found += _probe([p for p in SPEED_PROBES if _is_available(p.method)], bounds, 1)
    _write(arguments, found)
    # With --json - the standard output is the JSON's alone.
    words = sys.stderr if arguments.json == _STANDARD_OUTPUT else sys.stdout
    failed = [verdict for verdict in found if not verdict.passed]
    for verdict in found if arguments.verbose else failed:
        print(verdict_formats.line(verdict), file=words)
    if arguments.github:
        for verdict in failed:
            print(verdict_formats.github(verdict), file=words)
    print(_judged(found), file=words)
    print(f"{len(found) - len(failed)} passed, {len(failed)} failed", file=words)
    return 1 if failed or not found else 0


def judge_file(path: Path, bounds: Bounds) -> list[Verdict]:
    """Verdicts on what is there. Raises StoreError, InputError."""
    with ExitStack() as stack:
        results = stack.enter_context(open_results(path))
        shipped = [stack.enter_context(open_results(file)) for file in _frozen_files()]
        return verdicts(results, shipped, bounds)


def judge_presence(found: Sequence[Verdict], required: Sequence[str]) -> list[Verdict]:
    """Of every scene that was judged, whether it has a run of each method that must be there."""
    there = {(verdict.scene, verdict.method) for verdict in found}
    scenes = dict.fromkeys(verdict.scene for verdict in found if verdict.check == _OF_EVERY_RUN)
    return [
        Verdict(
            "required", scene, method, "run", float((scene, method) not in there), 0.0, "missing", "not in the file"
        )
        for scene in scenes
        for method in required
    ]


def _judged(found: Sequence[Verdict]) -> str:
    """What there was to be judged, so that a run that is not there is missed by whoever reads."""
    runs = Counter(one.method for one in found if one.check == _OF_EVERY_RUN and one.method != REFERENCE)
    return "runs judged: " + (", ".join(f"{count} {method}" for method, count in runs.items()) or "none")


def default_set() -> DefaultSet:
    """Every scene of the paper by the fast models, the chain on some; the scenes made for checking by every method."""
    paper, own = find_scenes(["paper"]), find_scenes(["check"])
    right = [name for name in METHOD_NAMES if not name.startswith("printed") and _is_available(name)]
    methods = {
        scene.name: [name for name in available_defaults() if name != _CHAIN or scene.name in _CHAIN_SCENES]
        for scene in paper
    }
    methods |= {scene.name: right for scene in own}
    return DefaultSet([*paper, *own], methods, PROBES)


def judge_default_set(chosen: DefaultSet, bounds: Bounds, jobs: int) -> list[Verdict]:
    """Computes the set, judges it, and looks after what it was held against: frozen references and bounds."""
    found = [*judge_bounds(bounds), *judge_frozen(bounds)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "check.h5"
        execute(Batch(chosen.scenes, chosen.methods, path, jobs, _TIMEOUT_S))
        found += judge_file(path, bounds)
    return found + _probe(chosen.probes, bounds, jobs)


def judge_bounds(bounds: Bounds) -> list[Verdict]:
    """Every shipped bound below what a known fault gives: else it would let that fault pass."""
    return [
        Verdict("bound", "bounds", one.method, one.check, one.value, one.fault, "as its check", one.known_fault)
        for one in bounds.entries
        if math.isfinite(one.fault)
    ]


def judge_frozen(bounds: Bounds) -> list[Verdict]:
    """Every shipped reference against its digests, one verdict a scene."""
    bound = bounds.of("frozen", REFERENCE).value
    found = []
    for path in _frozen_files():
        with open_results(path) as results:
            try:
                scenes = touched(results)
            except StoreError as exc:
                found.append(Verdict("frozen", path.stem, REFERENCE, "all", math.nan, bound, "arrays", str(exc)))
                continue
        for scene, names in scenes.items():
            look = f"{path.name}: {', '.join(names)} not as frozen" if names else "as frozen"
            channel = ", ".join(names) or "all"
            found.append(Verdict("frozen", scene, REFERENCE, channel, float(len(names)), bound, "arrays", look))
    return found


def _frozen_files() -> list[Path]:
    return sorted(reference_folder().glob("*.h5"))


def _is_available(method: str) -> bool:
    return method != "lagrange/taylor" or importlib.util.find_spec("heyoka") is not None


def _probe(probes: Sequence[Probe], bounds: Bounds, jobs: int) -> list[Verdict]:
    available = [probe for probe in probes if _is_available(probe.method)]
    found: dict[Probe, list[Verdict]] = {}
    for finished in run_tasks(measure, available, jobs, _TIMEOUT_S):
        measured = [_lost(finished.task, finished.message)] if finished.value is None else finished.value
        found[finished.task] = [_verdict(one, bounds) for one in measured]
    return [verdict for probe in available for verdict in found[probe]]


def _lost(probe: Probe, message: str) -> Measured:
    return Measured(probe.kind, probe.scene, probe.method, "all", math.nan, "", message)


def _verdict(one: Measured, bounds: Bounds) -> Verdict:
    bound = bounds.of(one.check, one.method).value
    return Verdict(one.check, one.scene, one.method, one.channel, one.value, bound, one.unit, one.look_at)


def _write(arguments: argparse.Namespace, found: list[Verdict]) -> None:
    if arguments.junit is not None:
        replace_file(arguments.junit, verdict_formats.junit(found))
    if arguments.json == _STANDARD_OUTPUT:
        print(verdict_formats.as_json(found))
    elif arguments.json is not None:
        replace_file(arguments.json, verdict_formats.as_json(found).encode())
    if not found:
        print("nothing to check: the file holds no run", file=sys.stderr)
