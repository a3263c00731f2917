"""Trajectories of codes that are not the package's, judged at their own times."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas
import pytest
import xarray
from support import other_code, references
from support.commands import rotor_mbs
from support.data_files import FORMATS

import rotor_mbs as rm
from rotor_mbs.comparison import trajectory
from rotor_mbs.comparison.verdict import as_dictionary, verdict_of
from rotor_mbs.models.lagrange import reference
from rotor_mbs.runs.read import read_records, write_records
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.testing import assert_agrees


def uneven(duration: float, rows: int = 240) -> np.ndarray:
    """Times that are no sample times of any scene, from 0 to the end."""
    share = np.linspace(0.0, 1.0, rows)
    return duration * (share + 0.1 * np.sin(np.pi * share) ** 2)


def scene_of(name: str, duration: float) -> Scene:
    scene = rm.scene(name)
    return replace(
        scene, duration=duration, samples=1 + round(duration * (scene.samples - 1) / scene.duration)
    )


@pytest.fixture(scope="module")
def run() -> rm.Run:
    """A right run of fig. 3: a pendulum, whose errors do not grow much."""
    return rm.run("paper/fig03", "lagrange/dop853")


@pytest.mark.parametrize(
    ("name", "kind", "duration"),
    [
        ("paper/fig08", "data.csv", 2.0),
        ("check/general", "data.mat", 1.5),  # springs, dampers, a torque with a jump, full inertia
        # Torques and commands on every pitch, with jumps.
        pytest.param("check/pitch-loads", "data.nc", 1.5, marks=pytest.mark.full),
        # To the end, past the horizon.
        pytest.param("paper/fig08", "data.txt", 10.0, marks=pytest.mark.full),
        pytest.param("paper/fig09", "data.npz", 10.0, marks=pytest.mark.full),
        pytest.param("paper/fig11", "data.out", 10.0, marks=pytest.mark.full),
    ],
)
def test_a_correct_code_agrees(tmp_path: Path, name: str, kind: str, duration: float) -> None:
    scene = scene_of(name, duration)
    time = uneven(duration)
    FORMATS[kind](tmp_path / kind, scene, time, *other_code.trajectory(scene, time))
    found = rm.compare(tmp_path / kind, scene)
    assert (found.status, found.message, found.likely) == ("ok", "", ())
    # SciPy at 1e-11 makes errors of some 1e-11 a step; a wrong digit in the equations, at least
    # 1e-4.
    assert max(channel.defect or 0.0 for channel in found.verdict.channels) < 1e-8


def test_the_reference_at_the_times_of_the_data_is_the_frozen_one() -> None:
    """At the scene's samples: the shipped file, bit for bit; between them: what a finer sampling
    has there."""
    pytest.importorskip("heyoka")
    scene, frozen = rm.scene("paper/fig08"), references.reference("paper/fig08")
    time = np.union1d(frozen.time, uneven(10.0))
    found = reference.reference_at(replace(scene, samples=len(time)), time).trajectory
    at = np.searchsorted(time, frozen.time)
    assert found.angles[at].tobytes() == frozen.angles.tobytes()


def test_the_reference_is_kept_for_further_data_of_the_same_times(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It is that of the scene and the times; of many, the four that were used last are kept."""
    asked = []

    def counted(scene: Scene, times: np.ndarray) -> reference.TimedReference:
        asked.append((scene.gravity, len(times)))
        return reference.reference_at(scene, times)

    monkeypatch.setattr(trajectory, "reference_at", counted)
    for gravity, rows in ((9.8, 9), (9.7, 9), (9.8, 9), (9.8, 17), (9.7, 9), (9.6, 9), (9.5, 9)):
        run = rm.run(
            rm.scene("paper/fig03").replace(gravity=gravity, duration=0.1, samples=rows),
            "lagrange/dop853",
        )
        data = {"time": run.time, "angles": run.angles, "rates": run.rates}
        assert rm.compare(data, run.scene).status == "ok"
    assert asked == [(9.8, 9), (9.7, 9), (9.8, 17), (9.6, 9), (9.5, 9)]
    assert rm.compare(data | {"angles": run.angles + 0.1}, run.scene).status == "inaccurate"
    assert rm.compare(data, run.scene).status == "ok"
    assert len(asked) == 5
    rm.compare(data, run.scene.replace(gravity=9.7))
    assert len(asked) == 5
    rm.compare(data, run.scene.replace(gravity=9.8))
    assert len(asked) == 6


