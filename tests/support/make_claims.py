"""Makes claim_runs.json, the paper's claims on many runs and its numbers under other conditions, and the verdicts that
follow from them, reference/claims.json.

    python tests/support/make_claims.py [--runs N] [--seed N] [--jobs N]

The same seed gives the same file, and fewer runs are the first of more. With 100 runs these are 8,484 runs.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from functools import partial
from itertools import product
from multiprocessing import Pool
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from rotor_mbs.analysis.claims import rounds_to
from rotor_mbs.analysis.judgement import judge
from rotor_mbs.analysis.published import Published, TrajectoryNumber, published
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.printed import literal
from rotor_mbs.report.core.numbers import number, power, with_unit
from rotor_mbs.runs.versions import versions
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.status import COMPLETE
from support.claim_study import (
    FILE,
    RULE,
    ClaimRuns,
    ClaimShare,
    Conditions,
    NumberTrial,
    NumberValues,
    claim_holds,
    claim_runs,
    measure,
    numbers_of,
)
from support.gravity_rows import DEFAULT_ROW, GRAVITY_ROWS

PRINTED = "printed/ode45"
METHODS = (PRINTED, "lagrange/taylor")
DURATIONS = (8.0, 10.0, 12.0)  # s, of the shares; of the numbers:
TRIED_DURATIONS = (8.0, 9.0, 10.0, 11.0, 12.0, 13.0)
TOLERANCES = ((1e-5, 1e-9), (1e-6, 1e-8), (1e-6, 1e-9), (1e-6, 1e-10), (1e-7, 1e-9), (1e-8, 1e-9))
AT_REST = "paper/fig05"
RUNS, SEED = 100, 2020
SPREAD = 1e-15  # rad
ENERGY_GAIN = 1e3  # of the energy scale: a run that gains as much decides nothing
SAMPLES_PER_SECOND = 100
MARKS = {True: "y", False: "n", None: "-"}


# Shares of claims


def moved_starts(scene: Scene, runs: int, seed: int) -> np.ndarray[Any, Any]:
    """(runs + 1, 1 + blades) rad: the scene's own start, then every angle moved by chance; the first k do not depend on
    `runs`."""
    starts = np.tile(scene.initial_angles, (runs + 1, 1))
    for i in range(starts.shape[1]):
        starts[1:, i] += np.random.default_rng([seed, i]).uniform(-SPREAD, SPREAD, runs)
    return starts


def decides(status: str, energy_drift: float) -> bool:
    """Whether a run reached its end without gaining a thousandfold energy, or one beyond all numbers."""
    return status in COMPLETE and energy_drift < ENERGY_GAIN


def values_of_run(scene: Scene, asked: Sequence[TrajectoryNumber], method: str, start: Sequence[float]) -> NumberValues:
    """The numbers read off the samples; none of a run that decides nothing."""
    run = solve(method, replace(scene, initial_angles=tuple(start)), {})
    with np.errstate(all="ignore"):
        judgement = judge(scene, run, None)
    if not decides(judgement.status, judgement.metrics.get("energy_drift_max", math.nan)):
        return {}
    arrays = {"time": run.time, "angles": run.angles, "rates": run.rates}
    return {number: measure(arrays, number) for number in asked}


def marks(item: Published, runs: Iterable[NumberValues]) -> str:
    """A mark of the claim for each run; run k of one scene is compared with run k of another."""
    return "".join(MARKS[claim_holds(item, values)] for values in runs)


def claim_shares(
    items: Sequence[Published] | None = None,
    durations: Sequence[float] = DURATIONS,
    runs: int = RUNS,
    seed: int = SEED,
    jobs: int = 1,
) -> list[ClaimShare]:
    """Every claim in words by the printed equations and by the corrected closed form."""
    claims = [item for item in (published() if items is None else items) if not item.is_number]
    asked = dict.fromkeys(number for item in claims for number in numbers_of(item))
    scenes = find_scenes(sorted({number.scene for number in asked}))
    shares = []
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
                for known, more in zip(values[method], pool.map(work, starts, chunksize=4), strict=True):
                    known |= more
                print(f"{scene.name} {method} {duration:g} s", flush=True)
            for item in claims:
                shares += [ClaimShare(item.id, name, duration, marks(item, rows)) for name, rows in values.items()]
    return shares


# Numbers under other conditions


@contextmanager
def written_as(name: str) -> Iterator[None]:
    """The first row of (56) in the printed equations written as this one of GRAVITY_ROWS."""
    if name == DEFAULT_ROW:
        yield
        return
    row, accelerations = GRAVITY_ROWS[name], literal.three_blade_accelerations
    at: dict[str, float] = {}  # the rotor angle and d, which the row as run does not take

    def with_place(m: float, c: float, d: float, g: float, torques: Any, state: Any) -> Any:
        at.update(d=d, q2=state[0])
        return accelerations(m, c, d, g, torques, state)

    def moment(m: float, c: float, g: float, _s2: float, _c2: float, c3: float, c4: float, c5: float) -> float:
        return row.moment(m, c, at["d"], g, at["q2"], c3, c4, c5)

    with (
        mock.patch.object(literal, "three_blade_accelerations", with_place),
        mock.patch.object(literal, "rotor_gravity", moment),
    ):
        yield


def numbers_of_run(task: tuple[Scene, Conditions]) -> dict[str, float]:
    """By its id, every published number that is read off a scene; NaN, which has no printed digits, where it is not."""
    scene, conditions = task
    tolerances = {name: getattr(conditions, name) for name in ("relative_tolerance", "absolute_tolerance")}
    with written_as(conditions.gravity_row):
        run = solve(PRINTED, replace(scene, duration=conditions.duration), tolerances).trajectory
    # At ode45's own output points, as off a printed figure.
    arrays = {"time": run.refined_time, "angles": run.refined_angles, "rates": run.refined_rates}
    numbers = {}
    for item in published():
        if item.of is not None and item.of.scene == scene.name:
            value = measure(arrays, item.of)
            numbers[item.id] = math.nan if value is None else value
    return numbers


def usual_conditions() -> Conditions:
    """Of the paper's own runs, but for the duration, which it does not print: that of Fig. 5."""
    settings = find_method(PRINTED).defaults
    (scene,) = find_scenes([AT_REST])
    tolerances = (float(str(settings[name])) for name in ("relative_tolerance", "absolute_tolerance"))
    return Conditions(DEFAULT_ROW, scene.duration, *tolerances)


