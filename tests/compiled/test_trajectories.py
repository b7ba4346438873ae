"""Runs over time as JAX sees them: derivatives in both modes, and periodic motions that come back."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import LEANING, WITH, parameters, settled
from tpd import Piecewise, Terms, simulate, status_name, steady_state
from tpd.compiled.trajectories import trajectory
from tpd.scene.parameters import as_arrays


@pytest.mark.parametrize("size", ["amplitude", "state"])
def test_reverse_and_forward_mode_agree(size):
    p = as_arrays(parameters(WITH[1].x))

    def answer(p):
        if size == "amplitude":
            return steady_state(p, model=Piecewise()).amplitude
        return simulate(p, np.zeros(4), [0.0, 4.0]).ys[-1]

    forward, backward = (d(answer)(p) for d in (jax.jacfwd, jax.jacrev))
    for a, b in zip(jax.tree.leaves(forward), jax.tree.leaves(backward), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12)


@pytest.mark.parametrize("equations", [Terms.linear, Terms.nonlinear])
@pytest.mark.parametrize(("x", "y0", "status"), [(WITH[3].x, (0.0,) * 4, "rocking"), (*LEANING, "held")])
def test_a_settled_state_returns_after_its_periods(equations, x, y0, status):
    p = as_arrays(parameters(x))
    found = settled(equations, p, jnp.array(y0), tolerance=1e-8)
    assert status_name(found.status) == status
    times = jnp.array([0.0, float(found.periods) * float(p.period)])
    ys, end = trajectory(equations, p, found.state, times, events=200, rest_rate=2e-7, rtol=1e-10)
    felt = np.array([0, 2])
    np.testing.assert_allclose(ys[-1][felt], found.state[felt], rtol=0, atol=1e-7)
    assert status_name(end) == "rocking"
