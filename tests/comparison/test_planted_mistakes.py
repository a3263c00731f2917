"""Mistakes that people make, planted in trajectories of a code of its own: each is named or
refused, none is ok."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from support import other_code
from support.checking import with_wrong_number
from support.other_code import Mistakes

import rotor_mbs as rm
from rotor_mbs.scenario.scene import Scene

Array = Any
DURATION = 2.0
ROWS = 201


JUMP = 5e4  # N m, at 0.5 s


def steps(*rows: tuple[float, float]) -> tuple[tuple[float, float], ...]:
    """A table that jumps to each value at its time, from 0 on."""
    value, table = 0.0, [(0.0, 0.0)]
    for time, following in rows:
        table += [(time, value), (time, following)]
        value = following
    return tuple(table)


@functools.cache
def short(name: str) -> Scene:
    """A shipped scene; "driven": fig. 11 with a torque that jumps; "sprung": that with three
    different bearings; "ramped", "two ramps": fig. 11 with loads that grow."""
    own = ("driven", "sprung", "ramped", "two ramps")
    shipped = "paper/fig11" if name in own else name
    scene = replace(rm.scene(shipped), duration=DURATION, samples=ROWS)
    if name in ("driven", "sprung"):
        scene = replace(scene, rotor_torque=steps((0.5, JUMP)))
    if name == "two ramps":  # with rows at times of their own
        rotor = ((0.0, 0.0), (1.0, JUMP), (DURATION, -JUMP))
        pitch = ((0.0, 0.0), (0.3, 30.0), (1.4, -30.0), (DURATION, 10.0))
        return replace(scene, rotor_torque=rotor, pitch_torque=(pitch, (), ()))
    if name == "ramped":
        scene = replace(rm.scene("paper/fig11"), duration=DURATION, samples=ROWS)
        return replace(scene, rotor_torque=((0.0, 0.0), (DURATION, JUMP)))
    if name == "sprung":
        scene = replace(
            scene, bearing_stiffness=(6e3, 5e3, 8e3), bearing_damping=(300.0, 500.0, 400.0)
        )
    return scene


@dataclass(frozen=True)
class Plant:
    """Data of a code with a mistake, compared with `scene`, and what names or refuses it.

    changed     the scene that the code has in place of the right one
    mistakes    in its equations
    spoilt      (time, angles, rates) -> the same, after the run
    """

    says: str
    scene: str = "paper/fig11"
    changed: Callable[[Scene], Scene] = lambda scene: scene
    mistakes: Mistakes = other_code.NONE
    spoilt: Callable[[Array, Array, Array], tuple[Array, Array, Array]] = lambda *arrays: arrays
    with_rates: bool = True

    def data(self) -> dict[str, Array]:
        time = np.linspace(0.0, DURATION, ROWS)
        angles, rates = _run(self.scene, self.changed, self.mistakes)
        time, angles, rates = self.spoilt(time, angles.copy(), rates.copy())
        return {"time": time, "angles": angles} | ({"rates": rates} if self.with_rates else {})


@functools.cache
def _run(name: str, changed: Callable[[Scene], Scene], mistakes: Mistakes) -> tuple[Array, Array]:
    return other_code.trajectory(changed(short(name)), np.linspace(0.0, DURATION, ROWS), mistakes)


def off(number: str, share: float) -> Callable[[Scene], Scene]:
    return lambda scene: with_wrong_number(scene, number, share)


def pitched(angle: float) -> Callable[[Scene], Scene]:
    """Blades whose pitch is counted from where it should be `angle`: the mass point is elsewhere at
    pitch 0."""

    def changed(scene: Scene) -> Scene:
        x, _, z = scene.blades[0].centre_of_mass
        moved = replace(scene.blades[0], centre_of_mass=(x * np.cos(angle), x * np.sin(angle), z))
        return replace(scene, blades=(moved,) * len(scene.blades))

    return changed


def reversed_c(scene: Scene) -> Scene:
    first, second, *others = scene.blades
    x, y, z = second.centre_of_mass
    return replace(scene, blades=(first, replace(second, centre_of_mass=(-x, y, z)), *others))


def with_gravity(value: float) -> Callable[[Scene], Scene]:
    return lambda scene: replace(scene, gravity=value)


def columns(*order: int) -> Callable[[Array, Array, Array], tuple[Array, Array, Array]]:
    return lambda time, angles, rates: (time, angles[:, order], rates[:, order])


def wrapped(angles: Array) -> Array:
    return (angles + np.pi) % (2.0 * np.pi) - np.pi


def noise(size: float) -> Callable[[Array, Array, Array], tuple[Array, Array, Array]]:
    drawn = np.random.default_rng(15).normal(0.0, size, (2, ROWS, 4))
    return lambda time, angles, rates: (time, angles + drawn[0], rates + drawn[1])


# Faults at a time


def with_row(
    row: int, angles: int, off: float = 0.0
) -> Callable[[Array, Array, Array], tuple[Array, Array, Array]]:
    """The numbers of a row are those of another, its second pitch off."""

    def spoilt(time: Array, q: Array, w: Array) -> tuple[Array, Array, Array]:
        q[row], w[row] = q[angles], w[angles]
        q[row, 2] += off
        return time, q, w

    return spoilt


def rows(*chosen: int) -> Callable[[Array, Array, Array], tuple[Array, Array, Array]]:
    """These rows at the times of the first ones."""
    return lambda time, q, w: (time[: len(chosen)], q[[*chosen]], w[[*chosen]])


def kicked(time: Array, q: Array, w: Array) -> tuple[Array, Array, Array]:
    """From row 30 on the motion from a rate that is wrong there."""
    start = w[30] + [0.0, 0.0, 1e-3, 0.0]
    after = replace(
        short("driven"),
        rotor_torque=steps((0.2, JUMP)),
        initial_angles=tuple(q[30]),
        initial_rates=tuple(start),
    )
    then, rates = other_code.trajectory(after, time[30:] - time[30])
    return time, np.vstack([q[:30], then]), np.vstack([w[:30], rates])


def driven(*table: tuple[float, float]) -> Callable[[Scene], Scene]:
    return lambda scene: replace(scene, rotor_torque=steps(*table))


# What programs make of right rows


def late(values: Array, *columns: int) -> Array:
    """Some columns a row late."""
    shifted = values.copy()
    shifted[1:, columns] = values[:-1, columns]
    return shifted


def between(degree: int) -> Callable[[Array, Array, Array], tuple[Array, Array, Array]]:
    """Every fifth row, and what interpolation puts between."""

    def spoilt(time: Array, q: Array, w: Array) -> tuple[Array, Array, Array]:
        knots = slice(0, None, 5)
        return (
            time,
            *(make_interp_spline(time[knots], values[knots], degree)(time) for values in (q, w)),
        )

    return spoilt


def interval_means(time: Array, *_: Array) -> tuple[Array, Array, Array]:
    """Of ten samples of the interval before each row."""
    fine = other_code.trajectory(
        short("paper/fig11"), np.linspace(0.0, DURATION, 10 * (ROWS - 1) + 1)
    )
    means = [
        np.vstack([values[:1], values[1:].reshape(ROWS - 1, 10, 4).mean(axis=1)]) for values in fine
    ]
    return time, means[0], means[1]


def in_steps(values: Array, step: float = 2.0 * np.pi / 4096) -> Array:
    return np.round(values / step) * step


def half(values: Array) -> Array:
    return values.astype(np.float16).astype(float)


def single_clock(time: Array, q: Array, w: Array) -> tuple[Array, Array, Array]:
    steps = np.append(np.float32(0.0), np.full(len(time) - 1, np.float32(0.01)))
    return np.cumsum(steps, dtype=np.float32).astype(float), q, w


def held_tables(scene: Scene) -> Scene:
    """Each load keeps the value of a row of its own table until the next."""

    def held(table: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        return steps(*table) if table else ()

    return replace(
        scene,
        rotor_torque=held(scene.rotor_torque),
        pitch_torque=tuple(map(held, scene.pitch_torque)),
    )


def held_ramp(scene: Scene) -> Scene:
    """The torque of every row until the next one, as a controller gives it."""
    rows = np.linspace(0.0, DURATION, ROWS)
    values = np.interp(rows, *np.array(scene.rotor_torque).T)
    return replace(scene, rotor_torque=steps(*zip(rows.tolist(), values.tolist(), strict=True)))


THIRD = 2.0 * np.pi / 3.0
QUARTER = np.array([np.pi / 2.0, 0.0, 0.0, 0.0])
# Scenes: those in which the mistake changes the motion.
PLANTS = {
    "degrees": Plant(
        "degrees taken as rad", spoilt=lambda t, q, w: (t, np.degrees(q), np.degrees(w))
    ),
    "sign of pitch": Plant(
        "sign reversed",
        spoilt=lambda t, q, w: (t, q * [1, -1, -1, -1], w * [1, -1, -1, -1]),
    ),
    "another zero": Plant("rotor: zero off by 1.5708", spoilt=lambda t, q, w: (t, q + QUARTER, w)),
    "a factor": Plant(
        "too large by a factor of 1.001", spoilt=lambda t, q, w: (t, 1.001 * q, 1.001 * w)
    ),
    "blade order": Plant("columns exchanged: pitch 1 is pitch 3", spoilt=columns(0, 3, 1, 2)),
    "phase": Plant(
        "blades numbered in the opposite sense", mistakes=Mistakes(phases=(0.0, 2.0 * THIRD, THIRD))
    ),
    "blade 2 a little off": Plant(
        "azimuth of blade 2 off by +0.05 rad",
        mistakes=Mistakes(phases=(0.0, THIRD + 0.05, 2.0 * THIRD)),
    ),
    "no phases": Plant(
        "all blades at the azimuth of blade 1", mistakes=Mistakes(phases=(0.0, 0.0, 0.0))
    ),
    "phases in degrees": Plant(
        "azimuths of the blades in degrees taken as rad",
        mistakes=Mistakes(phases=(0.0, 120.0, 240.0)),
    ),
    "blade 1 down": Plant(
        "blade 1 at an azimuth of 180 degrees where it is 0",
        mistakes=Mistakes(phases=(np.pi, np.pi + THIRD, np.pi + 2.0 * THIRD)),
    ),
    "pitch from flat": Plant(
        "pitch angles from another zero: 90 degrees where they are 0", changed=pitched(np.pi / 2.0)
    ),
    # the paper's A and B are its mass point's place: atan2(B, A) is in its pitch zero
    "pitch from the chord": Plant(
        "zero of the pitch of all blades off by +0.3588 rad",
        changed=pitched(np.arctan2(0.03, 0.08)),
    ),
    "gravity": Plant("gravity of 9.81 m/s^2", changed=with_gravity(9.81)),
    "mass 1 % off, driven": Plant(
        "blade.mass off by +1 %", "paper/fig15-10kNm", changed=off("mass", 0.01)
    ),
    "c 1 % off": Plant("blade.centre_of_mass[0] off by +1 %", changed=off("offset", 0.01)),
    "missing Coriolis": Plant("without the Coriolis terms", mistakes=Mistakes(coriolis=0.0)),
    "E1": Plant("erratum E1 of", mistakes=Mistakes(e1=True)),
    "E2": Plant("erratum E2 of", mistakes=Mistakes(e2=True)),
    "as printed": Plant(
        "erratum E1 and E2 and E3 of", mistakes=Mistakes(e1=True, e2=True, e3=True)
    ),
    "one sample late": Plant(
        "a constant lag of 0.01 s, 1 rows (late)",
        spoilt=lambda t, q, w: (t, np.vstack([q[:1], q[:-1]]), np.vstack([w[:1], w[:-1]])),
    ),
    "half a sample late": Plant(
        "a constant lag of 0.005 s (late)", spoilt=lambda t, q, w: (t + 0.005, q, w)
    ),
    "time in ms": Plant("time in ms taken as s", spoilt=lambda t, q, w: (1e3 * t, q, w)),
    "numbers of rows": Plant(
        "row numbers taken as s", spoilt=lambda t, q, w: (np.arange(1.0 * len(t)), q, w)
    ),
    "wrapped": Plant(
        "wrapped, taken as unwrapped", "paper/fig12", spoilt=lambda t, q, w: (t, wrapped(q), w)
    ),
    "rates as angles": Plant(
        "rotor is rotor rate, pitch 1 is pitch 1 rate",
        with_rates=False,
        spoilt=lambda t, q, w: (t, w, q),
    ),
    "noise": Plant("scatter from row to row, standard deviation 1", spoilt=noise(1e-4)),
    "truncated": Plant(
        "the data end at t = 1.49 s of 2 s", spoilt=lambda t, q, w: (t[:150], q[:150], w[:150])
    ),
    "late": Plant("begin at t = 0.6 s", spoilt=lambda t, q, w: (t[60:], q[60:], w[60:])),
    "another scene": Plant("the scene paper/fig09", changed=lambda _: short("paper/fig09")),
    "from the end, rates turned": Plant(
        "time reversed; and rotor rate, pitch 1 rate, pitch 2 rate, pitch 3 rate: sign reversed",
        spoilt=lambda t, q, w: (t, q[::-1], -w[::-1]),
    ),
    "a second late": Plant("`offset = -1` of the time", spoilt=lambda t, q, w: (t + 1.0, q, w)),
    "a stuck row": Plant(
        "a stuck row, or one at a wrong time: row 41, t = 0.4 s", "driven", spoilt=with_row(40, 39)
    ),
    "an outlier": Plant(
        "a single wrong row: row 41, t = 0.4 s", "driven", spoilt=with_row(40, 40, 1e-3)
    ),
    "a row repeated": Plant(
        "a row repeated, or times late by less than an interval, at t = 0.31 s",
        "driven",
        spoilt=rows(*range(31), *range(30, 200)),
    ),
    "a clock that goes on": Plant(
        "a row repeated, or times late by less than an interval, at t = 0.314 s",
        "driven",
        spoilt=lambda t, q, w: (t + 0.004 * (np.arange(ROWS) > 30), q, w),
    ),
    "a row left out": Plant(
        (
            "a row omitted and the others renumbered, or times early by less than an interval, at "
            "t = 0.31 s"
        ),
        "driven",
        spoilt=rows(*range(31), *range(32, 101)),
    ),
    "a wrong rate": Plant(
        "a jump of rates, or a load of one interval, before t = 0.3 s", "driven", spoilt=kicked
    ),
    "a load of an interval": Plant(
        "a jump of rates, or a load of one interval, before t = 0.31 s",
        "driven",
        changed=driven((0.3, JUMP), (0.31, 0.0), (0.5, JUMP)),
    ),
    "a late edge": Plant(
        "loads late by 0.01 s",  # the scene has no other edge
        "driven",
        changed=driven((0.51, JUMP)),
    ),
    "smoothed over three rows": Plant(
        "the load on the rotor is smoothed over its jump at t = 0.5 s",
        "driven",
        changed=driven((0.49, JUMP / 3.0), (0.5, 2.0 * JUMP / 3.0), (0.51, JUMP)),
    ),
    "missing": Plant(
        "a load that is wrong or missing from t = 0.7 to 0.8 s: on average -5e+04 N m on the rotor",
        "driven",
        changed=driven((0.5, JUMP), (0.7, 0.0), (0.8, JUMP)),
    ),
    "two loads at once": Plant(
        (
            "wrong or missing from t = 0.7 to 0.8 s: on average +5e+04 N m on the rotor and +100 N "
            "m on the pitch 3"
        ),
        "driven",
        changed=lambda scene: replace(
            driven((0.5, JUMP), (0.7, 2.0 * JUMP), (0.8, JUMP))(scene),
            pitch_torque=(steps(), steps(), steps((0.7, 100.0), (0.8, 0.0))),
        ),
    ),
    "damping of one bearing": Plant(
        "bearing.damping[0] off by +10 % (uncertainty ",
        "sprung",
        changed=lambda scene: replace(scene, bearing_damping=(330.0, 500.0, 400.0)),
    ),
    "bearings exchanged": Plant(
        "bearing.damping of blades 1 and 2 exchanged",
        "sprung",
        changed=lambda scene: replace(scene, bearing_damping=(500.0, 300.0, 400.0)),
    ),
    "c of a blade reversed": Plant(
        "blade[1].centre_of_mass[0] with opposite sign", changed=reversed_c
    ),
    "rest angle": Plant(
        "bearing.rest off by -0.1 rad (uncertainty ",
        "sprung",
        changed=lambda scene: replace(scene, bearing_rest=(((0.0, -0.1),),) * 3),
    ),
    "central differences": Plant(
        "pitch 3 rate: differences of the angles over two intervals, around each row",
        spoilt=lambda t, q, _: (t, q, np.gradient(q, t, axis=0)),
    ),
    "backward differences": Plant(
        "the mean over the interval before each row",
        spoilt=lambda t, q, w: (t, q, np.vstack([w[:1], np.diff(q, axis=0) / np.diff(t)[:, None]])),
    ),
    "rates a row late": Plant(
        "pitch 3 rate: a row late", spoilt=lambda t, q, w: (t, q, late(w, 0, 1, 2, 3))
    ),
    "rotor a row late": Plant("rotor: a row late", spoilt=lambda t, q, w: (t, late(q, 0), w)),
    "rows held": Plant(
        "every row is held for 5 rows",
        spoilt=lambda t, q, w: (t, q[np.arange(ROWS) // 5 * 5], w[np.arange(ROWS) // 5 * 5]),
    ),
    "interpolated": Plant("interpolated linearly between every 5 rows", spoilt=between(1)),
    "a spline": Plant("interpolated by a cubic spline between every 5 rows", spoilt=between(3)),
    "moving average": Plant(
        "mean of 5 rows around each row", spoilt=lambda *arrays: averaged(*arrays)
    ),
    "averaged and decimated": Plant(
        "mean of 10 samples of the interval before each row", spoilt=interval_means
    ),
    "encoder": Plant(
        "rounded to steps of 0.00153398 rad, 4096 a turn",
        spoilt=lambda t, q, w: (t, in_steps(q), w),
    ),
    "half precision": Plant(
        "numbers of half precision", spoilt=lambda t, q, w: (t, half(q), half(w))
    ),
    "a fast clock": Plant("a clock that is 0.1 % fast", spoilt=lambda t, q, w: (1.001 * t, q, w)),
    "a clock of single precision": Plant(
        "times are sums of 0.01 s in single precision", spoilt=single_clock
    ),
    "loads held": Plant("loads held from each row to the next", "ramped", changed=held_ramp),
    "tables held": Plant(
        "loads held from row to row of their tables", "two ramps", changed=held_tables
    ),
    "gravity and c": Plant(
        "gravity off by -1 % (uncertainty",
        changed=lambda scene: off("offset", 0.01)(off("gravity", -0.01)(scene)),
    ),
}
# One of each kind: in the columns, in time, in the scene, at a time. The others carry the mark
# full.
FAST = {
    "rotor a row late",
    "rows held",
    "degrees",
    "blade order",
    "truncated",
    "one sample late",
    "gravity",
    "missing",
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in FAST else pytest.mark.full) for name in PLANTS]
)
def test_a_mistake_is_named(name: str) -> None:
    plant = PLANTS[name]
    comparison = rm.compare(plant.data(), short(plant.scene))
    assert comparison.status != "ok"
    assert any(plant.says in text for text in (comparison.message, *comparison.likely)), (
        comparison.likely
    )


@pytest.mark.parametrize("with_rates", [False, True])
def test_exchanged_columns_in_degrees_are_two_mistakes(*, with_rates: bool) -> None:
    """Neither of them alone explains the data."""
    _, angles, rates = columns(0, 1, 3, 2)(*Plant("").data().values())
    data = {"time": np.linspace(0.0, DURATION, ROWS), "angles": np.degrees(angles)}
    expected = [
        "rotor, pitch 1, pitch 2, pitch 3: degrees taken as rad",
        "columns exchanged: pitch 2 is pitch 3, pitch 3 is pitch 2",
    ]
    if with_rates:
        data["rates"] = np.degrees(rates)
        expected[1:] = [
            "rotor rate, pitch 1 rate, pitch 2 rate, pitch 3 rate: deg/s taken as rad/s",
            f"{expected[1]}, pitch 2 rate is pitch 3 rate, pitch 3 rate is pitch 2 rate",
        ]
    comparison = rm.compare(data, short("paper/fig11"))
    assert (comparison.status, list(comparison.likely)) == ("inaccurate", expected)


def test_exchanged_columns_in_degrees_are_not_named_where_a_blade_is_wrong() -> None:
    data = Plant("", changed=off("mass", 0.05), scene="paper/fig15-10kNm").data()
    data |= {name: np.degrees(data[name]) for name in ("angles", "rates")}
    data["angles"][:, 1] += np.linspace(0.0, 3.0, ROWS)  # deg: the motion of no blade
    comparison = rm.compare(data, short("paper/fig15-10kNm"))
    assert comparison.status == "inaccurate"
    assert not any("exchanged" in text for text in comparison.likely), comparison.likely


def test_what_is_within_the_tolerance_but_not_random_is_named() -> None:
    """A mass that the motion cannot tell from a torque: both are named, also where the tolerance
    allows it."""
    data, scene = (
        Plant("", "paper/fig15-10kNm", changed=off("mass", 0.01)).data(),
        short("paper/fig15-10kNm"),
    )
    comparison = rm.compare(data, scene, tolerance=1e-3)
    assert comparison.status == "ok"
    for cause in ("blade.mass off by +1 %", "torque.rotor off by -0.9901 %"):
        assert any(text.startswith(f"{cause} (uncertainty ") for text in comparison.likely)
    assert any("times what the digits" in note for note in comparison.verdict.notes)


def test_data_of_another_time_are_refused() -> None:
    """What no file can have, a NaN, a time twice, is in tests/comparison."""
    late = Plant("", spoilt=lambda t, q, w: (t + 10.0, q, w)).data()
    with pytest.raises(rm.InputError, match="`offset = -10` of the time"):
        rm.compare(late, short("paper/fig11"))
    found = rm.compare(PLANTS["time in ms"].data(), short("paper/fig11"))
    assert found.message.startswith(
        f"1 of {ROWS} rows within the 2 s of paper/fig11; is the time in s? "
    )


@pytest.mark.parametrize(
    "scene", ["paper/fig11", pytest.param("check/general", marks=pytest.mark.full)]
)
def test_a_true_run_with_the_noise_of_rounding_is_ok(scene: str) -> None:
    comparison = rm.compare(Plant("", scene, spoilt=noise(1e-12)).data(), short(scene))
    assert (comparison.status, comparison.likely) == ("ok", ())


@pytest.mark.full
def test_a_hub_that_is_too_light_is_not_named_as_a_missing_one() -> None:
    """A mistake of the same kind but another size leaves less than the tolerance, and a multiple
    of the missing hub's effect explains it."""

    def light(scene: Scene) -> Scene:
        return replace(scene, hub_inertia=0.03 * scene.hub_inertia)

    data = Plant("", "check/general", changed=light).data()
    comparison = rm.compare(data, short("check/general"), tolerance=1e-5)
    assert comparison.status == "inaccurate"
    assert not any("without" in text for text in comparison.likely), comparison.likely


