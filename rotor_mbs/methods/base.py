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


from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rotor_mbs.scenario.scene import Scene


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
    label: str = ""  # of the variant; the method's where it is left out
    method: str = ""  # name and expected order (None: adaptive step) of the method; filled in by the `Method`
    order: float | None = None

    @property
    def curve(self) -> str:
        """Name of the curve: "model/integrator", and the variant."""
        return self.method + self.variant

    @property
    def short(self) -> Ladder:
        """This ladder with every second value, without the coarsest third."""
        return replace(self, values=self.values[len(self.values) // 3 :: 2])

    def rungs(self, interval: float) -> dict[float, dict[str, object]]:
        """All that the method is given at each rung, by step (s) or tolerance; interval: s, between samples."""
        numbers = [value * interval if self.kind == STEP else value for value in self.values]
        return {number: {**self.choices, **self.fill(number)} for number in numbers}


def step_ladder(count: int, first: int = 0, **facts: Any) -> Ladder:
    """Of the setting `step`: 0.5**first, ..., 0.5**(first + count - 1) of the sample interval; facts: of the
    `Ladder`."""
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
    """One thing a model builds for a scene: kind is node, object, marker, load, sensor, equation or term."""

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
    """Of a method that does not say what it builds."""
    return []


@dataclass(frozen=True, kw_only=True, eq=False)
class Method:
    """A model with one integrator.

    Attributes
    ----------
    name : "model/integrator", as on the command line and in files.
    label : how it is called in tables and figures: "model, integrator".
    build : (scene, settings) -> Solver; settings is an instance of `settings`. Raises MethodRefusal where the method
        cannot represent the scene.
    items : (scene) -> what is built for it; raises MethodRefusal likewise.
    settings : class of its settings, with units, defaults and ranges.
    is_corrected : whether it claims to solve the correct equations, so that any status but "ok" is a failure.
    is_default : whether it belongs to the set that runs where no method is named.
    erratum : "E1" ...: the one erratum of the printed equations it has; "" for others.
    distributions : packages it needs, by the names they are installed by.
    fallback : name of the method to take where these are not installed; "" for none.
    order : order of convergence; None where it is not fixed.
    fixed_step : whether the step is the setting `step`.
    ladders : settings it is benched with.
    relative_cost : run time as a multiple of the fastest method's, roughly: expensive methods are started first.
    bounds : accuracy bounds of a method from outside; those of built-in ones are in reference/accuracy.toml.
    solve_many : (scenes, settings) -> RunBlock: a vectorized path for sweeps that ask for angles, rates, tips and
        energies alone, or None.
    linearize : (scene, steady angles, rotor speed, rotor torque) -> the model linearized there, or None; one method of
        a model has it. Raises MethodRefusal for a state that the model cannot be linearized about.
    arrays : (settings) -> names of the quantities that not every method has and this one stores, such as
        "constraint_error".
    sources : of a method from outside, the files whose code decides its runs, or the code itself.
    load : imports what it computes with, and prevents the use of compiled code from an earlier process: before
        timings, which exclude both.
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
    arrays: Callable[[Any], tuple[str, ...]] = lambda _: ()
    sources: tuple[Path | str, ...] = ()
    load: Callable[[], object] = lambda: None

    def __post_init__(self) -> None:
        ladders = []
        for ladder in self.ladders:
            if not ladder.method:
                label = f"{self.label}, {ladder.label}" if ladder.label else self.label
                order = self.order if ladder.kind == STEP else None
                ladder = replace(ladder, method=self.name, label=label, order=order)
            ladders.append(ladder)
        object.__setattr__(self, "ladders", tuple(ladders))

    @property
    def model(self) -> str:
        """ "lagrange" of "lagrange/taylor"."""
        return self.name.partition("/")[0]

    @property
    def model_label(self) -> str:
        """ "closed form" of "closed form, Taylor"."""
        return self.label.partition(",")[0]

    @property
    def defaults(self) -> dict[str, object]:
        return self.settings().as_dict()

    def chosen(self, scene: Scene, given: Mapping[str, object]) -> Settings:
        """The settings with the `given` values in place of defaults. Raises InputError for an unknown name, for a value
        that is not allowed, and for a step that makes more than MAX_STEPS steps of the scene."""
        chosen = self.settings.of(self.name, given)
        step = getattr(chosen, STEP) if self.fixed_step else scene.duration
        if scene.duration / step > MAX_STEPS:
            what = f"step = {step:g} makes more than {MAX_STEPS:g} steps of {scene.duration:g} s"
            raise InputError(f"{self.name}: {what}; allowed: a step of at least {scene.duration / MAX_STEPS:g} s")
        return chosen

    def finer(self, settings: Mapping[str, object], interval: float) -> dict[str, object]:
        """The settings of the next finer rung of its ladder, {} at its end; interval: s, between samples."""
        for ladder in self.ladders:
            if ladder.variant:
                continue
            for rung in ladder.rungs(interval):
                finer = ladder.fill(rung)
                # By more than the rounding of a rung that was given with three digits.
                lower = {name: value for name, value in finer.items() if value < 0.99 * float(str(settings[name]))}
                first_setting = next(iter(finer))
                if first_setting in lower:
                    return dict(lower)
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
