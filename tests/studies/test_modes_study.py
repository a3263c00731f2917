"""The modes study: models agree and a planted error shows, records keep every number, the command,
page and API."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.commands import rotor_mbs
from support.scenes import general

import rotor_mbs as rm
from rotor_mbs.analysis import modes as modal
from rotor_mbs.analysis.modes import read_modes, to_records
from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.runs.read import write_records
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene, scene_from_tables
from rotor_mbs.solution.status import REFUSED
from rotor_mbs.studies import modes as study

NREL = find_scenes(["stiff/nrel-5mw"])[0]
SOFT = replace(
    NREL,
    name="soft",
    bearing_stiffness=(1e5,) * 3,
    bearing_damping=(5e3,) * 3,
    initial_angles=(0.5, 0.0, 0.0, 0.0),
)


@pytest.fixture(scope="module")
def found() -> rm.Modes:
    return rm.modes(replace(SOFT, gravity=0.0), speeds=[0.0, 1.2, 3.0])


def test_all_models_agree_on_the_nrel_rotor(found):
    assert list(found.rest)[:3] == ["lagrange", "exudyn_tree", "exudyn_chain"]
    assert list(found.rotation)[:2] == ["lagrange", "exudyn_tree"]
    assert found.agrees
    closed = found.rotation["lagrange"]
    assert closed.names == ("rotor", "collective pitch", "cosine pitch", "sine pitch")
    assert (np.diff(closed.undamped_frequencies[:, 1]) > 0.0).all()  # centrifugal stiffening


def change_one_model(monkeypatch, part, share):
    """One blade's stiffness or damping a little larger in one model alone."""
    method = find_method("exudyn_tree/rk67")
    right = method.linearize

    def wrong(scene, *state):
        first, *others = getattr(scene, part)
        return right(replace(scene, **{part: (first * (1.0 + share), *others)}), *state)

    monkeypatch.setitem(method.__dict__, "linearize", wrong)


@pytest.mark.parametrize(("part", "off"), [("bearing_stiffness", 5e-7), ("bearing_damping", 5e-8)])
def test_a_model_of_another_rotor_is_found_out(part, off, monkeypatch):
    """Half a millionth of the frequency, or a millionth of a decay rate that is a twentieth of
    it."""
    change_one_model(monkeypatch, part, 1e-6)
    found = study.compute_modes(general(gravity=0.0, bearing_damping=(300.0, 500.0, 400.0)))
    assert not found.agrees
    assert found.disagreement == pytest.approx(off, rel=0.2)


def break_matrices(monkeypatch, change):
    """Hand over matrices of one model that `change` has changed."""
    method = find_method("exudyn_tree/rk67")
    right = method.linearize

    def wrong(scene, *state):
        linear = right(scene, *state)
        stiffness = linear.stiffness.copy()
        change(stiffness)
        return replace(linear, stiffness=stiffness)

    monkeypatch.setitem(method.__dict__, "linearize", wrong)


def couple_pitches(stiffness):
    """Leave what multiblade coordinates read of equal blades: their diagonal."""
    size = 1e-4 * stiffness[1, 1]
    for i, j in ((1, 2), (2, 3), (3, 1)):
        stiffness[i, j] += size
        stiffness[j, i] -= size


def hold_rotor(stiffness):
    """Let the pitches depend on the rotor's angle, which is left out of modes without gravity."""
    stiffness[1:, 0] += 1e-4 * stiffness[1, 1]


@pytest.mark.parametrize("change", [couple_pitches, hold_rotor])
def test_a_linearization_that_its_modes_do_not_satisfy_is_found_out(change, monkeypatch, tmp_path):
    """Modes of symmetric equations are computed from a part of the matrices, which is right
    here."""
    break_matrices(monkeypatch, change)
    found = study.compute_modes(replace(SOFT, gravity=0.0), [1.2])
    assert not found.agrees
    np.testing.assert_allclose(
        found.rotation["exudyn_tree"].eigenvalues, found.rotation["lagrange"].eigenvalues, atol=1e-6
    )
    write_records(tmp_path / "modes.h5", to_records(found))
    assert not read_modes(tmp_path / "modes.h5")["soft"].agrees
    if change is couple_pitches:
        assert found.residuals["exudyn_tree"] > 1e-6 > found.residuals["lagrange"]
        assert "exudyn_tree: its modes leave" in found.faults[0]