def faster_at_first(time: Array, q: Array, w: Array) -> tuple[Array, Array, Array]:
    """Errors of every interval, which are large up to 0.6 s and within the tolerance later."""
    sizes = np.where(time < 0.6, 2e-5, 3e-7)
    q[:, 1] += sizes * (-1.0) ** np.arange(len(time))
    return time, q, w


def test_errors_that_become_smaller_are_no_fault_at_a_time() -> None:
    data = Plant("", spoilt=faster_at_first).data()
    comparison = rm.compare(data, short("paper/fig11"))
    assert comparison.status == "inaccurate"
    assert not any("a fault" in text for text in comparison.likely), comparison.likely


def averaged(time: Array, *arrays: Array) -> tuple[Array, Array, Array]:
    """A filter leaves the first and the last two rows as they were: the largest defects are
    there."""
    angles, rates = (
        np.vstack([a[:2], sum(a[i : len(a) - 4 + i] for i in range(5)) / 5.0, a[-2:]])
        for a in arrays
    )
    return time, angles, rates


WRONG_IN_ALL_ROWS = {
    "averaged": averaged,
    "rates by differences": lambda t, q, _: (t, q, np.gradient(q, t, axis=0)),
    "a sine": lambda t, q, w: (t, q + 1e-3 * np.sin(7.0 * t)[:, None], w),
}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(one, marks=() if one == "averaged" else pytest.mark.full)
        for one in WRONG_IN_ALL_ROWS
    ],
)
def test_what_is_wrong_in_all_rows_is_no_fault_at_a_time(name: str) -> None:
    comparison = rm.compare(
        Plant("", "driven", spoilt=WRONG_IN_ALL_ROWS[name]).data(), short("driven")
    )
    assert comparison.status == "inaccurate"
    assert not any(" t = " in text for text in comparison.likely), comparison.likely


@pytest.mark.full
def test_e3_alone_is_no_mistake() -> None:
    """The power of a term whose coefficient is zero unless E2 is in."""
    assert rm.compare(Plant("", mistakes=Mistakes(e3=True)).data(), short("paper/fig11")).agrees
