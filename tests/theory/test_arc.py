"""Motion between two events in closed form, against the equations and against the models."""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq

from tests.reference import parameters
from tpd import simulate
from tpd.theory import arc, holding_moment, impact
from tpd.theory.equations import Linear

SIGNS = [(side, direction) for side in (1, -1) for direction in (1, -1)]
X, Y0 = jnp.array((0.25, 0.2, 0.8, 0.1, 0.0, 0.5, 3.5, 0.9)), jnp.array((0.1, 0.1, 0.0, -0.3))
"""Parameters and initial state of a block that has impacts with loss."""
P = parameters(X.tolist())


@pytest.mark.parametrize("signs", SIGNS, ids=str)
def test_an_arc_solves_the_equations(signs):
    p, y0 = P, jnp.array([0.1, -0.2, 0.3, 0.5])
    side, direction = signs
    for tau in (0.7, 1.0, 2.5):
        y, slope = jax.jvp(lambda t: arc(p, y0, 0.7, t, side=side, direction=direction), (tau,), (1.0,))
        expected = Linear(p).rates(y, float(side), float(direction), jnp.sin(p.xi * tau))
        assert_allclose(slope, expected, rtol=0.0, atol=1e-13)
    assert_allclose(arc(p, y0, 0.7, 0.7, side=side, direction=direction), y0, rtol=0.0, atol=1e-15)


def test_a_held_block_keeps_its_tilt_and_the_moment_on_it_is_that_of_the_equations():
    p, y0 = P, jnp.array([0.1, -0.2, 0.0, 0.5])
    linear = Linear(p)
    for tau in (0.7, 1.0, 2.5):
        y, slope = jax.jvp(lambda t: arc(p, y0, 0.7, t, side=1, direction=0), (tau,), (1.0,))
        assert_allclose(y[0], 0.1, rtol=0.0, atol=1e-15)
        assert_allclose([y[2], slope[2]], [0.0, 0.0], rtol=0.0, atol=1e-15)
        # Without inertia and hinge on the left, row 1 of (25) is the moment that would tilt the block.
        ddpsi = (linear.f * jnp.sin(p.xi * tau) - y[1] - linear.c2 * y[3]) / linear.m22
        assert_allclose(slope[3], ddpsi, rtol=0.0, atol=1e-14)
        moment = linear.tilt * (y[0] - linear.f * jnp.sin(p.xi * tau)) + linear.c1 * y[3] - linear.m12 * ddpsi
        assert_allclose(holding_moment(p, y, tau), moment, rtol=0.0, atol=1e-14)


def test_derivatives_through_an_impact_agree_with_the_linear_model():
    before = partial(arc, side=1, direction=-1)
    met: Any = brentq(lambda t: float(before(P, Y0, 0.0, t)[0]), 0.1, 1.2, xtol=1e-15)
    end = met + 0.2

    def joined(x, y0):
        # One Newton step on the time of the impact, whose value is zero, gives the derivatives of this time.
        p = parameters(x)
        y, slope = jax.jvp(lambda t: before(p, y0, 0.0, t), (met,), (1.0,))
        t = met - y[0] / jax.lax.stop_gradient(slope[0])
        return arc(p, impact(p, before(p, y0, 0.0, t)), t, end, side=-1, direction=-1)

    def simulated(x, y0):
        return simulate(parameters(x), y0, [0.0, end]).ys[-1]

    expected = jax.jit(jax.jacfwd(simulated, argnums=(0, 1)))(X, Y0)
    assert_allclose(joined(X, Y0), simulated(X, Y0), rtol=0.0, atol=1e-12)
    for mode in jax.jacfwd, jax.jacrev:
        for ours, theirs in zip(jax.jit(mode(joined, argnums=(0, 1)))(X, Y0), expected, strict=True):
            assert_allclose(ours, theirs, rtol=1e-10, atol=1e-11)


def test_signs_are_checked():
    for side, direction, words in (
        (0, 1, "`side` must be -1 or 1, but is 0"),
        (1, 2, "-1 or 0 or 1, but is 2"),
    ):
        with pytest.raises(ValueError, match=words):
            arc(P, np.zeros(4), 0.0, 1.0, side=side, direction=direction)
