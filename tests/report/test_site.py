"""One site of any file: its navigation, the page of a sweep, formulas of the errata."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from markupsafe import escape
from support.scenes import paper
from support.stored import Made, rotor, store
from support.sweeps import made_sweep

from rotor_mbs.analysis.published import CheckedEntry, errata
from rotor_mbs.report.build import write_report
from rotor_mbs.report.core.elements import PageTable, Section
from rotor_mbs.report.core.files import render
from rotor_mbs.report.pages.errata import matrices
from rotor_mbs.report.pages.sweep import distribution, field_name
from rotor_mbs.scenario.accuracy_bounds import load_bounds
from rotor_mbs.studies.check import judge_file

FIG11 = paper("fig11", samples=101)
SWING = rotor(lambda t: 0.5 + 0.2 * t, lambda t: np.sin(t), np.cos, np.sin)


def test_every_page_has_the_same_navigation(tmp_path: Path) -> None:
    runs = [Made(FIG11, name, SWING) for name in ("reference", "printed/ode45", "lagrange/taylor")]
    folder = write_report(store(tmp_path / "r.h5", runs), tmp_path / "out").parent
    wanted = ["index.html", "figures.html", "errata.html"]
    for path in folder.glob("*.html"):
        nav = re.search(r'<nav class="site" aria-label="Report">(.*?)</nav>', path.read_text(encoding="utf-8"), re.S)
        assert nav is not None, path.name
        assert re.findall(r'href="([^"]*)"', nav[1]) == wanted
        here = re.findall(r'href="([^"]*)" aria-current="page"', nav[1])
        assert here == ([path.name] if path.name in wanted else [])


def test_the_page_of_the_check_has_every_verdict_that_fails_and_is_made_where_it_is_asked_for(tmp_path: Path) -> None:
    runs = [Made(FIG11, name, SWING) for name in ("reference", "lagrange/taylor")]
    results = store(tmp_path / "r.h5", runs)
    assert not (write_report(results, tmp_path / "out").parent / "check.html").exists()
    folder = write_report(results, tmp_path / "out", checked=True).parent
    text = (folder / "check.html").read_text(encoding="utf-8")
    failed = [one for one in judge_file(results, load_bounds()) if not one.passed]
    assert failed  # the motion is no solution: it does not start where the scene does
    assert f"{len(failed)} of " in text
    section = text[text.index('<section id="failures">') : text.index('<section id="all"')]
    assert section.count('class="bad"') == len(failed)
    assert {str(escape(one.hint)) for one in failed} == set(re.findall(r"fail</span><small>(.*?)</small>", section))
    assert 'href="check.html"' in (folder / "paper-fig11.html").read_text(encoding="utf-8")


def test_a_single_main_page_has_no_navigation_and_the_others_lead_to_it(tmp_path: Path) -> None:
    results = store(tmp_path / "r.h5", [Made(replace(FIG11, name="mine"), "lagrange/taylor", SWING)])
    folder = write_report(results, tmp_path / "out").parent
    assert "<nav" not in (folder / "index.html").read_text(encoding="utf-8")
    found = re.search(r'<nav class="site".*?</nav>', (folder / "mine.html").read_text(encoding="utf-8"))
    assert found is not None
    assert re.findall(r'href="([^"]*)"', found[0]) == ["index.html"]


def test_a_sweep_has_a_page_from_its_dataset_alone(tmp_path: Path) -> None:
    pytest.importorskip("heyoka")
    path = made_sweep(tmp_path)
    text = write_report(path, tmp_path / "out").read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
    assert "<h1>Speed &amp; stiffness</h1>" in text
    assert "12 runs of paper/fig06 by lagrange/taylor" in text
    assert ">initial rotor speed (rad/s)<" in text  # the axes, named as in the field
    assert ">bearing stiffness (N m/rad)<" in text
    assert re.search(r"The pitches grow 10-fold in \d+ of 12 runs", text)
    assert re.search(r'<th scope="row">ok</th><td class="n">12</td><td class="n">100.0 %</td>', text)
    assert text.count("<figure>") >= 3  # the map, and distributions
    assert "<script" not in text
    assert len(text.encode()) < 250_000


def test_keys_are_named_as_in_the_field() -> None:
    assert field_name("initial.angles[0]") == "initial rotor angle"
    assert field_name("initial.rates[2]") == "initial pitch rate of blade 2"
    assert field_name("bearing.stiffness") == "bearing stiffness"


def test_a_distribution_rises_from_none_to_all_runs() -> None:
    (axes,) = distribution(np.array([3.0, 1e-3, 10.0, np.nan, 0.1]), "error (rad)", logarithmic=True).axes
    x, y = axes.get_lines()[0].get_xydata().T
    assert x.tolist() == [1e-3, 0.1, 3.0, 10.0]
    assert (y[0], y[-1]) == (0.0, 100.0)
    assert axes.get_xscale() == "log"
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("error (rad)", "share of runs (%)")


def test_formulas_are_typeset() -> None:
    texts = ("c² m c3²", "what <is> this?")
    entries = [CheckedEntry("(8)", f"row 1 column {i + 1}", text, "", 0.0, True, "") for i, text in enumerate(texts)]
    ((_, (((formula, _), (text, _)),)),) = matrices(entries, ("(8)",))
    assert formula == (
        '<mrow><msup><mi>c</mi><mn>2</mn></msup><mspace width="0.2em"/><mi>m</mi><mspace width="0.2em"/>'
        "<msup><msub><mi>c</mi><mn>3</mn></msub><mn>2</mn></msup></mrow>"
    )
    assert text == "<mtext>what &lt;is&gt; this?</mtext>"


def test_the_faulty_entry_of_a_matrix_is_marked_and_corrected() -> None:
    entries = [
        CheckedEntry("(8)", "row 1 column 1", "-s2 c3", "-s2 c3", 0.0, True, ""),
        CheckedEntry("(8)", "row 1 column 2", "c c3", "0", 1.0, False, "E1"),
        CheckedEntry("(25)", "D(1,1)", "c", "d", 1.0, False, "E1"),
    ]
    found = matrices(entries, ("(8)", "(25)"))
    assert [equation for equation, _ in found] == ["(8)"]
    others = {"differing": Section(), "effects": Section(), "agreeing": PageTable("", (), ())}
    text = render("errata", {"errata": [(errata()[0], found)], **others})
    assert text.count("<mtd") == 2
    assert text.count('<mtd class="fault">') == 1
    fault = text[text.index('class="fault"') :]
    assert fault.index('class="printed"') < fault.index('class="right"')
    assert "<mn>0</mn>" in fault
