"""The search: screening, starts, order and statuses of the ends; descents and their finish: known minima,
curved limits, and designs without a value."""

import dataclasses

import numpy as np
import optax
import pytest

import tpd
from tests.design.minimax import FREE, LIMITED, STARTS, WORST, in_unit_square, linearisations
from tests.design.test_orbits import Both, orbits
from tpd.core.formatting import percent
from tpd.design.orbits import Linearisation
from tpd.design.search import (
    SearchStatus,
    _status,
    best_apart,
    descend,
    finish,
    first_apart,
    screened_designs,
    smoothed_merit,
    transformation,
)
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
    assert found.end_values.min() == pytest.approx(0.2726536, abs=1e-6), "as with 64 starts"


def test_the_message_of_a_search_states_the_gain_of_the_final_optimiser(search):
    objective, found = search
    assert found.finished < found.descended
    tilts = (percent(x, 1) for x in (found.descended, found.finished))
    after = "is {} of the toppling tilt after the descents, and {} after the finish."
    assert found.message.endswith(after.format(*tilts))
    alone = search_designs(objective, tpd.Descent(searches=20, screening=48, steps=8, finish=0), 0)
    assert alone.finished == alone.descended
    assert alone.message.endswith("and the finish does not lower it.")
    at_rest = dataclasses.replace(found, descended=0.1, finished=-0.2)
    assert at_rest.message.endswith(
        "-20.0 % after the finish; a negative number is the margin of a block at rest."
    )
    assert "no design" in dataclasses.replace(found, descended=np.inf).message


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
        ({"contradicted": True}, SearchStatus.contradicted),
    ],
)
def test_every_search_ends_with_a_status(changed, expected):
    given = {"value": 0.3, "limit": -0.5, "x": 0.5, "converged": True, "contradicted": False} | changed
    none = np.zeros((1, 2, 3))
    at = Linearisation(np.full((1, 2), given["value"]), none, np.full((1, 2), given["limit"]), none)
    assert _status(np.full(3, given["x"]), at, given["contradicted"], given["converged"]) is expected


def test_a_user_objective_on_the_swing_reduces_the_swing():
    """The more the bob's angle counts, the smaller it is at the optimum, and the larger the tilt."""
    settings, sizes = tpd.Descent(searches=4, screening=64, steps=10, model=tpd.Piecewise()), []
    for weight in (0.0, 0.3):
        o = orbits(limits=tpd.limits.POINT_BOB[1:], objective=Both(weight))
        found = search_designs(o, settings, 0)
        e = o.evaluate(found.ends[found.order[:1]])
        sizes.append((float(e.tilt.max()), float(e.swing.max())))
    assert sizes[0][0] < sizes[1][0]
    assert sizes[0][1] > sizes[1][1]


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


def test_first_apart_skips_neighbours_of_earlier_designs():
    units = np.array([[0.5, 0.5], [0.51, 0.5], [0.9, 0.9], [0.1, 0.1]])
    order = np.array([1, 0, 3, 2])
    assert first_apart(units, order, 4) == [1, 3, 2]
    assert first_apart(units, order, 2) == [1, 3]
    assert first_apart(units, order, 4, fixed=2) == [1, 0, 3, 2]
    assert first_apart(units, order[:0], 4) == []


def finished(problem, starts=STARTS, cap=1.0, risk=WORST, **more):
    """Ends of the finish from each start: designs and merits."""
    ends = [finish(problem, x, problem(x[None]), cap, risk, **more) for x in starts]
    return ends, np.array([float(risk(e.local.value)[0]) for e in ends]), np.array([e.x for e in ends])


def test_the_final_optimiser_reaches_a_known_minimax_from_every_start():
    ends, merit, x = finished(FREE)
    np.testing.assert_allclose(merit, 1.9522245, rtol=1e-6)
    np.testing.assert_allclose(6.0 * x - 3.0, [[1.13904, 0.89956]] * 4, atol=1e-3)
    assert all(e.converged for e in ends)
    assert not any(e.converged for e in finished(FREE, steps=2)[0]), "where the steps run out"


def test_the_final_optimiser_minimises_the_conditional_value_at_risk():
    """Of three functions the mean of the worst two, least on the limit where two of them are equal: there
    x^2 + (1.5 - x)^4 = 2 e^(1.5 - 2 x)."""
    risk = tpd.Risk.cvar(2.0 / 3.0)
    np.testing.assert_allclose(finished(LIMITED, cap=risk.cap(3), risk=risk.of)[1], 2.20740775, rtol=1e-6)


