"""The sentences and facts at the top of pages against the numbers of their files, computed here
once more."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.checking import results_file
from support.report_pages import answer_of, facts_of, rows_of, section_of, text_of
from support.scenes import paper
from support.stored import Made, rotor, store

import rotor_mbs as rm
from rotor_mbs.analysis.modes import SceneModes
from rotor_mbs.api.comparisons import compare
from rotor_mbs.errors import InputError
from rotor_mbs.report.build import write_report
from rotor_mbs.report.elements import Grid, Plot
from rotor_mbs.report.files import write_page
from rotor_mbs.report.numbers import number
from rotor_mbs.report.pages import agreement_of_scenes, computations
from rotor_mbs.report.pages.comparison import comparison_page, error_panels, onset_of
from rotor_mbs.report.pages.modes import mode_answer, modes_page
from rotor_mbs.runs.read import Record, open_results
from rotor_mbs.scenario.scene import scene_toml
from rotor_mbs.studies.modes import compute_modes

TAYLOR, DOP853, TREE = "lagrange/taylor", "lagrange/dop853", "exudyn_tree/rk67"
MARK = r"([\d.]+(?:×10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?)"
DIGITS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def value(text: str) -> float:
    """The number that was written as 2.4×10⁻⁶, 96.0 or −3.2."""
    mantissa, _, power = text.replace("−", "-").partition("×10")
    return float(mantissa) * 10.0 ** int(power.translate(DIGITS) or 0)


def found(pattern: str, text: str) -> list[float]:
    match = re.search(pattern.replace("NUMBER", MARK), text)
    assert match is not None, (pattern, text)
    return [value(group) for group in match.groups()]


# A scene of the paper


def test_the_sentence_of_a_scene_of_the_paper_has_its_numbers(results: Path, report: Path) -> None:
    text = answer_of(text_of(report, "paper-fig11.html"))
    with open_results(results) as opened:
        scene = opened.scenes["paper/fig11"]
        printed, reference, taylor = (
            scene.runs[name] for name in ("printed/ode45", "reference", TAYLOR)
        )
        gap = np.abs(printed.array("angles") - reference.array("angles")).max(axis=1)
        left = printed.array("time")[np.flatnonzero(gap > 0.05)[0]]
        gain, scale = (printed.attributes[name] for name in ("energy_gain_J", "energy_scale_J"))
        error = taylor.attributes["angle_error_max"]
        of_tree = scene.runs[TREE].attributes["angle_error_max"]
    (within,) = found(r"agrees with the reference within NUMBER rad", text)
    assert error <= within <= 1.1 * error  # rounded up, two digits
    # What the inaccurate run means for the angles.
    (within,) = found(r"Its angles are within NUMBER rad of the reference", text)
    assert of_tree <= within <= 1.1 * of_tree
    (departs,) = found(r"by more than 0\.05 rad at NUMBER s", text)
    assert departs == pytest.approx(left, rel=0.01)
    megajoules, percent = found(r"create NUMBER MJ of energy, NUMBER % of what", text)
    assert megajoules * 1e6 == pytest.approx(gain, rel=5e-3)
    assert percent == pytest.approx(100.0 * gain / scale, rel=0.05)
    # The tree run is inaccurate: it stands first, in red, and is not counted among what agrees.
    assert text.startswith("Exudyn tree, RK67 is inaccurate")
    assert "Corrected, closed form, Taylor agrees with the reference within" in text
    facts = facts_of(text_of(report, "paper-fig11.html"))
    assert facts["Corrected model"] == "inaccurate | 1 of 2 methods ok, limit 0.01 rad"
    assert facts["Printed model leaves it after"].startswith(
        f"{number(left)} s | largest difference"
    )
    assert facts["Published crest"] == "2.7315 rad | as printed 2.7315, corrected 3.6000"


def test_a_bound_is_never_below_its_number(tmp_path: Path) -> None:
    """2.33e-6 is not within 2.3e-6."""
    scene = paper("fig11", samples=101)
    for error in (2.31e-6, 9.97e-6):
        runs = [
            Made(scene, "reference", rotor(lambda t: t)),
            Made(scene, "printed/ode45", rotor(lambda t: 2.0 * t)),
            Made(scene, TAYLOR, rotor(lambda t, e=error: t + e * t / 10.0)),
        ]
        folder = write_report(store(tmp_path / f"{error}.h5", runs), tmp_path / f"{error}").parent
        (within,) = found(r"within NUMBER rad", answer_of(text_of(folder)))
        assert error * (1.0 - 1e-9) <= within < 1.1 * error


def test_a_printed_run_that_creates_nothing_is_not_said_to(report: Path) -> None:
    text = answer_of(text_of(report, "paper-fig14a.html"))
    assert "stay within 0 rad of them." in text
    assert "energy" not in text


# The index


def test_the_index_says_what_was_found(results: Path, report: Path) -> None:
    text = answer_of(text_of(report, "index.html"))
    assert text.startswith(
        "The paper's printed equations contain three errors and create energy in 2 of 4 scenes."
    )
    with open_results(results) as opened:
        error = opened.scenes["paper/fig11"].runs[TAYLOR].attributes["angle_error_max"]
    (within,) = found(
        (
            r"Corrected, closed form, Taylor agrees with the reference within NUMBER rad in 1 "
            r"of 4 scenes"
        ),
        text,
    )
    assert error <= within < 2.0 * error
    assert (
        "Of four numbers that the paper publishes three come out of the printed equations and none"
    ) in text
    facts = facts_of(text_of(report, "index.html"))
    assert facts["Published numbers reproduced"].startswith(
        "3 of 4 | by the printed equations; three of them"
    )
    # fig12 broke off
    assert facts["Scenes in which energy is created"] == "2 of 4 | up to 1.0 MJ (fig11)"


def test_methods_are_counted_as_independent_by_their_models() -> None:
    assert computations([TAYLOR, TREE, "exudyn_chain/extrapolated"]) == (
        "three independent computations"
    )
    assert computations([TAYLOR, DOP853]) == "two methods of one model"


def test_methods_are_said_to_agree_in_the_scenes_in_which_all_of_them_ran(tmp_path: Path) -> None:
    """Two methods ran on fig11, one of them on fig05, and another one that nothing was compared
    with."""
    scenes = paper("fig11", samples=101), paper("fig05", samples=101)
    runs = [Made(scene, name, rotor(np.sin)) for scene in scenes for name in ("reference", TAYLOR)]
    runs.append(Made(scenes[0], TREE, rotor(np.sin)))
    path = store(tmp_path / "r.h5", runs)
    with open_results(path) as opened:
        methods, error, count = agreement_of_scenes(opened.scenes.values())
        assert (methods, error, count) == ([TAYLOR], 0.0, 2)
    text = text_of(write_report(path, tmp_path / "out").parent, "index.html")
    assert (
        "Corrected, closed form, Taylor agrees with the reference exactly in all 2 scenes."
        in answer_of(text)
    )
    assert "independent" not in answer_of(text)
    assert "1 method" in section_of(text, "scenes")


# A scene of one's own


def own(folder: Path, **changes: object) -> tuple[Path, Path]:
    """A rotor that turns and pitches in known ways: its file and the folder of its page."""
    scene = replace(paper("fig11"), name="mine", title="Mine", figures=(), samples=1001, **changes)  # type: ignore[arg-type]
    scene = replace(scene, text=scene_toml(scene))
    angles = rotor(lambda t: 3.0 * t, lambda t: 0.1 * np.sin(t), lambda t: 0.05 + 0.0 * t)
    path = store(folder / "r.h5", [Made(scene, "reference", angles), Made(scene, TAYLOR, angles)])
    return path, write_report(path, folder / "out").parent


def test_the_sentence_of_ones_own_scene_says_what_happened_before_how_it_was_checked(
    tmp_path: Path,
) -> None:
    _, folder = own(tmp_path)
    text = answer_of(text_of(folder))
    turns, seconds, speed = found(
        r"^The rotor turns NUMBER times in NUMBER s, at NUMBER rad/s\.", text
    )
    assert (turns, seconds, speed) == pytest.approx((30.0 / (2.0 * np.pi), 10.0, 3.0), rel=2e-3)
    assert facts_of(text_of(folder))["Rotor speed"] == "3.00 rad/s | 28.6 rev/min"
    low, high = re.search(r"Pitch stays between (\S+)° and (\S+)°", text).groups()  # type: ignore[union-attr]
    assert (value(low), value(high)) == pytest.approx((-np.degrees(0.1), np.degrees(0.1)), rel=2e-3)
    assert text.endswith("Closed form, Taylor agrees with the reference exactly.")


def test_a_rotor_that_does_not_turn_is_said_to_move_between_two_angles(tmp_path: Path) -> None:
    scene = replace(paper("fig11"), name="mine", figures=())
    scene = replace(scene, text=scene_toml(scene))
    path = store(tmp_path / "r.h5", [Made(scene, TAYLOR, rotor(lambda t: 0.5 * np.sin(t)))])
    text = answer_of(text_of(write_report(path, tmp_path / "out").parent))
    assert text.startswith(
        "In 10 s the rotor moves between −28.6° and 28.6°, at −0.500 to 0.500 rad/s."
    )


def test_a_rotor_at_rest_is_said_to_stay_where_it_is(tmp_path: Path) -> None:
    scene = replace(paper("fig11"), name="mine", figures=())
    scene = replace(scene, text=scene_toml(scene))
    path = store(tmp_path / "r.h5", [Made(scene, TAYLOR, rotor(lambda t: 0.5 + 0.0 * t))])
    text = answer_of(text_of(write_report(path, tmp_path / "out").parent))
    assert text.startswith("For 10 s the rotor stays at 28.6°, at ")


def test_the_largest_root_moment_is_that_of_the_file(tmp_path: Path) -> None:
    path = results_file(tmp_path / "r.h5", ["check/loads"], [DOP853])
    text = text_of(write_report(path, tmp_path / "out").parent)
    with open_results(path) as opened:
        run = opened.scenes["check/loads"].reference
        assert run is not None
        sizes = np.linalg.norm(run.array("blade_root_moment"), axis=2)
        sample, blade = np.unravel_index(sizes.argmax(), sizes.shape)
        time = run.array("time")[sample]
    moment, at = found(
        rf"largest blade root moment is NUMBER kN m, blade {blade + 1} at NUMBER s", answer_of(text)
    )
    assert (moment * 1e3, at) == pytest.approx((sizes.max(), time), rel=5e-3)
    # The table has what is quoted, among all magnitudes.
    row = rows_of(section_of(text, "extremes"))[f"Blade root moment, magnitude, blade {blade + 1}"]
    assert (row[0], value(row[3]) * 1e3) == ("kN m", pytest.approx(sizes.max(), rel=1e-3))
    assert float(row[4]) == pytest.approx(time, abs=0.0051)
    assert facts_of(text)["Largest root moment"].startswith(
        f"{number(sizes.max() / 1e3, 3)} kN m | blade {blade + 1}"
    )


def test_a_status_that_is_not_ok_stands_above_all(tmp_path: Path) -> None:
    scene = replace(paper("fig11", samples=101), name="mine", figures=())
    scene = replace(scene, text=scene_toml(scene))
    bad = {"status": "inaccurate", "message": "defect of 3e-2 rad, allowed 1e-6"}
    runs = [
        Made(scene, "reference", rotor(lambda t: t)),
        Made(scene, TAYLOR, rotor(lambda t: t)),
        Made(scene, TREE, rotor(lambda t: 1.1 * t), attributes=bad),
    ]
    text = text_of(write_report(store(tmp_path / "r.h5", runs), tmp_path / "out").parent)
    assert answer_of(text).startswith(
        "Exudyn tree, RK67 is inaccurate: defect of 0.03 rad, allowed 10⁻⁶. The rotor turns"
    )  # its error is too large to be called small
    (name, fact), *_ = facts_of(text).items()
    assert (name, fact) == ("Result", "inaccurate | 1 of 2 methods ok, limit 0.01 rad")
    assert '<dd class="bad">inaccurate' in text


def test_a_run_without_samples_is_said_to_have_none(tmp_path: Path) -> None:
    scene = replace(paper("fig11", samples=11), name="mine", figures=())
    failed = {"status": "solver_failed", "message": "no step was possible"}
    path = store(
        tmp_path / "r.h5", [Made(scene, TAYLOR, rotor(lambda t: t), until=0.0, attributes=failed)]
    )
    text = text_of(write_report(path, tmp_path / "out").parent)
    assert answer_of(text) == (
        "Closed form, Taylor: solver failed: no step was possible. No run of this scene has "
        "samples."
    )
    assert 'class="plot"' not in text


# Comparison


def test_a_comparison_names_the_onset_of_a_fault_and_crosses_only_what_differs(
    tmp_path: Path,
) -> None:
    """Of Fig. 3 the rotor is 0.02 rad off from 4 s on; the pitch is right."""
    scene = paper("fig03")
    (reference,) = [results_file(tmp_path / "r.h5", ["paper/fig03"], [])]
    with open_results(reference) as opened:
        run = opened.scenes["paper/fig03"].reference
        assert run is not None
        time, angles, rates = (run.array(name).copy() for name in ("time", "angles", "rates"))
    angles[time > 4.0, 0] += 0.02
    compared = compare({"time": time, "angles": angles, "rates": rates}, scene)
    onset = onset_of(compared.record, compared.verdict)
    assert onset is not None
    assert onset[0] == pytest.approx(4.0, abs=1e-9)  # the last row that is right
    text = text_of(compared.to_html(tmp_path / "out").parent)
    assert "The data differ from paper/fig03 from 4 s on" in answer_of(text)
    assert facts_of(text)["First outside the tolerance"].startswith("4 s")
    # 0.02 rad are seen beside a motion of half a radian: the data stand before their errors.
    assert text.index("Data and reference") < text.index("<h2>Errors")
    angles[time > 4.0, 0] -= 0.0199
    hidden = compare({"time": time, "angles": angles, "rates": rates}, scene)
    small = text_of(hidden.to_html(tmp_path / "small").parent)
    assert small.index("<h2>Errors") < small.index("Data and reference")
    rows = rows_of(section_of(text, "table"))
    assert rows["rotor"][1].startswith("✗")
    assert rows["pitch 1"][1].startswith("✓")
    checked = [name for name, cells in rows.items() if cells[1].startswith("✓")]
    assert f"within the tolerance: {', '.join(checked)}." in answer_of(text)


@pytest.mark.full
def test_what_stays_at_the_reference_is_not_crossed(tmp_path: Path) -> None:
    """Pitch 1 of Fig. 11 drifts away from 4 s on: the defects of all coordinates are large, their
    errors are not."""
    with open_results(results_file(tmp_path / "r.h5", ["paper/fig11"], [])) as opened:
        run = opened.scenes["paper/fig11"].reference
        assert run is not None
        data = {name: run.array(name).copy() for name in ("time", "angles", "rates")}
    late = data["time"] > 4.0
    data["angles"][late, 1] += 0.02 * (data["time"][late] - 4.0)
    compared = compare(data, paper("fig11"))
    assert all(
        channel.defect > compared.verdict.tolerance for channel in compared.verdict.channels[1:4]
    )
    text = text_of(compared.to_html(tmp_path / "out").parent)
    rows = rows_of(section_of(text, "table"))
    assert [name for name, cells in rows.items() if cells[1].startswith("✗")] == ["pitch 1"]
    # A defect that follows from another channel's error is not within the tolerance, either.
    assert "within the tolerance" not in answer_of(text)


def test_data_that_agree_are_said_to(tmp_path: Path) -> None:
    with open_results(results_file(tmp_path / "r.h5", ["paper/fig03"], [])) as opened:
        run = opened.scenes["paper/fig03"].reference
        assert run is not None
        data = {name: run.array(name) for name in ("time", "angles", "rates")}
    # What `compare` takes for right, digit by digit: without heyoka it is no stored reference.
    right = compare(data, paper("fig03")).record.arrays
    for name, channels in (
        ("angles", ("rotor", "pitch_1")),
        ("rates", ("rotor_rate", "pitch_1_rate")),
    ):
        data[name] = np.stack([right[f"{key}_reference"] for key in channels], axis=1)
    text = text_of(compare(data, paper("fig03")).to_html(tmp_path / "out").parent)
    assert answer_of(text).startswith("The data agree with paper/fig03")
    assert facts_of(text)["Verdict"] == "✓ agrees"
    assert "✗" not in text
    # Errors of zero have no curve on a logarithmic axis; there are no loads to speak of.
    assert "Error: 0 rad in all rows." in text
    assert "Loads" not in text
    plots = _plots(compare(data, paper("fig03")).record)
    assert "Error" not in [plot.name for plot in plots]
    for plot in plots:
        assert all(np.isfinite(curve.y).any() for curve in plot.curves)


def test_one_row_has_no_plot_and_no_error(tmp_path: Path) -> None:
    """Times in ms: only the first row, the initial state, lies within the scene."""
    with open_results(results_file(tmp_path / "r.h5", ["paper/fig03"], [])) as opened:
        run = opened.scenes["paper/fig03"].reference
        assert run is not None
        data = {name: run.array(name)[::200] for name in ("time", "angles", "rates")}
    compared = compare(data | {"time": 1e3 * data["time"]}, paper("fig03"))
    assert compared.verdict.rows == 1
    assert _plots(compared.record) == []
    text = text_of(compared.to_html(tmp_path / "out").parent)
    assert facts_of(text) == {"Verdict": "✗ inaccurate", "Compared up to": "0 s | 1 row"}


def test_data_far_from_the_reference_are_not_cut_off() -> None:
    """Frequencies ten times too large would not be seen in a range about the reference."""
    scene = rm.scene("stiff/nrel-5mw")
    speeds = [0.0, 1.0, 2.0]
    frequencies = 10.0 * compute_modes(scene, speeds).rotation["lagrange"].damped_frequencies
    compared = compare({"speed": speeds, "frequencies": frequencies}, scene)
    plots = _plots(compared.record)
    assert [plot.name for plot in plots if plot.clip is not None] == []
    assert {curve.key for plot in plots for curve in plot.curves} >= {"reference", "data"}


def _plots(record: Record) -> list[Plot]:
    """All plots of the page of a comparison."""
    plots = []
    for section in comparison_page(record).sections:
        grids = [element for element in section.elements if isinstance(element, Grid)]
        cards = [card for grid in grids for card in grid.cards]
        plots += [part for card in cards for part in card if isinstance(part, Plot)]
    return plots


def test_data_of_which_no_channel_was_compared_have_a_page_and_no_plot(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    time = np.linspace(0.0, 1.0, 11)
    data = {"time": time, "angles": np.zeros((11, 4))}
    compared = compare(data, paper("fig11").replace(duration=1.0, samples=11))
    verdict = replace(compared.verdict, channels=[])
    monkeypatch.setattr("rotor_mbs.report.pages.comparison.verdict_of", lambda _: verdict)
    assert [section.id for section in comparison_page(compared.record).sections if section.elements]
    with pytest.raises(InputError, match="no channel was compared"):
        error_panels(compared.record)


# Modes


def test_the_sentence_of_modes_has_their_frequencies_and_stability() -> None:
    modes = compute_modes(paper("fig11").replace(bearing={"stiffness": 1e4}), [0.0, 1.0, 2.0])
    page = modes_page([modes])
    text = " ".join(re.sub("<[^>]*>", "", str(sentence)) for sentence in page.answer).replace(
        "\u00a0", " "
    )
    rest = next(iter(modes.rest.values())).undamped_frequencies[0] / (2.0 * np.pi)
    known = rest[rest > 1e-6 * rest.max()]
    numbers = [
        value(text)
        for text in re.search(r"natural frequencies are (.*?) Hz", text)[1].split(" to ")
    ]  # type: ignore[index]
    assert numbers[0] == pytest.approx(known.min(), rel=1e-3)
    assert numbers[-1] == pytest.approx(known.max(), rel=1e-3)
    assert str(page.answer[0]).startswith("paper/fig11, changed: bearing.stiffness: at rest its")
    assert str(page.answer[-1]).startswith("The modes of four models agree within")
    assert ("stable at all" in text) == bool(
        (modes.floquet is not None) and (modes.floquet.stable == 1).all()
    )


def test_modes_that_do_not_satisfy_their_equations_are_told_of_one_model_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    modes = compute_modes(paper("fig11"), [0.5, 1.0])
    fault = "lagrange: its modes leave 1.0e-02 of its own linearized equations"
    monkeypatch.setattr(SceneModes, "faults", property(lambda _: [fault]))
    for kind in (modes.rest, modes.rotation):
        for model in list(kind)[1:]:
            del kind[model]  # type: ignore[attr-defined]
    page = modes_page([modes])
    assert fault in str(page.answer[0])
    assert (page.facts[0].value, page.facts[0].note) == ("✗ not their equations", fault)


def test_facts_of_modes_have_the_digits_of_the_sentence_and_say_of_which_modes_they_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(SceneModes, "faults", property(lambda _: []))
    monkeypatch.setattr(SceneModes, "disagreement", 4.51e-13)
    bearing = {"stiffness": 1e4, "damping": 10.0}
    apart = compute_modes(paper("fig11").replace(bearing=bearing), [0.5, 1.0])
    page = modes_page([apart])
    facts = {fact.name: fact for fact in page.facts}
    monkeypatch.setattr(SceneModes, "disagreement", 0.5)
    assert "do not agree" in str(mode_answer(apart)[0])
    assert "agree within <b>4.6×10⁻¹³</b>" in str(page.answer[-1])
    assert facts["Models"].note == "4; difference 4.6×10⁻¹³ of the largest eigenvalue"
    assert facts["Damping ratio"].note == "in rotation without gravity, over all speeds"


def test_axes_of_modes_are_named_by_their_scenes(tmp_path: Path) -> None:
    modes = [compute_modes(paper(name), [0.5, 1.0]) for name in ("fig11", "fig12")]
    for of_page, names in (
        (modes[:1], ["rotor speed"]),
        (modes, ["rotor speed of paper/fig11", "rotor speed of paper/fig12"]),
    ):
        text = text_of(write_page(tmp_path / str(len(names)), modes_page(of_page), {}).parent)
        assert sorted(set(re.findall("&#34;name&#34;:&#34;(rotor speed.*?)&#34;", text))) == names
