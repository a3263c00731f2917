"""A report of synthetic runs of the paper's scenes, made once for all tests of this folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.scenes import paper
from support.stored import Made, rotor, store

from rotor_mbs.report.build import write_report

FIG11, FIG05, FIG12, FIG14A = (
    paper(name, samples=301) for name in ("fig11", "fig05", "fig12", "fig14a")
)
PRINTED, REFERENCE, TAYLOR, TREE = (
    "printed/ode45",
    "reference",
    "lagrange/taylor",
    "exudyn_tree/rk67",
)
RIGHT = rotor(lambda t: 0.5 + 0.31 * t, np.sin, np.cos, np.sin)
# Its crest is the published number, 2.7315 rad.
WRONG = rotor(
    lambda t: 2.7315 * np.sin(0.3 * t + 0.185), lambda t: np.sin(t) - 0.02 * t**2, np.cos, np.sin
)


def paper_runs() -> list[Made]:
    """Of Fig. 11 all models; of Fig. 5 two of three published numbers; of Fig. 12 a run that fails;
    Fig. 14."""
    failed = {"status": "solver_failed", "message": "the step became <too> small"}
    return [
        Made(FIG11, REFERENCE, RIGHT),
        Made(FIG11, PRINTED, WRONG, gain=1e6),
        Made(FIG11, TAYLOR, lambda t: RIGHT(t) + 1e-12 * t[:, None]),
        Made(FIG11, TREE, lambda t: RIGHT(t) + 1e-9, attributes={"status": "inaccurate"}),
        Made(FIG05, REFERENCE, rotor(lambda t: 0.52 + 0.0 * t)),
        Made(FIG05, PRINTED, rotor(lambda t: 0.52 + 0.0073 * np.sin(2.0 * t))),
        Made(FIG12, REFERENCE, RIGHT),
        Made(FIG12, PRINTED, RIGHT, gain=1e12, until=0.4, attributes=failed),
        Made(FIG12, TREE, RIGHT, until=0.0, attributes={"status": "timed_out", "message": "60 s"}),
        Made(FIG14A, REFERENCE, RIGHT),
        Made(FIG14A, PRINTED, RIGHT),
    ]


@pytest.fixture(scope="session")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return store(tmp_path_factory.mktemp("report") / "r.h5", paper_runs())


@pytest.fixture(scope="session")
def report(results: Path) -> Path:
    """The folder of the report."""
    return write_report(results, results.parent / "out").parent