def test_growth_of_each_channel_is_at_most_that_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """A row of the state transition matrix is no longer than its norm; without heyoka it is the
    same by differences."""
    scene = scene_of("paper/fig09", 0.5)
    found = reference.reference_at(scene, np.linspace(0.0, 0.5, 6))
    largest = found.growth.max(axis=1)
    assert (largest <= found.trajectory.error_growth * (1.0 + 1e-9)).all()
    assert (found.trajectory.error_growth <= largest * np.sqrt(8.0) * (1.0 + 1e-9)).all()
    monkeypatch.setattr(reference, "is_available", lambda: False)
    other = reference.reference_at(scene, np.linspace(0.0, 0.5, 6))
    np.testing.assert_allclose(other.trajectory.angles, found.trajectory.angles, atol=1e-11)
    np.testing.assert_allclose(other.growth, found.growth, rtol=1e-4)


def test_the_command_prints_a_table_and_writes_a_page(tmp_path: Path) -> None:
    """Status 0 for data that agree, 1 for others; JSON has the same numbers."""
    scene = rm.scene("paper/fig03").replace(duration=1.0, samples=101)
    (tmp_path / "own.toml").write_text(scene.text)
    run = rm.run(scene, "lagrange/dop853")
    data, page = tmp_path / "d.csv", tmp_path / "page" / "index.html"
    call = ["compare", data, "--scene", tmp_path / "own.toml", "-o", page.parent]
    FORMATS["data.csv"](data, scene, run.time, run.angles, run.rates)
    status, shown, _ = rotor_mbs(*call)
    assert status == 0
    assert "rotor = 'rotor' [deg]" in shown
    assert "\nok\n" in shown
    FORMATS["data.csv"](data, scene, run.time, 1.001 * run.angles, run.rates)
    assert rotor_mbs(*call, "--tolerance", 0.1).status == 0
    assert "inaccurate" not in page.read_text()
    status, shown, _ = rotor_mbs(*call, "--json")
    assert status == 1
    found = json.loads(shown)
    assert not found["agrees"]
    assert found["channels"][0]["agrees_until"]["0.001"] != 1.0
    text = page.read_text()
    assert text.count("<svg role") + text.count('role="img"') >= 2
    assert "inaccurate" in text
    assert (
        rotor_mbs("report", page.with_name("comparison.h5"), "-o", tmp_path / "again").status == 0
    )
    assert (tmp_path / "again" / "index.html").read_text() == text


def test_the_stored_comparison_has_data_reference_and_errors_in_si(
    run: rm.Run, tmp_path: Path
) -> None:
    """Of a file in degrees with a channel left out; both readers of netCDF-4 take it, with scales
    and units."""
    late = run.time <= 9.0
    pitch = np.degrees(run.angles[late, 1]) + 1e-3
    found = rm.compare({"t_ms": 1e3 * run.time[late], "pitch_1_deg": pitch}, run.scene)
    assert found.likely == ("pitch 1: zero off by 1.74533e-05",)
    found = pickle.loads(pickle.dumps(found))
    assert found.save(tmp_path / "c.h5") == tmp_path / "c.h5"
    for engine in ("h5netcdf", "netcdf4"):
        with xarray.open_datatree(tmp_path / "c.h5", engine=engine) as tree:
            data = tree["comparison/paper/fig03/data/trajectory"].to_dataset()
        np.testing.assert_array_equal(data.time, found.record.arrays["time"])
        np.testing.assert_allclose(data.pitch_1, run.angles[late, 1] + np.radians(1e-3), atol=1e-15)
        np.testing.assert_allclose(
            data.pitch_1_reference, run.reference.angles[late, 1], atol=1e-12
        )
        np.testing.assert_array_equal(data.pitch_1_error, data.pitch_1 - data.pitch_1_reference)
        assert np.isnan(data.pitch_1_defect[0])
        assert np.nanmax(data.pitch_1_defect) < 1e-6  # a zero that is elsewhere has next to none
        assert {one.attrs["units"] for one in data.data_vars.values()} == {"rad"}
        assert (data.time.attrs["units"], data.attrs["status"], data.attrs["tolerance"]) == (
            "s",
            "inaccurate",
            1e-6,
        )
        xarray.testing.assert_equal(data, found.to_xarray())
    (record,) = read_records(tmp_path / "c.h5", "comparison")
    assert as_dictionary(verdict_of(record)) == as_dictionary(found.verdict)
    write_records(tmp_path / "other.h5", [replace(record, kind="modes")])
    with pytest.raises(rm.InputError, match="holds modes, and this command writes comparisons"):
        found.save(tmp_path / "other.h5")


