"""The stability suite: every corrected method on the stiff and extreme scenes, step limits, and conservation.

Step limits of a fixed-step method on a scene: a ladder of steps, and the largest stable step, seen and in theory, where
|R(hλ)| <= 1 for the stability function R and every eigenvalue λ (Hairer & Wanner, Solving Ordinary Differential
Equations II, IV.2). Conservation, on a scene without damping and without a load that changes: the scene, its images and
itself backwards in time; perturbed starts for the energy drift.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rotor_mbs.analysis import exact as theory
from rotor_mbs.analysis.stability import TARGET, SuiteRun, suite_runs
from rotor_mbs.methods.catalogue import find_method, method_names, settings_for
from rotor_mbs.methods.solve import solve
from rotor_mbs.methods.time_limit import OutOfTimeError, time_limit
from rotor_mbs.runs.case import Case
from rotor_mbs.runs.layout import KEY_ATTRIBUTE
from rotor_mbs.runs.records import Record, read_records, write_records
from rotor_mbs.runs.results_file import ResultsStore
from rotor_mbs.runs.runner import Job, OnProgress, Outcome, Result, execute, ignore_progress, in_pool
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.impulse import angular_momentum
from rotor_mbs.solution.judgement import Judgement, judge
from rotor_mbs.solution.metrics import energy_scale
from rotor_mbs.solution.quantities import energy_error
from rotor_mbs.solution.status import COMPLETE, code_of
from rotor_mbs.solution.trajectory import Trajectory
from rotor_mbs.studies.run import able_methods, reference_case, run_scenes
from rotor_mbs.studies.stored_references import load_reference

SUITE = ("stiff", "extreme")

# The method that `run` relies on is given time for the longest scenes: a map of time-outs shows nothing.
_PATIENT_METHOD, _PATIENT_S = "lagrange/taylor", 120.0
# A ladder takes a few times its longest run; what is over this is stuck.
_RECORD_LIMIT_S = 40.0
# Scenes on which conservation is looked at: one without gravity, one regular with it.
_SYMMETRY_SCENES = ("extreme/zero-gravity", "extreme/light-1e-2")
_DRIFT_CASE = ("extreme/zero-gravity", "lagrange/taylor")
_SOURCES = ("studies/stability.py", "analysis/exact.py")
STEPS, LIMIT, SYMMETRY, DRIFT = "steps", "limits", "symmetry", "drift"

# A ladder goes down by fours until it reaches the target, stops gaining, or a run is expected to take this long.
_FACTOR = 4
_LONGEST_RUN_S = 1.5
# A run that fails at once costs nothing, however small its step.
_MOST_STEPS = 1e7
# Bisection: a window of so many radians of the fastest mode; a pitch this many times its start has grown, not swung.
_WINDOW_RADIANS = 5e3
_GROWTH = 100.0
_INTERVALS = 10
# Conservation.
_LIMIT_S = 30.0
# Enough starts for an exponent to ±0.05, on a motion long enough for round-off to walk.
STARTS = 64
_LONG_S = 4000.0
_PERTURBATION = 1e-3
_SEED = 20200101  # any: the starts must be the same on every machine


def run_suite(
    scenes: Sequence[Scene],
    output: Path,
    *,
    workers: int,
    timeout_s: float,
    methods: Sequence[str] = (),
    settings: Mapping[str, object] | None = None,
    on_progress: OnProgress = ignore_progress,
) -> list[Outcome]:
    """The suite on some scenes into the results file `output`; what this call computed, or tried to.

    methods: all corrected ones where none is named; settings: of the methods that have them, for the runs of the map
    (the step ladders vary the step by themselves).
    What the file has already is kept; records of these scenes that are no longer wanted are dropped. Raises InputError,
    StoreError.
    """
    asked = {scene.name: able_methods(scene, methods or method_names(is_corrected=True))[0] for scene in scenes}
    none: Mapping[str, Sequence[str]] = dict.fromkeys(asked, ())  # references, some of which take long, first
    patient = {name: [method for method in able if method == _PATIENT_METHOD] for name, able in asked.items()}
    every = dict.fromkeys(method for able in asked.values() for method in able)
    chosen_settings = settings_for(list(every), settings or {})
    made: list[Outcome] = []
    for chosen, limit_s in ((none, timeout_s), (patient, max(timeout_s, _PATIENT_S)), (asked, timeout_s)):
        own = {k: v for able in chosen.values() for method in able for k, v in chosen_settings[method].items()}
        report = run_scenes(
            scenes, chosen, output, workers=workers, timeout_s=limit_s, settings=own, on_progress=on_progress
        )
        made += report.made
    return made + complete_records(scenes, asked, output, workers, on_progress)


def complete_records(
    scenes: Sequence[Scene],
    methods: Mapping[str, Sequence[str]],
    output: Path,
    workers: int,
    on_progress: OnProgress = ignore_progress,
) -> list[Outcome]:
    """Step ladders, step limits and conservation of these scenes, where the runs in `output` call for them."""
    cases = _step_cases(scenes, suite_runs(output))
    cases += [
        Case(scene, method, study=DRIFT if (scene.name, method) == _DRIFT_CASE else SYMMETRY, sources=_SOURCES)
        for scene in scenes
        if scene.name in _SYMMETRY_SCENES
        for method in methods[scene.name]
    ]
    store = ResultsStore(output)
    made = execute(cases, in_pool(perform_record, workers, _RECORD_LIMIT_S), store, on_progress)
    records = read_records(output, "steps", "limits", "conservation")
    stale = {record.key for record in records if record.method in methods.get(record.scene, ())}
    stale -= {case.key for case in cases}
    if stale:
        store.merge((), without=stale)
    return made


def _step_cases(scenes: Sequence[Scene], found: Sequence[SuiteRun]) -> list[Case]:
    """Ladders where a fixed step may matter: the stiff and light scenes, and runs that failed at the default step."""
    by_name = {scene.name: scene for scene in scenes}
    cases = []
    for run in found:
        scene = by_name.get(run.scene)
        if scene is None or not find_method(run.method).fixed_step or not run.has_reference:
            continue
        reference = reference_case(scene).key
        if run.is_stiff_or_light or run.status in ("inaccurate", "diverged", "solver_failed"):
            cases.append(Case(scene, run.method, study=STEPS, reference=reference, sources=_SOURCES))
        if has_limit(scene, run.method):
            cases.append(Case(scene, run.method, study=LIMIT, reference=reference, sources=_SOURCES))
    return cases


def perform_record(job: Job) -> Result:
    """Computes and stores one record, in a worker process."""
    case = job.case
    compute = {STEPS: ladder_record, LIMIT: limit_record, SYMMETRY: conservation_record, DRIFT: conservation_record}
    record = compute[case.study](job)
    attributes = {**record.attributes, "scene_hash": case.scene_hash, KEY_ATTRIBUTE: case.key}
    write_records(job.part, [replace(record, attributes=attributes)])
    return Result("ok")


def has_limit(scene: Scene, method: str) -> bool:
    """Whether theory gives a limit: an explicit method, and a spring in every bearing."""
    has_function = find_method(method).stability_function is not None
    return has_function and bool(scene.bearing_stiffness) and min(scene.bearing_stiffness) >= 1e6


def ladder_record(job: Job) -> Record:
    """Errors in rad over steps in s, and the step that the target needs."""
    scene, method = job.case.scene, job.case.method
    reference = load_reference(job.reference, scene) if job.reference is not None else None
    rows: list[tuple[float, Judgement]] = []
    expected, step = 0.0, scene.duration / (scene.samples - 1)
    while expected <= _LONGEST_RUN_S and scene.duration <= _MOST_STEPS * step:
        judgement, seconds = _judged(scene, method, {"step": step}, reference)
        rows.append((step, judgement))
        if judgement.metrics.get("angle_error_max", np.inf) <= 0.1 * TARGET and judgement.status == "ok":
            break
        expected, step = _FACTOR * seconds, step / _FACTOR
    judgements = [judgement for _, judgement in rows]
    # A run that broke off has no error up to the horizon.
    errors = [one.metrics.get("angle_error_max", np.nan) if one.status in COMPLETE else np.nan for one in judgements]
    arrays = {
        "step": np.array([step for step, _ in rows]),
        "status": np.array([code_of(one.status) for one in judgements], dtype=np.int64),
        "angle_error_max": np.array(errors),
        "energy_drift_max": np.array([one.metrics.get("energy_drift_max", np.nan) for one in judgements]),
    }
    attributes: dict[str, object] = {"false_successes": sum(one.false_success for one in judgements)}
    needed = step_for(TARGET, arrays["step"], arrays["angle_error_max"])
    if needed is not None:
        attributes["step_for_target_s"] = needed
    return Record("steps", scene.name, method, attributes, arrays)


def step_for(target: float, steps: np.ndarray, errors: np.ndarray) -> float | None:
    """s: where the error crosses `target` for good, by a straight line in logarithms; None where it does not."""
    below = errors <= target
    if not below.any() or not below[-1]:
        return None
    last = len(errors) - 1 - int(np.argmin(below[::-1])) if not below.all() else -1
    if last < 0 or not np.isfinite(errors[last]) or errors[last + 1] == 0.0:
        return float(steps[last + 1])
    slope = np.log(errors[last] / errors[last + 1]) / np.log(steps[last] / steps[last + 1])
    return float(steps[last + 1] * (target / errors[last + 1]) ** (1.0 / slope))


def _judged(
    scene: Scene, method: str, settings: Mapping[str, object], reference: Trajectory | None
) -> tuple[Judgement, float]:
    """The judgement and the run time in s; a run over twice the longest one ends itself."""
    try:
        with time_limit(2.0 * _LONGEST_RUN_S):
            run = solve(method, scene, settings)
    except OutOfTimeError as exc:
        return Judgement("timed_out", str(exc), False, {}), 2.0 * _LONGEST_RUN_S
    return judge(scene, run, reference), run.run_times_s[0]


def limit_record(job: Job) -> Record:
    """The largest stable step by bisection on what becomes of the pitches, beside that of the theory."""
    scene, method = job.case.scene, job.case.method
    function = find_method(method).stability_function
    assert function is not None  # see has_limit
    # Of a pitch about zero, the rotor fixed: gravity and rotation are negligible beside such a spring.
    inertias = [(blade.pitch_inertia, *scene.bearing(i)) for i, blade in enumerate(scene.blades)]
    modes = [mode for numbers in inertias for mode in oscillator_modes(*numbers)]
    window = _WINDOW_RADIANS / max(abs(mode) for mode in modes)
    short = replace(scene, duration=window, samples=_INTERVALS + 1, outputs=("angles", "rates"))
    theory = largest_stable_step(function, modes, window, _GROWTH)
    low = max(1, int(0.5 * window / theory / _INTERVALS))  # steps per interval: too few, enough
    high = 4 * low + 1
    if not _stays(short, method, high) or _stays(short, method, low):
        found = float("nan")
    else:
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if _stays(short, method, middle) else (middle, high)
        found = window / (_INTERVALS * high)
    attributes = {
        "largest_stable_step_s": found,
        "theory_s": theory,
        "fastest_mode_per_s": max(abs(mode) for mode in modes),
        "mode_damping_ratio": min(1.0, *(abs(mode.real) / abs(mode) for mode in modes)),
    }
    return Record("limits", scene.name, method, attributes)


def _stays(scene: Scene, method: str, steps: int) -> bool:
    """Whether every pitch keeps within `_GROWTH` times the largest one at the start, to the end."""
    step = scene.duration / (_INTERVALS * steps)
    with time_limit(20.0):
        run = solve(method, scene, {"step": step})
    pitches = np.abs(run.trajectory.angles[:, 1:])
    complete = len(pitches) == scene.samples
    return complete and float(pitches.max()) <= _GROWTH * max(map(abs, scene.initial_angles[1:]))


def oscillator_modes(inertia: float, stiffness: float, damping: float) -> tuple[complex, complex]:
    """λ in 1/s of J θ̈ + d θ̇ + k θ = 0 (kg m², N m/rad, N m s/rad)."""
    root = cmath.sqrt(damping * damping - 4.0 * inertia * stiffness)
    return (-damping + root) / (2.0 * inertia), (-damping - root) / (2.0 * inertia)


def largest_stable_step(
    stability_function: Callable[[complex], complex], modes: Sequence[complex], window: float, growth: float
) -> float:
    """s: where the first range of steps ends on which no mode grows more than `growth`-fold in `window` s.

    Growth within a window, not |R| <= 1 itself, is what a run can show: RK67 has |R| > 1 on the whole imaginary axis,
    by so little at small steps that nothing comes of it. By scan and bisection.
    """
    fastest = max(abs(mode) for mode in modes)

    def stable(h: float) -> bool:
        largest = max(abs(stability_function(h * mode)) for mode in modes)
        return window / h * math.log(largest) <= math.log(growth)

    width = 0.01 / fastest
    step = width
    while stable(step + width):
        step += width
    low, high = step, step + width
    while high - low > 1e-6 / fastest:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


def conservation_record(job: Job) -> Record:
    """What an exact run conserves: errors, relative or in rad; where a run fails, its message."""
    scene, method = job.case.scene, job.case.method
    try:
        with time_limit(_LIMIT_S):
            symmetry = _symmetry(scene, method)
            if job.case.study != DRIFT:
                return Record("conservation", scene.name, method, symmetry)
            drift = drift_record(scene, method)
            return replace(drift, attributes={**symmetry, **drift.attributes})
    except OutOfTimeError as exc:
        return Record("conservation", scene.name, method, {"message": str(exc)})


def drift_record(scene: Scene, method: str) -> Record:
    """Root mean square of the relative energy error over perturbed starts, over time, and its growth exponent."""
    generator = np.random.default_rng(_SEED)
    long = replace(scene, duration=_LONG_S, samples=401, outputs=("angles", "rates", "energy"))
    squares = np.zeros(long.samples)
    for _ in range(STARTS):
        shift = _PERTURBATION * generator.standard_normal(len(long.initial_angles))
        start = replace(long, initial_angles=tuple((np.array(long.initial_angles) + shift).tolist()))
        run = _run(start, method)
        error = energy_error(run)
        assert error is not None  # the scene asks for energies
        squares += (error / energy_scale(start, run)) ** 2
        time = run.time
    rms = np.sqrt(squares / STARTS)
    attributes = {"exponent": theory.drift_exponent(time, rms), "starts": STARTS, "largest": float(rms.max())}
    return Record("conservation", scene.name, method, attributes, {"time": time, "energy_drift_rms": rms})


def _run(scene: Scene, method: str) -> Trajectory:
    return solve(method, scene, {}).trajectory


def _symmetry(scene: Scene, method: str) -> dict[str, float]:
    """rad, but for the angular momentum (relative); what does not exist for the scene is left out."""
    there = _run(scene, method)
    found = {
        "mirror_error": theory.mirror_error(there.angles, _run(theory.mirrored(scene), method).angles),
        "relabelling_error": theory.relabelling_error(there.angles, _run(theory.relabelled(scene), method).angles),
    }
    # From the last sample on with all rates reversed it runs back to its start.
    end = tuple(there.angles[-1].tolist()), tuple((-there.rates[-1]).tolist())
    back = _run(replace(scene, initial_angles=end[0], initial_rates=end[1]), method)
    found["reversal_error"] = float(np.abs(back.angles[-1] - np.array(scene.initial_angles)).max())
    if scene.gravity == 0.0 and not scene.has_torque:
        momentum = angular_momentum(scene, there.angles, there.rates)
        found["angular_momentum_drift"] = float(np.abs(momentum - momentum[0]).max() / abs(momentum[0]))
    return found
