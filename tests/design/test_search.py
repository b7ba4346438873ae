"""The search: screening, starts, order and statuses of the ends; descents by every optimiser, and designs
without a value. `test_newton` has more known minima."""

import dataclasses

import numpy as np
import optax
import pytest

import tpd
from tests.design.minimax import FREE, LIMITED, STARTS, WORST
from tests.design.test_orbits import Both, orbits
from tpd.design.newton import Linearisation
from tpd.design.search import Ends, SearchStatus, _status, best_apart, descend, screened_designs
from tpd.design.search import search as search_designs


def test_descent_results_are_ordered_by_risk_and_infeasible_ones_are_infinite(search):
    objective, found = search
    assert found.screened.shape == (48, 3)
    assert len(found.ends) == len(found.statuses) == 20
    values = found.end_values[found.order]
    assert np.all(np.diff(values[np.isfinite(values)]) >= 0.0)
    e = objective.evaluate(found.ends)
    kept = objective.constraints(e)[0].max(axis=1) <= 0.0
    np.testing.assert_array_equal(np.isfinite(found.end_values), kept)
    np.testing.assert_allclose(found.end_values[kept], objective.value(e)[kept], rtol=1e-10)
    assert found.end_values.min() == pytest.approx(0.2726536, abs=2e-6), "as with 64 starts and with SLSQP"


def test_the_search_reaches_the_least_factor_of_settling_that_many_starts_find(search):
    """64 starts of 512 screened designs, with three times as many steps, end at 0.6255692."""
    objective = dataclasses.replace(search[0], objective=tpd.limits.Settling())
    found = search_designs(objective, tpd.Descent(searches=4, screening=64, model=tpd.Piecewise()), 0)
    assert found.end_values.min() == pytest.approx(0.6255692, abs=1e-5)
    np.testing.assert_allclose(found.ends[found.order[0]], [0.18157, 1.33893, 0.4], rtol=1e-3)


def test_the_last_steps_on_the_exact_orbits_lower_the_risk(search):
    """The descents of few steps are the same, and the further steps never raise the merit."""
    objective, found = search
    settings = tpd.Descent(searches=20, screening=48, steps=8, polish=0, model=tpd.Piecewise())
    alone = search_designs(objective, settings, 0)
    assert alone.evaluations == 48 + 8 * 20
    assert found.evaluations == 48 + (8 + 60) * 20
    both = np.isfinite(alone.end_values)
    assert np.all(found.end_values[both] <= alone.end_values[both] + 1e-12)
    assert found.end_values.min() < alone.end_values.min()
    np.testing.assert_array_equal(alone.paths[0], found.paths[0][:9])
    # Eight steps are not enough, and the statuses of these descents say so.
    assert SearchStatus.steps_exhausted in alone.statuses


def test_equal_starting_designs_are_searched_once():
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
    ],
)
def test_every_search_ends_with_a_status(changed, expected):
    given = {"value": 0.3, "limit": -0.5, "x": 0.5, "converged": True} | changed
    none = np.zeros((1, 2, 3))
    at = Linearisation(np.full((1, 2), given["value"]), none, np.full((1, 2), given["limit"]), none)
    assert _status(np.full(3, given["x"]), at, given["converged"]) is expected


def test_an_objective_that_is_not_normalised_is_rejected():
    @dataclasses.dataclass(frozen=True)
    class Newtons(Both):
        def size(self, motion, design, geometry):
            return 1e3 * (1.0 + motion.tilt)

    with pytest.raises(ValueError, match="objective tilt and swing must be between 0 and 1"):
        search_designs(orbits(objective=Newtons(0.0)), tpd.Descent(screening=16), 0)


