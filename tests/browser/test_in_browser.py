"""Every page of a report in a headless Chromium: no error, no request, no sideways scrolling,
axe-core content.

Run with -m browser. Needs Chromium, and npm for axe-core. The report is a small one made here, or
the folder that the environment variable ROTOR_MBS_REPORT names.
"""

from __future__ import annotations

import base64
import json
import math
import os
import re
import shutil
import subprocess
import tarfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.checking import results_file
from support.devtools import PROGRAM, Page
from support.scenes import paper
from support.stored import Made, rotor, store
from support.sweeps import made_sweep

from rotor_mbs.api.comparisons import compare
from rotor_mbs.report.build import write_report
from rotor_mbs.report.files import write_page
from rotor_mbs.report.pages.modes import modes_page
from rotor_mbs.studies.modes import compute_modes

pytestmark = [pytest.mark.browser, pytest.mark.skipif(not PROGRAM, reason="no Chromium here")]
SIZES = (390, 1024, 1440)
SWING = rotor(lambda t: 0.5 + 0.2 * t, lambda t: np.sin(3.0 * t), np.cos, np.sin)
AXE_RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "best-practice"]
GRID = """title = "Speed & stiffness"
scene = "paper/fig06"
samples = 51
outputs = ["angles", "rates"]
[change]
"initial.angles[1]" = 1e-6
duration = 2
[[axis]]
key = "bearing.stiffness"
values = [0, 500, 40000]
[[axis]]
key = "initial.rates[0]"
values = [0.25, 5, 20, 30]
"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page of every kind."""
    if "ROTOR_MBS_REPORT" in os.environ:
        return Path(os.environ["ROTOR_MBS_REPORT"])
    folder = tmp_path_factory.mktemp("report")
    runs = []
    for name in ("fig11", "fig14c", "fig03"):
        scene = paper(name, samples=201)
        curve = (
            SWING if len(scene.blades) == 3 else lambda t: np.stack([np.sin(t), 0.1 * t], axis=1)
        )
        runs += [Made(scene, "reference", curve), Made(scene, "exudyn_tree/rk67", curve)]
        runs.append(
            Made(scene, "printed/ode45", lambda t, c=curve: 1.1 * c(t), until=0.7, gain=1e6)
        )
    results = store(folder / "r.h5", runs)
    out = write_report(results, folder / "out").parent
    own = results_file(folder / "own.h5", ["turbine/pitch-step"], ["lagrange/dop853"])
    suite = results_file(
        folder / "suite.h5", ["stiff/bearing-1e6", "extreme/toy"], ["lagrange/dop853"]
    )
    others = {
        "own": write_report(own, folder / "own"),
        "sweep": write_report(made_sweep(folder, GRID), folder / "sweep"),
        "modes": write_page(
            folder / "modes", modes_page([compute_modes(paper("fig11"), [0.0, 2.0, 3.0])]), {}
        ),
        "suite": write_report(suite, folder / "suite"),
        "comparison": compare(
            {"time": np.linspace(0.0, 10.0, 201), "angles": SWING(np.linspace(0.0, 10.0, 201))},
            "paper/fig11",
        ).to_html(folder / "comparison"),
    }
    for name, index in others.items():
        shutil.copy(index, out / f"{name}.html")
    return out


@pytest.fixture(scope="module")
def pages(report: Path) -> list[Path]:
    return sorted(report.glob("*.html"))


@pytest.fixture(scope="module")
def axe(tmp_path_factory: pytest.TempPathFactory) -> str:
    """axe-core's text, as npm has it."""
    if not shutil.which("npm"):
        pytest.skip("no npm to get axe-core with")
    folder = tmp_path_factory.mktemp("axe")
    done = subprocess.run(
        ["npm", "pack", "axe-core@4"], cwd=folder, capture_output=True, text=True, check=False
    )
    if done.returncode:
        pytest.skip(f"npm could not get axe-core: {done.stderr.strip()[-200:]}")
    with tarfile.open(next(folder.glob("axe-core-*.tgz"))) as packed:
        member = packed.extractfile("package/axe.min.js")
        assert member is not None
        return member.read().decode()


