"""The Python API as a user has it: scenes in, runs and comparisons out, labelled, in files, in a
notebook."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import rotor_mbs as rm
from rotor_mbs.testing import assert_agrees

METHOD = "lagrange/dop853"
SHORT = {"duration": 1.0, "samples": 101}


@pytest.fixture(scope="module")
def study() -> rm.Results:
    scene = rm.scene("paper/fig08").replace(**SHORT)
    return rm.run(scene, ["lagrange/dop853", "exudyn_tree/rk67", "exudyn_chain/generalized_alpha"])


def test_every_public_name_is_there_and_documented() -> None:
    assert set(rm.__all__) <= set(dir(rm))
    assert [name for name in rm.__all__ if not getattr(rm, name).__doc__] == []


def test_importing_the_package_imports_nothing_else() -> None:
    code = (
        "import sys; before = set(sys.modules); import rotor_mbs; print(*sorted(set(sys.modules) - "
        "before))"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert loaded == ["rotor_mbs"]


@pytest.mark.full
def test_every_function_takes_a_scene_by_its_name_or_path(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    shipped = rm.scene("paper/fig03")
    mine = shipped.replace(**SHORT)
    path.write_text(mine.text)
    for scene, text in (("paper/fig03", shipped.text), (path, mine.text)):
        run = rm.run(scene, "lagrange/dop853")
        assert run.scene.text == text
        assert list(rm.run(scene, ["lagrange/dop853"])) == ["reference", "lagrange/dop853"]
        assert assert_agrees(run.time, run.angles, scene=scene).agrees
        assert rm.modes(scene).scene == run.scene.name
        assert rm.sweep(scene, {"gravity": [0.0]}, methods="lagrange/dop853").statuses == {"ok": 1}
        assert [path.name for path in rm.export(scene, "csv", tmp_path / "a.csv")] == ["a.csv"]


def test_a_scene_of_ones_own_gets_a_computed_reference(tmp_path: Path) -> None:
    pytest.importorskip("heyoka")
    path = tmp_path / "mine.toml"
    path.write_text(rm.scene("paper/fig09").replace(**SHORT).text)
    mine = rm.load(path)
    assert mine.name == "mine"
    assert rm.run(mine, "lagrange/dop853").reference is None
    run = rm.run(mine, "lagrange/dop853", reference=True)
    assert run.reference is not None
    assert run.metrics["angle_error_max"] < 1e-10


def test_labels_units_and_values_of_xarray(study: rm.Results) -> None:
    data = study.to_xarray()
    run = study["exudyn_tree/rk67"]
    chosen = data.angles.sel(run="exudyn_tree/rk67", coordinate="pitch 1")
    np.testing.assert_array_equal(chosen, run.angles[:, 1])
    np.testing.assert_array_equal(
        data.tip.sel(run="exudyn_tree/rk67", blade=2, axis="y"), run["tip"][:, 1, 1]
    )
    assert data.angles.attrs["units"] == "rad"
    assert data.time.attrs["units"] == "s"
    assert "method" not in data.dims
    # The chain alone has joints that can open: NaN for the others, not a missing run.
    assert data.constraint_error.sel(run="lagrange/dop853").isnull().all()
    assert data.constraint_error.sel(run="exudyn_chain/generalized_alpha").notnull().all()


def test_two_models_differ_by_what_the_plot_and_the_table_show(study: rm.Results) -> None:
    drawn = study.plot.error().figure.axes[0]
    labels = [text.get_text() for text in drawn.get_legend().get_texts()]
    assert labels == ["closed form, DOP853", "Exudyn tree, RK67", "Exudyn chain, generalized-α"]
    runs = [run for name, run in study.items() if name != "reference"]
    for line, run in zip(drawn.get_lines(), runs, strict=False):
        assert np.nanmax(line.get_ydata()) == run.metrics["angle_error_whole"]
    assert all(f"{run.metrics['angle_error_max']:.1e}" in repr(study) for run in runs)
    assert study.statuses == {"ok": 4}


def test_runs_of_any_kind_have_a_table_with_units_and_are_the_same_after_saving(
    study: rm.Results, tmp_path: Path
) -> None:
    """Runs of a scene, of two scenes and of a sweep: labels, numbers, statuses, arrays."""
    scene = study["lagrange/dop853"].scene
    swept = rm.sweep(scene, {"gravity": [9.0, 9.8]}, methods=METHOD, samples=5)
    other = rm.run(scene.replace(gravity=9.0), [METHOD])
    for number, runs in enumerate((study, swept, other)):
        again = rm.open(runs.save(tmp_path / f"{number}.h5"))
        table = again.table()
        assert list(again) == list(runs) == list(table.index)
        assert table.equals(runs.table())
        assert again.statuses == {"ok": len(runs)} == table.status.value_counts().to_dict()
        for label, run in again.items():
            stored = {name: table[name][label] for name in run.metrics}
            assert stored == run.metrics
            assert (table.status[label], table.method_name[label]) == (run.status, run.method)
        for name, unit in (("defect_max", "rad"), ("time_reached", "s"), ("status", "1")):
            assert table.attrs[name]["units"] == unit
        assert "largest defect" in table.attrs["defect_max"]["long_name"]
        angles = np.array([run.angles for run in again.values()])
        np.testing.assert_array_equal(again.column("angles"), angles)
        np.testing.assert_array_equal(again.at("angles", -1), angles[:, -1])
        data = again.to_xarray()
        assert data.status.values.tolist() == table.status.tolist()
        np.testing.assert_array_equal(data.angles, angles)
    assert swept.table().gravity.tolist() == [9.0, 9.8]
    assert swept.table().attrs["gravity"]["units"] == "m/s^2"
    with pytest.raises(rm.InputError, match="unstack: nothing is varied"):
        study.to_xarray(unstack=True)


def test_a_solution_has_its_quantities_status_and_metrics() -> None:
    run = rm.run(rm.scene("paper/fig08").replace(**SHORT), METHOD)
    assert (run.status, run.message) == ("ok", "")
    assert run.metrics["energy_drift_max"] < 1e-9
    np.testing.assert_array_equal(run.energy_error, run["energy_error"])
    np.testing.assert_array_equal(run["time"], run.time)
    with pytest.raises(KeyError, match="this solution has: time, angles"):
        run["constraint_error"]
    with pytest.raises(AttributeError, match="nothing"):
        assert run.nothing is None
    np.testing.assert_array_equal(
        run.to_xarray().angles.sel(coordinate="pitch 2"), run.angles[:, 2]
    )


def test_runs_are_saved_opened_and_rendered(study: rm.Results, tmp_path: Path) -> None:
    file = rm.open(study.save(tmp_path / "deep" / "study.h5"))
    assert list(file) == list(study)
    for name, run in study.items():
        for again in (file[f"{study.scene}/{name}"], file[study.scene][name]):
            assert again.angles.tobytes() == run.angles.tobytes()
            assert (again.status, again.settings, again.metrics) == (
                run.status,
                run.settings,
                run.metrics,
            )
    with pytest.raises(KeyError, match="rk67"):
        file[f"{study.scene}/lagrange/radau"]
    with pytest.raises(rm.StoreError, match=r"^\.: is a folder; allowed: the name of a file$"):
        study.save(".")
    for shown in (study, study["lagrange/dop853"]):  # in a notebook
        assert "<table>" in shown._repr_html_()
        assert "<svg" in shown._repr_html_()
    index = study.to_html(tmp_path / "pages")
    assert index.read_text().startswith("<!DOCTYPE html>")
    # A file of one scene has no page but that of the scene.
    assert [path.name for path in index.parent.iterdir()] == ["index.html"]
    assert "<title>Three blades from rest, blade 1 pitched by 45°<" in index.read_text()


def test_what_was_not_asked_for_is_refused_by_name(tmp_path: Path) -> None:
    scene = rm.scene("paper/fig08").replace(outputs=["angles", "rates"], **SHORT)
    run = rm.run(scene, "lagrange/dop853")
    with pytest.raises(rm.InputError, match="kinetic_energy"):
        run.plot.energy()
    with pytest.raises(rm.InputError, match="reference"):
        run.plot.error()
    with pytest.raises(rm.InputError, match=r"\.pdf"):
        run.plot().save(tmp_path / "motion.bmp")
    run.plot().save(tmp_path / "motion.png")
    assert (tmp_path / "motion.png").read_bytes().startswith(b"\x89PNG")
    alone = rm.run(scene.replace(outputs=["angles"]), METHOD)
    assert alone.message.endswith(
        "without energies it needs both angles and rates, or angles and a reference"
    )
    # Read from a file that does not have them: NaN, and no plot of them.
    scene = scene.replace(outputs=["energy"])
    stored, of_sweep = (
        rm.run(scene, [METHOD])[METHOD],
        rm.sweep(scene, {"gravity": [9.8]}, methods=METHOD)[0],
    )
    assert np.isnan([stored.angles, stored.rates, of_sweep.angles, of_sweep.rates]).all()
    for draw in (stored.plot, stored.plot.error, stored.plot.defects, of_sweep.plot.rotor):
        with pytest.raises(
            rm.InputError, match="angles are not stored; allowed: angles in `outputs`"
        ):
            draw()
    assert "<svg" not in stored._repr_html_() + rm.run(scene, [METHOD])._repr_html_()


def test_a_sweep_gives_labelled_runs_of_each_parameter_value(tmp_path: Path) -> None:
    scene = rm.scene("paper/fig08").replace(**SHORT)
    values = [0.0, 1e3, 1e4]
    data = rm.sweep(
        scene,
        {"bearing.stiffness": values},
        methods="lagrange/dop853",
        samples=11,
        output=tmp_path / "stiffness.h5",
    )
    table = data.to_xarray()
    assert table.bearing_stiffness.values.tolist() == values
    assert table.bearing_stiffness.attrs["units"] == "N m/rad"
    for i, stiffness in enumerate(values):
        single = rm.run(
            scene.replace(samples=11, **{"bearing.stiffness": stiffness}), "lagrange/dop853"
        )
        np.testing.assert_array_equal(data.column("angles")[i], single.angles)
    np.testing.assert_array_equal(data.at("angles", 7), data.column("angles")[:, 7])
    assert repr(rm.open(tmp_path / "stiffness.h5")) == repr(data)
    assert repr(data).splitlines()[0] == f"{tmp_path / 'stiffness.h5'}: 3 runs: 3 ok"
    assert repr(data).splitlines()[-1].split() == [
        "bearing.stiffness",
        "N",
        "m/rad",
        "0",
        "10000",
        "3",
    ]
    with pytest.raises(
        rm.InputError, match=r"only of the runs of one scene; allowed: results\[0\]\.plot,"
    ):
        _ = data.plot
    assert data[1].status == "ok"
    assert data[1].metrics["defect_max"] == data.column("defect_max")[1]
    assert data[1].integration.steps == data.column("steps")[1] > 0
    assert data[1].integration.success
    short = rm.sweep(scene, {"gravity": [9.8]}, methods=METHOD, samples=11, precision="float32")[0]
    assert short.angles.dtype == float
    assert len(short.time) == 11
    alone = rm.sweep(scene, {"gravity": [9.8]}, methods=METHOD, samples=11, outputs=["angles"])[0]
    np.testing.assert_allclose(alone.angles, short.angles, rtol=1e-6)
    assert np.isnan(alone.rates).all()
    assert "run time" not in repr(data[1])
    np.testing.assert_array_equal(data[1].angles, data.column("angles")[1])
    by_stiffness = data.to_xarray(unstack=True).angles.sel(bearing_stiffness=1e3)
    np.testing.assert_array_equal(by_stiffness, data.column("angles")[1])
    for name, sample in (("angles", 11), ("status", 0)):
        with pytest.raises(
            rm.StoreError,
            match=(
                rf"^{name}, sample {sample}: allowed: .*, "
                r"samples 0 to 10$"
            ),
        ):
            data.at(name, sample)
    for options in ({"gravity": [9.8, 9.8, 9.8]}, {"gravity": [9.0, 9.5, 9.8], "combine": "zip"}):
        gravity = {"gravity": options.pop("gravity")}
        other = rm.sweep(
            scene, {"bearing.stiffness": values, **gravity}, methods=METHOD, samples=3, **options
        )
        with pytest.raises(
            rm.InputError,
            match=(
                r"not every combination of bearing_stiffness, "
                r"gravity, once each; al"
            ),
        ):
            other.to_xarray(unstack=True)
    with pytest.raises(rm.InputError, match=r"bearing\.stifness"):
        rm.sweep(scene, {"bearing.stifness": values})
