"""Define a method: one object with everything the package knows of it, and ladders of settings."""

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

if TYPE_CHECKING:  # reading the catalogue needs none of them
    from rotor_mbs.scenario.accuracy_bounds import Bound
    from rotor_mbs.scenario.scene import Scene
    from rotor_mbs.solution.trajectory import Integration, Linearization, RunBlock, Trajectory


STEP, TOLERANCE = "step", "tolerance"
MAX_STEPS = 1e9  # of a run; the engines count them in 32 bits


@dataclass(frozen=True)
class Ladder:
    """A curve of the work-precision diagram: a method over a falling step or tolerance.

    Attributes
    ----------
    kind : STEP or TOLERANCE.
    values : steps as shares of the sample interval, or tolerances, from coarse to fine.
    settings_at : (step in s, or tolerance) -> the settings that go with it.
    choices : settings that stay the same along the ladder.
    variant : what follows the method's name in the name of the curve; "" for the default choices.
    label : what follows the method's label in the label of the curve.
    """

    kind: str
    values: tuple[float, ...]
    settings_at: Callable[[float], Mapping[str, float]]
    choices: Mapping[str, object] = field(default_factory=dict)
    variant: str = ""
    label: str = ""

    @property
    def coarse(self) -> Ladder:
        """Return this ladder with every second value, without the coarsest third."""
        return replace(self, values=self.values[len(self.values) // 3 :: 2])

    def settings_by_value(self, interval: float) -> dict[float, dict[str, object]]:
        """Return the settings of every point of the ladder.

        Parameters
        ----------
        interval : s, between samples.

        Returns
        -------
        dict
            By step (s) or tolerance, from coarse to fine, all settings that the method is given.
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
    **others : other fields of the `Ladder`.
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
    settings_at : (tolerance) -> the settings that go with it.
    *tolerances : from coarse to fine.
    """
    return Ladder(TOLERANCE, tolerances, settings_at)


def tolerance_pair(tolerance: float) -> Mapping[str, float]:
    """Return the settings for a relative tolerance, with the absolute one that goes with it."""
    # Angles and rates are of order one: the relative tolerance decides.
    return {"relative_tolerance": tolerance, "absolute_tolerance": 0.01 * tolerance}


@dataclass(frozen=True, slots=True)
class BuiltItem:
    """An item of which a model consists, as `show --build` lists it.

    Attributes
    ----------
    kind : node, object, marker, load, sensor, equation or term.
    name : of the item.
    detail : further description.
    """

    kind: str
    name: str
    detail: str = ""


class Solver(Protocol):
    """A model built for one scene with one integrator, which runs from the start repeatedly."""

    def integrate(self) -> Integration:
        """Run from the initial state to the end.

        Only this is timed; it does no work that is not integration.
        """

    def observe(self) -> Trajectory:
        """Return samples of the last integration, cut before the first row that is not finite."""


def checked_result(value: Any, kind: type, name: str, function: object, method: str) -> Any:
    """Return what a function of a method returned, if it is of the right type.

    Parameters
    ----------
    value : what it returned.
    kind : the type that it must have.
    name : what the function is called in this package, such as "observe".
    function : the function; a class stands for its `__init__`.
    method : the method's name, in the message where the function's place is not known.

    Raises
    ------
    RotorError
        In one line, with the file and line number of the function.
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
    """Return which attribute of a method has a wrong type, and what is allowed; "" where none."""
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
    from rotor_mbs.scenario.accuracy_bounds import Bound  # late: `list` reads no bounds

    return _are_all(values, Bound)


def no_items(_scene: Scene) -> list[BuiltItem]:
    """Return no items, for methods that do not list them."""
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
    items : (scene) -> list of BuiltItem, the items of the model; raises MethodRefusal like `build`.
    settings : class of its settings, with units, defaults and ranges.
    is_corrected : whether it solves the corrected equations; if not, the accuracy of its runs is
        not assessed.
    is_default : whether it is in the default selection.
    erratum : "E1", "E2" or "E3" if it has this erratum of the printed equations only; else "".
    distributions : names of the packages it needs.
    fallback : name of the method that replaces it if these are not installed; "" for none.
    order : order of convergence; None if it is not fixed.
    fixed_step : whether the step is the setting `step`.
    ladders : series of settings used by `bench`.
    relative_cost : run time relative to the fastest method, roughly. Expensive methods are started
        first.
    bounds : accuracy bounds of a method of another package; those of built-in methods are in
        reference/accuracy.toml.
    solve_many : (scenes, settings) -> RunBlock: several runs of a sweep at once, for the outputs
        angles, rates, tip and energy only; or None.
    linearize : (scene, steady angles, rotor speed, rotor torque) -> Linearization, or None; for one
        method of each model. Raises MethodRefusal for a state about which the model cannot be
        linearized.
    arrays : names of optional quantities that it stores, such as "constraint_error".
    sources : source files of a method of another package, or the text of a method file;
        their digest is stored with each run.
    import_engine : imports the packages that the method needs, and switches off caches of code that
        earlier processes compiled; called before a timing.
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
        """Return the default values of its settings."""
        return self.settings().as_dict()

    @property
    def is_installed(self) -> bool:
        """Return whether all packages that it needs are installed."""
        return all(_is_distribution_installed(distribution) for distribution in self.distributions)

    def chosen(self, scene: Scene, given: Mapping[str, object]) -> Settings:
        """Return the settings for a run.

        Parameters
        ----------
        scene : the scene to run.
        given : values by name; the others have their defaults.

        Raises
        ------
        InputError
            For an unknown name, an invalid value, and a step that is less than the scene's duration
            divided by MAX_STEPS.
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
        """Return the next finer settings of its ladder, {} at its end.

        Parameters
        ----------
        settings : all settings of a run of the method.
        interval : s, between samples.
        """
        for ladder in self.ladders:
            # A variant has other choices: its settings are not finer, but other ones.
            if ladder.variant:
                continue
            for number in ladder.settings_by_value(interval):
                finer = ladder.settings_at(number)
                lower: dict[str, object] = {}
                for name, value in finer.items():
                    current = settings[name]
                    # Not by rounding alone: `next to try` prints values with three digits.
                    if isinstance(current, int | float) and value < 0.99 * current:
                        lower[name] = value
                # The first setting is the step or the relative tolerance: it must be lower.
                first_setting = next(iter(finer))
                if first_setting in lower:
                    return lower
        return {}


def _is_distribution_installed(distribution: str) -> bool:
    """Return whether a package is installed, without importing it."""
    module = distribution.replace("-", "_")
    if module in sys.modules:
        return bool(sys.modules[module])  # None where its import is blocked
    try:
        return find_spec(module) is not None or metadata.distribution(distribution) is not None
    except metadata.PackageNotFoundError:
        return False


def lazy(place: str) -> Callable[..., Any]:
    """Return the function at "package.module:name", imported when it is first called."""
    return lambda *arguments: resolve_name(place)(*arguments)
