"""Methods of search: known minima are found from everywhere; settings, paths, and optimisers of a user."""

from functools import partial

import numpy as np
import optax
import pytest
from tpd.design.methods import OPTIMISERS, descend, describe, minimise, named, smoothed_merit
from tpd.design.objective import Orbits

import tpd
from tests.design.minimax import FREE, LIMITED, STARTS, WORST, in_unit_square, linearisations


@pytest.fixture(scope="module")
def found():
    return minimise(FREE, STARTS, 1.0, WORST)


def test_a_known_minimax_is_found_from_everywhere(found):
    np.testing.assert_allclose(found.merit, 1.9522245, rtol=1e-6)
    np.testing.assert_allclose(6.0 * found.x - 3.0, [[1.13904, 0.89956]] * 4, atol=1e-3)
    assert not found.open.any()
    assert found.path.shape == (len(found.path_merit), 4, 2)
    np.testing.assert_array_equal(found.path[0], STARTS)
    np.testing.assert_array_equal(found.path[-1], found.x)
    assert np.all(np.diff(found.path_merit, axis=0) <= 0.0), "the best designs so far"


def test_the_mean_of_the_worst_share_is_minimised():
    """Of three functions the mean of the worst two, least on the limit where two of them are equal: there
    x^2 + (1.5 - x)^4 = 2 e^(1.5 - 2 x)."""
    risk = tpd.Risk.cvar(2.0 / 3.0)
    ended = minimise(LIMITED, STARTS, risk.cap(3), risk.of)
    np.testing.assert_allclose(ended.merit, 2.20740775, rtol=1e-8)
    np.testing.assert_allclose(ended.weights[0].sum(axis=1), 1.0, rtol=1e-6)
    assert np.all(ended.weights[0] <= 0.5 + 1e-9)


def test_a_constraint_and_a_smooth_bottom_are_met():
    bowl = [lambda x, y: ((x - 2) ** 2 + 10 * (y - 1) ** 2, (2 * x - 4, 20 * y - 20))]
    line = [lambda x, y: (x + y - 2.0, (np.ones_like(x), np.ones_like(y)))]
    starts = np.array([[0.5, 0.5]])
    free = minimise(in_unit_square(linearisations(bowl)), starts, 1.0, WORST)
    np.testing.assert_allclose(6.0 * free.x - 3.0, [[2.0, 1.0]], atol=1e-3)
    held = minimise(in_unit_square(linearisations(bowl, line)), starts, 1.0, WORST)
    # Lagrange: x = 2 - 10/11, y = 1 - 1/11.
    np.testing.assert_allclose(6.0 * held.x - 3.0, [[2.0 - 10 / 11, 1.0 - 1 / 11]], atol=1e-3)
    assert held.weights[1][0, 0] == pytest.approx(20 / 11, rel=1e-2)


def test_a_curved_limit_is_followed_to_its_end():
    """Along a ring to its rightmost point, where every straight step leaves the ring."""

    def ring(sign):
        return lambda x, y: (sign * 0.2 * (x**2 + y**2 - 1), (sign * 0.4 * x, sign * 0.4 * y))

    right = [lambda x, y: (-x, (-np.ones_like(x), np.zeros_like(y)))]
    problem = in_unit_square(linearisations(right, [ring(1.0), ring(-1.0)]))
    begin = np.array([[np.cos(2.5) + 3.0, np.sin(2.5) + 3.0]]) / 6.0
    found = minimise(problem, begin, 1.0, WORST)
    np.testing.assert_allclose(6.0 * found.x - 3.0, [[1.0, 0.0]], atol=1e-4)
    assert found.evaluations < 40
    assert not found.open.any()


BOTH = pytest.mark.parametrize("go", [minimise, partial(descend, named("adam", 10))], ids=["sqp", "adam"])


@BOTH
def test_searches_begin_within_the_bounds_and_stay_there(go):
    asked, starts = [], np.array([[1.2, 0.8], [0.5, -0.5]])

    def evaluate(units):
        asked.append(units.copy())
        return FREE(units)

    ended = go(evaluate, starts, 1.0, WORST, steps=10)
    np.testing.assert_array_equal(ended.path[0], [[1.0, 0.8], [0.5, 0.0]])
    assert np.all((np.concatenate(asked) >= 0.0) & (np.concatenate(asked) <= 1.0))
    np.testing.assert_array_equal(starts, [[1.2, 0.8], [0.5, -0.5]])


@BOTH
def test_every_start_gets_what_it_gets_alone(go):
    together = go(LIMITED, STARTS, 1.0, WORST, steps=10)
    for i in range(4):
        alone = go(LIMITED, STARTS[i : i + 1], 1.0, WORST, steps=10)
        np.testing.assert_allclose(alone.x[0], together.x[i], rtol=1e-9)


def test_what_is_known_is_not_asked_again_and_starts_are_counted(found):
    calls, done = [], []

    def counted(units):
        calls.append(len(units))
        return FREE(units)

    again = minimise(counted, STARTS, 1.0, WORST, known=FREE(STARTS), after=lambda *event: done.append(event))
    assert sum(calls) == again.evaluations == found.evaluations - 4
    np.testing.assert_array_equal(again.x, found.x)
    assert done == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert minimise(FREE, STARTS, 1.0, WORST, steps=2).open.all(), "where the steps run out"


