"""All methods by name: built-in ones, those of installed packages (entry points), and those of files that were named. A
model's code is imported when one of its methods is first used; its engine, when a solver is built. And which one to
take for a scene where none is named: the rule is drawn from the stability suite."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module, metadata
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, TypeVar

from rotor_mbs.errors import InputError, MethodRefusal, nearest, shown_value
from rotor_mbs.methods.base import Ladder, Method
from rotor_mbs.methods.method_file import ENDING, MethodFile, located, quiet, read_file
from rotor_mbs.scenario.toml_file import KeyProblem, file_path

if TYPE_CHECKING:  # `rotor-mbs list` reads no scene
    from rotor_mbs.scenario.scene import Scene

REFERENCE = "reference"
PRINTED = "printed/ode45"  # with all errata
GROUP = "rotor_mbs.methods"

R = TypeVar("R")

# By the object that has them: how the names of its methods begin.
_BUILT_IN: Mapping[str, tuple[str, ...]] = {
    "rotor_mbs.models.printed.methods:METHODS": ("printed",),
    "rotor_mbs.models.lagrange.methods:METHODS": ("lagrange", REFERENCE),
    "rotor_mbs.models.exudyn.methods:METHODS": ("exudyn",),
    "rotor_mbs.models.mujoco.methods:METHODS": ("mujoco",),
}


def methods() -> tuple[Method, ...]:
    """Every method, in the order of tables and legends; plug-ins last; the reference is not one of them."""
    built_in = (method for place in _BUILT_IN for method in _load(place) if method.name != REFERENCE)
    return (*built_in, *_plug_ins().values(), *_of_files.values())


def method_names(*, is_corrected: bool | None = None) -> tuple[str, ...]:
    """Names of all methods, or of those that do (True) or do not (False) claim the corrected equations."""
    return tuple(method.name for method in methods() if is_corrected in (None, method.is_corrected))


def _built_in(name: str) -> Method | None:
    for place, beginnings in _BUILT_IN.items():
        if name.startswith(beginnings):
            for method in _load(place):
                if method.name == name:
                    return method
    return None


def is_built_in(name: str) -> bool:
    """Whether the method called `name`, "reference" included, is one of this package."""
    return _built_in(name) is not None


def look_up(name: str) -> Method | None:
    """The method called `name`, "reference" included; None where it is not known here (a file from elsewhere)."""
    return _built_in(name) or _of_files.get(name) or _plug_ins().get(name)


def find_method(name: str) -> Method:
    """The method called `name` ("model/integrator" or "reference"). Raises InputError for an unknown name."""
    method = look_up(name)
    if method is None:
        raise InputError(_unknown([name]))
    return method


def check_names(names: str | Sequence[str]) -> tuple[str, ...]:
    """The names, or the one name, once each, in order; of a Python file, those of all its methods. Raises InputError
    with a line for every unknown one."""
    names = _with_files([names] if isinstance(names, str) else names)
    if unknown := _unknown(names):
        raise InputError(unknown)
    return tuple(dict.fromkeys(names))


def _unknown(names: Sequence[str]) -> list[str]:
    """A line for each of the names that no method has."""
    known = method_names() if names else ()
    unknown = [name for name in names if name not in known]
    return [
        f"unknown method {shown_value(name)}{nearest(name, known)}; allowed: {', '.join(known)}" for name in unknown
    ]


# Files that were named, by model, and their methods: state of this process, as a file may be edited between two calls.
_files: dict[str, MethodFile] = {}
_of_files: dict[str, Method] = {}


def _with_files(names: Sequence[str]) -> list[str]:
    """The names, those of a file's methods in place of its path. Raises InputError."""
    expanded: list[str] = []
    seen: dict[str, str] = {}
    for name in names:
        if not name.endswith(ENDING):
            expanded.append(name)
            continue
        path = file_path(name)
        model = path.stem
        if Path(seen.setdefault(model, name)).resolve() != path.resolve():
            raise InputError(f"{name}: methods {model}/... are those of {seen[model]}; allowed: another file name")
        expanded += _add(read_file(name))
    return expanded


