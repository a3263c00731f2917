"""OpenFAST's output without a word of mapping: signs, wrapped azimuths, frames, points and
weights."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.commands import refusal, rotor_mbs
from support.openfast_models import write_model
from support.openfast_output import columns_of, write_output

import rotor_mbs as rm
from rotor_mbs.scenario.scene import Scene

Array = Any
pytestmark = pytest.mark.usefixtures("files_read_here")

PROGRAM = {"program": "openfast"}


def rotor(**changes: object) -> Scene:
    """Three blades with offsets on springs, tilt and cones, a hub with mass and roots at a radius,
    turning."""
    scene = rm.scene("check/general").replace(duration=0.4, samples=21)
    keys = {
        "hub.radius": 0.5,
        "hub.mass": 300.0,
        "initial.rates[0]": 18.0,
        "outputs": ["angles", "rates", "loads"],
    }
    keys |= {
        "shaft.tilt": -0.1,
        "blade[0].cone": -0.06,
        "blade[1].cone": -0.06,
        "blade[2].cone": 0.2,
    }
    return scene.replace(**{**keys, **changes})


def output_of(scene: Scene, **numbers: float) -> dict[str, tuple[str, Array]]:
    run = rm.run(scene, "reference")
    return columns_of(scene, run.time, run.angles, run.rates, **numbers)


def in_python(columns: dict[str, tuple[str, Array]], names: Sequence[str] = ()) -> dict[str, Array]:
    """The columns, or some, as arrays with their units in the names."""
    return {f"{name} [{columns[name][0]}]": columns[name][1] for name in names or columns}


def loads_compared(comparison: rm.DataComparison) -> set[str]:
    return {channel.name for channel in comparison.verdict.channels if channel.unit in ("N", "N m")}


def test_every_channel_is_known_by_the_head_of_the_file(tmp_path: Path) -> None:
    """Root loads in both frames, shaft loads in both, pitches, azimuth from 0 to 360 degrees, speed
    in rpm."""
    scene = rotor()
    columns = output_of(scene)
    assert (np.abs(np.diff(columns["Azimuth"][1])) > 180.0).any()
    names = [name for name in columns if not name.startswith("LSSTipMx")]
    for chosen in (
        [
            name
            for name in names
            if not (name.startswith("Root") and name[6] == "b") and not name.endswith("a")
        ],
        [
            name
            for name in names
            if not (name.startswith("Root") and name[6] == "c") and not name.endswith("s")
        ],
    ):
        write_output(tmp_path / "model.out", columns, chosen)
        found = rm.compare(tmp_path / "model.out", scene)
        assert (found.status, found.message, found.likely) == ("ok", "", ())
        assert found.verdict.read[0].startswith(
            "OpenFAST's output, by its head: pitch with opposite sign"
        )
        assert len(loads_compared(found)) == 18 + 5
    assert "strain gages" in str(found.verdict.unused) or "LSSGagMya" not in chosen


@pytest.mark.full
def test_numbers_of_the_model_are_in_the_mapping() -> None:
    """AzimB1Up shifts the azimuth, HubCM moves the hub's weight; `new --from` writes both."""
    scene = rotor()
    names = [
        "Time",
        "Azimuth",
        "RotSpeed",
        "BldPitch1",
        "BldPitch2",
        "BldPitch3",
        "LSSTipMys",
        "LSSTipMzs",
    ]
    data = in_python(output_of(scene, azimuth_up=90.0, hub_centre=0.7), names)
    numbers = {"AzimB1Up": 90.0, "HubCM": 0.7}
    found = rm.compare(data, scene, columns=PROGRAM | {"openfast": numbers})
    assert (found.status, found.message) == ("ok", "")
    assert "azimuth less AzimB1Up = 90 deg" in found.verdict.read[0]
    assert loads_compared(found) == {"shaft moment x, shaft frame", "shaft moment z, shaft frame"}
    without = rm.compare(data, scene, columns=PROGRAM | {"openfast": {"AzimB1Up": 90.0}})
    wrong = [channel.name for channel in without.verdict.channels if (channel.defect or 0.0) > 1e-6]
    assert wrong == ["shaft moment x, shaft frame"]
    assert rm.compare(data, scene, columns=PROGRAM).status != "ok"


def test_a_column_that_is_mapped_goes_before_its_name() -> None:
    scene = rotor()
    columns = output_of(scene)
    columns["BldPitch1"] = ("deg", -columns["BldPitch1"][1])
    data = in_python(
        columns, ["Time", "Azimuth", "RotSpeed", "BldPitch1", "BldPitch2", "BldPitch3"]
    )
    assert rm.compare(data, scene, columns=PROGRAM | {"pitch_1": "BldPitch1"}).status == "ok"


@pytest.mark.parametrize(
    ("column", "factor"),
    [
        ("RootMyc2", 1.01),
        pytest.param("BldPitch2", -1.0, marks=pytest.mark.full),
        pytest.param("RootFxc1", -1.0, marks=pytest.mark.full),
        pytest.param("LSShftFys", -1.0, marks=pytest.mark.full),
    ],
)
def test_a_wrong_column_is_seen(column: str, factor: float) -> None:
    scene = rotor()
    columns = output_of(scene)
    columns[column] = (columns[column][0], factor * columns[column][1])
    assert rm.compare(in_python(columns), scene, columns=PROGRAM).status == "inaccurate"


def test_a_table_of_python_is_openfasts_by_the_mapping() -> None:
    """Without units they are OpenFAST's."""
    scene = rotor()
    data = {
        name: values
        for name, (_, values) in output_of(scene).items()
        if not name.startswith(("Root", "LSS"))
    }
    del data["RotThrust"]
    assert rm.compare(data, scene, columns=PROGRAM).status == "ok"


def test_from_a_model_to_a_verdict(tmp_path: Path) -> None:
    """What `new --from` writes is what its output needs: a two-bladed model, blade 1 up at 10
    degrees, HubCM 0.25 m."""
    model = write_model(tmp_path, "OpenFAST 3.1", 2, {"UndSling": "0", "TMax": "1"})
    scene, mapping, output = (
        tmp_path / "my.toml",
        tmp_path / "my.columns.toml",
        tmp_path / "model.out",
    )
    assert rotor_mbs("new", scene, "--from", model).status == 0
    turning = rm.load(scene)
    write_output(output, output_of(turning, azimuth_up=10.0, hub_centre=0.25))
    ended = rotor_mbs(
        "compare", output, "--scene", scene, "--columns", mapping, "-o", tmp_path / "page", "--json"
    )
    found = json.loads(ended.out)
    assert (ended.status, found["agrees"]) == (0, True)
    assert "BldPitch" in " ".join(found["read"])


def test_the_program_is_one_that_is_known(tmp_path: Path) -> None:
    data, mapping = tmp_path / "data.csv", tmp_path / "map.toml"
    data.write_text("time,rotor\n0,0\n1,1\n2,2\n")
    command = ("compare", data, "--scene", "paper/fig03", "--columns", mapping)
    mapping.write_text('program = "bladed"\n')
    line = refusal(*command)
    assert 'map.toml:1: program: "bladed" is not one of them; allowed: one of openfast' in line
    mapping.write_text('program = "openfast"\n[openfast]\nAzimB1 = 3\n')
    line = refusal(*command)
    assert "map.toml:3: openfast.AzimB1: " in line
    assert "perhaps AzimB1Up" in line
