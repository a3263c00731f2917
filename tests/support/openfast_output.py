"""OpenFAST's output of a rigid rotor: its axes, signs, units and names, from states and independent
loads."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.scenario.scene import Scene
from support.newton_euler import measure, turn

Array = Any
# From OpenFAST's axes x (downwind), y, z to a scene's.
TO_SCENE = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def columns_of(
    scene: Scene,
    time: Array,
    angles: Array,
    rates: Array,
    azimuth_up: float = 0.0,
    hub_centre: float = 0.0,
) -> dict[str, tuple[str, Array]]:
    """Return unit and numbers of OpenFAST's channels by name.

    Frames are those of OpenFAST's manual: s turned by the tilt about y, a by the azimuth about x, c
    by cone about y, b by the pitch about -z. Its loads are those of a blade on the hub, about the
    root, and of rotor and hub on the shaft, about the apex; forces in kN.

    Parameters
    ----------
    scene : of the rotor.
    time, angles, rates : (n,) s, (n, 1 + blades) rad and rad/s.
    azimuth_up : AzimB1Up, degrees.
    hub_centre : HubCM, m downwind of the apex.
    """
    table: dict[str, list[float]] = {}

    def put(name: str, value: float) -> None:
        table.setdefault(name, []).append(value)

    for t, q, qd in zip(time, angles, rates, strict=True):
        state = measure(scene, q, qd, float(t))
        put("Time", float(t))
        put("Azimuth", (math.degrees(q[0]) + azimuth_up) % 360.0)
        put("RotSpeed", qd[0] * 30.0 / math.pi)
        in_s = turn(1, -scene.shaft_tilt)
        in_a = in_s @ turn(0, q[0])
        force = -state.loads["shaft_force"]
        moment = -(state.loads["shaft_moment"])
        # The hub's mass is not at the apex in OpenFAST.
        weight = np.array([0.0, 0.0, -scene.hub_mass * scene.gravity])
        force, moment = TO_SCENE.T @ force, TO_SCENE.T @ moment
        moment = moment + np.cross(hub_centre * in_s[:, 0], weight)
        for frame, axes in (("s", in_s), ("a", in_a)):
            for axis, of_force, of_moment in zip(
                "xyz", axes.T @ force, axes.T @ moment, strict=True
            ):
                put(f"LSShftF{axis}{frame}", of_force / 1e3)
                put(f"LSSTipM{axis}{frame}", of_moment / 1e3)
        put("RotThrust", float((in_s.T @ force)[0]) / 1e3)
        put("LSSGagMya", 0.0)
        for i, blade in enumerate(scene.blades, 1):
            put(f"BldPitch{i}", -math.degrees(q[i]))
            put(f"BldPRate{i}", -math.degrees(qd[i]))
            phase = 2.0 * math.pi * (i - 1) / len(scene.blades)
            in_c = in_s @ turn(0, q[0] + phase) @ turn(1, blade.cone)
            in_b = in_c @ turn(2, q[i])  # the pitch is about -z, and so is a scene's negative one
            own = state.axes[i - 1]
            root_force = TO_SCENE.T @ own @ -state.loads["blade_root_force"][i - 1]
            root_moment = TO_SCENE.T @ own @ -state.loads["blade_root_moment"][i - 1]
            for frame, axes in (("c", in_c), ("b", in_b)):
                for axis, of_force, of_moment in zip(
                    "xyz", axes.T @ root_force, axes.T @ root_moment, strict=True
                ):
                    put(f"RootF{axis}{frame}{i}", of_force / 1e3)
                    put(f"RootM{axis}{frame}{i}", of_moment / 1e3)
    return {name: (_unit(name), np.array(values)) for name, values in table.items()}


def _unit(name: str) -> str:
    """Return the unit in which OpenFAST has a channel."""
    by_beginning = {
        "Time": "s",
        "Azimuth": "deg",
        "RotSpeed": "rpm",
        "BldPitch": "deg",
        "BldPRate": "deg/s",
    }
    for beginning, unit in by_beginning.items():
        if name.startswith(beginning):
            return unit
    return "kN" if "F" in name or name == "RotThrust" else "kN-m"


def write_output(
    path: Path, columns: dict[str, tuple[str, Array]], names: Sequence[str] = ()
) -> None:
    """Write a text output file, of all columns or of some."""
    chosen = list(names) or list(columns)
    head = [
        "",
        (
            "Predictions were generated on 27-Nov-2026 at 12:00:00 using OpenFAST, compiled as a "
            "64-bit application"
        ),
        " linked with NWTC Subroutine Library; ElastoDyn",
        "",
        "Description from the FAST input file: rigid",
        "",
        "\t".join(chosen),
        "\t".join(f"({columns[name][0]})" for name in chosen),
    ]
    table = np.column_stack([columns[name][1] for name in chosen])
    np.savetxt(path, table, header="\n".join(head), comments="", fmt="%20.12E", delimiter="\t")
