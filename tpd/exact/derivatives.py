"""Derivatives that are known, or refused: exact to the first order, and NaN beyond that."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from tpd.parameters import Number


@jax.custom_jvp
def refused(value: Array, usable: Bool[Array, ""]) -> Array:
    """`value`, whose derivative is NaN unless `usable`."""
    del usable
    return value


@refused.defjvp
def _refused_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    value, usable = primals
    return value, _scaled(jnp.where(usable, 1.0, jnp.nan), tangents[0] * _once(value))


@jax.custom_jvp
def with_slopes(p: Float[Array, "n"], value: Number, slopes: Float[Array, "n"]) -> Number:
    """`value`, known to depend on `p` with these slopes."""
    del p, slopes
    return value


@with_slopes.defjvp
def _with_slopes_jvp(primals: tuple, tangents: tuple) -> tuple[Number, Number]:
    p, value, slopes = primals
    return value, jnp.sum(_scaled(slopes, tangents[0] * _once(p)))


def _scaled(factor: Array, direction: Array) -> Array:
    """`factor * direction`; in reverse mode a factor that is NaN spoils only what asks for it, which
    a weight of zero does not."""

    def along(_: object, direction: Array) -> Array:
        return factor * direction

    def back(_: object, weight: Array) -> Array:
        return jnp.where(weight == 0.0, 0.0, factor * weight)

    # JAX's one linear map that takes its transpose as stated.
    return jax.lax.custom_linear_solve(lambda x: x, direction, along, back)


@jax.custom_jvp
def _once(x: Array) -> Array:
    """One, with a derivative of NaN."""
    return jnp.ones_like(x)


@_once.defjvp
def _once_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    return _once(*primals), jnp.nan * tangents[0]