def test_a_slow_mode_that_is_wrong_is_found_out(monkeypatch):
    """A pendulum on bearings over a thousand times faster, whose frequency is below what is
    compared."""
    scene = replace(general(bearing_stiffness=(3e8,) * 3), bearing_damping=())
    found = study.compute_modes(scene)
    values = np.abs(found.rest["lagrange"].eigenvalues)
    assert values.min() < 1e-3 * values.max()
    assert found.agrees

    def twice(stiffness):
        stiffness[0, 0] *= 2.0

    break_matrices(monkeypatch, twice)
    assert not study.compute_modes(scene).agrees


@pytest.mark.full
def test_models_that_agree_to_rounding_of_the_largest_eigenvalue_agree():
    """A mode 600 times slower than the largest has 2e-8 of its own frequency from rounding of 2e-11
    of that."""
    blade = {
        "mass": 5735.873229895609,
        "centre_of_mass": [-0.12268342394039689, 0.14314354773890337, 12.592758364323915],
        "inertia": [
            85519.73186439436,
            86726.09939908709,
            1578.6863819026487,
            -295.9626892286708,
            -2578.226239776899,
            1084.554916651137,
        ],
        "tip": [0.0, 0.0, 22.0],
    }
    angles = [
        2.1916749052073907,
        0.489647641963062,
        -0.04283653238530771,
        -1.1838732991132703,
        0.14028002379495041,
    ]
    stiffness = [22807.77811834454, 54485.32665326917, 16882.012736492943, 16766.434760896558]
    tables = {
        "title": "r", "blades": 4, "gravity": 9.81, "duration": 1.0, "samples": 11, "blade": blade,
        "hub": {"inertia": 83964.6944133776}, "initial": {"angles": angles, "rates": [0.0] * 5},
        "bearing": {"stiffness": stiffness},
    }  # fmt: skip
    found = study.compute_modes(scene_from_tables(tables, "m3"), [0.0, 1.25, 2.5])
    assert found.agrees
    assert "agree" in modal.mode_summary(found)


@pytest.mark.parametrize("share", [-1e-13, 1e-13])
def test_modes_of_equal_frequency_are_in_the_same_places_for_every_model(share, monkeypatch):
    """Of equal blades with unequal dampers the last bits of each model decide which is the
    slowest."""
    change_one_model(monkeypatch, "bearing_stiffness", share)
    found = study.compute_modes(replace(SOFT, gravity=0.0, bearing_damping=(3e3, 4e3, 5e3)), [3.0])
    ratios = [model.damping_ratios for model in found.rotation.values()]
    np.testing.assert_allclose(ratios[1:], [ratios[0]] * (len(ratios) - 1), rtol=1e-8)
    assert found.agrees


def test_blades_that_differ_have_numbered_modes_and_unknown_speeds_a_message():
    found = study.compute_modes(general(gravity=0.0), [1.0])
    assert found.rotation["lagrange"].names == ("mode 1", "mode 2", "mode 3", "mode 4")
    light = study.compute_modes(find_scenes(["extreme/light-1e-8"])[0], [1.2])
    assert not light.rotation
    assert any("steady state" in note for note in light.notes)


