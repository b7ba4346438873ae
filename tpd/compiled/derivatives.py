"""Rules for derivatives in JAX: computed by compiled code, or NaN where they do not exist.

All of them are exact to the first order. Second derivatives are NaN.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir
from jax.lax import stop_gradient
from jaxtyping import Array, Bool, Float

from tpd.compiled.rows import packed
from tpd.core import checks


@jax.custom_jvp
def refused(value: Array, usable: Bool[Array, "..."]) -> Array:
    """Return `value`. Its derivative is NaN unless `usable`."""
    del usable
    return value


@refused.defjvp
def _refused_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    (value, usable), (tangent, _) = primals, tangents
    return value, _scaled(jnp.where(usable, 1.0, jnp.nan), tangent, value)


@jax.custom_jvp
def with_slopes(
    p: Float[Array, "n"], value: Float[Array, "*shape"], slopes: Float[Array, "*shape n"]
) -> Float[Array, "*shape"]:
    """Return `value`, which depends on `p` with the derivatives `slopes`."""
    del p, slopes
    return value


@with_slopes.defjvp
def _with_slopes_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    (p, value, slopes), (direction, *_) = primals, tangents
    return value, moved(slopes, direction, p)


def unknown_in(point: Any) -> Any:
    """Return zero, whose derivatives in the numbers of an array are NaN."""
    return with_slopes(point.ravel(), jnp.zeros(()), jnp.full(point.size, jnp.nan))


def moved(
    slopes: Float[Array | np.ndarray, "*shape n"],
    direction: Float[Array | np.ndarray, "n"],
    point: Float[Array | np.ndarray, "n"],
) -> Float[Array, "*shape"]:
    """Return the derivative of a quantity in a direction, from its derivatives `slopes` at `point`.

    A derivative that is NaN only affects its own direction, and in reverse mode only its own quantity. The
    second derivatives are NaN.
    """
    return jnp.sum(_scaled(slopes, direction, point, keep_zeros=True), axis=-1)


def primal(values: Sequence[Any]) -> Any:
    """Return numbers without their tangents as one array.

    The array is one of NumPy if no number is traced otherwise, so that no JAX program is needed.
    """
    if all(isinstance(x, float) for x in values):
        return np.array(values)
    fixed = [x if checks.is_concrete(x) else stop_gradient(x) for x in values]
    return np.array(fixed, dtype=float) if all(map(checks.is_concrete, fixed)) else packed(fixed)


def joined(values: Sequence[Any], numbers: tuple, slopes: Sequence[Callable[[int], Any]]) -> tuple:
    """Return `numbers`, which depend on the numbers `values`.

    The derivatives of a number in value i are what its function in `slopes` returns for i.
    """
    # Only values that are traced need derivatives.
    traced = [i for i, x in enumerate(values) if not checks.is_concrete(x)]
    if not traced:
        return numbers
    values = tuple(jnp.asarray(values[i], dtype=jnp.float64) for i in traced)
    rows = tuple([slope(i) for i in traced] for slope in slopes)
    if not all(isinstance(x, (float, np.ndarray)) for x in jax.tree.leaves((numbers, rows))):
        return _joined(values, numbers, rows)
    # JAX creates zero derivatives for all arguments of a function. If nothing is traced and a derivative is
    # taken at once, the numbers are not passed as arguments, which is faster.
    with_rule = jax.custom_jvp(lambda *values: numbers)
    with_rule.defjvp(lambda primals, tangents: (numbers, _moves(primals, tangents, numbers, rows)))
    return with_rule(*values)


@jax.custom_jvp
def _joined(values: tuple, numbers: tuple, slopes: tuple) -> tuple:
    """Return `numbers`, as `joined` does, if JAX traces some of the arguments."""
    del values, slopes
    return numbers


@_joined.defjvp
def _joined_jvp(primals: tuple, tangents: tuple) -> tuple[tuple, tuple]:
    (values, numbers, slopes), (directions, *_) = primals, tangents
    return numbers, _moves(values, directions, numbers, slopes)


def _moves(values: tuple, directions: tuple, numbers: tuple, slopes: tuple) -> tuple:
    """Return the changes of `numbers` in the given directions."""
    # The dependence on the point makes second derivatives NaN.
    point = sum(values)

    def move(number: Any, by: Any) -> Array:
        def wide(x: Any) -> Any:
            return jnp.broadcast_to(x, jnp.shape(number)) if jnp.ndim(number) else x

        scaled = partial(_scaled_p.bind, keep_zeros=True, keep_back=True)
        first, *others = [scaled(b, wide(t), wide(point)) for b, t in zip(by, directions, strict=True)]
        return sum(others, first)

    return tuple(map(move, numbers, slopes))


def once(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of arrays whose derivatives are NaN, because its results are derivatives already."""

    @jax.custom_jvp
    def computed(*operands: Any) -> Any:
        return function(*operands)

    @computed.defjvp
    def _(primals: tuple, tangents: tuple) -> tuple[Any, Any]:
        out = computed(*primals)
        unknown = jnp.nan * sum(jnp.sum(t) for t in tangents)
        return out, jax.tree.map(lambda x: jnp.ones_like(x) * unknown, out)

    return computed


