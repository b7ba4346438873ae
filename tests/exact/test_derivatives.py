"""Derivatives that are known or refused, under every order of JAX's transformations."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tpd.exact.derivatives import refused, refused_in, with_slopes

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


def test_values_are_left_alone():
    np.testing.assert_array_equal(half_refused(X), X**2)
    assert stated(X) == 7.0
    np.testing.assert_array_equal(refused_in({"x": X}, X**2), X**2)


@pytest.mark.parametrize("derivative", [jax.jacfwd, jax.jacrev])
def test_a_refused_slope_is_nan_and_spoils_no_other(derivative):
    slopes = np.asarray(derivative(half_refused)(X))
    assert slopes[0, 0] == 4.0
    assert slopes[0, 1] == 0.0
    assert np.isnan(slopes[1, 1])
    np.testing.assert_array_equal(derivative(stated)(X), [5.0, np.nan])


def test_in_reverse_mode_what_is_not_asked_for_spoils_nothing():
    np.testing.assert_array_equal(jax.grad(lambda x: half_refused(x)[0])(X), [4.0, 0.0])
    assert np.isnan(jax.grad(lambda x: jnp.sum(half_refused(x)))(X)[1])


def test_in_forward_mode_what_does_not_move_spoils_nothing():
    _, slope = jax.jvp(stated, (X,), (jnp.array([1.0, 0.0]),))
    assert slope == 5.0
    _, slopes = jax.jvp(half_refused, (X,), (jnp.array([1.0, 0.0]),))
    np.testing.assert_array_equal(slopes, [4.0, np.nan])  # it may depend on what else it was made from


@pytest.mark.parametrize("first", [jax.jacfwd, jax.jacrev])
@pytest.mark.parametrize("then", [jax.jacfwd, jax.jacrev])
@pytest.mark.parametrize("function", [half_refused, stated])
def test_second_derivatives_are_nan_and_no_error(function, first, then):
    assert np.all(np.isnan(np.diagonal(then(first(function))(X), axis1=-2, axis2=-1)))
    batch = jax.jit(jax.vmap(then(first(function))))(jnp.stack([X, 2.0 * X]))
    assert np.all(np.isnan(np.diagonal(batch, axis1=-2, axis2=-1)))


@pytest.mark.parametrize("derivative", [jax.jacfwd, jax.jacrev])
def test_what_is_refused_in_a_pytree_is_refused_in_all_of_it(derivative):
    slopes = derivative(lambda x: refused_in({"a": x[0], "b": x[1:]}, jnp.ones(3)))(X)
    assert slopes.shape == (3, 2)
    assert np.all(np.isnan(slopes))