def test_the_final_optimiser_reaches_free_and_constrained_minima():
    bowl = [lambda x, y: ((x - 2) ** 2 + 10 * (y - 1) ** 2, (2 * x - 4, 20 * y - 20))]
    line = [lambda x, y: (x + y - 2.0, (np.ones_like(x), np.ones_like(y)))]
    start = np.array([[0.5, 0.5]])
    free = finished(in_unit_square(linearisations(bowl)), start)[2]
    np.testing.assert_allclose(6.0 * free - 3.0, [[2.0, 1.0]], atol=1e-3)
    held = finished(in_unit_square(linearisations(bowl, line)), start)[2]
    # Lagrange: x = 2 - 10/11, y = 1 - 1/11.
    np.testing.assert_allclose(6.0 * held - 3.0, [[2.0 - 10 / 11, 1.0 - 1 / 11]], atol=1e-3)


def test_the_final_optimiser_follows_a_curved_constraint():
    """Along a ring to its rightmost point, where every straight step leaves the ring."""

    def ring(sign):
        return lambda x, y: (sign * 0.2 * (x**2 + y**2 - 1), (sign * 0.4 * x, sign * 0.4 * y))

    right = [lambda x, y: (-x, (-np.ones_like(x), np.zeros_like(y)))]
    problem = in_unit_square(linearisations(right, [ring(1.0), ring(-1.0)]))
    (end,), _, x = finished(problem, np.array([[np.cos(2.5) + 3.0, np.sin(2.5) + 3.0]]) / 6.0)
    np.testing.assert_allclose(6.0 * x - 3.0, [[1.0, 0.0]], atol=1e-4)
    assert end.evaluations < 40
    assert end.converged


def test_the_final_optimiser_makes_no_step_from_an_unknown_value():
    def holed(units):
        at = FREE(units)
        return at._replace(value=np.where(units[:, :1] > 0.75, np.inf, at.value))

    ends, merit, x = finished(holed)
    assert [e.evaluations == 0 for e in ends] == [False, True, False, False]
    np.testing.assert_array_equal(x[1], STARTS[1])
    np.testing.assert_allclose(merit[[0, 2, 3]], 1.9522245, rtol=1e-6)


def descended(problem, settings, starts=STARTS, **more):
    optimiser, local = transformation(settings), problem(starts)
    return descend(optimiser, problem, starts, local, 1.0, WORST, steps=settings.steps, **more)


@pytest.mark.parametrize("cap", [1.0, 0.5, 1.0 / 3.0])
def test_the_smoothed_merit_tends_to_the_risk_and_has_correct_derivatives(cap):
    risk = tpd.Risk.cvar(1.0 / (3.0 * cap))
    at = LIMITED(STARTS)
    sharp = risk.of(at.value) + 10.0 * np.maximum(at.limit[:, 0], 0.0)
    np.testing.assert_allclose(smoothed_merit(at, cap, 1e-7)[0], sharp, atol=1e-5)
    _, slope = smoothed_merit(at, cap, 0.3)
    for i in range(2):
        step = 1e-6 * np.eye(2)[i]
        up, down = (smoothed_merit(LIMITED(STARTS + s * step), cap, 0.3)[0] for s in (1, -1))
        np.testing.assert_allclose(slope[:, i], (up - down) / 2e-6, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("optimiser", ["adam", "rmsprop", optax.adam(0.01)], ids=["adam", "rmsprop", "own"])
@pytest.mark.parametrize(("problem", "least"), [(FREE, 1.9522245), (LIMITED, 3.125)])
def test_every_first_order_optimiser_approaches_a_known_minimax(optimiser, problem, least):
    asked, done = [], []

    def recorded(units):
        asked.append(units.copy())
        return problem(units)

    settings = tpd.Descent(optimiser, steps=160)
    ends = descended(recorded, settings, after=lambda *event: done.append(event))
    np.testing.assert_allclose(ends.merit, least, rtol=0.03)
    assert np.all(ends.merit >= least * (1.0 - 1e-6))
    assert np.all((np.concatenate(asked) >= 0.0) & (np.concatenate(asked) <= 1.0))
    assert done == [(i, 160) for i in range(1, 161)]
    assert ends.path.shape == (161, 4, 2)
    np.testing.assert_array_equal(ends.path[0], STARTS)
    np.testing.assert_array_equal(ends.path[-1], ends.x)
    alone = descended(problem, settings, STARTS[1:2])
    np.testing.assert_allclose(alone.x[0], ends.x[1], rtol=1e-9)


def test_a_descent_returns_to_its_best_design_after_an_unknown_value():
    """Beyond x = 0.6 nothing is known, and there the minimum lies. A descent ends at that edge, well below
    its start (8.0), though not at the best place of the edge (2.97): no derivative leads along it."""

    def holed(unit):
        at = FREE(unit)
        return at._replace(value=np.where(unit[:, :1] > 0.6, np.inf, at.value))

    found = descended(holed, tpd.Descent(steps=60), STARTS[2:3])
    assert 0.59 < found.x[0, 0] <= 0.6
    assert found.merit[0] < 4.0


@pytest.mark.parametrize("status", list(SearchStatus))
def test_descriptions_of_descent_statuses_do_not_begin_with_a_verb(status):
    """A report puts a number before them."""
    assert status.value.split()[0] not in ("is", "are", "was", "were", "has", "have", "does", "do")