@pytest.mark.parametrize("width", SIZES)
def test_no_error_no_request_no_sideways_scrolling(
    page: Page, pages: list[Path], width: int
) -> None:
    for path in pages:
        page.open(path, width)
        assert page.faults == [], path.name
        assert page.run("document.documentElement.scrollWidth") <= width, path.name


def test_pages_can_be_mailed(pages: list[Path]) -> None:
    for path in pages:
        assert path.stat().st_size <= 1_000_000, path.name


@pytest.mark.parametrize("width", SIZES)
def test_every_plot_is_drawn_text_is_legible_and_tables_fit_their_cards(
    page: Page, pages: list[Path], width: int
) -> None:
    for path in pages:
        page.open(path, width)
        drawn = (
            "[...document.querySelectorAll('.plot')].map(p => [p.dataset.plot.slice(0, 60), "
            "p.querySelectorAll("
        )
        for name, count in page.run(f"{drawn}':scope > svg .curve').length])"):
            assert count > 0, (path.name, name)
        small = page.run(
            "[...document.querySelectorAll('body *')].filter(e => [...e.childNodes].some(n => "
            "n.nodeType === 3 &&n.textContent.trim()) && e.getClientRects().length && "
            "!e.closest('noscript, sub, script')).filter(e => {const svg = e.closest('svg'), box = "
            "svg && (svg.ownerSVGElement ?? svg);const view = box?.viewBox.baseVal, scale = view ? "
            "box.getBoundingClientRect().width / view.width : 1;return "
            "parseFloat(getComputedStyle(e).fontSize) * scale < 11.9; }).map(e => "
            "e.textContent.slice(0, 40))"
        )
        assert small == [], path.name
        wide = page.run(
            "[...document.querySelectorAll('.card .table')].filter(t => t.scrollWidth > "
            "t.clientWidth + 1).map(t => t.textContent.slice(0, 60))"
        )
        assert wide == [], path.name


def test_a_page_opens_with_its_answer(page: Page, pages: list[Path]) -> None:
    """The sentence is seen without scrolling, before facts, plots and tables."""
    for path in pages:
        page.open(path, 1440)
        top = page.run("document.querySelector('.answer')?.getBoundingClientRect().top ?? null")
        assert top is not None, path.name
        assert top < 300, path.name
        before = (
            "e => document.querySelector('.answer').compareDocumentPosition(e) & "
            "Node.DOCUMENT_POSITION_PRECEDING"
        )
        assert (
            page.run(
                f"[...document.querySelectorAll('.facts, .plot, table')].filter({before}).length"
            )
            == 0
        ), path.name


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", SIZES)
def test_axe_finds_nothing(
    page: Page, pages: list[Path], axe: str, width: int, scheme: str
) -> None:
    found = []
    for path in pages:
        page.open(path, width, scheme=scheme)
        page.run(f"{axe}; 0")
        options = {"runOnly": {"type": "tag", "values": AXE_RULES}, "resultTypes": ["violations"]}
        violations = page.run(
            f"axe.run({json.dumps(options)}).then(r => r.violations.map(v => [v.id, "
            "v.nodes.length, v.nodes[0].target.join(' '), v.nodes[0].failureSummary]))"
        )
        found += [(path.name, *violation) for violation in violations]
    assert found == []


def open_viewer(page: Page, report: Path, width: int = 1440) -> bytes:
    """A scene's page, with the viewer in sight and its keyboard; what is seen."""
    page.open(report / "paper-fig11.html", width)
    page.run(
        "document.querySelector('.viewer').scrollIntoView(); document.querySelector('.viewer "
        "canvas').focus()"
    )
    return settled(page)


