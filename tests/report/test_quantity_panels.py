"""A quantity that an installed package brings has a panel on the scene's page, by its declaration alone."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.checking import add_run, results_file
from support.scenes import paper
from support.stored import Made, rotor, store

from rotor_mbs.methods.solve import solve
from rotor_mbs.report.build import write_report
from rotor_mbs.report.core.numbers import prefixed, with_unit
from rotor_mbs.runs.read import open_results
from rotor_mbs.scenario.catalogue import find_scenes

PACKAGE = """
from rotor_mbs.solution.quantities import Plot, Quantity
BROUGHT = (
    Quantity("shaft_power", ("time",), "W", "power", output="report_test",
             producer=lambda scene, samples: 1e3 * samples.rates[:, 0], plot=Plot("Power at the shaft", "power (W)")),
    Quantity("pitch_speed", ("time", "blade"), "rad/s", "pitch speed", output="report_test",
             producer=lambda scene, samples: samples.rates[:, 1:], plot=Plot("Pitch speeds", "speed (rad/s)")),
    Quantity("spread", ("time", "blade"), "rad", "distance of the pitches", output="report_test",
             producer=lambda scene, samples: abs(samples.angles[:, 1:]),
             plot=Plot("Spread of the pitches", "spread (rad)", logarithmic=True)),
)
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An installed package with quantities for the output "report_test"."""
    (tmp_path / "report_test_quantities.py").write_text(PACKAGE)
    information = tmp_path / "report_test_quantities-1.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: report-test-quantities\nVersion: 1\n")
    (information / "entry_points.txt").write_text(
        "[rotor_mbs.quantities]\nreport_test = report_test_quantities:BROUGHT\n"
    )
    monkeypatch.syspath_prepend(tmp_path)


@pytest.mark.usefixtures("package")
def test_a_stored_quantity_of_another_package_is_drawn(tmp_path: Path) -> None:
    scene = paper("fig11", samples=101)
    outputs = ("angles", "rates", "report_test")
    text = f'outputs = ["angles", "rates", "report_test"]\n{re.sub(r"outputs = .*", "", scene.text)}'
    scene = replace(scene, outputs=outputs, text=text)
    runs = [Made(scene, name, rotor(np.sin, np.cos)) for name in ("lagrange/taylor", "exudyn_tree/rk67")]
    folder = write_report(store(tmp_path / "r.h5", runs), tmp_path / "out").parent
    page = (folder / "paper-fig11.html").read_text(encoding="utf-8")
    sections = dict(re.findall(r'<section id="quantity-(\w+)">(.*?)</section>', page, re.S))
    assert list(sections) == ["shaft_power", "pitch_speed", "spread"]
    assert "<h2>Power at the shaft</h2>" in sections["shaft_power"]
    assert sections["shaft_power"].count("<figure>") == sections["spread"].count("<figure>") == 1
    assert sections["pitch_speed"].count("<figure>") == 2  # one for each run
    assert "blade 3" in sections["pitch_speed"]
    assert "closed form, Taylor from" in sections["shaft_power"]


def test_loads_are_drawn_once_with_the_errors_of_the_others_and_their_extremes(tmp_path: Path) -> None:
    """Of the reference a picture per axis, one of the errors, and a table of the extremes with their times."""
    path = results_file(tmp_path / "r.h5", ["check/loads"], ["lagrange/dop853", "exudyn_tree/rk67"])
    folder = write_report(path, tmp_path / "out").parent
    page = (folder / "check-loads.html").read_text(encoding="utf-8")
    sections = dict(re.findall(r'<section id="quantity-(\w+)">(.*?)</section>', page, re.S))
    loads = ["blade_root_force", "blade_root_moment", "shaft_force", "shaft_moment", "pitch_actuator_moment"]
    assert [name for name in sections if name in loads] == loads
    counts = [sections[name].count("<figure>") for name in loads]
    assert counts == [4, 4, 2, 2, 2]
    with open_results(path) as results:
        reference = results.scenes["check/loads"].reference
        assert reference is not None
        largest = float(reference.array("blade_root_force")[:, 3, 0].max())
    row = re.search(r"blade 4 x.*?</tr>", sections["blade_root_force"], re.S)
    assert row is not None
    assert prefixed(largest, "N") in row[0]
    assert "Exudyn tree, RK67" in sections["shaft_moment"]
    regions = re.findall(r'role="region" aria-label="([^"]*)"', page)
    assert len(set(regions)) == len(regions) > len(loads)  # a screen reader lists them by their names


def test_the_uncertainty_of_an_extrapolated_run_is_drawn_and_told(tmp_path: Path) -> None:
    path, (scene,) = results_file(tmp_path / "r.h5", ["check/held"], []), find_scenes(["check/held"])
    settings = {"extrapolation": "richardson", "step": 5e-3}
    found = solve("exudyn_chain/newmark_index2", scene, settings)
    add_run(path, scene, found)
    page = (write_report(path, tmp_path / "out").parent / "check-held.html").read_text(encoding="utf-8")
    section = page[page.index('<section id="difference">') :]
    assert "Exudyn chain, Newmark index 2: its uncertainty" in section
    uncertainty = found.trajectory.angle_uncertainty.max()
    assert f"uncertain by {with_unit(float(uncertainty), 'rad')} up to the horizon" in section
