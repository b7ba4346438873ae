"""Motions under ground motions as JAX sees them, and as batches of the host."""

import jax
import jax.numpy as jnp
import numpy as np

import tpd
from tests.exact.shaken import Case, operands
from tpd.exact.rows import ground_row_of
from tpd.models.compiled_shaken import follow, follow_all

BLOCK = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9)
HUNG = tpd.Pendulum(mass=450.0, length=0.9, damping_ratio=0.1)
SCENE = tpd.Scene(BLOCK, tpd.Pulse.one_sine(acceleration=3.0, frequency=1.2))
NAMES = ("tilt", "swing", "relative", "times", "state", "status", "impacts", "lifted")


def test_one_motion_is_that_of_a_batch_and_records_are_shared():
    p, pieces = SCENE.ground_parameters(HUNG), jnp.asarray(SCENE.motion.pieces())
    alone = jax.jit(lambda y0: follow(p, pieces, 3.0, y0, 1000))(jnp.zeros(4))
    rows, each, _ = operands([Case(BLOCK, HUNG, SCENE.motion)])
    np.testing.assert_allclose(ground_row_of(p), rows[0], rtol=1e-14)
    some = [np.zeros((2, 4)), each[0], each[0][:5]]
    batch, none = follow_all(np.repeat(rows, 3, axis=0), some, np.array([1, 2, 1]), np.full(3, 3.0))
    assert none is None
    for name in NAMES:
        found = np.asarray(getattr(batch, name))
        np.testing.assert_array_equal(found[0], found[2])
        np.testing.assert_allclose(found[0], getattr(alone, name), rtol=1e-12, atol=1e-14)
    assert batch.tilt[1] != batch.tilt[0]
