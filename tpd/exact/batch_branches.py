"""Work that can be left out: by a batch because none of its members needs it, or because it is done.

Under `vmap` a `cond` computes both sides and a loop computes and selects until the slowest member is
through. What is asked of the whole batch is one number again, and a branch is one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool


@jax.custom_batching.custom_vmap
def anywhere(flag: Bool[Array, ""]) -> Bool[Array, ""]:
    """Whether `flag` is true for any member of the batch. Nothing that is kept may depend on it."""
    return flag


@anywhere.def_vmap
def _anywhere_batched(_: int, batched: list[bool], flag: Array) -> tuple[Array, bool]:
    return anywhere(jnp.any(flag, axis=0) if batched[0] else flag), False


def where_needed(flag: Bool[Array, ""], function: Callable[..., Any], *args: Any) -> Any:
    """`function(*args)` where `flag` is true; elsewhere it may be that, or zeros."""
    # The flag is asked of the whole batch, so that under `vmap` the branch stays a branch: the function costs
    # nothing where no member needs it, and is computed for all where one does.
    # Python goes through it once, for the shapes and for the branch.
    traced = jax.jit(function)
    shapes = jax.eval_shape(traced, *args)

    def nothing(*_: Any) -> Any:
        return jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), shapes)

    return jax.lax.cond(anywhere(flag), traced, nothing, *args)


def computed_once(*trees: Any) -> Any:
    """Store pytrees of single numbers before anything is made of them.

    Otherwise the compiler computes a number, and its derivatives, anew for everything that it is in. It
    looks through all but a product of matrices: hence the one with the identity. What is not finite in one
    number is NaN in all.
    """
    leaves, structure = jax.tree.flatten(trees)
    flat = jnp.stack([jnp.asarray(x) for x in leaves])
    stored = flat @ jnp.eye(flat.size)
    return jax.tree.unflatten(structure, [stored[i] for i in range(flat.size)])
