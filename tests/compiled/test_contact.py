"""Contact and impacts in compiled code: against the event loop and by hand, for both equations."""

import numba
import numpy as np
import pytest

from tests.compiled.plants import plants_of
from tests.reference import WITH, EventDriven, parameters
from tpd.compiled import contact
from tpd.compiled.columns import REST, SLIP, STICK
from tpd.compiled.motion import MOTION
from tpd.theory.equations import Linear

X = (0.25, 0.05, 0.2, 0.1, 0.05, 0.377, 2.67, 0.7)
DECISIONS = [
    (0.0, 0.1, 0.0, 0.0, (REST, 0.0, 0.0)),
    (0.0, -0.25, 0.0, 0.0, (REST, 0.0, 0.0)),
    (0.0, -0.26, 0.0, 0.0, (SLIP, 1.0, 1.0)),
    (0.0, 0.26, 0.0, 0.0, (SLIP, -1.0, -1.0)),
    (0.0, 0.1, 0.0, -1.0, (SLIP, -1.0, -1.0)),
    (-0.1, 0.06, -1.0, 0.0, (STICK, -1.0, 0.0)),
    (-0.1, 0.04, -1.0, 0.0, (SLIP, -1.0, 1.0)),
    (0.1, -0.14, 1.0, -1.0, (SLIP, 1.0, -1.0)),
]
"""Tilt and forcing of a block without a pendulum whose weight and friction balance 0.2 and 0.05, signs of
tilt and rate, and the mode."""
both_equations = pytest.mark.parametrize("linear", [True, False])


@numba.njit
def decide(plants, y, tilt, direction, eta, modes):
    contact.decide(plants[0], y, tilt, direction, eta, modes[0])


@numba.njit
def excess(plants, y, side, eta):
    return contact.excess(plants[0], y[0], y[1], y[3], side, eta)


@numba.njit
def impact(plants, rests, side, psi):
    return contact.impact(plants[0], rests, side, psi)


@numba.njit
def land(plants, y, capture, modes):
    return contact.land(plants[0], y, capture, 0.0, modes[0])


@numba.njit
def turn(plants, y, at_once, modes):
    contact.turn(plants[0], y, at_once, 0.0, modes[0])


def motion(*mode):
    """A motion in a mode."""
    modes = np.zeros(1, MOTION)
    modes["kind"], modes["tilt"], modes["direction"] = mode
    return modes


def mode_of(modes):
    return tuple(float(modes[name][0]) for name in ("kind", "tilt", "direction"))


@both_equations
@pytest.mark.parametrize(("phi", "eta", "tilt", "rate", "expected"), DECISIONS)
def test_a_block_is_held_while_friction_balances_the_excess(phi, eta, tilt, rate, expected, linear):
    plants, modes = plants_of([(0.2, 0.0, 0.4, 0.2, 0.05, 1.0, 2.0)], linear), motion(REST, 0.0, 0.0)
    decide(plants, np.array([phi, 0.0, 0.0, 0.0]), tilt, rate, eta, modes)
    assert mode_of(modes) == expected


@both_equations
def test_the_excess_moment_on_a_held_block_equals_that_of_the_event_loop(linear):
    plants, loop = plants_of([X], linear), EventDriven(X, nonlinear=not linear)
    for y in np.random.default_rng(2).normal(scale=0.4, size=(20, 4)) * [1.0, 1.0, 0.0, 1.0]:
        for side in (1.0, -1.0):
            expected = loop.excess(0.4, y, side)
            assert excess(plants, y, side, np.sin(2.67 * 0.4)) == pytest.approx(expected, rel=0, abs=1e-15)


@both_equations
@pytest.mark.parametrize(("speed", "friction", "ends"), [(1e-7, 0.05, (1, 1)), (0.1, 0.05, (0, 1))])
def test_a_slow_impact_on_a_block_that_can_be_held_is_the_last(linear, speed, friction, ends):
    plants, modes, y = plants_of([X], linear), motion(SLIP, 1.0, -1.0), np.array([0.0, 0.0, -speed, 0.0])
    assert land(plants, y, 1e-6, modes) == ends
    share = 0.0 if ends[0] else -0.7
    np.testing.assert_allclose(y, [0.0, 0.0, share * speed, (1.0 + share) * 10.0 * speed], rtol=1e-12)
    assert mode_of(modes) == ((REST, 0.0, 0.0) if ends[0] else (SLIP, -1.0, -1.0))


@both_equations
def test_a_turning_block_falls_back_or_stays(linear):
    for phi, k, at_once, kind in (
        (0.02, 0.05, False, SLIP),
        (0.02, 0.05, True, STICK),
        (0.02, 0.3, False, STICK),
        (0.0, 0.05, True, REST),
    ):
        modes = motion(SLIP, 1.0, 1.0)
        turn(plants_of([(*X[:4], k, *X[5:])], linear), np.array([phi, 0.0, 0.0, 0.0]), at_once, modes)
        assert mode_of(modes)[:2] == (kind, 1.0)
        assert kind != SLIP or modes["direction"][0] == -1.0


def test_an_impact_conserves_the_momentum_of_the_bob_and_a_rattle_sums_its_impacts():
    x = (*WITH[0].x, 0.7)
    p, linear, plants = parameters(x), Linear(parameters(x)), plants_of([x])
    rates = np.array([[0.7, -0.2]])
    for _ in range(200):
        block, bob = impact(plants, False, 1.0, 0.0)
        rates = np.vstack([rates, rates[-1] + rates[-1, 0] * np.array([block, bob])])
        # The impulse acts on the first row alone.
        jump = rates[-1] - rates[-2]
        assert float(linear.m21 * jump[0] + linear.m22 * jump[1]) == pytest.approx(0.0, abs=1e-16)
    np.testing.assert_allclose(rates[:, 0], 0.7 ** np.arange(1, 202), rtol=1e-13)
    captured = rates[0] + rates[0, 0] * np.array(impact(plants, True, 1.0, 0.0))
    np.testing.assert_allclose(captured, [0.0, -0.2 - 2.0 / float(p.lam) * 0.7], rtol=1e-15)
    np.testing.assert_allclose(captured, rates[-1], rtol=1e-13, atol=1e-30)
