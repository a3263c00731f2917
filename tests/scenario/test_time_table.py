"""Loads over time: segments against the tables they are cut from, and where engines stop."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import (
    ROTOR_TORQUE,
    LoadTable,
    constant_value,
    intervals,
    rest_place,
    segments,
    steps_and_rows,
    torque_place,
    value_at,
    values_at,
    values_before,
)

CONSTANT: LoadTable = ((0.0, 7.0),)
RAMP: LoadTable = ((0.3, 0.0), (0.47, 2.0), (0.47, 5.0), (0.8, 1.0))


def drawn_table(chance: random.Random) -> LoadTable:
    """Rows at tenths of a second, so that some of them are jumps."""
    times = sorted(chance.choices([k / 10.0 for k in range(12)], k=chance.randint(1, 6)))
    times = [t for i, t in enumerate(times) if i < 2 or times[i - 2] < t]
    return tuple((t, chance.choice([-3.0, 0.0, 1.5, chance.uniform(-1e3, 1e3)])) for t in times)


def test_segments_have_the_values_of_their_tables() -> None:
    """At a jump those of the side they are on; 2e-16 of the largest value is its last digit, 20 of
    them a bound."""
    chance = random.Random(7)
    for _ in range(200):
        tables = [drawn_table(chance) for _ in range(3)] + [()]
        parts = segments(tables, 1.0)
        assert [parts[0].start, *(part.end for part in parts)] == [
            *(part.start for part in parts),
            1.0,
        ]
        for part in parts:
            for share in (0.0, 0.37, 0.999):
                time = part.start + share * (part.end - part.start)
                exact = [value_at(table, time) for table in tables]
                assert part.loads_at(time) == pytest.approx(exact, rel=4e-15, abs=4e-12)
            before = [value_at(table, math.nextafter(part.end, 0.0)) for table in tables]
            assert part.loads_at(part.end) == pytest.approx(before, rel=4e-15, abs=1e-11)


def test_values_at_many_times_have_the_bits_of_those_at_one() -> None:
    """Before, at, between and after the rows; stored results depend on it."""
    chance = random.Random(11)
    for _ in range(200):
        table = drawn_table(chance)
        rows = [time for time, _ in table]
        times = [*rows, *(math.nextafter(time, 0.0) for time in rows), -0.1, 1.3, math.nan]
        times += [chance.uniform(-0.1, 1.3) for _ in range(20)]
        at_once = values_at(table, np.array(times))
        assert at_once.tobytes() == np.array([value_at(table, time) for time in times]).tobytes()
    assert values_at((), np.array([0.0, 1.0])).tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    "scene",
    find_scenes(["check/loads", "check/pitch-loads", "check/general"]),
    ids=lambda s: s.name,
)
def test_each_load_of_a_scene_is_at_its_place(scene: Scene) -> None:
    """Against the keys of the scene file, not the tables that the segments are cut from; bounds as
    above."""
    pitches = range(1, 1 + len(scene.blades))
    torques = {
        pitch: scene.pitch_torque[pitch - 1] if scene.pitch_torque else () for pitch in pitches
    }
    rests = {
        pitch: scene.bearing_rest[pitch - 1] if scene.bearing_rest else () for pitch in pitches
    }
    rows = [
        *scene.rotor_torque,
        *(row for table in (*torques.values(), *rests.values()) for row in table),
    ]
    inside = {time for time, _ in rows if 0.0 < time < scene.duration}
    assert set(scene.kink_times) <= inside
    assert scene.kink_times == [segment.start for segment in scene.load_segments[1:]]
    assert torque_place(0) == ROTOR_TORQUE
    for segment in scene.load_segments:
        time = segment.start + 0.37 * (segment.end - segment.start)
        loads = segment.loads_at(time)
        assert loads[ROTOR_TORQUE] == pytest.approx(
            value_at(scene.rotor_torque, time), rel=4e-15, abs=4e-12
        )
        for pitch in pitches:
            assert loads[torque_place(pitch)] == pytest.approx(
                value_at(torques[pitch], time), rel=4e-15, abs=4e-12
            )
            assert loads[rest_place(pitch)] == pytest.approx(
                value_at(rests[pitch], time), rel=4e-15, abs=4e-12
            )


def test_a_load_that_changes_has_no_constant_value() -> None:
    assert constant_value(CONSTANT) == 7.0
    assert constant_value(RAMP) == 0.0


def test_a_sample_on_a_jump_has_the_value_before_it() -> None:
    parts = segments([RAMP, CONSTANT], 1.0)
    times = np.linspace(0.0, 1.0, 101)
    values = values_before(parts, times)
    assert values[0, 47] == pytest.approx(2.0)
    exact = np.where(np.arange(101) == 47, 2.0, values_at(RAMP, times))
    assert values[0] == pytest.approx(exact, abs=1e-14)
    assert (values[1] == 7.0).all()


def test_intervals_meet_samples_and_kinks() -> None:
    parts = segments([RAMP], 1.0)
    assert [(p.start, p.values[0]) for p in parts] == [
        (0.0, 0.0),
        (0.3, 0.0),
        (0.47, 5.0),
        (0.8, 1.0),
    ]
    few = intervals(parts, 11, every_sample=False)
    assert np.allclose([interval.end for interval in few], [0.3, 0.4, 0.47, 0.5, 0.8, 1.0])
    assert [interval.sample_intervals for interval in few] == [3, 1, 1, 1, 3, 2]
    assert [interval.ends_at_sample for interval in few] == [True, True, False, True, True, True]
    every = intervals(parts, 11, every_sample=True)
    assert [interval.end for interval in every if interval.ends_at_sample] == np.linspace(
        0.0, 1.0, 11
    )[1:].tolist()
    assert [interval.end for interval in every if not interval.ends_at_sample] == [0.47]
    assert all(
        interval.segment.start <= 0.5 * (interval.start + interval.end) <= interval.segment.end
        for interval in every
    )


def test_the_last_interval_ends_at_the_end_and_not_beside_it() -> None:
    """49 times 1/49 is less than 1 in double precision."""
    assert (
        intervals(segments([RAMP], 1.0), 50, every_sample=False)[-1].end == 1.0 != 49 * (1.0 / 49)
    )


def test_a_kink_that_is_off_a_sample_by_rounding_is_on_it() -> None:
    parts = segments([((0.0, 1.0), (0.1 + 1e-14, 5.0), (0.1 + 1e-14, 2.0))], 1.2)
    assert all(interval.ends_at_sample for interval in intervals(parts, 61, every_sample=True))
    first, second = parts
    assert first.loads_at(first.end) == pytest.approx([5.0])
    assert second.loads_at(second.end) == [2.0]


def test_rows_between_samples_are_a_divisor_of_the_steps() -> None:
    assert steps_and_rows(0.01, 0.01 / 15, False) == (15, 1)
    assert steps_and_rows(0.01, 1e-4, True) == (100, 100)
    # a finer step has at least half as many rows as the coarser ones
    for steps in range(101, 1000, 37):
        taken, rows = steps_and_rows(0.01, 0.01 / steps, True)
        assert taken >= steps
        assert taken % rows == 0
        assert 50 <= rows <= 100
    assert steps_and_rows(0.49, 1e-3, True) == (490, 490)  # far apart: a row for every step
    assert steps_and_rows(3.6, 1e-3, True) == (3600, 900)