def number_trials(
    rows: Sequence[str] = tuple(GRAVITY_ROWS),
    durations: Sequence[float] = TRIED_DURATIONS,
    tolerances: Sequence[tuple[float, float]] = TOLERANCES,
    jobs: int = 1,
) -> list[NumberTrial]:
    """All published numbers for every row and duration, and for every pair of tolerances with the usual ones."""
    items = [item for item in published() if item.of is not None]
    scenes = {scene.name: scene for scene in find_scenes(sorted({name for item in items for name in item.scenes}))}
    usual = usual_conditions()
    tried = [replace(usual, gravity_row=row, duration=duration) for row in rows for duration in durations]
    tried += [replace(usual, relative_tolerance=pair[0], absolute_tolerance=pair[1]) for pair in tolerances]
    tasks = [(scene, conditions) for conditions in dict.fromkeys(tried) for scene in scenes.values()]
    values: dict[tuple[Conditions, str], float] = {}
    with Pool(jobs) as pool:
        for (_, conditions), numbers in zip(tasks, pool.imap(numbers_of_run, tasks), strict=True):
            values |= {(conditions, number): value for number, value in numbers.items()}
    return [
        NumberTrial(item.id, conditions, value, rounds_to(value, item),
                    remainder(scenes[AT_REST], conditions.gravity_row))
        for conditions in dict.fromkeys(tried)
        for item in items
        for value in [values[conditions, item.id]]
    ]  # fmt: skip


def remainder(scene: Scene, row: str) -> float:
    """N m, of the row at the start of the scene."""
    mass, (c, _, d) = scene.blades[0].mass, scene.blades[0].centre_of_mass
    cosines = [math.cos(angle) for angle in scene.initial_angles[1:]]
    return GRAVITY_ROWS[row].moment(mass, c, d, scene.gravity, scene.initial_angles[0], *cosines)


# The files


