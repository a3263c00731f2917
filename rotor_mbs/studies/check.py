"""The accuracy check: verdicts on a results file, or on a default set that is computed for the purpose."""

from __future__ import annotations

import math
import tempfile
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from rotor_mbs.analysis.run_integrity import defaults_faults
from rotor_mbs.analysis.verdicts import Verdict, judged, verdicts
from rotor_mbs.errors import RotorError, StoreError
from rotor_mbs.methods.catalogue import REFERENCE, default_methods, find_method, method_names
from rotor_mbs.runs.case import Case
from rotor_mbs.runs.freeze import changed_arrays
from rotor_mbs.runs.pool import local_pool, run_in
from rotor_mbs.runs.read import is_sweep, open_results
from rotor_mbs.studies.run import OnProgress, ignore_progress
from rotor_mbs.runs.table import MISSING
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.scenario.accuracy_bounds import Bounds, expected_settings
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.studies.check_probes import SPEED_RATIOS, measure, measured, probe, probes
from rotor_mbs.studies.run import run_scenes
from rotor_mbs.studies.stored_references import shipped_files

# The chain takes as long as all else together; four scenes of the paper cover what it can show.
_CHAIN, _CHAIN_SCENES = "exudyn_chain/generalized_alpha", ("paper/fig03", "paper/fig04b", "paper/fig08", "paper/fig11")
_TIMEOUT_S, _PROBE_S = 60.0, 90.0
_OF_EVERY_RUN = "status"  # a check that each run has one verdict of
# A value below a few units in the last place of a double is rounding: its change says nothing.
_ROUNDING = 2.0**-50


def default_set() -> tuple[list[Scene], dict[str, Sequence[str]]]:
    """Scenes, and methods by scene name, that are computed where no file is given.

    Every scene of the paper by the fast models, the chain on some; the scenes made for checking by every method.
    """
    paper, own = find_scenes(["paper"]), find_scenes(["check"])
    corrected = [name for name in method_names(is_corrected=True) if find_method(name).is_installed]
    methods: dict[str, Sequence[str]] = {
        scene.name: [name for name in default_methods() if name != _CHAIN or scene.name in _CHAIN_SCENES]
        for scene in paper
    }
    methods |= {scene.name: corrected for scene in own}
    return [*paper, *own], methods


def check_file(path: Path, bounds: Bounds, required: Sequence[str] = ()) -> list[Verdict]:
    """Verdicts on what is stored, and on whether every scene has a run of each required method.

    Raises StoreError, InputError.
    """
    found = judge_file(path, bounds)
    there = {(one.scene, one.method) for one in found}
    scenes = dict.fromkeys(one.scene for one in found if one.check == _OF_EVERY_RUN)
    wanted = [(scene, method) for scene in scenes for method in required]
    return [*found, *(_required(*one, "not in the file", is_missing=one not in there) for one in wanted)]


