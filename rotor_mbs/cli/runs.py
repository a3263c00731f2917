"""`run`, `reproduce` and `reference`: batches, and what is told of them at the end."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

from rotor_mbs.cli import EXIT_BAD_INPUT
from rotor_mbs.errors import InputError, MethodRefusal
from rotor_mbs.execution.environment import numerics_fingerprint
from rotor_mbs.methods.catalogue import ERRATA_METHODS, available_defaults, check_names
from rotor_mbs.methods.selection import choose
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.store.errata import errata_fingerprint, write_errata
from rotor_mbs.store.merge import refuse_other_kinds
from rotor_mbs.store.read import open_results
from rotor_mbs.studies.batch import Batch, Report, default_methods, execute


def run(arguments: argparse.Namespace) -> int:
    """A batch into one file. Methods named with -m must represent every scene; without, a rule takes them."""
    scenes = find_scenes(arguments.scenes)
    asked = check_names(arguments.method or ())
    if asked:
        methods, refused = _methods(scenes, asked)
        if refused:
            raise InputError(refused)
    else:
        methods, told = _chosen(scenes)
        for line in told:
            print(line, file=sys.stderr)
        scenes = [scene for scene in scenes if methods[scene.name]]
        if not scenes:
            return EXIT_BAD_INPUT
    report = execute(Batch(scenes, methods, arguments.output, arguments.jobs, arguments.timeout))
    return _tell(report, arguments.output)


def reproduce(arguments: argparse.Namespace) -> int:
    """Every scene of the paper, its default methods and each erratum alone, and the report."""
    from rotor_mbs.cli.reports import render_if_changed

    start = time.monotonic()
    scenes = find_scenes(["paper"])
    methods, _ = _methods(scenes, (*available_defaults(), *ERRATA_METHODS))
    results = arguments.output / "results.h5"
    errata = _errata_unless_in(results)
    report = execute(Batch(scenes, methods, results, arguments.jobs, arguments.timeout, also=errata))
    status = _tell(report, results)
    index = render_if_changed(results, arguments.output / "report", arguments.jobs)
    print(f"report: {index}\n{time.monotonic() - start:.1f} s in all")
    return status


def _errata_unless_in(path: Path) -> Callable[[Path], None] | None:
    """Writes the check of every printed entry; None where the results at `path` have that of the same code already."""
    from rotor_mbs.models.printed.errata import check_errata

    if path.exists():
        with open_results(path) as results:
            if errata_fingerprint(results) == numerics_fingerprint():
                return None

    def write(piece: Path) -> None:
        checks = [asdict(check) | {"explained_by": ", ".join(check.explained_by)} for check in check_errata()]
        write_errata(piece, checks, numerics_fingerprint())

    return write


def freeze(arguments: argparse.Namespace) -> int:
    """References computed anew, whatever is shipped, and stored without anything that can be computed from them."""
    from rotor_mbs.store.freeze import freeze as thin

    scenes = find_scenes(arguments.scenes)
    _refuse_other_contents(arguments.output, {scene.name for scene in scenes})
    nothing: dict[str, Sequence[str]] = {scene.name: () for scene in scenes}
    full = arguments.output.with_name(arguments.output.name + ".full.h5")
    report = execute(Batch(scenes, nothing, full, arguments.jobs, arguments.timeout, use_frozen=False))
    thin(full, arguments.output, datetime.now(UTC).date().isoformat())
    full.unlink()
    return _tell(report, arguments.output)


def _refuse_other_contents(path: Path, wanted: AbstractSet[str]) -> None:
    """A file of references is replaced as a whole: what this call does not make anew would be gone."""
    refuse_other_kinds(path)
    if not path.exists():
        return
    with open_results(path) as results:
        kept = [scene.name for scene in results.scenes.values() if scene.runs or scene.name not in wanted]
    if kept:
        raise InputError(
            f"{path}: holds {', '.join(kept)}, which would be dropped; allowed: another output file, or a file of "
            "references of these scenes alone"
        )


def _chosen(scenes: Sequence[Scene]) -> tuple[dict[str, Sequence[str]], list[str]]:
    """The methods that the rule takes for each scene, none where it refuses; and why, in a line each."""
    methods: dict[str, Sequence[str]] = {}
    told: list[str] = []
    for scene in scenes:
        try:
            choice = choose(scene, available_defaults())
        except MethodRefusal as exc:
            methods[scene.name] = ()
            told.append(str(exc))
            continue
        methods[scene.name], left_out = default_methods(scene, choice.methods)
        told += [f"{scene.name}: {choice.reason}: {', '.join(methods[scene.name])}", *left_out]
    return methods, told


def _methods(scenes: Sequence[Scene], names: Sequence[str]) -> tuple[dict[str, Sequence[str]], list[str]]:
    methods: dict[str, Sequence[str]] = {}
    refused: list[str] = []
    for scene in scenes:
        methods[scene.name], lines = default_methods(scene, names)
        refused += lines
    return methods, refused


def _tell(report: Report, output: Path) -> int:
    """The batch in a few lines; 1 where a run that should succeed did not."""
    failed, broken_off = len(report.failures), len(report.broken_off)
    ok = len(report.made) - failed - broken_off
    parts = [f"{ok} ok", f"{failed} failed" if failed else "", f"{broken_off} printed broke off" if broken_off else ""]
    made = f"{len(report.made)} runs made ({', '.join(filter(None, parts))})" if report.made else "nothing to do"
    print(f"{output}: {made}, {report.kept} there already")
    return 1 if failed else 0
