"""Claims and the finding of files whose numbers are known because they were made so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.scenes import paper
from support.stored import Made, rotor, store

from rotor_mbs.analysis.published import (
    HOLDS,
    Published,
    claim_study,
    claims,
    finding,
    rounds_to,
)
from rotor_mbs.analysis.text_tables import method_table
from rotor_mbs.runs.read import open_results

FIG11 = paper("fig11", samples=101)
PRINTED, REFERENCE, TAYLOR = "printed/ode45", "reference", "lagrange/taylor"


def number(value: float, scene: str = "paper/fig11") -> Published:
    metric = "rotor_angle_max"
    return Published(
        "n",
        "11",
        "«»",
        scene=scene,
        metric=metric,
        value=value,
        decimals=4,
        scenes=frozenset({scene}),
    )


def claim(*scenes: str) -> Published:
    return Published("c", "11", "«»", statement="A claim.", scenes=frozenset(scenes))


@pytest.mark.parametrize(
    ("value", "reproduced"), [(2.73146, True), (2.73154, True), (2.73144, False), (2.7316, False)]
)
def test_numbers_compare_at_the_printed_digits(value: float, reproduced: bool) -> None:
    assert rounds_to(value, number(2.7315)) is reproduced


def test_a_number_that_the_printed_model_gives_and_the_right_one_does_not(tmp_path: Path) -> None:
    runs = [
        Made(FIG11, PRINTED, rotor(lambda t: 2.73148 * np.sin(np.pi * t / 10.0))),
        Made(FIG11, REFERENCE, rotor(lambda t: 0.367 * t)),
    ]
    with open_results(store(tmp_path / "r.h5", runs)) as results:
        found = claims(results.scenes, [number(2.7315)])
    assert (found[0].printed, found[0].corrected) == (pytest.approx(2.73148), pytest.approx(3.67))


def test_what_the_file_cannot_decide_is_left_out(tmp_path: Path) -> None:
    known, elsewhere = "paper/fig11", "paper/fig12"
    with open_results(
        store(tmp_path / "r.h5", [Made(FIG11, PRINTED, rotor(lambda t: 0.1 * t))])
    ) as results:
        assert (
            claims(
                results.scenes, [claim(elsewhere), claim(known, elsewhere), number(1.0, elsewhere)]
            )
            == []
        )
        words, one = claims(results.scenes, [claim(known), number(1.0)])
        unknown_metric = replace(number(1.0), metric="not there")
        assert claims(results.scenes, [unknown_metric]) == []
    assert (words.printed, one.printed, one.corrected) == (None, pytest.approx(1.0), None)
    right = [Made(FIG11, REFERENCE, rotor(lambda t: 0.2 * t))]
    with open_results(store(tmp_path / "right.h5", right)) as results:
        (one,) = claims(results.scenes, [number(1.0)])
    assert (one.printed, one.corrected) == (None, pytest.approx(2.0))


def test_the_reference_stands_for_right_and_without_it_the_closed_form(tmp_path: Path) -> None:
    right = [
        Made(FIG11, name, rotor(np.zeros_like))
        for name in ("exudyn_tree/rk67", TAYLOR, REFERENCE, PRINTED)
    ]
    with open_results(store(tmp_path / "a.h5", right)) as results:
        assert results.scenes["paper/fig11"].corrected.method == REFERENCE
        assert list(results.scenes["paper/fig11"].runs)[:2] == [REFERENCE, PRINTED]
    with open_results(store(tmp_path / "b.h5", right[:2])) as results:
        assert results.scenes["paper/fig11"].corrected.method == TAYLOR
        assert results.scenes["paper/fig11"].printed is None


def test_the_finding_counts_what_was_put_in(tmp_path: Path) -> None:
    fig12, fig08, fig09 = (paper(name, samples=101) for name in ("fig12", "fig08", "fig09"))
    still = rotor(np.zeros_like)
    off = rotor(lambda t: np.full_like(t, 1e-9))
    runs = [
        *(Made(scene, REFERENCE, still) for scene in (FIG11, fig12)),
        Made(FIG11, PRINTED, still, gain=3e5),
        Made(fig12, PRINTED, still, gain=9e9, until=0.5, attributes={"status": "solver_failed"}),
        Made(fig08, PRINTED, still, gain=8.0e3),  # a thousandth of the energy scale is 7.8 kJ
        Made(fig09, PRINTED, still, gain=7.6e3),
        Made(FIG11, TAYLOR, off),
        Made(
            fig12,
            TAYLOR,
            rotor(lambda t: np.full_like(t, 1.0)),
            attributes={"status": "inaccurate"},
        ),
    ]
    with open_results(store(tmp_path / "r.h5", runs)) as results:
        rows = finding(results.scenes, [])
        printed, corrected = method_table(
            run for scene in results.scenes.values() for run in scene.methods.values()
        ).rows
    # The run that broke off made more, but what a runaway reaches is no measure.
    assert [row[1:] for row in rows] == [("3 of 4", ""), ("0.3 MJ", "")]
    assert (printed[1], corrected[1]) == ("3 of 4 completed", "1 of 2 ok")
    assert corrected[3] == "1.0e-09"


def test_the_finding_counts_numbers_that_are_known_and_the_claims_of_the_study() -> None:
    item = number(1.0)
    evaluated = [
        replace(item, printed=1.0, corrected=2.0),
        replace(item, corrected=2.0),
        claim("paper/fig11"),
    ]
    study = claim_study()
    printed, corrected = (
        f"{study.count(method, HOLDS)} of {len(study.verdicts)}" for method in study.methods
    )
    assert finding({}, evaluated) == [
        ("Published numbers reproduced", "1 of 1", "0 of 2"),
        ("Published claims that hold", printed, corrected),
    ]
    assert finding({}, []) == []
