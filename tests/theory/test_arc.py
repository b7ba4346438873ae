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
from tpd import Parameters, simulate
from tpd.theory import arc, holding_moment, impact
from tpd.theory.equations import Linear

SIGNS = [(side, direction) for side in (1, -1) for direction in (1, -1)]
SCENES = {
    "impacts with loss": ((0.25, 0.2, 0.8, 0.1, 0.0, 0.5, 3.5, 0.9), (0.1, 0.1, 0.0, -0.3)),
    "no pendulum": ((0.2, 0.0, 0.4, 0.2, 0.05, 0.1, 2.0, 1.0), (0.16, 0.0, 0.0, 0.0)),
    "sticking": ((0.25, 0.2, 0.34, 0.25, 0.28, 0.59, 2.62, 1.0), (0.1, 0.1, 0.0, 0.0)),
    "a bob without damping": ((0.15, 0.3, 0.3, 0.0, 0.02, 0.15, 4.2, 0.95), (0.05, 0.05, 0.0, 0.0)),
}


def excess(p: Parameters, y, tau, side):
    """The moment on a held block beyond that of its weight, and the friction that can balance it."""
    weight, moment = (1.0 + p.mu) * p.nu, float(holding_moment(p, y, tau))
    return (moment - side * weight, p.k) if y[0] else (moment, weight + p.k)


def signs_after(p: Parameters, y, tau, side):
    """The signs of the arc that follows an event."""
    if y[2]:
        return int(np.sign(y[0] or y[2])), int(np.sign(y[2]))
    moment, hold = excess(p, y, tau, side)
    direction = int(np.sign(moment)) if abs(moment) > hold else 0
    return (side if y[0] else direction or side), direction


def signals(p: Parameters, y, tau, side, direction):
    """Two numbers of which the first becomes negative at an impact, and one of them at another event."""
    if direction:
        return side * y[0], direction * y[2]
    moment, hold = excess(p, y, tau, side)
    return hold - moment, hold + moment


def followed(p: Parameters, y, end):
    """The state at `end` of a motion from tau = 0, and the kinds of its events: arcs in closed form, whose
    events are bracketed in steps of 0.01."""
    tau, y, events = 0.0, np.array(y), []
    signs = signs_after(p, y, tau, 1)
    while True:
        times = np.append(np.arange(tau + 0.002, end, 0.01)[:800], end)
        states = np.asarray(PATHS[signs](p, y, tau, np.resize(times, 801)))[: len(times)]
        values = np.array(
            [signals(p, state, time, *signs) for state, time in zip(states, times, strict=True)]
        )
        if not (values < 0.0).any():
            return states[-1], events
        i, which = np.argwhere(values < 0.0)[0]

        def state(time, y=y, tau=tau, signs=signs):
            return np.array(PATHS[signs](p, y, tau, np.full(801, time))[0])

        def signal(time, signs=signs, which=which, state=state):
            return signals(p, state(time), time, *signs)[which]

        time: Any = brentq(signal, times[i - 1], times[i], xtol=1e-15)
        y, tau = state(time), time
        if not signs[1]:
            events.append("release")
            signs = (signs[0] if y[0] else 1 - 2 * which), 1 - 2 * which
        elif which == 0:
            events.append("impact")
            y[0] = 0.0
            y, signs = np.array(impact(p, y)), (-signs[0], signs[1])
        else:
            y[2] = 0.0
            signs = signs_after(p, y, tau, signs[0])
            events.append("turn" if signs[1] else "hold")


def _path(side, direction):
    def path(p, y, tau, times):
        return jax.vmap(lambda t: arc(p, y, tau, t, side=side, direction=direction))(times)

    return jax.jit(path)


PATHS = {signs: _path(*signs) for signs in [*SIGNS, (1, 0), (-1, 0)]}


@pytest.mark.parametrize("signs", SIGNS, ids=str)
def test_an_arc_solves_the_equations(signs):
    p, y0 = parameters(SCENES["impacts with loss"][0]), jnp.array([0.1, -0.2, 0.3, 0.5])
    side, direction = signs
    for tau in (0.7, 1.0, 2.5):
        y, slope = jax.jvp(lambda t: arc(p, y0, 0.7, t, side=side, direction=direction), (tau,), (1.0,))
        expected = Linear(p).rates(y, float(side), float(direction), jnp.sin(p.xi * tau))
        assert_allclose(slope, expected, rtol=0.0, atol=1e-13)
    assert_allclose(arc(p, y0, 0.7, 0.7, side=side, direction=direction), y0, rtol=0.0, atol=1e-15)


def test_a_held_block_keeps_its_tilt_and_the_moment_on_it_is_that_of_the_equations():
    p, y0 = parameters(SCENES["impacts with loss"][0]), jnp.array([0.1, -0.2, 0.0, 0.5])
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


@pytest.mark.parametrize("name", SCENES)
def test_arcs_that_are_joined_at_events_are_the_motion_of_the_linear_model(name):
    x, y0 = SCENES[name]
    p = parameters(x)
    y, events = followed(p, y0, 8.0)
    assert {"hold", "release"} <= set(events) if name == "sticking" else events.count("impact") >= 3
    assert_allclose(y, simulate(p, y0, [0.0, 8.0]).ys[-1], rtol=0.0, atol=1e-12)


def test_derivatives_through_an_impact_agree_with_the_linear_model():
    x, y0 = map(jnp.array, SCENES["impacts with loss"])
    before = partial(arc, side=1, direction=-1)
    met: Any = brentq(lambda t: float(before(parameters(x), y0, 0.0, t)[0]), 0.1, 1.2, xtol=1e-15)
    end = met + 0.2

    def joined(x, y0):
        # One Newton step on the time of the impact, whose value is zero, gives the derivatives of this time.
        p = parameters(x)
        y, slope = jax.jvp(lambda t: before(p, y0, 0.0, t), (met,), (1.0,))
        t = met - y[0] / jax.lax.stop_gradient(slope[0])
        return arc(p, impact(p, before(p, y0, 0.0, t)), t, end, side=-1, direction=-1)

    def simulated(x, y0):
        return simulate(parameters(x), y0, [0.0, end]).ys[-1]

    expected = jax.jacfwd(simulated, argnums=(0, 1))(x, y0)
    for mode in jax.jacfwd, jax.jacrev:
        for ours, theirs in zip(mode(joined, argnums=(0, 1))(x, y0), expected, strict=True):
            assert_allclose(ours, theirs, rtol=1e-10, atol=1e-11)


def test_signs_are_checked():
    p = parameters(SCENES["no pendulum"][0])
    with pytest.raises(ValueError, match="`side` must be -1 or 1, but is 0"):
        arc(p, np.zeros(4), 0.0, 1.0, side=0, direction=1)
    with pytest.raises(ValueError, match="`direction` must be -1 or 0 or 1, but is 2"):
        arc(p, np.zeros(4), 0.0, 1.0, side=1, direction=2)