def _scaled(factor: Any, direction: Any, point: Any, *, keep_zeros: bool = False) -> Array:
    """Return `factor * direction`, whose own derivative in `point` is NaN.

    If `keep_zeros`, a direction of zero gives zero even if the factor is NaN. In reverse mode the same holds
    for a weight of zero.
    """
    arrays = jnp.broadcast_arrays(factor, direction, point)
    return _scaled_p.bind(*arrays, keep_zeros=keep_zeros, keep_back=True)


def _product(factor: Any, x: Any, _: Any, *, keep_zeros: bool, keep_back: bool) -> Array:
    """Return the product. Zero times NaN is zero if `keep_zeros`."""
    del keep_back
    return jnp.where(x == 0.0, 0.0, factor * x) if keep_zeros else factor * x


def _transposed(weight: Any, factor: Any, _: Any, point: Any, *, keep_zeros: bool, keep_back: bool) -> list:
    """Return the transpose of the product. `keep_back` is the rule for zeros in reverse mode."""
    if isinstance(weight, ad.Zero):
        return [None, weight, None]
    return [None, _scaled_p.bind(factor, weight, point, keep_zeros=keep_back, keep_back=keep_zeros), None]


def _batched(args: tuple, axes: tuple, **keep_zeros: bool) -> tuple[Array, int]:
    """Return the product of a batch."""
    size = next(x.shape[axis] for x, axis in zip(args, axes, strict=True) if axis is not None)
    same = [
        jnp.broadcast_to(x, (size, *x.shape)) if axis is None else jnp.moveaxis(x, axis, 0)
        for x, axis in zip(args, axes, strict=True)
    ]
    return _scaled_p.bind(*same, **keep_zeros), 0


# A derivative that does not exist must be NaN in forward and in reverse mode, for batches and for second
# derivatives. `where` and `stop_gradient` are not enough: reverse mode multiplies the NaN of one output by
# the zeros of all others. Hence this primitive, which has rules of its own for weights of zero. It is a
# linear map whose transpose differs a little from the map itself, which no function of JAX can express.
_scaled_p = Primitive("scaled")
_scaled_p.def_impl(_product)
_scaled_p.def_abstract_eval(lambda factor, x, point, **_: x)
mlir.register_lowering(_scaled_p, mlir.lower_fun(_product, multiple_results=False))
ad.defjvp(
    _scaled_p,
    None,
    lambda moved, factor, _, point, **keep_zeros: _scaled_p.bind(factor, moved, point, **keep_zeros),
    lambda moved, factor, x, _, **__: jnp.nan * moved,
)
ad.primitive_transposes[_scaled_p] = _transposed
batching.primitive_batchers[_scaled_p] = _batched
