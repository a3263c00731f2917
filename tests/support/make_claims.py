"""Makes claim_runs.json, the paper's claims on many runs and its numbers under other conditions,
and the verdicts that follow from them, reference/claims.json.

    python tests/support/make_claims.py [--jobs N]

The same seed gives the same file, and fewer runs are the first of more. These are 8,484 runs.
"""

from __future__ import annotations

import argparse
import json
import math
import operator
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from itertools import product
from multiprocessing import Pool
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import numpy as np

from rotor_mbs.analysis.judgement import judge
from rotor_mbs.analysis.published import FAILS, HOLDS, UNDECIDED, Published, published, rounds_to
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.printed import literal
from rotor_mbs.report.numbers import number, power, with_unit
from rotor_mbs.runs.versions import versions
from rotor_mbs.scenario.catalogue import REFERENCES, find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.metrics import metrics_of
from rotor_mbs.solution.status import COMPLETE
from rotor_mbs.solution.trajectory import Array
from support.gravity_rows import DEFAULT_ROW, GRAVITY_ROWS, SUMMED, moment

FILE = Path(__file__).with_name("claim_runs.json")
PRINTED = "printed/ode45"
METHODS = (PRINTED, "lagrange/taylor")
DURATIONS = (8.0, 10.0, 12.0)  # s, of the claims; of the numbers:
TRIED_DURATIONS = (8.0, 9.0, 10.0, 11.0, 12.0, 13.0)
TOLERANCES = ((1e-5, 1e-9), (1e-6, 1e-8), (1e-6, 1e-9), (1e-6, 1e-10), (1e-7, 1e-9), (1e-8, 1e-9))
AT_REST = "paper/fig05"
RUNS, SEED = 100, 2020
SPREAD = 1e-15  # rad
ENERGY_GAIN = 1e3  # of the energy scale: a run that gains as much decides nothing
SAMPLES_PER_SECOND = 100
MARKS = {True: "y", False: "n", None: "-"}
# share of the deciding runs from which on a claim holds; 1 - SURE: up to which it fails
SURE = 0.95
DECIDING = 0.5  # share of the runs that must decide
RULE = (
    f"A claim holds if it is true in at least {100 * SURE:.0f} % of the deciding runs for every "
    f"duration, fails if it is true in at most {100 * (1 - SURE):.0f} % for every duration, and is "
    f"undecided otherwise, or if fewer than {100 * DECIDING:.0f} % of the runs are deciding. A run "
    "that ended early, or whose energy rose by a thousand times the energy scale, is not deciding."
)
Row = dict[str, Any]  # of a table of claim_runs.json


# Numbers read off runs


class TrajectoryNumber(NamedTuple):
    """A number read off a trajectory: scene, "angle" or "rate", coordinate (0 rotor, i pitch of
    blade i), statistic."""

    scene: str
    quantity: str
    coordinate: int
    statistic: str


def _reversals(x: Array) -> float:
    signs = np.sign(x[x != 0.0])
    return float(np.count_nonzero(signs[1:] != signs[:-1]))


def _growth(t: Array, x: Array) -> float | None:
    """Largest departure from the start over the second half of the time reached by that over the
    first half."""
    first = t <= 0.5 * (t[0] + t[-1])
    away = np.abs(x - x[0])
    before = float(away[first].max())
    return float(away[~first].max()) / before if before > 0.0 and not first.all() else None


def _swing_ratio(x: Array) -> float | None:
    """Largest by smallest way from one turning point to the next; the start counts as one."""
    moving = np.flatnonzero(np.diff(x) != 0.0)
    signs = np.sign(np.diff(x)[moving])
    turning = moving[1:][signs[1:] != signs[:-1]]
    swings = np.abs(np.diff(x[[0, *turning]]))
    return float(swings.max() / swings.min()) if len(swings) >= 2 else None


STATISTICS: Mapping[str, Callable[[Array, Array], float | None]] = {
    "max_abs": lambda _, x: float(np.abs(x).max()),
    "range": lambda _, x: float(np.ptp(x)),
    "max_abs_change": lambda _, x: float(np.abs(x - x[0]).max()),
    "net_change": lambda _, x: float(x[-1] - x[0]),
    "reversals": lambda _, x: _reversals(x),
    "growth": _growth,
    "swing_ratio": lambda _, x: _swing_ratio(x),
}


def measure(time: Array, angles: Array, rates: Array, asked: TrajectoryNumber) -> float | None:
    """The number in rad or rad/s (reversals and growth: 1); None where it is undefined."""
    values = {"angle": angles, "rate": rates}[asked.quantity]
    return STATISTICS[asked.statistic](time, values[:, asked.coordinate])


# Claims in words