def test_a_start_that_is_not_finite_takes_no_step_and_the_others_go_around_what_is_not():
    entered = []

    def holed(units):
        at, hole = FREE(units), units[:, :1] > 0.75
        entered.append(hole.any())
        return at._replace(value=np.where(hole, np.inf, at.value))

    ended = minimise(holed, STARTS, 1.0, WORST)
    assert ended.steps[1] == 0
    np.testing.assert_array_equal(ended.x[1], STARTS[1])
    assert ended.open.tolist() == [False, True, False, False]
    assert sum(entered) > 1, "not the start alone"
    np.testing.assert_allclose(ended.merit[[0, 2, 3]], 1.9522245, rtol=1e-6)


@pytest.mark.parametrize("cap", [1.0, 0.5, 1.0 / 3.0])
def test_the_smoothed_merit_has_these_slopes_and_tends_to_the_risk(cap):
    risk = tpd.Risk.cvar(1.0 / (3.0 * cap))
    at = LIMITED(STARTS)
    sharp = risk.of(at.value) + 10.0 * np.maximum(at.limit[:, 0], 0.0)
    np.testing.assert_allclose(smoothed_merit(at, cap, 1e-7)[0], sharp, atol=1e-5)
    _, slope = smoothed_merit(at, cap, 0.3)
    for i in range(2):
        step = 1e-6 * np.eye(2)[i]
        up, down = (smoothed_merit(LIMITED(STARTS + s * step), cap, 0.3)[0] for s in (1, -1))
        np.testing.assert_allclose(slope[:, i], (up - down) / 2e-6, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("optimiser", OPTIMISERS)
@pytest.mark.parametrize(("problem", "least"), [(FREE, 1.9522245), (LIMITED, 3.125)])
def test_a_known_minimax_is_approached_at_more_cost(optimiser, problem, least):
    found = descend(named(optimiser, 160), problem, STARTS, 1.0, WORST, steps=160)
    surely = minimise(problem, STARTS, 1.0, WORST, steps=40)
    np.testing.assert_allclose(surely.merit, least, rtol=1e-5)
    np.testing.assert_allclose(found.merit, least, rtol=0.01)
    assert np.all(found.merit >= least * (1.0 - 1e-6))
    assert found.evaluations == 4 * 161 > 2 * surely.evaluations
    assert found.path.shape == (161, 4, 2)
    assert np.all(np.diff(found.path_merit, axis=0) <= 0.0)
    assert found.weights[0].shape == (4, 3)


@pytest.mark.parametrize("optimiser", [named("adam", 60), optax.sgd(0.05)], ids=["adam", "sgd"])
def test_a_start_where_nothing_is_known_goes_back_to_the_best_it_has_seen(optimiser):
    """Beyond x = 0.6 nothing is known, and there the minimum lies. A descent ends at that edge, well below
    its start (8.0), though not at the edge's best place (2.97): nothing leads it along."""
    entered = []

    def holed(unit):
        at = FREE(unit)
        hole = unit[:, 0] > 0.6
        entered.append(hole.any())
        return at._replace(value=np.where(hole[:, None], np.inf, at.value))

    found = descend(optimiser, holed, STARTS[2:3], 1.0, WORST, steps=60)
    assert any(entered[1:]), "the descent has been where nothing is known"
    assert 0.59 < found.x[0, 0] <= 0.6
    assert found.merit[0] < 4.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tpd.Sequential(screening=-1), "`screening` must be a whole number, 1 or more, but is -1"),
        (lambda: tpd.Sequential(steps=0), "`steps` must be a whole number, 1 or more, but is 0"),
        (lambda: tpd.Descent(tolerance=0.0), "`tolerance` must be positive"),
        (lambda: tpd.Descent(model=tpd.Segmented()), r"`model` must be Smoothed\(\) with linear terms"),
        (lambda: tpd.Descent(model=tpd.Smoothed(terms=tpd.Terms.parametric)), "`model` must be Smoothed"),
        (lambda: tpd.Descent(optax.lbfgs()), "`optimiser` must make its steps from gradients alone"),
    ],
)
def test_bad_settings_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_settings_of_a_method_are_plain_values():
    found = describe(tpd.Descent(optax.sgd(0.05), searches=3))
    names = {"method": "descent", "optimiser": "custom", "model": "None"}
    assert found == names | {"searches": 3, "screening": 512, "steps": 40, "tolerance": 0.01}


class Minimax(Orbits):
    """A known minimax of three functions in place of orbits."""

    risk, conditions = tpd.Risk.worst(), tpd.Conditions.amplitudes(1.0, 1.1, 1.2)
    at = staticmethod(LIMITED)

    def __init__(self):
        """Nothing that an objective over motions has."""


def test_a_descent_reports_its_path_and_what_it_spent():
    steps, problem = [], Minimax()
    method = tpd.Descent(optax.sgd(0.03), steps=20)
    ended = method.search(problem, STARTS, after=lambda *e: steps.append(e))
    assert steps == [(i, 20) for i in range(1, 21)]
    assert len(ended.path) == len(ended.path_merit) == len(ended.path_spent)
    assert np.all(np.diff(ended.path_spent) > 0)
    np.testing.assert_array_equal(ended.path[0], STARTS)
    np.testing.assert_array_equal(ended.path[-1], ended.x)
    again = method.search(problem, STARTS, known=LIMITED(STARTS))
    np.testing.assert_array_equal(again.x, ended.x)
    assert again.evaluations == ended.evaluations - len(STARTS)
