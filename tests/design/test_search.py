"""Multistart: groups, order, statuses and designs on the paths."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests.design.conftest import FEW_STEPS as METHOD
from tests.design.conftest import WIDE
from tests.design.test_objective import orbits
from tpd.design.result import DesignStatus
from tpd.design.search import GROUP, Multistart


def test_searches_run_in_groups_from_the_best_of_the_screening(search):
    assert [len(g.x) for g in search.groups] == [GROUP, 4]
    assert search.screened.shape == (48, 3)
    assert len(search.units) == 20
    begun = np.concatenate([g.path[0] for g in search.groups])
    # Half of the bests of the screening are among the designs from which searches begin.
    best = WIDE.scaled(search.screened[np.argsort(search.screened_value)[:1]])
    assert np.abs(begun - best).sum(axis=1).min() < 1e-12
    assert search.evaluations == 48 + sum(g.evaluations for g in search.groups)


def test_ends_are_ordered_by_risk_and_a_broken_limit_is_infinite(search):
    order = search.order()
    assert np.all(np.diff(search.values[order]) >= 0.0)
    assert set(order) == set(np.flatnonzero(np.isfinite(search.values)))
    assert len(search.order(feasible=False)) == 20
    e = search.objective.evaluate(search.designs)
    kept = search.objective.constraints(e)[0].max(axis=1) <= 0.0
    np.testing.assert_array_equal(np.isfinite(search.values), kept)
    np.testing.assert_allclose(search.values[kept], search.objective.value(e)[kept], rtol=1e-10)
    np.testing.assert_allclose(search.excess, search.objective.constraints(e)[0], atol=1e-9)


def test_designs_on_the_paths_lie_apart_from_each_other_and_from_the_ends(search):
    passed = WIDE.scaled(search.on_the_way(8))
    assert 0 < len(passed) <= 8
    met = np.concatenate([search.units, passed])
    for i in range(20, len(met)):
        assert np.linalg.norm(met[:i] - met[i], axis=1).min() > 0.05
    path = np.concatenate([g.path.reshape(-1, 3) for g in search.groups])
    merit = np.concatenate([g.path_merit.ravel() for g in search.groups])
    merits = [merit[np.isclose(path, x, atol=1e-9).all(axis=1)].min() for x in passed]
    assert merits == sorted(merits)


def test_a_search_may_begin_fewer_times_than_asked_for():
    """Where nothing lifts, moved designs stay where they were: screened designs coincide."""
    calm = orbits(conditions=tpd.Conditions.amplitudes(0.01, 0.02), limits=())
    narrow = dataclasses.replace(calm, space=tpd.DesignSpace(length_ratio=(0.1, 0.2)))
    out = Multistart(narrow, tpd.Sequential(searches=24, screening=24, steps=2), 0, None)
    assert out.statuses() == ()
    out.run()
    assert len(out.statuses()) == len(out.units) < 24


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({}, DesignStatus.converged),
        ({"open": True}, DesignStatus.steps_exhausted),
        ({"x": 0.0}, DesignStatus.at_bound),
        ({"limit": -1e-4}, DesignStatus.stroke_limited),
        ({"limit": 0.1}, DesignStatus.infeasible),
        ({"value": -0.1}, DesignStatus.rests),
    ],
)
def test_every_search_ends_with_a_status(search, changed, expected):
    g, given = search.groups[1], {"value": 0.3, "limit": -0.5, "x": 0.5, "open": False, "steps": 3} | changed
    parts = {name: np.full_like(getattr(g.local, name), given.pop(name)) for name in ("value", "limit")}
    ends = {name: np.full_like(getattr(g, name), value) for name, value in given.items()}
    one = Multistart(search.objective, METHOD, 0, None)
    one.groups = [g._replace(local=g.local._replace(**parts), **ends)]
    assert one.statuses() == (expected,) * 4


def test_an_end_that_the_exact_solution_contradicts_is_left_out_unless_all_are(search):
    """Ends of a descent whose tolerance is a hundredth: two lie beyond it, one by another kind of orbit."""
    g = search.groups[1]
    one = Multistart(search.objective, tpd.Descent(searches=4), 0, None)
    mismatch = np.array([[1e-6, 1e-4], [0.02, 0.0], [0.009, 0.3], [np.inf, 0.0]])
    one.groups = [g._replace(mismatch=mismatch)]
    assert one.contradicted.tolist() == [False, True, False, True]
    assert [status is DesignStatus.contradicted for status in one.statuses()] == [False, True, False, True]
    assert np.isinf(one.values[[1, 3]]).all()
    kept = Multistart(search.objective, METHOD, 0, None)
    kept.groups = [g]
    np.testing.assert_array_equal(one.values[[0, 2]], kept.values[[0, 2]])
    np.testing.assert_array_equal(one.history.mismatch, mismatch)
    # Where all are, their exact values are still the best that is known.
    one.groups = [g._replace(mismatch=np.full((4, 2), 0.5))]
    np.testing.assert_array_equal(one.values, kept.values)
