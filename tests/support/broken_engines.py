"""Engines with one mistake each, written without a look at how `test-method` searches, and right
ones.

    python tests/support/broken_engines.py FOLDER [-o docs/engines-tried.md] [--engines NAME,NAME]

examines each with `rotor-mbs test-method`, keeps its checks in FOLDER/NAME.json (what is there
already is not run again), and writes the table of the document. With `--first` it examines them in
this process by the first scene alone, which takes seconds, and keeps that in
FOLDER/NAME.first.json; the document says which have been examined by no more.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rotor_mbs.analysis.run_checks import Check
from rotor_mbs.methods import catalogue
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.studies import method_test

ROOT = Path(__file__).parents[2]
NEWTON = (ROOT / "tests/studies/engines/right.py").read_text()
_DOCUMENT = (ROOT / "docs/your-engine.md").read_text()
LAGRANGE = re.findall(r"```python\n(.*?METHOD = .*?\n)```", _DOCUMENT, re.DOTALL)[0]
NOT_FOUND = "cause not found"
# Not of the mistake itself, but of what it does to another check.
_CONSEQUENCE = (
    "see the defect|the motion is right: a stored energy is wrong|measured order|solved "
    "analytically|does not give that of the motion|by other numbers give another motion"
)


@dataclass(frozen=True)
class Engine:
    """An engine with a mistake.

    Attributes
    ----------
    mistake : in words; "" of a right engine.
    changes : (old, new) of the text that it is made of.
    reason : regular expression of what may be named as the cause; "" where nothing should be.
    text : that it is made of.
    """

    mistake: str
    changes: Sequence[tuple[str, str]]
    reason: str = ""
    text: str = NEWTON

    def source(self) -> str:
        """Return the text of the engine's file."""
        text = self.text
        for old, new in self.changes:
            assert old in text, old
            text = text.replace(old, new)
        return text


def _between(first: str, last: str) -> str:
    """Return the lines of the right engine from one text to before another."""
    return NEWTON[NEWTON.index(first) : NEWTON.index(last)]


_STEP = _between("        k1 = f(", "    def advance")  # of Runge and Kutta
_ADVANCE = _between("        count = max(", "    def integrate")
_ORDER = "order=4, fixed_step=True"
_EULER = """        rate, n = f(t, y, part), self.N + 1
        y = y.copy()
        y[n:] += h * rate[n:]
        y[:n] += h * y[n : 2 * n]
        return y

"""
_DOP853 = """        K = np.zeros((DOP853.n_stages, len(y)))
        for s in range(DOP853.n_stages):
            K[s] = f(t + DOP853.C[s] * h, y + h * DOP853.A[s, :s] @ K[:s], part)
        return y + h * DOP853.B @ K

"""
_SETTINGS = [
    ("self.scene, self.step = scene, settings.step", "self.scene = scene"),
    (", settings=Step", ""),
]
_SOLVE_IVP = ("import numpy as np\n", "import numpy as np\nfrom scipy.integrate import solve_ivp\n")
_LAW = "f[1:] = act - n[:, 2]"
_PHASES = "np.array(scene.phases)"
_RATES = "rows[:, : N + 1], rows[:, N + 1 : 2 * N + 2]\n"
_PART_LOADS = "np.array(part.loads_at(t))"
_ORDERED = "order (1|0|2|3)[.0-9]* where"
_LOAD = "a load of one interval|a load that is wrong|loads? of another time"
_OBSERVED = (
    "return Trajectory(self.time[: len(self.states)], *np.split(np.array(self.states), 2, axis=1))",
    "q, v = np.split(np.array(self.states), 2, axis=1)\n        return Trajectory(self.time[: "
    "len(q)], q, np.vstack([v[:1], v[:-1]]))",
)

