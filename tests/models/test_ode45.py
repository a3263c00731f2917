"""MATLAB's ode45, alone: its pair by order conditions, its step rules written anew, its results by
exact solutions."""

from __future__ import annotations

import math
from fractions import Fraction
from unittest.mock import Mock

import numpy as np
import pytest

from rotor_mbs.models.ode45 import ERROR, INTERPOLANT, NODES, STAGES, ode45

A = [[*row, *[Fraction(0)] * (7 - len(row))] for row in ((), *STAGES)]
B = A[6]


def harmonic(_, y):
    return [y[1], -y[0]]


def harmonic_exact(t):
    return np.stack([np.cos(t), -np.sin(t)], axis=-1)


def weighted(weights, *columns):
    """Σ_i weights_i Π columns_i."""
    return sum(w * math.prod(column[i] for column in columns) for i, w in enumerate(weights))


def times_a(column):
    return [sum(a * x for a, x in zip(row, column, strict=True)) for row in A]


C = list(NODES)
C2, C3 = [c**2 for c in C], [c**3 for c in C]
# Every rooted tree up to order four: elementary weight column and density.
TREES = [
    ([Fraction(1)] * 7, 1, 1),
    (C, 2, 2),
    (C2, 3, 3),
    (times_a(C), 3, 6),
    (C3, 4, 4),
    ([c * x for c, x in zip(C, times_a(C), strict=True)], 4, 8),
    (times_a(C2), 4, 12),
    (times_a(times_a(C)), 4, 24),
]


@pytest.mark.parametrize(("column", "order", "density"), TREES)
def test_order_conditions_hold_exactly(column, order, density):
    assert weighted(B, column) == Fraction(1, density)
    assert weighted(ERROR, column) == 0  # so the lower formula is of order four, too
    # The interpolant satisfies them at every s: s^order / density, coefficient by coefficient.
    for power in range(1, 5):
        coefficient = weighted([row[power - 1] for row in INTERPOLANT], column)
        assert coefficient == (Fraction(1, density) if power == order else 0)


def test_the_pair_is_of_orders_five_and_four():
    assert [sum(row) for row in A] == C
    C4 = [c**4 for c in C]
    assert weighted(B, C4) == Fraction(1, 5)
    assert weighted(ERROR, C4) != 0


def test_interpolant_meets_state_and_slope_at_both_ends():
    assert [sum(row) for row in INTERPOLANT] == [*B[:6], 0]
    assert [row[0] for row in INTERPOLANT] == [1, 0, 0, 0, 0, 0, 0]
    assert [sum(k * x for k, x in enumerate(row, start=1)) for row in INTERPOLANT] == [
        0,
        0,
        0,
        0,
        0,
        0,
        1,
    ]


def steps_of_matlab(f, end, start, rel_tol=1e-3, abs_tol=1e-6):
    """Times of the accepted steps by the rules of ode45.m, written with its vectors and norms."""
    t, y, threshold, longest, power = 0.0, np.array(start), abs_tol / rel_tol, end / 10.0, 1.0 / 5.0
    slope = np.array(f(t, y))
    rh = np.max(np.abs(slope) / np.maximum(np.abs(y), threshold)) / (0.8 * rel_tol**power)
    h, times, done = (1.0 / rh if longest * rh > 1.0 else longest), [t], False
    while not done:
        shortest = 16.0 * np.spacing(t)
        h = min(longest, max(shortest, h))
        done = 1.1 * h >= end - t
        h, has_failed = end - t if done else h, False
        while True:
            k = [slope]
            for row, node in zip(STAGES, NODES[1:], strict=True):
                new = y + h * sum(float(a) * x for a, x in zip(row, k, strict=True))
                k.append(np.array(f(t + float(node) * h, new)))
            scale = np.maximum(np.maximum(np.abs(y), np.abs(new)), threshold)
            error = h * np.max(
                np.abs(sum(float(e) * x for e, x in zip(ERROR, k, strict=True))) / scale
            )
            if error <= rel_tol:
                break
            if h <= shortest:
                return times
            # MATLAB's max passes over what is no number
            first = h * np.fmax(0.1, 0.8 * (rel_tol / error) ** power)
            h, done, has_failed = max(shortest, 0.5 * h if has_failed else first), False, True
        t, y, slope = t + h, new, k[-1]
        times.append(t)
        shrink = 1.25 * (error / rel_tol) ** power
        if not has_failed:
            h = h / shrink if shrink > 0.2 else 5.0 * h
    return times


def van_der_pol(_, y):
    return [y[1], 5.0 * (1.0 - y[0] ** 2) * y[1] - y[0]]


