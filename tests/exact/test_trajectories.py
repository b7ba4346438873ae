"""The linear equations by compiled code, as JAX sees them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tpd.exact.linear import cycle

from tests.reference import HUNG, LEANING, parameters, settled
from tpd import Piecewise, status_name, steady_state
from tpd.scene.parameters import as_arrays
from tpd.theory.equations import Terms


def test_reverse_and_forward_mode_agree():
    p = as_arrays(parameters(HUNG[1].x))
    forward, backward = (
        d(lambda p: steady_state(p, model=Piecewise()).amplitude)(p) for d in (jax.jacfwd, jax.jacrev)
    )
    for a, b in zip(jax.tree.leaves(forward), jax.tree.leaves(backward), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-13)


@pytest.mark.parametrize(("x", "y0", "status"), [(HUNG[0].x, (0.0,) * 4, "rocking"), (*LEANING, "held")])
def test_what_settled_goes_on_from_its_state_and_mode(x, y0, status):
    p = as_arrays(parameters(x))
    found = settled(Terms.linear, p, jnp.array(y0), periods=500, events=200, tolerance=1e-8)
    assert status_name(found.status) == status
    again = cycle(p, found, found.y, 200, 2e-7)
    felt = np.array([0, 2])
    np.testing.assert_allclose(again.end[felt], found.y[felt], rtol=0, atol=1e-7)
    assert float(again.amplitude) == pytest.approx(float(found.amplitude), rel=1e-6)
    assert bool(again.memory.equals(found.memory)) == bool(again.closed)