def test_records_keep_every_number(tmp_path):
    pytest.importorskip("heyoka")
    found = study.compute_modes(SOFT, [1.2, 3.0])
    write_records(tmp_path / "modes.h5", to_records(found))
    read = read_modes(tmp_path / "modes.h5")["soft"]
    assert (read.title, read.blades, read.gravity, read.notes) == (
        found.title,
        3,
        found.gravity,
        found.notes,
    )
    for model, one in found.rotation.items():
        other = read.rotation[model]
        assert (other.names, other.label, other.coordinates) == (
            one.names,
            one.label,
            one.coordinates,
        )
        for name in (
            "speeds",
            "angles",
            "stiffness",
            "damping",
            "eigenvalues",
            "shapes",
            "multiblade_shapes",
        ):
            np.testing.assert_array_equal(getattr(other, name), getattr(one, name))
    for name in ("speeds", "multipliers", "largest", "stable", "torque", "mismatch"):
        np.testing.assert_array_equal(getattr(read.floquet, name), getattr(found.floquet, name))
    assert np.nanmax(np.abs(found.floquet.product_error)) < 1e-9
    write_records(tmp_path / "none.h5", [replace(to_records(found)[0], kind="comparison")])
    with pytest.raises(StoreError, match="no modes"):
        read_modes(tmp_path / "none.h5")


@pytest.mark.parametrize(
    "speeds", [(1.0, 0.5), (1.0, -1.0), (1.0, 1.0), (float("nan"),), ("a",), (1e-320,), (10**400,)]
)
def test_speeds_that_do_not_increase_are_refused(speeds):
    with pytest.raises(
        InputError,
        match=(
            r"speeds: .*[1na].*; allowed: increasing numbers, each "
            r"0 or of a size from"
        ),
    ):
        study.compute_modes(SOFT, speeds)


RIGID = {
    "blade.centre_of_mass": [0.0, 0.0, 20.0],
    "blade.inertia": [0.0] * 6,
    "bearing.stiffness": 0.0,
}
AXIAL = {**RIGID, "blade.inertia": [4e6, 4e6, 2e4, 0.0, 0.0, 0.0]}
BALANCED = "balanced rotor: no preferred angle; modes taken at the initial angle"


def at_rest(changes: dict[str, object], *pitches: float) -> Scene:
    """The turbine's rotor at 0.5 rad and at rest."""
    start = {"initial.angles": [0.5, *pitches], "initial.rates": [0.0] * (1 + len(pitches))}
    return rm.scene("stiff/nrel-5mw").replace(**start, **changes)


@pytest.mark.parametrize(
    ("changes", "pitches"),
    [
        (RIGID, (0.1, 0.1, 0.1)),
        (AXIAL, (0.1, 0.2, 0.3)),
        ({"blades": 5, **AXIAL}, (0.1,) * 5),
        ({}, (0.1, 0.1, 0.1)),
        ({"bearing.stiffness": 1e10, "bearing.rest": 0.5}, (0.1, 0.1, 0.1)),
        ({"bearing.stiffness": 0.0}, (0.0, 0.0, 0.0)),
        ({"blades": 4, "bearing.stiffness": 0.0}, (0.0,) * 4),
    ],
)
def test_a_balanced_rotor_has_its_modes_at_the_initial_angle(changes, pitches):
    """Weights that balance leave rounding of 1e-16 of them, which is no stiffness, and no
    torque."""
    found = study.compute_modes(at_rest(changes, *pitches))
    assert found.notes == (BALANCED,)
    assert found.agrees
    assert list(found.rest)[:3] == ["lagrange", "exudyn_tree", "exudyn_chain"]
    for modes in found.rest.values():
        assert modes.angles[0, 0] == 0.5
    closed = found.rest["lagrange"]
    assert 0.0 in closed.undamped_frequencies
    assert closed.damped_frequencies.shape == (1, len(closed.coordinates))


def test_weights_that_soft_bearings_do_not_balance_turn_the_rotor():
    """On springs of 1e5 N m/rad the pitches move by 0.1 rad a turn: the energy has minima at every
    sixth of one."""
    found = study.compute_modes(
        at_rest({"bearing.stiffness": 1e5, "bearing.rest": 0.5}, 0.5, 0.5, 0.5)
    )
    assert found.notes == ()
    assert found.rest["lagrange"].angles[0, 0] == pytest.approx(np.pi / 6.0, abs=1e-9)


