"""Derivatives that are known or refused, under every order of JAX's transformations."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tpd.compiled.derivatives import joined, once, refused, with_slopes

X = jnp.array([2.0, 3.0])
USABLE = jnp.array([True, False])


@jax.jit
def half_refused(x):
    """x^2 of both numbers, one by one as a batch; the slope of the second is refused."""
    return jax.vmap(refused)(x**2, USABLE)


@jax.jit
def stated(x):
    """A number of which slopes (5, NaN) are stated."""
    return with_slopes(x, jnp.asarray(7.0), jnp.array([5.0, jnp.nan]))


@pytest.mark.parametrize("derivative", [jax.jacfwd, jax.jacrev])
def test_a_rejected_derivative_is_nan_and_changes_neither_values_nor_other_derivatives(derivative):
    np.testing.assert_array_equal(half_refused(X), X**2)
    assert stated(X) == 7.0
    slopes = np.asarray(derivative(half_refused)(X))
    np.testing.assert_array_equal(slopes[0], [4.0, 0.0])
    assert np.isnan(slopes[1, 1])
    np.testing.assert_array_equal(derivative(stated)(X), [5.0, np.nan])


def test_a_motionless_row_does_not_affect_other_rows():
    assert np.isnan(jax.grad(lambda x: jnp.sum(half_refused(x)))(X)[1])
    assert jax.jvp(stated, (X,), (jnp.array([1.0, 0.0]),))[1] == 5.0


@pytest.mark.parametrize("first", [jax.jacfwd, jax.jacrev])
@pytest.mark.parametrize("then", [jax.jacfwd, jax.jacrev])
@pytest.mark.parametrize("function", [half_refused, stated])
def test_second_derivatives_are_nan(function, first, then):
    batch = jax.jit(jax.vmap(then(first(function))))(jnp.stack([X, 2.0 * X]))
    assert np.all(np.isnan(np.diagonal(batch, axis1=-2, axis2=-1)))


@pytest.mark.parametrize("traced", [False, True])
def test_each_result_has_a_separate_derivative(traced):
    numbers = (np.array([1.0, 2.0]), 3.0)
    slopes = (np.array([[4.0, 5.0], [np.nan, 0.0]]), np.array([6.0, 7.0]))
    if traced:
        numbers, slopes = jax.tree.map(jnp.asarray, (numbers, slopes))

    def both(a, b):
        return joined((a, b), numbers, tuple(slope.__getitem__ for slope in slopes))

    by_a, by_b = jax.jacfwd(both, argnums=(0, 1))(*X)[0]
    np.testing.assert_array_equal(by_a, [4.0, 5.0])
    np.testing.assert_array_equal(by_b, [np.nan, 0.0])
    assert jax.grad(lambda a: both(a, X[1])[1])(X[0]) == 6.0


def test_computed_derivatives_cannot_be_differentiated_again():
    slopes = once(lambda x: (2.0 * x, x[0]))
    np.testing.assert_array_equal(slopes(X)[0], 2.0 * X)
    assert np.all(np.isnan(jax.jacfwd(lambda x: slopes(x)[0])(X)))