def _add(file: MethodFile) -> list[str]:
    """The names of its methods, which from now on are known."""
    if _files.get(file.model) != file:
        others = {name: method for name, method in _of_files.items() if method.model != file.model}
        made = file.load([method for method in methods() if method.name not in _of_files])
        _of_files.clear()
        _of_files.update(others | made)
        _files[file.model] = file
    return [name for name, method in _of_files.items() if method.model == file.model]


def with_method_files(work: Callable[..., R]) -> Callable[..., R]:
    """`work` for another process, which gets the method files of this one, too, and where they print nothing."""
    return partial(_in_worker, tuple(_files.values()), work) if _files else work


def _in_worker(files: Sequence[MethodFile], work: Callable[..., R], *arguments: object) -> R:
    import multiprocessing  # late: `rotor-mbs list` need not wait for it

    for file in files:
        _add(file)
    with quiet() if multiprocessing.parent_process() is not None else nullcontext():
        return work(*arguments)


def line_of(error: BaseException) -> str:
    """One line of what a method raised, with file and line number where it is a file's."""
    return located(error, [file.path for file in _files.values()])


def settings_for(names: Sequence[str], given: Mapping[str, object]) -> dict[str, dict[str, object]]:
    """By method, those of the `given` settings that it has. Raises InputError for one that none has, or that is not
    allowed."""
    if len(names) == 1:
        find_method(names[0]).settings.of(names[0], given)
    own = {name: find_method(name).settings.declared() for name in names}
    known = list(dict.fromkeys(setting for allowed in own.values() for setting in allowed))
    unknown = [setting for setting in given if setting not in known]
    if unknown and names:
        allowed = f"{', '.join(known) or 'none'} ({', '.join(names)})"
        raise InputError(f"no setting {setting!r}{nearest(setting, known)}; allowed: {allowed}" for setting in unknown)
    settings = {}
    for name, allowed_settings in own.items():
        settings[name] = {setting: value for setting, value in given.items() if setting in allowed_settings}
        find_method(name).settings.of(name, settings[name])  # checks the values
    return settings


def settings_of_any(names: Iterable[str], given: Mapping[str, object]) -> dict[str, object]:
    """Return those of the `given` settings that at least one of some methods has."""
    known = {setting for name in names for setting in find_method(name).settings.declared()}
    return {setting: value for setting, value in given.items() if setting in known}


def own_settings(scene: Scene, method: str) -> dict[str, object]:
    """Those of the scene's settings that the method has. Raises InputError for one that no method at all has."""
    if not scene.settings:
        return {}
    try:
        return settings_for(method_names(), dict(scene.settings)).get(method, {})
    except InputError as error:
        raise InputError(f"{scene.name}: settings: {problem}" for problem in error.problems) from error


def problems_of_methods(values: Mapping[str, Any]) -> list[KeyProblem]:
    """What is wrong with the `methods` that a scene file or a sweep file names."""
    return [KeyProblem(("methods",), line) for line in _unknown(values.get("methods", ()))]


def problems_of_scene(values: Mapping[str, Any]) -> list[KeyProblem]:
    """What is wrong with the `methods` and `settings` of a scene file. A sweep's settings have to be those of the
    methods that it is run with."""
    problems = problems_of_methods(values)
    settings = dict(values.get("settings", ()))
    if settings:
        try:
            settings_for(method_names(), settings)
        except InputError as error:
            problems += [KeyProblem(("settings",), problem) for problem in error.problems]
    return problems


def is_corrected(name: str) -> bool:
    """Whether the method called `name` claims the corrected equations; one that is not known here is taken to."""
    method = look_up(name)
    return method is None or method.is_corrected


def default_methods() -> tuple[str, ...]:
    """Names of the methods that run where none is named; a fallback in place of one that is not installed."""
    names = []
    for method in methods():
        if method.is_default:
            names.append(method.fallback if method.fallback and not method.is_installed else method.name)
    return tuple(names)


def errata_methods() -> dict[str, str]:
    """Name of the method that has one erratum of the printed equations alone, by erratum ("E1" ...)."""
    return {method.erratum: method.name for method in methods() if method.erratum}