def settled(page: Page) -> bytes:
    """What is seen a moment later."""
    time.sleep(0.3)
    return page.picture()


def part(name: str) -> str:
    """The script of a part of the viewer."""
    return f"document.querySelector('[data-part={name}]')"


def set_part(page: Page, name: str, value: object) -> None:
    page.run(f"{part(name)}.value = '{value}'; {part(name)}.dispatchEvent(new Event('input'))")


def test_the_viewer_moves_and_stops(page: Page, report: Path) -> None:
    still = open_viewer(page, report)
    assert settled(page) == still  # nothing moves before one asks
    page.run(f"{part('play')}.click()")
    moving = settled(page)
    assert moving != still
    page.run(f"{part('play')}.click()")
    stopped = settled(page)
    assert settled(page) == stopped != moving
    assert page.faults == []


def test_the_viewer_obeys_the_keyboard(page: Page, report: Path) -> None:
    seen = [open_viewer(page, report)]
    for key, number in (("ArrowLeft", 37), ("ArrowUp", 38), ("End", 35)):
        page.key(key, number=number)
        seen.append(settled(page))
    assert len(set(seen)) == len(seen)
    assert page.run(f"{part('clock')}.textContent") == "10.00 s"
    page.run("document.querySelector('.viewer details').open = true")
    page.key("Home", number=36)
    page.key(".", "Period", 190)
    settled(page)
    step = page.run("JSON.parse(document.querySelector('.viewer script').textContent).step")
    assert page.run(f"{part('clock')}.textContent") == f"{step:.2f} s"  # one frame
    reached = set()
    for _ in range(60):
        page.key("Tab", number=9)
        reached.add(
            page.run("document.activeElement.dataset.part || document.activeElement.tagName")
        )
    assert {"play", "time", "speed", "mode", "offset", "CANVAS", "BUTTON"} <= reached


_CURSORS = """[...document.querySelectorAll('.plot')].filter(p =>
  p.dataset.plot.includes('"x":{"name":"time"')).map(p => {
  const line = p.querySelector('.cursor path'), svg = p.querySelector(':scope > svg');
  const corners = svg.querySelector('.axis').getAttribute('d').match(/[\\d.]+/g).map(Number);
  const left = corners[0], right = corners[3];
  const at = line && Number(line.getAttribute('d').match(/[\\d.]+/)[0]);
  return line ? 10 * (at - left) / (right - left) : null; })"""


def test_plots_and_viewer_show_the_same_time(page: Page, report: Path) -> None:
    open_viewer(page, report)
    assert set(page.run(_CURSORS)) == {None}
    set_part(page, "time", 600)
    time.sleep(0.3)
    places = page.run(_CURSORS)
    assert len(places) > 4
    assert places == pytest.approx([6.0] * len(places), abs=0.05)  # of 10 s; a pixel is 0.02 s
    # and back: a plot that is read moves the rotor.
    page.run("document.querySelector('.plot > svg').focus()")
    page.key("Home", number=36)
    for _ in range(4):
        page.key("ArrowRight", number=39)
    time.sleep(0.3)
    step = page.run("JSON.parse(document.querySelector('.viewer script').textContent).step")
    assert page.run(f"{part('clock')}.textContent") == f"{4 * step:.2f} s"


def test_a_map_shows_the_curves_of_its_cell(page: Page, report: Path) -> None:
    page.open(report / "sweep.html", 1440)
    drawn = "document.querySelector('.plot .curve').getAttribute('d')"
    said = "document.getElementById('picked').textContent"
    first = page.run(drawn), page.run(said)
    page.run("document.querySelector('.heat td[aria-selected=true]').focus()")
    page.key("ArrowDown", number=40)
    second = page.run(drawn), page.run(said)
    assert first[0] != second[0]
    assert first[1] != second[1]
    cell = page.run("document.activeElement.dataset.run")
    assert second[1].startswith(f"Run {cell}:")
    # Another quantity writes other numbers into the cells, of the same runs.
    numbers = "[...document.querySelectorAll('.heat td[data-run]')].map(c => c.textContent)"
    before = page.run(numbers)
    page.run(
        "(q => { q.selectedIndex = 1; q.dispatchEvent(new Event('change')); "
        "})(document.getElementById('quantity'))"
    )
    assert page.run(numbers) != before
    assert page.faults == []


