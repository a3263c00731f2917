"""A method examined: does it build, is its protocol kept, are its motions right, and what is wrong where they are not.

Every run is made in a worker process with a time limit. A motion is judged by the defects of its intervals, which need
no reference; where one is wrong, the search of `compare` looks for the cause.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rotor_mbs.analysis.checks import Check, Where
from rotor_mbs.analysis.judgement import defects_of
from rotor_mbs.analysis.kinematics import exact_rotor_angle
from rotor_mbs.analysis.run_checks import defect_bound, energy_slack
from rotor_mbs.analysis.work_precision import fitted_order
from rotor_mbs.comparison.data import load_data
from rotor_mbs.comparison.trajectory import compare_with_reference
from rotor_mbs.errors import MethodRefusal, RotorError
from rotor_mbs.methods.base import STEP, Method
from rotor_mbs.methods.catalogue import find_method, line_of, with_method_files
from rotor_mbs.methods.solve import solve
from rotor_mbs.methods.time_limit import OutOfTimeError, caller_signals
from rotor_mbs.runs.pool import TaskLostError, TaskPool, WorkerPool
from rotor_mbs.scenario.accuracy_bounds import shipped_bounds
from rotor_mbs.scenario.catalogue import only_scene
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.defects import Defects
from rotor_mbs.solution.metrics import metrics_of
from rotor_mbs.solution.status import REFUSED
from rotor_mbs.solution.trajectory import Solution, Trajectory, sample_times
from rotor_mbs.studies.run import without_samples

# Between them they have every term; those with fewer terms first. With durations in s that show each at work, and how
# many times its bounds, which are for slow motions, a method may need: stiff bearings take more of a fixed step.
SCENES = {
    "check/point-masses": (1.0, 51, 1.0),  # gravity, a torque
    "check/general": (1.2, 61, 1.0),  # full inertia, hub, springs, dampers, shaft damping, a torque with a jump
    "check/pitch-loads": (0.75, 51, 1.0),  # torques on the pitches, pitch commands with jumps
    "check/held": (0.5, 26, 1.0),  # blades without inertia about their pitch axis
    "paper/fig11": (1.0, 51, 1.0),  # chaotic
    "turbine/pitch-step": (1.2, 61, 10.0),  # stiff bearings
}
EXACT = ("paper/fig05", "paper/fig06", "paper/fig15-10kNm", "paper/fig03")
_SMOOTH = "paper/fig11"  # order, symmetry, determinism
_ORDER_BAND = 0.3
_COARSEST = 0.02  # s, of the steps whose order is looked for
_FOLLOWS_STEP = 0.6  # order with which a defect must fall with the step to be an error of the step
_STRICT = 1e-15  # rad, so that no cause is named which leaves a part of the defects
_STANDS_OUT = 30.0  # times the median of the defects
_LONG = 1000.0  # times the duration, of a run that is to be stopped
_STOP_S, _LOAD_S = 0.5, 20.0
_FIRST_S = 300.0  # of a first run, in which an engine may compile its code
NOT_FOUND = "cause not found"


def _run(task: tuple[str, Scene, Mapping[str, object], int, float]) -> Solution:
    """In a worker process: (method, scene, settings, integrations, time limit in s). Without samples, and why, where
    the engine raises something."""
    name, scene, settings, repeats, time_limit_s = task
    try:
        with np.errstate(all="ignore"):
            return solve(name, scene, settings, repeats, time_limit_s=time_limit_s)
    except MethodRefusal as exc:
        status, message = REFUSED, str(exc)
    except OutOfTimeError as exc:
        status, message = "timed_out", str(exc)
    except Exception as exc:  # whatever an engine raises is what is asked
        status, message = "solver_failed", str(exc) if isinstance(exc, RotorError) else line_of(exc)
    return without_samples(scene, name, settings, status, message)


@caller_signals()
def examine(name: str, timeout_s: float = 60.0) -> list[Check]:
    """The checks of a method, each with the most likely reason where it fails. Raises InputError for an unknown one."""
    with WorkerPool(1) as pool:
        return _Examination(find_method(name), pool, timeout_s).checks()


class _Examination:
    def __init__(self, method: Method, pool: TaskPool, timeout_s: float) -> None:
        self._method, self._pool, self._timeout_s = method, pool, timeout_s
        bounds = shipped_bounds().with_entries(method.bounds)
        self._bound = defect_bound(bounds, method.name)
        self._energy = bounds.of("energy", method.name).value
        self._made: list[Check] = []
        self._reason = ""  # of the first wrong motion, which is the one that is searched
        self._refused: set[str] = set()

    def checks(self) -> list[Check]:
        self._ask(replace(only_scene(_SMOOTH), duration=0.02, samples=2, outputs=("angles", "rates")), limit=_FIRST_S)
        for name, (duration, samples, allowance) in SCENES.items():
            scene = replace(only_scene(name), duration=duration, samples=samples, outputs=("angles", "rates", "energy"))
            self._scene(scene, allowance)
        able = [name for name in SCENES if name not in self._refused]
        self._add("builds", "all", float(not able), 0.0, "rejects every scene")
        for name in EXACT:
            self._exact(replace(only_scene(name), duration=1.0, samples=11, outputs=("angles", "rates")))
        if _SMOOTH in able:
            scene = replace(only_scene(_SMOOTH), duration=0.2, samples=11, outputs=("angles", "rates"))
            self._symmetries(scene)
            self._order(scene)
            self._stops(scene)
        return self._made

    def _add(self, check: str, scene: str, value: float, bound: float, hint: str, unit: str = "") -> bool:
        made = Check(check, Where(scene, self._method.name, check), float(value), bound, hint, unit)
        self._made.append(made)
        return made.passed

    def _ask(
        self, scene: Scene, settings: Mapping[str, object] | None = None, *, repeats: int = 1, limit: float = 0.0
    ) -> Solution:
        """A run, not judged; its status is "" where it came back, else a reason why it has no samples."""
        name, settings, limit = self._method.name, settings or {}, repeats * (limit or self._timeout_s)
        task = (name, scene, settings, repeats, limit)
        try:
            return self._pool.submit(with_method_files(_run), task, limit + _LOAD_S).result()
        except TaskLostError as exc:
            status, message = "worker_died", str(exc)
        except Exception as exc:  # what cannot be sent from one process to the other
            status, message = "solver_failed", line_of(exc)
        return without_samples(scene, name, settings, status, message)

    def _scene(self, scene: Scene, allowance: float) -> None:
        solution = self._ask(scene)
        if solution.status == REFUSED:
            reason = solution.message
            self._refused.add(scene.name)
            self._add("refusal", scene.name, float(not reason), 0.0, reason or "without a reason")
            return
        fault = protocol_fault(solution)
        if not self._add("samples", scene.name, float(bool(fault)), 0.0, fault):
            return
        if scene.name == _SMOOTH:
            # Built again, and integrated twice: neither the process nor the solver may keep state.
            again = self._ask(scene, repeats=2)
            first, second = (run.quantities | {"time": run.time} for run in (solution, again))
            is_same = first.keys() == second.keys() and all(
                np.array_equal(values, second[name]) for name, values in first.items()
            )
            hint = "a repeated run gives different numbers: state kept between runs, or randomness"
            self._add("determinism", scene.name, float(not is_same), 0.0, hint)
        run = solution.trajectory
        defects = defects_of(scene, run)
        with np.errstate(all="ignore"):
            metrics = metrics_of(scene, run, None, defects)
        size = metrics.get("defect_judged", np.nan)
        if not size <= allowance * self._bound and not self._reason:
            self._reason = self._cause(scene, run, defects, size)
        self._add("defect", scene.name, size, allowance * self._bound, self._reason, "rad")
        if "energy_drift_max" in metrics:
            hint = "energies or work, if the defects pass; otherwise see the defects"
            bound = allowance * self._energy + energy_slack(scene, run)
            self._add("energy", scene.name, metrics["energy_drift_max"], bound, hint, "of scale")

    def _cause(self, scene: Scene, run: Trajectory, defects: Defects | None, size: float) -> str:
        """Why the defects of a run are too large: its step, or what the search of `compare` finds."""
        step, order = self._method.defaults.get("step"), self._method.order or 1.0
        if isinstance(step, float) and defects is not None:
            finer = self._ask(scene, {"step": 0.5 * step})
            if len(finer.time) == len(run.time):
                half = defects_of(scene, finer.trajectory)
                left = metrics_of(scene, finer.trajectory, None, half).get("defect_max", np.inf)
                seen = float(np.log2(size / max(left, np.finfo(float).tiny)))
                # Where the order is lower in a few intervals alone, something is wrong there.
                is_everywhere = float(defects.sizes.max()) < _STANDS_OUT * float(np.median(defects.sizes))
                if seen > order - 0.5 or (seen > _FOLLOWS_STEP and is_everywhere):
                    return f"step of {step:g} s too large: half the step gives {left:.1e} rad, order {seen:.1f}"
        try:
            data = load_data({"time": run.time, "angles": run.angles, "rates": run.rates}, scene)
            likely = compare_with_reference(data, scene, _STRICT)[0].likely
        except RotorError:
            likely = ()
        return " or ".join(likely) or NOT_FOUND

    def _exact(self, scene: Scene) -> None:
        known = exact_rotor_angle(scene, sample_times(scene))
        solution = self._ask(scene)
        if known is None or solution.status == REFUSED:
            return
        name, angle = known
        fault = protocol_fault(solution)
        error = np.inf if fault else np.abs(solution.angles[:, 0] - angle).max()
        # The defects of all intervals, added up; the pendulum falls, in a second by less than tenfold.
        bound = 10.0 * scene.samples * self._bound
        self._add("exact", scene.name, error, bound, fault or f"{name}: {self._reason or NOT_FOUND}", "rad")

    def _symmetries(self, scene: Scene) -> None:
        """Of a rotor whose blades are alike and symmetric: its mirror image, and its blades by other numbers."""
        (rotor, *pitches), (spin, *rates), blades = scene.initial_angles, scene.initial_rates, len(scene.blades)
        turn, sign = 2.0 * np.pi / blades, np.array([1.0, *[-1.0] * blades])
        mirrored = replace(
            scene,
            initial_angles=(rotor, *(-pitch for pitch in pitches)),
            initial_rates=(spin, *(-rate for rate in rates)),
        )
        renumbered = replace(
            scene,
            initial_angles=(rotor - turn, *pitches[-1:], *pitches[:-1]),
            initial_rates=(spin, *rates[-1:], *rates[:-1]),
        )
        angles, image, others = (self._ask(one).angles for one in (scene, mirrored, renumbered))
        if len(others):
            others = np.hstack([others[:, :1] + turn, others[:, 2:], others[:, 1:2]])
        for check, there in (("mirror image", image * sign if len(image) else image), ("renumbered", others)):
            error = np.abs(angles - there).max() if angles.shape == there.shape and len(angles) else np.inf
            hint = self._reason or "blades or signs are treated differently"
            self._add(check, scene.name, error, 10.0 * scene.samples * self._bound, hint, "rad")

    def _order(self, scene: Scene) -> None:
        ladder = next((one for one in self._method.ladders if one.kind == STEP), None)
        if ladder is None or self._method.order is None:
            return
        steps, sizes = [], []
        for step, settings in ladder.rungs(_COARSEST).items():
            run = self._ask(scene, settings).trajectory
            if len(run.time) == scene.samples and (defects := defects_of(scene, run)) is not None:
                steps.append(step)
                sizes.append(max(float(defects.sizes.max()), np.finfo(float).tiny))
        order = fitted_order(np.array(steps), np.array(sizes)) if steps else None
        if order is not None:
            claimed = self._method.order
            hint = f"measured order {order:.2f}, expected {claimed:g}"
            self._add("order", scene.name, max(claimed - order, 0.0), _ORDER_BAND, hint, "below")

    def _stops(self, scene: Scene) -> None:
        """A run that would take long is to end at its time limit, by itself."""
        long = replace(scene, duration=_LONG * scene.duration, samples=int(_LONG) * (scene.samples - 1) + 1)
        solution = self._ask(long, limit=_STOP_S)
        hint = f"not stopped after {_STOP_S:g} s: {solution.message}; it had to be killed"
        self._add("time limit", scene.name, float(solution.status == "worker_died"), 0.0, hint)


def protocol_fault(solution: Solution) -> str:
    """What is wrong with the form of a run that claims to be complete; "" where nothing is."""
    scene, run, integration = solution.scene, solution.trajectory, solution.integration
    if solution.status:  # without samples
        return solution.message
    times, n = sample_times(scene), len(run.time)
    rows = np.isfinite(np.hstack([run.time[:, None], run.angles, run.rates])).all(axis=1)
    if not rows.all():
        return f"row {1 + int(np.argmin(rows))} is not finite; a run ends before it"
    if n < scene.samples:
        claim = "although it reports success" if integration.success else integration.message or "no reason given"
        return f"{n} of {scene.samples} samples, {claim}"
    if not integration.success:
        return f"reports a failure: {integration.message or 'no reason given'}"
    if n > scene.samples or np.abs(run.time - times).max() > 1e-9 * scene.duration:
        return "its times are not the scene's sample times"
    turned = np.diff(run.angles, axis=0) - 0.5 * (run.rates[1:] + run.rates[:-1]) * np.diff(times)[:, None]
    jumps = np.argwhere((np.abs(turned) > np.pi) & (np.abs(np.abs(turned) - 2.0 * np.pi) < 0.5))
    if len(jumps):
        row, column = jumps[0]
        return f"{scene.coordinate_labels[column]} jumps by a turn at t = {times[row + 1]:.6g} s: angles are wrapped"
    return ""