def ladders(names: Sequence[str] = ()) -> dict[str, tuple[Method, Ladder]]:
    """Method and ladder by the name of the curve, "model/integrator" and the variant: of the methods named, of all
    where none is named. Raises InputError for a method that has none."""
    with_ladder = [method for method in methods() if method.ladders]
    allowed = [method.name for method in with_ladder]
    without = [name for name in names if name not in allowed]
    if without:
        own = " (a Method of a file needs a setting `step` or `tolerance`, or `ladders`: docs/your-engine.md)"
        faults = [f"no ladder for method {name!r}{own * (name in _of_files)}" for name in without]
        raise InputError([f"{fault}; allowed: {', '.join(allowed)}" for fault in faults])
    chosen = [method for method in with_ladder if not names or method.name in names]
    return {method.name + ladder.variant: (method, ladder) for method in chosen for ladder in method.ladders}


def label_of(curve: str) -> str:
    """How a method, or a variant of one by the name of its curve, is called; its name where it is not known here."""
    known = look_up(curve)
    if known is not None:
        return known.label
    variants = ladders()
    return ", ".join(part.label for part in variants[curve] if part.label) if curve in variants else curve


def model_label(model: str) -> str:
    """How a model is called: "closed form" for "lagrange"; its name where it is not known here."""
    return next((method.model_label for method in methods() if method.model == model), model)


def _load(place: str) -> tuple[Method, ...]:
    methods: tuple[Method, ...] = resolve_name(place)
    return methods


def _as_methods(loaded: object) -> tuple[Method, ...]:
    several = tuple(loaded) if isinstance(loaded, Iterable) else (loaded,)
    if not several or not all(isinstance(method, Method) for method in several):
        raise TypeError(f"{loaded!r:.60} is no Method and no sequence of them")
    return several


def _warn(message: str, *values: object) -> None:
    import logging  # late: 6 ms that `rotor-mbs list` need not wait for

    logging.getLogger("rotor_mbs").warning(message, *values)


@functools.cache
def _plug_ins() -> dict[str, Method]:
    """Methods of other packages by name. One that cannot be loaded is left out, with a warning."""
    taken = {REFERENCE} | {method.name for place in _BUILT_IN for method in _load(place)}
    plug_ins: dict[str, Method] = {}
    for point in metadata.entry_points(group=GROUP):
        try:
            loaded = _as_methods(point.load())
        except (Exception, SystemExit) as exc:  # whatever another package raises must not stop this one
            _warn("plug-in %s of %s omitted: %s: %s", point.name, point.value, type(exc).__name__, exc)
            continue
        package = (point.dist.name,) if point.dist else ()
        for method in loaded:
            if method.name in taken:
                _warn("plug-in %s of %s: method %s omitted: name already used", point.name, point.value, method.name)
                continue
            taken.add(method.name)
            distributions = tuple(dict.fromkeys((*method.distributions, *package)))
            plug_ins[method.name] = replace(method, distributions=distributions, sources=_sources(point.module))
    return plug_ins


def _sources(module: str) -> tuple[Path, ...]:
    """The files of the package that a module is in, or the module's own."""
    top = import_module(module.partition(".")[0])
    folders = [Path(folder) for folder in getattr(top, "__path__", ())]
    if folders:
        return tuple(path for folder in folders for path in sorted(folder.rglob("*.py")))
    return (Path(top.__file__),) if top.__file__ else ()


@dataclass(frozen=True)
class Refusal:
    """A run that is left out: its method cannot represent the scene, or its settings do not fit it.

    Attributes
    ----------
    scene, method : their names; "" for `method` if no method was selected for the scene.
    reason : in one sentence.
    is_asked : whether the method or its settings were named, by the call or by the scene, not selected by a rule.
    """

    scene: str
    method: str
    reason: str
    is_asked: bool = True

    def __str__(self) -> str:
        run = f"{self.method} on {self.scene}" if self.method else self.scene
        return f"not run: {run}: {self.reason}"


