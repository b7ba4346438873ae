"""Methods: bad settings, names, and a descent that is finished by sequential programming."""

import numpy as np
import optax
import pytest

import tpd
from tests.design.test_descent import LIMITED, STARTS, WORST
from tpd.design.methods import describe


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tpd.Descent(searches=0), "`searches` must be a whole number, 1 or more, but is 0"),
        (lambda: tpd.Sequential(screening=-1), "`screening` must be a whole number, 1 or more, but is -1"),
        (lambda: tpd.Sequential(steps=0), "`steps` must be a whole number, 1 or more, but is 0"),
        (lambda: tpd.Descent(tolerance=0.0), "`tolerance` must be positive"),
        (lambda: tpd.Descent("newton"), "`optimiser` must be one of adam, lbfgs, but is 'newton'"),
        (lambda: tpd.Descent(optax.lbfgs()), "`optimiser` must make its steps from gradients alone"),
    ],
)
def test_bad_settings_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize(
    ("optimiser", "name"), [("adam", "adam"), ("lbfgs", "lbfgs"), (optax.sgd(0.05), "custom")]
)
def test_optimisers_have_names(optimiser, name):
    method = tpd.Descent(optimiser, searches=3)
    assert method.optimiser_name == name
    assert describe(method) == {
        "method": "descent",
        "model": "orbits",
        "searches": 3,
        "screening": 192,
        "steps": 30,
        "optimiser": name,
        "tolerance": 0.01,
    }
    assert describe(tpd.Sequential(model=tpd.Piecewise()))["model"].startswith("Piecewise(")


@pytest.mark.parametrize("optimiser", ["adam", "lbfgs", optax.sgd(0.05)], ids=type)
def test_a_descent_is_finished_by_sequential_programming(optimiser):
    steps = []
    method = tpd.Descent(optimiser, steps=20)
    ended = method.search(LIMITED, STARTS, 1.0, WORST, after=lambda *e: steps.append(e))
    np.testing.assert_allclose(ended.merit, 3.125, rtol=1e-3)
    assert steps[0] == (1, 30)
    assert all(a < b for a, b in zip([s for s, _ in steps], [s for s, _ in steps[1:]], strict=False))
    assert len(ended.path) == len(ended.path_merit) == len(ended.path_spent)
    assert np.all(np.diff(ended.path_spent) > 0)
    assert np.all(np.diff(ended.path_merit, axis=0) <= 0.0)
    np.testing.assert_array_equal(ended.path[0], STARTS)
    np.testing.assert_array_equal(ended.path[-1], ended.x)
    known = LIMITED(STARTS)
    again = method.search(LIMITED, STARTS, 1.0, WORST, known=known)
    np.testing.assert_array_equal(again.x, ended.x)
    assert again.evaluations == ended.evaluations - len(STARTS)