PHYSICS = {
    "p01_gravity_axis": Engine(
        "gravity along x of the base",
        [
            ("gx = w * np.sin(turn)", "gx = w * np.cos(turn)"),
            ("gz = -w * np.cos(turn)", "gz = w * np.sin(turn)"),
        ],
        r"gravity along \+x",
    ),
    "p02_gravity_up": Engine(
        "gravity upwards", [("w = self.m * self.g\n", "w = -self.m * self.g\n")], r"along \+z"
    ),
    "p03_phase_degrees": Engine(
        "azimuths taken as degrees",
        [(_PHASES, "np.radians(scene.phases)")],
        "azimuths .* taken as degrees",
    ),
    "p04_damping_twice": Engine(
        "pitch dampers twice",
        [(_LAW, "f[1:] = act - self.d * v - n[:, 2]")],
        "twice the dampers of the bearings",
    ),
    "p05_no_shaft_damping": Engine(
        "no shaft damper",
        [("self.D = scene.shaft_damping", "self.D = 0.0")],
        "without the damper of the shaft",
    ),
    "p06_pitch_torque_reacts": Engine(
        "pitch torques react on the rotor",
        [("f[0] = tau - self.D * w", "f[0] = tau - np.sum(torque) - self.D * w")],
        "pitch torques with reactions",
    ),
    "p07_torque_blade_index": Engine(
        "pitch torques at the next blade",
        [("a[0], a[1::2], a[2::2]", "a[0], np.roll(a[1::2], 1), a[2::2]")],
        "torque.pitch of the previous blade",
    ),
    "p08_no_gravity_on_pitch": Engine(
        "no gravity in the pitch equations",
        [(_LAW, "f[1:] = act - n[:, 2] - np.cross(self.r, self.weight(q + self.phase, th))[:, 2]")],
        "without gravity in the equations of the pitches",
    ),
    "p09_no_gyroscopic_term": Engine(
        "ω x J ω missing",
        [(" + np.cross(omega, L)\n        n -=", "\n        n -=")],
        "without the gyroscopic",
    ),
    "p10_gravity_at_axis": Engine(
        "weights on the pitch axes",
        [("n -= np.cross(self.r, self", "n -= np.cross(self.r * [0, 0, 1], self")],
        "weight of the blades on the pitch axes",
    ),
    "p11_bearing_of_blade_1": Engine(
        "bearing of blade 1 at all blades",
        [
            ("pair[0] for pair", "scene.bearings[0][0] for pair"),
            ("pair[1] for pair", "scene.bearings[0][1] for pair"),
        ],
        "bearing 1 at all blades|bearing.stiffness of blade 1 at all",
    ),
    "p12_phase_direction": Engine(
        "azimuths against the rotation",
        [(_PHASES, "-np.array(scene.phases)")],
        "numbered in the opposite sense",
    ),
    "p13_coupling_sign": Engine(
        "coupling in the mass matrix reversed",
        [("= Ja[i, 2]", "= -Ja[i, 2]")],
        "opposite sign of the coupling of rotor and pitches in the mass matrix",
    ),
    "p14_pitch_sense_in_gravity": Engine(
        "weight turned against the pitch",
        [("np.cos(th) * gx, -np.sin(th) * gx, gz", "np.cos(th) * gx, np.sin(th) * gx, gz")],
    ),
    "p15_rest_degrees": Engine(
        "rest angles taken as degrees",
        [("a[0], a[1::2], a[2::2]", "a[0], a[1::2], np.radians(a[2::2])")],
        "rest angles .* taken as degrees",
    ),
    "p16_gravity_9_8": Engine(
        "gravity of 9.8",
        [("self.g = scene.gravity", "self.g = 9.8 if scene.gravity else 0.0")],
        "gravity of 9.8 ",
    ),
    "p17_no_hub": Engine(
        "no hub",
        [("self.scene.hub_inertia + np.sum(a * Ja)", "np.sum(a * Ja)")],
        "without the hub's inertia",
    ),
    "p18_diagonal_inertia": Engine(
        "no products of inertia",
        [("np.array(b.inertia_tensor) +", "np.diag(np.diag(b.inertia_tensor)) +")],
        "products of inertia .* ignored",
    ),
    "p19_no_coupling_alpha": Engine(
        "term J α0 missing",
        [("n = (J @ alpha0[:, :, None])[:, :, 0] + np.cross(omega, L)", "n = np.cross(omega, L)")],
    ),
    "p20_hub_radius": Engine(
        "m z² twice on the shaft",
        [
            (
                "inertia + np.sum(a * Ja)",
                "inertia + np.sum(a * Ja) + np.sum(self.m * self.r[:, 2] ** 2)",
            )
        ],
    ),
}

