"""The search: screening, starts, order and statuses of the ends, and what the finish adds."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests.design.conftest import WIDE
from tests.design.test_orbits import Both, orbits
from tpd.design.orbits import Linearisation, margins
from tpd.design.search import SearchStatus, _status, best_apart, first_apart, screened_designs
from tpd.design.search import search as search_designs


def test_ends_are_ordered_by_risk_and_a_broken_limit_is_infinite(search):
    objective, found = search
    assert found.screened.shape == (48, 3)
    assert len(found.ends) == len(found.statuses) == 20
    values = found.end_values[found.order]
    assert np.all(np.diff(values[np.isfinite(values)]) >= 0.0)
    e = objective.evaluate(found.ends)
    kept = objective.constraints(e)[0].max(axis=1) <= 0.0
    np.testing.assert_array_equal(np.isfinite(found.end_values), kept)
    np.testing.assert_allclose(found.end_values[kept], objective.value(e)[kept], rtol=1e-10)
    assert found.end_values.min() == pytest.approx(0.2726536, abs=1e-6), "as with 64 starts"


def test_the_history_tells_what_the_finish_adds(search):
    objective, found = search
    assert found.finished < found.descended
    assert found.told.startswith(f"The descents reach {found.descended:.4g}, and the finish lowers this by ")
    alone = search_designs(objective, tpd.Descent(searches=20, screening=48, steps=8, finish=0), 0)
    assert alone.finished == alone.descended
    assert alone.told.endswith("the finish finds nothing better.")


def test_designs_on_the_paths_lie_apart_from_each_other_and_from_the_ends(search):
    _, found = search
    every = WIDE.scaled(np.concatenate([found.ends, found.passed]))
    assert 20 < len(every) <= 68
    for i in range(20, len(every)):
        assert np.linalg.norm(every[:i] - every[i], axis=1).min() > 0.05


def test_a_search_may_begin_fewer_times_than_asked_for():
    """Where the space is a point, screened designs coincide."""
    calm = orbits(conditions=tpd.Conditions.amplitudes(0.01, 0.02), limits=())
    out = search_designs(calm, tpd.Descent(searches=24, screening=24, steps=2, model=tpd.Piecewise()), 0)
    assert len(out.statuses) == len(out.ends) <= 24
    assert all(np.isfinite(out.end_values))


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({}, SearchStatus.converged),
        ({"converged": False}, SearchStatus.steps_exhausted),
        ({"x": 0.0}, SearchStatus.at_bound),
        ({"limit": -1e-4}, SearchStatus.at_limit),
        ({"limit": 0.1}, SearchStatus.infeasible),
        ({"value": np.inf}, SearchStatus.infeasible),
        ({"value": -0.1}, SearchStatus.rests),
        ({"contradicted": True}, SearchStatus.contradicted),
    ],
)
def test_every_search_ends_with_a_status(changed, expected):
    given = {"value": 0.3, "limit": -0.5, "x": 0.5, "converged": True, "contradicted": False} | changed
    none = np.zeros((1, 2, 3))
    at = Linearisation(np.full((1, 2), given["value"]), none, np.full((1, 2), given["limit"]), none)
    assert _status(np.full(3, given["x"]), at, given["contradicted"], given["converged"]) is expected


def test_an_objective_of_the_user_moves_the_optimum_its_way():
    """The more the bob's angle counts, the smaller it is at the optimum, and the larger the tilt."""
    settings, sizes = tpd.Descent(searches=4, screening=64, steps=10, model=tpd.Piecewise()), []
    for weight in (0.0, 0.3):
        o = orbits(limits=tpd.limits.POINT_BOB[1:], objective=Both(weight))
        found = search_designs(o, settings, 0)
        e = o.evaluate(found.ends[found.order[:1]])
        sizes.append((float(e.tilt.max()), float(e.stroke.max())))
    assert sizes[0][0] < sizes[1][0]
    assert sizes[0][1] > sizes[1][1]


def test_values_that_are_not_divided_by_a_size_of_reference_are_rejected():
    @dataclasses.dataclass(frozen=True)
    class Newtons(Both):
        def values(self, e, g):
            return tpd.limits.Size("force", 1e3 * (1.0 + e.tilt), 1e3 * e.tilt_slope)

    with pytest.raises(ValueError, match="objective tilt and swing must be between 0 and 1"):
        search_designs(orbits(objective=Newtons(0.0)), tpd.Descent(screening=16), 0)


def test_a_quarter_of_the_screened_designs_has_the_largest_margins():
    objective = orbits()
    designs = screened_designs(objective, 40, seed=2)
    assert designs.shape == (40, 3)
    np.testing.assert_array_equal(designs, screened_designs(objective, 40, seed=2))
    assert not np.array_equal(designs, screened_designs(objective, 40, seed=3))
    least = margins(objective, designs).min(axis=1)
    assert least[30:].min() > np.median(least[:30])
    assert screened_designs(objective, 1, seed=2).shape == (1, 3)


def test_the_best_designs_that_lie_apart_come_first():
    units = np.array([[0.5, 0.5], [0.51, 0.5], [0.9, 0.9], [0.1, 0.1], [0.505, 0.5]])
    values = np.array([1.0, 2.0, 4.0, 3.0, 1.5])
    np.testing.assert_array_equal(best_apart(units, values, 3), [0, 3, 2])
    np.testing.assert_array_equal(best_apart(units, values, 5), [0, 3, 2, 4, 1])
    # Designs that coincide count once.
    np.testing.assert_array_equal(best_apart(units[[0, 0, 2]], values[[0, 0, 2]], 3), [0, 2])


def test_the_first_of_an_order_that_are_no_neighbours():
    units = np.array([[0.5, 0.5], [0.51, 0.5], [0.9, 0.9], [0.1, 0.1]])
    order = np.array([1, 0, 3, 2])
    assert first_apart(units, order, 4) == [1, 3, 2]
    assert first_apart(units, order, 2) == [1, 3]
    assert first_apart(units, order, 4, fixed=2) == [1, 0, 3, 2]
    assert first_apart(units, order[:0], 4) == []
