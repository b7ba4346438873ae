"""Periods of a motion with their derivatives, and the elimination that Newton's method uses."""

import jax
import numpy as np
import pytest

from tests.exact.plants import entry
from tests.reference import BARE, HUNG, along, exact, parameters
from tpd import Piecewise
from tpd.exact import near_orbits
from tpd.scene.parameters import as_arrays

eliminate = entry(near_orbits.eliminate)


def test_elimination_solves_and_tells_a_singular_matrix():
    rng = np.random.default_rng(2)
    for _ in range(20):
        a, b = rng.normal(size=(4, 4)), rng.normal(size=(4, 3))
        a[0, 0] = 0.0
        x = b.copy()
        assert eliminate(a.copy(), x) > 0.0
        np.testing.assert_allclose(a @ x, b, rtol=0, atol=1e-11)
    for added in (0.0, np.nan):
        singular = np.ones((4, 4))
        singular[3, 3] += added
        assert not eliminate(singular, np.ones((4, 1))) > 1e-12


@pytest.mark.parametrize("case", [HUNG[0], HUNG[3], BARE[1]], ids=lambda case: case.name)
def test_a_period_has_the_states_and_derivatives_of_the_trajectory(case):
    p, model = as_arrays(parameters(case.x)), Piecewise()
    y = np.asarray(exact(case.x, case.y0).steady.state) * 1.02
    settled = model.settle(p, np.asarray(case.y0))

    @jax.jit
    def end(y):
        cycle = model.cycle(p, settled, y)
        return cycle.end, cycle

    slopes, cycle = jax.jacfwd(end, has_aux=True)(y)
    times = np.linspace(0.0, 2.0 * np.pi / case.x[6], 361)
    ys, by, _ = along(case.x, y, times)
    felt = [0, 2] if case.x[1] == 0.0 else [0, 1, 2, 3]
    np.testing.assert_allclose(cycle.end[np.array(felt)], ys[-1, felt], rtol=0, atol=1e-12)
    np.testing.assert_allclose(slopes[np.ix_(felt, felt)], by[-1][np.ix_(felt, felt)], rtol=1e-9, atol=1e-9)
    largest = np.abs(ys[:, 0]).max()
    assert largest * (1.0 - 1e-12) <= float(cycle.amplitude) <= largest * (1.0 + 1e-3)
    assert bool(cycle.closed)
