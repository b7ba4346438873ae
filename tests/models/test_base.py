"""A model of one's own by the interface: the rules of every model, and their compiled twins."""

import collections
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from tpd import Parameters, Piecewise, status_name, steady_state


class Plain(Piecewise):
    """The exact motions by the rules that every model goes by, in place of their twins in compiled code."""

    def settle(self, p, y0):
        """Follow a motion as `Piecewise` does. A flow of its own goes by the rules of every model."""
        return super().settle(p, y0)


def test_compiled_rules_are_those_of_every_model():
    rng = np.random.default_rng(5)
    found = collections.Counter()
    names = ("nu", "mu", "lam", "zeta", "k", "f", "xi", "rho", "e")

    @partial(jax.jit, static_argnums=0)
    def answer(model, x, y0):
        def sizes(x):
            s = steady_state(Parameters(**dict(zip(names, x, strict=True))), model=model, y0=y0)
            return jnp.concatenate([jnp.stack([s.amplitude, s.stroke, s.multiplier, s.lyapunov]), s.state]), s

        return jax.jacfwd(sizes, has_aux=True)(x)

    for _ in range(40):
        x = rng.uniform(
            [0.05, 0.0, 0.05, 0.0, 0.0, 0.02, 0.4, 0.5, 0.5], [0.4, 0.6, 1.5, 1.0, 0.3, 0.4, 3.0, 1.0, 1.0]
        )
        # Some conserve energy, some have a bob without mass, some a bob that swings for ever.
        kind = rng.integers(5)
        x[4], x[8] = (0.0, 1.0) if kind < 2 else (x[4] * rng.integers(2), x[8])
        x[1], x[3] = (0.0 if kind == 0 else x[1]), (0.0 if kind in (1, 2) else x[3])
        y0 = rng.integers(2) * rng.normal(size=4) * [0.05, 0.1, 0.02, 0.1]
        ours, theirs = (answer(model, x, y0) for model in (Piecewise(), Plain()))
        status = status_name(ours[1].status)
        found[status] += 1
        if status in ("aperiodic", "not_settled"):
            # Chaos is recognised in compiled code alone.
            assert status_name(theirs[1].status) == "not_settled"
            continue
        assert status == status_name(theirs[1].status)
        jax.tree.map(partial(np.testing.assert_allclose, rtol=1e-11, atol=1e-12), ours, theirs)
    assert set(found) == {"rocking", "sticking", "rest", "held", "overturned", "aperiodic"}