def runs_as_json(shares: Iterable[ClaimShare], trials: Iterable[NumberTrial], runs: int, seed: int) -> str:
    """The text of claim_runs.json, with a line for each row of a table."""
    facts: Mapping[str, object] = {
        "seed": seed,
        "runs": runs,
        "spread": SPREAD,
        "made_with": versions(),
        "usual": asdict(usual_conditions()),
    }
    trial_rows = []
    for trial in trials:
        value = None if math.isnan(trial.value) else trial.value
        result = {"value": value, "reproduced": trial.reproduced, "remainder": trial.remainder}
        trial_rows.append({"number": trial.number, **asdict(trial.conditions), **result})
    tables: dict[str, list[Mapping[str, object]]] = {
        "rows": [
            {"name": name, "formula": row.formula, "is_of_56": row.of is not None} for name, row in GRAVITY_ROWS.items()
        ],
        "shares": [asdict(share) for share in shares],
        "trials": trial_rows,
    }
    parts = [f" {json.dumps(name)}: {json.dumps(value)}" for name, value in facts.items()]
    for name, rows in tables.items():
        lines = ",\n".join("  " + json.dumps(row, ensure_ascii=False) for row in rows)
        parts.append(f' "{name}": [\n{lines}\n ]')
    return "{\n" + ",\n".join(parts) + "\n}\n"


def verdicts_as_json(study: ClaimRuns) -> str:
    """The text of reference/claims.json: verdicts, shares and tables that follow from the runs."""
    shares, trials = study
    usual = trials.usual
    items = {item.id: item for item in published() if item.id in trials.numbers}

    def known(value: float) -> float | None:
        return None if math.isnan(value) else value

    def row(conditions: Conditions, *labels: str) -> tuple[list[str], list[float | None], list[bool]]:
        tried = [trials.under(conditions)[name] for name in items]
        return [*labels], [known(trial.value) for trial in tried], [trial.reproduced for trial in tried]

    over = f", over {with_unit(usual.duration, 's')}"
    tables = [
        {
            "caption": "The published numbers by the duration of the run",
            "head": ["Duration"],
            "rows": [row(tried, with_unit(tried.duration, "s")) for tried in trials.of_row(usual.gravity_row)],
        },
        {
            "caption": f"The published numbers by the tolerances of ode45{over}",
            "head": ["RelTol", "AbsTol"],
            "rows": [
                row(tried, ten_to(tried.relative_tolerance), ten_to(tried.absolute_tolerance))
                for tried in trials.with_tolerances()
            ],
        },
        {
            "caption": f"The published numbers by form of the first row of (56){over}",
            "head": ["Row", "At the start (N m)"],
            "rows": [
                row(conditions, formula, number(next(iter(trials.under(conditions).values())).remainder))
                for name, formula in trials.rows.items()
                for conditions in [replace(usual, gravity_row=name)]
            ],
        },
    ]
    facts: dict[str, object] = {
        "rule": RULE,
        "runs": shares.runs,
        "spread": shares.spread,
        "methods": shares.methods,
        "durations": shares.durations,
        "verdicts": {
            claim: {method: shares.verdict(claim, method) for method in shares.methods} for claim in shares.claims
        },
        "shares": {
            claim: {
                method: [(known(share.share), share.deciding) for share in shares.of(claim, method)]
                for method in shares.methods
            }
            for claim in shares.claims
        },
        "numbers": list(items),
        "trials": tables,
    }
    parts = []
    for name, value in facts.items():
        text = json.dumps(value, ensure_ascii=False)
        if isinstance(value, dict):  # a line for each claim
            lines = [f"  {json.dumps(key)}: {json.dumps(entry)}" for key, entry in value.items()]
            text = "{\n" + ",\n".join(lines) + "\n }"
        parts.append(f' "{name}": {text}')
    return "{\n" + ",\n".join(parts) + "\n}\n"


def ten_to(value: float) -> str:
    """A power of ten, as pages show it."""
    return power(int(f"{value:.0e}".partition("e")[2]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=RUNS, metavar="N")
    parser.add_argument("--seed", type=int, default=SEED, metavar="N")
    parser.add_argument("--jobs", type=int, default=2, metavar="N")
    arguments = parser.parse_args()
    shares = claim_shares(runs=arguments.runs, seed=arguments.seed, jobs=arguments.jobs)
    trials = number_trials(jobs=arguments.jobs)
    FILE.write_text(runs_as_json(shares, trials, arguments.runs, arguments.seed), encoding="utf-8")
    verdicts = Path(__file__).parents[2] / "reference" / "claims.json"
    verdicts.write_text(verdicts_as_json(claim_runs()), encoding="utf-8")


if __name__ == "__main__":
    main()
