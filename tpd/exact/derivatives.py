"""Derivatives that are known, or refused: exact to the first order, and NaN beyond that."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
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
    (value, usable), (tangent, _) = primals, tangents
    return value, _scaled(jnp.where(usable, 1.0, jnp.nan), tangent, value)


def refused_in(p: Any, value: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """`value`, which depends on the pytree `p` with a derivative that is not known: NaN."""
    flat, _ = ravel_pytree(p)
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
    (p, value, slopes), (direction, *_) = primals, tangents
    return value, moved(slopes, direction, p)


def moved(
    slopes: Float[Array | np.ndarray, "*shape n"],
    direction: Float[Array | np.ndarray, "n"],
    point: Float[Array | np.ndarray, "n"],
) -> Float[Array, "*shape"]:
    """How much something with these slopes moves in a direction. A slope of NaN spoils no direction but its
    own, and in reverse mode no other quantity; derivatives as `point` moves are NaN."""
    return jnp.sum(_scaled(slopes, direction, point, spared=True), axis=-1)


def joined(values: tuple, numbers: tuple, slopes: tuple) -> tuple:
    """`numbers`, each known to depend on the scalars `values` with slopes of its own, one for each of them in
    the first axis."""
    if not all(isinstance(x, (float, np.ndarray)) for x in jax.tree.leaves((numbers, slopes))):
        return _joined(values, numbers, slopes)
    # JAX makes zero derivatives of all that a function is given: where numbers are known, and a derivative is
    # taken at once, they are kept from it.
    with_rule = jax.custom_jvp(lambda *values: numbers)
    with_rule.defjvp(lambda primals, tangents: (numbers, _moves(primals, tangents, numbers, slopes)))
    return with_rule(*values)


@jax.custom_jvp
def _joined(values: tuple, numbers: tuple, slopes: tuple) -> tuple:
    del values, slopes
    return numbers


@_joined.defjvp
def _joined_jvp(primals: tuple, tangents: tuple) -> tuple[tuple, tuple]:
    (values, numbers, slopes), (directions, *_) = primals, tangents
    return numbers, _moves(values, directions, numbers, slopes)


def _moves(values: tuple, directions: tuple, numbers: tuple, slopes: tuple) -> tuple:
    # Second derivatives are NaN, in whatever value they are taken.
    point = sum(values)

    def move(number: Any, by: Any) -> Array:
        def wide(x: Any) -> Any:
            return jnp.broadcast_to(x, jnp.shape(number)) if jnp.ndim(number) else x

        scaled = partial(_scaled_p.bind, spared=True, spared_back=True)
        first, *others = [scaled(b, wide(t), wide(point)) for b, t in zip(by, directions, strict=True)]
        return sum(others, first)

    return tuple(map(move, numbers, slopes))


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


def _product(factor: Any, x: Any, _: Any, *, spared: bool, spared_back: bool) -> Array:
    del spared_back
    return jnp.where(x == 0.0, 0.0, factor * x) if spared else factor * x


def _transposed(weight: Any, factor: Any, _: Any, point: Any, *, spared: bool, spared_back: bool) -> list:
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