NUMERICS = {
    "n01_last_stage": Engine(
        "last stage at half a step",
        [("k4 = f(t + h, y + h * k3, part)", "k4 = f(t + h / 2, y + h / 2 * k3, part)")],
        _ORDERED,
    ),
    "n02_loads_at_step_start": Engine(
        "loads of the step's start",
        [
            (
                "        f = self.dynamics\n",
                "        def f(_, y, part):\n            return self.dynamics(t, y, part)\n\n",
            )
        ],
        _ORDERED,
    ),
    "n03_linear_output": Engine(
        "rows by straight lines",
        [
            (
                "        angles, rates = rows",
                "        some = np.unique(np.append(np.arange(0, len(rows), 5), len(rows) - 1))\n "
                "       rows = np.stack([np.interp(time, time[some], column[some]) for column in "
                "rows.T], axis=1)\n        kept = {}\n        angles, rates = rows",
            )
        ],
        "linear interpolation",
    ),
    "n04_last_step_short": Engine(
        "steps rounded down, the rest lost",
        [
            (
                _ADVANCE[: _ADVANCE.index("        for i")],
                "        count, h = int((b - a) / self.step), self.step\n",
            )
        ],
        "motion is late|times late|row repeated",
    ),
    "n05_loose": Engine(
        "solve_ivp with its default tolerances",
        [
            _SOLVE_IVP,
            *_SETTINGS,
            (
                _ADVANCE,
                "        return solve_ivp(self.dynamics, (a, b), y, args=(part,)).y[:, -1]\n\n",
            ),
            (", " + _ORDER, ""),
        ],
        "tolerance|step",
    ),
    "n06_no_jumps": Engine(
        "steps across jumps, with the loads before",
        [
            (_PART_LOADS, "np.array(part.loads_at(min(t, part.end)))"),
            ("            t = part.start\n", "            t = self.time[i - 1]\n"),
            ("self.time[i] <= part.end + tiny:", "t < part.end - tiny:"),
            (
                (
                    "            if part.end - t > tiny:\n                y = self.advance(t, "
                    "part.end, y, part)\n"
                ),
                "",
            ),
        ],
        _LOAD,
    ),
    "n07_semi_implicit": Engine(
        "semi-implicit Euler declared of order 2",
        [(_STEP, _EULER), ("order=4", "order=2")],
        _ORDERED,
    ),
}

