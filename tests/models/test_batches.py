"""Many starts at once: the pool that follows them."""

import jax
import numpy as np
import pytest

from tests.reference import BARE, HUNG, parameters
from tests.reference import exact as solve
from tpd import Status
from tpd.models.batches import settle_all
from tpd.models.settling import scale_of
from tpd.scene.parameters import as_arrays

BARE_BLOCK = parameters(BARE[1].x)
"""Rests, rocks or overturns, as it starts."""


def columns(x):
    return as_arrays(parameters(list(x.T)))


@pytest.fixture(scope="module")
def crowd():
    """Designs around the known ones and all over the place, starts for them, and what they settle into."""
    rng = np.random.default_rng(7)
    low = np.array([0.03, 0.0, 0.02, 0.0, 0.0, 0.0, 0.3, 0.0])
    high = np.array([0.5, 1.0, 2.0, 1.0, 0.3, 1.0, 12.0, 1.0])
    x = low + (high - low) * rng.random((400, 8))
    x[:200, :7] = np.array([HUNG[i % 4].x for i in range(200)]) * rng.uniform(0.95, 1.05, (200, 7))
    x[:200, 7] = 1.0
    x[:, 0] = np.minimum(x[:, 0], 0.5)
    y0 = rng.uniform(-0.1, 0.1, (400, 4))
    return x, y0, settle_all(columns(x), y0)


def assert_equal_leaves(a, b):
    for one, other in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        np.testing.assert_array_equal(one, other)


def test_settled_motions_depend_on_neither_order_nor_workers_nor_the_size_of_the_batch(crowd):
    x, y0, together = crowd
    order = np.random.default_rng(3).permutation(len(x))
    shuffled = settle_all(columns(x[order]), y0[order], workers=1)
    assert_equal_leaves(jax.tree.map(lambda leaf: leaf[order], together), shuffled)
    few = settle_all(columns(x[190:203]), y0[190:203])
    assert_equal_leaves(jax.tree.map(lambda leaf: leaf[190:203], together), few)


def test_a_batch_settles_as_each_of_its_members_does(crowd):
    x, y0, together = crowd
    for i in (*range(6), *range(200, 230)):
        alone = solve(x[i], y0[i])
        # The pool stops where the motion has repeated to 1e-6, and slow decay has further to go.
        if alone.status in ("rocking", "sticking"):
            assert together.amplitude[i] == pytest.approx(alone.amplitude, abs=1e-3 * x[i, 0])
            assert np.max(np.abs(together.y[i] - alone.steady.state) / scale_of(parameters(x[i]))) < 1e-3
        elif alone.status in ("rest", "overturned"):
            assert (together.status == getattr(Status, alone.status))[i]


def test_single_numbers_belong_to_every_start(crowd):
    _, y0, _ = crowd
    one = settle_all(BARE_BLOCK, y0[:8])
    each = settle_all(jax.tree.map(lambda v: np.full(8, v), BARE_BLOCK), y0[:8])
    assert_equal_leaves(one, each)


@pytest.mark.parametrize(
    ("p", "y0", "shapes"),
    [
        (BARE_BLOCK, np.zeros((0, 4)), r"\[\] and \(0, 4\)"),
        (BARE_BLOCK, np.zeros((3, 2)), r"\[\] and \(3, 2\)"),
        (columns(np.array([HUNG[0].x] * 2)), np.zeros((3, 4)), r"\[\(2,\)\] and \(3, 4\)"),
    ],
)
def test_batches_of_other_shapes_are_refused(p, y0, shapes):
    with pytest.raises(
        ValueError,
        match=rf"`p`, `begin` and `ramp` must have shape \(n,\) and `y0` \(n, 4\), but have {shapes}",
    ):
        settle_all(p, y0)


def test_progress_is_told_to_the_end(crowd):
    seen = []
    settle_all(BARE_BLOCK, crowd[1][:20], workers=1, progress=lambda done, n: seen.append((done, n)))
    assert seen[-1] == (20, 20)
    assert sorted(seen) == seen
