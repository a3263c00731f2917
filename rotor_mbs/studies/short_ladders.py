"""Error against run time at a few settings of each method, beside other runs: curves of seconds, not of minutes.

A bench takes one process on one core and rounds over all points; here each curve is a job of the pool, and a point is
run once. Its errors are those of a bench, its times are good to a factor.
"""

from __future__ import annotations

import os

from rotor_mbs.errors import RotorError
from rotor_mbs.execution.case import Case
from rotor_mbs.execution.execute import Job, Result
from rotor_mbs.execution.pool import OF_THE_MACHINE, one_line
from rotor_mbs.methods.catalogue import ladders
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.studies.bench import BENCH, SOURCES, Measured, curve_record, facts_of, points_of, store_curve
from rotor_mbs.studies.bench_worker import PointTimer, prepared_scene
from rotor_mbs.studies.run import able_methods, reference_case

_SOURCES = (*SOURCES, "studies/short_ladders.py")
_LONGEST_S = 0.4  # a run longer than this is the last of its curve


def ladder_cases(scene: Scene) -> list[Case]:
    """A short curve of each method on `scene`, judged by its reference."""
    chosen = [ladder.short for ladder in ladders() if not ladder.variant]
    able, _ = able_methods(scene, [ladder.method for ladder in chosen])
    reference = reference_case(scene).key
    return [
        Case(scene, one.method, {}, BENCH, {"curve": one.curve, "values": list(one.values)}, reference, _SOURCES)
        for one in chosen
        if one.method in able
    ]


def perform_ladder(job: Job) -> Result:
    """Runs, judges and stores one curve, in a worker process."""
    assert job.reference is not None  # every case of a ladder has a reference
    case = job.case
    short, reference = prepared_scene(case.scene, job.reference)
    ladder = next(one.short for one in ladders() if one.curve == case.options["curve"])
    points = points_of(ladder, short.duration / (short.samples - 1))
    timer = PointTimer(dict.fromkeys(points, (short, reference)))
    found, longest = Measured(), 0.0
    for point in points:
        if longest > _LONGEST_S:
            found.timings.left_out[point] = f"not run: the setting before took {longest:.2g} s"
            continue
        try:
            prepared = timer.prepare(point)
            found.prepared[point], found.timings.times[point] = prepared, [prepared.run_s]
            found.judged[point] = timer.judge(point)
            longest = prepared.run_s
        except OF_THE_MACHINE:
            raise
        except RotorError as exc:
            found.fail(point, str(exc))
        except Exception as exc:
            found.fail(point, one_line(exc))
    shared = facts_of(case, short, reference) | {
        "budget_s": _LONGEST_S, "load_before": os.getloadavg()[0], "pinned_core": -1, "is_short": True,
    }  # fmt: skip
    return store_curve(job, curve_record(case, ladder, found.rows(points), shared))