ROWS = {
    "r01_times": Engine(
        "times without the end point",
        [
            (
                "time = self.time[: len(rows)]",
                "time = np.linspace(0.0, self.scene.duration, self.scene.samples, endpoint=False)",
            )
        ],
        "not the scene's sample times",
    ),
    "r02_early": Engine(
        "stops at 90 % and reports success",
        [
            (
                "for n, part in enumerate(parts):\n",
                "for n, part in enumerate(parts):\n            if len(self.rows) > 0.9 * "
                "len(self.time):\n                break\n",
            ),
            ("while i < len(self.time) and", "while i < 0.9 * len(self.time) and"),
        ],
        "samples, although it reports success",
    ),
    "r03_kinetic_without_hub": Engine(
        "kinetic energy without the hub",
        [(" + 0.5 * self.scene.hub_inertia * w**2", "")],
        "kinetic energy: without the hub's inertia",
    ),
    "r04_tip_no_pitch": Engine(
        "tips without the pitch",
        [("self.to_base(turn, th, self.tip)", "self.to_base(turn, 0 * th, self.tip)")],
        "tips without the rotation by the pitch",
    ),
    "r05_loads_in_base": Engine(
        "root forces in the base frame",
        [
            (
                '"blade_root_force"].append(force)',
                '"blade_root_force"].append(self.to_base(turn, th, force))',
            )
        ],
        "blade root force: in the base frame",
    ),
    "r06_state_kept": Engine(
        "a second run starts from the end of the first",
        [
            ("y, parts = self.start.copy(),", "y, parts = self.start,"),
            ("return y + h / 6 *", "y += h / 6 *"),
            ("2 * k3 + k4)\n", "2 * k3 + k4)\n        return y\n"),
        ],
        "state kept between runs",
    ),
    "r07_rates_in_degrees": Engine(
        "rates in degrees per second",
        [(_RATES, "rows[:, : N + 1], np.degrees(rows[:, N + 1 : 2 * N + 2])\n")],
        "rates are in degrees per second",
    ),
    "r08_tips_reversed": Engine(
        "tips in reverse order",
        [("self.to_base(turn, th, self.tip)", "self.to_base(turn, th, self.tip)[::-1]")],
        "tips of the blades in reverse order",
    ),
    "r09_work_without_dampers": Engine(
        "work without the dampers",
        [
            ("            - self.D * w**2\n", ""),
            ("+ np.sum(torque * v - self.d * v**2)", "+ np.sum(torque * v)"),
        ],
        "the work of loads, commands or dampers is wrong",
    ),
    "r10_potential_sign": Engine(
        "energy of the weights with opposite sign",
        [("np.sum(self.m * self.g * height)", "-np.sum(self.m * self.g * height)")],
        "potential energy: opposite sign of the share of the weights",
    ),
    "r11_rates_finite_difference": Engine(
        "rates by backward differences",
        [
            (
                _RATES,
                "rows[:, : N + 1], rows[:, N + 1 : 2 * N + 2].copy()\n        rates[1:] = "
                "np.diff(angles, axis=0) / self.time[1]\n",
            )
        ],
        "backward differences",
    ),
    "r12_loads_of_blade_1": Engine(
        "root force of blade 1 for all",
        [('"blade_root_force"].append(force)', '"blade_root_force"].append(0 * force + force[0])')],
        "columns exchanged: blade root force 2 is blade root force 1, blade root force 3 is "
        "blade root force 1, blade root force 4 is blade root force 1, blade root force 5 is "
        "blade root force 1$",
    ),
    "r13_pitch_order": Engine(
        "pitches in reverse order of the blades",
        [
            (
                "return Trajectory(time, angles, rates, **kept)",
                "order = [0, *range(N, 0, -1)]\n        return Trajectory(time, angles[:, order], "
                "rates[:, order], **kept)",
            )
        ],
        # Where the pitches move alike, their moments tell the order.
        "pitches are in the reverse order|pitch actuator moment: of the blades in reverse order",
    ),
}

# The mistakes of an audit, in the engine of docs/your-engine.md; the last four in the other one.
GIVEN = {
    "b01_no_steiner": Engine(
        "Steiner's share missing",
        [("self.J += np.array([m *", "self.J += np.array([0 * m *")],
        "without Steiner's share",
        LAGRANGE,
    ),
    "b02_hub_per_blade": Engine(
        "hub once for each blade",
        [("scene.hub_inertia +", "len(q[1:]) * scene.hub_inertia +")],
        "hub's inertia once for each blade",
        LAGRANGE,
    ),
    "b03_rest_ignored": Engine(
        "rest angles ignored",
        [("(loads[2::2] - q[1:])", "(0 - q[1:])")],
        "without the rest angles",
        LAGRANGE,
    ),
    "b04_damper_to_ground": Engine(
        "dampers see the rotor's rate",
        [("self.d * v[1:]", "self.d * (v[1:] + 0.2 * v[0])")],
        "rate that the bearings' dampers see off by",
        LAGRANGE,
    ),
    "b05_product_sign": Engine(
        "products of inertia reversed",
        [
            (
                "        self.J += np",
                "        self.J = (2 * np.eye(3) - 1) * self.J\n        self.J += np",
            )
        ],
        "products of inertia with opposite sign",
        LAGRANGE,
    ),
    "b06_gyro_half": Engine(
        "half of the Coriolis terms",
        [("rotor -= 2 *", "rotor -= 1 *")],
        "half of the Coriolis",
        LAGRANGE,
    ),
    "b07_torque_held": Engine(
        "ramps held",
        [(_PART_LOADS, "np.array(part.loads_at(part.start))")],
        "ramps of loads held",
        LAGRANGE,
    ),
    "b08_wrong_tip": Engine(
        "tips 1 mm off",
        [
            (
                "self.to_base(turn, th, self.tip)",
                "self.to_base(turn, 0 * th, self.to_base(0 * th, th, self.tip) + [1e-3, 0, 0])",
            )
        ],
        "tips off by",
    ),
    "b09_energy_sign": Engine(
        "potential energy with opposite sign",
        [("np.sum(self.m * self.g * height) +", "-np.sum(self.m * self.g * height) -")],
        "potential energy: opposite sign",
    ),
    "b10_rates_lag": Engine("rates a row late", [_OBSERVED], "rates are a row late", LAGRANGE),
    "b12_only_three": Engine(
        "right for three blades alone",
        [(_PHASES, "np.arange(len(q) - 1) * 2 * np.pi / 3")],
        "blades at multiples of 120 degrees",
        LAGRANGE,
    ),
    "b13_work_without_damping": Engine(
        "work without the bearings' dampers",
        [("torque * v - self.d * v**2", "torque * v")],
        "the work of loads, commands or dampers is wrong",
    ),
    "b14_stale_load_jump": Engine(
        "loads stale after a jump",
        [(_PART_LOADS, "np.array(part.loads_at(t if t > part.start + 0.02 else part.start))")],
        _LOAD,
        LAGRANGE,
    ),
}

