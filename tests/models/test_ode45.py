"""MATLAB's ode45, alone: its pair by order conditions, its step rules by hand, its results by exact solutions."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from rotor_mbs.models.ode45 import ERROR, INTERPOLANT, NODES, STAGES, after_failure, first_step, ode45, smallest_step

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


def test_row_sums_are_the_nodes():
    assert [sum(row) for row in A] == C


def test_stages_are_evaluated_at_their_nodes():
    asked = []

    def slope(t, _):
        asked.append(t)
        return [math.cos(t)]

    ode45(slope, 1.0, [0.0])
    for stages in np.reshape(asked[1:], (-1, 6)):  # of each step, the second to the seventh
        step = (stages[4] - stages[0]) / float(1 - NODES[1])
        np.testing.assert_allclose(stages, stages[4] - step + step * np.array(NODES[1:], float), rtol=1e-13)


@pytest.mark.parametrize(("column", "order", "density"), TREES)
def test_order_conditions_hold_exactly(column, order, density):
    assert weighted(B, column) == Fraction(1, density)
    assert weighted(ERROR, column) == 0  # so the lower formula is of order four, too
    # The interpolant satisfies them at every s: s^order / density, coefficient by coefficient.
    for power in range(1, 5):
        coefficient = weighted([row[power - 1] for row in INTERPOLANT], column)
        assert coefficient == (Fraction(1, density) if power == order else 0)


def test_the_pair_is_of_orders_five_and_four():
    C4 = [c**4 for c in C]
    assert weighted(B, C4) == Fraction(1, 5)
    assert weighted(ERROR, C4) != 0


def test_interpolant_meets_state_and_slope_at_both_ends():
    assert [sum(row) for row in INTERPOLANT] == [*B[:6], 0]
    assert [row[0] for row in INTERPOLANT] == [1, 0, 0, 0, 0, 0, 0]
    assert [sum(k * x for k, x in enumerate(row, start=1)) for row in INTERPOLANT] == [0, 0, 0, 0, 0, 0, 1]


def test_order_of_convergence_of_steps_and_of_the_interpolant():
    # At a tolerance that accepts everything there are ten steps of T/10, so that the error goes as T·h⁵ ~ T⁶ at the
    # steps, and between them as the interpolant's own h⁵ ~ T⁵.
    spans = np.array([0.5, 1.0, 2.0])
    at_steps, between = [], []
    for span in spans:
        result = ode45(harmonic, span, [1.0, 0.0], 1e10, 1e10)
        assert result.steps == 10
        middle = (result.time[1:] + result.time[:-1]) / 2.0
        at_steps.append(np.abs(result.state[-1] - harmonic_exact(span)).max())
        between.append(np.abs(result.at(middle) - harmonic_exact(middle)).max())
    assert np.polyfit(np.log(spans), np.log(at_steps), 1)[0] == pytest.approx(6.0, abs=0.2)
    assert np.polyfit(np.log(spans), np.log(between), 1)[0] == pytest.approx(5.0, abs=0.2)


def errors_of_steps(result):
    """Relative error of every accepted step by the difference of the pair; AbsTol is a thousandth of RelTol."""
    raw = np.abs(np.einsum("s,ksn->kn", np.array(ERROR, float), result.stages))
    scale = np.maximum(np.abs(result.state[:-1]), np.abs(result.state[1:]))
    return np.diff(result.time) * (raw / np.maximum(scale, 1e-3)).max(axis=1)


@pytest.mark.parametrize("rel_tol", [1e-4, 1e-8])
def test_every_accepted_step_meets_the_tolerance(rel_tol):
    def van_der_pol(_, y):
        return [y[1], 5.0 * (1.0 - y[0] ** 2) * y[1] - y[0]]

    result = ode45(van_der_pol, 20.0, [2.0, 0.0], rel_tol, 1e-3 * rel_tol)
    assert result.success
    assert result.evaluations > 1 + 6 * result.steps  # some steps failed
    largest = errors_of_steps(result).max()
    assert largest <= rel_tol * (1.0 + 1e-9)  # rounding of the sum that is formed here in another order
    assert largest > 0.5 * rel_tol  # and is not held far below it


@pytest.mark.parametrize("amplitude", [1.0, 5e-4])  # below AbsTol / RelTol = 1e-3 an error is absolute
def test_steps_without_failures_follow_from_the_errors_before_them(amplitude):
    """h / (1.25 (error / RelTol)^(1/5)), five times h at most: the rule that decides the digits of a chaotic run."""
    result = ode45(harmonic, 10.0, [amplitude, 0.0], 1e-8, 1e-11)
    assert result.evaluations == 1 + 6 * result.steps
    h = np.diff(result.time)
    shrink = 1.25 * (errors_of_steps(result)[:-2] / 1e-8) ** 0.2
    np.testing.assert_allclose(h[1:-1], h[:-2] / np.maximum(shrink, 0.2), rtol=1e-6)


def test_first_step_by_hand():
    # y' = -20 y at y = 1, RelTol 1e-5: rh = 1.25·20 / (1e-5)^(1/5) = 250, so 1/250; T/10 = 0.1 would be longer.
    assert first_step([1.0], [-20.0], 0.1, 1e-5, 1e-3) == pytest.approx(0.004, rel=1e-12)
    # A state below the threshold 1e-3 is taken as the threshold: rh = 1.25·(0.02/1e-3)/0.1 = 250 again.
    assert first_step([0.0], [0.02], 0.1, 1e-5, 1e-3) == pytest.approx(0.004, rel=1e-12)
    assert first_step([1.0], [0.0], 0.1, 1e-5, 1e-3) == 0.1
    # Of 1/250 and the longest step the shorter one, however near they are.
    assert first_step([1.0], [-20.0], 0.004 * (1.0 + 1e-9), 1e-5, 1e-3) == pytest.approx(0.004, rel=1e-12)
    shorter = 0.004 * (1.0 - 1e-9)
    assert first_step([1.0], [-20.0], shorter, 1e-5, 1e-3) == shorter


def test_the_smallest_step_is_sixteen_units_in_the_last_place_of_the_time():
    assert [smallest_step(t) for t in (1.0, 1.5, 8.0)] == [2.0**-48, 2.0**-48, 2.0**-45]


def test_a_first_failure_shrinks_a_step_by_its_error_to_a_tenth_at_most():
    """Four fifths of the fifth root: an error 32 times the tolerance leaves 0.4 of the step."""
    assert after_failure(0.1, 32e-5, 1e-5, False) == pytest.approx(0.04, rel=1e-12)
    assert after_failure(0.1, 1e5, 1e-5, False) == pytest.approx(0.01, rel=1e-12)
    assert after_failure(0.1, 32e-5, 1e-5, True) == 0.05


def test_growth_cap_and_stretched_last_step_by_hand():
    # y' = k has no error: each step is five times the last, up to T/10. With 6 h0 = 0.095 the steps of 0.1 end at
    # 0.895, and 0.105 is left, less than 1.1·0.1: one step.
    h0 = 0.095 / 6.0
    k = 0.1 / (1.25 * h0)  # 1/rh = h0 at RelTol 1e-5
    result = ode45(lambda _t, _y: [k], 1.0, [1.0], 1e-5, 1e-8)
    expected = [0.0, h0, *(0.095 + 0.1 * np.arange(9)), 1.0]
    np.testing.assert_allclose(result.time, expected, rtol=1e-12)
    assert result.time[-1] == 1.0
    assert result.evaluations == 1 + 6 * result.steps


@pytest.mark.parametrize(("begun", "last"), [(0.09001, 0.10999), (0.08999, 0.01001)])
def test_the_last_step_is_stretched_by_a_tenth_at_most(begun, last):
    """Two steps of together `begun`, eight of 0.1: 0.10999 is one step more, 0.11001 is two."""
    k = 0.1 / (1.25 * begun / 6.0)  # 1/rh = begun / 6 at RelTol 1e-5
    result = ode45(lambda _t, _y: [k], 1.0, [1.0], 1e-5, 1e-8)
    assert result.time[-1] - result.time[-2] == pytest.approx(last, rel=1e-9)


def wall(position):
    """y' = 0 up to `position`, not defined beyond."""
    return lambda t, _y: [0.0 if t < position else math.nan]