_DRAWN = """(() => {{
  const lines = [], path = CanvasRenderingContext2D.prototype;
  const box = document.querySelector('.viewer'), canvas = box.querySelector('canvas');
  document.querySelector('[data-view=front]').click();
  const {{ moveTo, lineTo }} = path;
  path.moveTo = function (x, y) {{ lines.push([[x, y]]); moveTo.call(this, x, y); }};
  path.lineTo = function (x, y) {{ lines[lines.length - 1].push([x, y]); lineTo.call(this, x, y); }};
  const slider = document.querySelector('[data-part=time]');
  slider.value = {value};
  slider.dispatchEvent(new Event('input'));
  return new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => {{
    Object.assign(path, {{ moveTo, lineTo }});
    done([canvas.dataset.angles0.split(' ').map(Number), lines.filter(line => {chosen})]);
  }})));
}})()"""


def test_drawn_angles_are_those_of_the_data_and_fast_paths_are_round(
    page: Page, tmp_path: Path
) -> None:
    """A rotor at 4 rad/s for 300 s, which 361 frames and the shorter way round drew backwards.

    At 20 random times, to h² max|q̈| / 8 = 0.016 rad of straight lines between frames and their rounding to 1e-4 rad.
    """
    scene = replace(paper("fig11"), duration=300.0, samples=6001, name="fast")
    curve = rotor(lambda t: 4.0 * t, lambda t: 2.0 * np.sin(2.0 * t), np.cos, np.sin)
    time = np.linspace(0.0, scene.duration, scene.samples)
    angles = curve(time)
    path = store(tmp_path / "r.h5", [Made(scene, "reference", curve)])
    page.open(write_report(path, tmp_path / "out"), 1440)
    for share in np.random.default_rng(0).random(20):
        drawn, lines = page.run(_DRAWN.format(value=1000.0 * share, chosen="line.length === 2"))
        wanted = np.array([np.interp(share * time[-1], time, column) for column in angles.T])
        np.testing.assert_allclose(drawn, wanted, atol=0.016 + 0.5e-4)
        # A blade's axis, from the hub, as it stands in the picture: from above, clockwise in this
        # view.
        hub, axis = next(
            np.array(line) for line in lines if len(line) == 2 and math.dist(*line) > 50.0
        )
        turned = np.arctan2(axis[0] - hub[0], hub[1] - axis[1])
        # the blade that is drawn first is the farthest
        phases = [0.0, 2.0 * np.pi / 3.0, 4.0 * np.pi / 3.0]
        assert (
            min(
                abs(np.remainder(turned - wanted[0] - p + np.pi, 2 * np.pi) - np.pi) for p in phases
            )
            < 0.02
        )
    _, lines = page.run(_DRAWN.format(value=1000, chosen="line.length > 300"))
    trails = [np.array(line) for line in lines]
    assert trails
    for trail in trails:
        corners = np.diff(np.unwrap(np.arctan2(*(trail - hub).T[::-1])))
        assert np.abs(corners).max() < 0.1  # rad; a polygon of 63 corners a turn or more