def test_a_test_of_another_project(run: rm.Run) -> None:
    tolerance = np.float32(1e-6)
    assert assert_agrees(
        run.time, run.angles, scene="paper/fig03", rates=run.rates, tolerance=tolerance
    ).agrees
    with pytest.raises(AssertionError, match="first row"):
        assert_agrees(run.time, run.angles + 1e-4, scene=run.scene)
    with pytest.raises(rm.InputError, match="different lengths"):
        assert_agrees(run.time[1:], run.angles, scene=run.scene)


@pytest.mark.full
def test_a_row_far_beyond_the_horizon_is_not_ok() -> None:
    """From 6 to 20 s in one interval errors grow over 1e5-fold, so that no angle there says
    anything."""
    scene = rm.scene("paper/fig11").replace(duration=20.0, samples=201)
    run = rm.run(scene, "lagrange/dop853")
    rows = np.r_[0:61, 200]
    data = {"time": run.time[rows], "angles": run.angles[rows], "rates": run.rates[rows]}
    # Without rates, and none to be found from rows that are 0.2 s apart.
    coarse = rm.scene("paper/fig14a").replace(samples=51)
    run = rm.run(coarse, "lagrange/dop853")
    for columns, of in ((data, scene), ({"time": run.time, "angles": run.angles}, coarse)):
        found = rm.compare(columns, of)
        assert (found.status, found.message[:17], found.likely) == (
            "unchecked",
            "after the horizon",
            (),
        )


@pytest.mark.full
def test_rows_that_are_far_apart_are_judged() -> None:
    """Intervals of 2.5 s, with 27 radians of the pitches' own swinging in each."""
    scene = rm.scene("paper/fig08").replace(**{"initial.angles": [0.0, "pi/4", 1e-3, 0.0]})
    run = rm.run(scene, "lagrange/dop853")
    rows = np.r_[0:31, 250:1001:250]
    for factor, status in ((1.0, "ok"), (0.9, "inaccurate")):
        rates = run.rates * np.where(run.time < 2.0, 1.0, factor)[:, None]
        found = rm.compare(
            {"time": run.time[rows], "angles": run.angles[rows], "rates": rates[rows]}, scene
        )
        assert found.status == status


def test_tables_of_other_libraries_are_data(run: rm.Run) -> None:
    assert rm.compare(run.to_xarray(), run.scene).agrees
    table = {"time": run.time, "rotor": run.angles[:, 0], "pitch 1": run.angles[:, 1]}
    assert rm.compare(pandas.DataFrame(table), run.scene).agrees


def test_numbers_without_sense_are_inaccurate(run: rm.Run) -> None:
    found = rm.compare({"time": run.time, "rotor": 1e300 * run.angles[:, 0]}, run.scene)
    assert (found.status, found.likely) == (
        "inaccurate",
        ("rotor: too large by a factor of 1e+300",),
    )


