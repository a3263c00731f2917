"""The paper's claims in words tested on many runs, from starts moved by rounding: sweeps in, a table of shares out.

And its numbers by the printed equations for other durations, tolerances and ways of writing the first row of (56).
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from rotor_mbs.analysis import claim_records
from rotor_mbs.analysis.claim_records import ClaimStudy, Conditions, NumberTrial, NumberTrials
from rotor_mbs.analysis.claim_shares import ClaimShare, ClaimShares, SampledRuns, marks
from rotor_mbs.analysis.claims import rounds_to
from rotor_mbs.analysis.published import Published, TrajectoryNumber, published
from rotor_mbs.analysis.run_selection import PRINTED
from rotor_mbs.analysis.trajectory_numbers import measure
from rotor_mbs.errors import RotorError, StoreError
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.printed.gravity_rows import DEFAULT_ROW, GRAVITY_ROWS
from rotor_mbs.runs.cluster import open_task_pool
from rotor_mbs.runs.lock import writing
from rotor_mbs.runs.pool import local_pool, run_in
from rotor_mbs.runs.records import write_records
from rotor_mbs.runs.results_file import ResultsStore, refuse_other_kinds
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.runs.versions import versions
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.sweep import Sweep, sweep_of
from rotor_mbs.studies.sweep import plan_sweep, run_sweep

METHODS = (PRINTED, "lagrange/taylor")
DURATIONS = (8.0, 10.0, 12.0)  # s, of the shares; of the numbers:
TRIED_DURATIONS = (8.0, 9.0, 10.0, 11.0, 12.0, 13.0)
TOLERANCES = ((1e-5, 1e-9), (1e-6, 1e-8), (1e-6, 1e-9), (1e-6, 1e-10), (1e-7, 1e-9), (1e-8, 1e-9))
_AT_REST = "paper/fig05"
RUNS, SEED = 100, 2020
SPREAD = 1e-15  # rad
_SAMPLES_PER_SECOND = 100
_TIMEOUT_S = 600.0  # a run that ends by its own doing is never cut off: the table does not depend on the machine

# From (what was done, sweeps done, sweeps in all).
OnSweep = Callable[[str, int, int], None]


def claims(*, runs: int | None = None, seed: int = SEED, workers: int = 0) -> ClaimStudy:
    """The paper's claims in words as shares of many runs, and its numbers under other conditions.

    Parameters
    ----------
    runs
        Computes the shares anew, from so many starts moved by up to 1e-15 rad; None: as shipped.
    seed
        Of the moved starts; the same seed gives the same shares.
    workers
        Parallel processes; 0 runs everything in this process.

    Raises
    ------
    StoreError
        Where nothing is shipped.

    Examples
    --------
    >>> import rotor_mbs as rm
    >>> study = rm.claims()
    >>> study.shares.verdict("fig11-pitches-grow", "printed/ode45")
    'holds'
    >>> study.numbers.durations_of_all("multiplied_in")   # s, for which all four published numbers come out
    [12.0]
    """
    if runs is None:
        found = claim_records.stored_claims()
        if found is None:
            raise StoreError(f"{claim_records.shipped_claims()}: no such file; `rotor-mbs claims` makes one")
        return found
    with tempfile.TemporaryDirectory(prefix="rotor_mbs-") as folder:
        return study_claims(Path(folder) / "claims.h5", runs=runs, seed=seed, workers=workers)


def study_claims(
    output: Path, *, runs: int = RUNS, seed: int = SEED, workers: int = 1, on_sweep: OnSweep = lambda *_: None
) -> ClaimStudy:
    """The shares of all claims and the trials of all numbers, as records into the results file `output`.

    Interrupted, the same call continues: sweeps are kept in a folder beside `output` until all are done. Raises
    InputError and StoreError as `claim_shares`, and where `output` is a sweep's, or another process is writing it.
    """
    folder = output.with_name(f"{output.name}.sweeps")
    with writing(output) as parts:
        refuse_other_kinds(output)
        shares = claim_shares(folder, runs=runs, seed=seed, workers=workers, on_sweep=on_sweep)
        study = ClaimStudy(shares, number_trials(workers=workers))
        records = claim_records.records_of(study, seed, versions())
        part = parts / f"{records[0].key}.h5"
        write_records(part, records)
        ResultsStore(output).merge([part])
        part.unlink()
    for file in folder.glob("*-*s.h5"):
        file.unlink()
    with suppress(OSError):  # what is not of this study stays
        folder.rmdir()
    return study


def claim_shares(
    folder: Path,
    *,
    items: Sequence[Published] | None = None,
    durations: Sequence[float] = DURATIONS,
    runs: int = RUNS,
    seed: int = SEED,
    workers: int = 1,
    on_sweep: OnSweep = lambda *_: None,
) -> ClaimShares:
    """Every claim in words by the printed equations and by the corrected closed form.

    folder      where the sweeps are kept; an interrupted study continues there
    items       some claims, by default all; what is not a claim in words is left out
    durations   s, of all runs
    runs        from moved starts; with fewer, they are the first of them. One more is from the start as given
    seed        of the moved starts: the same seed gives the same table
    workers     parallel processes; 0 for none

    Raises InputError, StoreError where the folder has a sweep of other numbers, or cannot be written.
    """
    wanted = [item for item in (published() if items is None else items) if not item.is_number]
    asked = dict.fromkeys(number for item in wanted for number in item.numbers)
    scenes = find_scenes(sorted({number.scene for number in asked}))
    shares: list[ClaimShare] = []
    done, total = 0, len(scenes) * len(durations)
    folder.mkdir(parents=True, exist_ok=True)
    with open_task_pool("local", workers) as pool:
        for duration in durations:
            read: dict[str, list[dict[TrajectoryNumber, float | None]]]
            read = {method: [{} for _ in range(runs + 1)] for method in METHODS}
            for scene in scenes:
                plan = plan_sweep(moved_starts(scene, duration, runs, seed), time_limit_s=_TIMEOUT_S)
                file = folder / f"{scene.name.replace('/', '-')}-{duration:g}s.h5"
                result = run_sweep(plan, file, pool)
                own = [number for number in asked if number.scene == scene.name]
                stored = StoredSweep(file)
                columns = [stored.column(name) for name in ("angles", "rates", "status", "energy_drift_max")]
                for i, method in enumerate(METHODS):
                    rows = slice(i * (runs + 1), (i + 1) * (runs + 1))
                    found = SampledRuns(stored.column("time"), *(column[rows] for column in columns))
                    for values, more in zip(read[method], found.values(own), strict=True):
                        values |= more
                done += 1
                on_sweep(f"{scene.name} {duration:g} s: {result.made} runs made", done, total)
            for item in wanted:
                shares += [ClaimShare(item.id, name, duration, marks(item, values)) for name, values in read.items()]
    return ClaimShares(tuple(shares), SPREAD, runs)


def moved_starts(scene: Scene, duration: float, runs: int, seed: int) -> Sweep:
    """The scene over `duration` (s) from its own start, then from `runs` starts with every angle moved by chance.

    The first k of them do not depend on `runs`.
    """
    axes: dict[str, object] = {}
    for i, angle in enumerate(scene.initial_angles):
        moves = np.random.default_rng([seed, i]).uniform(-SPREAD, SPREAD, runs)
        axes[f"initial.angles[{i}]"] = [angle, *(angle + moves).tolist()]
    base = scene.replace(duration=duration, samples=round(_SAMPLES_PER_SECOND * duration) + 1)
    return sweep_of(base, axes, combine="zip", methods=list(METHODS), outputs=["angles", "rates"])


def number_trials(
    rows: Sequence[str] = tuple(GRAVITY_ROWS),
    durations: Sequence[float] = TRIED_DURATIONS,
    tolerances: Sequence[tuple[float, float]] = TOLERANCES,
    *,
    workers: int = 0,
) -> NumberTrials:
    """All published numbers for every row and duration, and for every pair of tolerances with the usual ones.

    rows         ways of writing the first row of (56), names of `gravity_rows.GRAVITY_ROWS`
    durations    s, of all runs
    tolerances   (relative, absolute) of ode45, tried for the usual row and the duration of Fig. 5
    workers      parallel processes; 0 for none
    """
    items = [item for item in published() if item.of is not None]
    scenes = {scene.name: scene for scene in find_scenes(sorted({name for item in items for name in item.scenes}))}
    defaults = find_method(PRINTED).defaults
    usual = Conditions(
        DEFAULT_ROW,
        scenes[_AT_REST].duration,
        float(str(defaults["relative_tolerance"])),
        float(str(defaults["absolute_tolerance"])),
    )
    tried = [replace(usual, gravity_row=row, duration=duration) for row in rows for duration in durations]
    tried += [replace(usual, relative_tolerance=pair[0], absolute_tolerance=pair[1]) for pair in tolerances]
    read: dict[tuple[Conditions, str], float] = {}
    with local_pool(workers) as pool:
        tasks = [(scene, one) for one in dict.fromkeys(tried) for scene in scenes.values()]
        for end in run_in(pool, numbers_of_run, tasks, _TIMEOUT_S):
            if end.value is None:
                raise end.error or RotorError(f"{end.task[0].name}: {end.message}")
            read |= {(end.task[1], number): value for number, value in end.value.items()}
    remainders = {row: _remainder(scenes[_AT_REST], row) for row in rows}
    trials = [
        NumberTrial(item.id, one, value, rounds_to(value, item.value, item.decimals), remainders[one.gravity_row])
        for one in dict.fromkeys(tried)
        for item in items
        for value in [read[one, item.id]]
    ]
    return NumberTrials(tuple(trials), usual, tuple(rows))


def numbers_of_run(task: tuple[Scene, Conditions]) -> dict[str, float]:
    """By its id, every published number that is read off a scene; NaN, which has no printed digits, where it is not."""
    scene, settings = task[0], asdict(task[1])
    run = solve(PRINTED, replace(scene, duration=settings.pop("duration")), settings).trajectory
    found = {item.id: item.of and measure(run, item.of) for item in published() if scene.name in item.scenes}
    return {number: math.nan if value is None else value for number, value in found.items()}


def _remainder(scene: Scene, row: str) -> float:
    """N m, of the row at the start of the scene."""
    mass, (c, _, d) = scene.blades[0].mass, scene.blades[0].centre_of_mass
    cosines = [math.cos(angle) for angle in scene.initial_angles[1:]]
    return GRAVITY_ROWS[row].moment(mass, c, d, scene.gravity, scene.initial_angles[0], *cosines)
