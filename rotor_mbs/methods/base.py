"""What a method is: one object that says all there is to know of it; its ladder of settings in the bench."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, Protocol

from rotor_mbs.errors import InputError
from rotor_mbs.methods.settings import Settings as Settings

if TYPE_CHECKING:  # reading the catalogue needs none of them
    from rotor_mbs.scenario.accuracy_bounds import Bound
    from rotor_mbs.scenario.scene import Scene
    from rotor_mbs.solution.trajectory import Integration, Linearization, RunBlock, Trajectory


STEP, TOLERANCE = "step", "tolerance"
MAX_STEPS = 1e9  # of a run; the engines count them in 32 bits


@dataclass(frozen=True)
class Ladder:
    """A curve of the diagram: one method with its fixed choices, over a falling step or tolerance."""

    kind: str  # STEP or TOLERANCE
    values: tuple[float, ...]  # steps as shares of the sample interval, or tolerances; coarse to fine
    fill: Callable[[float], Mapping[str, float]]  # the settings that go with one value
    choices: Mapping[str, object] = field(default_factory=dict)  # settings that stay the same along the ladder
    variant: str = ""  # what follows the method's name in the curve's name; "" where the choices are the default ones
    label: str = ""  # of the variant, which follows the method's

    @property
    def short(self) -> Ladder:
        """This ladder with every second value, without the coarsest third."""
        return replace(self, values=self.values[len(self.values) // 3 :: 2])

    def rungs(self, interval: float) -> dict[float, dict[str, object]]:
        """All that the method is given at each rung, by step (s) or tolerance; interval: s, between samples."""
        numbers = [value * interval if self.kind == STEP else value for value in self.values]
        return {number: {**self.choices, **self.fill(number)} for number in numbers}


def step_ladder(count: int, first: int = 0, **facts: Any) -> Ladder:
    """Return a ladder of steps: the sample interval times 0.5**first, ..., 0.5**(first + count - 1). `facts` are
    other fields of the `Ladder`."""
    shares = tuple(0.5**k for k in range(first, first + count))
    return Ladder(STEP, shares, lambda step: {"step": step}, **facts)


def tolerance_ladder(fill: Callable[[float], Mapping[str, float]], *tolerances: float) -> Ladder:
    """The settings that `fill` gives for each tolerance, coarse to fine."""
    return Ladder(TOLERANCE, tolerances, fill)


def tolerance_pair(tolerance: float) -> Mapping[str, float]:
    """Relative and absolute tolerance of the same work.

    Angles and rates of order one: a hundredth of the relative tolerance is nowhere the larger of the two."""
    return {"relative_tolerance": tolerance, "absolute_tolerance": 0.01 * tolerance}


@dataclass(frozen=True, slots=True)
class BuiltItem:
    """Item of a model: its `kind` (node, object, marker, load, sensor, equation or term), name and details."""

    kind: str
    name: str
    detail: str = ""


class Solver(Protocol):
    """A model built for one scene with one integrator, ready to run from the initial state as often as wanted."""

    def integrate(self) -> Integration:
        """Run from the initial state to the end. Only this is timed; it does no work that is not integration."""

    def observe(self) -> Trajectory:
        """Samples of the last integration, cut before the first row that is not finite."""


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
    build : (scene, settings) -> Solver; settings is an instance of `settings`. Raises MethodRefusal if the method
        cannot represent the scene.
    items : (scene) -> list of BuiltItem, the items of the model; raises MethodRefusal like `build`.
    settings : class of its settings, with units, defaults and ranges.
    is_corrected : whether it solves the corrected equations; if not, the accuracy of its runs is not assessed.
    is_default : whether it is in the default selection.
    erratum : "E1", "E2" or "E3" if it has this erratum of the printed equations only; else "".
    distributions : names of the packages it needs.
    fallback : name of the method that replaces it if these are not installed; "" for none.
    order : order of convergence; None if it is not fixed.
    fixed_step : whether the step is the setting `step`.
    ladders : series of settings used by `bench`.
    relative_cost : run time relative to the fastest method, roughly. Expensive methods are started first.
    bounds : accuracy bounds of a method of another package; those of built-in methods are in reference/accuracy.toml.
    solve_many : (scenes, settings) -> RunBlock: several runs of a sweep at once, for the outputs angles, rates, tip and
        energy only; or None.
    linearize : (scene, steady angles, rotor speed, rotor torque) -> Linearization, or None; for one method of each
        model. Raises MethodRefusal for a state about which the model cannot be linearized.
    arrays : names of optional quantities that it stores, such as "constraint_error".
    sources : source files of a method of another package, or its code.
    load : imports the packages it needs, and ignores code compiled by earlier processes; called before a timing.
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
    load: Callable[[], object] = lambda: None

    @property
    def model(self) -> str:
        """Name of the model, such as "lagrange" for "lagrange/taylor"."""
        return self.name.partition("/")[0]

    @property
    def model_label(self) -> str:
        """Label of the model, such as "closed form" for "closed form, Taylor"."""
        return self.label.partition(",")[0]

    @property
    def defaults(self) -> dict[str, object]:
        return self.settings().as_dict()

    def chosen(self, scene: Scene, given: Mapping[str, object]) -> Settings:
        """Return the settings: the `given` values, defaults for others. Raises InputError for an unknown name, an
        invalid value, and a step that is less than the scene's duration divided by MAX_STEPS."""
        chosen = self.settings.of(self.name, given)
        step = getattr(chosen, STEP) if self.fixed_step else scene.duration
        if scene.duration / step > MAX_STEPS:
            what = f"step = {step:g} requires more than {MAX_STEPS:g} steps for {scene.duration:g} s"
            raise InputError(f"{self.name}: {what}; allowed: a step of at least {scene.duration / MAX_STEPS:g} s")
        return chosen

    def finer(self, settings: Mapping[str, object], interval: float) -> dict[str, object]:
        """Return the next finer settings of its ladder, {} at its end.

        Parameters
        ----------
        settings : all settings of a run of the method.
        interval : s, between samples.
        """
        for ladder in self.ladders:
            if ladder.variant:
                continue
            for rung in ladder.rungs(interval):
                finer = ladder.fill(rung)
                lower: dict[str, object] = {}
                for name, value in finer.items():
                    current = settings[name]
                    # By more than the rounding of a rung that was given with three digits.
                    if isinstance(current, int | float) and value < 0.99 * current:
                        lower[name] = value
                first_setting = next(iter(finer))
                if first_setting in lower:
                    return lower
        return {}

    @property
    def is_installed(self) -> bool:
        return all(_is_distribution_installed(distribution) for distribution in self.distributions)


def _is_distribution_installed(distribution: str) -> bool:
    module = distribution.replace("-", "_")
    if module in sys.modules:
        return bool(sys.modules[module])
    try:
        return find_spec(module) is not None or metadata.distribution(distribution) is not None
    except metadata.PackageNotFoundError:
        return False


def late(place: str) -> Callable[..., Any]:
    """The function at "package.module:name", whose module is imported when it is first called."""
    return lambda *arguments: resolve_name(place)(*arguments)
