"""Which of a scene's runs is the printed model, which are right models, which stands for the right answer.

Knows the names of methods only; no numbers.
"""

from __future__ import annotations

from rotor_mbs.store.layout import REFERENCE
from rotor_mbs.store.read import StoredRun, StoredScene

PRINTED = "printed/ode45"
ALONE = {"E1": "printed_e1/ode45", "E2": "printed_e2/ode45", "E3": "printed_e3/ode45"}
RIGHT_MODELS = ("lagrange", "exudyn_tree", "exudyn_chain")


def model_of(method: str) -> str:
    """ "lagrange" of "lagrange/taylor"."""
    return method.partition("/")[0]


def has_samples(run: StoredRun) -> bool:
    """Whether the run left any samples: one that failed at the start did not."""
    return "time" in run and len(run.array("time")) > 0


def printed_run(scene: StoredScene) -> StoredRun | None:
    """The printed equations with all their errata, where there are samples of them."""
    run = scene.methods.get(PRINTED)
    return run if run is not None and has_samples(run) else None


def right_runs(scene: StoredScene) -> dict[str, StoredRun]:
    """Runs of the right models, closed form first; those without samples too."""
    found = {name: run for name, run in scene.methods.items() if model_of(name) in RIGHT_MODELS}
    return dict(sorted(found.items(), key=lambda item: (RIGHT_MODELS.index(model_of(item[0])), item[0])))


def right_run(scene: StoredScene) -> StoredRun | None:
    """What stands for the right answer: the reference, else the first right model that has samples."""
    candidates = [scene.reference, *right_runs(scene).values()]
    return next((run for run in candidates if run is not None and has_samples(run)), None)


def in_order(scene: StoredScene) -> dict[str, StoredRun]:
    """All runs as a reader wants them: printed, reference, right models, each erratum alone, others."""
    right = right_runs(scene)
    first = [PRINTED, REFERENCE, *right, *ALONE.values()]
    names = [name for name in first if name in scene.runs]
    return {name: scene.runs[name] for name in [*names, *(name for name in scene.runs if name not in names)]}