def able_methods(
    scene: Scene,
    names: Iterable[str],
    settings: Mapping[str, Mapping[str, object]] | None = None,
    *,
    are_named: bool = True,
) -> tuple[list[str], list[Refusal]]:
    """Return those of some methods that can run a scene, and a Refusal for each of the others.

    This is where every command decides what it leaves out.

    Parameters
    ----------
    scene : the scene.
    names : known methods.
    settings : by method, settings in place of the scene's own and the defaults; already valid by their
        declared ranges. None if the caller chooses settings that fit.
    are_named : whether the user named the methods.

    Raises
    ------
    InputError
        If the scene has a setting that no method has.
    """
    able: list[str] = []
    refused: list[Refusal] = []
    for name in names:
        method = find_method(name)
        # What a file's method raises while it is built is an InputError.
        try:
            method.items(scene)
        except (MethodRefusal, InputError) as exc:
            refused.append(Refusal(scene.name, name, _reason(exc, name), are_named))
            continue
        if settings is not None:
            own = own_settings(scene, name) | dict(settings.get(name, {}))
            # Declared ranges are checked before any scene: what is left is that they do not fit this one.
            try:
                method.chosen(scene, own)
            except InputError as exc:
                refused.append(Refusal(scene.name, name, _reason(exc, name), are_named or bool(own)))
                continue
        able.append(name)
    return able, refused


def _reason(error: Exception, method: str) -> str:
    """Return the text of an error without the method's name in front."""
    return str(error).removeprefix(f"{method}: ")


def selected_methods(
    scenes: Sequence[Scene],
    names: Sequence[str] = (),
    settings: Mapping[str, object] | None = None,
) -> tuple[dict[str, list[str]], list[str], list[Refusal]]:
    """Select the methods of each scene: those named, else those that it names itself, else those of the rule.

    Parameters
    ----------
    scenes : the scenes.
    names : known methods; () for none.
    settings : of the call, for the methods that have them.

    Returns
    -------
    methods : by scene name; an empty list where none can run.
    reasons : a line for each scene for which the rule selected methods.
    refused : the methods that were left out, and the scenes for which the rule selects none.

    Raises
    ------
    InputError
        For an unknown method of a scene, and for a setting that none of the methods has or whose value is invalid.
    """
    wanted: dict[str, list[str]] = {}
    rules: dict[str, str] = {}
    refused: list[Refusal] = []
    for scene in scenes:
        if not names and (unknown := _unknown(scene.methods)):
            raise InputError(f"{scene.name}: methods: {line}" for line in unknown)
        wanted[scene.name] = list(names or dict.fromkeys(scene.methods))
        if not wanted[scene.name]:
            try:
                chosen, reason = choose(scene, default_methods())
            except MethodRefusal as exc:
                refused.append(Refusal(scene.name, "", str(exc).removeprefix(f"{scene.name}: ")))
            else:
                wanted[scene.name] = list(chosen)
                rules[scene.name] = reason
    all_names = list(dict.fromkeys(name for chosen in wanted.values() for name in chosen))
    valid_settings = settings_for(all_names, settings or {})
    methods: dict[str, list[str]] = {}
    for scene in scenes:
        are_named = bool(names or scene.methods)
        able, others = able_methods(scene, wanted[scene.name], valid_settings, are_named=are_named)
        methods[scene.name] = able
        refused += others
    reasons = [f"{name}: {reason}: {', '.join(methods[name])}" for name, reason in rules.items()]
    return methods, reasons, refused


# Explicit fixed steps at their default (1e-3 s and below) follow a swing up to this rate, rad/s, within their bounds.
_MAX_EXPLICIT_SWING = 90.0
# A decay rate, 1/s, times the run, beyond which stability alone, not accuracy, sets an explicit step.
_MAX_EXPLICIT_DECAY = 1e4
# Radians of the fastest swing in a run beyond which fixed steps take minutes, and the error of each has added up.
_MAX_FIXED_STEP_TURN = 3e4
# Share of the rotor's inertia that a quarter turn of the pitch leaves, below which rates jump there.
_NEARLY_SINGULAR = 1e-3
# The share below which SciPy's shortest step is too long to pass there: 3e-13 breaks off, 3e-10 passes.
_NO_STEP_PASSES = 1e-11