# What is read off the runs of one model: None where it is undefined; without it where no run can
# decide.
NumberValues = Mapping[TrajectoryNumber, float | None]
RELATIONS: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    ">": operator.gt,
    "opposite": lambda value, other: value * other < 0.0,
}


def numbers_of(item: Published) -> list[TrajectoryNumber]:
    """All that is read off runs for a claim, each once."""
    sides = [
        TrajectoryNumber(*test[side])
        for test in item.tests
        for side in ("of", "than")
        if side in test
    ]
    return list(dict.fromkeys(sides))


def claim_holds(item: Published, values: NumberValues) -> bool | None:
    """Whether all tests of a claim in words hold for what was read off the runs.

    False as soon as one fails, even where others cannot be decided; None where none fails and one
    is undecided.
    """
    undecided = not item.tests
    for test in item.tests:
        sides = [TrajectoryNumber(*test[side]) for side in ("of", "than") if side in test]
        if any(side not in values for side in sides):
            undecided = True
            continue
        value, limit = values[sides[0]], values[sides[1]] if "than" in test else test["bound"]
        if value is None or limit is None or not RELATIONS[test["relation"]](value, limit):
            return False
    return None if undecided else True


def moved_starts(scene: Scene, runs: int, seed: int) -> np.ndarray[Any, Any]:
    """(runs + 1, 1 + blades) rad: the scene's own start, then every angle moved by chance; the
    first k do not depend on `runs`."""
    starts = np.tile(scene.initial_angles, (runs + 1, 1))
    for i in range(starts.shape[1]):
        starts[1:, i] += np.random.default_rng([seed, i]).uniform(-SPREAD, SPREAD, runs)
    return starts


def values_of_run(
    scene: Scene, asked: Sequence[TrajectoryNumber], method: str, start: Sequence[float]
) -> NumberValues:
    """The numbers read off the samples; none of a run that ended early or gained a thousand times
    the energy scale."""
    run = solve(method, replace(scene, initial_angles=tuple(start)), {})
    with np.errstate(all="ignore"):
        judgement = judge(scene, run, None)
    if (
        judgement.status not in COMPLETE
        or not judgement.metrics.get("energy_drift_max", math.nan) < ENERGY_GAIN
    ):
        return {}
    return {number: measure(run.time, run.angles, run.rates, number) for number in asked}


def claim_shares(
    items: Sequence[Published],
    durations: Sequence[float],
    runs: int,
    seed: int = SEED,
    jobs: int = 1,
) -> list[Row]:
    """Every claim in words by the printed equations and by the corrected closed form.

    marks: one for each run, the first from the start as given, the others from moved starts: "y"
    where the claim holds, "n" where it fails, "-" where the run decides nothing. Run k of one scene
    is compared with run k of another.
    """
    claims = [item for item in items if not item.is_number]
    asked = dict.fromkeys(number for item in claims for number in numbers_of(item))
    scenes = find_scenes(sorted({number.scene for number in asked}))
    shares: list[Row] = []
    with Pool(jobs) as pool:
        for duration in durations:
            values: dict[str, list[dict[TrajectoryNumber, float | None]]]
            values = {method: [{} for _ in range(runs + 1)] for method in METHODS}
            for scene, method in product(scenes, METHODS):
                base = replace(
                    scene, duration=duration, samples=round(SAMPLES_PER_SECOND * duration) + 1,
                    outputs=("angles", "rates", "energy"),
                )  # fmt: skip
                own = [number for number in asked if number.scene == scene.name]
                work = partial(values_of_run, base, own, method)
                starts = moved_starts(scene, runs, seed).tolist()
                for known, more in zip(
                    values[method], pool.map(work, starts, chunksize=4), strict=True
                ):
                    known |= more
                print(f"{scene.name} {method} {duration:g} s", flush=True)
            for item, method in product(claims, METHODS):
                marks = "".join(MARKS[claim_holds(item, read)] for read in values[method])
                shares.append(
                    {"claim": item.id, "method": method, "duration": duration, "marks": marks}
                )
    return shares


def share_of(marks: str) -> tuple[float | None, int]:
    """Share of the deciding runs from moved starts in which the claim holds, None where none
    decides; how many do."""
    deciding = len(marks) - 1 - marks[1:].count("-")
    return marks[1:].count("y") / deciding if deciding else None, deciding


def verdict_of(all_marks: Sequence[str]) -> str:
    """ "holds", "fails" or "undecided" of the marks for each duration: the same for all of them, or
    undecided."""
    verdicts = set()
    for marks in all_marks:
        share, deciding = share_of(marks)
        if share is None or deciding < DECIDING * (len(marks) - 1):
            verdicts.add(UNDECIDED)
        else:
            verdicts.add(HOLDS if share >= SURE else FAILS if share <= 1.0 - SURE else UNDECIDED)
    return verdicts.pop() if len(verdicts) == 1 else UNDECIDED


