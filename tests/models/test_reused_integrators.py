"""Compiled code and shipped references are used again within a process."""

from __future__ import annotations

import numpy as np
import pytest
from support.scenes import paper

from rotor_mbs.models.lagrange.heyoka_adapter import is_available
from rotor_mbs.studies import stored_references
from rotor_mbs.studies.run import solve_judged
from rotor_mbs.studies.stored_references import frozen_solution


@pytest.mark.skipif(not is_available(), reason="heyoka is not installed")
def test_an_integrator_is_used_again_when_its_owner_is_gone_and_not_before() -> None:
    from rotor_mbs.models.lagrange.taylor import Propagation

    scene = paper("fig08").replace(duration=1.0, samples=11)
    first, second = (Propagation(scene, tol=1e-14, compact_mode=False) for _ in range(2))
    assert first.integrator is not second.integrator
    first.integrate()
    states, integrator = first.states.copy(), first.integrator
    del first
    third = Propagation(scene, tol=1e-14, compact_mode=False)
    assert third.integrator is integrator
    third.integrate()
    assert np.array_equal(third.states, states)


def test_a_shipped_reference_is_read_once_and_cannot_be_changed() -> None:
    reference = frozen_solution(paper("fig08"))
    assert reference is not None
    assert frozen_solution(paper("fig08")) is reference
    with pytest.raises(ValueError, match="read-only"):
        reference.trajectory.angles[0] = 0.0


def test_an_error_of_this_code_is_not_called_damage_of_the_file(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def wrong(*_: object) -> None:
        raise TypeError("a mistake")

    monkeypatch.setattr(stored_references, "rebuilt_reference", wrong)
    with pytest.raises(TypeError, match="a mistake"):
        # Of another title, which no other test has read.
        frozen_solution(paper("fig08", title="Not read before"))


@pytest.mark.skipif(not is_available(), reason="heyoka is not installed")
def test_a_run_in_this_process_integrates_once() -> None:
    run, _ = solve_judged(paper("fig08").replace(duration=1.0, samples=11), "lagrange/taylor")
    assert len(run.run_times_s) == 1
