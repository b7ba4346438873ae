"""Methods: bad settings, names, the path of a descent, and what is compared."""

import numpy as np
import optax
import pytest

import tpd
from tests.design.test_descent import LIMITED, STARTS
from tpd.design.methods import describe
from tpd.design.objective import Orbits


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tpd.Descent(searches=0), "`searches` must be a whole number, 1 or more, but is 0"),
        (lambda: tpd.Sequential(screening=-1), "`screening` must be a whole number, 1 or more, but is -1"),
        (lambda: tpd.Sequential(steps=0), "`steps` must be a whole number, 1 or more, but is 0"),
        (lambda: tpd.Descent(tolerance=0.0), "`tolerance` must be positive"),
        (lambda: tpd.Descent("newton"), "`optimiser` must be one of adam, rmsprop, but is 'newton'"),
        (lambda: tpd.Descent(model=tpd.Segmented()), r"`model` must be Smoothed\(\) with linear terms"),
        (lambda: tpd.Descent(model=tpd.Smoothed(terms=tpd.Terms.parametric)), "`model` must be Smoothed"),
        (lambda: tpd.Descent(optax.lbfgs()), "`optimiser` must make its steps from gradients alone"),
    ],
)
def test_bad_settings_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize(
    ("optimiser", "name"), [("adam", "adam"), ("rmsprop", "rmsprop"), (optax.sgd(0.05), "custom")]
)
def test_optimisers_have_names(optimiser, name):
    method = tpd.Descent(optimiser, searches=3)
    assert method.optimiser_name == name
    assert describe(method) == {
        "method": "descent",
        "searches": 3,
        "screening": 512,
        "steps": 40,
        "optimiser": name,
        "tolerance": 0.01,
        "model": "None",
    }


class Minimax(Orbits):
    """A known minimax of three functions in place of orbits."""

    risk, conditions = tpd.Risk.worst(), tpd.Conditions.amplitudes(1.0, 1.1, 1.2)
    at = staticmethod(LIMITED)

    def __init__(self):
        """Nothing that an objective over motions has."""


GENTLE = optax.chain(optax.clip(1.0), optax.sgd(optax.cosine_decay_schedule(0.03, 120)))


@pytest.mark.parametrize(("optimiser", "near"), [("adam", 0.03), (GENTLE, 0.3)], ids=["adam", "sgd"])
def test_a_descent_reports_its_path_and_what_it_spent(optimiser, near):
    steps, problem = [], Minimax()
    method = tpd.Descent(optimiser, steps=120)
    ended = method.search(problem, STARTS, after=lambda *e: steps.append(e))
    np.testing.assert_allclose(ended.merit, 3.125, rtol=near)
    assert steps == [(i, 120) for i in range(1, 121)]
    assert len(ended.path) == len(ended.path_merit) == len(ended.path_spent)
    assert np.all(np.diff(ended.path_spent) > 0)
    assert np.all(np.diff(ended.path_merit, axis=0) <= 0.0)
    np.testing.assert_array_equal(ended.path[0], STARTS)
    np.testing.assert_array_equal(ended.path[-1], ended.x)
    again = method.search(problem, STARTS, known=LIMITED(STARTS))
    np.testing.assert_array_equal(again.x, ended.x)
    assert again.evaluations == ended.evaluations - len(STARTS)