def test_channels_may_be_missing_and_rates_alone_are_judged(run: rm.Run) -> None:
    alone = rm.compare({"t": run.time, "pitch_1": run.angles[:, 1]}, run.scene)
    assert (alone.status, len(alone.verdict.channels)) == ("unchecked", 1)
    assert alone.message == 'no column for rotor; allowed: omit = ["rotor"] in a mapping file'
    assert "missing angles: rotor" in alone.verdict.notes
    assert rm.compare(
        {"t": run.time, "pitch_1": run.angles[:, 1]}, run.scene, columns={"omit": ["rotor"]}
    ).agrees
    without = {"omit": ["rotor", "pitch_1"]}
    assert rm.compare(
        {"t": run.time, "rotor_rate": run.rates[:, 0]}, run.scene, columns=without
    ).agrees
    wrong = rm.compare(
        {"t": run.time, "rotor_rate": 1.001 * run.rates[:, 0]}, run.scene, columns=without
    )
    assert wrong.message.startswith("rotor")
    assert wrong.likely == ("rotor rate: too large by a factor of 1.001",)


def test_data_without_a_likely_cause_are_told_where_they_start() -> None:
    """Two mistakes at once, degrees in a scene that starts elsewhere: no single correction fits."""
    scene = rm.scene("paper/fig03")
    run = rm.run(scene.replace(**{"initial.angles": [0.3, 0.2]}), "lagrange/dop853")
    found = rm.compare({"t": run.time, "angles": np.degrees(run.angles)}, scene)
    assert not found.verdict.likely
    (line,) = (note for note in found.verdict.notes if note.startswith("initial state differs"))
    assert "rotor: 17.19 (scene: 2.88)" in line
    assert "unit?" in line
    same = rm.compare({"t": run.time, "angles": run.angles}, run.scene)
    assert not any("initial state differs" in note for note in same.verdict.notes)


def test_numbers_of_few_digits_are_noticed(run: rm.Run, tmp_path: Path) -> None:
    """OpenFAST's usual four digits: a right run is ok as far as they tell, which the page says; a
    wrong one is not."""
    head = "\n".join(["", "OpenFAST", "", "", "", "", "Time Azimuth BldPitch1", "(s) (deg) (deg)"])
    rows = np.column_stack([run.time, np.degrees(run.angles)])
    np.savetxt(tmp_path / "low.out", rows, header=head, comments="", fmt="%10.3E")
    found = rm.compare(tmp_path / "low.out", run.scene)
    assert found.status == "ok"
    assert "numbers of 4 digits: relative rounding error 5e-04" in found.verdict.notes
    heavier = run.scene.replace(gravity=9.0)
    assert not rm.compare(tmp_path / "low.out", heavier).agrees


@pytest.mark.full
def test_settled_angles_of_few_decimals_are_right_and_have_no_cause() -> None:
    """Of stiff bearings: each has few values, and one rounding error over many rows, which no rest
    angle explains."""
    stiff = {
        "bearing_stiffness": (1e6,) * 3,
        "bearing_damping": (3e4,) * 3,
        "initial_rates": (0.0,) * 4,
    }
    scene = replace(
        rm.scene("check/general"),
        duration=3.0,
        samples=151,
        initial_angles=(0.5, 0.0, 0.0, 0.0),
        **stiff,
    )
    run = rm.run(scene, "lagrange/radau")
    found = rm.compare(
        {"time": run.time, "angles": run.angles.round(4), "rates": run.rates.round(4)}, scene
    )
    assert (found.status, found.likely) == ("ok", ())
    assert found.verdict.notes == ("numbers of 4 decimals: rounding error 5e-05",)
    nothing = rm.compare({"time": run.time, "angles": 0.0 * run.angles}, scene)
    assert not any("numbers of" in note for note in nothing.verdict.notes)


def test_the_interval_that_is_named_is_that_of_the_channel() -> None:
    """Of a pitch that is ahead by more and more, the fitted rates have their largest defect 0.6 s
    before the pitch has its own."""
    run = rm.run("paper/fig11", "lagrange/taylor")
    time, angles = np.array(run.time), np.array(run.angles)
    late = time > 5.0
    angles[late, 2] += 1e-3 * (time[late] - 5.0)
    comparison = rm.compare({"time": time, "angles": angles}, "paper/fig11")
    defects = comparison.to_xarray()["pitch_2_defect"].to_numpy()
    end = time[np.nanargmax(defects)]
    assert comparison.message.startswith("pitch 2: defect of")
    assert f"in the interval up to t = {end:.6g} s" in comparison.message
