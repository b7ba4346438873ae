"""Sequential programming: known minima are found, and the numbers of a stored run do not change."""

import numpy as np
import pytest

import tpd
from tests.design.minimax import CB2, half_plane, linearisations
from tpd.design.sequential import merit_of, minimise

WORST = tpd.Risk.worst().of
STARTS = np.array([[-1.0, 2.0], [2.0, 0.0], [0.0, 0.0], [1.0, -0.1]])
BOX = {"low": np.full((4, 2), -3.0), "high": np.full((4, 2), 3.0)}


@pytest.fixture(scope="module")
def found():
    return minimise(linearisations(CB2), STARTS, 1.0, WORST, radius=0.5, **BOX)


def test_a_known_minimax_is_found_from_everywhere(found):
    np.testing.assert_allclose(found.merit, 1.9522245, rtol=1e-6)
    np.testing.assert_allclose(found.x, [[1.13904, 0.89956]] * 4, atol=1e-3)
    assert np.all(found.stationarity < 1e-2)
    assert not found.open.any()
    assert found.path.shape == (len(found.path_merit), 4, 2)
    assert np.all(np.diff(found.path_merit, axis=0) <= 0.0), "no step is taken that does not help"


def test_numbers_of_a_stored_run_do_not_change(found):
    """Stored before the functions were split: rounding alone may differ."""
    stored = [
        [1.1390377073, 0.8995598885],
        [1.1390381671, 0.8995596557],
        [1.1390375488, 0.8995600157],
        [1.1390357197, 0.8995615070],
    ]
    np.testing.assert_allclose(found.x, stored, atol=2e-9)
    assert found.evaluations == 34
    held = minimise(linearisations(CB2, [half_plane]), STARTS, 1.0, WORST, radius=0.5, steps=6, **BOX)
    assert held.evaluations == 19
    np.testing.assert_allclose(held.merit, 3.125, rtol=1e-8)


def test_the_mean_of_the_worst_share_is_minimised():
    """Of three functions the mean of the worst two: a grid of 6 million points gives 2.2076681."""
    risk = tpd.Risk.cvar(2.0 / 3.0)
    problem = linearisations(CB2, [half_plane])
    ended = minimise(problem, STARTS, risk.cap(3), risk.of, radius=0.5, **BOX)
    np.testing.assert_allclose(ended.merit, 2.2076681, rtol=1e-6)
    np.testing.assert_allclose(ended.weights[0].sum(axis=1), 1.0, rtol=1e-6)
    assert np.all(ended.weights[0] <= 0.5 + 1e-9)


def test_a_constraint_and_a_smooth_bottom_are_met():
    bowl = [lambda x, y: ((x - 2) ** 2 + 10 * (y - 1) ** 2, (2 * x - 4, 20 * y - 20))]
    line = [lambda x, y: (x + y - 2.0, (np.ones_like(x), np.ones_like(y)))]
    starts, wide = np.array([[0.0, 0.0]]), {"low": np.full((1, 2), -5.0), "high": np.full((1, 2), 5.0)}
    free = minimise(linearisations(bowl), starts, 1.0, WORST, radius=1.0, **wide)
    np.testing.assert_allclose(free.x, [[2.0, 1.0]], atol=1e-3)
    held = minimise(linearisations(bowl, line), starts, 1.0, WORST, radius=1.0, **wide)
    # Lagrange: x = 2 - 10/11, y = 1 - 1/11.
    np.testing.assert_allclose(held.x, [[2.0 - 10 / 11, 1.0 - 1 / 11]], atol=1e-3)
    assert held.weights[1][0, 0] == pytest.approx(20 / 11, rel=1e-2)


def test_a_curved_limit_is_followed_in_long_steps():
    """Maratos' effect: along a ring to its rightmost point, where every straight step leaves the ring."""

    def ring(sign):
        return lambda x, y: (sign * 50 * (x**2 + y**2 - 1), (sign * 100 * x, sign * 100 * y))

    right = [lambda x, y: (-x, (-np.ones_like(x), np.zeros_like(y)))]
    problem, begin = linearisations(right, [ring(1.0), ring(-1.0)]), np.array([[np.cos(2.5), np.sin(2.5)]])
    wide = {"low": np.full((1, 2), -2.0), "high": np.full((1, 2), 2.0)}
    found = minimise(problem, begin, 1.0, WORST, steps=60, **wide)
    np.testing.assert_allclose(found.x, [[1.0, 0.0]], atol=1e-4)
    assert found.evaluations < 130
    assert not found.open.any()


def test_searches_begin_within_their_bounds_and_stay_there():
    high = np.array([[0.5, 0.5], [3.0, 3.0]])
    starts, low = np.array([[2.0, 2.0], [0.0, 0.0]]), np.full((2, 2), -1.0)
    asked = []

    def evaluate(points):
        asked.append(points.copy())
        return linearisations(CB2)(points)

    ended = minimise(evaluate, starts, 1.0, WORST, radius=0.5, low=low, high=high)
    np.testing.assert_array_equal(ended.path[0], [[0.5, 0.5], [0.0, 0.0]])
    assert np.all(np.concatenate(asked) >= -1.0)
    assert np.all(ended.path <= high + 1e-12)
    np.testing.assert_array_equal(starts, [[2.0, 2.0], [0.0, 0.0]])


def test_no_step_is_an_evaluation_and_what_is_known_is_not_asked_again(found):
    problem, calls = linearisations(CB2), []

    def counted(points):
        calls.append(len(points))
        return problem(points)

    none = minimise(counted, STARTS, 1.0, WORST, steps=0, **BOX)
    assert calls == [4]
    assert none.evaluations == 4
    assert none.open.all()
    np.testing.assert_array_equal(none.x, STARTS)
    np.testing.assert_array_equal(none.merit, merit_of(problem(STARTS), WORST))
    calls.clear()
    again = minimise(counted, STARTS, 1.0, WORST, known=none.local, radius=0.5, **BOX)
    assert sum(calls) == again.evaluations == found.evaluations - 4
    np.testing.assert_array_equal(again.x, found.x)


def test_a_batch_gives_every_start_what_it_gets_alone(found):
    for i in range(4):
        box = {k: v[i : i + 1] for k, v in BOX.items()}
        alone = minimise(linearisations(CB2), STARTS[i : i + 1], 1.0, WORST, radius=0.5, **box)
        np.testing.assert_allclose(alone.x[0], found.x[i], rtol=0.0, atol=1e-12)


def test_a_start_that_is_not_finite_takes_no_step():
    def holed(points):
        at = linearisations(CB2)(points)
        return at._replace(value=np.where(points[:, :1] > 1.5, np.inf, at.value))

    ended = minimise(holed, STARTS, 1.0, WORST, radius=0.5, **BOX)
    assert ended.steps[1] == 0
    np.testing.assert_array_equal(ended.x[1], STARTS[1])
    assert not ended.open[1]
    np.testing.assert_allclose(ended.merit[[0, 2, 3]], 1.9522245, rtol=1e-6)
