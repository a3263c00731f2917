"""Test of a method: whether it builds, keeps the protocol, and gives correct motions.

Every run is made in a worker process with a time limit. Its samples undergo the same checks as in
`run` and `check`. If a motion is wrong, its cause is searched: modified equations and numbers are
integrated from each sample to the next, and compared with the run. A modification is named as the
cause if it leaves at most a thousandth of the defects, and every other one leaves more than ten
times as much.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from rotor_mbs.analysis.judgement import bounds_of, defects_of
from rotor_mbs.analysis.kinematics import exact_rotor_angle
from rotor_mbs.analysis.run_checks import Check, RunSamples, Where, defect_bound, run_checks
from rotor_mbs.analysis.work_precision import fitted_order
from rotor_mbs.comparison.data_defects import judged_defects
from rotor_mbs.comparison.defect_search import DefectSearch
from rotor_mbs.comparison.faults import UNKNOWN_FAULT, faults_in_time
from rotor_mbs.comparison.wrong_outputs import (
    root_mean_square,
    wrong_energy,
    wrong_loads,
    wrong_rows,
    wrong_tip,
)
from rotor_mbs.errors import MethodRefusal, ResourceError, RotorError
from rotor_mbs.methods.base import STEP, Method
from rotor_mbs.methods.catalogue import error_line, find_method, with_method_files
from rotor_mbs.methods.solve import solve
from rotor_mbs.methods.time_limit import OutOfTimeError, caller_signals
from rotor_mbs.processes.pool import TaskPool, WorkerPool
from rotor_mbs.processes.worker import TaskLostError
from rotor_mbs.scenario.catalogue import only_scene
from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.scenario.time_table import LoadTable
from rotor_mbs.solution.defects import Defects
from rotor_mbs.solution.metrics import metrics_of
from rotor_mbs.solution.status import REFUSED
from rotor_mbs.solution.trajectory import Solution, Trajectory, sample_times
from rotor_mbs.studies.run import without_samples

OUTPUTS = ("angles", "rates", "tip", "energy", "loads")


def five_blades() -> Scene:
    """Return a scene of five unequal blades, with every term, load and damper.

    One of the loads jumps between two samples. All other loads have their jumps and kinks at
    samples.
    """
    blades = [
        Blade(
            mass=15.0 + i,
            centre_of_mass=(0.1 + 0.02 * i, 0.05 - 0.03 * i, 1.2 + 0.1 * i),
            inertia=(2.0, 2.1, 0.2, 0.05, -0.1, 0.02),
            tip=(0.1, 0.2, 2.4),
        )
        for i in range(5)
    ]
    rests: list[LoadTable] = [((0.0, 0.1 * (i + 1)),) for i in range(5)]
    rests[1] = ((0.0, 0.2), (0.3, 0.2), (0.3, 0.35))  # a step
    rests[2] = ((0.0, 0.3), (0.6, 0.1))  # a ramp
    torques: list[LoadTable] = [((0.0, 3.0 + i),) for i in range(5)]
    # This jump is between two samples: an engine that ends its steps only at samples integrates
    # across it.
    torques[3] = ((0.0, 6.0), (0.413, 6.0), (0.413, -4.0))
    return Scene(
        name="five unequal blades",
        title="Five unequal blades with springs, dampers, torques and commands that step and ramp",
        figures=(),
        gravity=9.81,
        duration=0.6,
        samples=31,
        outputs=OUTPUTS,
        blades=tuple(blades),
        hub_inertia=5.0,
        initial_angles=(0.4, *(0.5 - 0.3 * i for i in range(5))),
        initial_rates=(2.0, *(0.5 - 0.4 * i for i in range(5))),
        rotor_torque=((0.0, 20.0), (0.3, 60.0), (0.3, -10.0), (0.6, 5.0)),
        bearing_stiffness=tuple(30.0 + 5.0 * i for i in range(5)),
        bearing_damping=tuple(2.0 + 0.5 * i for i in range(5)),
        shaft_damping=4.0,
        pitch_torque=tuple(torques),
        bearing_rest=tuple(rests),
    )


def leaning_blades() -> Scene:
    """Return the scene of `five_blades` with a tilted shaft, coned blades and a hub.

    Each blade has a different cone angle. The hub has a radius and a mass, which affect the loads.
    """
    scene = five_blades()
    blades = tuple(replace(blade, cone=0.3 - 0.15 * i) for i, blade in enumerate(scene.blades))
    return replace(
        scene,
        name="tilt and cone",
        title=f"{scene.title}, tilted and coned",
        blades=blades,
        shaft_tilt=-0.2,
        hub_radius=0.3,
        hub_mass=20.0,
    )


# Shipped scenes that every method computes, besides `five_blades` and `leaning_blades`. The values
# are a duration in s that is long enough for the effect of the scene, the number of samples, and a
# factor by which bounds of the method are multiplied. The factor is above 1 for stiff bearings,
# because a method with a fixed step has larger errors there than the bounds for slow motions allow.
SCENES = {
    "check/held": (0.5, 26, 1.0),  # blades without inertia about their pitch axis
    "check/point-masses": (1.0, 51, 1.0),  # blades without inertia of their own
    "turbine/pitch-step": (1.2, 61, 10.0),  # stiff bearings
    "paper/fig11": (1.0, 51, 1.0),  # chaotic
}
EXACT = ("paper/fig05", "paper/fig06", "paper/fig15-10kNm", "paper/fig03")
_SMOOTH = "paper/fig11"  # scene for the tests of order, symmetry and determinism
_ORDER_BAND = 0.3  # amount by which a measured order may be below the claimed one
_COARSEST = 0.02  # s; the steps of the method's ladder are shares of this interval
_LONG = 1000.0  # factor on the duration of the run that must stop at its time limit
# Time limit of that run in s, and time added to every limit for loading an engine.
_STOP_S, _LOAD_S = 0.5, 20.0
_FIRST_S = 300.0  # time limit in s of the first run, in which an engine may compile its code
# Largest defect of an accurate motion, rad per interval. It is too small to cause a failure of the
# energy balance.
_ACCURATE = 1e-6
NOT_FOUND = "cause not found"


def _run(task: tuple[str, Scene, Mapping[str, object], int, float]) -> Solution:
    """Compute a run in a worker process, and return it; errors become the status of the run.

    Parameters
    ----------
    task : (method, scene, settings, number of integrations, time limit in s).

    Returns
    -------
    Solution
        If the method refuses the scene, raises an error, or reaches the time limit before its first
        sample, the run has no samples, and its message is the reason.
    """
    name, scene, settings, repeats, time_limit_s = task
    try:
        with np.errstate(all="ignore"):
            return solve(name, scene, settings, repeats, time_limit_s=time_limit_s)
    except MethodRefusal as exc:
        status, message = REFUSED, str(exc)
    except OutOfTimeError as exc:
        status, message = "timed_out", str(exc)
    except Exception as exc:  # any error of an engine is a result of the test
        status, message = (
            "solver_failed",
            str(exc) if isinstance(exc, RotorError) else error_line(exc),
        )
    return without_samples(scene, name, settings, status, message)


@caller_signals()
def examine(
    name: str, timeout_s: float = 60.0, on_part: Callable[[int, int], None] | None = None
) -> list[Check]:
    """Test a method, and return its checks.

    The hint of a check that fails is the most likely reason.

    Parameters
    ----------
    name : name of the method.
    timeout_s : time limit of a run in s.
    on_part : called before the first part of the test and after each part, with the number of
        finished parts and the number of all parts. A part may take minutes, if the cause of a wrong
        motion is searched.

    Raises
    ------
    InputError
        If the method is unknown.
    """
    with WorkerPool(1) as pool:
        return _Examination(find_method(name), pool, timeout_s).checks(on_part or _ignore)


def _ignore(done: int, total: int) -> None:
    """Ignore the progress."""


class _Examination:
    """Make the runs of one method in a worker process, and collect its checks.

    Parameters
    ----------
    method, pool : the method, and the pool that runs it.
    timeout_s : time limit of a run in s.
    """

    def __init__(self, method: Method, pool: TaskPool, timeout_s: float) -> None:
        self._method, self._pool, self._timeout_s = method, pool, timeout_s
        self._bounds = bounds_of(method.name).with_entries(method.bounds)
        self._bound = defect_bound(self._bounds, method.name)
        self._made: list[Check] = []
        self._refused: dict[str, str] = {}  # reasons of the method by refused scene
        # Whether the wrong motion of the first scene that fails by its defects is explained by
        # faults at single times; None before such a scene.
        self._has_faults_in_time: bool | None = None

    def checks(self, on_part: Callable[[int, int], None]) -> list[Check]:
        """Make all runs, and return the checks in the order in which they are made.

        The first run is short and not judged, because an engine may compile its code in it.

        Parameters
        ----------
        on_part : see `examine`. Each scene is a part; all other checks together are the last part.
        """
        self._ask(
            replace(only_scene(_SMOOTH), duration=0.02, samples=2, outputs=("angles", "rates")),
            limit=_FIRST_S,
        )
        scenes = [(five_blades(), 1.0), (leaning_blades(), 1.0)]
        for name, (duration, samples, allowance) in SCENES.items():
            # The chaotic scene keeps its own outputs, without loads: the bounds on loads are made
            # for scenes that request loads.
            outputs = only_scene(name).outputs if name == _SMOOTH else OUTPUTS
            scenes.append(
                (
                    replace(only_scene(name), duration=duration, samples=samples, outputs=outputs),
                    allowance,
                )
            )
        parts = len(scenes) + 1
        for done, (scene, allowance) in enumerate(scenes):
            on_part(done, parts)
            self._scene(scene, allowance)
        on_part(len(scenes), parts)
        able = [scene.name for scene, _ in scenes if scene.name not in self._refused]
        hint, reasons = "rejects every scene", set(self._refused.values())
        if len(reasons) == 1:  # for example that the engine is not installed
            hint = f"{hint}: {reasons.pop()}"
        self._add("builds", "all", float(not able), 0.0, hint)
        for name in EXACT:
            self._exact(
                replace(only_scene(name), duration=1.0, samples=11, outputs=("angles", "rates"))
            )
        if _SMOOTH in able:
            scene = replace(
                only_scene(_SMOOTH), duration=0.2, samples=11, outputs=("angles", "rates")
            )
            self._symmetries(scene)
            self._order(scene)
            self._stops(scene)
        on_part(parts, parts)
        return self._made

    def _add(
        self, check: str, scene: str, value: float, bound: float, hint: str, unit: str = ""
    ) -> bool:
        """Add a check to the list, and return whether it passes.

        Parameters
        ----------
        check, scene : names of the check and of the scene.
        value, bound, unit : the value, its bound, and the unit of both; a value above the bound
            fails.
        hint : the reason, if the check fails.
        """
        made = Check(check, Where(scene, self._method.name, check), float(value), bound, hint, unit)
        self._made.append(made)
        return made.passed

    def _ask(
        self,
        scene: Scene,
        settings: Mapping[str, object] | None = None,
        *,
        repeats: int = 1,
        limit: float = 0.0,
    ) -> Solution:
        """Compute a run in the worker process, and return it without judging it.

        The status of the run is "" if it has samples. Otherwise the status and the message say why
        it has none.

        Parameters
        ----------
        scene, settings : the scene, and settings of the method; other settings keep their defaults.
        repeats : number of integrations.
        limit : time limit of one integration in s; 0 for the limit of all runs of the test.
        """
        name, settings, limit = (
            self._method.name,
            settings or {},
            repeats * (limit or self._timeout_s),
        )
        task = (name, scene, settings, repeats, limit)
        try:
            return self._pool.submit(with_method_files(_run), task, limit + _LOAD_S).result()
        except (TaskLostError, ResourceError) as exc:
            status, message = "worker_died", str(exc)
        except Exception as exc:  # a result that cannot be pickled
            status, message = "solver_failed", error_line(exc)
        return without_samples(scene, name, settings, status, message)

    def _scene(self, scene: Scene, allowance: float) -> None:
        """Run a scene, and add its checks: refusal or samples, determinism, those of `run_checks`.

        If several checks of `run_checks` have the same name, only the one with the smallest margin
        is added. The hint of a failed check is the probable cause, which may follow from an earlier
        check.

        Parameters
        ----------
        scene : the scene; if the method refuses it, it is run again without loads.
        allowance : factor by which the bounds on defects, energy and loads are multiplied.
        """
        solution = self._ask(scene)
        if solution.status == REFUSED:  # perhaps because of the loads, which are optional
            without_loads = replace(
                scene, outputs=tuple(name for name in OUTPUTS if name != "loads")
            )
            again = self._ask(without_loads)
            if again.status != REFUSED:
                scene, solution = without_loads, again
        if solution.status == REFUSED:
            reason = solution.message
            self._refused[scene.name] = reason
            self._add("refusal", scene.name, float(not reason), 0.0, reason or "without a reason")
            return
        fault = protocol_fault(solution)
        if not self._add("samples", scene.name, float(bool(fault)), 0.0, fault):
            return
        if scene.name == _SMOOTH:
            # The solver is built again in the same process, and integrates twice. Both must not
            # change the result: neither the process nor the solver may keep state.
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
            # `run_checks` has no checks for tips, energies and loads that the method does not
            # compute.
            samples = RunSamples(scene, self._method.name, run, metrics, defects)
            checks = list(run_checks(samples, self._bounds))
        # The check of each name with the smallest margin: in the dict a later check replaces an
        # earlier one.
        worst = {check.name: check for check in sorted(checks, key=lambda check: -check.margin)}
        reason = rows = ""
        if (
            "defect" in worst
            and defects is not None
            and not worst["defect"].value <= allowance * self._bound
        ):
            rows = wrong_rows(scene, run, defects)
            reason = rows or self._cause(scene, run, defects)
        for name, check in worst.items():
            # The check "error" is left out: its value is the defects, amplified by the motion. Only
            # the defects are due to the method.
            if name == "error":
                continue
            # Loads are as accurate as the accelerations, whose errors are the defects.
            bound = check.bound * (allowance if name in ("defect", "energy", "loads") else 1.0)
            hint = check.hint
            if reason and name in ("defect", "defect median"):
                hint = reason
            elif rows:
                hint = "the rows are wrong: see the defect"
            elif reason and name in ("energy", "loads"):
                hint = "the motion is wrong: see the defect"
            elif name == "energy":
                hint = f"energy minus work is not constant; {NOT_FOUND}"
                # If the motion is right, forces, masses and the step are right, too.
                if "defect" in worst and worst["defect"].value <= _ACCURATE * allowance:
                    hint = "the motion is right: a stored energy is wrong"
                    if "energies" in worst and worst["energies"].passed:
                        hint = (
                            "the motion and the energies are right: the work of loads, commands or "
                            "dampers is wrong"
                        )
            elif name in ("energies", "loads", "tip") and not check.value <= bound:
                hint = _wrong_output(scene, run, check)
            self._add(name, scene.name, check.value, bound, hint, check.unit)

    def _cause(self, scene: Scene, run: Trajectory, defects: Defects) -> str:
        """Return why the defects of a run are too large.

        Possible causes are tried in this order: a step that is too large, wrong equations or
        numbers, faults at single times, and a scheme of lower order than the method claims.

        Parameters
        ----------
        scene, run : the scene, and the samples of its run.
        defects : interval defects of the run; at least one is above its bound.
        """
        left, order = self._with_half_step(scene, run, defects)
        claimed = self._method.order or 1.0
        if order >= claimed - _ORDER_BAND:
            step = self._method.defaults["step"]
            return (
                f"step of {step:g} s too large: half the step gives {left:.1e} rad, order "
                f"{order:.1f}"
            )
        try:
            judged = judged_defects(scene, defects, self._bound)
            alike = DefectSearch(judged).textbook_causes()
            if alike and self._has_faults_in_time is None:
                self._has_faults_in_time = False
            if len(alike) > 1:  # this motion does not distinguish them
                return f"{NOT_FOUND}: explained alike by: {'; '.join(alike)}"
            if alike:
                return alike[0]
            faults = " and ".join(faults_in_time(judged))
            if faults.startswith(UNKNOWN_FAULT):  # only the time of the fault is known
                faults = f"{NOT_FOUND}: {faults}"
        except RotorError:
            faults = ""
        # Wrong equations cause the same defects with any step. Defects that shrink with the step
        # are due to the scheme.
        by_order = ""
        if order >= 1.0 - _ORDER_BAND:
            look_at = "the scheme's coefficients, or loads of another time within a step"
            by_order = f"order {order:.1f} where {claimed:g} is expected: {look_at}"
        # The first scene that fails decides for all scenes whether faults at single times are
        # reported. Its rotor moves in every interval; in a scene in which the rotor rests most of
        # the time, any error would look like a fault at a single time.
        if self._has_faults_in_time is None:
            self._has_faults_in_time = bool(faults)
        return (faults if self._has_faults_in_time else by_order) or NOT_FOUND

    def _with_half_step(
        self, scene: Scene, run: Trajectory, defects: Defects
    ) -> tuple[float, float]:
        """Return the largest judged defect (rad) with half the step, and the order of the defects.

        The order is the logarithm to base 2 of the root mean square of the defects with the default
        step divided by that with half the step. Both returned numbers are zero if the method has no
        step, or if the run with half the step is incomplete.

        Parameters
        ----------
        scene, run : the scene, and the samples of its run with the default step.
        defects : interval defects of the run with the default step.
        """
        step = self._method.defaults.get("step")
        if not isinstance(step, float):
            return 0.0, 0.0
        finer = self._ask(scene, {"step": 0.5 * step})
        half = defects_of(scene, finer.trajectory) if len(finer.time) == len(run.time) else None
        if half is None:
            return 0.0, 0.0
        ratio = root_mean_square(defects) / root_mean_square(half)
        return float(half.judged_sizes.max()), float(np.log2(ratio))

    def _exact(self, scene: Scene) -> None:
        """Check the rotor angle against the exact solution of a scene.

        Nothing is added if the scene has no exact solution, or if the method refuses the scene.
        """
        known = exact_rotor_angle(scene, sample_times(scene))
        solution = self._ask(scene)
        if known is None or solution.status == REFUSED:
            return
        name, angle = known
        fault = protocol_fault(solution)
        error = np.inf if fault else np.abs(solution.angles[:, 0] - angle).max()
        # The bound is the allowed defect of an interval times the number of samples, and a factor
        # 10: errors of the falling pendulum grow less than tenfold in the second that is computed.
        bound = 10.0 * scene.samples * self._bound
        self._add("exact", scene.name, error, bound, fault or f"{name}, solved analytically", "rad")

    def _symmetries(self, scene: Scene) -> None:
        """Check that a transformed initial state gives the transformed motion.

        The blades of `scene` must be equal and symmetric. Two transformations are checked: the
        mirror image, which changes the sign of all pitches, and a renumbering, which makes blade 1
        blade 2 and so on, and turns the rotor back by the angle between two blades.
        """
        (rotor, *pitches), (spin, *rates), blades = (
            scene.initial_angles,
            scene.initial_rates,
            len(scene.blades),
        )
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
        runs = [self._ask(start) for start in (scene, mirrored, renumbered)]
        fault = next(filter(None, map(protocol_fault, runs)), "")
        angles, image, others = (run.angles for run in runs)
        if len(others):
            others = np.hstack([others[:, :1] + turn, others[:, 2:], others[:, 1:2]])
        hints = {
            "mirror image": (
                "the mirror image of the initial state does not give that of the motion"
            ),
            "renumbered": "blades by other numbers give another motion",
        }
        for check, there in (
            ("mirror image", image * sign if len(image) else image),
            ("renumbered", others),
        ):
            error = (
                np.abs(angles - there).max()
                if angles.shape == there.shape and len(angles)
                else np.inf
            )
            bound = 10.0 * scene.samples * self._bound
            self._add(check, scene.name, error, bound, fault or hints[check], "rad")

    def _order(self, scene: Scene) -> None:
        """Check that the defects converge with at least the order that the method claims.

        A measured order may be lower by up to `_ORDER_BAND`. Nothing is added if the method has no
        ladder of steps or no claimed order, or if no order can be fitted.

        Parameters
        ----------
        scene : a short scene with a smooth motion; it is run with each step of the ladder.
        """
        ladder = next((one for one in self._method.ladders if one.kind == STEP), None)
        if ladder is None or self._method.order is None:
            return
        steps, sizes = [], []
        for step, settings in ladder.settings_by_value(_COARSEST).items():
            run = self._ask(scene, settings).trajectory
            if len(run.time) == scene.samples and (defects := defects_of(scene, run)) is not None:
                steps.append(step)
                sizes.append(root_mean_square(defects))
        order = fitted_order(np.array(steps), np.array(sizes)) if steps else None
        if order is not None:
            claimed = self._method.order
            hint = f"measured order {order:.2f}, expected {claimed:g}"
            self._add("order", scene.name, max(claimed - order, 0.0), _ORDER_BAND, hint, "below")

    def _stops(self, scene: Scene) -> None:
        """Check that a long run stops itself at its time limit, and need not be killed."""
        long = replace(
            scene, duration=_LONG * scene.duration, samples=int(_LONG) * (scene.samples - 1) + 1
        )
        solution = self._ask(long, limit=_STOP_S)
        hint = f"not stopped after {_STOP_S:g} s: {solution.message}; it had to be killed"
        self._add("time limit", scene.name, float(solution.status == "worker_died"), 0.0, hint)


def _wrong_output(scene: Scene, run: Trajectory, check: Check) -> str:
    """Return a text that says which mistake explains the tips, energies or loads of a run.

    Parameters
    ----------
    scene, run : the scene, and the samples of its run.
    check : a failed check named "tip", "energies" or "loads"; its channel names the array.
    """
    channel = check.where.channel
    if check.name == "tip":
        return wrong_tip(scene, run) or f"not where the angles put it; {NOT_FOUND}"
    if check.name == "energies":
        text = wrong_energy(scene, run, channel)
    else:
        # The text of `wrong_loads` names the loads itself.
        if text := wrong_loads(scene, run):
            return text
        channel = channel.replace("_", " ")
    return (
        f"{channel}: {text}"
        if text
        else f"{channel}: not that of its angles and rates; {NOT_FOUND}"
    )


def protocol_fault(solution: Solution) -> str:
    """Return what is wrong with the form of a run, or why it is incomplete; "" if it is right.

    A right run reports success. It has a row of finite numbers at every sample time of the scene,
    and its angles are not wrapped.

    Parameters
    ----------
    solution : a run that is not judged; its status is "" if it has samples.
    """
    scene, run, integration = solution.scene, solution.trajectory, solution.integration
    if solution.status == "solver_failed":  # the run has no samples
        return f"{NOT_FOUND}; the run raised an error: {solution.message}"
    if solution.status:
        return solution.message
    times, n = sample_times(scene), len(run.time)
    rows = np.isfinite(np.hstack([run.time[:, None], run.angles, run.rates])).all(axis=1)
    if not rows.all():
        return f"row {1 + int(np.argmin(rows))} is not finite; a run ends before it"
    if n < scene.samples:
        claim = (
            "although it reports success"
            if integration.success
            else integration.message or "no reason given"
        )
        return f"{n} of {scene.samples} samples, {claim}"
    if not integration.success:
        return f"reports a failure: {integration.message or 'no reason given'}"
    if n > scene.samples or np.abs(run.time - times).max() > 1e-9 * scene.duration:
        return "its times are not the scene's sample times"
    # The change of each angle in an interval, minus the integral of its rate (trapezoidal rule).
    # Where an angle is wrapped, the difference is about a turn.
    turned = (
        np.diff(run.angles, axis=0)
        - 0.5 * (run.rates[1:] + run.rates[:-1]) * np.diff(times)[:, None]
    )
    # Rates in a wrong unit cause large differences, too, but in neighbouring intervals as well. A
    # wrapped angle causes a single large difference.
    beside = np.full((1, turned.shape[1]), 0.0)
    before, after = np.vstack([beside, turned[:-1]]), np.vstack([turned[1:], beside])
    is_single = np.maximum(np.abs(before), np.abs(after)) < 1.0
    jumps = np.argwhere((np.abs(np.abs(turned) - 2.0 * np.pi) < 0.5) & is_single)
    if len(jumps):
        row, column = jumps[0]
        return (
            f"{scene.coordinate_labels[column]} jumps by a turn at t = {times[row + 1]:.6g} s: "
            "angles are wrapped"
        )
    return ""
