"""Which of a scene's runs are of the printed model, which of corrected models, which is the most accurate one."""

from __future__ import annotations

from collections.abc import Iterable

from rotor_mbs.methods.catalogue import REFERENCE, errata_methods, is_corrected, method_names
from rotor_mbs.runs.read import StoredRun, StoredScene

PRINTED = "printed/ode45"


def in_catalogue_order(names: Iterable[str]) -> list[str]:
    """The names as the catalogue has them; after them those that it does not know."""
    known = method_names()
    return sorted(names, key=lambda name: known.index(name) if name in known else len(known))


def has_samples(run: StoredRun) -> bool:
    """Whether the run left any samples: one that failed at the start did not."""
    return "time" in run and len(run.array("time")) > 0


def printed_run(scene: StoredScene) -> StoredRun | None:
    """The printed equations with all their errata, where there are samples of them."""
    run = scene.methods.get(PRINTED)
    return run if run is not None and has_samples(run) else None


def corrected_runs(scene: StoredScene) -> dict[str, StoredRun]:
    """Runs of the corrected models, in the order of the catalogue; those without samples too."""
    return {name: scene.methods[name] for name in in_catalogue_order(scene.methods) if is_corrected(name)}


def reference_or_corrected_run(scene: StoredScene) -> StoredRun | None:
    """The reference, else the first run of a corrected model that has samples; None without either."""
    candidates = [scene.reference, *corrected_runs(scene).values()]
    return next((run for run in candidates if run is not None and has_samples(run)), None)


def sides(scene: StoredScene) -> dict[str, StoredRun]:
    """The "printed" run and the one that stands for the "corrected" model, those that there are."""
    runs = {"printed": printed_run(scene), "corrected": reference_or_corrected_run(scene)}
    return {side: run for side, run in runs.items() if run is not None}


def in_order(scene: StoredScene) -> dict[str, StoredRun]:
    """All runs in the order of tables: printed, reference, corrected models, each erratum alone, others."""
    first = [PRINTED, REFERENCE, *corrected_runs(scene), *errata_methods().values()]
    names = [name for name in first if name in scene.runs]
    return {name: scene.runs[name] for name in [*names, *(name for name in scene.runs if name not in names)]}
