"""A user's script for Pinocchio, which knows nothing of this package: a rotor's numbers in JSON to a CSV in degrees.

    pip install pin scipy && python pinocchio_script.py rotor.json out.csv [loads]

Accelerations by Pinocchio's articulated-body algorithm, over time by SciPy's DOP853 from one knot of the loads to the
next. In the JSON: blades (mass, centre_of_mass, inertia xx yy zz xy xz yz), hub_inertia, gravity, stiffness, damping,
shaft_damping, angles and rates at the start, times, and loads: rows [t, value] of the rotor's torque, of each pitch's
torque, then of each spring's rest angle. With `loads`, also the joints' forces by the recursive Newton-Euler algorithm.
"""

import json
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp


def model_of(rotor):
    """A shaft along y at the origin of the base, then a hinge along z for each blade."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -rotor["gravity"]])
    shaft = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "shaft")
    model.appendBodyToJoint(shaft, pin.Inertia(0.0, np.zeros(3), rotor["hub_inertia"] * np.eye(3)), pin.SE3.Identity())
    for i, blade in enumerate(rotor["blades"]):
        place = pin.SE3(pin.utils.rotate("y", 2.0 * np.pi * i / len(rotor["blades"])), np.zeros(3))
        hinge = model.addJoint(shaft, pin.JointModelRZ(), place, f"blade {i + 1}")
        xx, yy, zz, xy, xz, yz = blade["inertia"]
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        body = pin.Inertia(blade["mass"], np.array(blade["centre_of_mass"]), inertia)
        model.appendBodyToJoint(hinge, body, pin.SE3.Identity())
    return model


def torques(rotor, t, y):
    """(1 + blades,) N m on the joints, and that of the drive alone, at a state (2 (1 + blades),)."""
    blades = len(rotor["blades"])
    q, v = y[: 1 + blades], y[1 + blades :]
    loads = np.array([np.interp(t, *np.transpose(table)) if table else 0.0 for table in rotor["loads"]])
    spring = np.array(rotor["stiffness"]) * (q[1:] - loads[1 + blades :])
    pitch = loads[1 : 1 + blades] - spring - np.array(rotor["damping"]) * v[1:]
    return np.array([loads[0] - rotor["shaft_damping"] * v[0], *pitch]), loads[0]


def joint_loads(rotor, states):
    """Columns by name: forces (N) and moments (N m) of the joints; those of the shaft in the rotor's frame."""
    model = model_of(rotor)
    data, count, rows = model.createData(), model.nv, []
    for t, y in zip(rotor["times"], states, strict=True):
        q, v = y[:count], y[count:]
        torque, drive = torques(rotor, t, y)
        pin.rnea(model, data, q, v, pin.aba(model, data, q, v, torque))
        shaft, *roots = (np.concatenate([f.linear, f.angular]) for f in list(data.f)[1:])
        shaft[4] -= drive  # which the bearing does not transmit
        rows.append(np.concatenate([shaft, *roots]))
    kinds = [f"{kind} {{}}{axis}" for kind in ("force", "moment") for axis in "xyz"]
    names = ["shaft " + kind.format("") + " rotor frame" for kind in kinds]
    names += [f"blade root {kind.format(f'{i} ')}" for i in range(1, count) for kind in kinds]
    return dict(zip(names, np.transpose(rows), strict=True))


def trajectory(rotor):
    """(n, 2 (1 + blades)) at the times, of which the first is 0."""
    model = model_of(rotor)
    data, count = model.createData(), model.nv
    times = np.array(rotor["times"])
    knots = {t for table in rotor["loads"] for t, _ in table if 0.0 < t < times[-1]}
    rows = [np.array([*rotor["angles"], *rotor["rates"]])[:, None]]
    for start, end in pairwise(sorted({0.0, times[-1], *knots})):

        def slope(t, y, start=start, end=end):
            margin = 1e-9 * (end - start)  # a jump counts for the interval that it begins
            torque, _ = torques(rotor, min(max(t, start + margin), end - margin), y)
            return np.concatenate([y[count:], pin.aba(model, data, y[:count], y[count:], torque)])

        inside = times[(times > start) & (times <= end)]
        run = solve_ivp(slope, (start, end), rows[-1][:, -1], "DOP853", np.union1d(inside, end), rtol=1e-11, atol=1e-12)
        rows.append(run.y)
        if end not in inside:
            raise SystemExit("a knot of the loads must be one of the times")
    return np.hstack(rows).T


if __name__ == "__main__":
    rotor = json.loads(Path(sys.argv[1]).read_text())
    states = trajectory(rotor)
    names = ["rotor", *(f"pitch {i + 1}" for i in range(len(rotor["blades"])))]
    header = ["time [s]", *(f"{name} [deg]" for name in names), *(f"{name} rate [deg/s]" for name in names)]
    columns = joint_loads(rotor, states) if "loads" in sys.argv else {}
    header += [f"{name} [{'N m' if 'moment' in name else 'N'}]" for name in columns]
    table = np.column_stack([rotor["times"], np.degrees(states), *columns.values()])
    np.savetxt(sys.argv[2], table, delimiter=",", header=",".join(header), comments="", fmt="%.17g")