# Numbers under other conditions


class Conditions(NamedTuple):
    """What the paper does not print: way of writing the first row of (56), duration (s), tolerances
    of ode45."""

    gravity_row: str
    duration: float
    relative_tolerance: float
    absolute_tolerance: float


@contextmanager
def written_as(name: str) -> Iterator[None]:
    """The first row of (56) in the printed equations written as this one of GRAVITY_ROWS."""
    if name == DEFAULT_ROW:
        yield
        return
    accelerations = literal.three_blade_accelerations
    at: dict[str, float] = {}  # the rotor angle and d, which the row as run does not take

    def with_place(m: float, c: float, d: float, g: float, torques: Any, state: Any) -> Any:
        at.update(d=d, q2=state[0])
        return accelerations(m, c, d, g, torques, state)

    def rotor_gravity(
        m: float, c: float, g: float, _s2: float, _c2: float, c3: float, c4: float, c5: float
    ) -> float:
        return moment(name, m, c, at["d"], g, at["q2"], c3, c4, c5)

    with (
        mock.patch.object(literal, "three_blade_accelerations", with_place),
        mock.patch.object(literal, "rotor_gravity", rotor_gravity),
    ):
        yield


def numbers_of_run(task: tuple[Scene, Conditions]) -> dict[str, float | None]:
    """By its id, every published number that is read off a scene; None where it is not."""
    scene, conditions = task
    tolerances = {
        name: getattr(conditions, name) for name in ("relative_tolerance", "absolute_tolerance")
    }
    with written_as(conditions.gravity_row):
        run = solve(PRINTED, replace(scene, duration=conditions.duration), tolerances).trajectory
    # at ode45's own output points, as off a printed figure
    extremes = metrics_of(scene, run, None, None)
    return {item.id: extremes[item.metric] for item in published() if item.scene == scene.name}


def usual_conditions() -> Conditions:
    """Of the paper's own runs, but for the duration, which it does not print: that of Fig. 5."""
    settings = find_method(PRINTED).defaults
    (scene,) = find_scenes([AT_REST])
    tolerances = (
        float(str(settings[name])) for name in ("relative_tolerance", "absolute_tolerance")
    )
    return Conditions(DEFAULT_ROW, scene.duration, *tolerances)


def number_trials(
    rows: Sequence[str],
    durations: Sequence[float],
    tolerances: Sequence[tuple[float, float]],
    jobs: int = 1,
) -> list[Row]:
    """All published numbers for every row and duration, and for every pair of tolerances with the
    usual ones.

    remainder: N m, the row's value at the start of Fig. 5: zero but for rounding.
    """
    items = [item for item in published() if item.is_number]
    scenes = {
        scene.name: scene
        for scene in find_scenes(sorted({name for item in items for name in item.scenes}))
    }
    usual = usual_conditions()
    tried = [
        usual._replace(gravity_row=row, duration=duration) for row in rows for duration in durations
    ]
    tried += [
        usual._replace(relative_tolerance=pair[0], absolute_tolerance=pair[1])
        for pair in tolerances
    ]
    tasks = [
        (scene, conditions) for conditions in dict.fromkeys(tried) for scene in scenes.values()
    ]
    values: dict[tuple[Conditions, str], float | None] = {}
    with Pool(jobs) as pool:
        for (_, conditions), numbers in zip(tasks, pool.imap(numbers_of_run, tasks), strict=True):
            values |= {(conditions, number): value for number, value in numbers.items()}
    trials = []
    for conditions, item in product(dict.fromkeys(tried), items):
        value = values[conditions, item.id]
        result = {
            "value": value,
            "reproduced": value is not None and rounds_to(value, item),
            "remainder": remainder(scenes[AT_REST], conditions.gravity_row),
        }
        trials.append({"number": item.id, **conditions._asdict(), **result})
    return trials


def remainder(scene: Scene, row: str) -> float:
    """N m, of the row at the start of the scene."""
    mass, (c, _, d) = scene.blades[0].mass, scene.blades[0].centre_of_mass
    cosines = [math.cos(angle) for angle in scene.initial_angles[1:]]
    return moment(row, mass, c, d, scene.gravity, scene.initial_angles[0], *cosines)


def trials_under(study: Mapping[str, Any]) -> dict[Conditions, list[Row]]:
    """The trials of each condition, in the order of the file."""
    trials: dict[Conditions, list[Row]] = {}
    for row in study["trials"]:
        trials.setdefault(Conditions(*(row[name] for name in Conditions._fields)), []).append(row)
    return trials


