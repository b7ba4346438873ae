"""Derivatives that are known, or refused: exact to the first order, and NaN beyond that."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import Primitive
from jax.flatten_util import ravel_pytree
from jax.interpreters import ad, batching, mlir
from jaxtyping import Array, Bool, Float


@jax.custom_jvp
def refused(value: Array, usable: Bool[Array, "..."]) -> Array:
    """`value`, whose derivative is NaN unless `usable`."""
    del usable
    return value


@refused.defjvp
def _refused_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    value, usable = primals
    return value, _scaled(jnp.where(usable, 1.0, jnp.nan), tangents[0], value)


def refused_in(p: Any, value: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """`value`, which depends on the pytree `p` with a derivative that is not known: NaN."""
    flat = ravel_pytree(p)[0]
    return with_slopes(flat, value, jnp.full((*value.shape, flat.size), jnp.nan))


@jax.custom_jvp
def with_slopes(
    p: Float[Array, "n"], value: Float[Array, "*shape"], slopes: Float[Array, "*shape n"]
) -> Float[Array, "*shape"]:
    """`value`, known to depend on `p` with these slopes."""
    del p, slopes
    return value


@with_slopes.defjvp
def _with_slopes_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    p, value, slopes = primals
    return value, moved(slopes, tangents[0], p)


def moved(
    slopes: Float[Array | np.ndarray, "*shape n"],
    direction: Float[Array | np.ndarray, "n"],
    point: Float[Array | np.ndarray, "n"],
) -> Float[Array, "*shape"]:
    """How much something with these slopes moves in a direction. A slope of NaN spoils no direction but its
    own, and in reverse mode no other quantity; derivatives as `point` moves are NaN."""
    return jnp.sum(_scaled(slopes, direction, point, spared=True), axis=-1)


def once(function: Callable[..., Any]) -> Callable[..., Any]:
    """`function` of arrays, whose derivatives are NaN: what it computes are derivatives already."""

    @jax.custom_jvp
    def computed(*operands: Any) -> Any:
        return function(*operands)

    @computed.defjvp
    def _(primals: tuple, tangents: tuple) -> tuple[Any, Any]:
        out = computed(*primals)
        unknown = jnp.nan * sum(jnp.sum(t) for t in tangents)
        return out, jax.tree.map(lambda x: jnp.ones_like(x) * unknown, out)

    return computed


def _scaled(factor: Any, direction: Any, point: Any, *, spared: bool = False) -> Array:
    """`factor * direction`, whose own derivative as `point` moves is NaN. If `spared`, a direction of
    zero is spoilt by no factor that is NaN; in reverse mode the same holds of a weight of zero."""
    arrays = jnp.broadcast_arrays(factor, direction, point)
    return _scaled_p.bind(*arrays, spared=spared, spared_back=True)


def _product(factor: Array, x: Array, _: Array, *, spared: bool, spared_back: bool) -> Array:
    del spared_back
    return jnp.where(x == 0.0, 0.0, factor * x) if spared else factor * x


def _transposed(weight: Any, factor: Array, _: Any, point: Array, *, spared: bool, spared_back: bool) -> list:
    if isinstance(weight, ad.Zero):
        return [None, weight, None]
    return [None, _scaled_p.bind(factor, weight, point, spared=spared_back, spared_back=spared), None]


def _batched(args: tuple, axes: tuple, **spared: bool) -> tuple[Array, int]:
    size = next(x.shape[axis] for x, axis in zip(args, axes, strict=True) if axis is not None)
    same = [
        jnp.broadcast_to(x, (size, *x.shape)) if axis is None else jnp.moveaxis(x, axis, 0)
        for x, axis in zip(args, axes, strict=True)
    ]
    return _scaled_p.bind(*same, **spared), 0


# A derivative that does not exist has to be NaN in forward and in reverse mode, for batches and for second
# derivatives. `where` and `stop_gradient` do not do that: reverse mode multiplies the NaN of one output into
# the zeros of all others. Hence a primitive with rules of its own for weights of zero. A linear map whose
# transpose is not quite itself: no function of JAX's states that.
_scaled_p = Primitive("scaled")
_scaled_p.def_impl(_product)
_scaled_p.def_abstract_eval(lambda factor, x, point, **_: x)
mlir.register_lowering(_scaled_p, mlir.lower_fun(_product, multiple_results=False))
ad.defjvp(
    _scaled_p,
    None,
    lambda moved, factor, _, point, **spared: _scaled_p.bind(factor, moved, point, **spared),
    lambda moved, factor, x, _, **__: jnp.nan * moved,
)
ad.primitive_transposes[_scaled_p] = _transposed
batching.primitive_batchers[_scaled_p] = _batched
