"""Work that a batch can leave out because none of its members needs it.

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
    shapes = jax.eval_shape(function, *args)

    def nothing(*_: Any) -> Any:
        return jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), shapes)

    return jax.lax.cond(anywhere(flag), function, nothing, *args)
