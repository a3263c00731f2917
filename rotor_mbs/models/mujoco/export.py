"""A scene as an MJCF file that plain MuJoCo loads, with its initial state, torques and something to look at."""

from __future__ import annotations

import math
from xml.etree import ElementTree as ET

from rotor_mbs.models.mujoco import mjcf
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import steps_and_rows

STEP = 2.5e-4  # s, of the file where none is given: the default of mujoco/rk4


def mjcf_file(scene: Scene, integrator: str = "rk4", step: float = STEP) -> str:
    """The MJCF text of a scene.

    integrator   "rk4" or "implicitfast"
    step         largest time step in s; the file's step is a whole part of the sample interval

    The keyframe "start" has the initial state and the loads at t = 0. A numeric "segment i" has the time in s from
    which loads follow it, then each actuator's torque in N m (or rest angle in rad), then each one's slope per s.
    """
    spacing = scene.duration / (scene.samples - 1)
    steps, _ = steps_and_rows(spacing, step, rows_between=False)
    root = mjcf.model(scene, integrator, spacing / steps)
    root.insert(0, ET.Comment(_header(scene, steps)))
    _add_shapes(root, scene)
    pieces, has_loads = mjcf.load_segments(scene), bool(mjcf.loads_of(scene))
    if has_loads:
        custom = ET.SubElement(root, "custom")
        for number, piece in enumerate(pieces, start=1):
            data = mjcf.numbers(piece.start, *piece.values, *piece.slopes)
            ET.SubElement(custom, "numeric", name=f"segment {number}", data=data)
    keyframe = ET.SubElement(root, "keyframe")
    key = ET.SubElement(keyframe, "key", name="start")
    moving = scene.moving_coordinates
    key.set("qpos", mjcf.numbers(*(scene.initial_angles[i] for i in moving)))
    key.set("qvel", mjcf.numbers(*(scene.initial_rates[i] for i in moving)))
    if has_loads:
        key.set("act", mjcf.numbers(*pieces[0].values))
        key.set("ctrl", mjcf.numbers(*pieces[0].slopes))
    return mjcf.text(root)


def _header(scene: Scene, steps: int) -> str:
    lines = [
        scene.title or scene.name,
        f"SI units, rad. {scene.samples} samples over {scene.duration!r} s, {steps} steps from one to the next.",
        "Start from the keyframe: mj_resetDataKeyframe(model, data, 0); then mj_step(model, data, nstep=...).",
    ]
    if mjcf.loads_of(scene):
        lines += [
            "An actuator's activation is its torque in N m, its control the slope of the torque in N m/s. An actuator",
            '"rest ..." has the rest angle of a spring in rad instead, and the stiffness as its gain.',
            "At the start of each segment (custom numerics: time, values, slopes) set data.act and data.ctrl to them.",
            "Where a segment starts between two steps, shorten model.opt.timestep to stop there.",
        ]
    lines.append("Point masses have the least inertia that MuJoCo compiles, 2e-15 kg m^2 about the centre of mass.")
    # Two hyphens end a comment.
    return "\n  " + "\n  ".join(line.replace("--", "- -") for line in lines) + "\n"


def _add_shapes(root: ET.Element, scene: Scene) -> None:
    """A capsule from the hub to each tip, without mass or contact."""
    reach = max(math.hypot(*blade.tip) for blade in scene.blades)
    bodies = {body.get("name"): body for body in root.iter("body")}
    for number, blade in enumerate(scene.blades, start=1):
        if any(blade.tip):
            ET.SubElement(
                bodies[f"blade {number}"], "geom", type="capsule", fromto=mjcf.numbers(0.0, 0.0, 0.0, *blade.tip),
                size=mjcf.numbers(0.01 * reach), mass="0", contype="0", conaffinity="0",
            )  # fmt: skip