@pytest.mark.parametrize("how", ["mouse", "touch"])
def test_the_view_turns_by_dragging(page: Page, report: Path, how: str) -> None:
    still = open_viewer(page, report, 390)
    x, y = page.run(
        "(() => { const b = document.querySelector('.viewer "
        "canvas').getBoundingClientRect();return [b.left + 150, b.top + 120]; })()"
    )
    if how == "mouse":
        for kind, way in (("Pressed", 0), ("Moved", 40), ("Moved", 90), ("Released", 90)):
            pressed = {"button": "left", "buttons": 1, "clickCount": 1}
            page.call("Input.dispatchMouseEvent", type=f"mouse{kind}", x=x + way, y=y, **pressed)
    else:
        page.call("Emulation.setTouchEmulationEnabled", enabled=True)
        for kind, points in (("Start", [x]), ("Move", [x + 40]), ("Move", [x + 90]), ("End", [])):
            touched = [{"x": at, "y": y} for at in points]
            page.call("Input.dispatchTouchEvent", type=f"touch{kind}", touchPoints=touched)
        page.call("Emulation.setTouchEmulationEnabled", enabled=False)
    assert settled(page) != still


def test_overlaid_and_magnified_pictures_differ(page: Page, report: Path) -> None:
    seen = [open_viewer(page, report)]
    for name, value in (("mode", "over"), ("offset", 5), ("time", 500)):
        set_part(page, name, value)
        seen.append(settled(page))
    assert len(set(seen)) == len(seen)
    assert page.run(f"{part('times')}.textContent") == "×5"


@pytest.mark.parametrize("name", ["paper-fig11", "own", "sweep", "modes", "comparison"])
def test_without_scripts_the_answer_the_tables_and_the_main_plots_are_there(
    page: Page, report: Path, name: str
) -> None:
    page.call("Emulation.setScriptExecutionDisabled", value=True)
    page.open(report / f"{name}.html", 390)
    page.call("Emulation.setScriptExecutionDisabled", value=False)
    assert page.run("document.querySelector('.answer').offsetHeight") > 20
    assert page.run("document.querySelector('table').offsetHeight") > 20
    assert page.run("document.querySelector('noscript').textContent.includes('JavaScript')")
    stills = page.run(
        "[...document.querySelectorAll('.still>svg')].filter(s => s.getBoundingClientRect().height "
        "> 100).length"
    )
    assert 1 <= stills <= 6
    empty = (
        "[...document.querySelectorAll('.card')].filter(c => c.offsetHeight > 0 && c.offsetHeight "
        "< 30).length"
    )
    assert page.run(empty) == 0
    assert page.run("document.documentElement.scrollWidth") <= 390
    assert page.run("document.querySelector('.viewer')?.offsetHeight ?? 0") == 0


def test_a_printed_page_has_few_sheets_and_no_heading_without_contents(
    page: Page, report: Path
) -> None:
    headings = (
        "[...document.querySelectorAll('section')].filter(s => s.offsetHeight).map(s => "
        "s.innerText.trim().split('\\n').length)"
    )
    for name, sheets in (("index.html", 5), ("own.html", 7), ("figures.html", 10)):
        page.open(report / name, 1440)
        page.call("Emulation.setEmulatedMedia", media="print")
        assert min(page.run(headings)) > 1, name
        page.call("Emulation.setEmulatedMedia", media="")
        printed = base64.b64decode(page.call("Page.printToPDF")["data"])
        assert len(re.findall(rb"/Type\s*/Page\b", printed)) <= sheets, name


def test_in_print_the_plots_stand_and_the_viewer_does_not(page: Page, report: Path) -> None:
    page.open(report / "paper-fig11.html", 1440)
    page.call("Emulation.setEmulatedMedia", media="print")
    viewer = page.run("document.querySelector('.viewer').offsetHeight")
    plots = page.run(
        "[...document.querySelectorAll('#motion > .grid2 .plot > svg')].map(s => "
        "s.getBoundingClientRect().height)"
    )
    nav = page.run("document.querySelector('nav').offsetHeight")
    page.call("Emulation.setEmulatedMedia", media="")
    assert (viewer, nav) == (0, 0)
    assert min(plots) > 50.0
