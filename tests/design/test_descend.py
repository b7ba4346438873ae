"""Descents and their finish: known minima, curved limits, designs without a value, and active constraints."""

import dataclasses

import numpy as np
import optax
import pytest

import tpd
from tests.design.conftest import BAND, WIDE
from tests.design.minimax import FREE, LIMITED, STARTS, WORST, in_unit_square, linearisations
from tests.design.test_orbits import orbits
from tpd.design.descend import active_constraints, descend, finish, smoothed_merit, transformation


def finished(problem, starts=STARTS, cap=1.0, risk=WORST, **more):
    """Ends of the finish from each start: designs and merits."""
    ends = [finish(problem, x, problem(x[None]), cap, risk, **more) for x in starts]
    return ends, np.array([float(risk(e.local.value)[0]) for e in ends]), np.array([e.x for e in ends])


def test_a_known_minimax_is_reached_from_everywhere():
    ends, merit, x = finished(FREE)
    np.testing.assert_allclose(merit, 1.9522245, rtol=1e-6)
    np.testing.assert_allclose(6.0 * x - 3.0, [[1.13904, 0.89956]] * 4, atol=1e-3)
    assert all(e.converged for e in ends)
    assert not any(e.converged for e in finished(FREE, steps=2)[0]), "where the steps run out"


def test_the_mean_of_the_worst_share_is_minimised():
    """Of three functions the mean of the worst two, least on the limit where two of them are equal: there
    x^2 + (1.5 - x)^4 = 2 e^(1.5 - 2 x)."""
    risk = tpd.Risk.cvar(2.0 / 3.0)
    np.testing.assert_allclose(finished(LIMITED, cap=risk.cap(3), risk=risk.of)[1], 2.20740775, rtol=1e-6)


def test_a_constraint_and_a_smooth_bottom_are_reached():
    bowl = [lambda x, y: ((x - 2) ** 2 + 10 * (y - 1) ** 2, (2 * x - 4, 20 * y - 20))]
    line = [lambda x, y: (x + y - 2.0, (np.ones_like(x), np.ones_like(y)))]
    start = np.array([[0.5, 0.5]])
    free = finished(in_unit_square(linearisations(bowl)), start)[2]
    np.testing.assert_allclose(6.0 * free - 3.0, [[2.0, 1.0]], atol=1e-3)
    held = finished(in_unit_square(linearisations(bowl, line)), start)[2]
    # Lagrange: x = 2 - 10/11, y = 1 - 1/11.
    np.testing.assert_allclose(6.0 * held - 3.0, [[2.0 - 10 / 11, 1.0 - 1 / 11]], atol=1e-3)


def test_a_curved_limit_is_followed_to_its_end():
    """Along a ring to its rightmost point, where every straight step leaves the ring."""

    def ring(sign):
        return lambda x, y: (sign * 0.2 * (x**2 + y**2 - 1), (sign * 0.4 * x, sign * 0.4 * y))

    right = [lambda x, y: (-x, (-np.ones_like(x), np.zeros_like(y)))]
    problem = in_unit_square(linearisations(right, [ring(1.0), ring(-1.0)]))
    (end,), _, x = finished(problem, np.array([[np.cos(2.5) + 3.0, np.sin(2.5) + 3.0]]) / 6.0)
    np.testing.assert_allclose(6.0 * x - 3.0, [[1.0, 0.0]], atol=1e-4)
    assert end.evaluations < 40
    assert end.converged


def test_a_finish_from_no_value_takes_no_step_and_others_go_around():
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


@pytest.mark.parametrize("optimiser", ["adam", "rmsprop", optax.adam(0.01)], ids=["adam", "rmsprop", "own"])
@pytest.mark.parametrize(("problem", "least"), [(FREE, 1.9522245), (LIMITED, 3.125)])
def test_a_known_minimax_is_approached(optimiser, problem, least):
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
    assert np.all(np.diff(ends.path_merit, axis=0) <= 0.0), "the best designs so far"
    alone = descended(problem, settings, STARTS[1:2])
    np.testing.assert_allclose(alone.x[0], ends.x[1], rtol=1e-9)


def test_a_descent_without_a_value_goes_back_to_the_best_design():
    """Beyond x = 0.6 nothing is known, and there the minimum lies. A descent ends at that edge, well below
    its start (8.0), though not at the best place of the edge (2.97): no derivative leads along it."""

    def holed(unit):
        at = FREE(unit)
        return at._replace(value=np.where(unit[:, :1] > 0.6, np.inf, at.value))

    found = descended(holed, tpd.Descent(steps=60), STARTS[2:3])
    assert 0.59 < found.x[0, 0] <= 0.6
    assert found.merit[0] < 4.0


def test_active_constraints_are_conditions_limits_and_bounds():
    e = orbits().evaluate(np.array([[0.2, 0.26, 0.35]]))
    stroke = e.stroke[0]
    limits = (tpd.limits.Stroke(float(stroke.max())), tpd.limits.Tilt(1.0))
    found = active_constraints(orbits(limits=limits), np.array([0.2, 0.26, 0.35]))
    worst = int(np.argmax(e.tilt[0]))
    assert found[0] == ("condition", "tilt", BAND.label(worst), e.tilt[0, worst])
    assert [str(a) for a in found[1:]] == [
        f"limit on stroke at {BAND.label(int(np.argmax(stroke)))}",
        "upper bound of the mass ratio, 0.2",
    ]
    every = active_constraints(orbits(limits=limits), np.array([0.2, 0.26, 0.35]), 1.0)
    assert [a.value for a in every[:5]] == sorted(e.tilt[0], reverse=True)
    mean = dataclasses.replace(orbits(limits=()), risk=tpd.Risk.expected())
    assert active_constraints(mean, WIDE.unscaled(np.full(3, 0.5))) == (), "in a mean all count alike"
