"""Data with one mistake each, made by equations of its own: none is `ok`, no wrong cause is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.mistaken_data import ALL, MARKER, MISTAKES, compared, verdict_of

import rotor_mbs as rm

pytestmark = pytest.mark.usefixtures("files_read_here")

DOCUMENT = Path(__file__).parents[2] / "docs" / "mistakes-tried.md"
# Of which a search finds no cause: the mistake is refused, and that is all.
NOT_NAMED = {"e50", "i03", "i04", "i08", "x12"}


def judged(name: str, folder: Path) -> tuple[str, list[str]]:
    result = compared(name, folder)
    return verdict_of(name, result["status"], result["likely"]), result["likely"]


def expected_of(name: str) -> str:
    if name in NOT_NAMED:
        return "none"
    return "small" if name == "i05" else "right"


@pytest.mark.parametrize("name", ["right_one", "e10", "x15", "i10"])
def test_a_cause_is_right(name: str, tmp_path: Path) -> None:
    """Exchanged moments of inertia, means of intervals and Heun's method are told apart."""
    assert judged(name, tmp_path)[0] == "right"


@pytest.mark.nightly
@pytest.mark.parametrize("name", list(ALL))
def test_every_cause_is_right(name: str, tmp_path: Path) -> None:
    verdict, causes = judged(name, tmp_path)
    assert verdict == expected_of(name), causes


def test_the_document_has_all_mistakes() -> None:
    rows = DOCUMENT.read_text(encoding="utf-8").partition(MARKER)[2].splitlines()
    judgements = {}
    for row in rows:
        cells = [cell.strip() for cell in row.strip("|").split(" | ")]
        if cells[0] in MISTAKES:
            judgements[cells[0]] = cells[-1]
    assert judgements == {name: expected_of(name) for name in MISTAKES}


@pytest.mark.full
def test_a_pitch_that_rests_is_no_mean() -> None:
    """Where nothing moves, a mean over an interval is the number itself, and shows nothing."""
    scene = rm.scene("paper/fig11").replace(
        duration=2.0,
        samples=201,
        gravity=0.0,
        **{
            "initial.angles": [0.0, 0.0, 0.0, 0.0],
            "initial.rates": [0.0, 0.0, 0.0, 0.0],
            "bearing.stiffness": 3000.0,
            "bearing.rest": [[1.2, 0.0], [1.2, 0.1]],
        },
    )
    run = rm.run(scene, "lagrange/dop853")
    # From the step of the command on, an error that no mean explains.
    later = np.maximum(run.time - 1.2, 0.0)[:, None]
    angles = run.angles + 1e-4 * later**2
    comparison = rm.compare({"time": run.time, "angles": angles, "rates": run.rates}, scene)
    assert comparison.status == "inaccurate"
    assert not any("mean" in cause for cause in comparison.likely), comparison.likely