FREE_TORQUE = {"torque.pitch": 500.0, "bearing.stiffness": 0.0, "gravity": 0.0}


def test_no_steady_state_is_one_line_and_no_file(tmp_path):
    scene = replace(at_rest(FREE_TORQUE, 0.1, 0.1, 0.1), name="free")
    (tmp_path / "free.toml").write_text(scene.text, encoding="utf-8")
    output = tmp_path / "modes.h5"
    reason = (
        "no steady state at 0 rad/s: a torque of 500 N m acts on pitch 1, which has no spring, and "
        "nothing"
    )
    shown = rotor_mbs("modes", "-o", output, "-j", 1, tmp_path / "free.toml", "--speeds=0:0.001:2")
    assert shown == (2, "", f"not run: free: {reason} balances it\n")
    assert not output.exists()
    with pytest.raises(InputError, match=reason):
        rm.modes(scene)


def test_a_scene_without_modes_ends_no_batch_and_takes_nothing_away(tmp_path):
    scene, output = replace(at_rest(FREE_TORQUE, 0.1, 0.1, 0.1), name="free"), tmp_path / "modes.h5"
    options = {"names": ["exudyn_tree/rk67"], "workers": 0, "timeout_s": 60.0}
    other = general(gravity=0.0)
    made = study.modes_of_scenes([scene, other], output, **options)
    by_label = {outcome.label: outcome for outcome in made}
    refused, computed = by_label["free modes"], by_label[f"{other.name} modes"]
    assert (refused.status, refused.is_stored) == (REFUSED, False)
    assert (computed.status, computed.is_stored) == ("ok", True)
    assert "no steady state" in refused.message
    assert list(read_modes(output)) == [other.name]
    before = output.read_bytes()
    without_any = study.modes_of_scenes([scene, replace(scene, name=other.name)], output, **options)
    assert [outcome.status for outcome in without_any] == [REFUSED, REFUSED]
    assert output.read_bytes() == before


def test_a_torque_that_the_weight_balances_is_a_steady_state():
    """At a torque of up to m g x a pitch can rest where its weight, off the axis, holds it."""
    hanging = at_rest({"torque.pitch": 500.0, "bearing.stiffness": 0.0}, 0.1, 0.1, 0.1)
    weight = 17740.0 * 9.80665 * 0.1
    assert study.compute_modes(hanging).rest
    with pytest.raises(InputError, match=f"gravity and rotation balance at most {weight:g} N m"):
        study.compute_modes(hanging.replace(**{"torque.pitch": 1.001 * weight}))


def test_a_turn_that_takes_years_has_no_multipliers_but_a_reason():
    pytest.importorskip("heyoka")
    found = study.compute_modes(SOFT, [1e-25])
    assert found.floquet.messages[0].endswith("takes more than 1000000000 steps")


