"""Verdicts on a results file: each a number against a bound, with what to look at. Reads the store alone.

Every number is computed again from the stored samples; a metric or status in the file is checked, never used.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass

import numpy as np

from rotor_mbs.analysis import kinematics
from rotor_mbs.analysis.claims import claims
from rotor_mbs.analysis.exact import exact_rotor_angle
from rotor_mbs.analysis.rehydrate import Rehydrated, reference_of, rehydrate
from rotor_mbs.analysis.run_integrity import copies, settings_faults, steps_off
from rotor_mbs.analysis.run_selection import PRINTED
from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.methods.catalogue import REFERENCE, is_corrected, methods
from rotor_mbs.runs.digests import DIGESTS
from rotor_mbs.runs.files import reading
from rotor_mbs.runs.read import OpenResults, StoredRun, StoredScene, all_damages
from rotor_mbs.scenario.accuracy_bounds import Bounds
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.solution.judgement import energy_slack, judge, quantity_bound, quantity_errors, start_slack
from rotor_mbs.solution.metrics import Metrics, energy_scale, metrics_of
from rotor_mbs.solution.quantities import energy_error
from rotor_mbs.solution.solution import Solution
from rotor_mbs.solution.status import COMPLETE
from rotor_mbs.solution.trajectory import Array, Trajectory


@dataclass(frozen=True, slots=True)
class Verdict:
    """`value` of `channel` against `bound`, both in `unit`; `look_at` says where a failure would come from."""

    check: str
    scene: str
    method: str
    channel: str
    value: float
    bound: float
    unit: str
    look_at: str

    @property
    def passed(self) -> bool:
        return self.value <= self.bound  # False for NaN

    @property
    def margin(self) -> float:
        """How many times the value would fit into the bound; infinite for a value of zero."""
        if math.isnan(self.value):
            return 0.0
        return self.bound / self.value if self.value else math.inf


def judged(
    bounds: Bounds, check: str, scene: str, method: str, channel: str, value: float, unit: str, look_at: str
) -> Verdict:
    """A value against the bound of its check that counts for the method."""
    return Verdict(check, scene, method, channel, float(value), bounds.of(check, method).value, unit, look_at)


def verdicts(results: OpenResults, frozen: Sequence[OpenResults], bounds: Bounds) -> list[Verdict]:
    """Every verdict that the file allows, in the order of its scenes. `frozen`: the shipped references.

    Raises InputError where a stored scene is none.
    """
    bounds = bounds.with_entries(bound for method in methods() for bound in method.bounds)
    shipped = {name: scene for file in frozen for name, scene in file.scenes.items()}
    found: list[Verdict] = []
    with np.errstate(all="ignore"):  # a hostile file may hold any number; what overflows fails
        damages = _damages(results)
        for scene in results.scenes.values():
            own = bounds.for_scene(scene.name if _is_shipped(scene) else "")
            known = shipped.get(scene.name) if own.scene else None
            exact = _readable_reference(scene)
            for run in scene.runs.values():
                found += _of_stored_run(scene, run, exact, own, damages.pop(f"{scene.name}/{run.method}", []))
            found += _copies(scene, own)
            found += _of_reference(scene, known.reference if known is not None else None, own)
        found += [_integrity(place, "*", parts, bounds) for place, parts in damages.items()]
        found += _of_paper(results, bounds)
    return found


def _is_shipped(scene: StoredScene) -> bool:
    """Whether it is a scene of this package, number by number: the bounds of its name are for no other."""
    try:
        return any(scene_hash(one) == scene.attributes["scene_hash"] for one in find_scenes([scene.name]))
    except InputError:
        return False


def _damages(results: OpenResults) -> dict[str, list[str]]:
    """Parts that are not what was written, by the path of their group; the root's is "file"."""
    found: dict[str, list[str]] = {}
    with reading(results.path):
        for place, part in all_damages(results.root):
            found.setdefault(place or "file", []).append(part)
    return found