# The files


def runs_as_json(shares: Sequence[Row], trials: Sequence[Row], runs: int, seed: int) -> str:
    """The text of claim_runs.json."""
    rows = [
        {"name": name, "formula": row, "is_of_56": name != SUMMED}
        for name, row in GRAVITY_ROWS.items()
    ]
    facts = {
        "seed": seed,
        "runs": runs,
        "spread": SPREAD,
        "made_with": versions(),
        "usual": usual_conditions()._asdict(),
        "rows": rows,
        "shares": shares,
        "trials": trials,
    }
    return as_json(facts, ("rows", "shares", "trials"))


def verdicts_as_json(study: Mapping[str, Any]) -> str:
    """The text of reference/claims.json: verdicts, shares and tables that follow from the runs."""
    marks: dict[str, dict[str, dict[float, str]]] = {}
    for share in study["shares"]:
        methods = marks.setdefault(share["claim"], {method: {} for method in METHODS})
        methods[share["method"]][share["duration"]] = share["marks"]
    trials, usual = trials_under(study), Conditions(**study["usual"])

    def row(
        conditions: Conditions, *labels: str
    ) -> tuple[list[str], list[float | None], list[bool]]:
        tried = trials[conditions]
        return (
            [*labels],
            [trial["value"] for trial in tried],
            [trial["reproduced"] for trial in tried],
        )

    over = f", over {with_unit(usual.duration, 's')}"
    by_duration = sorted(
        tried for tried in trials if tried == usual._replace(duration=tried.duration)
    )
    by_tolerance = sorted(tried for tried in trials if tried[:2] == usual[:2])
    by_form = [
        (usual._replace(gravity_row=written["name"]), written["formula"])
        for written in study["rows"]
    ]
    tables = [
        {
            "caption": "The published numbers by the duration of the run",
            "head": ["Duration"],
            "rows": [row(tried, with_unit(tried.duration, "s")) for tried in by_duration],
        },
        {
            "caption": f"The published numbers by the tolerances of ode45{over}",
            "head": ["RelTol", "AbsTol"],
            "rows": [
                row(tried, ten_to(tried.relative_tolerance), ten_to(tried.absolute_tolerance))
                for tried in by_tolerance
            ],
        },
        {
            "caption": f"The published numbers by form of the first row of (56){over}",
            "head": ["Row", "At the start (N m)"],
            "rows": [
                row(tried, formula, number(trials[tried][0]["remainder"]))
                for tried, formula in by_form
            ],
        },
    ]
    facts = {
        "rule": RULE,
        "runs": study["runs"],
        "spread": study["spread"],
        "methods": METHODS,
        "durations": DURATIONS,
        "verdicts": {
            claim: {method: verdict_of([*by_time.values()]) for method, by_time in methods.items()}
            for claim, methods in marks.items()
        },
        "shares": {
            claim: {
                method: [share_of(of_time) for of_time in by_time.values()]
                for method, by_time in methods.items()
            }
            for claim, methods in marks.items()
        },
        "numbers": [trial["number"] for trial in trials[usual]],
        "trials": tables,
    }
    return as_json(facts, ("verdicts", "shares"))


def as_json(facts: Mapping[str, Any], tables: Container[str]) -> str:
    """JSON with a line for each fact, and for each entry of a table."""
    parts = []
    for name, value in facts.items():
        text = json.dumps(value, ensure_ascii=False)
        if name in tables and isinstance(value, dict):
            lines = [
                f'  "{key}": {json.dumps(entry, ensure_ascii=False)}'
                for key, entry in value.items()
            ]
            text = "{\n" + ",\n".join(lines) + "\n }"
        elif name in tables:
            lines = [f"  {json.dumps(entry, ensure_ascii=False)}" for entry in value]
            text = "[\n" + ",\n".join(lines) + "\n ]"
        parts.append(f' "{name}": {text}')
    return "{\n" + ",\n".join(parts) + "\n}\n"


def ten_to(value: float) -> str:
    """A power of ten, as pages show it."""
    return power(int(f"{value:.0e}".partition("e")[2]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=2, metavar="N")
    arguments = parser.parse_args()
    shares = claim_shares(published(), DURATIONS, RUNS, SEED, arguments.jobs)
    trials = number_trials(tuple(GRAVITY_ROWS), TRIED_DURATIONS, TOLERANCES, arguments.jobs)
    text = runs_as_json(shares, trials, RUNS, SEED)
    FILE.write_text(text, encoding="utf-8")
    (REFERENCES / "claims.json").write_text(verdicts_as_json(json.loads(text)), encoding="utf-8")


if __name__ == "__main__":
    main()
