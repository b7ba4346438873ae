"""Symmetric orbits of batches on the host, and of one design under JAX."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.compiled.orbit_cases import ROWS
from tests.reference import parameters
from tpd.compiled import orbits as engine
from tpd.compiled.columns import SIZES, WIDTH
from tpd.compiled.rows import row_of

X = np.array([row_of(parameters(row["parameters"])) for row in ROWS[:40]])


def test_orbits_do_not_depend_on_threads_or_batch():
    calls = []
    alone = engine.solve_orbits(X, workers=1, progress=lambda *done: calls.append(done))
    assert calls[-1] == (40, 40)
    np.testing.assert_array_equal(alone["sizes"], engine.solve_orbits(X, workers=2)["sizes"])
    for i in (0, 7):
        one = engine.solve_orbits(X[i : i + 1])[0]
        np.testing.assert_array_equal(one["sizes"], alone[i]["sizes"])
        known = engine.solved(X[i])
        traced = jax.jit(engine.solved)(jnp.asarray(X[i]))
        np.testing.assert_array_equal(known, traced)


def test_derivatives_are_linear_in_the_direction_and_nan_if_not_requested():
    orbits = engine.solve_orbits(X)
    basis = np.broadcast_to(np.eye(WIDTH), (len(X), WIDTH, WIDTH))
    along = np.broadcast_to(np.linspace(0.1, 0.9, WIDTH), (len(X), 1, WIDTH))
    every = engine.orbit_slopes(X, orbits, basis, (0, 11))
    one = engine.orbit_slopes(X, orbits, along, (0, 3))[:, :, 0]
    there = np.isfinite(every[:, :, 0, 0])
    assert np.sum(there) > 10
    expected = np.einsum("nmds,d->nms", every, along[0, 0])
    np.testing.assert_allclose(one[there][:, :3], expected[there][:, :3], rtol=1e-10, atol=1e-12)
    assert np.all(np.isnan(one[:, :, SIZES["swing"] :]))
    i = int(np.argmax(there[:, 0]))
    alone = engine.slopes(X[i], engine.solved(X[i]), (0, 3))
    np.testing.assert_allclose(alone[0, :, :3], every[i, 0, :, :3], rtol=1e-12)


def test_a_single_row_instead_of_a_batch_is_rejected():
    with pytest.raises(ValueError, match=r"must have shape \(n,\), but the batch has shape \(\)"):
        engine.solve_orbits(X[0])


@pytest.mark.parametrize(
    "call",
    [
        lambda: engine.solve_orbits(X[:, :9]),
        lambda: engine.solved(X[0, :9]),
        lambda: engine.solved(jnp.asarray(X[0, :9])),
        lambda: engine.orbit_slopes(X[:1], engine.solve_orbits(X[:1]), np.eye(9)[None], (0, 3)),
        lambda: engine.vanishing(np.zeros(3), X[0, :9]),
    ],
)
def test_arrays_of_another_width_are_rejected(call):
    with pytest.raises(ValueError, match=r"parameters must have shape \(..., 10\), but have \(.*9"):
        call()