def _integrity(scene: str, method: str, parts: Sequence[str], bounds: Bounds) -> Verdict:
    look = f"{', '.join(parts)} changed after it was written" if parts else "as written"
    if list(parts) == [DIGESTS]:
        look = "it has no digests: they were removed, or an earlier version wrote it"
    return judged(bounds, "integrity", scene, method, "digests", len(parts), "parts", look)


def _readable_reference(scene: StoredScene) -> Trajectory | None:
    """Read once for all runs of the scene; a reference that cannot be read fails with each of them."""
    try:
        return reference_of(scene)
    except StoreError:
        return None


def _of_stored_run(
    scene: StoredScene, run: StoredRun, reference: Trajectory | None, bounds: Bounds, damages: Sequence[str]
) -> list[Verdict]:
    """Verdicts on what can still be judged of a run that is known to be damaged."""
    found = [_integrity(scene.name, run.method, damages, bounds)]
    try:
        with reading(str(scene.name), run.method) if damages else nullcontext():
            found += _of_run(run, bounds, rehydrate(scene, run, reference), _motion_ends(scene))
    except StoreError as exc:
        found.append(_make("complete", run, "all", math.nan, bounds, "faults", str(exc)))
    return found


def _copies(scene: StoredScene, bounds: Bounds) -> list[Verdict]:
    """One verdict for a scene with several runs; where there are copies, one for each pair."""
    if len(scene.runs) < 2:
        return []
    try:
        found = {(run, other): place for run, other, place in copies(scene)}
    except StoreError:
        return []  # the run that cannot be read has failed already
    if not found:
        return [judged(bounds, "copied", scene.name, "*", "all", 0.0, "columns", "no two runs have the same bits")]
    look = "{} is that of {} bit for bit: data stored, or read, under another method's name"
    return [
        _make("copied", run, place, 1.0, bounds, "columns", look.format(place, other))
        for (run, other), place in found.items()
    ]


def _make(check: str, run: StoredRun, channel: str, value: float, bounds: Bounds, unit: str, look_at: str) -> Verdict:
    return judged(bounds, check, run.scene, run.method, channel, value, unit, look_at)


def _motion_ends(scene: StoredScene) -> bool:
    """Whether the reference itself stops early: the motion does not exist beyond."""
    reference = scene.reference
    return reference is not None and "time" in reference and reference.status == "singular"


def _of_run(run: StoredRun, bounds: Bounds, found: Rehydrated, motion_ends: bool) -> Iterator[Verdict]:
    """A run that stops early and reports it is complete where the motion ends there."""
    reports_it = found.run is not None and run.status not in COMPLETE
    excused = reports_it and (motion_ends or not is_corrected(run.method))
    faults = [] if excused else found.faults
    look = "; ".join(faults) or "every channel, row and number is there"
    if faults and run.status != "ok":
        look += f"; stored as {run.status}: {run.attributes.get('message', '')}"
    yield _make("complete", run, "all", float(len(faults)), bounds, "faults", look)
    if found.run is None:
        return
    yield _status(run, bounds, found, found.run)
    yield from _of_settings(run, bounds, found.scene)
    if len(found.run.trajectory.time):
        yield from _of_samples(run, bounds, found.scene, found.run)
        if is_corrected(run.method) and run.method != REFERENCE:
            yield from _of_corrected_model(run, bounds, found, found.run.trajectory)


def _status(run: StoredRun, bounds: Bounds, found: Rehydrated, recorded: Solution) -> Verdict:
    judged = judge(found.scene, recorded, found.reference)
    claimed = bool(run.attributes.get("false_success", 0))
    faults = (judged.status != run.status) + (judged.false_success != claimed)
    look = f"stored {run.status}, its samples say {judged.status} {judged.message}".rstrip()
    if judged.false_success != claimed:
        look += "; the engine's claim of success is " + ("false" if judged.false_success else "not false")
    return _make("status", run, "status", float(faults), bounds, "faults", look)


def _of_settings(run: StoredRun, bounds: Bounds, scene: Scene) -> Iterator[Verdict]:
    faults = settings_faults(run)
    look = "; ".join(faults) or "the method's, each within its range"
    yield _make("settings", run, "settings", float(len(faults)), bounds, "faults", look)
    steps = steps_off(scene, run, bounds.scene)
    if steps is not None:
        yield _make("steps", run, "steps", steps[0], bounds, "relative", steps[1])


