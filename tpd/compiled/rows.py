"""Parameters as rows of numbers for compiled code, in the order of `tpd.scene.parameters.NAMES`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tpd.core import checks
from tpd.scene.parameters import NAMES, Parameters


def row_of(p: Parameters, *, piece: Any = None) -> Any:
    """Return the row of one set of parameters, or the rows of many, shape (..., 9).

    The result is a NumPy array, or a JAX array if JAX traces one of the numbers.

    Args:
        p: parameters. Arrays among them are broadcast against each other.
        piece: duration of a piece of a ground motion (tau), which replaces the frequency.
    """
    values = dict(zip(NAMES, p.numbers, strict=True))
    if piece is not None:
        values["xi"] = piece
    xp = checks.namespace(*values.values())
    return xp.stack(xp.broadcast_arrays(*(xp.asarray(values[name], dtype=float) for name in NAMES)), axis=-1)


def ground_row_of(p: Parameters) -> Any:
    """Return the row of the parameters that `Scene.ground_parameters` returns."""
    return row_of(p, piece=2.0 * np.pi / p.xi)


def packed(values: Iterable[Any]) -> Float[Array, "n"]:
    """Return numbers, some of which JAX may trace, as one array."""
    return jnp.stack([jnp.asarray(x, dtype=jnp.float64) for x in values])