RIGHT = {
    "euler": Engine(
        "",
        [
            (_STEP, _EULER),
            ("number(1e-3", "number(1e-4"),
            (
                "import numpy as np\n",
                "import numpy as np\nfrom rotor_mbs.scenario.accuracy_bounds import Bound\n",
            ),
            (
                _ORDER,
                'order=1, fixed_step=True, bounds=(Bound("defect", "euler/rk4", 3e-4, "order 1"),'
                ' Bound("energy", "euler/rk4", 1e-2, "order 1"))',
            ),
        ],
    ),
    "heun": Engine(
        "",
        [
            (
                _STEP,
                (
                    "        k1 = f(t, y, part)\n        return y + h / 2 * (k1 + f(t + h, y + h * "
                    "k1, part))\n\n"
                ),
            ),
            ("number(1e-3", "number(1e-4"),
            ("order=4", "order=2"),
        ],
    ),
    "rk4": Engine("", []),
    "dop8": Engine(
        "",
        [
            ("import numpy as np\n", "import numpy as np\nfrom scipy.integrate import DOP853\n"),
            (_STEP, _DOP853),
            ("number(1e-3", "number(2e-3"),
            ("order=4", "order=8"),
        ],
    ),
    "dop_tol": Engine(
        "",
        [
            _SOLVE_IVP,
            *_SETTINGS,
            (
                _ADVANCE,
                '        return solve_ivp(self.dynamics, (a, b), y, "DOP853", args=(part,), '
                "rtol=1e-12, atol=1e-13)"
                ".y[:, -1]\n\n",
            ),
            (_ORDER, "order=8"),
        ],
    ),
    "document": Engine("", [], text=LAGRANGE),
}

BROKEN = {**PHYSICS, **NUMERICS, **ROWS, **GIVEN}
ENGINES = {**BROKEN, **RIGHT}