def _of_samples(run: StoredRun, bounds: Bounds, scene: Scene, recorded: Solution) -> Iterator[Verdict]:
    """What the samples say of each other, whatever equations moved them."""
    trajectory = recorded.trajectory
    times = np.linspace(0.0, scene.duration, scene.samples)[: len(trajectory.time)]
    off = float(np.abs(trajectory.time - times).max()) / scene.duration
    yield _make("times", run, "time", off, bounds, "of duration", "samples are equally spaced, both ends included")
    if not scene.wants("angles"):
        return
    yield _make("start", run, "angles, rates", _start_off(scene, trajectory), bounds, "rad, rad/s", "the initial state")
    if trajectory.tip is not None:
        away = np.linalg.norm(trajectory.tip - kinematics.tip_paths(scene, trajectory.angles), axis=2).max()
        length = max(float(np.linalg.norm(blade.tip)) for blade in scene.blades) or 1.0
        look = "the tip point, a phase, or the rotation of a blade"
        yield _make("tip", run, "tip", float(away) / length, bounds, "of length", look)
    if trajectory.energy_error is not None:
        own = energy_error(trajectory)
        off = math.nan if own is None else float(np.abs(trajectory.energy_error - own).max())
        look = "the balance is not that of the stored energies"
        yield _make(
            "energies", run, "energy error", off / (energy_scale(scene, trajectory) or 1.0), bounds, "of scale", look
        )
    if scene.wants("rates") and trajectory.kinetic_energy is not None:
        for name, off in _energies_off(scene, trajectory).items():
            look = "its own angles and rates give another energy: a mass, an inertia, a spring"
            yield _make("energies", run, name, off, bounds, "of scale", look)


def _start_off(scene: Scene, trajectory: Trajectory) -> float:
    angles = np.abs(trajectory.angles[0] - scene.initial_angles)
    # A pitch without inertia is fixed: its rate is zero, whatever the scene says.
    given = [scene.initial_rates[0]] + [
        rate if blade.has_pitch_inertia else 0.0
        for rate, blade in zip(scene.initial_rates[1:], scene.blades, strict=True)
    ]
    rates = np.abs(trajectory.rates[0] - given) if scene.wants("rates") else np.zeros(1)
    size = max(1.0, *map(abs, scene.initial_angles), *map(abs, given))
    return max(float(angles.max()), float(rates.max())) / size


def _energies_off(scene: Scene, trajectory: Trajectory) -> dict[str, float]:
    angles, rates = trajectory.angles, trajectory.rates
    kinetic = kinematics.kinetic_energy(scene, angles, rates)
    formulas: dict[str, tuple[Array | None, Array | None]] = {
        "kinetic energy": (trajectory.kinetic_energy, kinetic),
        "potential energy": (trajectory.potential_energy, kinematics.potential_energy(scene, trajectory.time, angles)),
        "work": (trajectory.work, kinematics.work_of_constant_loads(scene, angles)),
        "work at the start": (None if trajectory.work is None else trajectory.work[:1], np.zeros(1)),
    }
    scale = max(energy_scale(scene, trajectory), float(np.abs(kinetic).max())) or 1.0
    return {
        name: float(np.abs(stored - own).max()) / scale
        for name, (stored, own) in formulas.items()
        if stored is not None and own is not None
    }


