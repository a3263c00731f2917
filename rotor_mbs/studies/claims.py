"""The paper's claims in words tested on many runs, from starts moved by rounding: sweeps in, a table of shares out."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np

from rotor_mbs.analysis.claim_records import ClaimStudy, records_of, shipped_claims, stored_claims
from rotor_mbs.analysis.claim_shares import ClaimShare, ClaimShares, MeasuredRuns, SampledRuns, numbers_in
from rotor_mbs.analysis.published import Published, published
from rotor_mbs.analysis.run_selection import PRINTED
from rotor_mbs.errors import StoreError
from rotor_mbs.execution.dask_cluster import open_task_pool
from rotor_mbs.execution.pool import SerialPool
from rotor_mbs.execution.provenance import versions
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.sweep import Sweep, sweep_of
from rotor_mbs.store.records import write_records
from rotor_mbs.store.sweep_dataset import StoredSweep
from rotor_mbs.studies.number_trials import number_trials
from rotor_mbs.studies.sweep import run_sweep

METHODS = (PRINTED, "lagrange/taylor")
DURATIONS = (8.0, 10.0, 12.0)  # s
RUNS, SEED = 100, 2020
SPREAD = 1e-15  # rad
_SAMPLES_PER_SECOND = 100
_TIMEOUT_S = 600.0  # a run that ends by its own doing is never cut off: the table does not depend on the machine

# From (sweeps done, sweeps in all, what was done).
OnSweep = Callable[[int, int, str], None]


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
        found = stored_claims()
        if found is None:
            raise StoreError(f"{shipped_claims()}: no such file; `rotor-mbs claims` makes one")
        return found
    with tempfile.TemporaryDirectory(prefix="rotor_mbs-") as folder:
        return study_claims(Path(folder) / "claims.h5", runs=runs, seed=seed, workers=workers)


def study_claims(
    output: Path, *, runs: int = RUNS, seed: int = SEED, workers: int = 1, on_sweep: OnSweep = lambda *_: None
) -> ClaimStudy:
    """The shares of all claims and the trials of all numbers, as records into the new results file `output`.

    Interrupted, the same call continues: sweeps are kept in a folder beside `output` until all are done.

    Raises
    ------
    InputError, StoreError
        As `claim_shares`, and where `output` cannot be written.
    """
    folder = output.with_name(f"{output.name}.sweeps")
    shares = claim_shares(folder, runs=runs, seed=seed, workers=workers, on_sweep=on_sweep)
    study = ClaimStudy(shares, number_trials(workers=workers))
    write_records(output, records_of(study, seed, versions()))
    shutil.rmtree(folder)
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

    Parameters
    ----------
    folder
        Where the sweeps are kept; an interrupted study continues there.
    items
        Some claims, by default all; what is not a claim in words is left out.
    durations
        s, of all runs.
    runs
        From moved starts; with fewer, they are the first of them. One more is from the start as given.
    seed
        Of the moved starts: the same seed gives the same table.
    workers
        Parallel processes; 0 for none.

    Raises
    ------
    InputError, StoreError
        Where the folder has a sweep of other numbers, or cannot be written.
    """
    wanted = [item for item in (published() if items is None else items) if not item.is_number]
    asked = numbers_in(wanted)
    scenes = find_scenes(sorted({number.scene for number in asked}))
    shares: list[ClaimShare] = []
    done, total = 0, len(scenes) * len(durations)
    folder.mkdir(parents=True, exist_ok=True)
    with closing(open_task_pool("local", workers) if workers else SerialPool()) as pool:
        for duration in durations:
            measured = {method: MeasuredRuns() for method in METHODS}
            for scene in scenes:
                sweep = moved_starts(scene, duration, runs, seed)
                file = folder / f"{scene.name.replace('/', '-')}-{duration:g}s.h5"
                result = run_sweep(sweep, file, engine=pool, timeout_s=_TIMEOUT_S)
                for method, found in _by_method(StoredSweep(file), runs + 1):
                    measured[method].add(scene.name, found, asked)
                done += 1
                on_sweep(done, total, f"{scene.name} {duration:g} s: {result.made} runs made")
            for item in wanted:
                shares += [ClaimShare(item.id, name, duration, found.marks(item)) for name, found in measured.items()]
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


def _by_method(sweep: StoredSweep, rows: int) -> Iterator[tuple[str, SampledRuns]]:
    columns = {name: sweep.column(name) for name in ("angles", "rates", "status", "energy_drift_max")}
    for number, method in enumerate(METHODS):
        runs = slice(number * rows, (number + 1) * rows)
        yield method, SampledRuns(sweep.column("time"), *(values[runs] for values in columns.values()))
