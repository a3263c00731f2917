"""The frozen references: sure of themselves, and what a computation today gives again."""

from __future__ import annotations

import numpy as np
import pytest
from support.scenes import PAPER, paper

from rotor_mbs.methods.solve import solve
from rotor_mbs.scenario.catalogue import reference_folder
from rotor_mbs.scenario.scene import scene_hash
from rotor_mbs.store.read import open_results

FROZEN = reference_folder() / "paper.h5"


def test_every_scene_of_the_paper_is_frozen_with_its_numbers() -> None:
    with open_results(FROZEN) as results:
        hashes = {name: scene.attributes["scene_hash"] for name, scene in results.scenes.items()}
    assert hashes == {f"paper/{name}": scene_hash(paper(name)) for name in PAPER}


@pytest.mark.parametrize("name", ["fig08", "fig09", "fig11", "fig12"])
def test_uncertainty_is_below_1e_20(name: str) -> None:
    with open_results(FROZEN) as results:
        reference = results.scenes[f"paper/{name}"].reference
        assert reference is not None
        assert reference.array("angle_uncertainty").max() <= 1e-20


@pytest.mark.parametrize("name", ["fig08", "fig11"])
def test_recomputed_is_frozen(name: str) -> None:
    """Quad precision leaves nothing to the machine in a double's digits: equal but for the last bit."""
    pytest.importorskip("heyoka")
    scene = paper(name)
    found = solve("reference", scene, {}).trajectory
    assert found.error_growth is not None
    with open_results(FROZEN) as results:
        reference = results.scenes[scene.name].reference
        assert reference is not None
        np.testing.assert_allclose(found.angles, reference.array("angles"), rtol=3e-16, atol=0)
        np.testing.assert_allclose(found.rates, reference.array("rates"), rtol=3e-16, atol=0)
        assert reference.array("angle_uncertainty").max() >= found.angle_uncertainty.max() * 0.1
        # The growth is in double precision and grows its own errors: a hundredth decides no horizon.
        np.testing.assert_allclose(found.error_growth, reference.array("error_growth"), rtol=1e-2)