def _of_corrected_model(run: StoredRun, bounds: Bounds, found: Rehydrated, trajectory: Trajectory) -> Iterator[Verdict]:
    """What is asked only of a model that claims the corrected equations: reference, energy balance, exact solutions."""
    scene = found.scene
    metrics = metrics_of(scene, trajectory, found.reference)
    if scene.wants("angles") and "angle_error_per_growth" in metrics:
        look = f"{metrics['angle_error_max']:.1e} rad up to {metrics['horizon_s']:.2f} s: a term, a parameter, the step"
        error = max(metrics["angle_error_per_growth"] - start_slack(scene), 0.0)
        yield _make("agreement", run, "angles", error, bounds, "per growth", look)
        if bounds.find("horizon", run.method):
            look = "1e-9 rad, the promise of docs/findings.md, up to the horizon"
            yield _make("horizon", run, "angles", metrics["angle_error_max"], bounds, "rad", look)
    if "energy_drift_max" in metrics:
        drift = max(metrics["energy_drift_max"] - energy_slack(scene, trajectory), 0.0)
        look = "a force without its potential, a wrong mass matrix, or too long a step"
        yield _make("energy", run, "balance", drift, bounds, "of scale", look)
    for channel in ("angular", "linear"):
        if (name := f"{channel}_impulse_error_max") in metrics:
            look = "momentum less the impulses of torque, weights and bearing: a force, an inertia, or too long a step"
            yield _make("impulse", run, channel, metrics[name], bounds, "of scale", look)
    yield from _of_quantities(run, bounds, scene, metrics)
    exact = exact_rotor_angle(scene, trajectory.time) if scene.wants("angles") else None
    if exact is not None:
        name, angle = exact
        off = float(np.abs(trajectory.angles[:, 0] - angle).max())
        yield _make("exact", run, "rotor angle", off, bounds, "rad", f"{name}, solved analytically")


def _of_quantities(run: StoredRun, bounds: Bounds, scene: Scene, metrics: Metrics) -> Iterator[Verdict]:
    """Every quantity that is judged by a rule of its declaration."""
    for quantity, rule, error in quantity_errors(scene, metrics):
        bound = quantity_bound(rule, bounds, run.method)
        if bound is not None:
            check, channel = rule.check or quantity.name, rule.channel or quantity.name
            unit = rule.unit or quantity.units
            yield Verdict(check, run.scene, run.method, channel, error, bound, unit, rule.look_at or quantity.long_name)


def _of_reference(scene: StoredScene, shipped: StoredRun | None, bounds: Bounds) -> Iterator[Verdict]:
    """The reference in the file against the shipped one of the same scene; a file without one cannot be judged."""
    stored = scene.reference
    look = "an altered reference, or a changed scene or closed form"
    if stored is None:
        bound = bounds.of("reference", REFERENCE).value
        look = "the file has no reference to compare the runs with"
        yield Verdict("reference", scene.name, REFERENCE, "all", math.nan, bound, "rad", look)
    elif shipped is not None:
        for name in ("angles", "rates"):
            if name in stored:
                off = _distance(shipped.array(name), stored.array(name))
                yield _make("reference", stored, name, off, bounds, "rad, rad/s", look)
        for name, check in (("error_growth", "growth"), ("angle_uncertainty", "uncertainty")):
            if name in shipped:
                off = _log_distance(shipped, stored, name)
                yield _make(check, stored, name.replace("_", " "), off, bounds, "log", look)


def _distance(first: Array, second: Array) -> float:
    if first.shape != second.shape or second.dtype.kind != "f":
        return math.nan
    return float((np.abs(first - second) / np.maximum(1.0, np.abs(first))).max()) if first.size else 0.0


def _log_distance(shipped: StoredRun, stored: StoredRun, name: str) -> float:
    """Largest |ln| of the ratio, as far as both are positive and finite; NaN where one is missing."""
    first, second = shipped.array(name), stored.array(name) if name in stored else np.empty(0)
    if first.shape != second.shape or second.dtype.kind != "f":
        return math.nan
    used = np.isfinite(first) & (first > 0.0)
    return float(np.abs(np.log(second[used] / first[used])).max(initial=0.0))


def _of_paper(results: OpenResults, bounds: Bounds) -> Iterator[Verdict]:
    """The paper's numbers, in units of their last printed digit."""
    for claim in claims(results.scenes):
        item, value = claim.published, claim.printed.value
        if item.of is None or value is None:
            continue
        off = abs(round(value, item.decimals) - item.value) * 10**item.decimals
        look = f"the paper prints {item.value}, the run gives {value:.6f}: the printed entries, g, ode45"
        yield judged(bounds, "published", item.of.scene, PRINTED, item.id, off, "last digits", look)