def choose(scene: Scene, defaults: tuple[str, ...]) -> tuple[tuple[str, ...], str]:
    """The methods for `scene`, the recommended one of the `defaults` first, and why, in one line. Raises MethodRefusal
    with the reason where no motion exists to be followed."""
    reason = singular_reason(scene)
    if reason:
        raise MethodRefusal(f"{scene.name}: rejected: {reason}; select a method with -m to run it anyway")
    closed_form = next((name for name in defaults if name.partition("/")[0] == "lagrange"), "lagrange/dop853")
    swing, decay = fastest_rates(scene)
    if decay * scene.duration > _MAX_EXPLICIT_DECAY and decay > 10.0 * swing:
        reason = f"overdamped (largest decay rate {decay:.2g} 1/s): an implicit method in addition"
        return (closed_form, "lagrange/radau"), reason
    # One point-mass blade that may come to a quarter turn of its pitch, on a hub that is light beside it.
    is_alone = len(scene.blades) == 1 and scene.blades[0].is_point_mass and _leaves_zero_pitch(scene)
    if is_alone and scene.hub_inertia < _NO_STEP_PASSES * _rotor_inertia(scene):
        return (closed_form,), "nearly singular at a pitch of ±π/2: other methods fail there"
    if is_alone and scene.hub_inertia < _NEARLY_SINGULAR * _rotor_inertia(scene):
        return (closed_form, "lagrange/dop853"), "near the singular pitch of ±π/2: methods with adaptive steps"
    if swing > _MAX_EXPLICIT_SWING:
        reason = f"stiff or fast (highest angular frequency {swing:.2g} rad/s): methods with adaptive steps"
        return (closed_form, "exudyn_tree/dopri5"), reason
    if swing * scene.duration > _MAX_FIXED_STEP_TURN:
        return (closed_form,), f"long ({swing * scene.duration:.2g} rad of the fastest oscillation): no fixed step"
    others = (name for name in defaults if name != closed_form)
    return (closed_form, *others), "not stiff, nearly singular or long: the default methods, the best of each model"


def fastest_rates(scene: Scene) -> tuple[float, float]:
    """Fastest swing of a pitch in rad/s (spring, torque, gravity, turning and driven rotor), fastest decay in 1/s."""
    swing = abs(scene.initial_rates[0])
    driven = max((abs(torque) for _, torque in scene.rotor_torque), default=0.0) / _rotor_inertia(scene)
    decay = scene.shaft_damping / _rotor_inertia(scene) if scene.shaft_damping else 0.0
    each = zip(scene.blades, scene.bearings, scene.pitch_loads, scene.initial_rates[1:], strict=True)
    for blade, (stiffness, damping), (torques, _), rate in each:
        if not blade.has_pitch_inertia:
            continue
        x, y, z = blade.centre_of_mass
        inertia = blade.pitch_inertia
        torque = max((abs(value) for _, value in torques), default=0.0)
        moment = stiffness + torque + blade.mass * (scene.gravity + driven * abs(z)) * math.hypot(x, y)
        swing = max(swing, math.sqrt(moment / inertia), abs(rate))
        decay = max(decay, damping / inertia)
    return swing, decay


def _rotor_inertia(scene: Scene) -> float:
    """Return the largest inertia about the shaft (kg m²) that the rotor can have, whatever the pitches.

    No axis through the apex has more than half the trace of a tensor, and a point mass far from the axis has as much.
    """
    total = scene.hub_inertia
    for blade in scene.blades:
        total += 0.5 * sum(blade.inertia_about_apex()[:3])
    return total


def singular_reason(scene: Scene) -> str:
    """Why the mass matrix is, or must become, singular; "" where it need not. Point-mass blades on a massless hub."""
    if not _rotor_inertia(scene):
        return "no inertia about the shaft; allowed: a hub or blade with inertia"
    if scene.hub_inertia or not all(blade.is_point_mass and blade.has_pitch_inertia for blade in scene.blades):
        return ""
    if all(abs(math.cos(angle)) < 1e-15 for angle in scene.initial_angles[1:]):
        return "all pitches are ±π/2 and the hub has no inertia: the initial mass matrix is singular"
    if len(scene.blades) == 1 and _leaves_zero_pitch(scene):
        return (
            "one point-mass blade on a hub without inertia: the mass matrix is singular at a pitch of ±π/2, where the "
            "motion ends; allowed: a hub with inertia"
        )
    return ""


def _leaves_zero_pitch(scene: Scene) -> bool:
    """Whether the pitch moves, and no spring holds it short of a right angle."""
    _, y, _ = scene.blades[0].centre_of_mass
    still = y == 0.0 and scene.initial_angles[1] == 0.0 and scene.initial_rates[1] == 0.0 and not scene.pitch_torque
    return not still and not any(scene.bearing_stiffness)
