"""The package without heyoka, as on macOS and Windows; skipped where it is installed
(.ci/without-heyoka hides it)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.commands import refusal, rotor_mbs

import rotor_mbs as rm
from rotor_mbs.errors import InputError
from rotor_mbs.methods.catalogue import default_methods
from rotor_mbs.models.lagrange.heyoka_adapter import is_available

pytestmark = pytest.mark.skipif(is_available(), reason="heyoka is installed")

TAYLOR, DOP853 = "lagrange/taylor", "lagrange/dop853"


def short_scene() -> rm.Scene:
    return rm.scene("paper/fig11").replace(duration=0.5, samples=51)


def test_dop853_is_chosen_in_place_of_taylor() -> None:
    assert DOP853 in default_methods()
    assert TAYLOR not in default_methods()


def test_where_no_method_is_named_a_run_and_a_sweep_are_by_dop853(tmp_path: Path) -> None:
    assert rm.run(short_scene()).method == DOP853
    runs = rm.sweep(short_scene(), {"gravity": [9.7, 9.8]}, samples=3)
    assert [(run.method, run.status) for run in runs.values()] == [(DOP853, "ok")] * 2
    study = tmp_path / "study.toml"
    axis = '[[axis]]\nkey = "gravity"\nvalues = [9.8]\n'
    study.write_text(f'title = "x"\nscene = "paper/fig08"\nsamples = 3\n{axis}')
    planned = rotor_mbs("sweep", study, "--dry-run", "-o", tmp_path / "study.h5")
    assert planned.out.startswith(f"1 runs with {DOP853}:")


def test_a_run_and_a_computed_reference_are_ok() -> None:
    run = rm.run(short_scene(), DOP853, reference=True)
    assert run.status == "ok"
    # both by DOP853, the reference at a tolerance of 1e-14
    assert run.metrics["angle_error_max"] < 1e-9


def test_samples_that_are_no_motion_are_judged_and_end() -> None:
    """DOP853 would take steps without end from a rate of 1e200 rad/s."""
    run = rm.run(short_scene(), DOP853)
    rates = run.rates.copy()
    rates[3] = 1e200
    data = {"time": run.time, "angles": run.angles, "rates": rates}
    assert rm.compare(data, short_scene(), timeout=60.0).status == "inaccurate"


def test_what_is_refused_names_another_method_and_a_mistake_comes_first(tmp_path: Path) -> None:
    output = ("-o", str(tmp_path / "r.h5"))
    refused = refusal("run", "paper/fig08", "-m", TAYLOR, *output)
    assert "heyoka is not installed" in refused
    assert DOP853 in refused
    mistaken = refusal("run", "paper/fig08", "-m", TAYLOR, "--set", "tolerence=1", *output)
    assert "no setting 'tolerence', perhaps tolerance" in mistaken
    assert "heyoka" not in mistaken
    with pytest.raises(InputError, match="blades"):
        rm.run(short_scene().replace(blades=0), TAYLOR)


def test_modes_are_computed_but_for_floquet_multipliers() -> None:
    modes = rm.modes(short_scene(), speeds=[0.5, 1.0])
    assert modes.agrees
    assert modes.floquet is None
    assert any("no Floquet multipliers" in note for note in modes.notes)
    with pytest.raises(InputError, match="no Floquet multipliers: heyoka is not installed"):
        modes.plot.multipliers()
    frequencies = modes.rotation["lagrange"].damped_frequencies
    assert np.isfinite(frequencies).any()