@pytest.mark.full
def test_the_command_writes_a_file_that_opens_in_xarray_and_a_page(tmp_path: Path):
    import xarray

    pytest.importorskip("heyoka")
    output = tmp_path / "modes.h5"
    command = ["modes", "stiff/nrel-5mw", "--speeds", "0:3:4", "-o", output, "-j", 1]
    status, printed, _ = rotor_mbs(*command)
    assert status == 0
    assert "lagrange, exudyn_tree, exudyn_chain" in printed
    assert " agree: modes differ by at most " in printed
    rotating = printed.partition("\nspeed (rpm)")[0]
    rows = [line.split() for line in rotating.splitlines() if "collective pitch" in line]
    assert [row[3] for row in rows] == ["0", "3"]  # the lowest and the highest speed
    for *_, damped, hertz, _, _ in rows:
        assert float(hertz) == pytest.approx(float(damped) / (2.0 * np.pi), rel=1e-5)
    page = (tmp_path / "modes-report" / "index.html").read_text(encoding="utf-8")
    for text in ("Campbell diagram", "collective pitch", "Floquet multipliers", "forward whirl"):
        assert text in page
    held = rotor_mbs(
        "modes", "check/held", "--speeds", "0:2:3", "-o", tmp_path / "held.h5", "-j", 1
    )
    assert held.status == 0
    assert "under gravity at 0, unknown at 2 of 2 speeds" in held.out
    page = (tmp_path / "held-report" / "index.html").read_text(encoding="utf-8")
    assert page.count("no periodic motion found: ") == 2
    with xarray.open_datatree(output, engine="netcdf4") as tree:
        data = tree["modes/stiff/nrel-5mw/exudyn_tree/rotation"].load()
        assert data.undamped_frequency.dims == ("speed", "mode")
        assert data.undamped_frequency.units == "rad/s"
        assert list(data.coordinate.labels) == ["rotor", "pitch 1", "pitch 2", "pitch 3"]
    rows = json.loads(rotor_mbs(*command, "--json").out)["stiff/nrel-5mw"]
    assert len(rows) == 4 + 4 * 4


def test_other_speeds_take_the_place_of_all_that_was_stored_for_the_scene(tmp_path):
    scene = replace(SOFT, gravity=0.0)
    output = tmp_path / "modes.h5"
    options = {"names": ["exudyn_tree/rk67"], "workers": 0, "timeout_s": 60.0}
    study.modes_of_scenes([scene, general(gravity=0.0)], output, speeds=[1.0], **options)
    first = read_modes(output)
    assert first["soft"].rotation
    made = study.modes_of_scenes([scene], output, **options)
    assert [outcome.status for outcome in made] == ["ok"]
    found = read_modes(output)
    assert found["soft"].rest
    assert not found["soft"].rotation
    general_before, general_now = (
        modes["general"].rotation["lagrange"] for modes in (first, found)
    )
    np.testing.assert_array_equal(general_now.eigenvalues, general_before.eigenvalues)


@pytest.mark.parametrize(
    "span",
    [
        "3",
        "0:3",
        "3:0:4",
        "0:3:1",
        "3:-1:4",
        "0:nan:4",
        "0:3:x",
        "0:1e300:3",
        "0:inf:3",
        "0:1e-320:3",
        "1:1.0000000000000002:5",
    ],
)
def test_a_span_that_means_nothing_is_bad_usage(span):
    ended = rotor_mbs("modes", "stiff/nrel-5mw", f"--speeds={span}")
    assert ended.status == 2
    assert "FROM:TO:COUNT" in ended.err


def test_the_api_has_tables_figures_files(found, tmp_path):
    table = found.table()
    assert (table["mode"] == "collective pitch").sum() == 4  # at rest, and at three speeds
    damped = found.rotation["lagrange"].damped_frequencies
    is_steady = table.state.str.startswith("steady")
    np.testing.assert_array_equal(table.damped_frequency[is_steady], damped.ravel())
    assert table.attrs["damped_frequency"]["units"] == table.attrs["speed"]["units"] == "rad/s"
    assert "<svg" in found._repr_html_()
    found.plot().save(tmp_path / "campbell.png")
    assert (tmp_path / "campbell.png").stat().st_size > 10_000
    assert found.to_html(tmp_path / "pages").read_text(encoding="utf-8").count("<svg") >= 2
    assert read_modes(found.save(tmp_path / "modes.h5"))["soft"].agrees
    with pytest.raises(InputError, match="no Floquet multipliers"):
        found.plot.multipliers()
    data = found.to_xarray()
    assert data.solver.long_name == "model"
    expected = found.rotation["lagrange"].undamped_frequencies[:, 2]
    np.testing.assert_array_equal(
        data.undamped_frequency.sel(solver="lagrange", mode="cosine pitch"), expected
    )
