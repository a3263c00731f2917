"""Wrong arguments of every public function: a wrong value is a line, a wrong type a TypeError of
the call itself."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import rotor_mbs as rm
from rotor_mbs.errors import InputError, MethodRefusal, StoreError
from rotor_mbs.testing import assert_agrees

METHOD = "lagrange/dop853"
VALUES: dict[str, Any] = {
    "None": None,
    "3": 3,
    "3.5": 3.5,
    "True": True,
    "text": "x",
    "bytes": b"x",
    "list": [],
    "dict": {},
    "object": object(),
    "nan": float("nan"),
    "inf": float("inf"),
    "-1": -1,
    "10**400": 10**400,
    "10**5000": 10**5000,  # Python converts no whole number of more than 4300 digits to text
    "NUL": "a\0b",
    "surrogate": "a\ud800b",
    "long": "x" * 10_000,
    "matrix": np.zeros((2, 2)),
    "empty": np.zeros(0),
}
NUMBERS = {"3", "3.5", "True"}
MAX_FRAMES = 2  # of this package: the function that was called, and what it calls first
MAX_LINE = 1500  # characters; the longest has the names of all methods


class World(NamedTuple):
    """What calls need: made once."""

    scene: rm.Scene
    run: rm.Run
    runs: rm.Results
    sweep: rm.Results
    modes: Any
    comparison: Any
    panels: Any
    arrays: dict[str, Any]


@pytest.fixture(scope="module")
def world() -> World:
    scene = rm.scene("paper/fig08").replace(
        duration=0.2, samples=11, outputs=["angles", "rates", "energy", "loads"], methods=[METHOD]
    )
    run = rm.run(scene, METHOD)
    arrays = {"time": run.time, "angles": run.angles, "rates": run.rates}
    return World(
        scene,
        run,
        rm.run(scene, [METHOD]),
        rm.sweep(scene, {"gravity": [9.0, 9.8]}, methods=[METHOD], samples=3),
        rm.modes(scene, [1.0]),
        rm.compare(arrays, scene),
        run.plot(),
        arrays,
    )


class Call(NamedTuple):
    """A call with one argument: names of the VALUES with which it returns; whether it looks
    something up by a key."""

    function: Callable[[World, Any], object]
    valid: set[str] = set()  # noqa: RUF012  (never changed)
    is_lookup: bool = False


def compared(world: World, **changes: Any) -> object:
    return rm.compare(world.arrays | changes, world.scene)


CALLS: dict[str, Call] = {
    "scenes folder": Call(lambda _, v: rm.scenes(v)),
    "scene name": Call(lambda _, v: rm.scene(v)),
    "load path": Call(lambda _, v: rm.load(v)),
    "open path": Call(lambda _, v: rm.open(v)),
    "Results path": Call(lambda _, v: rm.Results(v)),
    "Results scene": Call(lambda w, v: rm.Results(w.runs.path, v)),
    "run scene": Call(lambda _, v: rm.run(v, METHOD)),
    "run method": Call(lambda w, v: rm.run(w.scene, v), {"list", "dict", "empty"}),
    "run method file": Call(
        lambda w, v: rm.run(w.scene, [f"{v}.py"] if isinstance(v, str) else [v])
    ),
    "run methods": Call(lambda w, v: rm.run(w.scene, [v])),
    "run timeout": Call(lambda w, v: rm.run(w.scene, METHOD, timeout=v), {*NUMBERS, "inf"}),
    "run workers": Call(lambda w, v: rm.run(w.scene, METHOD, workers=v), {"3", "True"}),
    "run setting": Call(lambda w, v: rm.run(w.scene, METHOD, relative_tolerance=v), {"3", "3.5"}),
    "run choice": Call(lambda w, v: rm.run(w.scene, "exudyn_chain/generalized_alpha", node=v)),
    "sweep scene": Call(lambda _, v: rm.sweep(v, {"gravity": [9.8]})),
    "sweep parameters": Call(lambda w, v: rm.sweep(w.scene, v)),
    "sweep key": Call(lambda w, v: rm.sweep(w.scene, {v: [1.0]})),
    "sweep values": Call(lambda w, v: rm.sweep(w.scene, {"gravity": v})),
    "sweep value": Call(
        lambda w, v: rm.sweep(w.scene, {"gravity": [v]}, samples=2, outputs=[]), {"3", "3.5"}
    ),
    "sweep range": Call(lambda w, v: rm.sweep(w.scene, {"gravity": {"linear": v}})),
    "sweep methods": Call(lambda w, v: rm.sweep(w.scene, {"gravity": [9.8]}, methods=v)),
    "sweep output": Call(
        lambda w, v: rm.sweep(w.scene, {"gravity": [9.8]}, samples=2, output=v), {"None", "text"}
    ),
    # With parameters that are refused later: no worker is started.
    "sweep workers": Call(lambda w, v: rm.sweep(w.scene, {"gravity": ["a"]}, workers=v)),
    "sweep timeout": Call(lambda w, v: rm.sweep(w.scene, {"gravity": ["a"]}, timeout=v)),
    "sweep samples": Call(lambda w, v: rm.sweep(w.scene, {"gravity": [9.8]}, samples=v), {"3"}),
    "sweep outputs": Call(
        lambda w, v: rm.sweep(w.scene, {"gravity": [9.8]}, samples=2, outputs=v), {"list", "empty"}
    ),
    "sweep seed": Call(
        lambda w, v: rm.sweep(w.scene, {"gravity": [9.8]}, samples=2, seed=v), {"3"}
    ),
    "sweep settings": Call(
        lambda w, v: rm.sweep(w.scene, {"gravity": [9.8]}, samples=2, settings=v), {"dict"}
    ),
    "sweep unknown option": Call(lambda w, v: rm.sweep(w.scene, {"gravity": [9.8]}, speed=v)),
    "compare data": Call(lambda w, v: rm.compare(v, w.scene)),
    "compare time": Call(lambda w, v: compared(w, time=v)),
    "compare angles": Call(lambda w, v: rm.compare({"time": w.run.time, "angles": v}, w.scene)),
    "compare scene": Call(lambda w, v: rm.compare(w.arrays, v)),
    "compare columns": Call(lambda w, v: rm.compare(w.arrays, w.scene, columns=v), {"None"}),
    "compare column": Call(lambda w, v: rm.compare(w.arrays, w.scene, columns={"time": v})),
    "compare tolerance": Call(lambda w, v: rm.compare(w.arrays, w.scene, tolerance=v), NUMBERS),
    "compare timeout": Call(
        lambda w, v: rm.compare(w.arrays, w.scene, timeout=v), {*NUMBERS, "inf"}
    ),
    "modes scene": Call(lambda _, v: rm.modes(v)),
    # Bytes are whole numbers, a dictionary is gone through by its keys.
    "modes speeds": Call(lambda w, v: rm.modes(w.scene, v), {"bytes", "list", "dict", "empty"}),
    "modes speed": Call(lambda w, v: rm.modes(w.scene, [v]), {*NUMBERS, "-1"}),
    "export scene": Call(lambda _, v: rm.export(v, "mjcf", "scene.xml")),
    "export to": Call(lambda w, v: rm.export(w.scene, v, "scene.xml")),
    "export output": Call(lambda w, v: rm.export(w.scene, "mjcf", v), {"text"}),
    "assert_agrees time": Call(lambda w, v: assert_agrees(v, w.run.angles, scene=w.scene)),
    "assert_agrees angles": Call(lambda w, v: assert_agrees(w.run.time, v, scene=w.scene)),
    "assert_agrees scene": Call(lambda w, v: assert_agrees(w.run.time, w.run.angles, scene=v)),
    "assert_agrees tolerance": Call(
        lambda w, v: assert_agrees(w.run.time, w.run.angles, scene=w.scene, tolerance=v), NUMBERS
    ),
    "Run item": Call(lambda w, v: w.run[v], is_lookup=True),
    "Run loads": Call(lambda w, v: w.run.plot.loads(v)),
    "plot save": Call(lambda w, v: w.panels.save(v)),
    "plot save ending": Call(
        lambda w, v: w.panels.save(f"{v}.png" if isinstance(v, str) else v), {"text"}
    ),
    "Results item": Call(lambda w, v: w.runs[v], is_lookup=True),
    "Results item of a sweep": Call(lambda w, v: w.sweep[v], {"True"}, is_lookup=True),
    "Results column": Call(lambda w, v: w.sweep.column(v)),
    "Results column, no sweep": Call(lambda w, v: w.runs.column(v)),
    "Results at name": Call(lambda w, v: w.sweep.at(v, 0)),
    "Results at sample": Call(lambda w, v: w.sweep.at("angles", v), {"True", "-1"}),
    "Results save": Call(lambda w, v: w.runs.save(v), {"text"}),
    "Results to_html": Call(lambda w, v: w.runs.to_html(v), {"text"}),
    "Modes to_xarray": Call(lambda w, v: w.modes.to_xarray(v)),
    "Modes save": Call(lambda w, v: w.modes.save(v), {"text"}),
    "Modes to_html": Call(lambda w, v: w.modes.to_html(v), {"text"}),
    "DataComparison save": Call(lambda w, v: w.comparison.save(v), {"text"}),
    "DataComparison to_html": Call(lambda w, v: w.comparison.to_html(v), {"text"}),
    "Scene torque_at": Call(
        lambda w, v: w.scene.torque_at(v), {*NUMBERS, "nan", "inf", "-1", "10**400", "10**5000"}
    ),
    "replace gravity": Call(lambda w, v: w.scene.replace(gravity=v), {"3", "3.5"}),
    "replace title": Call(lambda w, v: w.scene.replace(title=v), {"text"}),
    "replace figures": Call(lambda w, v: w.scene.replace(figures=v), {"list", "empty"}),
    "replace outputs": Call(lambda w, v: w.scene.replace(outputs=v)),
    "replace samples": Call(lambda w, v: w.scene.replace(samples=v), {"3"}),
    "replace blade": Call(lambda w, v: w.scene.replace(blade=v)),
    "replace angles": Call(lambda w, v: w.scene.replace(**{"initial.angles": v})),
    "replace angle": Call(
        lambda w, v: w.scene.replace(**{"initial.angles[1]": v}), {"3", "3.5", "-1"}
    ),
    "replace torque": Call(
        lambda w, v: w.scene.replace(**{"torque.rotor": v}), {"3", "3.5", "-1", "matrix"}
    ),
    "replace settings": Call(lambda w, v: w.scene.replace(settings=v), {"dict"}),
    "replace unknown key": Call(lambda w, v: w.scene.replace(speed=v)),
}


def frames(error: BaseException) -> list[str]:
    """Names of the functions of this package on the way to an error; a comprehension, and a
    recursion, are none."""
    package = str(Path(rm.__file__).parent)
    found = traceback.extract_tb(error.__traceback__)
    names = [
        frame.name
        for frame in found
        if frame.filename.startswith(package) and not frame.name.startswith("<")
    ]
    return list(dict.fromkeys(names))


SLOW = ("Results to_html", "run method")  # draws a report; computes references


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.full if name in SLOW else ()) for name in CALLS]
)
def test_a_wrong_argument_is_a_line_or_a_type_error_of_the_call(
    name: str, world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    call = CALLS[name]
    problems, returned = [], set()
    for kind, value in VALUES.items():
        try:
            call.function(world, value)
            returned.add(kind)
        except (InputError, StoreError, MethodRefusal) as error:
            if max(map(len, str(error).splitlines())) > MAX_LINE:
                problems.append(f"{kind}: a line of {len(str(error))} characters")
        except TypeError as error:
            if len(frames(error)) > MAX_FRAMES:
                problems.append(f"{kind}: {' > '.join(frames(error))}: {error}")
        except Exception as error:
            if not (call.is_lookup and type(error) is KeyError):
                problems.append(
                    f"{kind}: {' > '.join(frames(error))}: {type(error).__name__} "
                    f"{str(error)[:200]}"
                )
    assert not problems, "\n".join(problems)
    assert returned == call.valid
