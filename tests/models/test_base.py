"""Models that compiled code solves: one rule book, which a subclass does not change."""

import jax
import numpy as np
import pytest

from tests.reference import box
from tpd import Nonlinear, Parameters, Piecewise, status_name, steady_state
from tpd.compiled.simulate import EVENTS, PERIODS, REST_RATES


def same(kind):
    """A subclass of a model that changes nothing."""

    class Same(kind):
        """Follow a motion as the class does."""

        def settle(self, p, y0):
            """See `Model.settle`."""
            return super().settle(p, y0)

    return Same()


@pytest.mark.parametrize("kind", [Piecewise, Nonlinear])
def test_an_unchanged_subclass_of_a_model_gives_equal_results(kind):
    names, found = ("nu", "mu", "lam", "zeta", "k", "f", "xi", "e"), set()
    # The first does not repeat, and by rules of their own motions of subclasses were not settled.
    wandering = (0.22890152, 0.1550568, 1.56917923, 0.0, 0.05825169, 0.87740434, 8.26180769, 1.0)
    designs, starts = box(120, seed=21)
    for x, y0 in zip([wandering, *designs], [np.zeros(4), *starts], strict=True):
        p = Parameters(**dict(zip(names, map(float, x), strict=True)))
        ours, theirs = (steady_state(p, model=model, y0=y0) for model in (same(kind), kind()))
        found.add(status_name(ours.status))
        for a, b in zip(jax.tree.leaves(ours), jax.tree.leaves(theirs), strict=True):
            np.testing.assert_array_equal(a, b)
    assert found >= {"rocking", "sticking", "rest", "held", "overturned"}


@pytest.mark.parametrize("model", [Piecewise(), Nonlinear()])
def test_default_bounds_of_a_model_equal_those_of_a_batch(model):
    assert model.max_periods == PERIODS[model.equations]
    assert model.max_events == EVENTS
    assert model.rest_rate == REST_RATES[model.equations]