def wall(position, before=0.0):
    """A constant slope up to `position`, not defined beyond."""
    return lambda t, _y: [before if t < position else math.nan]


def two_walls(t, y):
    return [*wall(0.4041)(t, y), 0.0]


# Right-hand side, end, start, tolerances. Constant slopes have no error: steps grow fivefold to a
# tenth of the span; begun with two steps of together 0.09001 the last one is stretched, with
# 0.08999 it is cut. At a wall a step fails at once and again, until it fits, or until none is short
# enough.
STEPPED = {
    "no step fails": (harmonic, 10.0, [1.0, 0.0], 1e-8, 1e-11),
    "errors below the threshold are absolute": (harmonic, 10.0, [5e-4, 0.0], 1e-8, 1e-11),
    "some steps fail": (van_der_pol, 20.0, [2.0, 0.0], 1e-4, 1e-7),
    "a slope that changes with time": (lambda t, _y: [math.cos(t)], 1.0, [0.0], 1e-8, 1e-11),
    "a slope that changes with time and state": (
        lambda t, y: [math.cos(5.0 * t) * y[0]],
        2.0,
        [1.0],
        1e-8,
        1e-11,
    ),
    # The longest step is a tenth of the span; the rule for the first one gives a 1.0005-th of it.
    "a first step that is hardly shorter than the longest": (
        wall(9.0, 1.0005 / 1.25),
        1.0,
        [1.0],
        1e-5,
        1e-8,
    ),
    "steep": (lambda _t, y: [-20.0 * y[0]], 1.0, [1.0], 1e-5, 1e-8),
    "stretched": (wall(9.0, 0.1 / (1.25 * 0.09001 / 6.0)), 1.0, [1.0], 1e-5, 1e-8),
    "cut": (wall(9.0, 0.1 / (1.25 * 0.08999 / 6.0)), 1.0, [1.0], 1e-5, 1e-8),
    "halved once": (wall(0.4041), 1.0, [1.0], 1e-3, 1e-6),
    "halved three times": (wall(0.4013), 1.0, [1.0], 1e-3, 1e-6),
    "not a number in the first component": (two_walls, 1.0, [1.0, 1.0], 1e-3, 1e-6),
    "not a number in the last component": (
        lambda t, y: two_walls(t, y)[::-1],
        1.0,
        [1.0, 1.0],
        1e-3,
        1e-6,
    ),
    "no growth after a failure": (wall(0.45), 1.0, [1.0], 1e-3, 1e-6),
    "a motion that ends": (lambda _, y: [y[0] ** 2], 2.0, [1.0], 1e-6, 1e-9),
}


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
@pytest.mark.parametrize("case", STEPPED)
def test_steps_are_those_of_matlabs_rules(case):
    f, *others = STEPPED[case]
    counted = Mock(side_effect=f)
    result, expected = ode45(counted, *others), steps_of_matlab(f, *others)
    np.testing.assert_allclose(result.time, expected, rtol=1e-12)
    assert result.evaluations == counted.call_count
    assert result.success == (expected[-1] == others[0])
    assert result.success or result.message == (
        f"Failure at t={expected[-1]:e}. Unable to meet integration tolerances without reducing "
        f"the step size below the smallest value allowed ({16.0 * np.spacing(expected[-1]):e}) at "
        "time t."
    )


def test_no_step_at_all():
    result = ode45(lambda _t, _y: [math.nan], 1.0, [1.0])
    assert not result.success
    assert result.steps == 0
    assert result.at(np.array([0.0])).tolist() == [[1.0]]
    assert [part.tolist() for part in result.refined()] == [[0.0], [[1.0]]]


def test_read_off_between_and_at_the_steps():
    result = ode45(harmonic, 10.0, [1.0, 0.0], 1e-8, 1e-8)
    assert np.array_equal(result.at(result.time), result.state)
    time, state = result.refined()  # four points a step
    assert len(time) == 4 * result.steps + 1
    assert np.array_equal(time[::4], result.time)
    np.testing.assert_allclose(np.diff(time)[:4], result.time[1] / 4.0, rtol=1e-12)
    assert np.array_equal(state, result.at(time))
    times = np.linspace(0.0, 10.0, 777)[::-1]
    # The interpolant is one order lower than the steps: its own error is h⁵ k with h ~ 0.08, k <
    # 1e-2, so 1e-7.
    np.testing.assert_allclose(result.at(times), harmonic_exact(times), atol=1e-7)
    with pytest.raises(ValueError, match="covers"):
        result.at(np.array([10.1]))