def reasons(checks: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Return the reasons of failed checks, each with the check that it was given for first."""
    given: dict[str, str] = {}
    for check in checks:
        if not check["passed"]:
            given.setdefault(check["hint"], f"{check['check']}, {check['scene']}")
    return given


def is_right(engine: Engine, reason: str) -> bool | None:
    """Return whether a reason names the engine's mistake; None if it names none."""
    if engine.reason and re.search(engine.reason, reason):
        return True
    return None if re.search(f"{NOT_FOUND}|{_CONSEQUENCE}", reason) else False


def examined(name: str, folder: Path) -> list[dict[str, Any]]:
    """Return the checks of an engine, from the folder if they are there.

    Parameters
    ----------
    name : of the engine.
    folder : has NAME.json, and the engine's file.
    """
    kept, file = folder / f"{name}.json", folder / f"{name}.py"
    if not kept.exists():
        file.write_text(ENGINES[name].source())
        command = [sys.executable, "-m", "rotor_mbs", "test-method", str(file), "--json", str(kept)]
        subprocess.run(command, check=False, capture_output=True)
    checks: list[dict[str, Any]] = json.loads(kept.read_text())
    return checks


class _HerePool:
    """A pool of no workers: what is submitted is computed at once."""

    def submit(self, _work: Any, task: Any, _limit_s: float) -> Future[Any]:
        done = Future[Any]()
        done.set_result(method_test._run(task))
        return done


def checks_of_first_scene(name: str, folder: Path) -> list[Check]:
    """Return the checks of an engine on the five blades alone; its file is written into the
    folder."""
    file = folder / f"{name}.py"
    file.write_text(ENGINES[name].source())
    (method,) = catalogue.check_names(str(file))
    examination = method_test._Examination(find_method(method), _HerePool(), 60.0)  # type: ignore[arg-type]
    examination._scene(method_test.five_blades(), 1.0)
    return examination._made


def as_records(checks: Sequence[Check]) -> list[dict[str, Any]]:
    """Return checks as `test-method --json` writes them."""
    records = []
    for check in checks:
        record = {
            "check": check.name,
            "scene": check.where.scene,
            "value": check.value,
            "bound": check.bound,
        }
        records.append(record | {"passed": check.passed, "hint": check.hint})
    return records


def table(folder: Path) -> str:
    """Return the document's tables, of the engines that have been examined."""
    broken, right = [], []
    named = wrong = 0
    for name, engine in ENGINES.items():
        places = [folder / f"{name}.json", folder / f"{name}.first.json"]
        place = next((place for place in places if place.exists()), None)
        if place is None:
            continue
        checks = json.loads(place.read_text())
        scenes = "first" if place == places[1] else "all"
        given = reasons(checks)
        if name in RIGHT:
            order = next((check["value"] for check in checks if check["check"] == "order"), None)
            shown = "" if order is None else f"at most {order:.2g} below what it claims"
            right.append(f"| {name} | {scenes} | {'passes' if not given else 'FAILS'} | {shown} |")
            continue
        verdicts = {reason: is_right(engine, reason) for reason in given}
        causes = [reason for reason, verdict in verdicts.items() if verdict] or [
            reason for reason, verdict in verdicts.items() if verdict is False
        ]
        is_named, is_wrong = True in verdicts.values(), False in verdicts.values()
        named, wrong = named + is_named, wrong + is_wrong
        word = "WRONG" if is_wrong else "right" if is_named else "none"
        cause = "; ".join(causes[:1]).replace("|", "/") or NOT_FOUND
        verdict = f"fails ({', '.join(sorted({where.split(',')[0] for where in given.values()}))})"
        verdict = verdict if given else "PASSES"
        broken.append(f"| {name} | {engine.mistake} | {scenes} | {verdict} | {cause} | {word} |")
    lines = [
        (
            f"{len(broken)} broken engines: {sum('PASSES' in line for line in broken)} pass, "
            f"{named} have the right cause,"
        ),
        f"{wrong} a wrong one, {len(broken) - named - wrong} none.",
        "",
        "| engine | mistake | scenes | verdict | cause named | right? |",
        "|---|---|---|---|---|---|",
        *broken,
        "",
        f"{len(right)} right engines:",
        "",
        "| engine | scenes | verdict | measured order |",
        "|---|---|---|---|",
        *right,
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--output", type=Path, help="the document, whose tables are replaced")
    parser.add_argument(
        "--first", action="store_true", help="by the first scene alone, in this process"
    )
    parser.add_argument(
        "--engines", default=",".join(ENGINES), help="names, separated by commas; '' for none"
    )
    arguments = parser.parse_args()
    arguments.folder.mkdir(exist_ok=True)
    for name in filter(None, arguments.engines.split(",")):
        print(name, flush=True)
        kept = arguments.folder / f"{name}.json"
        if arguments.first and not kept.exists():
            kept = arguments.folder / f"{name}.first.json"
            if not kept.exists():
                kept.write_text(
                    json.dumps(as_records(checks_of_first_scene(name, arguments.folder)))
                )
        checks = json.loads(kept.read_text()) if kept.exists() else examined(name, arguments.folder)
        for reason, at in reasons(checks).items():
            print(f"  {is_right(ENGINES[name], reason)}: {reason} ({at})", flush=True)
    if arguments.output is not None:
        text = arguments.output.read_text()
        kept = text[: text.index("<!-- tables -->")]
        arguments.output.write_text(f"{kept}<!-- tables -->\n\n{table(arguments.folder)}")


if __name__ == "__main__":
    main()
