"""Define the classes of methods, of their ladders of settings, and of the solvers they build.

A `Method` object describes a method completely, except for the accuracy bounds of built-in methods.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, Protocol

from rotor_mbs.errors import InputError, RotorError, shown_value
from rotor_mbs.methods.settings import Settings as Settings

if TYPE_CHECKING:  # reading the catalogue needs none of these modules
    from rotor_mbs.scenario.accuracy_bounds import Bound
    from rotor_mbs.scenario.scene import Scene
    from rotor_mbs.solution.trajectory import Integration, Linearization, RunBlock, Trajectory


STEP, TOLERANCE = "step", "tolerance"
MAX_STEPS = 1e9  # largest number of steps in a run; the engines count steps in 32 bits


@dataclass(frozen=True)
class Ladder:
    """A series of steps or tolerances of a method, each finer than the one before.

    `bench` draws each ladder as a curve of the work-precision diagram.

    Attributes
    ----------
    kind : STEP or TOLERANCE.
    values : steps as shares of the sample interval, or tolerances, from coarse to fine.
    settings_at : (step in s, or tolerance) -> settings with this step or tolerance.
    choices : settings that stay the same along the ladder.
    variant : text after the method's name in the name of the curve; "" for the default choices.
    label : text after the method's label in the label of the curve.
    """

    kind: str
    values: tuple[float, ...]
    settings_at: Callable[[float], Mapping[str, float]]
    choices: Mapping[str, object] = field(default_factory=dict)
    variant: str = ""
    label: str = ""

    @property
    def coarse(self) -> Ladder:
        """Return a shorter ladder: every second value, without the coarsest third."""
        return replace(self, values=self.values[len(self.values) // 3 :: 2])

    def settings_by_value(self, interval: float) -> dict[float, dict[str, object]]:
        """Return the settings of every point of the ladder.

        Parameters
        ----------
        interval : s, time between samples.

        Returns
        -------
        dict
            Settings of each point by its step (s) or tolerance, from coarse to fine. A setting that
            is missing has its default.
        """
        settings: dict[float, dict[str, object]] = {}
        for value in self.values:
            number = value * interval if self.kind == STEP else value
            settings[number] = {**self.choices, **self.settings_at(number)}
        return settings


def step_ladder(count: int, first: int = 0, **others: Any) -> Ladder:
    """Return a ladder of steps, each half as long as the one before.

    Parameters
    ----------
    count : number of steps.
    first : the first step is the sample interval times 0.5**first.
    **others : values of further fields of the `Ladder`.
    """
    shares = tuple(0.5**k for k in range(first, first + count))
    return Ladder(STEP, shares, lambda step: {"step": step}, **others)


def tolerance_ladder(
    settings_at: Callable[[float], Mapping[str, float]],
    *tolerances: float,
) -> Ladder:
    """Return a ladder of tolerances.

    Parameters
    ----------
    settings_at : (tolerance) -> settings with this tolerance.
    *tolerances : the tolerances, from coarse to fine.
    """
    return Ladder(TOLERANCE, tolerances, settings_at)


def tolerance_pair(tolerance: float) -> Mapping[str, float]:
    """Return settings with a relative tolerance, and an absolute tolerance of a hundredth of it."""
    # Angles and rates are of order one, so the relative tolerance determines the accuracy.
    return {"relative_tolerance": tolerance, "absolute_tolerance": 0.01 * tolerance}


@dataclass(frozen=True, slots=True)
class BuiltItem:
    """An item of a model, as `show --build` lists it.

    Attributes
    ----------
    kind : node, object, marker, load, sensor, equation, term or output.
    name : name of the item.
    detail : further description.
    """

    kind: str
    name: str
    detail: str = ""


class Solver(Protocol):
    """A model with an integrator, built for one scene; it can integrate the scene repeatedly."""

    def integrate(self) -> Integration:
        """Integrate from the initial state to the end.

        The time of this call is stored as the run time of the method. The call must therefore do
        nothing but integrate.
        """

    def observe(self) -> Trajectory:
        """Return the samples of the last integration, up to the first that is not finite.

        That sample is excluded.
        """


def checked_result(value: Any, kind: type, name: str, function: object, method: str) -> Any:
    """Return a value that a function of a method has returned, after a check of its type.

    Parameters
    ----------
    value : the value.
    kind : the type that the value must have.
    name : the role of the function, such as "observe", for the message.
    function : the function, or a class that is called like one.
    method : name of the method; the message begins with it if the function's file is not known.

    Raises
    ------
    RotorError
        If the value is of another type. The message has the file and line number of the function.
    """
    if isinstance(value, kind):
        return value
    what = "None" if value is None else f"an object of type {type(value).__name__}"
    allowed = f"an object of type {kind.__name__}"
    raise RotorError(f"{place_of(function, method)}: {name} returned {what}; allowed: {allowed}")


def place_of(function: object, default: str) -> str:
    """Return "file:line" of a Python function or class, or a default for other callables."""
    for place in (function, getattr(function, "__init__", None)):
        code = getattr(place, "__code__", None)
        if code is not None:
            return f"{code.co_filename}:{code.co_firstlineno}"
    return default


def method_fault(method: Method) -> str:
    """Return a message on the first attribute of a method that has a wrong type; "" if none has."""
    is_optional_number = method.order is None or _is_number(method.order)
    are_right = {
        "name": (isinstance(method.name, str), "text"),
        "label": (isinstance(method.label, str), "text"),
        "build": (callable(method.build), "a function of (scene, settings)"),
        "items": (callable(method.items), "a function of (scene)"),
        "settings": (_is_settings(method.settings), "a subclass of Settings"),
        "order": (is_optional_number, "a number or None"),
        "relative_cost": (_is_number(method.relative_cost), "a number"),
        "ladders": (_are_all(method.ladders, Ladder), "a tuple of Ladder"),
        "distributions": (_are_all(method.distributions, str), "a tuple of text"),
        "arrays": (_are_all(method.arrays, str), "a tuple of text"),
        "bounds": (_are_bounds(method.bounds), "a tuple of Bound"),
        "solve_many": (_is_function_or_none(method.solve_many), "a function or None"),
        "linearize": (_is_function_or_none(method.linearize), "a function or None"),
        "import_engine": (callable(method.import_engine), "a function"),
    }
    for name, (is_right, allowed) in are_right.items():
        if not is_right:
            return f"{name} = {shown_value(getattr(method, name))}; allowed: {allowed}"
    return ""


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_settings(value: object) -> bool:
    return isinstance(value, type) and issubclass(value, Settings)


def _is_function_or_none(value: object) -> bool:
    return value is None or callable(value)


def _are_all(values: object, kind: type) -> bool:
    return isinstance(values, tuple | list) and all(isinstance(value, kind) for value in values)


def _are_bounds(values: object) -> bool:
    from rotor_mbs.scenario.accuracy_bounds import Bound  # not at the top: `list` needs no bounds

    return _are_all(values, Bound)


def no_items(_scene: Scene) -> list[BuiltItem]:
    """Return an empty list, for methods that do not list their items."""
    return []


@dataclass(frozen=True, kw_only=True, eq=False)
class Method:
    """A model with one integrator.

    Attributes
    ----------
    name : "model/integrator", as on the command line and in files.
    label : name in tables and figures: "model, integrator".
    build : (scene, settings) -> Solver; settings is an instance of `settings`. Raises MethodRefusal
        if the method cannot represent the scene.
    items : (scene) -> list of BuiltItem, the items of the model. Raises MethodRefusal like `build`.
    settings : class of the settings, with their units, defaults and ranges.
    is_corrected : whether it solves the corrected equations; if not, the accuracy of its runs is
        not assessed.
    is_default : whether the method is in the default selection.
    erratum : "E1", "E2" or "E3" if its equations have only this erratum; otherwise "".
    distributions : names of the packages that the method needs.
    fallback : name of the method that replaces it if one of these packages is not installed; "" for
        none.
    order : order of convergence; None if it is not fixed.
    fixed_step : whether all steps of a run have the same length, the setting `step`.
    ladders : series of settings used by `bench`.
    relative_cost : approximate run time, divided by that of the fastest method. With the duration
        of the scene it decides in which order runs start.
    bounds : accuracy bounds of a method of another package; those of built-in methods are in
        reference/accuracy.toml.
    solve_many : (scenes, settings) -> RunBlock, several runs of a sweep computed at once; or None.
        It computes no outputs but angles, rates, tip and energy.
    linearize : (scene, steady angles, rotor speed, rotor torque) -> Linearization; or None. At most
        one method of a model has this function; the printed equations have none. It raises
        MethodRefusal for a state about which the model cannot be linearized.
    arrays : names of optional quantities that the method stores, such as "constraint_error".
    sources : source files of a method of another package, or the text of a method file. A digest
        of them is stored with each run.
    import_engine : () -> None, called by `bench` before its first timing. It imports the packages
        that the method needs. If the engine caches compiled code on the disk, the function also
        turns this cache off, so that a cold start is timed.
    """

    name: str
    label: str
    build: Callable[[Scene, Any], Solver]
    items: Callable[[Scene], list[BuiltItem]] = no_items
    settings: type[Settings] = Settings
    is_corrected: bool = True
    is_default: bool = False
    erratum: str = ""
    distributions: tuple[str, ...] = ()
    fallback: str = ""
    order: float | None = None
    fixed_step: bool = False
    ladders: tuple[Ladder, ...] = ()
    relative_cost: float = 1.0
    bounds: tuple[Bound, ...] = ()
    solve_many: Callable[[Sequence[Scene], Any], RunBlock] | None = None
    linearize: Callable[[Scene, Any, float, float], Linearization] | None = None
    arrays: tuple[str, ...] = ()
    sources: tuple[Path | str, ...] = ()
    import_engine: Callable[[], object] = lambda: None

    @property
    def model(self) -> str:
        """Return the name of the model, such as "lagrange" for "lagrange/taylor"."""
        return self.name.partition("/")[0]

    @property
    def model_label(self) -> str:
        """Return the label of the model, such as "closed form" for "closed form, Taylor"."""
        return self.label.partition(",")[0]

    @property
    def defaults(self) -> dict[str, object]:
        """Return the default values of the settings by name."""
        return self.settings().as_dict()

    @property
    def is_installed(self) -> bool:
        """Return whether all packages that the method needs are installed."""
        return all(_is_distribution_installed(distribution) for distribution in self.distributions)

    def chosen(self, scene: Scene, given: Mapping[str, object]) -> Settings:
        """Return all settings for a run, from those that are given and the defaults.

        Parameters
        ----------
        scene : the scene to run.
        given : values of settings by name.

        Raises
        ------
        InputError
            If a name is unknown, a value is invalid, or the step is less than the duration of the
            scene divided by MAX_STEPS.
        """
        chosen = self.settings.of(self.name, given)
        if not self.fixed_step:
            return chosen
        step = getattr(chosen, STEP)
        if scene.duration / step > MAX_STEPS:
            limit = f"{MAX_STEPS:g} steps for {scene.duration:g} s"
            allowed = f"a step of at least {scene.duration / MAX_STEPS:g} s"
            what = f"step = {step:g} requires more than {limit}"
            raise InputError(f"{self.name}: {what}; allowed: {allowed}")
        return chosen

    def finer(self, settings: Mapping[str, object], interval: float) -> dict[str, object]:
        """Return settings of the next point on the method's ladder that is finer than a run.

        Only the settings that have to be lowered are returned; none if there is no finer point.

        Parameters
        ----------
        settings : all settings of the run.
        interval : s, time between samples.
        """
        for ladder in self.ladders:
            # Only the ladder with the default choices is searched. Ladders of variants have the
            # same steps, and other choices.
            if ladder.variant:
                continue
            for number in ladder.settings_by_value(interval):
                finer = ladder.settings_at(number)
                lower: dict[str, object] = {}
                for name, value in finer.items():
                    current = settings[name]
                    # A value that is lower by less than 1 % does not count as finer: the run may
                    # have this value of the ladder already, rounded to three digits, if the user
                    # copied it from printed advice (`studies.run.next_to_try`).
                    if isinstance(current, int | float) and value < 0.99 * current:
                        lower[name] = value
                # The first setting of a point limits the accuracy: it is the step, the only
                # tolerance, or the larger of two tolerances. If this setting is not lower than that
                # of the run, the point is not finer than the run.
                first_setting = next(iter(finer))
                if first_setting in lower:
                    return lower
        return {}


def _is_distribution_installed(distribution: str) -> bool:
    """Return whether a package is installed, without importing it."""
    module = distribution.replace("-", "_")
    if module in sys.modules:
        return bool(sys.modules[module])  # None if its import is blocked
    try:
        return find_spec(module) is not None or metadata.distribution(distribution) is not None
    except metadata.PackageNotFoundError:
        return False


def lazy(place: str) -> Callable[..., Any]:
    """Return a function that imports and calls the function at "package.module:name".

    The import takes place when the returned function is called; the arguments are passed on.
    """
    return lambda *arguments: resolve_name(place)(*arguments)