def test_a_quarter_of_the_screened_designs_has_the_largest_margins():
    objective = orbits()
    designs = screened_designs(objective, 40, seed=2)
    assert designs.shape == (40, 3)
    np.testing.assert_array_equal(designs, screened_designs(objective, 40, seed=2))
    assert not np.array_equal(designs, screened_designs(objective, 40, seed=3))
    least = objective.margins(designs).min(axis=1)
    assert least[30:].min() > np.median(least[:30])
    assert screened_designs(objective, 1, seed=2).shape == (1, 3)


def test_separated_designs_precede_their_neighbours():
    units = np.array([[0.5, 0.5], [0.51, 0.5], [0.9, 0.9], [0.1, 0.1], [0.505, 0.5]])
    values = np.array([1.0, 2.0, 4.0, 3.0, 1.5])
    np.testing.assert_array_equal(best_apart(units, values, 3), [0, 3, 2])
    np.testing.assert_array_equal(best_apart(units, values, 5), [0, 3, 2, 4, 1])
    # Designs that coincide count once.
    np.testing.assert_array_equal(best_apart(units[[0, 0, 2]], values[[0, 0, 2]], 3), [0, 2])


OPTIMISERS = {"newton": "newton", "adam": "adam", "own": optax.adam(0.01)}


@pytest.mark.parametrize("optimiser", OPTIMISERS.values(), ids=OPTIMISERS)
@pytest.mark.parametrize(("problem", "least"), [(FREE, 1.9522245), (LIMITED, 3.125)])
def test_every_optimiser_approaches_a_known_minimax(optimiser, problem, least):
    asked, done = [], []

    def recorded(units):
        asked.append(units.copy())
        return problem(units)

    given = 1.0, WORST
    ends = descend(
        optimiser,
        recorded,
        STARTS,
        problem(STARTS),
        *given,
        steps=160,
        after=lambda *event: done.append(event),
    )
    # The last width of the smoothing is 1e-4.
    np.testing.assert_allclose(ends.merit, least, rtol=1e-3 if optimiser == "newton" else 0.01)
    assert np.all(ends.merit >= least * (1.0 - 1e-6))
    assert np.all((np.concatenate(asked) >= 0.0) & (np.concatenate(asked) <= 1.0))
    assert done == [(i, 160) for i in range(1, 161)]
    assert ends.path.shape == (161, 4, 2)
    np.testing.assert_array_equal(ends.path[0], STARTS)
    np.testing.assert_array_equal(ends.path[-1], ends.x)
    alone = descend(optimiser, problem, STARTS[1:2], problem(STARTS[1:2]), *given, steps=160)
    np.testing.assert_allclose(alone.x[0], ends.x[1], rtol=1e-9)


@pytest.mark.parametrize("optimiser", ["newton", "adam"])
def test_a_descent_returns_to_its_best_design_after_an_unknown_value(optimiser):
    """Beyond x = 0.6 nothing is known, and there the minimum lies. A descent ends at that edge, well below
    its start (8.0), though not at the best place of the edge (2.97): no derivative leads along it."""

    def holed(unit):
        at = FREE(unit)
        return at._replace(value=np.where(unit[:, :1] > 0.6, np.inf, at.value))

    found = descend(optimiser, holed, STARTS[2:3], holed(STARTS[2:3]), 1.0, WORST, steps=60)
    assert 0.59 < found.x[0, 0] <= 0.6
    assert found.merit[0] < 4.0


def test_a_few_steps_without_gain_are_no_sign_of_convergence():
    """A step that is taken back leaves the merit as it was."""
    none = Linearisation(*np.zeros((4, 1, 1, 1)))
    x, falls = np.zeros((1, 1)), [5.0, 4.0, 3.0, 2.0, 1.0, 1.0]

    def ends(merits):
        return Ends(x, none, np.array(merits[-1:]), x, np.array(merits)[:, None])

    assert not ends(falls).converged
    assert not ends([2.0, 1.0]).converged
    assert ends([*falls, *[1.0] * 4]).converged
    assert ends([1.0, 1.0]).converged
    assert not ends([np.inf, 1.0]).converged