def check_default_set(bounds: Bounds, workers: int, on_progress: OnProgress = ignore_progress) -> list[Verdict]:
    """Computes the set and judges it, and the frozen references and bounds that it is judged by."""
    found = [*judge_bounds(bounds), *judge_frozen(bounds), *judge_defaults(bounds)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "check.h5"
        report = run_scenes(*default_set(), path, workers=workers, timeout_s=_TIMEOUT_S, on_progress=on_progress)
        found += [_required(one.case.scene.name, one.case.method, one.result.message) for one in report.not_computed]
        found += judge_file(path, bounds)
    return found + judge_probes(probes(), bounds, workers)


def check_speed(bounds: Bounds) -> list[Verdict]:
    """Run times against those on file, one after the other; meaningful on an idle machine alone."""
    return judge_probes([probe("speed", "paper/fig11", method) for method in SPEED_RATIOS], bounds, 1)


def judge_file(path: Path, bounds: Bounds) -> list[Verdict]:
    """Verdicts on what is there: runs, or a sweep. Raises StoreError, InputError."""
    if is_sweep(path):
        return _judge_sweep(StoredSweep(path, allow_damaged_runs=True), bounds)
    try:
        with ExitStack() as stack:
            results = stack.enter_context(open_results(path, verify=False))
            shipped = [stack.enter_context(open_results(file)) for file in shipped_files()]
            found = verdicts(results, shipped, bounds)
    except (RuntimeError, OSError) as exc:  # what HDF5 finds wrong, at whatever place
        raise StoreError(f"{path}: damaged or incomplete ({' '.join(str(exc).split())[:150]})") from exc
    if path.resolve() in shipped_files():  # their digests stand beside them
        found = [one for one in found if one.check != "integrity"] + judge_frozen(bounds, [path])
    return found


def _judge_sweep(sweep: StoredSweep, bounds: Bounds) -> list[Verdict]:
    """Whether all runs are there, and as they were written; their energies were judged when they were computed."""
    scene = str(sweep.attributes.get("base_scene", "sweep"))
    missing = int((sweep.column("status") == MISSING).sum())
    damaged = len(sweep.damaged_runs)
    look = f"{missing} runs missing; the sweep's own command computes them"
    changed = f"{damaged} runs changed after they were written" if damaged else "every run as written"
    return [
        judged(bounds, "complete", scene, "*", "runs", missing, "runs", look),
        judged(bounds, "integrity", scene, "*", "runs", damaged, "runs", changed),
    ]


def _required(scene: str, method: str, look: str, *, is_missing: bool = True) -> Verdict:
    return Verdict("required", scene, method, "run", float(is_missing), 0.0, "missing", look)


def judged_runs(found: Iterable[Verdict]) -> Counter[str]:
    """How many runs of each method were judged, so that a run that is not there is missed by whoever reads."""
    return Counter(one.method for one in found if one.check == _OF_EVERY_RUN and one.method != REFERENCE)


def judge_bounds(bounds: Bounds) -> list[Verdict]:
    """Every shipped bound below what a known fault gives: else it would let that fault pass."""
    return [
        Verdict("bound", "bounds", one.method, one.check, one.value, one.fault, "as its check", one.known_fault)
        for one in bounds.entries
        if math.isfinite(one.fault)
    ]


def judge_defaults(bounds: Bounds) -> list[Verdict]:
    """Every built-in method's defaults against the settings that its bounds were found with."""
    found = []
    for method in expected_settings():
        faults = defaults_faults(method)
        look = "; ".join(faults) or "those that the bounds were found with"
        found.append(judged(bounds, "settings", "defaults", method, "defaults", len(faults), "faults", look))
    return found


def judge_frozen(bounds: Bounds, paths: Sequence[Path] = ()) -> list[Verdict]:
    """Every shipped reference, or those of `paths`, against the digests beside its file, one verdict a scene."""
    found = []
    for path in paths or shipped_files():
        with open_results(path) as results:
            try:
                scenes = changed_arrays(results)
            except StoreError as exc:
                found.append(judged(bounds, "frozen", path.stem, REFERENCE, "all", math.nan, "arrays", str(exc)))
                continue
        for scene, names in scenes.items():
            look = f"{path.name}: {', '.join(names)} not as frozen" if names else "as frozen"
            channel = ", ".join(names) or "all"
            found.append(judged(bounds, "frozen", scene, REFERENCE, channel, len(names), "arrays", look))
    return found


def judge_probes(cases: Sequence[Case], bounds: Bounds, workers: int) -> list[Verdict]:
    """Verdicts on measurements, in the order of `cases`; a measurement that was lost fails."""
    available = [case for case in cases if case.method == "*" or find_method(case.method).is_installed]
    found: dict[Case, list[Verdict]] = {}
    with local_pool(workers) as pool:
        for end in run_in(pool, measure, available, _PROBE_S):
            if isinstance(end.error, RotorError):
                raise end.error
            found[end.task] = end.value or [measured(end.task, "all", math.nan, "", end.message)]
    return [judge_measured(one, bounds) for case in available for one in found[case]]


def judge_measured(one: Verdict, bounds: Bounds) -> Verdict:
    """A measured number against its bound."""
    return replace(one, bound=bounds.of(one.check, one.method).value)


def regressions(new: Sequence[Verdict], old: Sequence[Verdict], factor: float) -> list[Verdict]:
    """A verdict "against" for every earlier one, how many times its margin has shrunk; one for a run that is gone.

    new, old   verdicts of the same checks, made with the same bounds
    factor     allowed ratio of the earlier margin to the present one, at least 1

    The value is NaN, which fails, where `new` lacks the verdict or the run, and infinite where a verdict that passed
    fails. A verdict that failed before and fails now is no regression.

    >>> from dataclasses import replace
    >>> was = Verdict("energy", "paper/fig08", "exudyn_tree/rk67", "balance", 1e-12, 1e-9, "of scale", "")
    >>> [found] = regressions([replace(was, value=6.4e-11)], [was], factor=10.0)
    >>> round(found.value), found.passed
    (64, False)
    """
    present = {_key(verdict): verdict for verdict in new}
    runs = {(verdict.scene, verdict.method) for verdict in new}
    gone = {(one.scene, one.method): replace(one, check="run", channel="all") for one in old}
    earlier = [one for one in old if (one.scene, one.method) in runs]
    earlier += [one for run, one in gone.items() if run not in runs]
    return [_compared(present.get(_key(verdict)), verdict, factor) for verdict in earlier]


def _key(verdict: Verdict) -> tuple[str, str, str, str]:
    return verdict.check, verdict.scene, verdict.method, verdict.channel


def _compared(new: Verdict | None, old: Verdict, factor: float) -> Verdict:
    if new is None:
        value, look = math.nan, "was judged in the earlier file and is not in this one"
    else:
        value = _shrinkage(new, old)
        look = f"{old.value:.2e} before, {new.value:.2e} now, bound {new.bound:.2e} {new.unit}; {new.look_at}"
    channel = f"{old.check}: {old.channel}"
    return replace(
        old, check="against", channel=channel, value=value, bound=factor, unit="times the margin", look_at=look
    )


def _shrinkage(new: Verdict, old: Verdict) -> float:
    if not new.passed:
        return math.inf if old.passed else 1.0
    if not old.passed:
        return 0.0
    before, now = max(old.value, _ROUNDING), max(new.value, _ROUNDING)
    return (now / before) * (old.bound / new.bound if new.bound and old.bound else 1.0)
