"""Decide which methods run a scene, and with which settings.

If the user or the scene's file names methods, those that can represent the scene are run. If no
method is named, a rule selects methods. The rule was derived from results of the stability suite,
which shows the scenes on which methods fail or take minutes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rotor_mbs.errors import InputError, MethodRefusal
from rotor_mbs.methods.catalogue import (
    default_methods,
    find_method,
    method_names,
    unknown_names,
)
from rotor_mbs.methods.settings import unknown_setting
from rotor_mbs.scenario.toml_file import KeyProblem

if TYPE_CHECKING:  # the command `list` imports this module, and needs no scene
    from rotor_mbs.scenario.scene import Scene


# Settings


def settings_for(names: Sequence[str], given: Mapping[str, object]) -> dict[str, dict[str, object]]:
    """Distribute settings to the methods that have them.

    Parameters
    ----------
    names : names of known methods.
    given : values of settings by name of the setting.

    Returns
    -------
    dict
        For each method, the given values of the settings that it has.

    Raises
    ------
    InputError
        For a setting that none of the methods has, and for a value that is not allowed.
    """
    if len(names) == 1:
        # For a single method, an unknown setting is reported here: this message lists the allowed
        # values of all settings, the message below only their names.
        find_method(names[0]).settings.of(names[0], given)
    declared = {name: find_method(name).settings.declared() for name in names}
    known = list(dict.fromkeys(setting for settings in declared.values() for setting in settings))
    unknown = [setting for setting in given if setting not in known]
    if unknown and names:
        allowed = f"{', '.join(known) or 'none'} ({', '.join(names)})"
        problems = []
        for setting in unknown:
            problems.append(f"{unknown_setting(setting, known)}; allowed: {allowed}")
        raise InputError(problems)
    by_method = {}
    for name, settings in declared.items():
        by_method[name] = {key: value for key, value in given.items() if key in settings}
        find_method(name).settings.of(name, by_method[name])  # checks the values
    return by_method


def own_settings(scene: Scene, method: str) -> dict[str, object]:
    """Return the scene's own settings, without those that a method does not have.

    Parameters
    ----------
    scene : the scene.
    method : name of the method.

    Raises
    ------
    InputError
        If the scene has a setting that no method has, or a value that is not allowed.
    """
    if not scene.settings:
        return {}
    # The settings are checked against all methods, as some may be for a method that is not run.
    try:
        return settings_for(method_names(), dict(scene.settings)).get(method, {})
    except InputError as error:
        lines = [f"{scene.name}: settings: {problem}" for problem in error.problems]
        raise InputError(lines) from error


def settings_of_run(scene: Scene, method: str, given: Mapping[str, object]) -> dict[str, object]:
    """Return the settings of a run: the scene's own settings, overridden by the given ones.

    Parameters
    ----------
    scene : the scene of the run.
    method : name of the method of the run.
    given : values by name of the setting, checked by `settings_for`. Settings that the method does
        not have are ignored.
    """
    declared = find_method(method).settings.declared()
    of_method = {name: value for name, value in given.items() if name in declared}
    return own_settings(scene, method) | of_method


def problems_of_methods(values: Mapping[str, Any]) -> list[KeyProblem]:
    """Return the problems of the key `methods` in a scene file or a sweep file."""
    return [KeyProblem(("methods",), line) for line in unknown_names(values.get("methods", ()))]


def problems_of_scene(values: Mapping[str, Any]) -> list[KeyProblem]:
    """Return the problems of the keys `methods` and `settings` in a scene file.

    Each setting in a scene file must be a setting of some method. The settings in a sweep file are
    checked elsewhere, as they must be settings of the methods of the sweep.
    """
    problems = problems_of_methods(values)
    settings = dict(values.get("settings", ()))
    if settings:
        try:
            settings_for(method_names(), settings)
        except InputError as error:
            problems += [KeyProblem(("settings",), problem) for problem in error.problems]
    return problems


# Methods of scenes


@dataclass(frozen=True)
class Refusal:
    """A run that is left out, such as one whose method or settings do not fit the scene.

    Attributes
    ----------
    scene : name of the scene.
    method : name of the method; "" if the scene is left out with all methods.
    reason : why the run is left out, in one sentence.
    is_asked : whether the run counts as one that the user asked for. It is always true if the call
        or the scene's file names the method, if `method` is "", or if the method refused the scene
        only when its solver was built. If `supporting_methods` refuses a method that nobody named,
        it is true only if the reason is that settings of the call or the scene's file do not fit
        the scene.
    """

    scene: str
    method: str
    reason: str
    is_asked: bool = True

    def __str__(self) -> str:
        run = f"{self.method} on {self.scene}" if self.method else self.scene
        return f"not run: {run}: {self.reason}"


def supporting_methods(
    scene: Scene,
    names: Iterable[str],
    settings: Mapping[str, object] | None = None,
    *,
    are_named: bool = True,
) -> tuple[list[str], list[Refusal]]:
    """Return which methods can run a scene, and a Refusal for each that cannot.

    The commands `run`, `reproduce`, `check`, `bench`, `stability` and `sweep` use this function to
    decide which methods they leave out.

    Parameters
    ----------
    scene : the scene.
    names : names of known methods.
    settings : settings of the call, checked by `settings_for`. They override the scene's own
        settings and the defaults of the methods that have them. None if the caller later chooses
        settings that fit the scene; settings are then not checked.
    are_named : whether the call or the scene's file names the methods.

    Raises
    ------
    InputError
        If the scene has a setting that no method has, or a value that is not allowed.
    """
    supporting: list[str] = []
    refused: list[Refusal] = []
    for name in names:
        method = find_method(name)
        # For a method of a Python file, `items` raises InputError for any error in the file's code.
        try:
            method.items(scene)
        except (MethodRefusal, InputError) as exc:
            refused.append(Refusal(scene.name, name, _reason(exc, name), are_named))
            continue
        if settings is not None:
            of_run = settings_of_run(scene, name, settings)
            # Names and ranges of the settings are checked already. `chosen` refuses values that do
            # not fit this scene, such as a step that is too short for the scene's duration.
            try:
                method.chosen(scene, of_run)
            except InputError as exc:
                is_asked = are_named or bool(of_run)
                refused.append(Refusal(scene.name, name, _reason(exc, name), is_asked))
                continue
        supporting.append(name)
    return supporting, refused


def _reason(error: Exception, method: str) -> str:
    """Return the text of an error without the name of the method or scene at its beginning."""
    return str(error).removeprefix(f"{method}: ")


def selected_methods(
    scenes: Sequence[Scene],
    names: Sequence[str] = (),
    settings: Mapping[str, object] | None = None,
) -> tuple[dict[str, list[str]], list[str], list[Refusal]]:
    """Select the methods of each scene: those in `names`, else those in its file, else by the rule.

    Parameters
    ----------
    scenes : the scenes.
    names : names of known methods; () if the call names no method.
    settings : settings of the call. Each method gets the settings that it has.

    Returns
    -------
    methods : names of the selected methods by scene name. The list is empty if no method can run
        the scene.
    reasons : a line for each scene for which the rule selected methods.
    refused : a Refusal for each method that is left out, and for each scene for which the rule
        selects no method.

    Raises
    ------
    InputError
        If a scene's file names an unknown method, or if a setting has an invalid value or belongs
        to none of the methods.
    """
    wanted: dict[str, list[str]] = {}
    rules: dict[str, str] = {}
    refused: list[Refusal] = []
    for scene in scenes:
        if not names and (unknown := unknown_names(scene.methods)):
            raise InputError(f"{scene.name}: methods: {line}" for line in unknown)
        wanted[scene.name] = list(names or dict.fromkeys(scene.methods))  # each name once
        if not wanted[scene.name]:
            try:
                recommended, reason = recommend(scene, default_methods())
            except MethodRefusal as exc:
                refused.append(Refusal(scene.name, "", _reason(exc, scene.name)))
            else:
                wanted[scene.name] = list(recommended)
                rules[scene.name] = reason
    all_names = list(dict.fromkeys(name for methods in wanted.values() for name in methods))
    settings_for(all_names, settings or {})  # checks the settings
    selected: dict[str, list[str]] = {}
    for scene in scenes:
        are_named = bool(names or scene.methods)
        supporting, others = supporting_methods(
            scene, wanted[scene.name], settings or {}, are_named=are_named
        )
        selected[scene.name] = supporting
        refused += others
    reasons = [f"{name}: {reason}: {', '.join(selected[name])}" for name, reason in rules.items()]
    return selected, reasons, refused


# The rule

# Largest angular frequency (rad/s) at which explicit methods with fixed steps stay within their
# bounds, if the step is their default (at most 1e-3 s).
_MAX_EXPLICIT_SWING = 90.0
# Product of decay rate and duration above which stability, not accuracy, limits the step of an
# explicit method.
_MAX_EXPLICIT_DECAY = 1e4
# Largest phase (rad) of the fastest oscillation over a run for methods with fixed steps. Above it,
# these methods take minutes, and their errors accumulate.
_MAX_FIXED_STEP_TURN = 3e4
# Ratio of the hub's inertia to the largest inertia of the rotor at any pitch, below which a rotor
# with one point-mass blade is nearly singular. At a pitch of ±π/2 the shaft can turn without moving
# the mass of such a blade, because the blade turns in pitch at the same time. Only the hub's
# inertia then resists the rotation, and if it is too small, the rates change abruptly.
_NEARLY_SINGULAR = 1e-3
# Ratio of the same inertias below which SciPy's shortest step is too long to pass a pitch of ±π/2.
# At a ratio of 3e-13 a run stops there with an error; at 3e-10 it passes.
_NO_STEP_PASSES = 1e-11


def recommend(scene: Scene, defaults: tuple[str, ...]) -> tuple[tuple[str, ...], str]:
    """Return the methods that the rule selects for a scene, and the reason.

    Parameters
    ----------
    scene : the scene.
    defaults : names of the default methods. All of them are selected for a scene that is not
        overdamped, nearly singular, stiff, fast or long.

    Returns
    -------
    names : names of the selected methods, the recommended one first.
    reason : why the rule selects these methods, in one line.

    Raises
    ------
    MethodRefusal
        If the mass matrix is or may become singular. The message has the reason.
    """
    reason = singular_reason(scene)
    if reason:
        advice = "select a method with -m to run it anyway"
        raise MethodRefusal(f"{scene.name}: rejected: {reason}; {advice}")
    of_lagrange = [name for name in defaults if name.partition("/")[0] == "lagrange"]
    closed_form = of_lagrange[0] if of_lagrange else "lagrange/dop853"
    swing, decay = fastest_rates(scene)
    if decay * scene.duration > _MAX_EXPLICIT_DECAY and decay > 10.0 * swing:
        reason = f"overdamped (largest decay rate {decay:.2g} 1/s): an implicit method in addition"
        return (closed_form, "lagrange/radau"), reason
    # A single point-mass blade does not resist the rotation of the shaft at a pitch of ±π/2.
    has_one_point = len(scene.blades) == 1 and scene.blades[0].is_point_mass
    if has_one_point and _may_reach_singular_pitch(scene):
        rotor_inertia = _largest_rotor_inertia(scene)
        if scene.hub_inertia < _NO_STEP_PASSES * rotor_inertia:
            return (closed_form,), "nearly singular at a pitch of ±π/2: other methods fail there"
        if scene.hub_inertia < _NEARLY_SINGULAR * rotor_inertia:
            reason = "near the singular pitch of ±π/2: methods with adaptive steps"
            return (closed_form, "lagrange/dop853"), reason
    if swing > _MAX_EXPLICIT_SWING:
        rate = f"highest angular frequency {swing:.2g} rad/s"
        reason = f"stiff or fast ({rate}): methods with adaptive steps"
        return (closed_form, "exudyn_tree/dopri5"), reason
    turn = swing * scene.duration
    if turn > _MAX_FIXED_STEP_TURN:
        reason = f"long ({turn:.2g} rad of the fastest oscillation): no fixed step"
        return (closed_form,), reason
    others = (name for name in defaults if name != closed_form)
    reason = "ordinary scene: the default methods, the best of each model"
    return (closed_form, *others), reason


def fastest_rates(scene: Scene) -> tuple[float, float]:
    """Estimate the rates of the fastest oscillation and of the fastest decay in a scene's motion.

    Parameters
    ----------
    scene : the scene.

    Returns
    -------
    swing : largest of the initial rates and the angular frequencies of the pitches, rad/s. Spring,
        torque, gravity and the acceleration of a driven rotor determine these frequencies.
    decay : largest decay rate that the dampers of shaft and bearings cause, 1/s.
    """
    swing = abs(scene.initial_rates[0])
    rotor_inertia = _largest_rotor_inertia(scene)
    largest_torque = max((abs(torque) for _, torque in scene.rotor_torque), default=0.0)
    driven = largest_torque / rotor_inertia  # angular acceleration of the rotor, rad/s²
    decay = scene.shaft_damping / rotor_inertia if scene.shaft_damping else 0.0
    blades = zip(
        scene.blades,
        scene.bearings,
        scene.pitch_loads,
        scene.initial_rates[1:],
        strict=True,
    )
    for blade, (stiffness, damping), (torques, _), rate in blades:
        if not blade.has_pitch_inertia:
            continue
        x, y, z = blade.centre_of_mass
        inertia = blade.pitch_inertia
        torque = max((abs(value) for _, value in torques), default=0.0)
        # `moment` is the moment about the pitch axis in N m. The spring's moment is taken at a
        # deflection of 1 rad.
        acceleration = scene.gravity + driven * abs(z)
        moment = stiffness + torque + blade.mass * acceleration * math.hypot(x, y)
        swing = max(swing, math.sqrt(moment / inertia), abs(rate))
        decay = max(decay, damping / inertia)
    return swing, decay


def singular_reason(scene: Scene) -> str:
    """Return why the mass matrix of a scene is or may become singular; "" if no reason is found.

    Only a rotor whose hub has no inertia can have a singular mass matrix. The function finds a
    singular mass matrix if the blades are point masses, but not if the blades are thin rods that
    point at the apex.

    Parameters
    ----------
    scene : the scene.
    """
    if not _largest_rotor_inertia(scene):
        return "no inertia about the shaft; allowed: a hub or blade with inertia"
    are_points = all(blade.is_point_mass and blade.has_pitch_inertia for blade in scene.blades)
    if scene.hub_inertia or not are_points:
        return ""
    if all(abs(math.cos(angle)) < 1e-15 for angle in scene.initial_angles[1:]):
        at_start = "the initial mass matrix is singular"
        return f"all pitches are ±π/2 and the hub has no inertia: {at_start}"
    if len(scene.blades) == 1 and _may_reach_singular_pitch(scene):
        return (
            "one point-mass blade on a hub without inertia: the mass matrix is singular at a pitch "
            "of ±π/2, where the motion ends; allowed: a hub with inertia"
        )
    return ""


def _largest_rotor_inertia(scene: Scene) -> float:
    """Return an upper bound on the rotor's inertia about the shaft (kg m²), for all pitches.

    A moment of inertia about any axis is at most half the trace of the inertia tensor. A point-mass
    blade reaches this bound when it is in the plane through the apex normal to the shaft.
    """
    total = scene.hub_inertia
    for blade in scene.blades:
        total += 0.5 * sum(blade.inertia_about_apex()[:3])
    return total


def _may_reach_singular_pitch(scene: Scene) -> bool:
    """Return whether the first blade's pitch may reach ±π/2.

    The result is false if the pitch stays at zero, or if its bearing has a spring.
    """
    _, y, _ = scene.blades[0].centre_of_mass
    starts_at_zero = scene.initial_angles[1] == 0.0 and scene.initial_rates[1] == 0.0
    leans = scene.blades[0].cone != 0.0 or (scene.shaft_tilt != 0.0 and scene.gravity != 0.0)
    # Gravity and the rotor's motion do not change a blade's pitch if the centre of mass is in the
    # plane of rotation.
    is_in_plane = y == 0.0 and not leans
    stays = is_in_plane and starts_at_zero and not scene.pitch_torque
    return not stays and not any(scene.bearing_stiffness)
