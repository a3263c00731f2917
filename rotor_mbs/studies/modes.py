"""Modes of a scene by every model that can be linearized.

Modes are computed at rest and over rotor speed, and Floquet multipliers over a turn under gravity.
The closed form computes the steady state, and all models linearize their equations about it. Each
model also returns its accelerations at this state, which must be nearly zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.analysis import modes as modal
from rotor_mbs.analysis.whirl import RPM
from rotor_mbs.errors import InputError, MethodRefusal, RotorError, shown_value
from rotor_mbs.methods.base import checked_result
from rotor_mbs.methods.catalogue import find_method, methods, with_method_files
from rotor_mbs.methods.time_limit import caller_signals
from rotor_mbs.processes.pool import local_pool, run_in
from rotor_mbs.runs.output_files import locked
from rotor_mbs.runs.read import write_records
from rotor_mbs.runs.runner import OnProgress, RunOutcome, ignore_progress
from rotor_mbs.runs.trailer import MODES, may_extend
from rotor_mbs.scenario.keys import LARGEST, SMALLEST
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.scenario.time_table import value_at
from rotor_mbs.solution.status import REFUSED
from rotor_mbs.solution.trajectory import Array, Linearization

if TYPE_CHECKING:
    from rotor_mbs.models.lagrange.floquet import Turn

# A model is not steady at the steady state of the closed form if an acceleration there (rad/s^2) is
# above this share of its largest stiffness (1/s^2).
_STEADY = 1e-7
# In a balanced rotor the moments of the weights about the shaft cancel. The remaining stiffness is
# rounding of finite differences, up to this share of the stiffness that the weights would have if
# they did not balance.
_STIFFNESS_ROUNDING = 1e-9
_BALANCED = "balanced rotor: no preferred angle; modes taken at the initial angle"

_Point: TypeAlias = "tuple[Scene, Array, float, float]"


@caller_signals()
def modes_of_scenes(
    scenes: Sequence[Scene],
    output: Path,
    *,
    speeds: Sequence[float] = (),
    names: Sequence[str] = (),
    workers: int,
    timeout_s: float,
    on_progress: OnProgress = ignore_progress,
) -> list[RunOutcome]:
    """Compute the modes of every scene, and store them in a file.

    Modes of other scenes that the file already has are kept.

    Parameters
    ----------
    scenes : sequence of Scene
        The scenes. If a scene has no modes, its outcome has the reason, and the other scenes are
        computed.
    output : Path
        The file; it is not written if no scene has modes.
    speeds : sequence of float
        Rotor speeds of the Campbell diagram and of the Floquet multipliers, rad/s.
    names : sequence of str
        Methods whose models are compared with the closed form; if empty, all models.
    workers : int
        Number of parallel processes.
    timeout_s : float
        Time limit of each scene, s.
    on_progress : callable
        Called after each scene, except for scenes without modes.

    Returns
    -------
    list of RunOutcome
        The outcome of each scene, in the order in which they ended.

    Raises
    ------
    InputError
        If the speeds do not increase, if the model of a method has no linearization, or if `output`
        holds another kind of results.
    StoreError
        If `output` cannot be written, or was not written by this program.
    """
    models = tuple(find_method(name).model for name in names)
    for name, model in zip(names, models, strict=True):
        if not any(method.linearize for method in methods() if method.model == model):
            raise InputError(
                f"{name}: its model has no linearization; allowed: a model with `linearize`"
            )
    speeds = increasing_speeds(speeds)
    made: list[RunOutcome] = []
    computed: list[modal.SceneModes] = []
    with locked(output):
        may_extend(output, MODES)  # before anything is computed
        work = with_method_files(partial(compute_modes, speeds=speeds, models=models))
        with local_pool(workers) as pool:
            for done, end in enumerate(run_in(pool, work, scenes, timeout_s), 1):
                label, share = f"{end.task.name} modes", done / len(scenes)
                if isinstance(end.error, RotorError):
                    reason = str(end.error).removeprefix(f"{end.task.name}: ")
                    made.append(
                        RunOutcome(label, "", REFUSED, reason, is_stored=False, share=share)
                    )
                    continue  # the caller reports the reason after all scenes
                if end.value is None:
                    outcome = RunOutcome(
                        label, "", end.failure, end.message, is_stored=False, share=share
                    )
                else:
                    computed.append(end.value)
                    status, message = "ok", ""
                    if not end.value.agrees:
                        differ = (
                            f"models differ by up to {end.value.disagreement:.1e} of the largest "
                            "eigenvalue"
                        )
                        status, message = "inaccurate", "; ".join(end.value.faults) or differ
                    outcome = RunOutcome(label, "", status, message, share=share)
                made.append(outcome)
                on_progress(done, len(scenes), outcome)
        if computed:
            records = []
            for modes in computed:
                records += modal.to_records(modes)
            write_records(output, records)
    return made


@caller_signals()
def compute_modes(
    scene: Scene, speeds: Sequence[float] | Array = (), models: Sequence[str] = ()
) -> modal.SceneModes:
    """Compute all modes of a scene.

    The result has the modes at rest under gravity, the modes in steady rotation without gravity at
    `speeds`, and the Floquet multipliers of a turn under gravity at all speeds except 0. The rotor
    torque of the scene is left out: the drive is assumed to hold the speed. Pitch torques and rest
    angles have their values at t = 0.

    Parameters
    ----------
    scene : Scene
        The scene that is linearized.
    speeds : sequence of float
        Rotor speeds, rad/s, increasing; below 0 the rotor turns the other way.
    models : sequence of str
        Models that are compared with the closed form; if empty, all models.

    Raises
    ------
    InputError
        If the speeds do not increase, or if the scene has no modes at all; the message says why.
    """
    notes: list[str] = []
    torques, rests = (
        tuple(((0.0, value_at(table, 0.0)),) if table else () for table in tables)
        for tables in (scene.pitch_torque, scene.bearing_rest)
    )
    facts = scene.name, scene_hash(scene), scene.title, len(scene.blades), scene.gravity
    label = scene.label
    scene = replace(scene, pitch_torque=torques, bearing_rest=rests)
    speeds = np.array(increasing_speeds(speeds))
    rest = _linear(scene, modal.REST, np.zeros(1), models, notes)
    rotation = _linear(scene, modal.ROTATION, speeds, models, notes) if len(speeds) else {}
    turning = speeds[speeds != 0.0]
    table = None
    if scene.gravity and len(turning):
        try:
            table = _floquet_table(scene, turning)
        except MethodRefusal as exc:
            notes.append(f"no Floquet multipliers: {exc}")
    reasons = tuple(dict.fromkeys(notes))  # rest and rotation may have the same reason
    if not (rest or rotation or (table is not None and (table.stable >= 0).any())):
        raise InputError("; ".join(reasons))
    return modal.SceneModes(*facts, rest, rotation, table, reasons, label)


def _linear(
    scene: Scene, kind: str, speeds: Array, models: Sequence[str], notes: list[str]
) -> dict[str, modal.LinearModes]:
    """Return the modes at rest or in rotation, by model, the closed form first.

    A model is left out if it cannot be linearized at one of the speeds, or is not steady there. At
    rest the reason is added to `notes`; in rotation it is not.

    Parameters
    ----------
    scene : the scene; its loads are constant.
    kind : REST or ROTATION.
    speeds : (speeds,) rad/s.
    models : names of the models that are compared with the closed form; if empty, all models.
    notes : list to which reasons for missing results are added.
    """
    from rotor_mbs.models.lagrange.linearization import is_balanced, weight_stiffness

    points = _steady_states(scene, kind, speeds)
    there = [not isinstance(point, str) for point in points]
    steady = [point for point in points if not isinstance(point, str)]
    if not steady:
        notes.append(str(points[0]))
        return {}
    # The rotor is symmetric if its blades, bearings and steady pitches are equal, and there is no
    # gravity.
    bearings = (
        scene.bearing_stiffness,
        scene.bearing_damping,
        scene.bearing_rest,
        scene.pitch_torque,
    )
    same = (
        all(len(set(values)) <= 1 for values in (scene.blades, *bearings))
        and scene.blades[0].has_pitch_inertia
    )
    symmetric = same and all(
        at.gravity == 0.0 and np.ptp(angles[1:]) < 1e-9 for at, angles, _, _ in steady
    )
    columns = scene.moving_coordinates
    # The stiffness of a balanced rotor about the shaft may be nothing but rounding of the moments
    # of the weights.
    weight_stiffnesses = [weight_stiffness(at, angles) for at, angles, _, _ in steady]
    is_balanced_rotor = False
    if kind == modal.REST and scene.gravity:
        is_balanced_rotor = is_balanced(scene, steady[0][1])
    if is_balanced_rotor:
        notes.append(_BALANCED)

    def over_speed(values: Sequence[NDArray[Any]], nothing: complex = np.nan) -> NDArray[Any]:
        """Return values at all speeds: `nothing` at speeds without a steady state."""
        whole = np.full((len(points), *values[0].shape), nothing, values[0].dtype)
        whole[there] = values
        return whole

    modes_by_model: dict[str, modal.LinearModes] = {}
    known = {
        method.model: method for method in methods() if method.linearize and method.is_installed
    }
    closed_form = next(iter(known), "")
    for method in known.values():
        if models and method.model not in (closed_form, *models):
            continue
        try:
            made = []
            for point, weight in zip(steady, weight_stiffnesses, strict=True):
                assert method.linearize is not None
                linear = method.linearize(*point)
                checked_result(linear, Linearization, "linearize", method.linearize, method.name)
                made.append(linear)
                left = np.abs(made[-1].residual).max(initial=0.0)
                if left > _STEADY * max(np.abs(made[-1].stiffness).max(), weight, 1e-12):
                    moves = f"accelerates by {left:.1e} rad/s^2 where the closed form is steady"
                    raise MethodRefusal(f"{method.model}: {moves}")
        except MethodRefusal as exc:
            if kind == modal.REST:
                notes.append(str(exc))
            continue
        modes_at = (
            modal.isotropic_modes
            if symmetric
            else partial(
                modal.modes_of,
                is_cyclic=kind == modal.ROTATION or scene.gravity == 0.0,
                rounding=_STIFFNESS_ROUNDING * weight_stiffnesses[0] if is_balanced_rotor else 0.0,
            )
        )
        sets = [modes_at(linear.stiffness, linear.damping) for linear in made]
        if not modes_by_model:
            sets = first_sets = modal.track(sets)
        else:  # order the modes as those of the closed form, also at equal frequencies
            sets = [
                modal.in_order_of(first, own) for first, own in zip(first_sets, sets, strict=True)
            ]
        names = (name if name == "rotor" else f"{name} pitch" for name in sets[0].names)
        modes_by_model[method.model] = modal.LinearModes(
            eigenvalues=over_speed([modes.eigenvalues for modes in sets], complex(np.nan, np.nan)),
            shapes=over_speed([modes.shapes for modes in sets]),
            names=tuple(names) or tuple(f"mode {k + 1}" for k in range(len(columns))),
            source=method.model,
            label=method.model_label,
            kind=kind,
            blades=len(scene.blades),
            speeds=speeds,
            coordinates=tuple(scene.coordinate_labels[column] for column in columns),
            angles=over_speed([angles[columns] for _, angles, _, _ in steady]),
            stiffness=over_speed([linear.stiffness for linear in made]),
            damping=over_speed([linear.damping for linear in made]),
            weights=max(weight_stiffnesses),
            messages=tuple(point if isinstance(point, str) else "" for point in points),
        )
    return modes_by_model


def _steady_states(scene: Scene, kind: str, speeds: Array) -> list[_Point | str]:
    """Return the steady state at each speed, or the reason why there is none.

    Parameters
    ----------
    scene : the scene; in rotation its gravity is left out.
    kind : REST or ROTATION.
    speeds : (speeds,) rad/s, increasing.

    Returns
    -------
    list of tuple or str
        For each speed (scene as it is linearized, angles (1 + blades,) rad, speed in rad/s, torque
        in N m that maintains the speed), or a text with the reason.
    """
    from rotor_mbs.models.lagrange.linearization import equilibrium, holding_torque, steady_rotation

    at = scene if kind == modal.REST else replace(scene, gravity=0.0)
    # The pitches at each speed are the initial guess at the next slower speed, so that one branch
    # of solutions is followed down to rest. The direction of rotation does not change the pitches.
    start = scene
    points: list[_Point | str] = [""] * len(speeds)
    for place in np.argsort(-np.abs(speeds), kind="stable").tolist():
        speed = float(speeds[place])
        try:
            angles = equilibrium(start) if kind == modal.REST else steady_rotation(start, speed)
        except InputError as exc:
            points[place] = str(exc)
        except ZeroDivisionError:
            points[place] = f"{scene.name}: singular at {speed:g} rad/s ({speed * RPM:.4g} rpm)"
        else:
            start = replace(start, initial_angles=tuple(angles.tolist()))
            torque = holding_torque(scene, speed)
            points[place] = (replace(at, rotor_torque=()), angles, speed, torque)
    return points


def _floquet_table(scene: Scene, speeds: Array) -> modal.FloquetTable:
    """Return the Floquet multipliers of the periodic motion under gravity at each speed.

    Parameters
    ----------
    scene : the scene; its loads are constant.
    speeds : (speeds,) rad/s, increasing, without 0.

    Raises
    ------
    MethodRefusal
        If heyoka is not installed.
    """
    from rotor_mbs.models.lagrange.floquet import periodic_turn

    # In each direction of rotation speeds are computed from the fastest to the slowest. The motion
    # at a speed, if it was found, is the first guess for the next slower speed.
    by_speed: dict[float, Turn] = {}
    for direction in (speeds[speeds < 0.0], speeds[speeds > 0.0][::-1]):
        guess: Turn | None = None
        for speed in direction.tolist():
            turn = periodic_turn(scene, speed, guess)
            guess = None if turn.message else turn
            by_speed[speed] = turn
    turns = [by_speed[speed] for speed in speeds.tolist()]
    rows = []
    for turn in turns:
        every, others = modal.floquet(turn.transition, turn.flow, turn.gradient, turn.speed)
        modulus = float(np.abs(others).max(initial=0.0))
        is_stable = -1 if turn.message else int(modulus <= 1.0 + modal.GROWTH)
        sizes = np.abs(every)
        # The product of all multipliers must be the exponential of the integrated trace
        # (Liouville).
        rounding = np.finfo(float).eps * np.linalg.norm(turn.transition)
        error = float("nan")  # unless rounding leaves at least six digits of the product
        if not turn.message and rounding < 1e-6 * sizes.min():
            error = float(np.log(sizes).sum() - turn.trace_integral)
        rows.append((every, modulus, is_stable, error, turn.torque, turn.mismatch))
    multipliers, largest, stable, errors, torques, mismatches = map(
        np.array, zip(*rows, strict=True)
    )
    messages = tuple(turn.message for turn in turns)
    return modal.FloquetTable(
        speeds, multipliers, largest, stable, errors, torques, mismatches, messages
    )


def increasing_speeds(speeds: Sequence[float] | Array) -> list[float]:
    """Return rotor speeds (rad/s) as floats, and check that they increase.

    Raises
    ------
    InputError
        If the speeds do not increase, or a speed is out of range or a text without a number.
    TypeError
        If the type of a speed has no conversion to float, such as None.
    """
    try:
        numbers = [float(speed) for speed in speeds]
    except (ValueError, OverflowError):  # a text, a whole number above 1e308
        numbers = [np.nan]
    are_allowed = all(number == 0.0 or SMALLEST <= abs(number) <= LARGEST for number in numbers)
    if not are_allowed or any(after <= before for before, after in pairwise(numbers)):
        allowed = "increasing numbers, each 0 or of a size "
        allowed += f"from {SMALLEST:g} to {LARGEST:g} (rad/s)"
        raise InputError(f"speeds: {shown_value(speeds)}; allowed: {allowed}")
    return numbers
