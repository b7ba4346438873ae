"""Parameters as rows of numbers for compiled code, in the order of `tpd.scene.parameters.NAMES`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tpd.core import checks
from tpd.scene.parameters import Parameters, unchecked


def row_of(p: Parameters) -> Any:
    """Return the row of one set of parameters, or the rows of many, shape (..., 10).

    The result is a NumPy array, or a JAX array if JAX traces one of the numbers.

    Args:
        p: parameters. Arrays among them are broadcast against each other.
    """
    xp = checks.namespace(*p.numbers)
    return xp.stack(xp.broadcast_arrays(*(xp.asarray(x, dtype=float) for x in p.numbers)), axis=-1)


def ground_row_of(p: Parameters, *, size: Any = None, piece: Any = None) -> Any:
    """Return the row of parameters under a ground motion, or the rows of many, as `row_of` does.

    Args:
        p: result of `Scene.ground_parameters`.
        size: factor on the ground motion, or factors; None for the motion as it is.
        piece: duration of a piece of the ground motion (tau), if `p` has the one of another motion.
    """
    # In a row under a ground motion the duration of a piece replaces the frequency.
    piece = 2.0 * np.pi / p.xi if piece is None else piece
    return row_of(unchecked(p, f=p.f if size is None else p.f * size, xi=piece))


def packed(values: Iterable[Any]) -> Float[Array, "n"]:
    """Return numbers, some of which JAX may trace, as one array."""
    return jnp.stack([jnp.asarray(x, dtype=jnp.float64) for x in values])