def test_steps_after_failures_by_hand():
    # From 0.4 the step 0.1 meets the wall at 0.4041: then a tenth, 0.01, then halves: 0.005, 0.0025 fits.
    result = ode45(wall(0.4041), 1.0, [1.0])
    np.testing.assert_allclose(result.time[4:6], [0.4, 0.4025], rtol=1e-12)
    # Wall at 0.4013: a tenth, 0.01, then three halvings, 0.00125; from one quartering on it would be 0.0025, 0.000625.
    result = ode45(wall(0.4013), 1.0, [1.0])
    np.testing.assert_allclose(result.time[4:6], [0.4, 0.40125], rtol=1e-12)
    # Wall at 0.45: 0.1 fails, 0.01 fits; no growth after it: 0.01 again; then 0.05 fails, 0.005 fits, and 0.005 again.
    result = ode45(wall(0.45), 1.0, [1.0])
    np.testing.assert_allclose(result.time[4:9], [0.4, 0.41, 0.42, 0.425, 0.43], rtol=1e-12)
    # It ends there, with what was reached.
    assert not result.success
    assert result.message.startswith("Failure at t=4.5")
    assert 0.45 - 2.0 * smallest_step(0.45) <= result.time[-1] < 0.45
    assert np.all(result.state == 1.0)


def test_what_is_not_a_number_in_any_component_fails():
    """In the last one, too, which the largest of all would pass over."""
    alone = ode45(wall(0.4041), 1.0, [1.0])
    for sign in (1, -1):
        both = ode45(lambda t, y, sign=sign: [0.0, *wall(0.4041)(t, y)][::sign], 1.0, [1.0, 1.0])
        assert both.time.tolist() == alone.time.tolist()


def test_a_blow_up_ends_the_run_at_its_time():
    # y' = y², y(0) = 1 is 1/(1 - t): no step is short enough at t = 1.
    result = ode45(lambda _, y: [y[0] ** 2], 2.0, [1.0], 1e-6, 1e-9)
    assert not result.success
    assert "smallest value allowed" in result.message
    assert result.time[-1] == pytest.approx(1.0, abs=1e-5)
    early = result.time < 0.9
    # The error in 1/y grows by at most RelTol a step, and 1/y has fallen to a tenth at t = 0.9.
    np.testing.assert_allclose(result.state[early, 0], 1.0 / (1.0 - result.time[early]), rtol=10 * 1e-6 * early.sum())


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
    # The interpolant is one order lower than the steps: its own error is h⁵ k with h ~ 0.08, k < 1e-2, so 1e-7.
    np.testing.assert_allclose(result.at(times), harmonic_exact(times), atol=1e-7)
    with pytest.raises(ValueError, match="covers"):
        result.at(np.array([10.1]))
