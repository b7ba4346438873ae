"""The nonlinear equations by compiled series, against diffrax from event to event."""

import math

import jax
import numpy as np
import pytest

from tests.exact.test_trajectory import STICKING
from tests.reference import HUNG, LEANING, OVERTURNING, STILL, parameters
from tests.segmented import Segmented
from tpd import Nonlinear, Parameters, simulate, status_name, steady_state
from tpd.scene.parameters import as_arrays


@pytest.mark.parametrize("x", [HUNG[0].x, HUNG[3].x, STICKING, STILL.x, OVERTURNING], ids=str)
def test_a_steady_state_is_that_of_integration(x):
    ours = steady_state(parameters(x), model=Nonlinear())
    theirs = jax.jit(lambda p: steady_state(p, model=Segmented()))(as_arrays(parameters(x)))
    name = status_name(ours.status)
    assert name == status_name(theirs.status)
    assert math.isnan(ours.multiplier)
    assert math.isnan(ours.lyapunov)
    assert ours.amplitude == pytest.approx(float(theirs.amplitude), rel=2e-7, abs=1e-8 * x[0])
    if name in ("rocking", "sticking"):
        assert ours.stroke == pytest.approx(float(theirs.stroke), rel=1e-6)
        # What capture at rest leaves out is of the square of its speed.
        np.testing.assert_allclose(ours.state, theirs.state, rtol=0, atol=1e-6)
        assert (ours.periods, bool(ours.symmetric)) == (int(theirs.periods), bool(theirs.symmetric))


def test_a_block_that_friction_holds_is_held():
    found = steady_state(parameters(LEANING[0]), y0=np.array(LEANING[1]), model=Nonlinear())
    assert status_name(found.status) == "held"
    assert found.amplitude == pytest.approx(LEANING[1][0], rel=1e-12)


def test_values_are_those_under_jit_and_derivatives_are_nan():
    x = HUNG[0].x

    def amplitude(nu):
        return steady_state(parameters((nu, *x[1:])), model=Nonlinear()).amplitude

    known = steady_state(parameters(x), model=Nonlinear()).amplitude
    assert jax.jit(amplitude)(x[0]) == jax.vmap(amplitude)(np.array([x[0]]))[0] == known
    assert math.isnan(jax.grad(amplitude)(x[0]))
    assert math.isnan(jax.jit(jax.grad(amplitude))(x[0]))


@pytest.mark.parametrize("count", [0, 40])
def test_states_over_time_are_those_of_integration(count):
    p, y0 = parameters(STICKING), np.array([0.02, 0.1, 0.0, -0.1])
    times = (count + np.array([0.3, 0.31, 1.0, 1.7, 4.25])) * 2.0 * np.pi / STICKING[6]
    ours = simulate(p, y0, times, model=Nonlinear())
    theirs = simulate(p, y0, times, model=Segmented(rtol=1e-11, rest_rate=1e-4))
    assert status_name(ours.status) == status_name(theirs.status)
    np.testing.assert_allclose(ours.ys, theirs.ys, rtol=0, atol=1e-8)
    slope = jax.jacfwd(lambda y: simulate(p, y, times, model=Nonlinear()).ys)(y0)
    assert np.all(np.isnan(slope))


def test_a_trajectory_ends_where_the_block_overturns():
    found = simulate(parameters(OVERTURNING), np.zeros(4), np.linspace(0.0, 60.0, 13), model=Nonlinear())
    assert status_name(found.status) == "overturned"
    finite = np.isfinite(found.ys).all(axis=1)
    assert finite[0]
    assert not finite[-1]


def test_too_few_events_are_said():
    p = Parameters(nu=0.25, mu=0.1, lam=0.6, zeta=0.1, k=0.05, f=0.4, xi=2.5)
    model = Nonlinear(max_events=1)
    assert status_name(steady_state(p, model=model).status) == "event_bound"
    assert status_name(simulate(p, np.zeros(4), [0.0, 9.0], model=model).status) == "event_bound"
